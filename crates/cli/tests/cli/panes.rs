//! Light that passes panes on its way to a surface.

use crate::run::{Bench, notes_in, text};

/// Floor's radiance under a smooth tinted pane, by each tracer of light.
fn under_a_pane(lights: &str, more: &str) -> Vec<f64> {
    let seen = |tracer: &str| {
        let bench = Bench::with_scene(&format!(
            r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}}, "render": {{"samples": 16}},
            "camera": {{"type": "orthographic", "height": 1e-4, "sensor": {{"resolution": [2, 2]}},
                        "pose": {{"from": [3, 0.5, 1], "look_at": [0, 0, 0], "up": [0, 0, 1]}}}},
            "objects": [
                {{"shape": "rectangle", "width": 9, "height": 9, "material": "floor"}},
                {{"shape": "rectangle", "material": "pane", "transform": {{"translate": [0, 0, 2]}}}}],
            "materials": {{"floor": {{"type": "matte", "color": [0.5, 0.5, 0.5]}},
                "pane": {{"type": "gltf", "color": [0.8, 0.6, 1], "ior": 1.5, "transmission": 1,
                          "metallic": 0, "roughness": 0 {more}}}}},
            "lights": [{lights}]}}"#
        ));
        bench.render(&[]);
        bench.array("picture")[..3].to_vec()
    };
    ["direct", "whitted", "path"].into_iter().flat_map(seen).collect()
}

/// E ρ/π, times the pane's colour and what its sheet does not reflect face on: 1 − ((n − 1)/(n + 1))².
#[test]
fn suns_and_points_shine_through_smooth_panes() {
    let sun = r#"{"type": "directional", "direction": [0, 0, -1], "irradiance": [1, 1, 1]}"#;
    let point = r#"{"type": "point", "at": [0, 0, 4], "intensity": [16, 16, 16]}"#;
    for light in [sun, point] {
        for (own, tint) in under_a_pane(light, "").iter().zip([0.8, 0.6, 1.0].iter().cycle()) {
            let known = 0.5 / std::f64::consts::PI * tint * 0.96;
            // Over a patch of 10⁻⁴ m nothing changes by more than its square; pictures are f32.
            assert!((own / known - 1.0).abs() < 1e-6, "{light}: {own}, not {known}");
        }
    }
    // Half of a pane that is half there is open.
    let halves = under_a_pane(sun, r#", "opacity": 0.5"#);
    let known = 0.5 / std::f64::consts::PI * (0.5 + 0.5 * 0.8 * 0.96);
    assert!((halves[0] / known - 1.0).abs() < 1e-6, "{halves:?}");
}

/// Lights that stay dark are told: a sun before glass that bends, and a lamp without area.
#[test]
fn light_that_finds_no_way_is_told() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "tracer": {"type": "path"}, "render": {"samples": 1},
        "camera": {"type": "pinhole", "sensor": {"resolution": [4, 4]}},
        "objects": [{"shape": "sphere", "material": "ball"}, {"file": "m.obj", "material": "lamp"}],
        "materials": {"ball": {"type": "dielectric", "ior": 1.5},
            "lamp": {"type": "emissive", "radiance": [5, 5, 5]}},
        "lights": [{"type": "directional", "direction": [0, 0, -1], "irradiance": [1, 1, 1]}]}"#,
    );
    bench.write("m.obj", b"v 0 2 0\nv 1 2 0\nv 2 2 0\nf 1 2 3\n");
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{message}");
    insta::assert_snapshot!(notes_in(&message), @r#"
    note: material "lamp": shines, and no triangle that it is on has an area: it lights nothing
    note: lights: the light of suns, spots, points and projectors does not find its way through surfaces that bend it (ball): what it shines on through them, or from within, is black; give the light a size (`emissive`, `environment`) and take the tracer `path`
    note: picture: 100 % of what the camera sees sends no light at all: its materials are black, or no light reaches it; name other `materials` or `lights` in the scene, or leave out the key `lights` for a grey studio
    "#);
}
