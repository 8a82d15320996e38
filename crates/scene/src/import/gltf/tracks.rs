//! Nodes as an animation moves them: the keys of their properties, what these are at a moment (glTF 2.0, appendix C), and
//! what goes on from there.

use std::collections::BTreeMap;
use std::path::Path;

use etendue_geometry::glam::{DQuat, DVec4};
use etendue_geometry::{self as geometry, Between, Joint};

use super::document::GltfNode;
use crate::import::Refusal;
use crate::import::error::damaged;

/// Effect of a channel on a node.
pub(super) struct NodeChange {
    pub(super) node: usize,
    pub(super) property: KeyProperty,
    pub(super) values: Vec<f64>,
    /// Its keys.
    pub(super) track: PropertyTrack,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum KeyProperty {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum KeyInterpolation {
    Step,
    Linear,
    CubicSpline,
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

/// The keys of one property.
pub(super) struct PropertyTrack {
    pub(super) property: KeyProperty,
    pub(super) interpolation: KeyInterpolation,
    /// Times of the keys (s), growing.
    pub(super) times: Vec<f64>,
    /// Numbers of a value.
    pub(super) width: usize,
    /// A value a key; for cubic splines the tangent into it, it, and the tangent out of it.
    pub(super) values: Vec<f64>,
}

impl PropertyTrack {
    /// The value at a time (s); before the first key and after the last it stands still.
    pub(super) fn at(&self, time: f64) -> Vec<f64> {
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
