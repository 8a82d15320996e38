//! The tile loop: batches of rays from the camera, through the accelerator, onto the film.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use etendue_accel::Accel;
use etendue_camera::lens::LensCamera;
use etendue_camera::{
    Camera, CameraRays, FilmSamples, LaneGroup, PixelSamples, Sampler, squares_of_pair,
};
use etendue_geometry::{Detail, HitBatch, RayBatch};
use etendue_optics::element::FateCounts;
use etendue_tracer::{LayerSpec, NormalKind, Surroundings, Tally, Traced};
use rayon::prelude::*;

use crate::backdrop;
use crate::film::{Band, FilmLayer, Rows, bands, single};
use crate::radiance::{LightBatch, LightPass};

/// Side of a tile (pixels): its rays are one batch.
const TILE: u32 = 16;

/// Rays a batch when several go through each pixel.
const BATCH: u32 = TILE * TILE;

/// How pixels are sampled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampling {
    /// Rays a pixel of coloured layers.
    pub(crate) samples: u32,
    pub(crate) sampler: Sampler,
    pub(crate) seed: u64,
}

/// What rendering needs; nothing of it changes on the way.
pub(crate) struct Job<'a> {
    pub(crate) accel: &'a dyn Accel,
    pub(crate) camera: &'a Camera,
    /// The colours of coloured layers that the camera traces apart.
    pub(crate) groups: Vec<LaneGroup>,
    pub(crate) surroundings: Surroundings<'a>,
    pub(crate) detail: Detail,
    pub(crate) sampling: Sampling,
    /// What fills [`LayerSpec::Radiance`].
    pub(crate) light: Option<LightPass<'a>>,
    /// Told the share done; answering `false` stops.
    pub(crate) progress: &'a (dyn Fn(f64) -> bool + Sync),
}

/// What was traced.
#[derive(Debug, Clone, Default)]
pub(crate) struct Traffic {
    /// Rays of the camera for layers without light.
    pub(crate) chief_rays: u64,
    /// Rays of the radiance pass.
    pub(crate) light: Tally,
    /// What became of rays inside the camera's lens.
    pub(crate) fates: FateCounts,
}

/// The render was stopped before it was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stopped;

impl Job<'_> {
    /// Fills `layers` and returns what was traced.
    pub(crate) fn run(&self, layers: &mut [FilmLayer]) -> Result<Traffic, Stopped> {
        let [width, height] = self.camera.resolution();
        let bands = bands(layers, [width, height], TILE);
        let total = bands.len() as f64;
        let done = AtomicU64::new(0);
        let traffic = Mutex::new(Traffic::default());
        bands
            .par_iter()
            .try_for_each(|band| {
                let Some(mut band) = take(band) else { return Some(()) };
                let mut batch = Batch::new(self.detail);
                self.fill(&mut band, width, &mut batch);
                let mut traffic = traffic.lock().unwrap_or_else(PoisonError::into_inner);
                traffic.chief_rays += batch.traced;
                traffic.light += batch.light.tally;
                traffic.fates.merge(&batch.camera_rays.fates);
                traffic.fates.merge(batch.light.fates());
                drop(traffic);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(done as f64 / total).then_some(())
            })
            .ok_or(Stopped)?;
        Ok(traffic.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    fn fill(&self, band: &mut Band<'_>, width: u32, batch: &mut Batch) {
        let at_centre = self.sampling.samples == 1 && self.camera.lens().is_none();
        let (mut lit, seen): (Vec<_>, Vec<_>) = std::mem::take(&mut band.layers)
            .into_iter()
            .partition(|(layer, _)| *layer == LayerSpec::Radiance);
        let (mut centre, mut mean): (Vec<_>, Vec<_>) = seen.into_iter().partition(|(layer, _)| {
            // What is behind the picture is where the picture's own samples are.
            let behind = matches!(layer, LayerSpec::Alpha | LayerSpec::Backdrop);
            !layer.is_averaged() || (at_centre && !(behind && self.light.is_some()))
        });
        for left in (0..width).step_by(TILE as usize) {
            let tile =
                Tile { left, top: band.top, width: TILE.min(width - left), height: band.height };
            if !centre.is_empty() {
                batch.aim_at_centres(self.camera, tile);
                self.trace(batch);
                for (layer, planes) in &mut centre {
                    if !self.write_batch(*layer, planes, batch) {
                        self.write(*layer, planes, batch, tile, width);
                    }
                }
            }
            if !mean.is_empty() {
                self.average(&mut mean, tile, width, batch);
            }
            if let (Some(pass), Some((_, planes))) = (&self.light, lit.first_mut()) {
                pass.fill(tile, width, self.sampling, planes, &mut batch.light);
            }
        }
    }

    fn trace(&self, batch: &mut Batch) {
        self.accel.closest(&batch.rays, &mut batch.hits);
        batch.traced += batch.rays.len() as u64;
    }

    /// Means of coloured layers over the samples of each pixel of a tile.
    fn average(
        &self,
        layers: &mut [(LayerSpec, Vec<Rows<'_>>)],
        tile: Tile,
        width: u32,
        batch: &mut Batch,
    ) {
        let samples = self.sampling.samples;
        let at_once = samples.min(BATCH);
        let pixels_at_once = (BATCH / at_once) as usize;
        let pixels: Vec<(u32, u32)> = tile.pixels().collect();
        for pixels in pixels.chunks(pixels_at_once) {
            let mut sums = vec![[0.0; 3]; pixels.len() * layers.len()];
            for first in (0..samples).step_by(at_once as usize) {
                let range = first..samples.min(first + at_once);
                let Batch { numbered, samples: film, .. } = &mut *batch;
                let wanted = (pixels, range.clone());
                place_samples(self.camera, tile, wanted, self.sampling, numbered, film);
                for group in &self.groups {
                    batch.samples.wavelength = group.wavelength;
                    self.camera.sample_rays(&batch.samples, &mut batch.camera_rays);
                    let CameraRays { rays, weight, sample, .. } = &batch.camera_rays;
                    self.accel.closest(rays, &mut batch.hits);
                    batch.traced += rays.len() as u64;
                    let traced = Traced { rays, hits: &batch.hits };
                    for (k, (layer, _)) in layers.iter().enumerate() {
                        self.colors(*layer, traced, &mut batch.numbers);
                        for (i, (&weight, &sample)) in weight.iter().zip(sample).enumerate() {
                            let pixel = sample as usize / range.len();
                            let sum = &mut sums[pixel * layers.len() + k];
                            for c in group.lanes.clone() {
                                sum[c] += weight * batch.numbers[c][i];
                            }
                        }
                    }
                }
            }
            for (p, &(x, y)) in pixels.iter().enumerate() {
                let index = tile.index(x, y, width);
                let count = layers.len();
                for (k, (layer, planes)) in layers.iter_mut().enumerate() {
                    let sums = sums[p * count + k];
                    if *layer == LayerSpec::Alpha {
                        planes[0].put(index, backdrop::share(sums));
                        continue;
                    }
                    for (plane, sum) in planes.iter_mut().zip(sums) {
                        plane.put(index, sum / f64::from(samples));
                    }
                }
            }
        }
    }

    fn colors(&self, layer: LayerSpec, traced: Traced<'_>, out: &mut [Vec<f64>; 3]) {
        match layer {
            LayerSpec::Facing => self.surroundings.facings(traced, out),
            LayerSpec::Albedo => self.surroundings.albedos(traced, out),
            LayerSpec::Alpha => backdrop::alpha(traced, out),
            LayerSpec::Backdrop => backdrop::radiance(self.light.as_ref(), traced, out),
            _ => self.surroundings.flats(traced, out),
        }
    }

    /// Writes the layers that most renders have, a whole batch at a time; `false` for others.
    fn write_batch(&self, layer: LayerSpec, planes: &mut [Rows<'_>], batch: &mut Batch) -> bool {
        let Batch { rays, hits, places, numbers, .. } = batch;
        let traced = Traced { rays, hits };
        match layer {
            LayerSpec::Distance => planes[0].scatter(places, &hits.t),
            LayerSpec::Depth => {
                self.surroundings.depths(traced, &mut numbers[0]);
                planes[0].scatter(places, &numbers[0]);
            }
            LayerSpec::Normal { space, kind: NormalKind::Geometric } => {
                self.surroundings.geometric_normals(traced, space, numbers);
                for (plane, values) in planes.iter_mut().zip(numbers) {
                    plane.scatter(places, values);
                }
            }
            LayerSpec::Flat
            | LayerSpec::Facing
            | LayerSpec::Albedo
            | LayerSpec::Alpha
            | LayerSpec::Backdrop => {
                self.colors(layer, traced, numbers);
                for (plane, values) in planes.iter_mut().zip(numbers) {
                    plane.scatter(places, values);
                }
            }
            _ => return false,
        }
        true
    }

    /// Writes one layer of a tile whose chief rays were traced.
    fn write(
        &self,
        layer: LayerSpec,
        planes: &mut [Rows<'_>],
        batch: &Batch,
        tile: Tile,
        width: u32,
    ) {
        let traced = Traced { rays: &batch.rays, hits: &batch.hits };
        let around = &self.surroundings;
        let index = |i: usize| {
            let (x, y) = batch.pixels[i];
            tile.index(x, y, width)
        };
        match layer {
            // Written a batch at a time.
            LayerSpec::Depth
            | LayerSpec::Distance
            | LayerSpec::Flat
            | LayerSpec::Facing
            | LayerSpec::Albedo
            | LayerSpec::Alpha
            | LayerSpec::Backdrop => {}
            LayerSpec::Normal { space, kind } => {
                each(planes, batch, index, |i| around.normal(traced, i, kind, space).to_array());
            }
            LayerSpec::Position { space } => {
                each(planes, batch, index, |i| around.position(traced, i, space).to_array());
            }
            LayerSpec::Ids => {
                each(planes, batch, index, |i| around.ids(&batch.hits, i).map(f64::from));
            }
            LayerSpec::Coverage => {
                each(planes, batch, index, |i| [f64::from(u8::from(batch.hits.is_hit(i)))]);
            }
            LayerSpec::Uv => each(planes, batch, index, |i| around.first_uv(&batch.hits, i)),
            LayerSpec::MaterialId => {
                each(planes, batch, index, |i| [f64::from(around.material_id(&batch.hits, i))]);
            }
            // Filled by the radiance pass.
            LayerSpec::Radiance => {}
        }
    }
}

/// Puts `value` of each ray at its pixel. All planes of a layer are of one type, so it is asked for
/// once a batch.
fn each<const N: usize>(
    planes: &mut [Rows<'_>],
    batch: &Batch,
    index: impl Fn(usize) -> usize,
    value: impl Fn(usize) -> [f64; N],
) {
    let rays = 0..batch.rays.len();
    match planes.first() {
        Some(Rows::F64(_)) => {
            let mut planes: Vec<&mut [f64]> = planes.iter_mut().filter_map(Rows::f64).collect();
            for i in rays {
                let index = index(i);
                for (plane, value) in planes.iter_mut().zip(value(i)) {
                    plane[index] = value;
                }
            }
        }
        Some(Rows::F32(_)) => {
            let mut planes: Vec<&mut [f32]> = planes.iter_mut().filter_map(Rows::f32).collect();
            for i in rays {
                let index = index(i);
                for (plane, value) in planes.iter_mut().zip(value(i)) {
                    plane[index] = single(value);
                }
            }
        }
        _ => {
            for i in rays {
                let index = index(i);
                for (plane, value) in planes.iter_mut().zip(value(i)) {
                    plane.put(index, value);
                }
            }
        }
    }
}

fn take<'a>(band: &Mutex<Option<Band<'a>>>) -> Option<Band<'a>> {
    band.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// A rectangle of the picture, at most [`TILE`] a side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tile {
    pub(crate) left: u32,
    pub(crate) top: u32,
    width: u32,
    height: u32,
}

impl Tile {
    /// Pixels from the tile's corner along a Z-order curve, so that any 4, 8 or 16 of them in a row,
    /// as many as go into a packet, are a block.
    pub(crate) fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        (0..TILE * TILE)
            .map(|k| (even_bits(k), even_bits(k >> 1)))
            .filter(move |&(x, y)| x < self.width && y < self.height)
    }

    /// Where a pixel of the tile stands in the rows of its band.
    pub(crate) fn index(self, x: u32, y: u32, width: u32) -> usize {
        y as usize * width as usize + (self.left + x) as usize
    }
}

/// Bits 0, 2, 4 and 6 of `k`, put together.
fn even_bits(k: u32) -> u32 {
    k & 1 | k >> 1 & 2 | k >> 2 & 4 | k >> 3 & 8
}

/// Pairs of random numbers that the camera uses before light does: place in the pixel, place in the
/// pupil, and of the third one number for the wavelength.
pub(crate) const CAMERA_PAIRS: u32 = 3;

/// Refills `film` with samples `range` of each of `pixels`, those of one pixel side by side, and
/// `numbers` with what each of them is sampled by. A camera without a lens looks at places alone.
pub(crate) fn place_samples(
    camera: &Camera,
    tile: Tile,
    (pixels, range): (&[(u32, u32)], Range<u32>),
    sampling: Sampling,
    numbers: &mut Vec<(PixelSamples, u32)>,
    film: &mut FilmSamples,
) {
    let Sampling { samples, sampler, seed } = sampling;
    numbers.clear();
    for &(x, y) in pixels {
        let pixel = sampler.pixel(seed, tile.left + x, tile.top + y, samples);
        numbers.extend(range.clone().map(|index| (pixel, index)));
    }
    let count = numbers.len();
    let draw = |pair, out: &mut Vec<_>| squares_of_pair(numbers.iter().copied(), pair, out);
    film.clear();
    let mut places = Vec::new();
    draw(0, &mut places);
    for (&(x, y), places) in pixels.iter().zip(places.chunks(range.len().max(1))) {
        let corner = [tile.left + x, tile.top + y].map(f64::from);
        film.columns.extend(places.iter().map(|place| corner[0] + place[0]));
        film.rows.extend(places.iter().map(|place| corner[1] + place[1]));
    }
    match camera.lens() {
        Some(_) => draw(1, &mut film.pupil),
        None => film.pupil.resize(count, [0.5; 2]),
    }
    if camera.lens().is_some_and(LensCamera::draws_wavelengths) {
        draw(2, &mut places);
        film.spectrum.extend(places.iter().map(|place| place[0]));
    } else {
        film.spectrum.resize(count, 0.5);
    }
}

/// One thread's rays and hits.
struct Batch {
    rays: RayBatch,
    hits: HitBatch,
    columns: Vec<f64>,
    rows: Vec<f64>,
    samples: FilmSamples,
    /// What each of the samples is sampled by.
    numbered: Vec<(PixelSamples, u32)>,
    camera_rays: CameraRays,
    /// The tile of the chief rays.
    tile: Option<Tile>,
    /// The pixel of each chief ray, from the tile's corner, and its place in the band's rows.
    pixels: Vec<(u32, u32)>,
    places: Vec<u32>,
    /// One number of each ray, three times.
    numbers: [Vec<f64>; 3],
    traced: u64,
    light: LightBatch,
}

impl Batch {
    fn new(detail: Detail) -> Self {
        Self {
            rays: RayBatch::default(),
            hits: HitBatch::new(detail),
            columns: Vec::new(),
            rows: Vec::new(),
            samples: FilmSamples::default(),
            numbered: Vec::new(),
            camera_rays: CameraRays::default(),
            tile: None,
            pixels: Vec::new(),
            places: Vec::new(),
            numbers: Default::default(),
            traced: 0,
            light: LightBatch::default(),
        }
    }

    fn aim_at_centres(&mut self, camera: &Camera, tile: Tile) {
        // Most tiles of a band are of one size, and their pixels stand in the same order.
        if self.tile.is_none_or(|last| (last.width, last.height) != (tile.width, tile.height)) {
            self.pixels.clear();
            self.pixels.extend(tile.pixels());
        }
        self.tile = Some(tile);
        let [width, _] = camera.resolution();
        self.places.clear();
        self.places.extend(self.pixels.iter().map(|&(x, y)| y * width + tile.left + x));
        self.columns.clear();
        self.columns.extend(self.pixels.iter().map(|&(x, _)| f64::from(tile.left + x) + 0.5));
        self.rows.clear();
        self.rows.extend(self.pixels.iter().map(|&(_, y)| f64::from(tile.top + y) + 0.5));
        camera.rays_through(&self.columns, &self.rows, &mut self.rays);
    }
}
