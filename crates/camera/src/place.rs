//! The way back: from a point of the world to the place on the sensor where its chief ray arrives.

use etendue_geometry::RayBatch;
use etendue_geometry::glam::{DVec2, DVec3};

use crate::lens::focused::View;
use crate::{Camera, Projection};

/// Steps of Newton's method; from the paraxial place three or four are enough.
const STEPS: usize = 30;

/// A step of this many pixels ends the search.
const SMALL: f64 = 1e-9;

/// Chief rays that are solved to 10⁻⁹ mm at the stop may leave steps of this many pixels.
const ROUNDING: f64 = 1e-6;

/// Over this many pixels a lens is straight enough for its derivatives.
const NEAR: f64 = 1e-3;

impl Camera {
    /// The place on the sensor (pixels from the corner of the top left one; it may lie outside of the
    /// picture) whose chief ray passes through the point that is `offset` (m, along the world's axes) away
    /// from the camera's position. `None` for what is behind the camera or beyond what its lens shows, and
    /// for a camera of many views, which has no one place.
    #[must_use]
    pub fn place_of(&self, offset: DVec3) -> Option<[f64; 2]> {
        if self.motion().is_some() {
            return self.moving_place_of(offset);
        }
        let pose = self.pose();
        let [x, y, z] = [pose.right(), -pose.up(), pose.forward()].map(|axis| axis.dot(offset));
        // Closed forms where there are any; through a lens, by rays from the paraxial place on.
        let place = match self.projection() {
            Projection::Pinhole(pinhole) => {
                let tangents = match pinhole.distortion() {
                    None if z > 0.0 => [x / z, y / z],
                    None => return None,
                    Some(distortion) => distortion.seen([x, y, z])?,
                };
                pinhole.intrinsics().project(tangents)
            }
            Projection::Orthographic(parallel) => {
                let [cx, cy] = parallel.centre();
                let pixel = parallel.metres_per_pixel();
                [x / pixel + cx, y / pixel + cy]
            }
            Projection::Lens(lens) => {
                let paraxial = match lens.focused().view() {
                    View::Perspective(k) if z > 0.0 => k.project([x / z, y / z]),
                    View::Perspective(_) => return None,
                    View::Parallel { metres_per_pixel, centre: [cx, cy] } => {
                        [x / metres_per_pixel + cx, y / metres_per_pixel + cy]
                    }
                };
                self.place_by_rays(offset, paraxial)?
            }
            Projection::Views(_) => return None,
        };
        place.iter().all(|x| x.is_finite()).then_some(place)
    }

    /// Newton's method over chief rays, from a place that is nearly right.
    fn place_by_rays(&self, offset: DVec3, near: [f64; 2]) -> Option<[f64; 2]> {
        let point = self.pose().position + offset;
        let [width, height] = self.resolution().map(f64::from);
        // What the picture does not show has no chief ray to begin with.
        let mut at = DVec2::from(near).clamp(DVec2::ZERO, DVec2::new(width, height));
        let mut rays = RayBatch::default();
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let columns = [at.x, at.x + NEAR, at.x];
            let rows = [at.y, at.y, at.y + NEAR];
            self.rays_through(&columns, &rows, &mut rays);
            if rays.t_max().iter().any(|&far| far < 0.0) {
                return None;
            }
            let [here, right, down] = [0, 1, 2].map(|i| self.misses_by(&rays, i, point));
            let (by_column, by_row) = ((right? - here?) / NEAR, (down? - here?) / NEAR);
            let miss = here?;
            let area = by_column.perp_dot(by_row);
            if area == 0.0 || !area.is_finite() {
                return None;
            }
            let step = -DVec2::new(miss.perp_dot(by_row), by_column.perp_dot(miss)) / area;
            at += step;
            last = step.abs().max_element();
            if last < SMALL {
                break;
            }
        }
        (last < ROUNDING).then(|| at.to_array())
    }

    /// Distance (m, right and up) at which ray `i` passes `point`, in the plane across the axis.
    fn misses_by(&self, rays: &RayBatch, i: usize, point: DVec3) -> Option<DVec2> {
        let pose = self.pose();
        let (direction, to_point) = (rays.direction(i), point - rays.origin(i));
        let (along, depth) = (direction.dot(pose.forward()), to_point.dot(pose.forward()));
        let offset = direction * (depth / along) - to_point;
        (along > 0.0 && depth > 0.0)
            .then(|| DVec2::new(offset.dot(pose.right()), offset.dot(pose.up())))
    }
}
