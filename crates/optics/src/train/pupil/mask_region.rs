//! The part of a mask that the other rims leave visible from each point of the sensor.
//!
//! At nodes over the sensor it is measured by rays aimed at the mask: its lowest and its highest place,
//! and the outermost visible places of lines between them. From the sensor's points between, these are
//! joined by straight lines. A point is drawn in two steps: a line of the mask from bands that hold what
//! is visible from anywhere in an interval of the sensor, then a place of the line between its own two
//! ends, so that bands cost no rays.

#![expect(clippy::cast_precision_loss, reason = "grids of a few dozen places")]

mod points;

use std::f64::consts::PI;

use glam::DVec2;
use rayon::prelude::*;

use super::mask_cells::{MaskCells, RowSpan};
use super::mask_map::{MappedScene, NO_TERMS};
use crate::element::{Clip, LensRays, RayStatus};
use crate::train::Side;
use crate::train::aim::towards_lens;

/// Intervals between nodes over each side of the sensor. None of these is a setting: what they miss of a mask adds
/// noise and takes no light, as one sample in a hundred is drawn from the whole pupil.
const FILM: usize = 28;

/// Intervals between the lines of a node, even in the angle of a circle through their ends.
const LINES: usize = 32;

/// Parts of an interval over each side that have bands of their own, and bands of each.
const PARTS: usize = 3;
const BANDS: usize = 24;

/// Places of a first look over each side of the mask, and halvings of what is between two of them.
const GRID: usize = 24;
const HALVINGS: usize = 7;

/// Added around what is visible, as a share of the mask's size, to begin with; it grows by a half at the
/// nodes around random rays that find more, so many times at most.
const MARGIN: f64 = 0.002;
const ROUNDS: u32 = 9;

/// Random rays that look for more.
const CHECKS: u32 = 1 << 15;

/// Visible region of a mask, for all places of the sensor.
#[derive(Debug, Clone)]
pub(super) struct MaskRegion {
    half_size: DVec2,
    nodes: Vec<Visibility>,
    intervals: Vec<Option<Interval>>,
}

/// Visible part of a mask from one node.
#[derive(Debug, Clone)]
enum Visibility {
    Nothing,
    /// No rim is in the way.
    All,
    Part(Box<Chords>),
}

/// Ends of lines across what is visible (mm).
#[derive(Debug, Clone)]
struct Chords {
    /// The lowest and the highest line.
    heights: [f64; 2],
    ends: [[f64; 2]; LINES + 1],
    /// Margin added around the lines, as a share of the mask's size.
    margin: f64,
}

/// Sampling of points for an interval of the sensor.
#[derive(Debug, Clone)]
struct Interval {
    /// From the lowest to the highest.
    bands: Vec<RowSpan>,
    mass: f64,
    /// True if the ends of lines are those of the sensor's own point.
    is_cut: bool,
}

impl Chords {
    /// The share of the way through the lines at a height, as an angle over π.
    fn turn(&self, y: f64) -> Option<f64> {
        let [low, high] = self.heights;
        let cosine = (low + high - 2.0 * y) / (high - low);
        (cosine.abs() <= 1.0).then(|| cosine.acos() / PI)
    }

    fn ends(&self, turn: f64) -> [f64; 2] {
        let (line, share) = split(turn, LINES);
        std::array::from_fn(|i| {
            let [a, b] = [self.ends[line][i], self.ends[line + 1][i]];
            a + share * (b - a)
        })
    }
}

impl MaskRegion {
    /// Finds what is visible of a mask's cells by rays of any of the maps.
    pub(super) fn new(scenes: &[MappedScene<'_>], cells: &MaskCells) -> Option<Self> {
        let MappedScene { scene, .. } = scenes.first()?;
        let mut region =
            Self { half_size: scene.half_size, nodes: Vec::new(), intervals: Vec::new() };
        let bounds = cells.bounds();
        region.nodes = (0..(FILM + 1) * (FILM + 1))
            .into_par_iter()
            .map(|node| {
                let at = DVec2::new((node % (FILM + 1)) as f64, (node / (FILM + 1)) as f64);
                let film = (2.0 * at / FILM as f64 - 1.0) * scene.half_size;
                let [low, high] = bounds;
                MaskRays { scenes, film, low, high }.seen()
            })
            .collect();
        for _ in 0..ROUNDS {
            let missed = region.missed(scenes, bounds);
            if missed.is_empty() {
                break;
            }
            for node in missed {
                if let Visibility::Part(chords) = &mut region.nodes[node] {
                    chords.margin *= 1.5;
                }
            }
        }
        let side = FILM * PARTS;
        region.intervals =
            (0..side * side).into_par_iter().map(|i| region.interval(i, cells)).collect();
        region.intervals.iter().any(Option::is_some).then_some(region)
    }

    fn corners(interval: usize) -> [usize; 4] {
        let first = interval / FILM * (FILM + 1) + interval % FILM;
        [first, first + 1, first + FILM + 1, first + FILM + 2]
    }

    /// Visible part between nodes, joined by straight lines; `None` unless all four have ends. Where they
    /// have none, all of the mask is aimed at.
    fn joined(&self, view: &FilmCell) -> Option<Chords> {
        let mut joined = Chords { heights: [0.0; 2], ends: [[0.0; 2]; LINES + 1], margin: 0.0 };
        for (node, weight) in view.corners.into_iter().zip(view.weights) {
            let Visibility::Part(chords) = &self.nodes[node] else { return None };
            joined.margin += weight * chords.margin;
            for i in 0..2 {
                joined.heights[i] += weight * chords.heights[i];
                for (sum, own) in joined.ends.iter_mut().zip(&chords.ends) {
                    sum[i] += weight * own[i];
                }
            }
        }
        Some(joined)
    }

    /// The bands of a part of an interval of the sensor; `None` when nothing is visible from the interval's
    /// corners.
    fn interval(&self, part: usize, cells: &MaskCells) -> Option<Interval> {
        let [low, high] = cells.bounds();
        let [column, row] = [part % (FILM * PARTS), part / (FILM * PARTS)];
        let corners = Self::corners(row / PARTS * FILM + column / PARTS);
        if corners.iter().all(|node| matches!(self.nodes[*node], Visibility::Nothing)) {
            return None;
        }
        let place = |i: usize| (i % PARTS) as f64 / PARTS as f64;
        let (x, y, side) = (place(column), place(row), 1.0 / PARTS as f64);
        let ends = [[x, y], [x + side, y], [x, y + side], [x + side, y + side]];
        let parts: Vec<Chords> =
            ends.iter().filter_map(|at| self.joined(&FilmCell::new(corners, *at))).collect();
        let is_cut = parts.len() == ends.len();
        let least = |of: &dyn Fn(&Chords) -> f64| parts.iter().map(of).fold(f64::MAX, f64::min);
        let most = |of: &dyn Fn(&Chords) -> f64| parts.iter().map(of).fold(f64::MIN, f64::max);
        let margin = most(&|c| c.margin).max(0.0) * (high - low);
        let (bottom, top) = match is_cut {
            true => (least(&|c| c.heights[0]) - margin.y, most(&|c| c.heights[1]) + margin.y),
            false => (low.y, high.y),
        };
        let mut bands = Vec::new();
        let count = if is_cut { BANDS } else { 1 };
        let (first, end) = (cells.row_at(bottom), cells.row_at(top) + 1);
        let mut from = first;
        for band in 1..=count {
            let until = bottom + (top - bottom) * band as f64 / count as f64;
            let to = if band == count { end } else { cells.row_at(until).max(from) };
            if to == from {
                continue;
            }
            let heights = [cells.line(from), cells.line(to)];
            let ends = match is_cut {
                true => {
                    // The widest of the lines in the band, and of those beside it.
                    let (mut left, mut right) = (f64::MAX, f64::MIN);
                    for chords in &parts {
                        let [bottom, top] = chords.heights;
                        let turn = |y: f64| chords.turn(y.clamp(bottom, top)).unwrap_or(0.5);
                        let [a, b] = heights.map(turn);
                        for step in 0..=8 {
                            let [x0, x1] = chords.ends(a + (b - a) * f64::from(step) / 8.0);
                            (left, right) = (left.min(x0), right.max(x1));
                        }
                    }
                    let slack = margin.x;
                    [left - slack, right + slack]
                }
                false => [low.x, high.x],
            };
            let rows = cells.rows(cells.columns(ends), from, to);
            if rows.mass > 0.0 {
                bands.push(rows);
            }
            from = to;
        }
        let mass: f64 = bands.iter().map(|band| band.mass).sum();
        (mass > 0.0).then_some(Interval { bands, mass, is_cut })
    }
}

/// The corners of an interval of the sensor, and their weights.
struct FilmCell {
    corners: [usize; 4],
    weights: [f64; 4],
}

impl FilmCell {
    /// At shares of the interval's sides.
    fn new(corners: [usize; 4], [right, down]: [f64; 2]) -> Self {
        let (left, up) = (1.0 - right, 1.0 - down);
        Self { corners, weights: [left * up, right * up, left * down, right * down] }
    }
}

/// The interval of `count` that holds a share, and the share of it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a few dozen intervals"
)]
fn split(share: f64, count: usize) -> (usize, f64) {
    let at = share * count as f64;
    let low = (at as usize).min(count - 1);
    (low, at - low as f64)
}

/// Rays from a point of the sensor towards points of the mask, at any of the wavelengths.
struct MaskRays<'a> {
    scenes: &'a [MappedScene<'a>],
    /// The point of the sensor (mm).
    film: DVec2,
    /// The corners of what is looked at (mm).
    low: DVec2,
    high: DVec2,
}

impl MaskRays<'_> {
    /// True for each point of the mask (mm) that is visible.
    fn passes(&self, places: &[DVec2]) -> Vec<bool> {
        let mut passed = vec![false; places.len()];
        for MappedScene { scene, map } in self.scenes {
            let mut room = NO_TERMS;
            let Some(local) = map.at(self.film, &mut room) else { continue };
            let start = scene.sensor.point(self.film.extend(0.0));
            let mut rays = LensRays::with_capacity(places.len());
            for &place in places {
                rays.push(start, towards_lens(local.slopes(place).0));
            }
            scene.lens.trace(Side::Sensor, Clip::On, &mut rays);
            let exited = (0..rays.len()).map(|i| rays.status(i) == RayStatus::Exited);
            passed.iter_mut().zip(exited).for_each(|(any, one)| *any |= one);
        }
        passed
    }

    /// A place of the grid of a first look.
    fn place(&self, column: f64, row: f64) -> DVec2 {
        self.low + DVec2::new(column, row) / GRID as f64 * (self.high - self.low)
    }

    /// y just outside of what is visible, on the way from a visible place.
    fn edge(&self, mut inside: DVec2, mut outside: DVec2) -> f64 {
        for _ in 0..HALVINGS {
            let between = 0.5 * (inside + outside);
            if self.passes(&[between])[0] { inside = between } else { outside = between }
        }
        outside.y.clamp(self.low.y, self.high.y)
    }

    /// Visible part of the mask; all, where nobody knows.
    fn seen(&self) -> Visibility {
        let mut room = NO_TERMS;
        if self.scenes.iter().all(|of| of.map.at(self.film, &mut room).is_none()) {
            return Visibility::All;
        }
        let grid: Vec<DVec2> = (0..(GRID + 1) * (GRID + 1))
            .map(|i| self.place((i % (GRID + 1)) as f64, (i / (GRID + 1)) as f64))
            .collect();
        let passed = self.passes(&grid);
        if passed.iter().all(|passed| *passed) {
            return Visibility::All;
        }
        let mut lit =
            passed.chunks_exact(GRID + 1).enumerate().filter(|(_, row)| row.contains(&true));
        let Some((first, bottom_row)) = lit.next() else { return Visibility::Nothing };
        let (last, top_row) = lit.next_back().unwrap_or((first, bottom_row));
        // The lowest and the highest place are looked for below and above the middle of the outermost rows
        // that are visible.
        let middle = |row: &[bool]| {
            let lit = || row.iter().enumerate().filter(|(_, lit)| **lit).map(|(i, _)| i as f64);
            0.5 * (lit().next().unwrap_or(0.0) + lit().next_back().unwrap_or(0.0))
        };
        let from_row = |row: usize, cells: &[bool], step: f64| {
            let column = middle(cells);
            self.edge(self.place(column, row as f64), self.place(column, row as f64 + step))
        };
        let heights = [from_row(first, bottom_row, -1.0), from_row(last, top_row, 1.0)];
        match self.ends(heights) {
            Some(ends) if heights[1] > heights[0] => {
                Visibility::Part(Box::new(Chords { heights, ends, margin: MARGIN }))
            }
            Some(_) | None => Visibility::All,
        }
    }

    /// Ends of the lines between two heights: the outermost visible of places along them, by halves; `None`
    /// when nothing is visible on any.
    fn ends(&self, [bottom, top]: [f64; 2]) -> Option<[[f64; 2]; LINES + 1]> {
        let along = |line: usize, i: usize| {
            let cosine = (PI * line as f64 / LINES as f64).cos();
            let y = 0.5 * (bottom + top - cosine * (top - bottom));
            DVec2::new(self.place(i as f64, 0.0).x, y)
        };
        let scan: Vec<DVec2> =
            (0..(LINES + 1) * (GRID + 1)).map(|i| along(i / (GRID + 1), i % (GRID + 1))).collect();
        let scanned = self.passes(&scan);
        let mut ends = [[f64::NAN; 2]; LINES + 1];
        let mut brackets = Vec::new();
        for (line, row) in scanned.chunks_exact(GRID + 1).enumerate() {
            let Some(left) = row.iter().position(|lit| *lit) else { continue };
            let right = row.iter().rposition(|lit| *lit).unwrap_or(left);
            ends[line] = [along(line, left).x, along(line, right).x];
            if left > 0 {
                brackets.push((line, 0, along(line, left), along(line, left - 1)));
            }
            if right < GRID {
                brackets.push((line, 1, along(line, right), along(line, right + 1)));
            }
        }
        for _ in 0..HALVINGS {
            let middles: Vec<DVec2> = (brackets.iter())
                .map(|(_, _, inside, outside)| 0.5 * (*inside + *outside))
                .collect();
            for ((_, _, inside, outside), (between, passed)) in
                brackets.iter_mut().zip(middles.iter().zip(self.passes(&middles)))
            {
                if passed { *inside = *between } else { *outside = *between }
            }
        }
        for (line, end, _, outside) in brackets {
            ends[line][end] = outside.x;
        }
        // Lines on which no place of the grid is visible are as their neighbours towards the middle.
        for line in (0..LINES / 2).rev().chain(LINES / 2 + 1..=LINES) {
            if ends[line][0].is_nan() {
                let inner = if line < LINES / 2 { line + 1 } else { line - 1 };
                ends[line] = ends[inner];
            }
        }
        ends.iter().flatten().all(|end| end.is_finite()).then_some(ends)
    }
}
