//! From points of a mask to the directions in which points of the sensor see them.
//!
//! Directions are solved by Newton's method at points of the mask from nodes over the sensor, and joined
//! by Chebyshev polynomials over the mask (least squares) and by Lagrange's cubics over the sensor. A lens
//! that is round about its axis has its nodes on a radius: the mask is turned with the point of the
//! sensor. The degree is the least that lands rays as near as the mask's pixels ask for; behind a thin
//! lens the map is linear.
//!
//! The map is not the true one, but its Jacobian is known exactly, which is all that an unbiased estimate
//! needs; how far rays land from where they are aimed is measured where a map is made.

#![expect(clippy::cast_precision_loss, reason = "grids of a few hundred points")]

mod make;

use glam::{DMat3, DVec2, DVec3};

use crate::element::{Clip, Frame, Ray, RayStatus};
use crate::train::aim::towards_lens;
use crate::train::{MonochromaticTrain, OpticalTrain, Part, Side};

/// Intervals between nodes over a radius of the sensor, and over each of its sides. Not a setting, nor are the points:
/// how near rays are to land is one (`mask_aim_error`), and the degree follows it.
const RADIAL: usize = 24;
const PLANAR: usize = 12;

/// Points of the mask over each side of its square, at which directions are solved.
const POINTS: usize = 16;

/// Margin around the points that any node sees, as a share of the square, and the number of times
/// that the square is drawn in to them: polynomials of a high degree are for places that are seen.
const SEEN_MARGIN: f64 = 0.12;
const DRAWN_IN: u32 = 2;

/// The highest degree of the polynomials, and the number of their terms.
const MOST_DEGREE: usize = 9;
const MOST_TERMS: usize = terms(MOST_DEGREE);

/// The weight of points that other rims hide.
const HIDDEN: f64 = 1e-4;

/// Chebyshev's polynomials and their derivatives.
type Powers = [[f64; MOST_DEGREE + 1]; 2];

const fn terms(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Room for the terms of a map from one point of the sensor, which [`MaskMap::at`] fills.
pub(super) type Terms = [DVec2; MOST_TERMS];

pub(super) const NO_TERMS: Terms = [DVec2::ZERO; MOST_TERMS];

/// Calls a function for a degree, known when it is compiled: loops over terms then have no ends to guess.
macro_rules! of_degree {
    ($degree:expr, $function:ident($($argument:expr),*)) => {
        match $degree {
            1 => $function::<1>($($argument),*),
            3 => $function::<3>($($argument),*),
            5 => $function::<5>($($argument),*),
            7 => $function::<7>($($argument),*),
            _ => $function::<MOST_DEGREE>($($argument),*),
        }
    };
}

/// Geometry of a mask's map: a lens with its masks clear, at a wavelength, before a sensor.
#[derive(Clone, Copy)]
pub(super) struct MaskScene<'a> {
    pub(super) clear: &'a OpticalTrain,
    pub(super) lens: &'a MonochromaticTrain,
    /// The mask's element.
    pub(super) element: usize,
    pub(super) sensor: &'a Frame,
    /// Half width and half height of the sensor (mm).
    pub(super) half_size: DVec2,
}

/// A scene with its map.
#[derive(Clone, Copy)]
pub(super) struct MappedScene<'a> {
    pub(super) scene: MaskScene<'a>,
    pub(super) map: &'a MaskMap,
}

impl MaskScene<'_> {
    /// Point where a ray along slopes crosses the mask's plane, in the mask's frame (mm).
    pub(super) fn crossing(&self, film: DVec3, slopes: DVec2) -> Option<DVec2> {
        let ray = Ray::new(film, towards_lens(slopes))?;
        self.lens.crossing(Side::Sensor, self.element, ray).map(DVec2::from)
    }

    fn passes(&self, film: DVec3, slopes: DVec2) -> bool {
        Ray::new(film, towards_lens(slopes)).is_some_and(|ray| {
            self.lens.run(Side::Sensor, Clip::On, ray).status == RayStatus::Exited
        })
    }

    /// True if a turn about the axis turns the directions towards the mask's plane: all that bends
    /// rays is round and centred, and the mask and the sensor stand square to the axis.
    fn is_round(&self) -> bool {
        let bends_round = |(i, element): (usize, &crate::train::Element)| match &element.part {
            Part::Aperture(_) | Part::Filter(_) => {
                i != self.element || element.frame.rotation == DMat3::IDENTITY
            }
            part => part.is_round() && element.frame.is_axial(),
        };
        self.sensor.rotation == DMat3::IDENTITY
            && self.clear.elements().iter().enumerate().all(bends_round)
    }
}

/// The map at one wavelength.
#[derive(Debug, Clone)]
pub(super) struct MaskMap {
    round: bool,
    sensor: Frame,
    half_size: DVec2,
    /// The distance of the outermost node of a round lens from the axis (mm).
    radius: f64,
    /// Offset added to a point of the mask before it is turned (mm).
    offset: DVec2,
    /// The square of the mask that the polynomials are made for: centre and half sides (mm).
    centre: DVec2,
    half: DVec2,
    degree: usize,
    /// By nodes, [`terms`] of each; none where directions could not be solved.
    terms: Vec<Option<Vec<DVec2>>>,
    /// Number of nodes, from the first on, that have terms.
    known: usize,
}

/// The map from one point of the sensor.
pub(super) struct LocalMap<'a> {
    map: &'a MaskMap,
    terms: &'a Terms,
    /// The direction on the sensor that is the nodes' +x.
    axis: DVec2,
}

impl MaskMap {
    pub(super) fn degree(&self) -> usize {
        self.degree
    }

    /// The map from a point of the sensor (mm, on the sensor); `None` where it is not known.
    pub(super) fn at<'a>(&'a self, film: DVec2, room: &'a mut Terms) -> Option<LocalMap<'a>> {
        // Four nodes from one on, at weights.
        let four = |node: usize| -> Option<[&[DVec2]; 4]> {
            let [Some(a), Some(b), Some(c), Some(d)] = self.terms.get(node..node + 4)? else {
                return None;
            };
            Some([a, b, c, d])
        };
        if self.round {
            let across = self.sensor.vertex.truncate() + film;
            let r = across.length();
            let at = if self.radius > 0.0 { r / self.radius * RADIAL as f64 } else { 0.0 };
            // The outermost nodes may see nothing of the mask: the last ones that do go on a little.
            if self.known < 4 || at > self.known as f64 {
                return None;
            }
            let first = first_of_four(at, self.known - 1);
            let weights = cubics(at - first as f64);
            of_degree!(self.degree, add_four(room, four(first)?, weights));
            let axis = if r > 0.0 { across / r } else { DVec2::X };
            return Some(LocalMap { map: self, terms: room, axis });
        }
        let along = |x: f64, half: f64| {
            let at = if half > 0.0 { 0.5 * (x / half + 1.0) * PLANAR as f64 } else { 0.0 };
            let held = (-1e-9..=PLANAR as f64 + 1e-9).contains(&at);
            held.then(|| {
                let first = first_of_four(at, PLANAR);
                (first, cubics(at - first as f64))
            })
        };
        let (column, across) = along(film.x, self.half_size.x)?;
        let (row, down) = along(film.y, self.half_size.y)?;
        for (j, down) in down.into_iter().enumerate() {
            let nodes = four((row + j) * (PLANAR + 1) + column)?;
            of_degree!(self.degree, add_four(room, nodes, across.map(|weight| weight * down)));
        }
        Some(LocalMap { map: self, terms: room, axis: DVec2::X })
    }
}

/// Adds the terms of four nodes at their weights.
fn add_four<const DEGREE: usize>(sums: &mut Terms, nodes: [&[DVec2]; 4], weights: [f64; 4]) {
    let count = terms(DEGREE);
    let [a, b, c, d] = nodes;
    let [u, v, w, x] = weights;
    for ((((sum, a), b), c), d) in sums[..count].iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *sum += (*a * u + *b * v) + (*c * w + *d * x);
    }
}

impl LocalMap<'_> {
    /// Slopes towards a point of the mask (mm, in its frame), and the area of slopes that an area of the
    /// mask takes (1/mm²).
    pub(super) fn slopes(&self, at: DVec2) -> (DVec2, f64) {
        let [slopes, by_x, by_y] = self.value(self.inside(at));
        let area = by_x.perp_dot(by_y).abs() / (self.map.half.x * self.map.half.y);
        (self.axis.rotate(slopes), area)
    }

    /// The point of the mask (mm) towards which slopes lead, and the area as [`Self::slopes`] gives it:
    /// the map inverted by Newton's method.
    pub(super) fn point(&self, slopes: DVec2) -> Option<(DVec2, f64)> {
        let back = DVec2::new(self.axis.x, -self.axis.y);
        let wanted = back.rotate(slopes);
        let mut x = DVec2::ZERO;
        for _ in 0..40 {
            let [here, by_x, by_y] = self.value(x);
            let miss = wanted - here;
            let determinant = by_x.perp_dot(by_y);
            if miss.length() <= 1e-14 * (by_x.length() + by_y.length()) {
                let turned = self.map.centre + x * self.map.half;
                let at = self.axis.rotate(turned) - self.map.offset;
                return Some((at, determinant.abs() / (self.map.half.x * self.map.half.y)));
            }
            let step = DVec2::new(miss.perp_dot(by_y), by_x.perp_dot(miss)) / determinant;
            if !step.is_finite() {
                return None;
            }
            x += step.clamp_length_max(1.0);
            if x.abs().max_element() > 3.0 {
                return None;
            }
        }
        None
    }

    /// From a point of the mask to −1..1.
    fn inside(&self, at: DVec2) -> DVec2 {
        let back = DVec2::new(self.axis.x, -self.axis.y);
        (back.rotate(at + self.map.offset) - self.map.centre) / self.map.half
    }

    /// The polynomial and its derivatives.
    fn value(&self, at: DVec2) -> [DVec2; 3] {
        of_degree!(self.map.degree, polynomial(self.terms, at))
    }
}

/// A polynomial and its derivatives.
fn polynomial<const DEGREE: usize>(terms: &Terms, at: DVec2) -> [DVec2; 3] {
    let [x, y] = [chebyshev(at.x, DEGREE), chebyshev(at.y, DEGREE)];
    let mut sums = [DVec2::ZERO; 3];
    power::<DEGREE, 0>(terms, &x, &y, &mut sums);
    power::<DEGREE, 1>(terms, &x, &y, &mut sums);
    power::<DEGREE, 2>(terms, &x, &y, &mut sums);
    power::<DEGREE, 3>(terms, &x, &y, &mut sums);
    power::<DEGREE, 4>(terms, &x, &y, &mut sums);
    power::<DEGREE, 5>(terms, &x, &y, &mut sums);
    power::<DEGREE, 6>(terms, &x, &y, &mut sums);
    power::<DEGREE, 7>(terms, &x, &y, &mut sums);
    power::<DEGREE, 8>(terms, &x, &y, &mut sums);
    power::<DEGREE, 9>(terms, &x, &y, &mut sums);
    sums
}

/// Adds the terms of a power of x, which stand one after another by the power of y: as many as is known when
/// this is compiled, as loops whose ends vary cost more than what is in them.
#[inline(always)]
fn power<const DEGREE: usize, const POWER: usize>(
    terms: &Terms,
    [x, by_x]: &Powers,
    [y, by_y]: &Powers,
    sums: &mut [DVec2; 3],
) {
    if POWER > DEGREE {
        return;
    }
    let first = (0..POWER).map(|before| DEGREE + 1 - before).sum::<usize>();
    let (mut line, mut slope) = (DVec2::ZERO, DVec2::ZERO);
    for (j, term) in terms[first..][..DEGREE + 1 - POWER].iter().enumerate() {
        line += *term * y[j];
        slope += *term * by_y[j];
    }
    sums[0] += line * x[POWER];
    sums[1] += line * by_x[POWER];
    sums[2] += slope * x[POWER];
}

/// Chebyshev's polynomials up to a degree and their derivatives.
#[inline(always)]
fn chebyshev(x: f64, degree: usize) -> Powers {
    let mut value = [0.0; MOST_DEGREE + 1];
    let mut slope = [0.0; MOST_DEGREE + 1];
    (value[0], value[1], slope[1]) = (1.0, x, 1.0);
    for i in 2..=degree {
        value[i] = 2.0 * x * value[i - 1] - value[i - 2];
        slope[i] = 2.0 * (value[i - 1] + x * slope[i - 1]) - slope[i - 2];
    }
    [value, slope]
}

/// The first of the four nodes around a place among the nodes 0 to `last`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few dozen nodes")]
fn first_of_four(at: f64, last: usize) -> usize {
    (at.max(0.0) as usize).saturating_sub(1).min(last - 3)
}

/// Lagrange's cubics of the nodes 0 to 3 at `x`.
fn cubics(x: f64) -> [f64; 4] {
    let [a, b, c, d] = [x, x - 1.0, x - 2.0, x - 3.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// The R2 sequence (M. Roberts, 2018), corners of the square first.
pub(super) fn roberts(i: u32) -> DVec2 {
    if i < 4 {
        return DVec2::new(f64::from(i & 1), f64::from(i >> 1));
    }
    let along = |step: f64| (0.5 + step * f64::from(i)).fract();
    DVec2::new(along(0.754_877_666_246_693), along(0.569_840_290_998_053))
}
