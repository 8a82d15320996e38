//! Cameras with a lens, from what a scene writes to the rays in the world.

mod placing; // where the sensor and the whole camera stand, and what is refused
mod wavelengths; // bands, filters and losses

use std::f64::consts::PI;

use etendue_camera::{Camera, CameraRays, CameraSpec, FilmSamples};
use etendue_geometry::{Bounds, RayBatch};
use etendue_spectrum::Bands;
use glam::DVec3;

fn try_build(json: &str) -> Result<Camera, String> {
    let spec: CameraSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
    let presets = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes");
    let resolve = |name: &str| Ok(std::path::Path::new(presets).join(name));
    let frame = || Bounds { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    spec.build(frame, &resolve).map_err(|e| e.to_string())
}

fn build(json: &str) -> Camera {
    try_build(json).unwrap_or_else(|e| panic!("{e}"))
}

/// A camera at the origin that looks along −z: `{` and what is special about it are put in front.
fn at_origin(special: &str) -> Camera {
    let camera =
        build(&format!(r#"{{{special}, "pose": {{"from": [0, 0, 0], "look_at": [0, 0, -1]}}}}"#));
    camera.opened(&Bands::Rgb).unwrap()
}

fn chief(camera: &Camera, places: &[[f64; 2]]) -> RayBatch {
    let mut rays = RayBatch::default();
    let [columns, rows] = [0, 1].map(|k| places.iter().map(|p| p[k]).collect::<Vec<f64>>());
    camera.rays_through(&columns, &rows, &mut rays);
    rays
}

fn origin(rays: &RayBatch, i: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| rays.origins()[k][i]))
}

fn direction(rays: &RayBatch, i: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| rays.directions()[k][i]))
}

/// `count` rays from one place of the sensor, spread over the pupil by the R2 sequence and over wavelengths by the golden
/// section.
fn sampled(camera: &Camera, place: [f64; 2], group: usize, count: u32) -> CameraRays {
    let mut samples = FilmSamples { group, ..FilmSamples::default() };
    for i in 0..count {
        let unit = [0.754_877_666_246_693, 0.569_840_290_998_053, 0.618_033_988_749_895];
        let [u, v, w] = unit.map(|step: f64| (0.5 + step * f64::from(i)).fract());
        samples.push(place, [u, v], w);
    }
    let mut rays = CameraRays::default();
    camera.sample_rays(&samples, &mut rays);
    rays
}

fn mean_weight(rays: &CameraRays, count: u32) -> f64 {
    rays.weight.iter().sum::<f64>() / f64::from(count)
}

const THIN: &str = r#""type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 2,
    "sensor": {"resolution": [300, 200], "pixel_pitch": 120}"#;

#[test]
fn a_thin_lens_is_registered_with_the_pinhole_of_its_field() {
    let thin = at_origin(THIN);
    let k = thin.opencv().k.unwrap();
    // The image of 2 m lies 50·2000/1950 mm behind the lens.
    let focal = 50.0 * 2000.0 / 1950.0 / 0.12;
    assert!((k[1][1] / focal - 1.0).abs() < 1e-12, "{k:?}");
    let fov = 2.0 * (100.0 / focal).atan().to_degrees();
    let pinhole = at_origin(&format!(
        r#""type": "pinhole", "fov": {fov}, "sensor": {{"resolution": [300, 200]}}"#
    ));
    let by_fov = at_origin(&format!(
        r#""type": "thin_lens", "fov": {fov}, "f_number": 2, "focus_distance": 2,
           "sensor": {{"resolution": [300, 200], "pixel_pitch": 120}}"#
    ));
    let places = [[150.0, 100.0], [0.0, 0.0], [300.0, 0.0], [0.0, 200.0], [299.5, 171.3]];
    let [a, b, c] = [&thin, &pinhole, &by_fov].map(|camera| chief(camera, &places));
    for i in 0..places.len() {
        // Newton stops within 1e-11 mm of the stop's centre, 51 mm away.
        assert!((direction(&a, i) - direction(&b, i)).length() < 1e-12, "{i}");
        assert!((direction(&c, i) - direction(&b, i)).length() < 1e-12, "{i}");
        assert!(origin(&a, i).length() < 1e-14 && a.t_min()[i] < 1e-14, "{i}");
    }
    assert!(direction(&a, 2).x > 0.0 && direction(&a, 2).y > 0.0, "pictures are upright");
}

#[test]
fn the_blur_of_a_thin_lens_camera_is_the_formula_at_ten_distances() {
    // At distance d all rays of a point in focus at s are in a disk of diameter D |d − s|/s around
    // the chief ray: similar triangles over the pupil D.
    let camera = at_origin(THIN);
    let (pupil, focus) = (0.025, 2.0);
    for place in [[150.0, 100.0], [20.0, 190.0]] {
        let centre = direction(&chief(&camera, &[place]), 0);
        let rays = sampled(&camera, place, 0, 4096);
        for distance in [0.3, 0.5, 0.9, 1.4, 1.9, 2.0, 2.2, 3.0, 8.0, 100.0] {
            let on_axis = centre * (distance / -centre.z);
            let mut widest = 0.0_f64;
            for i in 0..rays.rays.len() {
                let (o, d) = (origin(&rays.rays, i), direction(&rays.rays, i));
                let there = o + d * ((distance + o.z) / -d.z);
                widest = widest.max(2.0 * (there - on_axis).length());
            }
            let formula = pupil * (distance - focus).abs() / focus;
            // 4096 points leave the outermost 1/4096 of the disk's area free: 1e-4 of its radius,
            // more along the rim's own unevenness; rays are exact.
            let error = widest - formula;
            assert!(
                error < 1e-12 + 1e-9 * formula && error > -2e-3 * formula - 1e-12,
                "{distance}"
            );
        }
    }
}

#[test]
fn no_ray_of_a_thin_lens_is_lost_at_its_rim() {
    for special in ["", r#", "sensor_tilt": [5, -3], "sensor_decentre": [4, 1]"#] {
        let camera = at_origin(&format!("{THIN}{special}"));
        for place in [[150.0, 100.0], [0.0, 0.0], [299.5, 12.25]] {
            let rays = sampled(&camera, place, 0, 10_000);
            assert_eq!(
                (rays.statuses.exited, rays.statuses.total()),
                (10_000, 10_000),
                "{special}"
            );
            assert_eq!(rays.rays.len(), 10_000);
        }
    }
}

#[test]
fn light_falls_off_with_the_fourth_power_of_the_cosine() {
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 32, "sensor_distance": 50,
           "sensor": {"resolution": [300, 200], "pixel_pitch": 240}"#,
    );
    const COUNT: u32 = 20_000;
    let on_axis = mean_weight(&sampled(&camera, [150.0, 100.0], 0, COUNT), COUNT);
    // Weights differ by (D/2f)² = 2.4e-4 over the disk, which 20 000 places even out.
    assert!((on_axis - 1.0).abs() < 1e-6, "{on_axis}");
    for [column, row] in [[220.0, 100.0], [150.0, 0.0], [290.0, 30.0], [0.0, 0.0]] {
        let tangent = f64::hypot(column - 150.0, row - 100.0) * 0.24 / 50.0;
        let cosine4 = (1.0 + tangent * tangent).powi(-2);
        let rays = sampled(&camera, [column, row], 0, COUNT);
        let measured = mean_weight(&rays, COUNT);
        // f/32 is no point: (D/2f)² = 2.4e-4 of it differs; and the error of counting.
        assert!((measured / cosine4 - 1.0).abs() < 2e-3, "{column} {row}: {measured} {cosine4}");
    }
}

#[test]
fn an_unvignetted_pixel_on_the_axis_weighs_1_and_corners_are_vignetted() {
    let gauss = r#""type": "lens", "lens": "lenses/double-gauss.json", "focus_distance": 1.5,
        "sensor": {"resolution": [360, 240], "pixel_pitch": 100}"#;
    let camera = at_origin(gauss);
    const COUNT: u32 = 50_000;
    let axis = sampled(&camera, [180.0, 120.0], 0, COUNT);
    // As in the thin lens, and 1e-4 for the sum over a grid that is the yardstick.
    assert!((mean_weight(&axis, COUNT) - 1.0).abs() < 1e-3);
    assert!(axis.statuses.exited as f64 > 0.95 * f64::from(COUNT), "{:?}", axis.statuses.losses());
    assert_eq!(axis.statuses.total(), u64::from(COUNT));
    let corner = sampled(&camera, [0.0, 0.0], 0, COUNT);
    let weight = mean_weight(&corner, COUNT);
    let tangent: f64 = 21.6 / 50.0;
    let cosine4 = (1.0 + tangent * tangent).powi(-2);
    assert!(weight < 0.6 * cosine4 && weight > 0.1, "{weight} against {cosine4}");
    // Focused: rays of the axis meet within the lens' spot, 1.2 mm at 1.5 m, and what its colours add:
    // blue is focused 0.05 mm nearer, 0.05 / 50² · 1500 mm of the pupil's radius of 12.4 mm.
    for i in 0..axis.rays.len() {
        let (o, d) = (origin(&axis.rays, i), direction(&axis.rays, i));
        let there = o + d * ((1.5 + o.z) / -d.z);
        assert!(there.truncate().length() < 1.6e-3, "{there}");
    }
    // The camera's origin is the entrance pupil; the front of the lens is before it.
    let rays = chief(&camera, &[[180.0, 120.0], [300.0, 40.0]]);
    assert!(rays.t_min().iter().all(|&t| t > 0.01 && t < 0.05), "{:?}", rays.t_min());
    assert!(origin(&rays, 0).length() < 1e-12);
    assert!(origin(&rays, 1).length() < 2e-3, "pupil aberration moves it a little");
    // Near the axis K is what is traced.
    let k = camera.opencv().k.unwrap();
    let rays = chief(&camera, &[[181.0, 119.0]]);
    let d = direction(&rays, 0);
    assert!((d.x / -d.z * k[0][0] - 1.0).abs() < 1e-4 && (d.y / -d.z * k[1][1] - 1.0).abs() < 1e-4);
}

#[test]
fn a_stop_in_the_rear_focal_plane_keeps_sizes() {
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 40, "sensor_distance": 60,
           "elements": [{"type": "aperture", "shape": "circular", "radius": 2, "at": 40, "stop": true}],
           "sensor": {"resolution": [100, 100], "pixel_pitch": 100}"#,
    );
    let file = camera.opencv();
    assert_eq!(file.k, None);
    // Image distance 60 behind a lens of 40: magnification 1 − 60/40 = −1/2.
    let pixel = file.orthographic.unwrap().metres_per_pixel;
    assert!((pixel - 0.2e-3).abs() < 1e-15, "{pixel}");
    let rays = chief(&camera, &[[50.0, 50.0], [70.0, 40.0]]);
    assert!((direction(&rays, 1) - DVec3::NEG_Z).length() < 1e-12);
    assert!((origin(&rays, 1) - DVec3::new(20.0, 10.0, 0.0) * pixel).length() < 1e-12);
}

#[test]
fn orthographic_pictures_keep_sizes_at_all_distances() {
    let camera =
        at_origin(r#""type": "orthographic", "height": 2, "sensor": {"resolution": [200, 200]}"#);
    let rays = chief(&camera, &[[30.0, 100.0], [130.0, 100.0]]);
    for distance in [0.1, 1.0, 1e3] {
        let apart = origin(&rays, 1) - origin(&rays, 0)
            + (direction(&rays, 1) - direction(&rays, 0)) * distance;
        assert_eq!(apart, DVec3::X, "100 pixels of 2 m / 200");
    }
}

#[test]
fn the_weights_of_a_small_lens_are_its_solid_angle() {
    let camera = at_origin(THIN);
    let image = 50.0 * 2000.0 / 1950.0;
    // π sin²θ of the cone from the axis to the rim of 12.5 mm.
    let exact = PI * 12.5 * 12.5 / (12.5 * 12.5 + image * image);
    let measured = camera.lens().unwrap().solid_angle();
    // A grid of 500 cells across cuts a rim of 1500 cells.
    assert!((measured / exact - 1.0).abs() < 2e-4, "{measured} and {exact}");
}

#[test]
fn points_on_chief_rays_are_placed_where_these_start() {
    let sensor = r#""sensor": {"resolution": [640, 480], "pixel_pitch": "20 um"}"#;
    for special in [
        format!(
            r#""type": "thin_lens", "focal_length": "50 mm", "f_number": 2, "focus_distance": 2, {sensor}"#
        ),
        format!(
            r#""type": "lens", "lens": "lenses/double-gauss.json", "focus_distance": 2, {sensor}"#
        ),
    ] {
        let camera = at_origin(&special);
        let places = [[320.0, 240.0], [100.5, 400.25], [639.0, 1.0]];
        let rays = chief(&camera, &places);
        for (i, place) in places.iter().enumerate() {
            for far in [0.8, 2.0, 70.0] {
                let point = origin(&rays, i) + direction(&rays, i) * far;
                let found = camera.place_of(point).unwrap_or_else(|| panic!("{special} {place:?}"));
                let off = (found[0] - place[0]).hypot(found[1] - place[1]);
                // The stop's centre is met to 1e-9 mm, from 50 mm away, on pixels of 0.02 mm.
                assert!(off < 1e-6, "{off} px: {special} {place:?} {far}");
            }
        }
        assert_eq!(camera.place_of(DVec3::Z), None, "behind: {special}");
    }
}
