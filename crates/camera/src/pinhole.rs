//! The pinhole: every ray of the picture passes through one point.
//!
//! The orthographic camera: all rays are parallel to the axis.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::distortion::{Distortion, DistortionSpec};
use crate::falloff::{FalloffSpec, square_of};
use crate::framing::{self, FieldExtent, Subject};
use crate::{
    CameraError, CameraMotionSpec, Intrinsics, IntrinsicsSpec, PixelOrigin, Pose, PoseSpec,
    SensorSpec, ShutterSpec,
};
use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::{Degrees, Metres};
use etendue_geometry::{Float, RayBatch, RayBlock, RaysMut};

/// The vertical field of view of a pinhole that says nothing about it.
const DEFAULT_FOV: Degrees = Degrees(40.0);

/// The narrowest field of view (degrees): 4 micrometres at a kilometre.
const NARROWEST_FOV: f64 = 2e-7;

/// A pixel of a camera in single precision is at least so many times as wide as its largest tangent is rounded by: some four
/// roundings on the way to a direction move it by a sixteenth of a pixel at most.
const LEAST_ROUNDINGS: f64 = 64.0;

/// A pinhole camera as the scene file writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PinholeSpec {
    /// Vertical field of view (degrees), between 0 and 180; 40 when neither this nor `intrinsics`
    /// is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov: Option<Degrees>,
    /// OpenCV's K instead of `fov`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<IntrinsicsSpec>,
    /// Lens distortion, beside `intrinsics`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<DistortionSpec>,
    /// Falloff of light from the axis; none when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falloff: Option<FalloffSpec>,
    /// Pose of the camera; when absent, the whole scene is framed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseSpec>,
    /// When rows are open to light; all together, for as long as the sensor exposes, when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shutter: Option<ShutterSpec>,
    /// Motion of the camera; it stands still when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<CameraMotionSpec>,
    /// The grid of pixels.
    #[serde(default)]
    pub sensor: SensorSpec,
}

/// A pinhole's projection.
#[derive(Debug, Clone, PartialEq)]
pub struct Pinhole {
    intrinsics: Intrinsics,
    distortion: Option<Distortion>,
    falloff: Option<FalloffSpec>,
    pixel_origin: PixelOrigin,
}

impl PinholeSpec {
    /// The pose and projection. `subject` is asked for only when the pose is to be chosen.
    pub(crate) fn build<'a>(
        &self,
        subject: impl FnOnce() -> Subject<'a>,
    ) -> Result<(Pose, Pinhole), CameraError> {
        // Intrinsics as given, or by the field of view.
        let intrinsics = match (&self.intrinsics, self.fov) {
            (Some(_), Some(_)) => {
                return Err(CameraError::new(
                    "fov",
                    "is given beside `intrinsics`, which already fix it\nhint: remove one of them",
                ));
            }
            (Some(spec), None) => spec.build()?,
            (None, fov) => {
                let Degrees(fov) = fov.unwrap_or(DEFAULT_FOV);
                if !(fov > 0.0 && fov < 180.0) {
                    let why = format!("{fov} is outside 0 to 180 degrees (both excluded)");
                    return Err(CameraError::new("fov", why));
                }
                if fov < NARROWEST_FOV {
                    let why =
                        format!("{fov} is under {NARROWEST_FOV} degrees; no ray bends so little");
                    return Err(CameraError::new("fov", why));
                }
                Intrinsics::from_fov(fov.to_radians(), self.sensor.resolution)
            }
        };
        let distortion = self.build_distortion(&intrinsics)?;
        let pixel_origin = match &self.intrinsics {
            Some(spec) => spec.pixel_origin,
            None => PixelOrigin::Center,
        };
        self.falloff.as_ref().map_or(Ok(()), FalloffSpec::check)?;
        let pinhole = Pinhole { intrinsics, distortion, falloff: self.falloff, pixel_origin };
        // Without a pose the whole subject is framed.
        let pose = match &self.pose {
            Some(pose) => pose.build().map_err(|error| error.under("pose"))?,
            None => framing::perspective(subject(), pinhole.reach(self.sensor.resolution)),
        };
        Ok((pose, pinhole))
    }

    fn build_distortion(&self, intrinsics: &Intrinsics) -> Result<Option<Distortion>, CameraError> {
        match (&self.distortion, &self.intrinsics) {
            (None, _) => Ok(None),
            (Some(_), None) => Err(CameraError::new(
                "distortion",
                "has coefficients that hold for one K only\nhint: give `intrinsics` instead of `fov`",
            )),
            (Some(spec), Some(_)) => {
                let border = border(self.sensor.resolution);
                spec.build(border.map(|[u, v]| intrinsics.tangents(u, v))).map(Some)
            }
        }
    }
}

/// Places on the outer edge of the sensor (pixels from the corner), the four corners among them.
fn border([width, height]: [u32; 2]) -> impl Iterator<Item = [f64; 2]> {
    // Between two of these places no distortion in use bends by more than a fraction of a pixel.
    const PLACES: u32 = 64;
    let (width, height) = (f64::from(width), f64::from(height));
    (0..=PLACES).map(|i| f64::from(i) / f64::from(PLACES)).flat_map(move |share| {
        let (u, v) = (share * width, share * height);
        [[u, 0.0], [u, height], [0.0, v], [width, v]]
    })
}

impl Pinhole {
    /// The intrinsic parameters.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        self.intrinsics
    }

    /// The lens distortion.
    #[must_use]
    pub fn distortion(&self) -> Option<&Distortion> {
        self.distortion.as_ref()
    }

    /// The relative light of a place of the picture (column and row, pixels from the corner).
    pub(crate) fn light_at(&self, place: [f64; 2]) -> f64 {
        self.falloff.map_or(1.0, |falloff| falloff.at(square_of(&self.intrinsics, place)))
    }

    /// Origin from which the file counted the principal point; the centre when it gave a field of view.
    #[must_use]
    pub fn pixel_origin(&self) -> PixelOrigin {
        self.pixel_origin
    }

    /// Returns the camera on pixels `factor` times as large.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { intrinsics: self.intrinsics.coarser(factor), ..self.clone() }
    }

    /// The camera in single precision for a picture of so many pixels; `None` where it distorts, sees some places darker than
    /// others, or has pixels that single precision hardly tells apart.
    pub(crate) fn lanes(&self, pose: &Pose, resolution: [u32; 2]) -> Option<PinholeLanes> {
        let Intrinsics { focal: [fx, fy], skew, .. } = self.intrinsics;
        let widest = border(resolution).flat_map(|[u, v]| self.intrinsics.tangents(u, v));
        let widest = widest.fold(1.0_f64, |most, tangent| most.max(tangent.abs()));
        let are_wide = LEAST_ROUNDINGS * f64::from(f32::EPSILON) * widest * fx.max(fy) <= 1.0;
        if self.distortion.is_some() || self.falloff.is_some() || !are_wide {
            return None;
        }
        let (right, down, forward) = (pose.right(), -pose.up(), pose.forward());
        Some(PinholeLanes {
            position: pose.position,
            intrinsics: self.intrinsics,
            axes: [0, 1, 2].map(|k| [right[k], down[k], forward[k]].map(f32::of)),
            steps: [1.0 / fx, -skew / (fx * fy), 1.0 / fy].map(f32::of),
        })
    }

    /// The tangents up to which a framed scene may reach: of the picture's edges, or of what is
    /// seen at their middles and corners, at most 60° from the axis.
    fn reach(&self, [width, height]: [u32; 2]) -> FieldExtent {
        let (width, height) = (f64::from(width), f64::from(height));
        let tangents = |u: f64, v: f64| {
            let seen = self.intrinsics.tangents(u, v);
            let Some(distortion) = &self.distortion else { return seen };
            match distortion.undistort(seen) {
                Some([x, y, z]) if z > 0.0 => [x / z, y / z],
                _ => seen.map(|x| x.signum() * f64::INFINITY),
            }
        };
        let widest = if self.distortion.is_some() { 3_f64.sqrt() } else { f64::INFINITY };
        FieldExtent::of_picture([width, height], self.intrinsics.centre, widest, tangents)
    }

    /// Turns places on the sensor (pixels from the corner), which stand in the first two arrays of
    /// the directions, into rays from the pinhole. All arrays have the same length.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        for (axis, origins) in rays.arrays_mut().origins.into_iter().enumerate() {
            origins.fill(pose.position[axis]);
        }
        match &self.distortion {
            None => {
                let axes = [pose.right(), -pose.up(), pose.forward()];
                aim_straight(&self.intrinsics, axes, rays.arrays_mut().directions);
            }
            Some(distortion) => self.aim_distorted(distortion, pose, rays),
        }
    }

    fn aim_distorted(&self, distortion: &Distortion, pose: &Pose, rays: &mut RayBatch) {
        let RaysMut { directions: [dx, dy, dz], t_max, .. } = rays.arrays_mut();
        for (x, y) in dx.iter_mut().zip(dy.iter_mut()) {
            [*x, *y] = self.intrinsics.tangents(*x, *y);
        }
        distortion.undistort_all([dx, dy, dz]);
        for i in 0..t_max.len() {
            let [x, y, z] = [dx[i], dy[i], dz[i]];
            let sees = [x, y, z] != [0.0; 3];
            let turned = pose.right() * x - pose.up() * y + pose.forward() * z;
            [dx[i], dy[i], dz[i]] = if sees { turned } else { pose.forward() }.to_array();
            if !sees {
                // Nothing lies before a negative distance: the ray hits nothing.
                t_max[i] = -1.0;
            }
        }
    }
}

/// A pinhole in single precision, for rays that are traced in blocks: places in pixels become unit directions.
#[derive(Debug, Clone, Copy)]
pub struct PinholeLanes {
    /// The point where its rays start (m).
    pub position: DVec3,
    intrinsics: Intrinsics,
    /// Right, down and forward, by axis of the world.
    axes: [[f32; 3]; 3],
    /// Change of the tangents across a pixel: of the first along columns and along rows, of the second along rows.
    steps: [f32; 3],
}

impl PinholeLanes {
    /// The tangents at the outer corner of the pixel in this column and row.
    #[must_use]
    pub fn corner(&self, [column, row]: [i32; 2]) -> [f32; 2] {
        self.intrinsics.tangents(f64::from(column), f64::from(row)).map(f32::of)
    }

    /// Sets the directions of rays through places in pixels (0..1), with the tangents at the corners of these: two columns
    /// each, sixteen numbers a block.
    pub fn aim(&self, places: &[Vec<f32>; 2], corners: &[Vec<f32>; 2], blocks: &mut [RayBlock]) {
        aim_blocks(self, places, corners, blocks);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn aim_blocks(
    camera: &PinholeLanes,
    [u, v]: &[Vec<f32>; 2],
    [left, top]: &[Vec<f32>; 2],
    blocks: &mut [RayBlock],
) {
    let PinholeLanes { axes, steps: [across, skew, down], .. } = *camera;
    let (u, v) = (u.as_chunks::<LANES>().0, v.as_chunks::<LANES>().0);
    let (left, top) = (left.as_chunks::<LANES>().0, top.as_chunks::<LANES>().0);
    for ((block, (u, v)), (left, top)) in
        blocks.iter_mut().zip(u.iter().zip(v)).zip(left.iter().zip(top))
    {
        let [dx, dy, dz] = &mut block.direction;
        // One loop: of several short ones the axes would be put side by side, lane by lane.
        for i in 0..LANES {
            let (x, y) = (left[i] + u[i] * across + v[i] * skew, top[i] + v[i] * down);
            let shorten = 1.0 / (x * x + y * y + 1.0).sqrt();
            dx[i] = (axes[0][0] * x + axes[0][1] * y + axes[0][2]) * shorten;
            dy[i] = (axes[1][0] * x + axes[1][1] * y + axes[1][2]) * shorten;
            dz[i] = (axes[2][0] * x + axes[2][1] * y + axes[2][2]) * shorten;
        }
    }
}

/// Directions through places on the sensor, which stand in the first two arrays, along the axes that
/// point right, down and forward.
#[multiversion::multiversion(targets = "simd")]
fn aim_straight(
    intrinsics: &Intrinsics,
    [right, down, forward]: [DVec3; 3],
    directions: [&mut [f64]; 3],
) {
    let [dx, dy, dz] = directions;
    // The three arrays walk in step, so that the loop has no bounds to check and vectorises.
    for ((dx, dy), dz) in dx.iter_mut().zip(dy).zip(dz) {
        let [x, y] = intrinsics.tangents(*dx, *dy);
        let shorten = 1.0 / (x * x + y * y + 1.0).sqrt();
        let (x, y, z) = (x * shorten, y * shorten, shorten);
        *dx = right.x * x + down.x * y + forward.x * z;
        *dy = right.y * x + down.y * y + forward.y * z;
        *dz = right.z * x + down.z * y + forward.z * z;
    }
}

/// An orthographic camera as the scene file writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OrthographicSpec {
    /// Height of the picture in the world (m); the pixels are square. When absent, the whole
    /// scene fits in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<Metres>,
    /// Pose of the camera: rays start in the plane through it across its axis. When absent,
    /// the whole scene is framed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseSpec>,
    /// When rows are open to light; all together, for as long as the sensor exposes, when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shutter: Option<ShutterSpec>,
    /// Motion of the camera; it stands still when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<CameraMotionSpec>,
    /// The grid of pixels.
    #[serde(default)]
    pub sensor: SensorSpec,
}

/// An orthographic projection.
#[derive(Debug, Clone, PartialEq)]
pub struct Orthographic {
    /// A pixel's side in the world (m).
    pixel: f64,
    /// Half the picture's columns and rows (pixels).
    centre: [f64; 2],
}

impl OrthographicSpec {
    /// The pose and projection. `subject` is asked for only when something is to be chosen.
    pub(crate) fn build<'a>(
        &self,
        subject: impl FnOnce() -> Subject<'a>,
    ) -> Result<(Pose, Orthographic), CameraError> {
        if let Some(Metres(height)) = self.height
            && !(height > 0.0 && height.is_finite())
        {
            let why = format!("{height} m is not above zero");
            return Err(CameraError::new("height", why));
        }
        let aspect = self.sensor.aspect();
        let given = self.pose.as_ref().map(PoseSpec::build).transpose();
        let given = given.map_err(|error| error.under("pose"))?;
        let (pose, height) = match (given, self.height) {
            (Some(pose), Some(Metres(height))) => (pose, height),
            (Some(pose), None) => (pose, framing::orthographic_height(subject(), &pose, aspect)),
            (None, height) => {
                let (pose, fitting) = framing::orthographic(subject(), aspect);
                (pose, height.map_or(fitting, |Metres(height)| height))
            }
        };
        let [width, rows] = self.sensor.resolution.map(f64::from);
        Ok((pose, Orthographic { pixel: height / rows, centre: [0.5 * width, 0.5 * rows] }))
    }
}

impl Orthographic {
    /// A pixel's side in the world (m).
    #[must_use]
    pub fn metres_per_pixel(&self) -> f64 {
        self.pixel
    }

    /// Returns the camera on pixels `factor` times as large.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { pixel: self.pixel * factor, centre: self.centre.map(|c| c / factor) }
    }

    /// The place of the axis on the sensor (pixels from the corner).
    #[must_use]
    pub fn centre(&self) -> [f64; 2] {
        self.centre
    }

    /// Turns places on the sensor (pixels from the corner), which stand in the first two arrays of
    /// the directions, into parallel rays. All arrays have the same length.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        let (right, down, forward) = (pose.right(), -pose.up(), pose.forward());
        let RaysMut { origins, directions: [dx, dy, dz], .. } = rays.arrays_mut();
        for (axis, origins) in origins.into_iter().enumerate() {
            let (start, right, down) = (pose.position[axis], right[axis], down[axis]);
            for ((origin, u), v) in origins.iter_mut().zip(&*dx).zip(&*dy) {
                let (x, y) = ((u - self.centre[0]) * self.pixel, (v - self.centre[1]) * self.pixel);
                *origin = start + (right * x + down * y);
            }
        }
        dx.fill(forward.x);
        dy.fill(forward.y);
        dz.fill(forward.z);
    }
}
