//! Cells in columns.

use std::fmt;

/// A value, rounded for a person and in full for a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    /// `None` leaves the column to spreadsheets.
    shown: Option<String>,
    full: String,
    is_number: bool,
}

impl Cell {
    /// A word or a sentence.
    pub fn word(word: impl Into<String>) -> Self {
        let full = word.into();
        Self { shown: Some(full.clone()), full, is_number: false }
    }

    /// A count.
    #[must_use]
    pub fn count(count: u64) -> Self {
        Self::number(count, count.to_string())
    }

    /// A number, or a word in the place of one, and how a person wants to read it.
    pub fn number(value: impl fmt::Display, shown: impl Into<String>) -> Self {
        Self { shown: Some(shown.into()), full: value.to_string(), is_number: true }
    }

    /// A number where there is none.
    #[must_use]
    pub fn none() -> Self {
        Self::number("", "-")
    }

    /// A value for spreadsheets alone.
    pub fn hidden(full: impl fmt::Display) -> Self {
        Self { shown: None, full: full.to_string(), is_number: true }
    }
}

/// Rows of cells under titles.
///
/// In a terminal columns of numbers stand to the right, others to the left, two blanks apart.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    titles: Vec<String>,
    units: Vec<String>,
    rows: Vec<Vec<Cell>>,
    indent: usize,
    first_width: usize,
}

impl Table {
    /// An empty table.
    #[must_use]
    pub fn new(titles: &[&str]) -> Self {
        let titles = titles.iter().map(|&title| title.to_owned()).collect();
        Self { titles, ..Self::default() }
    }

    /// An empty list of names and values, which stand side by side from column `width` on, or farther.
    #[must_use]
    pub fn list(width: usize) -> Self {
        Self { first_width: width.saturating_sub(2), ..Self::default() }
    }

    /// A table of rows that name their columns; all name the same.
    #[must_use]
    pub fn of_rows(rows: Vec<Vec<(&'static str, Cell)>>) -> Self {
        let first = rows.first().into_iter().flatten();
        let mut table = Self::new(&first.map(|(title, _)| *title).collect::<Vec<_>>());
        rows.into_iter().for_each(|row| table.push(row.into_iter().map(|(_, cell)| cell)));
        table
    }

    /// Returns the table with a unit below each title.
    #[must_use]
    pub fn with_units(self, units: &[&str]) -> Self {
        Self { units: units.iter().map(|&unit| unit.to_owned()).collect(), ..self }
    }

    /// Returns the table with lines that begin with so many blanks in a terminal.
    #[must_use]
    pub fn indented(self, indent: usize) -> Self {
        Self { indent, ..self }
    }

    /// Adds a row.
    pub fn push(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Adds a name and a value to a list.
    pub fn put(&mut self, name: impl Into<String>, value: impl fmt::Display) {
        self.push([Cell::word(name), Cell::word(value.to_string())]);
    }

    /// Columns that people see.
    fn shown(&self) -> Vec<usize> {
        let count = self.rows.iter().map(Vec::len).max().unwrap_or(0).max(self.titles.len());
        let is_shown = |column: &usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(*column));
            cells.into_iter().all(|cell| cell.shown.is_some())
        };
        (0..count).filter(is_shown).collect()
    }

    /// Columns side by side, a row a line.
    #[must_use]
    pub fn text(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let shown = self.shown();
        // Heads and cells as they are printed.
        let head = |words: &[String]| -> Option<Vec<String>> {
            let word =
                |&column: &usize| words.get(column).map_or("", |word| word).replace('_', " ");
            (!words.is_empty()).then(|| shown.iter().map(word).collect())
        };
        let cells = |row: &Vec<Cell>| -> Vec<String> {
            let cell = |&column: &usize| row.get(column).and_then(|cell| cell.shown.clone());
            let words = shown.iter().map(|column| cell(column).unwrap_or_default());
            words.map(|word| word.replace('\n', "\\n")).collect()
        };
        let heads = [head(&self.titles), head(&self.units)];
        let lines: Vec<Vec<String>> =
            heads.into_iter().flatten().chain(self.rows.iter().map(cells)).collect();
        // How wide columns are, and on which side of them cells stand.
        let length = |text: &String| text.chars().count();
        let mut widths: Vec<usize> = (0..shown.len())
            .map(|k| lines.iter().map(|line| length(&line[k])).max().unwrap_or(0))
            .collect();
        if let Some(first) = widths.first_mut() {
            *first = self.first_width.max(*first);
        }
        let is_number = |column: &usize| {
            self.rows.iter().all(|row| row.get(*column).is_some_and(|cell| cell.is_number))
        };
        let sides: Vec<bool> = shown.iter().map(is_number).collect();
        let mut text = String::new();
        for line in &lines {
            let mut words = String::new();
            for (k, (cell, &width)) in line.iter().zip(&widths).enumerate() {
                let gap = if k == 0 { self.indent } else { 2 };
                words.extend(std::iter::repeat_n(' ', gap));
                words +=
                    &if sides[k] { format!("{cell:>width$}") } else { format!("{cell:<width$}") };
            }
            text += words.trim_end();
            text.push('\n');
        }
        text
    }

    /// A table of GitHub's Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let shown = self.shown();
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let title = |&column: &usize| self.titles.get(column).cloned().unwrap_or_default();
        let mut text = line(shown.iter().map(title).collect());
        text += &format!("|{}\n", "---|".repeat(shown.len()));
        for row in &self.rows {
            let cell = |&column: &usize| {
                let words = row.get(column).and_then(|cell| cell.shown.as_deref()).unwrap_or("");
                words.replace('|', "\\|").replace('\n', " ")
            };
            text += &line(shown.iter().map(cell).collect());
        }
        text
    }

    /// Values in full with commas between, titles first.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut csv = self.titles.join(",") + "\n";
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(|cell| quoted(&cell.full)).collect();
            csv += &(cells.join(",") + "\n");
        }
        csv
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}

/// A value that RFC 4180 reads as one.
fn quoted(value: &str) -> String {
    match value.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", value.replace('"', "\"\"")),
        false => value.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_forms_have_the_same_rows() {
        let row = |name: &str, value: f64, shown: &str| {
            vec![
                ("name", Cell::word(name)),
                ("all_digits", Cell::hidden(value)),
                ("the_error", Cell::number(value, shown)),
            ]
        };
        let table = Table::of_rows(vec![row("a, b", 0.123456789, "1.2e-1"), row("c|d", 0.0, "0")]);
        assert_eq!(
            table.csv(),
            "name,all_digits,the_error\n\"a, b\",0.123456789,0.123456789\nc|d,0,0\n"
        );
        assert_eq!(table.text(), "name  the error\na, b     1.2e-1\nc|d           0\n");
        assert_eq!(
            table.markdown(),
            "| name | the_error |\n|---|---|\n| a, b | 1.2e-1 |\n| c\\|d | 0 |\n"
        );
        assert_eq!(Table::new(&["name"]).text(), "");
    }

    #[test]
    fn lists_line_up_and_a_name_adds_no_lines() {
        let mut list = Table::list(6);
        list.put("a", "1\nerror: 2");
        list.put("", "2");
        assert_eq!(list.to_string(), "a     1\\nerror: 2\n      2\n");
        list.put("a longer name", 3);
        assert_eq!(list.indented(2).text().lines().last(), Some("  a longer name  3"));
    }

    #[test]
    fn units_stand_below_titles_and_dashes_with_numbers() {
        let mut table = Table::new(&["lens", "focal length"]).with_units(&["", "mm"]);
        table.push([Cell::word("first"), Cell::number(50, "50")]);
        table.push([Cell::word("second"), Cell::none()]);
        let lines = [
            "lens    focal length",
            "                  mm",
            "first             50",
            "second             -",
        ];
        assert_eq!(table.text().lines().collect::<Vec<_>>(), lines);
    }
}
