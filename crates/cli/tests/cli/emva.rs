//! The command's series through the reference implementation of EMVA 1288; without a network it is
//! skipped, and says so.

#[path = "../../../sensor/tests/sensor/environment.rs"]
pub(crate) mod environment;
#[path = "../../../sensor/tests/sensor/emva/python.rs"]
mod python;

use serde_json::json;

use crate::run::{Bench, text};

#[test]
fn a_sensor_file_comes_back_from_its_characterisation() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            println!("skipped: the reference implementation of EMVA 1288 cannot be had: {why}");
            return;
        }
    };
    let bench = Bench::new();
    // No preset: eight times the dark current of room temperature, saturated by its well.
    let sensor = json!({
        "type": "raw", "resolution": [400, 300], "quantum_efficiency": [[400, 0.3], [700, 0.6]],
        "system_gain": 0.31, "read_noise": 4.5, "dark_current": 3, "dark_current_doubling": 7,
        "temperature": 314.15, "full_well": 9000, "black_level": 120, "bit_depth": 12,
        "prnu": 0.011, "dsnu": 5, "serial": 77
    });
    bench.write("sensor.json", sensor.to_string().as_bytes());
    let arguments = ["sensor", "sensor.json", "--emva", "out", "--wavelength", "600", "--quiet"];
    let output = bench.run(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let results = python::characterised(&python, &bench.path("out/emva1288.txt"));
    // The implementation's own resolution on 256 × 256 pixels and 25 steps (one standard error).
    for (key, expected, resolution) in [
        ("system_gain", 0.31, 0.001_5),
        ("quantum_efficiency", 0.5, 0.001_5),
        ("dark_noise", 4.5, 0.002_2),
        ("dark_current_by_mean", 24.0, 0.002),
        ("dsnu", 5.0, 0.003),
        ("prnu", 0.011, 0.004),
    ] {
        let found = results[key].as_f64().unwrap();
        let error = (found / expected - 1.0) / resolution;
        assert!(error.abs() < 4.0, "{key}: {found}, not {expected}: {error:.1} errors");
    }
    for end in results["linearity_error"].as_array().unwrap() {
        assert!(end.as_f64().unwrap().abs() < 0.02, "linearity error {end} %");
    }
}
