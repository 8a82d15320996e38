//! Samples until an error is reached: which parts of the picture want more.
//!
//! The samples of a pixel are points of one sequence, which are evenest when they are a power of two. Then
//! the picture is judged: the means of the pixel's first half and of its second tell the variance of the
//! whole ([`convergence`]). A block of 8 by 8 pixels is judged twice: by the pixels of one colour of a
//! chessboard, and by those of the other. What is judged by one half of the pixels decides how many samples
//! the *other* half gets: none, half as many again, or as many again.
//!
//! So a pixel's samples have no part in deciding their own number, and its mean is without bias whatever
//! the rule is: the expected value of a mean of N samples is theirs if N does not depend on them, and
//! pixels' samples know nothing of each other. Where the same samples decide and are counted,
//! pixels that happen to be dark and even stop early, and the picture is too dark (Kirk & Arvo, "Unbiased
//! sampling techniques for image synthesis", 1991, who propose to throw the deciding samples away; Pharr,
//! Jakob & Humphreys, "Physically Based Rendering", 4th edition, 2023, section 8.1 on the bias of adaptive
//! sampling). Here nothing is thrown away. What it costs: what is uneven in a single pixel alone is found by
//! its neighbours or not at all.
//!
//! A block goes on as long as it has not passed, or one of the blocks beside, above and below it has more
//! than twice the error that is allowed: so what is hard is found from the blocks around it, too, and
//! numbers of samples change gradually, without a seam. Blocks belong to strips of rows, as the shares of a
//! render do, and look no further.

mod convergence;
mod halves;
mod rule;

use rayon::prelude::*;

use rule::by_chance;
pub(crate) use rule::{Rule, variance_of_mean};

use crate::film::FilmLayer;
use crate::samples::Averaging;
use crate::shard::Shard;
use crate::tiles::TILE;
use halves::{HALVES, half_of};

/// Side of a block (pixels).
const BLOCK: u32 = 8;

/// The share of pixels that may be so without a word.
const FEW: f64 = 0.01;

/// Rows of blocks in a strip of rows.
const ROWS_OF_STRIP: usize = (TILE / BLOCK) as usize;

/// What is known of a block.
#[derive(Debug, Clone, Copy)]
struct SampleBlock {
    /// Samples with which the block's other half found that a half will do; 0 before.
    passed: [u32; HALVES],
    /// Samples of each pixel of a half, when they are settled, which may be before it has them; 0 before.
    settled: [u32; HALVES],
    /// The error that is found in each half, as a share of what is allowed.
    error: [f64; HALVES],
    /// What the two sets of its pixels' samples would tell if they were independent, likewise, and what they
    /// told when there were half as many.
    apart: [f64; HALVES],
    apart_before: [f64; HALVES],
    /// How fast the variance falls.
    slope: [f64; HALVES],
}

impl Default for SampleBlock {
    fn default() -> Self {
        Self {
            passed: [0; HALVES],
            settled: [0; HALVES],
            error: [0.0; HALVES],
            apart: [0.0; HALVES],
            apart_before: [0.0; HALVES],
            slope: [1.0; HALVES],
        }
    }
}

impl SampleBlock {
    /// Whether a half is to have more than `samples` samples.
    fn wants(&self, half: usize, samples: u32) -> bool {
        self.settled[half] == 0 || self.settled[half] > samples
    }

    /// Samples of each pixel of a half, `samples` being what it has while it goes on.
    fn samples(&self, half: usize, samples: u32) -> u32 {
        match self.settled[half] {
            0 => samples,
            settled => settled.min(samples),
        }
    }

    /// Whether the number of each half is decided, or soon will be, as its error is `wait` at most.
    fn is_near(&self, wait: f64) -> [bool; HALVES] {
        let [a, b] = self.error;
        // The first half is judged by the second, and the second by the first.
        [self.passed[0] > 0 || b <= wait, self.passed[1] > 0 || a <= wait]
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

    /// Whether a pixel is to have more than `samples` samples.
    pub(crate) fn wants(&self, pixel: [u32; 2], samples: u32) -> bool {
        self.of(pixel).wants(half_of(pixel), samples)
    }

    /// How fast the variance of a pixel's mean falls.
    fn slope(&self, pixel: [u32; 2]) -> f64 {
        self.of(pixel).slope[half_of(pixel)]
    }

    /// The blocks beside, above and below one, in its strip of rows.
    fn around(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (across, count) = (self.across, self.blocks.len());
        let strip = ROWS_OF_STRIP * across;
        let column = index % across;
        let around = [
            (column > 0).then(|| index - 1),
            (column + 1 < across).then_some(index + 1),
            index.checked_sub(across),
            Some(index + across),
        ];
        let around = around.into_iter().flatten();
        around.filter(move |other| *other < count && other / strip == index / strip)
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
    /// Pixels of blocks that were done by what others found, and by their own samples have more variance than was
    /// allowed: more than what is allowed shows by chance once in a thousand blocks.
    #[serde(default)]
    pub over: u64,
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
            over: self.over + other.over,
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

    /// What a user should know of pixels that were given up, or stopped too early.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let ([column, row], error) = self.worst?;
        let part = |pixels: u64| pixels as f64 / self.pixels.max(1) as f64;
        let many = part(self.over) > FEW;
        let what = match (self.given_up, many) {
            (0, false) => return None,
            (0, true) => None,
            (given_up, _) => Some(format!(
                "{:.2} % of the pixels still have more error than `render.samples` allows after {} samples",
                100.0 * part(given_up),
                self.most
            )),
        };
        let over = many.then(|| {
            format!(
                "{:.2} % of the pixels stopped with more variance than `render.samples` allows, by their own \
                 samples (of what is allowed, chance shows 0.1 % so), of which those beside them saw too little",
                100.0 * part(self.over)
            )
        });
        let what: Vec<String> = what.into_iter().chain(over).collect();
        let remedy = if self.given_up > 0 { "`max`" } else { "`min`" };
        Some(format!(
            "samples: {}; the worst are around column {column}, row {row}, with {error:.1} times the \
             variance; give {remedy} a larger number, or see what shines so unevenly there",
            what.join("; ")
        ))
    }
}

/// Judges the samples of a picture.
pub(crate) struct Adaptive<'a> {
    rule: &'a Rule,
    /// Samples that each pixel gets, and after which it is given up.
    limits: [u32; 2],
    shard: Shard,
    pub(crate) blocks: SampleBlocks,
    /// Which part of what is averaged is judged, and its first value of a pixel.
    judged: (usize, usize),
}

impl<'a> Adaptive<'a> {
    pub(crate) fn new(
        rule: &'a Rule,
        limits: [u32; 2],
        resolution: [u32; 2],
        shard: Shard,
        judged: (usize, usize),
    ) -> Self {
        Self { rule, limits, shard, blocks: SampleBlocks::new(resolution), judged }
    }

    /// Whether it is time to judge after so many samples: when both sets have as many, and at the end.
    pub(crate) fn judges_at(&self, samples: u32) -> bool {
        samples.is_power_of_two() || samples >= self.limits[1]
    }

    /// Judges what there is after `samples` samples of each pixel that wanted them, and settles what is
    /// done.
    pub(crate) fn judge(&mut self, samples: u32, parts: &[Averaging<'_>]) {
        self.measure(samples, &parts[self.judged.0]);
        self.estimate(samples);
        if samples >= self.limits[0] {
            self.decide(samples);
        }
    }

    /// Writes to the layers `told` what sampling found of itself.
    pub(crate) fn tell(&self, samples: u32, parts: &[Averaging<'_>], told: &mut [&mut FilmLayer]) {
        parts[self.judged.0].tell(told, &self.blocks, (samples, self.judged.1));
    }

    /// Whether any pixel wants more than `samples`.
    pub(crate) fn goes_on(&self, samples: u32) -> bool {
        let blocks = &self.blocks.blocks;
        self.owned().any(|index| (0..HALVES).any(|half| blocks[index].wants(half, samples)))
    }

    /// The blocks of this share.
    fn owned(&self) -> impl Iterator<Item = usize> + '_ {
        let strip = ROWS_OF_STRIP * self.blocks.across;
        (0..self.blocks.blocks.len()).filter(move |index| self.shard.owns(index / strip))
    }

    /// Measures how far the sets are apart in the blocks that go on.
    fn measure(&mut self, samples: u32, part: &Averaging<'_>) {
        let pixels = self.blocks.clone();
        let (shard, rule, first) = (self.shard, self.rule, self.judged.1);
        let strip = ROWS_OF_STRIP * pixels.across;
        self.blocks.blocks.par_iter_mut().enumerate().for_each(|(index, block)| {
            if !shard.owns(index / strip) {
                return;
            }
            let apart = [0, 1].map(|half| {
                let pixels = pixels.pixels(index).filter(|pixel| half_of(*pixel) == half);
                let goes_on = block.settled[half] == 0;
                goes_on.then(|| {
                    let sampled = pixels.map(|pixel| part.sampled(pixel, first));
                    rule.error(sampled, samples)
                })
            });
            // A single pixel has no other half.
            let either = apart.iter().copied().flatten().flatten().next().unwrap_or(0.0);
            for (half, apart) in apart.into_iter().enumerate() {
                if let Some(apart) = apart {
                    block.apart_before[half] = block.apart[half];
                    block.apart[half] = apart.unwrap_or(either);
                }
            }
        });
    }

    /// Tells the errors of the blocks by how far their sets are apart, and how fast that falls in them and
    /// the blocks around them.
    fn estimate(&mut self, samples: u32) {
        let before = self.blocks.clone();
        for (index, block) in self.blocks.blocks.iter_mut().enumerate() {
            for half in 0..HALVES {
                if block.settled[half] > 0 {
                    // What is settled stands for what it would be with as many samples as the others have.
                    block.error[half] *= 0.5;
                    continue;
                }
                let around = before.around(index).chain([index]).map(|at| &before.blocks[at]);
                let goes_on = around.filter(|block| block.settled[half] == 0);
                let (last, now) = goes_on.fold((0.0, 0.0), |(last, now), block| {
                    (last + block.apart_before[half], now + block.apart[half])
                });
                let slope = if samples.is_power_of_two() {
                    convergence::slope(last, now)
                } else {
                    block.slope[half]
                };
                let share = convergence::share_of_independent(samples, slope);
                (block.slope[half], block.error[half]) = (slope, share * block.apart[half]);
            }
        }
    }

    /// Settles the halves of blocks that have passed with those beside them, and those that have had the
    /// most.
    fn decide(&mut self, samples: u32) {
        let [_, most] = self.limits;
        let Rule { wait, half_step, .. } = *self.rule;
        let strip = ROWS_OF_STRIP * self.blocks.across;
        let later = samples.saturating_add(samples / 2);
        // How many samples do, by the other half of the block.
        for block in &mut self.blocks.blocks {
            for half in 0..HALVES {
                let error = block.error[HALVES - 1 - half];
                let will_do = error <= half_step && samples.is_power_of_two() && later <= most;
                if block.passed[half] == 0 && (error <= 1.0 || will_do) {
                    block.passed[half] = if error <= 1.0 { samples } else { later };
                }
            }
        }
        let near: Vec<[bool; HALVES]> =
            self.blocks.blocks.iter().map(|block| block.is_near(wait)).collect();
        for index in 0..near.len() {
            if !self.shard.owns(index / strip) {
                continue;
            }
            for half in 0..HALVES {
                let is_near = self.blocks.around(index).all(|other| near[other][half]);
                let SampleBlock { passed, settled, .. } = &mut self.blocks.blocks[index];
                if settled[half] > 0 {
                    continue;
                }
                if passed[half] > 0 && is_near {
                    settled[half] = passed[half].max(samples);
                } else if samples >= most {
                    settled[half] = samples;
                }
            }
        }
    }

    /// The rays that are still to come after `samples` samples, by what blocks lack, for each part that
    /// is averaged.
    pub(crate) fn to_come(&self, samples: u32) -> u64 {
        let [_, most] = self.limits;
        let more = |(index, half): (usize, usize)| {
            let block = &self.blocks.blocks[index];
            // A variance falls at least as one over the number of samples.
            let error = block.error[0].max(block.error[1]).clamp(1.0, 1e6);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a forecast"
            )]
            let wanted = (f64::from(samples) * error).min(f64::from(most)) as u32;
            let wanted = match block.settled[half] {
                0 => wanted.max(samples + samples / 2).min(most),
                settled => settled,
            };
            let pixels = u64::from(BLOCK * BLOCK) / HALVES as u64;
            u64::from(wanted.saturating_sub(samples)) * pixels
        };
        self.owned().flat_map(|index| [(index, 0), (index, 1)]).map(more).sum()
    }

    /// The error of half a block by its own samples alone, which had no part in deciding how many they are.
    fn own_error(&self, (index, half): (usize, usize), number: u32, part: &Averaging<'_>) -> f64 {
        let pixels = self.blocks.pixels(index).filter(|pixel| half_of(*pixel) == half);
        let sampled = pixels.map(|pixel| part.sampled(pixel, self.judged.1));
        let slope = self.blocks.blocks[index].slope[half];
        let share = convergence::share_of_independent(number, slope);
        share * self.rule.error(sampled, number).unwrap_or(0.0)
    }

    /// How many samples the pixels got.
    pub(crate) fn counts(&self, samples: u32, parts: &[Averaging<'_>]) -> Option<SampleCounts> {
        let part = &parts[self.judged.0];
        let of_half = |(index, half): (usize, usize)| {
            let block = &self.blocks.blocks[index];
            let pixels = self.blocks.pixels(index).filter(|pixel| half_of(*pixel) == half);
            let pixels: Vec<[u32; 2]> = pixels.collect();
            let middle = *pixels.get(pixels.len() / 2)?;
            let (count, number) = (pixels.len() as u64, block.samples(half, samples));
            let gave_up = block.passed[half] == 0 && block.settled[half] > 0;
            // Of what goes on nobody knows yet.
            let is_done = !gave_up && (1..=samples).contains(&block.settled[half]);
            let own = if is_done { self.own_error((index, half), number, part) } else { 0.0 };
            let is_over = own > by_chance(pixels.len());
            Some(SampleCounts {
                least: number,
                most: number,
                pixels: count,
                total: count * u64::from(number),
                given_up: if gave_up { count } else { 0 },
                over: if is_over { count } else { 0 },
                worst: match (gave_up, is_over) {
                    (true, _) => Some((middle, block.error[0].max(block.error[1]))),
                    (false, true) => Some((middle, own)),
                    (false, false) => None,
                },
            })
        };
        self.owned()
            .flat_map(|index| [(index, 0), (index, 1)])
            .filter_map(of_half)
            .reduce(SampleCounts::and)
    }
}
