//! `etendue lens`: its table, its drawings and files, and what it refuses.

use serde_json::{Value, json};

use crate::lens_reference::{number, run};
use crate::run::{Bench, text, under};

/// A lens with a bit of everything.
const LENS: &str = r#"{"name": "test", "elements": [
    {"type": "surface", "radius": 20, "thickness": 4, "glass": "N-BK7", "semi_diameter": 8},
    {"type": "surface", "radius": -30, "thickness": 2},
    {"type": "aperture", "shape": "circular", "radius": 3, "thickness": 1, "stop": true},
    {"type": "surface", "thickness": 1, "glass": {"nd": 1.6, "vd": 36}, "tilt": [2, 0]},
    {"type": "surface", "decentre": [0, "100 um"]}]}"#;

#[test]
fn the_table_has_what_an_optical_engineer_looks_for() {
    let bench = Bench::new();
    bench.write("lens.json", LENS.as_bytes());
    let output = bench.run(&["lens", "lens.json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    for words in [
        "effective focal length",
        "back focal length",
        "principal plane",
        "entrance pupil",
        "exit pupil",
        "f-number",
        "image circle",
        "field of view",
        "RMS spot",
        "distortion",
        "illumination",
        "longitudinal",
        "stop",
        "tilted or decentred",
        "N-BK7",
        "mm",
        "um",
    ] {
        assert!(table.contains(words), "{words} in:\n{table}");
    }
    assert!(!table.contains("NaN") && !table.contains(" inf "), "{table}");
}

/// The message of the command, which must refuse with exit code 2 and print nothing.
fn refused(bench: &Bench, arguments: &[&str]) -> String {
    let output = bench.run(&[&["lens"], arguments].concat());
    let message = bench.said(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    message
}

#[test]
fn bad_lenses_are_refused_with_file_and_place() {
    let element = |keys: &str| format!(r#"{{"elements": [{{"type": "surface", {keys}}}]}}"#);
    let mask = r#"{"type": "aperture", "shape": "image", "file": "../m.png", "width": 1}"#;
    let lenses = [
        String::new(),
        "[]".to_owned(),
        element(r#""radios": 5"#),
        element(r#""conic": "flat""#),
        "\u{0}\u{1}".to_owned(),
        r#"{"elements": []}"#.to_owned(),
        r#"{"elements": [{"type": "surface"}], "elements": []}"#.to_owned(),
        element(r#""radius": NaN"#),
        element(r#""radius": 1e999"#),
        element(r#""radius": 0"#),
        element(r#""radius": "5 parsec""#),
        element(r#""thickness": "thick""#),
        element(r#""glass": "N-BK8""#),
        element(r#""glass": {"n": -1}"#),
        element(r#""semi_diameter": -1"#),
        element(r#""radius": 1e-320"#),
        r#"{"elements": [{"type": "prism"}]}"#.to_owned(),
        format!(r#"{{"elements": [{mask}]}}"#),
    ];
    let messages = lenses.map(|lens| {
        let bench = Bench::new();
        bench.write("lens.json", lens.as_bytes());
        let heading = lens.replace(char::is_control, "?");
        under(&heading, &refused(&bench, &["lens.json", "--json"]))
    });
    insta::assert_snapshot!(messages.concat());
    insta::assert_snapshot!(refused(&Bench::new(), &["nothing.json"]), @"error: nothing.json: no such file");
    insta::assert_snapshot!(refused(&Bench::new(), &["."]), @"
    error: .: it is a folder, not a regular file
    hint: give a lens file (.json), a file of Zemax (.zmx), CODE V (.seq), OSLO (.len), optiland or ISET (.json), pbrt (.dat) or PhotonsToPhotos (.txt), or a scene whose camera is a lens
    ");
}

#[test]
fn schemas_know_the_keys_of_lenses_and_rays() {
    let schema = |of| -> Value {
        serde_json::from_slice(&Bench::new().run(&["schema", of]).stdout).expect("JSON")
    };
    assert!(schema("lens")["properties"]["elements"].is_object());
    assert!(schema("rays")["properties"]["clip"].is_object());
}

#[test]
fn scenes_without_a_lens_are_told_so_by_their_camera() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "camera": {"type": "orthographic"}}"#);
    insta::assert_snapshot!(refused(&bench, &["scene.json"]), @r#"
    error: scene.json, line 1, column 27: camera.type: a "orthographic" has no lens to look at
    hint: give a scene whose camera has
    "#);
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": []}"#);
    insta::assert_snapshot!(refused(&bench, &["scene.json"]), @r#"
    error: scene.json: camera.type: a "pinhole" has no lens to look at
    hint: give a scene whose camera has
    "#);
}

#[test]
fn the_lens_of_a_scenes_camera_stands_where_the_scene_focuses_it() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "camera": {"type": "lens", "lens": "lens.json", "focus_distance": 1,
            "fov": 20, "pose": {"from": [0, 0, 1], "look_at": [0, 0, 0]}}}"#,
    );
    bench.write(
        "lens.json",
        br#"{"elements": [
        {"type": "thin_lens", "focal_length": 50, "semi_diameter": 10}]}"#,
    );
    let output = bench.run(&["lens", "scene.json", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    // 1/s' = 1/50 - 1/1000.
    assert!((number(&report["sensor_z"]) - 1000.0 / 19.0).abs() < 1e-9, "{}", report["sensor_z"]);
    insta::assert_snapshot!(refused(&bench, &["scene.json", "--save", "x.json"]), @"
    error: --save: the lens of a scene cannot be saved
    hint: give its own file
    ");
    let scene = r#"{"etendue": 1, "camera": {"type": "lens", "lens": "lens.zmx", "fov": 20}}"#;
    bench.write("zemax.json", scene.as_bytes());
    bench.write("lens.zmx", ZMX.as_bytes());
    assert!(bench.run(&["lens", "zemax.json"]).status.success());
    bench.write("lens.zmx", ZMX.replace("STANDARD", "USERSURF").as_bytes());
    insta::assert_snapshot!(refused(&bench, &["zemax.json"]), @"error: zemax.json, line 1, column 43: camera.lens: lens.zmx, line 15: TYPE: the surface type USERSURF has no counterpart here; known: STANDARD, EVENASPH, XASPHERE, ODDASPHE, TOROIDAL, BICONICX, SZERNSAG, FZERNSAG, FRESNELS, TILTSURF, DGRATING, BINARY_2, PARAXIAL, COORDBRK");
}

#[test]
fn bad_rays_are_refused_with_file_and_place() {
    let bench = Bench::new();
    bench.write("lens.json", LENS.as_bytes());
    let ray = |keys: &str| format!(r#"{{"from": "object", "clip": true, "rays": [{{{keys}}}]}}"#);
    let files = [
        String::new(),
        "{}".to_owned(),
        r#"{"from": "left", "clip": true, "rays": []}"#.to_owned(),
        r#"{"from": "object", "rays": []}"#.to_owned(),
        ray(r#""origin": [0, 0, -9], "direction": [0, 0, 1]"#),
        ray(r#""origin": [0, 0], "direction": [0, 0, 1], "wavelength": 500"#),
        ray(r#""origin": [0, 0, -9], "direction": [0, 0, 0], "wavelength": 500"#),
        ray(r#""origin": [0, 0, -9], "direction": [0, 0, 1], "wavelength": -5"#),
        ray(r#""origin": [0, null, -9], "direction": [0, 0, 1], "wavelength": 500"#),
        ray(r#""origin": [0, 0, 1e300], "direction": [0, 0, 1], "wavelength": 500"#),
        ray(r#""origin": [0, 0, -9], "direction": [0, 0, 1], "wavelength": 10170"#),
        ray(r#""origin": [0, 0, -9], "direction": [0, 0, 1], "wavelength": 500, "tag": 1"#),
    ];
    let messages = files.map(|file| {
        bench.write("rays.json", file.as_bytes());
        under(&file, &refused(&bench, &["lens.json", "--rays", "rays.json", "--json"]))
    });
    insta::assert_snapshot!(messages.concat());
}

/// A singlet as Zemax writes it, at a focal length that it states.
const ZMX: &str = "VERS 140730\nMODE SEQ\nNAME Singlet EFL=49.04\nUNIT MM\nFTYP 0 0 2 1 0 0 0\n\
    YFLN 0 3\nWAVM 1 0.58756 1\nPWAV 1\nRAIM 0 0 1\nSURF 0\n  CURV 0\n  DISZ INFINITY\n\
    SURF 1\n  STOP\n  TYPE STANDARD\n  CURV 2.0E-2 0\n  DISZ 4\n  GLAS N-BK7 0 0 1.5168 64.17\n  \
    DIAM 8 1\nSURF 2\n  CURV -2.0E-2 0\n  DISZ 47\n  DIAM 8 1\nSURF 3\n  CURV 0\n  DISZ 0\n";

#[test]
fn a_zemax_file_is_analysed_with_what_it_leaves_out_and_saved_as_a_lens_file() {
    let bench = Bench::new();
    let utf16: Vec<u8> =
        std::iter::once(0xfeff).chain(ZMX.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    bench.write("lens.ZMX", &utf16);
    let output = bench.run(&["lens", "lens.ZMX", "--json", "--save", "lens.json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    // 1/f = (n - 1) (2/R - (n - 1) d / (n R^2)), n = 1.5168 of N-BK7 to the fifth digit.
    let (n, r, d) = (1.516_80, 50.0, 4.0);
    let efl = 1.0 / ((n - 1.0) * (2.0 / r - (n - 1.0) * d / (n * r * r)));
    assert!((number(&report["paraxial"]["efl"]) - efl).abs() < 1e-3, "{}", report["paraxial"]);
    assert_eq!(report["fields"], json!([0.0, 3.0]));
    insta::assert_snapshot!(format!("{:#}", report["notes"]), @r#"
    [
      "the file states a focal length of 49.04 mm, and it is 49.04299 mm here",
      "commands left out: VERS (line 1), RAIM (line 9)"
    ]
    "#);
    let again = run(&bench, &[]);
    assert_eq!(again["paraxial"], report["paraxial"]);
    bench.write("bad.zmx", ZMX.replace("N-BK7", "N-BK77").as_bytes());
    insta::assert_snapshot!(refused(&bench, &["bad.zmx"]), @r#"error: bad.zmx, line 18: GLAS N-BK77: unknown glass "N-BK77"; the nearest names known are N-BK7, N-ZK7, N-BK10; a catalogue of your own is added with --glass-catalog FILE.agf, or by `glass_catalogs` of a lens file; write its index into the file as GLAS ___BLANK 1 0 nd vd"#);
    bench.write("empty.zmx", b"");
    insta::assert_snapshot!(refused(&bench, &["empty.zmx"]), @"error: empty.zmx, line 1: the file is empty");
}

#[test]
fn a_position_of_a_zoom_lens_is_chosen_and_saved() {
    let bench = Bench::new();
    let zoom = format!(
        "{ZMX}MNUM 2 1\nTHIC 2 1 47 0 0\nTHIC 2 2 60 0 0\nCRVT 1 1 0.02 0\nCRVT 1 2 0.01 0\n"
    );
    bench.write("zoom.zmx", zoom.as_bytes());
    let efl = |arguments: &[&str]| {
        let output = bench.run(&[&["lens", "--json"], arguments].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        (number(&report["paraxial"]["efl"]), number(&report["sensor_z"]))
    };
    assert_eq!(efl(&["zoom.zmx"]), efl(&["zoom.zmx", "--configuration", "1"]));
    let second = efl(&["zoom.zmx", "--configuration", "2", "--save", "long.json"]);
    // 1/f = (n - 1) (c1 - c2 + (n - 1) d c1 c2 / n).
    let (n, [c1, c2], d) = (1.516_80, [0.01, -0.02], 4.0);
    let expected = 1.0 / ((n - 1.0) * (c1 - c2 + (n - 1.0) * d * c1 * c2 / n));
    assert!((second.0 - expected).abs() < 1e-3 && second.1 == 64.0, "{second:?} {expected}");
    assert_eq!(efl(&["long.json"]), second);
    insta::assert_snapshot!(refused(&bench, &["zoom.zmx", "--configuration", "3"]), @"error: zoom.zmx, line 31: there is no configuration 3: the file has 2, from 1");
    insta::assert_snapshot!(refused(&bench, &["long.json", "--configuration", "1"]), @"
    error: long.json: has no configurations, which Zemax files (.zmx), those of OSLO (.len) and tables of PhotonsToPhotos (.txt) may have
    hint: leave `--configuration` out
    ");
}

/// Each of the same biconvex lens of n = 1.5, radii 50 and −50 mm, 4 mm thick, and a stop behind it.
const PBRT: &str = "50 4 1.5 20\n-50 1 1 20\n0 46 0 8\n";
const ISET: &str = r#"{"name": "a", "surfaces": [{"radius": 50, "thickness": 4, "ior": 1.5, "semi_aperture": 10},
    {"radius": -50, "thickness": 1, "ior": 1, "semi_aperture": 10}, {"radius": 0, "thickness": 46, "ior": 0, "semi_aperture": 4}]}"#;
const OSLO: &str = "LEN NEW \"a\" 50 4\nEBR 4\nANG 5\nTH 1e20\nNXT\nGLA 1.5\nRD 50\nTH 4\nAP 10\nNXT\nRD -50\nTH 1\nAP 10\nNXT\nTH 46\n\
    AST\nNXT\nEND 4\n";
const OPTBENCH: &str = "[variable distances]\nBf\t46\t50\n[lens data]\n1\t50\t4\t1.5\t20\n2\t-50\t1\t\t20\n3\tAS\tBf\t\t8\n";
const OPTILAND: &str = r#"{"aperture": {"type": "float_by_stop_size", "value": 8}, "surface_group": {"surfaces": [
    {"geometry": {"type": "Plane", "cs": {"z": -Infinity}}},
    {"geometry": {"type": "StandardGeometry", "cs": {"z": 0}, "radius": 50}, "material_post": {"type": "IdealMaterial", "index": 1.5}},
    {"geometry": {"type": "StandardGeometry", "cs": {"z": 4}, "radius": -50}},
    {"geometry": {"type": "Plane", "cs": {"z": 5}}, "is_stop": true}, {"geometry": {"type": "Plane", "cs": {"z": 51}}}]}}"#;

#[test]
fn lenses_of_other_programs_are_read_and_saved_and_taken_by_scenes() {
    let bench = Bench::new();
    let files = [
        ("lens.dat", PBRT),
        ("iset.json", ISET),
        ("lens.len", OSLO),
        ("lens.txt", OPTBENCH),
        ("optiland.json", OPTILAND),
    ];
    // The lensmaker's formula.
    let expected = 1.0 / (0.5 * (0.04 - 0.5 * 4.0 * 0.0004 / 1.5));
    let efl = |name: &str, more: &[&str]| {
        let output = bench.run(&[&["lens", name, "--json"], more].concat());
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        number(&report["paraxial"]["efl"])
    };
    for (name, content) in files {
        bench.write(name, content.as_bytes());
        let saved = format!("{name}.saved.json");
        assert!((efl(name, &["--save", &saved]) - expected).abs() < 1e-9, "{name}");
        assert!((efl(&saved, &[]) - expected).abs() < 1e-9, "{saved}");
        let scene = json!({"etendue": 1, "camera": {"type": "lens", "lens": name, "fov": 5}});
        bench.write("scene.json", scene.to_string().as_bytes());
        assert!((efl("scene.json", &[]) - expected).abs() < 1e-9, "{name} in a scene");
        // Broken, it is told as what it is, and none of Zemax' words.
        bench.write(name, content.replace("1.5", "0.5").as_bytes());
        let output = bench.run(&["lens", name]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            message.contains(name) && !message.contains("GLAS") && !message.contains("Zemax"),
            "{message}"
        );
    }
    bench.write("lens.txt", OPTBENCH.as_bytes());
    efl("lens.txt", &["--configuration", "2"]);
    insta::assert_snapshot!(refused(&bench, &["lens.txt", "--configuration", "3"]), @"error: lens.txt, line 6: there is no configuration 3: the file has 2, from 1");
    insta::assert_snapshot!(refused(&bench, &["lens.dat", "--configuration", "1"]), @"
    error: lens.dat: has no configurations, which Zemax files (.zmx), those of OSLO (.len) and tables of PhotonsToPhotos (.txt) may have
    hint: leave `--configuration` out
    ");
}

#[test]
fn weights_of_a_zemax_file_are_those_of_its_means() {
    let bench = Bench::new();
    let weighted = ZMX.replace("SURF 0", "WAVM 1 0.48 1\nWAVM 2 0.65 3\nSURF 0").replacen(
        "FTYP 0 0 2 1",
        "FTYP 0 0 2 2",
        1,
    );
    bench.write("lens.zmx", weighted.as_bytes());
    let output =
        bench.run(&["lens", "lens.zmx", "--waves", "--fields", "0", "--f-number", "11", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["waves"]["weights"], json!([0.25, 0.75]), "{}", report["waves"]["taken"]);
}

#[test]
fn drawings_are_written_whole() {
    let bench = Bench::new();
    bench.write("lens.json", LENS.as_bytes());
    let output = bench.run(&["lens", "lens.json", "-o", "out/drawn"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    for name in ["layout.svg", "spots.svg", "illumination.svg"] {
        let drawing = std::fs::read_to_string(bench.path("out/drawn").join(name)).unwrap();
        assert!(drawing.starts_with("<svg") && drawing.ends_with("</svg>"), "{name}");
    }
    bench.write("file", b"");
    insta::assert_snapshot!(refused(&bench, &["lens.json", "-o", "file/out"]), @"
    error: cannot write file/out: Not a directory (os error 20)
    hint: a part of the path is a file; choose another folder
    ");
}

#[test]
fn wavelengths_out_of_range_are_warned_of_once_or_refused() {
    let bench = Bench::new();
    bench.write("lens.json", LENS.as_bytes());
    let ray = json!({"origin": [0, 0, -9], "direction": [0, 0, 1], "wavelength": 3000});
    let file = json!({"from": "object", "clip": true, "rays": [ray, ray]});
    bench.write("rays.json", file.to_string().as_bytes());
    let arguments = ["lens", "lens.json", "--rays", "rays.json", "--json"];
    let output = bench.run(&arguments);
    assert!(output.status.success());
    assert_eq!(text(&output.stderr).matches("N-BK7").count(), 1, "{}", text(&output.stderr));
    // Programs read the version of the keys first.
    assert!(
        text(&output.stdout).starts_with(r#"{"version":1,"rays":["#),
        "{}",
        text(&output.stdout)
    );
    let strict = [&arguments[1..], &["--strict"]].concat();
    insta::assert_snapshot!(refused(&bench, &strict), @"error: lens.json: glass N-BK7 is known from 300 to 2500 nm, and 3000 nm lies outside");
    // Numbers state no range, and no glass is known there.
    bench.write("lens.json", LENS.replace("\"N-BK7\"", "{\"n\": 1.5}").as_bytes());
    let beyond = ["lens.json", "--wavelengths", "100", "--strict"];
    insta::assert_snapshot!(refused(&bench, &beyond), @"error: lens.json: glass n = 1.5 states no range, others are known from 240 to 14000 nm, and 100 nm lies outside");
}

#[test]
fn options_out_of_range_are_refused() {
    let bench = Bench::new();
    bench.write("lens.json", LENS.as_bytes());
    let options = [
        ["--fields", "0,200"],
        ["--fields", "nan"],
        ["--wavelengths", "-5"],
        ["--focus", "-1 m"],
        ["--focus", "0.001"],
        ["--f-number", "0"],
    ];
    let messages = options.map(|[option, value]| {
        under(&format!("{option} {value}"), &refused(&bench, &["lens.json", option, value]))
    });
    insta::assert_snapshot!(messages.concat());
}

/// A `.zmx` of windows in air behind a singlet.
fn long_zmx(surfaces: usize, fields: usize) -> String {
    let mut text = format!("MODE SEQ\nUNIT MM\nENPD 5\nFTYP 0 0 {fields} 1\nYFLN");
    (0..fields).for_each(|i| text += &format!(" {}", 10.0 * i as f64 / fields as f64));
    text += "\nWAVM 1 0.55 1\nPWAV 1\nSURF 0\n  CURV 0\n  DISZ INFINITY\n";
    for i in 1..surfaces {
        let curvature = [0.0, 0.02, -0.02].get(i).copied().unwrap_or(0.0);
        let stop = if i == 1 { "  STOP\n" } else { "" };
        let glass = if i % 2 == 1 { "  GLAS N-BK7\n" } else { "" };
        text += &format!("SURF {i}\n{stop}  CURV {curvature}\n  DISZ 0.01\n  DIAM 10\n{glass}");
    }
    text + &format!("SURF {surfaces}\n  CURV 0\n  DISZ 0\n")
}

#[test]
fn lenses_of_absurdly_many_elements_or_fields_are_refused_or_cut() {
    let bench = Bench::new();
    bench.write("long.zmx", long_zmx(4000, 3000).as_bytes());
    insta::assert_snapshot!(refused(&bench, &["long.zmx"]), @"error: long.zmx, line 4508: SURF: more than 1000 surfaces");

    bench.write("fields.zmx", long_zmx(400, 3000).as_bytes());
    let output = bench.run(&["lens", "fields.zmx", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(report["notes"].to_string().contains("of 3000 fields the first 25 are taken"));
    assert!(report["fields"].as_array().is_some_and(|fields| fields.len() == 25));

    let window = serde_json::json!({"type": "surface", "thickness": 1});
    let lens = serde_json::json!({"elements": vec![window; 1001]});
    bench.write("lens.json", lens.to_string().as_bytes());
    insta::assert_snapshot!(refused(&bench, &["lens.json"]), @"
    error: lens.json: the lens has 1001 elements, and 1000 are the most
    hint: leave out what bends no light
    ");
}

/// Glasses that disperse leave focal lengths at the d line where they were.
#[test]
fn the_double_gauss_and_the_fisheye_disperse() {
    let lenses = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/lenses");
    // Focal lengths of the lenses with constant indices, by the same command.
    for (name, efl) in [("double-gauss", 50.3582), ("fisheye", 9.99142)] {
        let path = lenses.join(format!("{name}.json"));
        let output = Bench::new().run(&["lens", &path.to_string_lossy(), "--json"]);
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let own = report["paraxial"]["efl"].as_f64().expect("a number");
        assert!((own / efl - 1.0).abs() < 1e-6, "{name}: {own}");
        let blue = report["colour"][0]["longitudinal"].as_f64().expect("a number");
        assert!(blue.abs() > 0.005 && blue.abs() < 0.01 * efl, "{name}: {blue} mm");
    }
}
