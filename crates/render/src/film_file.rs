//! File of what is filled of a film: a share of a render, or what there is of one on its way.
//!
//! A line of magic, the length of a header (u64), the header (JSON), numbers, and the XXH3 of all before
//! it (u64); everything little-endian. The header says which render it is of, which share of its rows and
//! how many samples a pixel it has, and lists the numbers: rows of planes of the film, or sums with what
//! rounding took from them.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use etendue_optics::element::StatusCounts;
use etendue_tracer::RayStats;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::adaptive::SampleCounts;
use crate::film::FilmLayer;
use crate::output::{OutputError, Values};
use crate::shard::{Shard, ShardBy};
use crate::sparkles::Sparkles;
use crate::sum::Sum;
use crate::tile::RayCounts;
use etendue_files::Transaction;

const MAGIC: &[u8] = b"etendue film 1\n";

/// Identity of the render that a film belongs to, as names and values, what tells most first: what
/// two films must agree in to be parts of one picture.
pub type Identity = Vec<(String, String)>;

/// Counts of rays by their ends, as a file has them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct FilmCounts {
    /// Wall time of the tracing.
    seconds: f64,
    chief_rays: u64,
    rays: u64,
    shadow_rays: u64,
    not_finite: u64,
    exited: u64,
    missed: Vec<u64>,
    reflected: Vec<u64>,
    vignetted: Vec<u64>,
    unlit: u64,
    #[serde(default)]
    sparkles: Sparkles,
}

impl FilmCounts {
    fn of(counts: &RayCounts, time: Duration) -> Self {
        let RayCounts { chief_rays, light, statuses, sparkles } = counts.clone();
        let RayStats { rays, shadow_rays, not_finite } = light;
        let StatusCounts { exited, missed, reflected, vignetted, unlit } = statuses;
        Self {
            seconds: time.as_secs_f64(),
            chief_rays,
            rays,
            shadow_rays,
            not_finite,
            exited,
            missed,
            reflected,
            vignetted,
            unlit,
            sparkles,
        }
    }
}

impl From<FilmCounts> for RayCounts {
    fn from(counts: FilmCounts) -> Self {
        let FilmCounts { rays, shadow_rays, not_finite, .. } = counts;
        let FilmCounts { exited, missed, reflected, vignetted, unlit, sparkles, .. } = counts;
        Self {
            chief_rays: counts.chief_rays,
            light: RayStats { rays, shadow_rays, not_finite },
            statuses: StatusCounts { exited, missed, reflected, vignetted, unlit },
            sparkles,
        }
    }
}

/// Header of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FilmHeader {
    identity: Identity,
    /// Request for the render, for whoever puts the shares together.
    pub origin: serde_json::Value,
    /// The share of the rows.
    pub shard: Shard,
    /// Samples that every pixel of them has.
    pub samples: u32,
    /// Numbers of samples of the pixels, where those differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_counts: Option<SampleCounts>,
    counts: FilmCounts,
    /// The names of what is kept, and the type of its numbers.
    sections: Vec<(String, String)>,
}

/// Numbers of a film, by name.
enum FilmSection<'a> {
    Plane(&'a Values),
    Sums(&'a [Sum]),
}

/// Section of a film, to be filled.
pub(crate) enum SectionMut<'a> {
    Plane(&'a mut Values),
    Sums(&'a mut [Sum]),
}

fn sums_name(k: usize) -> String {
    format!("sums {k}")
}

const SUMS: &str = "sum";

/// Writes what is filled of a film.
pub(crate) struct Writing<'a> {
    pub(crate) identity: &'a Identity,
    pub(crate) origin: &'a serde_json::Value,
    pub(crate) shard: Shard,
    pub(crate) samples: u32,
    pub(crate) sample_counts: Option<SampleCounts>,
    pub(crate) counts: &'a RayCounts,
    /// Wall time of the tracing.
    pub(crate) trace_time: Duration,
    /// Pixels of the picture, across and down.
    pub(crate) resolution: [u32; 2],
}

impl Writing<'_> {
    pub(crate) fn write(
        &self,
        files: &Transaction,
        path: &Path,
        layers: &[&FilmLayer],
        sums: &[&[Sum]],
    ) -> Result<(), OutputError> {
        // The sections, and the header that lists them.
        let planes = layers.iter().flat_map(|layer| layer.named_planes());
        let planes = planes.map(|(name, plane)| (name, FilmSection::Plane(plane)));
        let sums = sums.iter().enumerate().map(|(k, sums)| (sums_name(k), FilmSection::Sums(sums)));
        let sections: Vec<(String, FilmSection<'_>)> = planes.chain(sums).collect();
        let kind = |section: &FilmSection<'_>| match section {
            FilmSection::Plane(values) => values.type_name().to_owned(),
            FilmSection::Sums(_) => SUMS.to_owned(),
        };
        let header = FilmHeader {
            identity: self.identity.clone(),
            origin: self.origin.clone(),
            shard: self.shard,
            samples: self.samples,
            sample_counts: self.sample_counts,
            counts: FilmCounts::of(self.counts, self.trace_time),
            sections: sections.iter().map(|(name, s)| (name.clone(), kind(s))).collect(),
        };
        // Both, and a hash of them at the end.
        Ok(files.write(path, |part| {
            let mut file = HashingWriter { hash: Xxh3::new(), file: BufWriter::new(part) };
            let header = serde_json::to_vec(&header)?;
            file.write_all(MAGIC)?;
            file.write_all(&(header.len() as u64).to_le_bytes())?;
            file.write_all(&header)?;
            for (_, section) in &sections {
                self.write_section(&mut file, section)?;
            }
            let hash = file.hash.digest();
            file.file.write_all(&hash.to_le_bytes())?;
            file.file.flush()
        })?)
    }

    fn write_section(&self, file: &mut impl Write, section: &FilmSection<'_>) -> io::Result<()> {
        let pixels = self.resolution.iter().map(|&side| side as usize).product::<usize>();
        let row = self.resolution[0] as usize;
        match section {
            FilmSection::Plane(values) => {
                let bytes = values.value_bytes();
                let mut buffer = Vec::new();
                for part in self.shard.parts(values.len(), row) {
                    buffer.resize(part.len() * bytes, 0);
                    values.put_le(part, &mut buffer, bytes);
                    file.write_all(&buffer)?;
                }
            }
            FilmSection::Sums(sums) => {
                let a_row = sums.len() / pixels.max(1) * row;
                for part in self.shard.parts(sums.len(), a_row) {
                    for number in sums[part].iter().flat_map(|sum| sum.parts()) {
                        file.write_all(&number.to_le_bytes())?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Takes a fingerprint of what is written.
struct HashingWriter<W> {
    hash: Xxh3,
    file: W,
}

impl<W: Write> Write for HashingWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hash.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// A file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {why}", path.display())]
pub struct FilmError {
    path: PathBuf,
    why: String,
}

impl FilmError {
    /// Returns the error with what to do about it.
    pub(crate) fn with_remedy(self, remedy: &str) -> Self {
        Self { why: format!("{}; {remedy}", self.why), ..self }
    }
}

/// Filled part of a film, read from a file.
#[derive(Debug)]
pub struct FilmFile {
    pub(crate) path: PathBuf,
    /// Header of the file.
    pub header: FilmHeader,
    bytes: Vec<u8>,
    /// Offset of the numbers.
    start: usize,
}

impl FilmFile {
    /// Reads a file and checks that it is whole.
    ///
    /// # Errors
    ///
    /// When it cannot be read, is none of these, or is not as it was written.
    pub fn read(path: &Path) -> Result<Self, FilmError> {
        let refused = |why: &str| FilmError { path: path.to_owned(), why: why.to_owned() };
        let bytes =
            etendue_files::read(path, u64::MAX).map_err(|error| refused(&error.to_string()))?;
        let body = bytes.strip_prefix(MAGIC).ok_or_else(|| {
            refused("is no part of a render\nhint: give files that `etendue render --shard` wrote")
        })?;
        let torn = || refused("is not whole\nhint: remove it, and render this part again");
        let (content, hash) = bytes.split_last_chunk::<8>().ok_or_else(torn)?;
        if xxh3_64(content) != u64::from_le_bytes(*hash) {
            return Err(torn());
        }
        let (length, rest) = body.split_first_chunk::<8>().ok_or_else(torn)?;
        let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| torn())?;
        let header = rest.get(..length).ok_or_else(torn)?;
        let header: FilmHeader = serde_json::from_slice(header)
            .map_err(|error| refused(&format!("has a header that cannot be read: {error}")))?;
        if !header.shard.is_sound() {
            return Err(torn());
        }
        let start = MAGIC.len() + 8 + length;
        Ok(Self { path: path.to_owned(), header, bytes, start })
    }

    /// Refuses another render's.
    ///
    /// # Errors
    ///
    /// Names what differs.
    pub fn must_be_of(&self, identity: &Identity) -> Result<(), FilmError> {
        let own = &self.header.identity;
        let differs = identity.iter().find(|entry| !own.contains(entry));
        let Some((name, here)) = differs else { return Ok(()) };
        let said = own.iter().find(|entry| entry.0 == *name);
        let said = said.map_or("not said", |(_, value)| value.as_str());
        Err(self.error(format!(
            "is of another render: its {name} is {said}, and here it is {here}\nhint: render it anew of this scene, \
             or take the scene that it is of"
        )))
    }

    pub(crate) fn counts(&self) -> RayCounts {
        self.header.counts.clone().into()
    }

    /// Wall time of the tracing.
    pub(crate) fn trace_time(&self) -> Duration {
        Duration::try_from_secs_f64(self.header.counts.seconds).unwrap_or_default()
    }

    pub(crate) fn error(&self, why: String) -> FilmError {
        FilmError { path: self.path.clone(), why }
    }

    /// Fills all planes of `layers` and `sums` as far as the file's share goes.
    pub(crate) fn fill(
        &self,
        layers: &mut [&mut FilmLayer],
        sums: &mut [&mut [Sum]],
        [width, height]: [u32; 2],
    ) -> Result<(), FilmError> {
        // Where each section of the file belongs.
        let planes = layers.iter_mut().flat_map(|layer| layer.named_planes_mut());
        let planes = planes.map(|(name, plane)| (name, SectionMut::Plane(plane)));
        let sums = sums.iter_mut().enumerate();
        let sums = sums.map(|(k, sums)| (sums_name(k), SectionMut::Sums(sums)));
        let mut wanted: BTreeMap<String, SectionMut<'_>> = planes.chain(sums).collect();
        let (row, pixels) = (width as usize, width as usize * height as usize);
        let numbers = &self.bytes[self.start..self.bytes.len() - 8];
        let mut at = 0;
        let shard = self.header.shard;
        // The sections, in the order of the file, each of the share's pixels alone.
        for (name, kind) in &self.header.sections {
            let Some(section) = wanted.remove(name) else {
                return Err(self.error(format!("has {name}, which this render has not")));
            };
            let torn = || self.error("is not as long as its header says".to_owned());
            let mut take = |bytes: usize| {
                let taken = numbers.get(at..at + bytes).ok_or_else(torn);
                at += bytes;
                taken
            };
            match section {
                SectionMut::Plane(values) if values.type_name() == kind => {
                    let bytes = values.value_bytes();
                    for part in shard.parts(values.len(), row) {
                        values.read_le(part.clone(), take(part.len() * bytes)?);
                    }
                }
                SectionMut::Sums(sums) if kind == SUMS => {
                    let a_row = sums.len() / pixels.max(1) * row;
                    for part in shard.parts(sums.len(), a_row) {
                        let taken = take(part.len() * 16)?;
                        let pairs = taken.as_chunks::<8>().0.as_chunks::<2>().0;
                        for (sum, pair) in sums[part].iter_mut().zip(pairs) {
                            *sum = Sum::of_parts(pair.map(f64::from_le_bytes));
                        }
                    }
                }
                SectionMut::Plane(_) | SectionMut::Sums(_) => {
                    return Err(self.error(format!("has {name} as {kind}")));
                }
            }
        }
        match wanted.into_keys().next() {
            Some(name) => Err(self.error(format!("lacks {name}"))),
            None => Ok(()),
        }
    }
}

/// Refuses shares that are not one of each of one render, by name.
pub(crate) fn must_be_whole(shares: &[FilmFile], identity: &Identity) -> Result<(), String> {
    let Some(first) = shares.first() else {
        return Err("there is no share to put together".to_owned());
    };
    let Shard { count, by, .. } = first.header.shard;
    let mut found: BTreeMap<Shard, &FilmFile> = BTreeMap::new();
    // Each is of the same render and the same division, and none is there twice.
    for share in shares {
        share.must_be_of(identity).map_err(|error| error.to_string())?;
        let shard = share.header.shard;
        let (path, other) = (share.path.display(), first.path.display());
        if shard.count != count {
            return Err(format!("{path}: is share {shard}, and {other} is one of {count}"));
        }
        if shard.by != by {
            let of = |by| if by == ShardBy::Rows { "rows" } else { "samples" };
            let (this, that) = (of(shard.by), of(by));
            return Err(format!(
                "{path}: is a share of the {this}, and {other} is one of the {that}"
            ));
        }
        if let Some(twice) = found.insert(shard, share) {
            let other = twice.path.display();
            return Err(format!("{path}: is share {shard}, as {other} is\nhint: give each once"));
        }
    }
    // None is missing.
    let missing = (0..count).map(|index| Shard { index, count, by });
    let missing: Vec<String> = missing
        .filter(|shard| !found.contains_key(shard))
        .map(|shard| shard.to_string())
        .take(8)
        .collect();
    match missing.as_slice() {
        [] => Ok(()),
        missing => {
            let have = found.len();
            let left = count as usize - have - missing.len();
            let more = if left > 0 { format!(" and {left} more") } else { String::new() };
            let lack = missing.join(", ") + &more;
            Err(format!(
                "{have} of {count} shares are here; missing: {lack}\nhint: render them first"
            ))
        }
    }
}
