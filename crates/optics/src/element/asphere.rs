//! Even aspheres, met by [Newton's method](super::newton) from where the ray meets the conic underneath.

use super::newton::{Profile, squares_along};
use super::rays::Ray;
use super::real::Real;
use super::refract::{IndexPair, Root, meet_conic};
use super::surface::Surface;

impl Surface {
    /// Lower and upper bounds of the sag (mm) between two squared distances from the axis (mm²),
    /// the nearer first.
    ///
    /// Each term rises or falls all the way: those that rise are least at the nearer place, those that fall at
    /// the farther one.
    pub(super) fn sag_bounds_between(&self, squares: [f64; 2]) -> [f64; 2] {
        let part = |u: f64| {
            let conic = self.conic_sag(u);
            let (mut rising, mut falling) = (0.0, 0.0);
            for &a in self.aspheric.iter().rev() {
                rising = rising * u + a.max(0.0);
                falling = falling * u + a.min(0.0);
            }
            [conic.max(0.0) + rising * u, conic.min(0.0) + falling * u]
        };
        let [near, far] = [part(squares[0]), part(squares[1])];
        [near[0] + far[1], far[0] + near[1]]
    }
}

impl Profile for Surface {
    /// (∂z/∂x)/x.
    type Slope<T: Real> = T;

    #[inline(always)]
    fn begin(&self, ray: Ray) -> (Ray, f64) {
        let crossing = meet_conic::<false, f64>(self, ray, Root::Near);
        (crossing.ray, crossing.t)
    }

    #[inline(always)]
    fn sag_and_slope<T: Real>(&self, at: Ray<T>) -> (T, T) {
        let [x, y, _] = at.position;
        self.profile(x * x + y * y)
    }

    #[inline(always)]
    fn sags_and_slopes<const N: usize>(&self, [x, y, _]: &[[f64; N]; 3]) -> ([f64; N], [f64; N]) {
        // As [`super::surface::polynomial`], term by term, so that a term of all is one instruction.
        let (mut values, mut slopes, mut squares) = ([0.0; N], [0.0; N], [0.0; N]);
        for lane in 0..N {
            squares[lane] = x[lane] * x[lane] + y[lane] * y[lane];
        }
        for &a in self.aspheric.iter().rev() {
            for lane in 0..N {
                slopes[lane] = slopes[lane] * squares[lane] + values[lane];
                values[lane] = values[lane] * squares[lane] + a;
            }
        }
        for lane in 0..N {
            let u = squares[lane];
            let (value, slope) = (values[lane] * u, values[lane] + slopes[lane] * u);
            (values[lane], slopes[lane]) = self.with_conic(u, value, slope);
        }
        (values, slopes)
    }

    #[inline(always)]
    fn slope_at(&self, _root: Ray, slope: f64) -> f64 {
        slope
    }

    #[inline(always)]
    fn along<T: Real>(&self, at: Ray<T>, slope: T) -> T {
        let Ray { position: [x, y, _], direction: [u, v, w] } = at;
        w - slope * (x * u + y * v)
    }

    #[inline(always)]
    fn exists(&self, [x, y]: [f64; 2]) -> bool {
        x * x + y * y <= self.domain().powi(2)
    }

    #[inline(always)]
    fn refract<T: Real>(&self, media: IndexPair, at: Ray<T>, slope: T) -> (Ray<T>, bool) {
        let Ray { position: [x, y, _], direction: [u, v, w] } = at;
        let one = T::constant(1.0);
        let m = [-slope * x, -slope * y, one];
        let along = u * m[0] + v * m[1] + w;
        media.refract(at, m, one + slope * slope * (x * x + y * y), along * along, along)
    }

    fn extent(&self) -> [f64; 2] {
        let c = self.curvature;
        [self.domain(), if c == 0.0 { 10.0 } else { (2.0 / c).abs() }]
    }

    fn clear_radius(&self) -> f64 {
        self.semi_diameter
    }

    fn sag_range(&self, reach: f64) -> [f64; 2] {
        self.sag_bounds_between([0.0, reach * reach])
    }

    fn sag_bounds(&self, ray: Ray, part: [f64; 2]) -> [f64; 2] {
        self.sag_bounds_between(squares_along(ray, part))
    }

    fn along_bounds(&self, ray: Ray, part: [f64; 2]) -> [f64; 2] {
        let Ray { position: [x, y, _], direction: [u, v, w] } = ray;
        let slopes = self.slope_bounds(squares_along(ray, part));
        let across = part.map(|t| (x + t * u) * u + (y + t * v) * v);
        let changes = slopes.into_iter().flat_map(|slope| across.map(|across| w - slope * across));
        changes.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], c| [l.min(c), h.max(c)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::crossings::cross_block;
    use crate::element::newton::cross;
    use crate::element::rays::{LANES, PENDING};
    use crate::element::refract::RefractedRay;
    use crate::element::refraction::Refraction;
    use crate::element::surface::polynomial;

    fn ray(position: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray::new(position.into(), direction.into()).unwrap()
    }

    fn asphere(curvature: f64, conic: f64, aspheric: &[f64]) -> Refraction {
        let surface =
            Surface { curvature, conic, aspheric: aspheric.to_vec(), semi_diameter: f64::INFINITY };
        Refraction::new(surface, 1.0, 1.5)
    }

    fn at_asphere(asphere: &Refraction, ray: Ray, clip2: f64) -> RefractedRay {
        cross(&asphere.surface, asphere.media, ray, clip2)
    }

    #[test]
    fn a_point_found_lies_on_the_surface_to_the_last_digits() {
        let s = asphere(1.0 / 31.4, -0.5907, &[0.0, -3.497e-7, -4.9708e-10, -2.439e-13]);
        for height in [0.0, 1.0, 8.0, 15.0] {
            let at = at_asphere(&s, ray([height, 2.0, -20.0], [0.01, -0.03, 1.0]), 1e9);
            let [x, y, z] = at.ray.position;
            assert!(at.hit && (z - s.surface.profile(x * x + y * y).0).abs() < 1e-14);
        }
    }

    #[test]
    fn an_asphere_that_only_spells_a_sphere_is_the_sphere() {
        // The sphere's own series, cut off at r¹⁶, on a flat base: at r = 1 of R = 10 the rest is
        // about 0.01⁹ · 10.
        let r: f64 = 10.0;
        let binomial = [0.5, 0.125, 0.0625, 0.0390625, 0.02734375, 0.0205078125, 0.01611328125];
        let series: Vec<f64> =
            binomial.iter().zip(0..).map(|(b, i)| b * r.powi(-(2 * i + 1))).collect();
        let flat = asphere(0.0, 0.0, &series);
        let sphere = Refraction::new(Surface::sphere(0.1), 1.0, 1.5);
        let start = ray([0.8, 0.5, -4.0], [0.02, 0.01, 1.0]);
        let (a, b) = (at_asphere(&flat, start, 1e9).ray, sphere.exactly(start, 1e9).ray);
        for axis in 0..3 {
            assert!((a.position[axis] - b.position[axis]).abs() < 1e-15);
            assert!((a.direction[axis] - b.direction[axis]).abs() < 1e-14);
        }
    }

    #[test]
    fn a_steep_asphere_yields_its_first_root_or_a_miss_and_never_nonsense() {
        // Rings as steep as 3:1 on which Newton's method runs away.
        let s = asphere(0.02, 0.0, &[0.0, 4e-3, -9e-5, 5e-7]);
        let (mut hits, mut first) = (0, 0);
        for i in 0..400 {
            let height = 0.025 * f64::from(i);
            for slope in [-1.2, -0.4, 0.0, 0.7, 2.0] {
                let start = ray([height - 30.0 * slope, 0.3, -30.0], [slope, 0.0, 1.0]);
                let at = at_asphere(&s, start, 1e9);
                if !at.hit {
                    continue;
                }
                hits += 1;
                let [x, y, z] = at.ray.position;
                let sag = s.surface.profile(x * x + y * y).0;
                assert!((z - sag).abs() < 1e-9, "{height} {slope}: {}", z - sag);
                // Nowhere before is the ray behind the surface.
                let t = (x - start.position[0]) / start.direction[0].abs().max(1e-300);
                let reach = if slope == 0.0 { z + 30.0 } else { t.abs() };
                let inside = |j: u32| {
                    let at = start.advanced(reach * f64::from(j) / 2000.0);
                    s.surface.sag_and_slope(at).0 - at.position[2] < -1e-6
                };
                first += u32::from(!(0..1990).any(inside));
            }
        }
        assert!(hits > 1500, "{hits}");
        // Newton may pass over a grazing pair of roots; nearly all roots are the first.
        assert!(first * 100 >= hits * 97, "{first} of {hits}");
    }

    #[test]
    fn vector_and_single_rays_agree_to_the_last_bit() {
        let s = asphere(1.0 / 31.4, -0.5907, &[0.0, -3.497e-7, -4.9708e-10, -2.439e-13]);
        let mut rays = crate::element::LensRays::default();
        for i in 0..LANES {
            let x = i as f64 * 0.5;
            rays.push([x, 1.0, -20.0].into(), [0.02, -0.01 * x, 1.0].into());
        }
        let before = rays.blocks[0].clone();
        cross_block(&s.boundary(), &mut rays.blocks[0], 0, 0.0, 1e9, |_, _, _| ());
        for lane in 0..LANES {
            let single = at_asphere(&s, before.ray(lane), 1e9);
            let batch = rays.blocks[0].ray(lane);
            if single.hit && single.through {
                assert_eq!(batch.position, single.ray.position);
                assert_eq!(batch.direction, single.ray.direction);
            } else {
                assert_eq!(rays.blocks[0].outcome[lane], PENDING);
            }
        }
    }

    #[test]
    fn horner_gives_value_and_derivative() {
        let (value, slope) = polynomial(&[2.0, 3.0, 5.0], 0.5);
        assert_eq!(value, 2.0 * 0.5 + 3.0 * 0.25 + 5.0 * 0.125);
        assert_eq!(slope, 2.0 + 6.0 * 0.5 + 15.0 * 0.25);
    }
}
