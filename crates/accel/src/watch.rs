//! Progress of a build, from many threads at once.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::{BuildError, BuildOptions};

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
