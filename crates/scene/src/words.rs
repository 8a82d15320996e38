//! Words of messages about values: their kinds, and the word that was probably meant.

use std::collections::BTreeSet;

use serde_json::Value;

/// Kind of a value, as a sentence says it.
pub(crate) fn kind_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

/// The hint `did you mean …? known: …`, with the nearest of `known` when one is near.
pub(crate) fn suggest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: BTreeSet<&str> = known.into_iter().collect();
    if known.is_empty() {
        return String::new();
    }
    let all = known_words(known.iter().copied());
    match nearest(wrong, known) {
        Some(near) => format!("\nhint: did you mean `{near}`? {all}"),
        None => format!("\nhint: {all}"),
    }
}

/// The list `known: …` of the first words in the order of the alphabet.
pub(crate) fn known_words<'a>(known: impl IntoIterator<Item = &'a str>) -> String {
    const LISTED: usize = 40;
    let known: BTreeSet<&str> = known.into_iter().collect();
    let listed: Vec<String> = known.iter().take(LISTED).map(|word| format!("`{word}`")).collect();
    let more = if known.len() > LISTED { ", …" } else { "" };
    format!("known: {}{more}", listed.join(", "))
}

/// The word that was probably meant.
pub(crate) fn nearest<'a>(
    wrong: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    // Nobody mistypes a word of that length, and comparing takes its time.
    if wrong.len() > 200 {
        return None;
    }
    let wrong = wrong.to_lowercase();
    let distance = |word: &str| strsim::damerau_levenshtein(&wrong, &word.to_lowercase());
    let best = known.into_iter().min_by_key(|word| distance(word))?;
    // A third of the letters may be wrong: `colour`, `resoluton`, `focus_distnace`.
    (distance(best) * 3 <= wrong.chars().count().max(best.chars().count()).max(3)).then_some(best)
}
