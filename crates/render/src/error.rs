//! Errors of renders.

use etendue_accel::BuildError;
use etendue_oidn::OidnError;
use etendue_tracer::texture::ImageError;

use crate::film::NoMemory;
use crate::film_file::FilmError;
use crate::output::PictureError;
use crate::watch::Stopped;

/// Error of a render.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The acceleration structure could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The backend was left out when this program was built.
    #[error(
        "this program was built without {0}\nhint: use `--accel bvh`, or build it with the feature"
    )]
    Absent(&'static str),
    /// An instruction set was asked for that the backend cannot be told.
    #[error(
        "only Embree can be told an instruction set\nhint: leave `--isa` out, or use `--accel embree`"
    )]
    NotEmbree,
    /// The result is no picture; a fault of this program.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The camera's pupil cannot be sampled: nothing gets through the lens at the wavelengths that
    /// are wanted.
    #[error("camera: {0}")]
    Camera(String),
    /// Rays were sent, and not one left the lens.
    #[error(
        "the picture would be black: no ray gets from the sensor past element {element} of the \
         camera's lens, counted from 0 on the object side ({})",
        losses.join(", ")
    )]
    Dark {
        /// The element nearest to the object at which rays ended.
        element: usize,
        /// Shares of the rays by where they ended.
        losses: Vec<String>,
    },
    /// The system has less memory than the film takes.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The picture cannot be spread as waves are.
    #[error("camera.diffraction: {0}")]
    Diffraction(String),
    /// A light's spectrum is of no use to the sensor.
    #[error(
        "a light's spectrum: {0}\nhint: give the light `equal_energy`, `a` or {{\"black_body\": kelvin}}, \
         which reach further, or a curve or cube that does, or the sensor a quantum_efficiency or bands that see it"
    )]
    Lights(String),
    /// The environment is no image that can be read, or an image of the scene is too large.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A checkpoint of samples that go on until an error is reached: those are not kept on the way.
    #[error(
        "--checkpoint: samples that go on until an error is reached are not kept on the way\nhint: give \
         `render.samples` a number, or divide the render by --shard"
    )]
    Checkpoint,
    /// A share of samples that go on until an error is reached: each is chosen by all before it.
    #[error(
        "--shard-by samples: samples that go on until an error is reached are not known beforehand\nhint: give \
         `render.samples` a number, or divide the rows, by --shard alone"
    )]
    SampleShares,
    /// A time ends differently on each machine, so that parts of a picture do not fit together.
    #[error(
        "--shard, --checkpoint: a time (`render.samples.time`) ends at another number of samples in each \
         part\nhint: give `render.samples` a number"
    )]
    Timed,
    /// A file of what is filled of a film cannot be used.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// Shares of a render do not make a whole.
    #[error("{0}")]
    Shares(String),
    /// The picture has no noise that could be taken away.
    #[error("{0}")]
    NotDenoised(String),
    /// Open Image Denoise is not there, or failed.
    #[error("--denoise: {0}")]
    Denoise(#[from] OidnError),
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for RenderError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}
