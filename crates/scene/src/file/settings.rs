//! Settings of a scene's picture, and of how it is rendered.

use etendue_accel::AccelName;
use etendue_camera::sampler::Sampler;
use etendue_geometry::units::Seconds;
use etendue_tracer::{LayerSpec, Rules};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ImuSpec, SamplesSpec};

/// Content of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum TracerSpec {
    /// Base colour under a headlight, to look at.
    Facing {},
    /// Base colour without light.
    Flat {},
    /// Light that one surface sends to the camera, with shadows.
    Direct {},
    /// The same, seen through mirrors and clear glass.
    Whitted {
        /// The most surfaces on a path.
        #[serde(default = "default_whitted_bounces")]
        #[schemars(range(min = 1, max = 1024))]
        max_bounces: u32,
    },
    /// Global illumination.
    Path {
        /// The most surfaces on a path.
        #[serde(default = "default_path_bounces")]
        #[schemars(range(min = 1, max = 1024))]
        max_bounces: u32,
    },
}

fn default_whitted_bounces() -> u32 {
    16
}

fn default_path_bounces() -> u32 {
    32
}

/// A row of the table of tracers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TracerRow {
    /// The word behind `type` in the file.
    pub name: &'static str,
    /// The layer that holds the picture.
    pub layer: LayerSpec,
    /// Light transport of the tracer; `None` where it traces no light.
    pub light: Option<LightRow>,
}

/// Light transport of a tracer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LightRow {
    /// Rules of where paths end.
    pub rules: Rules,
    /// Reach of light that is followed, in words.
    pub reach: String,
    /// Light that the picture shows, in words.
    pub shows: &'static str,
}

impl TracerSpec {
    /// Description of the tracer. A picture without light is a layer that is filled for itself.
    #[must_use]
    pub fn row(self) -> TracerRow {
        let seen = |name, layer| TracerRow { name, layer, light: None };
        let lit = |name, rules, reach, shows| {
            let light = Some(LightRow { rules, reach, shows });
            TracerRow { name, layer: LayerSpec::Radiance, light }
        };
        match self {
            Self::Facing {} => seen("facing", LayerSpec::Facing),
            Self::Flat {} => seen("flat", LayerSpec::Flat),
            Self::Direct {} => {
                lit("direct", Rules::direct(), "1 bounce".to_owned(), "light of one surface")
            }
            Self::Whitted { max_bounces } => lit(
                "whitted",
                Rules::whitted(max_bounces),
                format!("at most {max_bounces} mirrors"),
                "direct light through mirrors and glass",
            ),
            Self::Path { max_bounces } => lit(
                "path",
                Rules::path(max_bounces),
                format!("at most {max_bounces}"),
                "light of any number of surfaces, up to its limit",
            ),
        }
    }

    /// The layer that holds the picture.
    #[must_use]
    pub fn layer(self) -> LayerSpec {
        self.row().layer
    }

    /// The word behind `type` in the file.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name
    }
}

/// Settings of the render. The command line's options of the same names go before these.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderSpec {
    /// Samples a pixel of the picture: a number, or what they are to reach. Layers take the pixel's chief
    /// ray alone.
    #[serde(default = "one")]
    pub samples: SamplesSpec,
    /// Rule for the places of samples in their pixels.
    #[serde(default)]
    pub sampler: Sampler,
    /// Another seed gives other samples.
    #[serde(default)]
    pub seed: u64,
    /// The number of the frame, which has random numbers of its own: those of the light's samples and of the
    /// sensor's noise. Each of a scene's `frames` has its own number; here it stands for a single picture.
    #[serde(default, skip_serializing_if = "is_first")]
    pub frame: u32,
    /// True if all frames have the random numbers of frame 0, so that noise stands still while things move.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub frozen_noise: bool,
    /// When the frame is taken (s, in the scene's clock): the moment at which its shutter opens. When absent, its
    /// number over `rate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<Seconds>,
    /// Frames a second, by which frames without a time of their own are taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// An inertial unit on the camera, whose readings are written beside the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imu: Option<ImuSpec>,
    /// Accelerator that finds the hits; the best that was built in when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<AccelName>,
    /// Brightness of `picture.png`: stops, each of which doubles the light, or `"auto"`. EXR and NPY
    /// keep the radiance as it is.
    #[serde(default)]
    pub exposure: Exposure,
    /// Curve that brings light above full scale into the range of `picture.png`.
    #[serde(default)]
    pub tone_map: ToneMap,
    /// True if the background of `picture.png` is transparent; adds the layers `Alpha` and, with a
    /// tracer of light, `Backdrop`.
    #[serde(default)]
    pub alpha: bool,
}

/// Decisions that the plan is given instead of making them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanSpec {
    /// Precision of paths' hits on surfaces. Data layers are always in f64.
    #[serde(default)]
    pub light_precision: LightPrecision,
    /// Time that the build of the structure may take; by the number of rays when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub build_quality: Option<BuildQuality>,
    /// True if surfaces that no ray of the data layers can meet are built into the structure all the same. They
    /// are left out when absent, where nothing but data layers is traced; the files are the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen: Option<bool>,
    /// True if hits that data layers and light in f64 are made of are solved again in f64, false if they are
    /// taken as Embree finds them in f32.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refine: Option<bool>,
    /// True if images of materials are read where a layer shows colour, false if materials have their
    /// factors alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub textures: Option<bool>,
    /// True if rays of each band run by the lens' indices at its own wavelengths, false if those of all bands run
    /// together, as at the design wavelength, so that the lens shows no colour errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dispersion: Option<bool>,
    /// True if the bands of a picture share the paths of the scene behind a lens that sends each its own way, where
    /// they can, false if the scene is traced for each band. When absent they share paths of several surfaces, and
    /// direct light in more than eight bands, unless samples stop at an error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shared_paths: Option<bool>,
    /// True if images are averaged over what a sample covers; where the camera tells that when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture_filter: Option<bool>,
}

/// Time that the build of the structure may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BuildQuality {
    /// The least.
    Low,
    /// The choice that pays for most pictures.
    Medium,
    /// The most, for the quickest rays.
    High,
}

impl PlanSpec {
    /// Contradiction with something else of these, or the accelerator that the scene names: the key, and why.
    pub(super) fn contradiction(&self, accel: Option<AccelName>) -> Option<(&'static str, String)> {
        match (self.refine, accel.filter(|accel| !accel.has_single())) {
            (Some(false), Some(accel)) => {
                let why = format!(
                    "`{}` works in f64 alone\nhint: leave this out, or take `embree`",
                    accel.name()
                );
                return Some(("refine", why));
            }
            (Some(false), None) if self.light_precision == LightPrecision::Double => {
                let why = "contradicts `light_precision` \"double\": without it there are hits in f32 \
                           alone\nhint: leave one of them out";
                return Some(("refine", why.to_owned()));
            }
            _ => {}
        }
        (self.textures == Some(false) && self.texture_filter == Some(true)).then(|| {
            let why = "contradicts `textures` false: no image is read that could be averaged\nhint: leave one \
                       of them out";
            ("texture_filter", why.to_owned())
        })
    }
}

/// Precision of paths' hits on surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightPrecision {
    /// In f32 where its error is lost in the noise, in f64 where it is not.
    #[default]
    Auto,
    /// In f64.
    Double,
    /// In f32.
    Single,
}

/// The exposure of a PNG.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Exposure {
    /// Light is multiplied by 2 to this power.
    Stops(#[schemars(range(min = -100, max = 100))] f64),
    /// By the picture's own light.
    Auto(Auto),
}

impl Exposure {
    /// By the picture's own light.
    pub const AUTO: Self = Self::Auto(Auto::Auto);
}

impl Default for Exposure {
    fn default() -> Self {
        Self::Stops(0.0)
    }
}

/// The word `auto`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Auto {
    /// The program chooses.
    Auto,
}

/// Curve that brings light above full scale into range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneMap {
    /// Nothing: it is clipped.
    #[default]
    None,
    /// Sobotka's `AgX`.
    Agx,
    /// The Academy's ACES.
    Aces,
}

impl RenderSpec {
    /// Time of the frame (s, in the scene's clock); 0 where nothing says so.
    #[must_use]
    pub fn time(&self) -> f64 {
        match (self.time, self.rate) {
            (Some(Seconds(time)), _) => time,
            (None, Some(rate)) => f64::from(self.frame) / rate,
            (None, None) => 0.0,
        }
    }

    /// The seed of all random numbers of this frame: the seed itself for frame 0 and for frozen noise.
    #[must_use]
    pub fn frame_seed(&self) -> u64 {
        if self.frame == 0 || self.frozen_noise {
            return self.seed;
        }
        let [a, b, c, d] = self.frame.to_le_bytes();
        etendue_sensor::mixed_seed(self.seed, &[b'f', b'r', b'a', b'm', a, b, c, d])
    }
}

fn is_first(frame: &u32) -> bool {
    *frame == 0
}

fn one() -> SamplesSpec {
    SamplesSpec::Count(1)
}

impl Default for RenderSpec {
    fn default() -> Self {
        let sampler = Sampler::default();
        let (exposure, tone_map) = Default::default();
        let (seed, frame, frozen_noise) = Default::default();
        let (accel, alpha) = Default::default();
        Self {
            samples: one(),
            sampler,
            seed,
            frame,
            frozen_noise,
            time: None,
            rate: None,
            imu: None,
            accel,
            exposure,
            tone_map,
            alpha,
        }
    }
}
