//! Looks of a glTF model's textures, on a square that fills the picture.

use serde_json::{Value, json};

use crate::gltf_looks::{GREY, assert_shows, glossy, pixels, stage, texels, textured};

/// Colours are sRGB; metal and roughness, beside it, are plain numbers: half metal, half of the coat.
#[test]
fn images_are_read_as_what_they_are() {
    let color = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let bench = stage(&color, &textured(&json!({})), &json!({"tracer": {"type": "flat"}}));
    bench.write("t.png", &texels(GREY));
    let linear = ((128.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    assert_shows(&bench, [linear; 3], "colour");
    let metal = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1],
        "roughnessFactor": 0, "metallicRoughnessTexture": {"index": 0}}});
    let bench = stage(&metal, &textured(&json!({})), &json!({}));
    bench.write("t.png", &texels([[0, 255, 128, 255]; 4]));
    assert_shows(&bench, [0.04 * (1.0 - 128.0 / 255.0); 3], "metal");
}

/// Texels at 2 u and 2 v of each wrap mode, by `KHR_texture_transform`.
#[test]
fn images_wrap_and_move_as_the_file_says() {
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
    let apply = |mode: u32, texel: usize| match mode {
        10497 => texel % 2,
        33648 => [0, 1, 1, 0][texel],
        _ => texel.min(1),
    };
    for (along_u, along_v) in [(10497, 33071), (33648, 10497), (33071, 33648)] {
        let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0,
            "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}}});
        let mut rest = textured(&json!({"wrapS": along_u, "wrapT": along_v}));
        rest["extensionsUsed"] = json!(["KHR_texture_transform"]);
        let bench = stage(&material, &rest, &json!({"tracer": {"type": "flat"}}));
        bench.write("t.png", &texels(colors));
        for (i, pixel) in pixels(&bench).iter().enumerate() {
            // Four texels across eight pixels.
            let (x, y) = (apply(along_u, i % 8 / 2), apply(along_v, i / 8 / 2));
            let [r, g, b, _] = colors[2 * y + x].map(|c| f64::from(c) / 255.0);
            assert_eq!(*pixel, [r, g, b], "pixel {i} of {along_u} {along_v}");
        }
    }
}

/// `facing` has 0.15 of even light and 0.85 of a headlight: occlusion of one half at strength 0.6
/// takes 0.3 of the former. Traced light finds out by itself.
#[test]
fn occlusion_dims_even_light_only() {
    let plain = json!({"pbrMetallicRoughness": {"metallicFactor": 0}});
    let mut occluded = plain.clone();
    occluded["occlusionTexture"] = json!({"index": 0, "strength": 0.6});
    let image = texels([[128, 0, 255, 255]; 4]);
    let facing = json!({"tracer": {"type": "facing"}});
    for (tracer, least, lost) in
        [(&facing, 1.0, 0.15 * 0.6 * (1.0 - 128.0 / 255.0)), (&json!({}), 0.9, 0.0)]
    {
        let [with, without] = [&occluded, &plain].map(|material| {
            let bench = stage(material, &textured(&json!({})), tracer);
            bench.write("t.png", &image);
            pixels(&bench)
        });
        for (with, without) in with.iter().zip(&without) {
            assert!((without[0] - with[0] - lost).abs() < 1e-6, "{with:?} {without:?}");
            assert!(without[0] >= least - 1e-6, "{without:?}");
        }
    }
}

/// Each image that is looked at is decoded, once, and its memory is told; others are not.
#[test]
fn images_are_decoded_once_and_only_when_looked_at() {
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 0}},
        "emissiveTexture": {"index": 1}, "emissiveFactor": [1, 1, 1]});
    let rest = json!({"textures": [{"source": 0}, {"source": 1}, {"source": 2}],
        "images": [{"uri": "t.png"}, {"uri": "e.png"}, {"uri": "broken.png"}]});
    for (tracer, count) in [("flat", 1), ("path", 2)] {
        let bench = stage(&material, &rest, &json!({"tracer": {"type": tracer}}));
        bench.write("t.png", &texels(GREY));
        bench.write("e.png", &texels(GREY));
        bench.write("broken.png", b"no image, and nobody looks");
        bench.render(&["--strict", "--report", "report.json"]);
        let report = bench.json("report.json");
        let told = report["images"].as_array().expect("a list").clone();
        assert_eq!(told.len(), count, "{told:?}");
        // Four texels of four bytes, and means over them where they are averaged.
        assert!(told.iter().all(|t| t["bytes"].as_u64().is_some_and(|b| b >= 16)), "{told:?}");
    }
    let bench = stage(&material, &rest, &json!({"layers": ["depth"], "tracer": null}));
    bench.render(&["--strict", "--report", "report.json"]);
    assert_eq!(bench.json("report.json")["images"], json!([]));
}

#[test]
fn glossiness_is_in_the_alpha_of_its_texture() {
    let half = json!({"diffuseFactor": [0, 0, 0, 1], "specularGlossinessTexture": {"index": 0}});
    let by_texture = stage(&glossy(&half), &textured(&json!({})), &lamp_in_front());
    by_texture.write("t.png", &texels([[255, 255, 255, 102]; 4]));
    // The same reflectance in the words of the metallic-roughness model: 1 − 102/255.
    let rough = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0,
                                 "roughnessFactor": 0.6},
        "extensions": {"KHR_materials_ior": {"ior": 0}, "KHR_materials_specular": {}}
    });
    let by_factor = stage(&rough, &json!({}), &lamp_in_front());
    let (texture, factor) = (pixels(&by_texture), pixels(&by_factor));
    assert!(factor.iter().any(|p| p[0] > 0.01), "the lamp is seen in it");
    for (a, b) in texture.iter().zip(&factor) {
        // Factors of glTF are f32; the same numbers of the sampler make the same picture.
        assert!((a[0] - b[0]).abs() <= 1e-4 * b[0].max(1e-3), "{a:?} is not {b:?}");
    }
}

/// A small lamp before the square and no other light.
fn lamp_in_front() -> Value {
    json!({
        "lights": [],
        "objects": [{"file": "m.gltf"},
            {"shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
             "transform": {"translate": [0, 0, 6], "rotate": [0, 1, 0, 180]}}],
        "materials": {"lamp": {"type": "emissive", "radiance": [1, 1, 1]}},
    })
}

#[test]
fn textures_in_webp_are_decoded() {
    // 2 × 2 texels, red, green, blue and grey, by libwebp 1.6.0 without loss.
    const WEBP: [u8; 56] = [
        0x52, 0x49, 0x46, 0x46, 0x30, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38,
        0x4c, 0x23, 0x00, 0x00, 0x00, 0x2f, 0x01, 0x40, 0x00, 0x00, 0x1f, 0x20, 0x10, 0x20, 0x38,
        0x77, 0x6e, 0x43, 0x40, 0x50, 0x74, 0xdd, 0x72, 0x02, 0x01, 0x82, 0x73, 0xe7, 0xe6, 0x3f,
        0xf0, 0xc9, 0x51, 0xc1, 0x0d, 0x18, 0x22, 0xfa, 0x1f, 0x02, 0x00,
    ];
    let rest = json!({
        "textures": [{"sampler": 0, "extensions": {"EXT_texture_webp": {"source": 0}}}],
        "images": [{"uri": "t.webp", "mimeType": "image/webp"}],
        "samplers": [{"magFilter": 9728}],
        "extensionsUsed": ["EXT_texture_webp"], "extensionsRequired": ["EXT_texture_webp"]
    });
    let colour = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let flat = json!({"tracer": {"type": "flat"}, "render": {"samples": 1}});
    let bench = stage(&colour, &rest, &flat);
    bench.write("t.webp", &WEBP);
    let pixels = pixels(&bench);
    assert_eq!(bench.json("report.json")["notes"], json!([]));
    for (at, expected) in
        [(0, [1.0, 0.0, 0.0]), (7, [0.0, 1.0, 0.0]), (56, [0.0, 0.0, 1.0]), (63, [0.215_860_5; 3])]
    {
        for k in 0..3 {
            // Pictures are f32.
            assert!((pixels[at][k] - expected[k]).abs() < 1e-6, "{:?}", pixels[at]);
        }
    }
}
