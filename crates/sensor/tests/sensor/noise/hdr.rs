//! Exposures that are merged.

use etendue_sensor::{Exposure, Film, Sensor, SensorSpec};
use serde_json::json;

use super::moments;

const SIDE: u32 = 256;

fn bracket() -> Sensor {
    let spec: SensorSpec = serde_json::from_value(json!({
        "type": "raw", "resolution": [SIDE, SIDE], "noise": "poisson", "radiometry": "physical",
        "quantum_efficiency": [[549, 1], [551, 1]], "bands": [549, 551],
        "system_gain": 0.25, "read_noise": 3.0, "full_well": 15_000.0, "bit_depth": 12, "black_level": 40,
        "dark_current": 0.5, "exposures": [10.0, 1e-4, 1e-3, 1.0, 1e-2, 0.1],
    }))
    .unwrap();
    Sensor::new(&spec).unwrap()
}

/// Light of which so many electrons a second are freed in each pixel, and how many they are after rounding.
fn film(sensor: &Sensor, rate: f64) -> (Vec<f32>, f64) {
    let unit = sensor.electrons_per_unit(0)[0];
    let light = (rate / unit) as f32;
    (vec![light; (SIDE * SIDE) as usize], f64::from(light) * unit)
}

/// Over 120 dB of light the signal to noise ratio is the closed form's, √Σ r²/v over the exposures that are not
/// saturated, within 0.1 dB; the mean is right; and the σ that is told is that of the pixels.
#[test]
fn merged_exposures_have_the_ratio_of_the_closed_form() {
    let sensor = bracket();
    let shots: Vec<Exposure> = sensor.shots().collect();
    let (well, gain) = (15_000.0, 0.25);
    let mut decibels = Vec::new();
    // The brightest is half of what the shortest holds; each is well off a saturation.
    for k in 0..13 {
        let (film, rate) = film(&sensor, 0.5 * well / 1e-4 / 10.0_f64.powf(0.5 * f64::from(k)));
        let expose = |sensor: &Sensor, shot| sensor.expose(Film { values: &film }, shot, 5);
        let image = sensor.merged(&shots, expose).unwrap();
        assert_eq!(image.saturated, 0);
        let variance = |time: f64| {
            (rate * time + 0.5 * time + 9.0 + 1.0 / (12.0 * gain * gain)) / (time * time)
        };
        let counts = shots.iter().map(|shot| shot.exposure).filter(|time| rate * time < 0.8 * well);
        let weight: f64 = counts.map(|time| 1.0 / variance(time)).sum();
        let [mean, spread] = moments(image.rate.iter().map(|&r| f64::from(r)));
        let sigma = (1.0 / weight).sqrt();
        // 65 536 pixels: four errors of the mean.
        assert!((mean - rate).abs() < 4.0 * sigma / 256.0, "{rate}: {mean}");
        let off = 20.0 * (spread.sqrt() / sigma).log10();
        assert!(off.abs() < 0.1, "{rate}: {off} dB");
        let told = f64::from(image.sigma[0]);
        // The pilot of one pixel is as far off as its noise.
        assert!((told / sigma - 1.0).abs() < 0.5, "{rate}: σ {told} for {sigma}");
        decibels.push(20.0 * rate.log10());
    }
    let range = decibels[0] - decibels[decibels.len() - 1];
    assert!(range >= 119.9, "{range} dB");
}

/// The order of exposures changes no bit; what the shortest cannot hold is told as such.
#[test]
fn order_does_not_count_and_saturation_is_told() {
    let sensor = bracket();
    let mut shots: Vec<Exposure> = sensor.shots().collect();
    let (film, rate) = film(&sensor, 3e8);
    let expose = |sensor: &Sensor, shot| sensor.expose(Film { values: &film }, shot, 5);
    let image = sensor.merged(&shots, expose).unwrap();
    assert_eq!(image.saturated, u64::from(SIDE * SIDE));
    assert!(image.sigma.iter().all(|&sigma| sigma == f32::INFINITY));
    assert!(image.rate.iter().all(|&found| found > 1.4e8 && f64::from(found) < rate));
    shots.reverse();
    assert_eq!(sensor.merged(&shots, expose).unwrap(), image);
    assert!(sensor.merged(&[], expose).is_err());
}

/// Near a saturation the mean is bent by no more than the choice among numbers of one exposure may: 0.4 (the peak of the
/// normal density) of its standard deviation.
#[test]
fn near_a_saturation_the_mean_holds() {
    let sensor = bracket();
    let shots: Vec<Exposure> = sensor.shots().collect();
    for share in [0.7, 0.8, 0.82, 0.84, 0.86, 0.88, 0.9, 0.95, 1.0, 1.05] {
        let (film, rate) = film(&sensor, share * 15_000.0 / 1e-2);
        let expose = |sensor: &Sensor, shot| sensor.expose(Film { values: &film }, shot, 9);
        let image = sensor.merged(&shots, expose).unwrap();
        let [mean, spread] = moments(image.rate.iter().map(|&r| f64::from(r)));
        let own = ((rate * 1e-2 + 10.0) / 1e-4).sqrt();
        let error = spread.sqrt() / 256.0;
        let off = (mean - rate).abs();
        assert!(off < 0.4 * own + 4.0 * error, "{share}: {mean} for {rate}, ±{own}");
    }
}
