#![forbid(unsafe_code)]
//! A simulator of computational cameras: a scene and a camera made of optical parts go in, what that
//! camera's sensor records comes out, with exact ground truth beside it.
//!
//! This is the library that a program calls; the `etendue` command stands on it.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let scene = folder.path().join("scene.json");
//! # std::fs::write(&scene, r#"{"etendue": 1, "tracer": {"type": "facing"}, "layers": ["depth"],
//! #     "render": {"samples": 4}, "objects": [{"shape": "sphere"}],
//! #     "camera": {"type": "thin_lens", "focal_length": "50 mm", "fov": 40, "f_number": 8,
//! #                "sensor": {"resolution": [32, 24]}}}"#)?;
//! let mut session = etendue::Session::open(&scene)?; // checked; built when first needed
//! session.set("camera.f_number", 2.8)?; // any path of the scene: only what it touches is made anew
//! let picture = session.render(&etendue::Progress::none())?; // layers as arrays, sensor images, report
//! let depth = picture.layer("Depth").ok_or("no depth")?;
//! println!("{} m in the middle", depth.channels[0].values.at(12 * 32 + 16));
//! # let out = folder.path().join("out");
//! picture.write(&out, etendue::Outputs::ALL)?;
//! # assert!(out.join("layers.exr").exists());
//! # Ok(())
//! # }
//! ```
//!
//! Scenes can be made without any file, of arrays:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = serde_json::json!({
//!     "layers": ["depth"],
//!     "objects": [{"file": "tile"}],
//!     "camera": {"type": "pinhole", "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
//!                "sensor": {"resolution": [8, 8]}},
//! });
//! let mut session = etendue::Session::from_json(".", scene)?;
//! let vertices = [[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]];
//! session.insert_mesh("tile", &vertices, &[[0, 1, 2]])?;
//! let picture = session.render(&etendue::Progress::none())?;
//! assert_eq!(picture.layer("Depth").ok_or("no depth")?.channels[0].values.at(0), 3.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Map
//!
//! | item | idea |
//! |---|---|
//! | [`Session`] | a scene, opened once, changed and rendered often |
//! | [`Rendering`] | layers as arrays, the sensor's images, files of them, the report |
//! | [`Viewed`], [`Still`] | a file to look at, by what it is: a scene, a model, a lens, an image |
//! | [`LightImage`], [`ExposedImage`] | a picture of light from elsewhere, and what a sensor makes of it |
//! | [`Preview`], [`Screen`], [`Viewpoint`], [`Inspector`] | what a window needs: pictures soon, shown, moved about and asked |
//! | [`Frame`], [`Dataset`] | the pictures of a scene that has `frames`, and what others read of them |
//! | [`Shard`], [`Shares`], [`Checkpoint`] | renders that are divided over machines, or interrupted |
//! | [`TimeForecast`], [`Calibration`] | how long a render will take, by what this machine takes for a ray |
//! | [`Denoiser`] | Open Image Denoise, where its library is there |
//! | [`Progress`] | how far work is, and how it is stopped |
//! | [`Error`] | why something could not be done, in a sentence |
//! | [`places`] | where results go |
//!
//! The parts that it is made of can be used by themselves: `etendue-optics` is a library of lens design,
//! `etendue-sensor` a sensor after EMVA 1288, `etendue-accel` an exact ray caster.

mod changes;
mod dataset;
mod error;
mod exposed_image;
mod forecast;
mod frame_files;
mod inspector;
mod lens_view;
mod light_image;
mod neighbours;
mod options;
pub mod places;
mod preview;
mod progress;
mod rendering;
mod saving;
mod session;
mod shares;
mod still;
mod structures;
mod viewed;
mod viewpoint;
mod words;

pub use dataset::Dataset;
pub use error::Error;
pub use etendue_files::Reach;
pub use etendue_oidn::{Denoiser, OidnError};
pub use etendue_render::expose::{KNOWN_UNITS, LightUnit, PixelLight};
pub use etendue_render::light_field::LightFieldViews;
pub use etendue_render::output::{
    Channel, DistanceScale, Layer, Look, Outputs, Picture, Screen, Values,
};
pub use etendue_render::{Checkpoint, Plan, Report, Shard, ShardBy, SoFar};
pub use etendue_report::{Decision, DecisionKind, DecisionValue, Saving, Tabled};
pub use etendue_scene::file::scene_schema;
pub use etendue_scene::{Frame, RigCamera, Scene, Strictness};
pub use exposed_image::{ExposedImage, write_frames};
pub use forecast::{Calibration, Prospect, TimeForecast};
pub use frame_files::FramePattern;
pub use inspector::{Inspector, Probe};
pub use lens_view::{LensView, lens_values};
pub use light_image::{ExposeOptions, LightImage};
pub use options::Options;
pub use preview::{Preview, Roughness};
pub use progress::{Phase, Progress};
pub use rendering::{Rendering, Written};
pub use session::{Session, read_glasses};
pub use shares::Shares;
pub use still::Still;
pub use viewed::Viewed;
pub use viewpoint::Viewpoint;

/// The layers by the names that scenes give them.
#[must_use]
pub fn layer_names() -> &'static [&'static str] {
    &etendue_tracer::LayerSpec::NAMES
}
