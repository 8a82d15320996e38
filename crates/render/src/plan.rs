//! The plan: the one place where it is decided what a scene needs, and why. What is off costs
//! nothing: it is not read, not traced, not written.

use std::fmt;

use etendue_accel::Quality;
use etendue_geometry::Detail;
use etendue_scene::Scene;
use etendue_scene::import::Wanted;
use etendue_spectrum::Lanes;
use etendue_tracer::{LayerSpec, Needs};
use serde::Serialize;

use crate::expose;
use crate::film::Precision;
use crate::output::Outputs;

/// What of the models has to be read for `layers`: decided before they are opened.
#[must_use]
pub fn wanted(layers: &[LayerSpec]) -> Wanted {
    let needs = needs(layers);
    Wanted {
        normals: needs.normals,
        uvs: needs.materials,
        colors: needs.materials,
        textures: needs.materials,
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
    /// Whether images of materials are decoded.
    pub images: bool,
    /// Rays a pixel for coloured layers.
    pub samples: u32,
    /// Rays in all.
    pub rays: u64,
    /// Build time against traversal speed.
    pub quality: Quality,
    /// How finely data layers are kept.
    pub precision: Precision,
    /// What the numbers are that the picture's light is kept in.
    pub lanes: Lanes,
    /// The decisions, in words.
    pub decisions: Vec<Decision>,
}

/// Rays per triangle from which a better structure pays for its longer build: a rule of thumb, which
/// `make bench` measures both sides of (build time a triangle, traversal time a ray).
const RAYS_PER_TRIANGLE: u64 = 50;

impl Plan {
    /// The plan for `scene`, written as `outputs`.
    #[must_use]
    pub fn new(scene: &Scene, outputs: Outputs) -> Self {
        let layers = scene.layers.clone();
        let needs = needs(&layers);
        let (centre, mean) = passes(&layers, scene.render.samples);
        let [width, height] = scene.camera.resolution();
        let pixels = u64::from(width) * u64::from(height);
        let samples = scene.render.samples;
        let rays = pixels * (u64::from(centre) + if mean { u64::from(samples) } else { 0 });
        let triangles = scene.geometry.triangles_unique();
        let quality =
            if rays / RAYS_PER_TRIANGLE < triangles { Quality::Low } else { Quality::Medium };
        let detail = if needs.surface { Detail::Surface } else { Detail::Distance };
        let precision = if outputs.npy { Precision::Double } else { Precision::Single };
        let images = needs.materials && !scene.textures.is_empty();
        let mut plan = Self {
            layers,
            detail,
            images,
            samples,
            rays,
            quality,
            precision,
            lanes: expose::lanes(scene),
            decisions: Vec::new(),
        };
        plan.decisions = plan.explain(scene, needs, centre, mean, triangles);
        plan
    }

    fn explain(
        &self,
        scene: &Scene,
        needs: Needs,
        centre: bool,
        mean: bool,
        triangles: u64,
    ) -> Vec<Decision> {
        let mut decisions = Vec::new();
        let mut decide = |what, choice: &str, because: String| {
            decisions.push(Decision { what, choice: choice.to_owned(), because });
        };
        let on = |yes| if yes { "on" } else { "off" };
        let count = self.layers.len();
        let rays_of = match (centre, mean) {
            (true, true) => format!(
                "the chief ray of each pixel for data layers, {} samples a pixel for colours",
                self.samples
            ),
            (false, true) => format!("{} samples a pixel, no data layers", self.samples),
            _ => format!("the chief ray of each pixel serves all {count} layers"),
        };
        decide("rays", &self.rays.to_string(), rays_of);
        let (lanes, because) = expose::explain_lanes(scene, &self.lanes);
        decide("wavelengths", &lanes, because);
        if let Some((choice, because)) = expose::explain_sensor(scene) {
            decide("sensor", &choice, because);
        }
        decide("pupil", "off", "the camera has no aperture: every ray is a chief ray".to_owned());
        decide("shadows and bounces", "off", "no layer looks at light".to_owned());
        decide(
            "surface",
            on(needs.surface),
            match needs.surface {
                true => "a layer needs normals or barycentric coordinates".to_owned(),
                false => "no layer needs more than distance and ids".to_owned(),
            },
        );
        decide(
            "vertex normals",
            on(needs.normals),
            match needs.normals {
                true => "a layer needs shading normals".to_owned(),
                false => "no layer needs shading normals; they are not read".to_owned(),
            },
        );
        decide(
            "materials and textures",
            on(needs.materials),
            match (needs.materials, scene.textures.len()) {
                (true, n) => format!("a layer shows base colour; {n} images to decode"),
                (false, _) => "no layer shows colour; no image is decoded".to_owned(),
            },
        );
        decide(
            "build quality",
            match self.quality {
                Quality::Low => "low",
                Quality::Medium => "medium",
                Quality::High => "high",
            },
            match self.quality {
                Quality::Low => format!(
                    "{} rays over {triangles} triangles: under {RAYS_PER_TRIANGLE} a triangle, a \
                     better structure would not pay for its build",
                    self.rays
                ),
                _ => format!(
                    "{} rays over {triangles} triangles: {RAYS_PER_TRIANGLE} a triangle or more \
                     pay for a better structure",
                    self.rays
                ),
            },
        );
        decide(
            "data layers",
            match self.precision {
                Precision::Single => "32 bits",
                Precision::Double => "64 bits",
            },
            match self.precision {
                Precision::Single => "an EXR holds no more".to_owned(),
                Precision::Double => "NPY files hold what was computed".to_owned(),
            },
        );
        decisions
    }
}

/// Whether chief rays and whether averaged samples have to be traced.
fn passes(layers: &[LayerSpec], samples: u32) -> (bool, bool) {
    let colored = |layer: &LayerSpec| matches!(layer, LayerSpec::Flat | LayerSpec::Facing);
    let mean = samples > 1 && layers.iter().any(colored);
    let centre = layers.iter().any(|layer| samples == 1 || !colored(layer));
    (centre, mean)
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
