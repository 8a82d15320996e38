//! Tables for a terminal and for spreadsheets, from the same columns.

use etendue_report::{Cell, Table};

use crate::accelerators;
use crate::cameras::Cameras;
use crate::hits::Quantiles;
use crate::samplers::Samplers;
use crate::target::Target;
use crate::timing::TimeSpread;

pub(super) fn accelerators(findings: &[accelerators::AcceleratorMeasurement]) -> Table {
    Table::of_rows(findings.iter().map(accelerator).collect())
}

fn accelerator(finding: &accelerators::AcceleratorMeasurement) -> Vec<(&'static str, Cell)> {
    let errors = &finding.errors;
    let of = |quantiles: Option<Quantiles>, which: fn(Quantiles) -> f64| quantiles.map(which);
    let mega = |bytes: u64| Cell::number(bytes as f64, format!("{:.1}", bytes as f64 / 1e6));
    let seconds = |value: f64| Cell::number(value, format!("{value:.3}"));
    let rays = errors.rays as f64;
    let rate = |seconds: f64| rays / seconds / 1e6;
    let shown_rate = |rate: f64| Cell::number(rate, format!("{rate:.2}"));
    // Hidden columns are in the CSV alone.
    vec![
        ("method", Cell::word(finding.method.as_str())),
        ("backend", Cell::hidden(&finding.backend)),
        ("batch", Cell::count(finding.width as u64)),
        ("threads", Cell::count(finding.threads as u64)),
        ("build_s", seconds(finding.build_seconds.median)),
        ("build_fastest_s", Cell::hidden(finding.build_seconds.fastest)),
        ("build_slowest_s", Cell::hidden(finding.build_seconds.slowest)),
        ("MB", mega(finding.bytes)),
        ("copied_MB", Cell::hidden(finding.copied_bytes as f64 / 1e6)),
        ("trace_s", seconds(finding.seconds.median)),
        ("trace_fastest_s", Cell::hidden(finding.seconds.fastest)),
        ("trace_slowest_s", Cell::hidden(finding.seconds.slowest)),
        ("Mrays/s", shown_rate(finding.mrays_per_second)),
        ("slowest", shown_rate(rate(finding.seconds.slowest))),
        ("fastest", shown_rate(rate(finding.seconds.fastest))),
        ("rays", Cell::hidden(errors.rays)),
        ("hits", Cell::hidden(errors.hits)),
        ("missed", Cell::count(errors.missed)),
        ("false", Cell::count(errors.false_hits)),
        ("wrong_triangle", Cell::count(errors.wrong_triangle)),
        ("ties", Cell::hidden(errors.ties)),
        ("depth_max_m", error(of(errors.distance, |q| q.max))),
        ("depth_p99.9_m", error(of(errors.distance, |q| q.p999))),
        ("depth_median_m", hidden_error(of(errors.distance, |q| q.median))),
        ("depth_rel_max", hidden_error(of(errors.relative_distance, |q| q.max))),
        ("depth_rel_p99.9", error(of(errors.relative_distance, |q| q.p999))),
        ("depth_rel_median", hidden_error(of(errors.relative_distance, |q| q.median))),
        ("normal_max_deg", error(of(errors.normal_angle, |q| q.max))),
        ("normal_p99.9_deg", hidden_error(of(errors.normal_angle, |q| q.p999))),
        ("normal_median_deg", hidden_error(of(errors.normal_angle, |q| q.median))),
    ]
}

pub(super) fn samplers(found: &Samplers) -> Table {
    let row = |finding: &crate::samplers::SamplerMeasurement| {
        let name = ["sampler", finding.sampler];
        picture(name, finding.samples, finding.seconds, [finding.rmse, finding.relative_rmse])
    };
    Table::of_rows(found.findings.iter().map(row).collect())
}

pub(super) fn cameras(found: &Cameras) -> Table {
    let row = |finding: &crate::cameras::ModelMeasurement| {
        let name = ["model", finding.model];
        picture(name, finding.samples, finding.seconds, [finding.rmse, finding.relative_rmse])
    };
    Table::of_rows(found.findings.iter().map(row).collect())
}

/// Table of when each contender reaches the target.
pub(super) fn contenders(found: &Target) -> Table {
    let row = |own: &crate::target::ContenderForecast| {
        let samples = own.samples.map_or_else(Cell::none, |samples| Cell::count(samples.into()));
        let seconds = |value: f64| Cell::number(value, format!("{value:.2}"));
        vec![
            ("settings", Cell::word(&own.name)),
            ("samples", samples),
            ("after_s", own.seconds.map_or_else(Cell::none, seconds)),
            ("renders", Cell::count(own.renders as u64)),
        ]
    };
    Table::of_rows(found.contenders.iter().map(row).collect())
}

/// Table of what some of them give in one time.
pub(super) fn equal_time(found: &Target) -> Table {
    let row = |own: &crate::target::EqualTime| {
        let shown = |value: f64, text: String| Cell::number(value, text);
        vec![
            ("settings", Cell::word(&own.name)),
            ("samples", Cell::count(own.samples.into())),
            ("seconds", shown(own.seconds, format!("{:.2}", own.seconds))),
            ("error", shown(own.error, format!("{:.4}", own.error))),
            ("relative_mse", shown(own.relative_mse, format!("{:.2e}", own.relative_mse))),
        ]
    };
    Table::of_rows(found.equal_time.iter().map(row).collect())
}

/// Every render of them.
pub(super) fn renders(found: &Target) -> Table {
    let row = |own: &crate::target::Render| {
        let [load, build, trace, write] = own.stages.map(Cell::hidden);
        vec![
            ("settings", Cell::word(&own.name)),
            ("samples", Cell::count(own.samples.into())),
            ("seconds", Cell::hidden(own.seconds)),
            ("load_s", load),
            ("build_s", build),
            ("trace_s", trace),
            ("write_s", write),
            ("error", Cell::hidden(own.error)),
            ("relative_mse", Cell::hidden(own.relative_mse)),
        ]
    };
    Table::of_rows(found.renders.iter().map(row).collect())
}

fn picture(
    [title, name]: [&'static str; 2],
    samples: u32,
    seconds: TimeSpread,
    [rmse, relative]: [f64; 2],
) -> Vec<(&'static str, Cell)> {
    let shown = |value: f64| Cell::number(value, format!("{value:.4}"));
    vec![
        (title, Cell::word(name)),
        ("samples", Cell::count(samples.into())),
        ("trace_s", shown(seconds.median)),
        ("fastest_s", shown(seconds.fastest)),
        ("slowest_s", shown(seconds.slowest)),
        ("rmse", error(Some(rmse))),
        ("relative_rmse", error(Some(relative))),
    ]
}

fn error(value: Option<f64>) -> Cell {
    match value {
        Some(0.0) => Cell::count(0),
        Some(value) => Cell::number(value, format!("{value:.1e}")),
        None => Cell::none(),
    }
}

fn hidden_error(value: Option<f64>) -> Cell {
    Cell::hidden(value.map_or_else(String::new, |value| value.to_string()))
}
