//! The scene file's own materials and lights, and the files and glasses that they name.

use std::path::PathBuf;
use std::sync::Arc;

use etendue_files::InputFolder;
use etendue_optics::glass::{AgfCatalogue, GlassSpec};
use etendue_spectrum::Curve;
use etendue_tracer::spec::{CubeSpec, Fault, ImageSpec, IorSpec, Supply};
use etendue_tracer::{
    Cube, CubeKind, ImageSource, Ior, Light, LightKind, Material, Modulation, Paint, Texture,
    TextureUse,
};
use serde_json::Value;

use crate::SceneError;
use crate::cubes;
use crate::error::not_found;
use crate::file::{SceneFile, ScenePath, read_value};
use crate::import::Wanted;

/// The scene's own materials in the order of their names, and the images that they name.
#[derive(Debug, Default)]
pub(crate) struct OwnMaterials {
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    /// Files of curves.
    pub(crate) files: Vec<PathBuf>,
}

impl SceneFile {
    pub(crate) fn named_materials(
        &self,
        folder: &InputFolder,
        glasses: &[AgfCatalogue],
        wanted: Wanted,
    ) -> Result<OwnMaterials, SceneError> {
        let mut own = OwnMaterials::default();
        let mut curves = 0;
        for (name, spec) in &self.spec.materials {
            let mut supply = MaterialSources {
                folder,
                glasses,
                wanted,
                textures: &mut own.textures,
                files: &mut own.files,
                curves: &mut curves,
            };
            let fault = |Fault { key, why }| {
                self.fault(ScenePath::of("materials").key(name).join(&key), why)
            };
            let mut material = spec.build(name, &mut supply).map_err(fault)?;
            if let Some(emission) = &mut material.emission {
                start_at(&mut emission.modulation, self.spec.render.time());
            }
            own.materials.push(material);
        }
        Ok(own)
    }

    /// The scene's own lights; `None` when it does not speak of any. Images that they throw are added to
    /// `textures`.
    pub(crate) fn named_lights(
        &self,
        folder: &InputFolder,
        glasses: &[AgfCatalogue],
        wanted: Wanted,
        textures: &mut Vec<Texture>,
        files: &mut Vec<PathBuf>,
    ) -> Result<Option<Vec<Light>>, SceneError> {
        let Some(specs) = &self.spec.lights else { return Ok(None) };
        let mut lights: Vec<Light> = Vec::new();
        for (index, spec) in specs.iter().enumerate() {
            let at = ScenePath::of("lights").index(index);
            let curves = &mut 0;
            let mut supply = MaterialSources { folder, glasses, wanted, textures, files, curves };
            let fault = |Fault { key, why }| self.fault(at.join(&key), why);
            let time = self.spec.render.time();
            let mut built = spec.build(&mut supply).map_err(fault)?;
            let motion = spec.motion().map(|(motion, place)| motion.build(place, time));
            let below = |Fault { key, why }| self.fault(at.key("motion").join(&key), why);
            let motion = motion.transpose().map_err(below)?.map(Arc::new);
            for light in &mut built {
                start_at(&mut light.modulation, time);
                light.motion.clone_from(&motion);
            }
            let is_sky = |l: &Light| matches!(l.kind, LightKind::Environment { .. });
            if built.iter().any(is_sky) && lights.iter().any(is_sky) {
                let why =
                    "a second environment; a scene has one at most\nhint: leave one of them out";
                return Err(self.fault(&at, why));
            }
            lights.extend(built);
        }
        Ok(Some(lights))
    }
}

/// Puts a light's modulation into the clock of a frame whose time is `time` (s).
fn start_at(modulation: &mut Option<Arc<Modulation>>, time: f64) {
    if let Some(modulation) = modulation {
        *modulation = Arc::new(modulation.from_time(time));
    }
}

/// The path `key`, which may be of several parts or none, below `at`.
/// The longest table of a curve that is read (bytes).
const LONGEST_TABLE: u64 = 1 << 26;

/// The scene's folder and the catalogue of glasses.
struct MaterialSources<'a> {
    folder: &'a InputFolder,
    glasses: &'a [AgfCatalogue],
    wanted: Wanted,
    textures: &'a mut Vec<Texture>,
    files: &'a mut Vec<PathBuf>,
    /// Number of curves that surfaces have so far.
    curves: &'a mut u32,
}

impl Supply for MaterialSources<'_> {
    fn image(&mut self, spec: &ImageSpec) -> Result<Paint, Fault> {
        let path = self.file(&spec.image).map_err(|why| Fault::new("image", why))?;
        if !spec.repeat.iter().all(|r| r.is_finite() && *r != 0.0) {
            return Err(Fault::new("repeat", "is zero, which leaves no image"));
        }
        if !self.wanted.textures {
            return Ok(Paint::Plain([1.0; 3]));
        }
        let same = |t: &Texture| {
            t.file() == Some(&path) && t.wrap == [spec.wrap; 2] && t.filter == spec.filter
        };
        let index = self.textures.iter().position(same).unwrap_or_else(|| {
            self.textures.push(Texture {
                name: spec.image.clone(),
                source: ImageSource::File(path.clone()),
                wrap: [spec.wrap; 2],
                filter: spec.filter,
                named_by_scene: true,
            });
            self.textures.len() - 1
        });
        let texture = u32::try_from(index).unwrap_or(u32::MAX);
        let [u, v] = spec.repeat;
        let transform = [[u, 0.0, 0.0], [0.0, v, 0.0]];
        let image = TextureUse { texture, uv_set: 0, transform, encoding: spec.encoding };
        Ok(Paint::Image { factor: [1.0; 3], curve: None, image })
    }

    fn text(&mut self, written: &str) -> Result<String, String> {
        let path = self.file(written)?;
        let bytes = etendue_files::read(&path, LONGEST_TABLE).map_err(|e| e.to_string())?;
        self.files.push(path);
        String::from_utf8(bytes).map_err(|_| "is no text".to_owned())
    }

    fn cube(&mut self, spec: &CubeSpec, kind: CubeKind) -> Result<Cube, Fault> {
        let fault = |why: String| Fault::new("cube", format!("\"{}\" {why}", spec.cube));
        if !spec.repeat.iter().all(|r| r.is_finite() && *r != 0.0) {
            return Err(Fault::new("repeat", "is zero, which leaves no cube"));
        }
        let (cube, files) = cubes::read(spec, kind, self.folder).map_err(fault)?;
        self.files.extend(files);
        Ok(cube)
    }

    fn curve_number(&mut self) -> u32 {
        *self.curves += 1;
        *self.curves - 1
    }

    fn file(&mut self, written: &str) -> Result<PathBuf, String> {
        Ok(self.folder.find(written).map_err(not_found)?.path)
    }

    /// The index of a glass, by the lens files' own words, sampled where bands may be.
    fn index(&mut self, spec: &IorSpec) -> Result<Ior, String> {
        let words = match spec {
            IorSpec::Constant(n) if *n >= 1.0 && n.is_finite() => return Ok(Ior::Constant(*n)),
            IorSpec::Constant(n) => {
                return Err(format!("{n} is below 1, the index of air and the least there is"));
            }
            IorSpec::Glass(name) => Value::from(name.as_str()),
            IorSpec::Abbe(abbe) => serde_json::json!({ "nd": abbe.nd, "vd": abbe.vd }),
        };
        let spec: GlassSpec = read_value(&words).map_err(|(_, why)| why)?;
        let glass = spec.resolve_in(self.glasses).map_err(|e| e.to_string())?;
        let step = 5.0;
        let samples: Vec<[f64; 2]> = (50..=500)
            .map(|k| f64::from(k) * step)
            .filter_map(|nm| Some([nm, glass.index(nm).ok().filter(|n| *n >= 1.0)?]))
            .collect();
        if !glass.is_dispersive()
            && let Some([_, n]) = samples.first()
        {
            return Ok(Ior::Constant(*n));
        }
        Curve::sampled(samples).map(Ior::Dispersive).map_err(|e| e.to_string())
    }
}
