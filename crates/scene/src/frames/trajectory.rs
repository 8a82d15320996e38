//! Trajectories: poses of a file, with the intrinsics that it brings along.
//!
//! Trajectories of a pose a line: those of the TUM RGB-D benchmark, `timestamp tx ty tz qx qy qz qw` (Sturm et al.,
//! "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012), and those of KITTI's odometry benchmark, the twelve
//! numbers of `[R | t]` by rows (Geiger et al., "Are we ready for Autonomous Driving?", 2012). Lines of `#` are comments.

use std::path::{Path, PathBuf};

use super::colmap::{self, numbers};
use super::frame::{PoseAxes, Station};
use super::transforms::{self, ScenePicture};
use crate::error::not_found;
use crate::file::TrajectoryFormat;
use crate::import::{Note, NoteKind};
use etendue_camera::PoseSpec;
use etendue_files::InputFolder;

/// The longest trajectory that is read (bytes).
const LONGEST: u64 = 1 << 30;

/// A file of poses, and how the scene wants it read.
#[derive(Debug)]
pub(super) struct TrajectorySource<'a> {
    /// The folder of the scene.
    pub(super) folder: &'a InputFolder,
    /// The file, as the scene writes it.
    pub(super) file: &'a str,
    /// Format of the file; told by its name when absent.
    pub(super) format: Option<TrajectoryFormat>,
    /// Axes of the poses in formats that do not say it themselves.
    pub(super) axes: PoseAxes,
    /// The scene's own pixels.
    pub(super) picture: ScenePicture,
}

impl TrajectorySource<'_> {
    /// The poses, and what a user should know of the file. The error goes on after the file's name.
    pub(super) fn read(&self, path: &Path) -> Result<(Vec<Station>, Vec<Note>), String> {
        let mut notes = Vec::new();
        let mut note = |kind, message| {
            notes.push(Note { kind, subject: self.file.to_owned(), message, count: 1 });
        };
        let format = match self.format {
            Some(format) => format,
            None => told_by_name(path)?,
        };
        let stations = match format {
            TrajectoryFormat::Npy => read_npy(&bytes(path)?, self.axes)?,
            TrajectoryFormat::Tum => {
                let text = text(path)?;
                // Files of both are called .txt.
                match self.format.is_none() && are_kittis(&text) {
                    true => read_kitti(&text, self.axes)?,
                    false => read_tum(&text, self.axes)?,
                }
            }
            TrajectoryFormat::Kitti => read_kitti(&text(path)?, self.axes)?,
            TrajectoryFormat::Colmap => {
                let is_binary = path.extension().is_some_and(|ending| ending == "bin");
                let images = match is_binary {
                    true => colmap::binary_images(&bytes(path)?)?,
                    false => colmap::text_images(&text(path)?)?,
                };
                let name = if is_binary { "cameras.bin" } else { "cameras.txt" };
                let cameras = self.sibling(path, name)?.map(|path| match is_binary {
                    true => colmap::binary_cameras(&bytes(&path)?),
                    false => colmap::text_cameras(&text(&path)?),
                });
                let cameras = cameras
                    .transpose()
                    .map_err(|why| format!("stands beside a {name} that {why}"))?;
                if cameras.is_none() {
                    let why = format!(
                        "no {name} stands beside it: the intrinsics are those of the scene's camera"
                    );
                    note(NoteKind::Assumed, why);
                }
                colmap::stations(images, cameras.as_ref())?
            }
            TrajectoryFormat::Nerfstudio => {
                let (stations, found) = transforms::read(&text(path)?, self.picture)?;
                found.into_iter().for_each(|(kind, message)| note(kind, message));
                stations
            }
        };
        Ok((stations, notes))
    }

    /// The file called `name` beside `path`, if there is one. It, too, lies in the scene's folder.
    fn sibling(&self, path: &Path, name: &str) -> Result<Option<PathBuf>, String> {
        if path.with_file_name(name).symlink_metadata().is_err() {
            return Ok(None);
        }
        let written = Path::new(self.file).with_file_name(name);
        let found = self.folder.find(&written.to_string_lossy());
        let path = found.map(|found| Some(found.path));
        path.map_err(|error| format!("stands beside {}", not_found(error)))
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    etendue_files::read(path, LONGEST).map_err(|error| format!("cannot be read: {error}"))
}

fn text(path: &Path) -> Result<String, String> {
    String::from_utf8(bytes(path)?).map_err(|_| "is not UTF-8 text".to_owned())
}

fn told_by_name(path: &Path) -> Result<TrajectoryFormat, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match name.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "npy" => Ok(TrajectoryFormat::Npy),
        "json" => Ok(TrajectoryFormat::Nerfstudio),
        _ if name == "images.txt" || name == "images.bin" => Ok(TrajectoryFormat::Colmap),
        "txt" | "tum" => Ok(TrajectoryFormat::Tum),
        "kitti" => Ok(TrajectoryFormat::Kitti),
        _ => Err(
            "does not tell its format by its name\nhint: set `format` to npy, tum, kitti, colmap or nerfstudio"
                .to_owned(),
        ),
    }
}

fn read_npy(bytes: &[u8], axes: PoseAxes) -> Result<Vec<Station>, String> {
    let array = etendue_image::npy::read(bytes, |shape| match shape {
        [_, 3 | 4, 4] => Ok(()),
        other => Err(format!("has the shape {other:?} instead of n × 4 × 4 or n × 3 × 4")),
    })?;
    let rows = array.shape[1];
    Ok(array.numbers.chunks_exact(4 * rows).map(|pose| Station::of_rows(pose, axes)).collect())
}

/// Words of a line of KITTI's.
const KITTI_WORDS: usize = 12;

/// The lines that say something, with their numbers from 1, in words.
fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let words = |line| str::split(line, [' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
    let lines = (1..).zip(text.lines()).map(move |(number, line)| (number, words(line)));
    lines.filter(|(_, words): &(_, Vec<&str>)| !words.first().is_none_or(|w| w.starts_with('#')))
}

/// True if the first line that says something has as many words as KITTI's.
pub(super) fn are_kittis(text: &str) -> bool {
    lines(text).next().is_some_and(|(_, words)| words.len() == KITTI_WORDS)
}

pub(super) fn read_tum(text: &str, axes: PoseAxes) -> Result<Vec<Station>, String> {
    let mut stations = Vec::new();
    for (number, words) in lines(text) {
        if words.len() != 8 {
            let count = words.len();
            return Err(format!(
                "has {count} words in line {number}; TUM's are timestamp tx ty tz qx qy qz qw, and KITTI's, \
                 with `format` kitti, the 12 numbers of [R | t] by rows"
            ));
        }
        let [time, x, y, z, a, b, c, d] = numbers(&words, number)?;
        if let Some(before) = stations.last().and_then(|last: &Station| last.time)
            && time < before
        {
            return Err(format!(
                "has the time {time} in line {number}, after {before}: sort the lines by their times"
            ));
        }
        let pose = PoseSpec::Quaternion {
            quaternion: [a, b, c, d],
            translation: [x, y, z],
            maps: axes.maps,
            convention: axes.convention,
        };
        stations.push(Station { time: Some(time), ..Station::new(pose) });
    }
    Ok(stations)
}

pub(super) fn read_kitti(text: &str, axes: PoseAxes) -> Result<Vec<Station>, String> {
    let station = |(number, words): (usize, Vec<&str>)| {
        if words.len() != KITTI_WORDS {
            let count = words.len();
            return Err(format!(
                "has {count} words in line {number}; KITTI's are the 12 numbers of [R | t] by rows"
            ));
        }
        let all: [f64; KITTI_WORDS] = numbers(&words, number)?;
        Ok(Station::of_rows(&all, axes))
    };
    lines(text).map(station).collect()
}
