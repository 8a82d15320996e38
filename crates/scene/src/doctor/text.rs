//! A diagnosis as a table for people.

use std::fmt;

use etendue_report::Table;

use super::{Diagnosis, Finding};
use crate::escape::one_line;

/// The most objects and files that are listed by name.
const LISTED: usize = 20;

impl Diagnosis {
    /// A list of names and values.
    #[must_use]
    pub fn table(&self) -> Table {
        let mut list = Table::list(14);
        // What is in the file.
        list.put("file", self.file.display());
        list.put("triangles", self.count());
        match &self.bounds {
            Some(extent) => {
                list.put("bounds", format!("{} to {} m", point(extent.min), point(extent.max)));
                let size: [f64; 3] = std::array::from_fn(|k| extent.max[k] - extent.min[k]);
                list.put("size", format!("{} m", point(size)));
            }
            None => list.put("bounds", "none"),
        }
        list.put("units", &self.units.remark);
        self.list_objects(&mut list);
        // What is wrong with it, and how exact it is.
        list.put("defects", self.defects_in_words());
        if let Some(p) = &self.precision {
            let text = format!(
                "files {:.1e} m; f32 {:.1e} m in the world, {:.1e} m from the scene's centre; \
                 f64 {:.1e} m",
                p.input_step, p.f32_step_in_world, p.f32_step_from_centre, p.f64_step
            );
            list.put("precision", text);
        }
        // What looks at it, and what lights it.
        let [width, height] = self.camera.resolution;
        list.put("camera", format!("{width} × {height}, {}", self.camera_origin));
        if let Some(frames) = self.frames {
            list.put("frames", format!("{frames}; all below is of one"));
        }
        if let Some(k) = self.camera.k {
            let [fx, fy, cx, cy] = [k[0][0], k[1][1], k[0][2], k[1][2]];
            let text =
                format!("fx {fx:.4} fy {fy:.4} cx {cx:.4} cy {cy:.4} skew {:.4} px", k[0][1]);
            list.put("", text);
        }
        for camera in &self.cameras {
            let text = format!(
                "--camera {} \"{}\" ({})",
                camera.index,
                one_line(&camera.name),
                camera.kind
            );
            list.put("", text);
        }
        if self.lights > 0 {
            list.put("lights", format!("{} in the models", self.lights));
        }
        // What it needs, what is left over, and what was found.
        let memory = self.memory.decision();
        list.put("memory", format!("{} ({})", memory.value, memory.reason));
        for path in self.unused_files.iter().take(LISTED) {
            list.put("unused file", one_line(&path.to_string_lossy()));
        }
        for finding in self.extensions.iter().chain(&self.findings) {
            list.put(finding.word(), finding);
        }
        list
    }

    fn count(&self) -> String {
        let Self { triangles, triangles_unique, meshes, placements, .. } = self;
        if triangles == triangles_unique {
            format!("{triangles} in {meshes} meshes")
        } else {
            format!(
                "{triangles} in {placements} placements; {triangles_unique} unique in {meshes} \
                 meshes"
            )
        }
    }

    fn defects_in_words(&self) -> String {
        let named = [
            (self.defects.not_finite, "not finite (dropped)"),
            (self.defects.degenerate, "without area (left out)"),
            (self.defects.collapsed, "placements without extent (left out)"),
            (self.defects.duplicate, "twice there"),
            (self.defects.coplanar, "pairs of things in one plane"),
        ];
        let found: Vec<String> = named
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        if found.is_empty() { "none".to_owned() } else { found.join(", ") }
    }

    fn list_objects(&self, list: &mut Table) {
        for (index, object) in self.objects.iter().take(LISTED).enumerate() {
            let label = if index == 0 { "objects" } else { "" };
            let (id, name) = (object.id, one_line(&object.name));
            list.put(label, format!("{id} \"{name}\": {} triangles", object.triangles));
        }
        if let Some(more) = self.objects.len().checked_sub(LISTED).filter(|more| *more > 0) {
            list.put("", format!("… and {more} more"));
        }
    }
}

impl Finding {
    fn word(&self) -> &'static str {
        use crate::NoteKind as Kind;
        match self.kind {
            Kind::Extension => "extension",
            Kind::Unsupported => "unsupported",
            Kind::MissingFile => "missing file",
            Kind::NotFinite => "not finite",
            Kind::Unused => "unused",
            Kind::Assumed => "assumed",
            Kind::Irregular => "irregular",
            Kind::Empty => "empty",
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", one_line(&self.subject), one_line(&self.message))?;
        if self.count > 1 { write!(f, " ({} times)", self.count) } else { Ok(()) }
    }
}

/// A point with six digits; nothing hides behind an exponent that need not be there.
fn point(p: [f64; 3]) -> String {
    let [x, y, z] = p.map(|x| {
        // Rounded to six significant digits, then printed as short as that allows.
        let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
        rounded.to_string()
    });
    format!("[{x}, {y}, {z}]")
}
