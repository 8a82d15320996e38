//! The table of presets in `docs/reference/sensors.md`, from what `etendue sensor --json` lists.

use std::fmt::Write as _;

use serde_json::Value;

/// The figures that are shown, by their keys, and the titles of their columns.
const COLUMNS: [(&str, &str); 9] = [
    ("resolution", "pixels"),
    ("pixel_pitch", "pitch µm"),
    ("bit_depth", "bits"),
    ("system_gain", "K DN/e⁻"),
    ("read_noise", "read noise e⁻"),
    ("dark_current", "dark e⁻/s"),
    ("full_well", "full well e⁻"),
    ("black_level", "black DN"),
    ("quantum_efficiency", "η at most"),
];

/// The table, with an empty line before and after it.
pub(super) fn table(cards: &[Value]) -> String {
    let titles = COLUMNS.map(|(_, title)| title).join(" | ");
    let rule = "---|".repeat(COLUMNS.len() + 2);
    let mut table = format!("\n| preset | kind | {titles} |\n|{rule}\n");
    for card in cards {
        let name: String =
            word(&card["name"]).chars().filter(char::is_ascii_alphanumeric).collect();
        let cells = COLUMNS.map(|(key, _)| cell(card, key)).join(" | ");
        let (name, kind) = (name.to_lowercase(), word(&card["kind"]));
        let _ = writeln!(table, "| `{name}` | {kind} | {cells} |");
    }
    table + "\n"
}

/// A figure with the mark of its origin.
fn cell(card: &Value, key: &str) -> String {
    let facts = card["facts"].as_array().expect("a list of figures");
    let fact = facts.iter().find(|fact| fact["key"] == key).expect("the figure");
    let value = word(&fact["value"]);
    let shown = match key {
        "system_gain" => four_digits(value.parse().expect("a number")),
        // The wavelength of the peak stands behind it.
        "quantum_efficiency" => value.split(' ').next().unwrap_or_default().to_owned(),
        _ => value.to_owned(),
    };
    let mark = match word(&fact["origin"]) {
        "measured" => " m",
        "derived" => " d",
        "assumed" => " a",
        _ => "",
    };
    format!("{shown}{mark}")
}

/// A number of 0.1 to 10 with four digits, but for zeros at its end.
fn four_digits(value: f64) -> String {
    let decimals = if value < 1.0 { 4 } else { 3 };
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn word(value: &Value) -> &str {
    value.as_str().expect("a text")
}
