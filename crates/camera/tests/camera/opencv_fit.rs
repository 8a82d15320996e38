//! OpenCV's camera fitted to lenses: exact where the lens is a pinhole, and as near as it says elsewhere.

use std::path::{Path, PathBuf};

use etendue_camera::{Camera, CameraSpec, LensAccuracy, OpencvFit};
use etendue_geometry::{Bounds, RayBatch};
use glam::DVec3;

fn camera(json: &str) -> Camera {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let resolve = |name: &str| -> Result<PathBuf, String> { Ok(scenes.join(name)) };
    let spec: CameraSpec = serde_json::from_str(json).unwrap();
    spec.build(|| Bounds::EMPTY, &resolve).unwrap()
}

/// The camera of a fit, read back from the words that a scene has.
fn fitted(fit: &OpencvFit) -> Camera {
    let spec = serde_json::to_string(&fit.camera).unwrap();
    let spec: CameraSpec = serde_json::from_str(&spec).unwrap();
    spec.build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned())).unwrap()
}

fn lens(file: &str, more: &str) -> Camera {
    camera(&format!(
        r#"{{"type": "lens", "lens": "lenses/{file}.json", "focus_distance": "2 m",
            "pose": {{"from": [1, 2, 3], "look_at": [0, 0.5, 0]}}, {more},
            "sensor": {{"resolution": [720, 480]}}}}"#
    ))
}

/// Point (m) on the ray of a place of the picture at a distance from the camera.
fn point(camera: &Camera, [column, row]: [f64; 2], distance: f64) -> Option<DVec3> {
    let mut rays = RayBatch::default();
    camera.rays_through(&[column], &[row], &mut rays);
    let (origin, direction) = (rays.origin(0), rays.direction(0));
    let from = origin - camera.pose().position;
    let nearest = from - direction * from.dot(direction);
    (rays.t_max()[0] >= 0.0).then(|| camera.pose().position + nearest + direction * distance)
}

#[test]
fn an_ideal_lens_is_a_pinhole() {
    let thin = camera(
        r#"{"type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": "1.5 m",
            "sensor_height": 24, "sensor_decentre": [2, -1],
            "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}, "sensor": {"resolution": [300, 200]}}"#,
    );
    let fit = OpencvFit::new(&thin, 0.5).unwrap();
    // Image distance 1/(1/50 − 1/1500) over pixels of 24/200 mm; the axis is 2 mm and 1 mm from the
    // middle of a picture that is upside down on its sensor.
    let focal = 1.0 / (1.0 / 50.0 - 1.0 / 1500.0) / 0.12;
    let expected = [[focal, 0.0, 149.5 + 2.0 / 0.12], [0.0, focal, 99.5 + 1.0 / 0.12]];
    for (own, expected) in fit.k.iter().zip(expected) {
        for (own, expected) in own.iter().zip(expected) {
            // Least squares of a thousand places with 16 digits.
            assert!((own - expected).abs() < 1e-8 * focal, "{:?} for {expected:?}", fit.k);
        }
    }
    assert!(fit.coefficients.iter().all(|c| c.abs() < 1e-8), "{:?}", fit.coefficients);
    assert!(fit.residuals.largest < 1e-8, "{:?}", fit.residuals);
    assert_eq!((fit.model, fit.holds.share), ("brown_conrady", 1.0));
    assert!(fit.holds.pupil_wander < 1e-9 && fit.holds.farthest.is_none(), "{:?}", fit.holds);
    // To as many places as the camera says.
    assert_eq!(fit.residuals.places, 33 * 33);
    let accuracy = LensAccuracy { fit_places: 9, ..LensAccuracy::DEFAULT };
    let few = OpencvFit::new(&thin.with_lens_accuracy(accuracy), 0.5).unwrap();
    assert_eq!(few.residuals.places, 81);
    assert!(few.residuals.largest < 1e-8, "{:?}", few.residuals);
}

/// The camera's own rays, by the inverse of the distortion, against the lens' chief rays: what the fit says
/// of itself is so.
#[test]
fn a_fitted_camera_looks_where_the_lens_does() {
    for (file, more) in [
        ("double-gauss", r#""sensor_height": 24"#),
        ("cooke-triplet", r#""sensor_height": 24, "sensor_decentre": [1, 0.5]"#),
        ("double-gauss", r#""sensor_height": 24, "sensor_tilt": [4, -3]"#),
    ] {
        let full = lens(file, more);
        let fit = OpencvFit::new(&full, 0.5).unwrap();
        let own = fitted(&fit);
        // A tilted sensor needs more terms than the fit has, and it says so.
        let is_tilted = more.contains("tilt");
        assert_eq!(fit.residuals.largest < 0.5, !is_tilted, "{file} {more}: {:?}", fit.residuals);
        assert_eq!(fit.holds.share < 1.0, is_tilted, "{file} {more}: {:?}", fit.holds);
        let mut worst = 0.0_f64;
        for i in 0..=12_u32 {
            for k in 0..=8_u32 {
                let place = [60.0 * f64::from(i), 60.0 * f64::from(k)];
                let there = |camera| point(camera, place, 2.0).unwrap();
                // A pixel covers a slope of one over the focal length.
                worst = worst.max((there(&own) - there(&full)).length() / 2.0 * fit.k[0][0]);
            }
        }
        // The tilted picture's pixels cover up to a tenth more or less than those on its axis.
        assert!(worst < 1.2 * fit.residuals.largest + 1e-9, "{file} {more}: {worst}");
        assert!(worst > 0.3 * fit.residuals.largest, "{file} {more}: {worst}");
    }
}

#[test]
fn parallax_ends_the_region_where_it_holds() {
    let full = lens("double-gauss", r#""sensor_height": 24"#);
    let fit = OpencvFit::new(&full, 0.5).unwrap();
    let own = fitted(&fit);
    let nearest = fit.holds.nearest.unwrap();
    let off = |distance: f64| {
        let mut worst = 0.0_f64;
        for place in [[0.0, 0.0], [720.0, 480.0], [0.0, 240.0], [360.0, 0.0], [360.0, 240.0]] {
            let there = |camera| point(camera, place, distance).unwrap();
            worst = worst.max((there(&own) - there(&full)).length() / distance * fit.k[0][0]);
        }
        worst
    };
    // The tolerance is reached at the corners, where rays stand a tenth oblique on the picture.
    assert!((0.4..0.6).contains(&off(nearest)), "{nearest} m: {}", off(nearest));
    assert!(off(2.0) < off(nearest) && off(0.5 * nearest) > 0.6, "{nearest} m");
}

#[test]
fn a_fisheye_takes_the_fisheye_model() {
    let full = camera(
        r#"{"type": "lens", "lens": "lenses/fisheye.json", "focus_distance": "infinity",
            "sensor_height": 20, "pose": {"from": [0, 0, 0], "look_at": [0, 0, -1]},
            "sensor": {"resolution": [400, 400]}}"#,
    );
    let fit = OpencvFit::new(&full, 0.5).unwrap();
    assert_eq!(fit.model, "fisheye");
    assert_eq!((fit.coefficients.len(), fit.distance), (4, None));
    assert!(fit.residuals.largest < 0.5, "{:?}", fit.residuals);
    assert!(fitted(&fit).lens().is_none());
}

#[test]
fn cameras_that_no_pinhole_stands_for_are_refused() {
    let pinhole =
        camera(r#"{"type": "pinhole", "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}}"#);
    let error = OpencvFit::new(&pinhole, 0.5).unwrap_err();
    assert!(error.to_string().contains("no lens"), "{error}");
    // The stop stands in the rear focal point of the lens before it.
    let telecentric = camera(
        r#"{"type": "thin_lens", "focal_length": 50, "sensor_distance": 80, "sensor_height": 10,
            "elements": [{"at": 50, "type": "aperture", "shape": "circular", "radius": 3, "stop": true}],
            "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}, "sensor": {"resolution": [30, 20]}}"#,
    );
    let error = OpencvFit::new(&telecentric, 0.5).unwrap_err();
    assert!(error.to_string().contains("telecentric"), "{error}");
}
