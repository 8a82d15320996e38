//! Decision whether the bands of a picture's light share the paths of the scene behind a lens that
//! sends each its own way: how it is made, and in words.

use etendue_camera::{Camera, SharedPaths};
use etendue_report::{Decision, DecisionKind, Size};
use etendue_scene::Scene;
use etendue_scene::file::SETS;
use etendue_spectrum::Bands;
use etendue_tracer::transport::Follow;

use crate::samples::BYTES_OF_SUM;
use crate::shard::{SampledStrips, Shard};
use crate::stopping::Stopping;

/// So many bands of direct light are traced each by itself. Not a setting: `plan.shared_paths` decides.
const FEW_BANDS: usize = 8;

/// The most memory that the sums of bands may take which share paths: they are kept for the whole film. Not a setting:
/// it changes time alone.
const MOST_BYTES_OF_SUMS: u64 = 2 << 30;

/// Paths of a picture's bands of light through the camera's lens.
#[derive(Debug, Clone, PartialEq)]
pub enum BandPaths {
    /// All alike: no lens tells them apart.
    Alike,
    /// The scene is traced once, and each band's light lands at its own place on the film.
    Shared(SharedPaths),
    /// The scene is traced for each band; and why.
    Apart(String),
}

impl BandPaths {
    /// The choice for `scene` through `camera`, whose picture is of light in `bands` where it `is_lit`.
    pub(crate) fn of(
        scene: &Scene,
        camera: &Camera,
        bands: &Bands,
        stopping: Stopping,
        is_lit: bool,
    ) -> Self {
        let lens = camera.lens().filter(|_| is_lit);
        let Some(lens) = lens.filter(|lens| lens.band_groups(bands).len() > 1) else {
            return Self::Alike;
        };
        if scene.plan.shared_paths == Some(false) {
            return Self::Apart("the scene has each traced by itself".to_owned());
        }
        let light = scene.tracer.and_then(|tracer| tracer.row().light);
        let is_direct = light.is_some_and(|light| light.rules.follow == Follow::Single);
        if scene.plan.shared_paths.is_none() && is_direct && bands.count() <= FEW_BANDS {
            let why = "direct light has less noise than how much of it lands on a pixel would, and bands are few";
            return Self::Apart(why.to_owned());
        }
        let sets = if stopping.is_adaptive() { u64::from(SETS) } else { 1 };
        if scene.plan.shared_paths.is_none() && stopping.is_adaptive() {
            let why =
                "samples stop at an error, and how unevenly light lands is known too late for that";
            return Self::Apart(why.to_owned());
        }
        if scene.camera.light_of_rows_differs() {
            let why = "rows are seen at different times, and light lands on other rows than it starts from";
            return Self::Apart(why.to_owned());
        }
        if scene.sensor.as_ref().is_some_and(|sensor| sensor.carrier_diffusion() > 0.0) {
            let why = "carriers diffuse in the sensor, beside the pixel that a ray starts from";
            return Self::Apart(why.to_owned());
        }
        let [width, height] = scene.camera.resolution().map(u64::from);
        let lit = scene.layers.iter().filter(|layer| layer.is_light()).count();
        let values = (width * height).saturating_mul((lit * bands.count()) as u64);
        if values.saturating_mul(sets * BYTES_OF_SUM) > MOST_BYTES_OF_SUMS {
            return Self::Apart(format!(
                "sums of them would take more than {}",
                Size(MOST_BYTES_OF_SUMS)
            ));
        }
        lens.shared_paths(bands).map_or_else(Self::Apart, Self::Shared)
    }

    /// True if the scene is traced once for all bands of a lens that tells them apart.
    #[must_use]
    pub fn are_shared(&self) -> bool {
        matches!(self, Self::Shared(_))
    }

    /// Share of the samples of a picture of `height` rows that a share of its rows takes: its own, and those from which light
    /// lands on them.
    #[must_use]
    pub fn share_of_samples(&self, shard: Shard, height: u32) -> f64 {
        match self {
            Self::Shared(SharedPaths { rows, margin, .. }) => {
                SampledStrips { shard, rows: *rows, height }.share_of_rows(*margin)
            }
            Self::Alike | Self::Apart(_) => f64::from(shard.rows(height)) / f64::from(height),
        }
    }

    /// The row of the plan; none where there is nothing to decide.
    pub(crate) fn decision(&self, scene: &Scene) -> Option<Decision> {
        let (choice, because) = match self {
            Self::Alike => return None,
            Self::Shared(SharedPaths { traced, error, rows, .. }) => {
                let how = match traced {
                    1 => "filters alone tell the bands apart".to_owned(),
                    _ => format!(
                        "a path is traced into the scene at one of {traced} wavelengths and back through the \
                         lens at all of them; between them the places where bands land are interpolated, to \
                         {error:.4} px, within {rows} rows"
                    ),
                };
                ("shared", how)
            }
            Self::Apart(why) => ("their own", why.clone()),
        };
        let is_forced = scene.plan.shared_paths.is_some();
        Some(Decision::new(DecisionKind::PathsOfBands, choice, because).forced(is_forced))
    }
}
