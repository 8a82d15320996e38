//! The way from an input of libFuzzer's programs in `fuzz/` to the target, under the limit of time of
//! [`run`](crate::run), on the clock of the processor. libFuzzer's own clock runs on while other
//! programs have the machine.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

use tempfile::TempDir;

use crate::run::{MOST_TIME, processor_time};
use crate::targets::named;

/// Folder into which targets put their files.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    // libFuzzer's own hook ends the process for a panic that the reader makes an error of.
    drop(std::panic::take_hook());
    tempfile::tempdir().expect("a temporary folder")
});

/// The processor time of the slowest input so far (µs).
static SLOWEST: AtomicU64 = AtomicU64::new(0);

/// Has the target `name` read `input`, and says on standard error when none took longer before.
///
/// Ends the process for a panic that leaves the target, and for more than [`MOST_TIME`]: libFuzzer then keeps
/// the input.
///
/// # Panics
///
/// When there is no such target.
pub fn read(name: &str, input: &[u8]) {
    let target = named(name).expect("the name of a target");
    let folder = FOLDER.path();
    let start = processor_time();
    let done = catch_unwind(AssertUnwindSafe(|| (target.run)(input, folder)));
    let time = processor_time().saturating_sub(start);
    let micros = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
    if micros > SLOWEST.fetch_max(micros, Ordering::Relaxed) {
        eprintln!("slowest: {micros} us of processor time");
    }
    if time > MOST_TIME {
        eprintln!("{time:.1?} of processor time for {} bytes", input.len());
    }
    if done.is_err() || time > MOST_TIME {
        std::process::abort();
    }
}
