//! Trajectories of the TUM RGB-D benchmark: `timestamp tx ty tz qx qy qz qw`, lines of `#` are comments
//! (Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012).

use etendue_camera::{Convention, Maps, PoseSpec};

use super::{Station, numbers};

pub(super) fn read(
    text: &str,
    (maps, convention): (Maps, Convention),
) -> Result<Vec<Station>, String> {
    let mut stations = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> =
            line.split([' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
        if words.is_empty() || words[0].starts_with('#') {
            continue;
        }
        if words.len() != 8 {
            let count = words.len();
            return Err(format!(
                "has {count} words in line {number}; TUM's are timestamp tx ty tz qx qy qz qw"
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
            maps,
            convention,
        };
        stations.push(Station { time: Some(time), ..Station::new(pose) });
    }
    Ok(stations)
}
