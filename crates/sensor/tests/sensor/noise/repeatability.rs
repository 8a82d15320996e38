//! The same bits whatever the threads, and a crop is a crop.

use etendue_sensor::{Exposure, Film, Sensor, SensorSpec};
use serde_json::json;

fn busy(keys: serde_json::Value) -> Sensor {
    let mut spec = json!({
        "model": "imx250", "resolution": [331, 97], "prnu": 0.01, "dsnu": 2.0, "row_noise": 0.5,
        "column_noise": 0.5, "hot_pixels": { "share": 0.01, "dark_current": 1e4 }, "serial": 4,
    });
    for (key, value) in keys.as_object().unwrap() {
        spec[key] = value.clone();
    }
    let spec: SensorSpec = serde_json::from_value(spec).unwrap();
    Sensor::new(&spec).unwrap()
}

/// Light from none to beyond saturation.
fn ramp(sensor: &Sensor) -> Vec<f32> {
    let [width, height] = sensor.resolution().map(|side| side as usize);
    let bands = sensor.bands().count();
    (0..width * height * bands).map(|i| 1.2 * ((i * 7919) % 10_007) as f32 / 10_007.0).collect()
}

#[test]
fn threads_do_not_matter() {
    for keys in [
        json!({ "type": "raw" }),
        json!({ "type": "raw", "cfa": "rggb", "quantum_efficiency": 0.6, "noise": "normal" }),
        json!({ "type": "rgb" }),
        json!({ "type": "multispectral", "bands": { "from": 400, "to": 700, "count": 7 } }),
    ] {
        let sensor = busy(keys.clone());
        let film = ramp(&sensor);
        let shot = Exposure { exposure: 0.02, frame: 6 };
        let images = [1, 2, 7].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sensor.expose(Film { values: &film }, shot, 99).unwrap())
        });
        assert_eq!(images[0], images[1], "{keys}");
        assert_eq!(images[0], images[2], "{keys}");
    }
}

#[test]
fn a_crop_from_the_corner_has_the_pixels_of_the_whole() {
    let keys = json!({ "type": "raw", "quantum_efficiency": 0.6 });
    let whole = busy(keys);
    let crop = whole.clone().with_resolution([130, 40]);
    let film = ramp(&whole);
    let part: Vec<f32> = film.chunks(331).take(40).flat_map(|row| &row[..130]).copied().collect();
    let shot = Exposure { exposure: 0.02, frame: 0 };
    let image = whole.expose(Film { values: &film }, shot, 1).unwrap();
    let cropped = crop.expose(Film { values: &part }, shot, 1).unwrap();
    for (whole, part) in image.values.chunks(331).zip(cropped.values.chunks(130)) {
        assert_eq!(&whole[..130], part);
    }
}

#[test]
fn channels_have_their_own_noise() {
    let sensor = busy(json!({ "type": "rgb", "quantum_efficiency": 1, "prnu": 0, "dsnu": 0 }));
    let film = vec![0.5; 331 * 97 * 3];
    let shot = Exposure { exposure: 0.02, frame: 0 };
    let image = sensor.expose(Film { values: &film }, shot, 1).unwrap();
    let equal = image.values.chunks(3).filter(|rgb| rgb[0] == rgb[1] || rgb[1] == rgb[2]).count();
    // Noise of ±25 DN: two of three numbers agree in a few pixels of a hundred.
    assert!(equal < 331 * 97 / 10, "{equal} of {}", 331 * 97);
}

/// FNV-1a of the numbers, low byte first.
fn fingerprint(values: &[u16]) -> u64 {
    values.iter().flat_map(|y| y.to_le_bytes()).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn any_machine_gives_the_same_bits() {
    // Vector units of any width, and none, have to agree with what was once drawn.
    for (keys, expected) in [
        (json!({ "type": "raw", "quantum_efficiency": 0.6 }), 0x1308_3bb1_fcf1_b621),
        (
            json!({ "type": "raw", "quantum_efficiency": 0.6, "noise": "normal" }),
            0xa1ba_0e7a_52a1_7432,
        ),
    ] {
        let sensor = busy(keys);
        let film = ramp(&sensor);
        let shot = Exposure { exposure: 0.02, frame: 3 };
        let image = sensor.expose(Film { values: &film }, shot, 2026).unwrap();
        assert_eq!(fingerprint(&image.values), expected, "{:#x}", fingerprint(&image.values));
    }
}
