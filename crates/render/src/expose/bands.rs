//! The spectral bands in which a picture is rendered, chosen for the sensor, the lights and the
//! colours of the scene.

use etendue_scene::Scene;
use etendue_sensor::{BandChoice, Illumination, Radiometry};
use etendue_spectrum::{Bands, Curve, VISIBLE, integral};
use etendue_tracer::{ClearSky, EnvironmentImage, LayerSpec, Material};

use super::illumination::illumination;

/// The bands that the picture of `scene` is rendered in: base colours have three parts and no more,
/// light has as many as it takes to count the sensor's electrons right.
pub(crate) fn bands(scene: &Scene) -> BandChoice {
    let rgb = || BandChoice::untried(Bands::Rgb);
    match (&scene.sensor, scene.picture) {
        (Some(sensor), Some(LayerSpec::Radiance)) => {
            sensor.bands_under(&illumination(scene), scene.accuracy.band_error).unwrap_or_else(
                |_| {
                    // The render refuses the light, and says which one.
                    BandChoice::untried(sensor.bands().clone())
                },
            )
        }
        _ => rgb(),
    }
}

/// Number of bands, and the reason.
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
        (Some(sensor), Some(LayerSpec::Radiance), None) => match sensor.radiometry() {
            Radiometry::Digital => "as many as the sensor can tell apart".to_owned(),
            Radiometry::Physical => {
                "as many as the sensor can tell apart; what they lose of electrons is not known"
                    .to_owned()
            }
        },
        (Some(_), Some(LayerSpec::Radiance), Some(error)) => in_words(error, chosen, scene),
        (Some(_), ..) => "the picture is base colour, which has three parts".to_owned(),
    };
    (choice, because)
}

/// Loss by the bands, in words.
fn in_words(error: f64, chosen: &BandChoice, scene: &Scene) -> String {
    let percent = 100.0 * error;
    let beyond = match beyond_visible(&chosen.bands) {
        Some(_) => "; beyond visible light, colours are taken as they end there",
        None => "",
    };
    let within = scene.accuracy.band_error;
    let verdict = match error <= within {
        true => {
            let within = 100.0 * within;
            format!("the fewest that keep electrons within {within} % of an integration by 1 nm")
        }
        false => {
            "sensor.bands says so; leave it out for fewer errors: electrons are off".to_owned()
        }
    };
    let unbounded = match (chosen.complete, illumination(scene).colored > 3) {
        (false, _) => {
            "; there are more products of its curves than were tried, which may lose more"
        }
        (true, true) => "; more than three colours in turn may lose more",
        (true, false) => "",
    };
    format!(
        "{verdict} ({percent:.2} % at most, for these lights, colours and this sensor){unbounded}{beyond}"
    )
}

/// The range of bands (nm), where it is more than visible light.
fn beyond_visible(bands: &Bands) -> Option<[f64; 2]> {
    let [from, to] = bands.range();
    (from < VISIBLE[0] || to > VISIBLE[1]).then_some([from, to])
}

/// The curves of surfaces that end within the bands, and by how much each is held beyond.
fn extended(scene: &Scene, bands: &Bands) -> Option<String> {
    bands.grid()?;
    let [from, to] = bands.range();
    let beyond = |material: &Material| -> Option<String> {
        let gap =
            |[low, high]: [f64; 2]| (low.min(to) - from).max(0.0) + (to - high.max(from)).max(0.0);
        let curves = material.curves().into_iter().map(|curve| curve.curve.range());
        let cube = material.reflected_cube().map(|cube| cube.cube.range());
        let gap = curves.chain(cube).map(gap).fold(0.0, f64::max);
        let share = 100.0 * gap / (to - from);
        (gap > 0.0).then(|| format!("\"{}\" over {gap:.0} nm ({share:.0} %)", material.name))
    };
    let short: Vec<String> = scene.materials.iter().filter_map(beyond).collect();
    let more = match short.len() {
        0 => return None,
        1..=3 => String::new(),
        count => format!(" and {} more", count - 3),
    };
    let named = short.iter().take(3).cloned().collect::<Vec<_>>().join(", ");
    Some(format!(
        "light of {from} to {to} nm is rendered, and curves and cubes of materials end before: they are held as they end, of \
         {named}{more}; give points as far as the sensor sees, or narrow its range"
    ))
}

/// Light that is nearly all within so many nanometres is narrow.
const NARROW: f64 = 60.0;

/// That colours of three numbers are a guess under lines.
fn upsampled(scene: &Scene) -> Option<String> {
    let Illumination { spectra, colored, .. } = illumination(scene);
    // The width of an even band that is as uneven: (∫ S)² over ∫ S².
    let width = |curve: &Curve| {
        let [from, to] = curve.range();
        let sum = curve.integral(from, to);
        sum * sum / integral(&[curve, curve], from, to)
    };
    let narrow = |curve: &&Curve| curve.as_flat().is_none() && width(curve) < NARROW;
    let line = spectra.iter().find(narrow).filter(|_| colored > 0)?;
    let at = line.peak().unwrap_or_default();
    Some(format!(
        "light near {at:.0} nm is a line {:.1} nm wide, and colours of three numbers are known as smooth mixtures of red, \
         green and blue: what they reflect of it is a guess; give those materials measured curves",
        width(line)
    ))
}

/// Notes on what materials and glasses do not know of the wavelengths that are rendered.
pub(super) fn unknown(scene: &Scene, bands: &Bands) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some([from, to]) = beyond_visible(bands) {
        notes.push(format!(
            "light of {from} to {to} nm is rendered, and colours are known from {} to {} nm: beyond, \
             materials and coloured lights are grey, of the mean of their red, green and blue",
            VISIBLE[0], VISIBLE[1]
        ));
    }
    notes.extend(extended(scene, bands));
    notes.extend(upsampled(scene));
    let sky = scene
        .lights
        .iter()
        .any(|light| matches!(EnvironmentImage::of(light), Some(EnvironmentImage::ClearSky(_))));
    let last = ClearSky::last_wavelength();
    if sky && bands.grid().is_some() && bands.range()[1] > last {
        notes.push(format!(
            "the clear sky and its sun are known up to {last} nm: from there to {} nm they are as at {last} nm, \
             and beyond they are dark",
            VISIBLE[1]
        ));
    }
    let said = |note: &String| scene.notes.iter().any(|known| known.message == *note);
    let glass = scene.camera.lens().map(|lens| lens.out_of_range(bands)).unwrap_or_default();
    notes.extend(glass.into_iter().filter(|note| !said(note)));
    notes
}
