//! Tiles of a picture, whose rays are a batch, and what became of those rays.

use std::sync::{Mutex, PoisonError};

use etendue_optics::element::StatusCounts;
use etendue_tracer::RayStats;

use crate::sparkles::Sparkles;

/// Side of a tile (pixels): its rays are one batch.
pub(crate) const TILE: u32 = 16;

/// Counts of what was traced.
#[derive(Debug, Clone, Default)]
pub(crate) struct RayCounts {
    /// Rays of the camera for layers without light.
    pub(crate) chief_rays: u64,
    /// Rays of the radiance pass.
    pub(crate) light: RayStats,
    /// Counts of rays by their outcome inside the camera's lens.
    pub(crate) statuses: StatusCounts,
    /// Light that a handful of samples carries.
    pub(crate) sparkles: Sparkles,
}

impl RayCounts {
    /// Adds what one thread traced, and the statuses of its rays.
    pub(crate) fn add(all: &Mutex<Self>, own: Self, statuses: &StatusCounts) {
        let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
        all.merge(&own);
        all.statuses.merge(statuses);
    }

    /// Adds what was traced elsewhere.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.chief_rays += other.chief_rays;
        self.light += other.light;
        self.sparkles.merge(&other.sparkles);
        self.statuses.merge(&other.statuses);
    }
}

/// A rectangle of the picture, at most [`TILE`] a side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tile {
    pub(crate) left: u32,
    pub(crate) top: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl Tile {
    /// The tiles of a strip of that top and height, from left to right.
    pub(crate) fn across(width: u32, [top, height]: [u32; 2]) -> impl Iterator<Item = Self> {
        let lefts = (0..width).step_by(TILE as usize);
        lefts.map(move |left| Self { left, top, width: TILE.min(width - left), height })
    }

    /// Pixels from the tile's corner along a Z-order curve, so that any 4, 8 or 16 of them in a row,
    /// as many as go into a packet, are a block.
    pub(crate) fn pixels(self) -> impl Iterator<Item = [u32; 2]> + Clone {
        (0..TILE * TILE)
            .map(|k| [even_bits(k), even_bits(k >> 1)])
            .filter(move |&[x, y]| x < self.width && y < self.height)
    }

    /// Column and row of a pixel of the tile.
    pub(crate) fn on_film(self, [x, y]: [u32; 2]) -> [i32; 2] {
        [self.left + x, self.top + y].map(u32::cast_signed)
    }

    /// Index of a pixel of the tile in the rows of its strip.
    pub(crate) fn index(self, [x, y]: [u32; 2], width: u32) -> u32 {
        y * width + self.left + x
    }
}

/// Bits 0, 2, 4 and 6 of `k`, put together.
fn even_bits(k: u32) -> u32 {
    k & 1 | k >> 1 & 2 | k >> 2 & 4 | k >> 3 & 8
}
