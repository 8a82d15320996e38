//! From the spectral lanes of a render to mean photo-electrons: which filter a pixel has, and what
//! a lane is worth behind it.
//!
//! # The two modes
//!
//! *Physical*: a lane holds spectral irradiance E (W·m⁻²·nm⁻¹), and a pixel of area A exposed for T
//! gets μₑ = T·A·Σ E·∫ shape(λ)·η(λ)·λ/(hc) dλ electrons, η being quantum efficiency times filter.
//!
//! *Digital*: a lane holds an intensity whose 1 is full scale. The same integral is divided by that
//! of a sensor which catches every photon of the channel, and by the most sensitive channel's value:
//! so 1 in all lanes is 1 in that channel and less in others, as with white light on a real sensor.
//! The grey value g = intensity·(2ᵇ − 1 − black) fixes μₑ = g/K, whatever the exposure time.

use etendue_spectrum::{Curve, Grid, Lanes, PLANCK, SPEED_OF_LIGHT, VISIBLE, integral, rgb};

use crate::philox::MOST_CHANNELS;
use crate::preset::nikon_d5100;
use crate::settings::Settings;
use crate::spec::{FilterSet, Filters, Radiometry, SensorKind, SensorSpec};
use crate::{CfaSpec, SensorError};

/// The width of bands (nm) when nobody asks for any and curves have to be integrated. A test shows
/// what it costs.
pub(crate) const BAND_WIDTH: f64 = 10.0;

/// One kind of photosite.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Channel {
    /// A filter's letter, or a band's wavelength.
    pub(crate) name: String,
    /// Mean photo-electrons a unit of each lane makes: a second in physical mode, in digital mode
    /// all that there are.
    pub(crate) electrons: Vec<f64>,
}

/// What the sensor makes of light.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Response {
    pub(crate) lanes: Lanes,
    pub(crate) channels: Vec<Channel>,
    /// For a sensor of one channel a pixel: which, by the pattern's rows and columns.
    pub(crate) pattern: Option<Vec<Vec<usize>>>,
}

/// What stands between the light and the silicon.
#[derive(Debug, Clone, PartialEq)]
enum Filter {
    Clear,
    /// One of the render's own colours.
    Primary(usize),
    Curve(Curve),
    /// One band, and nothing else.
    Band(usize),
}

impl Response {
    /// For the fewest lanes that the sensor can tell apart, or for given ones.
    pub(crate) fn new(
        spec: &SensorSpec,
        settings: &Settings,
        given: Option<Lanes>,
    ) -> Result<Self, SensorError> {
        let (names, filters, pattern) = match spec.kind {
            SensorKind::Raw => raw(spec)?,
            SensorKind::Rgb => {
                let named = |letter| filter(letter, spec.filters.as_ref());
                let filters = ['r', 'g', 'b'].map(named).into_iter().collect::<Result<_, _>>()?;
                (["R", "G", "B"].map(String::from).into(), filters, None)
            }
            SensorKind::Multispectral => multispectral(spec)?,
        };
        let lanes = match given {
            Some(lanes) => lanes,
            None => fewest_lanes(spec, settings, &filters)?,
        };
        if filters.iter().any(|f| matches!(f, Filter::Band(_)))
            && spec.bands.as_ref() != lanes.grid()
        {
            let why = "the bands of a multispectral sensor are the lanes of its render";
            return Err(SensorError::Misplaced { key: "bands", why });
        }
        let names = match (spec.kind, &spec.channels) {
            (SensorKind::Multispectral, None) => lanes.names(),
            _ => names,
        };
        // Ideal primaries are compared with an ideal primary, unless other filters show that a
        // primary is less than all light.
        let own = |filter: &Filter| matches!(filter, Filter::Band(_) | Filter::Primary(_));
        let alone = filters.iter().all(own);
        let holder = match spec.kind {
            SensorKind::Multispectral => "channels",
            _ => "filters",
        };
        let mut channels = Vec::with_capacity(filters.len());
        for (name, filter) in names.into_iter().zip(&filters) {
            let ideal = if alone { filter } else { &Filter::Clear };
            channels.push(channel(name, holder, [filter, ideal], &lanes, settings)?);
        }
        if settings.radiometry == Radiometry::Digital {
            to_full_scale(&mut channels, settings);
        }
        Ok(Self { lanes, channels, pattern })
    }

    /// The channels at each pixel of an image: one behind filters, else all.
    pub(crate) fn depth(&self) -> usize {
        if self.pattern.is_some() { 1 } else { self.channels.len() }
    }
}

type Filtered = (Vec<String>, Vec<Filter>, Option<Vec<Vec<usize>>>);

fn raw(spec: &SensorSpec) -> Result<Filtered, SensorError> {
    let Some(cfa) = &spec.cfa else {
        return Ok((vec!["Y".into()], vec![Filter::Clear], Some(vec![vec![0]])));
    };
    let letters = cfa.letters();
    let filters = letters
        .iter()
        .map(|&letter| filter(letter, spec.filters.as_ref()))
        .collect::<Result<_, _>>()?;
    let names = letters.iter().map(|letter| letter.to_uppercase().collect()).collect();
    Ok((names, filters, Some(numbered(cfa, &letters))))
}

/// The pattern with each letter replaced by its number.
fn numbered(cfa: &CfaSpec, letters: &[char]) -> Vec<Vec<usize>> {
    let [rows, columns] = cfa.period();
    let number = |row, column| {
        let letter = cfa.at(row, column);
        letters.iter().position(|&other| other == letter).unwrap_or(0)
    };
    (0..rows).map(|row| (0..columns).map(|column| number(row, column)).collect()).collect()
}

fn multispectral(spec: &SensorSpec) -> Result<Filtered, SensorError> {
    if let Some(channels) = &spec.channels {
        if channels.is_empty() {
            let why = "name one channel at least";
            return Err(SensorError::Missing { key: "channels", why });
        }
        let demand = "4096 channels at most";
        let count = channels.len();
        SensorError::unless(count <= MOST_CHANNELS, "channels", count as f64, demand)?;
        let mut filters = Vec::new();
        for (index, channel) in channels.iter().enumerate() {
            let name = channel.name.as_str();
            let fit = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if name.is_empty() || name.len() > 48 || !name.chars().all(fit) {
                let why = "must be 1 to 48 letters, digits, underscores or hyphens";
                return Err(SensorError::Channel { index, why });
            }
            if channels[..index].iter().any(|other| other.name == name) {
                let why = "is taken by one before it";
                return Err(SensorError::Channel { index, why });
            }
            let key = || format!("channels.{}", channel.name);
            filters.push(Filter::Curve(transmission(&channel.curve, key)?));
        }
        return Ok((channels.iter().map(|channel| channel.name.clone()).collect(), filters, None));
    }
    let Some(bands) = &spec.bands else {
        let why = "a multispectral sensor needs the edges of its bands (nm), or `channels`";
        return Err(SensorError::Missing { key: "bands", why });
    };
    Ok((vec![String::new(); bands.len()], (0..bands.len()).map(Filter::Band).collect(), None))
}

/// The filter of a letter: the user's curve, one of a named set, or an ideal one.
fn filter(letter: char, filters: Option<&Filters>) -> Result<Filter, SensorError> {
    let primary = ['r', 'g', 'b'].iter().position(|&other| other == letter.to_ascii_lowercase());
    if let Some(Filters::Curves(curves)) = filters
        && let Some(curve) = curves.get(&letter)
    {
        return Ok(Filter::Curve(transmission(curve, || format!("filters.{letter}"))?));
    }
    match (primary, filters) {
        (Some(k), Some(Filters::Set(FilterSet::NikonD5100))) => Ok(nikon_d5100()
            .get(k)
            .map_or(Filter::Primary(k), |curve| Filter::Curve(curve.clone()))),
        (Some(k), _) => Ok(Filter::Primary(k)),
        (None, _) if letter.eq_ignore_ascii_case(&'w') => Ok(Filter::Clear),
        (None, _) => Err(SensorError::UnknownFilter { letter }),
    }
}

fn transmission(curve: &Curve, key: impl Fn() -> String) -> Result<Curve, SensorError> {
    curve.clone().within(0.0, 1.0).map_err(|fault| SensorError::Curve { key: key(), fault })
}

/// The fewest lanes that the sensor can tell apart.
fn fewest_lanes(
    spec: &SensorSpec,
    settings: &Settings,
    filters: &[Filter],
) -> Result<Lanes, SensorError> {
    if let Some(bands) = &spec.bands {
        return Ok(Lanes::Bands(bands.clone()));
    }
    let ideal = |f: &Filter| matches!(f, Filter::Clear | Filter::Primary(_));
    if settings.efficiency.as_flat().is_some() && filters.iter().all(ideal) {
        let coloured = filters.iter().any(|filter| *filter != Filter::Clear);
        return Ok(if coloured { Lanes::Rgb } else { Lanes::Grey });
    }
    // Where the silicon is sensitive, within visible light: render's colours are known there only.
    let [from, to] = settings.efficiency.range();
    let [from, to] = [from.max(VISIBLE[0]), to.min(VISIBLE[1])];
    let blind =
        || SensorError::Blind { key: "quantum_efficiency", channel: "all".into(), lanes: VISIBLE };
    if from >= to {
        return Err(blind());
    }
    Grid::of_width(from, to, BAND_WIDTH).map(Lanes::Bands).map_err(|_| blind())
}

/// A channel's electrons: a second for physical light, else as a part of what the ideal one catches.
/// `holder` is the key that holds the curves of filters.
fn channel(
    name: String,
    holder: &'static str,
    [filter, ideal]: [&Filter; 2],
    lanes: &Lanes,
    settings: &Settings,
) -> Result<Channel, SensorError> {
    let count = lanes.count();
    let caught = |i: usize| photons_caught(lanes, i, filter, &settings.efficiency);
    let mut electrons: Vec<f64> = (0..count).map(caught).collect();
    if electrons.iter().all(|&value| value <= 0.0) {
        let key = match filter {
            Filter::Curve(_) => holder,
            _ => "quantum_efficiency",
        };
        return Err(SensorError::Blind { key, channel: name, lanes: lanes.range() });
    }
    let factor = match settings.radiometry {
        Radiometry::Physical => {
            let side = settings.pixel_pitch * 1e-6;
            side * side * 1e-9 / (PLANCK * SPEED_OF_LIGHT)
        }
        Radiometry::Digital => {
            1.0 / (0..count).map(|i| photons_caught(lanes, i, ideal, &Curve::ONE)).sum::<f64>()
        }
    };
    for value in &mut electrons {
        *value *= factor;
    }
    Ok(Channel { name, electrons })
}

/// ∫ shape·η·filter·λ dλ (nm²): proportional to the photons of lane `i` that free an electron.
fn photons_caught(lanes: &Lanes, i: usize, filter: &Filter, efficiency: &Curve) -> f64 {
    let shape = lanes.shape(i);
    let [from, to] = shape.range();
    let ramp = [[from, from], [to, to]];
    let Ok(ramp) = Curve::sampled(ramp.to_vec()) else { return 0.0 };
    match filter {
        Filter::Clear => integral(&[&shape, efficiency, &ramp], from, to),
        Filter::Curve(curve) => integral(&[&shape, efficiency, curve, &ramp], from, to),
        Filter::Band(band) if *band != i => 0.0,
        Filter::Band(_) => integral(&[&shape, efficiency, &ramp], from, to),
        Filter::Primary(k) if *lanes == Lanes::Rgb && *k != i => 0.0,
        Filter::Primary(_) if *lanes == Lanes::Rgb => {
            integral(&[&shape, efficiency, &ramp], from, to)
        }
        Filter::Primary(k) => integral(&[&shape, efficiency, &rgb::PRIMARIES[*k], &ramp], from, to),
    }
}

/// Digital mode: the most sensitive channel's value for 1 in all lanes becomes full scale, in
/// electrons.
fn to_full_scale(channels: &mut [Channel], settings: &Settings) {
    let white = |channel: &Channel| channel.electrons.iter().sum::<f64>();
    let most = channels.iter().map(white).fold(0.0, f64::max);
    let full_scale = (settings.white() - settings.black) / settings.gain;
    for value in channels.iter_mut().flat_map(|channel| &mut channel.electrons) {
        *value *= full_scale / most;
    }
}
