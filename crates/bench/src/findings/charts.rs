//! Charts: the accelerators by what is wrong, and how far, against time; pictures by their error against
//! time and against the number of samples.
use crate::accelerators::{AcceleratorMeasurement, RENDER_WIDTH};
use crate::cameras::Cameras;
use crate::samplers::{ConvergedPicture, Samplers};
use crate::target::{AS_IT_IS, Target};
use etendue_chart::{Axis, Chart, GREY, Mark, Point, Series, Stroke};

/// Number of one finding on a chart's axis.
type Measure = fn(&AcceleratorMeasurement) -> Option<f64>;

pub(super) fn accelerators(findings: &[AcceleratorMeasurement]) -> Vec<(&'static str, Chart)> {
    let rays = findings.first().map_or(0, |finding| finding.errors.rays);
    let hits = Chart {
        title: "Rays with a wrong answer".to_owned(),
        axes: [
            Axis::new(TIME),
            Axis::new("share of rays that miss, hit falsely, or hit another triangle")
                .with_zero(format!("not one of {rays} rays")),
        ],
        ..against_time(findings, |finding| Some(finding.errors.wrong_share()))
    };
    let depth = Chart {
        title: "Error of the distance".to_owned(),
        axes: [
            Axis::new(TIME),
            Axis::new("relative error that 99.9 % of hits stay below")
                .with_zero("equal to `exact` to the bit"),
        ],
        ..against_time(findings, |finding| Some(finding.errors.relative_distance?.p999))
    };
    let mut charts = vec![("accelerators-hits", hits), ("accelerators-depth", depth)];
    let widths = |finding: &AcceleratorMeasurement| finding.width;
    if findings.iter().any(|finding| Some(widths(finding)) != findings.first().map(widths)) {
        charts.push(("accelerators-batch", batch_widths(findings)));
    }
    charts
}

const TIME: &str = "wall time a ray (µs)";

fn micros(finding: &AcceleratorMeasurement) -> f64 {
    finding.seconds.median / finding.errors.rays.max(1) as f64 * 1e6
}

/// Every method with all its batch widths; for each number of threads a series of its own.
fn against_time(findings: &[AcceleratorMeasurement], error: Measure) -> Chart {
    let most = most_threads(findings);
    let mut notes = Vec::new();
    let others: Vec<String> = threads(findings)
        .into_iter()
        .filter(|&threads| threads != most)
        .map(|threads| threads.to_string())
        .collect();
    // What the marks mean.
    let mut marks = match most {
        1 => "disks: 1 thread".to_owned(),
        _ => format!("disks: {most} threads"),
    };
    if !others.is_empty() {
        marks.push_str(&format!("; rings: {}", others.join(", ")));
    }
    if findings.iter().any(|finding| finding.width != width(findings)) {
        marks.push_str(&format!("; batches of {}, dots: of other widths", width(findings)));
    }
    notes.push(marks);
    notes.push("shaded: the Pareto front, which nothing else of all threads beats in both".into());
    // A series for each method and number of threads, in the method's colour.
    let mut series = Vec::new();
    for (colour, method) in methods(findings).into_iter().enumerate() {
        for threads in threads(findings) {
            let own = findings.iter().filter(|f| f.method == method && f.threads == threads);
            let points = own.filter_map(|finding| {
                let mark = match (finding.width == width(findings), threads == most) {
                    (true, true) => Mark::Disk,
                    (true, false) => Mark::Ring,
                    (false, _) => Mark::Dot,
                };
                Some(Point { at: [micros(finding), error(finding)?], mark })
            });
            series.push(Series {
                name: if threads == most { method.to_owned() } else { String::new() },
                points: points.collect(),
                colour,
                contends: threads == most,
                ..Series::default()
            });
        }
    }
    Chart { notes, series, front: true, ..Chart::default() }
}

fn batch_widths(findings: &[AcceleratorMeasurement]) -> Chart {
    let most = most_threads(findings);
    let series = methods(findings).into_iter().enumerate().map(|(colour, method)| {
        let own = findings.iter().filter(|f| f.method == method && f.threads == most);
        let points = own.map(|finding| [finding.width as f64, micros(finding)]);
        Series { colour, ..Series::line(method, points) }
    });
    Chart {
        title: "Time by batch width".to_owned(),
        notes: vec![format!("threads: {most}; renders trace batches of {RENDER_WIDTH}")],
        axes: [Axis::new("rays a batch"), Axis::new(TIME)],
        series: series.collect(),
        front: false,
    }
}

/// The methods in their order.
fn methods(findings: &[AcceleratorMeasurement]) -> Vec<&str> {
    let mut methods: Vec<&str> = findings.iter().map(|finding| finding.method.as_str()).collect();
    methods.dedup();
    methods
}

fn threads(findings: &[AcceleratorMeasurement]) -> Vec<usize> {
    let mut threads: Vec<usize> = findings.iter().map(|finding| finding.threads).collect();
    threads.sort_unstable();
    threads.dedup();
    threads
}

fn most_threads(findings: &[AcceleratorMeasurement]) -> usize {
    findings.iter().map(|finding| finding.threads).max().unwrap_or(1)
}

/// The batch width that points are named at: a render's, or else the widest.
fn width(findings: &[AcceleratorMeasurement]) -> usize {
    let widths = || findings.iter().map(|finding| finding.width);
    if widths().any(|width| width == RENDER_WIDTH) {
        return RENDER_WIDTH;
    }
    widths().max().unwrap_or(RENDER_WIDTH)
}

/// Row of a chart for one finding: its name, samples, seconds and relative error.
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

/// Contenders that have a colour of their own: the soonest, and the scene as it is.
const COLOURS: usize = 6;

/// Every render by the time of the whole program and its error.
pub(super) fn target(found: &Target) -> Chart {
    let shown: Vec<&str> = found.contenders.iter().map(|own| &*own.name).take(COLOURS).collect();
    let mut series: Vec<Series> = Vec::new();
    for own in &found.contenders {
        let renders = found.renders.iter().filter(|render| render.name == own.name);
        let mut at: Vec<[f64; 2]> = renders.map(|render| [render.seconds, render.error]).collect();
        at.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let place = shown.iter().position(|name| *name == own.name);
        let is_named = place.is_some() || own.name == AS_IT_IS;
        let mark = if is_named { Mark::Disk } else { Mark::Dot };
        series.push(Series {
            name: if is_named { own.name.clone() } else { String::new() },
            points: at.into_iter().map(|at| Point { at, mark }).collect(),
            joined: is_named,
            colour: place.unwrap_or(GREY),
            contends: true,
            ..Series::default()
        });
    }
    // The target, from the first to the last.
    let times = || found.renders.iter().map(|render| render.seconds);
    if let (Some(low), Some(high)) = (times().reduce(f64::min), times().reduce(f64::max)) {
        let end = |x| Point { at: [x, found.target], mark: Mark::None };
        series.push(Series {
            name: format!("target: {} %", 100.0 * found.target),
            points: vec![end(low), end(high)],
            joined: true,
            stroke: Stroke::Dashed,
            colour: GREY,
            contends: false,
        });
    }
    Chart {
        title: "Settings: error of what the sensor records against the time of the whole program"
            .to_owned(),
        notes: vec![
            "dots: other settings; shaded: the Pareto front, which nothing else beats in both"
                .to_owned(),
        ],
        axes: [
            Axis::new("load, build, trace and write (s)"),
            Axis::new("root mean square error over the mean")
                .with_zero("the converged picture's own"),
        ],
        series,
        front: true,
    }
}

/// Pictures against a converged one.
struct Pictures<'a> {
    rows: &'a [ChartRow],
    resolution: [u32; 2],
    converged: &'a ConvergedPicture,
    /// Name of what they are compared with.
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
