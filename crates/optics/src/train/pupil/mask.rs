//! What a mask passes, over rectangles of it.

#![expect(clippy::cast_precision_loss, reason = "masks of far fewer than 2⁵³ pixels")]

use glam::DVec2;

use crate::element::{Opening, Picture};
use crate::train::OpticalTrain;

/// The first mask that stops or dims anything.
pub(super) fn first_mask(train: &OpticalTrain) -> Option<(usize, &Picture)> {
    train.elements.iter().enumerate().find_map(|(i, element)| match element.part.opening()? {
        Opening::Image(mask) if mask.values.iter().any(|v| *v < 1.0) => Some((i, mask)),
        Opening::Image(_) | Opening::Circle { .. } | Opening::Polygon { .. } => None,
    })
}

/// The greatest of the `reach` values on both sides along one direction of a square of `count`².
pub(super) fn greatest_around(
    values: &[f64],
    count: usize,
    reach: usize,
    stride: usize,
) -> Vec<f64> {
    let along = |i: usize| i / stride % count;
    (0..values.len())
        .map(|i| {
            let before = along(i).min(reach);
            let after = (count - 1 - along(i)).min(reach);
            let line = (0..=before + after).map(|step| values[i - before * stride + step * stride]);
            line.fold(0.0, f64::max)
        })
        .collect()
}

/// Sums of a mask's values over all rectangles from its top left corner.
pub(super) struct Sums(Vec<f64>);

impl Sums {
    pub(super) fn of(mask: &Picture) -> Self {
        let [columns, rows] = mask.pixels;
        let mut sums = vec![0.0; (columns + 1) * (rows + 1)];
        for row in 0..rows {
            let mut line = 0.0;
            for column in 0..columns {
                line += mask.values[row * columns + column];
                let at = (row + 1) * (columns + 1) + column + 1;
                sums[at] = sums[at - columns - 1] + line;
            }
        }
        Self(sums)
    }

    /// The sum up to a place (pixels from the top left corner).
    fn up_to(&self, [columns, rows]: [usize; 2], x: f64, y: f64) -> f64 {
        let along = |x: f64, count: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to the pixels"
            )]
            let low = (x.clamp(0.0, count as f64) as usize).min(count - 1);
            (low, (x.clamp(0.0, count as f64) - low as f64))
        };
        let ((i, s), (j, t)) = (along(x, columns), along(y, rows));
        let at = |i: usize, j: usize| self.0[j * (columns + 1) + i];
        (at(i, j) * (1.0 - s) + at(i + 1, j) * s) * (1.0 - t)
            + (at(i, j + 1) * (1.0 - s) + at(i + 1, j + 1) * s) * t
    }

    /// The mean over a rectangle (mm); nothing passes outside of the mask.
    pub(super) fn mean(&self, mask: &Picture, low: DVec2, high: DVec2) -> f64 {
        let pixels = DVec2::new(mask.pixels[0] as f64, mask.pixels[1] as f64);
        let size = DVec2::from(mask.size);
        let [left, right] = [low.x, high.x].map(|x| (x / size.x + 0.5) * pixels.x);
        // Row 0 is at +y.
        let [bottom, top] = [low.y, high.y].map(|y| (0.5 - y / size.y) * pixels.y);
        let area = (right - left) * (bottom - top);
        let sum = self.up_to(mask.pixels, right, bottom)
            - self.up_to(mask.pixels, left, bottom)
            - self.up_to(mask.pixels, right, top)
            + self.up_to(mask.pixels, left, top);
        // Differences of sums leave roundings where there is nothing.
        let mean = sum / area;
        if mean < 1e-12 { 0.0 } else { mean }
    }
}
