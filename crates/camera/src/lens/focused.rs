//! A lens and its sensor, focused: where each pixel lies, and the paraxial camera of both.

use glam::{DVec2, DVec3};

use super::source::Setup;
use crate::{CameraError, Intrinsics};
use etendue_optics::element::Frame;
use etendue_optics::train::analysis::{chief_height, projected_solid_angle};
use etendue_optics::train::pupil::{Disk, without_dimming};
use etendue_optics::train::{
    Focus, FocusError, LensError, MonochromaticTrain, OpticalTrain, Paraxial, SensorMount,
};

/// Entrance pupils farther away than this many times the lens' own size (mm) count as infinitely
/// far: rays towards the object are parallel.
const FARTHEST_PUPIL: f64 = 1e6;

/// A lens with its sensor in place.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusedLens {
    train: OpticalTrain,
    paraxial: Paraxial,
    film: FilmGrid,
    view: View,
    /// The plane in focus (m) from the camera's origin; infinite, or negative behind it, too.
    object_distance: f64,
    /// z of the camera's origin in lens coordinates (mm).
    origin: f64,
}

/// Paraxial view of the lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum View {
    /// Chief rays meet in the entrance pupil.
    Perspective(Intrinsics),
    /// The entrance pupil is at infinity (telecentric towards the object).
    Parallel {
        /// A pixel's side on the object (m).
        metres_per_pixel: f64,
        /// Point where the axis meets the sensor (pixels from the corner).
        centre: [f64; 2],
    },
}

/// Pixels on a sensor in lens coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FilmGrid {
    /// The sensor's place.
    pub(crate) frame: Frame,
    /// From one pixel's centre to the next (mm).
    pub(crate) pitch: f64,
    /// The middle of the picture (pixels from the corner).
    pub(crate) centre: DVec2,
    /// −1 where images are upside down, as behind most lenses; else 1.
    pub(crate) turn: f64,
}

impl FilmGrid {
    /// A place of the picture (pixels from the corner) on the sensor: x and y from its centre (mm) in
    /// the lens' axes.
    pub(crate) fn place(&self, column: f64, row: f64) -> DVec2 {
        let scale = self.turn * self.pitch;
        DVec2::new((column - self.centre.x) * scale, -(row - self.centre.y) * scale)
    }

    /// Projects a ray from the lens (mm, in lens coordinates) onto the sensor's plane, as a place in the picture
    /// (pixels from the corner): the inverse of [`Self::place`]. Not finite for a ray along the plane.
    #[inline]
    pub(crate) fn pixel(&self, position: DVec3, direction: DVec3) -> [f64; 2] {
        let Frame { vertex, rotation } = self.frame;
        let from = position - vertex;
        let distance = -from.dot(rotation.z_axis) / direction.dot(rotation.z_axis);
        let at = from + direction * distance;
        let scale = 1.0 / (self.turn * self.pitch);
        [
            self.centre.x + at.dot(rotation.x_axis) * scale,
            self.centre.y - at.dot(rotation.y_axis) * scale,
        ]
    }

    /// Point where the axis meets the sensor, were it not tilted (pixels from the corner).
    fn principal_point(&self) -> [f64; 2] {
        let scale = self.turn * self.pitch;
        let DVec3 { x, y, .. } = self.frame.vertex;
        [self.centre.x - x / scale, self.centre.y + y / scale]
    }

    /// Half the sensor's width and height (mm).
    pub(crate) fn half_size(&self) -> DVec2 {
        self.centre * self.pitch
    }
}

impl FocusedLens {
    /// Sets the stop, puts the sensor where `focus` says and finds the size of its pixels.
    pub(crate) fn new(
        train: OpticalTrain,
        setup: &Setup<'_>,
        focus: Focus,
    ) -> Result<Self, CameraError> {
        setup
            .losses
            .check()
            .map_err(|(key, why)| CameraError::new(format!("losses.{key}"), why))?;
        let train =
            stopped(train, setup)?.with_sensor(mount(setup)?).with_losses(setup.losses.clone());
        let unfocused = |fault: FocusError| {
            let key = match focus {
                Focus::Sensor(_) => "sensor_distance",
                Focus::AsWritten | Focus::Infinity | Focus::Distance(_) => "focus_distance",
            };
            CameraError::new(key, fault.to_string())
        };
        // Lenslets are focused with the sensor behind them.
        let (train, focus) = match focus {
            Focus::Distance(distance) if train.behind_lenslets().is_some() => {
                let focused = train.with_lenslets_focused(distance).map_err(unfocused)?;
                (focused, Focus::AsWritten)
            }
            Focus::AsWritten | Focus::Infinity | Focus::Distance(_) | Focus::Sensor(_) => {
                (train, focus)
            }
        };
        let z = train.sensor_z(focus).map_err(unfocused)?;
        let fault =
            |error: etendue_optics::glass::GlassError| CameraError::new("lens", error.to_string());
        let paraxial = train.paraxial(train.wavelength()).map_err(fault)?;
        let far = FARTHEST_PUPIL * (train.last_vertex().abs() + train.lateral_scale());
        let pupil = paraxial.entrance_pupil.z.filter(|z| z.abs() < far);
        let all = train.to_plane(z).map_err(fault)?;
        let scale = pupil.map(|pupil| all.image_scale(pupil));
        let mut film = FilmGrid {
            frame: train.sensor_frame(z),
            pitch: 0.0,
            centre: 0.5 * DVec2::from(setup.sensor.resolution.map(f64::from)),
            turn: -scale.unwrap_or(-all.a).signum(),
        };
        film.pitch = pitch(&train, setup, z)?;
        let centre = film.principal_point();
        let view = match scale {
            Some(scale) => {
                let focal = [scale.abs() / film.pitch; 2];
                View::Perspective(Intrinsics { focal, centre, skew: 0.0 })
            }
            None => View::Parallel { metres_per_pixel: 1e-3 * film.pitch / all.a.abs(), centre },
        };
        let finite = match view {
            View::Perspective(k) => k.focal[0],
            View::Parallel { metres_per_pixel, .. } => metres_per_pixel,
        };
        if !(finite > 0.0 && finite.is_finite()) {
            let why = "the sensor stands at an image of the stop: no picture forms there";
            return Err(CameraError::new("sensor_distance", why));
        }
        let origin = pupil.unwrap_or(0.0);
        let sharp = match train.behind_lenslets() {
            Some(view) => view.main.to_plane(view.picture_z(z)).map_err(fault)?,
            None => all,
        };
        let object_distance = 1e-3 * (sharp.conjugate() + origin);
        Ok(Self { train, paraxial, film, view, object_distance, origin })
    }

    /// Returns the setup on pixels `factor` times as large.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        let pitch = self.film.pitch * factor;
        let film = FilmGrid { pitch, centre: self.film.centre / factor, ..self.film };
        let view = match self.view {
            View::Perspective(k) => View::Perspective(k.coarser(factor)),
            View::Parallel { metres_per_pixel, centre } => View::Parallel {
                metres_per_pixel: metres_per_pixel * factor,
                centre: centre.map(|c| c / factor),
            },
        };
        Self { film, view, ..self.clone() }
    }

    /// The lens.
    #[must_use]
    pub fn train(&self) -> &OpticalTrain {
        &self.train
    }

    /// First-order data at the design wavelength.
    #[must_use]
    pub fn paraxial(&self) -> &Paraxial {
        &self.paraxial
    }

    /// Paraxial view of the lens.
    #[must_use]
    pub fn view(&self) -> View {
        self.view
    }

    /// z of the sensor's centre (mm).
    #[must_use]
    pub fn sensor_z(&self) -> f64 {
        self.film.frame.vertex.z
    }

    /// From one pixel's centre to the next (µm).
    #[must_use]
    pub fn pixel_pitch(&self) -> f64 {
        1e3 * self.film.pitch
    }

    /// −1 where pictures are upside down on the sensor, as behind most lenses; else 1.
    #[must_use]
    pub fn turn(&self) -> f64 {
        self.film.turn
    }

    /// Maps a point of the sensor's plane (mm across the axis) to the picture (pixels from the corner).
    #[must_use]
    pub fn pixel_of(&self, at: DVec2) -> [f64; 2] {
        let film = &self.film;
        let place = (at - film.frame.vertex.truncate()) / (film.turn * film.pitch);
        [film.centre.x + place.x, film.centre.y - place.y]
    }

    /// The middle of the sensor in lens coordinates (mm).
    #[must_use]
    pub fn sensor_point(&self) -> DVec3 {
        self.film.frame.vertex
    }

    /// The distance of what is in focus (m) from the camera's origin: infinite for infinity.
    #[must_use]
    pub fn object_distance(&self) -> f64 {
        self.object_distance
    }

    /// z of the camera's origin in lens coordinates (mm): the entrance pupil, or the first vertex
    /// where that is at infinity.
    #[must_use]
    pub fn origin(&self) -> f64 {
        self.origin
    }

    pub(crate) fn film(&self) -> &FilmGrid {
        &self.film
    }

    /// A point of lens coordinates (mm) in the camera's frame (m). The axes are the same: the lens'
    /// +z is the camera's backward.
    pub(crate) fn in_camera(&self, point: DVec3) -> DVec3 {
        (point - DVec3::new(0.0, 0.0, self.origin)) * 1e-3
    }

    /// The lens at its design wavelength.
    pub(crate) fn at_design(&self) -> Result<MonochromaticTrain, CameraError> {
        self.train
            .at(self.train.wavelength())
            .map_err(|fault| CameraError::new("lens", fault.to_string()))
    }
}

fn stopped(train: OpticalTrain, setup: &Setup<'_>) -> Result<OpticalTrain, CameraError> {
    match setup.f_number {
        Some(f_number) => train.with_f_number(f_number).map_err(|fault| {
            let why = match fault {
                LensError::Stop { why, .. } => why,
                other => other.to_string(),
            };
            CameraError::new("f_number", format!("{f_number} cannot be set: {why}"))
        }),
        None => Ok(train),
    }
}

/// Mounting of the sensor by the camera; `None` when it leaves that to the lens file.
fn mount(setup: &Setup<'_>) -> Result<Option<SensorMount>, CameraError> {
    let Setup { sensor_tilt: tilt, sensor_decentre: decentre, .. } = *setup;
    let mount = SensorMount { tilt, decentre };
    if !tilt.iter().all(|angle| angle.0.abs() < 90.0) {
        return Err(CameraError::new("sensor_tilt", "must be under 90 degrees"));
    }
    Ok((mount != SensorMount::default()).then_some(mount))
}

/// The size of a pixel (mm), from the one key that gives it.
fn pitch(train: &OpticalTrain, setup: &Setup<'_>, z: f64) -> Result<f64, CameraError> {
    let rows = f64::from(setup.sensor.resolution[1]);
    let given = [setup.sensor_height.is_some(), setup.fov.is_some()];
    // One of three keys gives the size of a pixel.
    match (setup.sensor.pixel_pitch, given) {
        (Some(pitch), [false, false]) => Ok(1e-3 * pitch.0),
        (None, [false, false]) => Err(CameraError::new(
            "sensor.pixel_pitch",
            "is missing: behind a lens the size of the pixels matters\nhint: give this, `sensor_height` \
             or `fov`",
        )),
        (None, [true, false]) => positive(setup.sensor_height, "sensor_height").map(|h| h / rows),
        (None, [false, true]) => {
            let fov = setup.fov.unwrap_or_default();
            if !(fov > 0.0 && fov < 360.0) {
                let why = format!("{fov} is outside 0 to 360 degrees (both excluded)");
                return Err(CameraError::new("fov", why));
            }
            let lens = train.at(train.wavelength());
            let height = lens.ok().and_then(|at| chief_height(train, &at, 0.5 * fov, z));
            match height {
                Some(height) if height != 0.0 => Ok(2.0 * height.abs() / rows),
                _ => {
                    let why = format!("no light from {} degrees off the axis arrives", 0.5 * fov);
                    Err(CameraError::new("fov", why))
                }
            }
        }
        (pitch, [height, _]) => {
            let other = match (pitch.is_some(), height) {
                (true, true) => "`sensor.pixel_pitch` and `sensor_height`",
                (true, false) => "`sensor.pixel_pitch` and `fov`",
                (false, _) => "`sensor_height` and `fov`",
            };
            let why = format!("{other} both give the size of the pixels\nhint: remove one of them");
            Err(CameraError::new(if height { "sensor_height" } else { "fov" }, why))
        }
    }
}

pub(crate) fn positive(value: Option<f64>, key: &str) -> Result<f64, CameraError> {
    let value = value.unwrap_or_default();
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(CameraError::new(key, format!("{value} is not above zero")))
}

/// The pupil as seen from the axis with all filters and masks clear; from elsewhere when the axis is
/// dark.
pub(super) fn unvignetted(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    focused: &FocusedLens,
) -> f64 {
    if let Some(view) = train.behind_lenslets() {
        return view.solid_angle(focused.sensor_z()) * at.index_before_sensor().powi(2);
    }
    let clear = without_dimming(train);
    let lens = clear.at(at.wavelength()).unwrap_or_else(|_| at.clone());
    let z = focused.sensor_z();
    let half = focused.film().half_size();
    let disk = Disk::of(&clear, &focused.film().frame, half);
    if let Some(angle) = disk.and_then(|disk| disk.solid_angle_from(z)) {
        return angle * lens.index_before_sensor().powi(2);
    }
    let on_axis = projected_solid_angle(&clear, &lens, DVec3::new(0.0, 0.0, z));
    if on_axis > 0.0 {
        return on_axis;
    }
    let mut widest = 0.0_f64;
    for y in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        for x in [-1.0, -0.5, 0.0, 0.5, 1.0] {
            let film = (DVec2::new(x, y) * half).extend(0.0);
            let point = focused.film().frame.point(film);
            widest = widest.max(projected_solid_angle(&clear, &lens, point));
        }
    }
    widest
}
