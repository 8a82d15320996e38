//! The picture's light in two parts: what one surface scattered at most, and the rest.

use etendue_render::output::Picture;
use etendue_tracer::{Emission, LayerSpec, LightGroup};

use crate::steps::{channels, glow, load, pictures, read};

fn refusal(text: &str) -> String {
    read(tempfile::tempdir().unwrap().path(), text).unwrap_err().to_string()
}

/// The values of a layer of light, channel by channel.
fn values(picture: &Picture, layer: &str) -> Vec<f64> {
    let channels = channels(picture, layer);
    assert_eq!(channels.len(), 3, "{layer}");
    channels.concat()
}

/// Within a closed box whose walls shine by 1 and return ρ, the light after n surfaces is ρⁿ.
#[test]
fn a_closed_furnace_in_parts() {
    for (tracer, indirect) in [("direct", 0.0), ("path", 0.6 * 0.6 / (1.0 - 0.6))] {
        let mut scene = load(&format!(
            r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}}, "layers": ["direct", "indirect"], "lights": [],
                "camera": {{"type": "orthographic", "height": 1e-3,
                    "pose": {{"from": [0.1, 0.2, 0.3], "look_at": [1, 0.1, 0.2]}},
                    "sensor": {{"resolution": [8, 8]}}}},
                "render": {{"samples": 256}},
                "objects": [{{"shape": "box", "size": [2, 2, 2], "material": "wall"}}],
                "materials": {{"wall": {{"type": "matte", "color": [0.6, 0.6, 0.6]}}}}}}"#
        ));
        scene.materials[0].emission = Some(glow());
        for (precision, picture) in pictures(&scene) {
            for (layer, known) in [("Direct", 1.6), ("Indirect", indirect)] {
                let [mean, bound] = mean(&picture, layer);
                let name = format!("{tracer}, {layer}, {precision:?}");
                assert!((mean - known).abs() <= bound, "{name}: {mean}, not {known}");
            }
        }
    }
}

/// A room with a mirror, a ball of glass, a lamp, a sky and a point.
fn room(layers: &str, sensor: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 6}}, "layers": {layers},
            "render": {{"samples": 8}},
            "camera": {{"type": "pinhole", "fov": 60, "pose": {{"from": [0, 1, 3], "look_at": [0, 0.6, 0]}},
                "sensor": {sensor}}},
            "lights": [{{"type": "point", "at": [1, 2, 1], "intensity": [2, 3, 4], "group": "key"}},
                {{"type": "environment", "radiance": [0.2, 0.3, 0.4]}}],
            "materials": {{"floor": {{"type": "matte", "color": [0.6, 0.5, 0.4]}},
                "mirror": {{"type": "mirror", "color": [0.9, 0.9, 0.9]}},
                "glass": {{"type": "dielectric", "ior": 1.5}},
                "lamp": {{"type": "emissive", "radiance": [3, 2, 1], "group": "lamp"}}}},
            "objects": [{{"shape": "rectangle", "width": 4, "height": 4, "material": "floor",
                    "transform": {{"rotate": [1, 0, 0, -90]}}}},
                {{"shape": "sphere", "radius": 0.4, "material": "mirror",
                    "transform": {{"translate": [-0.6, 0.4, 0]}}}},
                {{"shape": "sphere", "radius": 0.4, "material": "glass",
                    "transform": {{"translate": [0.6, 0.4, 0]}}}},
                {{"shape": "rectangle", "width": 0.5, "height": 0.5, "material": "lamp",
                    "transform": {{"rotate": [1, 0, 0, 90], "translate": [0, 1.5, 0]}}}}]}}"#
    )
}

#[test]
fn the_parts_are_the_picture_and_leave_it_as_it_is() {
    let plain = r#"{"resolution": [24, 16]}"#;
    let bands = r#"{"type": "multispectral", "resolution": [24, 16],
        "bands": {"from": 400, "to": 700, "count": 7}}"#;
    for sensor in [plain, bands] {
        let [in_parts, alone] = [r#"["indirect", "direct", "flat", "light_groups"]"#, "[]"]
            .map(|layers| pictures(&load(&room(layers, sensor))));
        for ((precision, parts), (_, alone)) in in_parts.iter().zip(&alone) {
            let whole = values(parts, "");
            let (direct, indirect) = (values(parts, "Direct"), values(parts, "Indirect"));
            assert!(direct.iter().sum::<f64>() > 0.0 && indirect.iter().sum::<f64>() > 0.0);
            let groups =
                ["Light.key", "Light.lamp", "Light.other"].map(|layer| values(parts, layer));
            assert!(groups.iter().all(|group| group.iter().sum::<f64>() > 0.0));
            for (i, whole) in whole.iter().enumerate() {
                // All are f32, and colours of bands are differences of them.
                let bound = 4.0 * f64::from(f32::EPSILON) * whole.abs() + 1e-6;
                let name = format!("pixel {i}, {precision:?}");
                assert!((direct[i] + indirect[i] - whole).abs() <= bound, "{name}: {whole}");
                let sum: f64 = groups.iter().map(|group| group[i]).sum();
                assert!((sum - whole).abs() <= bound, "{name}: {sum}, not {whole}");
            }
            assert_eq!(values(alone, ""), whole, "{sensor}, {precision:?}");
        }
    }
}

/// The mean of a layer's values, and four standard errors of it. The three colours share their paths: a
/// third of the values are independent.
fn mean(picture: &Picture, layer: &str) -> [f64; 2] {
    let found = values(picture, layer);
    let n = found.len() as f64;
    let mean = found.iter().sum::<f64>() / n;
    let variance = found.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [mean, 4.0 * (3.0 * variance / n).sqrt() + 1e-6]
}

/// A floor of ρ = 0.5 under a sky of radiance 0.8 has ρ L, and under a point of intensity I at a height h
/// above it ρ I / (π h²).
#[test]
fn each_group_is_the_picture_under_its_lights_alone() {
    for tracer in ["direct", "path"] {
        let scene = load(&format!(
            r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}}, "layers": ["light_groups"],
                "camera": {{"type": "orthographic", "height": 1e-3,
                    "pose": {{"from": [0, 5, 0.01], "look_at": [0, 0, 0]}},
                    "sensor": {{"resolution": [8, 8]}}}},
                "render": {{"samples": 256}},
                "lights": [{{"type": "point", "at": [0, 2, 0], "intensity": [6, 6, 6], "group": "key"}},
                    {{"type": "environment", "radiance": [0.8, 0.8, 0.8], "group": "sky"}},
                    {{"type": "directional", "direction": [0, -1, 0], "irradiance": [2, 2, 2]}}],
                "materials": {{"floor": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}},
                "objects": [{{"shape": "rectangle", "width": 40, "height": 40, "material": "floor",
                    "transform": {{"rotate": [1, 0, 0, -90]}}}}]}}"#
        ));
        let pi = std::f64::consts::PI;
        let key = 0.5 * 6.0 / (4.0 * pi);
        for (precision, picture) in pictures(&scene) {
            for (layer, known) in
                [("Light.sky", 0.4), ("Light.key", key), ("Light.other", 1.0 / pi)]
            {
                let [mean, bound] = mean(&picture, layer);
                let name = format!("{tracer}, {layer}, {precision:?}");
                assert!((mean - known).abs() <= bound, "{name}: {mean}, not {known}");
            }
        }
    }
}

/// As the furnace above, with a point within it.
#[test]
fn surfaces_that_shine_have_groups() {
    let mut scene = load(
        r#"{"etendue": 1, "tracer": {"type": "path"}, "layers": ["light_groups"],
            "lights": [{"type": "point", "at": [0, 0, 0], "intensity": [1, 1, 1], "group": "key"}],
            "camera": {"type": "orthographic", "height": 1e-3,
                "pose": {"from": [0.1, 0.2, 0.3], "look_at": [1, 0.1, 0.2]},
                "sensor": {"resolution": [8, 8]}},
            "render": {"samples": 256},
            "objects": [{"shape": "box", "size": [2, 2, 2], "material": "wall"}],
            "materials": {"wall": {"type": "matte", "color": [0.6, 0.6, 0.6]}}}"#,
    );
    let walls = LightGroup::try_from("walls".to_owned()).unwrap();
    scene.materials[0].emission = Some(Emission { group: Some(walls), ..glow() });
    scene.layers.push(LayerSpec::LightGroup { group: walls });
    for (precision, picture) in pictures(&scene) {
        let [found, bound] = mean(&picture, "Light.walls");
        assert!((found - 2.5).abs() <= bound, "{precision:?}: {found}");
        assert_eq!(mean(&picture, "Light.other")[0], 0.0, "{precision:?}");
        let whole = values(&picture, "");
        let parts = ["Light.walls", "Light.key"].map(|layer| values(&picture, layer));
        for (i, whole) in whole.iter().enumerate() {
            // Three numbers in f32.
            let off = (parts[0][i] + parts[1][i] - whole).abs();
            assert!(off <= 1e-6 * whole, "{precision:?}: pixel {i}");
        }
    }
}

#[test]
fn parts_of_light_without_light_are_refused() {
    let text = r#"{"etendue": 1, "tracer": {"type": "facing"}, "layers": ["depth", "indirect"],
        "objects": [{"shape": "sphere"}]}"#;
    let error = refusal(text);
    assert!(error.contains("layers[1]") && error.contains("tracer"), "{error}");
    let text = r#"{"etendue": 1, "tracer": {"type": "path"}, "objects": [{"shape": "sphere"}],
        "lights": [{"type": "point", "at": [0, 2, 0], "intensity": [1, 1, 1], "group": "Key Light"}]}"#;
    let error = refusal(text);
    assert!(error.contains("lights[0]") && error.contains("Key Light"), "{error}");
}
