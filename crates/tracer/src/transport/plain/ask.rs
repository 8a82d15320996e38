//! Rays from hits to the lights that they ask.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f32::consts::FRAC_1_PI;
use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};

use super::RayColumns;
use super::compaction::{Compaction, Instructions};
use super::kernel::{Hits, Mask, ROUNDINGS, ZERO, mask};
use super::lamps::{OtherPlaces, Places};

/// The rays to lights.
pub(super) struct LightRays {
    start: [Row; 3],
    along: [Row; 3],
    length: Row,
    /// From the hit itself to its light (unit), and the density of that (1/sr).
    pub(super) toward: [Row; 3],
    pub(super) pdf: Row,
    /// The share of the light's radiance that comes from there, per colour.
    pub(super) value: Row,
}

/// The rays to lights, each with the share of the light's radiance that a matte surface turns to the viewer, as
/// [`super::super::kernels::aim`] and [`super::super::kernels::reflect`] have them.
#[inline(always)]
pub(super) fn ask<const TILTED: bool, const RICH: bool>(
    (places, others, offset): (&Places, Option<&OtherPlaces>, [f32; 3]),
    hits: &Hits,
) -> LightRays {
    let (mut squared, mut facing, mut above, mut blur) = (ZERO, ZERO, ZERO, ZERO);
    let mut turned = ZERO;
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
    let (mut value, mut pdf, mut toward) = (ZERO, ZERO, [ZERO; 3]);
    for i in 0..LANES {
        let inverse = 1.0 / squared[i].sqrt();
        let shown = facing[i] * inverse;
        let is_delta = places.is_delta[i] > 0.0;
        let has_side = others.map_or(!is_delta, |others| others.has_side[i] > 0.0);
        let shines = (shown > 0.0) | ((shown < 0.0) & (places.two_sided[i] > 0.0)) | !has_side;
        let slope = select_unpredictable(has_side, shown.abs(), 1.0);
        let own = places.density[i] * squared[i] / slope;
        let cosine = if TILTED { turned[i] } else { above[i] };
        let reflected = cosine * inverse * FRAC_1_PI;
        // No direction comes upon a point by chance.
        let ratio = select_unpredictable(is_delta, 0.0, reflected / own);
        let share = reflected / ((1.0 + ratio * ratio) * own);
        value[i] = select_unpredictable(shines & (reflected > 0.0) & (above[i] > 0.0), share, 0.0);
        blur[i] *= if shown < 0.0 { -ROUNDINGS } else { ROUNDINGS };
        if RICH {
            pdf[i] = select_unpredictable(shines, own, f32::INFINITY);
            for axis in 0..3 {
                toward[axis][i] = places.way[axis][i] * inverse;
            }
        }
    }
    let mut side = hits.error;
    if RICH {
        for i in 0..LANES {
            let is_behind = (hits.passed[i] != 0) & (above[i] < 0.0);
            side[i] = if is_behind { -hits.error[i] } else { hits.error[i] };
        }
    }
    let (mut start, mut along, mut length) = ([ZERO; 3], [ZERO; 3], ZERO);
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = hits.normal[axis][i] * side[i] + hits.back[axis][i];
            let way = (places.way[axis][i] + places.normal[axis][i] * blur[i]) - lifted;
            let is_far = others.is_some_and(|others| others.is_far[i] > 0.0);
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
            along[axis][i] /= if length[i] > 0.0 { length[i] } else { 1.0 };
        }
        let is_far = others.is_some_and(|others| others.is_far[i] > 0.0);
        length[i] = select_unpredictable(is_far, f32::INFINITY, length[i]);
    }
    LightRays { start, along, length, toward, pdf, value }
}

/// Notes the rays to lights that bring some share of their radiance, by band.
#[inline(always)]
pub(super) fn send(
    asked: &LightRays,
    places: &Places,
    (asks, ray, shares): (&Mask, &[u32; LANES], &[Row]),
    (instructions, shadows): (Instructions, &mut RayColumns),
) {
    let mut goes = [0; LANES];
    for i in 0..LANES {
        // Any comparison with NaN is false.
        goes[i] = asks[i] & mask((asked.value[i] > 0.0) & (asked.value[i] <= f32::MAX));
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
    going.put(&places.lamp, &mut shadows.lamp, at);
    going.put(ray, &mut shadows.carried.ray, at);
    shadows.len += going.count;
}
