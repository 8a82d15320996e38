use std::sync::Arc;

use super::*;
use crate::element::newton::{Profile, cross};
use crate::element::rays::Ray;
use crate::element::refract::IndexPair;

fn read(json: &str) -> Result<Freeform, String> {
    let spec = serde_json::from_str::<FreeformSpec>(json).map_err(|e| e.to_string())?;
    spec.build(&|name: &str| Err(format!("{name}: no files")))
}

/// Places over a disk of 8 mm.
fn places() -> Vec<[f64; 2]> {
    let at = |i: i32| [0.73 * f64::from(i), 5.1 * (1.7 * f64::from(i)).sin()];
    (-8..=8).map(at).collect()
}

/// Compares the sag with its definition (to 1e-14 of a millimetre or of its size) and its slopes with differences.
fn check(json: &str, definition: impl Fn(f64, f64) -> f64) {
    let surface = read(json).unwrap();
    for [x, y] in places() {
        let (sag, slopes) = surface.sag_and_slopes([x, y]);
        let expected = definition(x, y);
        let close = 1e-14 * (1.0 + expected.abs());
        assert!((sag - expected).abs() < close, "{json} {x} {y}: {sag} {expected}");
        // A difference of fourth order over 1e-3 mm: its error is some 1e-12 of the fifth derivative, rounding 1e-12.
        let h = 1e-3;
        let by =
            |f: &dyn Fn(f64) -> f64| (8.0 * (f(h) - f(-h)) - f(2.0 * h) + f(-2.0 * h)) / (12.0 * h);
        let differences = [by(&|h| definition(x + h, y)), by(&|h| definition(x, y + h))];
        for axis in 0..2 {
            let error = (slopes[axis] - differences[axis]).abs();
            assert!(error < 1e-9, "{json} {x} {y}: {slopes:?} {differences:?}");
        }
        assert_eq!(surface.flipped().sag_and_slopes([x, y]).0, -sag);
    }
}

fn conic(c: f64, k: f64, square: f64) -> f64 {
    c * square / (1.0 + (1.0 - (1.0 + k) * c * c * square).sqrt())
}

#[test]
fn odd_aspheres_and_toroids_are_their_formulas() {
    check(
        r#"{"radius": 40, "conic": -0.4, "aspheric": {"2": 1e-3, "3": 2e-5, "5": -1e-7}}"#,
        |x, y| {
            let r = x.hypot(y);
            conic(1.0 / 40.0, -0.4, r * r) + 1e-3 * r * r + 2e-5 * r.powi(3) - 1e-7 * r.powi(5)
        },
    );
    check(
        r#"{"radius": 30, "conic": 0.2, "aspheric": {"4": 1e-6}, "rotation_radius": -25}"#,
        |x, y| {
            let f = conic(1.0 / 30.0, 0.2, y * y) + 1e-6 * y.powi(4);
            // z = R − sign(R) √((R − f)² − x²).
            -25.0 + ((-25.0 - f).powi(2) - x * x).sqrt()
        },
    );
}

#[test]
fn zernike_and_chebyshev_terms_are_their_formulas() {
    // Fringe 4, 6 and 8: 2ρ² − 1, ρ² sin 2θ, (3ρ³ − 2ρ) sin θ. Noll 6 is √6 ρ² cos 2θ.
    check(
        r#"{"sag": [{"type": "zernike", "radius": 9, "coefficients": {"4": 0.02, "6": -0.01, "8": 0.03}}]}"#,
        |x, y| {
            let (x, y) = (x / 9.0, y / 9.0);
            let square = x * x + y * y;
            0.02 * (2.0 * square - 1.0) - 0.01 * 2.0 * x * y + 0.03 * (3.0 * square - 2.0) * y
        },
    );
    check(
        r#"{"sag": [{"type": "zernike", "radius": 9, "order": "noll", "coefficients": {"6": 0.01}}]}"#,
        |x, y| 0.01 * 6.0_f64.sqrt() * (x * x - y * y) / 81.0,
    );
    // T₃(u) = cos(3 arccos u).
    check(
        r#"{"radius": 50, "sag": [{"type": "chebyshev", "half_size": [8, 7], "coefficients": [[3, 2, 0.01], [0, 1, 0.02]]}]}"#,
        |x, y| {
            let t = |n: f64, u: f64| (n * u.acos()).cos();
            conic(0.02, 0.0, x * x + y * y)
                + 0.01 * t(3.0, x / 8.0) * t(2.0, y / 7.0)
                + 0.02 * y / 7.0
        },
    );
    check(
        r#"{"sag": [{"type": "polynomial", "radius": 10, "coefficients": [[3, 0, 0.1], [0, 3, 0.1], [1, 2, -0.05]]}]}"#,
        |x, y| 1e-4 * (x.powi(3) + y.powi(3)) - 5e-5 * x * y * y,
    );
}

#[test]
fn q_polynomials_are_those_that_forbes_prints() {
    // Table 1 of the paper of 2007, and Q₁ and Q₂ of the strong ones: 6v − 5, 28v² − 42v + 15.
    check(
        r#"{"radius": 60, "sag": [{"type": "q_bfs", "radius": 10, "coefficients": [0.1, -0.05, 0.02, 0.01]}]}"#,
        |x, y| {
            let c: f64 = 1.0 / 60.0;
            let square = x * x + y * y;
            let v = square / 100.0;
            let q1 = (13.0 - 16.0 * v) / 19.0_f64.sqrt();
            let q2 = (2.0_f64 / 95.0).sqrt() * (29.0 - 4.0 * v * (25.0 - 19.0 * v));
            let q3 =
                (2.0_f64 / 2545.0).sqrt() * (207.0 - 4.0 * v * (315.0 - v * (577.0 - 320.0 * v)));
            let sum = 0.1 - 0.05 * q1 + 0.02 * q2 + 0.01 * q3;
            conic(c, 0.0, square) + v * (1.0 - v) * sum / (1.0 - c * c * square).sqrt()
        },
    );
    check(
        r#"{"radius": 60, "conic": -1, "sag": [{"type": "q_con", "radius": 10, "coefficients": [0.1, -0.05, 0.02]}]}"#,
        |x, y| {
            let square = x * x + y * y;
            let v = square / 100.0;
            let sum = 0.1 - 0.05 * (6.0 * v - 5.0) + 0.02 * (28.0 * v * v - 42.0 * v + 15.0);
            0.5 * square / 60.0 + v * v * sum
        },
    );
}

#[test]
fn second_derivatives_at_the_vertex_are_the_paraxial_curvature() {
    let surface = read(
        r#"{"radius": 40, "aspheric": {"2": 1e-3}, "sag": [{"type": "zernike", "radius": 10, "coefficients": {"4": 0.05}}]}"#,
    );
    // c + 2 A₂ + 4 a/R².
    assert!((surface.unwrap().paraxial_curvature() - (0.025 + 0.002 + 0.002)).abs() < 1e-17);
}

#[test]
fn rays_meet_the_surface_and_a_fresnel_lens_bends_as_its_facets() {
    let json = r#"{"radius": 40, "sag": [{"type": "zernike", "radius": 12, "coefficients": {"7": 0.1, "9": -0.05}}]}"#;
    let shape = Arc::new(read(json).unwrap());
    let surface = FreeformSurface::new(Arc::clone(&shape), 1.5, 550.0);
    for [x, y] in places() {
        let ray = Ray::new([x, y, -20.0].into(), [0.05, -0.02, 1.0].into()).unwrap();
        let crossing = cross(&surface, IndexPair::new(1.0, 1.5), ray, 1e9);
        let [x, y, z] = crossing.ray.position;
        assert!(crossing.hit && crossing.through && (z - shape.sag([x, y]).unwrap()).abs() < 1e-13);
    }
    // A parabola's slope at r is r/R: by Snell at the facet, from the plane.
    let fresnel = Arc::new(read(r#"{"radius": 40, "conic": -1, "fresnel": true}"#).unwrap());
    let surface = FreeformSurface::new(fresnel, 1.5, 550.0);
    let ray = Ray::new([0.0, 6.0, -5.0].into(), [0.0, 0.0, 1.0].into()).unwrap();
    let crossing = cross(&surface, IndexPair::new(1.0, 1.5), ray, 1e9);
    let facet = (6.0_f64 / 40.0).atan();
    let bent = facet - (facet.sin() / 1.5).asin();
    assert_eq!(crossing.ray.position, [0.0, 6.0, 0.0]);
    assert!((crossing.ray.direction[1] + bent.sin()).abs() < 1e-15);
}

#[test]
fn what_lies_in_a_plane_says_so_exactly() {
    let ray = Ray::new([1.0, -2.0, -5.0].into(), [0.6, 0.0, 0.8].into()).unwrap();
    for (json, is_in_a_plane) in [
        (r#"{"phase": {"pattern": {"type": "grating", "period": 0.05}, "order": 1}}"#, true),
        (r#"{"radius": 40, "conic": -1, "fresnel": true}"#, true),
        (r#"{"rotation_radius": 30}"#, false),
        (r#"{"aspheric": {"4": 1e-6}}"#, false),
        (r#"{"sag": [{"type": "zernike", "radius": 12, "coefficients": {"7": 0.1}}]}"#, false),
    ] {
        let surface = FreeformSurface::new(Arc::new(read(json).unwrap()), 1.0, 550.0);
        let found = [surface.sag_bounds(ray, [0.0, 9.0]), surface.along_bounds(ray, [0.0, 9.0])];
        assert_eq!(found == [[0.0, 0.0], [0.8, 0.8]], is_in_a_plane, "{json}");
        assert_eq!(surface.sag_range(5.0) == [0.0, 0.0], is_in_a_plane, "{json}");
        let at = Ray { position: [3.0, -4.0, 0.0], direction: ray.direction };
        assert_eq!(surface.sag_and_slope(at) == (0.0, [0.0; 2]), is_in_a_plane, "{json}");
    }
}

#[test]
fn gratings_obey_the_grating_equation_and_lose_what_is_evanescent() {
    for (order, n, n1, wavelength) in
        [(1, 1.0, 1.0, 550.0), (-2, 1.0, 1.5, 430.0), (3, 1.5, 1.0, 700.0), (40, 1.0, 1.0, 600.0)]
    {
        let json = format!(
            r#"{{"phase": {{"pattern": {{"type": "grating", "period": 0.005}}, "order": {order}}}}}"#
        );
        let shape = Arc::new(read(&json).unwrap());
        let surface = FreeformSurface::new(shape, n1, wavelength);
        for angle in [-20.0_f64, 0.0, 35.0] {
            let (sine, cosine) = angle.to_radians().sin_cos();
            let ray = Ray::new([0.3, 0.0, -5.0].into(), [0.0, sine, cosine].into()).unwrap();
            let crossing = cross(&surface, IndexPair::new(n, n1), ray, 1e9);
            let expected = (n * sine + f64::from(order) * wavelength * 1e-6 / 0.005) / n1;
            assert_eq!(crossing.through, expected.abs() <= 1.0, "order {order} at {angle}");
            if crossing.through {
                assert!((crossing.ray.direction[1] - expected).abs() < 1e-12);
                let length: f64 = crossing.ray.direction.iter().map(|d| d * d).sum();
                assert!((length - 1.0).abs() < 1e-15);
            }
        }
    }
}

#[test]
fn a_kinoform_has_its_focal_length_and_share_by_order() {
    let json = |order: i32| {
        format!(
            r#"{{"phase": {{"pattern": {{"type": "radial", "radius": 10, "coefficients": [-628.0]}},
               "order": {order}, "blaze_wavelength": 550}}}}"#
        )
    };
    for order in [1, 2, -1] {
        let surface = read(&json(order)).unwrap();
        for wavelength in [450.0, 550.0, 650.0] {
            // Φ = −m λ a₁/(π R²).
            let expected =
                f64::from(order) * wavelength * 1e-6 * 628.0 / (std::f64::consts::PI * 100.0);
            assert!(
                (surface.phase_power(wavelength) - expected).abs() < 1e-15 + 1e-14 * expected.abs()
            );
            let off = std::f64::consts::PI * (550.0 / wavelength - f64::from(order));
            let share = if off.abs() < 1e-12 { 1.0 } else { (off.sin() / off).powi(2) };
            assert!((surface.efficiency(wavelength) - share).abs() < 1e-12);
        }
    }
}

#[test]
fn what_is_no_surface_is_refused_in_words() {
    let error = |json: &str| read(json).unwrap_err();
    assert!(error(r#"{"aspheric": {"31": 1}}"#).contains("from 1 to 30"));
    assert!(error(r#"{"hole": 3}"#).contains("\"mirror\": true"));
    assert!(error(r#"{"mirror": true, "glass": "N-BK7"}"#).contains("no glass behind"));
    assert!(
        error(r#"{"sag": [{"type": "zernike", "radius": 1, "coefficients": {"38": 1}}]}"#)
            .contains("sag[0]")
    );
    assert!(
        error(r#"{"sag": [{"type": "q_bfs", "radius": 30, "coefficients": [1]}], "radius": 20}"#)
            .contains("beyond which")
    );
    assert!(
        error(r#"{"sag": [{"type": "zernike", "radius": 1, "coefficents": {}}]}"#)
            .contains("unknown field")
    );
    let both = r#"{"phase": {"pattern": {"type": "grating", "period": 1}, "order": 2, "design_wavelength": 500}}"#;
    assert!(error(both).contains("not both"));
    assert!(
        error(r#"{"phase": {"pattern": {"type": "grating", "period": 0}}}"#)
            .contains("phase.period")
    );
}
