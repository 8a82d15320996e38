//! The film: the planes that a render fills, and the strips of rows that threads fill side by side.

use std::sync::{Mutex, PoisonError};

use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

use crate::description::{Description, describe, id_definition};
use crate::expose::BandFilm;
use crate::output::{Channel, Layer, Values};

/// How finely data layers are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits, as an EXR stores them.
    Single,
    /// 64 bits, as an NPY may: accurate to the input's own coordinates.
    Double,
}

/// The planes of one layer while it is filled.
#[derive(Debug, Clone)]
pub(crate) struct FilmLayer {
    pub(crate) spec: LayerSpec,
    names: Vec<String>,
    planes: Vec<Values>,
}

/// Rows of one plane, lent to one thread.
#[derive(Debug)]
pub(crate) enum Rows<'a> {
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
    U32(&'a mut [u32]),
}

impl Rows<'_> {
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

    pub(crate) fn f32(&mut self) -> Option<&mut [f32]> {
        if let Self::F32(rows) = self { Some(rows) } else { None }
    }

    pub(crate) fn f64(&mut self) -> Option<&mut [f64]> {
        if let Self::F64(rows) = self { Some(rows) } else { None }
    }
}

/// The nearest f32.
#[expect(clippy::cast_possible_truncation, reason = "single precision was asked for")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

/// The rows that one thread fills: a strip of all planes of all layers, layer by layer.
#[derive(Debug)]
pub(crate) struct Strip<'a> {
    /// The topmost row.
    pub(crate) top: u32,
    /// Rows.
    pub(crate) height: u32,
    /// Each layer's planes.
    pub(crate) layers: Vec<(LayerSpec, Vec<Rows<'a>>)>,
}

impl FilmLayer {
    /// An empty layer; the picture of a tracer of light has a plane for each of `bands`.
    pub(crate) fn new(spec: LayerSpec, pixels: usize, precision: Precision, bands: &Bands) -> Self {
        let plane = || match (spec, precision) {
            (LayerSpec::Ids | LayerSpec::MaterialId, _) => Values::U32(vec![0; pixels]),
            (
                LayerSpec::Flat
                | LayerSpec::Facing
                | LayerSpec::Albedo
                | LayerSpec::Radiance
                | LayerSpec::Alpha
                | LayerSpec::Backdrop
                | LayerSpec::Coverage,
                _,
            )
            | (_, Precision::Single) => Values::F32(vec![0.0; pixels]),
            (_, Precision::Double) => Values::F64(vec![0.0; pixels]),
        };
        let names: Vec<String> = match spec {
            LayerSpec::Radiance => bands.names(),
            _ => describe(spec).channels.iter().map(|name| (*name).to_owned()).collect(),
        };
        let planes = names.iter().map(|_| plane()).collect();
        Self { spec, names, planes }
    }

    /// Takes the light of a tracer out of its bands, whose place red, green and blue take; `None`
    /// when they are the bands already.
    pub(crate) fn take_bands(&mut self, bands: &Bands) -> Option<BandFilm> {
        if self.spec != LayerSpec::Radiance || *bands == Bands::Rgb {
            return None;
        }
        let planes = self.planes.iter().filter_map(|plane| match plane {
            Values::F32(values) => Some(values.as_slice()),
            _ => None,
        });
        let film = BandFilm::woven(bands.clone(), &planes.collect::<Vec<_>>());
        self.names = ["R", "G", "B"].map(str::to_owned).into();
        self.planes = film.colors().map(Values::F32).into();
        Some(film)
    }

    /// The planes alone.
    pub(crate) fn into_planes(self) -> Vec<Values> {
        self.planes
    }

    /// The layers as they are written; `root` puts the picture at the root of the file, without a
    /// name. Each kind of id is a layer of its own, `Id.object.X`: the form that Blender reads.
    pub(crate) fn into_layers(self, root: bool) -> Vec<Layer> {
        let Description { name, look, meaning, .. } = describe(self.spec);
        let owned = |(k, v): &(&str, &str)| ((*k).to_owned(), (*v).to_owned());
        let meaning: Vec<_> = meaning.iter().map(owned).collect();
        let planes = self.names.into_iter().zip(self.planes);
        if self.spec == LayerSpec::Ids {
            let layer = |(channel, values): (String, Values)| {
                let definition = id_definition(&channel);
                let definition = ("definition".to_owned(), definition.to_owned());
                Layer {
                    name: format!("{name}.{channel}"),
                    look,
                    channels: vec![Channel { name: "X".to_owned(), values }],
                    meaning: std::iter::once(definition).chain(meaning.clone()).collect(),
                }
            };
            return planes.map(layer).collect();
        }
        let channels = planes.map(|(name, values)| Channel { name, values }).collect();
        let name = if root { String::new() } else { name.to_owned() };
        vec![Layer { name, look, channels, meaning }]
    }
}

/// Strips of `strip_height` rows over all `layers`, each to be taken by one thread.
pub(crate) fn strips<'a>(
    layers: &'a mut [&mut FilmLayer],
    [width, height]: [u32; 2],
    strip_height: u32,
) -> Vec<Mutex<Option<Strip<'a>>>> {
    let mut strips: Vec<Strip<'a>> = (0..height.div_ceil(strip_height))
        .map(|k| {
            let top = k * strip_height;
            Strip { top, height: strip_height.min(height - top), layers: Vec::new() }
        })
        .collect();
    let chunk = width as usize * strip_height as usize;
    for layer in layers {
        for strip in &mut strips {
            strip.layers.push((layer.spec, Vec::new()));
        }
        for plane in &mut layer.planes {
            let rows: Vec<Rows<'_>> = match plane {
                Values::F32(values) => values.chunks_mut(chunk).map(Rows::F32).collect(),
                Values::F64(values) => values.chunks_mut(chunk).map(Rows::F64).collect(),
                Values::U32(values) => values.chunks_mut(chunk).map(Rows::U32).collect(),
                Values::U16(_) => Vec::new(),
            };
            for (strip, rows) in strips.iter_mut().zip(rows) {
                if let Some((_, planes)) = strip.layers.last_mut() {
                    planes.push(rows);
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
