//! Rays per second through the double Gauss (11 elements) on one thread: in batches, and ray by ray
//! through the same arithmetic; and through arrays of lenslets, against plain surfaces in their places.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use etendue_optics::element::{Clip, LensRays};
use etendue_optics::train::{
    ExitPupil, Focus, LensFile, MonochromaticTrain, OpticalTrain, Registers, Side,
};
use glam::{DVec2, DVec3};

/// Tracing of a batch of rays through a train.
type Way = fn(&MonochromaticTrain, &mut LensRays);

/// A tile's worth of rays.
const RAYS: u32 = 512;

fn lens(text: &str) -> OpticalTrain {
    let file = LensFile::from_json(text).expect("a preset reads");
    file.build(&|name: &str| Err(format!("{name}: presets have no files")))
        .expect("a preset builds")
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

/// Ten spheres that all rays pass, as mirrors that face each other or as surfaces between glass and air.
fn spheres(are_mirrors: bool) -> OpticalTrain {
    let element = |i: u32| {
        let sign = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
        let (radius, thickness) = (1e4 * sign, 100.0);
        match are_mirrors {
            true => format!(
                r#"{{"type": "mirror", "radius": {radius}, "thickness": {}}}"#,
                sign * thickness
            ),
            false => {
                let glass = if sign < 0.0 { r#", "glass": {"n": 1.5}"# } else { "" };
                format!(
                    r#"{{"type": "surface", "radius": {radius}, "thickness": {thickness}{glass}}}"#
                )
            }
        }
    };
    let elements: Vec<String> = (0..10).map(element).collect();
    lens(&format!(r#"{{"elements": [{}]}}"#, elements.join(", ")))
}

/// Cost of a mirror beside a surface, and of a gradient beside both.
fn mirrors(criterion: &mut Criterion) {
    let rod = include_str!("../../../scenes/lenses/selfoc-relay.json");
    let mut group = criterion.benchmark_group("ten_spheres");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    for (name, train, radius) in [
        ("surfaces", spheres(false), 10.0),
        ("mirrors", spheres(true), 10.0),
        ("selfoc-rod", lens(rod), 0.3),
    ] {
        let at = train.at(train.wavelength()).expect("glasses have indices");
        let rays = beam(radius);
        group.bench_function(name, |bencher| {
            let mut work = rays.clone();
            bencher.iter(|| {
                work.clone_from(&rays);
                at.trace(Side::Object, Clip::On, black_box(&mut work));
            });
        });
    }
    group.finish();
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

/// Lenses with lenslets behind them, and the same with as many plain surfaces: the light of a disk of the
/// sensor that all of them pass, as a camera traces it.
fn lenslets(criterion: &mut Criterion) {
    let before = r#"{"type": "aperture", "shape": "circular", "radius": 9, "stop": true},
        {"type": "thin_lens", "focal_length": 50, "thickness": 50}"#;
    let array = |keys: &str, glass: &str, gap: f64| {
        format!(
            r#"{{"type": "microlens_array", "size": [12, 12], "pitch": 0.1, "thickness": {gap},
                {keys} {glass}}}"#
        )
    };
    let thin = |keys: &str| array(keys, r#""focal_length": 0.4"#, 0.4);
    let face = |keys: &str| {
        let front = array(keys, r#""radius": 0.2, "glass": "N-BK7""#, 0.3);
        format!(r#"{front}, {{"type": "surface", "thickness": 0.2}}"#)
    };
    let trains = [
        ("thin/plain", r#"{"type": "thin_lens", "focal_length": 900, "thickness": 0.4}"#.to_owned()),
        ("thin/square", thin("")),
        ("thin/hexagonal", thin(r#""grid": "hexagonal", "rotation": 2,"#)),
        ("thin/round", thin(r#""grid": "hexagonal", "aperture": "round", "gaps": "clear","#)),
        (
            "thin/three-types",
            thin(r#""types": [{"focal_length": 0.4}, {"focal_length": 0.41}, {"focal_length": 0.42}],"#)
                .replace(r#", "focal_length": 0.4}"#, "}"),
        ),
        (
            "thick/plain",
            r#"{"type": "surface", "radius": 200, "semi_diameter": 9, "glass": "N-BK7",
                "thickness": 0.3}, {"type": "surface", "thickness": 0.2}"#
                .to_owned(),
        ),
        ("thick/square", face("")),
        ("thick/hexagonal", face(r#""grid": "hexagonal","#)),
        (
            "thick/three-types",
            face(r#""types": [{"radius": 0.2}, {"radius": 0.21}, {"radius": 0.22}],"#)
                .replace(r#""radius": 0.2, "glass""#, r#""glass""#),
        ),
        ("thick/conic", face(r#""conic": -0.5,"#)),
    ];
    let mut group = criterion.benchmark_group("microlenses");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    for (name, rear) in trains {
        let train = lens(&format!(r#"{{"elements": [{before}, {rear}]}}"#));
        let at = train.at(train.wavelength()).expect("glasses have indices");
        let z = train.sensor_z(Focus::AsWritten).expect("as written");
        let pupil = ExitPupil::new(&train, &[587.56], z, [2.0, 1.5]).expect("light passes");
        let mut rays = LensRays::with_capacity(RAYS as usize);
        let unit = |i: u32, step: f64| (0.5 + step * f64::from(i)).fract();
        // Rays that pass, so that all trains have the same work.
        for i in 0..40 * RAYS {
            let r =
                [0.856_674_883, 0.733_891_857, 0.628_706_721, 0.538_597_270].map(|a| unit(i, a));
            let film = (2.0 * DVec2::new(r[0], r[1]) - 1.0) * DVec2::new(2.0, 1.5);
            let Some(sample) = pupil.sample(film, [r[2], r[3]], 587.56) else { continue };
            let mut one = LensRays::with_capacity(1);
            one.push(pupil.film_point(film), sample.direction);
            at.trace(Side::Sensor, Clip::On, &mut one);
            if one.exited() == 1 && rays.len() < RAYS as usize {
                rays.push(pupil.film_point(film), sample.direction);
            }
        }
        assert_eq!(rays.len(), RAYS as usize, "{name}");
        let mut work = rays.clone();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                work.clone_from(black_box(&rays));
                at.trace(Side::Sensor, Clip::On, &mut work);
            });
        });
        assert_eq!(work.exited(), RAYS as usize, "{name}: every ray passes every check");
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
            pupil.push_rays(black_box(&film), &u, 587.56, &mut rays);
        });
    });
    group.finish();
}

criterion_group!(benches, transfer, mirrors, lenslets, pupil);
criterion_main!(benches);
