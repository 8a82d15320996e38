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

use crate::cube::{BandAxis, Cube, Quantity, in_nanometres};
use crate::{DecodeError, Limits, room};

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
mod tests {
    use super::*;

    const HEADER: &str = "ENVI\ndescription = {\n two lines}\nsamples = 3\nlines = 2\nbands = 2\n; a comment\n\
        header offset = 0\nfile type = ENVI Standard\ndata type = 4\ninterleave = bsq\nbyte order = 0\n\
        wavelength units = Nanometers\nwavelength = {450,\n 550}\n";

    /// Value 100·row + 10·column + band of each pixel and band.
    fn numbers(interleave: &str) -> Vec<f64> {
        let value =
            |row: usize, column: usize, band: usize| (100 * row + 10 * column + band) as f64;
        let mut all = Vec::new();
        for (a, b, c) in (0..12).map(|i| match interleave {
            "bsq" => (i / 3 % 2, i % 3, i / 6),
            "bil" => (i / 6, i % 3, i / 3 % 2),
            _ => (i / 6, i / 2 % 3, i % 2),
        }) {
            all.push(value(a, b, c));
        }
        all
    }

    fn decode(header: &str, data: &[u8]) -> Result<Cube, String> {
        let header = Header::parse(header.as_bytes()).map_err(|error| error.to_string())?;
        header.decode(data, Limits::default()).map_err(|error| error.to_string())
    }

    #[test]
    fn all_orders_kinds_and_byte_orders_are_one_cube() {
        let expected: Vec<f32> = numbers("bip").into_iter().map(|v| v as f32).collect();
        type ToBytes = fn(f64) -> Vec<u8>;
        let kinds: [(u32, ToBytes); 9] = [
            (1, |v| (v as u8).to_le_bytes().into()),
            (2, |v| (v as i16).to_le_bytes().into()),
            (12, |v| (v as u16).to_le_bytes().into()),
            (3, |v| (v as i32).to_le_bytes().into()),
            (13, |v| (v as u32).to_le_bytes().into()),
            (14, |v| (v as i64).to_le_bytes().into()),
            (15, |v| (v as u64).to_le_bytes().into()),
            (4, |v| (v as f32).to_le_bytes().into()),
            (5, |v| v.to_le_bytes().into()),
        ];
        for interleave in ["bsq", "bil", "bip"] {
            for (code, bytes) in kinds {
                for order in [0, 1] {
                    let each = |v| {
                        let mut bytes = bytes(v);
                        if order == 1 {
                            bytes.reverse();
                        }
                        bytes
                    };
                    let data: Vec<u8> = numbers(interleave).into_iter().flat_map(each).collect();
                    let header = HEADER
                        .replace("= bsq", &format!("= {}", interleave.to_uppercase()))
                        .replace("data type = 4", &format!("data type = {code}"))
                        .replace("byte order = 0", &format!("byte order = {order}"))
                        .replace("offset = 0", "offset = 5");
                    let cube = decode(&header, &[&[9; 5][..], &data].concat()).unwrap();
                    assert_eq!(cube.values, expected, "{interleave} {code} {order}");
                    assert_eq!((cube.size, cube.axis.wavelengths()), ([3, 2], &[450.0, 550.0][..]));
                }
            }
        }
    }

    #[test]
    fn gains_offsets_missing_numbers_bad_bands_and_units_are_heeded() {
        let data: Vec<u8> =
            numbers("bsq").into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect();
        let more = "data gain values = {2, 3}\ndata offset values = {1, 0.5}\ndata ignore value = 10\n\
            fwhm = {100, 100}\nz plot titles = {Wavelength (nm), Radiance (W/(m^2 sr nm))}\n";
        let cube = decode(&(HEADER.to_owned() + more), &data).unwrap();
        assert_eq!(cube.values[..2], [1.0, 3.5]);
        // A number that f32 rounds, in the place of the first.
        for missing in ["1e20", "0.1", "-1e-5", "3.4028235e38"] {
            let mut data = data.clone();
            data[..4].copy_from_slice(&missing.parse::<f32>().unwrap().to_le_bytes());
            let header = format!("{HEADER}data ignore value = {missing}\n");
            let cube = decode(&header, &data).unwrap();
            assert!(cube.values[0].is_nan() && cube.values[1].is_finite(), "{missing}");
        }
        assert!(cube.values[2].is_nan() && cube.values[3] == 33.5, "{:?}", cube.values);
        assert_eq!(cube.axis.edges(), [400.0, 500.0, 600.0]);
        assert_eq!(cube.unit.as_deref(), Some("W/(m^2 sr nm)"));
        assert!(
            cube.notes[0].contains("1 numbers are its `data ignore value`"),
            "{:?}",
            cube.notes
        );
        let bad = HEADER.replace("bands = 2", "bands = 3").replace("550}", "550, 650}")
            + "bbl = {1, 0, 1}\n";
        let cube = decode(&bad, &[0; 72]).unwrap();
        assert_eq!((cube.axis.wavelengths(), cube.values.len()), (&[450.0, 650.0][..], 12));
        let share =
            decode(&(HEADER.to_owned() + "reflectance scale factor = 10000\n"), &data).unwrap();
        assert_eq!(share.quantity, Quantity::Reflectance);
        assert_eq!(share.values[11], 121.0 / 1e4, "{:?}", share.values);
        for bad in ["0", "-1", "nan", "white"] {
            let why = decode(&format!("{HEADER}reflectance scale factor = {bad}\n"), &data);
            assert!(why.unwrap_err().contains("`reflectance scale factor`"), "{bad}");
        }
        let micro = HEADER
            .replace("Nanometers", "Micrometers")
            .replace("450", "0.45")
            .replace("550", ".55");
        let cube = decode(&(micro + "fwhm = {0.1, 0.1}\n"), &data).unwrap();
        assert_eq!(cube.axis.edges(), [400.0, 500.0, 600.0]);
    }

    #[test]
    fn headers_that_make_no_sense_are_refused_by_their_key() {
        let data = [0; 48];
        for (from, to, word) in [
            ("ENVI", "ENVY", "first line"),
            ("samples = 3", "samples = 0", "`samples` of nothing"),
            ("samples = 3", "samples = three", "`samples = three`"),
            ("samples = 3\n", "", "does not say `samples`"),
            (
                "lines = 2",
                "lines = 3",
                "promises 3 samples x 3 lines x 2 bands of 4 bytes behind the first 0",
            ),
            ("lines = 2", "lines = 18446744073709551615", "promises 3 samples"),
            ("offset = 0", "offset = 1", "48 bytes: it is cut off"),
            ("= bsq", "= bsp", "known: bsq, bil, bip"),
            ("interleave = bsq\n", "", "does not say `interleave`"),
            ("data type = 4", "data type = 6", "complex"),
            ("data type = 4", "data type = 7", "`data type = 7`"),
            ("byte order = 0", "byte order = 2", "`byte order = 2`"),
            ("byte order = 0\n", "", "does not say `byte order`"),
            ("450,\n 550", "450", "1 numbers of `wavelength` and 2 bands"),
            ("450,\n 550", "450, blue", "\"blue\" among `wavelength`"),
            ("450,\n 550", "550, 450", "out of order"),
            ("450,\n 550", "450, 450", "two bands at 450 nm"),
            ("450,\n 550", "0.45, 0.55", "did you mean micrometres"),
            ("Nanometers", "GHz", "ghz, which is not read"),
            ("550}", "550", "never closed"),
            ("bands = 2", "bands = 2\nbands = 2", "twice, again in line 7"),
            ("bands = 2", "bands = 2\nwords", "line 7 without `=`"),
            ("bands = 2", "bands = 2\nfile compression = 1", "compressed"),
            ("bands = 2", "bands = 2\nbbl = {0, 0}", "no band"),
        ] {
            let header = HEADER.replacen(from, to, 1);
            assert_ne!(header, HEADER, "{from}");
            let why = decode(&header, &data).unwrap_err();
            assert!(why.contains(word), "{to}: {why}");
        }
        let without = decode(
            &HEADER.replace("wavelength units = Nanometers\n", "").replace("450", "0.45"),
            &data,
        );
        assert!(without.unwrap_err().contains("0.45 and does not say of what"));
    }

    #[test]
    fn files_are_found_beside_one_another() {
        let names = |path: &str| {
            data_names(Path::new(path)).map(|p| p.display().to_string()).collect::<Vec<_>>()
        };
        assert_eq!(names("x/a.hdr")[..2], ["x/a.img", "x/a.dat"]);
        assert_eq!(names("x/a.hdr").last().unwrap(), "x/a");
        assert_eq!(names("a.img.hdr")[0], "a.img");
        assert!(is_data(Path::new("a.bil")) && !is_data(Path::new("a.exr")));
        let headers: Vec<PathBuf> = header_names(Path::new("a.img")).collect();
        assert_eq!((headers[0].to_str(), headers[2].to_str()), (Some("a.hdr"), Some("a.img.hdr")));
    }
}
