//! Material files: `tobj` reads them, line by line made fit for it.
//!
//! Here are the library files found, lines that `tobj` 4.0 would refuse the whole file for (or end
//! the process over, as `Kd 1`) put right or dropped with a note, and what it leaves unparsed (the
//! options of a map) taken apart.
//!
//! Colours are taken as linear.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use etendue_tracer::material::Alpha;
use etendue_tracer::scattering::GltfSurface;
use etendue_tracer::spec::BRIGHTEST;
use etendue_tracer::texture::{Encoding, Filter, Wrap};
use etendue_tracer::{
    Emission, Glass, ImageSource, Ior, Material, Paint, Scattering, Texture, TextureUse,
};

use super::chunk;
use super::chunk::Segment;
use crate::import::error::{self, Note, NoteKind};
use crate::import::files::Files;
use crate::import::text::with_newlines;
use crate::import::{Import, Refusal, Strictness, Wanted};

/// The most material files of a model that are looked for.
const MOST_LIBRARIES: usize = 1000;

/// A material and the file that defines it.
struct MaterialDefinition {
    material: tobj::Material,
    file: PathBuf,
}

/// Reads the libraries and gives each segment the number of its material in `import`.
pub(super) fn load(
    libraries: &[&str],
    segments: &[Segment],
    files: &Files,
    wanted: Wanted,
    strictness: Strictness,
    import: &mut Import,
) -> Result<Vec<u32>, Refusal> {
    let mut defined: HashMap<String, MaterialDefinition> = HashMap::new();
    for file in find(libraries, files, &mut import.notes)? {
        for material in read(&file, files, &mut import.notes)? {
            let name = material.name.clone();
            defined.insert(name, MaterialDefinition { material, file: file.clone() });
        }
    }
    let mut known: HashMap<Option<&str>, u32> = HashMap::new();
    let mut maps = MtlMaps { files, strictness, numbers: HashMap::new() };
    let mut numbers = Vec::with_capacity(segments.len());
    for segment in segments {
        let name = segment.material.as_deref();
        let number = match known.get(&name) {
            Some(&number) => number,
            None => {
                let material = match (name, name.and_then(|name| defined.get(name))) {
                    (_, Some(defined)) => resolve(defined, &mut maps, wanted, import)?,
                    (name, None) => undefined(name, &mut import.notes),
                };
                import.materials.push(material);
                let number = u32::try_from(import.materials.len() - 1).unwrap_or(u32::MAX);
                known.insert(name, number);
                number
            }
        };
        numbers.push(number);
    }
    Ok(numbers)
}

/// The files that `mtllib` lines name: each line is one name, or several with blanks between them
/// and `\ ` for a blank inside one.
fn find(libraries: &[&str], files: &Files, notes: &mut Vec<Note>) -> Result<Vec<PathBuf>, Refusal> {
    let mut found: Vec<PathBuf> = Vec::new();
    let (mut seen, mut looked_for) = (HashSet::new(), 0);
    for line in libraries.iter().filter(|line| seen.insert(**line)) {
        let names = match files.locate(line)? {
            Some(_) => vec![(*line).to_owned()],
            None => split_names(line),
        };
        for name in names {
            looked_for += 1;
            if looked_for > MOST_LIBRARIES {
                let message = format!("only the first {MOST_LIBRARIES} material files are read");
                error::push(notes, Note::new(NoteKind::Irregular, "mtllib", message));
                return Ok(found);
            }
            match files.locate(&name)? {
                Some(file) if !found.contains(&file) => found.push(file),
                Some(_) => {}
                None => {
                    let message = "the material file does not exist; its materials are light grey";
                    error::push(notes, Note::new(NoteKind::MissingFile, name, message));
                }
            }
        }
    }
    Ok(found)
}

fn split_names(line: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut name = String::new();
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '\\' if characters.next_if_eq(&' ').is_some() => name.push(' '),
            blank if blank.is_whitespace() => {
                if !name.is_empty() {
                    names.push(std::mem::take(&mut name));
                }
            }
            other => name.push(other),
        }
    }
    if !name.is_empty() {
        names.push(name);
    }
    names
}

fn read(file: &Path, files: &Files, notes: &mut Vec<Note>) -> Result<Vec<tobj::Material>, Refusal> {
    let map = files.map(file)?;
    let mut text = String::new();
    for (number, line) in String::from_utf8_lossy(&with_newlines(map.bytes())).lines().enumerate() {
        match fit(line.trim_start_matches('\u{feff}').trim()) {
            Some(line) => {
                text.push_str(&line);
                text.push('\n');
            }
            None => {
                let message = format!("line {}, \"{}\", is left out", number + 1, line.trim());
                let subject = file.display().to_string();
                error::push(notes, Note::new(NoteKind::Irregular, subject, message));
            }
        }
    }
    match tobj::load_mtl_buf(&mut text.as_bytes()) {
        Ok((materials, _)) => Ok(materials),
        Err(error) => Err(error::damaged(file, "material file", error.to_string())),
    }
}

/// The line as `tobj` can read it; `None` when its value makes no sense.
fn fit(line: &str) -> Option<String> {
    let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim();
    let numbers: Vec<f64> = rest.split_whitespace().map_while(|word| word.parse().ok()).collect();
    match key {
        "Ka" | "Kd" | "Ks" | "Ke" => match *numbers.as_slice() {
            // The format's rule: green and blue are as red when they are not given.
            [grey] => Some(format!("{key} {grey} {grey} {grey}")),
            [red, green, blue, ..] => Some(format!("{key} {red} {green} {blue}")),
            _ => None,
        },
        "Ns" | "Ni" => numbers.first().map(|number| format!("{key} {number}")),
        // `d -halo 0.5` ends with its number.
        "d" => rest.split_whitespace().last()?.parse::<f64>().ok().map(|d| format!("d {d}")),
        "illum" => rest.parse::<u8>().ok().map(|model| format!("illum {model}")),
        "newmtl" => (!rest.is_empty()).then(|| format!("newmtl {rest}")),
        "map_kd" => (!rest.is_empty()).then(|| format!("map_Kd {rest}")),
        _ if key.starts_with("map_") || key.eq_ignore_ascii_case("bump") => {
            (!rest.is_empty()).then(|| format!("{key} {rest}"))
        }
        _ => Some(line.to_owned()),
    }
}

/// Material in the place of one that no file defines.
fn undefined(name: Option<&str>, notes: &mut Vec<Note>) -> Material {
    let Some(name) = name else { return Material::unnamed() };
    let message = "no material file defines it; it is light grey";
    error::push(notes, Note::new(NoteKind::Irregular, format!("usemtl {name}"), message));
    Material { name: name.to_owned(), ..Material::unnamed() }
}

fn resolve(
    defined: &MaterialDefinition,
    maps: &mut MtlMaps<'_>,
    wanted: Wanted,
    import: &mut Import,
) -> Result<Material, Refusal> {
    let material = &defined.material;
    let image = match &material.diffuse_texture {
        Some(map) if wanted.textures => maps.use_of(map, &defined.file, import)?,
        _ => None,
    };
    for what in chunk::impossible(material) {
        if maps.strictness == Strictness::Strict {
            return Err(error::damaged(
                &defined.file,
                format!("material \"{}\"", material.name),
                what.split(';').next().unwrap_or_default().to_owned(),
            ));
        }
        let note = Note::new(NoteKind::Irregular, material.name.clone(), what);
        error::push(&mut import.notes, note);
    }
    if wanted.light {
        for key in chunk::passed_over(material) {
            let message = "not supported: surfaces are shown without it";
            error::push(&mut import.notes, Note::new(NoteKind::Unsupported, key, message));
        }
    }
    let diffuse = material.diffuse.filter(|color| !color.iter().any(|value| value.is_nan()));
    let diffuse = diffuse.map(|color| color.map(|value| value.clamp(0.0, 1.0)));
    let base_color = match image {
        Some(image) => Paint::Image { factor: diffuse.unwrap_or([1.0; 3]), curve: None, image },
        None => diffuse.map_or(Material::unnamed().base_color, Paint::Plain),
    };
    let plain = Material { name: material.name.clone(), base_color, ..Material::unnamed() };
    Ok(if wanted.light { nearest(material, plain) } else { plain })
}

/// The nearest of our materials to what an MTL material says.
///
/// 1. Glass (`illum` 4, 6, 7 or 9): a dielectric of index `Ni`.
/// 2. Mirrors (`illum` 3, 5 or 8 with `Ks` and no `Kd`): metal of colour `Ks`.
/// 3. Highlights (`Ks` above zero): a matte base under a sheet that reflects `Ks` face on.
/// 4. All else is matte.
///
/// The roughness of 2 and 3 is that whose GGX peak is as wide as Phong's of exponent `Ns`, α² =
/// 2 / (Ns + 2) (Walter et al. 2007, section 5.2). `d` (or 1 − `Tr`) below 1 leaves that share of 2 to 4 in place.
/// `Ke` shines from both sides whatever else the surface does; so does `Ka` above 1, which can be no
/// reflectance and is how lamps were written before `Ke`. Of flat lamps at the rim of the model the backs
/// are left dark afterwards, see `lamps`.
fn nearest(material: &tobj::Material, plain: Material) -> Material {
    let sound = |color: Option<[f64; 3]>| {
        let color = color.filter(|c| c.iter().all(|v| v.is_finite()));
        color.unwrap_or_default().map(|v| v.clamp(0.0, 1.0))
    };
    let (diffuse, specular) = (sound(material.diffuse), sound(material.specular));
    let shininess = material.shininess.filter(|ns| ns.is_finite()).unwrap_or(0.0).max(0.0);
    let roughness = (2.0 / (shininess + 2.0)).powf(0.25);
    let ior = material.optical_density.filter(|n| n.is_finite()).map(|n| n.max(1.0));
    let dark = |color: [f64; 3]| color == [0.0; 3];
    let mut read = plain;
    match material.illumination_model {
        Some(4 | 6 | 7 | 9) => {
            read.base_color = Paint::Plain([1.0; 3]);
            read.scattering =
                Scattering::Dielectric(Glass::clear(Ior::Constant(ior.unwrap_or(1.5))));
        }
        Some(3 | 5 | 8) if dark(diffuse) && !dark(specular) => {
            read.base_color = Paint::Plain(specular);
            read.scattering = Scattering::Metal { roughness, named: None };
        }
        _ if !dark(specular) => {
            let surface = GltfSurface {
                metallic: 0.0,
                roughness,
                specular_color: specular.map(|s| s / 0.04),
                ..GltfSurface::default()
            };
            read.scattering = Scattering::Gltf(Box::new(surface));
        }
        _ => {}
    }
    // Some write what is missing instead of what is there.
    let tr = material.unknown_param.get("Tr").and_then(|tr| tr.parse::<f64>().ok());
    let dissolve = material.dissolve.or(tr.map(|tr| 1.0 - tr));
    let dissolve = dissolve.filter(|d| d.is_finite()).unwrap_or(1.0);
    if dissolve < 1.0 && !read.scattering.is_body() {
        read.alpha = Alpha::Blend { factor: dissolve.max(0.0) };
    }
    let shines = |[red, green, blue]: [f64; 3]| Emission {
        radiance: Paint::Plain([red, green, blue]),
        strength: 1.0,
        illuminant: None,
        two_sided: true,
        group: None,
        modulation: None,
    };
    let own = material.emissive.filter(|color| !dark(*color));
    let ambient = material.ambient.filter(|color| color.iter().any(|v| *v > 1.0));
    let sound = |color: &[f64; 3]| color.iter().all(|v| (0.0..=BRIGHTEST).contains(v));
    read.emission = own.or(ambient).filter(sound).map(shines);
    read
}

/// The images that maps name, each once.
struct MtlMaps<'a> {
    files: &'a Files,
    strictness: Strictness,
    numbers: HashMap<(PathBuf, bool), u32>,
}

impl MtlMaps<'_> {
    fn use_of(
        &mut self,
        written: &str,
        library: &Path,
        import: &mut Import,
    ) -> Result<Option<TextureUse>, Refusal> {
        let map = Map::parse(written);
        let (key, source) = match self.files.locate_beside(library, &map.name)? {
            Some(file) => (file.clone(), ImageSource::File(file)),
            None if self.strictness == Strictness::Strict => {
                return Err(error::damaged(
                    library,
                    "map_Kd",
                    format!("\"{}\" does not exist", map.name),
                ));
            }
            None => {
                error::push(&mut import.notes, error::missing_image(map.name.clone()));
                (PathBuf::from(&map.name), ImageSource::Missing)
            }
        };
        let next = u32::try_from(import.textures.len()).unwrap_or(u32::MAX);
        let texture = *self.numbers.entry((key, map.clamp)).or_insert_with(|| {
            let wrap = if map.clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
            import.textures.push(Texture {
                name: map.name.clone(),
                source,
                wrap: [wrap; 2],
                filter: Filter::Bilinear,
                named_by_scene: false,
            });
            next
        });
        let ([su, sv], [ou, ov]) = (map.scale, map.offset);
        // The map's v runs up and ours down: 1 − (sv·(1 − v) + ov).
        let transform = [[su, 0.0, ou], [0.0, sv, 1.0 - sv - ov]];
        Ok(Some(TextureUse { texture, uv_set: 0, transform, encoding: Encoding::Srgb }))
    }
}

/// A `map_Kd` line taken apart.
#[derive(Debug, PartialEq)]
struct Map {
    name: String,
    scale: [f64; 2],
    offset: [f64; 2],
    clamp: bool,
}

impl Map {
    fn parse(written: &str) -> Self {
        let mut map = Self { name: String::new(), scale: [1.0; 2], offset: [0.0; 2], clamp: false };
        let mut words = written.split_whitespace().peekable();
        while let Some(option) = words.next_if(|word| word.starts_with('-')) {
            let most = match option {
                "-s" | "-o" | "-t" => 3,
                "-mm" => 2,
                "-blendu" | "-blendv" | "-cc" | "-clamp" | "-texres" | "-bm" | "-boost"
                | "-imfchan" | "-type" => 1,
                // A file whose name starts so.
                _ => {
                    map.name = option.to_owned();
                    break;
                }
            };
            let mut numbers = Vec::new();
            for _ in 0..most {
                let word = match most {
                    1 => words.next(),
                    _ => words.next_if(|word| word.parse::<f64>().is_ok()),
                };
                map.clamp |= option == "-clamp" && word == Some("on");
                numbers.extend(word.and_then(|word| word.parse::<f64>().ok()));
            }
            let target = match option {
                "-s" => &mut map.scale,
                "-o" => &mut map.offset,
                _ => continue,
            };
            for (value, number) in target.iter_mut().zip(numbers) {
                *value = number;
            }
        }
        let rest: Vec<&str> = words.collect();
        let rest = rest.join(" ");
        map.name = [map.name, rest]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join(" ");
        map
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_taken_apart() {
        let map = Map::parse("-s 2 3 1 -o 0.5 -clamp on my wood.png");
        let expected = Map {
            name: "my wood.png".to_owned(),
            scale: [2.0, 3.0],
            offset: [0.5, 0.0],
            clamp: true,
        };
        assert_eq!(map, expected);
        assert_eq!(Map::parse("-odd name.png").name, "-odd name.png");
        assert_eq!(Map::parse("2 3.png").name, "2 3.png");
    }

    #[test]
    fn names_with_blanks_are_told_apart() {
        assert_eq!(split_names(r"a.mtl b\ c.mtl  d\e.mtl"), ["a.mtl", "b c.mtl", r"d\e.mtl"]);
    }

    #[test]
    fn lines_that_would_end_the_process_are_put_right() {
        assert_eq!(fit("Kd 0.5").as_deref(), Some("Kd 0.5 0.5 0.5"));
        assert_eq!(fit("Kd 0.5 0.5"), None);
        assert_eq!(fit("Kd spectral a.rfl"), None);
        assert_eq!(fit("Ks 1 2 3 4").as_deref(), Some("Ks 1 2 3"));
        assert_eq!(fit("d -halo 0.5").as_deref(), Some("d 0.5"));
        assert_eq!(fit("newmtl"), None);
        assert_eq!(fit("map_Kd"), None);
        assert_eq!(fit("").as_deref(), Some(""));
    }
}
