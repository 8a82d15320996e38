//! Data sets of each convention, written from one set of poses by the formulas of its own documentation.

use std::f64::consts::PI;
use std::fmt::Write as _;

use serde_json::{Map, Value, json};

/// Columns and rows that files give.
pub(super) const SIZE: [u32; 2] = [800, 600];

/// Focal lengths and principal point (pixels from the corner).
pub(super) const K: [f64; 4] = [612.25, 609.5, 403.125, 297.75];

/// Columns and rows of the scene, where the file gives none.
pub(super) const OWN: [u32; 2] = [64, 48];

/// The scene's own camera (degrees, vertical).
pub(super) const OWN_FOV: f64 = 50.0;

pub(super) type Rows = [[f64; 4]; 3];

/// Coefficients for OpenCV's function of this name.
pub(super) type Terms = Option<(&'static str, Vec<f64>)>;

/// Name, number and parameters of a camera model of COLMAP, and the same as K and OpenCV's coefficients.
type ColmapModel = (&'static str, i32, Vec<f64>, [f64; 4], Terms);

/// A camera's place by an axis of length 1, an angle (radians) and a position: its axes are OpenCV's.
#[derive(Clone, Copy)]
pub(super) struct Place {
    axis: [f64; 3],
    angle: f64,
    position: [f64; 3],
}

pub(super) const PLACES: [Place; 3] = [
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
    pub(super) fn camera_from_world(self) -> Rows {
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
pub(super) struct DataSet {
    pub(super) name: String,
    /// The files; the scene names the first.
    pub(super) files: Vec<(&'static str, Vec<u8>)>,
    /// More keys of `frames`.
    pub(super) keys: Value,
    /// fx, fy, cx and cy; `None` for the scene's own camera.
    pub(super) k: Option<[f64; 4]>,
    pub(super) size: Option<[u32; 2]>,
    /// Distortion by OpenCV's function of this name.
    pub(super) distortion: Terms,
    /// Words that a note has; none where there is nothing to note.
    pub(super) notes: &'static [&'static str],
}

impl DataSet {
    pub(super) fn new(name: &str, file: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
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
    pub(super) fn k(mut self, k: [f64; 4]) -> Self {
        (self.k, self.size) = (Some(k), Some(SIZE));
        self
    }
}

/// Lines of `images.txt`; `points` is the line behind each image.
pub(super) fn images_txt(points: &[Option<&str>; 3]) -> String {
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

pub(super) fn images_bin() -> Vec<u8> {
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

pub(super) fn cameras_bin(model: i32, parameters: &[f64]) -> Vec<u8> {
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

pub(super) fn colmap() -> Vec<DataSet> {
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
pub(super) fn transforms(all: &Value, own: &Value) -> Vec<u8> {
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

pub(super) fn of_nerfstudio() -> Vec<DataSet> {
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
pub(super) fn of_nerf() -> Vec<DataSet> {
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
pub(super) fn poses() -> Vec<DataSet> {
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
