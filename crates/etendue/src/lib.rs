#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Map
//!
//! | item | idea |
//! |---|---|
//! | [`Session`] | a scene, opened once, changed and rendered often |
//! | [`Rendering`] | layers as arrays, the sensor's images, files of them, the report |
//! | [`ViewedFile`], [`Still`] | a file to look at, by what it is: a scene, a model, a lens, an image |
//! | [`LightImage`], [`ExposedImage`] | a picture of light from elsewhere, and what a sensor makes of it |
//! | [`Preview`], [`Screen`], [`Viewpoint`], [`Inspector`] | what a window needs: pictures soon, shown, moved about and asked |
//! | [`Frame`], [`Dataset`] | the pictures of a scene that has `frames`, and what others read of them |
//! | [`Shard`], [`Shares`], [`Checkpoint`] | renders that are divided over machines, or interrupted |
//! | [`TimeForecast`], [`Calibration`] | how long a render will take, by what this machine takes for a ray |
//! | [`calibrate`] | the pictures by which a camera is calibrated |
//! | [`match_photo`] | what makes a simulation match a photograph |
//! | [`Denoiser`] | Open Image Denoise, where its library is there |
//! | [`Progress`] | how far work is, and how it is stopped |
//! | [`Error`] | why something could not be done, in a sentence |
//! | [`places`] | where results go |
//!
//! The parts that it is made of can be used by themselves: `etendue-optics` is a library of lens design,
//! `etendue-sensor` a sensor after EMVA 1288, `etendue-accel` an exact ray caster.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]

mod calibration_set;
mod changes;
mod dataset;
mod error;
mod exposed_image;
mod forecast;
mod frame_files;
mod inspector;
mod lens_view;
mod lens_waves;
mod light_image;
mod neighbours;
mod options;
mod photo_match;
pub mod places;
mod preview;
mod progress;
mod records;
mod rendering;
mod saving;
mod session;
mod still;
mod structures;
mod viewpoint;
mod words;

pub use calibration_set::{CalibrationOptions, calibrate};
pub use dataset::Dataset;
pub use error::Error;
pub use etendue_files::Reach;
pub use etendue_oidn::{Denoiser, OidnError};
pub use etendue_optics::analysis::fans::FanRay;
pub use etendue_render::expose::{KNOWN_UNITS, LightUnit, PixelLight};
pub use etendue_render::light_field::LightFieldViews;
pub use etendue_render::output::{
    Channel, DistanceScale, HeaderEntry, Layer, Look, Outputs, Picture, Screen, Values,
};
pub use etendue_render::tolerance::Verified;
pub use etendue_render::{Checkpoint, Plan, Report, Shard, ShardBy, SoFar};
pub use etendue_report::{Decision, DecisionKind, DecisionValue, Refusal, Saving, Tabled};
pub use etendue_scene::file::scene_schema;
pub use etendue_scene::{Frame, RigCamera, Scene, ScenePath, Setting, Strictness};
pub use exposed_image::{ExposedFrame, ExposedImage, write_frames};
pub use forecast::{Calibration, TimeForecast};
pub use frame_files::FramePattern;
pub use inspector::{Inspector, Probe};
pub use lens_view::{LensView, lens_values};
pub use lens_waves::{FieldCurves, LensWaves};
pub use light_image::{ExposeOptions, LightImage};
pub use options::Options;
pub use photo_match::{PhotoMatch, RawPhoto, match_photo};
pub use preview::{Preview, Roughness};
pub use progress::{Phase, Progress};
pub use rendering::{Rendering, WrittenFiles};
pub use session::{MeshAttributes, Prospect, Session, Shares, read_glasses};
pub use still::{Still, ViewedFile};
pub use viewpoint::Viewpoint;

/// The layers by the names that scenes give them.
#[must_use]
pub fn layer_names() -> &'static [&'static str] {
    &etendue_tracer::LayerSpec::NAMES
}
