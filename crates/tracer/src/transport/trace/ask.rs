//! Rays from hits to the lights that they ask.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f64::consts::FRAC_1_PI;
use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};

use super::RayColumns;
use super::block_lights::{OtherPlaces, Places};
use super::compaction::{Compaction, Instructions, Mask, mask};
use super::lane::Lane;
use super::surfaces::Hits;

/// The rays to lights.
pub(super) struct LightRays<F> {
    start: [Row<F>; 3],
    along: [Row<F>; 3],
    length: Row<F>,
    /// From the hit itself to its light (unit), and the density of that (1/sr): infinite where the light does not shine
    /// to there.
    pub(super) toward: [Row<F>; 3],
    pub(super) pdf: Row<F>,
    /// The share of the light's radiance that comes from there, per colour.
    pub(super) value: Row<F>,
}

/// The rays to lights, each with the share of the light's radiance that a matte surface turns to the viewer.
#[inline(always)]
pub(super) fn ask<F: Lane, const TILTED: bool, const RICH: bool>(
    places: &Places<F>,
    others: Option<&OtherPlaces<F>>,
    offset: [F; 3],
    roundings: F,
    hits: &Hits<F>,
) -> LightRays<F> {
    let (mut squared, mut facing, mut above, mut blur) =
        ([F::ZERO; LANES], [F::ZERO; LANES], [F::ZERO; LANES], [F::ZERO; LANES]);
    let mut turned = [F::ZERO; LANES];
    for axis in 0..3 {
        for i in 0..LANES {
            let (here, way) = (hits.point[axis][i], places.way[axis][i]);
            squared[i] += way * way;
            facing[i] -= way * places.normal[axis][i];
            above[i] += way * hits.normal[axis][i];
            if TILTED {
                turned[i] += way * hits.bent[axis][i];
            }
            let size =
                (here.abs() + (here + way).abs()) + (places.magnitudes[axis][i] + offset[axis]);
            blur[i] += places.normal[axis][i].abs() * size;
        }
    }
    let (mut value, mut pdf, mut toward) =
        ([F::ZERO; LANES], [F::ZERO; LANES], [[F::ZERO; LANES]; 3]);
    for i in 0..LANES {
        let inverse = F::ONE / squared[i].sqrt();
        let shown = facing[i] * inverse;
        let is_delta = places.is_delta[i] > F::ZERO;
        let has_side = others.map_or(!is_delta, |others| others.has_side[i] > F::ZERO);
        let shines =
            (shown > F::ZERO) | ((shown < F::ZERO) & (places.two_sided[i] > F::ZERO)) | !has_side;
        let slope = select_unpredictable(has_side, shown.abs(), F::ONE);
        let own = places.density[i] * squared[i] / slope;
        let cosine = if TILTED { turned[i] } else { above[i] };
        let reflected = cosine * inverse * F::of(FRAC_1_PI);
        // No direction comes upon a point by chance.
        let ratio = select_unpredictable(is_delta, F::ZERO, reflected / own);
        let share = reflected / ((F::ONE + ratio * ratio) * own);
        value[i] = select_unpredictable(
            shines & (reflected > F::ZERO) & (above[i] > F::ZERO),
            share,
            F::ZERO,
        );
        blur[i] *= if shown < F::ZERO { -roundings } else { roundings };
        if RICH {
            pdf[i] = select_unpredictable(shines, own, F::INFINITY);
            for axis in 0..3 {
                toward[axis][i] = places.way[axis][i] * inverse;
            }
        }
    }
    let mut side = hits.error;
    if RICH {
        for i in 0..LANES {
            let is_behind = (hits.passed[i] != 0) & (above[i] < F::ZERO);
            side[i] = if is_behind { -hits.error[i] } else { hits.error[i] };
        }
    }
    let (mut start, mut along, mut length) =
        ([[F::ZERO; LANES]; 3], [[F::ZERO; LANES]; 3], [F::ZERO; LANES]);
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = hits.normal[axis][i] * side[i] + hits.back[axis][i];
            let way = (places.way[axis][i] + places.normal[axis][i] * blur[i]) - lifted;
            let is_far = others.is_some_and(|others| others.is_far[i] > F::ZERO);
            let way = select_unpredictable(is_far, places.way[axis][i], way);
            start[axis][i] = hits.point[axis][i] + lifted;
            along[axis][i] = way;
            length[i] += way * way;
        }
    }
    for i in 0..LANES {
        length[i] = length[i].sqrt();
        for axis in 0..3 {
            // Points that fall together see each other: a ray of no length meets nothing.
            along[axis][i] /= if length[i] > F::ZERO { length[i] } else { F::ONE };
        }
        let is_far = others.is_some_and(|others| others.is_far[i] > F::ZERO);
        length[i] = select_unpredictable(is_far, F::INFINITY, length[i]);
    }
    LightRays { start, along, length, toward, pdf, value }
}

/// Notes the rays to lights that bring some share of their radiance, by band.
#[inline(always)]
pub(super) fn send<F: Lane, const RICH: bool>(
    asked: &LightRays<F>,
    places: &Places<F>,
    asks: &Mask,
    [ray, lanes]: [&[u32; LANES]; 2],
    shares: &[Row<F>],
    instructions: Instructions,
    shadows: &mut RayColumns<F>,
) {
    let mut goes = [0; LANES];
    for i in 0..LANES {
        // Any comparison with NaN is false.
        goes[i] = asks[i] & mask((asked.value[i] > F::ZERO) & (asked.value[i] <= F::MAX));
    }
    let (going, at) = (Compaction::new(&goes, instructions), shadows.len);
    for axis in 0..3 {
        going.put(&asked.start[axis], &mut shadows.start[axis], at);
        going.put(&asked.along[axis], &mut shadows.along[axis], at);
    }
    for (share, column) in shares.iter().zip(&mut shadows.carried.throughput) {
        going.put(share, column, at);
    }
    going.put(&asked.length, &mut shadows.reach, at);
    going.put(&places.light, &mut shadows.light, at);
    going.put(ray, &mut shadows.carried.ray, at);
    if RICH || F::HAS_ENDS {
        going.put(lanes, &mut shadows.left, at);
    }
    shadows.len += going.count;
}
