//! Arguments that name a scene, and what of it is overridden.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use etendue_bench::tolerance::Tolerance;
use etendue_files::{Opener, Reach};
use etendue_scene::import::Strictness;
use etendue_scene::{LoadOptions, Setting};
use etendue_tracer::LayerSpec;

use super::parse;

/// A scene, and what of it is overridden.
#[derive(Debug, Clone, Args)]
pub(crate) struct SceneArguments {
    /// A scene (.json), or a model (.gltf, .glb, .obj, .ply) to frame by itself
    #[arg(value_name = "SCENE|MODEL")]
    pub(crate) scene: PathBuf,
    // Not a comment of documentation, whose brackets would be a link.
    #[arg(
        long = "set",
        value_name = "PATH=VALUE",
        value_parser = parse::setting,
        help = "Set any value of the scene, e.g. camera.fov=30 or objects[0].transform.scale=2"
    )]
    pub(crate) settings: Vec<Setting>,
    /// Look through one of the models' own cameras, by its name or number (from 0)
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) camera: Option<String>,
    // Not a comment of documentation, whose names would need backticks.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        value_parser = parse::layer,
        help = format!("Layers to write: {}", LayerSpec::NAMES.join(", "))
    )]
    pub(crate) layers: Option<Vec<String>>,
    /// Axis that points up in OBJ and PLY files, which do not say
    #[arg(long, value_name = "AXIS", value_enum)]
    pub(crate) up: Option<UpArgument>,
    /// Samples per pixel of the picture; data layers take the pixel's centre
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_048_576))]
    pub(crate) samples: Option<u32>,
    /// Seed of the samples
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// The accelerator that finds the hits
    #[arg(long, value_parser = parse::accelerators())]
    pub(crate) accel: Option<String>,
    /// Error that a picture may have, such as "0.5 px, 2 %": what is cheapest within it is taken of the lens and
    /// of the bounces of light. With `plan --models` the share of light may be left out, and is not judged then
    #[arg(long, value_name = "PIXELS, SHARE", value_parser = parse::tolerance)]
    pub(crate) tolerance: Option<Tolerance>,
    /// A glass catalogue in Zemax' AGF format, searched before the built-in one; the last one given is
    /// searched first
    #[arg(long = "glass-catalog", value_name = "FILE")]
    pub(crate) glass_catalogs: Vec<PathBuf>,
    /// Refuse defects of the data (NaN positions, broken images) instead of dropping them
    #[arg(long)]
    pub(crate) strict: bool,
    /// Let the scene name files outside its own folder
    #[arg(long)]
    pub(crate) allow_outside: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum UpArgument {
    /// +Y, as in the scene
    Y,
    /// +Z, as in many CAD and scanning programs
    Z,
}

impl SceneArguments {
    /// Permission of where the scene's files may be.
    pub(crate) fn reach(&self) -> Reach {
        if self.allow_outside { Reach::Anywhere } else { Reach::OwnFolder }
    }

    /// Options by which the scene is to be loaded.
    pub(crate) fn load_options(&self) -> LoadOptions<'_> {
        LoadOptions {
            strictness: if self.strict { Strictness::Strict } else { Strictness::Tolerant },
            opener: Opener::new(self.reach()),
            camera: self.camera.as_deref(),
            ..LoadOptions::default()
        }
    }

    /// The settings and options as overrides of the scene's values, the later the stronger.
    pub(crate) fn overrides(&self) -> Vec<Setting> {
        // Options that stand for keys come after `--set`, and so overrule it.
        let mut overrides = self.settings.clone();
        let mut set = |path: &str, value: String| overrides.push(Setting::new(path, value));
        if let Some(layers) = &self.layers {
            let names: Vec<String> = layers.iter().map(|name| format!("\"{name}\"")).collect();
            set("layers", format!("[{}]", names.join(",")));
        }
        if let Some(up) = self.up {
            let axis = match up {
                UpArgument::Y => "y",
                UpArgument::Z => "z",
            };
            set("up", axis.to_owned());
        }
        if let Some(samples) = self.samples {
            set("render.samples", samples.to_string());
        }
        if let Some(seed) = self.seed {
            set("render.seed", seed.to_string());
        }
        if let Some(accel) = &self.accel {
            set("render.accel", accel.clone());
        }
        if let Some(Tolerance { pixels, light }) = self.tolerance {
            // Without a share of light the scene says what is missing.
            let light = light.map_or_else(String::new, |light| format!(",\"light\":{light}"));
            set("tolerance", format!("{{\"displacement\":{pixels}{light}}}"));
        }
        overrides
    }
}
