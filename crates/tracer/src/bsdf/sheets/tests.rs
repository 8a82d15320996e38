use etendue_geometry::glam::DVec3;

use super::*;
use crate::bsdf::{Bsdf, Coat, Layered, Model, Sheen};
use crate::sampling::{Frame, power_heuristic};

/// More than a block has, so that all kinds are among them.
const LANES: usize = 64;

type Row = [f64; LANES];

const ZERO: Row = [0.0; LANES];

/// Unit vectors all over the upper half about z.
fn upward(k: usize, steps: [f64; 2]) -> DVec3 {
    let [u, v] = steps.map(|step| (k as f64 * step).fract());
    let z = 0.01 + 0.99 * u;
    let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
    DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
}

fn put(rows: &mut [Row; 3], lane: usize, v: DVec3) {
    (rows[0][lane], rows[1][lane], rows[2][lane]) = v.into();
}

/// Surfaces of the lanes, one by one, with what sets them side by side: their shading and geometric normals, and
/// the directions that they are seen along.
fn laid_out(sheets: &mut Sheets<LANES>) -> (Vec<Bsdf>, [[Row; 3]; 3]) {
    let [mut shading, mut normal, mut direction] = [[ZERO; 3]; 3];
    let surface = |k: usize| {
        let share = |step: f64| (0.3 + k as f64 * step).fract();
        let alpha = [1e-4, 0.01, 0.2, 0.7, 1.0][k % 5];
        let base = [share(0.37), share(0.73), share(0.19)];
        let is_metal = k.is_multiple_of(3);
        let metallic = if is_metal { 1.0 } else { [0.0, 0.3, 1.0][k / 3 % 3] };
        let (f0, f90) = if is_metal { (0.0, 0.0) } else { (0.04, [1.0, 0.6][k % 2]) };
        let highlight = if is_metal { [1.0; 3] } else { [1.0, 2.0, 0.5] };
        let layered = Layered {
            metallic,
            alpha,
            along: alpha,
            f0,
            f90,
            ior: 1.5,
            transmission: 0.0,
            sheen: Sheen::default(),
            coat: Coat::default(),
        };
        let model = match is_metal {
            true => Model::Metal { alpha, named: None },
            false => Model::Layered(layered),
        };
        let z = shading_normal(k);
        let wo = Frame::around(z).world(upward(k, [0.41, 0.29]));
        let geometric = (z + 0.2 * wo).normalize();
        put(&mut shading, k, z);
        put(&mut normal, k, geometric);
        put(&mut direction, k, -wo);
        let peak = |c: [f64; 3]| c[0].max(c[1]).max(c[2]);
        (sheets.alpha[k], sheets.metallic[k]) = (alpha, metallic);
        (sheets.f0[k], sheets.f90[k]) = (f0, f90);
        sheets.base_peak[k] = peak(base);
        sheets.f0_peak[k] = (f0 * peak(highlight)).min(1.0);
        sheets.is_metal[k] = if is_metal { 1.0 } else { 0.0 };
        Bsdf::new(model, [geometric, z], wo, [base, highlight])
    };
    let surfaces = (0..LANES).map(surface).collect();
    (surfaces, [shading, normal, direction])
}

fn shading_normal(k: usize) -> DVec3 {
    upward(k, [0.618, 0.755]) * if k.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// Side by side as one by one: values, densities and directions, of metals and glTF's surfaces of all
/// roughnesses, for directions on both sides.
#[test]
fn side_by_side_as_one_by_one() {
    let mut sheets = Sheets::<LANES>::default();
    let (surfaces, [shading, normal, direction]) = laid_out(&mut sheets);
    let (mut toward, pdf, mut is_delta) = ([ZERO; 3], [0.7; LANES], ZERO);
    let (mut choices, mut squares) = (ZERO, [[0.0; 2]; LANES]);
    for k in 0..LANES {
        let share = |step: f64| (0.3 + k as f64 * step).fract();
        let side = if k.is_multiple_of(7) { -1.0 } else { 1.0 };
        let frame = Frame::around(shading_normal(k));
        put(&mut toward, k, frame.world(upward(k, [0.57, 0.83])) * side);
        is_delta[k] = if k.is_multiple_of(4) { 1.0 } else { 0.0 };
        (choices[k], squares[k]) = (share(0.07), [share(0.53), share(0.21)]);
    }
    // Some hundred roundings, magnified by what is lacking of 1 in highlights of α 10⁻⁴.
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-7 * (a.abs() + b.abs() + 1e-9);
    let alike = |a: Weights, b: Weights| {
        near(a.white, b.white)
            && near(a.base, b.base)
            && near(a.highlight, b.highlight)
            && near(a.dip, b.dip)
            && near(a.deep, b.deep)
    };
    sheets.view(&shading, &direction);
    let mut found = ZERO;
    let samples = LightSamples { toward: &toward, pdf: &pdf, is_delta: &is_delta };
    sheets.reflect([&normal, &shading], samples, &mut found);
    let mut lit = 0;
    for (k, surface) in surfaces.iter().enumerate() {
        let wi = DVec3::new(toward[0][k], toward[1][k], toward[2][k]);
        let (weights, own) = surface.evaluate(wi);
        let balance = if is_delta[k] > 0.0 { 1.0 } else { power_heuristic(pdf[k], own) };
        let expected = if weights.is_zero() { 0.0 } else { balance / pdf[k] };
        assert!(near(found[k], expected), "{k}: {} {expected}", found[k]);
        if expected > 0.0 {
            lit += 1;
            assert!(alike(sheets.weights(k), weights), "{k}: {:?} {weights:?}", sheets.weights(k));
            assert!(near(surface.mean_albedo(), sheets.mean[k]) || weights.deep == 0.0);
        }
    }
    assert!((40..LANES).contains(&lit), "{lit}");
    let (mut along, mut density) = ([ZERO; 3], ZERO);
    sheets.scatter([&normal, &shading], &choices, &squares, &mut along, &mut density);
    let mut sent = 0;
    for (k, surface) in surfaces.iter().enumerate() {
        let Some(sample) = surface.sample(choices[k], squares[k]) else {
            assert_eq!(density[k], 0.0, "{k}");
            continue;
        };
        sent += 1;
        let direction = DVec3::new(along[0][k], along[1][k], along[2][k]);
        assert!((direction - sample.direction).length() < 1e-12, "{k}");
        assert!(near(density[k], sample.pdf), "{k}: {} {}", density[k], sample.pdf);
        assert!(alike(sheets.weights(k), sample.weights), "{k}");
    }
    assert!(sent > 50, "{sent}");
}
