//! Light in bands as files: the layout of spectral EXR images and ENVI cubes, by others' readers and writers.

use std::path::Path;
use std::process::Command;

use serde_json::json;

use crate::emva::environment;
use crate::run::{Bench, text};

/// A ball under a lamp before a sensor of these bands (nm), which looks through no lens.
fn rendered(bands: &[f64], outputs: &str) -> Bench {
    let scene = json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 2.5,
            "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
            "sensor": {
                "type": "multispectral", "bands": bands, "resolution": [12, 9], "pixel_pitch": 4,
                "system_gain": 0.5, "radiometry": "physical", "exposure": 1e-5
            }
        },
        "tracer": { "type": "facing" }, "layers": ["depth"], "render": { "samples": 1 },
        "objects": [{ "shape": "sphere", "material": "paint" }],
        "materials": { "paint": { "type": "matte", "color": [2e-4, 1e-4, 3e-4] } }
    });
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--outputs", outputs]);
    bench
}

/// Beyond 1000 nm names sort otherwise than wavelengths do.
const BANDS: [f64; 6] = [400.0, 450.0, 505.0, 600.0, 700.0, 1500.0];

#[test]
fn bands_are_written_by_the_layout_of_spectral_images() {
    let bench = rendered(&BANDS, "exr,npy,envi");
    let image =
        exr::prelude::read_first_flat_layer_from_file(bench.path("out/layers.exr")).unwrap();
    let list = &image.layer_data.channel_data.list;
    let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
    let expected = [
        "B",
        "Depth.Z",
        "G",
        "R",
        "S0.1100,0nm",
        "S0.425,0nm",
        "S0.477,5nm",
        "S0.552,5nm",
        "S0.650,0nm",
    ];
    assert_eq!(names, expected);
    let attributes = &image.layer_data.attributes.other;
    let attribute = |name: &str| {
        let found = attributes.iter().find(|(key, _)| **key == *name);
        match found.map(|(_, value)| value) {
            Some(exr::prelude::AttributeValue::Text(text)) => text.to_string(),
            other => panic!("{name}: {other:?}"),
        }
    };
    assert_eq!(attribute("spectralLayoutVersion"), "1.0");
    // Cameras without an aperture give irradiance on the sensor.
    assert_eq!(attribute("emissiveUnits"), "W.m^-2.nm^-1");
    let cube = bench.array("spectrum");
    let band: Vec<f64> = list[6].sample_data.values_as_f32().map(f64::from).collect();
    let expected: Vec<f64> = cube.iter().skip(1).step_by(5).copied().collect();
    assert_eq!(band, expected);
    let layers = bench.json("out/layers.json").to_string();
    assert!(layers.contains("S0.552,5nm"), "{layers}");
    let header = std::fs::read_to_string(bench.path("out/spectrum.hdr")).unwrap();
    for line in [
        "samples = 12\nlines = 9\nbands = 5\n",
        "wavelength = {425, 477.5, 552.5, 650, 1100}",
        "fwhm = {50, 55, 95, 100, 800}",
        "data units = W.m^-2.nm^-1",
        "default bands = {4, 3, 2}",
    ] {
        assert!(header.contains(line), "{line} in {header}");
    }
    assert_eq!(std::fs::metadata(bench.path("out/spectrum.img")).unwrap().len(), 12 * 9 * 5 * 4);
    // Files of another run go with it.
    bench.render(&["--outputs", "png"]);
    assert!(!bench.path("out/spectrum.img").exists() && !bench.path("out/spectrum.hdr").exists());
}

#[test]
fn an_envi_cube_wants_a_sensor_of_bands() {
    let scene = r#"{"etendue": 1, "tracer": {"type": "facing"}, "objects": [{"shape": "sphere"}]}"#;
    let bench = Bench::with_scene(scene);
    let envi = ["render", "scene.json", "-o", "out", "--outputs", "envi"];
    insta::assert_snapshot!(bench.refusal(&envi), @"
    error: outputs: `envi` is a file of light in bands, and the scene has no such layer
    hint: give `camera.sensor` the `type` `multispectral` and `bands`, or leave `envi` out
    ");
}

#[test]
fn others_read_and_write_the_same_light() {
    let packages =
        ["numpy", "colour-science==0.4.7", "spectral==0.25", "OpenImageIO>=3", "OpenEXR>=3.3"];
    let python = match environment::python_with("spectral-readers-1", &packages) {
        Ok(python) => python,
        // Without a network there is nobody to ask; where the others are asked for, they must come.
        Err(why) if std::env::var_os("ETENDUE_NEEDS_READERS").is_none() => {
            println!("skipped: others' readers cannot be had: {why}");
            return;
        }
        Err(why) => panic!("others' readers cannot be had: {why}"),
    };
    let bands: Vec<f64> = (0..=12).map(|k| 400.0 + 25.0 * f64::from(k)).collect();
    let bench = rendered(&bands, "exr,npy,envi");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/spectral_readers.py");
    let mut command = Command::new(python);
    let output = command.arg(script).arg(bench.path("out")).arg("W.m^-2.nm^-1").output().unwrap();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    // What they wrote is the same light to a sensor.
    let own = bench.array("raw");
    for (name, unit) in [
        ("theirs.exr", &["--unit", "W/m2/nm"][..]),
        ("theirs-bsq.hdr", &[]),
        ("theirs-bil.hdr", &[]),
        ("theirs-bip.img", &[]),
    ] {
        let image = format!("out/{name}");
        let seed = bench.json("out/sensor.json")["noise_seed"].to_string();
        let arguments =
            ["expose", &image, "--sensor", "scene.json", "-o", "again", "--seed", &seed];
        let output = bench.run(&[&arguments[..], unit].concat());
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        let raw = std::fs::read(bench.path("again/raw.npy")).unwrap();
        assert!(raw == std::fs::read(bench.path("out/raw.npy")).unwrap(), "{name}");
    }
    let is_grey = |value: &&f64| **value > 100.0 && **value < 65_535.0;
    assert!(own.iter().filter(is_grey).count() > 100, "no light, no test");
}
