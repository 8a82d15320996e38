//! Refraction at a plane, a sphere or a conic: the inner loop of the camera kit.
//!
//! # Intersection
//!
//! In the surface's frame the conic is c (x² + y² + (1 + k) z²) − 2z = 0. The ray is first moved to
//! the foot of the perpendicular from the vertex, so that an object at infinity costs no digits.
//! With p + t d put in, A t² + 2B t + C = 0; then q = −(B + sign(B) √D), the root that the vertex'
//! sheet has for ordinary rays is C/q, and the other one is q/A (W. H. Press et al., *Numerical
//! Recipes*, eq. 5.6.4, is the stable quadratic). A root counts when t > 0 and 1 − (1 + k) c z ≥ 0:
//! the sheet that the sag formula describes. The nearest one is taken; where the other root might be
//! nearer and on the sheet, which takes a ray that cuts the rim of a cap, both are worked out.
//!
//! # Refraction
//!
//! Snell's law in vector form (G. H. Spencer and M. V. R. K. Murty, *J. Opt. Soc. Am.* 52, 672
//! (1962)) with an unnormalised normal m: d' = μ d + σ (√(|m|² (1 − μ²) + μ² (d·m)²) − μ |d·m|) m/|m|²,
//! where σ is the sign of d·m. |d·m| is √D, and |m|² is 1 − k c² r² on a conic, 1 on a sphere; where
//! roundings of the place make that untrue, as on conics of −10⁶ or spheres of a nanometre, the
//! direction is made a unit vector again. Equal indices leave every direction as it is, to the last
//! bit.
//!
//! The ideal thin lens: every point is imaged to a point by 1/s' − 1/s = 1/f, at any angle.
//!
//! Such a lens takes straight lines to straight lines, so with slopes X = dx/dz, Y = dy/dz a ray
//! through (x, y) leaves with X − x/f, Y − y/f.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::crossings::Slopes;
use super::rays::{Block, LANES, PENDING, Ray, RayStatus};
use super::surface::{LARGEST_CURVATURE, SMALLEST_RADIUS, Surface, checked_semi_diameter};
use etendue_geometry::units::Millimetres;

/// Steps that end this little before the last element (mm) still count, so that elements may touch.
pub(crate) const TOUCH: f64 = 1e-9;

/// A surface between two media at one wavelength, met from one side.
#[derive(Debug, Clone)]
pub(crate) struct Refraction {
    pub(crate) surface: Surface,
    pub(crate) media: Media,
    /// What tells which rays cross an asphere but once.
    pub(super) slopes: Slopes,
}

/// The media on both sides of a surface at one wavelength, met from one side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Media {
    /// The index before over the index behind, in the direction of travel.
    ratio: f64,
    /// 1 − μ².
    rest: f64,
}

/// What a ray does at a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Refracted {
    /// Where it meets the surface, and how it goes on.
    pub(crate) ray: Ray,
    /// How far it went (mm).
    pub(crate) t: f64,
    /// It meets the surface.
    pub(crate) hit: bool,
    /// Inside the clear aperture.
    pub(crate) clear: bool,
    /// Light goes on.
    pub(crate) through: bool,
}

/// Which root of the quadratic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Root {
    /// C/q.
    Near,
    /// q/A.
    Far,
}

impl Media {
    /// From a medium of index `before` into one of index `behind`.
    pub(crate) fn new(before: f64, behind: f64) -> Self {
        let ratio = before / behind;
        Self { ratio, rest: (1.0 - ratio) * (1.0 + ratio) }
    }

    /// Of a mirror: the kernels then give minus the direction that is reflected.
    pub(crate) const MIRROR: Self = Self { ratio: -1.0, rest: 0.0 };

    /// Refracts at `ray`'s position, where the normal is `m` with |m|² = `length2`, d·m has the
    /// sign of `sign`, and (d·m)² = `along2` with the root `along`.
    #[inline(always)]
    pub(crate) fn refract(
        &self,
        ray: Ray,
        m: [f64; 3],
        length2: f64,
        along2: f64,
        along: f64,
    ) -> (Ray, bool) {
        let behind2 = self.rest * length2 + self.ratio * self.ratio * along2;
        let g = (behind2.sqrt().copysign(along) - self.ratio * along) / length2;
        let direction = [
            self.ratio * ray.direction[0] + g * m[0],
            self.ratio * ray.direction[1] + g * m[1],
            self.ratio * ray.direction[2] + g * m[2],
        ];
        (Ray { direction, ..ray }, (0.0..f64::INFINITY).contains(&behind2))
    }
}

impl Media {
    /// As [`Self::refract`] at a surface whose phase adds `kick` to the direction in its tangent plane. What is
    /// evanescent does not go on.
    pub(crate) fn diffract(
        &self,
        ray: Ray,
        m: [f64; 3],
        length2: f64,
        along: f64,
        kick: [f64; 3],
    ) -> (Ray, bool) {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (across, of_kick) = (along / length2, dot(kick, m) / length2);
        let tangent: [f64; 3] = std::array::from_fn(|i| {
            self.ratio * (ray.direction[i] - across * m[i]) + kick[i] - of_kick * m[i]
        });
        let behind2 = 1.0 - dot(tangent, tangent);
        let rise = (behind2 / length2).sqrt().copysign(along);
        let direction = std::array::from_fn(|i| tangent[i] + rise * m[i]);
        (Ray { direction, ..ray }, (0.0..f64::INFINITY).contains(&behind2))
    }
}

impl Refraction {
    /// From a medium of index `before` into one of index `behind`.
    pub(crate) fn new(surface: Surface, before: f64, behind: f64) -> Self {
        let slopes = Slopes::of_surface(&surface);
        Self { surface, media: Media::new(before, behind), slopes }
    }

    /// At a mirror.
    pub(crate) fn mirror(surface: Surface) -> Self {
        Self { media: Media::MIRROR, ..Self::new(surface, 1.0, 1.0) }
    }

    /// A ray in the surface's frame at a plane.
    #[inline(always)]
    pub(crate) fn at_plane(&self, ray: Ray, clip2: f64) -> Refracted {
        let w = ray.direction[2];
        let t = -ray.position[2] / w;
        let mut there = ray.advanced(t);
        there.position[2] = 0.0;
        let [x, y, _] = there.position;
        let (out, through) = self.media.refract(there, [0.0, 0.0, 1.0], 1.0, w * w, w);
        let hit = (t > -TOUCH) & (t < f64::INFINITY);
        Refracted { ray: out, t, hit, clear: x * x + y * y <= clip2, through }
    }

    /// A ray in the surface's frame at a conic; with `SPHERE` the conic constant is taken to be 0.
    #[inline(always)]
    pub(crate) fn at_conic<const SPHERE: bool>(
        &self,
        ray: Ray,
        clip2: f64,
        which: Root,
    ) -> Refracted {
        let met = meet_conic::<SPHERE>(&self.surface, ray, which);
        let [x, y, z] = met.ray.position;
        let (c, k) = (self.surface.curvature, self.surface.conic);
        let r2 = x * x + y * y;
        let (stretch, length2) = if SPHERE { (1.0, 1.0) } else { (1.0 + k, 1.0 - k * c * c * r2) };
        let m = [-c * x, -c * y, 1.0 - stretch * c * z];
        let (out, through) = self.media.refract(met.ray, m, length2, met.along2, met.along);
        let out = out.unit();
        // A ray that misses has a NaN for a root, which is not greater than anything.
        let hit = (met.t > -TOUCH) & (met.t < f64::INFINITY) & (m[2] >= 0.0);
        Refracted { ray: out, t: met.t, hit, clear: r2 <= clip2, through }
    }

    /// A ray in the frame of any surface but an asphere, exactly by the rule.
    pub(crate) fn exactly(&self, ray: Ray, clip2: f64) -> Refracted {
        if self.surface.is_plane() {
            self.at_plane(ray, clip2)
        } else if self.surface.conic == 0.0 {
            self.at_nearest::<true>(ray, clip2)
        } else {
            self.at_nearest::<false>(ray, clip2)
        }
    }

    #[inline(always)]
    fn at_nearest<const SPHERE: bool>(&self, ray: Ray, clip2: f64) -> Refracted {
        let near = self.at_near_root::<SPHERE>(ray, clip2);
        if near.hit {
            return near;
        }
        let at = |which| self.at_conic::<SPHERE>(ray, clip2, which);
        let (near, far) = (at(Root::Near), at(Root::Far));
        if far.hit && (!near.hit || far.t < near.t) { far } else { near }
    }

    /// A ray in the surface's frame at the near root of a conic; no hit where that might not be the
    /// nearest, for [`Self::exactly`] to decide.
    #[inline(always)]
    pub(crate) fn at_near_root<const SPHERE: bool>(&self, ray: Ray, clip2: f64) -> Refracted {
        let crossing = self.at_conic::<SPHERE>(ray, clip2, Root::Near);
        let clear = rival_is_elsewhere::<SPHERE>(&self.surface, ray);
        Refracted { hit: crossing.hit & clear, ..crossing }
    }
}

/// Where a ray meets a conic.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Intersection {
    /// The ray, moved there.
    pub(crate) ray: Ray,
    /// Distance from where it was.
    pub(crate) t: f64,
    /// (d·m)²; negative when the ray misses.
    pub(crate) along2: f64,
    /// d·m.
    pub(crate) along: f64,
}

/// The quadratic of a ray and a conic, from the foot of the perpendicular on.
struct Quadratic {
    moved: Ray,
    foot: f64,
    a: f64,
    d: f64,
    along2: f64,
    along: f64,
    q: f64,
}

#[inline(always)]
fn quadratic<const SPHERE: bool>(s: &Surface, ray: Ray) -> Quadratic {
    let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
    let (c, k) = (s.curvature, s.conic);
    let foot = -(x * u + y * v + z * w);
    let moved = ray.advanced(foot);
    let [x, y, z] = moved.position;
    let stretch = if SPHERE { 1.0 } else { 1.0 + k };
    let a = if SPHERE { c } else { c * (1.0 + k * (w * w)) };
    let b = c * (x * u + y * v + stretch * (z * w)) - w;
    let d = c * (x * x + y * y + stretch * (z * z)) - 2.0 * z;
    let along2 = b * b - a * d;
    let along = along2.sqrt().copysign(b);
    Quadratic { moved, foot, a, d, along2, along, q: -(b + along) }
}

#[inline(always)]
pub(crate) fn meet_conic<const SPHERE: bool>(s: &Surface, ray: Ray, which: Root) -> Intersection {
    let Quadratic { moved, foot, a, d, along2, along, q } = quadratic::<SPHERE>(s, ray);
    // m is minus half the gradient of the conic, hence the signs.
    let (t, along) = match which {
        Root::Near => (d / q, -along),
        Root::Far => (q / a, along),
    };
    Intersection { ray: moved.advanced(t), t: foot + t, along2, along }
}

/// Whether the far root comes after the near one, or lies on the other sheet; without a division.
#[inline(always)]
fn rival_is_elsewhere<const SPHERE: bool>(s: &Surface, ray: Ray) -> bool {
    let Quadratic { moved, a, q, .. } = quadratic::<SPHERE>(s, ray);
    let (c, k, w) = (s.curvature, s.conic, ray.direction[2]);
    // 1 − (1 + k) c (z + q/a · w), times the square of a/c = 1 + k w².
    let (stretch, e) = if SPHERE { (1.0, 1.0) } else { (1.0 + k, 1.0 + k * (w * w)) };
    let sheet = e * (e * (1.0 - stretch * c * moved.position[2]) - stretch * (q * w));
    (a * q >= 0.0) | (sheet < 0.0)
}

/// Runs `cross` on every living ray of a block; rays that it does not let through are left as
/// they were and marked for the exact path. Says whether there are any.
#[inline(always)]
pub(crate) fn each_lane(
    block: &mut Block,
    element: usize,
    z: f64,
    cross: impl Fn(Ray) -> Refracted,
) -> bool {
    each_numbered_lane(
        block,
        element,
        z,
        #[inline(always)]
        |_, ray| cross(ray),
    )
}

/// As [`each_lane`], for what also wants to know the ray's place in the block.
#[inline(always)]
pub(crate) fn each_numbered_lane(
    block: &mut Block,
    element: usize,
    z: f64,
    cross: impl Fn(usize, Ray) -> Refracted,
) -> bool {
    let vignetted = RayStatus::Vignetted { element }.code();
    let mut pending = 0;
    for lane in 0..LANES {
        let old = block.ray(lane);
        let [x, y, depth] = old.position;
        let mut new = cross(lane, Ray { position: [x, y, depth - z], ..old });
        new.ray.position[2] += z;
        let outcome = block.outcome[lane];
        let alive = outcome == 0;
        let moved = alive & new.hit & (!new.clear | new.through);
        let passed = moved & new.clear;
        let position = if moved { new.ray.position } else { old.position };
        let direction = if passed { new.ray.direction } else { old.direction };
        block.set_ray(lane, Ray { position, direction });
        let ended = if new.hit & !new.clear { vignetted } else { PENDING };
        let outcome = if alive & !passed { ended } else { outcome };
        block.outcome[lane] = outcome;
        pending |= u64::from(outcome == PENDING);
    }
    pending != 0
}

/// A thin lens as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThinLensSpec {
    /// The focal length (mm), negative for a diverging lens. In a medium it is that in the medium.
    pub focal_length: Millimetres,
    /// Half the clear diameter (mm). Unlimited when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
}

/// A thin lens in its own frame (mm).
#[derive(Debug, Clone, PartialEq)]
pub struct ThinLens {
    /// 1/f (1/mm).
    pub power: f64,
    /// Half the clear diameter; infinite when unlimited.
    pub semi_diameter: f64,
}

impl ThinLensSpec {
    /// The lens.
    ///
    /// # Errors
    ///
    /// A sentence on the number that describes no lens.
    pub fn build(&self) -> Result<ThinLens, String> {
        let semi_diameter = checked_semi_diameter(self.semi_diameter)?;
        // An infinite focal length is a lens without power.
        let power = 1.0 / self.focal_length.0;
        if power.abs() <= LARGEST_CURVATURE {
            Ok(ThinLens { power, semi_diameter })
        } else {
            Err(format!(
                "focal_length is {} mm; it must be at least {SMALLEST_RADIUS:e} mm",
                self.focal_length.0
            ))
        }
    }
}

/// Light from the object meets `power`, light traced from the sensor `−power`.
#[inline(always)]
pub(crate) fn at_thin_lens(power: f64, ray: Ray, clip2: f64) -> Refracted {
    let w = ray.direction[2];
    let t = -ray.position[2] / w;
    let mut there = ray.advanced(t);
    there.position[2] = 0.0;
    let [x, y, _] = there.position;
    // (u/w − x/f, v/w − y/f, 1) times w.
    let (u, v) = (ray.direction[0] - x * power * w, ray.direction[1] - y * power * w);
    let length = (u * u + v * v + w * w).sqrt();
    let scale = if power == 0.0 { 1.0 } else { 1.0 / length };
    there.direction = [u * scale, v * scale, w * scale];
    let hit = (t > -TOUCH) & (t < f64::INFINITY) & (length < f64::INFINITY);
    Refracted { ray: there, t, hit, clear: x * x + y * y <= clip2, through: true }
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
        assert!(!s.at_near_root::<true>(start, 1e9).hit, "left to the exact path");
        let ordinary = ray([0.0, 3.0, -5.0], [0.0, 0.1, 1.0]);
        assert!(s.at_near_root::<true>(ordinary, 1e9).hit);
        assert!(sphere(-10.0, 1.0, 1.5).at_near_root::<true>(ordinary, 1e9).hit);
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

    #[test]
    fn points_are_imaged_to_points_at_any_angle_both_ways() {
        let (f, s) = (50.0, -75.0);
        let image = 1.0 / (1.0 / f + 1.0 / s);
        let object = [4.0, -3.0, s];
        for (x, y) in [(0.0, 0.0), (20.0, 0.0), (-60.0, 70.0), (1.0, -300.0)] {
            let towards = [x - object[0], y - object[1], -object[2]];
            let ray = Ray::new(object.into(), towards.into()).unwrap();
            let out = at_thin_lens(1.0 / f, ray, f64::INFINITY);
            assert!(out.hit && out.clear && out.through);
            let t = image / out.ray.direction[2];
            let magnification = image / s;
            let at = out.ray.advanced(t).position;
            assert!((at[0] - object[0] * magnification).abs() < 1e-11, "{x} {y}: {at:?}");
            assert!((at[1] - object[1] * magnification).abs() < 1e-11, "{x} {y}: {at:?}");
            // Back from the image to the object.
            let mut back = out.ray.advanced(t);
            back.direction = back.direction.map(|c| -c);
            let home = at_thin_lens(-1.0 / f, back, f64::INFINITY).ray;
            let home = home.advanced((s - home.position[2]) / home.direction[2]);
            assert!((home.position[0] - object[0]).abs() < 1e-10);
            assert!((home.position[1] - object[1]).abs() < 1e-10);
        }
    }

    #[test]
    fn no_power_changes_nothing_and_no_focal_length_is_refused() {
        let spec = |f| ThinLensSpec { focal_length: Millimetres(f), semi_diameter: None };
        let flat = spec(f64::INFINITY).build().unwrap();
        let ray = Ray::new([1.0, 2.0, -3.0].into(), [0.1, 0.2, 1.0].into()).unwrap();
        assert_eq!(at_thin_lens(flat.power, ray, 1e9).ray.direction, ray.direction);
        assert!(spec(0.0).build().unwrap_err().contains("at least 1e-9 mm"));
    }
}
