//! Rays whose ends are on known triangles, kept clear of them in single precision.
//!
//! Around a ray's start, single precision cannot tell the triangle that it leaves from one that it
//! meets, so f64 has to judge each such meeting, and Embree stops a whole packet for every one of them:
//! most of what a shadow ray costs. But a ray that starts well inside of its triangle meets nothing
//! else there: single precision may begin where it is clear of the triangle's plane,
//!
//! ```text
//! s = b / cos θ
//! ```
//!
//! along the ray, b being what single precision may misplace it by. *Well inside* is five times that
//! from all edges, so that neighbours are met even where they lean over the triangle by 80°. Other rays
//! are judged as before. Where a ray ends on a triangle, the same is done there.
//!
//! What is nearer than `b` over the start and does not touch the triangle is passed over: the limit
//! that single precision has at starts in any case (docs/accuracy.md).

use std::ops::Range;

use etendue_geometry::{Geometry, MISS, RayBatch};

use crate::single::{BLUR, Rays32, round};
use crate::solve::{LANES, Lane, Lanes};

/// Times `s` from all edges.
const INSIDE: f64 = 5.0;

/// One end of a batch's rays.
#[derive(Debug, Default)]
pub(crate) struct Ends {
    placement: Vec<u32>,
    triangle: Vec<u32>,
    clear: Clear,
}

/// How far from its end each ray of a chunk is clear of the triangle; infinite where it is not known
/// to meet nothing else before.
#[derive(Debug)]
struct Clear(Lane);

impl Default for Clear {
    fn default() -> Self {
        Self([f64::INFINITY; LANES])
    }
}

impl Ends {
    /// Begins and ends `rays32` where they are clear of the triangles at the ends of `rays`.
    pub(crate) fn spare(
        &mut self,
        geometry: &Geometry,
        rays: &RayBatch,
        rays32: &mut Rays32,
        lanes: &mut Lanes,
    ) {
        if rays.ends.len() != rays.len() {
            return;
        }
        for end in [0, 1] {
            self.placement.clear();
            self.placement.extend(rays.ends.iter().map(|ends| ends[end][0]));
            if self.placement.iter().all(|&placement| placement == MISS) {
                continue;
            }
            self.triangle.clear();
            self.triangle.extend(rays.ends.iter().map(|ends| ends[end][1]));
            for start in (0..rays.len()).step_by(LANES) {
                let range = start..rays.len().min(start + LANES);
                let ids = (&self.placement[..], &self.triangle[..]);
                lanes.gather(geometry, rays, ids, range.clone());
                measure(lanes, rays32, (&rays.t_max, end == 1), range.clone(), &mut self.clear);
                self.move_ends(rays, rays32, end == 1, range);
            }
        }
    }

    fn move_ends(&self, rays: &RayBatch, rays32: &mut Rays32, far: bool, range: Range<usize>) {
        let start = range.start;
        for i in range {
            let clear = self.clear.0[i - start];
            // Most of a short ray is left for what may be in between.
            if self.placement[i] == MISS || clear >= 0.25 * rays.t_max[i] {
                continue;
            }
            let [near, end] = [rays32.t_near[i], rays32.t_far[i]];
            if far {
                let t = round(rays.t_max[i] - clear - rays32.advance[i]);
                rays32.t_far[i] = end.min(t).max(near);
            } else if rays.t_min[i] <= clear {
                let t = round(clear - rays32.advance[i]);
                rays32.t_near[i] = near.max(t).min(end);
            }
        }
    }
}

/// The formula of this module's head for the rays of `range`, whose triangles are in `lanes`.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn measure(
    lanes: &Lanes,
    rays32: &Rays32,
    (t_max, far): (&[f64], bool),
    range: Range<usize>,
    out: &mut Clear,
) {
    let Lanes { a, e1, e2, d, .. } = lanes;
    let (mut t, mut size) = ([0.0; LANES], [0.0; LANES]);
    if far {
        t[..range.len()].copy_from_slice(&t_max[range.clone()]);
    }
    for axis in &rays32.origin {
        for (size, &x) in size.iter_mut().zip(&axis[range.clone()]) {
            *size += f64::from(x).abs();
        }
    }
    for i in 0..LANES {
        let (dx, dy, dz) = (d[0][i], d[1][i], d[2][i]);
        // The first corner from the ray's end.
        let (ax, ay, az) = (a[0][i] - dx * t[i], a[1][i] - dy * t[i], a[2][i] - dz * t[i]);
        let (bx, by, bz) = (e1[0][i], e1[1][i], e1[2][i]);
        let (cx, cy, cz) = (e2[0][i], e2[1][i], e2[2][i]);
        let (nx, ny, nz) = (by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx);
        let nn = nx * nx + ny * ny + nz * nz;
        let length = nn.sqrt();
        let cosine = (nx * dx + ny * dy + nz * dz).abs() / length;
        let clear = BLUR * (size[i] + t[i]) / cosine;
        // Distances from the edges, by the areas that the end makes with them.
        let (mx, my, mz) = (ay * nz - az * ny, az * nx - ax * nz, ax * ny - ay * nx);
        let u = mx * cx + my * cy + mz * cz;
        let v = -(mx * bx + my * by + mz * bz);
        let w = nn - u - v;
        let (gx, gy, gz) = (cx - bx, cy - by, cz - bz);
        let edges = [
            u / (cx * cx + cy * cy + cz * cz).sqrt(),
            v / (bx * bx + by * by + bz * bz).sqrt(),
            w / (gx * gx + gy * gy + gz * gz).sqrt(),
        ];
        let inside = edges[0].min(edges[1]).min(edges[2]) / length;
        // Comparisons with what is no number are false.
        out.0[i] = if inside > INSIDE * clear { clear } else { f64::INFINITY };
    }
}
