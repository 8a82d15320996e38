//! What many paths and rays of a plain scene carry: a column a number, with room for a block behind the last.

use etendue_geometry::RayBlocks;
use etendue_geometry::block::LANES;

use crate::transport::RaySamples;

/// What sixteen and more paths carry.
#[derive(Debug, Default)]
pub(in crate::transport) struct Columns {
    pub(super) len: usize,
    pub(super) ray: Vec<u32>,
    /// Density (1/sr) of the direction, unused of the camera's.
    pub(super) pdf: Vec<f32>,
    pub(super) throughput: [Vec<f32>; 3],
    /// Of the surface that each left, by which lights were chosen for it; unused of the camera's.
    pub(super) normal: [Vec<f32>; 3],
}

/// Rays that leave a block's hits.
#[derive(Debug, Default)]
pub(in crate::transport) struct RayColumns {
    pub(super) len: usize,
    pub(super) start: [Vec<f32>; 3],
    pub(super) along: [Vec<f32>; 3],
    pub(super) reach: Vec<f32>,
    /// The block's lane that each leaves, counted from the first block.
    pub(super) left: Vec<u32>,
    /// The light that each is sent to.
    pub(super) lamp: Vec<u32>,
    pub(super) carried: Columns,
}

impl Columns {
    fn resize(&mut self, len: usize) {
        let len = len.next_multiple_of(LANES) + LANES;
        self.ray.resize(len, 0);
        self.pdf.resize(len, 0.0);
        self.throughput.iter_mut().chain(&mut self.normal).for_each(|row| row.resize(len, 0.0));
    }

    /// Sets them to the camera's rays.
    pub(super) fn start(&mut self, camera: &RaySamples<'_>) {
        self.len = camera.rays.len();
        self.resize(self.len);
        for (number, ray) in (0..).zip(&mut self.ray) {
            *ray = number;
        }
        for (k, band) in self.throughput.iter_mut().enumerate() {
            band.fill(if camera.bands.contains(&k) { 1.0 } else { 0.0 });
        }
    }

    /// The unit normal of the surface that path `i` left.
    pub(super) fn normal(&self, i: usize) -> [f32; 3] {
        let [x, y, z] = &self.normal;
        [x[i], y[i], z[i]]
    }
}

impl RayColumns {
    pub(super) fn restart(&mut self, most: usize) {
        self.len = 0;
        self.carried.resize(most);
        let len = self.carried.ray.len();
        for axis in self.start.iter_mut().chain(&mut self.along) {
            axis.resize(len, 0.0);
        }
        self.reach.resize(len, 0.0);
        self.left.resize(len, 0);
        self.lamp.resize(len, 0);
    }

    /// The rays as blocks, which are refilled.
    pub(super) fn pack(&self, blocks: &mut RayBlocks) {
        blocks.refill(self.len, |block, start, count| {
            let run = start..start + LANES;
            for axis in 0..3 {
                block.origin[axis].copy_from_slice(&self.start[axis][run.clone()]);
                block.direction[axis].copy_from_slice(&self.along[axis][run.clone()]);
            }
            block.t_max[..count].copy_from_slice(&self.reach[start..start + count]);
        });
    }
}
