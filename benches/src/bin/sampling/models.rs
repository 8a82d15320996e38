//! What simpler models of the double Gauss miss, and what they cost.

use std::fmt::Write as _;
use std::path::Path;

use etendue_accel::BuildOptions;
use etendue_bench::tolerance::{Tolerance, compare};
use etendue_render::output::Outputs;
use etendue_render::{Plan, build, plan};
use etendue_scene::LoadOptions;
use etendue_scene::file::SceneFile;

/// The tolerance of the table.
const TOLERANCE: Tolerance = Tolerance { pixels: 0.5, light: None };

/// F-numbers at which the lens is looked at.
const F_NUMBERS: [f64; 2] = [2.8, 11.0];

/// The table of `etendue plan --models` for a scene, at several openings of its lens.
pub(crate) fn table(path: &Path) -> anyhow::Result<String> {
    let mut text = format!(
        "\n### What models of a lens miss\n\n`etendue plan {} --models --tolerance \"{} px\"`: the greatest \
         difference from the full train of what a pixel sees, over the field and the scene's own depths, and how \
         many times as fast the scene's picture is traced.\n\n\
         | f-number | model | chief ray (px) | centroid (px) | blur (px) | colour (px) | light (%) | times as fast | within {0} px |\n\
         |---|---|---|---|---|---|---|---|---|\n",
        path.display(),
        TOLERANCE.pixels
    );
    for f_number in F_NUMBERS {
        let settings = [("camera.f_number".to_owned(), f_number.to_string())];
        let file = SceneFile::read(path, &settings)?;
        let wanted = plan::wanted(&file.spec.all_layers());
        let scene = file.load(wanted, &LoadOptions::default())?;
        let plan = Plan::new(&scene, Outputs::ALL);
        let accel = build(&scene, &plan, &BuildOptions::default())?;
        let compared = compare(&scene, &*accel, TOLERANCE, &|_| true)?;
        for m in &compared.models {
            let _ = writeln!(
                text,
                "| f/{f_number} | `{}` | {:.3} | {:.3} | {:.3} | {:.3} | {:.1} | {} | {} |",
                m.model,
                m.chief_ray.value,
                m.centroid.value,
                m.blur.value,
                m.colour.value,
                100.0 * m.light.value,
                m.speed.map_or_else(|| "-".to_owned(), |speed| format!("{speed:.1}")),
                if m.model == compared.cheapest {
                    "the cheapest"
                } else if m.is_within {
                    "yes"
                } else {
                    "no"
                }
            );
        }
    }
    Ok(text)
}
