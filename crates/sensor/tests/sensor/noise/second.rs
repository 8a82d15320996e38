//! Sensors of two numbers a pixel: dual gain and split pixels, and what is merged of them.

use etendue_sensor::{Exposure, Film, Sensor, SensorSpec};
use serde_json::{Value, json};

use super::moments;

const SIDE: u32 = 256;
const PIXELS: f64 = 65_536.0;

fn sensor(second: Value) -> Sensor {
    let spec: SensorSpec = serde_json::from_value(json!({
        "type": "raw", "resolution": [SIDE, SIDE], "noise": "poisson", "radiometry": "physical",
        "quantum_efficiency": [[549, 1], [551, 1]], "bands": [549, 551],
        "system_gain": 2.0, "read_noise": 1.5, "full_well": 1_500.0, "bit_depth": 12, "black_level": 64,
        "dark_current": 3.0, "exposure": 0.01, "hdr": true, "second_readout": second,
    }))
    .unwrap();
    Sensor::new(&spec).unwrap()
}

fn dual_gain() -> Sensor {
    sensor(
        json!({ "type": "dual_gain", "system_gain": 0.2, "read_noise": 6.0, "full_well": 15_000.0 }),
    )
}

fn split_pixel() -> Sensor {
    sensor(
        json!({ "type": "split_pixel", "ratio": 0.02, "system_gain": 0.25, "read_noise": 4.0, "full_well": 12_000.0 }),
    )
}

/// A film of which so many electrons a second are freed in each pixel, and how many they are after rounding.
fn film(sensor: &Sensor, rate: f64) -> (Vec<f32>, f64) {
    let unit = sensor.electrons_per_unit(0)[0];
    let light = (rate / unit) as f32;
    (vec![light; (SIDE * SIDE) as usize], f64::from(light) * unit)
}

const SHOT: Exposure = Exposure { exposure: 0.01, frame: 0 };

/// Both read-outs of a dual gain have the same electrons, each with its own noise and gain: what is left of their
/// difference is the noise of the two read-outs. Two photodiodes have no noise in common.
#[test]
fn two_gains_read_the_same_electrons_and_two_photodiodes_do_not() {
    for (sensor, ratio, shares) in [(dual_gain(), 1.0, true), (split_pixel(), 0.02, false)] {
        let second = sensor.second().unwrap();
        let (film, rate) = film(&sensor, 1e5);
        let film = Film { values: &film };
        let electrons = |sensor: &Sensor| -> Vec<f64> {
            let image = sensor.expose(film, SHOT, 3).unwrap();
            let black = sensor.black_level();
            image.values.iter().map(|&y| (f64::from(y) - black) / sensor.system_gain()).collect()
        };
        let (first, other) = (electrons(&sensor), electrons(&second));
        let [mean, _] = moments(other.iter().copied());
        let dark = second.dark_current() * 0.01;
        let expected = ratio * rate * 0.01 + dark;
        let spread = (expected + second.read_noise().powi(2)).sqrt();
        assert!((mean - expected).abs() < 4.0 * spread / 256.0 + 0.02, "{mean} for {expected}");
        let rounding = |sensor: &Sensor| 1.0 / 12.0 / sensor.system_gain().powi(2);
        let of_read = [&sensor, &second].map(|s| s.read_noise().powi(2) + rounding(s));
        let [_, variance] = moments(first.iter().zip(&other).map(|(a, b)| a - b));
        let shot = if shares { 0.0 } else { rate * 0.01 * (1.0 + ratio) + 0.03 * (1.0 + ratio) };
        let expected = of_read[0] + of_read[1] + shot;
        // A variance of 65 536 pixels is known to √(2/n), times five.
        assert!(
            (variance / expected - 1.0).abs() < 5.0 * (2.0 / PIXELS).sqrt(),
            "{variance} for {expected}"
        );
    }
}

/// Over 60 dB and more of light the merged picture has the signal to noise ratio of the closed form within 0.1 dB: of two
/// gains √(r²/v), v = (μ + 1/Σ(1/σ²))/T², of two photodiodes √Σ r²/v.
#[test]
fn what_is_merged_has_the_ratio_of_the_closed_form() {
    for (sensor, is_dual) in [(dual_gain(), true), (split_pixel(), false)] {
        let second = sensor.second().unwrap();
        let shots: Vec<Exposure> = sensor.shots().collect();
        let most = second.saturation() / (0.01 * if is_dual { 1.0 } else { 0.02 });
        let mut range = 0.0;
        for k in 0..10 {
            let (film, rate) = film(&sensor, 0.5 * most / 10.0_f64.powf(0.4 * f64::from(k)));
            // Near saturation of the first it counts by chance.
            let share = rate * 0.01 / sensor.saturation();
            if (0.85..1.15).contains(&share) {
                continue;
            }
            range = 8.0 * f64::from(k);
            let expose = |sensor: &Sensor, shot| sensor.expose(Film { values: &film }, shot, 5);
            let image = sensor.merged(&shots, expose).unwrap();
            assert_eq!(image.saturated, 0);
            let readouts =
                [(&sensor, 1.0, share < 1.0), (&second, if is_dual { 1.0 } else { 0.02 }, true)];
            let counting = readouts.iter().filter(|(.., counts)| *counts);
            let of_read =
                |s: &Sensor| s.read_noise().powi(2) + 1.0 / 12.0 / s.system_gain().powi(2);
            let variance = match is_dual {
                true => {
                    let read: f64 = counting.map(|(s, ..)| 1.0 / of_read(s)).sum();
                    (rate * 0.01 + 0.03 + 1.0 / read) / 1e-4
                }
                false => {
                    let of = |s: &Sensor, q: f64| {
                        (q * rate * 0.01 + s.dark_current() * 0.01 + of_read(s))
                            / (q * 0.01).powi(2)
                    };
                    1.0 / counting.map(|(s, q, _)| 1.0 / of(s, *q)).sum::<f64>()
                }
            };
            let [mean, spread] = moments(image.rate.iter().map(|&r| f64::from(r)));
            assert!(
                (mean - rate).abs() < 4.0 * variance.sqrt() / 256.0 + 1e-4 * rate,
                "{rate}: {mean}"
            );
            let off = 10.0 * (spread / variance).log10();
            assert!(off.abs() < 0.1, "{is_dual} {rate}: {off} dB");
        }
        assert!(range >= 60.0, "{range} dB");
    }
}

/// A sensor that is not linear near saturation is made linear by the inverse of its curve before it is merged.
#[test]
fn what_bends_is_straightened_before_it_is_merged() {
    let spec: SensorSpec = serde_json::from_value(json!({
        "type": "raw", "resolution": [SIDE, SIDE], "noise": "poisson", "radiometry": "physical",
        "quantum_efficiency": [[549, 1], [551, 1]], "bands": [549, 551],
        "system_gain": 0.25, "read_noise": 3.0, "full_well": 12_000.0, "bit_depth": 12, "black_level": 64,
        "nonlinearity": [[0.6, 0.6], [1.0, 0.85]], "exposures": [0.001, 0.01], "hdr": true,
    }))
    .unwrap();
    let sensor = Sensor::new(&spec).unwrap();
    let shots: Vec<Exposure> = sensor.shots().collect();
    for share in [0.3, 0.5, 0.62, 0.66, 0.7] {
        let (film, rate) = film(&sensor, share * 12_000.0 / 0.01);
        let expose = |sensor: &Sensor, shot| sensor.expose(Film { values: &film }, shot, 5);
        let image = sensor.merged(&shots, expose).unwrap();
        let [mean, spread] = moments(image.rate.iter().map(|&r| f64::from(r)));
        assert!((mean - rate).abs() < 5.0 * spread.sqrt() / 256.0, "{share}: {mean} for {rate}");
    }
}

/// The metered exposure brings the percentile that is named to the share of saturation that is named, dark signal
/// included.
#[test]
fn the_metered_exposure_reaches_its_target() {
    for (percentile, target) in [(50.0, 0.3), (99.0, 0.8), (100.0, 1.0)] {
        let spec: SensorSpec = serde_json::from_value(json!({
            "type": "raw", "resolution": [100, 100], "noise": "none", "radiometry": "physical",
            "system_gain": 0.25, "full_well": 15_000.0, "bit_depth": 14, "dark_current": 40.0,
            "auto_exposure": { "percentile": percentile, "target": target },
        }))
        .unwrap();
        let sensor = Sensor::new(&spec).unwrap();
        // A ramp: pixel k has (k + 1)/10000 of the brightest.
        let values: Vec<f32> = (1..=10_000).map(|k| k as f32 * 1e-7).collect();
        let film = Film { values: &values };
        let time = sensor.metered(film).unwrap();
        let sensor = sensor.at_exposure(time);
        let image = sensor.expose(film, sensor.shots().next().unwrap(), 0).unwrap();
        let mut levels = image.values.clone();
        levels.sort_unstable();
        let place = (percentile * 100.0) as usize - 1;
        let reached = f64::from(levels[place]) / (0.25 * 15_000.0);
        // A step of the ramp and one of the converter.
        assert!((reached / target - 1.0).abs() < 5e-4, "{percentile}: {reached} for {target}");
        assert_eq!(sensor.metered(Film { values: &vec![0.0; 10_000] }), None);
    }
}
