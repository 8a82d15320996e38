//! The plan's decisions, each with its reason.

use std::fmt;

use etendue_accel::Quality;
use etendue_camera::{LensCamera, Projection};
use etendue_geometry::{HitPrecision, Placement};
use etendue_report::{Decision, DecisionKind as Kind, DecisionValue, Saving, Tabled};
use etendue_scene::Scene;
use etendue_scene::file::{LightPrecision, TracerRow, TracerSpec};
use etendue_sensor::BandChoice;
use etendue_tracer::layer::ValueKind;
use etendue_tracer::{LayerSpec, Needs};

use super::{
    MOST_BYTES_OF_SUMS, Passes, Plan, RAYS_A_SAMPLE_OF_LIGHT, RAYS_PER_TRIANGLE, quality_for,
};
use crate::film::Precision;
use crate::tolerance::TakenBounces;
use crate::{diffraction, expose, samples};

/// Grounds of decisions, beside the plan.
pub(super) struct Grounds<'a> {
    pub(super) scene: &'a Scene,
    pub(super) bands: &'a BandChoice,
    pub(super) needs: Needs,
    pub(super) passes: Passes,
    /// Triangles, each stored one once.
    pub(super) triangles: u64,
    /// Reason for the precision of light's hits.
    pub(super) why_precision: String,
}

/// Decision whether samples have times.
fn explain_shutter(scene: &Scene) -> Option<Decision> {
    let shutter = scene.camera.shutter()?;
    let placed = &scene.geometry.placements;
    let moving = scene.geometry.moving_within(scene.camera.exposure_span()).count();
    let bodies = match moving {
        0 => String::new(),
        _ => format!(
            "; {moving} of {} placed meshes move, and rays that meet the box in which one moves are traced in its own \
             frame, too",
            placed.len()
        ),
    };
    let steps: Vec<usize> = scene
        .geometry
        .meshes
        .iter()
        .filter_map(|mesh| Some(mesh.steps.as_ref()?.times().len()))
        .collect();
    let shapes = match steps.iter().max() {
        None => String::new(),
        Some(most) => format!(
            "; {} meshes change their shapes, in up to {most} steps, so many that no corner is farther than a \
             thousandth of a pixel from the straight lines between them",
            steps.len()
        ),
    };
    let why = match (scene.camera.is_timed(), shutter.is_fully_open()) {
        (true, _) if scene.camera.motion().is_some() => {
            "the camera moves: samples of light have times of their row's exposure"
        }
        (true, _) => "something moves: samples of light have times of their row's exposure",
        (false, _) if scene.camera.lights_change() => {
            "nothing moves, and lights change: rays have no times, and each row gets the light of its exposure, exactly"
        }
        (false, true) => "nothing moves: rays have no times, and nothing is paid",
        (false, false) => {
            "nothing moves: rays have no times, and light is multiplied by what the shutter lets through"
        }
    };
    let slots = match scene.slots {
        0 => String::new(),
        count => format!(
            "; its {count} slots are rendered one after another, and their light is added up"
        ),
    };
    Some(Decision::new(Kind::Shutter, shutter.words(), format!("{why}{bodies}{shapes}{slots}")))
}

impl Plan {
    /// The decisions: rays, samples, wavelengths, sensor and lens; surfaces and lights; how exactly, and in how
    /// much memory.
    pub(super) fn explain(&self, grounds: &Grounds<'_>) -> Vec<Decision> {
        let Grounds { scene, needs, passes, .. } = *grounds;
        let mut decisions = vec![Decision::new(
            Kind::Rays,
            DecisionValue::Count(self.rays),
            self.explain_rays(passes),
        )];
        if passes.mean || passes.light {
            let (choice, because) =
                self.stopping.words(scene.render.samples, self.not_as_asked.as_ref());
            decisions.push(Decision::new(Kind::Samples, choice, because));
            decisions.push(self.explain_passes());
        }
        let (bands, because) = expose::explain_bands(scene, grounds.bands);
        let because = match self.alike {
            true => format!(
                "{because}; nothing in the scene tells them apart, and one is traced for all"
            ),
            false => because,
        };
        decisions.push(Decision::new(Kind::Wavelengths, bands, because));
        decisions.extend(expose::explain_sensor(scene));
        decisions.extend(explain_shutter(scene));
        decisions.extend(self.explain_denoising());
        decisions.extend(self.explain_tolerance(scene));
        decisions.extend(self.explain_lens(scene));
        decisions.extend(self.band_paths.decision(scene));
        decisions.extend(diffraction::decision(scene, self));
        decisions.push(self.explain_bounces(scene, needs));
        decisions.extend(explain_surfaces(needs));
        decisions.extend(needs.light.then(|| explain_lights(scene)));
        decisions.extend(self.explain_textures(scene, needs));
        decisions.extend(self.explain_unseen(scene, grounds.triangles));
        decisions.push(self.explain_quality(scene, grounds.triangles));
        decisions.extend(self.explain_precision(grounds));
        decisions.extend(scene.accuracy_decisions());
        decisions.push(self.memory.decision());
        decisions
    }

    /// Description of the rays' purpose.
    fn explain_rays(&self, passes: Passes) -> String {
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

    /// Decision of how often the film is gone over.
    fn explain_passes(&self) -> Decision {
        let because = match &self.passes[..] {
            [first, ..] if self.stopping.is_adaptive() => format!(
                "the picture can be seen after {} samples a pixel, and then after every round of those that are \
                 still wanted",
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
        let value = match self.stopping.is_adaptive() {
            true => "in rounds".into(),
            false => DecisionValue::Count(self.passes.len() as u64),
        };
        Decision::new(Kind::Passes, value, because)
    }

    fn explain_quality(&self, scene: &Scene, triangles: u64) -> Decision {
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
        let is_forced = scene.plan.build_quality.is_some();
        let because = match is_forced {
            true => format!("it would be {} by itself: {because}", quality_name(own)),
            false => because,
        };
        Decision::new(Kind::BuildQuality, quality_name(self.quality), because).forced(is_forced)
    }

    /// Decision of what is not built, because nothing looks at it.
    fn explain_unseen(&self, scene: &Scene, triangles: u64) -> Option<Decision> {
        let is_forced = scene.plan.unseen.is_some();
        let Some(unseen) = &self.unseen else {
            let because = "the scene has all of it built, whether it is looked at or not";
            let all = Decision::new(Kind::Geometry, "all", because).forced(true);
            return (scene.plan.unseen == Some(true)).then_some(all);
        };
        let of = scene.geometry.placements.len();
        let choice = format!("{} of {of} meshes not built", unseen.placements());
        let because = format!(
            "no chief ray of the data layers can meet them, with {} of {triangles} triangles, and nothing else \
             is traced",
            unseen.triangles()
        );
        let share = unseen.triangles() as f64 / triangles.max(1) as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a number of bytes"
        )]
        let bytes = (self.memory.structure as f64 * share) as u64;
        let saving = (bytes > 0).then_some(Saving { bytes, images: None });
        Some(Decision::new(Kind::Geometry, choice, because).forced(is_forced).saving(saving))
    }

    /// Decisions of what is read of materials, and how images are looked up.
    fn explain_textures(&self, scene: &Scene, needs: Needs) -> Vec<Decision> {
        let n = scene.textures.len();
        // Whether materials are looked at, and their images with them.
        let (choice, because): (DecisionValue, _) = match (needs.materials, scene.plan.textures) {
            (true, Some(false)) => (
                "without images".into(),
                format!("surfaces have their factors alone; {n} images named"),
            ),
            (true, _) if needs.light => (
                DecisionValue::Switch(true),
                format!("light is scattered by them; {n} images named"),
            ),
            (true, _) => (
                DecisionValue::Switch(true),
                format!("a layer shows base colour; {n} images named"),
            ),
            (false, _) => (
                DecisionValue::Switch(false),
                "no layer shows colour; no image is decoded".to_owned(),
            ),
        };
        let bytes = scene.textures.iter().map(|texture| texture.decoded_bytes()).sum();
        let saving =
            (self.images.is_none() && bytes > 0).then_some(Saving { bytes, images: Some(n) });
        let read = Decision::new(Kind::Textures, choice, because)
            .forced(scene.plan.textures.is_some())
            .saving(saving);
        // How images are filtered.
        let filter = self.images.map(|_| {
            let because = match (self.footprint, scene.plan.texture_filter) {
                (true, _) => "the camera tells what a sample covers",
                (false, Some(false)) => "the scene takes images at the very points that were hit",
                (false, _) => "the camera does not tell what a pixel covers",
            };
            let choice = if self.footprint { "footprint" } else { "none" };
            let is_forced = scene.plan.texture_filter.is_some();
            Decision::new(Kind::TextureFilter, choice, because).forced(is_forced)
        });
        std::iter::once(read).chain(filter).collect()
    }

    /// Decisions of how exactly data and light are traced and kept.
    fn explain_precision(&self, grounds: &Grounds<'_>) -> impl Iterator<Item = Decision> {
        let Grounds { scene, needs, .. } = *grounds;
        let because = match self.refine {
            true => {
                "hits found in f32 are solved again in f64: data are as exact as the file's numbers"
            }
            false => "the scene takes f32's hits as they are",
        };
        let refined = Decision::new(Kind::Refinement, DecisionValue::Switch(self.refine), because)
            .forced(scene.plan.refine.is_some());
        // What of data layers f32 saves.
        let (bits, because, saving) = match self.precision {
            Precision::Single => {
                let [width, height] = scene.camera.resolution().map(u64::from);
                let planes =
                    self.layers.iter().filter(|layer| layer.row().kept == ValueKind::Measured);
                let planes: u64 = planes.map(|layer| layer.row().channels.len() as u64).sum();
                let saving = Saving { bytes: 4 * planes * width * height, images: None };
                (32, "an EXR holds no more", (planes > 0).then_some(saving))
            }
            Precision::Double => (64, "NPY files hold what was computed", None),
        };
        let data =
            Decision::new(Kind::DataLayers, DecisionValue::Bits(bits), because).saving(saving);
        // What light and samples of colours hit.
        let is_color = |layer: &LayerSpec| layer.is_averaged() && !layer.is_light();
        let averages_colors = self.samples > 1 && self.layers.iter().any(is_color);
        let kind = if needs.light { Kind::LightPaths } else { Kind::SampledHits };
        let bits = match self.light_precision {
            HitPrecision::Single => 32,
            HitPrecision::Double => 64,
        };
        let light = (needs.light || averages_colors).then(|| {
            Decision::new(kind, DecisionValue::Bits(bits), grounds.why_precision.clone())
                .forced(scene.plan.light_precision != LightPrecision::Auto)
        });
        [refined, data].into_iter().chain(light)
    }

    /// Decision of what becomes of the picture's noise, where something does.
    fn explain_denoising(&self) -> Option<Decision> {
        let because = "--denoise: by Open Image Denoise, which is guided by the layers MeanAlbedo and \
                       MeanNormal; the picture and the sensor's images keep their noise";
        let choice = "a layer beside the picture";
        self.outputs.denoised.then(|| Decision::new(Kind::Denoising, choice, because))
    }

    /// Decisions of how wavelengths and the pupil of the camera's lens are sampled.
    fn explain_lens(&self, scene: &Scene) -> [Decision; 2] {
        let camera = self.light_camera(scene);
        let lens = camera.lens();
        let groups = camera.band_groups(&self.bands).len();
        let each = lens.map_or(1, |lens| lens.wavelengths_a_group(&self.bands));
        let apart = groups > 1 || each > 1;
        let rays = if apart && self.pupil { "their own" } else { "shared" };
        let disperses = lens.is_some_and(|lens| lens.focused().train().is_dispersive());
        let because_apart = match scene.plan.dispersion == Some(false) && disperses && !apart {
            true => "the scene takes the lens as at its design wavelength; else each would run its own way"
                .to_owned(),
            false => wavelengths(apart, self.pupil, each),
        };
        let (is_on, because) = match camera.projection() {
            Projection::Pinhole(_) if scene.camera.has_pupil() => {
                let why = "the model that is taken of the lens has no aperture: every ray of light is a chief ray";
                (self.pupil, why.to_owned())
            }
            Projection::Views(_) if self.pupil => {
                (true, "each view is averaged over its own part of the opening".to_owned())
            }
            _ => pupil(lens, self.pupil, self.samples),
        };
        [
            Decision::new(Kind::RaysOfBands, rays, because_apart)
                .forced(scene.plan.dispersion.is_some() && disperses),
            Decision::new(Kind::Pupil, DecisionValue::Switch(is_on), because),
        ]
    }
}

/// Decisions of what is worked out of surfaces.
fn explain_surfaces(needs: Needs) -> [Decision; 2] {
    let surface = match needs.surface {
        true => "a layer needs normals or barycentric coordinates",
        false => "no layer needs more than distance and ids",
    };
    let normals = match needs.normals {
        true => "a layer needs shading normals",
        false => "no layer needs shading normals; they are not read",
    };
    [
        Decision::new(Kind::Surface, DecisionValue::Switch(needs.surface), surface),
        Decision::new(Kind::VertexNormals, DecisionValue::Switch(needs.normals), normals),
    ]
}

fn quality_name(quality: Quality) -> &'static str {
    match quality {
        Quality::Low => "low",
        Quality::Medium => "medium",
        Quality::High => "high",
    }
}

impl Plan {
    /// Decision of how far light is followed.
    fn explain_bounces(&self, scene: &Scene, needs: Needs) -> Decision {
        let own = explain_bounces(scene, needs);
        let fewer = self.taken.as_ref().and_then(|taken| taken.bounces);
        match fewer {
            Some(TakenBounces { bounces, .. }) => {
                let because =
                    format!("{}; {} by itself, and `tolerance` allows less", own.reason, own.value);
                Decision::new(Kind::Bounces, format!("at most {bounces}"), because)
                    .by_key("tolerance")
                    .forced(true)
            }
            None => own,
        }
    }
}

/// Decision of how far light is followed, by the tracer.
fn explain_bounces(scene: &Scene, needs: Needs) -> Decision {
    match scene.tracer.filter(|_| needs.light).map(TracerSpec::row) {
        Some(TracerRow { name, light: Some(light), .. }) => {
            let because = format!("the tracer is `{name}`: {}", light.shows);
            Decision::new(Kind::Bounces, light.reach, because)
        }
        Some(TracerRow { light: None, .. }) | None => {
            let off = DecisionValue::Switch(false);
            Decision::new(Kind::Bounces, off, "no layer looks at light")
        }
    }
}

/// Decision of where light comes from.
fn explain_lights(scene: &Scene) -> Decision {
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
    let more = match scene.studio_if_dark {
        true => "; a grey studio, too, where they leave what the camera sees in the dark",
        false => "",
    };
    let count = DecisionValue::Count((lights + triangles) as u64);
    Decision::new(Kind::Lights, count, words + more)
}

/// Reason why wavelengths are traced together or apart, `each` of them a band.
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

/// Choice whether rays are spread over a pupil, with the reason.
fn pupil(lens: Option<&LensCamera>, spread: bool, samples: u32) -> (bool, String) {
    let Some(lens) = lens else {
        return (false, "the camera has no aperture: every ray is a chief ray".to_owned());
    };
    if !spread {
        return (false, "no layer is a picture: data are taken along chief rays".to_owned());
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
    (true, because + noise)
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&Tabled(&self.decisions).text())
    }
}
