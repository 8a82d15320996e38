#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`timing`] | turns and medians of timed work; the machine that it ran on, and the memory of a process |
//! | [`hits`] | a camera's chief rays and what they scatter into, in batches of any width; how far hits are from the reference's |
//! | [`accelerators`] | each accelerator × batch width × threads |
//! | [`pictures`] | a scene's picture at any number of samples |
//! | [`samplers`] | each sampler × number of samples |
//! | [`cameras`] | each model of the same lens × number of samples |
//! | [`tolerance`] | the cheapest model of a lens within a tolerance, by what pixels see |
//! | [`target`] | which settings reach an error of the sensor's picture soonest, by the time of the whole program |
//! | [`findings`] | all that was measured on a scene: as text, CSV and charts |
//! | [`drawing`] | charts as files, SVG and PNG |

pub mod accelerators;
pub mod cameras;
pub mod drawing;
pub mod findings;
pub mod hits;
pub mod pictures;
pub mod samplers;
pub mod target;
pub mod timing;
pub mod tolerance;

use etendue_accel::BuildError;
use etendue_render::RenderError;
use etendue_render::tolerance::lens_models::NoModels;

/// Told the share done (0..=1) now and then; answering `false` stops.
pub type Progress<'a> = &'a dyn Fn(f64) -> bool;

/// Error of a benchmark that measured nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// A structure could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The scene has layers and no picture.
    #[error(
        "the scene has no `tracer`, so there is no picture to compare\nhint: name one, such as facing"
    )]
    NoPicture,
    /// The camera has no lens that could be simplified.
    #[error("there are no models of the camera's lens: {0}")]
    NoLens(&'static str),
    /// A picture could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A chart could not be turned into pixels; a fault of this program.
    #[error("a chart cannot be drawn as PNG: {0}")]
    Drawing(String),
    /// The scene itself cannot be rendered, or not by so many threads.
    #[error("{0}")]
    Refused(String),
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

impl From<NoModels> for BenchError {
    fn from(NoModels(why): NoModels) -> Self {
        Self::NoLens(why)
    }
}
