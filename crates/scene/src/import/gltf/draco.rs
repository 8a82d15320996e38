//! Primitives compressed by Draco (`KHR_draco_mesh_compression`).
//!
//! Crate `draco-core` decodes: Rust throughout, without `unsafe`, of the same bits as Google's library 1.5.7.
//! That library itself has a C++ interface only and would have to be installed. What goes in and what comes
//! out is checked here.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, ErrorKind, Mesh, MeshDecoder, PointAttribute, PointIndex,
};
use etendue_report::Size;
use gltf::json;
use json::accessor::ComponentType;
use json::mesh::Primitive;
use serde::Deserialize;

use super::GltfReader;
use super::accessor::Accessor;
use super::buffers::{BufferView, Bytes};
use super::document::GltfDocument;
use crate::file::read_value;
use crate::import::Refusal;

pub(super) const NAME: &str = "KHR_draco_mesh_compression";

/// Memory that the decoder and we hold of a triangle and of a point while it is decoded (bytes):
/// tables of corners and neighbours, and the map from points to values.
const PER_FACE: u64 = 256;
const PER_POINT: u64 = 128;

/// Compressed form of a primitive.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct DracoPrimitive {
    buffer_view: usize,
    /// Numbers of Draco's attributes by their names in glTF.
    attributes: BTreeMap<String, u32>,
}

/// The mesh of a compressed view.
#[derive(Debug)]
pub(super) struct DracoMesh {
    points: usize,
    pub triangles: Vec<[u32; 3]>,
    /// Values by Draco's numbers, one for each point.
    attributes: BTreeMap<u32, Attribute>,
}

#[derive(Debug)]
struct Attribute {
    component: ComponentType,
    components: usize,
    bytes: Bytes,
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

impl GltfReader<'_> {
    /// The mesh of `primitive` when it is there in compressed form alone.
    pub(super) fn draco(
        &self,
        primitive: &Primitive,
        place: &str,
    ) -> Result<Option<(DracoPrimitive, &DracoMesh)>, Refusal> {
        let Some(compressed) = DracoPrimitive::of(primitive) else { return Ok(None) };
        // Some files keep a plain copy beside it, which has lost nothing.
        let accessors = &self.document.root.accessors;
        let is_plain = primitive.attributes.values().chain(&primitive.indices).all(|index| {
            let accessor = accessors.get(index.value());
            accessor.is_none_or(|a| a.buffer_view.is_some() || a.sparse.is_some())
        });
        if is_plain && !primitive.attributes.is_empty() {
            return Ok(None);
        }
        let place = format!("{place}, {NAME}");
        let compressed = compressed.map_err(|why| self.damaged(&*place, why))?;
        let decoded = self.decoded(compressed.buffer_view, &place)?;
        Ok(Some((compressed, decoded)))
    }

    /// The mesh of view `index`, decoded once.
    fn decoded(&self, index: usize, place: &str) -> Result<&DracoMesh, Refusal> {
        let BufferView { bytes, start, len, .. } = self.view(index, place)?;
        // There is such a view.
        let known = &self.meshes_of_views[index];
        if let Some(decoded) = known.get() {
            return Ok(decoded);
        }
        let left = self.files.left();
        let limits = DecodeLimits::permissive()
            .with_max_points(left / PER_POINT)
            .with_max_faces(left / PER_FACE)
            .with_max_decoded_bytes(left / 2);
        let mut stream =
            DecoderBuffer::new(&bytes.as_slice()[start..start + len]).with_limits(limits);
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut stream, &mut mesh).map_err(|error| {
            let why = match error.kind() {
                ErrorKind::LimitExceeded => format!(
                    "its {len} bytes become more than the {} that there are for it\nhint: split the mesh",
                    Size(left)
                ),
                _ => format!("its stream is damaged ({error})\nhint: copy or export the file again"),
            };
            self.damaged(place, why)
        })?;
        let decoded = DracoMesh::of(&mesh).map_err(|why| self.damaged(place, why))?;
        self.files.take(decoded.bytes(), || place.to_owned())?;
        Ok(known.get_or_init(|| decoded))
    }
}

impl DracoMesh {
    fn of(mesh: &Mesh) -> Result<Self, String> {
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

    fn bytes(&self) -> u64 {
        let of = |attribute: &Attribute| attribute.bytes.as_slice().len();
        let values: usize = self.attributes.values().map(of).sum();
        (values + size_of_val(&*self.triangles)) as u64
    }

    /// The values of `semantic` as an accessor would give them; `None` when they are not compressed, and why
    /// not, when they should be.
    pub(super) fn accessor(
        &self,
        compressed: &DracoPrimitive,
        semantic: &str,
        normalized: bool,
    ) -> Option<Result<Accessor<'_>, String>> {
        let id = compressed.attributes.get(semantic)?;
        let Some(Attribute { component, components, bytes }) = self.attributes.get(id) else {
            return Some(Err(format!(
                "its stream has no attribute {id} that glTF could take\nhint: export the file again"
            )));
        };
        Some(Ok(Accessor::of_packed(bytes, (*component, *components), self.points, normalized)))
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
