#![doc = include_str!("../README.md")]
//!
//! # Conventions
//!
//! * The camera's frame is right-handed: it looks along −Z, +Y is up, +X is right (glTF's camera).
//!   Its origin is the **entrance pupil**: the pinhole, the thin lens' centre, the paraxial entrance
//!   pupil of a real lens. Distances in the world are metres.
//! * Inside a lens [`etendue_optics`]' conventions hold: millimetres, +z from the object to the sensor.
//! * Row 0 of an image is the top, column 0 the left; pictures are upright.

#![forbid(unsafe_code)]

pub mod camera;
pub mod camera_file;
pub mod camera_spec;
pub mod curve_files;
pub mod distortion;
pub mod exposure;
mod falloff;
pub mod framing;
pub mod intrinsics;
pub mod lens;
pub mod light_field;
pub mod motion;
pub mod opencv_fit;
pub mod pinhole;
mod place;
pub mod pose;
pub mod sampler;
pub mod samples;
pub mod shutter;
mod sobol;

pub use camera::{Camera, PixelExtent, Projection};
pub use camera_file::{CameraFile, ProjectionName};
pub use camera_spec::CameraSpec;
pub use distortion::{Distortion, DistortionSpec};
pub use falloff::{FalloffSpec, LitPlace};
pub use framing::{Subject, SupportFunction, Viewpoint};
pub use intrinsics::{Intrinsics, IntrinsicsSpec, PixelOrigin, SensorSpec};
pub use lens::{
    BandGroup, BandLandings, CameraResources, ChromaticRealLensCameraSpec, LensAccuracy,
    LensCamera, LensCameraSpec, RealLensCameraSpec, SharedPaths, SharingLimits, ThinLensCameraSpec,
    WaveAccuracy, WaveLens,
};
pub use light_field::{LightField, LightFieldSpec, ViewGrid};
pub use motion::{CameraMotionSpec, CameraTime, Kinematics, MotionAxes, Trajectory};
pub use opencv_fit::OpencvFit;
pub use pinhole::{Orthographic, OrthographicSpec, Pinhole, PinholeLanes, PinholeSpec};
pub use pose::{Convention, Maps, Pose, PoseSpec};
pub use sampler::{PixelRun, PixelSample, PixelSamples, SampleKeys, Sampler, squares_of_pair};
pub use samples::{CameraRays, FilmSamples, PixelBlock};
pub use shutter::{Readout, Shutter, ShutterKind, ShutterSpec, TruthAt};

/// A camera's description that makes no camera: where in it, and why.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{at}: {why}")]
pub struct CameraError {
    /// The key inside the camera, with dots and indices (`sensor.resolution`, `pose.up`).
    pub at: String,
    /// Description of the error, and of what is valid.
    pub why: String,
}

impl CameraError {
    /// At the key `at`, because of `why`.
    #[must_use]
    pub fn new(at: impl Into<String>, why: impl Into<String>) -> Self {
        Self { at: at.into(), why: why.into() }
    }

    /// The same error of what is written under `key`: its own key stands behind that.
    #[must_use]
    pub fn under(self, key: &str) -> Self {
        let dot = if self.at.is_empty() || self.at.starts_with('[') { "" } else { "." };
        Self { at: format!("{key}{dot}{}", self.at), ..self }
    }
}
