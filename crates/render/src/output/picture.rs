//! The layers of a render, checked once so that every writer may rely on them.

use std::collections::BTreeSet;
use std::ops::Range;

use rayon::prelude::*;

use serde_json::Value;

use etendue_image::cube::emission_channel;
use etendue_report::Refusal;
use etendue_tracer::LayerSpec;

use super::look::lacks;
use super::{Development, Look, OutputError, PictureError, SPECTRUM};

/// Numbers of one channel, a pixel each: row-major, row 0 at the top.
#[derive(Debug, Clone)]
pub enum Values {
    /// Measured or computed values.
    F32(Vec<f32>),
    /// Values with nothing rounded off. An EXR rounds them to f32, an NPY keeps them.
    F64(Vec<f64>),
    /// Digital numbers of a sensor.
    U16(Vec<u16>),
    /// Identities.
    U32(Vec<u32>),
}

impl Values {
    /// The number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }

    /// True if there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type as numpy writes it: `f4`, `f8`, `u2` or `u4`.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::F32(_) => "f4",
            Self::F64(_) => "f8",
            Self::U16(_) => "u2",
            Self::U32(_) => "u4",
        }
    }

    /// Bytes a value.
    #[must_use]
    pub fn value_bytes(&self) -> usize {
        match self {
            Self::U16(_) => 2,
            Self::F32(_) | Self::U32(_) => 4,
            Self::F64(_) => 8,
        }
    }

    /// The largest value of integers; 0 for other types.
    #[must_use]
    pub fn largest_integer(&self) -> u32 {
        match self {
            Self::U16(values) => values.par_iter().max().copied().unwrap_or(0).into(),
            Self::U32(values) => values.par_iter().max().copied().unwrap_or(0),
            Self::F32(_) | Self::F64(_) => 0,
        }
    }

    /// Value `i` as a number. Exact: f64 holds every value of every type here.
    #[must_use]
    #[inline]
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Self::F32(values) => values[i].into(),
            Self::F64(values) => values[i],
            Self::U16(values) => values[i].into(),
            Self::U32(values) => values[i].into(),
        }
    }

    /// Writes values `range` as little-endian bytes to `out`, `stride` bytes from one to the next.
    pub(crate) fn put_le(&self, range: Range<usize>, out: &mut [u8], stride: usize) {
        match self {
            Self::F32(values) => put(&values[range], out, stride, f32::to_le_bytes),
            Self::F64(values) => put(&values[range], out, stride, f64::to_le_bytes),
            Self::U16(values) => put(&values[range], out, stride, u16::to_le_bytes),
            Self::U32(values) => put(&values[range], out, stride, u32::to_le_bytes),
        }
    }

    /// Takes the values of `range` from `bytes`, little-endian and side by side.
    pub(crate) fn read_le(&mut self, range: Range<usize>, bytes: &[u8]) {
        match self {
            Self::F32(values) => get(&mut values[range], bytes, f32::from_le_bytes),
            Self::F64(values) => get(&mut values[range], bytes, f64::from_le_bytes),
            Self::U16(values) => get(&mut values[range], bytes, u16::from_le_bytes),
            Self::U32(values) => get(&mut values[range], bytes, u32::from_le_bytes),
        }
    }

    /// The index of the first NaN.
    fn first_nan(&self) -> Option<usize> {
        match self {
            Self::F32(values) => first(values, |value| value.is_nan()),
            Self::F64(values) => first(values, |value| value.is_nan()),
            Self::U16(_) | Self::U32(_) => None,
        }
    }
}

/// Values that are turned into bytes at a time: few enough to stay in a core's cache.
pub(super) const LE_BAND: usize = 1 << 14;

/// The values of `bytes`, side by side.
fn get<T, const N: usize>(values: &mut [T], bytes: &[u8], value: impl Fn([u8; N]) -> T) {
    for (slot, &bytes) in values.iter_mut().zip(bytes.as_chunks::<N>().0) {
        *slot = value(bytes);
    }
}

/// `bytes` of each value, `stride` bytes from one to the next in `out`.
pub(super) fn put<T: Copy, const N: usize>(
    values: &[T],
    out: &mut [u8],
    stride: usize,
    bytes: impl Fn(T) -> [u8; N],
) {
    if stride == N {
        // Without gaps this is a copy of memory.
        for (slot, &value) in out.as_chunks_mut::<N>().0.iter_mut().zip(values) {
            *slot = bytes(value);
        }
    } else {
        for (slot, &value) in out.chunks_mut(stride).zip(values) {
            slot[..N].copy_from_slice(&bytes(value));
        }
    }
}

/// The index of the first value that is `wanted`, searched by all threads.
fn first<T: Copy + Sync>(values: &[T], wanted: impl Fn(T) -> bool + Sync) -> Option<usize> {
    const BAND: usize = 1 << 15;
    values.par_chunks(BAND).enumerate().find_map_first(|(band, values)| {
        // Without an early exit this is a vector loop, and nearly always finds nothing.
        let any = values.iter().fold(false, |any, &value| any | wanted(value));
        let k = any.then(|| values.iter().position(|&value| wanted(value)))??;
        Some(band * BAND + k)
    })
}

/// One plane of a layer.
#[derive(Debug)]
pub struct Channel {
    /// `Z`, `X`, `R`, `object` …
    pub name: String,
    /// One value a pixel.
    pub values: Values,
}

/// One named image of a render: `Depth`, `Normal`, … All its channels are of one type.
#[derive(Debug)]
pub struct Layer {
    /// The name before the dot of `Depth.Z`; empty for the picture itself, whose `R G B` stand at
    /// the root of an EXR. Dots inside it make groups.
    pub name: String,
    /// Look of the layer in a preview.
    pub look: Look,
    /// Its planes, in the order that an NPY gives them.
    pub channels: Vec<Channel>,
    /// Meaning of the numbers: `definition`, `unit`, `frame`, `miss` …
    pub meaning: Vec<(String, String)>,
}

impl Layer {
    /// The full name of one of its channels, `Depth.Z`; `R` for a layer without a name.
    #[must_use]
    pub fn full_name(&self, channel: &Channel) -> String {
        if self.name.is_empty() {
            channel.name.clone()
        } else {
            format!("{}.{}", self.name, channel.name)
        }
    }

    /// The full name of one of its channels in an EXR: the same, but for light in bands, whose channels
    /// are called as the layout of spectral images has it, `S0.552,5nm` (Fichet, Pacanowski and Wilkie, *An OpenEXR
    /// Layout for Spectral Images*, JCGT 10(3), 2021).
    #[must_use]
    pub fn exr_name(&self, channel: &Channel) -> String {
        let nm = channel.name.strip_suffix("nm").and_then(|nm| nm.replace('_', ".").parse().ok());
        match nm.filter(|_| self.name == SPECTRUM) {
            Some(nm) => emission_channel(nm),
            None => self.full_name(channel),
        }
    }

    /// The type of its channels, as numpy writes it.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        self.channels.first().map_or("", |channel| channel.values.type_name())
    }

    /// Title of the layer where it needs a name: the picture goes by its channels, `RGB`.
    #[must_use]
    pub fn title(&self) -> String {
        if self.name.is_empty() {
            self.channels.iter().map(|channel| channel.name.as_str()).collect()
        } else {
            self.name.clone()
        }
    }
}

/// Layers of one size, with what holds for all of them. Sound by construction: no channel holds a
/// NaN, all have a value a pixel, and no two names meet in any file format.
#[derive(Debug)]
pub struct Picture {
    width: usize,
    height: usize,
    layers: Vec<Layer>,
    header: Vec<(String, String)>,
    names: Vec<(String, Value)>,
    png: Development,
}

impl Picture {
    /// Layers of `width` x `height` pixels under a `header` (scene hash, seed …). The values are
    /// moved in and looked through once, by all threads of the current rayon pool.
    ///
    /// # Errors
    ///
    /// When a layer is empty, of the wrong length, of mixed types, or unfit for its look; when a
    /// name is unfit or taken; and when any value is NaN.
    pub fn new(
        width: usize,
        height: usize,
        layers: Vec<Layer>,
        header: Vec<(String, String)>,
    ) -> Result<Self, PictureError> {
        let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0);
        let pixels = pixels.ok_or_else(|| PictureError::size([width, height]))?;
        if layers.is_empty() {
            return Err(PictureError::empty("the list of layers"));
        }
        for layer in &layers {
            check_shape(layer, pixels)?;
        }
        check_names(&layers, &header)?;
        for (layer, channel) in channels(&layers) {
            if let Some(i) = channel.values.first_nan() {
                let channel = layer.full_name(channel);
                return Err(PictureError::not_a_number(&channel, [i % width, i / width]));
            }
        }
        let (names, png) = Default::default();
        Ok(Self { width, height, layers, header, names, png })
    }

    /// Returns the picture with tables of what the numbers of layers name, by the layers' names.
    #[must_use]
    pub fn with_names(mut self, names: Vec<(String, Value)>) -> Self {
        self.names = names;
        self
    }

    /// Table of what the numbers of the layer called `name` stand for, if there is one.
    #[must_use]
    pub fn names(&self, name: &str) -> Option<&Value> {
        self.names.iter().find(|(layer, _)| layer == name).map(|(_, table)| table)
    }

    /// All tables of names, by the layers' names.
    pub(crate) fn all_names(&self) -> &[(String, Value)] {
        &self.names
    }

    /// Returns the picture with another development for PNGs of it.
    #[must_use]
    pub fn developed(mut self, png: Development) -> Self {
        self.png = png;
        self
    }

    /// Development of the picture's light in a PNG.
    #[must_use]
    pub fn development(&self) -> &Development {
        &self.png
    }

    /// Pixels a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The layers, in the order they were given.
    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// The layer called `name`; the picture itself for an empty name.
    #[must_use]
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }

    /// A layer of one plane or a set of planes that has a file name of its own.
    #[must_use]
    pub fn layer_of(&self, layer: LayerSpec) -> Option<&Layer> {
        self.layer(&layer.row().name)
    }

    /// The layer called `name`, or an error that says which there are.
    pub(super) fn require(&self, name: &str) -> Result<&Layer, OutputError> {
        self.layer(name).ok_or_else(|| {
            let names: Vec<_> = self.layers.iter().map(|l| format!("{:?}", l.name)).collect();
            let known = names.join(", ");
            Refusal::new(format!("the picture has no layer \"{name}\"; it has {known}")).into()
        })
    }

    /// Header entries that hold for all layers: scene hash, seed …
    #[must_use]
    pub fn header(&self) -> &[(String, String)] {
        &self.header
    }

    /// Gives the layers back, without a copy.
    #[must_use]
    pub fn into_layers(self) -> Vec<Layer> {
        self.layers
    }

    /// Every channel with its full name, in byte order of those names.
    pub(super) fn sorted_channels(&self) -> Vec<(String, &Values)> {
        self.sorted_by(Layer::full_name)
    }

    /// Every channel with its name in an EXR, in the order of an EXR: byte order of those names.
    pub(super) fn exr_channels(&self) -> Vec<(String, &Values)> {
        self.sorted_by(Layer::exr_name)
    }

    fn sorted_by(&self, name: fn(&Layer, &Channel) -> String) -> Vec<(String, &Values)> {
        let mut sorted: Vec<_> = channels(&self.layers)
            .map(|(layer, channel)| (name(layer, channel), &channel.values))
            .collect();
        sorted.sort_by(|(a, _), (b, _)| a.cmp(b));
        sorted
    }
}

fn channels(layers: &[Layer]) -> impl Iterator<Item = (&Layer, &Channel)> {
    layers.iter().flat_map(|layer| layer.channels.iter().map(move |channel| (layer, channel)))
}

fn check_shape(layer: &Layer, pixels: usize) -> Result<(), PictureError> {
    let Some(first) = layer.channels.first() else {
        return Err(PictureError::empty(&format!("layer \"{}\"", layer.name)));
    };
    for channel in &layer.channels {
        let (first, other) = (first.values.type_name(), channel.values.type_name());
        if first != other {
            let why = format!("layer \"{}\" mixes {first} with {other}", layer.title());
            return Err(Refusal::new(why).hint("split it into a layer a type").into());
        }
        let found = channel.values.len();
        if found != pixels {
            let channel = layer.full_name(channel);
            let why = format!(
                "channel \"{channel}\" has {found} values where the picture has {pixels} pixels"
            );
            return Err(Refusal::new(why).into());
        }
    }
    if let Some(needs) = lacks(layer) {
        let (layer, look) = (layer.title(), layer.look);
        let why = format!("layer \"{layer}\" looks like {look:?}, which needs {needs}");
        return Err(Refusal::new(why).into());
    }
    Ok(())
}

/// Names must be fit for every format, and differ wherever they share a space: channels in an EXR,
/// and its attributes, of which each layer and each header entry has one.
fn check_names(layers: &[Layer], header: &[(String, String)]) -> Result<(), PictureError> {
    let mut attributes = BTreeSet::new();
    let mut planes = BTreeSet::new();
    for layer in layers {
        if !layer.name.is_empty() {
            layer.name.split('.').try_for_each(|part| check_name("layer", part, &layer.name))?;
        }
        let mut entries = BTreeSet::new();
        for (key, text) in &layer.meaning {
            check_entry("entry of a layer's meaning", key, text)?;
            claim(&mut entries, key.clone())?;
        }
        for channel in &layer.channels {
            check_name("channel", &channel.name, &channel.name)?;
            claim(&mut planes, layer.full_name(channel))?;
        }
        claim(&mut attributes, layer.title())?;
    }
    for (key, text) in header {
        check_entry("header entry", key, text)?;
        claim(&mut attributes, key.clone())?;
    }
    Ok(())
}

fn check_name(what: &'static str, part: &str, name: &str) -> Result<(), PictureError> {
    let fit = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if part.is_empty() || name.len() > 64 || !part.chars().all(fit) {
        return Err(PictureError::name(what, name));
    }
    Ok(())
}

/// The keys of entries are PNG keywords too, so they may have single spaces inside.
fn check_entry(what: &'static str, key: &str, text: &str) -> Result<(), PictureError> {
    key.split(' ').try_for_each(|part| check_name(what, part, key))?;
    if text.contains('\0') {
        let why = format!("the text of \"{key}\" holds a zero byte");
        return Err(Refusal::new(why).hint("remove it").into());
    }
    Ok(())
}

fn claim(taken: &mut BTreeSet<String>, name: String) -> Result<(), PictureError> {
    if taken.contains(&name) {
        let why = format!("the name \"{name}\" is used twice; rename one of the two");
        return Err(Refusal::new(why).into());
    }
    taken.insert(name);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(name: &str, channel: &str, values: Values) -> Layer {
        let channels = vec![Channel { name: channel.into(), values }];
        Layer { name: name.into(), look: Look::Distance, channels, meaning: Vec::new() }
    }

    fn depth(values: Vec<f32>) -> Layer {
        layer("Depth", "Z", Values::F32(values))
    }

    #[test]
    fn a_nan_is_refused_with_its_layer_and_pixel() {
        // Longer than one band, so that the search has more than one piece to look through.
        let (width, height) = (256, 300);
        let mut values = vec![1.0; width * height];
        values[290 * width + 17] = f32::NAN;
        values[295 * width + 3] = f32::NAN;
        let error = Picture::new(width, height, vec![depth(values)], Vec::new()).unwrap_err();
        let start = "channel \"Depth.Z\" is NaN at column 17, row 290 ";
        assert!(error.to_string().starts_with(start), "{error}");
    }

    #[test]
    fn a_miss_is_no_fault() {
        let layers = vec![depth(vec![1.0, f32::INFINITY, f32::NEG_INFINITY, -0.0])];
        assert!(Picture::new(2, 2, layers, Vec::new()).is_ok());
    }

    #[test]
    fn a_wrong_length_is_named() {
        let error = Picture::new(2, 2, vec![depth(vec![1.0; 3])], Vec::new()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "channel \"Depth.Z\" has 3 values where the picture has 4 pixels"
        );
    }

    #[test]
    fn sizes_without_pixels_or_beyond_memory_are_refused() {
        for (width, height) in [(0, 4), (4, 0), (usize::MAX, 2)] {
            let error = Picture::new(width, height, vec![depth(Vec::new())], Vec::new());
            assert_eq!(error.unwrap_err(), PictureError::size([width, height]));
        }
    }

    #[test]
    fn channels_of_a_layer_share_a_type() {
        let mut mixed = depth(vec![1.0]);
        mixed.channels.push(Channel { name: "object".into(), values: Values::U32(vec![1]) });
        let error = Picture::new(1, 1, vec![mixed], Vec::new()).unwrap_err();
        assert!(error.to_string().contains("mixes f4 with u4"), "{error}");
    }

    #[test]
    fn names_that_a_format_cannot_take_are_refused() {
        for name in [".Depth", "Depth.", "A..B", "a/b", "Tiefe ü", "a b", &"x".repeat(65)] {
            let error =
                Picture::new(1, 1, vec![layer(name, "Z", Values::F32(vec![1.0]))], Vec::new())
                    .unwrap_err();
            assert!(error.to_string().contains("cannot name a layer"), "{name}: {error}");
        }
        for (key, fits) in [("taken along", true), (" a", false), ("a  b", false), ("a:b", false)] {
            let mut depth = depth(vec![1.0]);
            depth.meaning = vec![(key.into(), "text".into())];
            assert_eq!(Picture::new(1, 1, vec![depth], Vec::new()).is_ok(), fits, "{key}");
        }
        let dotted = layer("View.3_4", "Z", Values::F32(vec![1.0]));
        assert!(Picture::new(1, 1, vec![dotted], Vec::new()).is_ok());
    }

    #[test]
    fn names_that_would_meet_in_a_file_are_refused() {
        let twice = vec![depth(vec![1.0]), depth(vec![1.0])];
        let error = Picture::new(1, 1, twice, Vec::new()).unwrap_err();
        assert!(error.to_string().contains("\"Depth.Z\" is used twice"), "{error}");

        let header = vec![("Depth".to_owned(), "1".to_owned())];
        let error = Picture::new(1, 1, vec![depth(vec![1.0])], header).unwrap_err();
        assert!(error.to_string().contains("\"Depth\" is used twice"), "{error}");
    }
}
