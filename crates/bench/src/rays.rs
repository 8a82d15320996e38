//! A camera's chief rays and what they scatter into, in batches of any width.

use etendue_accel::Accel;
use etendue_camera::{Camera, PixelBlock, Sampler};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, RayBatch};

use crate::accelerators::RENDER_WIDTH;

/// Side of a tile (pixels): what a render traces at a time.
const TILE: u32 = 16;

/// How far off their surface rays start, as a share of the largest coordinate: some two hundred
/// roundings of f64.
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

    /// Whether there is no ray.
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use etendue_accel::{BuildOptions, Exact};
    use etendue_camera::{CameraSpec, Pose};
    use etendue_geometry::{Geometry, Mesh, Positions, Transform, Vertices};

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
