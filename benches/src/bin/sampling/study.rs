//! A scene that is rendered with samples of all kinds, and how far its pictures are from each other.

use std::path::Path;

use etendue_accel::{Accel, BuildOptions};
use etendue_files::Opener;
use etendue_render::output::{Outputs, Values};
use etendue_render::{Images, Plan, Rendered, build, plan, render};
use etendue_scene::file::SceneFile;
use etendue_scene::{LoadOptions, Scene, Setting};
use etendue_sensor::Sensor;
use etendue_spectrum::Bands;
use serde_json::{Value, json};

/// The exposure (s) at which the light of a scene is scaled to fill a part of the full well, in the mean
/// over the picture; and that part.
const METERED: [f64; 2] = [0.01, 0.25];

/// The sensor's full well (electrons).
const FULL_WELL: f64 = 10_000.0;

/// The pixels' pitch (µm).
const PITCH: f64 = 3.45;

/// Side of the blocks that errors are averaged over (pixels).
const BLOCK: usize = 8;

/// A picture that is wanted.
pub(crate) struct Wanted {
    /// `render.samples`.
    pub(crate) samples: Value,
    /// Exposure time (s).
    pub(crate) exposure: f64,
}

/// A picture's light, and its samples a pixel.
pub(crate) struct Picture {
    /// `[channel][pixel]`, in the film's bands as red, green and blue.
    light: Vec<Vec<f64>>,
    pub(crate) samples: f64,
}

impl Picture {
    /// The photo-electrons of a channel at a pixel, `units` being those of a unit of light of each band.
    fn electrons(&self, units: &[f64], pixel: usize) -> f64 {
        units.iter().zip(&self.light).map(|(e, light)| e * light[pixel]).sum()
    }
}

/// The mean of an error over the picture, and what nine tenths and 99 in 100 of all blocks stay below.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread {
    pub(crate) mean: f64,
    pub(crate) ninth: f64,
    pub(crate) most: f64,
}

/// A scene.
pub(crate) struct Study {
    file: SceneFile,
    accel: Box<dyn Accel>,
    images: Images,
    width: usize,
}

impl Study {
    pub(crate) fn open(path: &Path, width: u32) -> anyhow::Result<Self> {
        eprintln!("{}", path.display());
        let mut value: Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
        let [columns, rows] = [0, 1].map(|k| {
            let side = value.pointer(&format!("/camera/sensor/resolution/{k}"));
            side.and_then(Value::as_u64).unwrap_or(1)
        });
        let height = (u64::from(width) * rows / columns).max(1);
        value["camera"]["sensor"] = json!({
            "type": "rgb", "radiometry": "physical", "resolution": [width, height],
            "quantum_efficiency": 0.6, "read_noise": 2.5, "dark_current": 1,
            "system_gain": 0.4, "bit_depth": 12, "black_level": 64, "full_well": FULL_WELL,
        });
        if value["camera"]["sensor_height"].is_null() {
            value["camera"]["sensor"]["pixel_pitch"] = json!(PITCH);
        }
        if value["tracer"]["type"] == "facing" {
            value["tracer"] = json!({ "type": "direct" });
            value["lights"] = json!([{ "type": "environment", "radiance": [1, 1, 1] }]);
        }
        value["layers"] = json!([]);
        let folder = path.parent().unwrap_or(Path::new("."));
        let of = |value: Value| Self::prepared(folder, value, width as usize);
        let wanted = Wanted { samples: json!(16), exposure: METERED[0] };
        let unmetered = of(value.clone())?;
        let filled = unmetered.electrons(&unmetered.picture(&wanted, 1), wanted.exposure);
        dim(&mut value, METERED[1] * FULL_WELL / filled);
        of(value)
    }

    fn prepared(folder: &Path, value: Value, width: usize) -> anyhow::Result<Self> {
        let file = SceneFile::from_json(&Opener::default(), folder, value)?;
        let scene = loaded(&file);
        let plan = Plan::new(&scene, Outputs::ALL);
        let accel = build(&scene, &plan, &BuildOptions::default())?;
        let images = Images::decode(&scene, &plan, None)?;
        Ok(Self { file, accel, images, width })
    }

    /// The scene with the samples and exposure wanted.
    pub(crate) fn scene(&self, wanted: &Wanted, seed: u64) -> Scene {
        let mut settings = vec![
            Setting::new("render.samples", wanted.samples.to_string()),
            Setting::new("render.seed", seed.to_string()),
            Setting::new("camera.sensor.exposure", wanted.exposure.to_string()),
        ];
        if wanted.samples.is_object() {
            settings.push(Setting::new("layers", r#"["sample_count"]"#));
        }
        loaded(&self.file.with(&settings).expect("settings that the format knows"))
    }

    pub(crate) fn rendered(&self, wanted: &Wanted, seed: u64) -> Rendered {
        let scene = self.scene(wanted, seed);
        let plan = Plan::new(&scene, Outputs::ALL);
        render(&scene, &plan, &*self.accel, &self.images, Vec::new(), &|_: f64| true)
            .expect("a picture")
    }

    pub(crate) fn picture(&self, wanted: &Wanted, seed: u64) -> Picture {
        let done = self.rendered(wanted, seed);
        let samples = done.sample_counts.map_or(f64::from(done.samples), |counts| counts.mean());
        eprintln!("  {} at {} s: {samples:.0} samples", wanted.samples, wanted.exposure);
        let layer = done.picture.layer("").expect("the picture");
        let light = layer.channels.iter().map(|channel| numbers(&channel.values)).collect();
        Picture { light, samples }
    }

    /// The photo-electrons of a picture in the mean over its pixels and channels.
    fn electrons(&self, picture: &Picture, exposure: f64) -> f64 {
        let (_, units) = self.sensor(exposure);
        let pixels = picture.light[0].len();
        let of_pixel = |pixel| (0..3).map(|k| picture.electrons(&units[k], pixel)).sum::<f64>();
        (0..pixels).map(of_pixel).sum::<f64>() / (3 * pixels) as f64
    }

    /// The sensor, and the electrons of each channel by a unit of light of each band.
    fn sensor(&self, exposure: f64) -> (Sensor, Vec<Vec<f64>>) {
        let scene = self.scene(&Wanted { samples: json!(1), exposure }, 0);
        let sensor = scene.sensor.as_ref().expect("a sensor").clone();
        let sensor = sensor.in_bands(Bands::Rgb).expect("a sensor of three colours");
        let floor = sensor.noise_floor(exposure).expect("a sensor with noise");
        let angle = scene.camera.pupil_solid_angle().unwrap_or(1.0);
        let units = (0..3)
            .map(|channel| floor.electrons_per_unit(channel).map(|e| e * angle).collect())
            .collect();
        (sensor, units)
    }

    /// The variance of pairs of pictures in digital numbers, as a share of the sensor's own.
    pub(crate) fn noise_share(&self, pairs: &[[Picture; 2]], exposure: f64) -> Spread {
        spread_of(&mut self.noise_shares(pairs, exposure))
    }

    /// The same of each block, in the mean over the pairs.
    pub(crate) fn noise_shares(&self, pairs: &[[Picture; 2]], exposure: f64) -> Vec<f64> {
        mean_of(pairs.iter().map(|pair| self.noise_shares_of(pair, exposure)))
    }

    fn noise_shares_of(&self, pair: &[Picture; 2], exposure: f64) -> Vec<f64> {
        let (sensor, units) = self.sensor(exposure);
        let floor = sensor.noise_floor(exposure).expect("a sensor with noise");
        let share = |pixel: usize| {
            let of = |channel: usize| {
                let [a, b] = [0, 1].map(|k| pair[k].electrons(&units[channel], pixel));
                let slope = floor.slope(0.5 * (a + b));
                0.5 * slope * slope * (a - b).powi(2) / floor.variance(0.5 * (a + b))
            };
            (0..3).map(of).sum::<f64>() / 3.0
        };
        self.means(&share)
    }

    /// The variance of pairs of pictures, as a share of the square of a block's mean.
    pub(crate) fn relative_variance(&self, pairs: &[[Picture; 2]]) -> Spread {
        spread_of(&mut mean_of(pairs.iter().map(|pair| self.relative_variances(pair))))
    }

    fn relative_variances(&self, pair: &[Picture; 2]) -> Vec<f64> {
        let grey = |picture: &Picture, pixel: usize| {
            picture.light.iter().map(|plane| plane[pixel]).sum::<f64>() / 3.0
        };
        let variance = |pixel: usize| {
            let squares =
                (0..3).map(|k| 0.5 * (pair[0].light[k][pixel] - pair[1].light[k][pixel]).powi(2));
            squares.sum::<f64>() / 3.0
        };
        self.blocks(pair[0].light[0].len())
            .map(|pixels| {
                let count = pixels.len() as f64;
                let mean = |of: &dyn Fn(usize) -> f64| {
                    pixels.iter().map(|&pixel| of(pixel)).sum::<f64>() / count
                };
                let light = mean(&|pixel| 0.5 * (grey(&pair[0], pixel) + grey(&pair[1], pixel)));
                mean(&variance) / (light * light).max(1e-300)
            })
            .collect()
    }

    /// The mean of a value of pixels over each block.
    fn means(&self, of: &dyn Fn(usize) -> f64) -> Vec<f64> {
        let height = self.file.value()["camera"]["sensor"]["resolution"][1].as_u64().unwrap_or(1);
        let blocks = self.blocks(self.width * usize::try_from(height).unwrap_or(1));
        blocks
            .map(|pixels| pixels.iter().map(|&p| of(p)).sum::<f64>() / pixels.len() as f64)
            .collect()
    }

    /// The pixels of each block.
    fn blocks(&self, pixels: usize) -> impl Iterator<Item = Vec<usize>> + '_ {
        let (width, height) = (self.width, pixels / self.width);
        let rows = (0..height).step_by(BLOCK);
        rows.flat_map(move |y| (0..width).step_by(BLOCK).map(move |x| (x, y))).map(move |(x, y)| {
            let inside = |y: usize| (x..width.min(x + BLOCK)).map(move |x| y * width + x);
            (y..height.min(y + BLOCK)).flat_map(inside).collect()
        })
    }
}

/// The mean of lists of one length.
fn mean_of(lists: impl ExactSizeIterator<Item = Vec<f64>>) -> Vec<f64> {
    let count = lists.len() as f64;
    let sum = lists.reduce(|a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect());
    sum.unwrap_or_default().into_iter().map(|sum| sum / count).collect()
}

fn spread_of(blocks: &mut [f64]) -> Spread {
    blocks.sort_by(f64::total_cmp);
    let mean = blocks.iter().sum::<f64>() / blocks.len() as f64;
    let of_hundred = |below: usize| blocks[blocks.len() * below / 100];
    Spread { mean, ninth: of_hundred(90), most: of_hundred(99) }
}

fn loaded(file: &SceneFile) -> Scene {
    file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default()).expect("a scene")
}

fn numbers(values: &Values) -> Vec<f64> {
    (0..values.len()).map(|i| values.at(i)).collect()
}

/// Scales all light of a scene.
fn dim(value: &mut Value, light: f64) {
    match value {
        Value::Object(members) => {
            if members.get("type") == Some(&json!("environment")) {
                members.entry("radiance").or_insert(json!([1, 1, 1]));
            }
            for (key, member) in members {
                match (key.as_str(), member.as_array_mut()) {
                    ("radiance" | "intensity" | "irradiance", Some(numbers)) => {
                        for number in numbers {
                            *number = json!(number.as_f64().unwrap_or(0.0) * light);
                        }
                    }
                    _ => dim(member, light),
                }
            }
        }
        Value::Array(elements) => elements.iter_mut().for_each(|e| dim(e, light)),
        _ => {}
    }
}
