//! What is behind everything: which samples hit nothing, and the light that they bring.

use etendue_geometry::MISS;
use etendue_tracer::Traced;

use crate::radiance::LightPass;

/// Refills the arrays of `out`: 1 where a ray hits something, 1 for every ray, and 0.
pub(crate) fn alpha(traced: Traced<'_>, out: &mut [Vec<f64>; 3]) {
    let [hit, all, none] = out;
    hit.clear();
    hit.extend(traced.hits.placement.iter().map(|&p| if p == MISS { 0.0 } else { 1.0 }));
    for (array, value) in [(all, 1.0), (none, 0.0)] {
        array.clear();
        array.resize(traced.rays.len(), value);
    }
}

/// The share of hits in weighted sums of [`alpha`]. A lens that lets less through in the corners of
/// the picture does not make them transparent.
pub(crate) fn share([hit, all, _]: [f64; 3]) -> f64 {
    if all > 0.0 { (hit / all).clamp(0.0, 1.0) } else { 0.0 }
}

/// Refills the arrays of `out`: the environment's radiance along each ray that hits nothing, in red,
/// green and blue; 0 along others, without light, and with bands other than these three.
pub(crate) fn radiance(light: Option<&LightPass<'_>>, traced: Traced<'_>, out: &mut [Vec<f64>; 3]) {
    for array in out.iter_mut() {
        array.clear();
        array.resize(traced.rays.len(), 0.0);
    }
    let Some(stage) = light.map(|pass| pass.stage).filter(|stage| stage.spectral.count() == 3)
    else {
        return;
    };
    for i in 0..traced.rays.len() {
        let mut color = [0.0; 3];
        if traced.hits.placement[i] == MISS {
            stage.lights.environment(stage.spectral, traced.rays.direction(i), &mut color);
        }
        for (array, value) in out.iter_mut().zip(color) {
            array[i] = value;
        }
    }
}
