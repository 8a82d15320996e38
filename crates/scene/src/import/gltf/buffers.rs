//! Where the bytes of a glTF file are: in the GLB, in files beside it, in data URIs.

use std::path::Path;
use std::sync::Arc;

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use bytemuck::AnyBitPattern;
use etendue_geometry::{Buffer, MappedFile};
use gltf::json;

use super::document::Document;
use super::{Reader, damaged};
use crate::import::ImportError;
use crate::import::files::Files;

/// Data URIs come with and without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Bytes in a mapped file or in memory.
#[derive(Debug, Clone)]
pub(super) enum Bytes {
    Mapped { file: Arc<MappedFile>, start: usize, len: usize },
    Memory(Buffer<u8>),
}

impl Bytes {
    pub(super) fn as_slice(&self) -> &[u8] {
        match self {
            Self::Mapped { file, start, len } => &file.bytes()[*start..*start + *len],
            Self::Memory(bytes) => bytes,
        }
    }

    /// `len` values from byte `at`, without a copy; `None` where they are not mapped, not aligned
    /// or not in this machine's byte order. They may lie behind the end of these bytes, as long as
    /// the file has them.
    pub(super) fn view<T: AnyBitPattern>(&self, at: usize, len: usize) -> Option<Buffer<T>> {
        match self {
            Self::Mapped { file, start, .. } if cfg!(target_endian = "little") => {
                Buffer::from_file(file, start.checked_add(at)?, len)
            }
            _ => None,
        }
    }

    /// Bytes from `at` to the end of the file.
    pub(super) fn available_from(&self, at: usize) -> usize {
        match self {
            Self::Mapped { file, start, .. } => file.bytes().len().saturating_sub(start + at),
            Self::Memory(bytes) => bytes.len().saturating_sub(at),
        }
    }
}

/// The buffers of a document; those that cannot be read say so once somebody needs them.
pub(super) struct Buffers {
    buffers: Vec<Result<Bytes, Unread>>,
}

/// A buffer without bytes of its own: another extension's placeholder.
struct Unread;

impl Buffers {
    /// Opens all buffers that buffer views use.
    pub(super) fn open(
        path: &Path,
        files: &Files,
        document: &Document,
        binary: Option<Bytes>,
    ) -> Result<Self, ImportError> {
        let mut used = vec![false; document.root.buffers.len()];
        for view in &document.root.buffer_views {
            if let Some(used) = used.get_mut(view.buffer.value()) {
                *used = true;
            }
        }
        let mut buffers = Vec::with_capacity(used.len());
        for (index, (buffer, used)) in document.root.buffers.iter().zip(used).enumerate() {
            let binary = if index == 0 { binary.clone() } else { None };
            buffers.push(match (used, &buffer.uri, binary) {
                (true, Some(uri), _) => Ok(open_uri(path, files, index, buffer, uri)?),
                (true, None, Some(binary)) => Ok(checked(path, index, buffer, binary)?),
                _ => Err(Unread),
            });
        }
        Ok(Self { buffers })
    }
}

impl Reader<'_> {
    /// The bytes of buffer `index`.
    fn buffer(&self, index: usize) -> Result<&Bytes, ImportError> {
        match self.buffers.buffers.get(index) {
            Some(Ok(bytes)) => Ok(bytes),
            Some(Err(Unread)) => Err(self.damaged(
                format!("buffers[{index}]"),
                "it has neither a uri nor a binary chunk; export the file again",
            )),
            None => Err(self.damaged(format!("buffers[{index}]"), "there is no such buffer")),
        }
    }

    /// The buffer of view `index`, and where in it the view starts and how long it is (bytes).
    pub(super) fn view(&self, index: usize) -> Result<View<'_>, ImportError> {
        let place = || format!("bufferViews[{index}]");
        let Some(view) = self.document.root.buffer_views.get(index) else {
            return Err(self.damaged(place(), "there is no such buffer view"));
        };
        let buffer = self.buffer(view.buffer.value());
        super::extensions::refuse_compressed_view(self.file, view, buffer.is_ok())?;
        let bytes = buffer?;
        let total = bytes.as_slice().len();
        let range = size(view.byte_offset.unwrap_or_default())
            .zip(size(view.byte_length))
            .filter(|&(start, len)| start.checked_add(len).is_some_and(|end| end <= total));
        let Some((start, len)) = range else {
            return Err(self.damaged(
                place(),
                format!(
                    "{} bytes from byte {} on lie outside its buffer of {total} bytes; export the \
                     file again",
                    view.byte_length.0,
                    view.byte_offset.unwrap_or_default().0
                ),
            ));
        };
        let stride = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0);
        Ok(View { bytes, start, len, stride })
    }
}

/// Part of a buffer.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub bytes: &'a Bytes,
    pub start: usize,
    pub len: usize,
    pub stride: Option<usize>,
}

fn open_uri(
    path: &Path,
    files: &Files,
    index: usize,
    buffer: &json::Buffer,
    uri: &str,
) -> Result<Bytes, ImportError> {
    let place = || format!("buffers[{index}].uri");
    if let Some(data) = data_uri(uri) {
        let bytes = data.map_err(|reason| damaged(path, place(), reason))?;
        return checked(path, index, buffer, Bytes::Memory(bytes.into()));
    }
    let written = percent_decoded(uri);
    let Some(found) = files.locate(&written)? else {
        return Err(damaged(
            path,
            place(),
            format!("\"{written}\" does not exist; put it beside the model"),
        ));
    };
    let file = files.map(&found)?;
    let len = file.bytes().len();
    checked(path, index, buffer, Bytes::Mapped { file, start: 0, len })
}

/// `bytes` cut to the length that the document promises.
fn checked(
    path: &Path,
    index: usize,
    buffer: &json::Buffer,
    bytes: Bytes,
) -> Result<Bytes, ImportError> {
    let has = bytes.as_slice().len();
    let promised = buffer.byte_length.0;
    match usize::try_from(promised) {
        Ok(promised) if promised <= has => Ok(match bytes {
            Bytes::Mapped { file, start, .. } => Bytes::Mapped { file, start, len: promised },
            memory @ Bytes::Memory(_) => memory,
        }),
        _ => Err(damaged(
            path,
            format!("buffers[{index}]"),
            format!(
                "it should have {promised} bytes but is cut off after {has}; copy or export the \
                 file again"
            ),
        )),
    }
}

/// The bytes of a `data:` URI; `None` when `uri` is none.
pub(super) fn data_uri(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let rest = uri.strip_prefix("data:")?;
    let Some((kind, data)) = rest.split_once(',') else {
        return Some(Err("the data URI has no comma before its data".to_owned()));
    };
    if !kind.ends_with(";base64") {
        return Some(Ok(percent_decoded_bytes(data)));
    }
    Some(BASE64.decode(data).map_err(|error| format!("the data URI is not base64: {error}")))
}

/// `uri` with its percent escapes (RFC 3986, section 2.1) undone; those that are none stay.
pub(super) fn percent_decoded(uri: &str) -> String {
    String::from_utf8(percent_decoded_bytes(uri)).unwrap_or_else(|_| uri.to_owned())
}

fn percent_decoded_bytes(uri: &str) -> Vec<u8> {
    let mut rest = uri.as_bytes();
    let mut decoded = Vec::with_capacity(rest.len());
    while let [first, tail @ ..] = rest {
        let escape = if *first == b'%' { tail.get(..2).and_then(hex_pair) } else { None };
        match escape {
            Some(byte) => {
                decoded.push(byte);
                rest = &tail[2..];
            }
            None => {
                decoded.push(*first);
                rest = tail;
            }
        }
    }
    decoded
}

fn hex_pair(pair: &[u8]) -> Option<u8> {
    let digit = |byte: u8| char::from(byte).to_digit(16);
    u8::try_from(digit(pair[0])? * 16 + digit(pair[1])?).ok()
}

/// A JSON size as this machine counts.
pub(super) fn size(value: json::validation::USize64) -> Option<usize> {
    usize::try_from(value.0).ok()
}
