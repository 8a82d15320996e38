//! Landings of rays against those of rays that are traced.

use std::path::Path;

use etendue_geometry::Bounds;
use etendue_optics::element::Ray;
use etendue_optics::train::MonochromaticTrain;
use etendue_optics::train::pupil::PupilSample;
use etendue_spectrum::{Bands, Grid};
use glam::DVec3;

use super::*;
use crate::lens::nodes::NextTerm;
use crate::{CameraSpec, SharingLimits};

/// The lens of a file, stopped down and focused, before 256 × 256 pixels of a sensor so high.
fn camera_with(file: &str, f_number: f64, [distance, height]: [&str; 2]) -> crate::Camera {
    camera_of(serde_json::json!({
        "type": "lens", "lens": format!("lenses/{file}.json"), "f_number": f_number,
        "focus_distance": distance, "sensor_height": height, "pose": {"from": [0, 1, 4.4], "look_at": [0, 1, 0]},
        "sensor": {"resolution": [256, 256]}
    }))
}

fn camera_of(spec: serde_json::Value) -> crate::Camera {
    let spec: CameraSpec = serde_json::from_value(spec).unwrap();
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
            let (found, error) = landings_elsewhere(&camera, 256.0, bands.count());
            let nodes = camera.lens().unwrap().opened_paths().unwrap().traced;
            assert!(file != "double-gauss" || nodes == 2, "{nodes}");
            // Twice the error on either side, of columns and of rows.
            let name = format!("{file}, {} bands, {nodes} nodes, {error}", bands.count());
            assert!(error <= SharingLimits::DEFAULT.places, "{name}");
            assert!(found < 4.0 * error, "{name}: {found}");
            // Looked at on larger pixels, errors are smaller.
            let (found, error) = landings_elsewhere(&camera.coarser(2), 128.0, bands.count());
            assert!(found < 4.0 * (0.5 * error), "{name}: {found} on larger pixels");
        }
    }
}

/// Of rays that keep away from the rims of the double Gauss the places at other nodes follow from that at which they
/// leave: they pass at all of them, and land within the limit of where they are traced to. Most rays are such rays.
#[test]
fn rays_away_from_rims_land_where_they_are_traced_to() {
    let camera = camera_with("double-gauss", 2.8, ["4.4 m", "28 mm"]).opened(&Bands::Rgb);
    let camera = camera.unwrap();
    let lens = camera.lens().unwrap();
    let opened = lens.opened.as_ref().unwrap();
    let paths = opened.paths.as_ref().unwrap();
    let area = StartArea { resolution: [256; 2], margin: 0.0 };
    let film = lens.focused.film();
    let to_pixels = 1.0 / (film.turn * film.pitch);
    let ctx = LandingContext { paths, area: &area, next: NextTerm::default(), to_pixels };
    let samples = many_samples(20_000, 256.0);
    let (mut rays, mut landings) = (CameraRays::default(), BandLandings::default());
    let (mut left, mut known, mut worst) = (0, 0, 0.0_f64);
    for (node, at) in paths.leading().iter().enumerate() {
        landings.take_samples([node, paths.nodes.len()], &area, &samples);
        let numbers = landings.numbers.clone();
        lens.aim_samples(&opened.pupil, at, &samples, numbers.iter().copied(), &mut rays);
        landings.pass(paths, node, &mut rays.in_lens);
        left += rays.in_lens.exited();
        for start in (0..numbers.len()).step_by(LANES) {
            let (block, count) = rays.in_lens.block_at(start);
            let of_block = start..start + count;
            let BandLandings { before, rims, block: places, .. } = &mut landings;
            places.read(&samples, &numbers[of_block.clone()], &before[of_block.clone()]);
            places.displace(node, &ctx, rims, block, start);
            for (lane, i) in of_block.enumerate().filter(|&(_, i)| rims.is_within(i)) {
                known += 1;
                let [point, direction] = [rays.in_lens.position(i), rays.in_lens.direction(i)];
                let start = Ray::new(point + direction * paths.lead, -direction).unwrap();
                for (other, at) in paths.nodes.iter().enumerate() {
                    let end = at.run(Side::Object, Clip::On, start);
                    assert_eq!(end.status, RayStatus::Exited, "node {other}");
                    let Ray { position, direction } = end.ray;
                    let traced = film.pixel(position.into(), direction.into());
                    let [x, y] = places.place(other, lane);
                    worst = worst.max((traced[0] - x).hypot(traced[1] - y));
                }
            }
        }
    }
    assert!(known * 10 > 9 * left, "{known} of {left}");
    assert!(worst < SharingLimits::DEFAULT.places, "{worst}");
}

/// On pixels so large that one wavelength places all bands, each band has the rays that pass at its own wavelengths: near
/// rims they are looked at, at a few wavelengths of a wide band, which errs for some of the few rays there.
#[test]
fn large_pixels_have_the_rays_that_pass() {
    let edges: Vec<f64> = (0..16).map(|k| 400.0 + 20.0 * f64::from(k)).collect();
    let many = Bands::Spectral(Grid::from_edges(edges).unwrap());
    let spec = serde_json::json!({
        "type": "lens", "lens": "lenses/double-gauss.json", "f_number": 2.8, "focus_distance": "4.4 m",
        "sensor_height": "28 mm", "pose": {"from": [0, 1, 4.4], "look_at": [0, 1, 0]},
        "sensor": {"resolution": [4, 4]}
    });
    for bands in [&Bands::Rgb, &many] {
        let camera = camera_of(spec.clone()).opened(bands).unwrap();
        assert_eq!(camera.lens().unwrap().opened_paths().unwrap().traced, 1);
        // Of the band within an error of a pixel's four sides a fourth or less is on the wrong side.
        let (found, error) = landings_elsewhere(&camera, 4.0, bands.count());
        assert!(found < error, "{found} of {} bands are elsewhere, {error}", bands.count());
    }
}

/// Rays that pass a fisheye at the wavelength of a band leave it at a leading one, though some end at the rims of all of these.
/// Those that keep away from rims pass at all wavelengths.
#[test]
fn no_ray_of_a_band_ends_at_all_leading_wavelengths() {
    let edges: Vec<f64> = (0..16).map(|k| 400.0 + 20.0 * f64::from(k)).collect();
    let bands = Bands::Spectral(Grid::from_edges(edges).unwrap());
    let spec = serde_json::json!({
        "type": "lens", "lens": "lenses/fisheye.json", "focus_distance": "1 m", "fov": 150,
        "pose": {"from": [0, 1, 4.4], "look_at": [0, 1, 0]}, "sensor": {"resolution": [256, 256]}
    });
    let camera = camera_of(spec).opened(&bands).unwrap();
    let lens = camera.lens().unwrap();
    let opened = lens.opened.as_ref().unwrap();
    let paths = opened.paths.as_ref().unwrap();
    let area = StartArea { resolution: [256; 2], margin: lens.margin(paths) };
    let film = lens.focused.film();
    let samples = many_samples(200_000, 256.0);
    let [mut passed, mut ended, mut within] = [0_u32; 3];
    for i in 0..samples.len() {
        let group = &opened.groups[i % opened.groups.len()];
        let at = &group.lenses[group.lens_at(samples.spectrum[i])];
        let place = film.place(samples.columns[i], samples.rows[i]);
        let found = opened.pupil.sample(place, samples.pupil[i], at.wavelength());
        let Some(PupilSample { direction, .. }) = found else { continue };
        let start = Ray::new(opened.pupil.film_point(place), direction).unwrap();
        let end = at.run(Side::Sensor, Clip::On, start);
        if end.status != RayStatus::Exited {
            continue;
        }
        passed += 1;
        let [point, direction] = [end.ray.position, end.ray.direction].map(DVec3::from);
        let back = Ray::new(point + direction * paths.lead, -direction).unwrap();
        let passes = |lens: &MonochromaticTrain| {
            let end = lens.run(Side::Object, Clip::On, back);
            let Ray { position, direction } = end.ray;
            let [x, y] = film.pixel(position.into(), direction.into());
            let [[left, top], [right, bottom]] = area.bounds();
            end.status == RayStatus::Exited && x >= left && y >= top && x < right && y < bottom
        };
        ended += u32::from(!paths.nodes.iter().any(passes));
        assert!(paths.leading().iter().any(passes), "sample {i}");
        let bounds = paths.rims.as_ref().unwrap();
        let near = bounds.near.as_ref().unwrap();
        let is_within = bounds.inner.iter().any(passes) || near.iter().all(passes);
        within += u32::from(is_within);
        assert!(!is_within || opened.groups.iter().flat_map(|group| &group.lenses).all(passes));
    }
    assert!(ended > 20 && within * 2 > passed, "{ended} and {within} of {passed}");
}

/// The place (pixels) where light of a band at `u` of the spectrum lands along a ray that leaves the lens at a point
/// (mm) in a direction, and the share of it that passes.
fn trace_back(
    lens: &LensCamera,
    band: usize,
    u: f64,
    [point, direction]: [DVec3; 2],
) -> ([f64; 2], f64) {
    let opened = lens.opened.as_ref().unwrap();
    let group = &opened.groups[band];
    let lead = opened.paths.as_ref().unwrap().lead;
    let ray = Ray::new(point + direction * lead, -direction).unwrap();
    let end = group.lenses[group.lens_at(u)].run(Side::Object, Clip::On, ray);
    let Ray { position, direction } = end.ray;
    let place = lens.focused.film().pixel(position.into(), direction.into());
    (place, if end.status == RayStatus::Exited { end.throughput } else { 0.0 })
}

/// So many samples all over a film of so many pixels a side, the pupil and the spectrum.
fn many_samples(count: u32, side: f64) -> FilmSamples {
    let mut samples = FilmSamples::default();
    for i in 0..count {
        let steps = [0.754_877_666, 0.569_840_290, 0.618_033_988, 0.414_213_562, 0.732_050_807];
        let [x, y, u, v, w] = steps.map(|step: f64| (0.5 + step * f64::from(i)).fract());
        samples.push([side * x, side * y], [u, v], w);
        samples.leading[i as usize] = (0.5 + 0.236_067_977 * f64::from(i)).fract();
    }
    samples
}

/// The share of landings that are not on the pixel of the band's own ray, on a film of so many pixels a side, and the error
/// that was measured (pixels of the camera as it was opened).
fn landings_elsewhere(camera: &crate::Camera, side: f64, bands: usize) -> (f64, f64) {
    let lens = camera.lens().unwrap();
    let opened = lens.opened.as_ref().unwrap();
    let paths = opened.paths.as_ref().unwrap();
    let samples = many_samples(60_000 / u32::try_from(bands).unwrap(), side);
    let (mut rays, mut landings) = (CameraRays::default(), BandLandings::default());
    camera.sample_band_rays(&samples, &mut rays, &mut landings);
    let to_lens = camera.pose().rotation.transpose();
    let (mut landed, mut elsewhere) = (0, 0);
    for (ray, &sample) in rays.sample.iter().enumerate() {
        let u = samples.spectrum[sample as usize];
        let point = to_lens * (rays.rays.origin(ray) - camera.pose().position) * 1e3;
        let point = point + DVec3::new(0.0, 0.0, lens.focused.origin());
        let from = [point, to_lens * rays.rays.direction(ray)];
        for band in 0..bands {
            let ([x, y], passed) = trace_back(lens, band, u, from);
            let is_seen = passed > 0.0 && x.min(y) >= 0.0 && x.max(y) < side;
            let own = match is_seen {
                true => y.floor() * side + x.floor(),
                false => f64::from(BandLandings::NOWHERE),
            };
            landed += 1;
            elsewhere += u32::from(own != f64::from(landings.pixel[bands * ray + band]));
        }
    }
    assert!(landed > 30_000, "{landed}");
    (f64::from(elsewhere) / f64::from(landed), paths.error)
}
