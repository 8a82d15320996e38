//! OpenCV's two models of distortion with their derivatives, fitted to chief rays.

use glam::DVec3;

use super::sights::PixelSight;
use super::solve::{ResidualRow, least_squares};
use crate::Intrinsics;
use crate::distortion::{BrownConrady, DistortionSpec, Fisheye};

/// Directions further than this off the axis (as the cosine) are nothing that tangents can tell.
const WIDEST: f64 = 0.02;

/// A camera matrix and a distortion.
pub(super) type OpencvModel = (Intrinsics, DistortionSpec);

/// The standard model (k1, k2, p1, p2, k3) that comes nearest to `sights` at a `distance` (m), from the
/// intrinsics `start` on.
pub(super) fn standard(
    sights: &[PixelSight],
    distance: f64,
    start: &Intrinsics,
) -> Option<OpencvModel> {
    let seen: Vec<([f64; 2], [f64; 2])> = sights
        .iter()
        .map(|sight| (sight.at(distance), sight.pixel))
        .map(|(d, pixel)| (d.z > WIDEST).then(|| ([d.x / d.z, d.y / d.z], pixel)))
        .collect::<Option<_>>()?;
    let rows = |at: &[f64; 9]| -> Vec<ResidualRow<9>> {
        seen.iter().flat_map(|&(tangents, pixel)| standard_rows(at, tangents, pixel)).collect()
    };
    let [fx, fy] = start.focal;
    let [cx, cy] = start.centre;
    let found = least_squares([fx, fy, cx, cy, 0.0, 0.0, 0.0, 0.0, 0.0], rows)?;
    let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = found;
    let intrinsics = Intrinsics { focal: [fx, fy], centre: [cx, cy], skew: 0.0 };
    let model = BrownConrady { k1, k2, p1, p2, k3, ..BrownConrady::default() };
    Some((intrinsics, DistortionSpec::BrownConrady(model)))
}

/// How far the column and the row of a point are from `pixel`, and their derivatives by fx, fy, cx, cy,
/// k1, k2, p1, p2, k3.
fn standard_rows(at: &[f64; 9], [x, y]: [f64; 2], pixel: [f64; 2]) -> [ResidualRow<9>; 2] {
    let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = *at;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let (across, along_x, along_y) = (2.0 * x * y, r2 + 2.0 * x * x, r2 + 2.0 * y * y);
    let u = x * radial + p1 * across + p2 * along_x;
    let v = y * radial + p1 * along_y + p2 * across;
    let powers = [r2, r2 * r2, r2 * r2 * r2];
    let [a, b, c] = powers.map(|power| fx * x * power);
    let [d, e, f] = powers.map(|power| fy * y * power);
    [
        (fx * u + cx - pixel[0], [u, 0.0, 1.0, 0.0, a, b, fx * across, fx * along_x, c]),
        (fy * v + cy - pixel[1], [0.0, v, 0.0, 1.0, d, e, fy * along_y, fy * across, f]),
    ]
}

/// The fisheye model (k1, k2, k3, k4) that comes nearest.
pub(super) fn fisheye(
    sights: &[PixelSight],
    distance: f64,
    start: &Intrinsics,
) -> Option<OpencvModel> {
    let seen: Vec<(DVec3, [f64; 2])> =
        sights.iter().map(|sight| (sight.at(distance), sight.pixel)).collect();
    let rows = |at: &[f64; 8]| -> Vec<ResidualRow<8>> {
        seen.iter().flat_map(|&(direction, pixel)| fisheye_rows(at, direction, pixel)).collect()
    };
    let [fx, fy] = start.focal;
    let [cx, cy] = start.centre;
    let [fx, fy, cx, cy, k1, k2, k3, k4] =
        least_squares([fx, fy, cx, cy, 0.0, 0.0, 0.0, 0.0], rows)?;
    let intrinsics = Intrinsics { focal: [fx, fy], centre: [cx, cy], skew: 0.0 };
    Some((intrinsics, DistortionSpec::Fisheye(Fisheye { k1, k2, k3, k4 })))
}

/// As [`standard_rows`], by fx, fy, cx, cy, k1, k2, k3, k4.
fn fisheye_rows(at: &[f64; 8], direction: DVec3, pixel: [f64; 2]) -> [ResidualRow<8>; 2] {
    let [fx, fy, cx, cy, k1, k2, k3, k4] = *at;
    let across = direction.x.hypot(direction.y);
    let theta = across.atan2(direction.z);
    let axis = if across > 0.0 { [direction.x / across, direction.y / across] } else { [0.0; 2] };
    let t2 = theta * theta;
    let radius = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
    let powers = [1, 2, 3, 4].map(|power| theta * t2.powi(power));
    let [u, v] = axis.map(|share| share * radius);
    let [a, b, c, d] = powers.map(|power| fx * axis[0] * power);
    let [e, f, g, h] = powers.map(|power| fy * axis[1] * power);
    [
        (fx * u + cx - pixel[0], [u, 0.0, 1.0, 0.0, a, b, c, d]),
        (fy * v + cy - pixel[1], [0.0, v, 0.0, 1.0, e, f, g, h]),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::sights::sights;
    use super::*;
    use crate::{CameraSpec, Projection};
    use etendue_geometry::Bounds;

    /// Rays of a camera by OpenCV's own words, whose inverse is another piece of code: the fit finds the
    /// words.
    #[test]
    fn what_a_camera_was_made_of_is_found() {
        let place = r#""intrinsics": {"fx": 615.2, "fy": 600.8, "cx": 321.4, "cy": 236.1,
            "pixel_origin": "corner"}, "pose": {"from": [9, 2, 3], "look_at": [0, 1, 0]},
            "sensor": {"resolution": [640, 480]}"#;
        let start = Intrinsics { focal: [700.0; 2], centre: [320.0, 240.0], skew: 0.0 };
        type Fit = fn(&[PixelSight], f64, &Intrinsics) -> Option<OpencvModel>;
        let models: [(&str, Fit); 2] = [
            (
                r#"{"type": "brown_conrady", "k1": -0.21, "k2": 0.08, "p1": 0.001, "p2": -0.0007,
                    "k3": -0.02}"#,
                standard,
            ),
            (
                r#"{"type": "fisheye", "k1": 0.05, "k2": -0.012, "k3": 0.003, "k4": -0.0005}"#,
                fisheye,
            ),
        ];
        for (words, fit) in models {
            let json = format!(r#"{{"type": "pinhole", "distortion": {words}, {place}}}"#);
            let spec: CameraSpec = serde_json::from_str(&json).unwrap();
            let camera = spec.build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned())).unwrap();
            let Projection::Pinhole(pinhole) = camera.projection() else { panic!("a pinhole") };
            let (k, found) = fit(&sights(&camera), f64::INFINITY, &start).unwrap();
            let own = pinhole.intrinsics();
            let off = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
            // The inverse leaves some 1e-14 of the slopes, the normal equations square their condition.
            assert!(off(k.focal, own.focal) < 1e-7 && off(k.centre, own.centre) < 1e-7, "{k:?}");
            let expected = pinhole.distortion().unwrap().spec().coefficients();
            for (own, expected) in found.coefficients().iter().zip(expected) {
                assert!((own - expected).abs() < 1e-8, "{own} for {expected}");
            }
        }
    }
}
