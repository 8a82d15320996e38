//! Reflectance of a smooth boundary.

/// Reflectance of unpolarised light at a boundary between dielectrics (Fresnel 1823; Born and Wolf,
/// *Principles of Optics*, section 1.5.2), for the cosine of incidence (0..=1) and the relative index
/// `eta` = index behind / index in front; and the cosine behind, `None` under total reflection.
#[must_use]
pub fn dielectric(cos_in: f64, eta: f64) -> (f64, Option<f64>) {
    let sin2_out = (1.0 - cos_in * cos_in) / (eta * eta);
    if sin2_out >= 1.0 {
        return (1.0, None);
    }
    let cos_out = (1.0 - sin2_out).sqrt();
    let s = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    let p = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    (0.5 * (s * s + p * p), Some(cos_out))
}

/// Schlick's weight (1 − cos θ)⁵ between the reflectance face on and that at grazing incidence
/// (Schlick 1994, equation 15).
#[must_use]
#[inline(always)]
pub fn schlick_weight(cosine: f64) -> f64 {
    let c = (1.0 - cosine).clamp(0.0, 1.0);
    let c2 = c * c;
    c2 * c2 * c
}

/// Reflectance face on of a dielectric in air, from its index.
#[must_use]
pub fn normal_reflectance(ior: f64) -> f64 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_angles() {
        let (face_on, _) = dielectric(1.0, 1.5);
        assert!((face_on - 0.04).abs() < 1e-15);
        // At Brewster's angle, tan θ = η, only s is reflected: ((1 − η²)/(1 + η²))² / 2.
        let brewster = 1.5_f64.atan().cos();
        let s = ((1.0 - 2.25) / (1.0 + 2.25_f64)).powi(2);
        assert!((dielectric(brewster, 1.5).0 - s / 2.0).abs() < 1e-15);
        assert_eq!(dielectric(0.0, 1.5).0, 1.0);
        // From glass to air beyond the critical angle.
        assert_eq!(dielectric(0.5, 1.0 / 1.5), (1.0, None));
        // Both ways through one boundary reflect the same (Stokes).
        let (out, Some(cos)) = dielectric(0.8, 1.33) else { panic!("below the critical angle") };
        assert!((dielectric(cos, 1.0 / 1.33).0 - out).abs() < 1e-15);
    }
}
