//! Parts of real chips in a scene: metered exposures, maps of defects, second read-outs, angles, photodiodes, diffusion.

use std::f64::consts::PI;

use serde_json::{Value, json};

use crate::run::{Bench, read_npy, text};

/// A sensor that counts photons behind a wall that shines evenly.
fn wall(sensor: &Value, more: &Value) -> Bench {
    let mut all = json!({
        "type": "raw", "resolution": [8, 6], "system_gain": 0.5, "bit_depth": 14, "black_level": 100,
        "radiometry": "physical", "noise": "none",
    });
    for (key, value) in sensor.as_object().unwrap() {
        all[key] = value.clone();
    }
    let mut scene = json!({
        "etendue": 1,
        "camera": {
            "type": "pinhole", "fov": 60, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] }, "sensor": all
        },
        "tracer": { "type": "flat" },
        "objects": [{ "shape": "rectangle", "width": 99, "height": 99, "material": "paint" }],
        "materials": { "paint": { "type": "matte", "color": [2e-5, 2e-5, 2e-5] } },
    });
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    Bench::with_scene(&scene.to_string())
}

fn refused(bench: &Bench, more: &[&str]) -> String {
    bench.refusal(&[&["render", "scene.json", "-o", "out", "--quiet"], more].concat())
}

/// Frames of different light have the exposure of the first, or each its own where that is asked for; a run that
/// does not render the first finds it in the folder, or is refused.
#[test]
fn all_frames_have_the_exposure_of_the_first() {
    let frames = json!([
        {}, { "materials.paint.color": [4e-5, 4e-5, 4e-5] }, { "materials.paint.color": [1e-5, 1e-5, 1e-5] }
    ]);
    let metering = |each: bool| json!({ "auto_exposure": { "percentile": 90, "target": 0.4, "each_frame": each } });
    let metered = |bench: &Bench, frame: u32| {
        let sidecar = bench.json(&format!("out/frames/00000{frame}/sensor.json"));
        assert_eq!(sidecar["shots"][0]["exposure_s"], sidecar["metered_exposure_s"]);
        sidecar["metered_exposure_s"].as_f64().unwrap()
    };
    let bench = wall(&metering(false), &json!({ "frames": frames }));
    insta::assert_snapshot!(refused(&bench, &["--frames", "1..3"]), @"
    error: camera.sensor.auto_exposure: all frames have the exposure that is metered on frame 0, which is neither rendered by this run nor in out
    hint: render it first, give sensor.exposure, or set camera.sensor.auto_exposure.each_frame=true
    ");
    bench.render(&["--frames", "0..1"]);
    bench.render(&["--frames", "1..3"]);
    let first = metered(&bench, 0);
    assert_eq!([metered(&bench, 1), metered(&bench, 2)], [first; 2]);
    // 0.4 of the converter's (2¹⁴ − 1 − 100) above black; twice that in the second frame.
    let levels =
        [0, 1].map(|frame| read_npy(&bench.path(&format!("out/frames/00000{frame}/raw.npy")))[0]);
    let target = 0.4 * (16_383.0 - 100.0);
    assert!((levels[0] - 100.0 - target).abs() <= 1.0, "{}", levels[0]);
    assert!((levels[1] - 100.0 - 2.0 * target).abs() <= 1.5, "{}", levels[1]);
    let bench = wall(&metering(true), &json!({ "frames": frames }));
    bench.render(&[]);
    let times = [0, 1, 2].map(|frame| metered(&bench, frame));
    // Light is f32.
    assert!(
        (times[0] / times[1] - 2.0).abs() < 1e-5 && (times[2] / times[0] - 2.0).abs() < 1e-5,
        "{times:?}"
    );
}

/// Pictures of a folder have the exposure of the first; and what moves has to know the exposure beforehand.
#[test]
fn an_exposure_is_metered_once_and_never_while_things_move() {
    let metering = json!({ "auto_exposure": { "percentile": 50, "target": 0.5 } });
    let moving = json!({ "objects": [{
        "shape": "sphere", "material": "paint", "motion": { "type": "velocity", "velocity": [1, 0, 0] }
    }] });
    insta::assert_snapshot!(refused(&wall(&metering, &moving), &[]), @"
    error: scene.json, line 1, column 73: camera.sensor.auto_exposure: how long the shutter is open is known when the light is, and what moves or changes has to know it before
    hint: give the shutter its `exposure`, or the sensor the `exposure` that a render of the still scene reports
    ");
    let shutter = json!({
        "type": "pinhole", "fov": 60, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
        "shutter": { "exposure": 1e-3 },
        "sensor": {
            "type": "raw", "resolution": [8, 6], "system_gain": 0.5, "bit_depth": 14, "radiometry": "physical",
            "auto_exposure": metering["auto_exposure"]
        },
    });
    // Nor is there one to judge samples by.
    let judged = json!({ "render": { "samples": { "until": "sensor-noise" } } });
    let second = json!({ "second_readout": { "type": "split_pixel", "ratio": 0.1 } });
    insta::assert_snapshot!(refused(&wall(&metering, &judged), &[]), @"
    error: scene.json, line 1, column 73: camera.sensor.auto_exposure: `render.samples` until the sensor's noise goes by one plain read-out at an exposure that is known beforehand
    hint: give it a number of samples or a `relative_error`, or leave this out
    ");
    insta::assert_snapshot!(refused(&wall(&second, &judged), &[]), @"
    error: scene.json, line 1, column 164: camera.sensor.second_readout: `render.samples` until the sensor's noise goes by one plain read-out at an exposure that is known beforehand
    hint: give it a number of samples or a `relative_error`, or leave this out
    ");
    let mut open = moving;
    open["camera"] = shutter;
    wall(&metering, &open).render(&[]);
    let bench = wall(&metering, &json!({}));
    std::fs::create_dir(bench.path("light")).unwrap();
    for (name, level) in [("light/0.npy", 1.0), ("light/1.npy", 2.0)] {
        bench.write(name, &crate::expose::npy(&[6, 8], &[1e-3 * level; 48]));
    }
    let output =
        bench.run(&["expose", "light", "--sensor", "scene.json", "--unit", "W/m2/nm", "-o", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let metered = |frame: u32| {
        bench.json(&format!("out/frames/00000{frame}/sensor.json"))["metered_exposure_s"].clone()
    };
    assert!(metered(0).as_f64().unwrap() > 0.0);
    assert_eq!(metered(0), metered(1));
}

/// A map as a PNG and as the NPY of the same numbers are the list of them; others are refused by name.
#[test]
fn maps_of_defects_are_read() {
    let numbers = |at: usize| match at {
        9 => 2_u8,
        20 => 3,
        _ => 0,
    };
    let with = |map: &str| {
        wall(
            &json!({ "noise": "poisson", "defect_map": map }),
            &json!({ "tracer": { "type": "flat" } }),
        )
    };
    let png = |bench: &Bench, size: [u32; 2], value: &dyn Fn(usize) -> u8| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        let data: Vec<u8> = (0..(size[0] * size[1]) as usize).map(value).collect();
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
        bench.write("map.png", &bytes);
    };
    let npy = |bench: &Bench| {
        let mut header = "{'descr': '<f4', 'fortran_order': False, 'shape': (6, 8), }".to_owned();
        header.push_str(&" ".repeat(118 - header.len() - 1));
        header.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(header.bytes());
        (0..48).for_each(|at| bytes.extend(f32::from(numbers(at)).to_le_bytes()));
        bench.write("map.npy", &bytes);
    };
    for map in ["map.png", "map.npy"] {
        let bench = with(map);
        png(&bench, [8, 6], &|at| numbers(at));
        npy(&bench);
        bench.render(&[]);
        let raw = bench.array("raw");
        assert_eq!((raw[9], raw[20]), (100.0, 16_383.0), "{map}");
        assert!(
            raw.iter().enumerate().all(|(at, y)| numbers(at) > 0 || (*y > 110.0 && *y < 16_000.0))
        );
        let defects = bench.json("out/sensor.json")["defects"].clone();
        assert_eq!(
            defects,
            json!([{ "column": 1, "row": 1, "kind": "dead" }, { "column": 4, "row": 2, "kind": "stuck" }])
        );
    }
    let bench = with("map.png");
    png(&bench, [8, 5], &|_| 0);
    insta::assert_snapshot!(refused(&bench, &[]), @"error: scene.json, line 1, column 106: camera.sensor.defect_map: has 8 columns and 5 rows, the sensor [8,6]: give a map of the sensor's own");
    png(&bench, [8, 6], &|at| u8::from(at == 17) * 9);
    insta::assert_snapshot!(refused(&bench, &[]), @r#"error: scene.json, line 1, column 106: camera.sensor.defect_map: "map.png" has the number 9 at column 1, row 2: 0 is a good pixel, 1 a hot, 2 a dead and 3 a stuck one"#);
    insta::assert_snapshot!(refused(&with("none.png"), &[]), @r#"error: scene.json, line 1, column 106: camera.sensor.defect_map: "none.png" no such file: "none.png""#);
}

/// Both numbers of a pixel have their files, and the merged picture has what neither could hold.
#[test]
fn second_numbers_have_their_files() {
    let bench = wall(
        &json!({
            "hdr": true, "full_well": 1000, "exposure": 0.1,
            "second_readout": { "type": "split_pixel", "ratio": 0.01, "full_well": 20_000 },
        }),
        &json!({}),
    );
    bench.render(&[]);
    let [first, second, merged] = ["raw", "raw_second", "raw_hdr"].map(|name| bench.array(name)[0]);
    assert_eq!(first, 600.0, "full");
    let electrons = (second - 100.0) / 0.5;
    assert!(electrons > 20.0 && electrons < 20_000.0, "{electrons}");
    // Of the first photodiode: a hundred times, over a tenth of a second.
    assert!((merged / (electrons / 0.01 / 0.1) - 1.0).abs() < 1e-6, "{merged} {electrons}");
    assert_eq!(bench.json("out/sensor.json")["shots"][0]["second"], "raw_second.npy");
    assert!(bench.path("out/raw_second.png").exists());
}

/// A white image over one without falls off as the curve says, at each pixel by its own angle; lenses that are shifted for
/// the angle of the corner see all of it there.
#[test]
fn a_white_image_has_the_curve_of_angles() {
    let curve = [[0.0, 1.0], [10.0, 0.97], [20.0, 0.85], [30.0, 0.6], [40.0, 0.4]];
    let size = [60, 40];
    let white = |response: Option<Value>| {
        let mut sensor =
            json!({ "resolution": size, "bit_depth": 16, "black_level": 0, "exposure": 0.1 });
        if let Some(response) = response {
            sensor["angular_response"] = response;
        }
        let bench = wall(&sensor, &json!({}));
        bench.render(&[]);
        bench.array("raw")
    };
    let plain = white(None);
    let middle = plain.iter().sum::<f64>() / plain.len() as f64;
    assert!((20_000.0..60_000.0).contains(&middle), "{middle}");
    let centred = white(Some(json!({ "curve": curve })));
    // A picture of 60 degrees over 40 rows: the pinhole's distance in pixels.
    let distance = 20.0 / (30.0_f64.to_radians()).tan();
    let at = |angle: f64| {
        let k = curve.iter().rposition(|point| point[0] <= angle).unwrap().min(curve.len() - 2);
        let [[a, from], [b, to]] = [curve[k], curve[k + 1]];
        (from + (to - from) * (angle - a) / (b - a)).max(0.4)
    };
    let corner = 30.0_f64.hypot(20.0);
    let design = (corner / distance).atan().to_degrees();
    let shifted = white(Some(json!({ "curve": curve, "lens_shift": design })));
    for (place, plain) in plain.iter().enumerate() {
        let [x, y] = [(place % 60) as f64 - 29.5, (place / 60) as f64 - 19.5];
        let radius = x.hypot(y);
        let angle = (radius / distance).atan().to_degrees();
        let found = centred[place] / plain;
        assert!((found / at(angle) - 1.0).abs() < 2e-3, "{x} {y}: {found} for {}", at(angle));
        let found = shifted[place] / plain;
        let expected = at((angle - design * radius / corner).abs());
        assert!((found / expected - 1.0).abs() < 2e-3, "{x} {y}: {found} for {expected}");
    }
    // The angle and the way to the corner go nearly together: never six degrees apart.
    assert!(shifted.iter().zip(&plain).all(|(a, b)| a / b > 0.982));
}

/// A lens of 50 mm at f/2, focused at 1 m, before a small lamp at 2 m: of 0.8 mm, which enough rays find to place its disc
/// to 0.1 %; its size moves no centroid.
fn lamp(sensor: &Value) -> Bench {
    let scene = json!({
        "etendue": 1,
        "camera": {
            "type": "thin_lens", "focal_length": "50 mm", "f_number": 2, "focus_distance": "1 m",
            "sensor": sensor, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
        },
        "tracer": { "type": "direct" }, "render": { "samples": 1024 },
        "objects": [{ "shape": "disk", "radius": 8e-4, "material": "lamp" }],
        "materials": { "lamp": { "type": "emissive", "radiance": [100, 100, 100] } },
        "lights": [],
    });
    Bench::with_scene(&scene.to_string())
}

/// The halves of a defocused point are 8r/(3π) apart within 1 %, r being the radius of its disc by the thin lens' formula;
/// they and the quarters are the whole pixel, in the light to its rounding and in the sensor's electrons to the bit.
#[test]
fn halves_of_a_defocused_point_are_apart_and_make_the_whole() {
    let bench = lamp(&json!({
        "type": "raw", "resolution": [160, 120], "pixel_pitch": 5.0, "photodiodes": "dual",
        "noise": "none", "system_gain": 1, "bit_depth": 16,
    }));
    bench.render(&["--layers", "left_pupil,right_pupil"]);
    let plane =
        |name: &str| -> Vec<f64> { bench.array(name).chunks_exact(3).map(|rgb| rgb[0]).collect() };
    let (left, right, whole) = (plane("left_pupil"), plane("right_pupil"), plane("picture"));
    for ((l, r), w) in left.iter().zip(&right).zip(&whole) {
        // Each of the three is rounded to f32.
        assert!((l + r - w).abs() <= 3.0 * f64::from(f32::EPSILON) * w, "{l} {r} {w}");
    }
    let centroid = |plane: &[f64]| {
        let moment: f64 = plane.iter().enumerate().map(|(at, v)| (at % 160) as f64 * v).sum();
        moment / plane.iter().sum::<f64>()
    };
    // Images of 1 m and 2 m lie at 1/(1/f − 1/d); the aperture's radius is f/(2N).
    let image = |distance: f64| 1.0 / (1.0 / 0.05 - 1.0 / distance);
    let radius = 0.0125 * (image(1.0) - image(2.0)) / image(2.0) / 5e-6;
    let apart = centroid(&left) - centroid(&right);
    let expected = 8.0 * radius / (3.0 * PI);
    assert!((apart.abs() / expected - 1.0).abs() < 0.01, "{apart} for {expected} px");
    // Whole numbers of electrons: to the bit.
    let [left, right, whole] = ["raw_left", "raw_right", "raw"].map(|name| bench.array(name));
    for ((l, r), w) in left.iter().zip(&right).zip(&whole) {
        // Each of the three is rounded to a number.
        assert!((l + r - w).abs() <= 1.5, "{l} {r} {w}");
    }
    assert!(left != right && left.iter().sum::<f64>() > 1e4);
}

/// Parts of the pupil, angles and diffusion are refused by name where the camera has none.
#[test]
fn what_a_camera_has_not_is_refused() {
    let dual = json!({ "photodiodes": "dual" });
    let pinhole = wall(&dual, &json!({ "tracer": { "type": "direct" } }));
    insta::assert_snapshot!(refused(&pinhole, &[]), @"
    error: scene.json, line 1, column 121: camera.sensor.photodiodes: parts of the pupil want a camera with one lens
    hint: take a `thin_lens`, `real_lens` or `lens`, or leave this out
    ");
    let flat = lamp(&json!({ "photodiodes": "dual", "pixel_pitch": 5.0 }));
    insta::assert_snapshot!(refused(&flat, &["--set", "tracer={\"type\": \"flat\"}"]), @r#"
    error: scene.json, line 1, column 123: camera.sensor.photodiodes: base colours come through no pupil
    hint: give the scene a `tracer` of light, such as {"type": "path"}
    "#);
    let parts = json!({ "layers": ["left_pupil"], "tracer": { "type": "direct" } });
    insta::assert_snapshot!(refused(&wall(&json!({}), &parts), &[]), @"
    error: scene.json, line 1, column 236: layers[0]: parts of the pupil want a camera with one lens
    hint: take a `thin_lens`, `real_lens` or `lens`, or leave this out
    ");
    // A picture from elsewhere says nothing of a pupil.
    let bench = wall(&dual, &json!({}));
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (6, 8), }";
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").bytes());
    bytes.extend([0; 4 * 48]);
    bench.write("light.npy", &bytes);
    let expose =
        ["expose", "light.npy", "--sensor", "scene.json", "--unit", "W/m2/nm", "-o", "out"];
    insta::assert_snapshot!(bench.refusal(&expose), @"error: scene.json, line 1, column 121: camera.sensor.photodiodes: is of no use here: a picture from elsewhere does not say through which part of the pupil its light came");
    let rolling = json!({
        "camera": {
            "type": "pinhole", "fov": 60, "shutter": { "type": "rolling", "exposure": 0.01, "line_time": 1e-5 },
            "sensor": { "type": "raw", "resolution": [8, 6], "carrier_diffusion": 0.5 },
        },
    });
    insta::assert_snapshot!(refused(&wall(&json!({}), &rolling), &[]), @"
    error: scene.json, line 1, column 31: camera.sensor.carrier_diffusion: a shutter looks at rows of the light, and carriers come from beside them
    hint: leave out `shutter`, or this
    ");
}

/// Across a slanted edge the modulation is that of the pixel times that of the diffusion, exp(−2π²σ²f²), within 0.5 %.
#[test]
fn diffusion_and_pixels_have_the_modulation_of_their_formula() {
    let slant = 5.0_f64.to_radians();
    for sigma in [0.0, 0.35] {
        let scene = json!({
            "etendue": 1,
            "camera": {
                "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                "sensor": {
                    "type": "raw", "resolution": [128, 128], "pixel_pitch": 4.0, "carrier_diffusion": 4.0 * sigma,
                    "bit_depth": 16,
                },
            },
            "tracer": { "type": "flat" }, "render": { "samples": 256 },
            "objects": [
                { "shape": "rectangle", "width": 2, "height": 4, "material": "dark",
                  "transform": { "translate": [-slant.cos(), -slant.sin(), 0], "rotate": [0, 0, 1, 5] } },
                { "shape": "rectangle", "width": 2, "height": 4, "material": "bright",
                  "transform": { "translate": [slant.cos(), slant.sin(), 0], "rotate": [0, 0, 1, 5] } },
            ],
            "materials": {
                "dark": { "type": "matte", "color": [0.1, 0.1, 0.1] },
                "bright": { "type": "matte", "color": [0.9, 0.9, 0.9] },
            },
        });
        let bench = Bench::with_scene(&scene.to_string());
        bench.render(&[]);
        let output = bench.run(&["edge", "out/raw.png", "--raw", "--json", "--quiet"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let modulation = report["channels"][0]["modulation"].as_array().unwrap().clone();
        let mut seen = 0;
        for point in modulation {
            let [f, found] = [0, 1].map(|k| point[k].as_f64().unwrap());
            if !(0.02..=0.5).contains(&f) {
                continue;
            }
            let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
            let pixel = sinc(f * slant.cos()) * sinc(f * slant.sin());
            let expected = pixel * (-2.0 * (PI * sigma * f).powi(2)).exp();
            assert!((found - expected).abs() < 5e-3, "{sigma} at {f}: {found} for {expected}");
            seen += 1;
        }
        assert!(seen > 20, "{seen}");
    }
}
