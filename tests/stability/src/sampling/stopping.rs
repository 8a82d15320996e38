//! Samples that stop, and light that few of them find.

use anyhow::Result;
use serde_json::{Value, json};

use crate::rendered::{Pixels, load};
use crate::{Case, Outcome, Scale};

pub(super) const BEHIND_GLASS: Case = Case {
    name: "samples_that_stop_behind_glass",
    regime: "a ball of glass before a wall under a lamp and a sky, by samples that stop at a relative error of a \
        tenth, with one seed after the other",
    must: "the variance that the program tells is within a factor of 1.5 of the squared difference to a converged \
        picture, and the mean is not bent by more than four of its standard errors",
    limit: Some(
        "A block stops by what its neighbours and the other half of its pixels say. Behind glass, where a few paths \
         carry much, single blocks stop too early: the picture's note counts them.",
    ),
    run: behind_glass,
};

pub(super) const SPARKLES: Case = Case {
    name: "light_that_few_samples_find",
    regime: "a lamp of radius 1 m down to 0.1 m over a ball of glass, whose light reaches the floor behind the ball by \
        paths that nothing can be asked for along; 64 samples, eight seeds",
    must: "where the means of seeds differ by more than 0.5 %, most of the pictures say that a handful of samples \
        carries them; where they differ by less than 0.2 %, none does",
    limit: Some(
        "Such light takes bidirectional methods, which there are none of: the note says how much it is. Of a lamp that \
         is smaller still most pictures find nothing, and so say nothing.",
    ),
    run: sparkles,
};

/// A ball of glass over a floor, under a lamp of this radius (m) that shines 1/radius² and a sky.
fn glass(radius: f64, samples: &Value) -> Value {
    let layers = if samples.is_object() { json!(["variance"]) } else { json!([]) };
    json!({
        "etendue": 1, "tracer": { "type": "path", "max_bounces": 5 }, "layers": layers,
        "camera": { "type": "pinhole", "fov": 40, "pose": { "from": [0, 2, 3], "look_at": [0, 0.3, 0] },
            "sensor": { "resolution": [32, 32] } },
        "lights": [{ "type": "environment", "radiance": [0.2, 0.2, 0.2] }],
        "objects": [
            { "shape": "rectangle", "width": 9, "height": 9, "material": "floor",
              "transform": { "rotate": [1, 0, 0, -90] } },
            { "shape": "sphere", "radius": 0.5, "triangles": 2000, "material": "glass",
              "transform": { "translate": [0, 0.7, 0] } },
            { "shape": "sphere", "radius": radius, "triangles": 320, "material": "lamp",
              "transform": { "translate": [0, 5, 0] } },
        ],
        "materials": { "floor": { "type": "matte", "color": [0.5, 0.5, 0.5] }, "glass": { "type": "dielectric" },
            "lamp": { "type": "emissive", "radiance": [3.0 / radius.powi(2), 3.0 / radius.powi(2), 3.0 / radius.powi(2)] } },
        "render": { "samples": samples },
    })
}

fn rendered(scene: &Value, seeds: u64) -> Result<Vec<Pixels>> {
    let folder = tempfile::tempdir()?;
    let mut scene = load(folder.path(), &scene.to_string())?;
    let one = |seed| {
        scene.render.seed = seed;
        Pixels::of(&scene)
    };
    (0..seeds).map(one).collect()
}

/// The mean of some numbers, and the standard deviation of one of them.
fn mean_and_spread(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    [mean, (squares / (count - 1.0)).sqrt()]
}

fn behind_glass(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let seeds = scale.pick(4, 32);
    let converged = rendered(&glass(1.0, &json!(scale.pick(4_096, 32_768))), 1)?;
    let stopping = json!({ "relative_error": 0.1, "min": 8, "max": 4096 });
    let pictures = rendered(&glass(1.0, &stopping), seeds)?;
    let (mut told, mut found, mut over) = (0.0, 0.0, 0);
    for picture in &pictures {
        let pairs = picture.values.iter().zip(&converged[0].values);
        found += pairs.map(|(value, exact)| (value - exact).powi(2)).sum::<f64>();
        told += picture.variances.iter().sum::<f64>();
        over += u32::from(
            picture.notes.iter().any(|note| note.contains("stopped with more than twice")),
        );
        outcome.must(picture.are_sound(), || "a pixel is no number".to_owned());
    }
    outcome.measured(format!(
        "the error told is {:.3} times that found; {over} of {seeds} pictures tell of blocks that stopped early",
        (told / found).sqrt()
    ));
    let ratio = told / found;
    outcome.must((1.0 / 1.5..1.5).contains(&ratio), || format!("told {told}, found {found}"));
    let means: Vec<f64> = pictures.iter().map(Pixels::mean).collect();
    let [mean, spread] = mean_and_spread(&means);
    let (exact, off) = (converged[0].mean(), spread / (seeds as f64).sqrt());
    outcome.measured(format!("the mean is {:+.3} % off", 100.0 * (mean / exact - 1.0)));
    // Two per mil are the converged picture's own noise, at the fewest samples.
    let allowed = 4.0 * off + 2e-3 * exact;
    outcome.must((mean - exact).abs() <= allowed, || format!("{mean}, not {exact} ± {allowed}"));
    Ok(outcome)
}

fn sparkles(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let seeds = 8;
    let radii: &[f64] = scale.pick(&[1.0, 0.2], &[1.0, 0.3, 0.2, 0.1]);
    for &radius in radii {
        let pictures = rendered(&glass(radius, &json!(64)), seeds)?;
        let means: Vec<f64> = pictures.iter().map(Pixels::mean).collect();
        let [mean, spread] = mean_and_spread(&means);
        let told = |picture: &&Pixels| picture.notes.iter().any(|n| n.starts_with("sparkles: "));
        let told = pictures.iter().filter(told).count();
        let spread = spread / mean;
        outcome.measured(format!(
            "radius {radius} m: means differ by {:.2} %, {told} of {seeds} pictures say so",
            100.0 * spread
        ));
        outcome.must(spread < 0.005 || told > 4, || format!("{radius} m: {spread}, {told} told"));
        outcome.must(spread > 0.002 || told == 0, || format!("{radius} m: {spread}, {told} told"));
    }
    Ok(outcome)
}
