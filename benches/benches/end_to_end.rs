//! Time from a scene to its layers, without reading or writing files.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_accel::BuildOptions;
use etendue_benches::rays::View;
use etendue_benches::{files, meshes};
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, plan};
use etendue_scene::{LoadOptions, SceneFile};

fn end_to_end(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut group = criterion.benchmark_group("end_to_end");
    group.sample_size(10);
    for (mesh, triangles) in [("blob-100k", 100_000), ("blob-1M", 1_000_000)] {
        let geometry = meshes::blob(triangles).expect("a blob of so many triangles");
        let glb = folder.path().join("blob.glb");
        files::Format::Glb.write(&glb, &geometry).expect("the model is written");
        let path = folder.path().join(mesh).with_extension("json");
        let text = files::scene("blob.glb", &View::framing(geometry.bounds())).to_string();
        std::fs::write(&path, text).expect("the scene is written");
        let file = SceneFile::read(&path, &[]).expect("the scene is understood");
        let wanted = plan::wanted(&file.spec.all_layers());
        let scene = file.load(wanted, &LoadOptions::default()).expect("the scene loads");
        let plan = Plan::new(&scene, Outputs { exr: true, ..Outputs::NONE });
        let options = BuildOptions::default();
        let images = Images::decode(&scene, &plan, None).unwrap();
        group.throughput(Throughput::Elements(plan.rays));
        group.bench_function(BenchmarkId::new("build-and-render", mesh), |b| {
            b.iter(|| {
                let accel = etendue_render::build(&scene, &plan, &options).expect("it builds");
                etendue_render::render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true)
                    .expect("nothing stops it")
            });
        });
        let accel = etendue_render::build(&scene, &plan, &options).expect("it builds");
        group.bench_function(BenchmarkId::new("render", mesh), |b| {
            b.iter(|| {
                etendue_render::render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true)
                    .expect("nothing stops it")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, end_to_end);
criterion_main!(benches);
