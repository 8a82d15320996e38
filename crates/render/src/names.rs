//! Names that the numbers of id layers stand for, for every header.

use etendue_scene::Scene;
use etendue_tracer::LayerSpec;
use serde_json::Value;

use crate::output::{Outputs, Picture, exr, has_mask};

/// A table of names for each layer of ids among those of `scene`.
pub(crate) fn tables(scene: &Scene) -> Vec<(String, Value)> {
    let mut tables = Vec::new();
    let mut add = |layer: &str, names| {
        // Numbers and strings alone, which always serialise.
        let table = serde_json::to_value(names).unwrap_or_default();
        tables.push((layer.to_owned(), table));
    };
    if scene.layers.contains(&LayerSpec::Ids) {
        add("Id.object", scene.object_names());
        add("Id.instance", scene.instance_names());
        add("Id.node", scene.node_names());
    }
    if scene.layers.contains(&LayerSpec::MaterialId) {
        add("MaterialId", scene.material_names());
    }
    tables
}

/// Notes on files that are asked for and cannot hold the numbers of ids as they usually do.
pub(crate) fn notes(picture: &Picture, outputs: Outputs) -> Vec<String> {
    let mut notes = Vec::new();
    for name in exr::beyond_floats(picture).into_iter().filter(|_| outputs.exr) {
        notes.push(format!(
            "{name}: its numbers pass 16777216, the last that 32-bit floats hold exactly, so the EXR \
             has it as 32-bit integers, which OpenImageIO reads as shares of 2^32 unless it is asked \
             for integers; the NPY is plain"
        ));
    }
    for layer in picture.layers() {
        let name = &layer.name;
        if !has_mask(name) {
            continue;
        }
        let largest = layer.channels.first().map_or(0, |c| c.values.largest_integer());
        let mut note = |lacks: &str| {
            notes.push(format!(
                "{name}: its numbers reach {largest}, more than {lacks}; take the NPY or the EXR"
            ));
        };
        if outputs.png && largest > u16::MAX.into() {
            note("a 16-bit PNG holds, so there is no mask");
        }
        if outputs.indexed && largest > u8::MAX.into() {
            note("a palette has colours, so there is no indexed PNG");
        }
    }
    notes
}
