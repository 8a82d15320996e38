//! Meshes of primitives that Draco compressed: decoded once, and their values as accessors have them.

use draco_core::{DecodeLimits, DecoderBuffer, ErrorKind, Mesh, MeshDecoder};
use etendue_report::Size;
use gltf::json::mesh::Primitive;

use super::accessor::Accessor;
use super::draco::{Attribute, DracoData, DracoMesh, DracoPrimitive, NAME};
use super::reader::{BufferView, GltfReader};
use crate::import::Refusal;

/// Memory that the decoder and we hold of a triangle and of a point while it is decoded (bytes):
/// tables of corners and neighbours, and the map from points to values.
const PER_FACE: u64 = 256;
const PER_POINT: u64 = 128;

impl GltfReader<'_> {
    /// The mesh of `primitive` when it is there in compressed form alone.
    pub(super) fn draco(
        &self,
        primitive: &Primitive,
        place: &str,
    ) -> Result<Option<DracoData<'_>>, Refusal> {
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
        Ok(Some(DracoData { primitive: compressed, mesh: decoded }))
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
        Some(Ok(Accessor::of_packed(bytes, *component, *components, self.points, normalized)))
    }
}
