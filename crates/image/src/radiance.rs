//! Radiance pictures (`.hdr`, `.pic`): G. Ward, "Real Pixels", Graphics Gems II, 1991, and the
//! header keys of Radiance's file formats.

use std::io::{BufRead, Cursor, Read};

use image::codecs::hdr::HdrDecoder;

use crate::{DecodeError, Limits, Raster, Samples, bytes_of, read};

/// What every Radiance file begins with; a program's name follows, `RADIANCE` or `RGBE` mostly.
pub(crate) const SIGNATURE: &[u8] = b"#?";

/// Bytes of the line with the program's name.
const LONGEST_NAME: u64 = 1 << 10;

/// Decodes a picture. Its values are divided by the product of all `EXPOSURE` and `COLORCORR` lines,
/// which say by what they have been multiplied.
pub(crate) fn decode(bytes: &[u8], limits: Limits) -> Result<Raster, DecodeError> {
    let line = bytes.iter().position(|&b| b == b'\n').unwrap_or(bytes.len());
    // The decoder knows one program's name alone.
    let file = Cursor::new(&b"#?RADIANCE"[..]).chain(&bytes[line..]);
    let decoder = HdrDecoder::new(file)?;
    let about = decoder.metadata();
    let exposure = about.exposure.unwrap_or(1.0);
    let (r, g, b) = about.color_correction.unwrap_or((1.0, 1.0, 1.0));
    let scales = [("EXPOSURE", exposure), ("COLORCORR", r), ("COLORCORR", g), ("COLORCORR", b)];
    for (name, value) in scales {
        if !(value > 0.0 && value.is_finite()) {
            return Err(DecodeError::Header { name, value });
        }
    }
    let raster = read(decoder, limits)?;
    let (size, channels) = (raster.size(), raster.channels());
    let Samples::F32(mut values) = raster.into_samples() else { return Err(DecodeError::Channels) };
    let scales = [r, g, b].map(|c| c * exposure);
    if scales != [1.0; 3] {
        for texel in values.chunks_mut(channels) {
            texel.iter_mut().zip(scales).for_each(|(value, scale)| *value /= scale);
        }
    }
    Ok(Raster::new(size, channels, Samples::F32(values)))
}

/// Bytes that a picture takes.
pub(crate) fn decoded_bytes(mut file: impl BufRead) -> Option<u64> {
    let mut line = Vec::new();
    file.by_ref().take(LONGEST_NAME).read_until(b'\n', &mut line).ok()?;
    let file = Cursor::new(&b"#?RADIANCE\n"[..]).chain(file);
    Some(bytes_of(&HdrDecoder::new(file).ok()?))
}
