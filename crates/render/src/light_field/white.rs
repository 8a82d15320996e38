//! The white image: the same camera before a uniform light, of which no scene is asked.

use std::ops::Range;

use etendue_camera::{Camera, CameraRays, FilmSamples, squares_of_pair};
use etendue_scene::file::RenderSpec;
use etendue_spectrum::Bands;
use rayon::prelude::*;

use super::set::LightFieldError;
use crate::output::{Channel, HeaderEntry, Layer, Look, Picture, Values};

/// Greatest difference of the weights of a pixel, as a share of the largest, at which they are alike: cos⁴ takes half
/// within a lenslet's light at f/1. Sixteen stratified samples of what changes so evenly have its mean to a percent.
/// Not a setting: how many samples are taken is one (`white_samples`).
const ALIKE: f64 = 0.6;

/// Picture of radiance 1 everywhere, by a camera that is opened for red, green and blue, of so many samples a pixel.
pub(super) fn picture(
    camera: &Camera,
    spec: &RenderSpec,
    samples: u32,
) -> Result<Picture, LightFieldError> {
    let [width, height] = camera.resolution();
    let rows = white_rows(camera, spec, samples, &(0..height).collect::<Vec<u32>>());
    let channel = |(k, name): (usize, &str)| {
        let values = rows.iter().flat_map(|row| row[k].iter().copied()).collect();
        Channel { name: name.to_owned(), values: Values::F32(values) }
    };
    let channels = ["R", "G", "B"].into_iter().enumerate().map(channel).collect();
    let definition = "the picture of a radiance of 1 from everywhere";
    let meaning = vec![HeaderEntry::new("definition", definition)];
    let layer = Layer { name: String::new(), look: Look::Color, channels, meaning };
    Ok(Picture::new(width as usize, height as usize, vec![layer], Vec::new())?)
}

/// The samples of a pixel.
fn place(film: &mut FilmSamples, spec: &RenderSpec, [column, row]: [u32; 2], samples: u32) {
    let pixel = spec.sampler.pixel(spec.frame_seed(), column, row, samples);
    let numbers = pixel.samples(0..samples);
    let mut squares = [Vec::new(), Vec::new(), Vec::new()];
    for (pair, out) in (0..).zip(&mut squares) {
        squares_of_pair(numbers.clone(), pair, out);
    }
    let [places, pupil, spectrum] = squares;
    for ((place, pupil), spectrum) in places.iter().zip(pupil).zip(spectrum) {
        film.push([f64::from(column) + place[0], f64::from(row) + place[1]], pupil, spectrum[0]);
    }
}

/// These rows of the white image of a camera that is opened for red, green and blue, each in three bands: of so many
/// samples a pixel, and of a quarter of them where all of those get through alike.
#[must_use]
pub fn white_rows(
    camera: &Camera,
    spec: &RenderSpec,
    samples: u32,
    rows: &[u32],
) -> Vec<[Vec<f32>; 3]> {
    let numbers = [(samples / 4).max(1), samples];
    let groups = camera.band_groups(&Bands::Rgb);
    let [width, _] = camera.resolution();
    let row = |&row: &u32| -> [Vec<f32>; 3] {
        let mut sums = vec![[0.0; 3]; width as usize];
        let (mut film, mut rays) = (FilmSamples::default(), CameraRays::default());
        for column in 0..width {
            for (number, group) in groups.iter().enumerate() {
                let mut light = 0.0;
                // More samples only where the first ones differ.
                for samples in numbers {
                    film.clear();
                    film.group = number;
                    place(&mut film, spec, [column, row], samples);
                    camera.sample_rays(&film, &mut rays);
                    light = rays.weight.iter().sum::<f64>() / f64::from(samples);
                    let [low, high] = rays
                        .weight
                        .iter()
                        .fold([f64::MAX, 0.0_f64], |[low, high], w| [low.min(*w), high.max(*w)]);
                    if rays.weight.len() == samples as usize && high - low <= ALIKE * high {
                        break;
                    }
                }
                let bands: Range<usize> = group.bands.clone();
                sums[column as usize][bands].fill(light);
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let plane = |k: usize| sums.iter().map(|sum| sum[k] as f32).collect();
        [plane(0), plane(1), plane(2)]
    };
    rows.par_iter().map(row).collect()
}
