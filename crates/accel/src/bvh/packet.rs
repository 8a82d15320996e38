//! Sixteen neighbouring rays at a time: through the tree as one bundle, through triangles side by
//! side.
//!
//! A bundle visits what any of its rays may visit. Its box test is that of a single ray
//! ([`BoxTest`](super::ray::BoxTest)), with reciprocals and offsets that bound those of all its rays, so a node costs the
//! bundle what it costs one ray (interval arithmetic, after S. Boulos et al., "Packet-based Whitted and
//! distribution ray tracing", 2007). For bounds to exist the rays must run towards the same octant;
//! a packet that does not is taken apart into bundles that do.

mod batch;
mod triangles;

use etendue_geometry::RayBatch;
use etendue_geometry::glam::DVec3;

use super::bundle::{FrameRays, PACKET};
use super::lanes::{Arithmetic, Lanes};
use super::single::Sink;
use crate::nearest::Query;
use crate::parts::PartInstance;

pub(super) use self::batch::BatchTraversal;

/// Sixteen rays and what has become of them.
pub(super) struct Packet<'a, S> {
    /// `[axis][ray]`, in the world.
    origin: [&'a [f64; PACKET]; 3],
    direction: [&'a [f64; PACKET]; 3],
    t_min: &'a [f64; PACKET],
    /// Distance up to which each ray looks.
    t_max: [f64; PACKET],
    sinks: [S; PACKET],
    /// A bit for every ray that may still hit something.
    active: u32,
    /// A bit for every ray that could at first.
    sound: u32,
}

impl<'a, S: Sink> Packet<'a, S> {
    /// The rays of a batch from `first` on; `None` when there are not enough.
    #[inline(always)]
    pub(super) fn of(rays: &'a RayBatch, first: usize) -> Option<Self> {
        let [x, y, z] = rays.origins();
        let origin = [chunk(x, first)?, chunk(y, first)?, chunk(z, first)?];
        let [x, y, z] = rays.directions();
        let direction = [chunk(x, first)?, chunk(y, first)?, chunk(z, first)?];
        let t_min = chunk(rays.t_min(), first)?;
        let t_max = *chunk(rays.t_max(), first)?;
        let sound = soundness(origin, direction, t_min, &t_max);
        let sinks = t_max.map(S::new);
        Some(Self { origin, direction, t_min, t_max, sinks, active: sound, sound })
    }

    /// Hands over the answers of all rays that could hit.
    #[inline(always)]
    pub(super) fn finish(self, mut sink: impl FnMut(usize, S)) {
        for (lane, answer) in self.sinks.into_iter().enumerate() {
            if self.sound & 1 << lane != 0 {
                sink(lane, answer);
            }
        }
    }

    #[inline(always)]
    fn in_frame(&self, instance: &PartInstance) -> FrameRays {
        let parallel = FrameRays::parallel(instance, self.origin, self.direction, self.t_min);
        parallel.unwrap_or_else(|| {
            FrameRays::new(&instance.rays(self.origin, self.direction), self.t_min)
        })
    }

    #[inline(always)]
    fn query(&self, lane: usize) -> Query {
        let at =
            |axes: [&[f64; PACKET]; 3]| DVec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
        Query {
            origin: at(self.origin),
            direction: at(self.direction),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
        }
    }

    /// The farthest that any active ray of `group` looks.
    #[inline(always)]
    fn farthest<L: Lanes>(&self, lanes: L, rays: &FrameRays, group: u32) -> f32 {
        let l = lanes.sixteen();
        let far = lanes.load_sixteen(&rays.far(&self.t_max));
        l.greatest(l.select(group & self.active, far, l.splat(f32::NEG_INFINITY)))
    }
}

#[inline(always)]
fn chunk(numbers: &[f64], first: usize) -> Option<&[f64; PACKET]> {
    numbers.get(first..)?.first_chunk()
}

/// A bit for every ray that can hit something, as [`Query::of`] has it.
#[inline(always)]
fn soundness(
    origin: [&[f64; PACKET]; 3],
    direction: [&[f64; PACKET]; 3],
    t_min: &[f64; PACKET],
    t_max: &[f64; PACKET],
) -> u32 {
    let mut sound = 0;
    for i in 0..PACKET {
        // 0 unless one of them is not finite.
        let origin = origin[0][i] * 0.0 + origin[1][i] * 0.0 + origin[2][i] * 0.0;
        let [x, y, z] = [direction[0][i], direction[1][i], direction[2][i]];
        let is_finite = origin + (x * 0.0 + y * 0.0 + z * 0.0) == 0.0;
        let runs = (x != 0.0) | (y != 0.0) | (z != 0.0);
        sound |= u32::from(is_finite & runs & (t_min[i] <= t_max[i])) << i;
    }
    sound
}
