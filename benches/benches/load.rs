//! Time from a model's file to its mesh.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_benches::files::Format;
use etendue_benches::meshes;
use etendue_scene::import::{Options, Wanted, import};

fn load(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut group = criterion.benchmark_group("load");
    group.sample_size(10);
    for (mesh, triangles) in [("blob-100k", 100_000), ("blob-1M", 1_000_000)] {
        let geometry = meshes::blob(triangles).expect("a blob of so many triangles");
        for format in Format::ALL {
            let path = folder.path().join(mesh).with_extension(format.extension());
            format.write(&path, &geometry).expect("the model is written");
            group.throughput(Throughput::Elements(triangles));
            group.bench_function(BenchmarkId::new(format.extension(), mesh), |b| {
                b.iter(|| import(&path, Wanted::NOTHING, &Options::default()).expect("it reads"));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, load);
criterion_main!(benches);
