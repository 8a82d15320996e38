//! Fields of smooth wavefronts: path differences by a polynomial through the rays that an outline is
//! found by, instead of a ray that is aimed at every cell.
//!
//! A quarter of the rays that pass takes no part in the fit. Where one of them is farther from the polynomial than
//! a tolerance, the wavefront is not smooth, and each cell gets its own ray. What passes of a cell is
//! traced either way, in batches.

use glam::{DMat2, DVec2};

use super::aim::{self, FirstRay, Outline, PupilGrid};
use super::least_squares::LeastSquares;
use super::object::Beam;
use super::pupil::PupilField;
use super::wavefront::ReferenceSphere;

/// Degrees that are tried, one after another.
const DEGREES: [usize; 4] = [6, 10, 14, 20];

/// One more than the greatest degree.
const MOST: usize = 21;

/// Rays in the dark keep the polynomial from running away beside the pupil, and no more.
const DARK: f64 = 0.05;

/// Every so many-th ray is left out to check.
const CHECKED: usize = 4;

/// Greatest distance of a ray's place from that of its cell (shares of the beam's width): a rim is
/// as sharp as a tenth of a cell, which is a thousandth of it.
const ON_PLACE: f64 = 5e-4;

/// Beyond this share of the outline's half nothing is lit.
const OUTSIDE: f64 = 1.2;

/// Functions of one coordinate, and their derivatives.
type Basis = [[f64; MOST]; 2];

/// Chebyshev's polynomials of the first kind.
fn chebyshev(x: f64) -> Basis {
    let mut basis = [[0.0; MOST]; 2];
    basis[0][0] = 1.0;
    basis[0][1] = x;
    basis[1][1] = 1.0;
    for n in 2..MOST {
        basis[0][n] = 2.0 * x * basis[0][n - 1] - basis[0][n - 2];
        basis[1][n] = 2.0 * (basis[0][n - 1] + x * basis[1][n - 1]) - basis[1][n - 2];
    }
    basis
}

/// Powers.
fn powers(x: f64) -> Basis {
    let mut basis = [[0.0; MOST]; 2];
    basis[0][0] = 1.0;
    for n in 1..MOST {
        basis[0][n] = x * basis[0][n - 1];
        basis[1][n] = n as f64 * basis[0][n - 1];
    }
    basis
}

/// A polynomial of two coordinates along a line of one y: coefficients of functions of x, and those of its
/// derivative by y. Coefficients come by total degree, and in each by the degree in x.
struct LinePolynomial {
    degree: usize,
    values: [[f64; MOST]; 2],
}

impl LinePolynomial {
    fn new(coefficients: &[f64], degree: usize, y: &Basis) -> Self {
        let mut values = [[0.0; MOST]; 2];
        let mut term = coefficients.iter();
        for total in 0..=degree {
            for (i, coefficient) in (0..=total).zip(&mut term) {
                values[0][i] += coefficient * y[0][total - i];
                values[1][i] += coefficient * y[1][total - i];
            }
        }
        Self { degree, values }
    }

    /// Value, and derivatives by x and by y.
    fn at(&self, x: &Basis) -> (f64, DVec2) {
        let sum = |values: &[f64; MOST], x: &[f64; MOST]| -> f64 {
            values[..=self.degree].iter().zip(x).map(|(value, x)| value * x).sum()
        };
        let [own, by_y] = &self.values;
        (sum(own, &x[0]), DVec2::new(sum(own, &x[1]), sum(by_y, &x[0])))
    }
}

/// Path differences (mm) over places from the chief ray's.
struct PathPolynomial {
    /// The unit of places (optical direction cosines).
    scale: f64,
    degree: usize,
    coefficients: Vec<f64>,
}

impl PathPolynomial {
    /// The polynomial that rays are within `tolerance` (mm) of; `None` where there is none.
    fn through(rays: &[FirstRay], tolerance: f64) -> Option<Self> {
        let far = |ray: &FirstRay| ray.from_middle.abs().max_element();
        let scale = rays.iter().map(far).fold(0.0, f64::max);
        DEGREES.into_iter().find_map(|degree| {
            let terms = (degree + 1) * (degree + 2) / 2;
            if scale == 0.0 || rays.len() < 3 * terms {
                return None;
            }
            let mut fit = LeastSquares::new(terms);
            let mut row = Vec::with_capacity(terms);
            let mut lit = 0;
            for ray in rays {
                lit += usize::from(ray.is_lit);
                if ray.is_lit && lit.is_multiple_of(CHECKED) {
                    continue;
                }
                let [x, y] = (ray.from_middle / scale).to_array().map(chebyshev);
                row.clear();
                row.extend(
                    (0..=degree)
                        .flat_map(|total| (0..=total).map(move |i| x[0][i] * y[0][total - i])),
                );
                fit.add(&row, ray.ahead, if ray.is_lit { 1.0 } else { DARK });
            }
            let found = Self { scale, degree, coefficients: fit.solve()? };
            let is_near = |ray: &FirstRay| {
                let (ahead, _) = found.at(ray.from_middle);
                (ahead - ray.ahead).abs() <= tolerance
            };
            rays.iter().filter(|ray| ray.is_lit).all(is_near).then_some(found)
        })
    }

    fn at(&self, from_middle: DVec2) -> (f64, DVec2) {
        let [x, y] = (from_middle / self.scale).to_array().map(chebyshev);
        LinePolynomial::new(&self.coefficients, self.degree, &y).at(&x)
    }
}

/// True if the outline's polynomial reproduces the places of its rays.
fn has_places(outline: &Outline) -> bool {
    let lit = || outline.rays.iter().filter(|ray| ray.is_lit);
    let Some(first) = lit().next() else { return false };
    let bounds =
        lit().fold([first.place; 2], |[low, high], ray| [low.min(ray.place), high.max(ray.place)]);
    let width = (bounds[1] - bounds[0]).max_element();
    lit().all(|ray| {
        let (place, _) = outline.guess(ray.from_middle / outline.half);
        (place - ray.place).length() <= ON_PLACE * width
    })
}

/// The field of a beam on its sphere, with path differences within `tolerance` (waves); `None` where
/// the wavefront is not as smooth as that.
pub(crate) fn field(
    beam: &Beam<'_>,
    sphere: &ReferenceSphere,
    outline: &Outline,
    sampling: PupilGrid,
    tolerance: f64,
) -> Option<PupilField> {
    let PupilGrid { cells, step, middle } = sampling;
    let wavelength = beam.at.wavelength();
    let smooth = PathPolynomial::through(&outline.rays, tolerance * wavelength * 1e-6)?;
    if !has_places(outline) {
        return None;
    }
    let mut pupil = PupilField::dark(wavelength, cells, step, middle, sphere.index);
    let chief = glam::DVec3::from(beam.chief_end.ray.direction);
    pupil.chief_slopes = chief.truncate() / chief.z;
    let from_middle = |k: usize, axis: usize| {
        (k as f64 - (cells / 2) as f64) * step + middle[axis] - outline.middle[axis]
    };
    let bases = |axis: usize| -> Vec<[Basis; 2]> {
        let both = |at: f64| [powers(at / outline.half), chebyshev(at / smooth.scale)];
        (0..cells).map(|k| both(from_middle(k, axis))).collect()
    };
    let (columns, rows) = (bases(0), bases(1));
    let is_inside = |k: usize, axis: usize| from_middle(k, axis).abs() < OUTSIDE * outline.half;
    let mut places = vec![DVec2::splat(f64::NAN); cells * cells];
    let mut turns = vec![DMat2::ZERO; cells * cells];
    let length = 1.0 / (wavelength * 1e-6);
    for row in (0..cells).filter(|&row| is_inside(row, 1)) {
        let [power, polynomial] = &rows[row];
        let by_place = [0, 1].map(|axis| {
            outline.along(axis, |coefficients, degree| {
                LinePolynomial::new(coefficients, degree, power)
            })
        });
        let ahead = LinePolynomial::new(&smooth.coefficients, smooth.degree, polynomial);
        for column in (0..cells).filter(|&column| is_inside(column, 0)) {
            let i = row * cells + column;
            let [power, polynomial] = &columns[column];
            let [(x, by_x), (y, by_y)] = [0, 1].map(|axis: usize| by_place[axis].at(power));
            places[i] = DVec2::new(x, y);
            turns[i] = DMat2::from_cols(by_x, by_y).transpose() * (1.0 / outline.half);
            let (ahead, slope) = ahead.at(polynomial);
            pupil.waves[i] = ahead * length;
            // ∂W/∂p is where the ray lands, as the sphere's radius is to its way from the sphere to there.
            let (p, slope) = (pupil.place(i), slope / smooth.scale);
            pupil.landing[i] = slope * (1.0 + slope.dot(p) / (sphere.index * sphere.radius));
            let along = (sphere.index * sphere.index - p.length_squared()).max(1e-12).sqrt();
            pupil.slopes[i] = p / along;
        }
    }
    lit(&mut pupil, beam, &places, &turns);
    (pupil.total_power() > 0.0).then_some(pupil)
}

/// Computes the transmission and the power of each cell.
fn lit(pupil: &mut PupilField, beam: &Beam<'_>, places: &[DVec2], turns: &[DMat2]) {
    let cells = pupil.cells;
    let passed = beam.throughputs(places);
    let lit_neighbours = |i: usize| {
        let (row, column) = (i / cells, i % cells);
        let near = |k: usize| k.saturating_sub(1)..=(k + 1).min(cells - 1);
        let rows = near(row).map(|row| {
            passed[row * cells..][near(column)].iter().filter(|passed| **passed > 0.0).count()
        });
        (rows.sum::<usize>(), near(row).count() * near(column).count())
    };
    for i in (0..cells * cells).filter(|&i| places[i].is_finite()) {
        let ([clear, amplitude], lean) = match lit_neighbours(i) {
            (0, _) => continue,
            (lit, of) if lit < of => aim::cell(beam, places[i], turns[i] * pupil.step),
            _ => ([passed[i], passed[i].sqrt()], DVec2::ZERO),
        };
        let density = turns[i].determinant().abs();
        pupil.clear[i] = clear;
        pupil.lean[i] = lean * pupil.step;
        pupil.power[i] = clear * density;
        pupil.amplitude[i] = amplitude * density.sqrt();
    }
    aim::normalise(pupil);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::ObjectPoint;
    use crate::analysis::wavefront::chief_point;
    use crate::train::OpticalTrain;

    fn both(train: &OpticalTrain, tolerance: f64) -> (PupilField, Option<PupilField>) {
        let at = train.at(train.wavelength()).unwrap();
        let beam = Beam::new(train, &at, ObjectPoint::field(2.0)).unwrap();
        let centre = chief_point(&beam, train.sensor_z(crate::train::Focus::AsWritten).unwrap());
        let sphere = ReferenceSphere::about(train, &at, centre).unwrap();
        let outline = aim::outline(&beam, &sphere).unwrap();
        let sampling = PupilGrid::cells(64, &outline);
        let aimed = aim::field(&beam, &sphere, &outline, sampling).unwrap();
        (aimed, field(&beam, &sphere, &outline, sampling, tolerance))
    }

    fn lens(conic: f64) -> OpticalTrain {
        let text = format!(
            r#"{{"elements": [
            {{"type": "surface", "radius": 40, "thickness": 5, "glass": "N-BK7", "semi_diameter": 6, "stop": true}},
            {{"type": "surface", "radius": -40, "conic": {conic}, "semi_diameter": 8}}]}}"#
        );
        let file = crate::train::LensFile::from_json(&text).unwrap();
        file.build(&|name: &str| Err(name.to_owned())).unwrap()
    }

    /// The polynomial's field is the one that rays aimed at every cell have.
    #[test]
    fn a_smooth_wavefront_is_that_of_all_rays() {
        let (aimed, smooth) = both(&lens(-1.0), 1e-4);
        let smooth = smooth.expect("two spheres are smooth");
        let mut compared = 0;
        for i in aimed.lit().filter(|&i| aimed.clear[i] > 0.99) {
            compared += 1;
            // Newton's method ends within 1e-7 of a half, which is 20 waves of slope there at most.
            assert!((aimed.waves[i] - smooth.waves[i]).abs() < 1.2e-4, "{i}");
            // The slope of a polynomial is off by its degree squared times its error over the half.
            assert!((aimed.landing[i] - smooth.landing[i]).length() < 1e-4, "{i}");
            assert!((aimed.power[i] / smooth.power[i] - 1.0).abs() < 1e-3, "{i}");
        }
        assert!(compared > 2000, "{compared}");
        // The rim lies a thousandth of the width elsewhere at most: 0.03 of a cell on a side.
        for i in 0..aimed.clear.len() {
            assert!((aimed.clear[i] - smooth.clear[i]).abs() < 0.06, "{i}");
        }
    }

    /// No polynomial is good enough for any tolerance: what none is near enough to is left to rays.
    #[test]
    fn no_polynomial_is_good_enough_for_any_tolerance() {
        assert_eq!(both(&lens(-1.0), 1e-14).1, None);
    }
}
