//! Cameras with a lens: how a scene writes them, and how places on their sensor become rays.
//!
//! Every one of them is an [`OpticalTrain`](etendue_optics::train::OpticalTrain) focused on a sensor; they
//! differ in how the train is written.
//!
//! | module | idea |
//! |---|---|
//! | [`spec`] | the cameras of the scene file, the lens files that they stand for, and a lens by itself as a camera |
//! | [`source`] | a lens by its file or in place, and parts put on its axis |
//! | [`focused`] | a lens and its sensor: where pixels lie, and the paraxial camera of both |
//! | [`chief`] | the chief rays of a whole sensor; which lenslet a place on the sensor belongs to; the part of the sensor that light reaches |
//! | [`lens_camera`] | chief rays for data, and what is measured for pictures |
//! | `accuracy` | numbers of it that trade accuracy for time |
//! | `keys` | what cameras with a lens have in common in a scene file |
//! | `opened` | the same measured for the bands of a picture |
//! | `nodes` | wavelengths that rays of all bands are traced at |
//! | `implausible` | sizes that no camera has |
//! | `paths` | rays of a pixel on their way through the lens |
//! | `rays` | weighted rays of the pupil for pictures |
//! | [`waves`] | how light is spread on the sensor as waves, and what of it arrives |
//! | `traced_at` | bands whose rays run together through the lens |
//! | `band_paths` | one ray of the scene for all bands: why, and by how many wavelengths |
//! | `rims` | rays that pass at some wavelengths, and at all |
//! | `displacements` | where rays that are traced at one wavelength land at others |
//! | `band_landings` | such rays, and where each band's light of them lands |

mod accuracy;
mod band_landings;
mod band_paths;
pub mod chief;
mod displacements;
pub mod focused;
mod implausible;
pub(crate) mod keys;
pub mod lens_camera;
mod nodes;
mod opened;
mod paths;
mod rays;
mod rims;
pub mod source;
pub mod spec;
mod traced_at;
pub mod waves;

pub use accuracy::{LensAccuracy, WaveAccuracy};
pub use band_landings::BandLandings;
pub use band_paths::SharedPaths;
pub use chief::LensletChiefs;
pub use focused::FocusedLens;
pub use lens_camera::LensCamera;
pub use nodes::SharingLimits;
pub use source::{CameraResources, LensSource, PlacedSpec};
pub(crate) use spec::alone;
pub use spec::{
    ChromaticRealLensCameraSpec, LensCameraSpec, RealLensCameraSpec, ThinLensCameraSpec,
};
pub use traced_at::BandGroup;
pub use waves::WaveLens;
