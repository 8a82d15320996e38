//! Rays that end, surfaces that are hardly any.

use anyhow::Result;
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::Millimetres;
use etendue_optics::element::ElementSpec;
use etendue_optics::element::{Clip, LensRays, PartSpec, RayStatus, SurfaceSpec};
use etendue_optics::glass::GlassSpec;
use etendue_optics::train::{Focus, FocusError, LensFile, Side};

use super::bench::{YELLOW, greatest_height, lens, parallel, status};
use crate::{Case, Outcome, Scale};

/// A ball of glass, its front half the surface.
const BALL: &str = r#"{"type": "surface", "radius": 10, "glass": {"n": 1.5}}"#;

pub(super) const TOTAL_REFLECTION: Case = Case {
    name: "total_internal_reflection",
    regime: "parallel rays in glass of index 1.5 towards a sphere of radius 10 mm, up to its rim",
    must: "beyond 10/1.5 mm a ray ends as totally reflected, by element; the bound is exact to 10⁻¹² mm",
    limit: None,
    run: total_reflection,
};

pub(super) const MISSED: Case = Case {
    name: "missed_surface",
    regime: "rays beside a sphere of radius 10 mm, and square to the axis in front of it",
    must: "a ray ends as missed, by element; the bound is exact to 10⁻¹² mm",
    limit: None,
    run: missed,
};

pub(super) const WRONG_ROOT: Case = Case {
    name: "wrong_root_of_a_sphere",
    regime: "rays that start behind the vertex and meet only the back half of the sphere",
    must: "the back half is not the surface: missed",
    limit: None,
    run: wrong_root,
};

pub(super) const STEEP_ASPHERE: Case = Case {
    name: "newton_on_a_steep_asphere",
    regime: "an asphere with waves steeper than 60 degrees, rays at ±0.9 of slope",
    must: "every ray that exits has met the surface to 10⁻⁹ mm; every other ends by name; no NaN",
    limit: None,
    run: steep_asphere,
};

pub(super) const RIM_BEYOND_THE_RADIUS: Case = Case {
    name: "semi_diameter_beyond_the_radius",
    regime: "a sphere of radius 10 mm with a rim of 12 mm",
    must: "a note says where the surface ends, rays beyond miss it",
    limit: None,
    run: rim_beyond_the_radius,
};

pub(super) const FLAT: Case = Case {
    name: "infinite_radius",
    regime: "R = ±∞ and ±10³⁰⁰ mm, and ±10¹⁵ mm",
    must: "the first two are a plane to the bit, the last to 10⁻¹² of direction",
    limit: None,
    run: flat,
};

pub(super) const EQUAL_INDICES: Case = Case {
    name: "equal_indices",
    regime: "the same index on both sides of curved surfaces",
    must: "a ray's direction stays to the bit; focal length and f-number are absent, focus is refused \
        as afocal",
    limit: None,
    run: equal_indices,
};

pub(super) const CROSSING_EDGES: Case = Case {
    name: "crossing_edges",
    regime: "two spheres of 20 mm, 1 mm apart, that cut through each other at √(400 − 19.5²) mm",
    must: "a note says so; beyond, rays miss the second surface; the bound is exact to 10⁻⁸ mm",
    limit: None,
    run: crossing_edges,
};

fn total_reflection(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(
        r#"{"type": "surface", "thickness": 9, "glass": {"n": 1.5}},
           {"type": "surface", "radius": -10}"#,
    )?;
    let found = greatest_height(&train, Clip::Off, [0.0, 9.9])?;
    let off = (found - 10.0 / 1.5).abs();
    outcome.measured(format!("the last ray that gets through is {off:.0e} mm off 10/1.5 mm"));
    outcome.must(off <= 1e-12, || format!("{found} mm"));
    let beyond = parallel(&train, Clip::Off, 6.7)?;
    let expected = RayStatus::TotalInternalReflection { element: 1 };
    outcome.must(beyond == expected, || format!("at 6.7 mm: {beyond:?}"));
    let past = parallel(&train, Clip::Off, 10.1)?;
    outcome.must(past == RayStatus::Missed { element: 1 }, || format!("at 10.1 mm: {past:?}"));
    Ok(outcome)
}

fn missed(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(BALL)?;
    let found = greatest_height(&train, Clip::Off, [0.0, 11.0])?;
    let off = (found - 10.0).abs();
    outcome.measured(format!("the last ray that meets it is {off:.0e} mm off the rim"));
    outcome.must(off <= 1e-12, || format!("{found} mm"));
    let beside = parallel(&train, Clip::Off, 10.001)?;
    outcome.must(beside == RayStatus::Missed { element: 0 }, || format!("beside it: {beside:?}"));
    let across = status(&train, Clip::Off, DVec3::new(0.0, -30.0, -5.0), DVec3::Y)?;
    outcome.must(across == RayStatus::Missed { element: 0 }, || format!("across: {across:?}"));
    Ok(outcome)
}

fn wrong_root(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(BALL)?;
    let (mut asked, mut wrong) = (0, 0);
    let steps = scale.pick(20, 200);
    for i in 0..steps {
        for k in 1..steps {
            // Inside the ball, behind the front half, onwards.
            let share = |n: i32| f64::from(n) / f64::from(steps);
            let from = DVec3::new(0.0, 6.0 * share(i), 4.5 + 5.0 * share(k));
            let ends = status(&train, Clip::Off, from, DVec3::new(0.0, 0.1 * share(k), 1.0))?;
            asked += 1;
            wrong += usize::from(ends != RayStatus::Missed { element: 0 });
        }
    }
    outcome.measured(format!("{wrong} of {asked} rays meet the back half"));
    outcome.must(wrong == 0, || format!("{wrong} of {asked} rays"));
    Ok(outcome)
}

/// z(r) of the asphere below.
fn sagitta(r: f64) -> f64 {
    let (c, r2) = (1.0 / 50.0, r * r);
    c * r2 / (1.0 + (1.0 - c * c * r2).sqrt()) + 4e-3 * r2.powi(2) - 9e-5 * r2.powi(3)
        + 5e-7 * r2.powi(4)
}

fn steep_asphere(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(
        r#"{"type": "surface", "radius": 50, "thickness": 8, "glass": {"n": 1.5},
            "aspheric": {"4": 4e-3, "6": -9e-5, "8": 5e-7}},
           {"type": "surface"}"#,
    )?;
    let at = train.at(YELLOW)?;
    let (mut ends, mut worst) = ([0_usize; 3], 0.0_f64);
    let count = scale.pick(4_000, 400_000);
    for i in 0..count {
        let y = 20.0 * f64::from(i) / f64::from(count);
        let slope = 0.3 * f64::from(i % 7) - 0.9;
        let (from, along) = (DVec3::new(0.1, y - 20.0 * slope, -20.0), DVec3::new(0.0, slope, 1.0));
        let path = at.path(Side::Object, Clip::Off, from, along);
        let finite = path.points.iter().all(|p| p.is_finite());
        outcome.must(finite, || format!("from {from}: {:?}", path.points));
        if let Some(met) = path.points.first() {
            worst = worst.max((met.z - sagitta(met.truncate().length())).abs());
        }
        match path.status {
            RayStatus::Exited => ends[0] += 1,
            RayStatus::Missed { .. } => ends[1] += 1,
            _ => ends[2] += 1,
        }
    }
    let [exited, missed, other] = ends;
    outcome.measured(format!(
        "{exited} rays exit, {missed} miss, {other} end otherwise; {worst:.0e} mm off the surface at most"
    ));
    outcome.must(worst <= 1e-9, || format!("{worst} mm off the surface"));
    outcome.must(exited > 0 && missed > 0, || format!("no such regime: {ends:?}"));
    Ok(outcome)
}

fn rim_beyond_the_radius(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(
        r#"{"type": "surface", "radius": 10, "thickness": 5, "glass": {"n": 1.5},
            "semi_diameter": 12}, {"type": "surface", "semi_diameter": 12}"#,
    )?;
    let note = train.notes().first().cloned().unwrap_or_default();
    outcome.must(note.contains("its surface ends 10 mm"), || format!("the note is \"{note}\""));
    let beyond = parallel(&train, Clip::On, 11.0)?;
    outcome.must(beyond == RayStatus::Missed { element: 0 }, || format!("at 11 mm: {beyond:?}"));
    outcome.measured(format!("“{note}”"));
    Ok(outcome)
}

fn flat(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let window = |radius: Option<f64>| {
        let surface = PartSpec::Surface(SurfaceSpec {
            radius: radius.map(Millimetres),
            curvature: None,
            glass: Some(GlassSpec::Constant(1.5)),
            semi_diameter: None,
            conic: 0.0,
            aspheric: std::collections::BTreeMap::new(),
        });
        LensFile::new(vec![ElementSpec::new(surface, 0.0)]).build(&|_: &str| Err(String::new()))
    };
    let trace = |radius| -> Result<LensRays> {
        let mut rays = LensRays::default();
        for i in 0..100 {
            let slope = 0.02 * f64::from(i) - 1.0;
            rays.push(DVec3::new(0.1, f64::from(i), -7.0), DVec3::new(0.2, slope, 1.0));
        }
        window(radius)?.at(YELLOW)?.trace(Side::Object, Clip::Off, &mut rays);
        Ok(rays)
    };
    let plane = trace(None)?;
    for (radius, allowed) in [(f64::INFINITY, 0.0), (1e300, 0.0), (1e15, 1e-12)] {
        let mut worst = 0.0_f64;
        for sign in [1.0, -1.0] {
            let curved = trace(Some(sign * radius))?;
            for i in 0..plane.len() {
                outcome.must(curved.status(i) == RayStatus::Exited, || {
                    format!("{:?}", curved.status(i))
                });
                worst = worst.max((curved.direction(i) - plane.direction(i)).length());
            }
        }
        outcome.measured(format!("R = ±{radius:e} mm: {worst:.0e} from the plane's directions"));
        outcome.must(worst <= allowed, || format!("±{radius:e} mm: {worst:e}"));
    }
    Ok(outcome)
}

fn equal_indices(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(
        r#"{"type": "surface", "radius": 7, "thickness": 3, "glass": {"n": 1}},
           {"type": "surface", "radius": -9, "conic": -2}"#,
    )?;
    let direction = DVec3::new(0.1, 0.2, 1.0).normalize();
    let from = DVec3::new(0.5, 0.0, -4.0);
    let path = train.at(YELLOW)?.path(Side::Object, Clip::On, from, direction);
    outcome.must(path.direction == Some(direction), || format!("turned to {:?}", path.direction));
    let paraxial = train.paraxial(YELLOW)?;
    let none = (paraxial.efl, paraxial.bfl, paraxial.f_number) == (None, None, None);
    outcome.must(none, || format!("{paraxial:?}"));
    let focus = train.sensor_z(Focus::Infinity);
    outcome.must(focus == Err(FocusError::Afocal), || format!("{focus:?}"));
    let message = focus.err().map(|error| error.to_string()).unwrap_or_default();
    outcome.measured(format!("the direction stays to the bit; focus: “{message}”"));
    Ok(outcome)
}

fn crossing_edges(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(
        r#"{"type": "surface", "radius": 20, "thickness": 1, "glass": {"n": 1.5}, "semi_diameter": 10},
           {"type": "surface", "radius": -20, "semi_diameter": 10}"#,
    )?;
    let note = train.notes().first().cloned().unwrap_or_default();
    outcome.must(note.contains("cut through each other"), || format!("the note is \"{note}\""));
    let found = greatest_height(&train, Clip::On, [0.0, 9.0])?;
    let off = (found - (400.0 - 19.5_f64.powi(2)).sqrt()).abs();
    outcome.measured(format!("“{note}”; the last ray through is {off:.0e} mm off the cut"));
    outcome.must(off <= 1e-8, || format!("{found} mm"));
    let beyond = parallel(&train, Clip::On, 4.6)?;
    outcome.must(beyond == RayStatus::Missed { element: 1 }, || format!("at 4.6 mm: {beyond:?}"));
    Ok(outcome)
}
