//! Failures of the normal approximation of the Poisson distribution: charts into the file that is
//! named, a table to standard output.
//!
//! ```sh
//! cargo run --release -p etendue-sensor --example approximation -- docs/images/normal-approximation.svg
//! ```
#![allow(clippy::disallowed_methods, reason = "an example writes what it is told to")]

use std::fmt::Write as _;

use etendue_chart::{Axis, Chart, GREY, Series, Stroke, Theme, side_by_side};
use etendue_sensor::approximation::{Deviation, electrons_needed};

fn main() -> std::io::Result<()> {
    if let Some(path) = std::env::args_os().nth(1) {
        std::fs::write(path, charts())?;
    }
    print!("{}", table());
    Ok(())
}

/// Read noises that the charts show (e⁻).
const SHOWN: [f64; 6] = [0.0, 0.3, 1.0, 2.0, 5.0, 10.0];

/// Means that the charts show (e⁻): 0.1 to 1000.
fn means() -> impl Iterator<Item = f64> {
    (0..=80).map(|i| 0.1 * 10f64.powf(0.05 * f64::from(i)))
}

/// Distance, bias after clipping and skewness against mean electrons, a line for each of some read
/// noises, as SVG.
fn charts() -> String {
    let all: Vec<Vec<Deviation>> = SHOWN
        .iter()
        .map(|&sigma| means().map(|mean| Deviation::new(mean, sigma)).collect())
        .collect();
    let lines = |value: &dyn Fn(&Deviation) -> f64| -> Vec<Series> {
        let all = SHOWN.iter().zip(&all).enumerate();
        all.map(|(colour, (sigma, deviations))| {
            let points = deviations.iter().map(|at| [at.mean, value(at)]);
            Series { colour, ..Series::curve(format!("{sigma} e⁻"), points) }
        })
        .collect()
    };
    let chart = |title: &str, upwards: &str, series: Vec<Series>| Chart {
        title: title.to_owned(),
        notes: vec!["a line for each read noise".to_owned()],
        axes: [Axis::new("mean electrons"), Axis::new(upwards)],
        series,
        ..Chart::default()
    };
    let one_percent = Series {
        colour: GREY,
        stroke: Stroke::Dotted,
        ..Series::curve("1 %", [[0.1, 0.01], [1000.0, 0.01]])
    };
    let distances = lines(&|at| at.distance).into_iter().chain([one_percent]).collect();
    // Without a black level; below a millionth of an electron lies rounding.
    let visible = |bias: f64| if bias > 1e-6 { bias } else { 0.0 };
    let biases = lines(&|at| visible(at.bias_of_normal - at.bias));
    let charts = [
        chart("Kolmogorov's distance to the truth", "distance", distances),
        chart("Bias after clipping, normal − exact", "bias (e⁻)", biases),
        chart("Skewness, which the normal lacks", "skewness", lines(&|at| at.skewness)),
    ];
    side_by_side(&charts, Theme::Reader)
}

/// Mean electrons below which the approximation is over a limit of Kolmogorov's distance, a line for
/// each of some read noises, as a table of Markdown.
fn table() -> String {
    let limits = [0.05, 0.02, 0.01, 0.005];
    let mut text =
        String::from("| read noise e⁻ | 5 % | 2 % | 1 % | 0.5 % |\n|---|---|---|---|---|\n");
    for sigma in [0.0, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
        let _ = write!(text, "| {sigma} |");
        for limit in limits {
            let _ = match electrons_needed(sigma, limit) {
                Some(electrons) if electrons >= 10.0 => write!(text, " {electrons:.0} |"),
                Some(electrons) => write!(text, " {electrons:.2} |"),
                None => write!(text, " never |"),
            };
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_and_table_show_what_was_computed() {
        let drawn = charts();
        // Bias is nothing but rounding in none of them: six lines each, and the limit.
        assert_eq!(drawn.matches("<path").count(), 19);
        assert!(!drawn.contains("NaN"));
        let row = table().lines().find(|line| line.starts_with("| 1 |")).unwrap().to_owned();
        assert!(row.contains("| never | 7.") && row.contains("| 4"), "{row}");
    }
}
