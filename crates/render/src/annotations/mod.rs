//! Annotations of the things in a picture, as data sets and compositing programs keep them.
//!
//! | module | idea |
//! |---|---|
//! | `annotated` | what is told of each copy |
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

mod annotated;
mod cryptomatte;
mod model;
mod rigid;
mod runs;
mod sets;
mod survey;

use etendue_camera::{Distortion, Projection};
use etendue_scene::Scene;

pub use annotated::{Annotated, AnnotationError, Instance, PinholeCamera, Pose, Silhouette};
pub use cryptomatte::{CRYPTOMATTE, write as write_cryptomatte};
pub use model::Models;
pub use runs::Mask;
pub use sets::{Shot, Source, write as write_sets, write_depth};
pub use survey::survey;

use crate::output::Outputs;

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
            "traces each of the {copies} copies by itself, of which there may be {MOST_SILHOUETTES}\nhint: join what is \
             no object of its own in one mesh"
        ));
    }
    None
}
