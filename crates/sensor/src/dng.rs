//! Raw images as Adobe's DNG, which raw converters open: one number a pixel, with pattern, black and
//! white level, and what the channels make of colours.
//!
//! # Sources
//!
//! "Digital Negative (DNG) Specification", version 1.4.0.0, Adobe 2012; tag numbers are its.

use std::io::{Seek, Write};

use etendue_spectrum::colorchecker::PATCHES;
use etendue_spectrum::colour::{FINE_OBSERVER, Matrix3, SRGB_FROM_XYZ, inverse};
use etendue_spectrum::{Curve, Illuminant, integral};
use tiff::encoder::{Rational, SRational, TiffEncoder};
use tiff::tags::Tag;

use crate::response::{Filter, filters};
use crate::{RawImage, Sensor};

/// Why there is no DNG.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DngError {
    /// A sensor of several numbers a pixel, or of filters that DNG has no name for.
    #[error("{0}: write it as PNG or NPY instead")]
    NotRaw(String),
    /// The file could not be written.
    #[error("cannot write the DNG: {0}")]
    Write(#[from] tiff::TiffError),
}

/// What a DNG says beside the numbers.
#[derive(Debug, Clone, Copy)]
pub struct DngDetails<'a> {
    /// What the file calls the camera.
    pub model: &'a str,
    /// What each of [`Sensor::channels`] makes of a white surface in the scene's light, to any factor
    /// ([`Sensor::white_under`], or [`Sensor::white_response`] for equal energy).
    pub white: &'a [f64],
    /// s
    pub exposure: f64,
}

/// Colour filter array, of the photometric interpretations.
const CFA: u16 = 32_803;
/// Linear raw, for monochrome sensors.
const LINEAR_RAW: u16 = 34_892;
/// D65, of EXIF's light sources.
const D65: u16 = 21;

impl Sensor {
    /// Writes an image of this sensor, a `raw` one, as DNG.
    ///
    /// # Errors
    ///
    /// [`DngError`] when the sensor has several numbers a pixel or filters other than r, g, b, or
    /// when writing fails.
    pub fn write_dng(
        &self,
        image: &RawImage,
        DngDetails { model, white, exposure }: DngDetails<'_>,
        out: impl Write + Seek,
    ) -> Result<(), DngError> {
        if image.depth != 1 {
            return Err(DngError::NotRaw(format!(
                "an image of {} channels is no raw",
                image.depth
            )));
        }
        let pattern = self.pattern_codes()?;
        let mut encoder = TiffEncoder::new(out)?;
        let mut directory = encoder.image_directory()?;
        let too_large = || DngError::NotRaw("the image is too large for DNG".into());
        let [width, height] = [image.width, image.height].map(u32::try_from);
        let (width, height) = (width.map_err(|_| too_large())?, height.map_err(|_| too_large())?);
        let bytes = u32::try_from(2 * image.values.len()).map_err(|_| too_large())?;
        let photometric = if pattern.is_some() { CFA } else { LINEAR_RAW };
        // What TIFF 6.0 asks for.
        directory.write_tag(Tag::NewSubfileType, 0u32)?;
        directory.write_tag(Tag::ImageWidth, width)?;
        directory.write_tag(Tag::ImageLength, height)?;
        directory.write_tag(Tag::BitsPerSample, 16u16)?;
        directory.write_tag(Tag::Compression, 1u16)?;
        directory.write_tag(Tag::PhotometricInterpretation, photometric)?;
        directory.write_tag(Tag::Orientation, 1u16)?;
        directory.write_tag(Tag::SamplesPerPixel, 1u16)?;
        directory.write_tag(Tag::PlanarConfiguration, 1u16)?;
        directory.write_tag(Tag::Make, "etendue")?;
        directory.write_tag(Tag::Model, model)?;
        let offset = directory.write_data(image.values.as_slice())?;
        let offset = u32::try_from(offset).map_err(|_| too_large())?;
        directory.write_tag(Tag::StripOffsets, offset)?;
        directory.write_tag(Tag::RowsPerStrip, height)?;
        directory.write_tag(Tag::StripByteCounts, bytes)?;
        // What DNG adds, by the numbers of its specification: version, model, black and white
        // level.
        let unknown = Tag::Unknown;
        directory.write_tag(unknown(50_706), [1u8, 4, 0, 0].as_slice())?;
        directory.write_tag(unknown(50_708), model)?;
        directory.write_tag(unknown(50_714), rational(self.black_level()))?;
        directory.write_tag(unknown(50_717), self.white_level_of_file())?;
        if let Some(profile) = self.noise_profile(exposure) {
            directory.write_tag(unknown(51_041), profile.as_slice())?;
        }
        // Of TIFF/EP, on which DNG stands.
        directory.write_tag(unknown(33_434), duration(exposure))?;
        if let Some(iso) = self.spec().iso.filter(|iso| (1.0..=65_535.0).contains(iso)) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "see above"
            )]
            directory.write_tag(unknown(34_855), iso.round() as u16)?;
        }
        // The mosaic of filters, the matrix from XYZ to the camera's colours, and its white.
        if let Some([rows, columns, codes @ ..]) = pattern.as_deref() {
            let period = [u16::from(*rows), u16::from(*columns)];
            directory.write_tag(unknown(33_421), period.as_slice())?;
            directory.write_tag(unknown(33_422), codes)?;
            directory.write_tag(unknown(50_711), 1u16)?;
            let matrix = self.colour_matrix();
            directory.write_tag(unknown(50_721), matrix.as_slice())?;
            let neutral = self.neutral(white);
            directory.write_tag(unknown(50_728), neutral.as_slice())?;
            directory.write_tag(unknown(50_778), D65)?;
        }
        directory.finish()?;
        Ok(())
    }

    /// `NoiseProfile`: the slope and the offset of the variance over the signal, both as shares of the range from
    /// black to white. `None` where nobody counts electrons.
    fn noise_profile(&self, exposure: f64) -> Option<[f64; 2]> {
        let range = self.saturation_level() - self.black_level();
        let dark = self.system_gain() * self.dark_noise(exposure);
        let counts = self.settings.counts && range > 0.0;
        counts.then(|| [self.system_gain() / range, (dark * dark + 1.0 / 12.0) / (range * range)])
    }

    /// The period and then TIFF/EP's numbers for the filters: red 0, green 1, blue 2; nothing for a
    /// monochrome sensor.
    fn pattern_codes(&self) -> Result<Option<Vec<u8>>, DngError> {
        let Some(cfa) = self.cfa() else { return Ok(None) };
        let [rows, columns] = cfa.period();
        #[expect(clippy::cast_possible_truncation, reason = "patterns have at most 64 a side")]
        let mut codes = vec![rows as u8, columns as u8];
        for row in 0..rows {
            for column in 0..columns {
                let letter = cfa.at(row, column);
                codes.push(match letter.to_ascii_lowercase() {
                    'r' => 0,
                    'g' => 1,
                    'b' => 2,
                    _ => return Err(DngError::NotRaw(format!("DNG has no filter `{letter}`"))),
                });
            }
        }
        Ok(Some(codes))
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 2ᵇ − 1")]
    fn white_level_of_file(&self) -> u16 {
        self.saturation_level() as u16
    }

    /// `ColorMatrix1`: XYZ to channels, rows red, green, blue: for filters with curves the matrix that fits the 24
    /// patches of the ColorChecker under D65 best, for ideal ones that of their colours.
    fn colour_matrix(&self) -> Vec<SRational> {
        if let Some(fitted) = self.fitted_matrix() {
            return fitted.into_iter().flatten().map(signed).collect();
        }
        let response = self.response_to_primaries();
        let camera: Matrix3 = self.of_rgb(|k| response[k]);
        let from_xyz = |row: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| (0..3).map(|i| row[i] * SRGB_FROM_XYZ[i][k]).sum())
        };
        camera.map(from_xyz).into_iter().flatten().map(signed).collect()
    }

    /// The matrix from XYZ to channels red, green and blue that is off the least squares from what they make of the 24
    /// patches of the ColorChecker under D65; white has Y = 1, and 1 in the channel that sees the most of it. `None`
    /// of filters without curves.
    #[must_use]
    pub fn fitted_matrix(&self) -> Option<Matrix3> {
        let filters = filters(self.spec()).ok()?.filters;
        if !filters.iter().all(|filter| matches!(filter, Filter::Curve(_))) {
            return None;
        }
        let light = Illuminant::D65.curve().ok()?;
        let [from, to] = light.range();
        let ramp = Curve::sampled(vec![[from, from], [to, to]]).ok()?;
        let curves = self.of_rgb(|k| filters.get(k).and_then(Filter::curve).cloned());
        let [Some(r), Some(g), Some(b)] = curves else { return None };
        let efficiency = &self.settings.efficiency;
        let raw = |patch: &Curve| {
            [&r, &g, &b].map(|f| integral(&[&light, patch, efficiency, f, &ramp], from, to))
        };
        let seen = |patch: &Curve| -> [f64; 3] {
            std::array::from_fn(|k| integral(&[&light, patch, &FINE_OBSERVER[k]], from, to))
        };
        let (white, most) =
            (seen(&Curve::ONE)[1], raw(&Curve::ONE).into_iter().fold(0.0, f64::max));
        // The normal equations: M (Σ x xᵀ) = Σ c xᵀ.
        let (mut squares, mut products) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for patch in PATCHES.iter() {
            let last = patch.range();
            let patch = patch.held_over(from.min(last[0]), to.max(last[1]));
            let (x, c) = (seen(&patch).map(|x| x / white), raw(&patch).map(|c| c / most));
            for i in 0..3 {
                for k in 0..3 {
                    squares[i][k] += x[i] * x[k];
                    products[i][k] += c[i] * x[k];
                }
            }
        }
        let inverse = inverse(&squares)?;
        Some(
            products
                .map(|row| std::array::from_fn(|k| (0..3).map(|i| row[i] * inverse[i][k]).sum())),
        )
    }

    /// `AsShotNeutral`: white of each channel, the most of which is 1.
    fn neutral(&self, white: &[f64]) -> [Rational; 3] {
        let white = self.of_rgb(|k| white.get(k).copied().unwrap_or(0.0).max(0.0));
        let most = white.into_iter().fold(0.0, f64::max);
        // Nothing is divided by a channel that sees none of the light.
        white.map(|part| rational(if most > 0.0 { (part / most).max(1e-4) } else { 1.0 }))
    }

    /// What channels red, green and blue have, by the number of each.
    fn of_rgb<T: Default>(&self, of: impl Fn(usize) -> T) -> [T; 3] {
        let names: Vec<&str> = self.channels().collect();
        ["R", "G", "B"].map(|name| {
            let found = names.iter().position(|other| other.eq_ignore_ascii_case(name));
            found.map_or_else(T::default, &of)
        })
    }
}

fn rational(value: f64) -> Rational {
    let SRational { n, .. } = signed(value);
    Rational { n: n.unsigned_abs(), d: 10_000 }
}

/// A time (s), to nine digits of short ones.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cast saturates")]
fn duration(seconds: f64) -> Rational {
    let d = [1_000_000_000, 1_000_000, 1_000, 1].into_iter();
    let d = d.into_iter().find(|&d| seconds * f64::from(d) < f64::from(u32::MAX)).unwrap_or(1);
    Rational { n: (seconds * f64::from(d)).round() as u32, d }
}

#[expect(clippy::cast_possible_truncation, reason = "a cast saturates; levels are below 65536")]
fn signed(value: f64) -> SRational {
    SRational { n: (value * 1e4).round() as i32, d: 10_000 }
}
