//! Scenes from text to pixels, by the whole program.

use anyhow::{Context, Result, ensure};
use etendue_accel::BuildOptions;
use etendue_geometry::{HitPrecision, Mesh};
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, build, plan, render};
use etendue_scene::file::{LightPrecision, SceneFile};
use etendue_scene::{LoadOptions, Scene};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// A scene file's text in a folder of its own, or beside the images that it names.
pub(crate) fn load(folder: &Path, text: &str) -> Result<Scene> {
    let path = folder.join("scene.json");
    std::fs::write(&path, text)?;
    let file = SceneFile::read(&path, &[])?;
    Ok(file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())?)
}

/// The scene of a text that names no files.
pub(crate) fn scene(text: &str) -> Result<Scene> {
    load(tempfile::tempdir()?.path(), text)
}

/// Red of all pixels.
#[derive(Debug)]
pub(crate) struct Pixels {
    /// Of the hits of light.
    pub(crate) precision: HitPrecision,
    pub(crate) values: Vec<f64>,
    /// The variance that the program tells of each, where the scene asks for that layer.
    pub(crate) variances: Vec<f64>,
    /// Contributions that were not finite, and were left out.
    pub(crate) not_finite: u64,
    /// Notes on them.
    pub(crate) notes: Vec<String>,
}

impl Pixels {
    /// Of `scene`, with the default accelerator.
    pub(crate) fn of(scene: &Scene) -> Result<Self> {
        let plan = Plan::new(scene, Outputs::from_list("exr").map_err(anyhow::Error::msg)?);
        let accel = build(scene, &plan, &BuildOptions::default())?;
        let images = Images::decode(scene, &plan, None)?;
        ensure!(images.faults.is_empty(), "{:?}", images.faults);
        let done = render(scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true)?;
        let layers = done.picture.layers();
        let first_channel = |layer: &etendue_render::output::Layer| -> Result<Vec<f64>> {
            let channel = layer.channels.first().context("a layer has a channel")?;
            Ok((0..channel.values.len()).map(|i| channel.values.at(i)).collect())
        };
        let values = first_channel(layers.first().context("a picture has a layer")?)?;
        let variance = layers.iter().find(|layer| layer.name == "Variance");
        let variances = variance.map(first_channel).transpose()?.unwrap_or_default();
        let precision = plan.light_precision;
        let not_finite = done.light.not_finite;
        Ok(Self { precision, values, variances, not_finite, notes: done.notes })
    }

    /// Of the scene in `text`.
    pub(crate) fn read(text: &str) -> Result<Self> {
        Self::of(&scene(text)?)
    }

    /// Of `scene` with hits in f64 and, whatever the plan would take, in f32.
    pub(crate) fn in_both(mut scene: Scene) -> Result<[Self; 2]> {
        let mut of = |precision| {
            scene.plan.light_precision = precision;
            Self::of(&scene)
        };
        Ok([of(LightPrecision::Double)?, of(LightPrecision::Single)?])
    }

    /// Of `scene` with hits in f64 and, where the plan takes that, in f32: for regimes that f32 does not hold.
    pub(crate) fn where_planned(mut scene: Scene) -> Result<Vec<Self>> {
        scene.plan.light_precision = LightPrecision::Double;
        let double = Self::of(&scene)?;
        scene.plan.light_precision = LightPrecision::Auto;
        let planned = Self::of(&scene)?;
        Ok(match planned.precision {
            HitPrecision::Single => vec![double, planned],
            HitPrecision::Double => vec![double],
        })
    }

    pub(crate) fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }

    /// Of the mean, from the spread of the pixels, and half a unit in the last place of the f32 that
    /// they are kept in.
    pub(crate) fn standard_error(&self) -> f64 {
        let (n, mean) = (self.values.len() as f64, self.mean());
        let squares: f64 = self.values.iter().map(|v| (v - mean) * (v - mean)).sum();
        (squares / (n - 1.0) / n).sqrt() + 2.5e-8 * mean.abs()
    }

    pub(crate) fn most(&self) -> f64 {
        self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// True if all numbers are finite, and none had to be left out.
    pub(crate) fn are_sound(&self) -> bool {
        self.not_finite == 0 && self.values.iter().all(|v| v.is_finite())
    }
}

/// The one of some pictures whose mean is the farthest from what it should be.
pub(crate) fn farthest(pictures: &[Pixels], known: f64) -> Result<&Pixels> {
    let off = |picture: &Pixels| (picture.mean() - known).abs();
    pictures.iter().max_by(|a, b| off(a).total_cmp(&off(b))).context("a picture")
}

/// Divides each triangle of a scene into `n`² alike. Neighbours still share corners to the bit where `n` is a power of
/// two and the corners are those of boxes of such sides: single precision holds all of them.
pub(crate) fn divide(scene: &mut Scene, n: u32) -> Result<()> {
    for mesh in &mut Arc::make_mut(&mut scene.geometry).meshes {
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for whole in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(whole);
            let mut corner = |i: u32, j: u32| {
                let [along, across] = [i, j].map(|k| f64::from(k) / f64::from(n));
                corners.push((a + (b - a) * along + (c - a) * across).to_array());
                u32::try_from(corners.len() - 1)
            };
            for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
                triangles.push([corner(i, j)?, corner(i + 1, j)?, corner(i, j + 1)?]);
                if i + j + 1 < n {
                    triangles.push([corner(i + 1, j)?, corner(i + 1, j + 1)?, corner(i, j + 1)?]);
                }
            }
        }
        let name = mesh.name.clone();
        *mesh = Mesh::from_arrays(name, &corners, &triangles).map_err(anyhow::Error::msg)?;
    }
    Ok(())
}

/// 8 × 8 pixels of a tiny patch around `at`, seen from `from`, and the `rest` of the scene.
pub(crate) fn patch(tracer: &str, samples: u32, [from, at]: [[f64; 3]; 2], rest: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {tracer},
        "camera": {{"type": "orthographic", "height": 1e-3,
            "pose": {{"from": {from:?}, "look_at": {at:?}, "up": [0.1, 0.2, 0.9]}},
            "sensor": {{"resolution": [8, 8]}}}},
        "render": {{"samples": {samples}}}, {rest}}}"#
    )
}

/// Mean electrons a second of each channel of the sensor of the scene in `text`.
pub(crate) fn electrons_of_channels(text: &Value) -> Result<Vec<f64>> {
    Ok(electrons_in_bands(text)?.0)
}

/// The same, and how many bands the plan takes for them.
pub(crate) fn electrons_in_bands(text: &Value) -> Result<(Vec<f64>, usize)> {
    let folder = tempfile::tempdir()?;
    let scene = load(folder.path(), &text.to_string())?;
    let plan = Plan::new(&scene, Outputs::from_list("exr").map_err(anyhow::Error::msg)?);
    let accel = build(&scene, &plan, &BuildOptions::default())?;
    let images = Images::decode(&scene, &plan, None)?;
    ensure!(images.faults.is_empty(), "{:?}", images.faults);
    let done = render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true)?;
    let count = plan.bands.count();
    let sensor = scene.sensor.clone().context("a sensor")?.in_bands(plan.bands.clone())?;
    let film = done.band_film.context("light in bands")?;
    let pixels = film.values.len() / count;
    let of_channel = |channel: usize| {
        let worth = sensor.electrons_per_unit(channel);
        let values = film.values.chunks(count).flat_map(|pixel| pixel.iter().zip(worth));
        values.map(|(&value, worth)| f64::from(value) * worth).sum::<f64>() / pixels as f64
    };
    Ok(((0..sensor.channels().len()).map(of_channel).collect(), count))
}
