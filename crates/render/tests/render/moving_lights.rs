//! Lights that move while the shutter is open, against closed forms of what they send at each moment: they are asked
//! where they are at the ray's time.

use std::f64::consts::PI;
use std::sync::Arc;

use etendue_accel::AccelName;
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Motion, Steps};
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{layer, load_json, picture};

/// Of the floor, of the side that faces +Z.
const ALBEDO: f64 = 0.5;

const PIXELS: usize = 256;

/// A dot in the middle of a floor in z = 0, for one second.
fn scene(lights: Value, objects: Value, more: &Value) -> Scene {
    let mut all =
        vec![json!({ "shape": "rectangle", "width": 60, "height": 60, "material": "floor" })];
    all.extend(objects.as_array().unwrap().iter().cloned());
    let mut scene = json!({
        "etendue": 1, "tracer": { "type": "direct" }, "lights": lights, "objects": all,
        "camera": { "type": "orthographic", "height": 0.001, "sensor": { "resolution": [16, 16] },
                    "pose": { "from": [0, -3, 4], "look_at": [0, 0, 0] }, "shutter": { "exposure": 1 } },
        "materials": { "floor": { "type": "matte", "color": [ALBEDO, ALBEDO, ALBEDO] },
                       "metal": { "type": "metal", "color": [0.9, 0.9, 0.9], "roughness": 0.3 },
                       "lamp": { "type": "emissive", "radiance": [1, 1, 1], "two_sided": true } },
        "render": { "samples": 256 },
    });
    for (path, value) in more.as_object().unwrap() {
        *scene.pointer_mut(path).unwrap_or_else(|| panic!("{path}")) = value.clone();
    }
    load_json(std::path::Path::new("."), scene)
}

/// Light of a dot of it, and the standard error of that.
fn lit(scene: &Scene) -> [f64; 2] {
    let picture = picture(scene);
    let red = &layer(&picture, "")[..PIXELS];
    let mean = red.iter().sum::<f64>() / PIXELS as f64;
    let squares: f64 = red.iter().map(|v| (v - mean) * (v - mean)).sum();
    [mean, (squares / (PIXELS - 1) as f64 / PIXELS as f64).sqrt()]
}

/// All accelerators in both precisions of light.
fn all_ways() -> impl Iterator<Item = Value> {
    AccelName::built().map(AccelName::name).flat_map(|accel| {
        ["single", "double"].map(|precision| {
            json!({ "render": { "samples": 256, "accel": accel, "time": 7 }, "precision": precision })
        })
    })
}

/// A scene in one of [`all_ways`].
fn scene_in(way: &Value, tracer: &str, lights: Value, objects: Value) -> Scene {
    let more = json!({ "/render": way["render"], "/tracer": { "type": tracer } });
    let mut scene = scene(lights, objects, &more);
    scene.plan.light_precision = serde_json::from_value(way["precision"].clone()).unwrap();
    scene
}

/// The mean over x of h/(h² + y² + x²)^(3/2), what a point of intensity 1 sends down as it goes along x.
fn passing([x0, x1]: [f64; 2], y: f64, h: f64) -> f64 {
    let squared = h * h + y * y;
    let integral = |x: f64| h * x / squared / (squared + x * x).sqrt();
    (integral(x1) - integral(x0)) / (x1 - x0)
}

#[test]
fn points_that_move_send_the_mean_of_their_closed_form() {
    // h, and how far the way begins beside the dot: from x = −0.5 m to 1.5 m.
    let (h, y) = (1.2, 0.3);
    let due = ALBEDO / PI * 3.0 * passing([-0.5, 1.5], y, h);
    let at_first = ALBEDO / PI * 3.0 * h / (h * h + y * y + 0.25_f64).powf(1.5);
    assert!((at_first / due - 1.0).abs() > 0.1, "where it starts it sends otherwise");
    let light = |motion: Value| json!([{ "type": "point", "at": [-0.5, y, h], "intensity": [3, 3, 3], "motion": motion }]);
    let steady = light(json!({ "type": "velocity", "velocity": [2, 0, 0] }));
    let keyed =
        light(json!({ "type": "offsets", "offsets": [[0, 0, 0], [2, 0, 0]], "times": [7, 8] }));
    // Round an axis that is far to the left: the same way, but for a sagitta of 2 m²/(2 · 10⁵ m).
    let turning = light(json!({ "type": "velocity", "angular_velocity": [0, 0, 2e-5 * 180.0 / PI],
                                "about": [0, 1e5, h] }));
    for way in all_ways() {
        for lights in [&steady, &keyed, &turning] {
            let scene = scene_in(&way, "direct", lights.clone(), json!([]));
            let [found, _] = lit(&scene);
            // 65 536 random times were 0.3/256 off; those of a pixel are spread evenly.
            assert!((found / due - 1.0).abs() < 1.2e-3, "{way} {lights}: {found}, not {due}");
        }
    }
}

#[test]
fn cones_and_images_that_turn_are_seen_while_they_are_aimed() {
    // They turn by 120° from straight down, of which the first 30° meet the dot.
    let (h, turn) = (2.0_f64, json!({ "type": "velocity", "angular_velocity": [0, 120, 0] }));
    let common =
        json!({ "at": [0, 0, h], "look_at": [0, 0, 0], "intensity": [8, 8, 8], "motion": turn });
    let with = |more: Value| {
        let mut light = common.clone();
        light.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        json!([light])
    };
    let spot = with(json!({ "type": "spot", "cone": 30, "inner_cone": 30 }));
    let projector = with(json!({ "type": "projector", "fov": 60, "up": [0, 1, 0] }));
    let thirty = PI / 6.0;
    // Of a projector the intensity grows as 1/cos³ towards the edges of its image.
    let secants = 0.5 * (thirty.tan() / thirty.cos() + (1.0 / thirty.cos() + thirty.tan()).ln());
    for way in all_ways().take(2) {
        for (lights, share) in [(&spot, 0.25), (&projector, secants / (4.0 * thirty))] {
            let due = ALBEDO / PI * 8.0 / (h * h) * share;
            let [found, _] = lit(&scene_in(&way, "direct", lights.clone(), json!([])));
            // A quarter of 65 536 random times is 0.7 % off; those of a pixel are spread evenly: a tenth.
            assert!((found / due - 1.0).abs() < 3e-3, "{way} {lights}: {found}, not {due}");
        }
    }
}

/// Lambert's irradiance at the origin, from above, of a polygon of radiance 1 that is all above the floor.
fn lambert(corners: &[DVec3]) -> f64 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let parts = sides.map(|(a, b)| {
        let across = a.cross(*b);
        a.angle_between(*b) * across.normalize().z
    });
    0.5 * parts.sum::<f64>().abs()
}

/// The corners of a rectangle of a shape `rectangle`, in turn.
fn rectangle([width, height]: [f64; 2]) -> [DVec3; 4] {
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, y]| DVec3::new(0.5 * x * width, 0.5 * y * height, 0.0))
}

/// The mean of Lambert's irradiance over the second.
fn mean_over_time(corners: impl Fn(f64) -> Vec<DVec3>) -> f64 {
    let count = 2000;
    let moment = |k: u32| (f64::from(k) + 0.5) / f64::from(count);
    (0..count).map(|k| lambert(&corners(moment(k)))).sum::<f64>() / f64::from(count)
}

/// A lamp that flies and turns about an axis through its middle, as an object of a scene; and where its corners are.
struct Flying {
    size: [f64; 2],
    from: DVec3,
    velocity: DVec3,
    degrees: f64,
}

impl Flying {
    fn object(&self) -> Value {
        json!({ "shape": "rectangle", "width": self.size[0], "height": self.size[1], "material": "lamp",
                "transform": { "translate": self.from.to_array() },
                "motion": { "type": "velocity", "velocity": self.velocity.to_array(),
                            "angular_velocity": [0, self.degrees, 0] } })
    }

    fn corners(&self, time: f64) -> Vec<DVec3> {
        let turn = DMat3::from_rotation_y((self.degrees * time).to_radians());
        let place = self.from + self.velocity * time;
        rectangle(self.size).map(|corner| place + turn * corner).to_vec()
    }
}

/// The error that is told apart from a lamp that is not asked: paths that come upon one of a thousandth of what they
/// see are 1/√(0.001 · 65 536), 12 %, off.
const ASKED: f64 = 0.01;

/// Checks what is found against what is due, to 4 standard errors and what the triangles' f32 and 2000 moments make.
fn holds([found, error]: [f64; 2], due: f64, name: &str) {
    assert!((found - due).abs() < 4.0 * error + 2e-4 * due, "{name}: {found} ± {error}, not {due}");
    assert!(error < ASKED * due, "{name}: {error} of {due}: it is not asked");
}

#[test]
fn lamps_that_move_are_asked_and_send_the_mean_of_their_closed_form() {
    let small = Flying {
        size: [0.2, 0.1],
        from: DVec3::new(-1.0, 0.4, 1.5),
        velocity: DVec3::new(2.0, 0.0, 0.0),
        degrees: 0.0,
    };
    let turning = Flying {
        size: [0.6, 0.3],
        from: DVec3::new(0.5, 0.9, 1.4),
        velocity: DVec3::new(0.0, -0.6, 0.4),
        degrees: 400.0,
    };
    for way in all_ways() {
        for (name, lamp) in [("small", &small), ("turning", &turning)] {
            for tracer in ["direct", "path"] {
                let due = ALBEDO / PI * mean_over_time(|time| lamp.corners(time));
                let scene = scene_in(&way, tracer, json!([]), json!([lamp.object()]));
                // The lamp gets light of the floor by paths, which it does not return: it is black.
                holds(lit(&scene), due, &format!("{name} {tracer} {way}"));
            }
        }
    }
}

/// Among many, of which some stand still and some are points, lights are chosen by a tree over where they go.
#[test]
fn moving_lamps_among_many_are_chosen_by_where_they_go() {
    let lamp = |k: i32| Flying {
        size: [0.3, 0.2],
        from: DVec3::new(0.5 * f64::from(k) - 2.0, 1.0 - 0.2 * f64::from(k), 1.2),
        velocity: DVec3::new(0.0, if k % 3 == 0 { 0.0 } else { 1.5 }, 0.3),
        degrees: f64::from(k % 2) * 200.0,
    };
    let lamps: Vec<Flying> = (0..9).map(lamp).collect();
    let light = json!([{ "type": "point", "at": [-0.5, 0.3, 1.2], "intensity": [0.2, 0.2, 0.2],
                         "motion": { "type": "velocity", "velocity": [2, 0, 0] } }]);
    let of_lamps: f64 = lamps.iter().map(|lamp| mean_over_time(|time| lamp.corners(time))).sum();
    let due = ALBEDO / PI * (of_lamps + 0.2 * passing([-0.5, 1.5], 0.3, 1.2));
    for way in all_ways() {
        let objects: Vec<Value> = lamps.iter().map(Flying::object).collect();
        let scene = scene_in(&way, "direct", light.clone(), json!(objects));
        holds(lit(&scene), due, &way.to_string());
    }
}

/// A lamp that grows and tilts by steps of its shape is asked at its shape at the ray's time.
#[test]
fn a_lamp_that_changes_its_shape_is_asked() {
    let small = rectangle([0.1, 0.1]).map(|p| p + DVec3::new(-0.5, 0.2, 1.2));
    let large = rectangle([0.5, 0.3]).map(|p| p + DVec3::new(0.8, -0.2, 1.5 + 0.5 * p.x));
    let corners = |time: f64| -> Vec<DVec3> {
        small.iter().zip(&large).map(|(a, b)| a.lerp(*b, time)).collect()
    };
    // Four corners that go in straight lines stay in a plane here: both shapes have parallel sides.
    let due = ALBEDO / PI * mean_over_time(corners);
    for way in all_ways() {
        let lamp = json!([{ "shape": "rectangle", "width": 1, "height": 1, "material": "lamp" }]);
        let mut scene = scene_in(&way, "direct", json!([]), lamp);
        let geometry = Arc::make_mut(&mut scene.geometry);
        let placement = &mut geometry.placements[1];
        placement.motion = Some(Arc::new(Motion::default()));
        let mesh = &mut geometry.meshes[placement.mesh as usize];
        // The corners of the mesh as the shape has them.
        let own: Vec<usize> = (0..4)
            .map(|i| {
                let at = mesh.positions.get(i);
                let is_there = |p: &DVec3| p.distance(at) < 1e-6;
                rectangle([1.0, 1.0]).iter().position(is_there).unwrap()
            })
            .collect();
        let shape = |of: &[DVec3; 4]| own.iter().map(|&i| of[i].to_array()).collect::<Vec<_>>();
        let steps = [0.0, 1.0].map(|time| {
            let at: [DVec3; 4] = corners(time).try_into().unwrap();
            shape(&at)
        });
        let steps = Steps::new(vec![0.0, 1.0], steps.to_vec(), Vec::new(), &mesh.triangles);
        mesh.steps = Some(Arc::new(steps.unwrap()));
        mesh.normals = None;
        scene.camera = scene.camera.clone().among_moving_things(true);
        holds(lit(&scene), due, &way.to_string());
    }
}

/// On a surface that shines, light that is asked for and light that is met are weighed against each other at the ray's
/// time: the picture is the mean of those of lamps that stand, which are asked otherwise.
#[test]
fn asked_and_met_light_of_moving_lamps_make_one_whole() {
    let lamp = Flying {
        size: [0.8, 0.6],
        from: DVec3::new(-0.7, 2.4, 3.2),
        velocity: DVec3::new(1.4, 0.0, 0.0),
        degrees: 40.0,
    };
    let count = 24;
    let more = |samples: usize| json!({ "/objects/0/material": "metal", "/render": { "samples": samples, "seed": samples } });
    let (mut due, mut squares) = (0.0, 0.0);
    for k in 0..count {
        let time = (f64::from(k) + 0.5) / f64::from(count);
        let mut still = lamp.object();
        still.as_object_mut().unwrap().remove("motion");
        let at = lamp.from + lamp.velocity * time;
        still["transform"] =
            json!({ "translate": at.to_array(), "rotate": [0, 1, 0, lamp.degrees * time] });
        let [mean, error] = lit(&scene(json!([]), json!([still]), &more(32)));
        due += mean / f64::from(count);
        squares += (error / f64::from(count)).powi(2);
    }
    for way in all_ways().step_by(2) {
        let mut more = more(512);
        more["/render"]["accel"] = way["render"]["accel"].clone();
        let [found, error] = lit(&scene(json!([]), json!([lamp.object()]), &more));
        let error = (error * error + squares).sqrt();
        // 24 moments in place of all: the light changes by its whole at most over 1.4 m, and smoothly.
        assert!((found - due).abs() < 4.0 * error + 2e-3 * due, "{way}: {found} ± {error}, {due}");
    }
}

/// A light of no speed is one that stands still: rays have no times, and no bit of the picture is another.
#[test]
fn lights_that_stand_still_change_no_bit() {
    let light = |more: Value| {
        let mut light = json!({ "type": "point", "at": [0.3, 0, 2], "intensity": [3, 3, 3] });
        light.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        scene(json!([light]), json!([]), &json!({}))
    };
    let still = light(json!({}));
    let held = light(json!({ "motion": { "type": "velocity" } }));
    let moving = light(json!({ "motion": { "type": "velocity", "velocity": [1, 0, 0] } }));
    assert!(!still.camera.is_timed() && !held.camera.is_timed() && moving.camera.is_timed());
    let red = |scene: &Scene| layer(&picture(scene), "")[..PIXELS].to_vec();
    assert_eq!(red(&still), red(&held));
    assert_ne!(red(&still), red(&moving));
}
