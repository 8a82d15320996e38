//! Tables for a terminal and for spreadsheets, from the same columns.

use crate::accelerators;
use crate::cameras::Cameras;
use crate::hits::Quantiles;
use crate::samplers::Samplers;
use crate::timing::TimeSpread;

/// A value in both its forms.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TableCell {
    /// Rounded, for a person; `None` leaves the column out of the terminal.
    shown: Option<String>,
    /// In full.
    full: String,
}

impl TableCell {
    fn word(word: impl Into<String>) -> Self {
        let full = word.into();
        Self { shown: Some(full.clone()), full }
    }

    fn count(count: u64) -> Self {
        Self::word(count.to_string())
    }

    /// A number and how a person wants to read it.
    fn number(value: f64, shown: String) -> Self {
        Self { shown: Some(shown), full: value.to_string() }
    }

    /// Only for spreadsheets.
    fn hidden(full: impl ToString) -> Self {
        Self { shown: None, full: full.to_string() }
    }

    fn error(value: Option<f64>) -> Self {
        match value {
            Some(0.0) => Self::word("0"),
            Some(value) => Self::number(value, format!("{value:.1e}")),
            None => Self { shown: Some("-".to_owned()), full: String::new() },
        }
    }
}

/// Rows under titles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    titles: Vec<&'static str>,
    rows: Vec<Vec<TableCell>>,
}

impl Table {
    /// Rows of titled cells; all have the same titles.
    fn new(rows: Vec<Vec<(&'static str, TableCell)>>) -> Self {
        let titles = rows.first().map(|row| row.iter().map(|(title, _)| *title).collect());
        let cells = |row: Vec<(_, TableCell)>| row.into_iter().map(|(_, cell)| cell).collect();
        Self { titles: titles.unwrap_or_default(), rows: rows.into_iter().map(cells).collect() }
    }

    /// Columns side by side: words to the left, numbers to the right.
    pub(super) fn text(&self) -> String {
        let Some(first) = self.rows.first() else { return String::new() };
        let shown: Vec<usize> =
            (0..first.len()).filter(|&column| first[column].shown.is_some()).collect();
        let heads = shown.iter().map(|&column| self.titles[column].replace('_', " ")).collect();
        let mut lines: Vec<Vec<String>> = vec![heads];
        for row in &self.rows {
            let cell = |&column: &usize| row[column].shown.clone().unwrap_or_default();
            lines.push(shown.iter().map(cell).collect());
        }
        let length = |text: &String| text.chars().count();
        let width = |k: usize| lines.iter().map(|line| length(&line[k])).max().unwrap_or(0);
        let widths: Vec<usize> = (0..shown.len()).map(width).collect();
        let mut text = String::new();
        for line in &lines {
            for (k, (cell, &width)) in line.iter().zip(&widths).enumerate() {
                let cell = match k {
                    0 => format!("{cell:<width$}"),
                    _ => format!("  {cell:>width$}"),
                };
                text.push_str(&cell);
            }
            text.push('\n');
        }
        text
    }

    /// Values with commas between, titles first.
    pub(super) fn csv(&self) -> String {
        let mut csv = self.titles.join(",") + "\n";
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(|cell| quoted(&cell.full)).collect();
            csv.push_str(&cells.join(","));
            csv.push('\n');
        }
        csv
    }
}

/// A value that RFC 4180 reads as one.
fn quoted(value: &str) -> String {
    match value.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", value.replace('"', "\"\"")),
        false => value.to_owned(),
    }
}

pub(super) fn accelerators(findings: &[accelerators::Finding]) -> Table {
    Table::new(findings.iter().map(accelerator).collect())
}

fn accelerator(finding: &accelerators::Finding) -> Vec<(&'static str, TableCell)> {
    let errors = &finding.errors;
    let of = |quantiles: Option<Quantiles>, which: fn(Quantiles) -> f64| quantiles.map(which);
    let mega = |bytes: u64| TableCell::number(bytes as f64, format!("{:.1}", bytes as f64 / 1e6));
    let seconds = |value: f64| TableCell::number(value, format!("{value:.3}"));
    let rays = errors.rays as f64;
    let rate = |seconds: f64| rays / seconds / 1e6;
    let shown_rate = |rate: f64| TableCell::number(rate, format!("{rate:.2}"));
    // Hidden columns are in the CSV alone.
    vec![
        ("method", TableCell::word(finding.method)),
        ("backend", TableCell::hidden(&finding.backend)),
        ("batch", TableCell::count(finding.width as u64)),
        ("threads", TableCell::count(finding.threads as u64)),
        ("build_s", seconds(finding.build_seconds.median)),
        ("build_fastest_s", TableCell::hidden(finding.build_seconds.fastest)),
        ("build_slowest_s", TableCell::hidden(finding.build_seconds.slowest)),
        ("MB", mega(finding.bytes)),
        ("copied_MB", TableCell::hidden(finding.copied_bytes as f64 / 1e6)),
        ("trace_s", seconds(finding.seconds.median)),
        ("trace_fastest_s", TableCell::hidden(finding.seconds.fastest)),
        ("trace_slowest_s", TableCell::hidden(finding.seconds.slowest)),
        ("Mrays/s", shown_rate(finding.mrays_per_second)),
        ("slowest", shown_rate(rate(finding.seconds.slowest))),
        ("fastest", shown_rate(rate(finding.seconds.fastest))),
        ("rays", TableCell::hidden(errors.rays)),
        ("hits", TableCell::hidden(errors.hits)),
        ("missed", TableCell::count(errors.missed)),
        ("false", TableCell::count(errors.false_hits)),
        ("wrong_triangle", TableCell::count(errors.wrong_triangle)),
        ("ties", TableCell::hidden(errors.ties)),
        ("depth_max_m", TableCell::error(of(errors.distance, |q| q.max))),
        ("depth_p99.9_m", TableCell::error(of(errors.distance, |q| q.p999))),
        ("depth_median_m", hidden_error(of(errors.distance, |q| q.median))),
        ("depth_rel_max", hidden_error(of(errors.relative_distance, |q| q.max))),
        ("depth_rel_p99.9", TableCell::error(of(errors.relative_distance, |q| q.p999))),
        ("depth_rel_median", hidden_error(of(errors.relative_distance, |q| q.median))),
        ("normal_max_deg", TableCell::error(of(errors.normal_angle, |q| q.max))),
        ("normal_p99.9_deg", hidden_error(of(errors.normal_angle, |q| q.p999))),
        ("normal_median_deg", hidden_error(of(errors.normal_angle, |q| q.median))),
    ]
}

pub(super) fn samplers(found: &Samplers) -> Table {
    let row = |finding: &crate::samplers::Finding| {
        let name = ("sampler", TableCell::word(finding.sampler));
        picture(name, finding.samples, finding.seconds, [finding.rmse, finding.relative_rmse])
    };
    Table::new(found.findings.iter().map(row).collect())
}

pub(super) fn cameras(found: &Cameras) -> Table {
    let row = |finding: &crate::cameras::Finding| {
        let name = ("model", TableCell::word(finding.model));
        picture(name, finding.samples, finding.seconds, [finding.rmse, finding.relative_rmse])
    };
    Table::new(found.findings.iter().map(row).collect())
}

fn picture(
    name: (&'static str, TableCell),
    samples: u32,
    seconds: TimeSpread,
    [rmse, relative]: [f64; 2],
) -> Vec<(&'static str, TableCell)> {
    let shown = |value: f64| TableCell::number(value, format!("{value:.4}"));
    vec![
        name,
        ("samples", TableCell::count(samples.into())),
        ("trace_s", shown(seconds.median)),
        ("fastest_s", shown(seconds.fastest)),
        ("slowest_s", shown(seconds.slowest)),
        ("rmse", TableCell::error(Some(rmse))),
        ("relative_rmse", TableCell::error(Some(relative))),
    ]
}

fn hidden_error(value: Option<f64>) -> TableCell {
    TableCell::hidden(value.map_or_else(String::new, |value| value.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_have_the_same_rows() {
        let row = |name: &str, value: f64| {
            vec![
                ("name", TableCell::word(name)),
                ("all_digits", TableCell::hidden(value)),
                ("error", TableCell::error(Some(value))),
            ]
        };
        let table = Table::new(vec![row("a, b", 0.123456789), row("c", 0.0)]);
        assert_eq!(table.csv(), "name,all_digits,error\n\"a, b\",0.123456789,0.123456789\nc,0,0\n");
        assert_eq!(table.text(), "name   error\na, b  1.2e-1\nc          0\n");
        assert_eq!(Table::new(Vec::new()).text(), "");
    }
}
