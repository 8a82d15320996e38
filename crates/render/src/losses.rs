//! Losses of a file: how much of what a camera sees it clips or shows black, counted and told by
//! one rule, whatever the file.

use std::fmt;

/// Clipping is told above this share of what is there: hits, or a sensor's pixels.
pub const CLIPPED: f64 = 0.1;

/// Black is told from this share of what is there.
pub const BLACK: f64 = 0.3;

/// Number of things that a file loses, of those that are there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Losses {
    /// Those that it loses.
    pub lost: u64,
    /// All of them.
    pub of: u64,
}

impl Losses {
    /// Counts one for each item, and a loss for each `true`.
    pub fn count(items: impl IntoIterator<Item = bool>) -> Self {
        let mut counted = Self::default();
        for is_lost in items {
            counted.of += 1;
            counted.lost += u64::from(is_lost);
        }
        counted
    }

    /// The share that is lost, 0 to 1; 0 when there is nothing to lose.
    #[must_use]
    pub fn share(self) -> f64 {
        self.lost as f64 / self.of.max(1) as f64
    }

    /// True if so many are clipped that the user is told.
    #[must_use]
    pub fn is_clipped(self) -> bool {
        self.share() > CLIPPED
    }

    /// True if so many are black that the user is told.
    #[must_use]
    pub fn is_black(self) -> bool {
        self.of > 0 && self.share() >= BLACK
    }
}

/// The share, never rounded to all or to nothing of it.
impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.share();
        match (self.lost, percent) {
            (lost, _) if lost == self.of => write!(f, "100 %"),
            (_, 99.95..) => write!(f, "over 99.9 %"),
            (_, 10.0..) => write!(f, "{percent:.1} %"),
            _ => write!(f, "{percent:.2} %"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_told_above_its_threshold_and_never_rounded_to_all() {
        let of = |lost: u64, of: u64| Losses { lost, of };
        assert_eq!(Losses::count([true, false, true]), of(2, 3));
        for (losses, clipped, black, words) in [
            (of(0, 0), false, false, "100 %"),
            (of(100, 1000), false, false, "10.0 %"),
            (of(101, 1000), true, false, "10.1 %"),
            (of(299, 1000), true, false, "29.9 %"),
            (of(300, 1000), true, true, "30.0 %"),
            (of(998, 1000), true, true, "99.8 %"),
            (of(99_999, 100_000), true, true, "over 99.9 %"),
            (of(7, 7), true, true, "100 %"),
        ] {
            let found = (losses.is_clipped(), losses.is_black(), losses.to_string());
            assert_eq!(found, (clipped, black, words.to_owned()), "{losses:?}");
        }
    }
}
