//! OBJ and its materials.

use etendue_geometry::glam::DVec3;
use etendue_scene::import::NoteKind;
use etendue_tracer::Paint;

use crate::{error, folder, import_strict, load, points, write};

#[test]
fn obj_groups_materials_and_attributes() {
    let folder = folder();
    write(
        &folder,
        "paint.mtl",
        "newmtl red\nKd 1 0 0\nKd_odd\n\nnewmtl photo\nKd 0.5\nmap_Kd -s 2 1 pic ture.png\n",
    );
    write(&folder, "pic ture.png", "pixels");
    let text = "\
        mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.25\nvt 1 0.25\nvn 0 0 1\n\
        usemtl red\nf 1 2 3 # a comment\ng side\nusemtl photo\nf 1/1/1 2/2/1 \\\n 3/1/1\n\
        usemtl nobody\nf -4 -3 -2\nusemtl photo\nf 4/1/1 3/2/1 1/1/1\nl 1 2\nf 1 2\n";
    let import = load(&write(&folder, "a.obj", text));
    let summary: Vec<_> = import
        .placements
        .iter()
        .map(|p| {
            let mesh = &import.meshes[p.mesh as usize];
            let material = &import.materials[p.material as usize];
            (p.name.as_str(), material.name.as_str(), mesh.triangles.len(), mesh.uvs.len())
        })
        .collect();
    assert_eq!(summary, [("", "red", 1, 0), ("side", "photo", 2, 1), ("side", "nobody", 1, 0)]);
    assert_eq!(import.materials[0].base_color, Paint::Plain([1.0, 0.0, 0.0]));
    let Paint::Image { factor, image } = &import.materials[1].base_color else { panic!("image") };
    assert_eq!((*factor, image.transform), ([0.5; 3], [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    let side = &import.meshes[1];
    assert_eq!(side.uvs[0].get(1), [1.0, 0.75], "v runs down");
    assert_eq!(side.normals.as_ref().unwrap().get(0), [0.0, 0.0, 1.0]);
    assert_eq!(
        points(&import.meshes[2]),
        [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]].map(DVec3::from)
    );
    let noted = |kind: NoteKind| import.notes.iter().filter(|note| note.kind == kind).count();
    assert_eq!(
        (noted(NoteKind::Irregular), noted(NoteKind::Unsupported)),
        (2, 1),
        "{:?}",
        import.notes
    );
}

#[test]
fn obj_far_from_the_origin_keeps_its_digits() {
    let folder = folder();
    let text = "v 1000000.1 0 0\nv 1000001.1 0 0\nv 1000000.1 1.3 0\nf 1 2 3\n";
    let import = load(&write(&folder, "far.obj", text));
    assert_eq!(points(&import.meshes[0])[1].x, 1_000_001.1);
}

#[test]
fn broken_obj_is_refused_with_its_line() {
    let folder = folder();
    for (text, words) in [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n", ["line 5, column 7", "\"4\"", "3 vertices"]),
        ("v 0 0 0\nf 1 -2 1\nv 0 1 0\n", ["line 2, column 5", "\"-2\"", "1 vertices"]),
        ("v 0 0 0\nv 1 0\n", ["line 2", "3 numbers", "v 1 0"]),
        ("v 0 x 0\n", ["line 1, column 5", "\"x\"", "not a number"]),
        ("v 0 0 0\nf 1 1 0\n", ["line 2", "\"0\"", "count from 1"]),
        ("f 99999999999 1 1\n", ["line 1", "99999999999", "vert"]),
    ] {
        let message = error(&write(&folder, "bad.obj", text));
        for word in words {
            assert!(message.contains(word), "{text:?}: {message}");
        }
    }
    let path = write(&folder, "uv.obj", "v 0 0 0\nf 1/1 1/1 1/1\n");
    let import = load(&path);
    assert!(import.meshes[0].uvs.is_empty());
    assert_eq!(import.notes[0].count, 3, "{:?}", import.notes);
    let message = import_strict(&path).unwrap_err().to_string();
    assert!(message.contains("line 2, column 3") && message.contains("0 texture"), "{message}");
    assert!(load(&write(&folder, "empty.obj", "")).meshes[0].triangles.is_empty());
}
