//! A mask's own pixels as a density that points are drawn from, within any rectangle of it.
//!
//! The grid's lines stand beside the edges of pixels, a margin before and a margin behind each, so that
//! cells are either of one pixel or around an edge; a cell has the greatest value of the pixels within a
//! margin of it. Edges between columns or rows that are equal have no lines. Sums over all rectangles
//! from a corner (F. Crow, "Summed-area tables for texture mapping", 1984) give the share of any
//! rectangle, and points in it by two searches.

#![expect(clippy::cast_precision_loss, reason = "masks of far fewer than 2⁵³ pixels")]

use glam::DVec2;

use crate::element::{Opening, Picture};
use crate::train::OpticalTrain;

/// The most lines along each direction: a table of 32 MiB.
const MOST_LINES: usize = 2048;

/// The least margin, as a share of a pixel: what roundings move a ray by.
const LEAST_MARGIN: f64 = 1e-6;

/// Of cells of many pixels, which there are when lines would be too many: the density where only some of
/// them pass, as a share of the greatest.
const PARTLY: f32 = 0.05;

/// Total mass of all cells: sums of whole numbers below 2⁵³ are exact, and so are their
/// differences.
const TOTAL: f64 = (1_u64 << 50) as f64;

/// The first mask that stops or dims anything.
pub(super) fn first_mask(train: &OpticalTrain) -> Option<(usize, &Picture)> {
    train.elements.iter().enumerate().find_map(|(i, element)| match element.part.opening()? {
        Opening::Image(mask) if mask.values.iter().any(|v| *v < 1.0) => Some((i, mask)),
        Opening::Image(_)
        | Opening::Circle { .. }
        | Opening::Polygon { .. }
        | Opening::Shaped(_) => None,
    })
}

/// The corners of the rectangle that holds what a mask passes (mm); `None` when it passes nothing.
pub(super) fn open_bounds(mask: &Picture) -> Option<[DVec2; 2]> {
    let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (i, _) in mask.values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
        let [low, high] = mask.bounds_of(i);
        (min, max) = (min.min(low), max.max(high));
    }
    let size = max - min;
    (size.min_element() > 0.0 && size.is_finite()).then_some([min, max])
}

/// Distance of the farthest open pixel from a point of the mask (mm).
pub(super) fn open_reach(mask: &Picture, from: DVec2) -> f64 {
    let open = mask.values.iter().enumerate().filter(|(_, value)| **value > 0.0);
    let farthest = open.map(|(i, _)| {
        let [low, high] = mask.bounds_of(i);
        (low - from).abs().max((high - from).abs()).length_squared()
    });
    farthest.fold(0.0, f64::max).sqrt()
}

/// The density.
#[derive(Debug, Clone)]
pub(super) struct MaskCells {
    /// Lines along x and along y, ascending (mm).
    lines: [Vec<f64>; 2],
    /// Sums of the cells below and to the left of each crossing of lines, by rows.
    sums: Vec<f64>,
}

/// A place between two lines.
#[derive(Debug, Clone, Copy)]
struct LinePlace {
    /// The interval of lines that holds it.
    interval: usize,
    /// The share of that which is before it.
    share: f64,
}

/// Columns from one place to another.
#[derive(Debug, Clone, Copy)]
pub(super) struct ColumnSpan([LinePlace; 2]);

/// Rows of some columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowSpan {
    columns: ColumnSpan,
    first: usize,
    last: usize,
    /// The sum before the first, and of all of them.
    before: f64,
    pub(super) mass: f64,
}

impl RowSpan {
    pub(super) fn columns(&self) -> ColumnSpan {
        self.columns
    }

    pub(super) fn holds(&self, row: usize) -> bool {
        (self.first..self.last).contains(&row)
    }
}

impl MaskCells {
    /// The density of a mask whose open pixels lie between `low` and `high` (mm), widened by `margin`
    /// (mm) around what is open.
    pub(super) fn new(mask: &Picture, bounds: [DVec2; 2], margin: DVec2) -> Option<Self> {
        let pixel = DVec2::from(mask.size) / DVec2::from(mask.pixels.map(|n| n as f64));
        let margin = margin.max(LEAST_MARGIN * pixel);
        let [x, y] = [0, 1].map(|axis| GridLines::new(mask, bounds, margin, axis));
        let exact = x.is_exact && y.is_exact;
        // Columns first, then rows: the greatest and the mean of what is near a cell.
        let [columns, rows] = mask.pixels;
        let (wide, high) = (x.lines.len() - 1, y.lines.len() - 1);
        let used = y.near.iter().fold([rows, 0], |[a, b], near| [a.min(near[0]), b.max(near[1])]);
        let mut by_row = vec![[0.0_f32; 2]; wide * (used[1] - used[0])];
        for (line, pixels) in by_row.chunks_exact_mut(wide).zip(used[0]..) {
            let pixels = &mask.values[pixels * columns..][..columns];
            for (cell, near) in line.iter_mut().zip(&x.near) {
                *cell = greatest_and_mean(pixels[near[0]..near[1]].iter().copied());
            }
        }
        let mut density = vec![0.0; wide * high];
        for (row, near) in y.near.iter().enumerate() {
            for column in 0..wide {
                let of = |i: usize| by_row[(i - used[0]) * wide + column];
                let many = (near[0]..near[1]).map(|i| f64::from(of(i)[1]));
                let [_, mean] = greatest_and_mean(many);
                let most = (near[0]..near[1]).fold(0.0_f32, |most, i| most.max(of(i)[0]));
                let value = if exact { most } else { mean.max(PARTLY * most) };
                let area =
                    (x.lines[column + 1] - x.lines[column]) * (y.lines[row + 1] - y.lines[row]);
                density[row * wide + column] = f64::from(value) * area;
            }
        }
        let total: f64 = density.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut sums = vec![0.0; (wide + 1) * (high + 1)];
        for row in 0..high {
            let mut line = 0.0;
            for column in 0..wide {
                let mass = density[row * wide + column] / total * TOTAL;
                line += if mass > 0.0 { mass.round().max(1.0) } else { 0.0 };
                let at = (row + 1) * (wide + 1) + column + 1;
                sums[at] = sums[at - wide - 1] + line;
            }
        }
        Some(Self { lines: [x.lines, y.lines], sums })
    }

    /// The corners of all cells (mm).
    pub(super) fn bounds(&self) -> [DVec2; 2] {
        let [x, y] = &self.lines;
        [DVec2::new(x[0], y[0]), DVec2::new(x[x.len() - 1], y[y.len() - 1])]
    }

    /// The columns between two places (mm).
    pub(super) fn columns(&self, ends: [f64; 2]) -> ColumnSpan {
        ColumnSpan(ends.map(|x| locate(&self.lines[0], x)))
    }

    /// The rows between two places (mm), of some columns. They reach from line to line: `ends` that
    /// lie between lines are moved out to them.
    pub(super) fn rows(&self, columns: ColumnSpan, first: usize, last: usize) -> RowSpan {
        let before = self.sum(columns, first);
        RowSpan { columns, first, last, before, mass: self.sum(columns, last) - before }
    }

    /// The row that holds a place (mm).
    pub(super) fn row_at(&self, y: f64) -> usize {
        locate(&self.lines[1], y).interval
    }

    /// The place of a line below a row (mm).
    pub(super) fn line(&self, row: usize) -> f64 {
        self.lines[1][row]
    }

    /// y of the place (mm) up to which rows hold the share `v` of them, and its row.
    pub(super) fn draw_row(&self, rows: &RowSpan, v: f64) -> (f64, usize) {
        let target = rows.before + v * rows.mass;
        let (mut low, mut high) = (rows.first, rows.last);
        let (mut at_low, mut at_high) = (rows.before, rows.before + rows.mass);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            let there = self.sum(rows.columns, middle);
            if there <= target {
                (low, at_low) = (middle, there);
            } else {
                (high, at_high) = (middle, there);
            }
        }
        let share = ((target - at_low) / (at_high - at_low)).clamp(0.0, 1.0);
        let [from, to] = [self.lines[1][low], self.lines[1][low + 1]];
        (from + share * (to - from), low)
    }

    /// The sum over a row of some columns by the height of the row: per mm.
    pub(super) fn row_density(&self, columns: ColumnSpan, row: usize) -> f64 {
        (self.sum(columns, row + 1) - self.sum(columns, row))
            / (self.lines[1][row + 1] - self.lines[1][row])
    }

    /// x of the place (mm) up to which the columns of a row hold the share `u` of them, and the share
    /// that a millimetre has there; `None` where they hold nothing.
    pub(super) fn draw_column(
        &self,
        row: usize,
        columns: ColumnSpan,
        u: f64,
    ) -> Option<(f64, f64)> {
        let [from, to] = columns.0.map(|end| self.up_to(row, end));
        let target = from + u * (to - from);
        let (mut low, mut high) = (columns.0[0].interval, columns.0[1].interval + 1);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if self.of_row(row, middle) <= target { low = middle } else { high = middle }
        }
        let [at_low, at_high] = [self.of_row(row, low), self.of_row(row, low + 1)];
        let [left, right] = [self.lines[0][low], self.lines[0][low + 1]];
        let mass = at_high - at_low;
        if !(to > from && mass > 0.0) {
            return None;
        }
        let x = left + ((target - at_low) / mass).clamp(0.0, 1.0) * (right - left);
        Some((x, mass / (right - left) / (to - from)))
    }

    /// The share of the columns of a row that a millimetre has at `x` (mm).
    pub(super) fn column_density(&self, row: usize, columns: ColumnSpan, x: f64) -> f64 {
        let [from, to] = columns.0.map(|end| self.up_to(row, end));
        let low = locate(&self.lines[0], x).interval;
        let mass = self.of_row(row, low + 1) - self.of_row(row, low);
        if to > from {
            mass / (self.lines[0][low + 1] - self.lines[0][low]) / (to - from)
        } else {
            0.0
        }
    }

    /// The sum of some columns of all rows below a line.
    fn sum(&self, ColumnSpan(ends): ColumnSpan, line: usize) -> f64 {
        let sums = &self.sums[line * self.lines[0].len()..];
        let [from, to] =
            ends.map(|LinePlace { interval: i, share }| sums[i] + share * (sums[i + 1] - sums[i]));
        to - from
    }

    /// The sum of a row up to a column's left line.
    fn of_row(&self, row: usize, column: usize) -> f64 {
        let at = row * self.lines[0].len() + column;
        self.sums[at + self.lines[0].len()] - self.sums[at]
    }

    fn up_to(&self, row: usize, LinePlace { interval: column, share }: LinePlace) -> f64 {
        let [low, high] = [self.of_row(row, column), self.of_row(row, column + 1)];
        low + share * (high - low)
    }
}

/// The place of a number between ascending lines.
fn locate(lines: &[f64], at: f64) -> LinePlace {
    let i = lines.partition_point(|line| *line <= at).clamp(1, lines.len() - 1) - 1;
    let share = ((at - lines[i]) / (lines[i + 1] - lines[i])).clamp(0.0, 1.0);
    LinePlace { interval: i, share }
}

fn greatest_and_mean(values: impl Iterator<Item = f64>) -> [f32; 2] {
    let (mut most, mut sum, mut count) = (0.0_f64, 0.0, 0.0_f64);
    for value in values {
        (most, sum, count) = (most.max(value), sum + value, count + 1.0);
    }
    #[expect(clippy::cast_possible_truncation, reason = "a density needs no more digits")]
    [most, if count > 0.0 { sum / count } else { 0.0 }].map(|value| {
        // What passes a little is not left out.
        if value > 0.0 { (value as f32).max(f32::MIN_POSITIVE) } else { 0.0 }
    })
}

/// Lines along one direction.
struct GridLines {
    lines: Vec<f64>,
    /// Of each interval: the pixels within a margin of it, as the picture counts them.
    near: Vec<[usize; 2]>,
    /// True if no lines were left out.
    is_exact: bool,
}

impl GridLines {
    fn new(mask: &Picture, [low, high]: [DVec2; 2], margin: DVec2, axis: usize) -> Self {
        let count = mask.pixels[axis];
        let (size, margin) = (mask.size[axis], margin[axis]);
        let pixel = size / count as f64;
        // Edges in the order of the lines; rows of the picture are counted from +y.
        let edge = |k: usize| (k as f64 / count as f64 - 0.5) * size;
        let of_picture = |k: usize| if axis == 0 { k } else { count - 1 - k };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the number of pixels"
        )]
        let nearest =
            |x: f64| ((x / size + 0.5) * count as f64).round().clamp(0.0, count as f64) as usize;
        let (from, to) = (nearest(low[axis]), nearest(high[axis]));
        let mut edges: Vec<f64> = (from..=to)
            .filter(|&k| {
                k == from || k == to || !mask.are_equal(axis, of_picture(k - 1), of_picture(k))
            })
            .map(edge)
            .collect();
        let every = (2 * edges.len()).div_ceil(MOST_LINES);
        let last = edges.len() - 1;
        if every > 1 {
            edges = (edges.iter().copied().enumerate())
                .filter(|(i, _)| i % every == 0 || *i == last)
                .map(|(_, edge)| edge)
                .collect();
        }
        let mut lines: Vec<f64> =
            edges.iter().flat_map(|edge| [edge - margin, edge + margin]).collect();
        lines.sort_by(f64::total_cmp);
        lines.dedup();
        let near = lines
            .windows(2)
            .map(|ends| {
                // What only touches the margin is beside it.
                let slack = 1e-9 * pixel;
                let along = |x: f64| (x / size + 0.5) * count as f64;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped to the pixels"
                )]
                let [first, end] = [
                    along(ends[0] - margin + slack).floor().clamp(0.0, count as f64) as usize,
                    along(ends[1] + margin - slack).ceil().clamp(0.0, count as f64) as usize,
                ];
                let end = end.max(first);
                if axis == 0 { [first, end] } else { [count - end, count - first] }
            })
            .collect();
        Self { lines, near, is_exact: every == 1 }
    }
}

impl Picture {
    /// True if two columns (axis 0) or rows have the same values.
    fn are_equal(&self, axis: usize, a: usize, b: usize) -> bool {
        let [columns, rows] = self.pixels;
        if axis == 1 {
            return self.values[a * columns..][..columns] == self.values[b * columns..][..columns];
        }
        (0..rows).all(|row| self.values[row * columns + a] == self.values[row * columns + b])
    }
}
