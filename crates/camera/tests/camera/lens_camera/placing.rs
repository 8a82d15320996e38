//! Tests of where the sensor stands behind a lens, how a camera frames a scene, and what is refused.

use glam::DVec3;

use super::{at_origin, build, chief, direction, origin, sampled, try_build};

#[test]
fn a_tilted_sensor_puts_a_tilted_plane_in_focus() {
    // Scheimpflug: the planes of lens, sensor and object meet in one line, here at y = −f'/tan τ.
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 2, "sensor_distance": 52,
           "sensor_tilt": [6, 0], "sensor": {"resolution": [30, 200], "pixel_pitch": 100}"#,
    );
    let tilt = 6_f64.to_radians();
    for row in [40.0, 100.0, 170.0] {
        let film = (row - 100.0) * 0.1;
        // Turned about x, right-handed: y goes towards +z, away from the lens.
        let (y, s) = (film * tilt.cos(), 52.0 + film * tilt.sin());
        let object = 1.0 / (1.0 / 50.0 - 1.0 / s);
        let focus = DVec3::new(0.0, -y / s * object, -object) * 1e-3;
        let rays = sampled(&camera, [15.0, row], 0, 200);
        assert!(rays.rays.len() > 150);
        for i in 0..rays.rays.len() {
            let (o, d) = (origin(&rays.rays, i), direction(&rays.rays, i));
            let past = (focus - o).cross(d).length();
            assert!(past < 1e-12 * object, "{row}: {past}");
        }
    }
}

#[test]
fn data_end_at_the_image_circle_of_a_shifted_lens_too() {
    // Behind the lens light goes straight: the lens' disk (2 mm) and an aperture (3 mm) 30 mm behind
    // it overlap as seen from the sensor 50 mm behind it up to (2·20 + 3·50)/30 mm off the axis.
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "sensor_distance": 50,
           "aperture": {"shape": "circular", "radius": 2},
           "elements": [{"type": "aperture", "shape": "circular", "radius": 3, "at": 30}],
           "sensor_decentre": [4, 2], "sensor": {"resolution": [100, 70], "pixel_pitch": 200}"#,
    );
    let circle = (2.0 * 20.0 + 3.0 * 50.0) / 30.0;
    let places: Vec<[f64; 2]> =
        (0..7000).map(|i| [f64::from(i % 100) + 0.5, f64::from(i / 100) + 0.5]).collect();
    let rays = chief(&camera, &places);
    let (mut inside, mut outside) = (0, 0);
    for (i, [column, row]) in places.into_iter().enumerate() {
        // Pictures are upright, so the sensor's axes are turned.
        let off_axis = f64::hypot(-(column - 50.0) * 0.2 + 4.0, (row - 35.0) * 0.2 + 2.0);
        let seen = rays.t_max()[i] > 0.0;
        // Edges are found to 0.5 %, and 32 of them are joined by straight lines.
        if off_axis < 0.97 * circle {
            inside += 1;
            assert!(seen, "{column} {row}: {off_axis} mm");
        } else if off_axis > 1.03 * circle {
            outside += 1;
            assert!(!seen, "{column} {row}: {off_axis} mm");
        }
    }
    assert!(inside > 1000 && outside > 1000, "{inside} {outside}");
}

#[test]
fn a_camera_without_a_pose_frames_the_box_and_focuses_on_it() {
    for special in [
        r#""type": "thin_lens", "focal_length": 35, "f_number": 2, "sensor_height": 24"#,
        r#""type": "lens", "lens": "lenses/double-gauss.json", "sensor_height": 24"#,
        r#""type": "lens", "lens": "lenses/fisheye.json", "sensor_height": 10"#,
    ] {
        let camera = build(&format!(r#"{{{special}, "sensor": {{"resolution": [300, 200]}}}}"#));
        let distance = -(camera.pose().rotation.transpose() * -camera.pose().position).z;
        let focus = camera.lens().unwrap().focused().object_distance();
        assert!((focus / distance - 1.0).abs() < 0.01, "{special}: {focus} at {distance}");
        let by_name = camera.opencv();
        assert!(by_name.lens.is_some() && by_name.pixel_pitch_um.is_some());
    }
}

#[test]
fn the_field_of_view_gives_the_size_of_the_pixels() {
    let fisheye = at_origin(
        r#""type": "lens", "lens": "lenses/fisheye.json", "fov": 120, "sensor": {"resolution": [300, 200]}"#,
    );
    let rays = chief(&fisheye, &[[150.0, 0.0], [150.0, 200.0]]);
    for (i, up) in [(0, 1.0), (1, -1.0)] {
        let d = direction(&rays, i);
        let expected = DVec3::new(0.0, up * 60_f64.to_radians().sin(), -0.5);
        // Both chief rays pass within 1e-9 mm of the stop's centre.
        assert!((d - expected).length() < 1e-8, "{d}");
    }
}

#[test]
fn what_makes_no_camera_is_refused_with_its_place() {
    let thin = |keys: &str| try_build(&format!(r#"{{"type": "thin_lens", {keys}}}"#));
    let sensor = r#""sensor": {"resolution": [30, 20], "pixel_pitch": 50}"#;
    for (camera, place, words) in [
        (thin(sensor), "focal_length:", "give this, or `fov`"),
        (thin(&format!(r#""focal_length": 50, {sensor}"#)), "f_number:", "or `aperture`"),
        (thin(r#""focal_length": 50, "f_number": 2"#), "sensor.pixel_pitch:", "`sensor_height`"),
        (
            thin(&format!(r#""focal_length": 50, "f_number": 2, "fov": 30, {sensor}"#)),
            "fov:",
            "both give the size",
        ),
        (
            thin(&format!(r#""focal_length": 50, "f_number": 0, {sensor}"#)),
            "f_number:",
            "must be positive",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "focus_distance": 0.05, {sensor}"#
            )),
            "focus_distance:",
            "front focal point",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "focus_distance": 0.03, {sensor}"#
            )),
            "focus_distance:",
            "no real image",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "focus_distance": 1, "sensor_distance": 51, {sensor}"#
            )),
            "sensor_distance:",
            "remove one",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "aperture": {{"shape": "circular", "radius": 0}}, {sensor}"#
            )),
            ": no light passes the lens",
            "vignetted at element 1",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "elements": [{{"type": "aperture",
                   "shape": "polygon", "blades": 2, "radius": 1, "at": 3}}], {sensor}"#
            )),
            "elements[0]:",
            "3 to 1024",
        ),
        (
            try_build(&format!(
                r#"{{"type": "lens", "lens": {{"elements": [{{"type": "surface", "glass": "N-BK8"}}]}}, {sensor}}}"#
            )),
            "lens.elements[0].glass:",
            "N-BK7",
        ),
        (
            try_build(&format!(r#"{{"type": "lens", "lens": "lenses/none.json", {sensor}}}"#)),
            "lens:",
            "cannot be read",
        ),
        (
            try_build(&format!(
                r#"{{"type": "real_lens", "thickness": 5, "front_radius": 50, "refractive_index": 1.5, {sensor}}}"#
            )),
            ": the lens passes light in all directions",
            "semi_diameter",
        ),
    ] {
        let error = camera.expect_err(words);
        assert!(error.starts_with(place) && error.contains(words), "{error}");
    }
}
