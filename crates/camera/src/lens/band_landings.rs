//! Rays of the scene that all bands share, and where each band's light of them lands ([`band_paths`](super::band_paths)
//! has why).

use etendue_optics::element::{Clip, LensRays, Ray, RayStatus};
use etendue_optics::train::{MonochromaticTrain, Side};
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
    /// The rays of `samples` that all bands share, and where the light of each band lands.
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
        landings.clear();
        // Out of the camera, each at its leading wavelength.
        for (node, lens) in paths.nodes.iter().enumerate() {
            let is_of_node = |u: f64| place_of(u, paths.nodes.len()) == node;
            let numbered = samples.leading.iter().zip(0..);
            let numbers = numbered.filter(|&(&u, _)| is_of_node(u)).map(|(_, i)| i);
            let first = self.aim_samples(&opened.pupil, lens, samples, numbers, out);
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
            self.bring_back(node, lens, paths.lead, samples, out, landings);
        }
        self.land(paths, resolution, samples, out, landings);
    }

    /// Takes the rays of other leading wavelengths back through the lens, to where they land.
    fn bring_back(
        &self,
        node: usize,
        lens: &MonochromaticTrain,
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
        paths: &BandInterpolation,
        resolution: [u32; 2],
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
        land(self, paths, resolution, samples, out, landings);
    }

    /// The same between so many nodes at most.
    fn land_between<const NODES: usize>(
        &self,
        paths: &BandInterpolation,
        resolution: [u32; 2],
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
                    self.trace_back(paths.lead, band, number, from)
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
#[cfg(test)]
mod tests {
    use std::path::Path;

    use etendue_geometry::Bounds;
    use etendue_spectrum::{Bands, Grid};

    use super::*;
    use crate::{CameraSpec, SharingLimits};

    /// The lens of a file, stopped down and focused, before 256 × 256 pixels of a sensor so high.
    fn camera_with(file: &str, f_number: f64, [distance, height]: [&str; 2]) -> crate::Camera {
        let spec: CameraSpec = serde_json::from_value(serde_json::json!({
            "type": "lens", "lens": format!("lenses/{file}.json"), "f_number": f_number,
            "focus_distance": distance, "sensor_height": height, "pose": {"from": [0, 1, 4.4], "look_at": [0, 1, 0]},
            "sensor": {"resolution": [256, 256]}
        }))
        .unwrap();
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let bounds = || Bounds { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
        spec.build(bounds, &|name: &str| Ok(scenes.join(name))).unwrap()
    }

    /// Each band's light falls on the pixel of its own ray, but for rays that land nearer to an edge than places err:
    /// behind lenses of one glass and of several, in three bands and in many. Two wavelengths place all bands behind
    /// the double Gauss, as its secondary spectrum is foreseen.
    #[test]
    fn bands_land_where_their_own_rays_do() {
        let edges: Vec<f64> = (0..32).map(|k| 400.0 + 10.0 * f64::from(k)).collect();
        let many = Bands::Spectral(Grid::from_edges(edges).unwrap());
        for (file, f_number, at) in [
            ("double-gauss", 2.8, ["4.4 m", "28 mm"]),
            ("cooke-triplet", 5.6, ["3 m", "20 mm"]),
            ("achromat", 8.0, ["3 m", "4 mm"]),
            ("singlet", 4.0, ["3 m", "4 mm"]),
        ] {
            for bands in [&Bands::Rgb, &many] {
                let camera = camera_with(file, f_number, at).opened(bands).unwrap();
                let (found, error) = landings_elsewhere(&camera, bands.count());
                let nodes = camera.lens().unwrap().opened_paths().unwrap().traced;
                assert!(file != "double-gauss" || nodes == 2, "{nodes}");
                // Twice the error on either side, of columns and of rows.
                let name = format!("{file}, {} bands, {nodes} nodes, {error}", bands.count());
                assert!(error <= SharingLimits::DEFAULT.places, "{name}");
                assert!(found < 4.0 * error, "{name}: {found}");
            }
        }
    }

    /// The share of landings that are not on the pixel of the band's own ray, and the error that was measured (pixels).
    fn landings_elsewhere(camera: &crate::Camera, bands: usize) -> (f64, f64) {
        let lens = camera.lens().unwrap();
        let opened = lens.opened.as_ref().unwrap();
        let paths = opened.paths.as_ref().unwrap();
        let mut samples = FilmSamples::default();
        for i in 0..60_000 / u32::try_from(bands).unwrap() {
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
            for band in 0..bands {
                let wavelengths = &paths.bands[band];
                let number = place_of(u, wavelengths.len());
                let from = [landings.points[ray], landings.directions[ray]];
                let ([x, y], passed) = lens.trace_back(paths.lead, band, number, from);
                let is_seen = passed > 0.0 && x.min(y) >= 0.0 && x.max(y) < 256.0;
                let own = match is_seen {
                    true => y.floor() * 256.0 + x.floor(),
                    false => f64::from(BandLandings::NOWHERE),
                };
                landed += 1;
                elsewhere += u32::from(own != f64::from(landings.pixel[bands * ray + band]));
            }
        }
        assert!(landed > 30_000, "{landed}");
        (f64::from(elsewhere) / f64::from(landed), paths.error)
    }
}
