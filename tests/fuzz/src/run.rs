//! Many inputs in a process of their own, with limits for each.
//!
//! The parent gives the child as much memory as one input may take, and finds the input in a file
//! when the child ends before its time: by a panic, an abort for memory, or its own watchdog.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use fastrand::Rng;
use rustix::time::{ClockId, clock_gettime};

use crate::targets::Target;
use crate::{mutate, seeds};

/// The most memory of the process for one input (bytes), with what the program itself holds.
pub const MOST_MEMORY: u64 = 1 << 30;

/// The most processor time of one input. The machine may be busy, so that the time on the clock
/// tells little; [`MOST_WAIT`] ends what waits for ever.
pub const MOST_TIME: Duration = Duration::from_secs(5);

/// The most time on the clock of one input.
pub const MOST_WAIT: Duration = Duration::from_secs(120);

/// Work that the child is to do.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Time for which inputs are made, behind the seeds.
    pub time: Duration,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Runs `target` in a process of its own: how many inputs it read, or the one that failed and how.
///
/// # Errors
///
/// When the process cannot be started, or files cannot be written.
pub fn supervise(target: Target, effort: Effort, program: &Path) -> Result<Result<u64, Failure>> {
    let folder = tempfile::tempdir()?;
    // The shell's own limit, in KiB: it is the simplest that needs nobody's trust.
    let script = "ulimit -d \"$1\" && shift && exec \"$0\" \"$@\"";
    let kibibytes = (MOST_MEMORY >> 10).to_string();
    let [seconds, seed] = [effort.time.as_secs(), effort.seed].map(|number| number.to_string());
    let child = Command::new("sh")
        .args(["-c", script])
        .arg(program)
        .args([&kibibytes, "--child", target.name])
        .arg(folder.path())
        .args([&seconds, &seed])
        // Threads take memory and give nothing: inputs are small.
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .context("sh cannot be started")?;
    if child.status.success() {
        let count = String::from_utf8_lossy(&child.stdout);
        return Ok(Ok(count.trim().parse().context("the child did not count its inputs")?));
    }
    let input = fs::read(folder.path().join(CURRENT)).context("the child left no input")?;
    let words = String::from_utf8_lossy(&child.stderr);
    let last = words.lines().rev().take(6).collect::<Vec<_>>();
    let last: Vec<&str> = last.into_iter().rev().collect();
    Ok(Err(Failure { input, how: format!("{}\n{}", child.status, last.join("\n")) }))
}

/// An input that was not read within the limits.
#[derive(Debug)]
pub struct Failure {
    /// The input.
    pub input: Vec<u8>,
    /// End of the process, and its last words.
    pub how: String,
}

/// File in which the child keeps the input it is at.
const CURRENT: &str = "current-input";

/// Runs the seeds, and then changed ones until the time is over. Gives the number of inputs.
///
/// # Errors
///
/// When the folder cannot be written to.
pub fn child(target: Target, folder: &Path, effort: Effort) -> Result<u64> {
    let watch = Watch::start();
    let work = folder.join("work");
    fs::create_dir_all(&work)?;
    let mut inputs = seeds::of(target.name);
    let mut count = 0;
    let mut one = |input: &[u8]| -> Result<()> {
        fs::write(folder.join(CURRENT), input)?;
        watch.begin();
        (target.run)(input, &work);
        watch.end();
        count += 1;
        Ok(())
    };
    for seed in &inputs {
        one(seed)?;
    }
    let mut rng = Rng::with_seed(effort.seed);
    let start = Instant::now();
    while start.elapsed() < effort.time {
        let of = |rng: &mut Rng| rng.usize(0..inputs.len());
        let (input, other) = (of(&mut rng), of(&mut rng));
        let changed = mutate::mutate(&mut rng, &inputs[input], &inputs[other]);
        one(&changed)?;
        // A random walk of short inputs, beside what stays.
        if rng.u32(0..32) == 0 && changed.len() < 1 << 14 {
            match inputs.len() {
                0..64 => inputs.push(changed),
                _ => {
                    let at = rng.usize(32..inputs.len());
                    inputs[at] = changed;
                }
            }
        }
    }
    Ok(count)
}

/// Ends the process when one input takes too long.
struct Watch(&'static Mutex<Begun>);

/// The processor time and the time when an input was begun.
type Begun = Option<(Duration, Instant)>;

impl Watch {
    fn start() -> Self {
        // One a process.
        let begun: &'static Mutex<Begun> = Box::leak(Box::default());
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(Duration::from_millis(100));
                let begun: Begun = *begun.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                let Some((time, instant)) = begun else { continue };
                let (time, wait) = (processor_time().saturating_sub(time), instant.elapsed());
                if time > MOST_TIME || wait > MOST_WAIT {
                    eprintln!("too slow: {time:.1?} of processor time, {wait:.1?} on the clock");
                    std::process::exit(3);
                }
            }
        });
        Self(begun)
    }

    fn set(&self, begun: Begun) {
        *self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = begun;
    }

    fn begin(&self) {
        self.set(Some((processor_time(), Instant::now())));
    }

    fn end(&self) {
        self.set(None);
    }
}

/// The processor time of this process and all its threads so far.
pub(crate) fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    let [seconds, nanoseconds] = [time.tv_sec, time.tv_nsec].map(u64::try_from);
    Duration::from_secs(seconds.unwrap_or(0)) + Duration::from_nanos(nanoseconds.unwrap_or(0))
}

/// Keeps the input of a failure under a name that tells it from others; where.
///
/// # Errors
///
/// When it cannot be written.
pub fn keep(failure: &Failure, target: Target, folder: &Path) -> Result<PathBuf> {
    // FNV-1a (Fowler, Noll, Vo 1991): the same input has the same name.
    let hash = failure.input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let folder = folder.join(target.name);
    fs::create_dir_all(&folder)?;
    let path = folder.join(format!("{hash:016x}"));
    fs::write(&path, &failure.input)?;
    Ok(path)
}

/// Writes the seeds of `target` as files of `folder`.
///
/// # Errors
///
/// When they cannot be written.
pub fn write_seeds(target: Target, folder: &Path) -> Result<usize> {
    let folder = folder.join(target.name);
    fs::create_dir_all(&folder)?;
    let all = seeds::of(target.name);
    if all.is_empty() {
        bail!("there are no seeds of {}", target.name);
    }
    for (number, seed) in all.iter().enumerate() {
        fs::write(folder.join(format!("seed-{number:03}")), seed)?;
    }
    Ok(all.len())
}
