//! Projectors: points that throw an image, as for structured light.

use etendue_geometry::glam::{DMat3, DVec3};

use crate::reference::SceneView;
use crate::{Color, Paint, TextureUse};

/// A point that throws an image as a rectilinear lens does: on a screen that faces it the light is as even
/// as the image, E = I₀ / z² at the distance z along the axis, for which the intensity grows towards the
/// edges as 1/cos³ θ.
#[derive(Debug, Clone, PartialEq)]
pub struct Projector {
    /// Position (m).
    pub at: DVec3,
    /// Its axes in the world: +X to the right of the image as the projector sees it, +Y up, +Z backwards.
    pub axes: DMat3,
    /// Tangent of half the angle across.
    pub tangent: f64,
    /// Width over height; that of the image when absent, of a plain colour 1.
    pub aspect: Option<f64>,
    /// Image that is thrown.
    pub image: Paint,
}

impl Projector {
    /// Tangents of half the angles across and down.
    fn tangents(&self, scene: &SceneView<'_>) -> [f64; 2] {
        let of_image = || {
            let [width, height] = decoded(self.image.image()?, scene)?.size();
            (width > 0 && height > 0).then_some(width as f64 / height as f64)
        };
        let aspect = self.aspect.or_else(of_image).unwrap_or(1.0);
        [self.tangent, self.tangent / aspect]
    }

    /// Factor of its axial intensity towards the point `to` (m), by colour; `None` outside of its image.
    pub(crate) fn toward(&self, scene: &SceneView<'_>, to: DVec3) -> Option<Color> {
        let local = self.axes.transpose() * (to - self.at);
        let ahead = -local.z;
        let [across, down] = self.tangents(scene);
        let (x, y) = (local.x / (ahead * across), local.y / (ahead * down));
        if ahead <= 0.0 || x.abs().max(y.abs()) > 1.0 {
            return None;
        }
        let color = match &self.image {
            Paint::Plain(color) | Paint::Curve { look: color, .. } => *color,
            Paint::Checker { colors, squares, .. } => {
                let index = [x, -y].map(|c| (0.5 * (c + 1.0) * squares).floor());
                colors[usize::from((index[0] + index[1]).rem_euclid(2.0) != 0.0)]
            }
            Paint::Cube { .. } => [1.0; 3],
            Paint::Image { factor, image, .. } => {
                let [u, v] = [0.5 * (1.0 + x), 0.5 * (1.0 - y)];
                let uv = image.transform.map(|[a, b, c]| a * u + b * v + c);
                let thrown = decoded(image, scene).map(|file| file.sample(uv, image.encoding));
                std::array::from_fn(|k| factor[k] * thrown.map_or(1.0, |thrown| thrown[k]))
            }
        };
        let cosine = ahead / local.length();
        Some(color.map(|part| part / (cosine * cosine * cosine)))
    }

    /// Its power (W) over its axial intensity (W/sr), of a white image: ∫ cos⁻³ θ dΩ.
    pub(crate) fn solid_angle(&self, scene: &SceneView<'_>) -> f64 {
        let [across, down] = self.tangents(scene);
        4.0 * across * down
    }

    /// Direction in which it is aimed (unit).
    pub(crate) fn axis(&self) -> DVec3 {
        -self.axes.z_axis
    }

    /// The angle from the axis to the image's corner (rad).
    pub(crate) fn cone(&self, scene: &SceneView<'_>) -> f64 {
        let [across, down] = self.tangents(scene);
        across.hypot(down).atan()
    }
}

fn decoded<'a>(image: &TextureUse, scene: &SceneView<'a>) -> Option<&'a crate::Image> {
    scene.images.get(image.texture as usize)?.as_deref()
}
