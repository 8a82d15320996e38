//! What libFuzzer's programs in `fuzz/` do with an input: the target, under the limit of time of
//! [`run`](crate::run), on the clock of the processor. libFuzzer's own clock runs on while other
//! programs have the machine.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

use tempfile::TempDir;

use crate::run::{MOST_TIME, processor_time};
use crate::targets::named;

/// Where targets put their files.
static FOLDER: LazyLock<TempDir> =
    LazyLock::new(|| tempfile::tempdir().expect("a temporary folder"));

/// The processor time of the slowest input so far (µs).
static SLOWEST: AtomicU64 = AtomicU64::new(0);

/// Has the target `name` read `input`, and says on standard error when none took longer before.
///
/// # Panics
///
/// When there is no such target, or the input takes more than [`MOST_TIME`]: libFuzzer then keeps it.
pub fn read(name: &str, input: &[u8]) {
    let target = named(name).expect("the name of a target");
    let start = processor_time();
    (target.run)(input, FOLDER.path());
    let time = processor_time().saturating_sub(start);
    let micros = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
    if micros > SLOWEST.fetch_max(micros, Ordering::Relaxed) {
        eprintln!("slowest: {micros} us of processor time");
    }
    assert!(time <= MOST_TIME, "{time:.1?} of processor time for {} bytes", input.len());
}
