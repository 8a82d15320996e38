//! Surfaces that a ray crosses more than once.

use anyhow::{Context, Result};
use etendue_geometry::glam::{DVec2, DVec3};
use etendue_optics::element::{Clip, LensRays};
use etendue_optics::train::Side;

use super::bench::{YELLOW, lens};
use crate::{Case, Outcome, Scale};

pub(super) const CROSSINGS: Case = Case {
    name: "crossed_more_than_once",
    regime: "aspheres with and without a clear aperture, and biconics, that rays at 0 to 84 degrees cross once and \
        more often",
    must: "a ray meets the surface at the first place where it crosses from front to back, which a scan of 8000 places \
        finds by the sag alone; alone and in a batch to the bit",
    limit: None,
    run: crossings,
};

/// Its words, its sag and how far from the axis it may be crossed (mm).
type Surface = (&'static str, fn(DVec2) -> f64, f64);

const SURFACES: [Surface; 5] = [
    (
        r#""type": "surface", "curvature": 0.05, "semi_diameter": 6, "aspheric": {"4": -1.5e-3}"#,
        |p| sphere(0.05, p) - 1.5e-3 * p.length_squared().powi(2),
        6.0,
    ),
    (
        r#""type": "surface", "curvature": 0.05, "aspheric": {"4": -1.5e-3}"#,
        |p| sphere(0.05, p) - 1.5e-3 * p.length_squared().powi(2),
        20.0,
    ),
    (
        r#""type": "surface", "curvature": 0.02, "semi_diameter": 9, "aspheric": {"4": 4e-3, "6": -9e-5, "8": 5e-7}"#,
        |p| {
            let u = p.length_squared();
            sphere(0.02, p) + 4e-3 * u.powi(2) - 9e-5 * u.powi(3) + 5e-7 * u.powi(4)
        },
        9.0,
    ),
    (
        r#""type": "surface", "semi_diameter": 5, "aspheric": {"2": 0.3, "30": -1e-20}"#,
        |p| 0.3 * p.length_squared() - 1e-20 * p.length_squared().powi(15),
        5.0,
    ),
    (
        r#""type": "biconic", "radius_x": 50, "conic_x": -4000, "radius": 4, "conic": -1, "semi_diameter": 6"#,
        |p| {
            let rise = 0.02 * p.x * p.x + 0.25 * p.y * p.y;
            rise / (1.0 + (1.0 + 3999.0 * 0.0004 * p.x * p.x).sqrt())
        },
        6.0,
    ),
];

fn sphere(curvature: f64, p: DVec2) -> f64 {
    let u = p.length_squared();
    curvature * u / (1.0 + (1.0 - curvature * curvature * u).sqrt())
}

/// Places of the scan, and how far it runs (mm).
const PLACES: u32 = 8_000;
const RANGE: f64 = 80.0;

/// First crossing of a ray from front to back, to a step, and the number of all of them.
fn scanned(surface: &Surface, from: DVec3, along: DVec3) -> (Option<f64>, u32) {
    let step = RANGE / f64::from(PLACES);
    let behind = |i: u32| {
        let at = from + step * f64::from(i) * along;
        let sag = (surface.1)(at.truncate());
        (at.truncate().length() <= surface.2 && sag.is_finite()).then_some(at.z > sag)
    };
    let (mut first, mut count, mut before) = (None, 0, behind(0));
    for i in 1..=PLACES {
        let here = behind(i);
        if before.is_some() && here.is_some() && before != here {
            count += 1;
            if here == Some(true) {
                first = first.or(Some(step * f64::from(i - 1)));
            }
        }
        before = here;
    }
    (first, count)
}

fn crossings(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut random = fastrand::Rng::with_seed(8);
    for surface in &SURFACES {
        let train = lens(&format!(r#"{{{}, "thickness": 5, "glass": {{"n": 1.5}}}}"#, surface.0))?;
        let at = train.at(YELLOW)?;
        let (mut met, mut more) = (0, 0);
        for _ in 0..scale.pick(1_000, 20_000) {
            let (sin, cos) = (random.f64() * 84.0).to_radians().sin_cos();
            let about = DVec2::from_angle(random.f64() * std::f64::consts::TAU);
            let along = DVec3::new(sin * about.x, sin * about.y, cos);
            let mut place = || 8.0 * random.f64() - 4.0;
            let through = DVec3::new(place(), place(), place());
            let from = through - 0.5 * RANGE * along;
            let (Some(first), count) = scanned(surface, from, along) else { continue };
            met += 1;
            more += u32::from(count >= 3);
            let path = at.path(Side::Object, Clip::On, from, along);
            let point =
                path.points.first().with_context(|| format!("{from} along {along} ends"))?;
            let travel = (*point - from).dot(along);
            // The scan is as coarse as its step.
            let near = (first - 1e-9..first + RANGE / f64::from(PLACES) + 1e-9).contains(&travel);
            let off = point.z - (surface.1)(point.truncate());
            outcome.must(near && off.abs() < 1e-9, || {
                format!("{}: {from} along {along}: {travel}, not {first}; {off} off", surface.0)
            });
            let mut rays = LensRays::default();
            rays.push(from, along);
            at.trace(Side::Object, Clip::On, &mut rays);
            outcome.must(rays.status(0) == path.status, || format!("{from} along {along} alone"));
        }
        outcome.must(met > 0, || format!("no ray meets {}", surface.0));
        outcome.measured(format!("{met} rays, {more} of them crossing three times or more"));
    }
    Ok(outcome)
}
