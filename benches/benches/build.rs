//! Time to build each structure, on all cores.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_accel::limit::{BareScene, Mode};
use etendue_accel::{Accel, BuildOptions, Bvh, Embree, Exact, Quality};
use etendue_benches::meshes;

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("build");
    group.sample_size(10);
    let sizes = [("blob-100k", 100_000), ("blob-1M", 1_000_000), ("blob-10M", 10_000_000)];
    for (mesh, triangles) in sizes {
        let geometry = meshes::blob(triangles).expect("a blob of so many triangles");
        group.throughput(Throughput::Elements(triangles));
        for (name, quality) in [("low", Quality::Low), ("medium", Quality::Medium)] {
            let mode = Mode { quality, compact: false };
            group.bench_function(BenchmarkId::new(format!("limit-{name}"), mesh), |b| {
                b.iter(|| black_box(BareScene::build(Arc::clone(&geometry), mode, 0)).is_ok());
            });
            let options = BuildOptions { quality, ..BuildOptions::default() };
            group.bench_function(BenchmarkId::new(format!("embree-{name}"), mesh), |b| {
                b.iter(|| black_box(Embree::build(Arc::clone(&geometry), &options)).is_ok());
            });
        }
        let options = BuildOptions::default();
        group.bench_function(BenchmarkId::new("bvh", mesh), |b| {
            b.iter(|| Bvh::build(Arc::clone(&geometry), &options).map(|bvh| bvh.report()));
        });
        if triangles <= 1_000_000 {
            group.bench_function(BenchmarkId::new("exact", mesh), |b| {
                b.iter(|| {
                    Exact::build(Arc::clone(&geometry), &options).map(|exact| exact.report())
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
