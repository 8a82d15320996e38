//! OpenCV's standard model of distortion, and its inverse by Newton's method.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Radial (rational), tangential and thin-prism distortion. OpenCV's vector is
/// (k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BrownConrady {
    /// Radial, r² of the numerator.
    pub k1: f64,
    /// Radial, r⁴ of the numerator.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// Radial, r⁶ of the numerator.
    pub k3: f64,
    /// Radial, r² of the denominator.
    pub k4: f64,
    /// Radial, r⁴ of the denominator.
    pub k5: f64,
    /// Radial, r⁶ of the denominator.
    pub k6: f64,
    /// Thin prism, r² along x.
    pub s1: f64,
    /// Thin prism, r⁴ along x.
    pub s2: f64,
    /// Thin prism, r² along y.
    pub s3: f64,
    /// Thin prism, r⁴ along y.
    pub s4: f64,
}

/// The unit direction through tangents.
#[inline(always)]
fn direction([x, y]: [f64; 2]) -> [f64; 3] {
    let shorten = 1.0 / (x * x + y * y + 1.0).sqrt();
    [x * shorten, y * shorten, shorten]
}

/// Places that are inverted side by side.
const LANES: usize = 8;

/// Undistorts each place as [`BrownConrady::undistort`]; zero where nothing is seen.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn undistort_all(model: &BrownConrady, limit: f64, [x, y, z]: [&mut [f64]; 3]) {
    let ((x, rest_x), (y, rest_y)) = (x.as_chunks_mut::<LANES>(), y.as_chunks_mut::<LANES>());
    let (z, rest_z) = z.as_chunks_mut::<LANES>();
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        for (i, found) in model.invert([*x, *y], limit).into_iter().enumerate() {
            [x[i], y[i], z[i]] = found.map(direction).unwrap_or_default();
        }
    }
    for ((x, y), z) in rest_x.iter_mut().zip(rest_y).zip(rest_z) {
        [*x, *y, *z] = model.undistort([*x, *y], limit).unwrap_or_default();
    }
}

/// A map's value, and its derivatives by rows.
type MapValue = ([f64; 2], [[f64; 2]; 2]);

impl BrownConrady {
    /// Residuals below this, relative to 1 + the target's size, are rounding.
    const RESIDUAL: f64 = 4e-15;

    /// Steps of Newton's method after which it is given up.
    const MOST_STEPS: u32 = 30;

    /// Distorted tangents, and their derivatives by x and y.
    #[inline(always)]
    pub(super) fn distort(&self, [x, y]: [f64; 2]) -> MapValue {
        let r2 = x * x + y * y;
        let top = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let bottom = 1.0 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6));
        // The radial factor, the prisms, and their derivatives by r².
        let top_by_r2 = self.k1 + r2 * (2.0 * self.k2 + r2 * 3.0 * self.k3);
        let bottom_by_r2 = self.k4 + r2 * (2.0 * self.k5 + r2 * 3.0 * self.k6);
        let radial = top / bottom;
        let radial_by_r2 = (top_by_r2 - radial * bottom_by_r2) / bottom;
        let prism = [r2 * (self.s1 + r2 * self.s2), r2 * (self.s3 + r2 * self.s4)];
        let prism_by_r2 = [self.s1 + 2.0 * r2 * self.s2, self.s3 + 2.0 * r2 * self.s4];
        // With the tangential terms, and the derivatives by x and y.
        let (p1, p2) = (self.p1, self.p2);
        let seen = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + prism[0],
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + prism[1],
        ];
        let by = [
            [
                radial
                    + 2.0 * x * (x * radial_by_r2 + prism_by_r2[0])
                    + 2.0 * p1 * y
                    + 6.0 * p2 * x,
                2.0 * y * (x * radial_by_r2 + prism_by_r2[0]) + 2.0 * p1 * x + 2.0 * p2 * y,
            ],
            [
                2.0 * x * (y * radial_by_r2 + prism_by_r2[1]) + 2.0 * p1 * x + 2.0 * p2 * y,
                radial
                    + 2.0 * y * (y * radial_by_r2 + prism_by_r2[1])
                    + 6.0 * p1 * y
                    + 2.0 * p2 * x,
            ],
        ];
        (seen, by)
    }

    /// Newton's method from `start` for some places side by side: where it comes to, and whether it arrives. It does not
    /// behind a fold, where the map turns the picture over.
    #[inline(always)]
    fn newton<const N: usize>(
        &self,
        seen: [[f64; N]; 2],
        start: [[f64; N]; 2],
    ) -> ([[f64; N]; 2], [bool; N]) {
        let (mut at, mut enough) = (start, [0.0; N]);
        let [mut arrived, mut ended] = [[false; N]; 2];
        for i in 0..N {
            enough[i] = Self::RESIDUAL * (1.0 + seen[0][i].abs() + seen[1][i].abs());
        }
        for _ in 0..Self::MOST_STEPS {
            for i in 0..N {
                let [x, y] = [at[0][i], at[1][i]];
                let (there, by) = self.distort([x, y]);
                let (dx, dy) = (seen[0][i] - there[0], seen[1][i] - there[1]);
                let area = by[0][0] * by[1][1] - by[0][1] * by[1][0];
                // A zero denominator gives NaN, which ends the search too.
                let goes_on = (area > 0.0) & !ended[i];
                arrived[i] |= goes_on & (dx.abs() <= enough[i]) & (dy.abs() <= enough[i]);
                ended[i] = !goes_on | arrived[i];
                at[0][i] = if ended[i] { x } else { x + (by[1][1] * dx - by[0][1] * dy) / area };
                at[1][i] = if ended[i] { y } else { y + (by[0][0] * dy - by[1][0] * dx) / area };
            }
            if ended == [true; N] {
                break;
            }
        }
        (at, arrived)
    }

    /// The undistorted tangents seen at `seen`, followed from the axis outwards so that they lie on
    /// the picture's own side of every fold. The error is the tangent at which the model folds.
    pub(super) fn track(&self, seen: [f64; 2]) -> Result<[f64; 2], f64> {
        // Shares of the way; a step that fails is halved until it is plain that it is no step but
        // a fold, and steps grow again where they arrive: what is steep at the axis only is left in a few.
        const LONGEST: f64 = 1.0 / 16.0;
        const SHORTEST: f64 = 1.0 / 65_536.0;
        /// Steps after which a way that goes on in the shortest ones is given up as a fold.
        const MOST_SHARES: u32 = 4096;
        let (mut at, mut done, mut step) = ([0.0; 2], 0.0, LONGEST);
        for _ in 0..MOST_SHARES {
            if done >= 1.0 {
                return Ok(at);
            }
            let next = f64::min(done + step, 1.0);
            // On in the same direction; near the axis all these maps are the identity.
            let start =
                if done == 0.0 { seen.map(|x| x * next) } else { at.map(|x| x * next / done) };
            let reach = start[0].hypot(start[1]).max(1e-3);
            let (found, [arrives]) = self.newton(seen.map(|x| [x * next]), start.map(|x| [x]));
            let [x, y] = found.map(|[x]| x);
            // A solution far from where the last step pointed lies on another sheet.
            match arrives && (x - start[0]).hypot(y - start[1]) < 0.25 * reach {
                true => {
                    at = [x, y];
                    done = next;
                    step = f64::min(2.0 * step, LONGEST);
                }
                false if step > SHORTEST => step *= 0.5,
                false => break,
            }
        }
        if done >= 1.0 { Ok(at) } else { Err(at[0].hypot(at[1])) }
    }

    /// The undistorted tangents seen at some places. `limit` is the largest tangent in the picture.
    #[inline(always)]
    fn invert<const N: usize>(&self, seen: [[f64; N]; 2], limit: f64) -> [Option<[f64; 2]>; N] {
        // One step of the fixed point is near enough for the distortion of most lenses.
        let mut start = seen;
        for i in 0..N {
            let (once, _) = self.distort([seen[0][i], seen[1][i]]);
            [start[0][i], start[1][i]] = [2.0 * seen[0][i] - once[0], 2.0 * seen[1][i] - once[1]];
        }
        let (at, arrived) = self.newton(seen, start);
        std::array::from_fn(|i| {
            let [x, y] = [at[0][i], at[1][i]];
            match arrived[i] && x.hypot(y) <= limit {
                true => Some([x, y]),
                false => self.track([seen[0][i], seen[1][i]]).ok(),
            }
        })
    }

    /// The unit direction (x right, y down, z forward) that is seen at distorted tangents; `None` where nothing is.
    pub(super) fn undistort(&self, seen: [f64; 2], limit: f64) -> Option<[f64; 3]> {
        let [found] = self.invert(seen.map(|x| [x]), limit);
        found.map(direction)
    }
}
