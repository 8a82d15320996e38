//! Configurations: values that a zoom lens has in each of its positions.
//!
//! `MNUM` has their number and the one that the file stands at, whose values the surfaces have. Each value
//! of each is a line of its own: the operand, its surface or field, the configuration from 1, the value.

use super::ZemaxError;
use super::sheet::{Aperture, SheetLine, ZemaxSheet};

/// Thicknesses from here on are infinite, as OpticStudio has it.
const INFINITE: f64 = 1e10;

/// Operands whose values are taken, and what others do to the light's way.
const TAKEN: [&str; 7] = ["THIC", "CRVT", "CONN", "SDIA", "APER", "XFIE", "YFIE"];
const NOT_TAKEN: [&str; 15] = [
    "GLSS", "STPS", "PRAM", "EDVA", "MABB", "MIND", "CADX", "CADY", "CATX", "CATY", "CATZ", "CAOR",
    "WAVE", "PRWV", "IGNR",
];

/// A value of one configuration.
#[derive(Debug, Clone)]
pub(super) struct ConfigurationValue {
    line: usize,
    operand: &'static str,
    /// Of the surface or field.
    index: usize,
    configuration: usize,
    value: String,
}

impl ConfigurationValue {
    /// The value in a line; `None` when it is none of an operand.
    pub(super) fn read(line: &SheetLine<'_>) -> Result<Option<Self>, ZemaxError> {
        let operand = TAKEN.iter().chain(&NOT_TAKEN).find(|operand| **operand == line.command);
        let Some(&operand) = operand else { return Ok(None) };
        let (Ok(index), Ok(configuration), Some(value)) =
            (line.index(0), line.index(1), line.word(2))
        else {
            return Err(line.error("expected a surface or field, a configuration, and a value"));
        };
        let value = value.to_owned();
        Ok(Some(Self { line: line.number, operand, index, configuration, value }))
    }

    fn error(&self, why: &str) -> ZemaxError {
        ZemaxError::new(self.line, format!("{}: {why}", self.operand))
    }

    fn number(&self) -> Result<f64, ZemaxError> {
        let number = self.value.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.error(&format!("`{}` is not a number", self.value)))
    }
}

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
        let number = value.number()?;
        let missing = |what: &str| value.error(&format!("there is no {what} {}", value.index));
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
