//! Names that a glass may have been meant by: older and newer ones of the same kind, and similar ones.

use super::Glass;
use super::dispersion::Dispersion;

/// How many names an error offers.
const OFFERED: usize = 3;

/// What makers put before the name of a kind: Schott's leadless (N-) and moulded glasses (P-), Ohara's
/// (S-, L-), Hoya's (E-, M-), CDGM's (H-, D-), Hikari's (J-, E-, Q-), Sumita's (K-).
const PREFIXES: [&str; 11] = ["", "N-", "P-", "S-", "L-", "E-", "M-", "H-", "D-", "J-", "K-"];

/// The names that are meant most likely by one that is not known, best first: the same kind of an
/// older or newer series, then those with the fewest letters changed.
pub(super) fn similar<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Vec<String> {
    let wanted = name.to_ascii_uppercase();
    let mut names: Vec<(usize, usize, &str)> = known
        .map(|known| {
            let upper = known.to_ascii_uppercase();
            let steps = match kind(&upper) == kind(&wanted) {
                true => 0,
                false => strsim::damerau_levenshtein(&wanted, &upper),
            };
            (
                steps,
                PREFIXES.iter().position(|p| upper.starts_with(*p) && !p.is_empty()).unwrap_or(0),
                known,
            )
        })
        .collect();
    names.sort_by_key(|&(steps, series, known)| (steps, series, known.len()));
    names.dedup_by_key(|name| name.2);
    names.into_iter().take(OFFERED).map(|name| name.2.to_owned()).collect()
}

/// A name without its series, and without the N that earlier names had inside: `N-LAK7`, `LAKN7` and
/// `LAK7` are one kind.
fn kind(name: &str) -> String {
    let plain = PREFIXES[1..].iter().find_map(|prefix| name.strip_prefix(prefix)).unwrap_or(name);
    match plain.find(|c: char| c.is_ascii_digit()) {
        Some(digit) if digit > 1 && plain[..digit].ends_with('N') => {
            format!("{}{}", &plain[..digit - 1], &plain[digit..])
        }
        _ => plain.to_owned(),
    }
}

/// The end of the sentence on an unknown glass.
pub(super) fn offer(nearest: &[String]) -> String {
    format!(
        "the nearest names known are {}; a catalogue of your own is added with --glass-catalog FILE.agf, or by \
         `glass_catalogs` of a lens file",
        nearest.join(", ")
    )
}

/// The glass of a code of six digits: nd − 1 in thousandths, then Abbe's number in tenths.
pub(super) fn coded(name: &str) -> Option<Glass> {
    if name.len() != 6 || !name.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let [nd, vd] = [&name[..3], &name[3..]].map(|digits| digits.parse::<f64>().ok());
    let (nd, vd) = (nd?, vd?);
    (nd > 0.0 && vd > 0.0)
        .then(|| Glass::inline(name, Dispersion::from_abbe(1.0 + 1e-3 * nd, 0.1 * vd)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_kind_of_another_series_comes_first() {
        let known = ["N-BK7", "BK1", "N-SK16", "LAKN7", "N-LAK7", "LAK9", "S-LAL7"];
        assert_eq!(similar("BK7", known.into_iter())[0], "N-BK7");
        assert_eq!(similar("N-SK16X", known.into_iter())[0], "N-SK16");
        assert_eq!(similar("LAK7", known.into_iter())[..2], ["LAKN7", "N-LAK7"]);
        assert_eq!(similar("n-bk7", known.into_iter())[0], "N-BK7");
    }
}
