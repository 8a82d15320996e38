//! Metals whose optical constants have been measured.
//!
//! Light of wavelength λ meets a metal as a medium of index `n + i k`. At the cosine `c` of incidence a
//! smooth surface reflects, of unpolarised light (Born and Wolf, *Principles of Optics*, section 14.2),
//!
//! ```text
//! R = (Rₛ + Rₚ) / 2,  Rₛ = (a² + b² − 2 a c + c²) / (a² + b² + 2 a c + c²)
//! Rₚ = Rₛ (c² (a² + b²) − 2 a c s² + s⁴) / (c² (a² + b²) + 2 a c s² + s⁴),  s² = 1 − c²
//! 2 a² = √((n² − k² − s²)² + 4 n² k²) + n² − k² − s²,  a b = n k
//! ```
//!
//! # Sources
//!
//! * Gold, silver, copper: P. B. Johnson and R. W. Christy, "Optical Constants of the Noble Metals",
//!   Phys. Rev. B 6, 4370 (1972), at room temperature.
//! * Aluminium: A. D. Rakić, "Algorithm for the Determination of Intrinsic Optical Constants of Metal
//!   Films: Application to Aluminum", Appl. Opt. 34, 4755 (1995).
//!
//! Tables as refractiveindex.info has them (M. N. Polyanskiy, public domain), 0.3 to 1.2 µm.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Curve;

/// A metal of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metal {
    /// Gold.
    Gold,
    /// Silver.
    Silver,
    /// Copper.
    Copper,
    /// Aluminium.
    Aluminium,
}

impl Metal {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Gold, Self::Silver, Self::Copper, Self::Aluminium];

    /// Wavelength (nm), n and k.
    fn table(self) -> &'static [[f64; 3]] {
        match self {
            Self::Gold => GOLD,
            Self::Silver => SILVER,
            Self::Copper => COPPER,
            Self::Aluminium => ALUMINIUM,
        }
    }

    /// Reflectance of a smooth surface for unpolarised light at the cosine of incidence `cosine`
    /// (0..=1), by wavelength (nm).
    #[must_use]
    pub fn reflectance(self, cosine: f64) -> Curve {
        let row = |&[nm, n, k]: &[f64; 3]| [nm, reflectance([n, k], cosine)];
        Curve::trusted(self.table().iter().map(row).collect())
    }
}

/// Reflectance of a smooth surface whose n and k are curves, at the cosine of incidence `cosine`, by wavelength: where
/// either has a point, and between its points every 5 nm, for it is no straight line of theirs.
///
/// # Errors
///
/// When the curves have no wavelengths in common.
pub fn reflectance_of([n, k]: [&Curve; 2], cosine: f64) -> Result<Curve, crate::CurveError> {
    if let (Some(n), Some(k)) = (n.as_flat(), k.as_flat()) {
        return Curve::flat(reflectance([n, k], cosine));
    }
    let range = [n.range(), k.range()];
    let [from, to] = [range[0][0].max(range[1][0]), range[0][1].min(range[1][1])];
    let mut knots: Vec<f64> = n.samples().iter().chain(k.samples()).map(|s| s[0]).collect();
    let mut nm = (from / 5.0).ceil() * 5.0;
    while nm < to {
        knots.push(nm);
        nm += 5.0;
    }
    knots.retain(|nm| (from..=to).contains(nm));
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    let at = |nm: f64| [nm, reflectance([n.held(nm), k.held(nm)], cosine)];
    Curve::sampled(knots.into_iter().map(at).collect())
}

/// Reflectance of a smooth surface of index `n + i k` for unpolarised light at the cosine of
/// incidence `cosine` (0..=1).
#[must_use]
pub fn reflectance([n, k]: [f64; 2], cosine: f64) -> f64 {
    let c2 = cosine * cosine;
    let s2 = 1.0 - c2;
    let real = n * n - k * k - s2;
    // a² + b², and a.
    let both = (real * real + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (both + real)).max(0.0).sqrt();
    let s = (both - 2.0 * a * cosine + c2) / (both + 2.0 * a * cosine + c2);
    let (even, odd) = (c2 * both + s2 * s2, 2.0 * a * cosine * s2);
    0.5 * (s + s * (even - odd) / (even + odd))
}

const GOLD: &[[f64; 3]] = &[
    [292.4, 1.49, 1.878],
    [300.9, 1.53, 1.889],
    [310.7, 1.53, 1.893],
    [320.4, 1.54, 1.898],
    [331.5, 1.48, 1.883],
    [342.5, 1.48, 1.871],
    [354.2, 1.5, 1.866],
    [367.9, 1.48, 1.895],
    [381.5, 1.46, 1.933],
    [397.4, 1.47, 1.952],
    [413.3, 1.46, 1.958],
    [430.5, 1.45, 1.948],
    [450.9, 1.38, 1.914],
    [471.4, 1.31, 1.849],
    [495.9, 1.04, 1.833],
    [520.9, 0.62, 2.081],
    [548.6, 0.43, 2.455],
    [582.1, 0.29, 2.863],
    [616.8, 0.21, 3.272],
    [659.5, 0.14, 3.697],
    [704.5, 0.13, 4.103],
    [756.0, 0.14, 4.542],
    [821.1, 0.16, 5.083],
    [892.0, 0.17, 5.663],
    [984.0, 0.22, 6.35],
    [1088.0, 0.27, 7.15],
    [1216.0, 0.35, 8.145],
];

const SILVER: &[[f64; 3]] = &[
    [292.4, 1.39, 1.161],
    [300.9, 1.34, 0.964],
    [310.7, 1.13, 0.616],
    [320.4, 0.81, 0.392],
    [331.5, 0.17, 0.829],
    [342.5, 0.14, 1.142],
    [354.2, 0.1, 1.419],
    [367.9, 0.07, 1.657],
    [381.5, 0.05, 1.864],
    [397.4, 0.05, 2.07],
    [413.3, 0.05, 2.275],
    [430.5, 0.04, 2.462],
    [450.9, 0.04, 2.657],
    [471.4, 0.05, 2.869],
    [495.9, 0.05, 3.093],
    [520.9, 0.05, 3.324],
    [548.6, 0.06, 3.586],
    [582.1, 0.05, 3.858],
    [616.8, 0.06, 4.152],
    [659.5, 0.05, 4.483],
    [704.5, 0.04, 4.838],
    [756.0, 0.03, 5.242],
    [821.1, 0.04, 5.727],
    [892.0, 0.04, 6.312],
    [984.0, 0.04, 6.992],
    [1088.0, 0.04, 7.795],
    [1216.0, 0.09, 8.828],
];

const COPPER: &[[f64; 3]] = &[
    [292.4, 1.42, 1.633],
    [300.9, 1.4, 1.679],
    [310.7, 1.38, 1.729],
    [320.4, 1.38, 1.783],
    [331.5, 1.34, 1.821],
    [342.5, 1.36, 1.864],
    [354.2, 1.37, 1.916],
    [367.9, 1.36, 1.975],
    [381.5, 1.33, 2.045],
    [397.4, 1.32, 2.116],
    [413.3, 1.28, 2.207],
    [430.5, 1.25, 2.305],
    [450.9, 1.24, 2.397],
    [471.4, 1.25, 2.483],
    [495.9, 1.22, 2.564],
    [520.9, 1.18, 2.608],
    [548.6, 1.02, 2.577],
    [582.1, 0.7, 2.704],
    [616.8, 0.3, 3.205],
    [659.5, 0.22, 3.747],
    [704.5, 0.21, 4.205],
    [756.0, 0.24, 4.665],
    [821.1, 0.26, 5.18],
    [892.0, 0.3, 5.768],
    [984.0, 0.32, 6.421],
    [1088.0, 0.36, 7.217],
    [1216.0, 0.48, 8.245],
];

const ALUMINIUM: &[[f64; 3]] = &[
    [309.96, 0.28003, 3.7081],
    [326.28, 0.31474, 3.9165],
    [364.66, 0.39877, 4.3957],
    [413.28, 0.52135, 5.0008],
    [442.8, 0.6079, 5.3676],
    [476.87, 0.7278, 5.7781],
    [516.6, 0.8734, 6.2418],
    [563.57, 1.0728, 6.7839],
    [619.93, 1.366, 7.4052],
    [652.25, 1.5724, 7.7354],
    [688.81, 1.8301, 8.0601],
    [729.32, 2.1606, 8.3565],
    [774.91, 2.6154, 8.4914],
    [794.78, 2.7675, 8.3866],
    [815.69, 2.7668, 8.2573],
    [837.74, 2.6945, 8.1878],
    [885.61, 2.2802, 8.1134],
    [911.66, 1.9739, 8.3058],
    [939.28, 1.6784, 8.597],
    [968.63, 1.4867, 9.0655],
    [999.88, 1.4359, 9.4939],
    [1033.2, 1.3998, 9.8914],
    [1127.1, 1.3281, 10.969],
    [1239.9, 1.3157, 12.245],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectances_are_those_of_fresnel() {
        // Face on: ((n − 1)² + k²) / ((n + 1)² + k²).
        let [n, k] = [0.29, 2.863];
        let known = ((n - 1.0_f64).powi(2) + k * k) / ((n + 1.0_f64).powi(2) + k * k);
        assert!((reflectance([n, k], 1.0) - known).abs() < 1e-14);
        assert!((reflectance([n, k], 0.0) - 1.0).abs() < 1e-14);
        // Without absorption, glass at Brewster's angle: s alone, ((1 − n²)/(1 + n²))² / 2.
        let brewster = 1.5_f64.atan().cos();
        let s = ((1.0 - 2.25) / (1.0 + 2.25_f64)).powi(2);
        assert!((reflectance([1.5, 0.0], brewster) - s / 2.0).abs() < 1e-14);
        for metal in Metal::ALL {
            for cosine in [0.0, 0.1, 0.5, 1.0] {
                let curve = metal.reflectance(cosine);
                assert!(curve.samples().iter().all(|s| (0.0..=1.0 + 1e-12).contains(&s[1])));
            }
        }
    }

    #[test]
    fn metals_have_the_colours_that_they_are_known_by() {
        let at = |metal: Metal, nm: f64| metal.reflectance(1.0).held(nm);
        // Gold and copper turn dark towards blue; silver and aluminium hardly do (Born and Wolf,
        // table 14.1, and Hass 1955: aluminium reflects 0.91 to 0.92 in the visible).
        assert!(at(Metal::Gold, 650.0) > 0.95 && at(Metal::Gold, 450.0) < 0.42);
        assert!(at(Metal::Copper, 650.0) > 0.93 && at(Metal::Copper, 450.0) < 0.6);
        assert!(at(Metal::Silver, 450.0) > 0.96 && at(Metal::Silver, 650.0) > 0.98);
        assert!((at(Metal::Aluminium, 550.0) - 0.915).abs() < 0.01);
    }
}
