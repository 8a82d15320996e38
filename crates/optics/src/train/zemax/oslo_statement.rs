//! The text of OSLO's files as statements.

use super::ZemaxError;

/// One statement with its line.
pub(super) struct Statement {
    pub(super) line: usize,
    pub(super) words: Vec<String>,
}

impl Statement {
    pub(super) fn word(&self) -> &str {
        &self.words[0]
    }

    pub(super) fn text(&self, i: usize) -> Option<&str> {
        self.words.get(i).map(String::as_str)
    }

    pub(super) fn error(&self, why: impl std::fmt::Display) -> ZemaxError {
        ZemaxError::new(self.line, format!("{}: {why}", self.words[0]))
    }

    pub(super) fn number(&self, i: usize) -> Result<f64, ZemaxError> {
        let word = self.text(i).ok_or_else(|| self.error("a number is missing"))?;
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.error(format!("`{word}` is not a number")))
    }

    pub(super) fn numbers(&self) -> Result<Vec<f64>, ZemaxError> {
        (1..self.words.len()).map(|i| self.number(i)).collect()
    }

    pub(super) fn index(&self, i: usize) -> Result<usize, ZemaxError> {
        let word = self.text(i).ok_or_else(|| self.error("a whole number is missing"))?;
        word.parse().map_err(|_| self.error(format!("`{word}` is not a whole number")))
    }

    /// A surface that is named by its number or, below 0, from `own` on; one before `own`, or itself.
    pub(super) fn surface(&self, i: usize, own: usize) -> Result<usize, ZemaxError> {
        let word = self.text(i).ok_or_else(|| self.error("a surface is missing"))?;
        let error = || self.error(format!("`{word}` is no surface up to its own, {own}"));
        let named: isize = word.parse().map_err(|_| error())?;
        let found =
            if named < 0 { own.checked_add_signed(named) } else { usize::try_from(named).ok() };
        found.filter(|found| *found <= own).ok_or_else(error)
    }
}

/// A text taken apart.
pub(super) fn statements(text: &str) -> Result<Vec<Statement>, ZemaxError> {
    let mut found = Vec::new();
    for (line, written) in text.lines().enumerate().map(|(i, line)| (i + 1, line)) {
        let mut words: Vec<String> = Vec::new();
        let mut end = |words: &mut Vec<String>| {
            if let Some(first) = words.first_mut() {
                *first = first.to_ascii_uppercase();
                found.push(Statement { line, words: std::mem::take(words) });
            }
        };
        let mut rest = written.trim_start();
        while !rest.is_empty() && !rest.starts_with("//") {
            if let Some(quoted) = rest.strip_prefix('"') {
                let (word, after) = quoted.split_once('"').ok_or_else(|| {
                    ZemaxError::new(line, "a text in quotes does not end: the line is cut short")
                })?;
                words.push(word.to_owned());
                rest = after;
            } else if let Some(after) = rest.strip_prefix(';') {
                end(&mut words);
                rest = after;
            } else {
                let stop = rest.find([' ', '\t', ';', '"']).unwrap_or(rest.len());
                words.push(rest[..stop].to_owned());
                rest = &rest[stop..];
            }
            rest = rest.trim_start();
        }
        end(&mut words);
    }
    Ok(found)
}
