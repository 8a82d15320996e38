//! One session, many pictures.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

#[path = "session/checkpoints.rs"]
mod checkpoints;
#[path = "session/frame_noise.rs"]
mod frame_noise;
#[path = "session/glasses.rs"]
mod glasses;
#[path = "session/moving.rs"]
mod moving;
#[path = "session/outputs.rs"]
mod outputs;
#[path = "session/spectra.rs"]
mod spectra;
#[path = "session/unseen.rs"]
mod unseen;

use std::fs;
use std::path::Path;

use etendue::{Error, Options, Outputs, Phase, Progress, Rendering, Session, Setting, places};
use etendue_files::Ledger;
use serde_json::{Value, json};
use tempfile::TempDir;

/// A lit scene of two objects, one of them with a texture, seen by a real lens and recorded by a sensor.
fn scene() -> Value {
    json!({
        "etendue": 1,
        "tracer": {"type": "path", "max_bounces": 2},
        "render": {"samples": 4},
        "layers": ["depth", "normal", "ids"],
        "camera": {
            "type": "thin_lens", "focal_length": "50 mm", "fov": 40, "f_number": 4, "focus_distance": 4,
            "pose": {"from": [0.5, 1, 4], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [24, 16], "type": "raw", "cfa": "rggb", "exposure": 0.01}
        },
        "objects": [
            {"shape": "sphere", "material": "painted"},
            {"shape": "blob", "triangles": 30000, "material": "grey",
             "transform": {"translate": [0, -2, 0]}}
        ],
        "materials": {
            "painted": {"type": "matte", "color": {"image": "paint.png"}},
            "grey": {"type": "matte", "color": [0.5, 0.5, 0.5]}
        },
        "lights": [{"type": "point", "at": [2, 3, 2], "intensity": [40, 40, 40]},
                   {"type": "environment", "radiance": [0.3, 0.3, 0.3]}]
    })
}

/// The scene and its texture, of four by four texels.
fn write_scene(folder: &Path) -> std::path::PathBuf {
    let paint = folder.join("paint.png");
    fs::write(paint, include_bytes!("data/paint.png")).unwrap();
    let path = folder.join("scene.json");
    fs::write(&path, scene().to_string()).unwrap();
    path
}

fn opened() -> (TempDir, Session) {
    let folder = tempfile::tempdir().unwrap();
    let session = Session::open(write_scene(folder.path())).unwrap();
    (folder, session)
}

fn render(session: &mut Session) -> Rendering {
    session.render(&Progress::none()).unwrap()
}

/// All that a file of the picture would say, and the sensor's numbers.
fn numbers(picture: &Rendering) -> (String, String, Vec<Vec<u16>>) {
    let raw = picture.exposures().map(|e| picture.raw(e).unwrap().unwrap().values);
    (picture.report().image_hash.clone(), picture.report().scene_hash.clone(), raw.collect())
}

/// Changes, and whether the structure stays.
fn changes() -> Vec<(&'static str, Value, bool)> {
    vec![
        ("camera.f_number", json!(2.8), true),
        ("camera.sensor.exposure", json!(0.02), true),
        ("tracer", json!({"type": "facing"}), true),
        ("tracer", json!({"type": "direct"}), true),
        ("lights[0].intensity", json!([80, 80, 80]), true),
        ("materials.grey.color", json!([0.2, 0.4, 0.6]), true),
        ("layers", json!(["depth", "uv"]), true),
        ("render.samples", json!(9), true),
        ("camera.pose.from", json!([1, 1, 4]), true),
        ("objects[1].transform.translate", json!([0.1, -2, 0]), false),
        ("objects[1].transform.translate", json!([0.2, -2, 0]), false),
        ("objects[0]", json!({"shape": "box", "material": "painted"}), false),
        ("render.accel", json!("bvh"), false),
    ]
}

#[test]
fn after_any_change_pictures_are_those_of_a_new_session() {
    let (folder, mut session) = opened();
    render(&mut session);
    let mut settings = Vec::new();
    for (path, value, _) in changes() {
        session.set(path, value.clone()).unwrap();
        settings.push(Setting::new(path, value.to_string()));
        let options = Options { settings: settings.clone(), ..Options::default() };
        let mut fresh = Session::open_with(folder.path().join("scene.json"), options).unwrap();
        assert_eq!(numbers(&render(&mut session)), numbers(&render(&mut fresh)), "{path} {value}");
    }
}

#[test]
fn only_what_a_change_touches_is_made_anew() {
    let (_folder, mut session) = opened();
    let parts = |session: &mut Session| {
        let (scene, accel) = session.scene_and_accel(&Progress::none()).unwrap();
        let corners: Vec<usize> =
            scene.geometry.meshes.iter().map(|mesh| mesh.triangles.as_ptr() as usize).collect();
        (corners, std::ptr::from_ref(accel).cast::<u8>() as usize)
    };
    let mut before = parts(&mut session);
    for (path, value, keeps_structure) in changes() {
        session.set(path, value.clone()).unwrap();
        let now = parts(&mut session);
        assert_eq!(now.1 == before.1, keeps_structure, "{path}: the structure");
        // The blob, which no change replaces, comes last.
        assert_eq!(now.0.last(), before.0.last(), "{path}: the meshes");
        before = now;
    }
}

#[test]
fn a_refused_change_leaves_the_session_as_it_was() {
    let (_folder, mut session) = opened();
    let before = numbers(&render(&mut session));
    let error = session.set("camera.f_numbre", 2.8).unwrap_err();
    assert!(error.is_refused() && error.to_string().contains("f_number"), "{error}");
    assert!(session.set("objects[7].shape", "sphere").is_err());
    assert_eq!(numbers(&render(&mut session)), before);
    // What is known only when it is loaded can be set back.
    session.set("objects[0].transform.scale", 0).unwrap();
    let _ = session.render(&Progress::none());
    session.set("objects[0].transform", json!({})).unwrap();
    assert_eq!(numbers(&render(&mut session)).0, before.0);
}

#[test]
fn what_changes_on_disk_is_read_again() {
    let (folder, mut session) = opened();
    session.set("render.samples", 1).unwrap();
    let before = numbers(&render(&mut session));
    let mut scene = scene();
    scene["objects"][0]["shape"] = json!("box");
    fs::write(folder.path().join("scene.json"), scene.to_string()).unwrap();
    assert_eq!(numbers(&render(&mut session)), before, "not before it is asked to");
    session.reload().unwrap();
    assert_ne!(numbers(&render(&mut session)).0, before.0);
    assert_eq!(session.values()["render"]["samples"], 1);
}

#[test]
fn files_have_the_numbers_of_the_arrays() {
    let (folder, mut session) = opened();
    let picture = render(&mut session);
    let out = folder.path().join("out");
    let written = picture.write(&out, Outputs::ALL).unwrap();
    for name in ["layers.exr", "picture.png", "depth.npy", "raw.npy", "camera.json", "sensor.json"]
    {
        assert!(written.files.contains(&out.join(name)), "{name} in {:?}", written.files);
    }
    let array = fs::read(out.join("raw.npy")).unwrap();
    let [exposure] = picture.exposures().collect::<Vec<_>>()[..] else { panic!("one exposure") };
    let raw = picture.raw(exposure).unwrap().unwrap();
    let bytes: Vec<u8> = raw.values.iter().flat_map(|value| value.to_le_bytes()).collect();
    assert!(array.ends_with(&bytes));
    let depth = picture.layer("Depth").unwrap();
    let array = fs::read(out.join("depth.npy")).unwrap();
    let bytes: Vec<u8> =
        (0..24 * 16).flat_map(|i| depth.channels[0].values.at(i).to_le_bytes()).collect();
    assert!(array.ends_with(&bytes), "data layers keep f64");
    let report = picture.report_of(&written);
    assert_eq!((report.files.len(), report.samples), (written.files.len(), 4));
    // Its own scene is no place for results.
    let error = picture.write(folder.path(), Outputs::ALL);
    assert!(error.is_ok(), "no file of the scene has a result's name");
    fs::write(folder.path().join("picture.png"), "mine").unwrap();
    session.set("materials.painted.color.image", "picture.png").unwrap();
    assert!(session.check_place(folder.path(), &[], &Progress::none()).is_err());
}

#[test]
fn another_thread_cancels() {
    let (_folder, mut session) = opened();
    session.set("render.samples", 1_000_000).unwrap();
    let progress = Progress::new(|_, _| true);
    let other = progress.clone();
    // At the first look every pixel has samples.
    let progress = progress.with_looks(move |_| other.cancel());
    let picture = session.render(&progress).unwrap();
    let has = picture.report().samples;
    assert!((1..1_000_000).contains(&has), "{has}");
    assert!(picture.partial().unwrap().contains("of 1000000 samples"));
    // Cancelled before anything was done, there is nothing to keep.
    session.set("render.samples", 2).unwrap();
    let error = session.render(&progress).unwrap_err();
    assert!(error.is_stopped() && !error.is_refused(), "{error}");
    assert!(session.render(&Progress::none()).unwrap().partial().is_none());
}

#[test]
fn stages_are_told_in_order() {
    let (folder, mut session) = opened();
    let told = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let seen = std::sync::Arc::clone(&told);
    let progress = Progress::new(move |stage, share| {
        assert!((0.0..=1.0).contains(&share), "{stage:?} {share}");
        let mut told = seen.lock().unwrap();
        if told.last() != Some(&stage) {
            told.push(stage);
        }
        true
    });
    let picture = session.render(&progress).unwrap();
    picture.write_with(folder.path(), Outputs::ALL, &progress).unwrap();
    let told = told.lock().unwrap();
    assert_eq!(*told, [Phase::Load, Phase::Build, Phase::Render, Phase::Write, Phase::Expose]);
}

#[test]
fn arrays_make_scenes_and_bad_ones_are_named() {
    let scene = json!({
        "layers": ["depth"], "objects": [{"file": "tile"}],
        "camera": {"type": "pinhole", "sensor": {"resolution": [4, 4]},
                   "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}}
    });
    let corners = |z: f64| [[-9.0, -9.0, z], [9.0, -9.0, z], [0.0, 9.0, z]];
    let mut session = Session::from_json(".", scene.clone()).unwrap();
    let depth = |session: &mut Session| {
        let picture = render(session);
        (
            picture.layer("Depth").unwrap().channels[0].values.at(5),
            picture.report().scene_hash.clone(),
        )
    };
    // A third is not a number of single precision, and is kept.
    session.insert_mesh("tile", &corners(1.0 / 3.0), &[[0, 1, 2]]).unwrap();
    let first = depth(&mut session);
    assert!((first.0 - (2.0 - 1.0 / 3.0)).abs() < 1e-15, "{}", first.0);
    session.insert_mesh("tile", &corners(0.5), &[[0, 1, 2]]).unwrap();
    let second = depth(&mut session);
    assert_eq!(second.0, 1.5);
    assert_ne!(first.1, second.1, "another mesh is another scene");
    for (triangles, words) in [([[0, 1, 3]], "vertex 3 of 3"), ([[0, 1, 2]], "NaN")] {
        let mut vertices = corners(0.0);
        vertices[2][0] = f64::NAN;
        let error = session.insert_mesh("bad", &vertices, &triangles).unwrap_err().to_string();
        assert!(error.contains("mesh \"bad\"") && error.contains(words), "{error}");
    }
    let error = Session::from_json(".", scene).unwrap().scene(&Progress::none()).unwrap_err();
    assert!(error.to_string().contains("tile"), "{error}");
}

/// While one thread fills a set of files in a folder, another renders below it: each has its own files.
#[test]
fn a_set_in_another_thread_takes_no_file_of_a_folder_below() {
    let folder = tempfile::tempdir().unwrap();
    let (out, below) = (folder.path().join("out"), folder.path().join("out/below"));
    let (_home, mut session) = opened();
    let rendering = render(&mut session);
    places::folder(&out).unwrap();
    let mut written = Vec::new();
    let stopped = places::recorded(Ledger::open(&out, "render"), &[], |files| {
        files.write(&out.join("a"), |_| Ok(())).map_err(Error::from)?;
        let inner = std::thread::scope(|scope| {
            scope.spawn(|| rendering.write(&below, Outputs::ALL)).join()
        });
        written = inner.unwrap()?.files;
        assert!(written.iter().all(|path| path.exists()));
        Err::<(), _>(Error::Refused("stopped".to_owned()))
    });
    assert!(stopped.is_err() && written.len() > 5);
    assert!(written.iter().all(|path| path.exists()));
    assert!(below.join("etendue-manifest.json").exists() && !out.join("a").exists());
}

/// Scenes that are written, rendered and removed: file systems give the number of a removed file to the next.
#[test]
fn a_thousand_temporary_scenes_are_rendered_one_after_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let scene = json!({
        "etendue": 1, "layers": ["coverage"], "render": {"samples": 1, "accel": "bvh"},
        "camera": {"type": "pinhole", "sensor": {"resolution": [1, 1]},
                   "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]}},
        "objects": [{"shape": "rectangle", "width": 1, "height": 1}]
    });
    let outputs = Outputs { npy: true, ..Outputs::NONE };
    let options = Options { outputs, ..Options::default() };
    for round in 0..1000 {
        fs::write(&path, scene.to_string()).unwrap();
        let mut session = Session::open_with(&path, options.clone()).unwrap();
        let rendering = render(&mut session);
        fs::remove_file(&path).unwrap();
        let written = rendering.write(folder.path(), outputs);
        assert!(written.is_ok(), "round {round}: {}", written.unwrap_err());
    }
}
