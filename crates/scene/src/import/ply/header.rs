//! The header: what elements follow, and how they are written.

use crate::import::text::{TextFault, WordReader, whole, without_mark};

/// Encoding of the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Text,
    Binary(Order),
}

/// Byte order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

/// A type of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// A property: one number, or a list of them behind its length.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub name: String,
    /// The type of a list's length.
    pub list: Option<Type>,
    pub kind: Type,
}

/// Rows of the same properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct RowElement {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// Header of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PlyHeader {
    pub format: Format,
    pub elements: Vec<RowElement>,
    /// Offset at which the data starts (bytes).
    pub data: usize,
}

impl Type {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Its size (bytes).
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

impl RowElement {
    /// The number of the property with one of these names.
    pub(super) fn find(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|property| names.contains(&property.name.as_str()))
    }

    /// The size of a row without lists (bytes); `None` where there is a list.
    pub(super) fn fixed_size(&self) -> Option<usize> {
        self.properties
            .iter()
            .map(|property| property.list.is_none().then(|| property.kind.size()))
            .sum()
    }
}

/// Bytes of a vertex with position, normal, texture coordinates and colour.
const BYTES_PER_VERTEX: u64 = 3 * 8 + (3 + 2 + 4) * 4;

impl PlyHeader {
    /// Reads the header at the start of `file`. Its lines end as the first one does, by a newline,
    /// a carriage return, or both; lines of other words than the format's, which some programs
    /// write, are passed over.
    /// Bytes that the numbers of a file of `length` bytes take when they are converted: as many as the
    /// header promises, and no more than the file can hold.
    pub(super) fn bytes_to_make(&self, length: usize) -> u64 {
        // Text has a digit and a blank for each number.
        let in_text = matches!(self.format, Format::Text);
        let row = |element: &RowElement| -> usize {
            let sizes = element.properties.iter().map(|p| p.list.unwrap_or(p.kind).size());
            if in_text { 2 * element.properties.len() } else { sizes.sum() }
        };
        let made = |element: &RowElement| -> u64 {
            let rows = element.count.min(length / row(element).max(1)) as u64;
            let kept: u64 = match element.name.as_str() {
                // Text is read into a table of f64 first.
                "vertex" if in_text => 8 * element.properties.len() as u64 + BYTES_PER_VERTEX,
                "vertex" => BYTES_PER_VERTEX,
                _ => size_of::<[u32; 3]>() as u64,
            };
            rows.saturating_mul(kept)
        };
        self.elements.iter().map(made).fold(0, u64::saturating_add)
    }

    pub(super) fn parse(file: &[u8]) -> Result<Self, TextFault> {
        let mut lines = HeaderLines::new(file)?;
        let (mut format, mut elements, mut properties) = (None, Vec::new(), 0);
        while let Some((start, line)) = lines.next() {
            let mut words = WordReader::new(line);
            match words.word() {
                Some(b"format") => format = Some(parse_format(&mut words, start)?),
                Some(b"element") => elements.push(parse_element(&mut words, start)?),
                Some(b"property") => {
                    let property = parse_property(&mut words, start)?;
                    properties += 1;
                    match elements.last_mut() {
                        _ if properties > MOST_PROPERTIES => {
                            let reason = format!("more than {MOST_PROPERTIES} properties");
                            return Err(TextFault::new(start, reason));
                        }
                        Some(RowElement { properties, .. }) => properties.push(property),
                        None => return Err(TextFault::new(start, "a property before any element")),
                    }
                }
                Some(b"end_header") => {
                    let Some(format) = format else {
                        return Err(TextFault::new(start, "the header has no `format` line"));
                    };
                    return Ok(Self { format, elements, data: lines.at });
                }
                Some(_) | None => {}
            }
            if lines.at > LONGEST {
                let reason = format!("the header has no end in its first {LONGEST} bytes");
                return Err(TextFault::new(start, reason));
            }
        }
        Err(TextFault::new(
            file.len(),
            "the file ends inside its header\nhint: copy or export it again",
        ))
    }
}

/// The most properties of all elements: splats have sixty.
const MOST_PROPERTIES: usize = 1000;

/// The longest header (bytes): lines that mean nothing are passed over, but not for ever.
const LONGEST: usize = 1 << 20;

/// The lines of a header.
struct HeaderLines<'a> {
    file: &'a [u8],
    at: usize,
    end: u8,
}

impl<'a> HeaderLines<'a> {
    /// From behind the word `ply`, which is all of the first line.
    fn new(file: &'a [u8]) -> Result<Self, TextFault> {
        let text = without_mark(file);
        let rest = text.strip_prefix(b"ply").map(|rest| {
            let blanks = rest.iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
            &rest[blanks..]
        });
        let end = match rest {
            // A carriage return before a newline counts as a blank.
            Some([b'\n', ..] | [b'\r', b'\n', ..]) => b'\n',
            Some([b'\r', ..]) => b'\r',
            _ => {
                let reason = "a PLY file starts with the line `ply`; this one does not";
                return Err(TextFault::new(0, reason));
            }
        };
        // The rest of the first line comes next, and is blank.
        let at = file.len() - rest.map_or(0, <[u8]>::len);
        Ok(Self { file, at, end })
    }

    /// The next whole line and where it starts.
    fn next(&mut self) -> Option<(usize, &'a [u8])> {
        let (start, rest) = (self.at, self.file.get(self.at..)?);
        let length = rest.iter().position(|byte| *byte == self.end)?;
        self.at += length + 1;
        Some((start, &rest[..length]))
    }
}

fn parse_format(words: &mut WordReader<'_>, start: usize) -> Result<Format, TextFault> {
    match words.word() {
        Some(b"ascii") => Ok(Format::Text),
        Some(b"binary_little_endian") => Ok(Format::Binary(Order::Little)),
        Some(b"binary_big_endian") => Ok(Format::Binary(Order::Big)),
        _ => Err(TextFault::new(
            start,
            "the format is none of ascii, binary_little_endian and binary_big_endian",
        )),
    }
}

fn parse_element(words: &mut WordReader<'_>, start: usize) -> Result<RowElement, TextFault> {
    let name = words.word();
    let count = words.word().and_then(whole).and_then(|count| usize::try_from(count).ok());
    match (name, count) {
        (Some(name), Some(count)) => Ok(RowElement {
            name: String::from_utf8_lossy(name).into_owned(),
            count,
            properties: Vec::new(),
        }),
        _ => Err(TextFault::new(start, "an element needs a name and a whole number")),
    }
}

fn parse_property(words: &mut WordReader<'_>, start: usize) -> Result<Property, TextFault> {
    let unknown = || TextFault::new(start, "a property needs a type and a name");
    let first = words.word().ok_or_else(unknown)?;
    let (list, kind) = if first == b"list" {
        let length = words.word().and_then(Type::parse).ok_or_else(unknown)?;
        (Some(length), words.word().and_then(Type::parse).ok_or_else(unknown)?)
    } else {
        (None, Type::parse(first).ok_or_else(unknown)?)
    };
    let name = words.word().ok_or_else(unknown)?;
    Ok(Property { name: String::from_utf8_lossy(name).into_owned(), list, kind })
}
