//! Densities that are constant in the cells of a rectangle, and points drawn from them.

use glam::DVec2;

/// A density over the unit square, constant in each of a grid of cells.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Histogram {
    columns: usize,
    rows: usize,
    /// Of the rows: the share of all before each, and 1 at the end.
    marginal: Vec<f64>,
    /// Of each row: the share of the row before each of its cells, and 1 at the end.
    conditional: Vec<f64>,
    /// Mean of the values that it was made of.
    mean: f64,
}

/// A point drawn from a [`Histogram`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drawn {
    /// The cell's column and row.
    pub(super) cell: [usize; 2],
    /// The place in the cell, 0 to 1 along both sides.
    pub(super) inside: [f64; 2],
    /// The density there, over the unit square.
    pub(super) density: f64,
}

impl Histogram {
    /// The density in proportion to `values`, row by row; `None` when they are all 0.
    pub(super) fn new(columns: usize, values: &[f64]) -> Option<Self> {
        let rows = values.len() / columns.max(1);
        let mut conditional = Vec::with_capacity(rows * (columns + 1));
        let mut sums = Vec::with_capacity(rows);
        for row in values.chunks_exact(columns) {
            let (shares, sum) = cumulative(row);
            conditional.extend(shares);
            sums.push(sum);
        }
        let (marginal, total) = cumulative(&sums);
        #[expect(clippy::cast_precision_loss, reason = "a few thousand cells")]
        let mean = total / values.len() as f64;
        (total > 0.0).then_some(Self { columns, rows, marginal, conditional, mean })
    }

    /// Mean of the values that it was made of.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The point for a place in the unit square: neighbours stay neighbours, and equal areas of the
    /// square hold equal shares of the density.
    pub(super) fn draw(&self, [u, v]: [f64; 2]) -> Drawn {
        let (row, down) = invert(&self.marginal, v);
        let (column, across) = invert(self.row(row), u);
        Drawn { cell: [column, row], inside: [across, down], density: self.density([column, row]) }
    }

    /// The density in a cell, over the unit square.
    pub(super) fn density(&self, [column, row]: [usize; 2]) -> f64 {
        let shares = self.row(row);
        let share =
            (self.marginal[row + 1] - self.marginal[row]) * (shares[column + 1] - shares[column]);
        #[expect(clippy::cast_precision_loss, reason = "a few thousand cells")]
        let cells = (self.columns * self.rows) as f64;
        share * cells
    }

    /// The cell that holds a point of the unit square.
    pub(super) fn cell_at(&self, point: DVec2) -> [usize; 2] {
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share in 0..1 of a few dozen cells"
        )]
        let along = |x: f64, count: usize| ((x.max(0.0) * count as f64) as usize).min(count - 1);
        [along(point.x, self.columns), along(point.y, self.rows)]
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.conditional[row * (self.columns + 1)..][..=self.columns]
    }
}

/// Shares of the sum before each value, and 1 at the end; and the sum.
fn cumulative(values: &[f64]) -> (Vec<f64>, f64) {
    let sum: f64 = values.iter().sum();
    let mut shares = Vec::with_capacity(values.len() + 1);
    let mut before = 0.0;
    for value in values {
        shares.push(if sum > 0.0 { before / sum } else { 0.0 });
        before += value;
    }
    shares.push(if sum > 0.0 { 1.0 } else { 0.0 });
    (shares, sum)
}

/// The interval of ascending shares that holds `u`, of those that are not empty, and the place in it.
fn invert(shares: &[f64], u: f64) -> (usize, f64) {
    let last = shares.len() - 2;
    let mut i = shares.partition_point(|share| *share <= u).saturating_sub(1).min(last);
    while i > 0 && shares[i + 1] <= shares[i] {
        i -= 1;
    }
    let width = shares[i + 1] - shares[i];
    let inside = if width > 0.0 { (u - shares[i]) / width } else { 0.5 };
    (i, inside.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_fall_in_proportion_to_the_values_and_never_into_nothing() {
        let values = [0.0, 3.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 2.0];
        let histogram = Histogram::new(3, &values).unwrap();
        let (n, mut counts) = (400, [0.0; 9]);
        for i in 0..n * n {
            let place = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
            let drawn = histogram.draw([place(i % n), place(i / n)]);
            let cell = drawn.cell[1] * 3 + drawn.cell[0];
            counts[cell] += 1.0;
            assert!((drawn.density - values[cell] * 9.0 / 8.0).abs() < 1e-12, "{drawn:?}");
            assert_eq!(histogram.density(drawn.cell), drawn.density);
        }
        for (count, value) in counts.iter().zip(values) {
            // A cell's border is within a line of the grid of places.
            let share = count / f64::from(n * n);
            assert!((share - value / 8.0).abs() < 2.0 / f64::from(n), "{share} for {value}");
        }
        assert_eq!(Histogram::new(2, &[0.0; 4]), None);
        let edge = histogram.draw([1.0, 1.0]);
        assert_eq!(edge.cell, [2, 2]);
    }
}
