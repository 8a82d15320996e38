//! The exit pupil as each point of the sensor sees it, and samples of it.
//!
//! Rays that leave the sensor in directions in which no light can come are wasted: around a double
//! Gauss at f/2 a third of those aimed at a rectangle around the pupil. Here the outline of the
//! passing directions is known at nodes over the sensor, in slopes (x/−z, y/−z), as a frame (centre
//! and half axes) and a table of radii by angle in that frame. Frames and radii are joined by
//! straight lines over the sensor and over the angle, so the bound has no steps and a picture no
//! rings.
//!
//! # No bias
//!
//! A bound that cuts off part of the pupil would darken the picture, so each radius in the table is
//! the greatest of those measured at the nine nearest places of a grid twice as fine, in the sensor
//! and in the angle, plus a margin; the interpolated bound is then at least the true outline at all
//! measured places between. What the fine grid itself could miss is looked for with random rays just
//! outside the bound when it is built, and the bound is widened until none of them passes. Radii are
//! those of the outermost passing ray, so an outline needs not be convex.
//!
//! # Weights
//!
//! For the irradiance of Eq. (1) of Nürnberg et al. (2019), E = ∫ L cos θ dΩ: a sample stands for
//! dm = π a b ρ² of slopes, in which dΩ = cos³θ dm, θ from the axis, and the sensor sees it under its
//! own cosine. In a medium of index n before the sensor the radiance is n² that of the object.
//!
//! The bounds that this replaces: C. Kolb, D. Mitchell, P. Hanrahan, "A realistic camera model for
//! computer graphics", 1995; M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 6.4.5.

use glam::{DVec2, DVec3};

use super::aim::towards_lens;
use super::pupil_search::Window;
use super::{OpticalTrain, Part, Side, TrainAt};
use crate::element::{Clip, Fate, FateCounts, Frame, LensRays, Opening};
use crate::glass::GlassError;

/// Angles in the table of a node.
const ANGLES: usize = 128;

/// Intervals between nodes over the sensor's half diagonal, for lenses with rotational symmetry.
const RADIAL_INTERVALS: usize = 40;

/// Intervals between nodes over each side of the sensor for other lenses.
const PLANAR_INTERVALS: usize = 8;

/// Added to every radius, as a share of it: what rays measured on a grid may be short of.
const MARGIN: f64 = 0.004;

/// How far outside of the bound the closing check looks, as a share of the radius.
const CHECKED: f64 = 0.35;

/// Random rays of the closing check.
const CHECKS: u32 = 1 << 16;

/// Why there is no exit pupil to sample.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExitPupilError {
    /// Not one ray leaves the lens.
    #[error(
        "no light passes the lens: elements[{element}] blocks most of it ({})", losses.join(", ")
    )]
    Dark {
        /// The element that ends most rays.
        element: usize,
        /// Where rays from the sensor's centre end.
        losses: Vec<String>,
    },
    /// No element has a rim.
    #[error(
        "the lens passes light in all directions: give its stop a radius, or a surface a \
         semi_diameter"
    )]
    Unbounded,
    /// A sensor without size, or before the lens.
    #[error("the sensor must lie behind the last element and have a finite size")]
    Sensor,
    /// A glass without index.
    #[error(transparent)]
    Glass(#[from] GlassError),
}

/// One sample of the exit pupil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilSample {
    /// The unit direction from the point of the sensor into the lens, in lens coordinates.
    pub direction: DVec3,
    /// Projected solid angle that the sample stands for (sr): the mean of weight times radiance
    /// over samples, blocked ones counted as 0, is the irradiance.
    pub weight: f64,
}

/// Where light can come from, for each point of a sensor.
#[derive(Debug, Clone)]
pub struct ExitPupil {
    sensor: Frame,
    half_size: DVec2,
    layout: Layout,
    nodes: Vec<Outline>,
    index2: f64,
    radius: f64,
}

/// How nodes lie on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// On a radius, for all directions across the sensor.
    Radial,
    /// On a grid.
    Planar,
}

/// The passing directions from one point of the sensor.
#[derive(Debug, Clone)]
struct Outline {
    /// The middle of the frame in slopes.
    centre: DVec2,
    /// The frame's half axes in slopes; 0 when nothing passes.
    half: DVec2,
    /// Radii in the frame by angle; the first again at the end.
    reach: [f64; ANGLES + 1],
    /// The slopes of the chief ray.
    chief: Option<DVec2>,
}

impl Outline {
    const DARK: Self =
        Self { centre: DVec2::ZERO, half: DVec2::ZERO, reach: [0.0; ANGLES + 1], chief: None };

    fn is_dark(&self) -> bool {
        self.half == DVec2::ZERO
    }
}

impl ExitPupil {
    /// Measures the exit pupil for a sensor of half width and half height `half_size` (mm) at
    /// `sensor_z`, tilted and decentred as the lens file says, at all of `wavelengths` (nm).
    ///
    /// # Errors
    ///
    /// When no light passes, when nothing bounds the light, or when a glass has no index.
    pub fn new(
        train: &OpticalTrain,
        wavelengths: &[f64],
        sensor_z: f64,
        half_size: [f64; 2],
    ) -> Result<Self, ExitPupilError> {
        let half_size = DVec2::from(half_size);
        if !half_size.is_finite() || half_size.min_element() < 0.0 || !sensor_z.is_finite() {
            return Err(ExitPupilError::Sensor);
        }
        if train.elements.iter().all(|e| !e.clear_radius().is_finite()) {
            return Err(ExitPupilError::Unbounded);
        }
        let symmetric = train.is_rotationally_symmetric();
        let mut pupil = Self {
            sensor: train.sensor_frame(sensor_z),
            half_size,
            layout: if symmetric { Layout::Radial } else { Layout::Planar },
            nodes: Vec::new(),
            index2: 1.0,
            radius: half_size.length(),
        };
        let train = &without_masks(train);
        let lenses = wavelengths.iter().map(|&nm| train.at(nm)).collect::<Result<Vec<_>, _>>()?;
        let Some(first) = lenses.first() else { return Err(ExitPupilError::Sensor) };
        pupil.index2 = first.index_before_sensor().powi(2);
        pupil.measure(train, &lenses);
        if pupil.nodes.iter().all(Outline::is_dark) {
            return Err(blocked(train, first, pupil.sensor.vertex));
        }
        pupil.widen_until_tight(&lenses);
        Ok(pupil)
    }

    /// Whether one radius of nodes serves the whole sensor; otherwise a coarser grid of nodes does,
    /// and more rays are lost.
    #[must_use]
    pub fn is_radial(&self) -> bool {
        self.layout == Layout::Radial
    }

    /// A point of the sensor in lens coordinates (mm), from its place on the sensor: x and y from
    /// the sensor's centre (mm), in the lens' axes. Images are upside down there.
    #[must_use]
    pub fn film_point(&self, film: DVec2) -> DVec3 {
        self.sensor.point(film.extend(0.0))
    }

    /// The direction for the point `u` of the unit square, uniform in area over the bound, as seen
    /// from `film` on the sensor (mm). `None` where no light arrives.
    ///
    /// Neighbouring points of the square give neighbouring directions.
    #[must_use]
    pub fn sample(&self, film: DVec2, u: [f64; 2]) -> Option<PupilSample> {
        let (disc_radius, turn) = concentric(u);
        let (sine, cosine) = (turn * std::f64::consts::TAU).sin_cos();
        let place = self.place(film)?;
        let (mut centre, mut half, mut reach) = (DVec2::ZERO, DVec2::ZERO, 0.0);
        for (node, weight) in place.nodes {
            let outline = &self.nodes[node];
            centre += outline.centre * weight;
            half += outline.half * weight;
            reach += between(&outline.reach, turn) * weight;
        }
        if reach <= 0.0 || half.min_element() <= 0.0 {
            return None;
        }
        let offset = DVec2::new(cosine, sine) * half * (reach * disc_radius);
        let slopes = place.turned(centre + offset);
        let area = std::f64::consts::PI * half.x * half.y * reach * reach;
        let direction = towards_lens(slopes);
        let cosine = -direction.z;
        let on_sensor = direction.dot(self.sensor.rotation.z_axis).abs();
        let weight = self.index2 * area * cosine.powi(3) * on_sensor;
        Some(PupilSample { direction, weight })
    }

    /// Appends one ray for each point of the sensor (mm) and point of the unit square, ready to be
    /// traced from [`Side::Sensor`]; its throughput is its weight. Where no light arrives the ray
    /// has ended and weighs 0.
    pub fn push_rays(&self, film: &[DVec2], u: &[[f64; 2]], rays: &mut LensRays) {
        for (&film, &u) in film.iter().zip(u) {
            let at = self.film_point(film);
            match self.sample(film, u) {
                Some(sample) => rays.push_weighted(at, sample.direction, sample.weight),
                None => {
                    rays.push_weighted(at, DVec3::NEG_Z, 0.0);
                    rays.set_fate(rays.len() - 1, Fate::Vignetted { element: 0 });
                }
            }
        }
    }

    /// The direction of the chief ray from `film` (mm), which passes the stop's centre; `None` where
    /// the stop's centre cannot be seen.
    #[must_use]
    pub fn chief_direction(
        &self,
        train: &OpticalTrain,
        at: &TrainAt,
        film: DVec2,
    ) -> Option<DVec3> {
        let start = self.place(film).and_then(|place| {
            let mut slopes = DVec2::ZERO;
            for (node, weight) in place.nodes {
                slopes += self.nodes[node].chief? * weight;
            }
            Some(place.turned(slopes))
        });
        train.chief_direction_from(at, self.film_point(film), start)
    }

    /// The bound as a polygon of slopes around the passing directions from `film`, for drawing;
    /// empty where no light arrives.
    #[must_use]
    pub fn outline(&self, film: DVec2) -> Vec<DVec2> {
        let Some(place) = self.place(film) else { return Vec::new() };
        let mut corners = Vec::with_capacity(ANGLES);
        for i in 0..ANGLES {
            let angle = turn_of(i) * std::f64::consts::TAU;
            let mut corner = [DVec2::ZERO, DVec2::ZERO];
            let mut reach = 0.0;
            for (node, weight) in place.nodes {
                let outline = &self.nodes[node];
                corner[0] += outline.centre * weight;
                corner[1] += outline.half * weight;
                reach += outline.reach[i] * weight;
            }
            corners.push(place.turned(corner[0] + DVec2::from_angle(angle) * corner[1] * reach));
        }
        corners
    }

    fn place(&self, film: DVec2) -> Option<Place> {
        match self.layout {
            Layout::Radial => self.radial_place(film),
            Layout::Planar => self.planar_place(film),
        }
    }

    fn radial_place(&self, film: DVec2) -> Option<Place> {
        let r = film.length();
        let intervals = self.nodes.len() - 1;
        #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
        let at = if self.radius > 0.0 { r / self.radius * intervals as f64 } else { 0.0 };
        let (low, share) = split(at, intervals)?;
        let axis = if r > 0.0 { film / r } else { DVec2::X };
        let nodes = [(low, 1.0 - share), (low + 1, share), (low, 0.0), (low, 0.0)];
        Some(Place { axis, nodes })
    }

    fn planar_place(&self, film: DVec2) -> Option<Place> {
        let along = |x: f64, half: f64| {
            #[expect(clippy::cast_precision_loss, reason = "8 intervals")]
            let at =
                if half > 0.0 { 0.5 * (x / half + 1.0) } else { 0.0 } * PLANAR_INTERVALS as f64;
            split(at, PLANAR_INTERVALS)
        };
        let (column, right) = along(film.x, self.half_size.x)?;
        let (row, down) = along(film.y, self.half_size.y)?;
        let node = |c: usize, r: usize| (row + r) * (PLANAR_INTERVALS + 1) + column + c;
        let nodes = [
            (node(0, 0), (1.0 - right) * (1.0 - down)),
            (node(1, 0), right * (1.0 - down)),
            (node(0, 1), (1.0 - right) * down),
            (node(1, 1), right * down),
        ];
        Some(Place { axis: DVec2::X, nodes })
    }

    /// The sensor's point at a node of the grid that is twice as fine.
    fn fine_film(&self, column: usize, row: usize) -> DVec2 {
        #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
        let share = |i: usize, intervals: usize| i as f64 / (2 * intervals) as f64;
        match self.layout {
            Layout::Radial => DVec2::new(self.radius * share(column, RADIAL_INTERVALS), 0.0),
            Layout::Planar => {
                let across =
                    DVec2::new(share(column, PLANAR_INTERVALS), share(row, PLANAR_INTERVALS));
                (2.0 * across - 1.0) * self.half_size
            }
        }
    }

    /// Intervals between nodes along both directions.
    fn intervals(&self) -> [usize; 2] {
        match self.layout {
            Layout::Radial => [RADIAL_INTERVALS, 0],
            Layout::Planar => [PLANAR_INTERVALS, PLANAR_INTERVALS],
        }
    }

    fn measure(&mut self, train: &OpticalTrain, lenses: &[TrainAt]) {
        let [columns, rows] = self.intervals();
        for row in 0..=rows {
            for column in 0..=columns {
                let film = self.film_point(self.fine_film(2 * column, 2 * row));
                let previous = self.nodes.last().filter(|_| column > 0);
                let node = frame_at(train, lenses, film, previous);
                self.nodes.push(node);
            }
        }
        self.continue_frames();
        let fine = self.measure_fine(lenses);
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
                    *reach = widest * (1.0 + MARGIN);
                }
            }
        }
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
    fn measure_fine(&self, lenses: &[TrainAt]) -> Vec<[f64; 2 * ANGLES]> {
        let [columns, rows] = self.intervals();
        let mut fine = Vec::new();
        for row in 0..=2 * rows {
            for column in 0..=2 * columns {
                let film = self.fine_film(column, row);
                let mut radii = [0.0; 2 * ANGLES];
                if let Some(frame) = self.frame(film) {
                    let at = self.film_point(film);
                    for lens in lenses {
                        widen(&mut radii, lens, at, frame);
                    }
                }
                fine.push(radii);
            }
        }
        fine
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

    /// Looks for rays that pass just outside of the bound, and widens it until there are none.
    fn widen_until_tight(&mut self, lenses: &[TrainAt]) {
        for _ in 0..4 {
            let mut needed = 1.0_f64;
            for lens in lenses {
                needed = needed.max(self.outermost(lens));
            }
            if needed <= 1.0 {
                return;
            }
            for reach in self.nodes.iter_mut().flat_map(|node| &mut node.reach) {
                *reach *= needed * (1.0 + MARGIN);
            }
        }
    }

    /// The greatest radius, in units of the bound's, at which a random ray outside of the bound
    /// passes; 1 when none does.
    fn outermost(&self, lens: &TrainAt) -> f64 {
        let mut rays = LensRays::with_capacity(CHECKS as usize);
        let mut radii = Vec::with_capacity(CHECKS as usize);
        for i in 0..CHECKS {
            // The additive recurrence of the plastic number in four dimensions (M. Roberts, 2018).
            let u = [
                0.856_674_883_854_503,
                0.733_891_856_627_126,
                0.628_706_721_037_806,
                0.538_597_270_645_735,
            ]
            .map(|alpha: f64| (0.5 + alpha * f64::from(i)).fract());
            let film = match self.layout {
                Layout::Radial => DVec2::new(self.radius * u[0].sqrt(), 0.0),
                Layout::Planar => (2.0 * DVec2::new(u[0], u[3]) - 1.0) * self.half_size,
            };
            let Some([centre, half]) = self.frame(film) else { continue };
            let Some(place) = self.place(film) else { continue };
            let reach: f64 =
                place.nodes.iter().map(|&(n, w)| between(&self.nodes[n].reach, u[1]) * w).sum();
            let radius = 1.0 + CHECKED * u[2];
            let angle = DVec2::from_angle(u[1] * std::f64::consts::TAU);
            let slopes = centre + angle * half * (reach * radius);
            rays.push(self.film_point(film), towards_lens(slopes));
            radii.push(radius);
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        let passed = (0..rays.len()).filter(|&i| rays.fate(i) == Fate::Exited);
        passed.map(|i| radii[i]).fold(1.0, f64::max)
    }
}

/// Which nodes a point of the sensor lies between, and how it is turned against them.
struct Place {
    /// The direction on the sensor that is the nodes' +x.
    axis: DVec2,
    nodes: [(usize, f64); 4],
}

impl Place {
    fn turned(&self, slopes: DVec2) -> DVec2 {
        self.axis.rotate(slopes)
    }
}

/// The interval that holds `at`, and the share of it that is passed; `None` beyond the last.
fn split(at: f64, intervals: usize) -> Option<(usize, f64)> {
    #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
    let last = intervals as f64;
    // Points on the very rim may be rounded past it.
    if !(at >= -1e-9 && at <= last * (1.0 + 1e-9) + 1e-9) {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and a few dozen"
    )]
    let low = (at.max(0.0) as usize).min(intervals.saturating_sub(1));
    #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
    let share = (at - low as f64).clamp(0.0, 1.0);
    Some((low, share))
}

#[expect(clippy::cast_precision_loss, reason = "at most 256 angles")]
fn turn_of(i: usize) -> f64 {
    i as f64 / ANGLES as f64
}

/// The table's value at a share of a full turn.
fn between(reach: &[f64; ANGLES + 1], turn: f64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "128 angles")]
    let at = turn * ANGLES as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a turn is in 0..=1"
    )]
    let low = (at as usize).min(ANGLES - 1);
    #[expect(clippy::cast_precision_loss, reason = "128 angles")]
    let share = at - low as f64;
    reach[low] + (reach[low + 1] - reach[low]) * share
}

/// From the unit square to the disc: radius and share of a full turn, with equal areas staying
/// equal (P. Shirley and K. Chiu, "A low distortion map between disk and square", 1997).
fn concentric(u: [f64; 2]) -> (f64, f64) {
    let [a, b] = u.map(|x| 2.0 * x - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, eighths) = if a.abs() > b.abs() { (a, b / a) } else { (b, 2.0 - a / b) };
    let turn = eighths / 8.0 + if radius < 0.0 { 0.5 } else { 0.0 };
    (radius.abs(), turn.rem_euclid(1.0))
}

/// The frame around what passes at any of the wavelengths, begun from the node before.
fn frame_at(
    train: &OpticalTrain,
    lenses: &[TrainAt],
    film: DVec3,
    previous: Option<&Outline>,
) -> Outline {
    let mut window: Option<Window> = None;
    let mut chief = None;
    for lens in lenses {
        let near = previous
            .filter(|node| !node.is_dark())
            .and_then(|node| Window::near(node.centre, node.half * 1.5, lens, film));
        let Some(found) = near.or_else(|| Window::find(train, lens, film)) else { continue };
        window =
            Some(window.map_or(found, |w| Window {
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
        Some(window) => {
            Outline { centre: window.centre(), half: window.half(), chief, ..Outline::DARK }
        }
        None => Outline::DARK,
    }
}

/// Raises `radii` to the outermost passing ray of each angle from `film` in the frame.
fn widen(radii: &mut [f64; 2 * ANGLES], lens: &TrainAt, film: DVec3, [centre, half]: [DVec2; 2]) {
    const SCANNED: u32 = 32;
    const HALVINGS: u32 = 12;
    // The frame's corners are √2 from its centre.
    const OUTERMOST: f64 = 1.6;
    let angle = |i: usize| DVec2::from_angle(0.5 * turn_of(i) * std::f64::consts::TAU) * half;
    let directions: Vec<DVec2> = (0..2 * ANGLES).map(angle).collect();
    let passes = |places: &[(usize, f64)]| -> Vec<bool> {
        let mut rays = LensRays::with_capacity(places.len());
        for &(i, radius) in places {
            rays.push(film, towards_lens(centre + directions[i] * radius));
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        (0..rays.len()).map(|i| rays.fate(i) == Fate::Exited).collect()
    };
    let step = OUTERMOST / f64::from(SCANNED);
    let scan: Vec<(usize, f64)> =
        (0..2 * ANGLES).flat_map(|i| (0..SCANNED).map(move |s| (i, step * f64::from(s)))).collect();
    let mut outermost = [None; 2 * ANGLES];
    for (&(i, radius), passed) in scan.iter().zip(passes(&scan)) {
        if passed {
            outermost[i] = Some(radius);
        }
    }
    let mut brackets: Vec<(usize, f64)> =
        (0..2 * ANGLES).filter_map(|i| outermost[i].map(|radius| (i, radius))).collect();
    let mut width = step;
    for _ in 0..HALVINGS {
        width *= 0.5;
        let middles: Vec<(usize, f64)> =
            brackets.iter().map(|&(i, low)| (i, low + width)).collect();
        for (bracket, passed) in brackets.iter_mut().zip(passes(&middles)) {
            if passed {
                bracket.1 += width;
            }
        }
    }
    for (i, low) in brackets {
        radii[i] = radii[i].max(low + width);
    }
}

/// The same lens with masks and filter pictures clear: the bound goes around their whole rectangle.
fn without_masks(train: &OpticalTrain) -> OpticalTrain {
    let mut train = train.clone();
    for element in &mut train.elements {
        if let Part::Aperture(opening) = &element.part
            && let Opening::Image(picture) = &**opening
        {
            element.part = Part::Aperture(Opening::Image(picture.blank()).into());
        }
    }
    train
}

/// The error that names what blocks the light.
fn blocked(train: &OpticalTrain, lens: &TrainAt, film: DVec3) -> ExitPupilError {
    let mut counts = FateCounts::new(train.elements.len());
    if let Some(mut rays) = Window::probe(train, film) {
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        counts.add_all(&rays);
    }
    let element = counts.worst_element().unwrap_or(train.stop);
    ExitPupilError::Dark { element, losses: counts.losses() }
}
