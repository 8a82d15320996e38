//! Rays at an even asphere.
//!
//! Newton's method on F(t) = z − sag(x² + y²) along the ray, begun where the ray meets the conic
//! underneath. It is stopped once a step is under 10⁻¹⁰ mm: convergence being quadratic, the error
//! left is that squared times the surface's curvature, far under 10⁻¹⁴ mm. A root that the ray
//! crosses from behind, or one that Newton does not find, is looked for again by bisection of the
//! part of the ray that runs near the surface, from its start on.

use super::rays::{Block, LANES, PENDING, Ray, RayStatus, at_lane};
use super::refract::{Refracted, Refraction, Root, TOUCH, meet_conic};

pub(super) const SETTLED: f64 = 1e-10;
pub(super) const MOST_STEPS: usize = 20;

/// How many pieces of a ray are looked at for a change of sign.
const PIECES: u32 = 256;

impl Refraction {
    /// Runs a block through an asphere at `z`; as [`super::refract::each_lane`] does for conics.
    #[inline(always)]
    pub(crate) fn asphere_lanes(
        &self,
        block: &mut Block,
        element: usize,
        z: f64,
        clip2: f64,
    ) -> bool {
        let mut newton = Newton::start(self, block, z);
        for _ in 0..MOST_STEPS {
            if newton.step(self) {
                break;
            }
        }
        self.finish(block, &newton, element, z, clip2)
    }

    #[inline(always)]
    fn finish(
        &self,
        block: &mut Block,
        newton: &Newton,
        element: usize,
        z: f64,
        clip2: f64,
    ) -> bool {
        let vignetted = RayStatus::Vignetted { element }.code();
        let domain2 = self.surface.domain().powi(2);
        let mut pending = 0;
        for lane in 0..LANES {
            let ray = newton.ray(lane);
            let [x, y, depth] = ray.position;
            let u2 = x * x + y * y;
            let slope = newton.slope[lane];
            let along = ray.direction[2] - slope * (x * ray.direction[0] + y * ray.direction[1]);
            let hit = (newton.last[lane].abs() <= SETTLED)
                & (newton.travel[lane] > -TOUCH)
                & (u2 <= domain2)
                & (along * ray.direction[2] > 0.0);
            let (out, through) = self.at_slope(ray, slope);
            let outcome = block.outcome[lane];
            let alive = outcome == 0;
            let clear = u2 <= clip2;
            let moved = alive & hit & (!clear | through);
            let passed = moved & clear;
            let old = block.ray(lane);
            let position = if moved { [x, y, depth + z] } else { old.position };
            let direction = if passed { out.direction } else { old.direction };
            block.set_ray(lane, Ray { position, direction });
            let ended = if hit & !clear { vignetted } else { PENDING };
            let outcome = if alive & !passed { ended } else { outcome };
            block.outcome[lane] = outcome;
            pending |= u64::from(outcome == PENDING);
        }
        pending != 0
    }

    /// A ray in the asphere's frame: Newton first, then the search.
    pub(crate) fn at_asphere(&self, ray: Ray, clip2: f64) -> Refracted {
        let met = self.newton(ray).or_else(|| self.search(ray, clip2));
        let Some((there, slope)) = met else {
            return Refracted { ray, t: 0.0, hit: false, clear: false, through: false };
        };
        let [x, y, _] = there.position;
        let (out, through) = self.at_slope(there, slope);
        Refracted { ray: out, t: 0.0, hit: true, clear: x * x + y * y <= clip2, through }
    }

    fn newton(&self, ray: Ray) -> Option<(Ray, f64)> {
        let met = meet_conic::<false>(&self.surface, ray, Root::Near);
        let (mut at, mut travel) = (met.ray, met.t);
        if !travel.is_finite() {
            return None;
        }
        for _ in 0..MOST_STEPS {
            let (f, along, slope) = self.residual(at);
            let step = f / along;
            if !step.is_finite() {
                return None;
            }
            at = at.advanced(step);
            travel += step;
            if step.abs() <= SETTLED {
                let Ray { position: [x, y, _], direction: [u, v, w] } = at;
                let inside = x * x + y * y <= self.surface.domain().powi(2);
                let forwards = (w - slope * (x * u + y * v)) * w > 0.0;
                return (inside && forwards && travel > -TOUCH).then_some((at, slope));
            }
        }
        None
    }

    /// −F, dF/dt and the slope at a place of the ray.
    fn residual(&self, at: Ray) -> (f64, f64, f64) {
        let [x, y, z] = at.position;
        let (sag, slope) = self.surface.profile(x * x + y * y);
        (sag - z, at.direction[2] - slope * (x * at.direction[0] + y * at.direction[1]), slope)
    }

    /// The first root ahead on the part of the ray that runs through the box around the surface.
    fn search(&self, ray: Ray, clip2: f64) -> Option<(Ray, f64)> {
        let stretch = self.stretch(ray, clip2)?;
        let there = ray.advanced(first_root(stretch, |t| -self.residual(ray.advanced(t)).0)?);
        let [x, y, _] = there.position;
        let inside = x * x + y * y <= self.surface.domain().powi(2);
        inside.then(|| (there, self.residual(there).2))
    }

    /// From where to where the ray is both near the surface's depths and no farther from the axis
    /// than the surface reaches.
    fn stretch(&self, ray: Ray, clip2: f64) -> Option<[f64; 2]> {
        let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
        let foot = ray.advanced(-(x * u + y * v + z * w));
        let height = foot.position[0].hypot(foot.position[1]);
        let clear = if clip2.is_finite() { 2.0 * clip2.sqrt() } else { f64::INFINITY };
        let c = self.surface.curvature;
        let own = if c == 0.0 { 10.0 } else { (2.0 / c).abs() };
        let reach = self.surface.domain().min(clear).min(4.0 * height + own);
        let across = interval(u * u + v * v, x * u + y * v, x * x + y * y - reach * reach)?;
        let sags = (0..=64).map(|i| self.surface.profile((reach * f64::from(i) / 64.0).powi(2)).0);
        let (low, high) =
            sags.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)));
        let slack = 0.1 * (high - low) + 1e-6;
        let mut range = [across[0].max(-TOUCH), across[1]];
        if w != 0.0 {
            let ends = [(low - slack - z) / w, (high + slack - z) / w];
            range[0] = range[0].max(ends[0].min(ends[1]));
            range[1] = range[1].min(ends[0].max(ends[1]));
        }
        (range[0] < range[1] && range[0].is_finite() && range[1].is_finite()).then_some(range)
    }
}

/// The first root of `at` from `from` to `to`, among changes of sign between [`PIECES`] places.
pub(super) fn first_root([from, to]: [f64; 2], at: impl Fn(f64) -> f64) -> Option<f64> {
    let place = |i: u32| from + (to - from) * f64::from(i) / f64::from(PIECES);
    let (mut low, mut high) = (1..=PIECES)
        .map(|i| (place(i - 1), place(i)))
        .find(|&(a, b)| (at(a) <= 0.0) != (at(b) <= 0.0))?;
    let before = at(low) <= 0.0;
    // 2⁻⁶⁰ of a stretch of metres is less than the last bit of a millimetre.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (at(middle) <= 0.0) == before { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

/// Where a t² + 2b t + c ≤ 0.
pub(super) fn interval(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    if a <= 0.0 {
        return (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let root = (b * b - a * c).sqrt();
    (root >= 0.0).then(|| [(-b - root) / a, (-b + root) / a])
}

/// Newton's method on all rays of a block.
struct Newton {
    position: [[f64; LANES]; 3],
    direction: [[f64; LANES]; 3],
    /// Distance from the ray's start.
    travel: [f64; LANES],
    /// The step taken last.
    last: [f64; LANES],
    /// (∂z/∂x)/x where the last step began, which is within [`SETTLED`] of where it ended.
    slope: [f64; LANES],
    /// 1 while the ray has not settled; a settled one is left alone, so that no ray's last bits
    /// depend on its neighbours.
    active: [u64; LANES],
}

impl Newton {
    #[inline(always)]
    fn start(at: &Refraction, block: &Block, z: f64) -> Self {
        let mut newton = Self {
            position: [[0.0; LANES]; 3],
            direction: block.direction,
            travel: [0.0; LANES],
            last: [0.0; LANES],
            slope: [0.0; LANES],
            active: [0; LANES],
        };
        for lane in 0..LANES {
            let mut ray = block.ray(lane);
            ray.position[2] -= z;
            let met = meet_conic::<false>(&at.surface, ray, Root::Near);
            for axis in 0..3 {
                newton.position[axis][lane] = met.ray.position[axis];
            }
            newton.travel[lane] = met.t;
            newton.active[lane] =
                u64::from((block.outcome[lane] == 0) & (met.t.abs() < f64::INFINITY));
        }
        newton
    }

    /// One step of all rays; whether all have settled.
    #[inline(always)]
    fn step(&mut self, at: &Refraction) -> bool {
        let mut moving = 0;
        for lane in 0..LANES {
            let ray = self.ray(lane);
            let [x, y, z] = ray.position;
            let (sag, slope) = at.surface.profile(x * x + y * y);
            let along = ray.direction[2] - slope * (x * ray.direction[0] + y * ray.direction[1]);
            let active = self.active[lane] != 0;
            let step = (sag - z) / along;
            let next = ray.advanced(step);
            for axis in 0..3 {
                let old = self.position[axis][lane];
                self.position[axis][lane] = if active { next.position[axis] } else { old };
            }
            self.travel[lane] = if active { self.travel[lane] + step } else { self.travel[lane] };
            self.last[lane] = if active { step } else { self.last[lane] };
            self.slope[lane] = if active { slope } else { self.slope[lane] };
            let settled = step.abs() <= SETTLED;
            let still = u64::from(active & !settled);
            self.active[lane] = still;
            moving |= still;
        }
        moving == 0
    }

    #[inline(always)]
    fn ray(&self, lane: usize) -> Ray {
        Ray { position: at_lane(&self.position, lane), direction: at_lane(&self.direction, lane) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::surface::{Surface, polynomial};

    fn ray(position: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray::new(position.into(), direction.into()).unwrap()
    }

    fn asphere(curvature: f64, conic: f64, aspheric: &[f64]) -> Refraction {
        let surface =
            Surface { curvature, conic, aspheric: aspheric.to_vec(), semi_diameter: f64::INFINITY };
        Refraction::new(surface, 1.0, 1.5)
    }

    #[test]
    fn a_point_found_lies_on_the_surface_to_the_last_digits() {
        let s = asphere(1.0 / 31.4, -0.5907, &[0.0, -3.497e-7, -4.9708e-10, -2.439e-13]);
        for height in [0.0, 1.0, 8.0, 15.0] {
            let at = s.at_asphere(ray([height, 2.0, -20.0], [0.01, -0.03, 1.0]), 1e9);
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
        let (a, b) = (flat.at_asphere(start, 1e9).ray, sphere.exactly(start, 1e9).ray);
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
                let at = s.at_asphere(start, 1e9);
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
                let inside =
                    |j: u32| s.residual(start.advanced(reach * f64::from(j) / 2000.0)).0 < -1e-6;
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
        s.asphere_lanes(&mut rays.blocks[0], 0, 0.0, 1e9);
        for lane in 0..LANES {
            let single = s.at_asphere(before.ray(lane), 1e9);
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
