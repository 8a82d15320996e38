//! Verification of what is taken of a tolerance, against everything: the picture differs by no more
//! than was allowed, and by more where the tolerance is not kept.

use std::path::Path;

use etendue_geometry::Geometry;
#[cfg(feature = "embree")]
use etendue_geometry::HitPrecision;
use etendue_render::expose::SPECTRUM;
use etendue_render::output::Outputs;
use etendue_render::tolerance::lens_models::LensModelKind;
use etendue_render::tolerance::{
    Approximations, TakenBounces, choose, coarser, lens_models, with_meshes,
};
use etendue_render::{BandPaths, Plan, RenderedScene};
#[cfg(feature = "embree")]
use etendue_report::Decision;
use etendue_report::DecisionKind;
use etendue_scene::Scene;
use etendue_scene::file::SamplesSpec;
use serde_json::{Value, json};

use crate::steps::{channels, load_json, prepare, trace};

/// A ball on the ground before the double Gauss.
fn lens_scene(f_number: f64, tolerance: &Value) -> Scene {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let scene = json!({
        "camera": { "type": "lens", "lens": "lenses/double-gauss.json", "f_number": f_number,
            "focus_distance": "2.4 m", "sensor_height": "24 mm", "sensor": { "resolution": [96, 64] },
            "pose": { "from": [0, 0.6, 2.4], "look_at": [0, 0.3, 0] } },
        "tracer": { "type": "path", "max_bounces": 3 }, "tolerance": tolerance,
        "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
        "materials": { "white": { "type": "matte", "color": [0.7, 0.7, 0.7] } },
        "objects": [{ "shape": "sphere", "radius": 0.3, "material": "white",
                "transform": { "translate": [0, 0.3, 0] } },
            { "shape": "rectangle", "width": 12, "height": 12, "material": "white",
              "transform": { "rotate": [1, 0, 0, -90] } }],
        "render": { "samples": 36 },
    });
    load_json(&scenes, scene)
}

/// A closed room of grey walls with a lamp.
fn room(albedo: f64, tolerance: &Value) -> Scene {
    let scene = json!({
        "camera": { "type": "pinhole", "fov": 60, "sensor": { "resolution": [160, 120] },
            "pose": { "from": [1.2, 0.1, 1.1], "look_at": [-1, -0.3, -1] } },
        "tracer": { "type": "path" }, "lights": [],
        "materials": { "grey": { "type": "matte", "color": [albedo, albedo, albedo] },
            "lamp": { "type": "emissive", "radiance": [5, 5, 5] } },
        "objects": [{ "shape": "box", "size": [4, 3, 4], "material": "grey" },
            { "shape": "sphere", "radius": 0.3, "material": "grey", "transform": { "translate": [-0.5, -1, 0] } },
            { "shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
              "transform": { "translate": [0, 1.49, 0], "rotate": [1, 0, 0, 90] } }],
        "render": { "samples": 64 },
    });
    let mut scene = scene;
    if !tolerance.is_null() {
        scene["tolerance"] = tolerance.clone();
    }
    load_json(tempfile::tempdir().unwrap().path(), scene)
}

fn allowed(pixels: &str, light: &str) -> Value {
    json!({ "displacement": pixels, "light": light })
}

fn taken(scene: &Scene) -> Approximations {
    let plan = Plan::new(scene, Outputs::ALL);
    let (accel, images) = prepare(scene, &plan);
    let rendered = RenderedScene { scene, accel: &*accel, images: &images };
    choose(rendered, &plan, None, &|_: f64| true).unwrap().unwrap()
}

/// The light of blocks of 8 × 8 pixels with what is `taken`.
fn blocks(scene: &Scene, taken: Option<Approximations>) -> Vec<f64> {
    let plan = Plan::taking(scene, Outputs::ALL, taken);
    let (accel, images) = prepare(scene, &plan);
    let done = trace(scene, &plan, &*accel, &images);
    let [width, height] = scene.camera.resolution().map(|side| side as usize);
    let columns = width / 8;
    let mut sums = vec![0.0; columns * (height / 8)];
    for channel in channels(&done.picture, "") {
        for (i, value) in channel.iter().enumerate() {
            sums[i / width / 8 * columns + i % width / 8] += value;
        }
    }
    sums
}

/// The difference of light that 99 % of blocks have at most.
fn difference(own: &[f64], all: &[f64]) -> f64 {
    let mut shares: Vec<f64> = own.iter().zip(all).map(|(a, b)| (a - b).abs() / b).collect();
    shares.sort_by(f64::total_cmp);
    shares[shares.len() * 99 / 100 - 1]
}

#[test]
fn a_lens_stopped_down_is_taken_as_opencv_has_it_with_its_falloff() {
    let scene = lens_scene(16.0, &allowed("0.5 px", "2 %"));
    let taken = taken(&scene);
    let camera = taken.camera.as_ref().expect("a simpler camera");
    assert_eq!(camera.finding.model, LensModelKind::Falloff, "{:?}", camera.finding);
    assert!(camera.finding.displacement() <= 0.5 && camera.finding.light.value <= 0.02);
    // Shutter, place and pixels are the scene's.
    assert_eq!(camera.camera.pose(), scene.camera.pose());
    let full = blocks(&scene, None);
    let own = blocks(&scene, Some(taken.clone()));
    // Even blocks hold 2304 samples of a light that varies by its own size at edges alone: noise of less than
    // 1.5 %, which adds to the 2 % by its square. An edge in a block moves by less than 0.1 of its 8 pixels.
    let found = difference(&own, &full);
    assert!(found < 0.025, "{found}");
    // Without the falloff the corners are a fifth too bright, and the same comparison tells it.
    let mut bare = taken.clone();
    let (opencv, _) = lens_models::opencv(&scene.camera, 0.5).unwrap();
    bare.camera.as_mut().unwrap().camera = opencv.camera;
    let found = difference(&blocks(&scene, Some(bare)), &full);
    assert!(found > 0.1, "{found}");
    // The plan has one group of bands and no pupil.
    let plan = Plan::taking(&scene, Outputs::ALL, Some(taken.clone()));
    assert!(!plan.pupil && plan.band_paths == BandPaths::Alike, "{:?}", plan.band_paths);
    let row = plan.decisions.iter().find(|row| row.kind == DecisionKind::Tolerance).unwrap();
    assert!(
        row.reason.contains("`falloff`") && row.value.to_string() == "0.5 px, 2 % of light",
        "{row:?}"
    );
}

#[test]
fn a_lens_wide_open_is_taken_as_it_is_but_for_its_colours() {
    // Blur of half a pixel: of all models, the lens without its dispersion alone has it.
    let own = taken(&lens_scene(2.8, &allowed("0.1 px", "3 %")));
    assert_eq!(own.camera.map(|camera| camera.finding.model), Some(LensModelKind::Undispersed));
}

#[test]
fn what_choosing_measured_of_a_lens_is_what_rendering_would() {
    let scene = lens_scene(2.8, &allowed("0.1 px", "3 %"));
    let mut taken = taken(&scene);
    taken.bounces = None;
    let own = blocks(&scene, Some(taken));
    // To the bit the picture of a lens without dispersion that was never looked at.
    let mut fresh = lens_scene(2.8, &allowed("0.1 px", "3 %"));
    (fresh.tolerance, fresh.plan.dispersion) = (None, Some(false));
    fresh.camera = fresh.camera.without_dispersion();
    assert_eq!(own, blocks(&fresh, None));
}

#[test]
fn light_is_followed_to_as_few_surfaces_as_the_tolerance_allows() {
    for (albedo, percent) in [(0.3, 2.0), (0.6, 5.0)] {
        let scene = room(albedo, &allowed("0.5 px", &format!("{percent} %")));
        let own = taken(&scene);
        let TakenBounces { bounces, share } = own.bounces.expect("fewer bounces");
        // Walls of albedo ρ leave about ρⁿ of the light for paths of more than n surfaces: 2 % and 5 % of it are
        // left after 3.2 and 5.9; half of it, to which the choice is held, after 3.9 and 7.2, of steps up to 2 wide.
        let about = (percent / 100.0_f64).ln() / albedo.ln();
        let beyond = f64::from(bounces) - about;
        assert!(beyond > -1.0 && beyond < 4.5, "{bounces} for {about}");
        assert!(share <= percent / 100.0);
        let full = blocks(&scene, None);
        let with = |bounces| {
            let taken =
                Approximations { bounces: Some(TakenBounces { bounces, share }), ..own.clone() };
            difference(&blocks(&scene, Some(taken)), &full)
        };
        let found = with(bounces);
        assert!(found <= percent / 100.0, "{found} of {bounces} bounces");
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        let fewer = about.ceil() as u32 - 2;
        let less = with(fewer);
        assert!(less > percent / 100.0, "{less} of {fewer} bounces");
    }
}

#[test]
fn nothing_is_taken_without_a_tolerance_or_where_looking_does_not_pay() {
    let mut scene = room(0.5, &Value::Null);
    assert!(scene.tolerance.is_none());
    let plan = Plan::new(&scene, Outputs::ALL);
    let (accel, images) = prepare(&scene, &plan);
    let rendered = RenderedScene { scene: &scene, accel: &*accel, images: &images };
    let found = choose(rendered, &plan, None, &|_: f64| true).unwrap();
    assert!(found.is_none() && plan.taken.is_none());
    // Numbers are pixels and shares; a picture of few samples is rendered sooner than looked at.
    scene = room(0.5, &json!({ "displacement": 1, "light": 0.02 }));
    assert_eq!(scene.tolerance.map(|it| (it.displacement.0, it.light.0)), Some((1.0, 0.02)));
    scene.render.samples = SamplesSpec::Count(1);
    let few = taken(&scene);
    assert!(few.bounces.is_none() && few.notes[0].contains("too few"), "{few:?}");
}

/// A ball of many triangles, 17 pixels wide, lit by the sun from one side.
fn fine_ball(tolerance: &Value, changes: &[(&str, Value)]) -> Scene {
    let mut scene = json!({
        "camera": { "type": "pinhole", "fov": 40, "sensor": { "resolution": [72, 48] },
            "pose": { "from": [0, 0, 2.4], "look_at": [0, 0, 0] } },
        "tracer": { "type": "path", "max_bounces": 3 },
        "lights": [{ "type": "directional", "direction": [-1, -1, -1], "irradiance": [3, 3, 3] },
            { "type": "environment", "radiance": [0.3, 0.3, 0.3] }],
        "materials": { "white": { "type": "matte", "color": [0.7, 0.7, 0.7] } },
        "objects": [{ "shape": "sphere", "radius": 0.3, "triangles": 600_000, "material": "white" }],
        "render": { "samples": 16 },
    });
    if !tolerance.is_null() {
        scene["tolerance"] = tolerance.clone();
    }
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match scene.pointer_mut(parent).unwrap() {
            Value::Array(list) => list.push(value.clone()),
            parent => parent[key] = value.clone(),
        }
    }
    load_json(tempfile::tempdir().unwrap().path(), scene)
}

#[test]
fn meshes_have_the_detail_that_the_nearest_view_tells() {
    let scene = fine_ball(&allowed("0.5 px", "2 %"), &[]);
    let (geometry, detail) = coarser(&scene).expect("a coarser ball");
    assert!(detail.triangles[1] < detail.triangles[0] / 4, "{detail:?}");
    assert!(detail.displacement <= 0.5 && detail.light <= 0.01, "{detail:?}");
    let full = blocks(&scene, None);
    let lit = |own: Vec<f64>| -> (Vec<f64>, Vec<f64>) {
        own.into_iter().zip(full.iter().copied()).filter(|(_, full)| *full > 0.0).unzip()
    };
    let (own, all) = lit(blocks(&with_meshes(&scene, geometry), None));
    // The samples are the same; edges move by less than half a pixel.
    let found = difference(&own, &all);
    assert!(found < 0.02, "{found}");
    // Cells of several pixels change the area by more than half of 2 %, and where that is allowed the same comparison
    // tells it.
    let wide = |light: &str| coarser(&fine_ball(&allowed("10 px", light), &[]));
    assert!(wide("2 %").is_none());
    let (geometry, detail) = wide("60 %").expect("a coarser ball");
    assert!(detail.light > 0.01, "{detail:?}");
    let (own, all) = lit(blocks(&with_meshes(&scene, geometry), None));
    let found = difference(&own, &all);
    assert!(found > 0.02, "{found}");
}

#[test]
#[cfg(feature = "embree")]
fn triangles_finer_than_the_tolerance_tells_apart_do_not_ask_for_f64() {
    // A ball whose edges are of a millimetre, on a ground so large that f32 misplaces rays by a quarter of that.
    let ground = json!({ "shape": "box", "size": [120, 1, 120], "material": "white",
        "transform": { "translate": [0, -1, 0] } });
    let planned = |tolerance: &Value, more: &[(&str, Value)]| {
        let scene = fine_ball(tolerance, &[&[("/objects/1", ground.clone())], more].concat());
        let plan = Plan::taking(&scene, Outputs::ALL, None);
        let is_of_light = |row: &&Decision| row.kind == DecisionKind::LightPaths;
        let why = plan.decisions.iter().find(is_of_light).unwrap().reason.clone();
        (plan.light_precision, why)
    };
    let tolerance = allowed("4 px", "2 %");
    let (precision, why) = planned(&tolerance, &[]);
    assert_eq!(precision, HitPrecision::Single, "{why}");
    assert!(why.contains("that the tolerance hides"), "{why}");
    let point_light = json!({ "type": "point", "at": [0, 1, 0], "intensity": [1, 1, 1] });
    for (what, (precision, why)) in [
        ("no tolerance", planned(&Value::Null, &[])),
        ("a narrow one", planned(&allowed("0.04 px", "2 %"), &[])),
        ("a lamp nearby throws large shadows", planned(&tolerance, &[("/lights/2", point_light)])),
    ] {
        assert_eq!(precision, HitPrecision::Double, "{what}: {why}");
        assert!(why.contains("too much for triangles"), "{what}: {why}");
    }
    // The samples are the same, and so is the light.
    let light = |precision: &str| {
        let asked = json!({ "light_precision": precision });
        let changes = [("/objects/1", ground.clone()), ("/plan", asked)];
        blocks(&fine_ball(&tolerance, &changes), None)
    };
    let found = difference(&light("auto"), &light("double"));
    assert!(found > 0.0 && found < 0.02, "{found}");
}

/// The ball has a copy 9.6 m behind: as wide as 3 pixels, and as coarse as its distance asks for,
/// unless its shadow falls near the camera.
#[test]
fn copies_have_the_detail_of_their_own_distance() {
    let copies = || ("/objects/0/instances", json!([{}, { "translate": [0, 0, -9.6] }]));
    let tolerance = allowed("0.5 px", "2 %");
    let triangles = |geometry: &Geometry, copy: usize| {
        geometry.mesh_of(&geometry.placements[copy]).triangles.len()
    };
    let alone = coarser(&fine_ball(&tolerance, &[])).expect("a coarser ball").0;
    let near = triangles(&alone, 0);
    let scene = fine_ball(&tolerance, &[copies()]);
    let (geometry, detail) = coarser(&scene).expect("coarser balls");
    assert_eq!(triangles(&geometry, 0), near);
    // Cells four times as wide.
    assert!(triangles(&geometry, 1) < near / 10, "{} {near}", triangles(&geometry, 1));
    assert_eq!((detail.meshes, geometry.meshes.len()), (1, 2));
    // As placed: the nearest copy alone may need all, and versions for the others stand beside it.
    assert_eq!(detail.triangles, [scene.geometry.triangles(), geometry.triangles()]);
    let all = blocks(&scene, None);
    let own = blocks(&with_meshes(&scene, geometry), None);
    let lit: (Vec<f64>, Vec<f64>) =
        own.into_iter().zip(all).filter(|(_, full)| *full > 0.0).unzip();
    let found = difference(&lit.0, &lit.1);
    assert!(found < 0.02, "{found}");
    // The sun shines from behind, at the camera; or what shines is an image, which may have a sun.
    let sun = |direction: [f64; 3]| json!({ "type": "directional", "direction": direction, "irradiance": [3, 3, 3] });
    let others = [("/lights/0", sun([0.0, 0.0, 1.0])), ("/lights", Value::Null)];
    for light in others {
        let scene = fine_ball(&tolerance, &[copies(), light.clone()]);
        let (geometry, _) = coarser(&scene).expect("coarser balls");
        assert_eq!([0, 1].map(|copy| triangles(&geometry, copy)), [near; 2], "{light:?}");
        assert_eq!(geometry.meshes.len(), 1);
    }
    // Far from all others, and of one copy: the mesh itself is as coarse.
    let objects = json!({ "shape": "box", "size": [0.1, 0.1, 0.1], "material": "white", "transform": { "translate": [0.5, 0, 0] } });
    let place = ("/objects/0/transform", json!({ "translate": [0, 0, -9.6] }));
    let scene = fine_ball(&tolerance, &[place, ("/objects/1", objects)]);
    let (geometry, _) = coarser(&scene).expect("a coarser ball");
    assert!(triangles(&geometry, 0) < near / 10 && geometry.meshes.len() == 2);
}

#[test]
fn meshes_stay_as_they_are_where_something_could_show_more_of_them() {
    let tolerance = allowed("0.5 px", "2 %");
    assert!(coarser(&fine_ball(&tolerance, &[])).is_some());
    let mirror = json!({ "type": "mirror" });
    let ball = |more: Value| {
        let mut ball =
            json!({ "shape": "sphere", "radius": 0.2, "transform": { "translate": [0.6, 0, -1] } });
        ball.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        ball
    };
    let cases = [
        // Data are exact.
        ("depth", vec![("/layers", json!(["depth"]))]),
        ("alpha", vec![("/render/alpha", json!(true))]),
        // A mirror may enlarge, and a lamp nearby throws large shadows.
        (
            "mirror",
            vec![
                ("/materials/mirror", mirror),
                ("/objects/1", ball(json!({ "material": "mirror" }))),
            ],
        ),
        (
            "point",
            vec![(
                "/lights/2",
                json!({ "type": "point", "at": [0, 1, 0], "intensity": [1, 1, 1] }),
            )],
        ),
        (
            "emissive",
            vec![
                ("/materials/lamp", json!({ "type": "emissive", "radiance": [1, 1, 1] })),
                ("/objects/1", ball(json!({ "material": "lamp" }))),
            ],
        ),
        // The camera stands within the box of a thing.
        (
            "within",
            vec![("/objects/1", json!({ "shape": "box", "size": [9, 9, 9], "material": "white" }))],
        ),
        // The ball is patterned, or moves.
        ("checker", vec![("/materials/white", json!({ "type": "checker", "squares": 4 }))]),
    ];
    for (what, changes) in cases {
        assert!(coarser(&fine_ball(&tolerance, &changes)).is_none(), "{what}");
    }
    assert!(coarser(&room(0.5, &Value::Null)).is_none());
}

/// A shining ball near a corner, in twelve bands, before a lens of crown glass whose stop stands in front of it: its
/// colours lie more than a pixel apart there. The scene is traced for each band.
fn parted_colours(pixels: &str) -> Scene {
    let scene = json!({
        "camera": { "type": "chromatic_real_lens", "glass": "N-BK7", "front_radius": 50, "rear_radius": -50,
            "thickness": 6, "semi_diameter": 16, "sensor_distance": 48,
            "elements": [{ "type": "aperture", "shape": "circular", "radius": 0.6, "at": -40, "stop": true }],
            "sensor": { "type": "multispectral", "resolution": [96, 64], "pixel_pitch": 100,
                "bands": { "from": 400, "to": 700, "count": 12 } },
            "pose": { "from": [0, 0, 0], "look_at": [0, 0, -1] } },
        "tracer": { "type": "path", "max_bounces": 3 }, "lights": [],
        "tolerance": allowed(pixels, "10 %"), "plan": { "shared_paths": false },
        "materials": { "lamp": { "type": "emissive", "radiance": [1, 1, 1] } },
        "objects": [{ "shape": "sphere", "radius": 0.04, "material": "lamp",
            "transform": { "translate": [0.17, 0.11, -2.2] } }],
        "render": { "samples": 64 },
    });
    load_json(tempfile::tempdir().unwrap().path(), scene)
}

/// Middles of the light of the bands (pixels).
fn middles(scene: &Scene, taken: Option<Approximations>) -> Vec<[f64; 2]> {
    let plan = Plan::taking(scene, Outputs::ALL, taken);
    let (accel, images) = prepare(scene, &plan);
    let done = trace(scene, &plan, &*accel, &images);
    let width = scene.camera.resolution()[0] as usize;
    let middle = |band: Vec<f64>| {
        let mut sums = [0.0; 3];
        for (i, light) in band.iter().enumerate() {
            let at = [1.0, (i % width) as f64, (i / width) as f64];
            sums.iter_mut().zip(at).for_each(|(sum, at)| *sum += light * at);
        }
        [sums[1] / sums[0], sums[2] / sums[0]]
    };
    channels(&done.picture, SPECTRUM).into_iter().map(middle).collect()
}

#[test]
fn bands_run_together_in_as_few_groups_as_the_tolerance_allows() {
    let scene = parted_colours("0.3 px");
    let taken = taken(&scene);
    let camera = taken.camera.clone().expect("bands in groups");
    assert_eq!(camera.finding.model, LensModelKind::Grouped, "{:?}", camera.finding);
    assert!(camera.finding.displacement() <= 0.3, "{:?}", camera.finding);
    let plan = Plan::taking(&scene, Outputs::ALL, Some(taken.clone()));
    let groups = camera.camera.band_groups(&plan.bands).len();
    assert!((2..=6).contains(&groups), "{groups}");
    let row = plan.decisions.iter().find(|row| row.kind == DecisionKind::Tolerance).unwrap();
    assert!(row.reason.contains(&format!("`grouped` in {groups} groups of 12 bands")), "{row:?}");
    // A third to a half of the rays of all bands.
    assert!(plan.rays * 2 <= Plan::new(&scene, Outputs::ALL).rays, "{}", plan.rays);
    let full = middles(&scene, None);
    assert_eq!(full.len(), 12);
    let farthest = |taken: Approximations| {
        let own = middles(&scene, Some(taken));
        let off = own.iter().zip(&full).map(|(a, b)| f64::hypot(a[0] - b[0], a[1] - b[1]));
        off.fold(0.0, f64::max)
    };
    // The middle of a disk of some hundred pixels with 64 samples each is known to a hundredth.
    let found = farthest(taken.clone());
    assert!(found <= 0.32 && found > 0.02, "{found}");
    // All in one group displaces the outer bands by more, and the same comparison tells it.
    let mut one = taken.clone();
    one.camera.as_mut().unwrap().camera = scene.camera.with_bands_grouped(1).unwrap();
    let found = farthest(one);
    assert!(found > 0.4, "{found}");
    // Bands that share the paths of the scene have nothing to save.
    let mut shared = parted_colours("0.3 px");
    shared.plan.shared_paths = None;
    let own = self::taken(&shared);
    assert!(own.camera.is_none(), "{:?}", own.camera);
}
