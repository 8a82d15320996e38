//! A camera's lens, to be looked at: its section, its figures, and rays through it.

use std::path::Path;

use etendue_files::Reach;
use etendue_optics::train::drawing::Section;
use etendue_optics::train::{Focus, Inquiry, LensReport, OpticalTrain};
use etendue_scene::file::read_lens;
use serde_json::{Value, json};

use crate::{Error, Inspector, Options, Session, read_glasses};

/// A lens by itself looks at a board so many focal lengths away.
const BOARD_DISTANCE: f64 = 40.0;

/// Squares of the board over the height of the picture.
const BOARD_SQUARES: f64 = 8.0;

/// Data of a camera's lens.
#[derive(Debug, Clone)]
pub struct LensView {
    /// Its figures: first-order data, spots, distortion, illumination.
    pub report: LensReport,
    /// The lens cut along its axis.
    pub section: Section,
    /// Lens and its planes, for the curves in waves.
    pub(crate) in_focus: FocusedTrain,
}

/// A lens with its planes.
#[derive(Debug, Clone)]
pub(crate) struct FocusedTrain {
    pub(crate) train: OpticalTrain,
    /// z of the point that depths are counted from (mm).
    pub(crate) origin: f64,
    /// From there to the plane in focus (m).
    pub(crate) distance: f64,
    /// z of the sensor (mm).
    pub(crate) image_z: f64,
}

impl Inspector {
    /// The lens of the camera as it is focused; `None` for a camera without one.
    ///
    /// # Errors
    ///
    /// When a glass has no index at a wavelength of the report.
    pub fn lens(&self) -> Result<Option<LensView>, Error> {
        let Some(lens) = self.scene().camera.lens() else { return Ok(None) };
        let focused = lens.focused();
        let (train, distance) =
            (focused.train(), focused.sensor_z() - focused.train().last_vertex());
        let focus = if distance > 0.0 { Focus::Sensor(distance) } else { Focus::AsWritten };
        let refused = |why: String| Error::Refused(format!("camera.lens: {why}"));
        let report = LensReport::new(train, &Inquiry { focus, ..Inquiry::default() })
            .map_err(|error| refused(error.to_string()))?;
        let section = Section::new(train, &report).map_err(|error| refused(error.to_string()))?;
        let in_focus = FocusedTrain {
            train: train.clone(),
            origin: focused.origin(),
            distance: focused.object_distance(),
            image_z: focused.sensor_z(),
        };
        Ok(Some(LensView { report, section, in_focus }))
    }

    /// Rays of a place of the picture (pixels) through the lens, as lines of points (z, height over the axis)
    /// in lens coordinates (mm) from the sensor on: see
    /// [`LensCamera::paths`](etendue_camera::LensCamera::paths). None without a lens.
    #[must_use]
    pub fn ray_paths(&self, place: [f64; 2], count: u32) -> Vec<Vec<[f64; 2]>> {
        self.scene().camera.lens().map(|lens| lens.paths(place, count)).unwrap_or_default()
    }
}

/// A scene that looks through the lens file at `path` at a board of squares: focused on it, with a sensor
/// of three to two in the lens' image circle.
pub(crate) fn through(path: &Path, options: Options) -> Result<Session, Error> {
    let refused = |why: String| Error::Refused(format!("{}: {why}", path.display()));
    let lens = read_lens(path, options.reach, &read_glasses(&options.glass_catalogs)?)?;
    let inquiry = Inquiry { focus: lens.focus, ..Inquiry::default() };
    let report =
        LensReport::new(&lens.train, &inquiry).map_err(|error| refused(error.to_string()))?;
    let efl = report.paraxial.efl.filter(|efl| *efl > 0.0).ok_or_else(|| {
        refused(
            "it makes no picture by itself, as it has no focal length above zero; \
                 `etendue lens` analyses it"
                .to_owned(),
        )
    })?;
    // A sensor of three to two in the circle, where that has an end; never wider than 127 degrees.
    let circle = report.image_circle.map_or(f64::INFINITY, |circle| circle / 13_f64.sqrt() * 2.0);
    let height = if circle.is_finite() { circle.min(2.0 * efl) } else { 0.5 * efl };
    let distance = BOARD_DISTANCE * efl * 1e-3;
    let square = distance * height / efl / BOARD_SQUARES;
    // Wide lenses see far beyond the paraxial picture.
    let squares = 2.0 * (2.0 * BOARD_SQUARES).max(8.0 * BOARD_SQUARES * height / efl).ceil();
    let name = path.file_name().unwrap_or_default().display().to_string();
    let scene = json!({
        "etendue": 1,
        "camera": {
            "type": "lens", "lens": name,
            "focus_distance": short(distance), "sensor_height": short(height),
            "pose": {"from": [0, 0, short(distance)], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [720, 480]},
        },
        "tracer": {"type": "facing"},
        "render": {"samples": 64},
        "objects": [{
            "name": "board", "shape": "rectangle", "material": "squares",
            "width": short(squares * square), "height": short(squares * square),
        }],
        "materials": {"squares": {
            "type": "checker", "colors": [[0.9, 0.9, 0.9], [0.05, 0.05, 0.05]], "squares": squares,
        }},
    });
    Session::from_json_with(path.parent().unwrap_or(Path::new("")), scene, options)
}

/// Four significant digits, for people to read.
fn short(value: f64) -> f64 {
    let step = 10_f64.powf(value.abs().log10().floor() - 3.0);
    let digits = (value / step).round() * step;
    // Binary leftovers of the step go.
    format!("{digits:.9}").parse().unwrap_or(value)
}

/// The lens file at `path`, which a scene may also hold in its place, to be changed there.
///
/// # Errors
///
/// When it cannot be read.
pub fn lens_values(path: &Path) -> Result<Value, Error> {
    let lens = read_lens(path, Reach::Anywhere, &[])?;
    let file =
        lens.file.ok_or_else(|| Error::Refused(format!("{}: is no lens file", path.display())))?;
    serde_json::to_value(file).map_err(|error| Error::Refused(error.to_string()))
}
