//! Turns and medians of timed work; the machine that it ran on, and the memory of a process.
//!
//! Contestants take turns: a round times each of them once, so that whatever else the machine does
//! meanwhile meets all of them alike. A ratio is the median of the ratios of the rounds.

#![expect(clippy::disallowed_methods, reason = "tables of the kernel's, no user's files")]

use std::fs;
use std::process::Command;
use std::time::Instant;

use serde::Serialize;

/// The processor's model, its cores, and what is measured, one line each.
#[must_use]
pub fn describe() -> Vec<String> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    vec![
        format!("Processor: {}, {cores} cores for this process", processor()),
        format!("Memory: {:.0} GiB", gibibytes_of_machine()),
        format!("etendue {}; {}", env!("CARGO_PKG_VERSION"), embree()),
    ]
}

/// The compiler and the commit of the repository that the process was started in.
#[must_use]
pub fn checkout() -> String {
    format!("Commit {}; {}", commit(), first_line(Command::new("rustc").arg("--version")))
}

#[cfg(feature = "embree")]
fn embree() -> String {
    match etendue_accel::embree_version() {
        Ok(version) => version.to_string(),
        Err(error) => error.to_string(),
    }
}

#[cfg(not(feature = "embree"))]
fn embree() -> String {
    "built without Embree".to_owned()
}

fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line.split_once(':').map(|(_, value)| value.trim().to_owned())
    };
    let name = field("model name").unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let number = |name| field(name).unwrap_or_else(|| "?".to_owned());
    format!("{name} (family {}, model {})", number("cpu family"), number("model\t\t"))
}

fn gibibytes_of_machine() -> f64 {
    kilobytes("/proc/meminfo", "MemTotal:") as f64 / f64::from(1 << 20)
}

fn commit() -> String {
    let short = first_line(Command::new("git").args(["rev-parse", "--short", "HEAD"]));
    let changes = Command::new("git").args(["status", "--porcelain", "-uno"]).output();
    match changes {
        Ok(changes) if !changes.stdout.is_empty() => format!("{short} with changes"),
        _ => short,
    }
}

fn first_line(command: &mut Command) -> String {
    let output = command.output().ok().filter(|output| output.status.success());
    let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    text.and_then(|text| text.lines().next().map(str::to_owned)).unwrap_or_else(|| "?".to_owned())
}

fn kilobytes(file: &str, field: &str) -> u64 {
    let text = fs::read_to_string(file).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(field)).unwrap_or_default();
    line.split_whitespace().next().and_then(|number| number.parse().ok()).unwrap_or(0)
}

/// Memory that this process holds (bytes); zeros where the system does not tell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ProcessMemory {
    /// Its own.
    pub private: u64,
    /// Pages of mapped files, which the system may take back.
    pub mapped: u64,
    /// The most of both at any time so far.
    pub peak: u64,
}

impl ProcessMemory {
    /// Now.
    #[must_use]
    pub fn now() -> Self {
        let field = |name| kilobytes("/proc/self/status", name) << 10;
        Self { private: field("RssAnon:"), mapped: field("RssFile:"), peak: field("VmHWM:") }
    }
}

/// Wall time of `work` (s), and what it made.
pub fn wall<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let made = work();
    (start.elapsed().as_secs_f64(), made)
}

/// Times of one contestant, round by round (s).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Timings(pub Vec<f64>);

impl Timings {
    /// The median (s); NaN without rounds.
    #[must_use]
    pub fn median(&self) -> f64 {
        median(self.0.clone())
    }

    /// The fastest round (s).
    #[must_use]
    pub fn fastest(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The slowest round (s).
    #[must_use]
    pub fn slowest(&self) -> f64 {
        self.0.iter().copied().fold(0.0, f64::max)
    }

    /// Speed relative to `other`: the median over the rounds.
    #[must_use]
    pub fn speed_against(&self, other: &Self) -> f64 {
        median(self.0.iter().zip(&other.0).map(|(own, other)| other / own).collect())
    }

    /// The three numbers that are told of it; `None` without rounds.
    #[must_use]
    pub fn spread(&self) -> Option<TimeSpread> {
        let spread = || TimeSpread {
            median: self.median(),
            fastest: self.fastest(),
            slowest: self.slowest(),
        };
        (!self.0.is_empty()).then(spread)
    }
}

/// Times of all rounds in three numbers (s).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimeSpread {
    /// The median.
    pub median: f64,
    /// The fastest round.
    pub fastest: f64,
    /// The slowest round.
    pub slowest: f64,
}

/// The middle value, or the mean of the two in the middle; NaN of nothing.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let (below, above) = (values.len().wrapping_sub(1) / 2, values.len() / 2);
    match (values.get(below), values.get(above)) {
        (Some(a), Some(b)) => (a + b) / 2.0,
        _ => f64::NAN,
    }
}

/// Something that is timed once a round; it tells its own seconds.
pub type Turn<'a> = Box<dyn FnMut() -> f64 + 'a>;

/// Times each of `turns` once a round, after one round that is not counted. Each round begins with
/// another of them.
pub fn take_turns(rounds: usize, turns: &mut [Turn<'_>]) -> Vec<Timings> {
    let mut series = vec![Timings::default(); turns.len()];
    for turn in turns.iter_mut() {
        turn();
    }
    for round in 0..rounds {
        for who in order(round, turns.len()) {
            series[who].0.push(turns[who]());
        }
    }
    series
}

/// In which order `count` contestants take their turns in a round.
pub fn order(round: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |k| (round + k) % count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_medians_of_rounds() {
        let (ours, limit) = (Timings(vec![2.0, 4.0, 30.0]), Timings(vec![1.0, 2.0, 3.0]));
        assert_eq!(ours.speed_against(&limit), 0.5, "a round of noise does not move it");
        assert_eq!(ours.median(), 4.0);
        assert_eq!(Timings(vec![1.0, 3.0]).median(), 2.0);
        assert!(Timings::default().median().is_nan());
        assert_eq!(Timings::default().spread(), None);
    }

    #[test]
    fn every_turn_is_taken_once_a_round_after_a_warm_up() {
        let count = std::cell::Cell::new(0.0);
        let next = || {
            count.set(count.get() + 1.0);
            count.get()
        };
        let series = take_turns(2, &mut [Box::new(next), Box::new(next)]);
        assert_eq!(series[0].0, [3.0, 6.0]);
        assert_eq!(series[1].0, [4.0, 5.0]);
    }
}
