//! A photograph matched: the numbers of the scene's sensor and the level of its light that make the same picture.

use std::path::Path;

use etendue_image::{Limits, Samples, dng};
use etendue_render::expose::ExposeError;
use etendue_sensor::matching::{MatchError, Matched, Photograph};
use etendue_sensor::{Exposure, Radiometry, SensorSpec};

use crate::{Error, Progress, Session};

/// The longest photograph that is read (bytes).
const LONGEST: u64 = 1 << 31;

/// A raw photograph.
#[derive(Debug, Clone, PartialEq)]
pub struct RawPhoto {
    /// Columns and rows.
    pub size: [usize; 2],
    /// DN, `[row][column]`.
    pub numbers: Vec<u16>,
    /// White level: the number at which it saturates (DN), where its file says it.
    pub white: Option<f64>,
    /// Exposure time (s), where its file says it.
    pub exposure: Option<f64>,
}

impl RawPhoto {
    /// Reads a DNG or TIFF without compression, or a grey PNG of 16 bits whose numbers are those of the converter.
    ///
    /// # Errors
    ///
    /// When it cannot be read, or holds a developed picture; the message names the file and what to do.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let refuse = |why: String| Error::Refused(format!("{}: {why}", path.display()));
        let bytes =
            etendue_files::read(path, LONGEST).map_err(|error| refuse(error.to_string()))?;
        if dng::is_tiff(&bytes) {
            let read = dng::read(&bytes, Limits::default()).map_err(refuse)?;
            let dng::RawDng { size, numbers, white, exposure, .. } = read;
            return Ok(Self { size, numbers, white, exposure });
        }
        let raster = etendue_image::decode(&bytes, Limits::default()).map_err(|error| {
            refuse(format!("{error}\nhint: give a DNG, or a PNG of raw numbers"))
        })?;
        let developed = "is a developed picture, gamma-encoded\nhint: give the camera's raw numbers, as a DNG or a grey PNG of 16 bits";
        match (raster.size(), raster.channels(), raster.into_samples()) {
            (size, 1, Samples::U16(numbers)) => {
                Ok(Self { size, numbers, white: None, exposure: None })
            }
            _ => Err(refuse(developed.to_owned())),
        }
    }
}

/// Result of matching a scene to a photograph.
#[derive(Debug, Clone)]
pub struct PhotoMatch {
    /// Parameters that were fitted.
    pub matched: Matched,
    /// Exposure of the simulation (s).
    pub exposure: f64,
    /// Exposure of the photograph (s), where its file says it.
    pub photo_exposure: Option<f64>,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Values of the scene, by path, that make it match.
    pub settings: Vec<(String, f64)>,
}

/// A key of a sensor whose read-out is more than the fit has.
fn beyond_the_fit(spec: &SensorSpec) -> Option<&'static str> {
    [
        ("analog_gain", spec.analog_gain.is_some_and(|gain| gain != 1.0)),
        ("iso", spec.iso.is_some()),
        ("auto_exposure", spec.auto_exposure.is_some()),
        ("exposures", spec.exposures.as_ref().is_some_and(|times| times.len() > 1)),
        ("second_readout", spec.second_readout.is_some()),
        ("photodiodes", spec.photodiodes.is_some()),
        ("nonlinearity", spec.nonlinearity.is_some()),
    ]
    .into_iter()
    .find_map(|(key, is_given)| is_given.then_some(key))
}

/// Renders the scene of a session and fits its sensor's numbers and the level of its light to a photograph of it.
///
/// # Errors
///
/// When the scene has no raw sensor, and as the fit: of another size, clipped, not linear, too few levels of light.
pub fn match_photo(
    session: &mut Session,
    path: &Path,
    photo: &RawPhoto,
    progress: &Progress,
) -> Result<PhotoMatch, Error> {
    let of_scene = format!("{}: ", session.file().path().display());
    let idle = || {
        Error::Refused(format!(
            "{of_scene}camera.sensor: a photograph is matched by a sensor that counts electrons\nhint: give it one, such as \
             {{ \"type\": \"raw\", \"system_gain\": 0.3, \"bit_depth\": 12 }}"
        ))
    };
    {
        // Before anything is rendered.
        let scene = session.scene(progress)?;
        let sensor = scene.sensor.as_ref().ok_or_else(idle)?;
        if let Some(key) = beyond_the_fit(sensor.spec()) {
            return Err(Error::Refused(format!(
                "{of_scene}camera.sensor.{key}: a photograph is matched by one plain read-out, whose gain, noise, black and \
                 exposure are fitted\nhint: leave it out, and say `system_gain` and `exposure` instead"
            )));
        }
        let size = sensor.resolution().map(|side| side as usize);
        if size != photo.size {
            let why = MatchError::size(photo.size, size);
            return Err(Error::Refused(format!("{}: {why}", path.display())));
        }
        if sensor.depth() != 1 {
            let why = MatchError::not_raw(sensor.depth());
            return Err(Error::Refused(format!("{of_scene}{why}")));
        }
    }
    let rendering = session.render(progress)?;
    let light = rendering.sensor_light().ok_or_else(idle)?;
    let sensor = light.sensor();
    let Exposure { exposure, .. } =
        sensor.shots().next().unwrap_or(Exposure { exposure: 0.01, frame: 0 });
    let photograph = Photograph { size: photo.size, numbers: &photo.numbers, white: photo.white };
    let matched = light.matched(exposure, photograph).map_err(|error| match error {
        MatchError::Sensor(error) => ExposeError::from(error).into(),
        error => Error::Refused(format!("{}: {error}", path.display())),
    })?;
    let mut settings = vec![
        ("camera.sensor.system_gain".to_owned(), matched.system_gain.value),
        ("camera.sensor.read_noise".to_owned(), matched.read_noise.value),
        ("camera.sensor.black_level".to_owned(), matched.black_level.value.max(0.0)),
    ];
    if sensor.radiometry() == Radiometry::Physical {
        settings.push(("camera.sensor.exposure".to_owned(), matched.exposure.value));
    }
    Ok(PhotoMatch { matched, exposure, photo_exposure: photo.exposure, size: photo.size, settings })
}
