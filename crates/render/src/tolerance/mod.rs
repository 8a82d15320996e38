//! The cheapest that stays within a tolerance: models of the camera's lens compared with all of it by what a pixel
//! sees, and the surfaces that light is followed to by what the last ones add.
//!
//! Nothing is approximated unless a scene has the key `tolerance`: [`choose`] then says what is taken of it,
//! [`crate::Plan::taking`] plans with that, and [`verify`] renders a small part with everything.

mod clusters;
mod coarse_images;
mod detail;
mod full_view;
pub mod lens_models;
mod light;
mod pixel_views;
mod small_things;
mod taken;
mod verify;

use etendue_accel::Accel;
use etendue_camera::{Camera, CameraSpec, FalloffSpec, LitPlace, Projection};
use etendue_scene::Scene;
use etendue_tracer::LayerSpec;

use self::lens_models::{LensModel, LensModelKind, LensModels, NoModels};
use self::pixel_views::PlaceView;
use crate::{Plan, RenderError, RenderedScene, Watch};

pub use self::coarse_images::coarse_images;
pub(crate) use self::detail::hidden_offset;
pub use self::detail::{TakenDetail, coarser, with_meshes};
pub use self::full_view::{Field, FullView};
pub use self::taken::{
    Approximations, ModelError, Place, TakenBounces, TakenCamera, Tolerance, Worst,
};
pub use self::verify::{Verified, verify};

impl FullView {
    /// The light of OpenCV's camera in the places of this one: a polynomial of the distance from the axis, by least
    /// squares.
    fn falloff(&self, camera: &Camera) -> Option<FalloffSpec> {
        let light = |seen: &PlaceView| {
            let bands = seen.bands.iter().map(|band| band.light);
            bands.sum::<f64>() / seen.bands.len().max(1) as f64
        };
        let places = self.places.iter().zip(&self.seen);
        let lit = |(place, seen): (&Place, &PlaceView)| LitPlace {
            at: [place.column, place.row],
            light: light(seen),
        };
        let lit: Vec<LitPlace> = places.map(lit).collect();
        let Projection::Pinhole(pinhole) = camera.projection() else { return None };
        FalloffSpec::fitted(&pinhole.intrinsics(), &lit)
    }

    /// All models of the lens, the simplest first, and what is missing.
    ///
    /// # Errors
    ///
    /// [`NoModels`] as [`lens_models::near_axis`].
    pub fn models(&self, tolerance: Tolerance) -> Result<LensModels, NoModels> {
        self.models_of(Sought::All, tolerance)
    }

    /// Those that can be within the tolerance as far as this view tells by itself: where the lens blurs by more, no
    /// model without a pupil, which has no blur at all.
    fn models_in_reach(&self, tolerance: Tolerance) -> Result<LensModels, NoModels> {
        let sought = if self.blur() > tolerance.pixels { Sought::WithPupil } else { Sought::All };
        self.models_of(sought, tolerance)
    }

    fn models_of(&self, sought: Sought, tolerance: Tolerance) -> Result<LensModels, NoModels> {
        let full = &self.camera;
        let LensModels { models: mut near, mut notes } = lens_models::near_axis(full)?;
        let is_pinhole = |model: &&LensModel| model.kind == LensModelKind::Pinhole;
        let after = near.iter().take_while(is_pinhole).count();
        let mut models: Vec<LensModel> = near.drain(..after).collect();
        if sought == Sought::WithPupil {
            models.clear();
        } else {
            match lens_models::opencv(full, tolerance.pixels) {
                Ok((model, spec)) => {
                    let falloff = self.falloff(&model.camera);
                    models.push(model);
                    let with = falloff.and_then(|falloff| with_falloff(full, spec, falloff));
                    models.extend(with);
                }
                Err(error) => notes.push(format!("no `opencv` model of this lens: {error}")),
            }
        }
        models.extend(near);
        let undispersed = lens_models::undispersed(full);
        let groups = |camera: &Camera| camera.band_groups(&self.bands).len();
        let draws =
            |camera: &Camera| camera.lens().map_or(1, |lens| lens.wavelengths_a_group(&self.bands));
        let (own, other) = (full, &undispersed.camera);
        if groups(other) < groups(own) || draws(other) < draws(own) {
            models.push(undispersed);
        }
        Ok(LensModels { models, notes })
    }
}

/// Choice of the models that are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sought {
    All,
    /// Those whose pixels see through an aperture.
    WithPupil,
}

/// OpenCV's camera with a falloff.
fn with_falloff(full: &Camera, spec: CameraSpec, falloff: FalloffSpec) -> Option<LensModel> {
    let CameraSpec::Pinhole(mut spec) = spec else { return None };
    spec.falloff = Some(falloff);
    lens_models::model(LensModelKind::Falloff, full, &CameraSpec::Pinhole(spec)).ok()
}

/// Samples of light in three bands from which on looking for something cheaper can pay: finding out takes as long as
/// some 10⁵.
const WORTH: u64 = 200_000;

/// Chooses what of the tolerance of a scene is used: beside what was left out of its meshes ([`coarser`]), which are
/// those of the scene now, the simplest camera model within what this leaves, and of the light that is left then the
/// fewest surfaces. Says nothing of a scene without a tolerance.
///
/// # Errors
///
/// As a render: when no light gets through the lens, or `watch` asks to stop.
pub fn choose(
    rendered: RenderedScene<'_>,
    plan: &Plan,
    detail: Option<TakenDetail>,
    watch: &dyn Watch,
) -> Result<Option<Approximations>, RenderError> {
    let RenderedScene { scene, accel, images } = rendered;
    let Some(tolerance) = scene.tolerance else { return Ok(None) };
    let mut taken = Approximations::nothing(tolerance, detail);
    taken.images = images.coarser(scene);
    if !plan.layers.contains(&LayerSpec::Radiance) {
        taken.notes.push("no light is rendered: data layers are exact".to_owned());
        return Ok(Some(taken));
    }
    let [width, height] = scene.camera.resolution().map(u64::from);
    let samples = width * height * u64::from(scene.render.samples.typical());
    // What a sample takes grows with its bands.
    if samples.saturating_mul(plan.bands.count().max(3) as u64 / 3) < WORTH {
        let why = format!("{samples} samples of light are too few for looking to pay");
        taken.notes.push(why);
        return Ok(Some(taken));
    }
    let mut left = Tolerance::from(tolerance);
    let [pixels, light] = detail.map_or([0.0; 2], |detail| [detail.displacement, detail.light]);
    left.pixels -= pixels;
    left.light = Some((tolerance.light.0 - light).max(0.0));
    taken.camera = simplest(scene, plan, accel, left, &mut taken.notes)?;
    let of_lens = taken.camera.as_ref().map_or(0.0, |camera| camera.finding.light.value);
    let light_left = (tolerance.light.0 - light - of_lens).max(0.0);
    taken.bounces = light::fewest(rendered, light_left, samples, &mut taken.notes, watch)?;
    Ok(Some(taken))
}

/// The simplest model of the camera's lens within the tolerance.
fn simplest(
    scene: &Scene,
    plan: &Plan,
    accel: &dyn Accel,
    tolerance: Tolerance,
    notes: &mut Vec<String>,
) -> Result<Option<TakenCamera>, RenderError> {
    let Some(lens) = scene.camera.lens() else { return Ok(None) };
    if lens.lenslets().is_some() || scene.camera.light_field().is_some() {
        notes.push("lenslets cut the picture up, which no simpler lens does".to_owned());
        return Ok(None);
    }
    if scene.camera.diffracts() {
        notes.push("light is spread by the waves of this very lens".to_owned());
        return Ok(None);
    }
    let field = Field { rays: scene.accuracy.tolerance_rays, ..Field::QUICK };
    let view = FullView::new(scene, accel, &plan.bands, field)?;
    let models = match view.models_in_reach(tolerance) {
        Ok(found) => found.models,
        Err(error) => {
            notes.push(error.to_string());
            return Ok(None);
        }
    };
    // The root mean square of a blur says nothing of the pattern in it.
    for LensModel { kind, camera, .. } in models.into_iter().filter(|model| !model.lacks_mask) {
        if view.chief_displacement(&camera) > tolerance.pixels {
            continue;
        }
        let Ok(finding) = view.finding(kind, &camera, tolerance) else { continue };
        if finding.is_within {
            return Ok(Some(TakenCamera { camera, finding }));
        }
    }
    let grouped = lens_models::fewest_groups(scene, plan, accel, tolerance)?;
    if grouped.is_none() {
        notes.push("no simpler model of the lens is within it".to_owned());
    }
    Ok(grouped)
}
