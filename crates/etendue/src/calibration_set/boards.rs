//! A chessboard before a camera, in poses from which it is calibrated.

use etendue_camera::{Camera, Projection};
use glam::{DMat3, DVec3};
use serde::Serialize;
use serde_json::{Value, json};

use super::options::CalibrationOptions;

/// The share of the picture's width or height that the board fills, whichever is reached first.
const FILLED: f64 = 0.5;

/// Tilt of boards (degrees).
const TILT: f64 = 25.0;

/// Places of boards, as shares of the way from the middle of the picture to where they would reach its edge.
const PLACES: [[f64; 2]; 9] = [
    [0.0, 0.0],
    [-0.8, 0.8],
    [0.8, -0.8],
    [0.8, 0.8],
    [-0.8, -0.8],
    [0.0, 0.8],
    [-0.8, 0.0],
    [0.8, 0.0],
    [0.0, -0.8],
];

/// A chessboard and where it is held.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Board {
    /// Columns and rows of squares; the inner corners are one fewer each.
    squares: [u32; 2],
    /// A side of a square (m).
    square_m: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) poses: Vec<BoardPose>,
    #[serde(skip)]
    camera_rotation: DMat3,
    #[serde(skip)]
    camera_position: DVec3,
}

/// Place of a board, and places where its inner corners are seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct BoardPose {
    /// From the board's frame (x along rows, y down columns, z away from the viewer, the first inner corner at 0) to the
    /// camera's of OpenCV (x right, y down, z ahead), by rows.
    rotation: [[f64; 3]; 3],
    /// Of the board's origin in the camera's frame (m).
    translation: [f64; 3],
    /// Inner corners by rows: columns and rows of the whole chip (pixels, the middle of the first pixel at 0, as OpenCV
    /// counts), by their chief rays; `null` for what the lens does not show.
    corners: Vec<Option<[f64; 2]>>,
}

impl Board {
    /// A board before the camera of a scene, in so many poses.
    pub(super) fn before(
        camera: &Camera,
        options: &CalibrationOptions,
        count: u32,
    ) -> Result<Self, String> {
        let distance = match options.distance {
            Some(distance) => distance,
            None => focus_of(camera)?,
        };
        let half = half_extent(camera, distance)?;
        let [columns, rows] = options.squares.map(f64::from);
        // With a margin of a square all around.
        let [wide, tall] = [columns + 2.0, rows + 2.0];
        let fitting = FILLED * 2.0 * (half[0] / wide).min(half[1] / tall);
        let square = options.square.unwrap_or(fitting);
        let free = [half[0] - 0.5 * wide * square, half[1] - 0.5 * tall * square];
        if free.iter().any(|way| *way <= 0.0) {
            return Err(format!(
                "--square {square} m: a board of {columns} x {rows} such squares is larger than what the camera sees at {distance} m; \
                 {fitting:.4} m fills half of the picture"
            ));
        }
        let pose = camera.pose();
        // Columns of the camera's axes, as OpenCV has them.
        let camera_rotation = DMat3::from_cols(pose.right(), -pose.up(), pose.forward());
        let camera_position = pose.position;
        let mut board = Self {
            squares: options.squares,
            square_m: square,
            poses: Vec::new(),
            camera_rotation,
            camera_position,
        };
        for number in 0..count {
            board.poses.push(board.pose(camera, number, distance, free));
        }
        Ok(board)
    }

    fn pose(&self, camera: &Camera, number: u32, distance: f64, free: [f64; 2]) -> BoardPose {
        let place = PLACES[number as usize % PLACES.len()];
        // Tilts go around, about axes that differ from pose to pose by the golden angle.
        let axis = f64::from(number) * 2.399_963;
        let tilt = if number == 0 { 0.0 } else { TILT.to_radians() };
        let axis = DVec3::new(axis.cos(), axis.sin(), 0.0);
        let rotation = DMat3::from_axis_angle(axis, tilt);
        let middle = DVec3::new(0.75 * place[0] * free[0], 0.75 * place[1] * free[1], distance);
        let translation = middle + rotation * self.middle() * -1.0;
        let [columns, rows] = self.squares;
        let mut corners = Vec::new();
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let at = DVec3::new(f64::from(column), f64::from(row), 0.0) * self.square_m;
                let seen = rotation * at + translation;
                let offset = self.camera_rotation * seen;
                corners.push(camera.place_of(offset).map(|[x, y]| [x - 0.5, y - 0.5]));
            }
        }
        BoardPose { rotation: by_rows(rotation), translation: translation.into(), corners }
    }

    /// The board's middle from its first inner corner.
    fn middle(&self) -> DVec3 {
        let [columns, rows] = self.squares.map(|count| f64::from(count) * 0.5 - 1.0);
        DVec3::new(columns, rows, 0.0) * self.square_m
    }

    /// The board in a pose as objects of a scene: every square, and a white margin, side by side in one plane.
    pub(super) fn objects(&self, pose: &BoardPose) -> Vec<Value> {
        let [columns, rows] = self.squares;
        let square = self.square_m;
        let mut objects = Vec::new();
        let mut add = |[x, y]: [f64; 2], [width, height]: [f64; 2], material: &str| {
            objects.push(json!({
                "shape": "rectangle", "width": width * square, "height": height * square, "material": material,
                "transform": { "matrix": self.matrix(pose, DVec3::new(x, y, 0.0) * square) },
            }));
        };
        for row in 0..rows {
            for column in 0..columns {
                let material = if (row + column) % 2 == 0 { "black" } else { "white" };
                add([f64::from(column) - 0.5, f64::from(row) - 0.5], [1.0, 1.0], material);
            }
        }
        let [wide, tall] = self.squares.map(f64::from);
        let middle = [0.5 * wide - 1.0, 0.5 * tall - 1.0];
        for end in [-1.5, wide - 0.5] {
            add([end, middle[1]], [1.0, tall + 2.0], "white");
        }
        for end in [-1.5, tall - 0.5] {
            add([middle[0], end], [wide, 1.0], "white");
        }
        objects
    }

    /// From a rectangle, which faces +Z, to a place of the board in the world.
    fn matrix(&self, pose: &BoardPose, at: DVec3) -> [[f64; 4]; 4] {
        let [a, b, c] = pose.rotation.map(DVec3::from);
        let rotation = DMat3::from_cols(a, b, c).transpose();
        let centre = self.camera_rotation * (rotation * at + DVec3::from(pose.translation));
        let centre = centre + self.camera_position;
        // Its x as the board's, its y upwards, its z towards the viewer.
        let turned =
            self.camera_rotation * rotation * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let rows = by_rows(turned);
        let row = |k: usize| [rows[k][0], rows[k][1], rows[k][2], centre[k]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}

fn by_rows(matrix: DMat3) -> [[f64; 3]; 3] {
    let rows = matrix.transpose();
    [rows.x_axis.into(), rows.y_axis.into(), rows.z_axis.into()]
}

/// Distance at which the camera is focused (m); a metre where everything is sharp.
fn focus_of(camera: &Camera) -> Result<f64, String> {
    let Some(lens) = camera.lens() else { return Ok(1.0) };
    let distance = lens.focused().object_distance();
    match distance.is_finite() && distance > 0.0 {
        true => Ok(distance),
        false => Err(
            "--distance: the lens is focused at infinity, where no board can be\nhint: say how far it is"
                .to_owned(),
        ),
    }
}

/// A half of the width and of the height that the camera sees at a distance (m).
fn half_extent(camera: &Camera, distance: f64) -> Result<[f64; 2], String> {
    if let Projection::Views(_) = camera.projection() {
        return Err(
            "camera: many views are no camera to calibrate\nhint: take one with a lens or a pinhole"
                .to_owned(),
        );
    }
    let [columns, rows] = camera.resolution().map(f64::from);
    let middle = [0.5 * columns, 0.5 * rows];
    let places = [[columns - 0.5, middle[1]], [middle[0], rows - 0.5]];
    let mut rays = etendue_geometry::RayBatch::default();
    let [xs, ys] = [0, 1].map(|k| places.map(|place| place[k]));
    camera.rays_through(&xs, &ys, &mut rays);
    let pose = camera.pose();
    let half = |k: usize, axis: DVec3| {
        let from = rays.origin(k) - pose.position;
        let direction = rays.direction(k);
        let way = (distance - from.dot(pose.forward())) / direction.dot(pose.forward());
        (from + way * direction).dot(axis).abs()
    };
    let half = [half(0, pose.right()), half(1, pose.up())];
    match half.iter().all(|half| half.is_finite() && *half > 0.0) {
        true => Ok(half),
        false => Err("camera: it sees no plane before it, where a board could be".to_owned()),
    }
}
