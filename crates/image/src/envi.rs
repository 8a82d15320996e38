//! ENVI cubes: a text of keys beside a file of plain numbers.
//!
//! A header begins with the word `ENVI`; each key and value has a line, and values in braces may go on over
//! several. The numbers stand by bands (`bsq`), by lines (`bil`) or by pixels (`bip`), row 0 at the top.
//!
//! # Sources
//!
//! NV5 Geospatial, *ENVI Header Files* (the format's own description): the keys, the codes of `data type`,
//! `byte order`, `interleave`, `data gain values`, `data offset values`, `data ignore value` and
//! `reflectance scale factor`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::band_axis::in_nanometres;
use crate::{BandAxis, Cube, DecodeError, Limits, Quantity, room};

/// The longest header (bytes): some thousand bands with all that is said of them take less than a megabyte.
pub const MOST_HEADER_BYTES: u64 = 1 << 24;

/// The endings of the files of numbers; some have none.
const DATA_ENDINGS: [&str; 10] =
    ["img", "dat", "raw", "bsq", "bil", "bip", "bin", "IMG", "DAT", "RAW"];

/// True if `bytes` begin as a header does.
#[must_use]
pub fn is_header(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ENVI") && bytes.get(4).is_none_or(u8::is_ascii_whitespace)
}

/// True if a file's name says that it holds the numbers of a cube.
#[must_use]
pub fn is_data(path: &Path) -> bool {
    path.extension().is_some_and(|ending| DATA_ENDINGS.iter().any(|known| *known == ending))
}

/// The names that the file of numbers beside `header` may have: `a.img`, `a.dat`, … and `a` of `a.hdr`.
pub fn data_names(header: &Path) -> impl Iterator<Item = PathBuf> {
    let bare = header.with_extension("");
    let with = DATA_ENDINGS.map(|ending| header.with_extension(ending));
    // `a.img.hdr` is of `a.img`.
    let first = bare.extension().is_some().then(|| bare.clone());
    first.into_iter().chain(with).chain([bare])
}

/// The names that the header beside `data` may have: `a.hdr` and `a.img.hdr` of `a.img`.
pub fn header_names(data: &Path) -> impl Iterator<Item = PathBuf> {
    let whole = |ending: &str| {
        let mut name = data.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    [data.with_extension("hdr"), data.with_extension("HDR"), whole(".hdr"), whole(".HDR")]
        .into_iter()
}

/// In which order the numbers stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Interleave {
    /// Band by band.
    Bsq,
    /// Line by line, and in a line band by band.
    Bil,
    /// Pixel by pixel.
    Bip,
}

/// Kinds of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EnviDataType {
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl EnviDataType {
    /// The kind that `data type` has this code for.
    fn of(code: u64) -> Result<Self, String> {
        Ok(match code {
            1 => Self::U8,
            2 => Self::I16,
            3 => Self::I32,
            4 => Self::F32,
            5 => Self::F64,
            12 => Self::U16,
            13 => Self::U32,
            14 => Self::I64,
            15 => Self::U64,
            6 | 9 => {
                return Err(
                    "is of complex numbers (`data type = 6` or `9`), which are no light".to_owned()
                );
            }
            other => {
                return Err(format!(
                    "has `data type = {other}`; known: 1 (8 bits), 2, 12 (16), 3, 13 (32), 14, 15 (64), 4, 5 \
                     (floating-point numbers of 32 and 64)"
                ));
            }
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number of these bytes, the least significant first.
    #[expect(clippy::cast_precision_loss, reason = "films hold f32")]
    fn read(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::U8 => a.into(),
            Self::I16 => i16::from_le_bytes([a, b]).into(),
            Self::U16 => u16::from_le_bytes([a, b]).into(),
            Self::I32 => i32::from_le_bytes([a, b, c, d]).into(),
            Self::U32 => u32::from_le_bytes([a, b, c, d]).into(),
            Self::F32 => f32::from_le_bytes([a, b, c, d]).into(),
            Self::I64 => i64::from_le_bytes(bytes) as f64,
            Self::U64 => u64::from_le_bytes(bytes) as f64,
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }
}

/// Content of a header.
#[derive(Debug, Clone)]
pub struct Header {
    /// Columns and rows.
    size: [usize; 2],
    bands: usize,
    interleave: Interleave,
    number: EnviDataType,
    big_endian: bool,
    offset: usize,
    /// All keys in small letters, and their values without braces.
    texts: BTreeMap<String, String>,
}

impl Header {
    /// Reads the bytes of a header file.
    ///
    /// # Errors
    ///
    /// When it is none, or leaves open where the numbers are; the message goes on after the file's name.
    pub fn parse(bytes: &[u8]) -> Result<Self, DecodeError> {
        Self::read(bytes).map_err(DecodeError::Refused)
    }

    fn read(bytes: &[u8]) -> Result<Self, String> {
        if !is_header(bytes) {
            return Err("is no ENVI header: its first line is not the word ENVI".to_owned());
        }
        let texts = entries(&String::from_utf8_lossy(bytes))?;
        let text = |key: &str| texts.get(key).map(String::as_str);
        let whole = |key: &str| -> Result<Option<u64>, String> {
            let Some(text) = text(key) else { return Ok(None) };
            let number = text.parse().map_err(|_| {
                let text: String = text.chars().take(40).collect();
                format!("has `{key} = {}`, where a whole number is due", text.escape_debug())
            });
            number.map(Some)
        };
        let count = |key: &str| -> Result<usize, String> {
            let number = whole(key)?.ok_or_else(|| format!("does not say `{key}`"))?;
            let number = usize::try_from(number).ok().filter(|number| *number > 0);
            number.ok_or_else(|| format!("has `{key}` of nothing, or of more than there can be"))
        };
        let size = [count("samples")?, count("lines")?];
        let bands = count("bands")?;
        if whole("file compression")?.unwrap_or(0) != 0 {
            return Err("is compressed (`file compression`), which is not read".to_owned());
        }
        let interleave = match text("interleave").map(str::to_lowercase).as_deref() {
            Some("bsq") => Interleave::Bsq,
            Some("bil") => Interleave::Bil,
            Some("bip") => Interleave::Bip,
            None if bands == 1 => Interleave::Bsq,
            None => return Err("does not say `interleave`: bsq, bil or bip".to_owned()),
            Some(other) => {
                let other = other.escape_debug();
                return Err(format!("has `interleave = {other}`; known: bsq, bil, bip"));
            }
        };
        let code =
            whole("data type")?.ok_or("does not say `data type`, the kind of its numbers")?;
        let number = EnviDataType::of(code)?;
        let big_endian = match whole("byte order")? {
            Some(0) => false,
            Some(1) => true,
            None if number.bytes() == 1 => false,
            None => {
                return Err("does not say `byte order`: 0, the least significant byte first, or 1"
                    .to_owned());
            }
            Some(other) => {
                return Err(format!(
                    "has `byte order = {other}`; known: 0, the least significant byte first, and 1"
                ));
            }
        };
        let offset = whole("header offset")?.unwrap_or(0);
        let offset =
            usize::try_from(offset).map_err(|_| "has a `header offset` beyond all files")?;
        Ok(Self { size, bands, interleave, number, big_endian, offset, texts })
    }

    /// The cube whose numbers are in the bytes of its other file.
    ///
    /// # Errors
    ///
    /// When that has fewer bytes than the header promises, is over `limits`, or the bands have no wavelengths that
    /// make sense; the message goes on after the header's name.
    pub fn decode(&self, data: &[u8], limits: Limits) -> Result<Cube, DecodeError> {
        let [columns, rows] = self.size;
        let values = [columns, rows, self.bands, self.number.bytes()];
        let promised = values.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
        let end = promised.and_then(|bytes| bytes.checked_add(self.offset));
        let numbers = end.and_then(|end| data.get(self.offset..end)).ok_or_else(|| {
            let bands = self.bands;
            DecodeError::Refused(format!(
                "promises {columns} samples x {rows} lines x {bands} bands of {} bytes behind the first {}, and the \
                 file of numbers has {} bytes: it is cut off, or of another header",
                self.number.bytes(),
                self.offset,
                data.len()
            ))
        })?;
        let [wide, high] = self.size.map(|side| side as u64);
        limits.of(data).judge([wide, high], 4 * self.bands as u64)?;
        // Bands that the file itself calls bad are left out.
        let mut notes = Vec::new();
        let (kept, axis) = self.axis(&mut notes).map_err(DecodeError::Refused)?;
        let scale = self.scale().map_err(DecodeError::Refused)?;
        let ignored = self.one("data ignore value").map_err(DecodeError::Refused)?;
        // The file's numbers are those of f32 that are nearest to what the header writes.
        #[expect(clippy::cast_possible_truncation, reason = "that is what is meant")]
        let ignored = match self.number {
            EnviDataType::F32 => ignored.map(|number| f64::from(number as f32)),
            _ => ignored,
        };
        let mut values = room::<f32>(columns * rows * kept.len())?;
        let mut missing = 0_usize;
        for row in 0..rows {
            for column in 0..columns {
                for &band in &kept {
                    let at = match self.interleave {
                        Interleave::Bsq => (band * rows + row) * columns + column,
                        Interleave::Bil => (row * self.bands + band) * columns + column,
                        Interleave::Bip => (row * columns + column) * self.bands + band,
                    };
                    let number = self.number_at(numbers, at);
                    let value =
                        if Some(number) == ignored { f64::NAN } else { scale.of(band, number) };
                    missing += usize::from(Some(number) == ignored);
                    #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
                    values.push(value as f32);
                }
            }
        }
        if missing > 0 {
            notes.push(format!(
                "{missing} numbers are its `data ignore value`: nothing was measured there"
            ));
        }
        let unit = ["data units", "radiance units", "z plot titles"].into_iter();
        let unit =
            unit.filter_map(|key| self.texts.get(key).and_then(|text| unit_in(key, text))).next();
        let is_reflectance = self.texts.contains_key("reflectance scale factor");
        let quantity = if is_reflectance { Quantity::Reflectance } else { Quantity::Light };
        Ok(Cube { size: self.size, axis, values, quantity, unit, texts: self.texts.clone(), notes })
    }

    fn number_at(&self, numbers: &[u8], at: usize) -> f64 {
        let size = self.number.bytes();
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(&numbers[at * size..][..size]);
        if self.big_endian {
            bytes[..size].reverse();
        }
        self.number.read(bytes)
    }

    /// Indices of the bands that are read, and their wavelengths.
    fn axis(&self, notes: &mut Vec<String>) -> Result<(Vec<usize>, BandAxis), String> {
        let numbers = self.list("wavelength")?.ok_or(
            "does not say at which wavelengths its bands are: add `wavelength = {…}` and \
             `wavelength units = Nanometers`",
        )?;
        let unit = self.texts.get("wavelength units").map(String::as_str);
        let middles = in_nanometres(numbers, unit)?;
        let widths = match self.list("fwhm")? {
            Some(widths) => {
                // Widths are of the wavelengths' unit, and small in any.
                let ratio = in_nanometres(vec![1e3], unit.or(Some("nm")))?[0] / 1e3;
                Some(widths.into_iter().map(|width| width * ratio).collect::<Vec<f64>>())
            }
            None => None,
        };
        let is_good: Vec<bool> = match self.list("bbl")? {
            Some(marks) => marks.iter().map(|mark| *mark != 0.0).collect(),
            None => vec![true; self.bands],
        };
        let kept: Vec<usize> = (0..self.bands).filter(|&band| is_good[band]).collect();
        if kept.len() < self.bands {
            notes.push(format!(
                "{} of its {} bands are marked as bad (`bbl`) and left out: their neighbours reach to the middle \
                 between them",
                self.bands - kept.len(),
                self.bands
            ));
        }
        let only = |list: &[f64]| kept.iter().map(|&band| list[band]).collect::<Vec<f64>>();
        let axis = BandAxis::new(only(&middles), widths.map(|widths| only(&widths)).as_deref())?;
        Ok((kept, axis))
    }

    fn scale(&self) -> Result<BandScaling, String> {
        const OF_REFLECTANCE: &str = "reflectance scale factor";
        let white = self.one(OF_REFLECTANCE)?;
        if let Some(white) = white.filter(|white| !(*white > 0.0 && white.is_finite())) {
            return Err(format!(
                "has a `{OF_REFLECTANCE}` of {white}: it is the number of white, above 0"
            ));
        }
        Ok(BandScaling {
            white,
            gains: self.list("data gain values")?,
            offsets: self.list("data offset values")?,
        })
    }

    /// A key's list, of a number a band.
    fn list(&self, key: &str) -> Result<Option<Vec<f64>>, String> {
        let Some(text) = self.texts.get(key) else { return Ok(None) };
        let number = |word: &str| {
            word.trim().parse::<f64>().map_err(|_| {
                let word: String = word.chars().take(40).collect();
                format!(
                    "has \"{}\" among `{key}`, where a number is due",
                    word.trim().escape_debug()
                )
            })
        };
        let words = text.split(',').filter(|word| !word.trim().is_empty());
        let numbers = words.map(number).collect::<Result<Vec<f64>, _>>()?;
        match numbers.len() == self.bands {
            true => Ok(Some(numbers)),
            false => Err(format!(
                "has {} numbers of `{key}` and {} bands: one a band is due",
                numbers.len(),
                self.bands
            )),
        }
    }

    fn one(&self, key: &str) -> Result<Option<f64>, String> {
        let Some(text) = self.texts.get(key) else { return Ok(None) };
        let number = text.trim().parse();
        number.map(Some).map_err(|_| format!("has a `{key}` that is no number"))
    }
}

/// Factors of numbers, and what is added to them, a band each.
struct BandScaling {
    /// The number of a reflectance of 1.
    white: Option<f64>,
    gains: Option<Vec<f64>>,
    offsets: Option<Vec<f64>>,
}

impl BandScaling {
    fn of(&self, band: usize, number: f64) -> f64 {
        let gain = self.gains.as_ref().map_or(1.0, |gains| gains[band]);
        // Without offsets as it is: adding 0 would take the sign of a zero.
        let scaled =
            self.offsets.as_ref().map_or(gain * number, |offsets| gain * number + offsets[band]);
        self.white.map_or(scaled, |white| scaled / white)
    }
}

/// The unit of the values in the text of a key: all of it, or what stands in the brackets of the second title of a
/// plot's axes, `{Wavelength (nm), Radiance (W/(m^2 sr nm))}`.
fn unit_in(key: &str, text: &str) -> Option<String> {
    let unit = match key {
        "z plot titles" => text.split_once(',')?.1.split_once('(')?.1.trim().strip_suffix(')')?,
        _ => text,
    };
    let unit = unit.trim();
    (!unit.is_empty()).then(|| unit.to_owned())
}

/// The keys and values of a header.
fn entries(text: &str) -> Result<BTreeMap<String, String>, String> {
    let mut texts = BTreeMap::new();
    let mut lines = (1..).zip(text.lines());
    lines.next();
    while let Some((number, line)) = lines.next() {
        let line = line.trim();
        if line.is_empty() || line.starts_with(';') {
            continue;
        }
        let Some((key, value)) = line.split_once('=') else {
            return Err(format!("has a line {number} without `=`"));
        };
        let key = key.trim().to_lowercase();
        let mut value = value.trim().to_owned();
        if let Some(rest) = value.strip_prefix('{') {
            let mut all = rest.to_owned();
            while !all.contains('}') {
                let Some((_, more)) = lines.next() else {
                    return Err(format!("has a brace in line {number} that is never closed"));
                };
                all.push(' ');
                all.push_str(more.trim());
            }
            value = all.split('}').next().unwrap_or_default().trim().to_owned();
        }
        if texts.insert(key, value).is_some() {
            return Err(format!("says a key twice, again in line {number}"));
        }
    }
    Ok(texts)
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "small whole numbers in every kind")]
mod tests;
