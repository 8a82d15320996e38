//! Wavelengths that the rays of all bands are traced at, and polynomials between them.

use etendue_optics::analysis::least_squares::LeastSquares;
use etendue_optics::element::LANES;
use etendue_optics::train::OpticalTrain;
use glam::DVec2;

type Row = [f64; LANES];

/// The most wavelengths that a ray is traced at.
pub(super) const MOST_NODES: usize = 8;

/// Limits within which the rays of bands are interpolated between those of some wavelengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharingLimits {
    /// The greatest distance of an interpolated place from the traced one (pixels).
    pub places: f64,
    /// The greatest difference of what the lens passes (share of the light), where it takes some.
    pub shares: f64,
}

impl SharingLimits {
    /// Those of a scene that does not say.
    pub const DEFAULT: Self = Self { places: 0.01, shares: 1e-4 };
}

/// A wavelength between nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct NodeWeights {
    /// Weight of each node.
    pub(super) weights: [f64; MOST_NODES],
    /// Weight of the [`NextTerm`].
    pub(super) next: f64,
    /// Transmission of the filters.
    pub(super) filters: f64,
}

/// Weights between nodes by place in the spectrum, of all bands side by side.
#[derive(Debug)]
pub(super) struct BandWeights {
    bands: usize,
    /// Places in the spectrum where some band's wavelength gives way to its next.
    ends: Vec<f64>,
    /// `[stretch][row][band]`, the rows being the nodes, the [`NextTerm`] and the filters.
    rows: Vec<f64>,
    /// Length of a stretch of `rows`.
    stretch: usize,
}

impl BandWeights {
    /// Those of bands, by the wavelengths that each is drawn from, between so many nodes.
    pub(super) fn of(bands: &[Vec<NodeWeights>], nodes: usize) -> Self {
        let ends_of = |count: usize| (1..count).map(move |k| k as f64 / count as f64);
        let mut ends: Vec<f64> = bands.iter().flat_map(|own| ends_of(own.len())).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        let edges: Vec<f64> = [0.0].into_iter().chain(ends.iter().copied()).chain([1.0]).collect();
        let mut rows = Vec::new();
        for stretch in edges.windows(2) {
            let middle = 0.5 * (stretch[0] + stretch[1]);
            let own = |band: &Vec<NodeWeights>| band[place_of(middle, band.len())];
            let own: Vec<NodeWeights> = bands.iter().map(own).collect();
            for node in 0..nodes {
                rows.extend(own.iter().map(|band| band.weights[node]));
            }
            rows.extend(own.iter().map(|band| band.next));
            rows.extend(own.iter().map(|band| band.filters));
        }
        Self { bands: bands.len(), ends, rows, stretch: (nodes + 2) * bands.len() }
    }

    /// The number of bands.
    pub(super) fn bands(&self) -> usize {
        self.bands
    }

    /// The rows of the bands at a place of the spectrum.
    #[inline(always)]
    pub(super) fn at(&self, u: f64) -> &[f64] {
        let mut stretch = 0;
        for &end in &self.ends {
            stretch += usize::from(u >= end);
        }
        &self.rows[stretch * self.stretch..][..self.stretch]
    }
}

/// Index of the one of `count` equal parts of 0..1 in which a number lies.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most a few dozen lenses"
)]
pub(super) fn place_of(u: f64, count: usize) -> usize {
    ((u * count as f64) as usize).min(count - 1)
}

/// Bounds of the weights of all wavelengths between nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct WeightBounds {
    /// The least and the greatest weight of each node.
    nodes: [[f64; 2]; MOST_NODES],
    /// Those of the [`NextTerm`].
    next: [f64; 2],
    /// Those of what filters pass.
    filters: [f64; 2],
    /// The greatest sum of the weights' amounts.
    amounts: f64,
}

/// Roundings of a place among some ten thousand pixels, and a little more (pixels).
const ROUNDINGS: f64 = 1e-6;

impl WeightBounds {
    /// Those of `all` weights.
    pub(super) fn of<'w>(all: impl Iterator<Item = &'w NodeWeights>) -> Self {
        const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];
        let nodes = [NOTHING; MOST_NODES];
        let mut bounds = Self { nodes, next: NOTHING, filters: NOTHING, amounts: 0.0 };
        let widen = |[low, high]: &mut [f64; 2], weight: f64| {
            (*low, *high) = (low.min(weight), high.max(weight));
        };
        for NodeWeights { weights, next, filters } in all {
            bounds.nodes.iter_mut().zip(weights).for_each(|(own, &weight)| widen(own, weight));
            widen(&mut bounds.next, *next);
            widen(&mut bounds.filters, *filters);
            let amounts = weights.iter().map(|weight| weight.abs()).sum();
            bounds.amounts = bounds.amounts.max(amounts);
        }
        bounds
    }

    /// Factor at most by which errors of the places at nodes grow between them.
    pub(super) fn magnified(&self) -> f64 {
        self.amounts
    }

    /// True if filters pass all light.
    pub(super) fn are_unfiltered(&self) -> bool {
        self.filters == [1.0; 2]
    }

    /// The low and the high corners of rectangles in which rays land at all wavelengths, by where they land at the nodes
    /// and by their [`NextTerm`] (pixels).
    #[inline(always)]
    pub(super) fn corners(&self, places: &[[Row; 2]], next: &[Row; 2]) -> [[Row; 2]; 2] {
        let [mut low, mut high] = [places[0]; 2];
        for axis in 0..2 {
            let (low, high) = (&mut low[axis], &mut high[axis]);
            for i in 0..LANES {
                low[i] -= ROUNDINGS;
                high[i] += ROUNDINGS;
            }
            // Weights of nodes add up to 1.
            for (place, weights) in places.iter().zip(&self.nodes).skip(1) {
                let [least, most] = *weights;
                for i in 0..LANES {
                    let by = place[axis][i] - places[0][axis][i];
                    let (a, b) = (by * least, by * most);
                    low[i] += if a < b { a } else { b };
                    high[i] += if a < b { b } else { a };
                }
            }
            let [least, most] = self.next;
            for i in 0..LANES {
                let (a, b) = (next[axis][i] * least, next[axis][i] * most);
                low[i] += if a < b { a } else { b };
                high[i] += if a < b { b } else { a };
            }
        }
        [low, high]
    }
}

/// Variable in which places are polynomials.
pub(super) struct Variable<'a> {
    train: &'a OpticalTrain,
}

impl<'a> Variable<'a> {
    pub(super) fn of(train: &'a OpticalTrain) -> Self {
        Self { train }
    }

    /// The mean index of the dispersive media at a wavelength (nm); by the wavelength itself where there are
    /// none.
    fn at(&self, nm: f64) -> f64 {
        let media = self.train.media().iter();
        let indices = media.filter(|glass| glass.is_dispersive());
        let indices: Vec<f64> = indices.filter_map(|glass| glass.index(nm).ok()).collect();
        match indices.len() {
            0 => 1e-3 * nm,
            count => indices.iter().sum::<f64>() / count as f64,
        }
    }

    /// `count` nodes among ascending wavelengths and between them: those of Chebyshev with both ends.
    pub(super) fn nodes(&self, wavelengths: &[f64], count: usize) -> Vec<f64> {
        let last = wavelengths.len() - 1;
        let (from, to) = (wavelengths[0], wavelengths[last]);
        if count > last {
            return wavelengths.to_vec();
        }
        if count == 1 {
            return vec![wavelengths[last / 2]];
        }
        let fine = |k: u32| from + (to - from) * f64::from(k) / 256.0;
        let ends = [self.at(from), self.at(to)];
        let node = |k: usize| {
            let cosine = (std::f64::consts::PI * k as f64 / (count - 1) as f64).cos();
            let wanted = 0.5 * (ends[0] + ends[1]) + 0.5 * cosine * (ends[0] - ends[1]);
            let off = |nm: &f64| (self.at(*nm) - wanted).abs();
            let inner = (1..256).map(fine).min_by(|a, b| off(a).total_cmp(&off(b)));
            match k {
                0 => from,
                _ if k == count - 1 => to,
                _ => inner.unwrap_or(from),
            }
        };
        (0..count).map(node).collect()
    }

    /// The wavelength (nm) between the nodes at which the product of the distances from all of them is greatest: there
    /// [`Self::next_weight`] is 1.
    pub(super) fn farthest(&self, nodes: &[f64]) -> f64 {
        let (from, to) = (nodes[0], nodes[nodes.len() - 1]);
        let fine = (1..256).map(|k| from + (to - from) * f64::from(k) / 256.0);
        let off = |nm: &f64| self.off(nodes, *nm).abs();
        fine.max_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(from)
    }

    /// The product of the distances from all nodes.
    fn off(&self, nodes: &[f64], nm: f64) -> f64 {
        nodes.iter().map(|&node| self.at(nm) - self.at(node)).product()
    }

    /// Weight of the [`NextTerm`] at a wavelength (nm), whose greatest between the nodes is 1.
    pub(super) fn next_weight(&self, nodes: &[f64], nm: f64) -> f64 {
        let greatest = self.off(nodes, self.farthest(nodes));
        if greatest == 0.0 { 0.0 } else { self.off(nodes, nm) / greatest }
    }

    /// Weight of each node at a wavelength (nm): Lagrange's polynomials.
    pub(super) fn weights(&self, nodes: &[f64], nm: f64) -> [f64; MOST_NODES] {
        let x = self.at(nm);
        let at: Vec<f64> = nodes.iter().map(|&node| self.at(node)).collect();
        let mut weights = [0.0; MOST_NODES];
        for (j, weight) in weights.iter_mut().enumerate().take(nodes.len()) {
            let others = (0..nodes.len()).filter(|&k| k != j);
            *weight = others.map(|k| (x - at[k]) / (at[j] - at[k])).product();
        }
        weights
    }
}

/// The next term of Newton's polynomial through the nodes, for which a ray would have to be traced once more: by how much
/// places are off in between (pixels), as a straight line in where a ray lands and where it leaves the lens. That is
/// what secondary spectra are in the third order: longitudinal as the pupil's point, lateral as the field's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct NextTerm {
    /// Of columns and rows.
    factors: [[f64; TERMS]; 2],
}

const TERMS: usize = 5;

/// A ray that is off in between the nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayOff {
    /// Landing point (pixels).
    pub(super) place: DVec2,
    /// Point where it leaves the lens, across its axis (mm).
    pub(super) point: DVec2,
    /// By how much it is off (pixels).
    pub(super) off: DVec2,
}

impl NextTerm {
    /// By least squares of `rays`; zero where these do not tell it.
    pub(super) fn fitted(rays: impl Iterator<Item = RayOff>) -> Self {
        let mut fits = [LeastSquares::new(TERMS), LeastSquares::new(TERMS)];
        for RayOff { place, point, off } in rays {
            let row = terms(place.into(), point.into());
            fits[0].add(&row, off.x, 1.0);
            fits[1].add(&row, off.y, 1.0);
        }
        let factors = fits.map(|fit| fit.solve().and_then(|found| found.try_into().ok()));
        match factors {
            [Some(columns), Some(rows)] => Self { factors: [columns, rows] },
            _ => Self::default(),
        }
    }

    /// The same in pixels that are so many times as large.
    pub(super) fn on_pixels(mut self, times: f64) -> Self {
        for [constant, _, _, x, y] in &mut self.factors {
            for factor in [constant, x, y] {
                *factor /= times;
            }
        }
        self
    }

    /// That of a ray which lands on a place (pixels) and leaves the lens at a point, across its axis (mm): pixels.
    #[inline(always)]
    pub(super) fn at(&self, place: [f64; 2], point: [f64; 2]) -> [f64; 2] {
        let terms = terms(place, point);
        let sum = |factors: &[f64; TERMS]| {
            let [a, b, c, d, e] = *factors;
            a * terms[0] + b * terms[1] + c * terms[2] + d * terms[3] + e * terms[4]
        };
        [sum(&self.factors[0]), sum(&self.factors[1])]
    }
}

#[inline(always)]
fn terms([column, row]: [f64; 2], [x, y]: [f64; 2]) -> [f64; TERMS] {
    [1.0, column, row, x, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of one ray, which is in the third lane.
    fn corners_of(bounds: &WeightBounds, at: [[f64; 2]; 2], next: [f64; 2]) -> [[f64; 2]; 2] {
        let row = |x: f64| {
            let mut row = [f64::NAN; LANES];
            row[2] = x;
            row
        };
        let corners = bounds.corners(&at.map(|place| place.map(row)), &next.map(row));
        corners.map(|corner| corner.map(|row| row[2]))
    }

    /// Rays land within the corners at all wavelengths, and at some of them next to each side: the bounds of straight lines are
    /// no wider than needed.
    #[test]
    fn corners_hold_all_places_of_a_ray() {
        let wavelength = |k: u32| {
            let x = f64::from(k) / 20.0;
            let mut weights = [0.0; MOST_NODES];
            (weights[0], weights[1]) = (1.0 - x, x);
            NodeWeights { weights, next: 4.0 * x * (1.0 - x), filters: 1.0 }
        };
        let all: Vec<NodeWeights> = (0..=20).map(wavelength).collect();
        let bounds = WeightBounds::of(all.iter());
        assert!(bounds.are_unfiltered());
        let place = |at: [[f64; 2]; 2], next: [f64; 2], own: &NodeWeights| -> [f64; 2] {
            std::array::from_fn(|axis| {
                own.weights[0] * at[0][axis] + own.weights[1] * at[1][axis] + own.next * next[axis]
            })
        };
        for (at, next) in [
            ([[10.3, 7.6], [12.1, 7.2]], [0.0, 0.0]),
            ([[4000.9, 0.1], [3999.2, 0.3]], [-0.4, 0.2]),
            ([[5.5, 5.5], [5.5, 5.5]], [0.7, -0.7]),
        ] {
            let [low, high] = corners_of(&bounds, at, next);
            for own in &all {
                let found = place(at, next, own);
                for axis in 0..2 {
                    assert!(low[axis] < found[axis] && found[axis] < high[axis], "{found:?}");
                }
            }
        }
        let [low, high] = corners_of(&bounds, [[10.3, 7.6], [12.1, 7.2]], [0.0; 2]);
        let off = [low[0] - 10.3, high[0] - 12.1, low[1] - 7.2, high[1] - 7.6];
        assert!(off.iter().all(|off| off.abs() < 2.0 * ROUNDINGS), "{off:?}");
    }
}
