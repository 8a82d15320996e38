//! Shares of a render: it is divided over machines, and its picture is the same to the bit.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::tile::TILE;

/// Parts of a render that are dealt out to its shares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShardBy {
    /// Strips of rows, in turn, so that every share has some of each part of the picture.
    #[default]
    Rows,
    /// A range of the samples of every pixel; the first share has the layers that are not sampled.
    Samples,
}

/// A share of a render.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Shard {
    pub(crate) index: u32,
    pub(crate) count: u32,
    #[serde(default)]
    pub(crate) by: ShardBy,
}

impl Shard {
    /// The whole.
    pub const ALL: Self = Self { index: 0, count: 1, by: ShardBy::Rows };

    /// Share `number` of `count` of the rows, counted from 1; `None` when there is no such share.
    #[must_use]
    pub fn new(number: u32, count: u32) -> Option<Self> {
        let by = ShardBy::Rows;
        (1..=count).contains(&number).then(|| Self { index: number - 1, count, by })
    }

    /// About `wanted` strips of a picture of `height` rows, from all over it.
    #[must_use]
    pub fn sample(height: u32, wanted: u32) -> Self {
        let every = (height.div_ceil(TILE) / wanted.max(1)).max(1);
        Self { index: every / 2, count: every, by: ShardBy::Rows }
    }

    /// No row of a picture of `height`: what is left to do is what is done once.
    #[must_use]
    pub fn nothing(height: u32) -> Self {
        let strips = height.div_ceil(TILE);
        Self { index: strips, count: strips + 1, by: ShardBy::Rows }
    }

    /// Returns the share with what it divides replaced by `by`.
    #[must_use]
    pub fn by(self, by: ShardBy) -> Self {
        Self { by, ..self }
    }

    /// True if samples are dealt out rather than rows.
    #[must_use]
    pub fn is_of_samples(self) -> bool {
        self.by == ShardBy::Samples
    }

    /// True if the share has the layers that are not sampled.
    pub(crate) fn has_data(self) -> bool {
        !self.is_of_samples() || self.index == 0
    }

    /// Its part of the `samples` of each pixel.
    pub(crate) fn samples(self, samples: u32) -> Range<u32> {
        if !self.is_of_samples() {
            return 0..samples;
        }
        let [all, count] = [samples, self.count].map(u64::from);
        let [start, end] = [self.index, self.index + 1].map(|k| all * u64::from(k) / count);
        #[expect(clippy::cast_possible_truncation, reason = "at most as many as there are")]
        let range = start as u32..end as u32;
        range
    }

    /// True if there is such a share: one that was read from a file may be none.
    pub(crate) fn is_sound(self) -> bool {
        self.index < self.count
    }

    /// Number of shares.
    #[must_use]
    pub fn count(self) -> u32 {
        self.count
    }

    /// True if a strip of rows is of this share.
    pub(crate) fn owns(self, strip: usize) -> bool {
        self.is_of_samples() || strip % self.count as usize == self.index as usize
    }

    /// Number of rows, of `height`, that belong to the share.
    #[must_use]
    pub fn rows(self, height: u32) -> u32 {
        let strips = 0..height.div_ceil(TILE);
        strips
            .filter(|&strip| self.owns(strip as usize))
            .map(|strip| TILE.min(height - strip * TILE))
            .sum()
    }

    /// The parts of `values` that are of this share, `row` values a row of the picture.
    pub(crate) fn parts(self, len: usize, row: usize) -> impl Iterator<Item = Range<usize>> {
        let strip = (row * TILE as usize).max(1);
        let all = (0..len.div_ceil(strip)).filter(move |&k| self.owns(k));
        all.map(move |k| k * strip..len.min((k + 1) * strip))
    }
}

/// Strips whose samples a share takes: its own, and those from which light lands on them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SampledStrips {
    pub(crate) shard: Shard,
    /// Greatest number of rows from where light starts to where it lands.
    pub(crate) rows: u32,
    /// Rows of the picture.
    pub(crate) height: u32,
}

impl SampledStrips {
    /// True if a strip is one of them.
    pub(crate) fn contains(self, strip: usize) -> bool {
        let (rows, a_strip) = (self.rows as usize, TILE as usize);
        let first = (strip * a_strip).saturating_sub(rows);
        let last = ((strip + 1) * a_strip - 1 + rows).min(self.height.max(1) as usize - 1);
        (first / a_strip..=last / a_strip).any(|strip| self.shard.owns(strip))
    }

    /// True if light of a row, which may be one beside the picture, lands on rows of the share.
    pub(crate) fn land_from(self, row: i32) -> bool {
        let (rows, last) = (i64::from(self.rows), i64::from(self.height.max(1)) - 1);
        let strip = |row: i64| usize::try_from(row.clamp(0, last) / i64::from(TILE));
        let ends = [i64::from(row) - rows, i64::from(row) + rows].map(strip);
        let [Ok(first), Ok(end)] = ends else { return false };
        (first..=end).any(|strip| self.shard.owns(strip))
    }

    /// Share of the rows whose samples are taken, those beside the picture included, of which there are as many as this
    /// `margin` above and below.
    pub(crate) fn share_of_rows(self, margin: f64) -> f64 {
        let height = self.height.cast_signed();
        let taken = (0..height).filter(|&row| self.land_from(row)).count() as f64;
        let sides = [-1, height].into_iter().filter(|&row| self.land_from(row)).count() as f64;
        (taken + margin * sides) / (f64::from(self.height) + 2.0 * margin)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(number, count)| {
            Some((number.trim().parse().ok()?, count.trim().parse().ok()?))
        });
        numbers.and_then(|(number, count)| Self::new(number, count)).ok_or_else(|| {
            format!("\"{text}\" is no share\nhint: write NUMBER/COUNT, from 1/8 to 8/8 for eight of them")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light of a share's third strip comes from those beside it, where it lands as many rows away; a picture's end is no
    /// strip of another share.
    #[test]
    fn a_share_takes_the_strips_from_which_light_lands_on_its_own() {
        let shard = Shard { index: 2, count: 5, by: ShardBy::Rows };
        let height = 5 * TILE - 3;
        let taken = |rows| {
            let strips = SampledStrips { shard, rows, height };
            (0..5).filter(|strip| strips.contains(*strip)).collect::<Vec<_>>()
        };
        assert_eq!((taken(0), taken(1)), (vec![2], vec![1, 2, 3]));
        assert_eq!((taken(TILE), taken(TILE + 1)), (vec![1, 2, 3], vec![0, 1, 2, 3, 4]));
    }

    /// Of 80 rows the share has 16 to 31. With three rows on each side it takes 22, of which none is beside the picture;
    /// the first share takes 19 of its side, and those above, not those below.
    #[test]
    fn rows_from_which_light_lands_are_counted_beside_the_picture_too() {
        let of = |index, row| {
            let shard = Shard { index, count: 5, by: ShardBy::Rows };
            SampledStrips { shard, rows: 3, height: 5 * TILE }.land_from(row)
        };
        assert_eq!(
            (-10..100).filter(|&row| of(1, row)).collect::<Vec<_>>(),
            (13..35).collect::<Vec<_>>()
        );
        assert!(of(0, -2) && !of(0, 81) && of(4, 81) && !of(4, -2));
        let share = |index, margin| {
            let shard = Shard { index, count: 5, by: ShardBy::Rows };
            SampledStrips { shard, rows: 3, height: 5 * TILE }.share_of_rows(margin)
        };
        assert_eq!((share(1, 2.0), share(0, 2.0)), (22.0 / 84.0, 21.0 / 84.0));
    }

    #[test]
    fn shares_are_counted_from_one_and_written_so() {
        let shard: Shard = "3/8".parse().unwrap();
        assert_eq!((shard.to_string(), shard.count()), ("3/8".to_owned(), 8));
        for wrong in ["0/8", "9/8", "1/0", "8", "-1/8", "a/b", ""] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains("from 1/8 to 8/8"), "{wrong}");
        }
    }

    #[test]
    fn shares_have_all_samples_once() {
        for (samples, count) in [(1, 3), (7, 3), (64, 8), (5, 5), (u32::MAX, 7)] {
            let mut next = 0;
            for number in 1..=count {
                let shard = Shard::new(number, count).unwrap().by(ShardBy::Samples);
                let range = shard.samples(samples);
                assert_eq!(range.start, next, "{number}/{count} of {samples}");
                assert!((range.end - range.start).abs_diff(samples / count) <= 1);
                assert_eq!((shard.rows(100), shard.owns(7)), (100, true));
                next = range.end;
            }
            assert_eq!(next, samples);
        }
    }

    #[test]
    fn shares_have_all_rows_once() {
        for height in [1, 15, 16, 17, 100, 480] {
            for count in [1, 2, 3, 8, 100] {
                let shards = (1..=count).filter_map(|number| Shard::new(number, count));
                assert_eq!(shards.clone().map(|shard| shard.rows(height)).sum::<u32>(), height);
                let len = 7 * height as usize;
                let mut seen = vec![0; len];
                for part in shards.flat_map(|shard| shard.parts(len, 7)) {
                    seen[part].iter_mut().for_each(|count| *count += 1);
                }
                assert!(seen.iter().all(|&count| count == 1), "{height} rows, {count} shares");
            }
        }
    }
}
