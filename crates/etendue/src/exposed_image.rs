//! A picture of light on a sensor, and the files of it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use etendue_files::{Ledger, MANIFEST, Transaction, remove_empty_folders};
use etendue_render::expose::{self, SensorLight};
use etendue_render::output::Outputs;
use etendue_sensor::{Exposure, RawImage};

use crate::progress::Phase;
use crate::{Error, FramePattern, Progress, WrittenFiles, places};

/// A picture of light on a sensor.
#[derive(Debug, Clone)]
pub struct ExposedImage {
    light: SensorLight,
    inputs: Vec<PathBuf>,
    notes: Vec<String>,
}

impl ExposedImage {
    pub(crate) fn new(light: SensorLight, inputs: Vec<PathBuf>, notes: Vec<String>) -> Self {
        Self { light, inputs, notes }
    }

    /// One of a sequence: all have the exposure that `auto_exposure` metered on the `first` of them with light (s), unless each
    /// has its own.
    #[must_use]
    pub fn in_sequence(mut self, first: &mut Option<f64>) -> Self {
        if self.light.sensor().spec().auto_exposure.is_some_and(|metering| !metering.each_frame) {
            match *first {
                Some(time) => self.light = self.light.at_exposure(time),
                None => *first = self.light.metered(),
            }
        }
        self
    }

    /// The light on the sensor.
    #[must_use]
    pub fn sensor_light(&self) -> &SensorLight {
        &self.light
    }

    /// Notes for the user.
    pub fn notes(&self) -> impl Iterator<Item = &str> {
        self.notes.iter().chain(self.light.notes()).map(String::as_str)
    }

    /// The exposures that the sensor asks for: exposure times and frames.
    pub fn exposures(&self) -> impl Iterator<Item = Exposure> + '_ {
        self.light.sensor().shots()
    }

    /// The sensor's digital numbers for one exposure, rows from the top. The same whenever it is asked for.
    ///
    /// # Errors
    ///
    /// None that a caller can cause.
    pub fn raw(&self, exposure: Exposure) -> Result<RawImage, Error> {
        Ok(self.light.expose(exposure).map_err(expose::ExposeError::from)?)
    }

    /// Writes the files that a render leaves of its sensor into `folder`, which is made when it is missing. What an
    /// earlier run left there and this one does not write again is removed.
    ///
    /// # Errors
    ///
    /// When the folder cannot be written to, the picture would be written over, or it is stopped.
    pub fn write(
        &self,
        folder: &Path,
        outputs: Outputs,
        progress: &Progress,
    ) -> Result<WrittenFiles, Error> {
        let one = std::iter::once(Ok(ExposedFrame { number: None, image: self.clone() }));
        write_frames(one, folder, outputs, progress, &mut |_, _| ())
    }

    fn write_into(
        &self,
        to: &Transaction,
        folder: &Path,
        outputs: Outputs,
        goes_on: &dyn Fn(f64) -> bool,
    ) -> Result<WrittenFiles, Error> {
        let names = expose::files_of(self.light.sensor()).into_iter().chain([MANIFEST.to_owned()]);
        let results: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
        places::keep_apart(&self.inputs, &results)?;
        let exposed = expose::write(&self.light, to, folder, outputs, goes_on)?;
        let notes = self.notes.iter().cloned().chain(exposed.notes).collect();
        Ok(WrittenFiles { files: exposed.files, notes, time: Duration::ZERO })
    }
}

/// An exposed picture with the number of its frame, if it has one.
#[derive(Debug, Clone)]
pub struct ExposedFrame {
    /// The number.
    pub number: Option<u32>,
    /// The picture.
    pub image: ExposedImage,
}

/// Writes exposed pictures, each read when its turn comes, into `folder`: those with a number of a frame into
/// `frames/NUMBER` there, as a render's frames. Progress is of all of them; `on_frame` gets each frame's number, if it has
/// one, and the time that it took.
///
/// # Errors
///
/// Those of the pictures, and of [`ExposedImage::write`]; then nothing is written.
pub fn write_frames(
    images: impl Iterator<Item = Result<ExposedFrame, Error>>,
    folder: &Path,
    outputs: Outputs,
    progress: &Progress,
    on_frame: &mut dyn FnMut(Option<u32>, Duration),
) -> Result<WrittenFiles, Error> {
    let start = Instant::now();
    let count = images.size_hint().1.unwrap_or(1).max(1) as f64;
    places::folder(folder)?;
    let pattern = FramePattern::default();
    let mut made = Vec::new();
    let done = places::recorded(Ledger::open(folder, "expose"), &[], |to| {
        let mut all = WrittenFiles::default();
        let mut begun = Instant::now();
        for (done, image) in images.enumerate() {
            let ExposedFrame { number: frame, image } = image?;
            let own = match frame {
                None => folder.to_owned(),
                Some(number) => {
                    let own = folder.join(pattern.folder(number as usize));
                    places::folder(&own)?;
                    made.push(own.clone());
                    own
                }
            };
            let share = |own: f64| (done as f64 + own) / count;
            let goes_on = |own| progress.goes_on(Phase::Expose, share(own));
            let written = image.write_into(to, &own, outputs, &goes_on)?;
            on_frame(frame, begun.elapsed());
            begun = Instant::now();
            all.files.extend(written.files);
            // Of many frames much is true.
            all.notes.extend(written.notes);
            all.notes.sort();
            all.notes.dedup();
        }
        Ok::<_, Error>(all)
    });
    if done.is_err() {
        // They go only when nothing was in them.
        made.iter().for_each(|own| remove_empty_folders(folder, &own.join("raw.png")));
    }
    let mut written = done?;
    written.notes.iter().for_each(|note| progress.note(note));
    written.time = start.elapsed();
    Ok(written)
}
