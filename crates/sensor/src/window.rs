//! Regions of a raw image, and pixels that are binned.

use crate::{RawImage, Sensor, SensorError};

/// Part of an image that is read out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Left column, top row, width and height (pixels); all of it when absent.
    pub region: Option<[usize; 4]>,
    /// Pixels of one colour a side whose numbers are averaged (≥ 1).
    pub binning: usize,
}

impl Default for Window {
    fn default() -> Self {
        Self { region: None, binning: 1 }
    }
}

impl Sensor {
    /// Reads a window of an image, the region first: numbers of pixels behind the same filter are
    /// averaged and rounded, halves to even, so that a mosaic stays the mosaic that it is.
    ///
    /// # Errors
    ///
    /// [`SensorError`] when the region is none, reaches beyond the image, begins within a tile of filters, or does not
    /// divide into bins.
    pub fn window(&self, image: &RawImage, window: Window) -> Result<RawImage, SensorError> {
        let Window { region, binning } = window;
        let [x, y, width, height] = region.unwrap_or([0, 0, image.width, image.height]);
        let [tall, wide] = self.cfa().map_or([1, 1], crate::CfaSpec::period);
        let refuse = SensorError::unless;
        let beyond = |from: usize, length: usize, of: usize| {
            length > 0 && from.checked_add(length).is_some_and(|end| end <= of)
        };
        let demand = "columns of the chip, one at least";
        refuse(beyond(x, width, image.width), "region", x.saturating_add(width) as f64, demand)?;
        let demand = "rows of the chip, one at least";
        refuse(beyond(y, height, image.height), "region", y.saturating_add(height) as f64, demand)?;
        let demand = "a corner where a tile of filters begins";
        refuse(x.is_multiple_of(wide), "region", x as f64, demand)?;
        refuse(y.is_multiple_of(tall), "region", y as f64, demand)?;
        refuse((1..=64).contains(&binning), "binning", binning as f64, "1 to 64 pixels a side")?;
        let demand = "a width that divides into bins of whole tiles of filters";
        refuse(
            width.is_multiple_of(wide * binning) || binning == 1,
            "binning",
            width as f64,
            demand,
        )?;
        let demand = "a height that divides into bins of whole tiles of filters";
        refuse(
            height.is_multiple_of(tall * binning) || binning == 1,
            "binning",
            height as f64,
            demand,
        )?;
        let depth = image.depth;
        let mut values = Vec::with_capacity(width * height * depth / (binning * binning));
        let share = 1.0 / (binning * binning) as f64;
        for row in 0..height / binning {
            for column in 0..width / binning {
                // The first of the pixels of this one's colour: its tile is one of `binning` a side.
                let top = y + row / tall * tall * binning + row % tall;
                let left = x + column / wide * wide * binning + column % wide;
                for channel in 0..depth {
                    let mut sum = 0.0;
                    for down in 0..binning {
                        let start = (top + down * tall) * image.width;
                        for across in 0..binning {
                            let at = (start + left + across * wide) * depth + channel;
                            sum += f64::from(image.values[at]);
                        }
                    }
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "a mean of numbers of 16 bits"
                    )]
                    values.push((share * sum).round_ties_even() as u16);
                }
            }
        }
        let [width, height] = [width / binning, height / binning];
        Ok(RawImage { width, height, depth, values, invalid: image.invalid })
    }
}
