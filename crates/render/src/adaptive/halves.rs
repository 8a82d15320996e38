//! The two halves of a block's pixels, and what is made of the samples of each.

use etendue_scene::file::SETS;
use etendue_tracer::LayerSpec;
use rayon::prelude::*;

use super::rule::sizes;
use super::{SampleBlocks, convergence, variance_of_mean};
use crate::film::{FilmLayer, PlaneRows, strips, take};
use crate::samples::{Averaging, Sum, put, split};
use crate::tiles::TILE;

/// Halves of a block's pixels: those of one colour of a chessboard, and those of the other.
pub(super) const HALVES: usize = 2;

/// The sets that the samples of a pixel are of.
const SETS_OF_PIXEL: usize = SETS as usize;

/// The half that a pixel belongs to.
pub(super) fn half_of([x, y]: [u32; 2]) -> usize {
    ((x ^ y) & 1) as usize
}

/// A pixel: its place, and the sums of its two sets, of each band.
pub(super) struct Sampled<'a> {
    pub(super) pixel: [u32; 2],
    pub(super) sets: [&'a [Sum]; SETS_OF_PIXEL],
}

impl Averaging<'_> {
    /// Values of a pixel.
    fn values(&self) -> usize {
        self.what.shape().iter().product()
    }

    /// The samples of a pixel: of the layer whose first value is `first`.
    pub(super) fn sampled(&self, pixel: [u32; 2], first: usize) -> Sampled<'_> {
        let [width, _] = self.what.camera().resolution();
        let (values, [_, bands]) = (self.values(), self.what.shape());
        let at = (pixel[1] as usize * width as usize + pixel[0] as usize) * SETS_OF_PIXEL;
        let set = |k: usize| {
            let start = (at + k) * values + first;
            &self.sums[start..start + bands]
        };
        Sampled { pixel, sets: std::array::from_fn(set) }
    }

    /// Writes to the layers the means of what is settled, and of the `samples` samples that others have.
    pub(crate) fn show_settled(&mut self, blocks: &SampleBlocks, samples: u32) {
        let values = self.values();
        let Self { what, layers, sums, .. } = self;
        let resolution @ [width, _] = what.camera().resolution();
        let [_, bands] = what.shape();
        let kept = split(sums, *what, SETS_OF_PIXEL, resolution);
        strips(layers, resolution, TILE).par_iter().zip(&kept).for_each(|(strip, kept)| {
            let (Some(mut strip), Some(sums)) = (take(strip), take(kept)) else { return };
            let pixels = sums.chunks(values * SETS_OF_PIXEL);
            for ((index, sets), place) in pixels.enumerate().zip(places(strip.top, width)) {
                let (a, b) = sets.split_at(values);
                let both = |(a, b): (&Sum, &Sum)| {
                    let mut both = *a;
                    both.add_sum(*b);
                    both
                };
                let whole: Vec<Sum> = a.iter().zip(b).map(both).collect();
                put(&mut strip, index, &whole, bands, blocks.samples(place, samples));
            }
        });
    }

    /// Writes what sampling found of itself to `told`, for the layer whose first value is `first`.
    pub(crate) fn tell(
        &self,
        told: &mut [&mut FilmLayer],
        blocks: &SampleBlocks,
        (samples, first): (u32, usize),
    ) {
        let resolution @ [width, _] = self.what.camera().resolution();
        strips(told, resolution, TILE).par_iter().for_each(|strip| {
            let Some(mut strip) = take(strip) else { return };
            let pixels = (strip.height * width) as usize;
            for (index, place) in places(strip.top, width).take(pixels).enumerate() {
                let samples = blocks.samples(place, samples);
                let [a, b] = self.sampled(place, first).sets;
                let of_set = sizes(samples);
                let share = convergence::share_of_independent(samples, blocks.slope(place));
                let variance = |(a, b): (&Sum, &Sum)| {
                    share * variance_of_mean(a.total() / of_set[0] - b.total() / of_set[1])
                };
                for layer in &mut strip.layers {
                    let numbers: Vec<f64> = match layer.spec {
                        LayerSpec::SampleCount => vec![f64::from(samples)],
                        _ => a.iter().zip(b).map(variance).collect(),
                    };
                    for (plane, number) in layer.planes.iter_mut().zip(numbers) {
                        PlaneRows::put(plane, index, number);
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
