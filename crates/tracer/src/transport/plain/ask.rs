//! Lights that are asked by the hits of a block, and the rays to them.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f32::consts::FRAC_1_PI;

use etendue_geometry::block::{Floats as Row, LANES};

use super::columns::RayColumns;
use super::kernel::{BlockScratch, Carried, Hits, ROUNDINGS, Stage, ZERO, compress, offset, put};
use super::lamps::{Places, place};

/// Rays from hits to the places that they ask.
struct Aimed {
    /// To the place itself (unit), with its density (1/sr).
    toward: [Row; 3],
    pdf: Row,
    /// It shines to this side.
    shines: [bool; LANES],
    /// Where a ray begins (m), its unit direction, and how far it goes (m).
    start: [Row; 3],
    along: [Row; 3],
    reach: Row,
}

/// Notes the rays to lights, each with what it brings of its light's radiance.
#[inline(always)]
pub(super) fn ask(
    stage: &Stage<'_>,
    hits: &Hits,
    square: [Row; 2],
    Carried { ray, throughput }: &Carried,
    (shadows, BlockScratch { asking, sheets }): (&mut RayColumns, &mut BlockScratch),
) {
    let places = place(stage, hits, square, asking);
    let aimed = aim(stage, hits, &places);
    let mut value = reflect(hits, &aimed, &places);
    let mut color = hits.color;
    if hits.has_sheets {
        let asked = (&aimed.toward, &aimed.pdf, &places.is_delta);
        sheets.reflect(hits, asked, (&mut value, &mut color));
    }
    let mut goes = [false; LANES];
    for i in 0..LANES {
        // Any comparison with NaN is false.
        let counts = (value[i] > 0.0) & (value[i] < f32::INFINITY);
        goes[i] = hits.scatters[i] & aimed.shines[i] & counts;
    }
    let mut share = [ZERO; 3];
    for band in 0..3 {
        for i in 0..LANES {
            share[band][i] = throughput[band][i] * color[band][i] * value[i];
        }
        if let Some(light) = &places.light {
            for i in 0..LANES {
                share[band][i] *= light[band][i];
            }
        }
    }
    let (picked, count) = compress(&goes);
    let at = shadows.len;
    for axis in 0..3 {
        put(&mut shadows.start[axis], at, &aimed.start[axis], &picked);
        put(&mut shadows.along[axis], at, &aimed.along[axis], &picked);
        put(&mut shadows.carried.throughput[axis], at, &share[axis], &picked);
    }
    put(&mut shadows.reach, at, &aimed.reach, &picked);
    put(&mut shadows.lamp, at, &places.lamp, &picked);
    put(&mut shadows.carried.ray, at, ray, &picked);
    shadows.len += count;
}

/// Rays to places, as [`super::super::kernels::aim`] has them.
#[inline(always)]
fn aim(stage: &Stage<'_>, hits: &Hits, places: &Places) -> Aimed {
    let (mut squared, mut facing, mut blur) = (ZERO, ZERO, ZERO);
    let offset = offset(stage.plain.origin);
    for axis in 0..3 {
        for i in 0..LANES {
            let (here, way) = (hits.point[axis][i], places.way[axis][i]);
            squared[i] += way * way;
            facing[i] -= way * places.normal[axis][i];
            let size =
                (here.abs() + (here + way).abs()) + (places.magnitudes[axis][i] + offset[axis]);
            blur[i] += places.normal[axis][i].abs() * size;
        }
    }
    let mut inverse = ZERO;
    let (mut pdf, mut shines) = (ZERO, [false; LANES]);
    for i in 0..LANES {
        inverse[i] = 1.0 / squared[i].sqrt();
        let shown = facing[i] * inverse[i];
        let is_bare = places.is_bare[i];
        shines[i] = (shown > 0.0) | ((shown < 0.0) & places.two_sided[i]) | is_bare;
        let over = places.density[i] * squared[i] / if is_bare { 1.0 } else { shown.abs() };
        pdf[i] = if places.is_far[i] { places.density[i] } else { over };
        blur[i] *= if shown < 0.0 { -ROUNDINGS } else { ROUNDINGS };
    }
    let (mut toward, mut start, mut along) = ([ZERO; 3], [ZERO; 3], [ZERO; 3]);
    let mut reach = ZERO;
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = hits.normal[axis][i] * hits.error[i] + hits.back[axis][i];
            let way = places.way[axis][i];
            toward[axis][i] = way * inverse[i];
            let near = (way + places.normal[axis][i] * blur[i]) - lifted;
            let way = if places.is_far[i] { way } else { near };
            start[axis][i] = hits.point[axis][i] + lifted;
            along[axis][i] = way;
            reach[i] += way * way;
        }
    }
    for i in 0..LANES {
        reach[i] = reach[i].sqrt();
    }
    for axis in 0..3 {
        for i in 0..LANES {
            // Points that fall together see each other: a ray of no length meets nothing.
            along[axis][i] /= if reach[i] > 0.0 { reach[i] } else { 1.0 };
        }
    }
    for i in 0..LANES {
        reach[i] = if places.is_far[i] { f32::INFINITY } else { reach[i] };
    }
    Aimed { toward, pdf, shines, start, along, reach }
}

/// What matte surfaces turn to the viewer of the light that is asked, over its density, as
/// [`super::super::kernels::reflect`] has it.
#[inline(always)]
fn reflect(hits: &Hits, aimed: &Aimed, places: &Places) -> Row {
    let (mut cosine, mut above) = (ZERO, ZERO);
    for axis in 0..3 {
        for i in 0..LANES {
            cosine[i] += aimed.toward[axis][i] * hits.shading[axis][i];
            above[i] += aimed.toward[axis][i] * hits.normal[axis][i];
        }
    }
    let mut value = ZERO;
    for i in 0..LANES {
        let reflected = cosine[i] * FRAC_1_PI;
        let pdf = aimed.pdf[i];
        let ratio = if places.is_delta[i] { 0.0 } else { reflected / pdf };
        let share = reflected / ((1.0 + ratio * ratio) * pdf);
        value[i] = if (reflected > 0.0) & (above[i] > 0.0) { share } else { 0.0 };
    }
    value
}
