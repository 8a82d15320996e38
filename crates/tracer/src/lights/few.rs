//! Scenes with few lights to choose from.

use etendue_geometry::glam::DVec3;

use super::Lights;
use crate::area_light::AreaLight;
use crate::light::{Light, LightKind};

/// Few lights: points first, then triangles.
#[derive(Debug)]
pub(crate) struct FewLamps<'a> {
    /// m.
    pub(crate) points: Vec<DVec3>,
    pub(crate) triangles: &'a [Option<AreaLight>],
    /// `[light][band]` of both.
    pub(crate) bands: [&'a [f64]; 2],
    /// The sum of the chances of all before each, and 1 at the end.
    pub(crate) below: &'a [f64],
}

impl Lights {
    /// What [`Self::pick`] picks by, where that is a short list: the sum of the chances of all lights before
    /// each, and 1 at the end.
    pub(crate) fn few(&self) -> Option<&[f64]> {
        self.sampler.few()
    }

    /// All lights and their bands, if they are few triangles that are kept ready and shine alike all over.
    pub(crate) fn few_triangles(&self) -> Option<(&[Option<AreaLight>], &[f64])> {
        let are_alone = self.lights.is_empty() && !self.triangles.is_empty();
        let FewLamps { triangles, bands: [_, bands], .. } =
            if are_alone { self.few_lamps() } else { None }?;
        Some((triangles, bands))
    }

    /// The lights of a scene that has few to choose from, all of them points that stand still or triangles that shine
    /// alike all over and are kept ready.
    pub(crate) fn few_lamps(&self) -> Option<FewLamps<'_>> {
        let below = self.few()?;
        let point = |light: &Light| match &light.kind {
            LightKind::Point(at) => light.motion.is_none().then_some(*at),
            _ => None,
        };
        let points = self.lights.iter().map(point).collect::<Option<Vec<_>>>()?;
        let triangle = |own: &Option<AreaLight>| own.as_ref().is_some_and(|own| own.is_plain);
        let are_ready = self.area_lights.len() == self.triangles.len();
        let are_plain = are_ready && self.area_lights.iter().all(triangle);
        let bands = [&*self.bands, &*self.area_light_bands];
        are_plain.then_some(FewLamps { points, triangles: &self.area_lights, bands, below })
    }
}
