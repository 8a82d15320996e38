//! Place of a machine's calibration: a small file in the user's cache folder.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use etendue_accel::AccelName;
use etendue_files::{SOFTWARE, Transaction};
use serde::{Deserialize, Serialize};

use super::Calibration;
use crate::Error;

/// The file, below the cache folder.
const FILE: &str = "etendue/calibration.json";

/// The most bytes that such a file has: a few hundred machines that share a home.
const MOST_BYTES: u64 = 1 << 20;

/// Rates that are kept, by the machine that they were measured on.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeptRates {
    machines: BTreeMap<String, Calibration>,
}

impl Calibration {
    /// The rates of this machine: those that are kept, or else measured now, which takes a second or so, and
    /// kept for the next time. A file that cannot be read or makes no sense is made anew; where none can be
    /// written, nothing is kept.
    ///
    /// # Errors
    ///
    /// When the machine cannot be measured.
    pub fn of_this_machine() -> Result<Self, Error> {
        match Self::kept() {
            Some(kept) => Ok(kept),
            None => Self::measured(),
        }
    }

    /// The rates that are kept of this machine.
    #[must_use]
    pub fn kept() -> Option<Self> {
        let rates = read(&place()?).machines.remove(&machine())?;
        rates.is_sound().then_some(rates)
    }

    /// Measures this machine anew, and keeps its rates.
    ///
    /// # Errors
    ///
    /// When it cannot be measured.
    pub fn measured() -> Result<Self, Error> {
        let folder = tempfile::tempdir().map_err(|error| {
            Error::Refused(format!(
                "no folder for temporary files, to measure this machine: {error}"
            ))
        })?;
        let rates = Self::measure(folder.path())?;
        if let Some(path) = place() {
            // A favour for the next time: without it, everything is as it was.
            let _ = keep(&path, rates);
        }
        Ok(rates)
    }
}

fn keep(path: &Path, rates: Calibration) -> Result<(), Error> {
    let mut kept = read(path);
    kept.machines.insert(machine(), rates);
    if let Some(folder) = path.parent() {
        crate::places::folder(folder)?;
    }
    let json = serde_json::to_string_pretty(&kept).map_err(|e| Error::Refused(e.to_string()))?;
    Ok(Transaction::at_once().write(path, |file| writeln!(file, "{json}"))?)
}

/// Reads the rates that are kept; nothing when it cannot be read.
fn read(path: &Path) -> KeptRates {
    let text = etendue_files::read(path, MOST_BYTES).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// `$XDG_CACHE_HOME`, or `.cache` at home (XDG Base Directory Specification 0.8).
fn place() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let cache = folder("XDG_CACHE_HOME").or_else(|| Some(folder("HOME")?.join(".cache")))?;
    Some(cache.join(FILE))
}

/// Words for all that rates depend on: the processor, the threads, and this program with the accelerator that it has.
#[expect(clippy::disallowed_methods, reason = "a table of the kernel's, no user's file")]
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let processor = line.and_then(|line| line.split_once(':')).map_or("", |(_, name)| name.trim());
    let backend = AccelName::best();
    let kind = if cfg!(debug_assertions) { ", debug" } else { "" };
    format!("{processor}, {} threads, {SOFTWARE}, {backend:?}{kind}", rayon::current_num_threads())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: Calibration = Calibration {
        build: [1e-7, 2e-7, 3e-7],
        placed_copy: 1e-7,
        ray: 1e-7,
        exr: 1e-8,
        npy: 1e-8,
        png: 1e-8,
        together: 0.5,
        raw: 1e-8,
        rgb: 1e-8,
        noise: [1e-8, 1e-9],
    };

    #[test]
    fn what_is_kept_is_found_again_and_a_broken_file_is_made_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("below").join(FILE);
        assert!(read(&path).machines.is_empty());
        keep(&path, RATES).unwrap();
        assert_eq!(read(&path).machines.get(&machine()), Some(&RATES));
        for broken in ["", "{", "{\"machines\": 3}", "{\"machines\": {\"a\": {\"ray\": 1}}}"] {
            std::fs::write(&path, broken).unwrap();
            assert!(read(&path).machines.is_empty(), "{broken}");
            keep(&path, RATES).unwrap();
            assert_eq!(read(&path).machines.len(), 1);
        }
        let entries = std::fs::read_dir(path.parent().unwrap()).unwrap().count();
        assert_eq!(entries, 1, "written beside and renamed, nothing is left");
    }

    #[test]
    fn rates_that_are_no_times_do_not_count() {
        assert!(RATES.is_sound());
        assert!(!Calibration { ray: f64::NAN, ..RATES }.is_sound());
        assert!(!Calibration { build: [0.0, -1.0, 0.0], ..RATES }.is_sound());
        assert!(!Calibration { png: 2.0, ..RATES }.is_sound());
    }
}
