//! Materials, textures and lights that make no sense: refused by name, or shown as such and told.

use crate::run::{Bench, under};

/// A square over the whole picture with the texture `image` on it, by an OBJ model.
fn textured(image: Option<&[u8]>) -> Bench {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "tracer": {"type": "flat"}, "objects": [{"file": "m.obj"}],
            "camera": {"type": "orthographic", "height": 1, "sensor": {"resolution": [8, 8]},
                       "pose": {"from": [0.5, 0.5, 2], "look_at": [0.5, 0.5, 0]}}}"#,
    );
    bench.write(
        "m.obj",
        b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        usemtl m\nf 1/1 2/2 3/3 4/4\n",
    );
    bench.write("m.mtl", b"newmtl m\nKd 1 1 1\nmap_Kd wood.png\n");
    if let Some(image) = image {
        bench.write("wood.png", image);
    }
    bench
}

/// The header of a PNG of `side` × `side` pixels, and nothing behind it.
fn png_header(side: u32) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side, side);
    encoder.set_color(png::ColorType::Rgb);
    drop(encoder.write_header().expect("a header"));
    file
}

#[test]
fn textures_that_cannot_be_had_are_magenta_and_told_or_refused_when_strict() {
    let cases: [(&str, Option<&[u8]>); 4] = [
        ("no file", None),
        ("words", Some(b"\x89PNG\r\n\x1a\nnot much of an image")),
        ("a header of 8 x 8 pixels", Some(&png_header(8))),
        ("a header of 100000 x 100000 pixels", Some(&png_header(100_000))),
    ];
    let mut all = String::new();
    for (image_is, image) in cases {
        let bench = textured(image);
        bench.render(&["--report", "report.json"]);
        let picture = bench.array("picture");
        let magenta = picture.chunks(3).filter(|p| **p == [1.0, 0.0, 1.0]).count();
        let black = picture.chunks(3).filter(|p| **p == [0.0; 3]).count();
        assert_eq!((magenta, black), (32, 32), "{image_is}: two of four squares each");
        let notes = &bench.json("report.json")["notes"];
        let strict = bench.refusal(&["render", "scene.json", "-o", "strict", "--strict"]);
        all += &under(image_is, &format!("{notes:#}\n{strict}"));
    }
    insta::assert_snapshot!(all);
}

/// A colour is a colour whatever its encoding; a roughness that cannot be had is left out.
#[test]
fn broken_images_of_linear_colours_are_magenta_too() {
    let mut all = String::new();
    for (encoding, ending) in [("srgb", "png"), ("linear", "png"), ("linear", "webp")] {
        let image = format!("wood.{ending}");
        let scene = serde_json::json!({
            "etendue": 1, "tracer": {"type": "flat"},
            "camera": {"type": "orthographic", "height": 1, "sensor": {"resolution": [8, 8]},
                       "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}},
            "objects": [{"shape": "rectangle", "material": "m"}],
            "materials": {"m": {"type": "matte", "color": {"image": image, "encoding": encoding}}}
        });
        let bench = Bench::with_scene(&scene.to_string());
        bench.write(&image, b"not much of an image");
        bench.render(&["--report", "report.json"]);
        let picture = bench.array("picture");
        let magenta = picture.chunks(3).filter(|p| **p == [1.0, 0.0, 1.0]).count();
        assert_eq!(magenta, 32, "{encoding}: two of four squares");
        let notes = &bench.json("report.json")["notes"];
        all += &under(&format!("{image}, {encoding}"), &format!("{notes:#}\n"));
    }
    insta::assert_snapshot!(all);
}

#[test]
fn images_that_the_scene_itself_names_have_to_be_there() {
    let scene = r#"{"etendue": 1, "tracer": {"type": "flat"},
        "objects": [{"shape": "box", "material": "m"}],
        "materials": {"m": {"type": "matte", "color": {"image": "wodo.png"}}}}"#;
    let bench = Bench::with_scene(scene);
    bench.write("wood.png", b"");
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out"]), @r#"
    error: scene.json, line 3, column 56: materials.m.color.image: no such file: "wodo.png"
    hint: did you mean "wood.png"?
    "#);
}

#[test]
fn values_that_no_material_or_light_can_have_are_refused_by_path() {
    let materials = [
        r#"{"type": "matte", "color": [0.5, -0.1, 0]}"#,
        r#"{"type": "matte", "color": [0.5, NaN, 0]}"#,
        r#"{"type": "matte", "color": [0.5, 1e999, 0]}"#,
        r#"{"type": "emissive", "radiance": [-1, 0, 0]}"#,
        r#"{"type": "emissive", "radiance": [1e31, 0, 0]}"#,
        r#"{"type": "emissive", "radiance": [1, 1, 1], "illuminant": "d66"}"#,
        r#"{"type": "dielectric", "ior": 0.9}"#,
        r#"{"type": "dielectric", "ior": {"nd": 0.5, "vd": 60}}"#,
        r#"{"type": "gltf", "ior": 0.9}"#,
        r#"{"type": "metal", "color": [1, 1, 1], "roughness": -1}"#,
        r#"{"type": "gltf", "roughness": 1.1}"#,
    ];
    let lights = [
        r#"{"type": "environment", "radiance": [1e308, 1, 1]}"#,
        r#"{"type": "point", "at": [0, 0, 0], "intensity": [1, -1, 1]}"#,
        r#"{"type": "environment", "radiance": [-1, 1, 1]}"#,
        r#"{"type": "sky", "turbidity": 0.5}"#,
        r#"{"type": "sky", "sun": {"elevation": -1}}"#,
        r#"{"type": "sky", "ground_albedo": 1.5}"#,
        r#"{"type": "sky", "scale": -1}"#,
        r#"{"type": "sky", "up": [0, 0, 0]}"#,
        r#"{"type": "environment", "image": "sky.exr"}"#,
        r#"{"type": "environment", "image": "."}"#,
        r#"{"type": "projector", "at": [0, 2, 0], "look_at": [0, 0, 0], "intensity": [1, 1, 1]}"#,
        r#"{"type": "directional", "direction": [0, 0, 0], "irradiance": [1, 1, 1]}"#,
    ];
    let refused =
        |scene: &str| Bench::with_scene(scene).refusal(&["render", "scene.json", "-o", "out"]);
    let mut all = String::new();
    for m in materials {
        let scene = format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path"}},
            "objects": [{{"shape": "box", "material": "m"}}], "materials": {{"m": {m}}}}}"#
        );
        all += &under(m, &refused(&scene));
    }
    for light in lights {
        all += &under(light, &refused(&format!(r#"{{"etendue": 1, "lights": [{light}]}}"#)));
    }
    insta::assert_snapshot!(all);
}

/// A plane of this material under these lights, by global illumination; the picture's numbers.
fn plane(material: &str, lights: &str, bench: &mut Option<Bench>) -> Vec<f64> {
    let scene = format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path"}}, "render": {{"samples": 16}},
        "camera": {{"type": "pinhole", "fov": 20, "sensor": {{"resolution": [6, 6]}},
                    "pose": {{"from": [1, 0.5, 3], "look_at": [0, 0, 0]}}}},
        "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "m"}}],
        "materials": {{"m": {material}}}, "lights": {lights}}}"#
    );
    let own = Bench::with_scene(&scene);
    if let Some(other) = bench {
        let sky = std::fs::read(other.path("sky.exr")).expect("the sky");
        own.write("sky.exr", &sky);
    }
    own.render(&["--report", "report.json"]);
    assert_eq!(own.json("report.json")["not_finite"], 0);
    let picture = own.array("picture");
    *bench = Some(own);
    picture
}

#[test]
fn lights_without_power_light_nothing() {
    let matte = r#"{"type": "matte", "color": [0.5, 0.5, 0.5]}"#;
    let dark = [
        r#"[{"type": "point", "at": [0, 0, 2], "intensity": [0, 0, 0]}]"#,
        r#"[{"type": "environment", "radiance": [0, 0, 0]}]"#,
        r#"[{"type": "spot", "at": [0, 0, 2], "look_at": [0, 0, 0], "intensity": [1, 1, 1],
             "cone": 0}]"#,
        "[]",
    ];
    for lights in dark {
        assert!(plane(matte, lights, &mut None).iter().all(|&p| p == 0.0), "{lights}");
    }
    let lamp = r#"{"type": "emissive", "radiance": [0, 0, 0]}"#;
    assert!(plane(lamp, "[]", &mut None).iter().all(|&p| p == 0.0));
}

/// At roughness 0 metal is a mirror, glTF's coat too: of a sky of 1 they return all that they can.
#[test]
fn surfaces_without_roughness_are_mirrors() {
    let sky = r#"[{"type": "environment", "radiance": [1, 1, 1]}]"#;
    let metal = r#"{"type": "metal", "color": [1, 1, 1], "roughness": 0}"#;
    for value in plane(metal, sky, &mut None) {
        assert!((value - 1.0).abs() < 1e-6, "{value}");
    }
    let coat = r#"{"type": "gltf", "color": [1, 1, 1], "metallic": 1, "roughness": 0}"#;
    for value in plane(coat, sky, &mut None) {
        assert!((value - 1.0).abs() < 1e-6, "{value}");
    }
    let glazed = plane(r#"{"type": "gltf", "roughness": 0}"#, sky, &mut None);
    // 16 samples of 36 pixels: their spread of 0.03 leaves the mean 0.005.
    let mean = glazed.iter().sum::<f64>() / glazed.len() as f64;
    assert!((0.9..=1.02).contains(&mean), "{mean}");
}

#[test]
fn an_environment_that_is_no_number_is_black_and_counted_or_refused_when_strict() {
    let bench = Bench::new();
    let sky = bench.path("sky.exr");
    // A quarter of the pixels is no radiance.
    let value = |x: usize, y: usize| match (x + y) % 8 {
        0 => f32::NAN,
        1 => f32::NEG_INFINITY,
        _ => 1.0_f32,
    };
    exr::prelude::write_rgb_file(&sky, 16, 8, |x, y| (value(x, y), value(x, y), value(x, y)))
        .expect("an EXR file");
    let mut bench = Some(bench);
    let lights = r#"[{"type": "environment", "image": "sky.exr"}]"#;
    let matte = r#"{"type": "matte", "color": [1, 1, 1]}"#;
    let picture = plane(matte, lights, &mut bench);
    assert!(picture.iter().all(|p| p.is_finite() && *p > 0.3 && *p < 1.0), "{picture:?}");
    let bench = bench.expect("the bench of the render");
    let notes = &bench.json("report.json")["notes"];
    insta::assert_snapshot!(format!("{notes:#}"), @r#"
    [
      "the environment has 32 pixels that are not finite, below zero or above 1e30; they are black"
    ]
    "#);
    let strict = ["render", "scene.json", "-o", "strict", "--strict"];
    insta::assert_snapshot!(bench.refusal(&strict), @"error: the environment has 32 pixels that are not finite, below zero or above 1e30; they are black");
}

/// The brightest lights that are taken leave every number finite.
#[test]
fn the_brightest_lights_leave_numbers() {
    let bright = [
        r#"[{"type": "point", "at": [0, 0, 2], "intensity": [1e30, 1e30, 1e30]}]"#,
        r#"[{"type": "environment", "radiance": [1e30, 1e30, 1e30]}]"#,
        r#"[{"type": "directional", "direction": [0, 0, -1], "irradiance": [1e30, 1e30, 1e30]}]"#,
    ];
    for lights in bright {
        for value in plane(r#"{"type": "matte", "color": [0.5, 0.5, 0.5]}"#, lights, &mut None) {
            assert!(value > 1e28 && value.is_finite(), "{lights}: {value}");
        }
    }
}
