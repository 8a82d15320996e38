//! Annotations of the things in a picture, as data sets and compositing programs keep them.
//!
//! | module | idea |
//! |---|---|
//! | `survey` | which copy each chief ray hits, and what each would cover if nothing were before it |
//! | `runs` | masks as runs of pixels, and COCO's text of them |
//! | `rigid` | where a copy stands and how it is turned, and which copies are one model |
//! | `model` | models as PLY files, with boxes and diameters |
//! | `sets` | COCO's file of annotations and BOP's folder, of one picture or of many |
//! | `cryptomatte` | names by their shares of each pixel, in an EXR |
//!
//! Sources: T.-Y. Lin et al., "Microsoft COCO: Common Objects in Context", 2014, with the format at
//! cocodataset.org; T. Hodaň et al., "BOP: Benchmark for 6D Object Pose Estimation", 2018, with the format of its
//! toolkit; J. Friedman and A. Jones, "Fully Automatic ID Mattes with Support for Motion Blur and Transparency", 2015,
//! with Psyop's *Cryptomatte Specification* 1.2.0.

mod cryptomatte;
mod model;
mod rigid;
mod runs;
mod sets;
mod survey;

use etendue_camera::{Distortion, Projection};
use etendue_files::WriteError;
use etendue_scene::Scene;
use serde::{Deserialize, Serialize};

pub use cryptomatte::{CRYPTOMATTE, write as write_cryptomatte};
pub use model::Models;
pub use runs::Mask;
pub use sets::{Shot, Source, write as write_sets, write_depth};
pub use survey::survey;

use crate::output::{OutputError, Outputs, PictureError};
use crate::{NoMemory, RenderError};

/// The name of the file that lists a picture's copies.
pub const INSTANCES: &str = "instances.json";

/// The name of a frame's depth as BOP has it.
pub const BOP_DEPTH: &str = "depth.bop.png";

/// The name of COCO's file.
pub const COCO: &str = "coco.json";

/// The name of BOP's folder.
pub const BOP: &str = "bop";

/// The most copies whose whole silhouettes are traced: each takes a structure of its own.
const MOST_SILHOUETTES: usize = 10_000;

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

/// Bytes that a pixel takes while its annotations are made.
pub(crate) fn bytes_a_pixel(outputs: Outputs) -> u64 {
    let survey = if outputs.annotates() { survey::BYTES_A_PIXEL } else { 0 };
    let mattes = if outputs.cryptomatte { cryptomatte::BYTES_A_PIXEL } else { 0 };
    // One after the other.
    survey.max(mattes)
}

/// Reason why `scene` has no such annotations, with the remedy; `None` where it has what `outputs` ask for.
#[must_use]
pub fn refusal(scene: &Scene, outputs: Outputs) -> Option<String> {
    let kind = match outputs {
        Outputs { bop: true, .. } => "bop",
        Outputs { coco: true, .. } => "coco",
        _ => return None,
    };
    let refuse = |why: &str| Some(format!("outputs: `{kind}` {why}, or leave `{kind}` out"));
    if scene.picture.is_none() || !outputs.png {
        return refuse(
            "annotates picture.png, which is not written\nhint: give the scene a `tracer`, `png` to the outputs",
        );
    }
    if scene.camera.light_field().is_some() {
        return refuse(
            "annotates one view, and a light-field camera has many\nhint: take a `pinhole`",
        );
    }
    if !outputs.bop {
        return None;
    }
    let is_plain = match scene.camera.projection() {
        Projection::Pinhole(pinhole) => pinhole.distortion().map(Distortion::spec).is_none(),
        _ => false,
    };
    if !is_plain {
        return refuse(
            "has cameras that K alone describes\nhint: take a `pinhole` without `distortion` (`etendue plan --models` \
             prints that of a lens)",
        );
    }
    if scene.camera.rows_differ() {
        return refuse(
            "has one pose a picture, and rows of this one see different moments\nhint: set `camera.shutter.type` to `global`",
        );
    }
    if let Some(mesh) = scene.geometry.meshes.iter().find(|mesh| mesh.steps.is_some()) {
        let name = etendue_scene::escape::printable(&mesh.name);
        return refuse(&format!(
            "has rigid models, and the mesh \"{name}\" changes its shape while the shutter is open\nhint: set `exposure` to 0"
        ));
    }
    let copies = scene.copies.iter().map(|copies| copies.count as usize).sum::<usize>();
    if copies > MOST_SILHOUETTES {
        return refuse(&format!(
            "traces each of the {copies} copies by itself, of which there may be {MOST_SILHOUETTES}; join what is no \
             object of its own in one mesh"
        ));
    }
    None
}
