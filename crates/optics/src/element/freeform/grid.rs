//! Heights and phases by pictures, between whose pixels a bicubic surface goes.
//!
//! Cubic convolution with a = −1/2 (R. G. Keys, "Cubic convolution interpolation for digital image processing", *IEEE Trans.
//! Acoust. Speech Signal Process.* 29, 1153 (1981)): through every pixel's middle, with a slope without jumps, exact for
//! polynomials of the second degree. Beyond the outermost pixels' middles it goes on by the outermost pixels.

use etendue_geometry::units::Millimetres;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::element::Resolve;
use crate::element::aperture::Picture;
use crate::element::real::Real;

/// Heights by a grey picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeightMapSpec {
    /// A grey PNG or EXR; row 0 is at the top and column 0 on the left as seen from the sensor.
    pub file: String,
    /// The picture's width (mm).
    pub width: Millimetres,
    /// The picture's height (mm); by square pixels when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<Millimetres>,
    /// Height of white above black (mm).
    pub depth: Millimetres,
}

impl HeightMapSpec {
    pub(super) fn build(&self, resolve: Resolve<'_>) -> Result<HeightGrid, String> {
        let depth = self.depth.0;
        if !depth.is_finite() {
            return Err("depth must be finite".to_owned());
        }
        let height = self.height.map(|height| height.0);
        let picture = Picture::read(&self.file, self.width.0, height, resolve)?;
        Ok(HeightGrid::new(picture, depth))
    }
}

/// Values over a rectangle.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HeightGrid {
    picture: Picture,
    /// Value of white.
    scale: f64,
}

impl HeightGrid {
    pub(super) fn new(picture: Picture, scale: f64) -> Self {
        Self { picture, scale }
    }

    pub(super) fn half_size(&self) -> [f64; 2] {
        self.picture.size.map(|length| 0.5 * length)
    }

    /// The greatest change from a pixel to the next.
    pub(super) fn greatest_step(&self) -> f64 {
        let [columns, rows] = self.picture.pixels;
        let value = |column: usize, row: usize| self.picture.values[row * columns + column];
        let mut most = 0.0_f64;
        for row in 0..rows {
            for column in 0..columns {
                let here = value(column, row);
                if column + 1 < columns {
                    most = most.max((value(column + 1, row) - here).abs());
                }
                if row + 1 < rows {
                    most = most.max((value(column, row + 1) - here).abs());
                }
            }
        }
        most * self.scale.abs()
    }

    /// The value at a place (mm).
    pub(super) fn at<T: Real>(&self, [x, y]: [T; 2]) -> T {
        let [columns, rows] = self.picture.pixels;
        let [width, height] = self.picture.size;
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let (per_x, per_y) = (columns as f64 / width, rows as f64 / height);
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let (middle_x, middle_y) = (0.5 * columns as f64 - 0.5, 0.5 * rows as f64 - 0.5);
        let (across, first_column) = weights(x.times(per_x).plus(middle_x), columns);
        let (down, first_row) = weights(y.times(-per_y).plus(middle_y), rows);
        let mut sum = T::constant(0.0);
        for (row, &weight) in first_row.into_iter().zip(&down) {
            let mut line = T::constant(0.0);
            for (column, &weight) in first_column.into_iter().zip(&across) {
                line = line + weight.times(self.picture.values[row * columns + column]);
            }
            sum = sum + line * weight;
        }
        sum.times(self.scale)
    }
}

/// The weights of the four pixels about a place (pixels from the middle of the first), and which those are.
fn weights<T: Real>(place: T, count: usize) -> ([T; 4], [usize; 4]) {
    let last = count - 1;
    #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
    let floor = place.value().clamp(-2.0, last as f64 + 2.0).floor();
    let t = place.plus(-floor);
    let (t2, one) = (t * t, T::constant(1.0));
    let t3 = t2 * t;
    let weights = [
        t2 - t3.times(0.5) - t.times(0.5),
        t3.times(1.5) - t2.times(2.5) + one,
        t2.times(2.0) + t.times(0.5) - t3.times(1.5),
        t3.times(0.5) - t2.times(0.5),
    ];
    let pixel = |step: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a pixel's number, from 0 on"
        )]
        let index = (floor + step).max(0.0) as usize;
        index.min(last)
    };
    (weights, [-1.0, 0.0, 1.0, 2.0].map(pixel))
}
