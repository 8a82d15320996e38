//! Mirrors, smooth metal and smooth boundaries of glass, many hits side by side: one direction each, as
//! [`super::Bsdf`] has it.

use super::Weights;
use super::fresnel::schlick_weight;
use etendue_geometry::block::LANES;

/// The smooth surfaces of so many hits.
#[derive(Debug)]
pub(crate) struct SmoothSurfaces<const N: usize = LANES> {
    /// Index behind a boundary over the index in front; 0 of mirrors.
    pub(crate) eta: [f64; N],
    /// 1 for metal, which is white at grazing incidence.
    pub(crate) is_metal: [f64; N],
    /// 1 where light that was chosen last passes the boundary.
    pub(crate) refracts: [f64; N],
    white: [f64; N],
    base: [f64; N],
    dip: [f64; N],
}

impl<const N: usize> Default for SmoothSurfaces<N> {
    fn default() -> Self {
        let zero = [0.0; N];
        Self { eta: zero, is_metal: zero, refracts: zero, white: zero, base: zero, dip: zero }
    }
}

impl<const N: usize> SmoothSurfaces<N> {
    /// The weights of a lane's light that goes the way which was chosen last.
    #[inline(always)]
    pub(crate) fn weights(&self, lane: usize) -> Weights {
        let (white, base, dip) = (self.white[lane], self.base[lane], self.dip[lane]);
        Weights { white, base, dip, ..Weights::default() }
    }

    /// Directions that light comes from, for these geometric and shading normals on the viewer's side: mirrored or, by
    /// choices and Fresnel's share, refracted, to `along`. `value` is 1 where there is one, else 0.
    pub(crate) fn scatter(
        &mut self,
        [normal, shading]: [&[[f64; N]; 3]; 2],
        direction: &[[f64; N]; 3],
        choices: &[f64; N],
        along: &mut [[f64; N]; 3],
        value: &mut [f64; N],
    ) {
        scatter(self, [normal, shading], direction, choices, along, value);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn scatter<const N: usize>(
    smooth: &mut SmoothSurfaces<N>,
    [normal, shading]: [&[[f64; N]; 3]; 2],
    direction: &[[f64; N]; 3],
    choices: &[f64; N],
    along: &mut [[f64; N]; 3],
    value: &mut [f64; N],
) {
    for i in 0..N {
        let (mut cosine, is_boundary) = (0.0, smooth.eta[i] > 0.0);
        for axis in 0..3 {
            cosine -= direction[axis][i] * shading[axis][i];
        }
        // Fresnel's equations (`super::fresnel`).
        let eta = if is_boundary { smooth.eta[i] } else { 1.0 };
        let sin2_out = (1.0 - cosine * cosine) / (eta * eta);
        let is_total = sin2_out >= 1.0;
        let cos_out = if is_total { 0.0 } else { 1.0 - sin2_out }.sqrt();
        let s = (cosine - eta * cos_out) / (cosine + eta * cos_out);
        let p = (eta * cosine - cos_out) / (eta * cosine + cos_out);
        let reflected = 0.5 * (s * s + p * p);
        let refracts = is_boundary & !is_total & (choices[i] >= reflected);
        let (ahead, back) =
            if refracts { (cosine / eta - cos_out, 1.0 / eta) } else { (2.0 * cosine, 1.0) };
        let (mut way, mut squared, mut above) = ([0.0; 3], 0.0, 0.0);
        for axis in 0..3 {
            way[axis] = shading[axis][i] * ahead + direction[axis][i] * back;
            squared += way[axis] * way[axis];
            above += way[axis] * normal[axis][i];
        }
        let inverse = 1.0 / squared.sqrt();
        for axis in 0..3 {
            along[axis][i] = way[axis] * inverse;
        }
        // The shading normal may lean a reflection through the surface.
        let is_sound = (cosine > 0.0) & ((above < 0.0) == refracts);
        value[i] = if is_sound { 1.0 } else { 0.0 };
        smooth.refracts[i] = if refracts { 1.0 } else { 0.0 };
        let w = schlick_weight(cosine);
        let is_metal = smooth.is_metal[i] > 0.0;
        let mirrored = if is_metal { [w, 1.0 - w] } else { [0.0, 1.0] };
        let mirrored = if is_boundary { [1.0, 0.0] } else { mirrored };
        let [white, base] = if refracts { [0.0, 1.0 / (eta * eta)] } else { mirrored };
        (smooth.white[i], smooth.base[i]) = (white, base);
        smooth.dip[i] = if is_metal { -cosine * (1.0 - cosine) * w } else { 0.0 };
    }
}
