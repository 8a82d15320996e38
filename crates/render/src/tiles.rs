//! The tile loop: batches of rays from the camera, through the accelerator, onto the film.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use etendue_accel::Accel;
use etendue_camera::{BandGroup, Camera, CameraRays};
use etendue_geometry::{Detail, HitBatch, HitPrecision, RayBatch};
use etendue_optics::element::StatusCounts;
use etendue_tracer::layer::{Columns, LayerContext, OtherFrame, PlainColors};
use etendue_tracer::{LayerSpec, SceneView, TracedBatch};
use rayon::prelude::*;

use crate::adaptive::{ChiefHit, Rule, SampleCounts};
use crate::checkpoint::{Keeper, put_together};
use crate::error::RenderError;
use crate::film::{FilmLayer, Strip, strips, take};
use crate::film_file::{FilmError, FilmFile};
use crate::memory::{NoMemory, filled};
use crate::output::{Picture, PictureError};
use crate::radiance::LightPass;
use crate::samples::Averaging;
use crate::sampling::{BlockRays, Memory, SampledQuantity, Sampling};
use crate::shard::SampledStrips;
use crate::sum::Sum;
use crate::tile::{RayCounts, TILE, Tile};
use crate::watch::{Stopped, Watcher};

/// Makes a picture of layers with so many samples.
pub(crate) type ToPicture<'a> =
    dyn Fn(&[&FilmLayer], u32) -> Result<Picture, PictureError> + Sync + 'a;

/// Inputs of rendering; nothing of them changes on the way.
pub(crate) struct Job<'a> {
    pub(crate) accel: &'a dyn Accel,
    pub(crate) camera: &'a Camera,
    /// Frames that layers compare this one with.
    pub(crate) others: &'a [&'a dyn OtherFrame],
    /// The colours of coloured layers that the camera traces apart.
    pub(crate) groups: Vec<BandGroup>,
    pub(crate) surroundings: SceneView<'a>,
    pub(crate) detail: Detail,
    /// Of hits whose colours are averaged.
    pub(crate) precision: HitPrecision,
    pub(crate) sampling: Sampling,
    /// Ranges of samples, each taken of every pixel before the next is taken of any.
    pub(crate) passes: &'a [Range<u32>],
    /// Pass that fills [`LayerSpec::Radiance`] and the parts of it.
    pub(crate) light: Option<LightPass<'a>>,
    /// The picture as it is on the film.
    pub(crate) picture: &'a ToPicture<'a>,
    /// Rule that the samples are to satisfy, where pixels get different numbers of them.
    pub(crate) rule: Option<Rule>,
    /// Time limit of the samples.
    pub(crate) time: Option<Duration>,
    /// Layer of the picture, by whose error samples are judged.
    pub(crate) judged: Option<LayerSpec>,
    /// Shares of the samples, which are put together instead of being traced.
    pub(crate) shares: &'a [FilmFile],
    /// Keeper of the render on disk.
    pub(crate) keeper: Option<Keeper<'a>>,
}

/// Part of a job that was done.
#[derive(Debug)]
pub(crate) struct JobResult {
    pub(crate) traffic: RayCounts,
    pub(crate) passed: SamplesTaken,
    /// Of a share of the samples, the sums of what is averaged.
    pub(crate) sums: Vec<Vec<Sum>>,
    /// The layers that are not averaged.
    pub(crate) centres: Vec<LayerSpec>,
}

/// Samples taken in the passes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SamplesTaken {
    /// Samples that every pixel has.
    pub(crate) samples: u32,
    /// True if that is all that was wanted.
    pub(crate) is_complete: bool,
    /// Number of samples of each pixel, where that differs.
    pub(crate) counts: Option<SampleCounts>,
}

/// The layers that are not averaged.
pub(crate) struct OtherLayers<'a, 'f> {
    /// Along chief rays.
    pub(crate) centres: &'a [&'f mut FilmLayer],
    /// Those that tell of sampling.
    pub(crate) of_sampling: &'a mut [&'f mut FilmLayer],
}

impl Job<'_> {
    /// Fills `film`: layers along the chief ray first, then those that are averaged, in passes. When
    /// it is stopped after a pass, the layers hold the means of the samples until then.
    pub(crate) fn run(
        &self,
        film: &mut [FilmLayer],
        watcher: &Watcher<'_>,
    ) -> Result<JobResult, RenderError> {
        let traffic = Mutex::new(RayCounts::default());
        let (mut of_sampling, film): (Vec<_>, Vec<_>) =
            film.iter_mut().partition(|layer| layer.spec.is_of_sampling());
        let (lit, seen): (Vec<_>, Vec<_>) =
            film.into_iter().partition(|layer| layer.spec.is_light());
        let (mut mean, mut centre): (Vec<_>, Vec<_>) =
            seen.into_iter().partition(|layer| self.is_averaged(layer.spec));
        let colors = Colors::new(self, mean.iter().map(|layer| layer.spec).collect());
        let mut averaged = Vec::new();
        // Shares of the samples and what was kept on disk are sums, whatever the passes are.
        let is_shared = self.sampling.shard.is_of_samples() || !self.shares.is_empty();
        let has_sums = is_shared || self.keeper.is_some();
        let passes = if has_sums { usize::MAX } else { self.passes.len() };
        if !mean.is_empty() {
            let layers = std::mem::take(&mut mean);
            averaged.push(Averaging::new(&colors, self.sampling, layers, passes)?);
        }
        if let (Some(light), false) = (&self.light, lit.is_empty()) {
            // Where light lands on pixels beside its own there are sums, too.
            let passes = if light.rows.is_some() { usize::MAX } else { passes };
            averaged.push(Averaging::new(light, self.sampling, lit, passes)?);
        }
        let shard = self.sampling.shard;
        let range = self.sampling.range();
        let mut done = range.start;
        match self.found(&mut centre, &mut averaged)? {
            Some((samples, counts)) => {
                done = samples;
                *traffic.lock().unwrap_or_else(PoisonError::into_inner) = counts;
                let taken = done.saturating_sub(range.start);
                watcher.did(self.camera_rays(taken, averaged.len(), !centre.is_empty()))?;
            }
            None if shard.has_data() => self.centres(&mut centre, watcher, &traffic)?,
            None => {}
        }
        let others = OtherLayers { centres: &centre, of_sampling: &mut of_sampling };
        let passed = self.passes(done, &mut averaged, others, watcher, &traffic)?;
        let traffic = traffic.into_inner().unwrap_or_else(PoisonError::into_inner);
        let sums = averaged.into_iter().map(|part| part.sums).filter(|_| shard.is_of_samples());
        let (sums, centres) = (sums.collect(), centre.iter().map(|layer| layer.spec).collect());
        Ok(JobResult { traffic, passed, sums, centres })
    }

    /// Puts what there is already, in shares or on disk, onto the film; returns how many samples
    /// every pixel has, and what was traced for them.
    fn found(
        &self,
        centres: &mut [&mut FilmLayer],
        averaged: &mut [Averaging<'_>],
    ) -> Result<Option<(u32, RayCounts)>, FilmError> {
        if !self.shares.is_empty() {
            let counts = put_together(self.shares, self.camera.resolution(), centres, averaged)?;
            return Ok(Some((self.sampling.samples, counts)));
        }
        match &self.keeper {
            Some(keeper) => keeper.restore(centres, averaged),
            None => Ok(None),
        }
    }

    /// The rays of the camera that filling `film` takes.
    pub(crate) fn rays(&self, film: &[FilmLayer]) -> u64 {
        let film = film.iter().filter(|layer| !layer.spec.is_of_sampling());
        let is_lit = |layer: &FilmLayer| layer.spec.is_light();
        let is_mean = |layer: &FilmLayer| !is_lit(layer) && self.is_averaged(layer.spec);
        let any = |what: &dyn Fn(&FilmLayer) -> bool| film.clone().any(what);
        let sampled = usize::from(any(&is_lit)) + usize::from(any(&is_mean));
        let chief = any(&|layer| !is_lit(layer) && !is_mean(layer));
        let Range { start, end } = self.sampling.range();
        self.camera_rays(end - start, sampled, chief && self.sampling.shard.has_data())
    }

    /// The rays of the camera that `samples` of every pixel for `sampled` parts take, and the chief rays.
    fn camera_rays(&self, samples: u32, sampled: usize, chief: bool) -> u64 {
        let [width, height] = self.camera.resolution();
        let pixels = u64::from(width) * u64::from(self.sampling.shard.rows(height));
        pixels * (u64::from(chief) + sampled as u64 * u64::from(samples))
    }

    /// True if a layer without light is a mean over samples.
    fn is_averaged(&self, layer: LayerSpec) -> bool {
        let many = self.sampling.samples > 1 || self.camera.has_pupil();
        let lit = self.light.is_some() && layer.row().taken.with_picture();
        layer.is_averaged() && (many || lit)
    }

    /// Fills layers along the chief ray of each pixel.
    fn centres(
        &self,
        layers: &mut [&mut FilmLayer],
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<(), Stopped> {
        if layers.is_empty() {
            return Ok(());
        }
        let [width, height] = self.camera.resolution();
        let strips = strips(layers, [width, height], TILE);
        strips.par_iter().enumerate().try_for_each(|(k, strip)| {
            let Some(mut strip) = take(strip).filter(|_| self.sampling.shard.owns(k)) else {
                return Ok(());
            };
            let mut batch = RayBuffers::new(self.detail);
            let done = self.fill(&mut strip, width, &mut batch, watcher);
            let own = RayCounts { chief_rays: batch.traced, ..RayCounts::default() };
            RayCounts::add(traffic, own, &StatusCounts::default());
            done
        })
    }

    fn fill(
        &self,
        strip: &mut Strip<'_>,
        width: u32,
        batch: &mut RayBuffers,
        watcher: &Watcher<'_>,
    ) -> Result<(), Stopped> {
        // Rows that are seen from different places are batches of their own.
        let height = if self.camera.rows_differ() { 1 } else { strip.height };
        let tops = (strip.top..strip.top + strip.height).step_by(height.max(1) as usize);
        for tile in tops.flat_map(|top| Tile::across(width, [top, height])) {
            batch.aim_at_centres(self.camera, tile, strip.top);
            self.accel.closest(&batch.rays, &mut batch.hits);
            batch.traced += batch.rays.len() as u64;
            let RayBuffers { rays, hits, columns, rows, places, values, .. } = &mut *batch;
            let mut seen =
                LayerContext { places: [columns, rows], ..self.seen(TracedBatch { rays, hits }) };
            if self.camera.rows_differ() {
                let time = self.camera.truth_time(f64::from(tile.top) + 0.5);
                let pose = self.camera.pose_at(time);
                seen.scene.view.origin = pose.position;
                seen.scene.view.axes = pose.rotation;
            }
            for layer in &mut strip.layers {
                layer.spec.fill(&seen, values);
                for (plane, values) in layer.planes.iter_mut().zip(&*values) {
                    plane.scatter(places, values);
                }
            }
            watcher.did(batch.rays.len() as u64)?;
        }
        Ok(())
    }

    /// Strips whose samples of light the share takes.
    pub(crate) fn sampled_strips(&self) -> SampledStrips {
        let rows = self.light.as_ref().and_then(|pass| pass.rows).unwrap_or(0);
        let [_, height] = self.camera.resolution();
        SampledStrips { shard: self.sampling.shard, rows, height }
    }

    /// Hits of the chief ray of each pixel, in rows from the top: by which pixels are alike.
    pub(crate) fn chief_hits(&self) -> Result<Vec<ChiefHit>, NoMemory> {
        let [width, height] = self.camera.resolution();
        let mut all = filled(ChiefHit::default(), width as usize * height as usize)?;
        let strips = all.par_chunks_mut((width * TILE) as usize).enumerate();
        let taken = self.sampled_strips();
        strips.filter(|(k, _)| taken.contains(*k)).for_each(|(k, strip_hits)| {
            let mut batch = RayBuffers::new(Detail::Surface);
            #[expect(clippy::cast_possible_truncation, reason = "a row of a picture")]
            let top = k as u32 * TILE;
            for tile in Tile::across(width, [top, TILE.min(height - top)]) {
                batch.aim_at_centres(self.camera, tile, top);
                self.accel.closest(&batch.rays, &mut batch.hits);
                let RayBuffers { rays, hits, places, values, .. } = &mut batch;
                LayerSpec::Albedo.fill(&self.seen(TracedBatch { rays, hits }), values);
                for (i, &at) in places.iter().enumerate().filter(|(i, _)| hits.t[*i].is_finite()) {
                    let distance = hits.t[i].max(f64::MIN_POSITIVE).ln();
                    let [colour, normal] = [&values[..3], &hits.normal[..]];
                    let numbers = colour.iter().chain(normal).map(|column| column[i]);
                    let chief_hit = &mut strip_hits[at as usize];
                    for (value, number) in chief_hit.iter_mut().zip(numbers.chain([distance])) {
                        #[expect(clippy::cast_possible_truncation, reason = "how alike pixels are")]
                        let number = number as f32;
                        *value = number;
                    }
                }
            }
        });
        Ok(all)
    }

    /// Context that layers are filled from.
    fn seen<'b>(&'b self, traced: TracedBatch<'b>) -> LayerContext<'b> {
        let light = self.light.as_ref().map(|pass| pass.ctx);
        LayerContext {
            scene: self.surroundings,
            traced,
            light,
            places: [&[]; 2],
            others: self.others,
        }
    }
}

/// Coloured layers that are averaged over the samples of a pixel.
struct Colors<'a> {
    job: &'a Job<'a>,
    layers: Vec<LayerSpec>,
    /// Rays and colours where both are worked out in blocks.
    in_blocks: Option<(BlockRays, PlainColors<'a>)>,
}

impl<'a> Colors<'a> {
    fn new(job: &'a Job<'a>, layers: Vec<LayerSpec>) -> Self {
        let rays = BlockRays::of(job.camera, job.accel, job.precision);
        let rays = rays.filter(|_| job.sampling.diffusion == 0.0 && job.groups.len() == 1);
        let plain = |rays| Some((rays, PlainColors::of(job.surroundings, &layers)?));
        Self { in_blocks: rays.and_then(plain), job, layers }
    }
}

impl SampledQuantity for Colors<'_> {
    fn camera(&self) -> &Camera {
        self.job.camera
    }

    fn groups(&self) -> &[BandGroup] {
        &self.job.groups
    }

    fn is_light(&self) -> bool {
        false
    }

    fn shape(&self) -> [usize; 2] {
        [self.layers.len(), 3]
    }

    fn block_rays(&self) -> Option<&BlockRays> {
        self.in_blocks.as_ref().map(|(rays, _)| rays)
    }

    fn trace(&self, bands: &Range<usize>, memory: &mut Memory) {
        if let (Some((_, plain)), Some(accel)) = (&self.in_blocks, self.job.accel.blocks()) {
            let blocks = memory.scratch.camera_blocks();
            accel.closest_of_blocks(blocks.blocks_mut(), &[], true);
            memory.traffic.chief_rays += blocks.len() as u64;
            return plain.fill(blocks.blocks(), &mut memory.rows);
        }
        let Memory { rays: CameraRays { rays, .. }, hits, columns, values, traffic, .. } = memory;
        hits.detail = self.job.detail;
        rays.precision = self.job.precision;
        self.job.accel.closest(rays, hits);
        traffic.chief_rays += rays.len() as u64;
        let count = 3 * self.layers.len();
        values.resize(rays.len() * count, 0.0);
        for (k, layer) in self.layers.iter().enumerate() {
            layer.fill(&self.job.seen(TracedBatch { rays, hits }), columns);
            for c in bands.clone() {
                for (values, color) in values.chunks_mut(count).zip(&columns[c]) {
                    values[3 * k + c] = *color;
                }
            }
        }
    }
}

/// One thread's rays and hits.
struct RayBuffers {
    rays: RayBatch,
    hits: HitBatch,
    columns: Vec<f64>,
    rows: Vec<f64>,
    /// The tile of the chief rays.
    tile: Option<Tile>,
    /// The pixel of each chief ray, from the tile's corner, and its place in the strip's rows.
    pixels: Vec<[u32; 2]>,
    places: Vec<u32>,
    values: Columns,
    traced: u64,
}

impl RayBuffers {
    fn new(detail: Detail) -> Self {
        Self {
            rays: RayBatch::default(),
            hits: HitBatch::new(detail),
            columns: Vec::new(),
            rows: Vec::new(),
            tile: None,
            pixels: Vec::new(),
            places: Vec::new(),
            values: Columns::default(),
            traced: 0,
        }
    }

    /// Aims at the centres of a tile's pixels in a strip whose first row is `top`.
    fn aim_at_centres(&mut self, camera: &Camera, tile: Tile, top: u32) {
        // Most tiles of a strip are of one size, and their pixels stand in the same order.
        if self.tile.is_none_or(|last| (last.width, last.height) != (tile.width, tile.height)) {
            self.pixels.clear();
            self.pixels.extend(tile.pixels());
        }
        self.tile = Some(tile);
        let [width, _] = camera.resolution();
        self.places.clear();
        let below = tile.top - top;
        self.places.extend(self.pixels.iter().map(|&[x, y]| (below + y) * width + tile.left + x));
        self.columns.clear();
        self.columns.extend(self.pixels.iter().map(|&[x, _]| f64::from(tile.left + x) + 0.5));
        self.rows.clear();
        self.rows.extend(self.pixels.iter().map(|&[_, y]| f64::from(tile.top + y) + 0.5));
        camera.rays_through(&self.columns, &self.rows, &mut self.rays);
    }
}
