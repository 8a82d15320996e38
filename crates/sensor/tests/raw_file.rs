//! A DNG carries what a raw converter needs to know.

use std::collections::BTreeMap;
use std::io::Cursor;

use etendue_sensor::dng::DngError;
use etendue_sensor::{Film, RawImage, Sensor, SensorSpec, Shot};
use serde_json::{Value, json};

fn taken(spec: Value) -> (Sensor, RawImage) {
    let spec: SensorSpec = serde_json::from_value(spec).unwrap();
    let sensor = Sensor::new(&spec).unwrap();
    let [width, height] = sensor.resolution();
    let count = width as usize * height as usize * sensor.lanes().count();
    let film: Vec<f32> = (0..count).map(|i| (i % 50) as f32 / 50.0).collect();
    let image =
        sensor.expose(Film { values: &film }, Shot { exposure: 0.01, frame: 0 }, 0).unwrap();
    (sensor, image)
}

fn written(sensor: &Sensor, image: &RawImage) -> Result<Vec<u8>, DngError> {
    let mut bytes = Cursor::new(Vec::new());
    sensor.write_dng(image, "imx183", &mut bytes)?;
    Ok(bytes.into_inner())
}

/// The values of a TIFF's first directory, by tag: bytes of its `count` values.
fn directory(file: &[u8]) -> BTreeMap<u16, Vec<u8>> {
    assert_eq!(&file[..4], b"II*\0", "a little-endian TIFF");
    let short = |at: usize| u16::from_le_bytes([file[at], file[at + 1]]);
    let long = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let start = long(4);
    let entry = |i: u16| {
        let at = start + 2 + 12 * usize::from(i);
        // Sizes of TIFF 6.0's types, page 15.
        let size = [0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8][usize::from(short(at + 2))];
        let bytes = size * long(at + 4);
        let from = if bytes <= 4 { at + 8 } else { long(at + 8) };
        (short(at), file[from..from + bytes].to_vec())
    };
    (0..short(start)).map(entry).collect()
}

fn longs(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect()
}

fn shorts(bytes: &[u8]) -> Vec<u16> {
    bytes.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect()
}

#[test]
fn numbers_pattern_and_levels_come_back() {
    let spec = json!({
        "type": "raw", "model": "imx183", "resolution": [60, 40], "cfa": "gbrg", "black_level": 38.25,
    });
    let (sensor, image) = taken(spec);
    let file = written(&sensor, &image).unwrap();
    let tags = directory(&file);
    assert_eq!(longs(&tags[&256]), [60]);
    assert_eq!(longs(&tags[&257]), [40]);
    assert_eq!(shorts(&tags[&262]), [32_803], "photometric interpretation: colour filter array");
    assert_eq!(shorts(&tags[&33_421]), [2, 2], "period");
    assert_eq!(tags[&33_422], [1, 2, 0, 1], "green blue, red green");
    assert_eq!(tags[&50_706], [1, 4, 0, 0], "version");
    assert_eq!(longs(&tags[&50_714]), [382_500, 10_000], "black");
    assert_eq!(shorts(&tags[&50_717]), [4095], "white");
    assert_eq!(&tags[&50_708], b"imx183\0");
    let offset = longs(&tags[&273])[0] as usize;
    assert_eq!(longs(&tags[&279]), [4800]);
    assert_eq!(shorts(&file[offset..offset + 4800]), image.values);
    // ColorMatrix1 takes D65 white to the neutral of the camera.
    let signed = |bytes: &[u8]| -> Vec<f64> {
        longs(bytes)
            .as_chunks()
            .0
            .iter()
            .map(|[n, d]| f64::from(n.cast_signed()) / f64::from(*d))
            .collect()
    };
    let (matrix, neutral) = (signed(&tags[&50_721]), signed(&tags[&50_728]));
    let white = [0.3127 / 0.3290, 1.0, 0.3583 / 0.3290];
    for (row, neutral) in matrix.as_chunks::<3>().0.iter().zip(neutral) {
        let seen: f64 = row.iter().zip(white).map(|(entry, xyz)| entry * xyz).sum();
        // Entries have four decimals.
        assert!((seen - neutral).abs() < 3e-4, "{seen} {neutral}");
    }
}

#[test]
fn monochrome_sensors_write_linear_raw() {
    let (sensor, image) = taken(json!({ "type": "raw", "resolution": [8, 8] }));
    let tags = directory(&written(&sensor, &image).unwrap());
    assert_eq!(shorts(&tags[&262]), [34_892]);
    assert!(!tags.contains_key(&33_422));
}

#[test]
fn what_is_no_raw_is_refused() {
    let (sensor, image) = taken(json!({ "type": "rgb", "resolution": [4, 4] }));
    assert!(written(&sensor, &image).unwrap_err().to_string().contains("3 channels"));
    let (sensor, image) = taken(json!({ "type": "raw", "cfa": "rgbw", "resolution": [4, 4] }));
    assert!(written(&sensor, &image).unwrap_err().to_string().contains("no filter `w`"));
}
