//! The radiance pass: the tracer says what light the rays of the camera carry.

use std::ops::Range;

use etendue_camera::{BandGroup, Camera, PixelSamples, squares, squares_of_pair};
use etendue_tracer::transport::{Parts, RaySamples};
use etendue_tracer::{LayerSpec, LightingContext, Rules, Samples};

use crate::samples::{Averaged, CAMERA_PAIRS, Memory};

/// Samples that are traced together: enough that what is left of a batch after a few bounces still
/// fills packets, and few enough that its arrays stay in the cache.
const BATCH: u32 = 1024;

/// What tracing light needs; nothing of it changes on the way.
#[derive(Debug)]
pub(crate) struct LightPass<'a> {
    pub(crate) stage: LightingContext<'a>,
    pub(crate) tracer: Rules,
    /// The camera, opened for these bands.
    pub(crate) camera: &'a Camera,
    /// The bands that the camera sends separate ways.
    pub(crate) groups: Vec<BandGroup>,
    /// The picture, and the parts of its light that have layers of their own.
    pub(crate) layers: Vec<LayerSpec>,
}

/// The place of a layer among [`Parts`].
fn part(layer: LayerSpec) -> usize {
    match layer {
        LayerSpec::Direct => 1,
        LayerSpec::Indirect => 2,
        _ => 0,
    }
}

/// The random numbers of a batch of rays.
#[derive(Debug, Default)]
pub(crate) struct Numbers {
    /// The pixel's numbers and the sample's index of each sample of the film.
    pub(crate) samples: Vec<(PixelSamples, u32)>,
    /// The sample of each ray.
    of_ray: Vec<u32>,
}

impl Samples for Numbers {
    fn squares(&self, wanted: &[(u32, u32)], out: &mut Vec<[f64; 2]>) {
        let sample_of = |ray: u32| self.samples[self.of_ray[ray as usize] as usize];
        let Some(&(_, pair)) = wanted.first() else { return out.clear() };
        if wanted.iter().all(|&(_, other)| other == pair) {
            let samples = wanted.iter().map(|&(ray, _)| sample_of(ray));
            return squares_of_pair(samples, CAMERA_PAIRS + pair, out);
        }
        let numbered = wanted.iter().map(|&(ray, pair)| {
            let (pixel, index) = sample_of(ray);
            (pixel, index, CAMERA_PAIRS + pair)
        });
        squares(&numbered.collect::<Vec<_>>(), out);
    }
}

impl Averaged for LightPass<'_> {
    fn camera(&self) -> &Camera {
        self.camera
    }

    fn groups(&self) -> &[BandGroup] {
        &self.groups
    }

    fn shape(&self) -> [usize; 2] {
        [self.layers.len(), self.stage.spectral.count()]
    }

    fn batch(&self) -> u32 {
        BATCH
    }

    fn trace(&self, bands: &Range<usize>, memory: &mut Memory) {
        let Memory { rays, numbers, scratch, values, light_in_parts, traffic, .. } = memory;
        numbers.of_ray.clone_from(&rays.sample);
        let parts = if self.layers.len() > 1 { Parts::Scatterings } else { Parts::Whole };
        let beam = RaySamples { rays: &rays.rays, samples: numbers, bands: bands.clone(), parts };
        if parts == Parts::Whole {
            traffic.light += self.tracer.radiance(&self.stage, &beam, scratch, values);
            return;
        }
        traffic.light += self.tracer.radiance(&self.stage, &beam, scratch, light_in_parts);
        let count = self.stage.spectral.count();
        values.clear();
        for ray in light_in_parts.chunks_exact(parts.count() * count) {
            let of = |layer: &LayerSpec| &ray[part(*layer) * count..(part(*layer) + 1) * count];
            self.layers.iter().for_each(|layer| values.extend_from_slice(of(layer)));
        }
    }
}
