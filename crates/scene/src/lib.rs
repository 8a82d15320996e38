#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! Two steps, so that a plan can be made between them:
//!
//! 1. [`SceneFile::read`] reads the text, applies settings from the command line and checks every
//!    key and value; nothing else is opened. What it says tells what a render will want.
//! 2. [`SceneFile::load`] opens the models (each once, in parallel), makes the shapes, and puts all
//!    together, leaving out what is not wanted.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`file`](mod@file) | the JSON format: types, schema, errors with their place, settings |
//! | [`import`] | glTF, OBJ and PLY |
//! | [`shape`] | shapes made on load |
//! | [`scene`] | the loaded scene |
//! | [`Frame`] | what is set for each of the pictures of a scene |
//! | [`Cache`] | what is kept from one load to the next |
//! | [`escape`] | text out of files on its way to a terminal |
//! | [`memory`] | how much memory there may be, and an account of it |
//! | [`doctor`] | what a scene holds and what is wrong with it, without rendering |
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]

mod cache;
mod cameras;
mod contradictions;
mod cubes;
pub mod doctor;
pub mod error;
pub mod escape;
mod facing;
pub mod file;
mod frames;
mod identity;
mod idle;
pub mod import;
mod load;
mod materials;
pub mod memory;
mod parts;
pub mod scene;
pub mod serial;
pub mod shape;
mod sniff;
mod words;
mod world_vertices;

pub use cache::Cache;
pub use cameras::{CameraOrigin, SceneCamera};
pub use cubes::{EnviFault, read_envi};
pub use doctor::{Diagnosis, MemoryForecast};
pub use error::SceneError;
pub use etendue_report::Refusal;
pub use file::{FileKind, PathStep, SceneFile, ScenePath, SceneSpec, Setting, scene_schema};
pub use frames::{Frame, Frames, RigCamera, Start};
pub use identity::{Copies, IdName, SceneHash, SceneNode};
pub use import::{Import, Note, NoteKind, Strictness, Wanted};
pub use scene::{LoadOptions, LoadProgress, LoadStats, Scene};
