//! Pictures with a closed-form answer.

use etendue_accel::AccelName;

use crate::run::Bench;

/// A camera at `from` that looks at the origin, over a box of side 1.
fn box_seen_from(from: [f64; 3], up: [f64; 3]) -> Bench {
    Bench::with_scene(&format!(
        r#"{{"etendue": 1,
        "camera": {{"type": "pinhole", "fov": 20,
            "pose": {{"from": {from:?}, "look_at": [0, 0, 0], "up": {up:?}}},
            "sensor": {{"resolution": [8, 8]}}}},
        "layers": ["normal", {{"type": "normal", "space": "camera"}},
                   {{"type": "normal", "kind": "shading"}}, "depth"],
        "objects": [{{"shape": "box", "size": [1, 1, 1]}}]}}"#
    ))
}

#[test]
fn a_cube_from_six_sides_has_six_exact_normals() {
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut from = [0.0; 3];
            from[axis] = 3.0 * side;
            let up = if axis == 1 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
            let bench = box_seen_from(from, up);
            bench.render(&[]);
            let mut outward = [0.0; 3];
            outward[axis] = side;
            for name in ["normal", "normal_shading"] {
                for normal in bench.array(name).chunks(3) {
                    assert_eq!(normal, outward, "{name} from {from:?}");
                }
            }
            // The face that the camera looks at straight points along the camera's +Z.
            for normal in bench.array("normal_camera").chunks(3) {
                assert_eq!(normal, [0.0, 0.0, 1.0], "camera space from {from:?}");
            }
            for depth in bench.array("depth") {
                assert!((depth - 2.5).abs() < 1e-12, "the face is 2.5 m away, not {depth} m");
            }
        }
    }
}

#[test]
fn any_size_that_is_accepted_gives_the_same_ids() {
    let ids = |radius: &str, accel: &str| {
        let bench = Bench::with_scene(&format!(
            r#"{{"etendue": 1, "camera": {{"type": "pinhole", "sensor": {{"resolution": [40, 40]}}}},
            "layers": ["ids"],
            "objects": [{{"shape": "blob", "triangles": 5000, "radius": {radius}}}]}}"#
        ));
        bench.render(&["--accel", accel]);
        bench.array("id_primitive")
    };
    let expected = ids("1", "exact");
    for radius in ["6e-13", "1e-6", "1e6", "4e11"] {
        // The framed camera is placed by rounded numbers of another scale, so that a ray or two may
        // pass on the other side of an edge; nothing is lost by the dozen.
        let found = ids(radius, AccelName::best().name());
        let other = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
        assert!(other <= 4, "radius {radius}: {other} of {} differ", expected.len());
    }
}

/// The wall z = −1 m before a camera at `at`, moved with it.
fn wall(camera: &str, at: [f64; 3]) -> Bench {
    let [x, y, z] = at;
    let target = [x, y, z - 1.0];
    Bench::with_scene(&format!(
        r#"{{"etendue": 1,
        "camera": {{{camera},
            "pose": {{"from": {at:?}, "look_at": {target:?}, "up": [0, 1, 0]}},
            "sensor": {{"resolution": [33, 21]}}}},
        "layers": ["depth", "distance", "ids", "coverage"],
        "objects": [{{"shape": "rectangle", "width": 8, "height": 8,
            "transform": {{"translate": {target:?}}}}}]}}"#
    ))
}

#[test]
fn a_wall_at_one_metre_reads_one_metre_wherever_the_scene_is() {
    // 10⁷ m is held exactly by f64 (spacing 2⁻³⁰ m), so the camera's view does not change at all.
    for offset in [0.0, 1e4, 1e6, 1e7] {
        for camera in [r#""type": "pinhole", "fov": 50"#, r#""type": "orthographic", "height": 2"#]
        {
            let bench = wall(camera, [offset, -offset, offset]);
            bench.render(&[]);
            let (depth, distance) = (bench.array("depth"), bench.array("distance"));
            let scale = 21.0 / (2.0 * f64::to_radians(25.0).tan());
            for (i, (z, t)) in depth.iter().zip(&distance).enumerate() {
                let (x, y) = ((i % 33) as f64 - 16.0, (i / 33) as f64 - 10.0);
                let ray =
                    if camera.contains("pinhole") { x.hypot(y).hypot(scale) / scale } else { 1.0 };
                // f64 rounding of a handful of operations on numbers near 1.
                assert!((z - 1.0).abs() < 1e-12, "{camera} at {offset}: z = {z}");
                assert!((t - ray).abs() < 1e-12, "{camera} at {offset}: {t} for {ray}");
            }
            assert!(bench.array("coverage").iter().all(|a| *a == 1.0));
            assert!(bench.array("id_object").iter().all(|id| *id == 1.0));
            assert!(bench.array("id_primitive").iter().all(|id| *id > 0.0));
        }
    }
}

#[test]
fn the_top_row_is_up_and_the_first_column_left() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1,
        "camera": {"type": "pinhole", "fov": 40,
            "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0]},
            "sensor": {"resolution": [20, 20]}},
        "layers": ["position", {"type": "position", "space": "camera"}],
        "objects": [{"shape": "rectangle", "width": 9, "height": 9}]}"#,
    );
    bench.render(&[]);
    let position = bench.array("position");
    let (first, last) = (&position[..3], &position[position.len() - 3..]);
    assert!(first[0] < 0.0 && first[1] > 0.0, "the first pixel sees the upper left: {first:?}");
    assert!(last[0] > 0.0 && last[1] < 0.0, "the last pixel sees the lower right: {last:?}");
    let camera = bench.array("position_camera");
    assert!((camera[2] + 3.0).abs() < 1e-12, "the camera looks along −Z: {}", camera[2]);
}

const MANY: &str = r#"{"etendue": 1,
    "camera": {"type": "pinhole", "fov": 45,
        "pose": {"from": [2, 2, 4], "look_at": [0, 0, 0]}, "sensor": {"resolution": [150, 110]}},
    "tracer": {"type": "facing"}, "layers": ["depth", "normal", "position", "ids"],
    "objects": [
        {"shape": "blob", "triangles": 20000, "seed": 3, "material": "squares",
         "transform": {"translate": [-1, 0, 0]}},
        {"shape": "blob", "triangles": 20000, "seed": 3,
         "transform": {"translate": [1, 0.2, 0], "rotate": [0, 1, 0, 40], "scale": [1, -1, 1]}},
        {"shape": "rectangle", "width": 20, "height": 20,
         "transform": {"translate": [0, -1, 0], "rotate": [1, 0, 0, -90]}}],
    "materials": {"squares": {"type": "checker"}},
    "render": {"samples": 5, "seed": 11}}"#;

#[test]
fn a_picture_is_the_same_to_the_bit_for_any_thread_count() {
    let bench = Bench::with_scene(MANY);
    // The two best.
    for accel in AccelName::built().map(AccelName::name).take(2) {
        let mut hashes = Vec::new();
        for threads in ["1", "2", "7"] {
            bench.render(&["--threads", threads, "--accel", accel, "--report", "report.json"]);
            let report = bench.json("report.json");
            assert_eq!(report["threads"].to_string(), threads);
            hashes.push(report["image_hash"].clone());
        }
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{accel}: {hashes:?}");
    }
    bench.render(&["--seed", "12", "--report", "report.json"]);
    let other = bench.json("report.json")["image_hash"].clone();
    bench.render(&["--seed", "11", "--report", "report.json"]);
    assert_ne!(other, bench.json("report.json")["image_hash"], "another seed, other samples");
}

#[test]
fn all_accelerators_see_the_same_scene() {
    let bench = Bench::with_scene(MANY);
    let mut seen = Vec::new();
    // The reference first.
    for accel in AccelName::built().rev().map(AccelName::name) {
        bench.render(&["--accel", accel, "--outputs", "npy"]);
        let (objects, triangles) = (bench.array("id_object"), bench.array("id_primitive"));
        let ids: Vec<f64> = objects.into_iter().zip(triangles).flat_map(|(a, b)| [a, b]).collect();
        seen.push((ids, bench.array("depth")));
    }
    for (ids, depths) in &seen[1..] {
        // A handful of rays along silhouettes may be decided otherwise by single precision.
        let other = ids.chunks(2).zip(seen[0].0.chunks(2)).filter(|(a, b)| a != b).count();
        assert!(other <= 2, "{other} of 16500 pixels see another triangle");
        for ((z, reference), (a, b)) in
            depths.iter().zip(&seen[0].1).zip(ids.chunks(2).zip(seen[0].0.chunks(2)))
        {
            if a == b && reference.is_finite() {
                assert!((z - reference).abs() <= 1e-12 * reference, "{z} for {reference}");
            }
        }
    }
}

#[test]
fn an_instance_is_its_flattened_copy() {
    // Two placements of one mesh are instanced; the same two as different meshes are baked.
    let scene = |second: &str| {
        format!(
            r#"{{"etendue": 1,
            "camera": {{"type": "pinhole", "fov": 45, "pose": {{"from": [1, 2, 5],
                "look_at": [0, 0, 0]}}, "sensor": {{"resolution": [80, 60]}}}},
            "layers": ["depth", "normal"],
            "objects": [{{"file": "a.obj", "transform": {{"translate": [-1, 0, 0]}}}},
                {{"file": "{second}", "transform": {{"translate": [1, 0.2, 0.1],
                  "rotate": [1, 2, 3, 70], "scale": [-1, 1.5, 0.7]}}}}]}}"#
        )
    };
    let mesh = b"v -1 -1 -1\nv 1 -1 -1\nv 0 1 -0.3\nv 0.1 0 1\n\
                 f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    let mut seen = Vec::new();
    for second in ["a.obj", "b.obj"] {
        let bench = Bench::with_scene(&scene(second));
        bench.write("a.obj", mesh);
        bench.write("b.obj", mesh);
        bench.render(&["--report", "report.json"]);
        let unique = bench.json("report.json")["triangles_unique"].clone();
        assert_eq!(unique, if second == "a.obj" { 4 } else { 8 });
        seen.push((bench.array("depth"), bench.array("normal")));
    }
    // Both are solved in f64 from the same local corners, so they are the same to the bit.
    assert_eq!(seen[0], seen[1]);
}

#[test]
fn every_file_of_the_table_is_written_and_no_part_is_left() {
    let bench = box_seen_from([1.0, 2.0, 3.0], [0.0, 1.0, 0.0]);
    bench.render(&["--set", "tracer.type=facing"]);
    let mut names: Vec<String> = std::fs::read_dir(bench.path("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "camera.json",
            "depth.npy",
            "depth.preview.png",
            "etendue-manifest.json",
            "layers.exr",
            "layers.json",
            "normal.npy",
            "normal.preview.png",
            "normal_camera.npy",
            "normal_camera.preview.png",
            "normal_shading.npy",
            "normal_shading.preview.png",
            "picture.npy",
            "picture.png",
        ]
    );
    let camera = bench.json("out/camera.json");
    assert!(camera["K"].is_array() && camera["camera_from_world"].is_array(), "{camera}");
}

/// A room with a lamp under its ceiling, by global illumination: mean of the picture, and rays.
fn room(mode: &str) -> (f64, f64) {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "tracer": {"type": "path", "max_bounces": 6}, "render": {"samples": 64},
        "camera": {"type": "pinhole", "fov": 60, "sensor": {"resolution": [16, 16]},
                   "pose": {"from": [0, 0, 0.9], "look_at": [0, 0, 0]}},
        "objects": [{"shape": "box", "size": [2, 2, 2], "material": "m"},
            {"shape": "rectangle", "width": 0.8, "height": 0.8, "material": "lamp",
             "transform": {"translate": [0, 0.8, 0], "rotate": [1, 0, 0, 90]}}],
        "materials": {"m": {"type": "matte", "color": [0.7, 0.7, 0.7]},
            "lamp": {"type": "emissive", "radiance": [5, 5, 5]}}}"#,
    );
    bench.render(&["--report", "report.json", "--accel-mode", mode]);
    let picture = bench.array("picture");
    let rays = bench.json("report.json")["rays"].as_f64().expect("a number");
    (picture.iter().sum::<f64>() / picture.len() as f64, rays)
}

/// Rays that leave a surface meet it again in neither mode.
#[test]
fn the_fast_mode_traces_as_many_rays_to_the_same_light() {
    let (robust, fast) = (room("robust"), room("fast"));
    // The paths are the same but where single precision passes an edge: one in a hundred at most.
    assert!((fast.1 / robust.1 - 1.0).abs() < 0.01, "{robust:?} {fast:?}");
    assert!((fast.0 / robust.0 - 1.0).abs() < 0.02, "{robust:?} {fast:?}");
}
