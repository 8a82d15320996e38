//! Vertices as a node shows them: morph targets by their weights, then the joints of a skin
//! (glTF 2.0, sections 3.7.2.2 and 3.7.3.1).

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Positions, Transform, Vertices};
use gltf::json;
use json::mesh::{MorphTarget, Semantic};
use rayon::prelude::*;

use super::hierarchy::Shape;
use super::primitive::Part;
use super::skin::Skin;
use crate::import::note::NoteKind;
use crate::import::precision::{precise_enough, single};
use crate::import::{ImportError, Strictness};

/// How far the sum of a vertex's weights may be from 1 before it is said: numbers of three digits
/// are, and 8 bits, whose sum exporters make 255, are not.
const WEIGHTS_OFF: f64 = 2e-3;

/// The positions and normals of a primitive.
pub(super) struct Corners {
    pub positions: Positions,
    pub normals: Option<Vertices<3>>,
    /// Whether a skin placed them in the model's frame, and its node no longer does.
    pub skinned: bool,
    /// Whether the skin turned the triangles inside out.
    pub mirrored: bool,
}

/// Bytes that a position or normal takes while it is moved: as it is moved, and as it is kept.
const BYTES_PER_VECTOR: u64 = 2 * size_of::<DVec3>() as u64;

/// The numbers and weights of the joints that carry each vertex, four a set.
struct Influences {
    sets: Vec<[Vertices<4>; 2]>,
}

impl Part<'_> {
    /// The primitive's `positions` and `normals` as `shape` has them; the very same when it neither
    /// morphs nor has a skin.
    pub(super) fn deformed(
        &mut self,
        shape: &Shape,
        skin: Option<&Skin>,
        positions: Vertices<3>,
        normals: Option<Vertices<3>>,
    ) -> Result<Corners, ImportError> {
        let influences = match skin {
            Some(skin) => self.influences(skin, positions.len())?,
            None => None,
        };
        let weights = self.target_weights(shape)?;
        if influences.is_none() && weights.is_empty() {
            let positions = Positions::F32(positions);
            return Ok(Corners { positions, normals, skinned: false, mirrored: false });
        }
        let vertices = (positions.len() + normals.as_ref().map_or(0, Vertices::len)) as u64;
        self.reader.files.take(vertices * BYTES_PER_VECTOR, || self.place.clone())?;
        let mut points = doubles(&positions);
        self.morph(&mut points, &weights, "POSITION", |target| &target.positions)?;
        let mut directions = normals.as_ref().map(doubles);
        if let Some(directions) = &mut directions {
            self.morph(directions, &weights, "NORMAL", |target| &target.normals)?;
        }
        if let (Some(skin), Some(influences)) = (skin, &influences) {
            influences.apply(skin, &mut points, directions.as_deref_mut());
        }
        let unit = |normal: DVec3| normal.normalize_or_zero().to_array().map(single);
        let normals = directions.map(|directions| {
            let units: Vec<[f32; 3]> = directions.into_par_iter().map(unit).collect();
            Vertices::from_arrays(&units)
        });
        let points: Vec<[f64; 3]> = points.into_par_iter().map(|p| p.to_array()).collect();
        let skinned = influences.is_some();
        let mirrored = skinned && skin.is_some_and(Skin::mirrors);
        Ok(Corners { positions: precise_enough(&points), normals, skinned, mirrored })
    }

    /// The morph targets that `shape` gives a weight, with it.
    fn target_weights(&mut self, shape: &Shape) -> Result<Vec<(usize, f64)>, ImportError> {
        let targets = self.primitive.targets.as_ref().map_or(0, Vec::len);
        let weights: Vec<f64> = shape.weights().collect();
        if weights.len() != targets && !weights.is_empty() {
            let reason = format!("{} weights for {targets} morph targets", weights.len());
            self.irregular(&reason, "left out where they have no target")?;
        }
        Ok(weights.into_iter().take(targets).enumerate().filter(|&(_, w)| w != 0.0).collect())
    }

    /// Adds the targets' displacements of one attribute by their `weights`.
    fn morph(
        &mut self,
        values: &mut [DVec3],
        weights: &[(usize, f64)],
        attribute: &str,
        of: impl Fn(&MorphTarget) -> &Option<json::Index<json::Accessor>>,
    ) -> Result<(), ImportError> {
        for &(number, weight) in weights {
            let target = self.primitive.targets.as_ref().and_then(|targets| targets.get(number));
            let Some(index) = target.and_then(|target| of(target).as_ref()) else { continue };
            let place = format!("{}.targets[{number}].{attribute}", self.place);
            let accessor = self.reader.accessor(index.value(), &place)?;
            let moves = match accessor.floats::<3>(0.0) {
                Some(moves) if accessor.components == 3 => moves,
                _ => {
                    let reason = format!("it has {} components, not 3", accessor.components);
                    return Err(self.reader.damaged(place, reason + "; export the file again"));
                }
            };
            if moves.len() != values.len() {
                let reason = format!(
                    "morph target {number} moves {} of {} vertices' {attribute}",
                    moves.len(),
                    values.len()
                );
                self.irregular(&reason, "left where they are")?;
                continue;
            }
            values.par_iter_mut().enumerate().for_each(|(i, value)| {
                *value += weight * DVec3::from(moves.get(i).map(f64::from));
            });
        }
        Ok(())
    }

    /// The joints of each vertex; `None`, with a note, for a primitive that names none.
    fn influences(
        &mut self,
        skin: &Skin,
        vertices: usize,
    ) -> Result<Option<Influences>, ImportError> {
        let mut sets = Vec::new();
        // glTF numbers sets without gaps.
        while let Ok(set) = u32::try_from(sets.len()) {
            let joints = self.attribute::<4>(&Semantic::Joints(set), 0.0)?;
            let weights = self.attribute::<4>(&Semantic::Weights(set), 0.0)?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            if joints.len() != vertices || weights.len() != vertices {
                let (joints, weights) = (joints.len(), weights.len());
                return Err(self.reader.damaged(
                    format!("{}, JOINTS_{set}", self.place),
                    format!(
                        "{joints} joints and {weights} weights for {vertices} positions; export \
                         the file again"
                    ),
                ));
            }
            sets.push([joints, weights]);
        }
        if sets.is_empty() {
            let reason = "its node has a skin, but it has no JOINTS_0 with WEIGHTS_0";
            self.irregular(reason, "shown where its node stands")?;
            return Ok(None);
        }
        let influences = Influences { sets };
        self.check_joints(skin, &influences, vertices)?;
        self.check_weights(&influences, vertices)?;
        Ok(Some(influences))
    }

    /// Refuses vertices that name joints which the skin does not have.
    fn check_joints(
        &self,
        skin: &Skin,
        influences: &Influences,
        vertices: usize,
    ) -> Result<(), ImportError> {
        let count = skin.model_from_bound.len();
        let absent = |i: usize| {
            let is_absent = |&(joint, _): &(f32, f64)| number(joint, count).is_none();
            Some((i, influences.of(i).find(is_absent)?.0))
        };
        match (0..vertices).into_par_iter().find_map_first(absent) {
            Some((vertex, joint)) => Err(self.reader.damaged(
                self.place.clone(),
                format!(
                    "vertex {vertex} names joint {joint}, but its skin has {count}; export the \
                     file again"
                ),
            )),
            None => Ok(()),
        }
    }

    /// Says which weights do not sum to 1; refused when none weighs anything.
    fn check_weights(
        &mut self,
        influences: &Influences,
        vertices: usize,
    ) -> Result<(), ImportError> {
        let count = |off: &(dyn Fn(f64) -> bool + Sync)| {
            (0..vertices).into_par_iter().filter(|&i| off(influences.total(i))).count() as u64
        };
        let none = count(&|total| total == 0.0);
        if none == vertices as u64 && none > 0 {
            let reason = "all weights of its joints are 0; bind the mesh to its skin and export";
            return Err(self.reader.damaged(self.place.clone(), format!("{reason} it again")));
        }
        let off = count(&|total| total != 0.0 && (total - 1.0).abs() > WEIGHTS_OFF);
        for (found, what, done) in [
            (none, "without any weight of a joint", "moved by the skin's first joint"),
            (off, "whose joints' weights do not sum to 1", "brought to that sum"),
        ] {
            if found == 0 {
                continue;
            }
            if self.reader.options.strictness == Strictness::Strict {
                let reason = format!("{found} vertices {what}; without --strict they are {done}");
                return Err(self.reader.damaged(self.place.clone(), reason));
            }
            self.note_counted(NoteKind::Irregular, &format!("vertices {what} are {done}"), found);
        }
        Ok(())
    }
}

impl Influences {
    /// The joints of vertex `i` that weigh something, with their weights.
    fn of(&self, i: usize) -> impl Iterator<Item = (f32, f64)> {
        let set = move |[joints, weights]: &[Vertices<4>; 2]| {
            let (joints, weights) = (joints.get(i), weights.get(i));
            std::array::from_fn::<_, 4, _>(|k| (joints[k], f64::from(weights[k])))
        };
        self.sets.iter().flat_map(set).filter(|&(_, weight)| weight != 0.0)
    }

    /// The sum of the weights of vertex `i`.
    fn total(&self, i: usize) -> f64 {
        self.of(i).map(|(_, weight)| weight).sum()
    }

    /// The mean of the joint matrices of vertex `i` by their weights: linear blend skinning.
    fn blend(&self, skin: &Skin, i: usize) -> Transform {
        let joints = &skin.model_from_bound;
        let total = self.total(i);
        if total == 0.0 {
            return joints[0];
        }
        let (mut linear, mut translation) = (DMat3::ZERO, DVec3::ZERO);
        for (joint, weight) in self.of(i) {
            if let Some(joint) = number(joint, joints.len()) {
                let joint = &joints[joint];
                linear += joint.linear * (weight / total);
                translation += joint.offset_from(DVec3::ZERO) * (weight / total);
            }
        }
        Transform::new(linear, translation)
    }

    /// Moves all vertices, and turns their normals.
    fn apply(&self, skin: &Skin, points: &mut [DVec3], normals: Option<&mut [DVec3]>) {
        points.par_iter_mut().enumerate().for_each(|(i, point)| {
            *point = self.blend(skin, i).point(*point);
        });
        if let Some(normals) = normals {
            normals.par_iter_mut().enumerate().for_each(|(i, normal)| {
                *normal = self.blend(skin, i).normal_matrix() * *normal;
            });
        }
    }
}

/// The number of a joint that is one of `count`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65 535")]
fn number(joint: f32, count: usize) -> Option<usize> {
    (joint >= 0.0 && joint < count as f32).then_some(joint as usize)
}

fn doubles(values: &Vertices<3>) -> Vec<DVec3> {
    (0..values.len()).into_par_iter().map(|i| DVec3::from(values.get(i).map(f64::from))).collect()
}
