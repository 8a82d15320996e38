//! Annotation of a picture: each copy of each object, where it is and what is seen of it.

use etendue_files::WriteError;
use serde::{Deserialize, Serialize};

use super::runs::Mask;
use crate::output::{OutputError, PictureError};
use crate::{NoMemory, RenderError};

/// Error of annotations that could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnnotationError {
    /// Rays could not be traced, or it was stopped.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl From<WriteError> for AnnotationError {
    fn from(error: WriteError) -> Self {
        Self::Output(error.into())
    }
}

impl From<PictureError> for AnnotationError {
    fn from(error: PictureError) -> Self {
        Self::Render(error.into())
    }
}

impl From<NoMemory> for AnnotationError {
    fn from(error: NoMemory) -> Self {
        Self::Render(error.into())
    }
}

/// Annotation of the copies of objects in one picture: `instances.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Annotated {
    /// The program.
    pub software: String,
    /// Columns (pixels).
    pub width: u32,
    /// Rows (pixels).
    pub height: u32,
    /// The camera, of pinholes without distortion.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub camera: Option<PinholeCamera>,
    /// Millimetres of one step of BOP's depth image; absent where there is none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub depth_scale_mm: Option<f64>,
    /// The copies of which something is in the picture, or would be if nothing were before it.
    pub instances: Vec<Instance>,
}

/// A camera that its matrix says all of.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct PinholeCamera {
    /// K by rows (pixels), counted from the centre of the top left pixel, as OpenCV does.
    #[serde(rename = "K")]
    pub k: [[f64; 3]; 3],
    /// World to camera, by rows (m); x right, y down, z forward.
    pub camera_from_world: [[f64; 4]; 4],
}

/// One copy of an object in a picture.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Instance {
    /// Its number in `Id.instance`.
    pub instance: u32,
    /// The number of its object in `Id.object`.
    pub object: u32,
    /// The name of its object.
    pub name: String,
    /// The pixels whose chief rays hit it first.
    pub visible: Mask,
    /// Pixels that it would cover if nothing were before it; only of BOP's sets.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub silhouette: Option<Silhouette>,
    /// Its place and rotation; only of BOP's sets, and of what can be rigid.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub pose: Option<Pose>,
}

/// Pixels that a copy would cover if nothing were before it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Silhouette {
    /// Its pixels in the picture.
    pub mask: Mask,
    /// Those of them whose chief rays hit something, which they always do here.
    pub pixels: u32,
    /// All its pixels, also outside of the picture, as far as a picture's width and height on each side.
    pub all_pixels: u32,
    /// The box around them: the least column and row, and the greatest less these (pixels).
    #[serde(rename = "box")]
    pub bounds: [i64; 4],
}

/// Place and rotation of a model.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Pose {
    /// World from model, by rows: a proper rotation.
    pub rotation: [[f64; 3]; 3],
    /// The model's origin in the world (m).
    pub translation: [f64; 3],
    /// Name of the model: the same word for the same shape, whatever its place.
    pub model: String,
}
