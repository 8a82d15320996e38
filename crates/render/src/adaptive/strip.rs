//! The pixels of a strip of rows: what they tell of each other, and how many samples they are to get.

use super::counts::SampleCounts;
use super::early::{self, OwnVariance, PixelVariance};
use super::guide::{Guide, likeness};
use super::rule::{PixelNoise, Rule};

/// Side of a block (pixels).
const BLOCK: usize = 8;

/// Pixels to each side that are asked how large the variance is.
const REACH: usize = 5;

/// Weight that a pixel that is unlike all others gives each of them.
const LEAST: f32 = 1e-6;

/// The colours of the chessboard.
const HALVES: usize = 2;

/// The fewest that it gets when it gets any, as a share of what it has.
const STEP: u32 = 8;

/// Steps in which the number of samples is sought.
const BISECTIONS: usize = 24;

/// Evidence of a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Evidence {
    /// The sum of the variances of one sample that it told after each round, and of their weights: the squares of its
    /// numbers of samples.
    sum: f64,
    weight: f64,
    /// Variance of the mean of all its samples that they tell now.
    variance: f64,
    light: f64,
}

impl Evidence {
    /// Learns what its `samples` samples tell.
    pub(super) fn learn(&mut self, samples: u32, noise: PixelNoise) {
        let count = f64::from(samples);
        self.sum += count * count * (count * noise.variance);
        self.weight += count * count;
        self.tell(noise);
    }

    /// Takes what all of its samples tell now.
    pub(super) fn tell(&mut self, noise: PixelNoise) {
        (self.variance, self.light) = (noise.variance, noise.light);
    }

    /// The variance of one sample.
    fn of_one(&self) -> f64 {
        if self.weight > 0.0 { self.sum / self.weight } else { 0.0 }
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

/// The pixels that those of a block ask.
#[derive(Debug, Clone, Copy)]
struct PixelWindow {
    /// Columns of the strip, and the first and the one behind the last of columns and rows.
    width: usize,
    columns: [usize; 2],
    rows: [usize; 2],
}

impl PixelWindow {
    /// Around a block of a strip of so many columns and rows.
    fn around(block: [usize; 2], size: [usize; 2]) -> Self {
        let [columns, rows] = [0, 1].map(|axis| {
            let first = block[axis] * BLOCK;
            [first.saturating_sub(REACH), (first + BLOCK + REACH).min(size[axis])]
        });
        Self { width: size[0], columns, rows }
    }

    fn len(&self) -> usize {
        (self.columns[1] - self.columns[0]) * (self.rows[1] - self.rows[0])
    }

    /// The pixels of it, in rows.
    fn pixels(self) -> impl Iterator<Item = usize> {
        let rows = self.rows[0]..self.rows[1];
        rows.flat_map(move |y| (self.columns[0]..self.columns[1]).map(move |x| y * self.width + x))
    }

    /// The pixels of the other colour around one of the block, and their numbers in the window.
    fn others(self, index: usize) -> impl Iterator<Item = (usize, usize)> {
        let (x, y) = (index % self.width, index / self.width);
        let reach = |at: usize, [first, end]: [usize; 2]| {
            [at.saturating_sub(REACH).max(first), (at + REACH + 1).min(end)]
        };
        let ([left, right], [top, bottom]) = (reach(x, self.columns), reach(y, self.rows));
        let across = self.columns[1] - self.columns[0];
        (top..bottom).flat_map(move |row| {
            let first = left + (left + row + x + y + 1) % HALVES;
            let (of_strip, of_window) = (row * self.width, (row - self.rows[0]) * across);
            (first..right)
                .step_by(HALVES)
                .map(move |column| (of_strip + column, of_window + column - self.columns[0]))
        })
    }
}

/// Estimates of one half of a block by the pixels around.
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

    /// Says in `demands` how many samples the pixels are to have, where anything around them `changed`.
    pub(super) fn ask(&self, rule: &Rule, most: u32, changed: &[bool], demands: &mut [Demand]) {
        let [across, down] = self.blocks();
        let has_changed: Vec<bool> = (0..across * down)
            .map(|block| self.pixels([block % across, block / across]).any(|index| changed[index]))
            .collect();
        let variances: Vec<f64> = self.evidence.iter().map(Evidence::of_one).collect();
        for block in 0..across * down {
            let place @ [column, _] = [block % across, block / across];
            let columns = column.saturating_sub(1)..(column + 2).min(across);
            let is_new = |row: usize| columns.clone().any(|x| has_changed[row * across + x]);
            if (0..down).any(is_new) {
                for half in 0..HALVES {
                    let half = self.half(rule.floor, place, half, &variances);
                    self.ask_half(rule, most, &half, demands);
                }
            }
        }
    }

    /// Estimates of the pixels of one colour in a block, by those of the other: `variances` is that
    /// of one sample of each, of which each has a share of the mean, `floor`, in any case.
    fn half(&self, floor: f64, place: [usize; 2], half: usize, variances: &[f64]) -> HalfOfBlock {
        let pixels: Vec<usize> =
            self.pixels(place).filter(|&index| self.half_of(index) == half).collect();
        let window = PixelWindow::around(place, [self.width, self.height()]);
        let mut of_one = Vec::with_capacity(pixels.len());
        // How much each of those asked bears on each pixel.
        let mut weights: Vec<(usize, f64)> = Vec::new();
        let mut parts = Vec::with_capacity(pixels.len());
        let (mut light, mut lit) = (0.0, 0.0);
        for &index in &pixels {
            let start = weights.len();
            let (mut sum, mut total) = (0.0, 0.0);
            for (other, at) in window.others(index) {
                let weight = f64::from(likeness(&self.guides[index], &self.guides[other]) + LEAST);
                sum += weight * variances[other];
                light += weight * self.evidence[other].light;
                total += weight;
                weights.push((at, weight));
            }
            lit += total;
            of_one.push(if total > 0.0 { sum / total } else { 0.0 });
            parts.push((start..weights.len(), total));
        }
        let mean = of_one.iter().sum::<f64>() / of_one.len().max(1) as f64;
        for own in &mut of_one {
            *own = (1.0 - floor) * *own + floor * mean;
        }
        // And on the whole, where pixels get samples by the root of their variance.
        let mut bears = vec![0.0; window.len()];
        for ((part, total), own) in parts.into_iter().zip(&of_one) {
            let scale = 1.0 / (total * own.sqrt()).max(f64::MIN_POSITIVE);
            weights[part].iter().for_each(|&(at, weight)| bears[at] += weight * scale);
        }
        let (mut sum, mut squares) = (0.0, 0.0);
        for (index, bears) in window.pixels().zip(bears) {
            let part = variances[index] * bears;
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
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "saturated"
            )]
            let needs = number(scales[1], own, have).ceil() as u32;
            let next = match needs > have {
                true => {
                    let few = have + (have / STEP).max(2);
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "saturated"
                    )]
                    let many = have.saturating_add((rule.growth * f64::from(have)) as u32).max(few);
                    needs.clamp(few, many).next_multiple_of(2).min(most.max(have))
                }
                false => have,
            };
            demands[index] = Demand { next, needs };
        }
    }

    /// Counts of the samples that the pixels got, in a strip whose first row is `top`, of at most
    /// `most`; `None` of none.
    pub(super) fn counts(
        &self,
        rule: &Rule,
        top: u32,
        most: u32,
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

    /// Counts the outcome of the pixels of a block.
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
        let done: Vec<PixelVariance> = (pixels.iter().zip(&shares))
            .filter(|(index, _)| !gave_up(**index))
            .map(|(&index, &share)| PixelVariance { variance: share, samples: self.have[index] })
            .collect();
        CountedBlock {
            done: done.len(),
            own: shares.iter().sum::<f64>() / count.max(1) as f64,
            judged: (is_done && !done.is_empty()).then(|| OwnVariance::of(&done)),
            counts: pixels.iter().zip(&shares).map(of_pixel).reduce(SampleCounts::and),
        }
    }
}

/// Outcome of the pixels of a block.
struct CountedBlock {
    /// Those that were not given up.
    done: usize,
    /// The mean of their variances, by their own samples, as a share of what is allowed.
    own: f64,
    judged: Option<OwnVariance>,
    counts: Option<SampleCounts>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each pixel of a block asks those of the other colour alone, as far as the window and its own reach go, and their
    /// numbers in the window are those of its pixels.
    #[test]
    fn a_pixel_asks_those_of_the_other_colour() {
        let size @ [width, _] = [30, 16];
        for block in [[0, 0], [1, 1], [3, 0]] {
            let window = PixelWindow::around(block, size);
            let all: Vec<usize> = window.pixels().collect();
            assert_eq!(all.len(), window.len());
            for index in
                [block[1] * 8 * width + block[0] * 8, (block[1] * 8 + 5) * width + block[0] * 8 + 5]
            {
                let (x, y) = (index % width, index / width);
                let asked: Vec<(usize, usize)> = window.others(index).collect();
                let expected = all.iter().filter(|&&other| {
                    let (a, b) = (other % width, other / width);
                    (a + b + x + y) % 2 == 1 && a.abs_diff(x) <= REACH && b.abs_diff(y) <= REACH
                });
                assert_eq!(asked.len(), expected.count());
                assert!(asked.iter().all(|&(other, at)| all[at] == other));
            }
        }
    }

    /// Half of a block of 64 pixels, a quarter of which has sixteen times the variance: samples go by its root, to the
    /// mean that is allowed, and are the fewest that do.
    #[test]
    fn samples_go_by_the_root_of_the_variance() {
        let noise = |variance| PixelNoise { variance, light: 1.0 };
        let mut evidence = vec![Evidence::default(); 64];
        for (index, pixel) in evidence.iter_mut().enumerate() {
            pixel.learn(4, noise(if index % 8 < 2 { 16.0 } else { 1.0 }));
        }
        // Left columns are like each other alone.
        let mut guides = vec![[0.0; super::super::guide::FEATURES]; 64];
        (0..64).filter(|index| index % 8 < 2).for_each(|index| guides[index][0] = 1e3);
        let strip =
            StripOfPixels { width: 8, have: &[4; 64], evidence: &evidence, guides: &guides };
        let rule = Rule::of_relative_error(0.5, 0.0);
        let mut demands = vec![Demand::default(); 64];
        strip.ask(&rule, 1 << 20, &[true; 64], &mut demands);
        // Of one sample 64 and 4, of which each is reckoned to have a tenth of the mean: 19.
        let [hard, easy] = [64.0, 4.0].map(|own| 0.9 * own + 0.1 * 19.0_f64);
        let scale = (0.25 * hard.sqrt() + 0.75 * easy.sqrt()) / 0.25;
        for (index, demand) in demands.iter().enumerate() {
            let expected = scale * if index % 8 < 2 { hard.sqrt() } else { easy.sqrt() };
            let found = f64::from(demand.needs);
            assert!(
                (found - expected).abs() <= 1.0 + 1e-3 * expected,
                "{index}: {found} {expected}"
            );
            // Half as many again as it has, at most.
            assert_eq!(demand.next, 6);
        }
        // Rounds that grow faster, and pixels that are all reckoned to have the mean.
        let mut rule = rule;
        (rule.growth, rule.floor) = (2.0, 1.0);
        strip.ask(&rule, 1 << 20, &[true; 64], &mut demands);
        for demand in demands {
            // 19 over the 0.25 that are allowed, rounded up.
            assert!(demand.needs.abs_diff(76) <= 2, "{demand:?}");
            assert_eq!(demand.next, 12);
        }
    }
}
