//! The least that a picture of light can take: what the accelerator takes for the very rays that were traced.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use etendue_accel::{Accel, BlockAccel, BuildOptions, BuildReport, Counts, F32Frame};
use etendue_benches::contest::thread_time;
use etendue_geometry::{HitBatch, RayBatch, RayBlock};
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, plan};
use etendue_scene::{LoadOptions, SceneFile};
use serde_json::json;

/// Prints as JSON what the accelerator takes of a render of the scene at `path`, all threads together (s), with
/// watertight answers and without.
pub(crate) fn print_bound(path: &Path) -> anyhow::Result<()> {
    let file = SceneFile::read(path, &[])?;
    let scene = file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())?;
    let plan = Plan::new(&scene, Outputs { npy: true, ..Outputs::NONE });
    let images = Images::decode(&scene, &plan, None)?;
    let mut bound = serde_json::Map::new();
    for (name, robust) in [("robust", true), ("fast", false)] {
        let options = BuildOptions { robust, ..BuildOptions::default() };
        let timed = Timed::new(etendue_render::build(&scene, &plan, &options)?);
        etendue_render::render(&scene, &plan, &timed, &images, Vec::new(), &|_: f64| true)?;
        bound.insert(name.into(), json!(timed.seconds()));
        bound.insert("rays".into(), json!(timed.rays.into_inner()));
    }
    println!("{}", serde_json::Value::from(bound));
    Ok(())
}

/// An accelerator with a clock: a call is a batch of hundreds of rays, beside which the clock's own time is nothing.
#[derive(Debug)]
struct Timed {
    accel: Box<dyn Accel>,
    /// Processor time of all threads within it (ns).
    taken: AtomicU64,
    rays: AtomicU64,
}

impl Timed {
    fn new(accel: Box<dyn Accel>) -> Self {
        Self { accel, taken: AtomicU64::new(0), rays: AtomicU64::new(0) }
    }

    fn seconds(&self) -> f64 {
        self.taken.load(Ordering::Relaxed) as f64 * 1e-9
    }

    fn time<T>(&self, rays: usize, query: impl FnOnce() -> T) -> T {
        let start = thread_time();
        let answer = query();
        let taken = Duration::from_secs_f64((thread_time() - start).max(0.0));
        let nanoseconds = u64::try_from(taken.as_nanos()).unwrap_or(u64::MAX);
        self.taken.fetch_add(nanoseconds, Ordering::Relaxed);
        self.rays.fetch_add(rays as u64, Ordering::Relaxed);
        answer
    }

    /// The structure behind as one of blocks.
    fn of_blocks(&self) -> &dyn BlockAccel {
        self.accel.blocks().expect("asked only where it has blocks")
    }
}

impl Accel for Timed {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        self.time(rays.len(), || self.accel.closest(rays, hits));
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        self.time(rays.len(), || self.accel.occluded(rays, blocked));
    }

    fn blocks(&self) -> Option<&dyn BlockAccel> {
        self.accel.blocks().map(|_| self as &dyn BlockAccel)
    }

    fn report(&self) -> BuildReport {
        self.accel.report()
    }

    fn counts(&self) -> Counts {
        self.accel.counts()
    }
}

impl BlockAccel for Timed {
    fn frame(&self) -> &F32Frame {
        self.of_blocks().frame()
    }

    fn has_times(&self) -> bool {
        self.of_blocks().has_times()
    }

    fn closest_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool) {
        let lanes = blocks.len() * etendue_geometry::block::LANES;
        self.time(lanes, || self.of_blocks().closest_of_blocks(blocks, times, coherent));
    }

    fn occluded_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool) {
        let lanes = blocks.len() * etendue_geometry::block::LANES;
        self.time(lanes, || self.of_blocks().occluded_of_blocks(blocks, times, coherent));
    }
}
