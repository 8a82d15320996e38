//! Looks of a glTF model's material and lights: a square that fills the picture, and values that a closed form gives.

use std::f64::consts::PI;

use serde_json::{Value, json};

use crate::run::{Bench, under};

/// The square −1..1 in z = 0 that faces +Z, (0, 0) of its texture at the upper left, with `material`
/// and whatever else the document holds.
fn model(material: &Value, rest: &Value) -> (String, Vec<u8>) {
    let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0_f32]];
    let mut bytes = Vec::new();
    for [x, y] in corners {
        bytes.extend([x, y, 0.0].iter().flat_map(|c: &f32| c.to_le_bytes()));
    }
    for [x, y] in corners {
        bytes.extend([0.5 + 0.5 * x, 0.5 - 0.5 * y].iter().flat_map(|c: &f32| c.to_le_bytes()));
    }
    for index in [0_u32, 3, 2, 0, 2, 1] {
        bytes.extend(index.to_le_bytes());
    }
    let mut document = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [material],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4,
             "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": 4},
            {"bufferView": 2, "componentType": 5125, "type": "SCALAR", "count": 6}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 24}],
        "buffers": [{"uri": "m.bin", "byteLength": bytes.len()}],
    });
    for (key, value) in rest.as_object().expect("an object") {
        document[key] = value.clone();
    }
    (document.to_string(), bytes)
}

/// Radiance 1 from all around.
fn sky() -> Value {
    json!([{"type": "environment"}])
}

/// A scene of the model, looked at straight on, with some of its keys given.
pub(crate) fn stage(material: &Value, rest: &Value, scene: &Value) -> Bench {
    let mut whole = json!({
        "etendue": 1,
        "tracer": {"type": "path"},
        "camera": {"type": "orthographic", "height": 2, "sensor": {"resolution": [8, 8]},
                   "pose": {"from": [0, 0, 5], "look_at": [0, 0, 0]}},
        "objects": [{"file": "m.gltf"}],
        "lights": sky(),
        "render": {"samples": 64},
    });
    for (key, value) in scene.as_object().expect("an object") {
        whole[key] = value.clone();
    }
    let bench = Bench::with_scene(&whole.to_string());
    let (document, bytes) = model(material, rest);
    bench.write("m.gltf", document.as_bytes());
    bench.write("m.bin", &bytes);
    bench
}

/// The pixels of the picture.
pub(crate) fn pixels(bench: &Bench) -> Vec<[f64; 3]> {
    bench.render(&["--report", "report.json"]);
    bench.array("picture").as_chunks().0.to_vec()
}

/// The mean of all pixels is `known`, and within four standard errors of it.
pub(crate) fn assert_shows(bench: &Bench, known: [f64; 3], what: &str) {
    let pixels = pixels(bench);
    let n = pixels.len() as f64;
    for k in 0..3 {
        let mean = pixels.iter().map(|p| p[k]).sum::<f64>() / n;
        let variance = pixels.iter().map(|p| (p[k] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // Factors of glTF are f32, pictures too.
        let bound = 4.0 * (variance / n).sqrt() + 3e-7 * known[k].max(1.0);
        assert!((mean - known[k]).abs() <= bound, "{what}: {mean} is not {known:?} by {bound}");
    }
}

/// A PNG of 2 × 2 texels.
pub(crate) fn texels(rgba: [[u8; 4]; 4]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 2, 2);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(rgba.as_flattened()).expect("an image");
    drop(writer);
    file
}

/// The model's texture 0 from `t.png`, nearest texels.
pub(crate) fn textured(sampler: &Value) -> Value {
    let mut nearest = sampler.clone();
    nearest["magFilter"] = json!(9728);
    json!({"textures": [{"source": 0, "sampler": 0}], "images": [{"uri": "t.png"}],
           "samplers": [nearest]})
}

pub(crate) const GREY: [[u8; 4]; 4] = [[128, 128, 128, 255]; 4];

/// Light behind the square and none in front of it.
fn lamp_behind() -> Value {
    json!({
        "lights": [],
        "objects": [{"file": "m.gltf"},
            {"shape": "rectangle", "width": 20, "height": 20, "material": "lamp",
             "transform": {"translate": [0, 0, -1]}}],
        "materials": {"lamp": {"type": "emissive", "radiance": [1, 1, 1]}},
    })
}

#[test]
fn unlit_surfaces_show_their_colour_and_light_nothing() {
    let unlit = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 1]},
        "extensions": {"KHR_materials_unlit": {}}});
    let used = json!({"extensionsUsed": ["KHR_materials_unlit"]});
    for lights in [json!([]), sky()] {
        let bench = stage(&unlit, &used, &json!({"lights": lights}));
        assert_shows(&bench, [0.25, 0.5, 0.75], "unlit");
    }
    let wall = json!({"lights": [], "objects": [
        {"file": "m.gltf", "transform": {"rotate": [0, 1, 0, 90], "translate": [-1, 0, 1]}},
        {"shape": "rectangle", "width": 4, "height": 4}]});
    let bench = stage(&unlit, &used, &wall);
    // The square is seen from its edge, and the wall that it faces stays dark.
    assert_shows(&bench, [0.0; 3], "beside an unlit surface");
}

/// A black base leaves the coat alone. Face on its reflectance is ((n − 1)/(n + 1))², times what
/// `KHR_materials_specular` says.
#[test]
fn index_and_specular_give_the_reflectance_face_on() {
    let coat = |extensions: Value| {
        json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0,
            "roughnessFactor": 0}, "extensions": extensions})
    };
    let specular = "KHR_materials_specular";
    let cases = [
        (json!({}), [0.04; 3]),
        (json!({"KHR_materials_ior": {"ior": 2}}), [1.0 / 9.0; 3]),
        (json!({"KHR_materials_ior": {"ior": 1}}), [0.0; 3]),
        (json!({specular: {"specularFactor": 0.5}}), [0.02; 3]),
        (json!({specular: {"specularColorFactor": [1, 0.5, 0]}}), [0.04, 0.02, 0.0]),
        (json!({specular: {"specularColorFactor": [100, 1, 1]}}), [1.0, 0.04, 0.04]),
    ];
    for (extensions, known) in cases {
        let used: Vec<_> = extensions.as_object().into_iter().flat_map(|e| e.keys()).collect();
        let bench = stage(&coat(extensions.clone()), &json!({"extensionsUsed": used}), &json!({}));
        assert_shows(&bench, known, &extensions.to_string());
    }
}

/// A highlight of a black base, under the sun from 40° beside the view, where its grain goes along u, across it, or where
/// an image turns it: D G F / 4 by GGX with `α_t` = α + (1 − α) s² along the grain (the extension's formula).
#[test]
fn anisotropy_spreads_highlights_along_the_grain() {
    let (alpha, strength, tilt) = (0.36_f64, 0.7_f64, 40.0_f64.to_radians());
    let along = alpha + (1.0 - alpha) * strength * strength;
    // Along x of the grain's frame, seen face on.
    let shown = |[x, y]: [f64; 2], to_sun: [f64; 2]| {
        let half = 0.5 * tilt;
        let [tx, ty] = to_sun.map(|part| part * half.sin());
        let e = (tx / x).powi(2) + (ty / y).powi(2) + half.cos().powi(2);
        let distribution = 1.0 / (PI * x * y * e * e);
        let slope = ((x * to_sun[0]).powi(2) + (y * to_sun[1]).powi(2)) * tilt.tan().powi(2);
        let shadowing = 1.0 / (1.0 + 0.5 * ((1.0 + slope).sqrt() - 1.0));
        let fresnel = 0.04 + 0.96 * (1.0 - half.cos()).powi(5);
        // The cosine of the sun is in both terms.
        distribution * shadowing * fresnel / 4.0
    };
    let cases = [
        (json!({"anisotropyStrength": 0.7}), [1.0, 0.0]),
        (json!({"anisotropyStrength": 0.7, "anisotropyRotation": PI / 2.0}), [0.0, 1.0]),
        (
            json!({"anisotropyStrength": 0.7, "anisotropyRotation": PI / 6.0}),
            [0.75_f64.sqrt(), 0.5],
        ),
        (json!({"anisotropyStrength": 0.7, "anisotropyTexture": {"index": 0}}), [0.0, 1.0]),
    ];
    for (anisotropy, grain) in cases {
        let brushed = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1],
            "metallicFactor": 0, "roughnessFactor": alpha.sqrt()},
            "extensions": {"KHR_materials_anisotropy": anisotropy}});
        let mut rest = textured(&json!({}));
        rest["extensionsUsed"] = json!(["KHR_materials_anisotropy"]);
        // The sun is over +X; growing u goes there, and falling v to +Y.
        let sun = json!({"camera": {"type": "orthographic", "height": 1e-3,
                "sensor": {"resolution": [4, 4]},
                "pose": {"from": [0.1, 0.1, 5], "look_at": [0.1, 0.1, 0]}},
            "lights": [{"type": "directional", "direction": [-tilt.sin(), 0, -tilt.cos()],
                        "irradiance": [1, 1, 1]}]});
        let bench = stage(&brushed, &rest, &sun);
        // Up the image: (0.5, 1), which bytes have to 1/255.
        bench.write("t.png", &texels([[128, 255, 255, 255]; 4]));
        let known = shown([along, alpha], [grain[0], grain[1]]);
        let pixels = pixels(&bench);
        for pixel in pixels {
            // Roughness and rotation are f32, and the image's grain is off by 0.2°.
            assert!((pixel[0] / known - 1.0).abs() < 1e-4, "{anisotropy}: {pixel:?} {known}");
        }
    }
}

/// Cloth of a black base face on under a sun 60° beside: colour · D V μ, by Estevez and Kulla, and black where the
/// colour is.
#[test]
fn sheen_is_that_of_its_formula() {
    let cloth = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1],
            "metallicFactor": 0, "roughnessFactor": 1},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0},
            "KHR_materials_sheen": {"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 1}}});
    let used = json!({"extensionsUsed": ["KHR_materials_sheen", "KHR_materials_specular"]});
    let sun = json!({"lights": [{"type": "directional", "irradiance": [1, 1, 1],
        "direction": [-(0.75_f64.sqrt()), 0, -0.5]}]});
    // α is 1: D = 3 sin 30° / 2π, and Λ by the fit, L(0.5) in both.
    let fit = |x: f64| 21.5473 / (1.0 + 3.82987 * x.powf(0.19823)) - 1.97760 * x - 4.32054;
    let masking = 1.0 + (2.0 * fit(0.5) - fit(0.0)).exp() + (2.0 * fit(0.5) - fit(0.5)).exp();
    let known = 3.0 * 0.5 / (2.0 * PI) / (4.0 * masking);
    assert_shows(&stage(&cloth, &used, &sun), [known, 0.5 * known, 0.0], "cloth");
}

/// Of light from behind a wall shows its tint times what it lets through, and none without
/// transmission.
#[test]
fn transmission_lets_light_through() {
    let used = json!({"extensionsUsed": ["KHR_materials_transmission", "KHR_materials_ior"]});
    for (transmission, known) in [(1.0, [0.9, 0.5, 0.25]), (0.5, [0.45, 0.25, 0.125])] {
        let glass = json!({
            "pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.5, 0.25, 1], "metallicFactor": 0,
                                     "roughnessFactor": 0},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission},
                           "KHR_materials_ior": {"ior": 1}}});
        assert_shows(&stage(&glass, &used, &lamp_behind()), known, "glass");
    }
    let opaque = json!({"pbrMetallicRoughness": {"metallicFactor": 0}});
    assert_shows(&stage(&opaque, &json!({}), &lamp_behind()), [0.0; 3], "opaque");
}

#[test]
fn emission_is_its_factor_times_its_strength() {
    let lamp = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
        "emissiveFactor": [1, 0.5, 0.25],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}});
    let used = json!({"extensionsUsed": ["KHR_materials_emissive_strength"]});
    assert_shows(&stage(&lamp, &used, &json!({"lights": []})), [4.0, 2.0, 1.0], "lamp");
}

/// Alpha that leaves a surface out shows what is behind: a wall of radiance 1 behind a black square.
#[test]
fn alpha_cuts_or_thins() {
    let black = |mode: &str, alpha: f64, more: Value| {
        let mut material = json!({"alphaMode": mode, "pbrMetallicRoughness":
            {"baseColorFactor": [0, 0, 0, alpha], "metallicFactor": 1, "roughnessFactor": 1}});
        for (key, value) in more.as_object().into_iter().flatten() {
            material[key] = value.clone();
        }
        material
    };
    let cases = [
        (black("OPAQUE", 0.1, json!({})), 0.0),
        (black("MASK", 0.49, json!({})), 1.0),
        (black("MASK", 0.51, json!({})), 0.0),
        (black("MASK", 0.51, json!({"alphaCutoff": 0.6})), 1.0),
        (black("BLEND", 0.25, json!({})), 0.75),
    ];
    for (material, known) in cases {
        let bench = stage(&material, &json!({}), &lamp_behind());
        assert_shows(&bench, [known; 3], &material.to_string());
    }
    let mut holes = black("MASK", 1.0, json!({}));
    holes["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    let bench = stage(&holes, &textured(&json!({})), &lamp_behind());
    bench.write("t.png", &texels([[0, 0, 0, 0], [0, 0, 0, 255], [0, 0, 0, 255], [0, 0, 0, 0]]));
    let pixels = pixels(&bench);
    for (i, pixel) in pixels.iter().enumerate() {
        let hole = (i % 8 < 4) == (i / 8 < 4);
        assert_eq!(*pixel, [f64::from(u8::from(hole)); 3], "pixel {i}");
    }
}

/// With `cull_backfaces` a square that is not double-sided is there from its front and not from behind, to the camera
/// and to what it would shade, and shines to its front alone; data have it all the same.
#[test]
fn backs_are_left_out_where_the_scene_says_so() {
    let from = |z: f64, more: &Value| {
        let mut scene = json!({"cull_backfaces": true, "layers": ["coverage"],
            "camera": {"type": "orthographic", "height": 1, "sensor": {"resolution": [8, 8]},
            "pose": {"from": [0, 0, z], "look_at": [0, 0, 0]}}});
        for (key, value) in more.as_object().into_iter().flatten() {
            scene[key] = value.clone();
        }
        scene
    };
    let black = |double_sided: bool| {
        json!({"doubleSided": double_sided, "emissiveFactor": [0.5, 0.5, 0.5],
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1,
                                     "roughnessFactor": 0}})
    };
    for (z, double_sided, known) in [(5.0, false, 0.5), (-5.0, false, 1.0), (-5.0, true, 0.5)] {
        let bench = stage(&black(double_sided), &json!({}), &from(z, &json!({})));
        assert_shows(&bench, [known; 3], &format!("from {z}, doubleSided {double_sided}"));
        assert!(bench.array("coverage").iter().all(|share| *share == 1.0));
    }
    // A wall of reflectance 0.5 under a sun behind the camera, and the square between both: rays from the wall to the
    // sun pass its back and not its front.
    let floor = |turn: f64| {
        json!({"lights": [{"type": "directional", "direction": [0, 0, 1],
            "irradiance": [2.0 * PI, 2.0 * PI, 2.0 * PI]}],
        "objects": [{"file": "m.gltf", "transform": {"rotate": [0, 1, 0, turn], "translate": [0, 0, -6]}},
            {"shape": "rectangle", "width": 9, "height": 9, "material": "m",
             "transform": {"rotate": [0, 1, 0, 180]}}],
        "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}})
    };
    let dark = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1],
        "metallicFactor": 1, "roughnessFactor": 0}});
    for (turn, known) in [(0.0, 0.0), (180.0, 1.0)] {
        let bench = stage(&dark, &json!({}), &from(-5.0, &floor(turn)));
        assert_shows(&bench, [known; 3], &format!("shadow, turned by {turn}"));
    }
}

/// Whatever `doubleSided` says, a surface is there from behind.
#[test]
fn surfaces_have_two_sides() {
    for double_sided in [false, true] {
        let white = json!({"doubleSided": double_sided, "pbrMetallicRoughness":
            {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 0}});
        let behind = json!({"camera": {"type": "orthographic", "height": 2,
            "sensor": {"resolution": [8, 8]},
            "pose": {"from": [0, 0, -5], "look_at": [0, 0, 0]}}});
        assert_shows(&stage(&white, &json!({}), &behind), [0.04; 3], "from behind");
    }
}

/// Candela and lux on a matte wall: I cos θ / (π d²), between the cones by glTF's fall-off, and
/// E cos θ / π.
#[test]
fn punctual_lights_have_their_units_and_cones() {
    let scene = json!({
        "lights": [],
        "materials": {"wall": {"type": "matte", "color": [1, 1, 1]}},
        "objects": [{"file": "m.gltf", "material": "wall"}],
    });
    let lit = |light: Value, node: Value| {
        let mut node = node;
        node["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
        let rest = json!({"extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [light]}},
            "scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0}, node]});
        pixels(&stage(&json!({}), &rest, &scene))
    };
    let (inner, outer) = (0.2_f64, 0.5_f64);
    let spot = json!({"type": "spot", "intensity": 10,
        "spot": {"innerConeAngle": inner, "outerConeAngle": outer}});
    let point = json!({"type": "point", "intensity": 10, "color": [1, 0.5, 0]});
    let above = json!({"translation": [0, 0, 2]});
    let (spots, points) = (lit(spot, above.clone()), lit(point, above));
    for i in 0..64 {
        let at = |k: usize| (k as f64 + 0.5) / 4.0 - 1.0;
        let (x, y) = (at(i % 8), at(i / 8));
        let squared = x * x + y * y + 4.0;
        let cosine = 2.0 / squared.sqrt();
        let known = 10.0 * cosine / (PI * squared);
        // A pixel is a mean over a quarter of a metre: its second difference is under a hundredth.
        assert!((points[i][0] / known - 1.0).abs() < 0.02, "{i}: {} {known}", points[i][0]);
        assert!((points[i][1] / points[i][0] - 0.5).abs() < 1e-6 && points[i][2] == 0.0);
        let share = (cosine - outer.cos()) / (inner.cos() - outer.cos());
        let known = known * share.clamp(0.0, 1.0).powi(2);
        assert!((spots[i][0] - known).abs() < 0.05, "{i}: {} {known}", spots[i][0]);
        if cosine < 0.83 {
            assert_eq!(spots[i][0], 0.0, "outside of the cone");
        }
    }
    // Parallel light of π lx along the node's −Z, turned by 60°: half of it.
    let sun = json!({"type": "directional", "intensity": PI});
    let turned = json!({"rotation": [0.0, 0.5, 0.0, 0.75_f64.sqrt()]});
    for pixel in lit(sun, turned) {
        assert!((pixel[0] - 0.5).abs() < 1e-6, "{pixel:?}");
    }
}

/// Numbers that no surface can have are told by material and key, and refused when strict.
#[test]
fn numbers_that_no_surface_can_have_are_told_or_refused_when_strict() {
    let with = |key: &str, value: Value| json!({"name": "odd", key: value});
    let extended = |name: &str, value: Value| with("extensions", json!({name: value}));
    let cases = [
        with("pbrMetallicRoughness", json!({"roughnessFactor": -1})),
        with("pbrMetallicRoughness", json!({"metallicFactor": 2})),
        with("pbrMetallicRoughness", json!({"baseColorFactor": [2, 0, 0, 1]})),
        with("emissiveFactor", json!([-1, 0, 0])),
        with("emissiveFactor", json!([1e38, 0, 0])),
        with("alphaMode", json!("SOLID")),
        extended("KHR_materials_ior", json!({"ior": 0.5})),
        extended("KHR_materials_ior", json!({"ior": "glass"})),
        extended("KHR_materials_transmission", json!({"transmissionFactor": 5})),
        extended("KHR_materials_specular", json!({"specularFactor": -5})),
        extended("KHR_materials_specular", json!({"specularColorFactor": [1]})),
        extended("KHR_materials_specular", json!(7)),
    ];
    let messages = cases.map(|material| {
        let bench = stage(&material, &json!({}), &json!({"render": {"samples": 4}}));
        let odd = pixels(&bench);
        assert!(odd.iter().flatten().all(|v| v.is_finite()), "{material}");
        let notes = &bench.json("report.json")["notes"];
        let notes = notes.as_array().expect("notes").iter().filter_map(Value::as_str);
        let of_surface: Vec<&str> = notes.filter(|note| note.contains("\"odd\"")).collect();
        let strict = bench.refusal(&["render", "scene.json", "-o", "strict", "--strict"]);
        under(&material.to_string(), &format!("note: {}\n{strict}", of_surface.join("\nnote: ")))
    });
    insta::assert_snapshot!(messages.concat());
}

/// A model without lights is lit by the studio, and told so; a scene that wants none stays dark.
#[test]
fn what_has_no_light_is_lit_by_the_studio_unless_it_shall_be_dark() {
    let grey = json!({"pbrMetallicRoughness": {"metallicFactor": 0}});
    let lit = stage(&grey, &json!({}), &json!({"lights": null}));
    for pixel in pixels(&lit) {
        // The studio's floor and lamp are 0.1 and 4.5.
        assert!((0.1..1.5).contains(&pixel[0]), "{pixel:?}");
    }
    insta::assert_snapshot!(format!("{:#}", lit.json("report.json")["notes"]), @r#"
    [
      "lights: nothing in the scene shines: it is lit by a grey studio; name `lights` in the scene for others, or `\"lights\": []` for none"
    ]
    "#);
    let dark = stage(&grey, &json!({}), &json!({"lights": []}));
    assert_eq!(pixels(&dark), vec![[0.0; 3]; 64]);
    insta::assert_snapshot!(format!("{:#}", dark.json("report.json")["notes"]), @r#"
    [
      "picture: 100 % of what the camera sees sends no light at all: its materials are black, or no light reaches it; name other `materials` or `lights` in the scene, or leave out the key `lights` for a grey studio"
    ]
    "#);
}

/// A specular-glossiness material.
pub(crate) fn glossy(own: &Value) -> Value {
    json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": own}})
}

#[test]
fn specular_glossiness_is_a_reflectance_over_a_diffuse_colour() {
    // A mirror face on reflects its reflectance of a sky of 1.
    let mirror = json!({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.5, 0.25, 1]});
    let used = json!({"extensionsUsed": ["KHR_materials_pbrSpecularGlossiness"]});
    let bench = stage(&glossy(&mirror), &used, &json!({}));
    assert_shows(&bench, [0.5, 0.25, 1.0], "a mirror");
    insta::assert_snapshot!(format!("{:#}", bench.json("report.json")["notes"]), @r#"
    [
      "KHR_materials_pbrSpecularGlossiness: read as KHR_materials_specular with ior 0, as that extension's text converts it"
    ]
    "#);

    // The diffuse colour is the base colour.
    let diffuse = json!({"diffuseFactor": [0.25, 0.5, 0.75, 1], "glossinessFactor": 0});
    let bench = stage(&glossy(&diffuse), &used, &json!({"tracer": {"type": "flat"}}));
    assert_shows(&bench, [0.25, 0.5, 0.75], "the base colour");

    // Texel 128 is 0.2158605 by the sRGB curve (IEC 61966-2-1).
    let texture = json!({"diffuseFactor": [0, 0, 0, 1], "specularGlossinessTexture": {"index": 0}});
    let bench = stage(&glossy(&texture), &textured(&json!({})), &json!({}));
    bench.write("t.png", &texels(GREY));
    assert_shows(&bench, [0.215_860_5; 3], "a mirror by its texture");
}
