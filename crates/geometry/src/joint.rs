//! Frames that move in each other, each by tracks of its translation, its rotation and its scale that have times of their
//! own: the nodes of an animated model, at any time exactly in f64.
//!
//! Steps, straight lines (of rotations the shorter way at constant speed) and Hermite's cubics with tangents at their keys are
//! those of glTF 2.0, section 3.11 and appendix C.

use glam::{DQuat, DVec3, DVec4};

use crate::Transform;
use crate::hermite::turned;

/// Steps in which the length of a rotation's cubic is looked at between two keys.
const STEPS: u32 = 64;

/// A rotation's cubic that comes as near to no rotation at all has no direction.
const LEAST: f64 = 1e-3;

/// Interpolation between two keys of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// The value of the first.
    Step,
    /// A straight line.
    Linear,
    /// Hermite's cubic by the tangents at both.
    Cubic,
}

/// Values at times: vectors, whose fourth number is 0, or quaternions.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Interpolation between two keys.
    pub between: Between,
    /// Times (s), growing; one at least.
    pub times: Vec<f64>,
    /// Of each key the tangent into it (1/s), the value, and the tangent out of it (1/s); tangents count in cubics alone.
    pub keys: Vec<[DVec4; 3]>,
}

/// A frame in its parent's.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// m.
    pub translation: Track,
    /// Quaternions; made of length 1.
    pub rotation: Track,
    /// Without unit.
    pub scale: Track,
}

/// A step on the way from a body to what it hangs on.
#[derive(Debug, Clone, PartialEq)]
pub enum Link {
    /// A frame that stands still in its parent's.
    Fixed(Transform),
    /// One that moves.
    Joint(Box<Joint>),
}

impl Track {
    /// A value that does not change.
    #[must_use]
    pub fn constant(value: DVec4) -> Self {
        let keys = vec![[DVec4::ZERO, value, DVec4::ZERO]];
        Self { between: Between::Step, times: vec![0.0], keys }
    }

    /// The keys between which a time lies, and the share of the way between them; before the first and after the last
    /// one, that key alone.
    fn segment(&self, time: f64) -> (usize, Option<(usize, f64)>) {
        let after = self.times.partition_point(|&key| key <= time);
        if after == 0 || after == self.times.len() {
            return (after.saturating_sub(1), None);
        }
        let [from, to] = [self.times[after - 1], self.times[after]];
        (after - 1, Some((after, (time - from) / (to - from))))
    }

    /// The value at a time (s), of quaternions of any length.
    #[must_use]
    pub fn at(&self, time: f64) -> DVec4 {
        let (i, Some((k, s))) = self.segment(time) else {
            return self.keys[self.segment(time).0][1];
        };
        let [_, from, out] = self.keys[i];
        let [into, to, _] = self.keys[k];
        match self.between {
            Between::Step => from,
            Between::Linear => from + (to - from) * s,
            Between::Cubic => {
                let length = self.times[k] - self.times[i];
                let (s2, s3) = (s * s, s * s * s);
                from * (2.0 * s3 - 3.0 * s2 + 1.0)
                    + out * (length * (s3 - 2.0 * s2 + s))
                    + to * (3.0 * s2 - 2.0 * s3)
                    + into * (length * (s3 - s2))
            }
        }
    }

    /// The rotation at a time (s).
    fn rotation(&self, time: f64) -> DQuat {
        match (self.between, self.segment(time)) {
            (Between::Linear, (i, Some((k, s)))) => {
                let [a, b] = [i, k].map(|key| DQuat::from_vec4(self.keys[key][1]).normalize());
                turned(a, if a.dot(b) < 0.0 { -b } else { b }, s)
            }
            _ => DQuat::from_vec4(self.at(time)).normalize(),
        }
    }

    /// The ways from key to key that overlap some times (s).
    fn ways(&self, [open, close]: [f64; 2]) -> impl Iterator<Item = usize> {
        (1..self.times.len())
            .filter(move |&k| self.times[k] > open && self.times[k - 1] < close)
            .map(|k| k - 1)
    }

    /// The points by which the cubic of a way is within (Bézier's), and the length of the way (s).
    fn hull(&self, i: usize) -> ([DVec4; 4], f64) {
        let length = self.times[i + 1] - self.times[i];
        let [_, from, out] = self.keys[i];
        let [into, to, _] = self.keys[i + 1];
        ([from, from + out * (length / 3.0), to - into * (length / 3.0), to], length)
    }

    /// At most how fast the value changes between some times (1/s).
    fn speed(&self, times: [f64; 2]) -> f64 {
        let of_way = |i: usize| {
            let ([a, b, c, d], length) = self.hull(i);
            match self.between {
                Between::Step => 0.0,
                Between::Linear => (d - a).length() / length,
                Between::Cubic => {
                    let parts = [b - a, c - b, d - c].map(|part| 3.0 * part.length() / length);
                    parts.into_iter().fold(0.0, f64::max)
                }
            }
        };
        self.ways(times).map(of_way).fold(0.0, f64::max)
    }

    /// All values between which it is.
    fn values(&self) -> impl Iterator<Item = DVec4> {
        let cubics = if self.between == Between::Cubic { self.times.len() - 1 } else { 0 };
        self.keys.iter().map(|key| key[1]).chain((0..cubics).flat_map(|i| self.hull(i).0))
    }

    /// The least length of the values of the way from key `i`, at least.
    fn least(&self, i: usize) -> f64 {
        let (_, length) = self.hull(i);
        let step = length / f64::from(STEPS);
        let at = |k: u32| self.at(self.times[i] + step * f64::from(k)).length();
        let least = (0..STEPS).map(at).fold(f64::INFINITY, f64::min);
        let end = self.keys[i + 1][1].length();
        least.min(end) - 0.5 * step * self.speed([self.times[i], self.times[i + 1]])
    }

    /// At most how fast the rotation turns between some times (rad/s).
    fn turning(&self, times: [f64; 2]) -> f64 {
        let of_way = |i: usize| match self.between {
            Between::Step => 0.0,
            Between::Linear => {
                let [a, b] = [i, i + 1].map(|key| DQuat::from_vec4(self.keys[key][1]).normalize());
                let length = self.times[i + 1] - self.times[i];
                a.angle_between(if a.dot(b) < 0.0 { -b } else { b }) / length
            }
            // Of q/|q| by the speed of q.
            Between::Cubic => {
                2.0 * self.speed([self.times[i], self.times[i + 1]]) / self.least(i).max(LEAST)
            }
        };
        self.ways(times).map(of_way).fold(0.0, f64::max)
    }

    /// True if the value changes between two times (s).
    #[must_use]
    pub fn moves_within(&self, times: [f64; 2]) -> bool {
        self.ways(times).any(|i| {
            let ([a, b, c, d], _) = self.hull(i);
            match self.between {
                // At the end of the way.
                Between::Step => a != d && self.times[i + 1] < times[1],
                Between::Linear => a != d,
                Between::Cubic => a != d || a != b || c != d,
            }
        })
    }
}

impl Joint {
    /// Fault that keeps the joint's place from being known at all times, in words.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        let rotation = &self.rotation;
        let ways = 0..rotation.times.len() - 1;
        let is_lost =
            rotation.between == Between::Cubic && ways.clone().any(|i| rotation.least(i) < LEAST);
        if is_lost || rotation.keys.iter().any(|key| key[1].length() < LEAST) {
            return Some("its rotation passes through none");
        }
        let signs = self.scale.values().map(|value| value.truncate().signum());
        let has_zero = self.scale.values().any(|value| value.truncate().abs().min_element() == 0.0);
        let first = self.scale.keys[0][1].truncate().signum();
        (has_zero || signs.into_iter().any(|sign| sign != first))
            .then_some("its scale passes through 0")
    }

    /// Transform at a time (s), to its parent's frame.
    #[must_use]
    pub fn at(&self, time: f64) -> Transform {
        let [translation, scale]: [DVec3; 2] =
            [&self.translation, &self.scale].map(|track| track.at(time).truncate());
        Transform::from_trs(translation, self.rotation.rotation(time), scale)
    }

    fn tracks(&self) -> [&Track; 3] {
        [&self.translation, &self.rotation, &self.scale]
    }

    fn stretch(&self) -> f64 {
        self.scale.values().map(|value| value.abs().max_element()).fold(0.0, f64::max)
    }
}

impl Link {
    /// From the frame to its parent's at a time (s).
    #[must_use]
    pub fn at(&self, time: f64) -> Transform {
        match self {
            Self::Fixed(transform) => *transform,
            Self::Joint(joint) => joint.at(time),
        }
    }

    /// Bytes of it and its keys.
    pub(crate) fn heap_bytes(&self) -> usize {
        let key = size_of::<f64>() + size_of::<[DVec4; 3]>();
        let keys: usize = self.tracks().map(|track| track.keys.len() * key).sum();
        let joint = if matches!(self, Self::Joint(_)) { size_of::<Joint>() } else { 0 };
        size_of::<Self>() + joint + keys
    }

    /// Tracks that move the frame; none of a frame that stands still.
    pub fn tracks(&self) -> impl Iterator<Item = &Track> {
        let joint = match self {
            Self::Fixed(_) => None,
            Self::Joint(joint) => Some(joint),
        };
        joint.into_iter().flat_map(|joint| joint.tracks())
    }

    /// The times of its keys (s).
    pub(crate) fn times(&self) -> impl Iterator<Item = f64> {
        let tracks = self.tracks();
        tracks.filter(|track| track.times.len() > 1).flat_map(|track| track.times.iter().copied())
    }

    /// True if the link moves between two times (s).
    #[must_use]
    pub fn moves_within(&self, times: [f64; 2]) -> bool {
        match self {
            Self::Fixed(_) => false,
            Self::Joint(joint) => joint.tracks().iter().any(|track| track.moves_within(times)),
        }
    }

    /// True if directions in the link change between two times (s).
    pub(crate) fn turns_within(&self, times: [f64; 2]) -> bool {
        match self {
            Self::Fixed(_) => false,
            Self::Joint(joint) => {
                joint.rotation.moves_within(times) || joint.scale.moves_within(times)
            }
        }
    }

    /// A bound of the factor by which any length is stretched.
    pub(crate) fn stretch(&self) -> f64 {
        match self {
            Self::Fixed(transform) => {
                let axes = transform.linear;
                let lengths = [axes.x_axis, axes.y_axis, axes.z_axis].map(DVec3::length);
                DVec3::from(lengths).length()
            }
            Self::Joint(joint) => joint.stretch(),
        }
    }

    /// Of points within `reach` (m) of the frame's origin that move in it at most at a speed (m/s), the same in its
    /// parent's frame between some times (s).
    pub(crate) fn bounds(&self, [reach, speed]: [f64; 2], times: [f64; 2]) -> [f64; 2] {
        let stretch = self.stretch();
        match self {
            Self::Fixed(transform) => {
                [transform.translation.length() + stretch * reach, stretch * speed]
            }
            Self::Joint(joint) => {
                let place = joint.translation.values().map(|value| value.length());
                let farthest = place.fold(0.0, f64::max);
                let own = joint.translation.speed(times)
                    + (joint.rotation.turning(times) * stretch + joint.scale.speed(times)) * reach;
                [farthest + stretch * reach, own + stretch * speed]
            }
        }
    }
}
