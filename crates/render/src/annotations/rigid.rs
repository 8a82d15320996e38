//! Rigid part of a copy's placement: where it stands and how it is turned.
//!
//! A placement's linear part A is a rotation R after a symmetric stretch (the polar decomposition), which Newton's
//! iteration X ← (X + X⁻ᵀ) / 2 finds (N. J. Higham, "Computing the polar decomposition — with applications", 1986). The
//! stretch belongs to the model; what mirrors is a mirrored model.

use std::collections::BTreeMap;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Transform};
use xxhash_rust::xxh3::Xxh3Default;

use super::Pose;

/// Shapes whose numbers differ by less than about this share of their size are one model: far above what rounding makes
/// of the same shape in another place, far below what a picture tells. No multiple of a short decimal fraction lies on
/// a border between two steps of π times a power of ten.
const STEP: f64 = std::f64::consts::PI * 1e-7;

/// Newton's iteration ends within ten steps for all but nearly flat maps.
const STEPS: usize = 100;

/// The frame of a copy: its rotation, and its origin as a place in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct RigidFrame {
    pub(super) rotation: DMat3,
    /// Its own place is that of the first of its placements.
    origin: Transform,
}

impl RigidFrame {
    /// That of the placements of one copy at `time` (s from the frame's time); `None` where none has a volume.
    pub(super) fn of(geometry: &Geometry, placements: &[usize], time: f64) -> Option<Self> {
        placements.iter().find_map(|&index| {
            let origin = geometry.placements[index].world_from_mesh_at(time);
            Some(Self { rotation: rotation_of(origin.linear)?, origin })
        })
    }

    /// The model's origin in the world (m).
    pub(super) fn translation(&self) -> DVec3 {
        self.origin.translation + self.origin.translation_low
    }

    /// A point of a mesh that `placed` carries into the world, in the model's frame (m).
    pub(super) fn point(&self, placed: &Transform, point: DVec3) -> DVec3 {
        let offset = self.offset(placed);
        self.rotation.transpose() * (placed.linear * point) + offset
    }

    /// The origin of `placed` in the model's frame (m).
    fn offset(&self, placed: &Transform) -> DVec3 {
        let apart = placed.offset_from(self.origin.translation) - self.origin.translation_low;
        self.rotation.transpose() * apart
    }

    /// The pose of the copy of these placements.
    pub(super) fn pose(&self, geometry: &Geometry, placements: &[usize], time: f64) -> Pose {
        let rows = self.rotation.transpose().to_cols_array_2d();
        let model = self.model(geometry, placements, time);
        Pose { rotation: rows, translation: self.translation().to_array(), model }
    }

    /// A word for the shape: meshes, materials, and where each stands in the model's frame, in steps.
    fn model(&self, geometry: &Geometry, placements: &[usize], time: f64) -> String {
        let mut hash = Xxh3Default::new();
        let size = self.origin.linear.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut add = |value: f64| hash.update(&(value / STEP).round().to_le_bytes());
        add(size.ln());
        for &index in placements {
            let placement = &geometry.placements[index];
            let placed = placement.world_from_mesh_at(time);
            let mesh = geometry.mesh_of(placement);
            let extent = (size * mesh.bounds.diagonal()).max(f64::MIN_POSITIVE);
            let linear = self.rotation.transpose() * placed.linear;
            linear.to_cols_array().into_iter().for_each(|x| add(x / size));
            (self.offset(&placed) / extent).to_array().into_iter().for_each(&mut add);
            let counts = [placement.mesh, placement.material].map(f64::from);
            counts.into_iter().for_each(|count| add(count * STEP));
            add(mesh.triangles.len() as f64 * STEP);
            let corners = [mesh.bounds.min, mesh.bounds.max].map(|corner| corner * size / extent);
            corners.iter().flat_map(|corner| corner.to_array()).for_each(&mut add);
        }
        format!("{:016x}", hash.digest())
    }
}

/// The placements of each copy by its index.
pub(super) fn copies(geometry: &Geometry) -> BTreeMap<u32, Vec<usize>> {
    let mut copies: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, placement) in geometry.placements.iter().enumerate() {
        copies.entry(placement.instance).or_default().push(index);
    }
    copies
}

/// The proper rotation of a map's polar decomposition; `None` where the map is flat.
fn rotation_of(linear: DMat3) -> Option<DMat3> {
    let size = linear.to_cols_array().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let mut x = linear * size.recip();
    if !x.is_finite() || x.determinant().abs() < f64::EPSILON {
        return None;
    }
    for _ in 0..STEPS {
        let next = (x + x.inverse().transpose()) * 0.5;
        let change = (next - x).to_cols_array().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        x = next;
        if change < 4.0 * f64::EPSILON {
            break;
        }
    }
    Some(if x.determinant() < 0.0 { -x } else { x })
}

#[cfg(test)]
mod tests {
    use etendue_geometry::glam::{DQuat, EulerRot};

    use super::*;

    #[test]
    fn turns_and_stretches_come_apart() {
        let turn = DMat3::from_quat(DQuat::from_euler(EulerRot::XYZ, 0.7, -1.9, 2.6));
        let shear = DMat3::from_cols_array(&[2.0, 0.3, 0.0, 0.3, 0.5, -0.2, 0.0, -0.2, 7.0]);
        for stretch in [DMat3::IDENTITY, shear, shear * 1e-9, shear * 1e9, -shear] {
            let found = rotation_of(turn * stretch).unwrap();
            let off = (found - turn).to_cols_array().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            // Roundings of numbers up to 1, which a stretch of 14 to 1 makes larger.
            assert!(off < 1e-14, "{stretch:?}: {off}");
        }
        assert!(rotation_of(DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0))).is_none());
    }
}
