//! glTF 2.0, as text with buffers beside it or as one binary file.
//!
//! Crate `gltf`'s types describe the document; nodes, scenes and cameras are read here because
//! their numbers are wanted in f64 and the crate keeps f32, and bytes are read here because they
//! are to stay where they are mapped.
//!
//! # Sources
//!
//! The Khronos Group, *glTF 2.0 Specification*, version 2.0.1 (2021); its registry of extensions.

mod accessor;
mod animation;
mod buffers;
mod chains;
mod compressed;
mod deform;
mod document;
mod draco;
mod extensions;
mod hierarchy;
mod images;
mod instances;
mod judge;
mod lights;
mod lobes;
mod material;
mod meshopt;
mod part;
mod pose;
mod primitive;
mod reader;
mod tracks;

use std::path::Path;

use super::files::Files;
use super::{Import, ImportedLight, Options, Refusal, Wanted, error};
use crate::memory::of_json;
use buffers::Buffers;
use chains::Chains;
use reader::GltfReader;
use tracks::Playing;

/// Reads the glTF or GLB file at `path`.
pub(super) fn import(
    path: &Path,
    files: &Files,
    wanted: Wanted,
    options: &Options,
) -> Result<Import, Refusal> {
    let map = files.map_model(path)?;
    let container = buffers::open(path, &map)?;
    files.require_room(path, "its JSON", of_json(container.json))?;
    let mut document = document::parse(path, container.json, container.in_glb)?;
    let mut import = Import::default();
    extensions::check(path, &document, wanted, &mut import.notes)?;

    let mut playing = Playing::default();
    if let Some(play) = &options.animation {
        let buffers = Buffers::open(path, files, &document, container.binary.clone())?;
        let moved = {
            let (document, buffers, playing) = (&document, &buffers, &playing);
            let meshes_of_views = draco::undecoded(document);
            let reader = GltfReader {
                file: path,
                files,
                document,
                buffers,
                meshes_of_views,
                wanted,
                options,
                playing,
            };
            animation::moved(&reader, play, &mut import)?
        };
        tracks::apply(path, &moved, &mut document.nodes)?;
        if play.plays {
            playing = tracks::playing(path, moved, play.time, &document.nodes)?;
        }
    }
    let scene = hierarchy::walk(path, &document, &playing, &mut import.notes)?;
    let buffers = Buffers::open(path, files, &document, container.binary)?;
    let reader = GltfReader {
        file: path,
        files,
        document: &document,
        buffers: &buffers,
        meshes_of_views: draco::undecoded(&document),
        wanted,
        options,
        playing: &playing,
    };
    let chains = Chains::new(&reader);
    let shapes = primitive::load(&reader, &scene, &chains, &mut import)?;
    material::load(&reader, &mut import)?;
    chains.note(&scene.pose, &mut import);
    instances::place(&reader, &scene, &chains, &shapes, &mut import)?;
    import.cameras = scene.cameras;
    if wanted.light {
        let moves = |(node, light)| ImportedLight { links: chains.of(node), ..light };
        import.lights = scene.lights.into_iter().map(moves).collect();
    }
    if options.animation.is_none() && !document.animations.is_empty() {
        error::push(
            &mut import.notes,
            error::Note::new(
                error::NoteKind::Unsupported,
                "animations",
                "nodes stand as the file has them at rest; the object's `animation`, or `frames` of the type \
                 `animation`, play one",
            ),
        );
    }
    Ok(import)
}
