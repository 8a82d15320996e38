//! Noise over the frames of a scene: each has its own, whatever makes the frames, and the same whenever it
//! is rendered.

use std::fs;
use std::sync::Arc;

use etendue::{Frame, Progress, Rendering, Session};
use serde_json::{Value, json};

/// A wall that fills the picture under an even sky, before a sensor with noise. What is expected is the same
/// in every pixel.
fn scene(tracer: &str, side: u32, frames: &Value) -> Value {
    json!({
        "etendue": 1,
        "tracer": {"type": tracer},
        "camera": {
            "type": "pinhole", "fov": 40, "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
            "sensor": {
                "type": "raw", "resolution": [side, side], "system_gain": 0.5, "read_noise": 3.0,
                "bit_depth": 12, "black_level": 50, "row_noise": 0.25
            }
        },
        "objects": [
            {"shape": "rectangle", "width": 40, "height": 40, "material": "wall"},
            {"file": "behind.gltf", "transform": {"translate": [0, 0, 2]}}
        ],
        "materials": {"wall": {"type": "matte", "color": [0.3, 0.3, 0.3]}},
        "lights": [{"type": "environment", "radiance": [1, 1, 1]}],
        "render": {"samples": 1},
        "frames": frames
    })
}

/// A triangle behind the camera, two cameras at one place, and an animation that moves nothing.
fn write_model(folder: &std::path::Path) {
    let camera = json!({"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}});
    let view =
        |offset: u32, length: u32| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    let accessor = |view: u32, count: u32, kind: &str, ends: [Value; 2]| {
        let [min, max] = ends;
        json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind,
               "min": min, "max": max})
    };
    let gltf = json!({
        "asset": {"version": "2.0"},
        "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0}, {"camera": 0}, {"camera": 1}],
        "cameras": [camera, camera],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "animations": [{
            "samplers": [{"input": 1, "output": 2}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
        }],
        "buffers": [{"uri": "behind.bin", "byteLength": 68}],
        "bufferViews": [view(0, 36), view(36, 8), view(44, 24)],
        "accessors": [
            accessor(0, 3, "VEC3", [json!([0, 0, 1]), json!([1, 1, 1])]),
            accessor(1, 2, "SCALAR", [json!([0]), json!([1])]),
            accessor(2, 2, "VEC3", [json!([0, 0, 0]), json!([0, 0, 0])])
        ]
    });
    let numbers: [f32; 17] = [0., 0., 1., 1., 0., 1., 0., 1., 1., 0., 1., 0., 0., 0., 0., 0., 0.];
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    fs::write(folder.join("behind.bin"), bytes).unwrap();
    fs::write(folder.join("behind.gltf"), gltf.to_string()).unwrap();
}

fn session(scene: Value) -> (tempfile::TempDir, Session) {
    let folder = tempfile::tempdir().unwrap();
    write_model(folder.path());
    let poses = "0 0 0 2 1 0 0 0\n1 0 0 2 1 0 0 0\n";
    fs::write(folder.path().join("poses.tum"), poses).unwrap();
    let session = Session::from_json(folder.path(), scene).unwrap();
    (folder, session)
}

fn shown(session: &mut Session, frame: &Frame) -> Rendering {
    session.show(frame).unwrap();
    session.render(&Progress::none()).unwrap()
}

/// The picture's green, or the sensor's numbers.
fn light(picture: &Rendering) -> Vec<f64> {
    let green = &picture.layers()[0].channels[1].values;
    (0..green.len()).map(|i| green.at(i)).collect()
}

fn raw(picture: &Rendering) -> Vec<f64> {
    let exposure = picture.exposures().next().unwrap();
    picture.raw(exposure).unwrap().unwrap().values.into_iter().map(f64::from).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let product = |a: &[f64], ma: f64, b: &[f64], mb: f64| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum()
    };
    let spread = (product(a, ma, a, ma) * product(b, mb, b, mb)).sqrt();
    assert!(spread > 0.0, "there is no noise");
    product(a, ma, b, mb) / spread
}

/// Promise on any two frames: four standard errors of as many pixels as are compared.
const FOUR_ERRORS: f64 = 0.01;

#[test]
fn no_two_frames_share_their_noise_whatever_makes_them() {
    let still = json!({"from": [0, 0, 2], "look_at": [0, 0, 0]});
    let generators = [
        json!([{}, {}, {"camera.fov": 40}]),
        json!({"type": "poses", "poses": [still, still]}),
        json!({"type": "trajectory", "file": "poses.tum"}),
        json!({"type": "orbit", "count": 2, "angle": 1e-9}),
        json!({"type": "dolly", "count": 2, "to": [0, 0, 2]}),
        json!({"type": "grid", "columns": 2, "spacing": 1e-9}),
        json!({"type": "animation", "times": [0, 1]}),
        json!({"type": "cameras"}),
    ];
    for (number, generator) in generators.into_iter().enumerate() {
        // Light without noise leaves the sensor's alone, which has one stream whatever makes the frames.
        let tracers = if number == 0 { &["flat", "direct"][..] } else { &["direct"] };
        for tracer in tracers {
            // The standard error of 410² independent pixels is 1/410; rows share a hundredth of the noise.
            let (_folder, mut session) = session(scene(tracer, 410, &generator));
            let frames = session.frames(&Progress::none()).unwrap().unwrap();
            let pictures = [0, 1].map(|i| shown(&mut session, &frames[i]));
            let [a, b] = pictures.each_ref().map(raw);
            let r = correlation(&a, &b);
            assert!(r.abs() < FOUR_ERRORS, "{generator} {tracer}: raw numbers correlate by {r}");
            if *tracer == "direct" {
                let [a, b] = pictures.each_ref().map(light);
                let r = correlation(&a, &b);
                assert!(r.abs() < FOUR_ERRORS, "{generator}: light correlates by {r}");
            }
        }
    }
}

#[test]
fn a_frame_has_its_own_bits_whenever_and_however_it_is_rendered() {
    let frames = json!([{}, {}, {}, {"render.frame": 1}]);
    let (_folder, mut many) = session(scene("direct", 24, &frames));
    let all = many.frames(&Progress::none()).unwrap().unwrap();
    let bits = |picture: &Rendering| {
        (picture.report().image_hash.clone(), picture.report().scene_hash.clone(), raw(picture))
    };
    // The last first: its number is that among all frames.
    let last = bits(&shown(&mut many, &all[2]));
    let [first, second, named] = [0, 1, 3].map(|i| bits(&shown(&mut many, &all[i])));
    assert!(first != second && second != last && first != last);
    assert_eq!(second, named, "a frame may take another's number");
    let mut scene = scene("direct", 24, &frames);
    scene.as_object_mut().unwrap().remove("frames");
    let (_folder, mut alone) = session(scene);
    let mut render = |settings: &[(&str, Value)]| {
        for (key, value) in settings {
            alone.set(key, value.clone()).unwrap();
        }
        bits(&alone.render(&Progress::none()).unwrap())
    };
    assert_eq!(render(&[]), first, "without frames the bits are those of frame 0");
    assert_eq!(render(&[("render.frame", json!(2))]), last);
    let frozen = render(&[("render.frozen_noise", json!(true))]);
    assert_eq!((&frozen.0, &frozen.2), (&first.0, &first.2), "frozen noise is that of frame 0");
    // A scene with frames has no number of its own.
    many.set("render.frame", 2).unwrap();
    let error = many.frames(&Progress::none()).unwrap_err();
    assert!(error.is_refused() && error.to_string().contains("render.frame: each of"), "{error}");
}

/// A data set is asked for its frames once for each of them.
#[test]
fn frames_are_worked_out_once_until_a_value_is_set() {
    let orbit = json!({"type": "orbit", "count": 3, "angle": 90});
    let (_folder, mut session) = session(scene("direct", 8, &orbit));
    let mut frames = || session.frames(&Progress::none()).unwrap().unwrap();
    let first = frames();
    assert!(Arc::ptr_eq(&first, &frames()));
    // Neither is it worked out anew, nor does the scene leave the frame, while one is shown.
    session.show(&first[1]).unwrap();
    let pose = |session: &mut Session| *session.scene(&Progress::none()).unwrap().camera.pose();
    let place = pose(&mut session);
    assert!(Arc::ptr_eq(&first, &session.frames(&Progress::none()).unwrap().unwrap()));
    assert_eq!(pose(&mut session), place);
    session.set("frames.count", 5).unwrap();
    assert_eq!(session.frames(&Progress::none()).unwrap().unwrap().len(), 5);
    session.reload().unwrap();
    assert!(!Arc::ptr_eq(&first, &session.frames(&Progress::none()).unwrap().unwrap()));
}
