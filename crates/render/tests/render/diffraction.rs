//! Light spread as waves are: known patterns, no light lost, and what is refused.

use etendue_camera::WaveLens;
use etendue_geometry::glam::DVec3;
use etendue_optics::analysis::spread::WeightedFields;
use etendue_optics::analysis::wavefront::Cells;
use etendue_optics::analysis::{CellGrid, CellSpread, ObjectPoint, Transfer, Wavefront};
use etendue_render::output::Outputs;
use etendue_render::{Plan, Prepared, RenderError, RenderState, Shard};
use etendue_scene::Scene;
use etendue_scene::file::SamplesSpec;
use etendue_sensor::slanted_edge::{Lattice, slanted_edge};
use etendue_spectrum::{Bands, Grid};

use crate::steps::{load, prepare, rendered};

/// The wavelength of a narrow band (nm).
const GREEN: f64 = 550.0;

/// The light of a scene in one narrow band.
fn green(text: &str) -> Vec<f64> {
    green_of(&load(text))
}

fn green_of(scene: &Scene) -> Vec<f64> {
    let mut plan = Plan::new(scene, Outputs::NONE);
    plan.bands = Bands::Spectral(Grid::equal(GREEN - 0.05, GREEN + 0.05, 1).unwrap());
    let done = rendered(scene, &plan);
    let film = done.band_film.unwrap();
    film.values.iter().map(|&value| f64::from(value)).collect()
}

/// J₁ by Bessel's integral, which the trapezoid rule takes without error.
fn j1(x: f64) -> f64 {
    let angle = |k: u32| std::f64::consts::PI * (f64::from(k) + 0.5) / 128.0;
    (0..128).map(|k| (angle(k) - x * angle(k).sin()).cos()).sum::<f64>() / 128.0
}

/// The irradiance of an Airy pattern of power 1 at a distance, in units of λN (G. B. Airy, 1835).
fn airy(r: f64) -> f64 {
    let v = std::f64::consts::PI * r;
    let ring = if v < 1e-6 { 1.0 } else { 2.0 * j1(v) / v };
    std::f64::consts::FRAC_PI_4 * ring * ring
}

const SIDE: usize = 512;

/// A black plane a tenth of a millimetre behind: a cell that shows a bit of a lamp is as far away as it.
const BACKDROP: &str = r#"{"shape": "rectangle", "width": 40, "height": 40, "material": "black",
    "transform": {"translate": [0, 0, -1e-4]}}"#;

/// A lamp of a width in pixels, in the middle of one, before an ideal lens.
fn lamp(pitch: f64, f_number: f64, width: f64, samples: u32) -> String {
    // 50 mm, in focus at 5 m: 100 - 1 times as large there.
    let magnified = (5000.0 - 50.0) / 50.0;
    let pixel = pitch * 1e-6 * magnified;
    let (side, at) = (width * pixel, 0.5 * pixel);
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 1}}, "lights": [],
        "camera": {{"type": "thin_lens", "focal_length": 50, "f_number": {f_number},
            "focus_distance": 5, "pose": {{"from": [0, 0, 5], "look_at": [0, 0, 0]}}, "diffraction": true,
            "sensor": {{"resolution": [{SIDE}, {SIDE}], "pixel_pitch": {pitch}}}}},
        "objects": [{{"shape": "rectangle", "width": {side}, "height": {side}, "material": "lamp",
            "transform": {{"translate": [{at}, {at}, 0]}}}}, {BACKDROP}],
        "materials": {{"black": {{"type": "matte", "color": [0, 0, 0]}}, "lamp": {{"type": "emissive", "radiance": [1, 1, 1]}}}},
        "render": {{"samples": {samples}}}, "plan": {{"light_precision": "double"}}}}"#
    )
}

/// A lamp that fills one cell is a point in its middle, whose image is Airy's pattern: pixels of a cell have its
/// irradiance in their middles, times their area.
#[test]
fn a_lamp_is_the_airy_pattern() {
    let (pitch, f_number) = (3.2, 22.0);
    let picture = green(&lamp(pitch, f_number, 1.0, 16));
    // The image of what is 5 m away is a hundredth farther than the focal length.
    let pixel = pitch / (GREEN * 1e-3 * f_number * 5000.0 / 4950.0);
    let peak = airy(0.0) * pixel * pixel;
    let mut worst = 0.0_f64;
    for row in SIDE / 2 - 40..SIDE / 2 + 40 {
        for column in SIDE / 2 - 40..SIDE / 2 + 40 {
            // Up is towards smaller rows.
            let [x, y] = [column as f64 - (SIDE / 2) as f64, row as f64 - (SIDE / 2 - 1) as f64];
            let expected = airy(pixel * x.hypot(y)) * pixel * pixel;
            worst = worst.max((picture[row * SIDE + column] - expected).abs() / peak);
        }
    }
    // The pupil's rim on cells of its grid.
    assert!(worst < 1e-3, "{worst}");
}

/// All of a lamp's light arrives: the sum is that of the same samples before they are spread.
#[test]
fn no_light_is_lost() {
    for (f_number, pitch, cells) in [(22.0, 3.2, 1), (2.8, 3.45, 3)] {
        let text = lamp(pitch, f_number, 1.0, 36);
        let sum: f64 = green(&text).iter().sum();
        let mut chief = load(&text);
        chief.camera = chief.camera.along_chief_rays(cells);
        chief.render.samples = SamplesSpec::Count(36 / (cells * cells));
        let before: f64 = green_of(&chief).iter().sum::<f64>() / f64::from(cells * cells);
        // What lands beyond the picture's edge is 1e-5 of the light.
        assert!((sum / before - 1.0).abs() < 1e-4, "f/{f_number}: {sum} and {before}");
    }
}

/// The edge of a bright half, turned by 5 degrees, seen through a double Gauss at 1.6 m, in focus at
/// another distance.
fn edge(f_number: f64, pitch: f64, focus: f64) -> String {
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/double-gauss.json");
    let lens = std::fs::read_to_string(lens).unwrap();
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 1}}, "lights": [],
        "camera": {{"type": "lens", "lens": {lens}, "f_number": {f_number}, "diffraction": true,
            "focus_distance": {focus}, "pose": {{"from": [0, 0, 1.6], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": [240, 180], "pixel_pitch": {pitch}}}}},
        "objects": [{{"shape": "rectangle", "width": 1, "height": 4, "material": "lamp",
            "transform": {{"translate": [0.5019, 0.0436, 0], "rotate": [0, 0, 1, 5]}}}}, {BACKDROP}],
        "materials": {{"black": {{"type": "matte", "color": [0, 0, 0]}}, "lamp": {{"type": "emissive", "radiance": [1, 1, 1]}}}},
        "render": {{"samples": 72}}}}"#
    )
}

/// The edge that a camera renders, measured as ISO 12233 does, has the modulation that the lens has by
/// itself: in focus and two waves off, from where aberrations rule to where diffraction does.
#[test]
fn a_rendered_edge_has_the_modulation_of_the_lens() {
    for (f_number, pitch) in [(2.8, 2.4), (8.0, 3.45), (22.0, 6.0)] {
        for waves in [0.0, 2.0] {
            let still = load(&edge(f_number, pitch, 1.6));
            let lens = still.camera.lens().unwrap();
            let focus = 1.0 / (1.0 / 1.6 + waves / lens.waves_of_defocus(GREEN));
            let text = edge(f_number, pitch, focus);
            let scene = load(&text);
            let focused = scene.camera.lens().unwrap().focused();
            let train = focused.train();
            let at = train.at(GREEN).unwrap();
            let place = DVec3::new(0.0, 0.0, focused.origin() - 1600.0);
            let object = ObjectPoint::Near { place };
            let wavefront =
                Wavefront::new(train, &at, object, focused.sensor_z(), Cells::Needed).unwrap();
            let own = Transfer::diffraction(&WeightedFields::one(wavefront.pupil));
            let picture = green(&text);
            // Without the rows and columns beyond which the picture is taken to go on.
            let region: Vec<f64> =
                (10..170).flat_map(|y| picture[y * 240 + 10..][..220].to_vec()).collect();
            let edge = slanted_edge(&region, [220, 160], Lattice::ALL).unwrap();
            let mut worst = 0.0_f64;
            for k in 1..=10 {
                let f = 0.05 * f64::from(k);
                let expected = own.modulation(f / pitch * 1e3)[1];
                let measured = edge.modulation_at(f) / edge.modulation_of_pixels(f);
                println!("f/{f_number} {waves} waves {f:.2}: {measured:.4} {expected:.4}");
                worst = worst.max((measured - expected).abs());
            }
            // A hundredth: cells of a third of a pixel leave half of that at half a cycle a pixel, the rest
            // is samples along the edge and the depth of the grid of fields.
            assert!(worst < 0.01, "f/{f_number}, {waves} waves off: {worst}");
        }
    }
}

/// Light that is alike from all directions falls off towards the corners as it does by rays.
#[test]
fn even_light_falls_off_as_by_rays() {
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/double-gauss.json");
    let lens = std::fs::read_to_string(lens).unwrap();
    let text = |diffraction: bool| {
        format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 1}}, "lights": [],
            "camera": {{"type": "lens", "lens": {lens}, "f_number": 4, "diffraction": {diffraction},
                "focus_distance": 2, "sensor_height": 24, "pose": {{"from": [0, 0, 2], "look_at": [0, 0, 0]}},
                "sensor": {{"resolution": [18, 12]}}}},
            "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "lamp"}}],
            "materials": {{"lamp": {{"type": "emissive", "radiance": [1, 1, 1]}}}},
            "render": {{"samples": 1024}}}}"#
        )
    };
    let blocks = |diffraction: bool| {
        let picture = green(&text(diffraction));
        let block = |k: usize| {
            let [left, top] = [k % 6 * 3, k / 6 * 3];
            let pixel = |i: usize| picture[(top + i / 3) * 18 + left + i % 3];
            (0..9).map(pixel).sum::<f64>() / 9.0
        };
        (0..24).map(block).collect::<Vec<f64>>()
    };
    let [waves, rays] = [true, false].map(blocks);
    let worst = waves.iter().zip(&rays).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // At most 0.5 a sample, of nine pixels of 1024: 0.005, four times.
    assert!(worst < 0.02, "{worst}: {waves:?} {rays:?}");
    assert!(waves[0] < 0.9 * waves[9]);
}

/// The four places that are as far from the middle have spreads that are seen in mirrors of each other, though each
/// is not its own: coma points outwards.
#[test]
fn a_round_lens_spreads_light_as_in_a_mirror_beyond_its_axis() {
    let text = r#"{"etendue": 1, "tracer": {"type": "path", "max_bounces": 1}, "lights": [],
        "camera": {"type": "lens", "diffraction": true, "focus_distance": 1,
            "lens": {"elements": [
                {"type": "surface", "radius": 20, "thickness": 2, "glass": "N-BK7", "semi_diameter": 2, "stop": true},
                {"type": "surface", "radius": -20, "semi_diameter": 3}]},
            "pose": {"from": [0, 0, 1], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [400, 300], "pixel_pitch": 3}},
        "objects": [{"shape": "rectangle", "width": 1, "height": 1, "material": "lamp"}],
        "materials": {"lamp": {"type": "emissive", "radiance": [1, 1, 1]}}, "render": {"samples": 1}}"#;
    let scene = load(text);
    let bands = Bands::Spectral(Grid::equal(GREEN - 0.05, GREEN + 0.05, 1).unwrap());
    let waves = WaveLens::new(scene.camera.lens().unwrap(), &bands).unwrap();
    assert!(waves.is_mirrored([400, 300]) && !waves.is_mirrored([400, 301]));
    let grid = CellGrid { pitch: 3e-3, turn: waves.turn(), most: 200 };
    let spread = |place: [f64; 2]| {
        CellSpread::of(&[waves.fields(place, &[1.0]).unwrap().at(GREEN, 1e-3)], &grid)
    };
    let own = spread([40.0, 30.0]);
    let peak = own.shares.iter().copied().fold(0.0, f64::max);
    let worst = |other: &CellSpread, mirrored: [bool; 2]| {
        assert_eq!(other.half, own.half);
        let side = 2 * own.half + 1;
        let share = |i: usize| own.share([i % side, i / side], mirrored);
        let differences = other.shares.iter().enumerate().map(|(i, v)| (v - share(i)).abs());
        differences.fold(0.0, f64::max) / peak
    };
    for mirrored in [[true, false], [false, true], [true, true]] {
        let at = [0, 1].map(|axis| match mirrored[axis] {
            true => [400.0, 300.0][axis] - [40.0, 30.0][axis],
            false => [40.0, 30.0][axis],
        });
        let other = spread(at);
        // The polynomial of the wavefront is within 2e-3 waves, on each side by itself.
        assert!(worst(&other, mirrored) < 0.01, "{mirrored:?}: {}", worst(&other, mirrored));
        assert!(worst(&other, [false, false]) > 0.05, "{mirrored:?}");
    }
}

fn is_of_diffraction(error: &RenderError, words: &str) -> bool {
    let error = error.to_string();
    error.starts_with("camera.diffraction: ") && error.contains(words)
}

/// A scene that waves cannot be spread over is refused by name.
#[test]
fn what_goes_with_no_diffraction_is_refused() {
    let scene = load(&lamp(3.45, 8.0, 1.0, 4));
    let plan = Plan::new(&scene, Outputs::NONE);
    let (accel, images) = prepare(&scene, &plan);
    let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
    let state = RenderState { shard: Some(Shard::new(1, 2).unwrap()), ..RenderState::default() };
    let error =
        etendue_render::trace(&scene, &plan, prepared, &[], &state, &|_: f64| true).unwrap_err();
    assert!(is_of_diffraction(&error, "--shard"), "{error}");
    let mut adaptive = load(&lamp(3.45, 8.0, 1.0, 4));
    adaptive.render.samples =
        serde_json::from_str(r#"{"relative_error": 0.1, "min": 4, "max": 64}"#).unwrap();
    let plan = Plan::new(&adaptive, Outputs::NONE);
    let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
    let error = etendue_render::trace(
        &adaptive,
        &plan,
        prepared,
        &[],
        &RenderState::default(),
        &|_: f64| true,
    )
    .unwrap_err();
    assert!(is_of_diffraction(&error, "samples"), "{error}");
}
