//! Forecast of a render's memory, from counts and headers alone.

use etendue_image::MOST_BYTES;
use etendue_scene::file::SETS;
use etendue_scene::{MemoryForecast, Scene};
use etendue_sensor::{Sensor, SensorKind};
use etendue_spectrum::Bands;
use etendue_tracer::{ClearSky, EnvironmentImage, EnvironmentMap, LayerSpec, Material, texture};

use crate::film::bytes_of_plane;
use crate::images::{environment, wanted_images};
use crate::light_field::refocused_bytes;
use crate::output::Outputs;
use crate::samples::BYTES_OF_SUM;
use crate::{Plan, annotations, denoise, diffraction, expose};

const F32: u64 = size_of::<f32>() as u64;
const U16: u64 = size_of::<u16>() as u64;

/// Bytes of a texel of an environment (three f32), of the image that it is made from, and of a cell of
/// the table that directions are chosen by.
const ENVIRONMENT: f64 = 2.7;

/// Bytes that the pixels of a PNG take while they are packed.
const PNG: u64 = 6;

/// Forecasts the memory that rendering `scene` as planned will take, written as `outputs`.
pub(crate) fn forecast(scene: &Scene, plan: &Plan, outputs: Outputs) -> MemoryForecast {
    let [width, height] = scene.camera.resolution().map(u64::from);
    let pixels = width.saturating_mul(height);
    let each = |bytes: u64| pixels.saturating_mul(bytes);
    let picture = plan.layers.iter().find(|layer| Some(**layer) == scene.picture);
    let picture = picture.map_or(0, |layer| bytes_of_layer(*layer, plan));
    let woven = match (&plan.bands, plan.layers.contains(&LayerSpec::Radiance)) {
        // The light in its bands once more, and red, green and blue of it.
        (bands, true) if *bands != Bands::Rgb => F32 * (bands.count() as u64 + 3),
        _ => 0,
    };
    let is_gone_over = plan.passes.len() > 1;
    let look = if is_gone_over && outputs.png { picture + woven + PNG } else { 0 };
    let png = if outputs.png { PNG } else { 0 };
    let denoised = if plan.outputs.denoised { denoise::BYTES } else { 0 };
    let told_apart = annotations::bytes_a_pixel(outputs);
    let sensor = scene.sensor.as_ref().filter(|_| scene.picture.is_some());
    let sensor = sensor.map_or(0, |sensor| bytes_of_sensor(scene, sensor, plan));
    let film: u64 = plan.layers.iter().map(|layer| bytes_of_layer(*layer, plan)).sum();
    // Of slots there is the light of one, and the sum of all in f64.
    let lit = plan.layers.iter().filter(|layer| layer.is_light() && scene.slots > 0);
    let slots: u64 = lit.map(|layer| 3 * bytes_of_layer(*layer, plan)).sum();
    MemoryForecast {
        images: images(scene, plan),
        film: each(film).saturating_add(diffraction::bytes(scene, plan)),
        sums: each(bytes_of_sums(plan) + slots),
        sensor: each(if sensor > 0 { sensor.max(woven) } else { 0 }),
        files: each(look.max(png + denoised).max(told_apart).max(if sensor > 0 {
            0
        } else {
            woven
        })),
        views: views(scene, plan, outputs),
        ..MemoryForecast::of(scene)
    }
    .summed()
}

/// Bytes of what a light field leaves beside its raw picture: the white one, and views or a refocused picture. Views are
/// decoded, or rendered as an ideal lens has them and then taken apart and shown side by side, whichever is more.
fn views(scene: &Scene, plan: &Plan, outputs: Outputs) -> u64 {
    let (Some(light_field), Some(lens)) = (scene.camera.light_field(), scene.camera.lens()) else {
        return 0;
    };
    let [width, height] = scene.camera.resolution().map(u64::from);
    // Rows of it, and then planes of those.
    let white = F32 * 3 * width * height;
    let Some(&picture) = plan.layers.iter().find(|layer| Some(**layer) == scene.picture) else {
        return 2 * white;
    };
    if scene.camera.no_views().is_some() {
        return white + white.max(refocused_bytes(lens, light_field));
    }
    let grid = &light_field.grid;
    let side = |count: u32| u64::from(count) * u64::from(light_field.views);
    let bands = if expose::has_spectrum(scene) { plan.bands.count() as u64 } else { 0 };
    let arrays = F32 * (3 + bands);
    let averaged = if picture == LayerSpec::Radiance { plan.bands.count() as u64 } else { 3 };
    let shown = F32 * 3 + if outputs.png { PNG } else { 0 };
    let reference = bytes_of_layer(picture, plan) + (BYTES_OF_SUM * averaged).max(arrays + shown);
    let views = side(grid.rows).saturating_mul(side(grid.cols));
    white + white.max(views.saturating_mul(reference.max(2 * arrays)))
}

/// Bytes a pixel of what is kept between passes.
fn bytes_of_sums(plan: &Plan) -> u64 {
    let sets = match plan.stopping.is_adaptive() {
        true => u64::from(SETS),
        false => u64::from(plan.passes.len() > 1),
    };
    if sets == 0 && plan.band_paths.are_shared() {
        let lit = plan.layers.iter().filter(|layer| layer.is_light()).count();
        return BYTES_OF_SUM * (lit * plan.bands.count()) as u64;
    }
    BYTES_OF_SUM * sets * averaged(plan)
}

/// Values of a pixel that are averaged over samples.
fn averaged(plan: &Plan) -> u64 {
    let values = |layer: &LayerSpec| match layer.is_light() {
        true => plan.values_of_light() as u64,
        false => 3,
    };
    plan.layers.iter().filter(|layer| layer.is_averaged()).map(values).sum()
}

/// Bytes a pixel of the planes of a layer.
fn bytes_of_layer(layer: LayerSpec, plan: &Plan) -> u64 {
    let planes = match layer == LayerSpec::Variance || layer.is_light() {
        true => plan.bands.count(),
        false => layer.row().channels.len(),
    };
    planes as u64 * bytes_of_plane(layer, plan.precision)
}

/// Bytes a pixel of what a sensor makes of the light: its bands, the numbers, their preview, expected
/// values and variances, and what is merged of exposures.
fn bytes_of_sensor(scene: &Scene, sensor: &Sensor, plan: &Plan) -> u64 {
    let bands = plan.bands.count() as u64;
    bytes_exposed(sensor, bands, if expose::has_spectrum(scene) { bands } else { 0 })
}

/// Bytes a pixel of light in so many bands, of so many of another copy of it, and of what a sensor makes of it.
pub(crate) fn bytes_exposed(sensor: &Sensor, bands: u64, cube: u64) -> u64 {
    let depth = sensor.depth() as u64;
    let channels = match sensor.spec().kind {
        SensorKind::Raw => 3,
        SensorKind::Rgb | SensorKind::Multispectral => depth,
    };
    let numbers = U16 * depth * if depth > 1 { 2 } else { 1 };
    // Demosaiced, then in linear sRGB, pixel by pixel and plane by plane.
    let preview = F32 * (channels + 3 + 3) + PNG;
    let moments = match sensor.spec().moments {
        Some(true) => 2 * size_of::<f64>() as u64 * depth + F32 * depth,
        _ => 0,
    };
    // Of each number its sums, which exposures of it count, and what is written.
    let merged = match sensor.spec().hdr {
        Some(true) => 4 * size_of::<f64>() as u64 * depth + 3 * F32 * depth,
        _ => 0,
    };
    F32 * (bands + cube) + numbers + preview.max(moments).max(merged)
}

/// Bytes of the images that the plan's materials look at, and of the environment.
fn images(scene: &Scene, plan: &Plan) -> u64 {
    let wanted = wanted_images(scene, plan);
    let pairs = scene.textures.iter().zip(&wanted).filter(|(_, wanted)| wanted.is_some());
    // Of an image that is too large to be decoded at all, that is what is said.
    let decodable = |bytes: u64| if bytes > MOST_BYTES { 0 } else { bytes };
    let textures = pairs.map(|(texture, _)| {
        let bytes = decodable(texture.decoded_bytes());
        // The pyramid of means, of 16 bits a channel.
        if plan.footprint { bytes.saturating_add(bytes / 3 * 2) } else { bytes }
    });
    let cubes = scene.materials.iter().flat_map(Material::cubes);
    let cubes = cubes.map(|cube| cube.cube.bytes_in(&plan.bands));
    let textures = textures.chain(cubes).fold(0, u64::saturating_add);
    match environment(scene) {
        Some(EnvironmentImage::File(path)) if plan.layers.contains(&LayerSpec::Radiance) => {
            #[expect(
                clippy::cast_precision_loss,
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a forecast"
            )]
            let bytes = (decodable(texture::decoded_bytes(path)) as f64 * ENVIRONMENT) as u64;
            textures.saturating_add(bytes)
        }
        Some(EnvironmentImage::Cube(cube)) => {
            let [width, height] = cube.size();
            let looks = match plan.layers.contains(&LayerSpec::Radiance) {
                true => EnvironmentMap::LOOK_BYTES * (width * height) as u64,
                false => 0,
            };
            textures.saturating_add(cube.bytes_in(&plan.bands)).saturating_add(looks)
        }
        Some(EnvironmentImage::ClearSky(_)) if plan.layers.contains(&LayerSpec::Radiance) => {
            let rows = scene.accuracy.sky_rows;
            textures.saturating_add(ClearSky::map_bytes(plan.bands != Bands::Rgb, rows))
        }
        _ => textures,
    }
}
