//! All that was measured on a scene: as text, CSV and charts.

mod charts;
mod table;

use etendue_chart::Chart;
use etendue_report::Table;
use serde::Serialize;

use crate::accelerators;
use crate::cameras::Cameras;
use crate::samplers::{ConvergedPicture, Samplers};
use crate::target::Target;

/// All that was measured, and on what.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Findings {
    /// The machine, one line a fact.
    pub machine: Vec<String>,
    /// Facts of what was traced, a line each.
    pub scene: Vec<String>,
    /// Times that each was timed.
    pub rounds: usize,
    /// Each accelerator × batch width × threads.
    pub accelerators: Vec<accelerators::AcceleratorMeasurement>,
    /// Each sampler × number of samples, where the scene has a picture.
    pub samplers: Option<Samplers>,
    /// Each model of the lens × number of samples, where the camera has one.
    pub cameras: Option<Cameras>,
    /// Settings that reach a given error soonest, where that was asked for.
    pub target: Option<Target>,
    /// Notes on what was left out or stands in for something, and why.
    pub notes: Vec<String>,
}

impl Findings {
    /// Everything as tables for a terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for line in self.machine.iter().chain(&self.scene) {
            text.push_str(line);
            text.push('\n');
        }
        for (title, table) in self.tables() {
            text.push_str(&format!("\n{title}\n{}", table.text()));
        }
        text.extend(self.target.iter().map(|found| format!("\n{}\n", found.verdict())));
        text
    }

    /// Each table as the name of a file and its CSV, with all digits.
    #[must_use]
    pub fn csv(&self) -> Vec<(&'static str, String)> {
        let mut files = Vec::new();
        if !self.accelerators.is_empty() {
            files.push(("accelerators.csv", table::accelerators(&self.accelerators).csv()));
        }
        if let Some(samplers) = &self.samplers {
            files.push(("samplers.csv", table::samplers(samplers).csv()));
        }
        if let Some(cameras) = &self.cameras {
            files.push(("cameras.csv", table::cameras(cameras).csv()));
        }
        if let Some(target) = &self.target {
            files.push(("target.csv", table::renders(target).csv()));
            if !target.equal_time.is_empty() {
                files.push(("target-equal-time.csv", table::equal_time(target).csv()));
            }
        }
        files
    }

    /// Each chart with the stem of its file's name.
    #[must_use]
    pub fn charts(&self) -> Vec<(&'static str, Chart)> {
        let mut charts = Vec::new();
        if !self.accelerators.is_empty() {
            charts.extend(charts::accelerators(&self.accelerators));
        }
        if let Some(samplers) = &self.samplers {
            charts.extend(charts::samplers(samplers));
        }
        if let Some(cameras) = &self.cameras {
            charts.extend(charts::cameras(cameras));
        }
        if let Some(target) = &self.target {
            charts.push(("target-time", charts::target(target)));
        }
        charts
    }

    fn tables(&self) -> Vec<(String, Table)> {
        let mut tables = Vec::new();
        if let Some(first) = self.accelerators.first() {
            let title = format!(
                "Accelerators: {} rays, rounds: {}. Wrong are rays that miss, hit \
                 falsely, or hit another triangle elsewhere than `exact`.",
                first.errors.rays, self.rounds
            );
            tables.push((title, table::accelerators(&self.accelerators)));
        }
        let pictures = |what: &str,
                        [width, height]: [u32; 2],
                        converged: &ConvergedPicture,
                        of: &str| {
            format!(
                "{what}: pictures of {width} x {height} pixels against {of} of {} samples, whose own \
                 error is {:.1e} of its mean.",
                converged.samples,
                converged.rmse / converged.mean
            )
        };
        if let Some(found) = &self.samplers {
            let title = pictures("Samplers", found.resolution, &found.converged, "one");
            tables.push((title, table::samplers(found)));
        }
        if let Some(found) = &self.cameras {
            let of = "the full train's";
            let title = pictures("Camera models", found.resolution, &found.converged, of);
            tables.push((title, table::cameras(found)));
        }
        if let Some(found) = &self.target {
            let title = format!(
                "Settings by when the whole program reaches an error of {} % of the picture's mean, against one of {} \
                 samples, whose own error is {:.2} %.",
                100.0 * found.target,
                found.converged,
                100.0 * found.own_error
            );
            tables.push((title, table::contenders(found)));
            if !found.equal_time.is_empty() {
                let title = "In the time that the soonest takes: as `target-equal-time.png` shows them, from the left, \
                             behind the converged picture.";
                tables.push((title.to_owned(), table::equal_time(found)));
            }
        }
        tables
    }
}
