//! What the figures were measured on, and how much memory a process holds.

use std::fs;
use std::process::Command;

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

/// What this process holds (bytes); zeros where the system does not tell.
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
