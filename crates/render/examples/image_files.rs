//! Benchmark of writing images: time and size of each format, beside the crate `exr`'s own writer.
//!
//! ```text
//! cargo run --release -p etendue-render --example image_files -- [SIDE]
//! ```
//!
//! The picture is a bumpy ball before nothing: depth, distance and facet normals (as a mesh of about
//! a million triangles gives at 1024 pixels a side), then noisy light. All threads are used; each
//! line is the best of five runs (the check and the hash run once), into the system's folder for temporary files.

#![expect(clippy::cast_possible_truncation, reason = "layers are f32, what they show is made up")]

use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use ::exr::prelude as crate_exr;
use crate_exr::WritableImage;
use etendue_files::Transaction;
use etendue_render::output::{Channel, ImageHash, Layer, Look, Picture, Values, exr, npy, png};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let side = std::env::args().nth(1).map_or(Ok(1024), |side| side.parse())?;
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    println!("{side} x {side}, {} threads", rayon::current_num_threads());
    for (what, layers) in [("geometry", geometry(side)), ("noisy light", vec![light(side)])] {
        let bytes: usize = channels(&layers).map(|channel| channel.values.len() * 4).sum();
        println!("\n{what}: {:.1} MB", bytes as f64 / 1e6);
        let the_crates = the_crates_image(side, &layers);
        let checked = Instant::now();
        let picture = Picture::new(side, side, layers, Vec::new())?;
        println!("{:<24}{:8.1} ms", "check", checked.elapsed().as_secs_f64() * 1e3);

        for (name, compression) in
            [("none", exr::Compression::None), ("zip", exr::Compression::Zip)]
        {
            let options = exr::Options { compression, ..Default::default() };
            let path = at("a.exr");
            report(&format!("exr {name}"), &path, bytes, || {
                exr::write(&Transaction::at_once(), &path, &picture, &options)
            })?;
        }
        let path = at("b.exr");
        report("exr, the crate's ZIP16", &path, bytes, || the_crates.write().to_file(&path))?;
        let first = picture.layers()[0].name.clone();
        let path = at("a.npy");
        report(&format!("npy {first}"), &path, bytes, || {
            npy::write(&Transaction::at_once(), &path, &picture, &first)
        })?;
        for layer in picture.layers() {
            let path = at("a.png");
            let run = || {
                png::write(&Transaction::at_once(), &path, &picture, &layer.name, png::Bits::Eight)
            };
            report(&format!("png {}", layer.title()), &path, bytes, run)?;
        }
        let begun = Instant::now();
        black_box(ImageHash::of(&picture));
        println!("{:<24}{:8.1} ms", "hash", begun.elapsed().as_secs_f64() * 1e3);
    }
    Ok(())
}

/// Runs `write` five times, and prints the best time and the size of the file against `bytes`.
fn report<E>(
    name: &str,
    path: &Path,
    bytes: usize,
    mut write: impl FnMut() -> Result<(), E>,
) -> Result<(), Box<dyn std::error::Error>>
where
    Box<dyn std::error::Error>: From<E>,
{
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let begun = Instant::now();
        write()?;
        best = best.min(begun.elapsed().as_secs_f64());
    }
    let share = fs::metadata(path)?.len() as f64 / bytes as f64;
    println!("{name:<24}{:8.1} ms {:7.1} %", best * 1e3, share * 100.0);
    Ok(())
}

fn channels(layers: &[Layer]) -> impl Iterator<Item = &Channel> {
    layers.iter().flat_map(|layer| &layer.channels)
}

fn layer(
    name: &str,
    look: Look,
    planes: impl IntoIterator<Item = (&'static str, Vec<f32>)>,
) -> Layer {
    let channels = planes
        .into_iter()
        .map(|(name, values)| Channel { name: name.into(), values: Values::F32(values) })
        .collect();
    Layer { name: name.into(), look, channels, meaning: Vec::new() }
}

fn geometry(side: usize) -> Vec<Layer> {
    let mut planes: [Vec<f32>; 5] = std::array::from_fn(|_| Vec::with_capacity(side * side));
    for i in 0..side * side {
        let pixel = ball(side, i % side, i / side);
        for (plane, value) in planes.iter_mut().zip(pixel) {
            plane.push(value);
        }
    }
    let [z, distance, x, y, facing] = planes;
    vec![
        layer("Normal", Look::Direction, [("X", x), ("Y", y), ("Z", facing)]),
        layer("Depth", Look::Distance, [("Z", z)]),
        layer("Distance", Look::Distance, [("Z", distance)]),
    ]
}

/// Depth, distance and normal of a bumpy ball whose facets are one to two pixels wide.
fn ball(side: usize, column: usize, row: usize) -> [f32; 5] {
    let scale = 2.4 / side as f64;
    let place = |i: usize| (i as f64 + 0.5) * scale - 1.2;
    let (u, v) = (place(column), -place(row));
    let rest = 1.0 - u * u - v * v;
    if rest <= 0.0 {
        return [f32::INFINITY, f32::INFINITY, 0.0, 0.0, 0.0];
    }
    let w = rest.sqrt();
    let bump = 0.05 * (9.0 * u).sin() * (11.0 * v).cos() * (7.0 * w).sin();
    let z = 3.0 - w * (1.0 + bump);
    let facet = |k: u64| {
        let cell = (column as u64 * 2 / 3) << 32 | (row as u64 * 2 / 3) << 2 | k;
        (random(cell) - 0.5) * 0.05
    };
    let n = [u + bump + facet(0), v - bump + facet(1), w + facet(2)];
    let length = n.iter().map(|n| n * n).sum::<f64>().sqrt();
    let distance = z * (1.0 + 0.1 * (u * u + v * v)).sqrt();
    [z, distance, n[0] / length, n[1] / length, n[2] / length].map(|value| value as f32)
}

fn light(side: usize) -> Layer {
    let planes = ["R", "G", "B"].into_iter().zip(0..).map(|(name, k)| {
        let plane = (0..side * side).map(|i| random(i as u64 * 4 + k) as f32);
        (name, plane.collect())
    });
    layer("", Look::Color, planes)
}

/// A number in 0..1 from the bits of `i` (the finalizer of `MurmurHash3`).
fn random(i: u64) -> f64 {
    let i = (i ^ (i >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    let i = (i ^ (i >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    ((i ^ (i >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
}

type CrateImage =
    crate_exr::Image<crate_exr::Layer<crate_exr::AnyChannels<crate_exr::FlatSamples>>>;

fn the_crates_image(side: usize, layers: &[Layer]) -> CrateImage {
    let list = layers.iter().flat_map(|layer| {
        layer.channels.iter().map(|channel| {
            let Values::F32(values) = &channel.values else { unreachable!("all are f32 here") };
            let samples = crate_exr::FlatSamples::F32(values.clone());
            crate_exr::AnyChannel::new(layer.full_name(channel).as_str(), samples)
        })
    });
    let encoding = crate_exr::Encoding {
        compression: crate_exr::Compression::ZIP16,
        blocks: crate_exr::Blocks::ScanLines,
        line_order: crate_exr::LineOrder::Increasing,
    };
    let channels = crate_exr::AnyChannels::sort(list.collect());
    let attributes = crate_exr::LayerAttributes::default();
    crate_exr::Image::from_layer(crate_exr::Layer::new(
        (side, side),
        attributes,
        encoding,
        channels,
    ))
}
