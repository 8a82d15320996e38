#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]
#![doc = include_str!("../README.md")]

pub mod cube;
pub mod dng;
pub mod envi;
pub mod npy;

mod band_axis;
mod formats;
mod limits;
mod raster;
mod reduced;

use std::io::{BufRead, Cursor, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};

use image::ImageReader;

pub use band_axis::BandAxis;
pub use cube::{Cube, Quantity};
pub use limits::{Coarseness, DecodeError, Limits, MOST_BYTES, MOST_SIDE, room};
pub use raster::{ExrChannels, Plane, Raster, Samples, linear_from_srgb};

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
    Some(formats::bytes_of(&reader.into_decoder().ok()?))
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
    formats::read(reader.into_decoder()?, limits)
}

#[cfg(test)]
mod tests;
