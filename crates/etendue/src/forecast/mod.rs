//! Forecast of the time of a render, by stage, before it is begun.
//!
//! Counts of the plan times what this machine takes for each of them, which a short [`Calibration`] has
//! measured and the machine keeps. What rays cost in this very scene no count tells: where its structure is
//! built in a moment, some strips of its picture are traced with a few samples, and what they took is carried to
//! all rows and samples.

mod calibration;
mod kept;
mod pilot;

use std::time::{Duration, Instant};

use etendue_accel::BuildOptions;
use etendue_render::{Images, Plan, Stopping, build, build_without};
use etendue_report::{Decision, DecisionKind, DecisionValue, Span, listed};
use etendue_scene::Scene;
use etendue_scene::file::TracerSpec;
use etendue_sensor::SensorKind;
use etendue_tracer::LayerSpec;
use serde::Serialize;

pub use self::calibration::Calibration;
use self::pilot::Pilot;
use crate::{Error, Prospect};

/// The longest build (s), by the machine's rates, that is done for a forecast.
const LONGEST_BUILD: f64 = 1.0;

/// The longest that parts of the picture are traced for one: where rays take as long as in a pile of triangles in one
/// place, they are counted instead.
const LONGEST_PILOT: Duration = Duration::from_secs(3);

/// The most bytes of images that are decoded for one.
const MOST_IMAGES: u64 = 256 << 20;

/// The time that a render will take (s), by stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimeForecast {
    /// Reading the scene, its models and its images.
    pub load: f64,
    /// Building the acceleration structure.
    pub build: f64,
    /// Tracing rays and filling layers.
    pub trace: f64,
    /// The sensor's images of the light, with their files.
    pub sensor: f64,
    /// The views of a light field, and its white image.
    pub views: f64,
    /// Writing the layers.
    pub output: f64,
    /// All of it.
    pub total: f64,
    /// True if parts of the picture were traced; else rays were only counted.
    pub is_piloted: bool,
}

impl TimeForecast {
    /// By counts and the machine's rates alone; nothing is traced.
    #[must_use]
    pub fn counted(prospect: &Prospect<'_>, machine: &Calibration) -> Self {
        let Prospect { scene, plan, load, .. } = *prospect;
        let trace = match plan.stopping {
            Stopping::Time(time) => scene.slots.max(1) as f64 * time.as_secs_f64(),
            _ => plan.rays as f64 * machine.ray,
        };
        let views = 0.0;
        let build = build_time(scene, plan, machine);
        let (sensor, output) = (sensor(scene, plan, machine), output(prospect, machine));
        Self { load, build, trace, sensor, views, output, total: 0.0, is_piloted: false }.summed()
    }

    /// As [`Self::counted`], with parts of the picture traced where its structure is built and its images are
    /// decoded in a moment, and where it can be rendered at all.
    #[must_use]
    pub fn new(prospect: &Prospect<'_>, machine: &Calibration) -> Self {
        let counted = Self::counted(prospect, machine);
        let textures = prospect.scene.textures.iter();
        let images: u64 = textures.map(|texture| texture.decoded_bytes()).sum();
        if counted.build > LONGEST_BUILD || images > MOST_IMAGES {
            return counted;
        }
        // What is wrong with the scene, its render will say.
        Self::piloted(prospect, counted).unwrap_or(counted)
    }

    fn piloted(prospect: &Prospect<'_>, counted: Self) -> Result<Self, Error> {
        let Prospect { scene, plan, .. } = *prospect;
        let start = Instant::now();
        let threads = rayon::current_num_threads();
        let options = BuildOptions { threads, ..BuildOptions::default() };
        let accel = match &plan.unseen {
            Some(unseen) => build_without(unseen, scene, plan, &options)?,
            None => build(scene, plan, &options)?,
        };
        let build = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let images = Images::decode(scene, plan, None)?;
        let load = counted.load + start.elapsed().as_secs_f64();
        let until = Instant::now() + LONGEST_PILOT;
        // As far as what is taken of a tolerance follows light.
        let mut followed = scene.clone();
        let fewer = plan.taken.as_ref().and_then(|taken| taken.bounces);
        if let (Some(fewer), Some(TracerSpec::Path { max_bounces })) = (fewer, &mut followed.tracer)
        {
            *max_bounces = fewer.bounces;
        }
        let pilot = Pilot { scene: &followed, accel: &*accel, images: &images, until };
        let slots = scene.slots.max(1) as f64;
        let trace = match plan.stopping {
            Stopping::Time(time) => slots * time.as_secs_f64(),
            _ => slots * pilot.picture(plan.light_camera(scene))?,
        };
        let views = match (scene.camera.lens(), scene.camera.reference_views()) {
            (Some(_), Ok(views)) if scene.picture.is_some() => {
                pilot.picture(&views)? + pilot.white()?
            }
            _ => 0.0,
        };
        Ok(Self { load, build, trace, views, is_piloted: true, ..counted }.summed())
    }

    /// The stages in words.
    #[must_use]
    pub fn stages(&self) -> String {
        let Self { load, build, trace, sensor, views, output, .. } = *self;
        let always = [("load", load), ("build", build), ("trace", trace)].map(Some);
        let some = [("sensor", sensor), ("views", views)].map(|of| (of.1 > 0.0).then_some(of));
        let stages = always.into_iter().chain(some).chain([Some(("output", output))]);
        listed(stages.flatten().map(|(name, time)| format!("{name} {}", Span(time))))
    }

    /// As an entry of the plan's list.
    #[must_use]
    pub fn decision(&self) -> Decision {
        let by = match self.is_piloted {
            true => "by this machine's rates and strips of the picture",
            false => "by this machine's rates and the plan's counts",
        };
        let total = DecisionValue::Seconds(self.total);
        Decision::new(DecisionKind::Time, total, format!("{}; {by}", self.stages()))
    }

    fn summed(self) -> Self {
        let Self { load, build, trace, sensor, views, output, .. } = self;
        Self { total: load + build + trace + sensor + views + output, ..self }
    }
}

/// The time of the build (s).
fn build_time(scene: &Scene, plan: &Plan, machine: &Calibration) -> f64 {
    let unseen = plan.unseen.as_ref();
    let unseen = unseen.map_or([0; 2], |unseen| [unseen.triangles(), unseen.placements() as u64]);
    let triangles = scene.geometry.triangles_unique().saturating_sub(unseen[0]);
    let copies = scene.placed_copies().saturating_sub(unseen[1]);
    triangles as f64 * machine.build_of(plan.quality) + copies as f64 * machine.placed_copy
}

fn pixels(scene: &Scene) -> f64 {
    let [width, height] = scene.camera.resolution().map(f64::from);
    width * height
}

/// The time of the exposures and their files (s).
fn sensor(scene: &Scene, plan: &Plan, machine: &Calibration) -> f64 {
    let Some(sensor) = scene.sensor.as_ref().filter(|_| scene.picture.is_some()) else {
        return 0.0;
    };
    let shots = sensor.shots().count() as f64;
    let noise = machine.noise(sensor.noise());
    let channels = match sensor.spec().kind {
        SensorKind::Raw => machine.raw + noise,
        SensorKind::Rgb => machine.rgb + noise * 3.0,
        SensorKind::Multispectral => sensor.depth() as f64 * (machine.rgb / 3.0 + noise),
    };
    // Light comes to the sensor band by band.
    let bands = plan.bands.count() as f64 / 3.0;
    pixels(scene) * shots * channels * bands.max(1.0).sqrt()
}

/// The time of writing the layers (s).
fn output(prospect: &Prospect<'_>, machine: &Calibration) -> f64 {
    let Prospect { scene, plan, outputs, .. } = *prospect;
    let planes = |layer: &LayerSpec| match *layer == LayerSpec::Variance || layer.is_light() {
        true => plan.bands.count().max(3),
        false => layer.row().channels.len(),
    };
    let values: usize = plan.layers.iter().map(planes).sum();
    let each =
        |wanted: bool, rate: f64, count: usize| if wanted { rate * count as f64 } else { 0.0 };
    let formats =
        [outputs.exr, outputs.npy, outputs.png].into_iter().filter(|&wanted| wanted).count();
    let together = if formats > 1 { machine.together } else { 1.0 };
    pixels(scene)
        * together
        * (each(outputs.exr, machine.exr, values)
            + each(outputs.npy, machine.npy, values)
            + each(outputs.png, machine.png, plan.layers.len()))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::{Progress, Session};

    const RATES: Calibration = Calibration {
        build: [1e-7, 2e-7, 4e-7],
        placed_copy: 5e-6,
        ray: 1e-7,
        exr: 0.0,
        npy: 0.0,
        png: 0.0,
        together: 1.0,
        raw: 0.0,
        rgb: 0.0,
        noise: [0.0; 2],
    };

    #[test]
    fn copies_are_built_as_often_as_they_are_seen() {
        // Ninety copies of a box in a row before the camera, and ten behind it, which depth alone does not build.
        let places: Vec<_> = (0..100).map(|i| json!({ "translate": [0, 0, 30 - 3 * i] })).collect();
        let scene = json!({
            "etendue": 1, "layers": ["depth"], "plan": { "build_quality": "medium" },
            "camera": { "type": "pinhole", "sensor": { "resolution": [32, 24] },
                        "pose": { "from": [0, 0, 1.5], "look_at": [0, 0, 0] } },
            "objects": [{ "shape": "box", "instances": places }],
        });
        let build = |more: Option<bool>| {
            let mut scene = scene.clone();
            scene["plan"]["unseen"] = json!(more);
            let mut session = Session::from_json(".", scene).unwrap();
            let prospect = session.prospect(&Progress::none()).unwrap();
            TimeForecast::counted(&prospect, &RATES).build
        };
        // Twelve triangles of the box, and as many copies.
        let all = 12.0 * 2e-7 + 100.0 * 5e-6;
        assert!((build(Some(true)) - all).abs() < 1e-12);
        assert!((build(None) - (all - 10.0 * 5e-6)).abs() < 1e-12);
    }
}
