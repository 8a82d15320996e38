//! Pictures of a lens and of what it does, as SVG that follows the reader's light or dark theme.
//!
//! | module | idea |
//! |---|---|
//! | [`layout`] | the lens cut along y and z, with fans of rays |
//! | [`Section`] | the same cut as lines in millimetres, for those who draw themselves |
//! | [`spots`] | spot diagrams by field and wavelength |
//! | [`relative_illumination`] | relative illumination over the sensor |

mod layout;
mod relative_illumination;
mod section;
mod spots;

use super::LensReport;
use etendue_chart::short;

pub use layout::layout;
pub use relative_illumination::relative_illumination;
pub use section::{DrawnElement, Section};
pub use spots::spots;

/// Colours of fields and wavelengths before they begin again.
const COLOURS: usize = 5;

/// A lens' name for a title, with its focal length and f-number.
fn title(report: &LensReport) -> String {
    let mut words = vec![if report.name.is_empty() { "Lens" } else { &report.name }.to_owned()];
    if let Some(efl) = report.paraxial.efl {
        words.push(format!("f = {} mm", short(efl)));
    }
    if let Some(n) = report.paraxial.f_number {
        words.push(format!("f/{}", short((n * 100.0).round() / 100.0)));
    }
    words.join(" \u{b7} ")
}

#[cfg(test)]
mod tests;
