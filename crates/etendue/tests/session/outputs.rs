//! Every kind of file of every layer: over frames, and beside what a sensor and a light field leave.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use etendue::{Dataset, FramePattern, Options, Outputs, Progress, Session};
use etendue_files::Transaction;
use etendue_tracer::LayerSpec;
use serde_json::{Value, json};

const KINDS: [&str; 8] = ["exr", "png", "npy", "dng", "tum", "kitti", "flo", "indexed"];

/// A lit ball of a few pixels, of which every layer can be had.
fn scene(frames: &Value) -> Value {
    json!({
        "etendue": 1,
        "tracer": {"type": "direct"},
        "render": {"samples": {"relative_error": 0.5, "min": 4, "max": 8}},
        "camera": {"type": "thin_lens", "focal_length": "50 mm", "f_number": 8, "focus_distance": "3 m", "sensor_height": "24 mm",
                   "pose": {"from": [0, 0, 4], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [6, 4]}},
        "objects": [{"shape": "sphere"}],
        "lights": [{"type": "environment", "radiance": [1, 1, 1], "group": "sky"}],
        "frames": frames
    })
}

fn opened(folder: &Path, scene: Value, outputs: Outputs) -> Session {
    Session::from_json_with(folder, scene, Options { outputs, ..Options::default() }).unwrap()
}

/// True if files of this kind show the layer; `None` for kinds of whole pictures.
fn shows(kind: &str, layer: &str) -> Option<bool> {
    let of: &[&str] = match kind {
        "tum" => &["depth"],
        "kitti" => &["depth", "disparity", "flow"],
        "flo" => &["flow"],
        "indexed" => &["ids", "material_id"],
        _ => return None,
    };
    Some(of.contains(&layer))
}

/// Renders all frames as the command does; gives what the index says.
fn render_frames(
    session: &mut Session,
    outputs: Outputs,
    out: &Path,
) -> Result<Value, etendue::Error> {
    let (none, pattern) = (Progress::none(), FramePattern::default());
    let frames = session.frames(&none)?.unwrap();
    session.check_outputs(&frames)?;
    let mut dataset = Dataset::default();
    for frame in frames.iter() {
        session.show(frame)?;
        session.check_place(&out.join(pattern.folder(frame.number)), &[], &none)?;
        let rendering = session.render(&none)?;
        pattern.write(&rendering, out, frame.number, outputs, &none)?;
        dataset.add(frame, rendering.scene(), &pattern, outputs)?;
    }
    let files = dataset.write(&Transaction::at_once(), out)?;
    assert!(files.contains(&out.join("index.json")));
    let index = std::fs::read(out.join("index.json")).unwrap();
    Ok(serde_json::from_slice(&index).unwrap())
}

/// A layer that the last frame lacks, as flow to the next, is no reason to refuse it.
#[test]
fn every_kind_of_file_of_every_layer_is_had_over_frames() {
    let folder = tempfile::tempdir().unwrap();
    let grid = json!({"type": "grid", "columns": 2, "spacing": "0.1 m"});
    for kind in KINDS {
        let outputs = Outputs::from_list(kind).unwrap();
        let mut session = opened(folder.path(), scene(&grid), outputs);
        for layer in LayerSpec::NAMES {
            session.set("layers", json!([layer])).unwrap();
            let out = folder.path().join(kind).join(layer);
            let rendered = render_frames(&mut session, outputs, &out);
            if shows(kind, layer) == Some(false) {
                let error = rendered.unwrap_err().to_string();
                assert!(
                    error.contains(&format!("`{kind}` is a file of")),
                    "{kind} {layer}: {error}"
                );
                assert!(!out.exists(), "{kind} {layer}: refused before anything is written");
                continue;
            }
            let index = rendered.unwrap_or_else(|error| panic!("{kind} of {layer}: {error}"));
            let frames = index["frames"].as_array().unwrap();
            assert_eq!(frames.len(), 2, "{kind} of {layer}");
            // What a killed process leaves of them is found by their endings.
            let is_known = |file: &Value| {
                let name = file.as_str().unwrap();
                etendue_files::ENDINGS.iter().any(|ending| name.ends_with(ending))
            };
            let layers =
                frames.iter().flat_map(|frame| frame["files"].as_object().unwrap().values());
            let files = layers.flat_map(|files| files.as_object().unwrap().values());
            files.for_each(|file| assert!(is_known(file), "{kind} of {layer}: {file}"));
            if shows(kind, layer) == Some(true) {
                let files = frames[0]["files"].to_string();
                assert!(files.contains(kind), "{kind} of {layer}: {files}");
            }
        }
    }
    // Of several frames one is enough to have the layer, and none is too few.
    let outputs = Outputs::from_list("flo").unwrap();
    let list = json!([{"layers": ["flow"]}, {"layers": ["depth"]}]);
    let mut session = opened(folder.path(), scene(&list), outputs);
    let index = render_frames(&mut session, outputs, &folder.path().join("list")).unwrap();
    assert_eq!(index["frames"].as_array().map(Vec::len), Some(2));
    let mut session = opened(folder.path(), scene(&json!([{}, {"layers": ["depth"]}])), outputs);
    let out = folder.path().join("none");
    assert!(render_frames(&mut session, outputs, &out).is_err());
    assert!(!out.exists());
}

/// All layers with all their options that have names of their own.
fn all_layers() -> Value {
    let mut all: Vec<Value> = LayerSpec::NAMES.map(|name| json!(name)).to_vec();
    for space in ["camera", "opencv"] {
        all.push(json!({"type": "position", "space": space}));
        all.push(json!({"type": "normal", "space": space}));
        all.push(json!({"type": "normal", "space": space, "kind": "shading"}));
    }
    all.push(json!({"type": "normal", "kind": "shading"}));
    for to in [json!(-1), json!(2), json!(-2)] {
        all.extend(
            ["flow", "disparity", "occlusion"].map(|layer| json!({"type": layer, "to": to})),
        );
    }
    json!(all)
}

/// The files of one picture, as they were written and as they were foretold.
fn files(session: &mut Session, outputs: Outputs, out: &Path) -> [Vec<PathBuf>; 2] {
    let none = Progress::none();
    let frames = session.frames(&none).unwrap().unwrap();
    session.show(&frames[2]).unwrap();
    let foretold = session.check_place(out, &[], &none).unwrap();
    let written = session.render(&none).unwrap().write(out, outputs).unwrap();
    [written.files, foretold]
}

#[test]
fn no_two_files_share_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let outputs = Outputs::from_list(&KINDS.join(",")).unwrap();
    let frames = json!({"type": "grid", "columns": 5, "spacing": "0.1 m"});
    let resolution = json!([6, 4]);
    let mut sensors = vec![json!({"resolution": resolution})];
    for kind in [
        json!({"type": "raw"}),
        json!({"type": "raw", "cfa": "rggb"}),
        json!({"type": "rgb"}),
        json!({"type": "multispectral", "bands": [400, 500, 600, 650, 700]}),
    ] {
        for shots in
            [json!({}), json!({"frames": 2}), json!({"exposures": [0.001, 0.002], "frames": 2})]
        {
            let mut sensor = kind.clone();
            sensor["moments"] = json!(true);
            sensor["resolution"] = resolution.clone();
            sensor["noise"] = json!("poisson");
            sensor["system_gain"] = json!(0.5);
            shots.as_object().unwrap().iter().for_each(|(k, v)| sensor[k] = v.clone());
            sensors.push(sensor);
        }
    }
    let mut cameras: Vec<Value> = sensors
        .into_iter()
        .map(|sensor| {
            json!({
                "type": "thin_lens", "focal_length": "50 mm", "f_number": 8, "focus_distance": "3 m",
                "sensor_height": "24 mm", "pose": {"from": [0, 0, 4], "look_at": [0, 0, 0]}, "sensor": sensor
            })
        })
        .collect();
    cameras.push(json!({
        "type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 4,
        "microlenses": {"pitch": 0.1}, "pose": {"from": [0, 0, 4], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [60, 45], "pixel_pitch": 8}
    }));
    let mut session = opened(folder.path(), scene(&frames), outputs);
    session.set("layers", all_layers()).unwrap();
    for (number, camera) in cameras.into_iter().enumerate() {
        if camera["type"] == "light_field" {
            // Lenslets tell the pupil apart by themselves.
            let mut layers = all_layers();
            let is_part =
                |layer: &Value| layer.as_str().is_some_and(|name| name.ends_with("_pupil"));
            layers.as_array_mut().unwrap().retain(|layer| !is_part(layer));
            session.set("layers", layers).unwrap();
        }
        session.set("camera", camera.clone()).unwrap();
        let out = folder.path().join(number.to_string());
        let [written, foretold] = files(&mut session, outputs, &out);
        for names in [&written, &foretold] {
            let once: BTreeSet<&PathBuf> = names.iter().collect();
            let twice: Vec<&PathBuf> = names
                .iter()
                .filter(|name| names.iter().filter(|other| other == name).count() > 1)
                .collect();
            assert_eq!(once.len(), names.len(), "{camera}: {twice:?}");
        }
        let unforetold: Vec<_> = written.iter().filter(|name| !foretold.contains(name)).collect();
        assert!(unforetold.is_empty(), "{camera}: {unforetold:?}");
        assert!(written.iter().all(|name| name.is_file()), "{camera}");
    }
}

/// The camera's file is named by no value of the scene any more, and has the name of a file of the results: it is
/// written over by neither the session that read it nor one that is made of what that gave, again and again.
#[test]
fn a_restored_session_writes_over_no_file_that_the_first_had_read() {
    let folder = tempfile::tempdir().unwrap();
    let camera = json!({"type": "pinhole", "sensor": {"resolution": [4, 3]}}).to_string();
    std::fs::write(folder.path().join("camera.json"), &camera).unwrap();
    let text = json!({
        "etendue": 1, "camera": "camera.json", "layers": ["depth"], "objects": [{"shape": "sphere"}]
    });
    let path = folder.path().join("scene.json");
    std::fs::write(&path, text.to_string()).unwrap();
    let mut session = Session::open(&path).unwrap();
    for _ in 0..3 {
        let written = session.check_place(folder.path(), &[], &Progress::none());
        let error = written.unwrap_err().to_string();
        assert!(error.contains("camera.json"), "{error}");
        let (path, scene, inputs) = session.origin();
        let restored = Session::restore(path, scene.clone(), inputs, Options::default()).unwrap();
        session = restored;
    }
    let other = folder.path().join("out");
    session.check_place(&other, &[], &Progress::none()).unwrap();
    assert_eq!(std::fs::read_to_string(folder.path().join("camera.json")).unwrap(), camera);
}
