//! The spectral bands in which a picture is rendered, chosen for the sensor, the lights and the
//! colours of the scene.

use etendue_scene::Scene;
use etendue_sensor::bands::TOLERANCE;
use etendue_sensor::{BandChoice, Illumination};
use etendue_spectrum::{Bands, Curve, Illuminant, VISIBLE};
use etendue_tracer::{Color, EnvironmentImage, LayerSpec, LightKind, Material, Paint};

/// The bands that the picture of `scene` is rendered in: base colours have three parts and no more,
/// light has as many as it takes to count the sensor's electrons right.
pub(crate) fn bands(scene: &Scene) -> BandChoice {
    let rgb = || BandChoice { bands: Bands::Rgb, error: None };
    match (&scene.sensor, scene.picture) {
        (Some(sensor), Some(LayerSpec::Radiance)) => {
            sensor.bands_under(&illumination(scene)).unwrap_or_else(|_| {
                // The render refuses the light, and says which one.
                BandChoice { bands: sensor.bands().clone(), error: None }
            })
        }
        _ => rgb(),
    }
}

/// How many bands there are, and why.
pub(crate) fn explain_bands(scene: &Scene, chosen: &BandChoice) -> (String, String) {
    let choice = match &chosen.bands {
        Bands::Grey => "1".to_owned(),
        Bands::Rgb => "3 (RGB)".to_owned(),
        Bands::Spectral(_) | Bands::Weighted(_) => {
            let [from, to] = chosen.bands.range();
            format!("{} ({from} to {to} nm)", chosen.bands.count())
        }
    };
    let because = match (&scene.sensor, scene.picture, chosen.error) {
        (None, ..) => "no sensor or glass in the scene tells more apart".to_owned(),
        (Some(_), Some(LayerSpec::Radiance), None) => {
            "as many as the sensor can tell apart".to_owned()
        }
        (Some(_), Some(LayerSpec::Radiance), Some(error)) => in_words(error, &chosen.bands),
        (Some(_), ..) => "the picture is base colour, which has three parts".to_owned(),
    };
    (choice, because)
}

/// What bands lose, in words.
fn in_words(error: f64, bands: &Bands) -> String {
    let percent = 100.0 * error;
    let beyond = match beyond_visible(bands) {
        Some(_) => "; beyond visible light, colours are taken as they end there",
        None => "",
    };
    let verdict = match error <= TOLERANCE {
        true => "the fewest that keep electrons within 0.1 % of an integration by 1 nm",
        false => "sensor.bands says so; leave it out for fewer errors: electrons are off",
    };
    format!("{verdict} ({percent:.2} % at most, for these lights, colours and this sensor){beyond}")
}

/// The range of bands (nm), where it is more than visible light.
fn beyond_visible(bands: &Bands) -> Option<[f64; 2]> {
    let [from, to] = bands.range();
    (from < VISIBLE[0] || to > VISIBLE[1]).then_some([from, to])
}

/// What materials and glasses do not know of the wavelengths that are rendered.
pub(super) fn unknown(scene: &Scene, bands: &Bands) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some([from, to]) = beyond_visible(bands) {
        notes.push(format!(
            "light of {from} to {to} nm is rendered, and colours are known from {} to {} nm: beyond, \
             materials and coloured lights are grey, of the mean of their red, green and blue",
            VISIBLE[0], VISIBLE[1]
        ));
    }
    let said = |note: &String| scene.notes.iter().any(|known| known.message == *note);
    let glass = scene.camera.lens().map(|lens| lens.out_of_range(bands)).unwrap_or_default();
    notes.extend(glass.into_iter().filter(|note| !said(note)));
    notes
}

/// Lights, filters and colours that the bands have to tell apart.
fn illumination(scene: &Scene) -> Illumination {
    // The lights' spectra, and whether any of them is coloured.
    let mut spectra: Vec<Curve> = Vec::new();
    let mut add = |illuminant: Option<Illuminant>| {
        let curve = illuminant.and_then(|i| i.curve().ok()).unwrap_or(Curve::ONE);
        if !spectra.contains(&curve) {
            spectra.push(curve);
        }
    };
    let mut coloured_light = false;
    for light in scene.lights.iter().filter(|light| light.color != [0.0; 3]) {
        add(light.illuminant);
        let image = match &light.kind {
            LightKind::Environment { image, .. } => *image != EnvironmentImage::Constant,
            LightKind::Projector(projector) => match &projector.image {
                Paint::Plain(color) => !is_grey(color),
                Paint::Checker { .. } | Paint::Image { .. } => true,
            },
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Goniometric(_)
            | LightKind::Directional { .. } => false,
        };
        coloured_light |= image || !is_grey(&light.color);
    }
    // The same of materials that something is made of.
    let mut used = vec![false; scene.materials.len()];
    let mut coloured = false;
    for placement in &scene.geometry.placements {
        let Some(material) = scene.materials.get(placement.material as usize) else { continue };
        used[placement.material as usize] = true;
        let vertices = scene.geometry.mesh_of(placement).colors.is_some();
        coloured |= material.vertex_colors && vertices;
    }
    for (material, _) in scene.materials.iter().zip(used).filter(|(_, used)| *used) {
        if let Some(emission) = &material.emission {
            add(emission.illuminant);
            coloured_light |= is_coloured(&emission.radiance);
        }
        coloured |= reflects_colour(material);
    }
    // How many colours multiply on the way to the sensor.
    let light = scene.tracer.and_then(|tracer| tracer.row().light);
    let surfaces = 1 + usize::from(light.is_some_and(|light| light.rules.bounces > 1));
    let filters = scene.camera.lens().map(|lens| lens.filter_curves()).unwrap_or_default();
    let colored = usize::from(coloured_light) + if coloured { surfaces } else { 0 };
    Illumination { spectra, filters, colored }
}

fn is_grey([r, g, b]: &Color) -> bool {
    r == g && g == b
}

fn is_coloured(paint: &Paint) -> bool {
    match paint {
        Paint::Plain(color) => !is_grey(color),
        Paint::Checker { colors, .. } => !colors.iter().all(is_grey),
        Paint::Image { .. } => true,
    }
}

fn reflects_colour(material: &Material) -> bool {
    let specular = material.scattering.gltf().is_some_and(|surface| {
        !is_grey(&surface.specular_color) || surface.specular_color_texture.is_some()
    });
    specular || is_coloured(&material.base_color)
}
