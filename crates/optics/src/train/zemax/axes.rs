//! Coordinate breaks: the axes that they turn and move, and where a surface stands in them.
//!
//! OpticStudio turns right-handed, by R = Rx Ry Rz from a surface's axes to those before. Our
//! surfaces are round about their own axis, so only where that axis points matters, and two tilts
//! say that.

use glam::{DMat3, DVec3};

use crate::train::Isometry;

/// Tilts this small are the rounding of turns to and back (degrees).
const NO_TILT: f64 = 1e-12;

/// Lengths this small are the same (mm).
const NO_LENGTH: f64 = 1e-12;

/// A coordinate break, in mm and degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Break {
    pub(super) decentre: [f64; 2],
    pub(super) tilt: [f64; 3],
    /// Turned first, in the order z, y, x, and moved then.
    pub(super) turned_first: bool,
}

/// The axes of the next surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes {
    origin: DVec3,
    rotation: DMat3,
}

/// Place of a surface, as a lens file says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SheetPlace {
    pub(super) z: f64,
    pub(super) decentre: [f64; 2],
    pub(super) tilt: [f64; 2],
}

impl Default for Axes {
    fn default() -> Self {
        Self { origin: DVec3::ZERO, rotation: DMat3::IDENTITY }
    }
}

impl Axes {
    pub(super) fn new(origin: DVec3, rotation: DMat3) -> Self {
        Self { origin, rotation }
    }

    pub(super) fn rotation(&self) -> DMat3 {
        self.rotation
    }

    /// The thickness along this axis and the break behind it that lead to other axes.
    pub(super) fn to(&self, next: &Self) -> (f64, Break) {
        let back = self.rotation.transpose();
        let offset = back * (next.origin - self.origin);
        let turn = back * next.rotation;
        // R = Rx(a) Ry(b) Rz(c).
        let [about_x, about_y, about_z] = [
            (-turn.z_axis.y).atan2(turn.z_axis.z),
            turn.z_axis.x.atan2(turn.z_axis.y.hypot(turn.z_axis.z)),
            (-turn.y_axis.x).atan2(turn.x_axis.x),
        ];
        let clean = |value: f64, small: f64| if value.abs() <= small { 0.0 } else { value };
        let tilt = [about_x, about_y, about_z].map(|angle| clean(angle.to_degrees(), NO_TILT));
        let decentre = [offset.x, offset.y].map(|length| clean(length, NO_LENGTH));
        (offset.z, Break { decentre, tilt, turned_first: false })
    }

    pub(super) fn broken(self, by: &Break) -> Self {
        let [x, y, z] = by.tilt.map(f64::to_radians);
        let [x, y, z] =
            [DMat3::from_rotation_x(x), DMat3::from_rotation_y(y), DMat3::from_rotation_z(z)];
        let offset = DVec3::new(by.decentre[0], by.decentre[1], 0.0);
        if by.turned_first {
            let rotation = self.rotation * z * y * x;
            Self { origin: self.origin + rotation * offset, rotation }
        } else {
            Self {
                origin: self.origin + self.rotation * offset,
                rotation: self.rotation * x * y * z,
            }
        }
    }

    pub(super) fn advanced(self, thickness: f64) -> Self {
        Self { origin: self.origin + self.rotation.z_axis * thickness, ..self }
    }

    /// The same as it stands in an unfolded space, in which light that runs against the file's axis runs along +z.
    pub(super) fn unfolded(&self, space: &Isometry, sense: f64) -> Self {
        if *space == Isometry::ONE {
            return *self;
        }
        let flip = DMat3::from_diagonal(DVec3::new(1.0, 1.0, sense));
        let columns = [self.rotation.x_axis, self.rotation.y_axis, self.rotation.z_axis];
        let [x, y, z] = columns.map(|column| space.direction(column));
        Self { origin: space.place(self.origin), rotation: DMat3::from_cols(x, y, z) * flip }
    }

    /// The same moved across its axis (mm).
    pub(super) fn shifted(&self, [x, y]: [f64; 2]) -> Self {
        Self { origin: self.origin + self.rotation * DVec3::new(x, y, 0.0), ..*self }
    }

    /// The axis.
    pub(super) fn axis(&self) -> DVec3 {
        self.rotation.z_axis
    }

    pub(super) fn origin(&self) -> DVec3 {
        self.origin
    }

    /// True if it is turned about its own axis, which two tilts do not say.
    pub(super) fn is_turned(&self) -> bool {
        let [about_x, about_y] = self.placed().tilt.map(f64::to_radians);
        let two = DMat3::from_rotation_x(about_x) * DMat3::from_rotation_y(about_y);
        (two.x_axis - self.rotation.x_axis).length() > 1e-9
    }

    pub(super) fn placed(&self) -> SheetPlace {
        // Rx(a) Ry(b) takes z to (sin b, -sin a cos b, cos a cos b).
        let axis = self.rotation.z_axis;
        let about_x = (-axis.y).atan2(axis.z).to_degrees();
        let about_y = axis.x.atan2(axis.y.hypot(axis.z)).to_degrees();
        let clean = |value: f64, small: f64| if value.abs() <= small { 0.0 } else { value };
        SheetPlace {
            z: self.origin.z,
            decentre: [self.origin.x, self.origin.y].map(|length| clean(length, NO_LENGTH)),
            tilt: [about_x, about_y].map(|angle| clean(angle, NO_TILT)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Frame;

    #[test]
    fn an_axis_is_where_two_tilts_put_it() {
        let by = Break { decentre: [1.0, -2.0], tilt: [20.0, -35.0, 70.0], turned_first: false };
        let placed = Axes::default().advanced(5.0).broken(&by).placed();
        let frame = Frame::placed(placed.z, placed.decentre, placed.tilt);
        let direct = DMat3::from_rotation_x(20_f64.to_radians())
            * DMat3::from_rotation_y(-35_f64.to_radians());
        assert_eq!(frame.vertex, DVec3::new(1.0, -2.0, 5.0));
        assert!((frame.rotation.z_axis - direct.z_axis).length() < 1e-15);
    }

    #[test]
    fn a_break_and_its_reverse_leave_no_trace() {
        let there = Break { decentre: [0.3, 0.7], tilt: [3.0, 4.0, 5.0], turned_first: false };
        let back = Break { decentre: [-0.3, -0.7], tilt: [-3.0, -4.0, -5.0], turned_first: true };
        let placed = Axes::default().broken(&there).broken(&back).placed();
        assert_eq!((placed.decentre, placed.tilt), ([0.0; 2], [0.0; 2]));
        assert!(placed.z.abs() < 1e-15);
    }
}
