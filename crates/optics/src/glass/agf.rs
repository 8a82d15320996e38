//! Glass catalogues in Zemax' AGF format.
//!
//! # Source
//!
//! OpticStudio's help, "Using Material Catalogs" and "Formulas for Index of Refraction": the lines
//! `NM` (name, number of the formula, …), `CD` (coefficients), `LD` (range in µm), `IT` (wavelength in
//! µm, internal transmission, thickness in mm). Thermal data are not used.
//!
//! Names that a glass may have been meant by: older and newer ones of the same kind, and similar ones.

use std::collections::BTreeMap;
use std::path::Path;

use etendue_report::Refusal;

use super::dispersion::Dispersion;
use super::medium::{Glass, extinction_of};

/// The longest catalogue that is read (bytes); the longest of a maker has a fifth of a megabyte.
const LONGEST: u64 = 64 << 20;

/// The glasses of one AGF file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AgfCatalogue {
    /// The file's name without its ending, which stands for the maker.
    pub name: String,
    glasses: BTreeMap<String, Glass>,
}

impl AgfCatalogue {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// When it is no regular file, is longer than 64 MiB, or is no catalogue.
    pub fn open(path: &Path) -> Result<Self, Refusal> {
        let bytes = etendue_files::read(path, LONGEST)
            .map_err(|error| Refusal::new(format!("cannot be read: {error}")))?;
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        Self::read(&stem.unwrap_or_default(), &bytes)
    }

    /// Reads the bytes of a catalogue called `name`: UTF-8, UTF-16 with a byte order mark, or Latin-1.
    ///
    /// # Errors
    ///
    /// When it has no glass, or a line of one makes no sense; the error names the line.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, Refusal> {
        let text = decode(bytes);
        let mut catalogue = Self { name: name.to_owned(), glasses: BTreeMap::new() };
        let mut entry: Option<AgfEntry<'_>> = None;
        for (number, line) in (1..).zip(text.lines()) {
            let mut words = line.split_whitespace();
            let command = words.next().unwrap_or_default();
            let fault = |why: &str| Refusal::new(why).at(format_args!("line {number}"));
            // An entry begins with NM and ends before the next one; other lines are about it.
            match (command, &mut entry) {
                ("NM", previous) => {
                    let next = AgfEntry::named(number, words).ok_or_else(|| {
                        fault("NM needs a name and the number of a formula, 1 to 13")
                    })?;
                    if let Some(done) = previous.replace(next) {
                        catalogue.add(&done)?;
                    }
                }
                ("CD", Some(entry)) => {
                    entry.coefficients =
                        numbers(words).ok_or_else(|| fault("CD has no numbers"))?;
                }
                ("LD", Some(entry)) => {
                    let range = numbers(words).filter(|range| range.len() >= 2);
                    entry.range = range.ok_or_else(|| fault("LD needs two wavelengths"))?;
                }
                ("IT", Some(entry)) => entry.transmissions.extend(numbers(words)),
                _ => {}
            }
        }
        if let Some(last) = entry {
            catalogue.add(&last)?;
        }
        if catalogue.glasses.is_empty() {
            let why = "has no glass (a line that begins with NM): not an AGF catalogue";
            return Err(why.into());
        }
        Ok(catalogue)
    }

    /// The glass called exactly `name`.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&Glass> {
        self.glasses.get(name)
    }

    /// All names, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.glasses.keys().map(String::as_str)
    }

    fn add(&mut self, entry: &AgfEntry<'_>) -> Result<(), Refusal> {
        let fault = |why: String| Refusal::new(why).at(format_args!("line {}", entry.line));
        let dispersion = formula(entry.formula, &entry.coefficients).ok_or_else(|| {
            fault(format!("{} has too few coefficients for formula {}", entry.name, entry.formula))
        })?;
        // Micrometres to nanometres without the rounding of a product: 0.4861327 is 486.1327.
        let nanometres = |l: f64| (l * 1e9).round() / 1e6;
        let range = match entry.range[..] {
            [from, to, ..] if from < to => [from, to].map(nanometres),
            _ => [0.0, f64::INFINITY],
        };
        let mut extinction: Vec<[f64; 2]> = entry
            .transmissions
            .iter()
            .filter_map(|row| match row[..] {
                [l, passed, thickness, ..] if passed > 0.0 && passed < 1.0 && thickness > 0.0 => {
                    Some([nanometres(l), extinction_of(nanometres(l), passed, thickness)])
                }
                _ => None,
            })
            .collect();
        extinction.sort_by(|a, b| a[0].total_cmp(&b[0]));
        extinction.dedup_by(|a, b| a[0] == b[0]);
        let glass = Glass {
            name: entry.name.to_owned(),
            range,
            source: format!("the catalogue {}", self.name),
            maker: Some(self.name.clone()),
            namesakes: Vec::new(),
            dispersion,
            extinction,
        };
        self.glasses.insert(entry.name.to_owned(), glass);
        Ok(())
    }
}

/// One glass on its way.
struct AgfEntry<'a> {
    line: usize,
    name: &'a str,
    formula: u32,
    coefficients: Vec<f64>,
    range: Vec<f64>,
    transmissions: Vec<Vec<f64>>,
}

impl<'a> AgfEntry<'a> {
    fn named(line: usize, mut words: impl Iterator<Item = &'a str>) -> Option<Self> {
        let name = words.next()?;
        // Written as a whole number, or as 2.0.
        let number: f64 = words.next()?.parse().ok()?;
        let formula = (1..=13).find(|&known| f64::from(known) == number)?;
        let (coefficients, range) = (Vec::new(), Vec::new());
        Some(Self { line, name, formula, coefficients, range, transmissions: Vec::new() })
    }
}

/// Finite numbers up to the end of the line or the first word that is none (`-`, `_`).
fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> Option<Vec<f64>> {
    let parsed = words.map_while(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
    let numbers: Vec<f64> = parsed.collect();
    (!numbers.is_empty()).then_some(numbers)
}

/// Formula `number` of OpticStudio with its coefficients; those not given are 0.
fn formula(number: u32, given: &[f64]) -> Option<Dispersion> {
    if given.is_empty() {
        return None;
    }
    let c = |i: usize| given.get(i).copied().unwrap_or(0.0);
    let powers = |list: &[f64]| -> Vec<[f64; 2]> {
        let terms = list.iter().enumerate().map(|(i, &p)| [c(i), p]);
        terms.filter(|term| term[0] != 0.0).collect()
    };
    let pairs = |count: usize| -> Vec<[f64; 2]> {
        let terms = (0..count).map(|i| [c(2 * i), c(2 * i + 1)]);
        terms.filter(|term| term[0] != 0.0).collect()
    };
    let poles = |powers: Vec<[f64; 2]>, poles: Vec<[f64; 3]>| Dispersion::Poles { powers, poles };
    Some(match number {
        // Schott
        1 => Dispersion::Power(powers(&[0.0, 2.0, -2.0, -4.0, -6.0, -8.0])),
        // Sellmeier 1, 3 and 5
        2 => Dispersion::Sellmeier(pairs(3)),
        6 => Dispersion::Sellmeier(pairs(4)),
        11 => Dispersion::Sellmeier(pairs(5)),
        // Herzberger
        3 => Dispersion::Herzberger([c(0), c(1), c(2), c(3), c(4), c(5)]),
        // Sellmeier 2: n² − 1 = A + B₁λ²/(λ² − λ₁²) + B₂/(λ² − λ₂²)
        4 => poles(
            vec![[1.0 + c(0), 0.0]],
            vec![[c(1), 2.0, c(2).powi(2)], [c(3), 0.0, c(4).powi(2)]],
        ),
        // Conrady
        5 => Dispersion::Index(powers(&[0.0, -1.0, -3.5])),
        // Handbook of Optics 1 and 2
        7 => poles(vec![[c(0), 0.0], [-c(3), 2.0]], vec![[c(1), 0.0, c(2)]]),
        8 => poles(vec![[c(0), 0.0], [-c(3), 2.0]], vec![[c(1), 2.0, c(2)]]),
        // Sellmeier 4
        9 => poles(vec![[c(0), 0.0]], vec![[c(1), 2.0, c(2)], [c(3), 2.0, c(4)]]),
        // Extended, Extended 2 and 3
        10 => Dispersion::Power(powers(&[0.0, 2.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0])),
        12 => Dispersion::Power(powers(&[0.0, 2.0, -2.0, -4.0, -6.0, -8.0, 4.0, 6.0])),
        13 => Dispersion::Power(powers(&[0.0, 2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0])),
        _ => return None,
    })
}

fn decode(bytes: &[u8]) -> String {
    let wide = |read: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|pair| read([pair[0], pair[1]]));
        char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect()
    };
    match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_owned(),
            Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
        },
    }
}

/// Number of names that an error offers.
const OFFERED: usize = 3;

/// Prefixes that makers put before the name of a kind: Schott's leadless (N-) and moulded glasses
/// (P-), Ohara's (S-, L-), Hoya's (E-, M-), CDGM's (H-, D-), Hikari's (J-, E-, Q-), Sumita's (K-).
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

    fn one(formula: u32, coefficients: &str) -> Glass {
        let text = format!("CC test\nNM X {formula} 0 1.5 60 0 1\nCD {coefficients}\nLD 0.3 2.5\n");
        AgfCatalogue::read("own", text.as_bytes()).unwrap().find("X").unwrap().clone()
    }

    /// Each formula against its own words at 0.5 µm: sums of powers.
    #[test]
    fn the_formulas_of_powers_give_what_they_say() {
        let powers = "2.2 -.01 .011 2e-4 -7e-6 5e-7";
        let sum = |list: &[(f64, f64)]| -> f64 {
            list.iter().map(|&(a, p)| a * 0.5_f64.powf(p)).sum::<f64>().sqrt()
        };
        let short =
            [(2.2, 0.0), (-0.01, 2.0), (0.011, -2.0), (2e-4, -4.0), (-7e-6, -6.0), (5e-7, -8.0)];
        let with = |more: [(f64, f64); 2]| sum(&[&short[..], &more].concat());
        let third = [
            (2.2, 0.0),
            (-0.01, 2.0),
            (1e-3, 4.0),
            (0.011, -2.0),
            (2e-4, -4.0),
            (-7e-6, -6.0),
            (5e-7, -8.0),
            (1e-8, -10.0),
            (2e-9, -12.0),
        ];
        for (number, coefficients, expected) in [
            (1, powers.to_owned(), sum(&short)),
            (5, "1.5 .01 .0005".to_owned(), 1.5 + 0.01 / 0.5 + 0.0005 / 0.5_f64.powf(3.5)),
            (10, format!("{powers} 1e-8 2e-9"), with([(1e-8, -10.0), (2e-9, -12.0)])),
            (12, format!("{powers} 1e-3 2e-4"), with([(1e-3, 4.0), (2e-4, 6.0)])),
            (13, "2.2 -.01 1e-3 .011 2e-4 -7e-6 5e-7 1e-8 2e-9".to_owned(), sum(&third)),
        ] {
            let found = one(number, &coefficients).index(500.0).unwrap();
            // Sums of up to nine terms in another order: a few roundings.
            assert!((found - expected).abs() < 1e-14, "formula {number}: {found} for {expected}");
        }
    }

    /// Formulas of resonances give what they say, at λ² = 1/4.
    #[test]
    fn the_formulas_of_resonances_give_what_they_say() {
        let l2 = 0.25_f64;
        let h = 1.0 / (l2 - 0.028);
        let at = |b: f64, c: f64| b * l2 / (l2 - c);
        let four = at(1.0, 0.006) + at(0.1, 0.02) + at(0.1, 0.03) + at(1.0, 100.0);
        let herzberger =
            1.5 + 0.004 * h - 2e-5 * h * h - 0.003 * l2 + 1e-5 * l2 * l2 + 2e-6 * l2.powi(3);
        for (number, coefficients, expected) in [
            (2, "1 .006 .1 .02 1 100", (1.0 + four - at(0.1, 0.03)).sqrt()),
            (3, "1.5 .004 -2e-5 -.003 1e-5 2e-6", herzberger),
            (4, "0.2 1.04 .07 -.02 10", (1.2 + at(1.04, 0.0049) - 0.02 / (l2 - 100.0)).sqrt()),
            (6, "1 .006 .1 .02 .1 .03 1 100", (1.0 + four).sqrt()),
            (7, "2.2 .01 .02 .003", (2.2 + 0.01 / (l2 - 0.02) - 0.003 * l2).sqrt()),
            (8, "1.2 1.01 .02 .003", (1.2 + at(1.01, 0.02) - 0.003 * l2).sqrt()),
            (9, "1.2 1.01 .02 .3 .04", (1.2 + at(1.01, 0.02) + at(0.3, 0.04)).sqrt()),
            (11, "1 .006 .1 .02 .1 .03 1 100 .2 .01", (1.0 + four + at(0.2, 0.01)).sqrt()),
        ] {
            let found = one(number, coefficients).index(500.0).unwrap();
            assert!((found - expected).abs() < 1e-14, "formula {number}: {found} for {expected}");
        }
    }

    #[test]
    fn ranges_transmissions_and_encodings_are_read() {
        let text = "NM BK7 2.0 517642 1.5168 64.17 0 1\nCD 1.03961212 .00600069867 .231792344 \
                .0200179144 1.01046945 103.560653 0 0\nTD - - \nLD .31 2.325\nIT .5 .998 10\n\
                IT .4 .99 -\nNM LAST 5 0 1.5 0\nCD 1.5\n";
        let utf16: Vec<u8> = [0xff, 0xfe]
            .into_iter()
            .chain(text.encode_utf16().flat_map(u16::to_le_bytes))
            .collect();
        for bytes in [text.as_bytes(), &utf16] {
            let catalogue = AgfCatalogue::read("old", bytes).unwrap();
            assert_eq!(catalogue.names().collect::<Vec<_>>(), ["BK7", "LAST"]);
            let bk7 = catalogue.find("BK7").unwrap();
            assert_eq!(bk7.range, [310.0, 2325.0]);
            // 10 mm pass 0.998.
            let alpha = bk7.absorption(500.0).unwrap();
            assert!(((-10.0 * alpha).exp() - 0.998).abs() < 1e-12, "{alpha}");
            assert_eq!(catalogue.find("LAST").unwrap().index(700.0), Ok(1.5));
        }
    }

    #[test]
    fn what_is_no_catalogue_is_refused_by_line() {
        let refused =
            |text: &str| AgfCatalogue::read("x", text.as_bytes()).unwrap_err().to_string();
        assert!(refused("").contains("no glass"));
        assert!(refused("CC\nNM X\n").contains("line 2"));
        assert!(refused("NM X 14 0\nCD 1\n").contains("1 to 13"));
        assert!(refused("NM X 2 0\nLD .4 .7\n").contains("line 1"), "no coefficients");
        assert!(refused("NM X 2 0\nCD nan\n").contains("CD has no numbers"));
    }

    #[test]
    fn the_same_kind_of_another_series_comes_first() {
        let known = ["N-BK7", "BK1", "N-SK16", "LAKN7", "N-LAK7", "LAK9", "S-LAL7"];
        assert_eq!(similar("BK7", known.into_iter())[0], "N-BK7");
        assert_eq!(similar("N-SK16X", known.into_iter())[0], "N-SK16");
        assert_eq!(similar("LAK7", known.into_iter())[..2], ["LAKN7", "N-LAK7"]);
        assert_eq!(similar("n-bk7", known.into_iter())[0], "N-BK7");
    }
}
