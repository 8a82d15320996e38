//! Ctrl-C, SIGTERM and SIGHUP: the first asks the work to stop, which leaves no half file; the second
//! ends the process at once. Work that does not answer in time is ended, too, unless it has something
//! to save.

use std::path::{Path, PathBuf};
#[cfg(not(unix))]
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use etendue_files::remove_open_parts;
#[cfg(unix)]
use signal_hook::consts::SIGHUP;
use signal_hook::consts::{SIGINT, SIGTERM};
#[cfg(unix)]
use signal_hook::iterator::Signals;
use signal_hook::low_level::exit;

/// The signals that came.
static REQUESTS: AtomicU32 = AtomicU32::new(0);

/// The work has stopped and what it has is being written.
static HEEDED: AtomicBool = AtomicBool::new(false);

/// There is something worth waiting for.
static SAVES: AtomicBool = AtomicBool::new(false);

/// A folder that was made for the results.
static NEW_FOLDER: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Time that the work may take to answer: what it has begun, it may end, within what feels immediate.
const PATIENCE: Duration = Duration::from_millis(200);

/// Message on work that left nothing.
pub(crate) const STOPPED: &str = "stopped; no unfinished file was left";

/// Takes over Ctrl-C and the termination signals for the rest of the process, whose end is said by `say`. A
/// signal that it was started to ignore, as by `nohup`, stays ignored.
#[cfg(unix)]
pub(crate) fn listen(say: fn(&str)) {
    let ignored = ignored();
    let wanted = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|n| ignored >> (n - 1) & 1 == 0);
    // Without a handler the signal ends the process as ever; open parts then stay behind.
    let Ok(mut signals) = Signals::new(wanted) else { return };
    let _ = std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        for _ in signals.forever() {
            came(say);
        }
    });
}

/// Takes over Ctrl-C and the request to end for the rest of the process, whose end is said by `say`. Where
/// signals cannot be waited for they are looked for, as often as work is patient.
#[cfg(not(unix))]
pub(crate) fn listen(say: fn(&str)) {
    let asked = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Without a handler the signal ends the process as ever; open parts then stay behind.
        let _ = signal_hook::flag::register(signal, Arc::clone(&asked));
    }
    let _ = std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        loop {
            std::thread::sleep(PATIENCE);
            if asked.swap(false, Ordering::Relaxed) {
                came(say);
            }
        }
    });
}

/// A signal came: the first asks the work to stop, the second ends the process.
fn came(say: fn(&str)) {
    if REQUESTS.fetch_add(1, Ordering::Relaxed) > 0 {
        end(say);
    }
    let _ = std::thread::Builder::new().spawn(move || {
        std::thread::sleep(PATIENCE);
        if !HEEDED.load(Ordering::Relaxed) && !SAVES.load(Ordering::Relaxed) {
            end(say);
        }
    });
}

/// The signals that the process was started to ignore, one a bit, where the system tells.
#[cfg(unix)]
#[expect(clippy::disallowed_methods, reason = "a table of the kernel's, no user's file")]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// Ends the process now.
fn end(say: fn(&str)) -> ! {
    remove_open_parts();
    if let Some(folder) = NEW_FOLDER.lock().unwrap_or_else(PoisonError::into_inner).take() {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(folder);
    }
    say(&format!("error: {STOPPED}"));
    // Threads are at work everywhere: nothing that belongs to them is taken down first.
    exit(1)
}

/// True if the work should stop.
pub(crate) fn asked() -> bool {
    REQUESTS.load(Ordering::Relaxed) > 0 && !HEEDED.load(Ordering::Relaxed)
}

/// Says that the work has stopped, and that what follows is to save what there is: it is not asked
/// to stop again.
pub(crate) fn heed() {
    HEEDED.store(true, Ordering::Relaxed);
}

/// Says whether there is something to save, for which to wait.
pub(crate) fn saves(something: bool) {
    SAVES.store(something, Ordering::Relaxed);
}

/// Has `folder` removed at the end when it is new and nothing was written into it.
pub(crate) fn made(folder: &Path) {
    *NEW_FOLDER.lock().unwrap_or_else(PoisonError::into_inner) = Some(folder.to_owned());
}
