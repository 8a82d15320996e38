//! Bands divided until they are good, and joined where they stay so.
//!
//! Cells of wavelengths, and integrals over them.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use super::BandTable;
use etendue_spectrum::Curve;

/// Bands beyond which nobody divides.
const MOST_BANDS: usize = 256;

/// Places at which a band's division is tried.
const PLACES: usize = 24;

/// The search for bands, which are runs of cells of a table.
pub(super) struct Division<'a> {
    table: &'a BandTable,
    /// Losses of each trial by bands: the same are asked for again and again.
    known: RefCell<HashMap<[usize; 2], Rc<[f64]>>>,
}

impl<'a> Division<'a> {
    pub(super) fn of(table: &'a BandTable) -> Self {
        Self { table, known: RefCell::default() }
    }

    /// Loss of each trial by a band.
    fn losses(&self, band: [usize; 2]) -> Rc<[f64]> {
        let mut known = self.known.borrow_mut();
        Rc::clone(known.entry(band).or_insert_with(|| self.table.losses(band).into()))
    }

    /// Loss of each trial by all bands together.
    fn totals(&self, cells: &[usize]) -> Vec<f64> {
        let mut totals = vec![0.0; self.table.trials.len()];
        for ends in cells.windows(2) {
            let losses = self.losses([ends[0], ends[1]]);
            totals.iter_mut().zip(&*losses).for_each(|(total, lost)| *total += lost);
        }
        totals
    }

    /// The most that any trial is off in all bands together.
    pub(super) fn worst(&self, cells: &[usize]) -> f64 {
        most(self.totals(cells))
    }

    /// Bands divided until they are good, and joined where they stay so; `fixed` edges stay.
    pub(super) fn divided(&self, fixed: &[usize], tolerance: f64) -> Vec<usize> {
        let mut cells = fixed.to_vec();
        while cells.len() <= MOST_BANDS && self.worst(&cells) > tolerance {
            let pairs = cells.windows(2).filter(|ends| ends[1] - ends[0] > 1);
            let bands = pairs.map(|ends| [ends[0], ends[1]]);
            let lossy = bands.map(|band| (most(self.losses(band).iter().copied()), band));
            let Some((_, band)) = lossy.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let cut = self.best_cut(band);
            cells.insert(cells.partition_point(|cell| *cell < cut), cut);
        }
        let limit = self.worst(&cells).max(tolerance);
        self.joined(cells, fixed, limit)
    }

    /// Finds where to divide a band so that the worse of its halves is best.
    fn best_cut(&self, [a, b]: [usize; 2]) -> usize {
        let places = (b - a - 1).min(PLACES);
        let cuts = (1..=places).map(|i| a + ((b - a) * i).div_ceil(places + 1).clamp(1, b - a - 1));
        let loss = |cut: usize| {
            let [first, second] = [self.losses([a, cut]), self.losses([cut, b])];
            most(first.iter().zip(&*second).map(|(first, second)| first.abs() + second.abs()))
        };
        cuts.map(|cut| (loss(cut), cut))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(a + (b - a) / 2, |(_, cut)| cut)
    }

    /// Bands joined as long as that keeps the worst error below a limit.
    fn joined(&self, mut cells: Vec<usize>, fixed: &[usize], limit: f64) -> Vec<usize> {
        let mut totals = self.totals(&cells);
        loop {
            // The totals without an edge.
            let without = |i: usize| {
                let [a, b, c] = [cells[i - 1], cells[i], cells[i + 1]];
                let [both, first, second] = [[a, c], [a, b], [b, c]].map(|band| self.losses(band));
                let change = |k: usize| both[k] - first[k] - second[k];
                totals.iter().enumerate().map(|(k, total)| total + change(k)).collect::<Vec<f64>>()
            };
            let free = (1..cells.len() - 1).filter(|&i| !fixed.contains(&cells[i]));
            let choices = free.map(|i| (i, without(i)));
            let rated = choices.map(|(i, totals)| (most(totals.iter().copied()), i, totals));
            let best = rated.min_by(|a, b| a.0.total_cmp(&b.0));
            match best.filter(|(worst, ..)| *worst <= limit) {
                Some((_, i, after)) => {
                    totals = after;
                    cells.remove(i);
                }
                None => return cells,
            }
        }
    }
}

/// The largest of some errors, whatever their sign.
fn most(errors: impl IntoIterator<Item = f64>) -> f64 {
    errors.into_iter().map(f64::abs).fold(0.0, f64::max)
}

/// The steps of the integration (nm), at most.
const STEP: f64 = 1.0;

/// Steps over all of the light, at least.
const CELLS: f64 = 400.0;

/// Steps from one sample of a curve to the next, at least: edges of filters are steep.
const FINE: f64 = 4.0;

/// Sums of something over all cells before each edge.
pub(super) type RunningSums = Vec<f64>;

pub(super) fn product(factors: &[&[f64]]) -> Vec<f64> {
    let count = factors.first().map_or(0, |factor| factor.len());
    (0..count).map(|i| factors.iter().map(|factor| factor[i]).product()).collect()
}

/// Edges of cells at most [`STEP`] wide, between which curves are straight.
pub(super) fn cell_edges(curves: &[&Curve], [from, to]: [f64; 2], fixed: &[f64]) -> Vec<f64> {
    let samples = curves.iter().flat_map(|curve| curve.samples()).map(|sample| sample[0]);
    let mut knots: Vec<f64> = samples.chain(fixed.iter().copied()).collect();
    knots.retain(|nm| *nm > from && *nm < to);
    knots.extend([from, to]);
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    // As fine for a narrow line as for all visible light.
    let step = STEP.min((to - from) / CELLS);
    let mut edges = vec![from];
    for ends in knots.windows(2) {
        let [a, b] = [ends[0], ends[1]];
        let parts = ((b - a) / step).ceil().clamp(FINE, 1e5);
        let mut k = 1.0;
        while k < parts {
            edges.push(a + (b - a) * (k / parts));
            k += 1.0;
        }
        edges.push(b);
    }
    edges
}

/// Two places in each cell, at which functions are evaluated: Gauss' rule, exact for cubics.
pub(super) struct Nodes {
    pub(super) nm: Vec<f64>,
    /// Half the width of each cell (nm).
    half: Vec<f64>,
}

impl Nodes {
    pub(super) fn of(edges: &[f64]) -> Self {
        let cells = edges.windows(2).map(|e| (0.5 * (e[0] + e[1]), 0.5 * (e[1] - e[0])));
        let offset = 1.0 / 3.0_f64.sqrt();
        let nm = cells.clone().flat_map(|(mid, half)| [mid - half * offset, mid + half * offset]);
        Self { nm: nm.collect(), half: cells.map(|(_, half)| half).collect() }
    }

    pub(super) fn at(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        self.nm.iter().map(|&nm| f(nm)).collect()
    }

    /// Integrals of a product over all cells before each edge.
    pub(super) fn sums(&self, factors: &[&[f64]]) -> RunningSums {
        let values = product(factors);
        let mut sums = Vec::with_capacity(self.half.len() + 1);
        let mut sum = 0.0;
        sums.push(sum);
        for (pair, half) in values.as_chunks::<2>().0.iter().zip(&self.half) {
            sum += half * (pair[0] + pair[1]);
            sums.push(sum);
        }
        sums
    }

    /// Factors by which all functions bring the same when weighted; 0 for those that bring nothing.
    pub(super) fn scales(&self, functions: &[Vec<f64>], weight: &[f64]) -> Vec<f64> {
        let total = |f: &Vec<f64>| self.sums(&[f, weight]).last().copied().unwrap_or(0.0);
        let scale = |total: f64| if total > 0.0 { 1.0 / total } else { 0.0 };
        functions.iter().map(|function| scale(total(function))).collect()
    }

    /// The function through its values at the places.
    pub(super) fn curve(&self, values: &[f64]) -> Option<Curve> {
        Curve::sampled(self.nm.iter().zip(values).map(|(&nm, &value)| [nm, value]).collect()).ok()
    }
}
