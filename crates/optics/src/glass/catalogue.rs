//! The catalogue of glasses: tables, read when a name is asked for.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::agf::{self, AgfCatalogue};
use super::dispersion::Dispersion;
use super::medium::{Glass, GlassError};

/// Glasses of today, of yesterday and of other makers, and what is no glass.
static TABLES: [&str; 3] =
    [include_str!("catalogue.tsv"), include_str!("earlier.tsv"), include_str!("materials.tsv")];

static CATALOGUE: LazyLock<Catalogue> = LazyLock::new(|| Catalogue::index(&TABLES));

/// The catalogues in which Zemax has what no maker stands for: crystals, plastics, water.
const SUBSTANCES: [&str; 3] = ["MISC", "INFRARED", "BIREFRINGENT"];

/// The glass `NAME` or `CATALOGUE:NAME` of some catalogues.
pub(super) fn find_in<'a>(catalogues: &'a [AgfCatalogue], name: &str) -> Option<&'a Glass> {
    let (maker, plain) = match name.split_once(':') {
        Some((maker, plain)) => (Some(maker), plain),
        None => (None, name),
    };
    let asked =
        |own: &&AgfCatalogue| maker.is_none_or(|maker| own.name.eq_ignore_ascii_case(maker));
    catalogues.iter().rev().filter(asked).find_map(|own| own.find(plain))
}

/// The built-in catalogue.
#[must_use]
pub fn catalogue() -> &'static Catalogue {
    &CATALOGUE
}

/// The order in which makers are asked when two of them have a glass of the same name. A name that
/// several have, and the one that is meant, are told by [`Glass::namesakes`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Makers<'a>(
    /// Makers in order, in any case; those left out follow in the tables' order (Schott, Ohara,
    /// Hoya, CDGM, Hikari, then the others).
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
    fn index(tables: &[&'static str]) -> Self {
        let mut lines: BTreeMap<&'static str, Vec<Entry>> = BTreeMap::new();
        let all = tables.iter().flat_map(|table| table.lines());
        for line in all.filter(|line| !line.starts_with('#') && !line.is_empty()) {
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

    /// The glass called exactly `name`, or `MAKER:NAME`; a number of six digits that is no name stands
    /// for nd and Abbe number, as in 517642.
    ///
    /// # Errors
    ///
    /// When there is none; the error names those that are meant most likely.
    pub fn find(&self, name: &str, makers: Makers<'_>) -> Result<Glass, GlassError> {
        let (maker, plain) = match name.split_once(':') {
            Some((maker, plain)) => (Some(maker), plain),
            None => (None, name),
        };
        let of_maker = |entry: &&Entry| maker.is_none_or(|m| entry.is_made_by(m));
        let found: Vec<Entry> = self.entries(plain).iter().filter(of_maker).copied().collect();
        let rank = |entry: &Entry| makers.0.iter().position(|m| entry.is_made_by(m));
        let Some(&chosen) = found.iter().min_by_key(|e| rank(e).unwrap_or(usize::MAX)) else {
            return agf::coded(name).ok_or_else(|| self.unknown(name, &[]));
        };
        let mut glass = chosen.glass(plain)?;
        let others = found.iter().filter(|entry| entry.maker() != chosen.maker());
        glass.namesakes = others.map(|entry| entry.maker().to_owned()).collect();
        Ok(glass)
    }

    /// That no glass here or in `own` catalogues is called so, with those that are meant most likely.
    pub(super) fn unknown(&self, name: &str, own: &[AgfCatalogue]) -> GlassError {
        let plain = name.split_once(':').map_or(name, |(_, plain)| plain);
        let known: &BTreeMap<&str, Vec<Entry>> = &self.lines;
        let all = known.keys().copied().chain(own.iter().flat_map(AgfCatalogue::names));
        GlassError::Unknown { name: name.to_owned(), nearest: agf::similar(plain, all) }
    }
}

impl Entry {
    fn column(self, i: usize) -> &'static str {
        self.line.split('\t').nth(i).unwrap_or_default()
    }

    /// Maker of the glass; `MISC` for a substance.
    #[must_use]
    pub fn maker(self) -> &'static str {
        match self.column(1) {
            "-" => SUBSTANCES[0],
            maker => maker,
        }
    }

    fn is_made_by(self, maker: &str) -> bool {
        let is = |name: &&str| name.eq_ignore_ascii_case(maker);
        is(&self.maker()) || (self.is_substance() && SUBSTANCES.iter().any(is))
    }

    /// True if the entry is a substance, which has no particular maker.
    fn is_substance(self) -> bool {
        self.column(1) == "-"
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
        let terms = || pairs(self.column(5));
        let dispersion = match self.column(4) {
            "sellmeier" => Dispersion::Sellmeier(terms()?),
            "power" => Dispersion::Power(terms()?),
            "index" => Dispersion::Index(terms()?),
            "buchdahl" => Dispersion::Buchdahl(terms()?),
            "abbe" => match terms()?[..] {
                [[nd, vd]] => Dispersion::from_abbe(nd, vd),
                _ => return None,
            },
            "poles" => poles(self.column(5))?,
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
            maker: (!self.is_substance()).then(|| self.maker().to_owned()),
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

/// `a:p … b:q:c …`
fn poles(text: &str) -> Option<Dispersion> {
    let (mut powers, mut poles) = (Vec::new(), Vec::new());
    for term in text.split(' ') {
        let numbers: Result<Vec<f64>, _> = term.split(':').map(str::parse).collect();
        match numbers.ok()?[..] {
            [a, p] => powers.push([a, p]),
            [b, q, c] => poles.push([b, q, c]),
            _ => return None,
        }
    }
    Some(Dispersion::Poles { powers, poles })
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
        assert!(schott.namesakes.iter().any(|maker| maker == "CDGM"), "{:?}", schott.namesakes);
        let cdgm = find("CDGM:F2", &[]);
        assert!(cdgm.namesakes.is_empty());
        assert_ne!(schott.index(500.0), cdgm.index(500.0));
        assert_eq!(find("F2", &["cdgm", "schott"]).index(500.0), cdgm.index(500.0));
        assert!(catalogue().find("Ohara:F2", Makers::default()).is_err());
    }

    /// nd and vd of glasses that lenses on the web name and makers no longer list, as the catalogues
    /// of their time print them. The tables of 1983 keep n within 3e-5 there, which is 0.2 of vd.
    #[test]
    fn glasses_of_earlier_catalogues_have_their_printed_nd_and_abbe_number() {
        for (name, nd, vd) in [
            ("BK7", 1.5168, 64.17),
            ("SK16", 1.62041, 60.33),
            ("SK2", 1.60738, 56.65),
            ("SK4", 1.61272, 58.63),
            ("BAFN10", 1.67003, 47.11),
            ("SSK4A", 1.61765, 55.14),
            ("BAF3", 1.58267, 46.47),
            ("FK51", 1.48656, 84.47),
            ("KZFSN5", 1.65412, 39.63),
            ("PSK3", 1.55232, 63.46),
            ("PK2", 1.51821, 65.05),
            ("LAKN12", 1.6779, 55.2),
            ("SK10", 1.62278, 56.9),
            ("SF8", 1.68893, 31.18),
            ("SF19", 1.6668, 33.01),
            ("SF57", 1.84666, 23.83),
            ("BAK4", 1.56883, 56.13),
            ("K5", 1.52249, 59.48),
            ("B270", 1.523, 58.76),
            ("COC", 1.53373, 56.23),
            ("E48R", 1.53117, 56.0),
        ] {
            let glass = catalogue().find(name, Makers::default()).unwrap();
            let found = [glass.index(FRAUNHOFER_D).unwrap(), glass.abbe_number().unwrap()];
            assert!((found[0] - nd).abs() < 4e-5, "{name}: nd {} for {nd}", found[0]);
            assert!((found[1] - vd).abs() < 0.2, "{name}: vd {} for {vd}", found[1]);
        }
    }

    /// Indices that handbooks print for the infrared and the ultraviolet, with four digits.
    #[test]
    fn crystals_have_their_printed_indices() {
        for (name, nanometres, n) in [
            ("GERMANIUM", 10_600.0, 4.003),
            ("SILICON", 4000.0, 3.4255),
            ("ZNSE", 10_600.0, 2.4028),
            ("ZNS", 10_000.0, 2.2002),
            ("CAF2", 587.56, 1.43385),
            ("MISC:BAF2", 587.56, 1.4748),
            ("MGF2", 587.56, 1.3777),
            ("SAPPHIRE", 587.56, 1.7682),
            ("F_SILICA", 248.0, 1.5086),
            ("LIF", 587.56, 1.3921),
        ] {
            let glass = catalogue().find(name, Makers::default()).unwrap();
            let found = glass.index(nanometres).unwrap();
            assert!((found - n).abs() < 1.5e-3, "{name} at {nanometres} nm: {found} for {n}");
            assert!(glass.covers(nanometres), "{name}");
        }
    }

    #[test]
    fn a_glass_code_is_its_nd_and_abbe_number() {
        let glass = catalogue().find("777333", Makers::default()).unwrap();
        assert!((glass.index(FRAUNHOFER_D).unwrap() - 1.777).abs() < 1e-12);
        assert!((glass.abbe_number().unwrap() - 33.3).abs() < 1e-9);
        assert!(catalogue().find("000000", Makers::default()).is_err());
        assert!(catalogue().find("62036", Makers::default()).is_err());
    }
}
