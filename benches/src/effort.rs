//! The effort of every measurement: the sizes of meshes, and the number of rounds.

use clap::Args;

/// Arguments that the programs share.
#[derive(Debug, Clone, Copy, Args)]
pub struct Effort {
    /// Meshes a tenth as heavy, and shorter turns
    #[arg(long)]
    quick: bool,
    /// Times that everything is timed
    #[arg(long, default_value = "5", value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
}

impl Effort {
    /// Number of times that everything is timed.
    #[must_use]
    pub fn rounds(self) -> usize {
        self.rounds.into()
    }

    /// The one for full measurements, or that for quick ones.
    #[must_use]
    pub fn pick<T>(self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// Triangles of the two smooth meshes.
    #[must_use]
    pub fn blobs(self) -> [u64; 2] {
        self.pick([1_000_000, 10_000_000], [100_000, 1_000_000])
    }

    /// Triangles of the soup.
    #[must_use]
    pub fn soup(self) -> u32 {
        self.pick(1_000_000, 100_000)
    }
}

/// 1000000 is "1M", 100000 "100k".
#[must_use]
pub fn in_short(count: u64) -> String {
    match count {
        1_000_000.. => format!("{}M", count / 1_000_000),
        1_000.. => format!("{}k", count / 1_000),
        _ => count.to_string(),
    }
}
