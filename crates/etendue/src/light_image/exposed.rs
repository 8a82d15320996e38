//! Response of a sensor to a picture of light: its unit, its factor, and the sensor that fits it.

use std::path::Path;

use etendue_geometry::units::Micrometres;
use etendue_image::Quantity;
use etendue_render::expose::{self, KNOWN_UNITS, LightUnit, SensorLight, pupil_solid_angle};
use etendue_render::output::HeaderEntry;
use etendue_scene::file::{RenderSpec, SensorFile};
use etendue_sensor::{Radiometry, Sensor, SensorError, SensorSpec};

use super::{ExposeOptions, LightImage, fits, refused};
use crate::{Error, ExposedImage};

impl LightImage {
    /// Exposes `sensor` to the picture: its pixels are the picture's.
    ///
    /// # Errors
    ///
    /// When nobody says in which unit the values are, radiance comes without an f-number, the sensor is for light
    /// of another kind or of other pixels, or sees none of the bands.
    pub fn on(self, sensor: &SensorFile, options: &ExposeOptions) -> Result<ExposedImage, Error> {
        let path = self.path.clone();
        let unit = self.resolved_unit(options)?;
        let factor = self.factor(unit, options)?;
        let mut notes: Vec<String> = self.notes.clone();
        refuse_what_a_camera_knows(sensor)?;
        let sensor = for_light(sensor, unit, self.pixel_pitch, &path)?;
        notes.extend(self.judge_size(&sensor)?);
        let [columns, rows] = self.picture.size;
        let bytes = SensorLight::bytes_of(&sensor, &self.picture);
        fits(options.memory, bytes, [columns, rows, self.picture.depth()])
            .map_err(|why| refused(&path, why))?;
        let seed = match (options.seed, self.noise_seed) {
            (Some(seed), _) => frame_seed(seed, options.frame),
            (None, Some(seed)) => seed,
            (None, None) => frame_seed(0, options.frame),
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let header = [
            ("exposed_from", name),
            ("light_unit", unit.to_string()),
            ("noise_seed", seed.to_string()),
        ];
        let header = header.map(|(key, text)| HeaderEntry::new(key, text)).to_vec();
        let seeds = [options.seed.unwrap_or(seed), seed];
        let light = SensorLight::from_picture(&sensor, self.picture, factor, seeds, header);
        let light = light.map_err(|error| match error {
            expose::ExposeError::Sensor(error) => {
                refused(&path, format!("its bands miss what the sensor sees: {error}"))
            }
            other => other.into(),
        })?;
        Ok(ExposedImage::new(light, self.inputs, notes))
    }

    fn resolved_unit(&self, options: &ExposeOptions) -> Result<LightUnit, Error> {
        if self.quantity == Quantity::Reflectance {
            let why = "holds what is reflected and no light\nhint: multiply it by the light that falls on it";
            return Err(refused(&self.path, why.to_owned()));
        }
        match (options.unit, &self.unit) {
            (Some(unit), _) => Ok(unit),
            (None, Some(text)) => LightUnit::parse(text).map_err(|_| {
                let text = text.escape_debug();
                let why = format!(
                    "gives its values in \"{text}\", which is not read\nhint: give --unit, {KNOWN_UNITS}"
                );
                refused(&self.path, why)
            }),
            (None, None) => {
                let why = format!(
                    "does not say in which unit its values are\nhint: give --unit, {KNOWN_UNITS}"
                );
                Err(refused(&self.path, why))
            }
        }
    }

    /// W·m⁻²·nm⁻¹ on the sensor of a value of 1.
    fn factor(&self, unit: LightUnit, options: &ExposeOptions) -> Result<f64, Error> {
        let is_radiance = matches!(unit, LightUnit::Radiance(_));
        let Some(f_number) = options.f_number else {
            return match (is_radiance, self.solid_angle) {
                (true, Some(solid_angle)) => Ok(unit.irradiance(solid_angle)),
                (true, None) => Err(refused(
                    &self.path,
                    "its values are radiance, of which a lens lets a part onto the sensor\nhint: give its --f-number N \
                     (E = π L / (1 + 4 N² (1 + m)²)), or irradiance on the sensor with its --unit W/m2/nm"
                        .to_owned(),
                )),
                (false, _) => Ok(unit.irradiance(1.0)),
            };
        };
        if !is_radiance {
            let why = format!(
                "an f-number makes irradiance of radiance, and the values are in {unit}\nhint: leave it out"
            );
            return Err(refused(&self.path, why));
        }
        let m = options.magnification;
        if !(f_number > 0.0 && f_number.is_finite() && m >= 0.0 && m.is_finite()) {
            let why = format!(
                "f-number {f_number}, magnification {m}: above 0, and 0 or more, are needed"
            );
            return Err(refused(&self.path, why));
        }
        Ok(unit.irradiance(pupil_solid_angle(f_number, m)))
    }

    /// Refuses a sensor that says it has other pixels; a note where a preset has.
    fn judge_size(&self, sensor: &Sensor) -> Result<Option<String>, Error> {
        let [columns, rows] = self.picture.size;
        if columns.max(rows) > 65_535 {
            return Err(refused(&self.path, "is larger than 65535 pixels a side".to_owned()));
        }
        let [wide, high] = sensor.resolution().map(|side| side as usize);
        if [wide, high] == [columns, rows] {
            return Ok(None);
        }
        if sensor.spec().resolution.is_some() {
            let why = format!(
                "has {columns} x {rows} pixels, and the sensor's `resolution` is {wide} x {high}\nhint: leave that out, or \
                 --set it"
            );
            return Err(refused(&self.path, why));
        }
        let known = sensor.spec().model.map(|model| model.preset().name);
        Ok(known.map(|name| {
            format!(
                "the picture has {columns} x {rows} pixels, of the {wide} x {high} of an {name}"
            )
        }))
    }
}

/// The seed of a frame's noise, as a render has it.
fn frame_seed(seed: u64, frame: u32) -> u64 {
    RenderSpec { seed, frame, ..RenderSpec::default() }.frame_seed()
}

/// The sensor of `file` with the radiometry that light in `unit` has, and with pixels of `pitch` (µm) where it says
/// nothing of its own.
fn for_light(
    file: &SensorFile,
    unit: LightUnit,
    pitch: Option<f64>,
    path: &Path,
) -> Result<Sensor, Error> {
    let wanted = match unit {
        LightUnit::FullScale => Radiometry::Digital,
        LightUnit::Radiance(_) | LightUnit::Irradiance(_) => Radiometry::Physical,
    };
    match file.spec.radiometry {
        Some(own) if own != wanted => {
            let [own, wanted] = [own, wanted].map(|radiometry| match radiometry {
                Radiometry::Digital => "digital",
                Radiometry::Physical => "physical",
            });
            Err(refused(
                path,
                format!(
                    "its values are in {unit}, for a sensor of {wanted} radiometry, and this one's `radiometry` is \
                     {own}\nhint: leave that out, or give another --unit"
                ),
            ))
        }
        _ => {
            let mut spec = SensorSpec { radiometry: Some(wanted), ..file.spec.clone() };
            if spec.model.is_none() && spec.pixel_pitch.is_none() {
                spec.pixel_pitch = pitch.map(Micrometres);
            }
            Ok(Sensor::new(&spec).map_err(|error| file.fault(&error))?)
        }
    }
}

/// Refuses parts of a sensor that ask a camera which a picture from elsewhere has not.
fn refuse_what_a_camera_knows(sensor: &SensorFile) -> Result<(), Error> {
    let spec = &sensor.spec;
    let diffuses = spec.carrier_diffusion.is_some_and(|way| way.0 > 0.0);
    let (key, why) = if spec.photodiodes.is_some() {
        (
            "photodiodes",
            "a picture from elsewhere does not say through which part of the pupil its light came",
        )
    } else if spec.angular_response.is_some() {
        ("angular_response", "a picture from elsewhere does not say at which angle its light came")
    } else if diffuses {
        (
            "carrier_diffusion",
            "a picture from elsewhere does not say what light fell between the middles of its pixels",
        )
    } else {
        return Ok(());
    };
    Err(sensor.fault(&SensorError::misplaced(key, why)).into())
}
