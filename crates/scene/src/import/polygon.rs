//! Polygons into triangles, without losing a corner: every polygon of n corners gives n − 2
//! triangles, so that neighbours still meet corner to corner.
//!
//! Ears are clipped one by one (Meisters, *Polygons have ears*, 1975) in the coordinate plane that
//! shows the polygon largest, with exact orientation tests (Shewchuk 1997). Polygons that touch
//! themselves, as those do that reach a hole by a bridge, are cut inside as they should be.

use etendue_geometry::glam::DVec3;
use robust::{Coord, orient2d};

/// Ear clipping takes time with the square of the corners; beyond this many a polygon is fanned.
const MOST_CORNERS: usize = 20_000;

/// Triangles of the polygon `points`, as indices into it, onto the end of `triangles`.
pub(super) fn triangulate(points: &[DVec3], triangles: &mut Vec<[u32; 3]>) {
    let flat = match flattened(points) {
        Some(flat) if points.len() > 3 && points.len() <= MOST_CORNERS => flat,
        _ => return fan(points.len(), triangles),
    };
    if is_convex(&flat) {
        return fan(points.len(), triangles);
    }
    Clipper::new(&flat).clip(triangles);
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

/// Whether no corner turns right. (That it winds once is not asked: a star fans no worse.)
fn is_convex(polygon: &[Coord<f64>]) -> bool {
    let n = polygon.len();
    (0..n).all(|i| orient2d(polygon[i], polygon[(i + 1) % n], polygon[(i + 2) % n]) >= 0.0)
}

/// A polygon that loses its ears.
struct Clipper<'a> {
    polygon: &'a [Coord<f64>],
    previous: Vec<usize>,
    next: Vec<usize>,
    left: usize,
}

impl<'a> Clipper<'a> {
    fn new(polygon: &'a [Coord<f64>]) -> Self {
        let n = polygon.len();
        Self {
            polygon,
            previous: (0..n).map(|i| (i + n - 1) % n).collect(),
            next: (0..n).map(|i| (i + 1) % n).collect(),
            left: n,
        }
    }

    fn clip(mut self, triangles: &mut Vec<[u32; 3]>) {
        let index = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        let mut at = 0;
        while self.left > 3 {
            let ear = self.find(at);
            let (before, behind) = (self.previous[ear], self.next[ear]);
            triangles.push([index(before), index(ear), index(behind)]);
            self.next[before] = behind;
            self.previous[behind] = before;
            self.left -= 1;
            // One on, so that ears are taken around the polygon and not as a fan of needles.
            at = self.next[behind];
        }
        triangles.push([index(self.previous[at]), index(at), index(self.next[at])]);
    }

    /// The next ear from `from` on; where the polygon crosses itself and has none, a corner that
    /// turns left at least, or any.
    fn find(&self, from: usize) -> usize {
        let around = || std::iter::successors(Some(from), |&i| Some(self.next[i])).take(self.left);
        around()
            .find(|&i| self.is_ear(i))
            .or_else(|| around().find(|&i| self.turn(i) == 0.0))
            .or_else(|| around().find(|&i| self.turn(i) > 0.0))
            .unwrap_or(from)
    }

    /// Positive where corner `i` turns left.
    fn turn(&self, i: usize) -> f64 {
        self.side(self.previous[i], i, self.next[i])
    }

    /// Positive where `c` is to the left of the line from `a` to `b`.
    fn side(&self, a: usize, b: usize, c: usize) -> f64 {
        orient2d(self.polygon[a], self.polygon[b], self.polygon[c])
    }

    fn is_ear(&self, b: usize) -> bool {
        if self.turn(b) <= 0.0 {
            return false;
        }
        let corners = [self.previous[b], b, self.next[b]];
        let others = std::iter::successors(Some(self.next[corners[2]]), |&i| Some(self.next[i]));
        !others.take(self.left - 3).any(|other| self.blocks(corners, other))
    }

    /// Whether `other` lies in the triangle, or, where it is at one of its corners, whether the
    /// polygon goes from there into it.
    fn blocks(&self, [a, b, c]: [usize; 3], other: usize) -> bool {
        let inside = |p: usize, of: &[(usize, usize)]| {
            of.iter().all(|&(from, to)| self.side(from, to, p) > 0.0)
        };
        let wedge = |of: [(usize, usize); 2]| {
            inside(self.previous[other], &of) || inside(self.next[other], &of)
        };
        let place = self.polygon[other];
        if place == self.polygon[b] {
            wedge([(a, b), (b, c)])
        } else if place == self.polygon[a] {
            wedge([(a, b), (c, a)])
        } else if place == self.polygon[c] {
            wedge([(b, c), (c, a)])
        } else {
            [(a, b), (b, c), (c, a)].iter().all(|&(from, to)| self.side(from, to, other) >= 0.0)
        }
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
}
