//! Share of the light that pixels see by the angle of its chief ray.

use etendue_camera::Camera;
use etendue_geometry::RayBatch;
use etendue_scene::Scene;
use etendue_sensor::Sensor;

use super::BandFilm;

/// The light of `film` as far as the pixels of `sensor` see it, each at the angle of its own chief ray.
pub(super) fn seen(film: BandFilm, scene: &Scene, sensor: &Sensor) -> BandFilm {
    let Some(response) = &sensor.spec().angular_response else { return film };
    let [columns, rows] = sensor.resolution().map(|side| side as usize);
    let middle = [columns, rows].map(|side| side as f64 / 2.0);
    let corner = middle[0].hypot(middle[1]);
    let angles = ChiefAngles::of(&scene.camera, sensor);
    #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
    film.times_by_pixel(columns, |[column, row]| {
        let [x, y] = [column as f64 + 0.5 - middle[0], row as f64 + 0.5 - middle[1]];
        response.at(angles.at([column, row], x.hypot(y)), x.hypot(y) / corner) as f32
    })
}

/// The angle at which chief rays meet the sensor.
enum ChiefAngles<'a> {
    /// From the middle of an exit pupil so many pixels in front of the sensor.
    Pupil(f64),
    /// From infinity.
    Parallel,
    /// As they come from the scene.
    Straight(&'a Camera),
}

impl<'a> ChiefAngles<'a> {
    /// By the paraxial exit pupil of a lens; without a lens light goes straight on.
    fn of(camera: &'a Camera, sensor: &Sensor) -> Self {
        let Some(lens) = camera.lens() else { return Self::Straight(camera) };
        let focused = lens.focused();
        match focused.paraxial().exit_pupil.z {
            Some(z) => Self::Pupil(1e3 * (focused.sensor_z() - z) / sensor.pixel_pitch()),
            None => Self::Parallel,
        }
    }

    /// Degrees, of a pixel that lies so many pixels from the middle.
    fn at(&self, [column, row]: [usize; 2], radius: f64) -> f64 {
        match self {
            Self::Pupil(distance) => (radius / distance.abs()).atan().to_degrees(),
            Self::Parallel => 0.0,
            Self::Straight(camera) => {
                let mut rays = RayBatch::default();
                camera.rays_through(&[column as f64 + 0.5], &[row as f64 + 0.5], &mut rays);
                let forward = camera.pose().forward();
                let direction = rays.direction(0).normalize();
                direction.dot(forward).clamp(-1.0, 1.0).acos().to_degrees()
            }
        }
    }
}
