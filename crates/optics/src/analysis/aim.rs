//! Rays to the middles of a pupil's cells, and how much of each cell is clear.
//!
//! Rays are begun by coordinates of the object's side, and cells lie even on the reference sphere. The
//! way back from the sphere to those coordinates is a polynomial through rays that pass, from which
//! each ray is aimed by Newton's method until it meets the middle of its cell.

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use super::least_squares::LeastSquares;
use super::object::Beam;
use super::pupil::{PupilField, RIM};
use super::wavefront::ReferenceSphere;
use super::{AnalysisError, LEAST_CELLS, MOST_CELLS};
use crate::element::RayStatus;

/// Degree of the polynomial.
const DEGREE: usize = 7;

/// Its terms.
const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;

/// Rays a side of the rectangle of those that it is fitted to.
const SAMPLES: u32 = 56;

/// Steps of Newton's method.
const STEPS: u32 = 6;

/// Tolerance of a ray's aim at the middle of its cell (shares of the pupil's half).
const ON_TARGET: f64 = 1e-7;

/// Places across a cell at the pupil's edge.
const FINE: u32 = 10;

/// The lit part of the reference sphere.
#[derive(Debug, Clone)]
pub(crate) struct Outline {
    /// The chief ray's place on the sphere (optical direction cosines).
    pub(crate) middle: DVec2,
    /// The chief ray's path to the sphere (mm).
    pub(crate) path: f64,
    /// The greatest distance of a lit place from the middle, in x or in y.
    pub(crate) half: f64,
    /// From places about the middle, in shares of `half`, to coordinates of the beam.
    coefficients: [Vec<f64>; 2],
    /// Rays by which the outline was found.
    pub(super) rays: Vec<FirstRay>,
}

/// A ray of the grid that an outline is found by.
#[derive(Debug, Clone, Copy)]
pub(super) struct FirstRay {
    /// Coordinates of the beam.
    pub(super) place: DVec2,
    /// On the sphere, from the chief ray (optical direction cosines).
    pub(super) from_middle: DVec2,
    /// The path of the chief ray less its own (mm).
    pub(super) ahead: f64,
    /// True if light passes.
    pub(super) is_lit: bool,
}

/// A grid over the pupil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PupilGrid {
    /// Cells a side.
    pub(crate) cells: usize,
    /// A cell's side (optical direction cosines).
    pub(crate) step: f64,
    /// The middle of cell (`cells`/2, `cells`/2) (optical direction cosines).
    pub(crate) middle: DVec2,
}

impl PupilGrid {
    /// So many cells over an outline.
    pub(crate) fn cells(cells: usize, outline: &Outline) -> Self {
        let step = outline.half / (0.5 * cells as f64 - RIM);
        Self { cells, step, middle: outline.middle }
    }
}

/// Powers of two numbers up to the degree, and their derivatives.
fn basis(at: DVec2) -> [[f64; TERMS]; 3] {
    let mut terms = [[0.0; TERMS]; 3];
    let powers = |x: f64| {
        let mut powers = [1.0; DEGREE + 1];
        for i in 1..=DEGREE {
            powers[i] = powers[i - 1] * x;
        }
        powers
    };
    let (x, y) = (powers(at.x), powers(at.y));
    let mut term = 0;
    for total in 0..=DEGREE {
        for i in 0..=total {
            let j = total - i;
            terms[0][term] = x[i] * y[j];
            terms[1][term] = if i > 0 { i as f64 * x[i - 1] * y[j] } else { 0.0 };
            terms[2][term] = if j > 0 { j as f64 * x[i] * y[j - 1] } else { 0.0 };
            term += 1;
        }
    }
    terms
}

impl Outline {
    /// Evaluates `line` on the polynomial of one coordinate of the beam, by powers of shares, and its degree.
    pub(super) fn along<T>(&self, axis: usize, line: impl Fn(&[f64], usize) -> T) -> T {
        line(&self.coefficients[axis], DEGREE)
    }

    /// Coordinates of the beam for a place in shares, and their derivatives by the shares.
    pub(super) fn guess(&self, share: DVec2) -> (DVec2, DMat2) {
        let terms = basis(share);
        let sum = |values: &[f64; TERMS], axis: usize| -> f64 {
            values.iter().zip(&self.coefficients[axis]).map(|(t, c)| t * c).sum()
        };
        let by = |values: &[f64; TERMS]| DVec2::new(sum(values, 0), sum(values, 1));
        (by(&terms[0]), DMat2::from_cols(by(&terms[1]), by(&terms[2])))
    }
}

/// Finds the part of the sphere that a beam lights.
pub(crate) fn outline(beam: &Beam<'_>, sphere: &ReferenceSphere) -> Result<Outline, AnalysisError> {
    let no_sphere = || AnalysisError::no_sphere(sphere.centre[2]);
    let (middle, rest) = sphere.meet(&beam.chief_end).ok_or_else(no_sphere)?;
    let path = beam.chief_end.length + rest;
    let [low, high] = beam.bounds()?;
    let size = (high - low) / f64::from(SAMPLES);
    // All that leave, for the polynomial; those that are lit, for the half.
    let mut rays = Vec::new();
    let mut half = 0.0_f64;
    let cell = |k: u32| DVec2::new(f64::from(k % SAMPLES) + 0.5, f64::from(k / SAMPLES) + 0.5);
    let places: Vec<DVec2> = (0..SAMPLES * SAMPLES).map(|k| low + cell(k) * size).collect();
    for (&place, passed) in places.iter().zip(beam.throughputs(&places)) {
        let Some(end) = beam.run_on(place) else { continue };
        let Some((cosines, rest)) = sphere.meet(&end) else { continue };
        let (is_lit, from_middle) = (passed > 0.0, cosines - middle);
        if is_lit {
            half = half.max(from_middle.abs().max_element());
        }
        rays.push(FirstRay { place, from_middle, ahead: path - (end.length + rest), is_lit });
    }
    if half == 0.0 {
        return Err(AnalysisError::Dark { field: beam.object.name() });
    }
    // The middles of cells lie up to one cell inside.
    let lit = rays.iter().filter(|ray| ray.is_lit).count();
    half *= 1.0 + 1.5 / (lit as f64).sqrt().max(4.0);
    let mut fits = [LeastSquares::new(TERMS), LeastSquares::new(TERMS)];
    // Far outside, rays run in ways that no polynomial follows.
    rays.retain(|ray| (ray.from_middle / half).abs().max_element() < 1.2);
    for ray in &rays {
        let row = basis(ray.from_middle / half)[0];
        fits[0].add(&row, ray.place.x, 1.0);
        fits[1].add(&row, ray.place.y, 1.0);
    }
    let singular = AnalysisError::Singular { terms: TERMS, rays: lit };
    let [x, y] = fits.map(LeastSquares::solve);
    let coefficients = [x.ok_or(singular.clone())?, y.ok_or(singular)?];
    let mut outline = Outline { middle, path, half, coefficients, rays };
    outline.half = trimmed(beam, &outline);
    Ok(rescaled(outline, half))
}

/// The half of the outline, looked at more closely: lit places along its edge.
fn trimmed(beam: &Beam<'_>, outline: &Outline) -> f64 {
    const LINES: u32 = 200;
    const ACROSS: u32 = 200;
    let share = |i: u32, n: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
    let is_lit = |line: f64| {
        let places = (0..ACROSS).flat_map(|k| {
            let along = share(k, ACROSS);
            let (a, b) = (DVec2::new(line, along), DVec2::new(along, line));
            [a, DVec2::new(-line, along), b, DVec2::new(along, -line)]
        });
        let places: Vec<DVec2> = places.map(|place| outline.guess(place).0).collect();
        beam.throughputs(&places).iter().any(|passed| *passed > 0.0)
    };
    // From outside inwards: the first line of places with light.
    let lines = (0..LINES).map(|i| 1.0 - f64::from(i) / f64::from(LINES));
    let first = lines.into_iter().find(|&line| is_lit(line));
    first.map_or(1.0, |line| (line + 1.0 / f64::from(LINES)).min(1.0)) * outline.half
}

/// The outline with its polynomial in shares of its own half, from that in shares of `before`.
fn rescaled(mut outline: Outline, before: f64) -> Outline {
    let ratio = outline.half / before;
    let mut term = 0;
    for total in 0..=DEGREE {
        let factor = ratio.powi(i32::try_from(total).unwrap_or(0));
        for _ in 0..=total {
            outline.coefficients[0][term] *= factor;
            outline.coefficients[1][term] *= factor;
            term += 1;
        }
    }
    outline
}

/// A cell's ray.
#[derive(Debug, Clone, Copy)]
struct CellRay {
    /// Coordinates of the beam.
    place: DVec2,
    /// Their derivatives by optical direction cosines.
    turn: DMat2,
    /// The path of the chief ray less its own (mm).
    ahead: f64,
    landing: DVec2,
    slopes: DVec2,
    throughput: f64,
}

/// The field of a beam on its sphere.
pub(crate) fn field(
    beam: &Beam<'_>,
    sphere: &ReferenceSphere,
    outline: &Outline,
    sampling: PupilGrid,
) -> Result<PupilField, AnalysisError> {
    let PupilGrid { cells, step, middle } = sampling;
    if !(LEAST_CELLS..=MOST_CELLS).contains(&cells) {
        return Err(AnalysisError::out_of_range(cells));
    }
    let wavelength = beam.at.wavelength();
    let mut pupil = PupilField::dark(wavelength, cells, step, middle, sphere.index);
    let chief = DVec3::from(beam.chief_end.ray.direction);
    pupil.chief_slopes = chief.truncate() / chief.z;
    let aimed: Vec<Option<CellRay>> = (0..cells * cells)
        .into_par_iter()
        .map(|i| aim(beam, sphere, outline, pupil.place(i)))
        .collect();
    let is_lit = |i: usize| aimed[i].is_some_and(|ray| ray.throughput > 0.0);
    let clear: Vec<([f64; 2], DVec2)> = (0..cells * cells)
        .into_par_iter()
        .map(|i| {
            let others = neighbours(i, cells);
            let lit = others.iter().filter(|&&other| is_lit(other)).count();
            match aimed[i].or_else(|| others.iter().find_map(|&other| aimed[other])) {
                Some(ray) if lit > 0 && lit < others.len() => {
                    let middle = match aimed[i] {
                        Some(ray) => ray.place,
                        None => outline.guess((pupil.place(i) - outline.middle) / outline.half).0,
                    };
                    cell(beam, middle, ray.turn * step)
                }
                Some(ray) if lit > 0 => ([ray.throughput, ray.throughput.sqrt()], DVec2::ZERO),
                _ => ([0.0; 2], DVec2::ZERO),
            }
        })
        .collect();
    let length = 1.0 / (wavelength * 1e-6);
    for i in 0..cells * cells {
        let nearby = || neighbours(i, cells).into_iter().find_map(|other| aimed[other]);
        let ([passes, amplitude], lean) = clear[i];
        let Some(ray) = aimed[i].or_else(|| nearby().filter(|_| passes > 0.0)) else { continue };
        let density = ray.turn.determinant().abs();
        pupil.clear[i] = passes;
        pupil.lean[i] = lean * step;
        pupil.power[i] = passes * density;
        pupil.amplitude[i] = amplitude * density.sqrt();
        pupil.waves[i] = ray.ahead * length;
        pupil.landing[i] = ray.landing;
        pupil.slopes[i] = ray.slopes;
    }
    normalise(&mut pupil);
    if pupil.total_power() <= 0.0 {
        return Err(AnalysisError::Dark { field: beam.object.name() });
    }
    Ok(pupil)
}

/// A mean power of 1 where all is clear.
pub(super) fn normalise(pupil: &mut PupilField) {
    let clear: f64 = pupil.clear.iter().sum();
    let mean = pupil.total_power() / clear;
    if mean > 0.0 && mean.is_finite() {
        pupil.power.iter_mut().for_each(|power| *power /= mean);
        pupil.amplitude.iter_mut().for_each(|amplitude| *amplitude /= mean.sqrt());
    }
}

/// A cell and those around it.
fn neighbours(i: usize, cells: usize) -> Vec<usize> {
    let (row, column) = (i / cells, i % cells);
    let near = |x: usize| x.saturating_sub(1)..=(x + 1).min(cells - 1);
    near(row).flat_map(|row| near(column).map(move |column| row * cells + column)).collect()
}

/// Mean transmission of a cell, the mean of its root, and the middle of that from the cell's own
/// (in cells).
pub(super) fn cell(beam: &Beam<'_>, middle: DVec2, turn: DMat2) -> ([f64; 2], DVec2) {
    let offset = |k: u32| (f64::from(k) + 0.5) / f64::from(FINE) - 0.5;
    let at = |k: u32| DVec2::new(offset(k % FINE), offset(k / FINE));
    let places: Vec<DVec2> = (0..FINE * FINE).map(|k| middle + turn * at(k)).collect();
    let (mut sum, mut roots, mut lean) = (0.0, 0.0, DVec2::ZERO);
    for (at, passes) in (0..).map(at).zip(beam.throughputs(&places)) {
        sum += passes;
        roots += passes.sqrt();
        lean += at * passes.sqrt();
    }
    let lean = if roots > 0.0 { lean / roots } else { lean };
    ([sum, roots].map(|sum| sum / f64::from(FINE * FINE)), lean)
}

/// The ray that meets the sphere at `target`.
fn aim(
    beam: &Beam<'_>,
    sphere: &ReferenceSphere,
    outline: &Outline,
    target: DVec2,
) -> Option<CellRay> {
    let share = (target - outline.middle) / outline.half;
    let (mut place, by_share) = outline.guess(share);
    let turn = by_share * (1.0 / outline.half);
    let mut miss = f64::INFINITY;
    for _ in 0..STEPS {
        let end = beam.run_on(place)?;
        let (cosines, rest) = sphere.meet(&end)?;
        let off = target - cosines;
        let far = off.abs().max_element() / outline.half;
        if far < ON_TARGET {
            let direction = DVec3::from(end.ray.direction);
            let position = DVec3::from(end.ray.position);
            let slopes = direction.truncate() / direction.z;
            let centre = DVec3::from(sphere.centre);
            let landing = position.truncate() + slopes * (centre.z - position.z);
            let is_clear = end.status == RayStatus::Exited;
            let throughput = if is_clear { beam.throughput(place) } else { 0.0 };
            let landing = landing - centre.truncate();
            let ahead = outline.path - (end.length + rest);
            return Some(CellRay { place, turn, ahead, landing, slopes, throughput });
        }
        if far > miss {
            return None;
        }
        miss = far;
        place += turn * off;
    }
    None
}
