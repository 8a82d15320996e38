//! Coded apertures: samples of a mask in proportion to what it passes.
//!
//! Of rays that are aimed at a mask's whole rectangle, a coded aperture stops half and a small hole
//! nearly all. So a point of the mask is drawn from its transmission, and the ray is aimed at that
//! point. From which direction a point of the sensor sees a point of the mask is solved by Newton's
//! method at the nodes of a grid over the sensor and of a grid over the mask, and joined by
//! cubics over the sensor and straight lines over the mask: exact behind a thin lens, and elsewhere a map that is near the true one
//! and whose Jacobian is known exactly, which is all that an unbiased estimate needs.
//!
//! # No bias
//!
//! A ray that is aimed at a point of the mask lands a little beside it. The density is therefore
//! raised above zero around what is open, as far as the map was measured to err; and one sample in
//! [`ANYWHERE`] is drawn from the whole pupil, with the density of both ways together in its weight
//! (the one-sample estimate of E. Veach and L. Guibas, "Optimally combining sampling techniques",
//! 1995). Whatever passes can then be met, and what is met has the weight of its true density.
//!
//! Where other rims vignette the mask, the density is lowered to [`FLOOR`], not to zero.

#![expect(clippy::cast_precision_loss, reason = "grids of a few hundred cells")]

use glam::{DMat2, DVec2, DVec3};

use super::histogram::Histogram;
use super::mask::{Sums, first_mask, greatest_around};
use crate::element::{Clip, Frame, Picture, Ray, RayStatus};
use crate::train::aim::{slopes_to, towards_lens};
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Intervals between nodes over each side of the sensor and of the mask.
const FILM: usize = 12;
const MASK: usize = 12;

/// Cells of the density over each side of an interval of the mask.
const FINE: usize = 16;

/// The share of samples that is drawn from the whole pupil.
const ANYWHERE: f64 = 0.01;

/// The density beside what is open, and where other rims are in the way, as a share of that inside.
const FLOOR: f64 = 0.05;

/// The most that the density is widened beside what is open, as a share of the mask's open part; what
/// a worse map misses is left to the samples of the whole pupil.
const WIDEST_MARGIN: f64 = 0.3;

/// A mask as the points of a sensor see it.
#[derive(Debug, Clone)]
pub(super) struct Coded {
    half_size: DVec2,
    /// The corner of the rectangle that holds what the mask passes, and its size (mm), on the mask.
    corner: DVec2,
    size: DVec2,
    /// How much of that is around what passes.
    border: DVec2,
    /// Slopes towards the nodes of the mask, for each node of the sensor.
    slopes: Vec<[[DVec2; MASK + 1]; MASK + 1]>,
    /// The density over the mask's intervals, for each interval of the sensor; `None` where some
    /// direction could not be solved.
    coarse: Vec<Option<Histogram>>,
    /// The density inside of each of the mask's intervals; `None` where nothing passes.
    fine: Vec<Option<Histogram>>,
}

/// Nodes of the sensor around a point of it, and their weights.
type NodeWeights = [(usize, f64); 16];

/// A direction drawn from a mask.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aimed {
    /// Slopes x/−z, y/−z.
    pub(super) slopes: DVec2,
    /// Their density per area of slopes.
    pub(super) density: f64,
}

/// A point of the sensor between nodes.
pub(super) struct MaskView<'a> {
    coded: &'a Coded,
    coarse: &'a Histogram,
    nodes: NodeWeights,
}

impl Coded {
    /// Looks at the first mask of a lens from a sensor; `None` when it has none that dims anything, or
    /// when no direction towards it is found.
    pub(super) fn new(
        train: &OpticalTrain,
        clear: &OpticalTrain,
        lenses: &[MonochromaticTrain],
        sensor: &Frame,
        half_size: DVec2,
    ) -> Option<Self> {
        let (element, mask) = first_mask(train)?;
        let lens = lenses.get(lenses.len() / 2)?;
        let view = ClearLens { clear, lens, element };
        let mut coded = Self::around(mask, half_size, DVec2::ZERO)?;
        let mut nodes = coded.solve(&view, sensor);
        let mut margin = coded.greatest_miss(lenses, element, sensor);
        if margin.cmpgt(coded.border).any() {
            // A small hole: what the map errs by has to lie in the rectangle.
            coded = Self::around(mask, half_size, 1.5 * margin)?;
            nodes = coded.solve(&view, sensor);
            margin = margin.max(coded.greatest_miss(lenses, element, sensor));
        }
        coded.fill_fine(mask, margin);
        coded.fill_coarse(&nodes);
        coded.coarse.iter().any(Option::is_some).then_some(coded)
    }

    /// Solves the directions from the sensor's nodes to those of the mask.
    fn solve(&mut self, view: &ClearLens<'_>, sensor: &Frame) -> Vec<Option<MaskNode>> {
        let place = |i: usize| sensor.point(self.film_node(i).extend(0.0));
        let nodes: Vec<Option<MaskNode>> = (0..(FILM + 1) * (FILM + 1))
            .map(|i| view.node(place(i), |x, y| self.mask_node(x, y)))
            .collect();
        self.slopes = nodes
            .iter()
            .map(|node| node.as_ref().map_or([[DVec2::NAN; MASK + 1]; MASK + 1], |n| n.slopes))
            .collect();
        nodes
    }

    /// The rectangle that holds what a mask passes, with at least `border` (mm) around it.
    fn around(mask: &Picture, half_size: DVec2, border: DVec2) -> Option<Self> {
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for (i, _) in mask.values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
            let [low, high] = mask.bounds_of(i);
            (min, max) = (min.min(low), max.max(high));
        }
        let size = max - min;
        if !(size.min_element() > 0.0 && size.is_finite()) {
            return None;
        }
        let border = border.max(1.5 * size / (MASK * FINE) as f64);
        Some(Self {
            half_size,
            corner: min - border,
            size: size + 2.0 * border,
            border,
            slopes: Vec::new(),
            coarse: Vec::new(),
            fine: Vec::new(),
        })
    }

    fn film_node(&self, i: usize) -> DVec2 {
        let at = DVec2::new((i % (FILM + 1)) as f64, (i / (FILM + 1)) as f64);
        (2.0 * at / FILM as f64 - 1.0) * self.half_size
    }

    fn mask_node(&self, x: f64, y: f64) -> DVec2 {
        self.corner + DVec2::new(x, y) / MASK as f64 * self.size
    }

    /// How far from where they are aimed rays land, between the nodes (mm on the mask, x and y).
    fn greatest_miss(
        &self,
        lenses: &[MonochromaticTrain],
        element: usize,
        sensor: &Frame,
    ) -> DVec2 {
        let mut greatest = DVec2::ZERO;
        for interval in 0..FILM * FILM {
            let shift = DVec2::new((interval % FILM) as f64, (interval / FILM) as f64) + 0.5;
            let film = (2.0 * shift / FILM as f64 - 1.0) * self.half_size;
            let Some(nodes) = self.nodes_around(film) else { continue };
            let start = sensor.point(film.extend(0.0));
            for cell in (0..MASK * MASK).step_by(5) {
                let [x, y] = [cell % MASK, cell / MASK];
                let aim = self.mask_node(x as f64 + 0.5, y as f64 + 0.5);
                let (slopes, _) = self.map(&nodes, [x, y], [0.5, 0.5]);
                let Some(ray) = Ray::new(start, towards_lens(slopes)) else { continue };
                for lens in lenses {
                    let landed = lens.crossing(Side::Sensor, element, ray).map(DVec2::from);
                    let missed = landed.map_or(DVec2::ZERO, |landed| (landed - aim).abs());
                    greatest = greatest.max(missed);
                }
            }
        }
        greatest
    }

    /// The density over the mask: its transmission, and [`FLOOR`] within `margin` (mm) of what is open.
    fn fill_fine(&mut self, mask: &Picture, margin: DVec2) {
        let count = MASK * FINE;
        let cell = self.size / count as f64;
        // What passes each cell.
        let sums = Sums::of(mask);
        let open: Vec<f64> = (0..count * count)
            .map(|i| {
                let low = self.corner + cell * DVec2::new((i % count) as f64, (i / count) as f64);
                sums.mean(mask, low, low + cell)
            })
            .collect();
        // Cells near open ones are never left out: the picture of the mask is only known to a
        // margin.
        let reach = (margin / cell).min(DVec2::splat(WIDEST_MARGIN * count as f64)).ceil();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a few hundred cells"
        )]
        let [across, down] = [reach.x as usize + 1, reach.y as usize + 1];
        let widened =
            greatest_around(&greatest_around(&open, count, across, 1), count, down, count);
        let density = |i: usize| open[i].max(FLOOR * widened[i]);
        // A histogram for each interval of the coarse grid.
        self.fine = (0..MASK * MASK)
            .map(|interval| {
                let [x, y] = [interval % MASK * FINE, interval / MASK * FINE];
                let values: Vec<f64> = (0..FINE * FINE)
                    .map(|i| density((y + i / FINE) * count + x + i % FINE))
                    .collect();
                Histogram::new(FINE, &values)
            })
            .collect();
    }

    /// The density over the mask's intervals: what is open of each, and how much of it other rims let
    /// through from the corners of an interval of the sensor.
    fn fill_coarse(&mut self, nodes: &[Option<MaskNode>]) {
        let interval = |i: usize| {
            let [column, row] = [i % FILM, i / FILM].map(first_of_four);
            let node = |at: usize| &nodes[(row + at / 4) * (FILM + 1) + column + at % 4];
            if (0..16).any(|at| node(at).is_none()) {
                return None;
            }
            let corner = i / FILM * (FILM + 1) + i % FILM;
            let corners = [corner, corner + 1, corner + FILM + 1, corner + FILM + 2];
            let seen: Vec<&MaskNode> =
                corners.iter().filter_map(|&at| nodes[at].as_ref()).collect();
            let values: Vec<f64> = (0..MASK * MASK)
                .map(|cell| {
                    let open = self.fine[cell].as_ref().map_or(0.0, Histogram::mean);
                    let [x, y] = [cell % MASK, cell / MASK];
                    let passed = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]]
                        .iter()
                        .flat_map(|at| seen.iter().map(|node| node.passes[at[1]][at[0]]))
                        .filter(|passes| *passes)
                        .count();
                    open * (passed as f64 / 16.0).max(FLOOR)
                })
                .collect();
            Histogram::new(MASK, &values)
        };
        self.coarse = (0..FILM * FILM).map(interval).collect();
    }

    /// The nodes around a point of the sensor (mm) and their weights, of Lagrange's cubics; `None`
    /// beyond its edge.
    fn nodes_around(&self, film: DVec2) -> Option<NodeWeights> {
        let (at, [right, down]) = self.film_interval(film)?;
        let first = [at % FILM, at / FILM].map(first_of_four);
        let across = cubics((at % FILM) as f64 + right - first[0] as f64);
        let along = cubics((at / FILM) as f64 + down - first[1] as f64);
        Some(std::array::from_fn(|i| {
            let [column, row] = [i % 4, i / 4];
            let node = (first[1] + row) * (FILM + 1) + first[0] + column;
            (node, across[column] * along[row])
        }))
    }

    /// The sensor's interval around a point (mm), and the place in it.
    fn film_interval(&self, film: DVec2) -> Option<(usize, [f64; 2])> {
        let along = |x: f64, half: f64| {
            let at = if half > 0.0 { 0.5 * (x / half + 1.0) * FILM as f64 } else { 0.0 };
            if !(at >= -1e-9 && at <= FILM as f64 + 1e-9) {
                return None;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between 0 and a dozen"
            )]
            let low = (at.max(0.0) as usize).min(FILM - 1);
            Some((low, (at - low as f64).clamp(0.0, 1.0)))
        };
        let (column, right) = along(film.x, self.half_size.x)?;
        let (row, down) = along(film.y, self.half_size.y)?;
        Some((row * FILM + column, [right, down]))
    }

    /// Whence and how: what a point of the sensor (mm) sees of the mask. `None` where nothing is known.
    pub(super) fn seen_from(&self, film: DVec2) -> Option<MaskView<'_>> {
        let (interval, _) = self.film_interval(film)?;
        let coarse = self.coarse[interval].as_ref()?;
        Some(MaskView { coded: self, coarse, nodes: self.nodes_around(film)? })
    }

    /// Slopes towards a place in one of the mask's intervals, and their derivatives by that place.
    fn map(&self, nodes: &NodeWeights, [x, y]: [usize; 2], [s, t]: [f64; 2]) -> (DVec2, DMat2) {
        let at = |x: usize, y: usize| -> DVec2 {
            nodes.iter().map(|&(node, weight)| self.slopes[node][y][x] * weight).sum()
        };
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        let slopes = (a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t;
        let by_s = (b - a) * (1.0 - t) + (d - c) * t;
        let by_t = (c - a) * (1.0 - s) + (d - b) * s;
        (slopes, DMat2::from_cols(by_s, by_t))
    }
}

impl MaskView<'_> {
    /// A direction for a place in the unit square: towards a point of the mask for most of the square,
    /// and of the whole pupil as `anywhere` gives them with their density, per area of slopes, for the
    /// rest. `density` is that of the whole pupil's anywhere.
    pub(super) fn aim(
        &self,
        [u, v]: [f64; 2],
        anywhere: impl Fn([f64; 2]) -> DVec2,
        density: impl Fn(DVec2) -> f64,
    ) -> Aimed {
        let both = |slopes: DVec2, own: f64| Aimed {
            slopes,
            density: (1.0 - ANYWHERE) * own + ANYWHERE * density(slopes),
        };
        if u < ANYWHERE {
            let slopes = anywhere([u / ANYWHERE, v]);
            return both(slopes, self.density(slopes));
        }
        let u = (u - ANYWHERE) / (1.0 - ANYWHERE);
        let interval = self.coarse.draw([u, v]);
        let fine = &self.coded.fine[interval.cell[1] * MASK + interval.cell[0]];
        // An interval where nothing passes has no density and is not drawn.
        let Some(fine) = fine else { return both(anywhere([u, v]), 0.0) };
        let drawn = fine.draw(interval.inside);
        let place = |i: usize| (drawn.cell[i] as f64 + drawn.inside[i]) / FINE as f64;
        let (slopes, derivatives) =
            self.coded.map(&self.nodes, interval.cell, [place(0), place(1)]);
        both(slopes, self.per_slopes(interval.density * drawn.density, &derivatives))
    }

    /// From a density over the unit square of the mask to one over slopes.
    fn per_slopes(&self, density: f64, derivatives: &DMat2) -> f64 {
        // The derivatives are by the place in one interval of MASK × MASK.
        let area = derivatives.determinant().abs() * (MASK * MASK) as f64;
        if area > 0.0 { density / area } else { 0.0 }
    }

    /// The density with which [`Self::aim`] aims at the mask along given slopes, per area of slopes.
    fn density(&self, slopes: DVec2) -> f64 {
        let Some((cell, inside)) = self.place_of(slopes) else { return 0.0 };
        let Some(fine) = &self.coded.fine[cell[1] * MASK + cell[0]] else { return 0.0 };
        let (_, derivatives) = self.coded.map(&self.nodes, cell, inside);
        let density = self.coarse.density(cell) * fine.density(fine.cell_at(DVec2::from(inside)));
        self.per_slopes(density, &derivatives)
    }

    /// The interval of the mask and the place in it towards which given slopes lead: the map inverted
    /// by Newton's method, from interval to interval.
    fn place_of(&self, slopes: DVec2) -> Option<([usize; 2], [f64; 2])> {
        let mut at = DVec2::splat(0.5 * MASK as f64);
        for _ in 0..40 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to a dozen"
            )]
            let cell = at.to_array().map(|x| (x.clamp(0.0, MASK as f64 - 1e-9)) as usize);
            let corner = DVec2::new(cell[0] as f64, cell[1] as f64);
            let inside = (at - corner).to_array();
            let (here, derivatives) = self.coded.map(&self.nodes, cell, inside);
            let miss = slopes - here;
            let scale = derivatives.x_axis.length() + derivatives.y_axis.length();
            if miss.length() <= 1e-12 * scale {
                let held = inside.iter().all(|x| (-1e-9..=1.0 + 1e-9).contains(x));
                return held.then_some((cell, inside.map(|x| x.clamp(0.0, 1.0))));
            }
            let step = derivatives.inverse() * miss;
            if !step.is_finite() {
                return None;
            }
            // Intervals differ little: a step beyond the mask by more than its size is outside.
            at += step.clamp_length_max(MASK as f64);
            let far = 2.0 * MASK as f64;
            if at.min_element() < -far || at.max_element() > far {
                return None;
            }
        }
        None
    }
}

/// The first of the four nodes around an interval.
fn first_of_four(interval: usize) -> usize {
    interval.saturating_sub(1).min(FILM - 3)
}

/// Lagrange's cubics of the nodes 0 to 3 at `x`.
fn cubics(x: f64) -> [f64; 4] {
    let [a, b, c, d] = [x, x - 1.0, x - 2.0, x - 3.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// What a node of the sensor sees of the mask's nodes.
struct MaskNode {
    slopes: [[DVec2; MASK + 1]; MASK + 1],
    /// Whether all other rims let the ray through.
    passes: [[bool; MASK + 1]; MASK + 1],
}

/// A lens with its masks clear, and the mask in it.
struct ClearLens<'a> {
    clear: &'a OpticalTrain,
    lens: &'a MonochromaticTrain,
    element: usize,
}

impl ClearLens<'_> {
    /// Solves the directions from `film` (mm) to the nodes of the mask; `None` when its middle has none.
    fn node(&self, film: DVec3, mask: impl Fn(f64, f64) -> DVec2) -> Option<MaskNode> {
        let middle = mask(0.5 * MASK as f64, 0.5 * MASK as f64);
        let to =
            |target, start| slopes_to(self.clear, self.lens, film, (self.element, target), start);
        let centre = to(middle, None)?;
        let crossing = |slopes: DVec2| {
            let ray = Ray::new(film, towards_lens(slopes))?;
            self.lens.crossing(Side::Sensor, self.element, ray).map(DVec2::from)
        };
        // Where the others are is guessed from the derivative in the middle.
        const STEP: f64 = 1e-6;
        let there = crossing(centre)?;
        let by = |step: DVec2| Some((crossing(centre + step)? - there) / STEP);
        let derivative = DMat2::from_cols(by(DVec2::X * STEP)?, by(DVec2::Y * STEP)?);
        let inverse = derivative.inverse();
        let mut node = MaskNode {
            slopes: [[DVec2::ZERO; MASK + 1]; MASK + 1],
            passes: [[false; MASK + 1]; MASK + 1],
        };
        for y in 0..=MASK {
            for x in 0..=MASK {
                let target = mask(x as f64, y as f64);
                let guess = centre + inverse * (target - middle);
                // A part of the mask that no ray can reach goes on as the middle does.
                let found = to(target, Some(guess).filter(|guess| guess.is_finite()));
                node.slopes[y][x] = found.unwrap_or(guess);
                let ray = Ray::new(film, towards_lens(node.slopes[y][x]))?;
                let passes = self.lens.run(Side::Sensor, Clip::On, ray).status == RayStatus::Exited;
                node.passes[y][x] = found.is_some() && passes;
            }
        }
        Some(node)
    }
}
