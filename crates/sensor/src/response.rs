//! From the spectral bands of a render to mean photo-electrons: which filter a pixel has, and what
//! a band is worth behind it.
//!
//! # The two modes
//!
//! *Physical*: a band holds spectral irradiance E (W·m⁻²·nm⁻¹), and a pixel of area A exposed for T
//! gets μₑ = T·A·Σ E·∫ shape(λ)·η(λ)·λ/(hc) dλ electrons, η being quantum efficiency times filter.
//!
//! *Digital*: a band holds an intensity whose 1 is full scale. The same integral is divided by that
//! of a sensor which catches every photon of the channel, and by the most sensitive channel's value:
//! so 1 in all bands is 1 in that channel and less in others, as with white light on a real sensor.
//! The grey value g = intensity·(2ᵇ − 1 − black) fixes μₑ = g/K, whatever the exposure time.

use etendue_report::Refusal;
use etendue_spectrum::{Band, Bands, Curve, Grid, PLANCK, SPEED_OF_LIGHT, VISIBLE, integral, rgb};

use crate::philox::MOST_CHANNELS;
use crate::preset::nikon_d5100;
use crate::settings::SensorSettings;
use crate::spec::{Channels, FilterSet, Filters, Radiometry, SensorKind, SensorSpec};
use crate::{CfaSpec, SensorError};

/// The width of bands (nm) when nobody asks for any, curves have to be integrated and nothing is known
/// of the light. A test shows what it costs. Not a setting: `bands` of the sensor says otherwise, and of known light
/// `band_error`.
pub(crate) const BAND_WIDTH: f64 = 10.0;

/// One kind of photosite.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PhotositeKind {
    /// A filter's letter, or a band's wavelength.
    pub(crate) name: String,
    /// Mean photo-electrons a unit of each band makes: a second in physical mode, in digital mode
    /// all that there are.
    pub(crate) electrons: Vec<f64>,
    /// Electrons, likewise, of light that is red, green or blue, as the render's colours are, in no bands.
    pub(crate) primaries: [f64; 3],
}

/// Response of the sensor to light.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Response {
    pub(crate) bands: Bands,
    pub(crate) channels: Vec<PhotositeKind>,
    /// For a sensor of one channel a pixel: which, by the pattern's rows and columns.
    pub(crate) pattern: Option<Vec<Vec<usize>>>,
}

/// Filter between the light and the silicon.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ColourFilter {
    Clear,
    /// One of the render's own colours.
    Primary(usize),
    Curve(Curve),
    /// One band, and nothing else.
    Band(Band),
}

impl ColourFilter {
    /// The curve, if it is one.
    pub(crate) fn curve(&self) -> Option<&Curve> {
        match self {
            Self::Primary(k) => Some(&rgb::PRIMARIES[*k]),
            Self::Curve(curve) => Some(curve),
            Self::Clear | Self::Band(_) => None,
        }
    }

    /// The share that passes at a wavelength (nm).
    pub(crate) fn passes(&self, nm: f64) -> f64 {
        match self {
            Self::Clear => 1.0,
            Self::Primary(k) => rgb::PRIMARIES[*k].at(nm).unwrap_or(0.0),
            Self::Curve(curve) => curve.at(nm).unwrap_or(0.0),
            Self::Band(band) => f64::from(u8::from((band.from..band.to).contains(&nm))),
        }
    }

    /// The wavelengths that pass (nm); `None` for all of them.
    fn range(&self) -> Option<[f64; 2]> {
        match self {
            Self::Clear => None,
            Self::Primary(_) => Some(VISIBLE),
            Self::Curve(curve) if curve.as_flat().is_some() => None,
            Self::Curve(curve) => Some(extent(curve)),
            Self::Band(band) => Some([band.from, band.to]),
        }
    }
}

/// Range in which a curve is not 0 (nm); its whole range when it is 0 everywhere.
fn extent(curve: &Curve) -> [f64; 2] {
    let samples = curve.samples();
    let first = samples.iter().position(|sample| sample[1] > 0.0);
    let last = samples.iter().rposition(|sample| sample[1] > 0.0);
    match (first, last) {
        (Some(first), Some(last)) => {
            let last = (last + 1).min(samples.len() - 1);
            [samples[first.saturating_sub(1)][0], samples[last][0]]
        }
        _ => curve.range(),
    }
}

/// The wavelengths at which a sensor of this quantum efficiency behind these filters sees something
/// (nm). A number for the quantum efficiency is a statement about visible light, and about what
/// filters pass that have curves of their own.
pub(crate) fn sensitive_range(efficiency: &Curve, filters: &[ColourFilter]) -> Option<[f64; 2]> {
    let silicon = match efficiency.as_flat() {
        Some(_) => None,
        None => Some(extent(efficiency)),
    };
    let seen = filters.iter().filter_map(|filter| match (silicon, filter.range()) {
        (None, None) => Some(VISIBLE),
        (Some(range), None) | (None, Some(range)) => Some(range),
        (Some(a), Some(b)) => {
            let [from, to] = [a[0].max(b[0]), a[1].min(b[1])];
            (from < to).then_some([from, to])
        }
    });
    seen.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

impl Response {
    /// For the fewest bands that the sensor can tell apart, or for given ones.
    pub(crate) fn new(
        spec: &SensorSpec,
        settings: &SensorSettings,
        given: Option<Bands>,
    ) -> Result<Self, SensorError> {
        let FilterLayout { names, filters, pattern } = filters(spec)?;
        let bands = match given {
            Some(bands) => bands,
            None => fewest_bands(spec, settings, &filters)?,
        };
        if filters.iter().any(|f| matches!(f, ColourFilter::Band(_)))
            && !spec.bands.as_ref().is_some_and(|grid| divides(&bands, grid))
        {
            let why = "the bands of a multispectral sensor are the bands of its render";
            return Err(SensorError::misplaced("bands", why));
        }
        // Ideal primaries are compared with an ideal primary, unless other filters show that a
        // primary is less than all light.
        let own = |filter: &ColourFilter| {
            matches!(filter, ColourFilter::Band(_) | ColourFilter::Primary(_))
        };
        let alone = filters.iter().all(own);
        let holder = match spec.kind {
            SensorKind::Multispectral => "channels",
            SensorKind::Raw | SensorKind::Rgb => "filters",
        };
        let mut channels = Vec::with_capacity(filters.len());
        for (name, filter) in names.into_iter().zip(&filters) {
            let ideal = if alone { filter } else { &ColourFilter::Clear };
            channels.push(channel(name, holder, [filter, ideal], &bands, settings)?);
        }
        if settings.radiometry == Radiometry::Digital {
            to_full_scale(&mut channels, settings);
        }
        Ok(Self { bands, channels, pattern })
    }

    /// The channels at each pixel of an image: one behind filters, else all.
    pub(crate) fn depth(&self) -> usize {
        if self.pattern.is_some() { 1 } else { self.channels.len() }
    }
}

/// True if no band of the render lies across an edge of the sensor's own, which are divided without a gap.
fn divides(bands: &Bands, edges: &Grid) -> bool {
    let Some(grid) = bands.grid() else { return false };
    let near = |edge: &f64| grid.edges().iter().any(|own| (own - edge).abs() <= 1e-9 * edge);
    edges.edges().iter().all(near)
}

/// The kinds of photosites, what stands before each, and which pixel has which.
pub(crate) struct FilterLayout {
    names: Vec<String>,
    pub(crate) filters: Vec<ColourFilter>,
    pattern: Option<Vec<Vec<usize>>>,
}

/// The filters of a sensor.
pub(crate) fn filters(spec: &SensorSpec) -> Result<FilterLayout, SensorError> {
    match spec.kind {
        SensorKind::Raw => raw(spec),
        SensorKind::Rgb => {
            let named = |letter| filter(letter, spec.filters.as_ref());
            let filters = ['r', 'g', 'b'].map(named).into_iter().collect::<Result<_, _>>()?;
            let names = ["R", "G", "B"].map(String::from).into();
            Ok(FilterLayout { names, filters, pattern: None })
        }
        SensorKind::Multispectral => multispectral(spec),
    }
}

fn raw(spec: &SensorSpec) -> Result<FilterLayout, SensorError> {
    let Some(cfa) = &spec.cfa else {
        let pattern = Some(vec![vec![0]]);
        return Ok(FilterLayout {
            names: vec!["Y".into()],
            filters: vec![ColourFilter::Clear],
            pattern,
        });
    };
    let letters = cfa.letters();
    let filters = letters
        .iter()
        .map(|&letter| filter(letter, spec.filters.as_ref()))
        .collect::<Result<_, _>>()?;
    let names = letters.iter().map(|letter| letter.to_uppercase().collect()).collect();
    Ok(FilterLayout { names, filters, pattern: Some(numbered(cfa, &letters)) })
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

fn multispectral(spec: &SensorSpec) -> Result<FilterLayout, SensorError> {
    // Channels with curves of their own.
    if let Some(channels) = spec.channels.as_ref().map(Channels::curves) {
        if channels.is_empty() {
            let why = "name one channel at least";
            return Err(SensorError::missing("channels", why));
        }
        let demand = "4096 channels at most";
        let count = channels.len();
        SensorError::unless(count <= MOST_CHANNELS, "channels", count as f64, demand)?;
        let mut filters = Vec::new();
        for (index, channel) in channels.iter().enumerate() {
            let name = channel.name.as_str();
            let fit = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if name.is_empty() || name.len() > 48 || !name.chars().all(fit) {
                return Err(misnamed(
                    index,
                    "must be 1 to 48 letters, digits, underscores or hyphens",
                ));
            }
            if channels[..index].iter().any(|other| other.name == name) {
                return Err(misnamed(index, "is taken by one before it"));
            }
            let key = || format!("channels.{}", channel.name);
            filters.push(ColourFilter::Curve(transmission(&channel.curve, key)?));
        }
        let names = channels.iter().map(|channel| channel.name.clone()).collect();
        return Ok(FilterLayout { names, filters, pattern: None });
    }
    // Or one channel a band.
    let Some(grid) = &spec.bands else {
        let why = "a multispectral sensor needs the edges of its bands (nm), or `channels`";
        return Err(SensorError::missing("bands", why));
    };
    let filters = grid.bands().map(ColourFilter::Band).collect();
    Ok(FilterLayout { names: Bands::Spectral(grid.clone()).names(), filters, pattern: None })
}

/// Error of the name of a channel.
fn misnamed(index: usize, why: &str) -> SensorError {
    Refusal::new(format!("the name of channel {index} {why}")).at("channels").into()
}

/// The filter of a letter: the user's curve, one of a named set, or an ideal one.
fn filter(letter: char, filters: Option<&Filters>) -> Result<ColourFilter, SensorError> {
    let primary = ['r', 'g', 'b'].iter().position(|&other| other == letter.to_ascii_lowercase());
    if let Some(Filters::Curves(curves)) = filters
        && let Some(curve) = curves.get(&letter)
    {
        return Ok(ColourFilter::Curve(transmission(curve, || format!("filters.{letter}"))?));
    }
    match (primary, filters) {
        (Some(k), Some(Filters::Set(FilterSet::NikonD5100))) => Ok(nikon_d5100()
            .get(k)
            .map_or(ColourFilter::Primary(k), |curve| ColourFilter::Curve(curve.clone()))),
        (Some(k), _) => Ok(ColourFilter::Primary(k)),
        (None, _) if letter.eq_ignore_ascii_case(&'w') => Ok(ColourFilter::Clear),
        (None, _) => {
            let why = format!(
                "names the filter `{letter}`, for which there is no curve: add it to `filters`, or \
                 use r, g, b or w"
            );
            Err(Refusal::new(why).at("cfa").into())
        }
    }
}

fn transmission(curve: &Curve, key: impl Fn() -> String) -> Result<Curve, SensorError> {
    curve.clone().within(0.0, 1.0).map_err(|fault| SensorError::curve(&key(), &fault))
}

/// The fewest bands that the sensor can tell apart.
fn fewest_bands(
    spec: &SensorSpec,
    settings: &SensorSettings,
    filters: &[ColourFilter],
) -> Result<Bands, SensorError> {
    if let Some(grid) = &spec.bands {
        return Ok(Bands::Spectral(grid.clone()));
    }
    let ideal = |f: &ColourFilter| matches!(f, ColourFilter::Clear | ColourFilter::Primary(_));
    if settings.efficiency.as_flat().is_some() && filters.iter().all(ideal) {
        let coloured = filters.iter().any(|filter| *filter != ColourFilter::Clear);
        return Ok(if coloured { Bands::Rgb } else { Bands::Grey });
    }
    let blind = || SensorError::blind("quantum_efficiency", "all", settings.efficiency.range());
    let [from, to] = sensitive_range(&settings.efficiency, filters).ok_or_else(blind)?;
    // A curve may be given for more wavelengths than anybody renders.
    let width = BAND_WIDTH.max((to - from) / 1000.0);
    Grid::of_width(from, to, width).map(Bands::Spectral).map_err(|_| blind())
}

/// A channel's electrons: a second for physical light, else as a part of what the ideal one catches.
/// `holder` is the key that holds the curves of filters.
fn channel(
    name: String,
    holder: &'static str,
    [filter, ideal]: [&ColourFilter; 2],
    bands: &Bands,
    settings: &SensorSettings,
) -> Result<PhotositeKind, SensorError> {
    let count = bands.count();
    let caught = |i: usize| photons_caught(bands, i, filter, &settings.efficiency);
    let mut electrons: Vec<f64> = (0..count).map(caught).collect();
    if electrons.iter().all(|&value| value <= 0.0) {
        let key = match filter {
            ColourFilter::Curve(_) => holder,
            ColourFilter::Clear | ColourFilter::Primary(_) | ColourFilter::Band(_) => {
                "quantum_efficiency"
            }
        };
        return Err(SensorError::blind(key, &name, bands.range()));
    }
    // Weighted bands stand for pieces of the light, not of white: colours are weighed without them.
    let mut primaries = match bands {
        Bands::Weighted(_) => of_primaries(filter, &settings.efficiency, bands.range()),
        Bands::Grey | Bands::Rgb | Bands::Spectral(_) => in_bands(bands, &electrons),
    };
    let factor = match (settings.radiometry, bands) {
        (Radiometry::Physical, _) => {
            let side = settings.pixel_pitch * 1e-6;
            side * side * 1e-9 / (PLANCK * SPEED_OF_LIGHT)
        }
        (Radiometry::Digital, Bands::Weighted(_)) => {
            1.0 / of_primaries(ideal, &Curve::ONE, bands.range()).iter().sum::<f64>()
        }
        (Radiometry::Digital, _) => {
            1.0 / (0..count).map(|i| photons_caught(bands, i, ideal, &Curve::ONE)).sum::<f64>()
        }
    };
    for value in electrons.iter_mut().chain(&mut primaries) {
        *value *= factor;
    }
    Ok(PhotositeKind { name, electrons, primaries })
}

/// Electrons that red, green and blue make, from those that bands make.
fn in_bands(bands: &Bands, electrons: &[f64]) -> [f64; 3] {
    let rows = bands.from_rgb();
    std::array::from_fn(|k| rows.iter().zip(electrons).map(|(row, e)| row[k] * e).sum())
}

/// The same from the curves, over a range of wavelengths (nm), beyond which there is no light.
fn of_primaries(filter: &ColourFilter, efficiency: &Curve, [from, to]: [f64; 2]) -> [f64; 3] {
    let nm = Curve::sampled(vec![[from, from], [to, to]]).unwrap_or(Curve::ONE);
    std::array::from_fn(|k| {
        let held = rgb::PRIMARIES[k].held_over(from, to);
        let curves = [&held, efficiency, &nm];
        match filter {
            ColourFilter::Clear => integral(&curves, from, to),
            ColourFilter::Primary(_) | ColourFilter::Curve(_) => {
                let own = filter.curve().unwrap_or(&Curve::ONE);
                integral(&[&held, efficiency, &nm, own], from, to)
            }
            ColourFilter::Band(band) => integral(&curves, band.from.max(from), band.to.min(to)),
        }
    })
}

/// ∫ shape·η·filter·λ dλ (nm²): proportional to the photons of band `i` that free an electron.
pub(crate) fn photons_caught(
    bands: &Bands,
    i: usize,
    filter: &ColourFilter,
    efficiency: &Curve,
) -> f64 {
    let mut shape = bands.shape(i);
    if *bands == Bands::Rgb && efficiency.as_flat().is_none() {
        // Silicon may see what colours are not known for: they go on as they end.
        let [from, to] = efficiency.range();
        shape = shape.held_over(from, to);
    }
    let [from, to] = shape.range();
    let ramp = [[from, from], [to, to]];
    let Ok(ramp) = Curve::sampled(ramp.to_vec()) else { return 0.0 };
    match filter {
        ColourFilter::Clear => integral(&[&shape, efficiency, &ramp], from, to),
        ColourFilter::Curve(curve) => integral(&[&shape, efficiency, curve, &ramp], from, to),
        ColourFilter::Band(band) => {
            // Edges that agree to rounding are one.
            let middle = 0.5 * (from + to);
            match (band.from..band.to).contains(&middle) {
                true => integral(&[&shape, efficiency, &ramp], from, to),
                false => 0.0,
            }
        }
        ColourFilter::Primary(k) if *bands == Bands::Rgb && *k != i => 0.0,
        ColourFilter::Primary(_) if *bands == Bands::Rgb => {
            integral(&[&shape, efficiency, &ramp], VISIBLE[0], VISIBLE[1])
        }
        ColourFilter::Primary(k) => {
            integral(&[&shape, efficiency, &rgb::PRIMARIES[*k], &ramp], from, to)
        }
    }
}

/// Digital mode: the most sensitive channel's value for 1 in all bands becomes full scale, in
/// electrons.
fn to_full_scale(channels: &mut [PhotositeKind], settings: &SensorSettings) {
    let white = |channel: &PhotositeKind| channel.primaries.iter().sum::<f64>();
    let most = channels.iter().map(white).fold(0.0, f64::max);
    let full_scale = (settings.white() - settings.black) / settings.gain;
    let all = |channel| {
        let PhotositeKind { electrons, primaries, .. }: &mut PhotositeKind = channel;
        electrons.iter_mut().chain(primaries)
    };
    for value in channels.iter_mut().flat_map(all) {
        *value *= full_scale / most;
    }
}
