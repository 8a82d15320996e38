//! Every asset of the shared test data has exactly the triangles and the box that an independent
//! reader found.

use std::path::Path;

use etendue_geometry::glam::{DVec2, DVec3};
use etendue_geometry::{Bounds, Geometry, Placement};
use etendue_scene::import::{Import, Options, Wanted, import};

use crate::test_data;

fn geometry(import: &Import) -> Geometry {
    let placement = |p: &etendue_scene::import::ImportedPlacement| Placement {
        mesh: p.mesh,
        object: 0,
        instance: 0,
        node: 0,
        material: p.material,
        world_from_mesh: p.model_from_mesh,
        motion: None,
    };
    Geometry {
        meshes: import.meshes.clone(),
        placements: import.placements.iter().map(placement).collect(),
    }
}

/// Triangles and the tight box in the model's frame.
fn measure(import: &Import) -> (u64, Bounds) {
    let geometry = geometry(import);
    (geometry.triangles(), geometry.bounds())
}

fn load(path: &Path) -> Import {
    import(path, Wanted::EVERYTHING, &Options::default())
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The box as the table prints it: numbers with up to five digits behind the point.
fn assert_box(path: &str, bounds: Bounds, printed: &str) {
    let numbers: Vec<&str> = printed.split_whitespace().collect();
    let has = [bounds.min.to_array(), bounds.max.to_array()].concat();
    for (has, printed) in has.iter().zip(numbers) {
        let value: f64 = printed.parse().unwrap();
        // Half of the last printed digit, and a little for the table's own rounding.
        assert!((has - value).abs() <= 0.51e-5, "{path}: {bounds:?} instead of {printed}");
    }
}

const GLTF: [(&str, u64, &str); 12] = [
    ("Avocado/Avocado.gltf", 682, "-0.02128 -0.00005 -0.01381 0.02128 0.06285 0.01381"),
    ("NormalTangentTest/NormalTangentTest.glb", 7_774, "-1.11 -1.2 -0.01 1.11 0.95 0.0805"),
    ("SimpleMeshes/SimpleMeshes.gltf", 2, "0 0 0 2 1 0"),
    ("Cameras/Cameras.gltf", 2, "0 0 -0.70759 1 0.70662 0"),
    ("SphereLights/sphere_lights.gltf", 224, "-1 -1 -1 1 1 1"),
    ("Mirror/one_face_123_mirror.gltf", 1, "-3 -0.10998 0 -1 -0.01 0"),
    // Without the nodes that it hides, 6 192 triangles of its 15 546.
    ("Sundial/Sundial.glb", 9_354, "-0.52666 0 -0.57288 0.52666 0.45618 0.42135"),
    ("WhackAMole/WhackAMole.glb", 85_698, "-0.5 0 -0.5 0.5 0.05966 0.5"),
    ("VertexCount32/01_vertex_count_32bit.gltf", 130_380, "-1 -1 -2.62654 1 1 2.8"),
    ("NodeHierarchy/02_node_hierarchy.gltf", 60, "-1 -1 -1 5 5 1"),
    ("SharedMesh/02_shared_mesh.gltf", 24, "-1 -1.41421 -1.41421 5 1.41421 1.41421"),
    ("koala.glb", 99_994, KOALA),
];

const KOALA: &str = "-1.89076 -1.43612 -4.22494 1.89066 3.93034 5.04552";

#[test]
fn gltf_assets_have_their_triangles_and_boxes() {
    let Some(folder) = test_data() else { return };
    for (path, triangles, printed) in GLTF {
        let import = load(&folder.join("gltf").join(path));
        let (has, bounds) = measure(&import);
        println!("{path}: {has} triangles, {:?}", import.stats);
        for note in &import.notes {
            println!("    {note:?}");
        }
        assert_eq!(has, triangles, "{path}");
        assert_box(path, bounds, printed);
    }
}

/// Tangents of a file run along growing u of its texture coordinates, and bitangents along falling v: the program that
/// wrote them is the reference, but at seams and where it averaged.
#[test]
fn tangents_run_along_texture_coordinates() {
    let Some(folder) = test_data() else { return };
    let import = load(&folder.join("gltf/Avocado/Avocado.gltf"));
    let (mut along, mut across, mut count) = (0, 0, 0);
    for mesh in &import.meshes {
        let tangents = mesh.tangents.as_ref().expect("the file has them");
        let normals = mesh.normals.as_ref().unwrap();
        for (number, triangle) in mesh.triangles.iter().enumerate() {
            let [p, q, r] = mesh.corners(number);
            let uv = triangle
                .map(|i| DVec2::from(mesh.uvs[tangents.set].get(i as usize).map(f64::from)));
            let (first, second) = (uv[1] - uv[0], uv[2] - uv[0]);
            let area = first.perp_dot(second);
            let along_u = ((q - p) * second.y - (r - p) * first.y) / area;
            let along_v = ((r - p) * first.x - (q - p) * second.x) / area;
            for corner in triangle.map(|i| i as usize) {
                let [x, y, z, side] = tangents.corners.get(corner).map(f64::from);
                let tangent = DVec3::new(x, y, z);
                let bitangent =
                    DVec3::from(normals.get(corner).map(f64::from)).cross(tangent) * side;
                // Within 37 degrees.
                along += usize::from(tangent.dot(along_u) > 0.8 * along_u.length());
                across += usize::from(-bitangent.dot(along_v) > 0.8 * along_v.length());
                count += 1;
            }
        }
    }
    println!("{along} and {across} of {count}");
    assert!(along * 10 > count * 9 && across * 10 > count * 9, "{along} {across} of {count}");
}

const OBJ: [(&str, u64); 14] = [
    ("koala.obj", 99_994),
    ("spot.obj", 23_062),
    ("tricky/cornell_box.obj", 36),
    ("tricky/missing_material_file.obj", 36),
    ("tricky/negative_indices.obj", 12),
    ("tricky/smoothing-group-two-squares.obj", 3),
    ("tricky/cube-vertexcol.obj", 12),
    ("tricky/mtl filename with whitespace issue46.obj", 12),
    ("tricky/usemtl-issue-68.obj", 400),
    ("tricky/map-bump.obj", 400),
    ("tricky/leading-decimal-dot-issue-201.obj", 1),
    ("tricky/polygonfaces.obj", 3),
    ("tricky/concave_polygon.obj", 64),
    ("tricky/box_without_lineending.obj", 12),
];

#[test]
fn obj_assets_have_their_triangles_and_boxes() {
    let Some(folder) = test_data() else { return };
    for (path, triangles) in OBJ {
        let import = load(&folder.join("obj").join(path));
        let (has, bounds) = measure(&import);
        println!("{path}: {has} triangles, {:?}", import.stats);
        for note in &import.notes {
            println!("    {note:?}");
        }
        assert_eq!(has, triangles, "{path}");
        match path {
            "koala.obj" => assert_box(path, bounds, KOALA),
            "spot.obj" => {
                assert_box(path, bounds, "-0.46343 -0.73023 -0.69957 0.46419 1.01738 1.0776");
            }
            _ => {}
        }
    }
}

/// Corners of all triangles in the model's frame, rounded to f32 as a GLB holds them.
fn corners(import: &Import) -> Vec<[f32; 3]> {
    let geometry = geometry(import);
    let of_placement = |placement: &Placement| {
        let mesh = geometry.mesh_of(placement);
        let point = |&corner: &u32| {
            let p = mesh.positions.get(corner as usize);
            placement.world_from_mesh.point(p).as_vec3().to_array()
        };
        mesh.triangles.iter().flatten().map(point).collect::<Vec<_>>()
    };
    geometry.placements.iter().flat_map(of_placement).collect()
}

#[test]
fn the_koala_is_the_same_as_obj_and_glb() {
    let Some(folder) = test_data() else { return };
    let (obj, glb) = (load(&folder.join("obj/koala.obj")), load(&folder.join("gltf/koala.glb")));
    assert_eq!(corners(&obj), corners(&glb));
    assert_eq!(glb.stats.bytes_copied, 0, "a plain GLB is used where it is mapped");
    assert_eq!(glb.stats.bytes_mapped, 1_799_916, "12 bytes a triangle and 12 a vertex");
}

#[test]
fn a_face_that_bends_back_on_itself_keeps_its_area() {
    let Some(folder) = test_data() else { return };
    let import = load(&folder.join("obj/tricky/concave_polygon.obj"));
    let (mut vector, mut total) = (etendue_geometry::glam::DVec3::ZERO, 0.0);
    for corners in corners(&import).chunks_exact(3) {
        let [a, b, c] =
            [0, 1, 2].map(|i| etendue_geometry::glam::Vec3::from(corners[i]).as_dvec3());
        let area = (b - a).cross(c - a) * 0.5;
        vector += area;
        total += area.length();
    }
    // By the shoelace formula over the 66 corners as the file has them; here they are in f32.
    let expected = 0.245_496_687;
    assert!((vector.length() - expected).abs() < 1e-6 * expected, "{vector}");
    // Where triangles overlapped or stuck out, the sum of areas would be more.
    assert!((total - expected).abs() < 1e-6 * expected, "{total}");
}

/// Triangles as sorted corner positions, sorted: the same for any order of meshes.
fn sorted(corners: &[[f32; 3]]) -> Vec<[[u32; 3]; 3]> {
    let mut triangles: Vec<[[u32; 3]; 3]> = corners
        .chunks_exact(3)
        .map(|triangle| [0, 1, 2].map(|i| triangle[i].map(|x| (x + 0.0).to_bits())))
        .collect();
    triangles.sort_unstable();
    triangles
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "the same rounding as ours")]
fn obj_meshes_are_those_that_tobj_reads() {
    let Some(folder) = test_data() else { return };
    // tobj fans concave faces and refuses normals that do not exist.
    let cannot = [
        "tricky/concave_polygon.obj",
        "tricky/polygonfaces.obj",
        "tricky/smoothing-group-two-squares.obj",
    ];
    for (path, _) in OBJ.iter().filter(|(path, _)| !cannot.contains(path)) {
        let path = folder.join("obj").join(path);
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let mut reader = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let none = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
        let (models, _) = tobj::load_obj_buf(&mut reader, &options, none).unwrap();
        let point = |mesh: &tobj::Mesh, i: u32| {
            [0, 1, 2].map(|axis| mesh.positions[3 * i as usize + axis] as f32)
        };
        let theirs: Vec<[f32; 3]> = models
            .iter()
            .flat_map(|model| model.mesh.indices.iter().map(|&i| point(&model.mesh, i)))
            .collect();
        assert_eq!(sorted(&corners(&load(&path))), sorted(&theirs), "{}", path.display());
    }
}
