//! Displacements of rays from where they land on the film at one wavelength to where they land at another, without
//! tracing them there.
//!
//! Both places lie within a pixel or a few, and the vector between them is that of a lens with axial symmetry: with the
//! place h on the film and the ray's slopes r there, both from the axis, `h P(h², h·r, r²) + r Q(h², h·r, r²)`. P and
//! Q have all terms up to the third degree, which are aberrations up to the seventh order (H. A. Buchdahl, *Optical
//! Aberration Coefficients*, 1954), and are fitted to rays that are traced. Where they leave more than interpolation
//! between wavelengths may be off, rays are traced.
//!
//! They hold of rays that pass at all wavelengths, as those that keep away from all rims ([`rims`](super::rims)); others
//! are traced.

use etendue_optics::analysis::least_squares::LeastSquares;
use etendue_optics::element::{Block, Clip, LANES, RayStatus};
use etendue_optics::train::{MonochromaticTrain, Side};
use glam::{DVec2, DVec3};

use super::rims::SceneRay;

/// More wavelengths than these take as long to fit as many rays take to be traced. Not a setting: it changes time alone.
pub(super) const MOST_WAVELENGTHS: usize = 4;

/// Rays that are fitted to, about.
const RAYS: usize = 2500;

/// Terms of three numbers up to the third degree.
const TERMS: usize = 20;

/// Displacements of rays between all pairs of wavelengths.
#[derive(Debug)]
pub(super) struct Displacements {
    scales: Scales,
    /// `[from][to]`.
    shifts: Vec<Vec<Shift>>,
    /// Greatest distance from where fitted rays land (mm).
    pub(super) error: f64,
}

/// Units of places and slopes, in which both are numbers of about one.
#[derive(Debug, Clone, Copy)]
struct Scales {
    /// Factor on places (1/mm).
    place: f64,
    /// Slopes of the middle of the light, as a multiple of the place (1/mm).
    chief: f64,
    /// Factor on slopes from there.
    slope: f64,
}

/// Polynomials of a displacement from one wavelength to another (mm): P and Q.
#[derive(Debug, Clone, Copy)]
struct Shift {
    along: [f64; TERMS],
    across: [f64; TERMS],
}

/// End of a ray on the film at a wavelength: its place from the axis (mm), and its slopes.
struct FilmEnd {
    place: DVec2,
    slopes: DVec2,
}

impl Displacements {
    /// Fits them to rays of the scene that come back into the lens at each wavelength from `lead` (mm) in front of where
    /// they left it, to a film at `sensor_z` (mm); `None` where these do not tell them.
    pub(super) fn fitted(
        nodes: &[MonochromaticTrain],
        rays: &[SceneRay],
        lead: f64,
        sensor_z: f64,
    ) -> Option<Self> {
        // Where they end at each wavelength: those that pass at all of them.
        let step = rays.len().div_ceil(RAYS).max(1);
        let ends_of = |&SceneRay { point, direction }: &SceneRay| -> Option<Vec<FilmEnd>> {
            let start = point + direction * lead;
            nodes.iter().map(|lens| film_end(lens, start, -direction, sensor_z)).collect()
        };
        let ends: Vec<Vec<FilmEnd>> = rays.iter().step_by(step).filter_map(ends_of).collect();
        let scales = Scales::of(&ends)?;
        let mut found = Self { scales, shifts: Vec::new(), error: 0.0 };
        for from in 0..nodes.len() {
            let to = |to: usize| {
                if to == from {
                    return Some((Shift::NONE, 0.0));
                }
                let shift = Shift::fitted(&scales, &ends, [from, to])?;
                Some((shift, shift.error(&scales, &ends, [from, to])))
            };
            let pairs = (0..nodes.len()).map(to).collect::<Option<Vec<_>>>()?;
            found.error = pairs.iter().fold(found.error, |most, (_, error)| most.max(*error));
            found.shifts.push(pairs.into_iter().map(|(shift, _)| shift).collect());
        }
        Some(found)
    }

    /// Moves the places of a block's rays from where they land at one wavelength to where they land at another, by how they
    /// start from the film: `scale` units of each axis are a mm.
    pub(super) fn displace(
        &self,
        [from, to]: [usize; 2],
        block: &Block,
        scale: [f64; 2],
        places: &mut [[f64; LANES]; 2],
    ) {
        displace_block(&self.scales, &self.shifts[from][to], block, scale, places);
    }
}

/// End of a ray of the scene on a film at `sensor_z` (mm); `None` where it ends before.
fn film_end(lens: &MonochromaticTrain, start: DVec3, way: DVec3, sensor_z: f64) -> Option<FilmEnd> {
    let path = lens.path(Side::Object, Clip::On, start, way);
    let (last, direction) = (path.points.last()?, path.direction?);
    if path.status != RayStatus::Exited {
        return None;
    }
    let slopes = direction.truncate() / direction.z;
    let place = last.truncate() + slopes * (sensor_z - last.z);
    (place.is_finite() && slopes.is_finite()).then_some(FilmEnd { place, slopes })
}

impl Scales {
    /// Those of all ends on the film; `None` where they are all on one place, or have one slope.
    fn of(ends: &[Vec<FilmEnd>]) -> Option<Self> {
        let all = || ends.iter().flatten();
        let place = all().map(|end| end.place.length()).fold(0.0, f64::max).recip();
        let squares: f64 = all().map(|end| end.place.length_squared()).sum();
        let chief = all().map(|end| end.place.dot(end.slopes)).sum::<f64>() / squares;
        let from_chief = |end: &FilmEnd| (end.slopes - end.place * chief).length();
        let slope = all().map(from_chief).fold(0.0, f64::max).recip();
        let scales = Self { place, chief, slope };
        [place, chief, slope].iter().all(|scale| scale.is_finite()).then_some(scales)
    }

    /// Place and slopes in these units.
    #[inline(always)]
    fn scaled(&self, place: [f64; 2], slopes: [f64; 2]) -> [[f64; 2]; 2] {
        let slope = |axis: usize| (slopes[axis] - place[axis] * self.chief) * self.slope;
        [[place[0] * self.place, place[1] * self.place], [slope(0), slope(1)]]
    }
}

/// h², h·r and r².
#[inline(always)]
fn invariants([h, r]: [[f64; 2]; 2]) -> [f64; 3] {
    [h[0] * h[0] + h[1] * h[1], h[0] * r[0] + h[1] * r[1], r[0] * r[0] + r[1] * r[1]]
}

/// All products of up to three of the invariants, in the order of [`polynomial`]'s coefficients.
fn products([u, v, w]: [f64; 3]) -> [f64; TERMS] {
    let second = [u * u, u * v, u * w, v * v, v * w, w * w];
    let [uu, uv, uw, vv, vw, ww] = second;
    [
        1.0,
        u,
        v,
        w,
        uu,
        uv,
        uw,
        vv,
        vw,
        ww,
        uu * u,
        uu * v,
        uu * w,
        u * vv,
        uv * w,
        u * ww,
        vv * v,
        vv * w,
        v * ww,
        ww * w,
    ]
}

/// The polynomial of three numbers with these coefficients.
#[inline(always)]
fn polynomial(c: &[f64; TERMS], [u, v, w]: [f64; 3]) -> f64 {
    let of_u = c[1]
        + u * (c[4] + u * c[10] + v * c[11] + w * c[12])
        + v * (c[5] + v * c[13] + w * c[14])
        + w * (c[6] + w * c[15]);
    let of_v = c[2] + v * (c[7] + v * c[16] + w * c[17]) + w * (c[8] + w * c[18]);
    let of_w = c[3] + w * (c[9] + w * c[19]);
    c[0] + u * of_u + v * of_v + w * of_w
}

impl Shift {
    const NONE: Self = Self { along: [0.0; TERMS], across: [0.0; TERMS] };

    /// By least squares of rays that end at both wavelengths; `None` where these do not tell it.
    fn fitted(scales: &Scales, ends: &[Vec<FilmEnd>], [from, to]: [usize; 2]) -> Option<Self> {
        let mut fit = LeastSquares::new(2 * TERMS);
        for ends in ends {
            let FilmEnd { place, slopes, .. } = &ends[from];
            let shift = ends[to].place - *place;
            let scaled = scales.scaled((*place).into(), (*slopes).into());
            let products = products(invariants(scaled));
            for axis in 0..2 {
                let [along, across] = scaled.map(|vector| products.map(|term| vector[axis] * term));
                fit.add(&[along, across].concat(), shift[axis], 1.0);
            }
        }
        let found = fit.solve()?;
        let (along, across) = found.split_at(TERMS);
        Some(Self { along: along.try_into().ok()?, across: across.try_into().ok()? })
    }

    /// Greatest distance from where rays end (mm).
    fn error(&self, scales: &Scales, ends: &[Vec<FilmEnd>], [from, to]: [usize; 2]) -> f64 {
        let off = |ends: &Vec<FilmEnd>| {
            let FilmEnd { place, slopes, .. } = &ends[from];
            let shift = self.at(scales.scaled((*place).into(), (*slopes).into()));
            (DVec2::from(shift) + *place).distance(ends[to].place)
        };
        ends.iter().map(off).fold(0.0, f64::max)
    }

    /// That of a ray with a place and slopes in the units of [`Scales`].
    #[inline(always)]
    fn at(&self, [h, r]: [[f64; 2]; 2]) -> [f64; 2] {
        let of = invariants([h, r]);
        let (along, across) = (polynomial(&self.along, of), polynomial(&self.across, of));
        [h[0] * along + r[0] * across, h[1] * along + r[1] * across]
    }
}

/// Moves the places of the rays of a block that start from the film.
#[multiversion::multiversion(targets = "simd")]
fn displace_block(
    scales: &Scales,
    shift: &Shift,
    block: &Block,
    scale: [f64; 2],
    places: &mut [[f64; LANES]; 2],
) {
    let [x, y, _] = &block.position;
    let [u, v, w] = &block.direction;
    let (scales, shift) = (*scales, *shift);
    for i in 0..LANES {
        let inverse = 1.0 / w[i];
        let scaled = scales.scaled([x[i], y[i]], [u[i] * inverse, v[i] * inverse]);
        let [by_x, by_y] = shift.at(scaled);
        places[0][i] += by_x * scale[0];
        places[1][i] += by_y * scale[1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients stand before the products that they are fitted to.
    #[test]
    fn the_polynomial_is_the_sum_of_its_products() {
        let of = [0.7, -0.3, 0.45];
        let products = products(of);
        let mut all = [0.0; TERMS];
        let mut sum = 0.0;
        for (k, product) in products.iter().enumerate() {
            let mut one = [0.0; TERMS];
            one[k] = 1.0;
            assert!((polynomial(&one, of) - product).abs() < 1e-15, "{k}");
            all[k] = 1.0 + k as f64;
            sum += all[k] * product;
        }
        assert!((polynomial(&all, of) - sum).abs() < 1e-13);
    }
}
