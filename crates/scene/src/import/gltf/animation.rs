//! Animations at one moment: what their channels make of the nodes' translations, rotations, scales and
//! weights (glTF 2.0, section 3.11; interpolation by its appendix C).

use serde::Deserialize;
use serde_json::{Map, Value};

use super::reader::GltfReader;
use super::tracks::{KeyInterpolation, KeyProperty, NodeChange, PropertyTrack};
use crate::file::{ScenePath, read_value};
use crate::import::error::{Note, NoteKind};
use crate::import::{Import, Play, Refusal};

/// An animation.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Animation {
    channels: Vec<KeyChannel>,
    samplers: Vec<KeySampler>,
}

/// Property of a node that a sampler moves.
#[derive(Debug, Deserialize)]
struct KeyChannel {
    sampler: usize,
    target: KeyTarget,
}

#[derive(Debug, Deserialize)]
struct KeyTarget {
    node: Option<usize>,
    path: String,
    #[serde(default)]
    extensions: Map<String, Value>,
}

impl KeyTarget {
    /// Name of what is moved, in words: a path, or a pointer of `KHR_animation_pointer`.
    fn words(&self) -> &str {
        let extension = self.extensions.get("KHR_animation_pointer");
        let pointer = extension.and_then(|e| e.get("pointer")).and_then(Value::as_str);
        pointer.unwrap_or(&self.path)
    }

    /// The node and its property; `None` for what is no node's.
    fn aim(&self) -> Option<(usize, KeyProperty)> {
        let words = self.words();
        let (node, path) = match words.strip_prefix("/nodes/").and_then(|rest| rest.split_once('/'))
        {
            Some((node, path)) => (node.parse().ok(), path),
            None => (self.node, words),
        };
        let property = match path {
            "translation" => KeyProperty::Translation,
            "rotation" => KeyProperty::Rotation,
            "scale" => KeyProperty::Scale,
            "weights" => KeyProperty::Weights,
            _ => return None,
        };
        Some((node?, property))
    }
}

/// Times and values, as accessors.
#[derive(Debug, Deserialize)]
struct KeySampler {
    input: usize,
    output: usize,
    interpolation: Option<String>,
}

/// The nodes that the animation moves, as they are at its time.
pub(super) fn moved(
    reader: &GltfReader<'_>,
    play: &Play,
    import: &mut Import,
) -> Result<Vec<NodeChange>, Refusal> {
    let (number, animation) = chosen(reader, play)?;
    let mut moved = Vec::new();
    for (k, channel) in animation.channels.iter().enumerate() {
        let place = format!("animations[{number}].channels[{k}]");
        let Some((node, property)) = channel.target.aim() else {
            let message =
                format!("it moves \"{}\", which is left as it is", channel.target.words());
            let note = Note::new(NoteKind::Unsupported, &place, &message);
            crate::import::error::push(&mut import.notes, note);
            continue;
        };
        super::pose::exists(reader.file, node, reader.document.nodes.len(), || {
            format!("{place}.target.node")
        })?;
        let Some(sampler) = animation.samplers.get(channel.sampler) else {
            let count = animation.samplers.len();
            return Err(reader.absent(place, "sampler", channel.sampler, count));
        };
        let place = format!("animations[{number}].samplers[{}]", channel.sampler);
        let track = PropertyTrack::read(reader, sampler, property, &place)?;
        moved.push(NodeChange { node, property, values: track.at(play.time), track });
    }
    Ok(moved)
}

/// The animation by name or number, the first when none is named.
fn chosen(reader: &GltfReader<'_>, play: &Play) -> Result<(usize, Animation), Refusal> {
    let all = reader.document.animations.as_slice();
    let name = |value: &Value| value.get("name").and_then(Value::as_str).map(str::to_owned);
    let number = match &play.which {
        None => 0,
        Some(wanted) => {
            let named = all.iter().position(|value| name(value).as_deref() == Some(wanted));
            named.or_else(|| wanted.parse().ok()).unwrap_or(usize::MAX)
        }
    };
    let Some(value) = all.get(number) else {
        let known: Vec<String> = all
            .iter()
            .enumerate()
            .map(|(k, value)| format!("{k} \"{}\"", name(value).unwrap_or_default()))
            .collect();
        let reason = match (&play.which, known.as_slice()) {
            (_, []) => "there is none\nhint: take `animation` out of the scene".to_owned(),
            (Some(wanted), known) => {
                format!("there is no animation \"{wanted}\"; the file has {}", known.join(", "))
            }
            (None, _) => "there is none".to_owned(),
        };
        return Err(reader.damaged("animations", reason));
    };
    let animation = read_value(value).map_err(|(inside, why)| {
        reader.damaged(ScenePath::of("animations").index(number).join(inside), why)
    })?;
    Ok((number, animation))
}

impl PropertyTrack {
    fn read(
        reader: &GltfReader<'_>,
        sampler: &KeySampler,
        property: KeyProperty,
        place: &str,
    ) -> Result<Self, Refusal> {
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => KeyInterpolation::Linear,
            Some("STEP") => KeyInterpolation::Step,
            Some("CUBICSPLINE") => KeyInterpolation::CubicSpline,
            Some(other) => {
                let reason = format!(
                    "\"{other}\" is none of STEP, LINEAR and CUBICSPLINE\nhint: export the file again"
                );
                return Err(reader.damaged(format!("{place}.interpolation"), reason));
            }
        };
        let times = numbers::<1>(reader, sampler.input, &format!("{place}.input"))?;
        let grows = times.is_sorted_by(|a, b| a < b);
        if times.is_empty() || !grows {
            let reason = "its times do not grow from key to key, or there is none; export it again";
            return Err(reader.damaged(format!("{place}.input"), reason));
        }
        let place = format!("{place}.output");
        let values = match property {
            KeyProperty::Translation | KeyProperty::Scale => {
                numbers::<3>(reader, sampler.output, &place)?
            }
            KeyProperty::Rotation => numbers::<4>(reader, sampler.output, &place)?,
            KeyProperty::Weights => numbers::<1>(reader, sampler.output, &place)?,
        };
        let parts = if interpolation == KeyInterpolation::CubicSpline { 3 } else { 1 };
        let width = match property {
            KeyProperty::Translation | KeyProperty::Scale => 3,
            KeyProperty::Rotation => 4,
            KeyProperty::Weights => values.len() / (parts * times.len()),
        };
        if values.len() != width * parts * times.len() || width == 0 {
            let reason = format!(
                "{} numbers for {} keys\nhint: export the file again",
                values.len(),
                times.len()
            );
            return Err(reader.damaged(place, reason));
        }
        Ok(Self { property, interpolation, times, width, values })
    }
}

/// All numbers of an accessor of so many components, finite.
fn numbers<const N: usize>(
    reader: &GltfReader<'_>,
    accessor: usize,
    place: &str,
) -> Result<Vec<f64>, Refusal> {
    let accessor = reader.accessor(accessor, place)?;
    let values = (accessor.components == N).then(|| accessor.floats::<N>(0.0)).flatten();
    let Some(values) = values else {
        let reason = format!("{} components where {N} are due", accessor.components);
        return Err(reader.damaged(place, reason + "\nhint: export the file again"));
    };
    let numbers: Vec<f64> = (0..values.len()).flat_map(|i| values.get(i)).map(f64::from).collect();
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok(numbers),
        false => Err(reader.damaged(place, "a number is not finite\nhint: export the file again")),
    }
}
