#![expect(unsafe_code, reason = "Embree's C interface; the rest of the workspace has none")]
//! Embree behind four owners, each of one handle that it releases itself: [`Device`], [`Shape`],
//! [`SceneBuilder`] and [`Scene`].
//!
//! * `SceneBuilder` can be changed and not traced, `Scene` traced and not changed: Embree wants
//!   modifying, committing and tracing strictly one after the other (manual, `rtcCommitScene`), and
//!   moving the one into the other proves it.
//! * Vertex and index buffers are shared, not copied, where they stand as Embree wants them; a
//!   `Scene` keeps the [`Geometry`] that owns them alive.
//! * Errors come through the device's error function, with Embree's own words. Tracing reports none.
//! * Masks, ids and the 16 bytes behind the last vertex are seen to here and nowhere else.

mod device;
mod filter;
mod trace;

use std::collections::HashSet;
use std::ffi::c_void;
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::Arc;

use embree4_sys as sys;
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Mesh, Placement, Positions, Transform};

use self::device::Device;
use crate::single;
use crate::{BuildError, BuildOptions, Quality};

pub use self::device::{Version, version};
pub(crate) use self::filter::{Judged, Search};
pub(crate) use self::trace::Found;

type ProgressFn = dyn Fn(f64) -> bool + Send + Sync;

unsafe extern "C" fn on_progress(user: *mut c_void, done: f64) -> bool {
    // SAFETY: `user` points to the reference that `SceneBuilder::commit` keeps on its stack for as
    // long as the callback is registered.
    let progress = unsafe { *user.cast::<&ProgressFn>() };
    progress(done)
}

/// One mesh or instance, before it is attached to a scene.
struct Shape {
    handle: NonNull<sys::RTCGeometryTy>,
    copied_bytes: u64,
}

impl Shape {
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

    /// The triangles of `mesh`, moved by `to_frame`; the buffers are shared when nothing moves them.
    /// `mesh` must outlive the scene that this is attached to.
    fn mesh(
        device: &Device,
        mesh: &Mesh,
        to_frame: &Transform,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        check_size(&mesh.name, mesh.triangles.len(), mesh.positions.len())?;
        let mut shape = Self::new(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE, options)?;
        let triangles: &[[u32; 3]] = &mesh.triangles;
        // SAFETY: the indices stand behind `mesh`, which outlives the scene (`Scene` keeps the
        // geometry alive, `Buffer` never moves its values), three u32 a triangle; each is less than
        // the number of positions, as `Mesh` promises.
        unsafe {
            sys::rtcSetSharedGeometryBuffer(
                shape.handle.as_ptr(),
                sys::RTC_BUFFER_TYPE_INDEX,
                0,
                sys::RTC_FORMAT_UINT3,
                triangles.as_ptr().cast(),
                0,
                size_of::<[u32; 3]>(),
                triangles.len(),
            );
        }
        match &mesh.positions {
            Positions::F32(vertices) if to_frame.is_identity() && vertices.is_padded() => {
                let floats: &[f32] = vertices.floats();
                // SAFETY: as for the indices; `is_padded` says that 16 bytes can be read at the
                // last vertex, and `Vertices` that all vertices lie inside the floats.
                unsafe {
                    sys::rtcSetSharedGeometryBuffer(
                        shape.handle.as_ptr(),
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
            positions => shape.copy_positions(device, positions, to_frame)?,
        }
        device.check("rtcSetGeometryBuffer")?;
        // SAFETY: the geometry is complete and not yet in use.
        unsafe { sys::rtcCommitGeometry(shape.handle.as_ptr()) };
        device.check("rtcCommitGeometry")?;
        Ok(shape)
    }

    /// Moves the positions into a buffer of Embree's own, which it pads itself.
    fn copy_positions(
        &mut self,
        device: &Device,
        positions: &Positions,
        to_frame: &Transform,
    ) -> Result<(), BuildError> {
        use rayon::prelude::*;
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
            return Ok(());
        }
        // SAFETY: the buffer is `count` times three floats, aligned to 16 bytes, written by nobody
        // else until the geometry is committed.
        let out = unsafe { std::slice::from_raw_parts_mut(data.cast::<[f32; 3]>(), count) };
        out.par_iter_mut().with_min_len(4096).enumerate().for_each(|(i, corner)| {
            *corner = to_frame.point(positions.get(i)).as_vec3().to_array();
        });
        self.copied_bytes = (count * size_of::<[f32; 3]>()) as u64;
        Ok(())
    }

    /// `scene` once more, moved by `to_frame`.
    fn instance(
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

impl Drop for Shape {
    fn drop(&mut self) {
        // SAFETY: releases the reference that `rtcNewGeometry` gave; scenes hold their own.
        unsafe { sys::rtcReleaseGeometry(self.handle.as_ptr()) };
    }
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

impl Quality {
    fn to_embree(self) -> sys::RTCBuildQuality {
        match self {
            Self::Low => sys::RTC_BUILD_QUALITY_LOW,
            Self::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
            Self::High => sys::RTC_BUILD_QUALITY_HIGH,
        }
    }
}

/// One reference to an Embree scene.
struct SceneHandle(NonNull<sys::RTCSceneTy>);

impl Drop for SceneHandle {
    fn drop(&mut self) {
        // SAFETY: releases the reference that `rtcNewScene` gave.
        unsafe { sys::rtcReleaseScene(self.0.as_ptr()) };
    }
}

/// A scene that takes shapes and cannot be traced yet.
struct SceneBuilder<'a> {
    device: &'a Device,
    handle: SceneHandle,
}

impl<'a> SceneBuilder<'a> {
    fn new(device: &'a Device, options: &BuildOptions) -> Result<Self, BuildError> {
        // SAFETY: the device is live.
        let handle = unsafe { sys::rtcNewScene(device.handle.as_ptr()) };
        device.check("rtcNewScene")?;
        let Some(handle) = NonNull::new(handle) else {
            return Err(BuildError::Library {
                call: "rtcNewScene",
                message: "no scene".to_owned(),
            });
        };
        let handle = SceneHandle(handle);
        let mut flags = sys::RTC_SCENE_FLAG_NONE;
        if options.robust {
            flags = sys::RTCSceneFlags(flags.0 | sys::RTC_SCENE_FLAG_ROBUST.0);
        }
        if options.robust && options.refine {
            flags =
                sys::RTCSceneFlags(flags.0 | sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS.0);
        }
        if options.compact {
            flags = sys::RTCSceneFlags(flags.0 | sys::RTC_SCENE_FLAG_COMPACT.0);
        }
        // SAFETY: the scene is live and ours alone.
        unsafe {
            sys::rtcSetSceneFlags(handle.0.as_ptr(), flags);
            sys::rtcSetSceneBuildQuality(handle.0.as_ptr(), options.quality.to_embree());
        }
        Ok(Self { device, handle })
    }

    fn attach(&mut self, shape: &Shape, id: u32) {
        // SAFETY: both are live; the scene retains the geometry.
        unsafe {
            sys::rtcAttachGeometryByID(self.handle.0.as_ptr(), shape.handle.as_ptr(), id);
        }
    }

    /// Builds the acceleration structure.
    fn commit(self, progress: Option<&ProgressFn>) -> Result<SceneHandle, BuildError> {
        let scene = self.handle.0.as_ptr();
        if let Some(progress) = progress {
            let user: *mut c_void = ptr::from_ref(&progress).cast_mut().cast();
            // SAFETY: `progress` outlives the commit; the callback is taken off right after.
            unsafe {
                sys::rtcSetSceneProgressMonitorFunction(scene, Some(on_progress), user);
                sys::rtcCommitScene(scene);
                sys::rtcSetSceneProgressMonitorFunction(scene, None, ptr::null_mut());
            }
        } else {
            // SAFETY: the scene is live and ours alone.
            unsafe { sys::rtcCommitScene(scene) };
        }
        self.device.check("rtcCommitScene")?;
        Ok(self.handle)
    }
}

/// A committed scene: nothing changes it any more, so any number of threads may trace it.
pub(crate) struct Scene {
    // The order matters: the scene lets go of the buffers, then the device, then the geometry.
    handle: SceneHandle,
    device: Device,
    geometry: Arc<Geometry>,
    /// Bytes of vertices that had to be copied.
    pub(crate) copied_bytes: u64,
}

// SAFETY: after the commit the scene is read only; Embree's queries are re-entrant.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl fmt::Debug for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scene").field("device", &self.device).finish_non_exhaustive()
    }
}

impl Scene {
    /// Builds the scene of `geometry` with coordinates relative to `origin`.
    pub(crate) fn build(
        geometry: Arc<Geometry>,
        origin: DVec3,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let device = Device::new(options)?;
        let mut copied_bytes = 0;
        let instanced = Instanced::of(&geometry);
        let mut shared: Vec<Option<SceneHandle>> = Vec::with_capacity(geometry.meshes.len());
        for (mesh, &wanted) in geometry.meshes.iter().zip(&instanced.meshes) {
            let scene = if wanted {
                let mut builder = SceneBuilder::new(&device, options)?;
                let to_frame = Transform::new(DMat3::IDENTITY, -mesh_origin(mesh));
                let shape = Shape::mesh(&device, mesh, &to_frame, options)?;
                copied_bytes += shape.copied_bytes;
                builder.attach(&shape, 0);
                Some(builder.commit(options.progress.as_deref())?)
            } else {
                None
            };
            shared.push(scene);
        }
        let mut builder = SceneBuilder::new(&device, options)?;
        for (id, kind) in (0..).zip(&instanced.placements) {
            let placement = &geometry.placements[id as usize];
            let mesh = geometry.mesh_of(placement);
            let mut to_frame = placement.world_from_mesh;
            to_frame.translation -= origin;
            let shape = match (kind, &shared[placement.mesh as usize]) {
                (Kind::LeftOut, _) => continue,
                (Kind::Instance, Some(scene)) => {
                    let back = Transform::new(DMat3::IDENTITY, mesh_origin(mesh));
                    Shape::instance(&device, scene, &to_frame.then_inner(&back), options)?
                }
                _ => Shape::mesh(&device, mesh, &to_frame, options)?,
            };
            copied_bytes += shape.copied_bytes;
            builder.attach(&shape, id);
        }
        device.check("rtcAttachGeometry")?;
        let handle = builder.commit(options.progress.as_deref())?;
        Ok(Self { handle, device, geometry, copied_bytes })
    }

    /// The geometry whose buffers are shared.
    pub(crate) fn geometry(&self) -> &Arc<Geometry> {
        &self.geometry
    }

    /// Bytes that Embree holds.
    pub(crate) fn bytes(&self) -> u64 {
        self.device.bytes()
    }

    /// Rays per packet of coherent batches.
    pub(crate) fn packet_width(&self) -> usize {
        self.device.width
    }
}

/// The origin that an instanced mesh is traced relative to: its own, unless it lies far from it.
fn mesh_origin(mesh: &Mesh) -> DVec3 {
    single::Frame::of(mesh.bounds).origin
}

/// What becomes of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Nothing to see, or another stands in the same place.
    LeftOut,
    /// Its triangles are moved.
    Baked,
    /// Its mesh's own scene, moved.
    Instance,
}

/// What becomes of each placement, and which meshes get a scene of their own.
struct Instanced {
    placements: Vec<Kind>,
    meshes: Vec<bool>,
}

/// Rays are moved into a worse conditioned placement with an error that single precision cannot bear.
const WORST_CONDITION: f64 = 1e3;

impl Instanced {
    fn of(geometry: &Geometry) -> Self {
        let uses = geometry.uses();
        let mut seen = HashSet::new();
        let mut meshes = vec![false; geometry.meshes.len()];
        let kind = |placement: &Placement| {
            let (mesh, transform) = (placement.mesh as usize, &placement.world_from_mesh);
            if geometry.meshes[mesh].triangles.is_empty() || !transform.is_finite() {
                return Kind::LeftOut;
            }
            if uses[mesh] < 2 {
                return Kind::Baked;
            }
            // Of several in the very same place the first is the one that is seen.
            if !seen.insert((mesh, bits_of(transform))) {
                return Kind::LeftOut;
            }
            if !is_sound(&transform.linear) {
                return Kind::Baked;
            }
            meshes[mesh] = true;
            Kind::Instance
        };
        let placements = geometry.placements.iter().map(kind).collect();
        Self { placements, meshes }
    }
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

/// Whether single precision can invert `linear`.
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
