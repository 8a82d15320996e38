//! Tables of measured curves: CSV and `.spd` files, and refractiveindex.info's `.yml`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Curve;

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Column {
    /// Counted from 1, behind the wavelengths.
    Number(u32),
    /// By the header's word.
    Name(String),
}

/// A table of numbers over wavelengths (nm).
#[derive(Debug, Clone, PartialEq)]
pub struct CurveTable {
    /// The header's words, those of the values alone; empty where there is no header.
    names: Vec<String>,
    /// Rows: a wavelength and its values.
    rows: Vec<Vec<f64>>,
}

/// The most rows of a table.
const MOST_ROWS: usize = 1_000_000;

impl CurveTable {
    /// Reads rows of numbers that commas, semicolons, tabs, colons or spaces part. Lines that begin with `#` or `//` are
    /// notes; words before the first row are its header.
    ///
    /// # Errors
    ///
    /// A sentence with the line that is no row.
    pub fn read(text: &str) -> Result<Self, String> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut table = Self { names: Vec::new(), rows: Vec::new() };
        for (number, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') || line.starts_with("//") {
                continue;
            }
            let parts = parts_of(line);
            let numbers: Vec<f64> = parts.iter().map_while(|p| p.parse().ok()).collect();
            if numbers.len() < parts.len() {
                if table.rows.is_empty() && numbers.is_empty() {
                    table.names = parts.into_iter().skip(1).map(str::to_owned).collect();
                    continue;
                }
                let word = parts[numbers.len()];
                return Err(format!("line {}: \"{word}\" is no number", number + 1));
            }
            let width = table.rows.first().map_or(numbers.len(), Vec::len);
            if numbers.len() < 2 || numbers.len() != width {
                return Err(format!(
                    "line {}: {} numbers, where a row has a wavelength and {} values",
                    number + 1,
                    numbers.len(),
                    width.max(2) - 1
                ));
            }
            if table.rows.len() == MOST_ROWS {
                return Err(format!("has more than {MOST_ROWS} rows"));
            }
            table.rows.push(numbers);
        }
        match table.rows.is_empty() {
            true => Err("has no rows: each is a wavelength (nm) and its values".to_owned()),
            false => Ok(table),
        }
    }

    /// Names of the columns of values: the header's words, or their numbers from 1.
    #[must_use]
    pub fn titles(&self) -> Vec<String> {
        let count = self.rows[0].len() - 1;
        let title = |k: usize| self.names.get(k).cloned().unwrap_or_else(|| (k + 1).to_string());
        (0..count).map(title).collect()
    }

    /// A column as a curve.
    ///
    /// # Errors
    ///
    /// A sentence when there is no such column, several and none is named, or its numbers make no curve.
    pub fn column(&self, wanted: Option<&Column>) -> Result<Curve, String> {
        let count = self.rows[0].len() - 1;
        let known = || match self.names.is_empty() {
            true => format!("1 to {count}"),
            false => self.names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", "),
        };
        let index = match wanted {
            None if count == 1 => 0,
            None => {
                return Err(format!(
                    "has {count} columns\nhint: name one by `column`: {}",
                    known()
                ));
            }
            Some(Column::Number(number)) => match (*number as usize).checked_sub(1) {
                Some(index) if index < count => index,
                _ => return Err(format!("has no column {number}; there are {}", known())),
            },
            Some(Column::Name(name)) => {
                let same = |known: &String| known.trim() == name.trim();
                match self.names.iter().position(same).filter(|index| *index < count) {
                    Some(index) => index,
                    None => return Err(format!("has no column \"{name}\"; there are {}", known())),
                }
            }
        };
        let samples = self.rows.iter().map(|row| [row[0], row[index + 1]]).collect();
        Curve::sampled(samples).map_err(|e| e.to_string())
    }
}

/// The cells of a line.
fn parts_of(line: &str) -> Vec<&str> {
    for separator in [',', ';', '\t', ':'] {
        if line.contains(separator) {
            return line
                .split(separator)
                .map(|part| part.trim().trim_matches('"').trim())
                .filter(|part| !part.is_empty())
                .collect();
        }
    }
    line.split_whitespace().collect()
}

/// n and k of a refractiveindex.info `.yml` over wavelengths (nm), where each has a table.
///
/// # Errors
///
/// A sentence when the file has no table of n or none of k, or a row that is no numbers.
pub fn refractive_index_info(text: &str) -> Result<[Curve; 2], String> {
    let [mut n, mut k]: [Vec<[f64; 2]>; 2] = Default::default();
    let mut kind = None;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let entry = line.trim_start_matches('-').trim();
        if let Some(word) = entry.strip_prefix("type:") {
            kind = Some(word.trim().trim_matches(['"', '\'']).to_owned());
            continue;
        }
        let cells: Vec<&str> = line.split_whitespace().collect();
        let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.parse().ok()).collect();
        let Some(numbers) = numbers.filter(|numbers| !numbers.is_empty()) else { continue };
        // Micrometres in these files.
        let nm = numbers[0] * 1e3;
        match (kind.as_deref(), &numbers[..]) {
            (Some("tabulated nk"), &[_, a, b]) => {
                n.push([nm, a]);
                k.push([nm, b]);
            }
            (Some("tabulated n"), &[_, a]) => n.push([nm, a]),
            (Some("tabulated k"), &[_, b]) => k.push([nm, b]),
            (Some("tabulated nk" | "tabulated n" | "tabulated k"), _) => {
                return Err(format!(
                    "line {}: {} numbers in a row of \"{}\"",
                    number + 1,
                    numbers.len(),
                    kind.unwrap_or_default()
                ));
            }
            _ => {}
        }
    }
    for (name, table) in [("n", &n), ("k", &k)] {
        if table.is_empty() {
            return Err(format!(
                "has no table of {name} (\"type: tabulated nk\" or \"tabulated {name}\"): a metal \
                 needs n and k\nhint: choose an entry of refractiveindex.info that has both"
            ));
        }
    }
    let curve = |samples| Curve::sampled(samples).map_err(|e| e.to_string());
    Ok([curve(n)?, curve(k)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_all_kinds_are_read() {
        for text in [
            "400,0.5\n500,0.7\n",
            "\u{feff}nm;value\r\n400;0.5\r\n500;0.7\r\n",
            "# note\n400 0.5\n500\t0.7\n",
            "400:0.5\n500:0.7",
            "\"wavelength (nm)\",\"r\"\n400, 0.5\n\n500, 0.7\n",
        ] {
            let curve = CurveTable::read(text).and_then(|table| table.column(None));
            let curve = curve.unwrap_or_else(|why| panic!("{text}: {why}"));
            assert!((curve.at(450.0).unwrap() - 0.6).abs() < 1e-12);
        }
        for (text, word) in [
            ("", "no rows"),
            ("400,0.5\n500,x\n", "line 2: \"x\""),
            ("400,0.5\n500\n", "line 2: 1 numbers"),
        ] {
            assert!(CurveTable::read(text).unwrap_err().contains(word), "{text}");
        }
    }

    #[test]
    fn metals_of_the_data_base_are_read_and_those_that_lack_k_are_refused() {
        let text = "REFERENCES: \"x\"\nDATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.5 2.0\n        0.7 0.2 3.5\n";
        let [n, k] = refractive_index_info(text).unwrap();
        assert_eq!((n.at(400.0), k.at(700.0)), (Some(1.5), Some(3.5)));
        let only =
            text.replace("tabulated nk", "tabulated n").replace(" 2.0", "").replace(" 3.5", "");
        assert!(refractive_index_info(&only).unwrap_err().contains("no table of k"));
        assert!(refractive_index_info("DATA:").unwrap_err().contains("no table of n"));
    }
}
