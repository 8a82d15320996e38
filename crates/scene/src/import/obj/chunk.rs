//! One piece of an OBJ file: its vertices, faces and statements, with indices that are absolute
//! already or still relative to the piece.

use crate::import::precision::single;
use crate::import::text::{Fault, Words, number, whole};

/// The index of a corner that has none.
pub(super) const NONE: u32 = u32::MAX;

/// What lines of an OBJ model begin with (Wavefront Technologies, appendix B1).
const STATEMENTS: [&[u8]; 14] = [
    b"s", b"v", b"vt", b"vn", b"vp", b"f", b"fo", b"l", b"p", b"o", b"g", b"usemtl", b"mtllib",
    b"cstype",
];

/// Whether a line that begins with `word` is neither one that is looked at nor a comment.
fn is_foreign(word: &[u8]) -> bool {
    !word.starts_with(b"#") && !STATEMENTS.contains(&word)
}

/// What corners index: positions, texture coordinates, normals.
pub(super) const KINDS: usize = 3;
pub(super) const V: usize = 0;
pub(super) const VT: usize = 1;
pub(super) const VN: usize = 2;

/// What is to be read beside positions and faces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wish {
    pub uvs: bool,
    pub normals: bool,
    pub colors: bool,
}

/// What a piece of the file holds.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub positions: Vec<[f64; 3]>,
    /// Colours of the first positions; those behind have none.
    pub colors: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
    /// How many of each kind are defined here, read or not.
    pub defined: [usize; KINDS],
    /// The corners of all faces, by kind; empty for a kind that no face of this piece names.
    pub corners: [Vec<u32>; KINDS],
    /// Corners that count backwards: kind, corner, and index relative to the piece's first.
    pub relative: Vec<(usize, usize, i64)>,
    /// Where faces with other than three corners are.
    pub polygons: Vec<Polygon>,
    /// Statements, with the number of corners read before each.
    pub statements: Vec<(usize, Statement)>,
    /// Lines and points, which have no surface.
    pub without_surface: u64,
    /// Curves and surfaces of splines.
    pub free_form: u64,
    /// Faces of fewer than three corners.
    pub too_small: u64,
    /// Where the first line begins that no statement of OBJ begins like, and how it begins.
    pub foreign: Option<(usize, String)>,
    /// Some line is one of OBJ.
    pub is_obj: bool,
}

/// A face with other than three corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polygon {
    /// Its first corner in the piece.
    pub first: usize,
    pub corners: usize,
}

/// A line that changes how faces are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Statement {
    /// `o` or `g`.
    Name(String),
    /// `usemtl`.
    Material(String),
    /// `mtllib`, as written.
    Library(String),
}

impl Chunk {
    /// Reads `text`, which starts and ends with whole lines.
    pub(super) fn parse(text: &[u8], wish: Wish) -> Result<Self, Fault> {
        let mut chunk = Self::default();
        let mut words = Words::new(text);
        while !words.is_done() {
            let word = words.word();
            chunk.is_obj |= word.is_some_and(|word| STATEMENTS.contains(&word));
            match word {
                Some(b"v") => chunk.vertex(&mut words, wish)?,
                Some(b"f" | b"fo") => chunk.face(&mut words, wish)?,
                Some(b"vt") => chunk.uv(&mut words, wish)?,
                Some(b"vn") => chunk.normal(&mut words, wish)?,
                Some(b"o" | b"g") => {
                    let name = Statement::Name(string(words.rest()));
                    chunk.statements.push((chunk.corners[V].len(), name));
                    continue;
                }
                Some(b"usemtl") => {
                    let name = Statement::Material(string(words.rest()));
                    chunk.statements.push((chunk.corners[V].len(), name));
                    continue;
                }
                Some(b"mtllib") => {
                    let files = Statement::Library(string(words.rest()));
                    chunk.statements.push((chunk.corners[V].len(), files));
                    continue;
                }
                Some(b"l" | b"p") => chunk.without_surface += 1,
                Some(b"curv" | b"curv2" | b"surf") => chunk.free_form += 1,
                Some(other) if chunk.foreign.is_none() && is_foreign(other) => {
                    chunk.foreign = Some((words.at() - other.len(), string(other)));
                }
                // Comments, smoothing groups, display attributes, blank lines.
                _ => {}
            }
            words.end_line();
        }
        Ok(chunk)
    }

    fn vertex(&mut self, words: &mut Words<'_>, wish: Wish) -> Result<(), Fault> {
        let position = floats::<3>(words, 3)?;
        self.positions.push(position);
        self.defined[V] += 1;
        if wish.colors {
            self.vertex_color(words);
        }
        Ok(())
    }

    /// `v x y z r g b`; a fourth number alone is a weight, which only curves use.
    fn vertex_color(&mut self, words: &mut Words<'_>) {
        let mut color = [0.0; 3];
        for value in &mut color {
            let Some(number) = words.word().and_then(number) else { return };
            *value = single(number);
        }
        // Positions before that have no colour are white.
        self.colors.resize(self.positions.len() - 1, [1.0; 3]);
        self.colors.push(color);
    }

    fn uv(&mut self, words: &mut Words<'_>, wish: Wish) -> Result<(), Fault> {
        self.defined[VT] += 1;
        if wish.uvs {
            let [u, v] = floats::<2>(words, 1)?;
            // OBJ's v runs up, ours down.
            self.uvs.push([single(u), single(1.0 - v)]);
        }
        Ok(())
    }

    fn normal(&mut self, words: &mut Words<'_>, wish: Wish) -> Result<(), Fault> {
        self.defined[VN] += 1;
        if wish.normals {
            self.normals.push(floats::<3>(words, 3)?.map(single));
        }
        Ok(())
    }

    fn face(&mut self, words: &mut Words<'_>, wish: Wish) -> Result<(), Fault> {
        let first = self.corners[V].len();
        while let Some(word) = words.word() {
            let at = words.at() - word.len();
            if word[0] == b'#' {
                break;
            }
            let corner = self.corners[V].len();
            let mut parts = word.split(|&byte| byte == b'/');
            let (v, vt, vn) = (parts.next(), parts.next(), parts.next());
            self.index(V, corner, v, at)?;
            if wish.uvs {
                self.index(VT, corner, vt, at)?;
            }
            if wish.normals {
                self.index(VN, corner, vn, at)?;
            }
        }
        let corners = self.corners[V].len() - first;
        if corners < 3 {
            self.too_small += 1;
            self.cut_corners(first);
        } else if corners > 3 {
            self.polygons.push(Polygon { first, corners });
        }
        Ok(())
    }

    fn cut_corners(&mut self, len: usize) {
        self.corners.iter_mut().for_each(|indices| indices.truncate(len));
        // They came in the order of their corners.
        let kept = self.relative.partition_point(|&(_, corner, _)| corner < len);
        self.relative.truncate(kept);
    }

    /// Stores one index of a corner.
    #[inline]
    fn index(
        &mut self,
        kind: usize,
        corner: usize,
        word: Option<&[u8]>,
        at: usize,
    ) -> Result<(), Fault> {
        let word = match word {
            None | Some([]) if kind != V => return Ok(()),
            word => word.unwrap_or_default(),
        };
        let index = match whole(word) {
            Some(index @ 1..) => u32::try_from(index - 1).ok().filter(|&index| index != NONE),
            Some(0) | None => None,
            Some(back) => {
                let local = i64::try_from(self.defined[kind]).unwrap_or(i64::MAX) + back;
                self.relative.push((kind, corner, local));
                Some(0)
            }
        };
        let Some(index) = index else {
            return Err(Fault::new(
                at,
                format!(
                    "\"{}\" is not the number of a vertex; they count from 1, or back from -1",
                    String::from_utf8_lossy(word)
                ),
            ));
        };
        let indices = &mut self.corners[kind];
        if kind != V && indices.len() < corner {
            indices.resize(corner, NONE);
        }
        indices.push(index);
        Ok(())
    }
}

/// The next `N` numbers of the line, of which the first `needed` have to be there.
#[inline]
fn floats<const N: usize>(words: &mut Words<'_>, needed: usize) -> Result<[f64; N], Fault> {
    let mut values = [0.0; N];
    for (i, value) in values.iter_mut().enumerate() {
        match words.word() {
            Some(word) => match number(word) {
                Some(number) => *value = number,
                None => {
                    let word_at = words.at() - word.len();
                    let text = String::from_utf8_lossy(word);
                    return Err(Fault::new(word_at, format!("\"{text}\" is not a number")));
                }
            },
            None if i < needed => {
                return Err(Fault::new(words.at(), format!("{needed} numbers are needed")));
            }
            None => break,
        }
    }
    Ok(values)
}

/// Text as UTF-8; what is not (older files are Latin-1) is replaced by signs that show it.
fn string(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
