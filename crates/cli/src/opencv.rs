//! `etendue lens --fit-opencv`: OpenCV's camera for a lens.

use etendue_camera::{Camera, OpencvFit, SensorSpec};
use etendue_files::Transaction;
use etendue_geometry::units::Micrometres;
use etendue_optics::train::analysis::chief_height;
use etendue_optics::train::{Inquiry, LensReport, OpticalTrain};
use etendue_render::output::sidecar;
use etendue_scene::file::ReadLens;

use crate::arguments::LensArguments;
use crate::fault::{Fault, VersionedReport, print_json, print_text};
use crate::progress::say;

/// The file that holds a fit.
pub(crate) const FILE: &str = "opencv.json";

/// The picture of a lens that stands in no scene.
const RESOLUTION: [u32; 2] = [1536, 1024];

/// The share of the image circle's radius at which the corners of such a picture lie: on its edge there
/// is no light left.
const CORNERS: f64 = 0.9;

/// The angle from the axis (degrees) of the corners where light reaches everywhere.
const WIDEST: f64 = 20.0;

/// Fits OpenCV's camera to a lens, and prints or writes it.
pub(crate) fn fit(
    lens: &ReadLens,
    arguments: &LensArguments,
    to: &Transaction,
) -> Result<(), Fault> {
    let camera = camera(lens, arguments)?;
    let fit = OpencvFit::new(&camera, arguments.tolerance.unwrap_or(OpencvFit::TOLERANCE));
    let path = arguments.lens.display();
    let fit = fit.map_err(|error| Fault::refused(format!("{path}: --fit-opencv: {error}")))?;
    if let Some(folder) = &arguments.output {
        etendue::places::folder(folder)?;
        let path = folder.join(FILE);
        sidecar::write_json(to, &path, &VersionedReport::new(&fit))?;
        if !arguments.quiet {
            say(&format!("wrote {}", path.display()));
        }
    }
    if arguments.json {
        print_json(&VersionedReport::new(&fit))
    } else {
        print_text(&fit.to_string())
    }
}

/// The scene's camera, or the lens with a picture in its image circle.
fn camera(lens: &ReadLens, arguments: &LensArguments) -> Result<Camera, Fault> {
    if let Some(camera) = &lens.camera {
        let set = [
            ("--focus", arguments.focus.is_some()),
            ("--f-number", arguments.f_number.is_some()),
            ("--wavelengths", arguments.wavelengths.is_some()),
            ("--resolution", arguments.resolution.is_some()),
            ("--pixel-pitch", arguments.pixel_pitch.is_some()),
        ];
        return match set.into_iter().find(|(_, is_set)| *is_set) {
            None => Ok(camera.clone()),
            Some((option, _)) => Err(Fault::refused(format!(
                "{option}: --fit-opencv takes the camera of a scene as it is; change it in the scene, or \
                 give the lens' own file"
            ))),
        };
    }
    let resolution = arguments.resolution.unwrap_or(RESOLUTION);
    let pitch = match arguments.pixel_pitch {
        Some(pitch) => pitch,
        None => pitch(lens, arguments, resolution)?,
    };
    let sensor = SensorSpec { resolution, pixel_pitch: Some(Micrometres(pitch)) };
    let focus = arguments.focus.unwrap_or(lens.focus);
    Camera::of_lens(&lens.train, focus, sensor)
        .map_err(|error| Fault::refused(format!("{}: {error}", arguments.lens.display())))
}

/// The pitch (um) of pixels that fill the image circle.
fn pitch(lens: &ReadLens, arguments: &LensArguments, resolution: [u32; 2]) -> Result<f64, Fault> {
    let focus = arguments.focus.unwrap_or(lens.focus);
    let refused = |why: &dyn std::fmt::Display| {
        Fault::refused(format!("{}: {why}", arguments.lens.display()))
    };
    let inquiry = Inquiry { focus, fields: Some(Vec::new()), ..Inquiry::default() };
    let report = LensReport::new(&lens.train, &inquiry).map_err(|error| refused(&error))?;
    let radius = match report.image_circle {
        Some(diameter) => Some(0.5 * CORNERS * diameter),
        None => report.sensor_z.and_then(|z| height(&lens.train, z)),
    };
    let [width, height] = resolution.map(f64::from);
    let pitch = radius.map(|mm| 2e3 * mm / width.hypot(height));
    pitch.filter(|um| *um > 0.0 && um.is_finite()).ok_or_else(|| {
        refused(&"the size of its picture is not known\nhint: give the size of a pixel by --pixel-pitch")
    })
}

/// Distance from the axis (mm) at which the chief ray of the widest field meets the sensor.
fn height(train: &OpticalTrain, sensor_z: f64) -> Option<f64> {
    let at = train.at(train.wavelength()).ok()?;
    chief_height(train, &at, WIDEST, sensor_z).map(f64::abs)
}
