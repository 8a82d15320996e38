//! Models as BOP has them: PLY files in millimetres, their boxes and diameters.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use etendue_files::Transaction;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry};
use etendue_scene::Scene;
use serde_json::{Value, json};

use super::rigid::{RigidFrame, copies};
use crate::output::OutputError;

/// Millimetres a metre.
pub(super) const MM: f64 = 1000.0;

/// Greatest excess of the diameter over what was found, as a share.
const DIAMETER_TOLERANCE: f64 = 1e-6;

/// Points that are compared one by one.
const FEW: usize = 16;

/// The models of a data set, by the words that poses call them by.
#[derive(Debug, Clone, Default)]
pub struct Models {
    models: BTreeMap<String, ModelSource>,
}

/// Geometry that a model is made from.
#[derive(Debug, Clone)]
struct ModelSource {
    geometry: Arc<Geometry>,
    placements: Vec<usize>,
    time: f64,
}

/// The corners and triangles of a model.
struct Solid {
    /// In millimetres.
    corners: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Models {
    /// Adds those of a scene that are not there yet.
    pub fn add(&mut self, scene: &Scene) {
        let (geometry, time) = (&scene.geometry, truth_time(scene));
        for placements in copies(geometry).into_values() {
            let Some(frame) = RigidFrame::of(geometry, &placements, time) else { continue };
            let name = frame.pose(geometry, &placements, time).model;
            let geometry = Arc::clone(geometry);
            self.models.entry(name).or_insert(ModelSource { geometry, placements, time });
        }
    }

    /// Writes the model called `name` to `path`, and gives its entry of `models_info.json`.
    pub(super) fn write(
        &self,
        name: &str,
        files: &Transaction,
        path: &Path,
    ) -> Result<Value, OutputError> {
        let unknown = || OutputError::format(path, format!("no model {name} is in the scene"));
        let solid = self.models.get(name).and_then(ModelSource::solid).ok_or_else(unknown)?;
        files.write(path, |part| solid.write(BufWriter::new(part)))?;
        Ok(solid.info())
    }
}

/// Time at which data layers see the middle row (s from the frame's time).
pub(super) fn truth_time(scene: &Scene) -> f64 {
    let [_, rows] = scene.camera.resolution();
    scene.camera.truth_time(0.5 * f64::from(rows))
}

impl ModelSource {
    fn solid(&self) -> Option<Solid> {
        let frame = RigidFrame::of(&self.geometry, &self.placements, self.time)?;
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for &index in &self.placements {
            let placement = &self.geometry.placements[index];
            let placed = placement.world_from_mesh_at(self.time);
            let mesh = self.geometry.mesh_of(placement);
            let is_mirrored = placed.handedness() < 0.0;
            // What no triangle uses may be anything.
            let mut number = vec![u32::MAX; mesh.positions.len()];
            for triangle in mesh.triangles.iter() {
                let mut own = triangle.map(|corner| {
                    let number = &mut number[corner as usize];
                    if *number == u32::MAX {
                        *number = u32::try_from(corners.len()).unwrap_or(u32::MAX);
                        let point = mesh.positions.get(corner as usize);
                        corners.push(frame.point(&placed, point) * MM);
                    }
                    *number
                });
                if is_mirrored {
                    own.swap(1, 2);
                }
                triangles.push(own);
            }
        }
        (!corners.is_empty()).then_some(Solid { corners, triangles })
    }
}

impl Solid {
    /// The normals of corners: means of those of their triangles by area.
    fn normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.corners.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|corner| self.corners[corner as usize]);
            let normal = (b - a).cross(c - a);
            triangle.iter().for_each(|&corner| normals[corner as usize] += normal);
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    fn write(&self, mut file: impl Write) -> io::Result<()> {
        let (corners, faces) = (self.corners.len(), self.triangles.len());
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\ncomment millimetres\nelement vertex {corners}\nproperty float \
             x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement \
             face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
        )?;
        for (corner, normal) in self.corners.iter().zip(self.normals()) {
            for value in corner.to_array().into_iter().chain(normal.to_array()) {
                #[expect(clippy::cast_possible_truncation, reason = "the format's precision")]
                file.write_all(&(value as f32).to_le_bytes())?;
            }
        }
        for triangle in &self.triangles {
            file.write_all(&[3])?;
            triangle.iter().try_for_each(|corner| file.write_all(&corner.to_le_bytes()))?;
        }
        file.flush()
    }

    /// As `models_info.json` has it (mm).
    fn info(&self) -> Value {
        let Bounds { min, max } = Bounds::of_points(self.corners.iter().copied());
        let size = max - min;
        json!({
            "diameter": diameter(&self.corners),
            "min_x": min.x, "min_y": min.y, "min_z": min.z,
            "size_x": size.x, "size_y": size.y, "size_z": size.z,
        })
    }
}

/// A box of points in a tree of them.
struct PointTree {
    bounds: Bounds,
    points: Vec<DVec3>,
    halves: Option<Box<[Self; 2]>>,
}

impl PointTree {
    fn of(mut points: Vec<DVec3>) -> Self {
        let bounds = Bounds::of_points(points.iter().copied());
        if points.len() <= FEW {
            return Self { bounds, points, halves: None };
        }
        let size = bounds.max - bounds.min;
        let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
        let middle = points.len() / 2;
        points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        let right = points.split_off(middle);
        Self {
            bounds,
            points: Vec::new(),
            halves: Some(Box::new([Self::of(points), Self::of(right)])),
        }
    }

    /// No two points of both are farther apart.
    fn bound(&self, other: &Self) -> f64 {
        let across = (self.bounds.max - other.bounds.min).abs();
        across.max((other.bounds.max - self.bounds.min).abs()).length()
    }

    /// The longest distance between points of both, where it is longer than `best` by more than the tolerance.
    fn longest(&self, other: &Self, best: &mut f64) {
        if self.bound(other) <= *best * (1.0 + DIAMETER_TOLERANCE) {
            return;
        }
        match (&self.halves, &other.halves) {
            (None, None) => {
                for a in &self.points {
                    *best = other.points.iter().fold(*best, |best, b| best.max(a.distance(*b)));
                }
            }
            (Some(halves), _) if other.halves.is_none() || self.is_larger_than(other) => {
                let [near, far] = &**halves;
                let pair =
                    if near.bound(other) > far.bound(other) { [near, far] } else { [far, near] };
                pair.iter().for_each(|half| half.longest(other, best));
            }
            _ => other.longest(self, best),
        }
    }

    fn is_larger_than(&self, other: &Self) -> bool {
        self.bounds.diagonal() >= other.bounds.diagonal()
    }
}

/// The longest distance between two of `points`, to a millionth: of pairs of boxes those are passed over that reach no
/// farther than what was found.
fn diameter(points: &[DVec3]) -> f64 {
    let root = PointTree::of(points.to_vec());
    let mut best = 0.0;
    root.longest(&root, &mut best);
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diameters_are_those_of_all_pairs() {
        let mut state = 3_u32;
        let mut number = || {
            state = state.wrapping_mul(0x0019_660d).wrapping_add(0x3c6e_f35f);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        for count in [1, 2, 17, 900] {
            let points: Vec<DVec3> =
                (0..count).map(|_| DVec3::new(3.0 * number(), number(), 0.1 * number())).collect();
            let all = points.iter().flat_map(|a| points.iter().map(|b| a.distance(*b)));
            let expected = all.fold(0.0, f64::max);
            let found = diameter(&points);
            assert!((expected - found).abs() <= DIAMETER_TOLERANCE * expected, "{count}: {found}");
        }
    }

    #[test]
    fn the_diameter_of_a_sphere_is_found_without_all_pairs() {
        let golden = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
        let points: Vec<DVec3> = (0..200_000)
            .map(|i| {
                let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 200_000.0;
                let (sin, cos) = (golden * f64::from(i)).sin_cos();
                let ring = (1.0 - z * z).sqrt();
                DVec3::new(ring * cos, ring * sin, z)
            })
            .collect();
        // Some pair of so many points is within 1e-5 of being opposite.
        assert!((diameter(&points) - 2.0).abs() < 1e-5);
    }
}
