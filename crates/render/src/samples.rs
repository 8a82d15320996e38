//! Means over the samples of each pixel, taken in passes over the whole film: after each pass every
//! pixel has the same number of samples, so the film holds a picture that can be looked at, or kept
//! when the render is stopped.
//!
//! Values are added to [sums](Sum) in the order of the samples, and those are kept from pass to pass with what
//! rounding took from them: the picture is the same to the bit however many passes there are.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::adding::{Adding, RowSums, SamplesByPixel, Work, put_all};
use crate::film::{FilmLayer, strips, take};
use crate::memory::{NoMemory, filled};
pub(crate) use crate::sampling::passes;
use crate::sampling::{Memory, SampledQuantity, Sampling};
use crate::shard::SampledStrips;
pub(crate) use crate::sum::BYTES_OF_SUM;
use crate::sum::Sum;
use crate::tile::{RayCounts, TILE};
use crate::watch::{Stopped, Watcher};

/// Layers on their way: what is averaged, and the sums between passes.
pub(crate) struct Averaging<'a> {
    pub(crate) what: &'a dyn SampledQuantity,
    pub(crate) sampling: Sampling,
    pub(crate) layers: Vec<&'a mut FilmLayer>,
    /// `[pixel][set][layer][band]`; empty when there is one pass alone.
    pub(crate) sums: Vec<Sum>,
    /// Threads' memory between strips and passes: made anew each time, its pages are, too.
    spare: Mutex<Vec<Memory>>,
}

impl<'a> Averaging<'a> {
    pub(crate) fn new(
        what: &'a dyn SampledQuantity,
        sampling: Sampling,
        layers: Vec<&'a mut FilmLayer>,
        passes: usize,
    ) -> Result<Self, NoMemory> {
        let [width, height] = what.camera().resolution().map(|side| side as usize);
        let [count, bands] = what.shape();
        let values = width * height * count * bands * sampling.sets as usize;
        let kept = if passes > 1 || sampling.sets > 1 { values } else { 0 };
        let sums = filled(Sum::default(), kept)?;
        Ok(Self { what, sampling, layers, sums, spare: Mutex::default() })
    }

    /// Adds the samples `pass` of every pixel. Of several passes the layers see nothing until [`Self::show`]; a single
    /// one fills them.
    pub(crate) fn add(
        &mut self,
        pass: &Range<u32>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        match self.what.shared_rows() {
            Some(rows) => self.add_shared(rows, Work::Pass(pass), watcher, traffic),
            None => self.add_to(Work::Pass(pass), watcher, traffic),
        }
    }

    /// Adds the samples that are `wanted` of each pixel.
    pub(crate) fn add_wanted(
        &mut self,
        wanted: SamplesByPixel<'_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        self.add_to(Work::Wanted(wanted), watcher, traffic)
    }

    /// Takes again the samples that each pixel has, in rows from the top, once it is known how many they are: where
    /// bands share paths, light lands on pixels beside its own, and counts by the samples of the pixel that it started
    /// from. Then each set has one value, the mean of what landed of it.
    pub(crate) fn land(
        &mut self,
        have: &[u32],
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        let Some(rows) = self.what.shared_rows() else { return Ok(()) };
        // The sums of where light starts have told what they were to tell.
        self.sums.fill(Sum::default());
        self.add_shared(rows, Work::Wanted(&|pixel| 0..have[pixel]), watcher, traffic)
    }

    fn add_to(
        &mut self,
        work: Work<'_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        let sets = self.sampling.sets as usize;
        let resolution = self.what.camera().resolution();
        let Self { what, sampling, layers, sums, spare } = self;
        let spare = &*spare;
        let rows = what.shared_rows().unwrap_or(0);
        let taken = SampledStrips { shard: sampling.shard, rows, height: resolution[1] };
        let kept = split(sums, *what, sets, resolution);
        let strips = strips(layers, resolution, TILE);
        strips.par_iter().zip(&kept).enumerate().try_for_each(|(k, (strip, kept))| {
            let Some(mut strip) = take(strip).filter(|_| taken.contains(k)) else {
                return Ok(());
            };
            let adding = Adding { what: *what, sampling: *sampling, work, watcher };
            let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
            let mut memory = spare().pop().unwrap_or_default();
            let done = adding.fill(&mut strip, take(kept), &mut memory);
            let statuses = std::mem::take(&mut memory.rays.statuses);
            let own = std::mem::take(&mut memory.traffic);
            // Rays from beside a share's rows are counted by the share that has those.
            if sampling.shard.owns(k) {
                RayCounts::add(traffic, own, &statuses);
            }
            spare().push(memory);
            done
        })
    }

    /// As [`Self::add`], of rays whose light lands up to `rows` rows from where they start.
    ///
    /// Strips so far apart that they land on no common pixel are traced side by side, and each other set of
    /// them after that: every pixel gets its light in the same order, whatever the number of threads. A share
    /// of the rows takes the samples of those beside it, too, from which light lands on its own.
    fn add_shared(
        &mut self,
        rows: u32,
        work: Work<'_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        let Self { what, sampling, sums, spare, .. } = self;
        let (spare, sampling) = (&*spare, *sampling);
        let [width, height] = what.camera().resolution();
        let [count, bands] = what.shape();
        let a_row = width as usize * count * bands * sampling.sets as usize;
        let adding = Adding { what: *what, sampling, work, watcher };
        let sets = 1 + (2 * rows).div_ceil(TILE);
        for set in 0..sets {
            // The rows on which each strip of the set lands.
            let (mut left, mut top_left) = (&mut sums[..], 0);
            let mut strips = Vec::new();
            for top in (set * TILE..height).step_by((sets * TILE) as usize) {
                let strip = [top, TILE.min(height - top)];
                let first = top.saturating_sub(rows);
                let end = height.min(top + TILE + rows);
                let (_, after) = left.split_at_mut((first - top_left) as usize * a_row);
                let (window, after) = after.split_at_mut((end - first) as usize * a_row);
                (left, top_left) = (after, end);
                strips.push(Mutex::new(Some((strip, RowSums { first, rows, sums: window }))));
            }
            strips.par_iter().try_for_each(|strip| {
                let Some((strip, mut window)) = take(strip) else { return Ok(()) };
                let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
                let mut memory = spare().pop().unwrap_or_default();
                let done = adding.fill_window(strip, &mut window, &mut memory);
                let statuses = std::mem::take(&mut memory.rays.statuses);
                let own = std::mem::take(&mut memory.traffic);
                // Rays from beside a share's rows are counted by the share that has those.
                if sampling.shard.owns((strip[0] / TILE) as usize) {
                    RayCounts::add(traffic, own, &statuses);
                }
                spare().push(memory);
                done
            })?;
        }
        Ok(())
    }

    /// The sums between passes; none when there is one pass alone.
    pub(crate) fn sums(&self) -> &[Sum] {
        &self.sums
    }

    /// Sums of the samples, to be filled.
    pub(crate) fn sums_mut(&mut self) -> &mut [Sum] {
        &mut self.sums
    }

    /// The layers.
    pub(crate) fn layers(&self) -> impl Iterator<Item = &FilmLayer> {
        self.layers.iter().map(|layer| &**layer)
    }

    /// Writes to the layers the means of the share's samples before `samples`.
    pub(crate) fn show(&mut self, samples: u32) {
        let Self { what, layers, sums, sampling, .. } = self;
        let samples = samples - sampling.range().start;
        if sums.is_empty() {
            return;
        }
        let resolution = what.camera().resolution();
        let [_, bands] = what.shape();
        let kept = split(sums, *what, 1, resolution);
        let shard = sampling.shard;
        let strips = strips(layers, resolution, TILE);
        strips.par_iter().zip(&kept).enumerate().for_each(|(k, (strip, kept))| {
            let (Some(mut strip), Some(sums)) = (take(strip), take(kept)) else { return };
            // Of rows beside a share's there is only the light that landed from its own.
            if !shard.owns(k) {
                return;
            }
            put_all(&mut strip, sums, bands, samples);
        });
    }
}

type StripSlot<T> = Mutex<Option<T>>;

/// The sums of each strip; of nothing when none are kept.
pub(crate) fn split<'s>(
    sums: &'s mut [Sum],
    what: &dyn SampledQuantity,
    sets: usize,
    [width, height]: [u32; 2],
) -> Vec<StripSlot<&'s mut [Sum]>> {
    let [count, bands] = what.shape();
    if sums.is_empty() {
        return (0..height.div_ceil(TILE)).map(|_| Mutex::new(None)).collect();
    }
    let a_strip = width as usize * TILE as usize * count * bands * sets;
    sums.chunks_mut(a_strip.max(1)).map(|sums| Mutex::new(Some(sums))).collect()
}
