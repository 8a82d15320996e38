//! Laws that hold for any lens and any ray.

use std::cell::Cell;
use std::collections::BTreeMap;

use anyhow::{Result, anyhow};
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::{Degrees, Millimetres};
use etendue_optics::element::{
    Clip, ElementSpec, LensRays, PartSpec, RayStatus, SurfaceSpec, ThinLensSpec,
};
use etendue_optics::glass::GlassSpec;
use etendue_optics::train::{LensFile, OpticalTrain, Side};
use proptest::prelude::*;
use proptest::test_runner::{TestCaseResult, TestRunner};

use super::bench::YELLOW;
use crate::{Case, Outcome, Scale};

pub(super) const ANY_LENS: Case = Case {
    name: "any_lens_and_any_ray",
    regime: "random trains of 1 to 7 elements, lens-like and absurd (radii from 10⁻⁹ to 10¹² mm, tilts to \
        90 degrees, 16th powers), and rays with any f64 for a coordinate, from either side",
    must: "no NaN and no infinity anywhere, unit directions, a status by name; a batch gives the bits of \
        single rays",
    limit: None,
    run: any_lens,
};

fn glass() -> impl Strategy<Value = Option<GlassSpec>> {
    prop_oneof![
        Just(None),
        (1.0..4.0_f64).prop_map(|n| Some(GlassSpec::Constant(n))),
        Just(Some(GlassSpec::Named("N-SF11".to_owned()))),
    ]
}

/// Mostly lens-like, sometimes absurd.
fn size() -> impl Strategy<Value = f64> {
    prop_oneof![8 => 1.0..200.0_f64, 1 => 1e-9..1e-3_f64, 1 => 1e6..1e12_f64]
}

fn surface() -> impl Strategy<Value = PartSpec> {
    let radius = (size(), any::<bool>(), any::<bool>());
    let conic = prop_oneof![2 => Just(0.0), 1 => -5.0..5.0_f64, 1 => -1e6..1e6_f64];
    let aspheric = prop_oneof![
        2 => Just(BTreeMap::new()),
        1 => (-1e-2..1e-2_f64, -1e-3..1e-3_f64, -1e-6..1e-6_f64).prop_map(|(a, b, c)| {
            [("2", a), ("4", b), ("16", c)].map(|(k, v)| (k.to_owned(), v)).into()
        }),
    ];
    (radius, glass(), prop::option::of(size()), conic, aspheric).prop_map(
        |((radius, negative, flat), glass, semi_diameter, conic, aspheric)| {
            let radius = if negative { -radius } else { radius };
            PartSpec::Surface(SurfaceSpec {
                radius: (!flat).then_some(Millimetres(radius)),
                curvature: None,
                glass,
                semi_diameter: semi_diameter.map(Millimetres),
                conic,
                aspheric,
            })
        },
    )
}

fn element() -> impl Strategy<Value = ElementSpec> {
    let thin_lens = (size(), any::<bool>()).prop_map(|(f, negative)| {
        let focal_length = Millimetres(if negative { -f } else { f });
        PartSpec::ThinLens(ThinLensSpec { focal_length, semi_diameter: None })
    });
    let part =
        prop_oneof![6 => surface(), 1 => thin_lens, 1 => size().prop_map(PartSpec::circular)];
    let tilt = prop_oneof![3 => Just([0.0; 2]), 1 => [-90.0..90.0_f64, -90.0..90.0_f64]];
    (part, prop_oneof![Just(0.0), -5.0..20.0_f64], tilt).prop_map(|(part, thickness, tilt)| {
        let mut element = ElementSpec::new(part, thickness);
        element.mount.tilt = tilt.map(Degrees);
        element
    })
}

fn train() -> impl Strategy<Value = OpticalTrain> {
    prop::collection::vec(element(), 1..8).prop_map(|elements| {
        LensFile::new(elements)
            .build(&|_: &str| Err(String::new()))
            .expect("all of these are lenses")
    })
}

fn ray() -> impl Strategy<Value = (DVec3, DVec3)> {
    let place = prop_oneof![
        8 => [-30.0..30.0_f64, -30.0..30.0_f64, -50.0..50.0_f64].boxed(),
        1 => [-1e12..1e12_f64, -1e12..1e12_f64, -1e15..0.0_f64].boxed(),
        1 => [any::<f64>(), any::<f64>(), any::<f64>()].boxed(),
    ];
    let direction = prop_oneof![
        6 => [-0.5..0.5_f64, -0.5..0.5_f64, 0.5..1.0_f64].boxed(),
        2 => [-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64].boxed(),
        1 => Just([1.0, 0.0, 0.0]).boxed(),
        1 => [any::<f64>(), any::<f64>(), any::<f64>()].boxed(),
    ];
    (place, direction).prop_map(|(p, d)| (p.into(), d.into()))
}

/// Rays from one side, with or without rims.
#[derive(Debug, Clone)]
struct Shower {
    rays: Vec<(DVec3, DVec3)>,
    from_sensor: bool,
    clipped: bool,
}

fn shower() -> impl Strategy<Value = Shower> {
    let rays = prop::collection::vec(ray(), 1..40);
    (rays, any::<bool>(), any::<bool>()).prop_map(|(rays, from_sensor, clipped)| Shower {
        rays,
        from_sensor,
        clipped,
    })
}

/// Traces the rays as a batch and one by one; counts those that exit.
fn trace(train: &OpticalTrain, shower: &Shower, exited: &Cell<u64>) -> TestCaseResult {
    let at = train.at(YELLOW).map_err(|error| TestCaseError::fail(error.to_string()))?;
    let from = if shower.from_sensor { Side::Sensor } else { Side::Object };
    let clip = if shower.clipped { Clip::On } else { Clip::Off };
    let mut batch = LensRays::default();
    for &(position, direction) in &shower.rays {
        batch.push(position, direction);
    }
    let mut single = batch.clone();
    at.trace(from, clip, &mut batch);
    at.trace_singly(from, clip, &mut single);
    for (i, &(position, direction)) in shower.rays.iter().enumerate() {
        let (p, d) = (batch.position(i), batch.direction(i));
        prop_assert!(p.is_finite() && d.is_finite(), "{p} {d}");
        prop_assert!(batch.throughput(i).is_finite());
        if batch.status(i) == RayStatus::Exited {
            // Each of up to 8 elements rounds a direction a few times.
            prop_assert!((d.length() - 1.0).abs() < 1e-9, "{}", d.length() - 1.0);
            exited.set(exited.get() + 1);
        } else {
            let element = batch.status(i).element();
            prop_assert!(element.is_some_and(|element| element < train.elements().len()));
        }
        prop_assert_eq!(batch.status(i), single.status(i));
        prop_assert_eq!(p, single.position(i));
        prop_assert_eq!(d, single.direction(i));
        let path = at.path(from, clip, position, direction);
        prop_assert_eq!(path.status, batch.status(i));
        prop_assert!(path.points.iter().all(|p| p.is_finite()));
    }
    Ok(())
}

fn any_lens(scale: Scale) -> Result<Outcome> {
    let cases = scale.pick(2_000, 200_000);
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    let (rays, exited) = (Cell::new(0), Cell::new(0));
    let each = |(train, shower): (OpticalTrain, Shower)| {
        rays.set(rays.get() + shower.rays.len() as u64);
        trace(&train, &shower, &exited)
    };
    TestRunner::new(config).run(&(train(), shower()), each).map_err(|error| anyhow!("{error}"))?;
    let mut outcome = Outcome::default();
    let (rays, exited) = (rays.get(), exited.get());
    outcome.measured(format!(
        "{cases} trains, {rays} rays, {exited} exit; nothing that is not finite"
    ));
    outcome.must(exited > 0 && exited < rays, || format!("{exited} of {rays} exit"));
    Ok(outcome)
}
