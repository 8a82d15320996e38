//! Memory limit of a scene, and one account of the memory it will take: whatever grows with a file
//! is spoken for here before it is made.

#![expect(clippy::disallowed_methods, reason = "tables of the kernel's, no user's files")]

use std::fmt;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use etendue_report::Size;
use rayon::prelude::*;

/// The most memory that may be taken (bytes), and who says so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limit {
    /// Bytes.
    pub bytes: u64,
    /// Origin of the limit.
    pub source: LimitSource,
}

/// Origin of a memory limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LimitSource {
    /// The user.
    Given,
    /// The machine has no more free.
    Machine,
    /// The control group (a container) that the process is in.
    Group,
    /// The shell's limit of addresses, `ulimit -v`.
    Addresses,
    /// The system, which gave no more when it was asked.
    System,
}

impl Limit {
    /// The limit that the user gave, else what the system has free now; `None` where it does not tell.
    #[must_use]
    pub fn of(given: Option<u64>) -> Option<Self> {
        match given {
            Some(bytes) => Some(Self { bytes, source: LimitSource::Given }),
            None => Self::free(Path::new("/")),
        }
    }

    /// Free memory of a Linux system whose files begin at `root`: the least of free memory, of what
    /// the control group allows, and of the addresses left to this process.
    fn free(root: &Path) -> Option<Self> {
        let of = |bytes: Option<u64>, source| bytes.map(|bytes| Self { bytes, source });
        [
            of(kilobytes(&root.join("proc/meminfo"), "MemAvailable:"), LimitSource::Machine),
            of(group_has_free(root), LimitSource::Group),
            of(
                addresses_left(&root.join("proc/self/limits"), &root.join("proc/self/status")),
                LimitSource::Addresses,
            ),
        ]
        .into_iter()
        .flatten()
        .min_by_key(|limit| limit.bytes)
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = Size(self.bytes);
        match self.source {
            LimitSource::Given => write!(f, "--memory-limit allows {size}"),
            LimitSource::Machine => write!(f, "the machine has {size} free"),
            LimitSource::Group => write!(f, "the container has {size} free"),
            LimitSource::Addresses => write!(f, "the shell's limit (ulimit -v) leaves {size}"),
            LimitSource::System => write!(f, "the system gives no more"),
        }
    }
}

/// A line of `/proc`'s tables of kilobytes, in bytes.
fn kilobytes(file: &Path, name: &str) -> Option<u64> {
    number(file, name)?.checked_mul(1024)
}

/// The number after `name` in one of `/proc`'s tables. Asks for no memory: see [`addresses`].
fn number(file: &Path, name: &str) -> Option<u64> {
    let mut bytes = [0; 1 << 13];
    let mut file = fs::File::open(file).ok()?;
    let mut length = 0;
    while let Some(rest) = bytes.get_mut(length..).filter(|rest| !rest.is_empty()) {
        match file.read(rest).ok()? {
            0 => break,
            read => length += read,
        }
    }
    let lines = bytes[..length].split(|&byte| byte == b'\n');
    let line = lines.filter_map(|line| line.strip_prefix(name.as_bytes())).next()?;
    str::from_utf8(line).ok()?.split_whitespace().next()?.parse().ok()
}

/// Memory that the control groups (version 2) of this process leave; files that can be dropped count as free.
fn group_has_free(root: &Path) -> Option<u64> {
    let text = fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    let own = text.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let top = root.join("sys/fs/cgroup");
    let number = |file: PathBuf| fs::read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let free = |folder: &Path| {
        let most = number(folder.join("memory.max"))?;
        let used = number(folder.join("memory.current"))?;
        let stat = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
        let cached = stat.lines().find_map(|line| line.strip_prefix("inactive_file "));
        let cached = cached.and_then(|bytes| bytes.parse().ok()).unwrap_or(0);
        Some(most.saturating_sub(used.saturating_sub(cached)))
    };
    let folder = top.join(own);
    folder.ancestors().take_while(|folder| folder.starts_with(&top)).filter_map(free).min()
}

/// Address space that `ulimit -v` leaves to this process (bytes); `None` without such a limit, or
/// where the system does not tell. Asks for no memory itself, so that it answers where there is none.
#[must_use]
pub fn addresses() -> Option<u64> {
    addresses_left(Path::new("/proc/self/limits"), Path::new("/proc/self/status"))
}

/// Tests whether the system gives so many bytes in one piece now. A library that is about to take
/// them, or a growing list, would end the process otherwise.
#[must_use]
pub fn has_room(bytes: u64) -> bool {
    let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
    // What is small is there before and after whatever is large.
    bytes < SMALL || Vec::<u8>::new().try_reserve_exact(bytes).is_ok()
}

/// Size (bytes) below which memory is not asked for: the library keeps as much as this in hand of its own accord.
const SMALL: usize = 1 << 17;

/// Bytes that JSON of these bytes takes once it is read: a value for each comma, and a table of keys for
/// each object. `{"a":0},` are the most for their length.
#[must_use]
pub fn of_json(json: &[u8]) -> u64 {
    const VALUE: u64 = size_of::<serde_json::Value>() as u64;
    // The leaf of a `BTreeMap`: eleven keys and values, and the way up.
    const OBJECT: u64 = 11 * (size_of::<String>() as u64 + VALUE) + 16;
    let of = |byte: &u8| match byte {
        b',' => VALUE,
        b'{' => OBJECT,
        _ => 0,
    };
    json.par_chunks(1 << 20).map(|part| part.iter().map(of).sum::<u64>()).sum::<u64>()
        + json.len() as u64
}

fn addresses_left(limits: &Path, status: &Path) -> Option<u64> {
    let most = number(limits, "Max address space")?;
    let held = kilobytes(status, "VmSize:").unwrap_or(0);
    Some(most.saturating_sub(held))
}

/// An account of memory under a limit, for many threads.
#[derive(Debug, Default)]
pub struct Budget {
    limit: Option<Limit>,
    taken: AtomicU64,
}

impl Budget {
    /// Under the limit that the user gave, else under what the system has free now.
    #[must_use]
    pub fn new(given: Option<u64>) -> Self {
        Self { limit: Limit::of(given), taken: AtomicU64::new(0) }
    }

    /// True if the limit is the user's: then what is held already counts, too.
    #[must_use]
    pub fn is_given(&self) -> bool {
        self.limit.is_some_and(|limit| limit.source == LimitSource::Given)
    }

    /// Memory left under the limit (bytes).
    #[must_use]
    pub fn left(&self) -> u64 {
        let limit = self.limit.map_or(u64::MAX, |limit| limit.bytes);
        limit.saturating_sub(self.taken.load(Ordering::Relaxed))
    }

    /// Speaks for `bytes` before they are taken.
    ///
    /// # Errors
    ///
    /// When they and all that was spoken for before are over the limit, or the system has not as many now.
    pub fn take(&self, bytes: u64) -> Result<(), TooMuch> {
        let add = |taken: u64| Some(taken.saturating_add(bytes));
        let before = self.taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add);
        let before = before.unwrap_or_else(|taken| taken);
        match self.limit {
            Some(limit) if before.saturating_add(bytes) > limit.bytes => {
                Err(TooMuch { bytes, before, limit })
            }
            _ if has_room(bytes) => Ok(()),
            _ => Err(TooMuch {
                bytes,
                before,
                limit: Limit { bytes: 0, source: LimitSource::System },
            }),
        }
    }
}

/// More memory than there may be. The sentence goes on after what needs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "needs {}{}, and {limit}\nhint: ask for less (fewer pixels, layers, triangles or copies), or give it \
     more memory",
    Size(*bytes),
    beside(*before)
)]
pub struct TooMuch {
    /// Size of the allocation that was refused (bytes).
    pub bytes: u64,
    /// Memory spoken for before (bytes).
    pub before: u64,
    /// The limit.
    pub limit: Limit,
}

fn beside(before: u64) -> String {
    if before == 0 {
        String::new()
    } else {
        format!(" of memory beside {} before it", Size(before))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A system in a folder: 8 GiB free, a container with a limit, addresses with one.
    fn system(group: &str, addresses: &str) -> Option<Limit> {
        let root = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("proc/meminfo", "MemTotal: 9437184 kB\nMemAvailable: 8388608 kB\n");
        write("proc/self/cgroup", "0::/box/inner\n");
        write("sys/fs/cgroup/box/memory.max", group);
        write("sys/fs/cgroup/box/memory.current", "3000");
        write("sys/fs/cgroup/box/memory.stat", "anon 5\ninactive_file 1000\n");
        write("sys/fs/cgroup/box/inner/memory.max", "max");
        let limits =
            format!("Limit  Soft  Hard\nMax address space   {addresses}   unlimited bytes\n");
        write("proc/self/limits", &limits);
        write("proc/self/status", "VmPeak: 9 kB\nVmSize: 2 kB\n");
        Limit::free(root.path())
    }

    #[test]
    fn the_least_of_what_the_system_has_free_counts() {
        let limit = |bytes, source| Some(Limit { bytes, source });
        assert_eq!(system("max", "unlimited"), limit(8 << 30, LimitSource::Machine));
        assert_eq!(system("12000", "unlimited"), limit(10_000, LimitSource::Group));
        assert_eq!(system("12000", "6144"), limit(4096, LimitSource::Addresses));
    }

    #[test]
    fn an_account_is_kept_of_all_that_is_taken() {
        let budget = Budget::new(Some(1 << 20));
        assert!(budget.take(1 << 19).is_ok() && budget.take(1 << 19).is_ok());
        let message = budget.take(1).unwrap_err().to_string();
        assert!(message.contains("needs 1 B of memory beside 1.0 MiB"), "{message}");
        assert!(message.contains("--memory-limit allows 1.0 MiB"), "{message}");
        assert!(Budget::new(Some(1)).take(u64::MAX).is_err());
    }

    /// More than any processor has addresses.
    #[test]
    fn what_the_system_does_not_give_is_refused_without_a_limit() {
        let message = Budget::default().take(1 << 62).unwrap_err().to_string();
        assert!(message.contains("the system gives no more"), "{message}");
        assert!(Budget::default().take(1 << 20).is_ok());
    }

    /// Against what the lists and tables of the values hold.
    #[test]
    fn json_is_spoken_for_before_it_is_read() {
        fn held(value: &serde_json::Value) -> u64 {
            use serde_json::Value;
            let own = size_of::<Value>() as u64;
            own + match value {
                Value::Array(values) => values.iter().map(held).sum(),
                // A leaf holds five keys at least.
                Value::Object(map) => {
                    let pair = size_of::<String>() as u64 + own;
                    5 * pair
                        + map.iter().map(|(key, value)| key.len() as u64 + held(value)).sum::<u64>()
                }
                Value::String(text) => text.len() as u64,
                _ => 0,
            }
        }
        for text in [
            format!("[{}{{}}]", r#"{"a":0},"#.repeat(1000)),
            format!("[{}0]", "0,".repeat(1000)),
            format!("{}{}", "[".repeat(100), "]".repeat(100)),
            format!("\"{}\"", "x".repeat(1000)),
        ] {
            let value: serde_json::Value = serde_json::from_str(&text).unwrap();
            let (held, spoken) = (held(&value), of_json(text.as_bytes()));
            assert!(
                spoken + 100 * size_of::<serde_json::Value>() as u64 >= held,
                "{spoken} for {held}"
            );
        }
    }
}
