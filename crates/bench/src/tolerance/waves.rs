//! Effect of waves on a lens' picture beside rays: the modulation of a quarter of a cycle a pixel
//! at the middle, a side and a corner, at the nearest and the farthest depth there.

use etendue_camera::{Camera, WaveLens};
use etendue_optics::analysis::Transfer;
use etendue_optics::analysis::spread::WeightedFields;
use etendue_optics::analysis::transfer::geometric_modulation;
use etendue_spectrum::Bands;
use serde::Serialize;

use super::Place;

/// Cycles a pixel: half of what pixels tell apart.
const FREQUENCY: f64 = 0.25;

/// Modulation at a place, without that of the pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WaveFinding {
    /// The column and row of the place (pixels from the corner).
    pub at: [f64; 2],
    /// The depth (m); `null` for infinity.
    pub depth: Option<f64>,
    /// The wavelength (nm), of the middle band.
    pub wavelength: f64,
    /// By rays: of waves along y and along x on the sensor.
    pub rays: [f64; 2],
    /// By waves.
    pub waves: [f64; 2],
}

impl WaveFinding {
    /// The greatest difference of the two.
    #[must_use]
    pub fn difference(&self) -> f64 {
        let pairs = self.rays.iter().zip(&self.waves);
        pairs.map(|(rays, waves)| (rays - waves).abs()).fold(0.0, f64::max)
    }
}

/// Rays and waves at some of the places; and in sentences where there are none.
pub(super) fn findings(
    camera: &Camera,
    bands: &Bands,
    places: &[Place],
) -> (Vec<WaveFinding>, Vec<String>) {
    let Some(lens) = camera.lens() else { return (Vec::new(), Vec::new()) };
    let none = |why: String| (Vec::new(), vec![format!("nothing is told of waves: {why}")]);
    let waves = match WaveLens::new(lens, bands) {
        Ok(waves) => waves,
        Err(error) => return none(error.why),
    };
    let middle = waves.wavelengths().get(bands.count() / 2).and_then(|all| all.get(all.len() / 2));
    let Some(&wavelength) = middle else { return none("there are no bands".to_owned()) };
    let frequency = FREQUENCY / (1e-3 * lens.focused().pixel_pitch());
    let (mut found, mut notes) = (Vec::new(), Vec::new());
    for place in chosen(places, camera.resolution()) {
        let at = [place.column, place.row];
        let ends = match &place.depths[..] {
            [] => continue,
            [only] => vec![*only],
            [first, .., last] => vec![*first, *last],
        };
        for depth in ends {
            match waves.fields(at, &[1.0 / depth]) {
                Ok(fields) => {
                    let fields = WeightedFields::one(fields.at(wavelength, 1e-3 / depth));
                    found.push(WaveFinding {
                        at,
                        depth: Some(depth).filter(|depth| depth.is_finite()),
                        wavelength,
                        rays: geometric_modulation(&fields, frequency),
                        waves: Transfer::diffraction(&fields).modulation(frequency),
                    });
                }
                Err(error) => notes.push(format!(
                    "nothing is told of waves at ({:.0}, {:.0}), {depth:.3} m away: {error}",
                    at[0], at[1]
                )),
            }
        }
    }
    (found, notes)
}

/// The places nearest to the picture's middle, to the middle of its right side, and to a corner.
fn chosen(places: &[Place], resolution: [u32; 2]) -> Vec<&Place> {
    let [width, height] = resolution.map(f64::from);
    let nearest = |at: [f64; 2]| {
        let far = |place: &&Place| (place.column - at[0]).hypot(place.row - at[1]);
        let lit = places.iter().filter(|place| !place.depths.is_empty());
        lit.min_by(|a, b| far(a).total_cmp(&far(b)))
    };
    let mut found: Vec<&Place> = Vec::new();
    for at in [[0.5 * width, 0.5 * height], [width, 0.5 * height], [width, height]] {
        if let Some(place) = nearest(at)
            && !found.contains(&place)
        {
            found.push(place);
        }
    }
    found
}
