//! The radiance pass: the tracer says what light the rays of the camera carry.

use std::ops::Range;

use etendue_camera::{BandGroup, Camera, PixelSamples, squares_of_pair};
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
    /// Where the bands share rays all the same: how many rows from its own each lands, at most.
    pub(crate) rows: Option<u32>,
    /// The picture, and the parts of its light that have layers of their own.
    pub(crate) layers: Vec<LayerSpec>,
}

impl LightPass<'_> {
    /// Whether a layer counts light of the group of this number: that which one surface scattered at most,
    /// and the rest.
    fn counts(&self, layer: LayerSpec, group: usize) -> [bool; 2] {
        match layer {
            LayerSpec::Direct => [true, false],
            LayerSpec::Indirect => [false, true],
            LayerSpec::LightGroup { group: wanted } => {
                [self.stage.lights.group_number(wanted) == Some(group); 2]
            }
            _ => [true; 2],
        }
    }

    /// Counts what the samples of each pixel bring, that stand side by side.
    fn count_sparkles(&self, memory: &mut Memory) {
        let Memory { numbers, values, traffic, .. } = memory;
        let Some(picture) = self.layers.iter().position(|layer| *layer == LayerSpec::Radiance)
        else {
            return;
        };
        let [layers, bands] = self.shape();
        let light = |ray: usize| -> f64 {
            let start = (ray * layers + picture) * bands;
            values[start..start + bands].iter().sum()
        };
        let pixel = |ray: &usize| numbers.samples[numbers.of_ray[*ray] as usize].0;
        let rays: Vec<usize> = (0..numbers.of_ray.len()).collect();
        let mut of_pixel = Vec::new();
        for run in rays.chunk_by(|a, b| pixel(a) == pixel(b)) {
            of_pixel.clear();
            of_pixel.extend(run.iter().map(|&ray| light(ray)));
            traffic.sparkles.count(&of_pixel);
        }
    }

    /// Adds up the parts of each ray's light, `[ray][part][band]`, that each layer counts.
    fn gather(&self, parts: &[f64], groups: usize, values: &mut Vec<f64>) {
        let count = self.stage.spectral.count();
        values.clear();
        for ray in parts.chunks_exact((1 + 2 * groups) * count) {
            for &layer in &self.layers {
                if layer == LayerSpec::Radiance {
                    values.extend_from_slice(&ray[..count]);
                    continue;
                }
                let start = values.len();
                values.resize(start + count, 0.0);
                let counted = (0..groups).flat_map(|group| self.counts(layer, group));
                let parts = ray[count..].chunks_exact(count).zip(counted);
                for (part, _) in parts.filter(|(_, counts)| *counts) {
                    values[start..].iter_mut().zip(part).for_each(|(sum, band)| *sum += band);
                }
            }
        }
    }
}

/// The random numbers of a batch of rays.
#[derive(Debug, Default)]
pub(crate) struct SampleNumbers {
    /// The pixel's numbers and the sample's index of each sample of the film.
    pub(crate) samples: Vec<(PixelSamples, u32)>,
    /// The sample of each ray.
    of_ray: Vec<u32>,
}

impl Samples for SampleNumbers {
    fn squares_of_pair(&self, rays: &[u32], pair: u32, out: &mut Vec<[f64; 2]>) {
        let samples = rays.iter().map(|&ray| self.samples[self.of_ray[ray as usize] as usize]);
        squares_of_pair(samples, CAMERA_PAIRS + pair, out);
    }
}

impl Averaged for LightPass<'_> {
    fn camera(&self) -> &Camera {
        self.camera
    }

    fn groups(&self) -> &[BandGroup] {
        &self.groups
    }

    fn shared_rows(&self) -> Option<u32> {
        self.rows
    }

    fn is_light(&self) -> bool {
        true
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
        let groups = self.stage.lights.group_count();
        let parts = if self.layers.len() > 1 { Parts::Groups(groups) } else { Parts::Whole };
        let beam = RaySamples { rays: &rays.rays, samples: numbers, bands: bands.clone(), parts };
        let light = if parts == Parts::Whole { &mut *values } else { &mut *light_in_parts };
        traffic.light += self.tracer.radiance(&self.stage, &beam, scratch, light);
        if parts != Parts::Whole {
            self.gather(light_in_parts, groups, values);
        }
        if self.groups.len() == 1 {
            self.count_sparkles(memory);
        }
    }
}
