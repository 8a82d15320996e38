//! One pass over a strip of rows: rays of the samples of its pixels, batch by batch, and their values added to sums.

mod values;

use std::ops::Range;

use etendue_camera::LensCamera;
use etendue_tracer::layer::RaySource;

use crate::film::Strip;
use crate::sampling::{
    BATCH, DIFFUSION_PAIR, Memory, SampleRun, SampledQuantity, Sampling, TIME_PAIR,
};
use crate::shard::SampledStrips;
use crate::sum::Sum;
use crate::tile::{TILE, Tile};
use crate::watch::{Stopped, Watcher};

/// The samples of a pixel, by its place in rows from the top: from those that it has to those that it is to have.
pub(crate) type SamplesByPixel<'a> = &'a (dyn Fn(usize) -> Range<u32> + Sync);

/// Writes the means of a pixel of a strip; of one band those of all, where all are alike.
pub(crate) fn put(strip: &mut Strip<'_>, index: usize, sums: &[Sum], bands: usize, samples: u32) {
    for (layer, sums) in strip.layers.iter_mut().zip(sums.chunks(bands)) {
        for (k, plane) in layer.planes.iter_mut().enumerate() {
            plane.put(index, mean(layer.taken, sums, k, samples));
        }
    }
}

/// Writes those of all pixels of a strip, in rows from the top.
pub(crate) fn put_all(strip: &mut Strip<'_>, sums: &[Sum], bands: usize, samples: u32) {
    let count = bands * strip.layers.len();
    for (layer, first) in strip.layers.iter_mut().zip((0..).step_by(bands)) {
        for (k, plane) in layer.planes.iter_mut().enumerate() {
            let own = sums.chunks_exact(count).map(|sums| &sums[first..first + bands]);
            plane.fill(own.map(|sums| mean(layer.taken, sums, k, samples)));
        }
    }
}

/// The mean of a layer's plane by the sums of a pixel, or the share that the first is of the second.
#[inline(always)]
fn mean(taken: RaySource, sums: &[Sum], plane: usize, samples: u32) -> f64 {
    if let (RaySource::PictureShare, &[part, all, _]) = (taken, sums) {
        let (part, all) = (part.total(), all.total());
        return if all > 0.0 { (part / all).clamp(0.0, 1.0) } else { 0.0 };
    }
    sums[plane % sums.len()].total() / f64::from(samples)
}

/// A pixel by column and row, which may be one beside the picture.
type Pixel = [i32; 2];

/// A pixel that samples start from, and the number of the first of its sets among those of all sums.
#[derive(Clone, Copy)]
struct StartPixel {
    pixel: Pixel,
    slot: u32,
}

/// Sums of the pixels of some rows, on which light of a strip lands.
pub(crate) struct RowSums<'a> {
    /// The topmost row.
    pub(crate) first: u32,
    /// Greatest number of rows from where light starts to where it lands.
    pub(crate) rows: u32,
    pub(crate) sums: &'a mut [Sum],
}

/// Sums that the light of a batch is added to.
enum Destination<'a, 'b> {
    /// Those of the pixels that samples start from.
    Starts(&'a mut [Sum]),
    /// Those of the pixels on which it lands.
    Landings(&'a mut RowSums<'b>),
}

/// Selection of the samples that are added.
#[derive(Clone, Copy)]
pub(crate) enum Work<'a> {
    /// These of every pixel.
    Pass(&'a Range<u32>),
    /// Samples that each pixel wants, half of them of each set.
    Wanted(SamplesByPixel<'a>),
}

/// One pass of a strip.
pub(crate) struct Adding<'a> {
    pub(crate) what: &'a dyn SampledQuantity,
    pub(crate) sampling: Sampling,
    pub(crate) work: Work<'a>,
    pub(crate) watcher: &'a Watcher<'a>,
}

impl Adding<'_> {
    /// Adds to the sums that are kept, or else fills the layers.
    pub(crate) fn fill(
        &self,
        strip: &mut Strip<'_>,
        mut kept: Option<&mut [Sum]>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let [width, _] = self.what.camera().resolution();
        let [layers, bands] = self.what.shape();
        let (sets, count) = (self.sampling.sets, layers * bands * self.sampling.sets as usize);
        let mut pixels = Vec::new();
        for tile in Tile::across(width, [strip.top, strip.height]) {
            // Pixels that want more samples, which are added to what they have so far.
            let wanting = tile.pixels().filter(|&at| !self.range(tile.on_film(at)).is_empty());
            pixels.clear();
            if let Some(kept) = &mut kept {
                pixels.extend(wanting.map(|at| StartPixel {
                    pixel: tile.on_film(at),
                    slot: tile.index(at, width) * sets,
                }));
                self.add_pixels(&pixels, &mut Destination::Starts(kept), memory)?;
                continue;
            }
            // What pixels want is always kept.
            let Work::Pass(pass) = self.work else { continue };
            pixels.extend(slots_of(wanting.clone().map(|at| tile.on_film(at)), sets));
            let mut sums = std::mem::take(&mut memory.sums);
            sums.clear();
            sums.resize(pixels.len() * count, Sum::default());
            self.add_pixels(&pixels, &mut Destination::Starts(&mut sums), memory)?;
            for (at, sums) in wanting.zip(sums.chunks(count)) {
                put(strip, tile.index(at, width) as usize, sums, bands, pass.end);
            }
            memory.sums = sums;
        }
        Ok(())
    }

    /// The samples that a pixel is to have of this work; one beside the picture those of the nearest pixel in it.
    fn range(&self, pixel: Pixel) -> Range<u32> {
        match self.work {
            Work::Pass(pass) => pass.clone(),
            Work::Wanted(wanted) => {
                let size = self.what.camera().resolution();
                let near = |axis: usize| {
                    let last = size[axis].max(1) - 1;
                    pixel[axis].max(0).cast_unsigned().min(last) as usize
                };
                wanted(near(1) * size[0] as usize + near(0))
            }
        }
    }

    /// Adds the samples of `pixels`.
    fn add_pixels(
        &self,
        pixels: &[StartPixel],
        to: &mut Destination<'_, '_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        match self.work {
            Work::Pass(pass) => self.add_pass(pixels, pass, to, memory),
            Work::Wanted(_) => self.add_wanted(pixels, to, memory),
        }
    }

    /// Adds the same samples of each of `pixels`.
    fn add_pass(
        &self,
        pixels: &[StartPixel],
        pass: &Range<u32>,
        to: &mut Destination<'_, '_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let at_once = (pass.end - pass.start).clamp(1, BATCH);
        let pixels_at_once = (BATCH / at_once) as usize;
        let mut runs = Vec::with_capacity(pixels_at_once);
        for pixels in pixels.chunks(pixels_at_once) {
            for first in pass.clone().step_by(at_once as usize) {
                let range = first..pass.end.min(first + at_once);
                runs.clear();
                runs.extend(pixels.iter().map(|&StartPixel { pixel, slot }| {
                    let range = range.clone();
                    SampleRun { pixel, set: 0, range, slot, share: 1.0 }
                }));
                self.add_runs(&runs, to, memory)?;
            }
        }
        Ok(())
    }

    /// Adds to each of `pixels` the samples that it is to have of both its sets together, which are even numbers. Where
    /// light lands each counts as its share of its set.
    fn add_wanted(
        &self,
        pixels: &[StartPixel],
        to: &mut Destination<'_, '_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let sets = self.sampling.sets;
        let (mut runs, mut room) = (Vec::new(), BATCH);
        for &StartPixel { pixel, slot } in pixels {
            let Range { start, end } = self.range(pixel);
            let share = match to {
                Destination::Starts(_) => 1.0,
                Destination::Landings(_) => f64::from(sets) / f64::from(end - start),
            };
            for set in 0..sets {
                let (mut first, end) = (start / sets, end / sets);
                while first < end {
                    let last = end.min(first + room);
                    let slot = slot + set;
                    runs.push(SampleRun { pixel, set, range: first..last, slot, share });
                    (room, first) = (room - (last - first), last);
                    if room == 0 {
                        self.add_runs(&runs, to, memory)?;
                        runs.clear();
                        room = BATCH;
                    }
                }
            }
        }
        if runs.is_empty() { Ok(()) } else { self.add_runs(&runs, to, memory) }
    }

    /// Adds the samples of a batch.
    fn add_runs(
        &self,
        runs: &[SampleRun],
        to: &mut Destination<'_, '_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        memory.slots.clear();
        for run in runs {
            memory.slots.extend(std::iter::repeat_n(run.slot, run.range.len()));
        }
        match to {
            Destination::Starts(sums) if self.what.shared_rows().is_none() => {
                self.add_own_runs(runs, sums, memory)
            }
            Destination::Starts(_) | Destination::Landings(_) => {
                self.add_shared_runs(runs, to, memory)
            }
        }
    }

    /// Adds the samples of a batch whose light stays in the pixels that it starts from.
    fn add_own_runs(
        &self,
        runs: &[SampleRun],
        sums: &mut [Sum],
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let shape = self.what.shape();
        if let Some(rays) = self.what.block_rays() {
            let bands = 0..shape[1];
            rays.aim(&self.sampling, runs, memory);
            self.what.trace(&bands, memory);
            match memory.rows.is_empty() {
                false => memory.add_rows(shape, sums),
                true => memory.add(shape, &bands, sums),
            }
            return self.watcher.did(memory.slots.len() as u64);
        }
        self.place(runs, memory);
        for (number, group) in self.what.groups().iter().enumerate() {
            memory.film.group = number;
            self.what.camera().sample_rays(&memory.film, &mut memory.rays);
            self.what.trace(&group.bands, memory);
            memory.add(shape, &group.bands, sums);
        }
        self.watcher.did(memory.slots.len() as u64)
    }

    /// Adds the samples of a batch whose bands share their paths.
    fn add_shared_runs(
        &self,
        runs: &[SampleRun],
        to: &mut Destination<'_, '_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        self.place(runs, memory);
        memory.shares.clear();
        for run in runs {
            memory.shares.extend(std::iter::repeat_n(run.share, run.range.len()));
        }
        let (shape, [width, _]) = (self.what.shape(), self.what.camera().resolution());
        let Memory { film, rays, landings, .. } = memory;
        self.what.camera().sample_band_rays(film, rays, landings);
        if !rays.sample.is_empty() {
            self.what.trace(&(0..shape[1]), memory);
        }
        let counts = |run: &&SampleRun| match to {
            Destination::Starts(_) => true,
            // Others count those that start beside the share, and nobody those that start beside the picture.
            Destination::Landings(_) => self.owns(run.pixel),
        };
        let counted: usize = runs.iter().filter(counts).map(|run| run.range.len()).sum();
        match to {
            Destination::Starts(sums) => memory.add_where_it_starts(shape, sums),
            Destination::Landings(window) => {
                memory.add_where_it_lands(window, shape, [width, self.sampling.sets]);
            }
        }
        self.watcher.did(counted as u64)
    }

    /// True if a pixel is one of the picture and of the share.
    fn owns(&self, [column, row]: Pixel) -> bool {
        let [width, height] = self.what.camera().resolution();
        let is_inside = |at: i32, side: u32| u32::try_from(at).is_ok_and(|at| at < side);
        is_inside(column, width)
            && is_inside(row, height)
            && self.sampling.shard.owns((row.cast_unsigned() / TILE) as usize)
    }

    /// Adds the light of a strip's samples, and of those beside it, where it lands.
    pub(crate) fn fill_window(
        &self,
        strip: [u32; 2],
        window: &mut RowSums<'_>,
        memory: &mut Memory,
    ) -> Result<(), Stopped> {
        let ([width, height], sets) = (self.what.camera().resolution(), self.sampling.sets);
        // Rows from which light lands on rows of the share.
        let taken = SampledStrips { shard: self.sampling.shard, rows: window.rows, height };
        let lands = |pixel: &Pixel| taken.land_from(pixel[1]);
        let to = &mut Destination::Landings(window);
        for tile in Tile::across(width, strip) {
            let pixels = tile.pixels().map(|at| tile.on_film(at)).filter(lands);
            self.add_pixels(&slots_of(pixels, sets).collect::<Vec<_>>(), to, memory)?;
        }
        let margin = slots_of(self.margin_pixels(strip).filter(lands), sets);
        self.add_pixels(&margin.collect::<Vec<_>>(), to, memory)
    }

    /// Pixels beside the picture from which light may land on it: left and right of a strip, above the first one and
    /// below the last.
    fn margin_pixels(&self, [top, height]: [u32; 2]) -> impl Iterator<Item = Pixel> {
        let size = self.what.camera().resolution();
        let margin = self.what.margin().cast_signed();
        let [width, all, top, end] = [size[0], size[1], top, top + height].map(u32::cast_signed);
        let first = if top == 0 { -margin } else { top };
        let end = if end == all { all + margin } else { end };
        let is_outside =
            move |&[column, row]: &Pixel| !(0..width).contains(&column) || !(0..all).contains(&row);
        let rows = if margin > 0 { first..end } else { 0..0 };
        rows.flat_map(move |row| (-margin..width + margin).map(move |column| [column, row]))
            .filter(is_outside)
    }

    /// Refills the batch with the samples of `runs`. A camera without a lens looks at places alone.
    fn place(&self, runs: &[SampleRun], memory: &mut Memory) {
        let Memory { numbers, film, .. } = memory;
        // The numbers of all samples of these pixels.
        numbers.refill(&self.sampling, runs);
        numbers.has_pupil = self.what.camera().has_pupil();
        let count = numbers.count();
        // Their places on the sensor, in the pupil, and in the spectrum.
        let draw = |pair, out: &mut Vec<_>| numbers.draw(pair, out);
        film.clear();
        let mut places = Vec::new();
        if numbers.has_pupil {
            numbers.draw_first_pairs([&mut places, &mut film.pupil]);
        } else {
            draw(0, &mut places);
            film.pupil.resize(count, [0.5; 2]);
        }
        let mut first = 0;
        for run in runs {
            let (corner, end) = (run.pixel.map(f64::from), first + run.range.len());
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
            draw(TIME_PAIR, &mut places);
            let moments =
                rows.clone().zip(&places).map(|(row, place)| shutter.moment(row, place[0]));
            film.times.extend(moments);
        }
        if self.what.is_light() && !shutter.is_fully_open() {
            film.open_shares.extend(rows.map(|row| shutter.open_share(row)));
        }
    }
}

/// Pixels with sums side by side, as many each as there are sets.
fn slots_of(pixels: impl Iterator<Item = Pixel>, sets: u32) -> impl Iterator<Item = StartPixel> {
    pixels.zip((0..).step_by(sets as usize)).map(|(pixel, slot)| StartPixel { pixel, slot })
}
