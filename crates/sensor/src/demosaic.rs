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
//!
//! Pictures to look at: black taken away, missing colours found, white balanced, in sRGB. The raw
//! image stays as it is.

use rayon::prelude::*;

use crate::spec::{ChannelSet, Channels, Method};
use crate::{CfaSpec, RawImage, Sensor};
use etendue_spectrum::Bands;
use etendue_spectrum::colour::{SRGB_FROM_XYZ, XYZ_FROM_SRGB, srgb_encode, transpose};

/// A mosaic: one number a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Mosaic<'a> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[row][column]`, as many as there are pixels.
    pub values: &'a [f32],
    /// Pattern of the filters.
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

impl Sensor {
    /// Response of every channel to white light, the most sensitive being 1: of equal energy, and
    /// of a colorimeter that of sRGB, which is daylight (D65).
    #[must_use]
    pub fn white_response(&self) -> Vec<f64> {
        let all: Vec<f64> = match self.is_colorimeter() {
            true => XYZ_FROM_SRGB.map(|row| row.iter().sum()).into(),
            false => {
                let channels = self.response.channels.iter();
                channels.map(|channel| channel.primaries.iter().sum()).collect()
            }
        };
        let most = all.iter().copied().fold(0.0, f64::max);
        all.into_iter().map(|value| value / most).collect()
    }

    /// Response of every channel to a white surface in light that has these values in the sensor's
    /// [bands](Self::bands), the most being 1; as [`Self::white_response`] where no channel sees it.
    #[must_use]
    pub fn white_under(&self, light: &[f64]) -> Vec<f64> {
        let seen = |channel: usize| -> f64 {
            self.electrons_per_unit(channel).iter().zip(light).map(|(e, light)| e * light).sum()
        };
        let all: Vec<f64> = (0..self.channels().len()).map(seen).collect();
        let most = all.iter().copied().fold(0.0, f64::max);
        match most > 0.0 && most.is_finite() {
            true => all.into_iter().map(|value| value / most).collect(),
            false => self.white_response(),
        }
    }

    /// Factors that make white light equal in all channels, none below 1.
    #[must_use]
    pub fn white_balance(&self) -> Vec<f64> {
        self.white_response().into_iter().map(|response| 1.0 / response).collect()
    }

    /// Weights of each channel in linear sRGB, one row a channel: white light becomes (1, 1, 1) when
    /// the most sensitive channel is 1. For three and more channels the colours of the render's RGB
    /// assets come back exactly (the least-squares inverse of the response to them); fewer are grey. Of a
    /// colorimeter they are the matrix of IEC 61966-2-1.
    #[must_use]
    pub fn srgb_from_channels(&self) -> Vec<[f64; 3]> {
        let white = self.white_response();
        if self.is_colorimeter() {
            let most =
                XYZ_FROM_SRGB.map(|row| row.iter().sum::<f64>()).into_iter().fold(0.0, f64::max);
            return transpose(*SRGB_FROM_XYZ).map(|row| row.map(|part| part * most)).into();
        }
        if let Bands::Spectral(_) | Bands::Weighted(_) = self.bands()
            && self.channels().len() == self.bands().count()
            && self.is_one_band_a_channel()
        {
            let rows = self.bands().to_rgb();
            return rows
                .iter()
                .zip(white)
                .map(|(row, white)| row.map(|part| part / white))
                .collect();
        }
        let response = self.response_to_primaries();
        pseudo_inverse(&response).unwrap_or_else(|| {
            let count = white.len() as f64;
            white.iter().map(|white| [1.0 / (white * count); 3]).collect()
        })
    }

    /// `[channel][primary]`: each channel's response to the sRGB primaries, on the scale of
    /// [`Self::white_response`].
    #[must_use]
    pub fn response_to_primaries(&self) -> Vec<[f64; 3]> {
        let rows: Vec<[f64; 3]> =
            self.response.channels.iter().map(|channel| channel.primaries).collect();
        let most = rows.iter().map(|row| row.iter().sum::<f64>()).fold(0.0, f64::max);
        rows.into_iter().map(|row| row.map(|value| value / most)).collect()
    }

    /// True if its channels are X, Y and Z.
    fn is_colorimeter(&self) -> bool {
        matches!(self.spec().channels, Some(Channels::Set(ChannelSet::Cie1931)))
    }

    fn is_one_band_a_channel(&self) -> bool {
        (0..self.channels().len()).all(|channel| {
            let electrons = self.electrons_per_unit(channel).iter().enumerate();
            electrons.filter(|(band, value)| *band != channel && **value > 0.0).count() == 0
        })
    }

    /// Numbers of an image as parts of what saturates a pixel, black at 0, every channel at every
    /// pixel: `[row][column][channel]`.
    #[must_use]
    pub fn linear(&self, image: &RawImage, method: Method) -> Vec<f32> {
        let range = self.saturation_level() - self.black_level();
        #[expect(clippy::cast_possible_truncation, reason = "16 bits fit")]
        let part = |&y: &u16| ((f64::from(y) - self.black_level()) / range) as f32;
        let values: Vec<f32> = image.values.par_iter().map(part).collect();
        match self.cfa() {
            Some(pattern) => {
                let RawImage { width, height, .. } = *image;
                Mosaic { width, height, values: &values, pattern }.demosaiced(method)
            }
            None => values,
        }
    }

    /// An image in linear sRGB, white balanced: a pixel that a white light just saturates is (1, 1, 1).
    ///
    /// Above that light the most sensitive channel tells nothing any more. All channels are clipped
    /// there, each at what it makes of that light, before they are balanced: the usual way of raw
    /// converters, without which what is saturated in all channels would come out in the colour of the
    /// balance (pink, as a rule).
    #[must_use]
    pub fn developed(&self, image: &RawImage, method: Method) -> Vec<[f32; 3]> {
        let weights = self.srgb_from_channels();
        let white = self.white_response();
        let linear = self.linear(image, method);
        let pixels = linear.par_chunks_exact(weights.len());
        let colours = pixels.map(|channels| {
            std::array::from_fn(|k| {
                let pairs = channels.iter().zip(&weights).zip(&white);
                let part = |((&value, weight), white): ((&f32, &[f64; 3]), &f64)| {
                    f64::from(value).min(*white) * weight[k]
                };
                #[expect(clippy::cast_possible_truncation, reason = "to look at")]
                let sum = pairs.map(part).sum::<f64>() as f32;
                sum
            })
        });
        colours.collect()
    }

    /// An image as 8-bit sRGB, `[row][column][red, green, blue]`; `exposure` multiplies the light.
    #[must_use]
    pub fn preview(&self, image: &RawImage, method: Method, exposure: f64) -> Vec<u8> {
        let developed = self.developed(image, method);
        let byte = |part: f32| to_byte(srgb_encode(exposure * f64::from(part)));
        developed.into_par_iter().flat_map_iter(|colour| colour.map(byte)).collect()
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
fn to_byte(display: f64) -> u8 {
    (255.0 * display + 0.5) as u8
}

/// (AᵀA)⁻¹Aᵀ of a matrix by rows, returned column by column; `None` when the columns of A are not
/// independent, to within 1e-6.
fn pseudo_inverse(rows: &[[f64; 3]]) -> Option<Vec<[f64; 3]>> {
    let dot = |i: usize, k: usize| rows.iter().map(|row| row[i] * row[k]).sum::<f64>();
    let square: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|k| dot(i, k)));
    let cofactor = |i: usize, k: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3);
        square[a][c] * square[b][d] - square[a][d] * square[b][c]
    };
    let determinant: f64 = (0..3).map(|k| square[0][k] * cofactor(0, k)).sum();
    let scale = (0..3).map(|k| square[k][k]).product::<f64>();
    if determinant.is_nan() || determinant <= 1e-12 * scale {
        return None;
    }
    // The square is symmetric, and so are its cofactors.
    let column = |row: &[f64; 3]| {
        std::array::from_fn(|i| (0..3).map(|k| cofactor(i, k) * row[k]).sum::<f64>() / determinant)
    };
    Some(rows.iter().map(column).collect())
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
