//! Light sources by name: the CIE's illuminants and black bodies.
//!
//! # Sources
//!
//! * A, D50, D65 and daylight: CIE 15:2018, "Colorimetry", sections 4.1.1 to 4.1.3.
//! * C, fluorescent lamps and LEDs: the tables of `lamps.rs`.
//! * Black body: Planck's law with the exact constants of the SI (2019).

use serde::{Deserialize, Serialize};

use crate::cie::{DAYLIGHT, DAYLIGHT_START, STEP};
use crate::{BOLTZMANN, Curve, PLANCK, SPEED_OF_LIGHT, lamps};

/// A relative spectral power distribution, 1 at 560 nm.
///
/// In JSON: `"equal_energy"`, `"a"`, `"c"`, `"d50"`, `"d65"`, `"fl1"` to `"fl12"`, `"led_b1"` to `"led_b5"`,
/// `"led_bh1"`, `"led_rgb1"`, `"led_v1"`, `"led_v2"`, `{ "daylight": 5600 }` or `{ "black_body": 3200 }` with
/// temperatures in kelvin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Illuminant {
    /// The same power at every wavelength (CIE illuminant E).
    EqualEnergy,
    /// A tungsten lamp (CIE standard illuminant A, a black body near 2856 K).
    A,
    /// Average daylight as it was before D65 (CIE illuminant C).
    C,
    /// Fluorescent lamp: daylight, standard (CIE FL1).
    Fl1,
    /// Fluorescent lamp: cool white, standard (CIE FL2).
    Fl2,
    /// Fluorescent lamp: white, standard (CIE FL3).
    Fl3,
    /// Fluorescent lamp: warm white, standard (CIE FL4).
    Fl4,
    /// Fluorescent lamp: daylight, standard, 6350 K (CIE FL5).
    Fl5,
    /// Fluorescent lamp: light white, standard (CIE FL6).
    Fl6,
    /// Fluorescent lamp: daylight, broad-band, 6500 K (CIE FL7).
    Fl7,
    /// Fluorescent lamp: broad-band, 5000 K (CIE FL8).
    Fl8,
    /// Fluorescent lamp: cool white, broad-band (CIE FL9).
    Fl9,
    /// Fluorescent lamp: three-band, 5000 K (CIE FL10).
    Fl10,
    /// Fluorescent lamp: three-band, 4000 K (CIE FL11).
    Fl11,
    /// Fluorescent lamp: three-band, 3000 K (CIE FL12).
    Fl12,
    /// Phosphor-converted blue LED, 2733 K (CIE LED-B1).
    LedB1,
    /// Phosphor-converted blue LED, 2998 K (CIE LED-B2).
    LedB2,
    /// Phosphor-converted blue LED, 4103 K (CIE LED-B3).
    LedB3,
    /// Phosphor-converted blue LED, 5109 K (CIE LED-B4).
    LedB4,
    /// Phosphor-converted blue LED, 6598 K (CIE LED-B5).
    LedB5,
    /// Blue LED with phosphor, and a red one, 2851 K (CIE LED-BH1).
    LedBh1,
    /// Red, green and blue LEDs, 2840 K (CIE LED-RGB1).
    LedRgb1,
    /// Phosphor-converted violet LED, 2724 K (CIE LED-V1).
    LedV1,
    /// Phosphor-converted violet LED, 4070 K (CIE LED-V2).
    LedV2,
    /// Daylight near the horizon (CIE illuminant D50).
    D50,
    /// Average daylight (CIE standard illuminant D65).
    D65,
    /// A phase of daylight of this correlated colour temperature (K, in 4000..=25000).
    Daylight(f64),
    /// Planck's radiator of this temperature (K).
    BlackBody(f64),
}

/// Error of an illuminant that cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IlluminantError {
    /// The CIE gives daylight for 4000..=25000 K alone.
    #[error("daylight of {0} K asked for: the CIE defines it for 4000..=25000 K")]
    Daylight(f64),
    /// Too cold to shine between [`Illuminant::RANGE`], or no temperature at all.
    #[error("a black body of {0} K asked for: temperatures of 500..=100000 K are possible")]
    BlackBody(f64),
}

impl Illuminant {
    /// The wavelengths at which the CIE's daylight is known (nm).
    pub const RANGE: [f64; 2] = [300.0, 830.0];

    /// Passes the illuminant on when its temperature is possible.
    ///
    /// # Errors
    ///
    /// When it is not, with what is.
    pub fn checked(self) -> Result<Self, IlluminantError> {
        match self {
            Self::Daylight(kelvin) if !(4000.0..=25_000.0).contains(&kelvin) => {
                Err(IlluminantError::Daylight(kelvin))
            }
            Self::BlackBody(kelvin) if !(500.0..=100_000.0).contains(&kelvin) => {
                Err(IlluminantError::BlackBody(kelvin))
            }
            Self::EqualEnergy
            | Self::A
            | Self::D50
            | Self::D65
            | Self::C
            | Self::Fl1
            | Self::Fl2
            | Self::Fl3
            | Self::Fl4
            | Self::Fl5
            | Self::Fl6
            | Self::Fl7
            | Self::Fl8
            | Self::Fl9
            | Self::Fl10
            | Self::Fl11
            | Self::Fl12
            | Self::LedB1
            | Self::LedB2
            | Self::LedB3
            | Self::LedB4
            | Self::LedB5
            | Self::LedBh1
            | Self::LedRgb1
            | Self::LedV1
            | Self::LedV2
            | Self::Daylight(_)
            | Self::BlackBody(_) => Ok(self),
        }
    }

    /// The power distribution, sampled every 5 nm: over [`Self::RANGE`] for daylight, over
    /// 250..=2500 nm for those that a formula gives at any wavelength, 380..=780 nm for lamps of a table (C from 300 nm),
    /// flat for equal energy.
    ///
    /// # Errors
    ///
    /// As [`Self::checked`].
    pub fn curve(self) -> Result<Curve, IlluminantError> {
        let by_formula = |power: &dyn Fn(f64) -> f64| {
            let nm = |i: u32| 250.0 + 5.0 * f64::from(i);
            Curve::trusted((0..=450).map(|i| [nm(i), power(nm(i)) / power(560.0)]).collect())
        };
        Ok(match self.checked()? {
            Self::EqualEnergy => Curve::ONE,
            Self::A => by_formula(&illuminant_a),
            Self::C => tabulated(300.0, &lamps::C),
            Self::Fl1 => tabulated(380.0, &lamps::FLUORESCENT[0]),
            Self::Fl2 => tabulated(380.0, &lamps::FLUORESCENT[1]),
            Self::Fl3 => tabulated(380.0, &lamps::FLUORESCENT[2]),
            Self::Fl4 => tabulated(380.0, &lamps::FLUORESCENT[3]),
            Self::Fl5 => tabulated(380.0, &lamps::FLUORESCENT[4]),
            Self::Fl6 => tabulated(380.0, &lamps::FLUORESCENT[5]),
            Self::Fl7 => tabulated(380.0, &lamps::FLUORESCENT[6]),
            Self::Fl8 => tabulated(380.0, &lamps::FLUORESCENT[7]),
            Self::Fl9 => tabulated(380.0, &lamps::FLUORESCENT[8]),
            Self::Fl10 => tabulated(380.0, &lamps::FLUORESCENT[9]),
            Self::Fl11 => tabulated(380.0, &lamps::FLUORESCENT[10]),
            Self::Fl12 => tabulated(380.0, &lamps::FLUORESCENT[11]),
            Self::LedB1 => tabulated(380.0, &lamps::LED[0]),
            Self::LedB2 => tabulated(380.0, &lamps::LED[1]),
            Self::LedB3 => tabulated(380.0, &lamps::LED[2]),
            Self::LedB4 => tabulated(380.0, &lamps::LED[3]),
            Self::LedB5 => tabulated(380.0, &lamps::LED[4]),
            Self::LedBh1 => tabulated(380.0, &lamps::LED[5]),
            Self::LedRgb1 => tabulated(380.0, &lamps::LED[6]),
            Self::LedV1 => tabulated(380.0, &lamps::LED[7]),
            Self::LedV2 => tabulated(380.0, &lamps::LED[8]),
            // The CIE corrects the nominal temperatures for today's value of Planck's second
            // constant: 1.4388 against 1.4380 cm·K (CIE 15:2018, section 4.1.3, note).
            Self::D50 => daylight(5000.0 * 1.4388 / 1.4380),
            Self::D65 => daylight(6500.0 * 1.4388 / 1.4380),
            Self::Daylight(kelvin) => daylight(kelvin),
            Self::BlackBody(kelvin) => by_formula(&|nm| planck(nm, kelvin)),
        })
    }
}

/// A table of values every 5 nm from `start` (nm), scaled to 1 at 560 nm.
fn tabulated(start: f64, values: &[f64]) -> Curve {
    let at = |(i, &value): (usize, &f64)| [start + STEP * i as f64, value];
    let middle = values.iter().enumerate().map(at).find(|[nm, _]| *nm == 560.0);
    let unit = middle.map_or(1.0, |[_, value]| value);
    Curve::trusted(values.iter().enumerate().map(at).map(|[nm, v]| [nm, v / unit]).collect())
}

/// Spectral radiance of a black body (W·m⁻²·sr⁻¹·nm⁻¹) at `wavelength` (nm) and `kelvin`.
#[must_use]
pub fn planck(wavelength: f64, kelvin: f64) -> f64 {
    let metres = wavelength * 1e-9;
    let exponent = PLANCK * SPEED_OF_LIGHT / (metres * BOLTZMANN * kelvin);
    let per_metre = 2.0 * PLANCK * SPEED_OF_LIGHT.powi(2) / metres.powi(5) / exponent.exp_m1();
    per_metre * 1e-9
}

/// CIE 15:2018, equation 4.1: fixed by its own constants, whatever Planck's are today.
fn illuminant_a(nm: f64) -> f64 {
    let term = |nm: f64| (1.435e7 / (2848.0 * nm)).exp_m1();
    (560.0 / nm).powi(5) * term(560.0) / term(nm)
}

/// CIE 15:2018, equations 4.8 to 4.13; M₁ and M₂ are rounded to three decimals as it demands.
fn daylight(kelvin: f64) -> Curve {
    let inverse = 1e3 / kelvin;
    let cubic = |[a, b, c, d]: [f64; 4]| ((a * inverse + b) * inverse + c) * inverse + d;
    let x = if kelvin <= 7000.0 {
        cubic([-4.6070, 2.9678, 0.099_11, 0.244_063])
    } else {
        cubic([-2.0064, 1.9018, 0.247_48, 0.237_040])
    };
    let y = (-3.0 * x + 2.870) * x - 0.275;
    let m = 0.0241 + 0.2562 * x - 0.7341 * y;
    let rounded = |value: f64| (value * 1e3).round() * 1e-3;
    let m1 = rounded((-1.3515 - 1.7703 * x + 5.9114 * y) / m);
    let m2 = rounded((0.0300 - 31.4424 * x + 30.0717 * y) / m);
    let sample = |(i, [s0, s1, s2]): (usize, &[f64; 3])| {
        let power = 0.01 * (s0 + m1 * s1 + m2 * s2);
        // The bluest skies come out a hair negative at the ends of the tables.
        [DAYLIGHT_START + STEP * i as f64, power.max(0.0)]
    };
    Curve::trusted(DAYLIGHT.iter().enumerate().map(sample).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn daylight_agrees_with_the_published_tables() {
        // ISO/CIE 11664-2, table 1 (D65) and CIE 15:2018, table 6 (D50), divided by 100.
        let d65 = Illuminant::D65.curve().unwrap();
        for (nm, power) in [
            (300.0, 0.000_341),
            (400.0, 0.827_549),
            (560.0, 1.0),
            (700.0, 0.716_091),
            (780.0, 0.633_828),
        ] {
            // The tables carry six figures, the components four or five.
            assert!((d65.at(nm).unwrap() - power).abs() < 1e-5, "{nm}: {:?}", d65.at(nm));
        }
        let d50 = Illuminant::D50.curve().unwrap();
        for (nm, power) in [
            (300.0, 0.000_19),
            (400.0, 0.493_08),
            (500.0, 0.957_24),
            (700.0, 0.916_04),
            (780.0, 0.782_74),
        ] {
            assert!((d50.at(nm).unwrap() - power).abs() < 1e-5, "{nm}: {:?}", d50.at(nm));
        }
    }

    #[test]
    fn illuminant_a_agrees_with_its_table_and_its_black_body() {
        let a = Illuminant::A.curve().unwrap();
        // CIE 15:2018, table 5.
        for (nm, power) in [(300.0, 0.009_304_83), (400.0, 0.147_080), (700.0, 1.982_61)] {
            assert!((a.at(nm).unwrap() / power - 1.0).abs() < 2e-5, "{nm}: {:?}", a.at(nm));
        }
        let body = Illuminant::BlackBody(2856.0).curve().unwrap();
        for &[nm, power] in a.samples() {
            // 2848 K · 1.4388/1.4350 is 2855.5 K: half a kelvin, which moves 300 nm by 3e-3.
            assert!((body.at(nm).unwrap() / power - 1.0).abs() < 5e-3, "{nm}");
        }
    }

    #[test]
    fn planck_keeps_wien_and_stefan_boltzmann() {
        let peak = (400_000..600_000)
            .map(|i| f64::from(i) * 1e-3)
            .max_by(|&a, &b| planck(a, 5772.0).total_cmp(&planck(b, 5772.0)));
        // Wien: 2.897771955e6 nm·K (CODATA 2018), to the step of the search.
        assert!((peak.unwrap() - 2.897_771_955e6 / 5772.0).abs() < 1e-3);
        let total: f64 = (1..400_000).map(|i| planck(f64::from(i), 3000.0)).sum();
        let law = 5.670_374_419e-8 * 3000f64.powi(4) / std::f64::consts::PI;
        // Beyond 400 µm lie less than 1e-6 of the power.
        assert!((total / law - 1.0).abs() < 2e-6, "{}", total / law);
    }

    #[test]
    fn impossible_temperatures_are_refused() {
        assert_eq!(Illuminant::Daylight(3000.0).curve(), Err(IlluminantError::Daylight(3000.0)));
        for kelvin in [0.0, -1.0, f64::NAN, 1e9] {
            assert!(Illuminant::BlackBody(kelvin).curve().is_err(), "{kelvin}");
        }
        let named: Illuminant = serde_json::from_str(r#"{ "black_body": 3200 }"#).unwrap();
        assert_eq!(named, Illuminant::BlackBody(3200.0));
        assert_eq!(serde_json::from_str::<Illuminant>("\"d65\"").unwrap(), Illuminant::D65);
    }
}
