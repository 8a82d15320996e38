//! Trajectories: poses of a file, with the intrinsics that it brings along.

use std::path::{Path, PathBuf};

use etendue_camera::{Convention, Maps};
use etendue_files::InputFolder;

use super::transforms::ScenePicture;
use super::{Station, colmap, lines, transforms};
use crate::error::not_found;
use crate::file::TrajectoryFormat;
use crate::import::{Note, NoteKind};
use crate::npy;

/// The longest trajectory that is read (bytes).
const LONGEST: u64 = 1 << 30;

/// A file of poses, and how the scene wants it read.
#[derive(Debug)]
pub(super) struct Trajectory<'a> {
    /// The folder of the scene.
    pub(super) folder: &'a InputFolder,
    /// The file, as the scene writes it.
    pub(super) file: &'a str,
    /// What it is; told by its name when absent.
    pub(super) format: Option<TrajectoryFormat>,
    /// How the poses of formats map that do not say it themselves.
    pub(super) axes: (Maps, Convention),
    /// The scene's own pixels.
    pub(super) picture: ScenePicture,
}

impl Trajectory<'_> {
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
                match self.format.is_none() && lines::are_kittis(&text) {
                    true => lines::read_kitti(&text, self.axes)?,
                    false => lines::read_tum(&text, self.axes)?,
                }
            }
            TrajectoryFormat::Kitti => lines::read_kitti(&text(path)?, self.axes)?,
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
            "does not tell its format by its name; set `format` to npy, tum, kitti, colmap or nerfstudio"
                .to_owned(),
        ),
    }
}

fn read_npy(bytes: &[u8], axes: (Maps, Convention)) -> Result<Vec<Station>, String> {
    let array = npy::read(bytes, |shape| match shape {
        [_, 3 | 4, 4] => Ok(()),
        other => Err(format!("has the shape {other:?} instead of n × 4 × 4 or n × 3 × 4")),
    })?;
    let rows = array.shape[1];
    Ok(array.numbers.chunks_exact(4 * rows).map(|pose| Station::of_rows(pose, axes)).collect())
}

/// Numbers of a line of text, all finite; 0 beyond its last.
pub(super) fn numbers<const N: usize>(words: &[&str], line: usize) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
            format!("has \"{word}\" in line {line}, where a finite number is due")
        })?;
    }
    Ok(numbers)
}
