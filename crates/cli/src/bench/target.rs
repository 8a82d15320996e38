//! `etendue bench --target`: which settings reach a given error of what the sensor records soonest.

use etendue::{Denoiser, Options, Outputs, Progress, Rendering, Session, Setting};
use etendue_accel::AccelName;
use etendue_bench::target::{
    Change, Effort, Outcome, RULES, Run, SAMPLES, Target, WholeRun, measure, rendered_with,
};
use etendue_render::denoise;
use etendue_scene::Scene;
use etendue_scene::file::{AccuracySpec, SceneFile, TracerSpec};
use etendue_tracer::LayerSpec;

use crate::arguments::{BenchArguments, Sweep};
use crate::fault::Fault;
use crate::progress::Phases;
use crate::{job, stop};

/// Time limit of all renders (s), and in a quick run.
const SECONDS: [f64; 2] = [600.0, 50.0];

/// Surfaces to which light is followed, where the scene follows it farther.
const BOUNCES: [u32; 3] = [8, 4, 2];

/// Finds the settings among the changes of `axes`. `scene` is the scene as it is.
pub(super) fn race(
    arguments: &BenchArguments,
    target: f64,
    scene: &Scene,
    phases: Phases,
    axes: &[Vec<Change>],
) -> Result<Target, Fault> {
    if scene.picture != Some(LayerSpec::Radiance) {
        return Err(Fault::refused(
            "--target: the scene has no picture of light, whose error samples could mend\nhint: name a `tracer` such as path",
        ));
    }
    let seconds = arguments.seconds.unwrap_or(SECONDS[usize::from(arguments.quick)]);
    let folder = tempfile::tempdir().map_err(|error| {
        Fault::refused(format!("no folder for temporary files, to write pictures into: {error}"))
    })?;
    let layers = without_sampling(scene);
    let mut program = |run: Run<'_>| match whole_run(arguments, &layers, run, folder.path()) {
        Ok(done) => Ok(Outcome::Done(done)),
        Err(error) if error.is_refused() => Ok(Outcome::Refused(error.to_string())),
        Err(error) => Err(Fault::from(error)),
    };
    let progress = phases.begin("target");
    // The picture that all are compared with has everything.
    let in_full = [Setting::new("tolerance", "null")];
    let effort = Effort { target, seconds };
    measure(axes, &in_full, effort, &mut program, &|share| progress(share))
}

/// Settings that remove a scene's layers of sampling, which there are of samples that stop by
/// themselves alone; nothing where it has none.
fn without_sampling(scene: &Scene) -> Vec<Setting> {
    let is_own = |layer: &&LayerSpec| Some(**layer) != scene.picture;
    let own: Vec<&LayerSpec> = scene.layers.iter().filter(is_own).collect();
    if !own.iter().any(|layer| layer.is_of_sampling()) {
        return Vec::new();
    }
    let kept = own.iter().filter(|layer| !layer.is_of_sampling());
    let written = |layer: &LayerSpec| {
        LayerSpec::NAMES.into_iter().find(|name| LayerSpec::from_name(name) == Some(*layer))
    };
    let names: Vec<String> =
        kept.filter_map(|layer| Some(format!("\"{}\"", written(layer)?))).collect();
    vec![Setting::new("layers", format!("[{}]", names.join(",")))]
}

/// The program from the scene's text to its files, with these `layers` where they are set.
fn whole_run(
    arguments: &BenchArguments,
    layers: &[Setting],
    run: Run<'_>,
    folder: &std::path::Path,
) -> Result<WholeRun, etendue::Error> {
    let mut options =
        Options { memory_limit: arguments.memory_limit, ..job::options(&arguments.scene) };
    let mut settings = rendered_with(&run.contender.settings, run.samples);
    let wanted = settings.len();
    // What is no key of a scene is an output.
    settings.retain(|setting| setting.path != DENOISE);
    options.outputs = Outputs { denoised: settings.len() < wanted, ..Outputs::ALL };
    options.settings.extend(layers.iter().cloned());
    options.settings.extend(settings);
    options.settings.push(Setting::new("render.seed", run.seed.to_string()));
    let progress = Progress::new(|_, _| !stop::asked());
    let outputs = options.outputs;
    let rendering = Session::open_with(&arguments.scene.scene, options)?.render(&progress)?;
    let written = rendering.write_with(folder, outputs, &progress)?;
    let seconds = rendering.report().seconds;
    let before = seconds.load + seconds.decode;
    let trace = (seconds.total - before - seconds.build).max(0.0);
    let stages = [before, seconds.build, trace, written.time.as_secs_f64()];
    let (values, shape) = recorded(&rendering)?;
    Ok(WholeRun { stages, values, shape })
}

/// Mean of what the sensor records in its first exposure, above its black level (DN), as
/// `[row][column][channel]`; of a scene without a sensor the light, clipped at full scale.
fn recorded(rendering: &Rendering) -> Result<(Vec<f64>, [usize; 3]), etendue::Error> {
    if let Some(light) = rendering.sensor_light()
        && let Some(shot) = light.sensor().shots().next()
    {
        let black = light.sensor().black_level();
        let moments = light.moments(shot).map_err(etendue_render::expose::ExposeError::from)?;
        let values = moments.mean.iter().map(|&mean| f64::from(mean) - black).collect();
        return Ok((values, [moments.width, moments.height, moments.depth]));
    }
    let name = if rendering.layer(denoise::DENOISED).is_some() { denoise::DENOISED } else { "" };
    let channels = rendering.layer(name).map_or(&[][..], |layer| &layer.channels);
    let [width, height] = rendering.resolution();
    let of_pixel = |i: usize| channels.iter().map(move |channel| channel.values.at(i).min(1.0));
    Ok(((0..width * height).flat_map(of_pixel).collect(), [width, height, channels.len()]))
}

/// Name that stands for the output `--denoise` among settings.
const DENOISE: &str = "--denoise";

/// Shares of a number's default that it is swept over by itself.
const SWEPT: [f64; 4] = [0.25, 0.5, 2.0, 4.0];

/// Changes of keys that take some values in turn, an axis a key: of a number of `accuracy` without values, shares of
/// its default within its limits.
///
/// # Errors
///
/// When the scene does not take a value.
pub(super) fn sweeps(keys: &[Sweep], file: &SceneFile) -> Result<Vec<Vec<Change>>, Fault> {
    let axis = |Sweep { key, values }: &Sweep| -> Result<Vec<Change>, Fault> {
        let values = match values.is_empty() {
            true => by_itself(key)?,
            false => values.clone(),
        };
        let change = |value: String| {
            let name = format!("{key} {value}");
            let settings = vec![Setting::new(key, value)];
            file.with(&settings)?;
            Ok::<_, Fault>(Change { name, settings })
        };
        values.into_iter().map(change).collect()
    };
    keys.iter().map(axis).collect()
}

/// The values that a number of `accuracy` is swept over.
fn by_itself(key: &str) -> Result<Vec<String>, Fault> {
    let settings = AccuracySpec::default().settings();
    let Some(setting) = settings.iter().find(|setting| setting.path == key) else {
        let known: Vec<&str> = settings.iter().map(|setting| setting.path).collect();
        return Err(Fault::refused(format!(
            "--sweep {key}: no number of `accuracy`, which alone are swept without values\nhint: write --sweep \
             {key}=VALUE,VALUE, or one of {}",
            known.join(", ")
        )));
    };
    let [least, most] = setting.range;
    let whole = setting.default.fract() == 0.0 && least.fract() == 0.0;
    let value = |share: f64| {
        let value = (share * setting.default).clamp(least, most);
        if whole { value.round() } else { value }.to_string()
    };
    let mut values: Vec<String> = SWEPT.into_iter().map(value).collect();
    values.dedup();
    Ok(values)
}

/// Changes that can be made to a scene: lists of which each change excludes the others.
pub(super) fn axes(scene: &Scene) -> Vec<Vec<Change>> {
    let change = |name: &str, path: &str, value: &str| Change {
        name: name.to_owned(),
        settings: vec![Setting::new(path, value)],
    };
    let is_embree = scene.render.accel.unwrap_or_else(AccelName::best) == AccelName::Embree;
    let mut axes = vec![
        vec![
            change("independent samples", "render.sampler", "\"independent\""),
            change("blue noise", "render.sampler", "\"blue_noise\""),
        ],
        vec![
            change("a low build", "plan.build_quality", "\"low\""),
            change("a high build", "plan.build_quality", "\"high\""),
        ],
    ];
    if is_embree {
        axes.push(vec![change("the tree in Rust", "render.accel", "\"bvh\"")]);
        axes.push(vec![
            change("light in f32", "plan.light_precision", "\"single\""),
            change("light in f64", "plan.light_precision", "\"double\""),
        ]);
    }
    if let Some(TracerSpec::Path { max_bounces }) = scene.tracer {
        let fewer = BOUNCES.into_iter().filter(|&bounces| bounces < max_bounces);
        let fewer = fewer.map(|bounces| {
            change(&format!("{bounces} surfaces"), "tracer.max_bounces", &bounces.to_string())
        });
        axes.push(fewer.collect());
    }
    if scene.tolerance.is_none() {
        let tolerance = r#"{"displacement": "0.5 px", "light": "2 %"}"#;
        let mut models = vec![change("a tolerance of 0.5 px, 2 %", "tolerance", tolerance)];
        if scene.camera.lens().is_some() {
            models.push(change("no dispersion", "plan.dispersion", "false"));
        }
        axes.push(models);
    }
    let [relative, noise] = RULES;
    let mut rules = vec![change("samples by the light", SAMPLES, relative)];
    if scene.sensor.is_some() {
        rules.push(change("samples by the sensor's noise", SAMPLES, noise));
    }
    axes.push(rules);
    if scene.camera.lens().is_some() {
        axes.push(vec![
            change("a path for all bands", "plan.shared_paths", "true"),
            change("a path for each band", "plan.shared_paths", "false"),
        ]);
    }
    if !scene.textures.is_empty() {
        axes.push(vec![
            change("images at points", "plan.texture_filter", "false"),
            change("no images", "plan.textures", "false"),
        ]);
    }
    if scene.sensor.is_none() && Denoiser::open(1).is_ok() {
        axes.push(vec![change("denoised", DENOISE, "")]);
    }
    axes.retain(|axis| !axis.is_empty());
    axes
}
