//! Which faces belong together: those of one group or object with one material.

use std::collections::HashMap;
use std::ops::Range;

use super::chunk::{Chunk, Statement, V};

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
                Some(Statement::Name(name)) => current.0.clone_from(name),
                Some(Statement::Material(name)) => current.1 = Some(name.clone()),
                Some(Statement::Library(_)) | None => {}
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
            Statement::Library(files) => Some(files.as_str()),
            _ => None,
        })
        .collect()
}
