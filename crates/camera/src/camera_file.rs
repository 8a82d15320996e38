//! `camera.json`: the camera as computer vision reads it, written beside every picture.

use glam::DMat4;
use serde::{Deserialize, Serialize};

use crate::distortion::{Distortion, DistortionSpec};
use crate::{Camera, Convention, PixelOrigin, Projection};

/// A camera's projection and pose in OpenCV's convention: x right, y down, z forward, metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraFile {
    /// How points are projected; decides which of `k` and `orthographic` is there.
    pub projection: ProjectionName,
    /// Columns and rows.
    pub resolution: [u32; 2],
    /// What `k`'s principal point is counted from: as the scene gave it, else the centre of the top
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
    /// K's fy in millimetres, when the pixel pitch is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length_mm: Option<f64>,
}

/// How points are projected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionName {
    /// Through one point.
    Perspective,
    /// Through one point, with OpenCV's fisheye model.
    Fisheye,
    /// In parallel.
    Orthographic,
}

/// Lens distortion for OpenCV.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DistortionFile {
    /// `none`, `brown_conrady` or `fisheye` (for OpenCV's functions of that name).
    pub model: String,
    /// `distCoeffs` in OpenCV's order; empty for no distortion.
    pub coefficients: Vec<f64>,
}

/// What stands in for K when rays are parallel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrthographicFile {
    /// A pixel's side in the world (m).
    pub metres_per_pixel: f64,
    /// Where the axis meets the sensor (pixels, counted from `pixel_origin`).
    pub principal_point: [f64; 2],
}

impl Camera {
    /// The camera as `camera.json` tells it.
    #[must_use]
    pub fn opencv(&self) -> CameraFile {
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
        };
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

fn by_rows(matrix: DMat4) -> [[f64; 4]; 4] {
    // −0 would be read as a sign that means something.
    matrix.transpose().to_cols_array_2d().map(|row| row.map(|x| x + 0.0))
}
