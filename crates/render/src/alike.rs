//! Detection of scenes whose light is the same in all bands, so that one of them is traced for all.
//!
//! Grey surfaces and lights of equal energy have the same numbers in every band: the rows of red, green and blue that
//! make a band of a colour add up to 1 ([`etendue_spectrum::Bands::from_rgb`]). What is traced in one band is then what
//! each would have, but for the rounding of that sum.

use etendue_scene::Scene;
use etendue_tracer::{
    Color, EnvironmentImage, Ior, LayerSpec, Light, LightKind, Material, Paint, Scattering,
};

/// True if nothing of `scene` tells bands apart. Images and models' colours at corners are not looked through.
pub(crate) fn are_alike(scene: &Scene) -> bool {
    // The studio is found to be needed when the scene is rendered.
    let is_known = !scene.studio_if_dark && scene.slots == 0 && !scene.render.alpha;
    let is_of_light = |layer: &LayerSpec| layer.is_light() || !layer.row().taken.with_picture();
    is_known
        && scene.layers.iter().all(is_of_light)
        && scene.geometry.meshes.iter().all(|mesh| mesh.colors.is_none())
        && scene.materials.iter().all(is_grey_surface)
        && scene.lights.iter().all(is_grey_light)
}

fn is_grey(color: &Color) -> bool {
    color[0] == color[1] && color[1] == color[2]
}

fn is_grey_paint(paint: &Paint) -> bool {
    match paint {
        Paint::Plain(color) => is_grey(color),
        Paint::Checker { colors, curves: None, .. } => colors.iter().all(is_grey),
        Paint::Checker { .. } | Paint::Curve { .. } | Paint::Image { .. } | Paint::Cube { .. } => {
            false
        }
    }
}

fn is_grey_surface(material: &Material) -> bool {
    let scatters = match &material.scattering {
        Scattering::Black | Scattering::Matte | Scattering::Unlit | Scattering::Mirror => true,
        Scattering::Metal { named, .. } => named.is_none(),
        Scattering::Dielectric(glass) => {
            matches!(glass.ior, Ior::Constant(_)) && glass.absorption.is_none()
        }
        Scattering::Gltf(_) => false,
    };
    let shines = material
        .emission
        .as_ref()
        .is_none_or(|emission| is_grey_paint(&emission.radiance) && emission.illuminant.is_none());
    scatters && shines && is_grey_paint(&material.base_color)
}

fn is_grey_light(light: &Light) -> bool {
    let is_even = match &light.kind {
        LightKind::Point(_) | LightKind::Spot { .. } | LightKind::Directional { .. } => true,
        LightKind::Environment { image, .. } => *image == EnvironmentImage::Constant,
        LightKind::Projector(_) | LightKind::Goniometric(_) => false,
    };
    is_even && is_grey(&light.color) && light.illuminant.is_none() && light.spectrum.is_none()
}
