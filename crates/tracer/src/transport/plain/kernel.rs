//! One step of a plain scene's paths: what is looked up for sixteen hits first, then arithmetic on their rows, then
//! the rays that leave them side by side.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4};
use std::hint::select_unpredictable;

use etendue_geometry::RayBlock;
use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::compaction::{Compaction, Instructions};
use super::lamps::{Lights, Places, place, place_on_chosen};
use super::surfaces::{Found, Surfaces, bend};
use super::{Columns, RayColumns};
use crate::light_tree::Choices;
use crate::transport::paths::{DRAWS, Draw};
use crate::transport::{kernels, patch};

/// Roundings of a hit and of the rays that leave it: those of [`crate::spawn`] in single precision, and as many
/// again of the point, of the normal and of the start, which are of single precision, too.
const ROUNDINGS: f32 = 12.0 * f32::EPSILON;

/// [`kernels::BACK`] and [`patch::BESIDE`], which single precision holds.
#[expect(clippy::cast_possible_truncation, reason = "a power of two")]
const BACK: f32 = kernels::BACK as f32;
#[expect(clippy::cast_possible_truncation, reason = "a power of two")]
const BESIDE: f32 = patch::BESIDE as f32;

/// Bits that are all set in lanes of which something holds, and 0 in the others: rows of `bool` are worked out one by
/// one.
pub(super) type Mask = [u32; LANES];

pub(super) const ZERO: Row = [0.0; LANES];

/// What a step does, and its random numbers by use, a number a lane.
pub(super) struct Numbers<'a> {
    pub(super) is_scattered: bool,
    pub(super) goes_on: bool,
    pub(super) roulette: bool,
    pub(super) drawn: &'a [[Vec<f32>; 2]; DRAWS as usize],
    /// The lamps that lanes chose, and with which chances, where they are many; what is left of the number that chose
    /// each is drawn.
    pub(super) chosen: Option<(&'a [u32], &'a [f32])>,
}

/// Where rays go that leave hits.
pub(super) struct Leaving<'a> {
    pub(super) shadows: &'a mut RayColumns,
    pub(super) next: &'a mut RayColumns,
    pub(super) seen: &'a mut Vec<u32>,
}

/// A sphere around all that shines, relative to the blocks' origin: its centre and its radius (m).
pub(super) type Sphere = ([f32; 3], f32);

/// The hits of a block.
struct Hits {
    point: [Row; 3],
    normal: [Row; 3],
    /// The normals of meshes that light is scattered about, on the viewer's side, where there are any.
    bent: [Row; 3],
    error: Row,
    back: [Row; 3],
}

impl Hits {
    /// The normals that light is scattered about.
    #[inline(always)]
    fn shading<const TILTED: bool>(&self) -> &[Row; 3] {
        if TILTED { &self.bent } else { &self.normal }
    }
}

/// The points of some blocks, where surfaces scatter light, that choose among many lamps by a number a lane; their lanes
/// go to `asking`, which has room for all.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn ask_for_lamps<const TILTED: bool>(
    (surfaces, origin): (Surfaces<'_>, DVec3),
    (blocks, carried): (&[RayBlock], &Columns),
    numbers: &[f32],
    (choices, asking): (&mut Choices, &mut [u32]),
) {
    let instructions = Instructions::of_machine();
    for (number, block) in blocks.iter().enumerate() {
        let first = number * LANES;
        let count = carried.len.saturating_sub(first);
        let found = Found::of::<TILTED>(surfaces, (block, count), |_| ());
        let own: &Row = numbers[first..first + LANES].try_into().unwrap_or(&ZERO);
        let hits = measure(block, &found, [0.0; 3]);
        let (wanted, at) = (Compaction::new(&found.scatters, instructions), choices.len());
        wanted.put(&lanes_from(first), asking, at);
        choices.push_some((&hits.point, origin), hits.shading::<TILTED>(), own, |row, to| {
            wanted.put(row, to, 0);
            wanted.count
        });
    }
}

/// A step of all paths of some blocks: lists those that met what shines, and notes the rays that leave.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn leave_blocks<const TILTED: bool>(
    (surfaces, lights): (Surfaces<'_>, &Lights<'_>),
    (blocks, carried): (&[RayBlock], &Columns),
    (numbers, sphere): (Numbers<'_>, Option<Sphere>),
    Leaving { shadows, next, seen }: Leaving<'_>,
) {
    // Blocks' coordinates are those of the world less their origin, whose roundings count as well.
    let offset = single(lights.origin).map(|axis| 2.0 * axis.abs());
    let instructions = Instructions::of_machine();
    for (number, block) in blocks.iter().enumerate() {
        let first = number * LANES;
        let count = carried.len.saturating_sub(first);
        let numbers_of_lanes = lanes_from(first);
        let meets = |lane: usize| seen.push(numbers_of_lanes[lane]);
        let found = Found::of::<TILTED>(surfaces, (block, count), meets);
        if !numbers.is_scattered || found.scatters == [0; LANES] {
            continue;
        }
        let hits = measure(block, &found, offset);
        let run = first..first + LANES;
        let row = |column: &[f32]| -> Row { column[run.clone()].try_into().unwrap_or(ZERO) };
        // (What maps arrays is a function of its own, compiled without wide registers.)
        let [red, green, blue] = &carried.throughput;
        let mut throughput = [row(red), row(green), row(blue)];
        for band in 0..3 {
            for i in 0..LANES {
                throughput[band][i] *= found.color[band][i];
            }
        }
        let square = |draw: Draw| {
            let [first, second] = &numbers.drawn[draw as usize];
            [row(first), row(second)]
        };
        let ray: [u32; LANES] = carried.ray[run.clone()].try_into().unwrap_or([0; LANES]);
        let light = square(Draw::Light);
        let places = match numbers.chosen {
            None => place(lights, &hits.point, light),
            Some((lamps, chances)) => {
                let own: &[u32; LANES] = lamps[run.clone()].try_into().unwrap_or(&[0; LANES]);
                place_on_chosen(lights, &hits.point, &light, (own, &row(chances)))
            }
        };
        let asking = (&found.scatters, &throughput, &ray);
        ask::<TILTED>((&places, offset), &hits, asking, (instructions, shadows));
        if !numbers.goes_on {
            continue;
        }
        let direction = square(Draw::Direction);
        let (start, along, pdf, mut goes) = scatter::<TILTED>(&hits, direction);
        for i in 0..LANES {
            goes[i] &= found.scatters[i];
        }
        let mut most = ZERO;
        for i in 0..LANES {
            let [r, g, b] = [throughput[0][i], throughput[1][i], throughput[2][i]];
            let larger = if g > r { g } else { r };
            most[i] = if b > larger { b } else { larger };
            goes[i] &= mask(most[i] > 0.0);
        }
        if let Some(sphere) = &sphere {
            keep_those_that_may_meet(sphere, (&start, &along), &mut goes);
        }
        if numbers.roulette {
            let [_, chance] = square(Draw::Chance);
            for i in 0..LANES {
                // Its root: where few paths come this far, ending them saves little and leaves noise.
                let root = most[i].sqrt();
                let survival = if root < 1.0 { root } else { 1.0 };
                goes[i] &= mask(chance[i] < survival);
                let inverse = if survival > 0.0 { 1.0 / survival } else { 0.0 };
                for band in 0..3 {
                    throughput[band][i] *= inverse;
                }
            }
        }
        let (going, at) = (Compaction::new(&goes, instructions), next.len);
        for axis in 0..3 {
            going.put(&start[axis], &mut next.start[axis], at);
            going.put(&along[axis], &mut next.along[axis], at);
            going.put(&throughput[axis], &mut next.carried.throughput[axis], at);
        }
        if numbers.chosen.is_some() {
            for axis in 0..3 {
                going.put(&hits.shading::<TILTED>()[axis], &mut next.carried.normal[axis], at);
            }
        }
        going.put(&pdf, &mut next.carried.pdf, at);
        going.put(&ray, &mut next.carried.ray, at);
        going.put(&[f32::INFINITY; LANES], &mut next.reach, at);
        going.put(&numbers_of_lanes, &mut next.left, at);
        next.len += going.count;
    }
}

#[inline(always)]
pub(super) fn mask(holds: bool) -> u32 {
    select_unpredictable(holds, u32::MAX, 0)
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

/// Points, their errors, and normals on the viewer's side, as [`super::super::kernels::measure`] has them.
#[inline(always)]
fn measure(block: &RayBlock, found: &Found, offset: [f32; 3]) -> Hits {
    let magnitudes = &found.magnitudes;
    let [x, y, z] = &block.normal;
    let [dx, dy, dz] = &block.direction;
    let mut normal = [ZERO; 3];
    for i in 0..LANES {
        let squared = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
        let along = x[i] * dx[i] + y[i] * dy[i] + z[i] * dz[i];
        let scale = if along <= 0.0 { 1.0 } else { -1.0 } / squared.sqrt();
        normal[0][i] = x[i] * scale;
        normal[1][i] = y[i] * scale;
        normal[2][i] = z[i] * scale;
    }
    let (mut point, mut error, mut most) = ([ZERO; 3], ZERO, ZERO);
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
    let mut back = [ZERO; 3];
    for i in 0..LANES {
        error[i] *= ROUNDINGS;
        let (u, v) = (block.u[i], block.v[i]);
        let (rest, least) = (1.0 - u - v, if u < v { u } else { v });
        let least = if rest < least { rest } else { least };
        let amount = if least < BESIDE { BACK * ROUNDINGS * most[i] } else { 0.0 };
        let across = normal[0][i] * dx[i] + normal[1][i] * dy[i] + normal[2][i] * dz[i];
        back[0][i] = (normal[0][i] * across - dx[i]) * amount;
        back[1][i] = (normal[1][i] * across - dy[i]) * amount;
        back[2][i] = (normal[2][i] * across - dz[i]) * amount;
    }
    let bent = match &found.tilted {
        None => normal,
        Some(tilted) => bend(tilted, &normal, &block.direction),
    };
    Hits { point, normal, bent, error, back }
}

/// Notes the rays to lamps, each with the share of the lamp's radiance that it brings, as
/// [`super::super::kernels::aim`] and [`super::super::kernels::reflect`] have them.
#[inline(always)]
fn ask<const TILTED: bool>(
    (places, offset): (&Places, [f32; 3]),
    hits: &Hits,
    (scatters, throughput, ray): (&Mask, &[Row; 3], &[u32; LANES]),
    (instructions, shadows): (Instructions, &mut RayColumns),
) {
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
    let mut value = ZERO;
    for i in 0..LANES {
        let inverse = 1.0 / squared[i].sqrt();
        let shown = facing[i] * inverse;
        let is_point = places.is_point[i] > 0.0;
        let shines = (shown > 0.0) | ((shown < 0.0) & (places.two_sided[i] > 0.0)) | is_point;
        let slope = select_unpredictable(is_point, 1.0, shown.abs());
        let pdf = places.density[i] * squared[i] / slope;
        let cosine = if TILTED { turned[i] } else { above[i] };
        let reflected = cosine * inverse * FRAC_1_PI;
        // No direction comes upon a point by chance.
        let ratio = select_unpredictable(is_point, 0.0, reflected / pdf);
        let share = reflected / ((1.0 + ratio * ratio) * pdf);
        value[i] = select_unpredictable(shines & (reflected > 0.0) & (above[i] > 0.0), share, 0.0);
        blur[i] *= if shown < 0.0 { -ROUNDINGS } else { ROUNDINGS };
    }
    let (mut start, mut along, mut length) = ([ZERO; 3], [ZERO; 3], ZERO);
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = hits.normal[axis][i] * hits.error[i] + hits.back[axis][i];
            let way = (places.way[axis][i] + places.normal[axis][i] * blur[i]) - lifted;
            start[axis][i] = hits.point[axis][i] + lifted;
            along[axis][i] = way;
            length[i] += way * way;
        }
    }
    let mut goes = [0; LANES];
    for i in 0..LANES {
        length[i] = length[i].sqrt();
        // Any comparison with NaN is false.
        goes[i] = scatters[i] & mask((value[i] > 0.0) & (value[i] <= f32::MAX));
    }
    for axis in 0..3 {
        for i in 0..LANES {
            // Points that fall together see each other: a ray of no length meets nothing.
            along[axis][i] /= if length[i] > 0.0 { length[i] } else { 1.0 };
        }
    }
    let mut share = [ZERO; 3];
    for band in 0..3 {
        for i in 0..LANES {
            share[band][i] = throughput[band][i] * value[i];
        }
    }
    let (going, at) = (Compaction::new(&goes, instructions), shadows.len);
    for axis in 0..3 {
        going.put(&start[axis], &mut shadows.start[axis], at);
        going.put(&along[axis], &mut shadows.along[axis], at);
        going.put(&share[axis], &mut shadows.carried.throughput[axis], at);
    }
    going.put(&length, &mut shadows.reach, at);
    going.put(&places.lamp, &mut shadows.lamp, at);
    going.put(ray, &mut shadows.carried.ray, at);
    shadows.len += going.count;
}

/// Where rays start (m), their unit directions about the shading normals with density cos θ / π (1/sr), that density, and
/// whether there is one, as [`super::super::kernels::scatter`] has them.
#[inline(always)]
fn scatter<const TILTED: bool>(hits: &Hits, [u, v]: [Row; 2]) -> ([Row; 3], [Row; 3], Row, Mask) {
    let ([nx, ny, nz], [gx, gy, gz]) = (hits.shading::<TILTED>(), &hits.normal);
    let (mut along, mut start, mut pdf) = ([ZERO; 3], [ZERO; 3], ZERO);
    let mut goes = [0; LANES];
    let (mut a, mut b) = (ZERO, ZERO);
    for i in 0..LANES {
        [a[i], b[i]] = disk_point([u[i], v[i]]);
    }
    for i in 0..LANES {
        let (x, y, z, a, b) = (nx[i], ny[i], nz[i], a[i], b[i]);
        let rest = 1.0 - a * a - b * b;
        let c = if rest > 0.0 { rest } else { 0.0 }.sqrt();
        // Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
        let sign = if z < 0.0 { -1.0 } else { 1.0 };
        let f = -1.0 / (sign + z);
        let g = x * y * f;
        let dx = (1.0 + sign * x * x * f) * a + g * b + x * c;
        let dy = sign * g * a + (sign + y * y * f) * b + y * c;
        let dz = z * c - sign * x * a - y * b;
        let inverse = 1.0 / (dx * dx + dy * dy + dz * dz).sqrt();
        along[0][i] = dx * inverse;
        along[1][i] = dy * inverse;
        along[2][i] = dz * inverse;
        pdf[i] = c * FRAC_1_PI;
        goes[i] = mask((dx * gx[i] + dy * gy[i] + dz * gz[i] > 0.0) & (c > 0.0));
    }
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = hits.normal[axis][i] * hits.error[i] + hits.back[axis][i];
            start[axis][i] = hits.point[axis][i] + lifted;
        }
    }
    (start, along, pdf, goes)
}

/// A point of the unit square on the unit disk, as [`etendue_geometry::disk::point`] has it.
#[inline(always)]
fn disk_point([u, v]: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let flat = a.abs() > b.abs();
    let (radius, other) = (select_unpredictable(flat, a, b), select_unpredictable(flat, b, a));
    let ratio = if radius == 0.0 { 0.0 } else { other / radius };
    // Taylor's series as far as π/4: what is left out is below 4 · 10⁻⁹.
    let angle = FRAC_PI_4 * ratio;
    let x = angle * angle;
    let sine = 1.0 + x * (-1.0 / 6.0 + x * (1.0 / 120.0 + x * (-1.0 / 5_040.0 + x / 362_880.0)));
    let cosine = -0.5 + x * (1.0 / 24.0 + x * (-1.0 / 720.0 + x / 40_320.0));
    let (sine, cosine) = (angle * sine, 1.0 + x * cosine);
    let (near, far) = (radius * cosine, radius * sine);
    [select_unpredictable(flat, near, far), select_unpredictable(flat, far, near)]
}

/// Leaves out rays that meet nothing of a sphere for sure.
#[inline(always)]
fn keep_those_that_may_meet(
    (centre, radius): &Sphere,
    (start, along): (&[Row; 3], &[Row; 3]),
    goes: &mut Mask,
) {
    let (mut foot, mut squared) = (ZERO, ZERO);
    for axis in 0..3 {
        for i in 0..LANES {
            let way = centre[axis] - start[axis][i];
            foot[i] += way * along[axis][i];
            squared[i] += way * way;
        }
    }
    let within = radius * radius;
    for i in 0..LANES {
        let is_ahead = (foot[i] >= 0.0) | (squared[i] <= within);
        // Roundings of what is subtracted.
        let slack = ROUNDINGS * squared[i];
        let is_near = squared[i] - foot[i] * foot[i] <= within + slack;
        goes[i] &= mask((*radius >= 0.0) & is_ahead & is_near);
    }
}

pub(super) fn single(v: DVec3) -> [f32; 3] {
    v.to_array().map(round)
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
pub(super) fn round(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use etendue_geometry::disk;

    use super::*;

    #[test]
    fn points_on_the_disk_are_those_of_double_precision() {
        for i in 0..=64_u8 {
            for k in 0..=64_u8 {
                let square = [i, k].map(|n| f32::from(n) / 64.0);
                let [own, other] =
                    [disk_point(square).map(f64::from), disk::point(square.map(f64::from))];
                // Some roundings of numbers below 1.
                let error = (own[0] - other[0]).abs().max((own[1] - other[1]).abs());
                assert!(error < 4.0 * f64::from(f32::EPSILON), "{square:?}: {error}");
            }
        }
    }
}
