//! The binary container: a header, a chunk of JSON, a chunk of bytes (glTF 2.0, section 4).

use std::path::Path;
use std::sync::Arc;

use etendue_files::MappedFile;

use super::buffers::Bytes;
use super::damaged;
use crate::import::text::without_mark;
use crate::import::{ImportError, refuse_other_kind};

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
pub(super) fn open<'a>(
    path: &Path,
    map: &'a Arc<MappedFile>,
) -> Result<Container<'a>, ImportError> {
    let bytes = map.bytes();
    if !bytes.starts_with(MAGIC) {
        refuse_other_kind(path, bytes, "glTF")?;
        return Ok(Container { json: without_mark(bytes), in_glb: false, binary: None });
    }
    let broken = |reason: String| damaged(path, "GLB header", reason);
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(broken("the file ends inside its header; copy or export it again".into()));
    };
    if version == 1 {
        return Err(broken(super::first_version()));
    }
    if version != 2 {
        return Err(broken(format!("version {version} instead of 2; export it as glTF 2.0")));
    }
    let length = length as usize;
    let Some(bytes) = bytes.get(..length) else {
        return Err(broken(format!(
            "it should be {length} bytes long but is cut off after {}; copy or export it again",
            bytes.len()
        )));
    };
    let mut chunks = Chunks { bytes, at: 12 };
    let json = match chunks.next(path)? {
        Some((JSON, start, len)) => without_mark(&bytes[start..start + len]),
        Some((kind, ..)) => {
            let kind = String::from_utf8_lossy(&kind.to_le_bytes()).escape_debug().to_string();
            let reason =
                format!("the first chunk is of kind \"{kind}\", not JSON; export it again");
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
    fn next(&mut self, path: &Path) -> Result<Option<(u32, usize, usize)>, ImportError> {
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
                     file is cut off; copy or export it again",
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
