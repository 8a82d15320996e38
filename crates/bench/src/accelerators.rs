//! Each accelerator × batch width × threads: what it costs, and what it gets wrong.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use etendue_accel::{Accel, AccelName, BuildError, BuildOptions, Exact, Quality};
use etendue_geometry::{Detail, Geometry, HitBatch, RayBatch};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;

pub use crate::hits::RENDER_WIDTH;
use crate::hits::{HitErrors, Hits, Rays, trace};
use crate::timing::{TimeSpread, Timings, order};
use crate::{BenchError, Progress};

/// Timing goes on for at least so long (s), however few the rays.
const LEAST: f64 = 0.01;

/// Accelerator that finds the hits, and its options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Method {
    /// The accelerator.
    pub accel: AccelName,
    /// Watertight ([`BuildOptions::robust`]).
    pub robust: bool,
    /// Hits are solved in f64 ([`BuildOptions::refine`]).
    pub refine: bool,
}

impl Method {
    /// Embree without its robust mode and without f64: its own fastest.
    pub const EMBREE_FAST: Self = Self { robust: false, refine: false, ..Self::EMBREE_REFINED };
    /// Embree's robust mode, distances in f32.
    pub const EMBREE_ROBUST: Self = Self { refine: false, ..Self::EMBREE_REFINED };
    /// Robust, hits solved again in f64 and looked at again where suspicious: what renders use.
    pub const EMBREE_REFINED: Self = Self::whole(AccelName::Embree);
    /// The pure-Rust tree.
    pub const BVH: Self = Self::whole(AccelName::Bvh);
    /// The f64 reference.
    pub const EXACT: Self = Self::whole(AccelName::Exact);

    /// An accelerator as renders use it.
    const fn whole(accel: AccelName) -> Self {
        Self { accel, robust: true, refine: true }
    }

    /// Those that this program was built with, each accelerator in all its modes; the reference is the last.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let modes = |accel: AccelName| {
            let all = [[false, false], [false, true], [true, false], [true, true]];
            // Those of f64 alone have one.
            let own = if accel.has_single() { &all[..] } else { &all[3..] };
            own.iter()
                .map(move |&[robust, refine]| Self { accel, robust, refine })
                .collect::<Vec<_>>()
        };
        AccelName::built().flat_map(modes).collect()
    }

    /// As tables and charts write it.
    #[must_use]
    pub fn name(self) -> String {
        let accel = self.accel.name();
        if !self.accel.has_single() {
            return accel.to_owned();
        }
        let mode = if self.robust { "robust" } else { "fast" };
        format!("{accel} {mode}{}", if self.refine { " + f64" } else { "" })
    }

    /// Builds its structure.
    ///
    /// # Errors
    ///
    /// As [`AccelName::build`].
    pub fn build(
        self,
        geometry: &Arc<Geometry>,
        options: &BuildOptions,
    ) -> Result<Box<dyn Accel>, BuildError> {
        let Self { accel, robust, refine } = self;
        accel.build(Arc::clone(geometry), &BuildOptions { robust, refine, ..options.clone() })
    }
}

/// Extent of the measurement.
#[derive(Debug, Clone)]
pub struct Effort {
    /// Methods that take part.
    pub methods: Vec<Method>,
    /// Rays a batch.
    pub widths: Vec<usize>,
    /// Numbers of threads.
    pub threads: Vec<usize>,
    /// Times that everything is built and timed (at least 1).
    pub rounds: usize,
    /// Of the builds that heed it.
    pub quality: Quality,
    /// The most that a structure may hold (bytes).
    pub memory_limit: Option<u64>,
}

impl Effort {
    fn build_options(&self) -> BuildOptions {
        BuildOptions {
            quality: self.quality,
            memory_limit: self.memory_limit,
            ..BuildOptions::default()
        }
    }
}

/// Measurement of one accelerator at one batch width and number of threads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AcceleratorMeasurement {
    /// The accelerator and its mode, as [`Method::name`] writes it.
    pub method: String,
    /// As the accelerator writes itself, with its version.
    pub backend: String,
    /// Rays a batch.
    pub width: usize,
    /// Threads that traced.
    pub threads: usize,
    /// Of the build, on all threads (s).
    pub build_seconds: TimeSpread,
    /// Bytes of the structure without the geometry that it shares.
    pub bytes: u64,
    /// Bytes of geometry that it had to copy.
    pub copied_bytes: u64,
    /// Wall time of tracing all rays with their normals (s).
    pub seconds: TimeSpread,
    /// Millions of rays a second, by the median.
    pub mrays_per_second: f64,
    /// Against the reference.
    pub errors: HitErrors,
}

/// Builds and traces with every method in turn. Only one structure stands at a time, so a round
/// needs no more memory than the heaviest of them.
///
/// # Errors
///
/// When a structure cannot be built, the reference among them, or `progress` asks to stop.
pub fn measure(
    geometry: &Arc<Geometry>,
    rays: &Rays,
    effort: &Effort,
    progress: Progress<'_>,
) -> Result<Vec<AcceleratorMeasurement>, BenchError> {
    // Rays in batches of each width, and the hits that others are compared with.
    let pools = pools(&effort.threads)?;
    let batches: Vec<Vec<RayBatch>> =
        effort.widths.iter().map(|&width| rays.batches(width)).collect();
    let reference = reference(geometry, rays, effort)?;
    let rounds = effort.rounds.max(1);
    let steps = (1 + rounds * effort.methods.len()) as f64;
    let mut done = 1.0;
    // Methods take turns: each builds, and traces every batch on every number of threads.
    let mut entries: Vec<MethodRun> =
        effort.methods.iter().map(|&m| MethodRun::new(m, effort)).collect();
    for round in 0..rounds {
        for who in order(round, entries.len()) {
            if !progress(done / steps) {
                return Err(BenchError::Stopped);
            }
            let entry = &mut entries[who];
            let accel = entry.build(geometry, effort)?;
            if entry.errors.is_empty() {
                let compare = |batches| HitErrors::of(&trace(&*accel, batches), &reference);
                entry.errors = batches.iter().map(|batches| compare(batches)).collect();
            }
            let cells = batches.iter().flat_map(|batches| pools.iter().map(move |p| (batches, p)));
            for ((batches, pool), series) in cells.zip(&mut entry.traces) {
                series.0.push(time(&*accel, batches, pool));
            }
            done += 1.0;
        }
    }
    Ok(entries.iter().flat_map(|entry| entry.findings(effort, rays.len())).collect())
}

/// Hits of the reference.
fn reference(geometry: &Arc<Geometry>, rays: &Rays, effort: &Effort) -> Result<Hits, BenchError> {
    let exact = Exact::build(Arc::clone(geometry), &effort.build_options())?;
    Ok(trace(&exact, &rays.batches(RENDER_WIDTH)))
}

fn pools(threads: &[usize]) -> Result<Vec<ThreadPool>, BenchError> {
    let pool = |&threads: &usize| {
        let built = ThreadPoolBuilder::new().num_threads(threads).build();
        let fewer = "hint: ask for fewer with --threads";
        built.map_err(|error| BenchError::Refused(format!("{threads} threads: {error}\n{fewer}")))
    };
    threads.iter().map(pool).collect()
}

/// Wall time (s) of tracing all batches once. Pages and caches are warm.
fn time(accel: &dyn Accel, batches: &[RayBatch], pool: &ThreadPool) -> f64 {
    let pass = || {
        let hits = || HitBatch::new(Detail::Surface);
        batches.par_iter().for_each_init(hits, |hits, rays| {
            accel.closest(rays, hits);
            black_box(hits);
        });
    };
    pool.install(|| {
        pass();
        let start = Instant::now();
        let mut passes = 0.0;
        loop {
            pass();
            passes += 1.0;
            let elapsed = start.elapsed().as_secs_f64();
            if elapsed >= LEAST {
                return elapsed / passes;
            }
        }
    })
}

/// One method while it is measured.
struct MethodRun {
    method: Method,
    backend: String,
    bytes: u64,
    copied_bytes: u64,
    builds: Timings,
    /// One a width.
    errors: Vec<HitErrors>,
    /// One a width and number of threads.
    traces: Vec<Timings>,
}

impl MethodRun {
    fn new(method: Method, effort: &Effort) -> Self {
        Self {
            method,
            backend: String::new(),
            bytes: 0,
            copied_bytes: 0,
            builds: Timings::default(),
            errors: Vec::new(),
            traces: vec![Timings::default(); effort.widths.len() * effort.threads.len()],
        }
    }

    fn build(
        &mut self,
        geometry: &Arc<Geometry>,
        effort: &Effort,
    ) -> Result<Box<dyn Accel>, BenchError> {
        let accel = self.method.build(geometry, &effort.build_options())?;
        let report = accel.report();
        self.builds.0.push(report.time.as_secs_f64());
        self.backend = report.backend;
        (self.bytes, self.copied_bytes) = (report.bytes, report.copied_bytes);
        Ok(accel)
    }

    fn findings(&self, effort: &Effort, rays: usize) -> Vec<AcceleratorMeasurement> {
        let widths = effort.widths.iter().zip(&self.errors);
        let cells = widths
            .flat_map(|(width, errors)| effort.threads.iter().map(move |t| (width, t, errors)));
        let finding =
            |((&width, &threads, errors), series): ((&usize, &usize, &HitErrors), &Timings)| {
                let seconds = series.spread()?;
                Some(AcceleratorMeasurement {
                    method: self.method.name(),
                    backend: self.backend.clone(),
                    width,
                    threads,
                    build_seconds: self.builds.spread()?,
                    bytes: self.bytes,
                    copied_bytes: self.copied_bytes,
                    seconds,
                    mrays_per_second: rays as f64 / seconds.median / 1e6,
                    errors: errors.clone(),
                })
            };
        cells.zip(&self.traces).filter_map(finding).collect()
    }
}
