//! Shares of a render: it is divided over machines, and its picture is the same to the bit.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use etendue_optics::element::FateCounts;
use etendue_scene::Scene;
use serde::{Deserialize, Serialize};

use crate::Plan;
use crate::adaptive::SampleCounts;
use crate::film_file::{FilmFile, Identity, Writing};
use crate::output::OutputError;
use crate::passes::Passed;
use crate::render::{Film, RenderError, empty_film};
use crate::tiles::{RayCounts, TILE};

/// A share of a render. Its rows are dealt out in strips, in turn, so that every share has some of each
/// part of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// The whole.
    pub const ALL: Self = Self { index: 0, count: 1 };

    /// Share `number` of `count`, counted from 1; `None` when there is no such share.
    #[must_use]
    pub fn new(number: u32, count: u32) -> Option<Self> {
        (1..=count).contains(&number).then(|| Self { index: number - 1, count })
    }

    /// Whether there is such a share: one that was read from a file may be none.
    pub(crate) fn is_sound(self) -> bool {
        self.index < self.count
    }

    /// How many shares there are.
    #[must_use]
    pub fn count(self) -> u32 {
        self.count
    }

    /// Whether a strip of rows is of this share.
    pub(crate) fn owns(self, strip: usize) -> bool {
        strip % self.count as usize == self.index as usize
    }

    /// How many of `height` rows are.
    pub(crate) fn rows(self, height: u32) -> u32 {
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
            format!("\"{text}\" is no share; write NUMBER/COUNT, from 1/8 to 8/8 for eight of them")
        })
    }
}

impl Film {
    /// Writes it to `path`: which render it is of, and how that was asked for, goes with it.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write(
        &self,
        path: &Path,
        identity: &Identity,
        origin: &serde_json::Value,
    ) -> Result<(), OutputError> {
        let writing = Writing {
            identity,
            origin,
            shard: self.shard,
            samples: self.passed.samples,
            sample_counts: self.passed.counts,
            counts: &self.counts,
            trace_time: self.trace_time,
            resolution: self.resolution,
        };
        writing.write(path, &self.layers.iter().collect::<Vec<_>>(), &[])
    }

    /// Puts the shares of a render together.
    ///
    /// # Errors
    ///
    /// When one is of another render, is there twice, or is missing.
    pub fn merged(
        scene: &Scene,
        plan: &Plan,
        shares: &[FilmFile],
        identity: &Identity,
    ) -> Result<Self, RenderError> {
        let resolution = scene.camera.resolution();
        let mut layers = empty_film(scene, plan)?;
        must_be_whole(shares, identity).map_err(RenderError::Shares)?;
        let counts = Mutex::new(RayCounts::default());
        for share in shares {
            share.fill(&mut layers.iter_mut().collect::<Vec<_>>(), &mut [], resolution)?;
            RayCounts::add(&counts, share.counts(), &FateCounts::default());
        }
        let counts = counts.into_inner().unwrap_or_else(PoisonError::into_inner);
        let of_pixels = shares.iter().filter_map(|share| share.header.sample_counts);
        let of_pixels = of_pixels.reduce(SampleCounts::and);
        let samples = of_pixels.map_or(plan.samples, |counts| counts.least);
        let passed = Passed { samples, is_complete: true, counts: of_pixels };
        Ok(Self {
            layers,
            resolution,
            shard: Shard::ALL,
            counts,
            passed,
            trace_time: shares.iter().map(FilmFile::trace_time).sum(),
            notes: Vec::new(),
            camera: None,
        })
    }
}

/// Refuses shares that are not one of each of one render, by name.
fn must_be_whole(shares: &[FilmFile], identity: &Identity) -> Result<(), String> {
    let Some(first) = shares.first() else {
        return Err("there is no share to put together".to_owned());
    };
    let count = first.header.shard.count;
    let mut found: BTreeMap<Shard, &FilmFile> = BTreeMap::new();
    for share in shares {
        share.must_be_of(identity).map_err(|error| error.to_string())?;
        let shard = share.header.shard;
        if shard.count != count {
            let (path, other) = (share.path.display(), first.path.display());
            return Err(format!("{path}: is share {shard}, and {other} is one of {count}"));
        }
        if let Some(twice) = found.insert(shard, share) {
            let (path, other) = (share.path.display(), twice.path.display());
            return Err(format!("{path}: is share {shard}, as {other} is; give each once"));
        }
    }
    let missing = (0..count).map(|index| Shard { index, count });
    let missing: Vec<String> = missing
        .filter(|shard| !found.contains_key(shard))
        .map(|shard| shard.to_string())
        .take(8)
        .collect();
    match missing.as_slice() {
        [] => Ok(()),
        missing => {
            let have = found.len();
            let left = count as usize - have - missing.len();
            let more = if left > 0 { format!(" and {left} more") } else { String::new() };
            let lack = missing.join(", ") + &more;
            Err(format!("{have} of {count} shares are here; missing: {lack}; render them first"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_counted_from_one_and_written_so() {
        let shard: Shard = "3/8".parse().unwrap();
        assert_eq!((shard.to_string(), shard.count()), ("3/8".to_owned(), 8));
        for wrong in ["0/8", "9/8", "1/0", "8", "-1/8", "a/b", ""] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains("from 1/8 to 8/8"), "{wrong}");
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
