//! A camera's chief rays and what they scatter into, in batches of any width; and how far their hits are
//! from the reference's.

use rayon::prelude::*;
use serde::Serialize;

use etendue_accel::Accel;
use etendue_camera::{Camera, PixelBlock, Sampler};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, RayBatch};

/// Hits of the batches of rays, one entry a batch.
pub type Hits = Vec<HitBatch>;

/// The closest hits of all `batches` with their normals, on the threads of the current pool.
#[must_use]
pub fn trace(accel: &dyn Accel, batches: &[RayBatch]) -> Hits {
    let closest = |rays| {
        let mut hits = HitBatch::new(Detail::Surface);
        accel.closest(rays, &mut hits);
        hits
    };
    batches.par_iter().map(closest).collect()
}

/// Hits whose distances differ by no more than this share of them are in one place: the rounding of
/// f64 over the cosine of incidence of rays that graze a surface at a quarter of a degree.
const TIE: f64 = 1e-13;

/// The reference's hits whose barycentric coordinates are as near to an edge are on it.
const ON_EDGE: f64 = 1e-9;

/// Beside an edge that is hit, its triangles are in one place to the accuracy of distances in f32.
const TIE_ON_EDGE: f64 = 1e-4;

/// Errors of hits, by their kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HitErrors {
    /// Rays that were compared.
    pub rays: u64,
    /// Rays that hit something, by the reference.
    pub hits: u64,
    /// Rays that should have hit something and did not.
    pub missed: u64,
    /// Rays that should have hit nothing and did.
    pub false_hits: u64,
    /// Rays that hit another triangle than by the reference, elsewhere.
    pub wrong_triangle: u64,
    /// Rays that hit another triangle where two meet, or that lies in the very same place: which one it
    /// is is anybody's choice.
    pub ties: u64,
    /// Of rays that hit something by both: by how much the distance is off (m).
    pub distance: Option<Quantiles>,
    /// The same as a share of the distance.
    pub relative_distance: Option<Quantiles>,
    /// The angle between geometric normals (degrees).
    pub normal_angle: Option<Quantiles>,
}

/// Errors of many rays in three numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Half of the rays have no more.
    pub median: f64,
    /// 99.9 % of the rays have no more.
    pub p999: f64,
    /// No ray has more.
    pub max: f64,
}

impl Quantiles {
    /// Of `values`; `None` when there are none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        // The least value that so many are not above.
        let at = |per_mille: usize| values[(values.len() * per_mille).div_ceil(1000).max(1) - 1];
        Some(Self { median: at(500), p999: at(999), max: values[last] })
    }
}

impl HitErrors {
    /// Compares the hits of the same rays, in whatever batches they came.
    #[must_use]
    pub fn of(hits: &[HitBatch], reference: &[HitBatch]) -> Self {
        let mut errors = Self {
            rays: 0,
            hits: 0,
            missed: 0,
            false_hits: 0,
            wrong_triangle: 0,
            ties: 0,
            distance: None,
            relative_distance: None,
            normal_angle: None,
        };
        let [mut distance, mut relative, mut angle] = [const { Vec::new() }; 3];
        for ((a, i), (b, j)) in each(hits).zip(each(reference)) {
            errors.rays += 1;
            errors.hits += u64::from(b.is_hit(j));
            // Hits of nearly one distance are ties, and no wrong triangles.
            match (a.is_hit(i), b.is_hit(j)) {
                (false, true) => errors.missed += 1,
                (true, false) => errors.false_hits += 1,
                (false, false) => {}
                (true, true) => {
                    let same = [a.placement[i], a.triangle[i]] == [b.placement[j], b.triangle[j]];
                    let off = (a.t[i] - b.t[j]).abs();
                    let share = if off == 0.0 { 0.0 } else { off / b.t[j] };
                    let tie = if is_on_edge(b, j) { TIE_ON_EDGE } else { TIE };
                    errors.ties += u64::from(!same && share <= tie);
                    errors.wrong_triangle += u64::from(!same && share > tie);
                    distance.push(off);
                    relative.push(share);
                    angle.push(degrees(a.normal(i), b.normal(j)));
                }
            }
        }
        errors.distance = Quantiles::of(distance);
        errors.relative_distance = Quantiles::of(relative);
        errors.normal_angle = Quantiles::of(angle);
        errors
    }

    /// Rays with a wrong answer: missed, false, or of another triangle.
    #[must_use]
    pub fn wrong(&self) -> u64 {
        self.missed + self.false_hits + self.wrong_triangle
    }

    /// The share of rays with a wrong answer; 0 without rays.
    #[must_use]
    pub fn wrong_share(&self) -> f64 {
        self.wrong() as f64 / self.rays.max(1) as f64
    }
}

/// Every hit with its place in its batch.
fn each(hits: &[HitBatch]) -> impl Iterator<Item = (&HitBatch, usize)> {
    hits.iter().flat_map(|batch| (0..batch.len()).map(move |i| (batch, i)))
}

fn is_on_edge(hits: &HitBatch, i: usize) -> bool {
    let (u, v) = (hits.u[i], hits.v[i]);
    u.min(v).min(1.0 - u - v) <= ON_EDGE
}

/// The angle between two directions, accurate for small angles too (W. Kahan, "How futile are
/// mindless assessments of roundoff in floating-point computation?", 2006, §12).
fn degrees(a: DVec3, b: DVec3) -> f64 {
    if a == b {
        return 0.0;
    }
    2.0 * (a - b).length().atan2((a + b).length()).to_degrees()
}

/// Side of a tile (pixels): what a render traces at a time.
const TILE: u32 = 16;

/// Distance off their surface at which rays start, as a share of the largest coordinate: some two
/// hundred roundings of f64.
const CLEAR: f64 = 2e-14;

/// Rays in the order in which a render traces them: tile by tile, and inside a tile along a Z-order
/// curve, so that neighbours in the order are neighbours in the picture.
#[derive(Debug, Clone)]
pub struct Rays(RayBatch);

impl Rays {
    /// The chief rays of `camera`: of all its pixels when they are no more than `most`, else of whole
    /// tiles spread evenly over the picture.
    #[must_use]
    pub fn primary(camera: &Camera, most: usize) -> Self {
        let [width, height] = camera.resolution();
        let corners = (0..height)
            .step_by(TILE as usize)
            .flat_map(|y| (0..width).step_by(TILE as usize).map(move |x| (x, y)));
        let tiles: Vec<PixelBlock> = corners
            .map(|(x, y)| PixelBlock {
                x,
                y,
                width: TILE.min(width - x),
                height: TILE.min(height - y),
            })
            .collect();
        let wanted = (most / (TILE * TILE) as usize).clamp(1, tiles.len());
        let (mut columns, mut rows) = (Vec::new(), Vec::new());
        for k in 0..wanted {
            let tile = tiles[spread(k, wanted, tiles.len())];
            for (x, y) in z_order(tile) {
                columns.push(f64::from(x) + 0.5);
                rows.push(f64::from(y) + 0.5);
            }
        }
        let mut rays = RayBatch::default();
        camera.rays_through(&columns, &rows, &mut rays);
        Self(rays)
    }

    /// From where `accel` says that these rays hit, one ray each into any direction above the
    /// surface, by the cosine: as paths go on from matte surfaces. The same every time.
    #[must_use]
    pub fn scattered(&self, accel: &dyn Accel) -> Self {
        let mut scattered = RayBatch::default().from_surfaces();
        let mut hits = HitBatch::new(Detail::Surface);
        let mut number = 0;
        for rays in self.batches(RENDER_WIDTH) {
            accel.closest(&rays, &mut hits);
            for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
                let (origin, direction) = (rays.origin(i), rays.direction(i));
                let normal = hits.normal(i) * -hits.normal(i).dot(direction).signum();
                let [u, v] = Sampler::Independent.pixel(0, number, 0, 1).square(0, 0);
                number += 1;
                // Evenly over the unit sphere on top of the surface is by the cosine above it.
                let z = 2.0 * u - 1.0;
                let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
                let on_sphere = (1.0 - z * z).sqrt() * DVec3::new(cos, sin, 0.0) + DVec3::Z * z;
                let up = (normal + on_sphere).try_normalize().unwrap_or(normal);
                let place = origin + direction * hits.t[i];
                // Clear of the surface by what f64 may have misplaced it.
                let size = place.abs().max(origin.abs()).max_element();
                scattered.push(place + normal * (CLEAR * size), up);
            }
        }
        Self(scattered)
    }

    /// Any rays, in their own order.
    #[must_use]
    pub fn new(rays: RayBatch) -> Self {
        Self(rays)
    }

    /// The number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// True if there are no rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The rays in batches of `width`; the last may be shorter.
    #[must_use]
    pub fn batches(&self, width: usize) -> Vec<RayBatch> {
        let all = &self.0;
        let starts = (0..all.len()).step_by(width.max(1));
        starts
            .map(|start| {
                let mut batch = RayBatch::default();
                batch.gather(all, start..all.len().min(start + width.max(1)));
                batch
            })
            .collect()
    }
}

/// The place of number `k` of `wanted` among `all`: somewhere in its share of them, so that a share as
/// long as a row does not end up in one column. The golden ratio spreads any number evenly.
fn spread(k: usize, wanted: usize, all: usize) -> usize {
    let [start, end] = [k, k + 1].map(|k| k * all / wanted);
    let place = (k as f64 * 0.618_033_988_75).fract() * (end - start) as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a fraction of a positive number"
    )]
    let place = place as usize;
    start + place
}

/// The pixels of a tile along a Z-order curve.
fn z_order(tile: PixelBlock) -> impl Iterator<Item = (u32, u32)> {
    let even_bits = |k: u32| k & 1 | k >> 1 & 2 | k >> 2 & 4 | k >> 3 & 8;
    (0..TILE * TILE)
        .map(move |k| (even_bits(k), even_bits(k >> 1)))
        .filter(move |&(x, y)| x < tile.width && y < tile.height)
        .map(move |(x, y)| (tile.x + x, tile.y + y))
}

/// The width of a batch in a render: the pixels of a tile.
pub const RENDER_WIDTH: usize = 256;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use etendue_accel::{BuildOptions, Exact};
    use etendue_camera::{CameraSpec, Pose};
    use etendue_geometry::{Geometry, Mesh, Positions, Transform, Vertices};

    /// Hits at `t`, of triangle 0; infinity is a miss.
    fn hits(t: &[f64]) -> HitBatch {
        let mut hits = HitBatch::new(Detail::Surface);
        hits.reset(t.len());
        for (i, &t) in t.iter().enumerate().filter(|(_, t)| t.is_finite()) {
            (hits.t[i], hits.placement[i], hits.triangle[i]) = (t, 0, 0);
            hits.normal[2][i] = 1.0;
        }
        hits
    }

    #[test]
    fn each_kind_of_fault_is_counted_once() {
        let none = f64::INFINITY;
        let reference = [hits(&[1.0, 2.0, none]), hits(&[none, 4.0])];
        let mut found = hits(&[1.0, none, 3.0, none, 4.5]);
        (found.triangle[0], found.triangle[4]) = (7, 9);
        (found.normal[2][4], found.normal[0][4]) = (0.0, 1.0);
        let errors = HitErrors::of(&[found], &reference);
        assert_eq!([errors.rays, errors.hits], [5, 3]);
        assert_eq!([errors.missed, errors.false_hits, errors.wrong_triangle], [1, 1, 1]);
        assert_eq!(errors.ties, 1, "in the same place");
        assert_eq!(errors.wrong_share(), 0.6);
        assert_eq!(errors.distance.unwrap(), Quantiles { median: 0.0, p999: 0.5, max: 0.5 });
        assert_eq!(errors.relative_distance.unwrap().max, 0.125);
        assert_eq!(errors.normal_angle.unwrap().max, 90.0);
    }

    #[test]
    fn quantiles_are_of_the_sorted_values() {
        let values = (1..=2000).rev().map(f64::from).collect();
        let quantiles = Quantiles::of(values).unwrap();
        assert_eq!(quantiles, Quantiles { median: 1000.0, p999: 1998.0, max: 2000.0 });
        assert_eq!(Quantiles::of(vec![7.0]).unwrap().p999, 7.0);
        assert_eq!(Quantiles::of(Vec::new()), None);
    }

    #[test]
    fn small_angles_are_not_lost() {
        let angle = 1e-9f64;
        let turned = DVec3::new(angle.sin(), 0.0, angle.cos());
        let found = degrees(DVec3::Z, turned);
        // Directions are rounded to 1e-16, a ten-millionth of this angle.
        assert!((found / angle.to_degrees() - 1.0).abs() < 1e-6, "{found}");
    }

    fn build(spec: &CameraSpec) -> Camera {
        let frame = || -> etendue_geometry::Bounds { unreachable!("the pose is given") };
        spec.build(frame, &|_: &str| unreachable!()).unwrap()
    }

    #[test]
    fn batches_hold_every_pixel_once_in_one_order() {
        let pose = Pose::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y).unwrap();
        let mut spec = CameraSpec::perspective(pose, 0.7, 1.0);
        spec.sensor_mut().resolution = [40, 21];
        let camera = build(&spec);
        let rays = Rays::primary(&camera, usize::MAX);
        assert_eq!(rays.len(), 40 * 21);
        let mut ends: Vec<[u64; 2]> = (0..rays.len())
            .map(|i| [0, 1].map(|axis| rays.0.directions()[axis][i].to_bits()))
            .collect();
        ends.sort_unstable();
        ends.dedup();
        assert_eq!(ends.len(), 40 * 21, "every pixel has a direction of its own");
        for width in [1, 16, 100, 4096] {
            let batches = rays.batches(width);
            let joined: Vec<f64> =
                batches.iter().flat_map(|b| b.directions()[0].to_vec()).collect();
            assert_eq!(joined, rays.0.directions()[0], "{width}");
            assert!(batches.iter().all(|b| b.len() <= width && b.coherent));
        }
        // Every column and row of tiles has its share.
        spec.sensor_mut().resolution = [1024, 1024];
        let camera = build(&spec);
        let some = Rays::primary(&camera, 64 * 256);
        for axis in 0..2 {
            let side = |k: &f64| usize::from(*k > 0.0);
            let mut halves = [0usize; 2];
            some.0.directions()[axis].iter().for_each(|k| halves[side(k)] += 1);
            assert!(halves[0].abs_diff(halves[1]) < 64 * 256 / 8, "{halves:?}");
        }
        // Whole tiles, no more than asked for.
        spec.sensor_mut().resolution = [40, 21];
        let camera = build(&spec);
        assert_eq!(Rays::primary(&camera, 600).len() % 16, 0);
        assert!(Rays::primary(&camera, 600).len() <= 600);
    }

    #[test]
    fn scattered_rays_leave_the_surface_by_the_cosine() {
        let corners = [[-1.0, -1.0, 2.0], [9.0, -1.0, 2.0], [-1.0, 9.0, 2.0f32]];
        let mesh = Mesh::new(
            "sheet",
            Positions::F32(Vertices::from_arrays(&corners)),
            vec![[0, 1, 2]].into(),
        );
        let geometry = Geometry::alone(mesh, Transform::IDENTITY);
        let accel = Exact::build(Arc::new(geometry), &BuildOptions::default()).unwrap();
        let mut rays = RayBatch::default();
        for i in 0..40_000 {
            rays.push(DVec3::new(1e-4 * f64::from(i), 0.0, 5.0), -DVec3::Z);
        }
        // Beside the sheet: nothing is left of it.
        rays.push(DVec3::new(-2.0, 0.0, 5.0), -DVec3::Z);
        let scattered = Rays::new(rays).scattered(&accel);
        assert_eq!(scattered.len(), 40_000);
        assert!(scattered.0.from_surface && !scattered.0.coherent);
        let mut hits = HitBatch::new(Detail::Distance);
        accel.closest(&scattered.0, &mut hits);
        assert!((0..hits.len()).all(|i| !hits.is_hit(i)), "they leave the side that was seen");
        // The mean of the cosine over its own distribution is 2/3, its deviation 0.24.
        let mean = scattered.0.directions()[2].iter().sum::<f64>() / 40_000.0;
        assert!((mean - 2.0 / 3.0).abs() < 4.0 * 0.24 / 200.0, "{mean}");
    }
}
