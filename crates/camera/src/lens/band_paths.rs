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
//! heuristic. Rays that one wavelength loses at a rim come by another: the share of 1/m counts those that can. The lens that
//! rays pass at leading wavelengths has wider rims than the one that light of the bands passes ([`rims`](super::rims)), so
//! that each ray that passes at a band's wavelength comes by one of them.
//!
//! Light of a band that lands on the film may come along a ray that lands beside it at all leading wavelengths, as
//! where the middle of the spectrum is displaced against both its ends. Rays start from a margin all about the film, too,
//! that is as wide as the places of a ray part at the most, and m counts the wavelengths by which a ray lands on the film
//! or on the margin: without it the outermost pixels would lack that light.
//!
//! # Interpolation
//!
//! Leading wavelengths are the nodes of a polynomial in the mean index of the lens' dispersive media, by which
//! places move nearly in proportion. What that leaves, the next term of Newton's polynomial, is a straight line in the
//! ray, fitted to measured ones ([`NextTerm`]). As many nodes are taken as bring the places of all wavelengths that are
//! drawn within [`SharingLimits::places`](super::SharingLimits) of where rays land that are traced, over film and pupil.
//! A ray that comes as near to a rim as wavelengths part there is traced at every band's wavelength by itself.

use etendue_optics::element::{Clip, LensRays, Opening, RayStatus};
use etendue_optics::train::pupil::without_filters;
use etendue_optics::train::{Element, MonochromaticTrain, Side};
use etendue_spectrum::{Bands, Spread};
use glam::{DMat3, DVec2};

use super::displacements::{Displacements, MOST_WAVELENGTHS};
use super::lens_camera::LensCamera;
use super::nodes::{
    BandWeights, MOST_NODES, NextTerm, NodeWeights, RayOff, Variable, WeightBounds,
};
use super::opened::{BandInterpolation, filtered};
use super::rims::{RimBounds, SAFETY, SceneRay};
use super::traced_at::TracedAt;

/// Wavelengths at which interpolation is checked, at most. Not a setting, as the places and directions: how near places
/// are to lie is one (`band_place_error`).
const CHECKS: usize = 16;

/// Places on each side of the film, and in the pupil, from which rays are taken to measure it.
const PLACES: u32 = 11;
const DIRECTIONS: u32 = 64;

/// Fewer rays measure nothing.
const FEWEST: usize = 32;

/// The farthest that the places of one ray may part (rows of pixels): the sums of so many more are
/// kept from other threads. Not a setting: where they part farther, each band is traced by itself, as accurately.
const FARTHEST: f64 = 32.0;

/// Sharing of rays among bands, as measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedPaths {
    /// Wavelengths that each ray is traced at.
    pub traced: usize,
    /// Greatest distance between places that are interpolated and those that are traced (pixels).
    pub error: f64,
    /// Greatest number of rows of pixels between where a ray starts and where its light lands.
    pub rows: u32,
    /// Width of the margin beside the film from which rays start, too (pixels).
    pub margin: f64,
}

impl SharedPaths {
    /// Pixels beside each side of the film from which rays start: the last ones in part.
    #[must_use]
    pub fn margin_pixels(&self) -> u32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few dozen")]
        let pixels = self.margin.ceil() as u32;
        pixels
    }
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
        let error = paths.error * (paths.pitch / self.focused.film().pitch);
        SharedPaths { traced: paths.nodes.len(), error, rows, margin: self.margin(paths) }
    }

    /// Width of the margin beside the film from which rays start (pixels).
    pub(super) fn margin(&self, paths: &BandInterpolation) -> f64 {
        paths.margin() / self.focused.film().pitch
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

    /// Chooses the nodes, and measures how well they do.
    pub(super) fn band_paths(&self, bands: &Bands) -> Result<BandInterpolation, String> {
        if let Some(why) = self.parted() {
            return Err(why.to_owned());
        }
        let train = self.focused.train();
        let spreads: Vec<Spread> =
            self.band_groups(bands).iter().map(|group| self.spread(bands, group)).collect();
        let clear = without_filters(train);
        let at = |nm: f64| clear.at(nm).map_err(|error| error.to_string());
        let mut wavelengths: Vec<f64> = match self.runs_apart() {
            true => spreads.iter().flat_map(|spread| spread.wavelengths.clone()).collect(),
            false => vec![train.wavelength()],
        };
        wavelengths.sort_by(f64::total_cmp);
        wavelengths.dedup();
        // Rays over film and pupil, and where they land at wavelengths that are drawn.
        let lead = train.far_in_front(0.0);
        let rays = self.rays_to_measure(&at(wavelengths[wavelengths.len() / 2])?);
        if rays.len() < FEWEST {
            return Err("too few rays get through the lens to measure where they part".to_owned());
        }
        let checks = checks_among(&wavelengths);
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
        let limits = self.accuracy.sharing;
        let index = Variable::of(train);
        let has_losses = !train.losses().is_none()
            || train.elements().iter().any(|element| element.part.is_coated_or_blazed());
        let mut least = (f64::INFINITY, f64::INFINITY);
        for count in 1..=MOST_NODES.min(wavelengths.len()) {
            let chosen = index.nodes(&wavelengths, count);
            let landed = chosen.iter().map(land).collect::<Result<Vec<_>, _>>()?;
            let nodes = NodeLandings { rays: &rays, landed: &landed };
            // One wavelength says nothing of what rims cut at others: with two and more it lies between.
            let next = match count {
                1 => NextTerm::default(),
                _ => {
                    let nm = index.farthest(&chosen);
                    nodes.next_term(&index.weights(&chosen, nm), &land(&nm)?)
                }
            };
            let weights_at = |nm: f64| (index.weights(&chosen, nm), index.next_weight(&chosen, nm));
            let errors = |(nm, found): (&f64, &Landings)| {
                let (weights, of_next) = weights_at(*nm);
                nodes.error(&weights, of_next, &next, found)
            };
            let errors = checks.iter().zip(&checked).map(errors);
            let [error, share] = greatest(errors);
            least = (least.0.min(error), least.1.min(share));
            if error > limits.places || (has_losses && share > limits.shares) {
                continue;
            }
            let of_bands = (checks.as_slice(), bands.count());
            let nodes = chosen.iter().map(|&nm| at(nm)).collect::<Result<Vec<_>, _>>()?;
            let bands = self.band_weights(bands, &spreads, &chosen);
            let bounds = WeightBounds::of(bands.iter().flatten());
            let weights = BandWeights::of(&bands, chosen.len());
            return Ok(BandInterpolation {
                nodes,
                weights,
                bounds,
                next,
                has_losses,
                lead,
                reach,
                error,
                pitch: self.focused.film().pitch,
                rims: RimBounds::measured(&clear, &chosen, of_bands, (&rays, lead)),
                displacements: None,
            });
        }
        Err(format!(
            "places between {MOST_NODES} wavelengths are {:.2} pixels off, {} being the most, and \
             what passes {:.1e}",
            least.0, limits.places, least.1
        ))
    }

    /// Adds the displacements between its wavelengths to what is known of `paths`, where they will do.
    pub(super) fn displaced(&self, mut paths: BandInterpolation) -> BandInterpolation {
        paths.displacements = self.displacements(&paths);
        let error = paths.displacements.as_ref().map_or(0.0, |known| known.error);
        paths.error += paths.bounds.magnified() * error / self.focused.film().pitch;
        paths
    }

    /// Measures the displacements between the wavelengths of `paths`; `None` where these would be off by more than
    /// there is left of what places may be, or are dear, or where it is not known which rays keep away from rims.
    fn displacements(&self, paths: &BandInterpolation) -> Option<Displacements> {
        paths.rims.as_ref()?;
        let BandInterpolation { nodes, has_losses, lead, error, .. } = paths;
        let film = self.focused.film();
        let is_square = film.frame.rotation == DMat3::IDENTITY;
        if *has_losses || !is_square || !(2..=MOST_WAVELENGTHS).contains(&nodes.len()) {
            return None;
        }
        let rays = self.rays_to_measure(&nodes[nodes.len() / 2]);
        let found = Displacements::fitted(nodes, &rays, *lead, self.focused.sensor_z())?;
        let all = error + paths.bounds.magnified() * found.error / film.pitch;
        (all <= self.accuracy.sharing.places).then_some(found)
    }

    /// Weights of the nodes `chosen`, and what filters pass, by band and by wavelength that it is drawn from.
    fn band_weights(
        &self,
        bands: &Bands,
        spreads: &[Spread],
        chosen: &[f64],
    ) -> Vec<Vec<NodeWeights>> {
        let train = self.focused.train();
        let index = Variable::of(train);
        let of_band = |(band, spread): (usize, &Spread)| {
            let filters = filtered(train, bands, band, spread);
            let places = spread.wavelengths.iter().zip(filters).map(|(&nm, filters)| {
                let nm = if self.runs_apart() { nm } else { train.wavelength() };
                let (weights, next) = (index.weights(chosen, nm), index.next_weight(chosen, nm));
                NodeWeights { weights, next, filters }
            });
            places.collect()
        };
        spreads.iter().enumerate().map(of_band).collect()
    }

    /// Rays that leave the lens at one wavelength, from all over the film and the
    /// pupil.
    fn rays_to_measure(&self, lens: &MonochromaticTrain) -> Vec<SceneRay> {
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
        let ray = |i| SceneRay { point: rays.position(i), direction: rays.direction(i) };
        left.map(ray).collect()
    }

    /// Landing points of rays of the scene at the wavelength of a lens.
    fn landings(&self, lens: &MonochromaticTrain, rays: &[SceneRay], lead: f64) -> Landings {
        let mut back = LensRays::with_capacity(rays.len());
        for &SceneRay { point, direction } in rays {
            back.push(point + direction * lead, -direction);
        }
        lens.trace(Side::Object, Clip::On, &mut back);
        let film = self.focused.film();
        let landed = (0..back.len()).map(|i| {
            let pixel = film.pixel(back.position(i), back.direction(i));
            let lands = back.status(i) == RayStatus::Exited && pixel[0].is_finite();
            lands.then(|| (DVec2::from(pixel), back.throughput(i)))
        });
        Landings { places: landed.collect(), pitch: film.pitch }
    }
}

/// Some of ascending wavelengths, both ends among them.
fn checks_among(wavelengths: &[f64]) -> Vec<f64> {
    let step = wavelengths.len().div_ceil(CHECKS);
    let mut checks: Vec<f64> = wavelengths.iter().copied().step_by(step).collect();
    checks.extend(wavelengths.last());
    checks.dedup();
    checks
}

/// Landing points of rays (pixels), and the share of each that passed; `None` for those that ended.
struct Landings {
    places: Vec<Option<(DVec2, f64)>>,
    pitch: f64,
}

/// Greatest distance in rows or columns by which the places of a ray part (mm).
fn parting(landed: &[Landings]) -> f64 {
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

/// The greatest of some errors; infinite where one is not a number, as between nodes of the same mean index.
fn greatest(errors: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    let worse = |a: f64, b: f64| if b.is_nan() { f64::INFINITY } else { a.max(b) };
    errors.fold([0.0; 2], |[a, b], [c, d]| [worse(a, c), worse(b, d)])
}

/// Rays of the scene, and their landing points at the nodes.
struct NodeLandings<'a> {
    rays: &'a [SceneRay],
    landed: &'a [Landings],
}

impl NodeLandings<'_> {
    /// Places of a ray between nodes, and what the lens passes of it, by the nodes' weights.
    fn between(&self, weights: &[f64; MOST_NODES], ray: usize) -> Option<(DVec2, f64)> {
        let mut sum = (DVec2::ZERO, 0.0);
        for (node, weight) in self.landed.iter().zip(weights) {
            let (place, share) = node.places[ray]?;
            sum = (sum.0 + place * *weight, sum.1 + share * weight);
        }
        Some(sum)
    }

    /// Term by which rays land elsewhere than between the nodes, of those `found` where that is most.
    fn next_term(&self, weights: &[f64; MOST_NODES], found: &Landings) -> NextTerm {
        let off = |ray: usize| {
            let (place, _) = found.places[ray]?;
            let (first, _) = self.landed[0].places[ray]?;
            let off = place - self.between(weights, ray)?.0;
            Some(RayOff { place: first, point: self.rays[ray].point.truncate(), off })
        };
        NextTerm::fitted((0..self.rays.len()).filter_map(off))
    }

    /// Greatest error of interpolated places (pixels) and shares against those found; `of_next` is the weight of `next`.
    fn error(
        &self,
        weights: &[f64; MOST_NODES],
        of_next: f64,
        next: &NextTerm,
        found: &Landings,
    ) -> [f64; 2] {
        let of_ray = |(ray, found): (usize, &Option<(DVec2, f64)>)| {
            let ((sum, passed), (place, share)) = (self.between(weights, ray)?, (*found)?);
            let (first, _) = self.landed[0].places[ray].unwrap_or((DVec2::ZERO, 0.0));
            let point = self.rays[ray].point.truncate();
            let more = DVec2::from(next.at(first.into(), point.into())) * of_next;
            let off = (passed - share).abs();
            Some([(sum + more).distance(place), if off == 0.0 { 0.0 } else { off / share }])
        };
        greatest(found.places.iter().enumerate().filter_map(of_ray))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_number_is_the_greatest_error() {
        let all = [[0.1, 0.0], [f64::NAN, 0.2], [0.3, 0.1]];
        assert_eq!(greatest(all.into_iter()), [f64::INFINITY, 0.2]);
        assert_eq!(greatest(all[..1].iter().copied()), [0.1, 0.0]);
    }
}
