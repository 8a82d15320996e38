//! Coordinate breaks: the axes that they turn and move, and where a surface stands in them.
//!
//! OpticStudio turns right-handed, by R = Rx Ry Rz from a surface's axes to those before. Our
//! surfaces are round about their own axis, so only where that axis points matters, and two tilts
//! say that.

use glam::{DMat3, DVec3};

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

/// Where a surface stands, as a lens file says it.
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
