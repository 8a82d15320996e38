//! Where places of a picture look: a lens' chief rays in OpenCV's axes.

use etendue_geometry::RayBatch;
use glam::DVec3;

use crate::Camera;

/// Places on each side of the picture, its edges among them.
const PLACES: u32 = 33;

/// Places in all.
pub(super) const COUNT: usize = (PLACES * PLACES) as usize;

/// A chief ray. Axes are OpenCV's: x right, y down, z forward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PixelSight {
    /// The place in the picture (pixels from the outer corner of the top left pixel).
    pub(super) pixel: [f64; 2],
    /// The point of the ray that is nearest to the entrance pupil's middle, from there (m).
    origin: DVec3,
    direction: DVec3,
}

impl PixelSight {
    /// The direction from the entrance pupil's middle to where the ray is at a `distance` (m).
    pub(super) fn at(&self, distance: f64) -> DVec3 {
        match distance.is_finite() {
            true => (self.origin + self.direction * distance).normalize(),
            false => self.direction,
        }
    }

    /// How far the ray passes from the entrance pupil's middle (m).
    pub(super) fn wander(&self) -> f64 {
        self.origin.length()
    }
}

/// The chief rays of places all over the picture; places that see nothing have none.
pub(super) fn sights(camera: &Camera) -> Vec<PixelSight> {
    let [width, height] = camera.resolution().map(f64::from);
    let share = |i: u32| f64::from(i) / f64::from(PLACES - 1);
    let (mut columns, mut rows) = (Vec::new(), Vec::new());
    for row in 0..PLACES {
        for column in 0..PLACES {
            columns.push(share(column) * width);
            rows.push(share(row) * height);
        }
    }
    // The chief ray of each.
    let mut rays = RayBatch::default();
    camera.rays_through(&columns, &rows, &mut rays);
    // In OpenCV's frame, from the point that is nearest to the camera.
    let pose = camera.pose();
    let to_camera = pose.rotation.transpose();
    let opencv = |v: DVec3| {
        let v = to_camera * v;
        DVec3::new(v.x, -v.y, -v.z)
    };
    let seen = (0..rays.len()).filter(|&i| rays.t_max()[i] >= 0.0);
    let sight = |i: usize| {
        let (origin, direction) = (rays.origin(i) - pose.position, rays.direction(i));
        let nearest = origin - direction * origin.dot(direction);
        PixelSight {
            pixel: [columns[i], rows[i]],
            origin: opencv(nearest),
            direction: opencv(direction),
        }
    };
    seen.map(sight).collect()
}
