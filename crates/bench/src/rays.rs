//! A camera's chief rays, in batches of any width.

use etendue_camera::{Camera, PixelBlock};
use etendue_geometry::RayBatch;

/// Side of a tile (pixels): what a render traces at a time.
const TILE: u32 = 16;

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
                let range = start..all.len().min(start + width.max(1));
                let part = |array: &Vec<f64>| array[range.clone()].to_vec();
                RayBatch {
                    origin: all.origin.each_ref().map(part),
                    direction: all.direction.each_ref().map(part),
                    t_min: part(&all.t_min),
                    t_max: part(&all.t_max),
                    coherent: all.coherent,
                    from_surface: all.from_surface,
                }
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
    use super::*;
    use etendue_camera::{CameraSpec, Pose};
    use etendue_geometry::glam::DVec3;

    #[test]
    fn batches_hold_every_pixel_once_in_one_order() {
        let pose = Pose::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y).unwrap();
        let mut spec = CameraSpec::perspective(pose, 0.7, 1.0);
        spec.sensor_mut().resolution = [40, 21];
        let camera = spec
            .build(
                || -> etendue_geometry::Bounds { unreachable!("the pose is given") },
                &|_| unreachable!(),
            )
            .unwrap();
        let rays = Rays::primary(&camera, usize::MAX);
        assert_eq!(rays.len(), 40 * 21);
        let mut ends: Vec<[u64; 2]> = (0..rays.len())
            .map(|i| [0, 1].map(|axis| rays.0.direction[axis][i].to_bits()))
            .collect();
        ends.sort_unstable();
        ends.dedup();
        assert_eq!(ends.len(), 40 * 21, "every pixel has a direction of its own");
        for width in [1, 16, 100, 4096] {
            let batches = rays.batches(width);
            let joined: Vec<f64> = batches.iter().flat_map(|b| b.direction[0].clone()).collect();
            assert_eq!(joined, rays.0.direction[0], "{width}");
            assert!(batches.iter().all(|b| b.len() <= width && b.coherent));
        }
        // Every column and row of tiles has its share.
        spec.sensor_mut().resolution = [1024, 1024];
        let camera = spec
            .build(
                || -> etendue_geometry::Bounds { unreachable!("the pose is given") },
                &|_| unreachable!(),
            )
            .unwrap();
        let some = Rays::primary(&camera, 64 * 256);
        for axis in 0..2 {
            let side = |k: &f64| usize::from(*k > 0.0);
            let mut halves = [0usize; 2];
            some.0.direction[axis].iter().for_each(|k| halves[side(k)] += 1);
            assert!(halves[0].abs_diff(halves[1]) < 64 * 256 / 8, "{halves:?}");
        }
        // Whole tiles, no more than asked for.
        spec.sensor_mut().resolution = [40, 21];
        let camera = spec
            .build(
                || -> etendue_geometry::Bounds { unreachable!("the pose is given") },
                &|_| unreachable!(),
            )
            .unwrap();
        assert_eq!(Rays::primary(&camera, 600).len() % 16, 0);
        assert!(Rays::primary(&camera, 600).len() <= 600);
    }
}
