//! Numbers that trade accuracy for speed: one table, from which the type, its limits, its page and the plan's
//! rows are made.
//!
//! The manner is that of `GalSim`'s `GSParams` (B. Rowe et al., "GALSIM: The modular galaxy image simulation
//! toolkit", 2015, section 6): every such number has a name, and a scene may set it.

use etendue_camera::{LensAccuracy, SharingLimits, WaveAccuracy};
use etendue_optics::train::pupil::PupilAccuracy;
use etendue_report::{Decision, DecisionKind, DecisionValue};
use etendue_sensor::bands::TOLERANCE;
use etendue_tracer::{ClearSky, Image, Rules};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{LightPrecision, PlanSpec, ScenePath};

/// Numbers of a lens where the scene says nothing.
const LENS: LensAccuracy = LensAccuracy::DEFAULT;

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

/// The use of a number: by it a scene tells whether the number decides anything there
/// ([`Scene::why_idle`](crate::Scene::why_idle)).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AccuracyUse {
    /// Bands of light for a sensor.
    Bands,
    /// The choice between f32 and f64 for light.
    LightPrecision,
    /// Rays that bands of light share behind a lens that sends each its own way.
    SharedPaths,
    /// Ends of paths by chance.
    Roulette,
    /// Parts of paths at glass that disperses.
    DispersingGlass,
    /// Samples that stop by themselves.
    Stopping,
    /// Samples that are to stop at a sensor's noise, where there is none.
    StoppingWithoutNoise,
    /// Views of a light field.
    Views,
    /// The exit pupil of a lens that is measured by rays.
    Pupils,
    /// The same, of a lens that is not round.
    UnevenPupils,
    /// The part of the sensor where a lens' light arrives.
    ImageCircles,
    /// Coded apertures.
    Masks,
    /// Microlenses.
    Lenslets,
    /// Light that is spread as waves.
    Waves,
    /// Fits of other cameras to a lens.
    Fits,
    /// The search for a simpler lens within a `tolerance`, and its verification.
    LensTolerance,
    /// The verification of what was taken of a `tolerance`.
    Tolerance,
    /// Meshes that change their shapes while the shutter is open.
    Shapes,
    /// Images over surfaces, averaged over footprints.
    Images,
    /// The map of a clear sky.
    Skies,
    /// Mattes of objects.
    Mattes,
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
    LightPrecision path_contact: f64 = 1e-3, 0.0 to 1.0, "share of the probed area",
        "Part of what light crosses that may be thin as a mere contact is, such as a ball's on a floor",
        "Less takes f64 sooner, which is slower; more lets rays skip the next surface over as much of it";
    SharedPaths band_place_error: f64 = LENS.sharing.places, 1e-6 to 1.0, "pixels",
        "Distance from where its own ray would land that light of a band may land at which shares another's",
        "Less traces each shared ray through the lens at more wavelengths, and at last the scene once a band; more \
         displaces colours by as much";
    SharedPaths band_share_error: f64 = LENS.sharing.shares, 1e-9 to 0.5, "share of the light",
        "Difference of what a lens with coatings or dark glass passes of a band that shares another's rays",
        "Less traces each shared ray at more wavelengths, and at last the scene once a band; more is off by as much";
    Roulette roulette_after: u32 = Rules::ROULETTE_AFTER, 1 to 1024, "surfaces",
        "Surfaces of a path of the tracer `path` after which it may end by chance",
        "More follow dim paths farther, which takes time; fewer end paths sooner, which adds noise and no bias";
    DispersingGlass dispersion_paths: u32 = Rules::PARTS, 1 to 4096, "paths",
        "Paths that one is parted into by glass that disperses, at most, of one band each",
        "Fewer leave out bands at random, which adds noise of colours and no bias; more take as much longer there";
    Stopping sample_sigmas: f64 = 2.0, 0.0 to 10.0, "standard errors of a block's variance",
        "Standard errors that are added to the variance of a block of pixels, where samples stop by themselves",
        "Less stops sooner, and half of the blocks above what is allowed at 0; more takes more samples";
    StoppingWithoutNoise sample_error: f64 = 0.02, 1e-9 to 1.0, "relative error",
        "Error at which samples stop that are to stop at a sensor's noise, where there is none",
        "Less takes more samples, by its square";
    Stopping sample_growth: f64 = 0.5, 0.125 to 16.0, "share of the samples that a pixel has",
        "Samples that a pixel gets at once, at most, where samples stop by themselves",
        "Less takes more rounds, in each of which the whole picture is looked at; more takes samples that turn out to \
         be too many";
    Stopping sample_floor: f64 = 0.1, 0.0 to 1.0, "share of a block's mean variance",
        "Variance that each pixel is reckoned to have in any case, where samples stop by themselves",
        "Less takes fewer samples, and stops too early where something small shows in few of them; more spreads them \
         evenly";
    Views view_psnr: f64 = 43.0, 0.0 to 60.0, "dB",
        "Likeness to an ideal lens' that views of a light field have by their rays, at least",
        "More leaves out more of the outer views; under 40 dB views are shown that are bent or cut";
    Views view_color_shift: f64 = 0.02, 0.0 to 1e6, "pixels",
        "Distance of the centres of lenslets' images in bands from which on each band is sampled at its own",
        "Less samples views once a band for less; more leaves that shift in the views' colours";
    Views view_rays: u32 = 256, 16 to 65_536, "rays",
        "Rays in each of two sets by which the light of a view's pixel is measured",
        "More take longer before views are written; fewer leave noise in their light: of 256, a thousandth where it is \
         not cut";
    Views view_cubic_rays: u32 = 1024, 48 to 262_144, "rays",
        "Rays in each of two sets by which a view's pixel is compared with an ideal lens', which colours share",
        "More take longer before views are written; fewer tell the likeness of views less surely: of 1024, up to 47 dB";
    Views view_nodes: u32 = 5, 2 to 64, "lenslets",
        "Lenslets on each side of the array at which views are measured",
        "More follow a lens that changes over the picture, and take longer by their square";
    Views white_samples: u32 = 64, 4 to 16_384, "samples",
        "Samples of a pixel of the white image where it is cut, at rims of images; a quarter of them elsewhere",
        "More take longer; fewer leave noise in all that is divided by the white image";
    Pupils pupil_margin: f64 = LENS.pupil.margin, 0.0 to 0.2, "share of the radius",
        "Margin around the exit pupil as it was measured, within which rays are aimed at it",
        "Less aims fewer rays beside the pupil; too little loses rays at its rim, which darkens the picture";
    Pupils pupil_radial_intervals: u32 = LENS.pupil.radial_intervals, 4 to 1024, "intervals",
        "Places over the sensor's half diagonal between which the pupil of a round lens is interpolated",
        "More aim fewer rays beside the pupil, and take longer before the render";
    UnevenPupils pupil_planar_intervals: u32 = LENS.pupil.planar_intervals, 2 to 128, "intervals",
        "Places over each side of the sensor between which the pupil of any other lens is interpolated",
        "More aim fewer rays beside the pupil, and take longer before the render, by their square";
    Pupils pupil_wavelengths: u32 = LENS.pupil.wavelengths, 2 to 256, "wavelengths",
        "Wavelengths at which the pupil of a lens of glass is measured, at most; at all others it is checked",
        "More take longer before the render; fewer leave more to the check";
    Pupils pupil_checks: u32 = LENS.pupil.checks, 1024 to 4_194_304, "rays",
        "Rays of a round that look for light outside of the measured pupil, which is widened around what they find",
        "More find what is smaller, and take longer before the render; fewer may lose light at the pupil's rim";
    ImageCircles image_circle_error: f64 = LENS.pupil.image_circle, 1e-6 to 0.1, "share of its radius",
        "Precision of the edge of the image circle; that of a round lens is drawn as much wider",
        "Less searches longer before the render; more aims rays where no light arrives";
    Masks mask_aim_error: f64 = LENS.pupil.mask_aim, 1e-4 to 1.0, "share of the mask's pixel",
        "Distance from where it is aimed on a coded aperture at which a ray may land, when polynomials can do it",
        "Less takes polynomials of a higher degree, which cost time on every ray; more stops more rays at the mask";
    Lenslets lenslet_margin: f64 = LENS.pupil.lenslet_margin, 2e-4 to 0.2, "share of its width",
        "Margin around the opening as lenslets see it, which grows until one ray in 2000 is missed at most",
        "Less stops fewer rays, and takes more rounds of the check before the render; more stops more";
    Lenslets lenslet_nodes: u32 = LENS.pupil.lenslet_nodes, 2 to 257, "places",
        "Places on each side of a microlens array between which the opening before it is interpolated",
        "More stop fewer rays, and take longer before the render, by their square";
    Lenslets lenslet_checks: u32 = LENS.pupil.lenslet_checks, 1024 to 4_194_304, "rays",
        "Rays of a round that look for light that no lenslet is aimed at through",
        "More find what is smaller, and take longer before the render; fewer may lose light at rims";
    Waves wavefront_wavelengths: u32 = LENS.waves.wavelengths, 2 to 16, "wavelengths",
        "Wavelengths over all bands at which wavefronts of a lens that disperses are traced; others are interpolated",
        "More follow glass over a wide spectrum, and take as much longer and more memory before light is spread";
    Waves wavefront_error: f64 = LENS.waves.error, 1e-6 to 0.25, "waves",
        "Difference of a wavefront from the polynomial that may stand for it",
        "Less aims a ray at every cell of more pupils, which takes longer; more changes the spread by some thousandths \
         of its peak per hundredth of a wave";
    Waves spread_nodes: u32 = 5, 3 to 17, "places",
        "Places on each side of the picture between which the spread of light is interpolated, but behind ideal lenses",
        "More follow a lens that changes over the picture, and take time and memory by their square";
    Waves spread_wavelengths: u32 = 3, 1 to 64, "wavelengths",
        "Wavelengths of a band whose spreads are added up, at most",
        "More smooth the rings of wide bands, and take as much longer";
    Waves spread_difference: f64 = 5e-3, 0.0 to 2.0, "share of the light",
        "Difference of the spreads in the corners and in the middle up to which one spread does for the whole picture",
        "Less spreads light place by place sooner, which is slower; more takes the middle's spread for the corners'";
    Waves defocus_step: f64 = 0.35, 0.17 to 3.5, "waves",
        "Defocus from one layer of depth to the next near focus; far from it layers are deeper in proportion",
        "Less takes more layers, each of which is spread by itself; more steps from blur to blur where depth changes \
         evenly";
    Waves spread_detail_cells: f64 = 3.0, 1.0 to 16.0, "cells",
        "Cells across the finest detail that the lens draws, wavelength times f-number, on which light is spread",
        "More take time and memory by their square; under 2 detail is lost";
    Waves spread_pixel_cells: u32 = 3, 1 to 16, "cells",
        "Cells on each side of a pixel, at most, on which light is spread",
        "More take time and memory by their square; fewer lose detail of sharp lenses on large pixels";
    Waves illumination_places: u32 = 25, 2 to 513, "places",
        "Places on each side of the picture between which the light that arrives is interpolated, where it is spread \
         as waves",
        "More follow vignetting, and take longer by their square";
    Waves illumination_rays: u32 = 64, 4 to 1024, "rays",
        "Rays on each side of the pupil by which that light is measured",
        "More take longer by their square; fewer leave noise in the vignetting";
    Fits fit_places: u32 = LENS.fit_places, 5 to 513, "places",
        "Places on each side of the picture that OpenCV's camera is fitted to",
        "More follow distortion in between, and take longer by their square";
    LensTolerance tolerance_rays: u32 = 256, 16 to 65_536, "rays",
        "Rays of a place and band by which a simpler model is compared with the lens, under a `tolerance`; a quarter \
         of them for bands in groups",
        "More take longer before the render; fewer compare blur and light with more noise";
    Tolerance tolerance_samples: u32 = 256, 1 to 65_536, "samples",
        "Samples of a pixel of the small pictures by which what was taken of a `tolerance` is verified",
        "More take longer; fewer leave more of a difference to noise";
    Shapes deformation_error: f64 = 1e-3, 1e-6 to 1.0, "pixels",
        "Distance of points from where an animation has them while the shutter is open, by straight lines between \
         steps",
        "Less takes more steps, as its root falls, each of which takes time and memory; more moves surfaces by as much";
    Images texture_lookups: u32 = Image::LOOKUPS, 1 to 64, "lookups",
        "Lookups along what a sample sees of an image, at most, where images are averaged",
        "Fewer blur images that are seen at a slant; more take longer there";
    Skies sky_rows: u32 = ClearSky::ROWS, 16 to 4096, "rows",
        "Rows of the map of a clear sky, which has twice as many columns",
        "More show the brightness around the sun more finely, and take time and memory by their square";
    Mattes matte_samples: u32 = 64, 1 to 1024, "samples",
        "Samples of a pixel of Cryptomatte's mattes, where the picture has fewer",
        "More make finer steps of edges, and take longer";
}

impl AccuracySpec {
    /// True if the scene says nothing of it.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// The settings that are not as they are by themselves.
    pub(crate) fn set(&self) -> impl Iterator<Item = AccuracySetting> {
        self.settings().into_iter().filter(|setting| setting.value != setting.default)
    }

    /// The settings that a scene of these values writes, also as they are by themselves.
    pub(crate) fn written(&self, scene: &Value) -> impl Iterator<Item = AccuracySetting> {
        let all = self.settings().into_iter();
        all.filter(move |setting| ScenePath::of(setting.path).get(scene).is_some())
    }

    /// Those that are not as they are by themselves, as rows of the plan.
    #[must_use]
    pub fn decisions(&self) -> Vec<Decision> {
        self.set().map(AccuracySetting::decision).collect()
    }

    /// Numbers by which the camera's lens is measured.
    pub(crate) fn of_lens(&self) -> LensAccuracy {
        LensAccuracy {
            sharing: SharingLimits { places: self.band_place_error, shares: self.band_share_error },
            pupil: PupilAccuracy {
                margin: self.pupil_margin,
                radial_intervals: self.pupil_radial_intervals,
                planar_intervals: self.pupil_planar_intervals,
                wavelengths: self.pupil_wavelengths,
                checks: self.pupil_checks,
                image_circle: self.image_circle_error,
                mask_aim: self.mask_aim_error,
                lenslet_margin: self.lenslet_margin,
                lenslet_nodes: self.lenslet_nodes,
                lenslet_checks: self.lenslet_checks,
            },
            waves: WaveAccuracy {
                wavelengths: self.wavefront_wavelengths,
                error: self.wavefront_error,
            },
            fit_places: self.fit_places,
        }
    }

    /// Contradiction of what the values `scene` say of these with what the plan is told, or bands that the sensor is
    /// given (`has_bands`): the path, and why.
    pub(super) fn contradiction(
        &self,
        scene: &Value,
        plan: &PlanSpec,
        has_bands: bool,
    ) -> Option<(&'static str, String)> {
        self.written(scene).find_map(|setting| {
            let what = setting.used_for.contradicted(plan, has_bands)?;
            Some((setting.path, format!("contradicts {what}\nhint: leave one of them out")))
        })
    }
}

impl AccuracyUse {
    /// Setting beside which such a number decides nothing, whatever the scene is.
    fn contradicted(self, plan: &PlanSpec, has_bands: bool) -> Option<&'static str> {
        match self {
            Self::Bands if has_bands => {
                Some("`bands` of the camera's sensor, which are taken as they are")
            }
            Self::SharedPaths if plan.shared_paths == Some(false) => {
                Some("`plan.shared_paths` false, with which no rays are shared")
            }
            Self::SharedPaths if plan.dispersion == Some(false) => Some(
                "`plan.dispersion` false, with which no band goes through the lens its own way",
            ),
            Self::Images if plan.textures == Some(false) => {
                Some("`plan.textures` false, with which no image is read")
            }
            Self::Images if plan.texture_filter == Some(false) => {
                Some("`plan.texture_filter` false, with which no image is averaged")
            }
            Self::LightPrecision => match plan.light_precision {
                LightPrecision::Auto => None,
                LightPrecision::Double => {
                    Some("`plan.light_precision` \"double\", which decides by itself")
                }
                LightPrecision::Single => {
                    Some("`plan.light_precision` \"single\", which decides by itself")
                }
            },
            _ => None,
        }
    }
}

impl AccuracySetting {
    /// Its row of the plan.
    pub(crate) fn decision(self) -> Decision {
        let Self { name, path, unit, what, default, value, .. } = self;
        let reason = format!("{what} ({unit}); {default} by itself");
        Decision::new(DecisionKind::Accuracy, DecisionValue::Number { name, value }, reason)
            .by_key(path)
            .forced(true)
    }
}
