//! The steps from a scene's text to a picture's numbers, which most tests take.

use std::path::Path;

use etendue_accel::{Accel, AccelName, BuildOptions};
use etendue_files::Opener;
use etendue_geometry::HitPrecision;
use etendue_render::output::{Outputs, Picture, Values};
use etendue_render::{Images, Plan, Rendered, build, plan, render};
use etendue_scene::file::SceneFile;
use etendue_scene::{LoadOptions, Scene, SceneError};
use etendue_tracer::{Emission, Paint};
use serde_json::Value;

/// The scene `text` as a file in `folder`, where what it names is looked for.
pub(crate) fn read(folder: &Path, text: &str) -> Result<SceneFile, SceneError> {
    let path = folder.join("scene.json");
    std::fs::write(&path, text).unwrap();
    SceneFile::read(&path, &[])
}

fn loaded(file: &SceneFile) -> Scene {
    file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default()).unwrap()
}

pub(crate) fn load_in(folder: &Path, text: &str) -> Scene {
    loaded(&read(folder, text).unwrap())
}

/// A scene that names no files.
pub(crate) fn load(text: &str) -> Scene {
    load_in(tempfile::tempdir().unwrap().path(), text)
}

pub(crate) fn load_json(folder: &Path, scene: Value) -> Scene {
    loaded(&SceneFile::from_json(&Opener::default(), folder, scene).unwrap())
}

/// A surface that shines by 1 on both sides.
pub(crate) fn glow() -> Emission {
    let radiance = Paint::Plain([1.0; 3]);
    Emission {
        radiance,
        strength: 1.0,
        illuminant: None,
        two_sided: true,
        group: None,
        modulation: None,
    }
}

/// Prepares what rays meet: the structure, and images without a fault.
pub(crate) fn prepare(scene: &Scene, plan: &Plan) -> (Box<dyn Accel>, Images) {
    let accel = build(scene, plan, &BuildOptions::default()).unwrap();
    let images = Images::decode(scene, plan, None).unwrap();
    assert!(images.faults.is_empty(), "{:?}", images.faults);
    (accel, images)
}

/// The picture, whose every number is finite.
pub(crate) fn trace(scene: &Scene, plan: &Plan, accel: &dyn Accel, images: &Images) -> Rendered {
    let done = render(scene, plan, accel, images, Vec::new(), &|_: f64| true).unwrap();
    assert_eq!(done.light.not_finite, 0);
    done
}

/// All steps behind loading.
pub(crate) fn rendered(scene: &Scene, plan: &Plan) -> Rendered {
    let (accel, images) = prepare(scene, plan);
    trace(scene, plan, &*accel, &images)
}

/// The picture of light alone.
pub(crate) fn picture(scene: &Scene) -> Picture {
    rendered(scene, &Plan::new(scene, Outputs::from_list("exr").unwrap())).picture
}

/// The plan of a scene that names no accelerator, by the precision of the hits of its light: in f64, and in f32 where
/// the accelerator that is taken finds hits in that.
pub(crate) fn plans(scene: &Scene) -> Vec<Plan> {
    let plan = Plan::new(scene, Outputs::from_list("exr").unwrap());
    let single = AccelName::best().has_single().then_some(HitPrecision::Single);
    let precisions = [HitPrecision::Double].into_iter().chain(single);
    precisions.map(|light_precision| Plan { light_precision, ..plan.clone() }).collect()
}

/// The pictures of light alone by each of [`plans`], with the precision.
pub(crate) fn pictures(scene: &Scene) -> Vec<(HitPrecision, Picture)> {
    let pictured = |plan: &Plan| (plan.light_precision, rendered(scene, plan).picture);
    plans(scene).iter().map(pictured).collect()
}

/// The values of each channel of a layer, "" being the picture itself.
pub(crate) fn channels(picture: &Picture, layer: &str) -> Vec<Vec<f64>> {
    let channels = &picture.layer(layer).unwrap().channels;
    let values = channels.iter().map(|channel| &channel.values);
    values.map(|values| (0..values.len()).map(|i| values.at(i)).collect()).collect()
}

/// The bits of every value of every layer.
pub(crate) fn bits(picture: &Picture) -> Vec<u64> {
    let channels = picture.layers().iter().flat_map(|layer| &layer.channels);
    let bits = channels.flat_map(|channel| match &channel.values {
        Values::F32(values) => values.iter().map(|v| u64::from(v.to_bits())).collect::<Vec<_>>(),
        Values::F64(values) => values.iter().map(|v| v.to_bits()).collect(),
        Values::U16(values) => values.iter().map(|v| u64::from(*v)).collect(),
        Values::U32(values) => values.iter().map(|v| u64::from(*v)).collect(),
    });
    bits.collect()
}

/// Values of a layer's channels, one after the other.
pub(crate) fn layer(picture: &Picture, name: &str) -> Vec<f64> {
    channels(picture, name).concat()
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
