//! Inputs that are no sensor, no light or no film are refused, with the key and the remedy.

use etendue_sensor::{Film, InvalidValues, Sensor, SensorError, SensorSpec};
use serde_json::{Value, json};

fn refused(spec: Value) -> SensorError {
    let spec: SensorSpec =
        serde_json::from_value(spec.clone()).unwrap_or_else(|e| panic!("{spec}: {e}"));
    match Sensor::new(&spec) {
        Ok(_) => panic!("accepted: {spec:?}"),
        Err(error) => error,
    }
}

/// Settings of the amplifier that there are not, or twice; the first message says which there are.
#[test]
fn iso_settings() {
    let settings = |settings: Value, iso: Value| {
        refused(json!({ "type": "raw", "iso_settings": settings, "iso": iso })).to_string()
    };
    let two = json!([{ "iso": 100, "system_gain": 0.3 }, { "iso": 400, "system_gain": 1.2 }]);
    assert_eq!(
        settings(two, 200.into()),
        "sensor.iso: there is no setting 200: sensor.iso_settings has 100, 400"
    );
    let twice = json!([{ "iso": 100, "system_gain": 0.3 }, { "iso": 100, "system_gain": 1.2 }]);
    assert!(settings(twice, 100.into()).contains("settings of different numbers, found 100"));
    assert!(settings(json!([]), 100.into()).contains("one setting at least"));
    let none = json!([{ "iso": 100, "system_gain": 0 }]);
    assert!(settings(none, 100.into()).contains("sensor.system_gain: expected DN per electron"));
}

#[test]
fn numbers_out_of_range() {
    each_is_refused(&[
        (json!({ "quantum_efficiency": 1.01 }), "the curve is 1.01 at every wavelength"),
        (json!({ "quantum_efficiency": -0.1 }), "must lie in 0..=1"),
        (json!({ "quantum_efficiency": [[400, 0.5], [500, 1.5]] }), "1.5 at 500 nm"),
        (json!({ "system_gain": 0 }), "sensor.system_gain: expected "),
        (json!({ "system_gain": -1 }), "above 0"),
        (json!({ "system_gain": 1e-300 }), "1e-9 to 1e9), found 1e-300"),
        (json!({ "full_well": 0.4, "black_level": 100 }), "not half a digital number"),
        (json!({ "full_well": 0 }), "sensor.full_well: expected "),
        (json!({ "full_well": -5 }), "sensor.full_well: expected "),
        (json!({ "bit_depth": 0 }), "1 to 16 bits"),
        (json!({ "bit_depth": 17 }), "sensor.bit_depth: expected "),
        (json!({ "black_level": -1 }), "sensor.black_level: expected "),
        (json!({ "black_level": 255, "bit_depth": 8 }), "below full scale"),
        (json!({ "exposure": 0 }), "sensor.exposure: expected "),
        (json!({ "exposure": -1 }), "seconds, above 0"),
        (json!({ "exposures": [0.1, 0] }), "sensor.exposures: expected "),
        (json!({ "exposures": [] }), "one exposure time at least"),
        (json!({ "exposure": 1, "exposures": [1] }), "of no use"),
        (json!({ "frames": 0 }), "sensor.frames: expected "),
        (json!({ "temperature": -1 }), "kelvin, 0 or more"),
        (json!({ "temperature": 1e6, "dark_current_doubling": 1 }), "can be counted"),
        (json!({ "dark_current_doubling": 0 }), "kelvin, above 0"),
        (json!({ "dark_current": -1 }), "sensor.dark_current: expected "),
        (json!({ "read_noise": -1 }), "sensor.read_noise: expected "),
        (json!({ "prnu": 1.5 }), "a fraction"),
        (json!({ "dsnu": -1 }), "sensor.dsnu: expected "),
        (json!({ "row_noise": -1 }), "sensor.row_noise: expected "),
        (json!({ "row_pattern": -1 }), "sensor.row_pattern: expected "),
        (json!({ "column_pattern": 1e10 }), "sensor.column_pattern: expected "),
        (json!({ "dcnu": 1.5 }), "sensor.dcnu: expected a fraction"),
        (json!({ "dead_pixels": -0.1 }), "sensor.dead_pixels: expected a fraction"),
        (json!({ "dead_pixels": 0.6, "stuck_pixels": 0.6 }), "all of them at most together"),
        (json!({ "crosstalk": 0.3 }), "four neighbours"),
        (json!({ "analog_gain": 0 }), "sensor.analog_gain: expected a factor"),
        (json!({ "converter_noise": -1 }), "sensor.converter_noise: expected DN"),
        (json!({ "iso": 100 }), "sensor.iso_settings: is missing"),
        (
            json!({ "iso_settings": [{ "iso": 100, "system_gain": 1 }] }),
            "sensor.system_gain: is of no use",
        ),
        (
            json!({ "hot_pixels": { "share": 2, "dark_current": 1 } }),
            "hot_pixels.share: expected a fraction in 0..=1, found 2",
        ),
        (json!({ "resolution": [0, 5] }), "sensor.resolution: expected "),
        (json!({ "resolution": [70000, 5] }), "1 to 65535"),
        (json!({ "pixel_pitch": 0 }), "sensor.pixel_pitch: expected "),
    ]);
}

#[test]
fn parts_of_chips_out_of_range() {
    each_is_refused(&[
        (
            json!({ "blooming": 1.5, "system_gain": 1, "full_well": 9 }),
            "sensor.blooming: expected a fraction",
        ),
        (
            json!({ "blooming": 0.5, "system_gain": 1 }),
            "sensor.full_well: is missing: nonlinearity and blooming",
        ),
        (json!({ "smear": -1 }), "sensor.smear: expected a fraction"),
        (json!({ "nonlinearity": [[1, 0.9]] }), "sensor.full_well: is missing"),
        (
            json!({ "nonlinearity": [[0.9, 0.9]], "full_well": 9, "system_gain": 1 }),
            "up to 1 collected, found 0.9",
        ),
        (
            json!({ "nonlinearity": [[0.9, 0.9], [1, 0.8]], "full_well": 9, "system_gain": 1 }),
            "shares read that ascend",
        ),
        (json!({ "carrier_diffusion": -1 }), "sensor.carrier_diffusion: expected micrometres"),
        (json!({ "defect_map": "a.png" }), "sensor.defect_map: is of no use here"),
        (
            json!({ "defect_map": [{ "column": 1024, "row": 0, "kind": "dead" }] }),
            "columns of the sensor, found 1024",
        ),
        (
            json!({ "defect_map": [
                { "column": 3, "row": 5, "kind": "dead" }, { "column": 3, "row": 5, "kind": "stuck" }
            ] }),
            "sensor.defect_map: expected the column of each pixel once, found 3",
        ),
        (
            json!({ "defect_map": [{ "column": 0, "row": 0, "kind": "hot" }] }),
            "nobody says how hot",
        ),
        (
            json!({ "angular_response": { "curve": [[0, 1], [10, 1.1]] } }),
            "no light is seen twice, found 1.1",
        ),
        (json!({ "angular_response": { "curve": [[5, 1]] } }), "begin at 0 degrees"),
        (json!({ "angular_response": { "curve": [[0, 1], [0, 0.5]] } }), "angles that ascend"),
        (
            json!({ "angular_response": { "curve": [[0, 1]], "lens_shift": 95 } }),
            "lens_shift: expected degrees",
        ),
        (
            json!({ "auto_exposure": { "percentile": 0, "target": 0.5 }, "radiometry": "physical", "system_gain": 1 }),
            "sensor.auto_exposure.percentile: expected a percentile",
        ),
        (
            json!({ "auto_exposure": { "percentile": 99, "target": 2 }, "radiometry": "physical", "system_gain": 1 }),
            "sensor.auto_exposure.target: expected a share",
        ),
        (
            json!({ "auto_exposure": { "percentile": 99, "target": 0.5 } }),
            "longer exposures have no more light",
        ),
        (
            json!({ "auto_exposure": { "percentile": 99, "target": 0.5 }, "exposure": 1 }),
            "the time that it would meter",
        ),
        (
            json!({ "system_gain": 1, "second_readout": { "type": "split_pixel", "ratio": 1 } }),
            "sensor.second_readout.ratio: expected a share above 0 and below 1",
        ),
        (
            json!({ "system_gain": 1, "second_readout": { "type": "dual_gain", "system_gain": 0 } }),
            "sensor.second_readout: expected DN per electron",
        ),
    ]);
}

/// Keys of a raw sensor, each with words of its refusal.
fn each_is_refused(all: &[(Value, &str)]) {
    for (keys, word) in all {
        let mut spec = json!({ "type": "raw", "system_gain": 1.0 });
        for (key, value) in keys.as_object().unwrap() {
            spec[key] = value.clone();
        }
        let text = refused(spec).to_string();
        assert!(text.contains(word), "{keys}: {text}");
    }
}

#[test]
fn curves_that_are_none() {
    for (text, word) in [
        (r#"{ "quantum_efficiency": [] }"#, "empty"),
        (r#"{ "quantum_efficiency": [[500, 0.5], [400, 0.5]] }"#, "sort the samples"),
        (r#"{ "cfa": "rggx" }"#, "the filter `x`"),
        (r#"{ "cfa": "rggb", "filters": { "g": [[500, 2], [600, 0]] } }"#, "sensor.filters.g"),
    ] {
        let text = match serde_json::from_str::<SensorSpec>(text) {
            Err(error) => error.to_string(),
            Ok(spec) => {
                let spec = SensorSpec { kind: etendue_sensor::SensorKind::Raw, ..spec };
                Sensor::new(&spec).unwrap_err().to_string()
            }
        };
        assert!(text.contains(word), "{text}");
    }
}

#[test]
fn blind_sensors_are_errors_and_never_black_images() {
    for (keys, word) in [
        (
            json!({ "quantum_efficiency": [[900, 0.5], [1000, 0.5]], "cfa": "rggb" }),
            "sees nothing of 900..=1000 nm",
        ),
        (
            json!({ "quantum_efficiency": [[400, 0.5], [500, 0.5]], "bands": [600, 700] }),
            "sees nothing of 600..=700 nm",
        ),
        (json!({ "quantum_efficiency": 0 }), "sees nothing"),
        (
            json!({ "cfa": "rggb", "filters": { "r": [[800, 0.5], [900, 0.5]] }, "bands": [400, 700] }),
            "the channel `R` sees nothing",
        ),
        (
            json!({ "type": "multispectral", "bands": [400, 700], "channels":
                [{ "name": "nir", "curve": [[800, 0.5], [900, 0.5]] }] }),
            "the channel `nir` sees nothing",
        ),
    ] {
        let mut spec = json!({ "type": "raw" });
        for (key, value) in keys.as_object().unwrap() {
            spec[key] = value.clone();
        }
        let text = refused(spec).to_string();
        assert!(text.contains(word), "{keys}: {text}");
    }
}

#[test]
fn keys_that_would_do_nothing() {
    for (spec, word) in [
        (json!({ "type": "rgb", "cfa": "rggb" }), "sensor.cfa: is of no use"),
        (json!({ "type": "raw", "filters": "nikon_d5100" }), "sensor.cfa: is missing"),
        (json!({ "type": "multispectral" }), "sensor.bands: is missing"),
        (
            json!({ "type": "multispectral", "channels":
                [{ "name": "a", "curve": 1 }, { "name": "a", "curve": 1 }] }),
            "sensor.channels: the name of channel 1 is taken",
        ),
        (
            json!({ "type": "multispectral", "channels": [{ "name": "a b", "curve": 1 }] }),
            "sensor.channels: the name of channel 0 must be",
        ),
        (
            json!({ "type": "raw", "cfa": "rggb", "filters": { "w": 1 } }),
            "sensor.filters: is of no use here: it has a curve for a letter",
        ),
        (json!({ "type": "multispectral", "channels": [] }), "sensor.channels: is missing"),
        (json!({ "type": "multispectral", "bands": [1, 2], "filters": "ideal" }), "of no use"),
        (json!({ "type": "rgb", "channels": [] }), "sensor.channels: is of no use"),
        (json!({ "noise": "poisson" }), "sensor.system_gain: is missing"),
        (json!({ "read_noise": 3 }), "sensor.system_gain: is missing"),
        (json!({ "radiometry": "physical" }), "sensor.system_gain: is missing"),
    ] {
        let text = refused(spec.clone()).to_string();
        assert!(text.contains(word), "{spec}: {text}");
    }
}

#[test]
fn what_looks_like_a_slip_is_said() {
    let notes = |spec: Value| {
        let spec: SensorSpec = serde_json::from_value(spec).unwrap();
        Sensor::new(&spec).unwrap().notes().join("\n")
    };
    let celsius = notes(json!({ "model": "imx183", "temperature": 20 }));
    assert!(celsius.contains("was °C meant?"), "{celsius}");
    let idle = notes(json!({ "system_gain": 1, "dark_current": 1, "temperature": 300 }));
    assert!(idle.contains("dark_current_doubling is not given"), "{idle}");
    assert_eq!(notes(json!({ "model": "imx183", "temperature": 300 })), "");
}

#[test]
fn light_that_is_none_is_counted_and_dark() {
    let spec = json!({ "type": "rgb", "resolution": [2, 1] });
    let sensor = Sensor::new(&serde_json::from_value(spec).unwrap()).unwrap();
    let shot = sensor.shots().next().unwrap();
    let film = [f32::NAN, -1.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, -0.0];
    let image = sensor.expose(Film { values: &film }, shot, 0).unwrap();
    assert_eq!(image.values, [0, 0, 65535, 0, 0, 0]);
    assert_eq!(image.invalid, InvalidValues { negative: 1, not_finite: 3 });
    assert_eq!(sensor.moments(Film { values: &film }, shot).unwrap().invalid, image.invalid);
    let short = sensor.expose(Film { values: &film[..5] }, shot, 0).unwrap_err();
    assert!(short.to_string().contains("has 5 values, 2 × 1 pixels of 3 spectral bands need 6"));
}
