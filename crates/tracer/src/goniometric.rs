//! Luminaires by their measured intensities: files of the Illuminating Engineering Society.
//!
//! ANSI/IES LM-63 (1986 to 2019), photometry of type C: vertical angles from straight down, horizontal angles
//! about it.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};

use etendue_geometry::glam::{DMat3, DVec3};

use crate::tint::BRIGHTEST;

/// The longest file (bytes).
const LONGEST: u64 = 1 << 24;

/// The most angles of each kind.
const MOST_ANGLES: f64 = 4096.0;

/// A point that shines by a measured distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct Goniometric {
    /// Position (m).
    pub at: DVec3,
    /// Its axes in the world: +X in the plane of the horizontal angle 0, +Y in that of 90 degrees, and +Z
    /// against the vertical angle 0.
    pub axes: DMat3,
    /// The file.
    pub file: PathBuf,
    /// Intensities that the file states.
    pub photometry: Photometry,
}

impl Goniometric {
    /// The intensity (cd, before any colour) towards the point `to` (m).
    pub(crate) fn toward(&self, to: DVec3) -> f64 {
        let Some(direction) = (to - self.at).try_normalize() else { return 0.0 };
        let local = self.axes.transpose() * direction;
        let vertical = (-local.z).clamp(-1.0, 1.0).acos();
        self.photometry.intensity(vertical, local.y.atan2(local.x))
    }

    /// Direction in which it is aimed (unit).
    pub(crate) fn axis(&self) -> DVec3 {
        -self.axes.z_axis
    }
}

/// Intensities by direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Photometry {
    /// Angles from straight down (rad), ascending.
    vertical: Vec<f64>,
    /// Angles about it (rad), ascending, from 0 to 0, π/2, π or 2π: what is beyond follows by symmetry.
    horizontal: Vec<f64>,
    /// cd, `[horizontal][vertical]`.
    candela: Vec<f64>,
}

impl Photometry {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// A sentence on why it cannot be read.
    pub fn read(path: &Path) -> Result<Self, String> {
        let bytes = etendue_files::read(path, LONGEST)
            .map_err(|error| format!("cannot be read: {error}"))?;
        Self::parse(&String::from_utf8_lossy(&bytes))
    }

    /// From the text of a file. What a tilt of the lamp does (`TILT`) is not looked at.
    ///
    /// # Errors
    ///
    /// A sentence on what is wrong.
    pub fn parse(text: &str) -> Result<Self, String> {
        let lines = &mut text.lines();
        // All after the line TILT= is numbers, whatever the lines.
        let tilt = lines.find_map(|line| line.trim().strip_prefix("TILT="));
        let tilt = tilt.ok_or("has no line TILT=; is it an IES file (LM-63)?")?.trim();
        let words = lines.flat_map(|line| line.split([' ', '\t', ',']));
        let mut numbers = words.filter(|word| !word.is_empty()).map(|word| {
            let number: Option<f64> = word.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| format!("\"{}\" is no number", word.escape_debug()))
        });
        let mut next = |what: &str| numbers.next().unwrap_or(Err(format!("ends before {what}")));
        // The lamp's own tilt, which is not asked for.
        if tilt == "INCLUDE" {
            next("the lamp's tilt")?;
            for _ in 0..2 * count(next("the angles of tilt")?, "angles of tilt")? {
                next("the lamp's tilt")?;
            }
        }
        // Lamps, lumens, multiplier, numbers of angles, type and units; then sizes, ballast and
        // watts.
        let [_, _, multiplier, verticals, horizontals, kind] =
            array(|| next("the luminaire's figures"))?;
        let [_, _, _, _, ballast, _, _] = array(|| next("the luminaire's figures"))?;
        if kind != 1.0 {
            return Err(format!("is photometry of type {kind}; type C (1) alone is read"));
        }
        // The angles, which have to cover whole quarters.
        let mut angles = |number: f64, what: &str| -> Result<Vec<f64>, String> {
            let all =
                (0..count(number, what)?).map(|_| next(what)).collect::<Result<Vec<_>, _>>()?;
            if all.windows(2).any(|pair| pair[0] >= pair[1]) {
                return Err(format!("has {what} that do not ascend"));
            }
            Ok(all)
        };
        let vertical = angles(verticals, "vertical angles")?;
        let horizontal = angles(horizontals, "horizontal angles")?;
        let ends = |all: &[f64]| [all[0], all[all.len() - 1]];
        if !matches!(ends(&vertical), [0.0, 90.0 | 180.0] | [90.0, 180.0]) {
            return Err("has vertical angles other than from 0 or 90 to 90 or 180".to_owned());
        }
        if !matches!(ends(&horizontal), [0.0, 0.0 | 90.0 | 180.0 | 360.0]) {
            return Err("has horizontal angles other than from 0 to 0, 90, 180 or 360".to_owned());
        }
        let scale = multiplier * ballast;
        // The intensities, one vertical fan after the other.
        let candela = (0..vertical.len() * horizontal.len())
            .map(|_| Ok(next("all candela values")? * scale))
            .collect::<Result<Vec<f64>, String>>()?;
        if let Some(wrong) = candela.iter().find(|value| !(0.0..=BRIGHTEST).contains(*value)) {
            return Err(format!("has an intensity of {wrong} cd, which is none"));
        }
        let [vertical, horizontal] =
            [vertical, horizontal].map(|all| all.into_iter().map(f64::to_radians).collect());
        Ok(Self { vertical, horizontal, candela })
    }

    /// cd, in the direction of a vertical angle in 0..=π and any horizontal one (rad), between the angles of
    /// the file by interpolation; 0 where the file has nothing.
    #[must_use]
    pub fn intensity(&self, vertical: f64, horizontal: f64) -> f64 {
        let Some((row, down)) = between(&self.vertical, vertical) else { return 0.0 };
        let last = self.horizontal[self.horizontal.len() - 1];
        let azimuth = horizontal.rem_euclid(TAU);
        // Rounded to more than three quarters of a right angle, or to none.
        let azimuth = match last {
            0.0 => 0.0,
            last if last > 1.5 * PI => azimuth,
            last if last > 0.75 * PI => azimuth.min(TAU - azimuth),
            _ => {
                let half = azimuth.rem_euclid(PI);
                half.min(PI - half)
            }
        };
        let (column, aside) = between(&self.horizontal, azimuth.min(last)).unwrap_or_default();
        let rows = self.vertical.len();
        let at = |column: usize, row: usize| {
            let column = column.min(self.horizontal.len() - 1);
            self.candela[column * rows + row.min(rows - 1)]
        };
        let along = |column| at(column, row) * (1.0 - down) + at(column, row + 1) * down;
        along(column) * (1.0 - aside) + along(column + 1) * aside
    }

    /// The mean over all directions (cd).
    #[must_use]
    pub fn mean(&self) -> f64 {
        let (rows, columns) = (180, 72);
        let mut sum = 0.0;
        for row in 0..rows {
            // Equal parts of the sphere.
            let vertical = (1.0 - 2.0 * (f64::from(row) + 0.5) / f64::from(rows)).acos();
            for column in 0..columns {
                sum +=
                    self.intensity(vertical, TAU * (f64::from(column) + 0.5) / f64::from(columns));
            }
        }
        sum / f64::from(rows * columns)
    }

    /// The angle from straight down beyond which it is dark (rad), at least a right one.
    pub(crate) fn reach(&self) -> f64 {
        let last = self.vertical[self.vertical.len() - 1];
        if last > 0.75 * PI { PI } else { FRAC_PI_2 }
    }
}

/// So many numbers of what `next` gives.
fn array<const N: usize>(
    mut next: impl FnMut() -> Result<f64, String>,
) -> Result<[f64; N], String> {
    let mut all = [0.0; N];
    for number in &mut all {
        *number = next()?;
    }
    Ok(all)
}

/// A number of things.
fn count(number: f64, what: &str) -> Result<usize, String> {
    if number.fract() != 0.0 || !(1.0..=MOST_ANGLES).contains(&number) {
        return Err(format!("has {number} {what}; 1 to {MOST_ANGLES} are read"));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    Ok(number as usize)
}

/// The knot at or below `x` and the share of the next; `None` outside of all.
fn between(knots: &[f64], x: f64) -> Option<(usize, f64)> {
    let (first, last) = (knots[0], knots[knots.len() - 1]);
    // A rounding beyond the last is the last.
    let x = if x > last && x <= last * (1.0 + 4.0 * f64::EPSILON) { last } else { x };
    if !(first..=last).contains(&x) {
        return None;
    }
    let next = knots.partition_point(|&knot| knot <= x).clamp(1, knots.len().max(2) - 1);
    let below = next - 1;
    let width = knots.get(next).map_or(0.0, |next| next - knots[below]);
    Some((below, if width > 0.0 { (x - knots[below]) / width } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(horizontal: &[f64], candela: impl Fn(f64, f64) -> f64) -> Photometry {
        let vertical: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
        let words = |all: &[f64]| all.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let values: Vec<f64> = horizontal
            .iter()
            .flat_map(|&h| vertical.iter().map(move |&v| (h, v)))
            .map(|(h, v)| candela(h, v))
            .collect();
        let text = format!(
            "IESNA:LM-63-2002\n[TEST] none\nTILT=NONE\n1 -1 2 37 {} 1 2\n0 0 0 0.5 1 0\n{}\n{}\n{}\n",
            horizontal.len(),
            words(&vertical),
            words(horizontal),
            words(&values)
        );
        Photometry::parse(&text).unwrap()
    }

    #[test]
    fn planes_that_are_left_out_follow_by_symmetry() {
        let right: Vec<f64> = (0..=6).map(|k| 15.0 * f64::from(k)).collect();
        // Multiplier 2 times ballast 0.5.
        let quarter = file(&right, |h, v| h + v);
        for (h, same) in [(30.0, 30.0), (150.0, 30.0), (210.0, 30.0), (330.0, 30.0), (-90.0, 90.0)]
        {
            let found = quarter.intensity(f64::to_radians(40.0), f64::to_radians(h));
            assert!((found - (40.0 + same)).abs() < 1e-9, "{h}: {found}");
        }
        let half = file(&[0.0, 90.0, 180.0], |h, _| h);
        for (h, same) in [(45.0, 45.0), (170.0, 170.0), (190.0, 170.0), (-30.0, 30.0)] {
            assert!((half.intensity(1.0, f64::to_radians(h)) - same).abs() < 1e-9, "{h}");
        }
        let whole = file(&[0.0, 180.0, 360.0], |h, _| h);
        assert!((whole.intensity(1.0, f64::to_radians(-90.0)) - 270.0).abs() < 1e-9);
        let round = file(&[0.0], |_, v| v);
        assert!((round.intensity(f64::to_radians(82.5), 2.0) - 82.5).abs() < 1e-9);
        assert!((round.intensity(PI, 2.0) - 180.0).abs() < 1e-9);
    }

    /// I₀ cos θ downwards: a quarter of I₀ in the mean; interpolated linearly over five degrees, it is up to a
    /// thousandth less.
    #[test]
    fn the_mean_is_that_over_the_sphere() {
        let lambert = file(&[0.0], |_, v: f64| v.to_radians().cos().max(0.0));
        assert!((lambert.mean() - 0.25).abs() < 5e-4, "{}", lambert.mean());
    }

    #[test]
    fn what_is_wrong_is_said() {
        let says = |text: &str, word: &str| {
            let why = Photometry::parse(text).unwrap_err();
            assert!(why.contains(word), "{why}");
        };
        says("", "TILT=");
        says("TILT=NONE\n1 2 x", "\"x\" is no number");
        says("TILT=NONE\n1 -1 1 2 1 2 2 0 0 0 1 1 0", "type 2");
        says("TILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 0 0 90 0 5", "ends before all candela values");
        says("TILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 0 90 0 0 5 5", "do not ascend");
        says("TILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 0 0 80 0 5 5", "vertical angles");
        says("TILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 0 0 90 0 5 -5", "-5 cd");
        says("TILT=NONE\n1 -1 1 1e9 1 1 2 0 0 0 1 1 0 0 90", "1000000000 vertical");
    }
}
