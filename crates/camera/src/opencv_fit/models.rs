//! OpenCV's two models of distortion with their derivatives, fitted to chief rays.
//!
//! Least squares: Gauss and Newton's method for a handful of parameters.
//!
//! Where places of a picture look: a lens' chief rays in OpenCV's axes.

use glam::DVec3;

use crate::distortion::{BrownConrady, DistortionSpec, Fisheye};
use crate::{Camera, Intrinsics, LensAccuracy, LensCamera};
use etendue_geometry::RayBatch;

/// Directions further than this off the axis (as the cosine) are nothing that tangents can tell.
const WIDEST: f64 = 0.02;

/// A camera matrix and a distortion.
pub(super) struct OpencvModel {
    pub(super) intrinsics: Intrinsics,
    pub(super) distortion: DistortionSpec,
}

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
    Some(OpencvModel { intrinsics, distortion: DistortionSpec::BrownConrady(model) })
}

/// Residuals of the column and the row of a point against `pixel`, and their derivatives by fx, fy,
/// cx, cy, k1, k2, p1, p2, k3.
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
    let distortion = DistortionSpec::Fisheye(Fisheye { k1, k2, k3, k4 });
    Some(OpencvModel { intrinsics, distortion })
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

/// Steps after which no better parameters are looked for. Not a setting: from the paraxial camera a few are enough.
const MOST_STEPS: usize = 50;

/// Steps that change the sum of squares by less than this share have arrived.
const ENOUGH: f64 = 1e-14;

/// Residual of a model at one place (pixels), and its derivatives by the model's parameters.
pub(super) type ResidualRow<const N: usize> = (f64, [f64; N]);

/// The parameters from `start` on at which the squares of all `rows` have the least sum; `None` when
/// they do not tell the parameters apart.
pub(super) fn least_squares<const N: usize>(
    start: [f64; N],
    rows: impl Fn(&[f64; N]) -> Vec<ResidualRow<N>>,
) -> Option<[f64; N]> {
    let mut at = start;
    let mut here = rows(&at);
    let mut sum = sum_of_squares(&here);
    for _ in 0..MOST_STEPS {
        let step = step(&here)?;
        // Where a whole step is too far, the half of it may do.
        let tried = (0..20).find_map(|halvings| {
            let share = 0.5_f64.powi(halvings);
            let next: [f64; N] = std::array::from_fn(|i| at[i] - share * step[i]);
            let there = rows(&next);
            let other = sum_of_squares(&there);
            (other <= sum).then_some((next, there, other))
        });
        let Some((next, there, other)) = tried else { break };
        let gained = sum - other;
        (at, here, sum) = (next, there, other);
        if gained <= ENOUGH * sum {
            break;
        }
    }
    at.iter().all(|x| x.is_finite()).then_some(at)
}

fn sum_of_squares<const N: usize>(rows: &[ResidualRow<N>]) -> f64 {
    rows.iter().map(|(off, _)| off * off).sum()
}

/// The solution of the normal equations, by Cholesky's factors of a matrix with a diagonal of 1.
fn step<const N: usize>(rows: &[ResidualRow<N>]) -> Option<[f64; N]> {
    let mut matrix = [[0.0; N]; N];
    let mut right = [0.0; N];
    for (off, by) in rows {
        for i in 0..N {
            right[i] += by[i] * off;
            for k in 0..=i {
                matrix[i][k] += by[i] * by[k];
            }
        }
    }
    let scale: [f64; N] = std::array::from_fn(|i| matrix[i][i].sqrt());
    for i in 0..N {
        right[i] /= scale[i];
        for k in 0..=i {
            matrix[i][k] /= scale[i] * scale[k];
        }
    }
    for i in 0..N {
        for k in 0..=i {
            let known: f64 = (0..k).map(|j| matrix[i][j] * matrix[k][j]).sum();
            let rest = matrix[i][k] - known;
            matrix[i][k] = if i == k { rest.sqrt() } else { rest / matrix[k][k] };
        }
        // A parameter that the others stand for has nothing left of its own.
        if matrix[i][i].is_nan() || matrix[i][i] < 1e-7 {
            return None;
        }
    }
    for i in 0..N {
        let known: f64 = (0..i).map(|j| matrix[i][j] * right[j]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|j| matrix[j][i] * right[j]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    Some(std::array::from_fn(|i| right[i] / scale[i]))
}

/// Places on each side of the picture, its edges among them.
pub(super) fn places_a_side(camera: &Camera) -> u32 {
    camera.lens().map_or(LensAccuracy::DEFAULT, LensCamera::accuracy).fit_places
}

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

    /// Distance at which the ray passes the entrance pupil's middle (m).
    pub(super) fn wander(&self) -> f64 {
        self.origin.length()
    }
}

/// The chief rays of places all over the picture; places that see nothing have none.
pub(super) fn sights(camera: &Camera) -> Vec<PixelSight> {
    let [width, height] = camera.resolution().map(f64::from);
    let across = places_a_side(camera);
    let share = |i: u32| f64::from(i) / f64::from(across - 1);
    let (mut columns, mut rows) = (Vec::new(), Vec::new());
    for row in 0..across {
        for column in 0..across {
            columns.push(share(column) * width);
            rows.push(share(row) * height);
        }
    }
    // The chief ray of each.
    let mut rays = RayBatch::default();
    let camera = camera.standing();
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

#[cfg(test)]
mod tests {
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
            let found = fit(&sights(&camera), f64::INFINITY, &start).unwrap();
            let OpencvModel { intrinsics: k, distortion: found } = found;
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

    #[test]
    fn a_line_through_points_is_that_of_the_closed_form() {
        let points = [[0.0, 1.0], [1.0, 3.5], [2.0, 4.0], [3.0, 7.5]];
        let rows = |&[a, b]: &[f64; 2]| points.map(|[x, y]| (a + b * x - y, [1.0, x])).to_vec();
        let [a, b] = least_squares([10.0, -3.0], rows).unwrap();
        // b = Σ (x − x̄)(y − ȳ) / Σ (x − x̄)² = 10/5, a = ȳ − b x̄ = 4 − 3.
        assert!((a - 1.0).abs() < 1e-12 && (b - 2.0).abs() < 1e-12, "{a} {b}");
    }

    #[test]
    fn a_bent_model_is_found_from_afar() {
        let rows = |&[a, b]: &[f64; 2]| -> Vec<ResidualRow<2>> {
            let row = |i: u32| {
                let x = f64::from(i) / 10.0;
                let model = a * (b * x).exp();
                (model - 2.0 * (-1.3 * x).exp(), [(b * x).exp(), x * model])
            };
            (0..20).map(row).collect()
        };
        let [a, b] = least_squares([1.0, 0.0], rows).unwrap();
        assert!((a - 2.0).abs() < 1e-10 && (b + 1.3).abs() < 1e-10, "{a} {b}");
    }

    #[test]
    fn parameters_that_cannot_be_told_apart_are_none() {
        let rows = |&[a, b]: &[f64; 2]| vec![(a + b - 1.0, [1.0, 1.0]), (a + b - 2.0, [1.0, 1.0])];
        assert_eq!(least_squares([0.0, 0.0], rows), None);
    }
}
