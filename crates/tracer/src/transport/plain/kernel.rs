//! One step of a plain scene's paths: what is looked up for sixteen hits first, then arithmetic on their rows, then
//! the rays that leave them side by side.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4};

use etendue_geometry::block::{Floats as Row, LANES, vector};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{RayBatch, RayBlock};

use super::ask::ask;
use super::columns::{Columns, RayColumns};
use super::lamps::Asking;
use super::scene::PlainScene;
use super::surfaces::{PlainSheets, look_up};
use crate::LightingContext;
use crate::placed::PlainSurface;
use crate::transport::paths::{DRAWS, Draw};
use crate::transport::{kernels, patch};

/// Roundings of a hit and of the rays that leave it: those of [`crate::spawn`] in single precision, and as many
/// again of the point, of the normal and of the start, which are of single precision, too.
pub(super) const ROUNDINGS: f32 = 12.0 * f32::EPSILON;

/// [`kernels::BACK`] and [`patch::BESIDE`], which single precision holds.
#[expect(clippy::cast_possible_truncation, reason = "a power of two")]
const BACK: f32 = kernels::BACK as f32;
#[expect(clippy::cast_possible_truncation, reason = "a power of two")]
const BESIDE: f32 = patch::BESIDE as f32;

pub(super) const ZERO: Row = [0.0; LANES];

/// The scene, and the camera's rays where they are the ones that hit.
pub(super) struct Stage<'a> {
    pub(super) ctx: &'a LightingContext<'a>,
    pub(super) plain: &'a PlainScene,
    pub(super) camera: Option<&'a RayBatch>,
}

/// What a step does, and its random numbers by use, a number a lane.
pub(super) struct Numbers<'a> {
    pub(super) is_scattered: bool,
    pub(super) goes_on: bool,
    pub(super) roulette: bool,
    pub(super) drawn: &'a [[Vec<f32>; 2]; DRAWS as usize],
}

/// Where rays go that leave hits.
pub(super) struct Leaving<'a> {
    pub(super) shadows: &'a mut RayColumns,
    pub(super) next: &'a mut RayColumns,
    /// Hits on what shines, and rays that hit nothing.
    pub(super) seen: &'a mut Vec<u32>,
    pub(super) missed: &'a mut Vec<u32>,
}

/// Memory of a block, kept for the next.
#[derive(Debug, Default)]
pub(in crate::transport) struct BlockScratch {
    pub(super) asking: Asking,
    pub(super) sheets: Box<PlainSheets>,
}

/// A sphere around all that shines, relative to the blocks' origin: its centre and its radius (m).
pub(super) type Sphere = ([f32; 3], f32);

/// The hits of a block.
pub(super) struct Hits {
    pub(super) color: [Row; 3],
    pub(super) magnitudes: [Row; 3],
    pub(super) scatters: [bool; LANES],
    /// Those that have to be looked up one by one, and those on sheets of facets.
    pub(super) varies: [bool; LANES],
    pub(super) is_sheet: [bool; LANES],
    pub(super) has_sheets: bool,
    pub(super) point: [Row; 3],
    /// Of the triangle and as light is scattered by, on the viewer's side (unit).
    pub(super) normal: [Row; 3],
    pub(super) shading: [Row; 3],
    pub(super) error: Row,
    pub(super) back: [Row; 3],
}

impl Hits {
    const NONE: Self = Self {
        color: [ZERO; 3],
        magnitudes: [ZERO; 3],
        scatters: [false; LANES],
        varies: [false; LANES],
        is_sheet: [false; LANES],
        has_sheets: false,
        point: [ZERO; 3],
        normal: [ZERO; 3],
        shading: [ZERO; 3],
        error: ZERO,
        back: [ZERO; 3],
    };
}

/// The paths of a block: the camera's rays, and what they carry.
pub(super) struct Carried {
    pub(super) ray: [u32; LANES],
    pub(super) throughput: [Row; 3],
}

/// A step of all paths of some blocks: lists those that met what shines or nothing, and notes the rays that leave.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn leave_blocks(
    stage: &Stage<'_>,
    (blocks, paths): (&[RayBlock], &Columns),
    (numbers, sphere): (&Numbers<'_>, Option<Sphere>),
    leaving: &mut Leaving<'_>,
    scratch: &mut BlockScratch,
) {
    for (number, block) in blocks.iter().enumerate() {
        let first = number * LANES;
        let lanes = lanes_from(first);
        let mut hits = Hits::NONE;
        let count = paths.len.saturating_sub(first);
        let [any, varies] =
            gather(&stage.plain.surfaces, (block, lanes, count), &mut hits, leaving);
        if !(any & numbers.is_scattered) {
            continue;
        }
        measure(block, stage.plain.origin, &mut hits);
        if varies {
            look_up(stage, (block, first), &mut hits, &mut scratch.sheets);
        }
        let mut carried = Carried { ray: [0; LANES], throughput: [ZERO; 3] };
        carried.ray.copy_from_slice(&paths.ray[first..first + LANES]);
        for band in 0..3 {
            carried.throughput[band] = row(&paths.throughput[band], first);
        }
        let square = |draw: Draw| {
            let [first_of, second_of] = &numbers.drawn[draw as usize];
            [row(first_of, first), row(second_of, first)]
        };
        let square_of_light = square(Draw::Light);
        ask(stage, &hits, square_of_light, &carried, (&mut *leaving.shadows, &mut *scratch));
        if numbers.goes_on {
            let [_, choices] = square(Draw::Choice);
            let chances = numbers.roulette.then(|| square(Draw::Chance)[1]);
            let drawn = (square(Draw::Direction), choices, chances);
            let sheets = &mut scratch.sheets;
            follow((&hits, lanes, carried), drawn, (stage, sphere.as_ref()), sheets, leaving.next);
        }
    }
}

/// A row of a column.
#[inline(always)]
fn row(column: &[f32], first: usize) -> Row {
    let mut row = ZERO;
    row.copy_from_slice(&column[first..first + LANES]);
    row
}

/// What the surfaces of a block's hits are, of which so many lanes count; whether any scatters light, and whether any
/// has to be looked up.
#[inline(always)]
fn gather(
    surfaces: &[PlainSurface],
    (block, lanes, count): (&RayBlock, [u32; LANES], usize),
    hits: &mut Hits,
    leaving: &mut Leaving<'_>,
) -> [bool; 2] {
    let Some(last) = surfaces.len().checked_sub(1) else { return [false; 2] };
    let [mut any, mut varies] = [false; 2];
    for lane in 0..LANES {
        let surface = &surfaces[(block.placement[lane] as usize).min(last)];
        for axis in 0..3 {
            hits.color[axis][lane] = surface.color[axis];
            hits.magnitudes[axis][lane] = surface.magnitudes[axis];
        }
        let counts = lane < count;
        let is_hit = surface.is_there & counts;
        hits.scatters[lane] = surface.scatters & is_hit;
        hits.varies[lane] = surface.varies & is_hit;
        hits.is_sheet[lane] = surface.is_sheet & is_hit;
        any |= hits.scatters[lane];
        varies |= hits.varies[lane];
        hits.has_sheets |= hits.is_sheet[lane];
        if surface.shines & is_hit {
            leaving.seen.push(lanes[lane]);
        }
        if !surface.is_there & counts {
            leaving.missed.push(lanes[lane]);
        }
    }
    [any, varies]
}

/// Chooses directions, and notes the paths along those that carry something and do not end by chance.
#[inline(always)]
fn follow(
    (hits, lanes, mut carried): (&Hits, [u32; LANES], Carried),
    (squares, choices, chances): ([Row; 2], Row, Option<Row>),
    (stage, sphere): (&Stage<'_>, Option<&Sphere>),
    sheets: &mut PlainSheets,
    next: &mut RayColumns,
) {
    let (start, mut along, mut pdf, mut goes) = scatter(hits, squares);
    let throughput = &mut carried.throughput;
    for band in 0..3 {
        for i in 0..LANES {
            throughput[band][i] *= if hits.is_sheet[i] { 1.0 } else { hits.color[band][i] };
        }
    }
    if hits.has_sheets {
        sheets.scatter(hits, (&choices, squares), (&mut along, &mut pdf, &mut goes), throughput);
    }
    for i in 0..LANES {
        goes[i] &= hits.scatters[i];
    }
    let mut most = ZERO;
    for i in 0..LANES {
        let [r, g, b] = [throughput[0][i], throughput[1][i], throughput[2][i]];
        let larger = if g > r { g } else { r };
        most[i] = if b > larger { b } else { larger };
        goes[i] &= most[i] > 0.0;
    }
    if let Some(sphere) = sphere {
        keep_those_that_may_meet(sphere, (&start, &along), &mut goes);
    }
    if let Some(chance) = chances {
        for i in 0..LANES {
            // Its root: where few paths come this far, ending them saves little and leaves noise.
            let root = most[i].sqrt();
            let survival = if root < 1.0 { root } else { 1.0 };
            goes[i] &= chance[i] < survival;
            let inverse = if survival > 0.0 { 1.0 / survival } else { 0.0 };
            for band in 0..3 {
                throughput[band][i] *= inverse;
            }
        }
    }
    let (picked, count) = compress(&goes);
    let at = next.len;
    for axis in 0..3 {
        put(&mut next.start[axis], at, &start[axis], &picked);
        put(&mut next.along[axis], at, &along[axis], &picked);
        put(&mut next.carried.throughput[axis], at, &throughput[axis], &picked);
        if stage.plain.has_receivers {
            put(&mut next.carried.normal[axis], at, &hits.shading[axis], &picked);
        }
    }
    put(&mut next.carried.pdf, at, &pdf, &picked);
    put(&mut next.carried.ray, at, &carried.ray, &picked);
    put(&mut next.reach, at, &[f32::INFINITY; LANES], &picked);
    put(&mut next.left, at, &lanes, &picked);
    next.len += count;
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

/// Points, their errors, and normals of triangles on the viewer's side, as [`super::super::kernels::measure`] has them.
#[inline(always)]
fn measure(block: &RayBlock, origin: DVec3, hits: &mut Hits) {
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
    let offset = offset(origin);
    for axis in 0..3 {
        let (start, direction) = (&block.origin[axis], &block.direction[axis]);
        for i in 0..LANES {
            let here = start[i] + direction[i] * block.t_max[i];
            let size = (here.abs() + start[i].abs()) + (hits.magnitudes[axis][i] + offset[axis]);
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
    (hits.point, hits.error, hits.back) = (point, error, back);
    (hits.normal, hits.shading) = (normal, normal);
}

/// Where rays start (m), their unit directions about the normals with density cos θ / π (1/sr), that density, and
/// whether there is one, as [`super::super::kernels::scatter`] has them.
#[inline(always)]
fn scatter(hits: &Hits, [u, v]: [Row; 2]) -> ([Row; 3], [Row; 3], Row, [bool; LANES]) {
    let [nx, ny, nz] = &hits.shading;
    let (mut along, mut start, mut pdf) = ([ZERO; 3], [ZERO; 3], ZERO);
    let mut goes = [false; LANES];
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
        let above = dx * hits.normal[0][i] + dy * hits.normal[1][i] + dz * hits.normal[2][i];
        goes[i] = (above > 0.0) & (c > 0.0);
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
    let (radius, other) = if flat { (a, b) } else { (b, a) };
    let ratio = if radius == 0.0 { 0.0 } else { other / radius };
    // Taylor's series as far as π/4: what is left out is below 4 · 10⁻⁹.
    let angle = FRAC_PI_4 * ratio;
    let x = angle * angle;
    let sine = 1.0 + x * (-1.0 / 6.0 + x * (1.0 / 120.0 + x * (-1.0 / 5_040.0 + x / 362_880.0)));
    let cosine = -0.5 + x * (1.0 / 24.0 + x * (-1.0 / 720.0 + x / 40_320.0));
    let (sine, cosine) = (angle * sine, 1.0 + x * cosine);
    if flat { [radius * cosine, radius * sine] } else { [radius * sine, radius * cosine] }
}

/// Leaves out rays that meet nothing of a sphere for sure.
#[inline(always)]
fn keep_those_that_may_meet(
    (centre, radius): &Sphere,
    (start, along): (&[Row; 3], &[Row; 3]),
    goes: &mut [bool; LANES],
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
        goes[i] &= (*radius >= 0.0) & is_ahead & (squared[i] - foot[i] * foot[i] <= within + slack);
    }
}

/// The lanes of a mask in order, and how many there are: without a branch, as nothing tells beforehand which they
/// are.
#[inline(always)]
pub(super) fn compress(mask: &[bool; LANES]) -> ([u8; LANES], usize) {
    let (mut picked, mut count) = ([0; LANES], 0);
    for (lane, &is_in) in (0_u8..).zip(mask) {
        picked[count & (LANES - 1)] = lane;
        count += usize::from(is_in);
    }
    (picked, count)
}

/// Puts the picked lanes of a row into a column, which has room for all lanes.
#[inline(always)]
pub(super) fn put<T: Copy>(column: &mut [T], at: usize, row: &[T; LANES], picked: &[u8; LANES]) {
    let to = &mut column[at..at + LANES];
    for (to, &lane) in to.iter_mut().zip(picked) {
        *to = row[usize::from(lane) & (LANES - 1)];
    }
}

/// The vector of a lane in double precision.
#[inline(always)]
pub(super) fn double(axes: &[Row; 3], lane: usize) -> DVec3 {
    vector(axes, lane)
}

#[inline(always)]
pub(super) fn single(v: DVec3) -> [f32; 3] {
    [round(v.x), round(v.y), round(v.z)]
}

/// What the blocks' origin adds to the size of coordinates (m): they are those of the world less it, whose roundings
/// count as well.
#[inline(always)]
pub(super) fn offset(origin: DVec3) -> [f32; 3] {
    let [x, y, z] = single(origin);
    [2.0 * x.abs(), 2.0 * y.abs(), 2.0 * z.abs()]
}

#[inline(always)]
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
