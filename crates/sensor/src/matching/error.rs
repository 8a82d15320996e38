//! Refusals of photographs that cannot be matched.

use etendue_report::Refusal;

use crate::SensorError;

/// Error of a photograph that cannot be matched. The message says what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// A film that is not the sensor's.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The photograph, or what the sensor is; whoever asked knows the place of either.
    #[error(transparent)]
    Refused(Refusal),
}

impl MatchError {
    fn new(why: impl Into<String>, remedy: &str) -> Self {
        Self::Refused(Refusal::new(why).hint(remedy))
    }

    /// Error of a sensor of several numbers a pixel.
    #[must_use]
    pub fn not_raw(numbers: usize) -> Self {
        let why =
            format!("the scene's sensor has {numbers} numbers a pixel, and a raw photograph one");
        Self::new(why, "set camera.sensor.type to `raw`, with the photograph's `cfa`")
    }

    /// Error of a photograph of other columns and rows than the sensor's.
    #[must_use]
    pub fn size(photo: [usize; 2], sensor: [usize; 2]) -> Self {
        let why = format!(
            "has {} x {} pixels, and the scene's sensor {} x {}",
            photo[0], photo[1], sensor[0], sensor[1]
        );
        Self::new(why, "set camera.sensor.resolution to the photograph's")
    }

    /// Error of a photograph of which a share (0..=1) of the pixels is at an end of the scale, `level` (DN).
    pub(super) fn clipped(share: f64, level: f64, end: &str, remedy: &str) -> Self {
        let percent = 100.0 * share;
        let why = format!(
            "is clipped: {percent:.1} % of its pixels are at {level}, the {end} of its scale"
        );
        Self::new(why, remedy)
    }

    /// Error of numbers that do not go with the light: they bend by so many percent of the brightest.
    pub(super) fn not_linear(percent: f64) -> Self {
        let why = format!(
            "is not linear in the scene's light: its numbers bend by {percent:.0} % of the brightest; it is gamma-encoded or \
             developed, or shows another scene"
        );
        Self::new(why, "give the raw numbers, linearised")
    }

    /// Error of one level of light, or none.
    pub(super) fn one_level() -> Self {
        let why = "shows too few levels of light to tell gain from noise and light from black";
        Self::new(why, "photograph a step chart, or a scene with dark and bright parts")
    }
}
