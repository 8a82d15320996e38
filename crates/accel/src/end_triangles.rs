//! Rays that leave known triangles, started clear of them in single precision.
//!
//! Around a ray's start, single precision cannot tell the triangle that it leaves from one that it
//! meets, so a filter has to judge each such meeting, and Embree stops a whole packet for every one of
//! them: most of what a shadow ray costs. But a ray that starts well inside of its triangle meets
//! nothing else there, so single precision may begin where it is clear of the triangle's plane,
//!
//! ```text
//! s = b / cos θ
//! ```
//!
//! along the ray, b being what rounding misplaces its start by. *Well inside* is five times that from
//! all edges, so that neighbours are met even where they lean over the triangle by 80°. Rays flatter than
//! [`FLATTEST`] and those beside an edge are judged as before; so is a triangle that is met all the same.
//!
//! What is nearer than `b` over the start and does not touch the triangle is passed over: less than what
//! single precision cannot tell apart in any case (docs/accuracy.md).

use std::ops::Range;

use etendue_geometry::{Geometry, MISS, RayBatch};

use crate::single::{F32_EPSILON, Rays32, round};
use crate::solve::{ChunkTriangles, LANES, Lane};
use crate::triangle::{at, cross, cross_plane, dot, minus};

/// What rounding may misplace a start by, per sum of its coordinates: half a unit in the last place of
/// each, and half as much again for the triangle's.
const ROUNDING: f64 = 0.75 * F32_EPSILON;

/// Times `s` from all edges.
const INSIDE: f64 = 5.0;

/// The least cos θ of rays that are started so.
const FLATTEST: f64 = 0.25;

/// What a batch's rays leave.
#[derive(Debug, Default)]
pub(crate) struct EndTriangles {
    placement: Vec<u32>,
    triangle: Vec<u32>,
    clear: Clear,
}

/// How far from its start each ray of a chunk is clear of the triangle; infinite where it is not known
/// to meet nothing else before.
#[derive(Debug)]
struct Clear(Lane);

impl Default for Clear {
    fn default() -> Self {
        Self([f64::INFINITY; LANES])
    }
}

impl EndTriangles {
    /// Begins `rays32` where they are clear of the triangles that `rays` leave.
    pub(crate) fn spare(
        &mut self,
        geometry: &Geometry,
        rays: &RayBatch,
        rays32: &mut Rays32,
        lanes: &mut ChunkTriangles,
    ) {
        let Some(triangles) = rays.endpoint_triangles() else { return };
        self.placement.clear();
        self.placement.extend(triangles.iter().map(|[left, _]| left[0]));
        self.triangle.clear();
        self.triangle.extend(triangles.iter().map(|[left, _]| left[1]));
        for start in (0..rays.len()).step_by(LANES) {
            let range = start..rays.len().min(start + LANES);
            let ids = (&self.placement[..], &self.triangle[..]);
            lanes.gather(geometry, rays, ids, range.clone());
            measure(lanes, rays32, range.clone(), &mut self.clear);
            for i in range {
                let clear = self.clear.0[i - start];
                // Most of a short ray is left for what may be in between.
                let long = clear < 0.25 * rays.t_max()[i] && clear >= rays.t_min()[i];
                if long && self.placement[i] != MISS {
                    let (near, far) = (&mut rays32.t_near[i], rays32.t_far[i]);
                    *near = near.max(round(clear - rays32.advance[i])).min(far);
                }
            }
        }
    }
}

/// The formula of this module's head for the rays of `range`, whose triangles are in `lanes`.
#[multiversion::multiversion(targets = "simd")]
fn measure(lanes: &ChunkTriangles, rays32: &Rays32, range: Range<usize>, out: &mut Clear) {
    let ChunkTriangles { a, e1, e2, d, .. } = lanes;
    let mut size = [0.0; LANES];
    for axis in &rays32.origin {
        for (size, &x) in size.iter_mut().zip(&axis[range.clone()]) {
            *size += f64::from(x).abs();
        }
    }
    for (i, (out, &size)) in out.0.iter_mut().zip(&size).enumerate() {
        let (b, c) = (at(e1, i), at(e2, i));
        let n = cross(b, c);
        // The start's own weights, times n·n: those of the line from it along the normal.
        let foot = cross_plane(at(a, i), b, c, n);
        let (nn, length) = (foot.along, foot.along.sqrt());
        let cosine = dot(n, at(d, i)).abs() / length;
        let clear = ROUNDING * size / cosine;
        // Distances from the edges, by the areas that the start makes with them.
        let opposite = minus(c, b);
        let edges = [
            foot.u / dot(c, c).sqrt(),
            foot.v / dot(b, b).sqrt(),
            (nn - foot.u - foot.v) / dot(opposite, opposite).sqrt(),
        ];
        let inside = edges[0].min(edges[1]).min(edges[2]) / length;
        // Comparisons with what is no number are false.
        let known = (cosine >= FLATTEST) & (inside > INSIDE * clear);
        *out = if known { clear } else { f64::INFINITY };
    }
}
