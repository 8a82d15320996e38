//! Configurations: values that a zoom lens has in each of its positions.
//!
//! `MNUM` has their number and the one that the file stands at, whose values the surfaces have. Each value
//! of each is a line of its own: the operand, its surface or field, the configuration from 1, the value.

use super::ZemaxError;
use super::line::{ConfigurationValue, TAKEN};
use super::sheet::{Aperture, ZemaxSheet};

/// Thicknesses from here on are infinite, as OpticStudio has it.
const INFINITE: f64 = 1e10;

impl ZemaxSheet {
    /// Puts the values of a configuration, from 1, in place of those that the file stands at.
    pub(super) fn choose(&mut self, configuration: usize) -> Result<(), ZemaxError> {
        if configuration == 0 || configuration > self.configurations {
            let why = format!(
                "there is no configuration {configuration}: the file has {}, from 1",
                self.configurations
            );
            return Err(ZemaxError::new(self.last_line, why));
        }
        let active = std::mem::replace(&mut self.configuration, configuration);
        if active == configuration {
            return Ok(());
        }
        let all = std::mem::take(&mut self.values);
        for value in all.iter().filter(|value| value.configuration == configuration) {
            let is_same = |other: &&ConfigurationValue| {
                (other.operand, other.index, other.configuration)
                    == (value.operand, value.index, active)
            };
            let stands = all.iter().find(is_same);
            if TAKEN.contains(&value.operand) {
                self.take(value)?;
            } else if stands.is_none_or(|stands| stands.value != value.value) {
                return Err(value.error(&format!(
                    "what configuration {configuration} changes here has no counterpart; open the file at that \
                     configuration in OpticStudio and save it"
                )));
            }
        }
        self.values = all;
        Ok(())
    }

    fn take(&mut self, value: &ConfigurationValue) -> Result<(), ZemaxError> {
        let missing = |what: &str| value.error(&format!("there is no {what} {}", value.index));
        if value.operand == "GLSS" {
            let row = self.rows.get_mut(value.index).ok_or_else(|| missing("surface"))?;
            return row.change_glass(value.line, &value.value);
        }
        let number = value.number()?;
        let slot = value.index.checked_sub(1);
        if value.operand == "WAVE" {
            let wavelength = slot.and_then(|slot| self.wavelengths.get_mut(slot));
            *wavelength.ok_or_else(|| missing("wavelength"))? = number;
            return Ok(());
        }
        if let "WLWT" | "FLWT" = value.operand {
            let (weights, count) = match value.operand {
                "WLWT" => (&mut self.wavelength_weights, self.wavelengths.len()),
                _ => (&mut self.fields.weights, self.fields.x.len().max(self.fields.y.len())),
            };
            weights.resize(weights.len().max(count), 1.0);
            let weight = slot.and_then(|slot| weights.get_mut(slot));
            *weight.ok_or_else(|| missing("wavelength or field"))? = number;
            return Ok(());
        }
        if value.operand == "APER" {
            self.aperture = match self.aperture {
                Some((line, Aperture::EntrancePupil(_))) => {
                    Some((line, Aperture::EntrancePupil(number)))
                }
                Some((line, Aperture::FNumber(_))) => Some((line, Aperture::FNumber(number))),
                Some((_, Aperture::AtObject(_))) | None => {
                    return Err(value.error("only the values of ENPD and FNUM can be changed"));
                }
            };
            return Ok(());
        }
        if let "XFIE" | "YFIE" = value.operand {
            let fields =
                if value.operand == "XFIE" { &mut self.fields.x } else { &mut self.fields.y };
            let field = value.index.checked_sub(1).and_then(|i| fields.get_mut(i));
            *field.ok_or_else(|| missing("field"))? = number;
            return Ok(());
        }
        let row = self.rows.get_mut(value.index).ok_or_else(|| missing("surface"))?;
        match value.operand {
            "THIC" => row.thickness = if number >= INFINITE { f64::INFINITY } else { number },
            "CRVT" => row.curvature = number,
            "CONN" => row.conic = number,
            _ => row.semi_diameter = Some(number).filter(|length| *length > 0.0),
        }
        Ok(())
    }
}
