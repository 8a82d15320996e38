//! The report as one page of HTML, with its figures in it.

use std::fmt::Write;

use super::WaveReport;
use super::figures::figures;

/// Colours of page and letters in the reader's light and dark theme, as those of the charts.
const STYLE: &str = "body{font-family:sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;\
color-scheme:light dark}pre{overflow-x:auto;font-size:12px}figure{margin:1.5em 0}\
svg{max-width:100%;height:auto}";

/// The page. `above` is text that stands before the waves, such as the lens' table, and `drawings` are
/// SVG documents of the lens.
#[must_use]
pub fn page(title: &str, above: &str, drawings: &[String], report: &WaveReport) -> String {
    let mut html = String::new();
    let title = escaped(title);
    let text = format!("{above}{report}");
    // A string takes all that is written to it.
    let _ = write!(
        html,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n"
    );
    let own = figures(report);
    for svg in drawings.iter().chain(own.iter().map(|(_, svg)| svg)) {
        // Within a page an SVG element stands without a declaration of its own.
        let start = svg.find("<svg").unwrap_or(0);
        let _ = writeln!(html, "<figure>{}</figure>", &svg[start..]);
    }
    let _ = writeln!(html, "<pre>{}</pre>\n</body></html>", escaped(&text));
    html
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
