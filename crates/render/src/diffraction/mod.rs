//! Diffraction in the picture: the scene along chief rays, on cells of pixels, whose light is then spread
//! by the lens' point spread functions in waves. Nothing is spread by rays, so nothing is spread twice.
//!
//! 1. Cells a third of the finest detail that the lens can draw, but at least a third of a pixel (where `accuracy`
//!    says nothing else), are rendered along chief rays, with their depths.
//! 2. Light is multiplied by what of it arrives, which the lens' rays say as they do without diffraction.
//! 3. Cells are sorted by depth into layers, over each of which the spread hardly changes.
//! 4. From the rearmost to the foremost, each layer's light and its coverage are spread, and it is laid over
//!    what is behind it. What a layer in front hides of another is taken to go on as what is seen of it.
//!
//! So what the pupil's parts see differently, around edges of things and in mirrors, is lost.

mod convolve;
mod illumination;
mod layers;
mod spreads;
mod words;

use etendue_camera::{Camera, WaveLens};
use etendue_report::Refusal;
use etendue_scene::Scene;
use etendue_scene::file::{AccuracySpec, SamplesSpec};
use etendue_tracer::LayerSpec;

use crate::error::RenderError;
use crate::film::FilmLayer;
use crate::output::{Outputs, Values};
use crate::state::{Film, Prepared, RenderState, TraceFn};
use crate::tile::RayCounts;
use crate::watch::{SoFar, Watch};
use crate::{Plan, Shard};

use self::convolve::{CellPicture, composed};
use self::illumination::illumination;
use self::layers::DepthLayers;
use self::spreads::Spreads;

pub(crate) use self::words::decision;

/// Tracing takes this share of the work, as a rule.
const TRACING: f64 = 0.8;

/// Light spread over the film, and what it took.
pub(crate) struct SpreadLight {
    /// The planes of each layer of light, band by band.
    pub(crate) layers: Vec<(LayerSpec, Vec<Vec<f32>>)>,
    pub(crate) counts: RayCounts,
    pub(crate) notes: Vec<String>,
}

/// True if the plan's picture is of light that is spread as waves are.
fn is_wanted(scene: &Scene, plan: &Plan) -> bool {
    scene.camera.diffracts() && plan.layers.contains(&LayerSpec::Radiance)
}

/// Bytes of a picture: its cells' light, depths and layers, and what spreads them.
pub(crate) fn bytes(scene: &Scene, plan: &Plan) -> u64 {
    let Some(lens) = scene.camera.lens().filter(|_| is_wanted(scene, plan)) else { return 0 };
    let bands = plan.bands.count();
    let shortest = (0..bands).map(|band| plan.bands.wavelength(band)).fold(f64::INFINITY, f64::min);
    let pitch = 1e-3 * lens.focused().pixel_pitch();
    let accuracy = &scene.accuracy;
    let cells = cells_a_pixel(pitch, lens.airy_unit(shortest), accuracy);
    let lit = plan.layers.iter().filter(|layer| layer.is_light()).count();
    let each = size_of::<f32>() * (lit * bands + 1) + 1;
    let resolution = scene.camera.resolution();
    let [columns, rows] = resolution.map(|side| u64::from(side) * u64::from(cells));
    let longest = (0..bands).map(|band| plan.bands.wavelength(band)).fold(0.0, f64::max);
    let unit = lens.airy_unit(longest) * f64::from(cells) / pitch;
    // Beside light, what a layer covers and what is known.
    let is_flat = words::depths(scene).is_some_and(|[near, far]| {
        lens.waves_of_defocus(f64::midpoint(shortest, longest)) * (1.0 / near - 1.0 / far)
            <= accuracy.defocus_step
    });
    let planes = if is_flat { lit + 1 } else { lit + 2 };
    columns * rows * each as u64
        + spreads::bytes(lens, accuracy, resolution, cells, unit, planes, is_flat)
}

/// Refuses what light that is spread over the picture cannot be.
fn check(scene: &Scene, state: &RenderState<'_>) -> Result<(), RenderError> {
    if let Some(why) = scene.diffraction_fault() {
        return Err(RenderError::diffraction(why));
    }
    let is_whole = state.shard.is_none_or(|shard| shard == Shard::ALL);
    if !is_whole || state.checkpoint.is_some() || !state.shares.is_empty() {
        let why = Refusal::new("the light of the whole picture is spread at once");
        let remedy = "leave out --shard and --checkpoint, or `diffraction`";
        return Err(RenderError::diffraction(why.hint(remedy)));
    }
    Ok(())
}

/// Passes on a part of the work, and no pictures: those on the way are of cells.
struct PartialProgress<'a> {
    watch: &'a dyn Watch,
    from: f64,
    to: f64,
}

impl Watch for PartialProgress<'_> {
    fn goes_on(&self, share: f64) -> bool {
        self.watch.goes_on(self.from + (self.to - self.from) * share.clamp(0.0, 1.0))
    }

    fn look(&self, _so_far: &SoFar<'_>) {}
}

/// Number of cells of a pixel a side.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
fn cells_a_pixel(pitch: f64, finest: f64, accuracy: &AccuracySpec) -> u32 {
    let cells = (accuracy.spread_detail_cells * pitch / finest - 1e-9).ceil();
    cells.clamp(1.0, f64::from(accuracy.spread_pixel_cells)) as u32
}

/// Traces the light of `scene` by `trace` and spreads it, where that is [wanted](is_wanted). `opened` is the camera, opened
/// for the plan's bands.
///
/// # Errors
///
/// As [`trace`](crate::trace); when the scene asks for what goes with no diffraction, or the lens has no waves.
pub(crate) fn spread_light(
    scene: &Scene,
    plan: &Plan,
    prepared: Prepared<'_>,
    state: &RenderState<'_>,
    opened: &Camera,
    watch: &dyn Watch,
    trace: TraceFn,
) -> Result<Option<SpreadLight>, RenderError> {
    if !is_wanted(scene, plan) {
        return Ok(None);
    }
    check(scene, state)?;
    let fault = |why: String| RenderError::diffraction(why);
    let Some(lens) = opened.lens() else { return Err(fault("the camera has no lens".to_owned())) };
    let waves = WaveLens::new(lens, &plan.bands).map_err(|error| fault(error.why))?;
    let all = || waves.wavelengths().iter().flatten().copied();
    let shortest = all().fold(f64::INFINITY, f64::min);
    let pitch = 1e-3 * lens.focused().pixel_pitch();
    let accuracy = &scene.accuracy;
    let cells = cells_a_pixel(pitch, lens.airy_unit(shortest), accuracy);
    // Light along chief rays, and depths.
    let (picture, lit, mut film) = cell_picture(scene, plan, prepared, cells, watch, trace)?;
    let [columns, rows] = scene.camera.resolution();
    let is_mirrored = waves.is_mirrored([columns, rows]);
    let illumination = illumination(opened, &plan.bands, [columns, rows], is_mirrored, accuracy);
    let mean = all().sum::<f64>() / all().count().max(1) as f64;
    let (across, step) = (picture.size[0], accuracy.defocus_step);
    let layers = DepthLayers::of(&picture.depths, across, lens, mean, step);
    let size = [columns, rows];
    let spreads = Spreads::new(&waves, &layers, size, f64::from(cells), pitch, accuracy)
        .map_err(|error| fault(error.to_string()))?;
    let bands = plan.bands.count();
    let mut planes: Vec<Vec<Vec<f32>>> = vec![Vec::new(); lit.len()];
    for (band, arrives) in illumination.iter().enumerate() {
        let part = PartialProgress { watch, from: TRACING, to: 1.0 };
        if !part.goes_on(band as f64 / bands.max(1) as f64) {
            return Err(RenderError::Stopped);
        }
        let own = composed(&picture, &layers, &spreads, band, arrives);
        planes.iter_mut().zip(own).for_each(|(planes, plane)| planes.push(plane));
    }
    let notes = std::mem::take(&mut film.notes);
    let layers = lit.into_iter().zip(planes).collect();
    Ok(Some(SpreadLight { layers, counts: film.counts, notes }))
}

/// The scene along chief rays on cells: light and depths; which layers of light; and its film, emptied.
fn cell_picture(
    scene: &Scene,
    plan: &Plan,
    prepared: Prepared<'_>,
    cells: u32,
    watch: &dyn Watch,
    trace: TraceFn,
) -> Result<(CellPicture, Vec<LayerSpec>, Film), RenderError> {
    let mut fine = scene.clone();
    fine.camera = scene.camera.along_chief_rays(cells);
    fine.sensor = None;
    fine.layers = plan.layers.iter().copied().filter(|layer| layer.is_light()).collect();
    let lit = fine.layers.clone();
    fine.layers.push(LayerSpec::Depth);
    fine.render.samples = SamplesSpec::Count(plan.samples.div_ceil(cells * cells).max(1));
    let mut fine_plan = Plan::in_bands(&fine, Outputs::NONE, &plan.bands);
    // Nobody sees it on the way.
    fine_plan.passes = std::iter::once(0..fine_plan.samples).collect();
    let prepared = Prepared { others: &[], ..prepared };
    let part = PartialProgress { watch, from: 0.0, to: TRACING };
    let mut film = trace(&fine, &fine_plan, prepared, &[], &RenderState::default(), &part)?;
    let mut depths = Vec::new();
    let mut light = Vec::new();
    for layer in std::mem::take(&mut film.layers) {
        let is_light = layer.spec.is_light();
        let planes = layer.into_planes().into_iter().map(|values| match values {
            Values::F32(values) => values,
            #[expect(clippy::cast_possible_truncation, reason = "single precision does")]
            Values::F64(values) => values.into_iter().map(|value| value as f32).collect(),
            Values::U16(_) | Values::U32(_) => Vec::new(),
        });
        match is_light {
            true => light.push(planes.collect()),
            false => depths = planes.flatten().collect(),
        }
    }
    let size = fine.camera.resolution().map(|side| side as usize);
    Ok((CellPicture { size, cells: cells as usize, light, depths }, lit, film))
}

/// Puts light that was spread onto its layers of the film, and what it took to the rest.
pub(crate) fn put(
    film: &mut [FilmLayer],
    spread: Option<SpreadLight>,
    counts: &mut RayCounts,
    notes: &mut Vec<String>,
) {
    let Some(spread) = spread else { return };
    counts.merge(&spread.counts);
    notes.extend(spread.notes);
    for (spec, planes) in spread.layers {
        let Some(layer) = film.iter_mut().find(|layer| layer.spec == spec) else { continue };
        for ((_, values), plane) in layer.named_planes_mut().zip(planes) {
            *values = match values {
                Values::F64(_) => Values::F64(plane.into_iter().map(f64::from).collect()),
                _ => Values::F32(plane),
            };
        }
    }
}
