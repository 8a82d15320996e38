//! Conversion of a picture's light to a PNG, and the light when nobody names any.

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// A wall of one radiance that fills half of the picture, and nothing beside it.
fn glowing(radiance: f64, render: Value) -> Bench {
    let scene = json!({
        "etendue": 1,
        "camera": {"type": "pinhole", "fov": 40, "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [16, 16]}},
        "tracer": {"type": "direct"}, "lights": [],
        "objects": [{"shape": "rectangle", "width": 4, "height": 4, "material": "lamp",
                     "transform": {"translate": [-1.95, 0, 0]}}],
        "materials": {"lamp": {"type": "emissive", "radiance": [radiance, radiance, radiance]}},
        "render": render,
    });
    Bench::with_scene(&scene.to_string())
}

/// The left- and the rightmost pixel of the middle row of `out/picture.png`, with its text.
fn png_ends(bench: &Bench) -> (Vec<u8>, Vec<u8>, String) {
    let file = std::fs::File::open(bench.path("out/picture.png")).expect("a picture");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let channels = reader.info().color_type.samples();
    let texts = reader.info().utf8_text.iter();
    let reading = texts.filter(|t| t.keyword == "Reading").map(|t| t.get_text().expect("text"));
    let reading: String = reading.collect();
    let mut bytes = vec![0; 16 * 16 * channels];
    reader.next_frame(&mut bytes).expect("an image");
    let row = &bytes[8 * 16 * channels..9 * 16 * channels];
    (row[..channels].to_vec(), row[15 * channels..].to_vec(), reading)
}

#[test]
fn exposure_and_tone_map_change_the_png_alone_and_stand_in_it() {
    let plain = glowing(0.045, json!({}));
    plain.render(&[]);
    let radiance = plain.array("picture");
    // 0.045 in sRGB is 0.2348, 60 of 255; two stops on, 0.18 is 0.4614, 118.
    assert_eq!(png_ends(&plain).0, [60; 3]);
    for (exposure, tone_map, shown) in
        [("2", "none", 118), ("auto", "none", 118), ("2", "agx", 127), ("2", "aces", 91)]
    {
        let bench = glowing(0.045, json!({}));
        let exposure_key = format!("render.exposure={exposure}");
        let tone_map_key = format!("render.tone_map={tone_map}");
        bench.render(&["--set", &exposure_key, "--set", &tone_map_key]);
        let (left, right, reading) = png_ends(&bench);
        // 0.18 by the polynomial of AgX is 0.497, by ACES 0.3585 (develop.rs works both out).
        assert_eq!((left, right), (vec![shown; 3], vec![0; 3]), "{exposure} {tone_map}");
        assert!(reading.contains("+2.00 stops"), "{reading}");
        assert!(tone_map == "none" || reading.to_lowercase().contains(tone_map), "{reading}");
        assert_eq!(bench.array("picture"), radiance, "NPY keeps the radiance");
        let told = &bench.json("out/layers.json")["picture_png"];
        assert!((told["exposure"].as_f64().expect("stops") - 2.0).abs() < 1e-6, "{told}");
        assert_eq!(told["tone_map"], tone_map);
    }
}

#[test]
fn exposures_that_make_no_sense_are_refused() {
    let bench = glowing(1.0, json!({}));
    let refused = |setting| bench.refusal(&["render", "scene.json", "-o", "out", "--set", setting]);
    insta::assert_snapshot!(refused("render.exposure=bright"), @r#"
    error: --set render.exposure=bright: render.exposure: "bright" is not known here
    hint: known: `auto`
    "#);
    insta::assert_snapshot!(refused("render.exposure=1000"), @"
    error: --set render.exposure=1000: render.exposure: 1000 is above the most, 100
    hint: give a number from -100 to 100
    ");
    insta::assert_snapshot!(refused("render.tone_map=filmic"), @r#"
    error: --set render.tone_map=filmic: render.tone_map: "filmic" is not known here
    hint: known: `aces`, `agx`, `none`
    "#);
}

#[test]
fn the_background_is_transparent_on_request() {
    let bench = glowing(0.18, json!({"alpha": true, "samples": 4}));
    bench.render(&["--set", r#"lights=[{"type": "environment", "radiance": [0.5, 0.5, 0.5]}]"#]);
    let (left, right, _) = png_ends(&bench);
    // A wall that shines by itself reflects nothing here, so the light around is seen behind it alone.
    assert_eq!((left, right), (vec![118, 118, 118, 255], vec![0; 4]));
    let alpha = bench.array("alpha");
    let backdrop = bench.array("backdrop");
    let picture = bench.array("picture");
    for (i, share) in alpha.iter().enumerate() {
        let behind = 0.5 * (1.0 - share);
        // f32 holds each to 6e-8 of itself.
        assert!((backdrop[3 * i] - behind).abs() < 1e-6, "{share}: {}", backdrop[3 * i]);
        assert!((picture[3 * i] - (behind + 0.18 * share)).abs() < 1e-6, "{share}");
    }
    assert!(alpha.iter().any(|share| *share > 0.0 && *share < 1.0), "an edge");
}

/// A quad of 2 m with a texture that shines in a few texels alone, as the lamps of real assets do,
/// and a lamp as `KHR_lights_punctual` has it.
fn asset(emission: Option<f64>, lamp: Option<Value>) -> Bench {
    let bench = Bench::new();
    let mut model = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "m.bin", "byteLength": 80}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 32}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "mode": 5,
                                     "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0}}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    });
    if let Some(strength) = emission {
        model["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
        model["materials"][0]["emissiveTexture"] = json!({"index": 0});
        model["materials"][0]["extensions"] =
            json!({"KHR_materials_emissive_strength": {"emissiveStrength": strength}});
        model["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
        model["textures"] = json!([{"source": 0}]);
        model["images"] = json!([{"uri": "e.png"}]);
    }
    if let Some(lamp) = lamp {
        model["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        model["extensions"] = json!({"KHR_lights_punctual": {"lights": [lamp]}});
        model["nodes"].as_array_mut().expect("nodes").push(json!({"translation": [0, 0, 1],
            "extensions": {"KHR_lights_punctual": {"light": 0}}}));
        model["scenes"][0]["nodes"] = json!([0, 1]);
    }
    bench.write("m.gltf", model.to_string().as_bytes());
    let numbers: [f32; 20] =
        [-1., -1., 0., 1., -1., 0., -1., 1., 0., 1., 1., 0., 0., 1., 1., 1., 0., 0., 1., 0.];
    bench.write("m.bin", &numbers.map(f32::to_le_bytes).concat());
    let mut texels = vec![0_u8; 32 * 32 * 3];
    texels[..9].fill(255);
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 32, 32);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&texels).expect("an image");
    drop(writer);
    bench.write("e.png", &file);
    bench
}

/// Renders the asset by light and gives the notes and the mean of the picture where it is hit.
fn seen(bench: &Bench, more: &[&str]) -> (String, f64) {
    let fixed = [
        "render",
        "m.gltf",
        "-o",
        "out",
        "--layers",
        "coverage",
        "--samples",
        "16",
        "--set",
        "tracer.type=path",
        "--set",
        "camera.sensor.resolution=[32,32]",
    ];
    let output = bench.run(&[&fixed[..], more].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let hit = bench.array("coverage");
    let picture = bench.array("picture");
    let lit = picture.chunks(3).zip(&hit).filter(|(_, hit)| **hit == 1.0);
    let sum: f64 = lit.map(|(rgb, _)| rgb[1]).sum();
    (text(&output.stderr), sum / hit.iter().sum::<f64>())
}

#[test]
fn a_few_glowing_texels_do_not_put_the_studio_out() {
    let (notes, mean) = seen(&asset(Some(1.0), None), &[]);
    assert!(notes.contains("grey studio") && notes.contains("name `lights`"), "{notes}");
    assert!(mean > 0.1, "the model is seen: {mean}");
    // A scene that asks for no light gets none, and hears about it.
    let (notes, mean) = seen(&asset(Some(1.0), None), &["--set", "lights=[]"]);
    assert!(mean < 0.01, "{mean}");
    assert!(notes.contains("no light reaches") && notes.contains("`lights`"), "{notes}");
}

#[test]
fn a_picture_too_dark_to_see_is_told_with_the_key_that_mends_it() {
    for (exposure, dark) in [("0", true), ("auto", false), ("9", false)] {
        let bench = glowing(0.0005, json!({}));
        let setting = format!("render.exposure={exposure}");
        bench.render(&["--set", &setting, "--report", "report.json"]);
        let notes = bench.json("report.json")["notes"].to_string();
        let told = notes.contains("is black") && notes.contains("render.exposure=auto");
        assert_eq!(told, dark, "{exposure}: {notes}");
    }
}

#[test]
fn lamps_that_light_the_model_are_all_there_is() {
    // One candela a metre before the wall: irradiance of 1 lx at its middle, radiance of 1/pi.
    let lamp = |candela: f64| json!({"type": "point", "intensity": candela});
    let (notes, mean) = seen(&asset(None, Some(lamp(1.0))), &[]);
    assert!(!notes.contains("studio"), "{notes}");
    assert!((0.05..0.32).contains(&mean), "{mean}");
    // In real candela the picture is white, and a note says which key mends it; the key does.
    let (notes, _) = seen(&asset(None, Some(lamp(5000.0))), &[]);
    assert!(notes.contains("clipped") && notes.contains("render.exposure=auto"), "{notes}");
    let (notes, _) = seen(&asset(None, Some(lamp(5000.0))), &["--set", "render.exposure=auto"]);
    assert!(!notes.contains("clipped") && !notes.contains("is black"), "{notes}");
    // Where the lamp turns its back on it, the model is lit by the studio.
    let away = json!({"type": "spot", "intensity": 10, "spot": {"outerConeAngle": 0.5}});
    let bench = asset(None, Some(away));
    let text = std::fs::read_to_string(bench.path("m.gltf")).expect("the model");
    let mut model: Value = serde_json::from_str(&text).expect("JSON");
    model["nodes"][1]["rotation"] = json!([0, 1, 0, 0]);
    bench.write("m.gltf", model.to_string().as_bytes());
    let (notes, mean) = seen(&bench, &[]);
    assert!(notes.contains("grey studio"), "{notes}");
    assert!(mean > 0.1, "{mean}");
}
