//! The page of results, in Markdown.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use etendue_bench::timing;
use etendue_bench::timing::Timings;
use etendue_benches::effort::Effort;
use etendue_benches::field::names;

use crate::findings::{Contest, Findings, Part, Record};
use crate::goals::{self, Goal};
use crate::{build, first_light, load, threads, whole};

/// Between these, another script writes what other programs take; it is kept.
const PEERS: [&str; 2] = ["<!-- peers: begin -->", "<!-- peers: end -->"];

/// Writes the page to `path`, and returns it.
pub(crate) fn write(effort: Effort, findings: &Findings, path: &Path) -> anyhow::Result<String> {
    let old = std::fs::read_to_string(path).unwrap_or_default();
    let text = compose(effort, findings, &kept(&old));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("{}", folder.display()))?;
    }
    std::fs::write(path, &text).with_context(|| format!("{}", path.display()))?;
    Ok(text)
}

/// The part of an older page that is not ours.
fn kept(old: &str) -> String {
    let [begin, end] = PEERS;
    let part = old.split_once(begin).and_then(|(_, rest)| rest.split_once(end));
    let part = part.map_or("\nNot measured yet: `make bench-peers`.\n", |(part, _)| part);
    format!("{begin}{part}{end}")
}

fn compose(effort: Effort, findings: &Findings, peers: &str) -> String {
    let mut text = String::from(HEAD);
    for line in timing::describe().into_iter().chain([timing::checkout()]) {
        push(&mut text, &format!("- {line}"));
    }
    push(&mut text, &format!("- Rounds: {}, after one that is not counted", effort.rounds()));
    goals_table(&mut text, &goals::all(effort, findings));
    text.push_str(TRACING);
    for contest in findings.of(Part::Traversal) {
        traversal_table(&mut text, contest);
    }
    text.push_str(THREADS);
    threads_table(&mut text, findings);
    text.push_str(RENDERING);
    for contest in findings.of(Part::FirstLight) {
        first_light_table(&mut text, contest);
    }
    text.push_str(BUILD);
    for contest in findings.of(Part::Build) {
        build_table(&mut text, contest);
    }
    text.push_str(LOAD);
    for contest in findings.of(Part::Load) {
        load_table(&mut text, contest);
    }
    text.push_str(WHOLE);
    for contest in findings.of(Part::Whole) {
        whole_table(&mut text, contest, findings);
    }
    text.push_str("\n## Against other programs\n\n");
    text.push_str(peers);
    text.push('\n');
    text
}

fn push(text: &mut String, line: &str) {
    text.push_str(line);
    text.push('\n');
}

const HEAD: &str = "\
# Benchmarks

`make bench` measures all of this in one run and writes this page; `make bench-peers` adds the section on other
programs. `make bench ARGS=--quick` takes meshes a tenth as heavy. `cargo bench -p etendue-benches` has single
questions in detail.

**The limit** is Embree itself: a bare loop over prepared records (robust mode, the same build quality, the same
buffers), with nothing of etendue in between. What etendue adds to it: rays from f64 to f32 relative to the scene's
origin, packets, every hit solved again in f64 with its normal, and a second look at what is suspicious.

Contestants take turns; figures are medians over the rounds, with the fastest and the slowest round in brackets, and
ratios are medians of each round's ratio. Tracing is timed on the processor clock of the thread, which other processes
disturb less than they do wall time; everything else is wall time on all cores.

";

const TRACING: &str = "
## Tracing, one thread

Pictures of 1024 x 1024 pixels; closest hits with normals. `blob` is a closed surface of small triangles, `soup`
triangles anywhere, `forest` instances of a mesh of 10 000 triangles. 16 samples: those of one pixel side by side, of
every sixteenth tile. Incoherent: from anywhere on the scene's sphere to anywhere in it. Occlusion: from the primary
hits to a lamp.
";

const THREADS: &str = "
## Two threads

How many times as fast two threads are as one, on primary rays. The threads' own processor time shows what they cost
each other (caches, memory, locks); wall time also what else the machine was doing.

";

const RENDERING: &str = "
## The whole render loop

`scenes/first-light.json` from camera to film, without loading, building and writing; wall time. The bare loop traces the
same rays in a scene of the same build quality.

";

const BUILD: &str = "
## Building

Wall time on all cores. Bytes are of the structure alone, without the vertices and indices that it shares.
";

const LOAD: &str = "
## Loading

Wall time from file to mesh on all cores, the file in the system's cache.
";

const WHOLE: &str = "
## From file to pixels

`etendue render` on a GLB, whole process: depth and normals of 1024 x 1024 pixels to an EXR. Beside it the least that
the same takes with Embree: reading the file's bytes, Embree's default build, and the limit's traversal on all cores.
";

fn goals_table(text: &mut String, goals: &[Goal]) {
    text.push_str("\n## Goals\n\n| what | goal | measured | |\n|---|---|---|---|\n");
    for Goal { what, goal, measured, met, why } in goals {
        let verdict = match met {
            Some(true) => "met".to_owned(),
            Some(false) if why.is_empty() => "**missed**".to_owned(),
            Some(false) => format!("**missed**: {why}"),
            None => String::new(),
        };
        push(text, &format!("| {what} | {goal} | {measured} | {verdict} |"));
    }
}

fn heading(text: &mut String, contest: &Contest) {
    let Contest { mesh, question, .. } = contest;
    let _ = write!(text, "\n### {mesh}: {question}\n\n");
}

fn traversal_table(text: &mut String, contest: &Contest) {
    heading(text, contest);
    let coherent = contest.find(names::LIMIT_PACKETS).is_some();
    text.push_str("| | Mrays/s |");
    if coherent {
        text.push_str(" of the limit in packets |");
    }
    text.push_str(" of the limit, single |\n|---|---|---|");
    text.push_str(if coherent { "---|\n" } else { "\n" });
    for Record { who, series, .. } in &contest.records {
        let _ = write!(text, "| {who} | {} |", rates(series, contest.items));
        if coherent {
            let _ = write!(text, " {} |", ratio(contest.speed(who, names::LIMIT_PACKETS)));
        }
        push(text, &format!(" {} |", ratio(contest.speed(who, names::LIMIT_SINGLE))));
    }
}

fn threads_table(text: &mut String, findings: &Findings) {
    push(text, &format!("| | | {} | {} |\n|---|---|---|---|", threads::PROCESSOR, threads::WALL));
    for contest in findings.of(Part::Threads) {
        for who in [names::LIMIT_PACKETS, names::EMBREE_PACKETS, names::BVH] {
            let speed = |clock| {
                let [one, two] = [1, 2].map(|n| threads::title(who, n, clock));
                ratio(contest.speed(&two, &one))
            };
            let (own, wall) = (speed(threads::PROCESSOR), speed(threads::WALL));
            push(text, &format!("| {} | {who} | {own} | {wall} |", contest.mesh));
        }
    }
}

fn first_light_table(text: &mut String, contest: &Contest) {
    text.push_str("| | Mrays/s | times the bare loop's time |\n|---|---|---|\n");
    for threads in [1, 2] {
        let limit = first_light::title(first_light::LIMIT, threads);
        for who in [first_light::LIMIT, first_light::DATA, first_light::PICTURE] {
            let who = first_light::title(who, threads);
            let Some(record) = contest.find(&who) else { continue };
            let times = ratio(contest.speed(&limit, &who));
            push(text, &format!("| {who} | {} | {times} |", rates(&record.series, contest.items)));
        }
    }
}

fn build_table(text: &mut String, contest: &Contest) {
    heading(text, contest);
    text.push_str("| | s | times the limit | bytes a triangle | MB |\n|---|---|---|---|---|\n");
    for Record { who, series, bytes } in &contest.records {
        let times = ratio(contest.speed(build::LIMIT, who));
        let (each, all) = match bytes {
            Some(bytes) => (
                format!("{:.0}", *bytes as f64 / contest.items),
                format!("{:.0}", *bytes as f64 / 1e6),
            ),
            None => ("failed".to_owned(), String::new()),
        };
        push(text, &format!("| {who} | {} | {times} | {each} | {all} |", seconds(series)));
    }
}

fn load_table(text: &mut String, contest: &Contest) {
    heading(text, contest);
    text.push_str("| | s | MB/s | MB |\n|---|---|---|---|\n");
    for Record { who, series, bytes } in &contest.records {
        let megabytes = bytes.unwrap_or(0) as f64 / 1e6;
        let rate = megabytes / series.median();
        push(text, &format!("| {who} | {} | {rate:.0} | {megabytes:.0} |", seconds(series)));
    }
    if let Some(speed) = contest.speed("OBJ", load::TOBJ) {
        let _ = write!(text, "\nOBJ loads {speed:.1} times as fast as by the crate tobj.\n");
    }
}

fn whole_table(text: &mut String, contest: &Contest, findings: &Findings) {
    heading(text, contest);
    text.push_str("| | s |\n|---|---|\n");
    for Record { who, series, .. } in &contest.records {
        push(text, &format!("| {who} | {} |", seconds(series)));
    }
    let number =
        |name: &str| findings.number(&format!("{}: {name}", contest.mesh)).unwrap_or(f64::NAN);
    let stages = whole::STAGES.map(|stage| format!("{stage} {:.3}", number(&format!("{stage} s"))));
    let _ = write!(text, "\nStages of one run (s), as it reports them: {}.\n", stages.join(", "));
    let megabytes = |name: &str| number(name) / 1e6;
    text.push_str("\n| memory after (MB) | private | mapped files |\n|---|---|---|\n");
    for stage in whole::HELD {
        let [private, mapped] =
            ["private", "mapped"].map(|kind| megabytes(&format!("{stage} {kind}")));
        push(text, &format!("| {stage} | {private:.0} | {mapped:.0} |"));
    }
    let _ = write!(
        text,
        "\nThe file has {:.0} MB and the BVH {:.0} MB; the process held {:.0} MB at its peak. Embree's bare \
         loop, built in low quality, holds {:.0} MB at its peak by its own count.\n",
        megabytes("file"),
        megabytes("bvh_bytes"),
        megabytes("peak_memory_bytes"),
        megabytes(whole::EMBREE_PEAK)
    );
}

fn ratio(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))
}

/// Median, fastest and slowest as millions a second.
fn rates(series: &Timings, items: f64) -> String {
    let rate = |seconds: f64| items / seconds / 1e6;
    let [middle, fast, slow] = [series.median(), series.fastest(), series.slowest()].map(rate);
    format!("{middle:.2} ({slow:.2} to {fast:.2})")
}

/// Median, fastest and slowest in seconds.
fn seconds(series: &Timings) -> String {
    let digits = if series.median() < 0.1 { 4 } else { 3 };
    let [middle, fast, slow] = [series.median(), series.fastest(), series.slowest()];
    format!("{middle:.digits$} ({fast:.digits$} to {slow:.digits$})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_wrote_is_kept() {
        let [begin, end] = PEERS;
        let old = format!("# Page\n{begin}\n| peers |\n{end}\nrest");
        assert_eq!(kept(&old), format!("{begin}\n| peers |\n{end}"));
        assert!(kept("").contains("make bench-peers"));
    }
}
