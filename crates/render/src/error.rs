//! Errors of renders.

use std::fmt;

use etendue_accel::BuildError;
use etendue_oidn::OidnError;
use etendue_report::Refusal;
use etendue_scene::Scene;
use etendue_tracer::texture::ImageError;

use crate::film_file::FilmError;
use crate::memory::NoMemory;
use crate::output::PictureError;
use crate::watch::Stopped;

/// Error of a render.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The acceleration structure could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The result is no picture; a fault of this program.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The system has less memory than the film takes.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The environment is no image that can be read, or an image of the scene is too large.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A file of what is filled of a film cannot be used.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// Open Image Denoise is not there, or failed.
    #[error("--denoise: {0}")]
    Denoise(#[from] OidnError),
    /// Anything else that the scene or the options ask for and that cannot be done.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

impl RenderError {
    /// Error of a camera whose pupil cannot be sampled: nothing gets through the lens at the wavelengths that are
    /// wanted.
    #[must_use]
    pub fn camera(why: impl Into<Refusal>) -> Self {
        why.into().at("camera").into()
    }

    /// Error of a picture that cannot be spread as waves are.
    pub(crate) fn diffraction(why: impl Into<Refusal>) -> Self {
        why.into().at("camera.diffraction").into()
    }

    /// Error of a spectrum of a light of `scene` that is of no use to the sensor.
    pub(crate) fn lights(scene: &Scene, fault: impl fmt::Display) -> Self {
        let remedy = "give the light `equal_energy`, `a` or {\"black_body\": kelvin}, which reach further, or a \
                      curve or cube that does, or the sensor a quantum_efficiency or bands that see it";
        let refusal = Refusal::new(format!("a light's spectrum: {fault}")).hint(remedy);
        refusal.at(scene.path.display()).into()
    }

    /// Error of rays of which not one left the lens of `scene`: the element, counted from the object, nearest to the object at
    /// which rays ended, and the shares of the rays by where they ended.
    pub(crate) fn dark(scene: &Scene, element: usize, losses: &[String]) -> Self {
        let why = format!(
            "the picture would be black: no ray gets from the sensor past element {element} of the \
             camera's lens, counted from 0 on the object side ({})",
            losses.join(", ")
        );
        let refusal = Refusal::new(why).hint("let that element pass light, or leave it out");
        refusal.at(scene.path.display()).into()
    }

    /// Error of samples that end by a time, differently on each machine: parts of a picture would not fit together.
    pub(crate) fn timed() -> Self {
        let why = "a time (`render.samples.time`) ends at another number of samples in each part";
        let refusal = Refusal::new(why).hint("give `render.samples` a number");
        refusal.at("--shard, --checkpoint").into()
    }

    /// Error of a checkpoint of samples that go on until an error is reached.
    pub(crate) fn adaptive_checkpoint() -> Self {
        let why = "samples that go on until an error is reached are not kept on the way";
        let remedy = "give `render.samples` a number, or divide the render by --shard";
        Refusal::new(why).hint(remedy).at("--checkpoint").into()
    }

    /// Error of a share of samples that go on until an error is reached: each is chosen by all before it.
    pub(crate) fn adaptive_shares() -> Self {
        let why = "samples that go on until an error is reached are not known beforehand";
        let remedy = "give `render.samples` a number, or divide the rows, by --shard alone";
        Refusal::new(why).hint(remedy).at("--shard-by samples").into()
    }
}

impl From<Stopped> for RenderError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}
