//! Calibration sets of a scene's camera, and photographs matched by it.

#![expect(clippy::cast_possible_truncation, reason = "pixels of a small picture")]

use serde_json::{Value, json};

use crate::run::{Bench, read_npy, text, under};

/// A thin lens before a step chart: rectangles side by side, each darker than the one before.
fn chart(sensor: &Value) -> Value {
    let mut own = json!({
        "type": "raw", "resolution": [96, 64], "pixel_pitch": 6.0, "system_gain": 0.4, "read_noise": 3.0,
        "black_level": 64, "bit_depth": 12, "full_well": 20_000, "prnu": 0.003, "radiometry": "physical",
        "exposure": 0.02,
    });
    for (key, value) in sensor.as_object().unwrap() {
        own[key] = value.clone();
    }
    let patches: Vec<Value> = (0..12)
        .map(|k| {
            let x = (f64::from(k % 4) - 1.5) * 0.16;
            let y = (f64::from(k / 4) - 1.0) * 0.16;
            json!({
                "shape": "rectangle", "width": 0.16, "height": 0.16, "material": format!("step{k}"),
                "transform": { "translate": [x, y, 0] },
            })
        })
        .collect();
    let materials: serde_json::Map<String, Value> = (0..12)
        .map(|k| {
            let level = 3e-4 * 10.0_f64.powf(-f64::from(k) * 0.15);
            (format!("step{k}"), json!({ "type": "matte", "color": [level, level, level] }))
        })
        .collect();
    json!({
        "etendue": 1,
        "camera": {
            "type": "thin_lens", "focal_length": "1 mm", "f_number": 4, "focus_distance": "1 m",
            "pose": { "from": [0, 0, 1], "look_at": [0, 0, 0] }, "sensor": own,
        },
        "tracer": { "type": "flat" }, "render": { "samples": 16 },
        "objects": patches, "materials": materials,
    })
}

fn bench(sensor: &Value) -> Bench {
    Bench::with_scene(&chart(sensor).to_string())
}

fn moments(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    [mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count]
}

/// Darks, flats and white images are those of the sensor at its settings: levels, gain by photon transfer, and the mean of
/// the frames; the chessboard's corners lie where its squares meet.
#[test]
fn a_set_is_of_the_scenes_own_camera() {
    let bench = bench(&json!({ "prnu": 0 }));
    let output = bench.run(&[
        "calibrate",
        "scene.json",
        "-o",
        "out",
        "--quiet",
        "--frames",
        "4",
        "--boards",
        "3",
        "--squares",
        "6,4",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let (dark, flat) = (bench.array("dark_000"), bench.array("flat_000"));
    let ([black, of_dark], [bright, of_flat]) = (moments(&dark), moments(&flat));
    // 6144 pixels: five errors of a mean and of a variance.
    let errors = 5.0 / 6144.0_f64.sqrt();
    assert!((black - 64.0).abs() < errors * of_dark.sqrt(), "{black}");
    let saturation = (4095.0 - 64.0_f64).min(0.4 * 20_000.0);
    assert!(
        (bright - 64.0 - 0.5 * saturation).abs() < errors * of_flat.sqrt() + 2e-3 * saturation,
        "{bright}"
    );
    let gain = (of_flat - of_dark) / (bright - black);
    assert!((gain / 0.4 - 1.0).abs() < errors * 2.0_f64.sqrt() * 1.2, "{gain}");
    let frames: Vec<Vec<f64>> = (0..4).map(|k| bench.array(&format!("flat_00{k}"))).collect();
    for (at, mean) in bench.array("flat_mean").iter().enumerate() {
        let own = frames.iter().map(|frame| frame[at]).sum::<f64>() / 4.0;
        assert!((mean - own).abs() < 1e-3, "{mean} {own}");
    }
    assert_ne!(frames[0], frames[1]);
    for name in ["white_003.png", "white_000.dng", "calibration.json", "board_002_003.npy"] {
        assert!(bench.path("out").join(name).exists(), "{name}");
    }
    // About a corner two squares are dark and two bright, and opposite ones alike.
    let file = bench.json("out/calibration.json");
    let boards: Vec<&Value> =
        file["sets"].as_array().unwrap().iter().filter(|set| set["pose"].is_object()).collect();
    assert_eq!(boards.len(), 3);
    let mut seen = 0;
    for (number, board) in boards.iter().enumerate() {
        let raw = bench.array(&format!("board_{number:03}_mean"));
        let corners = board["pose"]["corners"].as_array().unwrap();
        assert_eq!(corners.len(), 15);
        for corner in corners.iter().filter(|corner| corner.is_array()) {
            let [x, y] = [0, 1].map(|k| corner[k].as_f64().unwrap());
            if !(4.0..91.0).contains(&x) || !(4.0..59.0).contains(&y) {
                continue;
            }
            let at = |dx: f64, dy: f64| {
                let [column, row] = [(x + dx).round() as usize, (y + dy).round() as usize];
                raw[row * 96 + column] - 64.0
            };
            let four = [at(-2.0, -2.0), at(2.0, -2.0), at(2.0, 2.0), at(-2.0, 2.0)];
            let [a, b] = [four[0] + four[2], four[1] + four[3]];
            assert!(a.max(b) > 4.0 * a.min(b), "board {number} at {x} {y}: {four:?}");
            assert!(
                (four[0] / four[2]).ln().abs() < 0.5 && (four[1] / four[3]).ln().abs() < 0.5,
                "{four:?}"
            );
            seen += 1;
        }
    }
    assert!(seen > 30, "{seen}");
}

/// Regions, bins and packed bytes are those of the whole; what does not fit the chip is refused by name.
#[test]
fn regions_bins_and_packed_numbers_fit_or_are_refused() {
    let bench = bench(&json!({ "cfa": "rggb" }));
    let of = |folder: &str, more: &[&str]| {
        let base =
            ["calibrate", "scene.json", "-o", folder, "--quiet", "--frames", "1", "--boards", "0"];
        let output = bench.run(&[&base[..], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
    };
    of("whole", &[]);
    of("part", &["--region", "8,4,32,16", "--binning", "2", "--packed", "raw12"]);
    let (whole, part) =
        (read_npy(&bench.path("whole/flat_000.npy")), read_npy(&bench.path("part/flat_000.npy")));
    assert_eq!(part.len(), 16 * 8);
    let four: f64 = [[8, 4], [10, 4], [8, 6], [10, 6]].iter().map(|[x, y]| whole[y * 96 + x]).sum();
    assert_eq!(part[0], (four / 4.0).round_ties_even());
    let packed = std::fs::read(bench.path("part/flat_000.raw12")).unwrap();
    assert_eq!(packed.len(), 16 * 8 * 3 / 2);
    let first = u16::from(packed[0]) << 4 | u16::from(packed[2] & 15);
    assert_eq!(f64::from(first), part[0]);
    let split = r#"camera.sensor.second_readout={"type": "split_pixel", "ratio": 0.1}"#;
    let cases: [&[&str]; 11] = [
        &["--boards", "0", "--region", "80,0,32,16"],
        &["--boards", "0", "--region", "1,0,32,16"],
        &["--boards", "0", "--binning", "5"],
        &["--boards", "0", "--packed", "raw10"],
        &[
            "--boards",
            "0",
            "--region",
            "0,0,6,4",
            "--packed",
            "raw10",
            "--set",
            "camera.sensor.bit_depth=10",
        ],
        &["--boards", "0", "--frames", "0"],
        &["--boards", "0", "--level", "1.5"],
        &["--boards", "1", "--squares", "2x6"],
        &["--boards", "1", "--square", "1 m"],
        &["--boards", "0", "--set", "camera.sensor.dark_current=1e7"],
        &["--boards", "0", "--set", split],
    ];
    let messages = cases.map(|more| {
        let base = ["calibrate", "scene.json", "-o", "none", "--quiet"];
        let why = bench.refusal(&[&base[..], more].concat());
        assert!(!bench.path("none").exists(), "{more:?}");
        under(&more.join(" "), &why)
    });
    insta::assert_snapshot!(messages.concat());
    let grid = Bench::with_scene(
        r#"{"etendue": 1, "camera": {"type": "pinhole"}, "objects": [{"shape": "sphere"}]}"#,
    );
    insta::assert_snapshot!(grid.refusal(&["calibrate", "scene.json", "-o", "out"]), @r#"
    error: scene.json: camera.sensor: an ideal grid of pixels has nothing to calibrate
    hint: give it a sensor, such as { "type": "raw", "model": "imx183" }
    "#);
}

/// A photograph that the program itself made with hidden numbers is matched: they are found within three of the deviations that
/// are stated, the settings that are told make the same picture, and the residuals are noise.
#[test]
fn a_photograph_with_hidden_numbers_is_matched() {
    let hidden = bench(&json!({
        "system_gain": 0.31, "read_noise": 5.0, "black_level": 101.5, "exposure": 0.013, "serial": 7,
    }));
    hidden.render(&["--seed", "99", "--samples", "256"]);
    let bench = bench(&json!({}));
    std::fs::copy(hidden.path("out/raw.dng"), bench.path("photo.dng")).unwrap();
    std::fs::copy(hidden.path("out/raw.png"), bench.path("photo.png")).unwrap();
    std::fs::copy(hidden.path("out/raw.preview.png"), bench.path("developed.png")).unwrap();
    for photo in ["photo.dng", "photo.png"] {
        let output = bench.run(&[
            "match",
            photo,
            "scene.json",
            "--json",
            "--quiet",
            "-o",
            "out",
            "--set",
            "render.samples=256",
        ]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        // Of 6144 pixels the noise of the dark ones tells the read-out's to a quarter.
        for (key, truth, least) in [
            ("system_gain", 0.31, 0.1),
            ("read_noise", 5.0, 0.3),
            ("black_level", 101.5, 0.02),
            ("exposure", 0.013, 0.1),
        ] {
            let [value, sigma] = ["value", "sigma"].map(|part| report[key][part].as_f64().unwrap());
            assert!(
                (value - truth).abs() < 3.0 * sigma && sigma < least * truth,
                "{key}: {value} ± {sigma}"
            );
        }
        let structure = report["structure"].as_f64().unwrap();
        assert!((structure - 1.0).abs() < 0.4, "{structure}");
    }
    let file = bench.json("out/match.json");
    assert_eq!(file["settings"][3][0], "camera.sensor.exposure");
    let residuals = bench.array("residuals");
    let [mean, variance] =
        moments(&residuals.iter().copied().filter(|r| r.is_finite()).collect::<Vec<_>>());
    assert!(mean.abs() < 0.05 && (variance - 1.0).abs() < 0.1, "{mean} {variance}");
    assert!(bench.path("out/residuals.svg").exists() && bench.path("out/residuals.png").exists());
    // Each of what cannot be matched, by its name.
    let developed = "developed.png";
    let mut all = under(developed, &bench.refusal(&["match", developed, "scene.json"]));
    for setting in [
        "camera.sensor.resolution=[48,32]",
        "camera.sensor.type=rgb",
        "camera.sensor.nonlinearity=[[0.4, 0.4], [1, 0.7]]",
    ] {
        let matched = ["match", "photo.dng", "scene.json", "--set", setting];
        all += &under(setting, &bench.refusal(&matched));
    }
    insta::assert_snapshot!(all);
    hidden.render(&["--set", "camera.sensor.exposure=1", "--outputs", "dng"]);
    std::fs::copy(hidden.path("out/raw.dng"), bench.path("bright.dng")).unwrap();
    let why = bench.refusal(&["match", "bright.dng", "scene.json"]);
    assert!(why.contains("is clipped") && why.contains("shorter exposure"), "{why}");
}
