//! Derivatives of a ray's path through an element, computed with dual numbers: how where it leaves
//! depends on where it came from.
//!
//! The surface, and which of its crossings it is, are found as for every ray; the kernels are the same.

use super::newton::cross_at;
use super::rays::{Clip, Ray, RayStatus};
use super::real::Real;
use super::refraction::Refraction;
use super::step::{Action, ElementStep};
use super::thin_lens::at_thin_lens;

impl ElementStep {
    /// Takes one ray through the element in any number, as rays without end of the element go; `None` where it does not
    /// go on, and at lenslets and gradients, which have no derivatives here.
    pub(crate) fn run_in<T: Real>(&self, ray: Ray<T>) -> Option<Ray<T>> {
        if self.graded.is_some() || matches!(self.action, Action::Lenslets(_)) {
            return None;
        }
        let found = self.pass_one(ray.value(), Clip::Off);
        if found.status != RayStatus::Exited {
            return None;
        }
        if !self.action.moves() && !matches!(self.action, Action::Turn(_)) {
            return Some(ray);
        }
        let place = self.frame.enter(Ray { position: found.point?, ..ray.value() }).position;
        let passed = self.frame.leave(self.local_in(self.frame.enter(ray), place));
        Some(self.fold.as_ref().map_or(passed, |fold| fold.unfolded(passed)))
    }

    /// A ray in the element's own frame behind it, where it is known to meet it at a place (mm).
    fn local_in<T: Real>(&self, ray: Ray<T>, place: [f64; 3]) -> Ray<T> {
        let open = f64::INFINITY;
        match &self.action {
            Action::Plane(refraction) | Action::Sphere(refraction) | Action::Conic(refraction) => {
                refraction.exactly(ray, open).ray
            }
            Action::Asphere(Refraction { surface, media, .. }) => {
                cross_at(surface, *media, ray, place)
            }
            Action::Biconic { surface, media, .. } => cross_at(surface, *media, ray, place),
            Action::Freeform { surface, media, .. } => cross_at(surface, *media, ray, place),
            Action::ThinLens { power, .. } => at_thin_lens(*power, ray, open).ray,
            Action::Turn(turn) => turn.renewed(ray),
            Action::Opening(_)
            | Action::Filter { .. }
            | Action::Lenslets(_)
            | Action::Shadow(_) => ray,
        }
    }
}
