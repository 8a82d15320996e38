//! Pictures of things that move while the shutter is open, against closed forms and against still things.

use std::sync::Arc;

use etendue_accel::AccelName;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitPrecision, Motion, Steady};
use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_report::DecisionKind;
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{layer, load_json, mean, picture};

const COLUMNS: usize = 64;
const EXPOSURE: f64 = 0.01;

/// A camera of parallel rays, a pixel 1/16 m, that looks at z = 0 from z = 5.
fn scene(accel: &str, lights: Value, objects: Value) -> Scene {
    let scene = json!({
        "etendue": 1,
        "camera": { "type": "orthographic", "height": 1, "sensor": { "resolution": [COLUMNS, 16] },
                    "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] },
                    "shutter": { "exposure": EXPOSURE } },
        "tracer": { "type": "direct" },
        "render": { "samples": 1024, "accel": accel },
        "lights": lights,
        "materials": { "lamp": { "type": "emissive", "radiance": [1, 1, 1], "two_sided": true },
                       "floor": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "objects": objects,
    });
    load_json(std::path::Path::new("."), scene)
}

/// Gives an object a velocity (m/s).
fn push(scene: &mut Scene, object: u32, velocity: DVec3) {
    let steady = Motion::steady(Steady { velocity, ..Steady::default() }).unwrap();
    for placement in &mut Arc::make_mut(&mut scene.geometry).placements {
        if placement.object == object {
            placement.motion = Some(Arc::new(steady.then_inner(&placement.world_from_mesh)));
        }
    }
    scene.camera = scene.camera.clone().among_moving_things(true);
}

/// The red of each column, a mean over its rows.
fn profile(scene: &Scene) -> Vec<f64> {
    let picture = picture(scene);
    let red = &layer(&picture, "")[..COLUMNS * 16];
    (0..COLUMNS).map(|x| (0..16).map(|y| red[y * COLUMNS + x]).sum::<f64>() / 16.0).collect()
}

/// The mean over the exposure of the share of a column that is right of an edge, which starts in the middle of
/// the picture and goes `pixels` to the left.
fn covered(column: usize, pixels: f64) -> f64 {
    let area = |x: f64| match x {
        x if x <= 0.0 => 0.0,
        x if x < 1.0 => 0.5 * x * x,
        x => x - 0.5,
    };
    let x = column as f64 + 1.0 - 32.0;
    (area(x + pixels) - area(x)) / pixels
}

/// The speed (m/s) to the left of so many pixels an exposure.
fn to_the_left(pixels: f64) -> DVec3 {
    DVec3::NEG_X * (pixels / 16.0 / EXPOSURE)
}

/// Places and moments are stratified each for itself; what is left of an edge that moves by 3 pixels is 0.22/√16384 = 0.0017
/// of 16 rows of 1024 samples, and less where it moves by more: near four times that.
const NOISE: f64 = 4.0 * 0.2 * 0.5 / 64.0;

#[test]
fn the_edge_of_a_lamp_that_moves_is_the_ramp_of_its_speed() {
    for accel in AccelName::built().map(AccelName::name) {
        for pixels in [3.0, 17.5] {
            let lamp = json!([{ "shape": "rectangle", "width": 20, "height": 20, "material": "lamp",
                                "transform": { "translate": [10, 0, 0] } }]);
            let mut scene = scene(accel, json!([]), lamp);
            push(&mut scene, 0, to_the_left(pixels));
            let profile = profile(&scene);
            let mut bias = 0.0;
            for (column, value) in profile.iter().enumerate() {
                let expected = covered(column, pixels);
                assert!((value - expected).abs() < NOISE, "{accel} {column}: {value} {expected}");
                bias += value - expected;
            }
            let light: f64 = profile.iter().sum();
            assert!((bias / light).abs() < 1e-3, "{accel} {pixels}: {bias}");
        }
    }
}

#[test]
fn the_shadow_of_a_body_that_moves_is_the_ramp_of_its_speed() {
    let sun = json!([{ "type": "directional", "direction": [1, 0, -1], "irradiance": [1, 1, 1] }]);
    let floor = json!({ "shape": "rectangle", "width": 40, "height": 20, "material": "floor" });
    // Its shadow, 6 m farther to the right, begins in the middle of the picture.
    let roof = json!({ "shape": "rectangle", "width": 20, "height": 20, "material": "floor",
                       "transform": { "translate": [4, 0, 6] } });
    for accel in AccelName::built().map(AccelName::name) {
        let open = mean(&profile(&scene(accel, sun.clone(), json!([floor]))));
        assert!(open > 0.01);
        let pixels = 11.0;
        let mut scene = scene(accel, sun.clone(), json!([floor, roof]));
        push(&mut scene, 1, to_the_left(pixels));
        for (column, value) in profile(&scene).into_iter().enumerate() {
            let expected = 1.0 - covered(column, pixels);
            assert!(
                (value / open - expected).abs() < NOISE,
                "{accel} {column}: {value} {expected}"
            );
        }
    }
}

/// A lamp that passes over a floor lights it as the mean of lamps that stand on its way.
#[test]
fn a_lamp_that_moves_lights_as_the_mean_of_those_on_its_way() {
    let floor = json!({ "shape": "rectangle", "width": 40, "height": 20, "material": "floor" });
    let lit = |x: f64, pixels: f64| {
        let lamp = json!({ "shape": "rectangle", "width": 4, "height": 4, "material": "lamp",
                           "transform": { "translate": [x, 0, 6] } });
        let mut scene = scene("embree", json!([]), json!([floor, lamp]));
        if pixels > 0.0 {
            push(&mut scene, 1, to_the_left(pixels));
        }
        mean(&profile(&scene))
    };
    let (start, pixels) = (2.0, 160.0);
    let steps = 20;
    let step = |k: i32| start - pixels / 16.0 * (f64::from(k) + 0.5) / f64::from(steps);
    let due = (0..steps).map(|k| lit(step(k), 0.0)).sum::<f64>() / f64::from(steps);
    let found = lit(start, pixels);
    // A moving lamp is met by one direction in ten of 262 144: 0.6 % of noise.
    assert!((found / due - 1.0).abs() < 0.025, "{found}, not {due}");
    assert!((lit(start, 0.0) / due - 1.0).abs() > 0.1, "where it starts it lights otherwise");
}

#[test]
fn the_plan_says_what_moves() {
    let floor = json!({ "shape": "rectangle", "width": 40, "height": 20, "material": "floor" });
    let mut scene = scene("bvh", json!([]), json!([floor, floor]));
    let words = |scene: &Scene| {
        let plan = Plan::new(scene, Outputs::ALL);
        let row = plan.decisions.into_iter().find(|row| row.kind == DecisionKind::Shutter);
        row.unwrap().reason
    };
    assert!(words(&scene).contains("nothing moves"));
    push(&mut scene, 1, DVec3::X);
    assert!(words(&scene).contains("1 of 2 placed meshes move"), "{}", words(&scene));
}

/// A white screen whose left edge is the middle of the picture when it stands still, and moves as `motion` says, before
/// a shutter as `shutter` says.
fn screen(accel: &str, shutter: &Value, motion: &Value) -> Scene {
    let scene = json!({
        "etendue": 1,
        "camera": { "type": "orthographic", "height": 1, "sensor": { "resolution": [COLUMNS, 16] },
                    "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] }, "shutter": shutter },
        "tracer": { "type": "flat" },
        "render": { "samples": 1024, "accel": accel },
        "materials": { "white": { "type": "matte", "color": [1, 1, 1] } },
        "objects": [{ "shape": "rectangle", "width": 20, "height": 20, "material": "white",
                      "transform": { "translate": [10, 0, 0] }, "motion": motion }],
    });
    load_json(std::path::Path::new("."), scene)
}

/// Number of white pixels in each row, from the top.
fn white(scene: &Scene) -> Vec<f64> {
    let picture = picture(scene);
    let red = &layer(&picture, "")[..COLUMNS * 16];
    red.chunks(COLUMNS).map(|row| row.iter().sum()).collect()
}

/// Each row sees the edge where it is when the row is open, to a hundredth of a pixel: of an object that moves at
/// constant speed and of one that turns, about its own edge and about a point of it that moves, with every accelerator.
#[test]
fn rows_of_a_rolling_shutter_see_objects_at_their_times() {
    let line_time = 1e-3;
    let pixels_a_row = 0.37;
    let speed = pixels_a_row / 16.0 / line_time;
    let degrees_a_second = 2_500.0;
    let sideways = json!({ "type": "velocity", "velocity": [-speed, 0, 0] });
    let turning = json!({ "type": "velocity", "angular_velocity": [0, 0, degrees_a_second], "about": [0, 0, 0] });
    let both = json!({ "type": "velocity", "velocity": [-speed, 0, 0],
                       "angular_velocity": [0, 0, degrees_a_second], "about": [0, 0, 0] });
    for accel in AccelName::built().map(AccelName::name) {
        for readout in ["down", "up"] {
            let shutter = json!({ "type": "rolling", "line_time": line_time, "readout": readout });
            for (motion, moves, turns) in
                [(&sideways, 1.0, 0.0), (&turning, 0.0, 1.0), (&both, 1.0, 1.0)]
            {
                for (row, white) in white(&screen(accel, &shutter, motion)).into_iter().enumerate()
                {
                    let read = if readout == "down" { row } else { 15 - row } as f64;
                    let angle = (turns * degrees_a_second * read * line_time).to_radians();
                    // The middle of the row above the picture's, in pixels; the edge leans to the left above.
                    let above = 7.5 - row as f64;
                    let due = 32.0 + moves * pixels_a_row * read + above * angle.tan();
                    assert!(
                        (white - due).abs() < 0.01,
                        "{accel} {readout} {motion} {row}: {white} {due}"
                    );
                }
            }
        }
    }
}

/// Motions through transforms are those of a velocity where they are alike, in the scene's clock; copies move along;
/// and the exposure is the sensor's where the scene names no shutter.
#[test]
fn transforms_at_times_are_a_velocity() {
    let shutter = json!({ "exposure": EXPOSURE });
    let speed = -9.0 / 16.0 / EXPOSURE;
    let steady =
        screen("embree", &shutter, &json!({ "type": "velocity", "velocity": [speed, 0, 0] }));
    let place = |t: f64| json!({ "translate": [10.0 + speed * t, 0, 0] });
    let text = |time: f64, objects: Value, sensor: Value| {
        json!({
            "etendue": 1, "tracer": { "type": "flat" },
            "camera": { "type": "orthographic", "height": 1, "sensor": sensor,
                        "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] } },
            "render": { "samples": 1024, "time": time },
            "materials": { "white": { "type": "matte", "color": [1, 1, 1] } },
            "objects": objects,
        })
    };
    let times = [7.0 - 0.3, 7.0, 7.0 + 0.004, 8.0];
    let through = json!({ "type": "transforms", "times": times,
        "transforms": times.map(|t| place(t - 7.0)) });
    let screen = json!([{ "shape": "rectangle", "width": 20, "height": 20, "material": "white", "motion": through }]);
    let sensor = json!({ "type": "raw", "resolution": [COLUMNS, 16], "exposure": EXPOSURE, "noise": "none" });
    let keyed = load_json(std::path::Path::new("."), text(7.0, screen, sensor.clone()));
    // Half of the screen as a copy beside the other.
    let half = json!([{ "shape": "rectangle", "width": 20, "height": 10, "material": "white",
        "instances": [{ "translate": [0, 5, 0] }, { "translate": [0, -5, 0] }],
        "transform": { "translate": [10, 0, 0] },
        "motion": { "type": "velocity", "velocity": [speed, 0, 0] } }]);
    let copies = load_json(std::path::Path::new("."), text(0.0, half, sensor));
    let due: Vec<f64> = (0..16).map(|_| 32.0 + 4.5).collect();
    for (name, scene) in [("velocity", &steady), ("transforms", &keyed), ("copies", &copies)] {
        for (white, due) in white(scene).into_iter().zip(&due) {
            // The edge passes over nine pixels of 1024 samples each: random ones were a twentieth off in all.
            assert!((white - due).abs() < 0.06, "{name}: {white}, not {due}");
        }
    }
}

/// A motion of no speed is none: rays have no times, and the picture is that of the object without it.
#[test]
fn objects_that_stand_still_change_no_bit() {
    let shutter = json!({ "exposure": EXPOSURE });
    let still = screen("embree", &shutter, &json!({ "type": "velocity" }));
    assert!(!still.camera.is_timed());
    let mut without = still.clone();
    for placed in &mut Arc::make_mut(&mut without.geometry).placements {
        placed.motion = None;
    }
    assert_eq!(layer(&picture(&still), ""), layer(&picture(&without), ""));
}

/// Objects and cameras that fly so far while the shutter is open that f32 cannot tell triangles
/// apart are hit in f64, and the plan says why. At a millionth of the speed f32 does.
#[test]
fn speeds_that_outrun_single_precision_take_double() {
    let planned = |object: bool, speed: f64| {
        let velocity = json!({ "type": "velocity", "velocity": [speed, 0, 0] });
        let mut camera = json!({ "type": "pinhole", "shutter": { "exposure": 1 },
                                 "pose": { "from": [0, 0, 4], "look_at": [0, 0, 0] } });
        let mut ball = json!({ "shape": "sphere", "triangles": 2000 });
        if object {
            ball["motion"] = velocity;
        } else {
            camera["motion"] = velocity;
        }
        let scene = json!({ "etendue": 1, "tracer": { "type": "path" }, "camera": camera, "objects": [ball],
                            "render": { "accel": "embree" } });
        let plan = Plan::new(
            &load_json(std::path::Path::new("."), scene),
            Outputs::from_list("exr").unwrap(),
        );
        let row = plan.decisions.iter().find(|row| row.kind == DecisionKind::LightPaths);
        (plan.light_precision, row.unwrap().reason.clone())
    };
    for object in [true, false] {
        let (precision, why) = planned(object, 1e6);
        assert_eq!(precision, HitPrecision::Double, "{why}");
        assert!(why.contains("while things move as far as 1.0e6 m away"), "{why}");
        assert_eq!(planned(object, 1.0).0, HitPrecision::Single);
    }
}
