//! What the pixels of views see, by rays: of the camera itself, and of the ideal lens that its views are held
//! against. Light that the lenslets and the main lens lose, and places that their aberrations move.

use etendue_camera::{Camera, CameraRays, FilmSamples, LightField, Pose, ViewGrid};
use etendue_spectrum::Bands;
use rayon::prelude::*;

/// Lenslets a side at which rays are traced; between them the light is interpolated.
const NODES: u32 = 5;

/// Rays a pixel: their mean has a thousandth of what spreads evenly over a pixel and a pupil.
const RAYS: u32 = 128;

/// How far (columns) the middle of what a view's pixel sees in the plane of disparity 0 may be from that of
/// the middle view, in addition to an ideal lens': of waves 7 columns long with an amplitude of 0.4 that is an error of 40 dB.
const MOST_SHIFT: f64 = 0.04;

/// Of an ideal view's light, the least that is made up for: below, a view looks past the rim of the images.
const LEAST_LIGHT: f64 = 0.1;

/// How a camera's views differ from an ideal lens'.
#[derive(Debug, Clone)]
pub(super) struct ViewResponse {
    /// Rows and columns of the nodes.
    nodes: [Vec<u32>; 2],
    /// Of each view, at each node: what its light is multiplied with to be that of the ideal lens.
    gains: Vec<Vec<f64>>,
    /// Disparities over those of the formula, in the mean over the field.
    pub(super) disparity_share: f64,
    /// How far (columns) what a pixel sees at disparity 0 is at most from where the middle view's pixel does,
    /// in addition to the ideal lens'.
    pub(super) worst_shift: f64,
}

/// What a pixel sees: its light, and the means of the viewpoints (views, along the rows) and of the places
/// in the plane of disparity 0 (columns) that its rays come from.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    light: f64,
    viewpoint: [f64; 2],
    place: [f64; 2],
}

impl ViewResponse {
    /// Traces the rays of a camera that is opened for red, green and blue, in green, and of its reference.
    pub(super) fn new(
        camera: &Camera,
        reference: &Camera,
        light_field: &LightField,
        grid: &ViewGrid,
    ) -> Self {
        let [cols, rows] = grid.view_resolution();
        let nodes = [rows, cols].map(spread);
        let n = light_field.views;
        let groups = camera.band_groups(&Bands::Rgb).len();
        let view = |k: u32| -> Vec<[Seen; 2]> {
            let [across, down] = [k % n, k / n];
            let node = |row: u32, col: u32| -> [Seen; 2] {
                let [right, below] = light_field.offset(across, down);
                let lens = camera.lens();
                let centre = lens.and_then(|lens| light_field.centre(lens, row, col));
                let ours = centre.map_or_else(Seen::default, |[x, y]| {
                    seen(camera, groups / 2, [x + right - 0.5, y + below - 0.5], grid)
                });
                let place = [across * cols + col, down * rows + row].map(f64::from);
                [ours, seen(reference, 0, place, grid)]
            };
            nodes[0]
                .iter()
                .flat_map(|&row| nodes[1].iter().map(move |&col| node(row, col)))
                .collect()
        };
        let views: Vec<Vec<[Seen; 2]>> = (0..n * n).into_par_iter().map(view).collect();
        // Light, shifts, and the step of viewpoints by least squares.
        let is_lit = |[ours, ideal]: &[Seen; 2]| ours.light > LEAST_LIGHT * ideal.light;
        let gain =
            |pair: &[Seen; 2]| if is_lit(pair) { pair[1].light / pair[0].light } else { 1.0 };
        let (mut worst_shift, mut sums) = (0.0_f64, [0.0; 2]);
        let middle = &views[(n / 2 * n + n / 2) as usize];
        let pairs = views.iter().flat_map(|view| view.iter().zip(middle));
        for ([ours, ideal], middle) in pairs.filter(|(pair, _)| is_lit(pair)) {
            for axis in 0..2 {
                // Distortion moves all views alike.
                let shift = |seen: usize, of: &Seen| of.place[axis] - middle[seen].place[axis];
                worst_shift = worst_shift.max((shift(0, ours) - shift(1, ideal)).abs());
                let step =
                    |seen: usize, of: &Seen| of.viewpoint[axis] - middle[seen].viewpoint[axis];
                sums[0] += step(0, ours) * step(1, ideal);
                sums[1] += step(1, ideal).powi(2);
            }
        }
        Self {
            nodes,
            gains: views.iter().map(|view| view.iter().map(gain).collect()).collect(),
            disparity_share: if n > 1 && sums[1] > 0.0 { sums[0] / sums[1] } else { 1.0 },
            worst_shift,
        }
    }

    /// Why the views are not those of an ideal lens, where they are not.
    pub(super) fn fault(&self) -> Option<String> {
        (self.worst_shift > MOST_SHIFT).then(|| {
            format!(
                "at the focus views see up to {:.3} columns beside the middle one, as the main lens or the \
                 lenslets lose or bend part of their light: close the main lens, or give lenslets that are \
                 thinner or of a longer focal length",
                self.worst_shift
            )
        })
    }

    /// What the light of a view's pixel is multiplied with to be that of the ideal lens.
    pub(super) fn gain(&self, view: u32, row: u32, col: u32) -> f64 {
        let gains = &self.gains[view as usize];
        let [(i, below), (j, right)] = [between(&self.nodes[0], row), between(&self.nodes[1], col)];
        let width = self.nodes[1].len();
        let at =
            |i: usize, j: usize| gains[i.min(self.nodes[0].len() - 1) * width + j.min(width - 1)];
        let along = |i| (1.0 - right) * at(i, j) + right * at(i, j + 1);
        (1.0 - below) * along(i) + below * along(i + 1)
    }
}

/// At most [`NODES`] of so many, the first and the last among them.
fn spread(count: u32) -> Vec<u32> {
    let last = count.saturating_sub(1);
    let steps = last.clamp(1, NODES - 1);
    let mut nodes: Vec<u32> = (0..=steps).map(|k| k * last / steps).collect();
    nodes.dedup();
    nodes
}

/// The node before a number, and the share of the way to the next.
fn between(nodes: &[u32], at: u32) -> (usize, f64) {
    let i = nodes.iter().rposition(|&node| node <= at).unwrap_or(0);
    let share =
        nodes.get(i + 1).map_or(0.0, |&next| f64::from(at - nodes[i]) / f64::from(next - nodes[i]));
    (i, share)
}

/// What a pixel of a camera sees, whose corner is at `corner` (pixels).
fn seen(camera: &Camera, group: usize, corner: [f64; 2], grid: &ViewGrid) -> Seen {
    let mut film = FilmSamples { group, ..FilmSamples::default() };
    for k in 1..=RAYS {
        // A sequence of Kronecker's in five dimensions (M. Roberts, "The unreasonable effectiveness of
        // quasirandom sequences", 2018).
        let r = |power: i32| (0.5 + f64::from(k) * 1.134_724_138_401_519_f64.powi(-power)).fract();
        film.push([corner[0] + r(1), corner[1] + r(2)], [r(3), r(4)], r(5));
    }
    let mut rays = CameraRays::default();
    camera.sample_rays(&film, &mut rays);
    let mut sum = Seen::default();
    let (sine, cosine) = grid.rotation().sin_cos();
    let along_rows =
        |[right, up]: [f64; 2]| [cosine * right - sine * up, -sine * right - cosine * up];
    for (i, weight) in rays.weight.iter().enumerate() {
        let (viewpoint, place) = crossing(camera.pose(), &rays, i, grid);
        let (viewpoint, place) = (along_rows(viewpoint), along_rows(place));
        sum.light += weight;
        for (sum, at) in sum.viewpoint.iter_mut().zip(viewpoint) {
            *sum += weight * at;
        }
        for (sum, at) in sum.place.iter_mut().zip(place) {
            *sum += weight * at;
        }
    }
    let light = sum.light.max(f64::MIN_POSITIVE);
    Seen {
        light: sum.light / f64::from(RAYS),
        viewpoint: sum.viewpoint.map(|x| x / light),
        place: sum.place.map(|x| x / light),
    }
}

/// Where a ray crosses the entrance pupil (views) and the plane of disparity 0 (columns), right and up.
fn crossing(pose: &Pose, rays: &CameraRays, i: usize, grid: &ViewGrid) -> ([f64; 2], [f64; 2]) {
    let back = pose.rotation.transpose();
    let origin = back * (rays.rays.origin(i) - pose.position);
    let direction = back * rays.rays.direction(i);
    let slopes = [direction.x, direction.y].map(|x| -x / direction.z);
    let pupil = [origin.x + slopes[0] * origin.z, origin.y + slopes[1] * origin.z];
    let vergence = 1.0 / grid.focus();
    let place = |k: usize| (slopes[k] + pupil[k] * vergence) * grid.focal_length();
    (pupil.map(|x| x / grid.baseline()), [place(0), place(1)])
}
