//! The frames of a scene as data sets that others read: nerfstudio's `transforms.json`, COLMAP's text
//! model, and a plain `index.json`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use etendue_camera::{
    CameraFile, Convention, PixelOrigin, ProjectionName, Readout, ShutterKind, TruthAt,
};
use etendue_files::{MANIFEST, SOFTWARE, Transaction};
use etendue_geometry::glam::{DMat3, DQuat};
use etendue_render::annotations::{self, BOP_DEPTH, COCO, INSTANCES, Models, Shot, Source};
use etendue_render::denoise::DENOISED;
use etendue_render::output::conventions::{KITTI_DEPTH, TUM_DEPTH};
use etendue_render::output::{Outputs, sidecar};
use etendue_scene::file::SamplesSpec;
use etendue_scene::{Frame, RigCamera, Scene};
use etendue_tracer::LayerSpec;
use serde_json::{Map, Value, json};

use crate::records::INDEX;
use crate::{Error, FramePattern, rendering};

/// File that nerfstudio reads.
const TRANSFORMS: &str = "transforms.json";

/// COLMAP's text model: its folder and files.
const COLMAP_FOLDER: &str = "colmap";
const COLMAP: [&str; 3] = ["cameras.txt", "images.txt", "points3D.txt"];

/// The frames of a scene, as they are added.
#[derive(Debug, Clone, Default)]
pub struct Dataset {
    entries: Vec<DatasetFrame>,
    outputs: Option<Outputs>,
    /// Of BOP's set.
    models: Models,
}

/// One frame.
#[derive(Debug, Clone)]
struct DatasetFrame {
    number: usize,
    rig: Option<RigCamera>,
    time: Option<f64>,
    folder: Option<String>,
    /// Name of the frame where it has no picture.
    name: String,
    camera: CameraFile,
    world_from_camera: [[f64; 4]; 4],
    picture: Option<String>,
    depth: Option<String>,
    /// The files of each layer, by their ending.
    files: BTreeMap<String, BTreeMap<String, String>>,
    scene_hash: String,
    seed: u64,
    samples: SamplesSpec,
    /// File that annotates the frame, and its depth as BOP has it.
    annotations: [String; 2],
}

impl Dataset {
    /// Adds a frame, whose files are named by `pattern`.
    ///
    /// # Errors
    ///
    /// When a file of the scene has gone.
    pub fn add(
        &mut self,
        frame: &Frame,
        scene: &Scene,
        pattern: &FramePattern,
        outputs: Outputs,
    ) -> Result<(), Error> {
        let files = layer_files(scene, pattern, frame.number, outputs);
        let of = |layer: &str, kind: &str| Some(files.get(layer)?.get(kind)?.clone());
        let clock = scene.render.time.is_some() || scene.render.rate.is_some();
        let matrix = scene.camera.pose().world_from_camera(Convention::Opengl);
        let at = self.entries.partition_point(|entry| entry.number < frame.number);
        self.outputs = Some(outputs);
        if outputs.bop {
            self.models.add(scene);
        }
        self.entries.insert(
            at,
            DatasetFrame {
                number: frame.number,
                rig: frame.rig.clone(),
                time: frame.time.or(clock.then(|| scene.render.time())),
                folder: pattern.own_folder(frame.number),
                name: pattern.place(frame.number, "picture"),
                camera: scene.camera.opencv(),
                world_from_camera: matrix.transpose().to_cols_array_2d(),
                picture: of("picture", "png"),
                depth: of(&LayerSpec::Depth.row().name, "npy"),
                files,
                scene_hash: scene.hash()?.to_string(),
                seed: scene.render.seed,
                samples: scene.render.samples,
                annotations: [INSTANCES, BOP_DEPTH].map(|name| pattern.place(frame.number, name)),
            },
        );
        Ok(())
    }

    /// The names of the files that it may write, as seen from its folder.
    pub fn file_names() -> impl Iterator<Item = String> {
        let colmap = COLMAP.map(|name| format!("{COLMAP_FOLDER}/{name}"));
        [INDEX, TRANSFORMS, COCO, MANIFEST].map(str::to_owned).into_iter().chain(colmap)
    }

    /// Writes `index.json`, and where every camera has a K, `transforms.json` and the folder `colmap`.
    /// Gives the files.
    ///
    /// # Errors
    ///
    /// When a file cannot be written.
    pub fn write(&self, to: &Transaction, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let mut files = vec![folder.join(INDEX)];
        sidecar::write_json(to, &files[0], &self.index(folder))?;
        files.extend(self.write_annotations(to, folder)?);
        if self.entries.is_empty() || !self.entries.iter().all(DatasetFrame::has_k) {
            return Ok(files);
        }
        let transforms = folder.join(TRANSFORMS);
        sidecar::write_json(to, &transforms, &self.transforms())?;
        files.push(transforms);
        crate::places::folder(&folder.join(COLMAP_FOLDER))?;
        for (name, text) in self.colmap() {
            let path = folder.join(COLMAP_FOLDER).join(name);
            to.write(&path, |file| file.write_all(text.as_bytes()))?;
            files.push(path);
        }
        Ok(files)
    }

    /// The sets of annotated pictures that are wanted.
    fn write_annotations(&self, to: &Transaction, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let Some(outputs) = self.outputs.filter(|outputs| outputs.annotates()) else {
            return Ok(Vec::new());
        };
        let shot = |entry: &DatasetFrame| {
            let [annotated, depth] = entry.annotations.each_ref().map(|name| folder.join(name));
            let file_name = entry.picture.clone().unwrap_or_default();
            Ok(Shot {
                number: entry.number,
                annotated: rendering::read_annotated(&annotated)?,
                picture: Source::File(folder.join(&file_name)),
                depth: Source::File(depth),
                file_name,
            })
        };
        let shots = self.entries.iter().map(shot).collect::<Result<Vec<_>, Error>>()?;
        Ok(annotations::write_sets(&shots, &self.models, to, folder, outputs)?)
    }

    /// Notes for the user on what the formats of others have no place for.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let why = self.timing().err();
        let note = |why| {
            format!(
                "{TRANSFORMS}: the format has exposures in the middle of which the poses are and rows that are read from \
                 the top, the same for all frames, and {why}: it has no `exposure_time`, `rolling_shutter_time` and \
                 velocities, which stand in {INDEX} and in each camera.json"
            )
        };
        why.map(note).into_iter().filter(|_| self.entries.iter().all(DatasetFrame::has_k)).collect()
    }

    /// Timing of all frames' exposures, as `transforms.json` for moving cameras has it (Seiskari et al., "Gaussian
    /// Splatting on the Move", 2024): a row y of h is taken (y / h - 1/2) times the readout after the frame's pose.
    /// `None` where no camera moves, and why not where the format has no place for it.
    fn timing(&self) -> Result<Option<Timing>, &'static str> {
        if self.entries.iter().all(|entry| entry.velocities().is_none()) {
            return Ok(None);
        }
        let of = |entry: &DatasetFrame| {
            let Some(shutter) = &entry.camera.shutter else {
                return Err("some frames have no shutter");
            };
            let readout = f64::from(entry.camera.resolution[1]) * shutter.line_time_s;
            let is_rolling = shutter.kind != ShutterKind::Global && readout > 0.0;
            match (shutter.kind, shutter.truth_at, shutter.readout) {
                (ShutterKind::GlobalReset, ..) if is_rolling => {
                    Err("rows of a global reset are open for different times")
                }
                (_, TruthAt::Open | TruthAt::Close, _) if shutter.exposure_s > 0.0 => {
                    Err("`camera.shutter.truth_at` is not in the middle")
                }
                (_, _, Readout::Up) if is_rolling => Err("rows are read from the bottom"),
                _ => Ok(Timing { exposure: shutter.exposure_s, readout }),
            }
        };
        let mut timings = self.entries.iter().map(of);
        let first = timings.next().transpose()?;
        for timing in timings {
            if Some(timing?) != first {
                return Err("frames are exposed for different times");
            }
        }
        Ok(first)
    }

    /// Of the files of `folder`. A mask whose numbers are too large for its format was not written.
    fn index(&self, folder: &Path) -> Value {
        let frame = |entry: &DatasetFrame| {
            let mut layers = entry.files.clone();
            layers
                .values_mut()
                .for_each(|files| files.retain(|_, file| folder.join(file).exists()));
            let mut frame = json!({
                "frame": entry.number, "time_s": entry.time, "folder": entry.folder,
                "files": layers,
                "K": entry.camera.k, "pixel_origin": entry.camera.pixel_origin,
                "distortion": entry.camera.distortion, "resolution": entry.camera.resolution,
                "camera_from_world": entry.camera.camera_from_world, "convention": "opencv",
                "seed": entry.seed, "samples": entry.samples, "scene_hash": entry.scene_hash,
            });
            if let Some((first, last, order)) = entry.readout() {
                frame["viewmat"] = json!(first);
                frame["viewmat_rs"] = json!(last);
                frame["rolling_shutter"] = json!(order);
            }
            if let Some(RigCamera { moment, camera, name, .. }) = &entry.rig {
                frame["moment"] = json!(moment);
                frame["rig_camera"] = json!({ "number": camera, "name": name });
            }
            frame
        };
        json!({
            "software": SOFTWARE,
            "about": "frames of one scene; matrices by rows, metres, OpenCV's axes (x right, y down, z \
                      forward)",
            "depth_factors": { "tum.png": TUM_DEPTH, "kitti.png": KITTI_DEPTH },
            "frames": self.entries.iter().map(frame).collect::<Vec<_>>(),
        })
    }

    fn transforms(&self) -> Value {
        let timing = self.timing().ok().flatten();
        let frame = |entry: &DatasetFrame| {
            let mut frame = Map::new();
            let name = entry.picture.clone().unwrap_or_else(|| entry.name.clone());
            frame.insert("file_path".to_owned(), json!(name));
            frame.insert("transform_matrix".to_owned(), json!(entry.world_from_camera));
            if let Some(depth) = &entry.depth {
                frame.insert("depth_file_path".to_owned(), json!(depth));
            }
            if let Some(time) = entry.time {
                frame.insert("time".to_owned(), json!(time));
            }
            if let (Some(_), Some([linear, angular])) = (timing, entry.velocities()) {
                frame.insert("camera_linear_velocity".to_owned(), json!(linear));
                frame.insert("camera_angular_velocity".to_owned(), json!(angular));
            }
            let PixelIntrinsics { focal: [fx, fy], centre: [cx, cy], distortion, is_fisheye } =
                entry.intrinsics();
            let [w, h] = entry.camera.resolution;
            let model = if is_fisheye { "OPENCV_FISHEYE" } else { "OPENCV" };
            frame.insert("camera_model".to_owned(), json!(model));
            for (key, value) in [("fl_x", fx), ("fl_y", fy), ("cx", cx), ("cy", cy)] {
                frame.insert(key.to_owned(), json!(value));
            }
            frame.insert("w".to_owned(), json!(w));
            frame.insert("h".to_owned(), json!(h));
            // OpenCV's order.
            let keys = if is_fisheye { ["k1", "k2", "k3", "k4"] } else { ["k1", "k2", "p1", "p2"] };
            for (key, value) in keys.iter().zip(&distortion) {
                frame.insert((*key).to_owned(), json!(value));
            }
            if !is_fisheye && let Some(k3) = distortion.get(4) {
                frame.insert("k3".to_owned(), json!(k3));
            }
            Value::Object(frame)
        };
        let frames: Vec<Value> = self.entries.iter().map(frame).collect();
        let mut all = Map::new();
        // Readers of this format look for one model of all cameras here, and take others for perspective.
        let models = || frames.iter().filter_map(|frame| frame.get("camera_model"));
        if let Some(model) = models().next().filter(|model| models().all(|other| other == *model)) {
            all.insert("camera_model".to_owned(), model.clone());
        }
        if let Some(Timing { exposure, readout }) = timing {
            all.insert("exposure_time".to_owned(), json!(exposure));
            all.insert("rolling_shutter_time".to_owned(), json!(readout));
        }
        all.insert("frames".to_owned(), Value::Array(frames));
        Value::Object(all)
    }

    /// The files of COLMAP's text model: cameras, images, and no points.
    fn colmap(&self) -> [(&'static str, String); 3] {
        let mut cameras: Vec<String> = Vec::new();
        let mut images = String::from("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n");
        if self.entries.iter().any(|entry| entry.velocities().is_some()) {
            // Writing to a string cannot fail.
            let _ = writeln!(
                images,
                "# Cameras move while their shutters are open, of which this format knows nothing: poses are those of the \
                 middle row; {INDEX} has more."
            );
        }
        for (number, entry) in (1..).zip(&self.entries) {
            let camera = entry.colmap_camera();
            let id = cameras.iter().position(|known| *known == camera).unwrap_or_else(|| {
                cameras.push(camera);
                cameras.len() - 1
            });
            let m = &entry.camera.camera_from_world;
            let column = |k: usize| [m[0][k], m[1][k], m[2][k]].into();
            let rotation = DMat3::from_cols(column(0), column(1), column(2));
            let q = DQuat::from_mat3(&rotation);
            let name = entry.picture.as_ref().unwrap_or(&entry.name);
            // Writing to a string cannot fail.
            let _ = writeln!(
                images,
                "{number} {} {} {} {} {} {} {} {} {name}\n",
                q.w,
                q.x,
                q.y,
                q.z,
                m[0][3],
                m[1][3],
                m[2][3],
                id + 1
            );
        }
        let mut lines = String::from("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
        for (id, camera) in (1..).zip(&cameras) {
            let _ = writeln!(lines, "{id} {camera}");
        }
        let points = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n".to_owned();
        let [a, b, c] = COLMAP;
        [(a, lines), (b, images), (c, points)]
    }
}

/// The files of each layer by their ending, as seen from the data set's folder.
fn layer_files(
    scene: &Scene,
    pattern: &FramePattern,
    number: usize,
    outputs: Outputs,
) -> BTreeMap<String, BTreeMap<String, String>> {
    let names = scene.layers.iter().flat_map(|layer| match Some(*layer) == scene.picture {
        true => vec![String::new()],
        false => layer.row().names_in_files(),
    });
    let names = names.chain(outputs.denoised.then(|| DENOISED.to_owned()));
    let endings = |name: String| {
        let files = rendering::layer_files(&name, outputs).into_iter().filter_map(|file| {
            let ending = file.split_once('.')?.1.to_owned();
            Some((ending, pattern.place(number, &file)))
        });
        let title = if name.is_empty() { "picture".to_owned() } else { name };
        (title, files.collect())
    };
    names.map(endings).collect()
}

/// By rows.
type Matrix = [[f64; 4]; 4];

/// Timing of a picture's exposure (s).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Timing {
    exposure: f64,
    /// From the first row to behind the last.
    readout: f64,
}

/// Pixels from the corner of the top left one.
struct PixelIntrinsics {
    focal: [f64; 2],
    centre: [f64; 2],
    /// In OpenCV's order.
    distortion: Vec<f64>,
    is_fisheye: bool,
}

impl DatasetFrame {
    fn has_k(&self) -> bool {
        self.camera.k.is_some()
    }

    /// The poses (world to camera, OpenCV's axes) of the row that is read out first and of that which is read out last,
    /// and their order as gsplat calls it, which goes from one to the other with the rows; `None` where all rows have
    /// one pose.
    fn readout(&self) -> Option<(Matrix, Matrix, &'static str)> {
        let shutter = self.camera.shutter.as_ref()?;
        let rows = &shutter.camera_from_world_of_rows;
        let [top, bottom] = [*rows.first()?, *rows.last()?];
        Some(match shutter.readout {
            Readout::Down => (top, bottom, "ROLLING_TOP_TO_BOTTOM"),
            Readout::Up => (bottom, top, "ROLLING_BOTTOM_TO_TOP"),
        })
    }

    /// The velocity (m/s) and the angular velocity (rad/s) along OpenGL's axes of the camera, where it moves.
    fn velocities(&self) -> Option<[[f64; 3]; 2]> {
        let velocity = self.camera.shutter.as_ref()?.velocity?;
        let gl = |[x, y, z]: [f64; 3]| [x, 0.0 - y, 0.0 - z];
        Some([gl(velocity.linear_m_s), gl(velocity.angular_rad_s)])
    }

    fn intrinsics(&self) -> PixelIntrinsics {
        let k = self.camera.k.unwrap_or_default();
        let half = match self.camera.pixel_origin {
            PixelOrigin::Center => 0.5,
            PixelOrigin::Corner => 0.0,
        };
        let distortion = self.camera.distortion.as_ref();
        PixelIntrinsics {
            focal: [k[0][0], k[1][1]],
            centre: [k[0][2] + half, k[1][2] + half],
            distortion: distortion.map(|d| d.coefficients.clone()).unwrap_or_default(),
            is_fisheye: self.camera.projection == ProjectionName::Fisheye,
        }
    }

    /// The camera without its number.
    fn colmap_camera(&self) -> String {
        let PixelIntrinsics { focal, centre, distortion, is_fisheye } = self.intrinsics();
        let (model, count) = match (is_fisheye, distortion.len()) {
            (true, _) => ("OPENCV_FISHEYE", 4),
            (false, 0) => ("PINHOLE", 0),
            (false, 1..=4) => ("OPENCV", 4),
            (false, _) => ("FULL_OPENCV", 8),
        };
        let [width, height] = self.camera.resolution;
        let mut text = format!("{model} {width} {height}");
        let coefficients = (0..count).map(|i| distortion.get(i).copied().unwrap_or(0.0));
        for value in focal.into_iter().chain(centre).chain(coefficients) {
            let _ = write!(text, " {value}");
        }
        text
    }
}
