//! The catalogue of glasses: one table, read when a name is asked for.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::dispersion::Dispersion;
use super::{Glass, GlassError};

static TABLE: &str = include_str!("catalogue.tsv");

static CATALOGUE: LazyLock<Catalogue> = LazyLock::new(|| Catalogue::index(TABLE));

/// How many similar names an error offers.
const NEAREST: usize = 3;

/// The built-in catalogue.
#[must_use]
pub fn catalogue() -> &'static Catalogue {
    &CATALOGUE
}

/// The order in which makers are asked when two of them have a glass of the same name. A name that
/// several have, and the one that is meant, are told by [`Glass::namesakes`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Makers<'a>(
    /// Makers in order, in any case; those left out follow in the table's order (Schott, Ohara,
    /// Hoya, CDGM, Hikari).
    pub &'a [&'a str],
);

/// All lines of the table by name.
#[derive(Debug)]
pub struct Catalogue {
    lines: BTreeMap<&'static str, Vec<Entry>>,
}

/// One line of the table, not yet taken apart.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    line: &'static str,
}

impl Catalogue {
    fn index(table: &'static str) -> Self {
        let mut lines: BTreeMap<&'static str, Vec<Entry>> = BTreeMap::new();
        for line in table.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
            let entry = Entry { line };
            for name in entry.column(0).split('|') {
                lines.entry(name).or_default().push(entry);
            }
        }
        Self { lines }
    }

    /// All names, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.lines.keys().copied()
    }

    /// Every line that bears `name`.
    #[must_use]
    pub fn entries(&self, name: &str) -> &[Entry] {
        self.lines.get(name).map_or(&[], Vec::as_slice)
    }

    /// The glass called exactly `name`, or `MAKER:NAME`.
    ///
    /// # Errors
    ///
    /// When there is none; the error names the most similar ones.
    pub fn find(&self, name: &str, makers: Makers<'_>) -> Result<Glass, GlassError> {
        let (maker, plain) = match name.split_once(':') {
            Some((maker, plain)) => (Some(maker), plain),
            None => (None, name),
        };
        let of_maker = |entry: &&Entry| maker.is_none_or(|m| entry.is_made_by(m));
        let found: Vec<Entry> = self.entries(plain).iter().filter(of_maker).copied().collect();
        let rank = |entry: &Entry| makers.0.iter().position(|m| entry.is_made_by(m));
        let Some(&chosen) = found.iter().min_by_key(|e| rank(e).unwrap_or(usize::MAX)) else {
            return Err(GlassError::Unknown {
                name: name.to_owned(),
                nearest: self.nearest(plain),
            });
        };
        let mut glass = chosen.glass(plain)?;
        let others = found.iter().filter(|entry| entry.maker() != chosen.maker());
        glass.namesakes = others.map(|entry| entry.maker().to_owned()).collect();
        Ok(glass)
    }

    fn nearest(&self, name: &str) -> Vec<String> {
        let wanted = name.to_ascii_uppercase();
        let distance = |known: &&str| {
            let known = known.to_ascii_uppercase();
            (strsim::damerau_levenshtein(&wanted, &known), known.len())
        };
        let mut names: Vec<&str> = self.names().collect();
        names.sort_by_key(distance);
        names.into_iter().take(NEAREST).map(str::to_owned).collect()
    }
}

impl Entry {
    fn column(self, i: usize) -> &'static str {
        self.line.split('\t').nth(i).unwrap_or_default()
    }

    /// Who makes it; `-` for a substance.
    #[must_use]
    pub fn maker(self) -> &'static str {
        self.column(1)
    }

    fn is_made_by(self, maker: &str) -> bool {
        self.maker().eq_ignore_ascii_case(maker)
    }

    /// The published nd and Abbe number.
    #[must_use]
    pub fn published(self) -> [Option<f64>; 2] {
        [6, 7].map(|i| self.column(i).parse().ok())
    }

    fn glass(self, name: &str) -> Result<Glass, GlassError> {
        self.read(name).ok_or_else(|| GlassError::Table { name: self.column(0).to_owned() })
    }

    fn read(self, name: &str) -> Option<Glass> {
        let terms = pairs(self.column(5))?;
        let dispersion = match self.column(4) {
            "sellmeier" => Dispersion::Sellmeier(terms),
            "power" => Dispersion::Power(terms),
            "index" => Dispersion::Index(terms),
            _ => return None,
        };
        let extinction = match self.column(9) {
            "-" => Vec::new(),
            list => pairs(list)?,
        };
        Some(Glass {
            name: name.to_owned(),
            range: [self.column(2).parse().ok()?, self.column(3).parse().ok()?],
            source: self.column(8).to_owned(),
            maker: (self.maker() != "-").then(|| self.maker().to_owned()),
            namesakes: Vec::new(),
            dispersion,
            extinction,
        })
    }
}

/// `a:b a:b …`
fn pairs(text: &str) -> Option<Vec<[f64; 2]>> {
    let pair = |term: &str| {
        let (a, b) = term.split_once(':')?;
        Some([a.parse().ok()?, b.parse().ok()?])
    };
    text.split(' ').map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{FRAUNHOFER_D, GlassSpec};
    use super::*;

    #[test]
    fn every_line_gives_the_published_nd_and_abbe_number() {
        let mut checked = 0;
        for name in catalogue().names() {
            for entry in catalogue().entries(name) {
                let glass = entry.glass(name).unwrap_or_else(|e| panic!("{e}"));
                assert!(glass.range[0] < glass.range[1], "{name}");
                let sorted = glass.extinction.is_sorted_by(|a, b| a[0] < b[0]);
                assert!(sorted, "{name}: extinction out of order");
                let [Some(nd), Some(vd)] = entry.published() else { continue };
                let [got_nd, got_vd] =
                    [glass.index(FRAUNHOFER_D).unwrap(), glass.abbe_number().unwrap()];
                // Data sheets print nd with five digits and vd with two; formulas are fits that
                // agree with them to the printed digit or the next.
                assert!((got_nd - nd).abs() < 2e-5, "{name}: nd {got_nd}, published {nd}");
                assert!((got_vd - vd).abs() < 0.03, "{name}: vd {got_vd}, published {vd}");
                checked += 1;
            }
        }
        assert!(checked > 1000, "only {checked} glasses have published numbers");
    }

    #[test]
    fn common_glasses_of_each_maker_are_there() {
        for name in [
            "N-BK7",
            "N-SF11",
            "N-LASF9",
            "F2",
            "SF1",
            "S-FPL53",
            "S-LAH79",
            "S-TIH6",
            "FCD1",
            "TAFD30",
            "H-K9L",
            "H-ZLAF50E",
            "J-LAK14",
            "fused_silica",
            "CaF2",
            "water",
            "air",
        ] {
            assert!(GlassSpec::Named(name.to_owned()).resolve().is_ok(), "{name}");
        }
    }

    #[test]
    fn of_two_namesakes_the_maker_decides_and_the_other_is_told() {
        let find = |name, makers| catalogue().find(name, Makers(makers)).unwrap();
        let schott = find("F2", &[]);
        assert_eq!(schott.namesakes, ["CDGM"]);
        let cdgm = find("CDGM:F2", &[]);
        assert!(cdgm.namesakes.is_empty());
        assert_ne!(schott.index(500.0), cdgm.index(500.0));
        assert_eq!(find("F2", &["cdgm", "schott"]).index(500.0), cdgm.index(500.0));
        assert!(catalogue().find("Ohara:F2", Makers::default()).is_err());
    }
}
