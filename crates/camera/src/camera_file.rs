//! `camera.json`: the camera as computer vision reads it, written beside every picture.

use glam::DMat4;
use serde::{Deserialize, Serialize};

use crate::distortion::{Distortion, DistortionSpec};
use crate::lens::focused::View;
use crate::{
    Camera, Convention, LensCamera, PixelOrigin, Pose, Projection, Readout, ShutterKind, TruthAt,
};

/// A camera's projection and pose in OpenCV's convention: x right, y down, z forward, metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraFile {
    /// Projection of points; decides which of `k` and `orthographic` is there.
    pub projection: ProjectionName,
    /// Columns and rows.
    pub resolution: [u32; 2],
    /// Origin of `k`'s principal point: as the scene gave it, else the centre of the top
    /// left pixel, as OpenCV does.
    pub pixel_origin: PixelOrigin,
    /// The matrix K by rows (pixels); `null` for parallel rays, which have none.
    #[serde(rename = "K")]
    pub k: Option<[[f64; 3]; 3]>,
    /// Lens distortion, `null` for parallel rays.
    pub distortion: Option<DistortionFile>,
    /// For parallel rays: u = x / `metres_per_pixel` + cx, v likewise.
    pub orthographic: Option<OrthographicFile>,
    /// The axes of the camera in both matrices.
    pub convention: Convention,
    /// World-to-camera by rows (m): OpenCV's extrinsics `[R | t]` over `[0 0 0 1]`.
    pub camera_from_world: [[f64; 4]; 4],
    /// Camera-to-world by rows (m), the inverse.
    pub world_from_camera: [[f64; 4]; 4],
    /// From one pixel's centre to the next (µm), when the scene says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_pitch_um: Option<f64>,
    /// K's fy in millimetres, when the pixel pitch is known: behind a lens, the image distance and
    /// not the focal length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length_mm: Option<f64>,
    /// The lens, when there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<LensFacts>,
    /// Times at which the rows are seen, when the scene names a shutter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shutter: Option<ShutterFile>,
}

/// Times at which the rows of a picture are seen (s since the frame's shutter opened), and the poses that they are seen
/// from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShutterFile {
    /// Times at which rows are open.
    #[serde(rename = "type")]
    pub kind: ShutterKind,
    /// Direction in which rows are read out.
    pub readout: Readout,
    /// From one row's readout to the next one's (s).
    pub line_time_s: f64,
    /// Time for which the row that is read out first is open (s).
    pub exposure_s: f64,
    /// The moment of a row's exposure at which data layers see it.
    pub truth_at: TruthAt,
    /// That moment of the picture's top row and of its bottom one (s).
    pub top_and_bottom_s: [f64; 2],
    /// The pose of each row at that moment, from the top: world-to-camera by rows (m). Where all rows have the pose of
    /// the frame it is empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub camera_from_world_of_rows: Vec<[[f64; 4]; 4]>,
    /// Motion of the camera in the pose of the frame; absent where it stands still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<VelocityFile>,
}

/// Motion of a camera, along its own axes (OpenCV's).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VelocityFile {
    /// Its velocity (m/s).
    pub linear_m_s: [f64; 3],
    /// Its angular velocity (rad/s).
    pub angular_rad_s: [f64; 3],
}

/// Facts about a camera's lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensFacts {
    /// Meaning of `K`.
    pub k_is: String,
    /// The design wavelength (nm), for which the other numbers are.
    pub wavelength_nm: f64,
    /// The effective focal length (mm); `null` for an afocal lens.
    pub effective_focal_length_mm: Option<f64>,
    /// Focal length over the entrance pupil's diameter.
    pub f_number: Option<f64>,
    /// The entrance pupil's diameter (mm).
    pub entrance_pupil_diameter_mm: Option<f64>,
    /// From the first element's vertex back to the camera's origin, the entrance pupil (mm).
    pub entrance_pupil_depth_mm: f64,
    /// The distance of what is in focus from the origin (m); `null` for infinity.
    pub focus_distance_m: Option<f64>,
    /// From the last element's vertex to the sensor (mm).
    pub sensor_distance_mm: f64,
    /// The projected solid angle of the pupil seen from the axis (sr): the irradiance for a radiance
    /// of 1.
    pub pupil_solid_angle_sr: f64,
}

/// Projection of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionName {
    /// Through one point.
    Perspective,
    /// Through one point, with OpenCV's fisheye model.
    Fisheye,
    /// Through a lens that was traced: `K` holds near the axis, and the layer `position` has what
    /// every pixel's chief ray hits.
    Lens,
    /// In parallel.
    Orthographic,
    /// From many points, each in its own part of the picture: `geometry.json` has them.
    Views,
}

/// Lens distortion for OpenCV.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DistortionFile {
    /// `none`, `brown_conrady` or `fisheye` (for OpenCV's functions of that name).
    pub model: String,
    /// `distCoeffs` in OpenCV's order; empty for no distortion.
    pub coefficients: Vec<f64>,
}

/// Numbers in the place of K when rays are parallel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrthographicFile {
    /// A pixel's side in the world (m).
    pub metres_per_pixel: f64,
    /// Intersection of the axis with the sensor (pixels, counted from `pixel_origin`).
    pub principal_point: [f64; 2],
}

impl Camera {
    /// The camera as `camera.json` tells it.
    #[must_use]
    pub fn opencv(&self) -> CameraFile {
        // What every camera has.
        let mut file = CameraFile {
            projection: ProjectionName::Perspective,
            resolution: self.resolution(),
            pixel_origin: PixelOrigin::Center,
            k: None,
            distortion: None,
            orthographic: None,
            convention: Convention::Opencv,
            camera_from_world: by_rows(self.pose().camera_from_world(Convention::Opencv)),
            world_from_camera: by_rows(self.pose().world_from_camera(Convention::Opencv)),
            pixel_pitch_um: self.pixel_pitch(),
            focal_length_mm: None,
            lens: self.lens().map(LensFacts::of),
            shutter: ShutterFile::of(self),
        };
        // What its projection adds.
        match self.projection() {
            Projection::Pinhole(pinhole) => {
                file.pixel_origin = pinhole.pixel_origin();
                file.k = Some(pinhole.intrinsics().matrix(file.pixel_origin));
                let spec = pinhole.distortion().map(Distortion::spec);
                if matches!(spec, Some(DistortionSpec::Fisheye(_))) {
                    file.projection = ProjectionName::Fisheye;
                }
                file.distortion = Some(DistortionFile {
                    model: spec.map_or("none", DistortionSpec::name).to_owned(),
                    coefficients: spec.map(DistortionSpec::coefficients).unwrap_or_default(),
                });
                file.focal_length_mm =
                    self.pixel_pitch().map(|um| um * 1e-3 * pinhole.intrinsics().focal[1]);
            }
            Projection::Lens(lens) => match lens.focused().view() {
                View::Perspective(k) => {
                    let ideal = lens.focused().train().is_ideal();
                    file.projection =
                        if ideal { ProjectionName::Perspective } else { ProjectionName::Lens };
                    file.k = Some(k.matrix(PixelOrigin::Center));
                    file.distortion = ideal
                        .then(|| DistortionFile { model: "none".to_owned(), coefficients: vec![] });
                    file.focal_length_mm = Some(1e-3 * lens.focused().pixel_pitch() * k.focal[1]);
                }
                View::Parallel { metres_per_pixel, centre } => {
                    file.projection = ProjectionName::Orthographic;
                    let principal_point = centre.map(|c| c - PixelOrigin::Center.to_corner());
                    file.orthographic =
                        Some(OrthographicFile { metres_per_pixel, principal_point });
                }
            },
            Projection::Views(_) => file.projection = ProjectionName::Views,
            Projection::Orthographic(orthographic) => {
                file.projection = ProjectionName::Orthographic;
                file.orthographic = Some(OrthographicFile {
                    metres_per_pixel: orthographic.metres_per_pixel(),
                    principal_point: orthographic
                        .centre()
                        .map(|c| c - PixelOrigin::Center.to_corner()),
                });
            }
        }
        file
    }
}

impl ShutterFile {
    fn of(camera: &Camera) -> Option<Self> {
        let shutter = camera.shutter()?;
        let [_, rows] = camera.resolution();
        let time = |row: u32| shutter.truth(f64::from(row) + 0.5);
        let pose =
            |row| by_rows(Pose::camera_from_world(&camera.pose_at(time(row)), Convention::Opencv));
        let differ = camera.rows_differ() && camera.motion().is_some();
        Some(Self {
            kind: shutter.kind(),
            readout: shutter.readout(),
            line_time_s: shutter.line_time(),
            exposure_s: shutter.exposure(),
            truth_at: shutter.truth_at(),
            top_and_bottom_s: [time(0), time(rows - 1)],
            camera_from_world_of_rows: if differ { (0..rows).map(pose).collect() } else { vec![] },
            velocity: camera.motion().map(|motion| {
                let now = motion.kinematics(shutter.truth(0.5 * f64::from(rows)));
                let along = |vector| now.along_camera(vector, Convention::Opencv).to_array();
                let [linear_m_s, angular_rad_s] =
                    [now.velocity, now.angular_velocity].map(along).map(|v| v.map(|x| x + 0.0));
                VelocityFile { linear_m_s, angular_rad_s }
            }),
        })
    }
}

impl LensFacts {
    fn of(lens: &LensCamera) -> Self {
        let focused = lens.focused();
        let paraxial = focused.paraxial();
        let k_is = match focused.view() {
            View::Perspective(_) if focused.train().is_ideal() => {
                "exact for what is in focus: the lens is ideal"
            }
            View::Perspective(_) if lens.lenslets().is_some() => {
                "the paraxial camera of the lens before the lenslets, whose picture they cut up"
            }
            View::Perspective(_) => {
                "the paraxial camera: what the lens does near its axis, without its distortion"
            }
            View::Parallel { .. } => "none: the lens is telecentric towards the object",
        };
        let finite = |x: f64| x.is_finite().then_some(x);
        Self {
            k_is: k_is.to_owned(),
            wavelength_nm: paraxial.wavelength,
            effective_focal_length_mm: paraxial.efl,
            f_number: paraxial.f_number,
            entrance_pupil_diameter_mm: paraxial.entrance_pupil.diameter,
            entrance_pupil_depth_mm: focused.origin(),
            focus_distance_m: finite(focused.object_distance()),
            sensor_distance_mm: focused.sensor_z() - focused.train().last_vertex(),
            pupil_solid_angle_sr: lens.solid_angle(),
        }
    }
}

fn by_rows(matrix: DMat4) -> [[f64; 4]; 4] {
    // −0 would be read as a sign that means something.
    matrix.transpose().to_cols_array_2d().map(|row| row.map(|x| x + 0.0))
}
