//! `geometry.json`: where the lenslets' images are, which views there are, and how disparity follows from
//! depth.

use etendue_camera::{Camera, LensCamera, LightField, PixelOrigin, ViewGrid};
use etendue_optics::element::Grid;
use serde::Serialize;

use super::centres::{Centres, Places};
use super::patches::{PatchFacts, Patches};
use super::response::ViewResponse;

/// Facts that a decoder needs, and those that it may be scored against.
#[derive(Debug, Serialize)]
pub(super) struct LightFieldGeometry {
    /// Origin of pixel coordinates.
    pixel_origin: PixelOrigin,
    /// `rect` or `hex`.
    grid: &'static str,
    /// From the middle of a lenslet's image to its next neighbour's along a row.
    pitch_px: f64,
    /// From row to row.
    row_pitch_px: f64,
    /// Angle by which rows are turned from right towards down.
    rotation_rad: f64,
    /// The middle of the image of lenslet (0, 0), the one in the first row and column.
    offset_px: Option<[f64; 2]>,
    /// Rows and columns of lenslets whose images are whole, which are those of a view.
    rows: u32,
    cols: u32,
    /// Views along each side.
    views: u32,
    /// The reason why there are no views, where there are none.
    no_views: Option<String>,
    /// From a view to the next on the sensor.
    step_px: f64,
    /// The diameter of the image of the main lens' opening.
    lens_image_diameter_px: f64,
    /// The disparity at the middle of the middle view; `null` where it sees nothing.
    expected_disparity: Option<f64>,
    /// `null` without views.
    disparity: Option<Disparity>,
    array: Option<ArrayFacts>,
    /// The middles of the lenslets' images by chief ray, `[row][column]`: x, y in pixels.
    centres_px: Option<Vec<Vec<[f64; 2]>>>,
    /// The same of red, green and blue light behind glass that tells wavelengths apart; `null` elsewhere.
    centres_by_color_px: Option<[Vec<Vec<[f64; 2]>>; 3]>,
    /// Greatest distance of these from `centres_px`.
    color_centres_apart_px: f64,
    /// True if red, green and blue views are sampled each at its own centres.
    views_by_color: bool,
    /// The centroids of the light of the same images before a uniform light, which cos⁴ and vignetting
    /// move away from the chief rays.
    centroids_px: Option<Vec<Vec<[f64; 2]>>>,
    /// The lenslets' own centres, seen square to the sensor, in pixels.
    lenslet_centres_px: Option<Vec<Vec<[f64; 2]>>>,
    /// The least that the views have, by their rays, of an ideal lens' before waves of 7 columns (dB).
    psnr_by_rays: Option<f64>,
    /// Of each view, `[down][across]`: by which parabola over its columns and rows its light is multiplied.
    gains: Option<Vec<Vec<[f64; 6]>>>,
    /// The plane of `refocused.*` (m), where it is written; `null` for infinity, too.
    refocused_m: Option<f64>,
    /// Facts by which a camera without views has its refocused picture from patches of the raw one.
    patches: Option<PatchFacts>,
    /// The reason why the camera has no such patches.
    no_patches: Option<String>,
    about: [&'static str; 6],
}

/// Disparity as a function of depth.
#[derive(Debug, Serialize)]
struct Disparity {
    formula: &'static str,
    sign: &'static str,
    unit: &'static str,
    depth: &'static str,
    baseline_m: f64,
    focal_length_px: f64,
    /// `null` for infinity.
    focus_m: Option<f64>,
    /// `baseline_m`, which is that of the camera's own rays, over that of the paraxial lens.
    baseline_share: f64,
    /// By how many columns to the right and rows down a thing of disparity 1 moves from a view to the next
    /// one along the rows of lenslets.
    move_along: [f64; 2],
    /// The same to the next one across them.
    move_across: [f64; 2],
    /// Of what the middle view sees: the least, and the greatest.
    range: Option<[f64; 2]>,
}

/// The array behind the main lens.
#[derive(Debug, Serialize)]
struct ArrayFacts {
    pitch_mm: f64,
    focal_length_mm: f64,
    /// From the array to the sensor.
    sensor_distance_mm: f64,
    /// From the main lens' exit pupil to the array; `null` for infinity.
    exit_pupil_distance_mm: Option<f64>,
    pixel_pitch_um: f64,
    first_lenslet_mm: [f64; 2],
}

const ABOUT: [&str; 6] = [
    "x runs right and y down; the picture is upright, so the sensor behind it is turned by 180 degrees",
    "view (u, v) takes the pixel at centre + step_px (u - (views - 1)/2) (cos, sin) + step_px (v - (views - \
     1)/2) (-sin, cos) of rotation_rad; u counts from the left, v from the top, and its viewpoint is that far \
     along rows and down across them in the opening",
    "row r, column c of a view is the lenslet at offset_px + pitch_px c (cos, sin) + row_pitch_px r (-sin, \
     cos) of rotation_rad; in a hex grid odd rows are half a pitch further along the row",
    "the chief ray of the main lens through a lenslet's middle ends in its image's middle: centres_px",
    "the light of that image in the white picture has its centroid at centroids_px: cos^4 and vignetting move \
     it",
    "gains: what is sampled is multiplied by the sum of these six and 1, x, y, x^2, x y, y^2, with x from -1 in \
     the first column to 1 in the last one, y so in rows, and 0 where there is but one",
];

impl LightFieldGeometry {
    pub(super) fn new(
        camera: &Camera,
        light_field: &LightField,
        grid: &ViewGrid,
        depth: &[f64],
    ) -> Self {
        // The grid, and where its lenslets are seen.
        let lenslets = &light_field.grid;
        let lens = camera.lens();
        let height = lenslets.row_height();
        let centres = lens.map(|lens| {
            by_rows(light_field, |row, col| light_field.centre(lens, row, col).map(from_centre))
        });
        // Disparities of what is seen, in the middle and at both ends.
        let disparities = || depth.iter().filter(|z| z.is_finite()).map(|&z| grid.disparity(z));
        let middle = (lenslets.rows / 2 * lenslets.cols + lenslets.cols / 2) as usize;
        let focus = grid.focus();
        let range = disparities().fold(None, |range: Option<[f64; 2]>, d| {
            Some(range.map_or([d, d], |[low, high]| [low.min(d), high.max(d)]))
        });
        Self {
            pixel_origin: PixelOrigin::Center,
            grid: match lenslets.grid {
                Grid::Square => "rect",
                Grid::Hexagonal => "hex",
            },
            pitch_px: light_field.image_pitch,
            row_pitch_px: light_field.image_pitch * height,
            rotation_rad: light_field.rotation,
            offset_px: centres.as_ref().map(|centres| centres[0][0]),
            rows: lenslets.rows,
            cols: lenslets.cols,
            views: light_field.views,
            no_views: None,
            step_px: light_field.step,
            lens_image_diameter_px: light_field.image_diameter,
            expected_disparity: depth
                .get(middle)
                .filter(|z| z.is_finite())
                .map(|&z| grid.disparity(z)),
            disparity: Some(Disparity {
                formula: "baseline_m * focal_length_px * (1 / depth_m - 1 / focus_m)",
                sign: "positive in front of the focus: times move_along (columns to the right, rows down) it is \
                       how things move to the next view along the rows of lenslets, times move_across to \
                       the next one across them",
                unit: "columns of a view per step from a view to the next",
                depth: "along the axis from the entrance pupil, in metres",
                baseline_m: grid.baseline(),
                focal_length_px: grid.focal_length(),
                focus_m: focus.is_finite().then_some(focus),
                baseline_share: light_field.pupil_share,
                move_along: [-1.0, 0.0],
                move_across: [0.0, -1.0 / height],
                range,
            }),
            array: lens.and_then(|lens| ArrayFacts::of(lens, light_field)),
            lenslet_centres_px: lens.and_then(|lens| {
                let view = lens.lenslets()?.view();
                Some(by_rows(light_field, |row, col| {
                    let at = view.centre(lenslets.cell(row, col));
                    Some(from_centre(lens.focused().pixel_of(at)))
                }))
            }),
            centroids_px: lens.map(|lens| {
                by_rows(light_field, |row, col| {
                    lens.image_centroid(lenslets.cell(row, col)).map(from_centre)
                })
            }),
            centres_px: centres,
            centres_by_color_px: None,
            color_centres_apart_px: 0.0,
            views_by_color: false,
            psnr_by_rays: None,
            gains: None,
            refocused_m: None,
            patches: None,
            no_patches: None,
            about: ABOUT,
        }
    }

    /// Says where the images of light of other wavelengths are.
    pub(super) fn bands(&mut self, centres: &Centres, light_field: &LightField) {
        let cols = light_field.grid.cols as usize;
        let rows = |places: &Places| {
            let row = |row: &[Option<[f64; 2]>]| {
                row.iter().map(|at| from_centre(at.unwrap_or_default())).collect()
            };
            places.chunks(cols).map(row).collect()
        };
        if let [red, green, blue] = centres.by_band() {
            self.centres_by_color_px = Some([red, green, blue].map(rows));
        }
        self.color_centres_apart_px = centres.apart();
        self.views_by_color = centres.are_apart();
    }

    /// Takes back what is said of views that there are not, or says how bright they are made.
    pub(super) fn judge(&mut self, no_views: Option<String>, response: Option<&ViewResponse>) {
        if no_views.is_some() {
            (self.views, self.disparity, self.expected_disparity) = (0, None, None);
        }
        self.psnr_by_rays = response.map(|response| response.worst(self.views));
        let n = self.views as usize;
        self.gains = response.filter(|_| n > 0).map(|response| {
            let factors: Vec<[f64; 6]> = response.gains.iter().map(|gain| gain.factors).collect();
            factors.chunks(n).map(<[_]>::to_vec).collect()
        });
        self.no_views = no_views;
    }
}

impl LightFieldGeometry {
    /// Says which plane the refocused picture has, and how patches make it or why they do not.
    pub(super) fn refocus(
        &mut self,
        patches: Option<&Result<Patches, String>>,
        light_field: &LightField,
    ) {
        match patches {
            Some(Ok(patches)) => {
                self.refocused_m = patches.facts.distance_m;
                self.patches = Some(patches.facts.clone());
            }
            Some(Err(why)) => self.no_patches = Some(why.clone()),
            None => self.refocused_m = light_field.refocus.filter(|distance| distance.is_finite()),
        }
    }
}

impl ArrayFacts {
    fn of(lens: &LensCamera, light_field: &LightField) -> Option<Self> {
        let view = lens.lenslets()?.view();
        Some(Self {
            pitch_mm: view.array.lattice.pitch,
            focal_length_mm: view.focal_length(0),
            sensor_distance_mm: lens.focused().sensor_z() - lens.focused().train().last_vertex(),
            exit_pupil_distance_mm: view.exit_pupil_z().map(|z| view.front_z - z),
            pixel_pitch_um: lens.focused().pixel_pitch(),
            first_lenslet_mm: view.centre(light_field.grid.cell(0, 0)).to_array(),
        })
    }
}

/// A place counted from the middle of the first pixel.
fn from_centre(place: [f64; 2]) -> [f64; 2] {
    place.map(|x| x - PixelOrigin::Center.to_corner())
}

fn by_rows(
    light_field: &LightField,
    place: impl Fn(u32, u32) -> Option<[f64; 2]>,
) -> Vec<Vec<[f64; 2]>> {
    let grid = &light_field.grid;
    let row = |row: u32| (0..grid.cols).map(|col| place(row, col).unwrap_or_default()).collect();
    (0..grid.rows).map(row).collect()
}
