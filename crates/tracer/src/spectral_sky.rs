//! Hosek and Wilkie's clear sky at its own eleven wavelengths, and its sun.
//!
//! # Sources
//!
//! * The dome: Hosek and Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", SIGGRAPH 2012.
//! * The sun: Hosek and Wilkie, "Adding a Solar-Radiance Function to the Hošek–Wilkie Skylight Model", IEEE
//!   Computer Graphics and Applications 33(3), 2013, with its darkening towards the limb.
//! * The numbers of both are the authors' own, in f32 (`data/hosek-wilkie.bin`, whose licence stands beside
//!   it), in the order `[turbidity][albedo][elevation][wavelength][parameter]`, the dome's mean radiances
//!   likewise without parameters, the sun's `[turbidity][piece][wavelength][power]`, and the limb's
//!   `[wavelength][power]`.

use std::f64::consts::{FRAC_PI_2, TAU};

use etendue_spectrum::{Bands, Curve, NoOverlap, Outside};

/// Number of wavelengths.
pub(crate) const COUNT: usize = 11;

/// The first of them, the step to the next, and the last (nm).
const WAVELENGTHS: [f64; 3] = [320.0, 40.0, 720.0];

/// Up to where the light of the last wavelength is held (nm): the end of visible light.
const HELD: f64 = 780.0;

/// Turbidities 1 to 10, albedos 0 and 1, and what is between elevations of the sun.
const TURBIDITIES: usize = 10;
const ALBEDOS: usize = 2;
const CONTROLS: usize = 6;
const PARAMETERS: usize = 9;

/// Pieces of the sun's radiance over its elevation, and the coefficients of each and of the limb.
const PIECES: usize = 45;
const POWERS: usize = 4;
const LIMB: usize = 6;

const NUMBERS: &[u8; 132_264] = include_bytes!("../data/hosek-wilkie.bin");

/// Indices at which the tables begin.
const RADIANCES: usize = TURBIDITIES * ALBEDOS * CONTROLS * COUNT * PARAMETERS;
const SUN: usize = RADIANCES + TURBIDITIES * ALBEDOS * CONTROLS * COUNT;
const DARKENING: usize = SUN + TURBIDITIES * PIECES * COUNT * POWERS;
const _: () = assert!(4 * (DARKENING + COUNT * LIMB) == NUMBERS.len());

/// A number of the authors' tables.
fn number(index: usize) -> f64 {
    let bytes = NUMBERS.as_chunks::<4>().0[index];
    f64::from(f32::from_le_bytes(bytes))
}

/// One number a wavelength.
pub(crate) type Spectrum = [f64; COUNT];

/// The dome at the eleven wavelengths, for one place of the sun.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SpectralSky {
    parameters: [[f64; PARAMETERS]; COUNT],
    /// Mean radiances, W/(m² sr nm).
    radiances: Spectrum,
    /// The sun's mean radiance over its disk, W/(m² sr nm).
    sun: Spectrum,
}

impl SpectralSky {
    /// For a turbidity of 1 to 10, an elevation of the sun of 0 to π/2 and an albedo of the ground of 0 to 1.
    pub(crate) fn new(turbidity: f64, elevation: f64, albedo: f64) -> Self {
        let (turbid, share) = between(turbidity);
        // Straight lines between turbidities and albedos, a Bézier curve over the cube root of the elevation.
        let x = (elevation / FRAC_PI_2).clamp(0.0, 1.0).cbrt();
        let [from, to] = [1.0 - x, x];
        let bezier: [f64; CONTROLS] = [
            from.powi(5),
            5.0 * from.powi(4) * to,
            10.0 * from.powi(3) * to.powi(2),
            10.0 * from.powi(2) * to.powi(3),
            5.0 * from * to.powi(4),
            to.powi(5),
        ];
        let mixed = |first: usize, width: usize, at: usize| -> f64 {
            let mut sum = 0.0;
            for (step, of_turbidity) in [1.0 - share, share].into_iter().enumerate() {
                let turbid = turbid + step;
                for (ground, of_albedo) in [1.0 - albedo, albedo].into_iter().enumerate() {
                    let row = (turbid * ALBEDOS + ground) * CONTROLS;
                    for (control, weight) in bezier.iter().enumerate() {
                        let value = number(first + (row + control) * width + at);
                        sum += of_turbidity * of_albedo * weight * value;
                    }
                }
            }
            sum
        };
        let parameter = |k: usize, p: usize| mixed(0, COUNT * PARAMETERS, k * PARAMETERS + p);
        Self {
            parameters: std::array::from_fn(|k| std::array::from_fn(|p| parameter(k, p))),
            radiances: std::array::from_fn(|k| mixed(RADIANCES, COUNT, k)),
            sun: solar_radiance(turbid, share, elevation),
        }
    }

    /// Radiance of the dome, W/(m² sr nm), by the cosine of the angle beside the zenith (0..=1) and the angle
    /// beside the sun.
    pub(crate) fn dome(&self, cos_zenith: f64, beside_sun: f64) -> Spectrum {
        let cos_sun = beside_sun.cos();
        let rayleigh = cos_sun * cos_sun;
        let root = cos_zenith.max(0.0).sqrt();
        std::array::from_fn(|k| {
            let [a, b, c, d, e, f, g, h, i] = self.parameters[k];
            let mie = (1.0 + rayleigh) / (1.0 + i * i - 2.0 * i * cos_sun).powf(1.5);
            let gradient = 1.0 + a * (b / (cos_zenith + 0.01)).exp();
            let glow = c + d * (e * beside_sun).exp() + f * rayleigh + g * mie + h * root;
            (gradient * glow * self.radiances[k]).max(0.0)
        })
    }

    /// Irradiance of the sun on a surface that faces it, W/(m² nm), for a disk of this solid angle (sr).
    pub(crate) fn irradiance(&self, solid_angle: f64) -> Spectrum {
        self.sun.map(|radiance| radiance * solid_angle)
    }
}

/// The number of the turbidity below, from 0, and the share of the one above.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 8")]
fn between(turbidity: f64) -> (usize, f64) {
    let from_one = (turbidity - 1.0).clamp(0.0, TURBIDITIES as f64 - 1.0);
    let below = from_one.floor().min(TURBIDITIES as f64 - 2.0);
    (below as usize, from_one - below)
}

/// Mean radiance of the sun's disk, W/(m² sr nm), at the elevation of its middle, between the turbidity of a number and
/// the next, of which `share` is the share.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 44")]
fn solar_radiance(turbid: usize, share: f64, elevation: f64) -> Spectrum {
    let pieces = PIECES as f64;
    let piece = (pieces * (elevation / FRAC_PI_2).clamp(0.0, 1.0).cbrt()).floor().min(pieces - 1.0);
    let x = elevation - FRAC_PI_2 * (piece / pieces).powi(3);
    std::array::from_fn(|k| {
        let at = |turbid: usize| {
            let first = SUN + ((turbid * PIECES + piece as usize) * COUNT + k) * POWERS;
            (0..POWERS).rev().fold(0.0, |sum, power| sum * x + number(first + power))
        };
        // The mean of cos^i over a disk, by its area, is 2/(i + 2).
        let limb = |i: usize| number(DARKENING + k * LIMB + i) * 2.0 / (i as f64 + 2.0);
        let darkened: f64 = (0..LIMB).map(limb).sum();
        ((1.0 - share) * at(turbid) + share * at(turbid + 1)).max(0.0) * darkened
    })
}

/// The polygon through a value at each wavelength, held from the last to the end of visible light, 0 elsewhere.
pub(crate) fn curve(values: &Spectrum) -> Curve {
    let [first, step, _] = WAVELENGTHS;
    let samples = values.iter().enumerate().map(|(k, &value)| [first + step * k as f64, value]);
    let samples = samples.chain([[HELD, values[COUNT - 1]]]).collect();
    Curve::sampled(samples).unwrap_or(Curve::ONE)
}

/// Last of the authors' wavelengths (nm).
pub(crate) fn last_wavelength() -> f64 {
    WAVELENGTHS[2]
}

/// Rows by which a spectrum becomes bands: band `i` of a [`curve`] is the dot product with row `i`.
///
/// # Errors
///
/// When the sky is known at no wavelength of the bands.
pub(crate) fn rows(bands: &Bands) -> Result<Vec<Spectrum>, NoOverlap> {
    bands.from_curve(&curve(&[1.0; COUNT]), Outside::Zero)?;
    let mut rows = vec![[0.0; COUNT]; bands.count()];
    for k in 0..COUNT {
        let mut hat = [0.0; COUNT];
        hat[k] = 1.0;
        // One wavelength may well have nothing to do with the bands.
        let in_bands = bands.from_curve(&curve(&hat), Outside::Zero).unwrap_or_default();
        for (row, value) in rows.iter_mut().zip(in_bands) {
            row[k] = value;
        }
    }
    Ok(rows)
}

/// The solid angle of a disk by its diameter (degrees), in sr.
pub(crate) fn solid_angle(diameter: f64) -> f64 {
    TAU * (1.0 - (0.5 * diameter).to_radians().cos())
}
