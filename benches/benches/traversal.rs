//! Speed of rays: primary ones (one a pixel, and sixteen samples of one pixel), such as have nothing to do with each
//! other, and shadow rays.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_benches::contest::{Query, time_of};
use etendue_benches::field::{Field, Rays, Reference, contestants};
use etendue_benches::rays::View;
use etendue_benches::{meshes, rays};

fn sets(field: &Field) -> Vec<(&'static str, Rays)> {
    let bounds = field.geometry.bounds();
    let view = View::framing(bounds);
    let primary = view.primary();
    let shadows = rays::occlusion(&field.embree, &field.geometry, &primary);
    vec![
        ("primary-1-sample", Rays::new(primary, Query::Closest)),
        ("primary-16-samples", Rays::new(view.samples(), Query::Closest)),
        ("incoherent", Rays::new(rays::incoherent(bounds, 1 << 18), Query::Closest)),
        ("occlusion", Rays::new(shadows, Query::Occluded)),
    ]
}

fn traversal(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("traversal");
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

criterion_group!(benches, traversal);
criterion_main!(benches);
