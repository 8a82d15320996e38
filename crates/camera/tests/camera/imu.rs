//! Readings of an inertial unit, against closed forms and against differences of the trajectory.

use etendue_camera::{CameraMotionSpec, Convention, Pose, Trajectory};
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

const GRAVITY: DVec3 = DVec3::new(0.3, -9.806_65, 0.1);

fn trajectory(motion: Value) -> Trajectory {
    serde_json::from_value::<CameraMotionSpec>(motion).unwrap().build(None).unwrap()
}

/// Places on a parabola and a turn at constant speed, of which the acceleration is constant: the cubic between uneven
/// times is the parabola.
fn thrown() -> (Trajectory, DVec3, DVec3) {
    let (acceleration, turn) = (DVec3::new(1.0, -2.0, 3.0), DVec3::new(0.7, 1.1, -0.4));
    let times = [0.0, 0.11, 0.25, 0.31, 0.5];
    let pose = |time: f64| {
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turn * time));
        let at = DVec3::new(4.0, 5.0, -6.0) * time + 0.5 * acceleration * time * time;
        let [x, y, z] = [rotation.x_axis, rotation.y_axis, rotation.z_axis];
        json!({ "matrix": [[x.x, y.x, z.x, at.x], [x.y, y.y, z.y, at.y], [x.z, y.z, z.z, at.z], [0, 0, 0, 1]],
                "maps": "world_from_camera", "convention": "opengl" })
    };
    let poses: Vec<Value> = times.iter().map(|&time| pose(time)).collect();
    let motion = json!({ "type": "poses", "poses": poses, "times": times, "translation": "cubic" });
    (trajectory(motion), acceleration, turn)
}

#[test]
fn readings_of_a_throw_are_the_closed_form() {
    let (trajectory, acceleration, turn) = thrown();
    let at = DVec3::new(0.1, -0.2, 0.3);
    for time in [0.01, 0.2, 0.3, 0.45] {
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turn * time));
        let kinematics = trajectory.kinematics(time);
        let [gyro, accel] = kinematics.inertial(Convention::Opengl, at, GRAVITY);
        // About an axis that turns with it, the angular velocity is the same along both axes.
        let arm = rotation * at;
        let force = acceleration + turn.cross(turn.cross(arm)) - GRAVITY;
        assert!((gyro - rotation.transpose() * turn).length() < 1e-9, "{time}: {gyro}");
        assert!((accel - rotation.transpose() * force).length() < 1e-9, "{time}: {accel}");
        // OpenCV's axes are turned by half a turn about x, and so is where the unit sits.
        let flipped = DVec3::new(1.0, -1.0, -1.0);
        let [theirs, force] = kinematics.inertial(Convention::Opencv, at * flipped, GRAVITY);
        assert!((theirs * flipped - gyro).length() < 1e-15);
        assert!((force * flipped - accel).length() < 1e-14);
    }
}

/// Against differences of the poses: of a cubic exact but for rounding, of a slerp exact.
#[test]
fn readings_are_the_derivatives_of_the_trajectory() {
    let pose = |x: f64, y: f64, turn: f64| json!({ "from": [x, y, 1.0 + x * y], "look_at": [turn, 0.3, -4.0] });
    let poses =
        [pose(0.0, 1.0, 0.0), pose(0.4, 0.8, 0.5), pose(0.5, 1.3, -0.4), pose(-0.2, 1.0, 0.1)];
    for translation in ["linear", "cubic"] {
        let trajectory = trajectory(json!({
            "type": "poses", "poses": poses, "times": [0.0, 0.4, 1.1, 1.5], "translation": translation,
            "revolutions": [0, 1, 0],
        }));
        for time in [0.2, 0.75, 1.3] {
            let step = 1e-2;
            let [before, now, after]: [Pose; 3] =
                [-step, 0.0, step].map(|by| trajectory.at(time + by));
            let [gyro, accel] =
                trajectory.kinematics(time).inertial(Convention::Opengl, DVec3::ZERO, GRAVITY);
            let toward = now.rotation.transpose();
            // Second differences of a cubic are its second derivative: rounding of 1e-16 over 1e-4.
            let acceleration =
                (after.position - 2.0 * now.position + before.position) / (step * step);
            assert!((accel - toward * (acceleration - GRAVITY)).length() < 1e-9, "{time} {accel}");
            let between = DQuat::from_mat3(&(after.rotation * before.rotation.transpose()));
            let turn = between.to_scaled_axis() / (2.0 * step);
            assert!((gyro - toward * turn).length() < 1e-9, "{translation} {time}: {gyro}");
        }
    }
}
