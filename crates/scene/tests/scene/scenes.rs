//! Scenes that are right: what they load as.

mod copies;

use std::fs;
use std::path::{Path, PathBuf};

use etendue_geometry::glam::DVec3;
use etendue_scene::{CameraOrigin, LoadOptions, Scene, SceneFile, Setting, Wanted, scene_schema};
use etendue_tracer::LayerSpec;

use crate::test_data;

fn load(path: &Path, settings: &[(&str, &str)]) -> Scene {
    let settings: Vec<Setting> =
        settings.iter().map(|&(path, value)| Setting::new(path, value)).collect();
    let file = SceneFile::read(path, &settings).unwrap_or_else(|error| panic!("{error}"));
    let scene = file.load(Wanted::EVERYTHING, &LoadOptions::default());
    scene.unwrap_or_else(|error| panic!("{error}"))
}

fn from_text(text: &str, settings: &[(&str, &str)]) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    fs::write(&path, text).unwrap();
    load(&path, settings)
}

fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut scenes: Vec<PathBuf> = [folder.clone(), folder.join("paper")]
        .into_iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .collect();
    scenes.sort();
    scenes
}

#[test]
fn every_example_scene_reads_and_loads() {
    let scenes = examples();
    assert!(scenes.len() >= 5, "{scenes:?}");
    for path in scenes {
        let scene = load(&path, &[]);
        assert!(scene.geometry.triangles() > 0, "{}", path.display());
        // The slanted edge is a crop on purpose, and that alone is said of it.
        if path.ends_with("slanted-edge.json") {
            let [note] = &scene.notes[..] else { panic!("{:?}", scene.notes) };
            assert!(note.message.contains("a crop of nearly any sensor"), "{note:?}");
            continue;
        }
        // What is unfolded is said.
        if path.ends_with("mirror-lens.json") {
            let [note] = &scene.notes[..] else { panic!("{:?}", scene.notes) };
            assert!(note.message.contains("the lens has mirrors"), "{note:?}");
            continue;
        }
        assert!(scene.notes.is_empty(), "{}: {:?}", path.display(), scene.notes);
    }
}

#[test]
fn lens_files_are_read_by_the_folder_rule_and_belong_to_the_scenes_identity() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("scene/lenses");
    fs::create_dir_all(&inside).unwrap();
    image_of_one_pixel(&inside.join("mask.png"));
    let lens = r#"{"elements": [{"type": "thin_lens", "focal_length": 50},
        {"type": "aperture", "shape": "image", "file": "mask.png", "width": 9}]}"#;
    fs::write(inside.join("lens.json"), lens).unwrap();
    fs::write(folder.path().join("other.json"), lens).unwrap();
    let path = folder.path().join("scene/scene.json");
    let write = |file: &str| {
        let text = format!(
            r#"{{"etendue": 1, "camera": {{"type": "lens", "lens": "{file}", "fov": 30}},
                "objects": [{{"shape": "box"}}]}}"#
        );
        fs::write(&path, text).unwrap();
    };
    write("lenses/lens.json");
    let first = load(&path, &[]).hash().unwrap();
    assert_eq!(load(&path, &[]).hash().unwrap(), first);
    fs::write(inside.join("lens.json"), lens.replace("50}", "51}")).unwrap();
    assert_ne!(load(&path, &[]).hash().unwrap(), first, "another lens is another scene");
    write("../other.json");
    let error = SceneFile::read(&path, &[])
        .unwrap()
        .load(Wanted::EVERYTHING, &LoadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("camera.lens") && error.contains("--allow-outside"), "{error}");
}

/// A mask that is open: one white pixel.
fn image_of_one_pixel(path: &Path) {
    const PNG: &[u8] =
        b"\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x01\x00\
        \x00\x00\x01\x08\x00\x00\x00\x00\x3a\x7e\x9b\x55\x00\x00\x00\x0a\x49\x44\x41\x54\x78\
        \x9c\x63\xf8\x0f\x00\x01\x01\x01\x00\xb1\x38\xf6\x14\x00\x00\x00\x00\x49\x45\x4e\x44\
        \xae\x42\x60\x82";
    fs::write(path, PNG).unwrap();
}

#[test]
fn faults_of_a_lens_are_told_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    for (camera, words) in [
        (r#""type": "thin_lens", "focal_lenght": 50"#, "did you mean `focal_length`?"),
        (r#""type": "thin_lens", "aperture": {"shape": "round", "radius": 3}"#, "unknown shape"),
        (r#""type": "thin_lens", "aperture": {"radius": 3}"#, "give it `shape`"),
        (
            r#""type": "thin_lens", "elements": [{"type": "aperture", "shape": "circular", "radius": 3}]"#,
            "the key `at` is missing",
        ),
        (
            r#""type": "thin_lens", "elements": [{"type": "filter", "at": 3, "thickness": 3}]"#,
            "camera.elements[0].thickness: unknown key",
        ),
        (
            r#""type": "lens", "lens": {"elements": [{"type": "surface", "radious": 3}]}"#,
            "camera.lens.elements[0].radious: unknown key\nhint: did you mean `radius`?",
        ),
        (r#""type": "lens""#, "the key `lens` is missing: A lens file's path"),
        (r#""type": "thin_lens", "focal_length": 50, "fov": 30"#, "camera.f_number"),
    ] {
        let text = format!(r#"{{"etendue": 1, "camera": {{{camera}}}}}"#);
        fs::write(&path, text).unwrap();
        let error = SceneFile::read(&path, &[])
            .and_then(|file| file.load(Wanted::EVERYTHING, &LoadOptions::default()))
            .unwrap_err()
            .to_string();
        assert!(error.contains(words), "{camera}: {error}");
    }
}

#[test]
fn first_light_is_a_million_triangles() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/first-light.json");
    let scene = load(&path, &[]);
    assert_eq!(scene.geometry.meshes[0].triangles.len(), 1_000_000);
    assert_eq!(scene.camera.resolution(), [1024, 1024]);
    assert_eq!(scene.picture, Some(LayerSpec::Facing));
    assert_eq!(scene.layers.len(), 3, "{:?}", scene.layers);
    assert_eq!(scene.objects, ["blob", "ground"]);
}

#[test]
fn an_empty_scene_is_a_scene() {
    let scene = from_text(r#"{"etendue": 1}"#, &[]);
    assert_eq!(scene.geometry.triangles(), 0);
    assert_eq!(scene.layers, [LayerSpec::Facing], "a picture when nothing is said");
    assert_eq!(scene.camera_origin, CameraOrigin::Framed);
    let depth = from_text(r#"{"etendue": 1, "layers": ["depth", "depth"], "objects": []}"#, &[]);
    assert_eq!((depth.picture, depth.layers), (None, vec![LayerSpec::Depth]));
}

#[test]
fn a_byte_order_mark_is_no_error() {
    assert!(from_text("\u{feff}{\"etendue\": 1}", &[]).objects.is_empty());
}

#[test]
fn shapes_alike_are_one_mesh_and_stand_where_they_are_told() {
    let text = r#"{"etendue": 1, "objects": [
        {"shape": "box", "transform": {"translate": [5, 0, 0], "scale": [-1, 2, 1]}},
        {"shape": "box", "material": "m", "name": "second"},
        {"shape": "box", "size": [2, 1, 1]}
    ], "materials": {"m": {"type": "matte", "color": [0.1, 0.2, 0.3]}}}"#;
    let scene = from_text(text, &[]);
    let geometry = &scene.geometry;
    assert_eq!((geometry.meshes.len(), geometry.placements.len()), (2, 3));
    assert_eq!((geometry.triangles_unique(), geometry.triangles()), (24, 36));
    let first = &geometry.placements[0].world_from_mesh;
    assert_eq!(first.point(DVec3::ONE), DVec3::new(4.0, 2.0, 1.0));
    assert_eq!(first.handedness(), -1.0);
    assert_eq!(scene.objects, ["box", "second", "box"]);
    let material = &scene.materials[geometry.placements[1].material as usize];
    assert_eq!(material.name, "m");
}

#[test]
fn a_camera_without_pose_frames_what_is_there() {
    let text = r#"{"etendue": 1, "camera": {"type": "pinhole", "fov": 30},
        "objects": [{"shape": "sphere", "transform": {"translate": [100, 200, 300]}}]}"#;
    let scene = from_text(text, &[]);
    let offset = scene.camera.pose().position - DVec3::new(100.0, 200.0, 300.0);
    assert!(offset.length() < 15.0 && offset.min_element() > 0.0, "{offset}");
    assert!(scene.camera.pose().forward().dot(-offset.normalize()) > 0.999);
}

#[test]
fn settings_change_the_scene() {
    let text = r#"{"etendue": 1, "camera": {"type": "pinhole", "fov": 30,
        "sensor": {"resolution": [8, 6]}}, "objects": [{"shape": "box"}]}"#;
    let fy = |scene: &Scene| scene.camera.opencv().k.unwrap()[1][1];
    let plain = from_text(text, &[]);
    let wide = from_text(text, &[("camera.fov", "90")]);
    assert!(fy(&wide) < fy(&plain));
    assert!((fy(&wide) - 3.0).abs() < 1e-14, "half of 6 rows over tan 45°, one rounding");
    let sharp = from_text(text, &[("camera.sensor.resolution", "[4, 3]")]);
    assert_eq!(sharp.camera.resolution(), [4, 3]);
    let two = from_text(text, &[("objects[0].shape", "sphere"), ("layers", "[\"ids\"]")]);
    assert_eq!((two.objects, two.layers), (vec!["sphere".to_owned()], vec![LayerSpec::Ids]));
}

#[test]
fn the_hash_is_of_the_contents() {
    let text = r#"{"etendue": 1, "camera": {"type": "pinhole", "fov": 30}, "objects": []}"#;
    let same = r#"{ "objects": [],
        "camera": {"fov": 30, "type": "pinhole"}, "etendue": 1 }"#;
    let hash = |scene: Scene| scene.hash().unwrap();
    let first = hash(from_text(text, &[]));
    assert_eq!(first, hash(from_text(same, &[])), "layout and place do not count");
    assert_ne!(first, hash(from_text(text, &[("camera.fov", "31")])));
    assert_eq!(first.to_string().len(), 32);

    let folder = tempfile::tempdir().unwrap();
    let (path, model) = (folder.path().join("s.json"), folder.path().join("m.obj"));
    fs::write(&path, r#"{"etendue": 1, "objects": [{"file": "m.obj"}]}"#).unwrap();
    fs::write(&model, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let before = hash(load(&path, &[]));
    fs::write(&model, "v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n").unwrap();
    assert_ne!(before, hash(load(&path, &[])), "one digit of the model");
}

#[test]
fn a_model_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("one model.obj");
    fs::write(&model, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let scene = load(&model, &[("camera.sensor.resolution", "[64, 48]")]);
    assert_eq!(scene.geometry.triangles(), 1);
    assert_eq!(scene.camera.resolution(), [64, 48]);
    assert_eq!(scene.camera_origin, CameraOrigin::Framed);
    assert_eq!(scene.camera.pose().forward(), DVec3::NEG_Z, "a flat model is seen face on");
}

#[test]
fn one_file_used_twice_is_read_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    fs::write(folder.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let text = r#"{"etendue": 1, "objects": [{"file": "m.obj"},
        {"file": "./m.obj", "transform": {"translate": [0, 0, 1]}}]}"#;
    fs::write(&path, text).unwrap();
    let scene = load(&path, &[]);
    assert_eq!(scene.geometry.meshes.len(), 1);
    assert_eq!(scene.geometry.uses(), [2]);
    assert_eq!(scene.stats.files.len(), 1);
}

#[test]
fn materials_of_a_model_are_replaced_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    fs::write(
        folder.path().join("m.obj"),
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl body\nf 1 2 3\nusemtl rim\nf 1 3 2\n",
    )
    .unwrap();
    fs::write(folder.path().join("m.mtl"), "newmtl body\nKd 1 0 0\nnewmtl rim\nKd 0 1 0\n")
        .unwrap();
    let names = |keys: &str| -> Vec<String> {
        let text = format!(
            r#"{{"etendue": 1, "objects": [{{"file": "m.obj"{keys}}}], "materials":
                {{"gold": {{"type": "mirror"}}, "clay": {{"type": "mirror"}}}}}}"#
        );
        fs::write(&path, text).unwrap();
        let scene = load(&path, &[]);
        let of =
            |p: &etendue_geometry::Placement| scene.materials[p.material as usize].name.clone();
        scene.geometry.placements.iter().map(of).collect()
    };
    assert_eq!(names(""), ["body", "rim"]);
    assert_eq!(names(r#", "materials": {"rim": "gold"}"#), ["body", "gold"]);
    assert_eq!(names(r#", "material": "clay", "materials": {"rim": "gold"}"#), ["clay", "gold"]);
    let refused = |keys: &str| {
        let text = format!(
            r#"{{"etendue": 1, "objects": [{{"file": "m.obj", "materials": {keys}}}], "materials":
                {{"gold": {{"type": "mirror"}}}}}}"#
        );
        fs::write(&path, text).unwrap();
        let file = SceneFile::read(&path, &[]).unwrap();
        file.load(Wanted::EVERYTHING, &LoadOptions::default()).unwrap_err().to_string()
    };
    let error = refused(r#"{"rmi": "gold"}"#);
    assert!(error.contains("objects[0].materials.rmi") && error.contains("`rim`"), "{error}");
    let error = refused(r#"{"rim": "glod"}"#);
    assert!(error.contains("objects[0].materials.rim") && error.contains("`gold`"), "{error}");
}

#[test]
fn the_schema_is_a_schema() {
    let schema = scene_schema();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    let keys: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
    for key in ["etendue", "camera", "tracer", "layers", "objects", "materials", "render"] {
        assert!(keys.contains(&&key.to_owned()), "{key} in {keys:?}");
    }
    assert_eq!(schema["additionalProperties"], false);
}

#[test]
fn a_model_has_an_object_for_each_of_its_nodes() {
    let Some(data) = test_data() else { return };
    let scene = load(&data.join("gltf/SharedMesh/02_shared_mesh.gltf"), &[]);
    assert_eq!(scene.objects.len(), 2, "{:?}", scene.objects);
    assert_eq!(scene.geometry.uses(), [2], "two nodes, one mesh");
    let objects: Vec<u32> = scene.geometry.placements.iter().map(|p| p.object).collect();
    assert_eq!(objects, [0, 1]);
}

#[test]
fn a_models_camera_moves_with_its_object_and_keeps_the_scenes_resolution() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    fs::copy(data.join("gltf/Cameras/Cameras.gltf"), folder.path().join("c.gltf")).unwrap();
    let path = folder.path().join("s.json");
    let text = r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [32, 16]}},
        "objects": [{"file": "c.gltf", "transform": {"translate": [0, 10, 0], "scale": 2}}]}"#;
    fs::write(&path, text).unwrap();
    let options = LoadOptions { camera: Some("0"), ..LoadOptions::default() };
    let scene = SceneFile::read(&path, &[]).unwrap().load(Wanted::NOTHING, &options).unwrap();
    assert_eq!(scene.camera_origin, CameraOrigin::Model("0".to_owned()));
    assert_eq!(scene.camera.resolution(), [32, 16]);
    assert_eq!(scene.camera.pose().position, DVec3::new(1.0, 11.0, 6.0), "(0.5, 0.5, 3) twice, up");
    assert_eq!(scene.camera.pose().forward(), DVec3::NEG_Z);
    assert_eq!(scene.cameras.len(), 2);
}

#[test]
fn loading_tells_how_far_it_is_and_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    fs::write(&path, r#"{"etendue": 1, "objects": [{"shape": "box"}, {"shape": "disk"}]}"#)
        .unwrap();
    let file = SceneFile::read(&path, &[]).unwrap();
    let told = std::sync::Mutex::new(Vec::new());
    let tell = |step: etendue_scene::LoadProgress<'_>| {
        told.lock().unwrap().push((step.done, step.total));
        true
    };
    let options = LoadOptions { progress: Some(&tell), ..LoadOptions::default() };
    file.load(Wanted::NOTHING, &options).unwrap();
    let mut told = told.lock().unwrap().clone();
    told.sort_unstable();
    told.dedup();
    // Before each object and behind it, and while the camera that has no pose is placed.
    assert_eq!(told, [(0, 2), (1, 1), (1, 2), (2, 2)]);
    let options = LoadOptions { progress: Some(&|_| false), ..LoadOptions::default() };
    let error = file.load(Wanted::NOTHING, &options).unwrap_err();
    assert!(matches!(error, etendue_scene::SceneError::Stopped), "{error}");
}

#[test]
fn placing_a_camera_before_many_triangles_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    let blob = r#"{"shape": "blob", "triangles": 500000}"#;
    fs::write(&path, format!(r#"{{"etendue": 1, "objects": [{blob}, {blob}]}}"#)).unwrap();
    let file = SceneFile::read(&path, &[]).unwrap();
    let asked = std::sync::atomic::AtomicUsize::new(0);
    // It says no once: what asks again must not go on.
    let stop = |step: etendue_scene::LoadProgress<'_>| {
        step.name != "camera" || asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) != 3
    };
    let options = LoadOptions { progress: Some(&stop), ..LoadOptions::default() };
    let error = file.load(Wanted::NOTHING, &options).unwrap_err();
    assert!(matches!(error, etendue_scene::SceneError::Stopped), "{error}");
}

#[test]
fn a_key_that_is_set_to_null_is_as_if_it_were_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let scene = r#"{"etendue": 1, "layers": ["depth"], "render": {"samples": 4}, "objects": []}"#;
    std::fs::write(&path, scene).unwrap();
    let null = |key: &str| Setting::new(key, "null");
    let file = SceneFile::read(&path, &[null("layers"), null("render")]).unwrap();
    assert!(file.spec.layers.is_empty());
    let is_written = |key: &str| file.value().get(key).is_some();
    assert!(is_written("objects") && !is_written("layers") && !is_written("render"));
    // In the file itself it stays an error.
    std::fs::write(&path, r#"{"etendue": 1, "layers": null}"#).unwrap();
    assert!(SceneFile::read(&path, &[]).is_err());
}
