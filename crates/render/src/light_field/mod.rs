//! Files that a light-field camera leaves beside its picture: a white image, where the lenslets'
//! images lie, the views decoded from the picture, the views of an ideal lens, depth and disparity
//! of the middle one, and all of it in the layout of the HCI 4D light-field benchmark.
//!
//! | module | idea |
//! |---|---|
//! | `geometry` | `geometry.json`: grid, centres, views, and the formula of disparities |
//! | `white` | the same camera before a uniform light |
//! | `views` | views as an array of five dimensions, from the raw picture and from a picture of views |
//! | `response` | what their pixels see, by rays, against an ideal lens |
//! | `gain` | what makes them as bright as it has them |
//! | `centres` | where they are sampled, and where light of other wavelengths has that |
//! | `choice` | how many of them are those of an ideal lens |
//! | `looking` | views one by one, and refocused together |
//! | `patches` | refocused pictures of focused cameras, which have no views |
//! | `hci` | the folder of the benchmark's layout |
//!
//! The layout: K. Honauer, O. Johannsen, D. Kondermann, B. Goldluecke, "A dataset and evaluation
//! methodology for depth estimation on 4D light fields", 2016.

mod centres;
mod choice;
mod gain;
mod geometry;
mod hci;
mod looking;
mod patches;
mod response;
mod set;
mod views;
mod white;

use std::path::Path;

use etendue_camera::{Camera, CameraError, LensCamera, LightField, ViewGrid};
use etendue_optics::element::Grid;
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

use crate::output::{
    Channel, HeaderEntry, Layer, Look, Outputs, Picture, PictureError, Values, exr, npy, pfm, png,
    sidecar,
};
use crate::{Plan, RenderError, RenderedScene, render};
use etendue_files::Transaction;

use centres::Centres;
use choice::ChosenViews;
use geometry::LightFieldGeometry;
pub use looking::LightFieldViews;
use patches::Patches;
pub(crate) use patches::refocused_bytes;
use set::SetWriter;
pub use set::{LightFieldError, LightFieldSet};
use views::Views;
pub use white::white_rows;

/// The names of the files of the set, in the folder of the results and below it.
#[must_use]
pub fn file_names(scene: &Scene) -> Vec<String> {
    let Some(light_field) = scene.camera.light_field() else { return Vec::new() };
    let stems = ["white", "views", "reference", "refocused", "central_depth", "central_disparity"];
    let endings = ["png", "npy", "exr", "pfm"];
    let plain = stems.iter().flat_map(|stem| endings.map(|ending| format!("{stem}.{ending}")));
    let spectra = ["views_spectrum.npy", "reference_spectrum.npy", "geometry.json"];
    let n = light_field.views;
    let single = (0..n * n).flat_map(|k| {
        let name = view_name(k % n, k / n);
        [format!("views/{name}"), format!("reference/{name}"), format!("hci/{}", hci::view_name(k))]
    });
    let hci = hci::FILES.map(|name| format!("hci/{name}"));
    plain.chain(spectra.map(str::to_owned)).chain(single).chain(hci).collect()
}

fn view_name(across: u32, down: u32) -> String {
    format!("view_{down:02}_{across:02}.png")
}

/// Writes the set of a light-field camera's `picture` into `folder`; nothing for other cameras. Told the
/// share done, `progress` answers whether to go on.
///
/// # Errors
///
/// When the reference views cannot be rendered, a file cannot be written, or `progress` says stop.
pub fn write(
    rendering: RenderedScene<'_>,
    picture: &Picture,
    files: &Transaction,
    folder: &Path,
    outputs: Outputs,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<LightFieldSet, LightFieldError> {
    let scene = rendering.scene;
    let mut set = SetWriter { files, folder, outputs, written: LightFieldSet::default() };
    let fault = |error: CameraError| RenderError::camera(error.to_string());
    let Some(chosen) = ChosenViews::of(&scene.camera, &scene.accuracy).map_err(fault)? else {
        return Ok(set.written);
    };
    let ChosenViews { light_field, reference, grid, response, no_views } = &chosen;
    let raw = scene.camera.lens();
    let depth = match no_views {
        None => central_depth(rendering, reference, outputs, &|share| progress(0.1 * share))?,
        Some(_) => Vec::new(),
    };
    // Without a lens there is nothing to open.
    let camera = scene.camera.opened(&Bands::Rgb).map_err(fault)?;
    let mut geometry = LightFieldGeometry::new(&camera, light_field, grid, &depth);
    geometry.judge(no_views.clone(), response.as_ref());
    if let Some(lens) = raw {
        let shift = scene.accuracy.view_color_shift;
        let centres = Centres::new(lens, light_field, &Bands::Rgb, shift).map_err(fault)?;
        geometry.bands(&centres, light_field);
    }
    // Without views a plane is put together from patches.
    let patches = raw
        .filter(|_| no_views.is_some())
        .map(|lens| Patches::new(lens, light_field, light_field.refocus));
    geometry.refocus(patches.as_ref(), light_field);
    sidecar::write_json(files, &set.place("geometry.json"), &geometry)?;
    let white = match raw {
        Some(_) => Some(white::picture(&camera, &scene.render, scene.accuracy.white_samples)?),
        None => None,
    };
    if let Some(white) = &white {
        set.picture("white", white)?;
    }
    if let Some(why) = no_views {
        set.written.notes.push(format!("views, depth, disparity and hci are not written: {why}"));
        set.patches(patches, picture, white.as_ref())?;
        return Ok(set.written);
    }
    set.written.notes.extend(chosen.notes(&scene.camera));
    set.depth(grid, &depth)?;
    if picture.layer("").is_none() {
        let why = "there is no picture (no tracer): views are left out of the light field's files";
        set.written.notes.push(why.to_owned());
        return Ok(set.written);
    }
    let truth = match raw.zip(response.as_ref()) {
        None => None,
        Some((lens, response)) => {
            // Gone before the reference is rendered, which takes as much again.
            let centres = by_layer(scene, lens, light_field).map_err(fault)?;
            let views = Views::decoded(picture, &centres, light_field, grid, response)?;
            set.views("views", &views, picture)?;
            set.refocused(light_field, grid, &views, picture)?;
            let truth = reference_picture(rendering, reference, outputs, &|share| {
                progress(0.1 + 0.9 * share)
            })?;
            Some(truth)
        }
    };
    let truth = truth.as_ref().unwrap_or(picture);
    let views = Views::split(truth, grid);
    set.views(if raw.is_some() { "reference" } else { "views" }, &views, truth)?;
    if raw.is_none() {
        set.refocused(light_field, grid, &views, truth)?;
    }
    match (outputs.png, grid.packing()) {
        (true, Grid::Square) => set.hci(scene, grid, &views, truth, &depth)?,
        (true, Grid::Hexagonal) => set.written.notes.push(HEXAGONAL.to_owned()),
        (false, _) => {}
    }
    Ok(set.written)
}

/// The centres at which colours are sampled, and those of the bands of a spectrum.
fn by_layer(
    scene: &Scene,
    lens: &LensCamera,
    light_field: &LightField,
) -> Result<[Centres; 2], CameraError> {
    let grid = scene.sensor.as_ref().and_then(|sensor| sensor.spec().bands.clone());
    let shift = scene.accuracy.view_color_shift;
    let colors = Centres::new(lens, light_field, &Bands::Rgb, shift)?;
    let spectrum = match grid {
        Some(grid) => Centres::new(lens, light_field, &Bands::Spectral(grid), shift)?,
        None => colors.clone(),
    };
    Ok([colors, spectrum])
}

/// Note on a hexagonal array, which leaves no folder of the benchmark.
const HEXAGONAL: &str = "hci is not written: the benchmark's pictures have square pixels, and the views of a \
                         hexagonal array have rows 0.866 columns apart, every other one moved by half a column";

/// A scene that shows `layers` to another camera.
fn shown_to(scene: &Scene, camera: Camera, layers: Vec<LayerSpec>) -> Scene {
    let picture = scene.picture.filter(|layer| layers.contains(layer));
    let tracer = scene.tracer.filter(|_| picture.is_some());
    let sensor = scene.sensor.clone().map(|sensor| sensor.with_resolution(camera.resolution()));
    let mut shown = scene.clone();
    (shown.camera, shown.layers, shown.sensor) = (camera, layers, sensor);
    (shown.picture, shown.tracer) = (picture, tracer);
    shown
}

/// The picture of all views by an ideal lens.
fn reference_picture(
    RenderedScene { scene, accel, images }: RenderedScene<'_>,
    reference: &Camera,
    outputs: Outputs,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Picture, LightFieldError> {
    let scene = shown_to(scene, reference.clone(), scene.picture.into_iter().collect());
    let plan = Plan::new(&scene, outputs);
    Ok(render(&scene, &plan, accel, images, Vec::new(), &progress)?.picture)
}

/// z of what the middle view sees (m), row by row; infinite where it sees nothing.
fn central_depth(
    RenderedScene { scene, accel, images }: RenderedScene<'_>,
    reference: &Camera,
    outputs: Outputs,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<f64>, LightFieldError> {
    let Some(central) = reference.central_view() else { return Ok(Vec::new()) };
    let scene = shown_to(scene, central, vec![LayerSpec::Depth]);
    let plan = Plan::new(&scene, Outputs { npy: true, ..outputs });
    let picture = render(&scene, &plan, accel, images, Vec::new(), &progress)?.picture;
    let layer = picture.layer_of(LayerSpec::Depth).and_then(|layer| layer.channels.first());
    let values = layer.map(|channel| &channel.values);
    Ok(values.map_or_else(Vec::new, |values| (0..values.len()).map(|i| values.at(i)).collect()))
}

impl SetWriter<'_> {
    /// Views side by side, as one array, and one file each; `shown` says how.
    fn views(&mut self, stem: &str, views: &Views, shown: &Picture) -> Result<(), LightFieldError> {
        let side_by_side = views.side_by_side()?.developed(*shown.development());
        // Side by side as one picture, as one array, and view by view.
        if self.outputs.exr {
            let place = self.place(&format!("{stem}.exr"));
            exr::write(self.files, &place, &side_by_side, &exr::Options::default())?;
        }
        if self.outputs.npy {
            let place = self.place(&format!("{stem}.npy"));
            npy::write_array(
                self.files,
                &place,
                &views.shape(&views.colors),
                &views.colors.values,
            )?;
            if let Some(spectrum) = &views.spectrum {
                let place = self.place(&format!("{stem}_spectrum.npy"));
                npy::write_array(self.files, &place, &views.shape(spectrum), &spectrum.values)?;
            }
        }
        if self.outputs.png {
            png::write(
                self.files,
                &self.place(&format!("{stem}.png")),
                &side_by_side,
                "",
                png::Bits::Eight,
            )?;
            self.below(stem, |set, folder| {
                for down in 0..views.views {
                    for across in 0..views.views {
                        let path = folder.join(view_name(across, down));
                        let view = views.single(across, down)?.developed(*shown.development());
                        png::write(set.files, &path, &view, "", png::Bits::Eight)?;
                        set.written.files.push(path);
                    }
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The plane that is asked for, by all views together; nothing when none is.
    fn refocused(
        &mut self,
        light_field: &LightField,
        grid: &ViewGrid,
        views: &Views,
        shown: &Picture,
    ) -> Result<(), LightFieldError> {
        let Some(distance) = light_field.refocus else { return Ok(()) };
        let refocused = views.averaged(grid.disparity(distance), grid.row_height())?;
        self.picture("refocused", &refocused.developed(*shown.development()))
    }

    /// A plane put together from the patches of lenslets, or why there is none.
    fn patches(
        &mut self,
        patches: Option<Result<Patches, String>>,
        picture: &Picture,
        white: Option<&Picture>,
    ) -> Result<(), LightFieldError> {
        match (patches, white) {
            (Some(Err(why)), _) => {
                self.written.notes.push(format!("refocused is not written: {why}"));
            }
            (Some(Ok(patches)), Some(white)) if picture.layer("").is_some() => {
                let refocused = patches.rendered(picture, white)?;
                self.picture("refocused", &refocused.developed(*picture.development()))?;
                self.written.notes.extend(patches.note());
            }
            _ => {}
        }
        Ok(())
    }

    /// Depth and disparity of the middle view.
    fn depth(&mut self, grid: &ViewGrid, depth: &[f64]) -> Result<(), LightFieldError> {
        let [cols, rows] = grid.view_resolution();
        let disparity: Vec<f64> = depth.iter().map(|&z| grid.disparity(z)).collect();
        for (stem, values, unit) in [
            ("central_depth", depth, "m"),
            ("central_disparity", &disparity[..], "pixels of a view per view"),
        ] {
            let picture = plane(stem, unit, [cols, rows], values)?;
            if self.outputs.npy {
                npy::write(self.files, &self.place(&format!("{stem}.npy")), &picture, NAME)?;
            }
            if self.outputs.png {
                let place = self.place(&format!("{stem}.png"));
                png::write(self.files, &place, &picture, NAME, png::Bits::Eight)?;
            }
            pfm::write(self.files, &self.place(&format!("{stem}.pfm")), [cols, rows], values)?;
        }
        Ok(())
    }

    /// The benchmark's layout.
    fn hci(
        &mut self,
        scene: &Scene,
        grid: &ViewGrid,
        views: &Views,
        shown: &Picture,
        depth: &[f64],
    ) -> Result<(), LightFieldError> {
        self.below("hci", |set, folder| {
            set.written
                .files
                .extend(hci::write(set.files, folder, scene, grid, views, shown, depth)?);
            Ok(())
        })
    }
}

/// The name of the layer of a picture of one plane.
const NAME: &str = "Plane";

/// Numbers as a picture of one plane.
fn plane(
    what: &str,
    unit: &str,
    [width, height]: [u32; 2],
    values: &[f64],
) -> Result<Picture, PictureError> {
    let channels = vec![Channel { name: "Z".to_owned(), values: Values::F64(values.to_vec()) }];
    let meaning = vec![HeaderEntry::new("definition", what), HeaderEntry::new("unit", unit)];
    let layer = Layer { name: NAME.to_owned(), look: Look::Distance, channels, meaning };
    Picture::new(width as usize, height as usize, vec![layer], Vec::new())
}
