//! Files of poses in the conventions of data sets that people have: each is written here by its own documentation, from
//! one set of poses by formulas of its own, and read again.

mod sets;

use std::f64::consts::PI;
use std::fs;

use etendue_camera::{CameraFile, PixelOrigin};
use etendue_files::{Opener, Reach};
use etendue_scene::{LoadOptions, SceneError, SceneFile, Wanted};
use serde_json::{Value, json};

use sets::{
    DataSet, K, OWN, OWN_FOV, PLACES, SIZE, cameras_bin, colmap, images_bin, images_txt, of_nerf,
    of_nerfstudio, poses, transforms,
};

/// The cameras of all frames, and the notes.
fn read(set: &DataSet) -> Result<(Vec<CameraFile>, Vec<String>), SceneError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in &set.files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let mut frames = json!({"type": "trajectory", "file": set.files[0].0});
    set.keys.as_object().unwrap().iter().for_each(|(key, value)| frames[key] = value.clone());
    let mut camera = json!({"type": "pinhole", "sensor": {"resolution": OWN}});
    if set.k.is_none() {
        camera["fov"] = json!(OWN_FOV);
    }
    let scene = json!({"camera": camera, "layers": ["depth"], "objects": [{"shape": "rectangle"}],
                       "frames": frames});
    let file = SceneFile::from_json(&Opener::default(), folder.path(), scene).unwrap();
    let opener = Opener::new(Reach::OwnFolder);
    let frames = file.frames(&opener, || panic!("a trajectory starts nowhere"))?.unwrap();
    let camera = |frame| {
        let scene = file.at(frame)?.load(Wanted::NOTHING, &LoadOptions::default())?;
        Ok(scene.camera.opencv())
    };
    let cameras = frames.frames.iter().map(camera).collect::<Result<_, SceneError>>()?;
    let notes = frames.notes.iter().map(|note| format!("{}: {}", note.subject, note.message));
    Ok((cameras, notes.collect()))
}

/// Equal to the roundings of a few operations.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * b.abs().max(1.0)
}

#[test]
fn data_sets_of_every_convention_give_their_cameras() {
    let sets: Vec<DataSet> =
        [colmap(), of_nerfstudio(), of_nerf(), poses()].into_iter().flatten().collect();
    assert!(sets.len() > 40, "{}", sets.len());
    for set in &sets {
        let name = &set.name;
        let (cameras, notes) = read(set).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(cameras.len(), PLACES.len(), "{name}: frames");
        for (camera, place) in cameras.iter().zip(PLACES) {
            let expected = place.camera_from_world();
            for (row, wanted) in camera.camera_from_world.iter().zip(expected) {
                for (number, wanted) in row.iter().zip(wanted) {
                    assert!(is_near(*number, wanted), "{name}: pose {number} {wanted}");
                }
            }
            assert_eq!(camera.resolution, set.size.unwrap_or(OWN), "{name}");
            let [w, h] = OWN.map(f64::from);
            let own = 0.5 * h / (0.5 * OWN_FOV * PI / 180.0).tan();
            let [fx, fy, cx, cy] = set.k.unwrap_or([own, own, 0.5 * w, 0.5 * h]);
            let corner = if camera.pixel_origin == PixelOrigin::Corner { 0.0 } else { 0.5 };
            let wanted = [[fx, 0.0, cx - corner], [0.0, fy, cy - corner], [0.0, 0.0, 1.0]];
            for (number, wanted) in
                camera.k.unwrap().as_flattened().iter().zip(wanted.as_flattened())
            {
                assert!(is_near(*number, *wanted), "{name}: K {number} {wanted}");
            }
            let found = camera.distortion.as_ref().unwrap();
            let (model, terms) = set.distortion.clone().unwrap_or(("none", Vec::new()));
            assert_eq!(found.model, model, "{name}");
            // OpenCV's vectors have certain lengths.
            for (i, number) in found.coefficients.iter().enumerate() {
                assert_eq!(*number, terms.get(i).copied().unwrap_or(0.0), "{name}: term {i}");
            }
            assert!(found.coefficients.len() >= terms.len(), "{name}");
        }
        let said = notes.join("\n");
        assert_eq!(said.is_empty(), set.notes.is_empty(), "{name}: {said}");
        set.notes.iter().for_each(|words| assert!(said.contains(words), "{name}: {said}"));
        if let Some(file) = set.files.first().filter(|_| !said.is_empty()) {
            assert!(said.contains(file.0), "{name}: {said}");
        }
    }
}

#[test]
fn what_is_wrong_in_a_file_of_poses_is_told_by_its_place() {
    let images = images_txt(&[Some(""); 3]);
    let colmap = |cameras: &str| {
        let mut set = DataSet::new(cameras, "images.txt", images.clone()).k(K);
        set.files.push(("cameras.txt", cameras.as_bytes().to_vec()));
        set
    };
    let of_images = |text: &str| DataSet::new(text, "images.txt", text);
    let json = |all: Value| {
        DataSet::new(&all.to_string(), "transforms.json", transforms(&all, &json!({}))).k(K)
    };
    let binary = |bytes: &[u8], name: &str| {
        let mut set = DataSet::new(name, "images.bin", images_bin()).k(K);
        set.files.push(("cameras.bin", bytes.to_vec()));
        set
    };
    let whole = cameras_bin(1, &K);
    let cut = DataSet::new("cut images", "images.bin", &images_bin()[..200]);
    let twelve = "5 1 0 0 0 1 2 3 7 10 20 30";
    let ambiguous = format!("{}{twelve}\n", images_txt(&[None; 3]));
    let [w, h] = SIZE;
    for (set, words) in [
        (colmap("garbage"), &["cameras.txt", "1 words in line 1", "export the model again"][..]),
        (colmap("# nothing\n"), &["cameras.txt", "has no camera"]),
        (colmap("\n7 PINHOLE\n"), &["cameras.txt", "2 words in line 2"]),
        (colmap("7 PINHOLE 800"), &["3 words in line 1"]),
        (colmap("7 PINHOLE 800 600 1 2 3"), &["3 parameters in line 1", "PINHOLE has 4"]),
        (colmap("7 PINHOLE 800 600 1 2 3 4 5"), &["5 parameters"]),
        (colmap("7 PINHOLE 800 600 1 nan 3 4"), &["\"nan\" in line 1"]),
        (colmap("7 PINHOLE 800 6e2 1 2 3 4"), &["\"6e2\" in line 1"]),
        (colmap("7 PINHOLE 800 600 -5 2 3 4"), &["camera 7", "focal lengths -5"]),
        (
            colmap("7 FOV 800 600 1 2 3 4 0.9"),
            &["FOV camera", "RADIAL_FISHEYE", "image_undistorter"],
        ),
        (colmap("8 PINHOLE 800 600 1 2 3 4"), &["camera 7", "line 2", "none of that number"]),
        (of_images("1 1 0 0 0 0 0"), &["7 words in line 1"]),
        (of_images("1.5 1 0 0 0 0 0 4 1 a.png"), &["\"1.5\" in line 1"]),
        (of_images("0.5 0.25 -1"), &["line of points, 1, where an image is due"]),
        (of_images(&ambiguous), &["may be an image and may be the points", "rename"]),
        (binary(&whole[..whole.len() - 1], "cut"), &["cameras.bin", "ends inside", "byte 56"]),
        (binary(&[&whole[..], &[0]].concat(), "more"), &["1 bytes after its last"]),
        (binary(&cameras_bin(7, &[1.0; 5]), "FOV"), &["cameras.bin", "byte 8", "FOV"]),
        (binary(&cameras_bin(77, &[]), "unknown"), &["model 77"]),
        (cut, &["images.bin", "ends inside"]),
        (json(json!({"fl_x": "612"})), &["frame 0", "fl_x = \"612\""]),
        (json(json!({"w": w, "fl_x": 600})), &["w and without h"]),
        (json(json!({"w": 800.5, "h": h, "fl_x": 600})), &["w = 800.5"]),
        (json(json!({"w": w, "h": h, "k1": 0.1})), &["k1 and without a focal length"]),
        (json(json!({"w": w, "h": h, "fl_x": -600})), &["focal lengths -600"]),
        (json(json!({"w": w, "h": h, "camera_angle_x": 4})), &["camera_angle_x = 4"]),
        (json(json!({"w": w, "h": h, "fl_x": 600, "k4": 0.1})), &["k4", "r⁸"]),
        (json(json!({"fl_x": 600, "camera_model": "FISHEYE624"})), &["FISHEYE624", "known"]),
        (json(json!({"rolling_shutter": [0, 0, 0, 0.1]})), &["rolling_shutter", "remove the key"]),
        (json(json!({"from_mitsuba": true})), &["from_mitsuba"]),
        (DataSet::new("no frames", "transforms.json", "{}"), &["`frames`"]),
        (
            DataSet::new("KITTI", "a.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0\n"),
            &["4 words in line 2", "12"],
        ),
    ] {
        let name = &set.name;
        let Err(error) = read(&set) else { panic!("{name} is read") };
        let error = error.to_string();
        words.iter().for_each(|words| assert!(error.contains(words), "{name}: {error}"));
        assert!(error.contains(set.files[0].0), "{name}: {error}");
    }
}
