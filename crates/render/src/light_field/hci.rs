//! The layout of the HCI 4D light-field benchmark: one PNG a view, numbered by rows from the top left,
//! `parameters.cfg`, and depth and disparity of the middle view as PFM.
//!
//! The benchmark's disparity is baseline times focal length times (1/depth − 1/focus distance) over the
//! size of a pixel, which is ours.

use std::io::Write;
use std::path::{Path, PathBuf};

use etendue_camera::ViewGrid;
use etendue_geometry::glam::DMat3;
use etendue_scene::Scene;

use super::set::LightFieldError;
use super::views::Views;
use crate::output::{Picture, pfm, png};
use etendue_files::Transaction;

/// Its files beside the views.
pub(super) const FILES: [&str; 3] = ["parameters.cfg", "gt_disp_lowres.pfm", "gt_depth_lowres.pfm"];

/// The focus distance that stands for infinity (m): the benchmark's tools divide by it.
const INFINITY: f64 = 1e9;

/// The name of view `k`.
pub(super) fn view_name(k: u32) -> String {
    format!("input_Cam{k:03}.png")
}

/// Fills the folder.
pub(super) fn write(
    transaction: &Transaction,
    folder: &Path,
    scene: &Scene,
    grid: &ViewGrid,
    views: &Views,
    shown: &Picture,
    depth: &[f64],
) -> Result<Vec<PathBuf>, LightFieldError> {
    let mut files = Vec::new();
    let n = views.views;
    for k in 0..n * n {
        let path = folder.join(view_name(k));
        let view = views.single(k % n, k / n)?.developed(*shown.development());
        png::write(transaction, &path, &view, "", png::Bits::Eight)?;
        files.push(path);
    }
    let disparity: Vec<f64> = depth.iter().map(|&z| grid.disparity(z)).collect();
    let [parameters, disparities, depths] = FILES.map(|name| folder.join(name));
    let text = parameters_of(scene, grid, &disparity);
    transaction.write(&parameters, |part| part.write_all(text.as_bytes()))?;
    pfm::write(transaction, &disparities, grid.view_resolution(), &disparity)?;
    pfm::write(transaction, &depths, grid.view_resolution(), depth)?;
    files.extend([parameters, disparities, depths]);
    Ok(files)
}

fn parameters_of(scene: &Scene, grid: &ViewGrid, disparity: &[f64]) -> String {
    let [cols, rows] = grid.view_resolution();
    let widest = f64::from(cols.max(rows));
    // Only focal length over sensor size counts; a pixel of 10 um gives both.
    let sensor = 0.01 * widest;
    let focal_length = 0.01 * grid.focal_length();
    let pose = scene.camera.pose();
    let finite = disparity.iter().copied().filter(|d| d.is_finite());
    let [low, high] = finite.fold([0.0_f64, 0.0_f64], |[low, high], d| [low.min(d), high.max(d)]);
    let focus = if grid.focus().is_finite() { grid.focus() } else { INFINITY };
    let name = scene.path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = name.unwrap_or_default().replace(char::is_control, " ");
    let views = grid.views();
    // About x, then the turned y, then the turned z.
    // The rows of views are those of lenslets, turned from right towards down.
    let turned = pose.rotation * DMat3::from_rotation_z(-grid.rotation());
    let [x, y, z] = [turned.x_axis, turned.y_axis, turned.z_axis];
    let rotation = ((-z.y).atan2(z.z), z.x.clamp(-1.0, 1.0).asin(), (-y.x).atan2(x.x));
    format!(
        "[intrinsics]\nfocal_length_mm = {focal_length}\nimage_resolution_x_px = {cols}\n\
         image_resolution_y_px = {rows}\nsensor_size_mm = {sensor}\nfstop = 100.0\n\n\
         [extrinsics]\nnum_cams_x = {views}\nnum_cams_y = {views}\nbaseline_mm = {}\n\
         focus_distance_m = {focus}\ncenter_cam_x_m = {}\ncenter_cam_y_m = {}\n\
         center_cam_z_m = {}\ncenter_cam_rx_rad = {}\ncenter_cam_ry_rad = {}\n\
         center_cam_rz_rad = {}\noffset = 0\n\n\
         [meta]\nscene = {name}\ncategory = etendue\ndisp_min = {low}\ndisp_max = {high}\n\
         depth_map_scale = 1.0\n",
        1e3 * grid.baseline(),
        pose.position.x,
        pose.position.y,
        pose.position.z,
        rotation.0,
        rotation.1,
        rotation.2,
    )
}
