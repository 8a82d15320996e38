//! A surface or a sheet with a gradient before it, behind it, or on both sides, as one ray meets it.
//!
//! A ray is taken through the gradient to the surface, and refracted there by the indices at that place. The kernels of
//! the surface do both, first with the indices of the glasses to find the place where a ray comes through an even medium.

use glam::DVec3;

use super::medium::{GradedMedium, GradientPair};
use super::path::Arrival;
use crate::element::part::Part;
use crate::element::rays::{Block, Clip, LANES, Ray, RayStatus, Traversal};
use crate::element::refract::IndexPair;
use crate::element::step::{Action, ElementStep};

impl ElementStep {
    /// Takes a block of rays through an element at a gradient, one by one.
    #[cold]
    #[inline(never)]
    pub(crate) fn run_graded(&self, graded: &GradientPair, block: &mut Block, clip: Clip) {
        for lane in 0..LANES {
            if block.outcome[lane] == 0 {
                let traversal = self.graded_one(graded, block.ray(lane), clip);
                let mut ray = traversal.ray;
                if let (RayStatus::Vignetted { .. }, Some(point)) =
                    (traversal.status, traversal.point)
                    && self.moves()
                {
                    ray.position = point;
                }
                block.set_ray(lane, ray);
                block.throughput[lane] *= traversal.transmission;
                block.outcome[lane] = traversal.status.code();
            }
        }
    }

    /// Height of a place of the lens above the element (mm), along the element's axis.
    fn height(&self, part: &Part, place: DVec3) -> Option<f64> {
        let local = self.frame.rotation.transpose() * (place - self.frame.vertex);
        Some(local.z - part.sag([local.x, local.y])?)
    }

    /// The way of a ray through the gradient before the element.
    fn arrival(
        &self,
        graded: &GradientPair,
        medium: &GradedMedium,
        ray: Ray,
        clip: Clip,
    ) -> Arrival {
        medium.follow(ray, |place| self.height(&graded.part, place), clip)
    }

    /// The optical path (mm) through the gradient before the element; `None` without one, or when the ray does not
    /// arrive.
    pub(crate) fn graded_path(&self, ray: Ray) -> Option<f64> {
        let graded = self.graded.as_deref()?;
        let medium = graded.media[0].as_ref()?;
        match self.arrival(graded, medium, ray, Clip::Off) {
            Arrival::On(end) => Some(end.path),
            Arrival::Side(_) | Arrival::Lost => None,
        }
    }

    /// Places (mm) of a ray's way through the gradient before the element, for drawings: `count` of them between its ends.
    pub(crate) fn graded_way(&self, ray: Ray, count: u32) -> Vec<DVec3> {
        let Some((graded, medium)) =
            self.graded.as_deref().and_then(|graded| Some((graded, graded.media[0].as_ref()?)))
        else {
            return Vec::new();
        };
        let place = DVec3::from(ray.position);
        let Arrival::On(end) = self.arrival(graded, medium, ray, Clip::Off) else {
            return Vec::new();
        };
        let between = |i: u32| {
            let z = place.z + (end.place.z - place.z) * f64::from(i) / f64::from(count + 1);
            match medium.follow(ray, |place| Some(place.z - z), Clip::Off) {
                Arrival::On(ray) => Some(ray.place),
                Arrival::Side(_) | Arrival::Lost => None,
            }
        };
        (1..=count).filter_map(between).collect()
    }

    /// One ray through the gradient before the element and the element itself.
    pub(crate) fn graded_one(&self, graded: &GradientPair, ray: Ray, clip: Clip) -> Traversal {
        let element = self.element;
        let [before, behind] = &graded.media;
        let (start, length) = match before {
            None => (ray, 0.0),
            Some(medium) => match self.arrival(graded, medium, ray, clip) {
                Arrival::On(end) => {
                    let direction = end.optical.normalize().to_array();
                    (Ray { position: end.place.to_array(), direction }, end.length)
                }
                Arrival::Side(place) => {
                    let status = RayStatus::Vignetted { element: medium.element };
                    let point = Some(place.to_array());
                    return Traversal { status, ray, point, transmission: 1.0 };
                }
                Arrival::Lost => {
                    let status = RayStatus::Missed { element };
                    return Traversal { status, ray, point: None, transmission: 1.0 };
                }
            },
        };
        let plain = self.pass_one(start, clip);
        let Some(point) = plain.point else { return Traversal { ray, ..plain } };
        let absorbed = graded.loss.as_ref().map_or(1.0, |loss| loss.absorbed(length));
        if !self.moves() {
            // It stays where it looks at the ray.
            let ray = if plain.status == RayStatus::Exited { start } else { ray };
            return Traversal { ray, transmission: plain.transmission * absorbed, ..plain };
        }
        let index = |medium: &Option<GradedMedium>, glass: f64| {
            medium.as_ref().map_or(glass, |medium| medium.index(point.into()))
        };
        let indices = [index(before, graded.indices[0]), index(behind, graded.indices[1])];
        let media = IndexPair::new(indices[0], indices[1]);
        let mut traversal = self.pass_one_with(start, clip, media);
        if traversal.status != RayStatus::Exited {
            return Traversal { ray, ..traversal };
        }
        traversal.transmission *= absorbed;
        if let Some(loss) = &graded.loss {
            traversal.transmission *= loss.between(indices).share(start, traversal.ray);
        }
        traversal
    }

    fn pass_one_with(&self, ray: Ray, clip: Clip, media: IndexPair) -> Traversal {
        let action = self.action.between(media);
        let step = Self { action, graded: None, loss: None, ..self.clone() };
        step.pass_one(ray, clip)
    }
}

impl Action {
    /// The same between other media. What does not refract stays as it is.
    fn between(&self, between: IndexPair) -> Self {
        let mut action = self.clone();
        match &mut action {
            Self::Plane(refraction)
            | Self::Sphere(refraction)
            | Self::Conic(refraction)
            | Self::Asphere(refraction) => refraction.media = between,
            Self::Biconic { media, .. } | Self::Freeform { media, .. } => *media = between,
            Self::ThinLens { .. }
            | Self::Opening(_)
            | Self::Filter { .. }
            | Self::Lenslets(_)
            | Self::Shadow(_)
            | Self::Turn(_) => {}
        }
        action
    }
}
