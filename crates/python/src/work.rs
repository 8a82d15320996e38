//! Work without Python's lock: its threads, how Ctrl-C stops it, and the exceptions of its callbacks.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use etendue::Progress;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::arrays::refused;

/// Time after which Python is asked again whether Ctrl-C was pressed, and shown progress (ms).
const LOOK: u64 = 50;

/// A pool of `threads` threads (0 for all processors) for one piece of work. Threads do not survive a fork, so none
/// are kept.
fn pool(threads: usize) -> PyResult<ThreadPool> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| refused(format!("threads = {threads}: {error}")))
}

/// Number of threads, of the number that is asked for, that work in `pieces` is worth.
pub(crate) fn threads_for(pieces: usize, threads: usize) -> usize {
    if pieces > 1 { threads } else { 1 }
}

/// Signal that stops work, and the exception that did.
#[derive(Clone, Default)]
pub(crate) struct StopSignal {
    stopped: Arc<AtomicBool>,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl StopSignal {
    pub(crate) fn is_asked_for(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Stops the work because of an exception; the first one counts.
    fn raise(&self, error: PyErr) {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        self.stopped.store(true, Ordering::Relaxed);
    }

    fn raised(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// A build's progress function that ends when this stops.
    pub(crate) fn heeded(&self) -> Arc<dyn Fn(f64) -> bool + Send + Sync> {
        let stop = self.clone();
        Arc::new(move |_| !stop.is_asked_for())
    }

    /// Progress that shows itself to `callback` now and then, and ends when this stops.
    pub(crate) fn progress(&self, callback: Option<Py<PyAny>>) -> Progress {
        let (stop, start, next) = (self.clone(), Instant::now(), AtomicU64::new(0));
        Progress::new(move |phase, share| {
            let now = u64::try_from(start.elapsed().as_millis()).unwrap_or(u64::MAX);
            let due = next.load(Ordering::Relaxed);
            let later = now + LOOK;
            let is_mine = now >= due
                && next.compare_exchange(due, later, Ordering::Relaxed, Ordering::Relaxed).is_ok();
            if let (true, false, Some(callback)) = (is_mine, stop.is_asked_for(), &callback)
                && let Err(error) = Python::attach(|py| callback.call1(py, (phase.name(), share)))
            {
                stop.raise(error);
            }
            !stop.is_asked_for()
        })
    }
}

/// Does `work` on `threads` threads (0 for all processors) without Python's lock, while this thread asks
/// whether Ctrl-C was pressed: Python tells no other one. The exception that stopped it comes out.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    threads: usize,
    stop: &StopSignal,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let pool = pool(threads)?;
    let done = py.detach(|| watched(stop, || pool.install(work)));
    match (stop.raised(), done) {
        (Some(raised), _) => Err(raised),
        (None, Ok(Some(done))) => Ok(done),
        (None, Ok(None)) => {
            Err(PyRuntimeError::new_err("a fault of etendue; see the message above"))
        }
        (None, Err(error)) => {
            Err(PyRuntimeError::new_err(format!("no thread to work in: {error}")))
        }
    }
}

/// The result of `work`, done in a thread of its own; `None` when it panicked, which was told.
fn watched<T: Send>(
    stop: &StopSignal,
    work: impl FnOnce() -> T + Send,
) -> std::io::Result<Option<T>> {
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        let worker = std::thread::Builder::new().spawn_scoped(scope, move || {
            // The other end is there until this one is gone.
            let _ = sender.send(work());
        })?;
        loop {
            match receiver.recv_timeout(Duration::from_millis(LOOK)) {
                Ok(done) => return Ok(Some(done)),
                Err(RecvTimeoutError::Disconnected) => {
                    // Joined here, its panic does not go on.
                    let _ = worker.join();
                    return Ok(None);
                }
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(error) = Python::attach(|py| py.check_signals()) {
                        stop.raise(error);
                    }
                }
            }
        }
    })
}
