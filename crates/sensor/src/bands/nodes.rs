//! Cells of wavelengths, and integrals over them.

use etendue_spectrum::Curve;

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
