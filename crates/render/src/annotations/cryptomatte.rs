//! Cryptomatte: the names of things by their shares of each pixel, in an EXR of their own.
//!
//! Three mattes: `CryptoObject` (objects), `CryptoInstance` (copies of objects) and `CryptoMaterial` (materials). Each has
//! six ranks, the greatest share first: pairs of a name's number and its share, two pairs a layer of four channels. The
//! number is `MurmurHash3_32` of the name, without a seed, as the bits of a float that is neither denormal, infinite nor no
//! number. The shares are those of the samples of a pixel, weighted as the camera weights them: through the lens, while the
//! shutter is open, over the pixel's square.
//!
//! Sources: Psyop, *Cryptomatte Specification*, version 1.2.0, 2018; A. Appleby, `MurmurHash3`, 2011.

use std::collections::BTreeMap;
use std::path::Path;

use etendue_accel::Accel;
use etendue_camera::{Camera, CameraRays, FilmSamples, squares_of_pair};
use etendue_files::Transaction;
use etendue_geometry::{Detail, HitBatch, MISS};
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use rayon::prelude::*;
use serde_json::Map;

use super::AnnotationError;
use crate::RenderError;
use crate::memory::filled;
use crate::output::{Channel, HeaderEntry, Layer, Look, Picture, Values, exr};

/// The name of the file.
pub const CRYPTOMATTE: &str = "cryptomatte.exr";

/// Pairs of number and share a pixel: more than six things in one pixel are rare, and the least are left out.
const RANKS: usize = 6;

/// Samples a pixel where the picture has more: 1/1024 is below what an 8-bit matte tells.
const MOST: u32 = 1024;

/// The pair of random numbers whose first is a sample's time, as the picture has it.
const TIME_PAIR: u32 = u32::MAX;

/// Bytes that a pixel takes: the pairs of three mattes.
pub(super) const BYTES_A_PIXEL: u64 = (3 * 2 * RANKS * size_of::<f32>()) as u64;

/// Rows that are traced before a stop is heard.
const ROWS: u32 = 16;

/// Rays that are traced together.
const BATCH: usize = 1024;

/// One matte: its layer's name, what a placement's number in it is, and the names.
struct Matte {
    layer: &'static str,
    definition: &'static str,
    names: Vec<String>,
    /// The numbers in files.
    ids: Vec<u32>,
}

impl Matte {
    fn new(layer: &'static str, definition: &'static str, names: Vec<String>) -> Self {
        let ids = names.iter().map(|name| float_bits(murmur3(name.as_bytes()))).collect();
        Self { layer, definition, names, ids }
    }

    /// The three of a scene, in the order of [`numbers`].
    fn all(scene: &Scene) -> [Self; 3] {
        let copies = scene.copies.iter().flat_map(|copies| {
            (0..copies.count).map(move |k| (copies.first + k, copies.count, k, &copies.name))
        });
        let mut instances = Vec::new();
        for (index, count, k, name) in copies {
            let index = index as usize;
            if instances.len() <= index {
                instances.resize(index + 1, String::new());
            }
            instances[index] = if count == 1 { name.clone() } else { format!("{name}[{k}]") };
        }
        let materials = scene.materials.iter().map(|material| material.name.clone()).collect();
        [
            Self::new("CryptoObject", "objects", scene.objects.clone()),
            Self::new("CryptoInstance", "copies of objects", instances),
            Self::new("CryptoMaterial", "materials", materials),
        ]
    }

    /// The entries of the EXR's header.
    fn attributes(&self) -> [HeaderEntry; 4] {
        let key = format!("{:08x}", murmur3(self.layer.as_bytes()));
        let of = |entry: &str| format!("cryptomatte/{}/{entry}", &key[..7]);
        let named: BTreeMap<&String, u32> =
            self.names.iter().zip(self.ids.iter().copied()).collect();
        let manifest: Map<_, _> = named
            .into_iter()
            .map(|(name, id)| (name.clone(), format!("{id:08x}").into()))
            .collect();
        [
            HeaderEntry::new(of("name"), self.layer),
            HeaderEntry::new(of("hash"), "MurmurHash3_32"),
            HeaderEntry::new(of("conversion"), "uint32_to_float32"),
            HeaderEntry::new(of("manifest"), serde_json::Value::Object(manifest).to_string()),
        ]
    }
}

/// Writes the mattes of `scene`, over which `accel` was built, to `path`. Told the share done, `progress` answers whether
/// to go on.
///
/// # Errors
///
/// When nothing gets through the camera's lens, memory is lacking, the file cannot be written, or `progress` says stop.
pub fn write(
    scene: &Scene,
    accel: &dyn Accel,
    files: &Transaction,
    path: &Path,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<(), AnnotationError> {
    let [width, height] = scene.camera.resolution();
    let mattes = Matte::all(scene);
    // Things have one place for all colours here.
    let camera = scene.camera.without_dispersion();
    let camera = match camera.has_pupil() {
        true => camera.opened(&Bands::Rgb).map_err(|error| RenderError::camera(error.why))?,
        false => camera,
    };
    let fewest = scene.accuracy.matte_samples.min(MOST);
    let samples = scene.render.samples.typical().clamp(fewest, MOST);
    let tracing = MatteTracing { scene, accel, camera: &camera, mattes: &mattes, samples };
    let pixels = width as usize * height as usize;
    let mut planes: Vec<Vec<f32>> = Vec::new();
    for _ in 0..mattes.len() * 2 * RANKS {
        planes.push(filled(0.0, pixels)?);
    }
    for top in (0..height).step_by(ROWS as usize) {
        if !progress(f64::from(top) / f64::from(height)) {
            return Err(RenderError::Stopped.into());
        }
        let rows: Vec<u32> = (top..height.min(top + ROWS)).collect();
        let ranked: Vec<_> = rows.par_iter().map(|&row| tracing.row(row)).collect();
        for (row, ranked) in rows.iter().zip(ranked) {
            for (x, pixel) in ranked.chunks(mattes.len() * 2 * RANKS).enumerate() {
                let at = *row as usize * width as usize + x;
                planes.iter_mut().zip(pixel).for_each(|(plane, value)| plane[at] = *value);
            }
        }
    }
    let mut planes = planes.into_iter();
    let layers = mattes.iter().flat_map(|matte| {
        (0..RANKS / 2)
            .map(|number| {
                let names = ["r", "g", "b", "a"].into_iter().zip(planes.by_ref());
                let channel = |(name, values): (&str, _)| Channel {
                    name: name.into(),
                    values: Values::F32(values),
                };
                let meaning = [
                    ("definition", format!("shares of {} in the pixel", matte.definition)),
                    ("samples", samples.to_string()),
                ];
                Layer {
                    name: format!("{}{number:02}", matte.layer),
                    look: Look::Cube,
                    channels: names.map(channel).collect(),
                    meaning: meaning.map(|(key, text)| HeaderEntry::new(key, text)).into(),
                }
            })
            .collect::<Vec<_>>()
    });
    let picture = Picture::new(width as usize, height as usize, layers.collect(), Vec::new())?;
    let attributes: Vec<_> = mattes.iter().flat_map(Matte::attributes).collect();
    let options = exr::Options { attributes: &attributes, ..exr::Options::default() };
    Ok(exr::write(files, path, &picture, &options)?)
}

struct MatteTracing<'a> {
    scene: &'a Scene,
    accel: &'a dyn Accel,
    camera: &'a Camera,
    mattes: &'a [Matte; 3],
    samples: u32,
}

impl MatteTracing<'_> {
    /// The pairs of a row's pixels: `[pixel][matte][rank][number, share]`.
    fn row(&self, row: u32) -> Vec<f32> {
        let [width, _] = self.camera.resolution();
        let mut out = Vec::with_capacity(width as usize * self.mattes.len() * 2 * RANKS);
        let (mut film, mut rays) = (FilmSamples::default(), CameraRays::default());
        let mut hits = HitBatch::new(Detail::Distance);
        let at_once = (BATCH / self.samples as usize).max(1);
        let columns: Vec<u32> = (0..width).collect();
        for pixels in columns.chunks(at_once) {
            self.aim(pixels, row, &mut film);
            self.camera.sample_rays(&film, &mut rays);
            self.accel.closest(&rays.rays, &mut hits);
            // Lenses may give the rays in another order than the samples.
            let mut order: Vec<usize> = (0..rays.rays.len()).collect();
            order.sort_by_key(|&ray| rays.sample[ray]);
            let mut own = order.iter().copied().peekable();
            for end in (1..=pixels.len()).map(|k| k * self.samples as usize) {
                let is_own = |ray: &usize| (rays.sample[*ray] as usize) < end;
                let of_pixel: Vec<usize> = std::iter::from_fn(|| own.next_if(is_own)).collect();
                self.rank(&of_pixel, &rays, &hits, &mut out);
            }
        }
        out
    }

    /// All samples of each of the pixels, one pixel after the other, as the picture has them.
    fn aim(&self, pixels: &[u32], row: u32, film: &mut FilmSamples) {
        let render = &self.scene.render;
        let mut numbers = Vec::with_capacity(pixels.len() * self.samples as usize);
        for &x in pixels {
            let pixel = render.sampler.pixel(render.frame_seed(), x, row, self.samples);
            numbers.extend(pixel.samples(0..self.samples));
        }
        let draw = |pair, out: &mut Vec<_>| squares_of_pair(numbers.iter().copied(), pair, out);
        film.clear();
        film.group = 0;
        let mut places = Vec::new();
        draw(0, &mut places);
        let corners =
            pixels.iter().flat_map(|&x| std::iter::repeat_n(f64::from(x), self.samples as usize));
        film.columns.extend(corners.zip(&places).map(|(x, place)| x + place[0]));
        film.rows.extend(places.iter().map(|place| f64::from(row) + place[1]));
        match self.camera.has_pupil() {
            true => draw(1, &mut film.pupil),
            false => film.pupil.resize(numbers.len(), [0.5; 2]),
        }
        film.spectrum.resize(numbers.len(), 0.5);
        film.leading.resize(numbers.len(), 0.5);
        if let (Some(shutter), true) = (self.camera.shutter(), self.camera.is_timed()) {
            draw(TIME_PAIR, &mut places);
            let middle = f64::from(row) + 0.5;
            film.times.extend(places.iter().map(|place| shutter.moment(middle, place[0])));
        }
    }

    /// Appends the pairs of a pixel, whose rays these are.
    fn rank(&self, own: &[usize], rays: &CameraRays, hits: &HitBatch, out: &mut Vec<f32>) {
        let all: f64 = own.iter().map(|&ray| rays.weight[ray]).sum();
        for (k, matte) in self.mattes.iter().enumerate() {
            let mut shares: Vec<(u32, f64)> = Vec::new();
            for i in own.iter().copied().filter(|&ray| hits.placement[ray] != MISS) {
                let placement = &self.scene.geometry.placements[hits.placement[i] as usize];
                let number = [placement.object, placement.instance, placement.material][k];
                let Some(&id) = matte.ids.get(number as usize) else { continue };
                match shares.iter_mut().find(|(known, _)| *known == id) {
                    Some((_, share)) => *share += rays.weight[i],
                    None => shares.push((id, rays.weight[i])),
                }
            }
            shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            shares.resize(RANKS, (0, 0.0));
            for (id, share) in shares {
                #[expect(clippy::cast_possible_truncation, reason = "the format's precision")]
                let share = if all > 0.0 { (share / all) as f32 } else { 0.0 };
                out.extend([f32::from_bits(id), share]);
            }
        }
    }
}

/// The bits of a float that stands for a hash: what would be denormal, infinite or no number has another exponent.
fn float_bits(hash: u32) -> u32 {
    let exponent = hash >> 23 & 255;
    if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash }
}

/// `MurmurHash3_32` without a seed.
fn murmur3(bytes: &[u8]) -> u32 {
    let mix = |word: u32| word.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = 0_u32;
    for word in words {
        hash ^= mix(u32::from_le_bytes(*word));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    if !rest.is_empty() {
        let tail = rest.iter().rev().fold(0, |tail, byte| tail << 8 | u32::from(*byte));
        hash ^= mix(tail);
    }
    #[expect(clippy::cast_possible_truncation, reason = "the hash counts bytes by 2³²")]
    let length = bytes.len() as u32;
    hash ^= length;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_murmur() {
        // By mmh3 5.3.1: hash(text, 0, signed=False).
        let expected: [(&str, u32); 7] = [
            ("", 0x0000_0000),
            ("a", 0x3c25_69b2),
            ("ab", 0x9bbf_d75f),
            ("abc", 0xb3dd_93fa),
            ("bunny", 0x1385_1a76),
            ("CryptoObject", 0x3ae3_9a58),
            ("floor é", 0x7292_437f),
        ];
        for (text, hash) in expected {
            assert_eq!(murmur3(text.as_bytes()), hash, "{text}");
        }
    }

    #[test]
    fn numbers_are_floats_of_every_day() {
        for hash in [0, 0x007f_ffff, 0x7f80_0000, 0xffff_ffff, 0x807f_ffff, 0x1234_5678] {
            let float = f32::from_bits(float_bits(hash));
            assert!(float.is_normal(), "{hash:08x}");
        }
        assert_eq!(float_bits(0x1234_5678), 0x1234_5678);
    }
}
