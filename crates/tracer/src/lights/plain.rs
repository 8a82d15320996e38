//! Lights that are plain: triangles that shine alike all over and stand still, and points that stand still and shine alike
//! to all sides, which need no more than their place; and what bounds all others.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{MISS, PlacedTriangle};

use super::Lights;
use crate::area_light::{AreaLight, LightTriangle, brightest};
use crate::light::{Light, LightBounds, LightKind};
use crate::light_tree::Choice;
use crate::reference::{SceneView, SurfacePoint};
use crate::sky::Sky;

/// A light that needs no more than its place.
#[derive(Debug, Clone, Copy)]
pub(crate) enum PlainLight<'a> {
    /// m.
    Point(DVec3),
    Triangle(&'a AreaLight),
}

impl Lights {
    /// The short list by which [`Self::pick`] picks, where there is one: the sum of the chances of all lights before
    /// each, and 1 at the end.
    pub(crate) fn few(&self) -> Option<&[f64]> {
        self.sampler.few()
    }

    /// Tests whether some lights need more than their place.
    pub(crate) fn has_others(&self) -> bool {
        self.bounds.has_others
    }

    /// Chooses a light by a number in 0..1, where all are far away and each is as likely from everywhere; what is left of
    /// the number goes to the choice.
    #[inline(always)]
    pub(crate) fn pick_far(&self, u: f64) -> Choice {
        self.sampler.pick_other(u, 1.0)
    }

    /// Bounds of all of them.
    pub(crate) fn bounds(&self) -> &LightBounds {
        &self.bounds
    }

    /// Number of lights.
    pub(crate) fn count(&self) -> usize {
        self.lights.len() + self.triangles.len()
    }

    /// A light that needs no more than its place, by its number; `None` of another.
    #[inline(always)]
    pub(crate) fn plain_light(&self, number: usize) -> Option<PlainLight<'_>> {
        match self.lights.get(number) {
            Some(light) => standing_point(light).map(PlainLight::Point),
            None => {
                let own = self.area_lights.get(number - self.lights.len())?.as_ref();
                own.filter(|own| own.is_plain).map(PlainLight::Triangle)
            }
        }
    }

    /// The placement's triangle that a light is, or [`MISS`].
    pub(crate) fn triangle_of(&self, number: usize) -> PlacedTriangle {
        let own = number.checked_sub(self.lights.len());
        own.and_then(|own| self.triangles.get(own)).copied().unwrap_or([MISS; 2])
    }

    /// Tests whether no direction meets a light by chance.
    pub(crate) fn is_delta(&self, number: usize) -> bool {
        self.lights.get(number).is_some_and(|light| match light.kind {
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Directional { .. } => true,
            LightKind::Environment { .. } => false,
        })
    }

    /// Light of such a light in each band: the intensity of a point, the radiance of a triangle.
    #[inline(always)]
    pub(crate) fn plain_light_bands(&self, number: usize, count: usize) -> &[f64] {
        match number.checked_sub(self.lights.len()) {
            Some(own) => &self.area_light_bands[own * count..(own + 1) * count],
            None => self.bands_of(number, count),
        }
    }

    /// Bounds of all lights once triangles are kept ready; of what moves by where it is within `span` (s from the
    /// frame's time).
    pub(super) fn bound(&self, scene: &SceneView<'_>, span: [f64; 2]) -> LightBounds {
        let mut bounds = LightBounds { are_far: self.triangles.is_empty(), ..LightBounds::NOTHING };
        let count = self.bands.len() / self.lights.len().max(1);
        for (index, light) in self.lights.iter().enumerate() {
            if standing_point(light).is_none() {
                bounds.has_others = true;
                let sky = self.sky.as_ref().filter(|sky| sky.index == index);
                let peak = sky.map_or(1.0, Sky::peak);
                let bands = self.bands_of(index, count);
                let most = bands.iter().copied().fold(0.0, f64::max);
                bounds.brightest = bounds.brightest.max(most * peak);
            }
            if let Some(at) = light.kind.place() {
                bounds.are_far = false;
                let at = light.pose(0.0).point(at);
                bounds.farthest = bounds.farthest.max(at.abs().max_element());
            }
        }
        for (placement, first) in (0_u32..).zip(&self.first) {
            if let Some(first) = first {
                self.bound_surface(scene, span, placement, *first as usize, &mut bounds);
            }
        }
        bounds
    }

    /// Takes the bounds of a placement that shines, by its number, whose triangles are lights from `first` on.
    fn bound_surface(
        &self,
        scene: &SceneView<'_>,
        span: [f64; 2],
        number: u32,
        first: usize,
        bounds: &mut LightBounds,
    ) {
        let placement = &scene.geometry.placements[number as usize];
        let mesh = scene.geometry.mesh_of(placement);
        let time = if placement.motion.is_some() { 0.5 * (span[0] + span[1]) } else { 0.0 };
        let mut are_others = false;
        for triangle in 0..mesh.triangles.len() {
            let area = match self.plain_light(first + triangle) {
                Some(PlainLight::Triangle(own)) => Some(own.shape.area),
                Some(PlainLight::Point(_)) | None => {
                    let corner = SurfacePoint::corner(scene.geometry, placement, triangle);
                    let own = LightTriangle::of(&SurfacePoint { time, ..corner });
                    are_others |= own.is_some();
                    own.map(|own| own.area)
                }
            };
            bounds.least_area = bounds.least_area.min(area.unwrap_or(f64::INFINITY));
        }
        let material = placement.material as usize;
        let emission = scene.materials.get(material).and_then(|own| own.emission.as_ref());
        let Some(emission) = emission.filter(|_| are_others) else { return };
        (bounds.has_others, bounds.has_other_triangles) = (true, true);
        bounds.are_textured |= emission.radiance.needs_uv();
        let brightest = brightest(scene, emission) * self.tints[material].most();
        bounds.brightest = bounds.brightest.max(brightest);
        if let Some(motion) = &placement.motion {
            let swept = motion.swept(mesh.bounds_at_all_times(), span);
            let far = swept.min.abs().max(swept.max.abs()).max_element();
            bounds.farthest = bounds.farthest.max(far);
        }
    }
}

/// The place of a light (m), if it is a point that shines alike to all sides and stands still.
#[inline(always)]
pub(super) fn standing_point(light: &Light) -> Option<DVec3> {
    let LightKind::Point(at) = light.kind else { return None };
    let stands = || !light.moves_within([f64::NEG_INFINITY, f64::INFINITY]);
    match light.motion {
        None => Some(at),
        Some(_) => stands().then(|| light.pose(0.0).point(at)),
    }
}
