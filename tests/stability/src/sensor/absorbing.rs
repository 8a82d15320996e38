//! Panes that absorb before bands that are wide.

use anyhow::Result;
use etendue_sensor::bands::TOLERANCE;
use etendue_spectrum::{Curve, Illuminant, rgb};
use serde_json::{Value, json};

use crate::rendered::electrons_in_bands;
use crate::{Case, Outcome, Scale};

pub(super) const ABSORBING: Case = Case {
    name: "absorbing_panes",
    regime: "a pane of 1 mm to 3 m, which absorbs to a colour in 0.1 m, before a wall that shines with illuminant A or \
        daylight; pixels that see all of the visible and such as silicon's",
    must: "in the bands that the plan chooses, the share of electrons that is left is that of Bouguer and Lambert's \
        law, summed in steps of 0.1 nm, to 10⁻³, as long as three thousandths are left, which is 3 m",
    limit: None,
    run: absorbing,
};

const SILICON: [[f64; 2]; 6] =
    [[380.0, 0.3], [450.0, 0.6], [530.0, 0.72], [600.0, 0.66], [700.0, 0.45], [780.0, 0.3]];

const COLOURS: [[f64; 3]; 2] = [[0.9, 0.5, 0.3], [0.2, 0.6, 0.95]];

/// To which way (m) a colour is what is left.
const DISTANCE: f64 = 0.1;

fn absorbing(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let all = [1e-3, 0.03, 0.1, 0.3, 0.8, 3.0];
    let lengths: &[f64] = scale.pick(&all[2..5], &all);
    let (mut worst, mut most, mut least) = (0.0_f64, 0, 1.0_f64);
    for (name, light) in [("a", Illuminant::A.curve()?), ("d65", Illuminant::D65.curve()?)] {
        for efficiency in [None, Some(Curve::sampled(SILICON.to_vec())?)] {
            for colour in COLOURS {
                let text = |length: f64| scene(name, efficiency.is_some(), colour, length);
                let (clear, _) = electrons(&text(0.0))?;
                for &length in lengths {
                    let (found, bands) = electrons(&text(length))?;
                    let exact = share_left(&light, efficiency.as_ref(), colour, length);
                    let off = found / clear / exact - 1.0;
                    outcome.must(off.abs() <= TOLERANCE, || {
                        format!(
                            "{name}, {colour:?}, {length} m, {bands} bands, {:.2} % left: {:+.3} %",
                            100.0 * exact,
                            100.0 * off
                        )
                    });
                    least = least.min(exact);
                    (worst, most) = (worst.max(off.abs()), most.max(bands));
                }
            }
        }
    }
    outcome.measured(format!(
        "at most {:.3} % off, in up to {most} bands; {:.2} % are left at least",
        100.0 * worst,
        100.0 * least
    ));
    Ok(outcome)
}

/// The share of a light's electrons behind a way (m) through a medium, by midpoints.
fn share_left(light: &Curve, efficiency: Option<&Curve>, colour: [f64; 3], length: f64) -> f64 {
    let (mut left, mut all) = (0.0, 0.0);
    for step in 0..4_000 {
        let nm = 380.0 + 0.1 * (f64::from(step) + 0.5);
        let seen = efficiency.map_or(1.0, |curve| curve.at(nm).unwrap_or(0.0));
        let electrons = light.at(nm).unwrap_or(0.0) * seen * nm;
        let kept: f64 = (0..3).map(|k| colour[k] * rgb::PRIMARIES[k].held(nm)).sum();
        left += electrons * kept.powf(length / DISTANCE);
        all += electrons;
    }
    left / all
}

/// A shining wall behind a pane of so many metres without surfaces, seen square on; without one for 0.
fn scene(illuminant: &str, is_silicon: bool, colour: [f64; 3], length: f64) -> Value {
    let mut sensor = json!({
        "type": "raw", "radiometry": "physical", "system_gain": 1.0, "noise": "none", "resolution": [4, 4]
    });
    if is_silicon {
        sensor["quantum_efficiency"] = json!(SILICON);
    }
    let mut objects =
        vec![json!({ "shape": "rectangle", "width": 9, "height": 9, "material": "lamp" })];
    if length > 0.0 {
        objects.push(json!({
            "shape": "box", "size": [3, 3, length], "material": "pane",
            "transform": { "translate": [0, 0, 2] }
        }));
    }
    json!({
        "etendue": 1, "objects": objects, "lights": [], "tracer": { "type": "path" },
        "camera": {
            "type": "orthographic", "height": 0.5, "sensor": sensor,
            "pose": { "from": [0, 0, 4], "look_at": [0, 0, 0] }
        },
        "materials": {
            "lamp": { "type": "emissive", "radiance": [1, 1, 1], "illuminant": illuminant },
            "pane": {
                "type": "dielectric", "ior": 1.0, "absorption": { "color": colour, "distance": DISTANCE }
            }
        },
        "render": { "samples": 4 }
    })
}

/// Mean electrons a second of a pixel, and how many bands the plan takes.
fn electrons(text: &Value) -> Result<(f64, usize)> {
    let (channels, bands) = electrons_in_bands(text)?;
    Ok((channels[0], bands))
}
