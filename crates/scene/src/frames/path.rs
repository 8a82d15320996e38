//! Paths of a camera that formulas make.

use std::f64::consts::TAU;

use etendue_camera::{Convention, Maps, Pose, PoseSpec};
use etendue_geometry::glam::{DMat3, DQuat, DVec3};

use super::{MOST_FRAMES, Start, Station, too_many};
use crate::file::CameraPath;

/// The stations of a path; the error has the key that is wrong.
pub(super) fn made(
    path: &CameraPath,
    start: &Start,
) -> Result<Vec<Station>, (&'static str, String)> {
    let poses = match path {
        CameraPath::Orbit { count, center, axis, angle } => {
            let center = center.map_or(start.center, DVec3::from);
            let axis = DVec3::from(*axis)
                .try_normalize()
                .ok_or_else(|| ("axis", "the axis has no direction".to_owned()))?;
            let count = some("count", *count)?;
            let whole = angle.0.to_radians();
            // A full turn would show its first picture twice.
            let is_closed = (whole.abs() / TAU).fract() == 0.0;
            let steps = if is_closed { count } else { (count - 1).max(1) };
            let turned = |i: u32| {
                let turn = DQuat::from_axis_angle(axis, whole * f64::from(i) / f64::from(steps));
                Pose {
                    rotation: DMat3::from_quat(turn) * start.pose.rotation,
                    position: center + turn * (start.pose.position - center),
                }
            };
            (0..count).map(turned).collect()
        }
        CameraPath::Dolly { count, to, look_at } => {
            let count = some("count", *count)?;
            let at = |i: u32| -> Result<Pose, (&'static str, String)> {
                let share = f64::from(i) / f64::from((count - 1).max(1));
                let position = start.pose.position.lerp(DVec3::from(*to), share);
                match look_at {
                    None => Ok(Pose { position, ..start.pose }),
                    Some(target) => Pose::look_at(position, DVec3::from(*target), start.pose.up())
                        .ok_or_else(|| {
                            ("look_at", format!("frame {i} would stand in it, or look up"))
                        }),
                }
            };
            (0..count).map(at).collect::<Result<Vec<_>, _>>()?
        }
        CameraPath::Grid { columns, rows, spacing } => {
            let (columns, rows) = (some("columns", *columns)?, some("rows", *rows)?);
            let count = columns as usize * rows as usize;
            if count > MOST_FRAMES {
                return Err(("columns", too_many(count)));
            }
            let offset = |i: u32, of: u32| (f64::from(i) - 0.5 * f64::from(of - 1)) * spacing.0;
            let right = |column: u32| start.pose.right() * offset(column, columns);
            let down = |row: u32| -start.pose.up() * offset(row, rows);
            let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
            all.map(|(row, column)| Pose {
                position: start.pose.position + right(column) + down(row),
                ..start.pose
            })
            .collect()
        }
        CameraPath::Poses { .. }
        | CameraPath::Trajectory { .. }
        | CameraPath::Animation { .. }
        | CameraPath::Cameras {}
        | CameraPath::Rig { .. } => Vec::new(),
    };
    Ok(poses.into_iter().map(|pose| Station::new(spec_of(&pose))).collect())
}

fn some(key: &'static str, count: u32) -> Result<u32, (&'static str, String)> {
    match count {
        0 => Err((key, "at least one frame is needed".to_owned())),
        count if count as usize > MOST_FRAMES => Err((key, too_many(count as usize))),
        count => Ok(count),
    }
}

/// A pose in the words of a scene file.
pub(super) fn spec_of(pose: &Pose) -> PoseSpec {
    let matrix = pose.world_from_camera(Convention::Opengl).transpose().to_cols_array_2d();
    PoseSpec::Matrix { matrix, maps: Maps::WorldFromCamera, convention: Convention::Opengl }
}
