//! Aspheres that are walls within their clear aperture: a camera behind one is made in time, whatever the order.
#![cfg(target_os = "linux")]

use std::fs;

use etendue_camera::CameraSpec;
use etendue_geometry::Bounds;
use etendue_spectrum::Bands;
use serde_json::json;

/// Processor time of the process so far, of all its threads (s).
fn processor_time() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    // Behind the program's name, which may have blanks; hundredths of a second.
    let fields: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split(' ').collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().unwrap()).sum::<f64>() / 100.0
}

/// The processor time that it takes to make a camera whose lens has a stop in front of an asphere with these
/// terms, and to open it for colours (s).
fn set_up(aspheric: &serde_json::Value) -> f64 {
    let spec: CameraSpec = serde_json::from_value(json!({
        "type": "lens", "focus_distance": 3, "sensor_height": 10, "sensor": {"resolution": [12, 8]},
        "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "lens": {"elements": [
            {"type": "aperture", "shape": "circular", "radius": 4, "thickness": 2, "stop": true},
            {"type": "surface", "radius": 40, "thickness": 5, "glass": "N-BK7", "semi_diameter": 8,
             "aspheric": aspheric},
            {"type": "surface", "radius": -60, "semi_diameter": 8}]}
    }))
    .unwrap();
    let start = processor_time();
    let camera = spec.build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned())).unwrap();
    camera.opened(&Bands::Rgb).unwrap();
    processor_time() - start
}

#[test]
fn a_camera_is_set_up_in_time_whatever_the_order_of_its_asphere() {
    for (order, coefficients) in [
        ("4", [1.0, 1e-3]),
        ("8", [1e-3, 1e-6]),
        ("16", [1e-10, 1e-14]),
        ("30", [1e-15, 1e-22]),
        ("30", [1e-26, -1e-22]),
    ] {
        for coefficient in coefficients {
            let seconds = set_up(&json!({order: coefficient}));
            println!("{coefficient} of order {order}: {seconds} s");
            // Two processors are under 2 s.
            assert!(seconds < 4.0, "{coefficient} of order {order}: {seconds} s");
        }
    }
}
