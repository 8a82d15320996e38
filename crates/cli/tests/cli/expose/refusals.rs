//! Pictures, light and sensors that do not go together, each refused with its remedy.

use std::fs;

use super::{counter, envi, npy};
use crate::run::{Bench, under};

/// Pictures and sensors of which each has one fault.
fn faulty() -> Bench {
    let bench = Bench::new();
    bench.write("sensor.json", counter().to_string().as_bytes());
    let cube = npy(&[1, 2, 2], &[1.0; 4]);
    bench.write("cube.npy", &cube);
    bench.write("grey.npy", &npy(&[2, 2], &[1.0; 4]));
    bench.write("line.npy", &npy(&[4], &[1.0; 4]));
    bench.write("cut.npy", &cube[..cube.len() - 1]);
    bench.write("words.exr", b"no image");
    let good = "wavelength units = nm\nwavelength = {500, 600}\n";
    envi(&bench, "good", good, 64);
    envi(&bench, "short", good, 60);
    envi(&bench, "far", "wavelength units = nm\nwavelength = {1500, 1600}\n", 64);
    envi(&bench, "micro", "wavelength = {0.55, 0.65}\n", 64);
    envi(&bench, "order", "wavelength units = nm\nwavelength = {600, 500}\n", 64);
    envi(&bench, "twice", "wavelength units = nm\nwavelength = {500, 500}\n", 64);
    envi(&bench, "nowhere", "", 64);
    envi(&bench, "share", &format!("{good}reflectance scale factor = 100\n"), 64);
    envi(&bench, "lux", &format!("{good}data units = lux\n"), 64);
    envi(&bench, "alone", good, 64);
    fs::remove_file(bench.path("alone.img")).unwrap();
    bench.write("orphan.img", &[0; 64]);
    fs::create_dir(bench.path("empty")).unwrap();
    fs::create_dir(bench.path("mixed")).unwrap();
    bench.write("mixed/a.npy", &cube);
    bench.write("mixed/b.exr", b"");
    bench.write("sized.json", br#"{"type": "raw", "resolution": [8, 8]}"#);
    bench.write("digital.json", br#"{"type": "raw", "radiometry": "digital"}"#);
    bench.write(
        "bands.json",
        br#"{"type": "multispectral", "system_gain": 1, "bands": [400, 450, 700]}"#,
    );
    bench
}

/// The messages that refuse each picture with a sensor and more arguments; nothing is left behind.
fn refused(cases: &[(&str, &str, &[&str])]) -> String {
    let bench = faulty();
    let messages = cases.iter().map(|&(image, sensor, more)| {
        let arguments = [&["expose", image, "--sensor", sensor, "-o", "again"], more].concat();
        let message = bench.refusal(&arguments);
        assert!(!bench.path("again").exists(), "{arguments:?}: something was left behind");
        under(&arguments.join(" "), &message)
    });
    messages.collect()
}

const IRRADIANCE: &[&str] = &["--unit", "W/m2/nm"];
const WITH_BANDS: &[&str] = &["--unit", "W/m2/nm", "--wavelengths", "500,600"];

#[test]
fn light_units_and_sensors_that_do_not_go_together_are_refused_with_the_remedy() {
    let messages = refused(&[
        ("grey.npy", "sensor.json", &[]),
        ("grey.npy", "sensor.json", &["--unit", "lux"]),
        ("grey.npy", "sensor.json", &["--unit", "W/m2/sr/nm"]),
        ("grey.npy", "sensor.json", &["--unit", "1", "--f-number", "4"]),
        ("grey.npy", "sensor.json", &["--unit", "1", "--f-number", "-4"]),
        ("grey.npy", "sized.json", &["--unit", "1"]),
        ("grey.npy", "digital.json", IRRADIANCE),
        ("grey.npy", "imx999", IRRADIANCE),
        ("cube.npy", "sensor.json", IRRADIANCE),
        ("cube.npy", "sensor.json", &["--unit", "1", "--wavelengths", "500"]),
        ("cube.npy", "sensor.json", &["--unit", "1", "--wavelengths", "1,2,3"]),
        ("cube.npy", "sensor.json", &["--unit", "1", "--wavelengths", "400,500,600"]),
        ("cube.npy", "sensor.json", &["--unit", "1", "--wavelengths", "600,500"]),
        ("cube.npy", "bands.json", WITH_BANDS),
        ("line.npy", "sensor.json", IRRADIANCE),
        ("cut.npy", "sensor.json", IRRADIANCE),
        ("words.exr", "sensor.json", IRRADIANCE),
        ("nothing.exr", "sensor.json", IRRADIANCE),
    ]);
    insta::assert_snapshot!(messages);
}

#[test]
fn pictures_that_make_no_sense_are_refused_by_file_and_place() {
    let messages = refused(&[
        ("good.hdr", "sensor.json", &[]),
        ("good.hdr", "sensor.json", WITH_BANDS),
        ("short.img", "sensor.json", IRRADIANCE),
        ("far.hdr", "sensor.json", IRRADIANCE),
        ("micro.hdr", "sensor.json", IRRADIANCE),
        ("order.hdr", "sensor.json", IRRADIANCE),
        ("twice.hdr", "sensor.json", IRRADIANCE),
        ("nowhere.hdr", "sensor.json", IRRADIANCE),
        ("share.hdr", "sensor.json", IRRADIANCE),
        ("lux.hdr", "sensor.json", &[]),
        ("alone.hdr", "sensor.json", IRRADIANCE),
        ("orphan.img", "sensor.json", IRRADIANCE),
        ("empty", "sensor.json", IRRADIANCE),
        ("mixed", "sensor.json", IRRADIANCE),
        ("grey.npy", "sensor.json", &["--unit", "1", "--outputs", "exr"]),
    ]);
    insta::assert_snapshot!(messages);
}
