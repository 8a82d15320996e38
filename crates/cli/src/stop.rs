//! Ctrl-C: the first asks the work to stop, which leaves no half file; the second does not wait.

use std::sync::atomic::{AtomicBool, Ordering};

use etendue_render::output::remove_open_parts;

static STOP: AtomicBool = AtomicBool::new(false);

/// Takes over Ctrl-C and the termination signals for the rest of the process.
pub(crate) fn listen() {
    // Without a handler the signal ends the process as ever; open parts then stay behind.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            remove_open_parts();
            std::process::exit(1);
        }
    });
}

/// Whether the work should stop.
pub(crate) fn asked() -> bool {
    STOP.load(Ordering::Relaxed)
}
