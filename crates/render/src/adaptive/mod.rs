//! Samples until an error is reached: which parts of the picture want more.
//!
//! The samples of a pixel are of two independent sets, in turn; the difference of their means tells the
//! variance of the pixel's. After each pass a block of 8 by 8 pixels is judged twice: by the pixels of one
//! colour of a chessboard, and by those of the other. What is judged by one half of the pixels decides
//! how many samples the *other* half gets.
//!
//! So a pixel's samples have no part in deciding their own number, and its mean is without bias whatever
//! the rule is: the expected value of a mean of N independent samples is theirs if N does not depend on
//! them, and pixels' samples know nothing of each other. Where the same samples decide and are counted,
//! pixels that happen to be dark and even stop early, and the picture is too dark (Kirk & Arvo, "Unbiased
//! sampling techniques for image synthesis", 1991, who propose to throw the deciding samples away; Pharr,
//! Jakob & Humphreys, "Physically Based Rendering", 4th edition, 2023, section 8.1 on the bias of adaptive
//! sampling). Here nothing is thrown away. What it costs: two sets of Sobol points fill a pixel less
//! evenly than one, and what is uneven in a single pixel alone is found by its neighbours or not at all.
//!
//! A block goes on as long as it has not passed, or one of the blocks beside, above and below it has more
//! than twice the error that is allowed: so what is hard is found from the blocks around it, too, and
//! numbers of samples change gradually, without a seam. Blocks belong to strips of rows, as the shares of a
//! render do, and look no further.

mod halves;
mod rule;

use rayon::prelude::*;

pub(crate) use rule::{Rule, variance_of_mean};

use crate::film::FilmLayer;
use crate::samples::Averaging;
use crate::shard::Shard;
use crate::tiles::TILE;
use halves::{HALVES, half_of};

/// Side of a block (pixels).
const BLOCK: u32 = 8;

/// The error of blocks around that a block does not wait for, as a share of what is allowed: they will
/// get about so many times its samples.
const NEAR: f64 = 2.0;

/// Rows of blocks in a strip of rows.
const ROWS_OF_STRIP: usize = (TILE / BLOCK) as usize;

/// What is known of a block.
#[derive(Debug, Clone, Copy, Default)]
struct SampleBlock {
    /// Samples after which the number of a half was decided by the block's other half; 0 before.
    passed: [u32; HALVES],
    /// Samples of each pixel of a half, when they are settled; 0 before.
    settled: [u32; HALVES],
    /// The error that is found in each half, as a share of what is allowed.
    error: [f64; HALVES],
}

impl SampleBlock {
    fn wants_more(&self) -> bool {
        self.settled.contains(&0)
    }

    /// Samples of each pixel of a half, `samples` being what it has while it goes on.
    fn samples(&self, half: usize, samples: u32) -> u32 {
        match self.settled[half] {
            0 => samples,
            settled => settled,
        }
    }

    /// Whether the number of each half is decided, or soon will be.
    fn is_near(&self) -> [bool; HALVES] {
        let [a, b] = self.error;
        // The first half is judged by the second, and the second by the first.
        [self.passed[0] > 0 || b <= NEAR, self.passed[1] > 0 || a <= NEAR]
    }
}

/// The blocks of a picture, in rows from the top.
#[derive(Debug, Clone)]
pub(crate) struct SampleBlocks {
    resolution: [u32; 2],
    across: usize,
    blocks: Vec<SampleBlock>,
}

impl SampleBlocks {
    fn new(resolution: [u32; 2]) -> Self {
        let [across, down] = resolution.map(|side| side.div_ceil(BLOCK) as usize);
        Self { resolution, across, blocks: vec![SampleBlock::default(); across * down] }
    }

    /// The block of a pixel.
    fn of(&self, pixel: [u32; 2]) -> &SampleBlock {
        &self.blocks[self.index(pixel)]
    }

    /// The number of the block of a pixel.
    fn index(&self, [x, y]: [u32; 2]) -> usize {
        (y / BLOCK) as usize * self.across + (x / BLOCK) as usize
    }

    /// Whether a pixel is to have more samples.
    pub(crate) fn wants(&self, pixel: [u32; 2]) -> bool {
        self.of(pixel).settled[half_of(pixel)] == 0
    }

    /// Samples of a pixel, `samples` being what it has while it goes on.
    fn samples(&self, pixel: [u32; 2], samples: u32) -> u32 {
        self.of(pixel).samples(half_of(pixel), samples)
    }

    /// The pixels of a block.
    fn pixels(&self, index: usize) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [width, height] = self.resolution;
        #[expect(clippy::cast_possible_truncation, reason = "a picture's sides have 16 bits")]
        let (left, top) =
            ((index % self.across) as u32 * BLOCK, (index / self.across) as u32 * BLOCK);
        let rows = top..height.min(top + BLOCK);
        rows.flat_map(move |y| (left..width.min(left + BLOCK)).map(move |x| [x, y]))
    }
}

/// How many samples the pixels of a picture got.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SampleCounts {
    /// The fewest.
    pub least: u32,
    /// The most.
    pub most: u32,
    /// Pixels.
    pub pixels: u64,
    /// Samples of all of them together.
    pub total: u64,
    /// Pixels that were given up at the most samples.
    pub given_up: u64,
    /// The middle of the worst block of these (column and row, from 0), and its error as a share of what
    /// was allowed (of variances).
    pub worst: Option<([u32; 2], f64)>,
}

impl SampleCounts {
    /// Of two parts of a picture.
    pub(crate) fn and(self, other: Self) -> Self {
        let worst = [self.worst, other.worst].into_iter().flatten();
        // The first of equals in the order of rows, so that shares give what the whole does.
        let worst = worst.reduce(|a, b| {
            let place = |worst: ([u32; 2], f64)| (worst.0[1], worst.0[0]);
            let first = if place(a) <= place(b) { [a, b] } else { [b, a] };
            if first[1].1 > first[0].1 { first[1] } else { first[0] }
        });
        Self {
            least: self.least.min(other.least),
            most: self.most.max(other.most),
            pixels: self.pixels + other.pixels,
            total: self.total + other.total,
            given_up: self.given_up + other.given_up,
            worst,
        }
    }

    /// Samples of a pixel in the mean.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.total as f64 / self.pixels.max(1) as f64
    }

    /// In words.
    #[must_use]
    pub fn words(&self) -> String {
        format!("{} to {}, {:.1} in the mean", self.least, self.most, self.mean())
    }

    /// What a user should know of pixels that were given up.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let ([column, row], error) = self.worst?;
        let share = 100.0 * self.given_up as f64 / self.pixels.max(1) as f64;
        Some(format!(
            "samples: {share:.2} % of the pixels still have more error than `render.samples` allows after \
             {} samples; the worst are around column {column}, row {row}, with {error:.1} times the \
             variance; give `max` a larger number, or see what shines so unevenly there",
            self.most
        ))
    }
}

/// Judges the samples of a picture.
pub(crate) struct Adaptive<'a> {
    rule: &'a Rule,
    /// Samples after which a pixel is given up.
    most: u32,
    shard: Shard,
    pub(crate) blocks: SampleBlocks,
    /// Which part of what is averaged is judged, and its first value of a pixel.
    judged: (usize, usize),
}

impl<'a> Adaptive<'a> {
    pub(crate) fn new(
        (rule, most): (&'a Rule, u32),
        resolution: [u32; 2],
        shard: Shard,
        judged: (usize, usize),
    ) -> Self {
        Self { rule, most, shard, blocks: SampleBlocks::new(resolution), judged }
    }

    /// Judges what there is after `samples` samples of each pixel that wanted them, and settles what is
    /// done.
    pub(crate) fn judge(&mut self, samples: u32, parts: &[Averaging<'_>]) {
        self.measure(samples, &parts[self.judged.0]);
        self.decide(samples);
    }

    /// Writes to the layers `told` what sampling found of itself.
    pub(crate) fn tell(&self, samples: u32, parts: &[Averaging<'_>], told: &mut [&mut FilmLayer]) {
        parts[self.judged.0].tell(told, &self.blocks, (samples, self.judged.1));
    }

    /// Whether any pixel wants more.
    pub(crate) fn goes_on(&self) -> bool {
        self.owned().any(|index| self.blocks.blocks[index].wants_more())
    }

    /// The blocks of this share.
    fn owned(&self) -> impl Iterator<Item = usize> + '_ {
        let strip = ROWS_OF_STRIP * self.blocks.across;
        (0..self.blocks.blocks.len()).filter(move |index| self.shard.owns(index / strip))
    }

    /// Measures the errors of the blocks that go on, and marks halves whose number they decide.
    fn measure(&mut self, samples: u32, part: &Averaging<'_>) {
        let pixels = self.blocks.clone();
        let (shard, rule, first) = (self.shard, self.rule, self.judged.1);
        let strip = ROWS_OF_STRIP * pixels.across;
        self.blocks.blocks.par_iter_mut().enumerate().for_each(|(index, block)| {
            if !block.wants_more() || !shard.owns(index / strip) {
                return;
            }
            let found = [0, 1].map(|half| {
                let pixels = pixels.pixels(index).filter(|pixel| half_of(*pixel) == half);
                let has = block.samples(half, samples);
                let sampled = pixels.map(|pixel| part.sampled(pixel, first));
                // What is settled stands for what it would be with as many samples as the others have.
                rule.error(sampled, has).map(|error| error * f64::from(has) / f64::from(samples))
            });
            // A single pixel has no other half.
            let either = found[0].or(found[1]).unwrap_or(0.0);
            block.error = found.map(|error| error.unwrap_or(either));
            for half in 0..HALVES {
                if block.passed[half] == 0 && block.error[HALVES - 1 - half] <= 1.0 {
                    block.passed[half] = samples;
                }
            }
        });
    }

    /// Settles the halves of blocks that have passed with those beside them, and those that have had the
    /// most.
    fn decide(&mut self, samples: u32) {
        let Self { blocks: SampleBlocks { across, blocks, .. }, most, shard, .. } = self;
        let (across, strip) = (*across, ROWS_OF_STRIP * *across);
        let near: Vec<[bool; HALVES]> = blocks.iter().map(SampleBlock::is_near).collect();
        for (index, block) in blocks.iter_mut().enumerate() {
            if !shard.owns(index / strip) {
                continue;
            }
            let column = index % across;
            let around = [
                (column > 0).then(|| index - 1),
                (column + 1 < across).then_some(index + 1),
                index.checked_sub(across),
                Some(index + across),
            ];
            let around = around.into_iter().flatten();
            let around: Vec<usize> = around
                .filter(|other| *other < near.len() && other / strip == index / strip)
                .collect();
            let SampleBlock { passed, settled, .. } = block;
            for (half, (settled, passed)) in settled.iter_mut().zip(passed).enumerate() {
                let has_passed = *passed > 0 && around.iter().all(|&other| near[other][half]);
                if *settled == 0 && (has_passed || samples >= *most) {
                    *settled = samples;
                }
            }
        }
    }

    /// The rays that are still to come after `samples` samples, by what blocks lack, for each part that
    /// is averaged.
    pub(crate) fn to_come(&self, samples: u32) -> u64 {
        let more = |index: usize| {
            let block = &self.blocks.blocks[index];
            let going_on = block.settled.iter().filter(|settled| **settled == 0).count();
            let error = block.error[0].max(block.error[1]);
            // A variance falls at least as one over the number of samples.
            let wanted = (f64::from(samples) * error.clamp(1.0, 1e6)).min(f64::from(self.most));
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a forecast"
            )]
            let wanted = (wanted as u32).max(samples) - samples;
            let pixels = going_on as u64 * u64::from(BLOCK * BLOCK) / HALVES as u64;
            u64::from(wanted.max(samples / 4)) * pixels
        };
        self.owned().map(more).sum()
    }

    /// How many samples the pixels got.
    pub(crate) fn counts(&self, samples: u32) -> Option<SampleCounts> {
        let of_half = |(index, half): (usize, usize)| {
            let block = &self.blocks.blocks[index];
            let pixels = self.blocks.pixels(index).filter(|pixel| half_of(*pixel) == half);
            let pixels: Vec<[u32; 2]> = pixels.collect();
            let middle = *pixels.get(pixels.len() / 2)?;
            let (count, number) = (pixels.len() as u64, block.samples(half, samples));
            let gave_up = block.passed[half] == 0 && block.settled[half] > 0;
            Some(SampleCounts {
                least: number,
                most: number,
                pixels: count,
                total: count * u64::from(number),
                given_up: if gave_up { count } else { 0 },
                worst: gave_up.then(|| (middle, block.error[0].max(block.error[1]))),
            })
        };
        self.owned()
            .flat_map(|index| [(index, 0), (index, 1)])
            .filter_map(of_half)
            .reduce(SampleCounts::and)
    }
}
