//! Numbers in 0..1 become directions, and indices by their weights.
//!
//! # Sources
//!
//! * Cosine-weighted directions: Shirley and Chiu, "A Low Distortion Map Between Disk and Square",
//!   1997, projected up (Malley).
//! * Orthonormal frames: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
//! * Choice by weight: inversion of the distribution function, with a guide table (Chen and Asau, "On
//!   generating random variates from an empirical distribution", 1974). It takes constant time on
//!   average, and neighbouring numbers choose neighbouring indices, so that what is stratified stays
//!   so; an alias table (Walker 1977) would scatter them.
//! * Choice on a grid: a row by the sums of rows, then a column within it (Pharr, Jakob and Humphreys,
//!   *Physically Based Rendering*, 4th edition, section A.5).

use etendue_geometry::disk;
use etendue_geometry::glam::DVec3;

use etendue_geometry::Float;

/// Three unit vectors at right angles; z is a surface's normal.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    x: DVec3,
    y: DVec3,
    /// The third, which the frame was made around.
    pub z: DVec3,
}

impl Frame {
    /// A frame around the unit vector `z`.
    #[must_use]
    pub fn around(z: DVec3) -> Self {
        // Duff et al.; a z of −0 counts as one of 0, as it does where many frames are made side by side.
        let sign = if z.z < 0.0 { -1.0 } else { 1.0 };
        let f = -1.0 / (sign + z.z);
        let g = z.x * z.y * f;
        let x = DVec3::new(1.0 + sign * z.x * z.x * f, sign * g, -sign * z.x);
        Self { x, y: DVec3::new(g, sign + z.y * z.y * f, -z.y), z }
    }

    /// A frame around the unit vector `z` whose x axis is as near to `along` as it can; any where they are
    /// parallel.
    #[must_use]
    pub fn along(z: DVec3, along: DVec3) -> Self {
        match (along - z * z.dot(along)).try_normalize() {
            Some(x) => Self { x, y: z.cross(x), z },
            None => Self::around(z),
        }
    }

    /// Components of `world` along the three.
    #[must_use]
    pub fn local(&self, world: DVec3) -> DVec3 {
        DVec3::new(world.dot(self.x), world.dot(self.y), world.dot(self.z))
    }

    /// The vector of these components.
    #[must_use]
    pub fn world(&self, local: DVec3) -> DVec3 {
        self.x * local.x + self.y * local.y + self.z * local.z
    }
}

/// A direction about +z with density cos θ / π.
#[must_use]
pub fn cosine_direction(square: [f64; 2]) -> DVec3 {
    let [x, y] = disk::point(square);
    DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// A direction with density 1/4π.
#[must_use]
pub fn sphere_direction([u, v]: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * u;
    let (sin, cos) = disk::turn(v);
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// A direction within the cone of half-angle arccos(`cos_max`) about +z, uniform over its solid
/// angle.
#[must_use]
pub fn cone_direction([u, v]: [f64; 2], cos_max: f64) -> DVec3 {
    // What is lacking of 1, which narrow cones need whole.
    let short = u * (1.0 - cos_max);
    let (sin, cos) = disk::turn(v);
    let r = (short * (2.0 - short)).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, 1.0 - short)
}

/// Barycentric weights of the second and third corner, uniform over a triangle (Turk 1990).
#[must_use]
pub fn triangle_point([u, v]: [f64; 2]) -> [f64; 2] {
    let root = u.sqrt();
    [root * (1.0 - v), root * v]
}

/// The weight of the first of two sampling techniques by the power heuristic of exponent 2 (Veach
/// 1997, section 9.2.4), for densities `of` and `other`.
#[must_use]
pub fn power_heuristic(of: f64, other: f64) -> f64 {
    if of == f64::INFINITY {
        return 1.0;
    }
    // Ratios do not overflow where squares do.
    let ratio = other / of;
    1.0 / (1.0 + ratio * ratio)
}

/// Indices by weight in constant time on average.
#[derive(Debug, Clone, Default)]
pub struct DiscreteDistribution {
    /// The sum of all probabilities before each index, and 1 at the end.
    below: Vec<f64>,
    /// For each of as many equal intervals of 0..1 as there are indices, the one that its start picks.
    guide: Vec<u32>,
}

impl DiscreteDistribution {
    /// By `weights`, at most 2³² of them; those that are not finite or below zero count as zero.
    /// Without any weight all are alike.
    #[must_use]
    pub fn new(weights: &[f64]) -> Self {
        let sound = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
        let most = weights.iter().copied().map(sound).fold(0.0, f64::max);
        let mut below = Vec::with_capacity(weights.len() + 1);
        let mut sum = 0.0;
        below.push(sum);
        for &weight in weights {
            // Shares of the largest, so that no sum overflows.
            sum += if most > 0.0 { sound(weight) / most } else { 1.0 };
            below.push(sum);
        }
        below.iter_mut().for_each(|share| *share /= sum);
        let mut guide = Vec::with_capacity(weights.len());
        let mut index = 0_u32;
        for k in 0..weights.len() {
            let start = k as f64 / weights.len() as f64;
            while below[index as usize + 1] <= start {
                index += 1;
            }
            guide.push(index);
        }
        Self { below, guide }
    }

    /// The sum of all probabilities before each index, and 1 at the end.
    #[must_use]
    pub fn below(&self) -> &[f64] {
        &self.below
    }

    /// Number of indices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.guide.len()
    }

    /// True if there is no index.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.guide.is_empty()
    }

    /// The index for `u` in 0..1, and `u` stretched to 0..1 again for the next choice. An index
    /// without weight is never chosen.
    #[must_use]
    #[inline]
    pub fn pick(&self, u: f64) -> (usize, f64) {
        self.pick_between(u, self.guided(u))
    }

    /// The first and the last index that `u` may pick.
    #[inline]
    fn guided(&self, u: f64) -> [u32; 2] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "u is in 0..1, and the cast saturates"
        )]
        let interval = ((u * self.len() as f64) as usize).min(self.len() - 1);
        let last = || u32::try_from(self.len() - 1).unwrap_or(u32::MAX);
        [self.guide[interval], self.guide.get(interval + 1).copied().unwrap_or_else(last)]
    }

    /// [`Self::pick`] from these on.
    #[inline]
    fn pick_between(&self, u: f64, ends: [u32; 2]) -> (usize, f64) {
        let [first, last] = ends.map(|index| index as usize);
        // The first whose end is beyond u.
        let index = first + self.below[first + 1..=last].partition_point(|&end| end <= u);
        let (start, end) = (self.below[index], self.below[index + 1]);
        (index, ((u - start) / (end - start)).clamp(0.0, ONE_BELOW))
    }

    /// The probability of `index`.
    #[must_use]
    pub fn probability(&self, index: usize) -> f64 {
        self.below[index + 1] - self.below[index]
    }
}

/// A place between 0 and 1 whose density goes from `start` to `end` in a straight line, to a factor (Pharr,
/// Jakob and Humphreys, *Physically Based Rendering*, 4th edition, section A.5.1).
#[must_use]
#[inline(always)]
pub(crate) fn linear_place<F: Float>(u: F, [start, end]: [F; 2]) -> F {
    let root = ((F::of(1.0) - u) * start * start + u * end * end).sqrt();
    let sum = start + root;
    let place = u * (start + end) / sum;
    let place = if place < F::ONE_BELOW { place } else { F::ONE_BELOW };
    // Where both are 0, or so small that their squares are.
    if sum > F::ZERO { place } else { u }
}

/// Cells of a grid by weight.
#[derive(Debug, Clone)]
pub struct GridDistribution {
    rows: DiscreteDistribution,
    columns: Vec<DiscreteDistribution>,
}

/// A cell of a grid that was chosen.
#[derive(Debug, Clone, Copy, Default)]
pub struct GridCell {
    /// Its column and row.
    pub at: [u32; 2],
    /// Rests of the numbers that chose them, in 0..1.
    pub rest: [f64; 2],
    between: [u32; 2],
}

impl GridDistribution {
    /// By `weights`, row by row of `columns` each.
    #[must_use]
    pub fn new(columns: usize, weights: &[f64]) -> Self {
        let rows: Vec<f64> = weights.chunks(columns).map(|row| row.iter().sum()).collect();
        Self {
            rows: DiscreteDistribution::new(&rows),
            columns: weights.chunks(columns).map(DiscreteDistribution::new).collect(),
        }
    }

    /// The cell for each of `squares`, the first number along columns; `cells` is refilled. Neighbours in the
    /// square are neighbours on the grid.
    ///
    /// Tables of large grids are in no cache near by: what is read of them is read in loops of little
    /// else, so that many reads are under way at once.
    pub fn cells(&self, squares: impl Iterator<Item = [f64; 2]>, cells: &mut Vec<GridCell>) {
        cells.clear();
        cells.extend(squares.map(|[u, v]| {
            let (row, down) = self.rows.pick(v);
            let row = u32::try_from(row).unwrap_or(u32::MAX);
            GridCell { at: [0, row], rest: [u, down], ..GridCell::default() }
        }));
        for cell in cells.iter_mut() {
            cell.between = self.columns[cell.at[1] as usize].guided(cell.rest[0]);
        }
        for GridCell { at: [column, row], rest: [across, _], between } in cells {
            let columns = &self.columns[*row as usize];
            let (own, rest) = columns.pick_between(*across, *between);
            (*column, *across) = (u32::try_from(own).unwrap_or(u32::MAX), rest);
        }
    }
}

/// The largest number below 1.
pub(crate) const ONE_BELOW: f64 = 1.0 - f64::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_pick_by_weight() {
        let weights = [1.0, 0.0, 3.0, f64::NAN, 4.0, -1.0];
        let table = DiscreteDistribution::new(&weights);
        let mut counts = [0_u32; 6];
        let n = 80_000;
        for k in 0..n {
            let (index, rest) = table.pick((f64::from(k) + 0.5) / f64::from(n));
            assert!((0.0..1.0).contains(&rest));
            counts[index] += 1;
        }
        // A regular grid of u hits each interval's length to within one step an interval.
        for (i, expected) in [1.0, 0.0, 3.0, 0.0, 4.0, 0.0].iter().enumerate() {
            let share = f64::from(counts[i]) / f64::from(n);
            assert!((share - expected / 8.0).abs() < 2e-4, "{counts:?}");
            assert!((table.probability(i) - expected / 8.0).abs() < 1e-15);
        }
        let alike = DiscreteDistribution::new(&[0.0, 0.0]);
        assert_eq!(alike.probability(1), 0.5);
        // Neither are both ends of 0..1 given to indices without weight, nor is anything between.
        let ends = DiscreteDistribution::new(&[0.0, 1e-300, 0.0, 1e308, 1e308, 0.0]);
        assert_eq!([0.0, 0.25, 0.75, ONE_BELOW].map(|u| ends.pick(u).0), [3, 3, 4, 4]);
    }

    /// Every place of a number in its index's interval: what is left of it is the place.
    #[test]
    fn picks_are_monotone_and_what_is_left_is_stretched() {
        let weights: Vec<f64> = (0..1_000).map(|k| f64::from(k * 7_919 % 1_000).powi(6)).collect();
        let table = DiscreteDistribution::new(&weights);
        let mut last = (0, 0.0);
        for k in 0..100_000 {
            let u = f64::from(k) / 100_000.0;
            let (index, rest) = table.pick(u);
            assert!((index, rest) >= last, "{last:?} and then {:?}", (index, rest));
            last = (index, rest);
            let back = table.below[index] + rest * table.probability(index);
            assert!((back - u).abs() < 1e-15, "{u}: {back}");
        }
    }

    #[test]
    fn cells_of_grids_have_their_probability() {
        let weights = [1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 5.0, 0.0, 7.0];
        let grid = GridDistribution::new(3, &weights);
        let mut cells = Vec::new();
        let n = 400;
        let mut counts = [0.0; 9];
        for k in 0..n * n {
            let square = [k % n, k / n].map(|i| (f64::from(i) + 0.5) / f64::from(n));
            grid.cells(std::iter::once(square), &mut cells);
            let GridCell { at, rest, .. } = cells[0];
            let [x, y] = at.map(|index| index as usize);
            let probability = grid.rows.probability(y) * grid.columns[y].probability(x);
            assert!(rest.iter().all(|rest| (0.0..1.0).contains(rest)));
            counts[y * 3 + x] += 1.0 / f64::from(n * n);
            assert!((probability - weights[y * 3 + x] / 16.0).abs() < 1e-12);
        }
        for (count, weight) in counts.iter().zip(weights) {
            // A regular grid: within a step along each side of the cell's share of the square.
            assert!((count - weight / 16.0).abs() < 4.0 / f64::from(n), "{counts:?}");
        }
    }

    /// The distribution function of a straight line, (s x + (e - s) x²/2) / ((s + e)/2), gives the number back.
    #[test]
    fn places_on_a_line_have_its_density() {
        for [start, end] in [[1.0, 3.0], [0.0, 2.0], [5.0, 0.0], [1.0, 1.0], [1e-12, 1.0]] {
            for k in 0..1_000 {
                let u = f64::from(k) / 1_000.0;
                let x = linear_place(u, [start, end]);
                let below = (start * x + 0.5 * (end - start) * x * x) / (0.5 * (start + end));
                // Some roundings, and one of a root where the density begins at 0.
                assert!((below - u).abs() < 1e-14, "{start} {end} at {u}: {below}");
            }
        }
        assert_eq!(linear_place(0.25, [0.0, 0.0]), 0.25);
    }

    #[test]
    fn directions_have_the_mean_of_their_density() {
        let n = 256;
        let grid = (0..n * n).map(|k| {
            [(f64::from(k % n) + 0.5) / f64::from(n), (f64::from(k / n) + 0.5) / f64::from(n)]
        });
        let (mut cosine, mut sphere, mut cone) = (0.0, DVec3::ZERO, 0.0);
        for square in grid {
            cosine += cosine_direction(square).z;
            sphere += sphere_direction(square);
            cone += cone_direction(square, 0.5).z;
        }
        let count = f64::from(n * n);
        // Midpoint rule: errors of 1/n², and of 1/n^1.5 where a root ends at the disk's edge.
        assert!((cosine / count - 2.0 / 3.0).abs() < 1e-3);
        assert!((sphere / count).length() < 1e-4);
        assert!((cone / count - 0.75).abs() < 1e-4);
    }
}
