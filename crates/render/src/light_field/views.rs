//! Views as arrays: `[down][across][row][column][channel]`, from the raw picture by cubic sampling at
//! the middles of the lenslets' images, or out of a picture that shows them side by side.
//!
//! Cubic sampling: R. Keys, "Cubic convolution interpolation for digital image processing", 1981, with
//! a = −1/2.

use etendue_camera::{LightField, ViewGrid};
use rayon::prelude::*;

use super::centres::Centres;
use super::response::{ViewResponse, weights};
use crate::output::{Channel, HeaderEntry, Layer, Look, Picture, PictureError, SPECTRUM, Values};

/// The values of all views.
#[derive(Debug, Clone)]
pub(super) struct ViewArray {
    /// `[down][across][row][column][channel]`.
    pub(super) values: Vec<f32>,
    channels: usize,
}

/// All views of a light field.
#[derive(Debug, Clone)]
pub(super) struct Views {
    /// Along each side.
    pub(super) views: u32,
    /// Columns and rows of each.
    pub(super) size: [u32; 2],
    /// Red, green and blue.
    pub(super) colors: ViewArray,
    /// The bands of a spectrum, where the picture has one.
    pub(super) spectrum: Option<ViewArray>,
}

impl Views {
    /// The views in a raw picture, as bright as an ideal lens has them.
    pub(super) fn decoded(
        picture: &Picture,
        [in_colors, in_bands]: &[Centres; 2],
        light_field: &LightField,
        grid: &ViewGrid,
        response: &ViewResponse,
    ) -> Result<Self, PictureError> {
        let [cols, rows] = grid.view_resolution();
        let n = light_field.views;
        let decode = |planes: &[&[f32]], centres: &Centres| {
            let view = |k: u32| {
                let [right, below] = light_field.offset(k % n, k / n);
                let size = [picture.width(), picture.height()];
                let pixel = |i: u32| {
                    #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
                    let gain = response.gains[k as usize].at([i / cols, i % cols]) as f32;
                    (0..).zip(planes).map(move |(band, plane)| {
                        let [x, y] = centres.sampled(band)[i as usize].unwrap_or_default();
                        gain * sampled(plane, size, [x + right, y + below])
                    })
                };
                (0..rows * cols).flat_map(pixel).collect::<Vec<f32>>()
            };
            let views: Vec<Vec<f32>> = (0..n * n).into_par_iter().map(view).collect();
            ViewArray { values: views.concat(), channels: planes.len() }
        };
        let empty = || PictureError::empty("the raw picture");
        let colors = decode(&planes(picture, "").ok_or_else(empty)?, in_colors);
        let spectrum = planes(picture, SPECTRUM).map(|planes| decode(&planes, in_bands));
        Ok(Self { views: n, size: [cols, rows], colors, spectrum })
    }

    /// The views that a picture shows side by side.
    pub(super) fn split(picture: &Picture, grid: &ViewGrid) -> Self {
        let [cols, rows] = grid.view_resolution();
        let n = grid.views();
        let split = |planes: &[&[f32]]| {
            let mut values = Vec::with_capacity(planes.len() * picture.width() * picture.height());
            for k in 0..n * n {
                let (left, top) = (k % n * cols, k / n * rows);
                for row in top..top + rows {
                    for col in left..left + cols {
                        let at = row as usize * picture.width() + col as usize;
                        values.extend(planes.iter().map(|plane| plane[at]));
                    }
                }
            }
            ViewArray { values, channels: planes.len() }
        };
        let colors = split(&planes(picture, "").unwrap_or_default());
        let spectrum = planes(picture, SPECTRUM).map(|planes| split(&planes));
        Self { views: n, size: [cols, rows], colors, spectrum }
    }

    /// The shape of one of its arrays.
    pub(super) fn shape(&self, array: &ViewArray) -> [u64; 5] {
        let [cols, rows] = self.size.map(u64::from);
        let views = u64::from(self.views);
        [views, views, rows, cols, array.channels as u64]
    }

    /// The colours of a pixel of a view.
    fn color(&self, view: u32, pixel: usize, channel: usize) -> f32 {
        let [cols, rows] = self.size.map(|side| side as usize);
        let count = self.colors.channels;
        self.colors.values[(view as usize * rows * cols + pixel) * count + channel]
    }

    /// One view as a picture.
    pub(super) fn single(&self, across: u32, down: u32) -> Result<Picture, PictureError> {
        let [cols, rows] = self.size.map(|side| side as usize);
        let view = down * self.views + across;
        let value = |k, channel| self.color(view, k, channel);
        picture([cols, rows], VIEWS, value)
    }

    /// The mean of all views, each moved by its number from the middle one times `disparity` (pixels of a
    /// view), over rows that are `height` columns apart: where that is not 1, odd ones begin half a column
    /// further right.
    pub(super) fn averaged(&self, disparity: f64, height: f64) -> Result<Picture, PictureError> {
        let [cols, rows] = self.size.map(|side| side as usize);
        let (n, middle) = (self.views, 0.5 * (f64::from(self.views) - 1.0));
        let odd = if height < 1.0 { 0.5 } else { 0.0 };
        let view = |k: u32| {
            let [right, below] = [k % n, k / n].map(|at| -disparity * (f64::from(at) - middle));
            let plane = |channel| (0..rows * cols).map(|i| self.color(k, i, channel)).collect();
            let planes: [Vec<f32>; 3] = std::array::from_fn(plane);
            let moved = |plane: &Vec<f32>, i: usize| {
                let (col, row) = (i % cols, i / cols);
                let x = col as f64 + 0.5 + right + odd * (row % 2) as f64;
                let y = row as f64 + 0.5 + below / height;
                sampled_rows(plane, [cols, rows], [x, y], odd)
            };
            planes.map(|plane| (0..rows * cols).map(|i| moved(&plane, i)).collect::<Vec<f32>>())
        };
        let moved: Vec<[Vec<f32>; 3]> = (0..n * n).into_par_iter().map(view).collect();
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let mean = |i: usize, channel: usize| {
            let sum: f64 = moved.iter().map(|planes| f64::from(planes[channel][i])).sum();
            (sum / moved.len() as f64) as f32
        };
        picture([cols, rows], VIEWS, mean)
    }

    /// All views as one picture.
    pub(super) fn side_by_side(&self) -> Result<Picture, PictureError> {
        let [cols, rows] = self.size.map(|side| side as usize);
        let n = self.views as usize;
        let value = |k: usize, channel| {
            let (x, y) = (k % (n * cols), k / (n * cols));
            #[expect(clippy::cast_possible_truncation, reason = "at most 255 views a side")]
            let view = (y / rows * n + x / cols) as u32;
            self.color(view, y % rows * cols + x % cols, channel)
        };
        picture([n * cols, n * rows], VIEWS, value)
    }
}

/// Description of pictures of views.
const VIEWS: &str = "views of a light field";

/// A picture of three colours, and what it is.
pub(super) fn picture(
    [width, height]: [usize; 2],
    definition: &str,
    value: impl Fn(usize, usize) -> f32,
) -> Result<Picture, PictureError> {
    let channel = |(k, name): (usize, &str)| {
        let values = (0..width * height).map(|i| value(i, k)).collect();
        Channel { name: name.to_owned(), values: Values::F32(values) }
    };
    let channels = ["R", "G", "B"].into_iter().enumerate().map(channel).collect();
    let meaning = vec![HeaderEntry::new("definition", definition)];
    let layer = Layer { name: String::new(), look: Look::Color, channels, meaning };
    Picture::new(width, height, vec![layer], Vec::new())
}

/// A plane at a place (pixels from the corner).
pub(super) fn sampled(plane: &[f32], size: [usize; 2], at: [f64; 2]) -> f32 {
    sampled_rows(plane, size, at, 0.0)
}

/// Samples a plane with odd rows that begin `odd` pixels further right.
fn sampled_rows(plane: &[f32], [width, height]: [usize; 2], [x, y]: [f64; 2], odd: f64) -> f32 {
    let split = |at: f64| {
        let low = (at - 0.5).floor();
        (low, weights(at - 0.5 - low))
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the picture"
    )]
    let clamped = |at: f64, side: usize| at.clamp(0.0, (side - 1) as f64) as usize;
    let (top, down) = split(y);
    let mut sum = 0.0;
    for (j, wy) in (0_u32..).zip(down) {
        let row = clamped(top - 1.0 + f64::from(j), height);
        let (left, across) = split(x - odd * (row % 2) as f64);
        let row = row * width;
        for (i, wx) in (0_u32..).zip(across) {
            let column = clamped(left - 1.0 + f64::from(i), width);
            sum += wx * wy * f64::from(plane[row + column]);
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
    let sum = sum as f32;
    sum
}

/// The planes of a picture's own colours, and of its spectrum.
pub(super) fn planes<'a>(picture: &'a Picture, layer: &str) -> Option<Vec<&'a [f32]>> {
    let layer = picture.layer(layer)?;
    let plane = |channel: &'a Channel| match &channel.values {
        Values::F32(values) => Some(values.as_slice()),
        Values::F64(_) | Values::U16(_) | Values::U32(_) => None,
    };
    layer.channels.iter().map(plane).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp that every view shows moved by its disparity is that ramp again when they are averaged so.
    #[test]
    fn averaging_moves_views_by_their_disparity() {
        let (n, cols, rows, disparity) = (3_u32, 12_u32, 10_u32, 0.75);
        let mut values = Vec::new();
        for k in 0..n * n {
            let [u, v] = [k % n, k / n].map(|at| f64::from(at) - 1.0);
            for i in 0..rows * cols {
                let (x, y) = (f64::from(i % cols), f64::from(i / cols));
                // What stands at x in the middle stands at x − u d here.
                #[expect(clippy::cast_possible_truncation, reason = "a test's numbers")]
                let value = ((x + u * disparity) + 2.0 * (y + v * disparity)) as f32;
                values.extend([value; 3]);
            }
        }
        let colors = ViewArray { values, channels: 3 };
        let views = Views { views: n, size: [cols, rows], colors, spectrum: None };
        let sharp = views.averaged(disparity, 1.0).unwrap();
        let value = sharp.layer("").unwrap().channels[1].values.at((5 * cols + 6) as usize);
        // f32 has 7 digits of numbers up to 30.
        assert!((value - 16.0).abs() < 1e-5, "{value}");
    }

    /// Cubic convolution gives second-degree polynomials back exactly.
    #[test]
    fn sampling_is_exact_for_parabolas() {
        let f = |x: f64, y: f64| 0.3 * x * x - x * y + 0.2 * y * y + 2.0 * y - 1.0;
        #[expect(clippy::cast_possible_truncation, reason = "a test's numbers")]
        let plane: Vec<f32> =
            (0..100).map(|k| f(f64::from(k % 10) + 0.5, f64::from(k / 10) + 0.5) as f32).collect();
        for (x, y) in [(4.5, 5.5), (4.7, 5.1), (3.0, 6.0), (5.99, 4.01)] {
            let found = f64::from(sampled(&plane, [10, 10], [x, y]));
            // f32 has 7 digits of numbers up to 60.
            assert!((found - f(x, y)).abs() < 2e-5, "{x} {y}: {found} {}", f(x, y));
        }
        assert_eq!(weights(0.0), [0.0, 1.0, 0.0, 0.0]);
    }
}
