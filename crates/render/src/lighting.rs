//! Check that light reaches what the camera sees: before a render by a small picture, after it by the picture itself.

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
use crate::losses::Losses;
use crate::output::{
    Development, Layer, LayerFile, Look, Outputs, Picture, PictureError, Values, luminance,
};
use crate::radiance::LightPass;
use crate::sampling::Sampling;
use crate::shard::Shard;
use crate::tiles::Job;
use crate::watch::Watcher;

/// The longer side of the small picture, and of the grid of pixels that are looked at (pixels).
const SIDE: u32 = 48;

/// Samples a pixel of the small picture.
const SAMPLES: u32 = 16;

/// Radiance below which a surface looks black: 8 of 255 in sRGB.
const BLACK: f64 = 8.0 / 255.0 / 12.92;

/// The studio lights a scene when more than this share of what the camera sees is black without it.
const DARK: f64 = 0.5;

/// A picture none of which is quite black is told to be when this share of what the camera sees nearly is.
const NEARLY_ALL: f64 = 0.9;

/// Of sRGB from 0 to 1, what looks black at first sight: 6 of 255.
const NEARLY_BLACK: f32 = 0.025;

/// Of sRGB from 0 to 1, what rounds to 0 of 255.
const ZERO: f32 = 0.5 / 255.0;

/// The lights of a scene as it is rendered.
#[derive(Debug)]
pub(crate) struct Lighting {
    pub(crate) lights: Vec<Light>,
    /// The image of the environment.
    pub(crate) map: Option<Arc<EnvironmentMap>>,
    /// Note for the user.
    pub(crate) note: Option<String>,
}

/// Adds the studio to the lights of a scene that names none, where its own emitters and lamps leave
/// most of what the camera sees in the dark. A lamp, a screen or a few lit windows on a model need
/// not shine on it.
///
/// # Errors
///
/// As a render.
pub(crate) fn settle(
    scene: &Scene,
    map: Option<Arc<EnvironmentMap>>,
    tracer: Rules,
    accel: &dyn Accel,
    surroundings: SceneView<'_>,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Lighting, RenderError> {
    let mut lighting = Lighting { lights: scene.lights.clone(), map, note: None };
    if !scene.studio_if_dark {
        return Ok(lighting);
    }
    let spectral = Spectral::of(&Bands::Rgb, &scene.materials);
    // The scene by its own lights alone.
    let (map, span) = (lighting.map.clone(), scene.camera.exposure_span());
    let lights = Lights::new(&lighting.lights, map, &surroundings, span, &spectral)
        .map_err(|fault| RenderError::lights(scene, fault))?;
    let placed = PlacedSurfaces::of(&scene.geometry, &scene.materials, &spectral);
    let ctx = LightingContext {
        accel,
        scene: surroundings,
        lights: &lights,
        spectral: &spectral,
        traits: Traits::of(&scene.geometry, &scene.materials, &placed),
        emitters: None,
        placed: &placed,
        precision: HitPrecision::Single,
    };
    let dark = dark_share(scene, tracer, ctx, progress)?;
    if dark.share() <= DARK {
        return Ok(lighting);
    }
    // They leave it dark: the studio shines as well.
    lighting.lights.push(Light::STUDIO);
    lighting.map = Some(Arc::new(EnvironmentMap::studio()));
    lighting.note = Some(format!(
        "lights: what shines in the scene leaves {dark} of what the camera sees black, so a grey studio \
             lights it too; name `lights` in the scene for others, or `\"lights\": []` for none"
    ));
    Ok(lighting)
}

/// Share of what the camera sees that is black under the lights of `ctx`.
fn dark_share(
    scene: &Scene,
    tracer: Rules,
    ctx: LightingContext<'_>,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Losses, RenderError> {
    // A coarse picture of light alone.
    let [width, height] = scene.camera.resolution();
    let camera = scene.camera.coarser(width.max(height).div_ceil(SIDE));
    let camera = match camera.lens() {
        Some(_) => camera.opened(&Bands::Rgb).map_err(|e| RenderError::camera(e.why))?,
        None => camera,
    };
    let [width, height] = camera.resolution();
    let pixels = width as usize * height as usize;
    let layer = |spec| FilmLayer::new(spec, pixels, Precision::Single, &Bands::Rgb);
    let mut film = [layer(LayerSpec::Radiance)?, layer(LayerSpec::Coverage)?];
    let groups = camera.band_groups(&Bands::Rgb);
    let pass: Vec<_> = std::iter::once(0..SAMPLES).collect();
    let job = Job {
        accel: ctx.accel,
        others: &[],
        camera: &camera,
        groups: groups.clone(),
        surroundings: ctx.scene,
        detail: Detail::Distance,
        precision: ctx.precision,
        sampling: Sampling {
            samples: SAMPLES,
            sampler: scene.render.sampler,
            seed: scene.render.frame_seed(),
            shard: Shard::ALL,
            sets: 1,
            diffusion: 0.0,
        },
        rule: None,
        time: None,
        judged: None,
        shares: &[],
        keeper: None,
        light: Some(LightPass {
            ctx,
            tracer,
            camera: &camera,
            groups,
            count: Bands::Rgb.count(),
            rows: None,
            margin: 0,
            layers: vec![LayerSpec::Radiance],
            block_rays: None,
        }),
        passes: &pass,
        picture: &|_, _| Err(PictureError::empty("the look")),
    };
    let watch = |_: f64| progress(0.0);
    let watcher = Watcher::new(&watch, job.rays(&film));
    job.run(&mut film, &watcher)?;
    let [light, coverage] = film.map(|layer| layer.into_planes());
    let seen = (0..pixels).filter(|&i| coverage[0].at(i) > 0.0);
    let rgb = |i| std::array::from_fn(|k| light[k].at(i));
    Ok(Losses::count(seen.map(|i| luminance(rgb(i)) < BLACK)))
}

/// Notes on what is wrong with the light of a finished picture as its PNG shows it, and on the key that mends it.
pub(crate) fn verdict(
    scene: &Scene,
    accel: &dyn Accel,
    camera: &Camera,
    picture: &Picture,
) -> Vec<String> {
    let Some(layer) = picture.layer("") else { return Vec::new() };
    let planes: Vec<&Values> = layer.channels.iter().map(|channel| &channel.values).collect();
    let [r, g, b] = *planes.as_slice() else { return Vec::new() };
    let develop = picture.development();
    let seen = seen_pixels(camera, accel);
    let losses = |is_lost: &dyn Fn([f64; 3]) -> bool| {
        Losses::count(seen.iter().map(|&i| is_lost([r, g, b].map(|plane| plane.at(i)))))
    };
    let below = |rgb, limit| develop.encode(rgb).iter().all(|c| *c < limit);
    let unlit = losses(&|rgb| luminance(rgb) <= 0.0);
    let zero = losses(&|rgb| below(rgb, ZERO));
    let nearly_black = losses(&|rgb| below(rgb, NEARLY_BLACK));
    let clipped = losses(&|rgb| develop.clips(rgb));
    let auto = "`--set render.exposure=auto`, or a number of stops, mends picture.png; EXR and NPY \
                keep the radiance as it is";
    let mut notes = Vec::new();
    if zero.is_black() && 2 * unlit.lost >= zero.lost {
        // The studio stands around the scene.
        let mend = match scene.studio_if_dark || scene.lights.contains(&Light::STUDIO) {
            true => "`lights`, which in a closed room stand within it: the studio is outside",
            false => "`lights` in the scene, or leave out the key `lights` for a grey studio",
        };
        notes.push(format!(
            "picture: {unlit} of what the camera sees sends no light at all: its materials are black, or no \
             light reaches it; name other `materials` or {mend}"
        ));
    } else if zero.is_black() || nearly_black.share() >= NEARLY_ALL {
        let black = if zero.is_black() { zero } else { nearly_black };
        notes.push(format!("picture: {black} of what the camera sees is black: {auto}"));
    }
    if clipped.is_clipped() {
        notes.push(format!(
            "picture: {clipped} of what the camera sees is clipped to white: {auto}"
        ));
    }
    notes.extend(clipped_previews(picture, &seen));
    notes
}

/// Notes on what the previews of layers of colour beside the picture clip at `seen` pixels.
fn clipped_previews(picture: &Picture, seen: &[usize]) -> Vec<String> {
    let previews = picture.layers().iter().filter(|layer| {
        let is_shown =
            LayerFile::of(&layer.name, Outputs { png: true, ..Outputs::NONE }).next().is_some();
        !layer.name.is_empty() && layer.look == Look::Color && is_shown
    });
    let development = Development::default();
    let clipped = |layer: &Layer| {
        let planes: Vec<&Values> = layer.channels.iter().map(|channel| &channel.values).collect();
        let color = |i: usize| match *planes.as_slice() {
            [r, g, b] => [r, g, b].map(|plane| plane.at(i)),
            _ => [planes[0].at(i); 3],
        };
        Losses::count(seen.iter().map(|&i| development.clips(color(i))))
    };
    let notes = previews.filter_map(|layer| {
        let clipped = clipped(layer);
        clipped.is_clipped().then(|| {
            format!(
                "{}: {clipped} of what the camera sees is clipped to white; EXR and NPY keep it",
                LayerFile::Preview.name(&layer.name)
            )
        })
    });
    notes.collect()
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
