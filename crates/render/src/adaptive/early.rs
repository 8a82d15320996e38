//! Detection of blocks that stopped too early, by their own samples, which had no part in deciding how many they are.
//!
//! The variances that a block's pixels tell of themselves have the right mean, but a block where no rare flash fell
//! tells too little, and one where it fell too much. Their own mean, of one sample, is therefore drawn towards that of
//! the blocks around it by as much as they differ by chance, divided by the samples that they have, and counted with the
//! probability that it is then over the limit (empirical Bayes: C. Morris, "Parametric empirical Bayes inference", 1983).

/// The variance, as a share of what is allowed, with which a block has stopped too early.
const TOO_MUCH: f64 = 2.0;

/// Blocks to each side that are taken to be like one.
const BESIDE: usize = 8;

/// Variance of a pixel's mean, as a share of what is allowed, and its samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelVariance {
    pub(super) variance: f64,
    pub(super) samples: u32,
}

impl PixelVariance {
    /// That of one sample.
    fn of_one(&self) -> f64 {
        self.variance * f64::from(self.samples)
    }
}

/// Variance that the pixels of a block tell of themselves.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct OwnVariance {
    /// The mean of their variances of one sample, as a share of what is allowed, and the variance of that mean.
    mean: f64,
    spread: f64,
    /// Factor on that for the mean of their variances of all samples.
    of_all: f64,
    pixels: usize,
}

impl OwnVariance {
    /// Of the pixels of a block.
    pub(super) fn of(pixels: &[PixelVariance]) -> Self {
        let count = pixels.len().max(1) as f64;
        let mean = pixels.iter().map(PixelVariance::of_one).sum::<f64>() / count;
        let squares: f64 = pixels.iter().map(|pixel| (pixel.of_one() - mean).powi(2)).sum();
        // A square of a normal number has twice the square of its mean as variance: so much there is in any case.
        let spread = (squares / (count - 1.0).max(1.0)).max(2.0 * mean * mean) / count;
        let all = pixels.iter().map(|pixel| pixel.variance).sum::<f64>() / count;
        let of_all = match mean > 0.0 {
            true => all / mean,
            false => {
                let of_pixel = |pixel: &PixelVariance| 1.0 / f64::from(pixel.samples.max(1));
                pixels.iter().map(of_pixel).sum::<f64>() / count
            }
        };
        Self { mean, spread, of_all, pixels: pixels.len() }
    }
}

/// Judgement of a block: its variance as a share of what is allowed, and the probability that it stopped too early.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Judgement {
    pub(super) variance: f64,
    pub(super) probability: f64,
}

/// The blocks of a strip, `across` a row; those that are none of them are `None`.
pub(super) fn judge(blocks: &[Option<OwnVariance>], across: usize) -> Vec<Judgement> {
    let rows = blocks.len() / across.max(1);
    let of_block = |index: usize| {
        let Some(own) = blocks[index] else { return Judgement::default() };
        let column = index % across;
        let columns = column.saturating_sub(BESIDE)..(column + BESIDE + 1).min(across);
        let neighbours: Vec<OwnVariance> = (0..rows)
            .flat_map(|row| columns.clone().filter_map(move |x| blocks[row * across + x]))
            .filter(|other| 2 * other.pixels > own.pixels)
            .collect();
        let count = neighbours.len() as f64;
        let mean = neighbours.iter().map(|other| other.mean).sum::<f64>() / count;
        // By chance alone, a block like these.
        let by_chance = neighbours.iter().map(|other| other.spread).sum::<f64>() / count;
        // Of flashes half of one more than fell: of what is rare none may have fallen yet (H. Jeffreys, 1946).
        let mean = if mean > 0.0 { mean + 0.5 * by_chance / (mean * count) } else { 0.0 };
        let all = neighbours.iter().map(|other| (other.mean - mean).powi(2)).sum::<f64>()
            / (count - 1.0).max(1.0);
        let spread = by_chance.max(own.spread);
        let between = (all - by_chance).max(0.0);
        let share = if spread > 0.0 { between / (between + spread) } else { 1.0 };
        let variance = mean + share * (own.mean - mean);
        // What is left unknown of it, and of the mean of all.
        let unknown = share * spread + (1.0 - share).powi(2) * by_chance / count;
        let of_all = own.of_all;
        let probability = above(variance * of_all, unknown * of_all * of_all);
        Judgement { variance: variance * of_all, probability }
    };
    (0..blocks.len()).map(of_block).collect()
}

/// The probability that a positive number with this mean and variance is over the limit: of a lognormal one.
fn above(mean: f64, variance: f64) -> f64 {
    if mean <= 0.0 {
        return 0.0;
    }
    let log_variance = (variance / (mean * mean)).ln_1p();
    let distance = (mean / TOO_MUCH).ln() - 0.5 * log_variance;
    match log_variance > 1e-12 {
        true => normal(distance / log_variance.sqrt()),
        false => f64::from(u8::from(distance > 0.0)),
    }
}

/// The share of normal numbers below `x`: to 7.5·10⁻⁸ (M. Abramowitz and I. A. Stegun, *Handbook of Mathematical
/// Functions*, 26.2.17).
fn normal(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series = [1.330_274_429, -1.821_255_978, 1.781_477_937, -0.356_563_782, 0.319_381_530];
    let tail = series.iter().fold(0.0, |sum, c| (sum + c) * t) * (-0.5 * x * x).exp()
        / (2.0 * std::f64::consts::PI).sqrt();
    if x > 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_is_that_of_tables() {
        for (x, below) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.959_963_985, 0.025)] {
            assert!((normal(x) - below).abs() < 1e-7, "{x}");
        }
    }

    /// Pseudo-random squares of normal numbers, by the sum of twelve uniform ones.
    fn squares(seed: u64, count: usize) -> impl Iterator<Item = f64> {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        (0..count).map(move |_| ((0..12).map(|_| uniform()).sum::<f64>() - 6.0).powi(2))
    }

    /// With four samples a pixel.
    fn block(variances: &[f64]) -> OwnVariance {
        let of_pixel = |&variance| PixelVariance { variance, samples: 4 };
        OwnVariance::of(&variances.iter().map(of_pixel).collect::<Vec<_>>())
    }

    /// Blocks of known variances, told within a factor of 1.5 of how many are over the limit, in the mean of seeds:
    /// where all are alike, where every fourth is hard, and where one pixel in 250 carries everything.
    #[test]
    fn blocks_over_the_limit_are_told_within_half() {
        let (across, pixels) = (40, 64);
        let share = |of: &dyn Fn(u64, usize) -> Vec<f64>| {
            let seeds = 32;
            let mut sum = 0.0;
            for seed in 0..seeds {
                let blocks: Vec<_> = (0..2 * across).map(|k| Some(block(&of(seed, k)))).collect();
                sum += judge(&blocks, across).iter().map(|block| block.probability).sum::<f64>();
            }
            sum / seeds as f64 / (2.0 * across as f64)
        };
        let normal = |seed: u64, k: usize, level: f64| -> Vec<f64> {
            squares(1 + seed * 1000 + k as u64, pixels).map(|v| level * v).collect()
        };
        assert!(share(&|seed, k| normal(seed, k, 0.8)) < 0.01);
        assert!(share(&|seed, k| normal(seed, k, 4.0)) > 0.99);
        let mixed = share(&|seed, k| normal(seed, k, if k % 4 == 0 { 5.0 } else { 0.8 }));
        assert!((0.25 / 1.5..0.25 * 1.5).contains(&mixed), "{mixed}");
        // Flashes: a square of a normal number is over 8.284 in one of 250.
        let flash = |level: f64| {
            share(&|seed, k| {
                let all = squares(7 + seed * 1000 + k as u64, pixels);
                all.map(|v| if v > 8.284 { level * 250.0 } else { 0.0 }).collect()
            })
        };
        assert!(flash(5.0) > 1.0 / 1.5, "{}", flash(5.0));
        assert!(flash(0.3) < 0.1, "{}", flash(0.3));
    }
}
