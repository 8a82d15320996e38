//! COCO's file of annotations and BOP's folder, of one picture or of many.

use std::collections::BTreeMap;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use etendue_files::{SOFTWARE, Transaction, prepare_folder};
use etendue_geometry::glam::{DMat3, DVec3};
use serde_json::{Value, json};

use super::model::MM;
use super::{Annotated, AnnotationError, BOP, COCO, Instance, Models, PinholeCamera, Silhouette};
use crate::output::png::Bits;
use crate::output::{OutputError, Outputs, Picture, png, sidecar};

/// BOP's folder of the pictures: of the split `train`, scene 0.
const SCENE: &str = "train/000000";

/// Folders below it.
const FOLDERS: [&str; 4] = ["rgb", "depth", "mask", "mask_visib"];

/// Source of an image.
#[derive(Debug, Clone)]
pub enum Source<'a> {
    /// A file that was written.
    File(PathBuf),
    /// The picture of layers.
    Picture(&'a Picture),
    /// Numbers of 16 bits, row by row.
    Numbers(&'a [u16]),
}

/// One picture of a set.
#[derive(Debug, Clone)]
pub struct Shot<'a> {
    /// Its number: the `image_id`.
    pub number: usize,
    /// The copies in it.
    pub annotated: Annotated,
    /// Its file as seen from the set's folder.
    pub file_name: String,
    /// The picture.
    pub picture: Source<'a>,
    /// Its depth; only BOP asks for it.
    pub depth: Source<'a>,
}

/// Writes the sets that `outputs` ask for into `folder`, and gives their files.
///
/// # Errors
///
/// When a file cannot be read or written.
pub fn write(
    shots: &[Shot<'_>],
    models: &Models,
    files: &Transaction,
    folder: &Path,
    outputs: Outputs,
) -> Result<Vec<PathBuf>, AnnotationError> {
    let mut written = Vec::new();
    if outputs.coco {
        let path = folder.join(COCO);
        sidecar::write_json(files, &path, &coco(shots))?;
        written.push(path);
    }
    if outputs.bop {
        let mut set = Bop { files, folder: folder.join(BOP), written: Vec::new() };
        set.write(shots, models)?;
        written.extend(set.written);
    }
    Ok(written)
}

/// COCO's file of annotations: a category for each name of an object, an annotation for each copy that is seen.
fn coco(shots: &[Shot<'_>]) -> Value {
    let mut categories: Vec<&str> = Vec::new();
    let mut annotations = Vec::new();
    let image = |shot: &Shot<'_>| {
        json!({
            "id": shot.number, "file_name": shot.file_name,
            "width": shot.annotated.width, "height": shot.annotated.height,
        })
    };
    for shot in shots {
        let seen =
            shot.annotated.instances.iter().map(|instance| (instance, instance.visible.area()));
        for (instance, area) in seen.filter(|(_, area)| *area > 0) {
            let known = categories.iter().position(|name| *name == instance.name);
            let category = known.unwrap_or_else(|| {
                categories.push(&instance.name);
                categories.len() - 1
            });
            annotations.push(json!({
                // Of annotation 0 pycocotools takes a match for none.
                "id": annotations.len() + 1, "image_id": shot.number, "category_id": category + 1,
                "segmentation": instance.visible, "area": area, "bbox": instance.visible.bounds(), "iscrowd": 0,
                "instance": instance.instance, "object": instance.object,
            }));
        }
    }
    let categories = (1..).zip(categories);
    let category =
        |(id, name): (usize, &str)| json!({ "id": id, "name": name, "supercategory": "object" });
    json!({
        "info": { "description": "objects of a scene", "contributor": SOFTWARE },
        "licenses": [],
        "images": shots.iter().map(image).collect::<Vec<_>>(),
        "annotations": annotations,
        "categories": categories.map(category).collect::<Vec<_>>(),
    })
}

/// BOP's folder while it is written.
struct Bop<'a> {
    files: &'a Transaction,
    folder: PathBuf,
    written: Vec<PathBuf>,
}

impl Bop<'_> {
    fn place(&mut self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        self.written.push(path.clone());
        path
    }

    fn json(&mut self, name: &str, value: &Value) -> Result<(), OutputError> {
        let path = self.place(name);
        sidecar::write_json(self.files, &path, value)
    }

    fn write(&mut self, shots: &[Shot<'_>], models: &Models) -> Result<(), AnnotationError> {
        prepare_folder(&self.folder.join("models"))?;
        for folder in FOLDERS {
            prepare_folder(&self.folder.join(SCENE).join(folder))?;
        }
        let (mut numbers, mut infos) = (BTreeMap::new(), BTreeMap::new());
        let (mut cameras, mut truths, mut facts) =
            (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        for shot in shots {
            let Annotated { camera: Some(camera), depth_scale_mm: Some(scale), .. } =
                shot.annotated
            else {
                continue;
            };
            let image = format!("{:06}.png", shot.number);
            self.copy(&format!("{SCENE}/rgb/{image}"), &shot.picture, &shot.annotated)?;
            self.copy(&format!("{SCENE}/depth/{image}"), &shot.depth, &shot.annotated)?;
            let (mut truth, mut fact) = (Vec::new(), Vec::new());
            for instance in &shot.annotated.instances {
                let (Some(pose), Some(whole)) = (&instance.pose, &instance.silhouette) else {
                    continue;
                };
                // Models are numbered from 1 in the order in which they are met.
                let next = numbers.len() + 1;
                let number = *numbers.entry(&pose.model).or_insert(next);
                if number == next {
                    let path = self.place(&format!("models/obj_{number:06}.ply"));
                    infos.insert(number, models.write(&pose.model, self.files, &path)?);
                }
                self.masks(shot, truth.len(), instance, whole)?;
                let [rotation, translation] = in_camera(&camera, &pose.rotation, pose.translation);
                truth.push(json!({
                    "obj_id": number, "cam_R_m2c": rotation, "cam_t_m2c": translation,
                }));
                fact.push(facts_of(instance, whole));
            }
            cameras.insert(shot.number, scene_camera(&camera, scale));
            truths.insert(shot.number, truth);
            facts.insert(shot.number, fact);
        }
        self.json("models/models_info.json", &json!(infos))?;
        self.json(&format!("{SCENE}/scene_camera.json"), &json!(cameras))?;
        self.json(&format!("{SCENE}/scene_gt.json"), &json!(truths))?;
        self.json(&format!("{SCENE}/scene_gt_info.json"), &json!(facts))?;
        if let Some(Shot { annotated, .. }) = shots.first()
            && let Some(PinholeCamera { k, .. }) = annotated.camera
        {
            let camera = json!({
                "width": annotated.width, "height": annotated.height, "fx": k[0][0], "fy": k[1][1],
                "cx": k[0][2], "cy": k[1][2], "depth_scale": annotated.depth_scale_mm,
            });
            self.json("camera.json", &camera)?;
        }
        Ok(())
    }

    /// The masks of a copy: all of it, and what is seen of it.
    fn masks(
        &mut self,
        shot: &Shot<'_>,
        number: usize,
        instance: &Instance,
        whole: &Silhouette,
    ) -> Result<(), OutputError> {
        let size = [shot.annotated.width, shot.annotated.height];
        for (folder, mask) in [("mask", &whole.mask), ("mask_visib", &instance.visible)] {
            let path = self.place(&format!("{SCENE}/{folder}/{:06}_{number:06}.png", shot.number));
            write_grey(self.files, &path, size, ::png::BitDepth::Eight, &mask.bytes())?;
        }
        Ok(())
    }

    fn copy(
        &mut self,
        name: &str,
        source: &Source<'_>,
        Annotated { width, height, .. }: &Annotated,
    ) -> Result<(), OutputError> {
        let path = self.place(name);
        match source {
            Source::Picture(picture) => png::write(self.files, &path, picture, "", Bits::Eight),
            Source::Numbers(numbers) => write_depth(self.files, &path, [*width, *height], numbers),
            Source::File(from) => {
                let image = etendue_files::open(from);
                let mut image = image.map_err(|error| OutputError::io(from, error))?;
                Ok(self.files.write(&path, |part| io::copy(&mut image, part).map(|_| ()))?)
            }
        }
    }
}

/// An entry of `scene_camera.json`.
fn scene_camera(camera: &PinholeCamera, scale: f64) -> Value {
    let m = &camera.camera_from_world;
    let rotation: Vec<f64> = (0..3).flat_map(|row| m[row][..3].to_vec()).collect();
    json!({
        "cam_K": camera.k.as_flattened(), "depth_scale": scale, "cam_R_w2c": rotation,
        "cam_t_w2c": [MM * m[0][3], MM * m[1][3], MM * m[2][3]],
    })
}

/// The rotation by rows and the translation (mm) from a model to the camera.
fn in_camera(
    camera: &PinholeCamera,
    rotation: &[[f64; 3]; 3],
    translation: [f64; 3],
) -> [Vec<f64>; 2] {
    let m = &camera.camera_from_world;
    let column = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
    let turn = DMat3::from_cols(column(0), column(1), column(2));
    let model = DMat3::from_cols_array_2d(rotation).transpose();
    let turned = (turn * model).transpose().to_cols_array().to_vec();
    let moved = (turn * DVec3::from(translation) + column(3)) * MM;
    [turned, moved.to_array().to_vec()]
}

/// An entry of `scene_gt_info.json`. Boxes are those of the toolkit's `calc_2d_bbox`: the greatest column and row less
/// the least, and -1 of what is not seen.
fn facts_of(instance: &Instance, whole: &Silhouette) -> Value {
    let visible = instance.visible.area();
    let [x, y, w, h] = instance.visible.bounds().map(i64::from);
    let (whole_box, seen) = match visible {
        0 => ([-1; 4], [-1; 4]),
        _ => (whole.bounds, [x, y, w - 1, h - 1]),
    };
    json!({
        "px_count_all": whole.all_pixels, "px_count_valid": whole.pixels, "px_count_visib": visible,
        "visib_fract": f64::from(visible) / f64::from(whole.all_pixels.max(1)),
        "bbox_obj": whole_box, "bbox_visib": seen,
    })
}

/// Writes depth as BOP has it to `path`: 16 bits, grey.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write_depth(
    files: &Transaction,
    path: &Path,
    size: [u32; 2],
    depth: &[u16],
) -> Result<(), OutputError> {
    let bytes: Vec<u8> = depth.iter().flat_map(|step| step.to_be_bytes()).collect();
    write_grey(files, path, size, ::png::BitDepth::Sixteen, &bytes)
}

/// A grey picture without words.
fn write_grey(
    files: &Transaction,
    path: &Path,
    [width, height]: [u32; 2],
    bits: ::png::BitDepth,
    bytes: &[u8],
) -> Result<(), OutputError> {
    let mut part = files.create(path)?;
    let mut encoder = ::png::Encoder::new(BufWriter::new(&mut part), width, height);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.set_depth(bits);
    encoder.set_compression(::png::Compression::Fast);
    let encoded = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(bytes)?;
        writer.finish()
    });
    encoded.map_err(|error| match error {
        ::png::EncodingError::IoError(source) => OutputError::io(path, source),
        error => OutputError::format(path, error),
    })?;
    Ok(part.finish()?)
}
