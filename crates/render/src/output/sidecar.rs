//! JSON beside the images: what an NPY cannot say about itself.

use std::io::Write;
use std::path::Path;

use etendue_scene::escape::printable_json;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::DENOISED;
use super::{HeaderEntry, OutputError, Picture};
use etendue_files::{SOFTWARE, Transaction};

/// Names and texts as a JSON object, in their own order; a text that is an object in JSON is that object.
#[derive(Debug)]
pub(super) struct Entries<'a>(pub(super) &'a [HeaderEntry]);

impl Serialize for Entries<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let value = |text: &String| match serde_json::from_str(text) {
            Ok(object @ Value::Object(_)) => object,
            _ => Value::from(text.as_str()),
        };
        serializer.collect_map(self.0.iter().map(|entry| (&entry.key, value(&entry.text))))
    }
}

/// Description of a picture, without its values.
#[derive(Debug, Serialize)]
struct Description<'a> {
    software: &'static str,
    width: usize,
    height: usize,
    rows: &'static str,
    header: Entries<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    picture_png: Option<Value>,
    layers: Vec<LayerDescription<'a>>,
}

#[derive(Debug, Serialize)]
struct LayerDescription<'a> {
    name: String,
    channels: Vec<String>,
    #[serde(rename = "type")]
    type_name: &'static str,
    meaning: Entries<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    names: Option<&'a Value>,
}

/// Writes what `picture` holds to `path`: size, header entries, and of each layer the name, the
/// channels (by their names in an EXR), numpy's type, the meaning, and what its numbers name.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write(files: &Transaction, path: &Path, picture: &Picture) -> Result<(), OutputError> {
    let layers = picture.layers().iter().map(|layer| LayerDescription {
        name: layer.title(),
        channels: layer.channels.iter().map(|channel| layer.exr_name(channel)).collect(),
        type_name: layer.type_name(),
        meaning: Entries(&layer.meaning),
        names: picture.names(&layer.name),
    });
    let description = Description {
        software: SOFTWARE,
        width: picture.width(),
        height: picture.height(),
        rows: "row 0 is the top, pixels run from left to right",
        header: Entries(picture.header()),
        picture_png: picture.layer("").map(|_| picture_png(picture)),
        layers: layers.collect(),
    };
    write_json(files, path, &description)
}

/// Description of what `picture.png` shows, and how.
fn picture_png(picture: &Picture) -> Value {
    let mut png = picture.development().in_json();
    if let Some(layer) = picture.layer(DENOISED) {
        png["layer"] = layer.title().into();
    }
    png
}

/// Writes `value` to `path` as indented JSON: reports, camera files and the like.
///
/// # Errors
///
/// When the file cannot be written, or when `value` has no form in JSON.
pub fn write_json(
    files: &Transaction,
    path: &Path,
    value: &impl Serialize,
) -> Result<(), OutputError> {
    let json =
        serde_json::to_string_pretty(value).map_err(|error| OutputError::format(path, error))?;
    Ok(files.write(path, |part| writeln!(part, "{}", printable_json(&json)))?)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{Channel, Layer, Look, Values};
    use super::*;

    #[test]
    fn says_what_the_layers_are() {
        let depth = Layer {
            name: "Depth".into(),
            look: Look::Distance,
            channels: vec![Channel { name: "Z".into(), values: Values::F32(vec![1.0, 2.0]) }],
            meaning: vec![HeaderEntry::new("unit", "m"), HeaderEntry::new("miss", "+inf")],
        };
        let header = [("seed", "3 \"quoted\""), ("camera", r#"{"K": [1.5]}"#)]
            .map(|(key, text)| HeaderEntry::new(key, text))
            .to_vec();
        let picture = Picture::new(2, 1, vec![depth], header).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("layers.json");
        write(&Transaction::at_once(), &path, &picture).unwrap();
        let read = fs::read_to_string(path).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read).unwrap();
        assert_eq!(json["width"], 2);
        assert_eq!(json["header"]["seed"], "3 \"quoted\"");
        assert_eq!(json["header"]["camera"]["K"][0], 1.5);
        assert_eq!(json["layers"][0]["channels"][0], "Depth.Z");
        assert_eq!(json["layers"][0]["type"], "f4");
        let (unit, miss) = (read.find("\"unit\"").unwrap(), read.find("\"miss\"").unwrap());
        assert!(unit < miss, "the order given is kept");
    }
}
