//! One function a reader.

use std::fs;
use std::path::{Path, PathBuf};

use etendue_files::{Opener, Reach};
use etendue_geometry::Buffer;
use etendue_image::{Cube, Limits, envi};
use etendue_optics::element::Picture;
use etendue_optics::train::{Focus, Inquiry, LensFile, LensFormat, LensReport, ZemaxLens};
use etendue_scene::file::{SensorFile, read_lens, trace_rays};
use etendue_scene::import::{Options, import};
use etendue_scene::{LoadOptions, SceneFile, Setting, Strictness, Wanted, doctor};
use etendue_tracer::texture::{Filter, Wrap};
use etendue_tracer::{EnvironmentMap, ImageSource, Texture};

/// A reader under test.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Its name: that of its file in `fuzz/fuzz_targets`.
    pub name: &'static str,
    /// Reads bytes, with a folder to put them in.
    pub run: fn(&[u8], &Path),
}

/// All readers.
pub const TARGETS: [Target; 29] = [
    Target { name: "gltf", run: gltf },
    Target { name: "glb", run: glb },
    Target { name: "obj", run: obj },
    Target { name: "mtl", run: mtl },
    Target { name: "ply", run: ply },
    Target { name: "npy", run: npy },
    Target { name: "curve", run: curve },
    Target { name: "scene", run: scene },
    Target { name: "set", run: set },
    Target { name: "sensor", run: sensor },
    Target { name: "lens", run: lens },
    Target { name: "rays", run: rays },
    Target { name: "zmx", run: zmx },
    Target { name: "seq", run: seq },
    Target { name: "oslo", run: oslo },
    Target { name: "optiland", run: optiland },
    Target { name: "iset", run: iset },
    Target { name: "pbrt_lens", run: pbrt_lens },
    Target { name: "photons_to_photos", run: photons_to_photos },
    Target { name: "lens_report", run: lens_report },
    Target { name: "zmx_report", run: zmx_report },
    Target { name: "mask_png", run: mask_png },
    Target { name: "mask_exr", run: mask_exr },
    Target { name: "texture", run: texture },
    Target { name: "environment_hdr", run: environment_hdr },
    Target { name: "environment_exr", run: environment_exr },
    Target { name: "envi", run: envi },
    Target { name: "dng", run: dng },
    Target { name: "doctor", run: doctor },
];

/// The target of that name.
#[must_use]
pub fn named(name: &str) -> Option<Target> {
    TARGETS.into_iter().find(|target| target.name == name)
}

/// Writes a file anew: one that is mapped keeps its bytes.
fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    // A folder that cannot be written to shows when the file is read.
    let _ = fs::remove_file(&path);
    let _ = fs::write(&path, bytes);
    path
}

/// Imports a model under both rules and examines it.
fn model(bytes: &[u8], folder: &Path, name: &str) {
    let path = write(folder, name, bytes);
    let options = Options {
        strictness: Strictness::Strict,
        root: Some(folder.to_owned()),
        ..Options::default()
    };
    let _ = import(&path, Wanted::EVERYTHING, &options);
    check(&path);
}

fn check(path: &Path) {
    check_within(path, None);
}

fn check_within(path: &Path, memory_limit: Option<u64>) {
    let options = LoadOptions { memory_limit, ..LoadOptions::default() };
    if let Ok(found) = doctor::check(path, &[], &options) {
        let _ = found.table().text();
    }
}

fn gltf(bytes: &[u8], folder: &Path) {
    model(bytes, folder, "m.gltf");
}

fn glb(bytes: &[u8], folder: &Path) {
    model(bytes, folder, "m.glb");
}

fn obj(bytes: &[u8], folder: &Path) {
    model(bytes, folder, "m.obj");
}

fn mtl(bytes: &[u8], folder: &Path) {
    write(folder, "m.mtl", bytes);
    model(b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n", folder, "m.obj");
}

fn ply(bytes: &[u8], folder: &Path) {
    model(bytes, folder, "m.ply");
}

fn npy(bytes: &[u8], folder: &Path) {
    write(folder, "m.npy", bytes);
    let scene = br#"{"etendue": 1, "objects": [{"shape": "rectangle", "instances": "m.npy"}]}"#;
    check(&write(folder, "s.json", scene));
}

/// As a reflectance and a lamp, and as the index of a metal.
fn curve(bytes: &[u8], folder: &Path) {
    for (name, material) in [
        ("curve.csv", r#"{"type": "matte", "color": {"file": "curve.csv"}}"#),
        ("curve.csv", r#"{"type": "emissive", "radiance": {"file": "curve.csv", "column": 2}}"#),
        ("metal.yml", r#"{"type": "metal", "metal": {"file": "metal.yml"}}"#),
    ] {
        write(folder, name, bytes);
        let text = format!(r#"{{"etendue": 1, "materials": {{"a": {material}}}, "objects": []}}"#);
        scene(text.as_bytes(), folder);
    }
}

/// A shape has as many triangles as a number says, each of which takes a microsecond: with this memory there
/// are some three million at most.
fn scene(bytes: &[u8], folder: &Path) {
    check_within(&write(folder, "s.json", bytes), Some(128 << 20));
}

/// A line a setting.
fn set(bytes: &[u8], folder: &Path) {
    let scene = br#"{"etendue": 1, "objects": [{"shape": "box"}], "layers": ["depth"],
        "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}}"#;
    let path = write(folder, "s.json", scene);
    let text = String::from_utf8_lossy(bytes);
    let pairs = text.lines().filter_map(|line| line.split_once('='));
    let settings: Vec<Setting> = pairs.map(|(path, value)| Setting::new(path, value)).collect();
    let _ = SceneFile::read(&path, &settings);
    let _ = doctor::check(&path, &settings, &LoadOptions::default());
}

fn sensor(bytes: &[u8], folder: &Path) {
    let _ = SensorFile::read(&Opener::default(), &write(folder, "sensor.json", bytes), &[]);
}

fn lens(bytes: &[u8], folder: &Path) {
    let _ = read_lens(&write(folder, "lens.json", bytes), Reach::OwnFolder, &[]);
}

fn seq(bytes: &[u8], folder: &Path) {
    let _ = read_lens(&write(folder, "lens.seq", bytes), Reach::OwnFolder, &[]);
}

fn oslo(bytes: &[u8], folder: &Path) {
    imported(LensFormat::Oslo, &write(folder, "lens.len", bytes), bytes);
}

/// By its content, and as what it no longer says that it is.
fn optiland(bytes: &[u8], folder: &Path) {
    imported(LensFormat::Optiland, &write(folder, "lens.json", bytes), bytes);
}

fn iset(bytes: &[u8], folder: &Path) {
    imported(LensFormat::Iset, &write(folder, "lens.json", bytes), bytes);
}

fn pbrt_lens(bytes: &[u8], folder: &Path) {
    imported(LensFormat::Pbrt, &write(folder, "lens.dat", bytes), bytes);
}

fn photons_to_photos(bytes: &[u8], folder: &Path) {
    imported(LensFormat::PhotonsToPhotos, &write(folder, "lens.txt", bytes), bytes);
}

/// As a file by its name, and as what it is meant to be.
fn imported(format: LensFormat, path: &Path, bytes: &[u8]) {
    let _ = read_lens(path, Reach::OwnFolder, &[]);
    let _ = ZemaxLens::read_as(format, bytes, Some(2), &[]);
}

fn zmx(bytes: &[u8], folder: &Path) {
    let _ = read_lens(&write(folder, "lens.zmx", bytes), Reach::OwnFolder, &[]);
}

/// The work of `etendue lens`, which takes a thousand times as long as reading the file.
fn report(path: &Path) {
    let Ok(lens) = read_lens(path, Reach::OwnFolder, &[]) else { return };
    let named = |list: Vec<f64>| (!list.is_empty()).then_some(list);
    let inquiry = Inquiry {
        wavelengths: named(lens.wavelengths()),
        fields: named(lens.fields()),
        stated: lens.file.map(|file| file.fields).unwrap_or_default(),
        focus: lens.focus,
    };
    if let Ok(report) = LensReport::new(&lens.train, &inquiry) {
        let _ = report.to_string();
    }
}

fn lens_report(bytes: &[u8], folder: &Path) {
    report(&write(folder, "lens.json", bytes));
}

fn zmx_report(bytes: &[u8], folder: &Path) {
    report(&write(folder, "lens.zmx", bytes));
}

fn rays(bytes: &[u8], folder: &Path) {
    let elements = r#"{"elements": [{"type": "surface", "radius": 50, "thickness": 4,
        "glass": "N-BK7", "semi_diameter": 9}, {"type": "surface", "radius": -50}]}"#;
    let lens =
        LensFile::from_json(elements).and_then(|file| file.build(&|name: &str| Err(name.into())));
    if let Ok(lens) = lens {
        let _ = trace_rays(&lens, &write(folder, "rays.json", bytes));
        let _ = lens.sensor_z(Focus::AsWritten);
    }
}

fn mask(bytes: &[u8], folder: &Path, name: &str) {
    write(folder, name, bytes);
    let _ = Picture::read(name, 10.0, None, &|name: &str| Ok(folder.join(name)));
}

fn mask_png(bytes: &[u8], folder: &Path) {
    mask(bytes, folder, "mask.png");
}

fn mask_exr(bytes: &[u8], folder: &Path) {
    mask(bytes, folder, "mask.exr");
}

/// PNG and JPEG.
fn texture(bytes: &[u8], _folder: &Path) {
    let texture = Texture {
        name: "texture".to_owned(),
        source: ImageSource::Bytes(Buffer::from(bytes.to_vec())),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Bilinear,
        named_by_scene: false,
    };
    let _ = texture.decode(Limits::default());
}

fn environment_hdr(bytes: &[u8], folder: &Path) {
    let _ = EnvironmentMap::read(&write(folder, "sky.hdr", bytes), Limits::default());
}

fn environment_exr(bytes: &[u8], folder: &Path) {
    let _ = EnvironmentMap::read(&write(folder, "sky.exr", bytes), Limits::default());
    if let Ok(channels) = etendue_image::exr_channels(bytes, Limits::default()) {
        let _ = Cube::from_exr(channels);
    }
}

/// A header, and behind its first zero byte the numbers.
fn envi(bytes: &[u8], _folder: &Path) {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (header, numbers) = bytes.split_at(end);
    if let Ok(header) = envi::Header::parse(header) {
        let _ = header.decode(numbers, Limits::default());
    }
}

/// A raw photograph.
fn dng(bytes: &[u8], _folder: &Path) {
    let _ = etendue_image::dng::read(bytes, Limits::default());
}

/// The files beside a model, which are looked through for names.
fn doctor(bytes: &[u8], folder: &Path) {
    for name in ["beside.gltf", "beside.glb", "beside.mtl", "beside.obj", "beside.json"] {
        write(folder, name, bytes);
    }
    write(folder, "unused.png", b"");
    check(&write(folder, "m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
}
