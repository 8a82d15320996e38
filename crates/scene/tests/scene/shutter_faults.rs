//! Shutters, motions and times that make no picture: what the message says; and which time a frame has.

use etendue_files::Opener;
use etendue_scene::{LoadOptions, Scene, SceneError, SceneFile, Wanted};
use serde_json::{Value, json};

fn file(camera: &Value, more: &Value) -> Result<SceneFile, SceneError> {
    let mut scene = json!({
        "etendue": 1,
        "camera": { "type": "pinhole", "sensor": { "resolution": [64, 100] } },
    });
    for (key, value) in camera.as_object().unwrap() {
        scene["camera"][key] = value.clone();
    }
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    SceneFile::from_json(&Opener::default(), std::path::Path::new("."), scene)
}

fn load(camera: &Value, more: &Value) -> Result<Scene, SceneError> {
    file(camera, more)?.load(Wanted::NOTHING, &LoadOptions::default())
}

fn pose(x: f64) -> Value {
    json!({ "from": [x, 0, 5], "look_at": [x, 0, 0] })
}

#[test]
fn wrong_shutters_and_motions_are_refused_by_place_and_remedy() {
    let poses = |times: Value| json!({ "motion": { "type": "poses", "poses": [pose(0.0), pose(1.0)], "times": times } });
    let turned = json!({ "motion": { "type": "poses", "poses": [pose(0.0), pose(1.0)], "times": [0, 1], "revolutions": [1] } });
    let cases: [(Value, Value, [&str; 2]); 16] = [
        (
            json!({ "shutter": { "exposure": -1 } }),
            json!({}),
            ["camera.shutter.exposure", "0 or more"],
        ),
        (
            json!({ "shutter": { "type": "rolling" } }),
            json!({}),
            ["camera.shutter.line_time", "15 us"],
        ),
        (
            json!({ "shutter": { "line_time": 1e-5 } }),
            json!({}),
            ["camera.shutter.line_time", "rolling"],
        ),
        (
            json!({ "shutter": { "type": "rolling", "line_time": -1 } }),
            json!({}),
            ["camera.shutter.line_time", "0 or more"],
        ),
        (
            json!({ "shutter": { "type": "rolling", "line_time": 0.001 } }),
            json!({ "render": { "rate": 30 } }),
            ["camera.shutter.line_time", "longer than"],
        ),
        (
            json!({ "shutter": { "exposure": 0.01, "open": [] } }),
            json!({}),
            ["camera.shutter.open", "no open moment"],
        ),
        (
            json!({ "shutter": { "exposure": 0.01, "open": [[0.002, 0.004], [0.003, 0.005]] } }),
            json!({}),
            ["camera.shutter.open[1]", "in order"],
        ),
        (
            json!({ "shutter": { "exposure": 0.01, "open": [[0.002, 0.014]] } }),
            json!({}),
            ["camera.shutter.open[0]", "an exposure of 0.01 s"],
        ),
        (
            json!({ "shutter": { "exposure": 0.01, "code": "0000" } }),
            json!({}),
            ["camera.shutter.code", "no open moment"],
        ),
        (
            json!({ "shutter": { "exposure": 0.01, "code": "1012" } }),
            json!({}),
            ["camera.shutter.code", "digits"],
        ),
        (
            json!({ "shutter": { "exposure": 0.01, "code": "1011", "chip": 0.003 } }),
            json!({}),
            ["camera.shutter.code", "longer than the exposure"],
        ),
        (
            json!({ "shutter": { "type": "global_reset", "line_time": 1e-5, "exposure": 0.01, "code": "10" } }),
            json!({}),
            ["camera.shutter.code", "rolling"],
        ),
        (poses(json!([0, 0])), json!({}), ["camera.motion.times[1]", "increase"]),
        (poses(json!([1, 0])), json!({}), ["camera.motion.times[1]", "increase"]),
        (poses(json!([0])), json!({}), ["camera.motion.times", "1 times for 2 poses"]),
        (turned, json!({}), ["camera.motion.revolutions[0]", "in between"]),
    ];
    for (camera, more, words) in cases {
        let Err(error) = load(&camera, &more) else { panic!("{camera} {more} must be refused") };
        let message = error.to_string();
        for word in words {
            assert!(message.contains(word), "expected `{word}` in: {message}");
        }
    }
}

#[test]
fn a_pose_beside_poses_is_refused() {
    let mut both =
        json!({ "motion": { "type": "poses", "poses": [pose(0.0), pose(1.0)], "times": [0, 1] } });
    both["pose"] = pose(0.0);
    let message = load(&both, &json!({})).unwrap_err().to_string();
    assert!(message.contains("camera.pose") && message.contains("remove one"), "{message}");
    let rate = load(&json!({}), &json!({ "render": { "rate": 0 } })).unwrap_err().to_string();
    assert!(rate.contains("render.rate") && rate.contains("above 0"), "{rate}");
}

#[test]
fn exposures_of_the_sensor_and_the_shutter_must_agree() {
    let camera = |sensor: Value, shutter: Value| {
        let mut sensor = sensor;
        sensor["type"] = json!("raw");
        sensor["resolution"] = json!([64, 100]);
        json!({ "sensor": sensor, "shutter": shutter, "motion": { "type": "velocity", "velocity": [1, 0, 0] } })
    };
    let message = |camera: Value| load(&camera, &json!({})).unwrap_err().to_string();
    let differ = message(camera(json!({ "exposure": 0.01 }), json!({ "exposure": 0.02 })));
    assert!(differ.contains("camera.shutter.exposure") && differ.contains("leave one"), "{differ}");
    let several = message(camera(json!({ "exposures": [0.01, 0.02] }), json!({})));
    assert!(several.contains("camera.sensor.exposures") && several.contains("frames"), "{several}");
    let scene = load(&camera(json!({ "exposure": 0.03 }), json!({})), &json!({})).unwrap();
    assert_eq!(scene.camera.shutter().unwrap().exposure(), 0.03);
}

#[test]
fn frames_of_a_moving_camera_are_taken_at_their_times() {
    let motion =
        json!({ "motion": { "type": "poses", "poses": [pose(0.0), pose(4.0)], "times": [0, 2] } });
    let frames = |more: Value| {
        let file = file(&motion, &more)?;
        let all = file.frames(&Opener::default(), || unreachable!("a list"))?.unwrap();
        let place = |frame| {
            let scene = file.at(frame)?.load(Wanted::NOTHING, &LoadOptions::default())?;
            Ok(scene.camera.pose().position.x)
        };
        all.frames.iter().map(place).collect::<Result<Vec<f64>, SceneError>>()
    };
    let by_rate =
        frames(json!({ "render": { "rate": 4 }, "frames": [{}, {}, { "render.time": 1.75 }] }));
    assert_eq!(by_rate.unwrap(), [0.0, 0.5, 3.5]);
    let untimed = frames(json!({ "frames": [{}, {}] })).unwrap_err().to_string();
    assert!(untimed.contains("frames") && untimed.contains("render.rate"), "{untimed}");
}

#[test]
fn wrong_motions_of_objects_are_refused_by_place_and_remedy() {
    let place = |x: f64| json!({ "translate": [x, 0, 0] });
    let through = |transforms: Value, times: Value| json!({ "type": "transforms", "transforms": transforms, "times": times });
    let two = json!([place(0.0), place(1.0)]);
    let flat = json!([[1, 0, 0, 0], [0.5, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    let cases = [
        (json!({}), through(two.clone(), json!([0, 0])), ["motion.times", "after the one before"]),
        (json!({}), through(two.clone(), json!([1, 0])), ["motion.times", "sort the times"]),
        (json!({}), through(two.clone(), json!([1])), ["motion.times", "as many times"]),
        (json!({}), through(json!([place(0.0)]), json!([1])), ["motion.transforms", "two or more"]),
        (
            json!({}),
            through(json!([place(0.0), { "rotate": [0, 0, 0, 5] }]), json!([0, 1])),
            ["motion.transforms[1].rotate", "no length"],
        ),
        (
            json!({}),
            through(json!([place(0.0), { "matrix": flat }]), json!([0, 1])),
            ["motion.transforms[1]", "shears"],
        ),
        (
            json!({}),
            through(json!([{ "scale": 1 }, { "scale": -1 }]), json!([0, 1])),
            ["motion.transforms[0]", "passes through 0"],
        ),
        (
            json!({ "transform": place(1.0) }),
            through(two, json!([0, 1])),
            ["motion.transforms", "beside `transform`"],
        ),
        (
            json!({}),
            json!({ "type": "velocity", "velocity": [1e200, 0, 0] }),
            ["motion.velocity", "too large"],
        ),
        (
            json!({}),
            json!({ "type": "velocity", "angular_velocity": [0, 1e300, 0] }),
            ["motion.angular_velocity", "too large"],
        ),
        (
            json!({}),
            json!({ "type": "velocity", "about": [0, 0, -1e200] }),
            ["motion.about", "too large"],
        ),
        (json!({}), json!({ "type": "velocity", "speed": 1 }), ["objects[0]", "speed"]),
        (json!({}), json!({ "type": "spin" }), ["objects[0]", "spin"]),
    ];
    for (keys, motion, words) in cases {
        let mut object = json!({ "shape": "sphere", "motion": motion });
        for (key, value) in keys.as_object().unwrap() {
            object[key] = value.clone();
        }
        let Err(error) = load(&json!({}), &json!({ "objects": [object] })) else {
            panic!("{object} must be refused")
        };
        let message = error.to_string();
        for word in words {
            assert!(message.contains(word), "expected `{word}` in: {message}");
        }
    }
    // Frames of what moves through transforms have their times.
    let moving = json!([{ "shape": "sphere",
        "motion": through(json!([place(0.0), place(1.0)]), json!([0, 1])) }]);
    let untimed = file(&json!({}), &json!({ "objects": moving, "frames": [{}, {}] })).unwrap();
    let all = untimed.frames(&Opener::default(), || unreachable!("a list"));
    let message = all.unwrap_err().to_string();
    assert!(message.contains("frames") && message.contains("render.rate"), "{message}");
}
