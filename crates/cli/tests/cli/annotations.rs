//! Sets that tell the copies of objects apart: COCO's and BOP's sets and Cryptomatte, against
//! closed forms and by others' readers.

use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

use crate::emva::environment;
use crate::run::{Bench, text};

/// A plate of 2 m by 1.2 m whose front is 4.95 m away, and a high one nearer before the right half of it, which the
/// picture's edges cut; a turned and stretched box stands beside them, below the picture for the most part.
fn scene() -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "pinhole",
            "intrinsics": { "fx": 100, "fy": 100, "cx": 32, "cy": 24, "pixel_origin": "corner" },
            "pose": { "from": [0, 0, 0], "look_at": [0, 0, -1] },
            "sensor": { "resolution": [64, 48] }
        },
        "tracer": { "type": "facing" }, "layers": ["depth", "ids"], "render": { "samples": 1, "accel": "bvh" },
        "objects": [
            { "name": "back", "shape": "box", "size": [2, 1.2, 0.1], "transform": { "translate": [0, 0, -5] },
              "material": "red" },
            { "name": "front", "shape": "box", "size": [0.8, 4, 0.1], "transform": { "translate": [0.6, 0, -3] },
              "material": "green" },
            { "name": "turned", "shape": "box", "size": [0.5, 0.25, 0.125], "material": "red",
              "transform": { "translate": [-0.9, -0.8, -4], "rotate": [1, 2, 3, 50], "scale": [1, 2, 3] } }
        ],
        "materials": {
            "red": { "type": "matte", "color": [0.8, 0.1, 0.1] },
            "green": { "type": "matte", "color": [0.1, 0.8, 0.1] }
        }
    })
}

fn rendered(scene: &Value, outputs: &str) -> Bench {
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--outputs", outputs]);
    bench
}

/// The numbers of a grey PNG.
fn grey(path: &Path) -> Vec<u16> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(info.color_type, png::ColorType::Grayscale);
    match info.bit_depth {
        png::BitDepth::Sixteen => {
            bytes.as_chunks().0.iter().map(|&b| u16::from_be_bytes(b)).collect()
        }
        _ => bytes.into_iter().map(u16::from).collect(),
    }
}

fn by_name<'a>(list: &'a Value, name: &str) -> &'a Value {
    let entry = list.as_array().unwrap().iter().find(|entry| entry["name"] == name);
    entry.unwrap_or_else(|| panic!("no {name} in {list}"))
}

#[test]
fn coco_has_what_is_seen_of_each_object() {
    let bench = rendered(&scene(), "png,coco");
    let coco = bench.json("out/coco.json");
    assert_eq!(coco["images"][0]["file_name"], "picture.png");
    assert!(bench.path("out/picture.png").exists());
    let annotation = |name: &str| {
        let id = &by_name(&coco["categories"], name)["id"];
        let all = coco["annotations"].as_array().unwrap();
        all.iter().find(|annotation| annotation["category_id"] == *id).unwrap().clone()
    };
    // 100 px · 1 m / 4.95 m = 20.2 px from the axis on both sides, of which pixels 12 to 51 have their centres inside, and
    // 12.1 px above and below: rows 12 to 35. The nearer plate covers pixels from 39 on.
    let back = annotation("back");
    assert_eq!((&back["bbox"], &back["area"]), (&json!([12, 12, 27, 24]), &json!(27 * 24)));
    let front = annotation("front");
    assert_eq!((&front["bbox"], &front["area"]), (&json!([39, 0, 25, 48]), &json!(25 * 48)));
    assert!(!bench.path("out/bop").exists(), "nobody asked for it");
}

#[test]
fn bop_has_whole_silhouettes_depth_and_poses() {
    let bench = rendered(&scene(), "npy,png,bop");
    let truth = &bench.json("out/bop/train/000000/scene_gt.json")["0"];
    let info = &bench.json("out/bop/train/000000/scene_gt_info.json")["0"];
    let camera = &bench.json("out/bop/train/000000/scene_camera.json")["0"];
    // From the centre of the top left pixel.
    assert_eq!(camera["cam_K"], json!([100.0, 0.0, 31.5, 0.0, 100.0, 23.5, 0.0, 0.0, 1.0]));
    assert_eq!(camera["depth_scale"], json!(0.1));
    // Behind the nearer plate the farther one goes on to pixel 51.
    let back = &info[0];
    assert_eq!((&back["px_count_all"], &back["px_count_visib"]), (&json!(960), &json!(648)));
    assert_eq!(
        (&back["bbox_obj"], &back["bbox_visib"]),
        (&json!([12, 12, 39, 23]), &json!([12, 12, 26, 23]))
    );
    assert_eq!(back["visib_fract"], json!(648.0 / 960.0));
    // Its front reaches 33.9 px to the right of the axis and 67.8 up and down, past the picture's edges; its left side
    // begins at 100 · 0.2 / 3.05 = 6.56 px.
    let front = &info[1];
    assert_eq!(
        (&front["px_count_all"], &front["px_count_valid"]),
        (&json!(27 * 136), &json!(1200))
    );
    assert_eq!(front["bbox_obj"], json!([39, -44, 26, 135]));
    assert_eq!(truth[0]["cam_t_m2c"].as_array().unwrap().len(), 3);
    // Depth in steps of 0.1 mm is what the layer says.
    let steps = grey(&bench.path("out/bop/train/000000/depth/000000.png"));
    let layer = bench.array("depth");
    for (step, depth) in steps.iter().zip(layer) {
        let off = if depth.is_finite() {
            (f64::from(*step) - depth * 1e4).abs()
        } else {
            f64::from(*step)
        };
        // Half a step, and the rounding of a number near 5e4.
        assert!(off <= 0.5 + 1e-9, "{step} {depth}");
    }
    // Masks are the same pixels.
    let count = |path: &str| {
        let mask = grey(&bench.path(&format!("out/bop/train/000000/{path}")));
        mask.iter().filter(|value| **value == 255).count()
    };
    assert_eq!(
        [count("mask/000000_000000.png"), count("mask_visib/000000_000000.png")],
        [960, 648]
    );
}

/// A rotation by rows, times a point, and a translation.
fn carried(pose: &Value, point: [f64; 3]) -> [f64; 3] {
    let number = |key: &str, k: usize| pose[key][k].as_f64().unwrap();
    std::array::from_fn(|row| {
        let turned: f64 = (0..3).map(|k| number("cam_R_m2c", 3 * row + k) * point[k]).sum();
        turned + number("cam_t_m2c", row)
    })
}

/// The corners of a PLY file of `models`, as the writer lays it out.
fn corners(path: &Path) -> Vec<[f64; 3]> {
    let bytes = std::fs::read(path).unwrap();
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    let header = text(&bytes[..start]);
    let count = header.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap();
    let count: usize = count.parse().unwrap();
    let floats = bytes[start..start + 24 * count].as_chunks::<4>().0;
    let float = |i: usize| f64::from(f32::from_le_bytes(floats[i]));
    (0..count).map(|i| [6 * i, 6 * i + 1, 6 * i + 2].map(float)).collect()
}

#[test]
fn poses_carry_models_to_where_the_objects_are() {
    let bench = rendered(&scene(), "png,bop");
    let truth = &bench.json("out/bop/train/000000/scene_gt.json")["0"];
    let turned = &truth[2];
    let number = turned["obj_id"].as_u64().unwrap();
    let model = corners(&bench.path(&format!("out/bop/models/obj_{number:06}.ply")));
    // Rodrigues' formula, and OpenCV's axes of a camera that looks along -z.
    let (axis, angle) = ([1.0, 2.0, 3.0].map(|x: f64| x / 14_f64.sqrt()), 50_f64.to_radians());
    let placed = |corner: [f64; 3]| {
        let along: f64 = (0..3).map(|k| axis[k] * corner[k]).sum();
        let cross = [
            axis[1] * corner[2] - axis[2] * corner[1],
            axis[2] * corner[0] - axis[0] * corner[2],
            axis[0] * corner[1] - axis[1] * corner[0],
        ];
        let (sin, cos) = angle.sin_cos();
        let at = [-0.9, -0.8, -4.0];
        let [x, y, z] = std::array::from_fn(|k| {
            cos * corner[k] + sin * cross[k] + (1.0 - cos) * along * axis[k] + at[k]
        });
        [1e3 * x, -1e3 * y, -1e3 * z]
    };
    let mut expected: Vec<[f64; 3]> = Vec::new();
    for signs in 0..8_u32 {
        let sign = |k: u32| if signs >> k & 1 == 0 { -0.5 } else { 0.5 };
        expected.push(placed([0.5 * sign(0), 0.5 * sign(1), 0.375 * sign(2)]));
    }
    for corner in model {
        let found = carried(turned, corner);
        let off = expected
            .iter()
            .map(|expected| (0..3).map(|k| (found[k] - expected[k]).abs()).fold(0.0, f64::max));
        // Half a millimetre's f32 step of models, 3e-5 mm, and more.
        let off = off.fold(f64::INFINITY, f64::min);
        assert!(off < 1e-4, "{found:?} is {off} mm from every corner of the box");
    }
    let info = &bench.json("out/bop/models/models_info.json")[number.to_string()];
    let diameter = 1e3 * (0.25 + 0.25 + 0.375_f64.powi(2)).sqrt();
    assert!((info["diameter"].as_f64().unwrap() - diameter).abs() < 1e-3, "{info}");
    assert!((info["size_x"].as_f64().unwrap() - 500.0).abs() < 1e-6, "{info}");
}

#[test]
fn copies_of_one_shape_are_one_model_and_frames_one_set() {
    let mut scene = scene();
    scene["objects"] = json!([{
        "name": "brick", "shape": "box", "size": [0.4, 0.2, 0.1],
        "instances": [
            { "translate": [-0.5, 0, -4] },
            { "translate": [0.5, 0, -4], "rotate": [0, 0, 1, 30] },
            { "translate": [0, 0.5, -4], "scale": 2 }
        ]
    }]);
    scene["frames"] = json!([
        { "camera.pose": { "from": [0, 0, 0], "look_at": [0, 0, -1] } },
        { "camera.pose": { "from": [0.1, 0, 0], "look_at": [0.1, 0, -1] } }
    ]);
    let bench = Bench::with_scene(&scene.to_string());
    let output =
        bench.run(&["render", "scene.json", "-o", "out", "--quiet", "--outputs", "png,coco,bop"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let truth = bench.json("out/bop/train/000000/scene_gt.json");
    for frame in ["0", "1"] {
        let numbers: Vec<_> =
            truth[frame].as_array().unwrap().iter().map(|one| one["obj_id"].clone()).collect();
        assert_eq!(numbers, [json!(1), json!(1), json!(2)], "of two sizes there are two models");
    }
    let shift = |frame: &str| truth[frame][0]["cam_t_m2c"][0].as_f64().unwrap();
    // Roundings of 600 mm.
    assert!((shift("0") - shift("1") - 100.0).abs() < 1e-9);
    for file in ["rgb/000001.png", "depth/000001.png", "mask/000001_000002.png"] {
        assert!(bench.path(&format!("out/bop/train/000000/{file}")).exists(), "{file}");
    }
    let coco = bench.json("out/coco.json");
    assert_eq!(coco["images"][1]["file_name"], "frames/000001/picture.png");
    assert_eq!(coco["annotations"].as_array().unwrap().len(), 6);
    assert_eq!(coco["categories"].as_array().unwrap().len(), 1);
    // What is complete serves again, and a render without sets takes them away.
    let again = ["render", "scene.json", "-o", "out", "--resume", "--outputs", "png,coco,bop"];
    insta::assert_snapshot!(bench.said(&bench.run(&again)), @"
    note: green: no object uses this material
    note: red: no object uses this material
    2 of 2 frames were complete and are left as they are
    ");
    assert_eq!(bench.json("out/coco.json"), coco);
    let output = bench.run(&["render", "scene.json", "-o", "out", "--quiet", "--outputs", "png"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(!bench.path("out/coco.json").exists() && !bench.path("out/bop").exists());
}

#[test]
fn sets_that_cannot_be_are_refused_before_the_render() {
    let refused = |change: &dyn Fn(&mut Value), outputs: &str| {
        let mut scene = scene();
        change(&mut scene);
        let bench = Bench::with_scene(&scene.to_string());
        let said = bench.refusal(&["render", "scene.json", "-o", "out", "--outputs", outputs]);
        assert!(!bench.path("out").exists());
        said
    };
    let orthographic = |scene: &mut Value| {
        scene["camera"] = json!({ "type": "orthographic", "height": 2 });
    };
    insta::assert_snapshot!(refused(&orthographic, "png,bop"), @"
    error: outputs: `bop` has cameras that K alone describes
    hint: take a `pinhole` without `distortion` (`etendue plan --models` prints that of a lens), or leave `bop` out
    ");
    let distorted = |scene: &mut Value| {
        scene["camera"]["distortion"] = json!({ "type": "brown_conrady", "k1": -0.1 });
    };
    insta::assert_snapshot!(refused(&distorted, "png,bop"), @"
    error: outputs: `bop` has cameras that K alone describes
    hint: take a `pinhole` without `distortion` (`etendue plan --models` prints that of a lens), or leave `bop` out
    ");
    insta::assert_snapshot!(refused(&|_| {}, "exr,coco"), @"
    error: outputs: `coco` annotates picture.png, which is not written
    hint: give the scene a `tracer`, `png` to the outputs, or leave `coco` out
    ");
    let untraced = |scene: &mut Value| scene["tracer"] = Value::Null;
    insta::assert_snapshot!(refused(&untraced, "png,coco"), @"
    error: outputs: `coco` annotates picture.png, which is not written
    hint: give the scene a `tracer`, `png` to the outputs, or leave `coco` out
    ");
}

#[test]
fn mattes_have_names_by_their_shares_of_a_pixel() {
    let bench = rendered(&scene(), "cryptomatte");
    let file = bench.path("out/cryptomatte.exr");
    let image = exr::prelude::read_first_flat_layer_from_file(&file).unwrap();
    let width = image.layer_data.size.0;
    let channel = |name: &str| -> Vec<f32> {
        let list = &image.layer_data.channel_data.list;
        let channel = list.iter().find(|channel| channel.name.to_string() == name).expect(name);
        channel.sample_data.values_as_f32().collect()
    };
    let (ids, shares) = (channel("CryptoObject00.r"), channel("CryptoObject00.g"));
    let (seconds, others) = (channel("CryptoObject00.b"), channel("CryptoObject00.a"));
    // By mmh3 5.3.1, which these two need no other exponent for.
    let number = |name: &str| match name {
        "back" => f32::from_bits(0xcee9_0855),
        _ => f32::from_bits(0xcfb0_2b23),
    };
    let at = |x: usize, y: usize| y * width + x;
    assert_eq!((ids[at(20, 24)], shares[at(20, 24)]), (number("back"), 1.0));
    assert_eq!((ids[at(2, 2)], shares[at(2, 2)]), (0.0, 0.0));
    // The nearer plate's left side begins at 38.557 px: of pixel 38 it has 0.443, and the farther plate the rest.
    let edge = at(38, 24);
    assert_eq!((ids[edge], seconds[edge]), (number("back"), number("front")));
    // 64 samples of a Sobol' sequence miss a half plane's share by 2 of them at most.
    assert!((others[edge] - 0.443).abs() < 2.0 / 64.0, "{}", others[edge]);
    assert!((shares[edge] + others[edge] - 1.0).abs() < 1e-6);
}

#[test]
fn what_a_lens_blurs_has_shares_of_the_pixels_around_its_edge() {
    let plate = |name: &str, width: f64, x: f64, z: f64| json!({ "name": name, "shape": "rectangle", "width": width, "height": 9, "transform": { "translate": [x, 0, z] } });
    let bench = rendered(
        &json!({
            "etendue": 1,
            "camera": {
                "type": "thin_lens", "focal_length": "50 mm", "f_number": 1.4, "focus_distance": "4 m",
                "sensor_height": "24 mm", "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                "sensor": { "resolution": [80, 20] }
            },
            "tracer": { "type": "facing" }, "render": { "samples": 1, "accel": "bvh" },
            "objects": [plate("near", 8.0, 4.0, 1.0), plate("far", 40.0, 0.0, -2.0)]
        }),
        "cryptomatte",
    );
    let image =
        exr::prelude::read_first_flat_layer_from_file(bench.path("out/cryptomatte.exr")).unwrap();
    let list = &image.layer_data.channel_data.list;
    let channel = |name: &str| -> Vec<f32> {
        let channel = list.iter().find(|channel| channel.name.to_string() == name).expect(name);
        channel.sample_data.values_as_f32().collect()
    };
    let near = f32::from_bits(0x8bb7_b66c);
    let pairs =
        [["r", "g"], ["b", "a"]].map(|pair| pair.map(|c| channel(&format!("CryptoObject00.{c}"))));
    for row in 0..20 {
        let share = |x: usize| -> f32 {
            pairs
                .iter()
                .filter(|[id, _]| id[80 * row + x] == near)
                .map(|[_, share]| share[80 * row + x])
                .sum()
        };
        let mixed = (0..80).filter(|&x| (0.01..0.99).contains(&share(x))).count();
        // The blur of an edge 1 m away is 50 mm / 1.4 · 3/4 · 4 · 50 / 3950 = 1.36 mm wide, pixels are 1.2 mm.
        assert!((1..=4).contains(&mixed), "{mixed}");
        // The edge is on the axis, and a round pupil takes from one side what it gives to the other. 64 samples are off
        // by 2 of them in each of the mixed pixels.
        let sum: f32 = (0..80).map(share).sum();
        assert!((sum - 40.0).abs() < 0.15, "{sum}");
    }
}

/// Others' readers read the sets: pycocotools, cryptomatte-api and a reader of BOP's folder.
#[test]
fn others_read_the_sets() {
    let packages = ["numpy", "pycocotools==2.0.11", "cryptomatte-api==1.0.0", "imageio", "pypng"];
    let python = match environment::python_with("annotation-readers-1", &packages) {
        Ok(python) => python,
        // Without a network there is nobody to ask; where the others are asked for, they must come.
        Err(why) if std::env::var_os("ETENDUE_NEEDS_READERS").is_none() => {
            println!("skipped: others' readers cannot be had: {why}");
            return;
        }
        Err(why) => panic!("others' readers cannot be had: {why}"),
    };
    let bench = rendered(&scene(), "npy,png,coco,bop,cryptomatte");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/annotation_readers.py");
    let output = Command::new(python).arg(script).arg(bench.path("out")).output().unwrap();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}
