//! The cheapest that stays within a tolerance: models of the camera's lens compared with all of it by what a pixel
//! sees, and the surfaces that light is followed to by what the last ones add.
//!
//! Nothing is approximated unless a scene has the key `tolerance`: [`choose`] then says what is taken of it,
//! [`crate::Plan::taking`] plans with that, and [`verify`] renders a small part with everything.

mod clusters;
mod coarse_images;
mod detail;
pub mod lens_models;
mod light;
mod pixel_views;
mod place;
mod small_things;
mod verify;

use etendue_accel::Accel;
use etendue_camera::{Camera, CameraSpec, FalloffSpec};
use etendue_scene::Scene;
use etendue_scene::file::ToleranceSpec;
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;
use serde::Serialize;

use self::lens_models::{LensModel, LensModelKind, LensModels, NoModels};
use self::pixel_views::{LightRay, PlaceView, chief_rays, places, seen};
use crate::{Images, Plan, RenderError, Watch};

pub use self::coarse_images::coarse_images;
pub(crate) use self::detail::hidden_offset;
pub use self::detail::{TakenDetail, coarser, with_meshes};
pub use self::place::Place;
pub use self::verify::{Verified, verify};

/// Errors that a model may have.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tolerance {
    /// Of places, blur and shifts of colour (pixels).
    pub pixels: f64,
    /// Of light, as a share of that on the axis; not judged when absent.
    pub light: Option<f64>,
}

/// Fineness of the comparison of models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Columns and rows of places, the picture's corners among them.
    pub size: [u32; 2],
    /// Rays of a place and a group of bands.
    pub rays: u32,
    /// Bands, at most, that are looked at: the first, the last, and some in between.
    pub bands: usize,
    /// Chief rays across the neighbourhood of a place, at most, by which its depths are found: one every two pixels
    /// where that is enough.
    pub across: u32,
}

impl Field {
    /// For a user who compares models.
    pub const FINE: Self = Self { size: [9, 7], rays: 1024, bands: usize::MAX, across: 256 };
    /// For the choice that a render makes before it begins.
    pub const QUICK: Self = Self { size: [9, 7], rays: 256, bands: 3, across: 64 };
    /// For the verification of a choice: places in between, and more bands.
    pub const BETWEEN: Self = Self { size: [16, 12], rays: 256, bands: 5, across: 64 };
}

/// Errors of a model, and its cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelError {
    /// Kind of the model.
    pub model: LensModelKind,
    /// Distance of chief rays from the train's (pixels).
    pub chief_ray: Worst,
    /// Distance of the middle of a pixel's light from the train's (pixels).
    pub centroid: Worst,
    /// The difference of the blur, the root mean square radius of a pixel's light in a band (pixels).
    pub blur: Worst,
    /// The difference of where a band lies among all bands (pixels).
    pub colour: Worst,
    /// The difference of a pixel's light in a band, as a share of that on the axis.
    pub light: Worst,
    /// True if it stays within the tolerance.
    pub is_within: bool,
    /// The time of a sample of a pixel (s); `null` without a picture to time.
    pub seconds_a_sample: Option<f64>,
    /// Speed as a multiple of the full train's.
    pub speed: Option<f64>,
}

impl ModelError {
    /// The greatest displacement, of whatever kind (pixels).
    #[must_use]
    pub fn displacement(&self) -> f64 {
        let all = [self.chief_ray, self.centroid, self.blur, self.colour];
        all.into_iter().map(|worst| worst.value).fold(0.0, f64::max)
    }
}

/// The greatest difference, and where it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Worst {
    /// As the quantity says.
    pub value: f64,
    /// The column and row of its place (pixels from the corner).
    pub at: [f64; 2],
    /// Its depth (m); `null` for infinity, or where the depth plays no part.
    pub depth: Option<f64>,
}

impl Worst {
    fn raise(&mut self, value: f64, place: &Place, nearness: Option<f64>) {
        if value > self.value {
            let depth = nearness.map(|nearness| 1.0 / nearness).filter(|depth| depth.is_finite());
            *self = Self { value, at: [place.column, place.row], depth };
        }
    }
}

/// View through all of a camera's lens, which its models are compared with.
#[derive(Debug, Clone)]
pub struct FullView {
    camera: Camera,
    bands: Bands,
    chosen: Vec<usize>,
    field: Field,
    /// Pixels of a slope of 1.
    scale: f64,
    /// Places of the picture that are compared.
    pub places: Vec<Place>,
    seen: Vec<PlaceView>,
    /// Notes on the view for the user, in sentences.
    pub notes: Vec<String>,
}

impl FullView {
    /// Of the camera of `scene` in `bands`, at the depths that it has behind `accel`.
    ///
    /// # Errors
    ///
    /// When no light gets through the lens.
    pub fn new(
        scene: &Scene,
        accel: &dyn Accel,
        bands: &Bands,
        field: Field,
    ) -> Result<Self, RenderError> {
        let mut places = places(scene, accel, field.size, field.across);
        let mut notes = Vec::new();
        if places.iter().all(|place| place.depths.is_empty()) {
            let in_focus = scene.camera.lens().map(|lens| lens.focused().object_distance());
            notes.push("the camera sees no surface: compared at the distance in focus".to_owned());
            let depth = in_focus.unwrap_or(f64::INFINITY).abs();
            places.iter_mut().for_each(|place| place.depths.push(depth));
        }
        let chosen = some_of(bands.count(), field.bands);
        let camera = open(&scene.camera, bands)?;
        let seen = seen((&camera, bands), &chosen, &places, field.rays);
        let scale = lens_models::scale(&scene.camera).unwrap_or(f64::NAN);
        let bands = bands.clone();
        Ok(Self { camera, bands, chosen, field, scale, places, seen, notes })
    }

    /// The light of OpenCV's camera in the places of this one: a polynomial of the distance from the axis, by least
    /// squares.
    fn falloff(&self, camera: &Camera) -> Option<FalloffSpec> {
        let light = |seen: &PlaceView| {
            let bands = seen.bands.iter().map(|band| band.light);
            bands.sum::<f64>() / seen.bands.len().max(1) as f64
        };
        let places = self.places.iter().zip(&self.seen);
        let lit: Vec<([f64; 2], f64)> =
            places.map(|(place, seen)| ([place.column, place.row], light(seen))).collect();
        FalloffSpec::fitted(camera, &lit)
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

    /// The greatest blur of a pixel's light in a band, at any of the depths (pixels).
    fn blur(&self) -> f64 {
        let of_place = |(seen, place): (&PlaceView, &Place)| {
            let depths = place.depths.iter();
            let of_depth = |depth: &f64| {
                seen.bands.iter().map(|band| band.blur(1.0 / depth)).fold(0.0, f64::max)
            };
            depths.map(of_depth).fold(0.0, f64::max)
        };
        self.scale * self.seen.iter().zip(&self.places).map(of_place).fold(0.0, f64::max)
    }

    /// Greatest distance of the chief rays of `camera` from the view's own (pixels): what is cheap
    /// to find of a model, of which no more needs to be known when this is too far.
    fn chief_displacement(&self, camera: &Camera) -> f64 {
        let own = chief_rays(camera, &self.places);
        let places = own.iter().zip(&self.seen).zip(&self.places);
        let of_place = |((own, full), place): ((&Option<LightRay>, &PlaceView), &Place)| {
            let (Some(own), Some(full)) = (own, &full.chief) else { return 0.0 };
            let depths = place.depths.iter().map(|depth| 1.0 / depth);
            depths.map(|near| (own.at(near) - full.at(near)).length()).fold(0.0, f64::max)
        };
        self.scale * places.map(of_place).fold(0.0, f64::max)
    }

    /// Compares `camera` with the view: what it misses.
    ///
    /// # Errors
    ///
    /// When no light gets through.
    pub fn finding(
        &self,
        model: LensModelKind,
        camera: &Camera,
        tolerance: Tolerance,
    ) -> Result<ModelError, RenderError> {
        let rays = self.field.rays;
        let camera = open(camera, &self.bands)?;
        let own = seen((&camera, &self.bands), &self.chosen, &self.places, rays);
        Ok(self.compared(model, &own, tolerance))
    }

    /// The lens against itself.
    #[must_use]
    pub fn itself(&self, tolerance: Tolerance) -> ModelError {
        self.compared(LensModelKind::Full, &self.seen, tolerance)
    }

    fn compared(
        &self,
        model: LensModelKind,
        own: &[PlaceView],
        tolerance: Tolerance,
    ) -> ModelError {
        let [mut chief_ray, mut centroid, mut blur, mut colour, mut light] = [Worst::default(); 5];
        let scale = self.scale;
        for ((own, full), place) in own.iter().zip(&self.seen).zip(&self.places) {
            // Light depends on the place alone.
            for (a, b) in own.bands.iter().zip(&full.bands) {
                light.raise((a.light - b.light).abs(), place, None);
            }
            // Chief rays, blur and colour also on the depth.
            for &depth in &place.depths {
                let nearness = 1.0 / depth;
                let at = Some(nearness);
                if let (Some(a), Some(b)) = (own.chief, full.chief) {
                    chief_ray.raise(scale * (a.at(nearness) - b.at(nearness)).length(), place, at);
                }
                let (Some(a), Some(b)) = (own.centroid(nearness), full.centroid(nearness)) else {
                    continue;
                };
                centroid.raise(scale * (a - b).length(), place, at);
                for (c, d) in own.bands.iter().zip(&full.bands) {
                    if let (Some(p), Some(q)) = (c.centroid(nearness), d.centroid(nearness)) {
                        blur.raise(scale * (c.blur(nearness) - d.blur(nearness)).abs(), place, at);
                        colour.raise(scale * ((p - a) - (q - b)).length(), place, at);
                    }
                }
            }
        }
        let in_pixels = [chief_ray, centroid, blur, colour];
        let is_within = in_pixels.iter().all(|worst| worst.value <= tolerance.pixels)
            && tolerance.light.is_none_or(|most| light.value <= most);
        ModelError {
            model,
            chief_ray,
            centroid,
            blur,
            colour,
            light,
            is_within,
            seconds_a_sample: None,
            speed: None,
        }
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

fn open(camera: &Camera, bands: &Bands) -> Result<Camera, RenderError> {
    camera.opened(bands).map_err(|error| RenderError::camera(error.why))
}

/// Of so many bands a few numbers: the first, the last, and even ones in between.
fn some_of(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most).map(|k| k * (count - 1) / (most - 1).max(1)).collect()
}

/// Part of a scene's tolerance that is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Approximations {
    /// The tolerance.
    pub tolerance: ToleranceSpec,
    /// The camera that light is sampled by, in the place of the scene's.
    pub camera: Option<TakenCamera>,
    /// Number of surfaces to which light is followed, less than the scene's tracer does.
    pub bounces: Option<TakenBounces>,
    /// Detail that is left out of the scene's meshes.
    pub detail: Option<TakenDetail>,
    /// Number of the scene's images decoded in as few texels as the nearest view can tell apart.
    pub images: usize,
    /// Reasons why not more is used, in sentences.
    pub notes: Vec<String>,
}

impl Approximations {
    /// Nothing but the detail of meshes yet.
    fn nothing(tolerance: ToleranceSpec, detail: Option<TakenDetail>) -> Self {
        Self { tolerance, camera: None, bounces: None, detail, images: 0, notes: Vec::new() }
    }
}

/// A simpler model of a lens that is taken.
#[derive(Debug, Clone, PartialEq)]
pub struct TakenCamera {
    /// The camera.
    pub camera: Camera,
    /// Its errors.
    pub finding: ModelError,
}

/// Fewer surfaces to which light is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TakenBounces {
    /// Number of surfaces to which light is followed.
    pub bounces: u32,
    /// The share of light that the others bring, in 99 % of blocks of 8 × 8 pixels.
    pub share: f64,
}

/// Samples of light in three bands from which on looking for something cheaper can pay: finding out takes as long as
/// some 10⁵.
const WORTH: u64 = 200_000;

/// Chooses what of the tolerance of `scene` is used: beside what was left out of its meshes ([`coarser`]), which are
/// those of `scene` now, the simplest camera model within what this leaves, and of the light that is left then the
/// fewest surfaces. Says nothing of a scene without a tolerance.
///
/// # Errors
///
/// As a render: when no light gets through the lens, or `watch` asks to stop.
pub fn choose(
    scene: &Scene,
    plan: &Plan,
    (accel, images): (&dyn Accel, &Images),
    detail: Option<TakenDetail>,
    watch: &dyn Watch,
) -> Result<Option<Approximations>, RenderError> {
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
    let looked = ((tolerance.light.0 - light - of_lens).max(0.0), samples);
    taken.bounces = light::fewest(scene, (accel, images), looked, &mut taken.notes, watch)?;
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

/// The tolerance of a scene as models are judged by.
impl From<ToleranceSpec> for Tolerance {
    fn from(spec: ToleranceSpec) -> Self {
        Self { pixels: spec.displacement.0, light: Some(spec.light.0) }
    }
}
