//! Charts of pictures: their error against time, and against the number of samples.

use etendue_chart::{Axis, Chart, GREY, Mark, Point, Series, Stroke};

use crate::cameras::Cameras;
use crate::samplers::{Converged, Samplers};

/// What stands on a chart of one finding: its name, samples, seconds and relative error.
type ChartRow = (&'static str, u32, f64, f64);

pub(super) fn samplers(found: &Samplers) -> Vec<(&'static str, Chart)> {
    let rows: Vec<ChartRow> = found
        .findings
        .iter()
        .map(|f| (f.sampler, f.samples, f.seconds.median, f.relative_rmse))
        .collect();
    let about = Pictures {
        rows: &rows,
        resolution: found.resolution,
        converged: &found.converged,
        of: "the converged picture",
    };
    vec![
        ("samplers-time", about.against_time("Samplers: error against time")),
        ("samplers-samples", about.against_samples("Samplers: error against samples")),
    ]
}

pub(super) fn cameras(found: &Cameras) -> Vec<(&'static str, Chart)> {
    let rows: Vec<ChartRow> = found
        .findings
        .iter()
        .map(|f| (f.model, f.samples, f.seconds.median, f.relative_rmse))
        .collect();
    let about = Pictures {
        rows: &rows,
        resolution: found.resolution,
        converged: &found.converged,
        of: "the full train's converged picture",
    };
    vec![("cameras-time", about.against_time("Models of the lens: error against time"))]
}

/// Pictures against a converged one.
struct Pictures<'a> {
    rows: &'a [ChartRow],
    resolution: [u32; 2],
    converged: &'a Converged,
    /// What they are compared with.
    of: &'static str,
}

impl Pictures<'_> {
    fn against_time(&self, title: &str) -> Chart {
        let [width, height] = self.resolution.map(f64::from);
        let micros = |row: &ChartRow| row.2 / (width * height) * 1e6;
        let across = Axis::new("wall time a pixel (µs), all threads");
        let mut chart = self.chart(title, across, &micros);
        chart.notes.push(format!(
            "{}; shaded: the Pareto front",
            counted("disks along a line", self.rows)
        ));
        chart.front = true;
        chart
    }

    fn against_samples(&self, title: &str) -> Chart {
        self.chart(title, Axis::new("samples a pixel"), &|row| f64::from(row.1))
    }

    fn chart(&self, title: &str, across: Axis, value: &dyn Fn(&ChartRow) -> f64) -> Chart {
        let [width, height] = self.resolution;
        let upwards = Axis::new(format!("RMSE to {}, share of its mean", self.of));
        let note = format!(
            "{width} x {height} pixels; compared with {} samples a pixel",
            self.converged.samples
        );
        let mut names: Vec<&str> = self.rows.iter().map(|row| row.0).collect();
        names.dedup();
        let mut series: Vec<Series> = Vec::new();
        for (colour, name) in names.into_iter().enumerate() {
            let own = self.rows.iter().filter(|row| row.0 == name);
            let points = own.map(|row| [value(row), row.3]);
            series.push(Series { colour, contends: true, ..Series::line(name, points) });
        }
        series.extend(self.own_error(value));
        Chart {
            title: title.to_owned(),
            notes: vec![note],
            axes: [across, upwards.with_zero("no difference")],
            series,
            front: false,
        }
    }

    /// A line at the error of the converged picture itself, below which nothing can be told.
    fn own_error(&self, value: &dyn Fn(&ChartRow) -> f64) -> Option<Series> {
        let values = || self.rows.iter().map(value).filter(|value| *value > 0.0);
        let (low, high) = (values().reduce(f64::min)?, values().reduce(f64::max)?);
        let error = self.converged.rmse / self.converged.mean;
        let end = |x| Point { at: [x, error], mark: Mark::None };
        (error > 0.0).then(|| Series {
            name: "error of the converged picture itself".to_owned(),
            points: vec![end(low), end(high)],
            joined: true,
            stroke: Stroke::Dashed,
            colour: GREY,
            contends: false,
        })
    }
}

/// The numbers of samples behind `what`.
fn counted(what: &str, rows: &[ChartRow]) -> String {
    let mut counts: Vec<u32> = rows.iter().map(|row| row.1).collect();
    counts.sort_unstable();
    counts.dedup();
    let counts: Vec<String> = counts.iter().map(u32::to_string).collect();
    format!("{what}: {} samples a pixel", counts.join(", "))
}
