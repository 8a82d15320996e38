//! f-numbers that a lens does not have, and glasses of earlier catalogues and of the user's own.

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

/// A biconvex lens of 24 mm diameter and 49 mm focal length: f/2.07.
const THICK: &str = r#""front_radius": 50, "rear_radius": -50, "thickness": 8,
    "semi_diameter": 12, "sensor_height": 24, "focus_distance": 2"#;

fn camera(bench: &Bench, camera: &str) {
    let scene =
        format!(r#"{{"etendue": 1, "camera": {{{camera}}}, "objects": [{{"shape": "sphere"}}]}}"#);
    bench.write("scene.json", scene.as_bytes());
}

/// A grey PNG of `side`² pixels, white at some.
fn mask(side: u32, white: &[[u32; 2]]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    let mut pixels = vec![0; (side * side) as usize];
    for &[x, y] in white {
        pixels[(y * side + x) as usize] = 255;
    }
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&pixels).expect("the pixels");
    drop(writer);
    file
}

#[test]
fn a_mask_of_one_open_pixel_passes_its_share_of_the_light_and_a_black_one_is_refused() {
    let bench = Bench::new();
    let scene = r#"{"etendue": 1, "tracer": {"type": "direct"},
        "camera": {"type": "thin_lens", "focal_length": "50 mm", "focus_distance": "infinity",
            "aperture": {"shape": "image", "file": "mask.png", "width": "20 mm"},
            "sensor_height": "0.01 mm", "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [4, 4]}},
        "objects": [{"shape": "sphere", "radius": 0.1, "transform": {"translate": [0, 0, 9]}}],
        "lights": [{"type": "environment", "radiance": [0.5, 0.5, 0.5]}],
        "render": {"samples": 64}}"#;
    bench.write("scene.json", scene.as_bytes());
    // cos^4 / d^2 over the open pixels, out of that over the whole mask, by the middles of 200 x 200 cells.
    let (f, width) = (50.0, 20.0);
    let light = |side: u32, [x, y]: [u32; 2]| {
        let pixel = width / f64::from(side);
        let at = |i: u32| (f64::from(i) + 0.5) * pixel - 0.5 * width;
        let d2 = f * f + at(x).powi(2) + at(y).powi(2);
        f * f / (d2 * d2) * pixel * pixel
    };
    let whole: f64 = (0..40_000).map(|i| light(200, [i % 200, i / 200])).sum();
    for side in [64, 256, 1024] {
        let white = [side * 5 / 8, side / 3];
        bench.write("mask.png", &mask(side, &[white]));
        bench.render(&[]);
        let picture = bench.array("picture");
        let mean = picture.iter().sum::<f64>() / picture.len() as f64;
        let expected = 0.5 * light(side, white) / whole;
        // One ray in a hundred is aimed anywhere: ten of 1024, give or take three.
        assert!((mean / expected - 1.0).abs() < 0.01, "{side}: {mean} for {expected}");
    }
    bench.write("mask.png", &mask(64, &[]));
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out"]), @"error: scene.json, line 2, column 9: camera: no light passes the lens: nothing gets from the sensor past elements[1] (vignetted at element 1: 100.000 %)");
}

#[test]
fn an_f_number_wider_than_the_lens_is_refused_with_the_widest() {
    let bench = Bench::new();
    let telephoto = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/telephoto.json");
    bench.write("telephoto.json", &std::fs::read(telephoto).unwrap());
    let thin = r#""type": "thin_lens", "focal_length": 50, "sensor_height": 24, "elements": [
        {"type": "aperture", "shape": "circular", "radius": 10, "at": -2}]"#;
    let mut all = String::new();
    for (written, narrower) in [
        (r#""type": "lens", "lens": "telephoto.json", "sensor_height": 6"#.to_owned(), 5.6),
        (format!(r#""type": "real_lens", "refractive_index": 1.52, {THICK}"#), 2.8),
        (format!(r#""type": "chromatic_real_lens", "glass": "BK7", {THICK}"#), 2.8),
        (thin.to_owned(), 2.6),
    ] {
        camera(&bench, &written);
        let f = |n: f64| format!("camera.f_number={n}");
        let message = bench.refusal(&["plan", "scene.json", "--set", &f(1.4)]);
        all += &under(&written, &message);
        // What it is said to have, it has.
        let number = message.split("opens to f/").nth(1).unwrap().split(' ').next().unwrap();
        let widest: f64 = number.parse().unwrap();
        for open in [widest, narrower] {
            let output = bench.run(&["plan", "scene.json", "--set", &f(open)]);
            assert!(output.status.success(), "f/{open}: {}", text(&output.stderr));
        }
    }
    insta::assert_snapshot!(all);
    let wider = ["lens", "telephoto.json", "--f-number", "4"];
    insta::assert_snapshot!(bench.refusal(&wider), @"error: --f-number: elements[3] is the stop and its opening cannot be set: the lens opens to f/4.81 at most: elements[1] ends wider beams on the axis");
}

/// Two glasses that nobody makes: by Sellmeier's formula and by Conrady's.
const OWN: &str = "CC made up\nNM OWN-1 2 0 1.6 60 0 1\nCD 1.5 0.01 0 0 0 0\nLD 0.35 2.5\n\
                   NM OWN-2 5 0 1.5 0 0 1\nCD 1.5 0.01 0.0005\nLD 0.35 2.5\n";

fn singlet(glass: &str) -> Value {
    json!({"elements": [
        {"type": "surface", "radius": 50, "thickness": 5, "glass": glass, "semi_diameter": 10},
        {"type": "surface", "radius": -50, "semi_diameter": 10}]})
}

#[test]
fn a_catalogue_of_ones_own_is_looked_up_by_every_command_that_reads_lenses() {
    let bench = Bench::new();
    bench.write("own.agf", OWN.as_bytes());
    bench.write("lens.json", singlet("OWN-1").to_string().as_bytes());
    camera(
        &bench,
        r#""type": "lens", "lens": "lens.json", "sensor_height": 4, "sensor": {"resolution": [8, 6]}"#,
    );
    let mut all = String::new();
    for command in [
        &["lens", "lens.json"][..],
        &["check", "scene.json"],
        &["plan", "scene.json"],
        &["render", "scene.json", "-o", "out", "--outputs", "npy"],
    ] {
        all += &under(&command.join(" "), &bench.refusal(command));
        let output = bench.run(&[command, &["--glass-catalog", "own.agf"]].concat());
        assert!(output.status.success(), "{command:?}: {}", text(&output.stderr));
    }
    insta::assert_snapshot!(all);
    // n² = 1 + 1.5 λ²/(λ² − 0.01) at 0.58756 µm.
    let output = bench.run(&["lens", "lens.json", "--json", "--glass-catalog", "own.agf"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let l2 = 0.58756_f64.powi(2);
    let expected = (1.0 + 1.5 * l2 / (l2 - 0.01)).sqrt();
    // The product of nanometres and a thousandth rounds.
    assert!((report["elements"][0]["index"].as_f64().unwrap() - expected).abs() < 1e-14);
    // The lens file may name its catalogues itself.
    let mut named = singlet("own:OWN-2");
    named["glass_catalogs"] = json!(["own.agf"]);
    bench.write("named.json", named.to_string().as_bytes());
    let output = bench.run(&["lens", "named.json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    named["glass_catalogs"] = json!(["named.json"]);
    bench.write("named.json", named.to_string().as_bytes());
    insta::assert_snapshot!(bench.refusal(&["lens", "named.json"]), @"error: named.json, line 1, column 168: glass_catalogs[0]: named.json: has no glass (a line that begins with NM): not an AGF catalogue");
    let absent = ["lens", "lens.json", "--glass-catalog", "absent.agf"];
    insta::assert_snapshot!(bench.refusal(&absent), @"error: the glass catalogue absent.agf: cannot be read: No such file or directory (os error 2)");
}

#[test]
fn glasses_of_earlier_catalogues_load_and_unknown_ones_are_told_their_kin() {
    let bench = Bench::new();
    for glass in
        ["BK7", "SK16", "B270", "BAFN10", "GERMANIUM", "ACRYLIC", "E48R", "517642", "K-LAFN5"]
    {
        bench.write("lens.json", singlet(glass).to_string().as_bytes());
        let output = bench.run(&["lens", "lens.json", "--wavelengths", "587.56"]);
        let message = text(&output.stderr);
        // Germanium has no index in the visible.
        assert!(output.status.success() || glass == "GERMANIUM", "{glass}: {message}");
        assert!(!message.contains("unknown glass"), "{glass}: {message}");
    }
    bench.write("lens.json", singlet("N-SK1").to_string().as_bytes());
    // The older name first.
    insta::assert_snapshot!(bench.refusal(&["lens", "lens.json"]), @r#"error: lens.json, line 1, column 15: elements[0].glass: unknown glass "N-SK1"; the nearest names known are SK1, N-SF1, N-SK2; a catalogue of your own is added with --glass-catalog FILE.agf, or by `glass_catalogs` of a lens file"#);
}

/// The glasses that 174 files on the web ask for beyond those that were known: which load now.
#[test]
fn at_least_150_of_174_public_lenses_find_their_glasses() {
    let Some(assets) = crate::run::assets("glass demand") else { return };
    let demand = std::fs::read_to_string(assets.join("reference/optics/glass-demand.tsv")).unwrap();
    let bench = Bench::new();
    let mut files = 0;
    for line in demand.lines().filter(|line| !line.starts_with('#')) {
        let (glass, count) = line.split_once('\t').unwrap();
        bench.write("lens.json", singlet(glass).to_string().as_bytes());
        let output = bench.run(&["lens", "lens.json"]);
        if text(&output.stderr).contains("unknown glass") {
            println!("{glass} is asked for by {count} and not known");
            files += count.trim().parse::<u32>().unwrap();
        }
    }
    // Of 174 files 119 were refused for a glass and 6 for other reasons; a file counts as often as it
    // has unknown glasses, so that at most `files` of them still are.
    assert!(174 - 6 - files >= 150, "{files} may still be refused");
    println!("at least {} of 174 load", 174 - 6 - files);
}

#[test]
fn a_scene_is_focused_at_infinity_by_that_word() {
    let bench = Bench::new();
    let thin = |focus: &str| {
        format!(
            r#""type": "thin_lens", "focal_length": 50, "f_number": 4, "sensor_height": 24,
               "pose": {{"from": [0, 0, 5], "look_at": [0, 0, 0]}},
               "sensor": {{"resolution": [4, 3]}}, "focus_distance": {focus}"#
        )
    };
    camera(&bench, &thin(r#""infinity""#));
    let output = bench.run(&["render", "scene.json", "-o", "out", "--outputs", "npy"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    // An object at infinity is none that JSON can write.
    assert!(bench.json("out/camera.json")["focus_distance_m"].is_null());
    camera(&bench, &thin(r#""2 parsecs""#));
    insta::assert_snapshot!(bench.refusal(&["plan", "scene.json"]), @r#"error: scene.json, line 3, column 50: camera.focus_distance: "2 parsecs": unknown unit `parsecs`, known: cm, ft, in, km, m, mm, nm, um"#);
}

#[test]
fn sizes_that_no_camera_has_are_told_before_the_render() {
    let bench = Bench::new();
    let thin =
        |more: &str| format!(r#""type": "thin_lens", "f_number": 4, "focus_distance": 2, {more}"#);
    for (more, said) in [
        (r#""focal_length": 0.05, "sensor_height": 24"#, "did you mean metres"),
        (
            r#""focal_length": 50, "sensor": {"resolution": [640, 480], "pixel_pitch": 2.4}"#,
            "the sensor is 1.536 x 1.152 mm",
        ),
    ] {
        camera(&bench, &thin(more));
        let output = bench.run(&["check", "scene.json"]);
        let words = text(&output.stdout) + &text(&output.stderr);
        assert!(words.contains(said), "{more}: {words}");
    }
    // A render that comes to nothing, by an image that is decoded before it, has said so already.
    let scene = serde_json::json!({
        "etendue": 1, "objects": [{"shape": "box"}], "tracer": {"type": "path"},
        "lights": [{"type": "environment", "image": "sky.hdr"}],
        "camera": {"type": "thin_lens", "f_number": 4, "focus_distance": 2, "focal_length": 0.05,
                   "sensor_height": 24, "sensor": {"resolution": [4, 3]}},
    });
    bench.write("scene.json", scene.to_string().as_bytes());
    bench.write("sky.hdr", b"not a sky");
    let message = bench.refusal(&["render", "scene.json", "-o", "out"]);
    let [note, error] = ["did you mean metres", "sky.hdr"].map(|words| message.find(words));
    assert!(note.is_some() && note < error, "{message}");
    camera(&bench, &thin(r#""focal_length": 50, "sensor_height": 24"#));
    let output = bench.run(&["check", "scene.json"]);
    let words = text(&output.stdout) + &text(&output.stderr);
    assert!(!words.contains("did you mean") && !words.contains("a crop of"), "{words}");
}
