//! Shares of a render: it is divided over machines, and its picture is the same to the bit.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use etendue_files::Transaction;
use etendue_optics::element::StatusCounts;
use etendue_scene::Scene;
use serde::{Deserialize, Serialize};

use crate::Plan;
use crate::adaptive::SampleCounts;
use crate::error::RenderError;
use crate::film::{FilmLayer, filled};
use crate::film_file::{FilmError, FilmFile, Identity, Writing};
use crate::output::OutputError;
use crate::passes::Passed;
use crate::render::{Film, empty_film};
use crate::samples::{Averaging, Sum};
use crate::tiles::{RayCounts, TILE};

/// What of a render is dealt out to its shares.
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
    index: u32,
    count: u32,
    #[serde(default)]
    by: ShardBy,
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

    /// The same share of what `by` says.
    #[must_use]
    pub fn by(self, by: ShardBy) -> Self {
        Self { by, ..self }
    }

    /// Whether samples are dealt out, and not rows.
    #[must_use]
    pub fn is_of_samples(self) -> bool {
        self.by == ShardBy::Samples
    }

    /// Whether it has the layers that are not sampled.
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
        self.is_of_samples() || strip % self.count as usize == self.index as usize
    }

    /// How many of `height` rows are.
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
    /// Writes it to a file: which render it is of, and how that was asked for, goes with it.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write(
        &self,
        to: (&Transaction, &Path),
        identity: &Identity,
        origin: &serde_json::Value,
    ) -> Result<(), OutputError> {
        let (shard, sums) = (self.shard, &self.sums);
        let is_written = |layer: &&FilmLayer| match shard.is_of_samples() {
            true => shard.has_data() && self.centres.contains(&layer.spec),
            false => true,
        };
        let layers: Vec<&FilmLayer> = self.layers.iter().filter(is_written).collect();
        let writing = Writing {
            identity,
            origin,
            shard,
            samples: self.passed.samples,
            sample_counts: self.passed.counts,
            counts: &self.counts,
            trace_time: self.trace_time,
            resolution: self.resolution,
        };
        writing.write(to, &layers, &sums.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    /// Puts the shares of a render's rows together.
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
        // Each fills its own pixels, or adds its own samples.
        for share in shares {
            share.fill(&mut layers.iter_mut().collect::<Vec<_>>(), &mut [], resolution)?;
            RayCounts::add(&counts, share.counts(), &StatusCounts::default());
        }
        let counts = counts.into_inner().unwrap_or_else(PoisonError::into_inner);
        // Samples by pixel, where the shares counted them.
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
            sums: Vec::new(),
            centres: Vec::new(),
            trace_time: shares.iter().map(FilmFile::trace_time).sum(),
            notes: Vec::new(),
            camera: None,
        })
    }
}

/// Puts the shares of a render's samples together, in the order of the samples, whatever that of the files
/// is: sums with what rounding took from them, and layers that are not sampled from the first share.
pub(crate) fn put_together(
    shares: &[FilmFile],
    resolution: [u32; 2],
    centres: &mut [&mut FilmLayer],
    averaged: &mut [Averaging<'_>],
) -> Result<RayCounts, FilmError> {
    let counts = Mutex::new(RayCounts::default());
    let mut shares: Vec<&FilmFile> = shares.iter().collect();
    shares.sort_by_key(|share| share.header.shard);
    for share in shares {
        let lengths = averaged.iter().map(|part| part.sums().len());
        let mut own = lengths
            .map(|length| filled(Sum::default(), length))
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| share.error(error.to_string()))?;
        let mut sums: Vec<&mut [Sum]> = own.iter_mut().map(Vec::as_mut_slice).collect();
        let has_data = share.header.shard.has_data();
        share.fill(if has_data { &mut *centres } else { &mut [] }, &mut sums, resolution)?;
        for (part, own) in averaged.iter_mut().zip(&own) {
            part.sums_mut().iter_mut().zip(own).for_each(|(sum, own)| sum.add_sum(*own));
        }
        RayCounts::add(&counts, share.counts(), &StatusCounts::default());
    }
    Ok(counts.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// Refuses shares that are not one of each of one render, by name.
pub(crate) fn must_be_whole(shares: &[FilmFile], identity: &Identity) -> Result<(), String> {
    let Some(first) = shares.first() else {
        return Err("there is no share to put together".to_owned());
    };
    let Shard { count, by, .. } = first.header.shard;
    let mut found: BTreeMap<Shard, &FilmFile> = BTreeMap::new();
    // Each is of the same render and the same division, and none is there twice.
    for share in shares {
        share.must_be_of(identity).map_err(|error| error.to_string())?;
        let shard = share.header.shard;
        let (path, other) = (share.path.display(), first.path.display());
        if shard.count != count {
            return Err(format!("{path}: is share {shard}, and {other} is one of {count}"));
        }
        if shard.by != by {
            let of = |by| if by == ShardBy::Rows { "rows" } else { "samples" };
            let (this, that) = (of(shard.by), of(by));
            return Err(format!(
                "{path}: is a share of the {this}, and {other} is one of the {that}"
            ));
        }
        if let Some(twice) = found.insert(shard, share) {
            let other = twice.path.display();
            return Err(format!("{path}: is share {shard}, as {other} is; give each once"));
        }
    }
    // None is missing.
    let missing = (0..count).map(|index| Shard { index, count, by });
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
