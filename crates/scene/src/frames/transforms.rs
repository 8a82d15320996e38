//! `transforms.json`: camera-to-world matrices with OpenGL's axes, intrinsics for all frames or for each. One name for
//! three formats that agree where they say the same: that of NeRF's synthetic scenes (Mildenhall et al. 2020), instant-ngp's
//! (`src/nerf_loader.cu`), and nerfstudio's (<https://docs.nerf.studio/quickstart/data_conventions.html>).
//!
//! Intrinsics of a trajectory's file, as settings of a scene.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use super::frame::Station;
use crate::import::NoteKind;
use etendue_camera::{Convention, Maps, PoseSpec};

/// The pixels of the scene's own camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScenePicture {
    /// Columns and rows.
    pub(super) resolution: [u32; 2],
    /// True if the scene gives it, false if it is a default.
    pub(super) is_given: bool,
}

/// Keys that are read.
const READ: [&str; 22] = [
    "frames",
    "transform_matrix",
    "time",
    "fl_x",
    "fl_y",
    "camera_angle_x",
    "camera_angle_y",
    "x_fov",
    "y_fov",
    "cx",
    "cy",
    "w",
    "h",
    "k1",
    "k2",
    "k3",
    "k4",
    "p1",
    "p2",
    "distortion_params",
    "camera_model",
    "is_fisheye",
];

/// Keys that name the pictures a frame was made of.
const PICTURES: [&str; 4] = ["file_path", "depth_file_path", "mask_path", "colmap_im_id"];

/// Keys that change poses or rays in ways that nothing here does, unless they are off.
const REFUSED: [&str; 19] = [
    "from_mitsuba",
    "from_na",
    "transform_matrix_start",
    "transform_matrix_end",
    "rolling_shutter",
    "latlong",
    "equirectangular",
    "ftheta_p0",
    "ftheta_p1",
    "ftheta_p2",
    "ftheta_p3",
    "ftheta_p4",
    "k5",
    "k6",
    "s1",
    "s2",
    "s3",
    "s4",
    "skew",
];

/// Keys that mean nothing without a focal length.
const OF_LENS: [&str; 9] = ["cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "distortion_params"];

/// Tolerance of two keys that state the same focal length: files are written with four digits and more.
const SAME_FOCAL: f64 = 1e-3;

type Notes = Vec<(NoteKind, String)>;

/// The poses, and what the file has and does otherwise. The error goes on after the file's name.
pub(super) fn read(text: &str, scene: ScenePicture) -> Result<(Vec<Station>, Notes), String> {
    let remedy = "a list `frames` of objects with a transform_matrix is wanted";
    let file: Map<String, Value> = serde_json::from_str(text)
        .map_err(|error| format!("is no transforms.json: {error}\nhint: {remedy}"))?;
    let frames = file.get("frames").and_then(Value::as_array);
    let frames = frames.ok_or_else(|| format!("is no transforms.json: {remedy}"))?;
    let mut said = Said::default();
    let mut stations = Vec::with_capacity(frames.len());
    for (number, frame) in frames.iter().enumerate() {
        let in_frame = |why: String| format!("has a frame {number} {why}");
        let own = frame
            .as_object()
            .ok_or_else(|| in_frame(format!("that is no object\nhint: {remedy}")))?;
        let keys = Keys { file: &file, own };
        stations.push(keys.station(scene, &mut said).map_err(in_frame)?);
    }
    let unread = file.keys().filter(|key| !is_known(key)).cloned();
    said.unread.extend(unread);
    Ok((stations, said.notes()))
}

fn is_known(key: &str) -> bool {
    READ.contains(&key) || PICTURES.contains(&key) || REFUSED.contains(&key)
}

/// Notes to be given of a file once, whatever its frames.
#[derive(Debug, Default)]
struct Said {
    unread: BTreeSet<String>,
    contradictions: BTreeSet<String>,
    lacks_focal: bool,
}

impl Said {
    fn notes(self) -> Notes {
        let list = |names: BTreeSet<String>| names.into_iter().collect::<Vec<_>>().join(", ");
        let mut notes = Vec::new();
        if self.lacks_focal {
            let why = "it has no focal length and no angle of view: the intrinsics are those of the scene's \
                       camera";
            notes.push((NoteKind::Assumed, why.to_owned()));
        }
        if !self.contradictions.is_empty() {
            notes.push((NoteKind::Irregular, list(self.contradictions)));
        }
        if !self.unread.is_empty() {
            let why = format!("not read: {}", list(self.unread));
            notes.push((NoteKind::Unsupported, why));
        }
        notes
    }
}

/// The keys that hold for one frame.
#[derive(Debug, Clone, Copy)]
struct Keys<'v> {
    file: &'v Map<String, Value>,
    own: &'v Map<String, Value>,
}

impl<'v> Keys<'v> {
    /// The frame's own value, or that of all frames.
    fn get(&self, key: &str) -> Option<&'v Value> {
        let is_there = |value: &&Value| !value.is_null();
        let own = self.own.get(key).filter(is_there);
        own.or_else(|| self.file.get(key).filter(is_there))
    }

    fn number(&self, key: &str) -> Result<Option<f64>, String> {
        let number = |value: &Value| {
            value.as_f64().ok_or_else(|| format!("with {key} = {value}, where a number is due"))
        };
        self.get(key).map(number).transpose()
    }

    fn station(&self, scene: ScenePicture, said: &mut Said) -> Result<Station, String> {
        if let Some(key) = REFUSED.iter().find(|key| self.get(key).is_some_and(is_on)) {
            return Err(format!(
                "with {key}, which changes its rays or its pose in a way that is not done here\nhint: remove the key to \
                 have them without it"
            ));
        }
        said.unread.extend(self.own.keys().filter(|key| !is_known(key)).cloned());
        let both = |key: &&&str| {
            self.own.get(**key).zip(self.file.get(**key)).is_some_and(|(own, all)| own != all)
        };
        if let Some(key) = READ.iter().find(both) {
            said.contradictions.insert(format!("{key} of frames is taken, not that of the file"));
        }
        let settings = match self.camera(scene, said)? {
            Some(camera) => camera.settings().map_err(|why| format!("with {why}"))?,
            None => Vec::new(),
        };
        let pose = PoseSpec::Matrix {
            matrix: self.matrix()?,
            maps: Maps::WorldFromCamera,
            convention: Convention::Opengl,
        };
        Ok(Station { pose, time: self.number("time")?, settings })
    }

    /// `transform_matrix`, of four rows or of three.
    fn matrix(&self) -> Result<[[f64; 4]; 4], String> {
        let fault = || "without a transform_matrix of four rows of four numbers".to_owned();
        let rows = self.own.get("transform_matrix").and_then(Value::as_array).ok_or_else(fault)?;
        if !(3..=4).contains(&rows.len()) {
            return Err(fault());
        }
        let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
        for (row, numbers) in matrix.iter_mut().zip(rows) {
            let numbers = numbers.as_array().filter(|numbers| numbers.len() == 4);
            for (number, value) in row.iter_mut().zip(numbers.ok_or_else(fault)?) {
                *number = value.as_f64().ok_or_else(fault)?;
            }
        }
        Ok(matrix)
    }

    /// The intrinsics; `None` where there are none.
    fn camera(&self, scene: ScenePicture, said: &mut Said) -> Result<Option<FileCamera>, String> {
        let resolution = self.resolution()?;
        let sides = resolution.unwrap_or(scene.resolution).map(f64::from);
        let [x, y] =
            [self.focal(['x', 'w'], sides[0], said)?, self.focal(['y', 'h'], sides[1], said)?];
        let Some(fx) = x.or(y) else {
            if let Some(key) = OF_LENS.iter().find(|key| self.get(key).is_some_and(is_on)) {
                return Err(format!(
                    "with {key} and without a focal length\nhint: give fl_x (pixels) or camera_angle_x (radians)"
                ));
            }
            said.lacks_focal = true;
            said.unread.extend(
                ["w", "h"].into_iter().filter(|key| self.get(key).is_some()).map(str::to_owned),
            );
            return Ok(None);
        };
        let is_in_pixels = ["fl_x", "fl_y", "cx", "cy"].iter().any(|key| self.get(key).is_some());
        if resolution.is_none() && is_in_pixels && !scene.is_given {
            return Err("with a focal length or a principal point in pixels and without its size\nhint: give w and h, or \
                        camera.sensor.resolution in the scene"
                .to_owned());
        }
        // In the middle of the picture unless it is given.
        let centre = [self.number("cx")?, self.number("cy")?];
        Ok(Some(FileCamera {
            focal: [fx, y.unwrap_or(fx)],
            centre: [centre[0].unwrap_or(0.5 * sides[0]), centre[1].unwrap_or(0.5 * sides[1])],
            resolution,
            distortion: self.distortion()?,
        }))
    }

    /// `w` and `h`, which some tools write as 1080.0.
    fn resolution(&self) -> Result<Option<[u32; 2]>, String> {
        let side = |key: &str| match self.number(key)? {
            None => Ok(None),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            Some(side) if side.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&side) => {
                Ok(Some(side as u32))
            }
            Some(side) => Err(format!("with {key} = {side}, where a count of pixels is due")),
        };
        match [side("w")?, side("h")?] {
            [Some(w), Some(h)] => Ok(Some([w, h])),
            [None, None] => Ok(None),
            [Some(_), None] => Err("with w and without h\nhint: give both".to_owned()),
            [None, Some(_)] => Err("with h and without w\nhint: give both".to_owned()),
        }
    }

    /// The focal length along an axis of so many pixels, by the first of its keys: in pixels, by an angle in
    /// radians, by one in degrees.
    fn focal(
        &self,
        [axis, side]: [char; 2],
        pixels: f64,
        said: &mut Said,
    ) -> Result<Option<f64>, String> {
        let by_angle = |key: &str, unit: f64| match self.number(key)? {
            None => Ok(None),
            Some(angle) if angle * unit > 0.0 && angle * unit < std::f64::consts::PI => {
                Ok(Some(0.5 * pixels / (0.5 * angle * unit).tan()))
            }
            Some(angle) => {
                Err(format!("with {key} = {angle}; an angle between 0 and half a turn is due"))
            }
        };
        let names = [format!("fl_{axis}"), format!("camera_angle_{axis}"), format!("{axis}_fov")];
        let of = [
            self.number(&names[0])?,
            by_angle(&names[1], 1.0)?,
            by_angle(&names[2], std::f64::consts::PI / 180.0)?,
        ];
        let Some(first) = of.iter().position(Option::is_some) else { return Ok(None) };
        for (name, other) in names.iter().zip(of).skip(first + 1) {
            let (Some(taken), Some(other)) = (of[first], other) else { continue };
            if (taken / other - 1.0).abs() > SAME_FOCAL {
                said.contradictions.insert(format!(
                    "{} is taken, a focal length of {taken} px; {name} and {side} make {other} px",
                    names[first]
                ));
            }
        }
        Ok(of[first])
    }

    /// Distortion by the name of the camera model; none where all terms are zero.
    fn distortion(&self) -> Result<Option<Value>, String> {
        let is_ngp_fisheye = self.get("is_fisheye").is_some_and(is_on);
        let model = match self.get("camera_model") {
            None if is_ngp_fisheye => "OPENCV_FISHEYE",
            None => "OPENCV",
            Some(model) => {
                model.as_str().ok_or_else(|| format!("with the camera model {model}"))?
            }
        };
        match model {
            "OPENCV" | "RADIAL" | "SIMPLE_RADIAL" | "PINHOLE" | "SIMPLE_PINHOLE" => {
                // Its k4 is of r⁸ in nerfstudio, and of the denominator in OpenCV.
                if self.term("k4")? != 0.0 {
                    return Err("with k4 and without a fisheye's model; nerfstudio takes it for a term of r⁸, which \
                                OpenCV's model lacks: set it to 0"
                        .to_owned());
                }
                let terms = self.terms(&["k1", "k2", "p1", "p2", "k3"])?;
                let is_straight = terms.iter().all(|(_, k)| *k == 0.0);
                Ok((!is_straight).then(|| distortion("brown_conrady", terms)))
            }
            "OPENCV_FISHEYE" => {
                if let Some(key) = ["p1", "p2"].into_iter().find(|key| self.term(key) != Ok(0.0)) {
                    return Err(format!(
                        "with {key}, which OpenCV's fisheye model lacks: set it to 0"
                    ));
                }
                Ok(Some(distortion("fisheye", self.terms(&["k1", "k2", "k3", "k4"])?)))
            }
            other => Err(format!(
                "with the camera model \"{other}\"\nhint: known: OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE, \
                 RADIAL, SIMPLE_RADIAL"
            )),
        }
    }

    fn terms<'k>(&self, keys: &[&'k str]) -> Result<Vec<(&'k str, f64)>, String> {
        keys.iter().map(|key| Ok((*key, self.term(key)?))).collect()
    }

    /// A coefficient by its key, or by its place in `distortion_params`, nerfstudio's k1 k2 k3 k4 p1 p2.
    fn term(&self, key: &str) -> Result<f64, String> {
        let Some(list) = self.get("distortion_params") else {
            return Ok(self.number(key)?.unwrap_or(0.0));
        };
        let at = ["k1", "k2", "k3", "k4", "p1", "p2"].iter().position(|name| *name == key);
        let list = list.as_array().filter(|list| list.len() == 6);
        let value = at.and_then(|at| list?[at].as_f64());
        value.ok_or_else(|| "with distortion_params that are not six numbers".to_owned())
    }
}

/// True if a value says something: neither false, nor zero, nor empty.
fn is_on(value: &Value) -> bool {
    match value {
        Value::Null => false,
        Value::Bool(is_on) => *is_on,
        Value::Number(number) => number.as_f64() != Some(0.0),
        Value::String(text) => !text.is_empty(),
        Value::Array(list) => list.iter().any(is_on),
        Value::Object(members) => !members.is_empty(),
    }
}

/// A pinhole camera that a trajectory's file describes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FileCamera {
    /// Focal lengths along rows and columns (pixels).
    pub(super) focal: [f64; 2],
    /// The principal point (pixels from the corner of the top left one).
    pub(super) centre: [f64; 2],
    /// Columns and rows; the scene's own when absent.
    pub(super) resolution: Option<[u32; 2]>,
    /// Distortion in the words of a scene.
    pub(super) distortion: Option<Value>,
}

impl FileCamera {
    /// Settings of a scene that make its camera this one.
    ///
    /// # Errors
    ///
    /// When a focal length or a side is not above 0; the sentence goes on after what has them.
    pub(super) fn settings(&self) -> Result<Vec<(String, Value)>, String> {
        let [fx, fy] = self.focal;
        if !self.focal.iter().all(|focal| *focal > 0.0 && focal.is_finite()) {
            return Err(format!("the focal lengths {fx} and {fy} px; both must be above 0"));
        }
        if let Some([width, height]) = self.resolution.filter(|sides| sides.contains(&0)) {
            return Err(format!("{width} x {height} pixels; both must be at least 1"));
        }
        let [cx, cy] = self.centre;
        let k = json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "pixel_origin": "corner"});
        let mut settings = vec![("camera.type".to_owned(), json!("pinhole"))];
        let resolution = self.resolution.map(|sides| json!(sides));
        settings.extend(resolution.map(|sides| ("camera.sensor.resolution".to_owned(), sides)));
        settings.push(("camera.intrinsics".to_owned(), k));
        let distortion = self.distortion.clone();
        settings.extend(distortion.map(|distortion| ("camera.distortion".to_owned(), distortion)));
        Ok(settings)
    }
}

/// Distortion in the words of a scene: `kind`, and coefficients by their names.
pub(super) fn distortion<'a>(
    kind: &str,
    coefficients: impl IntoIterator<Item = (&'a str, f64)>,
) -> Value {
    let mut distortion = json!({ "type": kind });
    coefficients.into_iter().for_each(|(key, k)| distortion[key] = json!(k));
    distortion
}
