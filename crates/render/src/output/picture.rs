//! The layers of a render, checked once so that every writer may rely on them.

use std::collections::BTreeSet;

use serde_json::Value;

use etendue_report::Refusal;
use etendue_tracer::LayerSpec;

use super::layer::{Channel, HeaderEntry, Layer, Values};
use super::look::{Bits, LayerImage, lacks};
use super::{Development, OutputError, PictureError};
use crate::memory::NoMemory;

/// Layers of one size, with what holds for all of them. Sound by construction: no channel holds a
/// NaN, all have a value a pixel, and no two names meet in any file format.
#[derive(Debug)]
pub struct Picture {
    width: usize,
    height: usize,
    layers: Vec<Layer>,
    header: Vec<HeaderEntry>,
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
        header: Vec<HeaderEntry>,
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

    /// One of its layers, of one channel or three, as a PNG shows the picture's light.
    pub(super) fn show(&self, layer: &Layer, bits: Bits) -> Result<LayerImage, NoMemory> {
        let [alpha, backdrop] =
            [LayerSpec::Alpha, LayerSpec::Backdrop].map(|own| self.layer_of(own));
        self.png.show(layer, [alpha, backdrop], bits)
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
    pub fn header(&self) -> &[HeaderEntry] {
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
fn check_names(layers: &[Layer], header: &[HeaderEntry]) -> Result<(), PictureError> {
    let mut attributes = BTreeSet::new();
    let mut planes = BTreeSet::new();
    for layer in layers {
        if !layer.name.is_empty() {
            layer.name.split('.').try_for_each(|part| check_name("layer", part, &layer.name))?;
        }
        let mut entries = BTreeSet::new();
        for HeaderEntry { key, text } in &layer.meaning {
            check_entry("entry of a layer's meaning", key, text)?;
            claim(&mut entries, key.clone())?;
        }
        for channel in &layer.channels {
            check_name("channel", &channel.name, &channel.name)?;
            claim(&mut planes, layer.full_name(channel))?;
        }
        claim(&mut attributes, layer.title())?;
    }
    for HeaderEntry { key, text } in header {
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
    use super::super::Look;
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
            depth.meaning = vec![HeaderEntry::new(key, "text")];
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

        let header = vec![HeaderEntry::new("Depth", "1")];
        let error = Picture::new(1, 1, vec![depth(vec![1.0])], header).unwrap_err();
        assert!(error.to_string().contains("\"Depth\" is used twice"), "{error}");
    }
}
