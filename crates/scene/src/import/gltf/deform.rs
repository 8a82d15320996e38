//! Vertices as a node shows them: morph targets by their weights, then the joints of a skin
//! (glTF 2.0, sections 3.7.2.2 and 3.7.3.1).
//!
//! Skins: what carries the vertices of a mesh from where they were bound to where the joints are
//! (glTF 2.0, section 3.7.3).

use gltf::json;
use json::mesh::{MorphTarget, Semantic};
use rayon::prelude::*;

use super::chains::Chains;
use super::hierarchy::NodeShape;
use super::part::PrimitiveReader;
use super::pose::{NodePoses, exists};
use super::reader::GltfReader;
use crate::import::deformer::{Deformer, Influences, Joints, Morph, number};
use crate::import::error::NoteKind;
use crate::import::precision::{precise_enough, single};
use crate::import::{Refusal, Strictness};
use etendue_geometry::glam::{DMat3, DVec3, DVec4};
use etendue_geometry::{Link, Positions, Track, Transform, Vertices};

/// Tolerance of the sum of a vertex's weights from 1 before it is said: numbers of three digits
/// are, and 8 bits, whose sum exporters make 255, are not.
const WEIGHTS_OFF: f64 = 2e-3;

/// The positions and normals of a primitive.
pub(super) struct PrimitiveCorners {
    pub positions: Positions,
    pub normals: Option<Vertices<3>>,
    /// True if they are not those of the file.
    pub is_deformed: bool,
    /// True if a skin placed the corners in the model's frame, and its node no longer does.
    pub skinned: bool,
    /// True if the skin turned the triangles inside out.
    pub mirrored: bool,
    /// Deformation from that moment on, where there is one.
    pub deformer: Option<Deformer>,
}

/// Bytes that a position or normal takes while it is moved: as the file has it, as it is moved, and as it is kept.
const BYTES_PER_VECTOR: u64 = 3 * size_of::<DVec3>() as u64;

impl PrimitiveReader<'_> {
    /// The primitive's `positions` and `normals` as `shape` has them; the very same when it neither
    /// morphs nor has a skin.
    pub(super) fn deformed(
        &mut self,
        shape: &NodeShape,
        skin: Option<&Skin>,
        positions: Vertices<3>,
        normals: Option<Vertices<3>>,
    ) -> Result<PrimitiveCorners, Refusal> {
        let influences = match skin {
            Some(skin) => self.influences(skin, positions.len())?,
            None => None,
        };
        let weights = self.target_weights(shape)?;
        if influences.is_none() && weights.is_empty() {
            let positions = Positions::F32(positions);
            return Ok(PrimitiveCorners {
                positions,
                normals,
                is_deformed: false,
                skinned: false,
                mirrored: false,
                deformer: None,
            });
        }
        let vertices = (positions.len() + normals.as_ref().map_or(0, Vertices::len)) as u64;
        self.reader.files.take(vertices * BYTES_PER_VECTOR, || self.place.clone())?;
        let count = positions.len();
        let mut morphs = Vec::new();
        for (target, weight) in weights {
            let points = self.moves(target, "POSITION", count, |target| &target.positions)?;
            let turned = match &normals {
                Some(_) => self.moves(target, "NORMAL", count, |target| &target.normals)?,
                None => None,
            };
            morphs.push(Morph { weight, points, normals: turned });
        }
        let skinned = influences.is_some();
        let mirrored = skinned && skin.is_some_and(Skin::mirrors);
        let skin = skin.zip(influences).map(|(skin, own)| (skin.model_from_bound.clone(), own));
        let deformer = Deformer {
            points: doubles(&positions),
            normals: normals.as_ref().map(doubles),
            morphs,
            skin,
            kept: std::sync::Mutex::default(),
        };
        let (points, directions) = deformer.shape(0.0);
        let normals = directions.map(|directions| {
            let unit = |normal: DVec3| normal.normalize_or_zero().to_array().map(single);
            let units: Vec<[f32; 3]> = directions.into_par_iter().map(unit).collect();
            Vertices::from_arrays(&units)
        });
        let points: Vec<[f64; 3]> = points.into_par_iter().map(|p| p.to_array()).collect();
        let plays = deformer.played_span().is_some();
        let deformer = plays.then_some(deformer);
        Ok(PrimitiveCorners {
            positions: precise_enough(&points),
            normals,
            is_deformed: true,
            skinned,
            mirrored,
            deformer,
        })
    }

    /// The morph targets to which `shape` gives a weight at some time, with it.
    fn target_weights(&mut self, shape: &NodeShape) -> Result<Vec<(usize, Track)>, Refusal> {
        let targets = self.primitive.targets.as_ref().map_or(0, Vec::len);
        let weights: Vec<Track> = match self.reader.playing.morphed.get(&shape.played_by()) {
            Some(tracks) => tracks.clone(),
            None => shape.weights().map(|w| Track::constant(DVec4::X * w)).collect(),
        };
        if weights.len() != targets && !weights.is_empty() {
            let reason = format!("{} weights for {targets} morph targets", weights.len());
            self.irregular(&reason, "left out where they have no target")?;
        }
        let counts =
            |(_, weight): &(usize, Track)| weight.keys.iter().any(|key| *key != [DVec4::ZERO; 3]);
        Ok(weights.into_iter().take(targets).enumerate().filter(counts).collect())
    }

    /// Offsets that a target adds to one attribute of all `count` vertices; `None` where it leaves that alone.
    fn moves(
        &mut self,
        number: usize,
        attribute: &str,
        count: usize,
        of: impl Fn(&MorphTarget) -> &Option<json::Index<json::Accessor>>,
    ) -> Result<Option<Vertices<3>>, Refusal> {
        let target = self.primitive.targets.as_ref().and_then(|targets| targets.get(number));
        let Some(index) = target.and_then(|target| of(target).as_ref()) else { return Ok(None) };
        let place = format!("{}.targets[{number}].{attribute}", self.place);
        let accessor = self.reader.accessor(index.value(), &place)?;
        let moves = match accessor.floats::<3>(0.0) {
            Some(moves) if accessor.components == 3 => moves,
            _ => {
                let reason = format!("it has {} components, not 3", accessor.components);
                return Err(self.reader.damaged(place, reason + "\nhint: export the file again"));
            }
        };
        if moves.len() != count {
            let reason = format!(
                "morph target {number} moves {} of {count} vertices' {attribute}",
                moves.len()
            );
            self.irregular(&reason, "left where they are")?;
            return Ok(None);
        }
        Ok(Some(moves))
    }

    /// The joints of each vertex; `None`, with a note, for a primitive that names none.
    fn influences(&mut self, skin: &Skin, vertices: usize) -> Result<Option<Influences>, Refusal> {
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
                        "{joints} joints and {weights} weights for {vertices} positions\nhint: export \
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
    ) -> Result<(), Refusal> {
        let count = skin.model_from_bound.0.len();
        let absent = |i: usize| {
            let is_absent = |&(joint, _): &(f32, f64)| number(joint, count).is_none();
            Some((i, influences.of(i).find(is_absent)?.0))
        };
        match (0..vertices).into_par_iter().find_map_first(absent) {
            Some((vertex, joint)) => Err(self.reader.damaged(
                self.place.clone(),
                format!(
                    "vertex {vertex} names joint {joint}, but its skin has {count}\nhint: export the \
                     file again"
                ),
            )),
            None => Ok(()),
        }
    }

    /// Says which weights do not sum to 1; refused when none weighs anything.
    fn check_weights(&mut self, influences: &Influences, vertices: usize) -> Result<(), Refusal> {
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

fn doubles(values: &Vertices<3>) -> Vec<DVec3> {
    (0..values.len()).into_par_iter().map(|i| DVec3::from(values.get(i).map(f64::from))).collect()
}

/// Joints that the vertices of a mesh can name: their numbers have 16 bits.
const MOST_JOINTS: usize = 1 << 16;

/// Tolerance of the last row of an inverse bind matrix from 0 0 0 1: exporters invert in f32.
const LAST_ROW: f32 = 1e-3;

/// A skin in a pose, and how it goes on from there.
pub(super) struct Skin {
    /// From the mesh's frame, as bound, to the model's, by joint (m).
    pub model_from_bound: Joints,
}

impl Skin {
    /// Skin `index`, which node `user` wears, with its joints standing as in `pose`, and going on by
    /// `chains`.
    ///
    /// # Errors
    ///
    /// When the skin or a joint is absent, a joint stands nowhere, or an inverse bind matrix is
    /// missing or not finite.
    pub(super) fn read(
        reader: &GltfReader<'_>,
        index: usize,
        user: usize,
        pose: &NodePoses,
        chains: &Chains<'_>,
    ) -> Result<Self, Refusal> {
        let document = reader.document;
        let Some(skin) = document.skins.get(index) else {
            let from = format!("nodes[{user}].skin");
            return Err(reader.absent(from, "skin", index, document.skins.len()));
        };
        let place = format!("skins[{index}].joints");
        match skin.joints.len() {
            0 => return Err(reader.damaged(place, "it has none\nhint: export the file again")),
            n if n > MOST_JOINTS => {
                let reason =
                    format!("{n} are more than vertices can name ({MOST_JOINTS})\nhint: split");
                return Err(reader.damaged(place, format!("{reason} the skin")));
            }
            _ => {}
        }
        let bound = inverse_bind_matrices(reader, index)?;
        let mut model_from_bound = Vec::with_capacity(skin.joints.len());
        for (k, &joint) in skin.joints.iter().enumerate() {
            let place = || format!("{place}[{k}]");
            exists(reader.file, joint, document.nodes.len(), place)?;
            let Some(model_from_joint) = pose.of(joint) else {
                let reason =
                    "stands nowhere: it is its own ancestor, or its transform or one above";
                return Err(reader.damaged(
                    place(),
                    format!("node {joint} {reason} is not finite\nhint: export the file again"),
                ));
            };
            let joint_from_bound = bound.get(k).copied().unwrap_or_default();
            let moved = model_from_joint.then_inner(&joint_from_bound);
            if !moved.is_finite() {
                return Err(reader.damaged(place(), "its joint matrix is not finite"));
            }
            let mut links = chains.of(joint);
            match links.is_empty() {
                true => links.push(Link::Fixed(moved)),
                false => links.push(Link::Fixed(joint_from_bound)),
            }
            model_from_bound.push(links);
        }
        Ok(Self { model_from_bound: Joints(model_from_bound) })
    }

    /// True if the joints turn triangles inside out.
    pub(super) fn mirrors(&self) -> bool {
        self.model_from_bound.at(0.0).iter().all(|joint| joint.linear.determinant() < 0.0)
    }
}

/// The inverse bind matrices of skin `index`; none when it has none, which stands for the identity.
fn inverse_bind_matrices(reader: &GltfReader<'_>, index: usize) -> Result<Vec<Transform>, Refusal> {
    let skin = &reader.document.skins[index];
    let Some(accessor) = skin.inverse_bind_matrices else { return Ok(Vec::new()) };
    let place = format!("skins[{index}].inverseBindMatrices");
    let accessor = reader.accessor(accessor, &place)?;
    let joints = skin.joints.len();
    if accessor.components != 16 || accessor.count < joints {
        let reason = format!(
            "{} elements of {} numbers for {joints} joints\nhint: export the file again, with a 4 × 4 \
             matrix a joint",
            accessor.count, accessor.components
        );
        return Err(reader.damaged(place, reason));
    }
    let matrices = accessor.floats::<16>(0.0);
    let matrix = |k: usize| {
        let matrix = matrices.as_ref().map_or([f32::NAN; 16], |matrices| matrices.get(k));
        affine(matrix).ok_or_else(|| {
            let reason = "it is not finite, or its last row is not 0 0 0 1; export the file again";
            reader.damaged(format!("{place}, matrix {k}"), reason)
        })
    };
    (0..joints).map(matrix).collect()
}

/// A column-major matrix whose last row is about that of an affine map, all finite.
fn affine(matrix: [f32; 16]) -> Option<Transform> {
    let [a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, t0, t1, t2, t3] = matrix;
    let is_affine = [a3, b3, c3, t3 - 1.0].iter().all(|x| x.abs() <= LAST_ROW);
    let linear = DMat3::from_cols_array(&[a0, a1, a2, b0, b1, b2, c0, c1, c2].map(f64::from));
    let transform = Transform::new(linear, DVec3::from([t0, t1, t2].map(f64::from)));
    (is_affine && transform.is_finite()).then_some(transform)
}
