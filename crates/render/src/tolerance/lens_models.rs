//! Simpler models of a camera's lens, registered: the same pixel of each looks along the same paraxial chief ray.
//!
//! | model | what it keeps of the lens |
//! |---|---|
//! | `pinhole` | where its entrance pupil is, and the scale of the picture |
//! | `opencv` | also its distortion, as [`OpencvFit`] fits it |
//! | `falloff` | also how its light falls off from the axis |
//! | `thin` | of the lens near its axis: focal length, f-number or the mask in its stop, and the plane in focus, so blur |
//! | `thick` | also how far its pupils are from its principal planes |
//! | `undispersed` | all of it, as at its design wavelength |
//!
//! `thin` and `thick` are the approximations of C. Kolb, D. Mitchell and P. Hanrahan, "A realistic camera model
//! for computer graphics", 1995.

use std::path::PathBuf;

use etendue_accel::Accel;
use etendue_camera::lens::PlacedSpec;
use etendue_camera::lens::focused::View;
use etendue_camera::{
    Camera, CameraSpec, IntrinsicsSpec, LensCamera, OpencvFit, PinholeSpec, PixelOrigin, PoseSpec,
    SensorSpec, ThinLensCameraSpec,
};
use etendue_geometry::Bounds;
use etendue_geometry::units::{Micrometres, Millimetres};
use etendue_optics::element::{ApertureSpec, ElementSpec, MaskSpec, Opening, PartSpec, Picture};
use etendue_scene::Scene;
use serde_json::{Value, json};

use super::full_view::{Field, FullView};
use super::taken::{TakenCamera, Tolerance};
use crate::{BandPaths, Plan, RenderError};

pub use super::full_view::scale;
pub use super::taken::LensModelKind;

/// The reason why a camera has no models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("there are no models of the camera's lens: {0}")]
pub struct NoModels(
    /// In words.
    pub &'static str,
);

/// A model of a lens.
#[derive(Debug, Clone, PartialEq)]
pub struct LensModel {
    /// Its kind.
    pub kind: LensModelKind,
    /// With the pose, resolution, shutter and motion of the camera.
    pub camera: Camera,
    /// The keys of a scene that take it.
    pub scene: Value,
    /// True if the pattern of a mask in the lens shows in what is out of focus, which this model lacks.
    pub lacks_mask: bool,
}

/// Models, the simplest first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LensModels {
    /// Those that there are.
    pub models: Vec<LensModel>,
    /// Notes on missing models and the reasons, in sentences.
    pub notes: Vec<String>,
}

impl LensModels {
    /// Adds the camera that `full` is with the projection of `spec`, or why there is none.
    fn add(&mut self, kind: LensModelKind, full: &Camera, spec: Result<CameraSpec, String>) {
        let model = spec.and_then(|spec| model(kind, full, &spec));
        match model {
            Ok(model) => self.models.push(model),
            Err(why) => self.notes.push(format!("no `{kind}` model of this lens: {why}")),
        }
    }
}

/// The model that `full` is with the projection of `spec`.
pub(super) fn model(
    kind: LensModelKind,
    full: &Camera,
    spec: &CameraSpec,
) -> Result<LensModel, String> {
    // A mask in it names the file that was read.
    let camera = spec.build(|| Bounds::EMPTY, &|name: &str| Ok(PathBuf::from(name)));
    let camera = full.seen_through(&camera.map_err(|error| error.to_string())?);
    let camera = match full.lens() {
        Some(lens) => camera.with_lens_accuracy(lens.accuracy()),
        None => camera,
    };
    let scene = serde_json::to_value(spec).map_err(|error| error.to_string())?;
    Ok(LensModel { kind, camera, scene: json!({ "camera": scene }), lacks_mask: false })
}

/// The models of a camera's lens that keep what is known near its axis: pinhole, thin and thick lens.
///
/// # Errors
///
/// [`NoModels`] when the camera has no lens, or one without a finite entrance pupil or focal length.
pub fn near_axis(full: &Camera) -> Result<LensModels, NoModels> {
    let lens = full.lens().ok_or(NoModels("the camera has none"))?;
    let gauss = Gauss::of(full, lens)?;
    let mut found = LensModels::default();
    found.add(LensModelKind::Pinhole, full, Ok(CameraSpec::Pinhole(gauss.pinhole())));
    let lens = |spec: Result<ThinLensCameraSpec, &str>| {
        spec.map(CameraSpec::ThinLens).map_err(str::to_owned)
    };
    found.add(LensModelKind::Thin, full, lens(gauss.thin()));
    found.add(LensModelKind::Thick, full, lens(gauss.thick()));
    let lacks_mask = gauss.mask.is_none() && masks(full).next().is_some();
    let blurred = found.models.iter_mut().filter(|model| model.kind != LensModelKind::Pinhole);
    blurred.for_each(|model| model.lacks_mask = lacks_mask);
    Ok(found)
}

/// OpenCV's camera for a camera's lens, fitted to a tolerance (pixels).
///
/// # Errors
///
/// When there is none, in words.
pub fn opencv(full: &Camera, tolerance: f64) -> Result<(LensModel, CameraSpec), String> {
    let fit = OpencvFit::new(full, tolerance).map_err(|error| error.to_string())?;
    Ok((model(LensModelKind::Opencv, full, &fit.camera)?, fit.camera))
}

/// All of the lens, as at its design wavelength.
#[must_use]
pub fn undispersed(full: &Camera) -> LensModel {
    let scene = json!({ "plan": { "dispersion": false } });
    let (kind, camera) = (LensModelKind::Undispersed, full.without_dispersion());
    LensModel { kind, camera, scene, lacks_mask: false }
}

/// The masks in a camera's lens, by the numbers of their elements.
fn masks(full: &Camera) -> impl Iterator<Item = (usize, &Picture)> {
    let train = full.lens().map(|lens| lens.focused().train());
    let elements = train.into_iter().flat_map(|train| train.elements().iter().enumerate());
    elements.filter_map(|(number, element)| match element.part.opening() {
        Some(Opening::Image(picture)) => Some((number, picture)),
        _ => None,
    })
}

/// The mask of a camera's lens as it is seen in the entrance pupil, where it is alone, in the stop, and not seen
/// upside down.
fn mask_in_pupil(full: &Camera, magnification: Option<f64>) -> Option<MaskSpec> {
    let mut all = masks(full);
    let ((number, picture), None) = (all.next()?, all.next()) else { return None };
    let is_stop = full.lens().is_some_and(|lens| lens.focused().train().stop() == number);
    let scale = 1.0 / magnification.filter(|m| is_stop && *m > 0.0)?;
    let [width, height] = picture.size.map(|side| Millimetres(scale * side));
    Some(MaskSpec { file: picture.file.to_str()?.to_owned(), width, height: Some(height) })
}

/// Data of a lens near its axis.
struct Gauss {
    pose: PoseSpec,
    resolution: [u32; 2],
    /// Focal length of the picture (pixels).
    scale: f64,
    /// Point where the axis meets the sensor (pixels from the corner).
    centre: [f64; 2],
    /// Focal length and diameter of the entrance pupil (mm).
    focal: f64,
    pupil: f64,
    /// The mask of the stop, as it is seen in the entrance pupil.
    mask: Option<MaskSpec>,
    /// From the front principal plane back to the entrance pupil (mm).
    pupil_behind_front: f64,
    /// From the rear principal plane back to the exit pupil, and its diameter (mm).
    exit: Option<[f64; 2]>,
    /// The plane in focus (m) from the entrance pupil.
    focus: f64,
}

impl Gauss {
    fn of(full: &Camera, lens: &LensCamera) -> Result<Self, NoModels> {
        let focused = lens.focused();
        let paraxial = focused.paraxial();
        let View::Perspective(k) = focused.view() else {
            return Err(NoModels("its entrance pupil is at infinity"));
        };
        let missing = NoModels("it has no focal length or no entrance pupil");
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
            mask: mask_in_pupil(full, paraxial.stop_magnification),
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
        // An image of the stop on the sensor's side of the focus would be upside down in the other one.
        if self.mask.is_some() && at > self.focal {
            return Err("its mask is seen upside down from one side");
        }
        let part = match self.mask_of(diameter) {
            Some(mask) => PartSpec::Aperture(ApertureSpec::Image(mask)),
            None => PartSpec::circular(0.5 * diameter),
        };
        let stop = ElementSpec::new(part, 0.0).as_stop();
        let stop = PlacedSpec { at: Millimetres(at), element: stop };
        self.lens(self.pupil_behind_front, vec![stop])
    }

    /// The mask in a pupil of so many mm.
    fn mask_of(&self, diameter: f64) -> Option<MaskSpec> {
        let MaskSpec { file, width, height } = self.mask.clone()?;
        let scaled = |side: Millimetres| Millimetres(side.0 * diameter / self.pupil);
        Some(MaskSpec { file, width: scaled(width), height: height.map(scaled) })
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
        let mask = self.mask.clone().filter(|_| is_alone).map(ApertureSpec::Image);
        Ok(ThinLensCameraSpec {
            diffraction: false,
            focal_length: Some(Millimetres(self.focal)),
            f_number: (is_alone && mask.is_none()).then_some(self.focal.abs() / self.pupil),
            aperture: mask,
            elements,
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

/// Numbers of groups that are tried.
const TRIES: usize = 6;

/// Bands of a lens run together in groups, where the scene is traced for each band. Where bands share the paths of the
/// scene ([`BandPaths::Shared`]), a group would save nothing: each costs as much as a scene traced once for all.
///
/// The camera of `scene` with its bands in as few groups as stay within the tolerance; `None` where the scene is traced
/// once for all bands, or where more than half as many groups as bands are needed.
pub(super) fn fewest_groups(
    scene: &Scene,
    plan: &Plan,
    accel: &dyn Accel,
    tolerance: Tolerance,
) -> Result<Option<TakenCamera>, RenderError> {
    let most = plan.bands.count() / 2;
    let paths = || BandPaths::of(scene, &scene.camera, &plan.bands, plan.stopping, true);
    let can_pay = || most >= 2 && matches!(paths(), BandPaths::Apart(_));
    let Some(two) = scene.camera.with_bands_grouped(2).filter(|_| can_pay()) else {
        return Ok(None);
    };
    // All bands are looked at, by fewer rays: those at the sides of a group are farthest from where they run together.
    let rays = (scene.accuracy.tolerance_rays / 4).max(1);
    let field = Field { bands: usize::MAX, rays, ..Field::QUICK };
    let view = FullView::new(scene, accel, &plan.bands, field)?;
    // Displacements within a group go as its width.
    let found = view.finding(LensModelKind::Grouped, &two, tolerance)?;
    if found.is_within {
        return Ok(Some(TakenCamera { camera: two, finding: found }));
    }
    let wanted = 2.0 * found.displacement() / tolerance.pixels;
    let first = match wanted.is_finite() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "few")]
        true => (wanted.ceil() as usize).max(3),
        false => return Ok(None),
    };
    for count in (first..=most).take(TRIES) {
        let Some(camera) = scene.camera.with_bands_grouped(count) else { break };
        let finding = view.finding(LensModelKind::Grouped, &camera, tolerance)?;
        if finding.is_within {
            return Ok(Some(TakenCamera { camera, finding }));
        }
    }
    Ok(None)
}
