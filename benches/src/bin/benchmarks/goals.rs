//! The goals, what was measured of each, and why those that are missed are missed.

use etendue_benches::effort::Effort;
use etendue_benches::field::names;

use crate::findings::{Findings, Part};
use crate::{build, first_light, load, threads, traversal, whole};

/// A goal and how far it is met.
#[derive(Debug)]
pub(crate) struct Goal {
    pub(crate) what: String,
    /// In words.
    pub(crate) goal: String,
    /// The figure, for people.
    pub(crate) measured: String,
    /// Nothing when it was not measured.
    pub(crate) met: Option<bool>,
    /// Shown when it is missed: where the time goes, as a profile shows it.
    pub(crate) why: &'static str,
}

/// A ratio that has to be at least, or at most, so much.
enum Bound {
    AtLeast(f64),
    AtMost(f64),
}

fn goal(what: String, bound: Bound, of: &str, figure: Option<f64>, why: &'static str) -> Goal {
    let (goal, met) = match bound {
        Bound::AtLeast(least) => (format!("≥ {least:.2} {of}"), figure.map(|f| f >= least)),
        Bound::AtMost(most) => (format!("≤ {most:.2} {of}"), figure.map(|f| f <= most)),
    };
    let measured = figure.map_or_else(|| "not measured".to_owned(), |f| format!("{f:.2}"));
    Goal { what, goal, measured, met, why }
}

/// All goals that one run can judge; those against other programs are in their own table.
pub(crate) fn all(effort: Effort, findings: &Findings) -> Vec<Goal> {
    let mut goals = Vec::new();
    for triangles in effort.blobs() {
        let mesh = crate::blob_name(triangles);
        tracing(&mesh, findings, &mut goals);
    }
    for triangles in effort.blobs() {
        let mesh = crate::blob_name(triangles);
        building(&mesh, findings, &mut goals);
        scaling(&mesh, findings, &mut goals);
    }
    rendering(findings, &mut goals);
    let [_, heavy] = effort.blobs();
    whole_process(&crate::blob_name(heavy), findings, &mut goals);
    goals
}

const REFINING: &str = "rays come in f64 and are turned and rounded to f32 for Embree, and each hit's \
                        corners are gathered from the mesh and solved for in f64: about equal shares, \
                        by profile, which weigh the more the faster the packets are";

fn tracing(mesh: &str, findings: &Findings, goals: &mut Vec<Goal>) {
    let speed =
        |question, who, other| findings.contest(Part::Traversal, mesh, question)?.speed(who, other);
    let packets = (names::EMBREE_PACKETS, names::LIMIT_PACKETS);
    for (question, least) in [(traversal::PRIMARY, 0.80), (traversal::SAMPLES, 0.95)] {
        goals.push(goal(
            format!("depth and normals in f64, {question}, {mesh}"),
            Bound::AtLeast(least),
            "of the limit in packets",
            speed(question, packets.0, packets.1),
            REFINING,
        ));
    }
    goals.push(goal(
        format!("incoherent rays, single, {mesh}"),
        Bound::AtLeast(0.95),
        "of the limit",
        speed(traversal::INCOHERENT, names::EMBREE_SINGLE, names::LIMIT_SINGLE),
        INCOHERENT,
    ));
    for question in [traversal::PRIMARY, traversal::INCOHERENT] {
        goals.push(goal(
            format!("`bvh`, {question}, {mesh}"),
            Bound::AtLeast(0.80),
            "of Embree, single, robust",
            speed(question, names::BVH, names::LIMIT_SINGLE),
            BVH,
        ));
    }
    goals.push(goal(
        format!("`bvh` in coherent packets, {mesh}"),
        Bound::AtLeast(0.80),
        "of Embree's packets",
        speed(traversal::PRIMARY, names::BVH, names::LIMIT_PACKETS),
        BVH_PACKETS,
    ));
}

const INCOHERENT: &str = "each hit's triangle is fetched anew for f64, from memory that no neighbour \
                          has touched: indices, then three vertices, while the next ray is traced; \
                          they push parts of Embree's structure out of the caches";
const BVH: &str = "beside traversal there is the exact f64 test of each hit";
const BVH_PACKETS: &str = "nodes are tested for the bundle as a whole, but triangles one after the other, \
                           and each hit is measured in f64";

fn building(mesh: &str, findings: &Findings, goals: &mut Vec<Goal>) {
    let contest = findings.contest(Part::Build, mesh, build::QUESTION);
    let longer = contest.and_then(|c| c.speed(build::BVH, build::LIMIT)).map(|speed| 1.0 / speed);
    goals.push(goal(
        format!("`bvh`, build, {mesh}"),
        Bound::AtMost(1.50),
        "times Embree's",
        longer,
        BUILD,
    ));
}

const BUILD: &str = "the tree is built in two forms: binary by the binned surface-area heuristic, then \
                     folded into nodes of eight";

fn scaling(mesh: &str, findings: &Findings, goals: &mut Vec<Goal>) {
    let contest = findings.contest(Part::Threads, mesh, "two threads");
    let who = names::EMBREE_PACKETS;
    let [one, two] = [1, 2].map(|threads| threads::title(who, threads, threads::PROCESSOR));
    goals.push(goal(
        format!("two threads, {who}, {mesh}"),
        Bound::AtLeast(1.90),
        "times one",
        contest.and_then(|c| c.speed(&two, &one)),
        SCALING,
    ));
}

const SCALING: &str =
    "the limit's own figure is in the table below: what it loses too is the machine's";

fn rendering(findings: &Findings, goals: &mut Vec<Goal>) {
    use first_light::{DATA, LIMIT, QUESTION, SCENE, title};
    let contest = findings.contest(Part::FirstLight, SCENE, QUESTION);
    for threads in [1, 2] {
        let [ours, limit] = [DATA, LIMIT].map(|who| title(who, threads));
        goals.push(goal(
            format!("the whole render loop of `first-light.json`, {}", title(DATA, threads)),
            Bound::AtMost(1.30),
            "times the bare loop over the same rays",
            contest.and_then(|c| c.speed(&ours, &limit)).map(f64::recip),
            RENDERING,
        ));
    }
}

const RENDERING: &str = "the f64 solution with the fetching of corners adds most, then the first touch of the \
                         film's memory, then camera rays and layers";

fn whole_process(mesh: &str, findings: &Findings, goals: &mut Vec<Goal>) {
    let contest = findings.contest(Part::Whole, mesh, whole::QUESTION);
    let longer = contest.and_then(|c| c.speed(whole::ETENDUE, whole::LEAST)).map(f64::recip);
    goals.push(goal(
        format!("file to pixels, GLB, {mesh}"),
        Bound::AtMost(1.10),
        "times reading, Embree's default build and the limit",
        longer,
        WHOLE,
    ));
    let loading = findings.contest(Part::Load, mesh, load::QUESTION);
    goals.push(goal(
        format!("OBJ, load, {mesh}"),
        Bound::AtLeast(1.0),
        "of the speed of the crate tobj",
        loading.and_then(|c| c.speed("OBJ", load::TOBJ)),
        "",
    ));
    let number = |name: &str| findings.number(&format!("{mesh}: {name}"));
    let needed = number("file").zip(number("bvh_bytes")).map(|(file, bvh)| file + bvh);
    let held = number("peak_memory_bytes").zip(needed).map(|(peak, needed)| peak / needed);
    goals.push(goal(
        format!("peak memory, GLB, {mesh}"),
        Bound::AtMost(1.15),
        "times file and BVH",
        held,
        MEMORY,
    ));
}

const WHOLE: &str = "the stages below add what the other side leaves out: checking the model, the scene's \
                     fingerprint, the layers and the EXR";
const MEMORY: &str = "Embree's own build holds more while it runs than after (below), beside the layers \
                      of the picture and the program itself";
