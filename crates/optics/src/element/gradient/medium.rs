//! Gradients at one wavelength: in a gap, and before and behind an element.

use glam::DVec3;

use super::GradedGap;
use super::path::{Arrival, OpticalRay};
use crate::element::losses::Loss;
use crate::element::part::Part;
use crate::element::rays::{Clip, Ray};

/// A gap with a gradient at one wavelength, in lens coordinates.
#[derive(Debug, Clone)]
pub(crate) struct GradedMedium {
    /// The gradient and where it begins.
    pub(crate) gap: GradedGap,
    /// z of the vertex that the gap is behind (mm).
    pub(crate) z: f64,
    /// The glass' index.
    pub(crate) base: f64,
    /// The element that the gap is behind, by which a ray that leaves its side is counted.
    pub(crate) element: usize,
    /// The length of the gap (mm).
    pub(crate) length: f64,
}

impl GradedMedium {
    /// About how many steps a ray is followed in.
    pub(crate) fn steps(&self) -> f64 {
        (self.length.abs() / self.gap.gradient.step).ceil()
    }
}

/// The media on both sides of an element, as light meets it, at least one of them a gradient.
#[derive(Debug, Clone)]
pub(crate) struct GradientPair {
    /// The gradients before and behind.
    pub(crate) media: [Option<GradedMedium>; 2],
    /// The indices of the glasses before and behind.
    pub(crate) indices: [f64; 2],
    /// The element's shape.
    pub(crate) part: Part,
    /// Losses of light at the surface, with the indices of the glasses.
    pub(crate) loss: Option<Loss>,
}

impl GradedMedium {
    /// The index at a place of the lens (mm).
    pub(super) fn index(&self, place: DVec3) -> f64 {
        let place = self.own(place);
        self.gap.gradient.field(self.base, place.to_array()).square.max(0.0).sqrt()
    }

    /// A place of the lens in the gradient's own frame.
    fn own(&self, place: DVec3) -> DVec3 {
        let GradedGap { offset, sense, .. } = self.gap;
        DVec3::new(place.x, place.y, offset + sense * (place.z - self.z))
    }

    /// Back into the lens.
    fn lens(&self, place: DVec3) -> DVec3 {
        let GradedGap { offset, sense, .. } = self.gap;
        DVec3::new(place.x, place.y, self.z + sense * (place.z - offset))
    }

    fn turned(&self, direction: DVec3) -> DVec3 {
        DVec3::new(direction.x, direction.y, self.gap.sense * direction.z)
    }

    /// A ray to the surface that `height` (mm) is above.
    pub(super) fn follow(
        &self,
        ray: Ray,
        height: impl Fn(DVec3) -> Option<f64>,
        clip: Clip,
    ) -> Arrival {
        let place = DVec3::from(ray.position);
        let optical = self.turned(ray.direction.into()) * self.index(place);
        let start = OpticalRay { place: self.own(place), optical, path: 0.0, length: 0.0 };
        let own = |place: DVec3| height(self.lens(place)).map(|above| self.gap.sense * above);
        let arrival = self.gap.gradient.to_surface(
            self.base,
            start,
            own,
            clip == Clip::On,
            self.length.abs(),
        );
        match arrival {
            Arrival::On(ray) => Arrival::On(OpticalRay {
                place: self.lens(ray.place),
                optical: self.turned(ray.optical),
                ..ray
            }),
            Arrival::Side(place) => Arrival::Side(self.lens(place)),
            Arrival::Lost => Arrival::Lost,
        }
    }
}
