//! One mesh or instance, before it is attached to a scene.
//!
//! Also the choice which placements are instances of a scene of their own, and which are baked into one.

use std::collections::HashSet;
use std::ptr::NonNull;

use embree4_sys as sys;
use rayon::prelude::*;

use super::device::{Device, SceneHandle};
use crate::{BuildError, BuildOptions};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    AreaTest, Bounds, Geometry, MISS, Mesh, Placement, Positions, Transform, Vertices,
};

/// One mesh or instance, before it is attached to a scene.
pub(super) struct EmbreeGeometry {
    pub(super) handle: NonNull<sys::RTCGeometryTy>,
    pub(super) copied_bytes: u64,
}

impl EmbreeGeometry {
    fn new(
        device: &Device,
        kind: sys::RTCGeometryType,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        // SAFETY: the device is live.
        let handle = unsafe { sys::rtcNewGeometry(device.handle.as_ptr(), kind) };
        device.check("rtcNewGeometry")?;
        let Some(handle) = NonNull::new(handle) else {
            return Err(BuildError::Library {
                call: "rtcNewGeometry",
                message: "no geometry".to_owned(),
            });
        };
        // SAFETY: the geometry was just made and is ours alone.
        unsafe { sys::rtcSetGeometryBuildQuality(handle.as_ptr(), options.quality.to_embree()) };
        Ok(Self { handle, copied_bytes: 0 })
    }

    /// The triangles of `mesh`, moved by `to_frame`; the buffers are shared when nothing moves them
    /// and every triangle has an area. `None` when none has. `mesh` must outlive the scene that this
    /// is attached to.
    pub(super) fn mesh(
        device: &Device,
        mesh: &Mesh,
        to_frame: &Transform,
        options: &BuildOptions,
    ) -> Result<Option<Self>, BuildError> {
        check_size(&mesh.name, mesh.triangles.len(), mesh.positions.len())?;
        let mut shape = Self::new(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE, options)?;
        let test = AreaTest::under(mesh, &to_frame.linear);
        let kept = match &mesh.positions {
            Positions::F32(vertices) if to_frame.is_identity() && vertices.is_padded() => {
                shape.share_vertices(vertices);
                sift(mesh, test, &[])
            }
            positions @ (Positions::F32(_) | Positions::F64(_)) => {
                sift(mesh, test, shape.copy_positions(device, positions, to_frame)?)
            }
        };
        match kept {
            None => shape.share_triangles(mesh),
            Some(kept) if !kept.contains(&true) => return Ok(None),
            Some(kept) => shape.copy_triangles(device, mesh, &kept)?,
        }
        device.check("rtcSetGeometryBuffer")?;
        // SAFETY: the geometry is complete and not yet in use.
        unsafe { sys::rtcCommitGeometry(shape.handle.as_ptr()) };
        device.check("rtcCommitGeometry")?;
        Ok(Some(shape))
    }

    /// Lets Embree read the triangles where they stand. `mesh` must outlive the scene.
    fn share_triangles(&mut self, mesh: &Mesh) {
        let triangles: &[[u32; 3]] = &mesh.triangles;
        // SAFETY: the indices stand behind `mesh`, which outlives the scene (`CommittedScene` keeps the
        // geometry alive, `Buffer` never moves its values), three u32 a triangle; each is less than
        // the number of positions, as `Mesh` promises.
        unsafe {
            sys::rtcSetSharedGeometryBuffer(
                self.handle.as_ptr(),
                sys::RTC_BUFFER_TYPE_INDEX,
                0,
                sys::RTC_FORMAT_UINT3,
                triangles.as_ptr().cast(),
                0,
                size_of::<[u32; 3]>(),
                triangles.len(),
            );
        }
    }

    /// Copies the triangles into a buffer of Embree's own, where those that are not `kept` name a
    /// vertex that does not exist: Embree passes over such, and the others keep their numbers.
    fn copy_triangles(
        &mut self,
        device: &Device,
        mesh: &Mesh,
        kept: &[bool],
    ) -> Result<(), BuildError> {
        let triangles: &[[u32; 3]] = &mesh.triangles;
        // SAFETY: the geometry is ours; Embree allocates `len` items of 12 bytes.
        let data = unsafe {
            sys::rtcSetNewGeometryBuffer(
                self.handle.as_ptr(),
                sys::RTC_BUFFER_TYPE_INDEX,
                0,
                sys::RTC_FORMAT_UINT3,
                size_of::<[u32; 3]>(),
                triangles.len(),
            )
        };
        device.check("rtcSetNewGeometryBuffer")?;
        if data.is_null() {
            return Ok(());
        }
        // SAFETY: the buffer is `len` times three u32, aligned to 16 bytes, written by nobody else
        // until the geometry is committed.
        let out =
            unsafe { std::slice::from_raw_parts_mut(data.cast::<[u32; 3]>(), triangles.len()) };
        let given = triangles.par_iter().zip(kept).with_min_len(4096);
        out.par_iter_mut().zip(given).for_each(|(out, (&triangle, &kept))| {
            *out = if kept { triangle } else { [MISS; 3] };
        });
        self.copied_bytes += std::mem::size_of_val(triangles) as u64;
        Ok(())
    }

    /// Lets Embree read the corners where they stand. They must be padded, and outlive the scene.
    fn share_vertices(&mut self, vertices: &Vertices<3>) {
        assert!(vertices.is_padded(), "Embree reads 16 bytes at the last vertex");
        let floats: &[f32] = vertices.floats();
        // SAFETY: as for the triangles; `is_padded` says that 16 bytes can be read at the last
        // vertex, and `Vertices` that all vertices lie inside the floats.
        unsafe {
            sys::rtcSetSharedGeometryBuffer(
                self.handle.as_ptr(),
                sys::RTC_BUFFER_TYPE_VERTEX,
                0,
                sys::RTC_FORMAT_FLOAT3,
                floats.as_ptr().cast(),
                0,
                vertices.stride() * size_of::<f32>(),
                vertices.len(),
            );
        }
    }

    /// Moves the positions into a buffer of Embree's own, which it pads itself; as they are there.
    fn copy_positions(
        &mut self,
        device: &Device,
        positions: &Positions,
        to_frame: &Transform,
    ) -> Result<&[[f32; 3]], BuildError> {
        let count = positions.len();
        // SAFETY: the geometry is ours; Embree allocates `count` items of 12 bytes and padding.
        let data = unsafe {
            sys::rtcSetNewGeometryBuffer(
                self.handle.as_ptr(),
                sys::RTC_BUFFER_TYPE_VERTEX,
                0,
                sys::RTC_FORMAT_FLOAT3,
                size_of::<[f32; 3]>(),
                count,
            )
        };
        device.check("rtcSetNewGeometryBuffer")?;
        if data.is_null() || count == 0 {
            return Ok(&[]);
        }
        // SAFETY: the buffer is `count` times three floats, aligned to 16 bytes, written by nobody
        // else until the geometry is committed.
        let out = unsafe { std::slice::from_raw_parts_mut(data.cast::<[f32; 3]>(), count) };
        out.par_iter_mut().with_min_len(4096).enumerate().for_each(|(i, corner)| {
            *corner = to_frame.point(positions.get(i)).as_vec3().to_array();
        });
        self.copied_bytes += (count * size_of::<[f32; 3]>()) as u64;
        Ok(out)
    }

    /// `scene` once more, moved by `to_frame`.
    pub(super) fn instance(
        device: &Device,
        scene: &SceneHandle,
        to_frame: &Transform,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let shape = Self::new(device, sys::RTC_GEOMETRY_TYPE_INSTANCE, options)?;
        let linear = to_frame.linear.as_mat3().to_cols_array();
        let moved = to_frame.point(DVec3::ZERO).as_vec3();
        let mut columns = [0.0f32; 12];
        columns[..9].copy_from_slice(&linear);
        columns[9..].copy_from_slice(&moved.to_array());
        // SAFETY: both handles are live; Embree copies the twelve floats and retains the scene.
        unsafe {
            sys::rtcSetGeometryInstancedScene(shape.handle.as_ptr(), scene.0.as_ptr());
            sys::rtcSetGeometryTransform(
                shape.handle.as_ptr(),
                0,
                sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                columns.as_ptr().cast(),
            );
            sys::rtcCommitGeometry(shape.handle.as_ptr());
        }
        device.check("rtcSetGeometryInstancedScene")?;
        Ok(shape)
    }
}

impl Drop for EmbreeGeometry {
    fn drop(&mut self) {
        // SAFETY: releases the reference that `rtcNewGeometry` gave; scenes hold their own.
        unsafe { sys::rtcReleaseGeometry(self.handle.as_ptr()) };
    }
}

/// Mask of the triangles that Embree is to see, `None` for all: those that `test` finds an area in, and that single
/// precision has not `moved` into a point, which no ray of Embree hits. Debian 12's Embree ends the process when trees
/// of several meshes meet in a box without extent (`heuristic_openmerge_array.h`, at low quality).
fn sift(mesh: &Mesh, test: AreaTest<'_>, moved: &[[f32; 3]]) -> Option<Vec<bool>> {
    if test.keeps_all() && moved.is_empty() {
        return None;
    }
    let is_point = |i: usize| {
        let [a, b, c] = mesh.triangles[i].map(|corner| moved.get(corner as usize));
        !moved.is_empty() && a == b && b == c
    };
    let keeps = |i: usize| (test.keeps_all() || test.keeps(i)) && !is_point(i);
    let all = || (0..mesh.triangles.len()).into_par_iter().with_min_len(4096);
    (!all().all(keeps)).then(|| all().map(keeps).collect())
}

/// Refuses what Embree's 32-bit numbers cannot count.
fn check_size(name: &str, triangles: usize, corners: usize) -> Result<(), BuildError> {
    let limit = u64::from(u32::MAX) - 1;
    let (triangles, corners) = (triangles as u64, corners as u64);
    let what = if triangles > limit {
        format!("{triangles} triangles")
    } else if corners > limit {
        format!("{corners} vertices")
    } else {
        return Ok(());
    };
    Err(BuildError::TooLarge { mesh: name.to_owned(), what, backend: "Embree", limit })
}

/// Treatment of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InstanceKind {
    /// Nothing to see, or another stands in the same place.
    LeftOut,
    /// Its triangles are moved.
    Baked,
    /// Its mesh's own scene, moved.
    Instance,
}

/// Treatment of each placement, and the meshes that get a scene of their own.
pub(super) struct InstanceChoice {
    pub(super) placements: Vec<InstanceKind>,
    pub(super) meshes: Vec<bool>,
}

/// Rays are moved into a worse conditioned placement with an error that single precision cannot bear.
const WORST_CONDITION: f64 = 1e3;

/// An instance whose box is fewer of single precision's steps long is baked: Debian 12's Embree ends
/// the process when it has to part instances whose boxes are one point
/// (`heuristic_openmerge_array.h`, at low quality). Under half a step there is nothing to hit.
const LEAST_STEPS: f64 = 4.0;

/// Triangles from which a mesh is worth a scene of its own when things move: below it, building takes a
/// few milliseconds.
const LARGE: usize = 10_000;

impl InstanceChoice {
    /// For coordinates relative to `origin`. Where things `move`, large meshes that are used once are
    /// instances, too: what has not changed is then not built again.
    pub(super) fn of(geometry: &Geometry, origin: DVec3, moves: bool) -> Self {
        let uses = geometry.uses();
        let is_large = |mesh: usize| geometry.meshes[mesh].triangles.len() >= LARGE;
        let mut seen = HashSet::new();
        let mut meshes = vec![false; geometry.meshes.len()];
        let kind = |placement: &Placement| {
            let (mesh, transform) = (placement.mesh as usize, &placement.world_from_mesh);
            if !transform.is_finite() || !geometry.has_area(placement) {
                return InstanceKind::LeftOut;
            }
            if uses[mesh] < 2 && !(moves && is_large(mesh)) {
                return InstanceKind::Baked;
            }
            // Of several in the very same place the first is the one that is seen.
            if !seen.insert((mesh, bits_of(transform))) {
                return InstanceKind::LeftOut;
            }
            if !is_sound(&transform.linear) {
                return InstanceKind::Baked;
            }
            let steps = steps_of_f32(geometry.meshes[mesh].bounds, transform, origin);
            if steps < LEAST_STEPS {
                return if steps < 0.5 { InstanceKind::LeftOut } else { InstanceKind::Baked };
            }
            meshes[mesh] = true;
            InstanceKind::Instance
        };
        let placements = geometry.placements.iter().map(kind).collect();
        Self { placements, meshes }
    }
}

/// Number of steps of single precision that the box of a mesh is long where `transform` places it,
/// seen from `origin`, on the axis on which it is most.
fn steps_of_f32(bounds: Bounds, transform: &Transform, origin: DVec3) -> f64 {
    let l = &transform.linear;
    let size = bounds.max - bounds.min;
    let extent = l.x_axis.abs() * size.x + l.y_axis.abs() * size.y + l.z_axis.abs() * size.z;
    let place = transform.point_from(bounds.centre(), origin).abs() + extent;
    let steps = extent / (place * f64::from(f32::EPSILON));
    // 0 over 0 is NaN, which `max` passes over.
    0.0_f64.max(steps.x).max(steps.y).max(steps.z)
}

fn bits_of(transform: &Transform) -> [u64; 15] {
    let mut bits = [0; 15];
    let [x, y, z] = [transform.linear.x_axis, transform.linear.y_axis, transform.linear.z_axis];
    let columns = [x, y, z, transform.translation, transform.translation_low];
    for (k, column) in columns.into_iter().enumerate() {
        // Adding zero turns −0 into 0.
        bits[3 * k..3 * k + 3].copy_from_slice(&(column + 0.0).to_array().map(f64::to_bits));
    }
    bits
}

/// Tests whether single precision can invert `linear`.
fn is_sound(linear: &DMat3) -> bool {
    let norm = |m: &DMat3| {
        let squares = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length_squared);
        squares.into_iter().sum::<f64>().sqrt()
    };
    let size = norm(linear);
    // At unit scale, so that a small determinant is not mistaken for 0; Embree works out f32's.
    let unit = *linear * (1.0 / size);
    (1e-12..1e12).contains(&size)
        && unit.determinant() != 0.0
        && norm(&unit.inverse()) <= WORST_CONDITION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_32_bits_cannot_count_is_refused_by_name() {
        let most = u32::MAX as usize - 1;
        assert!(check_size("statue", most, most).is_ok());
        for (triangles, corners, what) in [(most + 1, 3, "triangles"), (1, most + 1, "vertices")] {
            let refused = check_size("statue", triangles, corners).expect_err("too many");
            let message = refused.to_string();
            assert!(message.contains("statue") && message.contains(what), "{message}");
        }
    }

    #[test]
    fn placements_that_single_precision_cannot_invert_are_baked() {
        let sound = |x: f64, y: f64, z: f64| is_sound(&DMat3::from_diagonal(DVec3::new(x, y, z)));
        assert!(sound(1.0, 1.0, 1.0) && sound(-1e-6, 1e-6, 2e-6) && sound(1e5, -1e5, 1e5));
        assert!(!sound(1.0, 1.0, 0.0) && !sound(0.0, 0.0, 0.0) && !sound(1e-7, 1.0, 1.0));
        assert!(!sound(f64::NAN, 1.0, 1.0));
    }
}
