//! Light in blocks of rays against light in batches: the same paths by two ways, whose random numbers are the same.

mod bands;
mod shining;

use std::path::Path;
use std::sync::Arc;

use etendue_accel::{Accel, Build, BuildOptions, BuildReport, Bvh, build_moving};
use etendue_geometry::{HitBatch, RayBatch};
use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_scene::Scene;
use etendue_spectrum::{Bands, Grid};
use etendue_tracer::material::NormalMap;
use etendue_tracer::texture::Encoding;
use etendue_tracer::{Scattering, TextureUse};

use crate::curves::npy;
use crate::steps::{channels, load_in, prepare, trace};

/// A structure that traces batches alone.
#[derive(Debug)]
struct Batches<'a>(&'a dyn Accel);

impl Accel for Batches<'_> {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        self.0.closest(rays, hits);
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        self.0.occluded(rays, blocked);
    }

    fn report(&self) -> BuildReport {
        self.0.report()
    }
}

/// A room with a lamp, boxes and a ball, by what is put into it.
fn room(tracer: &str, lights: &str, more: &str, ball: &str) -> String {
    room_of(["red", "green"], [tracer, lights, more, ball])
}

/// The same by the materials of box and ball.
fn room_of([of_box, of_ball]: [&str; 2], [tracer, lights, more, ball]: [&str; 4]) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {tracer}, "lights": [{lights}],
        "layers": ["direct", "indirect"],
        "camera": {{"type": "pinhole", "fov": 40,
            "pose": {{"from": [0.1, 1, 3.4], "look_at": [0, 0.9, 0]}},
            "sensor": {{"resolution": [48, 48]}}}},
        "objects": [
            {{"shape": "rectangle", "width": 4, "height": 4, "material": "floor",
                "transform": {{"rotate": [1, 0, 0, -90]}}}},
            {{"shape": "box", "material": "{of_box}", "transform": {{"translate": [-0.5, 0.32, 0], "scale": 0.6}}}},
            {{"shape": "{ball}", "material": "{of_ball}",
                "transform": {{"translate": [0.6, 0.5, 0.2], "scale": 0.5}}}}
            {more}],
        "materials": {{
            "floor": {{"type": "checker", "colors": [[0.8, 0.8, 0.7], [0.2, 0.3, 0.4]], "squares": 8}},
            "red": {{"type": "matte", "color": [0.7, 0.1, 0.1]}},
            "green": {{"type": "matte", "color": [0.1, 0.5, 0.2]}},
            "gold": {{"type": "metal", "color": [0.9, 0.7, 0.3], "roughness": 0.35}},
            "burnished": {{"type": "metal", "color": [0.9, 0.7, 0.3], "roughness": 1e-11}},
            "polished": {{"type": "metal", "metal": "copper", "roughness": 0}},
            "copper": {{"type": "metal", "metal": "copper", "roughness": 0.3}},
            "mirror": {{"type": "mirror"}},
            "glass": {{"type": "dielectric", "ior": 1.5}},
            "frosted": {{"type": "dielectric", "ior": 1.5, "roughness": 0.4}},
            "plastic": {{"type": "gltf", "color": [0.2, 0.4, 0.8], "metallic": 0.3, "roughness": 0.4}},
            "smooth": {{"type": "gltf", "color": [0.2, 0.4, 0.8], "roughness": 0}},
            "coated": {{"type": "gltf", "color": [0.8, 0.4, 0.1], "clearcoat": 0.8, "clearcoat_roughness": 0.1,
                "sheen": [0.3, 0.3, 0.5]}},
            "brushed": {{"type": "gltf", "color": [0.9, 0.8, 0.7], "metallic": 1, "anisotropy": 0.6}},
            "printed": {{"type": "gltf", "color": {{"image": "waves.png"}}, "metallic": 0.2}},
            "veil": {{"type": "gltf", "color": [0.3, 0.8, 0.5], "opacity": 0.4}},
            "pane": {{"type": "gltf", "color": [0.5, 0.9, 0.8], "roughness": 0, "transmission": 0.9}},
            "amber": {{"type": "dielectric", "ior": 1.55,
                "absorption": {{"color": [0.9, 0.5, 0.1], "distance": 0.3}}}},
            "water": {{"type": "dielectric", "ior": 1.33}},
            "flint": {{"type": "dielectric", "ior": "N-SF11"}},
            "etched": {{"type": "dielectric", "ior": "N-SF11", "roughness": 0.3}},
            "tiles": {{"type": "emissive", "radiance": {{"checker": [[9, 8, 6], [1, 2, 5]], "squares": 3}}}},
            "screen": {{"type": "emissive", "two_sided": true,
                "radiance": {{"image": "waves.png", "factor": [3, 5, 4], "repeat": [2, 3]}}}},
            "lamp": {{"type": "emissive", "radiance": [9, 8, 6]}}}},
        "render": {{"samples": 16}}, "plan": {{"light_precision": "single"}}}}"#
    )
}

const LAMP: &str = r#", {"shape": "rectangle", "material": "lamp", "width": 0.6, "height": 0.6,
    "transform": {"rotate": [1, 0, 0, 90], "translate": [0.2, 2.2, 0.3]}}"#;

/// Water within the ball, and a veil before it.
const DROP: &str = r#", {"shape": "blob", "triangles": 800, "material": "water",
    "transform": {"translate": [0.6, 0.5, 0.2], "scale": 0.25}},
    {"shape": "rectangle", "material": "veil", "width": 0.7, "height": 0.7,
    "transform": {"translate": [0.4, 0.6, 0.9]}}"#;

const POINTS: &str = r#"{"type": "point", "at": [1, 2, 1], "intensity": [1, 2, 3]},
    {"type": "directional", "direction": [0.2, -1, -0.3], "irradiance": [0.5, 0.5, 0.5]},
    {"type": "spot", "at": [-1, 2, 1], "look_at": [0, 0, 0], "cone": 50, "intensity": [2, 2, 1]}"#;

/// A box stands on squares, a sphere on a floor that is alike all over.
fn on_floor(ball: &str, room: String) -> String {
    let squares =
        r#"{"type": "checker", "colors": [[0.8, 0.8, 0.7], [0.2, 0.3, 0.4]], "squares": 8}"#;
    match ball {
        "box" => room,
        _ => room.replace(squares, r#"{"type": "matte", "color": [0.8, 0.8, 0.7]}"#),
    }
}

/// Red, green, blue and alpha that change across: as a colour, as roughness and metal, and as a normal.
fn save_waves(folder: &Path, least: u8) {
    let wave = |x: u32, step: u32| u8::try_from(x * step % 256).unwrap();
    let texels = image::RgbImage::from_fn(32, 32, |x, y| {
        // Where green is 0 the surface is smooth.
        let green = if (x / 4 + y / 4) % 5 == 0 { least } else { 60 + wave(y, 5) / 2 };
        image::Rgb([110 + wave(x, 8) / 8, green, 150 + wave(x + y, 3) / 3])
    });
    texels.save(folder.join("waves.png")).unwrap();
}

/// The bands of the cube (nm).
const BANDS: &str = r#""bands": [400, 450, 500, 550, 600, 650, 700]"#;

/// Light by wavelength from all around, of which no two directions have the same spectrum.
fn save_cube(folder: &Path) {
    let value = |k: u16| f32::from(k * 37 % 101) / 50.0 + if k == 61 { 40.0 } else { 0.1 };
    let values: Vec<f32> = (0..8 * 16 * 6).map(value).collect();
    std::fs::write(folder.join("around.npy"), npy([8, 16, 6], &values)).unwrap();
}

/// Gives the printed surface roughness, metal and a normal by its image, which scene files cannot name.
fn print(scene: &mut Scene) {
    let printed = scene.materials.iter_mut().find(|material| material.name == "printed").unwrap();
    let image = printed.base_color.image().unwrap();
    let data = TextureUse { encoding: Encoding::Linear, ..image.clone() };
    printed.normal_map = Some(NormalMap { image: data.clone(), scale: 0.4 });
    let Scattering::Gltf(surface) = &mut printed.scattering else { panic!("a glTF surface") };
    surface.metallic_roughness = Some(data);
}

/// The picture, and its parts.
const LAYERS: [&str; 3] = ["", "Direct", "Indirect"];

/// That `layers` of the scene are the same by both ways, where there are two; how many structures have both.
fn compare(name: &str, scene: &Scene, plan: &Plan, layers: &[&str]) -> usize {
    let (accel, images) = prepare(scene, plan);
    let exposure = scene.camera.exposure_span();
    let options = BuildOptions { exposure, ..BuildOptions::default() };
    let bvh: Build<'_> = &|geometry, options| Ok(Box::new(Bvh::build(geometry, options)?));
    let bvh = build_moving(Arc::clone(&scene.geometry), &options, bvh).unwrap();
    let structures: [&dyn Accel; 2] = [&*accel, &*bvh];
    let mut compared = 0;
    for accel in structures {
        let name = format!("{name}, {}", accel.report().backend);
        if accel.blocks().is_none() {
            continue;
        }
        compared += 1;
        let blocks = trace(scene, plan, accel, &images);
        let batches = trace(scene, plan, &Batches(accel), &images);
        for &layer in layers {
            let [own, other] =
                [&blocks, &batches].map(|done| channels(&done.picture, layer).concat());
            let total: f64 = other.iter().sum();
            assert!(layer == "Indirect" || total > 0.0, "{name}: {layer} is dark");
            let apart = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-4 * (1e-3 + b.abs());
            let differ = own.iter().zip(&other).filter(|&pair| apart(pair)).count();
            // Hits within f32's rounding of an edge or of a shadow's: one sample in some thousands.
            assert!(differ * 50 <= own.len(), "{name}: {differ} of {} in {layer:?}", own.len());
            let sum: f64 = own.iter().sum();
            // One of those may come upon a light and bring as much as five thousandths of all.
            assert!((sum - total).abs() <= 6e-3 * total.abs(), "{name}: {sum} {total}");
        }
        let rays = [&blocks, &batches].map(|done| done.light.rays as f64);
        assert!((rays[0] / rays[1] - 1.0).abs() < 1e-3, "{name}: {rays:?}");
    }
    compared
}

/// That `layers` of a plain scene are the same by both ways: in red, green and blue, in five bands, and in one.
fn compare_plain(name: &str, scene: &Scene, layers: &[&str]) {
    let grid = Bands::Spectral(Grid::of_width(400.0, 700.0, 60.0).unwrap());
    for bands in [Bands::Rgb, grid, Bands::Grey] {
        let mut plan = Plan::new(scene, Outputs::from_list("exr").unwrap());
        plan.bands = bands;
        let name = format!("{name}, {} bands", plan.bands.count());
        assert!(compare(&name, scene, &plan, layers) > 0, "{name}");
    }
}

#[test]
fn blocks_and_batches_follow_the_same_paths() {
    let path = r#"{"type": "path", "max_bounces": 7}"#;
    let direct = r#"{"type": "direct"}"#;
    let whitted = r#"{"type": "whitted", "max_bounces": 4}"#;
    let sky = r#"{"type": "environment", "radiance": [0.6, 0.7, 0.9]}"#;
    let both = format!("{sky}, {POINTS}");
    let all = |materials, tracer| room_of(materials, [tracer, &both, LAMP, "sphere"]);
    let scenes = [
        ("lamp, path", room(path, "", LAMP, "sphere")),
        ("lamp, direct", room(direct, "", LAMP, "box")),
        ("points", room(path, POINTS, "", "sphere")),
        ("sky", room(path, sky, "", "sphere")),
        ("sky, direct", room(direct, sky, "", "box")),
        ("all", room(path, &both, LAMP, "sphere")),
        ("metals", all(["copper", "gold"], path)),
        ("metals, direct", all(["polished", "gold"], direct)),
        ("mirrors", all(["mirror", "polished"], path)),
        ("mirrors, whitted", all(["mirror", "mirror"], whitted)),
        ("points and a mirror", room_of(["red", "mirror"], [direct, POINTS, "", "sphere"])),
        ("glass", all(["red", "glass"], path)),
        ("glass, whitted", all(["plastic", "glass"], whitted)),
        ("frosted glass", all(["frosted", "mirror"], path)),
        ("glTF", all(["smooth", "plastic"], path)),
        ("glTF, points", room_of(["coated", "plastic"], [path, POINTS, "", "sphere"])),
        ("coats", all(["coated", "brushed"], path)),
        ("veils", all(["veil", "veil"], path)),
        ("veils, points", room_of(["veil", "red"], [direct, POINTS, "", "sphere"])),
        ("panes", all(["pane", "veil"], path)),
        ("amber", all(["amber", "amber"], path)),
        ("amber, whitted", all(["red", "amber"], whitted)),
        ("a drop in amber", room_of(["veil", "amber"], [path, &both, DROP, "sphere"])),
        ("flint", all(["red", "flint"], path)),
        ("etched flint", all(["veil", "etched"], path)),
        ("flint in amber", room_of(["flint", "amber"], [path, sky, DROP, "sphere"])),
        ("textures", all(["printed", "printed"], path)),
        ("textures, direct", all(["mirror", "printed"], direct)),
    ];
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 0);
    for (name, text) in scenes {
        let mut scene = load_in(folder.path(), &text);
        if text.matches(r#""printed""#).count() > 1 {
            print(&mut scene);
        }
        let mut plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
        assert!(compare(name, &scene, &plan, &LAYERS) > 0, "{name} is traced in batches alone");
        if name == "metals" || name == "flint" || name == "flint in amber" {
            plan.bands = Bands::Spectral(Grid::of_width(400.0, 700.0, 60.0).unwrap());
            compare(&format!("{name} in bands"), &scene, &plan, &LAYERS);
        }
    }
}

/// Matte surfaces of one colour under lamps are worked on in single precision as a whole, by blocks alone.
#[test]
fn plain_scenes_are_the_same_in_single_precision() {
    // Where more than an eighth of the triangles shine last directions ask the whole scene: boxes keep two lamps below.
    const ANOTHER: &str = r#", {"shape": "rectangle", "material": "sign", "width": 0.4, "height": 0.8,
        "transform": {"rotate": [0, 1, 0, 40], "translate": [-1.2, 1.1, 0.4]}},
        {"shape": "box", "material": "red", "transform": {"scale": 0.2, "translate": [1.2, 0.2, 0.8]}},
        {"shape": "box", "material": "green", "transform": {"scale": 0.3, "translate": [-0.9, 0.3, 1]}}"#;
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 0);
    let two = format!("{LAMP}{ANOTHER}");
    let path = |bounces: u32| format!(r#"{{"type": "path", "max_bounces": {bounces}}}"#);
    let direct = r#"{"type": "direct"}"#.to_owned();
    let points = r#"{"type": "point", "at": [1, 2, 1], "intensity": [1, 2, 3]},
        {"type": "point", "at": [-1.2, 0.3, 1.4], "intensity": [0.5, 0.4, 0.1]}"#;
    // More than eight are chosen by where the point is: a box of twelve triangles, and a blob of hundreds, beside which
    // the room is too large for the loop over all triangles.
    let sign = |shape: &str| {
        format!(
            r#", {{"shape": "{shape}, "material": "sign",
                "transform": {{"scale": 0.2, "translate": [-0.4, 1.3, 0.6]}}}}"#
        )
    };
    let (boxes, blob) = (sign(r#"box""#), sign(r#"blob", "triangles": 300"#));
    let many = format!("{LAMP}{boxes}");
    let hung = |k: u32| {
        let (x, z) = (f64::from(k % 5) * 0.6 - 1.2, f64::from(k / 5) * 0.7 - 0.9);
        format!(
            r#"{{"type": "point", "at": [{x}, {}, {z}], "intensity": [0.3, 0.2, 0.2]}}"#,
            0.8 + 0.1 * z
        )
    };
    let many_points = &*(0..20).map(hung).collect::<Vec<_>>().join(", ");
    for (name, tracer, lights, lamps) in [
        ("direct", &direct, "", LAMP),
        ("direct, many points", &direct, many_points, ""),
        ("direct, many lamps", &direct, "", &many),
        ("four, many of both", &path(4), many_points, &many),
        ("two, a sign", &path(2), "", &boxes),
        ("two, a blob", &path(2), many_points, &blob),
        ("direct, two lamps", &direct, "", &two),
        ("direct, points", &direct, points, ""),
        ("one bounce", &path(1), "", LAMP),
        // Light is scattered about the normals of its corners.
        ("direct, a sphere", &direct, "", LAMP),
        ("four, points and a sphere", &path(4), points, LAMP),
        ("two, a tiny scale of a huge sphere", &path(2), points, LAMP),
        ("three", &path(3), "", &two),
        ("three, points", &path(3), points, ""),
        // Dim paths end by chance.
        ("twelve", &path(12), points, &two),
    ] {
        // Boxes share a mesh, of which a structure for many triangles has instances.
        let ball = match () {
            () if lamps == blob => r#"blob", "triangles": 200, "name": "ball"#,
            () if name.ends_with("huge sphere") => r#"sphere", "radius": 1e15, "name": "ball"#,
            () if name.ends_with("sphere") => "sphere",
            () => "box",
        };
        let scale = if ball.contains("1e15") { "5e-16" } else { "0.5" };
        let text = room(tracer, lights, lamps, ball)
            .replace(r#""translate": [0.6, 0.5, 0.2], "scale": 0.5"#, &format!(r#""translate": [0.6, 0.5, 0.2], "scale": {scale}"#))
            .replace(r#""layers": ["direct", "indirect"],"#, "")
            .replace(
                r#"{"type": "checker", "colors": [[0.8, 0.8, 0.7], [0.2, 0.3, 0.4]], "squares": 8}"#,
                r#"{"type": "matte", "color": [0.8, 0.8, 0.7]},
                "sign": {"type": "emissive", "radiance": [0.5, 2, 4], "two_sided": true}"#,
            );
        let scene = load_in(folder.path(), &text);
        compare_plain(&format!("plain, {name}"), &scene, &[""]);
    }
}

/// So are facets, mirrors, smooth glass and what is printed on surfaces, under skies and lights of all kinds.
#[test]
fn plain_facets_skies_and_other_lights_are_the_same_in_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = |bounces: u32| format!(r#"{{"type": "path", "max_bounces": {bounces}}}"#);
    let whitted = |bounces: u32| format!(r#"{{"type": "whitted", "max_bounces": {bounces}}}"#);
    let direct = r#"{"type": "direct"}"#.to_owned();
    let sky = r#"{"type": "environment", "radiance": [0.6, 0.7, 0.9]}"#;
    let unseen = r#"{"type": "environment", "radiance": [0.6, 0.7, 0.9], "visible": false}"#;
    let image = r#"{"type": "environment", "image": "waves.png", "radiance": [2, 1, 0.5],
        "rotate": 40}"#;
    let sun = r#"{"type": "directional", "direction": [0.2, -1, -0.3], "irradiance": [0.5, 0.5, 0.5],
        "angle": 4}"#;
    let sunny = format!("{image}, {sun}");
    let clear =
        r#"{"type": "sky", "turbidity": 3, "sun": {"elevation": 35, "azimuth": 70}, "scale": 9}"#;
    let clouded = r#"{"type": "sky", "turbidity": 5, "ground_albedo": 0.4, "scale": 9,
        "sun": {"elevation": 20, "azimuth": 200, "shines": false}}"#;
    let cube = format!(
        r#"{{"type": "environment", "image": {{"cube": "around.npy", {BANDS}}}, "rotate": 25}}"#
    );
    save_cube(folder.path());
    let all = format!("{POINTS}, {image}");
    for (name, materials, tracer, lights, lamps) in [
        ("a sky", ["red", "green"], path(4), sky, ""),
        ("a sky that is not seen", ["red", "gold"], path(4), unseen, ""),
        ("an image", ["red", "green"], path(4), image, ""),
        ("an image, direct", ["gold", "plastic"], direct.clone(), image, ""),
        ("an image and a sun", ["gold", "plastic"], path(4), &sunny, ""),
        ("a clear sky", ["gold", "green"], path(4), clear, ""),
        ("a clear sky and a lamp", ["red", "glass"], path(4), clear, LAMP),
        ("a clear sky, direct", ["mirror", "coated"], direct.clone(), clouded, ""),
        ("a cube", ["gold", "glass"], path(5), &cube, ""),
        ("a cube and a lamp", ["coated", "green"], direct.clone(), &cube, LAMP),
        ("an image and a lamp", ["copper", "plastic"], path(4), image, LAMP),
        ("all lights", ["copper", "plastic"], path(5), &all, LAMP),
        // Denser than single precision holds.
        (
            "an image and facets that are hardly rough",
            ["burnished", "plastic"],
            path(3),
            image,
            LAMP,
        ),
        ("points", ["gold", "plastic"], path(3), POINTS, ""),
        ("a lamp", ["gold", "plastic"], path(3), "", LAMP),
        ("a lamp and mirrors", ["mirror", "polished"], path(4), "", LAMP),
        ("a lamp and glass", ["red", "glass"], path(6), "", LAMP),
        ("glass, all lights", ["plastic", "glass"], path(12), &all, LAMP),
        ("mirrors, whitted", ["mirror", "copper"], whitted(4), &all, LAMP),
        ("glass, whitted", ["red", "glass"], whitted(6), sky, ""),
        ("mirrors, direct", ["polished", "mirror"], direct.clone(), POINTS, LAMP),
        ("printed", ["red", "printed"], path(3), "", LAMP),
        ("printed, all lights", ["printed", "printed"], path(4), &all, LAMP),
        ("printed, direct", ["mirror", "printed"], direct.clone(), image, ""),
        ("printed, seen in mirrors", ["printed", "mirror"], path(5), &all, LAMP),
        ("printed, seen through glass", ["printed", "glass"], whitted(8), &all, LAMP),
        ("one bounce, glass", ["glass", "mirror"], path(1), sky, LAMP),
        // Worked out one by one, and smooth where the image of roughness has 0.
        ("coats", ["coated", "brushed"], path(4), &all, LAMP),
        ("coats, points", ["coated", "smooth"], path(3), POINTS, ""),
        ("coats, direct", ["brushed", "coated"], direct.clone(), sky, LAMP),
        ("coats, whitted", ["smooth", "coated"], whitted(4), &sunny, LAMP),
        ("frosted glass", ["frosted", "mirror"], path(6), &all, LAMP),
        ("frosted glass and a sky", ["red", "frosted"], path(5), sky, ""),
        ("frosted glass and a lamp", ["coated", "frosted"], path(4), "", LAMP),
        ("printed and smooth", ["printed", "printed"], path(4), &all, LAMP),
    ] {
        save_waves(folder.path(), if name == "printed and smooth" { 0 } else { 20 });
        for ball in ["sphere", "box"] {
            let text = room_of(materials, [&tracer, lights, lamps, ball])
                .replace(r#""layers": ["direct", "indirect"],"#, "");
            let mut scene = load_in(folder.path(), &on_floor(ball, text));
            if name.starts_with("printed") {
                print(&mut scene);
            }
            compare_plain(&format!("plain, {name}, {ball}"), &scene, &[""]);
        }
    }
}

/// So are surfaces that are partly there, panes, media and bodies within one another, and glass that parts wavelengths.
#[test]
fn plain_paths_that_pass_surfaces_are_the_same_in_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 20);
    let path = |bounces: u32| format!(r#"{{"type": "path", "max_bounces": {bounces}}}"#);
    let whitted = r#"{"type": "whitted", "max_bounces": 6}"#.to_owned();
    let direct = r#"{"type": "direct"}"#.to_owned();
    let sky = r#"{"type": "environment", "radiance": [0.6, 0.7, 0.9]}"#;
    let image = r#"{"type": "environment", "image": "waves.png", "radiance": [2, 1, 0.5]}"#;
    let all = format!("{POINTS}, {image}");
    let drop = format!("{LAMP}{DROP}");
    for (name, materials, tracer, lights, more) in [
        ("veils", ["veil", "veil"], path(4), &*all, LAMP),
        ("veils, points", ["veil", "red"], direct.clone(), POINTS, ""),
        ("a veil and a mirror", ["veil", "mirror"], path(3), sky, DROP),
        ("a veil, direct", ["mirror", "veil"], direct, image, LAMP),
        ("veils, whitted", ["veil", "glass"], whitted.clone(), &all, LAMP),
        ("panes", ["pane", "veil"], path(4), &all, LAMP),
        ("panes, points", ["pane", "plastic"], path(3), POINTS, ""),
        ("amber", ["amber", "gold"], path(6), &all, LAMP),
        ("amber, whitted", ["printed", "amber"], whitted, sky, LAMP),
        ("a drop in amber", ["veil", "amber"], path(8), &all, &drop),
        ("flint", ["red", "flint"], path(6), &all, LAMP),
        ("flint and dim paths", ["flint", "flint"], path(12), "", LAMP),
        ("etched flint", ["veil", "etched"], path(5), &all, LAMP),
        ("flint in amber", ["flint", "amber"], path(6), sky, &drop),
    ] {
        for ball in ["sphere", "box"] {
            let text = room_of(materials, [&tracer, lights, more, ball]);
            let mut scene = load_in(folder.path(), &text);
            if name.contains("whitted") {
                print(&mut scene);
            }
            compare_plain(&format!("plain, {name}, {ball}"), &scene, &LAYERS);
        }
    }
}

/// So are scenes in which bodies and lights move while the shutter is open, with light told apart by bounces.
#[test]
fn plain_scenes_that_move_are_the_same_in_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 20);
    let moving = |[x, y, z]: [f64; 3]| {
        format!(r#""motion": {{"type": "velocity", "velocity": [{x}, {y}, {z}]}}"#)
    };
    let point = |motion: &str| {
        format!(r#"{{"type": "point", "at": [1, 2, 1], "intensity": [1, 2, 3], {motion}}}"#)
    };
    let lights = format!("{}, {POINTS}", point(&moving([-4.0, 0.0, 2.0])));
    let path = r#"{"type": "path", "max_bounces": 4}"#;
    let moving_lamp = LAMP.replace("\"width\"", &format!("{}, \"width\"", moving([2.0, 0.0, 1.0])));
    let moving_box = format!(
        r#"{LAMP}, {{"shape": "box", "material": "tiles",
            "transform": {{"scale": 0.3, "translate": [-0.4, 1.4, 0.6]}},
            "motion": {{"type": "velocity", "velocity": [1, 0, 0], "angular_velocity": [0, 200, 90]}}}}"#
    );
    for (name, materials, lights, lamps) in [
        ("points", ["red", "green"], &*lights, ""),
        ("facets", ["gold", "plastic"], &*lights, LAMP),
        ("mirrors", ["mirror", "printed"], &*lights, LAMP),
        ("a lamp", ["red", "glass"], "", LAMP),
        ("a veil", ["red", "veil"], &*lights, LAMP),
        ("amber", ["veil", "amber"], "", LAMP),
        ("a lamp that moves", ["gold", "green"], "", &moving_lamp),
        ("lamps that move", ["mirror", "plastic"], &*lights, &moving_box),
    ] {
        for ball in ["sphere", "box"] {
            let place = r#""transform": {"translate": [0.6, 0.5, 0.2], "scale": 0.5}"#;
            let text = room_of(materials, [path, lights, lamps, ball])
                .replace(place, &format!("{place}, {}", moving([1.5, 0.3, -0.4])))
                .replace(r#""fov": 40,"#, r#""fov": 40, "shutter": {"exposure": 0.2},"#);
            let mut scene = load_in(folder.path(), &text);
            if name == "mirrors" {
                print(&mut scene);
            }
            compare_plain(&format!("plain and moving, {name}, {ball}"), &scene, &LAYERS);
        }
    }
}
