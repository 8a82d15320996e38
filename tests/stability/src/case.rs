//! A case, and what comes of it.

use std::fmt;

/// Amount of work of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Enough to fail when something is wrong: the tests, on every change.
    Quick,
    /// That which the page states.
    Full,
}

impl Scale {
    /// The number for this scale.
    #[must_use]
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// Cases of one method.
#[derive(Debug)]
pub struct Method {
    /// Its name on the page.
    pub name: &'static str,
    /// Its cases.
    pub cases: &'static [Case],
}

/// A regime in which a method may fail.
#[derive(Debug)]
pub struct Case {
    /// One word for tests and page, unlike any other of its method.
    pub name: &'static str,
    /// Regime that the method is taken to.
    pub regime: &'static str,
    /// Condition that must hold there; for a known limit, that which still has to.
    pub must: &'static str,
    /// Reason for which it is no better, where it is not mended.
    pub limit: Option<&'static str>,
    /// Goes there. An error means that it could not even be tried.
    pub run: fn(Scale) -> anyhow::Result<Outcome>,
}

/// Result of a case.
#[derive(Debug, Default)]
pub struct Outcome {
    measured: Vec<String>,
    violations: Vec<String>,
}

impl Outcome {
    /// Notes something measured, in words.
    pub fn measured(&mut self, what: impl Into<String>) {
        self.measured.push(what.into());
    }

    /// Notes that something which must hold does not.
    pub fn must(&mut self, holds: bool, otherwise: impl FnOnce() -> String) {
        if !holds {
            self.violations.push(otherwise());
        }
    }

    /// Conditions that did not hold.
    #[must_use]
    pub fn violations(&self) -> &[String] {
        &self.violations
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.measured.join("; "))
    }
}
