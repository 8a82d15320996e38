//! Surfaces that paths meet by themselves, and the light of those that shine.

use etendue_geometry::PlacedTriangle;
use etendue_geometry::glam::DVec3;

use super::{LightingContext, Tracing};
use crate::Scattering;
use crate::footprint::Footprint;
use crate::light_sampler::Receiver;
use crate::reference::SurfacePoint;
use crate::sampling::power_heuristic;

/// Hit of a ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayHit {
    /// Start of the ray (m).
    pub(crate) origin: DVec3,
    /// Direction of the ray (unit).
    pub(crate) direction: DVec3,
    /// Placement and triangle.
    pub(crate) id: PlacedTriangle,
    /// Of the second and the third corner.
    pub(crate) weights: [f64; 2],
    /// From where the ray starts (m).
    pub(crate) t: f64,
    /// Of the triangle (unit), on its front.
    pub(crate) normal: DVec3,
    /// Time (s from the frame's time).
    pub(crate) time: f64,
}

/// Way in which a path came to its direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way {
    /// Density (1/sr) of the direction; unused where it is specular.
    pub(super) pdf: f64,
    /// No light was asked in its stead: it is the camera's, a mirror's or a smooth boundary's.
    pub(super) is_specular: bool,
    /// Of the surface that it left, by which lights were chosen for it ([`Receiver::normal`]).
    pub(super) normal: [f32; 3],
}

impl Way {
    pub(super) const CAMERA: Self = Self { pdf: 0.0, is_specular: true, normal: [0.0; 3] };

    /// The point (m) that it left, as lights were chosen for it.
    pub(super) fn receiver(self, point: DVec3) -> Receiver {
        Receiver { point, normal: self.normal.map(f64::from).into() }
    }

    /// The weight of light that was met, of no specular way, against having asked for it with density `pdf` (1/sr).
    fn weight_against(self, pdf: f64) -> f64 {
        power_heuristic(self.pdf, if pdf.is_finite() { pdf } else { 0.0 })
    }
}

/// A surface that a path met by itself.
pub(super) struct Encounter {
    pub(super) hit: RayHit,
    /// Point where the path left the last surface that scattered it, as lights were chosen for it.
    pub(super) receiver: Receiver,
}

impl Encounter {
    /// Tests whether it is the front of the triangle that was met.
    pub(super) fn is_front(&self) -> bool {
        self.hit.normal.dot(self.hit.direction) <= 0.0
    }
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// The light of a surface that was met, and its weight against having asked for it; `None` if there is none.
    pub(super) fn light_of_hit(
        &self,
        encounter: &Encounter,
        way: Way,
        footprint: impl Fn() -> Option<Footprint>,
        radiance: &mut [f64],
    ) -> Option<f64> {
        let LightingContext { lights, scene, spectral, .. } = self.ctx;
        let Encounter { hit, receiver } = encounter;
        let is_front = encounter.is_front();
        if let Some(index) = lights.index_of(hit.id)
            && let Some((area_light, bands)) = lights.plain_triangle(index, self.count())
        {
            if !is_front && !area_light.two_sided {
                return None;
            }
            radiance.copy_from_slice(bands);
            if way.is_specular {
                return Some(1.0);
            }
            let cosine = hit.direction.dot(area_light.shape.normal).abs();
            let distance = hit.t + (hit.origin - receiver.point).length();
            let density = distance * distance / (cosine * area_light.shape.area);
            return Some(way.weight_against(lights.chance(receiver, index) * density));
        }
        let placement = scene.geometry.placements.get(hit.id[0] as usize)?;
        let [u, v] = hit.weights;
        let corner = SurfacePoint::corner(scene.geometry, placement, hit.id[1] as usize);
        let (weights, footprint) = ([1.0 - u - v, u, v], footprint());
        let point = SurfacePoint { weights, time: hit.time, footprint, ..corner };
        let material = scene.material(&point)?;
        if material.scattering == Scattering::Unlit {
            let (tint, alpha) = scene.base_tint(spectral, material, &point);
            spectral.spread_tint(&tint, radiance);
            let is_there = is_front || !material.one_sided;
            return (way.is_specular && is_there).then(|| material.alpha.opacity(alpha));
        }
        if !lights.emitted(scene, spectral, &point, is_front, radiance) {
            return None;
        }
        if way.is_specular {
            return Some(1.0);
        }
        let pdf = lights.pdf_of_surface(scene, hit.id[0], &point, receiver, hit.direction);
        Some(way.weight_against(pdf))
    }
}
