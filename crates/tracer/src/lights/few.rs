//! Scenes with few lights to choose from, and lights that are kept ready.

use super::Lights;
use crate::area_light::AreaLight;
use crate::light::Light;

impl Lights {
    /// What [`Self::pick`] picks by, where that is a short list: the sum of the chances of all lights before
    /// each, and 1 at the end.
    pub(crate) fn few(&self) -> Option<&[f64]> {
        self.sampler.few()
    }

    /// All lights and their bands, if they are few triangles that are kept ready and shine alike all over.
    pub(crate) fn few_triangles(&self) -> Option<(&[Option<AreaLight>], &[f64])> {
        self.few().filter(|_| self.lights.is_empty())?;
        let triangles = self.ready_triangles().filter(|triangles| !triangles.is_empty())?;
        let is_plain = |own: &Option<AreaLight>| own.as_ref().is_some_and(|own| own.is_plain);
        triangles.iter().all(is_plain).then_some((triangles, &*self.area_light_bands))
    }

    /// The emissive triangles, where they are kept ready.
    pub(crate) fn ready_triangles(&self) -> Option<&[Option<AreaLight>]> {
        (self.area_lights.len() == self.triangles.len()).then_some(&*self.area_lights)
    }

    /// What each of those gives off in `count` bands, of those that shine alike all over.
    pub(crate) fn bands_of_triangles(&self, count: usize) -> impl Iterator<Item = &[f64]> {
        self.area_light_bands.chunks(count)
    }

    /// The lights that are no triangles, which come first.
    pub(crate) fn bare(&self) -> &[Light] {
        &self.lights
    }
}
