//! Lens distortion as OpenCV models it, undone ray by ray.
//!
//! Both models map the undistorted direction of a point to where it is seen; a ray needs the
//! inverse, which has no closed form. It is found by Newton's method to the last few bits. Where the
//! forward map folds back, two directions are seen at one place and there is no inverse: the fold's
//! field angle is reported instead of a wrong ray.
//!
//! # Sources
//!
//! OpenCV, *Camera Calibration and 3D Reconstruction* (rational and thin-prism terms included) and
//! its *Fisheye camera model* (Kannala and Brandt, "A generic camera model", 2006).

mod brown_conrady;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::brown_conrady::BrownConrady;
use crate::CameraError;

/// Distortion as the scene file writes it; coefficients that are absent are 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum DistortionSpec {
    /// OpenCV's standard model.
    BrownConrady(BrownConrady),
    /// OpenCV's fisheye model.
    Fisheye(Fisheye),
}

/// The angle from the axis θ is seen at the radius θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Fisheye {
    /// Of θ².
    pub k1: f64,
    /// Of θ⁴.
    pub k2: f64,
    /// Of θ⁶.
    pub k3: f64,
    /// Of θ⁸.
    pub k4: f64,
}

/// A distortion with what its inverse needs to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Distortion {
    spec: DistortionSpec,
    /// The largest tangent (Brown–Conrady) or angle (fisheye, radians) that the picture shows.
    limit: f64,
}

impl DistortionSpec {
    /// The coefficients in OpenCV's order.
    #[must_use]
    pub fn coefficients(&self) -> Vec<f64> {
        match self {
            Self::BrownConrady(c) => {
                let all = [c.k1, c.k2, c.p1, c.p2, c.k3, c.k4, c.k5, c.k6, c.s1, c.s2, c.s3, c.s4];
                // OpenCV takes 5, 8 or 12 of them.
                let used = all.iter().rposition(|&x| x != 0.0).map_or(0, |last| last + 1);
                let len = [5, 8, 12].into_iter().find(|&len| used <= len).unwrap_or(12);
                all[..len].to_vec()
            }
            Self::Fisheye(c) => vec![c.k1, c.k2, c.k3, c.k4],
        }
    }

    /// The word behind `type` in the file.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::BrownConrady(_) => "brown_conrady",
            Self::Fisheye(_) => "fisheye",
        }
    }

    /// The distortion, made sure of for a picture whose border is seen at the distorted tangents
    /// `border`.
    ///
    /// # Errors
    ///
    /// When a coefficient is not finite, or the border lies beyond the Brown–Conrady model's fold.
    /// A fisheye's picture may go beyond its circle: there is no ray there.
    pub fn build(&self, border: impl Iterator<Item = [f64; 2]>) -> Result<Distortion, CameraError> {
        if !self.coefficients().iter().all(|c| c.is_finite()) {
            return Err(CameraError::new("distortion", "a coefficient is not finite"));
        }
        let limit = match self {
            Self::BrownConrady(model) => {
                let mut limit = 0.0_f64;
                for point in border {
                    plausible(point)?;
                    let [x, y] = model.track(point).map_err(folded)?;
                    limit = limit.max(x.hypot(y));
                }
                // The corners of the border are its farthest points, so nothing lies beyond.
                limit * (1.0 + 1e-6)
            }
            Self::Fisheye(model) => model.fold(),
        };
        Ok(Distortion { spec: self.clone(), limit })
    }
}

/// The largest tangent of a border for which the model is worth inverting: it is of lenses that see half a
/// space at most, and 1000 is 89.94° from the axis.
const WIDEST: f64 = 1000.0;

/// Refuses a picture that reaches where no lens of the model sees, before anything is inverted there.
fn plausible([x, y]: [f64; 2]) -> Result<(), CameraError> {
    if x.abs().max(y.abs()) <= WIDEST {
        return Ok(());
    }
    let angle = x.hypot(y).atan().to_degrees();
    Err(CameraError::new(
        "distortion",
        format!(
            "the picture reaches {angle:.4}° from the axis, where no lens of this model sees\nhint: check the focal \
             lengths (fx, fy) and the resolution, which are in pixels, or leave out the distortion"
        ),
    ))
}

fn folded(tangent: f64) -> CameraError {
    CameraError::new(
        "distortion",
        format!(
            "the model folds back {:.2}° from the axis, and the picture reaches beyond\nhint: use fewer \
             pixels, or check the coefficients and their order (OpenCV's vector is k1, k2, p1, p2, \
             k3)",
            tangent.atan().to_degrees()
        ),
    )
}

impl Distortion {
    /// The coefficients.
    #[must_use]
    pub fn spec(&self) -> &DistortionSpec {
        &self.spec
    }

    /// Projects the direction (x right, y down, z forward) to distorted tangents.
    #[must_use]
    pub fn distort(&self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        match &self.spec {
            DistortionSpec::BrownConrady(model) => model.distort([x / z, y / z]).0,
            DistortionSpec::Fisheye(model) => {
                let across = x.hypot(y);
                if across == 0.0 {
                    return [0.0; 2];
                }
                let radius = model.radius(across.atan2(z)).0;
                [x / across * radius, y / across * radius]
            }
        }
    }

    /// As [`Self::distort`], of directions up to the farthest that the picture shows, or a fisheye's fold;
    /// `None` of others.
    #[must_use]
    pub fn seen(&self, direction: [f64; 3]) -> Option<[f64; 2]> {
        let [x, y, z] = direction;
        let reaches = match &self.spec {
            // Tangents know nothing of what is behind.
            DistortionSpec::BrownConrady(_) => z > 0.0 && x.hypot(y) <= self.limit * z,
            DistortionSpec::Fisheye(_) => x.hypot(y).atan2(z) <= self.limit,
        };
        reaches.then(|| self.distort(direction))
    }

    /// As [`Self::undistort`], of many: distorted tangents, which stand in the first two arrays, become unit directions,
    /// and zero where nothing is seen.
    pub(crate) fn undistort_all(&self, [x, y, z]: [&mut [f64]; 3]) {
        if let DistortionSpec::BrownConrady(model) = &self.spec {
            brown_conrady::undistort_all(model, self.limit, [x, y, z]);
            return;
        }
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            [*x, *y, *z] = self.undistort([*x, *y]).unwrap_or_default();
        }
    }

    /// The unit direction (x right, y down, z forward) that is seen at distorted tangents; `None`
    /// where nothing is.
    #[must_use]
    pub fn undistort(&self, seen: [f64; 2]) -> Option<[f64; 3]> {
        match &self.spec {
            DistortionSpec::BrownConrady(model) => model.undistort(seen, self.limit),
            DistortionSpec::Fisheye(model) => {
                let radius = seen[0].hypot(seen[1]);
                if radius == 0.0 {
                    return Some([0.0, 0.0, 1.0]);
                }
                let (sin, cos) = model.invert(radius, self.limit)?.sin_cos();
                Some([seen[0] / radius * sin, seen[1] / radius * sin, cos])
            }
        }
    }
}

impl Fisheye {
    /// The radius at which the angle `theta` is seen, and its derivative.
    fn radius(&self, theta: f64) -> (f64, f64) {
        let t2 = theta * theta;
        let series = 1.0 + t2 * (self.k1 + t2 * (self.k2 + t2 * (self.k3 + t2 * self.k4)));
        let slope = 1.0
            + t2 * (3.0 * self.k1
                + t2 * (5.0 * self.k2 + t2 * (7.0 * self.k3 + t2 * 9.0 * self.k4)));
        (theta * series, slope)
    }

    /// The angle (radians) up to which the radius grows, at most half a turn.
    fn fold(&self) -> f64 {
        const STEPS: u32 = 4096;
        let angle = |i: u32| std::f64::consts::PI * f64::from(i) / f64::from(STEPS);
        match (1..=STEPS).find(|&i| self.radius(angle(i)).1 <= 0.0) {
            Some(i) => angle(i - 1),
            None => std::f64::consts::PI,
        }
    }

    /// The angle seen at `radius`; `None` beyond the angle `limit`. Newton's method, kept inside
    /// the shrinking bracket that the growing radius gives.
    fn invert(&self, radius: f64, limit: f64) -> Option<f64> {
        if radius.is_nan() || radius > self.radius(limit).0 {
            return None;
        }
        let (mut low, mut high) = (0.0, limit);
        let mut theta = radius.min(limit);
        for _ in 0..100 {
            let (at, slope) = self.radius(theta);
            if at < radius {
                low = theta;
            } else {
                high = theta;
            }
            let newton = theta + (radius - at) / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - theta).abs() <= f64::EPSILON * theta {
                return Some(next);
            }
            theta = next;
        }
        Some(theta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [[f64; 3]; 5] =
        [[0.0, 0.0, 1.0], [0.3, -0.2, 1.0], [-0.55, 0.4, 1.0], [0.6, 0.55, 1.0], [1.2, -0.9, 2.5]];

    /// fx, fy, cx, cy of the references.
    const K: [f64; 4] = [700.0, 690.5, 310.25, 245.5];

    fn rational() -> DistortionSpec {
        DistortionSpec::BrownConrady(BrownConrady {
            k1: -0.28,
            k2: 0.11,
            p1: 0.0012,
            p2: -0.0008,
            k3: -0.02,
            k4: 0.03,
            k5: -0.01,
            k6: 0.002,
            s1: 0.0015,
            s2: -0.0007,
            s3: 0.0004,
            s4: 0.0009,
        })
    }

    fn fisheye() -> DistortionSpec {
        DistortionSpec::Fisheye(Fisheye { k1: 0.05, k2: -0.012, k3: 0.003, k4: -0.0005 })
    }

    /// Many places at once, of every remainder beside whole blocks, and those where nothing is seen or Newton's method
    /// goes astray: what each gives alone, to the bit.
    #[test]
    fn many_places_give_what_each_gives_alone() {
        let strong = DistortionSpec::BrownConrady(BrownConrady { k1: -0.4, ..Default::default() });
        let steep = DistortionSpec::BrownConrady(BrownConrady { k1: 8.0, ..Default::default() });
        let zero = DistortionSpec::BrownConrady(BrownConrady::default());
        let corner = |x: f64| [[x, 0.75 * x]].into_iter();
        for (spec, widest) in
            [(rational(), 0.6), (strong, 0.45), (steep, 3.0), (zero, 1.0), (fisheye(), 2.0)]
        {
            let model = spec.build(corner(widest)).unwrap();
            for count in [0, 1, 7, 8, 9, 64, 421] {
                let share = |i: usize, step: f64| (2.4 * (i as f64 * step).fract() - 1.2) * widest;
                let seen: Vec<[f64; 2]> = (0..count)
                    .map(|i| [share(i, 0.618_034), share(i, 0.414_214)])
                    .map(|place| if place[0] > 1.19 * widest { [f64::NAN, 0.0] } else { place })
                    .collect();
                let [mut x, mut y] = [0, 1].map(|k| seen.iter().map(|p| p[k]).collect::<Vec<_>>());
                let mut z = vec![f64::NAN; count];
                model.undistort_all([&mut x, &mut y, &mut z]);
                for (i, &place) in seen.iter().enumerate() {
                    let alone = model.undistort(place).unwrap_or_default();
                    assert_eq!([x[i], y[i], z[i]], alone, "{spec:?} at {place:?} of {count}");
                }
            }
        }
    }

    /// Pixels of `POINTS` by OpenCV 5.0's `projectPoints` and `fisheye.projectPoints`.
    const OPENCV: [[[f64; 2]; 5]; 2] = [
        [
            [310.25, 245.5],
            [512.08649671755, 112.95904634883976],
            [-29.726039033969926, 490.1309829796339],
            [664.7440767555156, 566.9484489909362],
            [613.5075947200082, 21.705323849108083],
        ],
        [
            [310.25, 245.5],
            [512.9730158529184, 112.18548338434272],
            [-33.40607427460168, 492.03976029777914],
            [670.1828766917679, 570.9607339181338],
            [617.0159519377478, 18.5479752003412],
        ],
    ];

    #[test]
    fn opencv_sees_the_same() {
        for (spec, expected) in [rational(), fisheye()].into_iter().zip(OPENCV) {
            let model = spec.build(std::iter::empty()).unwrap();
            for (point, pixel) in POINTS.into_iter().zip(expected) {
                let [x, y] = model.distort(point);
                let off = (x * K[0] + K[2] - pixel[0]).hypot(y * K[1] + K[3] - pixel[1]);
                // OpenCV rounds a handful of times in f64 on some 700 px.
                assert!(off < 1e-11, "{point:?}: off by {off} px");
            }
        }
    }

    #[test]
    fn rays_come_back_to_where_opencv_sees_them() {
        for (spec, expected) in [rational(), fisheye()].into_iter().zip(OPENCV) {
            let border = expected.map(|[u, v]| [(u - K[2]) / K[0], (v - K[3]) / K[1]]);
            let model = spec.build(border.into_iter()).unwrap();
            for (point, seen) in POINTS.into_iter().zip(border) {
                let direction = model.undistort(seen).unwrap();
                let length = point.iter().map(|x| x * x).sum::<f64>().sqrt();
                for axis in 0..3 {
                    let off = direction[axis] - point[axis] / length;
                    assert!(off.abs() < 1e-13, "{point:?}: {direction:?}");
                }
            }
        }
    }

    #[test]
    fn every_pixel_of_strong_lenses_comes_back() {
        let barrel = BrownConrady { k1: -0.45, k2: 0.25, k3: -0.06, ..BrownConrady::default() };
        let pincushion = BrownConrady { k1: 0.6, k2: 0.2, p1: 0.01, ..BrownConrady::default() };
        for model in [barrel, pincushion] {
            let spec = DistortionSpec::BrownConrady(model);
            let border = [[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4]];
            let model = spec.build(border.into_iter()).unwrap();
            for i in 0..=40 {
                for j in 0..=40 {
                    let seen = [f64::from(i) / 40.0 - 0.5, f64::from(j) / 50.0 - 0.4];
                    let again = model.distort(model.undistort(seen).unwrap());
                    let off = (again[0] - seen[0]).hypot(again[1] - seen[1]);
                    assert!(off < 1e-14, "{seen:?}: off by {off}");
                }
            }
        }
    }

    /// r + k r³ rises for ever, so all of it has an inverse, as steep as it may be beside the axis.
    #[test]
    fn what_is_steep_far_out_comes_back_and_what_no_lens_sees_is_refused() {
        let spec =
            |k1| DistortionSpec::BrownConrady(BrownConrady { k1, ..BrownConrady::default() });
        for (k1, reach) in [(0.01, 1000.0), (1.0, 1000.0), (10.0, 1000.0)] {
            let model = spec(k1).build([[reach, 0.0], [0.0, reach]].into_iter()).unwrap();
            for share in 1..=64 {
                let seen = [reach * f64::from(share) / 64.0, 0.0];
                let again = model.distort(model.undistort(seen).unwrap());
                // A dozen roundings of a number of this size, as steep as the map is there.
                assert!((again[0] - seen[0]).abs() < 1e-10 * reach, "{k1}, {seen:?}: {again:?}");
            }
        }
        // A focal length of 2e-5 pixels: 16 of them reach 4e5 to each side.
        let error = spec(0.01).build([[4e5, 0.3]].into_iter()).unwrap_err();
        assert!(error.why.contains("89.9999°") && error.why.contains("fx, fy"), "{error}");
    }

    #[test]
    fn a_fold_is_reported_by_its_angle() {
        // r (1 − r²/3) turns back at r = 1, that is 45°, where it is 2/3.
        let model = BrownConrady { k1: -1.0 / 3.0, ..BrownConrady::default() };
        let spec = DistortionSpec::BrownConrady(model);
        assert!(spec.build([[0.66, 0.0]].into_iter()).is_ok());
        let error = spec.build([[0.5, 0.0], [0.0, 0.7]].into_iter()).unwrap_err();
        assert_eq!(error.at, "distortion");
        let angle: f64 = error.why["the model folds back ".len()..]
            .split('°')
            .next()
            .and_then(|number| number.parse().ok())
            .unwrap();
        // The search stops within 1/65536 of the way; near a fold the angle goes with its root.
        assert!((angle - 45.0).abs() < 0.5, "{error}");
    }

    #[test]
    fn a_fisheye_ends_where_it_folds() {
        let equidistant = DistortionSpec::Fisheye(Fisheye::default());
        let model = equidistant.build(std::iter::empty()).unwrap();
        let behind = model.undistort([0.0, 3.0]).unwrap();
        assert!((behind[2] - 3.0_f64.cos()).abs() < 1e-15, "{behind:?}");
        assert_eq!(model.undistort([3.2, 0.0]), None, "beyond half a turn");
        assert_eq!(model.undistort([0.0, 0.0]), Some([0.0, 0.0, 1.0]));
        // θ (1 − θ²/3) turns back at θ = 1, where it is 2/3.
        let folding = Fisheye { k1: -1.0 / 3.0, ..Fisheye::default() };
        let model = DistortionSpec::Fisheye(folding).build(std::iter::empty()).unwrap();
        assert!(model.undistort([0.666, 0.0]).is_some());
        assert_eq!(model.undistort([0.667, 0.0]), None);
    }

    #[test]
    fn coefficients_come_in_opencv_order() {
        assert_eq!(rational().coefficients()[..5], [-0.28, 0.11, 0.0012, -0.0008, -0.02]);
        assert_eq!(rational().coefficients().len(), 12);
        let plain = BrownConrady { k1: 0.1, k6: 0.0, ..BrownConrady::default() };
        assert_eq!(DistortionSpec::BrownConrady(plain).coefficients(), [0.1, 0.0, 0.0, 0.0, 0.0]);
    }
}
