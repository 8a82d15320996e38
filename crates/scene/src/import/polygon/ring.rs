//! The rest of a polygon while its ears are cut off.

use robust::{Coord, orient2d};

/// A polygon that loses its ears.
pub(super) struct Ring<'a> {
    pub(super) polygon: &'a [Coord<f64>],
    pub(super) previous: Vec<usize>,
    pub(super) next: Vec<usize>,
    pub(super) left: usize,
}

impl<'a> Ring<'a> {
    pub(super) fn new(polygon: &'a [Coord<f64>]) -> Self {
        let n = polygon.len();
        Self {
            polygon,
            previous: (0..n).map(|i| (i + n - 1) % n).collect(),
            next: (0..n).map(|i| (i + 1) % n).collect(),
            left: n,
        }
    }

    /// Cuts corner `i` off.
    pub(super) fn cut(&mut self, i: usize, triangles: &mut Vec<[u32; 3]>) {
        let (before, behind) = (self.previous[i], self.next[i]);
        triangles.push(self.triangle(i));
        self.next[before] = behind;
        self.previous[behind] = before;
        self.left -= 1;
    }

    /// The triangle at corner `i`.
    pub(super) fn triangle(&self, i: usize) -> [u32; 3] {
        let index = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        [index(self.previous[i]), index(i), index(self.next[i])]
    }

    /// Positive where corner `i` turns left.
    pub(super) fn turn(&self, i: usize) -> f64 {
        self.side(self.previous[i], i, self.next[i])
    }

    /// Positive where `c` is to the left of the line from `a` to `b`.
    fn side(&self, a: usize, b: usize, c: usize) -> f64 {
        orient2d(self.polygon[a], self.polygon[b], self.polygon[c])
    }

    /// True if `other` lies in the triangle, or, where it is at one of its corners, whether the
    /// polygon goes from there into it.
    pub(super) fn blocks(&self, [a, b, c]: [usize; 3], other: usize) -> bool {
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
