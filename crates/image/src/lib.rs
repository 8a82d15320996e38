#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]
#![doc = include_str!("../README.md")]

pub mod cube;
pub mod dng;
pub mod envi;
pub mod npy;

mod formats;
mod raster;
mod reduced;

use std::collections::BTreeMap;
use std::io::{BufRead, Cursor, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};

use bytemuck::Pod;
use image::{ColorType, ImageDecoder, ImageReader};

pub use cube::{BandAxis, Cube, Quantity};
pub use raster::{Raster, Samples, linear_from_srgb};
pub use reduced::Coarseness;

/// Side of the largest image that is decoded (texels).
pub const MOST_SIDE: u64 = 32_768;

/// Bytes that the largest image takes when it is decoded: 16 384 × 16 384 texels of 16-bit RGBA.
pub const MOST_BYTES: u64 = 1 << 31;

/// The most that an image may take, and how coarse it may be for that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Bytes of its decoded values.
    pub bytes: u64,
    /// Bytes of its file, which are out of proportion to much more.
    file: u64,
    /// As coarse as it may be decoded; as fine as its file where absent.
    coarse: Option<Coarseness>,
}

/// Bytes that an image may take, however small its file is.
const MADE_OF_NOTHING: u64 = 128 << 20;

/// As many more for each byte of its file: what deflate makes of one colour all over, 1032 to 1.
const MADE_PER_BYTE: u64 = 1024;

impl Default for Limits {
    fn default() -> Self {
        Self { bytes: MOST_BYTES, file: u64::MAX, coarse: None }
    }
}

impl Limits {
    /// [`MOST_BYTES`], or less where a whole render may not take as much.
    #[must_use]
    pub fn within(memory: Option<u64>) -> Self {
        Self { bytes: memory.unwrap_or(MOST_BYTES).min(MOST_BYTES), ..Self::default() }
    }

    /// Returns the limits for an image that may be as coarse: it is decoded in linear light, in as few texels.
    #[must_use]
    pub fn coarse(self, coarse: Option<Coarseness>) -> Self {
        Self { coarse, ..self }
    }

    /// Returns the limits, with no more than is in proportion to the `file`'s bytes.
    fn of(self, file: &[u8]) -> Self {
        Self { file: file.len() as u64, ..self }
    }

    /// The number of texels of an image of `width` × `height`, each of which takes `texel` bytes.
    fn judge(self, [width, height]: [u64; 2], texel: u64) -> Result<usize, DecodeError> {
        if width == 0 || height == 0 {
            return Err(DecodeError::Refused(format!("it has {width} x {height} texels")));
        }
        if width > MOST_SIDE || height > MOST_SIDE {
            return Err(DecodeError::Side { width, height });
        }
        let bytes = width * height * texel;
        if bytes > self.bytes {
            return Err(DecodeError::Size { width, height, bytes, most: self.bytes });
        }
        if bytes > MADE_OF_NOTHING.saturating_add(self.file.saturating_mul(MADE_PER_BYTE)) {
            return Err(DecodeError::Refused(format!(
                "it has {width} x {height} texels, which take {:.2} GB decoded, out of all proportion to the {} \
                 bytes of the file: make it smaller",
                giga(bytes),
                self.file
            )));
        }
        usize::try_from(width * height).map_err(|_| DecodeError::Memory { bytes })
    }
}

/// Error of an image that could not be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// It is too wide or too high.
    #[error(
        "it has {width} x {height} texels, and {MOST_SIDE} a side are the most: make it smaller"
    )]
    Side {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// It takes too much memory.
    #[error(
        "it has {width} x {height} texels, which take {:.2} GB decoded, and {:.2} GB are the most: \
         make it smaller{}",
        giga(*bytes),
        giga(*most),
        if *most < MOST_BYTES { ", or raise --memory-limit" } else { "" }
    )]
    Size {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Bytes that it takes.
        bytes: u64,
        /// Bytes that it may take.
        most: u64,
    },
    /// The system has less memory than it takes.
    #[error("it takes {:.2} GB decoded, and the system has less: make it smaller", giga(*bytes))]
    Memory {
        /// Bytes that it takes.
        bytes: u64,
    },
    /// The decoder says so.
    #[error(transparent)]
    Decoder(#[from] image::ImageError),
    /// The decoder of EXR files says so.
    #[error(transparent)]
    OpenExr(#[from] exr::error::Error),
    /// It is a JPEG file without an end, of which the decoder makes up the rest.
    #[error("it is cut off: a JPEG ends with a marker of its own, which is not there")]
    Cut,
    /// Anything else: the sentence goes on after the file's name.
    #[error("{0}")]
    Refused(String),
}

impl DecodeError {
    /// Error of an EXR file without the channels of a colour.
    #[must_use]
    pub fn no_color() -> Self {
        let why = "it has no channels R, G and B, nor Y, nor a single one (multi-part and deep data are not read)";
        Self::Refused(why.to_owned())
    }

    /// Error of a decoder that gave up with a panic.
    fn panicked() -> Self {
        let why = "its decoder failed: the file is damaged, or of a kind that it does not know";
        Self::Refused(why.to_owned())
    }
}

fn giga(bytes: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a number to be read")]
    let bytes = bytes as f64;
    bytes / 1e9
}

/// Decodes the bytes of a PNG, JPEG, Radiance or EXR file, of which the first bytes tell the kind.
///
/// # Errors
///
/// When it is over `limits`, of no kind that is read, or broken.
pub fn decode(bytes: &[u8], limits: Limits) -> Result<Raster, DecodeError> {
    // Decoders are others' code over hostile input. They get no state that a panic could leave broken:
    // all that one has seen is dropped with it.
    let decode = || {
        let limits = limits.of(bytes);
        if let Some(reduced) = reduced::png(bytes, limits)? {
            return Ok(reduced);
        }
        let raster = decode_unguarded(bytes, limits)?;
        match limits.coarse {
            Some(coarse) => reduced::reduced(raster, coarse),
            None => Ok(raster),
        }
    };
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| Err(DecodeError::panicked()))
}

/// The values of one channel of an EXR file, by rows.
#[derive(Debug, Clone, PartialEq)]
pub enum Plane {
    /// Half or single precision.
    F32(Vec<f32>),
    /// Integers.
    U32(Vec<u32>),
}

/// All channels of an EXR file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrChannels {
    /// Columns and rows.
    pub size: [usize; 2],
    /// The channels by their full names (`R`, `Depth.Z`), in the file's order: that of their names.
    pub planes: Vec<(String, Plane)>,
    /// Attributes of the header that are text.
    pub texts: BTreeMap<String, String>,
}

/// True if `bytes` begin as an EXR file does.
#[must_use]
pub fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(formats::EXR_SIGNATURE)
}

/// Reads all channels of an EXR file's first layer that is not deep, but for those with fewer values than
/// pixels.
///
/// # Errors
///
/// When it is over `limits`, no EXR file, or broken.
pub fn exr_channels(bytes: &[u8], limits: Limits) -> Result<ExrChannels, DecodeError> {
    let read = catch_unwind(AssertUnwindSafe(|| formats::exr_channels(bytes, limits.of(bytes))));
    read.unwrap_or_else(|_| Err(DecodeError::panicked()))
}

/// Bytes that an image takes when it is decoded, by its header alone; `None` where that is none that
/// is read.
pub fn decoded_bytes(file: impl BufRead + Seek) -> Option<u64> {
    catch_unwind(AssertUnwindSafe(|| bytes_by_header(file))).ok().flatten()
}

fn bytes_by_header(mut file: impl BufRead + Seek) -> Option<u64> {
    let start = file.fill_buf().ok()?;
    if start.starts_with(formats::EXR_SIGNATURE) {
        return formats::exr_bytes(file);
    }
    if start.starts_with(formats::RADIANCE_SIGNATURE) {
        return formats::radiance_bytes(file);
    }
    let mut reader = ImageReader::new(file).with_guessed_format().ok()?;
    let mut limits = image::Limits::no_limits();
    limits.max_alloc = Some(1 << 26);
    reader.limits(limits);
    Some(bytes_of(&reader.into_decoder().ok()?))
}

/// Bytes of what `decoder` will read.
fn bytes_of(decoder: &impl ImageDecoder) -> u64 {
    let (width, height) = decoder.dimensions();
    let texel = u64::from(decoder.color_type().bytes_per_pixel());
    u64::from(width).saturating_mul(height.into()).saturating_mul(texel)
}

fn decode_unguarded(bytes: &[u8], limits: Limits) -> Result<Raster, DecodeError> {
    if bytes.starts_with(formats::EXR_SIGNATURE) {
        return formats::decode_exr(bytes, limits);
    }
    if bytes.starts_with(formats::RADIANCE_SIGNATURE) {
        return formats::decode_radiance(bytes, limits);
    }
    if formats::is_cut_jpeg(bytes) {
        return Err(DecodeError::Cut);
    }
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(image::ImageError::IoError)?;
    let mut own = image::Limits::default();
    // What a decoder keeps beside the texels: lines, tables, profiles.
    own.max_alloc = Some(limits.bytes.saturating_add(1 << 26));
    reader.limits(own);
    read(reader.into_decoder()?, limits)
}

/// Reads what `decoder` has, once its size is judged.
fn read(decoder: impl ImageDecoder, limits: Limits) -> Result<Raster, DecodeError> {
    let (width, height) = decoder.dimensions();
    let color = decoder.color_type();
    let texels = limits.judge([width, height].map(u64::from), color.bytes_per_pixel().into())?;
    let channels = usize::from(color.channel_count());
    let count = texels * channels;
    let samples = match color {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {
            Samples::U8(filled(decoder, count)?)
        }
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            Samples::U16(filled(decoder, count)?)
        }
        ColorType::Rgb32F | ColorType::Rgba32F => Samples::F32(filled(decoder, count)?),
        other => {
            return Err(DecodeError::Refused(format!(
                "its texels are {other:?}, which is not read"
            )));
        }
    };
    Ok(Raster::new([width, height].map(|side| side as usize), channels, samples))
}

fn filled<T: Pod>(decoder: impl ImageDecoder, count: usize) -> Result<Vec<T>, DecodeError> {
    let mut values = zeroed::<T>(count)?;
    decoder.read_image(bytemuck::cast_slice_mut(&mut values))?;
    Ok(values)
}

/// So many zeros, where there is memory for them.
fn zeroed<T: Pod>(count: usize) -> Result<Vec<T>, DecodeError> {
    let mut values = room(count)?;
    values.resize(count, T::zeroed());
    Ok(values)
}

/// Room for so many values.
///
/// # Errors
///
/// When the system has no memory for them.
pub fn room<T>(count: usize) -> Result<Vec<T>, DecodeError> {
    let mut values = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    values.try_reserve_exact(count).map_err(|_| DecodeError::Memory { bytes })?;
    Ok(values)
}

#[cfg(test)]
mod tests;
