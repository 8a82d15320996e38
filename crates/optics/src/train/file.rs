//! The lens file: elements from the object side to the sensor, in millimetres.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Element, LensError, MOST_ELEMENTS, OpticalTrain, remove_notes};
use crate::element::{ElementSpec, Frame, LossesSpec, PartSpec, Resolve};
use crate::glass::{AgfCatalogue, FRAUNHOFER_D, Glass};
use etendue_geometry::units::{Degrees, Millimetres, Nanometres};

/// A lens as its file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LensFile {
    /// What the lens is called.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Where the numbers come from.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// The parts from the object side to the sensor.
    pub elements: Vec<ElementSpec>,
    /// The wavelength at which the lens is focused and its stop is set (nm); helium's d line when
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength: Option<Nanometres>,
    /// How the sensor stands: tilted for Scheimpflug's rule, decentred for shift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<SensorMount>,
    /// Catalogues of glasses in Zemax' AGF format, by their paths from the lens file's folder; the last
    /// is asked first, the built-in catalogue last.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub glass_catalogs: Vec<String>,
}

/// How a sensor stands in its lens.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorMount {
    /// Turns about the x axis and then about the sensor's own y axis (degrees), right-handed.
    pub tilt: [Degrees; 2],
    /// Moved across the axis by x and y (mm).
    pub decentre: [Millimetres; 2],
}

impl LensFile {
    /// A lens of the given elements.
    #[must_use]
    pub fn new(elements: Vec<ElementSpec>) -> Self {
        Self { elements, ..Self::default() }
    }

    /// Reads a lens file's text.
    ///
    /// # Errors
    ///
    /// [`LensError::Json`], with line and column of a file without notes.
    pub fn from_json(text: &str) -> Result<Self, LensError> {
        let json = |error: serde_json::Error| LensError::Json(error.to_string());
        // As it stands, so that an error has its line, unless notes are to be left out.
        serde_json::from_str(text).or_else(|error| {
            let mut value = serde_json::from_str(text).map_err(json)?;
            let file = match remove_notes(&mut value) {
                true => serde_json::from_value(value),
                false => Err(error),
            };
            file.map_err(json)
        })
    }

    /// The lens, ready to be traced. `resolve` turns the names of the lens file's own files (masks)
    /// into paths.
    ///
    /// # Errors
    ///
    /// When an element or a glass is not one; the error names the element.
    pub fn build(&self, resolve: Resolve<'_>) -> Result<OpticalTrain, LensError> {
        if self.elements.is_empty() {
            return Err(LensError::Empty);
        }
        if self.elements.len() > MOST_ELEMENTS {
            return Err(LensError::TooMany(self.elements.len()));
        }
        let wavelength = self.wavelength.map_or(FRAUNHOFER_D, |nm| nm.0);
        if !(wavelength > 0.0 && wavelength.is_finite()) {
            return Err(LensError::Wavelength(wavelength));
        }
        // Elements one after the other, each with the medium behind it.
        // The lens file's own catalogues before those of its user.
        let own = self.catalogues(resolve)?;
        let catalogues = match own.is_empty() {
            true => Cow::Borrowed(resolve.glasses()),
            false => Cow::Owned([resolve.glasses(), &own].concat()),
        };
        let mut media = vec![Glass::air()];
        let mut elements = Vec::with_capacity(self.elements.len());
        let mut z = 0.0;
        for (index, spec) in self.elements.iter().enumerate() {
            let error = |why| LensError::Element { index, why };
            elements.push(place(spec, z, resolve).map_err(error)?);
            media.push(behind(spec, index, &media, &catalogues)?);
            z += spec.mount.thickness.0;
        }
        let train = OpticalTrain {
            name: self.name.clone(),
            source: self.source.clone(),
            elements,
            media,
            stop: 0,
            wavelength,
            end: z,
            sensor: self.sensor.unwrap_or_default(),
            losses: LossesSpec::default(),
            notes: Vec::new(),
        };
        train.with_stop(self.stop()?)
    }

    fn catalogues(&self, resolve: Resolve<'_>) -> Result<Vec<AgfCatalogue>, LensError> {
        let read = |(index, name): (usize, &String)| {
            resolve
                .path(name)
                .and_then(|path| {
                    AgfCatalogue::open(&path).map_err(|error| format!("{name}: {error}"))
                })
                .map_err(|why| LensError::Catalogue { index, why })
        };
        self.glass_catalogs.iter().enumerate().map(read).collect()
    }

    /// The element marked as the stop, or the only aperture.
    fn stop(&self) -> Result<Option<usize>, LensError> {
        let indices = |wanted: &dyn Fn(&ElementSpec) -> bool| -> Vec<usize> {
            (0..self.elements.len()).filter(|&i| wanted(&self.elements[i])).collect()
        };
        let marked = indices(&|e| e.mount.stop);
        let apertures = indices(&|e| matches!(e.part, PartSpec::Aperture(_)));
        match (marked.as_slice(), apertures.as_slice()) {
            (&[first, second, ..], _) => Err(LensError::Stops { first, second }),
            (&[stop], _) | (&[], &[stop]) => Ok(Some(stop)),
            _ => Ok(None),
        }
    }
}

fn place(spec: &ElementSpec, z: f64, resolve: Resolve<'_>) -> Result<Element, String> {
    let part = spec.part.build(resolve)?;
    let tilt = spec.mount.tilt.map(|angle| angle.0);
    let decentre = spec.mount.decentre.map(|length| length.0);
    let numbers = [spec.mount.thickness.0, tilt[0], tilt[1], decentre[0], decentre[1]];
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err("thickness, tilt and decentre must be finite".to_owned());
    }
    Ok(Element { part, frame: Frame::placed(z, decentre, tilt) })
}

/// The medium behind an element: a surface's glass or air, and what was there for a sheet. Faces of
/// lenslets are surfaces.
fn behind(
    spec: &ElementSpec,
    index: usize,
    media: &[Glass],
    catalogues: &[AgfCatalogue],
) -> Result<Glass, LensError> {
    match spec.part.medium_behind() {
        Some(Some(glass)) => {
            glass.resolve_in(catalogues).map_err(|source| LensError::Glass { index, source })
        }
        Some(None) => Ok(Glass::air()),
        None => Ok(media[index].clone()),
    }
}
