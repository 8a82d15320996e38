//! The standard's own characterisation, run on our images, gives back the parameters that went in.

mod analysis;
mod python;
mod random;
mod reference;

use std::collections::BTreeSet;

use etendue_sensor::emva::{DESCRIPTOR, MANIFEST, Manifest, Options, Series, SeriesStep};
use etendue_sensor::{Sensor, SensorSpec};
use serde_json::{Value, json};

use crate::environment;

pub(crate) fn sensor(spec: Value) -> Sensor {
    let spec: SensorSpec = serde_json::from_value(spec).unwrap();
    Sensor::new(&spec).unwrap()
}

#[test]
fn a_series_is_what_a_characterisation_wants() {
    let sensor = sensor(json!({
        "type": "raw", "model": "kaf8300", "resolution": [48, 32], "cfa": "rggb", "serial": 3,
    }));
    let options = Options { steps: 20, ..Options::default() };
    let series = Series::plan(&sensor, &options).unwrap();
    let folder = tempfile::tempdir().unwrap();
    series.write(&sensor, &options, folder.path(), |done| done <= series.len()).unwrap();

    let text = std::fs::read_to_string(folder.path().join(MANIFEST)).unwrap();
    let manifest: Manifest = serde_json::from_str(&text).unwrap();
    assert_eq!(manifest, series.manifest);
    let keys: Value = serde_json::from_str(&text).unwrap();
    let names = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    let set = |keys: &[&str]| keys.iter().map(|key| (*key).to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(names(&keys), set(&["bits", "steps", "spatial"]));
    assert_eq!(names(&keys["spatial"]), set(&["exposure_s", "photons", "bright", "dark"]));
    assert_eq!(names(&keys["steps"][0]), names(&keys["spatial"]));

    assert_eq!((manifest.bits, manifest.steps.len()), (16, 20));
    assert!(manifest.steps.iter().all(|step| step.bright.len() == 2 && step.dark.len() == 2));
    assert_eq!((manifest.spatial.bright.len(), manifest.spatial.dark.len()), (16, 16));
    let flux: Vec<f64> = manifest.steps.iter().map(|s| s.photons / s.exposure_s).collect();
    // The film rounds photons to 24 bits.
    assert!(flux.iter().all(|f| (f / flux[0] - 1.0).abs() < 1e-6), "constant light");
    let efficiency = sensor.quantum_efficiency().at(525.0).unwrap();
    // Of light and dark current together: saturated at the last step but one, and half of that.
    let filled = |step: &SeriesStep| {
        let dark = sensor.dark_current() * step.exposure_s;
        (step.photons * efficiency + dark) / sensor.saturation()
    };
    let [last, before, half] =
        [&manifest.steps[19], &manifest.steps[18], &manifest.spatial].map(filled);
    assert!((before - 1.0).abs() < 1e-6 && (last - 20.0 / 19.0).abs() < 1e-6, "{before} {last}");
    assert!((half - 0.5).abs() < 1e-6, "{half}");

    let descriptor = std::fs::read_to_string(folder.path().join(DESCRIPTOR)).unwrap();
    assert!(descriptor.lines().any(|line| line == "n 16 48 32"));
    assert_eq!(descriptor.lines().filter(|line| line.starts_with("i ")).count(), 20 * 4 + 32);
    for name in descriptor.lines().filter_map(|line| line.strip_prefix("i ")) {
        let image = image::open(folder.path().join(name)).unwrap();
        assert_eq!(image.color(), image::ColorType::L16, "{name}");
        assert_eq!((image.width(), image.height()), (48, 32));
    }
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, series.len() + 2, "nothing half-written is left");
    // The last step is saturated: the converter clips.
    let last = image::open(folder.path().join(&manifest.steps[19].bright[0])).unwrap().to_luma16();
    assert!(last.iter().all(|&y| y == 65_535));
}

#[test]
fn a_series_comes_out_the_same_twice() {
    let sensor = sensor(json!({ "type": "raw", "model": "imx250", "resolution": [20, 10] }));
    let options = Options { steps: 20, ..Options::default() };
    let series = Series::plan(&sensor, &options).unwrap();
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    for folder in &folders {
        series.write(&sensor, &options, folder.path(), |_| true).unwrap();
    }
    for entry in std::fs::read_dir(folders[0].path()).unwrap() {
        let name = entry.unwrap().file_name();
        let [a, b] = [0, 1].map(|i| std::fs::read(folders[i].path().join(&name)).unwrap());
        assert!(a == b, "{} differs", name.display());
    }
}

#[test]
fn what_cannot_be_characterised_is_refused() {
    let seen = sensor(json!({ "type": "raw", "model": "imx183" }));
    let plan = |options: Options| Series::plan(&seen, &options).unwrap_err().to_string();
    let few = plan(Options { steps: 19, ..Options::default() });
    assert!(few.contains("19 exposure steps"), "{few}");
    let blind = plan(Options { wavelength: 1500.0, ..Options::default() });
    assert!(blind.contains("no quantum efficiency at 1500 nm"), "{blind}");
    for (spec, word) in [
        (json!({ "type": "raw" }), "sensor.noise: is of no use"),
        (json!({ "type": "raw", "model": "imx183", "noise": "none" }), "what has no noise"),
    ] {
        let error = Series::plan(&sensor(spec), &Options::default()).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

/// Half the variance of the difference of two images (DN²).
fn temporal_variance(folder: &std::path::Path, files: &[String]) -> f64 {
    let read = |name: &String| image::open(folder.join(name)).unwrap().to_luma16().into_raw();
    let [a, b] = [read(&files[0]), read(&files[1])];
    let differences = || a.iter().zip(&b).map(|(a, b)| f64::from(*a) - f64::from(*b));
    let mean = differences().sum::<f64>() / a.len() as f64;
    0.5 * differences().map(|d| (d - mean).powi(2)).sum::<f64>() / a.len() as f64
}

#[test]
fn whoever_looks_for_the_greatest_variance_finds_saturation() {
    // A well that is full long before the converter ends, and noise of the read-out behind it.
    let sensor = sensor(json!({
        "type": "raw", "resolution": [128, 128], "system_gain": 0.5, "bit_depth": 12, "full_well": 5200,
        "read_noise": 8, "black_level": 40, "dark_current": 10, "quantum_efficiency": 0.5,
    }));
    let options = Options { size: Some([128, 128]), ..Options::default() };
    for seed in 0..4 {
        let options = Options { seed, ..options };
        let series = Series::plan(&sensor, &options).unwrap();
        let folder = tempfile::tempdir().unwrap();
        series.write(&sensor, &options, folder.path(), |_| true).unwrap();
        let steps = &series.manifest.steps;
        let variances: Vec<f64> =
            steps.iter().map(|step| temporal_variance(folder.path(), &step.bright)).collect();
        // The rule of the reference implementation (emva1288 1.0.2, `index_u_ysat`): from the end on
        // to the first maximum that the step before it does not exceed.
        let (mut most, mut found) = (0.0, 0);
        for i in (0..steps.len()).rev() {
            let before = variances[i.saturating_sub(1)];
            if variances[i] >= most || before >= most {
                (most, found) = (variances[i], i);
            } else {
                break;
            }
        }
        // Step 24 of 25 saturates, and half of its pixels are clipped: the variance is greatest at the
        // one before it, 3 standard deviations below. What fills the well there is light and dark
        // current, and the rule counts the light: 4.2 % and, here, 1.8 % less than the full well.
        assert_eq!(found + 1, 23, "{seed}: {variances:?}");
        let saturation = steps[found].photons * 0.5;
        let light = 5200.0 - 10.0 * steps[23].exposure_s;
        let expected = light * 23.0 / 24.0;
        assert!((saturation / expected - 1.0).abs() < 1e-6, "{saturation} for {expected} e⁻");
        assert!((0.935..0.945).contains(&(saturation / 5200.0)), "{saturation} e⁻");
    }
}
