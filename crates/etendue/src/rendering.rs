//! A render's result: layers as arrays, the sensor's images, files of them, and a report.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use etendue_accel::{Accel, BuildOptions};
use etendue_files::{Ledger, MANIFEST, MOST_OWN_BYTES, Transaction};
use etendue_oidn::Denoiser;
use etendue_render::annotations::{
    self, Annotated, BOP_DEPTH, COCO, CRYPTOMATTE, INSTANCES, Models, Shot, Source,
};
use etendue_render::denoise::{self, DENOISED};
use etendue_render::expose::{self, BandFilm, SensorLight};
use etendue_render::light_field::{self, LightFieldSet};
use etendue_render::output::imu::{self, IMU};
use etendue_render::output::{HeaderEntry, Layer, LayerFile, Outputs, Picture, exr, sidecar};
use etendue_render::report::seconds;
use etendue_render::{Images, Plan, RenderError, RenderedScene, Report};
use etendue_scene::Scene;
use etendue_scene::file::SceneSpec;
use etendue_sensor::{Exposure, RawImage};

use crate::progress::Phase;
use crate::records::{complete_picture, stopped_samples};
use crate::{Error, Progress, places};

/// The folder of a stopped picture, in that of a complete one.
const PARTIAL: &str = "partial";

/// A rendered picture with all its layers, and what the camera's sensor makes of its light.
#[derive(Debug)]
pub struct Rendering {
    pub(crate) scene: Arc<Scene>,
    pub(crate) picture: Picture,
    pub(crate) light: Option<SensorLight>,
    /// Notes on a sensor that has nothing to expose.
    pub(crate) idle_notes: Vec<String>,
    pub(crate) report: Report,
    /// The structure and the images of a scene that more is asked of when files are written: by light-field cameras,
    /// and by annotations.
    traced: Option<TracedScene>,
    /// Entries of the header that tell what it shows.
    fingerprints: Vec<HeaderEntry>,
}

/// The structure and the images that a scene was traced with.
#[derive(Debug)]
pub(crate) struct TracedScene {
    pub(crate) accel: Arc<dyn Accel>,
    pub(crate) images: Arc<Images>,
}

/// Part of the results that a picture is: whole by itself, or a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PictureScope {
    /// It does, and its sets are of it alone.
    Whole,
    /// It is one of a scene's frames.
    Frame,
}

/// Files that were written.
#[derive(Debug, Clone, Default)]
pub struct WrittenFiles {
    /// The files, in the order in which they were written.
    pub files: Vec<PathBuf>,
    /// Notes for the user on the files.
    pub notes: Vec<String>,
    /// Duration of the writing.
    pub time: Duration,
}

impl Rendering {
    pub(crate) fn new(
        scene: Arc<Scene>,
        picture: Picture,
        band_film: Option<BandFilm>,
        traced: Option<TracedScene>,
        report: Report,
        fingerprints: Vec<HeaderEntry>,
    ) -> Result<Self, Error> {
        let (light, idle_notes) = match SensorLight::new(&scene, &picture, band_film)? {
            Ok(light) => (Some(light), Vec::new()),
            Err(notes) => (None, notes),
        };
        Ok(Self { scene, picture, light, idle_notes, report, traced, fingerprints })
    }

    /// Returns the rendering with the picture's noise taken out: beside the picture, which stays as it is, stands the
    /// layer `Denoised`, and `picture.png` shows it. What the sensor makes of the light keeps its noise. The layers
    /// `MeanAlbedo` and `MeanNormal`, where there are both, keep edges and patterns sharp.
    ///
    /// # Errors
    ///
    /// When the picture is no light in red, green and blue, there is too little memory, or the library fails.
    pub fn denoised(mut self, denoiser: &Denoiser) -> Result<Self, Error> {
        let start = Instant::now();
        self.picture = denoise::denoised(self.picture, denoiser)?;
        self.fingerprints.push(denoise::fingerprint());
        let took = seconds(start.elapsed());
        self.report.seconds.total += took;
        self.report.layers.push(DENOISED.to_owned());
        self.report.notes.push(format!(
            "picture.png shows the layer {DENOISED}, by Open Image Denoise {} in {took:.2} s; the picture in \
             EXR and NPY has its noise",
            denoiser.version()
        ));
        Ok(self)
    }

    /// The scene as it was rendered.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Fingerprints that tell, in the headers of files, which scene is shown, and which other
    /// frames it is compared with.
    #[must_use]
    pub fn fingerprints(&self) -> &[HeaderEntry] {
        &self.fingerprints
    }

    /// Columns and rows.
    #[must_use]
    pub fn resolution(&self) -> [usize; 2] {
        [self.picture.width(), self.picture.height()]
    }

    /// All layers with the header of their files.
    #[must_use]
    pub fn picture(&self) -> &Picture {
        &self.picture
    }

    /// The layers, the picture first where there is one.
    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        self.picture.layers()
    }

    /// The layer of this name, as files have it: `Depth`, `Normal`, `Id.object`; the picture's is empty.
    #[must_use]
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers().iter().find(|layer| layer.name == name)
    }

    /// The light on the sensor; `None` for an ideal camera, or a scene without a picture.
    #[must_use]
    pub fn sensor_light(&self) -> Option<&SensorLight> {
        self.light.as_ref()
    }

    /// The exposures that the scene asks for: exposure times and frames.
    pub fn exposures(&self) -> impl Iterator<Item = Exposure> + '_ {
        self.light.iter().flat_map(|light| light.sensor().shots())
    }

    /// The sensor's digital numbers for one exposure, rows from the top; `None` where there is no sensor.
    /// The same whenever it is asked for.
    ///
    /// # Errors
    ///
    /// None that a caller can cause.
    pub fn raw(&self, exposure: Exposure) -> Result<Option<RawImage>, Error> {
        let light = self.light.as_ref();
        Ok(light
            .map(|light| light.expose(exposure))
            .transpose()
            .map_err(expose::ExposeError::from)?)
    }

    /// Report of what the render did and cost. Its files and the time to write them are not in it.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Notes for the user.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.report.notes
    }

    /// That it was stopped before all samples were taken, in words.
    #[must_use]
    pub fn partial(&self) -> Option<String> {
        let (has, of) = (self.report.samples, self.report.samples_wanted);
        (has < of).then(|| format!("stopped after {has} of {of} samples a pixel"))
    }

    /// The folder that takes its files: `folder`, or `partial` in it when this picture was stopped and a
    /// complete one stands there.
    #[must_use]
    pub fn place_in(&self, folder: &Path) -> PathBuf {
        match self.partial().and_then(|_| complete_picture(folder)) {
            Some(_) => folder.join(PARTIAL),
            None => folder.to_owned(),
        }
    }

    /// The samples a pixel of a stopped picture of the same scene in `folder`, where it has more of them than
    /// this one, which was stopped earlier: it would be a loss to write this one over it.
    #[must_use]
    pub fn more_samples_in(&self, folder: &Path) -> Option<u64> {
        self.partial()?;
        let samples = stopped_samples(folder, &self.fingerprints)?;
        (samples > u64::from(self.report.samples)).then_some(samples)
    }

    /// Writes all files into `folder`, which is made when it is missing; each appears when it is complete.
    /// Files that an earlier render left there and this one does not write again are removed, when they are
    /// as they were; so is a stopped picture beside them, when this one is complete.
    ///
    /// # Errors
    ///
    /// When the folder cannot be written to, or a file of the scene would be overwritten.
    pub fn write(&self, folder: impl AsRef<Path>, outputs: Outputs) -> Result<WrittenFiles, Error> {
        places::folder(folder.as_ref())?;
        self.write_with(folder.as_ref(), outputs, &Progress::none())
    }

    /// As [`Self::write`], into a folder that is there, with progress, which can stop it.
    ///
    /// # Errors
    ///
    /// As [`Self::write`], and when it is stopped.
    pub fn write_with(
        &self,
        folder: &Path,
        outputs: Outputs,
        progress: &Progress,
    ) -> Result<WrittenFiles, Error> {
        self.write_part(folder, outputs, PictureScope::Whole, progress)
    }

    /// As [`Self::write_with`], of one frame among others: what annotates it is kept for the set of all.
    pub(crate) fn write_frame(
        &self,
        folder: &Path,
        outputs: Outputs,
        progress: &Progress,
    ) -> Result<WrittenFiles, Error> {
        self.write_part(folder, outputs, PictureScope::Frame, progress)
    }

    fn write_part(
        &self,
        folder: &Path,
        outputs: Outputs,
        part: PictureScope,
        progress: &Progress,
    ) -> Result<WrittenFiles, Error> {
        let start = Instant::now();
        // Results must not be written over inputs.
        let names = self.picture.layers().iter().map(|layer| layer.name.clone());
        let results = files_of(&self.scene, names, outputs);
        let results: Vec<PathBuf> = results.map(|name| folder.join(name)).collect();
        places::keep_apart(&self.scene.inputs, &results)?;
        // Layers, exposures and the light field's set, recorded in the folder's manifest.
        let mut written =
            places::recorded(Ledger::open(folder, "render"), &self.scene.inputs, |to| {
                let (mut files, mut notes) = self.write_layers(to, folder, outputs, progress)?;
                notes.extend(self.idle_notes.iter().cloned());
                if let Some(light) = &self.light {
                    let goes_on = |share| progress.goes_on(Phase::Expose, share);
                    let exposed = expose::write(light, to, folder, outputs, &goes_on)?;
                    files.extend(exposed.files);
                    notes.extend(exposed.notes);
                }
                let set = self.write_light_field(to, folder, outputs, progress)?;
                files.extend(set.files);
                notes.extend(set.notes);
                files.extend(self.write_annotations(to, folder, outputs, part, progress)?);
                Ok::<_, Error>(WrittenFiles { files, notes, time: Duration::ZERO })
            })?;
        // A whole picture takes the place of a partial one.
        if self.partial().is_none() {
            places::clear(&folder.join(PARTIAL));
        }
        written.notes.iter().for_each(|note| progress.note(note));
        written.time = start.elapsed();
        Ok(written)
    }

    /// The report with the files that were written, as `--report` has it.
    #[must_use]
    pub fn report_of(&self, written: &WrittenFiles) -> Report {
        let mut report = self.report.clone();
        report.seconds.write = seconds(written.time);
        report.seconds.total += report.seconds.write;
        report.notes.extend(written.notes.iter().cloned());
        report.files.clone_from(&written.files);
        report
    }

    /// Writes what a light-field camera leaves beside its picture; nothing of others.
    fn write_light_field(
        &self,
        to: &Transaction,
        folder: &Path,
        outputs: Outputs,
        progress: &Progress,
    ) -> Result<LightFieldSet, Error> {
        let Some(TracedScene { accel, images }) = &self.traced else {
            return Ok(LightFieldSet::default());
        };
        let rendering = RenderedScene { scene: &self.scene, accel: &**accel, images };
        let goes_on = |share| progress.goes_on(Phase::LightField, share);
        Ok(light_field::write(rendering, &self.picture, to, folder, outputs, &goes_on)?)
    }

    /// Writes what tells the scene's copies apart, and names by their shares of pixels.
    fn write_annotations(
        &self,
        to: &Transaction,
        folder: &Path,
        outputs: Outputs,
        part: PictureScope,
        progress: &Progress,
    ) -> Result<Vec<PathBuf>, Error> {
        let mut files = Vec::new();
        if !outputs.annotates() && !outputs.cryptomatte {
            return Ok(files);
        }
        if let Some(why) = annotations::refusal(&self.scene, outputs) {
            return Err(Error::Refused(why));
        }
        let accel = match &self.traced {
            Some(TracedScene { accel, .. }) => Arc::clone(accel),
            None => {
                let plan = Plan::new(&self.scene, outputs);
                etendue_render::build(&self.scene, &plan, &BuildOptions::default())?.into()
            }
        };
        let goes_on = |share| progress.goes_on(Phase::Annotate, share);
        if outputs.cryptomatte {
            let path = folder.join(CRYPTOMATTE);
            annotations::write_cryptomatte(&self.scene, &*accel, to, &path, &goes_on)?;
            files.push(path);
        }
        if !outputs.annotates() {
            return Ok(files);
        }
        let (annotated, depth) = annotations::survey(&self.scene, &*accel, outputs, &goes_on)?;
        let path = folder.join(INSTANCES);
        sidecar::write_json(to, &path, &annotated)?;
        files.push(path);
        match part {
            PictureScope::Frame if outputs.bop => {
                let path = folder.join(BOP_DEPTH);
                let size = self.scene.camera.resolution();
                annotations::write_depth(to, &path, size, &depth)?;
                files.push(path);
            }
            PictureScope::Frame => {}
            PictureScope::Whole => {
                let mut models = Models::default();
                if outputs.bop {
                    models.add(&self.scene);
                }
                let shot = Shot {
                    number: 0,
                    annotated,
                    file_name: LayerFile::Preview.name(""),
                    picture: Source::Picture(&self.picture),
                    depth: Source::Numbers(&depth),
                };
                files.extend(annotations::write_sets(&[shot], &models, to, folder, outputs)?);
            }
        }
        Ok(files)
    }

    /// The files of layers, and what a user should know of them.
    fn write_layers(
        &self,
        to: &Transaction,
        folder: &Path,
        outputs: Outputs,
        progress: &Progress,
    ) -> Result<(Vec<PathBuf>, Vec<String>), Error> {
        let (picture, camera) = (&self.picture, &self.scene.camera);
        let (mut files, mut notes) = (Vec::new(), Vec::new());
        let mut place = |name: String| {
            let path = folder.join(name);
            files.push(path.clone());
            path
        };
        if outputs.exr {
            let goes_on = |share: f64| progress.goes_on(Phase::Write, share * 0.5);
            let options = exr::Options { progress: Some(&goes_on), ..Default::default() };
            exr::write(to, &place("layers.exr".to_owned()), picture, &options)?;
        }
        let total = picture.layers().len() as f64;
        for (done, layer) in picture.layers().iter().enumerate() {
            if !progress.goes_on(Phase::Write, 0.5 + 0.5 * done as f64 / total) {
                return Err(RenderError::Stopped.into());
            }
            for file in LayerFile::of(&layer.name, outputs) {
                let name = file.name(&layer.name);
                if file.write(to, &folder.join(&name), picture, &layer.name)? {
                    notes.extend(file.note(picture, &layer.name));
                    place(name);
                }
            }
        }
        sidecar::write_json(to, &place("camera.json".to_owned()), &camera.opencv())?;
        sidecar::write(to, &place("layers.json".to_owned()), picture)?;
        if let Some(imu) = &self.scene.render.imu {
            notes.extend(imu::write(to, &place(IMU.to_owned()), &self.scene, imu)?);
        }
        Ok((files, notes))
    }
}

/// The names of all files that a render of `scene` may write, as planned.
pub(crate) fn file_names(scene: &Scene, plan: &Plan, outputs: Outputs) -> Vec<String> {
    files_of(scene, plan.names(scene), outputs).collect()
}

fn files_of(
    scene: &Scene,
    layers: impl IntoIterator<Item = String>,
    outputs: Outputs,
) -> impl Iterator<Item = String> {
    let always = ["layers.exr", "camera.json", "layers.json", MANIFEST].map(str::to_owned);
    let layers = layers.into_iter().flat_map(move |layer| layer_files(&layer, outputs));
    let others = expose::file_names(scene).into_iter().chain(light_field::file_names(scene));
    let others = others.chain(scene.render.imu.as_ref().map(|_| IMU.to_owned()));
    always.into_iter().chain(layers).chain(others).chain(annotation_files(outputs))
}

/// The files of annotations that lie beside those of layers, whatever the scene holds.
fn annotation_files(outputs: Outputs) -> impl Iterator<Item = String> {
    let all = [
        (outputs.annotates(), INSTANCES),
        (outputs.bop, BOP_DEPTH),
        (outputs.coco, COCO),
        (outputs.cryptomatte, CRYPTOMATTE),
    ];
    all.into_iter().filter(|(wanted, _)| *wanted).map(|(_, name)| name.to_owned())
}

/// The annotations of a picture that was written.
///
/// # Errors
///
/// When they cannot be read.
pub(crate) fn read_annotated(path: &Path) -> Result<Annotated, Error> {
    let read = etendue_files::read(path, MOST_OWN_BYTES).map_err(|error| error.to_string());
    read.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|error| error.to_string()))
        .map_err(|why| Error::Refused(format!("{}: cannot be read: {why}", path.display())))
}

/// The files that a render leaves of these layers whatever they hold. A mask is not among them: its numbers
/// may be too large for it.
pub(crate) fn certain_files(
    layers: impl IntoIterator<Item = String>,
    outputs: Outputs,
) -> Vec<String> {
    let of = |layer: String| {
        let certain = LayerFile::of(&layer, outputs).filter(|file| file.is_certain());
        certain.map(|file| file.name(&layer)).collect::<Vec<_>>()
    };
    let files = layers.into_iter().flat_map(of);
    let annotations = annotation_files(outputs).filter(|name| name != COCO);
    files.chain(outputs.exr.then(|| "layers.exr".to_owned())).chain(annotations).collect()
}

/// The names in files of the layers that a scene asks for; the picture's is empty.
pub(crate) fn layer_names(spec: &SceneSpec) -> impl Iterator<Item = String> {
    let picture = spec.picture();
    spec.all_layers().into_iter().flat_map(move |layer| match Some(layer) == picture {
        true => vec![String::new()],
        false => layer.row().names_in_files(),
    })
}

/// Those of them that are wanted.
pub(crate) fn layer_files(layer: &str, outputs: Outputs) -> Vec<String> {
    LayerFile::of(layer, outputs).map(|file| file.name(layer)).collect()
}
