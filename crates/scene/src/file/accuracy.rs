//! Numbers that trade accuracy for speed: one table, from which the type, its limits, its page and the plan's
//! rows are made.
//!
//! The manner is that of `GalSim`'s `GSParams` (B. Rowe et al., "GALSIM: The modular galaxy image simulation
//! toolkit", 2015, section 6): every such number has a name, and a scene may set it.

use etendue_camera::SharingLimits;
use etendue_report::{Decision, DecisionKind, DecisionValue};
use etendue_sensor::bands::TOLERANCE;
use etendue_tracer::Rules;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LightPrecision, PlanSpec};

/// A number that trades accuracy for speed, and what there is to know of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccuracySetting {
    /// Its use.
    pub used_for: AccuracyUse,
    /// Its key in `accuracy`.
    pub name: &'static str,
    /// Its path in the scene file.
    pub path: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its meaning.
    pub what: &'static str,
    /// Costs and gains of smaller and greater values.
    pub trade: &'static str,
    /// Its value when the scene does not say.
    pub default: f64,
    /// The least and the greatest that it may be.
    pub range: [f64; 2],
    /// Its value.
    pub value: f64,
}

/// The use of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AccuracyUse {
    /// Bands of light for a sensor.
    Bands,
    /// The choice between f32 and f64 for light.
    LightPrecision,
    /// Rays that bands of light share behind a lens that sends each its own way.
    SharedPaths,
    /// The ends of paths and samples.
    Samples,
    /// Views of a light field.
    Views,
}

/// The type and its table, of rows `use name: type = default, least to greatest, unit, what it is, what it trades`.
macro_rules! accuracy_settings {
    ($($for:ident $name:ident: $kind:ty = $default:expr, $least:literal to $most:literal, $unit:literal, $what:literal, $trade:literal;)*) => {
        /// Numbers that trade accuracy for speed. Each is what the plan's own choices, samples and bands are held
        /// to; what the scene says in `plan` goes before.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct AccuracySpec {
            $(
                #[doc = $what]
                #[schemars(
                    description = concat!($what, " (", $unit, "). ", $trade, "."),
                    range(min = $least, max = $most)
                )]
                pub $name: $kind,
            )*
        }

        impl Default for AccuracySpec {
            fn default() -> Self {
                Self { $($name: $default,)* }
            }
        }

        impl AccuracySpec {
            /// All of them with their values.
            #[must_use]
            pub fn settings(&self) -> Vec<AccuracySetting> {
                let default = Self::default();
                vec![$(AccuracySetting {
                    used_for: AccuracyUse::$for,
                    name: stringify!($name),
                    path: concat!("accuracy.", stringify!($name)),
                    unit: $unit,
                    what: $what,
                    trade: $trade,
                    default: f64::from(default.$name),
                    range: [f64::from($least), f64::from($most)],
                    value: f64::from(self.$name),
                },)*]
            }
        }
    };
}

accuracy_settings! {
    Bands band_error: f64 = TOLERANCE, 1e-6 to 0.5, "share of the electrons",
        "Difference of a sensor's electrons from an integration by 1 nm that the choice of bands allows",
        "Less takes more bands, each of which light carries on every ray, and more where glass disperses: rays of \
         its own";
    LightPrecision path_offset_of_edge: f64 = 0.125, 1e-6 to 1e3, "share of the shortest mean edge of a mesh",
        "Distance by which rays of light may start off surfaces in f32, beyond which light is traced in f64",
        "Less takes f64 sooner, which is slower; more lets starts cross a triangle's edge";
    LightPrecision path_offset_of_extent: f64 = 1e-3, 1e-9 to 1.0, "share of the extent",
        "Distance by which rays of light may start off what they cross in f32, beyond which light is traced in f64",
        "Less takes f64 sooner, which is slower; what such a thing does to light is off by about as much";
    LightPrecision path_noise: f64 = 0.25, 1e-6 to 1e3, "relative, of a pixel of one sample",
        "Noise of light that f32's displacement of the smallest thing is held against, falling with the root of \
         the samples",
        "Less takes f64 sooner, which is slower; more lets edges of small things move by more than noise hides";
    LightPrecision path_clearance: f64 = 8.0, 1.0 to 1e6, "distances of f32's starts",
        "Distance of the next surface that light crosses from which on light may be traced in f32",
        "More takes f64 for wider gaps and walls, which is slower; near 1 rays may skip the next surface";
    LightPrecision path_absorption: f64 = 2.5e-4, 1e-9 to 1.0, "share of the light",
        "Change by f32 of what a medium takes from light between two surfaces, beyond which light is traced in f64",
        "Less takes f64 sooner, which is slower";
    LightPrecision path_probes: u32 = 32_768, 64 to 16_777_216, "triangles",
        "Triangles that are probed for the thin places of what light crosses, at most",
        "More find what is thin over a smaller part of a large mesh, and take longer before the render";
    SharedPaths band_place_error: f64 = SharingLimits::DEFAULT.places, 1e-6 to 1.0, "pixels",
        "Distance from where its own ray would land that light of a band may land at which shares another's",
        "Less traces each shared ray through the lens at more wavelengths, and at last the scene once a band; more \
         displaces colours by as much";
    SharedPaths band_share_error: f64 = SharingLimits::DEFAULT.shares, 1e-9 to 0.5, "share of the light",
        "Difference of what a lens with coatings or dark glass passes of a band that shares another's rays",
        "Less traces each shared ray at more wavelengths, and at last the scene once a band; more is off by as much";
    Samples roulette_after: u32 = Rules::ROULETTE_AFTER, 1 to 1024, "surfaces",
        "Surfaces of a path of the tracer `path` after which it may end by chance",
        "More follow dim paths farther, which takes time; fewer end paths sooner, which adds noise and no bias";
    Samples sample_sigmas: f64 = 2.0, 0.0 to 10.0, "standard errors of a block's variance",
        "Standard errors that are added to the variance of a block of pixels, where samples stop by themselves",
        "Less stops sooner, and half of the blocks above what is allowed at 0; more takes more samples";
    Samples sample_error: f64 = 0.02, 1e-9 to 1.0, "relative error",
        "Error at which samples stop that are to stop at a sensor's noise, where there is none",
        "Less takes more samples, by its square";
    Views view_psnr: f64 = 43.0, 0.0 to 60.0, "dB",
        "Likeness to an ideal lens' that views of a light field have by their rays, at least",
        "More leaves out more of the outer views; under 40 dB views are shown that are bent or cut";
    Views view_color_shift: f64 = 0.02, 0.0 to 1e6, "pixels",
        "Distance of the centres of lenslets' images in bands from which on each band is sampled at its own",
        "Less samples views once a band for less; more leaves that shift in the views' colours";
}

impl AccuracySpec {
    /// True if the scene says nothing of it.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// The settings that are not as they are by themselves.
    fn set(&self) -> impl Iterator<Item = AccuracySetting> {
        self.settings().into_iter().filter(|setting| setting.value != setting.default)
    }

    /// Those as rows of the plan.
    #[must_use]
    pub fn decisions(&self) -> Vec<Decision> {
        let row = |AccuracySetting { name, path, unit, what, default, value, .. }| {
            let reason = format!("{what} ({unit}); {default} by itself");
            Decision::new(DecisionKind::Accuracy, DecisionValue::Number { name, value }, reason)
                .by_key(path)
                .forced(true)
        };
        self.set().map(row).collect()
    }

    /// Limits within which bands share rays of the camera's lens.
    pub(crate) fn sharing(&self) -> SharingLimits {
        SharingLimits { places: self.band_place_error, shares: self.band_share_error }
    }

    /// Contradiction with what the plan is told, or bands that the sensor is given (`has_bands`): the path, and why.
    pub(super) fn contradiction(
        &self,
        plan: &PlanSpec,
        has_bands: bool,
    ) -> Option<(&'static str, String)> {
        let precision = match plan.light_precision {
            LightPrecision::Auto => None,
            LightPrecision::Double => Some("double"),
            LightPrecision::Single => Some("single"),
        };
        self.set().find_map(|setting| match (setting.used_for, precision) {
            (AccuracyUse::Bands, _) if has_bands => {
                let why = "contradicts `bands` of the camera's sensor, which are taken as they are\nhint: leave one \
                           of them out";
                Some((setting.path, why.to_owned()))
            }
            (AccuracyUse::SharedPaths, _) if plan.shared_paths == Some(false) => {
                let why = "contradicts `plan.shared_paths` false, with which no rays are shared\nhint: leave one of \
                           them out";
                Some((setting.path, why.to_owned()))
            }
            (AccuracyUse::LightPrecision, Some(word)) => {
                let why = format!(
                    "contradicts `plan.light_precision` \"{word}\", which decides by itself\nhint: leave one of \
                     them out"
                );
                Some((setting.path, why))
            }
            _ => None,
        })
    }
}
