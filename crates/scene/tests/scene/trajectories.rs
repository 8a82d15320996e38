//! Files of poses in the conventions of data sets that people have: each is written here by its own documentation, from
//! one set of poses by formulas of its own, and read again.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;

use etendue_camera::{CameraFile, PixelOrigin};
use etendue_files::{Opener, Reach};
use etendue_scene::{LoadOptions, SceneError, SceneFile, Wanted};
use serde_json::{Map, Value, json};

/// Columns and rows that files give.
const SIZE: [u32; 2] = [800, 600];
/// Focal lengths and principal point (pixels from the corner).
const K: [f64; 4] = [612.25, 609.5, 403.125, 297.75];
/// Columns and rows of the scene, where the file gives none.
const OWN: [u32; 2] = [64, 48];
/// The scene's own camera (degrees, vertical).
const OWN_FOV: f64 = 50.0;

type Rows = [[f64; 4]; 3];
/// Coefficients for OpenCV's function of this name.
type Terms = Option<(&'static str, Vec<f64>)>;

/// Name, number and parameters of a camera model of COLMAP, and the same as K and OpenCV's coefficients.
type ColmapModel = (&'static str, i32, Vec<f64>, [f64; 4], Terms);

/// A camera's place by an axis of length 1, an angle (radians) and a position: its axes are OpenCV's.
#[derive(Clone, Copy)]
struct Place {
    axis: [f64; 3],
    angle: f64,
    position: [f64; 3],
}

const PLACES: [Place; 3] = [
    Place { axis: [0.6, 0.0, 0.8], angle: 0.75, position: [0.5, -1.25, 3.0] },
    Place { axis: [0.0, -1.0, 0.0], angle: 2.5, position: [-2.0, 0.25, 0.125] },
    Place { axis: [0.48, 0.6, -0.64], angle: -1.125, position: [10.0, 20.0, -30.0] },
];

impl Place {
    /// Rodrigues' formula: camera to world.
    fn world_from_camera(self) -> Rows {
        let ([x, y, z], (s, c)) = (self.axis, self.angle.sin_cos());
        let v = 1.0 - c;
        let [a, b, d] = self.position;
        [
            [c + x * x * v, x * y * v - z * s, x * z * v + y * s, a],
            [y * x * v + z * s, c + y * y * v, y * z * v - x * s, b],
            [z * x * v - y * s, z * y * v + x * s, c + z * z * v, d],
        ]
    }

    /// The inverse of a rigid map: its transpose.
    fn camera_from_world(self) -> Rows {
        let m = self.world_from_camera();
        let row = |i: usize| {
            let t: f64 = (0..3).map(|k| -m[k][i] * m[k][3]).sum();
            [m[0][i], m[1][i], m[2][i], t]
        };
        [row(0), row(1), row(2)]
    }

    /// Euler's parameters of camera to world, the real part first.
    fn quaternion(self) -> [f64; 4] {
        let (s, c) = (0.5 * self.angle).sin_cos();
        let [x, y, z] = self.axis;
        [c, s * x, s * y, s * z]
    }

    /// Camera to world with OpenGL's axes: y and z of the camera point the other way.
    fn opengl(self) -> Rows {
        self.world_from_camera().map(|[a, b, c, d]| [a, -b, -c, d])
    }
}

/// A file of a data set beside what it says.
struct DataSet {
    name: String,
    /// The files; the scene names the first.
    files: Vec<(&'static str, Vec<u8>)>,
    /// More keys of `frames`.
    keys: Value,
    /// fx, fy, cx and cy; `None` for the scene's own camera.
    k: Option<[f64; 4]>,
    size: Option<[u32; 2]>,
    /// Distortion by OpenCV's function of this name.
    distortion: Terms,
    /// Words that a note has; none where there is nothing to note.
    notes: &'static [&'static str],
}

impl DataSet {
    fn new(name: &str, file: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
        Self {
            name: name.to_owned(),
            files: vec![(file, bytes.into())],
            keys: json!({}),
            k: None,
            size: None,
            distortion: None,
            notes: &[],
        }
    }

    /// With a K and a size.
    fn k(mut self, k: [f64; 4]) -> Self {
        (self.k, self.size) = (Some(k), Some(SIZE));
        self
    }
}

/// Lines of `images.txt`; `points` is the line behind each image.
fn images_txt(points: &[Option<&str>; 3]) -> String {
    let mut text = "# Image list with two lines of data per image:\n".to_owned();
    for (i, (place, points)) in PLACES.iter().zip(points).enumerate() {
        let [w, x, y, z] = place.quaternion();
        let m = place.camera_from_world();
        // World to camera: the conjugate.
        let [a, b, c] = [m[0][3], m[1][3], m[2][3]];
        let number = 3 - i;
        let _ = writeln!(text, "{number} {w} {} {} {} {a} {b} {c} 7 view {i}.jpg", -x, -y, -z);
        points.iter().for_each(|points| text += &format!("{points}\n"));
    }
    text
}

fn images_bin() -> Vec<u8> {
    let mut bytes = 3_u64.to_le_bytes().to_vec();
    for (i, place) in (0..).zip(PLACES) {
        let ([w, x, y, z], m) = (place.quaternion(), place.camera_from_world());
        bytes.extend(u32::to_le_bytes(i + 1));
        [w, -x, -y, -z, m[0][3], m[1][3], m[2][3]]
            .iter()
            .for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes.extend(7_u32.to_le_bytes());
        bytes.extend(format!("view {i}.jpg\0").bytes());
        bytes.extend(u64::from(i).to_le_bytes());
        (0..i).for_each(|_| bytes.extend([0x20; 24]));
    }
    bytes
}

fn cameras_bin(model: i32, parameters: &[f64]) -> Vec<u8> {
    let mut bytes = 1_u64.to_le_bytes().to_vec();
    bytes.extend(7_u32.to_le_bytes());
    bytes.extend(model.to_le_bytes());
    SIZE.iter().for_each(|side| bytes.extend(u64::from(*side).to_le_bytes()));
    parameters.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes
}

fn numbers(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// COLMAP's camera models with parameters, and the same as K and OpenCV's coefficients.
fn colmap_models() -> Vec<ColmapModel> {
    let [fx, _, cx, cy] = K;
    let one = [fx, fx, cx, cy];
    let brown = |k: &[f64]| Some(("brown_conrady", k.to_vec()));
    let fisheye = |k: &[f64]| Some(("fisheye", k.to_vec()));
    vec![
        ("SIMPLE_PINHOLE", 0, vec![fx, cx, cy], one, None),
        ("PINHOLE", 1, K.to_vec(), K, None),
        ("SIMPLE_RADIAL", 2, vec![fx, cx, cy, -0.02], one, brown(&[-0.02])),
        ("RADIAL", 3, vec![fx, cx, cy, -0.02, 0.01], one, brown(&[-0.02, 0.01])),
        (
            "OPENCV",
            4,
            [&K[..], &[-0.02, 0.01, 0.001, -0.002]].concat(),
            K,
            brown(&[-0.02, 0.01, 0.001, -0.002]),
        ),
        (
            "OPENCV_FISHEYE",
            5,
            [&K[..], &[-0.02, 0.01, 0.001, -0.002]].concat(),
            K,
            fisheye(&[-0.02, 0.01, 0.001, -0.002]),
        ),
        (
            "FULL_OPENCV",
            6,
            [&K[..], &[-0.02, 0.01, 0.001, -0.002, 0.003, 0.004, 0.005, 0.006]].concat(),
            K,
            brown(&[-0.02, 0.01, 0.001, -0.002, 0.003, 0.004, 0.005, 0.006]),
        ),
        ("SIMPLE_RADIAL_FISHEYE", 8, vec![fx, cx, cy, -0.02], one, fisheye(&[-0.02])),
        ("RADIAL_FISHEYE", 9, vec![fx, cx, cy, -0.02, 0.01], one, fisheye(&[-0.02, 0.01])),
    ]
}

fn colmap() -> Vec<DataSet> {
    let empty = images_txt(&[Some(""); 3]);
    let mut all = Vec::new();
    for (model, number, parameters, k, distortion) in colmap_models() {
        let [w, h] = SIZE;
        let cameras = format!("# CAMERA_ID\n7 {model} {w} {h} {}\n", numbers(&parameters));
        let mut text = DataSet::new(model, "images.txt", empty.clone()).k(k);
        text.files.push(("cameras.txt", cameras.into_bytes()));
        text.distortion.clone_from(&distortion);
        let mut binary = DataSet::new(&format!("{model}, binary"), "images.bin", images_bin()).k(k);
        binary.files.push(("cameras.bin", cameras_bin(number, &parameters)));
        binary.distortion = distortion;
        all.extend([text, binary]);
    }
    // What stands behind an image: an empty line, points, one point, nothing at all, or some of each.
    let many = "2362.39 248.498 58396 1784.7 268.254 59027 1784.7 268.254 -1 1 2 3";
    let one = "0.5 0.25 -1";
    for points in [
        [Some(many); 3],
        [Some(one); 3],
        [None; 3],
        [None, Some(""), Some(many)],
        [Some(many), None, None],
        [Some("\n"), Some(one), None],
    ] {
        let name = format!("points {points:?}");
        let mut set = DataSet::new(&name, "images.txt", images_txt(&points));
        set.files.push(("cameras.txt", format!("7 PINHOLE 800 600 {}", numbers(&K)).into_bytes()));
        all.push(set.k(K));
    }
    let mut alone = DataSet::new("without cameras.txt", "images.txt", empty);
    alone.notes = &["no cameras.txt"];
    all.push(alone);
    all
}

/// A `transforms.json` with these keys of the file, and of each frame.
fn transforms(all: &Value, own: &Value) -> Vec<u8> {
    let frame = |(i, place): (usize, &Place)| {
        let [a, b, c] = place.opengl();
        let mut frame: Map<String, Value> = own.as_object().unwrap().clone();
        frame.insert("file_path".to_owned(), json!(format!("./train/r_{i}")));
        let rows = json!([a, b, c, [0, 0, 0, 1]]);
        frame.insert("transform_matrix".to_owned(), rows);
        Value::Object(frame)
    };
    let mut file = all.clone();
    file["frames"] = PLACES.iter().enumerate().map(frame).collect();
    file.to_string().into_bytes()
}

/// A `transforms.json` with these keys of the file, and of each frame.
fn file(name: &str, all: &Value, own: &Value) -> DataSet {
    DataSet::new(name, "transforms.json", transforms(all, own))
}

/// The K and the size, and more keys.
fn with(more: &Value) -> Value {
    let [fx, fy, cx, cy] = K;
    let [w, h] = SIZE;
    let mut all = json!({"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": w, "h": h});
    more.as_object().unwrap().iter().for_each(|(key, value)| all[key] = value.clone());
    all
}

/// Coefficients, as OpenCV's standard model or its fisheye model has them.
const TERMS: [f64; 4] = [-0.02, 0.01, 0.001, -0.002];

/// The keys of a fisheye, of which `key` says that it is one.
fn fisheye(key: &str, value: Value) -> Value {
    let [k1, k2, k3, k4] = TERMS;
    let mut keys = json!({"k1": k1, "k2": k2, "k3": k3, "k4": k4});
    keys[key] = value;
    with(&keys)
}

fn of_nerfstudio() -> Vec<DataSet> {
    let (k, none) = (with(&json!({})), json!({}));
    let bent = json!({"k1": -0.02, "k2": 0.01, "p1": 0.001, "p2": -0.002});
    let brown = Some(("brown_conrady", TERMS.to_vec()));
    vec![
        file("nerfstudio, all frames", &k, &none).k(K),
        file("nerfstudio, each frame", &json!({"camera_model": "OPENCV"}), &k).k(K),
        DataSet {
            distortion: brown.clone(),
            ..file("nerfstudio, distortion", &with(&bent), &none).k(K)
        },
        DataSet {
            distortion: brown,
            ..file(
                "nerfstudio, distortion_params",
                &k,
                &json!({"distortion_params": [-0.02, 0.01, 0.0, 0.0, 0.001, -0.002]}),
            )
            .k(K)
        },
        DataSet {
            distortion: Some(("fisheye", TERMS.to_vec())),
            ..file("nerfstudio, fisheye", &fisheye("camera_model", json!("OPENCV_FISHEYE")), &none)
                .k(K)
        },
        DataSet {
            notes: &["not read: applied_scale, applied_transform, ply_file_path"],
            ..file(
                "nerfstudio, processed",
                &with(&json!({"applied_transform": [[1, 0, 0, 0]], "applied_scale": 0.5,
                              "ply_file_path": "sparse_pc.ply", "camera_model": "PINHOLE"})),
                &json!({"colmap_im_id": 3, "mask_path": "m.png", "depth_file_path": "d.png"}),
            )
            .k(K)
        },
    ]
}

/// Those of instant-ngp, and of NeRF's synthetic scenes.
fn of_nerf() -> Vec<DataSet> {
    let [fx, fy, cx, cy] = K;
    let [w, h] = SIZE;
    let [width, height] = SIZE.map(f64::from);
    let angle = |side: f64, focal: f64| 2.0 * (0.5 * side / focal).atan();
    let (angle_x, angle_y) = (angle(width, fx), angle(height, fy));
    let [own_width, own_height] = OWN.map(f64::from);
    let middle = |k: [f64; 2]| [k[0], k[1], 0.5 * width, 0.5 * height];
    let own_f = 0.5 * own_width / (0.5 * angle_x).tan();
    let none = json!({});
    vec![
        DataSet {
            distortion: Some(("brown_conrady", TERMS.to_vec())),
            notes: &["not read: aabb_scale, sharpness"],
            ..file(
                "instant-ngp",
                &json!({"camera_angle_x": angle_x, "camera_angle_y": angle_y, "fl_x": fx, "fl_y": fy,
                        "k1": -0.02, "k2": 0.01, "k3": 0, "k4": 0, "p1": 0.001, "p2": -0.002,
                        "is_fisheye": false, "cx": cx, "cy": cy, "w": 800.0, "h": 600.0, "aabb_scale": 16}),
                &json!({"sharpness": 25.5}),
            )
            .k(K)
        },
        DataSet {
            distortion: Some(("fisheye", TERMS.to_vec())),
            ..file("instant-ngp, fisheye", &fisheye("is_fisheye", json!(true)), &none).k(K)
        },
        file("instant-ngp, degrees", &json!({"x_fov": angle_x * 180.0 / PI, "y_fov": angle_y * 180.0 / PI,
                                            "w": w, "h": h}), &none)
            .k(middle([fx, fy])),
        // As Blender's exporter writes it: the picture's size is that of its images.
        DataSet {
            k: Some([own_f, own_f, 0.5 * own_width, 0.5 * own_height]),
            notes: &["not read: rotation"],
            ..file(
                "NeRF's synthetic scenes",
                &json!({"camera_angle_x": angle_x}),
                &json!({"rotation": 0.012_566_370_614_359_171}),
            )
        },
        file("camera_angle_x with a size", &json!({"camera_angle_x": angle_x, "w": w, "h": h}), &none)
            .k(middle([fx, fx])),
        file("both angles", &json!({"camera_angle_x": angle_x, "camera_angle_y": angle_y, "w": w, "h": h}), &none)
            .k(middle([fx, fy])),
        file("one focal length, no centre", &json!({"fl_x": fx, "w": w, "h": h}), &none).k(middle([fx, fx])),
        DataSet {
            notes: &["fl_x is taken", "camera_angle_x and w make"],
            ..file("an angle of another size", &with(&json!({"camera_angle_x": 0.1})), &none).k(K)
        },
        DataSet {
            k: Some(K),
            ..file("pixels, and the size in the scene", &json!({"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy}), &none)
        },
        DataSet {
            notes: &["no focal length", "not read: h, w"],
            ..file("no intrinsics", &json!({"w": w, "h": h}), &none)
        },
    ]
}

fn npy(rows: usize) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': (3, {rows}, 4), }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").bytes());
    for place in PLACES {
        let [a, b, c] = place.world_from_camera();
        let all = [a, b, c, [0.0, 0.0, 0.0, 1.0]];
        all[..rows].iter().flatten().for_each(|number| bytes.extend(number.to_le_bytes()));
    }
    bytes
}

/// Formats that hold poses alone.
fn poses() -> Vec<DataSet> {
    let line = |rows: Rows| numbers(rows.as_flattened()) + "\n";
    let kitti: String = PLACES.iter().map(|place| line(place.world_from_camera())).collect();
    let inverse: String = PLACES.iter().map(|place| line(place.camera_from_world())).collect();
    let opengl: String = PLACES.iter().map(|place| line(place.opengl())).collect();
    let tum = |(i, place): (usize, &Place)| {
        let ([w, x, y, z], [a, b, c]) = (place.quaternion(), place.position);
        format!("{i}.5 {a} {b} {c} {x} {y} {z} {w}\n")
    };
    let tum: String = PLACES.iter().enumerate().map(tum).collect();
    let keyed = |name: &str, file, text: &str, keys: Value| DataSet {
        keys,
        ..DataSet::new(name, file, text)
    };
    vec![
        DataSet::new("TUM", "groundtruth.txt", format!("# timestamp tx ty tz qx qy qz qw\n{tum}")),
        DataSet::new("TUM by commas", "poses.tum", tum.replace(' ', ",")),
        DataSet::new("KITTI", "00.txt", &*kitti),
        keyed("KITTI by name", "poses.dat", &kitti, json!({"format": "kitti"})),
        keyed("KITTI, world to camera", "00.txt", &inverse, json!({"maps": "camera_from_world"})),
        keyed("KITTI, OpenGL", "00.txt", &opengl, json!({"convention": "opengl"})),
        DataSet::new("NPY n × 4 × 4", "poses.npy", npy(4)),
        DataSet::new("NPY n × 3 × 4", "poses.npy", npy(3)),
    ]
}

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
