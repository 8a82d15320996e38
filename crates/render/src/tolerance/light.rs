//! The fewest surfaces to which light has to be followed: by small pictures of the scene, whose pixels are the blocks
//! that the tolerance speaks of. All of them draw the same random numbers, so that what a path brings beyond a surface
//! is the difference of two of them, without noise of its own.

use etendue_camera::Camera;
use etendue_scene::file::{SamplesSpec, TracerSpec};
use etendue_tracer::LayerSpec;

use super::lens_models;
use super::taken::{Approximations, LensModelKind, TakenBounces};
use crate::output::Outputs;
use crate::{Plan, RenderError, RenderedScene, Watch, render};

/// Blocks of the picture whose light is compared (pixels a side).
pub(super) const BLOCK: u32 = 8;

/// The longer side of the small pictures, at most.
const SIDE: u32 = 28;

/// Samples of their pixels, at least and at most. Not a setting: all of these pictures draw the same numbers, so that
/// their differences have little noise, and what was taken is verified by `tolerance_samples`.
const SAMPLES: [u64; 2] = [8, 32];

/// A small picture has so many times fewer samples than the picture itself, so that looking takes a few hundredths of
/// its time: some five of them are rendered.
const FEWER: u64 = 128;

/// The numbers of surfaces among which the fewest are looked for.
const STEPS: [u32; 11] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24];

/// Factor on the share of nine blocks together: single ones among them have more.
const SAFETY: f64 = 2.0;

/// The share of blocks that are to be within the tolerance.
pub(super) const MOST_BLOCKS: f64 = 0.99;

/// The fewest surfaces whose longer paths bring at most the share `light` in 99 % of blocks, of a picture with so many
/// samples in all; `None` where the scene follows light no farther than that.
pub(super) fn fewest(
    rendered: RenderedScene<'_>,
    light: f64,
    samples: u64,
    notes: &mut Vec<String>,
    watch: &dyn Watch,
) -> Result<Option<TakenBounces>, RenderError> {
    let scene = rendered.scene;
    let Some(TracerSpec::Path { max_bounces }) = scene.tracer else { return Ok(None) };
    if max_bounces < 2 {
        return Ok(None);
    }
    let camera = match lens_models::near_axis(&scene.camera) {
        // What a lens does beside is nothing to bounces.
        Ok(found) => match found.models.into_iter().next() {
            Some(model) if model.kind == LensModelKind::Pinhole => model.camera,
            _ => scene.camera.clone(),
        },
        Err(_) => scene.camera.clone(),
    };
    let [width, height] = camera.resolution();
    let camera = camera.coarser(width.max(height).div_ceil(SIDE).max(BLOCK));
    let pixels: u64 = camera.resolution().map(u64::from).iter().product();
    let [least, most] = SAMPLES;
    #[expect(clippy::cast_possible_truncation, reason = "at most 32")]
    let samples = (samples / (FEWER * pixels)).clamp(least, most) as u32;
    let small = |bounces: u32| {
        let mut scene = scene.clone();
        scene.tracer = Some(TracerSpec::Path { max_bounces: bounces });
        values(RenderedScene { scene: &scene, ..rendered }, &camera, samples, None, watch)
    };
    let width = camera.resolution()[0] as usize;
    let all = pooled(&small(max_bounces)?, width);
    let share = |bounces: u32| {
        let found = differing(&pooled(&small(bounces)?, width), &all);
        Ok::<_, RenderError>(SAFETY * found)
    };
    // What longer paths bring falls with their length: between a number that is too few and one that will do.
    let steps: Vec<u32> = STEPS.into_iter().filter(|&step| step < max_bounces).collect();
    let (mut low, mut high) = (0, steps.len());
    let mut enough = (max_bounces, 0.0);
    while low < high {
        let middle = low + (high - low) / 2;
        let found = share(steps[middle])?;
        match found <= light {
            true => (enough, high) = ((steps[middle], found), middle),
            false => low = middle + 1,
        }
    }
    if enough.0 >= max_bounces {
        notes.push("the last surfaces of paths bring more light than it allows".to_owned());
        return Ok(None);
    }
    Ok(Some(TakenBounces { bounces: enough.0, share: enough.1 }))
}

/// The light of a picture of a scene through `camera`, by pixels: red, green and blue added up.
pub(super) fn values(
    RenderedScene { scene, accel, images }: RenderedScene<'_>,
    camera: &Camera,
    samples: u32,
    taken: Option<Approximations>,
    watch: &dyn Watch,
) -> Result<Vec<f64>, RenderError> {
    let mut scene = scene.clone();
    scene.camera = camera.clone();
    scene.sensor = None;
    scene.tolerance = None;
    scene.render.samples = SamplesSpec::Count(samples);
    scene.layers = vec![LayerSpec::Radiance];
    let outputs = Outputs { npy: true, ..Outputs::NONE };
    let plan = Plan::taking(&scene, outputs, taken);
    let goes_on = |_: f64| watch.goes_on(0.0);
    let done = render(&scene, &plan, accel, images, Vec::new(), &goes_on)?;
    if done.samples < done.samples_wanted {
        return Err(RenderError::Stopped);
    }
    let [width, height] = camera.resolution().map(|side| side as usize);
    let layer = done.picture.layer("");
    let channels = layer.into_iter().flat_map(|layer| &layer.channels);
    let mut sums = vec![0.0; width * height];
    for channel in channels {
        sums.iter_mut().enumerate().for_each(|(i, sum)| *sum += channel.values.at(i));
    }
    Ok(sums)
}

/// The sums of each pixel and the eight around it: what long paths bring is noisy, and changes little from block to
/// block.
fn pooled(values: &[f64], width: usize) -> Vec<f64> {
    let rows = values.len() / width.max(1);
    let neighbours = |at: usize, side: usize| at.saturating_sub(1)..(at + 2).min(side);
    let sum = |x: usize, y: usize| -> f64 {
        let row = |y: usize| values[y * width..][neighbours(x, width)].iter().sum::<f64>();
        neighbours(y, rows).map(row).sum()
    };
    let places = (0..rows).flat_map(|y| (0..width).map(move |x| (x, y)));
    places.map(|(x, y)| sum(x, y)).collect()
}

/// The share of light by which 99 % of the values of `own` differ from those of `all` at most; of black ones, none.
pub(super) fn differing(own: &[f64], all: &[f64]) -> f64 {
    let share = |(own, all): (&f64, &f64)| match *all > 0.0 {
        true => (own - all).abs() / all,
        false => 0.0,
    };
    let mut shares: Vec<f64> = own.iter().zip(all).map(share).collect();
    shares.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of them")]
    let place = (MOST_BLOCKS * shares.len() as f64).ceil() as usize;
    shares.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
}
