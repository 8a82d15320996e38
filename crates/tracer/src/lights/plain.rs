//! Scenes whose lights are all plain: triangles that shine alike all over, and lights that are no surfaces. Among these,
//! points that stand still and shine alike to all sides need no more than their place.

use etendue_geometry::glam::DVec3;

use super::Lights;
use crate::area_light::AreaLight;
use crate::light::{Light, LightKind};
use crate::light_tree::Choice;

/// Bounds of all plain lights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlainLightBounds {
    /// The least area of a triangle (m²); infinite without any.
    pub(crate) least_area: f64,
    /// The largest absolute coordinate of what has a place and is no triangle (m).
    pub(crate) farthest: f64,
    /// Some are neither triangles nor points that stand still and shine alike to all sides.
    pub(crate) has_others: bool,
    /// The largest band of those (W/sr, W/m² or W/(m² sr)).
    pub(crate) brightest: f64,
    /// All are far away.
    pub(crate) are_far: bool,
}

/// A light that needs no more than its place.
#[derive(Debug, Clone, Copy)]
pub(crate) enum PlainLight<'a> {
    /// m.
    Point(DVec3),
    Triangle(&'a AreaLight),
}

impl Lights {
    /// What [`Self::pick`] picks by, where that is a short list: the sum of the chances of all lights before
    /// each, and 1 at the end.
    pub(crate) fn few(&self) -> Option<&[f64]> {
        self.sampler.few()
    }

    /// All lights and their bands, if they are few triangles that are kept ready and shine alike all over.
    pub(crate) fn few_triangles(&self) -> Option<(&[Option<AreaLight>], &[f64])> {
        let are_triangles = self.lights.is_empty() && self.plain_lights.is_some();
        let are_taken = are_triangles && self.few().is_some() && !self.triangles.is_empty();
        are_taken.then_some((&*self.area_lights, &*self.area_light_bands))
    }

    /// Tests whether some lights need more than their place.
    pub(crate) fn has_others(&self) -> bool {
        self.plain_lights.is_none_or(|bounds| bounds.has_others)
    }

    /// Chooses a light by a number in 0..1, where all are far away and each is as likely from everywhere; what is left of
    /// the number goes to the choice.
    #[inline(always)]
    pub(crate) fn pick_far(&self, u: f64) -> Choice {
        self.sampler.pick_other((u, 1.0))
    }

    /// Bounds of the lights, if all are plain and kept ready.
    pub(crate) fn plain_lights(&self) -> Option<PlainLightBounds> {
        self.plain_lights
    }

    /// How many lights there are.
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

    /// Light of such a light in each band: the intensity of a point, the radiance of a triangle.
    #[inline(always)]
    pub(crate) fn plain_light_bands(&self, number: usize, count: usize) -> &[f64] {
        match number.checked_sub(self.lights.len()) {
            Some(own) => &self.area_light_bands[own * count..(own + 1) * count],
            None => self.bands_of(number, count),
        }
    }

    /// Bounds of all lights once triangles are kept ready; `None` if one is not plain.
    pub(super) fn bound_plain_lights(&self) -> Option<PlainLightBounds> {
        if self.area_lights.len() != self.triangles.len() {
            return None;
        }
        let mut bounds = PlainLightBounds {
            least_area: f64::INFINITY,
            farthest: 0.0,
            has_others: false,
            brightest: 0.0,
            are_far: self.triangles.is_empty(),
        };
        let count = self.bands.len() / self.lights.len().max(1);
        for (index, light) in self.lights.iter().enumerate() {
            if standing_point(light).is_none() {
                bounds.has_others = true;
                let sky = self.sky.as_ref().filter(|sky| sky.index == index);
                let map = sky.and_then(|sky| sky.map.as_ref());
                let peak = map.map_or(1.0, |(map, _)| f64::from(map.peak));
                let bands = self.bands_of(index, count);
                let most = bands.iter().copied().fold(0.0, f64::max);
                bounds.brightest = bounds.brightest.max(most * peak);
            }
            if let Some(at) = light.kind.place() {
                bounds.are_far = false;
                let at = light.stand(0.0).point(at);
                bounds.farthest = bounds.farthest.max(at.abs().max_element());
            }
        }
        for number in self.lights.len()..self.count() {
            let PlainLight::Triangle(own) = self.plain_light(number)? else { return None };
            bounds.least_area = bounds.least_area.min(own.shape.area);
        }
        Some(bounds)
    }
}

/// Where a light is (m), if it is a point that shines alike to all sides and stands still.
#[inline(always)]
pub(super) fn standing_point(light: &Light) -> Option<DVec3> {
    let LightKind::Point(at) = light.kind else { return None };
    let stands = || !light.moves_within([f64::NEG_INFINITY, f64::INFINITY]);
    match light.motion {
        None => Some(at),
        Some(_) => stands().then(|| light.stand(0.0).point(at)),
    }
}
