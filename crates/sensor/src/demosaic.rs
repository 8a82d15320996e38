//! From one number a pixel to one of each filter at every pixel, for looking: the raw stays raw.
//!
//! # Sources
//!
//! * [`Method::Malvar`]: H. S. Malvar, L. He, R. Cutler, "High-Quality Linear Interpolation for
//!   Demosaicing of Bayer-Patterned Color Images", ICASSP 2004, figure 2.
//! * [`Method::Bilinear`]: the weighted mean of the filter's nearest pixels with a pyramid as wide as
//!   the pattern; for Bayer patterns that is the usual bilinear interpolation.
//!
//! Beyond its edges the image is mirrored about its outermost pixels, which keeps the pattern's turns.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::CfaSpec;

/// How missing colours are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// From the same filter alone; any pattern.
    Bilinear,
    /// Guided by the pixel's own filter; Bayer patterns, bilinear for others.
    #[default]
    Malvar,
}

/// A mosaic: one number a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Mosaic<'a> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[row][column]`, as many as there are pixels.
    pub values: &'a [f32],
    /// Which filter is where.
    pub pattern: &'a CfaSpec,
}

impl Mosaic<'_> {
    /// `[row][column][letter]`, the letters in the order of [`CfaSpec::letters`].
    #[must_use]
    pub fn demosaiced(&self, method: Method) -> Vec<f32> {
        let letters = self.pattern.letters();
        let mut out = vec![0.0; self.width * self.height * letters.len()];
        if out.is_empty() || self.values.len() != self.width * self.height {
            return out;
        }
        let green = (method == Method::Malvar).then(|| self.bayer_green()).flatten();
        let rows = out.par_chunks_mut(self.width * letters.len()).enumerate();
        rows.for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(letters.len()).enumerate() {
                for (value, &letter) in pixel.iter_mut().zip(&letters) {
                    *value = match green {
                        _ if self.pattern.at(y, x) == letter => self.at(y as isize, x as isize),
                        Some(green) => self.malvar(y, x, letter, green),
                        None => self.bilinear(y, x, letter),
                    };
                }
            }
        });
        out
    }

    /// The letter that lies on a diagonal of a two-by-two pattern of three letters.
    fn bayer_green(&self) -> Option<char> {
        let at = |y, x| self.pattern.at(y, x);
        if self.pattern.period() != [2, 2] || self.pattern.letters().len() != 3 {
            return None;
        }
        [(at(0, 0), at(1, 1)), (at(0, 1), at(1, 0))]
            .into_iter()
            .find(|(a, b)| a == b)
            .map(|(a, _)| a)
    }

    /// A pixel, mirrored about the edges.
    fn at(&self, y: isize, x: isize) -> f32 {
        self.values[mirrored(y, self.height) * self.width + mirrored(x, self.width)]
    }

    fn bilinear(&self, y: usize, x: usize, letter: char) -> f32 {
        let [rows, columns] = self.pattern.period();
        let (mut sum, mut weights) = (0.0, 0.0);
        for dy in 1 - rows as isize..rows as isize {
            for dx in 1 - columns as isize..columns as isize {
                let (row, column) = (y as isize + dy, x as isize + dx);
                let [row, column] = [mirrored(row, self.height), mirrored(column, self.width)];
                if self.pattern.at(row, column) == letter {
                    let near = (rows - dy.unsigned_abs()) * (columns - dx.unsigned_abs());
                    sum += near as f32 * self.values[row * self.width + column];
                    weights += near as f32;
                }
            }
        }
        // A sensor smaller than its pattern may lack a filter altogether.
        if weights > 0.0 { sum / weights } else { 0.0 }
    }

    /// The value behind the filter `letter` at a pixel that has another.
    fn malvar(&self, y: usize, x: usize, letter: char, green: char) -> f32 {
        let (row, column) = (y as isize, x as isize);
        let at = |dy: isize, dx: isize| self.at(row + dy, column + dx);
        let centre = at(0, 0);
        let along = |step: isize| [at(0, -step) + at(0, step), at(-step, 0) + at(step, 0)];
        let ([near_x, near_y], [far_x, far_y]) = (along(1), along(2));
        let diagonal = at(-1, -1) + at(-1, 1) + at(1, -1) + at(1, 1);
        if letter == green {
            return (4.0 * centre + 2.0 * (near_x + near_y) - far_x - far_y) / 8.0;
        }
        if self.pattern.at(y, x) != green {
            return (6.0 * centre + 2.0 * diagonal - 1.5 * (far_x + far_y)) / 8.0;
        }
        let in_row = self.pattern.at(y, x + 1) == letter;
        let (near, far, across) =
            if in_row { (near_x, far_x, far_y) } else { (near_y, far_y, far_x) };
        (5.0 * centre + 4.0 * near - diagonal - far + 0.5 * across) / 8.0
    }
}

/// An index into `0..len` (len > 0), mirrored about the first and last.
fn mirrored(i: isize, len: usize) -> usize {
    let period = 2 * (len as isize - 1).max(1);
    let i = i.rem_euclid(period);
    (if i >= len as isize { period - i } else { i }).unsigned_abs().min(len - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn demosaiced(
        word: &str,
        size: usize,
        f: impl Fn(usize, usize) -> f32,
        method: Method,
    ) -> Vec<f32> {
        let pattern = CfaSpec::two_by_two(word).unwrap();
        let values: Vec<f32> = (0..size * size).map(|i| f(i / size, i % size)).collect();
        Mosaic { width: size, height: size, values: &values, pattern: &pattern }.demosaiced(method)
    }

    #[test]
    fn agrees_with_an_independent_program_inside() {
        // colour-demosaicing 0.2.6, demosaicing_CFA_Bayer_{Malvar2004,bilinear}, pixels
        // (3,3), (3,4), (4,3), (4,4) of this image as red, green, blue.
        let image = |r: usize, c: usize| ((7 * r * r + 13 * c + 5 * r * c * c) % 97) as f32;
        let expected = [
            (
                "rggb",
                Method::Malvar,
                [
                    [50.1875, 44.125, 43.0],
                    [72.625, 64.0, 38.3125],
                    [54.25, 40.0, 42.5625],
                    [96.0, 94.625, 100.6875],
                ],
            ),
            (
                "rggb",
                Method::Bilinear,
                [[65.0, 54.0, 43.0], [71.0, 64.0, 30.5], [60.0, 40.0, 47.0], [96.0, 61.0, 50.25]],
            ),
            (
                "gbrg",
                Method::Malvar,
                [
                    [47.625, 43.0, 33.4375],
                    [64.0, 65.125, 83.3125],
                    [20.4375, 38.625, 40.0],
                    [86.4375, 96.0, 98.125],
                ],
            ),
            (
                "gbrg",
                Method::Bilinear,
                [[58.0, 43.0, 50.0], [64.0, 50.75, 61.75], [42.75, 53.5, 40.0], [54.5, 96.0, 67.5]],
            ),
        ];
        for (word, method, pixels) in expected {
            let out = demosaiced(word, 8, image, method);
            let letters = CfaSpec::two_by_two(word).unwrap().letters();
            for (pixel, (y, x)) in pixels.into_iter().zip([(3, 3), (3, 4), (4, 3), (4, 4)]) {
                for (value, name) in pixel.into_iter().zip("rgb".chars()) {
                    let k = letters.iter().position(|&letter| letter == name).unwrap();
                    let ours = out[(y * 8 + x) * 3 + k];
                    assert!(
                        (ours - value).abs() < 1e-4,
                        "{word} {method:?} {y} {x} {name}: {ours}"
                    );
                }
            }
        }
    }

    #[test]
    fn even_light_stays_even_up_to_the_edges() {
        for word in ["rggb", "grbg", "gbrg", "bggr", "rgbw", "ryyb"] {
            for method in [Method::Bilinear, Method::Malvar] {
                for size in [2, 3, 8] {
                    let out = demosaiced(word, size, |_, _| 0.25, method);
                    assert!(
                        out.iter().all(|v| (v - 0.25).abs() < 1e-6),
                        "{word} {method:?} {size}"
                    );
                }
            }
        }
    }

    #[test]
    fn edges_mirror_without_changing_the_turns() {
        assert_eq!([-2, -1, 0, 4, 5, 6].map(|i| mirrored(i, 5)), [2, 1, 0, 4, 3, 2]);
        assert_eq!([-1, 0, 1, 7].map(|i| mirrored(i, 1)), [0; 4]);
    }

    #[test]
    fn wide_patterns_are_interpolated_too() {
        let pattern =
            CfaSpec::from_rows(["rgbw", "bwrg"].map(|row| row.chars().collect()).into()).unwrap();
        let values: Vec<f32> = (0..64).map(|i| (i % 8) as f32).collect();
        let mosaic = Mosaic { width: 8, height: 8, values: &values, pattern: &pattern };
        let out = mosaic.demosaiced(Method::Malvar);
        assert_eq!(out.len(), 64 * 4);
        assert_eq!(
            out[(3 * 8 + 4) * 4 + pattern.letters().iter().position(|&l| l == 'b').unwrap()],
            4.0
        );
        assert!(out.iter().all(|v| (0.0..=7.0).contains(v)));
    }
}
