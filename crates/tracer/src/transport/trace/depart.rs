//! Paths that leave hits: their directions by matte surfaces, those that end, and what the others carry.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f64::consts::{FRAC_1_PI, FRAC_PI_4};
use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};

use super::compaction::{Compaction, Instructions, Mask, mask};
use super::facets::BsdfSamples;
use super::kernel::StepRules;
use super::lane::Lane;
use super::surfaces::Hits;
use super::{LAST, RayColumns, SCATTERED, SPECULAR};
use crate::emitters::EmitterSphere;

/// Leaves out paths that carry nothing and, by roulette, some of those that carry little of their largest band.
#[inline(always)]
pub(super) fn end_some<F: Lane>(
    throughput: &mut [Row<F>],
    goes: &mut Mask,
    roulette: Option<[Row<F>; 2]>,
) {
    let mut most = [F::ZERO; LANES];
    for band in &*throughput {
        for i in 0..LANES {
            most[i] = if band[i] > most[i] { band[i] } else { most[i] };
        }
    }
    for i in 0..LANES {
        goes[i] &= mask(most[i] > F::ZERO);
    }
    let Some([_, chance]) = roulette else { return };
    let mut more = [F::ONE; LANES];
    for i in 0..LANES {
        // Its root: where few paths come this far, ending them saves little and leaves noise.
        let root = most[i].sqrt();
        let survival = if root < F::ONE { root } else { F::ONE };
        goes[i] &= mask(chance[i] < survival);
        more[i] = if survival > F::ZERO { F::ONE / survival } else { F::ZERO };
    }
    for band in throughput {
        for i in 0..LANES {
            band[i] *= more[i];
        }
    }
}

/// The paths of a block that leave its hits, with what they carry.
pub(super) struct BlockPaths<'a, F> {
    /// By band.
    pub(super) throughput: &'a [Row<F>],
    pub(super) ray: [u32; LANES],
    /// With which they arrived.
    pub(super) flags: [u32; LANES],
    pub(super) lanes: [u32; LANES],
    pub(super) sky_chance: Option<Row<F>>,
}

/// Notes the paths that leave a block's hits.
#[inline(always)]
pub(super) fn depart<F: Lane, const RICH: bool>(
    left: &BsdfSamples<F>,
    shading: Option<&[Row<F>; 3]>,
    departing: &BlockPaths<'_, F>,
    rules: &StepRules<'_, F>,
    instructions: Instructions,
    next: &mut RayColumns<F>,
    last: &mut RayColumns<F>,
) {
    let ends_apart = rules.is_last && rules.asks_emitters;
    let (mut rough, mut specular) = (left.goes, left.goes);
    if RICH && ends_apart {
        for i in 0..LANES {
            rough[i] &= !left.specular[i];
            specular[i] &= left.specular[i];
        }
    }
    let to = if ends_apart { last } else { &mut *next };
    if RICH && !to.carried.flags.is_empty() {
        let of_rough = if rules.is_last { LAST } else { 0 };
        put_flags(left, departing, Compaction::new(&rough, instructions), of_rough, to);
    }
    put(left, shading, departing, Compaction::new(&rough, instructions), to);
    if RICH && ends_apart && left.specular != [0; LANES] {
        put_flags(left, departing, Compaction::new(&specular, instructions), 0, next);
        put(left, shading, departing, Compaction::new(&specular, instructions), next);
    }
}

/// Notes which paths are specular, and so much of the others.
#[inline(always)]
fn put_flags<F: Lane>(
    left: &BsdfSamples<F>,
    departing: &BlockPaths<'_, F>,
    going: Compaction,
    of_rough: u32,
    to: &mut RayColumns<F>,
) {
    let mut flags = [0; LANES];
    for i in 0..LANES {
        let own = if left.specular[i] != 0 { SPECULAR } else { of_rough | SCATTERED };
        flags[i] = own | (departing.flags[i] & SCATTERED);
    }
    going.put(&flags, &mut to.carried.flags, to.len);
}

/// Notes paths, and how they came to their directions.
#[inline(always)]
fn put<F: Lane>(
    left: &BsdfSamples<F>,
    shading: Option<&[Row<F>; 3]>,
    departing: &BlockPaths<'_, F>,
    going: Compaction,
    to: &mut RayColumns<F>,
) {
    let at = to.len;
    for axis in 0..3 {
        going.put(&left.start[axis], &mut to.start[axis], at);
        going.put(&left.along[axis], &mut to.along[axis], at);
    }
    for (band, column) in departing.throughput.iter().zip(&mut to.carried.throughput) {
        going.put(band, column, at);
    }
    if let Some(shading) = shading {
        for axis in 0..3 {
            going.put(&shading[axis], &mut to.carried.normal[axis], at);
        }
    }
    if let Some(chance) = &departing.sky_chance {
        going.put(chance, &mut to.carried.sky_chance, at);
    }
    going.put(&left.pdf, &mut to.carried.pdf, at);
    going.put(&departing.ray, &mut to.carried.ray, at);
    going.put(&[F::INFINITY; LANES], &mut to.reach, at);
    going.put(&departing.lanes, &mut to.left, at);
    to.len += going.count;
}

/// Samples of matte surfaces: starts of rays (m), unit directions about the shading normals with density cos θ / π
/// (1/sr), and that density; without numbers to choose them by the starts alone.
#[inline(always)]
pub(super) fn scatter<F: Lane, const TILTED: bool>(
    hits: &Hits<F>,
    square: Option<[Row<F>; 2]>,
) -> BsdfSamples<F> {
    let (along, pdf) = match &square {
        Some(square) => cosine_directions(hits.shading::<TILTED>(), square),
        None => ([[F::ZERO; LANES]; 3], [F::ZERO; LANES]),
    };
    let [gx, gy, gz] = &hits.normal;
    let (mut start, mut goes) = ([[F::ZERO; LANES]; 3], [0; LANES]);
    for i in 0..LANES {
        let above = along[0][i] * gx[i] + along[1][i] * gy[i] + along[2][i] * gz[i];
        goes[i] = mask((above > F::ZERO) & (pdf[i] > F::ZERO));
    }
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = hits.normal[axis][i] * hits.error[i] + hits.back[axis][i];
            start[axis][i] = hits.point[axis][i] + lifted;
        }
    }
    BsdfSamples { start, along, pdf, goes, specular: [0; LANES] }
}

/// Unit directions about normals with density cos θ / π (1/sr), and that density.
#[inline(always)]
pub(super) fn cosine_directions<F: Lane>(
    [nx, ny, nz]: &[Row<F>; 3],
    [u, v]: &[Row<F>; 2],
) -> ([Row<F>; 3], Row<F>) {
    let (mut along, mut pdf, mut a, mut b) =
        ([[F::ZERO; LANES]; 3], [F::ZERO; LANES], [F::ZERO; LANES], [F::ZERO; LANES]);
    for i in 0..LANES {
        [a[i], b[i]] = disk_point([u[i], v[i]]);
    }
    for i in 0..LANES {
        let (x, y, z, a, b) = (nx[i], ny[i], nz[i], a[i], b[i]);
        let rest = F::ONE - a * a - b * b;
        let c = if rest > F::ZERO { rest } else { F::ZERO }.sqrt();
        // Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
        let sign = if z < F::ZERO { -F::ONE } else { F::ONE };
        let f = -F::ONE / (sign + z);
        let g = x * y * f;
        let dx = (F::ONE + sign * x * x * f) * a + g * b + x * c;
        let dy = sign * g * a + (sign + y * y * f) * b + y * c;
        let dz = z * c - sign * x * a - y * b;
        let inverse = F::ONE / (dx * dx + dy * dy + dz * dz).sqrt();
        along[0][i] = dx * inverse;
        along[1][i] = dy * inverse;
        along[2][i] = dz * inverse;
        pdf[i] = c * F::of(FRAC_1_PI);
    }
    (along, pdf)
}

/// A point of the unit square on the unit disk, as [`etendue_geometry::disk::point`] has it.
#[inline(always)]
fn disk_point<F: Lane>([u, v]: [F; 2]) -> [F; 2] {
    let (a, b) = (F::of(2.0) * u - F::ONE, F::of(2.0) * v - F::ONE);
    let flat = a.abs() > b.abs();
    let (radius, other) = (select_unpredictable(flat, a, b), select_unpredictable(flat, b, a));
    let ratio = if radius == F::ZERO { F::ZERO } else { other / radius };
    let (sine, cosine) = (F::of(FRAC_PI_4) * ratio).small_sine_cosine();
    let (near, far) = (radius * cosine, radius * sine);
    [select_unpredictable(flat, near, far), select_unpredictable(flat, far, near)]
}

/// Leaves out rays that meet nothing of a sphere for sure, but for specular ones.
#[inline(always)]
pub(super) fn keep_those_that_may_meet<F: Lane>(
    &EmitterSphere { centre, radius }: &EmitterSphere<F>,
    roundings: F,
    left: &mut BsdfSamples<F>,
) {
    let BsdfSamples { start, along, goes, specular, .. } = left;
    let (mut foot, mut squared) = ([F::ZERO; LANES], [F::ZERO; LANES]);
    for axis in 0..3 {
        for i in 0..LANES {
            let way = centre[axis] - start[axis][i];
            foot[i] += way * along[axis][i];
            squared[i] += way * way;
        }
    }
    let within = radius * radius;
    for i in 0..LANES {
        let is_ahead = (foot[i] >= F::ZERO) | (squared[i] <= within);
        // Roundings of what is subtracted.
        let slack = roundings * squared[i];
        let is_near = squared[i] - foot[i] * foot[i] <= within + slack;
        goes[i] &= mask((radius >= F::ZERO) & is_ahead & is_near) | specular[i];
    }
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
