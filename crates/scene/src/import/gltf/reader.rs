//! The reader of a document, and the views of its buffers.

use std::fmt::Display;
use std::path::Path;
use std::sync::OnceLock;

use gltf::json;

use super::buffers::{Buffers, Bytes, Unread};
use super::document::{GltfDocument, absent};
use super::draco::DracoMesh;
use super::meshopt::MeshoptView;
use super::tracks::Playing;
use crate::import::error::damaged;
use crate::import::files::Files;
use crate::import::{Options, Refusal, Wanted};

/// State that the parts of the reader share.
pub(super) struct GltfReader<'a> {
    /// The model, for messages.
    pub(super) file: &'a Path,
    pub(super) files: &'a Files,
    pub(super) document: &'a GltfDocument,
    pub(super) buffers: &'a Buffers,
    /// The meshes of views that Draco compressed, once somebody needs them.
    pub(super) meshes_of_views: Vec<OnceLock<DracoMesh>>,
    pub(super) wanted: Wanted,
    pub(super) options: &'a Options,
    /// Nodes and weights that go on from the moment that is shown.
    pub(super) playing: &'a Playing,
}

impl GltfReader<'_> {
    /// An error that names the file, `place` and `reason`.
    pub(super) fn damaged(&self, place: impl Display, reason: impl Into<Refusal>) -> Refusal {
        damaged(self.file, place, reason)
    }

    /// The error that `from` names the `what` number `index`, of which there are only `count`.
    pub(super) fn absent(
        &self,
        from: impl Display,
        what: &str,
        index: usize,
        count: usize,
    ) -> Refusal {
        absent(self.file, from, what, index, count)
    }

    /// The bytes of buffer `index`, which `from` names.
    fn buffer(&self, index: usize, from: &str) -> Result<&Bytes, Refusal> {
        match self.buffers.buffers.get(index) {
            Some(Ok(bytes)) => Ok(bytes),
            Some(Err(Unread)) => Err(self.damaged(
                format!("buffers[{index}]"),
                "it has neither a uri nor a binary chunk\nhint: export the file again",
            )),
            None => Err(self.absent(
                format!("{from}.buffer"),
                "buffer",
                index,
                self.buffers.buffers.len(),
            )),
        }
    }

    /// The buffer of view `index`, and where in it the view starts and how long it is (bytes);
    /// `from` is who names the view.
    pub(super) fn view(&self, index: usize, from: &str) -> Result<BufferView<'_>, Refusal> {
        let place = || format!("bufferViews[{index}]");
        let views = &self.document.root.buffer_views;
        let Some(view) = views.get(index) else {
            return Err(self.absent(from, "buffer view", index, views.len()));
        };
        let stride = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0);
        if let Some(compressed) = MeshoptView::of(view) {
            let bytes = self.decompressed(index, &compressed)?;
            return Ok(BufferView { bytes, start: 0, len: bytes.as_slice().len(), stride });
        }
        let bytes = self.buffer(view.buffer.value(), &place())?;
        let total = bytes.as_slice().len();
        let range = size(view.byte_offset.unwrap_or_default())
            .zip(size(view.byte_length))
            .filter(|&(start, len)| start.checked_add(len).is_some_and(|end| end <= total));
        let Some((start, len)) = range else {
            return Err(self.damaged(
                place(),
                format!(
                    "{} bytes from byte {} on lie outside its buffer of {total} bytes\nhint: export the \
                     file again",
                    view.byte_length.0,
                    view.byte_offset.unwrap_or_default().0
                ),
            ));
        };
        Ok(BufferView { bytes, start, len, stride })
    }

    /// The bytes of the compressed view `index`, decoded once.
    fn decompressed(&self, index: usize, compressed: &MeshoptView<'_>) -> Result<&Bytes, Refusal> {
        let known = &self.buffers.decoded[index];
        if let Some(bytes) = known.get() {
            return Ok(bytes);
        }
        let place = format!("bufferViews[{index}].extensions.{}", compressed.name);
        let stream = compressed.stream().map_err(|reason| self.damaged(&place, reason))?;
        let buffer = self.buffer(stream.buffer, &place)?.as_slice();
        let end = stream.start.checked_add(stream.len);
        let Some(packed) = end.and_then(|end| buffer.get(stream.start..end)) else {
            let reason = format!(
                "{} bytes from byte {} on lie outside its buffer of {} bytes\nhint: export the file again",
                stream.len,
                stream.start,
                buffer.len()
            );
            return Err(self.damaged(place, reason));
        };
        let bytes = stream.decode(packed).map_err(|reason| self.damaged(place, reason))?;
        Ok(known.get_or_init(|| Bytes::Memory(bytes.into())))
    }
}

/// Part of a buffer.
#[derive(Clone, Copy)]
pub(super) struct BufferView<'a> {
    pub bytes: &'a Bytes,
    pub start: usize,
    pub len: usize,
    pub stride: Option<usize>,
}

/// A JSON size as this machine counts.
pub(super) fn size(value: json::validation::USize64) -> Option<usize> {
    usize::try_from(value.0).ok()
}
