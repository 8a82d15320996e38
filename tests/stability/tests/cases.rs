//! Every case is a test, and the page of the documents names every case and no other.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

use std::collections::BTreeSet;
use std::process::ExitCode;

use etendue_stability::{Case, METHODS, Scale, page};
use libtest_mimic::{Arguments, Failed, Trial};

fn main() -> ExitCode {
    let mut trials = vec![Trial::test("the_page_names_every_case_and_no_other", page_names_cases)];
    for method in METHODS {
        for case in method.cases {
            let name = format!("{}::{}", method.name.to_lowercase(), case.name);
            trials.push(Trial::test(name, || run(case)));
        }
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

fn run(case: &Case) -> Result<(), Failed> {
    let outcome = (case.run)(Scale::Quick).map_err(|error| Failed::from(format!("{error:#}")))?;
    println!("{}: {outcome}", case.name);
    match outcome.violations() {
        [] => Ok(()),
        violations => Err(Failed::from(violations.join("\n"))),
    }
}

/// Measured cells, which differ from machine to machine, are not compared.
fn page_names_cases() -> Result<(), Failed> {
    let page = std::fs::read_to_string(page::PATH)?;
    let mut method = "";
    let mut on_page = BTreeSet::new();
    for line in page.lines() {
        if let Some(name) = line.strip_prefix("## ") {
            method = name;
        } else if let Some(row) = line.strip_prefix("| `") {
            let cells: Vec<&str> = row.split(" | ").collect();
            let name = cells[0].split('`').next().unwrap_or_default();
            on_page.insert([method, name, cells[1], cells[2]].map(str::to_owned));
        }
    }
    let cell = |text: &str| text.replace('|', "\\|");
    let cases = METHODS.iter().flat_map(|method| {
        let row = |case: &Case| {
            [method.name.to_owned(), case.name.to_owned(), cell(case.regime), cell(case.must)]
        };
        method.cases.iter().map(row)
    });
    let in_suite: BTreeSet<_> = cases.collect();
    let missing: Vec<_> = in_suite.difference(&on_page).collect();
    let stale: Vec<_> = on_page.difference(&in_suite).collect();
    if missing.is_empty() && stale.is_empty() {
        return Ok(());
    }
    Err(Failed::from(format!(
        "docs/measurements/stability.md is not of this suite; run `make docs-stability`\n\
         not on the page: {missing:#?}\nnot in the suite: {stale:#?}"
    )))
}
