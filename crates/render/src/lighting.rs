//! Whether light reaches what the camera sees: before a render by a small picture, after it by the
//! picture itself.

use std::sync::Arc;

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_geometry::{Detail, HitBatch, HitPrecision, RayBatch};
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use etendue_tracer::{
    EnvironmentMap, LayerSpec, Light, LightingContext, Lights, PlacedSurfaces, Rules, SceneView,
    Spectral, Traits,
};

use crate::error::RenderError;
use crate::film::{FilmLayer, Precision};
use crate::output::{Picture, PictureError, Values, luminance};
use crate::radiance::LightPass;
use crate::samples::Sampling;
use crate::shard::Shard;
use crate::tiles::Job;
use crate::watch::Watcher;

/// The longer side of the small picture, and of the grid of pixels that are looked at (pixels).
const SIDE: u32 = 48;

/// Samples a pixel of the small picture.
const SAMPLES: u32 = 16;

/// Radiance below which a surface looks black: 6 of 255 in sRGB.
const BLACK: f64 = 0.002;

/// Emitters light a scene when at least this share of what the camera sees is not black.
const LIT: f64 = 0.25;

/// A picture gets a note when this share of what the camera sees is black, or is clipped.
const NEARLY_ALL: f64 = 0.9;

/// The lights of a scene as it is rendered.
#[derive(Debug)]
pub(crate) struct Lighting {
    pub(crate) lights: Vec<Light>,
    /// The image of the environment.
    pub(crate) map: Option<Arc<EnvironmentMap>>,
    /// What a user should know.
    pub(crate) note: Option<String>,
}

/// Adds the studio to the lights of a scene that names none, where its own emitters and lamps leave
/// nearly all that the camera sees in the dark. A lamp, a screen or a few lit windows on a model need
/// not shine on it.
///
/// # Errors
///
/// As a render.
pub(crate) fn settle(
    scene: &Scene,
    map: Option<Arc<EnvironmentMap>>,
    tracer: Rules,
    (accel, surroundings): (&dyn Accel, SceneView<'_>),
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Lighting, RenderError> {
    let mut lighting = Lighting { lights: scene.lights.clone(), map, note: None };
    if !scene.studio_if_dark {
        return Ok(lighting);
    }
    let spectral = Spectral::new(&Bands::Rgb);
    // The scene by its own lights alone.
    let lights = Lights::new(&lighting.lights, lighting.map.clone(), &surroundings, &spectral)
        .map_err(|error| RenderError::Lights(error.to_string()))?;
    let placed = PlacedSurfaces::of(&scene.geometry, &scene.materials);
    let stage = LightingContext {
        accel,
        surroundings,
        lights: &lights,
        spectral: &spectral,
        traits: Traits::of(&scene.geometry, &scene.materials),
        emitters: None,
        placed: &placed,
        precision: HitPrecision::Single,
    };
    let lit = lit_share(scene, tracer, stage, progress)?;
    if lit.is_none_or(|share| share >= LIT) {
        return Ok(lighting);
    }
    // They leave it dark: the studio shines as well.
    lighting.lights.push(Light::STUDIO);
    lighting.map = Some(Arc::new(EnvironmentMap::studio()));
    lighting.note = Some(
        "lights: what shines in the scene leaves nearly all of it in the dark, so a grey studio \
         lights it too; name `lights` in the scene for others, or `\"lights\": []` for none"
            .to_owned(),
    );
    Ok(lighting)
}

/// The share of what the camera sees that is not black under the lights of `stage`; `None` when it
/// sees nothing.
fn lit_share(
    scene: &Scene,
    tracer: Rules,
    stage: LightingContext<'_>,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Option<f64>, RenderError> {
    // A coarse picture of light alone.
    let [width, height] = scene.camera.resolution();
    let camera = scene.camera.coarser(width.max(height).div_ceil(SIDE));
    let camera = match camera.lens() {
        Some(_) => camera.opened(&Bands::Rgb).map_err(|e| RenderError::Camera(e.why))?,
        None => camera,
    };
    let [width, height] = camera.resolution();
    let pixels = width as usize * height as usize;
    let layer = |spec| FilmLayer::new(spec, pixels, Precision::Single, &Bands::Rgb);
    let mut film = [layer(LayerSpec::Radiance)?, layer(LayerSpec::Coverage)?];
    let groups = camera.band_groups(&Bands::Rgb);
    let pass: Vec<_> = std::iter::once(0..SAMPLES).collect();
    let job = Job {
        accel: stage.accel,
        others: &[],
        camera: &camera,
        groups: groups.clone(),
        surroundings: stage.surroundings,
        detail: Detail::Distance,
        precision: stage.precision,
        sampling: Sampling {
            samples: SAMPLES,
            sampler: scene.render.sampler,
            seed: scene.render.seed,
            shard: Shard::ALL,
            sets: 1,
        },
        rule: None,
        time: None,
        judged: None,
        shares: &[],
        keeper: None,
        light: Some(LightPass {
            stage,
            tracer,
            camera: &camera,
            groups,
            layers: vec![LayerSpec::Radiance],
        }),
        passes: &pass,
        picture: &|_, _| Err(PictureError::Empty { what: "the look".to_owned() }),
    };
    let watch = |_: f64| progress(0.0);
    let watcher = Watcher::new(&watch, job.rays(&film));
    job.run(&mut film, &watcher)?;
    let [light, coverage] = film.map(|layer| layer.into_planes());
    // How many of the pixels that see something are lit.
    let (mut seen, mut lit) = (0_u32, 0_u32);
    for i in 0..pixels {
        if coverage[0].at(i) > 0.0 {
            seen += 1;
            let rgb = std::array::from_fn(|k| light[k].at(i));
            lit += u32::from(luminance(rgb) >= BLACK);
        }
    }
    Ok((seen > 0).then(|| f64::from(lit) / f64::from(seen)))
}

/// What is wrong with the light of a finished picture as its PNG shows it, and which key mends it.
pub(crate) fn verdict((camera, accel): (&Camera, &dyn Accel), picture: &Picture) -> Option<String> {
    let layer = picture.layer("")?;
    let planes: Vec<&Values> = layer.channels.iter().map(|channel| &channel.values).collect();
    let [r, g, b] = *planes.as_slice() else { return None };
    let develop = picture.development();
    // Pixels without light, black ones and clipped ones.
    let (mut seen, mut dark, mut black, mut clipped) = (0_u32, 0_u32, 0_u32, 0_u32);
    for i in seen_pixels(camera, accel) {
        let rgb = [r, g, b].map(|plane| plane.at(i));
        seen += 1;
        dark += u32::from(luminance(rgb) <= 0.0);
        black += u32::from(develop.encode(rgb).iter().all(|c| *c < 0.025));
        clipped += u32::from(develop.clips(rgb));
    }
    let share = |count: u32| f64::from(count) / f64::from(seen.max(1));
    let percent =
        |count: u32| format!("picture: {:.0} % of what the camera sees", 100.0 * share(count));
    let auto = "`--set render.exposure=auto`, or a number of stops, mends picture.png; EXR and NPY \
                keep the radiance as it is";
    // The worst that holds of nearly all of them.
    if share(dark) >= NEARLY_ALL {
        return Some(format!(
            "{} sends no light at all: its materials are black, or no light reaches it; name other \
             `materials` or `lights` in the scene, or leave out the key `lights` for a grey studio",
            percent(dark)
        ));
    }
    if share(black) >= NEARLY_ALL {
        return Some(format!("{} is black: {auto}", percent(black)));
    }
    (share(clipped) >= NEARLY_ALL)
        .then(|| format!("{} is clipped to white: {auto}", percent(clipped)))
}

/// Of a grid of pixels, those whose chief rays hit something.
fn seen_pixels(camera: &Camera, accel: &dyn Accel) -> Vec<usize> {
    let [width, height] = camera.resolution();
    let step = width.max(height).div_ceil(SIDE).max(1) as usize;
    let rows = (step / 2..height as usize).step_by(step);
    let columns = move |row| (step / 2..width as usize).step_by(step).map(move |x| (x, row));
    let pixels: Vec<(usize, usize)> = rows.flat_map(columns).collect();
    let middle = |place: usize| place as f64 + 0.5;
    let (us, vs): (Vec<f64>, Vec<f64>) =
        pixels.iter().map(|&(x, y)| (middle(x), middle(y))).unzip();
    let mut rays = RayBatch::default();
    let mut hits = HitBatch::new(Detail::Distance);
    camera.rays_through(&us, &vs, &mut rays);
    accel.closest(&rays, &mut hits);
    let hit = pixels.iter().enumerate().filter(|&(i, _)| hits.is_hit(i));
    hit.map(|(_, &(x, y))| y * width as usize + x).collect()
}
