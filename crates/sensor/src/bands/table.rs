//! Integrals of what a sensor sees of lights, filters and colours, over narrow cells and so over any band.

use etendue_spectrum::{Curve, Outside, rgb};

use super::factor::{DIM, Factor, Illumination, Product, Products};
use super::nodes::{Nodes, RunningSums, cell_edges, product};
use crate::Sensor;
use crate::response::{ColourFilter, Response, photons_caught};

/// Numbers beyond which a table is not made: sensors of very many channels.
const MOST_NUMBERS: usize = 2_000_000;

/// Parts of white: darker light need not be better than this part of it is, behind no colour, one and
/// two. Two pure colours one behind the other are nearly black, and no surface's.
const DARK: [f64; 4] = [1.0, 0.1, 1.0, 1.0];

/// The part of an error that bodies may show after the ways that are tried: it is largest between two of them.
const BETWEEN: f64 = 0.94;

/// A light, a channel, a filter and a product of colours and other curves, and the electrons that they
/// really make.
pub(super) struct Trial {
    light: usize,
    channel: usize,
    filter: Option<usize>,
    product: Product,
    exact: RunningSums,
    /// Scale that an error is a part of.
    scale: f64,
}

/// Integrals over narrow cells, from which those over any band follow.
pub(super) struct BandTable {
    /// Of the cells (nm).
    pub(super) edges: Vec<f64>,
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
    pub(super) trials: Vec<Trial>,
    /// True if all products are among them.
    pub(super) complete: bool,
    pub(super) sensitivity: Curve,
    pub(super) mean_light: Curve,
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
    pub(super) fn new(
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
    pub(super) fn losses(&self, [a, b]: [usize; 2]) -> Vec<f64> {
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
    pub(super) fn cells_at(&self, edges: &[f64]) -> Vec<usize> {
        let near = |edge: &f64| self.edges.partition_point(|nm| *nm < *edge - 1e-9);
        let mut cells: Vec<usize> =
            edges.iter().map(|edge| near(edge).min(self.edges.len() - 1)).collect();
        cells.dedup();
        cells
    }

    /// Greatest error of a sensor's counts in bands that are no bands of wavelengths, in shares of each trial's scale.
    pub(super) fn error_of(
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
