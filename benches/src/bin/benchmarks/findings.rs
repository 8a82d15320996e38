//! Findings: all that was measured.

use std::collections::BTreeMap;

use etendue_bench::timing::Timings;

/// One contestant at one question.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    pub(crate) who: String,
    /// Seconds, round by round.
    pub(crate) series: Timings,
    /// Bytes that it holds, where that was asked.
    pub(crate) bytes: Option<u64>,
}

/// All contestants at one question about one mesh, in the order in which they are shown.
#[derive(Debug, Clone)]
pub(crate) struct Contest {
    pub(crate) part: Part,
    pub(crate) mesh: String,
    pub(crate) question: String,
    /// Rays traced or triangles built, for rates.
    pub(crate) items: f64,
    pub(crate) records: Vec<Record>,
}

/// Table that a contest belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Traversal,
    FirstLight,
    Threads,
    Build,
    Load,
    Whole,
}

impl Contest {
    pub(crate) fn find(&self, who: &str) -> Option<&Record> {
        self.records.iter().find(|record| record.who == who)
    }

    /// Number of times that `who` is as fast as `other`.
    pub(crate) fn speed(&self, who: &str, other: &str) -> Option<f64> {
        Some(self.find(who)?.series.speed_against(&self.find(other)?.series))
    }
}

/// All contests, and single numbers beside them.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    pub(crate) contests: Vec<Contest>,
    pub(crate) numbers: BTreeMap<String, f64>,
}

impl Findings {
    pub(crate) fn of(&self, part: Part) -> impl Iterator<Item = &Contest> {
        self.contests.iter().filter(move |contest| contest.part == part)
    }

    pub(crate) fn contest(&self, part: Part, mesh: &str, question: &str) -> Option<&Contest> {
        self.of(part).find(|contest| contest.mesh == mesh && contest.question == question)
    }

    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.numbers.get(name).copied()
    }
}
