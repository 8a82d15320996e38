//! A picture does not depend on how its samples are divided into passes, and one that is stopped has
//! the samples that it says.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use etendue_accel::AccelName;
use etendue_render::output::{Outputs, Picture};
use etendue_render::{Plan, RenderError, Rendered, SoFar, Watch, render};
use etendue_scene::Scene;

use crate::steps::{bits, load, prepare};

/// Blobs under a sky before a wall, larger than a tile and not a multiple of it.
fn scene(tracer: &str, camera: &str, samples: u32, sampler: &str) -> Scene {
    sized([37, 21], tracer, camera, samples, sampler)
}

fn sized(resolution: [u32; 2], tracer: &str, camera: &str, samples: u32, sampler: &str) -> Scene {
    let text = format!(
        r#"{{"etendue": 1, "tracer": {tracer}, "layers": ["depth"],
        "camera": {{{camera}, "pose": {{"from": [0.5, 1, 4], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": {resolution:?}}}}},
        "materials": {{"a": {{"type": "dielectric", "ior": 1.5}},
            "b": {{"type": "matte", "color": [0.8, 0.3, 0.2]}}}},
        "lights": [{{"type": "environment", "radiance": [0.5, 0.5, 0.5]}},
            {{"type": "point", "at": [2, 3, 2], "intensity": [9, 9, 9]}}],
        "objects": [{{"shape": "blob", "triangles": 500, "material": "b"}},
            {{"shape": "sphere", "radius": 0.5, "material": "a",
              "transform": {{"translate": [0.7, 0, 1]}}}},
            {{"shape": "rectangle", "width": 9, "height": 9, "material": "b",
              "transform": {{"translate": [0, 0, -2]}}}}],
        "render": {{"samples": {samples}, "sampler": "{sampler}"}}}}"#
    );
    load(&text)
}

const PINHOLE: &str = r#""type": "pinhole", "fov": 40"#;
const PATH: &str = r#"{"type": "path", "max_bounces": 5}"#;

fn rendered(
    scene: &Scene,
    passes: Option<&[Range<u32>]>,
    watch: &dyn Watch,
) -> Result<Rendered, RenderError> {
    let mut plan = Plan::new(scene, Outputs::ALL);
    if let Some(passes) = passes {
        plan.passes = passes.to_vec();
    }
    let (accel, images) = prepare(scene, &plan);
    render(scene, &plan, &*accel, &images, Vec::new(), watch)
}

#[test]
fn one_pass_and_many_give_the_same_picture_to_the_bit() {
    let lens = r#""type": "chromatic_real_lens", "front_radius": 50, "rear_radius": -50,
        "thickness": 8, "glass": "N-BK7", "semi_diameter": 8, "fov": 40"#;
    let scenes = [
        scene(r#"{"type": "facing"}"#, PINHOLE, 32, "sobol"),
        scene(PATH, PINHOLE, 32, "sobol"),
        scene(PATH, PINHOLE, 32, "stratified"),
        scene(PATH, lens, 12, "sobol"),
    ];
    for (k, mut scene) in scenes.into_iter().enumerate() {
        for accel in AccelName::built() {
            scene.render.accel = Some(accel);
            let samples = scene.render.samples.most();
            let single: Vec<_> = std::iter::once(0..samples).collect();
            let once = rendered(&scene, Some(&single), &|_: f64| true).unwrap();
            let by_itself = rendered(&scene, None, &|_: f64| true).unwrap();
            let odd = [0..1, 1..6, 6..samples];
            let odd = rendered(&scene, Some(&odd), &|_: f64| true).unwrap();
            assert!(Plan::new(&scene, Outputs::ALL).passes.len() > 1, "scene {k}");
            for other in [by_itself, odd] {
                let (a, b) = (bits(&once.picture), bits(&other.picture));
                let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "scene {k}, {accel:?}: of {} values", a.len());
                assert_eq!(once.rays, other.rays);
            }
        }
    }
}

/// Stops in the pass after so many samples.
struct StopAfter {
    samples: u32,
    seen: AtomicU32,
}

impl Watch for StopAfter {
    fn goes_on(&self, share: f64) -> bool {
        assert!((0.0..=1.0).contains(&share), "{share}");
        self.seen.load(Ordering::Relaxed) < self.samples
    }

    fn look(&self, so_far: &SoFar<'_>) {
        let picture = so_far.picture().unwrap();
        assert_eq!(picture.layers().len(), 1, "the picture alone");
        self.seen.store(so_far.samples[0], Ordering::Relaxed);
    }
}

/// Sobol points are the same whatever their number, so a picture that is stopped after some is that of
/// as many.
#[test]
fn a_stopped_picture_is_that_of_fewer_samples() {
    for tracer in [r#"{"type": "flat"}"#, PATH] {
        let whole = scene(tracer, PINHOLE, 256, "sobol");
        let stop = StopAfter { samples: 16, seen: AtomicU32::new(0) };
        let stopped = rendered(&whole, None, &stop).unwrap();
        let fewer = rendered(&scene(tracer, PINHOLE, 16, "sobol"), None, &|_: f64| true).unwrap();
        assert_eq!((stopped.samples, fewer.samples), (16, 16));
        assert_eq!(bits(&stopped.picture), bits(&fewer.picture), "{tracer}");
        let header = |picture: &Picture, wanted: &str| {
            let entry = picture.header().iter().find(|entry| entry.key == wanted);
            entry.map(|entry| entry.text.clone())
        };
        let partial = header(&stopped.picture, "partial");
        assert_eq!(partial.as_deref(), Some("stopped after 16 of 256 samples a pixel"));
        assert_eq!(header(&stopped.picture, "samples").as_deref(), Some("16"));
        assert_eq!(header(&fewer.picture, "partial"), None);
    }
}

#[test]
fn a_picture_without_a_whole_pass_is_none() {
    let stop = StopAfter { samples: 0, seen: AtomicU32::new(0) };
    for samples in [1, 2, 64] {
        let found = rendered(&scene(PATH, PINHOLE, samples, "sobol"), None, &stop);
        assert!(matches!(found, Err(RenderError::Stopped)), "{samples}: {found:?}");
    }
}

/// Cost of passes: the least of many times, in turns, against one pass. Prints and asserts nothing:
/// `cargo nextest run -p etendue-render --run-ignored only --no-capture what_passes_cost`.
#[test]
#[ignore = "a measurement"]
fn what_passes_cost() {
    for (tracer, samples) in [(r#"{"type": "facing"}"#, 64), (PATH, 64)] {
        let scene = sized([256, 160], tracer, PINHOLE, samples, "sobol");
        let single: Vec<_> = std::iter::once(0..samples).collect();
        let mut best = [f64::INFINITY; 2];
        for _ in 0..5 {
            for (best, passes) in best.iter_mut().zip([Some(&single[..]), None]) {
                let done = rendered(&scene, passes, &|_: f64| true).unwrap();
                *best = best.min(done.trace_time.as_secs_f64());
            }
        }
        println!("{tracer}, {samples} samples: {:.3} of one pass' time", best[1] / best[0]);
    }
}
