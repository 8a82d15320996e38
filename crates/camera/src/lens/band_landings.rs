//! Rays of the scene that all bands share, and where each band's light of them lands ([`band_paths`](super::band_paths)
//! has why).

use etendue_optics::element::{Clip, LANES, LensRays, RayStatus};
use etendue_optics::train::{RimTrace, Side};

use self::block::{BlockLandings, LandingContext, NOWHERE, RayStart, StartArea, TracedRays};
use super::lens_camera::LensCamera;
use super::nodes::place_of;
use super::opened::BandInterpolation;
use crate::{CameraRays, FilmSamples, Pose};

mod block;

/// Landing points of the light of each band that comes along rays which all bands share, `[ray][band]`.
#[derive(Debug, Clone, Default)]
pub struct BandLandings {
    /// The pixel, counted row by row; [`Self::NOWHERE`] where the band's light does not arrive.
    pub pixel: Vec<u32>,
    /// Weight of the ray's radiance in the band in the mean over the samples of that pixel.
    pub weight: Vec<f64>,
    /// Rays that are traced back to find their places at other nodes.
    traced: TracedRays,
    strays: Vec<Stray>,
    /// Numbers of a node's samples.
    numbers: Vec<u32>,
    /// Weights of a batch before it passes the lens, and what becomes of it at the rims.
    before: Vec<f64>,
    rims: RimTrace,
    /// A block whose places follow from how its rays start.
    block: BlockLandings,
}

/// Ray that may end at some wavelengths.
#[derive(Debug, Clone)]
struct Stray {
    /// Its number among those that are traced.
    index: usize,
    /// True if the bands' places follow from those at the nodes.
    is_placed: bool,
    /// Its place in the spectrum.
    spectrum: f64,
    /// Its weight in the mean over the samples of a pixel, but for what the lens passes.
    scale: f64,
}

impl BandLandings {
    /// No pixel.
    pub const NOWHERE: u32 = NOWHERE;
}

impl LensCamera {
    /// The rays of `samples` that all bands share, and where the light of each band lands, of some at least.
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
        let film = self.focused.film();
        let ctx = LandingContext {
            paths,
            area: &area,
            next: paths.next.on_pixels(film.pitch / paths.pitch),
            to_pixels: 1.0 / (film.turn * film.pitch),
        };
        // Out of the camera, each at its leading wavelength.
        for (node, lens) in paths.leading().iter().enumerate() {
            landings.take_samples([node, paths.nodes.len()], &area, samples);
            let numbers = landings.numbers.iter().copied();
            let first = self.aim_samples(&opened.pupil, lens, samples, numbers, out);
            landings.pass(paths, node, &mut out.in_lens);
            out.statuses.add_all(&out.in_lens);
            landings.keep(node, &ctx, samples, &out.sample[first..], &out.in_lens);
            self.leave(pose, first, out);
        }
        out.rays.coherent = true;
        // Back into it at the others, where it is not known where they land.
        for node in 0..paths.nodes.len() {
            let BandLandings { traced, rims, .. } = landings;
            self.bring_back(node, paths, &mut out.in_lens, traced, rims);
        }
        landings.land(&ctx, samples, &out.sample);
        self.trace_strays(&ctx, &mut out.in_lens, landings);
        landings.drop_lost(opened.groups.len(), out);
    }

    /// Takes the rays of other leading wavelengths back through the lens at a node, to where they land; and those of its own,
    /// where it is not known whether they pass at all wavelengths.
    fn bring_back(
        &self,
        node: usize,
        paths: &BandInterpolation,
        back: &mut LensRays,
        traced: &mut TracedRays,
        rims: &mut RimTrace,
    ) {
        let TracedRays { points, directions, leading, is_within, is_inner, places, shares, .. } =
            traced;
        let has_near = paths.has_near();
        let comes_back = |&k: &usize| leading[k] != node || (has_near && !is_inner[k]);
        back.clear();
        for k in (0..points.len()).filter(comes_back) {
            back.push(points[k] + directions[k] * paths.lead, -directions[k]);
        }
        match &paths.rims {
            Some(bounds) => bounds.trace_back(node, back, rims),
            None => paths.nodes[node].trace(Side::Object, Clip::On, back),
        }
        let (film, nodes) = (self.focused.film(), paths.nodes.len());
        for (k, i) in (0..points.len()).filter(comes_back).zip(0..) {
            is_within[k] &= is_inner[k] || (has_near && rims.is_within(i));
            if leading[k] != node && back.status(i) == RayStatus::Exited {
                places[k * nodes + node] = film.pixel(back.position(i), back.direction(i));
                shares[k * nodes + node] = back.throughput(i);
            }
        }
    }

    /// Looks at which wavelengths of a band rays pass that come near a rim, and leaves out what ends there. Rays that end at
    /// a node land where they are traced to.
    fn trace_strays(
        &self,
        ctx: &LandingContext<'_>,
        back: &mut LensRays,
        landings: &mut BandLandings,
    ) {
        let BandLandings { pixel, weight, traced, strays, .. } = landings;
        let opened = self.opened.as_ref().expect("the camera is opened before it is sampled");
        let (bands, film) = (opened.groups.len(), self.focused.film());
        strays.sort_unstable_by(|a, b| a.spectrum.total_cmp(&b.spectrum));
        for (band, group) in opened.groups.iter().enumerate() {
            // Those that end at a node are few themselves.
            let lenses = if ctx.paths.rims.is_some() { group.near_rims() } else { &group.lenses };
            let lens_of = |stray: &Stray| place_of(stray.spectrum, lenses.len());
            for strays in strays.chunk_by(|a, b| lens_of(a) == lens_of(b)) {
                back.clear();
                for &Stray { index, .. } in strays {
                    let (point, direction) = (traced.points[index], traced.directions[index]);
                    back.push(point + direction * ctx.paths.lead, -direction);
                }
                lenses[lens_of(&strays[0])].trace(Side::Object, Clip::On, back);
                for (i, stray) in strays.iter().enumerate() {
                    let at = traced.ray[stray.index] * bands + band;
                    let passes = back.status(i) == RayStatus::Exited && back.throughput(i) > 0.0;
                    if passes && stray.is_placed {
                        continue;
                    }
                    let place = film.pixel(back.position(i), back.direction(i));
                    (pixel[at], weight[at]) = match passes && ctx.area.is_seen(place) {
                        true => (ctx.area.pixel_at(place), stray.scale * back.throughput(i)),
                        false => (BandLandings::NOWHERE, 0.0),
                    };
                }
            }
        }
    }
}

impl BandLandings {
    fn clear(&mut self) {
        self.pixel.clear();
        self.weight.clear();
        self.traced.clear();
    }

    /// Computes where each band's light of each ray lands that was traced at all nodes, and its weight: of rays that pass at
    /// all wavelengths. The others are strays.
    fn land(&mut self, ctx: &LandingContext<'_>, samples: &FilmSamples, sample: &[u32]) {
        let Self { pixel, weight, traced, strays, block, .. } = self;
        let (bands, nodes) = (ctx.paths.weights.bands(), ctx.paths.nodes.len());
        strays.clear();
        for first in (0..traced.ray.len()).step_by(LANES) {
            let count = LANES.min(traced.ray.len() - first);
            block.read_traced(ctx, traced, first..first + count, |ray| {
                samples.spectrum[sample[ray] as usize]
            });
            block.place_bands(ctx, u32::MAX >> (LANES - count));
            for lane in 0..count {
                let (index, is_placed) = (first + lane, block.passes(lane, nodes));
                if is_placed {
                    let of_ray = traced.ray[index] * bands..(traced.ray[index] + 1) * bands;
                    block.write(lane, &mut pixel[of_ray.clone()], &mut weight[of_ray]);
                }
                if !(is_placed && traced.is_within[index]) {
                    let (spectrum, scale) = (block.spectrum(lane), block.scale(lane));
                    strays.push(Stray { index, is_placed, spectrum, scale });
                }
            }
        }
    }

    /// Takes the numbers of the samples that start in `area` and lead at a node of so many.
    #[expect(clippy::cast_possible_truncation, reason = "samples of a batch")]
    fn take_samples(&mut self, [node, nodes]: [usize; 2], area: &StartArea, samples: &FilmSamples) {
        let [[left, top], [right, bottom]] = area.bounds();
        let starts = samples.columns.iter().zip(&samples.rows).zip(&samples.leading);
        self.numbers.clear();
        self.numbers.resize(samples.len(), 0);
        let mut taken = 0;
        for (i, ((&x, &y), &leading)) in starts.enumerate() {
            self.numbers[taken] = i as u32;
            let is_inside = (x >= left) & (y >= top) & (x < right) & (y < bottom);
            taken += usize::from(is_inside & (place_of(leading, nodes) == node));
        }
        self.numbers.truncate(taken);
    }

    /// Takes the rays of a node, just aimed, out of the lens.
    fn pass(&mut self, paths: &BandInterpolation, node: usize, rays: &mut LensRays) {
        self.before.clear();
        for start in (0..rays.len()).step_by(LANES) {
            let (block, count) = rays.block_at(start);
            self.before.extend_from_slice(&block.throughput[..count]);
        }
        match &paths.rims {
            Some(bounds) => bounds.trace(node, rays, &mut self.rims),
            None => paths.nodes[node].trace(Side::Sensor, Clip::On, rays),
        }
    }

    /// Leaves out rays of which nothing lands on the film: nobody asks what they see.
    fn drop_lost(&mut self, bands: usize, out: &mut CameraRays) {
        let lands = |pixels: &[u32]| pixels.iter().any(|&pixel| pixel != Self::NOWHERE);
        let kept: Vec<bool> = self.pixel.chunks_exact(bands).map(lands).collect();
        if kept.iter().all(|&kept| kept) {
            return;
        }
        out.rays.retain(|ray| kept[ray]);
        keep_rays(&mut out.weight, &kept, 1);
        keep_rays(&mut out.sample, &kept, 1);
        keep_rays(&mut self.pixel, &kept, bands);
        keep_rays(&mut self.weight, &kept, bands);
    }

    /// Appends the rays that left the lens at a node's wavelength, which are of `samples` of these `numbers`: with their
    /// landings, where these follow from how they start, else as rays to trace.
    fn keep(
        &mut self,
        node: usize,
        ctx: &LandingContext<'_>,
        samples: &FilmSamples,
        numbers: &[u32],
        rays: &LensRays,
    ) {
        let bands = ctx.paths.weights.bands();
        let mut end = self.pixel.len();
        self.pixel.resize(end + rays.len() * bands, Self::NOWHERE);
        self.weight.resize(end + rays.len() * bands, 0.0);
        for start in (0..rays.len()).step_by(LANES) {
            let (block, count) = rays.block_at(start);
            let numbers = &numbers[start..start + count];
            let known = ctx.known_lanes(&self.rims, start, count);
            if known != 0 {
                self.block.read(samples, numbers, &self.before[start..start + count]);
                self.block.displace(node, ctx, &self.rims, block, start);
                self.block.place_bands(ctx, known);
            }
            for lane in (0..count).filter(|&lane| block.is_bright_at(lane)) {
                let of_ray = end..end + bands;
                if known >> lane & 1 == 1 {
                    let (pixels, weights) =
                        (&mut self.pixel[of_ray.clone()], &mut self.weight[of_ray]);
                    self.block.write(lane, pixels, weights);
                } else {
                    let i = numbers[lane] as usize;
                    let nodes = [node, ctx.paths.nodes.len()];
                    let is_inner = ctx.paths.rims.is_none() || self.rims.is_within(start + lane);
                    let start = RayStart {
                        ray: end / bands,
                        place: [samples.columns[i], samples.rows[i]],
                        weight: self.before[start + lane],
                        is_inner,
                        is_within: is_inner || ctx.paths.has_near(),
                    };
                    self.traced.push(&start, nodes, block, lane);
                }
                end += bands;
            }
        }
        self.pixel.truncate(end);
        self.weight.truncate(end);
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
