//! The steps of all paths of a batch, on blocks of sixteen whose numbers stay in registers between the hit and the rays
//! that leave it, by one source for both precisions ([`Lane`]). Facets are worked out in double precision, and what is
//! neither matte nor of facets nor smooth is hit by hit, by [`crate::bsdf::Bsdf`].
//!
//! Both precisions have the same random numbers by use: pictures are the same up to the roundings of single precision.

mod ask;
mod block_lights;
mod choose;
mod compaction;
mod depart;
mod facets;
mod kernel;
mod lane;
mod light;
mod parting;
mod passing;
mod single;
mod sky;
mod surfaces;
mod varied;

use std::ops::RangeInclusive;

use etendue_geometry::block::{Floats as Row, LANES, lanes};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitPrecision, RayBlocks};

use self::block_lights::BlockLights;
use self::choose::ChosenLights;
use self::facets::BlockFacets;
use self::kernel::{StepOutput, StepRules, leave_blocks};
use self::lane::{Batch, Lane, Query, RayEnds};
use self::light::EmitterQuery;
use self::passing::Passages;
use self::single::SingleHits;
use self::surfaces::{Surfaces, TextureLookups};
use super::media::Media;
use super::{DRAWS, Draw};
use super::{LightingContext, PathRays, RaySamples, Tracing};
use crate::emitters::Emitters;
use crate::lights::LightBounds;

/// Hits of single precision are beside an edge of their triangle where their least barycentric weight is below this: only
/// triangles that are less than some hundred of the bounds of [`spawn`](crate::spawn) high have others as near
/// to one, and a mesh of those has no sharp corners that it can resolve.
const EDGE_WEIGHT: f64 = 1.0 / 256.0;

/// Single precision holds squares of lengths, and densities over areas, of scenes between these sizes (m).
pub(crate) const SIZES: [f64; 2] = [1e-6, 1e9];

/// The least area of a light over the square of the scene's size that it holds.
const LEAST_AREA: f64 = 1e-12;

/// Largest bands of lights whose light single precision holds, however near or far they are (W/sr, W/m² or
/// W/(m² sr)).
const BRIGHTNESS: RangeInclusive<f64> = 1e-12..=1e18;

/// A step of all paths of a batch of camera rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct TraceStep<'a> {
    /// The rays of the camera, as which the paths began.
    pub(super) camera: &'a RaySamples<'a>,
    /// Counted from 0, at whose beginning the paths are the camera's rays.
    pub(super) number: u32,
}

impl TraceStep<'_> {
    /// Tests whether its rays run close together.
    fn is_coherent(self) -> bool {
        self.number == 0 && self.camera.rays.are_coherent()
    }

    /// The direction of the path of a lane: the camera's own where it comes straight from there, else `of_block`.
    #[inline(always)]
    fn direction(self, lane: usize, of_block: impl FnOnce() -> DVec3) -> DVec3 {
        match self.camera.rays {
            PathRays::Batch(rays) if self.number == 0 => rays.direction(lane),
            _ => of_block(),
        }
    }
}

/// The numbers that sixteen and more paths carry, a column each; behind the last there is room for a block.
#[derive(Debug, Default)]
pub(super) struct Columns<F> {
    pub(super) len: usize,
    pub(super) ray: Vec<u32>,
    /// Density (1/sr) of the direction, unused of the camera's.
    pub(super) pdf: Vec<F>,
    /// By band.
    pub(super) throughput: Vec<Vec<F>>,
    /// The normal of the surface that each left, where there are many lights; unused of the camera's.
    pub(super) normal: [Vec<F>; 3],
    /// The chance with which the sky was chosen there; unused of the camera's, and without a sky.
    pub(super) sky_chance: Vec<F>,
    /// The cone that each stands for where it starts, if that is more than a point: its width (m), and by how much that
    /// grows per length. Unused of the camera's, and where no surface is smooth or all are alike all over.
    pub(super) cone: [Vec<F>; 2],
    /// [`SPECULAR`], [`LAST`] and [`SCATTERED`]; empty where no surface is smooth.
    pub(super) flags: Vec<u32>,
    /// The media that each is in; empty where they do not count.
    pub(super) media: Vec<Media>,
    /// The wavelength (nm) of the one band left, after a glass has parted them; empty where none does.
    pub(super) wavelengths: Vec<Option<f64>>,
}

/// A path came by a mirror or a smooth boundary: no light was asked in its stead.
const SPECULAR: u32 = 1;

/// A path looks for light and goes no farther.
const LAST: u32 = 2;

/// A path came by some surface that is neither a mirror nor a smooth boundary.
const SCATTERED: u32 = 4;

/// Rays that leave a block's hits, a column a number, with room for a block behind the last.
#[derive(Debug, Default)]
pub(super) struct RayColumns<F> {
    pub(super) len: usize,
    pub(super) start: [Vec<F>; 3],
    pub(super) along: [Vec<F>; 3],
    pub(super) reach: Vec<F>,
    /// The block's lane that each leaves, counted from the first block.
    pub(super) left: Vec<u32>,
    /// The light that each is sent to.
    pub(super) light: Vec<u32>,
    /// The triangles that each leaves and ends on; empty where nothing asks for them.
    ends: Vec<RayEnds>,
    pub(super) carried: Columns<F>,
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub(super) struct Workspace<F> {
    pub(super) rays: RayBlocks<F>,
    carried: Columns<F>,
    shadows: RayColumns<F>,
    next: RayColumns<F>,
    /// Last directions that ask what shines first.
    last: RayColumns<F>,
    shadow_rays: RayBlocks<F>,
    numbers: [[Vec<F>; 2]; DRAWS as usize],
    chosen: ChosenLights<F>,
    /// Hits on what shines, and rays that met nothing.
    seen: Vec<u32>,
    missed: Vec<u32>,
    facets: BlockFacets<F>,
    colors: Vec<Row<F>>,
    shares: Vec<Row<F>>,
    singles: SingleHits,
    varied: TextureLookups,
    passages: Passages<F>,
    query: EmitterQuery,
    /// Light of one hit by band.
    light: Vec<f64>,
    batch: Batch,
    /// Times of rays (s from the frame's time), where these count.
    times: Vec<f64>,
}

impl<F: Lane> Columns<F> {
    /// Number of bands.
    #[inline(always)]
    pub(super) fn count<const RGB: bool>(&self) -> usize {
        if RGB { 3 } else { self.throughput.len() }
    }

    /// The media that a path is in.
    fn media_of(&self, i: usize) -> Media {
        self.media.get(i).copied().unwrap_or(Media::NONE)
    }

    /// The wavelength (nm) of a path that has but one band.
    fn wavelength_of(&self, i: usize) -> Option<f64> {
        self.wavelengths.get(i).copied().flatten()
    }

    /// Makes room for at least `len` of `count` bands; `are_smooth` says that surfaces may be smooth.
    fn reserve(&mut self, len: usize, count: usize, are_smooth: bool) {
        self.throughput.resize(count, Vec::new());
        let len = len.next_multiple_of(LANES) + LANES;
        if are_smooth {
            grow(&mut self.flags, len);
        } else {
            self.flags.clear();
        }
        grow(&mut self.ray, len);
        grow(&mut self.pdf, len);
        grow(&mut self.sky_chance, len);
        let rows = self.throughput.iter_mut().chain(&mut self.normal).chain(&mut self.cone);
        rows.for_each(|row| grow(row, len));
    }
}

/// Makes a column at least so long.
fn grow<T: Copy + Default>(column: &mut Vec<T>, len: usize) {
    if column.len() < len {
        column.resize(len, T::default());
    }
}

impl<F: Lane> RayColumns<F> {
    /// Empties it, with room as by [`Self::reserve`].
    fn restart(&mut self, most: usize, count: usize, are_smooth: bool) {
        self.len = 0;
        self.carried.media.clear();
        self.carried.wavelengths.clear();
        self.reserve(most, count, are_smooth);
    }

    /// Makes room for `most` in all, of `count` bands; `are_smooth` says that surfaces may be smooth.
    fn reserve(&mut self, most: usize, count: usize, are_smooth: bool) {
        self.carried.reserve(most, count, are_smooth);
        let len = self.carried.ray.len();
        for axis in self.start.iter_mut().chain(&mut self.along) {
            grow(axis, len);
        }
        grow(&mut self.reach, len);
        grow(&mut self.left, len);
        grow(&mut self.light, len);
    }

    /// Appends a ray to a light along a unit direction, as far as `reach` (m), which starts as ray `of` of others does; its
    /// number, by which its light is put.
    fn push(&mut self, other: &Self, of: usize, along: [F; 3], reach: F, light: u32) -> usize {
        let to = self.len;
        for (axis, along) in along.into_iter().enumerate() {
            self.start[axis][to] = other.start[axis][of];
            self.along[axis][to] = along;
        }
        (self.reach[to], self.light[to], self.left[to]) = (reach, light, other.left[of]);
        self.carried.ray[to] = other.carried.ray[of];
        self.len += 1;
        to
    }

    /// Puts a last direction in the place of another.
    fn copy_within(&mut self, from: usize, to: usize) {
        let Columns { ray, pdf, throughput, normal, sky_chance, .. } = &mut self.carried;
        let columns = self.start.iter_mut().chain(&mut self.along).chain(throughput).chain(normal);
        columns.chain([pdf, sky_chance]).for_each(|column| column[to] = column[from]);
        (self.left[to], ray[to]) = (self.left[from], ray[from]);
    }

    /// The rays as blocks, which are refilled.
    fn pack(&self, blocks: &mut RayBlocks<F>) {
        blocks.refill(self.len, |block, start, count| {
            for axis in 0..3 {
                block.origin[axis] = lanes(&self.start[axis], start);
                block.direction[axis] = lanes(&self.along[axis], start);
            }
            block.t_max[..count].copy_from_slice(&self.reach[start..start + count]);
        });
    }
}

impl LightingContext<'_> {
    /// Tests whether single precision holds all numbers of the scene, whose hits are of it.
    #[must_use]
    pub fn fits_single(&self) -> bool {
        let &Self { accel, lights, placed, precision, .. } = self;
        let Some(blocks) = accel.blocks().filter(|_| precision == HitPrecision::Single) else {
            return false;
        };
        let &LightBounds { least_area, farthest, brightest, .. } = lights.bounds();
        let least = LEAST_AREA * placed.size().powi(2);
        let are_near = 2.0 * (farthest + blocks.origin().abs().max_element()) < SIZES[1];
        let is_held = brightest == 0.0 || BRIGHTNESS.contains(&brightest);
        placed.fits_single() && least_area > least && are_near && is_held
    }
}

impl<'a, const RGB: bool> Tracing<'a, RGB> {
    /// The surfaces of the scene.
    fn surfaces<F: Lane>(&self) -> Surfaces<'a, F> {
        let &LightingContext { placed, scene, precision, .. } = self.ctx;
        // What is worked out in single precision is rounded as often again: points, normals and starts.
        let roundings = self.ctx.roundings() * if F::HAS_ENDS { 1.0 } else { 2.0 };
        let edge_weight = match precision {
            HitPrecision::Single => EDGE_WEIGHT,
            HitPrecision::Double => -1.0,
        };
        Surfaces {
            all: placed.table(),
            placed,
            geometry: scene.geometry,
            varied: TextureLookups::NONE,
            roundings: F::of(roundings),
            edge_weight: F::of(edge_weight),
        }
    }

    /// Traces the camera's rays.
    pub(super) fn trace<F: Lane>(
        &mut self,
        camera: &RaySamples<'_>,
        workspace: &mut Workspace<F>,
        out: &mut [f64],
    ) {
        let accel = self.ctx.accel;
        let surfaces = self.surfaces::<F>();
        let lights = &BlockLights::new(self.ctx.lights, F::origin(accel), self.count());
        if let PathRays::Batch(rays) = camera.rays {
            F::convert(accel, rays, &mut workspace.rays);
        }
        let are_smooth = surfaces.all.are_smooth;
        start(camera, self.count(), are_smooth, &mut workspace.carried);
        workspace.carried.media = self.media_at_origins(camera.rays);
        workspace.next.ends.clear();
        let mut is_scattered = true;
        for number in 0..=self.rules.bounces {
            let step = TraceStep { camera, number };
            let len = workspace.rays.len();
            if len == 0 {
                break;
            }
            self.times_of::<F>(workspace.carried.ray[..len].iter().copied(), &mut workspace.times);
            let query = Query {
                times: &workspace.times,
                ends: &workspace.next.ends,
                coherent: step.is_coherent(),
            };
            F::closest(self.ctx, &mut workspace.rays, query, &mut workspace.batch);
            self.tally.rays += len as u64;
            self.pass(step, workspace, out);
            is_scattered &= number < self.rules.bounces;
            self.leave(step, surfaces, lights, is_scattered, workspace);
            self.carry_cones(step, surfaces.all, workspace);
            self.meet(step, workspace, out);
            self.add_sky(step, lights, workspace, out);
            self.add_disks(step, workspace, out);
            if let Some(emitters) = self.asked_emitters() {
                self.ask_emitters(emitters, lights, workspace);
            }
            let Workspace { rays, singles, carried, shadows, next, .. } = &mut *workspace;
            for leaving in [shadows, next] {
                self.carry_media(rays, singles, carried, leaving);
            }
            self.light(step, lights, workspace, out);
            // Last directions that do not ask what shines are followed as the others are.
            is_scattered &= !self.is_end_unless_specular(number) || are_smooth;
            self.find_ends_of_paths(workspace);
            workspace.next.pack(&mut workspace.rays);
            std::mem::swap(&mut workspace.carried, &mut workspace.next.carried);
            workspace.carried.len = workspace.next.len;
        }
    }

    /// Notes the rays that leave the hits of a step, where these scatter light.
    fn leave<F: Lane>(
        &self,
        step: TraceStep<'_>,
        surfaces: Surfaces<'_, F>,
        lights: &BlockLights<'_, F>,
        is_scattered: bool,
        workspace: &mut Workspace<F>,
    ) {
        let number = step.number;
        let (len, all) = (workspace.rays.len(), surfaces.all);
        // Last directions may become rays to the sky.
        let count = self.count();
        workspace.shadows.restart(2 * len, count, all.are_smooth);
        workspace.next.restart(len, count, all.are_smooth);
        workspace.last.restart(len, count, all.are_smooth);
        workspace.seen.clear();
        workspace.missed.clear();
        let is_last = self.is_end_unless_specular(number);
        // Nobody comes upon points.
        let goes_on = !is_last || self.ctx.lights.is_hittable();
        let roulette = !is_last && self.rules.roulette.is_some_and(|after| number + 1 >= after);
        if is_scattered {
            let needs = [goes_on || all.are_smooth, roulette, all.are_rich()];
            self.draw(step, needs, workspace);
            self.look_up_varied(step, surfaces, workspace);
            // Behind the paths of glass that parts wavelengths.
            workspace.next.reserve(workspace.next.len + len, count, all.are_smooth);
            if lights.are_many() && !self.ctx.lights.is_dark() {
                self.choose_lights(surfaces, lights, workspace);
            }
        }
        let surfaces = Surfaces { varied: &workspace.varied, ..surfaces };
        let asks_lights = !self.ctx.lights.is_dark();
        let chosen = (asks_lights && lights.are_many()).then_some(&workspace.chosen);
        let emitters = self.asked_emitters().map(|emitters| emitters.sphere::<F>(lights.origin));
        let (asks_emitters, drawn) = (emitters.is_some(), &workspace.numbers);
        let (has_environment, has_disks) =
            (self.ctx.lights.has_environment(), self.ctx.lights.has_disks());
        let rules = StepRules {
            is_scattered,
            goes_on,
            roulette,
            is_last,
            asks_lights,
            asks_emitters,
            sphere: emitters.filter(|_| is_last && !has_environment),
            drawn,
            chosen,
        };
        let output = StepOutput {
            shadows: &mut workspace.shadows,
            next: &mut workspace.next,
            last: &mut workspace.last,
            seen: &mut workspace.seen,
            missed: (has_environment || has_disks).then_some(&mut workspace.missed),
            facets: &mut workspace.facets,
            singles: &mut workspace.singles,
            colors: &mut workspace.colors,
            shares: &mut workspace.shares,
        };
        let is_rich = all.are_rich() || self.ctx.lights.has_others();
        let leave = match (all.are_tilted, is_rich) {
            (false, false) => leave_blocks::<F, false, false, RGB>,
            (false, true) => leave_blocks::<F, false, true, RGB>,
            (true, false) => leave_blocks::<F, true, false, RGB>,
            (true, true) => leave_blocks::<F, true, true, RGB>,
        };
        let (blocks, carried) = (workspace.rays.blocks(), &workspace.carried);
        leave(self, surfaces, lights, blocks, carried, rules, output);
    }

    /// The time of a ray of the camera (s from the frame's time).
    #[inline(always)]
    fn time_of(&self, ray: u32) -> f64 {
        self.times.get(ray as usize).copied().unwrap_or(0.0)
    }

    /// The times of some rays of the camera, where that counts; else none.
    fn times_of<F: Lane>(&self, rays: impl Iterator<Item = u32>, times: &mut Vec<f64>) {
        times.clear();
        if !self.times.is_empty() && F::has_times(self.ctx.accel) {
            times.extend(rays.map(|ray| self.time_of(ray)));
        }
    }

    /// The emitters that last directions ask before they ask the scene. Through surfaces that are partly there they have
    /// to be followed.
    fn asked_emitters(&self) -> Option<&'a Emitters> {
        self.ctx.emitters.filter(|_| !self.ctx.traits.may_pass())
    }

    /// Draws what a step needs for all lanes.
    fn draw<F: Lane>(
        &self,
        TraceStep { camera, number }: TraceStep<'_>,
        [goes_on, roulette, has_choice]: [bool; 3],
        workspace: &mut Workspace<F>,
    ) {
        let rays = &workspace.carried.ray[..workspace.rays.len()];
        let padded = rays.len().next_multiple_of(LANES);
        for (draw, needs) in [
            (Draw::Choice, has_choice),
            (Draw::Light, true),
            (Draw::Direction, goes_on),
            (Draw::Chance, roulette),
        ] {
            if needs {
                let drawn = &mut workspace.numbers[draw as usize];
                F::draw(camera, rays, draw.pair(number), drawn);
                drawn.iter_mut().for_each(|half| half.resize(padded, F::of(0.5)));
            }
        }
    }
}

/// The camera's rays as paths.
fn start<F: Lane>(
    camera: &RaySamples<'_>,
    count: usize,
    are_smooth: bool,
    carried: &mut Columns<F>,
) {
    let len = camera.rays.len();
    carried.reserve(len, count, are_smooth);
    carried.flags.fill(SPECULAR);
    carried.len = len;
    carried.wavelengths.clear();
    for (number, ray) in (0..).zip(&mut carried.ray) {
        *ray = number;
    }
    for (k, band) in carried.throughput.iter_mut().enumerate() {
        band.fill(if camera.bands.contains(&k) { F::ONE } else { F::ZERO });
    }
}
