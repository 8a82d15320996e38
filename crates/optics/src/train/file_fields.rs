//! Field points and wavelengths that a lens file states.

use super::LensError;
use super::fields::{MOST_FIELDS, MOST_WAVELENGTHS};
use super::file::LensFile;

impl LensFile {
    /// The angles of its fields (degrees).
    #[must_use]
    pub fn field_angles(&self) -> Vec<f64> {
        self.fields.iter().map(|field| field.angle.0).collect()
    }

    /// Its wavelengths (nm), the main one first; none where it names none but that.
    #[must_use]
    pub fn wavelengths_nm(&self) -> Vec<f64> {
        self.wavelengths.iter().map(|wavelength| wavelength.0).collect()
    }

    /// Refuses what its fields and wavelengths cannot be.
    pub(super) fn check_fields(&self) -> Result<(), LensError> {
        let error = |key: String, why: String| Err(LensError::Key { key, why });
        let counts = [
            ("fields", self.fields.len(), MOST_FIELDS),
            ("wavelengths", self.wavelengths.len(), MOST_WAVELENGTHS),
        ];
        if let Some((key, count, most)) = counts.into_iter().find(|(_, count, most)| count > most) {
            return error(key.to_owned(), format!("has {count}, and {most} are the most"));
        }
        for (i, field) in self.fields.iter().enumerate() {
            field.check().or_else(|why| error(format!("fields[{i}]"), why))?;
        }
        for (i, nm) in self.wavelengths.iter().enumerate() {
            if !(nm.0 > 0.0 && nm.0.is_finite()) {
                let why = format!("{} nm is no wavelength; it must be positive", nm.0);
                return error(format!("wavelengths[{i}]"), why);
            }
        }
        if let (Some(main), Some(first)) = (self.wavelength, self.wavelengths.first())
            && main != *first
        {
            let why = format!(
                "{} nm is the first, and `wavelength` is {} nm: put that first, or leave it out",
                first.0, main.0
            );
            return error("wavelengths".to_owned(), why);
        }
        if self.weights.is_empty() {
            return Ok(());
        }
        let are_weights = self.weights.iter().all(|w| *w >= 0.0 && w.is_finite())
            && self.weights.iter().any(|w| *w > 0.0);
        if self.weights.len() != self.wavelengths.len() || !are_weights {
            let why = format!(
                "give one for each of the {} wavelengths, from 0 on and not all 0",
                self.wavelengths.len()
            );
            return error("weights".to_owned(), why);
        }
        Ok(())
    }
}
