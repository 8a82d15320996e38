//! Lights of models and scenes that move while the shutter is open, with closed forms, and motions that are none.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use serde_json::{Value, json};

use crate::deforming::Model;
use crate::run::{Bench, under};

/// Duration of the animation (s), and the exposure.
const LENGTH: f64 = 0.5;

/// A model of one light, whose node is moved by `output` within that time below one that stands still.
fn write_light(bench: &Bench, light: &Value, path: &str, output: impl Fn(&mut Model) -> usize) {
    let mut model = Model::default();
    #[expect(clippy::cast_possible_truncation, reason = "as files have it")]
    let input = model.floats(&[[0.0_f32], [LENGTH as f32]]);
    let output = output(&mut model);
    model.write(
        bench,
        json!({
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": { "KHR_lights_punctual": { "lights": [light] } },
            "scenes": [{ "nodes": [0] }], "scene": 0,
            "nodes": [{ "translation": [0, 0.25, 1], "children": [1] },
                      { "children": [2] },
                      { "extensions": { "KHR_lights_punctual": { "light": 0 } } }],
            "animations": [{ "samplers": [{ "input": input, "output": output }],
                             "channels": [{ "sampler": 0, "target": { "node": 1, "path": path } }] }]
        }),
    );
}

/// A dot of a floor below the model, whose animation plays or not, and which moves itself or not.
fn scene(plays: bool, more: &Value) -> Bench {
    let mut model = json!({ "file": "model.gltf", "animation": { "time": 0, "plays": plays } });
    model.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
    let floor = json!({ "shape": "rectangle", "width": 60, "height": 60, "material": "floor" });
    let scene = json!({
        "etendue": 1, "tracer": { "type": "direct" },
        "camera": { "type": "orthographic", "height": 0.001, "sensor": { "resolution": [16, 16] },
                    "pose": { "from": [0, -3, 4], "look_at": [0, 0, 0] }, "shutter": { "exposure": LENGTH } },
        "materials": { "floor": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "objects": [floor, model], "render": { "samples": 256, "accel": "bvh" }
    });
    Bench::with_scene(&scene.to_string())
}

fn mean(bench: &Bench) -> f64 {
    bench.render(&[]);
    let picture = bench.array("picture");
    picture.iter().sum::<f64>() / picture.len() as f64
}

/// Share of a light's output while it moves, of that while it stands in the moment that is shown.
fn share(light: &Value, path: &str, output: impl Fn(&mut Model) -> usize) -> f64 {
    let [moving, still] = [true, false].map(|plays| {
        let bench = scene(plays, &json!({}));
        write_light(&bench, light, path, &output);
        mean(&bench)
    });
    moving / still
}

/// Error of 65 536 samples whose times are spread evenly in each pixel.
const NOISE: f64 = 3e-3;

/// The mean of the light of a point 1 m above the dot, and 0.25 m beside it, that goes from there to x = 2 m, over that at
/// the start.
fn passing() -> f64 {
    let (h, y, x): (f64, f64, f64) = (1.0, 0.25, 2.0);
    let squared = h * h + y * y;
    x / squared / (squared + x * x).sqrt() / x * squared.powf(1.5)
}

#[test]
fn lights_of_nodes_that_move_light_from_where_they_are() {
    let point = json!({ "type": "point", "intensity": 40 });
    let along =
        share(&point, "translation", |model| model.floats(&[[0.0_f32; 3], [2.0, 0.0, 0.0]]));
    assert!((along / passing() - 1.0).abs() < NOISE, "{along}, not {}", passing());
    // A quarter turn about +Y in equal times.
    #[expect(clippy::cast_possible_truncation, reason = "as files have it")]
    let half = FRAC_1_SQRT_2 as f32;
    let turn =
        |model: &mut Model| model.floats(&[[0.0_f32, 0.0, 0.0, 1.0], [0.0, half, 0.0, half]]);
    let sun = json!({ "type": "directional", "intensity": 3 });
    let sinking = share(&sun, "rotation", turn);
    assert!((sinking / (2.0 / PI) - 1.0).abs() < NOISE, "{sinking}, not {}", 2.0 / PI);
    // The dot, √1.0625 m away and 1 m below, is within a cone of 45° until cos φ = √½ · √1.0625.
    let cone = PI / 4.0;
    let spot = json!({ "type": "spot", "intensity": 40,
                       "spot": { "outerConeAngle": cone, "innerConeAngle": cone - 1e-6 } });
    let lit = (cone.cos() * 1.0625_f64.sqrt()).acos() / (PI / 2.0);
    let swept = share(&spot, "rotation", turn);
    assert!((swept / lit - 1.0).abs() < 2.0 * NOISE, "{swept}, not {lit}");
}

/// A model that an object's own motion carries takes its lights along.
#[test]
fn lights_of_models_that_move_go_along() {
    let motion = json!({ "motion": { "type": "velocity", "velocity": [2.0 / LENGTH, 0, 0] } });
    let point = json!({ "type": "point", "intensity": 40 });
    let [moving, still] = [&motion, &json!({})].map(|more| {
        let bench = scene(false, more);
        write_light(&bench, &point, "translation", |model| model.floats(&[[0.0_f32; 3]; 2]));
        mean(&bench)
    });
    let found = moving / still;
    assert!((found / passing() - 1.0).abs() < NOISE, "{found}, not {}", passing());
}

/// A light moves alike in whatever shares a picture is rendered, and by however many threads.
#[test]
fn threads_and_shares_of_a_moving_light_are_one_picture() {
    let bench = scene(true, &json!({}));
    let point = json!({ "type": "point", "intensity": 40 });
    write_light(&bench, &point, "translation", |model| {
        model.floats(&[[0.0_f32; 3], [2.0, 0.0, 0.0]])
    });
    let picture = |more: &[&str]| {
        bench.render(more);
        bench.array("picture")
    };
    assert_eq!(picture(&["--threads", "1"]), picture(&["--threads", "3"]));
}

#[test]
fn motions_of_lights_that_are_none_are_refused_by_place_and_remedy() {
    let motions = [
        json!({ "type": "offsets", "offsets": [[0, 0, 0], [1, 0, 0]], "times": [0.1, 0.1] }),
        json!({ "type": "offsets", "offsets": [[0, 0, 0], [1, 0, 0]], "times": [0.1] }),
        json!({ "type": "offsets", "offsets": [[0, 0, 0]], "times": [0] }),
        json!({ "type": "velocity", "velocity": [1e300, 1e300, 0] }),
        json!({ "type": "orbit" }),
    ];
    let messages = motions.map(|motion| {
        let light =
            json!({ "type": "point", "at": [0, 0, 1], "intensity": [1, 1, 1], "motion": motion });
        let scene = json!({ "etendue": 1, "lights": [light], "objects": [{ "shape": "box" }] });
        let bench = Bench::with_scene(&scene.to_string());
        under(&motion.to_string(), &bench.refusal(&["check", "scene.json"]))
    });
    insta::assert_snapshot!(messages.concat());
    // Frames of one clock want times where a light has times.
    let light = json!({ "type": "point", "at": [0, 0, 1], "intensity": [1, 1, 1],
        "motion": { "type": "offsets", "offsets": [[0, 0, 0], [1, 0, 0]], "times": [0, 1] } });
    let scene = json!({ "etendue": 1, "lights": [light], "objects": [{ "shape": "box" }],
                        "camera": { "type": "pinhole", "shutter": { "exposure": 0.1 } },
                        "frames": [{ "render.samples": 4 }, { "render.samples": 8 }] });
    let bench = Bench::with_scene(&scene.to_string());
    insta::assert_snapshot!(bench.refusal(&["check", "scene.json"]), @"
    error: scene.json, line 1, column 69: frames: something moves or changes, and nobody says when each frame is taken
    hint: give `render.rate` (frames a second), or each frame its `render.time`
    ");
}
