#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Conventions
//!
//! * Numbers carry EMVA's names and units: electrons (e⁻), digital numbers (DN), seconds,
//!   micrometres of pixel pitch, nanometres of wavelength, kelvin.
//! * The system gain K is in DN/e⁻; what data sheets call e⁻/DN is its inverse.
//! * A film is `[row][column][band]`, an image `[row][column][channel]`; row 0 is the top.
//! * Fixed patterns follow from the serial number and the pixel, temporal noise from the seed, the
//!   serial number, the frame and the pixel: the same image for any number of threads, and a crop is
//!   a crop.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`spec`] | the sensor as a scene file writes it |
//! | [`effects`] | parts of real chips: defects, blooming, second read-outs, angles |
//! | [`preset`] | sensors of the trade |
//! | [`cfa`] | colour filter arrays |
//! | [`bands`] | the fewest spectral bands that count electrons right |
//! | [`film`] | what a sensor is given and gives back; what a sensor's own noise hides |
//! | [`sensor`] | a sensor ready to expose, and pictures of what it saw |
//! | [`demosaic`] | missing colours |
//! | [`dng`] | raw files |
//! | [`matching`] | the numbers of a sensor by which a simulation matches a photograph |
//! | [`packed`] | raw numbers of 10 and 12 bits as MIPI packs them |
//! | [`emva`] | the image series of a characterisation |
//! | [`slanted_edge`] | the modulation transfer of a camera from a picture of an edge |
//! | [`photon_transfer`] | photon-transfer and SNR curves |
//! | [`approximation`] | where the normal distribution is no substitute |

pub mod approximation;
pub mod bands;
pub mod cfa;
mod chain;
mod chip;
pub mod demosaic;
pub mod dng;
pub mod effects;
pub mod emva;
mod error;
mod exposing;
pub mod film;
mod hdr;
mod inertial;
mod least_squares;
pub mod matching;
mod moments;
mod noise_floor;
mod normal;
pub mod packed;
mod philox;
pub mod photon_transfer;
mod poisson;
pub mod preset;
mod presets;
mod response;
mod responsivity;
mod second;
pub mod sensor;
mod settings;
pub mod slanted_edge;
pub mod spec;
mod whole_frame;
mod window;

pub use bands::{BandChoice, Factor, Illumination, Times};
pub use cfa::CfaSpec;
pub use effects::{
    AngularResponse, AutoExposure, Defect, DefectMap, ListedDefect, Photodiodes, SecondReadout,
};
pub use error::SensorError;
pub use film::{Exposure, Film, InvalidValues, Moments, RawImage};
pub use hdr::HdrImage;
pub use inertial::{InertialError, InertialNoise, InertialNoiseSpec};
pub use noise_floor::NoiseFloor;
pub use packed::Packing;
pub use philox::mixed_seed;
pub use preset::{Model, Preset};
pub use sensor::Sensor;
pub use settings::EXPOSURES;
pub use spec::{
    ChannelSet, ChannelSpec, Channels, IsoSetting, NoiseModel, Radiometry, SensorKind, SensorSpec,
};
pub use window::Window;
