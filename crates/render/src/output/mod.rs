//! Images on disk: a [`Picture`] of named layers goes out as EXR, PNG, NPY and JSON.
//!
//! | file | what it is for | what it holds |
//! |---|---|---|
//! | EXR | the data | all layers in one part, `Layer.Channel`, 32-bit, lossless |
//! | NPY | the data, for numpy | one layer, `[h, w]` or `[h, w, c]`, little-endian, f64 too |
//! | HDR and IMG | the bands, for programs of remote sensing | one layer as an ENVI cube: [`envi`] |
//! | PNG | looking, and a sensor's digital numbers | one layer, 8 or 16 bits |
//! | PNG, FLO | what TUM's and KITTI's tools read | depth, disparity, flow, masks: [`conventions`] |
//! | PFM | disparities, for light-field benchmarks | one plane, f32 |
//! | JSON | what the others mean | definition, unit, frame, miss … of each layer |
//!
//! Conventions of all of them:
//!
//! * Row 0 is the top, pixels of a row run from left to right.
//! * A miss is `+inf` in a float layer, 0 in an integer layer and the zero vector in a direction.
//! * A NaN is never written: [`Picture::new`] refuses it, with the layer and the pixel.
//! * Data passes no colour transform. PNG previews do, and say so in their text.
//! * A file appears under its name when it is complete, and not before ([`PartFile`](etendue_files::PartFile)).
//!
//! ```
//! use etendue_files::Transaction;
//! use etendue_render::output::{Channel, HeaderEntry, Layer, Look, Picture, Values, exr};
//!
//! let depth = Layer {
//!     name: "Depth".into(),
//!     look: Look::Distance,
//!     channels: vec![Channel { name: "Z".into(), values: Values::F32(vec![1.0, f32::INFINITY]) }],
//!     meaning: vec![HeaderEntry::new("unit", "m"), HeaderEntry::new("miss", "+inf")],
//! };
//! let picture = Picture::new(2, 1, vec![depth], vec![HeaderEntry::new("seed", "0")])?;
//! let folder = tempfile::tempdir()?;
//! exr::write(&Transaction::at_once(), &folder.path().join("picture.exr"), &picture, &exr::Options::default())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod conventions;
pub mod envi;
pub mod exr;
pub mod imu;
pub mod npy;
pub mod pfm;
pub mod png;
pub mod sidecar;

mod develop;
mod error;
mod hash;
mod layer;
mod layer_file;
mod look;
mod outputs;
mod picture;
mod screen;

pub use develop::Development;
pub(crate) use develop::luminance;
pub use error::{OutputError, PictureError};
pub use hash::ImageHash;
pub use layer::{Channel, HeaderEntry, Layer, Values};
pub(crate) use layer_file::has_mask;
pub use layer_file::{LayerFile, layer_stem};
pub use look::Look;
pub use outputs::Outputs;
pub use picture::Picture;
pub use screen::{DistanceScale, Screen};

/// Name of the layer of a hyperspectral cube.
pub const SPECTRUM: &str = "Spectrum";

/// The name of the layer.
pub const DENOISED: &str = "Denoised";
