//! Rays of the scene that all bands share, and where each band's light of them lands ([`band_paths`](super::band_paths)
//! has why).

use etendue_optics::element::{Clip, LensRays, Ray, RayStatus};
use etendue_optics::train::{MonochromaticTrain, RimTrace, Side};
use glam::DVec3;

use super::lens_camera::LensCamera;
use super::nodes::{MOST_NODES, NodeWeights};
use super::opened::{BandInterpolation, place_of};
use crate::{CameraRays, FilmSamples, Pose};

/// Landing points of the light of each band that comes along rays which all bands share, `[ray][band]`.
#[derive(Debug, Clone, Default)]
pub struct BandLandings {
    /// The pixel, counted row by row; [`Self::NOWHERE`] where the band's light does not arrive.
    pub pixel: Vec<u32>,
    /// Weight of the ray's radiance in the band in the mean over the samples of that pixel.
    pub weight: Vec<f64>,
    /// Of each ray where it leaves the lens (mm), its direction, its weight before the lens, and its node.
    points: Vec<DVec3>,
    directions: Vec<DVec3>,
    weights: Vec<f64>,
    leading: Vec<usize>,
    /// True of rays whose places at all nodes are known without tracing them.
    is_known: Vec<bool>,
    /// Before the lens is passed: the weights of a batch.
    before: Vec<f64>,
    /// And what becomes of it at the rims, and its displacements (mm), `[node][ray]`.
    rims: RimTrace,
    shifts: Vec<Vec<[f64; 2]>>,
    /// `[ray][node]`: the place (pixels), and the share that the lens passes, 0 where it ends.
    places: Vec<[f64; 2]>,
    shares: Vec<f64>,
}

impl BandLandings {
    /// No pixel.
    pub const NOWHERE: u32 = u32::MAX;
}

/// The film, and the margin beside it from which rays start (pixels).
#[derive(Debug, Clone, Copy)]
pub(super) struct StartArea {
    pub(super) resolution: [u32; 2],
    pub(super) margin: f64,
}

impl StartArea {
    /// True if a place is on the film.
    #[inline(always)]
    fn is_seen(&self, [x, y]: [f64; 2]) -> bool {
        let [width, height] = self.resolution.map(f64::from);
        x >= 0.0 && y >= 0.0 && x < width && y < height
    }

    /// True if rays start from a place.
    #[inline(always)]
    fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let margin = self.margin;
        let [width, height] = self.resolution.map(|side| f64::from(side) + margin);
        x >= -margin && y >= -margin && x < width && y < height
    }

    /// Index of the pixel in which a place of the film lies.
    #[inline(always)]
    fn pixel_at(&self, place: [f64; 2]) -> u32 {
        let [column, row] = column_and_row(place);
        row * self.resolution[0] + column
    }

    /// Index of the only pixel in which places between two corners lie, if there is one.
    #[inline(always)]
    fn only_pixel(&self, [low, high]: [[f64; 2]; 2]) -> Option<u32> {
        let is_one =
            self.is_seen(low) && self.is_seen(high) && column_and_row(low) == column_and_row(high);
        is_one.then(|| self.pixel_at(low))
    }
}

/// Column and row of the pixel in which a place of the film lies.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a pixel of a picture")]
fn column_and_row([x, y]: [f64; 2]) -> [u32; 2] {
    [x as u32, y as u32]
}

impl LensCamera {
    /// The rays of `samples` that all bands share, and where the light of each band lands. Of samples beside the film, which
    /// stand for light that lands on it all the same, those are left out from whose places none can, or does.
    ///
    /// # Panics
    ///
    /// When the camera was not opened, or its bands do not share rays ([`Self::opened_paths`]).
    pub(crate) fn sample_band_rays(
        &self,
        pose: &Pose,
        resolution: [u32; 2],
        samples: &FilmSamples,
        out: &mut CameraRays,
        landings: &mut BandLandings,
    ) {
        out.clear();
        let opened = self.opened.as_ref().expect("the camera is opened before it is sampled");
        let paths = opened.paths.as_ref().expect("bands share rays");
        let area = StartArea { resolution, margin: self.margin(paths) };
        landings.clear();
        // Out of the camera, each at its leading wavelength.
        for (node, lens) in paths.nodes.iter().enumerate() {
            let is_of_node = |u: f64| place_of(u, paths.nodes.len()) == node;
            let starts = |&i: &usize| area.contains([samples.columns[i], samples.rows[i]]);
            let of_node = (0..samples.len()).filter(|&i| is_of_node(samples.leading[i]));
            #[expect(clippy::cast_possible_truncation, reason = "samples of a batch")]
            let numbers = of_node.filter(starts).map(|i| i as u32);
            let first = self.aim_samples(&opened.pupil, lens, samples, numbers, out);
            landings.pass(paths, node, &mut out.in_lens);
            out.statuses.add_all(&out.in_lens);
            let to_pixels = 1.0 / (self.focused.film().turn * self.focused.film().pitch);
            landings.keep(node, to_pixels, samples, &out.sample[first..], &out.in_lens);
            self.leave(pose, first, out);
        }
        out.rays.coherent = true;
        // Back into it at the others, where it is not known where they land.
        for (node, lens) in paths.nodes.iter().enumerate() {
            self.bring_back([node, paths.nodes.len()], lens, paths.lead, out, landings);
        }
        self.land(paths, &area, samples, out, landings);
        landings.drop_lost(&area, samples, out);
    }

    /// Takes the rays of other leading wavelengths back through the lens at a node of so many, to where they land.
    fn bring_back(
        &self,
        [node, nodes]: [usize; 2],
        lens: &MonochromaticTrain,
        lead: f64,
        out: &mut CameraRays,
        landings: &mut BandLandings,
    ) {
        let BandLandings { points, directions, leading, is_known, places, shares, .. } = landings;
        let comes_back = |&ray: &usize| leading[ray] != node && !is_known[ray];
        let back = &mut out.in_lens;
        back.clear();
        for ray in (0..points.len()).filter(comes_back) {
            back.push(points[ray] + directions[ray] * lead, -directions[ray]);
        }
        lens.trace(Side::Object, Clip::On, back);
        let film = self.focused.film();
        for (ray, i) in (0..points.len()).filter(comes_back).zip(0..) {
            if back.status(i) == RayStatus::Exited {
                places[ray * nodes + node] = film.pixel(back.position(i), back.direction(i));
                shares[ray * nodes + node] = back.throughput(i);
            }
        }
    }

    /// Computes where each band's light of each ray lands, and its weight.
    fn land(
        &self,
        paths: &BandInterpolation,
        area: &StartArea,
        samples: &FilmSamples,
        out: &CameraRays,
        landings: &mut BandLandings,
    ) {
        let land = match paths.nodes.len() {
            1 => Self::land_between::<1>,
            2 => Self::land_between::<2>,
            3 => Self::land_between::<3>,
            4 => Self::land_between::<4>,
            _ => Self::land_between::<MOST_NODES>,
        };
        land(self, paths, area, samples, out, landings);
    }

    /// The same between so many nodes at most.
    fn land_between<const NODES: usize>(
        &self,
        paths: &BandInterpolation,
        area: &StartArea,
        samples: &FilmSamples,
        out: &CameraRays,
        landings: &mut BandLandings,
    ) {
        let BandLandings { pixel, weight, points, directions, weights, places, shares, .. } =
            landings;
        let (count, nodes) = (out.sample.len(), paths.nodes.len());
        let (bands, is_clear) = (paths.bands.len(), paths.is_clear());
        let next_term = paths.next.on_pixels(self.focused.film().pitch / paths.pitch);
        pixel.resize(count * bands, BandLandings::NOWHERE);
        weight.resize(count * bands, 0.0);
        let lands_of = pixel.chunks_exact_mut(bands).zip(weight.chunks_exact_mut(bands));
        for (ray, (pixels, weights_of_bands)) in lands_of.enumerate() {
            // Nodes that there are not count nothing.
            let (mut at, mut share) = ([[0.0; 2]; NODES], [0.0; NODES]);
            let (mut passes, mut makes) = (true, 0_u32);
            for node in 0..nodes.min(NODES) {
                let end = ray * nodes + node;
                (at[node], share[node]) = (places[end], shares[end]);
                passes &= share[node] > 0.0;
                makes += u32::from(share[node] > 0.0 && area.contains(at[node]));
            }
            let scale = weights[ray] * nodes as f64 / f64::from(makes.max(1));
            let more = next_term.at(at[0], points[ray]);
            // Most rays land on one pixel in all bands.
            if passes
                && is_clear
                && let Some(only) = area.only_pixel(paths.bounds.corners(&at, more))
            {
                pixels.fill(only);
                weights_of_bands.fill(scale);
                continue;
            }
            let u = samples.spectrum[out.sample[ray] as usize];
            for (band, wavelengths) in paths.bands.iter().enumerate() {
                let number = place_of(u, wavelengths.len());
                let NodeWeights { weights, next, filters } = &wavelengths[number];
                let (place, passed) = if passes {
                    let (mut place, mut passed) = ([more[0] * next, more[1] * next], 0.0);
                    for node in 0..NODES {
                        place[0] += weights[node] * at[node][0];
                        place[1] += weights[node] * at[node][1];
                        passed += weights[node] * share[node];
                    }
                    (place, if paths.has_losses { passed * filters } else { *filters })
                } else {
                    let from = [points[ray], directions[ray]];
                    self.trace_back(paths.lead, band, number, from)
                };
                if passed > 0.0 && area.is_seen(place) {
                    pixels[band] = area.pixel_at(place);
                    weights_of_bands[band] = scale * passed;
                }
            }
        }
    }

    /// Landing point of a ray that leaves the lens at a point (mm) in a direction, at one of a band's wavelengths (pixels), and
    /// the share of it that passes.
    #[inline(never)]
    fn trace_back(
        &self,
        lead: f64,
        band: usize,
        number: usize,
        [point, direction]: [DVec3; 2],
    ) -> ([f64; 2], f64) {
        let opened = self.opened.as_ref().expect("the camera is opened before it is sampled");
        let lens = &opened.groups[band].lenses[number];
        let Some(ray) = Ray::new(point + direction * lead, -direction) else {
            return ([f64::NAN; 2], 0.0);
        };
        let end = lens.run(Side::Object, Clip::On, ray);
        let Ray { position, direction } = end.ray;
        let place = self.focused.film().pixel(position.into(), direction.into());
        (place, if end.status == RayStatus::Exited { end.throughput } else { 0.0 })
    }
}
impl BandLandings {
    fn clear(&mut self) {
        self.pixel.clear();
        self.weight.clear();
        self.points.clear();
        self.directions.clear();
        self.weights.clear();
        self.leading.clear();
        self.is_known.clear();
        self.places.clear();
        self.shares.clear();
    }

    /// Takes the rays of a node, just aimed, out of the lens.
    fn pass(&mut self, paths: &BandInterpolation, node: usize, rays: &mut LensRays) {
        self.before.clear();
        self.before.extend((0..rays.len()).map(|i| rays.throughput(i)));
        let nodes = paths.nodes.len();
        self.shifts.resize_with(nodes, Vec::new);
        self.shifts.iter_mut().for_each(Vec::clear);
        let Some(displacements) = &paths.displacements else {
            return paths.nodes[node].trace(Side::Sensor, Clip::On, rays);
        };
        displacements.trace(node, &paths.nodes[node], rays, &mut self.rims);
        for (other, shifts) in self.shifts.iter_mut().enumerate().filter(|(k, _)| *k != node) {
            displacements.between([node, other], self.rims.starts(), shifts);
        }
    }

    /// Leaves out rays that start beside the film and of which nothing lands on it: nobody asks what they see.
    fn drop_lost(&mut self, area: &StartArea, samples: &FilmSamples, out: &mut CameraRays) {
        let is_seen = |&sample: &u32| {
            let i = sample as usize;
            area.is_seen([samples.columns[i], samples.rows[i]])
        };
        if out.sample.iter().all(is_seen) {
            return;
        }
        let bands = self.pixel.len() / out.sample.len();
        let lands = |pixels: &[u32]| pixels.iter().any(|&pixel| pixel != Self::NOWHERE);
        let of_rays = out.sample.iter().zip(self.pixel.chunks_exact(bands));
        let kept: Vec<bool> =
            of_rays.map(|(sample, pixels)| is_seen(sample) || lands(pixels)).collect();
        out.rays.retain(|ray| kept[ray]);
        keep_rays(&mut out.weight, &kept, 1);
        keep_rays(&mut out.sample, &kept, 1);
        let Self { pixel, weight, points, directions, weights, leading, .. } = self;
        keep_rays(pixel, &kept, bands);
        keep_rays(weight, &kept, bands);
        keep_rays(points, &kept, 1);
        keep_rays(directions, &kept, 1);
        keep_rays(weights, &kept, 1);
        keep_rays(leading, &kept, 1);
    }

    /// Appends the rays that left the lens at a node's wavelength, which are of `samples` of these `numbers`, with where they
    /// land at all nodes as far as that is known; a place on the film is `to_pixels` times its place in mm.
    fn keep(
        &mut self,
        node: usize,
        to_pixels: f64,
        samples: &FilmSamples,
        numbers: &[u32],
        rays: &LensRays,
    ) {
        let left = |&i: &usize| rays.status(i) == RayStatus::Exited && rays.throughput(i) > 0.0;
        for i in (0..rays.len()).filter(left) {
            self.points.push(rays.position(i));
            self.directions.push(rays.direction(i));
            self.weights.push(self.before[i]);
            self.leading.push(node);
            let sample = numbers[i] as usize;
            let place = [samples.columns[sample], samples.rows[sample]];
            let share = rays.throughput(i) / self.before[i];
            let mut is_known = true;
            for (other, shifts) in self.shifts.iter().enumerate() {
                let (at, passed) = match shifts.get(i) {
                    _ if other == node => (place, share),
                    Some([x, y]) if self.rims.is_within(i) => {
                        ([place[0] + x * to_pixels, place[1] - y * to_pixels], 1.0)
                    }
                    _ => {
                        is_known = false;
                        ([f64::NAN; 2], 0.0)
                    }
                };
                self.places.push(at);
                self.shares.push(passed);
            }
            self.is_known.push(is_known);
        }
    }
}

/// Leaves the values of those rays alone that are kept, `each` of which has so many.
fn keep_rays<T: Copy>(values: &mut Vec<T>, kept: &[bool], each: usize) {
    let mut end = 0;
    for (ray, _) in kept.iter().enumerate().filter(|(_, kept)| **kept) {
        values.copy_within(ray * each..(ray + 1) * each, end);
        end += each;
    }
    values.truncate(end);
}

#[cfg(test)]
mod tests;
