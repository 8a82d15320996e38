//! The table of layers in `docs/reference/outputs.md`, from the program's own.

use std::fmt::Write as _;

use etendue_render::output::layer_stem;
use etendue_tracer::layer::{Layer, ValueKind};
use etendue_tracer::{LayerSpec, NormalKind};

/// Words of the table of which more stands elsewhere, and where.
const LINKS: [(&str, &str); 5] = [
    ("another frame", "scene-format.md#frames"),
    ("since the frame's shutter opened", "../how-to/time.md#truth"),
    ("lights whose `group`", "../explanation/light.md#groups-of-lights"),
    ("go on until an error is reached", "../how-to/sampling.md"),
    ("guide for denoisers", "#pictures-without-their-noise"),
];

/// The table, with an empty line before and after it.
pub(super) fn table() -> String {
    let titles = ["layer", "in the EXR", "NPY", "definition", "unit", "miss"].join(" | ");
    let mut table = format!("\n| {titles} |\n|{}\n", "---|".repeat(6));
    for word in LayerSpec::NAMES {
        let spec = LayerSpec::from_name(word).expect("a layer of the table");
        push(&mut table, &format!("`{word}`"), spec);
        if let LayerSpec::Normal { space, .. } = spec {
            let shading = LayerSpec::Normal { space, kind: NormalKind::Shading };
            push(&mut table, &format!("`{word}`, `shading`"), shading);
        }
    }
    push(&mut table, "(by `render.alpha`)", LayerSpec::Backdrop);
    table = table.replace("Light.name", "Light.NAME").replace("light_name", "light_NAME");
    for (words, page) in LINKS {
        assert!(table.contains(words), "{words}");
        table = table.replace(words, &format!("[{words}]({page})"));
    }
    table + "\n"
}

/// The lines of a layer: one, or one for each channel where each is a layer of its own in files.
fn push(table: &mut String, word: &str, spec: LayerSpec) {
    let mut row = spec.row();
    if spec == LayerSpec::LightGroups {
        row.name = "Light.name".into();
    }
    let meant = |key: &str| row.meaning.iter().find(|(own, _)| *own == key).map(|(_, text)| *text);
    let unit = meant("unit").unwrap_or(match row.kept {
        ValueKind::Counted => "–",
        ValueKind::Measured | ValueKind::Shown => "1",
    });
    let miss = meant("miss").unwrap_or("–").replace("+inf", "`+inf`");
    for (k, name) in row.names_in_files().iter().enumerate() {
        let word = if k == 0 { word } else { "" };
        let definition = row.apart.map_or_else(|| meant("definition"), |own| Some(own[k]));
        let definition = definition.expect("a definition");
        let (channels, stem) = (channels(&row, name), layer_stem(name));
        let _ = writeln!(
            table,
            "| {word} | {channels} | `{stem}.npy` | {definition} | {unit} | {miss} |"
        );
    }
}

/// The channels of the layer `name`, the first with its whole name.
fn channels(row: &Layer, name: &str) -> String {
    let channels: &[&str] = if row.apart.is_some() { &["X"] } else { row.channels };
    let others = channels[1..].iter().map(|channel| format!(" `{channel}`"));
    format!("`{name}.{}`{}", channels[0], others.collect::<String>())
}
