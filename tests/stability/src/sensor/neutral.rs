//! A sensor's numbers of the light of a scene: the white of its raw files.

use anyhow::Result;
use etendue_sensor::bands::TOLERANCE;
use etendue_sensor::{Illumination, Sensor, SensorSpec};
use etendue_spectrum::{Curve, Illuminant, Outside};
use serde_json::{Value, json};

use crate::{Case, Outcome, Scale};

pub(super) const NEUTRAL: Case = Case {
    name: "white_of_raw_files",
    regime: "filters of 60 nm to 160 nm and ideal ones, before silicon, under illuminants A, E, D50, D65, FL2, FL11, \
        LED-B3 and black bodies of 1500 to 20 000 K",
    must: "what each channel makes of white, the most being 1 (a DNG's AsShotNeutral), is that of a sum in steps of \
        0.1 nm to 10⁻³",
    limit: None,
    run: neutral,
};

const SILICON: [[f64; 2]; 6] =
    [[380.0, 0.3], [450.0, 0.6], [530.0, 0.72], [600.0, 0.66], [700.0, 0.45], [780.0, 0.3]];

/// Of red, green and blue.
const NARROW: [[[f64; 2]; 4]; 3] = [
    [[580.0, 0.0], [600.0, 1.0], [640.0, 1.0], [660.0, 0.0]],
    [[510.0, 0.0], [530.0, 1.0], [550.0, 0.9], [570.0, 0.0]],
    [[420.0, 0.0], [440.0, 0.8], [460.0, 0.9], [480.0, 0.0]],
];

fn neutral(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let names = ["a", "equal_energy", "d50", "d65", "fl2", "fl11", "led_b3"];
    let bodies = [1500.0, 3000.0, 9000.0, 20_000.0];
    let lamps = names.iter().map(|name| json!(name));
    let lamps: Vec<Value> =
        lamps.chain(bodies.iter().map(|kelvin| json!({ "black_body": kelvin }))).collect();
    let lamps = scale.pick(&lamps[..5], &lamps[..]);
    let (mut worst, mut bluest) = (0.0_f64, 1.0_f64);
    for lamp in lamps {
        let illuminant: Illuminant = serde_json::from_value(lamp.clone())?;
        let light = illuminant.curve()?;
        for filters in [NARROW.map(|filter| filter.to_vec()), wide()] {
            let found = found(&light, &filters)?;
            let exact = exact(&light, &filters)?;
            for (found, exact) in found.iter().zip(exact) {
                let off = (found - exact).abs();
                outcome.must(off <= TOLERANCE, || format!("{lamp}: {found}, not {exact}"));
                worst = worst.max(off);
                bluest = bluest.min(*found);
            }
        }
    }
    outcome.measured(format!("at most {worst:.1e} off; the least channel has {bluest:.3}"));
    Ok(outcome)
}

/// Filters that overlap.
fn wide() -> [Vec<[f64; 2]>; 3] {
    [
        vec![[540.0, 0.0], [620.0, 1.0], [700.0, 0.8]],
        vec![[460.0, 0.0], [540.0, 1.0], [620.0, 0.0]],
        vec![[400.0, 0.3], [450.0, 1.0], [520.0, 0.0]],
    ]
}

/// As the sensor has it in the bands that are chosen for the light.
fn found(light: &Curve, filters: &[Vec<[f64; 2]>; 3]) -> Result<Vec<f64>> {
    let [r, g, b] = filters;
    let spec: SensorSpec = serde_json::from_value(json!({
        "type": "raw", "cfa": "rggb", "radiometry": "physical", "system_gain": 1, "pixel_pitch": 3.45,
        "quantum_efficiency": SILICON, "filters": { "r": r, "g": g, "b": b },
    }))?;
    let own = Sensor::new(&spec)?;
    let lit = Illumination { spectra: vec![light.clone()], ..Illumination::default() };
    let bands = own.bands_under(&lit, TOLERANCE)?.bands;
    let light = bands.from_curve(light, Outside::Zero)?;
    Ok(own.in_bands(bands)?.white_under(&light))
}

/// As a sum of photons has it.
fn exact(light: &Curve, filters: &[Vec<[f64; 2]>; 3]) -> Result<Vec<f64>> {
    let silicon = Curve::sampled(SILICON.to_vec())?;
    let mut all = Vec::new();
    for filter in filters {
        let curve = Curve::sampled(filter.clone())?;
        let sum = |step: u32| {
            let nm = 380.05 + 0.1 * f64::from(step);
            let part = |curve: &Curve| curve.at(nm).unwrap_or(0.0);
            part(light) * part(&silicon) * part(&curve) * nm
        };
        all.push((0..4000).map(sum).sum::<f64>());
    }
    let most = all.iter().copied().fold(0.0, f64::max);
    Ok(all.into_iter().map(|sum| sum / most).collect())
}
