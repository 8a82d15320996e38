//! OBJ and its materials.

use etendue_geometry::glam::DVec3;
use etendue_scene::import::NoteKind;
use etendue_tracer::material::Alpha;
use etendue_tracer::{Glass, Ior, Material, Paint, Scattering};

use super::{error, folder, import_strict, load, points, write};

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
    let Paint::Image { factor, image, .. } = &import.materials[1].base_color else {
        panic!("image")
    };
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
    assert!(load(&write(&folder, "blank.obj", "#\n")).meshes[0].triangles.is_empty());
    assert!(error(&write(&folder, "empty.obj", "")).contains("it is empty"));
}

/// Each rule of `docs/reference/models.md`: glass, mirrors, a coat over a matte base, thin surfaces, lamps.
#[test]
fn text_of_another_format_is_refused_as_such() {
    let folder = folder();
    let mni = "P 0.3 0.3 0.4 10 1 3\n 0 0 0\n 1 0 0\n 0 1 0\n\n 0 0 1\n 0 0 1\n 0 0 1\n\n 1\n 0 1 1 1 1\n\n 3\n\n 0 1 2\n";
    let stl = "# exported\n\n  solid cube\nfacet normal 0 0 1\n";
    for (text, words) in [
        (mni, ["line 1, column 1", "Wavefront", "the MNI's tools"]),
        (stl, ["line 3, column 3", "Wavefront", "another format"]),
    ] {
        let message = error(&write(&folder, "brain.obj", text));
        for word in [&["brain.obj"], &words[..]].concat() {
            assert!(message.contains(word), "{message}");
        }
    }
    // What has one line of OBJ, or comments alone, is one.
    for text in ["# nothing\n", "\n", "hello\nv 0 0 0\n", "s off\n"] {
        let import = load(&write(&folder, "odd.obj", text));
        assert!(import.meshes.iter().all(|mesh| mesh.triangles.is_empty()), "{text:?}");
    }
}

#[test]
fn mtl_materials_become_the_nearest_of_ours() {
    let folder = folder();
    write(
        &folder,
        "m.mtl",
        "newmtl matte\nKd 0.5 0.25 1\n\
        newmtl glass\nKd 0.1 0.1 0.1\nNi 1.7\nillum 7\n\
        newmtl thin\nKd 1 1 1\nNi 0.3\nillum 4\nd 0.2\n\
        newmtl metal\nKd 0 0 0\nKs 0.9 0.6 0.3\nNs 30\nillum 3\n\
        newmtl glazed\nKd 0.5 0.5 0.5\nKs 0.2 0.1 0\nNs 6\nd 0.25\n\
        newmtl lamp\nKd 0 0 0\nKe 5 4 3\n\
        newmtl old\nKa 20 10 5\nKd 1 1 1\n\
        newmtl dim\nKa 1 1 1\nKd 1 1 1\n\
        newmtl bad\nKd 1 1 1\nKe -1 0 0\n\
        newmtl veil\nKd 1 1 1\nTr 0.75\nmap_d veil.png\nmap_Ke veil.png\n",
    );
    let names = ["matte", "glass", "thin", "metal", "glazed", "lamp", "old", "dim", "bad", "veil"];
    let mut text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    for name in names {
        text += &format!("usemtl {name}\nf 1 2 3\n");
    }
    let import = load(&write(&folder, "m.obj", &text));
    let of = |name: &str| {
        let found = import.materials.iter().find(|m| m.name == name);
        found.unwrap_or_else(|| panic!("{name}: {:?}", import.materials))
    };
    assert_eq!(of("matte").scattering, Scattering::Matte);
    assert_eq!(of("matte").base_color, Paint::Plain([0.5, 0.25, 1.0]));
    assert_eq!(of("glass").scattering, Scattering::Dielectric(Glass::clear(Ior::Constant(1.7))));
    assert_eq!(of("glass").base_color, Paint::Plain([1.0; 3]), "glass lets all through");
    assert_eq!(of("thin").scattering, Scattering::Dielectric(Glass::clear(Ior::Constant(1.0))));
    assert_eq!(of("thin").alpha, Alpha::Opaque, "glass is there as a whole");
    // α² = 2 / (Ns + 2) and α is the square of the roughness.
    let roughness = |material: &Material| match &material.scattering {
        Scattering::Metal { roughness, .. } => *roughness,
        Scattering::Gltf(surface) => surface.roughness,
        other => panic!("{other:?}"),
    };
    assert!((roughness(of("metal")) - 0.5).abs() < 1e-12);
    assert_eq!(of("metal").base_color, Paint::Plain([0.9, 0.6, 0.3]));
    let glazed = of("glazed");
    assert!((roughness(glazed) - 0.25_f64.powf(0.25)).abs() < 1e-12);
    let Scattering::Gltf(surface) = &glazed.scattering else { panic!("{glazed:?}") };
    // Times the reflectance of glass face on, 0.04, that is Ks.
    let face_on = surface.specular_color.map(|c| c * 0.04);
    assert!(face_on.iter().zip([0.2, 0.1, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12));
    assert_eq!((surface.metallic, glazed.alpha), (0.0, Alpha::Blend { factor: 0.25 }));
    for (name, radiance) in [("lamp", [5.0, 4.0, 3.0]), ("old", [20.0, 10.0, 5.0])] {
        let emission = of(name).emission.as_ref().expect("it shines");
        assert_eq!((&emission.radiance, emission.two_sided), (&Paint::Plain(radiance), true));
    }
    assert_eq!(of("veil").alpha, Alpha::Blend { factor: 0.25 });
    let noted = |subject: &str, words: &str| {
        import.notes.iter().any(|note| note.subject == subject && note.message.contains(words))
    };
    assert!(noted("bad", "Ke is below zero") && noted("thin", "Ni is below 1"));
    assert!(noted("map_d", "not supported") && noted("map_Ke", "not supported"));
    let message = import_strict(&folder.path().join("m.obj")).unwrap_err().to_string();
    assert!(message.contains("m.mtl") && message.contains("material \"thin\""), "{message}");
    assert!(["matte", "glazed", "dim", "bad"].iter().all(|name| of(name).emission.is_none()));
}

#[test]
fn obj_lines_may_end_with_carriage_returns_alone() {
    let folder = folder();
    let text = "mtllib m.mtl\rv 0 0 0\rv 1 0 0\rv 0 1 0\rusemtl a\rf 1 2 3\r";
    write(&folder, "m.mtl", "\u{feff}newmtl a\rKd 1 0 0\r");
    let import = load(&write(&folder, "a.obj", text));
    assert_eq!(import.meshes[0].triangles.len(), 1);
    assert_eq!(import.materials[0].name, "a");
    assert!(import.notes.is_empty(), "{:?}", import.notes);
    let message = error(&write(&folder, "b.obj", text.replace("v 0 1 0", "v 0 x 0")));
    assert!(message.contains("line 4, column 5"), "{message}");
}

/// A room 2 m high with a lamp of 1 m at a height: on which sides it shines.
#[test]
fn flat_lamps_under_a_ceiling_shine_into_the_room_alone() {
    let folder = folder();
    write(&folder, "m.mtl", "newmtl white\nKd 1 1 1\nnewmtl lamp\nKd 1 1 1\nKe 9 9 9\n");
    let room = "mtllib m.mtl\nusemtl white\n\
        v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nf 4 3 2 1\nv 0 2 0\nv 2 2 0\nv 2 2 2\nv 0 2 2\nf 5 6 7 8\n";
    let lamp = |height: f64, face: &str| {
        format!(
            "usemtl lamp\nv 0.5 {height} 0.5\nv 1.5 {height} 0.5\nv 1.5 {height} 1.5\n\
             v 0.5 {height} 1.5\n{face}\n"
        )
    };
    let (down, up) = ("f -4 -3 -2 -1", "f -1 -2 -3 -4");
    let both_sides = |text: &str| {
        let import = load(&write(&folder, "a.obj", text));
        let lamp = import.materials.iter().find(|material| material.name == "lamp");
        lamp.and_then(|lamp| lamp.emission.as_ref()).expect("a lamp").two_sided
    };
    assert!(!both_sides(&format!("{room}{}", lamp(1.99, down))), "under the ceiling");
    assert!(!both_sides(&format!("{room}{}", lamp(0.01, up))), "in the floor");
    assert!(
        both_sides(&format!("{room}{}", lamp(1.99, up))),
        "else it would light the ceiling alone"
    );
    assert!(both_sides(&format!("{room}{}", lamp(1.5, down))), "half a metre of room behind it");
    let bent = "v 1 1.9 1\nf -1 -2 -3";
    assert!(both_sides(&format!("{room}{}{bent}", lamp(1.99, down))), "not flat");
    assert!(both_sides(&format!("mtllib m.mtl\n{}", lamp(1.99, down))), "a lamp alone");
}
