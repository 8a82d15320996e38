//! Construction of a map: directions solved from nodes, and polynomials fitted to them.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    DRAWN_IN, HIDDEN, MOST_DEGREE, MaskMap, MaskScene, NO_TERMS, PLANAR, POINTS, RADIAL,
    SEEN_MARGIN, chebyshev, roberts, terms,
};
use crate::train::aim::{slopes_near, slopes_to};

/// Directions solved from one node.
struct DirectionSolution {
    /// Point of the mask in −1..1, slopes, weight.
    points: Vec<(DVec2, DVec2, f64)>,
    is_round: bool,
}

impl DirectionSolution {
    /// Farthest distance from the middle of points that are seen, in −1..1; along x and y, or from the middle of a round map.
    fn reach(&self) -> DVec2 {
        let seen = self.points.iter().filter(|(.., weight)| *weight > HIDDEN);
        seen.fold(DVec2::ZERO, |most, (place, ..)| {
            most.max(if self.is_round { DVec2::splat(place.length()) } else { place.abs() })
        })
    }
}

impl MaskMap {
    /// The map for points of the mask between `low` and `high` (mm), of which open ones are at most `reach`
    /// (mm) from the axis, landing within `goal` (mm) where polynomials of at least the degree `least` can, and how far from that it lands (mm); `None` where no
    /// direction is found at all.
    pub(in crate::train::pupil) fn new(
        scene: &MaskScene<'_>,
        [low, high]: [DVec2; 2],
        reach: f64,
        goal: DVec2,
        least: usize,
    ) -> Option<(Self, DVec2)> {
        let frame = &scene.clear.elements()[scene.element].frame;
        let round = scene.is_round();
        let corner = |x: f64, y: f64| {
            scene.sensor.point((DVec2::new(x, y) * scene.half_size).extend(0.0)).truncate().length()
        };
        let radius = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
            .into_iter()
            .fold(0.0, |most: f64, (x, y)| most.max(corner(x, y)));
        let (mut centre, mut half) = (0.5 * (low + high), 0.5 * (high - low));
        let offset = if round { frame.vertex.truncate() } else { DVec2::ZERO };
        if round {
            // The circle about the axis that holds all of it.
            (centre, half) = (DVec2::ZERO, DVec2::splat(reach));
        }
        let mut map = Self {
            round,
            sensor: *scene.sensor,
            half_size: scene.half_size,
            radius,
            offset,
            centre,
            half,
            degree: 1,
            terms: Vec::new(),
            known: 0,
        };
        let count = if round { RADIAL + 1 } else { (PLANAR + 1) * (PLANAR + 1) };
        let solve = |map: &Self| -> Vec<Option<DirectionSolution>> {
            (0..count).into_par_iter().map(|node| map.solve(scene, node)).collect()
        };
        let mut solved = solve(&map);
        for _ in 0..DRAWN_IN {
            let seen = solved.iter().flatten().map(DirectionSolution::reach).reduce(DVec2::max);
            let Some(mut reach) = seen.map(|reach| reach + SEEN_MARGIN) else { break };
            if reach.min_element() <= SEEN_MARGIN {
                break;
            }
            if round {
                reach = DVec2::splat(reach.max_element());
            }
            if reach.min_element() >= 1.0 {
                break;
            }
            map.half *= reach.min(DVec2::ONE);
            solved = solve(&map);
        }
        // The least degree that is as good as wanted, or the best one.
        let mut best: Option<(f64, Self, DVec2)> = None;
        for degree in (least..=MOST_DEGREE).step_by(2) {
            map.degree = degree;
            map.terms = solved.iter().map(|node| fit(node.as_ref()?, degree)).collect();
            map.known = map.terms.iter().take_while(|node| node.is_some()).count();
            if map.terms.iter().all(Option::is_none) {
                break;
            }
            let Some(miss) = map.greatest_miss(scene, [low, high], reach) else { continue };
            let share = (miss / goal).max_element();
            if best.as_ref().is_none_or(|(least, ..)| share < *least) {
                best = Some((share, map.clone(), miss));
            }
            if share <= 1.0 {
                break;
            }
        }
        best.map(|(_, map, miss)| (map, miss))
    }

    /// The place of a node on the sensor, as [`Self::slopes`] has it: turned, for a round lens (mm).
    fn node_film(&self, node: usize) -> DVec3 {
        if self.round {
            let r = self.radius * node as f64 / RADIAL as f64;
            return DVec3::new(r, 0.0, self.sensor.vertex.z);
        }
        let at = DVec2::new((node % (PLANAR + 1)) as f64, (node / (PLANAR + 1)) as f64);
        self.sensor.point(((2.0 * at / PLANAR as f64 - 1.0) * self.half_size).extend(0.0))
    }

    /// Solves the directions from a node towards points of the mask; `None` when there are too few.
    fn solve(&self, scene: &MaskScene<'_>, node: usize) -> Option<DirectionSolution> {
        let film = self.node_film(node);
        // In the mask's frame, for the node as it stands.
        let target = |place: DVec2| self.centre + place * self.half - self.offset;
        let solve = |place: DVec2, guess: Option<DVec2>| {
            let (element, place) = (scene.element, target(place));
            match guess {
                Some(guess) => slopes_near(scene.lens, film, element, place, guess),
                None => slopes_to(scene.clear, scene.lens, film, element, place, None),
            }
        };
        let middle = solve(DVec2::ZERO, None)?;
        // The derivative in the middle guides the first points, a plane through what is solved the next.
        const STEP: f64 = 1e-3;
        let by = |step: DVec2| Some((solve(step, Some(middle))? - middle) / STEP);
        let (by_x, by_y) = (by(DVec2::X * STEP)?, by(DVec2::Y * STEP)?);
        let mut points = Vec::with_capacity(POINTS * POINTS);
        for place in self.places() {
            let guess = middle + by_x * place.x + by_y * place.y;
            let Some(slopes) = solve(place, Some(guess)) else { continue };
            let weight = if scene.passes(film, slopes) { 1.0 } else { HIDDEN };
            points.push((place, slopes, weight));
        }
        (points.len() >= POINTS * POINTS / 4)
            .then_some(DirectionSolution { points, is_round: self.round })
    }

    /// Points of the mask in −1..1: Chebyshev's in a square, and the same mapped to the disk of a round
    /// lens.
    fn places(&self) -> Vec<DVec2> {
        let node = |i: usize| (std::f64::consts::PI * (i as f64 + 0.5) / POINTS as f64).cos();
        let place = |i: usize| {
            let [x, y] = [node(i % POINTS), node(i / POINTS)];
            if self.round {
                DVec2::new(x * (1.0 - 0.5 * y * y).sqrt(), y * (1.0 - 0.5 * x * x).sqrt())
            } else {
                DVec2::new(x, y)
            }
        };
        (0..POINTS * POINTS).map(place).collect()
    }

    /// Greatest miss of rays that leave the lens from where they are aimed, between the nodes and
    /// between the points (mm on the mask, x and y), of which those beyond `reach` (mm) from the
    /// axis are closed; `None` when none leaves.
    fn greatest_miss(
        &self,
        scene: &MaskScene<'_>,
        [low, high]: [DVec2; 2],
        reach: f64,
    ) -> Option<DVec2> {
        /// Places of the sensor, and of the mask over each of its sides.
        const FILMS: u32 = 64;
        const ACROSS: u32 = 7;
        let miss = |i: u32| {
            let film = (2.0 * roberts(i) - 1.0) * scene.half_size;
            let mut room = NO_TERMS;
            let local = self.at(film, &mut room)?;
            let start = scene.sensor.point(film.extend(0.0));
            let mut greatest: Option<DVec2> = None;
            for k in 0..ACROSS * ACROSS {
                let share = DVec2::new(f64::from(k % ACROSS), f64::from(k / ACROSS));
                let aim = low + share / f64::from(ACROSS - 1) * (high - low);
                if self.round && (aim + self.offset).length() > reach {
                    continue;
                }
                let (slopes, _) = local.slopes(aim);
                if !scene.passes(start, slopes) {
                    continue;
                }
                let Some(landed) = scene.crossing(start, slopes) else { continue };
                greatest = Some(greatest.unwrap_or_default().max((landed - aim).abs()));
            }
            greatest
        };
        let all: Vec<Option<DVec2>> = (0..FILMS).into_par_iter().map(miss).collect();
        all.into_iter().flatten().reduce(DVec2::max)
    }
}

/// The polynomial of a degree nearest to what was solved, by the normal equations.
fn fit(solved: &DirectionSolution, degree: usize) -> Option<Vec<DVec2>> {
    let count = terms(degree);
    if solved.points.len() < count {
        return None;
    }
    let mut matrix = vec![0.0; count * count];
    let mut right = vec![DVec2::ZERO; count];
    let mut row = vec![0.0; count];
    for &(place, slopes, weight) in &solved.points {
        let ([x, _], [y, _]) = (chebyshev(place.x, degree), chebyshev(place.y, degree));
        let mut k = 0;
        for (i, x) in x[..=degree].iter().enumerate() {
            for y in &y[..=degree - i] {
                row[k] = x * y;
                k += 1;
            }
        }
        for (i, (sum, a)) in right.iter_mut().zip(&row).enumerate() {
            *sum += slopes * (weight * a);
            for (cell, b) in matrix[i * count..=i * count + i].iter_mut().zip(&row) {
                *cell += weight * a * b;
            }
        }
    }
    cholesky(&mut matrix, &mut right, count).then_some(right)
}

/// Solves a symmetric positive system in place (A.-L. Cholesky); `false` when it is not positive.
fn cholesky(matrix: &mut [f64], right: &mut [DVec2], count: usize) -> bool {
    for i in 0..count {
        for j in 0..=i {
            let mut sum = matrix[i * count + j];
            for k in 0..j {
                sum -= matrix[i * count + k] * matrix[j * count + k];
            }
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return false;
                }
                matrix[i * count + i] = sum.sqrt();
            } else {
                matrix[i * count + j] = sum / matrix[j * count + j];
            }
        }
    }
    for i in 0..count {
        for k in 0..i {
            let known = right[k] * matrix[i * count + k];
            right[i] -= known;
        }
        right[i] /= matrix[i * count + i];
    }
    for i in (0..count).rev() {
        for k in i + 1..count {
            let known = right[k] * matrix[k * count + i];
            right[i] -= known;
        }
        right[i] /= matrix[i * count + i];
    }
    true
}
