//! ENVI cubes: the bands of a layer as plain numbers, and a text of keys that says what they are.
//!
//! 32-bit floats, the least significant byte first, band by band (`bsq`), row 0 at the top. Wavelengths are
//! the middles of the bands, `fwhm` their widths.
//!
//! Source of the format: NV5 Geospatial, *ENVI Header Files*.

use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::layer::LE_BAND;
use super::{HeaderEntry, Layer, OutputError, Picture};
use etendue_files::{SOFTWARE, Transaction};

/// Writes the keys of the layer called `name` to `path`.
///
/// # Errors
///
/// When there is no such layer, it has no bands, or the file cannot be written.
pub fn write_header(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    name: &str,
) -> Result<(), OutputError> {
    let layer = picture.require(name)?;
    let edges = edges(layer)
        .ok_or_else(|| OutputError::format(path, "its layer does not say where its bands are"))?;
    let text = header(picture, layer, &edges);
    Ok(files.write(path, |part| part.write_all(text.as_bytes()))?)
}

/// Writes the numbers of the layer called `name` to `path`.
///
/// # Errors
///
/// When there is no such layer, or the file cannot be written.
pub fn write_numbers(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    name: &str,
) -> Result<(), OutputError> {
    let layer = picture.require(name)?;
    let pixels = picture.width() * picture.height();
    Ok(files.write(path, |part| {
        let mut file = BufWriter::with_capacity(1 << 20, part);
        let mut bytes = Vec::new();
        for channel in &layer.channels {
            let size = channel.values.value_bytes();
            for start in (0..pixels).step_by(LE_BAND) {
                let end = pixels.min(start + LE_BAND);
                bytes.resize((end - start) * size, 0);
                channel.values.put_le(start..end, &mut bytes, size);
                file.write_all(&bytes)?;
            }
        }
        file.flush()
    })?)
}

/// The edges of a layer's bands (nm), where it has as many bands.
fn edges(layer: &Layer) -> Option<Vec<f64>> {
    let entry = layer.meaning.iter().find(|entry| entry.key == "band edges nm")?;
    let edges: Vec<f64> = serde_json::from_str(&entry.text).ok()?;
    (edges.len() == layer.channels.len() + 1).then_some(edges)
}

fn header(picture: &Picture, layer: &Layer, edges: &[f64]) -> String {
    let entry = |key: &str| {
        let found = layer.meaning.iter().find(|entry| entry.key == key);
        found.map_or("", |entry| entry.text.as_str())
    };
    let middles: Vec<f64> = edges.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let widths: Vec<f64> = edges.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let list = |numbers: &[f64]| {
        let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
        words.join(", ")
    };
    // Viewers show these as red, green and blue.
    let nearest = |nm: f64| {
        let off = |i: &usize| (middles[*i] - nm).abs();
        1 + (0..middles.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
    };
    let [r, g, b] = [620.0, 545.0, 460.0].map(nearest);
    let code = match layer.type_name() {
        "f8" => 5,
        "u2" => 12,
        "u4" => 13,
        _ => 4,
    };
    let unit = entry("unit");
    let mut text = String::from("ENVI\n");
    let _ = writeln!(text, "description = {{{SOFTWARE}: {}}}", entry("definition"));
    let _ = writeln!(text, "samples = {}", picture.width());
    let _ = writeln!(text, "lines = {}", picture.height());
    let _ = writeln!(text, "bands = {}", layer.channels.len());
    let _ = writeln!(text, "header offset = 0\nfile type = ENVI Standard\ndata type = {code}");
    let _ = writeln!(text, "interleave = bsq\nbyte order = 0");
    let _ = writeln!(text, "default bands = {{{r}, {g}, {b}}}");
    let _ = writeln!(text, "wavelength units = Nanometers");
    let _ = writeln!(text, "wavelength = {{{}}}", list(&middles));
    let _ = writeln!(text, "fwhm = {{{}}}", list(&widths));
    let _ = writeln!(text, "data units = {unit}");
    let _ = writeln!(text, "z plot titles = {{Wavelength (nm), Light ({unit})}}");
    // What else this program reads back; `camera` has braces of its own.
    for HeaderEntry { key, text: value } in picture.header() {
        if !value.contains(['{', '}', '\n']) {
            let _ = writeln!(text, "etendue {key} = {value}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;

    use etendue_image::{Limits, envi};

    use super::super::{Channel, Look, Values};
    use super::*;

    #[test]
    fn the_reader_gives_every_bit_and_band_back() {
        let planes =
            [[1.5_f32, -0.0, f32::INFINITY, 0.1, 5e-42, 7.0], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]];
        let channels = planes.iter().zip(["405nm", "430nm"]).map(|(plane, name)| Channel {
            name: name.into(),
            values: Values::F32(plane.to_vec()),
        });
        let meaning = [
            ("definition", "light"),
            ("unit", "W.m^-2.nm^-1"),
            ("band edges nm", "[400.0,410.0,450.0]"),
        ];
        let layer = Layer {
            name: "Spectrum".into(),
            look: Look::Cube,
            channels: channels.collect(),
            meaning: meaning.map(|(key, text)| HeaderEntry::new(key, text)).into(),
        };
        let header = vec![HeaderEntry::new("noise_seed", "18446744073709551615")];
        let picture = Picture::new(3, 2, vec![layer], header).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let [keys, numbers] = ["a.hdr", "a.img"].map(|name| folder.path().join(name));
        let to = Transaction::at_once();
        write_header(&to, &keys, &picture, "Spectrum").unwrap();
        write_numbers(&to, &numbers, &picture, "Spectrum").unwrap();
        let read = envi::Header::parse(&fs::read(keys).unwrap()).unwrap();
        let cube = read.decode(&fs::read(numbers).unwrap(), Limits::default()).unwrap();
        assert_eq!((cube.size, cube.axis.edges()), ([3, 2], &[400.0, 410.0, 450.0][..]));
        assert_eq!(cube.axis.wavelengths(), [405.0, 430.0]);
        for (i, pixel) in cube.values.chunks(2).enumerate() {
            let expected = planes.map(|plane| plane[i].to_bits());
            assert_eq!([pixel[0].to_bits(), pixel[1].to_bits()], expected);
        }
        assert_eq!(cube.unit.as_deref(), Some("W.m^-2.nm^-1"));
        assert_eq!(cube.texts["etendue noise_seed"], "18446744073709551615");
    }
}
