//! `etendue spectrum`: what a curve is to the eye, as a colour and as photons, and its drawing.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use etendue::places;
use etendue_chart::{Axis, Chart, Series, Theme};
use etendue_files::Transaction;
use etendue_report::{Cell, Table};
use etendue_spectrum::table::Column;
use etendue_spectrum::{Curve, Illuminant, Summary, table};
use serde::Serialize;

use crate::arguments::SpectrumArguments;
use crate::fault::{Fault, print_json, print_text};
use crate::progress::say;

/// The longest file that is read (bytes).
const LONGEST: u64 = 1 << 26;

/// File that the curves are drawn into.
const DRAWING: &str = "spectrum.svg";

pub(crate) fn run(arguments: &SpectrumArguments) -> Result<(), Fault> {
    let curves = curves(arguments)?;
    let lit = match &arguments.under {
        Some(word) => {
            let lamp = lamp(word)?;
            let lit = curves.iter().map(|NamedCurve { name, curve }| {
                // The reflectance goes on beyond its ends as it is there.
                let [from, to] = lamp.range();
                let curve = times(&lamp, &curve.held_over(from, to));
                NamedCurve { name: name.clone(), curve }
            });
            lit.collect()
        }
        None => curves.clone(),
    };
    let found: Vec<Row> = lit.iter().map(|own| Row::new(&own.name, &own.curve)).collect();
    if let Some(folder) = &arguments.output {
        let path = folder.join(DRAWING);
        let input = PathBuf::from(&arguments.spectrum);
        let inputs: Vec<PathBuf> = input.exists().then_some(input).into_iter().collect();
        places::keep_apart(&inputs, std::slice::from_ref(&path))?;
        places::folder(folder)?;
        let drawn = drawing(&arguments.spectrum, &curves);
        let to = Transaction::at_once().keeping(&inputs);
        to.write(&path, |file| file.write_all(drawn.as_bytes()))?;
        say(&format!("wrote {}", path.display()));
    }
    if arguments.json {
        return print_json(&found);
    }
    let rows = found.iter().map(Row::cells).collect();
    print_text(&Table::of_rows(rows).to_string())
}

/// A curve with its name.
#[derive(Debug, Clone)]
struct NamedCurve {
    name: String,
    curve: Curve,
}

impl NamedCurve {
    fn new(name: &str, curve: Curve) -> Self {
        Self { name: name.to_owned(), curve }
    }
}

/// The curves of a file by their names, or that of a lamp.
fn curves(arguments: &SpectrumArguments) -> Result<Vec<NamedCurve>, Fault> {
    let name = &arguments.spectrum;
    let path = Path::new(name);
    if !path.exists() && path.extension().is_none() {
        return Ok(vec![NamedCurve::new(name, lamp(name)?)]);
    }
    let refused = |why: String| Fault::refused(format!("{name}: {why}"));
    let bytes = etendue_files::read(path, LONGEST).map_err(|error| refused(error.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|_| refused("is no text".to_owned()))?;
    let is_yml = path.extension().is_some_and(|ending| ending == "yml" || ending == "yaml");
    if is_yml {
        let [n, k] = table::refractive_index_info(&text).map_err(refused)?;
        return Ok(vec![NamedCurve::new("n", n), NamedCurve::new("k", k)]);
    }
    let table = table::CurveTable::read(&text).map_err(refused)?;
    let curve = |column: Column| table.column(Some(&column)).map_err(refused);
    match &arguments.column {
        Some(word) => {
            let column = match word.parse() {
                Ok(number) => Column::Number(number),
                Err(_) => Column::Name(word.clone()),
            };
            Ok(vec![NamedCurve::new(word, curve(column)?)])
        }
        None => table
            .titles()
            .into_iter()
            .zip(1..)
            .map(|(name, number)| Ok(NamedCurve { name, curve: curve(Column::Number(number))? }))
            .collect(),
    }
}

/// A lamp by its word in scene files.
fn lamp(word: &str) -> Result<Curve, Fault> {
    let lower = word.to_ascii_lowercase().replace('-', "_");
    let value = match lower.parse::<f64>() {
        Ok(kelvin) => serde_json::json!({ "black_body": kelvin }),
        Err(_) => serde_json::Value::from(lower),
    };
    let known: Illuminant = serde_json::from_value(value).map_err(|_| {
        Fault::refused(format!(
            "{word}: neither a file nor a lamp\nhint: name a .csv, .spd or .yml file, a lamp (a, c, d50, d65, \
             equal_energy, fl1 to fl12, led_b1 to led_b5, led_bh1, led_rgb1, led_v1, led_v2) or the \
             temperature of a black body in kelvin"
        ))
    })?;
    known.curve().map_err(|error| Fault::refused(error.to_string()))
}

/// The product of two curves over what both know, a nanometre apart and at their own points.
fn times(a: &Curve, b: &Curve) -> Curve {
    let [from, to] = match (a.as_flat(), b.as_flat()) {
        (Some(a), _) => return b.scaled(a).unwrap_or(Curve::ONE),
        (_, Some(b)) => return a.scaled(b).unwrap_or(Curve::ONE),
        _ => [a.range()[0].max(b.range()[0]), a.range()[1].min(b.range()[1])],
    };
    let own = a.samples().iter().chain(b.samples()).map(|s| s[0]);
    let mut knots: Vec<f64> = own.filter(|nm| (from..=to).contains(nm)).collect();
    let mut nm = from.ceil();
    while nm < to {
        knots.push(nm);
        nm += 1.0;
    }
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    let at = |nm: f64| [nm, a.held(nm) * b.held(nm)];
    Curve::sampled(knots.into_iter().map(at).collect()).unwrap_or(Curve::ONE)
}

/// A curve in numbers, for machines.
#[derive(Debug, Serialize)]
struct Row {
    name: String,
    /// nm
    range: [f64; 2],
    /// X, Y and Z: integrals over nm.
    xyz: [f64; 3],
    xy: Option<[f64; 2]>,
    /// K
    correlated_colour_temperature: Option<f64>,
    duv: Option<f64>,
    /// lm/W
    luminous_efficacy: Option<f64>,
    /// The integral over nm.
    total: f64,
    /// 1/J
    photons: Option<f64>,
}

impl Row {
    fn new(name: &str, curve: &Curve) -> Self {
        let Summary { range, xyz, xy, temperature, duv, efficacy, total, photons } =
            Summary::of(curve);
        Self {
            name: name.to_owned(),
            range,
            xyz,
            xy,
            correlated_colour_temperature: temperature,
            duv,
            luminous_efficacy: efficacy,
            total,
            photons,
        }
    }

    fn cells(&self) -> Vec<(&'static str, Cell)> {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(Cell::none, |value| Cell::number(value, format!("{value:.digits$}")))
        };
        let [from, to] = self.range;
        let [x, y, z] = self.xyz.map(|value| number(Some(value), 4));
        vec![
            ("curve", Cell::word(&self.name)),
            ("nm", Cell::word(format!("{from} to {to}"))),
            ("X", x),
            ("Y", y),
            ("Z", z),
            ("x", number(self.xy.map(|xy| xy[0]), 4)),
            ("y", number(self.xy.map(|xy| xy[1]), 4)),
            ("CCT (K)", number(self.correlated_colour_temperature, 0)),
            ("lm/W", number(self.luminous_efficacy, 1)),
            ("integral", number(Some(self.total), 4)),
            (
                "photons/J",
                self.photons.map_or_else(Cell::none, |n| Cell::number(n, format!("{n:.4e}"))),
            ),
        ]
    }
}

/// The curves as a chart.
fn drawing(title: &str, curves: &[NamedCurve]) -> String {
    let name = Path::new(title).file_name().unwrap_or_default().to_string_lossy();
    let series = curves.iter().enumerate().map(|(number, NamedCurve { name, curve })| {
        let points: Vec<[f64; 2]> = match curve.as_flat() {
            Some(value) => vec![[380.0, value], [780.0, value]],
            None => curve.samples().to_vec(),
        };
        let named = if curves.len() > 8 { String::new() } else { name.clone() };
        Series { colour: number % 7, ..Series::curve(named, points) }
    });
    let axes = [Axis::linear("wavelength (nm)").fitted(), Axis::linear("value")];
    let chart =
        Chart { title: name.into_owned(), axes, series: series.collect(), ..Chart::default() };
    chart.svg(Theme::Reader)
}
