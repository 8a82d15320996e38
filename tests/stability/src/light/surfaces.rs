//! Surfaces at grazing incidence, and nearly smooth ones.

use anyhow::Result;

use crate::rendered::{Pixels, farthest, patch, scene};
use crate::{Case, Outcome, Scale};

pub(super) const GRAZING: Case = Case {
    name: "grazing_surfaces",
    regime: "white surfaces of each material under a white sky, seen at 60 to 89.9999 degrees from the \
        normal, roughness 0 to 1",
    must: "all numbers are finite and none returns more than falls in, by more than 10⁻³ and 4 standard \
        errors",
    limit: None,
    run: grazing,
};

pub(super) const SMOOTH: Case = Case {
    name: "roughness_to_zero",
    regime: "metal of roughness 0.1 to 10⁻⁸ and 0 before a lamp that fills its highlight, and half of it",
    must: "all numbers are finite; from 10⁻³ on the picture is the mirror's, to 10⁻³ and 4 standard errors",
    limit: None,
    run: smooth,
};

pub(super) const WHITE_METAL: Case = Case {
    name: "white_metal_in_a_furnace",
    regime: "white metal of roughness 0.05 to 1, isotropic and brushed up to an anisotropy of 1, under a white sky, seen \
        along and across the grain at 0 to 88 degrees from the normal",
    must: "it returns what falls in, to 1.5·10⁻² and 4 standard errors: the table of brushed facets is as exact as a \
        hundredth",
    limit: None,
    run: white_metal,
};

pub(super) const COLOURED_PANE: Case = Case {
    name: "sun_through_a_coloured_pane",
    regime: "the sun at 0 to 80 degrees through a coloured pane without thickness, of indices 1.1 to 2.5, onto a white wall",
    must: "the wall shows E cos θ (1 − F) of the pane's colour over π by Fresnel's F, to 10⁻⁶",
    limit: None,
    run: coloured_pane,
};

fn white_metal(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for anisotropy in [0.0, 0.5, 1.0] {
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for roughness in [0.05, 0.1, 0.3, 0.6, 1.0] {
            for (degrees, azimuth) in
                [(0.0_f64, 0.0_f64), (60.0, 20.0), (80.0, 0.0), (80.0, 90.0), (88.0, 45.0)]
            {
                let rest = format!(
                    r#""lights": [{{"type": "environment"}}],
                    "objects": [{{"shape": "rectangle", "width": 900, "height": 900, "material": "m"}}],
                    "materials": {{"m": {{"type": "gltf", "color": [1, 1, 1], "metallic": 1,
                        "roughness": {roughness}, "anisotropy": {anisotropy}}}}}"#
                );
                let ((sin, cos), (y, x)) =
                    (degrees.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
                let eye = [[3.0 * sin * x, 3.0 * sin * y, 3.0 * cos], [0.0; 3]];
                let samples = scale.pick(64, 4_096);
                let text = patch(r#"{"type": "path"}"#, samples, eye, &rest);
                for seen in Pixels::in_both(scene(&text)?)? {
                    let (mean, bound) = (seen.mean(), 1.5e-2 + 4.0 * seen.standard_error());
                    outcome.must((mean - 1.0).abs() <= bound, || {
                        let lobe = format!("roughness {roughness}, anisotropy {anisotropy}");
                        format!("{lobe} at {degrees}, {:?}: {mean}", seen.precision)
                    });
                    (least, most) = (least.min(mean), most.max(mean));
                }
            }
        }
        outcome.measured(format!("anisotropy {anisotropy}: {least:.4} to {most:.4} returns"));
    }
    Ok(outcome)
}

fn coloured_pane(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut worst = 0.0_f64;
    for degrees in [0.0_f64, 30.0, 60.0, 75.0, 80.0] {
        for index in [1.1, 1.5, 2.5] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let rest = format!(
                r#""lights": [{{"type": "directional", "direction": [{sin}, 0, {}], "irradiance": [1, 1, 1]}}],
                "objects": [{{"shape": "rectangle", "width": 1, "height": 1, "material": "wall"}},
                    {{"shape": "rectangle", "width": 90, "height": 90, "material": "pane",
                      "transform": {{"translate": [0, 0, 1]}}}}],
                "materials": {{"wall": {{"type": "matte", "color": [1, 1, 1]}},
                    "pane": {{"type": "gltf", "color": [0.4, 0.6, 0.8], "transmission": 1, "roughness": 0,
                        "ior": {index}}}}}"#,
                -cos
            );
            let (reflected, _) = etendue_tracer::bsdf::fresnel::dielectric(cos, index);
            let known = 0.4 * (1.0 - reflected) * cos / std::f64::consts::PI;
            let eye = [[0.0, 0.2, 0.5], [0.0; 3]];
            for seen in Pixels::in_both(scene(&patch(r#"{"type": "direct"}"#, 4, eye, &rest))?)? {
                let (mean, precision) = (seen.mean(), seen.precision);
                let off = (mean / known - 1.0).abs();
                outcome.must(off <= 1e-6, || {
                    format!("{degrees}°, {index}, {precision:?}: {mean}, not {known}")
                });
                worst = worst.max(off);
            }
        }
    }
    outcome.measured(format!("at most {worst:.1e} off"));
    Ok(outcome)
}

fn materials() -> Vec<(String, String)> {
    let mut all = vec![("matte".to_owned(), r#""type": "matte", "color": [1, 1, 1]"#.to_owned())];
    for roughness in ["0", "0.01", "0.1", "0.5", "1"] {
        let metal = format!(r#""type": "metal", "color": [1, 1, 1], "roughness": {roughness}"#);
        all.push((format!("metal {roughness}"), metal));
        for metallic in ["0", "0.5", "1"] {
            let gltf = format!(
                r#""type": "gltf", "color": [1, 1, 1], "metallic": {metallic}, "roughness": {roughness}"#
            );
            all.push((format!("gltf {metallic} {roughness}"), gltf));
        }
    }
    all
}

fn grazing(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for degrees in [60.0_f64, 85.0, 89.0, 89.9, 89.9999] {
        let (mut most, mut worst) = (0.0_f64, String::new());
        for (name, material) in materials() {
            let rest = format!(
                r#""lights": [{{"type": "environment", "radiance": [1, 1, 1]}}],
                "objects": [{{"shape": "disk", "radius": 1000, "triangles": 4, "material": "m"}}],
                "materials": {{"m": {{{material}}}}}"#
            );
            let (sin, cos) = degrees.to_radians().sin_cos();
            let eye = [[3.0 * sin, 0.0, 3.0 * cos], [0.0; 3]];
            let samples = scale.pick(16, 1_024);
            let text = patch(r#"{"type": "direct"}"#, samples, eye, &rest);
            for seen in Pixels::in_both(scene(&text)?)? {
                let at = format!("{name} at {degrees}, {:?}", seen.precision);
                outcome.must(seen.are_sound(), || format!("{at}: not finite"));
                let bound = 1.001 + 4.0 * seen.standard_error();
                let mean = seen.mean();
                outcome.must(mean <= bound, || format!("{at}: returns {mean}"));
                outcome.must(mean > 0.1, || format!("{at}: returns only {mean}"));
                if mean > most {
                    (most, worst) = (mean, name.clone());
                }
            }
        }
        outcome.measured(format!("{degrees} degrees: at most {most:.4} returns, of {worst}"));
    }
    Ok(outcome)
}

fn smooth(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    // The mirror's direction meets the lamp's middle, or its edge.
    for (what, x) in [("whole", 0.0), ("half", 2.0)] {
        let mirror = 1.0;
        for roughness in ["0.1", "0.01", "1e-3", "1e-4", "1e-6", "1e-8", "0"] {
            let rest = format!(
                r#""lights": [],
                "objects": [{{"shape": "rectangle", "width": 1, "height": 1, "material": "m"}},
                    {{"shape": "rectangle", "width": 4, "height": 4, "material": "lamp",
                      "transform": {{"translate": [{}, 0, 3], "rotate": [0, 1, 0, 180]}}}}],
                "materials": {{
                    "m": {{"type": "metal", "color": [1, 1, 1], "roughness": {roughness}}},
                    "lamp": {{"type": "emissive", "radiance": [1, 1, 1]}}}}"#,
                x + 3.0
            );
            // At 45 degrees from the left; the mirrored ray meets z = 3 at x = 3.
            let eye = [[-2.0, 0.0, 2.0], [0.0; 3]];
            let samples = scale.pick(64, 4_096);
            let both =
                Pixels::in_both(scene(&patch(r#"{"type": "whitted"}"#, samples, eye, &rest))?)?;
            let smooth: f64 = roughness.parse()?;
            let known = if what == "whole" { mirror } else { 0.5 };
            // The facets of a rough highlight lose a little, and the lamp's edge is not quite amid it.
            let bias = if what == "whole" { 1e-3 } else { 2e-2 };
            for seen in &both {
                let at = format!("{what}, {roughness}, {:?}", seen.precision);
                outcome.must(seen.are_sound(), || format!("{at}: not finite"));
                let (mean, error) = (seen.mean(), seen.standard_error());
                let holds = smooth > 1e-3 || (mean - known).abs() <= bias + 4.0 * error;
                outcome.must(holds, || format!("{at}: {mean} ± {error}"));
            }
            if smooth <= 0.01 && what == "whole" {
                outcome.measured(format!("{roughness}: {:.6}", farthest(&both, known)?.mean()));
            }
        }
    }
    Ok(outcome)
}
