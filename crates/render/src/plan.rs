//! The plan: the one place where it is decided what a scene needs, and why. What is off costs
//! nothing: it is not read, not traced, not written.

use std::fmt;
use std::ops::Range;

use etendue_accel::Quality;
use etendue_camera::{LensCamera, Projection};
use etendue_geometry::{Detail, HitPrecision, Placement};
use etendue_scene::file::{TracerRow, TracerSpec};
use etendue_scene::import::Wanted;
use etendue_scene::{MemoryForecast, Scene};
use etendue_sensor::BandChoice;
use etendue_spectrum::Bands;
use etendue_tracer::{LayerSpec, Needs, TextureScope};
use serde::Serialize;

use crate::expose;
use crate::film::Precision;
use crate::forecast::forecast;
use crate::output::Outputs;
use crate::precision::light_precision;
use crate::samples::{self, BYTES_OF_SUM};
use crate::stopping::{Stopping, judged_passes};

/// What of the models has to be read for `layers`: decided before they are opened.
#[must_use]
pub fn wanted(layers: &[LayerSpec]) -> Wanted {
    let needs = needs(layers);
    Wanted {
        normals: needs.normals,
        uvs: needs.uvs,
        colors: needs.materials,
        textures: needs.materials,
        light: needs.light,
        occlusion: needs.ambient,
    }
}

fn needs(layers: &[LayerSpec]) -> Needs {
    layers.iter().fold(Needs::default(), |needs, layer| needs.union(layer.needs()))
}

/// A decision and its reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// What is decided.
    pub what: &'static str,
    /// How.
    pub choice: String,
    /// Why.
    pub because: String,
}

/// What is done for a scene, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The layers to fill, the picture first.
    pub layers: Vec<LayerSpec>,
    /// How much of each hit is worked out.
    pub detail: Detail,
    /// Which images of materials are decoded; none for `None`.
    pub images: Option<TextureScope>,
    /// Whether images are averaged over the footprint of a sample.
    pub footprint: bool,
    /// Samples a pixel for coloured layers, at most.
    pub samples: u32,
    /// When they are enough.
    pub stopping: Stopping,
    /// Why that is not what the scene asks for, where it is not.
    pub stopping_note: Option<String>,
    /// Which of these are taken of every pixel before the next are taken of any. The picture does
    /// not depend on it.
    pub passes: Vec<Range<u32>>,
    /// Whether rays are spread over a pupil.
    pub pupil: bool,
    /// Rays in all.
    pub rays: u64,
    /// Build time against traversal speed.
    pub quality: Quality,
    /// How finely data layers are kept.
    pub precision: Precision,
    /// How precisely paths of light hit.
    pub light_precision: HitPrecision,
    /// What the numbers are that the picture's light is kept in.
    pub bands: Bands,
    /// What it will take, by counts and headers alone: within 1.5 of the peak of the example scenes.
    pub memory: MemoryForecast,
    /// The decisions, in words.
    pub decisions: Vec<Decision>,
}

/// Rays per triangle from which a better structure pays for its longer build: a rule of thumb, which
/// `make bench` measures both sides of (build time a triangle, traversal time a ray).
const RAYS_PER_TRIANGLE: u64 = 50;

/// Rays that a sample of light is counted as when the build quality is chosen: the camera's, one to a
/// light, and one more bounce with its own.
const RAYS_A_SAMPLE_OF_LIGHT: u64 = 4;

/// The most memory that the sums of a film may take between passes. A larger film is gone over once.
const MOST_BYTES_OF_SUMS: u64 = 2 << 30;

/// The passes in which the film is filled.
fn sample_passes(
    scene: &Scene,
    passes: Passes,
    bands: usize,
    stopping: Stopping,
) -> Vec<Range<u32>> {
    let samples = scene.render.samples.most();
    if stopping.is_adaptive() {
        return judged_passes(scene.render.samples.least(), samples);
    }
    let [width, height] = scene.camera.resolution().map(u64::from);
    let colours = if passes.mean {
        3 * scene.layers.iter().filter(|layer| layer.is_averaged()).count()
    } else {
        0
    };
    let bands = if passes.light { bands } else { 0 };
    let bytes = (width * height).saturating_mul(BYTES_OF_SUM * (colours + bands) as u64);
    match samples::passes(samples) {
        several if several.len() > 1 && bytes > MOST_BYTES_OF_SUMS => {
            std::iter::once(0..samples).collect()
        }
        passes => passes,
    }
}

impl Plan {
    /// The plan for `scene`, written as `outputs`.
    #[must_use]
    pub fn new(scene: &Scene, outputs: Outputs) -> Self {
        let layers = scene.layers.clone();
        let needs = needs(&layers);
        let lens = scene.camera.has_pupil();
        let spec = scene.render.samples;
        let (stopping, stopping_note) = Stopping::of(scene);
        let passes = Passes::of(&layers, spec.most(), lens);
        let [width, height] = scene.camera.resolution();
        let pixels = u64::from(width) * u64::from(height);
        let samples = spec.most();
        let chosen = expose::bands(scene);
        let apart = scene.camera.band_groups(&chosen.bands).len() as u64;
        let sampled = |yes| if yes { u64::from(spec.typical()) * apart } else { 0 };
        let rays = pixels
            * (u64::from(passes.centre)
                + sampled(passes.mean)
                + sampled(passes.light) * RAYS_A_SAMPLE_OF_LIGHT);
        let triangles = scene.geometry.triangles_unique();
        let quality =
            if rays / RAYS_PER_TRIANGLE < triangles { Quality::Low } else { Quality::Medium };
        let detail = if needs.surface { Detail::Surface } else { Detail::Distance };
        let precision = if outputs.npy { Precision::Double } else { Precision::Single };
        let (light_precision, why_precision) = light_precision(scene, samples);
        let images = (needs.materials && !scene.textures.is_empty())
            .then_some(TextureScope { light: needs.light, ambient: needs.ambient });
        let mut plan = Self {
            layers,
            detail,
            images,
            footprint: images.is_some() && scene.camera.pixel_extent().is_some(),
            samples,
            stopping,
            stopping_note,
            passes: sample_passes(scene, passes, chosen.bands.count(), stopping),
            pupil: lens && (passes.mean || passes.light),
            rays,
            quality,
            precision,
            light_precision,
            bands: chosen.bands.clone(),
            memory: MemoryForecast::default(),
            decisions: Vec::new(),
        };
        plan.memory = forecast(scene, &plan, outputs);
        plan.decisions = plan.explain(scene, &chosen, (needs, passes), triangles);
        if needs.light {
            let choice = match light_precision {
                HitPrecision::Single => "32 bits",
                HitPrecision::Double => "64 bits",
            };
            let because = why_precision;
            let decision = Decision { what: "light paths", choice: choice.to_owned(), because };
            let last = plan.decisions.len() - 1;
            plan.decisions.insert(last, decision);
        }
        plan
    }

    /// The layers of the picture by the names that they will have in files; the picture's is empty.
    #[must_use]
    pub fn names(&self, scene: &Scene) -> Vec<String> {
        let names = |layer: &LayerSpec| match Some(*layer) == scene.picture {
            true => vec![String::new()],
            false => layer.row().names_in_files(),
        };
        let spectrum = expose::has_spectrum(scene).then(|| expose::SPECTRUM.to_owned());
        self.layers.iter().flat_map(names).chain(spectrum).collect()
    }

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

    fn explain(
        &self,
        scene: &Scene,
        chosen: &BandChoice,
        (needs, passes): (Needs, Passes),
        triangles: u64,
    ) -> Vec<Decision> {
        let mut decisions = Vec::new();
        let mut decide = |what, choice: &str, because: String| {
            decisions.push(Decision { what, choice: choice.to_owned(), because });
        };
        let on = |yes| if yes { "on" } else { "off" };
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
        for (what, choice, because) in self.explain_lens(scene) {
            decide(what, choice, because);
        }
        let (choice, because) = light_words(scene, needs);
        decide("shadows and bounces", &choice, because);
        decide(
            "surface",
            on(needs.surface),
            either(
                needs.surface,
                "a layer needs normals or barycentric coordinates",
                "no layer needs more than distance and ids",
            ),
        );
        if needs.light {
            let (choice, because) = source_words(scene);
            decide("lights", &choice, because);
        }
        decide(
            "vertex normals",
            on(needs.normals),
            either(
                needs.normals,
                "a layer needs shading normals",
                "no layer needs shading normals; they are not read",
            ),
        );
        for (what, choice, because) in self.explain_textures(scene, needs) {
            decide(what, choice, because);
        }
        let (choice, because) = self.explain_quality(triangles);
        decide("build quality", choice, because);
        decide(
            "data layers",
            if self.precision == Precision::Single { "32 bits" } else { "64 bits" },
            either(
                self.precision == Precision::Single,
                "an EXR holds no more",
                "NPY files hold what was computed",
            ),
        );
        let memory = self.memory.to_string();
        let (total, parts) = memory.split_once(" (").unwrap_or((&memory, ""));
        decide("memory", total, parts.replacen(')', "", 1));
        decisions
    }

    /// How often the film is gone over, where samples are averaged.
    fn explain_passes(&self, passes: Passes) -> Option<(String, String)> {
        if !passes.mean && !passes.light {
            return None;
        }
        let because = match &self.passes[..] {
            [first, ..] if self.stopping.is_adaptive() => format!(
                "at most: the picture can be seen after {} samples a pixel, and is judged after each",
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

    fn explain_quality(&self, triangles: u64) -> (&'static str, String) {
        let what = format!("{} rays over {triangles} triangles:", self.rays);
        let pays = format!("{RAYS_PER_TRIANGLE} a triangle or more pay for a better structure");
        match self.quality {
            Quality::Low => {
                let less = format!("under {RAYS_PER_TRIANGLE} a triangle, a better structure");
                ("low", format!("{what} {less} would not pay for its build"))
            }
            Quality::Medium => ("medium", format!("{what} {pays}")),
            Quality::High => ("high", format!("{what} {pays}")),
        }
    }

    /// What is read of materials, and how images are looked up.
    fn explain_textures(
        &self,
        scene: &Scene,
        needs: Needs,
    ) -> Vec<(&'static str, &'static str, String)> {
        let because = match (needs.materials, scene.textures.len()) {
            (true, n) if needs.light => format!("light is scattered by them; {n} images named"),
            (true, n) => format!("a layer shows base colour; {n} images named"),
            (false, _) => "no layer shows colour; no image is decoded".to_owned(),
        };
        let on = if needs.materials { "on" } else { "off" };
        let mut decisions = vec![("materials and textures", on, because)];
        if self.images.is_some() {
            let reason = either(
                self.footprint,
                "the camera tells what a sample covers",
                "the camera does not tell what a pixel covers",
            );
            let choice = if self.footprint { "footprint" } else { "none" };
            decisions.push(("texture filter", choice, reason));
        }
        decisions
    }

    /// How wavelengths and the pupil of the camera's lens are sampled.
    fn explain_lens(&self, scene: &Scene) -> [(&'static str, &'static str, String); 2] {
        let lens = scene.camera.lens();
        let groups = scene.camera.band_groups(&self.bands).len();
        let each = lens.map_or(1, |lens| lens.wavelengths_a_group(&self.bands));
        let apart = groups > 1 || each > 1;
        let rays = if apart && self.pupil { "their own" } else { "shared" };
        let (pupil, because) = match scene.camera.projection() {
            Projection::Views(_) if self.pupil => {
                ("on", "each view is averaged over its own part of the opening".to_owned())
            }
            _ => pupil(lens, self.pupil, self.samples),
        };
        [
            ("rays of a wavelength", rays, wavelengths(apart, self.pupil, each)),
            ("pupil", pupil, because),
        ]
    }
}

/// One of two reasons.
fn either(yes: bool, reason: &str, other: &str) -> String {
    if yes { reason } else { other }.to_owned()
}

/// Which rays have to be traced.
#[derive(Debug, Clone, Copy)]
struct Passes {
    /// Chief rays.
    centre: bool,
    /// Samples of layers that are averaged.
    mean: bool,
    /// Samples of light.
    light: bool,
}

impl Passes {
    fn of(layers: &[LayerSpec], samples: u32, lens: bool) -> Self {
        let averaged = samples > 1 || lens;
        let light = layers.contains(&LayerSpec::Radiance);
        let is_traced = |layer: &LayerSpec| !layer.is_of_sampling();
        let seen = layers.iter().filter(|layer| **layer != LayerSpec::Radiance);
        let mut seen = seen.filter(|layer| is_traced(layer));
        let mean = averaged && seen.clone().any(|layer| layer.is_averaged());
        let centre = seen.any(|layer| !averaged || !layer.is_averaged());
        Self { centre, mean, light }
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
        for Decision { what, choice: chosen, because } in &self.decisions {
            writeln!(f, "{what:width$}  {chosen:choice$}  {because}")?;
        }
        Ok(())
    }
}
