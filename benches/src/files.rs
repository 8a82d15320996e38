//! A mesh as GLB, OBJ and PLY, as other programs write them, and a scene around it.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use etendue_geometry::{Geometry, Mesh};
use serde_json::{Value, json};

use crate::rays::{SIDE, View};

/// The formats that are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Binary glTF 2.0.
    Glb,
    /// Binary little-endian PLY, triangles as lists of a byte and three ints.
    Ply,
    /// Wavefront OBJ.
    Obj,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Glb, Self::Ply, Self::Obj];

    /// The ending of its files.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Ply => "ply",
            Self::Obj => "obj",
        }
    }

    /// Writes the first mesh of `geometry` to `path`.
    ///
    /// # Errors
    ///
    /// When the file cannot be written, or there is no mesh.
    pub fn write(self, path: &Path, geometry: &Geometry) -> io::Result<()> {
        let mesh = geometry.meshes.first().ok_or_else(|| io::Error::other("there is no mesh"))?;
        let mut out = BufWriter::with_capacity(1 << 20, File::create(path)?);
        match self {
            Self::Glb => write_glb(&mut out, mesh),
            Self::Ply => write_ply(&mut out, mesh),
            Self::Obj => write_obj(&mut out, mesh),
        }?;
        out.flush()
    }
}

fn corners(mesh: &Mesh) -> Vec<[f32; 3]> {
    (0..mesh.positions.len()).map(|i| mesh.positions.get(i).as_vec3().to_array()).collect()
}

fn write_glb(out: &mut impl Write, mesh: &Mesh) -> io::Result<()> {
    let corners = corners(mesh);
    let (lo, hi) = (mesh.bounds.min.as_vec3().to_array(), mesh.bounds.max.as_vec3().to_array());
    let (vertices, indices) = (corners.len() * 12, mesh.triangles.len() * 12);
    let document = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": corners.len(), "type": "VEC3",
             "min": lo, "max": hi},
            {"bufferView": 1, "componentType": 5125, "count": mesh.triangles.len() * 3,
             "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": vertices, "target": 34962},
            {"buffer": 0, "byteOffset": vertices, "byteLength": indices, "target": 34963},
        ],
        "buffers": [{"byteLength": vertices + indices}],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary = vertices + indices;
    let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(io::Error::other);
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&word(12 + 8 + text.len() + 8 + binary)?)?;
    out.write_all(&word(text.len())?)?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    out.write_all(&word(binary)?)?;
    out.write_all(b"BIN\0")?;
    out.write_all(bytemuck::cast_slice(&corners))?;
    out.write_all(bytemuck::cast_slice(&mesh.triangles))
}

fn write_ply(out: &mut impl Write, mesh: &Mesh) -> io::Result<()> {
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty \
         float y\nproperty float z\nelement face {}\nproperty list uchar int \
         vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len()
    )?;
    out.write_all(bytemuck::cast_slice(&corners(mesh)))?;
    for triangle in &*mesh.triangles {
        out.write_all(&[3])?;
        out.write_all(bytemuck::cast_slice(triangle))?;
    }
    Ok(())
}

fn write_obj(out: &mut impl Write, mesh: &Mesh) -> io::Result<()> {
    for [x, y, z] in corners(mesh) {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for triangle in &*mesh.triangles {
        let [a, b, c] = triangle.map(|corner| corner + 1);
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

/// A scene of the model `file` seen through `view`: depth and normals.
#[must_use]
pub fn scene(file: &str, view: &View) -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "pinhole",
            "fov": view.fov,
            "pose": {"from": view.from.to_array(), "look_at": view.look_at.to_array()},
            "sensor": {"resolution": [SIDE, SIDE]},
        },
        "layers": ["depth", "normal"],
        "objects": [{"file": file}],
    })
}

#[cfg(test)]
mod tests {
    use etendue_geometry::glam::DVec3;
    use etendue_scene::import::{Options, Wanted, import};

    use super::*;
    use crate::meshes;

    #[test]
    fn every_format_reads_back_as_the_mesh_that_was_written() {
        let geometry = meshes::blob(512).expect("a small blob");
        let mesh = &geometry.meshes[0];
        let folder = tempfile::tempdir().expect("a folder");
        for format in Format::ALL {
            let path = folder.path().join("blob").with_extension(format.extension());
            format.write(&path, &geometry).expect("it is written");
            let read = import(&path, Wanted::NOTHING, &Options::default()).expect("it reads");
            assert_eq!(read.meshes.len(), 1, "{format:?}");
            assert_eq!(read.meshes[0].triangles.len(), 512, "{format:?}");
            for i in 0..512 {
                assert_eq!(read.meshes[0].corners(i), mesh.corners(i), "{format:?}, triangle {i}");
            }
        }
    }

    #[test]
    fn the_scene_is_one() {
        let view = View { from: DVec3::Z, look_at: DVec3::ZERO, fov: 30.0 };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.json");
        std::fs::write(&path, scene("blob.glb", &view).to_string()).expect("it is written");
        etendue_scene::SceneFile::read(&path, &[]).expect("it is understood");
    }
}
