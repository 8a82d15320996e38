//! `etendue expose`: a sensor before pictures from elsewhere, against the same sensor in a render, and against sums.

mod refusals;

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::run::{Bench, notes_in, text};

/// An array as numpy writes it.
pub(crate) fn npy(shape: &[usize], values: &[f32]) -> Vec<u8> {
    let shape: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let length = u16::try_from(header.len()).expect("a short header");
    bytes.extend(length.to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// Exposes an image into `again`, and gives the command's notes.
fn exposed(bench: &Bench, image: &str, sensor: &str, more: &[&str]) -> String {
    let arguments = [&["expose", image, "--sensor", sensor, "-o", "again"], more].concat();
    let output = bench.run(&arguments);
    let message = text(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    message
}

/// Asserts that all arrays of a sensor that stand in `out` stand in `again`, to the bit.
fn assert_same(bench: &Bench, out: &str, again: &str, what: &str) {
    let mut count = 0;
    for entry in fs::read_dir(bench.path(out)).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.starts_with("raw") && name.ends_with(".npy") {
            let [a, b] =
                [out, again].map(|folder| fs::read(bench.path(folder).join(&name)).unwrap());
            assert!(a == b, "{what}: {name} is another");
            count += 1;
        }
    }
    assert!(count > 0, "{what}: nothing was compared");
    let files = |folder: &str| {
        let names = fs::read_dir(bench.path(folder)).unwrap();
        let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> =
            names.filter(|name| name.starts_with("raw") || name == "sensor.json").collect();
        names.sort();
        names
    };
    assert_eq!(files(out), files(again), "{what}");
}

/// A ball before `sensor`, through `camera`.
fn scene(camera: &Value, sensor: &Value) -> Value {
    let mut camera = camera.clone();
    camera["sensor"] = sensor.clone();
    camera["pose"] = json!({ "from": [0, 0, 3], "look_at": [0, 0, 0] });
    json!({
        "etendue": 1, "camera": camera, "tracer": { "type": "facing" },
        "render": { "samples": 2, "seed": 11 },
        "objects": [{ "shape": "sphere", "material": "paint" }],
        "materials": { "paint": { "type": "matte", "color": [0.8, 0.5, 0.2] } }
    })
}

/// The oracle: the render exposes its light itself, and leaves it as a picture in 32-bit floats.
#[test]
fn pictures_of_renders_are_exposed_as_the_render_did_to_the_bit() {
    let curve = json!([[350, 0.1], [550, 0.6], [900, 0.2]]);
    let exposures = json!({ "exposures": [0.01, 0.1], "frames": 2, "moments": true });
    let noise = json!({
        "system_gain": 0.5, "bit_depth": 12, "read_noise": 2.5, "prnu": 0.01, "dsnu": 3, "black_level": 50,
        "dark_current": 20, "row_noise": 1, "column_noise": 0.5, "serial": 9
    });
    let bright = json!({ "radiometry": "physical", "pixel_pitch": 1 });
    let pinhole = json!({ "type": "pinhole", "fov": 45 });
    let lens =
        json!({ "type": "thin_lens", "focal_length": 0.02, "f_number": 4, "focus_distance": 2 });
    for (camera, keys) in [
        (&pinhole, json!({ "type": "raw", "cfa": "rggb" })),
        (&pinhole, json!({ "type": "rgb" })),
        (&pinhole, json!({ "type": "raw", "model": "imx183", "cfa": "grbg", "noise": "normal" })),
        (
            &pinhole,
            json!({ "type": "raw", "quantum_efficiency": curve, "cfa": "rgbw", "physical": true }),
        ),
        (&pinhole, json!({ "type": "multispectral", "bands": [400, 450, 520, 610, 700] })),
        (
            &lens,
            json!({
                "type": "multispectral", "bands": [400, 450, 520, 610, 700], "quantum_efficiency": curve,
                "physical": true
            }),
        ),
        (&lens, json!({ "type": "rgb", "quantum_efficiency": curve, "physical": true })),
    ] {
        let mut sensor = json!({ "resolution": [24, 16] });
        let mut merge = |keys: &Value| {
            for (key, value) in keys.as_object().unwrap() {
                sensor[key] = value.clone();
            }
        };
        let is_preset = keys.get("model").is_some();
        if !is_preset {
            merge(&noise);
        }
        merge(&exposures);
        merge(&keys);
        let is_physical = sensor.as_object_mut().unwrap().remove("physical").is_some();
        if is_physical {
            for (key, value) in bright.as_object().unwrap() {
                sensor[key] = value.clone();
            }
        }
        let mut scene = scene(camera, &sensor);
        if is_physical {
            // Some thousand electrons in a hundredth of a second.
            scene["tracer"] = json!({ "type": "flat" });
            scene["materials"]["paint"]["color"] = json!([8e-4, 5e-4, 2e-4]);
        }
        let bench = Bench::with_scene(&scene.to_string());
        let with_bands = sensor["type"] == "multispectral";
        bench.render(&[
            "--outputs",
            if with_bands { "exr,npy,png,dng,envi" } else { "exr,npy,png,dng" },
        ]);
        let mut grey = bench.array("raw_000");
        grey.sort_by(f64::total_cmp);
        grey.dedup();
        assert!(grey.len() > 30, "all black or white: {sensor}");
        let has_bands = bench.path("out/spectrum.npy").exists();
        let pictures = ["layers.exr", "picture.npy"].into_iter();
        let cubes =
            ["spectrum.npy", "spectrum.hdr", "spectrum.img"].into_iter().filter(|_| has_bands);
        for picture in pictures.chain(cubes) {
            // The file says its unit, its pupil and its noise.
            exposed(&bench, &format!("out/{picture}"), "scene.json", &[]);
            assert_same(&bench, "out", "again", &format!("{picture} of {sensor}"));
        }
        assert_eq!(has_bands, with_bands);
    }
}

/// Light of a tracer, whose bands the plan may divide further than the sensor's own: then the cube that is written
/// is of their means, and the electrons differ by what the plan's bands are for.
#[test]
fn light_through_a_lens_is_exposed_within_the_error_of_its_bands() {
    let bands: Vec<f64> = (0..=15).map(|k| 400.0 + 20.0 * f64::from(k)).collect();
    let sensor = json!({
        "type": "multispectral", "bands": bands, "resolution": [16, 12], "radiometry": "physical",
        "system_gain": 0.5, "bit_depth": 16, "noise": "none", "exposure": 0.002, "pixel_pitch": 5,
        "quantum_efficiency": [[380, 0.2], [550, 0.7], [800, 0.3]]
    });
    let camera =
        json!({ "type": "thin_lens", "focal_length": 0.1, "f_number": 2.8, "focus_distance": 2 });
    let mut scene = scene(&camera, &sensor);
    scene["tracer"] = json!({ "type": "direct" });
    scene["lights"] = json!([{ "type": "directional", "direction": [0, 0, -1], "irradiance": [1, 1, 1], "illuminant": "a" }]);
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--outputs", "exr,npy,envi"]);
    let own = bench.array("raw");
    assert!(own.iter().copied().fold(0.0, f64::max) > 5000.0, "no light, no test");
    for more in [&[][..], &["--f-number", "2.8", "--magnification", "0.00005"]] {
        exposed(&bench, "out/layers.exr", "scene.json", more);
        let again = read(&bench, "again/raw.npy");
        for (a, b) in own.iter().zip(&again) {
            // The mean over a band loses s·t/12 where the light changes by a share s over it and η·λ by t: of
            // illuminant A and the blue edge of the colours s = 0.45 and t = 0.26 at most in 20 nm, together 1 %.
            // Besides, a DN of rounding.
            assert!((a - b).abs() <= 1e-2 * a + 1.0, "{more:?}: {a} {b}");
        }
    }
}

fn read(bench: &Bench, name: &str) -> Vec<f64> {
    let bytes = fs::read(bench.path(name)).unwrap();
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[start..].as_chunks().0.iter().map(|&b| f64::from(u16::from_le_bytes(b))).collect()
}

const HC: f64 = 6.626_070_15e-34 * 299_792_458.0;

/// Electrons of an irradiance (W·m⁻²·nm⁻¹) over a range (nm), on 4 µm pixels in 10 ms at η = 0.5.
fn electrons(irradiance: f64, [from, to]: [f64; 2]) -> f64 {
    irradiance * 16e-12 * 0.01 * 0.5 / HC * 0.5 * (to * to - from * from) * 1e-9
}

fn counter() -> Value {
    json!({
        "type": "raw", "pixel_pitch": 4, "quantum_efficiency": [[300, 0.5], [1100, 0.5]], "system_gain": 1,
        "noise": "none", "exposure": 0.01
    })
}

#[test]
fn cubes_from_elsewhere_are_counted_by_area_time_and_energy() {
    let bench = Bench::new();
    bench.write("sensor.json", counter().to_string().as_bytes());
    // Two pixels in bands of 450 to 550 and 550 to 650 nm.
    bench.write("cube.npy", &npy(&[1, 2, 2], &[3e-4, 0.0, 6e-4, 9e-4]));
    let [low, high] = [[450.0, 550.0], [550.0, 650.0]];
    let expected = [electrons(3e-4, low), electrons(6e-4, low) + electrons(9e-4, high)];
    // π / (1 + 4·4²) of radiance, π / (1 + 4·4²·1.5²) at half of life size.
    let pupil = |square: f64| std::f64::consts::PI / (1.0 + 4.0 * 16.0 * square);
    for (more, factor) in [
        (&["--unit", "W/m2/nm"][..], 1.0),
        (&["--unit", "uW/cm^2/nm"], 1e-2),
        (&["--unit", "W/m2/sr/nm", "--f-number", "4"], pupil(1.0)),
        (&["--unit", "W/m2/sr/nm", "--f-number", "4", "--magnification", "0.5"], pupil(2.25)),
    ] {
        let all = [&["--wavelengths", "500,600"], more].concat();
        let notes = exposed(&bench, "cube.npy", "sensor.json", &all);
        for (found, expected) in read(&bench, "again/raw.npy").iter().zip(expected) {
            // Rounded to a DN of an electron; the film's f32 is finer.
            let expected = factor * expected;
            assert!(
                (found - expected).abs() <= 0.51 + 1e-6 * expected,
                "{more:?}: {found} {expected}"
            );
        }
        // λ weighs: 1 − (650² − 450²)/(1100² − 300²) = 80.4 %.
        assert!(notes.contains("from 450 to 650 nm") && notes.contains("80.4 %"), "{notes}");
    }
    // A multispectral sensor divides the cube's bands at its own.
    let own = json!({ "type": "multispectral", "bands": [480, 530, 600] });
    let mut sensor = counter();
    for (key, value) in own.as_object().unwrap() {
        sensor[key] = value.clone();
    }
    bench.write("own.json", sensor.to_string().as_bytes());
    exposed(&bench, "cube.npy", "own.json", &["--unit", "W/m2/nm", "--wavelengths", "500,600"]);
    let found = read(&bench, "again/raw.npy");
    let expected = [
        electrons(3e-4, [480.0, 530.0]),
        electrons(3e-4, [530.0, 550.0]),
        electrons(6e-4, [480.0, 530.0]),
        electrons(6e-4, [530.0, 550.0]) + electrons(9e-4, [550.0, 600.0]),
    ];
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 0.51 + 1e-6 * expected, "{found} {expected}");
    }
}

#[test]
fn what_is_no_light_counts_as_none_and_is_told() {
    let bench = Bench::new();
    bench.write("sensor.json", counter().to_string().as_bytes());
    let values = [f32::NAN, -1.0, f32::INFINITY, 1e-3];
    bench.write("grey.npy", &npy(&[2, 2], &values));
    let notes = exposed(&bench, "grey.npy", "sensor.json", &["--unit", "W/m2/nm"]);
    let raw = read(&bench, "again/raw.npy");
    assert!(raw[..3] == [0.0; 3] && raw[3] > 100.0, "{raw:?}");
    insta::assert_snapshot!(notes_in(&notes), @"
    note: 25.0 % of the pixels are saturated at an exposure of 0.01 s (65535 DN): set the sensor's `exposure` to 1.5e-3 s, at which nine pixels of ten have less than half of that, or use a smaller pupil
    note: 3 negative and 6 infinite or NaN values of the film are no light and were taken for none
    ");
    let invalid = &bench.json("again/sensor.json")["invalid"];
    assert!(
        invalid["negative"].as_u64() > Some(0) && invalid["not_finite"].as_u64() > Some(0),
        "{invalid}"
    );
}

/// The frames of a render, and pictures in a folder, draw noise of their own by their numbers.
#[test]
fn folders_of_frames_are_exposed_as_the_frames_of_a_render() {
    let sensor = json!({
        "type": "raw", "cfa": "rggb", "resolution": [16, 12], "system_gain": 0.5, "bit_depth": 12, "read_noise": 2
    });
    let mut scene = scene(&json!({ "type": "pinhole", "fov": 45 }), &sensor);
    scene["frames"] = json!([{}, { "camera.fov": 40 }, { "camera.fov": 35 }]);
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--outputs", "exr,npy"]);
    exposed(&bench, "out", "scene.json", &["--outputs", "npy"]);
    for frame in 0..3 {
        let [out, again] =
            ["out", "again"].map(|folder| format!("{folder}/frames/{frame:06}/raw.npy"));
        assert!(
            fs::read(bench.path(&out)).unwrap() == fs::read(bench.path(&again)).unwrap(),
            "{frame}"
        );
    }
    // The same picture thrice: each frame has noise of its own, the first that of a single picture.
    fs::create_dir(bench.path("pictures")).unwrap();
    let grey = npy(&[12, 16], &[0.5; 12 * 16]);
    for name in ["a", "b", "c"] {
        bench.write(&format!("pictures/{name}.npy"), &grey);
    }
    bench.write("one.npy", &grey);
    let told = exposed(&bench, "pictures", "scene.json", &["--unit", "1", "--seed", "5"]);
    for (number, done) in [(0, 1), (1, 2), (2, 3)] {
        assert!(told.contains(&format!("frame {number} ({done} of 3): ")), "{told}");
    }
    let quiet = exposed(&bench, "pictures", "scene.json", &["--unit", "1", "--seed", "5", "-q"]);
    assert_eq!(quiet, "");
    let raws: Vec<Vec<u8>> = (0..3)
        .map(|i| fs::read(bench.path(&format!("again/frames/{i:06}/raw.npy"))).unwrap())
        .collect();
    assert!(raws[0] != raws[1] && raws[1] != raws[2] && raws[0] != raws[2]);
    // Fewer frames than before leave no more of the others than of another command.
    fs::remove_file(bench.path("pictures/c.npy")).unwrap();
    exposed(&bench, "pictures", "scene.json", &["--unit", "1", "--seed", "5"]);
    assert!(!bench.path("again/frames/000002").exists(), "a frame of an earlier run is left");
    exposed(&bench, "one.npy", "scene.json", &["--unit", "1", "--seed", "5"]);
    assert!(fs::read(bench.path("again/raw.npy")).unwrap() == raws[0]);
    assert!(!bench.path("again/frames").exists());
    exposed(&bench, "one.npy", "scene.json", &["--unit", "1", "--seed", "6"]);
    assert!(fs::read(bench.path("again/raw.npy")).unwrap() != raws[0]);
}

#[test]
fn a_preset_takes_a_radiance_picture_whole() {
    let bench = Bench::new();
    let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n";
    bench.write("photo.hdr", &[header.as_bytes(), &[64, 64, 64, 127]].concat());
    // 64/256 · 2^(127 − 128) = 1/8 of full scale; the imx183 has 38 DN of black of 4095.
    let notes = exposed(&bench, "photo.hdr", "imx183", &["--unit", "1", "--set", "noise=none"]);
    assert_eq!(read(&bench, "again/raw.npy"), [(38.0_f64 + 4057.0 / 8.0).round()]);
    insta::assert_snapshot!(notes_in(&notes), @"note: the picture has 1 x 1 pixels, of the 5496 x 3672 of an IMX183");
    for name in ["raw.png", "raw.dng", "raw.preview.png", "sensor.json", "etendue-manifest.json"] {
        assert!(bench.path("again").join(name).exists(), "{name}");
    }
}

/// Of every kind of file, before it is read or before the sensor is asked.
#[test]
fn pictures_that_take_too_much_memory_are_refused_before_the_work() {
    let bench = Bench::new();
    // 48 MiB of numbers.
    bench.write("large.npy", &npy(&[2048, 2048, 3], &vec![0.25; 2048 * 2048 * 3]));
    let sensor = json!({ "type": "rgb", "noise": "none" });
    bench.write("sensor.json", sensor.to_string().as_bytes());
    let expose = |limit: &str| {
        bench.run(&[
            "expose",
            "large.npy",
            "--sensor",
            "sensor.json",
            "-o",
            "again",
            "--unit",
            "1",
            "--memory-limit",
            limit,
        ])
    };
    // An array of 48 MiB is read as 96, and held as f32 beside them; with the sensor it is no more than 600.
    for limit in ["32M", "128M", "200M"] {
        let output = expose(limit);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{limit}: {message}");
        for words in ["large.npy: a picture of 2048 x 2048 pixels", "--memory-limit allows"] {
            assert!(message.contains(words), "expected \"{words}\" in: {message}");
        }
        assert!(!bench.path("again").exists(), "{limit}: something was left behind");
    }
    let output = expose("1G");
    assert!(output.status.success(), "{}", text(&output.stderr));
    // A header alone tells.
    envi(&bench, "vast", "wavelength units = nm\nwavelength = {500, 600}\n", 64);
    let vast = std::fs::read_to_string(bench.path("vast.hdr")).unwrap();
    let vast = vast.replace("samples = 4", "samples = 40000").replace("lines = 2", "lines = 40000");
    bench.write("vast.hdr", vast.as_bytes());
    let output = bench.run(&[
        "expose",
        "vast.hdr",
        "--sensor",
        "sensor.json",
        "-o",
        "again",
        "--unit",
        "1",
        "--memory-limit",
        "1G",
    ]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

/// ENVI files of one band more or less; the numbers are zeros.
fn envi(bench: &Bench, name: &str, header: &str, bytes: usize) {
    let text = format!(
        "ENVI\nsamples = 4\nlines = 2\nbands = 2\ndata type = 4\ninterleave = bsq\nbyte order = 0\n{header}"
    );
    bench.write(&format!("{name}.hdr"), text.as_bytes());
    bench.write(&format!("{name}.img"), &vec![0; bytes]);
}

#[test]
fn a_picture_is_never_written_over() {
    let bench = Bench::new();
    bench.write("sensor.json", br#"{"type": "raw"}"#);
    fs::create_dir(bench.path("here")).unwrap();
    let bytes = npy(&[2, 2], &[0.5; 4]);
    bench.write("here/raw.npy", &bytes);
    let arguments =
        ["expose", "here/raw.npy", "--sensor", "sensor.json", "-o", "here", "--unit", "1"];
    insta::assert_snapshot!(bench.refusal(&arguments), @"
    error: here/raw.npy would be written over, and is read by this command; nothing was written
    hint: choose another folder or name
    ");
    assert_eq!(fs::read(bench.path("here/raw.npy")).unwrap(), bytes);
    assert!(Path::new(&bench.path("here")).read_dir().unwrap().count() == 1);
}
