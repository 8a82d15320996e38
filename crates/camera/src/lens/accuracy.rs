//! Numbers of a camera with a lens that trade accuracy for time, and the camera by others than its own.

use etendue_optics::analysis::between::WAVEFRONT_ERROR;
use etendue_optics::train::pupil::{PupilAccuracy, without_dimming};

use super::chief::ImageCircle;
use super::lens_camera::LensCamera;
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

impl LensCamera {
    /// The numbers by which it is measured.
    #[must_use]
    pub fn accuracy(&self) -> LensAccuracy {
        self.accuracy
    }

    /// Returns the camera measured by other numbers. What was measured of its pupil stays where they are the same.
    pub(crate) fn with_accuracy(&self, accuracy: LensAccuracy) -> Self {
        let mut own = self.clone();
        if accuracy != self.accuracy {
            own.opened = None;
        }
        let error = accuracy.pupil.image_circle;
        if error != self.accuracy.pupil.image_circle {
            own.lit = self.lit_within(error);
        }
        own.accuracy = accuracy;
        own
    }

    /// The region of the sensor where light arrives, its edge to within a share of its distance.
    fn lit_within(&self, error: f64) -> ImageCircle {
        let train = without_dimming(&self.focused.train().without_arrays());
        let film = self.focused.film();
        match train.at(train.wavelength()) {
            Ok(clear) => ImageCircle::measure(&train, &clear, film.frame, film.half_size(), error),
            Err(_) => self.lit.clone(),
        }
    }
}
