//! Lights nearer than near, and a sky that is one pixel.

use std::f64::consts::PI;

use anyhow::{Context, Result};
use etendue_geometry::glam::DVec3;
use etendue_tracer::ClearSky;
use serde_json::json;

use crate::rendered::{Pixels, electrons_of_channels, farthest, load, patch, scene};
use crate::sampling::SAMPLERS;
use crate::{Case, Outcome, Scale};

pub(super) const ON_A_SURFACE: Case = Case {
    name: "lamp_over_a_surface",
    regime: "a lamp of 1 m square, 1 m to 10⁻⁶ m over a matte floor, seen through the gap",
    must: "the floor shows ρ L times the form factor of the square (Howell, B-3), within 4 standard \
        errors; no sparkles: no pixel is beyond 1.5 times the mean",
    limit: None,
    run: on_a_surface,
};

pub(super) const POINT_ON_A_SURFACE: Case = Case {
    name: "point_light_on_a_surface",
    regime: "a point light 1 m, 10⁻⁶, 10⁻¹² and 10⁻³⁰ m over a floor, in its plane, and under it",
    must: "all numbers are finite; 1 m away the law of cosines to 10⁻⁶; under the floor it is dark",
    limit: None,
    run: point_on_a_surface,
};

pub(super) const TOUCHING: Case = Case {
    name: "lamp_that_touches",
    regime: "a lamp that stands on the floor: the corner between both, where the distance goes to 0",
    must: "the floor shows ρ L/2 at the corner, within 4 standard errors and 1 %; all numbers are finite",
    limit: None,
    run: touching,
};

pub(super) const ONE_BRIGHT_PIXEL: Case = Case {
    name: "one_bright_pixel_of_sky",
    regime: "an environment image of 256 × 128 and 2048 × 1024 pixels, black but for one of 10⁶",
    must: "a matte floor under it shows the integral of that pixel within 4 standard errors, and pixels \
        differ by no more than 10 % of it",
    limit: None,
    run: one_bright_pixel,
};

pub(super) const SMALL_SUN: Case = Case {
    name: "sky_with_a_small_sun",
    regime: "a sky of 0.0498 with a square of 1/16 of its width that shines 300, as an image of 256 × 128 \
        to 2048 × 1024 pixels, by every sampler",
    must: "a matte floor under it shows the integral of the image within 4 standard errors, which are \
        below 0.2 %",
    limit: None,
    run: small_sun,
};

pub(super) const IN_A_FLOOR: Case = Case {
    name: "lamp_in_a_floor",
    regime: "a lamp in the very plane of a floor, named before it and after it, straight and turned, at the origin, 0.3 and \
        100 m away",
    must: "the later one is seen, and nothing of the other",
    limit: None,
    run: in_a_floor,
};

pub(super) const SKY_SPECTRUM: Case = Case {
    name: "spectrum_of_a_clear_sky",
    regime: "a multispectral sensor of eight bands from 400 to 720 nm that looks into a clear sky of turbidity 1 to 8, \
        the sun at 10 to 80 degrees",
    must: "the bands' electrons are as those of the authors' radiance at eleven wavelengths, summed in steps of 0.1 nm, \
        to 2·10⁻³: bands may lose 10⁻³, and a texel of the map is 0.35 degrees",
    limit: None,
    run: sky_spectrum,
};

/// The form factor of a square of side 1 from a point under its middle, `h` below.
fn form_factor(h: f64) -> f64 {
    let x = 0.5 / h;
    let root = (1.0 + x * x).sqrt();
    // Four corners, each X/√(1 + X²) · atan(X/√(1 + X²)) / π.
    4.0 / PI * (x / root) * (x / root).atan()
}

fn in_a_floor(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut worst = 0.0_f64;
    for (at, turn) in [(0.0, 0), (0.3, 37), (100.0, 37)] {
        let sheet = |size: f64, material: &str| {
            format!(
                r#"{{"shape": "rectangle", "width": {size}, "height": {size}, "material": "{material}",
                    "transform": {{"translate": [{at}, {at}, {at}], "rotate": [1, 0.2, 0.3, {turn}]}}}}"#
            )
        };
        let (floor, lamp) = (sheet(4.0, "floor"), sheet(1.0, "lamp"));
        for (name, objects, known) in [
            ("the lamp is later", format!("{floor}, {lamp}"), 3.0),
            ("the floor is later", format!("{lamp}, {floor}"), 0.0),
        ] {
            let rest = format!(
                r#""lights": [], "objects": [{objects}],
                "materials": {{"floor": {{"type": "matte", "color": [0.5, 0.5, 0.5]}},
                    "lamp": {{"type": "emissive", "radiance": [3, 3, 3], "two_sided": true}}}}"#
            );
            for tracer in ["direct", "path"] {
                let eye = [[at + 0.1, at + 0.2, at + 2.0], [at + 0.1, at + 0.13, at]];
                let tracer = format!(r#"{{"type": "{tracer}"}}"#);
                for seen in Pixels::in_both(scene(&patch(&tracer, 4, eye, &rest))?)? {
                    let off = seen.values.iter().map(|v| (v - known).abs()).fold(0.0, f64::max);
                    // What shines along its own plane is a rounding of nothing: 10⁻⁷ at both ends of a ray, over the
                    // squared distance, which may be millimetres.
                    outcome.must(off <= 1e-6, || {
                        format!("{name} at {at} m, {tracer}, {:?}: {off}", seen.precision)
                    });
                    worst = worst.max(off);
                }
            }
        }
    }
    outcome.measured(format!("at most {worst:.1e} off"));
    Ok(outcome)
}

fn sky_spectrum(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let all = [(1.0, 80.0), (3.0, 45.0), (8.0, 45.0), (3.0, 10.0)];
    let skies: &[(f64, f64)] = scale.pick(&all[1..2], &all);
    for &(turbidity, elevation) in skies {
        let sky = ClearSky::new(turbidity, elevation, 0.2, false).context("a sky")?;
        let mut worst = 0.0_f64;
        let seen = [[0.2, 0.9, 0.4], [0.5, 0.4, 0.7]]
            .into_iter()
            .flat_map(|toward| ["double", "single"].map(|precision| (toward, precision)));
        for (toward, precision) in seen {
            let text = json!({
                "etendue": 1, "tracer": { "type": "direct" }, "render": { "samples": 1 },
                "plan": { "light_precision": precision },
                "camera": {
                    "type": "orthographic", "height": 0.5,
                    "pose": { "from": [0, 0, 0], "look_at": toward },
                    "sensor": {
                        "type": "multispectral", "bands": { "from": 400, "to": 720, "count": 8 },
                        "radiometry": "physical", "system_gain": 1.0, "noise": "none", "resolution": [4, 4]
                    }
                },
                // What keeps the scene from being empty is not seen.
                "objects": [{ "shape": "rectangle", "transform": { "translate": [0, -50, 0] } }],
                "lights": [{ "type": "sky", "turbidity": turbidity,
                             "sun": { "elevation": elevation, "shines": false } }]
            });
            let found = electrons_of_channels(&text)?;
            let spectrum = sky.dome_spectrum(DVec3::from(toward).normalize());
            let known: Vec<f64> = (0..8)
                .map(|band| {
                    let places = (0..400).map(|k| 0.1 * (f64::from(k) + 0.5));
                    let photons = |nm: f64| spectrum.at(nm).unwrap_or(0.0) * nm;
                    places.map(|nm| photons(400.0 + 40.0 * f64::from(band) + nm)).sum()
                })
                .collect();
            let [all, sum] = [&found, &known].map(|of| of.iter().sum::<f64>());
            for (found, known) in found.iter().zip(&known) {
                worst = worst.max((found / all * sum / known - 1.0).abs());
            }
        }
        outcome.must(worst <= 2e-3, || format!("{turbidity}, {elevation}°: {worst}"));
        outcome.measured(format!("turbidity {turbidity}, {elevation}°: {worst:.1e} off"));
    }
    Ok(outcome)
}

fn on_a_surface(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for gap in [1.0, 1e-1, 1e-2, 1e-4, 1e-6] {
        // A camera in the gap that looks down at the point under the lamp's middle.
        let text = format!(
            r#"{{"etendue": 1, "tracer": {{"type": "direct"}},
            "camera": {{"type": "pinhole", "fov": 1,
                "pose": {{"from": [0, 0, {}], "look_at": [0, 0, 0], "up": [0, 1, 0]}},
                "sensor": {{"resolution": [8, 8]}}}},
            "lights": [],
            "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "m"}},
                {{"shape": "rectangle", "material": "lamp",
                  "transform": {{"translate": [0, 0, {gap}], "rotate": [0, 1, 0, 180]}}}}],
            "materials": {{"m": {{"type": "matte", "color": [0.8, 0.8, 0.8]}},
                "lamp": {{"type": "emissive", "radiance": [5, 5, 5]}}}},
            "render": {{"samples": {}}}}}"#,
            gap / 2.0,
            scale.pick(256, 16_384)
        );
        let both = Pixels::in_both(scene(&text)?)?;
        let known = 0.8 * 5.0 * form_factor(gap);
        for seen in &both {
            let at = format!("at {gap} m, {:?}", seen.precision);
            let (mean, error) = (seen.mean(), seen.standard_error());
            outcome.must(seen.are_sound(), || format!("{at}: not finite"));
            // The patch is 10⁻² of the gap wide, of which the form factor knows the square.
            let bound = 4.0 * error + 1e-4 * known;
            let holds = (mean - known).abs() <= bound;
            outcome.must(holds, || format!("{at}: {mean} ± {error}, not {known}"));
            outcome.must(seen.most() <= 1.5 * mean, || format!("{at}: {}", seen.most()));
        }
        let seen = farthest(&both, known)?;
        let (off, error) = (seen.mean() / known - 1.0, seen.standard_error() / known);
        outcome.measured(format!("{gap:.0e} m: {off:+.1e} off, ± {error:.0e}"));
    }
    Ok(outcome)
}

fn point_on_a_surface(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for height in [1.0, 1e-6, 1e-12, 1e-30, 0.0, -1e-6] {
        let rest = format!(
            r#""lights": [{{"type": "point", "at": [0, 0, {height:?}], "intensity": [1, 1, 1]}}],
            "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "m"}}],
            "materials": {{"m": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}}"#
        );
        let eye = [[1.0, 0.5, 3.0], [0.0; 3]];
        let both = Pixels::in_both(scene(&patch(r#"{"type": "direct"}"#, 64, eye, &rest))?)?;
        for seen in &both {
            let at = format!("at {height:e} m, {:?}", seen.precision);
            outcome.must(seen.are_sound(), || format!("{at}: not finite"));
            let mean = seen.mean();
            if height == 1.0 {
                let off = mean / (0.5 / PI) - 1.0;
                outcome.must(off.abs() <= 1e-6, || format!("{at}: {off:e} off"));
            }
            outcome.must(height >= 0.0 || mean == 0.0, || format!("{at}, under the floor: {mean}"));
        }
        // The brighter one.
        let mean = farthest(&both, 0.0)?.mean();
        outcome.measured(format!("{height:.0e} m: {mean:.1e}"));
    }
    Ok(outcome)
}

fn touching(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for away in [1e-3, 1e-6, 1e-9] {
        // The lamp stands in the plane x = 0 and shines along +x over the floor z = 0.
        let text = format!(
            r#"{{"etendue": 1, "tracer": {{"type": "direct"}},
            "camera": {{"type": "orthographic", "height": {},
                "pose": {{"from": [3, 0, 3], "look_at": [{away:?}, 0, 0], "up": [0, 0, 1]}},
                "sensor": {{"resolution": [8, 8]}}}},
            "lights": [],
            "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "m"}},
                {{"shape": "rectangle", "width": 8, "height": 8, "material": "lamp",
                  "transform": {{"translate": [0, 0, 4], "rotate": [0, 1, 0, 90]}}}}],
            "materials": {{"m": {{"type": "matte", "color": [0.8, 0.8, 0.8]}},
                "lamp": {{"type": "emissive", "radiance": [5, 5, 5]}}}},
            "render": {{"samples": {}}}}}"#,
            away / 10.0,
            scale.pick(256, 16_384)
        );
        // Nearer than f32 tells from the corner the plan takes f64.
        let all = Pixels::where_planned(scene(&text)?)?;
        let known = 0.8 * 5.0 / 2.0;
        for seen in &all {
            let at = format!("at {away:e} m, {:?}", seen.precision);
            outcome.must(seen.are_sound(), || format!("{at}: not finite"));
            let (mean, error) = (seen.mean(), seen.standard_error());
            let holds = (mean - known).abs() <= 4.0 * error + 0.01 * known;
            outcome.must(holds, || format!("{at}: {mean} ± {error}, not {known}"));
        }
        let seen = farthest(&all, known)?;
        let (off, error) = (seen.mean() / known - 1.0, seen.standard_error() / known);
        outcome.measured(format!("{away:.0e} m: {off:+.1e} off, ± {error:.0e}"));
    }
    Ok(outcome)
}

/// The irradiance on a floor that faces +y, of one pixel of the sky's image at `row`, radiance 1: an
/// image is interpolated between the middles of its pixels, so the pixel is a tent.
fn irradiance(row: f64, [width, height]: [f64; 2]) -> f64 {
    let steps = 1_000;
    let tent = |k: i32| {
        let t = (f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0;
        let theta = PI * (row + 0.5 + t) / height;
        (1.0 - t.abs()) * theta.cos() * theta.sin() * 2.0 / f64::from(steps)
    };
    (0..steps).map(tent).sum::<f64>() * (2.0 * PI / width) * (PI / height)
}

fn one_bright_pixel(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let sizes: &[[u16; 2]] = scale.pick(&[[256, 128]], &[[256, 128], [2048, 1024]]);
    for &[width, height] in sizes {
        let (column, row) = (width / 3, height / 4);
        let folder = tempfile::tempdir()?;
        let dark = image::Rgb([0.0_f32; 3]);
        let mut sky = image::Rgb32FImage::from_pixel(width.into(), height.into(), dark);
        sky.put_pixel(column.into(), row.into(), image::Rgb([1e6; 3]));
        write_exr(&folder.path().join("sky.exr"), &sky)?;
        let rest = r#""lights": [{"type": "environment", "image": "sky.exr"}],
            "objects": [{"shape": "rectangle", "width": 9, "height": 9, "material": "m",
                "transform": {"rotate": [1, 0, 0, -90]}}],
            "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;
        let size = [width, height].map(f64::from);
        let known = 0.5 / PI * 1e6 * irradiance(f64::from(row), size);
        for tracer in ["direct", "path"] {
            let eye = [[0.5, 3.0, 1.0], [0.0; 3]];
            let samples = scale.pick(1_024, 16_384);
            let tracer_spec = format!(r#"{{"type": "{tracer}"}}"#);
            let text = patch(&tracer_spec, samples, eye, rest);
            let both = Pixels::in_both(load(folder.path(), &text)?)?;
            let spread = |seen: &Pixels| 8.0 * seen.standard_error() / known;
            for seen in &both {
                let at = format!("{tracer}, {width}, {:?}", seen.precision);
                let (mean, error) = (seen.mean(), seen.standard_error());
                outcome.must(seen.are_sound(), || format!("{at}: not finite"));
                let holds = (mean - known).abs() <= 4.0 * error + 1e-5 * known;
                outcome.must(holds, || format!("{at}: {mean} ± {error}, not {known}"));
                let spread = spread(seen);
                outcome.must(spread <= 0.1, || format!("{at}: pixels differ by {spread}"));
            }
            let seen = farthest(&both, known)?;
            let (off, spread) = (seen.mean() / known - 1.0, spread(seen));
            outcome.measured(format!(
                "{tracer}, {width} columns: {off:+.1e} off, pixels ± {spread:.0e}"
            ));
        }
    }
    Ok(outcome)
}

fn small_sun(scale: Scale) -> Result<Outcome> {
    const SKY: f64 = 0.0498;
    const SUN: f64 = 300.0;
    let mut outcome = Outcome::default();
    let sizes: &[u16] = scale.pick(&[1024], &[256, 1024, 2048]);
    for &width in sizes {
        let (height, side) = (width / 2, width / 16);
        let (column, row) = (width / 3, height / 5);
        let folder = tempfile::tempdir()?;
        let mut sky = image::Rgb32FImage::from_pixel(width.into(), height.into(), grey(SKY));
        for k in 0..u32::from(side) * u32::from(side) {
            let [x, y] = [k % u32::from(side), k / u32::from(side)];
            sky.put_pixel(u32::from(column) + x, u32::from(row) + y, grey(SUN));
        }
        write_exr(&folder.path().join("sky.exr"), &sky)?;
        let size = [width, height].map(f64::from);
        let rows: f64 = (row..row + side).map(|row| irradiance(f64::from(row), size)).sum();
        let known = 0.5 / PI * (PI * SKY + (SUN - SKY) * rows * f64::from(side));
        let mut off = Vec::new();
        for (name, _) in SAMPLERS {
            let rest = r#""lights": [{"type": "environment", "image": "sky.exr"}],
                "objects": [{"shape": "rectangle", "width": 9, "height": 9, "material": "m",
                    "transform": {"rotate": [1, 0, 0, -90]}}],
                "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;
            let eye = [[0.5, 3.0, 1.0], [0.0; 3]];
            let text = patch(r#"{"type": "direct"}"#, scale.pick(1_024, 16_384), eye, rest);
            let sampler = format!(r#""render": {{"sampler": "{name}", "#);
            let text = text.replace(r#""render": {"#, &sampler);
            let both = Pixels::in_both(load(folder.path(), &text)?)?;
            for seen in &both {
                let at = format!("{name}, {width}, {:?}", seen.precision);
                let (mean, error) = (seen.mean(), seen.standard_error());
                // The image is kept in f32, and the sun's edges are summed in a thousand steps.
                let holds = (mean - known).abs() <= 4.0 * error + 1e-5 * known;
                outcome.must(holds, || format!("{at}: {mean} ± {error}, not {known}"));
                outcome.must(error <= 2e-3 * known, || format!("{at}: ± {error}"));
            }
            let seen = farthest(&both, known)?;
            let (by, error) = (seen.mean() / known - 1.0, seen.standard_error() / known);
            off.push(format!("{name} {by:+.1e} ± {error:.0e}"));
        }
        outcome.measured(format!("{width} columns: {}", off.join(", ")));
    }
    Ok(outcome)
}

#[expect(clippy::cast_possible_truncation, reason = "an image of f32")]
fn grey(value: f64) -> image::Rgb<f32> {
    image::Rgb([value as f32; 3])
}

fn write_exr(path: &std::path::Path, image: &image::Rgb32FImage) -> Result<()> {
    let [width, height] = [image.width(), image.height()].map(|side| side as usize);
    exr::prelude::write_rgb_file(path, width, height, |x, y| {
        let [x, y] = [x, y].map(|k| u32::try_from(k).unwrap_or(u32::MAX));
        let [r, g, b] = image.get_pixel(x, y).0;
        (r, g, b)
    })?;
    Ok(())
}
