//! Film: the light that a sensor is given, and the numbers that it gives back.

use serde::Serialize;

/// The light of a render, as the sensor's [`bands`](crate::Sensor::bands) want it.
#[derive(Debug, Clone, Copy)]
pub struct Film<'a> {
    /// `[row][column][band]`: intensities (1 is full scale) or irradiances (W·m⁻²·nm⁻¹).
    pub values: &'a [f32],
}

/// One exposure of a film.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Exposure {
    /// Exposure time T (s).
    pub exposure: f64,
    /// Number of the frame: temporal noise differs from frame to frame.
    pub frame: u32,
}

/// Numbers of the converter, as they are: nothing scaled or subtracted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers a pixel.
    pub depth: usize,
    /// `[row][column][channel]` (DN).
    pub values: Vec<u16>,
    /// Counts of values of the film that were no light.
    pub invalid: InvalidValues,
}

/// The expected value and the variance of every pixel over frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers a pixel.
    pub depth: usize,
    /// `[row][column][channel]` (DN).
    pub mean: Vec<f32>,
    /// `[row][column][channel]` (DN²).
    pub variance: Vec<f32>,
    /// Counts of values of the film that were no light.
    pub invalid: InvalidValues,
}

/// Values of a film that are no light and were taken for none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct InvalidValues {
    /// Negative values.
    pub negative: u64,
    /// Values that are NaN or infinite.
    pub not_finite: u64,
}

impl InvalidValues {
    /// True if there are any such values.
    #[must_use]
    pub fn any(self) -> bool {
        self.negative + self.not_finite > 0
    }

    /// The invalid ones of these values.
    pub(crate) fn of(values: &[f32]) -> Self {
        let count =
            |flaw: &dyn Fn(f32) -> bool| values.iter().filter(|value| flaw(**value)).count() as u64;
        Self {
            negative: count(&|value| value.is_finite() && value < 0.0),
            not_finite: count(&|value| !value.is_finite()),
        }
    }

    pub(crate) fn sum(self, other: Self) -> Self {
        Self {
            negative: self.negative + other.negative,
            not_finite: self.not_finite + other.not_finite,
        }
    }
}
