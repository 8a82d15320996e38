//! Data sets of frames whose cameras move while they are exposed, as others read them, and the readings of an inertial
//! unit beside pictures.

use serde_json::{Value, json};

use crate::run::{Bench, notes_in, text, under};

const SIZE: [usize; 2] = [16, 12];

/// Two frames of a camera that flies and turns while its rows are read.
fn scene(shutter: &Value) -> Value {
    json!({
        "etendue": 1,
        "layers": ["depth"],
        "camera": {
            "type": "pinhole", "fov": 50, "pose": { "from": [0.2, 0.3, 3], "look_at": [0, 0, 0] },
            "sensor": { "resolution": SIZE }, "shutter": shutter,
            "motion": { "type": "velocity", "velocity": [2, -1, 3], "angular_velocity": [30, 200, -60] }
        },
        "objects": [{ "shape": "sphere" }],
        "frames": [{}, { "camera.pose.from": [0.4, 0.1, 3] }],
        "render": { "rate": 10 }
    })
}

type Matrix = [[f64; 4]; 4];

fn matrix(value: &Value) -> Matrix {
    serde_json::from_value(value.clone()).unwrap()
}

fn vector(value: &Value) -> [f64; 3] {
    serde_json::from_value(value.clone()).unwrap()
}

/// The rotation by a vector (radians): Rodrigues' formula.
fn turned(by: [f64; 3]) -> [[f64; 3]; 3] {
    let angle = by.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = by.map(|component| component / angle);
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
    ]
}

#[test]
fn readers_of_transforms_find_each_row_where_it_was_taken() {
    let (line, exposure) = (2e-3, 5e-3);
    let shutter = json!({ "type": "rolling", "line_time": line, "exposure": exposure });
    let bench = Bench::with_scene(&scene(&shutter).to_string());
    bench.render(&[]);
    let all = bench.json("out/transforms.json");
    assert_eq!(all["exposure_time"].as_f64(), Some(exposure));
    let readout = all["rolling_shutter_time"].as_f64().unwrap();
    assert!((readout - line * SIZE[1] as f64).abs() < 1e-15);
    for (number, frame) in all["frames"].as_array().unwrap().iter().enumerate() {
        assert_eq!(frame["time"].as_f64(), Some(0.1 * number as f64));
        let pose = matrix(&frame["transform_matrix"]);
        let [linear, angular] =
            ["camera_linear_velocity", "camera_angular_velocity"].map(|key| vector(&frame[key]));
        let camera = bench.json(&format!("out/frames/{number:06}/camera.json"));
        let rows = camera["shutter"]["camera_from_world_of_rows"].as_array().unwrap().clone();
        for (y, row) in rows.iter().enumerate() {
            let time = ((y as f64 + 0.5) / SIZE[1] as f64 - 0.5) * readout;
            let row = matrix(row);
            // World from camera, moved along the camera's own axes: R exp(ω t), and p + R v t.
            let turn = turned(angular.map(|component| component * time));
            for i in 0..3 {
                for j in 0..3 {
                    let found: f64 = (0..3).map(|k| pose[i][k] * turn[k][j]).sum();
                    // Theirs has OpenGL's axes, ours OpenCV's, and goes from the world to the camera.
                    let due = row[j][i] * [1.0, -1.0, -1.0][j];
                    assert!((found - due).abs() < 1e-12, "{number} {y} {i} {j}: {found} {due}");
                }
                let step: f64 = (0..3).map(|k| pose[i][k] * linear[k] * time).sum();
                let place = pose[i][3] + step;
                let due = -(0..3).map(|k| row[k][i] * row[k][3]).sum::<f64>();
                assert!((place - due).abs() < 1e-12, "{number} {y} {i}: {place} {due}");
            }
        }
        // gsplat goes from the row that is read first to the last.
        let entry = &bench.json("out/index.json")["frames"][number];
        assert_eq!(entry["rolling_shutter"], "ROLLING_TOP_TO_BOTTOM");
        assert_eq!(entry["viewmat"], rows[0]);
        assert_eq!(entry["viewmat_rs"], rows[SIZE[1] - 1]);
    }
    let images = std::fs::read_to_string(bench.path("out/colmap/images.txt")).unwrap();
    assert!(images.contains("# Cameras move"), "{images}");
}

#[test]
fn what_a_format_has_no_place_for_is_left_out_with_a_note() {
    let mut notes = String::new();
    for shutter in [
        json!({ "type": "rolling", "line_time": 1e-3, "readout": "up" }),
        json!({ "type": "global_reset", "line_time": 1e-3, "exposure": 1e-3 }),
        json!({ "exposure": 1e-3, "truth_at": "open" }),
    ] {
        let bench = Bench::with_scene(&scene(&shutter).to_string());
        let output = bench.run(&["render", "scene.json", "-o", "out"]);
        let told = text(&output.stderr);
        assert!(output.status.success(), "{told}");
        notes += &under(&shutter.to_string(), &(notes_in(&told) + "\n"));
        let all = bench.json("out/transforms.json");
        assert!(
            all.get("rolling_shutter_time").is_none()
                && all["frames"][0].get("camera_linear_velocity").is_none()
        );
        let entry = &bench.json("out/index.json")["frames"][0];
        if shutter["readout"] == "up" {
            let rows = &bench.json("out/frames/000000/camera.json")["shutter"]["camera_from_world_of_rows"];
            assert_eq!(entry["rolling_shutter"], "ROLLING_BOTTOM_TO_TOP");
            assert_eq!([&entry["viewmat"], &entry["viewmat_rs"]], [&rows[SIZE[1] - 1], &rows[0]]);
        }
    }
    insta::assert_snapshot!(notes);
    // A camera that stands still has no keys of motion.
    let mut still = scene(&json!({ "type": "rolling", "line_time": 1e-3 }));
    still["camera"].as_object_mut().unwrap().remove("motion");
    let bench = Bench::with_scene(&still.to_string());
    bench.render(&[]);
    assert!(bench.json("out/transforms.json").get("exposure_time").is_none());
    assert!(bench.json("out/index.json")["frames"][0].get("viewmat").is_none());
}

/// The rows of a table, without its header.
fn table(bench: &Bench, file: &str) -> Vec<Vec<f64>> {
    let table = std::fs::read_to_string(bench.path(file)).unwrap();
    let row = |line: &str| line.split(',').map(|number| number.parse().unwrap()).collect();
    table.lines().skip(1).map(row).collect()
}

/// A unit that turns about an upright axis at 1 rad/s on a circle of 2 m: 2 m/s² toward the axis, and gravity.
#[test]
fn an_inertial_unit_reads_the_motion_of_its_frames() {
    let mut scene = scene(&json!({ "exposure": 1e-3 }));
    scene["camera"]["pose"] = json!({ "from": [0, 0, 0], "look_at": [0, 0, -1] });
    let degrees = 180.0 / std::f64::consts::PI;
    scene["camera"]["motion"] = json!({ "type": "velocity", "angular_velocity": [0, degrees, 0] });
    scene["frames"] = json!([{}, {}, {}]);
    scene["render"]["imu"] = json!({ "rate": 40, "at": [0, 0, 2] });
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&[]);
    let mut times = Vec::new();
    for frame in 0..3 {
        let readings = table(&bench, &format!("out/frames/{frame:06}/imu.csv"));
        assert_eq!(readings.len(), 4, "frame {frame}");
        for reading in readings {
            // OpenCV's axes: y is down, and forward from the axis is z.
            let due = [0.0, -1.0, 0.0, 0.0, -9.806_65, -2.0];
            let off = reading[1..].iter().zip(due).map(|(a, b): (&f64, f64)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{reading:?}");
            times.push(reading[0]);
        }
    }
    // Files of frames go on from each other.
    let due: Vec<f64> = (0..12).map(|k| f64::from(k) / 40.0).collect();
    assert_eq!(times, due);
}

#[test]
fn errors_of_an_inertial_unit_are_those_of_its_seed() {
    let mut scene = scene(&json!({ "exposure": 1e-3 }));
    scene.as_object_mut().unwrap().remove("frames");
    scene["render"]["imu"] = json!({
        "rate": 100, "from": 1, "to": 3,
        "noise": { "gyro_density": 1e-3, "accel_density": 1e-2, "gyro_walk": 1e-4, "accel_walk": 1e-3,
                   "gyro_bias": [0.01, 0, 0] },
    });
    let read = |scene: &Value| {
        let bench = Bench::with_scene(&scene.to_string());
        bench.render(&[]);
        table(&bench, "out/imu.csv")
    };
    let readings = read(&scene);
    assert_eq!(readings.len(), 200);
    for reading in &readings {
        assert_eq!(reading.len(), 19);
        for k in 0..6 {
            let [measured, truth, bias] = [reading[1 + k], reading[7 + k], reading[13 + k]];
            let deviation = if k < 3 { 1e-3 } else { 1e-2 } * 10.0;
            // Six deviations: beyond, one of 1200 values is once in 4 · 10⁵ runs.
            assert!((measured - truth - bias).abs() < 6.0 * deviation, "{k}: {reading:?}");
            assert!(measured != truth);
        }
    }
    assert_eq!(readings, read(&scene));
    scene["render"]["seed"] = json!(5);
    assert_ne!(readings, read(&scene));
    // Nothing falls within a short exposure, which is told.
    let mut short = scene.clone();
    short["render"] = json!({ "time": 0.0001, "imu": { "rate": 100 } });
    let bench = Bench::with_scene(&short.to_string());
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    let none = notes_in(&text(&output.stderr));
    let units = [
        json!({ "rate": 0 }),
        json!({ "rate": 10, "from": 2, "to": 1 }),
        json!({ "rate": 1e5, "to": 1e4 }),
        json!({ "rate": 1, "noise": { "gyro_walk": -1 } }),
    ];
    let messages = units.map(|imu| {
        let heading = imu.to_string();
        scene["render"]["imu"] = imu;
        let bench = Bench::with_scene(&scene.to_string());
        under(&heading, &bench.refusal(&["render", "scene.json", "-o", "out"]))
    });
    insta::assert_snapshot!(messages.concat());
    insta::assert_snapshot!(none, @"note: imu.csv: none of 100 readings a second falls between 0.0001 s and 0.0011 s; give `render.imu` a higher `rate`, or `from` and `to`");
}
