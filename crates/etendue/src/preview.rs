//! Pictures that are there soon: larger pixels, fewer samples, and only what somebody looks at.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use etendue_render::expose::{ExposeError, SensorLight};
use etendue_render::light_field::LightFieldViews;
use etendue_render::output::{Layer, Picture, Screen};
use etendue_render::{Plan, Prepared};
use etendue_scene::Scene;
use etendue_scene::file::SamplesSpec;
use etendue_sensor::RawImage;

use crate::session::PreparedScene;
use crate::{Error, Progress, Rendering, Session};

/// Roughness of a preview.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Roughness {
    /// Pixels along the side of one of the preview's; 1 is the picture's own size.
    pub factor: u32,
    /// The most samples a pixel; the scene's own number when absent.
    pub samples: Option<u32>,
}

impl Roughness {
    /// The picture as it is rendered.
    pub const NONE: Self = Self { factor: 1, samples: None };
}

/// A picture on its way to the one that [`Session::render`] makes: the same view on larger pixels.
#[derive(Debug)]
pub struct Preview {
    scene: Arc<Scene>,
    picture: Picture,
    light: Option<SensorLight>,
    /// The first exposure, once somebody has asked.
    raw: OnceLock<Option<RawImage>>,
    factor: u32,
    samples: [u32; 2],
    time: Duration,
    notes: Vec<String>,
}

impl Preview {
    /// Pixels of the picture along the side of one of these.
    #[must_use]
    pub fn factor(&self) -> u32 {
        self.factor
    }

    /// Samples that its pixels have, and that the scene's are to have.
    #[must_use]
    pub fn samples(&self) -> [u32; 2] {
        self.samples
    }

    /// Wall time of the tracing, without what was prepared before it.
    #[must_use]
    pub fn time(&self) -> Duration {
        self.time
    }

    /// Columns and rows.
    #[must_use]
    pub fn resolution(&self) -> [usize; 2] {
        [self.picture.width(), self.picture.height()]
    }

    /// The layers, the picture first where there is one.
    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        self.picture.layers()
    }

    /// Notes for the user.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The scene as it was rendered: its camera has these pixels.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The light on the sensor; `None` for an ideal camera, or without a picture.
    #[must_use]
    pub fn sensor_light(&self) -> Option<&SensorLight> {
        self.light.as_ref()
    }

    /// The sensor's digital numbers of the first exposure; `None` where there is no sensor.
    ///
    /// # Errors
    ///
    /// None that a caller can cause.
    pub fn raw(&self) -> Result<Option<&RawImage>, Error> {
        if let Some(raw) = self.raw.get() {
            return Ok(raw.as_ref());
        }
        let shot =
            self.light.iter().find_map(|light| Some((light, light.sensor().shots().next()?)));
        let raw = match shot {
            Some((light, shot)) => Some(light.expose(shot).map_err(ExposeError::from)?),
            None => None,
        };
        Ok(self.raw.get_or_init(|| raw).as_ref())
    }

    /// Reads the values at column and row coordinates `place` of the picture at its own size
    /// (pixels): names and values with their units. Digital numbers, and the mean electrons that
    /// they stand for where the sensor has a gain, of each channel; then every layer's channels.
    ///
    /// # Errors
    ///
    /// None that a caller can cause.
    pub fn reading(&self, place: [f64; 2]) -> Result<Vec<(String, String)>, Error> {
        let [width, height] = self.resolution();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 0 is 0")]
        let [x, y] = place.map(|at| (at / f64::from(self.factor)).floor() as usize);
        if x >= width || y >= height {
            return Ok(Vec::new());
        }
        let (i, mut reading) = (y * width + x, Vec::new());
        if let (Some(light), Some(raw)) = (&self.light, self.raw()?) {
            let sensor = light.sensor();
            let numbers = raw.values.iter().skip(i * raw.depth).take(raw.depth);
            let names = sensor.channels().map(str::to_owned).collect::<Vec<_>>();
            for (channel, &number) in numbers.enumerate() {
                let name = match raw.depth {
                    1 => "raw".to_owned(),
                    _ => format!("raw {}", names.get(channel).map_or("", |name| name)),
                };
                reading.push((name.clone(), format!("{number} DN")));
                let gain = sensor.system_gain();
                if gain > 0.0 && gain.is_finite() {
                    let electrons = (f64::from(number) - sensor.black_level()) / gain;
                    reading.push((name, format!("{electrons:.1} e\u{207b}")));
                }
            }
        }
        reading.extend(self.layers().iter().map(|layer| layer_reading(layer, i)));
        Ok(reading)
    }

    /// The views of a light-field camera's picture; `None` of other cameras, and of those that have no
    /// views.
    ///
    /// # Errors
    ///
    /// When the views have no places.
    pub fn light_field(&self) -> Result<Option<LightFieldViews>, Error> {
        Ok(LightFieldViews::of(&self.scene, &self.picture)?)
    }

    /// A layer for a screen; the picture's name is empty.
    ///
    /// # Errors
    ///
    /// When there is no such layer.
    pub fn screen(&self, layer: &str) -> Result<Screen, Error> {
        Ok(Screen::of_layer(&self.picture, layer)?)
    }
}

impl Session {
    /// Renders the scene as it is now on larger pixels and with fewer samples: the way to a window that
    /// follows its user's hand. Without any [roughness](Roughness::NONE) it is [`Self::render`]'s picture
    /// to the bit. Layers that compare frames are only found at the picture's own size.
    ///
    /// # Errors
    ///
    /// As [`Self::render`].
    pub fn preview(&mut self, rough: Roughness, progress: &Progress) -> Result<Preview, Error> {
        if rough == Roughness::NONE {
            let start = Instant::now();
            let rendering = self.render(progress)?;
            return Ok(Preview::finished(rendering, start.elapsed()));
        }
        self.prepare(progress)?;
        let PreparedScene { scene, accel, images } = self.prepared()?;
        let mut scene = Scene::clone(&scene);
        scene.camera = scene.camera.coarser(rough.factor);
        let resolution = scene.camera.resolution();
        scene.sensor = scene.sensor.map(|sensor| sensor.with_resolution(resolution));
        let wanted = scene.render.samples.most();
        if let Some(most) = rough.samples {
            scene.render.samples = SamplesSpec::Count(most.clamp(1, wanted));
        }
        let plan = Plan::new(&scene, self.outputs());
        let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
        let (start, state) = (Instant::now(), etendue_render::RenderState::default());
        let film = etendue_render::trace(&scene, &plan, prepared, &[], &state, progress)
            .map_err(|error| self.placed(error))?;
        let rendered = etendue_render::finish(&scene, &plan, film, Vec::new(), Some(&*accel))?;
        let time = start.elapsed();
        let light = SensorLight::new(&scene, &rendered.picture, rendered.band_film)?.ok();
        let (samples, scene) = ([rendered.samples, wanted], Arc::new(scene));
        let (picture, notes) = (rendered.picture, rendered.notes);
        let (factor, raw) = (rough.factor, OnceLock::new());
        Ok(Preview { scene, picture, light, raw, factor, samples, time, notes })
    }
}

/// Reading of a layer at pixel `i`: its name, and its values with their unit.
pub(crate) fn layer_reading(layer: &Layer, i: usize) -> (String, String) {
    let values = layer.channels.iter().map(|channel| format!("{:.4}", channel.values.at(i)));
    let unit = layer.meaning.iter().find(|entry| entry.key == "unit");
    let unit = unit.map(|unit| format!(" {}", unit.text)).filter(|unit| !unit.starts_with(" 1"));
    let values = values.collect::<Vec<_>>().join(", ");
    (layer.title(), format!("{values}{}", unit.unwrap_or_default()))
}

impl Preview {
    fn finished(rendering: Rendering, time: Duration) -> Self {
        let Rendering { scene, picture, light, report, .. } = rendering;
        let samples = [report.samples, report.samples_wanted];
        let (raw, notes) = (OnceLock::new(), report.notes);
        Self { scene, picture, light, raw, factor: 1, samples, time, notes }
    }
}
