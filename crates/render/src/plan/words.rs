//! The plan's decisions in words: what, how, why, what it saves, and by which key it is made otherwise.

use std::fmt;

use etendue_accel::Quality;
use etendue_camera::{LensCamera, Projection};
use etendue_geometry::{HitPrecision, Placement};
use etendue_scene::Scene;
use etendue_scene::file::{LightPrecision, TracerRow, TracerSpec};
use etendue_scene::memory::Size;
use etendue_sensor::BandChoice;
use etendue_tracer::layer::Kept;
use etendue_tracer::{LayerSpec, Needs};
use serde::Serialize;

use super::{
    MOST_BYTES_OF_SUMS, Passes, Plan, RAYS_A_SAMPLE_OF_LIGHT, RAYS_PER_TRIANGLE, quality_for,
};
use crate::film::Precision;
use crate::{expose, samples};

/// A decision: one value, its reason, and how to overrule it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// What is decided.
    pub what: &'static str,
    /// How.
    pub choice: String,
    /// Why.
    pub because: String,
    /// What it saves beside the fullest choice, counted; `None` where that has no number before the render.
    pub saves: Option<String>,
    /// The path in the scene file that decides it otherwise.
    pub key: Option<&'static str>,
    /// Whether the scene has decided it.
    pub forced: bool,
}

/// The key of a decision, whether the scene gives it, and what the decision saves.
struct Overruling {
    key: &'static str,
    forced: bool,
    saves: Option<String>,
}

impl Plan {
    /// What the rays are for.
    fn ray_words(&self, passes: Passes) -> String {
        let seen = match (passes.centre, passes.mean) {
            (true, true) => Some(format!(
                "the chief ray of each pixel for data layers, {} samples a pixel for colours",
                self.samples
            )),
            (false, true) => Some(format!("{} samples a pixel for colours", self.samples)),
            (true, false) => Some(match passes.light {
                true => "the chief ray of each pixel for data layers".to_owned(),
                false => {
                    format!("the chief ray of each pixel serves all {} layers", self.layers.len())
                }
            }),
            (false, false) => None,
        };
        let lit = passes.light.then(|| {
            format!(
                "{} samples of light a pixel, counted as {RAYS_A_SAMPLE_OF_LIGHT} rays each",
                self.samples
            )
        });
        let parts: Vec<String> = seen.into_iter().chain(lit).collect();
        parts.join("; ")
    }

    pub(super) fn explain(
        &self,
        scene: &Scene,
        chosen: &BandChoice,
        (needs, passes): (Needs, Passes),
        (triangles, why_precision): (u64, String),
    ) -> Vec<Decision> {
        let mut decisions = Vec::new();
        let mut decide = |what, choice: &str, because: String| {
            let choice = choice.to_owned();
            decisions.push(Decision {
                what,
                choice,
                because,
                saves: None,
                key: None,
                forced: false,
            });
        };
        let on = |yes| if yes { "on" } else { "off" };
        // What is traced: rays, samples, passes, wavelengths, the sensor, the lens.
        decide("rays", &self.rays.to_string(), self.ray_words(passes));
        if passes.mean || passes.light {
            let note = self.stopping_note.as_ref();
            let (choice, because) = self.stopping.words(scene.render.samples, note);
            decide("samples", &choice, because);
        }
        if let Some((choice, because)) = self.explain_passes(passes) {
            decide("passes", &choice, because);
        }
        let (bands, because) = expose::explain_bands(scene, chosen);
        decide("wavelengths", &bands, because);
        if let Some((choice, because)) = expose::explain_sensor(scene) {
            decide("sensor", &choice, because);
        }
        let lens = self.explain_lens(scene).into_iter().chain(self.band_paths.words());
        for (what, choice, because) in self.explain_denoising().into_iter().chain(lens) {
            decide(what, choice, because);
        }
        // What is asked of surfaces and lights.
        let (choice, because) = light_words(scene, needs);
        decide("shadows and bounces", &choice, because);
        for (what, choice, because) in surface_words(needs) {
            decide(what, on(choice), because);
        }
        if needs.light {
            let (choice, because) = source_words(scene);
            decide("lights", &choice, because);
        }
        for (what, choice, because) in self.explain_textures(scene, needs) {
            decide(what, choice, because);
        }
        // How exactly, and in how much memory.
        let (choice, because) = self.explain_quality(scene, triangles);
        decide("build quality", choice, because);
        decide(
            "refinement",
            on(self.refine),
            either(
                self.refine,
                "hits found in f32 are solved again in f64: data are as exact as the file's numbers",
                "the scene takes f32's hits as they are",
            ),
        );
        decide(
            "data layers",
            if self.precision == Precision::Single { "32 bits" } else { "64 bits" },
            either(
                self.precision == Precision::Single,
                "an EXR holds no more",
                "NPY files hold what was computed",
            ),
        );
        if needs.light || self.averages_colors() {
            let choice = match self.light_precision {
                HitPrecision::Single => "32 bits",
                HitPrecision::Double => "64 bits",
            };
            decide(if needs.light { "light paths" } else { "sampled hits" }, choice, why_precision);
        }
        let memory = self.memory.to_string();
        let (total, parts) = memory.split_once(" (").unwrap_or((&memory, ""));
        decide("memory", total, parts.replacen(')', "", 1));
        // Which of these a key of the scene overrules.
        for decision in &mut decisions {
            if let Some(Overruling { key, forced, saves }) = self.overruling(scene, decision.what) {
                (decision.key, decision.forced, decision.saves) = (Some(key), forced, saves);
            }
        }
        decisions
    }

    /// Whether colours of surfaces are averaged over samples.
    fn averages_colors(&self) -> bool {
        let is_color = |layer: &LayerSpec| layer.is_averaged() && !layer.is_light();
        self.samples > 1 && self.layers.iter().any(is_color)
    }

    /// How a decision is overruled, and what it saves.
    fn overruling(&self, scene: &Scene, what: &str) -> Option<Overruling> {
        let spec = &scene.plan;
        let by = |key, forced, saves| Some(Overruling { key, forced, saves });
        match what {
            "samples" => by("render.samples", false, None),
            "materials and textures" => {
                let bytes = scene.textures.iter().map(|texture| texture.decoded_bytes()).sum();
                let saved = (self.images.is_none() && bytes > 0)
                    .then(|| format!("{} of {} images", Size(bytes), scene.textures.len()));
                by("plan.textures", spec.textures.is_some(), saved)
            }
            "rays of a wavelength" => by("plan.dispersion", spec.dispersion.is_some(), None),
            "paths of a band" => by("plan.shared_paths", spec.shared_paths.is_some(), None),
            "texture filter" => by("plan.texture_filter", spec.texture_filter.is_some(), None),
            "build quality" => by("plan.build_quality", spec.build_quality.is_some(), None),
            "refinement" => by("plan.refine", spec.refine.is_some(), None),
            "light paths" | "sampled hits" => {
                let forced = spec.light_precision != LightPrecision::Auto;
                by("plan.light_precision", forced, None)
            }
            "data layers" => {
                let [width, height] = scene.camera.resolution().map(u64::from);
                let planes = self.layers.iter().filter(|layer| layer.row().kept == Kept::Measured);
                let planes: u64 = planes.map(|layer| layer.row().channels.len() as u64).sum();
                let is_single = self.precision == Precision::Single && planes > 0;
                let saved = is_single.then(|| Size(4 * planes * width * height).to_string());
                by("--outputs", false, saved)
            }
            _ => None,
        }
    }

    /// How often the film is gone over, where samples are averaged.
    fn explain_passes(&self, passes: Passes) -> Option<(String, String)> {
        if !passes.mean && !passes.light {
            return None;
        }
        let because = match &self.passes[..] {
            [first, ..] if self.stopping.is_adaptive() => format!(
                "at most: the picture can be seen after {} samples a pixel, and is judged where they are \
                 a power of two",
                first.end
            ),
            [first, .., last] => format!(
                "the picture can be seen after {} samples a pixel, and a stop loses {} at most",
                first.end,
                last.len()
            ),
            _ if samples::passes(self.samples).len() > 1 => {
                format!("the sums of several would take more than {} MiB", MOST_BYTES_OF_SUMS >> 20)
            }
            _ => "too few samples to look at some of them".to_owned(),
        };
        Some((self.passes.len().to_string(), because))
    }

    fn explain_quality(&self, scene: &Scene, triangles: u64) -> (&'static str, String) {
        let what = format!("{} rays over {triangles} triangles:", self.rays);
        let pays = format!("{RAYS_PER_TRIANGLE} a triangle or more pay for a better structure");
        let own = quality_for(self.rays, triangles);
        let because = match own {
            Quality::Low => {
                let less = format!("under {RAYS_PER_TRIANGLE} a triangle, a better structure");
                format!("{what} {less} would not pay for its build")
            }
            Quality::Medium | Quality::High => format!("{what} {pays}"),
        };
        match scene.plan.build_quality {
            Some(_) => {
                let own = quality_name(own);
                (quality_name(self.quality), format!("it would be {own} by itself: {because}"))
            }
            None => (quality_name(self.quality), because),
        }
    }

    /// What is read of materials, and how images are looked up.
    fn explain_textures(
        &self,
        scene: &Scene,
        needs: Needs,
    ) -> Vec<(&'static str, &'static str, String)> {
        // Whether materials are looked at, and their images with them.
        let because = match (needs.materials, scene.textures.len()) {
            (true, n) if needs.light => format!("light is scattered by them; {n} images named"),
            (true, n) => format!("a layer shows base colour; {n} images named"),
            (false, _) => "no layer shows colour; no image is decoded".to_owned(),
        };
        let (on, because) = match (needs.materials, scene.plan.textures) {
            (true, Some(false)) => {
                let n = scene.textures.len();
                ("without images", format!("surfaces have their factors alone; {n} images named"))
            }
            (needed, _) => (if needed { "on" } else { "off" }, because),
        };
        let mut decisions = vec![("materials and textures", on, because)];
        // How images are filtered.
        if self.images.is_some() {
            let reason = match (self.footprint, scene.plan.texture_filter) {
                (true, _) => "the camera tells what a sample covers",
                (false, Some(false)) => "the scene takes images at the very points that were hit",
                (false, _) => "the camera does not tell what a pixel covers",
            };
            let reason = reason.to_owned();
            let choice = if self.footprint { "footprint" } else { "none" };
            decisions.push(("texture filter", choice, reason));
        }
        decisions
    }

    /// What becomes of the picture's noise, where something does.
    fn explain_denoising(&self) -> Option<(&'static str, &'static str, String)> {
        let because = "--denoise: by Open Image Denoise, which is guided by the layers MeanAlbedo and \
                       MeanNormal; the picture and the sensor's images keep their noise";
        self.denoised.then(|| ("denoising", "a layer beside the picture", because.to_owned()))
    }

    /// How wavelengths and the pupil of the camera's lens are sampled.
    fn explain_lens(&self, scene: &Scene) -> [(&'static str, &'static str, String); 2] {
        let lens = scene.camera.lens();
        let groups = scene.camera.band_groups(&self.bands).len();
        let each = lens.map_or(1, |lens| lens.wavelengths_a_group(&self.bands));
        let apart = groups > 1 || each > 1;
        let rays = if apart && self.pupil { "their own" } else { "shared" };
        let disperses = lens.is_some_and(|lens| lens.focused().train().is_dispersive());
        let is_forced = scene.plan.dispersion == Some(false) && disperses && !apart;
        let because_apart = match is_forced {
            true => "the scene takes the lens as at its design wavelength; else each would run its own way"
                .to_owned(),
            false => wavelengths(apart, self.pupil, each),
        };
        let (pupil, because) = match scene.camera.projection() {
            Projection::Views(_) if self.pupil => {
                ("on", "each view is averaged over its own part of the opening".to_owned())
            }
            _ => pupil(lens, self.pupil, self.samples),
        };
        [("rays of a wavelength", rays, because_apart), ("pupil", pupil, because)]
    }
}

/// One of two reasons.
fn either(yes: bool, reason: &str, other: &str) -> String {
    if yes { reason } else { other }.to_owned()
}

/// What is worked out of surfaces, and why.
fn surface_words(needs: Needs) -> [(&'static str, bool, String); 2] {
    let surface = either(
        needs.surface,
        "a layer needs normals or barycentric coordinates",
        "no layer needs more than distance and ids",
    );
    let normals = either(
        needs.normals,
        "a layer needs shading normals",
        "no layer needs shading normals; they are not read",
    );
    [("surface", needs.surface, surface), ("vertex normals", needs.normals, normals)]
}

fn quality_name(quality: Quality) -> &'static str {
    match quality {
        Quality::Low => "low",
        Quality::Medium => "medium",
        Quality::High => "high",
    }
}

/// What becomes of light, and why.
fn light_words(scene: &Scene, needs: Needs) -> (String, String) {
    match scene.tracer.filter(|_| needs.light).map(TracerSpec::row) {
        Some(TracerRow { name, light: Some(light), .. }) => {
            (light.reach, format!("the tracer is `{name}`: {}", light.shows))
        }
        Some(TracerRow { light: None, .. }) | None => {
            ("off".to_owned(), "no layer looks at light".to_owned())
        }
    }
}

/// Where light comes from.
fn source_words(scene: &Scene) -> (String, String) {
    let shines = |placement: &&Placement| {
        let material = scene.materials.get(placement.material as usize);
        material.is_some_and(|material| material.emission.is_some())
    };
    let placed = scene.geometry.placements.iter().filter(shines);
    let triangles: usize = placed.map(|p| scene.geometry.mesh_of(p).triangles.len()).sum();
    let lights = scene.lights.len();
    let words = match (lights, triangles) {
        (0, 0) => "nothing shines: the picture is black".to_owned(),
        (_, 0) => "named by the scene or its models, or chosen in their place".to_owned(),
        _ => format!("lights are chosen by power; {triangles} triangles shine too"),
    };
    let more = "; a grey studio, too, where they leave what the camera sees in the dark";
    let words = if scene.studio_if_dark { words + more } else { words };
    ((lights + triangles).to_string(), words)
}

/// Why wavelengths are traced together or apart, `each` of them a band.
fn wavelengths(apart: bool, pupil: bool, each: usize) -> String {
    match (apart, pupil, each) {
        (false, ..) => "no glass or filter of a lens tells them apart".to_owned(),
        (true, true, 1) => "the lens bends or dims each in its own way".to_owned(),
        (true, true, _) => format!(
            "the lens bends or dims each in its own way, and the widest band's samples are drawn \
             from {each} wavelengths"
        ),
        (true, false, _) => "the chief ray at the lens' design wavelength serves all".to_owned(),
    }
}

/// Whether rays are spread over a pupil, and why.
fn pupil(lens: Option<&LensCamera>, spread: bool, samples: u32) -> (&'static str, String) {
    let Some(lens) = lens else {
        return ("off", "the camera has no aperture: every ray is a chief ray".to_owned());
    };
    if !spread {
        return ("off", "no layer is a picture: data are taken along chief rays".to_owned());
    }
    let f_number = match lens.focused().paraxial().f_number {
        Some(f_number) => format!(" (f/{f_number:.2})"),
        None => String::new(),
    };
    let symmetric = lens.focused().train().is_rotationally_symmetric();
    let bound = match symmetric {
        _ if lens.lenslets().is_some() => "that of the lens before the array, through each lenslet",
        _ if lens.has_round_pupil() => "known exactly: a disk",
        true => "bounded along a radius of the sensor",
        false => "bounded on a grid of the sensor",
    };
    let noise = match samples {
        1 => {
            "; 1 sample a pixel is one ray through one place of it, which is noise wherever the \
              picture is not sharp: ask for more with `--samples` or render.samples"
        }
        _ => "",
    };
    let because = format!("colours are averaged over the lens' exit pupil{f_number}, {bound}");
    ("on", because + noise)
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.decisions.iter().map(|d| d.what.len()).max().unwrap_or(0);
        let choice = self.decisions.iter().map(|d| d.choice.len()).max().unwrap_or(0);
        for Decision { what, choice: chosen, because, saves, key, forced } in &self.decisions {
            write!(f, "{what:width$}  {chosen:choice$}  {because}")?;
            if let Some(saves) = saves {
                write!(f, "; saves {saves}")?;
            }
            match (key, forced) {
                (Some(key), true) => writeln!(f, " [forced by {key}]")?,
                (Some(key), false) => writeln!(f, " [{key}]")?,
                (None, _) => writeln!(f)?,
            }
        }
        Ok(())
    }
}
