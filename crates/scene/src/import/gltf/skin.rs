//! Skins: what carries the vertices of a mesh from where they were bound to where the joints are
//! (glTF 2.0, section 3.7.3).

use etendue_geometry::Transform;
use etendue_geometry::glam::{DMat3, DVec3};

use super::Reader;
use super::pose::{Pose, exists};
use crate::import::ImportError;

/// Joints that the vertices of a mesh can name: their numbers have 16 bits.
const MOST_JOINTS: usize = 1 << 16;

/// How far the last row of an inverse bind matrix may be from 0 0 0 1: exporters invert in f32.
const LAST_ROW: f32 = 1e-3;

/// A skin in a pose.
pub(super) struct Skin {
    /// From the mesh's frame, as bound, to the model's, by joint (m).
    pub model_from_bound: Vec<Transform>,
}

impl Skin {
    /// Skin `index`, which node `user` wears, with its joints standing as in `pose`.
    ///
    /// # Errors
    ///
    /// When the skin or a joint is absent, a joint stands nowhere, or an inverse bind matrix is
    /// missing or not finite.
    pub(super) fn read(
        reader: &Reader<'_>,
        index: usize,
        user: usize,
        pose: &Pose,
    ) -> Result<Self, ImportError> {
        let document = reader.document;
        let Some(skin) = document.skins.get(index) else {
            let from = format!("nodes[{user}].skin");
            return Err(reader.absent(from, "skin", index, document.skins.len()));
        };
        let place = format!("skins[{index}].joints");
        match skin.joints.len() {
            0 => return Err(reader.damaged(place, "it has none; export the file again")),
            n if n > MOST_JOINTS => {
                let reason = format!("{n} are more than vertices can name ({MOST_JOINTS}); split");
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
                    format!("node {joint} {reason} is not finite; export the file again"),
                ));
            };
            let joint_from_bound = bound.get(k).copied().unwrap_or_default();
            let moved = model_from_joint.then_inner(&joint_from_bound);
            if !moved.is_finite() {
                return Err(reader.damaged(place(), "its joint matrix is not finite"));
            }
            model_from_bound.push(moved);
        }
        Ok(Self { model_from_bound })
    }

    /// Whether the joints turn triangles inside out.
    pub(super) fn mirrors(&self) -> bool {
        self.model_from_bound.iter().all(|joint| joint.linear.determinant() < 0.0)
    }
}

/// The inverse bind matrices of skin `index`; none when it has none, which stands for the identity.
fn inverse_bind_matrices(reader: &Reader<'_>, index: usize) -> Result<Vec<Transform>, ImportError> {
    let skin = &reader.document.skins[index];
    let Some(accessor) = skin.inverse_bind_matrices else { return Ok(Vec::new()) };
    let place = format!("skins[{index}].inverseBindMatrices");
    let accessor = reader.accessor(accessor, &place)?;
    let joints = skin.joints.len();
    if accessor.components != 16 || accessor.count < joints {
        let reason = format!(
            "{} elements of {} numbers for {joints} joints; export the file again, with a 4 × 4 \
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
