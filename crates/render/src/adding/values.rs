//! Values of the rays of a batch, added to the sums of the pixels that their samples start from, or on which they land.

use std::ops::Range;

use etendue_camera::{BandLandings, CameraRays};

use super::RowSums;
use crate::sampling::Memory;
use crate::sum::{Sum, add_rows, add_run};

impl Memory {
    /// Adds the values of the batch's rays, sample by sample, to the sums that they start from.
    pub(super) fn add(
        &mut self,
        [layers, bands]: [usize; 2],
        group: &Range<usize>,
        sums: &mut [Sum],
    ) {
        let Self { rays: CameraRays { sample, weight, .. }, values, slots, order, .. } = self;
        let count = layers * bands;
        if group.len() == count && sample.is_sorted() {
            // Samples of one sum lie side by side.
            let slot = |sample: &u32| slots[*sample as usize];
            let mut first = 0;
            for run in sample.chunk_by(|a, b| slot(a) == slot(b)) {
                let (at, end) = (slot(&run[0]) as usize * count, first + run.len());
                let values = &values[first * count..end * count];
                add_run(&mut sums[at..at + count], values, &weight[first..end]);
                first = end;
            }
            return;
        }
        let mut add = |ray: usize| {
            let (at, weight) = (slots[sample[ray] as usize] as usize * count, weight[ray]);
            let sums = sums[at..at + count].chunks_exact_mut(bands.max(1));
            let values = values[ray * count..(ray + 1) * count].chunks_exact(bands.max(1));
            for (sums, values) in sums.zip(values) {
                let values = &values[group.clone()];
                sums[group.clone()].iter_mut().zip(values).for_each(|(sum, v)| sum.add(v * weight));
            }
        };
        in_order(sample, order, &mut add);
    }

    /// Adds values in blocks of rays, one for each sample, to the sums that they start from.
    pub(super) fn add_rows(&self, [layers, bands]: [usize; 2], sums: &mut [Sum]) {
        let (count, mut first) = (layers * bands, 0);
        for run in self.slots.chunk_by(|a, b| a == b) {
            let (at, end) = (run[0] as usize * count, first + run.len());
            add_rows(&mut sums[at..at + count], &self.rows, first..end);
            first = end;
        }
    }

    /// Adds the values of the batch's rays whose bands share paths, sample by sample, to the sums of the pixels that they
    /// start from.
    pub(super) fn add_where_it_starts(&mut self, [layers, bands]: [usize; 2], sums: &mut [Sum]) {
        let Self { rays, values, slots, landings, order, .. } = self;
        let count = layers * bands;
        let mut add = |ray: usize| {
            let at = slots[rays.sample[ray] as usize] as usize * count;
            for k in 0..count {
                let landing = ray * bands + k % bands;
                if landings.pixel[landing] != BandLandings::NOWHERE {
                    sums[at + k].add(values[ray * count + k] * landings.weight[landing]);
                }
            }
        };
        in_order(&rays.sample, order, &mut add);
    }

    /// Adds the values of the batch's rays, sample by sample, to the sums of the pixels on which each band of
    /// them lands.
    pub(super) fn add_where_it_lands(
        &mut self,
        window: &mut RowSums<'_>,
        [layers, bands]: [usize; 2],
        [width, sets]: [u32; 2],
    ) {
        let Self { rays, values, landings, film, slots, shares, order, .. } = self;
        let (count, width) = (layers * bands, width as usize);
        let RowSums { first, rows, sums } = window;
        let (first, rows_away) = (*first as usize * width, i64::from(*rows));
        let mut add = |ray: usize| {
            let sample = rays.sample[ray] as usize;
            // Those that start beside the picture land within its first rows, or its last.
            let from = film.rows[sample];
            #[expect(clippy::cast_possible_truncation, reason = "a row of a picture")]
            let start = from as i64 - i64::from(from < 0.0);
            let row = |row: i64| usize::try_from(row).unwrap_or(0) * width;
            let (nearest, farthest) = (row(start - rows_away), row(start + rows_away + 1));
            let (share, set) = (shares[sample], (slots[sample] % sets) as usize);
            let pixels = &landings.pixel[ray * bands..(ray + 1) * bands];
            let weights = &landings.weight[ray * bands..(ray + 1) * bands];
            let values = &values[ray * count..(ray + 1) * count];
            // Neighbouring bands mostly land on one pixel.
            let mut end = 0;
            for run in pixels.chunk_by(|a, b| a == b) {
                let of_run = end..end + run.len();
                end = of_run.end;
                let pixel = run[0] as usize;
                // Nowhere is beyond every row.
                if pixel < nearest || pixel >= farthest {
                    continue;
                }
                let at = ((pixel - first) * sets as usize + set) * count;
                for layer in (0..count).step_by(bands) {
                    let sums = &mut sums[at + layer + of_run.start..at + layer + of_run.end];
                    let values = &values[layer + of_run.start..layer + of_run.end];
                    for ((sum, value), weight) in
                        sums.iter_mut().zip(values).zip(&weights[of_run.clone()])
                    {
                        sum.add(value * (weight * share));
                    }
                }
            }
        };
        in_order(&rays.sample, order, &mut add);
    }
}

/// Adds rays in the order of their samples, of which each has one at most.
fn in_order(sample: &[u32], order: &mut Vec<u32>, add: &mut dyn FnMut(usize)) {
    /// No ray.
    const NONE: u32 = u32::MAX;
    if sample.is_sorted() {
        return (0..sample.len()).for_each(add);
    }
    // A lens that disperses sorts its rays by wavelength.
    let last = sample.iter().copied().max().unwrap_or(0);
    order.clear();
    order.resize(last as usize + 1, NONE);
    for (&sample, ray) in sample.iter().zip(0..) {
        order[sample as usize] = ray;
    }
    order.iter().filter(|&&ray| ray != NONE).for_each(|&ray| add(ray as usize));
}
