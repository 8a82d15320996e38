//! The environment of a scene: what comes from where nothing is, and directions by how bright it is
//! there, many at a time.

use std::sync::Arc;

use etendue_geometry::glam::DMat3;
use etendue_spectrum::NoOverlap;

use crate::environment::{EnvironmentMap, MapSampler};
use crate::light::{EnvironmentImage, Light, LightKind};
use crate::spectral::Spectral;
use crate::spectral_sky::{self, Spectrum};

/// The environment, ready to be asked.
#[derive(Debug)]
pub(crate) struct Sky {
    /// Its number among all lights.
    pub(crate) index: usize,
    pub(crate) map: Option<(Arc<EnvironmentMap>, MapSampler)>,
    pub(crate) spectra: Spectra,
    pub(crate) world_from_map: DMat3,
    /// The camera sees it.
    pub(crate) visible: bool,
}

/// The source of the bands of a sky.
#[derive(Debug)]
pub(crate) enum Spectra {
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

    /// The sampler of directions of `map`: by its brightness in the bands, which need not be seen.
    fn sampler(&self, map: &EnvironmentMap, count: usize) -> MapSampler {
        let Self::Texels(texels) = self else { return MapSampler::new(map) };
        let mean = |texel: &[f32]| texel.iter().map(|v| f64::from(*v)).sum::<f64>() / count as f64;
        MapSampler::by_brightness(map.size(), texels.chunks_exact(count).map(mean))
    }
}

impl Sky {
    /// Tests whether its bands are those of its colours.
    pub(crate) fn is_of_colors(&self) -> bool {
        matches!(self.spectra, Spectra::Colors)
    }

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

    /// A bound of what its image has in any band, or 1.
    pub(crate) fn peak(&self) -> f64 {
        let Some((map, _)) = &self.map else { return 1.0 };
        match &self.spectra {
            Spectra::Colors => f64::from(map.peak),
            Spectra::ClearSky(rows) => {
                let of = |row: &Spectrum| {
                    row.iter().zip(&map.spectral_peaks).map(|(row, peak)| row * peak).sum()
                };
                rows.iter().map(of).fold(0.0, f64::max)
            }
            Spectra::Texels(texels) => f64::from(texels.iter().copied().fold(0.0, f32::max)),
        }
    }
}
