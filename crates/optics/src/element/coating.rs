//! Thin films on glass and on mirrors, by their characteristic matrices.
//!
//! A layer of index N = n − ik and thickness d has δ = 2π N d cos θ/λ and the matrix [cos δ, i sin δ/η; i η sin δ, cos δ], with
//! η = N cos θ across the plane of incidence and N/cos θ in it; the product of all on (1, η) of what is behind is
//! (B, C). Then R = |(η₀ B − C)/(η₀ B + C)|² and T = 4 η₀ Re η/|η₀ B + C|² (H. A. Macleod, *Thin-Film Optical Filters*, 4th ed.,
//! 2010, Eqs. (2.108) to (2.118)). Light is unpolarised, films are coherent, flat and homogeneous.

use std::sync::Arc;

use etendue_geometry::units::Nanometres;
use rustfft::num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The most layers of a stack.
const MOST_LAYERS: usize = 200;

/// A film as a file writes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThinFilmSpec {
    /// Its index n.
    pub index: f64,
    /// Its coefficient of extinction k; 0 when absent.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub extinction: f64,
    /// Its thickness (nm).
    pub thickness: Nanometres,
}

/// Films on glass as a file writes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StackSpec {
    /// The films, that next to the air first.
    pub layers: Vec<ThinFilmSpec>,
}

/// A metal or glass and the films on it, that reflect, as a file writes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorCoatingSpec {
    /// The index n of what is below.
    pub index: f64,
    /// Its coefficient of extinction k; 0 when absent.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub extinction: f64,
    /// The films on it, that next to the light first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<ThinFilmSpec>,
}

/// Films, ready to be asked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stack {
    /// Complex indices n − ik and thicknesses (nm), as light from the air meets them.
    layers: Vec<(Complex64, f64)>,
}

/// A mirror's films on what is below them.
#[derive(Debug, Clone, PartialEq)]
pub struct MirrorCoating {
    stack: Arc<Stack>,
    below: Complex64,
}

fn index(n: f64, k: f64) -> Result<Complex64, String> {
    if !(n > 0.0 && n <= 20.0) {
        return Err(format!("index is {n}; it must be above 0 and at most 20"));
    }
    if !(0.0..=100.0).contains(&k) {
        return Err(format!("extinction is {k}; it must be from 0 to 100"));
    }
    Ok(Complex64::new(n, -k))
}

fn films(layers: &[ThinFilmSpec]) -> Result<Stack, String> {
    if layers.len() > MOST_LAYERS {
        return Err(format!("{} layers; {MOST_LAYERS} are the most", layers.len()));
    }
    let film = |(i, layer): (usize, &ThinFilmSpec)| {
        let error = |why: String| format!("layers[{i}]: {why}");
        let thickness = layer.thickness.0;
        if !(0.0..=1e5).contains(&thickness) {
            return Err(error(format!(
                "thickness is {thickness} nm; it must be from 0 to 100000 nm"
            )));
        }
        Ok((index(layer.index, layer.extinction).map_err(error)?, thickness))
    };
    Ok(Stack { layers: layers.iter().enumerate().map(film).collect::<Result<_, _>>()? })
}

impl StackSpec {
    /// The films.
    ///
    /// # Errors
    ///
    /// A sentence on the layer that is none.
    pub fn build(&self) -> Result<Stack, String> {
        films(&self.layers)
    }
}

impl MirrorCoatingSpec {
    /// The films and what is below them.
    ///
    /// # Errors
    ///
    /// A sentence on the number that is none.
    pub fn build(&self) -> Result<MirrorCoating, String> {
        let stack = Arc::new(films(&self.layers)?);
        Ok(MirrorCoating { stack, below: index(self.index, self.extinction)? })
    }
}

impl MirrorCoating {
    /// The share of light of a wavelength (nm) that is reflected in a medium of index `before` at this cosine of
    /// incidence.
    #[must_use]
    pub fn reflectance(&self, before: f64, cosine: f64, wavelength: f64) -> f64 {
        self.stack.shares([Complex64::new(before, 0.0), self.below], cosine, wavelength)[0]
    }
}

impl Stack {
    /// Returns the stack as light from the glass meets it.
    pub(crate) fn reversed(&self) -> Self {
        Self { layers: self.layers.iter().rev().copied().collect() }
    }

    /// The shares of light of a wavelength (nm) that are reflected and let through from an index before into one behind, at
    /// this cosine of incidence.
    #[must_use]
    pub fn shares(
        &self,
        [before, behind]: [Complex64; 2],
        cosine: f64,
        wavelength: f64,
    ) -> [f64; 2] {
        let sine = before * (1.0 - cosine * cosine).max(0.0).sqrt();
        // Of the two roots that in which light behind goes on and fades.
        let cosine_in = |n: Complex64| {
            let ratio = sine / n;
            let root = (1.0 - ratio * ratio).sqrt();
            if (n * root).im > 0.0 { -root } else { root }
        };
        let mut shares = [0.0; 2];
        for across in [true, false] {
            let admittance = |n: Complex64, cosine: Complex64| {
                if across { n * cosine } else { n / cosine }
            };
            let first = admittance(before, Complex64::new(cosine.max(1e-12), 0.0));
            let last = admittance(behind, cosine_in(behind));
            let (mut b, mut c) = (Complex64::new(1.0, 0.0), last);
            for &(n, thickness) in self.layers.iter().rev() {
                let cosine = cosine_in(n);
                let phase = std::f64::consts::TAU * n * thickness * cosine / wavelength;
                let (eta, i) = (admittance(n, cosine), Complex64::i());
                let (cos, sin) = (phase.cos(), phase.sin());
                (b, c) = (cos * b + i * sin / eta * c, i * eta * sin * b + cos * c);
            }
            let sum = first * b + c;
            shares[0] += 0.5 * ((first * b - c) / sum).norm_sqr();
            shares[1] += 0.5 * 4.0 * first.re * last.re / sum.norm_sqr();
        }
        // Rounding aside, and where a thick absorber leaves no number: nothing comes through.
        shares.map(|share| if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference values of another program: `scripts/lens_opinions.py`.
    #[test]
    fn stacks_reflect_and_pass_what_tmm_says() {
        let text = include_str!("../../tests/data/coatings.json");
        let rows: Vec<serde_json::Value> = serde_json::from_str(text).unwrap();
        assert!(rows.len() > 70);
        for row in &rows {
            let number = |key: &str| row[key].as_f64().unwrap();
            let layers: Vec<[f64; 3]> = serde_json::from_value(row["layers"].clone()).unwrap();
            let spec = StackSpec {
                layers: layers
                    .iter()
                    .map(|&[index, extinction, thickness]| ThinFilmSpec {
                        index,
                        extinction,
                        thickness: Nanometres(thickness),
                    })
                    .collect(),
            };
            let behind: [f64; 2] = serde_json::from_value(row["behind"].clone()).unwrap();
            let indices =
                [Complex64::new(number("before"), 0.0), Complex64::new(behind[0], -behind[1])];
            let cosine = number("angle").to_radians().cos();
            let stack = spec.build().unwrap();
            let [reflected, passed] = stack.shares(indices, cosine, number("wavelength"));
            // Products of some matrices of numbers of order 1: 1e-14 and less.
            assert!((reflected - number("reflectance")).abs() < 1e-9, "{row}: {reflected}");
            assert!((passed - number("transmittance")).abs() < 1e-9, "{row}: {passed}");
        }
    }

    #[test]
    fn without_absorption_nothing_is_lost_and_both_ways_are_alike() {
        let layers = [(1.38, 99.0), (2.1, 131.0), (1.62, 85.0)];
        let layers = layers.map(|(index, nm)| ThinFilmSpec {
            index,
            extinction: 0.0,
            thickness: Nanometres(nm),
        });
        let stack = StackSpec { layers: layers.to_vec() }.build().unwrap();
        let [air, glass] = [1.0, 1.52].map(|n| Complex64::new(n, 0.0));
        for angle in [0.0_f64, 0.3, 0.9, 1.4] {
            let [r, t] = stack.shares([air, glass], angle.cos(), 520.0);
            assert!((r + t - 1.0).abs() < 1e-14);
            // Stokes: from the other side at the refracted angle.
            let inside = (angle.sin() / 1.52).asin();
            let [back, _] = stack.reversed().shares([glass, air], inside.cos(), 520.0);
            assert!((back - r).abs() < 1e-13, "{angle}");
        }
    }

    #[test]
    fn what_is_no_film_is_refused_in_words() {
        let error = |json: &str| {
            let spec: StackSpec = serde_json::from_str(json).unwrap();
            spec.build().unwrap_err()
        };
        assert!(
            error(r#"{"layers": [{"index": 0, "thickness": 1}]}"#)
                .contains("layers[0]: index is 0")
        );
        assert!(
            error(r#"{"layers": [{"index": 1, "thickness": -1}]}"#).contains("thickness is -1")
        );
        let metal: MirrorCoatingSpec =
            serde_json::from_str(r#"{"index": 1, "extinction": -2}"#).unwrap();
        assert!(metal.build().unwrap_err().contains("extinction is -2"));
    }
}
