//! Pictures in bands of wavelengths: what a cube is, and the layout that spectral EXR files share.
//!
//! # Sources
//!
//! Fichet, Pacanowski and Wilkie, *An OpenEXR Layout for Spectral Images*, JCGT 10(3), 2021: channels
//! `S0.550,5nm` of emission (`S1` to `S3` beside them are of polarised light) and `T.550,5nm` of reflectance or
//! transmittance, numbers with a decimal comma; attributes `spectralLayoutVersion` and `emissiveUnits`.

use std::collections::BTreeMap;

use crate::band_axis::rounded;
use crate::{DecodeError, ExrChannels, Plane, room};

pub use crate::band_axis::{BandAxis, in_nanometres};

/// Speed of light in vacuum (m/s): some files name bands by frequencies.
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Quantity of a cube's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Light, or what the file does not say.
    Light,
    /// Shares of light that are reflected or transmitted.
    Reflectance,
}

/// A picture in bands of wavelengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Cube {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Axis of the bands.
    pub axis: BandAxis,
    /// `[row][column][band]`, row 0 at the top.
    pub values: Vec<f32>,
    /// Quantity of the numbers.
    pub quantity: Quantity,
    /// Their unit as the file has it.
    pub unit: Option<String>,
    /// Other entries of the file's header.
    pub texts: BTreeMap<String, String>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Content of a channel of a spectral EXR file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// Emission, by its Stokes component: 0 is the light itself.
    Stokes(u8),
    /// Reflectance or transmittance.
    Reflectance,
}

/// The component and the wavelength (nm) of a channel's full name by the layout: `S0.550,5nm`, `T.5,5e2nm`,
/// `S0.545,07THz`. `None` for channels of other kinds.
#[must_use]
pub fn spectral_channel(name: &str) -> Option<(Component, f64)> {
    let (layer, place) = name.split_once('.')?;
    let component = match layer {
        "S0" => Component::Stokes(0),
        "S1" => Component::Stokes(1),
        "S2" => Component::Stokes(2),
        "S3" => Component::Stokes(3),
        "T" => Component::Reflectance,
        _ => return None,
    };
    let (rest, is_frequency) = match place.strip_suffix("Hz") {
        Some(rest) => (rest, true),
        None => (place.strip_suffix('m')?, false),
    };
    const PREFIXES: [(&str, f64); 13] = [
        ("n", 1e-9),
        ("u", 1e-6),
        ("m", 1e-3),
        ("c", 1e-2),
        ("d", 1e-1),
        ("p", 1e-12),
        ("h", 1e2),
        ("k", 1e3),
        ("M", 1e6),
        ("G", 1e9),
        ("T", 1e12),
        ("P", 1e15),
        ("", 1.0),
    ];
    let found = PREFIXES.iter().find_map(|(prefix, factor)| {
        let number = rest.strip_suffix(prefix)?;
        let plain = |c: char| c.is_ascii_digit() || ",.eE+-".contains(c);
        let number: f64 =
            number.chars().all(plain).then(|| number.replace(',', ".").parse().ok())??;
        // Nanometres stay the number that is written.
        Some(match (is_frequency, *prefix) {
            (true, _) => rounded(1e9 * SPEED_OF_LIGHT / (number * factor)),
            (false, "n") => number,
            (false, _) => rounded(number * factor * 1e9),
        })
    });
    found.filter(|nm| nm.is_finite() && *nm > 0.0).map(|nm| (component, nm))
}

/// The name of the channel of emission around `nm` by the layout: `S0.550,5nm`.
#[must_use]
pub fn emission_channel(nm: f64) -> String {
    let text = format!("{}", rounded(nm));
    let text = if text.contains('.') { text.replace('.', ",") } else { text + ",0" };
    format!("S0.{text}nm")
}

/// True if an EXR file has spectral channels.
#[must_use]
pub fn is_spectral(channels: &ExrChannels) -> bool {
    channels.planes.iter().any(|(name, _)| {
        matches!(spectral_channel(name), Some((Component::Stokes(0) | Component::Reflectance, _)))
    })
}

impl Cube {
    /// The spectral channels of an EXR file: its light, or else what it reflects. `None` where it has none.
    ///
    /// # Errors
    ///
    /// When two are of one wavelength, or there is no memory for them.
    pub fn from_exr(channels: ExrChannels) -> Result<Option<Self>, DecodeError> {
        Self::of_channels(channels, |_| true)
    }

    /// Reads what an EXR file reflects or lets pass, whatever light it has beside it. `None` where
    /// it has no such channels.
    ///
    /// # Errors
    ///
    /// As [`Self::from_exr`].
    pub fn reflectance_from_exr(channels: ExrChannels) -> Result<Option<Self>, DecodeError> {
        Self::of_channels(channels, |component| component == Component::Reflectance)
    }

    fn of_channels(
        channels: ExrChannels,
        is_wanted: impl Fn(Component) -> bool,
    ) -> Result<Option<Self>, DecodeError> {
        let mut light: Vec<(f64, Plane)> = Vec::new();
        let mut reflectance = Vec::new();
        let mut polarised = false;
        for (name, plane) in channels.planes {
            match spectral_channel(&name).filter(|(component, _)| is_wanted(*component)) {
                Some((Component::Stokes(0), nm)) => light.push((nm, plane)),
                Some((Component::Reflectance, nm)) => reflectance.push((nm, plane)),
                Some((Component::Stokes(_), _)) => polarised = true,
                None => {}
            }
        }
        let (mut bands, quantity) = match (light.is_empty(), reflectance.is_empty()) {
            (false, _) => (light, Quantity::Light),
            (true, false) => (reflectance, Quantity::Reflectance),
            (true, true) => return Ok(None),
        };
        // An EXR file has its channels in the order of their names.
        bands.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (middles, planes): (Vec<f64>, Vec<Plane>) = bands.into_iter().unzip();
        let own = channels.texts.get(OWN_BANDS).and_then(|text| own_edges(text));
        let own = own.filter(|edges| edges.len() == middles.len() + 1);
        let axis = match own {
            Some(edges) => BandAxis::between(edges),
            None => BandAxis::new(middles, None),
        };
        let axis = axis.map_err(DecodeError::Refused)?;
        let [columns, rows] = channels.size;
        let mut values = room::<f32>(columns * rows * planes.len())?;
        for i in 0..columns * rows {
            values.extend(planes.iter().map(|plane| plane.at(i)));
        }
        let mut notes = Vec::new();
        if polarised {
            notes.push(
                "its light is polarised, of which sensors see nothing: S0 alone is read".to_owned(),
            );
        }
        let unit = channels.texts.get("emissiveUnits").cloned();
        let unit = unit.filter(|_| quantity == Quantity::Light);
        Ok(Some(Self {
            size: channels.size,
            axis,
            values,
            quantity,
            unit,
            texts: channels.texts,
            notes,
        }))
    }
}

/// The attribute in which this program's own files say what their bands are, as JSON.
const OWN_BANDS: &str = "etendue:Spectrum";

/// The edges of bands (nm) in the meaning of a layer of bands, which is JSON: the entry `band edges nm`,
/// `[400.0, 410.0]`.
#[must_use]
pub fn own_edges(meaning: &str) -> Option<Vec<f64>> {
    let (_, rest) = meaning.split_once("\"band edges nm\"")?;
    let (_, list) = rest.split_once('[')?;
    let (list, _) = list.split_once(']')?;
    let edges: Option<Vec<f64>> = list.split(',').map(|edge| edge.trim().parse().ok()).collect();
    edges.filter(|edges| edges.len() > 1)
}

impl Plane {
    #[expect(clippy::cast_precision_loss, reason = "light is no number of things")]
    fn at(&self, i: usize) -> f32 {
        match self {
            Self::F32(values) => values[i],
            Self::U32(values) => values[i] as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_named_as_in_the_paper() {
        for (name, found) in [
            ("S0.550,5nm", Some((Component::Stokes(0), 550.5))),
            ("S0.400,000000nm", Some((Component::Stokes(0), 400.0))),
            ("S3.5,5e2nm", Some((Component::Stokes(3), 550.0))),
            ("T.0,55um", Some((Component::Reflectance, 550.0))),
            ("S0.4e-7m", Some((Component::Stokes(0), 400.0))),
            // c / 545.077196 THz = 550 nm.
            ("S0.545,077196363THz", Some((Component::Stokes(0), 550.0))),
            ("T.380,0nm.400,0nm", None),
            ("S4.400nm", None),
            ("S0.nm", None),
            ("S0.-400nm", None),
            ("Depth.Z", None),
            ("R", None),
        ] {
            assert_eq!(spectral_channel(name), found, "{name}");
        }
        for nm in [400.0, 552.5, 1050.0, 487.123_456] {
            assert_eq!(spectral_channel(&emission_channel(nm)), Some((Component::Stokes(0), nm)));
        }
        assert_eq!(emission_channel(552.5), "S0.552,5nm");
    }

    fn channels(names: &[&str]) -> ExrChannels {
        let plane = |k: usize| Plane::F32(vec![k as f32, 10.0 + k as f32]);
        let planes = names.iter().enumerate().map(|(k, name)| ((*name).to_owned(), plane(k)));
        let texts = [("emissiveUnits".to_owned(), "W.m^-2.sr^-1".to_owned())].into();
        ExrChannels { size: [2, 1], planes: planes.collect(), texts }
    }

    #[test]
    fn light_comes_before_reflectance_in_the_order_of_wavelengths() {
        let light = ["B", "S0.1100,0nm", "S0.400,0nm", "S1.400,0nm", "T.400,0nm"];
        let cube = Cube::from_exr(channels(&light)).unwrap().unwrap();
        assert_eq!((cube.quantity, cube.unit.as_deref()), (Quantity::Light, Some("W.m^-2.sr^-1")));
        assert_eq!(cube.axis.wavelengths(), [400.0, 1100.0]);
        assert_eq!(cube.values, [2.0, 1.0, 12.0, 11.0]);
        assert!(cube.notes[0].contains("polarised"), "{:?}", cube.notes);
        let share = Cube::from_exr(channels(&["T.500,0nm", "T.400,0nm"])).unwrap().unwrap();
        assert_eq!((share.quantity, share.unit), (Quantity::Reflectance, None));
        assert_eq!(share.values, [1.0, 0.0, 11.0, 10.0]);
        let both = || channels(&["S0.400,0nm", "S0.500,0nm", "T.450,0nm", "T.550,0nm"]);
        assert_eq!(Cube::from_exr(both()).unwrap().unwrap().axis.wavelengths(), [400.0, 500.0]);
        let share = Cube::reflectance_from_exr(both()).unwrap().unwrap();
        assert_eq!((share.axis.wavelengths(), share.values[0]), (&[450.0, 550.0][..], 2.0));
        let alone = channels(&["S0.400,0nm", "S0.500,0nm"]);
        assert!(Cube::reflectance_from_exr(alone).unwrap().is_none());
        assert!(Cube::from_exr(channels(&["R", "G", "B"])).unwrap().is_none());
        let twice = Cube::from_exr(channels(&["S0.0,4um", "S0.400,0nm"])).unwrap_err().to_string();
        assert!(twice.contains("two bands at 400 nm"), "{twice}");
        // What this program itself says of its bands counts, and not their names' middles.
        let mut own = channels(&["S0.425,0nm", "S0.500,0nm"]);
        let meaning = r#"{"definition":"light","band edges nm":"[400.0, 450.0, 550.0]"}"#;
        own.texts.insert(OWN_BANDS.to_owned(), meaning.to_owned());
        assert_eq!(Cube::from_exr(own).unwrap().unwrap().axis.edges(), [400.0, 450.0, 550.0]);
    }
}
