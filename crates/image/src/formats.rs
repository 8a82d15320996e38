//! Images from decoders of the crate `image`, and formats whose decoders are called here and not by it.
//!
//! OpenEXR files: colour, or luminance alone.
//!
//! Radiance pictures (`.hdr`, `.pic`): G. Ward, "Real Pixels", Graphics Gems II, 1991, and the
//! header keys of Radiance's file formats.

use std::io::{BufRead, Cursor, Read};

use bytemuck::Pod;
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::*;
use image::codecs::hdr::HdrDecoder;
use image::{ColorType, ImageDecoder};

use crate::{DecodeError, ExrChannels, Limits, MOST_BYTES, Plane, Raster, Samples, room};

// The prelude below has another.
use std::result::Result;

/// Signature that every EXR file begins with.
pub(crate) const EXR_SIGNATURE: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Placement of a layer's texels in its display window.
#[derive(Debug, Clone, Copy)]
struct DisplayWindow {
    size: [usize; 2],
    /// The layer's corner in the display window.
    corner: [i32; 2],
    channels: usize,
}

impl DisplayWindow {
    /// The first value of a texel of the layer; `None` outside of the display window.
    fn place(self, texel: Vec2<usize>) -> Option<usize> {
        let at = |k: usize, index: usize| {
            let place = i64::from(self.corner[k]) + i64::try_from(index).ok()?;
            usize::try_from(place).ok().filter(|&place| place < self.size[k])
        };
        let (x, y) = (at(0, texel.x())?, at(1, texel.y())?);
        Some((y * self.size[0] + x) * self.channels)
    }
}

/// Decodes the first layer that has the channels R, G and B, or else Y, or else a single one; alpha
/// beside them where it is. Texels of the display window that the layer does not cover are 0.
pub(crate) fn decode_exr(bytes: &[u8], limits: Limits) -> Result<Raster, DecodeError> {
    let about = MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    judge_blocks(&about, limits)?;
    let flat = || about.headers.iter().filter(|header| !header.deep);
    let rgb = |header: &&Header| ["R", "G", "B"].iter().all(|name| has(header, name));
    if let Some(header) = flat().find(rgb) {
        return colours(bytes, header, limits);
    }
    if let Some(header) = flat().find(|header| has(header, "Y") && !has(header, "RY")) {
        return grey(bytes, header, &Text::from("Y"), limits);
    }
    let lone = |header: &Header| {
        let mut names = header.channels.list.iter().map(|channel| &channel.name);
        let name = names.find(|name| **name != *"A")?.clone();
        names.all(|other| *other == *"A").then_some(name)
    };
    let found = flat().find_map(|header| Some((header, lone(header)?)));
    let (header, name) = found.ok_or_else(DecodeError::no_color)?;
    grey(bytes, header, &name, limits)
}

/// Checks that the blocks that a file is divided into are in proportion to it: a tile may be larger
/// than its image, and the decoder takes its memory before it reads it.
fn judge_blocks(about: &MetaData, limits: Limits) -> Result<(), DecodeError> {
    let limits = Limits { bytes: MOST_BYTES, ..limits };
    for header in about.headers.iter().filter(|header| !header.deep) {
        let size = match header.blocks {
            BlockDescription::Tiles(tiles) => tiles.tile_size,
            BlockDescription::ScanLines => {
                Vec2(header.layer_size.x(), header.compression.scan_lines_per_block())
            }
        };
        let size = [size.x(), size.y()].map(|side| side as u64);
        limits.judge(size, header.channels.bytes_per_pixel as u64)?;
    }
    Ok(())
}

/// Bytes that the first layer takes, with no more than four channels.
pub(crate) fn exr_bytes(file: impl BufRead) -> Option<u64> {
    let about = MetaData::read_from_buffered(file, false).ok()?;
    let header = about.headers.first()?;
    let size = header.shared_attributes.display_window.size;
    let channels = header.channels.list.len().min(4) as u64;
    (size.x() as u64).checked_mul(size.y() as u64)?.checked_mul(4 * channels)
}

fn has(header: &Header, name: &str) -> bool {
    header.channels.list.iter().any(|channel| channel.name == *name)
}

/// The window of `header`, with so many values that it and what the file itself has are within limits.
fn window(header: &Header, channels: usize, limits: Limits) -> Result<DisplayWindow, DecodeError> {
    let shown = header.shared_attributes.display_window;
    let texel = 4 * channels as u64;
    let layer = [header.layer_size.x(), header.layer_size.y()].map(|side| side as u64);
    limits.judge(layer, texel)?;
    let size = [shown.size.x(), shown.size.y()];
    limits.judge(size.map(|side| side as u64), texel)?;
    let offset = |own: i32, display: i32| own.saturating_sub(display);
    let own = header.own_attributes.layer_position;
    let corner = [offset(own.x(), shown.position.x()), offset(own.y(), shown.position.y())];
    // Memory is asked for here, where it may be refused; below the decoder asks for it.
    drop(room::<f32>(size[0] * size[1] * channels)?);
    Ok(DisplayWindow { size, corner, channels })
}

fn colours(bytes: &[u8], header: &Header, limits: Limits) -> Result<Raster, DecodeError> {
    let window = window(header, if has(header, "A") { 4 } else { 3 }, limits)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            move |_, _| vec![0.0_f32; window.size[0] * window.size[1] * window.channels],
            move |values: &mut Vec<f32>, texel, (r, g, b, a): (f32, f32, f32, f32)| {
                if let Some(first) = window.place(texel) {
                    let own = &mut values[first..first + window.channels];
                    own.copy_from_slice(&[r, g, b, a][..window.channels]);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))?;
    let values = image.layer_data.channel_data.pixels;
    Ok(Raster::new(window.size, window.channels, Samples::F32(values)))
}

fn grey(bytes: &[u8], header: &Header, name: &Text, limits: Limits) -> Result<Raster, DecodeError> {
    let window = window(header, if has(header, "A") { 2 } else { 1 }, limits)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required(name.clone())
        .optional("A", 1.0_f32)
        .collect_pixels(
            move |_, _| vec![0.0_f32; window.size[0] * window.size[1] * window.channels],
            move |values: &mut Vec<f32>, texel, (grey, alpha): (f32, f32)| {
                if let Some(first) = window.place(texel) {
                    let own = &mut values[first..first + window.channels];
                    own.copy_from_slice(&[grey, alpha][..window.channels]);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))?;
    let values = image.layer_data.channel_data.pixels;
    Ok(Raster::new(window.size, window.channels, Samples::F32(values)))
}

/// Reads all channels of the first layer as they are.
pub(crate) fn exr_channels(bytes: &[u8], limits: Limits) -> Result<ExrChannels, DecodeError> {
    // The header is judged before anything is decoded.
    let about = MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    judge_blocks(&about, limits)?;
    let header =
        about.headers.iter().find(|header| !header.deep).ok_or_else(DecodeError::no_color)?;
    let side = [header.layer_size.x(), header.layer_size.y()].map(|side| side as u64);
    let channels = header.channels.list.len();
    let texels = limits.judge(side, 4 * channels as u64)?;
    // As in `window`; halves become floats beside what was decoded.
    drop(room::<f32>(2 * texels * channels)?);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))?;
    let layer = image.layer_data;
    let size = [layer.size.x(), layer.size.y()];
    // Words and numbers; channels at less than full resolution are left out.
    let texts = image.attributes.other.iter().chain(&layer.attributes.other);
    let texts = texts.filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
        _ => None,
    });
    let whole = layer.channel_data.list.into_iter();
    let whole = whole.filter(|channel| channel.sample_data.len() == size[0] * size[1]);
    let planes = whole.map(|channel| {
        let plane = match channel.sample_data {
            FlatSamples::F16(values) => Plane::F32(values.into_iter().map(f16::to_f32).collect()),
            FlatSamples::F32(values) => Plane::F32(values),
            FlatSamples::U32(values) => Plane::U32(values),
        };
        (channel.name.to_string(), plane)
    });
    Ok(ExrChannels { size, planes: planes.collect(), texts: texts.collect() })
}

/// Signature that every Radiance file begins with; a program's name follows, `RADIANCE` or `RGBE` mostly.
pub(crate) const RADIANCE_SIGNATURE: &[u8] = b"#?";

/// Bytes of the line with the program's name.
const LONGEST_NAME: u64 = 1 << 10;

/// Decodes a picture. Its values are divided by the product of all `EXPOSURE` and `COLORCORR` lines,
/// which say by what they have been multiplied.
pub(crate) fn decode_radiance(bytes: &[u8], limits: Limits) -> Result<Raster, DecodeError> {
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
            return Err(DecodeError::Refused(format!(
                "its header has {name} {value}, and a positive number is needed"
            )));
        }
    }
    let raster = read(decoder, limits)?;
    let (size, channels) = (raster.size(), raster.channels());
    let Samples::F32(mut values) = raster.into_samples() else {
        return Err(DecodeError::no_color());
    };
    let scales = [r, g, b].map(|c| c * exposure);
    if scales != [1.0; 3] {
        for texel in values.chunks_mut(channels) {
            texel.iter_mut().zip(scales).for_each(|(value, scale)| *value /= scale);
        }
    }
    Ok(Raster::new(size, channels, Samples::F32(values)))
}

/// Bytes that a picture takes.
pub(crate) fn radiance_bytes(mut file: impl BufRead) -> Option<u64> {
    let mut line = Vec::new();
    file.by_ref().take(LONGEST_NAME).read_until(b'\n', &mut line).ok()?;
    let file = Cursor::new(&b"#?RADIANCE\n"[..]).chain(file);
    Some(bytes_of(&HdrDecoder::new(file).ok()?))
}
/// True if a file is a JPEG that ends before its picture does: segments are gone through by their
/// lengths, and the data behind them to the next marker (ITU-T T.81, B.1.1). Of other files, and of
/// what is no segment, the decoder says more.
pub(crate) fn is_cut_jpeg(bytes: &[u8]) -> bool {
    const SCAN: u8 = 0xda;
    const END: u8 = 0xd9;
    let Some(mut rest) = bytes.strip_prefix(b"\xff\xd8") else { return false };
    loop {
        // Fill bytes may stand before a marker.
        let (marker, after) = match rest {
            [0xff, 0xff, ..] => {
                rest = &rest[1..];
                continue;
            }
            [0xff, marker, after @ ..] => (*marker, after),
            [] | [0xff] => return true,
            _ => return false,
        };
        if marker == END {
            return false;
        }
        let [high, low, ..] = after else { return true };
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        let Some(behind) = after.get(length..) else { return true };
        // Within a scan 0xff stands for itself with 0 behind it, and restarts are part of the data.
        let is_marker = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0 | 0xff | 0xd0..=0xd7);
        let data = match marker {
            SCAN => behind.windows(2).position(is_marker),
            _ => Some(0),
        };
        let Some(data) = data else { return true };
        rest = &behind[data..];
    }
}

/// Bytes of what `decoder` will read.
pub(crate) fn bytes_of(decoder: &impl ImageDecoder) -> u64 {
    let (width, height) = decoder.dimensions();
    let texel = u64::from(decoder.color_type().bytes_per_pixel());
    u64::from(width).saturating_mul(height.into()).saturating_mul(texel)
}

/// Reads what `decoder` has, once its size is judged.
pub(crate) fn read(decoder: impl ImageDecoder, limits: Limits) -> Result<Raster, DecodeError> {
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
