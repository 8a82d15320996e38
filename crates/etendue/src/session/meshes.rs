//! Meshes that are in no file.

use etendue_geometry::{Mesh, Vertices};

use crate::{Error, Session};

/// Attributes of the vertices of a mesh of arrays: one entry each, or nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct MeshAttributes<'a> {
    /// Texture coordinates; v runs down, as glTF has it.
    pub uvs: Option<&'a [[f32; 2]]>,
    /// Shading normals; they need no length of 1.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Linear colours, 0 to 1: they multiply the light grey of objects without a material, as vertex colours of
    /// PLY files do.
    pub colors: Option<&'a [[f32; 4]]>,
}

impl Session {
    /// Adds a mesh, or replaces it: objects whose `file` is `name` are made of it. Three coordinates a
    /// vertex (m) and three vertices a triangle, counter-clockwise from its front.
    ///
    /// # Errors
    ///
    /// When a triangle names a vertex that is not there, or has a corner that is not finite.
    pub fn insert_mesh(
        &mut self,
        name: &str,
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<(), Error> {
        self.insert_mesh_with(name, vertices, triangles, MeshAttributes::default())
    }

    /// As [`Self::insert_mesh`], with what is known at the vertices.
    ///
    /// # Errors
    ///
    /// As [`Self::insert_mesh`]; when an attribute has another length than the vertices, or is not finite.
    pub fn insert_mesh_with(
        &mut self,
        name: &str,
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
        attributes: MeshAttributes<'_>,
    ) -> Result<(), Error> {
        let mesh = Mesh::from_arrays(name, vertices, triangles)
            .and_then(|mesh| attributes.added_to(mesh))
            .map_err(|why| Error::Refused(format!("mesh \"{name}\": {why}")))?;
        self.cache.insert_mesh(name, mesh);
        self.loaded = None;
        Ok(())
    }

    /// Sets whether pictures of light lose their noise from now on, as [`crate::Options::outputs`]
    /// says it of a session that is opened.
    pub fn set_denoised(&mut self, denoised: bool) {
        if self.options.outputs.denoised != denoised {
            self.options.outputs.denoised = denoised;
            self.denoiser = None;
            self.loaded = None;
        }
    }
}

impl MeshAttributes<'_> {
    fn added_to(self, mut mesh: Mesh) -> Result<Mesh, String> {
        let count = mesh.positions.len();
        mesh.uvs = checked("uvs", self.uvs, count)?.into_iter().collect();
        mesh.normals = checked("normals", self.normals, count)?;
        mesh.colors = checked("colors", self.colors, count)?;
        Ok(mesh)
    }
}

fn checked<const N: usize>(
    name: &str,
    values: Option<&[[f32; N]]>,
    count: usize,
) -> Result<Option<Vertices<N>>, String> {
    let Some(values) = values else { return Ok(None) };
    if values.len() != count {
        let given = values.len();
        return Err(format!(
            "{given} {name} are given for {count} vertices\nhint: give each vertex one"
        ));
    }
    match values.iter().position(|value| !value.iter().all(|x| x.is_finite())) {
        Some(vertex) => Err(format!("{name}: that of vertex {vertex} is {:?}", values[vertex])),
        None => Ok(Some(Vertices::from_arrays(values))),
    }
}
