//! PNG: a layer to look at, or a sensor's digital numbers.
//!
//! How numbers become colours is the layer's [`Look`]. The file's text says which of the two it is
//! (`Comment`), how to read it (`Reading`), and carries the layer's meaning and the header.
//!
//! Source: W3C, *Portable Network Graphics (PNG) Specification (Third Edition)*, 2025.

use std::borrow::Cow;
use std::io::BufWriter;
use std::path::Path;

use ::png::text_metadata::ITXtChunk;
use ::png::{BitDepth, ColorType, EncodingError, Info, SrgbRenderingIntent};

use super::DENOISED;
pub use super::look::Bits;
use super::look::{ColourType, LayerImage, mask, palette, show};
use super::{HeaderEntry, Layer, Look, OutputError, Picture};
use crate::memory::check_room;
use etendue_files::{PartFile, SOFTWARE, Transaction};

/// Writes the layer called `name` (empty for the picture itself, or for what it is without its noise where
/// that is there) to `path`. `bits` is the depth of
/// a preview; a sensor's digital numbers take the depth they need.
///
/// # Errors
///
/// When there is no such layer, when a side is longer than PNG's 2³¹ − 1, or when the file cannot
/// be written.
pub fn write(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    name: &str,
    bits: Bits,
) -> Result<(), OutputError> {
    let layer = picture.require(name)?;
    let denoised = picture.layer(DENOISED).filter(|_| name.is_empty());
    let layer = denoised.unwrap_or(layer);
    let shown = match (layer.look, name) {
        (Look::Color, "") => picture.show(layer, bits)?,
        _ => show(layer, bits)?,
    };
    write_shown(files, path, picture, layer, &shown)
}

/// Writes the numbers of the layer of ids called `name` to `path`: 16 bits, grey, not scaled. `false`
/// when a number needs more bits, and nothing is written.
///
/// # Errors
///
/// As [`write()`].
pub fn write_mask(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    name: &str,
) -> Result<bool, OutputError> {
    let layer = picture.require(name)?;
    match mask(layer)? {
        Some(shown) => write_shown(files, path, picture, layer, &shown).map(|()| true),
        None => Ok(false),
    }
}

pub(super) fn write_shown(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    layer: &Layer,
    shown: &LayerImage,
) -> Result<(), OutputError> {
    let [width, height] = [picture.width(), picture.height()].map(|side| {
        let side = i32::try_from(side).ok().map(i32::unsigned_abs);
        side.ok_or_else(|| OutputError::format(path, "a side is longer than 2147483647 pixels"))
    });
    let mut info = Info::with_size(width?, height?);
    info.utf8_text = texts(picture, layer, shown);
    info.color_type = match shown.channels {
        ColourType::Grey => ColorType::Grayscale,
        ColourType::Rgb => ColorType::Rgb,
        ColourType::Rgba => ColorType::Rgba,
        ColourType::Indexed => ColorType::Indexed,
    };
    info.palette = (shown.channels == ColourType::Indexed).then(|| palette().into());
    info.bit_depth = match shown.bits {
        Bits::Eight => BitDepth::Eight,
        Bits::Sixteen => BitDepth::Sixteen,
    };
    // Only light is meant for a colour transform.
    info.srgb = (layer.look == Look::Color).then_some(SrgbRenderingIntent::Perceptual);

    // The encoder holds the filtered rows and what it makes of them, which may be no smaller.
    check_room(shown.bytes.len().saturating_mul(2))?;
    let mut part = files.create(path)?;
    encode(&mut part, info, &shown.bytes).map_err(|error| match error {
        EncodingError::IoError(source) => OutputError::io(path, source),
        error => OutputError::format(path, error),
    })?;
    Ok(part.finish()?)
}

fn encode(part: &mut PartFile<'_>, info: Info<'_>, bytes: &[u8]) -> Result<(), EncodingError> {
    let mut encoder = ::png::Encoder::with_info(BufWriter::new(part), info)?;
    encoder.set_compression(::png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()
}

/// Texts of the file, beside its pixels.
fn texts(picture: &Picture, layer: &Layer, shown: &LayerImage) -> Vec<ITXtChunk> {
    let comment = match shown.is_data {
        true => "data",
        false => "preview, not data: the values are in the EXR and NPY files",
    };
    let title = layer.title();
    let fixed = [
        ("Title", title.as_str()),
        ("Software", SOFTWARE),
        ("Comment", comment),
        ("Reading", shown.note.as_str()),
    ];
    let entries = layer.meaning.iter().chain(picture.header());
    let entries = entries
        .map(|HeaderEntry { key, text }| (Cow::from(format!("etendue:{key}")), text.as_str()));
    let fixed = fixed.into_iter().map(|(key, text)| (Cow::from(key), text));
    let names = picture.names(&layer.name).filter(|_| shown.channels == ColourType::Indexed);
    let names = names.map(|names| ITXtChunk::new("Names", names.to_string()));
    fixed.chain(entries).map(|(key, text)| ITXtChunk::new(key, text)).chain(names).collect()
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::BufReader;

    use super::super::{Channel, Values};
    use super::*;

    fn picture() -> Picture {
        let channel = |name: &str, values| Channel { name: name.into(), values };
        let depth = Layer {
            name: "Depth".into(),
            look: Look::Distance,
            channels: vec![channel("Z", Values::F32(vec![1.0, 2.0, 4.0, f32::INFINITY]))],
            meaning: vec![HeaderEntry::new("unit", "m")],
        };
        let raw = Layer {
            name: "Raw".into(),
            look: Look::Counts { bits: 12 },
            channels: vec![channel("Y", Values::U16(vec![0, 1, 256, 4095]))],
            meaning: vec![HeaderEntry::new("unit", "DN")],
        };
        let rgb = ["R", "G", "B"].map(|name| channel(name, Values::F32(vec![0.0, 0.18, 0.5, 1.0])));
        let light =
            Layer { name: String::new(), look: Look::Color, channels: rgb.into(), meaning: vec![] };
        let header = vec![HeaderEntry::new("scene", "größe.json")];
        Picture::new(2, 2, vec![depth, raw, light], header).unwrap()
    }

    fn texts_of(path: &Path) -> Vec<(String, String)> {
        let reader = ::png::Decoder::new(BufReader::new(File::open(path).unwrap()));
        let reader = reader.read_info().unwrap();
        let texts = reader.info().utf8_text.iter();
        texts.map(|text| (text.keyword.clone(), text.get_text().unwrap())).collect()
    }

    fn text(texts: &[(String, String)], key: &str) -> String {
        texts.iter().find(|(name, _)| name == key).map(|(_, text)| text.clone()).unwrap_or_default()
    }

    #[test]
    fn a_sensor_image_comes_back_to_the_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("raw.png");
        write(&Transaction::at_once(), &path, &picture(), "Raw", Bits::Eight).unwrap();
        let read = image::open(&path).unwrap();
        let image::DynamicImage::ImageLuma16(read) = read else { panic!("{:?}", read.color()) };
        assert_eq!(read.dimensions(), (2, 2));
        assert_eq!(read.into_raw(), [0, 1, 256, 4095]);
        let texts = texts_of(&path);
        assert_eq!(text(&texts, "Comment"), "data");
        assert_eq!(text(&texts, "etendue:unit"), "DN");
        assert!(text(&texts, "Reading").contains("0 to 4095"));
    }

    #[test]
    fn a_preview_says_that_it_is_one_and_names_its_range() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.png");
        write(&Transaction::at_once(), &path, &picture(), "Depth", Bits::Eight).unwrap();
        let read = image::open(&path).unwrap();
        let image::DynamicImage::ImageLuma8(read) = read else { panic!("{:?}", read.color()) };
        assert_eq!(read.into_raw(), [255, 106, 32, 0]);
        let texts = texts_of(&path);
        assert!(text(&texts, "Comment").starts_with("preview, not data"), "{texts:?}");
        let reading = text(&texts, "Reading");
        assert!(reading.contains("white is 1 ") && reading.contains("white is 4 "), "{reading}");
        assert_eq!(text(&texts, "etendue:scene"), "größe.json");
        assert_eq!(text(&texts, "Software"), SOFTWARE);
    }

    #[test]
    fn only_light_is_tagged_as_srgb() {
        let folder = tempfile::tempdir().unwrap();
        for (name, tagged) in [("", true), ("Depth", false), ("Raw", false)] {
            let path = folder.path().join("a.png");
            write(&Transaction::at_once(), &path, &picture(), name, Bits::Sixteen).unwrap();
            let reader = ::png::Decoder::new(BufReader::new(File::open(&path).unwrap()));
            assert_eq!(reader.read_info().unwrap().info().srgb.is_some(), tagged, "{name}");
        }
    }

    #[test]
    fn sixteen_bit_colour_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rgb.png");
        write(&Transaction::at_once(), &path, &picture(), "", Bits::Sixteen).unwrap();
        let read = image::open(&path).unwrap();
        let image::DynamicImage::ImageRgb16(read) = read else { panic!("{:?}", read.color()) };
        // IEC 61966-2-1: 0.18 → 0.461356, 0.5 → 0.735357 of 65535.
        let expected = [0, 30235, 48192, 65535];
        assert_eq!(read.into_raw(), expected.map(|value| [value; 3]).as_flattened());
    }

    #[test]
    fn an_unknown_layer_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = write(
            &Transaction::at_once(),
            &folder.path().join("a.png"),
            &picture(),
            "Id",
            Bits::Eight,
        );
        let error = error.unwrap_err().to_string();
        assert!(error.starts_with("the picture has no layer \"Id\"; it has "), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
