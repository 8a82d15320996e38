//! Boundaries between media that paths cross, and what media take from light, by Beer and Lambert
//! (`KHR_materials_volume`).

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, HitPrecision, RayBatch};

use super::media::{CoincidentBoundary, Media, MediumInterface};
use super::{PathRays, Tracing};
use crate::Ior;
use crate::surface::SurfaceInteraction;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// The media on both sides of a boundary that a path in `media` met, which is told of them; `None` where it parts
    /// none, or where nothing asks for them.
    pub(super) fn cross(
        &self,
        media: Media,
        placement: u32,
        coincident: CoincidentBoundary,
        interaction: &mut SurfaceInteraction<'_>,
    ) -> Option<MediumInterface> {
        if !interaction.material.scattering.is_body() || !self.ctx.traits.has_media {
            return None;
        }
        let placed = self.ctx.placed;
        let crossing = MediumInterface::of(media, placement, coincident, interaction.front, placed);
        let [outside, inside] = [crossing.outside, crossing.inside].map(|m| m.medium(placed));
        interaction.media = if interaction.front { [outside, inside] } else { [inside, outside] };
        Some(crossing)
    }

    /// Effect that is left of a boundary whose media on both sides are the same; `None` of one that is there.
    pub(super) fn vanishes(
        &self,
        placement: u32,
        interaction: &SurfaceInteraction<'_>,
    ) -> Option<NullBoundary> {
        let body = self.ctx.placed.get(placement)?.body?;
        let [here, behind] = interaction.media;
        if !body.may_vanish {
            return None;
        }
        if here == behind {
            return Some(NullBoundary { is_tinted: false });
        }
        let scene = &self.ctx.scene;
        let index = |medium| scene.index(medium);
        let air = Ior::Constant(1.0);
        let [here, behind] = [here, behind].map(|medium| index(medium).unwrap_or(&air));
        (here == behind).then_some(NullBoundary { is_tinted: true })
    }

    /// The other boundary at a point of one that a ray along `direction` hit.
    pub(super) fn coincident_at(
        &self,
        point: DVec3,
        direction: DVec3,
        own: [u32; 2],
    ) -> CoincidentBoundary {
        /// Shares of a triangle beyond its edges, as the point is known to no more.
        const BEYOND: f64 = 1e-6;
        let geometry = self.ctx.scene.geometry;
        let touching = &self.ctx.placed.touching;
        for [placement, triangle] in touching.others_near(own, point, f64::INFINITY) {
            let placed = &geometry.placements[placement as usize];
            let corners = geometry.mesh_of(placed).corners(triangle as usize);
            let [a, b, c] = corners.map(|corner| placed.world_from_mesh.point(corner));
            let normal = (b - a).cross(c - a);
            // Planes that single precision cannot tell apart may be.
            let other = self.ctx.placed.get(placement).map_or(DVec3::ZERO, |p| p.magnitudes);
            let error = self.ctx.roundings() * (point.abs() + other).element_sum();
            if normal.dot(point - a).abs() > error * normal.length() {
                continue;
            }
            let share = |from: DVec3, to: DVec3| {
                (to - from).cross(point - from).dot(normal) / normal.length_squared()
            };
            if [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| share(from, to) >= -BEYOND) {
                let turned = normal * placed.world_from_mesh.handedness();
                return CoincidentBoundary {
                    placement,
                    triangle,
                    front: turned.dot(direction) <= 0.0,
                };
            }
        }
        CoincidentBoundary::NONE
    }

    /// Takes from light what a medium absorbs over a way (m); nothing over one without end.
    pub(super) fn dim_along(&self, media: &Media, length: f64, light: &mut [f64]) {
        let (placed, spectral) = (self.ctx.placed, self.ctx.spectral);
        let medium = placed.get(media.medium(placed)).and_then(|placed| placed.absorption.as_ref());
        let Some(absorption) = medium.filter(|_| length.is_finite()) else { return };
        let ways = length / absorption.distance;
        let tint = absorption.tint(spectral);
        for (k, band) in light.iter_mut().enumerate() {
            *band *= spectral.tint(&tint, k).max(0.0).powf(ways);
        }
    }

    /// The bodies that hold the origin of each ray: those whose back is the side that is met along a line, both ways.
    /// Empty where none can.
    pub(super) fn media_at_origins(&self, rays: PathRays<'_>) -> Vec<Media> {
        let placed = self.ctx.placed;
        if !self.ctx.traits.has_media || placed.bodies().next().is_none() {
            return Vec::new();
        }
        let (moves, times) = (self.ctx.scene.geometry.moves(), rays.times());
        let holds = |i: usize| {
            let origin = rays.origin(i);
            moves
                || placed.bodies().any(|body| {
                    body.bounds.min.cmple(origin).all() && origin.cmple(body.bounds.max).all()
                })
        };
        let mut media: Vec<Media> = Vec::with_capacity(rays.len());
        let mut last: Option<(DVec3, f64)> = None;
        for i in 0..rays.len() {
            let place = (rays.origin(i), times.get(i).copied().unwrap_or(0.0));
            media.push(match (last, media.last()) {
                (Some(same), Some(&media)) if same == place => media,
                _ if holds(i) => self.media_at(place.0, place.1),
                _ => Media::NONE,
            });
            last = Some(place);
        }
        media
    }

    /// The media at a place (m) at a time (s from the frame's time).
    fn media_at(&self, origin: DVec3, time: f64) -> Media {
        /// A line that no model is likely to have a face or an edge along.
        const LINE: DVec3 = DVec3::new(0.529_1, 0.694_7, 0.487_3);
        let [one, other] =
            [1.0, -1.0].map(|sign| self.backs_along(origin, time, LINE.normalize() * sign));
        let both = one.iter().filter(|body| other.contains(body));
        both.fold(Media::NONE, |media, &body| media.with(body))
    }

    /// The bodies of which a ray meets the back more often than the front.
    fn backs_along(&self, origin: DVec3, time: f64, direction: DVec3) -> Vec<u32> {
        /// By how much of its distance the next surface lies behind one.
        const BEHIND: f64 = 1e-13;
        /// The most surfaces on the way.
        const MOST: u32 = 1024;
        let mut backs: Vec<(u32, i32)> = Vec::new();
        let (mut rays, mut hits) = (RayBatch::default(), HitBatch::new(Detail::Surface));
        let mut start = 0.0;
        for _ in 0..MOST {
            rays.clear();
            rays.precision = HitPrecision::Double;
            rays.push_between(origin, direction, start, f64::INFINITY);
            rays.end_at_times([time].into_iter());
            self.ctx.accel.closest(&rays, &mut hits);
            if !hits.is_hit(0) {
                break;
            }
            let own = [hits.placement[0], hits.triangle[0]];
            let coplanar = self.coincident_at(origin + direction * hits.t[0], direction, own);
            let front = hits.normal(0).dot(direction) <= 0.0;
            for (body, front) in [(own[0], front), (coplanar.placement, coplanar.front)] {
                if self.ctx.placed.get(body).is_none_or(|placed| placed.body.is_none()) {
                    continue;
                }
                let turn = if front { -1 } else { 1 };
                match backs.iter_mut().find(|(own, _)| *own == body) {
                    Some((_, count)) => *count += turn,
                    None => backs.push((body, turn)),
                }
            }
            start = hits.t[0] * (1.0 + BEHIND);
        }
        backs.iter().filter(|(_, count)| *count > 0).map(|&(body, _)| body).collect()
    }
}

/// A boundary that is not there.
#[derive(Debug, Clone, Copy)]
pub(super) struct NullBoundary {
    /// It parts two bodies of one index, and tints what passes; else it lies in a body of higher rank.
    pub(super) is_tinted: bool,
}
