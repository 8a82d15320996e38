#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`plan`] | what a scene needs, decided in one place, with reasons |
//! | [`render`](mod@render) | build, decode, trace: from a loaded scene to a picture |
//! | [`denoise`] | the picture without its noise, by Open Image Denoise |
//! | [`expose`] | what the camera's sensor makes of the light |
//! | [`light_field`] | what a light-field camera leaves beside its picture |
//! | [`output`] | the named layers of a render, and EXR, PNG, NPY and JSON files of them |
//! | [`report`] | what a render did and what it cost |
//! | [`Watch`] | who is told how far a render is, and may stop it |
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]

mod adaptive;
mod adding;
mod alike;
pub mod annotations;
mod band_paths;
mod build;
mod checkpoint;
pub mod denoise;
mod diffraction;
mod error;
pub mod expose;
mod film;
mod film_file;
mod forecast;
mod gaps;
mod images;
pub mod light_field;
mod lighting;
pub mod losses;
mod memory;
mod merge;
mod names;
mod other_frame;
pub mod output;
mod passes;
pub mod plan;
mod precision;
mod radiance;
pub mod render;
pub mod report;
mod samples;
mod sampling;
pub mod serial;
mod shard;
mod sparkles;
mod state;
mod stopping;
mod sum;
mod tile;
mod tiles;
pub mod tolerance;
mod watch;

pub use adaptive::SampleCounts;
pub use band_paths::BandPaths;
pub use build::{build, build_without, check_extent, rebuild};
pub use checkpoint::Checkpoint;
pub use error::RenderError;
pub use film::Precision;
pub use film_file::{FilmError, FilmFile, FilmHeader, Identity};
pub use images::Images;
pub use memory::NoMemory;
pub use other_frame::FollowedFrame;
pub use plan::{Plan, Unseen};
pub use render::{Progress, Rendered, finish, render, sample_set, trace};
pub use report::{Report, Seconds};
pub use shard::{Shard, ShardBy};
pub use state::{Film, Prepared, RenderState, RenderedScene};
pub use stopping::Stopping;
pub use watch::{SoFar, Watch};
