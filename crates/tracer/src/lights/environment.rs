//! The environment among the lights, and its light that comes from a direction.

use etendue_geometry::glam::DVec3;

use super::Lights;
use crate::environment::place;
use crate::light_tree::Choices;
use crate::sky::Spectra;
use crate::{Color, Spectral};

impl Lights {
    /// True if light comes from where nothing is.
    #[must_use]
    pub fn has_environment(&self) -> bool {
        self.sky.is_some()
    }

    /// The chance with which [`Self::pick`] picks the sky for a point that chose.
    pub(crate) fn chance_of_sky(&self, choices: &Choices, number: usize) -> f64 {
        let sky = self.sky.as_ref();
        sky.map_or(0.0, |sky| self.sampler.chance_of_other(choices, number, sky.index))
    }

    /// The group of the sky.
    pub(crate) fn group_of_sky(&self) -> u32 {
        self.groups.of_light(self.sky.as_ref().map_or(0, |sky| sky.index))
    }

    /// Radiance that the camera sees along the unit `direction` where nothing is.
    pub(crate) fn backdrop(&self, spectral: &Spectral, direction: DVec3, radiance: &mut [f64]) {
        let Some(sky) = self.sky.as_ref().filter(|sky| sky.visible) else { return };
        match &sky.map {
            None => radiance.copy_from_slice(self.bands_of(sky.index, radiance.len())),
            Some((map, _)) => {
                let at = place(sky.world_from_map.transpose() * direction);
                self.spread_sky(spectral, at, &map.radiance_at(at), radiance);
            }
        }
    }

    /// The environment's image at a place where it has this colour, in all bands: by its spectra where it has some.
    pub(crate) fn spread_sky(
        &self,
        spectral: &Spectral,
        at: [f64; 2],
        color: &Color,
        radiance: &mut [f64],
    ) {
        let Some(sky) = &self.sky else { return };
        let own = self.bands_of(sky.index, radiance.len());
        match (&sky.spectra, &sky.map) {
            (Spectra::ClearSky(rows), Some((map, _))) => {
                let values = map.spectrum_at(at);
                for (band, row) in radiance.iter_mut().zip(rows) {
                    *band = row.iter().zip(values).map(|(row, value)| row * value).sum();
                }
            }
            (Spectra::Texels(texels), Some((map, _))) => map.bands_at(texels, at, radiance),
            (Spectra::Colors, _) | (_, None) => spectral.spread(color, radiance),
        }
        radiance.iter_mut().zip(own).for_each(|(band, own)| *band *= own);
    }
}
