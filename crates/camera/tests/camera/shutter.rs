//! Shutters and moving cameras: rays at their times, against closed forms and against cameras that stand still.

use etendue_camera::{
    Camera, CameraMotionSpec, CameraRays, CameraSpec, FilmSamples, Pose, ShutterSpec, Trajectory,
};
use etendue_geometry::{Bounds, RayBatch};
use etendue_spectrum::Bands;
use glam::{DQuat, DVec3};
use serde_json::{Value, json};

fn camera(value: Value) -> Camera {
    let text = value.to_string();
    let spec: CameraSpec = serde_json::from_value(value).unwrap_or_else(|e| panic!("{e}: {text}"));
    spec.build(|| Bounds::EMPTY, &|name: &str| Err(format!("{name}: no files"))).unwrap()
}

fn pinhole(shutter: Value, motion: Value) -> Camera {
    camera(json!({
        "type": "pinhole",
        "intrinsics": { "fx": 300, "fy": 300, "cx": 80, "cy": 60, "pixel_origin": "corner" },
        "pose": { "from": [0, 0, 0], "look_at": [0, 0, -1] },
        "sensor": { "resolution": [160, 120] }, "shutter": shutter, "motion": motion,
    }))
}

/// The column at which the chief rays of a row cross from the left to the right of the edge x = `edge` at z = −2 m.
fn edge_column(camera: &Camera, row: u32, edge: f64) -> f64 {
    let mut rays = RayBatch::default();
    let [mut left, mut right] = [-200.0, 360.0];
    for _ in 0..60 {
        let middle = 0.5 * (left + right);
        camera.rays_through(&[middle], &[f64::from(row) + 0.5], &mut rays);
        let (origin, direction) = (rays.origin(0), rays.direction(0));
        let far = (-2.0 - origin.z) / direction.z;
        *if origin.x + far * direction.x < edge { &mut left } else { &mut right } = middle;
    }
    0.5 * (left + right)
}

#[test]
fn a_rolling_shutter_bends_an_edge_by_the_closed_form_of_each_motion() {
    let (line, exposure, edge, f) = (40e-6, 1e-3, 0.1, 300.0);
    let speed = 20_f64;
    let turn = 400_f64;
    type Column = dyn Fn(f64, f64) -> f64;
    // By time and the slope of the row upwards: the column's slope to the right.
    let [v, w] = [speed, turn.to_radians()];
    let cases: [(&str, [f64; 3], [f64; 3], Box<Column>); 5] = [
        ("aside", [speed, 0.0, 0.0], [0.0; 3], Box::new(move |t, _| (edge - v * t) / 2.0)),
        ("forward", [0.0, 0.0, -speed], [0.0; 3], Box::new(move |t, _| edge / (2.0 - v * t))),
        (
            "pan",
            [0.0; 3],
            [0.0, turn, 0.0],
            Box::new(move |t, _| ((edge / 2.0).atan() + w * t).tan()),
        ),
        (
            "tilt",
            [0.0; 3],
            [turn, 0.0, 0.0],
            Box::new(move |t, y| edge / 2.0 * ((w * t).cos() - y * (w * t).sin())),
        ),
        (
            "roll",
            [0.0; 3],
            [0.0, 0.0, turn],
            Box::new(move |t, y| (edge / 2.0 + y * (w * t).sin()) / (w * t).cos()),
        ),
    ];
    for (name, velocity, angular_velocity, slope) in cases {
        for readout in ["down", "up"] {
            let camera = pinhole(
                json!({ "type": "rolling", "line_time": line, "exposure": exposure, "readout": readout }),
                json!({ "type": "velocity", "velocity": velocity, "angular_velocity": angular_velocity }),
            );
            for row in 0..120 {
                let before = f64::from(if readout == "up" { 119 - row } else { row });
                let time = before * line + 0.5 * exposure;
                let y = (60.0 - (f64::from(row) + 0.5)) / f;
                let expected = 80.0 + f * slope(time, y);
                let found = edge_column(&camera, row, edge);
                // Roundings of the bisection and of f · 10⁻¹⁶.
                assert!(
                    (found - expected).abs() < 1e-9,
                    "{name} {readout} {row}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn rays_at_a_time_are_those_of_a_camera_that_stands_there() {
    let sensor = json!({ "resolution": [60, 40], "pixel_pitch": 20 });
    let kinds = [
        json!({ "type": "pinhole", "fov": 40, "sensor": { "resolution": [60, 40] } }),
        json!({ "type": "orthographic", "height": 2, "sensor": { "resolution": [60, 40] } }),
        json!({ "type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 3, "sensor": sensor }),
        json!({ "type": "real_lens", "front_radius": 60, "rear_radius": -60, "thickness": 5,
                "refractive_index": 1.5, "f_number": 8, "focus_distance": 3, "sensor": sensor }),
        json!({ "type": "chromatic_real_lens", "front_radius": 60, "rear_radius": -60, "thickness": 5,
                "glass": "N-BK7", "f_number": 8, "focus_distance": 3, "sensor": sensor }),
        json!({ "type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
                "microlenses": { "pitch": 0.1 }, "sensor": { "resolution": [60, 40], "pixel_pitch": 10 } }),
    ];
    for mut kind in kinds {
        kind["pose"] = json!({ "from": [1, 2, 3], "look_at": [0, 0, 0] });
        kind["shutter"] = json!({ "type": "rolling", "line_time": "50 us", "exposure": "4 ms" });
        kind["motion"] = json!({ "type": "velocity", "velocity": [3, 1, -2], "angular_velocity": [50, 80, -900] });
        let name = kind["type"].clone();
        let moving = camera(kind).opened(&Bands::Rgb).unwrap();
        let mut samples = FilmSamples::default();
        for k in 0..64_u32 {
            let r = |alpha: f64| (0.5 + alpha * f64::from(k)).fract();
            let place = [60.0 * r(0.8567), 40.0 * r(0.7339)];
            samples.push(place, [r(0.6287), r(0.5386)], r(0.4614));
            let shutter = moving.shutter().unwrap();
            samples.times.push(shutter.moment(place[1].floor() + 0.5, r(0.3953)));
        }
        let mut all = CameraRays::default();
        moving.sample_rays(&samples, &mut all);
        assert!(!all.rays.is_empty(), "{name}");
        for (ray, &sample) in all.sample.iter().enumerate() {
            let i = sample as usize;
            let mut one = FilmSamples::default();
            one.push([samples.columns[i], samples.rows[i]], samples.pupil[i], samples.spectrum[i]);
            let mut still = CameraRays::default();
            moving.standing_at(samples.times[i]).sample_rays(&one, &mut still);
            let apart = (still.rays.origin(0) - all.rays.origin(ray)).length()
                + (still.rays.direction(0) - all.rays.direction(ray)).length();
            // Roundings of places of some metres.
            assert!(apart < 1e-13, "{name}: {apart:e}");
            assert_eq!(still.weight[0], all.weight[ray], "{name}");
        }
    }
}

#[test]
fn points_are_found_in_the_rows_that_see_them() {
    for kind in ["global", "rolling", "global_reset"] {
        for truth_at in ["open", "middle", "close"] {
            let mut shutter = json!({ "type": kind, "exposure": 0.002, "truth_at": truth_at });
            if kind != "global" {
                shutter["line_time"] = json!(30e-6);
            }
            let motion = json!({ "type": "velocity", "velocity": [4, -3, 2], "angular_velocity": [90, 150, -120] });
            let camera = pinhole(shutter, motion);
            for place in [[80.5, 60.5], [3.5, 0.5], [150.5, 119.5], [40.5, 90.5]] {
                let mut rays = RayBatch::default();
                camera.rays_through(&[place[0]], &[place[1]], &mut rays);
                let point = rays.origin(0) + 3.0 * rays.direction(0);
                let found = camera.place_of(point - camera.pose().position).unwrap();
                let apart = (found[0] - place[0]).hypot(found[1] - place[1]);
                // Steps end at moments that are 10⁻¹⁵ s apart; the rest is rounding.
                assert!(apart < 1e-9, "{kind} {truth_at} {place:?}: {found:?}");
            }
        }
    }
}

#[test]
fn moments_fill_the_open_time_evenly() {
    let build =
        |value: Value| serde_json::from_value::<ShutterSpec>(value).unwrap().build(100).unwrap();
    let code = build(json!({ "exposure": 0.008, "code": "11010001" }));
    let list =
        build(json!({ "exposure": 0.008, "open": [[0, 0.002], [0.003, 0.004], [0.007, 0.008]] }));
    for shutter in [&code, &list] {
        assert!((shutter.open_share(0.5) - 0.5).abs() < 1e-15);
        let mut chips = [0; 8];
        for k in 0..4000 {
            let time = shutter.moment(7.5, (f64::from(k) + 0.5) / 4000.0);
            chips[(time / 0.001) as usize] += 1;
        }
        assert_eq!(chips, [1000, 1000, 0, 1000, 0, 0, 0, 1000]);
    }
    let rolling = build(json!({ "type": "rolling", "line_time": 1e-5, "exposure": 0.001 }));
    assert_eq!(rolling.whole_span(), [0.0, 99.0 * 1e-5 + 0.001]);
    let reset = build(json!({ "type": "global_reset", "line_time": 1e-5, "exposure": 0.001 }));
    // The last row is open for 99 lines more.
    assert!((reset.open_share(99.5) - 1.99).abs() < 1e-12);
    assert!((reset.moment(99.5, 0.5) - 0.5 * 1.99e-3).abs() < 1e-15);
}

fn trajectory(value: Value) -> Trajectory {
    serde_json::from_value::<CameraMotionSpec>(value).unwrap().build(Some(Pose::IDENTITY)).unwrap()
}

fn quaternion(axis: DVec3, angle: f64, translation: [f64; 3]) -> Value {
    let rotation = DQuat::from_axis_angle(axis, angle).to_array();
    json!({ "quaternion": rotation, "translation": translation, "maps": "world_from_camera",
            "convention": "opengl" })
}

#[test]
fn derivatives_are_those_of_the_pose() {
    let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
    let keys = json!({ "type": "poses", "translation": "cubic", "times": [0, 0.3, 0.4, 1.1], "poses": [
        quaternion(axis, 0.0, [0.0, 0.0, 0.0]), quaternion(axis, 1.0, [1.0, 2.0, 0.5]),
        quaternion(DVec3::Y, -0.7, [1.5, 1.0, 0.0]), quaternion(DVec3::X, 0.2, [2.0, 0.0, -1.0])] });
    let steady =
        json!({ "type": "velocity", "velocity": [1, 2, 3], "angular_velocity": [40, -100, 700] });
    for motion in [trajectory(keys), trajectory(steady)] {
        for time in [0.01, 0.2, 0.35, 0.41, 0.8, 1.05] {
            let h = 1e-4;
            let [before, here, after] = [time - h, time, time + h].map(|t| motion.kinematics(t));
            let velocity = (after.pose.position - before.pose.position) / (2.0 * h);
            let acceleration =
                (after.pose.position - 2.0 * here.pose.position + before.pose.position) / (h * h);
            let turn = DQuat::from_mat3(&(after.pose.rotation * before.pose.rotation.transpose()));
            let turn = turn.to_scaled_axis() / (2.0 * h);
            // Third derivatives of a few hundred times h²; second differences lose 10⁻¹⁶/h².
            assert!((velocity - here.velocity).length() < 1e-5, "{time}");
            assert!((acceleration - here.acceleration).length() < 1e-5, "{time}");
            assert!((turn - here.angular_velocity).length() < 1e-8, "{time}");
        }
    }
}

#[test]
fn a_cubic_is_exact_for_parabolas_and_whole_turns_are_made() {
    let times = [0.0, 0.2, 0.7, 1.5];
    let place = |t: f64| [t * t, 3.0 - t, 2.0 * t * t - t];
    let poses = times.map(|t| quaternion(DVec3::Y, 0.0, place(t)));
    let motion = trajectory(
        json!({ "type": "poses", "translation": "cubic", "times": times, "poses": poses }),
    );
    for k in 0..=30 {
        let t = 1.5 * f64::from(k) / 30.0;
        let apart = (motion.at(t).position - DVec3::from_array(place(t))).length();
        assert!(apart < 1e-14, "{t}: {apart:e}");
    }
    // 90° and two turns more in a second are 810°/s, forwards and backwards.
    for (turns, rate) in [(2, 810.0_f64), (-1, -270.0)] {
        let poses = [
            quaternion(DVec3::Z, 0.0, [0.0; 3]),
            quaternion(DVec3::Z, 1.570_796_326_794_896_6, [0.0; 3]),
        ];
        let motion = trajectory(
            json!({ "type": "poses", "times": [0, 1], "poses": poses, "revolutions": [turns] }),
        );
        let steady = trajectory(json!({ "type": "velocity", "angular_velocity": [0, 0, rate] }));
        for k in 0..=20 {
            let t = f64::from(k) / 20.0;
            let apart = (motion.at(t).rotation - steady.at(t).rotation).to_cols_array();
            // Roundings of 15 radians.
            assert!(apart.iter().all(|x| x.abs() < 1e-14), "{t}: {apart:?}");
        }
    }
}
