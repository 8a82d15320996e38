//! Sums that lose nothing to rounding.
//!
//! They are compensated (Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher
//! Summen", 1974), so the mean of a million samples is as exact as that of ten.

use std::ops::Range;

use etendue_geometry::block::{Floats, LANES};

/// Bytes that sums take a value of the film when there are several passes.
pub(crate) const BYTES_OF_SUM: u64 = size_of::<Sum>() as u64;

/// A sum and what rounding took from it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    /// Adds a number, and what rounding takes from it to what is lost.
    #[inline]
    pub(crate) fn add(&mut self, value: f64) {
        let lost;
        (self.sum, lost) = sum_and_loss(self.sum, value);
        self.lost += lost;
    }

    /// The sum, and what rounding took from it.
    pub(crate) fn parts(self) -> [f64; 2] {
        [self.sum, self.lost]
    }

    /// From its [`Self::parts`].
    pub(crate) fn of_parts([sum, lost]: [f64; 2]) -> Self {
        Self { sum, lost }
    }

    /// Adds what another has, as exactly as both are.
    pub(crate) fn add_sum(&mut self, other: Self) {
        self.add(other.sum);
        self.lost += other.lost;
    }

    pub(crate) fn total(self) -> f64 {
        self.sum + self.lost
    }
}

/// The sum of two numbers and what rounding takes from it, by Knuth's way, which asks neither for the larger.
#[inline(always)]
fn sum_and_loss(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// Adds the values of rays side by side, as many each as there are sums, times the weight of each.
pub(crate) fn add_run(sums: &mut [Sum], values: &[f64], weights: &[f64]) {
    match sums.len() {
        1 => add_run_of::<1>(sums, values, weights),
        3 => add_run_of::<3>(sums, values, weights),
        count => {
            for (values, weight) in values.chunks_exact(count.max(1)).zip(weights) {
                sums.iter_mut().zip(values).for_each(|(sum, value)| sum.add(value * weight));
            }
        }
    }
}

/// Adds a run to a known number of sums, four at most, which stay side by side in registers.
#[multiversion::multiversion(targets = "simd")]
fn add_run_of<const N: usize>(sums: &mut [Sum], values: &[f64], weights: &[f64]) {
    let Some(sums) = sums.first_chunk_mut::<N>() else { return };
    let (mut sum, mut lost) = ([0.0; 4], [0.0; 4]);
    for (k, own) in sums.iter().enumerate() {
        (sum[k], lost[k]) = (own.sum, own.lost);
    }
    for (values, weight) in values.as_chunks::<N>().0.iter().zip(weights) {
        let mut four = [0.0; 4];
        four[..N].copy_from_slice(values);
        for k in 0..4 {
            let rounded;
            (sum[k], rounded) = sum_and_loss(sum[k], four[k] * weight);
            lost[k] += rounded;
        }
    }
    for (k, own) in sums.iter_mut().enumerate() {
        (own.sum, own.lost) = (sum[k], lost[k]);
    }
}

/// Adds the values of some rays in blocks, of which each has a row for each sum, three sums at a time.
pub(crate) fn add_rows(sums: &mut [Sum], rows: &[Floats], rays: Range<usize>) {
    let count = sums.len();
    for (three, first) in sums.as_chunks_mut::<3>().0.iter_mut().zip((0..).step_by(3)) {
        let mut own = *three;
        for ray in rays.clone() {
            let start = ray / LANES * count + first;
            if let [r, g, b] = &rows[start..start + 3] {
                for (sum, row) in own.iter_mut().zip([r, g, b]) {
                    sum.add(f64::from(row[ray % LANES]));
                }
            }
        }
        *three = own;
    }
}

/// The variance of the mean of two independent sets of one size, by the difference of their means: a quarter
/// of its square.
pub(crate) fn variance_of_mean(difference: f64) -> f64 {
    0.25 * difference * difference
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_keeps_what_rounding_takes() {
        let mut sum = Sum::default();
        for value in [1.0, 1e100, 1.0, -1e100] {
            sum.add(value);
        }
        // The example of Neumaier's paper: naive summation gives 0.
        assert_eq!(sum.total(), 2.0);
    }

    /// Runs are added as their values are one by one, to the bit.
    #[test]
    fn a_run_is_added_as_its_values_are() {
        for count in [1, 2, 3, 4, 5] {
            let value =
                |k: usize| (1.0 + k as f64).sqrt() * if k.is_multiple_of(7) { 1e12 } else { -1.0 };
            let values: Vec<f64> = (0..20 * count).map(value).collect();
            let weights: Vec<f64> = (0..20).map(|k| 1.0 / (3.0 + f64::from(k))).collect();
            let mut sums: Vec<Sum> = (0..count).map(|k| Sum::of_parts([value(k), 1e-9])).collect();
            let mut one_by_one = sums.clone();
            add_run(&mut sums, &values, &weights);
            for (values, weight) in values.chunks(count).zip(&weights) {
                one_by_one.iter_mut().zip(values).for_each(|(sum, v)| sum.add(v * weight));
            }
            let parts = |sums: &[Sum]| sums.iter().map(|sum| sum.parts()).collect::<Vec<_>>();
            assert_eq!(parts(&sums), parts(&one_by_one), "{count}");
        }
    }
}
