//! All vertices of a file together, and the indices that name them.

use rayon::prelude::*;

use super::chunk::{Chunk, KINDS, NONE, V, VN, VT};
use crate::import::Strictness;
use crate::import::text::{Fault, Words, whole};

/// Everything that corners name, in the order of the file.
pub(super) struct Pool {
    pub positions: Vec<[f64; 3]>,
    /// Empty when no vertex has a colour, else one each.
    pub colors: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
}

impl Pool {
    /// Takes the vertices out of `chunks`.
    pub(super) fn gather(chunks: &mut [Chunk]) -> Self {
        let colored = chunks.iter().any(|chunk| !chunk.colors.is_empty());
        for chunk in chunks.iter_mut().filter(|_| colored) {
            chunk.colors.resize(chunk.positions.len(), [1.0; 3]);
        }
        Self {
            positions: concat(chunks, |chunk| &mut chunk.positions),
            colors: concat(chunks, |chunk| &mut chunk.colors),
            uvs: concat(chunks, |chunk| &mut chunk.uvs),
            normals: concat(chunks, |chunk| &mut chunk.normals),
        }
    }
}

/// One array of the arrays of all chunks, which are emptied as they are copied.
fn concat<T: Copy>(chunks: &mut [Chunk], part: impl Fn(&mut Chunk) -> &mut Vec<T>) -> Vec<T> {
    if let [only] = chunks {
        return std::mem::take(part(only));
    }
    let mut parts: Vec<Vec<T>> =
        chunks.iter_mut().map(|chunk| std::mem::take(part(chunk))).collect();
    let mut all = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for part in &mut parts {
        all.extend_from_slice(part);
        *part = Vec::new();
    }
    all
}

/// How many of each kind come before each chunk, and in all.
fn bases(chunks: &[Chunk]) -> (Vec<[usize; KINDS]>, [usize; KINDS]) {
    let mut before = [0; KINDS];
    let mut bases = Vec::with_capacity(chunks.len());
    for chunk in chunks {
        bases.push(before);
        for (sum, here) in before.iter_mut().zip(chunk.defined) {
            *sum += here;
        }
    }
    (bases, before)
}

/// Makes all indices absolute and checks that what they name exists; on failure, a chunk that names
/// what does not. Texture coordinates and normals that do not exist are left out unless under
/// strict rules; so many there were.
pub(super) fn settle(chunks: &mut [Chunk], strictness: Strictness) -> Result<u64, usize> {
    let (bases, total) = bases(chunks);
    let settle_chunk = |(chunk, base): (&mut Chunk, &[usize; KINDS])| {
        for (kind, corner, local) in std::mem::take(&mut chunk.relative) {
            let index = i64::try_from(base[kind]).ok().and_then(|base| base.checked_add(local));
            let index = index.and_then(|index| u32::try_from(index).ok());
            // As large as an index can be: it names nothing either.
            chunk.corners[kind][corner] = index.unwrap_or(NONE - 1);
        }
        let mut missing = 0;
        for (kind, indices) in chunk.corners.iter_mut().enumerate() {
            let is_missing = |&index: &u32| index != NONE && index as usize >= total[kind];
            if !indices.par_iter().any(is_missing) {
                continue;
            }
            if kind == V || strictness == Strictness::Strict {
                return None;
            }
            for index in indices.iter_mut().filter(|index| is_missing(index)) {
                *index = NONE;
                missing += 1;
            }
        }
        Some(missing)
    };
    let settled: Vec<Option<u64>> = chunks.par_iter_mut().zip(&bases).map(settle_chunk).collect();
    let mut missing = 0;
    for (chunk, settled) in settled.into_iter().enumerate() {
        missing += settled.ok_or(chunk)?;
    }
    Ok(missing)
}

/// Where in chunk number `chunk` an index names what does not exist.
pub(super) fn find_bad_index(
    pieces: &[(usize, &[u8])],
    chunk: usize,
    chunks: &[Chunk],
    strictness: Strictness,
) -> Fault {
    let kinds = if strictness == Strictness::Strict { KINDS } else { V + 1 };
    let (bases, total) = bases(chunks);
    let (start, text) = pieces[chunk];
    let mut defined = bases[chunk];
    let mut words = Words::new(text);
    while !words.is_done() {
        match words.word() {
            Some(b"v") => defined[V] += 1,
            Some(b"vt") => defined[VT] += 1,
            Some(b"vn") => defined[VN] += 1,
            Some(b"f" | b"fo") => {
                while let Some(word) = words.word() {
                    if let Some(reason) = bad_corner(word, kinds, defined, total) {
                        return Fault::new(start + words.at() - word.len(), reason);
                    }
                }
            }
            _ => {}
        }
        words.end_line();
    }
    Fault::new(start, "a face names a vertex that does not exist")
}

fn bad_corner(
    word: &[u8],
    kinds: usize,
    defined: [usize; KINDS],
    total: [usize; KINDS],
) -> Option<String> {
    let names = ["vertices", "texture coordinates", "normals"];
    for (kind, part) in word.split(|&byte| byte == b'/').enumerate().take(kinds) {
        let Some(index) = whole(part) else { continue };
        let count = i64::try_from(total[kind]).ok()?;
        let before = i64::try_from(defined[kind]).ok()?;
        if index > count || (index < 0 && before + index < 0) {
            return Some(format!(
                "\"{}\" names number {index} of {} {}; export the file again",
                String::from_utf8_lossy(word),
                if index < 0 { before } else { count },
                names[kind]
            ));
        }
    }
    None
}
