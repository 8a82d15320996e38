//! Gain of a view, which makes its light that of an ideal lens: a parabola over its rows and columns.

/// Powers of column and row, from −1 to 1 over a view, in the order of the factors.
const POWERS: [[i32; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

/// A lenslet (row and column), and what its light is to be multiplied with.
#[derive(Debug, Clone, Copy)]
pub(super) struct GainNode {
    pub(super) at: [u32; 2],
    pub(super) gain: f64,
}

/// The gain of a view by row and column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gain {
    /// Of 1, x, y, x², x y and y².
    pub(super) factors: [f64; POWERS.len()],
    last: [u32; 2],
}

impl Gain {
    /// The parabola of least squares through nodes, of which the `last` row and column are given; 1
    /// without any.
    pub(super) fn fitted(nodes: &[GainNode], last: [u32; 2]) -> Self {
        const N: usize = POWERS.len();
        let mut gain = Self { factors: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], last };
        if nodes.is_empty() {
            return gain;
        }
        // Normal equations, of the difference from the mean. Where all nodes stand in one row or two, powers
        // of it are the same numbers as others: a little of the square of each factor decides.
        let mean = nodes.iter().map(|node| node.gain).sum::<f64>() / nodes.len() as f64;
        let mut rows = [[0.0; N + 1]; N];
        for node in nodes {
            let terms = gain.terms(node.at);
            for (row, term) in rows.iter_mut().zip(terms) {
                for (sum, other) in row.iter_mut().zip(terms) {
                    *sum += term * other;
                }
                row[N] += term * (node.gain - mean);
            }
        }
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] += 1e-6 * nodes.len() as f64;
        }
        // Gauss and Jordan: such a matrix needs no exchange of rows.
        for i in 0..N {
            let pivot = rows[i].map(|x| x / rows[i][i]);
            for (j, row) in rows.iter_mut().enumerate() {
                let share = row[i];
                *row =
                    if j == i { pivot } else { std::array::from_fn(|k| row[k] - share * pivot[k]) };
            }
        }
        gain.factors = rows.map(|row| row[N]);
        gain.factors[0] += mean;
        gain
    }

    fn terms(&self, [row, col]: [u32; 2]) -> [f64; POWERS.len()] {
        let across = |at: u32, last: u32| match last {
            0 => 0.0,
            last => 2.0 * f64::from(at) / f64::from(last) - 1.0,
        };
        let (x, y) = (across(col, self.last[1]), across(row, self.last[0]));
        POWERS.map(|[right, down]| x.powi(right) * y.powi(down))
    }

    /// The gain of a row and column.
    pub(super) fn at(&self, at: [u32; 2]) -> f64 {
        self.terms(at).iter().zip(self.factors).map(|(term, factor)| term * factor).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_goes_through_its_own_points() {
        let f = |[row, col]: [u32; 2]| {
            let (x, y) = (f64::from(col) / 10.0 - 1.0, f64::from(row) / 5.0 - 1.0);
            1.3 + 0.1 * x - 0.2 * y + 0.05 * x * x - 0.03 * x * y + 0.02 * y * y
        };
        let node = |at| GainNode { at, gain: f(at) };
        let all: Vec<GainNode> =
            [0, 3, 5, 8, 10].map(|row| [0, 7, 13, 20].map(|col| node([row, col]))).concat();
        let gain = Gain::fitted(&all, [10, 20]);
        // A millionth of the square of each factor takes about as much of it.
        assert!((gain.at([4, 11]) - f([4, 11])).abs() < 1e-5, "{gain:?}");
        // One row, of which nothing is known down the view.
        let row: Vec<GainNode> = [0, 7, 13, 20].map(|col| node([0, col])).into();
        let gain = Gain::fitted(&row, [0, 20]);
        assert!((gain.at([0, 7]) - f([0, 7])).abs() < 1e-5, "{gain:?}");
        assert_eq!(Gain::fitted(&[], [10, 20]).at([3, 4]), 1.0);
    }
}
