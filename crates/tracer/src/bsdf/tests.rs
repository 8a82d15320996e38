use std::f64::consts::{PI, TAU};

use etendue_spectrum::Metal;

use super::*;
use crate::Color;

const WHITE: Color = [1.0; 3];

fn bsdf(model: Model, cos_theta: f64) -> Bsdf {
    let wo = DVec3::new((1.0 - cos_theta * cos_theta).sqrt(), 0.0, cos_theta);
    Bsdf::new(model, [DVec3::Z, DVec3::Z], wo, [WHITE, WHITE])
}

fn layered(metallic: f64, roughness: f64, transmission: f64) -> Model {
    let alpha = roughness * roughness;
    let (sheen, coat) = (Sheen::default(), Coat::default());
    let (along, f0, f90, ior) = (alpha, 0.04, 1.0, 1.5);
    Model::Layered(Layered { metallic, alpha, along, f0, f90, ior, transmission, sheen, coat })
}

fn all() -> Vec<(&'static str, Model)> {
    let mut models = Vec::new();
    for eta in [1.5, 1.0 / 1.5, 1.0] {
        models.push(("glass", Model::Dielectric { alpha: 0.0, eta }));
        if eta != 1.0 {
            for alpha in [0.09, 0.4, 1.0] {
                models.push(("frosted glass", Model::Dielectric { alpha, eta }));
            }
        }
    }
    for roughness in [0.0_f64, 0.05, 0.3, 0.7, 1.0] {
        let alpha = roughness * roughness;
        models.push(("metal", Model::Metal { alpha, named: None }));
        for metallic in [0.0, 0.4, 1.0] {
            models.push(("gltf", layered(metallic, roughness, 0.0)));
        }
        models.push(("wall", layered(0.0, roughness, 0.7)));
    }
    let Model::Layered(below) = layered(0.0, 0.3, 0.3) else { return models };
    models.push(("shiny", Model::Layered(Layered { f0: 0.8, ..below })));
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        let sheen = Sheen { color: WHITE.into(), roughness };
        for (metallic, transmission, coat) in [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.6, 0.7)] {
            let Model::Layered(below) = layered(metallic, 0.7, transmission) else { continue };
            if transmission > 0.0 && roughness < 0.25 {
                // At grazing angles nothing at all passes, and samples without weight are left out.
                continue;
            }
            let coat = Coat { share: coat, alpha: 0.16 };
            models.push(("sheen", Model::Layered(Layered { sheen, coat, ..below })));
        }
    }
    for (along, alpha) in [(0.8, 0.1), (0.1, 0.8), (0.4, 0.15)] {
        for (metallic, transmission) in [(1.0, 0.0), (0.0, 0.0), (0.0, 0.7)] {
            let Model::Layered(below) = layered(metallic, 0.5, transmission) else { continue };
            models.push(("brushed", Model::Layered(Layered { along, alpha, ..below })));
        }
    }
    for (share, roughness) in [(1.0, 0.4), (0.5, 0.8)] {
        for (metallic, transmission) in [(1.0, 0.0), (0.0, 0.0), (0.3, 0.6)] {
            let Model::Layered(below) = layered(metallic, 0.7, transmission) else { continue };
            let coat = Coat { share, alpha: roughness * roughness };
            models.push(("coated", Model::Layered(Layered { coat, ..below })));
        }
    }
    models
}

fn total(w: Weights) -> f64 {
    w.white + w.base + w.highlight + w.deep + w.sheen
}

/// Metal of reflectance 1 returns all light at every roughness: what facets send to one another comes
/// out. Integrated over the hemisphere. The table of albedos is exact to 1e-3, which both directions are
/// short of, against a mean that lacks 0.06 and more.
#[test]
fn white_metal_returns_all_light() {
    let n = 400;
    for roughness in [0.4_f64, 0.7, 1.0] {
        let alpha = roughness * roughness;
        let metal = Model::Metal { alpha, named: None };
        for model in [metal, layered(1.0, roughness, 0.0)] {
            for cosine in [1.0, 0.6, 0.2, 0.05] {
                let surface = bsdf(model, cosine);
                let mut sum = 0.0;
                for [u, v] in grid(n) {
                    let phi = std::f64::consts::TAU * v;
                    let z = 1.0 - (1.0 - u) * (1.0 - u);
                    let r = (1.0 - z * z).sqrt();
                    let wi = DVec3::new(r * phi.cos(), r * phi.sin(), z);
                    sum += total(surface.evaluate(wi).0) * 2.0 * (1.0 - u);
                }
                let albedo = sum / f64::from(n * n) * std::f64::consts::TAU;
                assert!((albedo - 1.0).abs() < 6e-3, "{model:?} at {cosine}: {albedo}");
            }
        }
    }
}

/// The fit to a measured metal's reflectance is within 0.05 of Fresnel's at every angle.
#[test]
fn measured_metals_follow_fresnel() {
    for named in Metal::ALL {
        for nm in [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0] {
            let at = |cosine| named.reflectance(cosine).held(nm);
            let (face_on, second) = (at(1.0), at(metal::SECOND_COSINE));
            let dip = metal::dip(face_on, second);
            let (mut mean, steps) = (0.0, 400);
            for k in 0..steps {
                let cosine = (f64::from(k) + 0.5) / f64::from(steps);
                let fit = metal::facets(cosine);
                let fit = fit.white + fit.base * face_on + fit.dip * dip;
                let known = at(cosine);
                assert!((fit - known).abs() < 0.05, "{named:?} {nm} {cosine}: {fit} {known}");
                mean += 2.0 * cosine * known / f64::from(steps);
            }
            assert!((metal::mean_reflectance(face_on, dip) - mean).abs() < 0.01, "{named:?}");
        }
    }
}

/// Tests whether its lobe is finer than cells of a hemisphere.
fn is_narrow(model: Model) -> bool {
    matches!(model, Model::Metal { alpha, .. } if alpha < 0.01)
        || matches!(model, Model::Layered(l) if l.alpha.min(l.along) < 0.01)
}

/// Points of a square grid.
fn grid(n: u32) -> impl Iterator<Item = [f64; 2]> {
    let at = move |k: u32| (f64::from(k) + 0.5) / f64::from(n);
    (0..n * n).map(move |k| [at(k % n), at(k / n)])
}

/// Steps of an additive recurrence in three dimensions (M. Roberts, *The unreasonable effectiveness of
/// quasirandom sequences*, 2018).
const R3: [f64; 3] = [0.819_172_513_396_164, 0.671_043_606_703_789, 0.549_700_477_901_960];

/// A white surface returns no more than falls in: the mean weight of its own sampling is the albedo.
#[test]
fn energy_is_conserved() {
    for (name, model) in all() {
        for cosine in [1.0, 0.8, 0.5, 0.2, 0.05, 0.01] {
            let surface = bsdf(model, cosine);
            let (mut sum, n) = (0.0, 1 << 17);
            for k in 0..n {
                let [choice, u, v] = R3.map(|step| (0.5 + step * f64::from(k)).fract());
                let Some(s) = surface.sample(choice, [u, v]) else { continue };
                // A boundary compresses radiance, not power: its own factor is undone.
                let compressed = match model {
                    Model::Dielectric { eta, .. } if s.direction.z < 0.0 => eta * eta,
                    _ => 1.0,
                };
                sum += total(s.weights) * compressed;
            }
            let albedo = sum / f64::from(n);
            // Of surfaces that return all of it the points make an error of a few 1e-4.
            assert!(albedo <= 1.0 + 1e-3, "{name} {model:?} at {cosine}: {albedo}");
        }
    }
}

/// The same by integration of the value over the hemispheres, for models without single directions:
/// no more than 1 + 1e-3.
#[test]
fn values_integrate_to_no_more_than_one() {
    for (name, model) in all() {
        for cosine in [1.0, 0.5, 0.15, 0.05] {
            let surface = bsdf(model, cosine);
            if surface.is_delta() {
                continue;
            }
            // As above.
            let compressed = |side: f64| match model {
                Model::Dielectric { eta, .. } if side < 0.0 => eta * eta,
                _ => 1.0,
            };
            let mut sum = 0.0;
            let n = 400;
            // cos θ and φ, midpoint rule; squares of the cosine resolve grazing directions.
            for [u, v] in grid(n) {
                let phi = std::f64::consts::TAU * v;
                let z = 1.0 - (1.0 - u) * (1.0 - u);
                let r = (1.0 - z * z).sqrt();
                for side in [1.0, -1.0] {
                    let wi = DVec3::new(r * phi.cos(), r * phi.sin(), side * z);
                    let value = total(surface.evaluate(wi).0) * compressed(side);
                    sum += value * 2.0 * (1.0 - u);
                }
            }
            let albedo = sum / f64::from(n * n) * std::f64::consts::TAU;
            // Lobes narrower than the grid's cells are integrated by their own sampling above.
            let narrow = is_narrow(model);
            if !narrow {
                assert!(albedo <= 1.0 + 1e-3, "{name} {model:?} at {cosine}: {albedo}");
            }
        }
    }
}

/// f(wo, wi) = f(wi, wo).
#[test]
fn values_are_reciprocal() {
    for (name, model) in all() {
        for [u, v] in grid(9) {
            for side in [1.0, -1.0] {
                let z = 0.02 + 0.97 * u;
                let wi = DVec3::new(
                    (1.0 - z * z).sqrt() * (6.0 * v).cos(),
                    (1.0 - z * z).sqrt() * (6.0 * v).sin(),
                    side * z,
                );
                let cosine: f64 = 0.3;
                let wo = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
                let value = |a: DVec3, b: DVec3| {
                    // Seen from below the wall is turned over, and so is glass.
                    let up = a.z.signum() * DVec3::Z;
                    let model = match model {
                        Model::Dielectric { alpha, eta } if a.z < 0.0 => {
                            Model::Dielectric { alpha, eta: 1.0 / eta }
                        }
                        other => other,
                    };
                    let s = Bsdf::new(model, [up, up], a, [WHITE, WHITE]);
                    total(s.evaluate(b).0) / b.z.abs()
                };
                // Radiance is compressed by the square of the index (Veach 1997, equation 5.14).
                let compressed = match model {
                    Model::Dielectric { eta, .. } if wi.z < 0.0 => eta * eta,
                    _ => 1.0,
                };
                let (there, back) = (value(wo, wi) * compressed, value(wi, wo));
                // A few dozen roundings, and cancellation in the half vector's cosine.
                let bound = 1e-9 * there.max(back).max(1e-12);
                assert!((there - back).abs() <= bound, "{name} {model:?}: {there} {back}");
            }
        }
    }
}

/// χ² of sampled directions against the density that `evaluate` states, over cells of equal solid
/// angle on the sphere; and the sample's own density and weight against `evaluate`.
#[test]
fn sampling_has_the_density_it_states() {
    const ROWS: usize = 16;
    const COLUMNS: usize = 24;
    for (name, model) in all() {
        for cosine in [0.9, 0.35] {
            let surface = bsdf(model, cosine);
            if surface.is_delta() {
                continue;
            }
            #[expect(clippy::cast_possible_truncation, reason = "a cell's number")]
            let cell = |w: DVec3| {
                let row = ((1.0 - w.z) / 2.0 * ROWS as f64).clamp(0.0, ROWS as f64 - 1.0);
                let phi = w.y.atan2(w.x).rem_euclid(std::f64::consts::TAU);
                let column = (phi / std::f64::consts::TAU * COLUMNS as f64) as usize;
                row as usize * COLUMNS + column.min(COLUMNS - 1)
            };
            let n: u32 = 200_000;
            let mut counts = vec![0.0_f64; ROWS * COLUMNS];
            let mut state = 0x1234_5678_9abc_def1_u64;
            let mut random = || {
                // xorshift*: Vigna 2016.
                state ^= state >> 12;
                state ^= state << 25;
                state ^= state >> 27;
                (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
            };
            for _ in 0..n {
                let Some(s) = surface.sample(random(), [random(), random()]) else { continue };
                if s.is_specular {
                    continue;
                }
                let (value, pdf) = surface.evaluate(s.direction);
                assert!((pdf / s.pdf - 1.0).abs() < 1e-6, "{name} {model:?}");
                assert!((total(value) / pdf / total(s.weights) - 1.0).abs() < 1e-6);
                counts[cell(s.direction)] += 1.0;
            }
            // Expected counts by the midpoint rule on a finer grid. Refraction ends within cells, where
            // no facet points upwards that would send light there: finer, and at random within.
            let glass = matches!(model, Model::Dielectric { .. });
            let fine = if glass { 48 } else { 12 };
            let mut expected = vec![0.0_f64; ROWS * COLUMNS];
            for row in 0..ROWS * fine {
                for column in 0..COLUMNS * fine {
                    let [down, across] = if glass { [random(), random()] } else { [0.5; 2] };
                    let z = 1.0 - 2.0 * (row as f64 + down) / (ROWS * fine) as f64;
                    let phi = TAU * (column as f64 + across) / (COLUMNS * fine) as f64;
                    let r = (1.0 - z * z).sqrt();
                    let w = DVec3::new(r * phi.cos(), r * phi.sin(), z);
                    let area = 4.0 * PI / (ROWS * COLUMNS * fine * fine) as f64;
                    expected[row / fine * COLUMNS + column / fine] +=
                        surface.evaluate(w).1 * area * f64::from(n);
                }
            }
            let narrow = is_narrow(model);
            if narrow {
                // The lobe is finer than the cells of the expectation.
                continue;
            }
            let (mut chi2, mut freedom) = (0.0, 0.0);
            let (mut few_seen, mut few_expected) = (0.0, 0.0);
            for (seen, wanted) in counts.iter().zip(&expected) {
                if *wanted < 10.0 {
                    few_seen += seen;
                    few_expected += wanted;
                } else {
                    chi2 += (seen - wanted).powi(2) / wanted;
                    freedom += 1.0;
                }
            }
            if few_expected > 10.0 {
                chi2 += (few_seen - few_expected).powi(2) / few_expected;
                freedom += 1.0;
            }
            // χ² has mean ν and variance 2 ν: five standard deviations.
            let bound = freedom + 5.0 * (2.0_f64 * freedom).sqrt();
            assert!(chi2 < bound, "{name} {model:?} at {cosine}: {chi2} > {bound}");
        }
    }
}

/// The albedo of a white sheen, integrated on another grid in Python from the formulas of the extension: 800 × 400
/// directions in √μ and azimuth. Roughnesses below 0.25 return more than falls in by them, at grazing
/// angles.
#[test]
fn sheen_returns_what_its_formula_says() {
    let known = [
        (1.0, 1.0, 0.1638),
        (1.0, 0.4, 0.4176),
        (0.7, 0.1, 0.6512),
        (0.5, 0.4, 0.2468),
        (0.3, 0.2, 0.3407),
        (0.15, 0.03, 1.0),
    ];
    for (roughness, cosine, albedo) in known {
        let Model::Layered(below) = layered(0.0, 0.5, 0.0) else { continue };
        let sheen = Sheen { color: WHITE.into(), roughness };
        let surface = bsdf(Model::Layered(Layered { sheen, ..below }), cosine);
        let (mut sum, n) = (0.0, 500);
        for [u, v] in grid(n) {
            let (phi, z) = (TAU * v, u * u);
            let r = (1.0 - z * z).sqrt();
            let wi = DVec3::new(r * phi.cos(), r * phi.sin(), z);
            sum += surface.evaluate(wi).0.sheen * 2.0 * u;
        }
        let found = sum / f64::from(n * n) * TAU;
        let what = format!("{roughness} at {cosine}: {found}");
        if albedo < 1.0 {
            // The grids differ by 2e-4.
            assert!((found - albedo).abs() < 1e-3, "{what}");
        } else {
            assert!(found > 0.85 && found <= 1.0, "{what}");
        }
    }
}

/// Brushed facets are spread along x as sheets of the one roughness are and along y as those of the other.
#[test]
fn anisotropic_facets_have_both_roughnesses() {
    let (along, across) = (0.6, 0.1);
    let both = ggx::Facets { x: along, y: across };
    for tilt in [0.05_f64, 0.2, 0.5] {
        let (sin, cos) = tilt.sin_cos();
        // Slopes along one axis are distributed as of that roughness, but for the other's share of the density.
        let [x, y] = [DVec3::new(sin, 0.0, cos), DVec3::new(0.0, sin, cos)];
        let ratio = |h, alpha: f64, other| {
            ggx::distribution(h, both) / ggx::distribution(h, alpha) * other / alpha
        };
        assert!((ratio(x, along, across) - 1.0).abs() < 1e-12);
        assert!((ratio(y, across, along) - 1.0).abs() < 1e-12);
        assert!((ggx::masking(x, both) / ggx::masking(x, along) - 1.0).abs() < 1e-12);
        assert!((ggx::masking(y, both) / ggx::masking(y, across) - 1.0).abs() < 1e-12);
    }
}

/// Rough glass returns all light to both sides together: what facets send to one another comes out. Integrated over
/// the sphere; of what is lacking a hundredth is not taken for lacking, and the table is as exact.
#[test]
fn rough_glass_keeps_its_energy() {
    let n = 400;
    for (roughness, eta) in
        [0.5_f64, 0.8, 1.0].into_iter().flat_map(|r| [(r, 1.5), (r, 1.0 / 1.5), (r, 1.33)])
    {
        let model = Model::Dielectric { alpha: roughness * roughness, eta };
        for cosine in [1.0, 0.6, 0.2, 0.05] {
            let surface = bsdf(model, cosine);
            let mut sum = 0.0;
            for [u, v] in grid(n) {
                let (phi, z) = (TAU * v, 1.0 - (1.0 - u) * (1.0 - u));
                let r = (1.0 - z * z).sqrt();
                for (side, compressed) in [(1.0, 1.0), (-1.0, eta * eta)] {
                    let wi = DVec3::new(r * phi.cos(), r * phi.sin(), side * z);
                    sum += total(surface.evaluate(wi).0) * compressed * 2.0 * (1.0 - u);
                }
            }
            let albedo = sum / f64::from(n * n) * TAU;
            assert!(albedo > 0.97 && albedo <= 1.001, "{roughness} {eta} at {cosine}: {albedo}");
        }
    }
}
