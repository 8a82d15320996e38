//! Rigid and stretching motion within an exposure: where a body is at any time, exactly in f64.
//!
//! Between keys the translation is linear or a cubic ([`crate::hermite`]), the rotation goes the shorter way at
//! constant speed (Shoemake, *Animating rotation with quaternion curves*, 1985) and the scale is linear.
//! A steady motion has a velocity and a spin, of any number of revolutions, about an axis through a point.

use glam::{DMat3, DQuat, DVec3};

use crate::hermite::{self, Interpolation, Points, Way, turned};
use crate::joint::Link;
use crate::{Bounds, Transform};

/// Motion of a body: times are in s from the frame's time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Motion {
    keys: Vec<Key>,
    interpolation: Interpolation,
    steady: Option<Steady>,
    /// Frames that move in each other, the outermost first.
    links: Vec<Link>,
    /// Transform that is applied first.
    inner: Transform,
}

/// A pose at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Key {
    time: f64,
    translation: DVec3,
    /// Rounding error of the translation (m): what rounding took from it.
    low: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

/// A constant velocity and a constant spin, which are those of the body at all times; at time 0 it is
/// where it would stand without them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Steady {
    /// Metres a second; carries the axis along.
    pub velocity: DVec3,
    /// The axis, counter-clockwise as it points at the viewer; of any length but 0.
    pub axis: DVec3,
    /// Radians a second.
    pub rate: f64,
    /// A point on the axis at time 0 (m).
    pub about: DVec3,
}

impl Steady {
    /// Of a velocity (m/s), an angular velocity (degrees/s; its direction is the axis, right-handed) and a point on the
    /// axis (m), along the world's axes.
    ///
    /// # Errors
    ///
    /// The name of the first that is too large or not finite, and why.
    pub fn of_velocities(
        velocity: [f64; 3],
        angular_velocity: [f64; 3],
        about: DVec3,
    ) -> Result<Self, (&'static str, &'static str)> {
        let [velocity, axis] = [velocity, angular_velocity].map(DVec3::from);
        let given = [("velocity", velocity), ("angular_velocity", axis), ("about", about)];
        // A length that is finite has numbers that are.
        match given.iter().find(|(_, vector)| !vector.length().is_finite()) {
            Some((name, _)) => Err((*name, "a number is too large or not finite")),
            None => Ok(Self { velocity, axis, rate: axis.length().to_radians(), about }),
        }
    }
}

/// Error of keys or a steady motion that make no motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// No key, or not one time for each transform.
    #[error(
        "there are {times} times and {transforms} transforms\nhint: give as many times as transforms, at least one"
    )]
    Count {
        /// Times that were given.
        times: usize,
        /// Transforms that were given.
        transforms: usize,
    },
    /// A number is infinite or none.
    #[error("{0} is not finite\nhint: give finite numbers")]
    NotFinite(String),
    /// Times that do not increase.
    #[error(
        "time {index} ({time} s) is not after the one before it; sort the times and leave out equal ones"
    )]
    Order {
        /// Index of the time, counted from 0.
        index: usize,
        /// That time (s).
        time: f64,
    },
    /// A transform that is no rotation and scale along the axes.
    #[error("transform {0} shears\nhint: give a translation, a rotation and a scale")]
    Shear(usize),
    /// A scale that is 0 at a key or on the way to the next one.
    #[error(
        "the scale passes through 0 at or after transform {0}\nhint: keep its sign from key to key"
    )]
    Scale(usize),
    /// A spin about no axis.
    #[error("the spin has an axis of length 0\nhint: give a direction")]
    Axis,
}

/// Cosines between axes below which a matrix does not shear: ten times what f32 matrices of files have.
const ORTHOGONAL: f64 = 1e-6;

/// Steps of a sweep between two keys.
const STEPS: u32 = 64;

impl Motion {
    /// A motion through `transforms` at `times` (s): held before the first and after the last one.
    ///
    /// # Errors
    ///
    /// [`MotionError`], when times do not increase, a number is not finite, or a transform shears or passes
    /// through a scale of 0.
    pub fn through(
        times: &[f64],
        transforms: &[Transform],
        interpolation: Interpolation,
    ) -> Result<Self, MotionError> {
        if times.is_empty() || times.len() != transforms.len() {
            let (times, transforms) = (times.len(), transforms.len());
            return Err(MotionError::Count { times, transforms });
        }
        let mut keys: Vec<Key> = Vec::with_capacity(times.len());
        for (i, (&time, transform)) in times.iter().zip(transforms).enumerate() {
            if !time.is_finite() {
                return Err(MotionError::NotFinite(format!("time {i}")));
            }
            if !transform.is_finite() {
                return Err(MotionError::NotFinite(format!("transform {i}")));
            }
            let mut key = Key::new(i, time, transform)?;
            if let Some(last) = keys.last() {
                if time <= last.time {
                    return Err(MotionError::Order { index: i, time });
                }
                // Of both quaternions of a rotation the nearer one; of mirrors, whose axis may be any, the first key's.
                if last.rotation.dot(key.rotation) < 0.0 {
                    key.rotation = -key.rotation;
                }
                if (last.scale * key.scale).min_element() <= 0.0 {
                    return Err(MotionError::Scale(i - 1));
                }
            }
            keys.push(key);
        }
        Ok(Self { keys, interpolation, ..Self::default() })
    }

    /// A steady motion.
    ///
    /// # Errors
    ///
    /// [`MotionError`], when a number is not finite or the axis of a spin has no length.
    pub fn steady(steady: Steady) -> Result<Self, MotionError> {
        Self::default().with_steady(steady)
    }

    /// Returns the motion of a body that moves steadily in the frame that is moved.
    ///
    /// # Errors
    ///
    /// As those of [`Self::steady`].
    pub fn with_steady(mut self, mut steady: Steady) -> Result<Self, MotionError> {
        let Steady { velocity, axis, rate, about } = steady;
        let vectors = [("the velocity", velocity), ("the axis", axis), ("the point", about)];
        for (what, vector) in vectors {
            if !vector.is_finite() {
                return Err(MotionError::NotFinite(what.to_owned()));
            }
        }
        if !rate.is_finite() {
            return Err(MotionError::NotFinite("the spin's rate".to_owned()));
        }
        if rate != 0.0 {
            steady.axis = axis.try_normalize().ok_or(MotionError::Axis)?;
        }
        self.steady = Some(steady);
        Ok(self)
    }

    /// The motion of what `inner` places in the frame that moves.
    #[must_use]
    pub fn then_inner(&self, inner: &Transform) -> Self {
        Self { inner: self.inner.then_inner(inner), ..self.clone() }
    }

    /// The motion of what hangs on this by `links`, the outermost first.
    #[must_use]
    pub fn then_links(&self, links: &[Link]) -> Self {
        let mut all = self.clone();
        all.links.push(Link::Fixed(self.inner));
        all.links.extend_from_slice(links);
        Self { inner: Transform::IDENTITY, ..all }
    }

    /// Span of time in which its frames have keys (s), where they have any.
    #[must_use]
    pub fn played_span(&self) -> Option<[f64; 2]> {
        let times = || self.links.iter().flat_map(Link::times);
        Some([times().reduce(f64::min)?, times().reduce(f64::max)?])
    }

    /// The transform at `time` (s).
    #[must_use]
    pub fn at(&self, time: f64) -> Transform {
        let hung = |inner: Transform, link: &Link| link.at(time).then_inner(&inner);
        let inner = self.links.iter().rev().fold(self.inner, hung);
        let inner = match &self.steady {
            Some(steady) => steady.at(time).then_inner(&inner),
            None => inner,
        };
        if self.keys.is_empty() { inner } else { self.key_at(time).transform().then_inner(&inner) }
    }

    /// Span of time in which it moves (s): infinite for a steady motion.
    #[must_use]
    pub fn span(&self) -> [f64; 2] {
        let is_steady = self.steady.is_some_and(|steady| steady.moves());
        let keys = self.keys.first().zip(self.keys.last());
        let keys = keys.map(|(first, last)| [first.time, last.time]);
        let spans = keys.into_iter().chain(self.played_span()).filter(|_| !is_steady);
        let joined = spans.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
        joined.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    }

    /// True if anything differs at two times of `exposure` (s, first and last).
    #[must_use]
    pub fn moves_within(&self, [open, close]: [f64; 2]) -> bool {
        let overlaps = |a: &Key, b: &Key| a.time < close && b.time > open;
        open < close
            && (self.steady.is_some_and(|steady| steady.moves())
                || self.keys.windows(2).any(|k| overlaps(&k[0], &k[1]) && !k[0].is_at(&k[1]))
                || (self.interpolation == Interpolation::Cubic && self.keys.len() > 2)
                || self.links.iter().any(|link| link.moves_within([open, close])))
    }

    /// Bytes of its keys and of the frames that it hangs on, beside the motion itself.
    #[must_use]
    pub fn heap_bytes(&self) -> usize {
        let links: usize = self.links.iter().map(Link::heap_bytes).sum();
        size_of_val(&self.keys[..]) + links
    }

    /// A bound of the factor by which any length is stretched at any time.
    #[must_use]
    pub fn stretch(&self) -> f64 {
        let [x, y, z] =
            [self.inner.linear.x_axis, self.inner.linear.y_axis, self.inner.linear.z_axis];
        let inner = DVec3::new(x.length(), y.length(), z.length()).length();
        let links: f64 = self.links.iter().map(Link::stretch).product();
        inner * links * self.keys.iter().map(Key::stretch).reduce(f64::max).unwrap_or(1.0)
    }

    /// True if directions of the body change between two times of `exposure` (s, first and last):
    /// if it turns or is stretched, rather than only moves along.
    #[must_use]
    pub fn turns_within(&self, [open, close]: [f64; 2]) -> bool {
        let overlaps = |a: &Key, b: &Key| a.time < close && b.time > open;
        let differ = |a: &Key, b: &Key| a.rotation != b.rotation || a.scale != b.scale;
        open < close
            && (self.steady.is_some_and(|steady| steady.rate != 0.0)
                || self.keys.windows(2).any(|k| overlaps(&k[0], &k[1]) && differ(&k[0], &k[1]))
                || self.links.iter().any(|link| link.turns_within([open, close])))
    }

    /// A box (m) around all places of the box `local` between the times of `exposure` (s, first and last).
    #[must_use]
    pub fn swept(&self, local: Bounds, exposure: [f64; 2]) -> Bounds {
        if local.is_empty() {
            return Bounds::EMPTY;
        }
        self.sweep(local, exposure).bounds_of(&local.corners())
    }

    /// The places between the times of `exposure` (s, first and last) of what is in the box `local`.
    #[must_use]
    pub fn sweep(&self, local: Bounds, [open, close]: [f64; 2]) -> Sweep {
        let mut sweep = Sweep { places: Vec::new() };
        let mut times = vec![open];
        let keys = self.keys.iter().map(|key| key.time);
        let keys = keys.chain(self.links.iter().flat_map(Link::times));
        times.extend(keys.filter(|&t| open < t && t < close));
        times.push(close);
        times.sort_by(f64::total_cmp);
        let reach =
            local.corners().iter().fold(0.0f64, |r, &p| r.max(self.inner.point(p).length()));
        for span in times.windows(2) {
            let step = (span[1] - span[0]) / f64::from(STEPS);
            // Each point is within half a step of one of the places looked at.
            let pad = self.speed(reach, [span[0], span[1]]) * step * 0.5;
            let places = (0..=STEPS).map(|i| (self.at(span[0] + step * f64::from(i)), pad));
            sweep.places.extend(places);
        }
        sweep
    }

    /// At most how fast (m/s) any point moves that `inner` brings within `reach` (m) of its frame's origin.
    fn speed(&self, reach: f64, [open, close]: [f64; 2]) -> f64 {
        let outward = |bounds, link: &Link| link.bounds(bounds, [open, close]);
        let [mut reach, mut speed] = self.links.iter().rev().fold([reach, 0.0], outward);
        if let Some(steady) = &self.steady {
            let radius = reach + steady.about.length();
            speed += steady.velocity.length() + steady.rate.abs() * radius;
            let time = open.abs().max(close.abs());
            reach += 2.0 * steady.about.length() + steady.velocity.length() * time;
        }
        let mut fastest: f64 = speed * self.keys.first().map_or(1.0, Key::stretch);
        for (i, pair) in self.keys.windows(2).enumerate() {
            let [a, b] = [pair[0], pair[1]];
            if a.time > close || b.time < open {
                continue;
            }
            let seconds = b.time - a.time;
            let along = self.way(i).fastest();
            let stretch = a.stretch().max(b.stretch());
            let turn = a.rotation.angle_between(b.rotation) / seconds;
            let stretching = (b.scale - a.scale).abs().max_element() / seconds;
            fastest =
                fastest.max(along + turn * stretch * reach + stretching * reach + stretch * speed);
        }
        // Roundings of the above.
        fastest * (1.0 + 1e-9)
    }

    /// The way of the translation from key `i` to the next one.
    fn way(&self, i: usize) -> Way {
        let [a, b] = [&self.keys[i], &self.keys[i + 1]];
        Way {
            length: b.time - a.time,
            across: b.translation - a.translation,
            slopes: hermite::slopes(&KeyTranslations(&self.keys), i, self.interpolation),
        }
    }

    fn key_at(&self, time: f64) -> Key {
        let next = self.keys.partition_point(|key| key.time <= time);
        let Some(i) = next.checked_sub(1) else { return self.keys[0] };
        let a = self.keys[i];
        let Some(&b) = self.keys.get(next) else { return a };
        let seconds = b.time - a.time;
        let s = (time - a.time) / seconds;
        let moved = self.way(i).at(s);
        Key {
            time,
            translation: a.translation,
            low: a.low.lerp(b.low, s) + moved,
            rotation: turned(a.rotation, b.rotation, s),
            scale: a.scale.lerp(b.scale, s),
        }
    }
}

/// Sweep of a body: its places while it moves, step by step.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Places, and how far any point is from there at most until half of the way to the next one (m).
    places: Vec<(Transform, f64)>,
}

impl Sweep {
    /// A box (m) around all places of what is between some points of the body (m, in its frame).
    #[must_use]
    pub fn bounds_of(&self, points: &[DVec3]) -> Bounds {
        let mut swept = Bounds::EMPTY;
        for (place, pad) in &self.places {
            for point in points.iter().map(|&p| place.point(p)) {
                let size = point.abs() * (4.0 * f64::EPSILON);
                swept.include(point - *pad - size);
                swept.include(point + *pad + size);
            }
        }
        swept
    }
}

/// The translations of keys.
struct KeyTranslations<'a>(&'a [Key]);

impl Points for KeyTranslations<'_> {
    fn count(&self) -> usize {
        self.0.len()
    }

    fn time(&self, i: usize) -> f64 {
        self.0[i].time
    }

    fn place(&self, i: usize) -> DVec3 {
        self.0[i].translation
    }
}

impl Key {
    fn new(i: usize, time: f64, transform: &Transform) -> Result<Self, MotionError> {
        let axes = transform.linear;
        let lengths = DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
        if lengths.min_element() == 0.0 {
            return Err(MotionError::Scale(i));
        }
        let [x, y, z] = [axes.x_axis / lengths.x, axes.y_axis / lengths.y, axes.z_axis / lengths.z];
        if x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs()) > ORTHOGONAL {
            return Err(MotionError::Shear(i));
        }
        // A mirror is one of the first axis.
        let sign = transform.handedness();
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x * sign, y, z)).normalize();
        let scale = lengths * DVec3::new(sign, 1.0, 1.0);
        let (translation, low) = (transform.translation, transform.translation_low);
        Ok(Self { time, translation, low, rotation, scale })
    }

    fn transform(&self) -> Transform {
        let place = Transform::from_trs(self.translation, self.rotation, self.scale);
        let low = Transform::new(DMat3::IDENTITY, self.low);
        // The sum keeps what rounding takes from it.
        low.then_inner(&place)
    }

    fn stretch(&self) -> f64 {
        self.scale.abs().max_element()
    }

    fn is_at(&self, other: &Self) -> bool {
        Self { time: other.time, ..*self } == *other
    }
}

impl Steady {
    fn moves(&self) -> bool {
        self.velocity != DVec3::ZERO || self.rate != 0.0
    }

    fn at(&self, time: f64) -> Transform {
        let moved = self.velocity * time;
        if self.rate == 0.0 {
            return Transform::new(DMat3::IDENTITY, moved);
        }
        let turn = DMat3::from_axis_angle(self.axis, self.rate * time);
        Transform::new(turn, self.about - turn * self.about + moved)
    }
}

#[cfg(test)]
mod tests;
