//! Surfaces and lamps by wavelength from files: NPY, ENVI and spectral EXR, and what of them is refused.

use std::path::Path;
use std::process::Command;

use exr::prelude::{
    AnyChannel, AnyChannels, FlatSamples, Image, WritableImage, read_first_flat_layer_from_file,
};
use serde_json::{Value, json};

use crate::expose::npy;
use crate::run::{Bench, text, under};

/// The texels of two columns and one row, by bands.
pub(crate) const TEXELS: [[f32; 4]; 2] = [[0.1, 0.8, 0.2, 0.6], [0.9, 0.3, 0.5, 0.0]];

/// A wall of two texels that fills the picture, before a sensor of bands between `edges` (nm).
fn wall(material: &Value, edges: &[f64]) -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
            "sensor": { "type": "multispectral", "resolution": [4, 4], "bands": edges }
        },
        "tracer": { "type": "path" }, "render": { "samples": 1 },
        "objects": [{ "shape": "rectangle", "width": 1, "height": 1, "material": "a" }],
        "materials": { "a": material },
        "lights": [{ "type": "directional", "direction": [0, 0, -1],
                     "irradiance": ([std::f64::consts::PI; 3]) }]
    })
}

/// The light of each pixel, `[row][column][band]`.
pub(crate) fn seen(bench: &Bench, scene: &Value) -> Vec<f64> {
    bench.write("scene.json", scene.to_string().as_bytes());
    bench.render(&["--outputs", "npy", "--report", "report.json"]);
    bench.array("spectrum")
}

/// An EXR file of one row, a channel for each name.
pub(crate) fn exr(bench: &Bench, name: &str, channels: &[(&str, Vec<f32>)]) {
    let size = (channels[0].1.len(), 1);
    let list = channels
        .iter()
        .map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.clone())))
        .collect();
    let image = Image::from_channels(size, AnyChannels::sort(list));
    image.write().to_file(bench.path(name)).expect("an EXR");
    assert!(read_first_flat_layer_from_file(bench.path(name)).is_ok());
}

/// The four bands of [`TEXELS`] as channels of these names.
pub(crate) fn planes(names: [&str; 4]) -> Vec<(&str, Vec<f32>)> {
    (0..4).map(|k| (names[k], TEXELS.map(|texel| texel[k]).to_vec())).collect()
}

/// An ENVI cube of two columns, one row and four bands by pixels, of f32.
pub(crate) fn envi(bench: &Bench, name: &str, more: &str, values: [[f32; 4]; 2]) {
    let header = format!(
        "ENVI\nsamples = 2\nlines = 1\nbands = 4\ndata type = 4\ninterleave = bip\nbyte order = 0\n{more}"
    );
    bench.write(&format!("{name}.hdr"), header.as_bytes());
    let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    bench.write(&format!("{name}.img"), &bytes);
}

pub(crate) const EVEN: &str = "wavelength units = Nanometers\nwavelength = {450, 550, 650, 750}\n";

pub(crate) const BANDS: [f64; 5] = [400.0, 500.0, 600.0, 700.0, 800.0];

#[test]
fn cubes_of_all_forms_are_one_surface_and_one_lamp() {
    let bench = Bench::new();
    bench.write("a.npy", &npy(&[1, 2, 4], TEXELS.as_flattened()));
    envi(&bench, "a", EVEN, TEXELS);
    // By lines, of 16 bits, the greatest byte first, in micrometres.
    let header = "ENVI\nsamples = 2\nlines = 1\nbands = 4\ndata type = 12\ninterleave = bil\nbyte order = 1\n\
        reflectance scale factor = 10000\nwavelength units = Micrometers\nwavelength = {0.45, 0.55, 0.65, 0.75}\n";
    bench.write("b.hdr", header.as_bytes());
    let numbers = (0..4).flat_map(|k| TEXELS.map(|texel| (1e4 * f64::from(texel[k])).round()));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 10000")]
    let bytes: Vec<u8> = numbers.flat_map(|v| (v as u16).to_be_bytes()).collect();
    bench.write("b.dat", &bytes);
    let shares = ["T.450,0nm", "T.550,0nm", "T.650,0nm", "T.750,0nm"];
    let light = ["S0.450,0nm", "S0.550,0nm", "S0.650,0nm", "S0.750,0nm"];
    // Of a file that has both, a surface has what is reflected.
    let mut both = planes(shares);
    both.extend(light.map(|name| (name, vec![7.0, 7.0])));
    exr(&bench, "a.exr", &both);
    exr(&bench, "light.exr", &planes(light));
    let array = json!({ "cube": "a.npy", "bands": BANDS, "filter": "nearest" });
    let other = |name: &str| json!({ "cube": name, "filter": "nearest" });
    // The means over a band of straight lines between the bands' middles; the ends are held.
    let mean = |texel: usize, i: usize| {
        let v = TEXELS[texel].map(f64::from);
        0.75 * v[i] + 0.125 * (v[i.saturating_sub(1)] + v[(i + 1).min(3)])
    };
    let matte = |cube: Value| wall(&json!({ "type": "matte", "color": cube }), &BANDS);
    let surface = seen(&bench, &matte(array.clone()));
    for (pixel, texel) in [(4, 0), (7, 1)] {
        for i in 0..4 {
            let found = surface[4 * pixel + i];
            // Films are f32.
            assert!((found - mean(texel, i)).abs() < 1e-6, "{texel} {i}: {found}");
        }
    }
    for name in ["a.hdr", "a.img", "b.hdr", "b.dat", "a.exr"] {
        assert_eq!(seen(&bench, &matte(other(name))), surface, "{name}");
    }
    // A lamp is dark beyond the outer edges of its bands.
    let wide = [350.0, 400.0, 500.0, 600.0, 700.0, 800.0, 900.0];
    let lamp = |cube: Value| wall(&json!({ "type": "emissive", "radiance": cube }), &wide);
    let shining = seen(&bench, &lamp(array));
    for (pixel, texel) in [(4, 0), (7, 1)] {
        let found = &shining[6 * pixel..][..6];
        assert_eq!([found[0], found[5]], [0.0, 0.0], "{found:?}");
        for i in 0..4 {
            assert!((found[i + 1] - mean(texel, i)).abs() < 1e-6, "{texel} {i}: {found:?}");
        }
    }
    for name in ["a.hdr", "light.exr"] {
        assert_eq!(seen(&bench, &lamp(other(name))), shining, "{name}");
    }
}

/// A cube of one texel, whose wavelengths are unequally far apart, is the curve through them.
#[test]
fn wavelengths_are_the_file_s_own() {
    let bench = Bench::new();
    let values = [0.2f32, 0.7, 0.1, 0.9];
    let more = "wavelength units = nm\nwavelength = {410, 430, 500, 690}\n";
    envi(&bench, "a", more, [values; 2]);
    let points: Vec<(f64, f64)> =
        [410.0, 430.0, 500.0, 690.0].into_iter().zip(values.map(f64::from)).collect();
    let of = |color: Value| wall(&json!({ "type": "matte", "color": color }), &BANDS);
    let cube = seen(&bench, &of(json!({ "cube": "a.hdr" })));
    let curve = seen(&bench, &of(json!({ "curve": points })));
    for (cube, curve) in cube.iter().zip(&curve) {
        // Texels and films are f32.
        assert!((cube - curve).abs() < 1e-6, "{cube} {curve}");
    }
    assert!(curve.iter().all(|value| *value > 0.1), "{curve:?}");
}

/// A floor under a lamp of one spectrum all over, in visible and in invisible light: the cube is the curve.
#[test]
fn lamps_of_cubes_light_what_is_around_them() {
    let bench = Bench::new();
    let values = [1.0f32, 4.0, 2.0, 3.0];
    for start in [400.0, 900.0] {
        let edges = [0.0, 100.0, 200.0, 300.0, 400.0].map(|nm| start + nm);
        bench.write("lamp.npy", &npy(&[1, 2, 4], [values; 2].as_flattened()));
        let mut points: Vec<(f64, f64)> = vec![(edges[0], 1.0), (edges[4], 3.0)];
        points.extend((0..4).map(|i| (edges[i] + 50.0, f64::from(values[i]))));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let lit = |radiance: Value| {
            let mut scene = wall(&json!({ "type": "matte", "color": [0.5, 0.5, 0.5] }), &edges);
            scene["materials"]["lamp"] = json!({ "type": "emissive", "radiance": radiance });
            scene["objects"].as_array_mut().unwrap().push(json!({
                "shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
                "transform": { "rotate": [1, 0, 0, 90], "translate": [0, 0.9, 0.6] }
            }));
            scene["render"]["samples"] = json!(256);
            scene["lights"] = json!([]);
            let light = seen(&bench, &scene);
            let mean = |i: usize| light.iter().skip(i).step_by(4).sum::<f64>() / 16.0;
            [mean(0), mean(1), mean(2), mean(3)]
        };
        let cube = lit(json!({ "cube": "lamp.npy", "bands": edges }));
        let curve = lit(json!({ "curve": points }));
        println!("from {start} nm: {cube:?} {curve:?}");
        for i in 0..4 {
            assert!(cube[i] > 0.0, "{start}: {cube:?}");
            // Both are 4096 samples of one lamp, each spread by about its mean.
            assert!((cube[i] / curve[i] - 1.0).abs() < 0.05, "{start}: {cube:?} {curve:?}");
            // All bands have the same paths: f32.
            let ratio = (cube[i] / cube[0]) / (curve[i] / curve[0]);
            assert!((ratio - 1.0).abs() < 1e-5, "{start}: {cube:?} {curve:?}");
        }
    }
}

/// The report of a render tells how much a curve or a cube is held beyond its ends.
#[test]
fn what_ends_inside_the_sensor_s_range_is_told() {
    let bench = Bench::new();
    envi(&bench, "a", EVEN, TEXELS);
    let curve = json!({ "curve": [[400, 0.4], [800, 0.5]] });
    let cases = [
        (json!({ "cube": "a.hdr" }), [400.0, 900.0], Some("\"a\" over 100 nm (20 %)")),
        (json!({ "cube": "a.hdr" }), [350.0, 850.0], Some("\"a\" over 100 nm (20 %)")),
        (json!({ "cube": "a.hdr" }), [850.0, 950.0], Some("\"a\" over 100 nm (100 %)")),
        (json!({ "cube": "a.hdr" }), [400.0, 800.0], None),
        (curve.clone(), [300.0, 800.0], Some("\"a\" over 100 nm (20 %)")),
        (curve, [450.0, 700.0], None),
    ];
    for (color, edges, told) in cases {
        seen(&bench, &wall(&json!({ "type": "matte", "color": color }), &edges));
        let notes = bench.json("report.json")["notes"].to_string();
        let found = notes.contains("they are held as they end");
        assert_eq!(found, told.is_some(), "{color} {edges:?}: {notes}");
        // As it stands in JSON.
        let words = told.unwrap_or_default().replace('"', "\\\"");
        assert!(notes.contains(&words), "{color} {edges:?}: {notes}");
    }
}

#[test]
fn what_is_no_cube_is_refused_with_its_place() {
    let bench = Bench::new();
    bench.write("a.npy", &npy(&[1, 2, 4], TEXELS.as_flattened()));
    bench.write("deep.npy", &npy(&[1, 2, 2, 2], TEXELS.as_flattened()));
    envi(&bench, "good", EVEN, TEXELS);
    envi(&bench, "order", &EVEN.replace("550, 650", "650, 550"), TEXELS);
    envi(&bench, "twice", &EVEN.replace("550, 650", "550, 550"), TEXELS);
    envi(&bench, "micro", "wavelength = {0.45, 0.55, 0.65, 0.75}\n", TEXELS);
    envi(&bench, "nowhere", "", TEXELS);
    envi(&bench, "short", EVEN, TEXELS);
    bench.write("short.img", &[0; 31]);
    envi(&bench, "alone", EVEN, TEXELS);
    std::fs::remove_file(bench.path("alone.img")).unwrap();
    bench.write("orphan.img", &[0; 32]);
    envi(&bench, "above", EVEN, [TEXELS[0], [0.5, 0.5, 1.5, 0.5]]);
    envi(&bench, "below", EVEN, [TEXELS[0], [0.5, -0.5, 0.5, 0.5]]);
    envi(&bench, "holes", &format!("{EVEN}data ignore value = 0\n"), TEXELS);
    envi(&bench, "share", &format!("{EVEN}reflectance scale factor = 1\n"), TEXELS);
    exr(&bench, "light.exr", &planes(["S0.450,0nm", "S0.550,0nm", "S0.650,0nm", "S0.750,0nm"]));
    exr(&bench, "rgb.exr", &planes(["R", "G", "B", "A"]));
    bench.write("words.txt", b"no cube");
    let color = |cube: Value| json!({ "type": "matte", "color": cube });
    let of = |name: &str| color(json!({ "cube": name }));
    let light = |name: &str| json!({ "type": "emissive", "radiance": { "cube": name } });
    let array = json!({ "cube": "a.npy", "bands": [400, 500, 600] });
    let with_illuminant =
        json!({ "type": "emissive", "radiance": { "cube": "good.hdr" }, "illuminant": "d65" });
    let materials = [
        of("a.npy"),
        color(array),
        color(json!({ "cube": "deep.npy", "bands": BANDS })),
        color(json!({ "cube": "good.hdr", "bands": BANDS })),
        of("order.hdr"),
        of("twice.img"),
        of("micro.hdr"),
        of("nowhere.hdr"),
        of("short.hdr"),
        of("alone.hdr"),
        of("orphan.img"),
        of("above.hdr"),
        of("holes.hdr"),
        of("light.exr"),
        of("rgb.exr"),
        of("words.txt"),
        of("none.hdr"),
        light("share.hdr"),
        light("below.hdr"),
        light("rgb.exr"),
        with_illuminant,
    ];
    let refused = |scene: &Value| {
        bench.write("scene.json", scene.to_string().as_bytes());
        let message = bench.refusal(&["render", "scene.json", "-o", "out"]);
        assert!(!bench.path("out").exists(), "something was left behind: {message}");
        message
    };
    let messages =
        materials.map(|material| under(&material.to_string(), &refused(&wall(&material, &BANDS))));
    insta::assert_snapshot!(messages.concat());
    // A lamp that nothing of is rendered.
    let far = wall(&light("good.hdr"), &[900.0, 950.0, 1000.0]);
    insta::assert_snapshot!(refused(&far), @r#"
    error: scene.json: a light's spectrum: the curve covers 400..=800 nm, the spectral bands 900..=1000 nm: they do not overlap
    hint: give the light `equal_energy`, `a` or {"black_body": kelvin}, which reach further, or a curve or cube that does, or the sensor a quantum_efficiency or bands that see it
    "#);
    let mut thrown = wall(&of("good.hdr"), &BANDS);
    thrown["lights"] = json!([{ "type": "projector", "intensity": [1, 1, 1], "at": [0, 0, 2], "look_at": [0, 0, 0],
                                "image": { "cube": "good.hdr" } }]);
    insta::assert_snapshot!(refused(&thrown), @"error: scene.json, line 1, column 217: lights[0].image: is a cube, which a projector does not throw: it throws images and checkers, and their spectrum is that of its `intensity`");
}

/// Curves that a lens file names are those beside it, and what is none is told with its place in that file.
#[test]
fn lens_files_name_curves_from_their_own_folder() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("lenses")).unwrap();
    bench.write("lenses/coating.csv", b"nm,red,blue\n400,0.1,0.9\n800,0.9,0.1\n");
    // Not this one.
    bench.write("coating.csv", b"nm,red,blue\n400,0,0\n800,0,0\n");
    let lens = |transmission: Value| {
        let elements = json!([
            { "type": "filter", "transmission": transmission, "thickness": 1 },
            { "type": "aperture", "shape": "circular", "radius": 2, "thickness": 1, "stop": true },
            { "type": "surface", "radius": 50, "thickness": 5, "glass": "N-BK7", "semi_diameter": 4 },
            { "type": "surface", "radius": -50, "semi_diameter": 4 }
        ]);
        json!({ "elements": elements })
    };
    let through = |transmission: Value| {
        bench.write("lenses/lens.json", lens(transmission).to_string().as_bytes());
        let mut scene = wall(&json!({ "type": "matte", "color": [0.5, 0.5, 0.5] }), &BANDS);
        let sensor = scene["camera"]["sensor"].clone();
        scene["camera"] = json!({
            "type": "lens", "lens": "lenses/lens.json", "focus_distance": 2, "sensor_height": 4,
            "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] }, "sensor": sensor
        });
        scene
    };
    let listed = seen(&bench, &through(json!([[400, 0.9], [800, 0.1]])));
    let named = seen(&bench, &through(json!({ "file": "coating.csv", "column": "blue" })));
    let lit = listed.iter().filter(|value| **value > 0.0).count();
    assert!(lit > 48, "no light, no test: {listed:?}");
    assert_eq!(named, listed);
    let alone = bench.run(&["lens", "lenses/lens.json"]);
    assert!(alone.status.success(), "{}", String::from_utf8_lossy(&alone.stderr));
    let curves = [
        json!({ "file": "none.csv" }),
        json!({ "file": "coating.csv" }),
        json!({ "file": "coating.csv", "column": "green" }),
    ];
    let messages = curves.map(|curve| {
        bench.write("scene.json", through(curve.clone()).to_string().as_bytes());
        under(&curve.to_string(), &bench.refusal(&["render", "scene.json", "-o", "refused"]))
    });
    insta::assert_snapshot!(messages.concat());
}

/// The table and the Python of docs/explanation/spectra.md, on what its command leaves. Takes the interpreter that
/// `ETENDUE_PYTHON` names, else `python3`, where it has numpy.
#[test]
#[cfg(unix)]
fn the_page_of_spectra_runs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = std::fs::read_to_string(root.join("docs/explanation/spectra.md")).unwrap();
    let block = |kind: &str| {
        let rest = page.split(&format!("```{kind}\n")).nth(1).expect("a block");
        rest.split("```").next().expect("its end").to_owned()
    };
    let bench = Bench::new();
    bench.write("measured.csv", block("csv").as_bytes());
    let leaf = json!({ "type": "matte", "color": { "file": "measured.csv", "column": "leaf" } });
    let light = seen(&bench, &wall(&leaf, &[400.0, 500.0, 600.0, 700.0]));
    // From 500 to 600 nm: the mean of two trapezoids, 0.08 to 0.18 and 0.18 to 0.09.
    assert!((light[1] - 0.1325).abs() < 1e-6, "{light:?}");
    let python = std::env::var("ETENDUE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_numpy = Command::new(&python).args(["-c", "import numpy"]).output();
    if !has_numpy.is_ok_and(|output| output.status.success()) {
        println!("passed over: {python} has no numpy");
        return;
    }
    assert!(page.contains("etendue render scenes/color-checker.json -o out/spectra/bands\n"));
    let scene = root.join("scenes/color-checker.json");
    let render = ["render", &scene.to_string_lossy(), "-o", "out/spectra/bands", "-q"];
    let output = bench.run(&[&render[..], &["--outputs", "npy"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    std::os::unix::fs::symlink(root.join("scenes"), bench.path("scenes")).unwrap();
    bench.write("page.py", block("python").as_bytes());
    let output = Command::new(&python).arg("page.py").current_dir(bench.path("")).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: f64 = text(&output.stdout).trim().parse().expect("a number");
    // "It prints 0.003", in as many digits.
    assert!((0.0025..0.0035).contains(&found), "{found}");
}
