//! Calibration: the time that this machine takes for a triangle, a ray, a pixel of a file.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use etendue_accel::Quality;
use etendue_render::output::Outputs;
use etendue_sensor::NoiseModel;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::{Error, Phase, Progress, Rendering, Session};

/// Triangles of the mesh that is built.
const TRIANGLES: u32 = 100_000;

/// Copies of the mesh that is placed often.
const COPIES: u32 = 10_000;

/// Columns and rows of the pictures.
const RESOLUTION: [u32; 2] = [256, 192];

/// Number of times that files are written: the fastest counts, which nothing else has disturbed.
const TIMES: usize = 3;

/// The rates of a machine: seconds for each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// A triangle of a structure of low, medium and high quality.
    pub build: [f64; 3],
    /// A copy of a mesh in a structure, apart from others.
    pub placed_copy: f64,
    /// A ray of light.
    pub ray: f64,
    /// A value of an EXR.
    pub exr: f64,
    /// A value of an array.
    pub npy: f64,
    /// A pixel of a layer's picture.
    pub png: f64,
    /// Time of all three together, against one after the other.
    pub together: f64,
    /// A pixel of a raw sensor's files, without noise.
    pub raw: f64,
    /// A pixel of a colour sensor's files, without noise.
    pub rgb: f64,
    /// A pixel's noise, exact and by the normal approximation.
    pub noise: [f64; 2],
}

impl Calibration {
    /// A triangle of a structure of this quality (s).
    #[must_use]
    pub fn build_of(&self, quality: Quality) -> f64 {
        let [low, medium, high] = self.build;
        match quality {
            Quality::Low => low,
            Quality::Medium => medium,
            Quality::High => high,
        }
    }

    /// A pixel's noise (s).
    pub(super) fn noise(&self, model: NoiseModel) -> f64 {
        let [poisson, normal] = self.noise;
        match model {
            NoiseModel::Poisson => poisson,
            NoiseModel::Normal => normal,
            NoiseModel::None => 0.0,
        }
    }

    /// True if every rate is a time.
    pub(super) fn is_sound(&self) -> bool {
        let Self { build, placed_copy, ray, exr, npy, png, together, raw, rgb, noise } = *self;
        let all = [placed_copy, ray, exr, npy, png, raw, rgb].into_iter().chain(build).chain(noise);
        all.into_iter().all(|rate| (0.0..1.0).contains(&rate)) && (0.0..=1.0).contains(&together)
    }

    /// Measures this machine, in a second or so: small scenes are rendered and written into `folder`.
    ///
    /// # Errors
    ///
    /// When they cannot be; a fault of this program or of the folder.
    pub(super) fn measure(folder: &Path) -> Result<Self, Error> {
        let mut build = [0.0; 3];
        for (time, quality) in build.iter_mut().zip(["low", "medium", "high"]) {
            let plan = json!({ "build_quality": quality });
            let done = rendered(&json!({ "plan": plan, "layers": ["depth"] }))?;
            *time = done.report().seconds.build / f64::from(TRIANGLES);
        }
        // Apart, since what touches is looked at for coplanar triangles; and built whether or not they are seen.
        let places: Vec<Value> = (0..COPIES)
            .map(|i| json!({ "translate": [3 * (i % 100), 3 * (i / 100), 0] }))
            .collect();
        let copies = json!([{ "shape": "box", "instances": places }]);
        let all = json!({ "unseen": true });
        let done = rendered(&json!({ "objects": copies, "layers": ["depth"], "plan": all }))?;
        let placed_copy = done.report().seconds.build / f64::from(COPIES);
        let lit = rendered(&json!({
            "tracer": { "type": "path", "max_bounces": 4 }, "layers": ["depth", "normal"],
            "render": { "samples": 4 }, "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
        }))?;
        let report = lit.report();
        let ray = report.seconds.render / report.rays.max(1) as f64;
        let pixels: f64 = RESOLUTION.map(f64::from).iter().product();
        let only = |outputs: Outputs| writing(&lit, folder, outputs).map(|(time, _)| time);
        let nothing = only(Outputs::NONE)?;
        // Red, green, blue, a depth, and three numbers of a normal, in three layers.
        let (values, layers) = (7.0 * pixels, 3.0 * pixels);
        let beyond = |time: f64| (time - nothing).max(0.0);
        let exr = beyond(only(Outputs { exr: true, ..Outputs::NONE })?);
        let npy = beyond(only(Outputs { npy: true, ..Outputs::NONE })?);
        let png = beyond(only(Outputs { png: true, ..Outputs::NONE })?);
        let together = beyond(only(Outputs::ALL)?) / (exr + npy + png).max(f64::MIN_POSITIVE);
        let (exr, npy, png) = (exr / values, npy / values, png / layers);
        let exposed = |kind: &str, noise: &str| -> Result<f64, Error> {
            let sensor = json!({ "type": kind, "noise": noise, "resolution": RESOLUTION,
                "quantum_efficiency": 0.6, "read_noise": 2, "bit_depth": 12, "system_gain": 0.5 });
            let scene = json!({ "tracer": { "type": "facing" }, "sensor": sensor });
            Ok(writing(&rendered(&scene)?, folder, Outputs::ALL)?.1 / pixels)
        };
        let [raw, rgb] = [exposed("raw", "none")?, exposed("rgb", "none")?];
        let noise = [exposed("raw", "poisson")?, exposed("raw", "normal")?];
        let noise = noise.map(|time| (time - raw).max(0.0));
        Ok(Self {
            build,
            placed_copy,
            ray,
            exr,
            npy,
            png,
            together: together.min(1.0),
            raw,
            rgb,
            noise,
        })
    }
}

/// A blob before a camera, with `more` of a scene.
fn rendered(more: &Value) -> Result<Rendering, Error> {
    let mut scene = json!({
        "objects": [{ "shape": "blob", "triangles": TRIANGLES, "seed": 1 }],
        "camera": { "type": "pinhole", "fov": 40, "sensor": { "resolution": RESOLUTION },
                    "pose": { "from": [0.3, 0.8, 3.2], "look_at": [0, 0, 0] } },
    });
    for (key, value) in more.as_object().into_iter().flatten() {
        match key.as_str() {
            "sensor" => scene["camera"]["sensor"] = value.clone(),
            _ => scene[key] = value.clone(),
        }
    }
    Session::from_json(".", scene)?.render(&Progress::none())
}

/// The least time (s) of writing a rendering's layers, and of its exposures.
fn writing(rendering: &Rendering, folder: &Path, outputs: Outputs) -> Result<(f64, f64), Error> {
    let mut least = (f64::INFINITY, f64::INFINITY);
    for _ in 0..TIMES {
        let (layers, exposures) = written(rendering, folder, outputs)?;
        least = (least.0.min(layers), least.1.min(exposures));
    }
    Ok(least)
}

/// The times (s) of writing once.
fn written(rendering: &Rendering, folder: &Path, outputs: Outputs) -> Result<(f64, f64), Error> {
    let begun: Arc<Mutex<Option<Instant>>> = Arc::default();
    let first = Arc::clone(&begun);
    let progress = Progress::new(move |phase, _| {
        if phase == Phase::Expose {
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(Instant::now);
        }
        true
    });
    crate::places::folder(folder)?;
    let start = Instant::now();
    rendering.write_with(folder, outputs, &progress)?;
    let end = Instant::now();
    let middle = begun.lock().unwrap_or_else(PoisonError::into_inner).unwrap_or(end);
    Ok(((middle - start).as_secs_f64(), (end - middle).as_secs_f64()))
}
