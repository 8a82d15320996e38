//! The page: headings, charts with what to pick and when, and small tables.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use etendue_bench::timing;
use etendue_chart::{Chart, Theme};

/// The folder of the charts, below that of the documents, in which the page has one of its own.
const IMAGES: &str = "images/speed-and-accuracy";

/// The page while it is made.
#[derive(Debug)]
pub(crate) struct Page {
    folder: PathBuf,
    text: String,
}

impl Page {
    /// A page of the documents in `folder`.
    pub(crate) fn new(folder: &Path, rounds: usize) -> anyhow::Result<Self> {
        let images = folder.join(IMAGES);
        std::fs::create_dir_all(&images).with_context(|| format!("{}", images.display()))?;
        let mut text = HEAD.to_owned();
        for line in timing::describe().into_iter().chain([timing::checkout()]) {
            let _ = writeln!(text, "- {line}");
        }
        let _ = writeln!(text, "- Rounds: {rounds}, unless a section says otherwise");
        Ok(Self { folder: folder.to_owned(), text })
    }

    /// Begins a section.
    pub(crate) fn heading(&mut self, title: &str) {
        eprintln!("{title}");
        let _ = write!(self.text, "\n## {title}\n");
    }

    /// A paragraph.
    pub(crate) fn paragraph(&mut self, words: &str) {
        let _ = write!(self.text, "\n{}\n", wrapped(words));
    }

    /// A chart under the name of its file, with what to pick and when.
    pub(crate) fn chart(&mut self, stem: &str, chart: &Chart, advice: &str) -> anyhow::Result<()> {
        let path = self.folder.join(IMAGES).join(format!("{stem}.svg"));
        let svg = chart.svg(Theme::Reader);
        std::fs::write(&path, svg).with_context(|| format!("{}", path.display()))?;
        let _ = write!(self.text, "\n![{}](../{IMAGES}/{stem}.svg)\n", chart.title);
        self.paragraph(advice);
        Ok(())
    }

    /// Rows under titles.
    pub(crate) fn table(&mut self, titles: &[&str], rows: &[Vec<String>]) {
        let _ = write!(self.text, "\n| {} |\n", titles.join(" | "));
        let _ = writeln!(self.text, "|{}", "---|".repeat(titles.len()));
        for row in rows {
            let _ = writeln!(self.text, "| {} |", row.join(" | "));
        }
    }

    /// Writes the page and tells where it is.
    pub(crate) fn write(&self) -> anyhow::Result<PathBuf> {
        let path = self.folder.join("measurements/speed-and-accuracy.md");
        std::fs::write(&path, &self.text).with_context(|| format!("{}", path.display()))?;
        Ok(path)
    }
}

/// Lines of at most 120 characters.
fn wrapped(words: &str) -> String {
    let mut text = String::new();
    let mut length = 0;
    for word in words.split_whitespace() {
        let more = word.chars().count();
        if length > 0 && length + 1 + more > 120 {
            text.push('\n');
            length = 0;
        } else if length > 0 {
            text.push(' ');
            length += 1;
        }
        text.push_str(word);
        length += more;
    }
    text
}

const HEAD: &str = "\
# Speed and accuracy

`make docs-charts` measures all of this in one run and writes this page. [`etendue bench`](../reference/bench.md) draws the same charts
of your own scene on your own machine, and its page says what the columns and marks mean. Left is fast, low is accurate;
an error of exactly zero has a place of its own below the axis. Contestants take turns; times are medians of the rounds.

";
