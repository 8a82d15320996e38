//! Pictures to look at: black taken away, missing colours found, white balanced, in sRGB. The raw
//! image stays as it is.

use etendue_spectrum::Bands;
use etendue_spectrum::colour::srgb_encode;
use rayon::prelude::*;

use crate::demosaic::{Method, Mosaic};
use crate::{RawImage, Sensor};

impl Sensor {
    /// What every channel makes of white light (equal energy), the most sensitive being 1.
    #[must_use]
    pub fn white_response(&self) -> Vec<f64> {
        let all: Vec<f64> =
            self.response.channels.iter().map(|channel| channel.primaries.iter().sum()).collect();
        let most = all.iter().copied().fold(0.0, f64::max);
        all.into_iter().map(|value| value / most).collect()
    }

    /// What every channel makes of a white surface in light that has these values in the sensor's
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
    /// assets come back exactly (the least-squares inverse of the response to them); fewer are grey.
    #[must_use]
    pub fn srgb_from_channels(&self) -> Vec<[f64; 3]> {
        let white = self.white_response();
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
