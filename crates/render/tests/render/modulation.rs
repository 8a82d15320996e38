//! Lights that change with time: banding of rolling shutters, flashes, codes, against closed forms.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use etendue_files::Opener;
use etendue_render::output::{Outputs, Picture};
use etendue_render::{Plan, plan};
use etendue_scene::file::SceneFile;
use etendue_scene::{LoadOptions, Scene};
use serde_json::{Value, json};

use crate::steps::{layer, load_json, picture, rendered};

const SIDE: usize = 16;

/// Of f32 in which layers are kept, and of parts of light that are added up in another order.
const ROUNDING: f64 = 1e-6;

/// A room under one light, before a camera with this shutter; `modulation` is the light's.
fn room(light: &Value, modulation: Option<Value>, shutter: &Value, tracer: &str) -> Value {
    let mut light = light.clone();
    if let Some(modulation) = modulation {
        light["modulation"] = modulation;
    }
    let mut scene = json!({
        "etendue": 1,
        "tracer": { "type": tracer },
        "camera": { "type": "pinhole", "fov": 60, "sensor": { "resolution": [SIDE, SIDE] },
                    "pose": { "from": [0, 1, 3], "look_at": [0, 0.5, 0] }, "shutter": shutter },
        "render": { "samples": 16 },
        "lights": [],
        "materials": { "grey": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "objects": [
            { "shape": "rectangle", "width": 8, "height": 8, "material": "grey",
              "transform": { "rotate": [1, 0, 0, -90] } },
            { "shape": "sphere", "radius": 0.5, "material": "grey", "transform": { "translate": [0, 0.5, 0] } },
        ],
    });
    match light["type"] == "emissive" {
        false => scene["lights"] = json!([light]),
        true => {
            scene["materials"]["lamp"] = light;
            scene["objects"].as_array_mut().unwrap().push(json!({
                "shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
                "transform": { "translate": [0, 2, -1], "rotate": [1, 0, 0, 45] },
            }));
        }
    }
    scene
}

fn load(scene: Value) -> Scene {
    load_json(Path::new("."), scene)
}

fn each_light() -> Vec<Value> {
    vec![
        json!({ "type": "point", "at": [1, 2, 1], "intensity": [3, 2, 1] }),
        json!({ "type": "spot", "at": [1, 2, 1], "look_at": [0, 0, 0], "intensity": [3, 2, 1], "cone": 60 }),
        json!({ "type": "directional", "direction": [0.2, -1, -0.3], "irradiance": [3, 2, 1], "angle": 5 }),
        json!({ "type": "projector", "at": [1, 2, 1], "look_at": [0, 0, 0], "intensity": [3, 2, 1] }),
        json!({ "type": "environment", "radiance": [0.3, 0.4, 0.5] }),
        json!({ "type": "sky" }),
        json!({ "type": "emissive", "radiance": [3, 2, 1], "two_sided": true }),
    ]
}

/// The red of each row's pixels, and what it is of the same without modulation.
fn ratios(changed: &Picture, steady: &Picture, name: &str) -> Vec<Vec<f64>> {
    let [changed, steady] = [changed, steady].map(|picture| layer(picture, name));
    let row = |y: usize| {
        let pixels = (0..SIDE).map(|x| y * SIDE + x).filter(|&i| steady[i] > 0.0);
        pixels.map(|i| changed[i] / steady[i]).collect()
    };
    (0..SIDE).map(row).collect()
}

/// A lamp of 100 Hz under a rolling shutter: row r, open from r l to r l + T, gets
/// 1 + d sinc(f T) sin 2π(f (r l + T/2) + φ).
#[test]
fn rows_have_the_banding_of_the_closed_form_under_each_light() {
    let (line, exposure, frequency, depth, phase) = (1.3e-3, 3e-3, 100.0, 0.8, 0.1);
    let shutter = json!({ "type": "rolling", "line_time": line, "exposure": exposure });
    let sine = |depth: f64| json!({ "type": "sine", "frequency": frequency, "depth": depth, "phase": phase });
    for light in each_light() {
        for tracer in ["direct", "path"] {
            let [changed, steady, plain] = [Some(sine(depth)), Some(sine(0.0)), None]
                .map(|modulation| picture(&load(room(&light, modulation, &shutter, tracer))));
            // Without modulation a matte scene may be worked on in f32 as a whole: as near as `blocks.rs` holds that.
            for found in ratios(&steady, &plain, "").concat() {
                assert!((found - 1.0).abs() < 1e-4, "{light} {tracer}: {found}, not 1");
            }
            let mut lit = 0;
            for (row, found) in ratios(&changed, &steady, "").into_iter().enumerate() {
                let middle = row as f64 * line + 0.5 * exposure;
                let half_turn = PI * frequency * exposure;
                let share = half_turn.sin() / half_turn;
                let due = 1.0 + depth * share * (TAU * (frequency * middle + phase)).sin();
                lit += found.len();
                for found in found {
                    assert!(
                        (found / due - 1.0).abs() < ROUNDING,
                        "{light} {tracer} {row}: {found}, not {due}"
                    );
                }
            }
            assert!(lit > SIDE, "{light}");
        }
    }
}

/// Of 10 ms a flash of 1 ms fills a tenth; a code lets through what it is open for; a shutter that sees an instant
/// has the factor of then.
#[test]
fn a_flash_is_the_share_of_the_exposure_that_it_fills() {
    let flash =
        |start: f64| json!({ "type": "pulse", "start": start, "duration": "1 ms", "factor": 4 });
    let light = &each_light()[0];
    for (shutter, start, due) in [
        (json!({ "exposure": "10 ms" }), 0.002, 0.4),
        (json!({ "exposure": "10 ms" }), 0.0095, 0.2),
        // Open from 0 to 2.5 ms and from 7.5 ms on: half of what is seen is of the exposure.
        (json!({ "exposure": "10 ms", "code": "1001" }), 0.002, 0.2),
        (json!({ "exposure": "10 ms", "code": "1001" }), 0.004, 0.0),
        (json!({ "exposure": 0 }), 0.0, 4.0),
        (json!({ "exposure": 0 }), -0.01, 0.0),
    ] {
        let changed = picture(&load(room(light, Some(flash(start)), &shutter, "direct")));
        // Of no depth, so that both go the same way: without any a matte scene may be worked on in f32 as a whole.
        let even = json!({ "type": "sine", "frequency": 100, "depth": 0 });
        let exposed = json!({ "exposure": "10 ms" });
        let steady = picture(&load(room(light, Some(even), &exposed, "direct")));
        for found in ratios(&changed, &steady, "").concat() {
            assert!((found - due).abs() < 4.0 * ROUNDING, "{shutter} {start}: {found}, not {due}");
        }
    }
    let dark = load(room(light, Some(flash(0.02)), &json!({ "exposure": "10 ms" }), "direct"));
    assert!(
        dark.notes.iter().any(|note| note.subject == "lights[0]" && note.message.contains("dark"))
    );
}

/// Two lamps, each with its own: light is linear in both, and so are its groups, bands and parts. Constants of the same mean
/// over the exposure leave the choice of lights as it is, so all pictures have the same samples.
#[test]
fn lights_change_each_by_itself() {
    let (line, exposure) = (1e-3, 2e-3);
    let shutter = json!({ "type": "rolling", "line_time": line, "exposure": exposure });
    let lights = each_light();
    let changed = [
        json!({ "type": "square", "frequency": 90, "duty": 0.4, "low": 0.2 }),
        json!({ "type": "sine", "frequency": 130, "depth": 0.7 }),
    ];
    // From the first row's opening to the last one's closing, where the square has begun its second period.
    let open = (SIDE - 1) as f64 * line + exposure;
    let high: f64 = 2.0 * 0.4 / 90.0;
    let turn = TAU * 130.0 * open;
    let constant = |mean: f64| json!({ "type": "curve", "points": [[0, mean]] });
    let steady = [
        constant((high + 0.2 * (open - high)) / open),
        constant(1.0 + 0.7 * (1.0 - turn.cos()) / turn),
    ];
    let both = |lamp: &Value, of_sky: &Value| {
        let mut scene = room(&lights[6], Some(lamp.clone()), &shutter, "path");
        let mut sky = lights[4].clone();
        (sky["group"], sky["modulation"]) = (json!("sky"), of_sky.clone());
        scene["lights"] = json!([sky]);
        scene["layers"] = json!(["direct", "indirect", "light_groups"]);
        picture(&load(scene))
    };
    let whole = both(&changed[0], &changed[1]);
    let [lamp, sky] = [both(&changed[0], &steady[1]), both(&steady[0], &changed[1])];
    let neither = both(&steady[0], &steady[1]);
    for name in ["", "Direct", "Indirect", "Light.sky", "Light.other"] {
        let [whole, lamp, sky, neither] =
            [&whole, &lamp, &sky, &neither].map(|picture| layer(picture, name));
        for i in 0..whole.len() {
            let due = lamp[i] + sky[i] - neither[i];
            let size = lamp[i] + sky[i] + neither[i];
            assert!((whole[i] - due).abs() <= ROUNDING * size, "{name} {i}: {} {due}", whole[i]);
        }
    }
}

/// Rays have random times where something moves: the same banding, within the noise and without bias.
#[test]
fn rays_with_times_have_the_same_mean() {
    let (line, exposure, frequency) = (1e-3, 4e-3, 120.0);
    let light = json!({ "type": "environment", "radiance": [1, 1, 1] });
    let square = json!({ "type": "square", "frequency": frequency, "duty": 0.5 });
    let shutter = json!({ "type": "rolling", "line_time": line, "exposure": exposure });
    let mut scene = room(&light, Some(square), &shutter, "direct");
    // All see the sky; the ball passes behind the camera.
    scene["camera"]["pose"] = json!({ "from": [0, 9, 0], "look_at": [0, 20, 1] });
    scene["objects"][1]["motion"] = json!({ "type": "velocity", "velocity": [1, 0, 0] });
    scene["render"]["samples"] = json!(256);
    let scene = load(scene);
    assert!(scene.camera.is_timed());
    let red = layer(&rendered(&scene, &Plan::new(&scene, Outputs::ALL)).picture, "");
    let (mut all, mut all_due) = (0.0, 0.0);
    for row in 0..SIDE {
        let found = red[row * SIDE..(row + 1) * SIDE].iter().sum::<f64>() / SIDE as f64;
        let n = 100_000;
        let moment = |i: usize| row as f64 * line + exposure * (i as f64 + 0.5) / n as f64;
        let on = (0..n).filter(|&i| (frequency * moment(i)).fract() < 0.5).count();
        let due = on as f64 / n as f64;
        // A pixel's 256 times are stratified: each of the two steps is off by 1/256 at most, 16 pixels together.
        assert!((found - due).abs() < 2.0 / 256.0, "{row}: {found}, not {due}");
        all += found;
        all_due += due;
    }
    assert!((all / all_due - 1.0).abs() < 1e-3, "{all} {all_due}");
}

/// A lamp goes on from frame to frame; a flash is each frame's.
#[test]
fn clocks_of_frames() {
    let at = |time: f64, modulation: Value| {
        let mut scene =
            room(&each_light()[0], Some(modulation), &json!({ "exposure": "1 ms" }), "direct");
        scene["render"]["time"] = json!(time);
        layer(&picture(&load(scene)), "").iter().sum::<f64>()
    };
    let ramp = |clock: &str| json!({ "type": "curve", "points": [[0, 0], [1, 1]], "clock": clock });
    let [scene, later] = [0.2, 0.6].map(|time| at(time, ramp("scene")));
    assert!((later / scene - 0.6005 / 0.2005).abs() < 3.0 * ROUNDING, "{}", later / scene);
    let [frame, later] = [0.2, 0.6].map(|time| at(time, ramp("frame")));
    assert_eq!(frame, later);
}

#[test]
fn what_is_no_modulation_is_refused_by_its_key() {
    let light = &each_light()[0];
    let sine = json!({ "type": "sine", "frequency": 100 });
    let refused = |scene: Value| {
        let file = SceneFile::from_json(&Opener::default(), Path::new("."), scene);
        let load = |file: SceneFile| {
            file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())
        };
        match file.and_then(load) {
            Ok(_) => panic!("refused"),
            Err(error) => error.to_string(),
        }
    };
    let bad = room(light, Some(json!({ "type": "sine", "frequency": -1 })), &json!({}), "direct");
    let error = refused(bad);
    assert!(error.contains("lights[0].modulation.frequency"), "{error}");
    let lamp = &each_light()[6];
    let bad = room(lamp, Some(json!({ "type": "pulse", "duration": "0 s" })), &json!({}), "direct");
    let error = refused(bad);
    assert!(error.contains("materials.lamp.modulation.duration"), "{error}");
    let mut bracket = room(light, Some(sine), &json!({}), "direct");
    bracket["camera"]["sensor"] =
        json!({ "type": "raw", "resolution": [SIDE, SIDE], "exposures": [0.01, 0.02] });
    bracket["camera"]["shutter"] = Value::Null;
    bracket["camera"].as_object_mut().unwrap().remove("shutter");
    let error = refused(bracket);
    assert!(error.contains("camera.sensor.exposures"), "{error}");
}
