//! Surfaces that shine unevenly or are partly there, in blocks of rays and in batches.

use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_tracer::material::Alpha;

use super::{BANDS, LAMP, POINTS, compare_plain, on_floor, room, room_of, save_cube, save_waves};
use crate::steps::{channels, load_in, prepare, trace};

/// Scenes of surfaces that shine unevenly, or are too many to be kept ready, are the same in blocks and batches, as they
/// are seen and as they give light.
#[test]
fn plain_surfaces_that_shine_unevenly_are_the_same_in_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 20);
    save_cube(folder.path());
    let path = r#"{"type": "path", "max_bounces": 5}"#;
    let tiles = LAMP.replace("lamp", "tiles");
    let both = format!(
        r#"{LAMP}, {{"shape": "rectangle", "material": "screen", "width": 1.4, "height": 0.9,
            "transform": {{"rotate": [0, 1, 0, 50], "translate": [-1.2, 1.1, 0.4]}}}}"#
    );
    // Behind the camera, so that it is seen in the mirror alone.
    let mirrored = format!(
        r#"{LAMP}, {{"shape": "rectangle", "material": "screen", "width": 3, "height": 2,
            "transform": {{"translate": [0, 1.2, 4.5]}}}},
            {{"shape": "rectangle", "material": "mirror", "width": 3, "height": 2,
            "transform": {{"translate": [0, 1, -1.2]}}}}"#
    );
    let hung = |shape: &str| {
        let place = r#""transform": {"scale": 0.3, "translate": [-0.4, 1.4, 0.6]}}"#;
        format!(r#"{tiles}, {{"shape": "{shape}, {place}"#)
    };
    let boxes = hung(r#"box", "material": "tiles""#);
    let crowd = hung(r#"blob", "triangles": 70000, "material": "lamp""#);
    for (name, materials, tracer, lights, lamps) in [
        ("tiles", ["red", "green"], path, "", &tiles),
        ("a screen", ["green", "coated"], path, "", &both),
        ("a screen in a mirror", ["red", "green"], path, "", &mirrored),
        ("all lights", ["copper", "printed"], path, POINTS, &both),
        ("seen in mirrors and glass", ["mirror", "glass"], path, "", &both),
        ("a cube", ["gold", "mirror"], path, "", &both),
        ("a box", ["mirror", "gold"], path, POINTS, &boxes),
        ("too many", ["gold", "green"], r#"{"type": "direct"}"#, "", &crowd),
    ] {
        for ball in ["sphere", "box"] {
            let mut text = room_of(materials, [tracer, lights, lamps, ball])
                .replace(r#""layers": ["direct", "indirect"],"#, "");
            if name == "a cube" {
                let of_image = r#""image": "waves.png", "factor": [3, 5, 4], "repeat": [2, 3]"#;
                text = text.replace(of_image, &format!(r#""cube": "around.npy", {BANDS}"#));
            }
            let scene = load_in(folder.path(), &on_floor(ball, text));
            compare_plain(&format!("plain and uneven, {name}, {ball}"), &scene, &[""]);
        }
    }
}

#[test]
fn a_lamp_that_is_half_there_shines_half_as_much() {
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 0);
    let lit = |radiance: f64, factor: f64| {
        let lamp = LAMP.replace("\"lamp\"", "\"shining\"");
        let text = room(r#"{"type": "path", "max_bounces": 1}"#, "", &lamp, "sphere");
        let shining = format!(
            r#""shining": {{"type": "emissive", "radiance": [{radiance}, 1, 0.5]}}, "lamp""#
        );
        let mut scene = load_in(folder.path(), &text.replacen("\"lamp\"", &shining, 1));
        let shining = scene.materials.iter_mut().find(|material| material.name == "shining");
        shining.unwrap().alpha = if factor < 1.0 { Alpha::Blend { factor } } else { Alpha::Opaque };
        let plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
        let (accel, images) = prepare(&scene, &plan);
        let done = trace(&scene, &plan, &*accel, &images);
        channels(&done.picture, "")[0].iter().sum::<f64>()
    };
    for factor in [0.5, 0.1] {
        let [whole, partly] = [lit(9.0 * factor, 1.0), lit(9.0, factor)];
        // 37 thousand samples, of which each that finds the lamp is off by less than what it finds.
        assert!((partly / whole - 1.0).abs() < 0.01, "{factor}: {partly} {whole}");
    }
}
