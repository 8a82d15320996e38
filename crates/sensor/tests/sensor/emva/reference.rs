//! The round trip through the reference implementation. Without a network it is skipped, and says
//! so.

use std::path::Path;

use etendue_sensor::emva::{DESCRIPTOR, Options, Series};
use serde_json::{Value, json};

use super::{python, sensor};

fn characterised(python: &Path, spec: Value) -> Value {
    let sensor = sensor(spec);
    let options = Options { seed: 1, ..Options::default() };
    let series = Series::plan(&sensor, &options).unwrap();
    let folder = tempfile::tempdir().unwrap();
    series.write(&sensor, &options, folder.path(), |_| true).unwrap();
    python::characterised(python, &folder.path().join(DESCRIPTOR))
}

#[test]
fn the_reference_implementation_gives_back_what_went_in() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            println!("skipped: the reference implementation of EMVA 1288 cannot be had: {why}");
            return;
        }
    };
    for (model, prnu, dsnu) in
        [("imx183", 0.008, 3.0), ("imx174", 0.005, 6.0), ("kaf8300", 0.01, 12.0)]
    {
        let spec = json!({
            "type": "raw", "model": model, "prnu": prnu, "dsnu": dsnu, "serial": 1288,
        });
        let true_values = sensor(spec.clone());
        let results = characterised(&python, spec);
        println!("{model}: {results}");
        // The implementation's own resolution on 256 × 256 pixels and 25 steps (one standard error).
        for (key, expected, resolution) in [
            ("system_gain", true_values.system_gain(), 0.001_5),
            ("quantum_efficiency", true_values.quantum_efficiency().at(525.0).unwrap(), 0.001_5),
            ("dark_noise", true_values.read_noise(), 0.002_2),
            ("dark_current_by_mean", true_values.dark_current(), 0.002),
            ("dark_current_by_variance", true_values.dark_current(), 0.01),
            ("dsnu", dsnu, 0.003),
            ("prnu", prnu, 0.004),
        ] {
            let found = results[key].as_f64().unwrap();
            let error = (found / expected - 1.0) / resolution;
            assert!(error.abs() < 4.0, "{model} {key}: {found}, not {expected}: {error:.1} errors");
        }
        for end in results["linearity_error"].as_array().unwrap() {
            assert!(end.as_f64().unwrap().abs() < 0.02, "{model}: linearity error {end} %");
        }
        // Its variance peaks before the clip, and steps are 4.6 % of saturation apart.
        let saturation = results["saturation"].as_f64().unwrap() / true_values.saturation();
        assert!((0.90..1.01).contains(&saturation), "{model}: saturation {saturation}");
    }
}

/// With parts of real chips switched on that the standard has a parameter for: every gain of a table is found again with the
/// noise that belongs to it, and patterns of rows and columns are in the non-uniformity of the dark signal.
#[test]
fn the_reference_implementation_finds_gains_and_patterns_again() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            println!("skipped: the reference implementation of EMVA 1288 cannot be had: {why}");
            return;
        }
    };
    let base = json!({
        "type": "raw", "bit_depth": 14, "full_well": 30000, "system_gain": 0.5, "black_level": 200,
        "read_noise": 4.0, "dark_current": 10, "prnu": 0.008, "dsnu": 3.0, "quantum_efficiency": 0.6, "serial": 1288,
    });
    let with = |more: Value| {
        let mut spec = base.clone();
        for (key, value) in more.as_object().unwrap() {
            spec[key] = value.clone();
        }
        spec
    };
    let total = |parts: &[f64]| parts.iter().map(|part| part * part).sum::<f64>().sqrt();
    let gained = |gain: f64| with(json!({ "analog_gain": gain, "converter_noise": 2.0 }));
    // 2 DN behind the gain are 2/K electrons; of 256 rows a pattern's variance is known to a share of 0.09.
    for (what, spec, [gain, noise, dsnu], of_dsnu) in [
        ("gain 1", gained(1.0), [0.5, total(&[4.0, 2.0 / 0.5]), 3.0], 0.003),
        ("gain 4", gained(4.0), [2.0, total(&[4.0, 2.0 / 2.0]), 3.0], 0.003),
        (
            "patterns",
            with(json!({ "row_pattern": 1.0, "column_pattern": 1.0 })),
            [0.5, 4.0, total(&[3.0, 1.0, 1.0])],
            0.009,
        ),
    ] {
        let results = characterised(&python, spec);
        println!("{what}: {results}");
        for (key, expected, resolution) in [
            ("system_gain", gain, 0.001_5),
            ("quantum_efficiency", 0.6, 0.001_5),
            ("dark_noise", noise, 0.002_2),
            ("dsnu", dsnu, of_dsnu),
            ("prnu", 0.008, 0.004),
        ] {
            let found = results[key].as_f64().unwrap();
            let error = (found / expected - 1.0) / resolution;
            assert!(error.abs() < 4.0, "{what} {key}: {found}, not {expected}: {error:.1} errors");
        }
    }
}
