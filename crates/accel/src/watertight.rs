//! The one ray-triangle test that every backend answers by, in f64.
//!
//! Whether a ray passes a triangle is decided by the signs of three determinants alone, one an
//! edge: with corners *a*, *b*, *c* seen from the ray's origin and direction *d*, they are
//! det(*d*, *b*, *c*), det(*d*, *c*, *a*) and det(*d*, *a*, *b*). The ray's line meets the
//! triangle when no two of them have opposite signs. The signs are **exact**: plain f64 answers
//! when its rounding error cannot matter, and otherwise Shewchuk's adaptive expansions do.
//!
//! Zero counts as both sides. Two triangles that share an edge work out the same exact number with
//! opposite signs, so a line through a closed mesh can never pass between them, nor through a
//! corner. For that, each corner must round to the same place in every triangle that uses it: it
//! does when each is `world_from_mesh.point_from(corner, origin)`.
//!
//! A triangle without area, or seen exactly edge-on, has three zeros. It is never hit; a closed
//! mesh has neighbours that are.
//!
//! # Range
//!
//! The signs are exact for all finite coordinates, with one proviso: within a corner or a
//! direction, a component less than 2⁻²⁵⁰ of the largest one counts as zero. (That moves the
//! corner in the same way for all triangles that use it, so nothing opens.)
//!
//! # Sources
//!
//! J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates", 1997 (section 4.3: orientation in 3D and its error bound); A. Kensler and
//! P. Shirley, "Optimizing ray-triangle intersection via automated search", 2006, for the form of
//! the distance; S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", 2013, for
//! the idea that ties on edges count for both sides.

use etendue_geometry::glam::DVec3;
use robust::{Coord3D, orient3d};

use crate::triangle::{Vector, at, cross_plane, dot, minus};

/// Intersection of a ray with a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the direction (m for a unit vector). Negative behind the origin.
    pub t: f64,
    /// Barycentric weight of the second corner (0..=1).
    pub u: f64,
    /// Barycentric weight of the third corner (0..=1 − `u`).
    pub v: f64,
    /// True if the ray meets the side from which the corners run counter-clockwise.
    pub front: bool,
}

/// Half the distance from 1 to the next f64: the largest relative error of one rounding.
const ROUNDING: f64 = f64::EPSILON / 2.0;

/// A plain determinant is off by at most 7 roundings of its permanent (Shewchuk 1997, table 5),
/// which is at most 2 (|dx| + |dy| + |dz|) m² when m is the largest coordinate of both corners.
const DETERMINANT_ERROR: f64 = 14.0 * ROUNDING;

/// Far above what products lose below f64's smallest normal number, and below everything else.
const UNDERFLOW: f64 = 1e-290;

/// Below this squared sine, of the corner's angle or of the angle between ray and plane, the plain
/// formula for the distance loses digits and the careful one takes over.
const SLIM: f64 = 1e-2;

/// Intersects the line from the origin along `d` with the triangle of corners `a`, `b`, `c`, all
/// seen from the ray's origin; `None` when it passes by, or the triangle has no area, or a number
/// is not finite. The caller compares `t` with its own limits.
///
/// # Accuracy
///
/// With ε = 2⁻⁵³, r the distance of the farthest corner, θ the angle between ray and normal, and
/// φ the largest angle of the triangle, `t` is within 16 ε r / (cos θ · sin φ) of the exact
/// distance to the given corners: 10⁻¹² r unless the triangle is grazed to within 0.1° or so.
/// However flat the view, `t` stays within the triangle's own extent along the ray. `u` and `v`
/// are as good relative to r over the triangle's height.
#[must_use]
#[inline]
pub fn intersect(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<Hit> {
    let bound = determinant_bound(a, b, c, d);
    let [p, q, r] = determinants(a, b, c, d);
    let (low, high) = (p.min(q).min(r), p.max(q).max(r));
    // `min` and `max` pass over NaN; the sum does not.
    let sound = (p + q + r).is_finite();
    let front = if sound && low > bound {
        false
    } else if sound && high < -bound {
        true
    } else if sound && low < -bound && high > bound {
        return None;
    } else {
        exact_side(a, b, c, d)?
    };
    Some(locate(a, b, c, d, front))
}

/// The edge determinants opposite `a`, `b` and `c`, in plain f64.
#[inline]
fn determinants(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> [f64; 3] {
    [d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b))]
}

/// The most that any of [`determinants`] can be off.
#[inline]
fn determinant_bound(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let d = d.abs();
    DETERMINANT_ERROR * (d.x + d.y + d.z) * (largest * largest) + UNDERFLOW
}

/// The side of the triangle that the line meets, by exact signs: `true` for its front.
#[cold]
fn exact_side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<bool> {
    if !(a.is_finite() && b.is_finite() && c.is_finite() && d.is_finite()) {
        return None;
    }
    let [a, b, c, d] = [a, b, c, d].map(to_unit_scale);
    let signs =
        [exact_determinant(d, b, c), exact_determinant(d, c, a), exact_determinant(d, a, b)];
    let (mut ahead, mut behind) = (false, false);
    for sign in signs {
        ahead |= sign > 0.0;
        behind |= sign < 0.0;
    }
    (ahead != behind).then_some(behind)
}

/// det(`a`, `b`, `c`) with the right sign.
fn exact_determinant(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let [a, b, c] = [a, b, c].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    orient3d(a, b, c, Coord3D { x: 0.0, y: 0.0, z: 0.0 })
}

/// `v` times the power of two that brings its largest component to 1..2, so that no product of an
/// expansion leaves f64's range. Signs of determinants do not change by it.
fn to_unit_scale(v: DVec3) -> DVec3 {
    let mut v = v;
    let mut largest = v.abs().max_element();
    if largest == 0.0 {
        return v;
    }
    if largest < f64::MIN_POSITIVE {
        v *= 2f64.powi(60);
        largest *= 2f64.powi(60);
    }
    // Bits 52..63 hold the exponent. Halved twice over, because 2¹⁰²³ has no reciprocal that is
    // a normal number.
    let exponent = (largest.to_bits() >> 52) as i32 - 1023;
    let half = exponent / 2;
    let scaled = v * 2f64.powi(-half) * 2f64.powi(half - exponent);
    let negligible = 2f64.powi(-250);
    DVec3::select(scaled.abs().cmplt(DVec3::splat(negligible)), DVec3::ZERO, scaled)
}

/// Triangles, each as a ray sees it, and the rays' directions: one a lane.
pub(crate) struct Lines<const N: usize> {
    /// `[corner][axis][lane]`
    pub(crate) corners: [[[f64; N]; 3]; 3],
    /// `[axis][lane]`
    pub(crate) direction: [[f64; N]; 3],
}

/// The distance and the weights of the second and third corner where the lines whose bit is set in
/// `wanted` meet their triangles, which they must be known to do. The same numbers, to the bit, as
/// [`intersect`] finds one by one; in other lanes there is noise.
#[inline(always)]
pub(crate) fn locate_many<const N: usize>(lines: &Lines<N>, wanted: u32) -> [[f64; N]; 3] {
    let (mut t, mut u, mut v) = ([0.0; N], [0.0; N], [0.0; N]);
    let mut careful = 0_u32;
    let [a, b, c] = &lines.corners;
    for i in 0..N {
        let corners = [at(a, i), at(b, i), at(c, i)];
        let plain = locate_plainly(corners, at(&lines.direction, i));
        (t[i], u[i], v[i]) = (plain.t, plain.u, plain.v);
        careful |= u32::from(plain.is_delicate) << i;
    }
    careful &= wanted;
    while careful != 0 {
        let i = careful.trailing_zeros() as usize;
        careful &= careful - 1;
        let corner = |k: usize| DVec3::from_array(lines.corners[k].map(|axis| axis[i]));
        let d = DVec3::from_array(lines.direction.map(|axis| axis[i]));
        let hit = locate_carefully([corner(0), corner(1), corner(2)], d, true);
        (t[i], u[i], v[i]) = (hit.t, hit.u, hit.v);
    }
    [t, u, v]
}

/// Distance and weights of a line that is known to meet the triangle.
#[inline]
fn locate(a: DVec3, b: DVec3, c: DVec3, d: DVec3, front: bool) -> Hit {
    let PlainResult { t, u, v, is_delicate } =
        locate_plainly([a, b, c].map(|corner| corner.to_array()), d.to_array());
    if is_delicate { locate_carefully([a, b, c], d, front) } else { Hit { t, u, v, front } }
}

/// Result of the plain formula, and whether the careful one has to take over.
struct PlainResult {
    t: f64,
    u: f64,
    v: f64,
    is_delicate: bool,
}

/// The plain formula. Edges are differences of neighbours, so they have no rounding to speak of.
#[inline(always)]
fn locate_plainly([a, b, c]: [Vector; 3], d: Vector) -> PlainResult {
    let (e1, e2) = (minus(b, a), minus(c, a));
    let crossing = cross_plane(a, e1, e2, d);
    let (nn, nd) = (dot(crossing.normal, crossing.normal), crossing.along);
    let slim = nn < SLIM * (dot(e1, e1) * dot(e2, e2));
    let grazed = nd * nd < SLIM * (nn * dot(d, d));
    let is_delicate = slim | grazed | !((nn > 1e-250) & (nn < 1e250));
    let scale = 1.0 / nd;
    let u = (crossing.u * scale).clamp(0.0, 1.0);
    // Not `clamp`, which panics where `u` is no number.
    let v = (crossing.v * scale).max(0.0).min(1.0 - u);
    PlainResult { t: crossing.t * scale, u, v, is_delicate }
}

/// As [`locate`] for needles, grazed triangles and extreme sizes: works from the corner with the
/// largest angle, at unit scale, and keeps the distance within the triangle.
#[cold]
#[expect(clippy::cast_possible_truncation, reason = "an exponent of f64 has 11 bits")]
fn locate_carefully(corners: [DVec3; 3], d: DVec3, front: bool) -> Hit {
    let largest = corners.iter().fold(0.0_f64, |most, p| most.max(p.abs().max_element()));
    // A power of two whose reciprocal is one too.
    let scale = 2f64.powi(largest.log2().clamp(-1000.0, 1000.0) as i32);
    let corners = corners.map(|p| p / scale);
    let edge = |i: usize| (corners[(i + 2) % 3] - corners[(i + 1) % 3]).length_squared();
    let first = if edge(0) >= edge(1) && edge(0) >= edge(2) {
        0
    } else if edge(1) >= edge(2) {
        1
    } else {
        2
    };
    let [a, b, c] = [0, 1, 2].map(|k| corners[(first + k) % 3]);
    let (e1, e2) = (b - a, c - a);
    let normal = e1.cross(e2);
    let moment = a.cross(d);
    let nd = normal.dot(d);

    let along = [a, b, c].map(|p| p.dot(d) / d.length_squared());
    let (near, far) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
    let third = 1.0 / 3.0;
    let quotient = |x: f64, otherwise: f64| if nd == 0.0 { otherwise } else { x / nd };
    let t = quotient(normal.dot(a), near + (far - near) / 2.0);
    let v1 = quotient(moment.dot(e2), third).clamp(0.0, 1.0);
    let v2 = quotient(-moment.dot(e1), third).clamp(0.0, 1.0 - v1);

    // Weights of the corners as they were given.
    let mut weights = [0.0; 3];
    weights[first] = 1.0 - v1 - v2;
    weights[(first + 1) % 3] = v1;
    weights[(first + 2) % 3] = v2;
    let u = weights[1];
    Hit { t: t.clamp(near, far) * scale, u, v: weights[2].clamp(0.0, 1.0 - u), front }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: DVec3 = DVec3::new(-1.0, -1.0, 5.0);
    const B: DVec3 = DVec3::new(3.0, -1.0, 5.0);
    const C: DVec3 = DVec3::new(-1.0, 3.0, 5.0);

    #[test]
    fn a_plain_hit_has_distance_weights_and_side() {
        let hit = intersect(A, B, C, DVec3::Z).expect("the axis passes inside");
        assert_eq!((hit.t, hit.u, hit.v), (5.0, 0.25, 0.25));
        // Seen from the origin, towards +z, these corners run clockwise.
        assert!(!hit.front);
        assert!(intersect(A, C, B, DVec3::Z).expect("the same triangle, turned").front);
        let behind = intersect(A, B, C, DVec3::NEG_Z).expect("lines go both ways");
        assert_eq!(behind.t, -5.0);
        assert!(intersect(A, B, C, DVec3::new(0.0, 0.8, 0.6)).is_none());
    }

    #[test]
    fn edges_and_corners_count_as_inside() {
        for target in [A, B, C, (A + B) / 2.0, (B + C) / 2.0, (C + A) / 2.0] {
            let hit = intersect(A, B, C, target).expect("exactly on the rim");
            assert!((hit.t - 1.0).abs() < 1e-15, "{target}: {hit:?}");
        }
    }

    #[test]
    fn zeros_of_either_sign_and_denormals_keep_their_places() {
        let tiny = f64::from_bits(1);
        for x in [0.0, -0.0, tiny, -tiny] {
            for y in [0.0, -0.0, tiny, -tiny] {
                let d = DVec3::new(x, y, 1.0);
                assert!(intersect(A, B, C, d).is_some(), "{d}");
                // A fan whose hub is on the axis: the ray is within a denormal of the hub.
                let hub = DVec3::new(0.0, -0.0, 2.0);
                let rim =
                    [(1.0, 0.0), (0.0, 1.0), (-1.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 2.0));
                let hit = (0..3).any(|i| intersect(hub, rim[i], rim[(i + 1) % 3], d).is_some());
                assert!(hit, "{d} passes through the hub");
            }
        }
    }

    #[test]
    fn triangles_without_area_and_edge_on_are_never_hit() {
        assert!(intersect(A, A, A, DVec3::Z).is_none());
        assert!(intersect(A, B, A, A).is_none());
        assert!(intersect(A, B, B.lerp(A, 0.5), A).is_none());
        let on_edge = [DVec3::new(0.0, -1.0, 1.0), DVec3::new(0.0, 1.0, 1.0), DVec3::Z * 2.0];
        assert!(intersect(on_edge[0], on_edge[1], on_edge[2], DVec3::Z).is_none());
    }

    #[test]
    fn what_is_not_finite_is_missed() {
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(intersect(DVec3::splat(bad), B, C, DVec3::Z).is_none());
            assert!(intersect(A, B, C, DVec3::new(0.0, bad, 1.0)).is_none());
        }
    }

    #[test]
    fn sizes_from_the_smallest_to_the_largest_give_the_same_weights() {
        for exponent in [-1000, -400, -60, 0, 60, 400, 900] {
            let scale = 2f64.powi(exponent);
            let d = DVec3::new(0.1, 0.2, 5.0);
            let hit = intersect(A * scale, B * scale, C * scale, d).expect("scaled about the eye");
            assert!((hit.t / scale - 1.0).abs() < 1e-15, "2^{exponent}: {hit:?}");
            assert!((hit.u - 1.1 / 4.0).abs() + (hit.v - 1.2 / 4.0).abs() < 1e-15, "{hit:?}");
        }
    }

    /// Needles of aspect 10⁶, aimed at along a known point: the error stays within the documented
    /// bound, which for a needle (largest angle ≥ 90°) is that of a well-shaped triangle.
    #[test]
    fn needles_keep_their_distance() {
        let mut random = random_numbers(11);
        for case in 0..10_000 {
            let tip = random_direction(&mut random) * 3.0;
            let along = random_direction(&mut random);
            let across = random_direction(&mut random).cross(along).normalize() * 1e-6;
            let mut corners = [tip, tip + along + across, tip + along - across];
            corners.rotate_left(case % 3);
            let [a, b, c] = corners;
            let target = (a + b + c) / 3.0;
            let d = target.normalize();
            let normal = (b - a).cross(c - a).normalize();
            let cosine = normal.dot(d).abs();
            let Some(hit) = intersect(a, b, c, d) else {
                // The needle's half width is 10⁹ roundings, so only an edge-on view may miss.
                assert!(cosine < 1e-6, "missed at cosine {cosine}");
                continue;
            };
            let r = a.length().max(b.length()).max(c.length());
            let error = (hit.t - target.length()).abs();
            let allowed = 16.0 * ROUNDING * r / cosine;
            assert!(error <= allowed, "case {case}: {error:e} over {allowed:e}, cosine {cosine}");
        }
    }

    #[test]
    fn many_lines_are_located_as_one_is() {
        let mut random = random_numbers(19);
        for _ in 0..2000 {
            let zero = [0.0; 4];
            let mut lines = Lines { corners: [[zero; 3]; 3], direction: [zero; 3] };
            let mut hits = [None; 4];
            for (i, hit) in hits.iter_mut().enumerate() {
                // A third of them slim or grazed.
                let size = if random() < 0.3 { 1e-7 } else { 1.0 };
                let a = random_direction(&mut random) * 3.0;
                let b = a + random_direction(&mut random);
                let c = a.lerp(b, random()) + random_direction(&mut random) * size;
                let d = (a + (b - a) * 0.3 + (c - a) * 0.2).normalize();
                *hit = intersect(a, b, c, d);
                for (k, corner) in [a, b, c].into_iter().enumerate() {
                    for axis in 0..3 {
                        lines.corners[k][axis][i] = corner[axis];
                        lines.direction[axis][i] = d[axis];
                    }
                }
            }
            let [t, u, v] = locate_many(&lines, 0b1111);
            for (i, hit) in hits.into_iter().enumerate() {
                let Some(hit) = hit else { continue };
                assert_eq!((hit.t, hit.u, hit.v), (t[i], u[i], v[i]));
            }
        }
    }

    /// 10⁵ rays at vertices and edge midpoints of a closed mesh, half of them rounded to unit
    /// length (beside the vertex by one rounding), half exactly through: the triangles around the
    /// target must not let one pass.
    #[test]
    fn nothing_passes_between_the_triangles_of_a_closed_mesh() {
        let sphere = sphere(3);
        let mut targets: Vec<(DVec3, Vec<[DVec3; 3]>)> = Vec::new();
        for corner in 0..3 {
            for triangle in &sphere {
                let vertex = triangle[corner];
                let middle = (vertex + triangle[(corner + 1) % 3]) / 2.0;
                let fan = |p: DVec3| -> Vec<[DVec3; 3]> {
                    let near = |t: &&[DVec3; 3]| t.iter().any(|q| (*q - p).length() < 0.3);
                    sphere.iter().filter(near).copied().collect()
                };
                targets.push((vertex, fan(vertex)));
                targets.push((middle, fan(middle)));
            }
        }
        let mut random = random_numbers(3);
        let mut rays = 0;
        for (target, fan) in &targets {
            for inside in [false, true] {
                for _ in 0..9 {
                    let away = random_direction(&mut random);
                    let origin = if inside { away * 0.3 } else { *target * 3.0 + away };
                    let seen = *target - origin;
                    for d in [seen, seen.normalize()] {
                        let hit = |[a, b, c]: &[DVec3; 3]| {
                            intersect(*a - origin, *b - origin, *c - origin, d)
                        };
                        assert!(fan.iter().any(|t| hit(t).is_some()), "{origin} to {target}");
                        rays += 1;
                    }
                }
            }
        }
        assert!(rays >= 100_000, "{rays}");
    }

    /// A unit octahedron, each triangle split in four `levels` times.
    fn sphere(levels: usize) -> Vec<[DVec3; 3]> {
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut triangles = Vec::new();
        for (s, t) in [(x, y), (y, -x), (-x, -y), (-y, x)] {
            triangles.extend([[s, t, z], [t, s, -z]]);
        }
        for _ in 0..levels {
            triangles = triangles
                .into_iter()
                .flat_map(|[a, b, c]| {
                    let middle = |p: DVec3, q: DVec3| (p + q).normalize();
                    let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
                })
                .collect();
        }
        triangles
    }

    /// Uniform numbers in 0..1 (Vigna's splitmix64).
    fn random_numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
        }
    }

    fn random_direction(random: &mut impl FnMut() -> f64) -> DVec3 {
        let z = 2.0 * random() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * random()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}
