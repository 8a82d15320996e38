//! In which unit the values of a picture are, and what makes irradiance on a sensor of them.

use std::f64::consts::PI;
use std::fmt;

use etendue_scene::Scene;
use etendue_sensor::Radiometry;

/// Unit of a picture's values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightUnit {
    /// Intensities, of which 1 is full scale: for sensors of `digital` radiometry.
    FullScale,
    /// Spectral radiance: so many W·m⁻²·sr⁻¹·nm⁻¹ are a value of 1.
    Radiance(f64),
    /// Spectral irradiance on the sensor: so many W·m⁻²·nm⁻¹ are a value of 1.
    Irradiance(f64),
}

/// The unit of spectral radiance as files have it.
const RADIANCE: &str = "W.m^-2.sr^-1.nm^-1";

/// The unit of spectral irradiance as files have it.
const IRRADIANCE: &str = "W.m^-2.nm^-1";

/// The one word that the layout of Fichet et al. (2021) has for emission. Those who write it, pbrt and ART among
/// them, mean radiance a nanometre.
const LAYOUT_WORD: &str = "W.m^-2.sr^-1";

/// Known ways to write a unit.
pub const KNOWN_UNITS: &str = "1 (1 is full scale), W/m2/sr/nm (spectral radiance) or W/m2/nm (spectral irradiance on the \
                               sensor), with mW, uW, cm2, um and the like";

impl LightUnit {
    /// Of the picture of `scene`, as its sensor takes it.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        match scene.sensor.as_ref().map(etendue_sensor::Sensor::radiometry) {
            None | Some(Radiometry::Digital) => Self::FullScale,
            Some(Radiometry::Physical) => match scene.camera.pupil_solid_angle() {
                Some(_) => Self::Radiance(1.0),
                None => Self::Irradiance(1.0),
            },
        }
    }

    /// From the words of a user or a file: `1`, `W/m2/sr/nm`, `W.m^-2.sr^-1.nm^-1`, `µW/(cm² sr nm)`.
    ///
    /// # Errors
    ///
    /// When it is none; the message names those that are known.
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if text == "1" || text.starts_with("1 (") {
            return Ok(Self::FullScale);
        }
        if text == LAYOUT_WORD {
            return Ok(Self::Radiance(1.0));
        }
        let wrong =
            || format!("\"{}\" is no unit of light; known: {KNOWN_UNITS}", text.escape_debug());
        let mut powers = Powers::default();
        powers.read(&plain(text), 1).ok_or_else(wrong)?;
        match powers {
            Powers { watt: 1, area: true, wavelength: true, steradian: -1, factor } => {
                Ok(Self::Radiance(factor))
            }
            Powers { watt: 1, area: true, wavelength: true, steradian: 0, factor } => {
                Ok(Self::Irradiance(factor))
            }
            _ => Err(wrong()),
        }
    }

    /// W·m⁻²·nm⁻¹ on the sensor, of a value of 1 in a picture of this unit behind a pupil of this projected solid
    /// angle (sr); 1 of intensities.
    #[must_use]
    pub fn irradiance(self, solid_angle: f64) -> f64 {
        match self {
            Self::FullScale => 1.0,
            Self::Radiance(factor) => factor * solid_angle,
            Self::Irradiance(factor) => factor,
        }
    }
}

impl fmt::Display for LightUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (factor, unit) = match self {
            Self::FullScale => return f.write_str("1"),
            Self::Radiance(factor) => (factor, RADIANCE),
            Self::Irradiance(factor) => (factor, IRRADIANCE),
        };
        match *factor == 1.0 {
            true => f.write_str(unit),
            false => write!(f, "{factor} {unit}"),
        }
    }
}

/// The projected solid angle (sr) of a pupil as the centre of the sensor sees it: E = Ω L, with
/// Ω = π / (1 + 4 N² (1 + m)²) for an aplanatic lens of f-number N, focused at the magnification m.
///
/// Source: E. Hecht, *Optics*, section 5.3; R. W. Boyd, *Radiometry and the Detection of Optical Radiation*,
/// chapter 5: E = π L sin²θ, with tan θ = 1 / (2 N (1 + m)).
#[must_use]
pub fn pupil_solid_angle(f_number: f64, magnification: f64) -> f64 {
    let working = 2.0 * f_number * (1.0 + magnification);
    PI / (1.0 + working * working)
}

/// Powers of the base units in a product.
#[derive(Debug, Clone, Copy, Default)]
struct Powers {
    watt: i32,
    steradian: i32,
    /// True if there is one area below the line.
    area: bool,
    /// True if there is one length of a wavelength below the line.
    wavelength: bool,
    /// To W, m², sr and nm; 0 is none yet.
    factor: f64,
}

/// `text` with ASCII's signs alone.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    let mut is_raised = false;
    for c in text.replace("**", "^").chars() {
        let raised = match c {
            '⁻' => Some('-'),
            '¹' => Some('1'),
            '²' => Some('2'),
            '³' => Some('3'),
            _ => None,
        };
        if let Some(raised) = raised {
            if !is_raised {
                plain.push('^');
            }
            plain.push(raised);
        } else {
            plain.push(match c {
                'µ' | 'μ' => 'u',
                '·' | '⋅' | '.' | '*' | '_' => ' ',
                other => other,
            });
        }
        is_raised = raised.is_some();
    }
    plain
}

impl Powers {
    /// Multiplies by the units of `text`, to the power `sign`.
    fn read(&mut self, text: &str, sign: i32) -> Option<()> {
        if self.factor == 0.0 {
            self.factor = 1.0;
        }
        let mut rest = text.trim_start();
        // What follows a line goes below it: one unit, or all in brackets.
        let mut below = false;
        while !rest.is_empty() {
            let own = if below { -sign } else { sign };
            if let Some(after) = rest.strip_prefix('/') {
                if below {
                    return None;
                }
                (below, rest) = (true, after.trim_start());
                continue;
            }
            if let Some(after) = rest.strip_prefix('(') {
                let (inner, behind) = after.split_once(')')?;
                if inner.contains('(') {
                    return None;
                }
                self.read(inner, own)?;
                (below, rest) = (false, behind.trim_start());
                continue;
            }
            let end = rest.find(|c: char| c == '/' || c == '(' || c.is_whitespace());
            let (word, behind) = rest.split_at(end.unwrap_or(rest.len()));
            self.unit(word, own)?;
            (below, rest) = (false, behind.trim_start());
        }
        (!below).then_some(())
    }

    /// Multiplies by `m^-2`, `cm2` or `nm`.
    fn unit(&mut self, word: &str, sign: i32) -> Option<()> {
        let letters = word.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(word.len());
        let (name, power) = word.split_at(letters);
        let power = power.strip_prefix('^').unwrap_or(power);
        let power: i32 = if power.is_empty() { 1 } else { power.parse().ok()? };
        let power = sign * power;
        let watts = [
            ("W", 1.0),
            ("w", 1.0),
            ("kW", 1e3),
            ("mW", 1e-3),
            ("uW", 1e-6),
            ("uw", 1e-6),
            ("nW", 1e-9),
        ];
        if let Some((_, factor)) = watts.iter().find(|(known, _)| *known == name) {
            self.watt += power;
            self.factor *= factor;
            return (power == 1).then_some(());
        }
        if name == "sr" {
            self.steradian += power;
            return Some(());
        }
        let lengths: [(&str, f64); 6] =
            [("m", 1.0), ("dm", 0.1), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9)];
        let (_, metres) = lengths.iter().find(|(known, _)| *known == name)?;
        let to_area = metres.powi(-2);
        let to_wavelength = 1e-9 / metres;
        match power {
            -2 if !self.area => (self.area, self.factor) = (true, self.factor * to_area),
            -1 if !self.wavelength => {
                // A nanometre is one, not nearly.
                let factor = if name == "nm" { 1.0 } else { to_wavelength };
                (self.wavelength, self.factor) = (true, self.factor * factor);
            }
            -3 if !self.area && !self.wavelength => {
                (self.area, self.wavelength) = (true, true);
                self.factor *= to_area * to_wavelength;
            }
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_people_and_programs_write_them() {
        for (text, radiance, factor) in [
            ("W/m2/sr/nm", true, 1.0),
            ("W.m^-2.sr^-1.nm^-1", true, 1.0),
            ("W.m^-2.sr^-1", true, 1.0),
            ("W·m⁻²·sr⁻¹·nm⁻¹", true, 1.0),
            ("W m-2 sr-1 nm-1", true, 1.0),
            ("W/(m^2 sr nm)", true, 1.0),
            ("µW/(cm² sr nm)", true, 1e-2),
            ("uW/cm^2/nm/sr", true, 1e-2),
            ("mW/(m**2*sr*nm)", true, 1e-3),
            ("W/m^2/um/sr", true, 1e-3),
            ("W/m3/sr", true, 1e-9),
            ("W/m2/nm", false, 1.0),
            ("W/(m^2*um)", false, 1e-3),
            ("mW cm-2 um-1", false, 1e-2),
        ] {
            let (is_radiance, found) = match LightUnit::parse(text) {
                Ok(LightUnit::Radiance(factor)) => (true, factor),
                Ok(LightUnit::Irradiance(factor)) => (false, factor),
                other => panic!("{text}: {other:?}"),
            };
            // Products of three decimal factors, each rounded.
            assert!(
                is_radiance == radiance && (found / factor - 1.0).abs() < 1e-14,
                "{text}: {found}"
            );
        }
        for text in ["1", "1 (linear light; R G B: sRGB primaries)"] {
            assert_eq!(LightUnit::parse(text), Ok(LightUnit::FullScale));
        }
        for text in [
            "",
            "W",
            "lux",
            "W/m2",
            "W/m2/sr",
            "W/m2/Hz/sr",
            "W/m2//sr/nm",
            "J/m2/sr/nm",
            "W/m2/m2/nm",
            "W/(m2 sr nm",
            "W2/m2/nm",
            "W/m2/sr/nm/",
            "W/m^99999999999/nm",
        ] {
            let why = LightUnit::parse(text).unwrap_err();
            assert!(why.contains("W/m2/sr/nm (spectral radiance)"), "{text}: {why}");
        }
        for unit in [LightUnit::FullScale, LightUnit::Radiance(1.0), LightUnit::Irradiance(1.0)] {
            assert_eq!(LightUnit::parse(&unit.to_string()), Ok(unit));
        }
    }

    #[test]
    fn a_wide_pupil_fills_the_hemisphere_and_a_small_one_is_a_disc() {
        assert!((pupil_solid_angle(1e-9, 0.0) - PI).abs() < 1e-12);
        // π/(4 N²) but for the 1 below the line: 1/(4·64²) of it.
        assert!((pupil_solid_angle(64.0, 0.0) * 4.0 * 64.0 * 64.0 / PI - 1.0).abs() < 1e-4);
        // A working f-number of 2 N at life size.
        assert_eq!(pupil_solid_angle(2.0, 1.0), pupil_solid_angle(4.0, 0.0));
    }
}
