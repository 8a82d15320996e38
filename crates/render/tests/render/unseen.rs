//! Parts that no chief ray can meet are left out of the structure, and the layers keep their bits.

use etendue_accel::BuildOptions;
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, build, build_without};
use etendue_report::DecisionKind;
use serde_json::{Value, json};

use crate::steps::{layer, load_json, trace};

/// Balls and blobs in all directions of a camera, near and far, so that many cross the sides of what it sees.
fn around(camera: &Value, accel: &str) -> Value {
    let mut state = 7_u64;
    let mut random = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let objects: Vec<Value> = (0..400)
        .map(|seed| {
            let [x, y, z] = std::array::from_fn(|_| 9.0 * random());
            json!({ "shape": "blob", "triangles": 100, "seed": seed, "radius": 0.15,
                "transform": { "translate": [x, y, z], "rotate": [1, 1, 0, 300.0 * random()],
                    "scale": [1.0, 0.3 + random().abs(), 1.0] } })
        })
        .collect();
    json!({ "camera": camera, "layers": ["depth", "distance", "normal", "position", "ids"],
        "objects": objects, "render": { "accel": accel } })
}

fn camera(kind: Value) -> Value {
    let mut camera = json!({ "sensor": { "resolution": [61, 47] },
        "pose": { "from": [0.3, 0.2, 0.4], "look_at": [2, 1, -1] } });
    camera.as_object_mut().unwrap().extend(kind.as_object().unwrap().clone());
    camera
}

#[test]
fn what_is_left_out_changes_no_bit_of_any_layer_of_any_camera() {
    let lens = json!({ "elements": [
        { "type": "surface", "radius": 51.68, "thickness": 6, "glass": { "n": 1.5168 }, "semi_diameter": 12 },
        { "type": "surface", "radius": -51.68, "semi_diameter": 12, "thickness": 1 },
        { "type": "aperture", "shape": "circular", "radius": 5, "stop": true }] });
    let cameras = [
        json!({ "type": "pinhole", "fov": 40 }),
        // The principal point far from the middle: all slopes to one side.
        json!({ "type": "pinhole", "intrinsics":
            { "fx": 30, "fy": 25, "cx": -5.0, "cy": 55.0, "skew": 1.0, "pixel_origin": "corner" } }),
        json!({ "type": "pinhole", "distortion": { "type": "brown_conrady", "k1": -0.2, "p1": 0.01 }, "intrinsics":
            { "fx": 50, "fy": 50, "cx": 30, "cy": 23, "pixel_origin": "corner" } }),
        json!({ "type": "orthographic", "height": 3 }),
        json!({ "type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": "3 m",
            "sensor_height": "24 mm" }),
        json!({ "type": "lens", "lens": lens, "focus_distance": "3 m", "sensor_height": "24 mm" }),
    ];
    for kind in cameras {
        let folder = tempfile::tempdir().unwrap();
        let scene = load_json(folder.path(), around(&camera(kind.clone()), "bvh"));
        let plan = Plan::new(&scene, Outputs::from_list("npy").unwrap());
        let unseen = plan.unseen.as_ref().unwrap_or_else(|| panic!("{kind}: all is seen"));
        // A camera whose view is narrow sees a few of the balls, and none of those behind it.
        let count = unseen.placements();
        assert!((200..400).contains(&count), "{kind}: {count} of 400 unseen");
        let row = plan.decisions.iter().find(|row| row.kind == DecisionKind::Geometry).unwrap();
        assert!(row.value.to_string().starts_with(&format!("{count} of 400")), "{row:?}");
        let images = Images::decode(&scene, &plan, None).unwrap();
        let options = BuildOptions::default();
        let whole = build(&scene, &plan, &options).unwrap();
        let part = build_without(unseen, &scene, &plan, &options).unwrap();
        assert!(part.report().bytes < whole.report().bytes);
        let [whole, part] = [whole, part].map(|accel| trace(&scene, &plan, &*accel, &images));
        let hits = layer(&whole.picture, "Depth").iter().filter(|z| z.is_finite()).count();
        assert!(hits > 100, "{kind}: {hits} pixels see something");
        let names = whole.picture.layers().iter().map(|layer| layer.name.clone());
        let names: Vec<String> = names.collect();
        assert!(names.len() >= 5, "{names:?}");
        for name in &names {
            let [whole, part] = [&whole, &part].map(|done| {
                layer(&done.picture, name).into_iter().map(f64::to_bits).collect::<Vec<_>>()
            });
            assert_eq!(whole, part, "{kind}: {name}");
        }
    }
}

/// The least that is in sight is built: balls that touch the sides of the view from without, and from within.
#[test]
fn a_ball_that_just_crosses_the_side_of_the_view_is_built() {
    // 45° to each side in columns: the outermost centres of 100 pixels lie at slopes of 0.99.
    let slope = 0.99_f64;
    let beside = |distance: f64| {
        // A box whose corner is so far (m) beyond the side, at a depth of 2 m and behind it.
        let edge = 2.0 * slope + distance;
        let scene = json!({
            "camera": { "type": "pinhole", "sensor": { "resolution": [100, 100] },
                "intrinsics": { "fx": 50, "fy": 50, "cx": 50, "cy": 50, "pixel_origin": "corner" },
                "pose": { "from": [0, 0, 0], "look_at": [0, 0, -1] } },
            "layers": ["depth"],
            "objects": [{ "shape": "box", "size": [1, 1, 1],
                "transform": { "translate": [edge + 0.5, 0, -1.5] } },
                { "shape": "sphere", "transform": { "translate": [0, 0, -4] } }],
        });
        let folder = tempfile::tempdir().unwrap();
        let scene = load_json(folder.path(), scene);
        Plan::new(&scene, Outputs::ALL).unseen.map_or(0, |unseen| unseen.placements())
    };
    // A micrometre within is within 1e-6 of the distance: kept for safety.
    assert_eq!(beside(-1e-3), 0);
    assert_eq!(beside(0.0), 0);
    assert_eq!(beside(1e-3), 1);
}

#[test]
fn all_is_built_where_more_than_chief_rays_are_traced() {
    let folder = tempfile::tempdir().unwrap();
    let of = |key: &str, value: Value| {
        let mut scene = around(&camera(json!({ "type": "pinhole", "fov": 40 })), "bvh");
        scene[key] = value;
        let scene = load_json(folder.path(), scene);
        Plan::new(&scene, Outputs::ALL).unseen.is_some()
    };
    assert!(of("layers", json!(["depth"])));
    // Light comes from everywhere, and samples of colours lie at the very sides of pixels.
    assert!(!of("tracer", json!({ "type": "path" })));
    assert!(of("tracer", json!({ "type": "flat" })));
    assert!(!of("plan", json!({ "unseen": true })));
    let mut scene = around(&camera(json!({ "type": "pinhole", "fov": 40 })), "bvh");
    scene["tracer"] = json!({ "type": "flat" });
    scene["render"] = json!({ "samples": 4 });
    assert!(Plan::new(&load_json(folder.path(), scene), Outputs::ALL).unseen.is_none());
    // A fisheye camera looks sideways and back.
    let mut scene = around(&camera(json!({ "type": "pinhole", "fov": 40 })), "bvh");
    scene["camera"] = camera(json!({ "type": "pinhole",
        "intrinsics": { "fx": 12, "fy": 12, "cx": 30, "cy": 23, "pixel_origin": "corner" },
        "distortion": { "type": "fisheye", "k1": 0.0 } }));
    assert!(Plan::new(&load_json(folder.path(), scene), Outputs::ALL).unseen.is_none());
}
