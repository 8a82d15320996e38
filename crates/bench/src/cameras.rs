//! Each model of the same lens, from a pinhole to the full train: how far its picture is from the
//! full train's, and the time.
//!
//! | model | what it keeps of the lens |
//! |---|---|
//! | `pinhole` | where its entrance pupil is, and the scale of the picture |
//! | `thin` | also focal length, f-number and the plane in focus: blur |
//! | `thick` | also how far its pupils are from its principal planes: falloff |
//! | `full` | everything: aberrations, distortion, vignetting, cos⁴ |
//!
//! All of them are registered: the same pixel looks along the same paraxial chief ray. `thin` and
//! `thick` are the approximations of C. Kolb, D. Mitchell and P. Hanrahan, "A realistic camera model
//! for computer graphics", 1995.

use etendue_camera::lens::PlacedSpec;
use etendue_camera::lens::focused::View;
use etendue_camera::{
    Camera, CameraSpec, IntrinsicsSpec, LensCamera, PinholeSpec, PixelOrigin, PoseSpec, Sampler,
    SensorSpec, ThinLensCameraSpec,
};
use etendue_geometry::Bounds;
use etendue_geometry::units::{Micrometres, Millimetres};
use etendue_optics::element::{ElementSpec, PartSpec};
use etendue_scene::file::LightPrecision;
use serde::Serialize;

use crate::pictures::{Studio, opened};
use crate::samplers::{Converged, Effort, Entry, take_pictures};
use crate::timing::TimeSpread;
use crate::{BenchError, Progress};

/// What was measured of one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cameras {
    /// Columns and rows of the pictures.
    pub resolution: [u32; 2],
    /// The picture through the full train that others are compared with.
    pub converged: Converged,
    /// Each model × number of samples.
    pub findings: Vec<Finding>,
    /// Models that there are not of this lens, and why.
    pub notes: Vec<String>,
}

/// What was measured of one model at one number of samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// `pinhole`, `thin`, `thick` or `full`.
    pub model: &'static str,
    /// Samples a pixel.
    pub samples: u32,
    /// Wall time of tracing the picture on all threads (s).
    pub seconds: TimeSpread,
    /// The root of the mean squared difference to the full train's converged picture.
    pub rmse: f64,
    /// The same over the mean of that picture.
    pub relative_rmse: f64,
}

/// Renders through every model of the scene's lens in turn.
///
/// # Errors
///
/// [`BenchError::NoLens`] when the camera has none; when the scene cannot be rendered, or `progress`
/// asks to stop.
pub fn measure(
    studio: &mut Studio<'_>,
    effort: &Effort,
    progress: Progress<'_>,
) -> Result<Cameras, BenchError> {
    let rounds = effort.rounds.max(1);
    let own: f64 = effort.counts.iter().map(|&n| f64::from(n)).sum();
    let all = f64::from(effort.converged) + own * (rounds * 4) as f64;
    studio.fit(all, effort.seconds)?;
    let full = studio.camera().clone();
    let (models, notes) = models(&full)?;
    let converged = Converged::render(studio, &full, effort.converged)?;
    let mut entries: Vec<Entry<usize>> =
        (0..models.len()).flat_map(|model| Entry::each(model, &effort.counts)).collect();
    let way = |of: &usize| (&models[*of].1, (Sampler::Sobol, LightPrecision::Auto));
    take_pictures(studio, &mut entries, (effort, &converged, all), &way, progress)?;
    let finding = |entry: &Entry<usize>| {
        let rmse = entry.rmse();
        Some(Finding {
            model: models[entry.of].0,
            samples: entry.samples,
            seconds: entry.seconds.spread()?,
            rmse,
            relative_rmse: rmse / converged.mean,
        })
    };
    let findings = entries.iter().filter_map(finding).collect();
    Ok(Cameras { resolution: full.resolution(), converged, findings, notes })
}

/// A model of a lens: what it is called, and its camera.
pub type LensModel = (&'static str, Camera);

/// All models of a camera's lens, the simplest first, and what is missing for which reason.
///
/// # Errors
///
/// [`BenchError::NoLens`] when the camera has none, or one without a finite entrance pupil or focal
/// length.
pub fn models(full: &Camera) -> Result<(Vec<LensModel>, Vec<String>), BenchError> {
    let lens = full.lens().ok_or(BenchError::NoLens("the camera has none"))?;
    let gauss = Gauss::of(full, lens)?;
    let mut models = Vec::new();
    let mut notes = Vec::new();
    let specs = [
        ("pinhole", Ok(CameraSpec::Pinhole(gauss.pinhole()))),
        ("thin", gauss.thin().map(CameraSpec::ThinLens)),
        ("thick", gauss.thick().map(CameraSpec::ThinLens)),
    ];
    for (name, spec) in specs {
        let build = |spec: CameraSpec| {
            let camera = spec.build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned()));
            opened(&camera.map_err(|e| e.to_string())?).map_err(|e| e.to_string())
        };
        match spec.map_err(str::to_owned).and_then(build) {
            Ok(camera) => models.push((name, camera)),
            Err(why) => notes.push(format!("no `{name}` model of this lens: {why}")),
        }
    }
    models.push(("full", full.clone()));
    Ok((models, notes))
}

/// Pixels of a picture for a slope of 1 near the axis; `None` of a camera without a lens, or with a
/// telecentric one.
pub(crate) fn scale(camera: &Camera) -> Option<f64> {
    match camera.lens()?.focused().view() {
        View::Perspective(k) => Some(k.focal[0]),
        View::Parallel { .. } => None,
    }
}

/// What is known of a lens near its axis.
struct Gauss {
    pose: PoseSpec,
    resolution: [u32; 2],
    /// Focal length of the picture (pixels).
    scale: f64,
    /// Where the axis meets the sensor (pixels from the corner).
    centre: [f64; 2],
    /// Focal length and diameter of the entrance pupil (mm).
    focal: f64,
    pupil: f64,
    /// From the front principal plane back to the entrance pupil (mm).
    pupil_behind_front: f64,
    /// From the rear principal plane back to the exit pupil, and its diameter (mm).
    exit: Option<[f64; 2]>,
    /// The plane in focus (m) from the entrance pupil.
    focus: f64,
}

impl Gauss {
    fn of(full: &Camera, lens: &LensCamera) -> Result<Self, BenchError> {
        let focused = lens.focused();
        let paraxial = focused.paraxial();
        let View::Perspective(k) = focused.view() else {
            return Err(BenchError::NoLens("its entrance pupil is at infinity"));
        };
        let missing = BenchError::NoLens("it has no focal length or no entrance pupil");
        let (Some(focal), Some(front), Some(rear), Some(z), Some(pupil)) = (
            paraxial.efl,
            paraxial.front_principal_z,
            paraxial.rear_principal_z,
            paraxial.entrance_pupil.z,
            paraxial.entrance_pupil.diameter,
        ) else {
            return Err(missing);
        };
        let exit = paraxial.exit_pupil.z.zip(paraxial.exit_pupil.diameter);
        Ok(Self {
            pose: PoseSpec::from(*full.pose()),
            resolution: full.resolution(),
            scale: k.focal[0],
            centre: k.centre,
            focal,
            pupil,
            pupil_behind_front: z - front,
            exit: exit.map(|(z, diameter)| [z - rear, diameter]),
            focus: focused.object_distance(),
        })
    }

    fn pinhole(&self) -> PinholeSpec {
        let [cx, cy] = self.centre;
        let intrinsics = IntrinsicsSpec {
            fx: self.scale,
            fy: self.scale,
            cx,
            cy,
            skew: 0.0,
            pixel_origin: PixelOrigin::Corner,
        };
        PinholeSpec {
            intrinsics: Some(intrinsics),
            pose: Some(self.pose.clone()),
            sensor: SensorSpec::new(self.resolution),
            ..PinholeSpec::default()
        }
    }

    /// A thin lens that stands where the entrance pupil is.
    fn thin(&self) -> Result<ThinLensCameraSpec, &'static str> {
        self.lens(0.0, Vec::new())
    }

    /// A thin lens in the principal planes' place, and the stop where a pupil is.
    fn thick(&self) -> Result<ThinLensCameraSpec, &'static str> {
        // Of the two images of the stop, one is on its own side of the lens, where a stop can stand.
        let (at, diameter) = match self.exit {
            _ if self.pupil_behind_front <= 0.0 => (self.pupil_behind_front, self.pupil),
            Some([z, diameter]) if z >= 0.0 => (z, diameter),
            _ => return Err("its pupils are on the wrong sides of the principal planes"),
        };
        let stop = ElementSpec::new(PartSpec::circular(0.5 * diameter), 0.0).as_stop();
        let stop = PlacedSpec { at: Millimetres(at), element: stop };
        self.lens(self.pupil_behind_front, vec![stop])
    }

    /// A thin lens whose entrance pupil lies `pupil` (mm) behind it, and what else is on its axis.
    /// Its pixels are as large as the scale of the picture asks for.
    fn lens(
        &self,
        pupil: f64,
        elements: Vec<PlacedSpec>,
    ) -> Result<ThinLensCameraSpec, &'static str> {
        // From the lens to the plane in focus, and to its image (mm).
        let object = 1e3 * self.focus - pupil;
        let image =
            if object.is_finite() { 1.0 / (1.0 / self.focal - 1.0 / object) } else { self.focal };
        // A slope of 1 through the pupil meets the lens at −pupil, is bent, and goes on to the image.
        let height = image * (1.0 + pupil / self.focal) - pupil;
        let pitch = (height / self.scale).abs();
        if !(pitch > 0.0 && pitch.is_finite() && image > 0.0) {
            return Err("a thin lens of its focal length has no image there");
        }
        let middle = self.resolution.map(|side| 0.5 * f64::from(side));
        let sensor_decentre = [self.centre[0] - middle[0], self.centre[1] - middle[1]];
        let sensor_decentre = sensor_decentre.map(|pixels| pixels * pitch);
        let is_alone = elements.is_empty();
        Ok(ThinLensCameraSpec {
            diffraction: false,
            focal_length: Some(Millimetres(self.focal)),
            aperture: None,
            elements,
            f_number: is_alone.then_some(self.focal.abs() / self.pupil),
            focus_distance: None,
            sensor_distance: Some(Millimetres(image)),
            fov: None,
            sensor_height: None,
            sensor_tilt: Default::default(),
            // Behind a lens the picture is upside down.
            sensor_decentre: [Millimetres(sensor_decentre[0]), Millimetres(-sensor_decentre[1])],
            losses: Default::default(),
            pose: Some(self.pose.clone()),
            shutter: None,
            motion: None,
            sensor: SensorSpec {
                resolution: self.resolution,
                pixel_pitch: Some(Micrometres(1e3 * pitch)),
            },
        })
    }
}
