//! EXR: all layers in one file of one part, every value kept to the bit.
//!
//! Channels are called `Layer.Channel` (`Depth.Z`, `Normal.X`, `Id.object`), those of the picture
//! itself `R`, `G`, `B`: the form that Nuke, Blender and tev group into layers. All are written as
//! 32-bit floats, f64 rounded to the nearest. Integers, too: they are exact up to 2²⁴, where `OpenImageIO`
//! reads a channel of integers as shares of 2³² and Blender none at all. A channel with a larger number
//! is written as 32-bit unsigned integers ([`beyond_floats`] tells which).
//!
//! The header says what the numbers mean. Each layer has an attribute `etendue:LAYER` with its
//! meaning as JSON, each header entry an attribute `etendue:ENTRY`; the picture's attribute goes by
//! its channels, `etendue:RGB`. Light in bands has the names and attributes of spectral images
//! ([`Layer::exr_name`](super::Layer::exr_name)). `etendue:names:LAYER` has what the numbers of a layer of ids name. `software` names the program.
//!
//! The crate `exr` knows the format's header and checks it. Blocks are packed here, because its own
//! writer starts a thread pool beside the one that the render runs in, takes a slower deflate, and
//! leaves attributes in the order of a hash table, so that equal renders would give unequal files.
//!
//! # Sources
//!
//! *OpenEXR File Layout* and *Technical Introduction to OpenEXR*, openexr.com; for the order of
//! bytes inside a ZIP block, OpenEXR's `internal_zip.c`.

use std::fmt;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;
use std::slice;

use ::exr::meta::attribute::{
    self, AttributeValue, ChannelDescription, LineOrder, SampleType, Text,
};
use ::exr::meta::header::Header;
use ::exr::meta::{BlockDescription, MetaData, magic_number, sequence_end};
use rayon::prelude::*;

use super::layer::put;
use super::sidecar::Entries;
use super::{HeaderEntry, OutputError, Picture, SPECTRUM, Values};
use etendue_files::{SOFTWARE, Transaction};

/// Packing of the pixels. Both keep every bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// As they are: the quickest to write, four bytes a value.
    None,
    /// Deflated in blocks of 16 rows (EXR's ZIP) at the quickest level. What both cost:
    /// `cargo run --release -p etendue-render --example image_files`.
    #[default]
    Zip,
}

/// Options of writing a file.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// Packing of the pixels.
    pub compression: Compression,
    /// Told the share done (0..=1) now and then; answering `false` stops, and leaves no file.
    pub progress: Option<&'a dyn Fn(f64) -> bool>,
    /// Texts of the header by their full names, as other programs look for them.
    pub attributes: &'a [HeaderEntry],
}

impl fmt::Debug for Options<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options").field("compression", &self.compression).finish_non_exhaustive()
    }
}

/// Writes all layers of `picture` to `path`. The pixels are packed by the threads of the current
/// rayon pool; the file's bytes do not depend on how many there are.
///
/// # Errors
///
/// When the file cannot be written, when a finite f64 is beyond f32's range, when the picture is
/// larger than the format's 2³¹ − 1, and when `options.progress` asks to stop.
pub fn write(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    options: &Options<'_>,
) -> Result<(), OutputError> {
    let blocks = ScanLineBlocks::new(picture, options.compression);
    let header = header(path, picture, &blocks, options.attributes)?;
    let head = head_bytes(&header).map_err(|error| OutputError::format(path, error))?;
    let mut part = files.create(path)?;
    let mut file = BufWriter::with_capacity(1 << 20, &mut part);
    let io = |source| OutputError::io(path, source);

    // The table of offsets is filled in last, when they are known.
    let table = vec![0; blocks.count() * size_of::<u64>()];
    file.write_all(&head).and_then(|()| file.write_all(&table)).map_err(io)?;
    let offsets =
        write_blocks(&mut file, (head.len() + table.len()) as u64, &blocks, path, options)?;
    let table: Vec<u8> = offsets.iter().flat_map(|offset| offset.to_le_bytes()).collect();
    file.seek(SeekFrom::Start(head.len() as u64)).map_err(io)?;
    file.write_all(&table).and_then(|()| file.flush()).map_err(io)?;
    drop(file);
    Ok(part.finish()?)
}

/// Writes all blocks from byte `offset` on, and returns where each begins. Some are packed at once,
/// then written in order, so that memory stays small and the file the same for any thread count.
fn write_blocks(
    file: &mut impl Write,
    mut offset: u64,
    blocks: &ScanLineBlocks<'_>,
    path: &Path,
    options: &Options<'_>,
) -> Result<Vec<u64>, OutputError> {
    let at_once = 4 * rayon::current_num_threads();
    let mut offsets = Vec::with_capacity(blocks.count());
    for start in (0..blocks.count()).step_by(at_once) {
        let end = blocks.count().min(start + at_once);
        let packed: Result<Vec<_>, _> =
            (start..end).into_par_iter().map(|block| blocks.pack(block)).collect();
        for (block, bytes) in (start..end).zip(packed?) {
            let head = block_head(blocks.rows(block).start, bytes.len());
            let head = head.ok_or_else(|| OutputError::format(path, "its rows are too long"))?;
            let written = file.write_all(&head).and_then(|()| file.write_all(&bytes));
            written.map_err(|source| OutputError::io(path, source))?;
            offsets.push(offset);
            offset += (head.len() + bytes.len()) as u64;
        }
        let share = end as f64 / blocks.count() as f64;
        if options.progress.is_some_and(|progress| !progress(share)) {
            return Err(OutputError::Stopped { path: path.to_owned() });
        }
    }
    Ok(offsets)
}

/// First row and size of a block, as they stand before its bytes.
fn block_head(row: usize, bytes: usize) -> Option<[u8; 8]> {
    let [row, bytes] = [i32::try_from(row).ok()?, i32::try_from(bytes).ok()?];
    let mut head = [0; 8];
    head[..4].copy_from_slice(&row.to_le_bytes());
    head[4..].copy_from_slice(&bytes.to_le_bytes());
    Some(head)
}

/// The picture cut into the blocks of rows that the format packs together.
struct ScanLineBlocks<'a> {
    width: usize,
    height: usize,
    channels: Vec<(String, &'a Values, SampleType)>,
    compression: Compression,
}

impl<'a> ScanLineBlocks<'a> {
    fn new(picture: &'a Picture, compression: Compression) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let channels = picture.exr_channels().into_iter();
        let channels = channels.map(|(name, values)| (name, values, sample_type(values)));
        Self { width, height, channels: channels.collect(), compression }
    }

    fn format(&self) -> attribute::Compression {
        match self.compression {
            Compression::None => attribute::Compression::Uncompressed,
            Compression::Zip => attribute::Compression::ZIP16,
        }
    }

    fn rows_each(&self) -> usize {
        self.format().scan_lines_per_block()
    }

    fn count(&self) -> usize {
        self.height.div_ceil(self.rows_each())
    }

    fn rows(&self, block: usize) -> Range<usize> {
        let start = block * self.rows_each();
        start..self.height.min(start + self.rows_each())
    }

    /// The bytes of block `block` as they stand in the file.
    fn pack(&self, block: usize) -> Result<Vec<u8>, OutputError> {
        let raw = self.raw(self.rows(block))?;
        Ok(match self.compression {
            Compression::None => raw,
            Compression::Zip => zip(raw),
        })
    }

    /// Row after row; in a row channel after channel; in a channel pixel after pixel.
    fn raw(&self, rows: Range<usize>) -> Result<Vec<u8>, OutputError> {
        let row_bytes = self.width * SAMPLE_BYTES;
        let mut bytes = vec![0; rows.len() * self.channels.len() * row_bytes];
        let lines = rows.flat_map(|row| self.channels.iter().map(move |channel| (row, channel)));
        for (out, (row, (name, values, kind))) in bytes.chunks_exact_mut(row_bytes).zip(lines) {
            let pixels = row * self.width..(row + 1) * self.width;
            if let Err((x, value)) = put_samples(values, *kind, pixels, out) {
                return Err(OutputError::overflow(name, value, [x, row]));
            }
        }
        Ok(bytes)
    }
}

/// Bytes of a sample: all are written as 32-bit floats or integers.
const SAMPLE_BYTES: usize = 4;

/// The largest integer up to which f32 holds all.
const LARGEST_EXACT: u32 = 1 << 24;

fn sample_type(values: &Values) -> SampleType {
    match values {
        Values::F32(_) | Values::F64(_) | Values::U16(_) => SampleType::F32,
        Values::U32(_) if values.largest_integer() <= LARGEST_EXACT => SampleType::F32,
        Values::U32(_) => SampleType::U32,
    }
}

/// The channels with numbers that floats do not hold exactly, which are written as integers.
#[must_use]
pub fn beyond_floats(picture: &Picture) -> Vec<String> {
    let channels = picture.exr_channels().into_iter();
    let beyond = channels.filter(|(_, values)| sample_type(values) == SampleType::U32);
    beyond.map(|(name, _)| name).collect()
}

/// Writes values `range` as samples. The error is the place and value of a finite number that f32
/// would make infinite.
fn put_samples(
    values: &Values,
    kind: SampleType,
    range: Range<usize>,
    out: &mut [u8],
) -> Result<(), (usize, f64)> {
    match values {
        Values::F32(values) => put(&values[range], out, SAMPLE_BYTES, f32::to_le_bytes),
        Values::U32(values) if kind == SampleType::U32 => {
            put(&values[range], out, SAMPLE_BYTES, u32::to_le_bytes);
        }
        Values::U32(values) => {
            put(&values[range], out, SAMPLE_BYTES, |value| narrow(value.into()).to_le_bytes());
        }
        Values::U16(values) => {
            put(&values[range], out, SAMPLE_BYTES, |value| f32::from(value).to_le_bytes());
        }
        Values::F64(values) => {
            let values = &values[range];
            put(values, out, SAMPLE_BYTES, |value| narrow(value).to_le_bytes());
            let lost = |&value: &f64| value.is_finite() && !narrow(value).is_finite();
            if let Some(x) = values.iter().position(lost) {
                return Err((x, values[x]));
            }
        }
    }
    Ok(())
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32, as documented")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// Deflates a block as EXR's ZIP does: bytes of even place first, then those of odd place, each
/// replaced by its difference from the one before. A block that would not shrink stays as it is;
/// readers know it by its size.
fn zip(raw: Vec<u8>) -> Vec<u8> {
    // Level 4, which the crate `exr` takes, shrinks renders little further and takes far longer:
    // see the example `image_files`.
    const LEVEL: u8 = 1;
    let mut sorted = vec![0; raw.len()];
    let (even, odd) = sorted.split_at_mut(raw.len().div_ceil(2));
    for (pair, (even, odd)) in raw.as_chunks::<2>().0.iter().zip(even.iter_mut().zip(odd)) {
        [*even, *odd] = *pair;
    }
    // A sample has four bytes, so a block has an even number and nothing remains.
    let mut before = 128;
    for byte in &mut sorted {
        let difference = byte.wrapping_sub(before).wrapping_add(128);
        before = std::mem::replace(byte, difference);
    }
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(&sorted, LEVEL);
    if packed.len() < raw.len() { packed } else { raw }
}

fn header(
    path: &Path,
    picture: &Picture,
    blocks: &ScanLineBlocks<'_>,
    attributes: &[HeaderEntry],
) -> Result<Header, OutputError> {
    // The format counts pixels in i32, and the crate panics beyond.
    if i32::try_from(blocks.width).is_err() || i32::try_from(blocks.height).is_err() {
        return Err(OutputError::format(path, "a side is longer than 2147483647 pixels"));
    }
    let channels = blocks
        .channels
        .iter()
        .map(|(name, _, kind)| ChannelDescription::new(text(name), *kind, false));
    let mut header = Header::new(text(""), (blocks.width, blocks.height), channels.collect())
        .with_encoding(blocks.format(), BlockDescription::ScanLines, LineOrder::Increasing);
    let own = &mut header.own_attributes;
    // A part's name would stand before the names of its layers in some viewers.
    own.layer_name = None;
    own.software_name = Some(text(SOFTWARE));
    for layer in picture.layers() {
        let meaning = serde_json::to_string(&Entries(&layer.meaning));
        let meaning = meaning.map_err(|error| OutputError::format(path, error))?;
        own.other.insert(attribute_name(&layer.title()), AttributeValue::Text(text(&meaning)));
    }
    for (layer, table) in picture.all_names() {
        let name = attribute_name(&format!("names:{layer}"));
        own.other.insert(name, AttributeValue::Text(text(&table.to_string())));
    }
    if let Some(spectrum) = picture.layer(SPECTRUM) {
        // The layout of Fichet et al. (2021): see `Layer::exr_name`.
        let unit = spectrum.meaning.iter().find(|entry| entry.key == "unit");
        let unit = unit.map_or("", |entry| entry.text.as_str());
        for (name, value) in [("spectralLayoutVersion", "1.0"), ("emissiveUnits", unit)] {
            own.other.insert(text(name), AttributeValue::Text(text(value)));
        }
    }
    for HeaderEntry { key, text: value } in picture.header() {
        own.other.insert(attribute_name(key), AttributeValue::Text(text(value)));
    }
    for HeaderEntry { key, text: value } in attributes {
        own.other.insert(text(key), AttributeValue::Text(text(value)));
    }
    Ok(header)
}

fn attribute_name(name: &str) -> Text {
    text(&format!("etendue:{name}"))
}

/// UTF-8, as OpenEXR has it; the crate's own constructors take Latin-1.
fn text(string: &str) -> Text {
    Text::from_slice_unchecked(string.as_bytes())
}

/// All that stands before the table of offsets, with attributes sorted by name.
fn head_bytes(header: &Header) -> ::exr::error::Result<Vec<u8>> {
    let requirements = MetaData::validate(slice::from_ref(header), true)?;
    let mut bytes = Vec::new();
    magic_number::write(&mut bytes)?;
    requirements.write(&mut bytes)?;
    let mut attributes: Vec<_> = header.all_named_attributes().collect();
    attributes.sort_by_key(|(name, _)| *name);
    for (name, value) in attributes {
        attribute::write(name, &value, &mut bytes)?;
    }
    sequence_end::write(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::fs;

    use ::exr::prelude::{FlatSamples, read_first_flat_layer_from_file};

    use super::super::{Channel, Layer, Look};
    use super::*;

    fn layer(name: &str, channel: &str, look: Look, values: Values) -> Layer {
        let channels = vec![Channel { name: channel.into(), values }];
        let meaning = vec![HeaderEntry::new("unit", "m")];
        Layer { name: name.into(), look, channels, meaning }
    }

    /// 37 x 41: neither side a multiple of a block's rows.
    fn picture() -> Picture {
        let depth: Vec<f32> = (0_u16..37 * 41)
            .map(|i| if i % 5 == 0 { f32::INFINITY } else { 1.0 + f32::from(i).sqrt() })
            .collect();
        let ids: Vec<u32> = (0..37 * 41).map(|i: u32| i.wrapping_mul(0x9e37_79b9)).collect();
        let layers = vec![
            layer("Id", "object", Look::Ids, Values::U32(ids)),
            layer("Depth", "Z", Look::Distance, Values::F32(depth)),
        ];
        Picture::new(37, 41, layers, vec![HeaderEntry::new("seed", "7")]).unwrap()
    }

    fn bytes(picture: &Picture, compression: Compression) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write(
            &Transaction::at_once(),
            &path,
            picture,
            &Options { compression, ..Options::default() },
        )
        .unwrap();
        fs::read(path).unwrap()
    }

    #[test]
    fn the_crate_reads_back_every_bit() {
        let picture = picture();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        for compression in [Compression::None, Compression::Zip] {
            write(
                &Transaction::at_once(),
                &path,
                &picture,
                &Options { compression, ..Options::default() },
            )
            .unwrap();
            let read = read_first_flat_layer_from_file(&path).unwrap().layer_data;
            assert_eq!((read.size.0, read.size.1), (37, 41));
            for (channel, (name, values)) in
                read.channel_data.list.iter().zip(picture.exr_channels())
            {
                assert_eq!(channel.name.to_string(), name);
                match (&channel.sample_data, values) {
                    (FlatSamples::F32(read), Values::F32(values)) => {
                        let bits = |values: &[f32]| -> Vec<u32> {
                            values.iter().map(|value| value.to_bits()).collect()
                        };
                        assert_eq!(bits(read), bits(values), "{name}, {compression:?}");
                    }
                    (FlatSamples::U32(read), Values::U32(values)) => assert_eq!(read, values),
                    (read, values) => panic!("{name}: {read:?} for {}", values.type_name()),
                }
            }
        }
    }

    #[test]
    fn the_bytes_do_not_depend_on_threads_nor_on_the_run() {
        let picture = picture();
        let expected = bytes(&picture, Compression::Zip);
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let got = pool.install(|| bytes(&picture, Compression::Zip));
            assert!(got == expected, "{threads} threads give other bytes");
        }
    }

    #[test]
    fn noise_is_stored_rather_than_grown() {
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(0x0019_660d).wrapping_add(0x3c6e_f35f);
            state ^ (state >> 16)
        };
        let ids = Values::U32((0..64 * 64).map(|_| noise()).collect());
        let picture = Picture::new(64, 64, vec![layer("Id", "x", Look::Ids, ids)], Vec::new());
        let picture = picture.unwrap();
        let raw = bytes(&picture, Compression::None).len();
        // A block of 16 rows has one head and one offset where single rows have 16.
        assert_eq!(bytes(&picture, Compression::Zip).len(), raw - (64 - 4) * 16);
    }

    #[test]
    fn doubles_are_rounded_and_never_made_a_miss() {
        let of = |values: Vec<f64>| {
            let layer = layer("Depth", "Z", Look::Distance, Values::F64(values));
            let picture = Picture::new(3, 1, vec![layer], Vec::new()).unwrap();
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.exr");
            write(&Transaction::at_once(), &path, &picture, &Options::default())?;
            let read = read_first_flat_layer_from_file(&path).unwrap().layer_data.channel_data;
            Ok::<_, OutputError>(read.list[0].sample_data.values_as_f32().collect::<Vec<_>>())
        };
        assert_eq!(
            of(vec![0.1, 1e300_f64.recip(), f64::INFINITY]).unwrap(),
            [0.1, 0.0, f32::INFINITY]
        );
        let error = of(vec![1.0, 2.0, 1e39]).unwrap_err();
        let start = "channel \"Depth.Z\" is 1e39 at column 2, row 0, ";
        assert!(error.to_string().starts_with(start), "{error}");
    }

    #[test]
    fn progress_ends_at_one_and_can_stop() {
        let picture = picture();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let last = Cell::new(0.0);
        let watch = |share: f64| {
            assert!(share >= last.get());
            last.set(share);
            true
        };
        write(
            &Transaction::at_once(),
            &path,
            &picture,
            &Options { progress: Some(&watch), ..Options::default() },
        )
        .unwrap();
        assert_eq!(last.get(), 1.0);

        fs::write(&path, "old").unwrap();
        let stop = Options { progress: Some(&|_| false), ..Options::default() };
        let error = write(&Transaction::at_once(), &path, &picture, &stop).unwrap_err();
        assert!(matches!(error, OutputError::Stopped { .. }), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "a part file was left");
    }
}
