//! Weighted least squares of a few parameters by their normal equations.

/// Sums of weighted least squares.
#[derive(Debug, Clone)]
pub(crate) struct NormalEquations {
    matrix: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl NormalEquations {
    /// Of so many parameters.
    pub(crate) fn new(count: usize) -> Self {
        Self { matrix: vec![vec![0.0; count]; count], right: vec![0.0; count] }
    }

    /// Adds a value of the sum of `terms`, each times its parameter.
    pub(crate) fn add(&mut self, terms: &[f64], value: f64, weight: f64) {
        for (i, &term) in terms.iter().enumerate().filter(|(_, term)| **term != 0.0) {
            self.right[i] += weight * term * value;
            for (sum, other) in self.matrix[i].iter_mut().zip(terms) {
                *sum += weight * term * other;
            }
        }
    }

    /// Adds what others have.
    pub(crate) fn add_all(&mut self, other: &Self) {
        for (own, row) in self.matrix.iter_mut().zip(&other.matrix) {
            own.iter_mut().zip(row).for_each(|(own, other)| *own += other);
        }
        self.right.iter_mut().zip(&other.right).for_each(|(own, other)| *own += other);
    }

    /// The solution and the inverse, by Gauss and Jordan on a matrix whose diagonal is 1; `None` where it is singular.
    pub(crate) fn solved(&self) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let count = self.right.len();
        let scale: Vec<f64> = (0..count).map(|i| self.matrix[i][i].sqrt()).collect();
        if scale.iter().any(|scale| !(*scale > 0.0 && scale.is_finite())) {
            return None;
        }
        let mut own: Vec<Vec<f64>> = (0..count)
            .map(|i| (0..count).map(|k| self.matrix[i][k] / (scale[i] * scale[k])).collect())
            .collect();
        let mut inverse: Vec<Vec<f64>> =
            (0..count).map(|i| (0..count).map(|k| f64::from(u8::from(i == k))).collect()).collect();
        for i in 0..count {
            let pivot = (i..count).max_by(|&a, &b| own[a][i].abs().total_cmp(&own[b][i].abs()))?;
            own.swap(i, pivot);
            inverse.swap(i, pivot);
            let divisor = own[i][i];
            // Terms that are nearly one another's multiples.
            if divisor.abs() < 1e-9 {
                return None;
            }
            own[i].iter_mut().chain(&mut inverse[i]).for_each(|value| *value /= divisor);
            for k in (0..count).filter(|&k| k != i) {
                let factor = own[k][i];
                for column in 0..count {
                    own[k][column] -= factor * own[i][column];
                    inverse[k][column] -= factor * inverse[i][column];
                }
            }
        }
        let inverse: Vec<Vec<f64>> = (0..count)
            .map(|i| (0..count).map(|k| inverse[i][k] / (scale[i] * scale[k])).collect())
            .collect();
        let solution = inverse
            .iter()
            .map(|row| row.iter().zip(&self.right).map(|(a, b)| a * b).sum())
            .collect();
        Some((solution, inverse))
    }
}
