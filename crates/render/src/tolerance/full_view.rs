//! View through all of a camera's lens, which its models are compared with by what a pixel sees.

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_camera::lens::focused::View;
use etendue_scene::Scene;
use etendue_spectrum::Bands;

use super::pixel_views::{LightRay, PlaceView, chief_rays, places, seen};
use super::taken::{LensModelKind, ModelError, Place, Tolerance, Worst};
use crate::RenderError;

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

/// View through all of a camera's lens, which its models are compared with.
#[derive(Debug, Clone)]
pub struct FullView {
    pub(super) camera: Camera,
    pub(super) bands: Bands,
    chosen: Vec<usize>,
    field: Field,
    /// Pixels of a slope of 1.
    scale: f64,
    /// Places of the picture that are compared.
    pub places: Vec<Place>,
    pub(super) seen: Vec<PlaceView>,
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
        let seen = seen(&camera, bands, &chosen, &places, field.rays);
        let scale = scale(&scene.camera).unwrap_or(f64::NAN);
        let bands = bands.clone();
        Ok(Self { camera, bands, chosen, field, scale, places, seen, notes })
    }

    /// The greatest blur of a pixel's light in a band, at any of the depths (pixels).
    pub(super) fn blur(&self) -> f64 {
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
    pub(super) fn chief_displacement(&self, camera: &Camera) -> f64 {
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
        let own = seen(&camera, &self.bands, &self.chosen, &self.places, rays);
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

/// Pixels of a picture for a slope of 1 near the axis; `None` of a camera without a lens, or with a
/// telecentric one.
#[must_use]
pub fn scale(camera: &Camera) -> Option<f64> {
    match camera.lens()?.focused().view() {
        View::Perspective(k) => Some(k.focal[0]),
        View::Parallel { .. } => None,
    }
}
