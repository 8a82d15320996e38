//! The fewest samples with which the blocks of a picture are good enough, by somebody who knows beforehand how the
//! variance of each falls.

/// Exponents by which variances fall with the number of samples: from not at all to that of what is smooth.
const SLOPES: [f64; 2] = [-3.0, -0.3];

/// The share of blocks that need not be good enough, and get the fewest.
const FEW: f64 = 0.01;

/// Samples a pixel, in the mean over all blocks: each gets as many as bring its variance to `level`, `fewest` at least,
/// but for the hundredth of them that want most. `variances` are those of every block with each of `counts` samples.
///
/// What is measured of a block is noisy, and the fewest of several noisy numbers would be too few: a line through all
/// of them, of the logarithms, stands for the law that the block follows.
pub(crate) fn samples(counts: &[u32], variances: &[Vec<f64>], level: f64, fewest: f64) -> f64 {
    let blocks = variances.first().map_or(0, Vec::len);
    let of_block = |block: usize| {
        let measured = counts.iter().zip(variances).map(|(&n, all)| [f64::from(n), all[block]]);
        let logs: Vec<[f64; 2]> =
            measured.filter(|point| point[1] > 0.0).map(|point| point.map(f64::ln)).collect();
        needed(&logs, level.ln()).max(fewest)
    };
    let mut all: Vec<f64> = (0..blocks).map(of_block).collect();
    all.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of them")]
    let few = (FEW * blocks as f64) as usize;
    let kept: f64 = all.iter().take(blocks - few).sum();
    (kept + fewest * few as f64) / blocks.max(1) as f64
}

/// The number of samples at which the line of least squares through logarithms reaches `level`; none where there are
/// no points.
fn needed(logs: &[[f64; 2]], level: f64) -> f64 {
    let count = logs.len() as f64;
    if logs.is_empty() {
        return 0.0;
    }
    let [x, y] = [0, 1].map(|k| logs.iter().map(|point| point[k]).sum::<f64>() / count);
    let square: f64 = logs.iter().map(|point| (point[0] - x).powi(2)).sum();
    let both: f64 = logs.iter().map(|point| (point[0] - x) * (point[1] - y)).sum();
    let slope = if square > 0.0 { both / square } else { -1.0 };
    (x + (level - y) / slope.clamp(SLOPES[0], SLOPES[1])).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_block_gets_what_its_law_asks_for() {
        let counts = [8, 16, 32];
        // A hundred blocks of 1/n, and as many of 16/n³ᐟ²; a level of 1/64.
        let laws = |n: f64| [1.0 / n, 16.0 / n.powf(1.5)];
        let of = |&n: &u32| laws(f64::from(n)).iter().flat_map(|&v| [v; 100]).collect::<Vec<f64>>();
        let variances: Vec<Vec<f64>> = counts.iter().map(of).collect();
        let needs = [64.0, (16.0_f64 * 64.0).powf(2.0 / 3.0)];
        // Two of the harder hundred get four.
        let expected = (100.0 * needs[0] + 98.0 * needs[1] + 2.0 * 4.0) / 200.0;
        let found = samples(&counts, &variances, 1.0 / 64.0, 4.0);
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        // What is good at once gets the fewest.
        assert!((samples(&counts, &variances, 10.0, 4.0) - 4.0).abs() < 1e-9);
    }
}
