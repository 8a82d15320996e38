//! NPY files: the header's three keys, read strictly, and the numbers behind it.
//!
//! The header is the text of a Python dictionary. Reading it as Python would let a header of a few
//! bytes cost any time and memory; of that language only what NumPy writes is understood.
//!
//! # Sources
//!
//! Kern, *A Simple File Format for NumPy Arrays*, NEP 1 (2007), with versions 2 and 3 of the format
//! as `numpy.lib.format` describes them.

use crate::room;

/// The longest header (bytes), as NumPy's own reader has it.
const LONGEST_HEADER: usize = 10_000;

/// The most dimensions, as NumPy has it.
const MOST_DIMENSIONS: usize = 64;

/// An array of floating-point numbers, `[row][column]…`.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// The lengths of the dimensions, the slowest first.
    pub shape: Vec<usize>,
    /// As many numbers as the product of `shape`.
    pub numbers: Vec<f64>,
}

/// Kinds of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dtype {
    F32,
    F64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ByteOrder {
    Little,
    Big,
}

/// Reads the bytes of an NPY file whose shape `fits`.
///
/// # Errors
///
/// When it is none, is cut off, or its shape does not fit; the message goes on after the file's name.
pub fn read(
    bytes: &[u8],
    fits: impl FnOnce(&[usize]) -> Result<(), String>,
) -> Result<Array, String> {
    let (shape, numbers) = read_as(bytes, fits, |number| number)?;
    Ok(Array { shape, numbers })
}

/// As [`read`], with the numbers rounded to f32: the shape and the numbers.
///
/// # Errors
///
/// As [`read`].
pub fn read_f32(
    bytes: &[u8],
    fits: impl FnOnce(&[usize]) -> Result<(), String>,
) -> Result<(Vec<usize>, Vec<f32>), String> {
    #[expect(clippy::cast_possible_truncation, reason = "what is asked for")]
    read_as(bytes, fits, |number| number as f32)
}

fn read_as<T>(
    bytes: &[u8],
    fits: impl FnOnce(&[usize]) -> Result<(), String>,
    rounded: impl Fn(f64) -> T,
) -> Result<(Vec<usize>, Vec<T>), String> {
    let (text, data) = split(bytes)?;
    let broken =
        |why: String| format!("has a broken header: {why}\nhint: write it with numpy.save");
    let text = std::str::from_utf8(text).map_err(|_| broken("it is not UTF-8".to_owned()))?;
    // What kind of numbers, in which order, and how many.
    let header = NpyHeader::parse(text).map_err(broken)?;
    let (kind, order) = number(header.kind)?;
    fits(&header.shape)?;
    if header.fortran_order {
        return Err("is in Fortran order; save numpy.ascontiguousarray of it".to_owned());
    }
    let size = match kind {
        Dtype::F32 => 4,
        Dtype::F64 => 8,
    };
    let count = header.shape.iter().try_fold(1_usize, |product, &n| product.checked_mul(n));
    let length = count.and_then(|count| count.checked_mul(size));
    let data = length.and_then(|length| data.get(..length)).ok_or_else(|| {
        let shape = &header.shape;
        let has = data.len();
        format!("ends before its last number: {has} bytes follow where its shape is {shape:?}")
    })?;
    let count = data.len() / size;
    if room::<T>(count).is_err() {
        return Err(format!("holds {count} numbers, and the system has no memory for them"));
    }
    let numbers = match kind {
        Dtype::F32 => {
            let of = match order {
                ByteOrder::Little => f32::from_le_bytes,
                ByteOrder::Big => f32::from_be_bytes,
            };
            data.as_chunks().0.iter().map(|&bytes| rounded(f64::from(of(bytes)))).collect()
        }
        Dtype::F64 => {
            let of = match order {
                ByteOrder::Little => f64::from_le_bytes,
                ByteOrder::Big => f64::from_be_bytes,
            };
            data.as_chunks().0.iter().map(|&bytes| rounded(of(bytes))).collect()
        }
    };
    Ok((header.shape, numbers))
}

/// The header's text and the bytes behind it.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let cut_off = || "ends inside its header\nhint: copy it again".to_owned();
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or(
        "is no NPY file: it does not start with \"\\x93NUMPY\"\nhint: write it with numpy.save",
    )?;
    let (&[version, _minor], rest) = rest.split_first_chunk().ok_or_else(cut_off)?;
    let (length, rest) = match version {
        1 => {
            let (&length, rest) = rest.split_first_chunk().ok_or_else(cut_off)?;
            (usize::from(u16::from_le_bytes(length)), rest)
        }
        2 | 3 => {
            let (&length, rest) = rest.split_first_chunk().ok_or_else(cut_off)?;
            (usize::try_from(u32::from_le_bytes(length)).unwrap_or(usize::MAX), rest)
        }
        other => return Err(format!("is of version {other} of the NPY format; known: 1, 2, 3")),
    };
    if length > LONGEST_HEADER {
        return Err(format!(
            "has a header of {length} bytes, where an array of numbers needs a hundred\nhint: write it \
             with numpy.save"
        ));
    }
    rest.split_at_checked(length).ok_or_else(cut_off)
}

/// The type that `descr` names.
fn number(descr: &str) -> Result<(Dtype, ByteOrder), String> {
    let native = if cfg!(target_endian = "little") { ByteOrder::Little } else { ByteOrder::Big };
    let (order, kind) = match descr.split_at_checked(1) {
        Some(("<", kind)) => (ByteOrder::Little, kind),
        Some((">", kind)) => (ByteOrder::Big, kind),
        Some(("=", kind)) => (native, kind),
        _ => (native, descr),
    };
    match kind {
        "f4" => Ok((Dtype::F32, order)),
        "f8" => Ok((Dtype::F64, order)),
        _ => {
            let descr = descr.escape_debug();
            Err(format!("holds '{descr}' instead of float32 or float64 numbers"))
        }
    }
}

/// Content of the header.
#[derive(Debug, PartialEq)]
struct NpyHeader<'a> {
    kind: &'a str,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl<'a> NpyHeader<'a> {
    /// Reads `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4, 4), }`, keys in any order.
    fn parse(text: &'a str) -> Result<Self, String> {
        let mut rest = HeaderText(text);
        let (mut kind, mut fortran_order, mut shape) = (None, None, None);
        rest.expect('{')?;
        // A dictionary of Python's with three keys, each once.
        while !rest.takes('}') {
            let key = rest.string()?;
            rest.expect(':')?;
            let twice = match key {
                "descr" => kind.replace(rest.string()?).is_some(),
                "fortran_order" => fortran_order.replace(rest.truth()?).is_some(),
                "shape" => shape.replace(rest.shape()?).is_some(),
                other => return Err(format!("the key {other:?} is none of the format's")),
            };
            if twice {
                return Err(format!("the key {key:?} stands there twice"));
            }
            if !rest.takes(',') {
                rest.expect('}')?;
                break;
            }
        }
        if !rest.0.trim_ascii().is_empty() {
            return Err("something follows its last key".to_owned());
        }
        let missing = |key: &str| format!("the key {key:?} is missing");
        Ok(Self {
            kind: kind.ok_or_else(|| missing("descr"))?,
            fortran_order: fortran_order.ok_or_else(|| missing("fortran_order"))?,
            shape: shape.ok_or_else(|| missing("shape"))?,
        })
    }
}

/// The text that is still to be read.
struct HeaderText<'a>(&'a str);

impl<'a> HeaderText<'a> {
    /// Passes over blanks and `sign`, when it comes next.
    fn takes(&mut self, sign: char) -> bool {
        self.0 = self.0.trim_ascii_start();
        let behind = self.0.strip_prefix(sign);
        self.0 = behind.unwrap_or(self.0);
        behind.is_some()
    }

    fn expect(&mut self, sign: char) -> Result<(), String> {
        if self.takes(sign) { Ok(()) } else { Err(self.instead_of(&format!("`{sign}`"))) }
    }

    fn instead_of(&self, expected: &str) -> String {
        let found: String = self.0.chars().take(20).collect();
        format!("expected {expected}, found {found:?}")
    }

    fn string(&mut self) -> Result<&'a str, String> {
        for quote in ['\'', '"'] {
            if self.takes(quote) {
                let (string, rest) = self.0.split_once(quote).ok_or("a string has no end")?;
                self.0 = rest;
                return Ok(string);
            }
        }
        Err(self.instead_of("a string"))
    }

    fn truth(&mut self) -> Result<bool, String> {
        self.0 = self.0.trim_ascii_start();
        for (word, value) in [("True", true), ("False", false)] {
            if let Some(rest) = self.0.strip_prefix(word) {
                self.0 = rest;
                return Ok(value);
            }
        }
        Err(self.instead_of("True or False"))
    }

    /// `()`, `(3,)`, `(3, 4)`; Python 2 wrote `3L`.
    fn shape(&mut self) -> Result<Vec<usize>, String> {
        let mut shape = Vec::new();
        self.expect('(')?;
        while !self.takes(')') {
            self.0 = self.0.trim_ascii_start();
            let digits = self.0.bytes().take_while(u8::is_ascii_digit).count();
            let length = self.0[..digits].parse().map_err(|_| self.instead_of("a length"))?;
            self.0 = &self.0[digits..];
            self.0 = self.0.strip_prefix('L').unwrap_or(self.0);
            if shape.len() == MOST_DIMENSIONS {
                return Err(format!("it has more than {MOST_DIMENSIONS} dimensions"));
            }
            shape.push(length);
            if !self.takes(',') {
                self.expect(')')?;
                break;
            }
        }
        Ok(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with this header, padded as NumPy pads it.
    fn file(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        let length = u32::try_from(header.len()).unwrap();
        match version {
            1 => bytes.extend(u16::try_from(length).unwrap().to_le_bytes()),
            _ => bytes.extend(length.to_le_bytes()),
        }
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn read_all(bytes: &[u8]) -> Result<Array, String> {
        read(bytes, |_| Ok(()))
    }

    const HEADER: &str = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 1), }    \n";

    #[test]
    fn every_version_order_and_spelling_is_read() {
        let expected = Array { shape: vec![2, 1], numbers: vec![1.5, -2.0] };
        let little: Vec<u8> = [1.5_f64, -2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        for version in [1, 2, 3] {
            assert_eq!(read_all(&file(version, HEADER, &little)).as_ref(), Ok(&expected));
        }
        for header in [
            "{\"shape\":(2,1),\"fortran_order\":False,\"descr\":\"<f8\"}",
            " { 'shape' : ( 2L , 1L , ) , 'descr' : '=f8' , 'fortran_order' : False }\n",
        ] {
            assert_eq!(read_all(&file(1, header, &little)).as_ref(), Ok(&expected), "{header}");
        }
        let big: Vec<u8> = [1.5_f32, -2.0].iter().flat_map(|x| x.to_be_bytes()).collect();
        let header = HEADER.replace("<f8", ">f4");
        assert_eq!(read_all(&file(1, &header, &big)), Ok(expected));
    }

    #[test]
    fn what_numpy_writes_through_another_program_is_read() {
        use npyz::WriterBuilder;
        let mut bytes = Vec::new();
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&[2, 3])
            .writer(&mut bytes)
            .begin_nd()
            .unwrap();
        writer.extend([1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        writer.finish().unwrap();
        let numbers = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(read_all(&bytes), Ok(Array { shape: vec![2, 3], numbers }));
    }

    #[test]
    fn headers_that_are_not_the_formats_are_refused() {
        let refused = |header: &str, word: &str| {
            let why = read_all(&file(1, header, &[0; 64])).unwrap_err();
            assert!(why.contains(word), "{header}: {why}");
        };
        refused(&"{".repeat(14), "a string");
        refused("{'descr': '<f8', 'fortran_order': False}", "\"shape\" is missing");
        refused("{'descr': '<f8', 'descr': '<f8'}", "twice");
        refused("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': ()}", "a string");
        refused(&HEADER.replace("<f8", "<i4"), "'<i4'");
        refused(&HEADER.replace("<f8", "|O"), "float32 or float64");
        refused(&HEADER.replace("False", "True"), "Fortran");
        refused(&HEADER.replace("(2, 1)", "(-2, 1)"), "a length");
        refused(&HEADER.replace("(2, 1)", "(9, 1)"), "ends before");
        refused(&HEADER.replace("(2, 1)", "(4294967296, 4294967296)"), "ends before");
        refused(&HEADER.replace("(2, 1)", "(99999999999999999999999)"), "a length");
        refused(&HEADER.replace("(2, 1)", &format!("({})", "1,".repeat(65))), "dimensions");
        refused(&HEADER.replace("'shape'", "'shapes'"), "shapes");
        refused("{'descr': '<f8", "no end");
        refused(&format!("{HEADER}x"), "follows");
    }

    #[test]
    fn lengths_of_headers_are_not_believed() {
        let mut long = file(2, HEADER, &[]);
        long[8..12].copy_from_slice(&0x7fff_ffff_u32.to_le_bytes());
        assert!(read_all(&long).unwrap_err().contains("2147483647 bytes"));
        long[8..12].copy_from_slice(&9_000_u32.to_le_bytes());
        assert!(read_all(&long).unwrap_err().contains("ends inside its header"));
        for length in 0..11 {
            assert!(read_all(&file(1, HEADER, &[])[..length]).is_err());
        }
        assert!(read_all(&file(9, HEADER, &[])).unwrap_err().contains("version 9"));
    }
}
