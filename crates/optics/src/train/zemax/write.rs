//! A lens file as a Zemax file, which OpticStudio and [`super::ZemaxLens`] read.

use std::fmt::Write;

use super::write_surface::{SurfaceLines, surface};
use crate::element::{ElementSpec, PartSpec};
use crate::glass::{FRAUNHOFER_D, GlassSpec};
use crate::train::{FieldSpec, LensFile};

impl LensFile {
    /// The lens as the text of a `.zmx` file, in millimetres.
    ///
    /// # Errors
    ///
    /// A sentence that names the element that such files have no counterpart for.
    pub fn to_zemax(&self) -> Result<String, String> {
        let mut rows = Vec::new();
        let mut medium: Option<GlassSpec> = None;
        for (i, element) in self.elements.iter().enumerate() {
            let error = |why: String| format!("elements[{i}]: {why}");
            if element.mount.gradient.is_some() {
                return Err(error(
                    "a gradient has no counterpart here; save the lens as .json".to_owned(),
                ));
            }
            if let PartSpec::CoordinateBreak(broken) = &element.part {
                rows.push(axis_break(broken, &element.mount).map_err(error)?);
                continue;
            }
            let mut row = surface(element, medium.as_ref()).map_err(error)?;
            if let Some(behind) = element.part.medium_behind() {
                medium = behind.cloned();
            }
            if element.mount.stop {
                row.lines.insert(0, "STOP".to_owned());
            }
            placed(element, row, &mut rows);
        }
        let mut text = "VERS 140730 201 26155\nMODE SEQ\n".to_owned();
        // A title of one line.
        let name = self.name.replace(['\r', '\n'], " ");
        let _ = write!(
            text,
            "NAME {name}\nUNIT MM X W X CM MR CPMM\nFLOA\n{}",
            self.fields_and_wavelengths()
        );
        let makers = self.glass_makers();
        if !makers.is_empty() {
            let _ = writeln!(text, "GCAT {}", makers.join(" "));
        }
        let object =
            SurfaceLines { lines: vec!["TYPE STANDARD".to_owned()], thickness: f64::INFINITY };
        let mut image = vec![SurfaceLines::new("STANDARD")];
        if let Some(sensor) = self.sensor {
            let mount = crate::element::Mount {
                tilt: sensor.tilt,
                decentre: sensor.decentre,
                ..crate::element::Mount::default()
            };
            image.insert(0, coordinate_break(&mount, 1.0));
        }
        for (number, row) in std::iter::once(object).chain(rows).chain(image).enumerate() {
            let _ = writeln!(text, "SURF {number}");
            for line in &row.lines {
                let _ = writeln!(text, "  {line}");
            }
            match row.thickness.is_infinite() {
                true => text.push_str("  DISZ INFINITY\n"),
                false => {
                    let _ = writeln!(text, "  DISZ {:e}", row.thickness);
                }
            }
        }
        Ok(text)
    }

    /// Lines on its fields and wavelengths.
    fn fields_and_wavelengths(&self) -> String {
        let main = self.wavelength.map_or(FRAUNHOFER_D, |nm| nm.0);
        let wavelengths = match self.wavelengths_nm() {
            none if none.is_empty() => vec![main],
            all => all,
        };
        let mut text = String::new();
        if !self.fields.is_empty() {
            let (fields, used) = (self.fields.len(), wavelengths.len());
            let _ = writeln!(text, "FTYP 0 0 {fields} {used} 0 0 0");
            type Value = fn(&FieldSpec) -> f64;
            let lists: [(&str, Value); 8] = [
                ("XFLN", |_| 0.0),
                ("YFLN", |field| field.angle.0),
                ("FWGN", |field| field.weight),
                ("VDXN", |field| field.vignetting.decentre[0]),
                ("VDYN", |field| field.vignetting.decentre[1]),
                ("VCXN", |field| field.vignetting.compression[0]),
                ("VCYN", |field| field.vignetting.compression[1]),
                ("VANN", |field| field.vignetting.rotation.0),
            ];
            for (command, value) in lists {
                let values = self.fields.iter().map(|field| format!(" {:e}", value(field)));
                let _ = writeln!(text, "{command}{}", values.collect::<String>());
            }
        }
        for (i, nm) in wavelengths.iter().enumerate() {
            let weight = self.weights.get(i).copied().unwrap_or(1.0);
            let _ = writeln!(text, "WAVM {} {:e} {weight:e}", i + 1, nm * 1e-3);
        }
        text.push_str("PWAV 1\n");
        text
    }

    /// The makers that its glasses name, in the order in which they do: where two have a glass of one name, that of
    /// the first is taken when the file is read.
    fn glass_makers(&self) -> Vec<String> {
        let mut makers = Vec::new();
        for element in &self.elements {
            if let Some(Some(GlassSpec::Named(name))) = element.part.medium_behind()
                && let Some((maker, _)) = name.split_once(':')
            {
                let maker = maker.to_uppercase();
                if !makers.contains(&maker) {
                    makers.push(maker);
                }
            }
        }
        makers
    }
}

/// A break to where an element stands, or, with −1, back.
fn coordinate_break(mount: &crate::element::Mount, sense: f64) -> SurfaceLines {
    let mut row = SurfaceLines::new("COORDBRK");
    let values = [mount.decentre[0].0, mount.decentre[1].0, mount.tilt[0].0, mount.tilt[1].0];
    for (i, value) in values.into_iter().enumerate().filter(|(_, value)| *value != 0.0) {
        row.parameter(i + 1, sense * value);
    }
    if sense < 0.0 {
        // Turned first, about the axes in the other order.
        row.parameter(6, 1.0);
    }
    row
}

/// A break of the axis for all that follows.
fn axis_break(
    broken: &crate::element::CoordinateBreakSpec,
    mount: &crate::element::Mount,
) -> Result<SurfaceLines, String> {
    if broken.return_to.is_some() {
        return Err(
            "return_to is not written; write the turns and decentres of the way back".to_owned()
        );
    }
    let mut row = coordinate_break(mount, 1.0);
    if broken.rotation.0 != 0.0 {
        row.parameter(5, broken.rotation.0);
    }
    if broken.tilt_first {
        row.parameter(6, 1.0);
    }
    row.thickness = mount.thickness.0;
    Ok(row)
}

/// Adds the row of an element with the breaks that it takes.
fn placed(element: &ElementSpec, mut row: SurfaceLines, rows: &mut Vec<SurfaceLines>) {
    let mount = &element.mount;
    let is_moved = mount.tilt.iter().any(|angle| angle.0 != 0.0)
        || mount.decentre.iter().any(|length| length.0 != 0.0);
    if !is_moved {
        row.thickness = mount.thickness.0;
        return rows.push(row);
    }
    let folds = match &element.part {
        PartSpec::Mirror(mirror) => mirror.fold,
        PartSpec::Freeform(surface) => surface.mirror && surface.fold,
        _ => false,
    };
    rows.extend([coordinate_break(mount, 1.0), row]);
    if folds {
        // About y first and then about x, as the reflection of the way there; and back across.
        let turn = |axis: usize| {
            let mut row = SurfaceLines::new("COORDBRK");
            row.parameter(axis + 3, mount.tilt[axis].0);
            row
        };
        rows.extend([turn(1), turn(0)]);
        let mut back = SurfaceLines::new("COORDBRK");
        for (i, length) in mount.decentre.iter().enumerate().filter(|(_, length)| length.0 != 0.0) {
            back.parameter(i + 1, -length.0);
        }
        back.thickness = mount.thickness.0;
        rows.push(back);
    } else {
        let mut back = coordinate_break(mount, -1.0);
        back.thickness = mount.thickness.0;
        rows.push(back);
    }
}
