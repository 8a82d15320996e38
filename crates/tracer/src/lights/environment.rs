//! The light of an environment: what comes from a direction, and how often it is asked.

use etendue_geometry::glam::DVec3;

use super::Lights;
use crate::environment::place;
use crate::light_sampler::Receiver;
use crate::sky::{SkySamples, Spectra, uniform_density};
use crate::{Color, Spectral};

impl Lights {
    /// Radiance that comes to a point from each unit direction without meeting anything, and the density
    /// (1/sr), chance included, with which [`Self::pick`] and [`Self::place`] give that direction for that point; 0 without a point.
    /// Both go to `each`, with the number of the pair.
    pub(crate) fn environment(
        &self,
        spectral: &Spectral,
        wanted: impl Iterator<Item = (Option<Receiver>, DVec3)>,
        asked: &mut SkySamples,
        radiance: &mut [f64],
        mut each: impl FnMut(usize, f64, &mut [f64]),
    ) {
        let Some(sky) = &self.sky else { return };
        let own = self.bands_of(sky.index, radiance.len());
        let Some((map, sampler)) = &sky.map else {
            for (number, (receiver, direction)) in wanted.enumerate() {
                radiance.copy_from_slice(own);
                let density = receiver.map_or(0.0, |receiver| {
                    uniform_density(&receiver, direction) * self.chance(&receiver, sky.index)
                });
                each(number, density, radiance);
            }
            return;
        };
        let SkySamples { chances, there, .. } = asked;
        let map_from_world = sky.world_from_map.transpose();
        chances.clear();
        there.directions.clear();
        for (receiver, world) in wanted {
            chances.push(receiver.map_or(0.0, |receiver| self.chance(&receiver, sky.index)));
            there.directions.push(map_from_world * world);
        }
        sampler.look_up(map, there);
        let lit = there.places.iter().copied().zip(&there.colors);
        for (number, (lit, (chance, pdf))) in
            lit.zip(chances.iter().zip(&there.densities)).enumerate()
        {
            self.spread_sky(spectral, lit, radiance);
            each(number, chance * pdf, radiance);
        }
    }

    /// Radiance that the camera sees along the unit `direction` where nothing is.
    pub(crate) fn backdrop(&self, spectral: &Spectral, direction: DVec3, radiance: &mut [f64]) {
        let Some(sky) = self.sky.as_ref().filter(|sky| sky.visible) else { return };
        match &sky.map {
            None => radiance.copy_from_slice(self.bands_of(sky.index, radiance.len())),
            Some((map, _)) => {
                let at = place(sky.world_from_map.transpose() * direction);
                self.spread_sky(spectral, (at, &map.radiance_at(at)), radiance);
            }
        }
    }

    /// The environment's image at a place where it has this colour, in all bands: by its spectra where it has some.
    pub(crate) fn spread_sky(
        &self,
        spectral: &Spectral,
        (at, color): ([f64; 2], &Color),
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
