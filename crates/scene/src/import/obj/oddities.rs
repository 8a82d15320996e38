//! What an MTL material says that cannot be so, or that is not looked at.

use etendue_tracer::spec::BRIGHTEST;

/// The values that no surface can have, each with what becomes of it.
pub(super) fn impossible(material: &tobj::Material) -> Vec<String> {
    let outside = |color: Option<[f64; 3]>| {
        color.is_some_and(|color| !color.iter().all(|value| (0.0..=1.0).contains(value)))
    };
    let mut found = Vec::new();
    for (key, color) in [("Kd", material.diffuse), ("Ks", material.specular)] {
        if outside(color) {
            found.push(format!("{key} is outside 0 to 1; it is brought there"));
        }
    }
    if outside(material.dissolve.map(|d| [d; 3])) {
        found.push("d is outside 0 to 1; it is brought there".to_owned());
    }
    if material.shininess.is_some_and(|ns| !(0.0..f64::INFINITY).contains(&ns)) {
        found.push("Ns is below zero or not finite; 0 is taken".to_owned());
    }
    let is_glass = matches!(material.illumination_model, Some(4 | 6 | 7 | 9));
    if is_glass && material.optical_density.is_some_and(|n| !(1.0..f64::INFINITY).contains(&n)) {
        found.push("Ni is below 1 or not finite; it is no glass".to_owned());
    }
    for (key, color) in [("Ke", material.emissive), ("Ka", material.ambient)] {
        let is_sound =
            |color: [f64; 3]| color.iter().all(|value| (0.0..=BRIGHTEST).contains(value));
        if color.is_some_and(|color| !is_sound(color)) {
            found.push(format!(
                "{key} is below zero, not finite or above {BRIGHTEST:e}; it does not shine"
            ));
        }
    }
    found
}

/// The keys that change how a surface looks and are passed over.
pub(super) fn passed_over(material: &tobj::Material) -> Vec<String> {
    let maps = [
        ("map_Ks", &material.specular_texture),
        ("map_Ns", &material.shininess_texture),
        ("map_d", &material.dissolve_texture),
        ("map_bump", &material.normal_texture),
    ];
    let maps = maps.into_iter().filter(|(_, map)| map.is_some()).map(|(key, _)| key.to_owned());
    let is_look = |key: &str| {
        key.starts_with("map_")
            || ["norm", "disp", "decal", "refl", "Pr", "Pm", "Ps", "Pc", "Pcr", "aniso", "anisor"]
                .contains(&key)
    };
    let mut others: Vec<String> =
        material.unknown_param.keys().filter(|key| is_look(key)).cloned().collect();
    others.sort();
    maps.chain(others).collect()
}
