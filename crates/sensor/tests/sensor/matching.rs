//! Photographs matched: hidden parameters are found again, with the deviations that are stated.

#![expect(clippy::cast_possible_truncation, reason = "films hold f32, numbers 16 bits")]

use etendue_sensor::matching::{MatchError, Matched, Photograph};
use etendue_sensor::{Exposure, Film, Sensor, SensorSpec};
use serde_json::{Value, json};

const COLUMNS: usize = 192;
const ROWS: usize = 128;

/// A sensor before a step chart of 24 patches.
fn sensor(keys: &Value) -> Sensor {
    let mut spec = json!({
        "type": "raw", "resolution": [COLUMNS, ROWS], "radiometry": "physical", "bit_depth": 12,
        "quantum_efficiency": [[549, 1], [551, 1]], "bands": [549, 551], "noise": "poisson",
        "system_gain": 0.3, "read_noise": 3.0, "black_level": 60, "dark_current": 2.0, "dsnu": 0.8, "prnu": 0.004,
        "exposure": 0.01,
    });
    for (key, value) in keys.as_object().unwrap() {
        spec[key] = value.clone();
    }
    Sensor::new(&serde_json::from_value::<SensorSpec>(spec).unwrap()).unwrap()
}

/// Patches of levels from a hundredth to the brightest, which makes 8000 electrons in 10 ms.
fn chart(sensor: &Sensor) -> Vec<f32> {
    let unit = sensor.electrons_per_unit(0)[0];
    let level = |at: usize| {
        let patch = at / COLUMNS / 32 * 6 + at % COLUMNS / 32;
        8000.0 / 0.01 / unit * 10.0_f64.powf(-2.0 * patch as f64 / 23.0)
    };
    (0..COLUMNS * ROWS).map(|at| level(at) as f32).collect()
}

struct Hidden {
    gain: f64,
    read_noise: f64,
    black: f64,
    exposure: f64,
}

fn hidden(k: usize) -> Hidden {
    let spread = |a: f64, b: f64, step: usize| a + (b - a) * ((k * step + 3) % 10) as f64 / 9.0;
    Hidden {
        gain: spread(0.1, 0.42, 3),
        read_noise: spread(1.5, 12.0, 7),
        black: spread(40.0, 200.0, 1),
        exposure: spread(0.004, 0.01, 9),
    }
}

/// Chart as a sensor of hidden numbers takes it, matched by one that knows them not.
fn matched(of: &Hidden, seed: u64) -> Matched {
    matched_with(of, seed, &json!({}))
}

/// Chart matched as by [`matched`], of a chip with more keys.
fn matched_with(of: &Hidden, seed: u64, more: &Value) -> Matched {
    let own = sensor(&json!({}));
    let film = chart(&own);
    let mut keys = json!({
        "system_gain": of.gain, "read_noise": of.read_noise, "black_level": of.black, "serial": seed,
    });
    for (key, value) in more.as_object().unwrap() {
        keys[key] = value.clone();
    }
    let taken_by = sensor(&keys);
    let film = Film { values: &film };
    let shot = Exposure { exposure: of.exposure, frame: 0 };
    let image = taken_by.expose(film, shot, seed).unwrap();
    let photo = Photograph { size: [COLUMNS, ROWS], numbers: &image.values, white: None };
    own.matched(film, 0.01, photo).unwrap()
}

fn parameters(found: &Matched) -> [[f64; 2]; 4] {
    [found.system_gain, found.read_noise, found.black_level, found.exposure]
        .map(|e| [e.value, e.sigma])
}

/// Two standard deviations cover each of four hidden parameters in nine of ten photographs at least, and they are not
/// wide: gain and exposure are known to 2 %.
#[test]
fn hidden_parameters_are_covered() {
    let mut covered = [0; 4];
    for k in 0..10 {
        let of = hidden(k);
        let found = matched(&of, k as u64);
        assert!((found.structure - 1.0).abs() < 0.15, "{k}: {}", found.structure);
        let truth = [of.gain, of.read_noise, of.black, of.exposure];
        for (covered, (truth, [value, sigma])) in
            covered.iter_mut().zip(truth.iter().zip(parameters(&found)))
        {
            *covered += u32::from((value - truth).abs() <= 2.0 * sigma);
        }
        assert!(found.system_gain.sigma < 0.02 * of.gain, "{k}: {:?}", found.system_gain);
        assert!(found.exposure.sigma < 0.02 * of.exposure, "{k}: {:?}", found.exposure);
    }
    assert!(
        covered.iter().all(|&count| count >= 9),
        "gain, noise, black, exposure: {covered:?} of 10"
    );
}

/// The stated standard deviations are those of fifty photographs within a factor of 1.5 (the spread of fifty is itself
/// known to a tenth). Dead and stuck pixels are left out: what is found is as near as without them.
#[test]
fn defective_pixels_do_not_count() {
    let of = hidden(4);
    let clean = parameters(&matched(&of, 7));
    for defects in [json!({ "dead_pixels": 0.002 }), json!({ "stuck_pixels": 0.002 })] {
        let found = parameters(&matched_with(&of, 7, &defects));
        for ([value, sigma], [without, _]) in found.into_iter().zip(clean) {
            assert!((value - without).abs() < sigma, "{defects}: {value} {without} {sigma}");
        }
    }
}

#[test]
fn stated_deviations_are_those_of_many_photographs() {
    let of = hidden(4);
    let found: Vec<[[f64; 2]; 4]> =
        (0..50).map(|seed| parameters(&matched(&of, 100 + seed))).collect();
    for k in 0..4 {
        let mean = found.iter().map(|f| f[k][0]).sum::<f64>() / 50.0;
        let spread = (found.iter().map(|f| (f[k][0] - mean).powi(2)).sum::<f64>() / 49.0).sqrt();
        let stated = found.iter().map(|f| f[k][1]).sum::<f64>() / 50.0;
        let ratio = stated / spread;
        assert!((1.0 / 1.5..1.5).contains(&ratio), "{k}: stated {stated}, spread {spread}");
    }
}

/// The light of each colour is found apart.
#[test]
fn colours_are_told_apart() {
    let keys = json!({
        "cfa": "rggb", "radiometry": "digital", "bit_depth": 14, "prnu": 0, "dsnu": 0, "dark_current": 0,
        "quantum_efficiency": 1, "bands": null,
    });
    let own = sensor(&keys);
    let [r, g, b] = [0.8, 1.0, 0.6];
    let film = |color: [f64; 3]| -> Vec<f32> {
        let level = |at: usize| 0.6 * 10.0_f64.powf(-1.5 * (at % COLUMNS) as f64 / COLUMNS as f64);
        (0..COLUMNS * ROWS).flat_map(|at| color.map(|part| (part * level(at)) as f32)).collect()
    };
    let image = own
        .expose(Film { values: &film([r, g, b]) }, Exposure { exposure: 0.01, frame: 0 }, 1)
        .unwrap();
    let photo = Photograph { size: [COLUMNS, ROWS], numbers: &image.values, white: None };
    let found = own.matched(Film { values: &film([1.0; 3]) }, 0.01, photo).unwrap();
    for (level, truth) in found.levels.iter().zip([r, g, b]) {
        let off = (level.level.value - truth).abs();
        assert!(off < 4.0 * level.level.sigma && level.level.sigma < 0.02, "{level:?} {truth}");
    }
}

/// Each kind of photograph that cannot be matched is refused by its own name, with what to do.
#[test]
fn what_cannot_be_matched_is_refused() {
    let own = sensor(&json!({}));
    let film = chart(&own);
    let film = Film { values: &film };
    let image = own.expose(film, Exposure { exposure: 0.01, frame: 0 }, 1).unwrap();
    let refused = |size: [usize; 2], numbers: &[u16]| -> MatchError {
        own.matched(film, 0.01, Photograph { size, numbers, white: None }).unwrap_err()
    };
    let why = refused([ROWS, COLUMNS], &image.values).to_string();
    assert!(why.contains("128 x 192 pixels") && why.contains("camera.sensor.resolution"), "{why}");
    let gamma: Vec<u16> = image
        .values
        .iter()
        .map(|&y| {
            (4095.0 * ((f64::from(y) - 60.0).max(0.0) / 4035.0).powf(1.0 / 2.2) * 0.9 + 60.0) as u16
        })
        .collect();
    let why = refused([COLUMNS, ROWS], &gamma).to_string();
    assert!(why.contains("gamma-encoded") && why.contains("raw numbers"), "{why}");
    let clipped: Vec<u16> = image.values.iter().map(|&y| (y * 3).min(4095)).collect();
    let why = refused([COLUMNS, ROWS], &clipped).to_string();
    assert!(why.contains("clipped") && why.contains("shorter exposure"), "{why}");
    let black: Vec<u16> = image.values.iter().map(|&y| y.saturating_sub(90)).collect();
    let why = refused([COLUMNS, ROWS], &black).to_string();
    assert!(why.contains("clipped") && why.contains("black level"), "{why}");
    let dark = vec![0.0; COLUMNS * ROWS];
    let photo = Photograph { size: [COLUMNS, ROWS], numbers: &image.values, white: None };
    let why = own.matched(Film { values: &dark }, 0.01, photo).unwrap_err().to_string();
    assert!(why.contains("too few levels of light") && why.contains("step chart"), "{why}");
}
