//! The radiance pass: samples of the film become rays, the tracer says what light they carry, and
//! each pixel gets the mean.
//!
//! Sums are compensated (Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher
//! Summen", 1974), so the mean of a million samples is as exact as that of ten.

use etendue_camera::{
    Camera, CameraRays, FilmSamples, LaneGroup, PixelSamples, squares, squares_of_pair,
};
use etendue_optics::element::FateCounts;
use etendue_tracer::transport::Beam;
use etendue_tracer::{Samples, Scratch, Stage, Tally, Tracer};

use crate::film::Rows;
use crate::tiles::{CAMERA_PAIRS, Sampling, Tile, place_samples};

/// Samples that are traced together: enough that what is left of a batch after a few bounces still
/// fills packets, and few enough that its arrays stay in the cache.
const BATCH: u32 = 1024;

/// What tracing light needs; nothing of it changes on the way.
#[derive(Debug)]
pub(crate) struct LightPass<'a> {
    pub(crate) stage: Stage<'a>,
    pub(crate) tracer: &'a dyn Tracer,
    /// The camera, opened for these lanes.
    pub(crate) camera: &'a Camera,
    /// The lanes that the camera sends separate ways.
    pub(crate) groups: Vec<LaneGroup>,
}

/// One thread's memory for it.
#[derive(Debug, Default)]
pub(crate) struct LightBatch {
    film: FilmSamples,
    camera: CameraRays,
    numbers: Numbers,
    scratch: Scratch,
    out: Vec<f64>,
    sums: Vec<Sum>,
    pub(crate) tally: Tally,
}

/// The random numbers of a batch of rays.
#[derive(Debug, Default)]
struct Numbers {
    /// The pixel's numbers and the sample's index of each sample of the film.
    samples: Vec<(PixelSamples, u32)>,
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

/// A sum and what rounding took from it.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        self.lost += if self.sum.abs() >= value.abs() {
            (self.sum - sum) + value
        } else {
            (value - sum) + self.sum
        };
        self.sum = sum;
    }

    fn total(self) -> f64 {
        self.sum + self.lost
    }
}

impl LightPass<'_> {
    /// Fills the pixels of `tile` in `planes`, one a lane.
    pub(crate) fn fill(
        &self,
        tile: Tile,
        width: u32,
        sampling: Sampling,
        planes: &mut [Rows<'_>],
        batch: &mut LightBatch,
    ) {
        let samples = sampling.samples;
        let at_once = samples.min(BATCH);
        let pixels_at_once = (BATCH / at_once) as usize;
        let lanes = self.stage.spectral.count();
        let pixels: Vec<(u32, u32)> = tile.pixels().collect();
        for pixels in pixels.chunks(pixels_at_once) {
            batch.sums.clear();
            batch.sums.resize(pixels.len() * lanes, Sum::default());
            for first in (0..samples).step_by(at_once as usize) {
                let range = first..samples.min(first + at_once);
                let LightBatch { numbers, film, .. } = &mut *batch;
                let wanted = (pixels, range);
                place_samples(self.camera, tile, wanted, sampling, &mut numbers.samples, film);
                for group in &self.groups {
                    self.trace(group, batch);
                }
            }
            for (p, &(x, y)) in pixels.iter().enumerate() {
                let index = tile.index(x, y, width);
                let sums = &batch.sums[p * lanes..(p + 1) * lanes];
                for (plane, sum) in planes.iter_mut().zip(sums) {
                    plane.put(index, sum.total() / f64::from(samples));
                }
            }
        }
    }

    /// Traces the batch's samples in one group of lanes and adds what they bring.
    fn trace(&self, group: &LaneGroup, batch: &mut LightBatch) {
        let LaneGroup { wavelength, lanes } = group.clone();
        let LightBatch { film, camera: rays, numbers, scratch, out, sums, tally } = batch;
        film.wavelength = wavelength;
        self.camera.sample_rays(film, rays);
        numbers.of_ray.clone_from(&rays.sample);
        let beam = Beam { rays: &rays.rays, samples: numbers, lanes: lanes.clone() };
        *tally += self.tracer.radiance(&self.stage, &beam, scratch, out);
        let count = self.stage.spectral.count();
        let a_pixel = film.len() / (sums.len() / count).max(1);
        for (i, light) in out.chunks(count).enumerate() {
            let pixel = rays.sample[i] as usize / a_pixel.max(1);
            for k in lanes.clone() {
                sums[pixel * count + k].add(light[k] * rays.weight[i]);
            }
        }
    }
}

impl LightBatch {
    /// What became of rays inside the camera's lens.
    pub(crate) fn fates(&self) -> &FateCounts {
        &self.camera.fates
    }
}
