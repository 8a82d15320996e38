//! Rays at a plane, a sphere or a conic between two media: met and refracted in closed form.

use super::crossings::{ProfileBoundary, Slopes};
use super::rays::Ray;
use super::real::Real;
use super::refract::{
    IndexPair, RefractedRay, Root, is_ahead, is_within, meet_conic, rival_is_elsewhere,
};
use super::surface::Surface;

/// A surface between two media at one wavelength, met from one side.
#[derive(Debug, Clone)]
pub(crate) struct Refraction {
    pub(crate) surface: Surface,
    pub(crate) media: IndexPair,
    /// Bounds of slopes, by which rays are known to cross an asphere but once.
    pub(super) slopes: Slopes,
}

impl Refraction {
    /// From a medium of index `before` into one of index `behind`.
    pub(crate) fn new(surface: Surface, before: f64, behind: f64) -> Self {
        let slopes = Slopes::of_surface(&surface);
        Self { surface, media: IndexPair::new(before, behind), slopes }
    }

    /// At a mirror.
    pub(crate) fn mirror(surface: Surface) -> Self {
        Self { media: IndexPair::MIRROR, ..Self::new(surface, 1.0, 1.0) }
    }

    /// The boundary that it is to rays that may cross its surface more than once.
    #[inline(always)]
    pub(super) fn boundary(&self) -> ProfileBoundary<'_, Surface> {
        ProfileBoundary { surface: &self.surface, media: self.media, slopes: &self.slopes }
    }

    /// A ray in the surface's frame at a plane.
    #[inline(always)]
    pub(crate) fn at_plane<T: Real>(&self, ray: Ray<T>, clip2: f64) -> RefractedRay<T> {
        let w = ray.direction[2];
        let t = -ray.position[2] / w;
        let mut there = ray.advanced(t);
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        there.position[2] = zero;
        let (out, through) = self.media.refract(there, [zero, zero, one], one, w * w, w);
        RefractedRay { ray: out, t, hit: is_ahead(t), clear: is_within(there, clip2), through }
    }

    /// A ray in the surface's frame at a conic; with `SPHERE` the conic constant is taken to be 0.
    #[inline(always)]
    pub(crate) fn at_conic<const SPHERE: bool, T: Real>(
        &self,
        ray: Ray<T>,
        clip2: f64,
        which: Root,
    ) -> RefractedRay<T> {
        let crossing = meet_conic::<SPHERE, T>(&self.surface, ray, which);
        let [x, y, z] = crossing.ray.position;
        let (c, k) = (self.surface.curvature, self.surface.conic);
        let r2 = x * x + y * y;
        let one = T::constant(1.0);
        let stretch = if SPHERE { 1.0 } else { 1.0 + k };
        let length2 = if SPHERE { one } else { one - r2.times(k * c * c) };
        let m = [x.times(-c), y.times(-c), one - z.times(stretch * c)];
        let (out, through) =
            self.media.refract(crossing.ray, m, length2, crossing.along2, crossing.along);
        let out = out.unit();
        // A ray that misses has a NaN for a root, which is not greater than anything.
        let hit = is_ahead(crossing.t) & (m[2].value() >= 0.0);
        RefractedRay { ray: out, t: crossing.t, hit, clear: r2.value() <= clip2, through }
    }

    /// A ray in the frame of any surface but an asphere, exactly by the rule.
    pub(crate) fn exactly<T: Real>(&self, ray: Ray<T>, clip2: f64) -> RefractedRay<T> {
        if self.surface.is_plane() {
            self.at_plane(ray, clip2)
        } else if self.surface.conic == 0.0 {
            self.at_nearest::<true, T>(ray, clip2)
        } else {
            self.at_nearest::<false, T>(ray, clip2)
        }
    }

    #[inline(always)]
    fn at_nearest<const SPHERE: bool, T: Real>(&self, ray: Ray<T>, clip2: f64) -> RefractedRay<T> {
        let near = self.at_near_root::<SPHERE, T>(ray, clip2);
        if near.hit {
            return near;
        }
        let at = |which| self.at_conic::<SPHERE, T>(ray, clip2, which);
        let (near, far) = (at(Root::Near), at(Root::Far));
        if far.hit && (!near.hit || far.t.value() < near.t.value()) { far } else { near }
    }

    /// A ray in the surface's frame at the near root of a conic; no hit where that might not be the
    /// nearest, for [`Self::exactly`] to decide.
    #[inline(always)]
    pub(crate) fn at_near_root<const SPHERE: bool, T: Real>(
        &self,
        ray: Ray<T>,
        clip2: f64,
    ) -> RefractedRay<T> {
        let crossing = self.at_conic::<SPHERE, T>(ray, clip2, Root::Near);
        let clear = rival_is_elsewhere::<SPHERE, T>(&self.surface, ray);
        RefractedRay { hit: crossing.hit & clear, ..crossing }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(position: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray::new(position.into(), direction.into()).unwrap()
    }

    fn sphere(radius: f64, before: f64, behind: f64) -> Refraction {
        Refraction::new(Surface::sphere(1.0 / radius), before, behind)
    }

    #[test]
    fn snell_holds_at_a_sphere() {
        let at = sphere(20.0, 1.0, 1.5).exactly(ray([3.0, 4.0, -30.0], [0.0, 0.0, 1.0]), 1e9);
        assert!(at.hit && at.clear && at.through);
        let [x, y, z] = at.ray.position;
        assert!((z - (20.0 - 375.0_f64.sqrt())).abs() < 1e-14);
        // The normal at height 5 of a sphere of 20 makes sin θ = 1/4; sin θ' = 1/6.
        let normal = [-x / 20.0, -y / 20.0, 1.0 - z / 20.0];
        let cos: f64 = (0..3).map(|i| normal[i] * at.ray.direction[i]).sum();
        assert!((cos - (35.0_f64 / 36.0).sqrt()).abs() < 1e-15);
        let length: f64 = at.ray.direction.iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-15);
    }

    #[test]
    fn equal_indices_change_no_bit_of_a_direction() {
        let start = ray([1.0, 2.0, -5.0], [0.3, -0.2, 1.0]);
        for surface in [sphere(-7.0, 1.3, 1.3), sphere(f64::INFINITY, 1.3, 1.3)] {
            assert_eq!(surface.exactly(start, 1e9).ray.direction, start.direction);
        }
    }

    #[test]
    fn a_ball_is_entered_and_left_on_its_own_hemispheres() {
        // The vertex-root formula is 0/0 for a ray that starts on the sphere that it must leave.
        let inside = sphere(5.0, 1.0, 1.5).exactly(ray([3.0, 0.0, -9.0], [0.0, 0.0, 1.0]), 25.0);
        assert!((inside.ray.position[2] - 1.0).abs() < 1e-15);
        let mut local = inside.ray;
        local.position[2] -= 10.0;
        let left = sphere(-5.0, 1.5, 1.0).exactly(local, 25.0);
        assert!(left.hit && left.through && left.ray.position[2] > -5.0);
        // By symmetry about the ball's centre the deviation doubles: 2 (θ − θ').
        let (outer, inner) = (0.6_f64.asin(), 0.4_f64.asin());
        let deviation = left.ray.direction[0].atan2(left.ray.direction[2]);
        assert!((deviation + 2.0 * (outer - inner)).abs() < 1e-14);
    }

    #[test]
    fn the_wrong_half_of_a_sphere_is_a_miss_and_the_second_root_a_hit() {
        let s = sphere(10.0, 1.0, 1.5);
        // Along the axis from behind the vertex, inside the ball: only the back half is ahead.
        assert!(!s.exactly(ray([0.0, 0.0, 5.0], [0.0, 0.0, 1.0]), 1e9).hit);
        // Across the cap from inside: the near root lies behind the start, the far one ahead.
        let across = s.exactly(ray([0.0, 0.0, 2.0], [1.0, 0.0, 0.0]), 1e9);
        assert!(across.hit && (across.ray.position[0] - 6.0).abs() < 1e-14);
        assert!(!s.exactly(ray([0.0, 11.0, -5.0], [0.0, 0.0, 1.0]), 1e9).hit);
    }

    #[test]
    fn a_ray_from_behind_the_rim_enters_a_dome_at_the_first_of_two_roots() {
        // 100° off the axis: the front of a fisheye. Both roots are on the vertex' half.
        let s = sphere(10.0, 1.0, 1.5);
        let (sine, cosine) = 100.0_f64.to_radians().sin_cos();
        let start = ray([0.0, -30.0, 9.0], [0.0, sine, cosine]);
        let at = s.exactly(start, 1e9);
        assert!(at.hit && at.ray.position[1] < 0.0, "{:?}", at.ray);
        assert!(!s.at_near_root::<true, f64>(start, 1e9).hit, "left to the exact path");
        let ordinary = ray([0.0, 3.0, -5.0], [0.0, 0.1, 1.0]);
        assert!(s.at_near_root::<true, f64>(ordinary, 1e9).hit);
        assert!(sphere(-10.0, 1.0, 1.5).at_near_root::<true, f64>(ordinary, 1e9).hit);
    }

    #[test]
    fn an_object_at_ten_million_kilometres_loses_no_digits_to_the_quadratic() {
        let s = sphere(29.475, 1.0, 1.67);
        let far = s.exactly(ray([0.0, 10.0, -1e13], [0.0, 0.0, 1.0]), 1e9).ray;
        let near = s.exactly(ray([0.0, 10.0, -30.0], [0.0, 0.0, 1.0]), 1e9).ray;
        for axis in 0..3 {
            assert!((far.position[axis] - near.position[axis]).abs() < 1e-12);
            assert!((far.direction[axis] - near.direction[axis]).abs() < 1e-14);
        }
    }

    #[test]
    fn a_conic_of_constant_minus_one_focuses_a_parallel_beam() {
        // A paraboloid facing infinity as a mirror would; as a refractor an ellipsoid with
        // k = −1/n² brings a parallel beam in air to a point at n R/(n − 1) inside the glass.
        let n: f64 = 1.5;
        let mut surface = Surface::sphere(1.0 / 20.0);
        surface.conic = -1.0 / (n * n);
        let refraction = Refraction::new(surface, 1.0, n);
        let focus = n * 20.0 / (n - 1.0);
        for height in [0.1, 3.0, 9.0, 14.0] {
            let out = refraction.exactly(ray([height, 0.0, -3.0], [0.0, 0.0, 1.0]), 1e9).ray;
            let t = -out.position[0] / out.direction[0];
            assert!((out.position[2] + t * out.direction[2] - focus).abs() < 1e-11, "{height}");
        }
    }

    #[test]
    fn total_reflection_is_told() {
        let plane = Refraction::new(Surface::sphere(0.0), 1.5, 1.0);
        let at =
            |sine: f64| plane.exactly(ray([0.0; 3], [sine, 0.0, (1.0 - sine * sine).sqrt()]), 1e9);
        let critical = 1.0 / 1.5;
        assert!(at(critical - 1e-12).through);
        assert!(!at(critical + 1e-12).through);
    }
}
