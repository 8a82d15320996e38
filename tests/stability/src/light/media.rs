//! Bodies that light goes through: thin ones, and those in one another.

use anyhow::Result;
use etendue_scene::file::LightPrecision;

use crate::rendered::{Pixels, patch, scene};
use crate::{Case, Outcome, Scale};

pub(super) const THIN: Case = Case {
    name: "thin_where_light_goes_through",
    regime: "a tinted pane 10 µm to 1 m thick, turned by 35°, between two boxes 200 m apart, at the origin and 20, 100 \
        and 1000 m away",
    must: "what the plan takes shows what f64 does, to 10⁻³",
    limit: None,
    run: thin,
};

pub(super) const NESTED: Case = Case {
    name: "bodies_in_bodies",
    regime: "glass, water and air in glass, overlapping and touching, before a wall of radiance 1, face on to 60°",
    must: "what parallel layers let pass, to 10⁻³ and 4 standard errors",
    limit: None,
    run: nested,
};

pub(super) const WITHIN: Case = Case {
    name: "camera_within_a_body",
    regime: "a camera in the middle of a body that absorbs, 10⁻² to 10³ m from its faces and leaving half or a thousandth of \
        the light, and of one within another, at the origin and 100 m away",
    must: "Bouguer and Lambert's law from the camera on, to 10⁻⁵",
    limit: None,
    run: within,
};

fn within(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut worst = 0.0_f64;
    for way in [1e-2, 1.0, 1e3] {
        for left in [0.5_f64, 1e-3] {
            for at in [0.0, 100.0] {
                let body = |side: f64, material: &str| {
                    format!(
                        r#"{{"shape": "box", "size": [{side}, {side}, {side}], "material": "{material}",
                            "transform": {{"translate": [{at}, {at}, {at}]}}}}"#
                    )
                };
                let (outer, inner) = (body(2.0 * way, "outer"), body(way, "inner"));
                let stacks = [
                    (outer.clone(), left),
                    (format!("{outer}, {inner}"), left.sqrt() * left),
                    (format!("{inner}, {outer}"), left.sqrt() * left),
                ];
                for (objects, known) in stacks {
                    let medium = |name: &str, left: f64| {
                        format!(
                            r#""{name}": {{"type": "dielectric", "ior": 1.0,
                                "absorption": {{"color": [{left}, {left}, {left}], "distance": {way}}}}}"#
                        )
                    };
                    // Half a way of the inner one leaves what a whole one of the outer does.
                    let rest = format!(
                        r#""lights": [{{"type": "environment"}}], "objects": [{objects}], "materials": {{{}, {}}}"#,
                        medium("outer", left),
                        medium("inner", left * left)
                    );
                    let eye = [[at; 3], [at, at, at - 3.0 * way]];
                    let text = patch(r#"{"type": "path"}"#, 1, eye, &rest);
                    for seen in Pixels::where_planned(scene(&text)?)? {
                        let (mean, precision) = (seen.mean(), seen.precision);
                        let off = (mean / known - 1.0).abs();
                        outcome.must(off <= 1e-5, || {
                            format!("{way} m at {at} m, {left}, {precision:?}: {mean}, not {known}")
                        });
                        worst = worst.max(off);
                    }
                }
            }
        }
    }
    outcome.measured(format!("at most {worst:.1e} off"));
    Ok(outcome)
}

fn thin(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut worst = 0.0_f64;
    for thickness in [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0] {
        for at in [0.0, 20.0, 100.0, 1000.0] {
            let text = patch(
                r#"{"type": "path"}"#,
                scale.pick(16, 1_024),
                [[at, at, at + 3.0], [at; 3]],
                &format!(
                    r#""lights": [{{"type": "environment"}}], "objects": [
                        {{"shape": "box", "size": [3, 3, {thickness}], "material": "pane",
                          "transform": {{"translate": [{at}, {at}, {at}], "rotate": [0, 1, 0, 35]}}}},
                        {{"shape": "box", "size": [9, 9, 9], "material": "grey", "transform": {{"translate": [-100, 0, 0]}}}},
                        {{"shape": "box", "size": [9, 9, 9], "material": "grey", "transform": {{"translate": [100, 0, 0]}}}}],
                    "materials": {{"grey": {{"type": "matte", "color": [0.5, 0.5, 0.5]}},
                        "pane": {{"type": "dielectric", "color": [0.5, 0.5, 0.5]}}}}"#
                ),
            );
            let seen = |precision: LightPrecision| {
                let mut scene = scene(&text)?;
                scene.plan.light_precision = precision;
                anyhow::Ok(Pixels::of(&scene)?.mean())
            };
            let ratio = seen(LightPrecision::Auto)? / seen(LightPrecision::Double)? - 1.0;
            worst = worst.max(ratio.abs());
            outcome.must(ratio.abs() < 1e-3, || format!("{thickness} m at {at} m: {ratio:+.1e}"));
        }
    }
    outcome.measured(format!("at most {worst:.1e}"));
    Ok(outcome)
}

fn nested(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let block = |size: [f64; 3], z: f64, material: &str| {
        format!(
            r#"{{"shape": "box", "size": {size:?}, "material": "{material}", "transform": {{"translate": [0, 0, {z}]}}}}"#
        )
    };
    let outer = block([40.0, 40.0, 1.0], 0.0, "glass");
    let stacks: [(&str, String, &[f64]); 5] = [
        ("glass in glass", block([30.0, 30.0, 0.4], 0.1, "same"), &[1.5]),
        ("water in glass", block([30.0, 30.0, 0.4], 0.1, "water"), &[1.5, 1.33, 1.5]),
        ("air in glass", block([30.0, 30.0, 0.4], 0.1, "air"), &[1.5, 1.0, 1.5]),
        ("water over glass", block([40.0, 40.0, 0.5], 0.7, "water"), &[1.33, 1.5]),
        ("water on glass", block([40.0, 40.0, 0.5], 0.75, "water"), &[1.33, 1.5]),
    ];
    let mut worst = 0.0_f64;
    for degrees in [0.0_f64, 30.0, 60.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        for (name, inner, indices) in &stacks {
            let rest = format!(
                r#""lights": [], "objects": [{outer}, {inner}, {{"shape": "rectangle", "width": 90, "height": 90,
                    "material": "lamp", "transform": {{"translate": [0, 0, -2]}}}}],
                "materials": {{"lamp": {{"type": "emissive", "radiance": [1, 1, 1]}},
                    "glass": {{"type": "dielectric", "ior": 1.5}}, "same": {{"type": "dielectric", "ior": 1.5}},
                    "water": {{"type": "dielectric", "ior": 1.33}}, "air": {{"type": "dielectric", "ior": 1.0}}}}"#
            );
            let samples = scale.pick(64, 4_096);
            let eye = [[3.0 * sin, 0.0, 3.0 * cos], [0.0; 3]];
            let both = Pixels::in_both(scene(&patch(r#"{"type": "path"}"#, samples, eye, &rest))?)?;
            // Boundaries of reflectances Rᵢ without loss: (1 − T)/T = Σ Rᵢ/(1 − Rᵢ).
            let (mut sum, mut before) = (0.0, 1.0);
            for &index in indices.iter().chain(&[1.0]) {
                let inside = (1.0 - (sin / before) * (sin / before)).sqrt();
                let (r, _) = etendue_tracer::bsdf::fresnel::dielectric(inside, index / before);
                sum += r / (1.0 - r);
                before = index;
            }
            let known = 1.0 / (1.0 + sum);
            for seen in both {
                let (shown, precision) = (seen.mean(), seen.precision);
                worst = worst.max((shown - known).abs());
                let bound = 1e-3 + 4.0 * seen.standard_error();
                outcome.must((shown - known).abs() <= bound, || {
                    format!("{name} at {degrees}°, {precision:?}: {shown:.5}, not {known:.5}")
                });
            }
        }
    }
    outcome.measured(format!("at most {worst:.1e} off"));
    Ok(outcome)
}
