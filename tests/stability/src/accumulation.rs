//! Sums of many samples.

use anyhow::Result;
use etendue_camera::Sampler;

use crate::rendered::Pixels;
use crate::sampling::SAMPLERS;
use crate::{Case, Method, Outcome, Scale};

/// The film.
pub const METHOD: Method = Method {
    name: "Accumulation",
    cases: &[
        Case {
            name: "a_million_samples_of_light",
            regime: "2²⁰ samples in one pixel, of which one in 10⁵ is 10⁸ times as bright as the others",
            must: "the mean is that of the very same samples, counted, to 10⁻⁶ relatively, with every \
                sampler",
            limit: None,
            run: light,
        },
        Case {
            name: "a_million_samples_of_colour",
            regime: "the same in a layer of base colours, 1 and 10⁻⁸, that is averaged over the pixel",
            must: "the mean is that of the very same samples, counted, to 10⁻⁶ relatively",
            limit: None,
            run: colour,
        },
    ],
};

/// End of the bright half of the pixel: samples left of it are bright.
const BRIGHT: f64 = 1e-5;

/// A pixel of 1 m: a sheet in front of another, over the share [`BRIGHT`] of it on the left.
fn scene(tracer: &str, materials: &str, sampler: &str, samples: u32) -> String {
    let (width, x) = (1.0 + BRIGHT, -1.0 + BRIGHT / 2.0);
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}},
        "camera": {{"type": "orthographic", "height": 1,
            "pose": {{"from": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0]}},
            "sensor": {{"resolution": [1, 1]}}}},
        "lights": [],
        "objects": [
            {{"shape": "rectangle", "width": 4, "height": 4, "material": "dim"}},
            {{"shape": "rectangle", "width": {width}, "height": 4, "material": "bright",
              "transform": {{"translate": [{x}, 0, 1]}}}}],
        "materials": {materials},
        "render": {{"samples": {samples}, "sampler": "{sampler}"}}}}"#
    )
}

/// By how much, relatively, the pixel is off the mean of its samples.
fn off(text: &str, sampler: Sampler, samples: u32, [dim, bright]: [f64; 2]) -> Result<(f64, u32)> {
    let pixel = sampler.pixel(0, 0, 0, samples);
    let count = (0..samples).filter(|&i| pixel.square(i, 0)[0] < BRIGHT).count();
    let count = u32::try_from(count)?;
    let sum = bright * f64::from(count) + dim * f64::from(samples - count);
    let mean = sum / f64::from(samples);
    Ok(((Pixels::read(text)?.mean() / mean - 1.0).abs(), count))
}

fn light(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let samples = scale.pick(1 << 18, 1 << 20);
    let materials = r#"{"dim": {"type": "emissive", "radiance": [1, 1, 1]},
        "bright": {"type": "emissive", "radiance": [1e8, 1e8, 1e8]}}"#;
    for (name, sampler) in SAMPLERS {
        let text = scene("direct", materials, name, samples);
        let (off, bright) = off(&text, sampler, samples, [1.0, 1e8])?;
        outcome.must(off <= 1e-6 && bright > 0, || format!("{name}: {off:e}, {bright} bright"));
        outcome.measured(format!("{name}: {off:.0e} off, {bright} of {samples} bright"));
    }
    Ok(outcome)
}

fn colour(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let samples = scale.pick(1 << 18, 1 << 20);
    let materials = r#"{"dim": {"type": "matte", "color": [1e-8, 1e-8, 1e-8]},
        "bright": {"type": "matte", "color": [1, 1, 1]}}"#;
    let text = scene("flat", materials, "sobol", samples);
    let (off, bright) = off(&text, Sampler::Sobol, samples, [1e-8, 1.0])?;
    outcome.must(off <= 1e-6 && bright > 0, || format!("{off:e} off, {bright} bright"));
    outcome.measured(format!("{off:.0e} off, {bright} of {samples} bright"));
    Ok(outcome)
}
