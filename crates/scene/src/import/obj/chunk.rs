//! One piece of an OBJ file: its vertices, faces and statements, with indices that are absolute
//! already or still relative to the piece.
//!
//! What an MTL material says that cannot be so, or that is not looked at.
//!
//! Which faces belong together: those of one group or object with one material.

use std::collections::HashMap;
use std::ops::Range;

use crate::import::precision::single;
use crate::import::text::{TextFault, WordReader, number, whole};
use etendue_tracer::spec::BRIGHTEST;

/// The index of a corner that has none.
pub(super) const NONE: u32 = u32::MAX;

/// Words that lines of an OBJ model begin with (Wavefront Technologies, appendix B1).
const STATEMENTS: [&[u8]; 14] = [
    b"s", b"v", b"vt", b"vn", b"vp", b"f", b"fo", b"l", b"p", b"o", b"g", b"usemtl", b"mtllib",
    b"cstype",
];

/// True if a line that begins with `word` is neither one that is looked at nor a comment.
fn is_foreign(word: &[u8]) -> bool {
    !word.starts_with(b"#") && !STATEMENTS.contains(&word)
}

/// Number of kinds that corners index: positions, texture coordinates, normals.
pub(super) const KINDS: usize = 3;
pub(super) const V: usize = 0;
pub(super) const VT: usize = 1;
pub(super) const VN: usize = 2;

/// Columns to be read beside positions and faces.
#[derive(Debug, Clone, Copy)]
pub(super) struct WantedColumns {
    pub uvs: bool,
    pub normals: bool,
    pub colors: bool,
}

/// Content of a piece of the file.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub positions: Vec<[f64; 3]>,
    /// Colours of the first positions; those behind have none.
    pub colors: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
    /// Number of definitions of each kind here, read or not.
    pub defined: [usize; KINDS],
    /// The corners of all faces, by kind; empty for a kind that no face of this piece names.
    pub corners: [Vec<u32>; KINDS],
    /// Corners that count backwards: kind, corner, and index relative to the piece's first.
    pub relative: Vec<(usize, usize, i64)>,
    /// Faces with other than three corners.
    pub polygons: Vec<Polygon>,
    /// Statements, with the number of corners read before each.
    pub statements: Vec<(usize, FaceStatement)>,
    /// Lines and points, which have no surface.
    pub without_surface: u64,
    /// Curves and surfaces of splines.
    pub free_form: u64,
    /// Faces of fewer than three corners.
    pub too_small: u64,
    /// Position of the first line that no statement of OBJ begins like, and how it begins.
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
pub(super) enum FaceStatement {
    /// `o` or `g`.
    Name(String),
    /// `usemtl`.
    Material(String),
    /// `mtllib`, as written.
    Library(String),
}

impl Chunk {
    /// Reads `text`, which starts and ends with whole lines.
    pub(super) fn parse(text: &[u8], wish: WantedColumns) -> Result<Self, TextFault> {
        let mut chunk = Self::default();
        let mut words = WordReader::new(text);
        while !words.is_done() {
            let word = words.word();
            chunk.is_obj |= word.is_some_and(|word| STATEMENTS.contains(&word));
            match word {
                Some(b"v") => chunk.vertex(&mut words, wish)?,
                Some(b"f" | b"fo") => chunk.face(&mut words, wish)?,
                Some(b"vt") => chunk.uv(&mut words, wish)?,
                Some(b"vn") => chunk.normal(&mut words, wish)?,
                Some(b"o" | b"g") => {
                    let name = FaceStatement::Name(string(words.rest()));
                    chunk.statements.push((chunk.corners[V].len(), name));
                    continue;
                }
                Some(b"usemtl") => {
                    let name = FaceStatement::Material(string(words.rest()));
                    chunk.statements.push((chunk.corners[V].len(), name));
                    continue;
                }
                Some(b"mtllib") => {
                    let files = FaceStatement::Library(string(words.rest()));
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

    fn vertex(&mut self, words: &mut WordReader<'_>, wish: WantedColumns) -> Result<(), TextFault> {
        let position = floats::<3>(words, 3)?;
        self.positions.push(position);
        self.defined[V] += 1;
        if wish.colors {
            self.vertex_color(words);
        }
        Ok(())
    }

    /// `v x y z r g b`; a fourth number alone is a weight, which only curves use.
    fn vertex_color(&mut self, words: &mut WordReader<'_>) {
        let mut color = [0.0; 3];
        for value in &mut color {
            let Some(number) = words.word().and_then(number) else { return };
            *value = single(number);
        }
        // Positions before that have no colour are white.
        self.colors.resize(self.positions.len() - 1, [1.0; 3]);
        self.colors.push(color);
    }

    fn uv(&mut self, words: &mut WordReader<'_>, wish: WantedColumns) -> Result<(), TextFault> {
        self.defined[VT] += 1;
        if wish.uvs {
            let [u, v] = floats::<2>(words, 1)?;
            // OBJ's v runs up, ours down.
            self.uvs.push([single(u), single(1.0 - v)]);
        }
        Ok(())
    }

    fn normal(&mut self, words: &mut WordReader<'_>, wish: WantedColumns) -> Result<(), TextFault> {
        self.defined[VN] += 1;
        if wish.normals {
            self.normals.push(floats::<3>(words, 3)?.map(single));
        }
        Ok(())
    }

    fn face(&mut self, words: &mut WordReader<'_>, wish: WantedColumns) -> Result<(), TextFault> {
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
    ) -> Result<(), TextFault> {
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
            return Err(TextFault::new(
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
fn floats<const N: usize>(
    words: &mut WordReader<'_>,
    needed: usize,
) -> Result<[f64; N], TextFault> {
    let mut values = [0.0; N];
    for (i, value) in values.iter_mut().enumerate() {
        match words.word() {
            Some(word) => match number(word) {
                Some(number) => *value = number,
                None => {
                    let word_at = words.at() - word.len();
                    let text = String::from_utf8_lossy(word);
                    return Err(TextFault::new(word_at, format!("\"{text}\" is not a number")));
                }
            },
            None if i < needed => {
                return Err(TextFault::new(words.at(), format!("{needed} numbers are needed")));
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

/// The values that no surface can have, each with what becomes of it.
pub(super) fn impossible(material: &tobj::Material) -> Vec<String> {
    let outside = |color: Option<[f64; 3]>| {
        color.is_some_and(|color| !color.iter().all(|value| (0.0..=1.0).contains(value)))
    };
    let mut found = Vec::new();
    for (key, color) in [("Kd", material.diffuse), ("Ks", material.specular)] {
        if outside(color) {
            found.push(format!("{key} is outside 0 to 1; it is brought there"));
        }
    }
    if outside(material.dissolve.map(|d| [d; 3])) {
        found.push("d is outside 0 to 1; it is brought there".to_owned());
    }
    if material.shininess.is_some_and(|ns| !(0.0..f64::INFINITY).contains(&ns)) {
        found.push("Ns is below zero or not finite; 0 is taken".to_owned());
    }
    let is_glass = matches!(material.illumination_model, Some(4 | 6 | 7 | 9));
    if is_glass && material.optical_density.is_some_and(|n| !(1.0..f64::INFINITY).contains(&n)) {
        found.push("Ni is below 1 or not finite; it is no glass".to_owned());
    }
    for (key, color) in [("Ke", material.emissive), ("Ka", material.ambient)] {
        let is_sound =
            |color: [f64; 3]| color.iter().all(|value| (0.0..=BRIGHTEST).contains(value));
        if color.is_some_and(|color| !is_sound(color)) {
            found.push(format!(
                "{key} is below zero, not finite or above {BRIGHTEST:e}; it does not shine"
            ));
        }
    }
    found
}

/// The keys that change how a surface looks and are passed over.
pub(super) fn passed_over(material: &tobj::Material) -> Vec<String> {
    let maps = [
        ("map_Ks", &material.specular_texture),
        ("map_Ns", &material.shininess_texture),
        ("map_d", &material.dissolve_texture),
        ("map_bump", &material.normal_texture),
    ];
    let maps = maps.into_iter().filter(|(_, map)| map.is_some()).map(|(key, _)| key.to_owned());
    let is_look = |key: &str| {
        key.starts_with("map_")
            || ["norm", "disp", "decal", "refl", "Pr", "Pm", "Ps", "Pc", "Pcr", "aniso", "anisor"]
                .contains(&key)
    };
    let mut others: Vec<String> =
        material.unknown_param.keys().filter(|key| is_look(key)).cloned().collect();
    others.sort();
    maps.chain(others).collect()
}

/// Faces of one name and one material, in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Segment {
    /// The last `o` or `g` before; may be empty.
    pub name: String,
    /// The last `usemtl` before.
    pub material: Option<String>,
    /// Corners, by chunk.
    pub runs: Vec<(usize, Range<usize>)>,
}

/// Divides the faces of all `chunks`. A file without faces is one empty segment.
pub(super) fn divide(chunks: &[Chunk]) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    let mut known: HashMap<(String, Option<String>), usize> = HashMap::new();
    let mut current: (String, Option<String>) = Default::default();
    for (number, chunk) in chunks.iter().enumerate() {
        let mut from = 0;
        let ends = chunk.statements.iter().map(|(at, statement)| (*at, Some(statement)));
        for (end, statement) in ends.chain([(chunk.corners[V].len(), None)]) {
            if end > from {
                let at = *known.entry(current.clone()).or_insert(segments.len());
                if at == segments.len() {
                    let (name, material) = current.clone();
                    segments.push(Segment { name, material, runs: Vec::new() });
                }
                segments[at].runs.push((number, from..end));
                from = end;
            }
            match statement {
                Some(FaceStatement::Name(name)) => current.0.clone_from(name),
                Some(FaceStatement::Material(name)) => current.1 = Some(name.clone()),
                Some(FaceStatement::Library(_)) | None => {}
            }
        }
    }
    if segments.is_empty() {
        segments.push(Segment::default());
    }
    segments
}

/// The `mtllib` lines of all chunks, in the order of the file.
pub(super) fn libraries(chunks: &[Chunk]) -> Vec<&str> {
    let statements = chunks.iter().flat_map(|chunk| &chunk.statements);
    statements
        .filter_map(|(_, statement)| match statement {
            FaceStatement::Library(files) => Some(files.as_str()),
            _ => None,
        })
        .collect()
}
