//! Trajectories of a pose a line: those of the TUM RGB-D benchmark, `timestamp tx ty tz qx qy qz qw` (Sturm et al.,
//! "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012), and those of KITTI's odometry benchmark, the twelve
//! numbers of `[R | t]` by rows (Geiger et al., "Are we ready for Autonomous Driving?", 2012). Lines of `#` are comments.

use etendue_camera::{Convention, Maps, PoseSpec};

use super::Station;
use super::trajectory::numbers;

/// Words of a line of KITTI's.
const KITTI_WORDS: usize = 12;

/// The lines that say something, with their numbers from 1, in words.
fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let words = |line| str::split(line, [' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
    let lines = (1..).zip(text.lines()).map(move |(number, line)| (number, words(line)));
    lines.filter(|(_, words): &(_, Vec<&str>)| !words.first().is_none_or(|w| w.starts_with('#')))
}

/// Whether the first line that says something has as many words as KITTI's.
pub(super) fn are_kittis(text: &str) -> bool {
    lines(text).next().is_some_and(|(_, words)| words.len() == KITTI_WORDS)
}

pub(super) fn read_tum(text: &str, axes: (Maps, Convention)) -> Result<Vec<Station>, String> {
    let mut stations = Vec::new();
    for (number, words) in lines(text) {
        if words.len() != 8 {
            let count = words.len();
            return Err(format!(
                "has {count} words in line {number}; TUM's are timestamp tx ty tz qx qy qz qw, and KITTI's, \
                 with `format` kitti, the 12 numbers of [R | t] by rows"
            ));
        }
        let [time, x, y, z, a, b, c, d] = numbers(&words, number)?;
        if let Some(before) = stations.last().and_then(|last: &Station| last.time)
            && time < before
        {
            return Err(format!(
                "has the time {time} in line {number}, after {before}: sort the lines by their times"
            ));
        }
        let pose = PoseSpec::Quaternion {
            quaternion: [a, b, c, d],
            translation: [x, y, z],
            maps: axes.0,
            convention: axes.1,
        };
        stations.push(Station { time: Some(time), ..Station::new(pose) });
    }
    Ok(stations)
}

pub(super) fn read_kitti(text: &str, axes: (Maps, Convention)) -> Result<Vec<Station>, String> {
    let station = |(number, words): (usize, Vec<&str>)| {
        if words.len() != KITTI_WORDS {
            let count = words.len();
            return Err(format!(
                "has {count} words in line {number}; KITTI's are the 12 numbers of [R | t] by rows"
            ));
        }
        let all: [f64; KITTI_WORDS] = numbers(&words, number)?;
        Ok(Station::of_rows(&all, axes))
    };
    lines(text).map(station).collect()
}
