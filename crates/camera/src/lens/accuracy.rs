//! Numbers of a camera with a lens that trade accuracy for time.

use etendue_optics::analysis::between::WAVEFRONT_ERROR;
use etendue_optics::train::pupil::PupilAccuracy;

use super::nodes::SharingLimits;

/// Numbers of a camera with a lens that trade accuracy for time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensAccuracy {
    /// Limits within which bands share rays.
    pub sharing: SharingLimits,
    /// Those by which the exit pupil is measured.
    pub pupil: PupilAccuracy,
    /// Those by which light is traced as waves.
    pub waves: WaveAccuracy,
    /// Places on each side of the picture that OpenCV's models are fitted to, two at least.
    pub fit_places: u32,
}

/// Numbers by which the fields of the pupil are traced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaveAccuracy {
    /// Wavelengths that fields are traced at, of a lens that disperses; two at least.
    pub wavelengths: u32,
    /// Greatest difference of a wavefront from the polynomial that stands for it (waves).
    pub error: f64,
}

impl LensAccuracy {
    /// Those of a scene that does not say.
    pub const DEFAULT: Self = Self {
        sharing: SharingLimits::DEFAULT,
        pupil: PupilAccuracy::DEFAULT,
        waves: WaveAccuracy { wavelengths: 3, error: WAVEFRONT_ERROR },
        fit_places: 33,
    };
}
