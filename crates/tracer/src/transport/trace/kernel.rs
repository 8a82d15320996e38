//! One step of all paths: the surfaces of sixteen hits are looked up first, then comes arithmetic on their rows, then
//! the rays that leave them side by side.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use etendue_geometry::RayBlock;
use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::ask::{LightRays, ask, send};
use super::block_lights::{BlockLights, OtherPlaces, place, place_on_chosen};
use super::choose::ChosenLights;
use super::compaction::{Compaction, Instructions, mask};
use super::depart::{BlockPaths, depart, end_some, keep_those_that_may_meet, scatter};
use super::facets::{BlockFacets, FacetHits};
use super::lane::{Lane, single};
use super::single::SingleHits;
use super::surfaces::{BlockLookup, Hits, Surfaces, bend};
use super::{Columns, LAST, RayColumns};
use crate::bsdf::sheets::LightSamples;
use crate::emitters::EmitterSphere;
use crate::light_tree::Choices;
use crate::transport::Tracing;
use crate::transport::{DRAWS, Draw};

/// Distance by which rays that leave hits of f32 beside an edge start back, over the bound of [`crate::spawn`], which
/// counts more roundings for safety than these two: of the hit, and of the origin of the ray that leaves it.
const BACK: f64 = 0.25;

/// The rules of a step, and its random numbers by use, a number a lane.
pub(super) struct StepRules<'a, F> {
    pub(super) is_scattered: bool,
    pub(super) goes_on: bool,
    pub(super) roulette: bool,
    /// Paths go on no farther than to the light that they meet, but for those of smooth surfaces.
    pub(super) is_last: bool,
    /// Emitters are asked for that light first.
    pub(super) asks_emitters: bool,
    /// Anything shines.
    pub(super) asks_lights: bool,
    /// The sphere that directions have to meet, but for those of smooth surfaces; `None` where all are followed.
    pub(super) sphere: Option<EmitterSphere<F>>,
    pub(super) drawn: &'a [[Vec<F>; 2]; DRAWS as usize],
    /// The lights of lanes where each chooses by itself; what is left of the number that chose is drawn.
    pub(super) chosen: Option<&'a ChosenLights<F>>,
}

/// The rays that leave hits, the hits on what shines, and memory of a step.
pub(super) struct StepOutput<'a, F> {
    pub(super) shadows: &'a mut RayColumns<F>,
    pub(super) next: &'a mut RayColumns<F>,
    /// Last directions that ask what shines first.
    pub(super) last: &'a mut RayColumns<F>,
    pub(super) seen: &'a mut Vec<u32>,
    /// Rays that met nothing, if that is asked for.
    pub(super) missed: Option<&'a mut Vec<u32>>,
    pub(super) facets: &'a mut BlockFacets<F>,
    pub(super) singles: &'a mut SingleHits,
    /// Room for a block's colours, and for what they leave of light, by band, where bands are not red, green and blue.
    pub(super) colors: &'a mut Vec<Row<F>>,
    pub(super) shares: &'a mut Vec<Row<F>>,
}

/// Room for the points that choose a light each, by a column a number.
pub(super) struct ReceiverColumns<'a, F> {
    pub(super) choices: &'a mut Choices,
    /// Their lanes, counted from the first block.
    pub(super) lanes: &'a mut [u32],
    /// Their places from the blocks' origin (m), unless it is empty.
    pub(super) points: &'a mut [Vec<F>; 3],
}

/// Gathers the points of some blocks, where surfaces scatter light, that choose among many lights by a number a lane;
/// `receivers` has room for all.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn gather_receivers<F: Lane, const TILTED: bool, const RICH: bool>(
    surfaces: Surfaces<'_, F>,
    origin: DVec3,
    singles: &SingleHits,
    blocks: &[RayBlock<F>],
    carried: &Columns<F>,
    numbers: &[F],
    receivers: ReceiverColumns<'_, F>,
) {
    let ReceiverColumns { choices, lanes, points } = receivers;
    let instructions = Instructions::of_machine();
    for (number, block) in blocks.iter().enumerate() {
        let first = number * LANES;
        let count = carried.len.saturating_sub(first);
        let mut found = BlockLookup::nothing(first);
        found.look_up::<TILTED, RICH, true>(surfaces, block, count, |_| (), |_| ());
        if RICH {
            leave_out(&mut found, carried);
            if TILTED && !singles.is_empty() {
                singles.mark(&mut found);
            }
        }
        let own: Row<F> = numbers[first..first + LANES].try_into().unwrap_or([F::ZERO; LANES]);
        let mut hits = measure(surfaces, block, &found, [F::ZERO; 3]);
        if RICH && TILTED && found.single != [0; LANES] {
            singles.put_normals(first, &mut hits.bent);
        }
        let (wanted, at) = (Compaction::new(&found.asks(), instructions), choices.len());
        wanted.put(&lanes_from(first), lanes, at);
        for axis in 0..3 {
            if !points[axis].is_empty() {
                wanted.put(&hits.point[axis], &mut points[axis], at);
            }
        }
        choices.push_some(
            &hits.point,
            origin,
            hits.shading::<TILTED>(),
            &own,
            |row, to| {
                wanted.put(row, to, 0);
                wanted.count
            },
            |row, to| wanted.put(row, to, 0),
        );
    }
}

/// A step of all paths of some blocks: lists those that met what shines, and notes the rays that leave. Scenes are `RICH`
/// in which some surface is not matte or not alike all over, or some light needs more than its place.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn leave_blocks<F: Lane, const TILTED: bool, const RICH: bool, const RGB: bool>(
    tracing: &Tracing<'_, RGB>,
    surfaces: Surfaces<'_, F>,
    lights: &BlockLights<'_, F>,
    blocks: &[RayBlock<F>],
    carried: &Columns<F>,
    rules: StepRules<'_, F>,
    mut output: StepOutput<'_, F>,
) {
    // Blocks' coordinates are those of the world less their origin, whose roundings count as well.
    let offset = single::<F>(lights.origin).map(|axis| F::of(2.0) * axis.abs());
    let instructions = Instructions::of_machine();
    for rows in [&mut *output.colors, &mut *output.shares] {
        rows.resize(if RGB { 0 } else { carried.throughput.len() }, [F::ZERO; LANES]);
    }
    for (number, block) in blocks.iter().enumerate() {
        let first = number * LANES;
        let count = carried.len.saturating_sub(first);
        let lanes = lanes_from(first);
        let (seen, missed) = (&mut *output.seen, &mut output.missed);
        let meets = |lane: usize| seen.push(lanes[lane]);
        let misses = |lane: usize| {
            if let Some(missed) = missed {
                missed.push(lanes[lane]);
            }
        };
        let mut found = BlockLookup::nothing(first);
        found.look_up::<TILTED, RICH, RGB>(surfaces, block, count, meets, misses);
        if RICH {
            leave_out(&mut found, carried);
            if TILTED && !output.singles.is_empty() {
                output.singles.mark(&mut found);
            }
        }
        if !rules.is_scattered || found.scatters == [0; LANES] {
            continue;
        }
        let mut hits = measure(surfaces, block, &found, offset);
        let has_singles = RICH && TILTED && found.single != [0; LANES];
        if has_singles {
            output.singles.put_normals(first, &mut hits.bent);
        }
        let run = first..first + LANES;
        let row =
            |column: &[F]| -> Row<F> { column[run.clone()].try_into().unwrap_or([F::ZERO; LANES]) };
        let square = |draw: Draw| {
            let [first, second] = &rules.drawn[draw as usize];
            [row(first), row(second)]
        };
        let colors = found.colors::<RGB>(surfaces, output.colors);
        let has_facets = RICH && found.has_facets();
        if has_facets {
            let (found, hits, shading) = (&found, &hits, hits.shading::<TILTED>());
            output.facets.see::<RGB>(surfaces, FacetHits { block, found, hits, shading, colors });
        }
        let ray: [u32; LANES] = carried.ray[run.clone()].try_into().unwrap_or([0; LANES]);
        let has_sheets = RICH && found.sheets != [0; LANES];
        let bands = carried.count::<RGB>();
        let asks = match (rules.asks_lights, RICH) {
            (false, _) => [0; LANES],
            (true, true) => found.asks(),
            (true, false) => found.scatters,
        };
        if asks != [0; LANES] {
            let light = square(Draw::Light);
            let mut places = match rules.chosen {
                None => place(lights, &hits.point, light),
                Some(chosen) => place_on_chosen(lights, chosen, &hits.point, &light, first),
            };
            let others = RICH.then(|| {
                OtherPlaces::of::<TILTED>(rules.chosen, &hits, &light, first, &mut places)
            });
            let mut asked =
                ask::<F, TILTED, RICH>(&places, others.as_ref(), offset, surfaces.roundings, &hits);
            if has_sheets {
                let LightRays { toward, pdf, value, .. } = &mut asked;
                let samples = LightSamples { toward, pdf, is_delta: &places.is_delta };
                output.facets.reflect(&found.sheets, samples, value);
            }
            if has_singles {
                let LightRays { toward, pdf, value, .. } = &mut asked;
                let samples = LightSamples { toward, pdf, is_delta: &places.is_delta };
                output.singles.reflect(tracing, &found, samples, value);
            }
            // Rows are worked out in locals: closures for them, and rows that change in place, go through memory.
            let mut three = [[F::ZERO; LANES]; 3];
            let shares: &mut [Row<F>] = if RGB { &mut three } else { output.shares };
            for band in 0..bands {
                let (mut share, arrived) = (colors[band], row(&carried.throughput[band]));
                if has_sheets {
                    output.facets.sheets_in_band(&found.sheets, band, &mut share);
                }
                if has_singles {
                    output.singles.in_band(&found, band, bands, &mut share);
                }
                for i in 0..LANES {
                    share[i] *= arrived[i] * asked.value[i];
                }
                if let (Some(others), Some(chosen)) = (&others, rules.chosen) {
                    let radiance = others.radiance(chosen, first, &places.light, band);
                    for i in 0..LANES {
                        share[i] *= radiance[i];
                    }
                }
                shares[band] = share;
            }
            let shadows = &mut *output.shadows;
            send::<F, RICH>(&asked, &places, &asks, [&ray, &lanes], shares, instructions, shadows);
        }
        if !rules.goes_on && !has_singles && (!RICH || found.smooth == [0; LANES]) {
            continue;
        }
        let has_matte = !RICH || found.has_matte();
        let mut left = scatter::<F, TILTED>(&hits, has_matte.then(|| square(Draw::Direction)));
        left.specular = found.smooth;
        for i in 0..LANES {
            left.goes[i] &= found.scatters[i];
        }
        if has_facets {
            let (choice, directions) = (square(Draw::Choice), square(Draw::Direction));
            output.facets.scatter(&found, &hits, &choice[1], &directions, &mut left);
        }
        if has_singles {
            let (choice, directions) = (square(Draw::Choice), square(Draw::Direction));
            output.singles.scatter(tracing, &found, &hits, &choice[1], &directions, &mut left);
        }
        if RICH && !rules.goes_on {
            for i in 0..LANES {
                left.goes[i] &= left.specular[i];
            }
        }
        if let Some(sphere) = &rules.sphere {
            keep_those_that_may_meet(sphere, surfaces.roundings, &mut left);
        }
        let mut three = [[F::ZERO; LANES]; 3];
        let throughput: &mut [Row<F>] = if RGB { &mut three } else { output.shares };
        for band in 0..bands {
            let (mut passed, arrived) = (colors[band], row(&carried.throughput[band]));
            if has_facets {
                output.facets.in_band(&found, band, &mut passed);
            }
            if has_singles {
                output.singles.in_band(&found, band, bands, &mut passed);
            }
            for i in 0..LANES {
                passed[i] *= arrived[i];
            }
            throughput[band] = passed;
        }
        end_some(throughput, &mut left.goes, rules.roulette.then(|| square(Draw::Chance)));
        let sky_chance = rules.chosen.filter(|chosen| RICH && !chosen.sky_chance.is_empty());
        let sky_chance = sky_chance.map(|chosen| row(&chosen.sky_chance));
        let flags = carried.flags.get(run.clone()).and_then(|flags| flags.try_into().ok());
        let flags = flags.unwrap_or([0; LANES]);
        let departing = BlockPaths { throughput, ray, flags, lanes, sky_chance };
        let shading = rules.chosen.is_some().then(|| hits.shading::<TILTED>());
        let (next, last) = (&mut *output.next, &mut *output.last);
        depart::<F, RICH>(&left, shading, &departing, &rules, instructions, next, last);
    }
}

/// Leaves out the surfaces that paths met which only look for light.
#[inline(always)]
fn leave_out<F: Lane>(found: &mut BlockLookup<F>, carried: &Columns<F>) {
    let Some(flags) = carried.flags.get(found.first..found.first + LANES) else { return };
    for i in 0..LANES {
        let goes_on = if flags[i] & LAST == 0 { u32::MAX } else { 0 };
        found.scatters[i] &= goes_on;
        found.sheets[i] &= goes_on;
        found.smooth[i] &= goes_on;
        found.single[i] &= goes_on;
    }
}

/// The numbers of a block's lanes, counted from the first block.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a batch has few")]
fn lanes_from(first: usize) -> [u32; LANES] {
    let mut lanes = [0; LANES];
    for i in 0..LANES {
        lanes[i] = (first + i) as u32;
    }
    lanes
}

/// Points, their errors, and normals on the viewer's side.
#[inline(always)]
fn measure<F: Lane>(
    Surfaces { roundings, edge_weight, .. }: Surfaces<'_, F>,
    block: &RayBlock<F>,
    found: &BlockLookup<F>,
    offset: [F; 3],
) -> Hits<F> {
    let magnitudes = &found.magnitudes;
    let [x, y, z] = &block.normal;
    let [dx, dy, dz] = &block.direction;
    let (mut normal, mut front) = ([[F::ZERO; LANES]; 3], [0; LANES]);
    for i in 0..LANES {
        let squared = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
        let along = x[i] * dx[i] + y[i] * dy[i] + z[i] * dz[i];
        front[i] = mask(along <= F::ZERO);
        let scale = if along <= F::ZERO { F::ONE } else { -F::ONE } / squared.sqrt();
        normal[0][i] = x[i] * scale;
        normal[1][i] = y[i] * scale;
        normal[2][i] = z[i] * scale;
    }
    let (mut point, mut error, mut most) =
        ([[F::ZERO; LANES]; 3], [F::ZERO; LANES], [F::ZERO; LANES]);
    for axis in 0..3 {
        let (start, direction) = (&block.origin[axis], &block.direction[axis]);
        for i in 0..LANES {
            let here = start[i] + direction[i] * block.t_max[i];
            let size = (here.abs() + start[i].abs()) + (magnitudes[axis][i] + offset[axis]);
            point[axis][i] = here;
            error[i] += normal[axis][i].abs() * size;
            most[i] = if size > most[i] { size } else { most[i] };
        }
    }
    let mut back = [[F::ZERO; LANES]; 3];
    for i in 0..LANES {
        error[i] *= roundings;
        let (u, v) = (block.u[i], block.v[i]);
        let (rest, least) = (F::ONE - u - v, if u < v { u } else { v });
        let least = if rest < least { rest } else { least };
        let is_at_edge = (least < edge_weight) & (found.passed[i] == 0);
        let amount = if is_at_edge { F::of(BACK) * roundings * most[i] } else { F::ZERO };
        let across = normal[0][i] * dx[i] + normal[1][i] * dy[i] + normal[2][i] * dz[i];
        back[0][i] = (normal[0][i] * across - dx[i]) * amount;
        back[1][i] = (normal[1][i] * across - dy[i]) * amount;
        back[2][i] = (normal[2][i] * across - dz[i]) * amount;
    }
    let bent = match &found.tilted {
        None => normal,
        Some(tilted) => bend(tilted, &normal, &block.direction),
    };
    Hits { point, normal, bent, error, back, passed: found.passed, front }
}
