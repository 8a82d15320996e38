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

pub use factor::{Factor, Times};

use etendue_report::Refusal;
use etendue_spectrum::{Bands, Curve, Grid, Outside, WeightedBands, rgb};

use crate::response::{ColourFilter, Response, filters, photons_caught, sensitive_range};
use crate::spec::{Radiometry, SensorKind};
use crate::{Sensor, SensorError};
use division::{Division, Nodes, RunningSums, cell_edges, product};
use factor::{DIM, Product, Products};

/// By how much of themselves electrons may differ from an integration in steps of a nanometre.
pub const TOLERANCE: f64 = 1e-3;

/// Numbers beyond which a table is not made: sensors of very many channels.
const MOST_NUMBERS: usize = 2_000_000;

/// Parts of white: darker light need not be better than this part of it is, behind no colour, one and
/// two. Two pure colours one behind the other are nearly black, and no surface's.
const DARK: [f64; 4] = [1.0, 0.1, 1.0, 1.0];

/// The part of an error that bodies may show after the ways that are tried: it is largest between two of them.
const BETWEEN: f64 = 0.94;

/// Spectra and filters that the bands of a render have to tell apart.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Illumination {
    /// Spectra of the lights, to any factor; none for equal energy.
    pub spectra: Vec<Curve>,
    /// Curves of filters in front of the sensor, each of which may be what light passes.
    pub filters: Vec<Curve>,
    /// Number of coloured factors that light meets on its way to the sensor: its own colour and
    /// those of surfaces; more than three count as three.
    pub colored: usize,
    /// Other curves that light may be multiplied by on its way.
    pub factors: Vec<Factor>,
}

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
        let counts = self.settings.radiometry == Radiometry::Physical;
        let ideal = matches!(self.response.bands, Bands::Grey | Bands::Rgb);
        let multispectral = spec.kind == SensorKind::Multispectral && spec.bands.is_some();
        if !counts && (ideal || spec.bands.is_some()) {
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
        let may_divide = given.is_none() || multispectral;
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

/// A light, a channel, a filter and a product of colours and other curves, and the electrons that they
/// really make.
struct Trial {
    light: usize,
    channel: usize,
    filter: Option<usize>,
    product: Product,
    exact: RunningSums,
    /// Scale that an error is a part of.
    scale: f64,
}

/// Integrals over narrow cells, from which those over any band follow.
struct BandTable {
    /// Of the cells (nm).
    edges: Vec<f64>,
    /// The sensor's: of all channels together.
    seen: RunningSums,
    /// Of each light, by the sensor.
    lights: Vec<RunningSums>,
    /// Of the mean light, by the sensor.
    weight: RunningSums,
    /// Of each primary, by sensor and mean light.
    primaries: [RunningSums; 3],
    /// Of each filter, likewise.
    filters: Vec<RunningSums>,
    /// Of each other factor, likewise.
    factors: Vec<RunningSums>,
    /// Of the mean light by each channel.
    channels: Vec<RunningSums>,
    trials: Vec<Trial>,
    /// True if all products are among them.
    complete: bool,
    sensitivity: Curve,
    mean_light: Curve,
}

/// Functions at the nodes of a table: of channels, lights, filters, primaries and other factors.
struct Functions<'a> {
    responses: &'a [Vec<f64>],
    spectra: &'a [Vec<f64>],
    passed: &'a [Vec<f64>],
    primaries: &'a [Vec<f64>; 3],
    factors: &'a [Vec<f64>],
}

/// A curve's value, 0 outside of its range.
fn inside(curve: &Curve, nm: f64) -> f64 {
    curve.at(nm).unwrap_or(0.0)
}

impl BandTable {
    /// `None` when it would be too large.
    fn new(
        sensor: &Sensor,
        filters: &[ColourFilter],
        light: &Illumination,
        range: [f64; 2],
        fixed: &[f64],
    ) -> Option<Self> {
        let efficiency = &sensor.settings.efficiency;
        let even = [Curve::ONE];
        let spectra = if light.spectra.is_empty() { &even[..] } else { &light.spectra };
        // A curve that is the same everywhere tells no bands apart.
        let factors: Vec<&Factor> =
            light.factors.iter().filter(|factor| factor.curve.as_flat().is_none()).collect();
        let curves: Vec<&Curve> = (spectra.iter().chain(&light.filters))
            .chain(factors.iter().map(|factor| &factor.curve))
            .chain(filters.iter().filter_map(ColourFilter::curve))
            .chain([efficiency, &rgb::PRIMARIES[0]])
            .collect();
        let edges = cell_edges(&curves, range, fixed);
        let each = spectra.len() * filters.len() * light.filters.len().max(1);
        let most = MOST_NUMBERS / (each * edges.len());
        let nodes = Nodes::of(&edges);
        let responses: Vec<Vec<f64>> = filters
            .iter()
            .map(|filter| nodes.at(|nm| nm * inside(efficiency, nm) * filter.passes(nm)))
            .collect();
        let lights = spectra;
        let spectra: Vec<Vec<f64>> =
            lights.iter().map(|curve| nodes.at(|nm| inside(curve, nm))).collect();
        let primaries: [Vec<f64>; 3] =
            std::array::from_fn(|k| nodes.at(|nm| rgb::PRIMARIES[k].held(nm)));
        let passed: Vec<Vec<f64>> =
            light.filters.iter().map(|curve| nodes.at(|nm| curve.held(nm))).collect();
        // Every channel and every light counts alike, however weak.
        let all: Vec<f64> =
            (0..nodes.nm.len()).map(|i| responses.iter().map(|r| r[i]).sum()).collect();
        let scales = nodes.scales(&spectra, &all);
        let mean_light = mixed(&spectra, &scales);
        let seen = mixed(&responses, &nodes.scales(&responses, &mean_light));
        // Straight lines join the light's samples, all of which are edges.
        let at_edge = |nm: f64| lights.iter().zip(&scales).map(|(s, k)| k * inside(s, nm)).sum();
        let light_curve = Curve::sampled(edges.iter().map(|&nm| [nm, at_edge(nm)]).collect());
        let weight = product(&[&seen, &mean_light]);
        let others: Vec<Vec<f64>> =
            factors.iter().map(|factor| nodes.at(|nm| factor.curve.held(nm))).collect();
        let left = |factor: usize, power: f64| {
            let values: Vec<f64> = others[factor].iter().map(|value| value.powf(power)).collect();
            let total = |sums: RunningSums| sums.last().copied().unwrap_or(0.0);
            let of_channel = |response: &Vec<f64>| {
                let white = total(nodes.sums(&[response, &mean_light]));
                total(nodes.sums(&[response, &mean_light, &values])) / white
            };
            let shares = responses.iter().map(of_channel).filter(|share| share.is_finite());
            shares.fold([1.0, 0.0], |[l, m]: [f64; 2], share| [l.min(share), m.max(share)])
        };
        let times = factors.iter().map(|factor| factor.times).enumerate();
        let powers: Vec<Vec<f64>> = times.map(|(k, times)| times.powers(|p| left(k, p))).collect();
        let repeat: Vec<bool> = factors.iter().map(|factor| factor.times.may_repeat()).collect();
        let Products { all: products, complete } =
            Products::of(light.colored, &powers, &repeat, most)?;
        let mut table = Self {
            seen: nodes.sums(&[&seen]),
            lights: spectra.iter().map(|s| nodes.sums(&[&seen, s])).collect(),
            weight: nodes.sums(&[&weight]),
            primaries: std::array::from_fn(|k| nodes.sums(&[&weight, &primaries[k]])),
            filters: passed.iter().map(|t| nodes.sums(&[&weight, t])).collect(),
            factors: others.iter().map(|f| nodes.sums(&[&weight, f])).collect(),
            channels: responses.iter().map(|r| nodes.sums(&[r, &mean_light])).collect(),
            trials: Vec::new(),
            complete,
            sensitivity: nodes.curve(&seen)?.held_over(range[0], range[1]),
            mean_light: light_curve.ok()?,
            edges,
        };
        let functions = Functions {
            responses: &responses,
            spectra: &spectra,
            passed: &passed,
            primaries: &primaries,
            factors: &others,
        };
        table.add_trials(&nodes, functions, &products);
        Some(table)
    }

    fn add_trials(
        &mut self,
        nodes: &Nodes,
        Functions { responses, spectra, passed, primaries, factors }: Functions<'_>,
        products: &[Product],
    ) {
        let filters: Vec<Option<usize>> = match passed.len() {
            0 => vec![None],
            count => (0..count).map(Some).collect(),
        };
        for (light, spectrum) in spectra.iter().enumerate() {
            for (channel, response) in responses.iter().enumerate() {
                for &filter in &filters {
                    // What the channel counts of a white surface.
                    let mut base = product(&[spectrum, response]);
                    if let Some(f) = filter {
                        base = product(&[&base, &passed[f]]);
                    }
                    let total = |sums: &RunningSums| sums.last().copied().unwrap_or(0.0);
                    let white = total(&nodes.sums(&[&base]));
                    // And of surfaces in all products of curves; those that are nearly black are judged
                    // against white.
                    for what in products {
                        let mut values = base.clone();
                        for &(k, power) in &what.factors {
                            let left = values.iter_mut().zip(&factors[k]);
                            left.for_each(|(value, factor)| *value *= factor.powf(power));
                        }
                        let clear = match what.factors.is_empty() {
                            true => white,
                            false => total(&nodes.sums(&[&values])).max(DIM * white),
                        };
                        for &k in &what.colors {
                            values = product(&[&values, &primaries[k]]);
                        }
                        let exact = nodes.sums(&[&values]);
                        let dark = DARK[what.colors.len()];
                        let margin = if what.factors.is_empty() { 1.0 } else { BETWEEN };
                        let scale = margin * total(&exact).max(dark * clear);
                        if scale > 0.0 {
                            let product = what.clone();
                            let trial = Trial { light, channel, filter, product, exact, scale };
                            self.trials.push(trial);
                        }
                    }
                }
            }
        }
    }

    /// The electrons that a band of cells loses of each trial (or finds too many), as a part of its scale.
    fn losses(&self, [a, b]: [usize; 2]) -> Vec<f64> {
        let over = |sums: &RunningSums| sums[b] - sums[a];
        let (seen, weight) = (over(&self.seen), over(&self.weight));
        let lost = |trial: &Trial, counted: f64| (counted - over(&trial.exact)) / trial.scale;
        if seen <= 0.0 || weight <= 0.0 {
            return self.trials.iter().map(|trial| lost(trial, 0.0)).collect();
        }
        // 1 in the band is the mean light, scaled to a mean of 1.
        let share = |of: f64| move |sums: &RunningSums| over(sums) / of;
        let channels: Vec<f64> = self.channels.iter().map(|c| over(c) * seen / weight).collect();
        let lights: Vec<f64> = self.lights.iter().map(share(seen)).collect();
        let filters: Vec<f64> = self.filters.iter().map(share(weight)).collect();
        let factors: Vec<f64> = self.factors.iter().map(share(weight)).collect();
        let primaries = self.primaries.each_ref().map(share(weight));
        let counted = |trial: &Trial| {
            let passed = trial.product.of(|k| primaries[k], |k| factors[k]);
            let counted = channels[trial.channel] * lights[trial.light] * passed;
            counted * trial.filter.map_or(1.0, |filter| filters[filter])
        };
        self.trials.iter().map(|trial| lost(trial, counted(trial))).collect()
    }

    /// The cells that begin at these wavelengths, which are edges of cells.
    fn cells_at(&self, edges: &[f64]) -> Vec<usize> {
        let near = |edge: &f64| self.edges.partition_point(|nm| *nm < *edge - 1e-9);
        let mut cells: Vec<usize> =
            edges.iter().map(|edge| near(edge).min(self.edges.len() - 1)).collect();
        cells.dedup();
        cells
    }

    /// Greatest error of a sensor's counts in bands that are no bands of wavelengths, in shares of each trial's scale.
    fn error_of(
        &self,
        response: &Response,
        filters: &[ColourFilter],
        efficiency: &Curve,
        light: &Illumination,
    ) -> f64 {
        let bands = &response.bands;
        let count = bands.count();
        let in_bands = |curve: &Curve, outside| {
            bands.from_curve(curve, outside).unwrap_or_else(|_| vec![0.0; count])
        };
        // Electrons, light and filters in the bands of the response.
        let electrons: Vec<Vec<f64>> = filters
            .iter()
            .map(|f| (0..count).map(|i| photons_caught(bands, i, f, efficiency)).collect())
            .collect();
        let even = [Curve::ONE];
        let spectra = if light.spectra.is_empty() { &even[..] } else { &light.spectra };
        let spectra: Vec<_> = spectra.iter().map(|s| in_bands(s, Outside::Zero)).collect();
        let passed: Vec<_> = light.filters.iter().map(|t| in_bands(t, Outside::Held)).collect();
        let factors = light.factors.iter().filter(|factor| factor.curve.as_flat().is_none());
        let factors: Vec<_> = factors.map(|f| in_bands(&f.curve, Outside::Held)).collect();
        let colors = bands.from_rgb();
        // The count in these bands against the exact one.
        let off = |trial: &Trial| {
            let counted = |i: usize| {
                let filter = trial.filter.map_or(1.0, |f| passed[f][i]);
                let product = trial.product.of(|k| colors[i][k], |k| factors[k][i]);
                electrons[trial.channel][i] * spectra[trial.light][i] * filter * product
            };
            let exact = trial.exact.last().copied().unwrap_or(0.0);
            (((0..count).map(counted).sum::<f64>() - exact) / trial.scale).abs()
        };
        self.trials.iter().map(off).fold(0.0, f64::max)
    }
}

/// The sum of functions times their scales.
fn mixed(functions: &[Vec<f64>], scales: &[f64]) -> Vec<f64> {
    let count = functions.first().map_or(0, Vec::len);
    (0..count).map(|i| functions.iter().zip(scales).map(|(f, scale)| scale * f[i]).sum()).collect()
}
