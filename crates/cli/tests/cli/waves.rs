//! `etendue lens --waves` and `--report`: numbers against closed forms, files, and what is refused.

use serde_json::Value;

use crate::run::{Bench, text, under};

/// An ideal lens of 50 mm at f/5.
const IDEAL: &str = r#"{"name": "ideal", "wavelength": 500, "elements": [
    {"type": "thin_lens", "focal_length": 50},
    {"type": "aperture", "shape": "circular", "radius": 5, "stop": true}]}"#;

/// A singlet with all its errors.
const SINGLET: &str = r#"{"name": "<singlet>", "elements": [
    {"type": "surface", "radius": 50, "thickness": 4, "glass": "N-BK7", "semi_diameter": 4, "stop": true},
    {"type": "surface", "radius": -50, "semi_diameter": 6}]}"#;

fn json(bench: &Bench, arguments: &[&str]) -> Value {
    let output = bench.run(&[&["lens"], arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn an_ideal_lens_has_the_transfer_function_of_a_clear_circle() {
    let bench = Bench::new();
    bench.write("lens.json", IDEAL.as_bytes());
    let arguments =
        ["lens.json", "--wavelengths", "500", "--fields", "0", "--frequencies", "40,100,200,300"];
    let report = json(&bench, &arguments);
    assert_eq!(report["version"], 1);
    let waves = &report["waves"];
    assert_eq!(waves["taken"]["fields"], "option");
    assert_eq!(waves["taken"]["object"], "default");
    let field = &waves["fields"][0];
    assert!((number(&field["strehl"]) - 1.0).abs() < 1e-6, "{field}");
    assert!(number(&field["rms"]) < 1e-6);
    let limit = 2.0 * 5.0 / 50.0_f64.hypot(5.0) / 500e-6;
    for row in field["mtf"].as_array().unwrap() {
        let s = number(&row["frequency"]) / limit;
        let expected = std::f64::consts::FRAC_2_PI * (s.acos() - s * (1.0 - s * s).sqrt());
        for key in ["tangential", "sagittal"] {
            // An ideal lens maps tangents, not sines: at f/5 its rim has 1.5 % more power. To that
            // come 1e-4 of the grid.
            assert!((number(&row[key]) - expected).abs() < 2e-3, "{row} {expected}");
        }
        assert!((number(&row["geometric_tangential"]) - 1.0).abs() < 1e-6, "{row}");
    }
}

#[test]
fn a_near_object_has_heights_and_the_aperture_that_was_asked_for() {
    let bench = Bench::new();
    bench.write("lens.json", IDEAL.as_bytes());
    let by_size =
        ["lens.json", "--magnification", "-0.5", "--numerical-aperture", "0.02", "--fields", "0,3"];
    let waves = json(&bench, &by_size)["waves"].clone();
    assert!((number(&waves["planes"]["object_z"]) + 150.0).abs() < 1e-9, "{}", waves["planes"]);
    assert!((number(&waves["planes"]["image_z"]) - 75.0).abs() < 1e-9);
    let field = &waves["fields"][1];
    assert!((number(&field["sphere"]["centre"][1]) + 1.5).abs() < 1e-9, "{}", field["sphere"]);
    // Sines over sines are the magnification but for an ideal lens' tangents: f/12.5 in the image.
    let [n, _] = [0, 1].map(|i| number(&waves["fields"][0]["working_f_number"][i]));
    assert!((n - 12.5).abs() < 0.1, "{n}");
    let by_place = ["lens.json", "--object-distance", "150 mm", "--fields", "3"];
    let again = json(&bench, &by_place)["waves"]["planes"].clone();
    assert!((number(&again["magnification"]) + 0.5).abs() < 1e-12, "{again}");
}

#[test]
fn figures_tables_and_a_page_are_written_whole() {
    let bench = Bench::new();
    bench.write("lens.json", SINGLET.as_bytes());
    let arguments = [
        "lens",
        "lens.json",
        "--report",
        "out/page.html",
        "-o",
        "out",
        "--best-focus",
        "--fields",
        "0,3",
    ];
    let output = bench.run(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    for words in
        ["In waves", "Strehl", "Modulation, by diffraction", "S III", "Coddington", "coma y"]
    {
        assert!(table.contains(words), "{words} in:\n{table}");
    }
    assert!(!table.contains("NaN"), "{table}");
    let page = std::fs::read(bench.path("out/page.html")).unwrap();
    let page = text(&page);
    assert!(
        page.matches("<svg").count() == 10 && page.ends_with("</html>\n"),
        "two drawings and eight figures"
    );
    assert!(page.contains("&lt;singlet&gt;") && !page.contains("<singlet>"));
    for name in [
        "mtf.svg",
        "through-focus.svg",
        "encircled.svg",
        "line-spread.svg",
        "ray-fans.svg",
        "opd-fans.svg",
        "field-curvature.svg",
        "distortion.svg",
    ] {
        let svg = std::fs::read(bench.path(&format!("out/{name}"))).unwrap();
        assert!(text(&svg).contains("<path") || text(&svg).contains("<circle"), "{name}");
    }
    for name in [
        "waves.csv",
        "mtf.csv",
        "mtf-geometric.csv",
        "zernike.csv",
        "field-curvature.csv",
        "seidel.csv",
    ] {
        let csv = std::fs::read(bench.path(&format!("out/{name}"))).unwrap();
        let lines: Vec<usize> = text(&csv).lines().map(|line| line.split(',').count()).collect();
        assert!(
            lines.len() > 2 && lines.iter().all(|&count| count == lines[0]),
            "{name}: {lines:?}"
        );
    }
}

#[test]
fn the_best_focus_has_the_flattest_wavefront() {
    let bench = Bench::new();
    bench.write("lens.json", SINGLET.as_bytes());
    let rms = |more: &[&str]| {
        let arguments =
            [&["lens.json", "--wavelengths", "550", "--fields", "0", "--waves"], more].concat();
        let waves = json(&bench, &arguments)["waves"].clone();
        (number(&waves["fields"][0]["rms"]), number(&waves["refocused"]))
    };
    let (here, none) = rms(&[]);
    let (there, moved) = rms(&["--best-focus"]);
    // Spherical aberration alone: the best plane takes three quarters of the root mean square.
    assert!(none == 0.0 && moved < -1e-3 && there < 0.3 * here, "{here} {there} {moved}");
}

#[test]
fn what_cannot_be_analysed_is_refused_by_name() {
    let bench = Bench::new();
    bench.write("lens.json", SINGLET.as_bytes());
    bench.write(
        "afocal.json",
        br#"{"elements": [{"type": "thin_lens", "focal_length": 100, "thickness": 150, "semi_diameter": 9},
        {"type": "thin_lens", "focal_length": 50}]}"#,
    );
    let commands: [&[&str]; 18] = [
        &["lens.json", "--cells", "20", "--fields", "8"],
        &["lens.json", "--cells", "3"],
        &["lens.json", "--waves", "--fields", "120"],
        &["lens.json", "--wavelengths", "550,600", "--weights", "0,0"],
        &["lens.json", "--wavelengths", "550", "--weights", "1,2"],
        &["lens.json", "--wavelengths", "550", "--weights", "-1"],
        &["lens.json", "--waves", "--wavelengths", "550,9000"],
        &["lens.json", "--magnification", "0"],
        &["lens.json", "--magnification", "0.5"],
        &["lens.json", "--object-distance", "20 mm"],
        &["lens.json", "--numerical-aperture", "0.1"],
        &["lens.json", "--frequencies", "nan"],
        &["afocal.json", "--waves"],
        &["lens.json", "--afocal"],
        &["afocal.json", "--afocal", "--focus", "2 m"],
        &["afocal.json", "--magnification", "-1"],
        &["lens.json", "--cells", "64", "--fit-opencv"],
        &["lens.json", "--report", "lens.json"],
    ];
    let messages =
        commands.map(|more| under(&more.join(" "), &bench.refusal(&[&["lens"], more].concat())));
    insta::assert_snapshot!(messages.concat());
    // A field of no light among those that were chosen is a note.
    let output = bench.run(&["lens", "lens.json", "--waves", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// An ideal lens' point spread function at f/5 on cells of an eighth of λN is Airy's, in focus; out of focus
/// it is wider, and all of its light is there.
#[test]
fn point_spread_functions_are_written_by_depth_field_and_wavelength() {
    let bench = Bench::new();
    bench.write("lens.json", IDEAL.as_bytes());
    let arguments = [
        "lens",
        "lens.json",
        "--psf",
        "-o",
        "out",
        "--depths",
        "infinity,20 m",
        "--fields",
        "0,1",
        "--wavelengths",
        "500,600",
        "--psf-pitch",
        "0.3125 um",
        "--psf-size",
        "201",
        "-q",
    ];
    let output = bench.run(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let meaning: Value =
        serde_json::from_slice(&std::fs::read(bench.path("out/psf.json")).unwrap()).unwrap();
    assert_eq!(meaning["shape"], serde_json::json!([2, 2, 2, 201, 201]));
    assert_eq!(meaning["depths"], serde_json::json!([null, 20000.0]));
    let values = bench.array("psf");
    let plane = |k: usize| &values[k * 201 * 201..(k + 1) * 201 * 201];
    // λN/8: the middle has π/4 of a cell in λN², less what tangents in the place of sines change at f/5
    // (1.5 % of power at the rim).
    let middle = plane(0)[100 * 201 + 100];
    let expected = std::f64::consts::FRAC_PI_4 / 64.0;
    assert!((middle / expected - 1.0).abs() < 0.02, "{middle} {expected}");
    // The first dark ring, at 1.22 λN.
    let ring = plane(0)[100 * 201 + 110];
    assert!(ring < 2e-3 * middle, "{ring}");
    // In 20 m: 12.5 mm² / 0.5 µm / 20 m are 1.25 waves.
    assert!(plane(4)[100 * 201 + 100] < 0.2 * middle);
    for (k, held) in meaning["held"].as_array().unwrap().iter().enumerate() {
        let sum: f64 = plane(k).iter().sum();
        assert!((sum - number(held)).abs() < 1e-6);
        // 12.5 λN on each side hold all but 2 %.
        assert!(sum > 0.97 && sum < 1.0 + 1e-6, "{sum}");
    }
    assert!(bench.path("out/psf.exr").exists());
    // One degree off the axis the chief ray lands on 50 mm tan 1°.
    let middles = meaning["middles"].as_array().unwrap();
    assert!((number(&middles[2][1]) - 50.0 * 1.0_f64.to_radians().tan()).abs() < 1e-6);
}

/// Huygens' sum over true distances has the pattern of the transform, where the sphere is large.
#[test]
fn huygens_sum_is_written_as_the_transform_is() {
    let bench = Bench::new();
    bench.write("lens.json", IDEAL.as_bytes());
    let written = |folder: &str, more: &[&str]| {
        let out = format!("out/{folder}");
        let size = [
            "--fields",
            "0.5",
            "--wavelengths",
            "500",
            "--psf-pitch",
            "0.625 um",
            "--psf-size",
            "31",
        ];
        let arguments =
            [&["lens", "lens.json", "--psf", "-q", "-o", &out], &size[..], more].concat();
        let output = bench.run(&arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
        bench.array(&format!("{folder}/psf"))
    };
    let (fft, sum) = (written("fft", &[]), written("sum", &["--huygens"]));
    assert_eq!(fft.len(), sum.len());
    let peak = fft.iter().copied().fold(0.0, f64::max);
    for (k, (a, b)) in fft.iter().zip(&sum).enumerate() {
        // The transform divides all by what it finds on its cells and in the ring beyond: a few thousandths.
        assert!((a - b).abs() < 5e-3 * peak, "{k}: {a} {b}");
    }
}

/// Kepler's telescope of ideal lenses, twice: angles leave twice as large and upside down, and waves are those of its
/// exit pupil of 9 mm, by cycles a milliradian.
#[test]
fn an_afocal_lens_is_analysed_by_angles() {
    let bench = Bench::new();
    bench.write(
        "afocal.json",
        br#"{"wavelength": 500, "elements": [
        {"type": "thin_lens", "focal_length": 100, "thickness": 150, "semi_diameter": 9, "stop": true},
        {"type": "thin_lens", "focal_length": 50}]}"#,
    );
    let arguments = [
        "afocal.json",
        "--afocal",
        "--wavelengths",
        "500",
        "--fields",
        "0,1",
        "--frequencies",
        "9",
    ];
    let waves = json(&bench, &arguments)["waves"].clone();
    assert_eq!(waves["image_unit"], "mrad");
    let [on_axis, field] = [0, 1].map(|k| &waves["fields"][k]);
    let expected = 2000.0 * 1.0_f64.to_radians().tan();
    let angle = number(&field["sphere"]["centre"][1]);
    assert!((angle.abs() - expected).abs() < 1e-6, "{angle} {expected}");
    assert!((number(&on_axis["strehl"]) - 1.0).abs() < 1e-6);
    // 9 mm over 500 nm: 18 cycles a milliradian are the limit, and 9 half of it.
    let modulation = number(&on_axis["mtf"][0]["tangential"]);
    let half = std::f64::consts::FRAC_2_PI * (0.5_f64.acos() - 0.5 * 0.75_f64.sqrt());
    assert!((modulation - half).abs() < 1e-3, "{modulation} {half}");
    let output = bench.run(&[&["lens"], &arguments[..]].concat());
    let table = text(&output.stdout);
    assert!(table.contains("mrad") && table.contains("cycles/mrad"), "{table}");
}

#[test]
fn point_spread_functions_that_cannot_be_are_refused() {
    let bench = Bench::new();
    bench.write("lens.json", IDEAL.as_bytes());
    let commands: [&[&str]; 7] = [
        &["--psf"],
        &["--psf", "-o", "out", "--psf-size", "64"],
        &["--psf", "-o", "out", "--fields", "0,1,2,3,4,5,6,7", "--psf-size", "4095"],
        &["--depths", "2 m"],
        &["--huygens"],
        &["--psf", "--huygens", "-o", "out", "--psf-pitch", "2 um"],
        &["--psf", "--huygens", "-o", "out", "--psf-size", "2001"],
    ];
    let messages = commands.map(|more| {
        under(&more.join(" "), &bench.refusal(&[&["lens", "lens.json"], more].concat()))
    });
    insta::assert_snapshot!(messages.concat());
}

/// A 16-bit picture of an edge that a Gaussian spreads, turned by 5 degrees.
fn write_edge(bench: &Bench, name: &str) {
    let (width, height, sigma): (u32, u32, f64) = (120, 140, 1.0);
    let slope = 5.0_f64.to_radians().tan();
    let mut data = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let from = f64::from(x) + 0.5 - 60.2 - slope * (f64::from(y) + 0.5 - 70.0);
            let share =
                0.5 * libm::erfc(-from * slope.atan().cos() / sigma / std::f64::consts::SQRT_2);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "16 bits")]
            let code = (2_000.0_f64 + 60_000.0 * share).round() as u16;
            data.extend(code.to_be_bytes());
        }
    }
    let mut file = std::fs::File::create(bench.path(name)).unwrap();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
}

#[test]
fn an_edge_is_measured_and_what_is_none_is_refused() {
    let bench = Bench::new();
    write_edge(&bench, "raw.png");
    let arguments = ["edge", "raw.png", "--raw", "--pitch", "4 um", "--json", "-o", "out", "-q"];
    let output = bench.run(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let measured: Value = serde_json::from_slice(&output.stdout).unwrap();
    let channel = &measured["channels"][0];
    assert!((number(&channel["angle"]) - 5.0).abs() < 0.02, "{}", channel["angle"]);
    for row in channel["modulation"].as_array().unwrap().iter().take(51) {
        let frequency = number(&row[0]);
        let expected = (-2.0 * (std::f64::consts::PI * frequency).powi(2)).exp();
        assert!((number(&row[1]) - expected).abs() < 5e-3, "{row}");
    }
    // exp(−2π²ν²) is a half at ν = √(ln 2 / 2) / π, 0.1874 cycles a pixel of 4 µm.
    assert!((number(&channel["mtf50"]) - 0.1874).abs() < 1e-3);
    assert!((number(&channel["mtf50_mm"]) - 46.85).abs() < 0.3);
    assert!(bench.path("out/edge.svg").exists() && bench.path("out/edge.csv").exists());
    let refused = [
        ["--region", "100,0,40,40"],
        ["--region", "0,0,30,60"],
        ["--region", "40,40"],
        ["--layer", "Depth"],
    ]
    .map(|[option, value]| {
        let message = bench.refusal(&["edge", "raw.png", option, value]);
        under(&format!("{option} {value}"), &message)
    });
    insta::assert_snapshot!(refused.concat());
}

/// Diffraction is refused behind lenslets and where there is no one point of view, by name; the plan says
/// whether it would show.
#[test]
fn the_plan_says_whether_waves_would_show() {
    let scene = |f_number: f64, on: bool| {
        format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path"}}, "camera": {{"type": "thin_lens", "focal_length": 50,
                "f_number": {f_number}, "focus_distance": 2, "diffraction": {on},
                "pose": {{"from": [0, 0, 2], "look_at": [0, 0, 0]}},
                "sensor": {{"resolution": [32, 24], "pixel_pitch": 3.45}}}},
              "objects": [{{"shape": "rectangle", "width": 1, "height": 1}}]}}"#
        )
    };
    for (f_number, on, words) in
        [(22.0, false, "waves would show"), (2.0, false, "hardly show"), (22.0, true, "chief rays")]
    {
        let bench = Bench::with_scene(&scene(f_number, on));
        let output = bench.run(&["plan", "scene.json"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains(words), "{}", text(&output.stdout));
    }
    // What it does not go with is refused before a render, and of a render with its place, too.
    let bench = Bench::with_scene(&scene(8.0, true));
    let until = ["scene.json", "--set", r#"render.samples={"relative_error": 0.1}"#];
    let [checked, planned] =
        ["check", "plan"].map(|command| bench.refusal(&[&[command], &until[..]].concat()));
    insta::assert_snapshot!(checked, @"
    error: scene.json, line 2, column 53: camera.diffraction: light that is spread as waves lands beside the pixel that it starts from, so that no pixel can tell when its samples are enough
    hint: give `render.samples` a number, or leave out `diffraction`
    ");
    assert_eq!(checked, planned);
    let share = ["render", "scene.json", "-o", "out", "--quiet", "--shard", "1/2"];
    insta::assert_snapshot!(bench.refusal(&share), @"
    error: scene.json, line 2, column 53: camera.diffraction: the light of the whole picture is spread at once
    hint: leave out --shard and --checkpoint, or `diffraction`
    ");
    let bench = Bench::with_scene(&scene(8.0, true).replace(
        r#""f_number": 8, "focus_distance": 2,"#,
        r#""sensor_distance": 51.3, "elements": [{"at": 50, "type": "aperture", "shape": "circular", "radius": 3, "stop": true}],"#,
    ));
    insta::assert_snapshot!(bench.refusal(&["check", "scene.json"]), @"
    error: scene.json, line 2, column 136: camera.diffraction: the lens is telecentric towards the object: its picture has no one point that it is seen from
    hint: leave out `diffraction`
    ");
}
