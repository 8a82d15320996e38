//! Accessors: typed, strided, possibly sparse views of bytes.
//!
//! f32 values that lie in the mapped file are used there; everything else is converted, in
//! parallel, by the rules of glTF 2.0, section 3.11, and `KHR_mesh_quantization`.

use etendue_geometry::{Buffer, Vertices};
use gltf::json;
use json::accessor::{ComponentType, Type};
use json::validation::Checked;
use rayon::prelude::*;

use super::buffers::Bytes;
use super::reader::{BufferView, GltfReader, size};
use crate::import::Refusal;

/// Floats that Embree reads from the start of the last vertex on.
const LAST_READ: usize = 4;

/// An accessor whose sizes have been checked.
pub(super) struct Accessor<'a> {
    view: Option<BufferView<'a>>,
    /// Offset of the first element in the buffer (bytes).
    start: usize,
    /// From one element to the next (bytes).
    stride: usize,
    pub count: usize,
    component: ComponentType,
    pub components: usize,
    normalized: bool,
    sparse: Option<Sparse<'a>>,
}

/// Elements that deviate.
struct Sparse<'a> {
    indices: Box<Accessor<'a>>,
    values: Box<Accessor<'a>>,
}

impl<'a> GltfReader<'a> {
    /// Accessor `index`, which `place` names.
    pub(super) fn accessor(&'a self, index: usize, place: &str) -> Result<Accessor<'a>, Refusal> {
        let place = format!("{place} (accessor {index})");
        let Some(accessor) = self.document.root.accessors.get(index) else {
            let count = self.document.root.accessors.len();
            return Err(self.absent(place, "accessor", index, count));
        };
        let (Checked::Valid(component), Checked::Valid(kind)) =
            (&accessor.component_type, &accessor.type_)
        else {
            let reason = "its componentType is none of 5120, 5121, 5122, 5123, 5125 and 5126, or \
                          its type none of SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 and MAT4; export \
                          the file again";
            return Err(self.damaged(place, reason));
        };
        let Some(count) = size(accessor.count).filter(|&count| u32::try_from(count).is_ok()) else {
            return Err(self.damaged(
                place,
                format!(
                    "{} elements are more than 32 bits can count\nhint: split the mesh",
                    accessor.count.0
                ),
            ));
        };
        let mut plain = Accessor {
            view: None,
            start: 0,
            stride: 0,
            count,
            component: component.0,
            components: components(*kind),
            normalized: accessor.normalized,
            sparse: None,
        };
        if let Some(view) = accessor.buffer_view {
            let offset = size(accessor.byte_offset.unwrap_or_default());
            self.bind(&mut plain, view.value(), offset, &place)?;
        }
        let in_place = matches!(plain.component, ComponentType::F32 | ComponentType::U32)
            && plain.view.is_some()
            && accessor.sparse.is_none();
        if !in_place {
            // Each component becomes four bytes.
            self.files.take(4 * (count * plain.components) as u64, || place.clone())?;
        }
        if let Some(sparse) = &accessor.sparse {
            plain.sparse = Some(self.sparse(&plain, sparse, &place)?);
        }
        Ok(plain)
    }

    /// Gives `accessor` its bytes, `offset` into view `view`.
    fn bind(
        &'a self,
        accessor: &mut Accessor<'a>,
        view: usize,
        offset: Option<usize>,
        place: &str,
    ) -> Result<(), Refusal> {
        let view = self.view(view, place)?;
        let element = accessor.components * accessor.component.size();
        accessor.stride = view.stride.unwrap_or(element);
        if accessor.stride < element {
            return Err(self.damaged(
                place,
                format!(
                    "its elements of {element} bytes overlap: byteStride is {}",
                    accessor.stride
                ),
            ));
        }
        let end = match accessor.count {
            0 => Some(0),
            count => {
                (count - 1).checked_mul(accessor.stride).and_then(|last| last.checked_add(element))
            }
        };
        let fits = offset
            .zip(end)
            .and_then(|(offset, end)| offset.checked_add(end))
            .is_some_and(|end| end <= view.len);
        let Some(offset) = offset.filter(|_| fits) else {
            return Err(self.damaged(
                place,
                format!(
                    "its {} elements do not fit into its buffer view of {} bytes\nhint: export the file \
                     again",
                    accessor.count, view.len
                ),
            ));
        };
        accessor.start = view.start + offset;
        accessor.view = Some(view);
        Ok(())
    }

    fn sparse(
        &'a self,
        of: &Accessor<'a>,
        sparse: &json::accessor::sparse::Sparse,
        place: &str,
    ) -> Result<Sparse<'a>, Refusal> {
        let Checked::Valid(index_type) = &sparse.indices.component_type else {
            return Err(self.damaged(place, "its sparse indices are of no type that glTF allows"));
        };
        let Some(count) = size(sparse.count).filter(|&count| count <= of.count) else {
            return Err(self.damaged(place, "it has more sparse elements than elements"));
        };
        let mut indices = Accessor {
            view: None,
            start: 0,
            stride: 0,
            count,
            component: index_type.0,
            components: 1,
            normalized: false,
            sparse: None,
        };
        let mut values = Accessor {
            component: of.component,
            components: of.components,
            normalized: of.normalized,
            sparse: None,
            ..indices
        };
        let place_of = |part: &str| format!("{place}, sparse {part}");
        let (i, v) = (&sparse.indices, &sparse.values);
        self.bind(&mut indices, i.buffer_view.value(), size(i.byte_offset), &place_of("indices"))?;
        self.bind(&mut values, v.buffer_view.value(), size(v.byte_offset), &place_of("values"))?;
        if let Some(at) = (0..count).find(|&i| indices.integer(i) as usize >= of.count) {
            return Err(self.damaged(
                place_of("indices"),
                format!("element {} of only {}", indices.integer(at), of.count),
            ));
        }
        Ok(Sparse { indices: Box::new(indices), values: Box::new(values) })
    }
}

impl<'a> Accessor<'a> {
    /// `count` elements that lie behind each other in `bytes`.
    pub(super) fn of_packed(
        bytes: &'a Bytes,
        component: ComponentType,
        components: usize,
        count: usize,
        normalized: bool,
    ) -> Self {
        let len = bytes.as_slice().len();
        Self {
            view: Some(BufferView { bytes, start: 0, len, stride: None }),
            start: 0,
            stride: components * component.size(),
            count,
            component,
            components,
            normalized,
            sparse: None,
        }
    }
}

impl Accessor<'_> {
    /// The elements as `N` floats each; components that the file does not have are `fill`.
    ///
    /// `None` when the file has more components than `N`.
    pub(super) fn floats<const N: usize>(&self, fill: f32) -> Option<Vertices<N>> {
        if self.components > N {
            return None;
        }
        if let Some(mapped) = self.mapped_floats() {
            return Some(mapped);
        }
        // Embree reads past the last vertex: four floats more than the vertices need.
        let mut floats = vec![fill; self.count * N + LAST_READ];
        floats[..self.count * N]
            .par_chunks_exact_mut(N)
            .enumerate()
            .for_each(|(i, element)| self.read(i, element));
        if let Some(sparse) = &self.sparse {
            for i in 0..sparse.indices.count {
                let at = sparse.indices.integer(i) as usize * N;
                sparse.values.read(i, &mut floats[at..at + N]);
            }
        }
        Vertices::new(floats.into(), N, self.count)
    }

    /// The floats where they are in the file.
    fn mapped_floats<const N: usize>(&self) -> Option<Vertices<N>> {
        let view = self.view?;
        let as_is = self.component == ComponentType::F32 && self.components == N;
        if !as_is || self.sparse.is_some() || self.count == 0 || !self.stride.is_multiple_of(4) {
            return None;
        }
        let stride = self.stride / 4;
        let needed = (self.count - 1) * stride + N;
        let padded = (self.count - 1) * stride + LAST_READ.max(N);
        let available = view.bytes.available_from(self.start) / 4;
        let floats = view.bytes.view(self.start, padded.min(available).max(needed))?;
        Vertices::new(floats, stride, self.count)
    }

    /// The elements as integers, and whether they could stay where they are.
    pub(super) fn integers(&self) -> Buffer<u32> {
        let integers: Vec<u32> = match &self.sparse {
            None => (0..self.count).into_par_iter().map(|i| self.integer(i)).collect(),
            Some(sparse) => {
                let mut integers: Vec<u32> = (0..self.count).map(|i| self.integer(i)).collect();
                for i in 0..sparse.indices.count {
                    integers[sparse.indices.integer(i) as usize] = sparse.values.integer(i);
                }
                integers
            }
        };
        integers.into()
    }

    /// Triples of u32 where they are in the file; what is left over is left out.
    pub(super) fn mapped_triangles(&self) -> Option<Buffer<[u32; 3]>> {
        let view = self.view?;
        let as_is =
            self.component == ComponentType::U32 && self.components == 1 && self.stride == 4;
        if !as_is || self.sparse.is_some() {
            return None;
        }
        view.bytes.view(self.start, self.count / 3)
    }

    /// True if its elements are whole numbers that can count vertices.
    pub(super) fn is_index(&self) -> bool {
        use ComponentType::{U8, U16, U32};
        self.components == 1 && matches!(self.component, U8 | U16 | U32)
    }

    /// Component 0 of element `i` as a whole number; 0 without data.
    fn integer(&self, i: usize) -> u32 {
        let bytes = self.element(i);
        match self.component {
            ComponentType::U8 => bytes.first().copied().unwrap_or(0).into(),
            ComponentType::U16 => u16::from_le_bytes(head(bytes)).into(),
            _ => u32::from_le_bytes(head(bytes)),
        }
    }

    /// Writes the components of element `i` to the front of `to`; zeros without data.
    fn read(&self, i: usize, to: &mut [f32]) {
        let bytes = self.element(i);
        let size = self.component.size();
        for (k, value) in to.iter_mut().take(self.components).enumerate() {
            let bytes = bytes.get(k * size..).unwrap_or_default();
            *value = component(self.component, self.normalized, bytes);
        }
    }

    fn element(&self, i: usize) -> &[u8] {
        match self.view {
            Some(view) => &view.bytes.as_slice()[self.start + i * self.stride..],
            None => &[],
        }
    }
}

/// One component as a float. Normalized integers become 0..=1 or −1..=1 (glTF 2.0, section
/// 3.11.1); others keep their value.
#[expect(clippy::cast_precision_loss, reason = "u32 components exist in no float attribute")]
fn component(kind: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let signed = |value: f32, most: f32| if normalized { (value / most).max(-1.0) } else { value };
    let unsigned = |value: f32, most: f32| if normalized { value / most } else { value };
    match kind {
        ComponentType::I8 => signed(i8::from_le_bytes(head(bytes)).into(), 127.0),
        ComponentType::U8 => unsigned(u8::from_le_bytes(head(bytes)).into(), 255.0),
        ComponentType::I16 => signed(i16::from_le_bytes(head(bytes)).into(), 32767.0),
        ComponentType::U16 => unsigned(u16::from_le_bytes(head(bytes)).into(), 65535.0),
        ComponentType::U32 => u32::from_le_bytes(head(bytes)) as f32,
        ComponentType::F32 => f32::from_le_bytes(head(bytes)),
    }
}

/// The first bytes; zeros where there are none.
fn head<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

fn components(kind: Type) -> usize {
    match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    }
}
