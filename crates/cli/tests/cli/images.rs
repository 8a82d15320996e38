//! Textures and environments of every kind and size.

use crate::run::{Bench, text, under};

/// A plane under an environment, or that shines itself, seen whole; `rest` has lights and materials.
fn plane(rest: &str) -> Bench {
    Bench::with_scene(&format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 1}},
        "render": {{"samples": 64}},
        "camera": {{"type": "orthographic", "height": 1, "sensor": {{"resolution": [4, 4]}},
                    "pose": {{"from": [0, 0, 3], "look_at": [0, 0, 0]}}}},
        "objects": [{{"shape": "rectangle", "width": 4, "height": 4, "material": "m"}}], {rest}}}"#
    ))
}

const UNDER_A_SKY: &str = r#""lights": [{"type": "environment", "image": "sky.hdr"}],
    "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;

/// A Radiance file of 2 × 1 texels of 64 in every colour.
fn radiance(header: &str) -> Vec<u8> {
    let mut file = format!("{header}\n\n-Y 1 +X 2\n").into_bytes();
    file.extend([64, 64, 64, 136, 64, 64, 64, 136]);
    file
}

/// A sky of one radiance L lights a matte plane to ρ L.
#[test]
fn skies_of_every_program_shine_as_their_headers_say() {
    let cases = [
        ("#?RADIANCE\nFORMAT=32-bit_rle_rgbe", 64.0),
        ("#?RGBE\nFORMAT=32-bit_rle_rgbe", 64.0),
        ("#?RGBE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=4\nEXPOSURE=2", 8.0),
    ];
    for (header, sky) in cases {
        let bench = plane(UNDER_A_SKY);
        bench.write("sky.hdr", &radiance(header));
        bench.render(&[]);
        let picture = bench.array("picture");
        let mean = picture.iter().sum::<f64>() / picture.len() as f64;
        // 1024 samples, whose spread is that of the cosine: below 1 %.
        assert!((mean / (0.5 * sky) - 1.0).abs() < 0.03, "{header}: {mean}");
    }
}

#[test]
fn a_sky_of_luminance_alone_is_grey() {
    let bench = plane(&UNDER_A_SKY.replace("sky.hdr", "sky.exr"));
    let channels =
        exr::prelude::SpecificChannels::build().with_channel("Y").with_pixel_fn(|_| (8.0_f32,));
    let image = exr::prelude::Image::from_channels((8, 4), channels);
    exr::prelude::WritableImage::write(&image).to_file(bench.path("sky.exr")).expect("an EXR");
    bench.render(&[]);
    let picture = bench.array("picture");
    let mean = picture.iter().sum::<f64>() / picture.len() as f64;
    assert!((mean / 4.0 - 1.0).abs() < 0.03, "{mean}");
}

#[test]
fn skies_that_are_none_are_refused() {
    let skies: [(&str, &[u8]); 3] = [
        ("words", b"not a sky"),
        ("XYZ", b"#?RGBE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n\x40\x40\x40\x88"),
        ("no exposure", b"#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n\x40\x40\x40\x88"),
    ];
    let messages = skies.map(|(what, sky)| {
        let bench = plane(UNDER_A_SKY);
        bench.write("sky.hdr", sky);
        under(what, &bench.refusal(&["render", "scene.json", "-o", "out"]))
    });
    insta::assert_snapshot!(messages.concat());
}

#[test]
fn large_images_are_refused_by_their_size_before_they_are_decoded() {
    let rest = r#""lights": [{"type": "environment"}],
        "materials": {"m": {"type": "matte", "color": {"image": "large.png"}}}"#;
    let cases: [(u32, &[&str], &str); 3] = [
        (32_768, &[], "32768 x 32768 texels, which take 3.22 GB"),
        (65_536, &[], "32768 a side are the most"),
        (16_384, &["--memory-limit", "100M"], "--memory-limit"),
    ];
    for (side, arguments, words) in cases {
        let bench = plane(rest);
        let file = header_of_png(side, png::ColorType::Rgb);
        bench.write("large.png", &file);
        let command = [&["render", "scene.json", "-o", "out", "--strict"], arguments].concat();
        let output = bench.run(&command);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("large.png") && message.contains(words), "{words}: {message}");
    }
}

/// The start of a PNG of `side` × `side` grey or coloured texels, and none of them: what is judged is
/// the size alone.
fn header_of_png(side: u32, color: png::ColorType) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side, side);
    encoder.set_color(color);
    drop(encoder.write_header().expect("a header"));
    // Signature and header; then a chunk of the texels without any.
    file.truncate(33);
    file.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
    file
}

#[test]
fn images_that_a_scene_names_are_refused_when_they_are_too_large() {
    let grey = r#""materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;
    let texture = r#""lights": [{"type": "environment"}],
        "materials": {"m": {"type": "matte", "color": {"image": "huge.png"}}}"#;
    let sky = format!(r#""lights": [{{"type": "environment", "image": "huge.png"}}], {grey}"#);
    let mask = Bench::with_scene(&format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path"}}, {grey},
        "objects": [{{"shape": "sphere", "material": "m"}}],
        "camera": {{"type": "lens", "focus_distance": 3, "sensor": {{"resolution": [4, 4]}},
            "lens": {{"elements": [{{"type": "thin_lens", "focal_length": 50, "semi_diameter": 10}},
                {{"type": "aperture", "shape": "image", "file": "huge.png", "width": 10,
                 "height": 10}}]}}}}}}"#
    ));
    let rgb = || header_of_png(32_768, png::ColorType::Rgb);
    let cases = [
        ("texture", plane(texture), rgb()),
        ("sky", plane(&sky), rgb()),
        ("mask", mask, header_of_png(32_768, png::ColorType::Grayscale)),
    ];
    for (what, bench, file) in cases {
        bench.write("huge.png", &file);
        let output = bench.run(&["render", "scene.json", "-o", "out"]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{what}: {message}");
        assert!(message.contains("huge.png"), "{what}: {message}");
        assert!(message.contains("32768 x 32768 texels"), "{what}: {message}");
        assert!(!bench.path("out").exists(), "{what} left a folder");
    }
}

#[test]
fn textures_shine_as_bright_and_are_as_fine_as_their_files() {
    let shining = |file: &str, encoding: &str| {
        plane(&format!(
            r#""lights": [], "materials": {{"m": {{"type": "emissive",
                "radiance": {{"image": "{file}", "encoding": "{encoding}"}}}}}}"#
        ))
    };
    let bench = shining("lamp.exr", "srgb");
    exr::prelude::write_rgb_file(bench.path("lamp.exr"), 4, 4, |_, _| (12.5_f32, 0.25, 0.003))
        .expect("an EXR file");
    bench.render(&[]);
    for pixel in bench.array("picture").chunks(3) {
        // Floats are linear, and f32 keeps 0.003 to 2⁻²⁴.
        for (own, known) in pixel.iter().zip([12.5, 0.25, 0.003]) {
            assert!((own / known - 1.0).abs() < 1e-6, "{pixel:?}");
        }
    }
    let bench = shining("fine.png", "linear");
    let fine = [1_000_u16, 20_001, 65_534].map(u16::to_be_bytes).concat();
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&fine).expect("the texel");
    writer.finish().expect("the file");
    bench.write("fine.png", &file);
    bench.render(&[]);
    for pixel in bench.array("picture").chunks(3) {
        for (own, known) in pixel.iter().zip([1_000.0, 20_001.0, 65_534.0]) {
            assert!((own / (known / 65_535.0) - 1.0).abs() < 1e-6, "{pixel:?}");
        }
    }
}
