//! Response of sensors to light: full scale in digital mode, closed forms in physical mode, bands and colours.

#![expect(clippy::cast_possible_truncation, reason = "films hold f32")]

use etendue_sensor::spec::Method;
use etendue_sensor::{Exposure, Film, Model, RawImage, Sensor, SensorSpec};
use etendue_spectrum::{Bands, Curve, Grid, integral};
use serde_json::{Value, json};

fn sensor(spec: Value) -> Sensor {
    let spec: SensorSpec =
        serde_json::from_value(spec.clone()).unwrap_or_else(|e| panic!("{spec}: {e}"));
    Sensor::new(&spec).unwrap_or_else(|e| panic!("{spec:?}: {e}"))
}

/// Even light of this value in every band.
fn exposed(sensor: &Sensor, light: f32, exposure: f64) -> RawImage {
    let [width, height] = sensor.resolution().map(|side| side as usize);
    let film = vec![light; width * height * sensor.bands().count()];
    sensor.expose(Film { values: &film }, Exposure { exposure, frame: 0 }, 0).unwrap()
}

#[test]
fn full_scale_is_one_whatever_the_bands() {
    let bands = json!({ "from": 400, "to": 700, "count": 31 });
    for (spec, bands, channels) in [
        (json!({ "type": "raw" }), 1, vec![1.0]),
        (json!({ "type": "raw", "quantum_efficiency": 0.3 }), 1, vec![1.0]),
        (json!({ "type": "raw", "cfa": "rggb" }), 3, vec![1.0; 3]),
        (json!({ "type": "raw", "bands": bands }), 31, vec![1.0]),
        (json!({ "type": "rgb" }), 3, vec![1.0; 3]),
        (json!({ "type": "rgb", "bands": bands }), 31, vec![1.0; 3]),
        (json!({ "type": "multispectral", "bands": bands }), 31, vec![1.0; 31]),
        (json!({ "type": "raw", "quantum_efficiency": [[400, 0.2], [700, 0.8]] }), 30, vec![1.0]),
    ] {
        let mut full = spec.clone();
        full["resolution"] = json!([4, 4]);
        full["bit_depth"] = json!(12);
        full["black_level"] = json!(95);
        let sensor = sensor(full);
        assert_eq!(sensor.bands().count(), bands, "{spec}");
        for (white, expected) in sensor.white_response().iter().zip(&channels) {
            assert!((white - expected).abs() < 1e-9, "{spec}: {white}");
        }
        assert_eq!(sensor.channels().len(), channels.len());
        for (light, expected) in [(0.0, 95), (0.5, 2095), (1.0, 4095), (2.0, 4095)] {
            let image = exposed(&sensor, light, 0.01);
            assert!(
                image.values.iter().all(|&y| y == expected),
                "{spec} {light}: {:?}",
                image.values[0]
            );
        }
    }
}

#[test]
fn in_digital_mode_exposure_moves_the_dark_signal_alone() {
    let sensor = sensor(json!({
        "type": "raw", "resolution": [4, 4], "noise": "none", "bit_depth": 12, "system_gain": 0.5,
        "dark_current": 1000,
    }));
    for (exposure, expected) in [(0.01, 2048 + 5), (0.1, 2048 + 50), (1.0, 2048 + 500)] {
        assert_eq!(exposed(&sensor, 0.500_122_1, exposure).values[0], expected);
    }
}

#[test]
fn photons_become_electrons_by_the_closed_form() {
    // h·c of the SI, A = (3.45 µm)², ∫ λ dλ = (780² − 380²)/2 nm².
    let (hc, area) = (6.626_070_15e-34 * 299_792_458.0, 3.45e-6f64.powi(2));
    let spec = json!({
        "type": "raw", "resolution": [4, 4], "noise": "none", "system_gain": 0.01, "pixel_pitch": 3.45,
        "quantum_efficiency": 0.6, "radiometry": "physical", "black_level": 100, "bit_depth": 16,
    });
    let ramp = |from: f64, to: f64| 0.5e-9 * (to * to - from * from);
    let visible = 0.6 * area / hc * ramp(380.0, 780.0);
    let mono = sensor(spec.clone());
    assert!((mono.electrons_per_unit(0)[0] / visible - 1.0).abs() < 1e-12);
    let irradiance = 0.02f32;
    let electrons = visible * f64::from(irradiance) * 0.005;
    let expected = (0.01 * electrons + 100.0).round();
    assert!(expected > 1000.0 && expected < 60_000.0, "{expected} is no test");
    assert_eq!(f64::from(exposed(&mono, irradiance, 0.005).values[0]), expected);
    // Bands divide the same photons, and red, green and blue do.
    let mut bands = spec.clone();
    bands["type"] = json!("multispectral");
    bands["bands"] = json!([400, 500, 650]);
    let bands = sensor(bands);
    for (channel, (from, to)) in [(400.0, 500.0), (500.0, 650.0)].into_iter().enumerate() {
        let electrons = bands.electrons_per_unit(channel);
        assert!((electrons[channel] / (0.6 * area / hc * ramp(from, to)) - 1.0).abs() < 1e-12);
        assert_eq!(electrons[1 - channel], 0.0);
    }
    let mut colour = spec;
    colour["type"] = json!("rgb");
    let colour = sensor(colour);
    let sum: f64 = (0..3).map(|k| colour.electrons_per_unit(k)[k]).sum();
    assert!((sum / visible - 1.0).abs() < 1e-9, "{}", sum / visible);
}

#[test]
fn a_clear_pixel_among_colours_catches_what_all_of_them_do() {
    let sensor = sensor(json!({ "type": "raw", "cfa": "rgbw" }));
    let white = sensor.white_response();
    assert_eq!(sensor.channels().collect::<Vec<_>>(), ["R", "G", "B", "W"]);
    assert!((white[0] + white[1] + white[2] - 1.0).abs() < 1e-9 && white[3] == 1.0, "{white:?}");
}

#[test]
fn ten_nanometres_are_fine_enough_for_every_preset() {
    // The electrons of white, pure red, green and blue in default bands against one-nanometre
    // bands, behind the Nikon's filters and without.
    let mut worst: f64 = 0.0;
    for model in Model::ALL {
        for filtered in [false, true] {
            let mut spec = json!({ "type": "raw", "model": model, "radiometry": "physical" });
            if filtered {
                spec["cfa"] = json!("rggb");
                spec["filters"] = json!("nikon_d5100");
            }
            let coarse = sensor(spec.clone());
            let Bands::Spectral(grid) = coarse.bands() else {
                panic!("{model:?} has flat efficiency")
            };
            let [from, to] = grid.range();
            spec["bands"] = json!(Grid::of_width(from, to, 1.0).unwrap());
            let fine = sensor(spec);
            let [coarse, fine] = [coarse.response_to_primaries(), fine.response_to_primaries()];
            for (coarse, fine) in coarse.iter().zip(&fine) {
                for (a, b) in coarse.iter().zip(fine) {
                    worst = worst.max((a - b).abs());
                }
            }
        }
    }
    // Of full scale; one grey value of an 8-bit picture is 3.9e-3.
    assert!(worst < 3e-3, "{worst}");
}

#[test]
fn a_sensor_may_be_asked_to_make_do_with_other_bands() {
    let spec = json!({ "type": "raw", "model": "imx183", "cfa": "rggb", "filters": "nikon_d5100" });
    let own = sensor(spec);
    let three = own.clone().in_bands(Bands::Rgb).unwrap();
    assert_eq!(three.bands(), &Bands::Rgb);
    let [own, three] = [own.response_to_primaries(), three.response_to_primaries()];
    for (own, three) in own.iter().flatten().zip(three.iter().flatten()) {
        // As far as bands of 10 nm blur the primaries, and the silicon's curve ends at 404 nm.
        assert!((own - three).abs() < 3e-3, "{own} {three}");
    }
    let bands = sensor(json!({ "type": "multispectral", "bands": [400, 500, 600] }));
    let error = bands.in_bands(Bands::Rgb).unwrap_err().to_string();
    assert!(error.contains("are the bands of its render"), "{error}");
}

#[test]
fn channels_of_a_multispectral_sensor_may_be_curves() {
    let sensor = sensor(json!({
        "type": "multispectral", "quantum_efficiency": 0.5, "radiometry": "physical",
        "system_gain": 1, "bands": { "from": 400, "to": 900, "count": 50 },
        "channels": [
            { "name": "green", "curve": [[500, 0], [550, 1], [600, 0]] },
            { "name": "nir", "curve": [[700, 0], [710, 0.8], [890, 0.8], [900, 0]] },
        ],
    }));
    assert_eq!(sensor.channels().collect::<Vec<_>>(), ["green", "nir"]);
    assert_eq!((sensor.depth(), sensor.bands().count()), (2, 50));
    let nir = sensor.electrons_per_unit(1);
    assert!(nir[..30].iter().all(|&e| e == 0.0) && nir[40] > 0.0);
    let curve = Curve::sampled(vec![[500.0, 0.0], [550.0, 0.5], [600.0, 0.0]]).unwrap();
    let ramp = Curve::sampled(vec![[400.0, 400.0], [900.0, 900.0]]).unwrap();
    let expected = integral(&[&curve, &ramp], 400.0, 900.0) * 25e-12 * 1e-9
        / (6.626_070_15e-34 * 299_792_458.0);
    let sum: f64 = sensor.electrons_per_unit(0).iter().sum();
    assert!((sum / expected - 1.0).abs() < 1e-9, "{}", sum / expected);
}

#[test]
fn colours_come_back_in_the_preview() {
    let colours = [[0.8f64, 0.4, 0.2], [0.1, 0.5, 0.3], [1.0, 1.0, 1.0], [0.2, 0.2, 0.6]];
    for spec in [
        json!({ "type": "rgb" }),
        json!({ "type": "raw", "cfa": "bggr" }),
        json!({ "type": "raw", "cfa": "rgbw" }),
        json!({ "type": "raw", "cfa": "rggb", "filters": "nikon_d5100" }),
        json!({ "type": "raw", "cfa": "grbg", "model": "imx183", "full_well": 1e6 }),
        json!({ "type": "rgb", "quantum_efficiency": [[400, 0.2], [700, 0.8]] }),
        json!({ "type": "multispectral", "bands": { "from": 380, "to": 780, "count": 80 } }),
    ] {
        let mut full = spec.clone();
        full["resolution"] = json!([8, 8]);
        full["bit_depth"] = json!(16);
        full["system_gain"] = json!(1);
        full["noise"] = json!("none");
        let sensor = sensor(full);
        for colour in colours {
            let bands: Vec<f32> = sensor
                .bands()
                .from_rgb()
                .iter()
                .map(|row| (0..3).map(|k| row[k] * colour[k]).sum::<f64>() as f32)
                .collect();
            let film: Vec<f32> = bands.iter().copied().cycle().take(64 * bands.len()).collect();
            let image =
                sensor.expose(Film { values: &film }, sensor.shots().next().unwrap(), 0).unwrap();
            let preview = sensor.preview(&image, Method::Malvar, 1.0);
            assert_eq!(preview.len(), 64 * 3);
            let pixel = &preview[3 * 27..3 * 28];
            for (&byte, linear) in pixel.iter().zip(colour) {
                let expected = 255.0 * etendue_spectrum::colour::srgb_encode(linear);
                // Five-nanometre bands blur colours a little; rounding does the rest.
                assert!((f64::from(byte) - expected).abs() < 2.0, "{spec} {colour:?}: {pixel:?}");
            }
        }
    }
}

#[test]
fn shots_are_every_frame_of_every_exposure() {
    let sensor = sensor(json!({
        "type": "raw", "exposures": [0.01, 0.1], "frames": 3, "system_gain": 1, "resolution": [2, 2],
    }));
    let shots: Vec<(f64, u32)> = sensor.shots().map(|shot| (shot.exposure, shot.frame)).collect();
    assert_eq!(shots, [(0.01, 0), (0.01, 1), (0.01, 2), (0.1, 3), (0.1, 4), (0.1, 5)]);
}

#[test]
fn warmth_doubles_the_dark_current() {
    let dark = |keys: Value| {
        let mut spec = json!({
            "type": "raw", "system_gain": 1, "dark_current": 100, "dark_current_doubling": 8,
        });
        for (key, value) in keys.as_object().unwrap() {
            spec[key] = value.clone();
        }
        sensor(spec).dark_current()
    };
    assert_eq!(dark(json!({})), 100.0);
    assert!((dark(json!({ "temperature": 301.15 })) - 200.0).abs() < 1e-9);
    assert!((dark(json!({ "temperature": 309.15 })) - 400.0).abs() < 1e-9);
    let cold = json!({ "temperature": 300, "dark_current_temperature": 308 });
    assert!((dark(cold) - 50.0).abs() < 1e-9);
}
