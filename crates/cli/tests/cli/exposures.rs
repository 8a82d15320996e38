//! Sensor's images of a render.

use serde_json::{Value, json};

use crate::run::{Bench, notes_in, text, under};

/// A wall of one colour that fills the picture, before `sensor`.
fn wall(color: [f64; 3], sensor: &Value) -> Bench {
    let scene = json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 1, "sensor": sensor,
            "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] }
        },
        "tracer": { "type": "flat" },
        "objects": [{ "shape": "rectangle", "width": 9, "height": 9, "material": "paint" }],
        "materials": { "paint": { "type": "matte", "color": color } }
    });
    Bench::with_scene(&scene.to_string())
}

fn exists(bench: &Bench, name: &str) -> bool {
    bench.path("out").join(name).exists()
}

#[test]
fn a_grid_of_pixels_alone_exposes_nothing() {
    let bench = wall([0.5; 3], &json!({ "resolution": [8, 4], "pixel_pitch": "3.45 um" }));
    bench.render(&[]);
    assert!(!exists(&bench, "raw.png") && !exists(&bench, "sensor.json"));
}

#[test]
fn without_noise_numbers_are_those_of_the_light() {
    let bench = wall(
        [0.25; 3],
        &json!({ "type": "raw", "resolution": [8, 4], "bit_depth": 10, "black_level": 23 }),
    );
    bench.render(&[]);
    // Black, and a quarter of what is left: 23 + 0.25 · 1000.
    assert_eq!(bench.array("raw"), [273.0; 32]);
    let (bits, values) = png16(&bench, "raw.png");
    assert_eq!((bits, values), (16, vec![273; 32]));
    let sidecar = bench.json("out/sensor.json");
    assert_eq!((&sidecar["bits"], &sidecar["shots"][0]["png"]), (&10.into(), &"raw.png".into()));
    assert!(exists(&bench, "raw.dng") && exists(&bench, "raw.preview.png"));
    assert!(!exists(&bench, "raw_mean.npy"), "nobody asked for moments");
}

#[test]
fn filters_see_their_own_colour() {
    let bench = wall(
        [1.0, 0.5, 0.25],
        &json!({ "type": "raw", "cfa": "grbg", "resolution": [4, 2], "bit_depth": 8 }),
    );
    bench.render(&[]);
    // Rows GRGR and BGBG; halves round to even.
    assert_eq!(bench.array("raw"), [128.0, 255.0, 128.0, 255.0, 64.0, 128.0, 64.0, 128.0]);
}

#[test]
fn frames_share_the_light_and_the_pattern_but_not_the_noise() {
    let bench = wall(
        [0.4; 3],
        &json!({
            "type": "raw", "resolution": [64, 64], "system_gain": 1, "bit_depth": 12, "dsnu": 20,
            "read_noise": 1, "exposures": ["10 ms", 0.1], "frames": 2, "moments": true, "serial": 4
        }),
    );
    bench.render(&[]);
    let [a, b, c] = ["raw_000", "raw_001", "raw_002"].map(|name| bench.array(name));
    assert!(a != b && b != c && !exists(&bench, "raw_004.npy"));
    let (mean, variance) = (bench.array("raw_mean_000"), bench.array("raw_variance_000"));
    assert_eq!(
        mean,
        bench.array("raw_mean_001"),
        "in digital mode without dark current, one picture"
    );
    // Poisson of 1638 e⁻, 1 e⁻ of read noise, rounding; 4096 pixels: 4 standard errors are 9 %.
    let residual: Vec<f64> = a.iter().zip(&mean).map(|(y, m)| (y - m).powi(2)).collect();
    let expected = variance.iter().sum::<f64>() / 4096.0;
    let found = residual.iter().sum::<f64>() / 4096.0;
    assert!((found / expected - 1.0).abs() < 0.09, "{found} {expected}");
    let spread = {
        let centre = mean.iter().sum::<f64>() / 4096.0;
        (mean.iter().map(|m| (m - centre).powi(2)).sum::<f64>() / 4096.0).sqrt()
    };
    // DSNU of 20 e⁻ at K = 1, from 4096 pixels: 4 standard errors are 4.4 %.
    assert!((spread / 20.0 - 1.0).abs() < 0.05, "{spread}");
    let shots = bench.json("out/sensor.json")["shots"].as_array().unwrap().clone();
    let times: Vec<f64> = shots.iter().map(|s| s["exposure_s"].as_f64().unwrap()).collect();
    assert_eq!(times, [0.01, 0.01, 0.1, 0.1]);
}

#[test]
fn bands_are_channels_named_by_wavelength() {
    let bench = wall(
        [1.0; 3],
        &json!({
            "type": "multispectral", "bands": [400, 450, 505, 600, 650], "resolution": [4, 2],
            "quantum_efficiency": 0.5, "bit_depth": 8
        }),
    );
    bench.render(&[]);
    // White is 1 in every band, and a flat efficiency makes all of them full scale.
    assert_eq!(bench.array("raw"), [255.0; 4 * 2 * 4]);
    let cube = bench.array("spectrum");
    assert!(cube.len() == 32 && cube.iter().all(|v| (v - 1.0).abs() < 1e-6), "{cube:?}");
    let layers = bench.json("out/layers.json").to_string();
    assert!(layers.contains("S0.425,0nm") && layers.contains("S0.477,5nm"), "{layers}");
    assert!(exists(&bench, "raw.preview.png") && !exists(&bench, "raw.png"));
}

#[test]
fn physical_light_is_counted_by_area_time_and_energy() {
    // 1e-4 W·m⁻²·nm⁻¹ over 380 to 780 nm on 4 µm pixels for 10 ms at η = 0.5:
    // E·A·T·η/(hc) · ∫ λ dλ = 1e-4 · 16e-12 · 0.01 · 0.5/1.986446e-25 · 2.32e5 · 1e-9 (nm → m).
    let expected = 1e-4 * 16e-12 * 0.01 * 0.5 / 1.986_445_857e-25 * 2.32e5 * 1e-9;
    let bench = wall(
        [1e-4; 3],
        &json!({
            "type": "raw", "resolution": [4, 2], "pixel_pitch": 4, "quantum_efficiency": 0.5,
            "system_gain": 1, "noise": "none", "radiometry": "physical", "exposure": 0.01
        }),
    );
    bench.render(&[]);
    // Rounded to a DN; the film's f32 is finer.
    for y in bench.array("raw") {
        assert!((y - expected).abs() <= 0.51, "{y} {expected}");
    }
}

#[test]
fn a_model_brings_its_pixels_and_pitch() {
    let bench = wall(
        [0.5; 3],
        &json!({ "type": "raw", "model": "mt9m031", "cfa": "rgbw", "noise": "none" }),
    );
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(bench.array("raw").len(), 1280 * 960);
    assert_eq!(bench.json("out/camera.json")["resolution"], json!([1280, 960]));
    insta::assert_snapshot!(notes_in(&text(&output.stderr)), @"note: no DNG is written: DNG has no filter `w`");
    assert!(!exists(&bench, "raw.dng"));
}

#[test]
fn a_sensor_without_a_picture_is_told_so() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "layers": ["depth"], "objects": [{"shape": "box"}],
            "camera": {"type": "pinhole", "sensor": {"type": "raw", "resolution": [4, 4]}}}"#,
    );
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    insta::assert_snapshot!(notes_in(&text(&output.stderr)), @"note: camera.sensor is not used: the scene has layers and no tracer: there is no picture for the sensor to expose");
    let plan = text(&bench.run(&["plan", "scene.json"]).stdout);
    assert!(plan.contains("sensor") && plan.contains("no tracer"), "{plan}");
}

#[test]
fn a_scenes_sensor_is_refused_by_its_path() {
    let sensors = [
        json!({ "quantum_efficiency": 2 }),
        json!({ "bit_depth": 0 }),
        json!({ "system_gain": -1 }),
        json!({ "exposure": 0 }),
        json!({ "exposure": "3 parsec" }),
        json!({ "pixel_pitch": "3 parsec" }),
        json!({ "resolution": [0, 1] }),
        json!({ "type": "bayer" }),
        json!({ "red_noise": 1 }),
        json!({ "type": "rgb", "quantum_efficiency": [[900, 0.5], [1000, 0.5]] }),
    ];
    let messages = sensors.map(|sensor| {
        let bench = wall([0.5; 3], &sensor);
        let message = bench.refusal(&["render", "scene.json", "-o", "out"]);
        assert!(!bench.path("out").exists(), "something was left behind");
        under(&sensor.to_string(), &message)
    });
    insta::assert_snapshot!(messages.concat());
}

/// Bits a sample and the numbers of a grey PNG.
fn png16(bench: &Bench, name: &str) -> (u8, Vec<u16>) {
    let file = std::fs::File::open(bench.path("out").join(name)).expect("a PNG");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut bytes).expect("pixels");
    let values = bytes.as_chunks().0.iter().map(|&b| u16::from_be_bytes(b)).collect();
    (info.bit_depth as u8, values)
}

/// A bracket merged: a bright and a dark wall, of which no single exposure has both, in the electrons that the light
/// makes; what is told of each pixel's noise is its noise, and defects are listed.
#[test]
fn a_bracket_is_merged() {
    let sensor = |keys: Value| {
        let mut sensor = json!({
            "type": "raw", "resolution": [64, 64], "system_gain": 0.25, "bit_depth": 12, "black_level": 40,
            "read_noise": 3, "full_well": 15000, "exposures": ["1 s", "10 ms", "0.1 ms"], "hdr": true,
            "radiometry": "physical",
        });
        for (key, value) in keys.as_object().unwrap() {
            sensor[key] = value.clone();
        }
        sensor
    };
    let rates: Vec<f64> = [1e-3, 1e-6]
        .map(|light| {
            let bench = wall([light; 3], &sensor(json!({})));
            bench.render(&[]);
            let (rate, sigma) = (bench.array("raw_hdr"), bench.array("raw_hdr_sigma"));
            let mean = rate.iter().sum::<f64>() / 4096.0;
            let spread = (rate.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 4095.0).sqrt();
            // 4096 pixels: a deviation is known to 1/√(2n), times five, and a told one by the pixel's own rate.
            assert!((spread / (sigma.iter().sum::<f64>() / 4096.0) - 1.0).abs() < 0.06);
            let sidecar = bench.json("out/sensor.json");
            assert_eq!(sidecar["hdr"], json!(["raw_hdr.npy", "raw_hdr_sigma.npy"]));
            assert!(sidecar["defects"].is_null());
            mean
        })
        .into();
    // The light is a thousand times less, within the noise of the darker one.
    assert!((rates[0] / rates[1] / 1000.0 - 1.0).abs() < 0.05, "{rates:?}");
    // What the shortest cannot hold is said.
    let bench = wall([1e-3; 3], &sensor(json!({ "exposures": ["1000 s", "2000 s"] })));
    let told = bench.run(&["render", "scene.json", "-o", "out"]);
    assert!(text(&told.stderr).contains("hdr: 4096 of 4096 numbers are saturated"), "{told:?}");
    assert!(bench.array("raw_hdr_sigma").iter().all(|sigma| *sigma == f64::INFINITY));
    // Dead pixels are listed where they are.
    let bench = wall([1e-3; 3], &sensor(json!({ "dead_pixels": 0.01 })));
    bench.render(&[]);
    let defects = bench.json("out/sensor.json")["defects"].clone();
    let defects = defects.as_array().unwrap();
    assert!((15..75).contains(&defects.len()), "{}", defects.len());
    let (rate, at) = (bench.array("raw_hdr"), &defects[0]);
    let place = at["row"].as_u64().unwrap() * 64 + at["column"].as_u64().unwrap();
    assert_eq!(at["kind"], "dead");
    assert!(rate[usize::try_from(place).unwrap()].abs() < 0.01 * rates[0]);
    // What cannot be merged is refused, by key.
    let refused = |keys: Value| {
        let bench = wall([1e-3; 3], &sensor(keys));
        bench.refusal(&["render", "scene.json", "-o", "out"])
    };
    insta::assert_snapshot!(refused(json!({ "radiometry": "digital" })), @"
    error: scene.json, line 1, column 162: camera.sensor.hdr: is of no use here: with radiometry `digital` longer exposures have no more light
    hint: set `physical`
    ");
    insta::assert_snapshot!(refused(json!({ "exposures": ["1 s"] })), @"error: scene.json, line 1, column 107: camera.sensor.exposures: is missing: sensor.hdr merges several: name their times, or a second_readout");
}
