//! One triangle, asked in every way this crate offers: the shim and Embree 4 must say the same.

use std::ffi::{c_int, c_void};
use std::ptr;

use embree4_sys::*;

/// A device and a scene of the triangle (0,0,2) (1,0,2) (0,1,2), facing the rays along +z.
struct Triangle {
    device: RTCDevice,
    scene: RTCScene,
}

impl Triangle {
    fn new() -> Self {
        // SAFETY: every handle is made here and checked; the buffers are written within the sizes
        // they were asked for, before the commit.
        unsafe {
            let device = rtcNewDevice(ptr::null());
            assert!(!device.is_null(), "no device");
            let geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
            let vertices: *mut [f32; 3] =
                buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, 3);
            vertices.copy_from([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]].as_ptr(), 3);
            let indices: *mut [u32; 3] =
                buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, 1);
            indices.write([0, 1, 2]);
            rtcCommitGeometry(geometry);
            let scene = rtcNewScene(device);
            rtcSetSceneFlags(
                scene,
                RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS,
            );
            assert_eq!(rtcAttachGeometry(scene, geometry), 0);
            rtcReleaseGeometry(geometry);
            rtcCommitScene(scene);
            assert_eq!(rtcGetDeviceError(device), RTC_ERROR_NONE);
            Self { device, scene }
        }
    }
}

impl Triangle {
    /// True if lanes that are masked off are left alone: where the processor has no packets of 16, Embree 3.13 traces
    /// them as a stream, which goes by the ends of rays and not by the mask.
    fn heeds_masks(&self) -> bool {
        // SAFETY: the device is live.
        unsafe {
            rtcGetDeviceProperty(self.device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0
        }
    }
}

/// True if two numbers are the same but for the processor's reciprocal, which Embree refines by one step of
/// Newton's method: within two units in the last place.
fn is_close(found: f32, known: f32) -> bool {
    found == known || (found - known).abs() <= 2.0 * f32::EPSILON * known.abs()
}

impl Drop for Triangle {
    fn drop(&mut self) {
        // SAFETY: both are handles of ours, released once.
        unsafe {
            assert_eq!(rtcGetDeviceError(self.device), RTC_ERROR_NONE);
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}

/// A new buffer of `count` items in slot 0.
unsafe fn buffer<T>(
    geometry: RTCGeometry,
    kind: RTCBufferType,
    format: RTCFormat,
    count: usize,
) -> *mut T {
    // SAFETY: the caller passes a live geometry and the format of `T`.
    let items =
        unsafe { rtcSetNewGeometryBuffer(geometry, kind, 0, format, size_of::<T>(), count) };
    assert!(!items.is_null());
    items.cast()
}

/// A ray from (x, y, 0) along +z.
fn ray(x: f32, y: f32) -> RTCRay {
    RTCRay {
        org_x: x,
        org_y: y,
        dir_z: 1.0,
        tfar: f32::INFINITY,
        mask: u32::MAX,
        ..RTCRay::default()
    }
}

fn ray_hit(x: f32, y: f32) -> RTCRayHit {
    let hit = RTCHit {
        primID: RTC_INVALID_GEOMETRY_ID,
        geomID: RTC_INVALID_GEOMETRY_ID,
        instID: [RTC_INVALID_GEOMETRY_ID; RTC_MAX_INSTANCE_LEVEL_COUNT as usize],
        ..RTCHit::default()
    };
    RTCRayHit { ray: ray(x, y), hit }
}

/// Sixteen rays on a diagonal; those of x + y <= 1 hit.
fn ray16() -> RTCRay16 {
    let along: [f32; 16] = std::array::from_fn(|lane| 0.04 + 0.06 * lane as f32);
    RTCRay16 {
        org_x: along,
        org_y: along,
        dir_z: [1.0; 16],
        tfar: [f32::INFINITY; 16],
        mask: [u32::MAX; 16],
        ..RTCRay16::default()
    }
}

#[repr(align(64))]
struct Valid([c_int; 16]);

/// Every lane but the first.
const VALID: Valid = {
    let mut lanes = [-1; 16];
    lanes[0] = 0;
    Valid(lanes)
};

fn lane_hits(lane: usize) -> bool {
    let x = 0.04 + 0.06 * lane as f32;
    lane != 0 && 2.0 * x <= 1.0
}

#[test]
fn one_ray_hits_and_misses() {
    let triangle = Triangle::new();
    let mut args = RTCIntersectArguments::default();
    let mut hit = ray_hit(0.25, 0.5);
    let mut miss = ray_hit(0.75, 0.5);
    // SAFETY: the scene is committed, the records live on the stack with their types' alignment.
    unsafe {
        rtcIntersect1(triangle.scene, &raw mut hit, &raw mut args);
        rtcIntersect1(triangle.scene, &raw mut miss, ptr::null_mut());
    }
    assert_eq!((hit.hit.geomID, hit.hit.primID, hit.hit.instID[0]), (0, 0, u32::MAX));
    // Powers of two throughout, so that f32 is exact but for reciprocals.
    for (found, known) in [(hit.ray.tfar, 2.0), (hit.hit.u, 0.25), (hit.hit.v, 0.5)] {
        assert!(is_close(found, known), "{found} is not {known}");
    }
    assert_eq!(miss.hit.geomID, RTC_INVALID_GEOMETRY_ID);
    assert_eq!(miss.ray.tfar, f32::INFINITY);
}

#[test]
fn sixteen_rays_are_sixteen_rays() {
    let triangle = Triangle::new();
    for flags in [RTC_RAY_QUERY_FLAG_COHERENT, RTC_RAY_QUERY_FLAG_INCOHERENT] {
        let mut args = RTCIntersectArguments { flags, ..RTCIntersectArguments::default() };
        let hit = RTCHit16 {
            geomID: [RTC_INVALID_GEOMETRY_ID; 16],
            instID: [[RTC_INVALID_GEOMETRY_ID; 16]; RTC_MAX_INSTANCE_LEVEL_COUNT as usize],
            ..RTCHit16::default()
        };
        let mut packet = RTCRayHit16 { ray: ray16(), hit };
        // SAFETY: as above; the mask is aligned to 64 bytes by its type.
        unsafe {
            rtcIntersect16(VALID.0.as_ptr(), triangle.scene, &raw mut packet, &raw mut args);
        }
        for lane in usize::from(!triangle.heeds_masks())..16 {
            let (id, distance) =
                if lane_hits(lane) { (0, 2.0) } else { (RTC_INVALID_GEOMETRY_ID, f32::INFINITY) };
            let found = (packet.hit.geomID[lane], packet.ray.tfar[lane]);
            assert!(found.0 == id && is_close(found.1, distance), "{lane}: {found:?}");
        }
    }
}

#[test]
fn occlusion_writes_minus_infinity() {
    let triangle = Triangle::new();
    let mut args = RTCOccludedArguments::default();
    let (mut blocked, mut free) = (ray(0.25, 0.25), RTCRay { tfar: 1.5, ..ray(0.25, 0.25) });
    let mut packet = ray16();
    // SAFETY: as above.
    unsafe {
        rtcOccluded1(triangle.scene, &raw mut blocked, &raw mut args);
        rtcOccluded1(triangle.scene, &raw mut free, &raw mut args);
        rtcOccluded16(VALID.0.as_ptr(), triangle.scene, &raw mut packet, &raw mut args);
    }
    assert_eq!((blocked.tfar, free.tfar), (f32::NEG_INFINITY, 1.5));
    for lane in usize::from(!triangle.heeds_masks())..16 {
        let expected = if lane_hits(lane) { f32::NEG_INFINITY } else { f32::INFINITY };
        assert_eq!(packet.tfar[lane], expected, "{lane}");
    }
}

/// A query's context with a count behind it, as Embree's manual extends it.
#[repr(C)]
struct Counter {
    context: RTCRayQueryContext,
    calls: u32,
}

/// Counts in the query's context and lets every hit pass.
unsafe extern "C" fn count(args: *const RTCFilterFunctionNArguments) {
    // SAFETY: called by Embree in a query that passed a `Counter`.
    unsafe { (*filter_context(args).cast::<Counter>()).calls += 1 }
}

#[test]
fn filters_find_the_context_of_their_query() {
    let triangle = Triangle::new();
    let mut counter = Counter { context: RTCRayQueryContext::default(), calls: 0 };
    for (flags, calls) in
        [(RTC_RAY_QUERY_FLAG_NONE, 0), (RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER, 1)]
    {
        let mut args = RTCIntersectArguments {
            flags,
            filter: Some(count),
            context: (&raw mut counter).cast(),
            ..RTCIntersectArguments::default()
        };
        let mut hit = ray_hit(0.25, 0.25);
        // SAFETY: as above; the context outlives the query.
        unsafe { rtcIntersect1(triangle.scene, &raw mut hit, &raw mut args) };
        assert_eq!((hit.hit.geomID, counter.calls), (0, calls));
    }
    assert_eq!(counter.context.instID[0], RTC_INVALID_GEOMETRY_ID);
}

/// Notes which primitive came up and keeps the radius.
unsafe extern "C" fn note(args: *mut RTCPointQueryFunctionArguments) -> bool {
    // SAFETY: called by Embree with the pointer that the query was given, to a list of ids.
    unsafe {
        let seen: *mut Vec<(u32, u32)> = (*args).userPtr.cast();
        (*seen).push(((*args).geomID, (*args).primID));
    }
    false
}

#[test]
fn point_queries_are_the_same_on_both() {
    let triangle = Triangle::new();
    let mut query = RTCPointQuery { radius: 2.5, ..RTCPointQuery::default() };
    let mut context = RTCPointQueryContext::default();
    let mut seen = Vec::new();
    let user: *mut c_void = (&raw mut seen).cast();
    // SAFETY: as above; a stack of no instances needs no ids.
    let changed = unsafe {
        rtcPointQuery(triangle.scene, &raw mut query, &raw mut context, Some(note), user)
    };
    assert_eq!((changed, seen), (false, vec![(0, 0)]));
}

#[test]
fn the_library_is_the_one_of_the_header() {
    let triangle = Triangle::new();
    // SAFETY: a live device.
    let version = unsafe { rtcGetDeviceProperty(triangle.device, RTC_DEVICE_PROPERTY_VERSION) };
    assert_eq!(version, RTC_VERSION as isize);
    let parts = [RTC_VERSION_MAJOR, RTC_VERSION_MINOR, RTC_VERSION_PATCH].map(|n| n.to_string());
    assert_eq!(VERSION, parts.join("."));
}
