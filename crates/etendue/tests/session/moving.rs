//! Motion and deformation while the shutter is open, in a session that goes on.

use std::fs;
use std::path::Path;

use etendue::{Options, Progress, Roughness, Session, Setting};
use serde_json::{Value, json};

use super::{numbers, render};

/// A triangle whose target, 1 m to the right, gets its whole weight within 10 ms by a cubic.
fn write_model(folder: &Path) {
    let floats: [&[f32]; 4] = [
        &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0],
        &[1.0, 0.0, 0.0, 1.0, 0.0, 0.5, 1.0, 0.3, 0.0],
        &[0.0, 0.01],
        &[0.0, 0.0, 50.0, 0.0, 1.0, 0.0],
    ];
    let bytes = |part: &&[f32]| part.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let parts: Vec<Vec<u8>> = floats.iter().map(bytes).collect();
    let mut views = Vec::new();
    let mut start = 0;
    for part in &parts {
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": part.len()}));
        start += part.len();
    }
    let shapes = [("VEC3", 3), ("VEC3", 3), ("SCALAR", 2), ("SCALAR", 6)];
    let accessors: Vec<Value> = shapes
        .iter()
        .enumerate()
        .map(|(k, (shape, count))| json!({"bufferView": k, "componentType": 5126, "type": shape, "count": count}))
        .collect();
    let document = json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "accessors": accessors, "bufferViews": views,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}]}]}],
        "animations": [{"samplers": [{"input": 2, "output": 3, "interpolation": "CUBICSPLINE"}],
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}],
        "buffers": [{"byteLength": start, "uri": "model.bin"}]
    });
    fs::write(folder.join("model.bin"), parts.concat()).unwrap();
    fs::write(folder.join("model.gltf"), document.to_string()).unwrap();
}

fn scene() -> Value {
    json!({
        "etendue": 1, "tracer": {"type": "path", "max_bounces": 2}, "render": {"samples": 4},
        "layers": ["depth", "normal", "time"],
        "camera": {
            "type": "pinhole", "fov": 50, "pose": {"from": [0, 0.5, 4], "look_at": [0, 0, 0]},
            "shutter": {"type": "rolling", "line_time": "50 us"},
            "sensor": {"resolution": [24, 16], "type": "raw", "cfa": "rggb", "exposure": 0.005}
        },
        "objects": [
            {"file": "model.gltf", "material": "grey", "animation": {"time": 0.001, "plays": true}},
            {"shape": "box", "size": [0.5, 0.5, 0.5], "material": "grey",
             "motion": {"type": "velocity", "velocity": [20, 0, 0], "angular_velocity": [0, 3000, 0]},
             "transform": {"translate": [0, 0.4, 0.5]}}
        ],
        "materials": {"grey": {"type": "matte", "color": [0.5, 0.5, 0.5]}},
        "lights": [{"type": "point", "at": [2, 3, 2], "intensity": [40, 40, 40]},
                   {"type": "environment", "radiance": [0.3, 0.3, 0.3]}]
    })
}

fn written(folder: &Path) -> std::path::PathBuf {
    write_model(folder);
    let path = folder.join("scene.json");
    fs::write(&path, scene().to_string()).unwrap();
    path
}

#[test]
fn after_any_change_of_what_moves_pictures_are_those_of_a_new_session() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path());
    let mut session = Session::open(&path).unwrap();
    render(&mut session);
    let mut settings = Vec::new();
    // Each may change steps, times of rays, structures, or none of them.
    for (at, value) in [
        ("lights[0].intensity", json!([80, 80, 80])),
        ("camera.sensor.exposure", json!(0.002)),
        ("camera.pose.from", json!([0.3, 0.5, 2])),
        ("objects[0].animation.time", json!(0.004)),
        ("objects[1].motion.velocity", json!([-20, 5, 0])),
        ("camera.motion", json!({"type": "velocity", "velocity": [1, 0, 0]})),
        ("objects[0].transform.translate", json!([0.1, 0, 0])),
        ("camera.shutter.line_time", json!(1e-4)),
        ("objects[0].animation.plays", json!(false)),
        ("render.accel", json!("bvh")),
        ("objects[0].animation.plays", json!(true)),
    ] {
        session.set(at, value.clone()).unwrap();
        settings.push(Setting::new(at, value.to_string()));
        let options = Options { settings: settings.clone(), ..Options::default() };
        let mut fresh = Session::open_with(&path, options).unwrap();
        assert_eq!(numbers(&render(&mut session)), numbers(&render(&mut fresh)), "{at} {value}");
    }
}

#[test]
fn shapes_and_structures_stay_as_long_as_nothing_of_them_changes() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::open(written(folder.path())).unwrap();
    let parts = |session: &mut Session| {
        let (scene, accel) = session.scene_and_accel(&Progress::none()).unwrap();
        let steps = scene.geometry.meshes[0].steps.as_ref().expect("it deforms");
        (std::sync::Arc::as_ptr(steps) as usize, std::ptr::from_ref(accel).cast::<u8>() as usize)
    };
    let before = parts(&mut session);
    session.set("lights[0].intensity", json!([80, 80, 80])).unwrap();
    assert_eq!(parts(&mut session), before, "light");
    session.set("camera.sensor.exposure", json!(0.002)).unwrap();
    let after = parts(&mut session);
    assert!(after.0 != before.0 && after.1 != before.1, "a shorter exposure has other steps");
}

/// The finest preview of a scene that moves is the picture.
#[test]
fn the_finest_preview_of_what_moves_is_the_render() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::open(written(folder.path())).unwrap();
    let preview = session.preview(Roughness::NONE, &Progress::none()).unwrap();
    let rendered = render(&mut session);
    for (shown, rendered) in preview.layers().iter().zip(rendered.layers()) {
        let bits = |layer: &etendue::Layer| -> Vec<u64> {
            let channels = layer.channels.iter().map(|channel| &channel.values);
            channels.flat_map(|it| (0..it.len()).map(|i| it.at(i).to_bits())).collect()
        };
        assert_eq!(bits(shown), bits(rendered), "{}", shown.title());
    }
    // A coarser one has rows that are read in the same time.
    let rough = Roughness { factor: 4, samples: Some(1) };
    let coarse = session.preview(rough, &Progress::none()).unwrap();
    assert_eq!(coarse.resolution(), [6, 4]);
}
