//! One ray of the scene for all bands: it is traced into the scene at one wavelength, and back into the
//! camera at others, to where each band's light of it lands on the film.
//!
//! # Measure
//!
//! A band's value at a pixel is the mean of T L over the étendue dG = n² cos θ dA dΩ of the pixel's area and
//! the pupil, T being what the lens passes and L the radiance of the scene along the ray that leaves the lens.
//! Refraction keeps étendue (Clausius' theorem; W. T. Welford and R. Winston, *High Collection Nonimaging
//! Optics*, 1989, appendix A), at every wavelength, so the map from rays at the film to rays in the scene has
//! a Jacobian of 1 in G, and so has that from the film at one wavelength, by way of the scene, to the film at
//! another: a ray of the scene stands for as much étendue in all bands, wherever it lands. In front of the lens
//! and behind it n must be the same for all, which is asked for.
//!
//! # Estimator
//!
//! A sample has a place x on the film, a direction ω with the weight w = 1/p(x, ω) of single bands, and one of
//! `H` *leading* wavelengths, each as likely. Its ray is traced into the scene at that wavelength. A ray r of
//! the scene may come from each of the leading wavelengths j by which it lands on the film and passes the lens:
//! of `m` of them. The contribution to band b at the place where b lands is
//!
//! `L(r) T_b(r) w H / m`.
//!
//! As the shares 1/m that the leading wavelengths take of r add up to 1 (the condition of E. Veach,
//! *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, eq. 9.5), the mean is that of each band
//! traced by itself, whatever the weights are; where w is the same for all, as it nearly is, this is his balance
//! heuristic. Rays that one wavelength loses at a rim come by another: the share of 1/m counts those that can.
//!
//! # Interpolation
//!
//! Leading wavelengths are the nodes of a polynomial in the mean index of the lens' dispersive media, by which
//! places move nearly in proportion. What that leaves, the next term of Newton's polynomial, is a straight line in the
//! ray, fitted to measured ones ([`NextTerm`]). As many nodes are taken as bring the places of all wavelengths that are
//! drawn within [`SharingLimits::places`](super::SharingLimits) of where rays land that are traced, over film and pupil.
//! A ray that ends at some node is traced at every band's wavelength by itself.

use std::sync::Arc;

use etendue_optics::element::{Clip, LensRays, Opening, Ray, RayStatus};
use etendue_optics::train::pupil::without_filters;
use etendue_optics::train::{Element, MonochromaticTrain, Side};
use etendue_spectrum::{Bands, Spread};
use glam::{DVec2, DVec3};

use super::lens_camera::LensCamera;
use super::nodes::{MOST_NODES, NextTerm, NodeWeights, Variable};
use super::opened::{BandInterpolation, FoundPaths, filtered, place_of};
use super::traced_at::TracedAt;
use crate::{CameraRays, FilmSamples, Pose};

/// Wavelengths at which interpolation is checked, at most.
const CHECKS: usize = 16;

/// Places on each side of the film, and in the pupil, from which rays are taken to measure it.
const PLACES: u32 = 11;
const DIRECTIONS: u32 = 64;

/// Fewer rays measure nothing.
const FEWEST: usize = 32;

/// The farthest that the places of one ray may part (rows of pixels): the sums of so many more are
/// kept from other threads.
const FARTHEST: f64 = 32.0;

/// Factor on the measured parting of places, which may be greater in between.
const SAFETY: f64 = 1.25;

/// Sharing of rays among bands, as measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedPaths {
    /// Wavelengths that each ray is traced at.
    pub traced: usize,
    /// Greatest distance between places that are interpolated and those that are traced (pixels).
    pub error: f64,
    /// Greatest number of rows of pixels between where a ray starts and where its light lands.
    pub rows: u32,
}

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
    /// Before the lens is passed: the weights of a batch.
    before: Vec<f64>,
    /// `[node][ray]`: the place (pixels), and the share that the lens passes, 0 where it ends.
    places: Vec<[f64; 2]>,
    shares: Vec<f64>,
}

impl BandLandings {
    /// No pixel.
    pub const NOWHERE: u32 = u32::MAX;
}

impl LensCamera {
    /// Measures how the rays of `bands` are shared.
    ///
    /// # Errors
    ///
    /// When they cannot be shared, in words.
    pub fn shared_paths(&self, bands: &Bands) -> Result<SharedPaths, String> {
        self.band_paths(bands).map(|paths| self.shared(&paths))
    }

    /// Sharing of rays for which the camera was opened; `None` where bands have rays of their own.
    #[must_use]
    pub fn opened_paths(&self) -> Option<SharedPaths> {
        let paths = self.opened.as_ref()?.paths.as_ref()?;
        Some(self.shared(paths))
    }

    fn shared(&self, paths: &BandInterpolation) -> SharedPaths {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few dozen")]
        let rows = (paths.reach / self.focused.film().pitch).ceil() as u32 + 1;
        SharedPaths { traced: paths.nodes.len(), error: paths.error, rows }
    }

    /// Reason why rays of different bands differ by more than where they land, if they do.
    fn parted(&self) -> Option<&'static str> {
        if matches!(self.traced_at, TracedAt::Grouped(_)) {
            return Some("groups of bands run each its own way");
        }
        let train = self.focused.train();
        let is_mask = |element: &Element| matches!(element.part.opening(), Some(Opening::Image(_)));
        let is_patterned = |element: &Element| {
            !element.part.curves().is_empty() && element.part.uniform_curve().is_none()
        };
        let media = train.media();
        if train.first_array().is_some() {
            return Some("a lenslet that a ray of one wavelength meets may be another's neighbour");
        }
        if train.elements().iter().any(is_mask) {
            return Some("a mask's edges cut each wavelength's light at another place");
        }
        if train.elements().iter().any(is_patterned) {
            return Some("a filter that differs from place to place is met elsewhere by each");
        }
        (media[0].is_dispersive() || media[media.len() - 1].is_dispersive()).then_some(
            "the medium at an end of the lens is dispersive, so that radiance differs, too",
        )
    }

    /// Paths by which bands share rays, or why they do not, in words.
    pub(super) fn band_paths(&self, bands: &Bands) -> FoundPaths {
        self.measured_paths.get_or(bands, || self.measure_paths(bands).map(Arc::new))
    }

    /// Chooses the nodes, and measures how well they do.
    fn measure_paths(&self, bands: &Bands) -> Result<BandInterpolation, String> {
        if let Some(why) = self.parted() {
            return Err(why.to_owned());
        }
        let train = self.focused.train();
        let spreads: Vec<Spread> =
            self.band_groups(bands).iter().map(|group| self.spread(bands, group)).collect();
        let clear = without_filters(train);
        let at = |nm: f64| clear.at(nm).map_err(|error| error.to_string());
        let index = Variable::of(train);
        let mut wavelengths: Vec<f64> = match self.runs_apart() {
            true => spreads.iter().flat_map(|spread| spread.wavelengths.clone()).collect(),
            false => vec![train.wavelength()],
        };
        wavelengths.sort_by(f64::total_cmp);
        wavelengths.dedup();
        // Rays over film and pupil, and where they land at wavelengths that are drawn.
        let middle = at(wavelengths[wavelengths.len() / 2])?;
        let lead = train.far_in_front(0.0);
        let rays = self.rays_to_measure(&middle);
        if rays.len() < FEWEST {
            return Err("too few rays get through the lens to measure where they part".to_owned());
        }
        let step = wavelengths.len().div_ceil(CHECKS);
        let mut checks: Vec<f64> = wavelengths.iter().copied().step_by(step).collect();
        checks.extend(wavelengths.last());
        checks.dedup();
        let land = |nm: &f64| Ok::<_, String>(self.landings(&at(*nm)?, &rays, lead));
        let checked = checks.iter().map(land).collect::<Result<Vec<_>, _>>()?;
        let reach = SAFETY * parting(&checked);
        let rows = reach / self.focused.film().pitch;
        if rows > FARTHEST {
            return Err(format!(
                "the light of one ray lands up to {rows:.0} rows apart, and {FARTHEST} are the most"
            ));
        }
        // As few nodes as will do.
        let limits = self.sharing;
        let has_losses = !train.losses().is_none()
            || train.elements().iter().any(|element| element.part.is_coated_or_blazed());
        let mut least = (f64::INFINITY, f64::INFINITY);
        for count in 1..=MOST_NODES.min(wavelengths.len()) {
            let chosen = index.nodes(&wavelengths, count);
            let landed = chosen.iter().map(land).collect::<Result<Vec<_>, _>>()?;
            // One wavelength says nothing of what rims cut at others: with two and more it lies between.
            let next = match count {
                1 => NextTerm::default(),
                _ => {
                    let nm = index.farthest(&chosen);
                    next_term(&index.weights(&chosen, nm), (&rays, &landed), &land(&nm)?)
                }
            };
            let weights_at = |nm: f64| (index.weights(&chosen, nm), index.next_weight(&chosen, nm));
            let errors = |(nm, found): (&f64, &Landed)| {
                error_of((&weights_at(*nm), &next), (&rays, &landed), found)
            };
            let errors = checks.iter().zip(&checked).map(errors);
            let [error, share] = errors.fold([0.0_f64; 2], |[a, b], [c, d]| [a.max(c), b.max(d)]);
            least = (least.0.min(error), least.1.min(share));
            if error > limits.places || (has_losses && share > limits.shares) {
                continue;
            }
            let nodes = chosen.iter().map(|&nm| at(nm)).collect::<Result<Vec<_>, _>>()?;
            let of_band = |(band, spread): (usize, &Spread)| {
                let filters = filtered(train, bands, band, spread);
                let places = spread.wavelengths.iter().zip(filters).map(|(&nm, filters)| {
                    let nm = if self.runs_apart() { nm } else { train.wavelength() };
                    let (weights, next) = weights_at(nm);
                    NodeWeights { weights, next, filters }
                });
                places.collect()
            };
            let bands = spreads.iter().enumerate().map(of_band).collect();
            return Ok(BandInterpolation { nodes, bands, next, has_losses, lead, reach, error });
        }
        Err(format!(
            "places between {MOST_NODES} wavelengths are {:.2} pixels off, {} being the most, and \
             what passes {:.1e}",
            least.0, limits.places, least.1
        ))
    }

    /// Rays that leave the lens at one wavelength (point and direction, mm), from all over the film and the
    /// pupil.
    fn rays_to_measure(&self, lens: &MonochromaticTrain) -> Vec<(DVec3, DVec3)> {
        let film = self.focused.film();
        let train = self.focused.train();
        let rim = train.elements().last().map_or(f64::INFINITY, |e| e.clear_radius());
        // A little more than the paraxial exit pupil, or the last element.
        let exit = self.focused.paraxial().exit_pupil;
        let (z, radius) = match (exit.z, exit.diameter) {
            (Some(z), Some(diameter)) if (z - film.frame.vertex.z).abs() > 1e-6 => {
                (z, 0.6 * diameter)
            }
            _ if rim.is_finite() => (train.last_vertex(), rim),
            _ => (train.last_vertex(), 0.5 * film.half_size().length()),
        };
        let mut rays = LensRays::default();
        for k in 0..PLACES * PLACES {
            let side = |i: u32| 2.0 * f64::from(i) / f64::from(PLACES - 1) - 1.0;
            let place = DVec2::new(side(k % PLACES), side(k / PLACES)) * film.half_size();
            let start = film.frame.point(place.extend(0.0));
            for i in 0..DIRECTIONS {
                // Even over the disk (H. Vogel, "A better way to construct the sunflower head", 1979).
                let share = (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
                let turn = f64::from(i) * 2.399_963_229_728_653;
                let at = DVec2::from_angle(turn) * (radius * share.sqrt());
                let way = at.extend(z) - start;
                rays.push(start, if way.z > 0.0 { -way } else { way });
            }
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        let left = (0..rays.len()).filter(|&i| rays.status(i) == RayStatus::Exited);
        left.map(|i| (rays.position(i), rays.direction(i))).collect()
    }

    /// Landing points of rays of the scene at the wavelength of a lens.
    fn landings(&self, lens: &MonochromaticTrain, rays: &[(DVec3, DVec3)], lead: f64) -> Landed {
        let mut back = LensRays::with_capacity(rays.len());
        for &(point, direction) in rays {
            back.push(point + direction * lead, -direction);
        }
        lens.trace(Side::Object, Clip::On, &mut back);
        let film = self.focused.film();
        let landed = (0..back.len()).map(|i| {
            let pixel = film.pixel(back.position(i), back.direction(i));
            let lands = back.status(i) == RayStatus::Exited && pixel[0].is_finite();
            lands.then(|| (DVec2::from(pixel), back.throughput(i)))
        });
        Landed { places: landed.collect(), pitch: film.pitch }
    }

    /// The rays of `samples` that all bands share, and where the light of each band lands.
    ///
    /// # Panics
    ///
    /// When the camera was not opened, or its bands do not share rays ([`Self::opened_paths`]).
    pub(crate) fn sample_band_rays(
        &self,
        (pose, resolution): (&Pose, [u32; 2]),
        samples: &FilmSamples,
        out: &mut CameraRays,
        landings: &mut BandLandings,
    ) {
        out.clear();
        let opened = self.opened.as_ref().expect("the camera is opened before it is sampled");
        let paths = opened.paths.as_ref().expect("bands share rays");
        landings.clear();
        // Out of the camera, each at its leading wavelength.
        for (node, lens) in paths.nodes.iter().enumerate() {
            let is_of_node = |u: f64| place_of(u, paths.nodes.len()) == node;
            let numbered = samples.leading.iter().zip(0..);
            let numbers = numbered.filter(|&(&u, _)| is_of_node(u)).map(|(_, i)| i);
            let first = self.aim_samples((&opened.pupil, lens), samples, numbers, out);
            let before = &mut landings.before;
            before.clear();
            before.extend((0..out.in_lens.len()).map(|i| out.in_lens.throughput(i)));
            lens.trace(Side::Sensor, Clip::On, &mut out.in_lens);
            out.statuses.add_all(&out.in_lens);
            landings.keep(&out.in_lens, node);
            self.leave(pose, first, out);
        }
        out.rays.coherent = true;
        // Back into it at the others.
        let count = out.sample.len();
        landings.places.resize(paths.nodes.len() * count, [f64::NAN; 2]);
        landings.shares.resize(paths.nodes.len() * count, 0.0);
        for (node, lens) in paths.nodes.iter().enumerate() {
            self.bring_back((node, lens), paths.lead, samples, out, landings);
        }
        self.land((paths, resolution), samples, out, landings);
    }

    /// Takes the rays of other leading wavelengths back through the lens, to where they land.
    fn bring_back(
        &self,
        (node, lens): (usize, &MonochromaticTrain),
        lead: f64,
        samples: &FilmSamples,
        out: &mut CameraRays,
        landings: &mut BandLandings,
    ) {
        let BandLandings { points, directions, weights, leading, places, shares, .. } = landings;
        let count = out.sample.len();
        let (places, shares) =
            (&mut places[node * count..][..count], &mut shares[node * count..][..count]);
        let back = &mut out.in_lens;
        back.clear();
        for ray in 0..count {
            if leading[ray] == node {
                let i = out.sample[ray] as usize;
                places[ray] = [samples.columns[i], samples.rows[i]];
                shares[ray] = out.weight[ray] / weights[ray];
            } else {
                back.push(points[ray] + directions[ray] * lead, -directions[ray]);
            }
        }
        lens.trace(Side::Object, Clip::On, back);
        let film = self.focused.film();
        let others = (0..count).filter(|&ray| leading[ray] != node);
        for (ray, i) in others.zip(0..) {
            if back.status(i) == RayStatus::Exited {
                places[ray] = film.pixel(back.position(i), back.direction(i));
                shares[ray] = back.throughput(i);
            }
        }
    }

    /// Computes where each band's light of each ray lands, and its weight.
    fn land(
        &self,
        (paths, resolution): (&BandInterpolation, [u32; 2]),
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
        land(self, (paths, resolution), samples, out, landings);
    }

    /// The same between so many nodes at most.
    fn land_between<const NODES: usize>(
        &self,
        (paths, resolution): (&BandInterpolation, [u32; 2]),
        samples: &FilmSamples,
        out: &CameraRays,
        landings: &mut BandLandings,
    ) {
        let BandLandings { pixel, weight, points, directions, weights, places, shares, .. } =
            landings;
        let size = resolution.map(f64::from);
        let is_seen = |[x, y]: [f64; 2]| x >= 0.0 && y >= 0.0 && x < size[0] && y < size[1];
        let (count, nodes) = (out.sample.len(), paths.nodes.len());
        let bands = paths.bands.len();
        pixel.resize(count * bands, BandLandings::NOWHERE);
        weight.resize(count * bands, 0.0);
        let lands_of = pixel.chunks_exact_mut(bands).zip(weight.chunks_exact_mut(bands));
        for (ray, (pixels, weights_of_bands)) in lands_of.enumerate() {
            // Nodes that there are not count nothing.
            let (mut at, mut share) = ([[0.0; 2]; NODES], [0.0; NODES]);
            let (mut passes, mut makes) = (true, 0_u32);
            for node in 0..nodes.min(NODES) {
                (at[node], share[node]) = (places[node * count + ray], shares[node * count + ray]);
                passes &= share[node] > 0.0;
                makes += u32::from(share[node] > 0.0 && is_seen(at[node]));
            }
            let scale = weights[ray] * nodes as f64 / f64::from(makes.max(1));
            let more = paths.next.at(at[0], points[ray]);
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
                    self.trace_back(paths.lead, (band, number), from)
                };
                if passed > 0.0 && is_seen(place) {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "a pixel of a picture"
                    )]
                    let at = place[1] as u32 * resolution[0] + place[0] as u32;
                    (pixels[band], weights_of_bands[band]) = (at, scale * passed);
                }
            }
        }
    }

    /// Where a ray that leaves the lens at a point (mm) in a direction lands at one of a band's wavelengths (pixels), and
    /// the share of it that passes.
    #[inline(never)]
    fn trace_back(
        &self,
        lead: f64,
        (band, number): (usize, usize),
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
        let Self { pixel, weight, points, directions, weights, leading, before, places, shares } =
            self;
        pixel.clear();
        weight.clear();
        points.clear();
        directions.clear();
        weights.clear();
        leading.clear();
        before.clear();
        places.clear();
        shares.clear();
    }

    /// Appends the rays that left the lens at a node's wavelength.
    fn keep(&mut self, rays: &LensRays, node: usize) {
        let left = |&i: &usize| rays.status(i) == RayStatus::Exited && rays.throughput(i) > 0.0;
        for i in (0..rays.len()).filter(left) {
            self.points.push(rays.position(i));
            self.directions.push(rays.direction(i));
            self.weights.push(self.before[i]);
            self.leading.push(node);
        }
    }
}

/// Landing points of rays (pixels), and the share of each that passed; `None` for those that ended.
struct Landed {
    places: Vec<Option<(DVec2, f64)>>,
    pitch: f64,
}

/// Greatest distance in rows or columns by which the places of a ray part (mm).
fn parting(landed: &[Landed]) -> f64 {
    let Some(first) = landed.first() else { return 0.0 };
    let part = |ray: usize| {
        let places = landed.iter().filter_map(|at| at.places[ray].map(|(place, _)| place));
        let (low, high) = places
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), place| {
                (low.min(place), high.max(place))
            });
        (high - low).max_element().max(0.0)
    };
    (0..first.places.len()).map(part).fold(0.0, f64::max) * first.pitch
}

/// Rays of the scene (point and direction, mm), and where they land at the nodes.
type Nodes<'a> = (&'a [(DVec3, DVec3)], &'a [Landed]);

/// Places of a ray between nodes, and what the lens passes of it, by the nodes' weights.
fn between(weights: &[f64; MOST_NODES], nodes: &[Landed], ray: usize) -> Option<(DVec2, f64)> {
    let mut sum = (DVec2::ZERO, 0.0);
    for (node, weight) in nodes.iter().zip(weights) {
        let (place, share) = node.places[ray]?;
        sum = (sum.0 + place * *weight, sum.1 + share * weight);
    }
    Some(sum)
}

/// Term by which rays land elsewhere than between the nodes, of those `found` where that is most.
fn next_term(weights: &[f64; MOST_NODES], (rays, nodes): Nodes<'_>, found: &Landed) -> NextTerm {
    let off = |ray: usize| {
        let (place, _) = found.places[ray]?;
        let (first, _) = nodes[0].places[ray]?;
        Some((first, rays[ray].0, place - between(weights, nodes, ray)?.0))
    };
    NextTerm::fitted((0..rays.len()).filter_map(off))
}

/// Greatest error of interpolated places (pixels) and shares against those found.
fn error_of(
    ((weights, of_next), next): (&([f64; MOST_NODES], f64), &NextTerm),
    (rays, nodes): Nodes<'_>,
    found: &Landed,
) -> [f64; 2] {
    let mut errors = [0.0_f64; 2];
    for (ray, found) in found.places.iter().enumerate() {
        let (Some(sum), Some((place, share))) = (between(weights, nodes, ray), found) else {
            continue;
        };
        let first = nodes[0].places[ray].map_or(DVec2::ZERO, |(place, _)| place);
        let more = DVec2::from(next.at(first.into(), rays[ray].0)) * *of_next;
        errors[0] = errors[0].max((sum.0 + more).distance(*place));
        errors[1] = errors[1].max((sum.1 - share).abs() / share);
    }
    errors
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use etendue_geometry::Bounds;

    use super::*;
    use crate::CameraSpec;

    /// Two wavelengths place all bands behind the double Gauss, as its secondary spectrum is foreseen: each band's light
    /// falls on the pixel of its own ray, but for those that land nearer to an edge than places err.
    #[test]
    fn bands_land_where_their_own_rays_do() {
        let spec: CameraSpec = serde_json::from_str(
            r#"{"type": "lens", "lens": "lenses/double-gauss.json", "f_number": 2.8, "focus_distance": "4.4 m",
                "sensor_height": "28 mm", "pose": {"from": [0, 1, 4.4], "look_at": [0, 1, 0]},
                "sensor": {"resolution": [256, 256]}}"#,
        )
        .unwrap();
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let bounds = || Bounds { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
        let camera = spec.build(bounds, &|name: &str| Ok(scenes.join(name))).unwrap();
        let camera = camera.opened(&Bands::Rgb).unwrap();
        let lens = camera.lens().unwrap();
        let opened = lens.opened.as_ref().unwrap();
        let paths = opened.paths.as_ref().unwrap();
        assert_eq!(paths.nodes.len(), 2);
        let mut samples = FilmSamples::default();
        for i in 0..20_000 {
            let steps = [0.754_877_666, 0.569_840_290, 0.618_033_988, 0.414_213_562, 0.732_050_807];
            let [x, y, u, v, w] = steps.map(|step: f64| (0.5 + step * f64::from(i)).fract());
            samples.push([256.0 * x, 256.0 * y], [u, v], w);
            samples.leading[i as usize] = (0.5 + 0.236_067_977 * f64::from(i)).fract();
        }
        let (mut rays, mut landings) = (CameraRays::default(), BandLandings::default());
        camera.sample_band_rays(&samples, &mut rays, &mut landings);
        let (mut landed, mut elsewhere) = (0, 0);
        for (ray, &sample) in rays.sample.iter().enumerate() {
            let u = samples.spectrum[sample as usize];
            for band in 0..3 {
                let number = place_of(u, opened.groups[band].lenses.len());
                let from = [landings.points[ray], landings.directions[ray]];
                let ([x, y], passed) = lens.trace_back(paths.lead, (band, number), from);
                let is_seen = passed > 0.0 && x.min(y) >= 0.0 && x.max(y) < 256.0;
                let own = match is_seen {
                    true => y.floor() * 256.0 + x.floor(),
                    false => f64::from(BandLandings::NOWHERE),
                };
                landed += 1;
                elsewhere += u32::from(own != f64::from(landings.pixel[3 * ray + band]));
            }
        }
        // Twice the error on either side, of columns and of rows.
        let share = f64::from(elsewhere) / f64::from(landed);
        assert!(landed > 50_000 && share < 4.0 * paths.error, "{share} of {landed}: {paths:?}");
    }
}
