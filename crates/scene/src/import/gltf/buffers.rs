//! Buffers of a glTF file: its bytes in the GLB, in files beside it, in data URIs.
//!
//! The binary container: a header, a chunk of JSON, a chunk of bytes (glTF 2.0, section 4).

use std::path::Path;
use std::sync::{Arc, OnceLock};

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine as _};
use bytemuck::AnyBitPattern;
use gltf::json;

use super::document::{GltfDocument, first_version};
use super::meshopt::MeshoptView;
use crate::import::Refusal;
use crate::import::error::damaged;
use crate::import::files::{Files, refuse_other_kind};
use crate::import::text::without_mark;
use etendue_files::MappedFile;
use etendue_geometry::Buffer;

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
    pub(super) buffers: Vec<Result<Bytes, Unread>>,
    /// The bytes of compressed views, once somebody needs them.
    pub(super) decoded: Vec<OnceLock<Bytes>>,
}

/// A buffer without bytes of its own: another extension's placeholder.
pub(super) struct Unread;

impl Buffers {
    /// Opens all buffers that buffer views use.
    pub(super) fn open(
        path: &Path,
        files: &Files,
        document: &GltfDocument,
        binary: Option<Bytes>,
    ) -> Result<Self, Refusal> {
        let mut used = vec![false; document.root.buffers.len()];
        for view in &document.root.buffer_views {
            // The buffer of a compressed view itself is a placeholder, or holds it in plain.
            let buffer = MeshoptView::of(view).and_then(|packed| packed.buffer());
            if let Some(used) = used.get_mut(buffer.unwrap_or(view.buffer.value())) {
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
        let mut decoded = Vec::new();
        decoded.resize_with(document.root.buffer_views.len(), OnceLock::new);
        Ok(Self { buffers, decoded })
    }
}

fn open_uri(
    path: &Path,
    files: &Files,
    index: usize,
    buffer: &json::Buffer,
    uri: &str,
) -> Result<Bytes, Refusal> {
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
            format!("\"{written}\" does not exist\nhint: put it beside the model"),
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
) -> Result<Bytes, Refusal> {
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
                "it should have {promised} bytes but is cut off after {has}\nhint: copy or export the \
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
    Some(BASE64.decode(data).map_err(|error| not_base64(&error)))
}

fn not_base64(error: &DecodeError) -> String {
    let why = match *error {
        DecodeError::InvalidByte(at, byte) => {
            format!("character {} is {:?}", at + 1, char::from(byte))
        }
        DecodeError::InvalidLength(len) => {
            format!("{len} characters are no whole number of bytes; it is cut off")
        }
        DecodeError::InvalidLastSymbol { offset, .. } => {
            format!("character {}, the last, cannot end it; it is cut off", offset + 1)
        }
        DecodeError::InvalidPadding => "the `=` at its end are too few or too many".to_owned(),
    };
    format!("the data URI is not sound base64: {why}\nhint: export the file again")
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

const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// A glTF file's JSON and, in a GLB, its bytes.
pub(super) struct Container<'a> {
    pub json: &'a [u8],
    pub in_glb: bool,
    pub binary: Option<Bytes>,
}

/// Splits `map` into JSON and bytes. A file without GLB's magic number is JSON throughout,
/// whatever its ending.
pub(super) fn open<'a>(path: &Path, map: &'a Arc<MappedFile>) -> Result<Container<'a>, Refusal> {
    let bytes = map.bytes();
    if !bytes.starts_with(MAGIC) {
        refuse_other_kind(path, bytes, "glTF")?;
        return Ok(Container { json: without_mark(bytes), in_glb: false, binary: None });
    }
    let broken = |reason: String| damaged(path, "GLB header", reason);
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(broken(
            "the file ends inside its header\nhint: copy or export it again".into(),
        ));
    };
    if version == 1 {
        return Err(broken(first_version()));
    }
    if version != 2 {
        return Err(broken(format!("version {version} instead of 2\nhint: export it as glTF 2.0")));
    }
    let length = length as usize;
    let Some(bytes) = bytes.get(..length) else {
        return Err(broken(format!(
            "it should be {length} bytes long but is cut off after {}\nhint: copy or export it again",
            bytes.len()
        )));
    };
    let mut chunks = Chunks { bytes, at: 12 };
    let json = match chunks.next(path)? {
        Some((JSON, start, len)) => without_mark(&bytes[start..start + len]),
        Some((kind, ..)) => {
            let kind = String::from_utf8_lossy(&kind.to_le_bytes()).escape_debug().to_string();
            let reason =
                format!("the first chunk is of kind \"{kind}\", not JSON\nhint: export it again");
            return Err(broken(reason));
        }
        None => {
            let reason = "the file ends before its first chunk; copy or export it again";
            return Err(broken(reason.to_owned()));
        }
    };
    let mut binary = None;
    while let Some((kind, start, len)) = chunks.next(path)? {
        if kind == BIN && binary.is_none() {
            binary = Some(Bytes::Mapped { file: Arc::clone(map), start, len });
        }
    }
    Ok(Container { json, in_glb: true, binary })
}

/// Walks the chunks of a file.
struct Chunks<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Chunks<'_> {
    /// The kind, start and length of the next chunk.
    fn next(&mut self, path: &Path) -> Result<Option<(u32, usize, usize)>, Refusal> {
        // Up to three bytes of padding may follow the last chunk.
        if self.at + 8 > self.bytes.len() {
            return Ok(None);
        }
        let (Some(len), Some(kind)) = (word(self.bytes, self.at), word(self.bytes, self.at + 4))
        else {
            return Ok(None);
        };
        let (start, len) = (self.at + 8, len as usize);
        if len > self.bytes.len() - start {
            return Err(damaged(
                path,
                format!("GLB chunk at byte {}", self.at),
                format!(
                    "it should be {len} bytes long but only {} follow: this length is wrong, {}the \
                     file is cut off\nhint: copy or export it again",
                    self.bytes.len() - start,
                    if self.at > 12 { "or that of the chunk before, or " } else { "or " }
                ),
            ));
        }
        self.at = start + len.next_multiple_of(4);
        Ok(Some((kind, start, len)))
    }
}

/// The little-endian word at byte `at`.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}
