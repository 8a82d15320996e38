//! The environment of a scene: what comes from where nothing is, and directions by how bright it is
//! there, many at a time.

use std::f64::consts::PI;
use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_spectrum::NoOverlap;

use crate::Color;
use crate::environment::{EnvironmentMap, MapSampler, OnMap, place};
use crate::light::{EnvironmentImage, Light, LightKind};
use crate::light_sampler::Receiver;
use crate::lights::Lights;
use crate::sampling::{Frame, cosine_direction, sphere_direction};
use crate::spectral::Spectral;
use crate::spectral_sky::{self, Spectrum};

/// The environment, ready to be asked.
#[derive(Debug)]
pub(crate) struct Sky {
    /// Which of the lights it is.
    pub(crate) index: usize,
    map: Option<(Arc<EnvironmentMap>, MapSampler)>,
    spectra: Spectra,
    world_from_map: DMat3,
    /// The camera sees it.
    pub(crate) visible: bool,
}

/// What the bands of a sky are made of.
#[derive(Debug)]
enum Spectra {
    /// Its colours.
    Colors,
    /// The spectra of a clear sky: a row for each band.
    ClearSky(Vec<Spectrum>),
    /// The texels of a cube in these bands, `[row][column][band]`.
    Texels(Vec<f32>),
}

impl Spectra {
    /// Those of `image` in the bands of a render.
    fn of(image: &EnvironmentImage, spectral: &Spectral) -> Result<Self, NoOverlap> {
        if spectral.is_rgb() {
            return Ok(Self::Colors);
        }
        Ok(match image {
            EnvironmentImage::ClearSky(_) => Self::ClearSky(spectral_sky::rows(spectral.bands())?),
            EnvironmentImage::Cube(cube) => {
                cube.overlaps(spectral.bands())?;
                Self::Texels(cube.in_bands(spectral.bands()))
            }
            EnvironmentImage::Constant | EnvironmentImage::Studio | EnvironmentImage::File(_) => {
                Self::Colors
            }
        })
    }

    /// What directions of `map` are chosen by: how bright it is in the bands, which need not be seen.
    fn sampler(&self, map: &EnvironmentMap, count: usize) -> MapSampler {
        let Self::Texels(texels) = self else { return MapSampler::new(map) };
        let mean = |texel: &[f32]| texel.iter().map(|v| f64::from(*v)).sum::<f64>() / count as f64;
        MapSampler::by_brightness(map.size(), texels.chunks_exact(count).map(mean))
    }
}

/// Directions that are asked together; kept for the next.
#[derive(Debug, Default)]
pub(crate) struct Asked {
    /// Lanes and the chance of each.
    lanes: Vec<(usize, f64)>,
    squares: Vec<[f64; 2]>,
    /// With which the sky is chosen for each direction that was met.
    chances: Vec<f64>,
    there: OnMap,
}

impl Asked {
    pub(crate) fn clear(&mut self) {
        self.lanes.clear();
        self.squares.clear();
    }

    /// Adds a lane that chose the sky.
    pub(crate) fn push(&mut self, lane: usize, square: [f64; 2], chance: f64) {
        self.lanes.push((lane, chance));
        self.squares.push(square);
    }
}

impl Sky {
    /// That of `lights`; `map` is its decoded image, if it has one.
    ///
    /// # Errors
    ///
    /// When a clear sky or a cube is known at no wavelength of the bands.
    pub(crate) fn of(
        lights: &[Light],
        map: Option<Arc<EnvironmentMap>>,
        spectral: &Spectral,
    ) -> Result<Option<Self>, NoOverlap> {
        let first = lights.iter().enumerate().find_map(|(index, light)| match &light.kind {
            LightKind::Environment { image, turn, visible } => {
                Some((index, image, *turn, *visible))
            }
            _ => None,
        });
        let Some((index, image, world_from_map, visible)) = first else { return Ok(None) };
        let spectra = Spectra::of(image, spectral)?;
        let sampled = |map: Arc<EnvironmentMap>| {
            let sampler = spectra.sampler(&map, spectral.count());
            (map, sampler)
        };
        let map = map.map(sampled);
        Ok(Some(Self { index, map, spectra, world_from_map, visible }))
    }

    /// The mean over all directions of what its image has, or 1.
    pub(crate) fn mean(&self) -> f64 {
        self.map.as_ref().map_or(1.0, |(_, sampler)| sampler.mean)
    }

    /// Chooses the directions of the lanes that were pushed, by brightness: `each` gets a lane, its unit
    /// direction with the density of that (1/sr), its place on the map, and the colour there.
    pub(crate) fn choose(
        &self,
        asked: &mut Asked,
        mut each: impl FnMut(usize, (DVec3, f64), ([f64; 2], &Color)),
    ) {
        let Some((map, sampler)) = &self.map else { return };
        let Asked { lanes, squares, there, .. } = asked;
        sampler.sample(map, squares, there);
        let lit = there.places.iter().copied().zip(&there.colors);
        let chosen = there.directions.iter().zip(&there.densities);
        for ((&(lane, chance), (&local, &pdf)), lit) in lanes.iter().zip(chosen).zip(lit) {
            each(lane, (self.world_from_map * local, pdf * chance), lit);
        }
    }
}

/// A direction to a sky that is alike all over, for a point, and its density (1/sr): by the cosine where the point
/// gets light from one side alone, else any.
pub(crate) fn uniform_direction(receiver: &Receiver, square: [f64; 2]) -> (DVec3, f64) {
    if !receiver.is_one_sided() {
        return (sphere_direction(square), 0.25 / PI);
    }
    let local = cosine_direction(square);
    (Frame::around(receiver.normal).world(local), local.z / PI)
}

/// The density (1/sr) with which [`uniform_direction`] gives a unit direction.
fn uniform_density(receiver: &Receiver, direction: DVec3) -> f64 {
    match receiver.is_one_sided() {
        true => receiver.normal.dot(direction).max(0.0) / PI,
        false => 0.25 / PI,
    }
}

impl Lights {
    /// Radiance that comes to a point from each unit direction without meeting anything, and the density
    /// (1/sr), chance included, with which [`Self::choose`] gives that direction for that point; 0 without a point.
    /// Both go to `each`, with the number of the pair.
    pub(crate) fn environment(
        &self,
        spectral: &Spectral,
        wanted: impl Iterator<Item = (Option<Receiver>, DVec3)>,
        asked: &mut Asked,
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
        let Asked { chances, there, .. } = asked;
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
