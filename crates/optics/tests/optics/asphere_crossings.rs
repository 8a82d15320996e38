//! Rays that cross a strong asphere more than once, against a scan of the whole ray by the sag formula.

use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::Side;
use glam::DVec3;

use crate::build;

/// An asphere alone in glass of index 1.5: its radius, its semi-diameter (mm), and coefficients of r², r⁴, ….
struct Asphere {
    curvature: f64,
    semi_diameter: f64,
    coefficients: &'static [f64],
}

/// A gull's wing, a bowl with a bump in its middle, and a ring of waves.
const ASPHERES: [Asphere; 3] = [
    Asphere { curvature: 0.05, semi_diameter: 6.0, coefficients: &[0.0, -1.5e-3] },
    Asphere { curvature: -0.15, semi_diameter: 5.0, coefficients: &[0.0, 8e-3, 1e-4] },
    Asphere { curvature: 0.02, semi_diameter: 9.0, coefficients: &[0.0, 4e-3, -9e-5, 5e-7] },
];

impl Asphere {
    fn sag(&self, r2: f64) -> f64 {
        let conic = self.curvature * r2 / (1.0 + (1.0 - self.curvature.powi(2) * r2).sqrt());
        self.coefficients.iter().rev().fold(0.0, |sum, a| (sum + a) * r2) + conic
    }

    fn file(&self) -> String {
        let powers =
            self.coefficients.iter().zip(1..).map(|(a, i)| format!(r#""{}": {a:e}"#, 2 * i));
        let powers: Vec<String> = powers.collect();
        format!(
            r#"{{"elements": [{{"type": "surface", "curvature": {}, "semi_diameter": {}, "thickness": 5,
                "glass": {{"n": 1.5}}, "aspheric": {{{}}}}}]}}"#,
            self.curvature,
            self.semi_diameter,
            powers.join(", ")
        )
    }

    /// Where the ray crosses from front to back within the semi-diameter, and how often it crosses there at all: by
    /// the sign of z − sag at 20 000 places of 80 mm.
    fn crossings(&self, start: DVec3, direction: DVec3) -> (Option<f64>, usize) {
        let behind = |t: f64| {
            let at = start + t * direction;
            let r2 = at.x * at.x + at.y * at.y;
            (r2 <= self.semi_diameter.powi(2)).then(|| at.z > self.sag(r2))
        };
        let step = 80.0 / 20_000.0;
        let (mut first, mut count) = (None, 0);
        for i in 0..20_000 {
            let t = step * f64::from(i);
            match [behind(t), behind(t + step)] {
                [Some(false), Some(true)] => {
                    first = first.or(Some(t));
                    count += 1;
                }
                [Some(true), Some(false)] => count += 1,
                _ => {}
            }
        }
        (first, count)
    }
}

/// Rays at up to 80 degrees to the axis from 40 mm before the vertex' plane on: each meets the asphere at the first
/// place where it crosses it from front to back within the aperture, alone and in batches to the same bits.
#[test]
fn the_first_crossing_within_the_aperture_is_taken() {
    let (mut thrice, mut total) = (0, 0);
    for asphere in &ASPHERES {
        let train = build(&asphere.file());
        let at = train.at(550.0).unwrap();
        let mut rays = LensRays::default();
        let mut paths = Vec::new();
        for degrees in [0.0, 30.0, 60.0, 70.0, 75.0, 80.0_f64] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let direction = DVec3::new(sine, 0.0, cosine);
            for across in [0.0, 0.7, 2.0, 4.0] {
                for i in 0..60 {
                    // Through places at heights from −3 to 3 mm on the axis, 40 mm along the ray before.
                    let through = DVec3::new(0.0, across, 0.1 * f64::from(i) - 3.0);
                    let start = through - 40.0 * direction;
                    let (first, count) = asphere.crossings(start, direction);
                    let Some(first) = first else { continue };
                    total += 1;
                    thrice += usize::from(count >= 3);
                    let path = at.path(Side::Object, Clip::On, start, direction);
                    let what =
                        format!("{:?} {degrees} {across} {i}: {path:?}", asphere.coefficients);
                    let point = path.points.first().unwrap_or_else(|| panic!("{what}"));
                    let travel = (*point - start).dot(direction);
                    // A step of the scan is 0.004 mm.
                    assert!(
                        travel >= first - 1e-9 && travel <= first + 0.004 + 1e-9,
                        "{what}, not {first}"
                    );
                    let off = point.z - asphere.sag(point.x * point.x + point.y * point.y);
                    assert!(off.abs() < 1e-9, "{what}: {off} mm off");
                    rays.push(start, direction);
                    paths.push(path);
                }
            }
        }
        at.trace(Side::Object, Clip::On, &mut rays);
        for (i, path) in paths.iter().enumerate() {
            assert_eq!(rays.status(i), path.status);
            if path.status == RayStatus::Exited {
                assert_eq!(rays.position(i), path.points[0]);
                assert_eq!(Some(rays.direction(i)), path.direction);
            }
        }
    }
    println!("{thrice} rays cross three times of {}", total);
    assert!(thrice > 100, "{thrice} rays cross an asphere three times");
}
