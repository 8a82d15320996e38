//! Samples until an error is reached: which parts of the picture want more.
//!
//! The samples of a pixel are of two sets, each a sequence of its own, so that a quarter of the squared difference of
//! their means is the variance of the mean of both, without bias and for any number of samples (F. Rousselle, C. Knaus
//! and M. Zwicker, "Adaptive rendering with non-local means filtering", 2012, section 4.1, on two buffers). One square is
//! a poor witness: those of pixels around that are alike are pooled ([`guide`]), those of all numbers of samples that a
//! pixel had on the way count, and what a block of 8 by 8 pixels is reckoned to have is the mean of that and two of its
//! standard errors. From it follows how many samples the block lacks ([`strip`]), of which a pixel gets as many as the
//! root of its variance asks for: so their sum is least for the mean of their variances.
//!
//! What is found out by the pixels of one colour of a chessboard decides how many samples those of the *other* get.
//! So a pixel's samples have no part in deciding their own number, and its mean is without bias whatever
//! the rule is: the expected value of a mean of N samples is theirs if N does not depend on them, and
//! pixels' samples know nothing of each other. Where the same samples decide and are counted,
//! pixels that happen to be dark and even stop early, and the picture is too dark (Kirk & Arvo, "Unbiased
//! sampling techniques for image synthesis", 1991, who propose to throw the deciding samples away; Pharr,
//! Jakob & Humphreys, "Physically Based Rendering", 4th edition, 2023, section 8.1 on the bias of adaptive
//! sampling). Here nothing is thrown away. What it costs: what is uneven in a single pixel alone is found by
//! its neighbours or not at all. What stopped too early for that is told in the end, by the pixels' own
//! samples ([`early`]).
//!
//! Strips of rows, which the shares of a render have, know nothing of each other.

mod counts;
mod early;
mod guide;
mod rule;
mod sampled;
mod strip;

use std::borrow::Cow;
use std::ops::Range;

use etendue_scene::file::SETS;
use rayon::prelude::*;

pub use counts::SampleCounts;
pub(crate) use guide::ChiefHit;
pub(crate) use rule::Rule;

use crate::film::FilmLayer;
use crate::memory::{NoMemory, filled};
use crate::samples::Averaging;
use crate::shard::SampledStrips;
use crate::tile::TILE;
use guide::{Guide, guides};
use strip::{Demand, Evidence, StripOfPixels};

/// The value of a pixel by which its samples are judged.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct JudgedValue {
    /// Index of its part of what is averaged.
    pub(crate) part: usize,
    /// Index of the first value of a pixel there.
    pub(crate) first: usize,
}

/// Judges the samples of a picture.
pub(crate) struct Adaptive<'a> {
    rule: &'a Rule,
    /// Samples after which a pixel is given up.
    most: u32,
    /// Strips whose samples are judged.
    strips: SampledStrips,
    resolution: [u32; 2],
    /// Samples that each pixel has, in rows from the top, and is to have.
    have: Vec<u32>,
    demands: Vec<Demand>,
    /// Evidence of each pixel, and the features by which it is like others.
    evidence: Vec<Evidence>,
    guides: Vec<Guide>,
    judged: JudgedValue,
    /// The sums of parts whose light lands beside where it starts are of where it landed.
    has_landed: bool,
}

impl<'a> Adaptive<'a> {
    /// Of a picture whose chief rays met this.
    pub(crate) fn new(
        rule: &'a Rule,
        most: u32,
        resolution: [u32; 2],
        strips: SampledStrips,
        judged: JudgedValue,
        hits: &[ChiefHit],
    ) -> Result<Self, NoMemory> {
        let [width, height] = resolution.map(|side| side as usize);
        let mut demands = filled(Demand::default(), width * height)?;
        let (a_strip, next) = (width * TILE as usize, rule.least.min(most));
        // Other strips are another share's.
        let rows = demands.chunks_mut(a_strip.max(1)).enumerate();
        rows.filter(|(k, _)| strips.contains(*k))
            .for_each(|(_, rows)| rows.fill(Demand { next, needs: next }));
        Ok(Self {
            rule,
            most,
            strips,
            resolution,
            have: filled(0, width * height)?,
            demands,
            evidence: filled(Evidence::default(), width * height)?,
            guides: hits.chunks(a_strip).flat_map(|hits| guides(hits, width)).collect(),
            judged,
            has_landed: false,
        })
    }

    /// The samples of a pixel, by its place in rows from the top: from those that it has to those that it is to
    /// have.
    pub(crate) fn wanted(&self, pixel: usize) -> Range<u32> {
        self.have[pixel]..self.demands[pixel].next
    }

    /// True if any pixel wants more.
    pub(crate) fn goes_on(&self) -> bool {
        self.have.iter().zip(&self.demands).any(|(have, demand)| demand.next > *have)
    }

    /// Judges what there is after the samples that were wanted, and says which are wanted next.
    pub(crate) fn judge(&mut self, parts: &[Averaging<'_>]) {
        let (part, first) = (&parts[self.judged.part], self.judged.first);
        let (rule, most, taken, width) = (self.rule, self.most, self.strips, self.resolution[0]);
        let a_strip = (width * TILE) as usize;
        let strips = self.have.par_chunks_mut(a_strip).zip(self.demands.par_chunks_mut(a_strip));
        let strips = strips.zip(self.evidence.par_chunks_mut(a_strip));
        let strips = strips.zip(self.guides.par_chunks(a_strip)).enumerate();
        strips.for_each(|(k, (((have, demands), evidence), guides))| {
            if !taken.contains(k) {
                return;
            }
            #[expect(clippy::cast_possible_truncation, reason = "a row of a picture")]
            let top = k as u32 * TILE;
            let mut changed = vec![false; have.len()];
            for index in 0..have.len() {
                if demands[index].next <= have[index] {
                    continue;
                }
                have[index] = demands[index].next;
                #[expect(clippy::cast_possible_truncation, reason = "a pixel of a strip")]
                let place = [index as u32 % width, top + index as u32 / width];
                let noise = rule.noise(&part.sampled(place, first), have[index] / 2);
                evidence[index].learn(have[index], noise);
                changed[index] = true;
            }
            StripOfPixels { width: width as usize, have, evidence, guides }
                .ask(rule, most, &changed, demands);
        });
    }

    /// Writes to the layers the means of what each pixel has, and to `findings` what sampling found of itself.
    pub(crate) fn show(&self, parts: &mut [Averaging<'_>], findings: &mut [&mut FilmLayer]) {
        for part in &mut *parts {
            let in_sums = self.in_sums_of(part);
            part.show_counted(&in_sums);
        }
        if !findings.is_empty() {
            let part = &parts[self.judged.part];
            part.tell(findings, &self.have, &self.in_sums_of(part), self.judged.first);
        }
    }

    /// Number of values in the sums of each pixel.
    fn in_sums_of(&self, part: &Averaging<'_>) -> Cow<'_, [u32]> {
        match self.has_landed && part.what.shared_rows().is_some() {
            true => Cow::Owned(vec![SETS; self.have.len()]),
            false => Cow::Borrowed(&self.have),
        }
    }

    /// Takes what pixels tell of themselves from the light that landed on them, which varies by how much of it did.
    pub(crate) fn judge_landed(&mut self, parts: &[Averaging<'_>]) {
        self.has_landed = true;
        let (part, first) = (&parts[self.judged.part], self.judged.first);
        if part.what.shared_rows().is_none() {
            return;
        }
        let (rule, width, shard) = (self.rule, self.resolution[0], self.strips.shard);
        for (index, evidence) in (0_u32..).zip(&mut self.evidence) {
            let pixel = [index % width, index / width];
            if shard.owns((pixel[1] / TILE) as usize) {
                evidence.tell(rule.noise(&part.sampled(pixel, first), 1));
            }
        }
    }

    /// Samples that each pixel has, in rows from the top.
    pub(crate) fn have(&self) -> &[u32] {
        &self.have
    }

    /// Samples of all pixels.
    pub(crate) fn taken(&self) -> u64 {
        self.have.iter().copied().map(u64::from).sum()
    }

    /// The rays that are still to come, by what pixels lack, for each part that is averaged.
    pub(crate) fn to_come(&self) -> u64 {
        let lacks = |(demand, have): (&Demand, &u32)| {
            u64::from(demand.needs.min(self.most).max(demand.next).saturating_sub(*have))
        };
        self.demands.iter().zip(&self.have).map(lacks).sum()
    }

    /// Counts of the samples that the pixels got.
    pub(crate) fn counts(&self) -> Option<SampleCounts> {
        let width = self.resolution[0] as usize;
        let a_strip = width * TILE as usize;
        let of_strip = |k: usize| {
            let rows = k * a_strip..self.have.len().min((k + 1) * a_strip);
            let strip = StripOfPixels {
                width,
                have: &self.have[rows.clone()],
                evidence: &self.evidence[rows.clone()],
                guides: &self.guides[rows.clone()],
            };
            #[expect(clippy::cast_possible_truncation, reason = "a row of a picture")]
            let top = k as u32 * TILE;
            strip.counts(self.rule, top, self.most, &self.demands[rows])
        };
        let strips = 0..self.have.len().div_ceil(a_strip.max(1));
        strips.filter(|k| self.strips.shard.owns(*k)).filter_map(of_strip).reduce(SampleCounts::and)
    }
}
