//! Pictures of moving cameras: blur and codes against closed forms, and what is not to change.

use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_report::DecisionKind;
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{layer, load_json, picture, rendered};

const COLUMNS: usize = 64;

/// A camera of parallel rays, a pixel 1/16 m, before a lamp whose left edge is at x = 0.
fn scene(camera: Value, more: Value) -> Scene {
    let mut scene = json!({
        "etendue": 1,
        "camera": { "type": "orthographic", "height": 1, "sensor": { "resolution": [COLUMNS, 16] },
                    "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] } },
        "tracer": { "type": "direct" },
        "render": { "samples": 1024 },
        "lights": [],
        "materials": { "lamp": { "type": "emissive", "radiance": [1, 1, 1] } },
        "objects": [{ "shape": "rectangle", "width": 20, "height": 20, "material": "lamp",
                      "transform": { "translate": [10, 0, 0] } }],
    });
    for (key, value) in camera.as_object().unwrap() {
        scene["camera"][key] = value.clone();
    }
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    load_json(std::path::Path::new("."), scene)
}

/// The red of each column, a mean over its rows.
fn profile(scene: &Scene) -> Vec<f64> {
    let picture = picture(scene);
    let red = &layer(&picture, "")[..COLUMNS * 16];
    (0..COLUMNS).map(|x| (0..16).map(|y| red[y * COLUMNS + x]).sum::<f64>() / 16.0).collect()
}

fn aside(speed: f64) -> Value {
    json!({ "type": "velocity", "velocity": [speed, 0, 0] })
}

/// The share of the moments in `open` (chips of an exposure of 1) and of places in a pixel at which the lamp is seen
/// from the column, when the camera goes `pixels` to the right in the exposure.
fn seen(column: usize, pixels: f64, open: &[[f64; 2]]) -> f64 {
    // Integral over time of clamp(x, 0, 1), where x is how much of the pixel is right of the edge.
    let integral = |time: f64| {
        let x = column as f64 + 1.0 - 32.0 + pixels * time;
        let area = if x <= 0.0 {
            0.0
        } else if x < 1.0 {
            0.5 * x * x
        } else {
            x - 0.5
        };
        area / pixels
    };
    open.iter().map(|[from, to]| integral(*to) - integral(*from)).sum()
}

#[test]
fn a_blurred_edge_is_the_ramp_of_its_speed() {
    for pixels in [3.0, 17.5] {
        let speed = pixels / 16.0 / 0.01;
        let blurred =
            scene(json!({ "shutter": { "exposure": 0.01 }, "motion": aside(speed) }), json!({}));
        let profile = profile(&blurred);
        let mut bias = 0.0;
        for (column, value) in profile.iter().enumerate() {
            let expected = seen(column, pixels, &[[0.0, 1.0]]);
            // Places and moments are stratified each for itself, which leaves 0.22/√16384 = 0.0017 of 16 rows of 1024
            // samples: near four times that.
            assert!(
                (value - expected).abs() < 4.0 * 0.5 / 64.0 * 0.2,
                "{pixels} {column}: {value} {expected}"
            );
            bias += value - expected;
        }
        let light: f64 = profile.iter().sum();
        assert!((bias / light).abs() < 1e-3, "{pixels}: {bias}");
    }
}

#[test]
fn a_flutter_shutter_leaves_its_code_in_the_picture() {
    let code = "1010011100000101";
    let open: Vec<[f64; 2]> = (0..16)
        .filter(|&i| code.as_bytes()[i] == b'1')
        .map(|i| [i as f64 / 16.0, (i as f64 + 1.0) / 16.0])
        .collect();
    let pixels = 28.0;
    let coded = scene(
        json!({ "shutter": { "exposure": 0.02, "code": code }, "motion": aside(pixels / 16.0 / 0.02) }),
        json!({ "render": { "samples": 4096 } }),
    );
    let profile = profile(&coded);
    // The line spread is the code itself: each column is lit by the next half chip.
    let spread: Vec<f64> = profile.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let ideal: Vec<f64> =
        (1..COLUMNS).map(|x| seen(x, pixels, &open) - seen(x - 1, pixels, &open)).collect();
    let transfer = |spread: &[f64], k: usize| {
        let turn = |x: usize| std::f64::consts::TAU * (k * x) as f64 / 64.0;
        let real: f64 = spread.iter().enumerate().map(|(x, v)| v * turn(x).cos()).sum();
        let imaginary: f64 = spread.iter().enumerate().map(|(x, v)| v * turn(x).sin()).sum();
        real.hypot(imaginary)
    };
    let light = transfer(&ideal, 0);
    assert!((light - 7.0 / 16.0).abs() < 1e-12, "the open share: {light}");
    for k in 0..24 {
        let [found, expected] = [&spread, &ideal].map(|spread| transfer(spread, k) / light);
        assert!((found - expected).abs() < 0.01, "{k}: {found} {expected}");
    }
}

#[test]
fn light_is_what_the_shutter_lets_through_also_when_nothing_moves() {
    let lamp = |shutter: Value| profile(&scene(json!({ "shutter": shutter }), json!({})))[60];
    assert_eq!(lamp(json!({ "exposure": 0.01 })), 1.0);
    assert!((lamp(json!({ "exposure": 0.01, "code": "1001" })) - 0.5).abs() < 1e-7, "f32");
    let reset = lamp(json!({ "type": "global_reset", "exposure": 0.01, "line_time": 0.001 }));
    // Rows are open for 10 to 25 ms.
    assert!((reset - 1.75).abs() < 1e-6, "{reset}");
}

#[test]
fn a_shutter_changes_no_bit_when_nothing_moves_and_says_so() {
    let still = scene(json!({}), json!({ "layers": ["depth", "position"] }));
    let bits = |scene: &Scene| {
        let done = rendered(scene, &Plan::new(scene, Outputs::ALL));
        let all = ["", "Depth", "Position"].map(|name| layer(&done.picture, name));
        all.concat().iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    for (shutter, motion) in [
        (json!({ "exposure": 0.01 }), json!({ "type": "velocity" })),
        (
            json!({ "type": "rolling", "line_time": 1e-5, "exposure": 0.01 }),
            json!({ "type": "velocity" }),
        ),
        // The motion leaves the shutter closed.
        (json!({ "exposure": 0 }), aside(5.0)),
    ] {
        let timed = scene(
            json!({ "shutter": shutter, "motion": motion }),
            json!({ "layers": ["depth", "position"] }),
        );
        assert_eq!(bits(&timed), bits(&still), "{shutter}");
        assert!(
            timed.notes.iter().any(|note| note.message.contains("changes nothing")),
            "{shutter}"
        );
        let plan = Plan::new(&timed, Outputs::ALL);
        let row = plan.decisions.iter().find(|row| row.kind == DecisionKind::Shutter).unwrap();
        assert!(row.reason.contains("nothing is paid"), "{}", row.reason);
    }
    assert!(still.notes.is_empty());
}

#[test]
fn data_layers_of_a_rolling_shutter_are_those_of_their_rows() {
    let shutter =
        json!({ "type": "rolling", "line_time": 0.01, "exposure": 0.004, "truth_at": "open" });
    let motion = json!({ "type": "velocity", "velocity": [0, 0, -3] });
    let moving =
        scene(json!({ "shutter": shutter, "motion": motion }), json!({ "layers": ["depth"] }));
    let done = rendered(&moving, &Plan::new(&moving, Outputs::ALL));
    let depth = layer(&done.picture, "Depth");
    for row in 0..16 {
        // The camera is 5 m away and comes nearer by 3 cm a row.
        let expected = 5.0 - 0.03 * row as f64;
        let found = depth[row * COLUMNS + 60];
        // f32 of layers that are kept so.
        assert!((found - expected).abs() < 1e-6, "{row}: {found}");
    }
}

/// The layer `time` and `camera.json` say when each row is seen, and from where: with the pose of its row each pixel's
/// point is projected back onto the pixel.
#[test]
fn points_are_projected_onto_their_pixels_by_the_pose_of_their_row() {
    let [width, height] = [24_usize, 18];
    let motion =
        json!({ "type": "velocity", "velocity": [3, -2, 4], "angular_velocity": [20, 400, -300] });
    for (kind, readout, truth_at, moves) in [
        ("rolling", "down", "middle", true),
        ("rolling", "up", "open", true),
        ("global_reset", "down", "close", true),
        ("rolling", "down", "middle", false),
    ] {
        let (line_time, exposure) = (2e-3, 7e-3);
        let mut camera = json!({
            "type": "pinhole", "fov": 50, "sensor": { "resolution": [width, height] },
            "pose": { "from": [0.3, 0.2, 4], "look_at": [0, 0, 0] },
            "shutter": { "type": kind, "line_time": line_time, "exposure": exposure, "readout": readout,
                         "truth_at": truth_at },
        });
        if moves {
            camera["motion"] = motion.clone();
        }
        let scene = load_json(
            std::path::Path::new("."),
            json!({
                "etendue": 1, "camera": camera, "layers": ["time", { "type": "position", "space": "world" }],
                "objects": [{ "shape": "sphere", "radius": 30 }],
            }),
        );
        let picture = picture(&scene);
        let times = layer(&picture, "Time");
        let points = layer(&picture, "Position");
        let file = scene.camera.opencv();
        let shutter = file.shutter.as_ref().expect("a shutter");
        assert_eq!(shutter.camera_from_world_of_rows.len(), if moves { height } else { 0 });
        let k = file.k.expect("a matrix");
        let mut first_and_last = [f64::NAN; 2];
        for row in 0..height {
            let read = if readout == "down" { row } else { height - 1 - row } as f64;
            let lag = read * line_time;
            let [open, close] = match kind {
                "rolling" => [lag, lag + exposure],
                _ => [0.0, lag + exposure],
            };
            let due = match truth_at {
                "open" => open,
                "middle" => 0.5 * (open + close),
                _ => close,
            };
            first_and_last[usize::from(row > 0)] = due;
            let pose =
                shutter.camera_from_world_of_rows.get(row).unwrap_or(&file.camera_from_world);
            for column in 0..width {
                let i = row * width + column;
                // Kept in f32: steps of 4 ns below 63 ms.
                assert!((times[i] - due).abs() < 4e-9, "{kind} {row}: {} s, not {due}", times[i]);
                let world = [0, 1, 2].map(|axis| points[axis * width * height + i]);
                let [x, y, z] = [0, 1, 2]
                    .map(|r| pose[r][3] + (0..3).map(|c| pose[r][c] * world[c]).sum::<f64>());
                let place = [k[0][0] * x / z + k[0][2], k[1][1] * y / z + k[1][2]];
                // Positions are kept in f32: 30 m to 2 µm, 10⁻⁵ px here at most.
                let off = (place[0] - column as f64).hypot(place[1] - row as f64);
                assert!(off < 1e-4, "{kind} {readout} {row} {column}: {place:?}");
            }
        }
        let [top, bottom] = shutter.top_and_bottom_s;
        assert!(
            (top - first_and_last[0]).abs() < 1e-15 && (bottom - first_and_last[1]).abs() < 1e-15
        );
    }
}
