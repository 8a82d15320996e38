//! Data as text, one row a line.
//!
//! Binary data of either byte order.

use std::sync::Arc;

use rayon::prelude::*;

use super::header::{Order, PlyHeader, Property, RowElement, Type};
use super::vertices::{Faces, Lists, VertexColumns, VertexData, VertexTable};
use crate::import::Wanted;
use crate::import::text::{TextFault, WordReader, number, pieces, with_newlines};
use etendue_files::MappedFile;
use etendue_geometry::{Buffer, Vertices};

/// Bytes that one task reads.
const PIECE: usize = 1 << 20;

/// Reads vertices and faces.
pub(super) fn read_text(
    map: &MappedFile,
    header: &PlyHeader,
    wanted: Wanted,
) -> Result<(VertexData, Faces), TextFault> {
    let text = with_newlines(&map.bytes()[header.data..]);
    let pieces = pieces(&text, PIECE);
    let lines: Vec<usize> = pieces.par_iter().map(|piece| count_rows(piece.text)).collect();
    let mut before = 0;
    let mut starts = Vec::with_capacity(lines.len());
    for count in lines {
        starts.push(before);
        before += count;
    }
    let parts: Vec<_> = pieces
        .par_iter()
        .zip(starts)
        .map(|(piece, row)| {
            TextPiece::parse(piece.text, header, row).map_err(|fault| TextFault {
                at: header.data + piece.start + fault.at,
                reason: fault.reason,
            })
        })
        .collect();
    // The first of the file's faults is told, however threads run.
    let parts = parts.into_iter().collect::<Result<Vec<TextPiece>, _>>()?;
    let needed = header.elements.iter().try_fold(0_usize, |sum, e| sum.checked_add(e.count));
    if needed.is_none_or(|needed| before < needed) {
        return Err(TextFault::new(
            map.bytes().len(),
            format!("the file ends after {before} rows of data\nhint: copy or export it again"),
        ));
    }
    let Some(element) = header.elements.iter().find(|element| element.name == "vertex") else {
        return Err(TextFault::new(
            header.data,
            "there is no vertex element\nhint: export the file again",
        ));
    };
    let columns = VertexColumns::of(element, wanted, true)
        .map_err(|reason| TextFault::new(header.data, reason))?;
    let mut matrix = Matrix { width: element.properties.len(), values: Vec::new() };
    matrix.values.reserve_exact(parts.iter().map(|part| part.values.len()).sum());
    let mut faces = Faces::default();
    for mut part in parts {
        matrix.values.append(&mut part.values);
        faces.append(part.faces);
    }
    Ok((columns.read(&matrix), faces))
}

/// Lines that are not blank.
fn count_rows(piece: &[u8]) -> usize {
    piece.split(|&byte| byte == b'\n').filter(|line| !line.trim_ascii().is_empty()).count()
}

/// The numbers of all vertices, row by row.
struct Matrix {
    width: usize,
    values: Vec<f64>,
}

impl VertexTable for Matrix {
    fn rows(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    fn get(&self, row: usize, property: usize) -> f64 {
        self.values[row * self.width + property]
    }
}

/// Content of a piece of the text.
#[derive(Default)]
struct TextPiece {
    values: Vec<f64>,
    faces: Faces,
}

impl TextPiece {
    /// Reads `text`, whose first row is number `row` of the data.
    fn parse(text: &[u8], header: &PlyHeader, row: usize) -> Result<Self, TextFault> {
        let mut part = Self::default();
        let mut words = WordReader::new(text);
        let mut corners = Vec::new();
        let (mut number_of_row, mut elements) = (row, header.elements.iter());
        let Some(mut element) = elements.next() else { return Ok(part) };
        let mut end = element.count;
        while !words.is_done() {
            let mut ahead = words.clone();
            if ahead.word().is_none() {
                words.end_line();
                continue;
            }
            while number_of_row >= end {
                let Some(next) = elements.next() else { return Ok(part) };
                element = next;
                end = end.saturating_add(element.count);
            }
            if element.name == "vertex" {
                part.vertex(&mut words, element)?;
            } else if let Some((lists, column)) = Lists::of(element) {
                face(&mut words, element, column, &mut corners)?;
                part.faces.push(lists, &corners);
            }
            words.end_line();
            number_of_row += 1;
        }
        Ok(part)
    }

    fn vertex(
        &mut self,
        words: &mut WordReader<'_>,
        element: &RowElement,
    ) -> Result<(), TextFault> {
        for property in &element.properties {
            if property.list.is_some() {
                let reason = "vertices with lists are not supported; export without them";
                return Err(TextFault::new(words.at(), reason));
            }
            self.values.push(next_number(words)?);
        }
        Ok(())
    }
}

/// The list `column` of a face.
fn face(
    words: &mut WordReader<'_>,
    element: &RowElement,
    column: usize,
    corners: &mut Vec<u32>,
) -> Result<(), TextFault> {
    corners.clear();
    for (i, property) in element.properties.iter().enumerate().take(column + 1) {
        let count = match property.list {
            Some(_) => next_index(words)?,
            None => 1,
        };
        for _ in 0..count {
            if i == column {
                corners.push(next_index(words)?);
            } else {
                next_number(words)?;
            }
        }
    }
    Ok(())
}

fn next_number(words: &mut WordReader<'_>) -> Result<f64, TextFault> {
    let Some(word) = words.word() else {
        return Err(TextFault::new(words.at(), "the row has too few numbers"));
    };
    number(word).ok_or_else(|| {
        let text = String::from_utf8_lossy(word);
        TextFault::new(words.at() - word.len(), format!("\"{text}\" is not a number"))
    })
}

/// A whole number; below zero as its two's complement, as the strips' −1.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be whole")]
fn next_index(words: &mut WordReader<'_>) -> Result<u32, TextFault> {
    let start = words.at();
    let value = next_number(words)?;
    if value.fract() == 0.0 && value >= -1.0 && value <= f64::from(u32::MAX) {
        Ok(value as i64 as u32)
    } else {
        Err(TextFault::new(start, format!("{value} is not the number of a vertex")))
    }
}

/// Reads vertices and faces.
pub(super) fn read_binary(
    map: &Arc<MappedFile>,
    header: &PlyHeader,
    order: Order,
    wanted: Wanted,
) -> Result<(VertexData, Faces), String> {
    let mut at = header.data;
    let (mut vertices, mut faces) = (None, Faces::default());
    for element in &header.elements {
        let cut_off = || {
            format!(
                "the file ends inside its {} {} rows\nhint: copy or export it again",
                element.count, element.name
            )
        };
        let bytes = map.bytes().get(at..).ok_or_else(cut_off)?;
        let size = match (element.fixed_size(), Lists::of(element)) {
            (Some(row), _) => {
                let size = row.checked_mul(element.count).ok_or_else(cut_off)?;
                let data = bytes.get(..size).ok_or_else(cut_off)?;
                if element.name == "vertex" {
                    let columns = VertexColumns::of(element, wanted, false)?;
                    let table = RowsOfSize { map, start: at, data, row, element, order };
                    vertices = Some(columns.read(&table));
                }
                size
            }
            (None, Some((lists, column))) => {
                let walk = Walk { element, bytes, order };
                match walk.triangles_only(lists, column) {
                    Some((triangles, size)) => {
                        faces.append(Faces::from_triangles(triangles));
                        size
                    }
                    None => walk.lists(lists, column, &mut faces).ok_or_else(cut_off)?,
                }
            }
            (None, None) if element.name == "vertex" => {
                return Err(
                    "vertices with lists are not supported\nhint: export without them".into()
                );
            }
            (None, None) => Walk { element, bytes, order }.skip().ok_or_else(cut_off)?,
        };
        at += size;
    }
    let vertices = vertices.ok_or("there is no vertex element\nhint: export the file again")?;
    Ok((vertices, faces))
}

/// One number at the start of `bytes`; 0 where they are too few.
#[inline]
fn value(kind: Type, order: Order, bytes: &[u8]) -> f64 {
    macro_rules! read {
        ($type:ty) => {{
            let bytes = bytes.first_chunk().copied().unwrap_or_default();
            match order {
                Order::Little => <$type>::from_le_bytes(bytes).into(),
                Order::Big => <$type>::from_be_bytes(bytes).into(),
            }
        }};
    }
    match kind {
        Type::I8 => read!(i8),
        Type::U8 => read!(u8),
        Type::I16 => read!(i16),
        Type::U16 => read!(u16),
        Type::I32 => read!(i32),
        Type::U32 => read!(u32),
        Type::F32 => read!(f32),
        Type::F64 => read!(f64),
    }
}

/// A whole number at the start of `bytes`, below zero as its two's complement; what is not whole or
/// too large becomes an index that no vertex has.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be whole")]
fn index(kind: Type, order: Order, bytes: &[u8]) -> u32 {
    let value = value(kind, order, bytes);
    if value.fract() == 0.0 && value.abs() <= f64::from(u32::MAX) {
        value as i64 as u32
    } else {
        u32::MAX
    }
}

/// Rows of one size.
struct RowsOfSize<'a> {
    map: &'a Arc<MappedFile>,
    /// Offset of the rows in the file.
    start: usize,
    data: &'a [u8],
    row: usize,
    element: &'a RowElement,
    order: Order,
}

impl RowsOfSize<'_> {
    /// Offset of a property in its row.
    fn offset(&self, property: usize) -> usize {
        self.element.properties[..property].iter().map(|p| p.kind.size()).sum()
    }
}

impl VertexTable for RowsOfSize<'_> {
    fn rows(&self) -> usize {
        self.element.count
    }

    #[inline]
    fn get(&self, row: usize, property: usize) -> f64 {
        let kind = self.element.properties[property].kind;
        value(kind, self.order, &self.data[row * self.row + self.offset(property)..])
    }

    fn mapped_positions(&self, xyz: [usize; 3]) -> Option<Vertices<3>> {
        let is_f32 = xyz.iter().all(|&p| self.element.properties[p].kind == Type::F32);
        let first = self.offset(xyz[0]);
        let in_a_row = xyz.map(|property| self.offset(property)) == [first, first + 4, first + 8];
        let native = self.order == Order::Little && cfg!(target_endian = "little");
        if !(is_f32 && in_a_row && native && self.row.is_multiple_of(4)) || self.rows() == 0 {
            return None;
        }
        let start = self.start + first;
        let last = (self.rows() - 1) * self.row / 4;
        let available = (self.map.bytes().len() - start) / 4;
        let floats = Buffer::from_file(self.map, start, (last + 4).min(available).max(last + 3))?;
        Vertices::new(floats, self.row / 4, self.rows())
    }
}

/// Reads a triangle from each of the `rows`; whether all have one.
fn filled<'a>(
    triangles: &mut [[u32; 3]],
    rows: impl IndexedParallelIterator<Item = &'a [u8]>,
    read: impl Fn(&[u8]) -> Option<[u32; 3]> + Sync,
) -> bool {
    triangles.par_iter_mut().zip(rows).all(|(to, row)| {
        let read = read(row);
        *to = read.unwrap_or_default();
        read.is_some()
    })
}

/// Rows with lists.
struct Walk<'a> {
    element: &'a RowElement,
    bytes: &'a [u8],
    order: Order,
}

impl Walk<'_> {
    /// The triangles and the size of rows whose one list always has three entries: then all rows
    /// are of one size. `None` otherwise.
    fn triangles_only(&self, lists: Lists, column: usize) -> Option<(Vec<[u32; 3]>, usize)> {
        let properties = &self.element.properties;
        let others_fixed =
            properties.iter().enumerate().all(|(i, p)| i == column || p.list.is_none());
        let (length, item) = (properties[column].list?, properties[column].kind);
        if lists != Lists::Polygons || !others_fixed || self.element.count == 0 {
            return None;
        }
        let size = |properties: &[Property]| properties.iter().map(|p| p.kind.size()).sum();
        let before: usize = size(&properties[..column]);
        let behind: usize = size(&properties[column + 1..]);
        let first = before + length.size();
        let row = first + 3 * item.size() + behind;
        let total = row.checked_mul(self.element.count)?;
        let bytes = self.bytes.get(..total)?;
        let mut triangles = vec![[0; 3]; self.element.count];
        // As nearly all files have them: a length of a byte, and corners of four, whose bits are the numbers.
        let corners_of_four = |row: &[u8]| {
            let word = |k: usize| row[first + 4 * k..].first_chunk().copied().unwrap_or_default();
            let [a, b, c] = [word(0), word(1), word(2)];
            let corners = match self.order {
                Order::Little => [a, b, c].map(u32::from_le_bytes),
                Order::Big => [a, b, c].map(u32::from_be_bytes),
            };
            (row[before] == 3).then_some(corners)
        };
        let corners_of_any = |row: &[u8]| {
            let corner = |k: usize| index(item, self.order, &row[first + k * item.size()..]);
            (index(length, self.order, &row[before..]) == 3)
                .then(|| [corner(0), corner(1), corner(2)])
        };
        let is_plain = matches!((length, item), (Type::U8, Type::U32 | Type::I32));
        let are_triangles = match is_plain {
            true => filled(&mut triangles, bytes.par_chunks_exact(row), corners_of_four),
            false => filled(&mut triangles, bytes.par_chunks_exact(row), corners_of_any),
        };
        are_triangles.then_some((triangles, total))
    }

    /// Adds all lists to `faces`; the size of the rows, `None` where the file ends too soon.
    fn lists(&self, lists: Lists, column: usize, faces: &mut Faces) -> Option<usize> {
        let mut corners = Vec::new();
        self.each(|number, property, bytes| {
            if number == column {
                let items = bytes.chunks_exact(property.kind.size());
                corners.clear();
                corners.extend(items.map(|bytes| index(property.kind, self.order, bytes)));
                faces.push(lists, &corners);
            }
        })
    }

    /// The size of the rows.
    fn skip(&self) -> Option<usize> {
        self.each(|_, _, _| {})
    }

    /// Visits the bytes of each property of each row.
    fn each(&self, mut visit: impl FnMut(usize, &Property, &[u8])) -> Option<usize> {
        let mut at = 0_usize;
        for _ in 0..self.element.count {
            for (number, property) in self.element.properties.iter().enumerate() {
                let count = match property.list {
                    Some(length) => {
                        let bytes = self.bytes.get(at..at.checked_add(length.size())?)?;
                        at += length.size();
                        // A length below zero becomes one that no file can hold.
                        index(length, self.order, bytes) as usize
                    }
                    None => 1,
                };
                let size = count.checked_mul(property.kind.size())?;
                visit(number, property, self.bytes.get(at..at.checked_add(size)?)?);
                at += size;
            }
        }
        Some(at)
    }
}
