//! Response of the pixels of views, by rays: of the camera itself, as its raw picture is sampled,
//! and of the ideal lens that its views are held against. Light that the lenslets and the main lens
//! lose, places that their aberrations move, and how far both are spread.
//!
//! Both are asked for waves of [`PERIOD`] columns about a mean of 0.5: of a wave e^(iκx) a pixel shows
//! the mean of e^(iκx) over its rays. What is different is the error of the view.

use std::f64::consts::TAU;

use etendue_camera::{
    Camera, CameraRays, FilmSamples, LightField, Pose, Sampler, ViewGrid, squares_of_pair,
};
use etendue_scene::file::AccuracySpec;
use etendue_spectrum::Bands;
use rayon::prelude::*;

use super::centres::Centres;
use super::gain::{Gain, GainNode};

/// Sets of rays. Their errors have nothing to do with each other, so that the product of what both say of an
/// error has its square in the mean, and not that of their own.
const SETS: [u64; 2] = [0, 1];

/// The waves that views are held against: their length (columns) is what a view of a few dozen columns shows
/// well, and their amplitude leaves the darkest place a tenth of the brightest.
const PERIOD: f64 = 7.0;
const AMPLITUDE: f64 = 0.4;
const MEAN: f64 = 0.5;

/// The disparities at which they stand: those from 0.6 to 2.5 times the focus of a 50 mm f/4 with lenslets of
/// 15 pixels.
const DISPARITIES: [f64; 3] = [-0.2, 0.0, 0.2];

/// Of an ideal view's light, the least that is made up for: below, a view looks past the rim of the images.
const LEAST_LIGHT: f64 = 0.1;

/// Waves along rows and across them at each disparity.
const WAVES: usize = 2 * DISPARITIES.len();

type Complex = [f64; 2];

/// View of a pixel: its light, the means of the viewpoints (views, along the rows) and of the
/// places in the plane of disparity 0 (columns) that its rays come from, and what both sets of rays
/// say of waves in each colour that is looked at.
#[derive(Debug, Clone, Default)]
pub(super) struct PixelView {
    light: f64,
    viewpoint: [f64; 2],
    place: [f64; 2],
    colors: Vec<[Waves; SETS.len()]>,
}

/// Light, and the light of waves at each of [`DISPARITIES`] along the rows and across them.
#[derive(Debug, Clone, Copy, Default)]
struct Waves {
    light: f64,
    waves: [[Complex; 2]; DISPARITIES.len()],
}

/// Source of a pixel's value.
#[derive(Debug, Clone, Copy)]
enum PixelSource {
    /// A pixel whose corner is here.
    Pixel([f64; 2]),
    /// Cubic convolution of the pixels about a place (from the corner of the first one).
    Cubic([f64; 2]),
}

/// Rays of the views of a raw picture.
#[derive(Debug, Clone)]
pub(super) struct ViewRays {
    /// Rows and columns of the nodes.
    nodes: [Vec<u32>; 2],
    views: u32,
    /// Of each view, at each node.
    seen: Vec<Vec<PixelView>>,
}

/// Response of a camera's views, against an ideal lens'.
#[derive(Debug, Clone)]
pub(super) struct ViewResponse {
    /// Of each view: what its light is multiplied with to be that of the ideal lens.
    pub(super) gains: Vec<Gain>,
    /// Of each view: its waves against the ideal ones (dB).
    psnr: Vec<f64>,
    views: u32,
    /// Greatest mean distance (columns) of views from the ideal ones, by the main lens' distortion.
    pub(super) distortion: f64,
}

impl ViewRays {
    /// Traces the rays of a camera that is opened for red, green and blue: waves in these `colors`, light in
    /// green.
    ///
    /// Rays of a pixel through cubic convolution count less than nothing, some of them: of 1024 in each of two sets the
    /// light of one is right to a percent, and the squares of errors in the mean over 25 lenslets to 47 dB. Colours
    /// share them.
    pub(super) fn of_raw(
        camera: &Camera,
        light_field: &LightField,
        unit: &ViewGrid,
        centres: &Centres,
        colors: &[usize],
        accuracy: &AccuracySpec,
    ) -> Self {
        let green = camera.band_groups(&Bands::Rgb).len() / 2;
        let [cols, _] = unit.view_resolution();
        #[expect(clippy::cast_possible_truncation, reason = "three colours at most")]
        let count = (accuracy.view_cubic_rays / colors.len() as u32).max(1);
        let nodes = accuracy.view_nodes;
        Self::traced(light_field.views, unit, nodes, |number, [across, down], [row, col]| {
            let [right, below] = light_field.offset(across, down);
            let place = |color| {
                let centre = centres.sampled(color)[(row * cols + col) as usize];
                centre.map(|[x, y]| [x + right, y + below])
            };
            let waves = |&color: &usize| {
                let of =
                    RequestedRays { group: color, count, number, first_set: SETS.len() * color };
                let at = place(color);
                at.map_or_else(Vec::new, |at| {
                    seen(camera, &of, PixelSource::Cubic(at), unit).colors
                })
            };
            // The pixel at the place has the same light wherever that is even about it, and rays that
            // do not count less than nothing tell it with less noise.
            let count = accuracy.view_rays;
            let of = RequestedRays { group: green, count, number, first_set: 0 };
            let pixel = place(green).map_or_else(PixelView::default, |at| {
                seen(camera, &of, PixelSource::Pixel(at.map(|x| x - 0.5)), unit)
            });
            PixelView { colors: colors.iter().flat_map(waves).collect(), ..pixel }
        })
    }

    /// Traces the rays of an ideal lens with so many `views` a side.
    pub(super) fn of_reference(
        reference: &Camera,
        views: u32,
        unit: &ViewGrid,
        accuracy: &AccuracySpec,
    ) -> Self {
        let [cols, rows] = unit.view_resolution();
        let count = accuracy.view_rays;
        Self::traced(views, unit, accuracy.view_nodes, |number, [across, down], [row, col]| {
            let corner = [across * cols + col, down * rows + row].map(f64::from);
            let of = RequestedRays { group: 0, count, number, first_set: 0 };
            seen(reference, &of, PixelSource::Pixel(corner), unit)
        })
    }

    fn traced(
        views: u32,
        unit: &ViewGrid,
        most: u32,
        trace: impl Fn([u32; 2], [u32; 2], [u32; 2]) -> PixelView + Sync,
    ) -> Self {
        let [cols, rows] = unit.view_resolution();
        let nodes = [rows, cols].map(|count| spread(count, most));
        let cells: Vec<[u32; 2]> =
            nodes[0].iter().flat_map(|&row| nodes[1].iter().map(move |&col| [row, col])).collect();
        let view = |k: u32| {
            let seen = |(node, &cell)| trace([k, node], [k % views, k / views], cell);
            (0..).zip(&cells).map(seen).collect()
        };
        let seen = (0..views * views).into_par_iter().map(view).collect();
        Self { nodes, views, seen }
    }

    /// The middle `views` a side of them.
    fn middle(&self, views: u32) -> impl Iterator<Item = &Vec<PixelView>> {
        let (first, n) = ((self.views - views) / 2, self.views);
        (0..views * views)
            .map(move |k| &self.seen[((k / views + first) * n + k % views + first) as usize])
    }

    /// Ratio of the distance between viewpoints of the middle `views` a side to that of the
    /// paraxial lens: by least squares over the field.
    pub(super) fn pupil_share(&self, views: u32) -> f64 {
        let middle = 0.5 * (f64::from(views) - 1.0);
        let mut sums = [0.0; 2];
        for (k, view) in (0..).zip(self.middle(views)) {
            let nominal = [k % views, k / views].map(|at| f64::from(at) - middle);
            let lit = view.iter().filter(|seen| seen.light > 0.0);
            for seen in lit {
                for (found, nominal) in seen.viewpoint.into_iter().zip(nominal) {
                    sums[0] += found * nominal;
                    sums[1] += nominal.powi(2);
                }
            }
        }
        let share = sums[0] / sums[1];
        // One view has no distances, and what is far off is no view.
        if (0.5..2.0).contains(&share) { share } else { 1.0 }
    }
}

impl ViewResponse {
    /// The middle views of `ours` against an ideal lens', which are as many as there are to be.
    pub(super) fn new(ours: &ViewRays, ideal: &ViewRays) -> Self {
        let n = ideal.views;
        let [rows, cols] = &ours.nodes;
        let at = |node: usize| [rows[node / cols.len()], cols[node % cols.len()]];
        // Distortion moves all views alike.
        let mut bent = vec![[0.0; 2]; rows.len() * cols.len()];
        for (ours, ideal) in ours.middle(n).zip(&ideal.seen) {
            for (bent, (ours, ideal)) in bent.iter_mut().zip(ours.iter().zip(ideal)) {
                let moves = ours.place.into_iter().zip(ideal.place);
                for (bent, (ours, ideal)) in bent.iter_mut().zip(moves) {
                    *bent += (ours - ideal) / f64::from(n * n);
                }
            }
        }
        let judged = ours.middle(n).zip(&ideal.seen).map(|(ours, ideal)| {
            let pairs = || ours.iter().zip(ideal);
            let shares = pairs().enumerate().filter(|(_, (ours, ideal))| {
                ideal.light > 0.0 && ours.light > LEAST_LIGHT * ideal.light
            });
            let shares: Vec<GainNode> = shares
                .map(|(node, (ours, ideal))| GainNode {
                    at: at(node),
                    gain: ideal.light / ours.light,
                })
                .collect();
            let gain = Gain::fitted(&shares, [rows, cols].map(|nodes| nodes[nodes.len() - 1]));
            // The worst wave of the mean over the field.
            let mut sums = [0.0; WAVES];
            for (node, ((ours, ideal), &bent)) in pairs().zip(&bent).enumerate() {
                let errors = errors(ours, ideal, gain.at(at(node)), bent);
                sums = std::array::from_fn(|wave| sums[wave] + errors[wave]);
            }
            let worst = sums.into_iter().fold(0.0, f64::max) / ours.len() as f64;
            (gain, -10.0 * worst.max(1e-8).log10())
        });
        let (gains, psnr) = judged.unzip();
        let distortion = bent.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        Self { gains, psnr, views: n, distortion }
    }

    /// The worst of the middle `views` a side (dB).
    pub(super) fn worst(&self, views: u32) -> f64 {
        let (first, n) = ((self.views - views) / 2, self.views);
        let within = |at: u32| (first..first + views).contains(&at);
        let inner = (0..)
            .zip(&self.psnr)
            .filter(|(k, _)| within(k % n) && within(k / n))
            .map(|(_, db)| *db);
        inner.fold(f64::INFINITY, f64::min)
    }
}

/// The mean square of the difference between what a pixel makes of waves and what an ideal lens makes of
/// them, the mean over their phases and over colours: of each wave.
fn errors(ours: &PixelView, ideal: &PixelView, gain: f64, bent: [f64; 2]) -> [f64; WAVES] {
    let dark = [[Waves::default(); SETS.len()]];
    let ideal = ideal.colors.first().unwrap_or(&dark[0]);
    let colors = if ours.colors.is_empty() { &dark[..] } else { &ours.colors };
    colors.iter().fold([0.0; WAVES], |sums, ours| {
        let errors = errors_of(ours, ideal, gain, bent);
        std::array::from_fn(|wave| sums[wave] + errors[wave] / colors.len() as f64)
    })
}

/// Errors in one colour.
fn errors_of(
    ours: &[Waves; SETS.len()],
    ideal: &[Waves; SETS.len()],
    gain: f64,
    bent: [f64; 2],
) -> [f64; WAVES] {
    let means = [0, 1].map(|set| MEAN * (gain * ours[set].light - ideal[set].light));
    std::array::from_fn(|wave| {
        let (disparity, axis) = (wave / 2, wave % 2);
        let (sine, cosine) = (-TAU / PERIOD * bent[axis]).sin_cos();
        let [first, second] = [0, 1].map(|set| {
            let [re, im] = ours[set].waves[disparity][axis];
            let moved = [re * cosine - im * sine, re * sine + im * cosine];
            let expected = ideal[set].waves[disparity][axis];
            [gain * moved[0] - expected[0], gain * moved[1] - expected[1]]
        });
        let square = first[0] * second[0] + first[1] * second[1];
        means[0] * means[1] + 0.5 * AMPLITUDE * AMPLITUDE * square
    })
}

/// At most so many (two at least) of all, the first and the last among them.
fn spread(count: u32, most: u32) -> Vec<u32> {
    let last = count.saturating_sub(1);
    let steps = last.clamp(1, most - 1);
    let mut nodes: Vec<u32> = (0..=steps).map(|k| k * last / steps).collect();
    nodes.dedup();
    nodes
}

/// A place among four pixels whose middle two stand on both sides of `at`, by a number in 0..=1, so that
/// they are met as often as cubic convolution weighs them; and what each then counts.
fn cubic(at: f64, number: f64) -> (f64, f64) {
    let low = (at - 0.5).floor();
    let weights = weights(at - 0.5 - low);
    let total: f64 = weights.iter().map(|weight| weight.abs()).sum();
    let (mut before, mut pixel) = (0.0, 0);
    while pixel < 3 && before + weights[pixel].abs() < number * total {
        before += weights[pixel].abs();
        pixel += 1;
    }
    let within = (number * total - before) / weights[pixel].abs().max(f64::MIN_POSITIVE);
    (low - 1.0 + pixel as f64 + within.clamp(0.0, 1.0), total * weights[pixel].signum())
}

/// The rays that are asked for.
struct RequestedRays {
    /// Of the camera's bands.
    group: usize,
    /// In each set.
    count: u32,
    /// Numbers that make the samples those of one pixel alone, and of one colour.
    number: [u32; 2],
    first_set: usize,
}

/// View of a pixel of a camera, by rays of its own.
fn seen(
    camera: &Camera,
    asked: &RequestedRays,
    sampling: PixelSource,
    unit: &ViewGrid,
) -> PixelView {
    let RequestedRays { group, count: count_of_set, number, first_set } = *asked;
    let mut film = FilmSamples { group, ..FilmSamples::default() };
    let mut counts = Vec::with_capacity(SETS.len() * count_of_set as usize);
    let mut squares = [Vec::new(), Vec::new(), Vec::new()];
    for set in SETS {
        let pixel =
            Sampler::Sobol.pixel(first_set as u64 + set, number[0], number[1], count_of_set);
        for (pair, out) in (0..).zip(&mut squares) {
            squares_of_pair(pixel.samples(0..count_of_set), pair, out);
        }
        let [places, pupil, spectrum] = &squares;
        for ((place, pupil), spectrum) in places.iter().zip(pupil).zip(spectrum) {
            let (place, count) = match sampling {
                PixelSource::Pixel([x, y]) => ([x + place[0], y + place[1]], 1.0),
                PixelSource::Cubic([x, y]) => {
                    let ((x, across), (y, down)) = (cubic(x, place[0]), cubic(y, place[1]));
                    ([x, y], across * down)
                }
            };
            film.push(place, *pupil, spectrum[0]);
            counts.push(count / f64::from(count_of_set));
        }
    }
    let mut rays = CameraRays::default();
    camera.sample_rays(&film, &mut rays);
    let mut seen = PixelView::default();
    let mut sets = [Waves::default(); SETS.len()];
    let (sine, cosine) = unit.rotation().sin_cos();
    let along_rows =
        |[right, up]: [f64; 2]| [cosine * right - sine * up, -sine * right - cosine * up];
    for (i, (weight, &sample)) in rays.weight.iter().zip(&rays.sample).enumerate() {
        let weight = weight * counts[sample as usize];
        let (viewpoint, place) = crossing(camera.pose(), &rays, i, unit);
        let (viewpoint, place) = (along_rows(viewpoint), along_rows(place));
        let set = &mut sets[usize::from(sample >= count_of_set)];
        set.light += weight;
        for axis in 0..2 {
            seen.viewpoint[axis] += weight * viewpoint[axis];
            seen.place[axis] += weight * place[axis];
            for (wave, disparity) in set.waves.iter_mut().zip(DISPARITIES) {
                let phase = TAU / PERIOD * (place[axis] + disparity * viewpoint[axis]);
                let (sine, cosine) = phase.sin_cos();
                wave[axis][0] += weight * cosine;
                wave[axis][1] += weight * sine;
            }
        }
    }
    let light: f64 = sets.iter().map(|set| set.light).sum();
    seen.light = light / SETS.len() as f64;
    if light.abs() > 0.0 {
        seen.viewpoint = seen.viewpoint.map(|x| x / light);
        seen.place = seen.place.map(|x| x / light);
    }
    seen.colors = vec![sets];
    seen
}

/// Points where a ray crosses the entrance pupil (views) and the plane of disparity 0 (columns), right and up.
fn crossing(pose: &Pose, rays: &CameraRays, i: usize, unit: &ViewGrid) -> ([f64; 2], [f64; 2]) {
    let back = pose.rotation.transpose();
    let origin = back * (rays.rays.origin(i) - pose.position);
    let direction = back * rays.rays.direction(i);
    let slopes = [direction.x, direction.y].map(|x| -x / direction.z);
    let pupil = [origin.x + slopes[0] * origin.z, origin.y + slopes[1] * origin.z];
    let vergence = 1.0 / unit.focus();
    let place = |k: usize| (slopes[k] + pupil[k] * vergence) * unit.focal_length();
    (pupil.map(|x| x / unit.baseline()), [place(0), place(1)])
}

/// The weights of four neighbours for a place between the middle two, `t` in 0..=1.
pub(super) fn weights(t: f64) -> [f64; 4] {
    let near = |x: f64| (1.5 * x - 2.5) * x * x + 1.0;
    let far = |x: f64| ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0;
    [far(1.0 + t), near(t), near(1.0 - t), far(2.0 - t)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places that are met by their weights have the means of cubic convolution: of a parabola, which it gives
    /// back, with the twelfth that a pixel's own width adds.
    #[test]
    fn places_are_met_as_cubic_convolution_weighs_them() {
        for at in [3.0, 3.2, 3.5, 3.93] {
            let mut sums = [0.0; 3];
            for k in 0..100_000 {
                let (place, count) = cubic(at, (f64::from(k) + 0.5) / 1e5);
                sums = [sums[0] + count, sums[1] + count * place, sums[2] + count * place * place];
            }
            let means = sums.map(|sum| sum / 1e5);
            for (found, expected) in means.iter().zip([1.0, at, at * at + 1.0 / 12.0]) {
                // A number that falls into the wrong pixel is one in 10^5 of a place of up to 30.
                assert!((found - expected).abs() < 1e-3, "{at}: {means:?}");
            }
        }
    }
}
