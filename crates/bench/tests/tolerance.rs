//! Differences of models of a lens, where a closed form tells it.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

use std::path::Path;

use etendue_accel::BuildOptions;
use etendue_bench::BenchError;
use etendue_bench::tolerance::{Comparison, ModelError, Tolerance, compare};
use etendue_render::output::Outputs;
use etendue_render::{Plan, build, plan};
use etendue_scene::LoadOptions;
use etendue_scene::file::SceneFile;
use serde_json::{Value, json};

/// A wall 3 m before a camera.
fn compared(camera: &Value, tolerance: Tolerance) -> Result<Comparison, BenchError> {
    compared_with(camera, tolerance, None)
}

/// Comparison of a camera's models, with a thing before it.
fn compared_with(
    camera: &Value,
    tolerance: Tolerance,
    thing: Option<Value>,
) -> Result<Comparison, BenchError> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    compared_in(&scenes, camera, tolerance, thing)
}

/// Comparison of a camera's models, with scenes in a folder.
fn compared_in(
    folder: &Path,
    camera: &Value,
    tolerance: Tolerance,
    thing: Option<Value>,
) -> Result<Comparison, BenchError> {
    let mut camera = camera.clone();
    camera["pose"] = json!({ "from": [1, 2, 3], "look_at": [1, 2, 0] });
    let scene = json!({
        "camera": camera, "tracer": { "type": "facing" },
        "objects": [{ "shape": "rectangle", "width": 40, "height": 40 }],
    });
    let mut scene = scene;
    scene["objects"].as_array_mut().unwrap().extend(thing);
    let file = SceneFile::from_json(&LoadOptions::default().opener, folder, scene).unwrap();
    let scene = file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default()).unwrap();
    let own = Plan::new(&scene, Outputs::ALL);
    let accel = build(&scene, &own, &BuildOptions::default()).unwrap();
    compare(&scene, &*accel, tolerance, &|_| true)
}

fn model<'a>(all: &'a Comparison, name: &str) -> &'a ModelError {
    all.models.iter().find(|finding| finding.model.name() == name).unwrap()
}

fn thin_lens() -> Value {
    json!({ "type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 2,
            "sensor_height": 24, "sensor": { "resolution": [150, 100] } })
}

/// A thin lens of 25 mm, focused at 2 m, sees a point at 3 m in a disk of 25 mm · (1/2 − 1/3) per metre,
/// whose root mean square radius is its radius over the root of 2. Its corners get the light of a disk of
/// finite size, which is a little more than cos⁴ (P. Foote, "Illumination from a radiating disk", 1915).
#[test]
fn a_pinhole_lacks_the_blur_and_falloff_of_a_thin_lens_and_nothing_else() {
    let all = compared(&thin_lens(), Tolerance { pixels: 0.2, light: None }).unwrap();
    let image = 1.0 / (1.0 / 50.0 - 1.0 / 2000.0);
    let focal = image / 0.24;
    let blur = focal * 0.0125 / 2.0_f64.sqrt() * (1.0 / 2.0 - 1.0 / 3.0);
    let corner = (75.0_f64 / focal).powi(2) + (50.0 / focal).powi(2);
    let pupil = (12.5_f64 / image).powi(2);
    let root = (corner * corner + 2.0 * corner * (1.0 - pupil) + (1.0 + pupil).powi(2)).sqrt();
    let light = 0.5 * (1.0 - (1.0 + corner - pupil) / root);
    let falloff = 1.0 - light / (pupil / (1.0 + pupil));
    for name in ["pinhole", "opencv"] {
        let pinhole = model(&all, name);
        // Of 1024 places of the pupil, weighed by the angle at which each is seen.
        assert!(
            (pinhole.blur.value / blur - 1.0).abs() < 0.02,
            "{} for {blur}",
            pinhole.blur.value
        );
        assert!((pinhole.light.value - falloff).abs() < 0.002, "{:?} {falloff}", pinhole.light);
        assert!(pinhole.chief_ray.value < 1e-6 && pinhole.colour.value < 1e-9, "{pinhole:?}");
        assert!((pinhole.blur.depth.unwrap() - 3.0).abs() < 1e-9, "{:?}", pinhole.blur);
        assert!(!pinhole.is_within);
    }
    for name in ["thin", "thick", "full"] {
        let own = model(&all, name);
        assert!(own.blur.value < 1e-9 && own.light.value < 1e-9 && own.is_within, "{own:?}");
    }
    assert_eq!((all.cheapest.name(), all.depths.len()), ("thin", 2));
    assert!(all.models.iter().all(|m| m.seconds_a_sample.is_some()));
}

/// A ball of three pixels, and one of half a pixel, 0.6 m before a camera that looks at a wall, wherever it stands: its parallax and blur count.
#[test]
fn small_near_things_are_seen() {
    // A pixel of 0.24 mm behind 50 mm covers 2.8 mm there.
    let places = [[0.011, 0.003], [-0.071, 0.042], [0.1234, -0.0871], [0.0327, 0.0611]];
    for (place, radius) in places.into_iter().flat_map(|at| [(at, 0.0043), (at, 0.0007)]) {
        let ball = json!({ "shape": "sphere", "radius": radius, "triangles": 320,
            "transform": { "translate": [1.0 + place[0], 2.0 + place[1], 2.4] } });
        let all = compared_with(&thin_lens(), Tolerance { pixels: 0.35, light: None }, Some(ball))
            .unwrap();
        assert!((all.depths[0] - 0.6).abs() < 0.005, "{place:?}: {:?}", all.depths);
        // A pinhole is within it for the wall alone.
        assert_eq!(all.cheapest.name(), "thin", "{place:?}");
    }
}

#[test]
fn the_tolerance_decides_which_model_is_the_cheapest() {
    let cheapest = |pixels, light| {
        compared(&thin_lens(), Tolerance { pixels, light }).unwrap().cheapest.name()
    };
    // The blur is 0.31 pixels and the corners lack 26 % of the light.
    assert_eq!(cheapest(0.3, None), "thin");
    assert_eq!(cheapest(0.35, None), "pinhole");
    // A pinhole with the falloff of the lens has its light, and not its blur.
    assert_eq!(cheapest(0.35, Some(0.2)), "falloff");
    assert_eq!(cheapest(0.3, Some(0.2)), "thin");
    assert_eq!(cheapest(0.35, Some(0.4)), "pinhole");
}

/// The double Gauss at f/11: distortion is what a thin lens lacks, and OpenCV's model has.
#[test]
fn opencv_has_the_distortion_that_other_models_lack() {
    let camera = json!({ "type": "lens", "lens": "lenses/double-gauss.json", "f_number": 11,
        "focus_distance": 3, "sensor_height": 24, "sensor": { "resolution": [720, 480] } });
    let all = compared(&camera, Tolerance { pixels: 1.0, light: None }).unwrap();
    let chief = |name| model(&all, name).chief_ray.value;
    assert!(chief("opencv") < 0.2, "{}", chief("opencv"));
    for name in ["pinhole", "thin", "thick"] {
        assert!((chief(name) / chief("pinhole") - 1.0).abs() < 1e-3, "{name}: {}", chief(name));
        assert!(chief(name) > 5.0 * chief("opencv"), "{name}: {}", chief(name));
    }
    let full = model(&all, "full");
    let all_zero = [full.chief_ray, full.centroid, full.blur, full.colour, full.light];
    assert!(all_zero.iter().all(|worst| worst.value == 0.0), "{full:?}");
    // A lens of glass has colours where ideal lenses have none; as at one wavelength it has nothing else amiss.
    assert!(model(&all, "thick").colour.value > 0.01);
    let undispersed = model(&all, "undispersed");
    assert_eq!(undispersed.chief_ray.value, 0.0);
    let worst = |found: &ModelError| {
        let all = [found.chief_ray, found.centroid, found.blur, found.colour];
        all.map(|worst| worst.value).into_iter().fold(0.0, f64::max)
    };
    assert!(undispersed.colour.value > 0.01, "{undispersed:?}");
    assert!(worst(undispersed) < worst(model(&all, "opencv")), "{undispersed:?}");
}

/// The double Gauss with a mask in its stop that is open on one side: a thick lens has it, the right way up, and a mask
/// before the lens is in none.
#[test]
fn simpler_lenses_keep_the_mask_of_the_stop() {
    let folder = tempfile::tempdir().unwrap();
    let mask = folder.path().join("mask.png");
    let file = std::fs::File::create(&mask).unwrap();
    let mut png = png::Encoder::new(file, 2, 2);
    png.set_color(png::ColorType::Grayscale);
    png.write_header().unwrap().write_image_data(&[255, 0, 0, 0]).unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let gauss = std::fs::read(scenes.join("lenses/double-gauss.json")).unwrap();
    let mut lens: Value = serde_json::from_slice(&gauss).unwrap();
    let mask = json!({ "type": "aperture", "shape": "image", "file": "mask.png", "width": 4, "thickness": 4.5 });
    let elements = lens["elements"].as_array_mut().unwrap();
    let stop = elements.iter().position(|element| element["stop"] == true).unwrap();
    elements[stop] = mask.clone();
    elements[stop]["stop"] = json!(true);
    let camera = |lens: &Value| {
        let bytes = serde_json::to_vec(lens).unwrap();
        std::fs::write(folder.path().join("lens.json"), bytes).unwrap();
        json!({ "type": "lens", "lens": "lens.json", "focus_distance": 1, "sensor_height": 2,
            "sensor": { "resolution": [150, 100] } })
    };
    let tolerance = Tolerance { pixels: 1.0, light: None };
    let all = compared_in(folder.path(), &camera(&lens), tolerance, None).unwrap();
    // The corner of the mask that is open is 1 mm to two sides of the axis: the light of a wall beyond the focus lies as
    // far to a side of the chief ray, which a mask that is upside down or round would not have. The entrance pupil is 1.46
    // times as large as the stop, the wall 3 m away and the image 52.6 mm: 1.46 √2 mm · 52.6 mm (1/1 m - 1/3 m) = 3.6
    // pixels of 0.02 mm; distances are counted from the lens' middle, hence a tenth.
    let [pinhole, thick] = ["pinhole", "thick"].map(|name| model(&all, name));
    assert!((pinhole.centroid.value - 3.6).abs() < 0.36, "{pinhole:?}");
    // What is left are the lens' aberrations, by which blur differs as much; a mask upside down would be 7 pixels off, one
    // a tenth too large 0.4.
    assert!(thick.centroid.value < 0.2, "{thick:?}");
    assert!(thick.is_within, "{thick:?}");
    assert!(all.scenes.iter().any(|scene| scene.to_string().contains("mask.png")));
    // Elsewhere it is lost, and said to be.
    let mut before = lens.clone();
    before["elements"][stop] = json!({ "type": "aperture", "shape": "circular", "radius": 8.55,
        "thickness": 4.5, "stop": true });
    before["elements"].as_array_mut().unwrap().insert(0, mask);
    let all = compared_in(folder.path(), &camera(&before), tolerance, None).unwrap();
    assert!(!model(&all, "thick").is_within && !model(&all, "thin").is_within);
    assert!(all.notes.iter().any(|note| note.contains("mask")), "{:?}", all.notes);
}

#[test]
fn cameras_without_a_lens_to_simplify_are_refused() {
    for camera in [
        json!({ "type": "pinhole", "fov": 40, "sensor": { "resolution": [30, 20] } }),
        json!({ "type": "light_field", "focal_length": 35, "f_number": 2, "focus_distance": 0.8,
            "microlenses": { "pitch": 0.09 },
            "sensor": { "resolution": [60, 45], "pixel_pitch": 6 } }),
    ] {
        match compared(&camera, Tolerance { pixels: 0.5, light: None }) {
            Err(BenchError::NoLens(_)) => {}
            other => panic!("{other:?}"),
        }
    }
}
