//! What holds for any lens and any ray.

use std::collections::BTreeMap;

use etendue_camera::element::{
    Clip, ElementSpec, Fate, LensRays, PartSpec, SurfaceSpec, ThinLensSpec,
};
use etendue_camera::glass::GlassSpec;
use etendue_camera::length::{Degrees, Millimetres};
use etendue_camera::train::{LensFile, OpticalTrain, Side};
use glam::DVec3;
use proptest::prelude::*;

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
        LensFile::new(elements).build(&|_| Err(String::new())).expect("all of these are lenses")
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

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// No NaN, no infinity, unit directions; batches and single rays agree to the last bit.
    #[test]
    fn nothing_is_ever_nan(
        train in train(),
        rays in prop::collection::vec(ray(), 1..40),
        from_sensor in any::<bool>(),
        clipped in any::<bool>(),
    ) {
        let at = train.at(587.56).unwrap();
        let from = if from_sensor { Side::Sensor } else { Side::Object };
        let clip = if clipped { Clip::On } else { Clip::Off };
        let mut batch = LensRays::default();
        for &(position, direction) in &rays {
            batch.push(position, direction);
        }
        let mut single = batch.clone();
        at.trace(from, clip, &mut batch);
        at.trace_singly(from, clip, &mut single);
        for (i, &(position, direction)) in rays.iter().enumerate() {
            let (p, d) = (batch.position(i), batch.direction(i));
            prop_assert!(p.is_finite() && d.is_finite(), "{p} {d}");
            prop_assert!(batch.throughput(i).is_finite());
            if batch.fate(i) == Fate::Exited {
                // Each of up to 8 elements rounds a direction a few times.
                prop_assert!((d.length() - 1.0).abs() < 1e-9, "{}", d.length() - 1.0);
            } else {
                prop_assert!(batch.fate(i).element().unwrap() < train.elements().len());
            }
            prop_assert_eq!(batch.fate(i), single.fate(i));
            prop_assert_eq!(p, single.position(i));
            prop_assert_eq!(d, single.direction(i));
            let path = at.path(from, clip, position, direction);
            prop_assert_eq!(path.fate, batch.fate(i));
            prop_assert!(path.points.iter().all(|p| p.is_finite()));
        }
    }

    /// A ray sent back along its way arrives where it came from.
    #[test]
    fn light_can_go_back(radius in 15.0..60.0_f64, height in -6.0..6.0_f64, slope in -0.2..0.2_f64) {
        let file = format!(
            r#"{{"elements": [
                {{"type": "surface", "radius": {radius}, "thickness": 4, "glass": "N-BK7"}},
                {{"type": "surface", "radius": -40, "thickness": 2, "glass": "N-SF11", "conic": -0.7}},
                {{"type": "surface", "radius": -90, "aspheric": {{"4": 1e-5}}, "thickness": 7}},
                {{"type": "thin_lens", "focal_length": -120}}]}}"#
        );
        let train = LensFile::from_json(&file).unwrap().build(&|_| Err(String::new())).unwrap();
        let at = train.at(550.0).unwrap();
        let start = DVec3::new(0.3, height, -12.0);
        let direction = DVec3::new(0.01, slope, 1.0).normalize();
        let out = at.path(Side::Object, Clip::Off, start, direction);
        if let Some(onwards) = out.direction {
            let beyond = *out.points.last().unwrap() + onwards * 10.0;
            let back = at.path(Side::Sensor, Clip::Off, beyond, -onwards);
            let home = back.direction.expect("the same way back");
            // Eight refractions, each good to a few roundings.
            prop_assert!((home + direction).length() < 1e-12, "{home} {direction}");
            let first = *back.points.last().unwrap();
            let miss = (start - first).cross(direction).length();
            prop_assert!(miss < 1e-10, "{miss}");
        }
    }
}
