//! Exposures of the camera's sensor: the film is rendered once and exposed as often as the scene
//! says. Raw numbers, previews, moments and a sidecar go out as files.
//!
//! | file | what it is |
//! |---|---|
//! | `raw.png` | digital numbers, 16 bits a channel, unscaled (one channel or three) |
//! | `raw.npy` | the same, `[h, w]` or `[h, w, channels]`, `u2` |
//! | `raw.dng` | the same for raw converters, with pattern and levels (`raw` sensors of r, g, b or none) |
//! | `raw.preview.png` | demosaiced, white balanced, sRGB; not data |
//! | `raw_left.png`, `.npy`, `raw_right…`, `raw_top_left…`, … | the numbers of the photodiodes of dual and quad pixels |
//! | `raw_second.png`, `raw_second.npy` | the second number of each pixel, of sensors that have two |
//! | `raw_mean.npy`, `raw_variance.npy` | the expected value and variance of every pixel, once an exposure time, when asked for |
//! | `raw_snr.preview.png` | beside those, of one number a pixel, the ratio of signal to noise from 0 to 50 dB; not data |
//! | `raw_hdr.npy`, `raw_hdr_sigma.npy` | electrons a second of all exposures merged, when asked for |
//! | `sensor.json` | what the numbers mean, and which file is which exposure |
//!
//! Several exposures or frames are numbered: `raw_000.png`, `raw_001.png`, …

mod angles;
mod bands;
mod elsewhere;
mod files;
mod film;
mod illumination;
mod light;
mod noise;
mod photometry;
mod remarks;
mod unit;

use std::collections::BTreeSet;
use std::path::Path;

use etendue_files::Transaction;
use etendue_report::{Decision, DecisionKind, DecisionValue};
use etendue_scene::Scene;
use etendue_sensor::{Exposure, InvalidValues, NoiseModel, Sensor, SensorKind};

pub use crate::output::SPECTRUM;
pub(crate) use bands::{bands, explain_bands};
pub use elsewhere::{PictureLight, PixelLight};
pub use film::BandFilm;
pub(crate) use film::{has_spectrum, photodiodes, spectrum, three_planes};
pub use light::{ExposeError, Exposed, SensorLight, noise_seed};
pub(crate) use noise::NoiseOfPixels;
pub use photometry::Photometry;
pub use unit::{KNOWN_UNITS, LightUnit, pupil_solid_angle};

use crate::output::{Outputs, sidecar};
use files::{ExposureWriter, Sidecar};
use light::NOTHING_TO_EXPOSE;

/// Decision of what the sensor will do, with the reason.
pub(crate) fn explain_sensor(scene: &Scene) -> Option<Decision> {
    let sensor = scene.sensor.as_ref()?;
    if scene.picture.is_none() {
        let off = DecisionValue::Switch(false);
        return Some(Decision::new(DecisionKind::Sensor, off, NOTHING_TO_EXPOSE));
    }
    let noise = match sensor.noise() {
        NoiseModel::Poisson => "exact Poisson noise",
        NoiseModel::Normal => "normal approximation of noise",
        NoiseModel::None => "no noise",
    };
    let shots = sensor.shots().count();
    let because = format!(
        "camera.sensor says more than its grid of pixels; the light is rendered once and exposed \
         {shots} time{}",
        if shots == 1 { "" } else { "s" }
    );
    let choice = format!("{}, {} bit, {noise}", name(sensor), sensor.bit_depth());
    Some(Decision::new(DecisionKind::Sensor, choice, because))
}

fn name(sensor: &Sensor) -> String {
    let kind = match sensor.spec().kind {
        SensorKind::Raw => "raw",
        SensorKind::Rgb => "rgb",
        SensorKind::Multispectral => "multispectral",
    };
    match sensor.spec().model {
        Some(model) => format!("{kind} {}", model.preset().name),
        None => kind.to_owned(),
    }
}

/// Writes what the sensor makes of `light` into `folder`. Told the share done, `progress` answers
/// whether to go on.
///
/// # Errors
///
/// When a file cannot be written, or `progress` says stop.
pub fn write(
    light: &SensorLight,
    files: &Transaction,
    folder: &Path,
    outputs: Outputs,
    progress: &dyn Fn(f64) -> bool,
) -> Result<Exposed, ExposeError> {
    let sensor = light.sensor();
    let shots: Vec<Exposure> = sensor.shots().collect();
    let digits = digits(shots.len());
    let mut writer = ExposureWriter {
        sensor,
        second: sensor.second(),
        light,
        files,
        folder,
        outputs,
        digits,
        moments: Vec::new(),
        invalid: InvalidValues::default(),
        remarked_exposure: None,
        exposed: Exposed { files: Vec::new(), notes: light.notes.clone() },
    };
    let mut sidecar = Sidecar::new(sensor, light.seeds);
    sidecar.metered_exposure_s = light.metered;
    sidecar.photometry = light.photometry();
    // One shot after the other, each with its entry in the sidecar.
    for (done, shot) in shots.iter().enumerate() {
        if !progress(done as f64 / shots.len() as f64) {
            return Err(ExposeError::Stopped);
        }
        sidecar.shots.push(writer.shot(*shot)?);
    }
    if sensor.spec().hdr == Some(true) {
        sidecar.hdr = Some(writer.merged(&shots)?);
    }
    sidecar.invalid = writer.invalid;
    writer.exposed.notes.extend(in_words(sidecar.invalid));
    sidecar.notes.clone_from(&writer.exposed.notes);
    let path = writer.place("sensor.json");
    sidecar::write_json(files, &path, &sidecar)?;
    Ok(writer.exposed)
}

/// The names of all files that exposing `scene` may write.
#[must_use]
pub fn file_names(scene: &Scene) -> Vec<String> {
    scene.sensor.as_ref().map(files_of).unwrap_or_default()
}

/// The names of all files that exposures of `sensor` may leave.
#[must_use]
pub fn files_of(sensor: &Sensor) -> Vec<String> {
    let shots: Vec<Exposure> = sensor.shots().collect();
    let digits = digits(shots.len());
    let endings = ["png", "preview.png", "npy", "dng"];
    let shot =
        |shot: &Exposure| endings.map(|ending| files::name(digits, "raw", shot.frame, ending));
    let has_moments = sensor.spec().moments == Some(true);
    // Fewer exposure times than shots, numbered alike.
    let moments: BTreeSet<String> = (0..)
        .zip(shots.iter().filter(|_| has_moments))
        .flat_map(|(number, _)| {
            let [mean, variance] = files::moment_names(sensor, digits, number);
            [mean, variance, files::snr_name(sensor, digits, number)]
        })
        .collect();
    let merged = files::HDR_NAMES.iter().filter(|_| sensor.spec().hdr == Some(true));
    let merged = merged.map(|(name, _)| (*name).to_owned());
    let sidecar = ["sensor.json".to_owned()];
    let second = shots.iter().filter(|_| sensor.spec().second_readout.is_some());
    let of_second = |shot: &Exposure| {
        ["png", "npy"].map(|ending| files::name(digits, files::SECOND, shot.frame, ending))
    };
    let second = second.flat_map(of_second);
    let parts = photodiodes(sensor).iter().flat_map(|(_, name)| {
        let of_part = |shot: &Exposure| {
            ["png", "npy"].map(|ending| files::name(digits, name, shot.frame, ending))
        };
        shots.iter().flat_map(of_part).collect::<Vec<_>>()
    });
    shots
        .iter()
        .flat_map(shot)
        .chain(second)
        .chain(parts)
        .chain(moments)
        .chain(merged)
        .chain(sidecar)
        .collect()
}

/// Digits of a shot's number in names; 0 for none.
fn digits(shots: usize) -> usize {
    match shots {
        1 => 0,
        count => (count - 1).to_string().len().max(3),
    }
}

/// Note on what a film has that is no light, if anything.
fn in_words(invalid: InvalidValues) -> Option<String> {
    let InvalidValues { negative, not_finite } = invalid;
    invalid.any().then(|| {
        format!(
            "{negative} negative and {not_finite} infinite or NaN values of the film are no light \
             and were taken for none"
        )
    })
}
