//! Raw images as Adobe's DNG, which raw converters open: one number a pixel, with pattern, black and
//! white level, and what the channels make of colours.
//!
//! # Sources
//!
//! "Digital Negative (DNG) Specification", version 1.4.0.0, Adobe 2012; tag numbers are its.

use std::borrow::Cow;
use std::io::{Seek, Write};

use etendue_spectrum::colorchecker::PATCHES;
use etendue_spectrum::colour::{FINE_OBSERVER, Matrix3, SRGB_FROM_XYZ, inverse};
use etendue_spectrum::{Curve, Illuminant, integral};
use tiff::encoder::{Rational, SRational, TiffEncoder, TiffValue};
use tiff::tags::{Tag, Type};

use crate::response::{ColourFilter, filters};
use crate::{RawImage, Sensor};

/// Error of a DNG that cannot be written.
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

/// Details of a DNG beside the numbers.
#[derive(Debug, Clone, Copy)]
pub struct DngDetails<'a> {
    /// Name of the camera in the file.
    pub model: &'a str,
    /// Response of each of [`Sensor::channels`] to a white surface in the scene's light, to any
    /// factor ([`Sensor::white_under`], or [`Sensor::white_response`] for equal energy).
    pub white: &'a [f64],
    /// s
    pub exposure: f64,
    /// Of the lens, if anybody knows.
    pub f_number: Option<f64>,
    /// Gain map that brings the lens' shading back to even, if it is known.
    pub shading: Option<&'a GainMap>,
}

/// Factors over a picture, from its top left corner to its bottom right one.
#[derive(Debug, Clone, PartialEq)]
pub struct GainMap {
    /// Columns and rows of points.
    pub points: [u32; 2],
    /// `[row][column]`, by which numbers above black are multiplied.
    pub gains: Vec<f32>,
}

impl GainMap {
    /// The map that makes a white image even: `white` has `[row][column]` numbers above black, of `columns` columns, and
    /// the map's gains are 1 at the greatest of their means around its `points`.
    #[must_use]
    pub fn of_white(white: &[f64], columns: usize, points: [u32; 2]) -> Self {
        let rows = white.len() / columns.max(1);
        let [across, down] = points.map(|count| count.max(2) as usize);
        // A half of the way to the next point, all around.
        let span = |k: usize, count: usize, length: usize| {
            let [way, middle] = [length as f64 / (count - 1) as f64, k as f64];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a place in it"
            )]
            let place = |at: f64| (at * way).round().clamp(0.0, length as f64) as usize;
            let from = place(middle - 0.25).min(length.saturating_sub(1));
            from..place(middle + 0.25).max(from + 1)
        };
        let mut means = Vec::with_capacity(across * down);
        for row in 0..down {
            for column in 0..across {
                let (mut sum, mut count) = (0.0, 0.0);
                for y in span(row, down, rows) {
                    for x in span(column, across, columns) {
                        sum += white[y * columns + x];
                        count += 1.0;
                    }
                }
                means.push(sum / f64::max(count, 1.0));
            }
        }
        let most = means.iter().copied().fold(0.0, f64::max);
        #[expect(clippy::cast_possible_truncation, reason = "the format has f32")]
        let gains = means.iter().map(|mean| (most / mean.max(1e-3 * most)) as f32).collect();
        #[expect(clippy::cast_possible_truncation, reason = "as they came")]
        Self { points: [across as u32, down as u32], gains }
    }

    /// As the only one of an `OpcodeList2`: opcode 9 of DNG 1.3, in big-endian order.
    fn opcodes(&self, [width, height]: [u32; 2]) -> Vec<u8> {
        let [across, down] = self.points;
        let mut data = Vec::new();
        let words = [0, 0, height, width, 0, 1, 1, 1, down, across];
        words.iter().for_each(|word: &u32| data.extend(word.to_be_bytes()));
        let step = |count: u32| 1.0 / f64::from(count.max(2) - 1);
        let places = [step(down), step(across), 0.0, 0.0];
        places.iter().for_each(|place| data.extend(place.to_be_bytes()));
        data.extend(1u32.to_be_bytes());
        self.gains.iter().for_each(|gain| data.extend(gain.to_be_bytes()));
        // One opcode: its number, the version that knows it, no flags, its length.
        let mut list = Vec::new();
        #[expect(clippy::cast_possible_truncation, reason = "a map of a few hundred points")]
        let head = [1, 9, 0x0103_0000, 0, data.len() as u32];
        head.iter().for_each(|word: &u32| list.extend(word.to_be_bytes()));
        list.extend(data);
        list
    }
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
        DngDetails { model, white, exposure, f_number, shading }: DngDetails<'_>,
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
        if let Some(f_number) = f_number.filter(|number| number.is_finite() && *number > 0.0) {
            directory.write_tag(unknown(33_437), rational(f_number))?;
        }
        if let Some(map) = shading {
            directory.write_tag(unknown(51_009), TiffUndefined(&map.opcodes([width, height])))?;
        }
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
            if let Some(forward) = forward_matrix(&matrix) {
                directory.write_tag(unknown(50_964), forward.as_slice())?;
            }
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
        if !filters.iter().all(|filter| matches!(filter, ColourFilter::Curve(_))) {
            return None;
        }
        let light = Illuminant::D65.curve().ok()?;
        let [from, to] = light.range();
        let ramp = Curve::sampled(vec![[from, from], [to, to]]).ok()?;
        let curves = self.of_rgb(|k| filters.get(k).and_then(ColourFilter::curve).cloned());
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

    /// Values of the channels red, green and blue, by the number of each.
    fn of_rgb<T: Default>(&self, of: impl Fn(usize) -> T) -> [T; 3] {
        let names: Vec<&str> = self.channels().collect();
        ["R", "G", "B"].map(|name| {
            let found = names.iter().position(|other| other.eq_ignore_ascii_case(name));
            found.map_or_else(T::default, &of)
        })
    }
}

/// `ForwardMatrix1`: from channels that are balanced for D65 to XYZ under D50, of a `ColorMatrix1` for D65. White, 1 in
/// each of them, becomes D50's (DNG specification, chapter 6, "Camera to XYZ (D50) Transform"), adapted by Bradford's
/// matrices (Lam 1985).
fn forward_matrix(of_colours: &[SRational]) -> Option<Vec<SRational>> {
    let number = |k: usize| f64::from(of_colours[k].n) / f64::from(of_colours[k].d);
    let matrix: Matrix3 = std::array::from_fn(|row| std::array::from_fn(|k| number(3 * row + k)));
    let times = |m: &Matrix3, x: [f64; 3]| -> [f64; 3] {
        m.map(|row| row.iter().zip(x).map(|(m, x)| m * x).sum())
    };
    let bradford: Matrix3 =
        [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    let (d65, d50) = ([0.950_47, 1.0, 1.088_83], [0.964_22, 1.0, 0.825_21]);
    let [from, to] = [d65, d50].map(|white| times(&bradford, white));
    let (back, of_channels) = (inverse(&bradford)?, inverse(&matrix)?);
    let balanced = times(&matrix, d65);
    let column = |k: usize| -> [f64; 3] {
        let mut channel = [0.0; 3];
        channel[k] = balanced[k];
        let cones = times(&bradford, times(&of_channels, channel));
        times(&back, std::array::from_fn(|i| cones[i] * to[i] / from[i]))
    };
    let columns: [[f64; 3]; 3] = std::array::from_fn(column);
    Some((0..9).map(|at| signed(columns[at % 3][at / 3])).collect())
}

/// Bytes of TIFF's type `UNDEFINED`, which no list of bytes has by itself.
struct TiffUndefined<'a>(&'a [u8]);

impl TiffValue for TiffUndefined<'_> {
    const BYTE_LEN: u8 = 1;
    const FIELD_TYPE: Type = Type::UNDEFINED;

    fn count(&self) -> usize {
        self.0.len()
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(self.0)
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
