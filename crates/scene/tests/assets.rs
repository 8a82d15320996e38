//! Every asset of the shared test data has exactly the triangles and the box that an independent
//! reader found.

use std::path::{Path, PathBuf};

use etendue_geometry::{Bounds, Geometry, Placement};
use etendue_scene::import::{Import, Options, Wanted, import};

/// The folder of test data; says so and gives `None` when there is none.
fn assets() -> Option<PathBuf> {
    let folder = match std::env::var_os("ETENDUE_ASSETS") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
    };
    let folder = folder.join("data");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: no test data in {}; set ETENDUE_ASSETS", folder.display());
    None
}

fn geometry(import: &Import) -> Geometry {
    let placement = |p: &etendue_scene::import::ImportedPlacement| Placement {
        mesh: p.mesh,
        object: 0,
        material: p.material,
        world_from_mesh: p.model_from_mesh,
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
    ("Sundial/Sundial.glb", 15_546, "-0.55 -0.08854 -0.57288 0.55 0.45618 0.55"),
    ("WhackAMole/WhackAMole.glb", 85_698, "-0.5 0 -0.5 0.5 0.05966 0.5"),
    ("VertexCount32/01_vertex_count_32bit.gltf", 130_380, "-1 -1 -2.62654 1 1 2.8"),
    ("NodeHierarchy/02_node_hierarchy.gltf", 60, "-1 -1 -1 5 5 1"),
    ("SharedMesh/02_shared_mesh.gltf", 24, "-1 -1.41421 -1.41421 5 1.41421 1.41421"),
    ("koala.glb", 99_994, KOALA),
];

const KOALA: &str = "-1.89076 -1.43612 -4.22494 1.89066 3.93034 5.04552";

#[test]
fn gltf_assets_have_their_triangles_and_boxes() {
    let Some(folder) = assets() else { return };
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
