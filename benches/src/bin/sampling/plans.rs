//! The plan of a scene as a table.

use std::fmt::Write as _;
use std::path::Path;

use etendue_render::output::Outputs;
use etendue_render::{Plan, plan};
use etendue_scene::LoadOptions;
use etendue_scene::file::SceneFile;

/// What is decided for a scene, why, what it saves, and by which key it is decided otherwise.
pub(crate) fn table(path: &Path) -> anyhow::Result<String> {
    let file = SceneFile::read(path, &[])?;
    let scene = file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())?;
    let mut text = format!(
        "\n### The plan of `{}`\n\n| what | choice | because | saves | key |\n|---|---|---|---|---|\n",
        path.display()
    );
    for decision in Plan::new(&scene, Outputs::ALL).decisions {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            decision.what,
            decision.choice,
            decision.because,
            decision.saves.unwrap_or_default(),
            decision.key.map_or_else(String::new, |key| format!("`{key}`"))
        );
    }
    Ok(text)
}
