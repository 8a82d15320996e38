//! From a loaded scene to a picture: decode, trace.

use std::sync::Arc;
use std::time::{Duration, Instant};

use etendue_accel::Accel;
use etendue_camera::{Camera, LensCamera, PixelExtent};
use etendue_optics::element::StatusCounts;
use etendue_scene::Scene;
use etendue_scene::file::{LightRow, SETS};
use etendue_sensor::Sensor;
use etendue_spectrum::Bands;
use etendue_tracer::layer::OtherFrame;
use etendue_tracer::{
    Emitters, LayerSpec, LightingContext, Lights, Material, Pixel, PlacedSurfaces, RayStats, Rules,
    SceneView, Spectral, Traits, View,
};

use crate::adaptive::{Rule, SampleCounts};
use crate::checkpoint::Keeper;
use crate::error::RenderError;
use crate::film::FilmLayer;
use crate::film_file::FilmFile;
use crate::images::Images;
use crate::memory::NoMemory;
use crate::output::{Development, HeaderEntry, Layer, Picture, PictureError};
use crate::radiance::LightPass;
use crate::sampling::{Sampling, short_passes};
use crate::shard::Shard;
use crate::tile::RayCounts;
use crate::tiles::{Job, JobResult, SamplesTaken};
use crate::watch::{Watch, Watcher};
use crate::{Plan, diffraction, expose, lighting, names};

pub use crate::state::{Film, Prepared, RenderState, RenderedScene};

/// Told the share done (0..=1) now and then; answering `false` stops.
pub type Progress = Arc<dyn Fn(f64) -> bool + Send + Sync>;

/// A render's result.
#[derive(Debug)]
pub struct Rendered {
    /// The layers.
    pub picture: Picture,
    /// Samples that every pixel of the picture has.
    pub samples: u32,
    /// Samples that every pixel was to have: more than it has when the render was stopped. Then the
    /// picture's header says so, by the entry `partial`.
    pub samples_wanted: u32,
    /// Number of samples of each pixel, where they got them until an error was reached.
    pub sample_counts: Option<SampleCounts>,
    /// The light of the picture in bands other than red, green and blue, where it was traced so.
    pub band_film: Option<expose::BandFilm>,
    /// Rays traced, to lights included.
    pub rays: u64,
    /// Counts of rays by their outcome inside the camera's lens; all 0 without one.
    pub statuses: StatusCounts,
    /// Statistics of the rays that were light's.
    pub light: RayStats,
    /// Wall time of the tracing alone.
    pub trace_time: Duration,
    /// Notes on the picture for the user.
    pub notes: Vec<String>,
}

/// Renders `scene` as planned. Runs on the threads of the current rayon pool; the picture does not
/// depend on how many there are. The file header gets the number of samples a pixel.
///
/// When `watch` asks to stop, the picture of the samples that every pixel has by then is returned, if
/// there are any: see [`Rendered::samples`].
///
/// # Errors
///
/// When `watch` asks to stop before every pixel has samples, or no light gets through the camera's
/// lens.
pub fn render(
    scene: &Scene,
    plan: &Plan,
    accel: &dyn Accel,
    images: &Images,
    header: Vec<HeaderEntry>,
    watch: &dyn Watch,
) -> Result<Rendered, RenderError> {
    let prepared = Prepared { accel, images, others: &[] };
    let film = trace(scene, plan, prepared, &header, &RenderState::default(), watch)?;
    finish(scene, plan, film, header, Some(accel))
}

/// The rules and lights of the picture, with `notes` of them; `None` without a picture of light.
fn light_of(
    RenderedScene { scene, accel, images }: RenderedScene<'_>,
    plan: &Plan,
    surroundings: SceneView<'_>,
    spectral: &Spectral,
    notes: &mut Vec<String>,
    watch: &dyn Watch,
) -> Result<Option<(Rules, Lights)>, RenderError> {
    let light = scene.tracer.and_then(|tracer| tracer.row().light);
    let light = light.filter(|_| plan.layers.contains(&LayerSpec::Radiance));
    let Some(LightRow { rules, .. }) = light else { return Ok(None) };
    let roulette = rules.roulette.map(|_| scene.accuracy.roulette_after);
    let fewer = plan.taken.as_ref().and_then(|taken| taken.bounces);
    let bounces = fewer.map_or(rules.bounces, |fewer| fewer.bounces.min(rules.bounces));
    let rules = Rules { roulette, bounces, parts: scene.accuracy.dispersion_paths, ..rules };
    let map = images.environment.clone();
    let goes_on = |share: f64| watch.goes_on(share);
    let found = lighting::settle(scene, map, rules, accel, surroundings, &goes_on)?;
    notes.extend(found.note);
    let span = scene.camera.exposure_span();
    let lights = Lights::new(&found.lights, found.map, &surroundings, span, spectral)
        .map_err(|fault| RenderError::lights(scene, fault))?;
    Ok(Some((rules, lights)))
}

/// The camera opened for the wavelengths of data, and that of light for those of light.
fn opened_cameras(scene: &Scene, plan: &Plan) -> Result<[Camera; 2], RenderError> {
    let open = |camera: &Camera, bands: &Bands| match plan.pupil {
        true => camera.opened(bands).map_err(|e| RenderError::camera(e.why)),
        false => Ok(camera.clone()),
    };
    let lit_by = plan.light_camera(scene);
    let is_own = std::ptr::eq(lit_by, &raw const scene.camera);
    // Beside another camera of light, the scene's own is looked through for averaged colours alone.
    let averages = plan.layers.iter().any(|layer| layer.is_averaged() && !layer.is_light());
    let camera = match is_own || averages {
        true => open(&scene.camera, &Bands::Rgb)?,
        false => scene.camera.clone(),
    };
    let light_camera = match is_own && plan.bands == Bands::Rgb {
        true => camera.clone(),
        false => open(lit_by, &plan.bands)?,
    };
    Ok([camera, light_camera])
}

/// Traces what a `state` wants onto a film.
///
/// # Errors
///
/// As [`render`]; when what was kept is of another render.
pub fn trace(
    scene: &Scene,
    plan: &Plan,
    Prepared { accel, images, others }: Prepared<'_>,
    header: &[HeaderEntry],
    state: &RenderState<'_>,
    watch: &dyn Watch,
) -> Result<Film, RenderError> {
    state.allows(plan.stopping)?;
    let mut layers = empty_film(scene, plan)?;
    let start = Instant::now();
    let [camera, light_camera] = opened_cameras(scene, plan)?;
    let shared = light_camera.lens().filter(|_| plan.band_paths.are_shared());
    let shared = shared.and_then(LensCamera::opened_paths);
    // Light that is spread as waves are is traced by itself.
    let whole = Prepared { accel, images, others };
    let spread = diffraction::spread_light(scene, plan, whole, state, &light_camera, watch, trace)?;
    // Lights, the studio among them where all else leaves the scene dark.
    let surroundings = surroundings(scene, images, scene.render.samples.typical());
    let traced = if plan.alike { &Bands::Grey } else { &plan.bands };
    let spectral = Spectral::of(traced, &scene.materials);
    let mut notes = Vec::new();
    let rendered = RenderedScene { scene, accel, images };
    let lit = match spread {
        Some(_) => None,
        None => light_of(rendered, plan, surroundings, &spectral, &mut notes, watch)?,
    };
    // What light passes ask of the scene.
    let emitters = lit.as_ref().and_then(|_| Emitters::of(&scene.geometry, &scene.materials));
    let placed = PlacedSurfaces::of(&scene.geometry, &scene.materials, &spectral);
    let light = lit.as_ref().map(|(rules, lights)| LightPass {
        ctx: LightingContext {
            accel,
            scene: surroundings,
            lights,
            spectral: &spectral,
            traits: Traits::of(&scene.geometry, &scene.materials, &placed),
            emitters: emitters.as_ref(),
            placed: &placed,
            precision: plan.light_precision,
        },
        tracer: *rules,
        camera: &light_camera,
        groups: plan.groups_of_light(&light_camera),
        count: plan.values_of_light(),
        rows: shared.map(|shared| shared.rows),
        margin: shared.map_or(0, |shared| shared.margin_pixels()),
        layers: plan.layers.iter().copied().filter(|layer| layer.is_light()).collect(),
        block_rays: None,
    });
    // The passes, kept shorter where a checkpoint is written after each.
    let so_far = |layers: &[&FilmLayer], samples| so_far(scene, plan, header, layers, samples);
    let shard = state.shard.unwrap_or(Shard::ALL);
    let checkpoint = state.checkpoint.as_ref();
    let is_kept = checkpoint.is_some() && plan.samples > 1;
    let passes = if is_kept { short_passes(plan.samples) } else { plan.passes.clone() };
    let others: Vec<&dyn OtherFrame> = others.iter().map(|other| other as _).collect();
    let rule = Rule::of(scene, plan);
    let sampling = sampling_of(scene, plan, shard, rule.as_ref());
    // All of it as one job, tile by tile.
    let job = Job {
        accel,
        others: &others,
        camera: &camera,
        groups: camera.band_groups(&Bands::Rgb),
        surroundings,
        detail: plan.detail,
        precision: plan.light_precision,
        sampling,
        rule,
        time: plan.stopping.time(),
        judged: scene.picture,
        passes: &passes,
        light: light.map(|light| light.in_blocks(sampling)),
        picture: &so_far,
        shares: state.shares,
        keeper: checkpoint
            .map(|file| Keeper::new(file, &state.identity, shard, plan.samples, scene)),
    };
    // What was traced, and what a user should know of it.
    let watcher = Watcher::new(watch, job.rays(&layers));
    let JobResult { traffic: mut counts, passed, sums, centres } =
        job.run(&mut layers, &watcher)?;
    notes.extend(job.keeper.as_ref().and_then(Keeper::fault));
    let trace_time = start.elapsed() + state.shares.iter().map(FilmFile::trace_time).sum();
    drop(job);
    diffraction::put(&mut layers, spread, &mut counts, &mut notes);
    let (camera, resolution) = (Some(camera), scene.camera.resolution());
    Ok(Film { layers, resolution, shard, counts, passed, trace_time, sums, centres, notes, camera })
}

/// Settings of how the pixels of a share are sampled.
fn sampling_of(scene: &Scene, plan: &Plan, shard: Shard, rule: Option<&Rule>) -> Sampling {
    Sampling {
        samples: plan.samples,
        sampler: scene.render.sampler,
        seed: scene.render.frame_seed(),
        shard,
        sets: if rule.is_some() { SETS } else { 1 },
        diffusion: scene.sensor.as_ref().map_or(0.0, Sensor::carrier_diffusion),
    }
}

pub(crate) fn empty_film(scene: &Scene, plan: &Plan) -> Result<Vec<FilmLayer>, NoMemory> {
    let [width, height] = scene.camera.resolution().map(|side| side as usize);
    plan.layers
        .iter()
        .map(|&layer| FilmLayer::new(layer, width * height, plan.precision, &plan.bands))
        .collect()
}

/// The picture on a film. With an accelerator it is judged, too, whether it is black.
///
/// # Errors
///
/// When no light got through the camera's lens, or the film holds no picture.
pub fn finish(
    scene: &Scene,
    plan: &Plan,
    film: Film,
    header: Vec<HeaderEntry>,
    accel: Option<&dyn Accel>,
) -> Result<Rendered, RenderError> {
    let Film { layers, counts, passed, trace_time, mut notes, camera, .. } = film;
    let SamplesTaken { samples, is_complete, counts: sample_counts } = passed;
    let samples_wanted = if is_complete { samples } else { plan.samples };
    let RayCounts { chief_rays, light, statuses, sparkles } = counts;
    // A lens through which no ray came has no picture.
    if let (true, 0, Some(element)) =
        (statuses.total() > 0, statuses.exited, statuses.farthest_from_sensor())
    {
        return Err(RenderError::dark(scene, element, &statuses.losses()));
    }
    notes.extend(sparkles.note_in_words());
    notes.extend(plan.not_as_asked.as_ref().map(|why| format!("samples: {why}")));
    notes.extend(sample_counts.filter(|_| is_complete).iter().flat_map(SampleCounts::notes));
    let words = sample_counts.map_or_else(|| samples.to_string(), |counts| counts.words());
    let header = marked(header, words, [samples, samples_wanted]);
    // The film as a picture, and whether it is black or clipped.
    let (picture, band_film) = finished(scene, plan, layers, header)?;
    if let (Some(camera), Some(accel)) = (&camera, accel)
        && scene.picture == Some(LayerSpec::Radiance)
    {
        notes.extend(lighting::verdict(scene, accel, camera, &picture));
    }
    notes.extend(names::notes(&picture, plan.outputs));
    let rays = chief_rays + light.rays + light.shadow_rays;
    Ok(Rendered {
        picture,
        samples,
        samples_wanted,
        sample_counts,
        band_film,
        rays,
        light,
        statuses,
        trace_time,
        notes,
    })
}

/// Finishes the film as a picture, and its light in bands of its own.
fn finished(
    scene: &Scene,
    plan: &Plan,
    mut film: Vec<FilmLayer>,
    header: Vec<HeaderEntry>,
) -> Result<(Picture, Option<expose::BandFilm>), PictureError> {
    let [width, height] = scene.camera.resolution().map(|side| side as usize);
    let mut band_film = None;
    let mut parts = Vec::new();
    let photodiodes = scene.sensor.as_ref().map_or(&[][..], expose::photodiodes);
    let is_photodiode = |spec| photodiodes.iter().any(|(layer, _)| *layer == spec);
    for layer in &mut film {
        let bands = expose::BandFilm::taken_from(layer, &plan.bands)?;
        // Of the picture and of photodiodes: other parts of its light are to look at.
        match (layer.spec, bands) {
            (LayerSpec::Radiance, bands) => band_film = bands,
            (spec, Some(bands)) if is_photodiode(spec) => parts.push((spec, bands.values)),
            _ => {}
        }
    }
    if let Some(film) = &mut band_film {
        film.parts = parts;
    }
    let mut layers: Vec<Layer> = film
        .into_iter()
        .flat_map(|layer| {
            let root = Some(layer.spec) == scene.picture;
            layer.into_layers(root)
        })
        .collect();
    layers.extend(expose::spectrum(scene, &layers, band_film.as_ref())?);
    let picture = Picture::new(width, height, layers, header)?.with_names(names::tables(scene));
    let development = Development::new(&scene.render, picture.layer(""));
    Ok((picture.developed(development), band_film))
}

/// `header` with the `words` for how many samples the pixels have; all have `samples`, of those asked for.
fn marked(
    mut header: Vec<HeaderEntry>,
    words: String,
    [samples, of]: [u32; 2],
) -> Vec<HeaderEntry> {
    header.push(HeaderEntry::new("samples", words));
    if samples < of {
        let words = format!("stopped after {samples} of {of} samples a pixel");
        header.push(HeaderEntry::new("partial", words));
    }
    header
}

/// The picture as it is among the `layers` that are averaged, with `samples` of each pixel.
fn so_far(
    scene: &Scene,
    plan: &Plan,
    header: &[HeaderEntry],
    layers: &[&FilmLayer],
    samples: u32,
) -> Result<Picture, PictureError> {
    let [width, height] = scene.camera.resolution().map(|side| side as usize);
    let picture = layers.iter().find(|layer| Some(layer.spec) == scene.picture);
    let layers = match picture {
        Some(layer) => {
            let mut layer = FilmLayer::clone(layer);
            expose::BandFilm::taken_from(&mut layer, &plan.bands)?;
            layer.into_layers(true)
        }
        None => Vec::new(),
    };
    let header = marked(header.to_vec(), samples.to_string(), [samples, plan.samples]);
    let picture = Picture::new(width, height, layers, header)?;
    let development = Development::new(&scene.render, picture.layer(""));
    Ok(picture.developed(development))
}

/// Size of the set of samples that those of the picture are taken from; `None` where the first of
/// them are the same however many follow, so that a render may go on from fewer.
#[must_use]
pub fn sample_set(scene: &Scene, plan: &Plan) -> Option<u32> {
    // Patterns are looked up over what a sample covers, which is less where there are more of them.
    let has_patterns = scene.materials.iter().any(Material::is_patterned);
    match has_patterns && scene.camera.pixel_extent().is_some() {
        true => Some(plan.samples),
        false => scene.render.sampler.set_size(plan.samples),
    }
}

fn surroundings<'a>(scene: &'a Scene, images: &'a Images, samples: u32) -> SceneView<'a> {
    let pose = scene.camera.pose();
    // The samples of a pixel share it.
    let share = 1.0 / f64::from(samples).sqrt();
    // Where nothing has a pattern, nothing is averaged.
    let patterned = scene.materials.iter().any(Material::is_patterned);
    let extent = scene.camera.pixel_extent().filter(|_| patterned);
    let pixel = extent.map(|extent| match extent {
        PixelExtent::Angle(angle) => Pixel::Angle(angle * share),
        PixelExtent::Width(width) => Pixel::Width(width * share),
    });
    SceneView {
        geometry: &scene.geometry,
        materials: &scene.materials,
        images: &images.decoded,
        view: View { origin: pose.position, axes: pose.rotation, pixel },
    }
}
