//! Inputs to start from: the repository's scenes, small files made here, and what failed once.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::prelude::WritableImage;
use image::{ImageFormat, Rgb, RgbImage};

/// The inputs that `target` starts from.
#[must_use]
pub fn of(target: &str) -> Vec<Vec<u8>> {
    let mut seeds = match target {
        "gltf" => vec![GLTF.into(), INSTANCED.into(), format!("\u{feff}{GLTF}").into_bytes()],
        "glb" => {
            let draco = files("crates/scene/tests/scene/data/draco", "glb");
            [vec![glb(GLTF), glb(INSTANCED)], draco].concat()
        }
        "obj" => objs(),
        "mtl" => {
            vec![MTL.into(), missing("newmtl m", "\nmap_Kd "), b"\xef\xbb\xbfnewmtl a\r".into()]
        }
        "ply" => plys(),
        "npy" => npys(),
        "curve" => {
            let metal = b"DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.5 2.0\n        0.7 0.2 3.5\n";
            let mut curves = files("scenes/spectra", "csv");
            curves.extend([metal.to_vec(), b"# spd\n400:1\n700:2\n".to_vec()]);
            curves
        }
        "scene" => files("scenes", "json"),
        "set" => vec![
            b"camera.fov=30\nobjects[0].transform.scale=2\nlayers=[\"depth\", \"normal\"]".into(),
            [&b"a.".repeat(60_000)[..], b"b=1"].concat(),
            [&b"camera="[..], &b"[".repeat(60_000)].concat(),
        ],
        "sensor" => vec![SENSOR.into()],
        "lens" | "lens_report" => files("scenes/lenses", "json"),
        "rays" => vec![RAYS.into()],
        "zmx" | "zmx_report" => zmxs(),
        "seq" => seqs(),
        "oslo" => vec![OSLO.into()],
        "optiland" => files("crates/optics/tests/optics/optiland", "json"),
        "iset" => vec![ISET_TABLE.into(), ISET_SPHERES.into()],
        "pbrt_lens" => {
            vec![b"# a\n50 4 1.5 20\n-50 1 1 20\n0 46 0 8\n60 2 1.6 18\n-60 0 1 18\n".into()]
        }
        "photons_to_photos" => vec![PHOTONS_TO_PHOTOS.into()],
        "mask_png" => vec![picture(ImageFormat::Png, [7, 7, 7])],
        "texture" => {
            let color = [200, 90, 10];
            vec![picture(ImageFormat::Png, color), picture(ImageFormat::Jpeg, color)]
        }
        "environment_hdr" => vec![hdr()],
        "mask_exr" | "environment_exr" => vec![exr_file()],
        "envi" => envis(),
        "dng" => dngs(),
        "doctor" => vec![GLTF.into(), glb(GLTF), MTL.into(), b"unused.png %20 \\ ".repeat(99)],
        _ => Vec::new(),
    };
    seeds.push(Vec::new());
    seeds.extend(found(target));
    seeds
}

/// The repository's root.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Inputs that failed once.
fn found(target: &str) -> Vec<Vec<u8>> {
    files(&format!("tests/fuzz/found/{target}"), "")
}

/// The contents of the files of a folder with that ending, by their names.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let Ok(entries) = fs::read_dir(root().join(folder)) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.is_file() && path.to_string_lossy().ends_with(ending));
    paths.sort();
    paths.iter().filter_map(|path| fs::read(path).ok()).collect()
}

/// A triangle with all attributes, a material, a camera and a light; its bytes in a data URI.
const GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
"nodes": [{"mesh": 0, "children": [2], "rotation": [0, 0, 0, 1], "scale": [1, 2, 1], "name": "n"},
 {"camera": 0, "translation": [0, 0, 3]}, {"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1],
 "extensions": {"KHR_lights_punctual": {"light": 0}}}],
"extensionsUsed": ["KHR_lights_punctual"],
"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3}]}},
"cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 0, "TEXCOORD_0": 2},
 "indices": 1, "material": 0}]}],
"materials": [{"name": "m", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 1],
 "metallicFactor": 0.3, "baseColorTexture": {"index": 0}}, "alphaMode": "MASK"}],
"textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071}],
"images": [{"bufferView": 0, "mimeType": "image/png"}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
 "min": [0, 0, 0], "max": [1, 1, 0]},
 {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
 {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2", "sparse": {"count": 1,
  "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}}}],
"bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
"buffers": [{"byteLength": 42, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA"}]}"#;

/// Instances by an accessor without a buffer view, which counts zeros.
const INSTANCED: &str = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
"extensionsUsed": ["EXT_mesh_gpu_instancing"],
"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}}}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}],
"accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"},
 {"componentType": 5126, "count": 100, "type": "VEC3"}]}"#;

/// A GLB of a document and the forty-two bytes of the triangle.
fn glb(json: &str) -> Vec<u8> {
    // With its buffer in the file.
    let (json, end) = json.split_once(", \"uri\"").map_or((json, ""), |(head, _)| (head, "}]}"));
    let mut json = [json.as_bytes(), end.as_bytes()].concat();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary: Vec<u8> = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    binary.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    let size = |length: usize| u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes();
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(size(28 + json.len() + binary.len()));
    file.extend(size(json.len()));
    file.extend(b"JSON");
    file.extend(json);
    file.extend(size(binary.len()));
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

fn objs() -> Vec<Vec<u8>> {
    let plain = "mtllib m.mtl\no a\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.1\nvt 0 1\nvn 0 0 1\n\
                 usemtl m\nf 1/1/1 2/1/1 4//1 3\ng b\nf -1 -2 \\\n -3\nl 1 2\n";
    let around: String = (0..5000).map(|i| format!(" {}", i % 4 + 1)).collect();
    let crowd: String = (1..3000).map(|i| format!("vt {i}\nf 1/{i} 1/1 1/{i}\n")).collect();
    vec![
        plain.into(),
        plain.replace('\n', "\r").into_bytes(),
        format!("v .5 -.5 .5\nv -.5 -.5 .5\nv -.5 -.5 1e-160\nv -.5 .5 -.5\nf{around}\n")
            .into_bytes(),
        format!("v 0 0 0\n{crowd}").into_bytes(),
        missing("v 1.#IND 0 0\nv -1.#INF 0 nan\nv 0 0 0\nf 1 2 3", "\nmtllib "),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
            .to_owned()
            .into_bytes()
            .into_iter()
            .chain(b"f -1 -2 -3\nf -1\n".repeat(2000))
            .collect(),
    ]
}

/// Many names of files that are not there.
fn missing(start: &str, before: &str) -> Vec<u8> {
    let names: String = (0..3000).map(|i| format!("{before}a{i}")).collect();
    format!("{start}{names}\n").into_bytes()
}

const MTL: &str = "newmtl a\nKa 0 0 0\nKd 0.5\nKs 1 1 1\nKe 2 2 2\nNs 10\nNi 1.5\nd -halo 0.5\nillum 4\n\
                   map_Kd -s 2 2 -o 1 0 -clamp on wood.png\nTr 0.1\nnewmtl b\nbump x.png\n";

fn plys() -> Vec<Vec<u8>> {
    let header = "ply\nformat FORMAT 1.0\ncomment c\nelement vertex 4\nproperty float x\n\
                  property float y\nproperty float z\nproperty uchar red\nproperty uchar green\n\
                  property uchar blue\nelement face 2\nproperty list uchar int vertex_indices\n\
                  end_header\n";
    let rows = "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n.2 .2 1.#IND 9 9 9\n3 0 1 2\n4 0 1 3 2\n";
    let text = header.replace("FORMAT", "ascii") + rows;
    let mut all = vec![text.clone().into_bytes(), text.replace('\n', "\r").into_bytes()];
    for (format, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let mut file = header.replace("FORMAT", format).into_bytes();
        let word = |mut bytes: [u8; 4]| {
            if big {
                bytes.reverse();
            }
            bytes
        };
        for [x, y, z] in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, 0.0]] {
            [x, y, z].iter().for_each(|x| file.extend(word(x.to_le_bytes())));
            file.extend([1, 2, 3]);
        }
        for face in [&[0_i32, 1, 2][..], &[0, 1, 3, 2]] {
            file.extend(u8::try_from(face.len()).ok());
            face.iter().for_each(|corner| file.extend(word(corner.to_le_bytes())));
        }
        all.push(file);
    }
    all
}

/// Cubes of two bands in each order of numbers.
fn envis() -> Vec<Vec<u8>> {
    let cube = |interleave: &str, more: &str| {
        let mut bytes = format!(
            "ENVI\nsamples = 3\nlines = 2\nbands = 2\ndata type = 4\ninterleave = {interleave}\nbyte order = 0\n\
             wavelength units = Nanometers\nwavelength = {{450,\n 550}}\n{more}"
        )
        .into_bytes();
        bytes.extend([0; 48]);
        bytes
    };
    vec![
        cube("bsq", "fwhm = {100, 100}\n"),
        cube("bil", "data gain values = {2, 3}\nbbl = {1, 0}\n"),
        cube("bip", "header offset = 18446744073709551615\n"),
        cube(
            "bsq",
            "reflectance scale factor = 1\ndata ignore value = 0\nz plot titles = {a (nm), b (c)}\n",
        ),
    ]
}

/// A raw image of four by two numbers, in both orders of bytes.
fn dngs() -> Vec<Vec<u8>> {
    let file = |is_big: bool| {
        let short = |n: u16| if is_big { n.to_be_bytes() } else { n.to_le_bytes() };
        let long = |n: u32| if is_big { n.to_be_bytes() } else { n.to_le_bytes() };
        let mut bytes = if is_big { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
        bytes.extend(long(8));
        let tags: [(u16, u32); 8] =
            [(256, 4), (257, 2), (258, 16), (259, 1), (273, 110), (277, 1), (278, 2), (279, 16)];
        bytes.extend(short(8));
        for (tag, value) in tags {
            [short(tag), short(4)].iter().for_each(|word| bytes.extend(word));
            [long(1), long(value)].iter().for_each(|word| bytes.extend(word));
        }
        bytes.extend(long(0));
        bytes.resize(126, 7);
        bytes
    };
    vec![file(false), file(true)]
}

fn npys() -> Vec<Vec<u8>> {
    let file = |version: u8, header: &str| {
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        let length = u16::try_from(header.len()).unwrap_or(u16::MAX).to_le_bytes();
        bytes.extend(length);
        if version > 1 {
            bytes.extend([0, 0]);
        }
        bytes.extend(header.as_bytes());
        for number in [1.0_f64, 0.0, 0.0, 2.0, 0.0, 1.0, 0.0, 3.0, 0.0, 0.0, 1.0, 4.0] {
            bytes.extend(number.to_le_bytes());
        }
        bytes
    };
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 3, 4), }\n";
    let mut long = file(2, header);
    long[8..12].copy_from_slice(&[0xff, 0xff, 0xff, 0x7f]);
    vec![file(1, header), file(2, header), file(3, header), file(1, &"{".repeat(14)), long]
}

const SENSOR: &str = r#"{"type": "raw", "resolution": [64, 48], "pixel_pitch": 2.4,
"quantum_efficiency": [[400, 0.5], [700, 0.6]], "system_gain": 0.5, "read_noise": 2,
"full_well": 15000, "black_level": 64, "bit_depth": 12, "exposure": 0.01, "cfa": "rggb"}"#;

const RAYS: &str = r#"{"from": "object", "clip": true, "rays": [
{"origin": [0, 1, -5], "direction": [0, 0, 1], "wavelength": 587.56},
{"origin": [0, 0, -5], "direction": [0.1, 0, 1], "wavelength": 486.1}]}"#;

fn zmxs() -> Vec<Vec<u8>> {
    let fields: Vec<String> = (0..300).map(|i| (f64::from(i) * 0.1).to_string()).collect();
    let lens = format!(
        "MODE SEQ\nNAME a 50 mm EFL 50\nUNIT MM\nENPD 10\nGCAT SCHOTT\nFTYP 3 0 300 1\nYFLN {}\n\
         WAVM 1 0.55 1\nWAVM 2 0.48 1\nPWAV 1\n\
         SURF 0\n  TYPE STANDARD\n  DISZ INFINITY\n\
         SURF 1\n  STOP\n  TYPE EVENASPH\n  CURV 0.02\n  CONI -0.5\n  PARM 2 1e-6\n  DISZ 4\n  \
         GLAS N-BK7 0 0\n  DIAM 8 1\n\
         SURF 2\n  TYPE COORDBRK\n  PARM 3 1.5\n  DISZ 0\n\
         SURF 3\n  TYPE STANDARD\n  CURV -0.02\n  DISZ 48\n  DIAM 8\n\
         SURF 4\n  TYPE STANDARD\n  DISZ 0\n",
        fields.join(" ")
    );
    let wide = lens.encode_utf16().flat_map(u16::to_le_bytes);
    vec![[0xff, 0xfe].into_iter().chain(wide).collect(), lens.into_bytes()]
}

fn seqs() -> Vec<Vec<u8>> {
    let lens = "RDM;LEN\nTITLE 'a'\nEPD 10\nDIM M\nWL 656 587 &\n 486\nREF 2\nYAN 0 7\nSO 0 0.1e14\n\
        S 20 3 NBK7_SCHOTT\n  CIR 6\nS -50 2 517000.642000\n  ASP\n  K -0.5; A 1e-6\nS 0 1.5\n  STO\n  CIR 4\n\
        S -90 -30 REFL\n  ADE 10\n  BEN\n  CIR 9\n  CIR HOL 1\nSI 0 0\nGO\n";
    vec![lens.as_bytes().to_vec()]
}

const OSLO: &str = "// OSLO\nLEN NEW \"a b\" 50 4\nEBR 5\nANG 10\nUNI 1\n// SRF 0\nAIR\nTH 1e20\nAP 1e20\nNXT\nGLA BK7\nRD 50; TH 4\n\
    AP CHK 8\nAST\nCC -0.5; AD 1e-6\nNXT\nAIR\nRD -50\nTH 9\nASP ASX 9\nAS4 1e-6\nTLA 2; DCY 1\nRCO\nNXT\nRFL\nPK CVM 1 0.01\n\
    TH -50\nTLA 20\nBEN\nNXT\nWV 0.58 0.48 0.65\nWW 1 1 1\nEND 4\nCFG NEW\nTH 3 2 -45\nEND\nRST NEW\nF 1 0 1 0 0 0 -1 1 -1 1 1\nEND\n";

const ISET_TABLE: &str = r#"{"name": "a", "type": "multi element lens", "surfaces": [
    {"radius": [50, 51], "thickness": 4, "ior": [[400, 500, 600, 700], [1.62, 1.61, 1.605, 1.602]], "semi_aperture": 10,
    "conic_constant": [-0.5, -0.5]}, {"radius": -50, "thickness": 1, "ior": 1, "semi_aperture": 10},
    {"radius": 0, "thickness": 46, "ior": 0, "semi_aperture": 4}]}"#;

const ISET_SPHERES: &str = r#"{"units": "mm", "apertureMiddleD": 6, "surfaceArray": [
    {"subtype": "refractive", "sRadius": 50, "sCenter": [0, 0, 46], "wave": [400, 700], "n": [1.5, 1.49], "apertureD": 20},
    {"subtype": "refractive", "sRadius": -50, "sCenter": [0, 0, -51], "wave": [400, 700], "n": [1, 1], "apertureD": 20},
    {"subtype": "diaphragm", "sRadius": 0, "sCenter": [0, 0, 0], "wave": [400, 700], "n": [1, 1], "apertureD": 20}]}"#;

const PHOTONS_TO_PHOTOS: &str = "[descriptive data]\ntitle\ta\n[constants]\nAsphericalOddCount\t1\n[variable distances]\nFocal Length\t48\t60\n\
    F-Number\t4\t5\nAngle of View\t40\t30\nd0\tInfinity\nd2\t1\t3\nBf\t40\n[lens data]\n1\t50\t4\t1.5\t20\t64.2\tN-BK7\tSCHOTT\n\
    2\t-50\td2\t\t20\n3\tAS\t2\t\t9\n4\tInfinity\t2\t1.6\t18\t50\n5\t-60\tBf\t\t18\n[aspherical data]\n2\t-50\t-0.5\t1e-6\t-2e-9\t1e-12\n";

fn picture(format: ImageFormat, color: [u8; 3]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    // An encoder that fails leaves its part, which is a seed as well.
    let _ = RgbImage::from_pixel(9, 7, Rgb(color)).write_to(&mut bytes, format);
    bytes.into_inner()
}

fn hdr() -> Vec<u8> {
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
    file.extend([128, 64, 32, 129].repeat(8));
    file
}

fn exr_file() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let channels = exr::prelude::SpecificChannels::rgb(|at: exr::prelude::Vec2<usize>| {
        let grey = at.x() as f32 / 9.0;
        (grey, grey, grey)
    });
    let _ = exr::prelude::Image::from_channels((9, 5), channels)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes);
    bytes.into_inner()
}
