//! Contestants: who is timed, on which clock, and in which order.
//!
//! * Contestants take turns ([`etendue_bench::timing`]).
//! * Tracing is timed on the processor clock of the thread that traces, which other processes on the
//!   machine disturb less than they do the wall's.
//! * Rays are in the cache when their turn comes, as they are when a camera has just made them: each
//!   chunk of them is touched, and records are reset, while the clock stands.

use std::hint::black_box;
use std::time::Duration;

use etendue_accel::Accel;
use etendue_geometry::{Detail, HitBatch, RayBatch};
use rustix::time::{ClockId, clock_gettime};

use crate::rays::BATCH;
use etendue_accel::limit::{BareScene, RayHit16, Single, WIDTH};

/// Batches a chunk: its rays stay in the second-level cache.
const CHUNK: usize = 16;

/// Processor time of this thread (s).
#[must_use]
pub fn thread_time() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

/// Question that is asked of each ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Query {
    /// The closest hit, with its normal.
    Closest,
    /// True if there is any.
    Occluded,
}

/// Traces chunk after chunk and tells the seconds that each took.
pub type Worker<'a> = Box<dyn FnMut(usize) -> f64 + 'a>;

/// Somebody who traces a given set of rays.
pub trait Contestant: Sync {
    /// Rays in all.
    fn rays(&self) -> usize;
    /// Worker of one thread.
    fn worker(&self) -> Worker<'_>;
}

/// An accelerator of ours.
#[derive(Debug, Clone, Copy)]
pub struct Ours<'a> {
    /// Caster of the rays.
    pub accel: &'a dyn Accel,
    /// The rays, [`BATCH`] a batch.
    pub batches: &'a [RayBatch],
    /// Question of each ray.
    pub query: Query,
}

impl Contestant for Ours<'_> {
    fn rays(&self) -> usize {
        self.batches.len() * BATCH
    }

    fn worker(&self) -> Worker<'_> {
        let mut hits = HitBatch::new(Detail::Surface);
        let mut blocked = Vec::new();
        Box::new(move |chunk| {
            let batches = chunk_of(self.batches, chunk, CHUNK);
            batches.iter().for_each(touch);
            let start = thread_time();
            for rays in batches {
                match self.query {
                    Query::Closest => self.accel.closest(rays, &mut hits),
                    Query::Occluded => self.accel.occluded(rays, &mut blocked),
                }
                black_box((&hits, &blocked));
            }
            thread_time() - start
        })
    }
}

fn chunk_of<T>(all: &[T], chunk: usize, len: usize) -> &[T] {
    &all[chunk * len..all.len().min((chunk + 1) * len)]
}

fn touch(rays: &RayBatch) {
    let limits = [rays.t_min(), rays.t_max()];
    let arrays = rays.origins().into_iter().chain(rays.directions()).chain(limits);
    black_box(arrays.map(|array| array.iter().sum::<f64>()).sum::<f64>());
}

/// Embree's bare loop over packets.
#[derive(Debug, Clone, Copy)]
pub struct LimitPackets<'a> {
    /// Caster of the rays.
    pub scene: &'a BareScene,
    /// The rays.
    pub packets: &'a [RayHit16],
    /// Question of each ray.
    pub query: Query,
}

impl Contestant for LimitPackets<'_> {
    fn rays(&self) -> usize {
        self.packets.len() * WIDTH
    }

    fn worker(&self) -> Worker<'_> {
        let mut records = Vec::new();
        Box::new(move |chunk| {
            records.clear();
            records.extend_from_slice(chunk_of(self.packets, chunk, CHUNK * BATCH / WIDTH));
            let start = thread_time();
            match self.query {
                Query::Closest => self.scene.closest_packets(&mut records),
                Query::Occluded => self.scene.occluded_packets(&mut records),
            }
            black_box(&records);
            thread_time() - start
        })
    }
}

/// Embree's bare loop over single rays.
#[derive(Debug, Clone, Copy)]
pub struct LimitSingles<'a> {
    /// Caster of the rays.
    pub scene: &'a BareScene,
    /// The rays.
    pub singles: &'a [Single],
    /// Question of each ray.
    pub query: Query,
}

impl Contestant for LimitSingles<'_> {
    fn rays(&self) -> usize {
        self.singles.len()
    }

    fn worker(&self) -> Worker<'_> {
        let mut records = Vec::new();
        Box::new(move |chunk| {
            records.clear();
            records.extend_from_slice(chunk_of(self.singles, chunk, CHUNK * BATCH));
            let start = thread_time();
            match self.query {
                Query::Closest => self.scene.closest_singles(&mut records),
                Query::Occluded => self.scene.occluded_singles(&mut records),
            }
            black_box(&records);
            thread_time() - start
        })
    }
}

/// Seconds to trace all rays of `contestant` on `threads` threads: the busiest thread's. Only one
/// chunk in `every` is traced, and the time scaled up.
#[must_use]
pub fn time(contestant: &dyn Contestant, threads: usize, every: usize) -> f64 {
    let chunks = contestant.rays().div_ceil(CHUNK * BATCH);
    let share = |first: usize| {
        let mut worker = contestant.worker();
        (first * every..chunks).step_by(every * threads).map(&mut worker).sum::<f64>()
    };
    let busiest = if threads == 1 {
        share(0)
    } else {
        std::thread::scope(|scope| {
            let share = &share;
            let workers: Vec<_> = (0..threads).map(|k| scope.spawn(move || share(k))).collect();
            workers.into_iter().filter_map(|w| w.join().ok()).fold(0.0, f64::max)
        })
    };
    busiest * chunks as f64 / chunks.div_ceil(every) as f64
}

/// [`time`] on one thread, for criterion.
#[must_use]
pub fn time_of(contestant: &dyn Contestant, times: u64) -> Duration {
    Duration::from_secs_f64((0..times).map(|_| time(contestant, 1, 1)).sum())
}
