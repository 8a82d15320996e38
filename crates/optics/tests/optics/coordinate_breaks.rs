//! Breaks of the coordinates: the axis turns for all that follows, and comes back.

use etendue_optics::element::{Clip, LensRays, Ray, RayStatus};
use etendue_optics::train::{LensFile, OpticalTrain, Side, ZemaxLens};
use glam::{DMat3, DVec3};
use serde_json::{Value, json};

use crate::{build, try_build};

const D: f64 = 587.561_8;

fn lens(elements: &[Value]) -> OpticalTrain {
    build(&json!({ "elements": elements }).to_string())
}

fn doublet() -> [Value; 3] {
    [
        json!({"type": "surface", "radius": 60.0, "glass": "N-BK7", "thickness": 6.0, "semi_diameter": 15.0}),
        json!({"type": "surface", "radius": -45.0, "glass": "SF2", "thickness": 2.0, "semi_diameter": 15.0}),
        json!({"type": "surface", "radius": -130.0, "conic": -0.5, "thickness": 80.0, "semi_diameter": 15.0, "stop": true}),
    ]
}

fn rays() -> Vec<Ray> {
    [[0.0, 0.0, 0.0, 0.0], [3.0, -2.0, 0.02, 0.01], [-5.0, 4.0, 0.0, -0.05], [1.0, 6.0, -0.06, 0.0]]
        .map(|[x, y, u, v]| Ray::new(DVec3::new(x, y, -20.0), DVec3::new(u, v, 1.0)).unwrap())
        .to_vec()
}

/// Difference of two rays: places (mm) and directions.
fn apart(a: Ray, b: Ray) -> f64 {
    let of = |a: [f64; 3], b: [f64; 3]| (DVec3::from(a) - DVec3::from(b)).length();
    of(a.position, b.position).max(of(a.direction, b.direction))
}

#[test]
fn what_follows_a_break_is_as_without_it_for_rays_told_along_the_new_axis() {
    let plain = lens(&doublet());
    let at = plain.at(D).unwrap();
    for (tilt, rotation, decentre) in [
        ([7.0, 0.0], 0.0, [0.0, 0.0]),
        ([-3.0, 5.0], 20.0, [0.7, -1.2]),
        ([0.0, 0.0], 90.0, [2.0, 0.0]),
    ] {
        for tilt_first in [false, true] {
            let broken = json!({"type": "coordinate_break", "tilt": tilt, "rotation": rotation, "decentre": decentre,
                                "tilt_first": tilt_first});
            let train = lens(&[&[broken], &doublet()[..]].concat());
            // By the turns as they are written.
            let turns = [
                DMat3::from_rotation_x(f64::to_radians(tilt[0])),
                DMat3::from_rotation_y(f64::to_radians(tilt[1])),
                DMat3::from_rotation_z(f64::to_radians(rotation)),
            ];
            let shift = DVec3::new(decentre[0], decentre[1], 0.0);
            let (turn, origin) = match tilt_first {
                false => (turns[0] * turns[1] * turns[2], shift),
                true => {
                    let turn = turns[2] * turns[1] * turns[0];
                    (turn, turn * shift)
                }
            };
            let broken = train.at(D).unwrap();
            for ray in rays() {
                let own = Ray {
                    position: (turn.transpose() * (DVec3::from(ray.position) - origin)).to_array(),
                    direction: (turn.transpose() * DVec3::from(ray.direction)).to_array(),
                };
                let [a, b] =
                    [broken.run(Side::Object, Clip::On, ray), at.run(Side::Object, Clip::On, own)];
                assert_eq!((a.status, b.status), (RayStatus::Exited, RayStatus::Exited));
                // Roundings of places of 20 mm.
                assert!(apart(a.ray, b.ray) < 1e-13, "{:?} {:?}", a.ray, b.ray);
                // And back, which ends on the first surface as it is told before the break.
                let reversed =
                    |ray: Ray| Ray { direction: ray.direction.map(|cosine| -cosine), ..ray };
                let back = broken.run(Side::Sensor, Clip::On, reversed(a.ray)).ray;
                let (place, way) = (DVec3::from(ray.position), DVec3::from(ray.direction));
                let off = DVec3::from(back.position) - place;
                assert!((off - way * off.dot(way)).length() < 1e-12, "{back:?}");
                assert!((DVec3::from(back.direction) + way).length() < 1e-13);
            }
            // Focal lengths, planes and the sensor are those along the axis.
            let [a, b] = [&train, &plain].map(|train| train.paraxial(D).unwrap());
            assert_eq!((a.efl, a.bfl, a.image_z), (b.efl, b.bfl, b.image_z));
            assert!(!train.is_rotationally_symmetric());
            assert!(train.notes().iter().any(|note| note.contains("the axis breaks")));
        }
    }
}

#[test]
fn a_break_and_its_return_tilt_one_surface_as_its_own_tilt_does() {
    let [first, middle, last] = doublet();
    let mut tilted = middle.clone();
    tilted["tilt"] = json!([2.0, -1.5]);
    tilted["decentre"] = json!([0.3, -0.2]);
    let alone = lens(&[first.clone(), tilted, last.clone()]);
    let broken = json!({"type": "coordinate_break", "tilt": [2.0, -1.5], "decentre": [0.3, -0.2]});
    let mut flat = middle.clone();
    flat["thickness"] = json!(0.0);
    // Back by hand, turned first; and to where the break stood.
    let by_hand = json!({"type": "coordinate_break", "tilt": [-2.0, 1.5], "decentre": [-0.3, 0.2], "tilt_first": true,
                         "thickness": 2.0});
    let by_return = json!({"type": "coordinate_break", "return_to": 1, "thickness": 2.0});
    for back in [by_hand, by_return] {
        let train = lens(&[first.clone(), broken.clone(), flat.clone(), back, last.clone()]);
        assert_eq!(train.last_vertex(), alone.last_vertex());
        let ends = train.built();
        let [one, other] = [&train, &alone].map(|train| train.at(D).unwrap());
        for ray in rays() {
            let [a, b] = [&one, &other].map(|at| at.run(Side::Object, Clip::On, ray));
            assert_eq!((a.status, b.status), (RayStatus::Exited, RayStatus::Exited));
            assert!(apart(a.ray, b.ray) < 1e-13, "{:?} {:?}", a.ray, b.ray);
        }
        let place = DVec3::new(1.0, 2.0, 88.0);
        assert!((ends.last().unwrap().place(place) - place).length() < 1e-12, "the axis is back");
        let mut batch = LensRays::default();
        for ray in rays() {
            batch.push(ray.position.into(), ray.direction.into());
        }
        let mut single = batch.clone();
        one.trace(Side::Object, Clip::On, &mut batch);
        one.trace_singly(Side::Object, Clip::On, &mut single);
        for i in 0..batch.len() {
            assert_eq!(
                (batch.position(i), batch.direction(i)),
                (single.position(i), single.direction(i))
            );
        }
    }
}

#[test]
fn breaks_stand_as_those_of_a_zemax_file() {
    let [first, middle, last] = doublet();
    for tilt_first in [false, true] {
        let broken = json!({"type": "coordinate_break", "tilt": [6.0, -4.0], "rotation": 30.0, "decentre": [0.4, 0.9],
                            "tilt_first": tilt_first, "thickness": 3.0});
        let elements = [first.clone(), broken, middle.clone(), last.clone()];
        let text = json!({ "elements": elements }).to_string();
        let file = LensFile::from_json(&text).unwrap();
        let zemax = ZemaxLens::read(file.to_zemax().unwrap().as_bytes(), &[]).unwrap();
        let files = |name: &str| Err(format!("{name}: no files"));
        let (ours, theirs) = (lens(&elements), zemax.file.build(&files).unwrap());
        let spaces = ours.built();
        for ray in rays() {
            let path = |train: &OpticalTrain| {
                let at = train.at(D).unwrap();
                at.path(Side::Object, Clip::On, ray.position.into(), ray.direction.into())
            };
            let [a, b] = [path(&ours), path(&theirs)];
            assert_eq!((a.status, b.status), (RayStatus::Exited, RayStatus::Exited));
            // Elements 0, 2 and 3 in the space of the object; the file's are all there.
            for (i, k) in [(0, 0), (2, 1), (3, 2)] {
                assert!((spaces[i].place(a.points[i]) - b.points[k]).length() < 1e-12, "{i}");
            }
            let out = spaces[4].direction(a.direction.unwrap());
            assert!((out - b.direction.unwrap()).length() < 1e-13);
        }
    }
}

#[test]
fn breaks_that_are_none_are_refused() {
    let refused = |broken: Value| {
        let elements = json!([{"type": "surface", "glass": {"n": 1.5}, "thickness": 1.0}, broken, {"type": "surface"}]);
        try_build(&json!({ "elements": elements }).to_string()).unwrap_err()
    };
    for (broken, words) in [
        (json!({"type": "coordinate_break", "return_to": 1}), "must be an element before this one"),
        (
            json!({"type": "coordinate_break", "return_to": 0, "tilt": [1, 0]}),
            "give either return_to",
        ),
        (json!({"type": "coordinate_break", "stop": true}), "stops nothing"),
        (json!({"type": "coordinate_break", "radius": 3}), "unknown field `radius`"),
        (
            json!({"type": "coordinate_break", "gradient": {"type": "rod", "g": 0.1}}),
            "write it there",
        ),
    ] {
        let why = refused(broken);
        assert!(why.contains(words), "{why} / {words}");
    }
    let folded = json!({"elements": [
        {"type": "mirror", "thickness": -10.0}, {"type": "coordinate_break", "return_to": 0}, {"type": "surface"}
    ]});
    let why = try_build(&folded.to_string()).unwrap_err();
    assert!(why.contains("an odd number of mirrors"), "{why}");
}
