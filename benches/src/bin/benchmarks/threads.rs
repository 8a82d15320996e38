//! Tracing on one thread and on two.

use etendue_bench::timing::{Turn, take_turns, wall};
use etendue_benches::contest::time;
use etendue_benches::effort::Effort;
use etendue_benches::field::{Field, Rays, contestants, names};

use crate::findings::{Contest, Part, Record};

/// The clocks, as the page shows them.
pub(crate) const PROCESSOR: &str = "busiest thread's processor time";
pub(crate) const WALL: &str = "wall time";

/// The contestants.
const SHOWN: [&str; 3] = [names::LIMIT_PACKETS, names::EMBREE_PACKETS, names::BVH];

/// Name of a contestant on so many threads.
pub(crate) fn title(name: &str, threads: usize, clock: &str) -> String {
    format!("{name}, {threads}, {clock}")
}

pub(crate) fn contest(effort: Effort, mesh: &str, field: &Field, rays: &Rays) -> Contest {
    eprintln!("  one thread and two");
    let all = contestants(field, rays);
    let shown: Vec<_> = all.iter().filter(|(name, _)| SHOWN.contains(name)).collect();
    let mut titles = Vec::new();
    let mut turns: Vec<Turn<'_>> = Vec::new();
    for (name, contestant) in shown {
        for threads in [1, 2] {
            titles.push(title(name, threads, PROCESSOR));
            turns.push(Box::new(move || time(&**contestant, threads, 1)));
            titles.push(title(name, threads, WALL));
            turns.push(Box::new(move || wall(|| time(&**contestant, threads, 1)).0));
        }
    }
    let series = take_turns(effort.rounds(), &mut turns);
    let records =
        titles.into_iter().zip(series).map(|(who, series)| Record { who, series, bytes: None });
    Contest {
        part: Part::Threads,
        mesh: mesh.to_owned(),
        question: "two threads".to_owned(),
        items: rays.singles.len() as f64,
        records: records.collect(),
    }
}
