//! `etendue lens --waves` and `--report`: numbers against closed forms, files, and what is refused.

use serde_json::Value;

use crate::run::{Bench, text};

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
    let refused = |arguments: &[&str], words: &[&str]| {
        let output = bench.run(&[&["lens"], arguments].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
        for word in words {
            assert!(message.contains(word), "expected \"{word}\" in: {message}");
        }
    };
    refused(
        &["lens.json", "--cells", "20", "--fields", "8"],
        &["lens.json", "20 x 20 cells", "it needs"],
    );
    refused(&["lens.json", "--cells", "3"], &["3 cells", "from 16"]);
    refused(&["lens.json", "--waves", "--fields", "120"], &["120", "beyond the image circle"]);
    refused(
        &["lens.json", "--wavelengths", "550,600", "--weights", "0,0"],
        &["weights 0, 0", "not all of them 0"],
    );
    refused(
        &["lens.json", "--wavelengths", "550", "--weights", "1,2"],
        &["1, 2 for 1 wavelengths"],
    );
    refused(&["lens.json", "--wavelengths", "550", "--weights", "-1"], &["weights -1"]);
    refused(&["lens.json", "--waves", "--wavelengths", "550,9000"], &["N-BK7"]);
    refused(&["lens.json", "--magnification", "0"], &["magnification", "other than 0"]);
    refused(&["lens.json", "--magnification", "0.5"], &["magnification", "negative"]);
    refused(&["lens.json", "--object-distance", "20 mm"], &["no real image"]);
    refused(&["lens.json", "--numerical-aperture", "0.1"], &["numerical-aperture", "infinity"]);
    refused(&["lens.json", "--frequencies", "nan"], &["--frequencies", "NaN"]);
    refused(&["afocal.json", "--waves"], &["afocal"]);
    refused(&["afocal.json", "--magnification", "-1"], &["afocal"]);
    refused(&["lens.json", "--cells", "64", "--fit-opencv"], &["--cells", "--fit-opencv"]);
    refused(&["lens.json", "--report", "lens.json"], &["lens.json"]);
    // A field of no light among those that were chosen is a note.
    let output = bench.run(&["lens", "lens.json", "--waves", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}
