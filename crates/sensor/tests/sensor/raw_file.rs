//! A DNG carries what a raw converter needs to know.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::process::Command;

use etendue_sensor::dng::{DngDetails, DngError, GainMap};
use etendue_sensor::{ChannelSet, Channels, Exposure, Film, RawImage, Sensor, SensorSpec};
use serde_json::{Value, json};

use crate::environment;

fn taken(spec: Value) -> (Sensor, RawImage) {
    let spec: SensorSpec = serde_json::from_value(spec).unwrap();
    let sensor = Sensor::new(&spec).unwrap();
    let [width, height] = sensor.resolution();
    let count = width as usize * height as usize * sensor.bands().count();
    let film: Vec<f32> = (0..count).map(|i| (i % 50) as f32 / 50.0).collect();
    let image =
        sensor.expose(Film { values: &film }, Exposure { exposure: 0.01, frame: 0 }, 0).unwrap();
    (sensor, image)
}

fn written(sensor: &Sensor, image: &RawImage) -> Result<Vec<u8>, DngError> {
    let mut bytes = Cursor::new(Vec::new());
    let white = sensor.white_response();
    let details = DngDetails {
        model: "imx183",
        white: &white,
        exposure: 0.01,
        f_number: Some(2.8),
        shading: None,
    };
    sensor.write_dng(image, details, &mut bytes)?;
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

/// The well of an IMX250 is full before its converter ends: what a raw converter must take for white.
#[test]
fn white_is_where_the_first_of_well_and_converter_ends() {
    for (model, white) in [("imx250", 3779), ("imx183", 4095)] {
        let spec = json!({"type": "raw", "model": model, "resolution": [8, 6]});
        let (sensor, image) = taken(spec);
        let tags = directory(&written(&sensor, &image).unwrap());
        assert_eq!(shorts(&tags[&50_717]), [white], "{model}");
    }
}

/// F-number, forward matrix and gain map are there as the specification has them: white balanced for D65 becomes D50's
/// XYZ, and the map evens a white image that falls off by a known law.
#[test]
fn lens_and_shading_are_told() {
    let spec = json!({ "type": "raw", "model": "imx183", "resolution": [64, 48], "cfa": "rggb" });
    let (sensor, image) = taken(spec);
    let falloff = |x: f64, y: f64| {
        let [x, y] = [(x - 32.0) / 40.0, (y - 24.0) / 40.0];
        1.0 / (1.0 + x * x + y * y).powi(2)
    };
    let white: Vec<f64> = (0..64 * 48)
        .map(|at| 900.0 * falloff((at % 64) as f64 + 0.5, (at / 64) as f64 + 0.5))
        .collect();
    let map = GainMap::of_white(&white, 64, [9, 7]);
    let white = sensor.white_response();
    let mut bytes = Cursor::new(Vec::new());
    let details = DngDetails {
        model: "imx183",
        white: &white,
        exposure: 0.01,
        f_number: Some(2.8),
        shading: Some(&map),
    };
    sensor.write_dng(&image, details, &mut bytes).unwrap();
    let tags = directory(&bytes.into_inner());
    assert_eq!(longs(&tags[&33_437]), [28_000, 10_000]);
    let forward: Vec<f64> =
        longs(&tags[&50_964]).chunks(2).map(|r| f64::from(r[0] as i32) / f64::from(r[1])).collect();
    let balanced = [0, 1, 2].map(|row| forward[3 * row..3 * row + 3].iter().sum::<f64>());
    for (found, d50) in balanced.iter().zip([0.964_22, 1.0, 0.825_21]) {
        // Each of three numbers is rounded to four digits.
        assert!((found - d50).abs() < 5e-4, "{balanced:?}");
    }
    let opcodes = &tags[&51_009];
    let word = |at: usize| u32::from_be_bytes(opcodes[at..at + 4].try_into().unwrap());
    let double = |at: usize| f64::from_be_bytes(opcodes[at..at + 8].try_into().unwrap());
    // One opcode, GainMap of DNG 1.3, over the whole picture, of 7 rows and 9 columns.
    assert_eq!([word(0), word(4), word(8), word(12)], [1, 9, 0x0103_0000, 0]);
    assert_eq!(word(16) as usize, opcodes.len() - 20);
    assert_eq!(
        [20, 24, 28, 32, 36, 40, 44, 48, 52, 56].map(word),
        [0, 0, 48, 64, 0, 1, 1, 1, 7, 9]
    );
    assert_eq!([60, 68, 76, 84].map(double), [1.0 / 6.0, 1.0 / 8.0, 0.0, 0.0]);
    assert_eq!(word(92), 1);
    for row in 0..7_u8 {
        for column in 0..9_u8 {
            let at = 96 + 4 * (9 * usize::from(row) + usize::from(column));
            let gain = f64::from(f32::from_bits(word(at)));
            let known = falloff(64.0 * f64::from(column) / 8.0, 48.0 * f64::from(row) / 6.0);
            // Means about a point are off by the law over a quarter of the way to the next, most in the corners.
            assert!((gain * known - 1.0).abs() < 0.1, "{row} {column}: {gain} {known}");
        }
    }
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

/// The variance that `NoiseProfile` tells of a signal is that of frames at it, as shares of the range from black to
/// white; exposure time and ISO stand beside it.
#[test]
fn the_noise_profile_is_the_noise() {
    let spec = json!({
        "type": "raw", "resolution": [300, 300], "bit_depth": 12, "black_level": 64, "noise": "poisson",
        "iso_settings": [{ "iso": 400, "system_gain": 0.8, "read_noise": 3.0 }], "iso": 400,
    });
    let spec: SensorSpec = serde_json::from_value(spec).unwrap();
    let sensor = Sensor::new(&spec).unwrap();
    let shot = Exposure { exposure: 0.01, frame: 0 };
    let frame = |light: f32| sensor.expose(Film { values: &vec![light; 90_000] }, shot, 1).unwrap();
    let tags = directory(&written(&sensor, &frame(0.5)).unwrap());
    let profile: Vec<f64> =
        tags[&51_041].as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let range = 4095.0 - 64.0;
    for light in [0.0, 0.1, 0.5] {
        let image = frame(light);
        let signal = |&y: &u16| (f64::from(y) - 64.0) / range;
        let mean = image.values.iter().map(signal).sum::<f64>() / 9e4;
        let squares: f64 = image.values.iter().map(|y| (signal(y) - mean).powi(2)).sum();
        let told = profile[0] * f64::from(light) + profile[1];
        // Of 90 000 pixels a variance is known to √(2/n), times five.
        let tolerance = 5.0 * (2.0_f64 / 9e4).sqrt();
        assert!((squares / 9e4 / told - 1.0).abs() < tolerance, "{light}: {told}");
    }
    assert_eq!(longs(&tags[&33_434]), [10_000_000, 1_000_000_000]);
    assert_eq!(shorts(&tags[&34_855])[0], 400);
    let (unknown, image) = taken(json!({ "type": "raw", "resolution": [8, 8] }));
    assert!(!directory(&written(&unknown, &image).unwrap()).contains_key(&51_041));
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

/// Colours as an independent raw converter (`LibRaw`, of Python's `rawpy`) develops them, in the four
/// quarters of a picture: pattern, levels, balance and matrix are right, and up is up.
#[test]
fn a_raw_converter_develops_the_colours() {
    let python = match environment::python_with("rawpy-0.28.0", &["rawpy==0.28.0"]) {
        Ok(python) => python,
        Err(why) => {
            println!("skipped: the raw converter rawpy cannot be had: {why}");
            return;
        }
    };
    // Top left, top right, bottom left, bottom right, in linear sRGB: as saturated as surfaces are, to which the
    // matrix is fitted.
    let colours = [[0.5, 0.2, 0.15], [0.15, 0.4, 0.15], [0.15, 0.15, 0.4], [0.8, 0.8, 0.8]];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("raw.dng");
    let program = "import rawpy, sys, json
raw = rawpy.imread(sys.argv[1])
look = raw.postprocess(use_camera_wb=True, no_auto_bright=True, output_bps=8)
height, width = look.shape[:2]
quarter = lambda i: look[(1 + 2 * (i // 2)) * height // 4 - 4:, (1 + 2 * (i % 2)) * width // 4 - 4:]
print(json.dumps({
    'pattern': ''.join(chr(raw.color_desc[i]) for i in raw.raw_pattern.flatten()),
    'black': raw.black_level_per_channel, 'white': int(raw.white_level),
    'look': [quarter(i)[:8, :8].reshape(-1, 3).mean(0).tolist() for i in range(4)]}))";
    for (cfa, pattern) in [("rggb", "RGGB"), ("gbrg", "GBRG"), ("grbg", "GRBG"), ("bggr", "BGGR")] {
        let spec = json!({
            "type": "raw", "model": "imx183", "resolution": [96, 64], "cfa": cfa,
            "filters": "nikon_d5100",
        });
        let sensor = Sensor::new(&serde_json::from_value(spec).unwrap()).unwrap();
        let rows = sensor.bands().from_rgb();
        let film: Vec<f32> = (0..96 * 64)
            .flat_map(|i| {
                let colour = colours[(i / 96 / 32) * 2 + i % 96 / 48];
                #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
                let band = |row: &[f64; 3]| (0..3).map(|k| row[k] * colour[k]).sum::<f64>() as f32;
                rows.iter().map(band).collect::<Vec<f32>>()
            })
            .collect();
        let shot = Exposure { exposure: 0.01, frame: 0 };
        let image = sensor.expose(Film { values: &film }, shot, 0).unwrap();
        std::fs::write(&path, written(&sensor, &image).unwrap()).unwrap();
        let out = Command::new(&python).args(["-c", program]).arg(&path).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let read: Value = serde_json::from_slice(&out.stdout).unwrap();
        // It counts the second green as a colour of its own.
        assert_eq!(read["pattern"].as_str().unwrap(), pattern);
        assert_eq!(read["white"], 4095);
        assert_eq!(read["black"], json!([38, 38, 38, 38]));
        for (i, colour) in colours.iter().enumerate() {
            for (k, linear) in colour.iter().enumerate() {
                let found = read["look"][i][k].as_f64().unwrap();
                let expected = 255.0 * etendue_spectrum::colour::srgb_encode(*linear);
                // The converter's tone curve is BT.709's, up to 14 of 255 darker than sRGB's; filters
                // of a real camera and a matrix of three by three miss a colour by about as much.
                assert!((found - expected).abs() < 30.0, "{cfa} {i} {k}: {found}, not {expected}");
            }
        }
    }
}

/// A camera that sees as the CIE's observer does: its matrix only scales, and a real one nearly fits.
#[test]
fn the_matrix_fits_the_patches() {
    let observer = Channels::Set(ChannelSet::Cie1931);
    let [x, y, z] = [0, 1, 2].map(|k| observer.curves()[k].curve.clone());
    let of = |filters: Value| {
        let spec =
            json!({ "type": "raw", "cfa": "rggb", "resolution": [4, 4], "filters": filters });
        Sensor::new(&serde_json::from_value(spec).unwrap()).unwrap().fitted_matrix()
    };
    let matrix = of(json!({ "r": x, "g": y, "b": z })).unwrap();
    // D65 has Y = 1 and Z = 1.0888, the most of the three: that is 1 in its channel.
    for (i, row) in matrix.iter().enumerate() {
        for (k, value) in row.iter().enumerate() {
            let expected = if i == k { 1.0 / 1.0888 } else { 0.0 };
            // The published white has four figures; the fit's curves are joined by straight lines.
            assert!((value - expected).abs() < 2e-4, "{matrix:?}");
        }
    }
    assert_eq!(of(json!("ideal")), None);
    let real = of(json!("nikon_d5100")).unwrap();
    // Each channel sees most of its own third of the light.
    assert!((0..3).all(|i| (0..3).all(|k| real[i][i] >= real[i][k])), "{real:?}");
}
