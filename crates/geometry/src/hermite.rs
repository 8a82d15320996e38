//! The curve through points at uneven times that cameras and objects move along: Hermite's cubic, or straight lines.
//!
//! The slope at a point is that of the parabola through it and its two neighbours, and at both ends that of the last
//! parabola (Catmull & Rom, *A class of local interpolating splines*, 1974, for uneven times): points on a parabola give that
//! parabola. Of two points the curve is the line.

use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Interpolation of a place between two points.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// In a straight line at constant speed.
    #[default]
    Linear,
    /// Along a cubic, without a corner at the points.
    Cubic,
}

/// Points by their number, each with its time (s).
pub trait Points {
    /// Number of points: two or more.
    fn count(&self) -> usize;
    /// The time of a point (s), after that of the one before it.
    fn time(&self, i: usize) -> f64;
    /// The point (m).
    fn place(&self, i: usize) -> DVec3;
}

/// The velocity (m/s) of the straight way from point `i` to the next.
fn chord(points: &impl Points, i: usize) -> DVec3 {
    (points.place(i + 1) - points.place(i)) / (points.time(i + 1) - points.time(i))
}

/// The slope (m/s) of the curve at point `i`.
fn slope(points: &impl Points, i: usize) -> DVec3 {
    let last = points.count() - 1;
    let length = |k: usize| points.time(k + 1) - points.time(k);
    let [before, after] = [i.checked_sub(1), Some(i).filter(|i| *i < last)];
    match (before, after) {
        (Some(before), Some(after)) => {
            let [a, b] = [before, after].map(length);
            (chord(points, before) * b + chord(points, after) * a) / (a + b)
        }
        _ if last == 1 => chord(points, 0),
        (None, _) => outward(points, [0, 1]),
        (Some(_), None) => outward(points, [last - 1, last - 2]),
    }
}

/// The slope at the end where way `near` ends, of the parabola over it and way `far`.
fn outward(points: &impl Points, [near, far]: [usize; 2]) -> DVec3 {
    let [a, b] = [near, far].map(|k| points.time(k + 1) - points.time(k));
    let [own, other] = [near, far].map(|k| chord(points, k));
    own + (own - other) * (a / (a + b))
}

/// The slopes (m/s) at both ends of the way from point `i` to the next.
#[must_use]
pub fn slopes(points: &impl Points, i: usize, interpolation: Interpolation) -> [DVec3; 2] {
    match interpolation {
        Interpolation::Linear => [chord(points, i); 2],
        Interpolation::Cubic => [slope(points, i), slope(points, i + 1)],
    }
}

/// A way from one point to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Duration (s).
    pub length: f64,
    /// From its start to its end (m).
    pub across: DVec3,
    /// The slopes at both (m/s).
    pub slopes: [DVec3; 2],
}

impl Way {
    /// From its start to where a share `s` of its time leads (m): the line, and the bow of the curve over it, of which a
    /// straight way has none.
    #[must_use]
    pub fn at(&self, s: f64) -> DVec3 {
        let [m, n] = self.bows();
        self.across * s + (m * (1.0 - s) - n * s) * (s * (1.0 - s) * self.length)
    }

    /// The velocity there (m/s).
    #[must_use]
    pub fn velocity(&self, s: f64) -> DVec3 {
        let [m, n] = self.bows();
        let bend = m * ((1.0 - s) * (1.0 - 3.0 * s)) + n * (s * (3.0 * s - 2.0));
        self.across / self.length + bend
    }

    /// The acceleration there (m/s²).
    #[must_use]
    pub fn acceleration(&self, s: f64) -> DVec3 {
        let [m, n] = self.bows();
        (m * (6.0 * s - 4.0) + n * (6.0 * s - 2.0)) / self.length
    }

    /// At most how fast (m/s) the way is gone, by the control points of its derivative (Farin, *Curves and Surfaces for
    /// CAGD*, 4.3).
    #[must_use]
    pub fn fastest(&self) -> f64 {
        let [m, n] = self.slopes;
        let middle = self.across * (3.0 / self.length) - m - n;
        m.length().max(n.length()).max(middle.length())
    }

    /// The slopes over that of the line (m/s).
    fn bows(&self) -> [DVec3; 2] {
        let line = self.across / self.length;
        self.slopes.map(|slope| slope - line)
    }
}

/// The rotation a share `s` of the way from `a` to `b`, which are in one half of the sphere: as `a` and a
/// turn about one axis, which is exact for the least angles, too.
pub(crate) fn turned(a: DQuat, b: DQuat, s: f64) -> DQuat {
    let way = a.conjugate() * b;
    let sine = way.xyz().length();
    if sine == 0.0 {
        return a;
    }
    let half = sine.atan2(way.w) * s;
    let axis = way.xyz() / sine;
    let turn = DQuat::from_vec4((axis * half.sin()).extend(half.cos()));
    (a * turn).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Throw(Vec<f64>);

    impl Throw {
        fn at(time: f64) -> DVec3 {
            DVec3::new(1.0, 2.0, -3.0) + DVec3::new(4.0, -1.0, 0.5) * time
                - DVec3::new(0.3, 4.9, -2.0) * (time * time)
        }
    }

    impl Points for Throw {
        fn count(&self) -> usize {
            self.0.len()
        }
        fn time(&self, i: usize) -> f64 {
            self.0[i]
        }
        fn place(&self, i: usize) -> DVec3 {
            Self::at(self.0[i])
        }
    }

    /// Three points or more of a throw at uneven times give the throw, its velocity and its acceleration, up to the ends.
    #[test]
    fn points_of_a_parabola_give_that_parabola() {
        for times in [vec![0.0, 0.3, 1.0], vec![-1.0, -0.9, 0.2, 0.5, 2.0]] {
            let points = Throw(times);
            for i in 0..points.count() - 1 {
                let [from, to] = [points.time(i), points.time(i + 1)];
                let way = Way {
                    length: to - from,
                    across: points.place(i + 1) - points.place(i),
                    slopes: slopes(&points, i, Interpolation::Cubic),
                };
                for s in [0.0, 0.2, 0.7, 1.0] {
                    let time = from + s * (to - from);
                    let velocity = DVec3::new(4.0, -1.0, 0.5) - DVec3::new(0.6, 9.8, -4.0) * time;
                    let acceleration = -DVec3::new(0.6, 9.8, -4.0);
                    // Roundings of numbers of some tens, over times of a tenth.
                    assert!((points.place(i) + way.at(s) - Throw::at(time)).length() < 1e-13);
                    assert!((way.velocity(s) - velocity).length() < 1e-12, "{i} {s}");
                    assert!((way.acceleration(s) - acceleration).length() < 1e-10, "{i} {s}");
                    assert!(way.velocity(s).length() <= way.fastest() * (1.0 + 1e-14));
                }
            }
        }
    }

    #[test]
    fn two_points_are_a_line() {
        let points = Throw(vec![0.0, 2.0]);
        let line = slopes(&points, 0, Interpolation::Linear);
        assert_eq!(slopes(&points, 0, Interpolation::Cubic), line);
    }
}
