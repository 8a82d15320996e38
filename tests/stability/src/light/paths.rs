//! Paths that are rare, and paths that end by chance.

use anyhow::Result;
use etendue_tracer::{Emission, Paint};

use crate::rendered::{Pixels, farthest, patch, scene};
use crate::{Case, Outcome, Scale};

pub(super) const FIREFLIES: Case = Case {
    name: "fireflies",
    regime: "a small lamp that a matte floor sees in a mirror: no light can be asked for along such paths",
    must: "the mean is right within 4 standard errors, no sample counts more than ρ L, nothing is clamped",
    limit: Some(
        "Caustics of small lamps are found by chance alone, so they come as bright pixels that only more \
         samples even out.",
    ),
    run: fireflies,
};

pub(super) const ROULETTE: Case = Case {
    name: "russian_roulette",
    regime: "a closed box whose walls shine by 1 and return 0.05 to 0.95: 1/(1 − ρ), over up to 20 times \
        as many surfaces as a path sees before it may end by chance",
    must: "the mean is right within 4 standard errors",
    limit: None,
    run: roulette,
};

fn fireflies(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    // A lamp of radius 0.05 at (1, 0, 1), and its image behind the mirror z = 2 at (1, 0, 3).
    let rest = r#""lights": [],
        "objects": [{"shape": "rectangle", "width": 0.1, "height": 0.1, "material": "m"},
            {"shape": "sphere", "radius": 0.05, "triangles": 20000, "material": "lamp",
             "transform": {"translate": [1, 0, 1]}},
            {"shape": "rectangle", "width": 40, "height": 40, "material": "mirror",
             "transform": {"translate": [0, 0, 2], "rotate": [0, 1, 0, 180]}}],
        "materials": {"m": {"type": "matte", "color": [0.8, 0.8, 0.8]},
            "mirror": {"type": "mirror", "color": [1, 1, 1]},
            "lamp": {"type": "emissive", "radiance": [1000, 1000, 1000]}}"#;
    // Below the mirror, from the side where the lamp is not.
    let eye = [[-1.0, 0.3, 1.5], [0.0; 3]];
    let samples = scale.pick(4_096, 65_536);
    let tracer = r#"{"type": "path", "max_bounces": 2}"#;
    let both = Pixels::in_both(scene(&patch(tracer, samples, eye, rest))?)?;
    let factor = |d2: f64, cosine: f64| 0.05 * 0.05 / d2 * cosine;
    let direct = 800.0 * factor(2.0, 0.5_f64.sqrt());
    let mirrored = 800.0 * factor(10.0, 3.0 / 10.0_f64.sqrt());
    let known = direct + mirrored;
    for seen in &both {
        let (mean, error, precision) = (seen.mean(), seen.standard_error(), seen.precision);
        outcome.must(seen.are_sound(), || format!("{precision:?}: not finite"));
        // The sphere's triangles cut 3·10⁻⁴ off its outline.
        let holds = (mean - known).abs() <= 4.0 * error + 1e-3 * known;
        outcome.must(holds, || format!("{precision:?}: {mean} ± {error}, not {known}"));
        let most = seen.most();
        outcome.must(most <= 800.0, || format!("{precision:?}: a pixel shows {most}"));
    }
    let seen = farthest(&both, known)?;
    let (mean, error) = (seen.mean(), seen.standard_error());
    // What one sample of a pixel spreads by, over the mean.
    let spread = error * 8.0 * f64::from(samples).sqrt() / mean;
    outcome.measured(format!(
        "{:+.1e} off, ± {:.0e}; one sample spreads by {spread:.0} times the mean; of {samples} samples a \
         pixel the brightest pixel is {:.2} times the mean",
        mean / known - 1.0,
        error / known,
        seen.most() / mean
    ));
    Ok(outcome)
}

fn roulette(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for albedo in [0.05, 0.5, 0.8, 0.95] {
        let bounces = 1024;
        let rest = format!(
            r#""lights": [],
            "objects": [{{"shape": "box", "size": [2, 2, 2], "material": "wall"}}],
            "materials": {{"wall": {{"type": "matte", "color": [{albedo}, {albedo}, {albedo}]}}}}"#
        );
        let tracer = format!(r#"{{"type": "path", "max_bounces": {bounces}}}"#);
        let eye = [[0.2, 0.1, 0.3], [-0.5, -1.0, 0.2]];
        let mut scene = scene(&patch(&tracer, scale.pick(64, 4_096), eye, &rest))?;
        for material in &mut scene.materials {
            let radiance = Paint::Plain([1.0; 3]);
            material.emission = Some(Emission {
                radiance,
                strength: 1.0,
                illuminant: None,
                two_sided: true,
                group: None,
                modulation: None,
            });
        }
        let both = Pixels::in_both(scene)?;
        let known = 1.0 / (1.0 - albedo);
        for seen in &both {
            let at = format!("{albedo}, {:?}", seen.precision);
            let (mean, error) = (seen.mean(), seen.standard_error());
            outcome.must(seen.are_sound(), || format!("{at}: not finite"));
            let holds = (mean - known).abs() <= 4.0 * error;
            outcome.must(holds, || format!("{at}: {mean} ± {error}, not {known}"));
        }
        let seen = farthest(&both, known)?;
        let (off, error) = (seen.mean() / known - 1.0, seen.standard_error() / known);
        outcome.measured(format!("ρ = {albedo}: {off:+.1e} off, ± {error:.0e}"));
    }
    Ok(outcome)
}
