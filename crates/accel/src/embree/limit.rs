//! The limit: Embree's own speed. A loop that hands prepared records to Embree and does nothing else;
//! robust mode, as `etendue` has it by default, and the same geometry, shared in the same way.

mod motion;

use std::ffi::{CString, c_void};
use std::fmt;
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use embree4_sys as sys;
use etendue_geometry::{Geometry, Mesh, Positions, RayBatch};

use crate::Quality;

/// Rays in a packet. Where the processor has no packets of 16, Embree splits them itself.
pub const WIDTH: usize = 16;

/// Error of a bare scene that could not be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LimitError {
    /// Embree reported an error.
    #[error("Embree reports error {0}")]
    Embree(u32),
    /// The vertices are not as Embree reads them.
    #[error("mesh \"{0}\" has no padded f32 vertices, so its buffers cannot be shared")]
    Layout(String),
    /// Something moves as Embree's own motion blur does not have it.
    #[error("{0}, which Embree's own motion blur does not have")]
    Motion(String),
}

/// Bytes that Embree holds by its own count.
#[derive(Debug, Default)]
struct ByteCounter {
    now: AtomicI64,
    peak: AtomicI64,
}

/// A scene of Embree's, and nothing around it.
pub struct BareScene {
    scene: sys::RTCScene,
    parts: Vec<sys::RTCScene>,
    device: sys::RTCDevice,
    bytes: Box<ByteCounter>,
    /// Owns the buffers that Embree reads, where those are shared.
    _geometry: Option<Arc<Geometry>>,
}

// SAFETY: after `build` the scene is only read, and Embree's queries may be made from any thread;
// the counter is atomic.
unsafe impl Send for BareScene {}
// SAFETY: as above.
unsafe impl Sync for BareScene {}

impl fmt::Debug for BareScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BareScene").field("bytes", &self.bytes()).finish_non_exhaustive()
    }
}

/// Options of building a bare scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Mode {
    /// Time against traversal speed.
    pub quality: Quality,
    /// Embree's compact mode.
    pub compact: bool,
}

impl Mode {
    fn quality(self) -> sys::RTCBuildQuality {
        match self.quality {
            Quality::Low => sys::RTC_BUILD_QUALITY_LOW,
            Quality::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
            Quality::High => sys::RTC_BUILD_QUALITY_HIGH,
        }
    }
}

impl BareScene {
    /// Builds `geometry` on `threads` threads (0: all); a mesh placed more than once is instanced.
    ///
    /// # Errors
    ///
    /// When Embree says so, or a mesh is of another layout than the generators make.
    pub fn build(geometry: Arc<Geometry>, mode: Mode, threads: usize) -> Result<Self, LimitError> {
        let config = CString::new(format!("threads={threads}")).unwrap_or_default();
        // SAFETY: the string is terminated; the device is released in `drop`, before the counter
        // that its callback writes to; scenes are made, filled and committed here alone, and the
        // geometry whose buffers they share is kept beside them.
        unsafe {
            let device = sys::rtcNewDevice(config.as_ptr());
            let bytes = Box::<ByteCounter>::default();
            let counter: *mut c_void = ptr::from_ref(&*bytes).cast_mut().cast();
            sys::rtcSetDeviceMemoryMonitorFunction(device, Some(count_bytes), counter);
            let scene = new_scene(device, mode);
            let owner = Some(Arc::clone(&geometry));
            let mut bare = Self { scene, parts: Vec::new(), device, bytes, _geometry: owner };
            for (mesh, uses) in geometry.meshes.iter().zip(geometry.uses()) {
                let part = if uses > 1 { new_scene(device, mode) } else { scene };
                let shape = new_mesh(device, mesh, mode)?;
                sys::rtcAttachGeometry(part, shape);
                sys::rtcReleaseGeometry(shape);
                if uses > 1 {
                    sys::rtcCommitScene(part);
                }
                bare.parts.push(part);
            }
            bare.attach_instances(&geometry);
            sys::rtcCommitScene(scene);
            match sys::rtcGetDeviceError(device) {
                sys::RTC_ERROR_NONE => Ok(bare),
                error => Err(LimitError::Embree(error.0)),
            }
        }
    }

    fn attach_instances(&self, geometry: &Geometry) {
        for placement in &geometry.placements {
            let part = self.parts[placement.mesh as usize];
            if part == self.scene {
                continue;
            }
            let map = &placement.world_from_mesh;
            let mut columns = [0.0f32; 12];
            columns[..9].copy_from_slice(&map.linear.as_mat3().to_cols_array());
            columns[9..].copy_from_slice(&map.translation.as_vec3().to_array());
            // SAFETY: device and scenes are live, and the scene is not yet committed; Embree copies
            // the twelve floats.
            unsafe {
                let shape = sys::rtcNewGeometry(self.device, sys::RTC_GEOMETRY_TYPE_INSTANCE);
                sys::rtcSetGeometryInstancedScene(shape, part);
                sys::rtcSetGeometryTransform(
                    shape,
                    0,
                    sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                    columns.as_ptr().cast(),
                );
                sys::rtcCommitGeometry(shape);
                sys::rtcAttachGeometry(self.scene, shape);
                sys::rtcReleaseGeometry(shape);
            }
        }
    }

    /// Bytes that Embree holds.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        u64::try_from(self.bytes.now.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// The most bytes that Embree held while it built.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        u64::try_from(self.bytes.peak.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// Finds the closest hits of packets of coherent rays.
    pub fn closest_packets(&self, packets: &mut [RayHit16]) {
        let valid = Valid([-1; WIDTH]);
        let mut arguments = sys::RTCIntersectArguments {
            flags: sys::RTC_RAY_QUERY_FLAG_COHERENT,
            ..Default::default()
        };
        for packet in packets {
            // SAFETY: the scene is committed; packet and mask are of the C types and aligned by
            // theirs; `RayHit16::of` has set ids and masks.
            unsafe {
                sys::rtcIntersect16(valid.0.as_ptr(), self.scene, &mut packet.0, &mut arguments);
            }
        }
    }

    /// Finds the closest hits one by one.
    pub fn closest_singles(&self, singles: &mut [Single]) {
        let mut arguments = sys::RTCIntersectArguments::default();
        for single in singles {
            // SAFETY: as above.
            unsafe { sys::rtcIntersect1(self.scene, &mut single.0, &mut arguments) };
        }
    }

    /// Finds whether anything is in the way of packets of coherent rays.
    pub fn occluded_packets(&self, packets: &mut [RayHit16]) {
        let valid = Valid([-1; WIDTH]);
        let mut arguments = sys::RTCOccludedArguments {
            flags: sys::RTC_RAY_QUERY_FLAG_COHERENT,
            ..Default::default()
        };
        for packet in packets {
            let ray = &mut packet.0.ray;
            // SAFETY: as above.
            unsafe { sys::rtcOccluded16(valid.0.as_ptr(), self.scene, ray, &mut arguments) };
        }
    }

    /// Finds whether anything is in the way, one by one.
    pub fn occluded_singles(&self, singles: &mut [Single]) {
        let mut arguments = sys::RTCOccludedArguments::default();
        for single in singles {
            // SAFETY: as above.
            unsafe { sys::rtcOccluded1(self.scene, &mut single.0.ray, &mut arguments) };
        }
    }
}

impl Drop for BareScene {
    fn drop(&mut self) {
        // SAFETY: each handle was made in `build` and is released once; the counter, which Embree
        // writes to while it frees, is a field and so outlives this.
        unsafe {
            for &part in self.parts.iter().filter(|&&part| part != self.scene) {
                sys::rtcReleaseScene(part);
            }
            sys::rtcReleaseScene(self.scene);
            sys::rtcSetDeviceMemoryMonitorFunction(self.device, None, ptr::null_mut());
            sys::rtcReleaseDevice(self.device);
        }
    }
}

unsafe extern "C" fn count_bytes(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: `user` is the counter that `build` registered.
    let counter = unsafe { &*user.cast::<ByteCounter>() };
    let now = counter.now.fetch_add(bytes as i64, Ordering::Relaxed) + bytes as i64;
    counter.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// # Safety
///
/// `device` must be live.
unsafe fn new_scene(device: sys::RTCDevice, mode: Mode) -> sys::RTCScene {
    let mut flags = sys::RTC_SCENE_FLAG_ROBUST;
    if mode.compact {
        flags |= sys::RTC_SCENE_FLAG_COMPACT;
    }
    // SAFETY: the caller vouches for the device.
    unsafe {
        let scene = sys::rtcNewScene(device);
        sys::rtcSetSceneFlags(scene, flags);
        sys::rtcSetSceneBuildQuality(scene, mode.quality());
        scene
    }
}

/// # Safety
///
/// `device` must be live, and `mesh` outlive the geometry.
unsafe fn new_mesh(
    device: sys::RTCDevice,
    mesh: &Mesh,
    mode: Mode,
) -> Result<sys::RTCGeometry, LimitError> {
    let Positions::F32(vertices) = &mesh.positions else {
        return Err(LimitError::Layout(mesh.name.clone()));
    };
    if !vertices.is_padded() {
        return Err(LimitError::Layout(mesh.name.clone()));
    }
    let (floats, triangles): (&[f32], &[[u32; 3]]) = (vertices.floats(), &mesh.triangles);
    // SAFETY: the caller vouches for the device and the mesh; the lengths are those of the buffers,
    // the vertices padded, and a `Mesh` promises that its indices are in range.
    unsafe {
        let shape = sys::rtcNewGeometry(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE);
        sys::rtcSetGeometryBuildQuality(shape, mode.quality());
        sys::rtcSetSharedGeometryBuffer(
            shape,
            sys::RTC_BUFFER_TYPE_VERTEX,
            0,
            sys::RTC_FORMAT_FLOAT3,
            floats.as_ptr().cast(),
            0,
            vertices.stride() * size_of::<f32>(),
            vertices.len(),
        );
        sys::rtcSetSharedGeometryBuffer(
            shape,
            sys::RTC_BUFFER_TYPE_INDEX,
            0,
            sys::RTC_FORMAT_UINT3,
            triangles.as_ptr().cast(),
            0,
            size_of::<[u32; 3]>(),
            triangles.len(),
        );
        sys::rtcCommitGeometry(shape);
        Ok(shape)
    }
}

#[repr(C, align(64))]
struct Valid([i32; WIDTH]);

/// Sixteen rays and their hits, as Embree takes them.
#[derive(Clone, Copy)]
pub struct RayHit16(sys::RTCRayHit16);

impl RayHit16 {
    /// Packets of all `batches`, whose lengths are multiples of [`WIDTH`].
    #[must_use]
    pub fn of(batches: &[RayBatch]) -> Vec<Self> {
        let packets = |rays: &RayBatch| {
            (0..rays.len() / WIDTH).map(|k| Self::at(rays, k * WIDTH)).collect::<Vec<_>>()
        };
        batches.iter().flat_map(packets).collect()
    }

    fn at(rays: &RayBatch, start: usize) -> Self {
        let mut packet = sys::RTCRayHit16::default();
        let ray = &mut packet.ray;
        for lane in 0..WIDTH {
            let single = Single::at(rays, start + lane).0.ray;
            (ray.org_x[lane], ray.org_y[lane], ray.org_z[lane]) =
                (single.org_x, single.org_y, single.org_z);
            (ray.dir_x[lane], ray.dir_y[lane], ray.dir_z[lane]) =
                (single.dir_x, single.dir_y, single.dir_z);
            (ray.tnear[lane], ray.tfar[lane], ray.mask[lane]) =
                (single.tnear, single.tfar, single.mask);
            ray.time[lane] = single.time;
        }
        packet.hit.geomID = [sys::RTC_INVALID_GEOMETRY_ID; WIDTH];
        packet.hit.instID[0] = [sys::RTC_INVALID_GEOMETRY_ID; WIDTH];
        Self(packet)
    }

    /// Number of the rays that hit something.
    #[must_use]
    pub fn hits(&self) -> usize {
        self.0.hit.geomID.iter().filter(|&&id| id != sys::RTC_INVALID_GEOMETRY_ID).count()
    }
}

impl fmt::Debug for RayHit16 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Packet").field("hits", &self.hits()).finish_non_exhaustive()
    }
}

/// A ray and its hit, as Embree takes them.
#[derive(Clone, Copy)]
pub struct Single(sys::RTCRayHit);

impl Single {
    /// The rays of all `batches`.
    #[must_use]
    pub fn of(batches: &[RayBatch]) -> Vec<Self> {
        batches.iter().flat_map(|rays| (0..rays.len()).map(|i| Self::at(rays, i))).collect()
    }

    fn at(rays: &RayBatch, i: usize) -> Self {
        let (origin, direction) = (rays.origin(i).as_vec3(), rays.direction(i).as_vec3());
        #[expect(clippy::cast_possible_truncation, reason = "Embree's rays are single precision")]
        let [tnear, tfar, time] =
            [rays.t_min()[i], rays.t_max()[i], rays.time(i)].map(|x| x as f32);
        let mut query = sys::RTCRayHit::default();
        let ray = &mut query.ray;
        [ray.org_x, ray.org_y, ray.org_z] = origin.to_array();
        [ray.dir_x, ray.dir_y, ray.dir_z] = direction.to_array();
        (ray.tnear, ray.tfar, ray.mask, ray.time) = (tnear, tfar, u32::MAX, time);
        query.hit.geomID = sys::RTC_INVALID_GEOMETRY_ID;
        query.hit.instID[0] = sys::RTC_INVALID_GEOMETRY_ID;
        Self(query)
    }

    /// True if the ray hit something.
    #[must_use]
    pub fn is_hit(&self) -> bool {
        self.0.hit.geomID != sys::RTC_INVALID_GEOMETRY_ID
    }
}

impl fmt::Debug for Single {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Single").field("hit", &self.is_hit()).finish_non_exhaustive()
    }
}
