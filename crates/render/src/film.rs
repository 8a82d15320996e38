//! The film: the planes that a render fills, and the strips of rows that threads fill side by side.

use std::sync::{Mutex, PoisonError};

use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;
use etendue_tracer::layer::{self, Look, RaySource, ValueKind};

use crate::memory::{NoMemory, filled};
use crate::output::{Channel, HeaderEntry, Layer, Values};

/// Precision of data layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits, as an EXR stores them.
    Single,
    /// 64 bits, as an NPY may: accurate to the input's own coordinates.
    Double,
}

/// Number type of a plane's values while it is filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PlaneKind {
    F32,
    F64,
    U32,
}

fn kind_of_plane(spec: LayerSpec, precision: Precision) -> PlaneKind {
    match (spec.row().kept, precision) {
        (ValueKind::Counted, _) => PlaneKind::U32,
        (ValueKind::Shown, _) | (ValueKind::Measured, Precision::Single) => PlaneKind::F32,
        (ValueKind::Measured, Precision::Double) => PlaneKind::F64,
    }
}

/// Bytes of a pixel of one plane of a layer.
pub(crate) fn bytes_of_plane(spec: LayerSpec, precision: Precision) -> u64 {
    match kind_of_plane(spec, precision) {
        PlaneKind::F32 | PlaneKind::U32 => 4,
        PlaneKind::F64 => 8,
    }
}

/// The planes of one layer while it is filled.
#[derive(Debug, Clone)]
pub(crate) struct FilmLayer {
    pub(crate) spec: LayerSpec,
    row: layer::Layer,
    pub(crate) names: Vec<String>,
    pub(crate) planes: Vec<Values>,
}

/// Rows of one plane, lent to one thread.
#[derive(Debug)]
pub(crate) enum PlaneRows<'a> {
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
    U32(&'a mut [u32]),
}

impl PlaneRows<'_> {
    /// Writes a number to the pixel at `index` of the rows.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "integer layers are given the u32 that they hold"
    )]
    pub(crate) fn put(&mut self, index: usize, value: f64) {
        match self {
            Self::F32(rows) => rows[index] = single(value),
            Self::F64(rows) => rows[index] = value,
            Self::U32(rows) => rows[index] = value as u32,
        }
    }

    /// Writes a number to each pixel of the rows.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "integer layers are given the u32 that they hold"
    )]
    pub(crate) fn fill(&mut self, values: impl Iterator<Item = f64>) {
        match self {
            Self::F32(rows) => rows.iter_mut().zip(values).for_each(|(row, v)| *row = single(v)),
            Self::F64(rows) => rows.iter_mut().zip(values).for_each(|(row, v)| *row = v),
            Self::U32(rows) => rows.iter_mut().zip(values).for_each(|(row, v)| *row = v as u32),
        }
    }

    /// Writes `values` to the pixels at `places` of the rows.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "integer layers are given the u32 that they hold"
    )]
    pub(crate) fn scatter(&mut self, places: &[u32], values: &[f64]) {
        let pairs = places.iter().zip(values);
        match self {
            Self::F32(rows) => pairs.for_each(|(&at, &value)| rows[at as usize] = single(value)),
            Self::F64(rows) => pairs.for_each(|(&at, &value)| rows[at as usize] = value),
            Self::U32(rows) => pairs.for_each(|(&at, &value)| rows[at as usize] = value as u32),
        }
    }
}

/// The nearest f32.
#[expect(clippy::cast_possible_truncation, reason = "single precision was asked for")]
fn single(value: f64) -> f32 {
    value as f32
}

/// The rows that one thread fills: a strip of all planes of all layers, layer by layer.
#[derive(Debug)]
pub(crate) struct Strip<'a> {
    /// The topmost row.
    pub(crate) top: u32,
    /// Rows.
    pub(crate) height: u32,
    /// Each layer's part.
    pub(crate) layers: Vec<StripLayer<'a>>,
}

/// The part of one layer in a strip.
#[derive(Debug)]
pub(crate) struct StripLayer<'a> {
    pub(crate) spec: LayerSpec,
    pub(crate) taken: RaySource,
    pub(crate) planes: Vec<PlaneRows<'a>>,
}

impl FilmLayer {
    /// An empty layer; light has a plane for each of `bands`. `Err` when there
    /// is no memory for it.
    pub(crate) fn new(
        spec: LayerSpec,
        pixels: usize,
        precision: Precision,
        bands: &Bands,
    ) -> Result<Self, NoMemory> {
        let row = spec.row();
        let plane = || {
            Ok(match kind_of_plane(spec, precision) {
                PlaneKind::U32 => Values::U32(filled(0, pixels)?),
                PlaneKind::F32 => Values::F32(filled(0.0, pixels)?),
                PlaneKind::F64 => Values::F64(filled(0.0, pixels)?),
            })
        };
        let names: Vec<String> = match spec {
            _ if spec.is_light() => bands.names(),
            // Dots part the names of layers and channels in files.
            LayerSpec::Variance => {
                bands.names().iter().map(|name| name.replace('.', "_")).collect()
            }
            _ => row.channels.iter().map(|name| (*name).to_owned()).collect(),
        };
        let planes = names.iter().map(|_| plane()).collect::<Result<_, _>>()?;
        Ok(Self { spec, row, names, planes })
    }

    /// Each plane with the name that it has in files of shards.
    pub(crate) fn named_planes(&self) -> impl Iterator<Item = (String, &Values)> {
        let title = self.row.name.clone();
        self.planes.iter().enumerate().map(move |(k, plane)| (format!("{title} {k}"), plane))
    }

    /// Planes of the layer with their names, to be filled.
    pub(crate) fn named_planes_mut(&mut self) -> impl Iterator<Item = (String, &mut Values)> {
        let title = self.row.name.clone();
        self.planes.iter_mut().enumerate().map(move |(k, plane)| (format!("{title} {k}"), plane))
    }

    /// The planes alone.
    pub(crate) fn into_planes(self) -> Vec<Values> {
        self.planes
    }

    /// The layers as they are written; `root` puts the picture at the root of the file, without a
    /// name.
    pub(crate) fn into_layers(self, root: bool) -> Vec<Layer> {
        let files = self.row.names_in_files();
        let layer::Layer { name, look, meaning, apart, .. } = self.row;
        let owned = |(key, text): &(&str, &str)| HeaderEntry::new(*key, *text);
        let meaning: Vec<_> = meaning.iter().map(owned).collect();
        if let Some(definitions) = apart {
            let layer = |((name, values), definition): ((String, Values), &&str)| {
                let definition = owned(&("definition", definition));
                let channels = vec![Channel { name: "X".to_owned(), values }];
                let meaning = std::iter::once(definition).chain(meaning.clone()).collect();
                Layer { name, look, channels, meaning }
            };
            return files.into_iter().zip(self.planes).zip(definitions).map(layer).collect();
        }
        let look = if self.planes.len() > 3 { Look::Cube } else { look };
        let planes = self.names.into_iter().zip(self.planes);
        let channels = planes.map(|(name, values)| Channel { name, values }).collect();
        let name = if root { String::new() } else { name.into_owned() };
        vec![Layer { name, look, channels, meaning }]
    }
}

/// Strips of `strip_height` rows over all `layers`, each to be taken by one thread.
pub(crate) fn strips<'a>(
    layers: &'a mut [&mut FilmLayer],
    [width, height]: [u32; 2],
    strip_height: u32,
) -> Vec<Mutex<Option<Strip<'a>>>> {
    // Strips without their numbers, and then each layer's rows dealt out to them.
    let mut strips: Vec<Strip<'a>> = (0..height.div_ceil(strip_height))
        .map(|k| {
            let top = k * strip_height;
            Strip { top, height: strip_height.min(height - top), layers: Vec::new() }
        })
        .collect();
    let chunk = width as usize * strip_height as usize;
    for layer in layers {
        for strip in &mut strips {
            let (spec, taken) = (layer.spec, layer.row.taken);
            strip.layers.push(StripLayer { spec, taken, planes: Vec::new() });
        }
        for plane in &mut layer.planes {
            let rows: Vec<PlaneRows<'_>> = match plane {
                Values::F32(values) => values.chunks_mut(chunk).map(PlaneRows::F32).collect(),
                Values::F64(values) => values.chunks_mut(chunk).map(PlaneRows::F64).collect(),
                Values::U32(values) => values.chunks_mut(chunk).map(PlaneRows::U32).collect(),
                Values::U16(_) => Vec::new(),
            };
            for (strip, rows) in strips.iter_mut().zip(rows) {
                if let Some(layer) = strip.layers.last_mut() {
                    layer.planes.push(rows);
                }
            }
        }
    }
    strips.into_iter().map(|strip| Mutex::new(Some(strip))).collect()
}

/// Takes what stands ready for one thread.
pub(crate) fn take<T>(place: &Mutex<Option<T>>) -> Option<T> {
    place.lock().unwrap_or_else(PoisonError::into_inner).take()
}
