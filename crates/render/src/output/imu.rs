//! `imu.csv`: what an inertial unit on the camera reads.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use etendue_camera::Kinematics;
use etendue_files::Transaction;
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::Seconds;
use etendue_scene::Scene;
use etendue_scene::file::ImuSpec;
use etendue_sensor::InertialNoise;

use super::OutputError;

/// Its name.
pub const IMU: &str = "imu.csv";

/// Writes the readings of the unit of `scene`, and gives what a user should know of them. Nothing is written where the
/// scene has no unit.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write(
    files: &Transaction,
    path: &Path,
    scene: &Scene,
    imu: &ImuSpec,
) -> Result<Option<String>, OutputError> {
    let (text, note) = table(scene, imu);
    files.write(path, |file| file.write_all(text.as_bytes()))?;
    Ok(note)
}

/// From when until when there are readings (s, in the scene's clock).
fn span(scene: &Scene, imu: &ImuSpec) -> [f64; 2] {
    let start = scene.render.time();
    let [_, close] = scene.camera.exposure_span();
    let next = scene.render.rate.map_or(close, |rate| 1.0 / rate);
    let given = |time: Option<Seconds>, other: f64| time.map_or(other, |time| time.0);
    let from = given(imu.from, start);
    [from, given(imu.to, start + next)]
}

/// The readings as a table, and what a user should know of them.
fn table(scene: &Scene, imu: &ImuSpec) -> (String, Option<String>) {
    let mut text = String::from("time_s");
    let mut columns = vec!["gyro", "accel"];
    if imu.noise.is_some() {
        columns.extend(["true_gyro", "true_accel", "gyro_bias", "accel_bias"]);
    }
    for name in columns {
        let unit = if name.contains("gyro") { "rad_s" } else { "m_s2" };
        // Writing to a string cannot fail.
        let _ = ["x", "y", "z"].iter().try_for_each(|axis| write!(text, ",{name}_{axis}_{unit}"));
    }
    text.push('\n');
    let mut noise = imu.noise.map(|spec| InertialNoise::new(spec, imu.rate, scene.render.seed));
    let [from, to] = span(scene, imu);
    let numbers = imu.numbers([from, to]);
    let note = numbers.is_empty().then(|| {
        format!(
            "{IMU}: none of {} readings a second falls between {from} s and {to} s; give `render.imu` a higher `rate`, \
             or `from` and `to`",
            imu.rate
        )
    });
    for number in numbers {
        let time = number as f64 / imu.rate;
        let kinematics = scene.camera.kinematics(time - scene.render.time());
        let [gyro, accel] = true_reading(&kinematics, imu);
        let _ = write!(text, "{time}");
        let mut add = |vector: DVec3| {
            // −0 would be read as a sign that means something.
            let _ = vector.to_array().iter().try_for_each(|value| write!(text, ",{}", value + 0.0));
        };
        match &mut noise {
            None => [gyro, accel].into_iter().for_each(add),
            Some(noise) => {
                let error = noise.error(number);
                let [bias, white] = [error.bias, error.white].map(|two| two.map(DVec3::from));
                add(gyro + bias[0] + white[0]);
                add(accel + bias[1] + white[1]);
                [gyro, accel, bias[0], bias[1]].into_iter().for_each(add);
            }
        }
        text.push('\n');
    }
    (text, note)
}

/// The angular velocity (rad/s) and the specific force (m/s²) at the unit, along its axes.
fn true_reading(kinematics: &Kinematics, imu: &ImuSpec) -> [DVec3; 2] {
    let [at, gravity] = [imu.at, imu.gravity].map(DVec3::from);
    kinematics.inertial(imu.convention, at, gravity)
}
