//! Factors on the light on its way to the sensor: the curves that bands have to tell apart.

use std::f64::consts::PI;
use std::sync::Arc;

use etendue_geometry::glam::DVec3;
use etendue_scene::Scene;
use etendue_sensor::{Factor, Illumination, Times};
use etendue_spectrum::{Bands, Curve, Outside, rgb};
use etendue_tracer::transport::Follow;
use etendue_tracer::{Color, Emission, EnvironmentImage, LightKind, Material, Paint, Spectral};

/// Lights, filters, colours, bodies and metals of a scene.
pub(super) fn illumination(scene: &Scene) -> Illumination {
    let mut spectra: Vec<Curve> = Vec::new();
    let mut add = |curve: Curve| {
        if !spectra.contains(&curve) {
            spectra.push(curve);
        }
    };
    let of = |spectrum: &Option<Arc<Curve>>| spectrum.as_deref().cloned().unwrap_or(Curve::ONE);
    // The lights' spectra, and whether any of them is coloured.
    let mut coloured_light = false;
    for light in scene.lights.iter().filter(|light| light.color != [0.0; 3]) {
        match (&light.spectrum, EnvironmentImage::of(light)) {
            (Some(spectrum), _) => add(Curve::clone(spectrum)),
            // Any place of a sky is about a mixture of these.
            (None, Some(EnvironmentImage::ClearSky(sky))) => {
                sky.typical_spectra().into_iter().for_each(&mut add);
            }
            // Any place of a cube is a sum of these.
            (None, Some(EnvironmentImage::Cube(cube))) => {
                cube.parts().into_iter().for_each(&mut add);
            }
            (None, _) => add(of(&light.illuminant)),
        }
        let image = match &light.kind {
            LightKind::Environment { image, .. } => match image {
                EnvironmentImage::Studio | EnvironmentImage::File(_) => true,
                EnvironmentImage::Constant
                | EnvironmentImage::ClearSky(_)
                | EnvironmentImage::Cube(_) => false,
            },
            LightKind::Projector(projector) => is_coloured(&projector.image),
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Goniometric(_)
            | LightKind::Directional { .. } => false,
        };
        coloured_light |= image || (light.spectrum.is_none() && !is_grey(&light.color));
    }
    // The same of materials that something is made of.
    let mut used = vec![false; scene.materials.len()];
    let mut colours = Colours::default();
    for placement in &scene.geometry.placements {
        let Some(material) = scene.materials.get(placement.material as usize) else { continue };
        used[placement.material as usize] = true;
        if material.vertex_colors && scene.geometry.mesh_of(placement).colors.is_some() {
            colours.note(material);
        }
    }
    let mut factors: Vec<Factor> = Vec::new();
    let most = most_scattered(scene);
    for (material, _) in scene.materials.iter().zip(used).filter(|(_, used)| *used) {
        if let Some(emission) = &material.emission {
            match &emission.radiance {
                // Every texel is a sum of these.
                Paint::Cube { cube, .. } => cube.cube.parts().into_iter().for_each(&mut add),
                Paint::Checker { curves: Some(curves), .. } => {
                    curves.iter().for_each(|one| add(Curve::clone(&one.curve)));
                }
                Paint::Plain(_)
                | Paint::Curve { .. }
                | Paint::Checker { curves: None, .. }
                | Paint::Image { .. } => add(of(&emission.illuminant)),
            }
            coloured_light |= is_coloured(&emission.radiance);
        }
        if reflects_colour(material) {
            colours.note(material);
        }
        for factor in self::factors(material, most) {
            if !factors.contains(&factor) {
                factors.push(factor);
            }
        }
    }
    let filters = scene.camera.lens().map(|lens| lens.filter_curves()).unwrap_or_default();
    let colored = usize::from(coloured_light) + colours.in_turn(scene);
    Illumination { spectra, filters, colored, factors }
}

/// The light of a scene in bands, as a white surface has it that all lights reach alike: a sky and its sun as they
/// are, all else as strong as each other. Behind a filter of the lens that all light passes it is what passes.
pub(super) fn light(scene: &Scene, bands: &Bands) -> Vec<f64> {
    let spectral = Spectral::of(bands, &scene.materials);
    let mut sum = vec![0.0; bands.count()];
    let mut add = |mut light: Vec<f64>, weight: Option<f64>| {
        let all = light.iter().sum::<f64>();
        if all > 0.0 {
            let weight = weight.unwrap_or(1.0 / all);
            light.iter_mut().zip(&mut sum).for_each(|(value, sum)| *sum += weight * *value);
        }
    };
    let tinted = |color: &Color, illuminant: &Option<Arc<Curve>>| {
        let mut light = vec![0.0; bands.count()];
        spectral.spread(color, &mut light);
        if let Some(tint) = illuminant.as_ref().and_then(|known| spectral.emission(known).ok()) {
            light.iter_mut().zip(tint).for_each(|(value, tint)| *value *= tint);
        }
        light
    };
    let of_curve = |curve: &Curve| bands.from_curve(curve, Outside::Zero).unwrap_or_default();
    for light in &scene.lights {
        match (&light.spectrum, EnvironmentImage::of(light)) {
            (Some(spectrum), _) => add(of_curve(spectrum), Some(1.0)),
            (None, Some(EnvironmentImage::ClearSky(sky))) => {
                // The zenith stands for the dome, whose radiance falls on a floor π times.
                let zenith = sky.dome_spectrum(DVec3::Y);
                add(of_curve(&zenith), Some(PI * light.color[0]));
            }
            (None, Some(EnvironmentImage::Cube(cube))) => {
                let mean = cube.mean_over_the_sphere();
                add(mean.map(|mean| of_curve(&mean)).unwrap_or_default(), None);
            }
            (None, _) => add(tinted(&light.color, &light.illuminant), None),
        }
    }
    let used = |number: usize| {
        scene.geometry.placements.iter().any(|placement| placement.material as usize == number)
    };
    for (number, material) in scene.materials.iter().enumerate() {
        let Some(emission) = material.emission.as_ref().filter(|_| used(number)) else { continue };
        let color = match &emission.radiance {
            Paint::Cube { cube, .. } => {
                add(cube.cube.mean().map(|mean| of_curve(&mean)).unwrap_or_default(), None);
                continue;
            }
            Paint::Checker { curves: Some(curves), .. } => {
                curves.iter().for_each(|one| add(of_curve(&one.curve), None));
                continue;
            }
            Paint::Plain(color) => *color,
            Paint::Curve { .. } | Paint::Checker { .. } | Paint::Image { .. } => [1.0; 3],
        };
        add(tinted(&color, &emission.illuminant), None);
    }
    if let Some([filter]) = scene.camera.lens().map(|lens| lens.filter_curves()).as_deref() {
        let passed = bands.from_curve(filter, Outside::Held).unwrap_or_default();
        sum.iter_mut().zip(passed).for_each(|(value, passed)| *value *= passed);
    }
    sum
}

/// Factors on light by a material that are no mixtures of red, green and blue: what its body leaves
/// of it, what a measured metal reflects, and curves, up to `most` times one after the other.
fn factors(material: &Material, most: u8) -> Vec<Factor> {
    let mut factors = Vec::new();
    let absorption = material.absorption();
    if let Some(absorption) = &absorption {
        let curve = match &absorption.curve {
            Some(curve) => Some(Curve::clone(&curve.curve)),
            None => (!is_grey(&absorption.color)).then(|| rgb::spectrum(absorption.color)),
        };
        factors.extend(curve.map(|curve| Factor { curve, times: Times::AnyPower }));
    }
    let metal = material.scattering.measured_metal();
    factors.extend(metal.map(|m| Factor { curve: m.face_on(), times: Times::UpTo(2) }));
    let own = material.base_color.curves().iter();
    let layers = material.scattering.gltf();
    let layers = layers.into_iter().flat_map(|s| s.sheen_curve.iter().chain(&s.specular_curve));
    // Every texel of a cube is a sum of these.
    let parts = material.reflected_cube().map(|cube| cube.cube.parts()).unwrap_or_default();
    factors.extend(parts.into_iter().map(|curve| Factor { curve, times: Times::UpTo(1) }));
    factors.extend(
        own.chain(layers)
            .map(|curve| Factor { curve: Curve::clone(&curve.curve), times: Times::UpTo(most) }),
    );
    factors
}

/// Greatest number of times that light is taken to be scattered on its way, 2 at most: what is
/// darker than two surfaces leave counts little.
fn most_scattered(scene: &Scene) -> u8 {
    let light = scene.tracer.and_then(|tracer| tracer.row().light);
    let bounces = light.map_or(1, |light| light.rules.bounces);
    if bounces > 1 { 2 } else { 1 }
}

/// Coloured surfaces.
#[derive(Debug, Default)]
struct Colours {
    /// There is one.
    some: bool,
    /// Light passes one, or is mirrored by one, and goes on.
    passing: bool,
    /// One may be a mirror.
    mirroring: bool,
}

impl Colours {
    fn note(&mut self, material: &Material) {
        self.some = true;
        let surface = material.scattering.gltf();
        self.passing |= surface.is_some_and(|surface| surface.transmission > 0.0)
            || material.scattering.is_body();
        self.mirroring |= surface.is_some() || material.scattering.shows_others();
    }

    /// Number of them that may follow one another on a path of the scene's tracer. A body is
    /// entered and left, so that what passes it is coloured twice.
    fn in_turn(&self, scene: &Scene) -> usize {
        let Some(light) = scene.tracer.and_then(|tracer| tracer.row().light) else { return 0 };
        let bounces = light.rules.bounces as usize;
        let scattered = match light.rules.follow {
            Follow::Single if self.mirroring => bounces,
            Follow::Single => 1,
            Follow::All => bounces,
        };
        match (self.some, self.passing) {
            (false, _) => 0,
            (true, false) => scattered,
            (true, true) => scattered.max(1) + 2,
        }
    }
}

fn is_grey([r, g, b]: &Color) -> bool {
    r == g && g == b
}

fn is_coloured(paint: &Paint) -> bool {
    match paint {
        Paint::Plain(color) => !is_grey(color),
        // Curves are tried as such.
        Paint::Curve { .. } | Paint::Checker { curves: Some(_), .. } | Paint::Cube { .. } => false,
        Paint::Checker { colors, curves: None, .. } => !colors.iter().all(is_grey),
        Paint::Image { .. } => true,
    }
}

fn reflects_colour(material: &Material) -> bool {
    let layers = material.scattering.gltf().is_some_and(|surface| {
        let colored =
            |color: &Color, curve: bool, image: bool| (!is_grey(color) && !curve) || image;
        let sheen = colored(
            &surface.sheen_color,
            surface.sheen_curve.is_some(),
            surface.sheen_color_texture.is_some(),
        );
        let specular = colored(
            &surface.specular_color,
            surface.specular_curve.is_some(),
            surface.specular_color_texture.is_some(),
        );
        sheen || specular
    });
    // The colour of a lamp of curves is for looking.
    let shines = |emission: &Emission| !emission.radiance.curves().is_empty();
    if material.emission.as_ref().is_some_and(shines) {
        return false;
    }
    // So is that of a measured metal.
    let is_measured = material.scattering.measured_metal().is_some();
    layers || (!is_measured && is_coloured(&material.base_color))
}
