//! glTF documents put together accessor by accessor.

use serde_json::{Value, json};

/// Builds a glTF document and its bytes, accessor by accessor.
#[derive(Default)]
pub(crate) struct Builder {
    pub(crate) bytes: Vec<u8>,
    views: Vec<Value>,
    pub(crate) accessors: Vec<Value>,
}

impl Builder {
    pub(crate) fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let mut view =
            json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    pub(crate) fn accessor(&mut self, kind: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes, None);
        self.accessors.push(
            json!({"bufferView": view, "componentType": kind, "type": shape, "count": count}),
        );
        self.accessors.len() - 1
    }

    pub(crate) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let shape = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        self.accessor(5126, shape, values.len(), &bytes)
    }

    pub(crate) fn u32s(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(5125, "SCALAR", values.len(), &bytes)
    }

    /// The document with `rest` and a node for mesh 0 unless it has its own.
    pub(crate) fn document(&self, rest: Value) -> Value {
        let mut document = json!({
            "asset": {"version": "2.0"},
            "nodes": [{"mesh": 0}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len()}],
        });
        for (key, value) in rest.as_object().unwrap() {
            document[key] = value.clone();
        }
        document
    }

    pub(crate) fn glb(&self, rest: Value) -> Vec<u8> {
        glb(&self.document(rest), &self.bytes)
    }
}

pub(crate) fn glb(document: &Value, bytes: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = bytes.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let word = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut file = Vec::new();
    file.extend(b"glTF");
    file.extend(word(2));
    file.extend(word(total));
    file.extend(word(json.len()));
    file.extend(b"JSON");
    file.extend(json);
    file.extend(word(binary.len()));
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

pub(crate) const SQUARE: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];

/// A GLB with one primitive over [`SQUARE`] with these attributes beside it.
pub(crate) fn square_glb(
    primitive: Value,
    rest: Value,
    build: impl FnOnce(&mut Builder),
) -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    build(&mut builder);
    let mut primitive = primitive;
    if primitive["attributes"].is_null() {
        primitive["attributes"] = json!({});
    }
    primitive["attributes"]["POSITION"] = json!(positions);
    let mut rest = rest;
    rest["meshes"] = json!([{"primitives": [primitive]}]);
    builder.glb(rest)
}
