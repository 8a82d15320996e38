//! Polygons into triangles, without losing a corner: every polygon of n corners gives n − 2
//! triangles, so that neighbours still meet corner to corner.
//!
//! Ears are clipped one by one (Meisters, *Polygons have ears*, 1975) in the coordinate plane that
//! shows the polygon largest, with exact orientation tests (Shewchuk 1997). Polygons that touch
//! themselves, as those do that reach a hole by a bridge, are cut inside as they should be.
//!
//! Small polygons are walked around corner by corner, which takes time with the cube of the corners
//! at worst; for larger ones see [`large`].

mod large;
mod ring;

use etendue_geometry::glam::DVec3;
use robust::{Coord, orient2d};

use ring::Ring;

/// The most corners of a polygon that is walked around.
const SMALL: usize = 64;

/// Triangles of the polygon `points`, as indices into it, onto the end of `triangles`.
pub(super) fn triangulate(points: &[DVec3], triangles: &mut Vec<[u32; 3]>) {
    let flat = match flattened(points) {
        Some(flat) if points.len() > 3 => flat,
        _ => return fan(points.len(), triangles),
    };
    if is_convex(&flat) {
        fan(points.len(), triangles);
    } else if flat.len() <= SMALL {
        Clipper::new(&flat).clip(triangles);
    } else {
        large::clip(&flat, triangles);
    }
}

/// All triangles from the first corner.
fn fan(corners: usize, triangles: &mut Vec<[u32; 3]>) {
    let last = u32::try_from(corners).unwrap_or(u32::MAX);
    triangles.extend((2..last).map(|i| [0, i - 1, i]));
}

/// The polygon in two dimensions, counter-clockwise; `None` without an area or with corners that
/// are not finite.
fn flattened(points: &[DVec3]) -> Option<Vec<Coord<f64>>> {
    let first = *points.first()?;
    // Newell's normal, about the first corner so that no digits are lost far from the origin.
    let mut normal = DVec3::ZERO;
    let mut previous = DVec3::ZERO;
    for &point in points {
        let next = point - first;
        normal += previous.cross(next);
        previous = next;
    }
    let size = normal.abs();
    if !(size.max_element() > 0.0 && size.is_finite()) {
        return None;
    }
    let (x, y, front) = if size.x >= size.y && size.x >= size.z {
        (1, 2, normal.x)
    } else if size.y >= size.z {
        (2, 0, normal.y)
    } else {
        (0, 1, normal.z)
    };
    let (x, y) = if front > 0.0 { (x, y) } else { (y, x) };
    Some(points.iter().map(|p| Coord { x: p[x], y: p[y] }).collect())
}

/// True if no corner turns right. (That it winds once is not asked: a star fans no worse.)
fn is_convex(polygon: &[Coord<f64>]) -> bool {
    let n = polygon.len();
    (0..n).all(|i| orient2d(polygon[i], polygon[(i + 1) % n], polygon[(i + 2) % n]) >= 0.0)
}

/// Clips a small polygon.
struct Clipper<'a>(Ring<'a>);

impl<'a> Clipper<'a> {
    fn new(polygon: &'a [Coord<f64>]) -> Self {
        Self(Ring::new(polygon))
    }

    fn clip(mut self, triangles: &mut Vec<[u32; 3]>) {
        let mut at = 0;
        while self.0.left > 3 {
            let ear = self.find(at);
            let behind = self.0.next[ear];
            self.0.cut(ear, triangles);
            // One on, so that ears are taken around the polygon and not as a fan of needles.
            at = self.0.next[behind];
        }
        triangles.push(self.0.triangle(at));
    }

    /// The next ear from `from` on; where the polygon crosses itself and has none, a corner that
    /// turns left at least, or any.
    fn find(&self, from: usize) -> usize {
        let ring = &self.0;
        let corners = || std::iter::successors(Some(from), |&i| Some(ring.next[i])).take(ring.left);
        corners()
            .find(|&i| self.is_ear(i))
            .or_else(|| corners().find(|&i| ring.turn(i) == 0.0))
            .or_else(|| corners().find(|&i| ring.turn(i) > 0.0))
            .unwrap_or(from)
    }

    fn is_ear(&self, b: usize) -> bool {
        let ring = &self.0;
        if ring.turn(b) <= 0.0 {
            return false;
        }
        let corners = [ring.previous[b], b, ring.next[b]];
        let others = std::iter::successors(Some(ring.next[corners[2]]), |&i| Some(ring.next[i]));
        !others.take(ring.left - 3).any(|other| ring.blocks(corners, other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3], triangles: &[[u32; 3]]) -> (DVec3, f64) {
        let vector = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            (b - a).cross(c - a) * 0.5
        };
        let sum = triangles.iter().map(vector).sum();
        (sum, triangles.iter().map(|t| vector(t).length()).sum())
    }

    fn check(points: &[DVec3], expected: f64) {
        let mut triangles = Vec::new();
        triangulate(points, &mut triangles);
        assert_eq!(triangles.len(), points.len() - 2);
        let (vector, total) = area(points, &triangles);
        // Sums of a dozen products of small numbers: a few units in the last place.
        assert!((vector.length() - expected).abs() < 1e-13 * expected, "{vector} {expected}");
        assert!((total - expected).abs() < 1e-13 * expected, "overlaps: {total} for {expected}");
    }

    #[test]
    fn concave_polygons_in_all_planes_keep_their_area() {
        // An arrow head and a comb with two teeth.
        let arrow = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]];
        let comb = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        let planes: [fn([f64; 2]) -> DVec3; 4] = [
            |[x, y]| DVec3::new(x, y, 0.0),
            |[x, y]| DVec3::new(y, x, 7.0),
            |[x, y]| DVec3::new(x, 1.0, y),
            |[x, y]| DVec3::new(3.0, x, y),
        ];
        for plane in planes {
            for start in 0..4 {
                let mut turned = arrow.map(plane);
                turned.rotate_left(start);
                check(&turned, 0.5);
            }
            check(&comb.map(plane), 11.0);
        }
    }

    #[test]
    fn a_hole_reached_by_a_bridge_stays_open() {
        let square = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        check(&square.map(|[x, y]| DVec3::new(x, y, 0.0)), 12.0);
    }

    #[test]
    fn corners_in_a_row_are_kept() {
        let row = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
        check(&row.map(|[x, y]| DVec3::new(x, y, 0.0)), 2.5);
    }

    #[test]
    fn nothing_is_too_broken_to_end() {
        let nan = DVec3::NAN;
        for points in [vec![], vec![nan; 2], vec![DVec3::ZERO; 9], vec![nan; 9]] {
            let mut triangles = Vec::new();
            triangulate(&points, &mut triangles);
            assert_eq!(triangles.len(), points.len().saturating_sub(2));
        }
        // A star that crosses itself five times.
        let star: Vec<DVec3> = (0..5)
            .map(|i| f64::from(i) * 0.8 * std::f64::consts::PI)
            .map(|a| DVec3::new(a.cos(), a.sin(), 0.0))
            .collect();
        let mut triangles = Vec::new();
        triangulate(&star, &mut triangles);
        assert_eq!(triangles.len(), 3);
    }

    /// A comb of `teeth` thin teeth of length 9 on a back of height 1; a tooth and a gap are 1 wide.
    fn comb(teeth: u32) -> Vec<DVec3> {
        let width = f64::from(teeth);
        let mut corners = vec![[0.0, 0.0], [width, 0.0]];
        for tooth in (0..teeth).rev() {
            let left = f64::from(tooth);
            corners.extend([[left + 0.75, 1.0], [left + 0.75, 10.0], [left + 0.25, 10.0]]);
            corners.push([left + 0.25, 1.0]);
        }
        corners.push([0.0, 1.0]);
        // The right end of the back.
        corners.insert(2, [width, 1.0]);
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    #[test]
    fn large_combs_and_spirals_keep_their_area() {
        for teeth in [16, 100, 3000] {
            check(&comb(teeth), f64::from(teeth) * (1.0 + 4.5));
        }
        // A band of width 1/2 that winds fifty times around; its area is that of its quadrangles.
        let steps = 3000;
        let at = |i: u32, radius: f64| {
            let turn = 50.0 * f64::from(i) / f64::from(steps);
            let (sin, cos) = (turn * std::f64::consts::TAU).sin_cos();
            DVec3::new((radius + turn) * cos, (radius + turn) * sin, 0.0)
        };
        let outer: Vec<DVec3> = (0..=steps).map(|i| at(i, 1.5)).collect();
        let inner: Vec<DVec3> = (0..=steps).map(|i| at(i, 1.0)).collect();
        let triangle = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).z * 0.5;
        let area: f64 = (0..steps as usize)
            .map(|i| {
                let [a, b, c, d] = [inner[i], outer[i], outer[i + 1], inner[i + 1]];
                triangle(a, b, c) + triangle(a, c, d)
            })
            .sum();
        let spiral: Vec<DVec3> = outer.into_iter().chain(inner.into_iter().rev()).collect();
        check(&spiral, area);
    }

    #[test]
    fn many_holes_reached_by_bridges_stay_open() {
        // Square holes in a row, each reached by a bridge from the lower side.
        let holes = 400;
        let mut corners = vec![[0.0, 0.0]];
        for hole in 0..holes {
            let x = f64::from(hole) + 0.25;
            corners.extend([[x, 0.0], [x, 0.25], [x, 0.75], [x + 0.5, 0.75], [x + 0.5, 0.25]]);
            corners.extend([[x, 0.25], [x, 0.0]]);
        }
        let width = f64::from(holes);
        corners.extend([[width, 0.0], [width, 1.0], [0.0, 1.0]]);
        let corners: Vec<DVec3> = corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
        check(&corners, width * 0.75);
    }

    #[test]
    fn large_polygons_are_cut_as_small_ones_are_where_they_are_sound() {
        // Not the same triangles, but the same area without overlaps.
        for teeth in [3, 15] {
            let points = comb(teeth);
            let flat = flattened(&points).unwrap();
            let mut triangles = Vec::new();
            large::clip(&flat, &mut triangles);
            assert_eq!(triangles.len(), points.len() - 2);
            let (vector, total) = area(&points, &triangles);
            assert!((vector.length() - total).abs() < 1e-12 * total);
        }
    }

    #[test]
    fn sides_of_many_corners_in_a_row_keep_them_all() {
        let side = 500;
        let along = |i: u32| f64::from(i) / f64::from(side);
        let mut corners: Vec<[f64; 2]> = (0..side).map(|i| [along(i), 0.0]).collect();
        corners.extend((0..side).map(|i| [1.0, along(i)]));
        corners.extend((0..side).map(|i| [1.0 - along(i), 1.0]));
        // Inwards, so that it is not convex.
        corners.extend([[0.0, 1.0], [0.5, 0.5]]);
        let corners: Vec<DVec3> = corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
        // The square without its left quarter, which the last two sides cut off.
        check(&corners, 1.0 - 0.25);
    }

    #[test]
    fn large_broken_polygons_take_a_bounded_effort() {
        let plane = |[x, y]: [f64; 2]| DVec3::new(x, y, 0.0);
        let angles = |n: u32, step: u32| {
            (0..n).map(move |i| f64::from(i * step % n) / f64::from(n) * std::f64::consts::TAU)
        };
        // Few places visited many times, a star that crosses itself everywhere, all on a line, and
        // back and forth on a line with a tip.
        let places = [[0.0, 0.0], [1.0, 0.0], [0.4, 0.4], [0.0, 1.0], [0.3, 0.3]];
        let repeated: Vec<DVec3> = (0..20_000).map(|i| plane(places[i % 5])).collect();
        let star: Vec<DVec3> = angles(19_999, 9_998).map(|a| plane([a.cos(), a.sin()])).collect();
        let mut zigzag: Vec<DVec3> = (0..20_000).map(|i| plane([f64::from(i % 7), 0.0])).collect();
        zigzag.push(plane([3.0, 1.0]));
        zigzag.push(plane([2.0, 0.1]));
        let noise: Vec<DVec3> = (0..20_000_u64)
            .map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15))
            .map(|k| plane([(k >> 40) as f64, (k >> 16 & 0xff_ffff) as f64]))
            .collect();
        for points in [repeated, star, zigzag, noise] {
            let flat = flattened(&points).unwrap();
            let mut triangles = Vec::new();
            let effort = large::clip(&flat, &mut triangles);
            assert_eq!(triangles.len(), points.len() - 2);
            let corners = points.len();
            assert!(effort <= large::most_effort(corners) + 64, "{effort} for {corners}");
        }
    }
}
