//! The two halves of a pixel's samples: their sums, and what is settled of their means.

use etendue_scene::file::SETS;
use etendue_tracer::LayerSpec;
use rayon::prelude::*;

use super::{Block, Blocks};
use crate::film::{FilmLayer, Rows, strips, take};
use crate::samples::{Averaging, Sum, put, split};
use crate::tiles::TILE;

/// Halves of a pixel's samples.
pub(super) const HALVES: usize = 2;

/// Sets of a half.
const SETS_OF_HALF: usize = SETS as usize / HALVES;

/// Where what is settled of a pixel stands among its sums: not a sum but a part of its mean, and of the
/// mean's variance.
const SETTLED: usize = SETS as usize;

/// One half of a pixel's samples: its place, and the sums of its two sets.
pub(super) struct Half<'a> {
    pub(super) pixel: [u32; 2],
    pub(super) sets: [&'a [Sum]; SETS_OF_HALF],
}

/// The part that a half has of the mean of a value, and of its variance, after `samples` samples of the
/// pixel.
fn parts_of_mean([a, b]: [Sum; SETS_OF_HALF], samples: u32) -> [f64; 2] {
    let of_set = f64::from(samples / SETS);
    let [a, b] = [a.total() / of_set, b.total() / of_set];
    // The variance of a set's mean is (a − b)²/2, that of the pixel's, the mean of four, a quarter of
    // it; half of that is this half's part.
    [(a + b) / f64::from(SETS), (a - b) * (a - b) / f64::from(4 * SETS)]
}

impl Block {
    /// Samples that the mean of a pixel is taken over, `samples` being what it has while it goes on.
    pub(super) fn samples(&self, samples: u32) -> u32 {
        let of_half = |settled: u32| if settled == 0 { samples } else { settled } / 2;
        self.settled.map(of_half).iter().sum()
    }
}

impl Averaging<'_> {
    /// Values of a pixel.
    fn values(&self) -> usize {
        self.what.shape().iter().product()
    }

    /// One half of the samples of a pixel: of the layer whose first value is `first`.
    pub(super) fn half(&self, pixel: [u32; 2], half: usize, first: usize) -> Half<'_> {
        let [width, _] = self.what.camera().resolution();
        let (values, [_, bands]) = (self.values(), self.what.shape());
        let slots = self.sampling.slots();
        let at = (pixel[1] as usize * width as usize + pixel[0] as usize) * slots;
        let set = |k: usize| {
            let start = (at + half * SETS_OF_HALF + k) * values + first;
            &self.sums[start..start + bands]
        };
        Half { pixel, sets: std::array::from_fn(set) }
    }

    /// Settles the means of the halves of `blocks` that were decided after `samples` samples and not
    /// `before`.
    pub(super) fn settle(&mut self, blocks: &Blocks, before: &[[u32; HALVES]], samples: u32) {
        let [width, height] = self.what.camera().resolution();
        let (values, slots) = (self.values(), self.sampling.slots());
        let a_row = width as usize * slots * values;
        self.sums.par_chunks_mut(a_row.max(1)).zip(0..height).for_each(|(row, y)| {
            for (pixel, x) in row.chunks_mut(slots * values).zip(0..) {
                let block = blocks.of([x, y]);
                let was = before[blocks.index([x, y])];
                for half in (0..HALVES).filter(|&h| was[h] == 0 && block.settled[h] != 0) {
                    let (sets, settled) = pixel.split_at_mut(SETTLED * values);
                    for (value, settled) in settled.iter_mut().enumerate() {
                        let set = |k| sets[(half * SETS_OF_HALF + k) * values + value];
                        let [mean, variance] = parts_of_mean(std::array::from_fn(set), samples);
                        let [so_far, spread] = settled.parts();
                        *settled = Sum::of_parts([so_far + mean, spread + variance]);
                    }
                }
            }
        });
    }

    /// The mean of each value of a pixel, and the variance of the mean, of what is settled and of what
    /// there is after `samples` samples.
    fn estimate(
        pixel: &[Sum],
        values: usize,
        block: &Block,
        samples: u32,
        out: &mut Vec<[f64; 2]>,
    ) {
        out.clear();
        for value in 0..values {
            let mut whole = pixel[SETTLED * values + value].parts();
            for half in (0..HALVES).filter(|&half| block.settled[half] == 0) {
                let set = |k| pixel[(half * SETS_OF_HALF + k) * values + value];
                let part = parts_of_mean(std::array::from_fn(set), samples);
                whole = [whole[0] + part[0], whole[1] + part[1]];
            }
            out.push(whole);
        }
    }

    /// Writes to the layers the means of what is settled, and of the `samples` samples that others have.
    pub(crate) fn show_settled(&mut self, blocks: &Blocks, samples: u32) {
        let (values, slots) = (self.values(), self.sampling.slots());
        let Self { what, layers, sums, .. } = self;
        let resolution @ [width, _] = what.camera().resolution();
        let [_, bands] = what.shape();
        let kept = split(sums, *what, slots, resolution);
        strips(layers, resolution, TILE).par_iter().zip(&kept).for_each(|(strip, kept)| {
            let (Some(mut strip), Some(sums)) = (take(strip), take(kept)) else { return };
            let mut found = Vec::new();
            let pixels = sums.chunks(values * slots);
            for ((index, pixel), place) in pixels.enumerate().zip(places(strip.top, width)) {
                Self::estimate(pixel, values, blocks.of(place), samples, &mut found);
                let means: Vec<Sum> =
                    found.iter().map(|[mean, _]| Sum::of_parts([*mean, 0.0])).collect();
                put(&mut strip, index, &means, bands, 1);
            }
        });
    }

    /// Writes what sampling found of itself to `told`, for the layer whose first value is `first`.
    pub(crate) fn tell(
        &self,
        told: &mut [&mut FilmLayer],
        blocks: &Blocks,
        (samples, first): (u32, usize),
    ) {
        let (values, slots) = (self.values(), self.sampling.slots());
        let [_, bands] = self.what.shape();
        let resolution @ [width, _] = self.what.camera().resolution();
        let a_strip = width as usize * TILE as usize * values * slots;
        let kept = self.sums.par_chunks(a_strip.max(1));
        strips(told, resolution, TILE).par_iter().zip(kept).for_each(|(strip, sums)| {
            let Some(mut strip) = take(strip) else { return };
            let mut found = Vec::new();
            let pixels = sums.chunks(values * slots);
            for ((index, pixel), place) in pixels.enumerate().zip(places(strip.top, width)) {
                let block = blocks.of(place);
                Self::estimate(pixel, values, block, samples, &mut found);
                for layer in &mut strip.layers {
                    let spreads = found[first..first + bands].iter().map(|[_, spread]| *spread);
                    let numbers: Vec<f64> = match layer.spec {
                        LayerSpec::SampleCount => vec![f64::from(block.samples(samples))],
                        _ => spreads.collect(),
                    };
                    for (plane, number) in layer.planes.iter_mut().zip(numbers) {
                        Rows::put(plane, index, number);
                    }
                }
            }
        });
    }
}

/// The pixels of rows of a picture, from row `top` on.
fn places(top: u32, width: u32) -> impl Iterator<Item = [u32; 2]> {
    (top..).flat_map(move |y| (0..width).map(move |x| [x, y]))
}
