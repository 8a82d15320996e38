//! The pixels of a strip of rows: what they tell of each other, and how many samples they are to get.

use super::counts::SampleCounts;
use super::early::{self, OwnVariance};
use super::guide::{Guide, likeness};
use super::rule::{Rule, Told};

/// Side of a block (pixels).
const BLOCK: usize = 8;

/// Pixels to each side that are asked how large the variance is.
const REACH: usize = 5;

/// The colours of the chessboard.
const HALVES: usize = 2;

/// The share of a block's mean variance that each of its pixels is reckoned to have in any case: what none of those
/// around it happened to tell.
const OF_BLOCK: f64 = 0.1;

/// The most samples that a pixel may have after a round, as a multiple of what it has.
const GROWTH: u32 = 2;

/// The fewest that it gets when it gets any, as a share of what it has.
const STEP: u32 = 8;

/// Steps in which the number of samples is sought.
const BISECTIONS: usize = 24;

/// What is known of a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Evidence {
    /// The sum of the variances of one sample that it told after each round, and of their weights: the squares of its
    /// numbers of samples.
    told: f64,
    weight: f64,
    /// What its samples tell now, of the mean of all.
    variance: f64,
    light: f64,
}

impl Evidence {
    /// Learns what its `samples` samples tell.
    pub(super) fn learn(&mut self, samples: u32, told: Told) {
        let count = f64::from(samples);
        self.told += count * count * (count * told.variance);
        self.weight += count * count;
        (self.variance, self.light) = (told.variance, told.light);
    }

    /// The variance of one sample.
    fn of_one(&self) -> f64 {
        if self.weight > 0.0 { self.told / self.weight } else { 0.0 }
    }
}

/// Samples that a pixel is to have next, and is reckoned to need in the end, whatever the most are.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Demand {
    pub(super) next: u32,
    pub(super) needs: u32,
}

/// A strip of rows.
pub(super) struct StripOfPixels<'a> {
    pub(super) width: usize,
    pub(super) have: &'a [u32],
    pub(super) evidence: &'a [Evidence],
    pub(super) guides: &'a [Guide],
}

/// What the pixels around tell of one half of a block.
struct HalfOfBlock {
    /// Its pixels, and the variance of one sample of each.
    pixels: Vec<usize>,
    of_one: Vec<f64>,
    /// The standard error of the mean of these, as a share of it.
    error: f64,
    /// The light of the other half.
    light: f64,
}

impl StripOfPixels<'_> {
    fn height(&self) -> usize {
        self.have.len() / self.width.max(1)
    }

    /// Blocks in a row, and rows of them.
    fn blocks(&self) -> [usize; 2] {
        [self.width, self.height()].map(|side| side.div_ceil(BLOCK))
    }

    /// The pixels of a block.
    fn pixels(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height());
        let rows = row * BLOCK..height.min((row + 1) * BLOCK);
        let columns = column * BLOCK..width.min((column + 1) * BLOCK);
        rows.flat_map(move |y| columns.clone().map(move |x| y * width + x))
    }

    /// The colour of a pixel on the chessboard.
    fn half_of(&self, index: usize) -> usize {
        (index % self.width + index / self.width) % HALVES
    }

    /// The pixels of the other colour around one.
    fn around(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height());
        let (x, y) = (index % width, index / width);
        let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
        let (left, right) = (x.saturating_sub(REACH), (x + REACH + 1).min(width));
        rows.flat_map(move |row| {
            let first = left + (left + row + x + y + 1) % HALVES;
            (first..right).step_by(HALVES).map(move |column| row * width + column)
        })
    }

    /// Says in `demands` how many samples the pixels are to have, where anything around them `changed`.
    pub(super) fn ask(&self, rule: &Rule, most: u32, changed: &[bool], demands: &mut [Demand]) {
        let [across, down] = self.blocks();
        let has_changed: Vec<bool> = (0..across * down)
            .map(|block| self.pixels([block % across, block / across]).any(|index| changed[index]))
            .collect();
        for block in 0..across * down {
            let place @ [column, _] = [block % across, block / across];
            let beside = column.saturating_sub(1)..(column + 2).min(across);
            let is_new = |row: usize| beside.clone().any(|x| has_changed[row * across + x]);
            if (0..down).any(is_new) {
                for half in 0..HALVES {
                    self.ask_half(rule, most, &self.half(place, half), demands);
                }
            }
        }
    }

    /// What the pixels of the other colour tell of those of one in a block.
    fn half(&self, place: [usize; 2], half: usize) -> HalfOfBlock {
        let pixels: Vec<usize> =
            self.pixels(place).filter(|&index| self.half_of(index) == half).collect();
        let (mut weights, mut spans) = (Vec::new(), Vec::new());
        let mut of_one = Vec::with_capacity(pixels.len());
        let (mut light, mut lit) = (0.0, 0.0);
        for &index in &pixels {
            let start = weights.len();
            let (mut sum, mut total) = (0.0, 0.0);
            for other in self.around(index) {
                let evidence = &self.evidence[other];
                if evidence.weight > 0.0 {
                    let weight =
                        f64::from(likeness(&self.guides[index], &self.guides[other])) + 1e-6;
                    sum += weight * evidence.of_one();
                    light += weight * evidence.light;
                    total += weight;
                    weights.push((other, weight));
                }
            }
            lit += total;
            of_one.push(if total > 0.0 { sum / total } else { 0.0 });
            spans.push((start..weights.len(), total));
        }
        let mean = of_one.iter().sum::<f64>() / of_one.len().max(1) as f64;
        for own in &mut of_one {
            *own = (1.0 - OF_BLOCK) * *own + OF_BLOCK * mean;
        }
        // By how much each of those asked bears on the whole, where pixels get samples by the root of their variance.
        let mut bears: Vec<(usize, f64)> = Vec::new();
        for ((span, total), own) in spans.into_iter().zip(&of_one) {
            let scale = 1.0 / (total * own.sqrt()).max(f64::MIN_POSITIVE);
            bears.extend(weights[span].iter().map(|&(other, weight)| (other, weight * scale)));
        }
        bears.sort_unstable_by_key(|&(other, _)| other);
        let (mut sum, mut squares) = (0.0, 0.0);
        for same in bears.chunk_by(|a, b| a.0 == b.0) {
            let told = self.evidence[same[0].0].of_one();
            let part = told * same.iter().map(|&(_, weight)| weight).sum::<f64>();
            sum += part;
            squares += part * part;
        }
        // The square of a normal number has two thirds of its mean square as variance.
        let error = if sum > 0.0 { (2.0 / 3.0 * squares).sqrt() / sum } else { 0.0 };
        HalfOfBlock { pixels, of_one, error, light: if lit > 0.0 { light / lit } else { 0.0 } }
    }

    /// Says how many samples the pixels of half a block are to have: the fewest with which the mean of their
    /// variances, and as many of its standard errors as the rule says, is what is allowed.
    fn ask_half(&self, rule: &Rule, most: u32, half: &HalfOfBlock, demands: &mut [Demand]) {
        let count = half.pixels.len() as f64;
        let allowed = count * rule.allowed(half.light) / (1.0 + rule.sigmas * half.error);
        let of_one = || half.of_one.iter().zip(&half.pixels);
        let number = |scale: f64, own: f64, have: u32| (scale * own.sqrt()).max(f64::from(have));
        let with = |scale: f64| -> f64 {
            of_one().map(|(&own, &index)| own / number(scale, own, self.have[index])).sum()
        };
        // With this scale it is what is allowed where no pixel has more by now, and less where one has.
        let roots: f64 = half.of_one.iter().map(|own| own.sqrt()).sum();
        let mut scales = [0.0, roots / allowed.max(f64::MIN_POSITIVE)];
        if with(0.0) <= allowed {
            scales[1] = 0.0;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (scales[0] + scales[1]);
            scales[usize::from(with(middle) <= allowed)] = middle;
        }
        for (&own, &index) in of_one() {
            let have = self.have[index];
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturated")]
            let needs = number(scales[1], own, have).ceil() as u32;
            let next = match needs > have {
                true => {
                    let few = have + (have / STEP).max(2);
                    let many = have.saturating_mul(GROWTH);
                    needs.clamp(few, many.max(few)).next_multiple_of(2).min(most.max(have))
                }
                false => have,
            };
            demands[index] = Demand { next, needs };
        }
    }

    /// How many samples the pixels got, in a strip whose first row is `top`, of at most `most`; `None` of none.
    pub(super) fn counts(
        &self,
        rule: &Rule,
        (top, most): (u32, u32),
        demands: &[Demand],
    ) -> Option<SampleCounts> {
        let [across, down] = self.blocks();
        let blocks = (0..across * down).map(|block| {
            let pixels = self.pixels([block % across, block / across]);
            self.counted(rule, most, demands, pixels.collect())
        });
        let blocks: Vec<CountedBlock> = blocks.collect();
        let judged: Vec<Option<OwnVariance>> = blocks.iter().map(|block| block.judged).collect();
        let judged = early::judge(&judged, across);
        let early = |(block, judged): (&CountedBlock, &early::Judgement)| {
            judged.probability * block.done as f64
        };
        let over: f64 = blocks.iter().zip(&judged).map(early).sum();
        let counted = (0..blocks.len()).filter_map(|index| {
            let (block, judged) = (&blocks[index], &judged[index]);
            let variance = match block.counts?.given_up > 0 {
                true => Some(block.own),
                false => (judged.probability > 0.1).then_some(judged.variance),
            };
            #[expect(clippy::cast_possible_truncation, reason = "a pixel of a picture")]
            let [x, y] = [index % across * BLOCK, index / across * BLOCK].map(|at| at as u32 + 4);
            #[expect(clippy::cast_possible_truncation, reason = "a pixel of a picture")]
            let [last_x, last_y] = [self.width, self.height()].map(|side| side as u32 - 1);
            let middle = [x.min(last_x), top + y.min(last_y)];
            Some(SampleCounts { worst: variance.map(|v| (middle, v)), ..block.counts? })
        });
        let counts = counted.reduce(SampleCounts::and)?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
        let over = over.round() as u64;
        Some(SampleCounts { over, ..counts })
    }

    /// What became of the pixels of a block.
    fn counted(
        &self,
        rule: &Rule,
        most: u32,
        demands: &[Demand],
        pixels: Vec<usize>,
    ) -> CountedBlock {
        let count = pixels.len();
        let light = pixels.iter().map(|&index| self.evidence[index].light).sum::<f64>();
        let allowed = rule.allowed(light / count.max(1) as f64);
        let share = |&index: &usize| match self.evidence[index].variance {
            variance if variance > 0.0 => variance / allowed.max(f64::MIN_POSITIVE),
            _ => 0.0,
        };
        let shares: Vec<f64> = pixels.iter().map(share).collect();
        let gave_up = |index: usize| self.have[index] >= most && demands[index].needs > most;
        let is_done = pixels.iter().all(|&index| demands[index].next <= self.have[index]);
        let of_pixel = |(&index, &share): (&usize, &f64)| SampleCounts {
            given_up: u64::from(gave_up(index)),
            ..SampleCounts::of_pixel(self.have[index], share)
        };
        // Of what goes on nobody knows yet, and what was given up is told by itself.
        let done: Vec<(f64, u32)> = (pixels.iter().zip(&shares))
            .filter(|(index, _)| !gave_up(**index))
            .map(|(&index, &share)| (share, self.have[index]))
            .collect();
        CountedBlock {
            done: done.len(),
            own: shares.iter().sum::<f64>() / count.max(1) as f64,
            judged: (is_done && !done.is_empty()).then(|| OwnVariance::of(&done)),
            counts: pixels.iter().zip(&shares).map(of_pixel).reduce(SampleCounts::and),
        }
    }
}

/// What became of the pixels of a block.
struct CountedBlock {
    /// Those that were not given up.
    done: usize,
    /// The mean of their variances, by their own samples, as a share of what is allowed.
    own: f64,
    judged: Option<OwnVariance>,
    counts: Option<SampleCounts>,
}
