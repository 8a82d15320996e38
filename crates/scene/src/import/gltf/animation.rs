//! Animations at one moment: what their channels make of the nodes' translations, rotations, scales and
//! weights (glTF 2.0, section 3.11; interpolation by its appendix C).

use std::collections::BTreeMap;
use std::path::Path;

use etendue_geometry::glam::{DQuat, DVec4};
use etendue_geometry::{self as geometry, Between, Joint};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::GltfReader;
use super::document::GltfNode;
use super::fault::damaged;
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

/// Effect of a channel on a node.
pub(super) struct NodeChange {
    node: usize,
    property: KeyProperty,
    values: Vec<f64>,
    /// Its keys.
    track: PropertyTrack,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum KeyProperty {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum KeyInterpolation {
    Step,
    Linear,
    CubicSpline,
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

/// Puts what moved in place of what the nodes have at rest.
pub(super) fn apply(
    file: &Path,
    moved: &[NodeChange],
    nodes: &mut [GltfNode],
) -> Result<(), Refusal> {
    for NodeChange { node: index, property, values, .. } in moved {
        let node = &mut nodes[*index];
        if node.matrix.is_some() && *property != KeyProperty::Weights {
            let reason = "it has a matrix and is animated, which moves translation, rotation and scale; \
                          export the file again";
            return Err(damaged(file, format!("nodes[{index}]"), reason));
        }
        match (property, &values[..]) {
            (KeyProperty::Translation, &[x, y, z]) => node.translation = Some([x, y, z]),
            (KeyProperty::Scale, &[x, y, z]) => node.scale = Some([x, y, z]),
            (KeyProperty::Rotation, &[x, y, z, w]) => node.rotation = Some([x, y, z, w]),
            _ => node.weights = Some(values.clone()),
        }
    }
    Ok(())
}

/// Nodes and weights that move while an animation plays.
#[derive(Debug, Default)]
pub(super) struct Playing {
    /// The nodes whose frames do, in s from the moment that is shown.
    pub(super) joints: BTreeMap<usize, Joint>,
    /// The weights of the nodes whose morph targets do, by target.
    pub(super) morphed: BTreeMap<usize, Vec<geometry::Track>>,
}

/// Collects what goes on from the moment `time` (s), of nodes that stand as they do then.
pub(super) fn playing(
    file: &Path,
    moved: Vec<NodeChange>,
    time: f64,
    nodes: &[GltfNode],
) -> Result<Playing, Refusal> {
    let mut playing = Playing::default();
    for NodeChange { node: index, property, track, .. } in
        moved.into_iter().filter(|it| it.track.changes())
    {
        if property == KeyProperty::Weights {
            playing.morphed.insert(index, track.each_since(time));
            continue;
        }
        let node = &nodes[index];
        let joint = playing.joints.entry(index).or_insert_with(|| {
            let rest = |value: Option<[f64; 3]>, other: [f64; 3]| {
                let [x, y, z] = value.unwrap_or(other);
                geometry::Track::constant(DVec4::new(x, y, z, 0.0))
            };
            let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
            Joint {
                translation: rest(node.translation, [0.0; 3]),
                rotation: geometry::Track::constant(DVec4::from(rotation)),
                scale: rest(node.scale, [1.0; 3]),
            }
        });
        let track = track.since(time);
        match property {
            KeyProperty::Translation => joint.translation = track,
            KeyProperty::Rotation => joint.rotation = track,
            KeyProperty::Scale | KeyProperty::Weights => joint.scale = track,
        }
    }
    for (index, joint) in &playing.joints {
        if let Some(why) = joint.fault() {
            let reason = format!(
                "{why} while its animation plays\nhint: leave `plays` out, or export it otherwise"
            );
            return Err(damaged(file, format!("nodes[{index}]"), reason));
        }
    }
    Ok(playing)
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

/// The keys of one property.
struct PropertyTrack {
    property: KeyProperty,
    interpolation: KeyInterpolation,
    /// Times of the keys (s), growing.
    times: Vec<f64>,
    /// Numbers of a value.
    width: usize,
    /// A value a key; for cubic splines the tangent into it, it, and the tangent out of it.
    values: Vec<f64>,
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

    /// The value at a time (s); before the first key and after the last it stands still.
    fn at(&self, time: f64) -> Vec<f64> {
        let after = self.times.partition_point(|&key| key <= time);
        let last = self.times.len() - 1;
        if after == 0 {
            return self.key(0).to_vec();
        }
        if after > last {
            return self.key(last).to_vec();
        }
        let (from, to) = (after - 1, after);
        let step = self.times[to] - self.times[from];
        let t = (time - self.times[from]) / step;
        match self.interpolation {
            KeyInterpolation::Step => self.key(from).to_vec(),
            KeyInterpolation::Linear if self.property == KeyProperty::Rotation => {
                slerp(self.key(from), self.key(to), t)
            }
            KeyInterpolation::Linear => {
                let pairs = self.key(from).iter().zip(self.key(to));
                pairs.map(|(a, b)| (1.0 - t) * a + t * b).collect()
            }
            KeyInterpolation::CubicSpline => {
                let (t2, t3) = (t * t, t * t * t);
                let hermite = |i: usize| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * self.key(from)[i]
                        + step * (t3 - 2.0 * t2 + t) * self.part(from, 2)[i]
                        + (3.0 * t2 - 2.0 * t3) * self.key(to)[i]
                        + step * (t3 - t2) * self.part(to, 0)[i]
                };
                (0..self.width).map(hermite).collect()
            }
        }
    }

    /// True if its value is another at some time.
    fn changes(&self) -> bool {
        let first = self.key(0);
        let is_cubic = self.interpolation == KeyInterpolation::CubicSpline && self.times.len() > 1;
        is_cubic || (1..self.times.len()).any(|key| self.key(key) != first)
    }

    /// Track of a joint, in s from `time` on.
    fn since(&self, time: f64) -> geometry::Track {
        self.picked_since(time, |numbers: &[f64]| {
            let number = |k: usize| numbers.get(k).copied().unwrap_or(0.0);
            DVec4::new(number(0), number(1), number(2), number(3))
        })
    }

    /// Tracks of each of its numbers, in s from `time` on.
    fn each_since(&self, time: f64) -> Vec<geometry::Track> {
        let of = |k: usize| self.picked_since(time, move |numbers| DVec4::X * numbers[k]);
        (0..self.width).map(of).collect()
    }

    /// A track of what `vector` picks of its numbers, in s from `time` on.
    fn picked_since(&self, time: f64, vector: impl Fn(&[f64]) -> DVec4) -> geometry::Track {
        let key = |key: usize| match self.interpolation {
            KeyInterpolation::CubicSpline => [0, 1, 2].map(|part| vector(self.part(key, part))),
            KeyInterpolation::Step | KeyInterpolation::Linear => {
                [DVec4::ZERO, vector(self.key(key)), DVec4::ZERO]
            }
        };
        geometry::Track {
            between: match self.interpolation {
                KeyInterpolation::Step => Between::Step,
                KeyInterpolation::Linear => Between::Linear,
                KeyInterpolation::CubicSpline => Between::Cubic,
            },
            times: self.times.iter().map(|key| key - time).collect(),
            keys: (0..self.times.len()).map(key).collect(),
        }
    }

    fn key(&self, key: usize) -> &[f64] {
        match self.interpolation {
            KeyInterpolation::CubicSpline => self.part(key, 1),
            KeyInterpolation::Step | KeyInterpolation::Linear => {
                &self.values[key * self.width..(key + 1) * self.width]
            }
        }
    }

    /// The tangent into a key of a cubic spline, its value, or the tangent out of it.
    fn part(&self, key: usize, part: usize) -> &[f64] {
        let start = (3 * key + part) * self.width;
        &self.values[start..start + self.width]
    }
}

/// Along the shorter way around.
fn slerp(from: &[f64], to: &[f64], t: f64) -> Vec<f64> {
    let quaternion = |q: &[f64]| DQuat::from_slice(q).normalize();
    quaternion(from).slerp(quaternion(to), t).to_array().to_vec()
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
