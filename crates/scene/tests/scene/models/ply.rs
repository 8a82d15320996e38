//! PLY in its three formats.

use std::fmt::Write as _;

use etendue_geometry::glam::DVec3;

use super::build::SQUARE;
use super::{error, folder, load, points, write};

const PLY_HEADER: &str = "ply\nformat FORMAT 1.0\ncomment by hand\nelement vertex 5\n\
    property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
    property uchar green\nproperty uchar blue\nelement face 2\n\
    property list uchar int vertex_indices\nend_header\n";

/// A triangle and a concave quadrilateral.
const PLY_POINTS: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [2.0, -1.0, 0.0], [0.5, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 9.0]];
const PLY_FACES: [&[i32]; 2] = [&[0, 1, 4], &[0, 1, 2, 3]];

pub(crate) fn ply_text() -> Vec<u8> {
    let mut text = PLY_HEADER.replace("FORMAT", "ascii");
    for [x, y, z] in PLY_POINTS {
        writeln!(text, "{x} {y} {z} 255 0 128").unwrap();
    }
    for face in PLY_FACES {
        let corners: Vec<String> = face.iter().map(i32::to_string).collect();
        writeln!(text, "{} {}", face.len(), corners.join(" ")).unwrap();
    }
    text.into_bytes()
}

pub(crate) fn ply_binary(big: bool) -> Vec<u8> {
    let format = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut file = PLY_HEADER.replace("FORMAT", format).into_bytes();
    let word = |bytes: [u8; 4]| {
        if big { bytes.map(|b| b).into_iter().rev().collect() } else { bytes.to_vec() }
    };
    for point in PLY_POINTS {
        point.iter().for_each(|x| file.extend(word(x.to_le_bytes())));
        file.extend([255, 0, 128]);
    }
    for face in PLY_FACES {
        file.push(u8::try_from(face.len()).unwrap());
        face.iter().for_each(|i| file.extend(word(i.to_le_bytes())));
    }
    file
}

#[test]
fn ply_is_the_same_in_all_formats() {
    let folder = folder();
    for (name, bytes) in
        [("t.ply", ply_text()), ("l.ply", ply_binary(false)), ("b.ply", ply_binary(true))]
    {
        let import = load(&write(&folder, name, &bytes));
        let mesh = &import.meshes[0];
        assert_eq!(points(mesh), PLY_POINTS.map(|p| DVec3::from(p.map(f64::from))), "{name}");
        assert_eq!(mesh.triangles.len(), 3, "{name}");
        let area: f64 = (1..3)
            .map(|i| mesh.corners(i))
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum();
        assert_eq!(area, 0.5, "{name}: the arrow head is not filled up");
        let [red, green, blue, _] = mesh.colors.as_ref().unwrap().get(4);
        // 128 of 255 in sRGB is 0.2158605 of full scale.
        assert_eq!((red, green), (1.0, 0.0));
        assert!((blue - 0.215_860_5).abs() < 1e-7, "{blue}");
        for (cut, word) in [(10, "format"), (100, "cut.ply"), (bytes.len() - 4, "")] {
            let message = error(&write(&folder, "cut.ply", &bytes[..cut]));
            assert!(message.contains(word), "{cut}: {message}");
        }
    }
}

#[test]
fn ply_of_triangles_is_read_in_parallel_and_in_place() {
    let folder = folder();
    let mut header = String::from(
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n\
         property float y\nproperty float z\nelement face 2\nproperty uchar flags\n\
         property list uchar uint vertex_index\nproperty float quality\nend_header\n",
    );
    while !header.len().is_multiple_of(4) {
        header = header.replace("end_header", "comment\nend_header").replacen(
            "comment\n",
            "comment \n",
            1,
        );
        if header.len() > 600 {
            break;
        }
    }
    let mut file = header.into_bytes();
    SQUARE.as_flattened().iter().for_each(|x| file.extend(x.to_le_bytes()));
    for triangle in [[0_u32, 1, 2], [1, 3, 2]] {
        file.extend([7, 3]);
        triangle.iter().for_each(|i| file.extend(i.to_le_bytes()));
        file.extend(0.5_f32.to_le_bytes());
    }
    let import = load(&write(&folder, "t.ply", file));
    assert_eq!(&import.meshes[0].triangles[..], [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(points(&import.meshes[0])[3], DVec3::new(1.0, 1.0, 0.0));
}

#[test]
fn ply_strips_are_cut_at_minus_one() {
    let folder = folder();
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
        property double z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 2 1 0\n";
    let import = load(&write(&folder, "s.ply", text));
    assert_eq!(&import.meshes[0].triangles[..], [[0, 1, 2], [2, 1, 3], [2, 1, 0]]);
}

#[test]
fn ply_lines_end_in_any_way() {
    let folder = folder();
    let expected = load(&write(&folder, "plain.ply", ply_text()));
    for end in ["\r", "\r\n"] {
        let header = PLY_HEADER.replace("FORMAT", "ascii").len();
        let text = String::from_utf8(ply_text()).unwrap().replace('\n', end);
        let import = load(&write(&folder, "text.ply", &text));
        assert_eq!(points(&import.meshes[0]), points(&expected.meshes[0]), "{end:?}");
        assert_eq!(import.meshes[0].triangles.len(), 3, "{end:?}");
        // A program may write its header so and text as ever.
        let file = ply_text();
        let head = String::from_utf8(file[..header].to_vec()).unwrap().replace('\n', end);
        let import =
            load(&write(&folder, "mixed.ply", [head.as_bytes(), &file[header..]].concat()));
        assert_eq!(points(&import.meshes[0]), points(&expected.meshes[0]), "{end:?}");
        // Binary data starts right behind the header's last line, also with a byte like a newline.
        for big in [false, true] {
            let file = ply_binary(big);
            let format = if big { "binary_big_endian" } else { "binary_little_endian" };
            let at = PLY_HEADER.replace("FORMAT", format).len();
            let head = String::from_utf8(file[..at].to_vec()).unwrap().replace('\n', end);
            let mut data = file[at..].to_vec();
            // The first number becomes 2⁻¹⁰⁷ or so, whose first byte is a newline's.
            data[..4].copy_from_slice(&[0x0a; 4]);
            let import = load(&write(&folder, "data.ply", [head.as_bytes(), &data].concat()));
            let first = points(&import.meshes[0])[0].x;
            assert_eq!(first, f64::from(f32::from_bits(0x0a0a_0a0a)), "{end:?}");
            assert_eq!(import.meshes[0].triangles.len(), 3, "{end:?}");
        }
    }
}

#[test]
fn ply_headers_of_real_programs_are_read() {
    let folder = folder();
    let text = String::from_utf8(ply_text()).unwrap();
    for changed in [
        // Blender 2.47 forgot the word `comment`.
        text.replace(
            "comment by hand",
            "Created by Blender3D 247 - www.blender.org, source file: ",
        ),
        format!("\u{feff}{text}"),
        text.replace("ply\n", "ply \n"),
        text.replace("property float", "property float32").replace("uchar int", "uint8 int32"),
        text.replace("element face", "obj_info num_cols 512\n\nelement face"),
    ] {
        let import = load(&write(&folder, "a.ply", &changed));
        assert_eq!(import.meshes[0].triangles.len(), 3, "{changed}");
    }
    let endless = format!("ply\nformat ascii 1.0\n{}", "x y\n".repeat(300_000));
    let message = error(&write(&folder, "c.ply", endless));
    assert!(message.contains("no end"), "{message}");
    let cr = text.replace('\n', "\r").replace("0.5", "o.5");
    let message = error(&write(&folder, "d.ply", cr));
    assert!(message.contains("line 16, column 1") && message.contains("o.5"), "{message}");
}

#[test]
fn numbers_that_are_none_are_counted_in_any_spelling() {
    let folder = folder();
    for word in ["nan", "1.#IND", "-1.#IND00", "1.#QNAN", "1.#INF", "-nan(ind)"] {
        let text =
            String::from_utf8(ply_text()).unwrap().replace("0 0 9 ", &format!("0 {word} 9 "));
        let import = load(&write(&folder, "a.ply", &text));
        assert_eq!(import.stats.dropped, 1, "{word}");
        let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 {word} 0\nf 1 2 3\nf 1 2 4\n");
        let import = load(&write(&folder, "a.obj", &obj));
        assert_eq!(import.stats.dropped, 1, "{word}");
    }
}
