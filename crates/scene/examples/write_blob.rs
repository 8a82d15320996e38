//! Writes a blob of any number of triangles as GLB, OBJ or binary PLY, to load heavy models with.
//!
//! ```sh
//! cargo run --release -p etendue-scene --example write_blob -- 10000000 blob.glb
//! ```
#![allow(clippy::disallowed_methods, reason = "an example writes what it is told to")]

use std::fs::File;
use std::io::{BufWriter, Error, Result, Write};

use etendue_geometry::units::Metres;
use etendue_geometry::{Mesh, Positions, Vertices};
use etendue_scene::import::Wanted;
use etendue_scene::shape::ShapeSpec;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (triangles, path) = match &arguments[..] {
        [triangles, path] => (triangles.parse::<u64>().map_err(Error::other)?, path),
        _ => return Err(Error::other("usage: write_blob TRIANGLES FILE.glb|FILE.obj|FILE.ply")),
    };
    let shape = ShapeSpec::Blob { radius: Metres(1.0), triangles, seed: 7, amplitude: 0.25 };
    let mesh = shape.build(Wanted::NOTHING).map_err(Error::other)?;
    let Positions::F32(vertices) = &mesh.positions else {
        return Err(Error::other("shapes are made in f32"));
    };
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    match path.rsplit('.').next() {
        Some("glb") => write_glb(&mut file, vertices, &mesh)?,
        Some("obj") => write_obj(&mut file, vertices, &mesh)?,
        Some("ply") => write_ply(&mut file, vertices, &mesh)?,
        _ => return Err(Error::other("the ending is none of .glb, .obj and .ply")),
    }
    file.flush()
}

fn write_glb(to: &mut impl Write, vertices: &Vertices<3>, mesh: &Mesh) -> Result<()> {
    let (indices, positions) = (12 * mesh.triangles.len(), 12 * vertices.len());
    let mut json = serde_json::json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": vertices.len()},
            {"bufferView": 1, "componentType": 5125, "type": "SCALAR",
             "count": 3 * mesh.triangles.len()}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions},
            {"buffer": 0, "byteOffset": positions, "byteLength": indices}
        ],
        "buffers": [{"byteLength": positions + indices}]
    })
    .to_string();
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(Error::other);
    to.write_all(b"glTF\x02\0\0\0")?;
    to.write_all(&word(28 + json.len() + positions + indices)?)?;
    to.write_all(&word(json.len())?)?;
    to.write_all(b"JSON")?;
    to.write_all(json.as_bytes())?;
    to.write_all(&word(positions + indices)?)?;
    to.write_all(b"BIN\0")?;
    write_positions(to, vertices)?;
    mesh.triangles.iter().flatten().try_for_each(|corner| to.write_all(&corner.to_le_bytes()))
}

fn write_positions(to: &mut impl Write, vertices: &Vertices<3>) -> Result<()> {
    (0..vertices.len())
        .flat_map(|i| vertices.get(i))
        .try_for_each(|value| to.write_all(&value.to_le_bytes()))
}

fn write_obj(to: &mut impl Write, vertices: &Vertices<3>, mesh: &Mesh) -> Result<()> {
    for i in 0..vertices.len() {
        let [x, y, z] = vertices.get(i);
        writeln!(to, "v {x:.6} {y:.6} {z:.6}")?;
    }
    for [a, b, c] in mesh.triangles.iter() {
        writeln!(to, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    Ok(())
}

fn write_ply(to: &mut impl Write, vertices: &Vertices<3>, mesh: &Mesh) -> Result<()> {
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        mesh.triangles.len()
    )?;
    write_positions(to, vertices)?;
    for triangle in mesh.triangles.iter() {
        to.write_all(&[3])?;
        triangle.iter().try_for_each(|corner| to.write_all(&corner.to_le_bytes()))?;
    }
    Ok(())
}
