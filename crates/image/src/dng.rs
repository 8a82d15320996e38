//! Raw numbers of a DNG or another TIFF of one channel: uncompressed, 8 to 16 bits, in strips or tiles.
//!
//! # Sources
//!
//! "TIFF", revision 6.0, Adobe 1992, sections 2 and 15; "Digital Negative (DNG) Specification", version 1.4.0.0, Adobe 2012.

use std::ops::Range;

use crate::{Limits, room};

/// Raw numbers, and what the file says of them.
#[derive(Debug, Clone, PartialEq)]
pub struct RawDng {
    /// Columns and rows.
    pub size: [usize; 2],
    /// `[row][column]` (DN).
    pub numbers: Vec<u16>,
    /// Black level: the number without light (DN), where the file says it.
    pub black: Option<f64>,
    /// White level: the number at which it saturates (DN), where the file says it.
    pub white: Option<f64>,
    /// Exposure time (s), where the file says it.
    pub exposure: Option<f64>,
}

/// Directories that are looked into: the first, and those that it names.
const MOST_DIRECTORIES: usize = 32;

/// Entries of a directory.
const MOST_ENTRIES: usize = 4096;

/// Values of an entry.
const MOST_VALUES: usize = 1 << 22;

/// True if the bytes begin as a TIFF does.
#[must_use]
pub fn is_tiff(bytes: &[u8]) -> bool {
    bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*")
}

/// Reads the raw image of a file: of a DNG with previews the directory that is no preview.
///
/// # Errors
///
/// When it is none, is cut off, compressed, of several channels, or larger than `limits` allow; the message goes on after the
/// file's name.
pub fn read(bytes: &[u8], limits: Limits) -> Result<RawDng, String> {
    if !is_tiff(bytes) {
        return Err("is no DNG or TIFF".to_owned());
    }
    let file = TiffFile { bytes, is_big: bytes[0] == b'M' };
    let mut open = vec![file.number(4, 4).ok_or_else(cut)?];
    let (mut found, mut exposure) = (None, None);
    let mut looked = 0;
    while let Some(at) = open.pop() {
        looked += 1;
        if looked > MOST_DIRECTORIES {
            break;
        }
        let directory = file.directory(at)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a cast saturates"
        )]
        open.extend(directory.all(330)?.into_iter().map(|at| at as usize));
        exposure = exposure.or(directory.first(33_434)?);
        // Neither a preview nor a mask.
        let is_raw = directory.first(254)?.unwrap_or(0.0) == 0.0;
        let channels = directory.first(277)?.unwrap_or(1.0);
        if is_raw && directory.first(256)?.is_some() && (found.is_none() || channels == 1.0) {
            found = Some(directory);
        }
    }
    let directory = found.ok_or("has no raw image")?;
    let (size, numbers) = directory.numbers(limits)?;
    let [black, white] = [directory.first(50_714)?, directory.first(50_717)?];
    Ok(RawDng { size, numbers, black, white, exposure })
}

fn cut() -> String {
    "is cut off".to_owned()
}

#[derive(Debug, Clone, Copy)]
struct TiffFile<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

/// A directory: tag, type, count, and where its values are.
struct Directory<'a> {
    file: TiffFile<'a>,
    entries: Vec<(u16, usize, usize, usize)>,
}

impl<'a> TiffFile<'a> {
    /// An unsigned number of some bytes.
    fn number(self, at: usize, length: usize) -> Option<usize> {
        let bytes = self.bytes.get(at..at.checked_add(length)?)?;
        let add = |all: usize, byte: &u8| all << 8 | usize::from(*byte);
        Some(match self.is_big {
            true => bytes.iter().fold(0, add),
            false => bytes.iter().rev().fold(0, add),
        })
    }

    fn directory(self, at: usize) -> Result<Directory<'a>, String> {
        let count = self.number(at, 2).ok_or_else(cut)?;
        if count > MOST_ENTRIES {
            return Err(format!("has a directory of {count} entries"));
        }
        let mut entries = Vec::new();
        for k in 0..count {
            let entry = at + 2 + 12 * k;
            let field = |from: usize, length| self.number(entry + from, length).ok_or_else(cut);
            let (tag, kind, values) = (field(0, 2)?, field(2, 2)?, field(4, 4)?);
            let length = length_of(kind).saturating_mul(values);
            let place = if length <= 4 { entry + 8 } else { field(8, 4)? };
            #[expect(clippy::cast_possible_truncation, reason = "two bytes")]
            entries.push((tag as u16, kind, values, place));
        }
        Ok(Directory { file: self, entries })
    }
}

/// Bytes of a value, by TIFF's types.
fn length_of(kind: usize) -> usize {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 => 4,
        5 | 10 | 12 => 8,
        _ => 1,
    }
}

impl Directory<'_> {
    /// All values of a tag; none where it is not there.
    fn all(&self, tag: u16) -> Result<Vec<f64>, String> {
        let Some(&(_, kind, count, place)) = self.entries.iter().find(|entry| entry.0 == tag)
        else {
            return Ok(Vec::new());
        };
        if count > MOST_VALUES {
            return Err(format!("has {count} values of tag {tag}"));
        }
        let length = length_of(kind);
        if length.saturating_mul(count) > self.file.bytes.len() {
            return Err(cut());
        }
        let value = |k: usize| {
            let at = place.checked_add(k * length)?;
            let whole = |from: usize, length| self.file.number(at.checked_add(from)?, length);
            Some(match kind {
                5 => whole(0, 4)? as f64 / whole(4, 4)? as f64,
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_possible_wrap,
                    reason = "four bytes"
                )]
                10 => f64::from(whole(0, 4)? as u32 as i32) / f64::from(whole(4, 4)? as u32 as i32),
                11 => f64::from(f32::from_bits(u32::try_from(whole(0, 4)?).ok()?)),
                12 => f64::from_bits(whole(0, 8)? as u64),
                _ => whole(0, length)? as f64,
            })
        };
        (0..count).map(|k| value(k).ok_or_else(cut)).collect()
    }

    fn first(&self, tag: u16) -> Result<Option<f64>, String> {
        Ok(self.all(tag)?.first().copied().filter(|value| value.is_finite()))
    }

    /// A whole number that has to be there.
    fn whole(&self, tag: u16, name: &str) -> Result<usize, String> {
        let value = self.first(tag)?.ok_or_else(|| format!("has no {name}"))?;
        match (0.0..4e9).contains(&value) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
            true => Ok(value as usize),
            false => Err(format!("has {value} for its {name}")),
        }
    }

    /// The numbers of all strips or tiles.
    fn numbers(&self, limits: Limits) -> Result<([usize; 2], Vec<u16>), String> {
        let size @ [width, height] = [self.whole(256, "width")?, self.whole(257, "height")?];
        let channels = self.first(277)?.unwrap_or(1.0);
        if channels != 1.0 {
            return Err(format!(
                "has {channels} numbers a pixel: it is developed, and no raw\nhint: give the camera's own numbers"
            ));
        }
        let compression = self.first(259)?.unwrap_or(1.0);
        if compression != 1.0 {
            return Err(format!(
                "is compressed (method {compression}): save it uncompressed, as Adobe's DNG Converter and \
                 `tiffcp -c none` do"
            ));
        }
        let bits = self.whole(258, "bits")?;
        if !(8..=16).contains(&bits) {
            return Err(format!("has numbers of {bits} bits, not of 8 to 16"));
        }
        let pixels = width.checked_mul(height).filter(|count| *count > 0).ok_or("has no pixels")?;
        if pixels as u64 * 2 > limits.bytes {
            return Err(format!("has {width} x {height} pixels, more than may be read"));
        }
        let mut numbers = room::<u16>(pixels).map_err(|error| error.to_string())?;
        numbers.resize(pixels, 0);
        let is_tiled = !self.all(324)?.is_empty();
        let (places, lengths, wide, tall) = match is_tiled {
            true => (
                self.all(324)?,
                self.all(325)?,
                self.whole(322, "tile width")?,
                self.whole(323, "tile height")?,
            ),
            false => {
                let rows =
                    self.first(278)?.map_or(Ok(height), |_| self.whole(278, "rows a strip"))?;
                (self.all(273)?, self.all(279)?, width, rows.min(height))
            }
        };
        if wide == 0 || tall == 0 {
            return Err("has tiles of no pixels".to_owned());
        }
        let across = width.div_ceil(wide);
        if places.len() < across * height.div_ceil(tall) {
            return Err(cut());
        }
        for (k, place) in places.iter().take(across * height.div_ceil(tall)).enumerate() {
            let [left, top] = [k % across * wide, k / across * tall];
            // Strips end with the picture, tiles go on.
            let rows = if is_tiled { tall } else { tall.min(height - top) };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked below"
            )]
            let start = *place as usize;
            let length = (wide * bits).div_ceil(8).saturating_mul(rows);
            let stated = lengths.get(k).copied().unwrap_or(f64::INFINITY);
            let block = start
                .checked_add(length)
                .filter(|_| stated >= length as f64)
                .and_then(|end| self.file.bytes.get(start..end))
                .ok_or_else(cut)?;
            for row in 0..rows.min(height - top) {
                let bytes = &block[(wide * bits).div_ceil(8) * row..][..(wide * bits).div_ceil(8)];
                let own = &mut numbers[(top + row) * width + left..][..wide.min(width - left)];
                self.unpack(bytes, bits, own);
            }
        }
        Ok((size, numbers))
    }

    /// Numbers of a row: of 16 bits in the file's order of bytes, of fewer one bit after the other from the highest on.
    fn unpack(&self, bytes: &[u8], bits: usize, out: &mut [u16]) {
        for (k, number) in out.iter_mut().enumerate() {
            *number = match bits {
                8 => u16::from(bytes[k]),
                16 if self.file.is_big => u16::from_be_bytes([bytes[2 * k], bytes[2 * k + 1]]),
                16 => u16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]]),
                _ => {
                    let Range { start, end } = k * bits..(k + 1) * bits;
                    let byte = |at: usize| u32::from(bytes.get(at).copied().unwrap_or(0));
                    let three =
                        byte(start / 8) << 16 | byte(start / 8 + 1) << 8 | byte(start / 8 + 2);
                    let shifted = three >> (24 - (end - start / 8 * 8));
                    #[expect(clippy::cast_possible_truncation, reason = "at most 15 bits")]
                    let number = (shifted & ((1 << bits) - 1)) as u16;
                    number
                }
            };
        }
    }
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "small files")]
mod tests {
    use super::*;

    /// A file of tags `(tag, type, value)`, of which 0 stands for the place of `data`.
    fn file(tags: &[(u16, u16, u32)], data: &[u8], is_big: bool) -> Vec<u8> {
        let short = |n: u16| if is_big { n.to_be_bytes() } else { n.to_le_bytes() };
        let long = |n: u32| if is_big { n.to_be_bytes() } else { n.to_le_bytes() };
        let mut bytes = if is_big { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
        bytes.extend(long(8));
        bytes.extend(short(tags.len() as u16));
        let behind = 8 + 2 + 12 * tags.len() as u32 + 4;
        for &(tag, kind, value) in tags {
            bytes.extend(short(tag));
            bytes.extend(short(kind));
            bytes.extend(long(1));
            let value = if tag == 273 || tag == 324 { behind } else { value };
            match kind {
                3 => {
                    bytes.extend(short(value as u16));
                    bytes.extend([0; 2]);
                }
                _ => bytes.extend(long(value)),
            }
        }
        bytes.extend(long(0));
        bytes.extend(data);
        bytes
    }

    fn tags(bits: u32, length: u32) -> Vec<(u16, u16, u32)> {
        vec![
            (256, 3, 4),
            (257, 3, 2),
            (258, 3, bits),
            (259, 3, 1),
            (273, 4, 0),
            (277, 3, 1),
            (278, 3, 2),
            (279, 4, length),
            (50_714, 3, 64),
            (50_717, 3, 1023),
        ]
    }

    #[test]
    fn numbers_of_all_widths_come_back() {
        let numbers = [1, 2, 1000, 7, 0, 1023, 512, 3];
        for is_big in [false, true] {
            let word = |n: u16| if is_big { n.to_be_bytes() } else { n.to_le_bytes() };
            let data: Vec<u8> = numbers.iter().flat_map(|&n| word(n)).collect();
            let found = read(&file(&tags(16, 16), &data, is_big), Limits::default()).unwrap();
            assert_eq!((found.size, &found.numbers[..]), ([4, 2], &numbers[..]));
            assert_eq!(
                (found.black, found.white, found.exposure),
                (Some(64.0), Some(1023.0), None)
            );
        }
        // Ten bits after ten bits, each row from a byte on.
        let data: Vec<u8> = numbers
            .chunks(4)
            .flat_map(|row| {
                let bits = row.iter().fold(0u64, |all, &n| all << 10 | u64::from(n));
                bits.to_be_bytes()[3..].to_vec()
            })
            .collect();
        let found = read(&file(&tags(10, 10), &data, false), Limits::default()).unwrap();
        assert_eq!(found.numbers, numbers);
        let data = [9, 8, 7, 6, 5, 4, 3, 2];
        let found = read(&file(&tags(8, 8), &data, false), Limits::default()).unwrap();
        assert_eq!(found.numbers, data.map(u16::from));
    }

    #[test]
    fn what_is_no_raw_is_refused() {
        let with = |tag: u16, value: u32| {
            let mut tags = tags(16, 16);
            tags.iter_mut().filter(|own| own.0 == tag).for_each(|own| own.2 = value);
            read(&file(&tags, &[0; 16], false), Limits::default()).unwrap_err()
        };
        assert!(with(259, 7).contains("is compressed (method 7)"));
        assert!(with(277, 3).contains("it is developed, and no raw"));
        assert!(with(258, 32).contains("32 bits"));
        assert!(with(257, 3).contains("cut off"));
        assert!(with(256, 0).contains("no pixels"));
        assert!(read(b"\x89PNG", Limits::default()).unwrap_err().contains("no DNG"));
        let whole = file(&tags(16, 16), &[0; 16], false);
        for end in 0..whole.len() {
            assert!(read(&whole[..end], Limits::default()).is_err(), "{end}");
        }
    }
}
