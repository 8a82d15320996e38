//! Settings that reach a given error of the sensor's picture soonest, by the time of the whole program.
//!
//! The scene as it is contends with itself under changes: one on every axis (accelerator, precision, sampler, …), and
//! several together. All are rendered with few samples; of each is foretold when it will reach the target, the later
//! half is left out, and the others are rendered with four times as many: successive halving (K. Jamieson & A.
//! Talwalkar, "Non-stochastic best arm identification and hyperparameter optimization", 2016). The soonest is rendered
//! once more, with as many samples as it is foretold to need.
//!
//! The squared error falls with the number of samples n as b² + v/n, where b is what a change misses that no sample
//! mends, and the time rises as a + c n: two renders tell all four. Where the error falls faster, as that of Sobol's
//! points does, what is foretold is late, and the renders that follow mend it.

mod race;

use etendue_scene::Setting;
use serde::Serialize;

pub use self::race::measure;

/// A change of the scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Change {
    /// Its name.
    pub name: String,
    /// Settings of the scene.
    pub settings: Vec<Setting>,
}

/// Settings that contend: the scene under some changes, each of another axis.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Contender {
    /// Its changes by axis and number; none of the scene as it is.
    pub changes: Vec<(usize, usize)>,
    /// Its name.
    pub name: String,
    /// All that is set.
    pub settings: Vec<Setting>,
}

impl Contender {
    /// The scene under changes of `axes`.
    #[must_use]
    pub fn of(axes: &[Vec<Change>], changes: &[(usize, usize)]) -> Self {
        let chosen: Vec<&Change> =
            changes.iter().map(|&(axis, number)| &axes[axis][number]).collect();
        let names: Vec<&str> = chosen.iter().map(|change| &*change.name).collect();
        let name = if names.is_empty() { AS_IT_IS.to_owned() } else { names.join(" + ") };
        let settings = chosen.iter().flat_map(|change| change.settings.iter().cloned()).collect();
        Self { changes: changes.to_vec(), name, settings }
    }
}

/// The path of the number of samples, for which a change may set a rule that stops them.
pub const SAMPLES: &str = "render.samples";

/// A rule that stops samples at a relative error, at the sensor's noise.
pub const RULES: [&str; 2] = ["relative_error", "sensor-noise"];

/// `settings` of a scene rendered with so many samples. A rule has an error that falls as those of so many samples do: one
/// over their root, and a variance of one over them.
#[must_use]
pub fn rendered_with(settings: &[Setting], samples: u32) -> Vec<Setting> {
    let most = samples.saturating_mul(64);
    let variance = 1.0 / f64::from(samples.max(2));
    let [relative, noise] = RULES;
    let mut all = settings.to_vec();
    match all.iter_mut().find(|setting| setting.path == SAMPLES) {
        Some(Setting { value: rule, .. }) if rule == relative => {
            *rule = format!(r#"{{"{relative}": {:.6}, "max": {most}}}"#, variance.sqrt());
        }
        Some(Setting { value: rule, .. }) if rule == noise => {
            *rule = format!(r#"{{"until": "{noise}", "fraction": {variance:.9}, "max": {most}}}"#);
        }
        Some(_) => {}
        None => all.push(Setting::new(SAMPLES, samples.to_string())),
    }
    all
}

/// Name of the scene without changes.
pub const AS_IT_IS: &str = "as the plan takes it";

/// A render of the whole program that is wanted.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// The settings.
    pub contender: &'a Contender,
    /// Samples a pixel.
    pub samples: u32,
    /// Other seeds give other samples.
    pub seed: u64,
}

/// Outcome of a render.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// It was rendered.
    Done(WholeRun),
    /// The scene is not to be had with these settings, and why.
    Refused(String),
}

/// A render of the whole program.
#[derive(Debug, Clone, PartialEq)]
pub struct WholeRun {
    /// Loading, building, tracing and writing, in turn (s).
    pub stages: [f64; 4],
    /// Mean numbers that the sensor records, above its black level: `[row][column][channel]`.
    pub values: Vec<f64>,
    /// Columns, rows and channels.
    pub shape: [usize; 3],
}

impl WholeRun {
    /// All of it (s).
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.stages.iter().sum()
    }
}

/// Error that is sought, and the time that it may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// The error: the root of the mean squared difference to the converged picture, over its mean.
    pub target: f64,
    /// Time that all renders together may take (s): about, since a render is not broken off.
    pub seconds: f64,
}

/// Result of the search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// The error that is sought, as a share of the picture's mean.
    pub target: f64,
    /// Samples of the converged picture, which is the mean of two.
    pub converged: u32,
    /// Its own error, in the same terms.
    pub own_error: f64,
    /// All that was rendered, in turn.
    pub renders: Vec<Render>,
    /// Every contender and when it reaches the target, the soonest first.
    pub contenders: Vec<ContenderForecast>,
    /// The soonest, rendered with as many samples as it needs.
    pub verified: Option<Verification>,
    /// The scene as it is, the soonest and those next to it, each with what fits into the time of the soonest.
    pub equal_time: Vec<EqualTime>,
    /// Their pictures, behind the converged one.
    #[serde(skip)]
    pub strip: Option<Strip>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// A render, and how far it is from the converged picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Render {
    /// The contender's name.
    pub name: String,
    /// Samples a pixel.
    pub samples: u32,
    /// Loading, building, tracing and writing, in turn (s).
    pub stages: [f64; 4],
    /// The whole program (s).
    pub seconds: f64,
    /// The root of the mean squared difference to the converged picture, over its mean.
    pub error: f64,
    /// The mean of squared differences over squared values, to which a hundredth of the squared mean is added (F.
    /// Rousselle et al., "Adaptive sampling and reconstruction using greedy error minimization", 2011).
    pub relative_mse: f64,
}

/// Forecast of when a contender reaches the target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContenderForecast {
    /// Its name.
    pub name: String,
    /// Samples a pixel; `null` where no number is enough.
    pub samples: Option<u32>,
    /// The time of the whole program (s).
    pub seconds: Option<f64>,
    /// Number of times that it was rendered.
    pub renders: usize,
    /// Settings of the scene.
    pub settings: Vec<Setting>,
}

/// The soonest contender, rendered for itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verification {
    /// Its name.
    pub name: String,
    /// Samples a pixel.
    pub samples: u32,
    /// The time that was foretold of so many (s).
    pub foretold: f64,
    /// The time that it took (s).
    pub seconds: f64,
    /// Its error.
    pub error: f64,
}

/// Result of settings in the time that the soonest takes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EqualTime {
    /// Their name.
    pub name: String,
    /// Samples a pixel.
    pub samples: u32,
    /// The time that they took (s).
    pub seconds: f64,
    /// The root of the mean squared difference to the converged picture, over its mean.
    pub error: f64,
    /// As [`Render::relative_mse`].
    pub relative_mse: f64,
}

/// One part of several pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Strip {
    /// Columns and rows of each.
    pub side: [usize; 2],
    /// The column and row of its first pixel.
    pub corner: [usize; 2],
    /// Red, green and blue of each pixel, in rows, of each picture.
    pub pictures: Vec<Vec<u8>>,
}

impl Verification {
    /// By which factor what was foretold is off, above 1.
    #[must_use]
    pub fn factor(&self) -> f64 {
        (self.foretold / self.seconds).max(self.seconds / self.foretold)
    }
}

impl Target {
    /// Result in a sentence or two.
    #[must_use]
    pub fn verdict(&self) -> String {
        let Some(found) = &self.verified else {
            return format!("No settings were seen to reach {} %.", 100.0 * self.target);
        };
        let settings = self.contenders.iter().find(|own| own.name == found.name);
        let settings = settings.map_or(&[][..], |own| &own.settings);
        // What is no key of a scene is an option.
        let word = |Setting { path, value }: &Setting| match path.starts_with("--") {
            true => format!(" {path}"),
            false => format!(" --set '{path}={value}'"),
        };
        let set: String = rendered_with(settings, found.samples).iter().map(word).collect();
        format!(
            "Soonest: {} with {} samples: {:.2} s foretold, {:.2} s taken (a factor of {:.2}), an error of {:.2} %.\n\
             It is rendered with{set}",
            found.name,
            found.samples,
            found.foretold,
            found.seconds,
            found.factor(),
            100.0 * found.error
        )
    }
}
