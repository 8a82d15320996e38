//! Rigs: cameras that hold on to each other wherever other frames move them.

use std::fs;

use etendue_camera::{Pose, PoseSpec};
use etendue_files::{Opener, Reach};
use etendue_geometry::glam::{DMat4, DVec3};
use etendue_scene::{LoadOptions, SceneError, SceneFile, Start, Wanted};
use serde_json::{Value, json};

/// The poses of all frames, moment by moment.
fn poses(frames: &Value) -> Result<Vec<Vec<DMat4>>, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.tum"), "0 0 0 4 0 0 0 1\n1 1 0 4 0 0.6 0 0.8\n").unwrap();
    let scene = json!({
        "camera": {"type": "pinhole", "fov": 40, "pose": {"from": [1, 2, 3], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [8, 6]}},
        "layers": ["depth"], "objects": [{"shape": "sphere"}], "frames": frames
    });
    let file = SceneFile::from_json(&Opener::default(), folder.path(), scene)?;
    let load = |file: &SceneFile| file.load(Wanted::NOTHING, &LoadOptions::default());
    let opener = Opener::new(Reach::OwnFolder);
    let frames = file.frames(&opener, || load(&file).map(|scene| Start::of(&scene)))?;
    let frames = frames.unwrap().frames;
    let count = frames[0].rig.as_ref().unwrap().count;
    let mut moments = vec![Vec::new(); frames.len() / count];
    for (number, frame) in frames.iter().enumerate() {
        let rig = frame.rig.as_ref().unwrap();
        assert_eq!((frame.number, rig.moment * count + rig.camera), (number, number));
        let camera = load(&file.at(frame)?)?.camera;
        moments[rig.moment]
            .push(camera.pose().world_from_camera(etendue_camera::Convention::Opengl));
    }
    Ok(moments)
}

/// A right camera to the side, higher and turned inwards by 10°, in the words of a scene, with OpenCV's axes, and as a
/// matrix with OpenGL's.
fn right() -> (Value, Value, DMat4) {
    let (s, c) = 10.0_f64.to_radians().sin_cos();
    // Turned to the left around the axis that points up: x' = c, −z' goes to −x.
    let gl = json!([[c, 0, s, 0.2], [0, 1, 0, 0.05], [-s, 0, c, 0.01], [0, 0, 0, 1]]);
    let cv = json!([[c, 0, -s, 0.2], [0, 1, 0, -0.05], [s, 0, c, -0.01], [0, 0, 0, 1]]);
    let of = |matrix, convention| {
        json!({"name": "right",
               "pose": {"matrix": matrix, "maps": "world_from_camera", "convention": convention}})
    };
    let rows = [[c, 0.0, s, 0.2], [0.0, 1.0, 0.0, 0.05], [-s, 0.0, c, 0.01], [0.0, 0.0, 0.0, 1.0]];
    (of(gl, "opengl"), of(cv, "opencv"), DMat4::from_cols_array_2d(&rows).transpose())
}

#[test]
fn cameras_of_a_rig_keep_their_places_on_every_path() {
    let (gl, cv, expected) = right();
    let paths = [
        (json!({"type": "orbit", "count": 4}), 4),
        (json!({"type": "dolly", "count": 3, "to": [4, 0, 1], "look_at": [0, 0, 0]}), 3),
        (json!({"type": "grid", "columns": 2, "spacing": 1}), 2),
        (json!({"type": "poses", "poses": [{"from": [0, 3, 1], "look_at": [1, 1, 0]}]}), 1),
        (json!({"type": "trajectory", "file": "a.tum"}), 2),
        (json!([{}, {"camera.pose.from": [5, 1, 0]}, {"camera.fov": 30}]), 3),
    ];
    for (path, count) in paths {
        for right in [&gl, &cv] {
            let frames = json!({"type": "rig", "cameras": [{}, right], "path": path});
            let moments = poses(&frames).unwrap_or_else(|error| panic!("{path}: {error}"));
            assert_eq!(moments.len(), count, "{path}");
            for moment in &moments {
                let between = moment[0].inverse() * moment[1];
                // The roundings of an inverse at coordinates of 5 m.
                assert!(between.abs_diff_eq(expected, 1e-13), "{path}: {between}");
            }
            // The first camera is where the path has it.
            if let Value::Array(_) = path {
                let spec: PoseSpec =
                    serde_json::from_value(json!({"from": [5, 1, 0], "look_at": [0, 0, 0]}))
                        .unwrap();
                let Pose { position, .. } = spec.build().unwrap();
                let at = moments[1][0].transform_point3(DVec3::ZERO);
                assert!(at.abs_diff_eq(position, 1e-14), "{at}");
            }
        }
    }
}

#[test]
fn rigs_that_make_no_sense_are_refused_by_their_place() {
    let orbit = json!({"type": "orbit", "count": 2});
    let rig =
        |cameras: Value, path: &Value| json!({"type": "rig", "cameras": cameras, "path": path});
    let pose = json!({"from": [0, 0, 0], "look_at": [0, 0, -1]});
    for (frames, words) in [
        (rig(json!([]), &orbit), "frames.cameras"),
        (rig(json!([{}]), &rig(json!([{}]), &orbit)), "a rig on a rig"),
        (rig(json!([{}, {"at": [0, 0, 0], "pose": pose}]), &orbit), "frames.cameras[1].at"),
        (rig(json!([{"settings": {"camera.pose.from": [0, 0, 0]}}]), &orbit), "set `at` or `pose`"),
        (rig(json!([{"at": [0, 0]}]), &orbit), "at"),
        (rig(json!([{}, {}]), &json!({"type": "orbit", "count": 60_000})), "120000 frames"),
    ] {
        let error = poses(&frames).unwrap_err().to_string();
        assert!(error.contains(words), "{frames}: {error}");
    }
}
