//! The samples of pixels, and what is made of them.

use etendue_scene::file::SETS;
use etendue_tracer::LayerSpec;
use rayon::prelude::*;

use crate::adding::put;
use crate::film::{FilmLayer, PlaneRows, strips, take};
use crate::samples::{Averaging, split};
use crate::sum::{Sum, variance_of_mean};
use crate::tile::TILE;

/// The sets that the samples of a pixel are of.
const SETS_OF_PIXEL: usize = SETS as usize;

/// A pixel: its place, and the sums of its two sets, of each band.
pub(super) struct PixelSets<'a> {
    pub(super) pixel: [u32; 2],
    pub(super) sets: [&'a [Sum]; SETS_OF_PIXEL],
}

impl Averaging<'_> {
    /// Values of a pixel.
    fn values(&self) -> usize {
        self.what.shape().iter().product()
    }

    /// The samples of a pixel: of the layer whose first value is `first`.
    pub(super) fn sampled(&self, pixel: [u32; 2], first: usize) -> PixelSets<'_> {
        let [width, _] = self.what.camera().resolution();
        let (values, [_, bands]) = (self.values(), self.what.shape());
        let at = (pixel[1] as usize * width as usize + pixel[0] as usize) * SETS_OF_PIXEL;
        let set = |k: usize| {
            let start = (at + k) * values + first;
            &self.sums[start..start + bands]
        };
        PixelSets { pixel, sets: std::array::from_fn(set) }
    }

    /// Writes to the layers the means of the samples that each pixel has, in rows from the top: of the share's rows.
    pub(crate) fn show_counted(&mut self, have: &[u32]) {
        let values = self.values();
        let Self { what, layers, sums, sampling, .. } = self;
        let shard = sampling.shard;
        let resolution @ [width, _] = what.camera().resolution();
        let [_, bands] = what.shape();
        let kept = split(sums, *what, SETS_OF_PIXEL, resolution);
        strips(layers, resolution, TILE).par_iter().zip(&kept).enumerate().for_each(
            |(k, (strip, kept))| {
                let (Some(mut strip), Some(sums)) = (take(strip), take(kept)) else { return };
                if !shard.owns(k) {
                    return;
                }
                let have = &have[(strip.top * width) as usize..];
                let pixels = sums.chunks(values * SETS_OF_PIXEL).zip(have).enumerate();
                for (index, (sets, &have)) in pixels {
                    let (a, b) = sets.split_at(values);
                    let both = |(a, b): (&Sum, &Sum)| {
                        let mut both = *a;
                        both.add_sum(*b);
                        both
                    };
                    let whole: Vec<Sum> = a.iter().zip(b).map(both).collect();
                    put(&mut strip, index, &whole, bands, have);
                }
            },
        );
    }

    /// Writes what sampling found of itself to `findings`, for the layer whose first value is `first`: of pixels that `have`
    /// so many samples, and so many values in their sums.
    pub(super) fn tell(
        &self,
        findings: &mut [&mut FilmLayer],
        have: &[u32],
        in_sums: &[u32],
        first: usize,
    ) {
        let resolution @ [width, _] = self.what.camera().resolution();
        strips(findings, resolution, TILE).par_iter().for_each(|strip| {
            let Some(mut strip) = take(strip) else { return };
            let (top, pixels) = (strip.top, strip.height * width);
            for index in 0..pixels {
                let pixel = [index % width, top + index / width];
                let place = (top * width + index) as usize;
                let samples = have[place];
                let [a, b] = self.sampled(pixel, first).sets;
                let a_set = f64::from((in_sums[place] / SETS).max(1));
                let variance =
                    |(a, b): (&Sum, &Sum)| variance_of_mean((a.total() - b.total()) / a_set);
                for layer in &mut strip.layers {
                    let numbers: Vec<f64> = match layer.spec {
                        LayerSpec::SampleCount => vec![f64::from(samples)],
                        _ => a.iter().zip(b).map(variance).collect(),
                    };
                    for (plane, number) in layer.planes.iter_mut().zip(numbers) {
                        PlaneRows::put(plane, index as usize, number);
                    }
                }
            }
        });
    }
}
