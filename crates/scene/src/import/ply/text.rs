//! Data as text, one row a line.

use etendue_files::MappedFile;
use rayon::prelude::*;

use super::faces::{Faces, Lists};
use super::header::{Element, Header};
use super::vertices::{Columns, Table, VertexData};
use crate::import::Wanted;
use crate::import::text::{Fault, Words, number, pieces, with_newlines};

/// Bytes that one task reads.
const PIECE: usize = 1 << 20;

/// Reads vertices and faces.
pub(super) fn read(
    map: &MappedFile,
    header: &Header,
    wanted: Wanted,
) -> Result<(VertexData, Faces), Fault> {
    let text = with_newlines(&map.bytes()[header.data..]);
    let pieces = pieces(&text, PIECE);
    let lines: Vec<usize> = pieces.par_iter().map(|(_, piece)| count_rows(piece)).collect();
    let mut before = 0;
    let mut starts = Vec::with_capacity(lines.len());
    for count in lines {
        starts.push(before);
        before += count;
    }
    let parts: Vec<Part> = pieces
        .par_iter()
        .zip(starts)
        .map(|(&(start, piece), row)| {
            Part::parse(piece, header, row)
                .map_err(|fault| Fault { at: header.data + start + fault.at, reason: fault.reason })
        })
        .collect::<Result<_, _>>()?;
    let needed = header.elements.iter().try_fold(0_usize, |sum, e| sum.checked_add(e.count));
    if needed.is_none_or(|needed| before < needed) {
        return Err(Fault::new(
            map.bytes().len(),
            format!("the file ends after {before} rows of data; copy or export it again"),
        ));
    }
    let Some(element) = header.elements.iter().find(|element| element.name == "vertex") else {
        return Err(Fault::new(header.data, "there is no vertex element; export the file again"));
    };
    let columns =
        Columns::of(element, wanted, true).map_err(|reason| Fault::new(header.data, reason))?;
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

impl Table for Matrix {
    fn rows(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    fn get(&self, row: usize, property: usize) -> f64 {
        self.values[row * self.width + property]
    }
}

/// What a piece of the text holds.
#[derive(Default)]
struct Part {
    values: Vec<f64>,
    faces: Faces,
}

impl Part {
    /// Reads `text`, whose first row is number `row` of the data.
    fn parse(text: &[u8], header: &Header, row: usize) -> Result<Self, Fault> {
        let mut part = Self::default();
        let mut words = Words::new(text);
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

    fn vertex(&mut self, words: &mut Words<'_>, element: &Element) -> Result<(), Fault> {
        for property in &element.properties {
            if property.list.is_some() {
                let reason = "vertices with lists are not supported; export without them";
                return Err(Fault::new(words.at(), reason));
            }
            self.values.push(next_number(words)?);
        }
        Ok(())
    }
}

/// The list `column` of a face.
fn face(
    words: &mut Words<'_>,
    element: &Element,
    column: usize,
    corners: &mut Vec<u32>,
) -> Result<(), Fault> {
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

fn next_number(words: &mut Words<'_>) -> Result<f64, Fault> {
    let Some(word) = words.word() else {
        return Err(Fault::new(words.at(), "the row has too few numbers"));
    };
    number(word).ok_or_else(|| {
        let text = String::from_utf8_lossy(word);
        Fault::new(words.at() - word.len(), format!("\"{text}\" is not a number"))
    })
}

/// A whole number; below zero as its two's complement, as the strips' −1.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be whole")]
fn next_index(words: &mut Words<'_>) -> Result<u32, Fault> {
    let start = words.at();
    let value = next_number(words)?;
    if value.fract() == 0.0 && value >= -1.0 && value <= f64::from(u32::MAX) {
        Ok(value as i64 as u32)
    } else {
        Err(Fault::new(start, format!("{value} is not the number of a vertex")))
    }
}
