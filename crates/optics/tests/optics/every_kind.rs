//! A lens of `scenes/lenses` for every kind of element, aperture, sag, phase and gradient that lens files have.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use etendue_optics::train::analysis::spot;
use etendue_optics::train::{FieldSpec, Focus, LensFile, OpticalTrain};
use serde_json::Value;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/lenses")
}

/// Names, texts and trains of all of them.
fn lenses() -> Vec<(String, Value, OpticalTrain)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "json") {
            let text = std::fs::read_to_string(&path).unwrap();
            let file = LensFile::from_json(&text).unwrap_or_else(|e| panic!("{path:?}: {e}"));
            let resolve = |name: &str| Ok(folder().join(name));
            let train = file.build(&resolve).unwrap_or_else(|e| panic!("{path:?}: {e}"));
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            all.push((name, serde_json::from_str(&text).unwrap(), train));
        }
    }
    all
}

/// `type: mirror`, `shape: spider` and so on: what tags a schema has.
fn tags(schema: &Value, found: &mut BTreeSet<String>) {
    match schema {
        Value::Object(members) => {
            for key in ["type", "shape"] {
                let tag = members.get("properties").and_then(|p| p[key]["const"].as_str());
                found.extend(tag.map(|tag| format!("{key}: {tag}")));
            }
            members.values().for_each(|value| tags(value, found));
        }
        Value::Array(values) => values.iter().for_each(|value| tags(value, found)),
        _ => {}
    }
}

/// Collects the tags that a file uses.
fn used(file: &Value, found: &mut BTreeSet<String>) {
    match file {
        Value::Object(members) => {
            for key in ["type", "shape"] {
                let tag = members.get(key).and_then(Value::as_str);
                found.extend(tag.map(|tag| format!("{key}: {tag}")));
            }
            members.values().for_each(|value| used(value, found));
        }
        Value::Array(values) => values.iter().for_each(|value| used(value, found)),
        _ => {}
    }
}

#[test]
fn every_kind_of_surface_has_a_lens() {
    let mut kinds = BTreeSet::new();
    tags(schemars::schema_for!(LensFile).as_value(), &mut kinds);
    for kind in ["type: mirror", "shape: outline", "type: q_con", "type: radial", "type: rod"] {
        assert!(kinds.contains(kind), "{kind} is not in {kinds:?}");
    }
    let mut shown = BTreeSet::new();
    let mut keys = BTreeSet::new();
    for (_, file, _) in lenses() {
        used(&file, &mut shown);
        let text = file.to_string();
        let all =
            ["fresnel", "rotation_radius", "blaze_wavelength", "design_wavelength", "coating"];
        keys.extend(all.into_iter().filter(|key| text.contains(&format!("\"{key}\":"))));
    }
    let missing: Vec<&String> = kinds.difference(&shown).collect();
    assert!(missing.is_empty(), "no lens of scenes/lenses shows {missing:?}");
    assert_eq!(keys.len(), 5, "{keys:?}");
}

/// Each has the focal length that its name says, and light through it on the axis.
#[test]
fn every_lens_does_what_its_name_says() {
    let mut named = 0;
    for (name, _, train) in lenses() {
        let paraxial = train.paraxial(train.wavelength()).unwrap();
        let efl = paraxial.efl.unwrap_or_else(|| panic!("{name} is afocal"));
        let words: Vec<&str> = train.name().split([' ', ',']).collect();
        let said = words.windows(2).find(|pair| pair[1] == "mm").map(|pair| pair[0]);
        if let Some(said) = said.and_then(|number| number.parse::<f64>().ok()) {
            // Names are rounded to two digits, and aspheric terms of r² are added to some.
            assert!((efl.abs() / said - 1.0).abs() < 0.025, "{name}: {efl}");
            named += 1;
        }
        let at = train.at(train.wavelength()).unwrap();
        let z = train.sensor_z(Focus::AsWritten).unwrap_or_else(|e| panic!("{name}: {e}"));
        let spot = spot(&train, &at, &FieldSpec::at(0.0), z);
        let spot = spot.unwrap_or_else(|| panic!("{name}: no light"));
        assert!(spot.passed() > 0.1, "{name}: {} of the light passes", spot.passed());
        assert!(spot.rms.is_finite() && spot.centroid_y.is_finite(), "{name}: {spot:?}");
        println!("{name}: efl {efl:.3}, rms {:.5}, passed {:.2}", spot.rms, spot.passed());
    }
    assert!(named > 30, "{named}");
}
