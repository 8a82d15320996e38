//! Paths whose hits are in f32, beside those in f64.

use anyhow::Result;
use etendue_geometry::HitPrecision;
use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_scene::Scene;
use etendue_scene::file::LightPrecision;

use crate::rendered::{Pixels, divide, scene};
use crate::{Case, Outcome, Scale};

pub(super) const DARK_BOX: Case = Case {
    name: "closed_box_in_both_precisions",
    regime: "paths of five bounces in a closed box, with a smaller one in its corner, under a sky of 10⁶, at \
        the origin, 10³, 10⁶ and 10⁹ m away from it; hits in f64 and, forced, in f32",
    must: "it is dark inside in f64, and in f32 wherever the plan takes f32",
    limit: None,
    run: dark_box,
};

pub(super) const CORNER: Case = Case {
    name: "precision_of_light",
    regime: "a matte floor that meets a matte wall of 2 m under a white sky, seen 1 mm to 1 m beside the wall, at \
        the origin, 10³ to 10⁹ m away; hits in f64 and, forced, in f32, in the same samples",
    must: "both agree within 10⁻³ wherever the plan takes f32, which it does not where f32 fails",
    limit: Some(
        "Hits in f32 are misplaced by about 10⁻⁷ of the coordinates. The plan compares that with the meshes' \
         edges and takes f64 where it shows; `plan.light_precision` forces either.",
    ),
    run: corner,
};

/// Distances of the scenes from the origin (m), and the words for them.
const AWAY: [(f64, &str); 4] = [(0.0, "origin"), (1e3, "10³ m"), (1e6, "10⁶ m"), (1e9, "10⁹ m")];

/// True if the plan, when it is free to choose, takes f32.
fn takes_single(scene: &mut Scene) -> Result<bool> {
    scene.plan.light_precision = LightPrecision::Auto;
    let outputs = Outputs::from_list("exr").map_err(anyhow::Error::msg)?;
    Ok(Plan::new(scene, outputs).light_precision == HitPrecision::Single)
}

fn dark_box(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for (far, place) in AWAY {
        let at = |x: f64, y: f64, z: f64| [x + far, y + far, z + far];
        let text = format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 5}},
            "camera": {{"type": "pinhole", "fov": 100,
                "pose": {{"from": {:?}, "look_at": {:?}}}, "sensor": {{"resolution": [64, 64]}}}},
            "lights": [{{"type": "environment", "radiance": [1e6, 1e6, 1e6]}}],
            "objects": [{{"shape": "box", "size": [2, 2, 2], "material": "m", "transform": {{"translate": {:?}}}}},
                {{"shape": "box", "size": [0.5, 0.5, 0.5], "material": "m", "transform": {{"translate": {:?}}}}}],
            "materials": {{"m": {{"type": "matte", "color": [0.9, 0.9, 0.9]}}}},
            "render": {{"samples": {}}}}}"#,
            at(0.3, 0.1, 0.2),
            at(-1.0, -1.0, -1.0),
            at(0.0, 0.0, 0.0),
            at(-0.75, -0.75, -0.75),
            // Five bounces and as many rays to the sky.
            scale.pick(4, 256),
        );
        // Of few triangles, which are traced without a tree, and of many: the worse of both is told.
        let (mut double, mut forced, mut all_single) = (0, 0, true);
        for parts in [1, 4] {
            let mut scene = scene(&text)?;
            divide(&mut scene, parts)?;
            let single = takes_single(&mut scene)?;
            let [in_double, in_single] = Pixels::in_both(scene)?.map(|pixels| lit(&pixels));
            let what = format!("{place}, {} triangles", 24 * parts * parts);
            outcome.must(in_double == 0, || format!("{what}: {in_double} pixels are lit in f64"));
            outcome.must(!single || in_single == 0, || {
                format!("{what}: {in_single} pixels are lit in f32")
            });
            (double, forced) = (in_double.max(double), in_single.max(forced));
            all_single &= single;
        }
        let choice = if all_single { "f32" } else { "f64" };
        outcome.measured(format!(
            "{place}: {double} pixels lit in f64, {forced} in f32 (plan: {choice})"
        ));
    }
    Ok(outcome)
}

/// Number of pixels that are not quite dark.
fn lit(pixels: &Pixels) -> usize {
    pixels.values.iter().filter(|value| **value != 0.0).count()
}

fn corner(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for (far, place) in AWAY {
        for beside in [1e-3, 1.0] {
            let at = |x: f64, y: f64, z: f64| [x + far, y + far, z + far];
            let mut scene = scene(&format!(
                r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 3}},
                "camera": {{"type": "orthographic", "height": {}, "pose": {{"from": {:?}, "look_at": {:?},
                    "up": [0, 1, 0]}}, "sensor": {{"resolution": [16, 16]}}}},
                "lights": [{{"type": "environment"}}],
                "objects": [{{"shape": "rectangle", "width": 8, "height": 8, "material": "m",
                        "transform": {{"translate": {:?}}}}},
                    {{"shape": "rectangle", "width": 2, "height": 8, "material": "m",
                        "transform": {{"translate": {:?}, "rotate": [0, 1, 0, 90]}}}}],
                "materials": {{"m": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}},
                "render": {{"samples": {}}}}}"#,
                0.2 * beside,
                at(beside, 0.0, 2.0),
                at(beside, 0.0, 0.0),
                at(0.0, 0.0, 0.0),
                at(0.0, 0.0, 1.0),
                scale.pick(16, 1_024),
            ))?;
            let single = takes_single(&mut scene)?;
            let [double, forced] = Pixels::in_both(scene)?;
            outcome.must(double.are_sound() && forced.are_sound(), || "not finite".to_owned());
            let off = forced.mean() / double.mean() - 1.0;
            outcome.must(!single || off.abs() <= 1e-3, || {
                format!(
                    "{place}, {beside} m: f32 shows {} and f64 {}",
                    forced.mean(),
                    double.mean()
                )
            });
            let choice = if single { "f32" } else { "f64" };
            outcome
                .measured(format!("{place}, {beside} m: f32 is {off:+.0e} off (plan: {choice})"));
        }
    }
    Ok(outcome)
}
