#![doc = include_str!("../README.md")]
//!
//! Three backends answer to one trait, [`Accel`]:
//!
//! | backend | what it is | speed | exactness |
//! |---|---|---|---|
//! | [`Embree`] | Intel's Embree finds, f64 measures | the fastest | of f64, watertight |
//! | [`Bvh`] | pure Rust, for machines without Embree | good | of f64, watertight |
//! | [`Exact`] | f64 throughout, exact edge predicates | slow | the reference |
//!
//! *Single precision finds, double precision measures*: a fast backend says **which** triangle a ray
//! hits; the f64
//! solution then works out where, in f64 and relative to the ray's origin, so that distances
//! are accurate to the coordinates the file gave, and stay so far from the origin.

mod bvh;
#[cfg(feature = "embree")]
mod checked;
mod deforming;
#[cfg(feature = "embree")]
mod embree;
mod exact;
mod few;
mod moving;
mod name;
mod nearest;
mod parts;
#[cfg(feature = "embree")]
mod recheck;
#[cfg_attr(
    not(feature = "embree"),
    expect(dead_code, reason = "few triangles need its conversion alone")
)]
mod single;
#[cfg(feature = "embree")]
mod solve;
mod tree;
mod triangle;
pub mod watertight;

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, HitBatch, RayBatch, RayBlock, RayBlocks};

pub use bvh::Bvh;
#[cfg(feature = "embree")]
pub use checked::Embree;
#[cfg(feature = "limit")]
pub use embree::limit;
#[cfg(feature = "embree")]
pub use embree::{Version, version as embree_version};
pub use exact::Exact;
pub use moving::{Build, build_moving};
pub use name::AccelName;
pub use parts::check_scale;
pub use single::{BlockOrigin, F32Frame};

/// Answers nearest-hit and visibility queries about one scene. Built once, then only read.
pub trait Accel: Send + Sync + fmt::Debug {
    /// The closest hit of each ray. `hits` is resized to the batch, and filled to its detail.
    ///
    /// Among hits in one place the one of the latest placement wins, then the lowest triangle: those at the
    /// very same distance, and those of [triangles in one plane](etendue_geometry::Coplanar) within 64 units
    /// in the last place (f64) of the largest of the distance and the coordinates of the ray's origin.
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch);

    /// Tests whether anything lies between each ray's `t_min` and `t_max`. `blocked` is resized.
    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>);

    /// This structure as one that traces rays in blocks; `None` where it does not, or not in this scene.
    fn blocks(&self) -> Option<&dyn BlockAccel> {
        None
    }

    /// The structure over `geometry`, some of whose placements were moved, added or replaced since this
    /// one was built, with all of this one that has not changed; `None` for backends that build anew.
    fn rebuilt(
        &self,
        _geometry: Arc<Geometry>,
        _options: &BuildOptions,
    ) -> Option<Result<Box<dyn Accel>, BuildError>> {
        None
    }

    /// Report of the build.
    fn report(&self) -> BuildReport;

    /// Counts of what re-validation has done since the build.
    fn counts(&self) -> Counts {
        Counts::default()
    }
}

/// Hits of single precision for rays in blocks: as [`Accel`] finds them for batches of
/// [`HitPrecision::Single`](etendue_geometry::HitPrecision), without arrays on the way.
pub trait BlockAccel: Send + Sync + fmt::Debug {
    /// Frame of the coordinates of blocks.
    fn frame(&self) -> &F32Frame;

    /// Reference point of the origins of blocks (m, world).
    fn origin(&self) -> DVec3 {
        self.frame().origin()
    }

    /// The rays of a batch as blocks, which are refilled. A ray from afar starts nearer to the scene.
    fn convert(&self, rays: &RayBatch, blocks: &mut RayBlocks) {
        self.frame().convert(rays, blocks);
    }

    /// The closest hit of each ray: its distance goes to `t_max`, with placement, triangle, weights and normal.
    /// Rays of one block that run close together are faster as `coherent`.
    /// `times` (s from the frame's time) are those of the rays, block by block; all are at 0 where there are none.
    fn closest_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool);

    /// Tests whether anything is between the ends of each ray ([`RayBlock::is_blocked`]).
    fn occluded_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool);

    /// True if what rays hit depends on their times.
    fn has_times(&self) -> bool {
        false
    }
}

/// Report of how a structure was built.
#[derive(Debug, Clone, PartialEq)]
pub struct BuildReport {
    /// The backend with its mode, e.g. `embree 3.13.5 robust`.
    pub backend: String,
    /// The quality it was built with.
    pub quality: Quality,
    /// Wall time of the build.
    pub time: Duration,
    /// Bytes of the structure itself, without the geometry it shares.
    pub bytes: u64,
    /// Bytes of vertices and indices that had to be copied (baked, padded or moved).
    pub copied_bytes: u64,
}

/// Counts of the f64 check of a fast backend's hits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays looked at a second time.
    pub rechecked: u64,
    /// Rays whose answer changed by that.
    pub corrected: u64,
}

/// Quality of a build: the time spent to make traversal faster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// Morton order: the quickest to build.
    Low,
    /// Binned surface-area heuristic.
    #[default]
    Medium,
    /// With spatial splits.
    High,
}

/// Options of a build.
#[derive(Clone)]
pub struct BuildOptions {
    /// Worker threads of the build; 0 means all that the process may use.
    pub threads: usize,
    /// Time against traversal speed.
    pub quality: Quality,
    /// Smaller nodes, slower traversal (Embree's compact mode).
    pub compact: bool,
    /// Watertight answers: Embree's robust mode, and a second look at suspicious rays. Off is
    /// faster and leaks at edges and vertices.
    pub robust: bool,
    /// Solve each hit again in f64. Off gives f32's distances.
    pub refine: bool,
    /// Between which times rays are (s from the frame's time, first and last): what moves then is kept apart
    /// by [`build_moving`].
    pub exposure: [f64; 2],
    /// Force one of Embree's instruction sets (`sse2`, `sse4.2`, `avx`, `avx2`, `avx512`).
    pub isa: Option<String>,
    /// Give up when the structure would need more bytes than this.
    pub memory_limit: Option<u64>,
    /// Told the share done (0..=1) now and then; answering `false` stops the build.
    pub progress: Option<Arc<dyn Fn(f64) -> bool + Send + Sync>>,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            threads: 0,
            quality: Quality::default(),
            compact: false,
            robust: true,
            refine: true,
            exposure: [0.0; 2],
            isa: None,
            memory_limit: None,
            progress: None,
        }
    }
}

impl fmt::Debug for BuildOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BuildOptions")
            .field("threads", &self.threads)
            .field("quality", &self.quality)
            .field("compact", &self.compact)
            .field("robust", &self.robust)
            .field("refine", &self.refine)
            .field("memory_limit", &self.memory_limit)
            .finish_non_exhaustive()
    }
}

/// Error of a structure that could not be built.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The build would pass the caller's memory limit.
    #[error(
        "building the {backend} structure needs more than the limit of {limit} bytes\nhint: raise \
         --memory-limit, or place fewer or lighter meshes"
    )]
    MemoryLimit {
        /// The backend that was building.
        backend: &'static str,
        /// The limit (bytes).
        limit: u64,
    },
    /// The machine has no more memory to give. What was built so far is freed, but for the handle of a
    /// scene of Embree's.
    #[error(
        "the machine has too little free memory for the {backend} structure ({call})\nhint: end other \
         programs, or place fewer or lighter meshes"
    )]
    OutOfMemory {
        /// The backend that was building.
        backend: &'static str,
        /// The library's call that said so.
        call: &'static str,
    },
    /// More triangles or corners than the backend can number.
    #[error("mesh \"{mesh}\": {what} is over the {backend} limit of {limit}\nhint: split the mesh")]
    TooLarge {
        /// The mesh's name.
        mesh: String,
        /// Quantity that is too large, with its number.
        what: String,
        /// The backend that was building.
        backend: &'static str,
        /// The most it takes.
        limit: u64,
    },
    /// A scene so large or so small that no backend tells its parts apart.
    #[error(
        "the scene measures {extent:.1e} m, and accelerators hold {least:.0e} to {most:.0e} m\nhint: scale its \
         objects, or leave out what stands far from the others"
    )]
    Scale {
        /// The scene's longest side (m).
        extent: f64,
        /// The shortest that they hold (m).
        least: f64,
        /// The longest that they hold (m).
        most: f64,
    },
    /// The caller's progress function asked to stop.
    #[error("the build was stopped")]
    Stopped,
    /// The library below reported an error.
    #[error("{call}: {message}")]
    Library {
        /// Function that was called.
        call: &'static str,
        /// The library's own message.
        message: String,
    },
}

/// Counts triangles as they are put in place, tells the caller, and hears whether to go on.
pub(crate) struct BuildWatch<'a> {
    options: &'a BuildOptions,
    total: u64,
    done: AtomicU64,
    stopped: AtomicBool,
}

impl<'a> BuildWatch<'a> {
    pub(crate) fn new(options: &'a BuildOptions, total: u64) -> Self {
        Self { options, total, done: AtomicU64::new(0), stopped: AtomicBool::new(false) }
    }

    /// Counts `triangles` more.
    ///
    /// # Errors
    ///
    /// [`BuildError::Stopped`] once the caller's progress function has answered `false`.
    pub(crate) fn advance(&self, triangles: u64) -> Result<(), BuildError> {
        let done = self.done.fetch_add(triangles, Ordering::Relaxed) + triangles;
        if let Some(progress) = &self.options.progress {
            let share = (done as f64 / self.total.max(1) as f64).min(1.0);
            if !self.stopped.load(Ordering::Relaxed) && !progress(share) {
                self.stopped.store(true, Ordering::Relaxed);
            }
        }
        if self.stopped.load(Ordering::Relaxed) { Err(BuildError::Stopped) } else { Ok(()) }
    }
}

/// Runs `build` with as many threads as the options ask for.
///
/// # Errors
///
/// Those of `build`, and [`BuildError::Library`] when threads cannot be had.
pub(crate) fn with_threads<T: Send>(
    options: &BuildOptions,
    build: impl FnOnce() -> Result<T, BuildError> + Send,
) -> Result<T, BuildError> {
    if options.threads == 0 {
        return build();
    }
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(options.threads).build().map_err(|error| {
            BuildError::Library {
                call: "rayon::ThreadPoolBuilder::build",
                message: error.to_string(),
            }
        })?;
    pool.install(build)
}
