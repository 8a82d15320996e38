//! Benchmark of the time to expose a frame of 20 megapixels, exactly and with the normal approximation.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_sensor::{Exposure, Film, NoiseModel, Sensor};
use rayon::ThreadPoolBuilder;

/// Columns and rows of a sensor of 20 megapixels.
const SIDES: [u32; 2] = [5472, 3648];

/// Full scale of the film (e⁻).
const FULL: f32 = 16_000.0;

fn sensor() -> Sensor {
    let spec = serde_json::json!({
        "type": "raw", "resolution": SIDES, "system_gain": 4095.0 / f64::from(FULL), "bit_depth": 12,
        "read_noise": 2.5, "dark_current": 1, "exposure": 0.01
    });
    let spec = serde_json::from_value(spec).expect("a sensor's keys");
    Sensor::new(&spec).expect("a sensor")
}

fn exposure(criterion: &mut Criterion) {
    let exact = sensor();
    let pixels = SIDES[0] as usize * SIDES[1] as usize;
    let shot = Exposure { exposure: 0.01, frame: 0 };
    let mut group = criterion.benchmark_group("exposure");
    group.sample_size(10).throughput(Throughput::Elements(pixels as u64));
    let even = |electrons: f32| vec![electrons / FULL; pixels];
    let ramp = (0..pixels).map(|i| i as f32 / pixels as f32).collect();
    for (light, film) in [
        ("1 e", even(1.0)),
        ("10 e", even(10.0)),
        ("40 e", even(40.0)),
        ("1000 e", even(1000.0)),
        ("0 to 16000 e", ramp),
    ] {
        for threads in [1, 2] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            for (name, noise) in [("poisson", NoiseModel::Poisson), ("normal", NoiseModel::Normal)]
            {
                let sensor = exact.clone().with_noise(noise);
                let id = BenchmarkId::new(format!("{name}, {threads} threads"), light);
                group.bench_function(id, |bencher| {
                    bencher.iter(|| {
                        pool.install(|| sensor.expose(Film { values: &film }, shot, 0))
                            .expect("the film fits")
                    });
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, exposure);
criterion_main!(benches);
