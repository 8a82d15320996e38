//! The radiance pass: the tracer says what light the rays of the camera carry.

use std::ops::Range;
use std::sync::Arc;

use etendue_camera::{BandGroup, Camera, CameraRays, FilmSamples};
use etendue_geometry::RayBatch;
use etendue_tracer::transport::{Parts, PathRays, RaySamples};
use etendue_tracer::{LayerSpec, LightGroup, LightingContext, Modulation, Rules};

use crate::sampling::{BlockRays, Memory, SampledQuantity, Sampling};

/// Inputs of tracing light; nothing of them changes on the way.
#[derive(Debug)]
pub(crate) struct LightPass<'a> {
    pub(crate) ctx: LightingContext<'a>,
    pub(crate) tracer: Rules,
    /// The camera, opened for these bands.
    pub(crate) camera: &'a Camera,
    /// Number of bands that are added up: as many as are traced, or as many as land by themselves,
    /// all like the one that is.
    pub(crate) count: usize,
    /// The bands that the camera sends separate ways.
    pub(crate) groups: Vec<BandGroup>,
    /// Greatest number of rows from its own that each band's light lands, where the bands share rays all the same.
    pub(crate) rows: Option<u32>,
    /// Pixels beside each side of the picture from which it lands there.
    pub(crate) margin: u32,
    /// The picture, and the parts of its light that have layers of their own.
    pub(crate) layers: Vec<LayerSpec>,
    /// Rays in blocks, by [`Self::in_blocks`].
    pub(crate) block_rays: Option<BlockRays>,
}

impl LightPass<'_> {
    /// The pass with rays in blocks, where these are all that it asks of the camera, and carriers do not diffuse.
    pub(crate) fn in_blocks(mut self, sampling: Sampling) -> Self {
        let is_one_way = self.groups.len() == 1 && self.rows.is_none() && sampling.diffusion == 0.0;
        let has_parts = self.layers.iter().any(|layer| layer.pupil_part().is_some());
        if is_one_way && !has_parts && self.ctx.fits_single() && !self.ctx.lights.are_modulated() {
            self.block_rays = BlockRays::of(self.camera, self.ctx.accel, self.ctx.precision);
        }
        self
    }

    /// Counts what the samples of each pixel bring, that stand side by side.
    fn count_sparkles(&self, memory: &mut Memory) {
        let Memory { numbers, slots, values, traffic, .. } = memory;
        let Some(picture) = self.layers.iter().position(|layer| *layer == LayerSpec::Radiance)
        else {
            return;
        };
        let [layers, bands] = self.shape();
        let slot = |sample: &u32| slots[*sample as usize];
        let (mut values, all) = (values.as_slice(), layers * bands);
        for run in numbers.of_ray.chunk_by(|a, b| slot(a) == slot(b)) {
            let (of_pixel, rest) = values.split_at(run.len() * all);
            let rays = of_pixel.chunks_exact(all).map(|ray| &ray[picture * bands..][..bands]);
            traffic.sparkles.count(rays.map(|ray| ray.iter().sum::<f64>()));
            values = rest;
        }
    }

    /// Multiplies the parts of each ray's light, `[ray][part][band]`, by the factors of lights that change with time:
    /// where rays have times those of then, else the means over the time for which the ray's row is open, exactly.
    fn modulate(&self, rays: &CameraRays, film: &FilmSamples, parts: &mut [f64]) {
        let count = self.ctx.spectral.count();
        let groups = self.ctx.lights.parts();
        let (mut of, mut factors) = (f64::NAN, Vec::new());
        for (i, ray) in parts.chunks_exact_mut((1 + 2 * groups.len()) * count).enumerate() {
            // Rays of one row, without times, have the same.
            let now = match rays.rays.times().is_empty() {
                true => film.rows[rays.sample[i] as usize].floor() + 0.5,
                false => rays.rays.time(i),
            };
            if now != of {
                of = now;
                let open = match (rays.rays.times().is_empty(), self.camera.shutter()) {
                    (false, _) => vec![[now; 2]],
                    (true, Some(shutter)) => shutter.open_intervals(now),
                    (true, None) => vec![[0.0; 2]],
                };
                let factor = |modulation: &Arc<Modulation>| modulation.mean_over(&open);
                let all =
                    groups.iter().map(|(_, modulation)| modulation.as_ref().map_or(1.0, factor));
                factors.clear();
                factors.extend(all);
            }
            let (whole, parts) = ray.split_at_mut(count);
            whole.fill(0.0);
            for (parts, factor) in parts.chunks_exact_mut(2 * count).zip(&factors) {
                for (k, band) in parts.iter_mut().enumerate() {
                    *band *= factor;
                    whole[k % count] += *band;
                }
            }
        }
    }

    /// Point where a ray crosses the entrance pupil's plane, to the right of its middle and above it (m).
    fn place_in_pupil(&self, rays: &RayBatch, ray: usize) -> [f64; 2] {
        let pose = self.camera.pose();
        let from = rays.origin(ray) - pose.position;
        let direction = rays.direction(ray);
        let way = -from.dot(pose.forward()) / direction.dot(pose.forward());
        let at = from + way * direction;
        [at.dot(pose.right()), at.dot(pose.up())]
    }

    /// Adds up the parts of each ray's light, `[ray][part][band]`, that each layer counts.
    fn gather(&self, rays: &RayBatch, parts: &[f64], values: &mut Vec<f64>) {
        let count = self.ctx.spectral.count();
        let groups = self.ctx.lights.parts();
        values.clear();
        for (number, ray) in parts.chunks_exact((1 + 2 * groups.len()) * count).enumerate() {
            for &layer in &self.layers {
                let is_seen = layer
                    .pupil_part()
                    .is_none_or(|part| part.contains(self.place_in_pupil(rays, number)));
                if layer == LayerSpec::Radiance || (layer.pupil_part().is_some() && is_seen) {
                    values.extend_from_slice(&ray[..count]);
                    continue;
                }
                if !is_seen {
                    values.resize(values.len() + count, 0.0);
                    continue;
                }
                let start = values.len();
                values.resize(start + count, 0.0);
                let counted = groups.iter().flat_map(|(group, _)| counts(layer, *group));
                let parts = ray[count..].chunks_exact(count).zip(counted);
                for (part, _) in parts.filter(|(_, counts)| *counts) {
                    values[start..].iter_mut().zip(part).for_each(|(sum, band)| *sum += band);
                }
            }
        }
    }
}

/// Puts so many of each value in its place.
fn repeat_each(values: &mut Vec<f64>, count: usize) {
    let few = values.len();
    values.resize(few * count, 0.0);
    for i in (0..few).rev() {
        let value = values[i];
        values[i * count..(i + 1) * count].fill(value);
    }
}

/// Tests whether a layer counts light of a group: that which one surface scattered at most, and the rest.
fn counts(layer: LayerSpec, group: LightGroup) -> [bool; 2] {
    match layer {
        LayerSpec::Direct => [true, false],
        LayerSpec::Indirect => [false, true],
        LayerSpec::LightGroup { group: wanted } => [wanted == group; 2],
        _ => [true; 2],
    }
}

impl SampledQuantity for LightPass<'_> {
    fn camera(&self) -> &Camera {
        self.camera
    }

    fn groups(&self) -> &[BandGroup] {
        &self.groups
    }

    fn shared_rows(&self) -> Option<u32> {
        self.rows
    }

    fn margin(&self) -> u32 {
        self.margin
    }

    fn is_light(&self) -> bool {
        true
    }

    fn block_rays(&self) -> Option<&BlockRays> {
        self.block_rays.as_ref()
    }

    fn shape(&self) -> [usize; 2] {
        [self.layers.len(), self.count]
    }

    fn trace(&self, bands: &Range<usize>, memory: &mut Memory) {
        let Memory { rays, film, numbers, scratch, values, light_in_parts, traffic, .. } = memory;
        numbers.set_rays(&rays.sample);
        let lights = self.ctx.lights;
        let parts = match self.layers.len() > 1 || lights.are_modulated() {
            true => Parts::Groups(lights.parts().len()),
            false => Parts::Whole,
        };
        let is_one_for_all = self.ctx.spectral.count() != self.count;
        let bands = if is_one_for_all { 0..self.ctx.spectral.count() } else { bands.clone() };
        let rays_of_paths = match &self.block_rays {
            Some(rays) => PathRays::Blocks { len: numbers.count(), from: rays.camera.position },
            None => PathRays::Batch(&rays.rays),
        };
        let samples = RaySamples { rays: rays_of_paths, samples: numbers, bands, parts };
        let light = if parts == Parts::Whole { &mut *values } else { &mut *light_in_parts };
        traffic.light += self.tracer.radiance(&self.ctx, &samples, scratch, light);
        if lights.are_modulated() {
            self.modulate(rays, film, light_in_parts);
        }
        if parts != Parts::Whole {
            self.gather(&rays.rays, light_in_parts, values);
        }
        if is_one_for_all {
            repeat_each(values, self.count);
        }
        if self.groups.len() == 1 {
            self.count_sparkles(memory);
        }
    }
}
