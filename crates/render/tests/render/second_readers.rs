//! Files read by programs that share no code with ours: OpenEXR's own Python module and
//! `exrheader`, numpy, and xxhash. Each test says so and passes when its reader is not there.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use etendue_files::{SOFTWARE, Transaction};
use etendue_render::output::{
    Channel, HeaderEntry, ImageHash, Layer, Look, Picture, Values, exr, npy,
};
use serde_json::{Map, Value, json};

// Neither side a multiple of a block's 16 rows, nor of a vector's bands.
const WIDTH: usize = 83;
const HEIGHT: usize = 53;

fn plane<T>(value: impl Fn(u32) -> T) -> Vec<T> {
    (0..u32::try_from(WIDTH * HEIGHT).unwrap()).map(value).collect()
}

/// Deterministic bits without a pattern.
fn scramble(i: u32) -> u32 {
    let i = (i ^ (i >> 16)).wrapping_mul(0x045d_9f3b);
    (i ^ (i >> 16)).wrapping_mul(0x045d_9f3b)
}

fn layer(name: &str, look: Look, planes: Vec<(&str, Values)>) -> Layer {
    let channels =
        planes.into_iter().map(|(name, values)| Channel { name: name.into(), values }).collect();
    let meaning = vec![
        HeaderEntry::new("definition", format!("what {name} means, \"quoted\", in m² and µm")),
        HeaderEntry::new("unit", "m"),
        HeaderEntry::new("miss", "+inf"),
    ];
    Layer { name: name.into(), look, channels, meaning }
}

/// One layer of each type, with the values that a format is most likely to spoil.
fn picture() -> Picture {
    let depth = plane(|i| match i % 11 {
        0 => f32::INFINITY,
        1 => f32::from_bits(1 + i), // the smallest there are: flushed to zero by careless readers
        2 => -0.0,
        3 => f32::MAX,
        _ => 1.0 + (i as f32).sqrt(),
    });
    let doubles = plane(|i| if i % 7 == 0 { f64::INFINITY } else { f64::from(i).sqrt() / 3.0 });
    let light = |k: u32| Values::F32(plane(|i| (scramble(i * 3 + k) >> 8) as f32 / 8_388_608.0));
    let normal =
        |k: u32| Values::F32(plane(|i| (scramble(i * 5 + k) >> 8) as f32 / 8_388_608.0 - 1.0));
    let layers = vec![
        layer("", Look::Color, vec![("R", light(0)), ("G", light(1)), ("B", light(2))]),
        layer("Depth", Look::Distance, vec![("Z", Values::F32(depth))]),
        layer("Distance", Look::Distance, vec![("Z", Values::F64(doubles))]),
        layer(
            "Normal",
            Look::Direction,
            vec![("X", normal(0)), ("Y", normal(1)), ("Z", normal(2))],
        ),
        layer(
            "Id",
            Look::Ids,
            vec![
                ("object", Values::U32(plane(|i| i / 100))),
                ("primitive", Values::U32(plane(scramble))),
            ],
        ),
        layer(
            "Raw",
            Look::Counts { bits: 12 },
            vec![("Y", Values::U16(plane(|i| u16::try_from(i % 4096).unwrap())))],
        ),
    ];
    let header = vec![
        HeaderEntry::new("scene_hash", "0123456789abcdef0123456789abcdef"),
        HeaderEntry::new("seed", "0"),
        HeaderEntry::new("pixel_origin", "top left corner; centres at half integers"),
    ];
    Picture::new(WIDTH, HEIGHT, layers, header).unwrap()
}

fn raw(values: &Values) -> Vec<u8> {
    match values {
        Values::F32(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Values::F64(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Values::U16(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Values::U32(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
    }
}

fn attributes(picture: &Picture) -> Map<String, Value> {
    let mut attributes = Map::new();
    attributes.insert("software".into(), SOFTWARE.into());
    for layer in picture.layers() {
        let meaning: Vec<_> = layer
            .meaning
            .iter()
            .map(|HeaderEntry { key, text }| format!("{}:{}", json!(key), json!(text)))
            .collect();
        attributes.insert(
            format!("etendue:{}", layer.title()),
            format!("{{{}}}", meaning.join(",")).into(),
        );
    }
    for HeaderEntry { key, text } in picture.header() {
        attributes.insert(format!("etendue:{key}"), text.as_str().into());
    }
    attributes
}

/// Writes all that `read_back.py` compares.
fn write_all(folder: &Path, picture: &Picture) {
    let mut channels = Map::new();
    let mut arrays = Map::new();
    for layer in picture.layers() {
        let array = format!("{}.npy", layer.title());
        npy::write(&Transaction::at_once(), &folder.join(&array), picture, &layer.name).unwrap();
        let names = layer.channels.iter().map(|channel| layer.full_name(channel));
        arrays.insert(array, names.collect());
        for channel in &layer.channels {
            let name = layer.full_name(channel);
            fs::write(folder.join(format!("{name}.raw")), raw(&channel.values)).unwrap();
            // Integers that floats hold exactly are floats, for readers that know no others.
            let stored = match &channel.values {
                Values::U32(values) if values.iter().any(|value| *value > 1 << 24) => "uint32",
                _ => "float32",
            };
            let kind = channel.values.type_name();
            channels.insert(name, json!({ "type": kind, "stored": stored }));
        }
    }
    for (name, compression) in [("none", exr::Compression::None), ("zip", exr::Compression::Zip)] {
        let options = exr::Options { compression, ..Default::default() };
        exr::write(&Transaction::at_once(), &folder.join(format!("{name}.exr")), picture, &options)
            .unwrap();
    }
    let expected = json!({
        "width": WIDTH, "height": HEIGHT,
        "exr": ["none.exr", "zip.exr"], "npy": arrays,
        "channels": channels, "attributes": attributes(picture),
        "hash": ImageHash::of(picture).to_string(),
    });
    fs::write(folder.join("expected.json"), expected.to_string()).unwrap();
}

/// A Python with the readers, made once under the target folder; `None`, with the reason printed,
/// when it cannot be made.
fn python() -> Option<PathBuf> {
    const PACKAGES: [&str; 4] = ["OpenEXR>=3.3", "OpenImageIO>=3", "numpy", "xxhash"];
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-2");
    let python = home.join("bin").join("python");
    let ready = home.join("ready");
    fs::create_dir_all(&home).ok()?;
    // Tests run as processes side by side; one of them installs.
    let lock = File::create(home.join("lock")).ok()?;
    lock.lock().ok()?;
    if ready.exists() {
        return Some(python);
    }
    let mut make = Command::new("python3");
    make.args(["-m", "venv"]).arg(&home);
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    install.args(["--timeout", "20", "--retries", "1", "--only-binary", ":all:"]).args(PACKAGES);
    for (what, command) in [("python3 -m venv", &mut make), ("pip install", &mut install)] {
        match command.output() {
            Ok(output) if output.status.success() => {}
            Ok(output) => return skip(what, &String::from_utf8_lossy(&output.stderr)),
            Err(error) => return skip(what, &error.to_string()),
        }
    }
    fs::write(ready, "").ok()?;
    Some(python)
}

fn skip(what: &str, why: &str) -> Option<PathBuf> {
    println!("skipped: {what}: {}", why.trim());
    None
}

fn text(output: &Output) -> String {
    let streams = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    streams.concat()
}

#[test]
fn openexr_numpy_and_xxhash_read_every_bit() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    write_all(folder.path(), &picture());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/render/read_back.py");
    let output = Command::new(python).arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    print!("{}", text(&output));
}

#[test]
fn exrheader_shows_channels_and_meaning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    exr::write(&Transaction::at_once(), &path, &picture(), &exr::Options::default()).unwrap();
    let Ok(output) = Command::new("exrheader").arg(&path).output() else {
        println!("skipped: there is no exrheader (Debian's package openexr)");
        return;
    };
    let header = text(&output);
    assert!(output.status.success(), "{header}");
    for line in [
        "compression (type compression): zip, multi-scanline blocks",
        "dataWindow (type box2i): (0 0) - (82 52)",
        "lineOrder (type lineOrder): increasing y",
        "    Depth.Z, 32-bit floating-point, sampling 1 1",
        "    Distance.Z, 32-bit floating-point, sampling 1 1",
        "    Id.object, 32-bit floating-point, sampling 1 1",
        "    Normal.X, 32-bit floating-point, sampling 1 1",
        "    R, 32-bit floating-point, sampling 1 1",
        "    Id.primitive, 32-bit unsigned integer, sampling 1 1",
        "    Raw.Y, 32-bit floating-point, sampling 1 1",
        "etendue:seed (type string): \"0\"",
        "etendue:scene_hash (type string): \"0123456789abcdef0123456789abcdef\"",
        "etendue:RGB (type string): \"{\"definition\":",
        &format!("software (type string): \"{SOFTWARE}\""),
    ] {
        assert!(header.lines().any(|found| found.starts_with(line)), "no \"{line}\" in:\n{header}");
    }
}
