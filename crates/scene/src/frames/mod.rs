//! The frames of a scene: what is set for each of its pictures.

mod animation;
mod colmap;
mod intrinsics;
mod nerfstudio;
mod path;
mod tum;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use etendue_camera::{CameraSpec, Convention, Maps, Pose, PoseSpec};
use etendue_geometry::files;
use etendue_geometry::glam::DVec3;
use serde_json::Value;

use crate::file::{CameraPath, FramesSpec, SceneFile, TrajectoryFormat, join, join_index};
use crate::paths::Folder;
use crate::{Reach, Scene, SceneError, npy};

/// The longest trajectory that is read (bytes).
const LONGEST: u64 = 1 << 30;

/// The most frames of a scene. All are made before the first is shown, of a few kilobytes each.
const MOST_FRAMES: usize = 100_000;

/// One picture of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its number, from 0.
    pub number: usize,
    /// When it was taken (s), where the scene says.
    pub time: Option<f64>,
    /// What is set for it: paths of the scene and values.
    pub settings: Vec<(String, Value)>,
}

/// What paths of the camera start from.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The scene's own camera.
    pub pose: Pose,
    /// The middle of the scene's box (m).
    pub center: DVec3,
    /// The cameras of the models.
    pub cameras: Vec<CameraSpec>,
}

impl Start {
    /// Of a scene that is loaded.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self {
            pose: *scene.camera.pose(),
            center: scene.geometry.loose_bounds().centre(),
            cameras: scene.cameras.iter().map(|camera| camera.spec.clone()).collect(),
        }
    }
}

/// A pose of a trajectory, with what else its file says.
#[derive(Debug, Clone, PartialEq)]
struct Station {
    pose: PoseSpec,
    time: Option<f64>,
    /// More settings, such as intrinsics.
    settings: Vec<(String, Value)>,
}

impl Station {
    fn new(pose: PoseSpec) -> Self {
        Self { pose, time: None, settings: Vec::new() }
    }
}

impl SceneFile {
    /// The frames of the scene, in order; `None` when it has no `frames` and is one picture. `start` is
    /// asked for when a path of the camera begins where the camera stands.
    ///
    /// # Errors
    ///
    /// When a path of the scene cannot be set, a pose is no rotation, or a trajectory's file is missing or
    /// broken; the message names the frame.
    pub fn frames(
        &self,
        reach: Reach,
        start: impl FnOnce() -> Result<Start, SceneError>,
    ) -> Result<Option<Vec<Frame>>, SceneError> {
        let Some(spec) = &self.spec.frames else { return Ok(None) };
        let frames = match spec {
            FramesSpec::List(list) => {
                let frame = |(number, settings): (usize, &BTreeMap<String, Value>)| Frame {
                    number,
                    time: None,
                    settings: settings.iter().map(|(k, v)| (k.clone(), v.clone())).collect(),
                };
                list.iter().enumerate().map(frame).collect()
            }
            FramesSpec::Path(path) => self.along(path, reach, start)?,
        };
        if frames.len() > MOST_FRAMES {
            return Err(self.fault("frames", too_many(frames.len())));
        }
        if frames.is_empty() {
            return Err(
                self.fault("frames", "there is no frame; leave `frames` out for one picture")
            );
        }
        if let FramesSpec::List(_) = spec {
            // Known now, and not when it is that frame's turn; but for lenses, which take some milliseconds each.
            let folder = Folder::open(self.folder(), reach)?;
            for frame in &frames {
                let file = self.at(frame)?;
                if let Some(CameraSpec::Pinhole(_) | CameraSpec::Orthographic(_)) = file.spec.camera
                {
                    file.camera_alone(&folder)?;
                }
            }
        }
        Ok(Some(frames))
    }

    /// The scene with a frame's settings, and without `frames`: as if each stood in a file of its own.
    ///
    /// # Errors
    ///
    /// When the format does not know what they say; the message names the frame.
    pub fn at(&self, frame: &Frame) -> Result<Self, SceneError> {
        let settings: Vec<(String, String)> =
            frame.settings.iter().map(|(path, value)| (path.clone(), value.to_string())).collect();
        let in_frame = |error: SceneError| {
            let why = match error {
                // Its place is the frame, which is told here.
                SceneError::Invalid { path, reason, .. } => format!("{path}: {reason}"),
                other => other.to_string(),
            };
            self.fault(&join_index("frames", frame.number), why)
        };
        self.without_frames()?.of_frame(frame.number).with(&settings).map_err(in_frame)
    }

    fn along(
        &self,
        path: &CameraPath,
        reach: Reach,
        start: impl FnOnce() -> Result<Start, SceneError>,
    ) -> Result<Vec<Frame>, SceneError> {
        let fault = |(key, why): (&str, String)| self.fault(&join("frames", key), why);
        let stations = match path {
            CameraPath::Animation { .. } => return animation::frames(self, path).map_err(fault),
            CameraPath::Cameras {} => {
                return animation::cameras(self, &start()?.cameras).map_err(fault);
            }
            CameraPath::Poses { poses, times } => {
                if let Some(times) = times
                    && times.len() != poses.len()
                {
                    let why = format!("{} times for {} poses", times.len(), poses.len());
                    return Err(fault(("times", why)));
                }
                let time = |i: usize| times.as_ref().map(|times| times[i].0);
                let station = |(i, pose): (usize, &PoseSpec)| Station {
                    time: time(i),
                    ..Station::new(pose.clone())
                };
                poses.iter().enumerate().map(station).collect()
            }
            CameraPath::Trajectory { file, format, maps, convention } => {
                let folder = Folder::open(self.folder(), reach)?;
                let found = folder.find(file).map_err(|why| fault(("file", why)))?;
                let maps = maps.unwrap_or(Maps::WorldFromCamera);
                let convention = convention.unwrap_or(Convention::Opencv);
                read(&found.path, *format, (maps, convention))
                    .map_err(|why| fault(("file", format!("\"{file}\" {why}"))))?
            }
            CameraPath::Orbit { .. } | CameraPath::Dolly { .. } | CameraPath::Grid { .. } => {
                path::made(path, &start()?).map_err(fault)?
            }
        };
        if stations.len() > MOST_FRAMES {
            return Err(self.fault("frames", too_many(stations.len())));
        }
        let mut frames = Vec::with_capacity(stations.len());
        for (number, station) in stations.into_iter().enumerate() {
            // Told here, by its number, and not when it is that frame's turn.
            station.pose.build().map_err(|error| {
                let why = format!("pose {number}: {}: {}", error.at, error.why);
                fault(match path {
                    CameraPath::Trajectory { file, .. } => ("file", format!("\"{file}\": {why}")),
                    _ => ("poses", why),
                })
            })?;
            let mut settings = station.settings;
            // A pose is made of numbers and words only, which always serialise.
            let pose = serde_json::to_value(&station.pose).unwrap_or_default();
            settings.push(("camera.pose".to_owned(), pose));
            frames.push(Frame { number, time: station.time, settings });
        }
        Ok(frames)
    }
}

fn too_many(count: usize) -> String {
    format!("{count} frames; {MOST_FRAMES} are the most")
}

/// Reads a trajectory; the error goes on after the file's name.
fn read(
    path: &Path,
    format: Option<TrajectoryFormat>,
    (maps, convention): (Maps, Convention),
) -> Result<Vec<Station>, String> {
    let format = match format {
        Some(format) => format,
        None => told_by_name(path)?,
    };
    let bytes = |path: &PathBuf| {
        files::read(path, LONGEST).map_err(|error| format!("cannot be read: {error}"))
    };
    let path = path.to_owned();
    let text = |path: &PathBuf| {
        String::from_utf8(bytes(path)?).map_err(|_| "is not UTF-8 text".to_owned())
    };
    // Each format's own reader.
    match format {
        TrajectoryFormat::Npy => {
            let array = npy::read(&bytes(&path)?, |shape| match shape {
                [_, 3 | 4, 4] => Ok(()),
                other => Err(format!("has the shape {other:?} instead of n × 4 × 4 or n × 3 × 4")),
            })?;
            let rows = array.shape[1];
            let station = |numbers: &[f64]| {
                let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
                for (row, numbers) in matrix.iter_mut().zip(numbers.chunks_exact(4)) {
                    row.copy_from_slice(numbers);
                }
                Station::new(PoseSpec::Matrix { matrix, maps, convention })
            };
            Ok(array.numbers.chunks_exact(4 * rows).map(station).collect())
        }
        TrajectoryFormat::Tum => tum::read(&text(&path)?, (maps, convention)),
        TrajectoryFormat::Colmap => {
            let cameras = path.with_file_name("cameras.txt");
            let cameras = if cameras.exists() { Some(text(&cameras)?) } else { None };
            colmap::read(&text(&path)?, cameras.as_deref())
        }
        TrajectoryFormat::Nerfstudio => nerfstudio::read(&text(&path)?),
    }
}

fn told_by_name(path: &Path) -> Result<TrajectoryFormat, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match name.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "npy" => Ok(TrajectoryFormat::Npy),
        "json" => Ok(TrajectoryFormat::Nerfstudio),
        _ if name == "images.txt" => Ok(TrajectoryFormat::Colmap),
        "txt" | "tum" => Ok(TrajectoryFormat::Tum),
        _ => Err(
            "does not tell its format by its name; set `format` to npy, tum, colmap or nerfstudio"
                .to_owned(),
        ),
    }
}

/// Numbers of a line of text, all finite.
fn numbers<const N: usize>(words: &[&str], line: usize) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
            format!("has \"{word}\" in line {line}, where a finite number is due")
        })?;
    }
    Ok(numbers)
}
