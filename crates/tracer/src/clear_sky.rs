//! A clear sky and its sun, by the sun's elevation and the turbidity of the air, in physical units: mean spectral
//! radiance, W/(m² sr nm), and irradiance, W/(m² nm). Colours are as lights have them: (1, 1, 1) is the same
//! power at every wavelength.
//!
//! # Sources
//!
//! * The dome: Hosek and Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", SIGGRAPH 2012: in red,
//!   green and blue by the crate `hw-skymodel`, in f32, as linear sRGB of ∫ L(λ) ȳ(λ) dλ; in other bands by
//!   the authors' eleven wavelengths, 320 to 720 nm, between which lie straight lines.
//! * The sun: the same authors' solar radiance (2013) at the same wavelengths.
//! * From 720 to 780 nm the light of 720 nm is held; beyond, the model is dark.
//! * Below the horizon lies the ground: a Lambert plane under that sky and sun.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use etendue_geometry::glam::DVec3;
use etendue_spectrum::{Curve, rgb};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

use crate::spectral_sky::{self, SpectralSky, Spectrum};
use crate::{Color, EnvironmentMap};

/// Angular diameter of the sun (degrees): the mean over the year.
pub const SUN_DIAMETER: f64 = 0.533;

/// ∫ ȳ(λ) dλ of the CIE's observer of 1931 (nm).
const OBSERVER: f64 = 106.857;

/// Linear sRGB of light of the same power at every wavelength (IEC 61966-2-1).
const EQUAL_ENERGY: Color = [1.2048, 0.9484, 0.9087];

/// A clear sky whose sun stands over −Z, with +Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct ClearSky {
    dome: SkyState,
    spectra: SpectralSky,
    /// rad.
    elevation: f64,
    ground_albedo: f64,
    sunlit: bool,
}

impl ClearSky {
    /// Rows of the [`Self::map`] where nothing else is said.
    pub const ROWS: u32 = 512;

    /// A sky over air of a turbidity (1, air without haze, to 10), whose sun stands at `elevation` (degrees, 0..=90)
    /// over ground that reflects `ground_albedo` (0..=1); without a sun of its own where it is not `sunlit`, as
    /// when a cloud hides it. `None` outside of these.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "the model is of f32")]
    pub fn new(turbidity: f64, elevation: f64, ground_albedo: f64, sunlit: bool) -> Option<Self> {
        let elevation = elevation.to_radians();
        let params = SkyParams {
            // Straight up, f32 may round beyond the right angle.
            elevation: (elevation as f32).min(std::f32::consts::FRAC_PI_2),
            turbidity: turbidity as f32,
            albedo: [ground_albedo as f32; 3],
        };
        let dome = SkyState::new(&params).ok()?;
        let known = (0.0..=FRAC_PI_2).contains(&elevation);
        known.then(|| {
            let spectra = SpectralSky::new(turbidity, elevation, ground_albedo);
            Self { dome, spectra, elevation, ground_albedo, sunlit }
        })
    }

    /// Tests whether the sun shines in addition to the dome.
    #[must_use]
    pub fn is_sunlit(&self) -> bool {
        self.sunlit
    }

    /// Direction to the sun (unit).
    #[must_use]
    pub fn toward_sun(&self) -> DVec3 {
        DVec3::new(0.0, self.elevation.sin(), -self.elevation.cos())
    }

    /// Radiance of the dome in a unit direction, W/(m² sr nm); 0 below the horizon.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "the model is of f32")]
    pub fn dome(&self, toward: DVec3) -> Color {
        if toward.y < 0.0 {
            return [0.0; 3];
        }
        let zenith = toward.y.min(1.0).acos() as f32;
        let sun = toward.dot(self.toward_sun()).clamp(-1.0, 1.0).acos() as f32;
        let of = |channel| f64::from(self.dome.radiance(zenith, sun, channel)).max(0.0);
        let seen = [of(Channel::R), of(Channel::G), of(Channel::B)];
        std::array::from_fn(|k| seen[k] / (OBSERVER * EQUAL_ENERGY[k]))
    }

    /// Irradiance of the sun on a surface that faces it, W/(m² nm); 0 where it is hidden.
    #[must_use]
    pub fn sun(&self) -> Color {
        rgb::colour(&self.sun_spectrum()).map(|part| part.max(0.0))
    }

    /// The same as a curve: straight lines between the authors' wavelengths.
    #[must_use]
    pub fn sun_spectrum(&self) -> Curve {
        spectral_sky::curve(&self.sun_at_wavelengths())
    }

    fn sun_at_wavelengths(&self) -> Spectrum {
        match self.sunlit {
            true => self.spectra.irradiance(spectral_sky::solid_angle(SUN_DIAMETER)),
            false => [0.0; spectral_sky::COUNT],
        }
    }

    /// The spectrum of the dome in a unit direction, W/(m² sr nm); 0 below the horizon.
    #[must_use]
    pub fn dome_spectrum(&self, toward: DVec3) -> Curve {
        spectral_sky::curve(&self.dome_at_wavelengths(toward))
    }

    fn dome_at_wavelengths(&self, toward: DVec3) -> Spectrum {
        if toward.y < 0.0 {
            return [0.0; spectral_sky::COUNT];
        }
        let beside_sun = toward.dot(self.toward_sun()).clamp(-1.0, 1.0).acos();
        self.spectra.dome(toward.y.min(1.0), beside_sun)
    }

    /// Spectra that stand for all of the sky: of the zenith, over the sun and across from it, at the horizon below
    /// each, and of the sun itself where it shines.
    #[must_use]
    pub fn typical_spectra(&self) -> Vec<Curve> {
        let places = [
            [0.0, 1.0, 0.0],
            [0.0, 1.0, -1.0],
            [0.0, 1.0, 1.0],
            [0.0, 0.05, -1.0],
            [0.0, 0.05, 1.0],
        ];
        let dome = places.map(|place| self.dome_spectrum(DVec3::from(place).normalize()));
        dome.into_iter().chain(self.sunlit.then(|| self.sun_spectrum())).collect()
    }

    /// Last of the authors' wavelengths (nm).
    #[must_use]
    pub fn last_wavelength() -> f64 {
        spectral_sky::last_wavelength()
    }

    /// All directions as an image of so many `rows` and twice as many columns: the dome, and below the horizon the
    /// ground as that dome and the sun light it; where it is to be `spectral`, at the authors' wavelengths besides.
    #[must_use]
    pub fn map(&self, spectral: bool, rows: u32) -> EnvironmentMap {
        let size = map_size(rows);
        let colors = self.texels(size, |toward| self.dome(toward), self.sun());
        let map = EnvironmentMap::new(size, colors);
        if !spectral {
            return map;
        }
        let dome = |toward| self.dome_at_wavelengths(toward);
        map.with_spectra(self.texels(size, dome, self.sun_at_wavelengths()))
    }

    /// The texels of the map of a dome and of the irradiance of its sun, row by row from the top.
    fn texels<const N: usize>(
        &self,
        [width, height]: [usize; 2],
        dome: impl Fn(DVec3) -> [f64; N],
        sun: [f64; N],
    ) -> Vec<[f32; N]> {
        let mut texels = vec![[0.0_f32; N]; width * height];
        let mut falling = sun.map(|part| part * self.elevation.sin());
        for (y, row) in texels.chunks_mut(width).take(height / 2).enumerate() {
            let (sin, cos) = (PI * (y as f64 + 0.5) / height as f64).sin_cos();
            // Solid angle of a texel, times the cosine on the ground.
            let weight = TAU / width as f64 * PI / height as f64 * sin * cos;
            let (left, right) = row.split_at_mut(width / 2);
            for (x, (own, mirrored)) in left.iter_mut().zip(right.iter_mut().rev()).enumerate() {
                let azimuth = TAU * ((x as f64 + 0.5) / width as f64 - 0.5);
                let toward = DVec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos());
                let radiance = dome(toward);
                falling.iter_mut().zip(radiance).for_each(|(sum, l)| *sum += 2.0 * weight * l);
                *own = single(radiance);
                *mirrored = *own;
            }
        }
        let ground = single(falling.map(|part| self.ground_albedo * part / PI));
        texels[width * height / 2..].fill(ground);
        texels
    }

    /// Bytes of the [`Self::map`], with the table that directions are chosen by.
    #[must_use]
    pub fn map_bytes(spectral: bool, rows: u32) -> u64 {
        let spectra = if spectral { size_of::<[f32; spectral_sky::COUNT]>() } else { 0 };
        let [width, height] = map_size(rows);
        (width * height) as u64 * (EnvironmentMap::LOOK_BYTES + spectra as u64)
    }
}

/// Columns and rows of a map of so many rows, which are even: the horizon lies between two.
fn map_size(rows: u32) -> [usize; 2] {
    let rows = rows.max(2).next_multiple_of(2) as usize;
    [2 * rows, rows]
}

#[expect(clippy::cast_possible_truncation, reason = "radiance is kept as f32")]
fn single<const N: usize>(color: [f64; N]) -> [f32; N] {
    color.map(|part| part as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(turbidity: f64, elevation: f64, albedo: f64) -> ClearSky {
        ClearSky::new(turbidity, elevation, albedo, true).unwrap()
    }

    /// Radiance of Mitsuba 3.9.1's emitter `sunsky` (`scalar_rgb`, `sun_scale` 0) at angles beside the zenith and
    /// azimuths beside the sun (degrees), which divides by 106.7502594 nm and leaves the colours in sRGB. Both
    /// have the authors' tables in f32.
    #[test]
    fn the_dome_is_that_of_another_renderer() {
        let known = [
            ((3.0, 0.2, 40.0), (0.0, 0.0), [0.020_161_49, 0.036_001_1, 0.073_046_4]),
            ((3.0, 0.2, 40.0), (30.0, 0.0), [0.060_086_74, 0.080_950_13, 0.121_529_76]),
            ((3.0, 0.2, 40.0), (60.0, 90.0), [0.036_180_3, 0.065_052_08, 0.119_019_6]),
            ((2.0, 0.0, 30.0), (80.0, 180.0), [0.081_879_69, 0.132_858_92, 0.185_287_48]),
            ((6.5, 0.5, 10.0), (89.0, 45.0), [0.184_121_7, 0.135_062_17, 0.073_162_59]),
            ((1.0, 0.0, 85.0), (60.0, 90.0), [0.028_335_59, 0.058_131_69, 0.115_441_76]),
        ];
        for ((turbidity, albedo, elevation), (zenith, azimuth), radiance) in known {
            let [zenith, azimuth] = [zenith, azimuth].map(f64::to_radians);
            let (sin, cos) = f64::sin_cos(zenith);
            let toward = DVec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos());
            let found = sky(turbidity, elevation, albedo).dome(toward);
            for k in 0..3 {
                let found = found[k] * EQUAL_ENERGY[k] * OBSERVER / 106.750_259_4;
                assert!(
                    (found / radiance[k] - 1.0).abs() < 2e-5,
                    "{turbidity}: {found} {radiance:?}"
                );
            }
        }
    }

    /// Radiance of Mitsuba 3.9.1's emitter `sunsky` (`scalar_spectral`, `sun_scale` 0) at 320, 400, 480, 560, 600, 640
    /// and 680 nm and just below 720 nm, W/(m² sr nm), at angles beside the zenith and azimuths beside the sun.
    #[test]
    #[rustfmt::skip]
    fn the_dome_has_the_authors_spectrum() {
        let known = [
            ((3.0, 0.2, 45.0), (0.0, 0.0), [0.0424873, 0.0888217, 0.0709702, 0.0349222, 0.0275997, 0.02083, 0.0160798, 0.0126169]),
            ((3.0, 0.2, 40.0), (30.0, 0.0), [0.047073, 0.120555, 0.12089, 0.0750203, 0.0639961, 0.0533832, 0.0438048, 0.0362185]),
            ((2.5, 0.3, 30.0), (80.0, 180.0), [0.0326638, 0.171678, 0.224539, 0.13822, 0.113213, 0.0859318, 0.0658299, 0.0512748]),
            ((6.5, 0.5, 10.0), (89.0, 45.0), [0.00370256, 0.0390157, 0.114834, 0.138611, 0.152313, 0.150872, 0.148055, 0.140461]),
            ((1.0, 0.0, 85.0), (60.0, 90.0), [0.0574784, 0.120835, 0.104036, 0.0520721, 0.0379013, 0.0268606, 0.0201439, 0.0151135]),
        ];
        let wavelengths = [320.0, 400.0, 480.0, 560.0, 600.0, 640.0, 680.0, 719.99];
        for ((turbidity, albedo, elevation), (zenith, azimuth), radiance) in known {
            let [zenith, azimuth]: [f64; 2] = [zenith, azimuth].map(f64::to_radians);
            let (sin, cos) = f64::sin_cos(zenith);
            let toward = DVec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos());
            let spectrum = sky(turbidity, elevation, albedo).dome_spectrum(toward);
            for (nm, known) in wavelengths.into_iter().zip(radiance) {
                let found = spectrum.at(nm).unwrap();
                // Both have the authors' numbers in f32, Mitsuba also its arithmetic; six digits are given.
                assert!((found / known - 1.0).abs() < 1e-4, "{turbidity} {nm} nm: {found} {known}");
            }
        }
    }

    /// Irradiance of Mitsuba 3.9.1's sun (its table `sun_irradiance` at turbidity 1 and 3, 90 degrees, W/(m² nm)) from 320
    /// to 720 nm, whose disk is 0.5358 degrees across. It was added up over the disk; at its middle's
    /// elevation the sun is 0.4 % brighter.
    #[test]
    #[rustfmt::skip]
    fn the_sun_is_the_authors() {
        let known = [
            (1.0, [0.11464836, 0.30995774, 0.66303444, 1.0072057, 1.301352, 1.2821264, 1.2463815, 1.2848122, 1.226811, 1.1687655, 1.1024727]),
            (3.0, [0.11247962, 0.30375895, 0.64776254, 0.9817648, 1.2668521, 1.247739, 1.213383, 1.2524931, 1.1969218, 1.1419419, 1.0786877]),
        ];
        for (turbidity, known) in known {
            let found = sky(turbidity, 90.0, 0.2).sun_spectrum();
            let as_large = (0.5358_f64 / SUN_DIAMETER).powi(2);
            for (k, known) in known.into_iter().enumerate() {
                let found = found.at(320.0 + 40.0 * k as f64).unwrap() * as_large;
                assert!((found / known - 1.0).abs() < 6e-3, "{turbidity} {k}: {found} {known}");
            }
        }
        // Lower, in haze, it is dimmer and redder; hidden it is dark.
        let ([red, _, blue], [low, _, low_blue]) = (sky(3.0, 40.0, 0.2).sun(), sky(6.0, 10.0, 0.2).sun());
        assert!(low < red && low_blue / low < 0.5 * blue / red);
        assert_eq!(ClearSky::new(3.0, 40.0, 0.2, false).unwrap().sun(), [0.0; 3]);
    }

    #[test]
    fn the_map_has_the_dome_and_the_ground() {
        let sky = sky(3.0, 40.0, 0.3);
        let map = sky.map(true, ClearSky::ROWS);
        let radiance = |d: DVec3| map.radiance_at(crate::environment::place(d));
        for toward in
            [DVec3::new(0.3, 0.8, -0.5), DVec3::new(-0.7, 0.2, 0.3), DVec3::new(0.1, 0.9, 0.2)]
        {
            let toward = toward.normalize();
            let (found, known) = (radiance(toward), sky.dome(toward));
            for k in 0..3 {
                assert!((found[k] / known[k] - 1.0).abs() < 1e-3, "{found:?} {known:?}");
            }
            let found = map.spectrum_at(crate::environment::place(toward));
            let known = sky.dome_at_wavelengths(toward);
            for k in 0..spectral_sky::COUNT {
                assert!((found[k] / known[k] - 1.0).abs() < 1e-3, "{found:?} {known:?}");
            }
        }
        let ground = radiance(DVec3::new(0.5, -0.5, 0.1).normalize());
        assert_eq!(ground, radiance(DVec3::NEG_Y));
        // The sun alone.
        let least = 0.3 * sky.sun()[1] * 40.0_f64.to_radians().sin() / PI;
        assert!(ground[1] > least && ground[1] < 1.5 * least, "{ground:?} {least}");
    }

    #[test]
    fn a_map_has_the_rows_that_are_asked_for() {
        let sky = sky(3.0, 40.0, 0.3);
        assert_eq!(sky.map(false, ClearSky::ROWS).size(), [1024, 512]);
        // An even number of them.
        assert_eq!(sky.map(true, 31).size(), [64, 32]);
        let bytes = |rows| ClearSky::map_bytes(true, rows);
        assert_eq!(bytes(64), 4 * bytes(32));
    }

    #[test]
    fn what_is_no_sky_is_none() {
        for (turbidity, elevation, albedo) in [
            (0.9, 40.0, 0.2),
            (10.1, 40.0, 0.2),
            (3.0, -1.0, 0.2),
            (3.0, 91.0, 0.2),
            (3.0, 40.0, 1.1),
        ] {
            assert_eq!(ClearSky::new(turbidity, elevation, albedo, true), None);
        }
    }
}
