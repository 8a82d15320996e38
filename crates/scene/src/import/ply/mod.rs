//! PLY, the Stanford polygon format: binary of either byte order, or text.
//!
//! Little-endian f32 positions are used where they are mapped when the header's length happens to
//! be a multiple of four; everything else is converted in parallel.
//!
//! Byte colours are taken as sRGB, as scanners write them, and float colours as linear. Texture
//! coordinates are turned over, as in OBJ.
//!
//! # Sources
//!
//! Greg Turk, *The PLY polygon file format* (1994).

mod header;
mod text;
mod vertices;

use std::path::Path;

use etendue_geometry::{Positions, Transform};
use etendue_tracer::Material;

use super::admit::{self, MeshCandidate, cost};
use super::files::{Files, refuse_other_kind};
use super::text::TextFault;
use super::{Import, ImportedPlacement, Options, Refusal, Wanted, error};
use header::{Format, PlyHeader};

/// Reads the PLY file at `path`.
pub(super) fn import(
    path: &Path,
    files: &Files,
    wanted: Wanted,
    options: &Options,
) -> Result<Import, Refusal> {
    let map = files.map_model(path)?;
    if !map.bytes().starts_with(b"ply") {
        refuse_other_kind(path, map.bytes(), "a PLY model")?;
    }
    let fault = |fault: TextFault| fault.locate(path, map.bytes());
    let header = PlyHeader::parse(map.bytes()).map_err(fault)?;
    let damaged = |reason: String| error::damaged(path, "PLY data", reason);
    let bytes = header.bytes_to_make(map.bytes().len());
    files.take(bytes, || "vertices and faces".to_owned())?;
    let (vertices, faces) = match header.format {
        Format::Text => text::read_text(&map, &header, wanted).map_err(fault)?,
        Format::Binary(order) => {
            text::read_binary(&map, &header, order, wanted).map_err(damaged)?
        }
    };
    files.take(faces.bytes_to_cut(), || "faces cut into triangles".to_owned())?;
    let triangles = faces.triangles(&vertices.positions);
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut import = Import::default();
    let mut add = |(copied, mapped): (u64, u64)| {
        import.stats.bytes_copied += copied;
        import.stats.bytes_mapped += mapped;
    };
    match &vertices.positions {
        Positions::F32(v) => add(cost(v.floats(), v.len() * 3)),
        Positions::F64(v) => add(cost(v, v.len())),
    }
    add(cost(&triangles, triangles.len()));
    vertices.normals.iter().for_each(|v| add(cost(v.floats(), v.len() * 3)));
    vertices.uvs.iter().for_each(|v| add(cost(v.floats(), v.len() * 2)));
    vertices.colors.iter().for_each(|v| add(cost(v.floats(), v.len() * 4)));
    let candidate = MeshCandidate {
        place: format!("\"{name}\""),
        name: name.clone(),
        positions: vertices.positions,
        triangles,
        normals: vertices.normals,
        uvs: vertices.uvs.into_iter().collect(),
        colors: vertices.colors,
        tangents: None,
    };
    let admitted = admit::admit(candidate, path, options)?;
    import.stats.dropped = admitted.dropped;
    import.notes.extend(admitted.notes);
    import.meshes.push(admitted.mesh);
    import.materials.push(Material::unnamed());
    import.placements.push(ImportedPlacement {
        mesh: 0,
        material: 0,
        model_from_mesh: Transform::IDENTITY,
        name,
        node: 0,
        links: Vec::new(),
        instance: None,
    });
    Ok(import)
}
