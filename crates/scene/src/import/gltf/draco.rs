//! Primitives compressed by Draco (`KHR_draco_mesh_compression`).
//!
//! Crate `draco-core` decodes: Rust throughout, without `unsafe`, of the same bits as Google's library 1.5.7.
//! That library itself has a C++ interface only and would have to be installed. What goes in and what comes
//! out is checked here.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use draco_core::{DataType, Mesh, PointAttribute, PointIndex};
use gltf::json;
use json::accessor::ComponentType;
use json::mesh::Primitive;
use serde::Deserialize;

use super::buffers::Bytes;
use super::document::GltfDocument;
use crate::file::read_value;

pub(super) const NAME: &str = "KHR_draco_mesh_compression";

/// A compressed primitive, and its mesh as it was decoded.
#[derive(Debug)]
pub(super) struct DracoData<'a> {
    pub(super) primitive: DracoPrimitive,
    pub(super) mesh: &'a DracoMesh,
}

/// Compressed form of a primitive.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct DracoPrimitive {
    pub(super) buffer_view: usize,
    /// Numbers of Draco's attributes by their names in glTF.
    pub(super) attributes: BTreeMap<String, u32>,
}

/// The mesh of a compressed view.
#[derive(Debug)]
pub(super) struct DracoMesh {
    pub(super) points: usize,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Values by Draco's numbers, one for each point.
    pub(super) attributes: BTreeMap<u32, Attribute>,
}

/// The values of the points.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) component: ComponentType,
    pub(super) components: usize,
    pub(super) bytes: Bytes,
}

impl DracoPrimitive {
    /// The compressed form of `primitive`; `None` when it has none.
    pub(super) fn of(primitive: &Primitive) -> Option<Result<Self, String>> {
        let written = primitive.extensions.as_ref()?.others.get(NAME)?;
        Some(read_value(written).map_err(|(_, why)| why))
    }
}

/// A place for the mesh of each view of a document.
pub(super) fn undecoded(document: &GltfDocument) -> Vec<OnceLock<DracoMesh>> {
    document.root.buffer_views.iter().map(|_| OnceLock::new()).collect()
}

impl DracoMesh {
    pub(super) fn of(mesh: &Mesh) -> Result<Self, String> {
        let points = mesh.num_points();
        let triangles: Vec<[u32; 3]> =
            mesh.faces().iter().map(|face| face.map(|PointIndex(point)| point)).collect();
        if let Some(point) = triangles.iter().flatten().find(|&&p| p as usize >= points) {
            return Err(format!(
                "a triangle has point {point} of only {points}\nhint: export it again"
            ));
        }
        let mut attributes = BTreeMap::new();
        for id in 0..mesh.num_attributes() {
            let attribute = mesh.attribute(id);
            // Types that glTF does not have may be there for others.
            if let Some(component) = component(attribute.data_type()) {
                let components = usize::from(attribute.num_components());
                let bytes = values(attribute, points, components * component.size())?;
                let bytes = Bytes::Memory(bytes.into());
                let known = Attribute { component, components, bytes };
                attributes.insert(attribute.unique_id(), known);
            }
        }
        Ok(Self { points, triangles, attributes })
    }

    pub(super) fn bytes(&self) -> u64 {
        let of = |attribute: &Attribute| attribute.bytes.as_slice().len();
        let values: usize = self.attributes.values().map(of).sum();
        (values + size_of_val(&*self.triangles)) as u64
    }
}

/// The values of all points behind each other, `size` bytes each.
fn values(attribute: &PointAttribute, points: usize, size: usize) -> Result<Vec<u8>, String> {
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or(size);
    let stored = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..u32::try_from(points).unwrap_or(u32::MAX) {
        let value = attribute.mapped_index(PointIndex(point)).0 as usize;
        let at = value.checked_mul(stride).filter(|_| value < attribute.size());
        let value = at.and_then(|at| stored.get(at..)?.get(..size));
        bytes.extend_from_slice(value.ok_or_else(|| {
            format!("point {point} of its stream has no value\nhint: copy or export the file again")
        })?);
    }
    Ok(bytes)
}

/// glTF's type of component; `None` for those that it does not have.
fn component(kind: DataType) -> Option<ComponentType> {
    match kind {
        DataType::Int8 => Some(ComponentType::I8),
        DataType::Uint8 => Some(ComponentType::U8),
        DataType::Int16 => Some(ComponentType::I16),
        DataType::Uint16 => Some(ComponentType::U16),
        DataType::Uint32 => Some(ComponentType::U32),
        DataType::Float32 => Some(ComponentType::F32),
        DataType::Invalid
        | DataType::Int32
        | DataType::Int64
        | DataType::Uint64
        | DataType::Float64
        | DataType::Bool => None,
    }
}
