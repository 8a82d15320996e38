//! Rays per second through the double Gauss (11 elements) on one thread: in batches, and ray by ray
//! through the same arithmetic.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_optics::element::{Clip, LensRays};
use etendue_optics::train::{
    ExitPupil, Focus, LensFile, MonochromaticTrain, OpticalTrain, Registers, Side,
};
use glam::{DVec2, DVec3};

/// How a batch is taken through.
type Way = fn(&MonochromaticTrain, &mut LensRays);

/// A tile's worth of rays.
const RAYS: u32 = 512;

fn lens(text: &str) -> OpticalTrain {
    let file = LensFile::from_json(text).expect("a preset reads");
    file.build(&|name| Err(format!("{name}: presets have no files"))).expect("a preset builds")
}

/// Parallel rays over the entrance pupil, 1° off the axis: all of them pass.
fn beam(radius: f64) -> LensRays {
    let mut rays = LensRays::with_capacity(RAYS as usize);
    for i in 0..RAYS {
        // Vogel's spiral: even in area.
        let r = radius * ((f64::from(i) + 0.5) / f64::from(RAYS)).sqrt();
        let place = DVec2::from_angle(2.399_963_229_728_653 * f64::from(i)) * r;
        rays.push(place.extend(-10.0), DVec3::new(0.0, 0.02, 1.0));
    }
    rays
}

fn transfer(criterion: &mut Criterion) {
    let presets = [
        ("double-gauss", include_str!("../../../scenes/lenses/double-gauss.json"), 10.0),
        ("asphere", include_str!("../../../scenes/lenses/asphere.json"), 15.0),
    ];
    let mut group = criterion.benchmark_group("lens_transfer");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    for (name, text, radius) in presets {
        let train = lens(text);
        let at = train.at(train.wavelength()).expect("glasses have indices");
        let rays = beam(radius);
        let ways: [(&str, Way); 4] = [
            ("batch", |at, rays| at.trace(Side::Object, Clip::On, rays)),
            ("batch-avx2", |at, rays| {
                at.trace_on(Registers::FourLanes, Side::Object, Clip::On, rays);
            }),
            ("batch-baseline", |at, rays| {
                at.trace_on(Registers::Baseline, Side::Object, Clip::On, rays);
            }),
            ("singly", |at, rays| at.trace_singly(Side::Object, Clip::On, rays)),
        ];
        for (way, trace) in ways {
            let mut work = rays.clone();
            trace(&at, &mut work);
            assert_eq!(work.exited(), RAYS as usize, "{name}: every ray passes every check");
            group.bench_function(BenchmarkId::new(name, way), |bencher| {
                bencher.iter(|| {
                    work.clone_from(black_box(&rays));
                    trace(&at, &mut work);
                });
            });
        }
    }
    group.finish();
}

fn pupil(criterion: &mut Criterion) {
    let train = lens(include_str!("../../../scenes/lenses/double-gauss.json"));
    let z = train.sensor_z(Focus::Infinity).expect("it focuses");
    let measure = || ExitPupil::new(&train, &[587.56], z, [18.0, 12.0]).expect("light passes");
    criterion.bench_function("exit_pupil/measure", |bencher| bencher.iter(measure));
    let pupil = measure();
    let unit = |i: u32, step: f64| (0.5 + step * f64::from(i)).fract();
    let u: Vec<[f64; 2]> =
        (0..RAYS).map(|i| [unit(i, 0.754_877_666), unit(i, 0.569_840_290)]).collect();
    let film: Vec<DVec2> = (0..RAYS).map(|i| DVec2::new(0.03 * f64::from(i), 5.0)).collect();
    let mut group = criterion.benchmark_group("exit_pupil");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    let mut rays = LensRays::with_capacity(RAYS as usize);
    group.bench_function("sample", |bencher| {
        bencher.iter(|| {
            rays.clear();
            pupil.push_rays(black_box(&film), &u, &mut rays);
        });
    });
    group.finish();
}

criterion_group!(benches, transfer, pupil);
criterion_main!(benches);
