//! Images over surfaces.

use std::io::{BufReader, Cursor};
use std::path::{Path, PathBuf};

use etendue_geometry::Buffer;
use etendue_image::{DecodeError, Limits, Raster, Samples};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pyramid::{Pyramid, bilinear};

pub use crate::pyramid::Wrap;

/// Source of an image's bytes, still encoded (PNG, JPEG, Radiance or EXR).
#[derive(Debug, Clone)]
pub enum ImageSource {
    /// A file.
    File(PathBuf),
    /// Bytes inside another file (a GLB's buffer view, a data URI).
    Bytes(Buffer<u8>),
    /// Nowhere: the file that the model names is not there.
    Missing,
}

/// Filter by which a lookup reads texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// Weighted by distance to the four nearest.
    #[default]
    Bilinear,
    /// The nearest only.
    Nearest,
}

/// Encoding of the numbers of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Colours by the sRGB curve.
    #[default]
    Srgb,
    /// Plain numbers.
    Linear,
}

/// An image with its sampler. Decoded only when the plan needs it, and once.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Its name in the file, for messages.
    pub name: String,
    /// The encoded image.
    pub source: ImageSource,
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// Filter by which texels are read.
    pub filter: Filter,
    /// True if the scene file itself names it, and not one of its models.
    pub named_by_scene: bool,
}

/// One use of a texture by a material.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureUse {
    /// Index into the scene's textures.
    pub texture: u32,
    /// Number of one of the mesh's texture coordinate sets.
    pub uv_set: u32,
    /// `KHR_texture_transform`: rows of the 2×3 matrix that carries (u, v, 1).
    pub transform: [[f64; 3]; 2],
    /// Encoding of the image's numbers to this use.
    pub encoding: Encoding,
}

impl TextureUse {
    /// The transform that changes nothing.
    pub const UNCHANGED: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
}

/// A decoded image, ready to be looked up.
#[derive(Debug, Clone)]
pub struct Image {
    raster: Raster,
    wrap: [Wrap; 2],
    filter: Filter,
    /// For each encoding that is filtered by footprint.
    pyramids: [Option<Pyramid>; 2],
    /// Lookups along a footprint, at most: beyond so many times as long as wide it is made wider.
    lookups: f64,
    stands_in: bool,
    /// Texels that were not finite or below zero, and count as black.
    pub dropped: u64,
}

/// The reason why an image could not be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file could not be read.
    #[error("cannot read {path}: {source}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause of the error.
        source: std::io::Error,
    },
    /// The bytes are no image that we read, or a broken one.
    #[error("cannot decode {name}: {source}")]
    Decode {
        /// Name of the texture.
        name: String,
        /// Cause of the error.
        source: DecodeError,
    },
}

impl ImageError {
    /// True if the image is larger than it may be, rather than broken.
    #[must_use]
    pub fn is_too_large(&self) -> bool {
        matches!(
            self,
            Self::Decode {
                source: DecodeError::Side { .. }
                    | DecodeError::Size { .. }
                    | DecodeError::Memory { .. },
                ..
            }
        )
    }
}

/// The longest image file that is read (bytes): twice what the largest image takes decoded.
const LONGEST: u64 = 1 << 32;

impl Texture {
    /// The file that holds the image, when it is one of its own.
    #[must_use]
    pub fn file(&self) -> Option<&PathBuf> {
        if let ImageSource::File(path) = &self.source { Some(path) } else { None }
    }

    /// Bytes that the image takes when it is decoded, by its header; 0 where that cannot be read.
    #[must_use]
    pub fn decoded_bytes(&self) -> u64 {
        match &self.source {
            ImageSource::Missing => 0,
            ImageSource::Bytes(bytes) => {
                etendue_image::decoded_bytes(Cursor::new(&**bytes)).unwrap_or(0)
            }
            ImageSource::File(path) => decoded_bytes(path),
        }
    }

    /// Decodes the image, with the values that the file has: 8 or 16 bits, half or single precision.
    ///
    /// # Errors
    ///
    /// When it cannot be read or decoded, or is over `limits`.
    pub fn decode(&self, limits: Limits) -> Result<Image, ImageError> {
        let read;
        let bytes: &[u8] = match &self.source {
            ImageSource::Missing => return Ok(Image::missing()),
            ImageSource::Bytes(bytes) => bytes,
            ImageSource::File(path) => {
                read = read_file(path)?;
                &read
            }
        };
        let mut raster = read_image(&self.name, bytes, limits)?;
        let dropped = raster.drop_unsound();
        let raster = raster.packed();
        let (wrap, filter, lookups) = (self.wrap, self.filter, f64::from(Image::LOOKUPS));
        let pyramids = [None, None];
        Ok(Image { raster, wrap, filter, pyramids, lookups, stands_in: false, dropped })
    }
}

/// Bytes that an image file takes when it is decoded, by its header; 0 where that cannot be read.
#[must_use]
pub fn decoded_bytes(path: &Path) -> u64 {
    let file = etendue_files::open(path).ok().map(BufReader::new);
    file.and_then(etendue_image::decoded_bytes).unwrap_or(0)
}

/// The bytes of an image file.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, ImageError> {
    etendue_files::read(path, LONGEST)
        .map_err(|source| ImageError::Read { path: path.to_owned(), source })
}

/// Decodes an image file of any kind that is read.
pub(crate) fn read_image(name: &str, bytes: &[u8], limits: Limits) -> Result<Raster, ImageError> {
    etendue_image::decode(bytes, limits)
        .map_err(|source| ImageError::Decode { name: name.to_owned(), source })
}

impl Image {
    /// Lookups along a footprint, at most, where nothing else is said.
    pub const LOOKUPS: u32 = 8;

    /// The magenta and black checker that stands in for an image that cannot be had.
    #[must_use]
    pub fn missing() -> Self {
        let (magenta, black) = ([255, 0, 255], [0; 3]);
        let texels = [magenta, black, black, magenta].concat();
        Self {
            raster: Raster::new([2, 2], 3, Samples::U8(texels)),
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Nearest,
            pyramids: [None, None],
            lookups: f64::from(Self::LOOKUPS),
            stands_in: true,
            dropped: 0,
        }
    }

    /// True if this is [`Self::missing`], which is to be seen where it is a colour and to be left
    /// out where it is anything else.
    #[must_use]
    pub fn stands_in(&self) -> bool {
        self.stands_in
    }

    /// Returns the image with another number of lookups along a footprint, at most.
    #[must_use]
    pub fn with_lookups(self, most: u32) -> Self {
        Self { lookups: f64::from(most.max(1)), ..self }
    }

    /// Makes ready for [`Self::sample_over`] in an encoding.
    ///
    /// # Errors
    ///
    /// When there is no memory for its means; `name` is what the texture is called.
    pub fn filter_by_footprint(
        &mut self,
        encoding: Encoding,
        name: &str,
    ) -> Result<(), ImageError> {
        if self.pyramids[encoding as usize].is_some() || self.raster.is_empty() {
            return Ok(());
        }
        // What every byte stands for, where the image has bytes: that of an image of all of them.
        let bytes = || {
            let all = Raster::new([256, 1], 1, Samples::U8((0..=255).collect()));
            std::array::from_fn(|i| decoded(&all, i, encoding)[0])
        };
        let texel = |i: usize| decoded(&self.raster, i, encoding);
        let pyramid = Pyramid::new(&self.raster, texel, bytes)
            .map_err(|source| ImageError::Decode { name: name.to_owned(), source })?;
        self.pyramids[encoding as usize] = Some(pyramid);
        Ok(())
    }

    /// Bytes of the decoded texels, those of means over several included.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let means: usize = self.pyramids.iter().flatten().map(Pyramid::bytes).sum();
        self.raster.bytes() + means
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.raster.size()
    }

    /// A bound of its colours.
    pub(crate) fn brightest(&self) -> f64 {
        match self.raster.samples() {
            Samples::U8(_) | Samples::U16(_) => 1.0,
            // The largest number of half precision.
            Samples::F16(_) => 65_504.0,
            Samples::F32(values) => f64::from(values.iter().copied().fold(0.0, f32::max)),
        }
    }

    /// Linear colour and alpha at (u, v): (0, 0) is the upper left corner of the upper left texel, as
    /// in glTF.
    #[must_use]
    pub fn sample(&self, [u, v]: [f64; 2], encoding: Encoding) -> [f64; 4] {
        if !(u.is_finite() && v.is_finite()) || self.raster.is_empty() {
            return [0.0, 0.0, 0.0, 1.0];
        }
        let [width, height] = self.size();
        let (x, y) = (u * width as f64, v * height as f64);
        match self.filter {
            Filter::Nearest => self.texel(x.floor(), y.floor(), encoding),
            Filter::Bilinear => bilinear([x - 0.5, y - 0.5], |x, y| self.texel(x, y, encoding)),
        }
    }

    /// [`Self::sample`], averaged over an ellipse with these axes (in units of u and v): several
    /// lookups along the longer one, in a level of the pyramid whose texels are as wide as the
    /// shorter. Ellipses within one texel are points.
    #[must_use]
    pub fn sample_over(&self, uv: [f64; 2], axes: [[f64; 2]; 2], encoding: Encoding) -> [f64; 4] {
        let Some(pyramid) = &self.pyramids[encoding as usize] else {
            return self.sample(uv, encoding);
        };
        let [width, height] = self.size();
        let length = |[u, v]: [f64; 2]| {
            let (x, y) = (u * width as f64, v * height as f64);
            let squared = x * x + y * y;
            // However long it is, it has a length.
            if squared > f64::MAX { f64::MAX.sqrt() } else { squared.sqrt() }
        };
        let lengths = axes.map(length);
        let (long, short, axis) = if lengths[0] >= lengths[1] {
            (lengths[0], lengths[1], axes[0])
        } else {
            (lengths[1], lengths[0], axes[1])
        };
        if !(long > 1.0 && uv.iter().all(|c| c.is_finite())) {
            return self.sample(uv, encoding);
        }
        let wide = short.max(long / self.lookups).max(1.0);
        let level = wide.log2().min(pyramid.len() as f64);
        let count = (long / wide).ceil().clamp(1.0, self.lookups);
        let mut sum = [0.0; 4];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        for i in 0..count as u32 {
            let at = (f64::from(i) + 0.5) / count - 0.5;
            let value =
                self.between(pyramid, level, [0, 1].map(|k| uv[k] + at * axis[k]), encoding);
            sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += value / count);
        }
        sum
    }

    /// The value between the two levels next to a fractional one; level 0 is the image.
    fn between(&self, pyramid: &Pyramid, level: f64, uv: [f64; 2], encoding: Encoding) -> [f64; 4] {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "few levels")]
        let below = level.floor() as usize;
        let share = level - level.floor();
        let at = |level: usize| match level {
            0 => self.sample(uv, encoding),
            level => pyramid.sample(level, uv, self.wrap),
        };
        let lower = at(below);
        if share == 0.0 {
            return lower;
        }
        let upper = at(below + 1);
        std::array::from_fn(|k| lower[k] + (upper[k] - lower[k]) * share)
    }

    /// The texel in column `x` and row `y`, wrapped.
    fn texel(&self, x: f64, y: f64, encoding: Encoding) -> [f64; 4] {
        let [width, height] = self.size();
        let column = self.wrap[0].apply(x, width);
        let row = self.wrap[1].apply(y, height);
        decoded(&self.raster, row * width + column, encoding)
    }
}

/// Linear colour and alpha of a texel. Floats are linear light whatever a colour's encoding is.
fn decoded(raster: &Raster, index: usize, encoding: Encoding) -> [f64; 4] {
    match encoding {
        Encoding::Srgb => raster.linear(index),
        Encoding::Linear => raster.texel(index),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One white row among sixteen, seen over all of it by an ellipse as high as a row: by sixteen lookups it is white,
    /// and by one, which is as high as wide, a sixteenth of that.
    #[test]
    fn few_lookups_blur_across_a_footprint() {
        let texels: Vec<u8> = (0..256).map(|i| if i / 16 == 8 { 255 } else { 0 }).collect();
        let raster = Raster::new([16, 16], 1, Samples::U8(texels));
        let (wrap, filter) = ([Wrap::Repeat; 2], Filter::Bilinear);
        let mut image = Image { raster, wrap, filter, ..Image::missing() };
        image.filter_by_footprint(Encoding::Linear, "rows").unwrap();
        let seen = |lookups: u32| {
            let image = image.clone().with_lookups(lookups);
            image.sample_over([0.5, 8.5 / 16.0], [[1.0, 0.0], [0.0, 1.0 / 16.0]], Encoding::Linear)
        };
        // Means have 16 bits.
        assert!((seen(16)[0] - 1.0).abs() < 1e-4, "{:?}", seen(16));
        assert!((seen(1)[0] - 1.0 / 16.0).abs() < 1e-4, "{:?}", seen(1));
    }
}
