//! Treatment of each extension: done, left out with a note, or refused with the command that
//! converts the file.

use std::path::Path;

use gltf::json;

use super::document::GltfDocument;
use crate::import::error::{self, Note, NoteKind};
use crate::import::{Refusal, Wanted};

/// Support of an extension.
enum Support {
    /// Done.
    Full,
    /// Read as something else; as what.
    As(&'static str),
    /// Read without it, which a still picture bears; what that means.
    Without(&'static str),
    /// Part of how a surface looks: refused where a file requires it and a picture would show it.
    Look,
    /// Its data cannot be decoded; the command that converts the file, with `IN` for its name.
    Encoded(&'static str),
}

const TO_PNG: &str = "convert its textures: npx @gltf-transform/cli ktxdecompress IN converted.glb (needs KTX-Software)";
const FROM_AVIF: &str =
    "convert its textures: npx @gltf-transform/cli png IN converted.glb --formats '*'";
const LOOK: &str = "surfaces are shown without it";
const UNKNOWN: &str = "export the file without it";

/// Support of an extension by its name; `None` for one that nobody has heard of here.
fn support(name: &str) -> Option<Support> {
    Some(match name {
        "KHR_mesh_quantization"
        | "EXT_mesh_gpu_instancing"
        | "KHR_texture_transform"
        | "KHR_lights_punctual"
        | "KHR_materials_unlit"
        | "KHR_materials_ior"
        | "KHR_materials_transmission"
        | "KHR_materials_emissive_strength"
        | "KHR_materials_specular"
        | "KHR_materials_sheen"
        | "KHR_materials_anisotropy"
        | "EXT_meshopt_compression"
        | "KHR_meshopt_compression"
        | "KHR_draco_mesh_compression"
        | "KHR_node_visibility"
        | "EXT_texture_webp" => Support::Full,
        "KHR_texture_basisu" => Support::Encoded(TO_PNG),
        "EXT_texture_avif" => Support::Encoded(FROM_AVIF),
        "KHR_materials_variants" => Support::Without("the default variant is shown"),
        "KHR_materials_pbrSpecularGlossiness" => Support::As(
            "read as KHR_materials_specular with ior 0, as that extension's text converts it",
        ),
        "KHR_materials_clearcoat" => {
            Support::As("coats follow the normals of what is beneath them")
        }
        "KHR_materials_volume" => Support::As(
            "surfaces that are clear all over and have a thickness are bodies of glass; light passes \
             others as thin walls",
        ),
        "KHR_animation_pointer" => Support::As("animations move nodes by it, and nothing else"),
        "KHR_interactivity" | "KHR_node_selectability" | "KHR_node_hoverability" => {
            Support::Without("a still picture has no use for it")
        }
        "KHR_xmp_json_ld" | "KHR_xmp" => Support::Without("it holds descriptions only"),
        _ if name.starts_with("KHR_materials_") || name.starts_with("EXT_materials_") => {
            Support::Look
        }
        _ => return None,
    })
}

/// Refuses what the document requires and is not supported, and notes what it merely uses, or
/// requires for what is not wanted.
pub(super) fn check(
    path: &Path,
    document: &GltfDocument,
    wanted: Wanted,
    notes: &mut Vec<Note>,
) -> Result<(), Refusal> {
    let missing = document.root.extensions_required.iter().filter_map(|name| {
        match support(name) {
            Some(Support::Full | Support::As(_) | Support::Without(_)) => None,
            // A required look (a thin film, say) changes no geometry.
            Some(Support::Look) if !wanted.light => None,
            Some(Support::Look) | None => Some(MissingExtension { name, command: UNKNOWN }),
            Some(Support::Encoded(command)) => Some(MissingExtension { name, command }),
        }
    });
    let missing: Vec<_> = missing.collect();
    if !missing.is_empty() {
        return Err(refused(path, &missing));
    }
    let (used, required) = (&document.root.extensions_used, &document.root.extensions_required);
    // What is required should be among what is used, and is not always.
    for name in used.iter().chain(required.iter().filter(|name| !used.contains(name))) {
        let message = match support(name) {
            Some(Support::Full) => continue,
            Some(Support::As(what)) => what.to_owned(),
            Some(Support::Without(meaning)) => format!("not supported: {meaning}"),
            Some(Support::Look) => format!("not supported: {LOOK}"),
            Some(Support::Encoded(command)) => {
                format!(
                    "not supported: its plain fallback is read; else {}",
                    with_name(path, command)
                )
            }
            None => "not supported: it is ignored".to_owned(),
        };
        error::push(notes, Note::new(NoteKind::Extension, name, message));
    }
    Ok(())
}

/// The image that a texture has as `WebP`.
pub(super) fn webp_image(texture: &json::Texture) -> Option<usize> {
    let extension = texture.extensions.as_ref()?.others.get("EXT_texture_webp")?;
    usize::try_from(extension.get("source")?.as_u64()?).ok()
}

/// Checks a texture without a plain image: refused when its pixels are wanted.
pub(super) fn encoded_texture(
    path: &Path,
    texture: &json::Texture,
    wanted: Wanted,
) -> Result<Option<Note>, Refusal> {
    for name in ["KHR_texture_basisu", "EXT_texture_avif"] {
        if !texture.extensions.as_ref().is_some_and(|e| e.others.contains_key(name)) {
            continue;
        }
        let command = if name == "KHR_texture_basisu" { TO_PNG } else { FROM_AVIF };
        if wanted.textures {
            return Err(refused(path, &[MissingExtension { name, command }]));
        }
        return Ok(Some(Note::new(NoteKind::Extension, name, with_name(path, command))));
    }
    Ok(None)
}

/// An extension that is needed and not supported, with the command that takes it out of a file.
struct MissingExtension<'a> {
    name: &'a str,
    command: &'a str,
}

/// That extensions are needed.
fn refused(path: &Path, missing: &[MissingExtension<'_>]) -> Refusal {
    let names: Vec<&str> = missing.iter().map(|extension| extension.name).collect();
    let why = Refusal::new(format!("needs {}, not supported", names.join(" and ")));
    let remedies = missing.iter().map(|MissingExtension { name, command }| match missing.len() {
        1 => with_name(path, command),
        _ => format!("{name}: {}", with_name(path, command)),
    });
    remedies.fold(why, Refusal::hint).at(path.display())
}

/// The command with the file's own name in it, quoted for a shell where it has blanks.
fn with_name(path: &Path, command: &str) -> String {
    let name = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "._-/+=:@%".contains(c);
    let quoted =
        if name.chars().all(plain) { name } else { format!("'{}'", name.replace('\'', r"'\''")) };
    command.replace("IN", &quoted)
}
