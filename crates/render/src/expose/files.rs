//! The files of each exposure.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use etendue_sensor::dng::{DngDetails, DngError};
use etendue_sensor::{
    Defect, Exposure, Film, InvalidValues, Moments, NoiseModel, RawImage, Sensor, SensorKind,
    SensorSpec,
};
use rayon::prelude::*;
use serde::Serialize;

use super::film::plain;
use super::light::{ExposeError, Exposed, SensorLight};
use super::remarks;
use crate::output::{
    Channel, HeaderEntry, Layer, Look, Outputs, Picture, PictureError, Values, npy, png,
};
use etendue_files::{SOFTWARE, Transaction};

/// `raw_003.png` of `raw` and `png` when there are several shots.
pub(super) fn name(digits: usize, stem: &str, number: u32, ending: &str) -> String {
    match digits {
        0 => format!("{stem}.{ending}"),
        digits => format!("{stem}_{number:0digits$}.{ending}"),
    }
}

/// Writes one exposure after the other.
pub(super) struct ExposureWriter<'a> {
    pub(super) sensor: &'a Sensor,
    /// Sensor of its second read-out, where it has one.
    pub(super) second: Option<Sensor>,
    pub(super) light: &'a SensorLight,
    pub(super) files: &'a Transaction,
    pub(super) folder: &'a Path,
    pub(super) outputs: Outputs,
    /// Digits of a shot's number in names; 0 for none.
    pub(super) digits: usize,
    /// Of each exposure time so far: its moments' files, which all of its frames share.
    pub(super) moments: Vec<(f64, MomentFiles)>,
    pub(super) invalid: InvalidValues,
    /// The exposure time (s) of the last shot whose losses are told.
    pub(super) remarked_exposure: Option<f64>,
    pub(super) exposed: Exposed,
}

impl ExposureWriter<'_> {
    fn film(&self) -> Film<'_> {
        self.light.film()
    }

    pub(super) fn place(&mut self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        self.exposed.files.push(path.clone());
        path
    }

    fn name(&self, stem: &str, number: u32, ending: &str) -> String {
        name(self.digits, stem, number, ending)
    }

    pub(super) fn shot(&mut self, shot: Exposure) -> Result<ShotFiles, ExposeError> {
        let image = self.light.expose(shot)?;
        let mut files = ShotFiles::new(shot);
        // Every shot sees the same film, so once is enough.
        self.invalid = image.invalid;
        // Frames of one exposure time differ by their noise alone.
        if self.remarked_exposure != Some(shot.exposure) {
            self.remarked_exposure = Some(shot.exposure);
            let remarks = remarks::on(self.sensor, self.film(), &image, shot);
            self.exposed.notes.extend(remarks);
        }
        let preview = self.preview(&image, shot)?;
        if self.outputs.dng && self.sensor.spec().kind == SensorKind::Raw {
            files.dng = self.dng(&image, shot)?;
        }
        let many = image.depth != 1 && image.depth != 3;
        let raw = self.raw(image, shot)?;
        if self.outputs.png {
            if !many {
                let name = self.name("raw", shot.frame, "png");
                png::write(self.files, &self.place(&name), &raw, "Raw", png::Bits::Sixteen)?;
                files.png = Some(name);
            }
            let name = self.name("raw", shot.frame, "preview.png");
            png::write(self.files, &self.place(&name), &preview, "", png::Bits::Eight)?;
            files.preview = Some(name);
        }
        // Without PNG of that many channels, the numbers still have to go somewhere.
        if self.outputs.npy || many {
            let name = self.name("raw", shot.frame, "npy");
            npy::write(self.files, &self.place(&name), &raw, "Raw")?;
            files.npy = Some(name);
        }
        if let Some(second) = self.second.clone() {
            let image = self.light.expose_on(&second, shot)?;
            files.second = self.numbers(image, SECOND, shot)?;
        }
        let parts: Vec<&'static str> = self.light.parts().collect();
        for (part, stem) in parts.into_iter().enumerate() {
            let image = self.light.expose_part(part, shot)?;
            files.photodiodes.extend(self.numbers(image, stem, shot)?);
        }
        if self.sensor.spec().moments == Some(true) {
            let known = self.moments.iter().find(|(exposure, _)| *exposure == shot.exposure);
            let found = match known {
                Some((_, found)) => found.clone(),
                None => {
                    let found = self.moments(shot)?;
                    self.moments.push((shot.exposure, found.clone()));
                    found
                }
            };
            [files.mean, files.variance] = found.map(Some);
        }
        Ok(files)
    }

    /// Writes further numbers of the pixels, as the first ones.
    fn numbers(
        &mut self,
        image: RawImage,
        stem: &str,
        shot: Exposure,
    ) -> Result<Option<String>, ExposeError> {
        let is_picture = matches!(image.depth, 1 | 3);
        let raw = self.raw(image, shot)?;
        let mut named = None;
        if self.outputs.png && is_picture {
            let name = self.name(stem, shot.frame, "png");
            png::write(self.files, &self.place(&name), &raw, "Raw", png::Bits::Sixteen)?;
            named = Some(name);
        }
        if self.outputs.npy || !is_picture {
            let name = self.name(stem, shot.frame, "npy");
            npy::write(self.files, &self.place(&name), &raw, "Raw")?;
            named = Some(name);
        }
        Ok(named)
    }

    /// The numbers as a picture of one layer.
    fn raw(&self, image: RawImage, shot: Exposure) -> Result<Picture, PictureError> {
        let RawImage { width, height, depth, values, .. } = image;
        let planes = if depth == 1 {
            vec![Values::U16(values)]
        } else {
            let plane = |k: usize| values.iter().skip(k).step_by(depth).copied().collect();
            (0..depth).into_par_iter().map(|k| Values::U16(plane(k))).collect()
        };
        let look = match depth {
            1 | 3 => Look::Counts { bits: u8::try_from(self.sensor.bit_depth()).unwrap_or(16) },
            _ => Look::Cube,
        };
        let layer = Layer {
            name: "Raw".to_owned(),
            look,
            channels: self.named(planes),
            meaning: self.meaning("digital numbers as the converter gave them", "DN", shot),
        };
        Picture::new(width, height, vec![layer], self.light.header.clone())
    }

    fn named(&self, planes: Vec<Values>) -> Vec<Channel> {
        let names: Vec<String> = match planes.len() {
            1 => vec!["Y".to_owned()],
            _ => self.sensor.channels().map(plain).collect(),
        };
        names.into_iter().zip(planes).map(|(name, values)| Channel { name, values }).collect()
    }

    fn meaning(&self, definition: &str, unit: &str, shot: Exposure) -> Vec<HeaderEntry> {
        let sensor = self.sensor;
        [
            ("definition", definition.to_owned()),
            ("unit", unit.to_owned()),
            ("black level", format!("{} DN", sensor.black_level())),
            ("white level", format!("{} DN", sensor.white_level())),
            ("exposure", format!("{} s", shot.exposure)),
            ("frame", shot.frame.to_string()),
        ]
        .map(|(key, text)| HeaderEntry::new(key, text))
        .into()
    }

    fn preview(&self, image: &RawImage, shot: Exposure) -> Result<Picture, PictureError> {
        let method = self.sensor.spec().demosaic.unwrap_or_default();
        let developed = if self.outputs.png {
            self.sensor.developed(image, method)
        } else {
            vec![[0.0; 3]; image.width * image.height]
        };
        let plane = |k: usize| Values::F32(developed.iter().map(|color| color[k]).collect());
        let channels = ["R", "G", "B"]
            .into_iter()
            .enumerate()
            .map(|(k, name)| Channel { name: name.to_owned(), values: plane(k) })
            .collect();
        let meaning = self.meaning("demosaiced and white balanced", "1", shot);
        let layer = Layer { name: String::new(), look: Look::Color, channels, meaning };
        Picture::new(image.width, image.height, vec![layer], self.light.header.clone())
    }

    /// A DNG where the format has words for the sensor; else a note, once.
    fn dng(&mut self, image: &RawImage, shot: Exposure) -> Result<Option<String>, ExposeError> {
        let name = self.name("raw", shot.frame, "dng");
        let path = self.folder.join(&name);
        let model = self.sensor.spec().model.map_or("etendue", |model| model.preset().name);
        let mut refused = None;
        // An image that no DNG can hold is not written, and that is no fault.
        let written = self.files.write(&path, |part| {
            let mut out = BufWriter::new(part);
            let white = &self.light.white;
            let (exposure, f_number) = (shot.exposure, self.light.f_number);
            let details = DngDetails { model, white, exposure, f_number, shading: None };
            match self.sensor.write_dng(image, details, &mut out) {
                Ok(()) => out.flush(),
                Err(DngError::NotRaw(why)) => {
                    refused = Some(why);
                    Err(io::ErrorKind::Unsupported.into())
                }
                Err(error) => Err(io::Error::other(error)),
            }
        });
        // Said once for all shots.
        match (refused, written) {
            (Some(why), _) => {
                let note = format!("no DNG is written: {why}");
                if !self.exposed.notes.contains(&note) {
                    self.exposed.notes.push(note);
                }
                Ok(None)
            }
            (None, Err(error)) => Err(error.into()),
            (None, Ok(())) => {
                self.exposed.notes.extend(remarks::on_pattern(self.sensor));
                self.exposed.notes.dedup();
                self.exposed.files.push(path);
                Ok(Some(name))
            }
        }
    }

    /// Merges all exposures, and writes electrons a second with their standard deviation.
    pub(super) fn merged(&mut self, shots: &[Exposure]) -> Result<[String; 2], ExposeError> {
        let light = self.light;
        let image = self.sensor.merged(shots, |sensor, shot| light.expose_on(sensor, shot))?;
        if image.saturated > 0 {
            let of = image.rate.len();
            self.exposed.notes.push(format!(
                "hdr: {} of {of} numbers are saturated in the shortest exposure: raw_hdr.npy has what they are at \
                 least, raw_hdr_sigma.npy has infinity; add a shorter one",
                image.saturated
            ));
        }
        let depth = image.depth;
        let times: Vec<String> = shots.iter().map(|shot| shot.exposure.to_string()).collect();
        for ((name, definition), values) in HDR_NAMES.into_iter().zip([image.rate, image.sigma]) {
            let plane = |k: usize| values.iter().skip(k).step_by(depth).copied().collect();
            let planes = (0..depth).map(|k| Values::F32(plane(k))).collect();
            let meaning = [
                ("definition", definition.to_owned()),
                ("unit", "e-/s".to_owned()),
                ("exposures", format!("{} s", times.join(", "))),
            ];
            let meaning = meaning.map(|(key, text)| HeaderEntry::new(key, text)).into();
            let channels = self.named(planes);
            let layer = Layer { name: "Hdr".to_owned(), look: Look::Cube, channels, meaning };
            let header = self.light.header.clone();
            let picture = Picture::new(image.width, image.height, vec![layer], header)?;
            npy::write(self.files, &self.place(name), &picture, "Hdr")?;
        }
        Ok(HDR_NAMES.map(|(name, _)| name.to_owned()))
    }

    /// Draws the ratio of signal above black to noise of every number, 20·log₁₀ of it from 0 dB (black) to 50 dB (white).
    fn ratios(&mut self, moments: &Moments, name: &str, shot: Exposure) -> Result<(), ExposeError> {
        let black = self.sensor.black_level()
            + self.sensor.system_gain() * self.sensor.dark_current() * shot.exposure;
        let grey = |(mean, variance): (&f32, &f32)| {
            let ratio =
                (f64::from(*mean) - black).max(0.0) / f64::from(*variance).max(1e-12).sqrt();
            #[expect(clippy::cast_possible_truncation, reason = "a picture to look at")]
            let grey = (20.0 * ratio.max(1e-9).log10() / WHITE_DECIBELS).clamp(0.0, 1.0) as f32;
            grey
        };
        let all: Vec<f32> = moments.mean.iter().zip(&moments.variance).map(grey).collect();
        let depth = moments.depth;
        let plane = |k: usize| Values::F32(all.iter().skip(k).step_by(depth).copied().collect());
        let definition = "signal to noise, 20 log10 of it, as a share of 50 dB";
        let layer = Layer {
            name: "Snr".to_owned(),
            look: Look::Share,
            channels: self.named((0..depth).map(plane).collect()),
            meaning: self.meaning(definition, "50 dB", shot),
        };
        let header = self.light.header.clone();
        let picture = Picture::new(moments.width, moments.height, vec![layer], header)?;
        png::write(self.files, &self.place(name), &picture, "Snr", png::Bits::Eight)?;
        Ok(())
    }

    /// Writes expected value and variance of an exposure time, numbered as the exposure is.
    fn moments(&mut self, shot: Exposure) -> Result<MomentFiles, ExposeError> {
        #[expect(clippy::cast_possible_truncation, reason = "fewer than shots")]
        let number = self.moments.len() as u32;
        let names = moment_names(self.sensor, self.digits, number);
        // Mean and variance, a file each.
        let moments = self.sensor.moments(self.film(), shot)?;
        let depth = moments.depth;
        if self.outputs.png && depth == 1 {
            self.ratios(&moments, &snr_name(self.sensor, self.digits, number), shot)?;
        }
        for ((stem, definition, unit, values), name) in [
            ("mean", "expected digital number", "DN", moments.mean),
            ("variance", "variance over frames, quantisation included", "DN^2", moments.variance),
        ]
        .into_iter()
        .zip(&names)
        {
            let plane = |k: usize| values.iter().skip(k).step_by(depth).copied().collect();
            let planes = (0..depth).map(|k| Values::F32(plane(k))).collect();
            let layer = Layer {
                name: stem.to_owned(),
                look: Look::Cube,
                channels: self.named(planes),
                meaning: self.meaning(definition, unit, shot),
            };
            let header = self.light.header.clone();
            let picture = Picture::new(moments.width, moments.height, vec![layer], header)?;
            npy::write(self.files, &self.place(name), &picture, stem)?;
        }
        Ok(names)
    }
}

/// Decibels that are white in a map of ratios.
const WHITE_DECIBELS: f64 = 50.0;

/// The name of the map of ratios of signal to noise of the exposure time `number`.
pub(super) fn snr_name(sensor: &Sensor, digits: usize, number: u32) -> String {
    name(digits_of_moments(sensor, digits), "raw_snr", number, "preview.png")
}

/// The files of all exposures merged, and what is in them.
pub(super) const HDR_NAMES: [(&str, &str); 2] = [
    ("raw_hdr.npy", "photo-electrons a second, of all exposures by the weights of least noise"),
    ("raw_hdr_sigma.npy", "their standard deviation"),
];

/// File name of a second read-out.
pub(super) const SECOND: &str = "raw_second";

/// Names of the files of expected value and variance.
pub(super) type MomentFiles = [String; 2];

/// These names for the exposure time `number` of a sensor. Frames of one exposure have the same moments.
pub(super) fn moment_names(sensor: &Sensor, digits: usize, number: u32) -> MomentFiles {
    let digits = digits_of_moments(sensor, digits);
    ["raw_mean", "raw_variance"].map(|stem| name(digits, stem, number, "npy"))
}

/// Number of digits of the exposure's number in names of moments: none where all exposures take the same time.
fn digits_of_moments(sensor: &Sensor, digits: usize) -> usize {
    let mut times = sensor.shots().map(|shot| shot.exposure);
    let first = times.next();
    if times.any(|other| Some(other) != first) { digits } else { 0 }
}

/// `sensor.json`.
#[derive(Debug, Serialize)]
pub(super) struct Sidecar<'a> {
    software: &'static str,
    sensor: &'a SensorSpec,
    resolution: [u32; 2],
    bits: u32,
    black_level_dn: f64,
    white_level_dn: f64,
    saturation_level_dn: f64,
    system_gain_dn_per_electron: f64,
    /// The light in lux, cd/m² and EV, where it has units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) photometry: Option<super::Photometry>,
    /// The exposure that `auto_exposure` found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) metered_exposure_s: Option<f64>,
    channels: Vec<&'a str>,
    white_balance: Vec<f64>,
    /// Pixels with which something is wrong, row by row.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    defects: Vec<DefectivePixel>,
    bands: Vec<String>,
    seed: u64,
    noise_seed: u64,
    pub(super) invalid: InvalidValues,
    pub(super) notes: Vec<String>,
    pub(super) shots: Vec<ShotFiles>,
    /// Of all exposures merged: electrons a second, and their standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) hdr: Option<[String; 2]>,
}

impl<'a> Sidecar<'a> {
    pub(super) fn new(sensor: &'a Sensor, [seed, noise_seed]: [u64; 2]) -> Self {
        Self {
            software: SOFTWARE,
            sensor: sensor.spec(),
            resolution: sensor.resolution(),
            bits: sensor.bit_depth(),
            black_level_dn: sensor.black_level(),
            white_level_dn: sensor.white_level(),
            saturation_level_dn: sensor.saturation_level(),
            system_gain_dn_per_electron: sensor.system_gain(),
            photometry: None,
            metered_exposure_s: None,
            channels: sensor.channels().collect(),
            white_balance: sensor.white_balance(),
            defects: DefectivePixel::all(sensor),
            bands: sensor.bands().names(),
            seed,
            noise_seed,
            invalid: InvalidValues::default(),
            notes: Vec::new(),
            shots: Vec::new(),
            hdr: None,
        }
    }
}

/// A pixel with which something is wrong.
#[derive(Debug, Serialize)]
struct DefectivePixel {
    column: u32,
    row: u32,
    /// The channel of the image, where it has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    channel: Option<usize>,
    kind: Defect,
}

impl DefectivePixel {
    /// Those of a sensor. Without noise it has none, as it has no other pattern.
    fn all(sensor: &Sensor) -> Vec<Self> {
        let has_channels = sensor.depth() > 1;
        let pixel = |([column, row], channel, kind): ([u32; 2], usize, Defect)| {
            let channel = has_channels.then_some(channel);
            Self { column, row, channel, kind }
        };
        match sensor.noise() {
            NoiseModel::None => Vec::new(),
            NoiseModel::Poisson | NoiseModel::Normal => sensor.defects().map(pixel).collect(),
        }
    }
}

/// The files of one exposure, by name.
#[derive(Debug, Serialize)]
pub(super) struct ShotFiles {
    exposure_s: f64,
    frame: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    png: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    npy: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dng: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    preview: Option<String>,
    /// Of the second read-out.
    #[serde(skip_serializing_if = "Option::is_none")]
    second: Option<String>,
    /// Of the photodiodes of dual and quad pixels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    photodiodes: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    variance: Option<String>,
}

impl ShotFiles {
    fn new(Exposure { exposure, frame }: Exposure) -> Self {
        Self {
            exposure_s: exposure,
            frame,
            png: None,
            npy: None,
            dng: None,
            preview: None,
            second: None,
            photodiodes: Vec::new(),
            mean: None,
            variance: None,
        }
    }
}
