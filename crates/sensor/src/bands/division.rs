//! Bands divided until they are good, and joined where they stay so.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use super::table::BandTable;

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
