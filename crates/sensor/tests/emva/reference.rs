//! The round trip through the reference implementation of EMVA 1288 (`emva1288` 1.0.2 of
//! Python's package index), in an environment of its own below the target directory. Without a
//! network it is skipped, and says so.

use std::path::{Path, PathBuf};
use std::process::Command;

use etendue_sensor::emva::{DESCRIPTOR, Options, Series};
use serde_json::{Value, json};

use crate::sensor;

/// A Python that has the reference implementation; `Err` says why there is none.
fn python() -> Result<PathBuf, String> {
    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("emva1288-1.0.2");
    let (python, ready) = (venv.join("bin/python"), venv.join("ready"));
    if ready.exists() {
        return Ok(python);
    }
    let run = |program: &Path, arguments: &[&str]| {
        let out = Command::new(program).args(arguments).output();
        let out = out.map_err(|error| format!("{} cannot be run: {error}", program.display()))?;
        let last = String::from_utf8_lossy(&out.stderr).lines().last().unwrap_or("").to_owned();
        if out.status.success() { Ok(()) } else { Err(format!("{}: {last}", arguments.join(" "))) }
    };
    let folder = venv.to_str().ok_or("the target directory's name is not UTF-8")?;
    run(Path::new("python3"), &["-m", "venv", "--clear", folder])?;
    let pip = ["-m", "pip", "install", "--quiet", "numpy<2", "emva1288==1.0.2"];
    run(&python, &pip)?;
    std::fs::write(&ready, "").map_err(|error| error.to_string())?;
    Ok(python)
}

fn characterised(python: &Path, spec: Value) -> Value {
    let sensor = sensor(spec);
    let options = Options { seed: 1, ..Options::default() };
    let series = Series::plan(&sensor, &options).unwrap();
    let folder = tempfile::tempdir().unwrap();
    series.write(&sensor, &options, folder.path(), |_| true).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/emva/characterise.py");
    let descriptor = folder.path().join(DESCRIPTOR);
    let out = Command::new(python).arg(script).arg(descriptor).output().unwrap();
    let errors = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "the reference implementation failed: {errors}");
    serde_json::from_slice(&out.stdout).unwrap_or_else(|error| panic!("{error}: {out:?}"))
}

#[test]
fn the_reference_implementation_gives_back_what_went_in() {
    let python = match python() {
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
