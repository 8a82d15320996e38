#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | `table` | cells in columns |
//! | `decision` | what is decided, how, why, what it saves, and by which key it is decided otherwise |
//! | `refusal` | where, why not, and what would do |
//! | [`Size`], [`Span`] | bytes and times with the digits that a forecast has |

mod decision;
mod refusal;
mod table;

use std::fmt;

pub use decision::{Decision, DecisionKind, DecisionValue, Saving, Tabled};
pub use refusal::Refusal;
pub use table::{Cell, Table};

/// Bytes as people read them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size(
    /// Bytes.
    pub u64,
);

impl fmt::Display for Size {
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut value = self.0 as f64;
        let mut unit = "B";
        for next in ["KiB", "MiB", "GiB", "TiB"] {
            if value < 1024.0 {
                break;
            }
            value /= 1024.0;
            unit = next;
        }
        if unit == "B" { write!(f, "{value} B") } else { write!(f, "{value:.1} {unit}") }
    }
}

/// A time with two or three digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span(
    /// Seconds.
    pub f64,
);

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            time if time >= 5400.0 => write!(f, "{:.1} h", time / 3600.0),
            time if time >= 90.0 => write!(f, "{:.0} min", time / 60.0),
            time if time >= 10.0 => write!(f, "{time:.0} s"),
            time if time >= 0.1 => write!(f, "{time:.1} s"),
            time => write!(f, "{:.0} ms", 1e3 * time),
        }
    }
}

/// Words with commas between.
pub fn listed(words: impl IntoIterator<Item: fmt::Display>) -> String {
    let words: Vec<String> = words.into_iter().map(|word| word.to_string()).collect();
    words.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_few_digits() {
        let sizes = [0, 1023, 1024, 195_559_424, 3 << 40].map(|bytes| Size(bytes).to_string());
        assert_eq!(sizes, ["0 B", "1023 B", "1.0 KiB", "186.5 MiB", "3.0 TiB"]);
        let spans = [0.0421, 2.68, 31.4, 600.0, 9000.0].map(|seconds| Span(seconds).to_string());
        assert_eq!(spans, ["42 ms", "2.7 s", "31 s", "10 min", "2.5 h"]);
        assert_eq!(listed([Size(1), Size(2)]), "1 B, 2 B");
    }
}
