//! Viewpoint: where a camera stands and what it looks at, moved as by hand.

use etendue_camera::{Camera, Projection};
use etendue_geometry::glam::{DQuat, DVec3};
use serde_json::{Value, json};

/// The nearest that a direction of view comes to straight up or down (radians).
const POLE: f64 = 0.02;

/// A place, what is looked at from there, and what is up in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    /// The camera's position (m): its entrance pupil.
    pub from: DVec3,
    /// The point in the middle of the picture (m), about which the camera turns.
    pub look_at: DVec3,
    /// Up in the world, of length 1.
    pub up: DVec3,
    /// The height of the picture (m) where it is looked at, per metre of distance.
    height: f64,
}

impl Viewpoint {
    /// That of `camera`, which turns about what it sees `distance` (m) away along its axis.
    #[must_use]
    pub fn of(camera: &Camera, distance: f64) -> Self {
        let pose = camera.pose();
        let distance = if distance.is_finite() && distance > 0.0 { distance } else { 1.0 };
        let rows = f64::from(camera.resolution()[1]);
        let height = match (camera.pixel_extent(), camera.projection()) {
            (Some(etendue_camera::PixelExtent::Angle(angle)), _) => angle * rows,
            (Some(etendue_camera::PixelExtent::Width(width)), _) => width * rows / distance,
            (None, Projection::Pinhole(_)) => 2.0,
            (None, _) => 1.0,
        };
        Self {
            from: pose.position,
            look_at: pose.position + pose.forward() * distance,
            up: upright(pose.up()),
            height,
        }
    }

    /// From the camera to what it looks at (m).
    fn sight(&self) -> DVec3 {
        self.look_at - self.from
    }

    fn right(&self) -> DVec3 {
        self.sight().cross(self.up).try_normalize().unwrap_or(DVec3::X)
    }

    /// Turned about what is looked at, as if the scene were dragged by `angles` (radians) to the right and
    /// down.
    #[must_use]
    pub fn orbited(&self, angles: [f64; 2]) -> Self {
        Self { from: self.look_at - self.turned(angles), ..*self }
    }

    /// Looking elsewhere from the same place: by `angles` (radians) to the right and down.
    #[must_use]
    pub fn looking(&self, angles: [f64; 2]) -> Self {
        Self { look_at: self.from + self.turned(angles), ..*self }
    }

    /// The sight after a turn about up and about right, kept off the poles.
    fn turned(&self, [across, down]: [f64; 2]) -> DVec3 {
        let sight = self.sight();
        let from_up = sight.angle_between(self.up);
        let limit = std::f64::consts::PI - POLE;
        // A positive angle about right lifts the sight towards up.
        let pitch = from_up - (from_up + down).clamp(POLE, limit);
        let turn = DQuat::from_axis_angle(self.up, -across);
        turn * (DQuat::from_axis_angle(self.right(), pitch) * sight)
    }

    /// Moved across the sight so that the scene follows a drag by `shift` picture heights to the right and
    /// down.
    #[must_use]
    pub fn panned(&self, [right, down]: [f64; 2]) -> Self {
        let sight = self.sight();
        let up = self.right().cross(sight).try_normalize().unwrap_or(self.up);
        let scale = self.height * sight.length();
        let step = (up * down - self.right() * right) * scale;
        Self { from: self.from + step, look_at: self.look_at + step, ..*self }
    }

    /// At `factor` times the distance from what is looked at.
    #[must_use]
    pub fn approached(&self, factor: f64) -> Self {
        let factor = if factor.is_finite() { factor.clamp(1e-3, 1e3) } else { 1.0 };
        Self { from: self.look_at - self.sight() * factor, ..*self }
    }

    /// Moved with what it looks at: `steps` to the right, up and ahead, each in distances to what is
    /// looked at.
    #[must_use]
    pub fn flown(&self, [right, up, ahead]: [f64; 3]) -> Self {
        let sight = self.sight();
        let step = (self.right() * right + self.up * up) * sight.length() + sight * ahead;
        Self { from: self.from + step, look_at: self.look_at + step, ..*self }
    }

    /// The pose in the words of the scene format.
    #[must_use]
    pub fn pose(&self) -> Value {
        let mut pose = json!({ "from": self.from.to_array(), "look_at": self.look_at.to_array() });
        if self.up != DVec3::Y {
            pose["up"] = json!(self.up.to_array());
        }
        pose
    }
}

/// The axis of the world that is nearest to `up`.
fn upright(up: DVec3) -> DVec3 {
    let axes = [DVec3::Y, DVec3::Z, DVec3::X, -DVec3::Y, -DVec3::Z, -DVec3::X];
    // +Y is up in scenes, unless the camera all but denies it.
    if up.dot(DVec3::Y) > 0.1 {
        return DVec3::Y;
    }
    axes.into_iter().max_by(|a, b| a.dot(up).total_cmp(&b.dot(up))).unwrap_or(DVec3::Y)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn front() -> Viewpoint {
        Viewpoint {
            from: DVec3::new(0.0, 0.0, 3.0),
            look_at: DVec3::ZERO,
            up: DVec3::Y,
            height: 0.5,
        }
    }

    fn near(a: DVec3, b: DVec3) -> bool {
        // Some roundings of numbers up to 3.
        (a - b).length() < 1e-14
    }

    #[test]
    fn a_quarter_turn_ends_at_the_side() {
        // Dragged to the right, the scene shows its left side.
        let side = front().orbited([FRAC_PI_2, 0.0]);
        assert!(near(side.from, DVec3::new(-3.0, 0.0, 0.0)), "{side:?}");
        assert!(near(side.orbited([-FRAC_PI_2, 0.0]).from, front().from));
    }

    #[test]
    fn nobody_turns_over_the_pole() {
        let above = front().orbited([0.0, 10.0]);
        let height = above.from.y / 3.0;
        assert!((height - POLE.cos()).abs() < 1e-12, "dragged down, seen from above: {above:?}");
        assert!((above.orbited([0.0, -10.0]).from.y / 3.0 + POLE.cos()).abs() < 1e-12);
    }

    #[test]
    fn a_pan_moves_by_heights_of_the_picture() {
        let panned = front().panned([1.0, 1.0]);
        // A picture is 0.5 m high per metre, and 3 m are away.
        assert!(near(panned.look_at, DVec3::new(-1.5, 1.5, 0.0)), "{panned:?}");
        assert!(near(panned.from - panned.look_at, front().from));
    }

    #[test]
    fn steps_ahead_and_back_meet() {
        let there = front().flown([0.1, 0.2, 0.5]);
        assert!(near(there.from, DVec3::new(0.3, 0.6, 1.5)), "{there:?}");
        assert!(near(front().approached(0.5).from, DVec3::new(0.0, 0.0, 1.5)));
        assert!(near(front().looking([FRAC_PI_2, 0.0]).look_at, DVec3::new(3.0, 0.0, 3.0)));
    }
}
