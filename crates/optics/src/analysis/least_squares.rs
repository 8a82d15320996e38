//! Linear least squares by the normal equations: few unknowns, many rows, a basis that is nearly
//! orthogonal, so that squaring its condition costs no digits that matter.

/// Sums of a weighted fit of `terms` unknowns.
#[derive(Debug, Clone)]
pub struct LeastSquares {
    terms: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl LeastSquares {
    /// Without any row.
    #[must_use]
    pub fn new(terms: usize) -> Self {
        Self { terms, matrix: vec![0.0; terms * terms], right: vec![0.0; terms] }
    }

    /// Adds a row: the terms' values, what they are to add up to, and its weight.
    pub fn add(&mut self, row: &[f64], value: f64, weight: f64) {
        for i in 0..self.terms {
            let scaled = weight * row[i];
            self.right[i] += scaled * value;
            let sums = &mut self.matrix[i * self.terms..];
            for (sum, other) in sums.iter_mut().zip(&row[..=i]) {
                *sum += scaled * other;
            }
        }
    }

    /// The coefficients, by Cholesky's factors; `None` when the rows do not tell the terms apart.
    #[must_use]
    pub fn solve(mut self) -> Option<Vec<f64>> {
        /// A pivot this small a share of its row's own is lost in rounding.
        const LOST: f64 = 1e-13;
        let n = self.terms;
        for i in 0..n {
            let own = self.matrix[i * n + i];
            for j in 0..=i {
                let (row, other) = (&self.matrix[i * n..], &self.matrix[j * n..]);
                let sum: f64 = (0..j).map(|k| row[k] * other[k]).sum();
                let rest = self.matrix[i * n + j] - sum;
                self.matrix[i * n + j] = match i == j {
                    true if rest > LOST * own => rest.sqrt(),
                    true => return None,
                    false => rest / self.matrix[j * n + j],
                };
            }
        }
        let mut x = self.right;
        for i in 0..n {
            let sum: f64 = (0..i).map(|k| self.matrix[i * n + k] * x[k]).sum();
            x[i] = (x[i] - sum) / self.matrix[i * n + i];
        }
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|k| self.matrix[k * n + i] * x[k]).sum();
            x[i] = (x[i] - sum) / self.matrix[i * n + i];
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_and_twins_are_not_told_apart() {
        let mut fit = LeastSquares::new(3);
        let mut twins = LeastSquares::new(2);
        for i in 0..9 {
            let x = 0.25 * f64::from(i) - 1.0;
            fit.add(&[1.0, x, x * x], 2.0 - x + 0.5 * x * x, 1.0 + x * x);
            twins.add(&[x, 3.0 * x], x, 1.0);
        }
        let found = fit.solve().unwrap();
        for (value, expected) in found.iter().zip([2.0, -1.0, 0.5]) {
            assert!((value - expected).abs() < 1e-13, "{found:?}");
        }
        assert_eq!(twins.solve(), None);
    }
}
