//! Room for the program itself where the shell limits its addresses (`ulimit -v`).
//!
//! What a scene takes is forecast and refused by name. Stacks of threads, and the lists of a few bytes
//! that are everywhere, are not: without room for them a library ends the process.

use std::io::Write as _;

use etendue_report::Size;
use etendue_scene::memory::addresses;

use crate::fault::Fault;

/// The C library gives each thread that asks it for memory 64 MiB of addresses of its own, used or not:
/// with one such arena for all, a limit holds what is used.
const ARENAS: (&str, &str) = ("MALLOC_ARENA_MAX", "1");

/// Memory that the program itself takes beside its threads (bytes): Embree's device and what measures this machine
/// among it. With less, whether a library ends the process is a matter of which thread asks first.
const ITSELF: u64 = 200 << 20;

/// Memory that each thread takes (bytes): a stack of ours, one of Embree's, and their small lists.
const THREAD: u64 = 8 << 20;

/// Memory that the reading of a command line takes at most (bytes); it takes less than one.
const COMMAND: u64 = 4 << 20;

/// Tests whether the shell leaves addresses enough to read a command line, and says so if not. Asks for no memory
/// itself: where there is none, whatever asks first ends the process.
pub(crate) fn has_room_for_command() -> bool {
    let Some(left) = addresses().filter(|&left| left < COMMAND) else { return true };
    let (left, needed) = (Size(left), Size(COMMAND));
    let _ = writeln!(
        std::io::stderr(),
        "error: the shell's limit (ulimit -v) leaves {left}, and to read a command takes {needed}\n\
         hint: raise the limit"
    );
    false
}

/// Refuses to work on so many threads (all, for 0) where the shell leaves too few addresses. Under such a
/// limit the program starts itself anew, with one arena.
pub(crate) fn check_memory_limit(threads: usize) -> Result<(), Fault> {
    let Some(left) = addresses() else { return Ok(()) };
    if std::env::var_os(ARENAS.0).is_none() {
        restart();
    }
    let threads = if threads == 0 { all_threads() } else { threads };
    let needed = ITSELF + THREAD.saturating_mul(threads as u64);
    if left >= needed {
        return Ok(());
    }
    let plural = if threads == 1 { "" } else { "s" };
    Err(Fault::refused(format!(
        "the shell's limit (ulimit -v) leaves {}, and the program itself needs {} with {threads} thread{plural}\
         \nhint: raise the limit",
        Size(left),
        Size(needed)
    )))
}

/// Runs the command once more, in this process. Returns where that cannot be had, and then goes on.
#[cfg(unix)]
fn restart() {
    use std::os::unix::process::CommandExt;
    use std::process::Command;
    let Ok(program) = std::env::current_exe() else { return };
    let mut arguments = std::env::args_os();
    let name = arguments.next().unwrap_or_else(|| program.clone().into_os_string());
    let _ = Command::new(program).arg0(name).args(arguments).env(ARENAS.0, ARENAS.1).exec();
}

/// Other systems have neither such limits nor such arenas.
#[cfg(not(unix))]
fn restart() {}

/// As many as the thread pool takes.
fn all_threads() -> usize {
    let named = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse().ok());
    let named = named.filter(|&threads: &usize| threads > 0);
    named.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}
