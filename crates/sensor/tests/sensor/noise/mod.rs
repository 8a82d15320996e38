//! Noise against that of the physics: moments, whole distributions, patterns, and the same bits for
//! any number of threads.

#![expect(clippy::cast_possible_truncation, reason = "films hold f32")]

mod charge;
mod distribution;
mod gain;
mod hdr;
mod moments;
mod patterns;
mod reference;
mod repeatability;
mod second;

use etendue_sensor::{Exposure, Film, RawImage, Sensor, SensorSpec};
use serde_json::{Value, json};

/// A monochrome sensor with these keys besides the usual ones.
fn sensor(side: u32, keys: Value) -> Sensor {
    let mut spec = json!({ "type": "raw", "resolution": [side, side], "noise": "poisson" });
    for (key, value) in keys.as_object().unwrap() {
        spec[key] = value.clone();
    }
    let spec: SensorSpec = serde_json::from_value(spec).unwrap();
    Sensor::new(&spec).unwrap()
}

/// A frame of a digital monochrome sensor under even light of about `electrons` a pixel, and how
/// many it really is after rounding to the film's f32.
fn even_frame(sensor: &Sensor, electrons: f64, frame: u32, seed: u64) -> (RawImage, f64) {
    let responsivity = sensor.electrons_per_unit(0)[0];
    let light = (electrons / responsivity) as f32;
    let [width, height] = sensor.resolution();
    let film = vec![light; (width * height) as usize];
    let shot = Exposure { exposure: 0.01, frame };
    let image = sensor.expose(Film { values: &film }, shot, seed).unwrap();
    (image, f64::from(light) * responsivity)
}

/// Mean and variance of numbers.
fn moments(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let squares: f64 = values.map(|value| (value - mean) * (value - mean)).sum();
    [mean, squares / (count - 1.0)]
}
