//! How fast are primary rays: one a pixel, and sixteen samples of one pixel?

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_benches::contest::{Query, time_of};
use etendue_benches::field::{Field, Rays, Reference, contestants};
use etendue_benches::meshes;
use etendue_benches::rays::View;

fn sets(field: &Field) -> Vec<(&'static str, Rays)> {
    let geometry = &field.geometry;
    let view = View::framing(geometry.bounds());
    vec![
        ("1-sample", Rays::new(view.primary(), Query::Closest)),
        ("16-samples", Rays::new(view.samples(), Query::Closest)),
    ]
}

fn primary(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("primary");
    group.sample_size(10);
    let blob = |triangles| meshes::blob(triangles).expect("a blob of so many triangles");
    let scenes = [
        ("blob-100k", blob(100_000)),
        ("blob-1M", blob(1_000_000)),
        ("soup-1M", meshes::soup(1_000_000)),
    ];
    for (mesh, geometry) in scenes {
        let field = Field::build(&geometry, Reference::Included).expect("everything builds");
        for (set, rays) in sets(&field) {
            for (name, contestant) in contestants(&field, &rays) {
                group.throughput(Throughput::Elements(contestant.rays() as u64));
                group.bench_function(BenchmarkId::new(name, format!("{mesh}/{set}")), |b| {
                    b.iter_custom(|times| time_of(&*contestant, times));
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, primary);
criterion_main!(benches);
