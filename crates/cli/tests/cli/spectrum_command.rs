//! `etendue spectrum`: what it says of a curve, and what is none.

use serde_json::Value;

use crate::run::{Bench, text, under};

/// Rows of the command's JSON.
fn rows(bench: &Bench, arguments: &[&str]) -> Vec<Value> {
    let output = bench.run(&[&["spectrum"], arguments, &["--json"]].concat());
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    let rows: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    rows.as_array().expect("a list").clone()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key} in {row}"))
}

#[test]
fn curves_are_told_in_numbers() {
    let bench = Bench::new();
    bench.write("two.csv", b"wavelength,one,two\n400,1,2\n700,1,2\n");
    let found = rows(&bench, &["two.csv"]);
    assert_eq!(found.len(), 2);
    for (row, (name, value)) in found.iter().zip([("one", 1.0), ("two", 2.0)]) {
        assert_eq!(row["name"], name);
        assert_eq!(row["range"], serde_json::json!([400.0, 700.0]));
        assert!((number(row, "total") - 300.0 * value).abs() < 1e-9, "{row}");
        // Of a flat curve the mean wavelength, 550 nm, over h c.
        let photons = 550e-9 / (6.626_070_15e-34 * 299_792_458.0);
        assert!((number(row, "photons") / photons - 1.0).abs() < 1e-9, "{row}");
    }
    for column in ["two", "2"] {
        let row = &rows(&bench, &["two.csv", "--column", column])[0];
        assert!((number(row, "total") - 600.0).abs() < 1e-9, "{row}");
    }
    // 683 lm/W where the eye is most sensitive.
    bench.write("green.csv", b"554,0\n555,1\n556,0\n");
    let efficacy = number(&rows(&bench, &["green.csv"])[0], "luminous_efficacy");
    assert!((efficacy / 683.0 - 1.0).abs() < 1e-3, "{efficacy}");
}

/// Chromaticities and temperatures of CIE 015:2018, tables T.3 and 11; of black bodies their own.
#[test]
fn lamps_have_their_colours_and_temperatures() {
    let bench = Bench::new();
    for (name, [x, y], kelvin) in [
        ("a", [0.4476, 0.4074], 2856.0),
        ("d50", [0.3457, 0.3585], 5003.0),
        ("D65", [0.3127, 0.3290], 6504.0),
        ("fl2", [0.3721, 0.3751], 4230.0),
        ("FL11", [0.3805, 0.3769], 4000.0),
    ] {
        let row = &rows(&bench, &[name])[0];
        let at = |k: usize| row["xy"][k].as_f64().unwrap();
        // Printed to the fourth digit, of sums by 5 nm where these are integrals.
        assert!((at(0) - x).abs() < 3e-4 && (at(1) - y).abs() < 3e-4, "{name}: {row}");
        let found = number(row, "correlated_colour_temperature");
        // The same, and rounded to 10 K for fluorescent lamps.
        assert!((found - kelvin).abs() < 8.0, "{name}: {found} K");
    }
    for kelvin in [2500.0, 5000.0, 10000.0] {
        let row = &rows(&bench, &[&kelvin.to_string()])[0];
        let found = number(row, "correlated_colour_temperature");
        assert!((found / kelvin - 1.0).abs() < 1e-3, "{kelvin}: {found}");
        assert!(number(row, "duv").abs() < 1e-4, "{row}");
    }
    // White under a lamp is the lamp.
    bench.write("white.csv", b"300,1\n900,1\n");
    let (under, lamp) =
        (&rows(&bench, &["white.csv", "--under", "d65"])[0], &rows(&bench, &["d65"])[0]);
    for k in 0..3 {
        let [a, b] = [under, lamp].map(|row| row["xyz"][k].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn curves_are_drawn_beside_their_table() {
    let bench = Bench::new();
    bench.write("leaf.csv", b"wavelength,leaf\n400,0.1\n550,0.4\n700,0.2\n");
    let output = bench.run(&["spectrum", "leaf.csv", "-o", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    // Trapezoids of 150 nm: 37.5 and 45.
    assert!(table.contains("leaf") && table.contains("82.5000"), "{table}");
    let drawn = std::fs::read_to_string(bench.path("out/spectrum.svg")).unwrap();
    assert!(drawn.contains("<svg") && drawn.contains("leaf"), "{drawn}");
}

#[test]
fn what_is_no_curve_is_refused() {
    let bench = Bench::new();
    for (name, bytes) in [
        ("order.csv", "500,1\n400,1\n"),
        ("twice.csv", "400,1\n400,1\n"),
        ("below.csv", "-400,1\n500,1\n"),
        ("micro.csv", "0.4,1\n0.7,1\n"),
        ("words.csv", "no curve\n"),
        ("two.csv", "wavelength,a,b\n400,1,2\n700,1,2\n"),
        ("n.yml", "DATA:\n  - type: tabulated n\n    data: |\n      0.4 1.5\n      0.7 1.4\n"),
    ] {
        bench.write(name, bytes.as_bytes());
    }
    let commands: [&[&str]; 11] = [
        &["order.csv"],
        &["twice.csv"],
        &["below.csv"],
        &["micro.csv"],
        &["words.csv"],
        &["two.csv", "--column", "c"],
        &["two.csv", "--column", "3"],
        &["n.yml"],
        &["none.csv"],
        &["fl13"],
        &["two.csv", "--under", "moon"],
    ];
    let messages = commands.map(|arguments| {
        let [table, json] = [&[][..], &["--json"]].map(|more| {
            let output = bench.run(&[&["spectrum"], arguments, more].concat());
            let message = bench.said(&output);
            assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
            assert!(output.stdout.is_empty(), "{arguments:?}: {}", text(&output.stdout));
            message
        });
        assert_eq!(table, json);
        under(&arguments.join(" "), &table)
    });
    insta::assert_snapshot!(messages.concat());
}
