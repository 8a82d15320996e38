//! The fewest spectral bands that count a sensor's electrons right.
//!
//! A render carries a few numbers a ray, and multiplies those of light and surfaces. That loses what
//! happens within a band: the mean of a product is not the product of the means. How much it loses
//! can be known beforehand, for light of known spectra, for filters, for colours and for what bodies
//! and metals leave of light: red, green and blue alone and two or three of them one behind the other
//! are the worst that colours can be, and every other colour is a sum of them. So bands are divided where they lose most until the electrons of every channel
//! agree with an integration in steps of a nanometre at most, and joined again where that does no
//! harm.
//!
//! Electrons count as right within a tolerance ([`TOLERANCE`] by itself) of themselves; of colours darker than a tenth of
//! white, within that of a tenth of white, and behind two pure colours within that of white. White is
//! what bodies and metals on the way leave of it, where that is three thousandths at least; of less, those three
//! thousandths are.

mod division;
mod factor;
mod nodes;
mod table;

pub use factor::{Factor, Illumination, Times};

use etendue_report::Refusal;
use etendue_spectrum::{Bands, Curve, Grid, WeightedBands};

use crate::response::{filters, sensitive_range};
use crate::spec::{Radiometry, SensorKind};
use crate::{Sensor, SensorError};
use division::Division;
use table::BandTable;

/// By how much of themselves electrons may differ from an integration in steps of a nanometre.
pub const TOLERANCE: f64 = 1e-3;

/// Bands for a sensor, and what they lose.
#[derive(Debug, Clone, PartialEq)]
pub struct BandChoice {
    /// The bands.
    pub bands: Bands,
    /// The worst relative error of any channel's electrons under any light and colour; `None` where
    /// nobody counts photons, or nobody worked it out.
    pub error: Option<f64>,
    /// True if all products of the light's curves were tried; false if there are too many.
    pub complete: bool,
}

impl BandChoice {
    /// Bands that nobody compared with others.
    #[must_use]
    pub fn untried(bands: Bands) -> Self {
        Self { bands, error: None, complete: true }
    }
}

impl Sensor {
    /// True if its bands are chosen by the light, within a tolerance: false where they are given as they are to be
    /// taken, and of a sensor in digital mode that tells no more than its colours or its channels apart.
    #[must_use]
    pub fn chooses_bands(&self) -> bool {
        !self.has_untried_bands() && (self.spec().bands.is_none() || self.divides_bands())
    }

    /// True if the bands that are given are channels, which may be divided further.
    fn divides_bands(&self) -> bool {
        self.spec().kind == SensorKind::Multispectral && self.spec().bands.is_some()
    }

    /// True if its bands are taken without a look at the light: digital mode counts no electrons.
    fn has_untried_bands(&self) -> bool {
        let ideal = matches!(self.response.bands, Bands::Grey | Bands::Rgb);
        self.settings.radiometry == Radiometry::Digital && (ideal || self.spec().bands.is_some())
    }

    /// The fewest bands in which a render counts this sensor's electrons right within `tolerance` of themselves,
    /// or its own `bands`.
    ///
    /// In digital mode a sensor without curves keeps the three colours, or the one, that it tells
    /// apart: its light is a picture's.
    ///
    /// # Errors
    ///
    /// When the sensor sees nothing of the light.
    pub fn bands_under(
        &self,
        light: &Illumination,
        tolerance: f64,
    ) -> Result<BandChoice, SensorError> {
        let spec = self.spec();
        let ideal = matches!(self.response.bands, Bands::Grey | Bands::Rgb);
        if self.has_untried_bands() {
            return Ok(BandChoice::untried(self.response.bands.clone()));
        }
        // The range in which the sensor sees the light, or the bands that are asked for.
        let filters = filters(spec)?.filters;
        let given = spec.bands.as_ref().map(|grid| grid.edges().to_vec());
        let range = match &given {
            Some(edges) => [edges[0], edges[edges.len() - 1]],
            None => lit_range(sensitive_range(&self.settings.efficiency, &filters), light)?,
        };
        let edges = given.clone().unwrap_or(range.to_vec());
        let Some(table) = BandTable::new(self, &filters, light, range, &edges) else {
            return Ok(BandChoice::untried(self.response.bands.clone()));
        };
        // The bands of ideal filters will do where they count the same electrons.
        if ideal {
            let error = table.error_of(&self.response, &filters, &self.settings.efficiency, light);
            if error <= tolerance {
                let bands = self.response.bands.clone();
                return Ok(BandChoice { bands, error: Some(error), complete: table.complete });
            }
        }
        // Otherwise bands are divided until they do.
        let fixed = table.cells_at(&edges);
        let may_divide = given.is_none() || self.divides_bands();
        let division = Division::of(&table);
        let cells = if may_divide { division.divided(&fixed, tolerance) } else { fixed };
        let (error, complete) = (Some(division.worst(&cells)), table.complete);
        let edges = cells.iter().map(|&cell| table.edges[cell]).collect();
        let bands = match Grid::from_edges(edges) {
            Ok(grid) => Bands::Weighted(
                WeightedBands::new(grid, table.sensitivity, table.mean_light).into(),
            ),
            Err(_) => self.response.bands.clone(),
        };
        Ok(BandChoice { bands, error, complete })
    }
}

/// Range in which the sensor sees and some light shines (nm).
fn lit_range(sensor: Option<[f64; 2]>, light: &Illumination) -> Result<[f64; 2], SensorError> {
    let Some(sensor) = sensor else {
        let why = "the sensor sees nothing at any wavelength";
        return Err(SensorError::missing("quantum_efficiency", why));
    };
    let all = light.spectra.iter().map(Curve::range);
    let lit = all.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or([0.0, f64::INFINITY]);
    let [from, to] = [sensor[0].max(lit[0]), sensor[1].min(lit[1])];
    if from >= to {
        let ([a, b], [from, to]) = (sensor, lit);
        let why = format!(
            "the sensor sees {a}..={b} nm, the lights shine at {from}..={to} nm: the image would be black"
        );
        let remedy = "give a light the illuminant `a`, `equal_energy` or {\"black_body\": kelvin}, which reach \
                      further, or the sensor a curve that reaches into the light";
        return Err(Refusal::new(why).hint(remedy).at("quantum_efficiency").into());
    }
    Ok([from, to])
}
