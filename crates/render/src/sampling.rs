//! Sampling of pixels: in which passes, by which random numbers, what is averaged, and the memory
//! that a thread needs for it.

use std::borrow::Cow;
use std::ops::Range;

use etendue_accel::{Accel, BlockOrigin};
use etendue_camera::{
    BandGroup, BandLandings, Camera, CameraRays, FilmSamples, PinholeLanes, PixelRun, SampleKeys,
    Sampler,
};
use etendue_geometry::block::{Floats, LANES};
use etendue_geometry::{HitBatch, HitPrecision};
use etendue_tracer::layer::Columns;
use etendue_tracer::{Samples, Scratch};

use crate::shard::Shard;
use crate::sum::Sum;
use crate::tile::RayCounts;

/// Samples of the first pass: they fill the batches of a tile.
const FIRST_PASS: u32 = 4;

/// Samples of a pixel that are worked on side by side: what follows the first pass has them whole.
const SIDE_BY_SIDE: u32 = 16;

/// The most samples of a pass.
const LONGEST_PASS: u32 = 1024;

/// Longest pass where what a render has so far is kept on disk after passes.
const LONGEST_KEPT_PASS: u32 = 16;

/// A pass is no longer than this share of all: what a stopped render loses; or than [`SIDE_BY_SIDE`].
const SHARE_OF_PASS: u32 = 8;

/// Pairs of random numbers that are the camera's: place in the pixel, place in the pupil, the wavelength and where bands
/// share paths the leading one, and one that nothing draws, so that light's pairs begin with a set of its own.
pub(crate) const CAMERA_PAIRS: u32 = 4;

/// The pair of random numbers that is a sample's place in the pupil.
pub(crate) const PUPIL_PAIR: u32 = 1;

/// The pair of random numbers whose first is a sample's time: the last that there is, which light never gets to.
pub(crate) const TIME_PAIR: u32 = u32::MAX;

/// The pair of random numbers by which carriers diffuse.
pub(crate) const DIFFUSION_PAIR: u32 = u32::MAX - 1;

/// Samples that are traced together: enough that what is left of a batch after a few bounces still
/// fills packets, and few enough that its arrays stay in the cache.
pub(crate) const BATCH: u32 = 1024;

/// The passes of `samples` a pixel: the first has few, so that there is soon something to see, the second fills
/// what is worked on side by side, and each other takes as many as all before it until they are a small share of all.
pub(crate) fn passes(samples: u32) -> Vec<Range<u32>> {
    let share = (samples / SHARE_OF_PASS).next_multiple_of(SIDE_BY_SIDE);
    up_to(samples, share.clamp(SIDE_BY_SIDE, LONGEST_PASS))
}

/// Shorter passes, after each of which a render can be kept on disk.
pub(crate) fn short_passes(samples: u32) -> Vec<Range<u32>> {
    up_to(samples, LONGEST_KEPT_PASS)
}

fn up_to(samples: u32, longest: u32) -> Vec<Range<u32>> {
    let mut passes = Vec::new();
    let mut start = 0;
    while start < samples {
        let length = match start {
            0 => FIRST_PASS,
            FIRST_PASS => SIDE_BY_SIDE - FIRST_PASS,
            _ => start.min(longest),
        };
        let left = samples - start;
        // What would be left for a short pass is done by this one.
        let length = if left < length + length / 2 { left } else { length };
        passes.push(start..start + length);
        start += length;
    }
    passes
}

/// Settings of how pixels are sampled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampling {
    /// Rays a pixel of coloured layers.
    pub(crate) samples: u32,
    pub(crate) sampler: Sampler,
    pub(crate) seed: u64,
    /// The share of the pixels, or of the samples, that is rendered.
    pub(crate) shard: Shard,
    /// Sets that the samples of a pixel are of, each of which is a sequence of its own: two, of one size, where they
    /// are judged, or one.
    pub(crate) sets: u32,
    /// Standard deviation of the way that carriers diffuse in the sensor (pixels).
    pub(crate) diffusion: f64,
}

/// Difference of the seed of the second set's sequence.
const SECOND_SET: u64 = 0xD1B5_4A32_D192_ED03;

/// Samples of a pixel, side by side.
#[derive(Debug, Clone)]
pub(crate) struct SampleRun {
    /// The pixel by column and row, also one beside the picture, and which of its sequences they are of.
    pub(crate) pixel: [i32; 2],
    pub(crate) set: u32,
    pub(crate) range: Range<u32>,
    /// The sum that they are added to.
    pub(crate) slot: u32,
    /// Factor on the light of each, where it lands.
    pub(crate) share: f64,
}

impl Sampling {
    /// The samples of a run, which are of its pixel and set.
    fn of_run(&self, run: &SampleRun) -> PixelRun {
        let seed = if run.set == 0 { self.seed } else { self.seed ^ SECOND_SET };
        let [column, row] = run.pixel.map(i32::cast_unsigned);
        let pixel = self.sampler.pixel(seed, column, row, self.samples);
        PixelRun { pixel, numbers: run.range.clone() }
    }

    /// The samples that the share has.
    pub(crate) fn range(&self) -> Range<u32> {
        self.shard.samples(self.samples)
    }
}

/// Quantity averaged over the samples of a pixel: colours of surfaces, or light.
pub(crate) trait SampledQuantity: Sync {
    /// The camera, opened for these bands.
    fn camera(&self) -> &Camera;
    /// The bands that the camera sends separate ways.
    fn groups(&self) -> &[BandGroup];
    /// Greatest number of rows that light lands from the pixel that it starts from, where the groups share rays.
    fn shared_rows(&self) -> Option<u32> {
        None
    }
    /// Pixels beside each side of the picture from which light lands on it.
    fn margin(&self) -> u32 {
        0
    }
    /// True if it is light, of which a row gets as much as its shutter lets through.
    fn is_light(&self) -> bool;
    /// Layers, and the bands of each.
    fn shape(&self) -> [usize; 2];
    /// Rays in blocks of single precision, where they are all that the quantity asks of the camera.
    fn block_rays(&self) -> Option<&BlockRays> {
        None
    }
    /// Fills `memory.values`, `[ray][layer][band]`, or `memory.rows`, for the rays of one group of bands; they are in
    /// [`Scratch::camera_blocks`] where there are [`Self::block_rays`].
    fn trace(&self, bands: &Range<usize>, memory: &mut Memory);
}

/// Rays of a pinhole that are traced in blocks.
#[derive(Debug)]
pub(crate) struct BlockRays {
    pub(crate) camera: PinholeLanes,
    pub(crate) from: BlockOrigin,
}

impl BlockRays {
    /// Those of a camera near a scene of which single precision finds the hits, if it has any.
    pub(crate) fn of(camera: &Camera, accel: &dyn Accel, precision: HitPrecision) -> Option<Self> {
        let blocks = accel.blocks().filter(|blocks| !blocks.has_times());
        let blocks = blocks.filter(|_| precision == HitPrecision::Single)?;
        let camera = camera.pinhole_lanes()?;
        Some(Self { from: blocks.frame().block_origin(camera.position)?, camera })
    }

    /// Refills the blocks with the rays of the samples of `runs`, one for each, in order.
    pub(crate) fn aim(&self, sampling: &Sampling, runs: &[SampleRun], memory: &mut Memory) {
        let Memory { numbers, places, corners, scratch, rays: counted, .. } = memory;
        numbers.has_pupil = false;
        let blocks = scratch.camera_blocks();
        numbers.refill(sampling, runs);
        let count = numbers.count();
        counted.sample.clear();
        counted.sample.extend((0_u32..).take(count));
        numbers.draw_floats(&counted.sample, 0, places);
        corners.iter_mut().for_each(Vec::clear);
        for run in runs {
            let corner = self.camera.corner(run.pixel);
            for (corners, corner) in corners.iter_mut().zip(corner) {
                corners.resize(corners.len() + run.range.len(), corner);
            }
        }
        let whole_blocks = count.next_multiple_of(LANES);
        places.iter_mut().chain(&mut *corners).for_each(|column| column.resize(whole_blocks, 0.0));
        blocks.reset(count);
        self.camera.aim(places, corners, blocks.blocks_mut());
        self.from.start(blocks);
        counted.weight.clear();
        counted.weight.resize(count, 1.0);
    }
}

/// One thread's memory for it.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// Numbers by which the samples of the batch are sampled, and the sample of each ray.
    pub(crate) numbers: SampleNumbers,
    pub(crate) rays: CameraRays,
    /// Places of samples in pixels, and the tangents at the pixels' corners, where rays are in blocks.
    pub(crate) places: [Vec<f32>; 2],
    pub(crate) corners: [Vec<f32>; 2],
    pub(crate) values: Vec<f64>,
    /// Values by blocks of rays, `[block][layer][band]`, of what is found so.
    pub(crate) rows: Vec<Floats>,
    /// `[ray][part][band]`, where light is told apart.
    pub(crate) light_in_parts: Vec<f64>,
    pub(crate) hits: HitBatch,
    pub(crate) columns: Columns,
    pub(crate) scratch: Scratch,
    pub(crate) traffic: RayCounts,
    pub(crate) landings: BandLandings,
    /// Places of the samples of the batch.
    pub(crate) film: FilmSamples,
    /// `[pixel of the tile][set][layer][band]`.
    pub(crate) sums: Vec<Sum>,
    /// The sum that each sample of the batch is added to: its number among those of a pixel's set.
    pub(crate) slots: Vec<u32>,
    /// Factor on the light of each sample of the batch, where bands share paths.
    pub(crate) shares: Vec<f64>,
    pub(crate) order: Vec<u32>,
}

/// The random numbers of a batch of rays.
#[derive(Debug, Default)]
pub(crate) struct SampleNumbers {
    /// The sample of each ray.
    pub(crate) of_ray: Vec<u32>,
    /// Each sample has a ray, in order.
    is_straight: bool,
    /// Samples have places in a pupil.
    pub(crate) has_pupil: bool,
    /// By sample of the film.
    keys: SampleKeys,
}

impl SampleNumbers {
    /// Makes the samples of the film those of `runs`.
    pub(crate) fn refill(&mut self, sampling: &Sampling, runs: &[SampleRun]) {
        self.keys.refill(runs.iter().map(|run| sampling.of_run(run)));
    }

    /// Number of samples of the film.
    pub(crate) fn count(&self) -> usize {
        self.keys.count()
    }

    /// A pair of random numbers of each sample of the film.
    pub(crate) fn draw(&self, pair: u32, out: &mut Vec<[f64; 2]>) {
        self.keys.squares_of_all(pair, out);
    }

    /// A pair of random numbers of single precision of some samples of the film, in two columns.
    pub(crate) fn draw_floats(&self, samples: &[u32], pair: u32, out: &mut [Vec<f32>; 2]) {
        self.keys.floats_of_pair(samples, pair, out);
    }

    /// The places of each sample of the film in its pixel and in the pupil: the pairs 0 and [`PUPIL_PAIR`].
    pub(crate) fn draw_first_pairs(&self, out: [&mut Vec<[f64; 2]>; 2]) {
        self.keys.squares_of_first_pairs(out);
    }

    /// Makes the rays those of so many samples of the film, by their numbers.
    pub(crate) fn set_rays(&mut self, of_ray: &[u32]) {
        self.of_ray.clear();
        self.of_ray.extend_from_slice(of_ray);
        self.is_straight = (0..).zip(of_ray).all(|(ray, &sample)| ray == sample);
    }

    /// The samples of some rays.
    fn samples_of<'a>(&self, rays: &'a [u32]) -> Cow<'a, [u32]> {
        match self.is_straight {
            true => Cow::Borrowed(rays),
            false => rays.iter().map(|&ray| self.of_ray[ray as usize]).collect(),
        }
    }
}

impl SampleNumbers {
    /// Pair of the sampler that is light's pair of this number. Its first is even together with the place in the pixel
    /// where no place in a pupil is.
    fn pair_of_light(&self, pair: u32) -> u32 {
        if pair == 0 && !self.has_pupil { PUPIL_PAIR } else { CAMERA_PAIRS + pair }
    }
}

impl Samples for SampleNumbers {
    fn squares_of_pair(&self, rays: &[u32], pair: u32, out: &mut Vec<[f64; 2]>) {
        self.keys.squares_of_pair(&self.samples_of(rays), self.pair_of_light(pair), out);
    }

    fn floats_of_pair(&self, rays: &[u32], pair: u32, out: &mut [Vec<f32>; 2]) {
        self.keys.floats_of_pair(&self.samples_of(rays), self.pair_of_light(pair), out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_cover_all_samples_once_and_none_is_a_large_share() {
        for samples in (1..300).chain([1000, 1024, 4095, 4096, 65_537, 1 << 20]) {
            let passes = passes(samples);
            assert_eq!(passes[0].start, 0);
            assert_eq!(passes.last().unwrap().end, samples);
            assert!(passes.windows(2).all(|pair| pair[0].end == pair[1].start), "{passes:?}");
            // Half of a pass more is the most that the last takes.
            let most = (samples / SHARE_OF_PASS).next_multiple_of(SIDE_BY_SIDE);
            let most = most.max(SIDE_BY_SIDE) * 3 / 2;
            assert!(passes.iter().all(|pass| pass.end - pass.start <= most), "{passes:?}");
            assert!(samples < 6 || passes[0].end == FIRST_PASS, "{passes:?}");
        }
        assert_eq!((passes(5).len(), passes(64).len()), (1, 5));
        assert_eq!(passes(256)[..5], [0..4, 4..16, 16..32, 32..64, 64..96]);
    }
}
