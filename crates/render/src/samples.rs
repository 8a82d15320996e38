//! Means over the samples of each pixel, taken in passes over the whole film: after each pass every
//! pixel has the same number of samples, so the film holds a picture that can be looked at, or kept
//! when the render is stopped.
//!
//! Sums are compensated (Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher
//! Summen", 1974), so the mean of a million samples is as exact as that of ten. They are added in the
//! order of the samples, and kept from pass to pass with what rounding took from them: the picture is
//! the same to the bit however many passes there are.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use etendue_camera::{
    BandGroup, BandLandings, Camera, CameraRays, FilmSamples, LensCamera, PixelSamples, Sampler,
    squares_of_pair,
};
use etendue_geometry::HitBatch;
use etendue_tracer::Scratch;
use etendue_tracer::layer::{Columns, Taken};
use rayon::prelude::*;

use crate::adaptive::Wanted;
use crate::film::{FilmLayer, NoMemory, PlaneRows, Strip, filled, strips, take};
use crate::radiance::SampleNumbers;
use crate::shard::Shard;
use crate::tiles::{RayCounts, TILE, Tile};
use crate::watch::{Stopped, Watcher};

/// Samples of the first pass: they fill the batches of a tile.
const FIRST_PASS: u32 = 4;

/// The most samples of a pass.
const LONGEST_PASS: u32 = 1024;

/// The same where what a render has so far is kept on disk after passes.
const LONGEST_KEPT_PASS: u32 = 16;

/// A pass is no longer than this share of all: what a stopped render loses.
const SHARE_OF_PASS: u32 = 8;

/// Pairs of random numbers that the camera uses before light does: place in the pixel, place in the
/// pupil, and of the third one number for the wavelength.
pub(crate) const CAMERA_PAIRS: u32 = 3;

/// The pair of random numbers whose first is a sample's time: the last that there is, which light never gets to.
const TIME_PAIR: u32 = u32::MAX;

/// The pair of random numbers by which carriers diffuse.
const DIFFUSION_PAIR: u32 = u32::MAX - 1;

/// Bytes that sums take a value of the film when there are several passes.
pub(crate) const BYTES_OF_SUM: u64 = size_of::<Sum>() as u64;

/// The passes of `samples` a pixel: the first has few, so that there is soon something to see, and
/// each takes as many as all before it until they are a small share of all.
pub(crate) fn passes(samples: u32) -> Vec<Range<u32>> {
    up_to(samples, (samples / SHARE_OF_PASS).clamp(FIRST_PASS, LONGEST_PASS))
}

/// Shorter passes, after each of which a render can be kept on disk.
pub(crate) fn short_passes(samples: u32) -> Vec<Range<u32>> {
    up_to(samples, LONGEST_KEPT_PASS)
}

fn up_to(samples: u32, longest: u32) -> Vec<Range<u32>> {
    let mut passes = Vec::new();
    let mut start = 0;
    while start < samples {
        let length = start.clamp(FIRST_PASS, longest);
        let left = samples - start;
        // What would be left for a short pass is done by this one.
        let length = if left < length + length / 2 { left } else { length };
        passes.push(start..start + length);
        start += length;
    }
    passes
}

/// How pixels are sampled.
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

/// What the seed of the second set's sequence differs by.
const SECOND_SET: u64 = 0xD1B5_4A32_D192_ED03;

/// Samples of a pixel, side by side.
#[derive(Debug, Clone)]
struct Run {
    /// The pixel from its tile's corner, and which of its sequences they are of.
    pixel: (u32, u32),
    set: u32,
    range: Range<u32>,
    /// The sum that they are added to.
    slot: u32,
}

impl Sampling {
    /// Appends what each sample of a run at a pixel is sampled by, and its index there.
    fn extend(&self, pixel: [u32; 2], run: &Run, numbers: &mut Vec<(PixelSamples, u32)>) {
        let seed = if run.set == 0 { self.seed } else { self.seed ^ SECOND_SET };
        let pixel = self.sampler.pixel(seed, pixel[0], pixel[1], self.samples);
        numbers.extend(run.range.clone().map(|index| (pixel, index)));
    }

    /// The samples that the share has.
    pub(crate) fn range(&self) -> Range<u32> {
        self.shard.samples(self.samples)
    }
}

/// What is averaged over the samples of a pixel: colours of surfaces, or light.
pub(crate) trait Averaged: Sync {
    /// The camera, opened for these bands.
    fn camera(&self) -> &Camera;
    /// The bands that the camera sends separate ways.
    fn groups(&self) -> &[BandGroup];
    /// Where the groups share rays, whose light lands beside the pixel that it starts from: how many rows from
    /// it, at most.
    fn shared_rows(&self) -> Option<u32> {
        None
    }
    /// Whether it is light, of which a row gets as much as its shutter lets through.
    fn is_light(&self) -> bool;
    /// Layers, and the bands of each.
    fn shape(&self) -> [usize; 2];
    /// Samples that are traced together.
    fn batch(&self) -> u32;
    /// Fills `memory.values`, `[ray][layer][band]`, for the rays of one group of bands.
    fn trace(&self, bands: &Range<usize>, memory: &mut Memory);
}

/// One thread's memory for it.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// What the samples of the batch are sampled by, and the sample of each ray.
    pub(crate) numbers: SampleNumbers,
    pub(crate) rays: CameraRays,
    pub(crate) values: Vec<f64>,
    /// `[ray][part][band]`, where light is told apart.
    pub(crate) light_in_parts: Vec<f64>,
    pub(crate) hits: HitBatch,
    pub(crate) columns: Columns,
    pub(crate) scratch: Scratch,
    pub(crate) traffic: RayCounts,
    landings: BandLandings,
    /// Where the samples of the batch lie.
    pub(crate) film: FilmSamples,
    /// `[pixel of the tile][set][layer][band]`.
    sums: Vec<Sum>,
    /// The sum that each sample of the batch is added to: its number among those of a pixel's set.
    slots: Vec<u32>,
    order: Vec<u32>,
}

/// A sum and what rounding took from it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    /// By Knuth's sum of two numbers without loss, which asks neither for the larger.
    #[inline]
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        let of_value = sum - self.sum;
        self.lost += (self.sum - (sum - of_value)) + (value - of_value);
        self.sum = sum;
    }

    /// The sum, and what rounding took from it.
    pub(crate) fn parts(self) -> [f64; 2] {
        [self.sum, self.lost]
    }

    /// From its [`Self::parts`].
    pub(crate) fn of_parts([sum, lost]: [f64; 2]) -> Self {
        Self { sum, lost }
    }

    /// Adds what another has, as exactly as both are.
    pub(crate) fn add_sum(&mut self, other: Self) {
        self.add(other.sum);
        self.lost += other.lost;
    }

    pub(crate) fn total(self) -> f64 {
        self.sum + self.lost
    }
}

/// Layers on their way: what is averaged, and the sums between passes.
pub(crate) struct Averaging<'a> {
    pub(crate) what: &'a dyn Averaged,
    pub(crate) sampling: Sampling,
    pub(crate) layers: Vec<&'a mut FilmLayer>,
    /// `[pixel][set][layer][band]`; empty when there is one pass alone.
    pub(crate) sums: Vec<Sum>,
    /// Threads' memory between strips and passes: made anew each time, its pages are, too.
    spare: Mutex<Vec<Memory>>,
}

impl<'a> Averaging<'a> {
    pub(crate) fn new(
        what: &'a dyn Averaged,
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
            Some(rows) => self.add_shared(rows, pass, watcher, traffic),
            None => self.add_to(Work::Pass(pass), watcher, traffic),
        }
    }

    /// Adds the samples that are `wanted` of each pixel.
    pub(crate) fn add_wanted(
        &mut self,
        wanted: Wanted<'_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        self.add_to(Work::Wanted(wanted), watcher, traffic)
    }

    fn add_to(
        &mut self,
        work: Work<'_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        let sets = self.sampling.sets as usize;
        let Self { what, sampling, layers, sums, spare } = self;
        let spare = &*spare;
        let resolution = what.camera().resolution();
        let kept = split(sums, *what, sets, resolution);
        let strips = strips(layers, resolution, TILE);
        strips.par_iter().zip(&kept).enumerate().try_for_each(|(k, (strip, kept))| {
            let Some(mut strip) = take(strip).filter(|_| sampling.shard.owns(k)) else {
                return Ok(());
            };
            let adding = Adding { what: *what, sampling: *sampling, work, watcher };
            let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
            let mut memory = spare().pop().unwrap_or_default();
            let done = adding.fill(&mut strip, take(kept), &mut memory);
            let statuses = std::mem::take(&mut memory.rays.statuses);
            RayCounts::add(traffic, std::mem::take(&mut memory.traffic), &statuses);
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
        pass: &Range<u32>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        let Self { what, sampling, sums, spare, .. } = self;
        let (spare, sampling) = (&*spare, *sampling);
        let [width, height] = what.camera().resolution();
        let [count, bands] = what.shape();
        let a_row = width as usize * count * bands;
        let adding = Adding { what: *what, sampling, work: Work::Pass(pass), watcher };
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
                strips.push(Mutex::new(Some((strip, Window { first, rows, sums: window }))));
            }
            strips.par_iter().try_for_each(|strip| {
                let Some((strip, mut window)) = take(strip) else { return Ok(()) };
                let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
                let mut memory = spare().pop().unwrap_or_default();
                let done = adding.fill_window((strip, pass), &mut window, &mut memory);
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

    /// The same, to be filled.
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
        let [count, bands] = what.shape();
        let kept = split(sums, *what, 1, resolution);
        let shard = sampling.shard;
        let strips = strips(layers, resolution, TILE);
        strips.par_iter().zip(&kept).enumerate().for_each(|(k, (strip, kept))| {
            let (Some(mut strip), Some(sums)) = (take(strip), take(kept)) else { return };
            // Of rows beside a share's there is only the light that landed from its own.
            if !shard.owns(k) {
                return;
            }
            for (index, sums) in sums.chunks(count * bands).enumerate() {
                put(&mut strip, index, sums, bands, samples);
            }
        });
    }
}

type Shared<T> = Mutex<Option<T>>;

/// The sums of each strip; of nothing when none are kept.
pub(crate) fn split<'s>(
    sums: &'s mut [Sum],
    what: &dyn Averaged,
    sets: usize,
    [width, height]: [u32; 2],
) -> Vec<Shared<&'s mut [Sum]>> {
    let [count, bands] = what.shape();
    if sums.is_empty() {
        return (0..height.div_ceil(TILE)).map(|_| Mutex::new(None)).collect();
    }
    let a_strip = width as usize * TILE as usize * count * bands * sets;
    sums.chunks_mut(a_strip.max(1)).map(|sums| Mutex::new(Some(sums))).collect()
}

/// Writes the means of a pixel of a strip.
pub(crate) fn put(strip: &mut Strip<'_>, index: usize, sums: &[Sum], bands: usize, samples: u32) {
    for (layer, sums) in strip.layers.iter_mut().zip(sums.chunks(bands)) {
        if let (Taken::PictureShare, &[part, all, _]) = (layer.taken, sums) {
            let (part, all) = (part.total(), all.total());
            let share = if all > 0.0 { (part / all).clamp(0.0, 1.0) } else { 0.0 };
            layer.planes[0].put(index, share);
            continue;
        }
        for (plane, sum) in layer.planes.iter_mut().zip(sums) {
            PlaneRows::put(plane, index, sum.total() / f64::from(samples));
        }
    }
}

/// Sums of the pixels of some rows, on which light of a strip lands.
struct Window<'a> {
    /// The topmost row.
    first: u32,
    /// How many rows from where it starts light lands, at most.
    rows: u32,
    sums: &'a mut [Sum],
}

/// Which samples are added.
#[derive(Clone, Copy)]
enum Work<'a> {
    /// These of every pixel.
    Pass(&'a Range<u32>),
    /// What each pixel wants, half of it of each set.
    Wanted(Wanted<'a>),
}

/// One pass of a strip.
struct Adding<'a> {
    what: &'a dyn Averaged,
    sampling: Sampling,
    work: Work<'a>,
    watcher: &'a Watcher<'a>,
}

impl Adding<'_> {
    /// Adds to the sums that are kept, or else fills the layers.
    fn fill(
        &self,
        strip: &mut Strip<'_>,
        mut kept: Option<&mut [Sum]>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let [width, _] = self.what.camera().resolution();
        let [layers, bands] = self.what.shape();
        let count = layers * bands * self.sampling.sets as usize;
        for tile in Tile::across(width, [strip.top, strip.height]) {
            let range = |x: u32, y: u32| match self.work {
                Work::Pass(pass) => pass.clone(),
                Work::Wanted(wanted) => {
                    let above = strip.top as usize * width as usize;
                    wanted.of(above + tile.index(x, y, width))
                }
            };
            // Pixels that want more samples, with what they have so far.
            let pixels: Vec<(u32, u32)> =
                tile.pixels().filter(|&(x, y)| !range(x, y).is_empty()).collect();
            let places = pixels.iter().map(|&(x, y)| tile.index(x, y, width));
            memory.sums.clear();
            match &kept {
                Some(kept) => places.clone().for_each(|at| {
                    memory.sums.extend_from_slice(&kept[at * count..(at + 1) * count]);
                }),
                None => memory.sums.resize(pixels.len() * count, Sum::default()),
            }
            // Samples for these, and back to where their sums are kept.
            match self.work {
                Work::Pass(pass) => self.tile(tile, &pixels, pass, memory)?,
                Work::Wanted(_) => self.tile_of_wanted(tile, &pixels, &range, memory)?,
            }
            for (at, sums) in places.zip(memory.sums.chunks(count)) {
                match (&mut kept, self.work) {
                    (Some(kept), _) => kept[at * count..(at + 1) * count].copy_from_slice(sums),
                    (None, Work::Pass(pass)) => put(strip, at, sums, bands, pass.end),
                    // What pixels want is always kept.
                    (None, Work::Wanted(_)) => {}
                }
            }
        }
        Ok(())
    }

    /// Adds the same samples of each of `pixels`.
    fn tile(
        &self,
        tile: Tile,
        pixels: &[(u32, u32)],
        pass: &Range<u32>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let at_once = (pass.end - pass.start).clamp(1, self.what.batch());
        let pixels_at_once = (self.what.batch() / at_once) as usize;
        let mut runs = Vec::with_capacity(pixels_at_once);
        for (pixels, slot) in pixels.chunks(pixels_at_once).zip((0_u32..).step_by(pixels_at_once)) {
            for first in pass.clone().step_by(at_once as usize) {
                let range = first..pass.end.min(first + at_once);
                let of_pixel = |(&pixel, slot)| Run { pixel, set: 0, range: range.clone(), slot };
                runs.clear();
                runs.extend(pixels.iter().zip(slot..).map(of_pixel));
                self.add_runs(tile, &runs, memory)?;
            }
        }
        Ok(())
    }

    /// Adds to each of `pixels` the samples `range` of both its sets together, which are even numbers.
    fn tile_of_wanted(
        &self,
        tile: Tile,
        pixels: &[(u32, u32)],
        range: &dyn Fn(u32, u32) -> Range<u32>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let (batch, sets) = (self.what.batch(), self.sampling.sets);
        let (mut runs, mut room) = (Vec::new(), batch);
        for (&pixel, slot) in pixels.iter().zip((0..).step_by(sets as usize)) {
            let Range { start, end } = range(pixel.0, pixel.1);
            for set in 0..sets {
                let (mut first, end) = (start / sets, end / sets);
                while first < end {
                    let last = end.min(first + room);
                    runs.push(Run { pixel, set, range: first..last, slot: slot + set });
                    (room, first) = (room - (last - first), last);
                    if room == 0 {
                        self.add_runs(tile, &runs, memory)?;
                        runs.clear();
                        room = batch;
                    }
                }
            }
        }
        if runs.is_empty() { Ok(()) } else { self.add_runs(tile, &runs, memory) }
    }

    /// Adds the samples of a batch.
    fn add_runs(&self, tile: Tile, runs: &[Run], memory: &mut Memory) -> Result<(), Stopped> {
        self.place(tile, runs, memory);
        memory.slots.clear();
        for run in runs {
            memory.slots.extend(run.range.clone().map(|_| run.slot));
        }
        for (number, group) in self.what.groups().iter().enumerate() {
            memory.film.group = number;
            self.what.camera().sample_rays(&memory.film, &mut memory.rays);
            self.what.trace(&group.bands, memory);
            memory.add(self.what.shape(), &group.bands);
        }
        self.watcher.did(memory.slots.len() as u64)
    }

    /// Adds the light of a strip's samples where it lands.
    fn fill_window(
        &self,
        (strip, pass): ([u32; 2], &Range<u32>),
        window: &mut Window<'_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let [width, height] = self.what.camera().resolution();
        let [_, bands] = self.what.shape();
        let shard = self.sampling.shard;
        let owns = |row: u32| shard.owns((row / TILE) as usize);
        // Rows from which light lands on rows of the share.
        let rows = window.rows;
        let lands = |row: u32| {
            let last = (row + rows).min(height - 1);
            (row.saturating_sub(rows) / TILE..=last / TILE).any(|strip| owns(strip * TILE))
        };
        for tile in Tile::across(width, strip) {
            let pixels: Vec<(u32, u32)> =
                tile.pixels().filter(|&(_, y)| lands(tile.top + y)).collect();
            let at_once = (pass.end - pass.start).clamp(1, self.what.batch());
            for pixels in pixels.chunks((self.what.batch() / at_once) as usize) {
                for first in pass.clone().step_by(at_once as usize) {
                    let range = first..pass.end.min(first + at_once);
                    let a_pixel = range.end - range.start;
                    let of_pixel = |&pixel| Run { pixel, set: 0, range: range.clone(), slot: 0 };
                    let runs: Vec<Run> = pixels.iter().map(of_pixel).collect();
                    self.place(tile, &runs, memory);
                    let Memory { film, rays, landings, .. } = memory;
                    self.what.camera().sample_band_rays(film, rays, landings);
                    self.what.trace(&(0..bands), memory);
                    memory.add_where_it_lands(window, self.what.shape(), width as usize);
                    let own = pixels.iter().filter(|&&(_, y)| owns(tile.top + y)).count();
                    self.watcher.did(own as u64 * u64::from(a_pixel))?;
                }
            }
        }
        Ok(())
    }

    /// Refills the batch with the samples of `runs`. A camera without a lens looks at places alone.
    fn place(&self, tile: Tile, runs: &[Run], memory: &mut Memory) {
        let Memory { numbers, film, .. } = memory;
        let numbers: &mut Vec<(PixelSamples, u32)> = &mut numbers.samples;
        numbers.clear();
        // The numbers of all samples of these pixels.
        let pixel = |run: &Run| [tile.left + run.pixel.0, tile.top + run.pixel.1];
        for run in runs {
            self.sampling.extend(pixel(run), run, numbers);
        }
        let count = numbers.len();
        // Their places on the sensor, in the pupil, and in the spectrum.
        let draw = |pair, out: &mut Vec<_>| squares_of_pair(numbers.iter().copied(), pair, out);
        film.clear();
        let mut places = Vec::new();
        draw(0, &mut places);
        let mut first = 0;
        for run in runs {
            let (corner, end) = (pixel(run).map(f64::from), first + run.range.len());
            film.columns.extend(places[first..end].iter().map(|place| corner[0] + place[0]));
            film.rows.extend(places[first..end].iter().map(|place| corner[1] + place[1]));
            first = end;
        }
        // Carriers that a pixel collects were freed beside where they are collected: the pixel sees its own square,
        // spread by a normal distribution.
        if self.sampling.diffusion > 0.0 {
            draw(DIFFUSION_PAIR, &mut places);
            let moved = film.columns.iter_mut().zip(&mut film.rows).zip(&places);
            for ((column, row), &[u, v]) in moved {
                let radius = self.sampling.diffusion * (-2.0 * (1.0 - u).ln()).sqrt();
                let (sine, cosine) = (std::f64::consts::TAU * v).sin_cos();
                *column += radius * cosine;
                *row += radius * sine;
            }
        }
        let lens = self.what.camera().lens();
        match self.what.camera().has_pupil() {
            true => draw(1, &mut film.pupil),
            false => film.pupil.resize(count, [0.5; 2]),
        }
        let is_shared = self.what.shared_rows().is_some();
        if is_shared || lens.is_some_and(LensCamera::draws_wavelengths) {
            draw(2, &mut places);
            film.spectrum.extend(places.iter().map(|place| place[0]));
            film.leading.extend(places.iter().map(|place| place[1]));
        } else {
            film.spectrum.resize(count, 0.5);
            film.leading.resize(count, 0.5);
        }
        // Their times, where something moves, and what comes through the shutter.
        let camera = self.what.camera();
        let Some(shutter) = camera.shutter() else { return };
        let rows = film.rows.iter().map(|row| row.floor() + 0.5);
        if camera.is_timed() {
            squares_of_pair(numbers.iter().copied(), TIME_PAIR, &mut places);
            let moments =
                rows.clone().zip(&places).map(|(row, place)| shutter.moment(row, place[0]));
            film.times.extend(moments);
        }
        if self.what.is_light() && !shutter.is_fully_open() {
            film.open_shares.extend(rows.map(|row| shutter.open_share(row)));
        }
    }
}

impl Memory {
    /// Adds the values of the batch's rays, sample by sample, to their sums.
    fn add(&mut self, [layers, bands]: [usize; 2], group: &Range<usize>) {
        let Self { rays: CameraRays { sample, weight, .. }, values, sums, slots, order, .. } = self;
        let count = layers * bands;
        if group.len() == count && sample.is_sorted() {
            // Samples of one sum lie side by side.
            let mut first = 0;
            while let Some(&of_first) = sample.get(first) {
                let slot = slots[of_first as usize];
                let is_of_sum = |other: &&u32| slots[**other as usize] == slot;
                let of_sum = sample[first..].iter().take_while(is_of_sum).count();
                let (at, end) = (slot as usize * count, first + of_sum);
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

    /// Adds the values of the batch's rays, sample by sample, to the sums of the pixels on which each band of
    /// them lands.
    fn add_where_it_lands(
        &mut self,
        window: &mut Window<'_>,
        [layers, bands]: [usize; 2],
        width: usize,
    ) {
        let Self { rays, values, landings, film, order, .. } = self;
        let count = layers * bands;
        let Window { first, rows, sums } = window;
        let mut add = |ray: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a row of a picture"
            )]
            let start = film.rows[rays.sample[ray] as usize] as u32;
            let nearest = start.saturating_sub(*rows) as usize * width;
            let farthest = (start + *rows + 1) as usize * width;
            let first = *first as usize * width;
            for band in 0..bands {
                let pixel = landings.pixel[ray * bands + band] as usize;
                // Nowhere is beyond every row.
                if pixel < nearest || pixel >= farthest {
                    continue;
                }
                let weight = landings.weight[ray * bands + band];
                for layer in 0..layers {
                    let value = values[ray * count + layer * bands + band];
                    sums[(pixel - first) * count + layer * bands + band].add(value * weight);
                }
            }
        };
        in_order(&rays.sample, order, &mut add);
    }
}

/// Adds the values of rays side by side, as many each as there are sums, times the weight of each.
fn add_run(sums: &mut [Sum], values: &[f64], weights: &[f64]) {
    match sums.len() {
        1 => add_run_of::<1>(sums, values, weights),
        3 => add_run_of::<3>(sums, values, weights),
        count => {
            for (values, weight) in values.chunks_exact(count.max(1)).zip(weights) {
                sums.iter_mut().zip(values).for_each(|(sum, value)| sum.add(value * weight));
            }
        }
    }
}

/// The same of a number of sums that is known, which stay in registers.
fn add_run_of<const N: usize>(sums: &mut [Sum], values: &[f64], weights: &[f64]) {
    let Some(sums) = sums.first_chunk_mut::<N>() else { return };
    let mut own = *sums;
    for (values, weight) in values.as_chunks::<N>().0.iter().zip(weights) {
        for (sum, value) in own.iter_mut().zip(values) {
            sum.add(value * weight);
        }
    }
    *sums = own;
}

/// Adds rays in the order of their samples.
fn in_order(sample: &[u32], order: &mut Vec<u32>, add: &mut dyn FnMut(usize)) {
    if sample.is_sorted() {
        return (0..sample.len()).for_each(add);
    }
    // A lens that disperses sorts its rays by wavelength.
    order.clear();
    order.extend(0..u32::try_from(sample.len()).unwrap_or(u32::MAX));
    order.sort_unstable_by_key(|&ray| sample[ray as usize]);
    order.iter().for_each(|&ray| add(ray as usize));
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
            let most = (samples / SHARE_OF_PASS).max(FIRST_PASS) * 3 / 2;
            assert!(passes.iter().all(|pass| pass.end - pass.start <= most), "{passes:?}");
            assert!(samples < 6 || passes[0].end == FIRST_PASS, "{passes:?}");
        }
        assert_eq!((passes(5).len(), passes(64).len()), (1, 9));
        assert_eq!(passes(256)[..4], [0..4, 4..8, 8..16, 16..32]);
    }

    #[test]
    fn a_sum_keeps_what_rounding_takes() {
        let mut sum = Sum::default();
        for value in [1.0, 1e100, 1.0, -1e100] {
            sum.add(value);
        }
        // The example of Neumaier's paper: naive summation gives 0.
        assert_eq!(sum.total(), 2.0);
    }
}
