//! Embree's own motion blur: the limit of what moves, and the same standing still, built alike.
//!
//! Instances have a transform for each end of the exposure, and meshes that change their shapes a buffer of corners for
//! each of their steps; Embree goes in straight lines between them, all in single precision.

use std::ffi::CString;

use embree4_sys as sys;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, Mesh, Placement, Transform};

use super::{BareScene, LimitError, Mode, new_scene};

/// Steps that are as far from each other, to a rounding.
const EVEN: f64 = 1e-9;

impl BareScene {
    /// Builds `geometry` on `threads` threads (0: all), of which what moves does so between the times of `exposure`
    /// (s, first and last); rays then have times of that. A mesh that is placed more than once or is carried is
    /// instanced, and others stand where they are placed.
    ///
    /// # Errors
    ///
    /// When Embree says so, a body turns, whose way Embree would cut short, or steps are not even, as Embree has them.
    pub fn build_moving(
        geometry: &Geometry,
        exposure: [f64; 2],
        mode: Mode,
        threads: usize,
    ) -> Result<Self, LimitError> {
        let mut moves = vec![false; geometry.placements.len()];
        for (i, motion) in geometry.moving_within(exposure) {
            if motion.turns_within(exposure) {
                return Err(LimitError::Motion("a body turns".to_owned()));
            }
            moves[i] = true;
        }
        let config = CString::new(format!("threads={threads}")).unwrap_or_default();
        // SAFETY: the string is terminated; all handles are made here and released in `drop`, which `bare` is for
        // as soon as there are any; scenes are filled and committed here alone, and own their buffers.
        unsafe {
            let device = sys::rtcNewDevice(config.as_ptr());
            let scene = new_scene(device, mode);
            let (parts, bytes) = Default::default();
            let mut bare = Self { scene, parts, device, bytes, _geometry: None };
            let mut of_mesh = vec![None; geometry.meshes.len()];
            let uses = geometry.uses();
            for (i, placement) in geometry.placements.iter().enumerate() {
                let (number, mesh) = (placement.mesh as usize, geometry.mesh_of(placement));
                let span = moves[i].then_some(exposure);
                let is_instance = mesh.steps.is_none() && (uses[number] > 1 || moves[i]);
                let shape = if is_instance {
                    let part = *of_mesh[number].get_or_insert_with(|| {
                        let part = new_scene(device, mode);
                        let own =
                            copied(device, mesh, &Placement::of(0, Transform::IDENTITY), mode);
                        attach(part, own);
                        sys::rtcCommitScene(part);
                        bare.parts.push(part);
                        part
                    });
                    instance(device, part, placement, span)
                } else {
                    let steps = mesh.steps.as_ref().filter(|_| moves[i]);
                    if steps.is_some_and(|steps| !are_even(steps.times(), exposure)) {
                        return Err(LimitError::Motion(format!(
                            "\"{}\" has uneven steps",
                            mesh.name
                        )));
                    }
                    copied(device, mesh, placement, mode)
                };
                attach(scene, shape);
            }
            sys::rtcCommitScene(scene);
            match sys::rtcGetDeviceError(device) {
                sys::RTC_ERROR_NONE => Ok(bare),
                error => Err(LimitError::Embree(error.0)),
            }
        }
    }
}

/// True if times run from one end of the exposure to the other, each as far from the next.
fn are_even(times: &[f64], [open, close]: [f64; 2]) -> bool {
    let each = (close - open) / (times.len() - 1).max(1) as f64;
    let is_due =
        |(k, &time): (usize, &f64)| (time - open - each * k as f64).abs() <= EVEN * (close - open);
    times.len() > 1 && times.iter().enumerate().all(is_due)
}

/// # Safety
///
/// Both must be live, and the scene not be committed.
unsafe fn attach(scene: sys::RTCScene, shape: sys::RTCGeometry) {
    // SAFETY: the caller vouches for both; the scene keeps the shape.
    unsafe {
        sys::rtcCommitGeometry(shape);
        sys::rtcAttachGeometry(scene, shape);
        sys::rtcReleaseGeometry(shape);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "Embree's times are single precision")]
fn single(x: f64) -> f32 {
    x as f32
}

/// # Safety
///
/// Both must be live.
unsafe fn instance(
    device: sys::RTCDevice,
    part: sys::RTCScene,
    placement: &Placement,
    span: Option<[f64; 2]>,
) -> sys::RTCGeometry {
    let places = match span {
        None => vec![placement.world_from_mesh],
        Some(ends) => ends.map(|time| placement.world_from_mesh_at(time)).to_vec(),
    };
    // SAFETY: the caller vouches for device and scene; Embree copies the twelve floats of each step.
    unsafe {
        let shape = sys::rtcNewGeometry(device, sys::RTC_GEOMETRY_TYPE_INSTANCE);
        sys::rtcSetGeometryInstancedScene(shape, part);
        if let Some([open, close]) = span {
            sys::rtcSetGeometryTimeStepCount(shape, 2);
            sys::rtcSetGeometryTimeRange(shape, single(open), single(close));
        }
        for (step, place) in (0..).zip(places) {
            let mut columns = [0.0f32; 12];
            columns[..9].copy_from_slice(&place.linear.as_mat3().to_cols_array());
            columns[9..].copy_from_slice(&place.point(DVec3::ZERO).as_vec3().to_array());
            let format = sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
            sys::rtcSetGeometryTransform(shape, step, format, columns.as_ptr().cast());
        }
        shape
    }
}

/// A mesh where it is placed, with all of its steps.
///
/// # Safety
///
/// `device` must be live.
unsafe fn copied(
    device: sys::RTCDevice,
    mesh: &Mesh,
    placement: &Placement,
    mode: Mode,
) -> sys::RTCGeometry {
    let times = mesh.steps.as_ref().map_or(&[0.0][..], |steps| steps.times());
    let count = mesh.positions.len();
    // SAFETY: the caller vouches for the device; Embree makes each buffer of the length that is asked for, and pads
    // it; a `Mesh` promises that its indices are in range.
    unsafe {
        let shape = sys::rtcNewGeometry(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE);
        sys::rtcSetGeometryBuildQuality(shape, mode.quality());
        if let [open, .., close] = times {
            sys::rtcSetGeometryTimeStepCount(shape, u32::try_from(times.len()).unwrap_or(1));
            sys::rtcSetGeometryTimeRange(shape, single(*open), single(*close));
        }
        for (slot, &time) in (0..).zip(times) {
            let (vertex, size) = (sys::RTC_BUFFER_TYPE_VERTEX, size_of::<[f32; 3]>());
            let format = sys::RTC_FORMAT_FLOAT3;
            let data = sys::rtcSetNewGeometryBuffer(shape, vertex, slot, format, size, count);
            let out = data.cast::<[f32; 3]>();
            let corner = |i: usize| match &mesh.steps {
                None => mesh.positions.get(i),
                Some(steps) => steps.corner(steps.moment(time), i),
            };
            let place = placement.world_from_mesh_at(time);
            for i in (0..count).filter(|_| !out.is_null()) {
                out.add(i).write(place.point(corner(i)).as_vec3().to_array());
            }
        }
        let (kind, format) = (sys::RTC_BUFFER_TYPE_INDEX, sys::RTC_FORMAT_UINT3);
        let triangles = mesh.triangles.len();
        let size = size_of::<[u32; 3]>();
        let data = sys::rtcSetNewGeometryBuffer(shape, kind, 0, format, size, triangles);
        if !data.is_null() {
            data.cast::<[u32; 3]>().copy_from(mesh.triangles.as_ptr(), triangles);
        }
        shape
    }
}
