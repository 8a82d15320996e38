//! A clear sky and its sun, by the sun's elevation and the turbidity of the air, in physical units: mean spectral
//! radiance, W/(m² sr nm), and irradiance, W/(m² nm). Colours are as lights have them: (1, 1, 1) is the same
//! power at every wavelength.
//!
//! # Sources
//!
//! * The dome: Hosek and Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", SIGGRAPH 2012, by the
//!   crate `hw-skymodel`, in f32. Its red, green and blue are linear sRGB of ∫ L(λ) ȳ(λ) dλ.
//! * The sun and what passes the air: Preetham, Shirley and Smits, "A Practical Analytic Model for Daylight",
//!   SIGGRAPH 1999, appendix 1 and table 2: Rayleigh's scattering, Ångström's turbidity and ozone. Water
//!   vapour and oxygen absorb beyond 689 nm, where hardly anything is seen, and are left out.
//! * Below the horizon lies the ground: a Lambert plane under that sky and sun.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use etendue_geometry::glam::DVec3;
use etendue_spectrum::{Curve, rgb};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

use crate::{Color, EnvironmentMap};

/// Angular diameter of the sun (degrees): the mean over the year.
pub const SUN_DIAMETER: f64 = 0.533;

/// ∫ ȳ(λ) dλ of the CIE's observer of 1931 (nm).
const OBSERVER: f64 = 106.857;

/// Linear sRGB of light of the same power at every wavelength (IEC 61966-2-1).
const EQUAL_ENERGY: Color = [1.2048, 0.9484, 0.9087];

/// Columns and rows of the tabulated sky.
const SIZE: [usize; 2] = [1024, 512];

/// Wavelengths of [`SUN`] and [`OZONE`] (nm): the first, and the step to the next.
const WAVELENGTHS: [u32; 2] = [380, 10];

/// Radiance of the sun outside of the air (100 W/(m² sr nm)).
const SUN: [f64; 38] = [
    165.5, 162.3, 211.2, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1,
    278.2, 271.0, 272.3, 263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1,
    228.2, 223.4, 219.7, 215.3, 211.0, 207.3, 202.4, 198.7, 194.3, 190.7, 186.3, 182.6,
];

/// What ozone absorbs (1/cm).
const OZONE: [f64; 38] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.030, 0.040, 0.048,
    0.063, 0.075, 0.085, 0.103, 0.120, 0.120, 0.115, 0.125, 0.120, 0.105, 0.090, 0.079, 0.067,
    0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.010, 0.009,
];

/// Ozone above each place (cm).
const OZONE_DEPTH: f64 = 0.35;

/// A clear sky whose sun stands over −Z, with +Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct ClearSky {
    dome: SkyState,
    turbidity: f64,
    /// rad.
    elevation: f64,
    ground_albedo: f64,
    sunlit: bool,
}

impl ClearSky {
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
        known.then_some(Self { dome, turbidity, elevation, ground_albedo, sunlit })
    }

    /// Whether the sun shines beside the dome.
    #[must_use]
    pub fn is_sunlit(&self) -> bool {
        self.sunlit
    }

    /// Where the sun stands (unit).
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
        if !self.sunlit {
            return [0.0; 3];
        }
        let solid_angle = TAU * (1.0 - (0.5 * SUN_DIAMETER).to_radians().cos());
        let arriving = (0..).zip(SUN.iter().zip(&OZONE)).map(|(step, (sun, ozone))| {
            let nm = f64::from(WAVELENGTHS[0] + step * WAVELENGTHS[1]);
            [nm, 100.0 * sun * solid_angle * self.passed(nm, *ozone)]
        });
        Curve::sampled(arriving.collect())
            .map_or([0.0; 3], |spectrum| rgb::colour(&spectrum).map(|part| part.max(0.0)))
    }

    /// Share of the sun's light of a wavelength (nm) that passes the air, where ozone absorbs that much
    /// (1/cm).
    fn passed(&self, nm: f64, ozone: f64) -> f64 {
        let um = 1e-3 * nm;
        let beside_zenith = 90.0 - self.elevation.to_degrees();
        // Of the air straight up.
        let mass = 1.0 / (self.elevation.sin() + 0.15 * (93.885 - beside_zenith).powf(-1.253));
        let rayleigh = 0.008_735 * um.powf(-4.08);
        let aerosols = (0.046_08 * self.turbidity - 0.045_86) * um.powf(-1.3);
        (-mass * (rayleigh + aerosols + ozone * OZONE_DEPTH)).exp()
    }

    /// All directions as an image: the dome, and below the horizon the ground as that dome and the sun light it.
    #[must_use]
    pub fn map(&self) -> EnvironmentMap {
        let [width, height] = SIZE;
        let mut texels = vec![[0.0_f32; 3]; width * height];
        let mut falling = self.sun().map(|part| part * self.elevation.sin());
        for (y, row) in texels.chunks_mut(width).take(height / 2).enumerate() {
            let (sin, cos) = (PI * (y as f64 + 0.5) / height as f64).sin_cos();
            // Solid angle of a texel, times the cosine on the ground.
            let weight = TAU / width as f64 * PI / height as f64 * sin * cos;
            let (left, right) = row.split_at_mut(width / 2);
            for (x, (own, mirrored)) in left.iter_mut().zip(right.iter_mut().rev()).enumerate() {
                let azimuth = TAU * ((x as f64 + 0.5) / width as f64 - 0.5);
                let toward = DVec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos());
                let radiance = self.dome(toward);
                falling.iter_mut().zip(radiance).for_each(|(sum, l)| *sum += 2.0 * weight * l);
                *own = single(radiance);
                *mirrored = *own;
            }
        }
        let ground = single(falling.map(|part| self.ground_albedo * part / PI));
        texels[width * height / 2..].fill(ground);
        EnvironmentMap::new(SIZE, texels)
    }

    /// Bytes of the [`Self::map`], with the table that directions are chosen by.
    pub const MAP_BYTES: u64 =
        (SIZE[0] * SIZE[1] * (size_of::<[f32; 3]>() + 2 * size_of::<f64>())) as u64;
}

#[expect(clippy::cast_possible_truncation, reason = "radiance is kept as f32")]
fn single(color: Color) -> [f32; 3] {
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

    /// Direct normal irradiance at 550 nm by the same source's formulas, worked out by hand for turbidity 2 and the sun
    /// in the zenith: m = 1/(1 + 0.15 · 93.885^−1.253), optical depths of 0.10013, 0.10072 and 0.02975.
    #[test]
    fn the_sun_is_weakened_by_the_air() {
        let passed = sky(2.0, 90.0, 0.2).passed(550.0, 0.085);
        assert!((passed - 0.7942).abs() < 2e-4, "{passed}");
    }

    /// The sun's light outside of the air is 1.83 to 1.87 W/(m² nm) at 550 nm (ASTM E490-00a: 1.863), the source's
    /// 7 % less. Through clear air (turbidity 3, 40°) Mitsuba 3.9.1's sun, whose radiance in its middle is 17 150 in
    /// green, gives 1.18 where limbs are as bright as the middle and about 0.95 by their darkening: the
    /// models differ, so 25 % are allowed.
    #[test]
    fn the_sun_is_as_bright_as_another_renderers() {
        let [red, green, blue] = sky(3.0, 40.0, 0.2).sun();
        assert!((0.75..1.25).contains(&(green / 1.07)), "{green}");
        assert!(red > blue && green > blue, "{red} {green} {blue}");
        // Lower, in haze, it is dimmer and redder.
        let [low, _, low_blue] = sky(6.0, 10.0, 0.2).sun();
        assert!(low < red && low_blue / low < 0.5 * blue / red);
    }

    #[test]
    fn the_map_has_the_dome_and_the_ground() {
        let sky = sky(3.0, 40.0, 0.3);
        let map = sky.map();
        for toward in
            [DVec3::new(0.3, 0.8, -0.5), DVec3::new(-0.7, 0.2, 0.3), DVec3::new(0.1, 0.9, 0.2)]
        {
            let toward = toward.normalize();
            let (found, known) = (map.radiance(toward), sky.dome(toward));
            for k in 0..3 {
                assert!((found[k] / known[k] - 1.0).abs() < 1e-3, "{found:?} {known:?}");
            }
        }
        let ground = map.radiance(DVec3::new(0.5, -0.5, 0.1).normalize());
        assert_eq!(ground, map.radiance(DVec3::NEG_Y));
        // The sun alone.
        let least = 0.3 * sky.sun()[1] * 40.0_f64.to_radians().sin() / PI;
        assert!(ground[1] > least && ground[1] < 1.5 * least, "{ground:?} {least}");
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
