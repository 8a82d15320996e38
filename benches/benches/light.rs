//! Time of the tracers of light: a matte blob through a thin lens, under a point light and under an area light, by
//! direct light and by paths.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_accel::BuildOptions;
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, plan};
use etendue_scene::{LoadOptions, SceneFile};

const POINT: &str = r#"{"type": "point", "at": [1, 2, 1.5], "intensity": [8, 8, 8]}"#;
const LAMP: &str = r#", {"shape": "rectangle", "material": "lamp",
    "transform": {"translate": [0.5, 2, 0.5], "rotate": [1, 0, 0, 90]}}"#;

/// The scene of a light and a tracer.
fn scene(lights: &str, lamp: &str, tracer: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {tracer}, "lights": [{lights}], "render": {{"samples": 16}},
        "camera": {{"type": "thin_lens", "focal_length": 50, "f_number": 2.8, "fov": 28,
            "focus_distance": 2.4, "pose": {{"from": [0.7, 0.9, 2.6], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": [256, 256]}}}},
        "objects": [{{"shape": "blob", "triangles": 1000000, "radius": 0.5, "material": "clay"}}
            {lamp}],
        "materials": {{"clay": {{"type": "matte", "color": [0.8, 0.4, 0.3]}},
            "lamp": {{"type": "emissive", "radiance": [6, 6, 6]}}}}}}"#
    )
}

fn light(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut group = criterion.benchmark_group("light");
    group.sample_size(10);
    let tracers =
        [("direct", r#"{"type": "direct"}"#), ("path", r#"{"type": "path", "max_bounces": 5}"#)];
    for (name, tracer) in tracers {
        for (light, lights, lamp) in [("point", POINT, ""), ("area", "", LAMP)] {
            let path = folder.path().join("scene.json");
            std::fs::write(&path, scene(lights, lamp, tracer)).expect("the scene is written");
            let file = SceneFile::read(&path, &[]).expect("the scene is understood");
            let wanted = plan::wanted(&file.spec.all_layers());
            let scene = file.load(wanted, &LoadOptions::default()).expect("the scene loads");
            let plan = Plan::new(&scene, Outputs { exr: true, ..Outputs::NONE });
            let options = BuildOptions::default();
            let accel = etendue_render::build(&scene, &plan, &options).expect("it builds");
            let images = Images::decode(&scene, &plan, None).unwrap();
            group.throughput(Throughput::Elements(256 * 256 * 16));
            group.bench_function(BenchmarkId::new(name, light), |b| {
                b.iter(|| {
                    etendue_render::render(
                        &scene,
                        &plan,
                        &*accel,
                        &images,
                        Vec::new(),
                        &|_: f64| true,
                    )
                    .expect("nothing stops it")
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, light);
criterion_main!(benches);
