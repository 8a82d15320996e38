//! Placement of an element: on the axis, or tilted and decentred.

use glam::{DMat3, DVec3};

use super::rays::{Ray, moved, turned};
use super::real::Real;

/// An element's place in lens coordinates (mm). The element is moved across the axis first and then
/// turned about its own vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The vertex.
    pub vertex: DVec3,
    /// From the element's frame to lens coordinates: about x first, then about the element's y.
    pub rotation: DMat3,
}

impl Frame {
    /// On the axis at `z`.
    #[must_use]
    pub fn on_axis(z: f64) -> Self {
        Self { vertex: DVec3::new(0.0, 0.0, z), rotation: DMat3::IDENTITY }
    }

    /// Moved by `decentre` (mm) across the axis and turned by `tilt` (degrees) about the x and y
    /// axes, right-handed.
    #[must_use]
    pub fn placed(z: f64, decentre: [f64; 2], tilt: [f64; 2]) -> Self {
        let [about_x, about_y] = tilt.map(f64::to_radians);
        Self {
            vertex: DVec3::new(decentre[0], decentre[1], z),
            rotation: DMat3::from_rotation_x(about_x) * DMat3::from_rotation_y(about_y),
        }
    }

    /// True if the element is centred on the axis and square to it.
    #[must_use]
    pub fn is_axial(&self) -> bool {
        self.rotation == DMat3::IDENTITY && self.vertex.x == 0.0 && self.vertex.y == 0.0
    }

    /// A point of the element's frame in lens coordinates.
    #[must_use]
    pub fn point(&self, local: DVec3) -> DVec3 {
        self.vertex + self.rotation * local
    }

    pub(crate) fn enter<T: Real>(&self, ray: Ray<T>) -> Ray<T> {
        let back = self.rotation.transpose();
        let place = moved(ray.position, -self.vertex);
        Ray { position: turned(&back, place), direction: turned(&back, ray.direction) }
    }

    pub(crate) fn leave<T: Real>(&self, ray: Ray<T>) -> Ray<T> {
        let place = turned(&self.rotation, ray.position);
        let direction = turned(&self.rotation, ray.direction);
        Ray { position: moved(place, self.vertex), direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilts_turn_about_the_vertex_and_come_back() {
        let frame = Frame::placed(10.0, [1.0, 2.0], [30.0, -10.0]);
        assert_eq!(frame.point(DVec3::ZERO), DVec3::new(1.0, 2.0, 10.0));
        // A turn about x by a right angle takes +z to −y.
        let quarter = Frame::placed(0.0, [0.0; 2], [90.0, 0.0]);
        assert!((quarter.point(DVec3::Z) + DVec3::Y).length() < 1e-15);
        let ray = Ray { position: [3.0, -1.0, 4.0], direction: [0.6, 0.0, 0.8] };
        let back = frame.leave(frame.enter(ray));
        for axis in 0..3 {
            assert!((back.position[axis] - ray.position[axis]).abs() < 1e-14);
            assert!((back.direction[axis] - ray.direction[axis]).abs() < 1e-15);
        }
        assert!(!frame.is_axial() && Frame::on_axis(3.0).is_axial());
    }
}
