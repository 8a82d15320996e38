//! The pictures by which a camera is calibrated, as its own simulation takes them: darks, flats, white images and a board.

mod boards;
mod options;
mod surroundings;

use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

use etendue_files::{Ledger, MANIFEST, SOFTWARE, Transaction};
use etendue_render::expose::{ExposeError, SensorLight};
use etendue_render::output::{HeaderEntry, Look, npy, png, sidecar};
use etendue_sensor::dng::{DngDetails, DngError, GainMap};
use etendue_sensor::{Exposure, InvalidValues, RawImage, Sensor, SensorError, SensorKind};
use serde::Serialize;
use serde_json::{Value, json};

use crate::progress::Phase;
use crate::{Channel, Error, Layer, Picture, Progress, Session, Values, WrittenFiles, places};
use boards::{Board, BoardPose};
use options::check;
use surroundings::WhiteSurroundings;

pub use options::CalibrationOptions;

/// Points of the gain map of a DNG, along columns and rows.
const SHADING: [u32; 2] = [17, 13];

/// `calibration.json`.
#[derive(Debug, Serialize)]
struct CalibrationFile {
    software: &'static str,
    version: u32,
    sensor: Value,
    resolution: [usize; 2],
    region: Option<[usize; 4]>,
    binning: usize,
    exposure_s: f64,
    level: f64,
    black_level_dn: f64,
    saturation_level_dn: f64,
    sets: Vec<FrameSet>,
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<Board>,
}

/// Frames of one kind.
#[derive(Debug, Serialize)]
struct FrameSet {
    kind: String,
    what: &'static str,
    files: Vec<String>,
    mean: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pose: Option<BoardPose>,
}

/// Takes the pictures by which the camera of the session's scene is calibrated, at its own settings, and writes them into
/// `folder`.
///
/// Darks are exposed in the dark. White images are the scene's camera before an even white surrounding; flats have the light of
/// the middle of that on every pixel, as without a lens. The board is a chessboard of matte black and white squares under the
/// same surrounding, in poses that go over the picture and are tilted to all sides; `calibration.json` says where its inner
/// corners are in the world and where in the picture.
///
/// # Errors
///
/// When the scene has no camera with a sensor that is more than a grid of pixels, an option is out of its range, the region or
/// the packing does not fit the chip, or something cannot be written.
pub fn calibrate(
    session: &mut Session,
    options: &CalibrationOptions,
    folder: &Path,
    progress: &Progress,
) -> Result<WrittenFiles, Error> {
    let start = Instant::now();
    check(options)?;
    let surroundings = WhiteSurroundings::of(session, progress)?;
    // One picture of white, of which darks and flats are made, too.
    let white = surroundings.take(Vec::new(), progress)?;
    let sensor = white.sensor().clone();
    let first = Exposure { exposure: 0.01, frame: 0 };
    let shot = Exposure { frame: 0, ..sensor.shots().next().unwrap_or(first) };
    let factor = surroundings.factor(&white, shot, options.level)?;
    let board = match options.boards {
        0 => None,
        count => {
            let board = Board::before(&surroundings.camera, options, count);
            Some(board.map_err(|why| surroundings.refused(&why))?)
        }
    };
    let mut set = CalibrationSet {
        sensor: &sensor,
        options,
        shot,
        shading: None,
        f_number: white.f_number().or(options.f_number),
        files: Vec::new(),
        notes: Vec::new(),
    };
    // What does not fit is told before anything is written.
    let resolution = set.fitting()?;
    places::folder(folder)?;
    let names = [MANIFEST.to_owned(), "calibration.json".to_owned()];
    places::keep_apart(&surroundings.inputs, &names.map(|name| folder.join(name)))?;
    let white = white.scaled(factor);
    let count = 3.0 + f64::from(options.boards);
    places::recorded(Ledger::open(folder, "calibrate"), &surroundings.inputs, |to| {
        let goes_on = |done: f64| match progress.goes_on(Phase::Expose, done / count) {
            true => Ok(()),
            false => Err(Error::from(ExposeError::Stopped)),
        };
        goes_on(0.0)?;
        let mut sets = set.of_light(to, folder, &white, &goes_on)?;
        for (number, pose) in board.iter().flat_map(|board| &board.poses).enumerate() {
            goes_on(3.0 + number as f64)?;
            let objects = board.iter().flat_map(|board| board.objects(pose)).collect();
            let light = surroundings.take(objects, progress)?.scaled(factor);
            let kind = format!("board_{number:03}");
            let mut frames = set.frames(to, folder, &kind, "a chessboard", &light)?;
            frames.pose = Some(pose.clone());
            sets.push(frames);
        }
        set.describe(to, folder, sets, board.clone(), resolution)
    })?;
    let CalibrationSet { files, mut notes, .. } = set;
    notes.dedup();
    notes.iter().for_each(|note| progress.note(note));
    Ok(WrittenFiles { files, notes, time: start.elapsed() })
}

fn in_words(error: SensorError) -> Error {
    match error.at() {
        "region" | "binning" | "packed" => {
            Error::Refused(format!("--{}: {}", error.at(), error.why()))
        }
        _ => ExposeError::from(error).into(),
    }
}

/// A set that is being taken.
struct CalibrationSet<'a> {
    sensor: &'a Sensor,
    options: &'a CalibrationOptions,
    shot: Exposure,
    shading: Option<GainMap>,
    f_number: Option<f64>,
    files: Vec<PathBuf>,
    notes: Vec<String>,
}

impl CalibrationSet<'_> {
    /// Columns and rows of what is read out.
    fn fitting(&self) -> Result<[usize; 2], Error> {
        let [width, height] = self.sensor.resolution().map(|side| side as usize);
        let depth = self.sensor.depth();
        let values = vec![0; width * height * depth];
        let blank = RawImage { width, height, depth, values, invalid: InvalidValues::default() };
        let seen = self.sensor.window(&blank, self.options.window).map_err(in_words)?;
        if let Some(packing) = self.options.packed {
            packing.pack(&seen).map_err(in_words)?;
            let [own, most] = [self.sensor.bit_depth(), packing.bits()];
            if own > most {
                return Err(Error::Refused(format!(
                    "--packed: the sensor has {own} bits, the format {most}\nhint: set camera.sensor.bit_depth"
                )));
            }
        }
        Ok([seen.width, seen.height])
    }

    /// Darks, flats and white images of white light.
    fn of_light(
        &mut self,
        to: &Transaction,
        folder: &Path,
        white: &SensorLight,
        goes_on: &dyn Fn(f64) -> Result<(), Error>,
    ) -> Result<Vec<FrameSet>, Error> {
        self.shading = self.shading_of(white)?;
        let flat = white.clone().even(self.sensor.resolution().map(|side| side as usize / 2));
        let dark = flat.clone().scaled(0.0);
        let kinds = [
            ("dark", "no light at all", &dark),
            ("flat", "the same light on every pixel, as without a lens", &flat),
            ("white", "an even white surrounding through the camera's own lens", white),
        ];
        let mut sets = Vec::new();
        for ((kind, what, light), done) in kinds.into_iter().zip([0.0, 1.0, 2.0]) {
            goes_on(done)?;
            sets.push(self.frames(to, folder, kind, what, light)?);
        }
        Ok(sets)
    }

    /// Writes `calibration.json`.
    fn describe(
        &mut self,
        to: &Transaction,
        folder: &Path,
        sets: Vec<FrameSet>,
        board: Option<Board>,
        resolution: [usize; 2],
    ) -> Result<(), Error> {
        let (sensor, options) = (self.sensor, self.options);
        let file = CalibrationFile {
            software: SOFTWARE,
            version: 1,
            sensor: json!(sensor.spec()),
            resolution,
            region: options.window.region,
            binning: options.window.binning,
            exposure_s: self.shot.exposure,
            level: options.level,
            black_level_dn: sensor.black_level(),
            saturation_level_dn: sensor.saturation_level(),
            sets,
            board: board.map(|mut board| {
                // Each stands with its own pictures.
                board.poses.clear();
                board
            }),
        };
        let path = folder.join("calibration.json");
        sidecar::write_json(to, &path, &file)?;
        self.files.push(path);
        Ok(())
    }

    /// The gain map of the lens, by the expected numbers of the white image; `None` of sensors whose numbers DNG has not.
    fn shading_of(&self, white: &SensorLight) -> Result<Option<GainMap>, Error> {
        if self.sensor.depth() != 1 || !self.options.outputs.dng {
            return Ok(None);
        }
        let silent = self.sensor.clone().with_noise(etendue_sensor::NoiseModel::None);
        let image = white.expose_on(&silent, self.shot).map_err(ExposeError::from)?;
        let image = self.sensor.window(&image, self.options.window).map_err(in_words)?;
        let black = self.sensor.black_level();
        let above: Vec<f64> =
            image.values.iter().map(|&y| (f64::from(y) - black).max(0.0)).collect();
        // Colours of a mosaic differ by more than the lens does: each is taken by its own mean.
        let even = self.by_own_means(&above, image.width);
        Ok(Some(GainMap::of_white(&even, image.width, SHADING)))
    }

    /// Numbers over the mean of those behind the same filter.
    fn by_own_means(&self, values: &[f64], width: usize) -> Vec<f64> {
        let channel = |at: usize| self.sensor.channel_at(at / width, at % width);
        let count = self.sensor.channels().len();
        let mut sums = vec![[0.0; 2]; count];
        for (at, value) in values.iter().enumerate() {
            let [sum, number] = &mut sums[channel(at)];
            *sum += value;
            *number += 1.0;
        }
        let mean = |at: usize| sums[channel(at)][0] / f64::max(sums[channel(at)][1], 1.0);
        values.iter().enumerate().map(|(at, value)| value / f64::max(mean(at), 1e-9)).collect()
    }

    /// Writes the frames of one kind, and their mean.
    fn frames(
        &mut self,
        to: &Transaction,
        folder: &Path,
        kind: &str,
        what: &'static str,
        light: &SensorLight,
    ) -> Result<FrameSet, Error> {
        let mut files = Vec::new();
        let mut sums: Vec<f64> = Vec::new();
        let mut size = [0; 3];
        for frame in 0..self.options.frames {
            let shot = Exposure { frame, ..self.shot };
            let image = light.expose(shot).map_err(ExposeError::from)?;
            let image = self.sensor.window(&image, self.options.window).map_err(in_words)?;
            sums.resize(image.values.len(), 0.0);
            sums.iter_mut().zip(&image.values).for_each(|(sum, &y)| *sum += f64::from(y));
            size = [image.width, image.height, image.depth];
            files.extend(self.write(
                to,
                folder,
                &format!("{kind}_{frame:03}"),
                image,
                light.white(),
            )?);
        }
        let count = f64::from(self.options.frames);
        #[expect(clippy::cast_possible_truncation, reason = "a mean of numbers of 16 bits")]
        let means: Vec<f32> = sums.iter().map(|sum| (sum / count) as f32).collect();
        let [width, height, depth] = size;
        let planes =
            (0..depth).map(|k| Values::F32(means.iter().skip(k).step_by(depth).copied().collect()));
        let layer = self.layer(planes.collect(), Look::Cube, "mean of the frames' numbers");
        let picture =
            Picture::new(width, height, vec![layer], Vec::new()).map_err(ExposeError::from)?;
        let mean = format!("{kind}_mean.npy");
        let path = folder.join(&mean);
        npy::write(to, &path, &picture, "Raw")?;
        self.files.push(path);
        Ok(FrameSet { kind: kind.to_owned(), what, files, mean, pose: None })
    }

    fn layer(&self, planes: Vec<Values>, look: Look, definition: &str) -> Layer {
        let names: Vec<String> = match planes.len() {
            1 => vec!["Y".to_owned()],
            _ => self.sensor.channels().map(|name| name.replace('.', "_")).collect(),
        };
        let channels = names.into_iter().zip(planes).map(|(name, values)| Channel { name, values });
        let meaning = [
            ("definition", definition.to_owned()),
            ("unit", "DN".to_owned()),
            ("exposure", format!("{} s", self.shot.exposure)),
        ];
        let meaning = meaning.map(|(key, text)| HeaderEntry::new(key, text)).into();
        Layer { name: "Raw".to_owned(), look, channels: channels.collect(), meaning }
    }

    /// Writes one frame in all formats that are wanted; their names.
    fn write(
        &mut self,
        to: &Transaction,
        folder: &Path,
        stem: &str,
        image: RawImage,
        white: &[f64],
    ) -> Result<Vec<String>, Error> {
        let mut names = Vec::new();
        let outputs = self.options.outputs;
        if outputs.dng && self.sensor.spec().kind == SensorKind::Raw {
            names.extend(self.dng(to, folder, stem, &image, white)?);
        }
        if let Some(packing) = self.options.packed {
            let bytes = packing.pack(&image).map_err(in_words)?;
            let name = format!("{stem}.raw{}", packing.bits());
            to.write(&folder.join(&name), |file| file.write_all(&bytes))?;
            names.push(name);
        }
        let RawImage { width, height, depth, values, .. } = image;
        let plane = |k: usize| Values::U16(values.iter().skip(k).step_by(depth).copied().collect());
        let look = match depth {
            1 | 3 => Look::Counts { bits: u8::try_from(self.sensor.bit_depth()).unwrap_or(16) },
            _ => Look::Cube,
        };
        let layer = self.layer((0..depth).map(plane).collect(), look, "digital numbers");
        let picture =
            Picture::new(width, height, vec![layer], Vec::new()).map_err(ExposeError::from)?;
        if outputs.png && matches!(depth, 1 | 3) {
            let name = format!("{stem}.png");
            png::write(to, &folder.join(&name), &picture, "Raw", png::Bits::Sixteen)?;
            names.push(name);
        }
        if outputs.npy {
            let name = format!("{stem}.npy");
            npy::write(to, &folder.join(&name), &picture, "Raw")?;
            names.push(name);
        }
        self.files.extend(names.iter().map(|name| folder.join(name)));
        Ok(names)
    }

    fn dng(
        &mut self,
        to: &Transaction,
        folder: &Path,
        stem: &str,
        image: &RawImage,
        white: &[f64],
    ) -> Result<Option<String>, Error> {
        let name = format!("{stem}.dng");
        let mut refused = None;
        let written = to.write(&folder.join(&name), |part| {
            let mut out = BufWriter::new(part);
            let details = DngDetails {
                model: self.sensor.spec().model.map_or("etendue", |model| model.preset().name),
                white,
                exposure: self.shot.exposure,
                f_number: self.f_number,
                shading: self.shading.as_ref(),
            };
            match self.sensor.write_dng(image, details, &mut out) {
                Ok(()) => out.flush(),
                Err(DngError::NotRaw(why)) => {
                    refused = Some(why);
                    Err(std::io::ErrorKind::Unsupported.into())
                }
                Err(error) => Err(std::io::Error::other(error)),
            }
        });
        match (refused, written) {
            (Some(why), _) => {
                self.notes.push(format!("no DNG is written: {why}"));
                Ok(None)
            }
            (None, Err(error)) => Err(error.into()),
            (None, Ok(())) => Ok(Some(name)),
        }
    }
}
