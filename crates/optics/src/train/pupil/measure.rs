//! Measuring the outlines: frames at the nodes, radii on a grid twice as fine, and the closing check.

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::place::{NodePlace, angle_below, between, turn_of};
use super::search::SlopeWindow;
use super::wavelengths::{LensSplit, Stray};
use super::{ANGLES, ExitPupil, NodeLayout, PupilOutline};
use crate::element::{Clip, LensRays, RayStatus};
use crate::train::aim::towards_lens;
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Margin beside nodes in the dark, likewise a share of the radius: at the edge of the image circle
/// the pupil closes as a square root, faster than straight lines.
const FADING_MARGIN: f64 = 0.2;

/// Share of the frames' bend from node to node that is added to the margin, and the bend that comes
/// from the search grid's cells alone.
const BEND: [f64; 2] = [0.4, 0.1];

/// Margin outside of the bound that the closing check looks at, as a share of the radius.
const CHECKED: f64 = 0.35;

impl ExitPupil {
    /// The sensor's point at a node of the grid that is twice as fine.
    fn fine_film(&self, column: usize, row: usize) -> DVec2 {
        #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
        let share = |i: usize, intervals: usize| i as f64 / (2 * intervals) as f64;
        let [columns, rows] = self.intervals();
        match self.layout {
            NodeLayout::Radial => DVec2::new(self.radius * share(column, columns), 0.0),
            NodeLayout::Planar => {
                let across = DVec2::new(share(column, columns), share(row, rows));
                (2.0 * across - 1.0) * self.half_size
            }
        }
    }

    /// Intervals between nodes along both directions.
    fn intervals(&self) -> [usize; 2] {
        match self.layout {
            NodeLayout::Radial => [self.accuracy.radial_intervals as usize, 0],
            NodeLayout::Planar => [self.accuracy.planar_intervals as usize; 2],
        }
    }

    pub(super) fn measure(&mut self, train: &OpticalTrain, lenses: &[MonochromaticTrain]) {
        if self.layout == NodeLayout::Radial {
            let error = self.accuracy.image_circle;
            self.radius = lit_radius(train, lenses, self.sensor.vertex.z, self.radius, error);
        }
        // The frame of slopes around the light at each node, from its neighbour's.
        let [columns, rows] = self.intervals();
        for row in 0..=rows {
            for column in 0..=columns {
                let film = self.film_point(self.fine_film(2 * column, 2 * row));
                let previous = self.nodes.last().filter(|_| column > 0);
                let mut node = frame_at(train, lenses, film, previous);
                if self.layout == NodeLayout::Radial {
                    // What passes from a place on the x axis of a round lens is the same on both sides of it.
                    node.half.y += node.centre.y.abs();
                    node.centre.y = 0.0;
                }
                self.nodes.push(node);
            }
        }
        // The outline between nodes, twice as fine in place and angle.
        let margins = self.margins();
        self.continue_frames();
        let fine = self.measure_fine(lenses, 0.0, widen);
        let inner = train.is_obscured().then(|| self.measure_fine(lenses, f64::INFINITY, narrow));
        // Each node's reach is the widest around it, so that no light between nodes is lost.
        let [fine_columns, fine_rows] = [2 * columns + 1, 2 * rows + 1];
        for row in 0..=rows {
            for column in 0..=columns {
                let near = |at: usize, count: usize| {
                    (2 * at).saturating_sub(1)..=(2 * at + 1).min(count - 1)
                };
                let node = &mut self.nodes[row * (columns + 1) + column];
                if node.is_dark() {
                    continue;
                }
                let margin = margins[row * (columns + 1) + column];
                for (i, reach) in node.reach.iter_mut().enumerate() {
                    let mut widest = 0.0_f64;
                    for r in near(row, fine_rows) {
                        for c in near(column, fine_columns) {
                            let radii = &fine[r * fine_columns + c];
                            for step in [2 * ANGLES - 1, 0, 1] {
                                widest = widest.max(radii[(2 * i + step) % (2 * ANGLES)]);
                            }
                        }
                    }
                    *reach = widest * (1.0 + margin);
                }
                // The innermost around it; where nothing passes nearby, nothing is known to be obscured.
                let Some(fine) = &inner else { continue };
                for (i, inner) in node.inner.iter_mut().enumerate() {
                    let mut least = f64::INFINITY;
                    for r in near(row, fine_rows) {
                        for c in near(column, fine_columns) {
                            let radii = &fine[r * fine_columns + c];
                            for step in [2 * ANGLES - 1, 0, 1] {
                                least = least.min(radii[(2 * i + step) % (2 * ANGLES)]);
                            }
                        }
                    }
                    let is_known = least.is_finite();
                    *inner = if is_known { (least * (1.0 - margin)).max(0.0) } else { 0.0 };
                }
            }
        }
    }

    /// The margin of each node: more where frames do not follow straight lines over the sensor.
    fn margins(&self) -> Vec<f64> {
        let [columns, rows] = self.intervals();
        let index = |column: usize, row: usize| row * (columns + 1) + column;
        let mut margins = Vec::with_capacity(self.nodes.len());
        for row in 0..=rows {
            for column in 0..=columns {
                let here = &self.nodes[index(column, row)];
                let bend = |before: Option<usize>, after: Option<usize>| {
                    // At the rim of the sensor there is no bend to be seen.
                    let (Some(before), Some(after)) = (before, after) else { return 0.0 };
                    let [before, after] = [&self.nodes[before], &self.nodes[after]];
                    if here.is_dark() || before.is_dark() || after.is_dark() {
                        return f64::INFINITY;
                    }
                    let turn = (before.centre - 2.0 * here.centre + after.centre).abs();
                    let swell = (before.half - 2.0 * here.half + after.half).abs();
                    ((turn + swell) / here.half).max_element()
                };
                let across = bend(
                    column.checked_sub(1).map(|c| index(c, row)),
                    (column < columns).then(|| index(column + 1, row)),
                );
                let down = bend(
                    row.checked_sub(1).map(|r| index(column, r)),
                    (row < rows).then(|| index(column, row + 1)),
                );
                let [weight, free] = BEND;
                let bent = weight * (across.max(down) - free).max(0.0);
                margins.push((self.accuracy.margin + bent).min(FADING_MARGIN));
            }
        }
        margins
    }

    /// Gives dark nodes beside lit ones a frame, so that light between the two is not cut off.
    fn continue_frames(&mut self) {
        let [columns, rows] = self.intervals();
        let lit = self.nodes.clone();
        let index = |column: usize, row: usize| row * (columns + 1) + column;
        for row in 0..=rows {
            for column in 0..=columns {
                if !lit[index(column, row)].is_dark() {
                    continue;
                }
                let mut frames = Vec::new();
                for (dc, dr) in
                    [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)]
                {
                    let step = |times: isize| {
                        let c = column.checked_add_signed(dc * times).filter(|c| *c <= columns)?;
                        let r = row.checked_add_signed(dr * times).filter(|r| *r <= rows)?;
                        Some(&lit[index(c, r)]).filter(|node| !node.is_dark())
                    };
                    if let Some(next) = step(1) {
                        let drift = step(2).map_or(DVec2::ZERO, |far| next.centre - far.centre);
                        frames.push((next.centre + drift, next.half));
                    }
                }
                let Some(&(centre, half)) = frames.first() else { continue };
                let node = &mut self.nodes[index(column, row)];
                (node.centre, node.half) = (centre, half);
            }
        }
    }

    /// Radii at all nodes of the fine grid, each in the frame that the bound has there.
    fn measure_fine(
        &self,
        lenses: &[MonochromaticTrain],
        initial: f64,
        measure: fn(&mut [f64; 2 * ANGLES], &MonochromaticTrain, DVec3, &SearchRegion),
    ) -> Vec<[f64; 2 * ANGLES]> {
        let [columns, rows] = self.intervals();
        let columns = 2 * columns + 1;
        let radii = |place: usize| {
            let film = self.fine_film(place % columns, place / columns);
            let mut radii = [initial; 2 * ANGLES];
            if let Some(frame) = self.frame(film) {
                let at = self.film_point(film);
                let region = SearchRegion { frame, is_round: self.is_radial() };
                for lens in lenses {
                    measure(&mut radii, lens, at, &region);
                }
            }
            radii
        };
        (0..columns * (2 * rows + 1)).into_par_iter().map(radii).collect()
    }

    /// The interpolated centre and half axes; `None` in the dark.
    fn frame(&self, film: DVec2) -> Option<[DVec2; 2]> {
        let place = self.place(film)?;
        let mut frame = [DVec2::ZERO; 2];
        for (node, weight) in place.nodes {
            frame[0] += self.nodes[node].centre * weight;
            frame[1] += self.nodes[node].half * weight;
        }
        (frame[1].min_element() > 0.0).then_some(frame)
    }

    /// Looks for rays that pass just outside of the bound, and widens it around them until there
    /// are none.
    pub(super) fn widen_until_tight(&mut self, lenses: &LensSplit) {
        for round in 0..4 {
            let found = self.found_in_round(lenses, round, Self::strays);
            for stray in &found {
                self.widen_at(stray);
            }
            if found.is_empty() {
                return;
            }
        }
    }

    /// Looks for rays that pass just inside of the obscured middle, and lets them through until there are none.
    pub(super) fn narrow_until_tight(&mut self, lenses: &LensSplit) {
        let margin = self.accuracy.margin;
        for round in 4..8 {
            let found = self.found_in_round(lenses, round, Self::inner_strays);
            for stray in &found {
                let low = turn_index(stray.turn);
                for (node, _) in stray.nodes.into_iter().filter(|&(_, weight)| weight > 0.0) {
                    let inner = &mut self.nodes[node].inner;
                    for entry in [low, low + 1] {
                        inner[entry] = inner[entry].min(stray.radius * (1.0 - margin));
                    }
                    let ends = inner[0].min(inner[ANGLES]);
                    (inner[0], inner[ANGLES]) = (ends, ends);
                }
            }
            if found.is_empty() {
                return;
            }
        }
    }

    /// Random rays of these numbers within the obscured middle that pass.
    pub(super) fn inner_strays(
        &self,
        lens: &MonochromaticTrain,
        numbers: Range<u32>,
    ) -> Vec<Stray> {
        self.random_strays(lens, numbers, |place, u| {
            let nodes = place.nodes.iter();
            let inner: f64 =
                nodes.map(|&(n, w)| between(&self.nodes[n].inner, angle_below(u[1])) * w).sum();
            inner * (1.0 - CHECKED * u[2])
        })
    }

    /// Random rays of these numbers outside of the bound that pass.
    pub(super) fn strays(&self, lens: &MonochromaticTrain, numbers: Range<u32>) -> Vec<Stray> {
        self.random_strays(lens, numbers, |place, u| {
            let nodes = place.nodes.iter();
            let bound: f64 =
                nodes.map(|&(n, w)| between(&self.nodes[n].reach, angle_below(u[1])) * w).sum();
            bound * (1.0 + CHECKED * u[2])
        })
    }

    fn random_strays(
        &self,
        lens: &MonochromaticTrain,
        numbers: Range<u32>,
        radius_at: impl Fn(&NodePlace, [f64; 4]) -> f64,
    ) -> Vec<Stray> {
        let checks = (numbers.end - numbers.start) / if lens.is_costly() { 4 } else { 1 };
        let first = numbers.start;
        let mut rays = LensRays::with_capacity(checks as usize);
        let mut strays = Vec::with_capacity(checks as usize);
        for i in first..first + checks {
            let u = ROBERTS.map(|alpha| (0.5 + alpha * f64::from(i)).fract());
            let film = match self.layout {
                NodeLayout::Radial => DVec2::new(self.radius * u[0].sqrt(), 0.0),
                NodeLayout::Planar => (2.0 * DVec2::new(u[0], u[3]) - 1.0) * self.half_size,
            };
            let Some(place) = self.place(film) else { continue };
            let Some([centre, half]) = self.frame(film) else { continue };
            let radius = radius_at(&place, u);
            let angle = DVec2::from_angle(u[1] * std::f64::consts::TAU);
            rays.push(self.film_point(film), towards_lens(centre + angle * half * radius));
            strays.push(Stray { nodes: place.nodes, turn: u[1], radius });
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        let passed = |i: &usize| rays.status(*i) == RayStatus::Exited;
        (0..rays.len()).filter(passed).map(|i| strays[i]).collect()
    }

    /// Raises the table's entries around a ray to the ray's radius.
    fn widen_at(&mut self, stray: &Stray) {
        let (low, margin) = (turn_index(stray.turn), self.accuracy.margin);
        for (node, _) in stray.nodes.into_iter().filter(|&(_, weight)| weight > 0.0) {
            let reach = &mut self.nodes[node].reach;
            for entry in [low, low + 1] {
                reach[entry] = reach[entry].max(stray.radius * (1.0 + margin));
            }
            let ends = reach[0].max(reach[ANGLES]);
            (reach[0], reach[ANGLES]) = (ends, ends);
        }
    }
}

/// The entry of the table at or before a share of a turn.
fn turn_index(turn: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "a turn is in 0..1"
    )]
    let low = (turn * ANGLES as f64) as usize;
    low.min(ANGLES - 1)
}

/// Steps of the additive recurrence of the plastic number's kin in four dimensions (M. Roberts,
/// *The unreasonable effectiveness of quasirandom sequences*, 2018).
pub(super) const ROBERTS: [f64; 4] =
    [0.856_674_883_854_503, 0.733_891_856_627_126, 0.628_706_721_037_806, 0.538_597_270_645_735];

/// Farthest distance from the axis at which there is light, up to `limit` (mm), and a little more: by `error`, a share
/// of it, 0.4 of which is how nearly it is found.
pub fn lit_radius(
    train: &OpticalTrain,
    lenses: &[MonochromaticTrain],
    z: f64,
    limit: f64,
    error: f64,
) -> f64 {
    let lit = |r: f64| {
        let film = DVec3::new(r, 0.0, z);
        lenses.iter().any(|lens| SlopeWindow::find(train, lens, film).is_some())
    };
    if lit(limit) || !lit(0.0) {
        return limit;
    }
    let (mut low, mut high) = (0.0, limit);
    while high - low > 0.4 * error * high {
        let middle = 0.5 * (low + high);
        if lit(middle) { low = middle } else { high = middle }
    }
    (high * (1.0 + error)).min(limit)
}

/// The frame around what passes at any of the wavelengths, begun from the node before.
fn frame_at(
    train: &OpticalTrain,
    lenses: &[MonochromaticTrain],
    film: DVec3,
    previous: Option<&PupilOutline>,
) -> PupilOutline {
    let mut window: Option<SlopeWindow> = None;
    let mut chief = None;
    for lens in lenses {
        // Around the neighbour's frame first, else anywhere.
        let near = previous
            .filter(|node| !node.is_dark())
            .and_then(|node| SlopeWindow::near(node.centre, node.half * 1.5, lens, film));
        let Some(found) = near.or_else(|| SlopeWindow::find(train, lens, film)) else { continue };
        window = Some(window.map_or(found, |w| SlopeWindow {
            min: w.min.min(found.min),
            max: w.max.max(found.max),
        }));
        chief = chief.or_else(|| {
            let start = previous.and_then(|node| node.chief);
            let direction = train.chief_direction_from(lens, film, start)?;
            Some(-direction.truncate() / direction.z)
        });
    }
    match window {
        Some(window) => PupilOutline {
            centre: window.centre(),
            half: window.half(),
            chief,
            ..PupilOutline::DARK
        },
        None => PupilOutline::DARK,
    }
}

/// Raises `radii` to the outermost passing ray of each angle from `film` in the frame.
fn widen(
    radii: &mut [f64; 2 * ANGLES],
    lens: &MonochromaticTrain,
    film: DVec3,
    region: &SearchRegion,
) {
    for (radius, found) in radii.iter_mut().zip(limits(RimSide::Outer, lens, film, region)) {
        *radius = found.map_or(*radius, |found| radius.max(found));
    }
}

/// Lowers `radii` to the innermost passing ray of each angle from `film` in the frame; to 0 where none passes.
fn narrow(
    radii: &mut [f64; 2 * ANGLES],
    lens: &MonochromaticTrain,
    film: DVec3,
    region: &SearchRegion,
) {
    for (radius, found) in radii.iter_mut().zip(limits(RimSide::Inner, lens, film, region)) {
        // Where nothing passes at an angle, nothing is known.
        *radius = radius.min(found.unwrap_or(0.0));
    }
}

/// Directions among which passing rays are looked for.
struct SearchRegion {
    /// The middle and the half axes of slopes.
    frame: [DVec2; 2],
    is_round: bool,
}

/// Extreme that is looked for among the passing rays of an angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RimSide {
    /// That of the greatest radius.
    Outer,
    /// That of the least.
    Inner,
}

/// The radius of the last passing ray of each angle from `film` in the frame, rounded to the side where none passes;
/// `None` where none does.
fn limits(
    limit: RimSide,
    lens: &MonochromaticTrain,
    film: DVec3,
    &SearchRegion { frame: [centre, half], is_round }: &SearchRegion,
) -> [Option<f64>; 2 * ANGLES] {
    // Costly trains are measured more coarsely: to 0.003 of the radius, which the margin covers.
    let (scanned, halvings) = if lens.is_costly() { (16, 5) } else { (32, 12) };
    // The frame's corners are √2 from its centre.
    const OUTERMOST: f64 = 1.6;
    // Both sides of the x axis are alike there.
    let is_mirrored = is_round && film.y == 0.0 && centre.y == 0.0;
    let angles = if is_mirrored { ANGLES + 1 } else { 2 * ANGLES };
    let angle = |i: usize| DVec2::from_angle(0.5 * turn_of(i) * std::f64::consts::TAU) * half;
    let directions: Vec<DVec2> = (0..angles).map(angle).collect();
    let passes = |places: &[(usize, f64)]| -> Vec<bool> {
        let mut rays = LensRays::with_capacity(places.len());
        for &(i, radius) in places {
            rays.push(film, towards_lens(centre + directions[i] * radius));
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        (0..rays.len()).map(|i| rays.status(i) == RayStatus::Exited).collect()
    };
    // A radius moved farther beyond what passes.
    let beyond = |radius: f64, by: f64| match limit {
        RimSide::Outer => radius + by,
        RimSide::Inner => (radius - by).max(0.0),
    };
    let mut width = OUTERMOST / f64::from(scanned);
    let scan: Vec<(usize, f64)> =
        (0..angles).flat_map(|i| (0..scanned).map(move |s| (i, width * f64::from(s)))).collect();
    let mut last = [None; 2 * ANGLES];
    for (&(i, radius), passed) in scan.iter().zip(passes(&scan)) {
        if passed && (limit == RimSide::Outer || last[i].is_none()) {
            last[i] = Some(radius);
        }
    }
    let mut passing: Vec<(usize, f64)> =
        (0..angles).filter_map(|i| last[i].map(|radius| (i, radius))).collect();
    for _ in 0..halvings {
        width *= 0.5;
        let middles: Vec<(usize, f64)> =
            passing.iter().map(|&(i, radius)| (i, beyond(radius, width))).collect();
        for ((own, &(_, middle)), passed) in passing.iter_mut().zip(&middles).zip(passes(&middles))
        {
            if passed {
                own.1 = middle;
            }
        }
    }
    for (i, radius) in passing {
        last[i] = Some(beyond(radius, width));
    }
    for i in angles..2 * ANGLES {
        last[i] = last[2 * ANGLES - i];
    }
    last
}
