//! The grid that lenslets stand on: which cell a point lies in, by arithmetic.
//!
//! A square grid has its nodes at pitch (i, j). A hexagonal one has rows a distance pitch √3/2 apart,
//! each moved by half a pitch against the row before: nodes at pitch (i + j/2, j √3/2). It is two
//! rectangular grids, one between the nodes of the other, so the nearest node is the nearer of two that
//! are found by rounding.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// √3.
const ROOT3: f64 = 1.732_050_807_568_877_2;

/// Packing of lenslets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "LensletGrid")]
pub enum Grid {
    /// In columns and rows.
    #[default]
    Square,
    /// In rows that are moved by half a pitch against each other, six neighbours around each.
    Hexagonal,
}

/// A grid in the plane of its array (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// Packing of the lenslets.
    pub grid: Grid,
    /// From a lenslet's centre to its next neighbour's.
    pub pitch: f64,
    /// Cosine and sine of the turn of the rows from +x towards +y.
    pub turn: [f64; 2],
    /// The centre of lenslet (0, 0).
    pub offset: [f64; 2],
}

/// Cell of the lattice that holds a point, and the point's place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeCell {
    /// Index of the cell: steps along the rows, and rows. In a hexagonal grid a row begins half a
    /// pitch further than the one before.
    pub index: [f64; 2],
    /// From the cell's centre to the point, along the rows and across them (mm).
    pub local: [f64; 2],
    /// From the cell's centre to the point, in the array's own axes (mm).
    pub away: [f64; 2],
}

/// The nearest whole number, halves up: `f64::round` has no vector instruction.
#[inline(always)]
fn nearest(x: f64) -> f64 {
    (x + 0.5).floor()
}

impl Lattice {
    /// The cell of a point of the plane (mm).
    #[must_use]
    pub fn cell(&self, x: f64, y: f64) -> LatticeCell {
        self.cell_of(self.grid, x, y)
    }

    /// Variant of [`Self::cell`] with a packing that the compiler knows.
    #[inline(always)]
    pub(crate) fn cell_of(&self, grid: Grid, x: f64, y: f64) -> LatticeCell {
        let [c, s] = self.turn;
        let (x, y) = (x - self.offset[0], y - self.offset[1]);
        let scale = 1.0 / self.pitch;
        let (u, v) = ((c * x + s * y) * scale, (c * y - s * x) * scale);
        let (index, local) = match grid {
            Grid::Square => {
                let (i, j) = (nearest(u), nearest(v));
                ([i, j], [u - i, v - j])
            }
            Grid::Hexagonal => {
                let even = [nearest(u), nearest(v * (1.0 / ROOT3))];
                let odd = [nearest(u - 0.5), nearest(v * (1.0 / ROOT3) - 0.5)];
                let a = [u - even[0], v - ROOT3 * even[1]];
                let b = [u - odd[0] - 0.5, v - ROOT3 * (odd[1] + 0.5)];
                let first = a[0] * a[0] + a[1] * a[1] <= b[0] * b[0] + b[1] * b[1];
                let (m, local, extra) = if first { (even, a, 0.0) } else { (odd, b, 1.0) };
                ([m[0] - m[1], 2.0 * m[1] + extra], local)
            }
        };
        let local = [local[0] * self.pitch, local[1] * self.pitch];
        let away = [c * local[0] - s * local[1], s * local[0] + c * local[1]];
        LatticeCell { index, local, away }
    }

    /// True if a point (mm from a cell's centre, in the array's own axes) is of this cell, whatever
    /// rounding does: some that are, 10⁻⁹ of the pitch within its border, are not told.
    #[inline(always)]
    pub(crate) fn is_well_inside(&self, grid: Grid, x: f64, y: f64) -> bool {
        let [c, s] = self.turn;
        let (u, v) = (c * x + s * y, c * y - s * x);
        let half = self.pitch * (0.5 - 1e-9);
        match grid {
            Grid::Square => u.abs().max(v.abs()) <= half,
            // Two edges across the rows, and four at 60° to them.
            Grid::Hexagonal => (u.abs() <= half) & (0.5 * u.abs() + 0.5 * ROOT3 * v.abs() <= half),
        }
    }

    /// The centre of a cell (mm).
    #[must_use]
    pub fn centre(&self, index: [f64; 2]) -> [f64; 2] {
        let [i, j] = index;
        let [u, v] = match self.grid {
            Grid::Square => [i, j],
            Grid::Hexagonal => [i + 0.5 * j, 0.5 * ROOT3 * j],
        };
        let away = self.turned([u * self.pitch, v * self.pitch]);
        [self.offset[0] + away[0], self.offset[1] + away[1]]
    }

    /// A vector along and across the rows in the array's own axes.
    #[must_use]
    pub fn turned(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turn;
        [c * u - s * v, s * u + c * v]
    }

    /// The cells whose centres lie within `reach` (mm) of a point, and perhaps some more.
    pub fn cells_near(
        &self,
        [x, y]: [f64; 2],
        reach: f64,
    ) -> impl Iterator<Item = [f64; 2]> + use<> {
        let [c, s] = self.turn;
        let (x, y) = (x - self.offset[0], y - self.offset[1]);
        let (u, v) = ((c * x + s * y) / self.pitch, (c * y - s * x) / self.pitch);
        let reach = reach / self.pitch;
        let grid = self.grid;
        let height = match grid {
            Grid::Square => 1.0,
            Grid::Hexagonal => 0.5 * ROOT3,
        };
        steps((v - reach) / height, (v + reach) / height).flat_map(move |j| {
            let shift = match grid {
                Grid::Square => 0.0,
                Grid::Hexagonal => 0.5 * j,
            };
            steps(u - reach - shift, u + reach - shift).map(move |i| [i, j])
        })
    }

    /// The corners of a cell around its centre, along and across the rows (mm), turning from + to +.
    #[must_use]
    pub fn cell_corners(&self) -> Vec<[f64; 2]> {
        match self.grid {
            Grid::Square => regular(4, 0.5 * self.pitch, 0.0),
            Grid::Hexagonal => regular(6, 0.5 * self.pitch, 0.0),
        }
    }
}

/// The whole numbers from `from` to `to`.
fn steps(from: f64, to: f64) -> impl Iterator<Item = f64> {
    let (first, last) = (from.ceil(), to.floor());
    std::iter::successors(Some(first), |i| Some(i + 1.0)).take_while(move |i| *i <= last)
}

/// The corners of a regular polygon by the distance of its edges, the first edge's normal at `angle`.
pub(crate) fn regular(edges: u32, apothem: f64, angle: f64) -> Vec<[f64; 2]> {
    let step = std::f64::consts::TAU / f64::from(edges);
    let radius = apothem / (0.5 * step).cos();
    let corner = |i: u32| angle + (f64::from(i) + 0.5) * step;
    (0..edges).map(|i| [radius * corner(i).cos(), radius * corner(i).sin()]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(grid: Grid, rotation: f64) -> Lattice {
        let (s, c) = f64::to_radians(rotation).sin_cos();
        Lattice { grid, pitch: 0.3, turn: [c, s], offset: [0.07, -0.02] }
    }

    /// Against a search over all nodes around, on 10⁴ points in two grids and three turns.
    #[test]
    fn the_cell_by_arithmetic_is_that_of_the_nearest_node() {
        for grid in [Grid::Square, Grid::Hexagonal] {
            for rotation in [0.0, 13.0, 45.0] {
                let lattice = lattice(grid, rotation);
                for k in 0..10_000 {
                    let x = 4.0 * ((f64::from(k) * 0.754_877_666).fract() - 0.5);
                    let y = 4.0 * ((f64::from(k) * 0.569_840_291).fract() - 0.5);
                    let found = lattice.cell(x, y);
                    let distance = |index| {
                        let [cx, cy] = lattice.centre(index);
                        (x - cx).hypot(y - cy)
                    };
                    let near = lattice.cells_near([x, y], 0.35).map(distance);
                    let least = near.fold(f64::INFINITY, f64::min);
                    let [cx, cy] = lattice.centre(found.index);
                    assert!((distance(found.index) - least).abs() < 1e-12, "{grid:?} {x} {y}");
                    assert!((found.away[0] - (x - cx)).abs() < 1e-12, "{found:?}");
                    assert!((found.away[1] - (y - cy)).abs() < 1e-12, "{found:?}");
                    let is_inside =
                        |[cx, cy]: [f64; 2]| lattice.is_well_inside(grid, x - cx, y - cy);
                    assert!(is_inside([cx, cy]), "no point of these is on a border");
                    let others = lattice.cells_near([x, y], 0.35).filter(|one| *one != found.index);
                    assert!(!others.map(|one| lattice.centre(one)).any(is_inside), "{found:?}");
                }
            }
        }
    }

    #[test]
    fn a_hexagon_has_six_neighbours_at_the_pitch() {
        let lattice = lattice(Grid::Hexagonal, 20.0);
        let [x, y] = lattice.centre([2.0, -3.0]);
        let near: Vec<f64> = lattice
            .cells_near([x, y], 0.301)
            .map(|index| lattice.centre(index))
            .map(|[a, b]| (a - x).hypot(b - y))
            .filter(|d| *d < 0.301)
            .collect();
        assert_eq!(near.len(), 7, "itself and six: {near:?}");
        assert!(near.iter().all(|d| d.abs() < 1e-12 || (d - 0.3).abs() < 1e-12));
    }
}
