//! Rays that cross a strong asphere or biconic more than once, against a scan of the whole ray by the sag formula.

use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::Side;
use glam::DVec3;

use crate::build;

/// A surface alone in glass of index 1.5: curvatures (1/mm) and conic constants along x and y, and for an
/// asphere, which is round, coefficients of r², r⁴, ….
struct Shape {
    curvature: [f64; 2],
    conic: [f64; 2],
    /// Half the clear diameter (mm); none for a surface that goes on.
    semi_diameter: Option<f64>,
    coefficients: &'static [f64],
}

const fn asphere(
    curvature: f64,
    conic: f64,
    semi_diameter: Option<f64>,
    coefficients: &'static [f64],
) -> Shape {
    Shape { curvature: [curvature; 2], conic: [conic; 2], semi_diameter, coefficients }
}

const fn biconic(curvature: [f64; 2], conic: [f64; 2], semi_diameter: Option<f64>) -> Shape {
    Shape { curvature, conic, semi_diameter, coefficients: &[] }
}

/// A gull's wing, a bowl with a bump in its middle, and a ring of waves.
const ASPHERES: [Shape; 3] = [
    asphere(0.05, 0.0, Some(6.0), &[0.0, -1.5e-3]),
    asphere(-0.15, 0.0, Some(5.0), &[0.0, 8e-3, 1e-4]),
    asphere(0.02, 0.0, Some(9.0), &[0.0, 4e-3, -9e-5, 5e-7]),
];

/// Shapes without a clear aperture, up to their domain, and the first with one that has no end.
const UNLIMITED: [Shape; 4] = [
    asphere(0.05, 0.0, None, &[0.0, -1.5e-3]),
    asphere(0.05, -1.0, None, &[0.0, -1.5e-3]),
    asphere(-0.15, 0.0, None, &[0.0, 8e-3, 1e-4]),
    asphere(0.02, 0.0, None, &[0.0, 4e-3, -9e-5, 5e-7]),
];

/// Along x these bend one way about the axis and the other farther off.
const BICONICS: [Shape; 4] = [
    biconic([0.02, 0.3], [-4000.0, -3.0], Some(6.0)),
    biconic([0.02, 0.3], [-4000.0, -3.0], None),
    biconic([0.02, 0.2], [-2000.0, -1.0], Some(6.0)),
    biconic([0.15, -0.1], [0.5, -0.3], Some(5.0)),
];

impl Shape {
    /// The sag; no number where there is none.
    fn sag(&self, at: DVec3) -> f64 {
        let [c, d] = self.curvature;
        let [x2, y2] = [at.x * at.x, at.y * at.y];
        let [a, b] = [(1.0 + self.conic[0]) * c * c, (1.0 + self.conic[1]) * d * d];
        let conic = (c * x2 + d * y2) / (1.0 + (1.0 - a * x2 - b * y2).sqrt());
        self.coefficients.iter().rev().fold(0.0, |sum, a| (sum + a) * (x2 + y2)) + conic
    }

    fn file(&self) -> String {
        let ([c, d], [k, l]) = (self.curvature, self.conic);
        let shape = if self.coefficients.is_empty() {
            let (along_x, along_y) = (1.0 / c, 1.0 / d);
            format!(
                r#""type": "biconic", "radius_x": {along_x}, "radius": {along_y}, "conic_x": {k}, "conic": {l}"#
            )
        } else {
            let powers =
                self.coefficients.iter().zip(1..).map(|(a, i)| format!(r#""{}": {a:e}"#, 2 * i));
            let powers = powers.collect::<Vec<_>>().join(", ");
            format!(
                r#""type": "surface", "curvature": {c}, "conic": {k}, "aspheric": {{{powers}}}"#
            )
        };
        let rim =
            self.semi_diameter.map_or(String::new(), |r| format!(r#""semi_diameter": {r}, "#));
        format!(r#"{{"elements": [{{{shape}, {rim}"thickness": 5, "glass": {{"n": 1.5}}}}]}}"#)
    }

    /// Distance from the axis within which a ray may cross the shape: up to its rim, and where it
    /// has none up to four times the ray's distance from the vertex beyond the greatest diameter of
    /// curvature, as it is documented.
    fn reach(&self, start: DVec3, direction: DVec3) -> f64 {
        let height = start.cross(direction).length();
        let diameter = self.curvature.iter().map(|c| (2.0 / c).abs()).fold(0.0, f64::max);
        self.semi_diameter.unwrap_or(4.0 * height + diameter)
    }

    /// First crossing of the ray from front to back within its reach, and the number of crossings
    /// there at all: by the sign of z − sag at 20 000 places of 80 mm.
    fn crossings(&self, start: DVec3, direction: DVec3) -> (Option<f64>, usize) {
        let reach = self.reach(start, direction);
        let behind = |t: f64| {
            let at = start + t * direction;
            let sag = self.sag(at);
            let exists = at.truncate().length() <= reach && sag.is_finite();
            exists.then_some(at.z > sag)
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

    /// Holds rays at some angles to the axis (degrees), turned about it, from 40 mm before the vertex' plane on to
    /// the scan: each meets the surface at the first place where it crosses it from front to back, alone and in
    /// batches to the same bits. How many cross three times, and how many rays there are.
    fn held_to_the_scan(&self, angles: &[f64], turns: &[f64]) -> (usize, usize) {
        let (mut thrice, mut total) = (0, 0);
        let train = build(&self.file());
        let at = train.at(550.0).unwrap();
        let mut rays = LensRays::default();
        let mut paths = Vec::new();
        let places = turns.iter().flat_map(|turn| {
            let angles = angles.iter().map(move |angle| [turn.to_radians(), angle.to_radians()]);
            angles.flat_map(|angles| [0.0, 0.7, 2.0, 4.0].map(move |across| (angles, across)))
        });
        for ([turn, angle], across) in places {
            let about = DVec3::new(turn.cos(), turn.sin(), 0.0);
            let direction = angle.sin() * about + angle.cos() * DVec3::Z;
            for i in 0..60 {
                // Through places at heights from −3 to 3 mm on the axis, 40 mm along the ray before.
                let height = 0.1 * f64::from(i) - 3.0;
                let through = across * DVec3::Z.cross(about) + height * DVec3::Z;
                let start = through - 40.0 * direction;
                let (first, count) = self.crossings(start, direction);
                let Some(first) = first else { continue };
                total += 1;
                thrice += usize::from(count >= 3);
                let path = at.path(Side::Object, Clip::On, start, direction);
                let what = format!("{} {turn} {angle} {across} {i}: {path:?}", self.file());
                let point = path.points.first().unwrap_or_else(|| panic!("{what}"));
                let travel = (*point - start).dot(direction);
                // A step of the scan is 0.004 mm.
                assert!(
                    travel >= first - 1e-9 && travel <= first + 0.004 + 1e-9,
                    "{what}, not {first}"
                );
                // Newton's last step is under 1e-10 mm.
                let off = point.z - self.sag(*point);
                assert!(off.abs() < 1e-9, "{what}: {off} mm off");
                rays.push(start, direction);
                paths.push(path);
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
        (thrice, total)
    }
}

/// Of surfaces at rays of these directions, together.
fn held(shapes: &[Shape], angles: &[f64], turns: &[f64]) -> (usize, usize) {
    let counts = shapes.iter().map(|shape| shape.held_to_the_scan(angles, turns));
    let (thrice, total) = counts.fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
    println!("{thrice} rays cross three times of {total}");
    (thrice, total)
}

const ANGLES: [f64; 6] = [0.0, 30.0, 60.0, 70.0, 75.0, 80.0];

#[test]
fn the_first_crossing_within_the_aperture_is_taken() {
    assert!(held(&ASPHERES, &ANGLES, &[0.0]).0 > 100);
}

#[test]
fn without_a_clear_aperture_the_first_crossing_is_taken() {
    assert!(held(&UNLIMITED, &ANGLES, &[0.0]).0 > 100);
}

#[test]
fn biconics_are_met_at_the_first_crossing() {
    let (thrice, total) = held(&BICONICS, &[0.0, 45.0, 75.0, 80.0, 84.0], &[0.0, 20.0, 90.0]);
    assert!(thrice > 20 && total > 1000, "{thrice} of {total}");
}
