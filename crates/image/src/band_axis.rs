//! The wavelengths of a cube's bands: their middles and their edges, and units that files give them in.

/// The shortest and the longest wavelength of a band (nm): soft X-rays and thermal infrared.
const WAVELENGTHS: [f64; 2] = [1.0, 1e6];

/// Numbers below this are micrometres, where nobody says what they are.
const SHORTEST_NM: f64 = 100.0;

/// The wavelengths of a cube's bands, from the shortest on.
#[derive(Debug, Clone, PartialEq)]
pub struct BandAxis {
    /// The middles of the bands (nm).
    wavelengths: Vec<f64>,
    /// One more than there are bands (nm).
    edges: Vec<f64>,
}

impl BandAxis {
    /// Bands around `wavelengths` (nm), `widths` being their full widths at half maximum (nm). Bands that
    /// meet by their widths end there; all others reach to the middle between them and their
    /// neighbours, the outer ones as far beyond their middles as inside of them.
    ///
    /// # Errors
    ///
    /// When wavelengths are none, do not ascend, or there is one alone without a width; the message goes on after
    /// the file's name.
    pub fn new(wavelengths: Vec<f64>, widths: Option<&[f64]>) -> Result<Self, String> {
        judge(&wavelengths)?;
        let widths = widths.filter(|widths| {
            widths.len() == wavelengths.len() && widths.iter().all(|w| *w > 0.0 && w.is_finite())
        });
        let from_widths = widths.and_then(|widths| edges_that_meet(&wavelengths, widths));
        let between = || {
            let n = wavelengths.len();
            let [first, second] = *wavelengths.first_chunk()?;
            let mut edges = vec![first - 0.5 * (second - first)];
            edges.extend(wavelengths.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
            edges.push(wavelengths[n - 1] + 0.5 * (wavelengths[n - 1] - wavelengths[n - 2]));
            Some(edges)
        };
        let edges = from_widths.or_else(between).ok_or_else(|| {
            "has one band, and nothing says how wide it is: give its width (`fwhm` of an ENVI \
             header)"
                .to_owned()
        })?;
        Self::from_edges(edges.into_iter().map(rounded).collect(), wavelengths)
    }

    /// Bands between `edges` (nm), one after the other.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn between(edges: Vec<f64>) -> Result<Self, String> {
        let middles = edges.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        Self::from_edges(edges, middles)
    }

    fn from_edges(edges: Vec<f64>, wavelengths: Vec<f64>) -> Result<Self, String> {
        judge(&wavelengths)?;
        let ascends = |pair: &[f64]| pair[0] < pair[1];
        if edges.first().is_none_or(|edge| *edge <= 0.0) || !edges.windows(2).all(ascends) {
            return Err(format!("has bands whose edges do not ascend from above 0 nm: {edges:?}"));
        }
        Ok(Self { wavelengths, edges })
    }

    /// The number of bands.
    #[must_use]
    pub fn len(&self) -> usize {
        self.wavelengths.len()
    }

    /// Never: there is at least one band.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.wavelengths.is_empty()
    }

    /// The middles of the bands (nm).
    #[must_use]
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths
    }

    /// The edges of the bands (nm), one more than there are bands.
    #[must_use]
    pub fn edges(&self) -> &[f64] {
        &self.edges
    }
}

/// Edges to a millionth of a nanometre, as people write them.
pub(crate) fn rounded(nm: f64) -> f64 {
    (nm * 1e6).round() / 1e6
}

/// The edges of bands each of which ends where the next begins, to a thousandth of its width.
fn edges_that_meet(middles: &[f64], widths: &[f64]) -> Option<Vec<f64>> {
    let ends = |i: usize| [middles[i] - 0.5 * widths[i], middles[i] + 0.5 * widths[i]];
    let meet = |i: usize| (ends(i)[1] - ends(i + 1)[0]).abs() <= 1e-3 * widths[i];
    let n = middles.len();
    (0..n - 1).all(meet).then(|| (0..n).map(|i| ends(i)[0]).chain([ends(n - 1)[1]]).collect())
}

/// Refuses wavelengths (nm) that are none, or not in order.
fn judge(wavelengths: &[f64]) -> Result<(), String> {
    let [least, most] = WAVELENGTHS;
    let bad = |nm: &f64| !(least..=most).contains(nm);
    if let Some(i) = wavelengths.iter().position(bad) {
        let (band, nm) = (i + 1, wavelengths[i]);
        return Err(format!(
            "has a band {band} at {nm} nm; wavelengths lie between {least} and {most} nm"
        ));
    }
    if wavelengths.is_empty() {
        return Err("has no band".to_owned());
    }
    match wavelengths.windows(2).position(|pair| pair[0] >= pair[1]) {
        None => Ok(()),
        Some(i) if wavelengths[i] == wavelengths[i + 1] => Err(format!(
            "has two bands at {} nm, {} and {}: leave one of them out",
            wavelengths[i],
            i + 1,
            i + 2
        )),
        Some(i) => Err(format!(
            "has its bands out of order: band {} is at {} nm and band {} at {} nm; sort them by \
             wavelength",
            i + 1,
            wavelengths[i],
            i + 2,
            wavelengths[i + 1]
        )),
    }
}

/// `numbers` in nanometres; `unit` is what the file calls theirs.
///
/// # Errors
///
/// When the unit is no length, or there is none and the numbers look like micrometres; the message goes on after
/// the file's name.
pub fn in_nanometres(mut numbers: Vec<f64>, unit: Option<&str>) -> Result<Vec<f64>, String> {
    let known = unit.map(|unit| unit.trim().to_lowercase());
    let factor = match known.as_deref() {
        None | Some("" | "unknown") => {
            let low = |number: &&f64| (0.0..SHORTEST_NM).contains(*number);
            if let Some(number) = numbers.iter().find(low) {
                return Err(format!(
                    "has a wavelength of {number} and does not say of what: did you mean \
                     micrometres? (`wavelength units = Micrometers` of an ENVI header)"
                ));
            }
            1.0
        }
        Some("nanometers" | "nanometres" | "nanometer" | "nanometre" | "nm") => {
            // Micrometres by mistake: no sensor sees all of its light below ten nanometres.
            if let Some(most) = numbers.iter().copied().reduce(f64::max).filter(|most| *most < 10.0)
            {
                return Err(format!(
                    "has wavelengths of at most {most} nm: did you mean micrometres?"
                ));
            }
            1.0
        }
        Some(
            "micrometers" | "micrometres" | "micrometer" | "micrometre" | "microns" | "um" | "µm"
            | "μm",
        ) => 1e3,
        Some("millimeters" | "millimetres" | "mm") => 1e6,
        Some("centimeters" | "centimetres" | "cm") => 1e7,
        Some("meters" | "metres" | "m") => 1e9,
        Some("angstroms" | "angstrom" | "å") => 0.1,
        Some(other) => {
            let other = other.escape_debug();
            return Err(format!(
                "gives its bands in {other}, which is not read: give them in nanometers"
            ));
        }
    };
    if factor != 1.0 {
        numbers.iter_mut().for_each(|number| *number = rounded(*number * factor));
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_reach_to_their_neighbours_or_as_wide_as_they_are() {
        let edges = |middles: &[f64], widths: Option<&[f64]>| {
            BandAxis::new(middles.to_vec(), widths).map(|axis| axis.edges().to_vec())
        };
        assert_eq!(edges(&[405.0, 415.0, 430.0], None).unwrap(), [400.0, 410.0, 422.5, 437.5]);
        // Bands of unequal widths that meet.
        let touching = edges(&[405.0, 420.0, 440.0], Some(&[10.0, 20.0, 20.0]));
        assert_eq!(touching.unwrap(), [400.0, 410.0, 430.0, 450.0]);
        // Filters with gaps between them.
        let apart = edges(&[450.0, 550.0], Some(&[10.0, 10.0]));
        assert_eq!(apart.unwrap(), [400.0, 500.0, 600.0]);
        assert_eq!(edges(&[550.0], Some(&[20.0])).unwrap(), [540.0, 560.0]);
        for (middles, word) in [
            (&[][..], "no band"),
            (&[550.0], "one band"),
            (&[400.0, 400.0], "two bands at 400 nm, 1 and 2"),
            (&[400.0, 500.0, 450.0], "band 2 is at 500 nm and band 3 at 450 nm"),
            (&[-400.0, 500.0], "band 1 at -400 nm"),
            (&[400.0, f64::NAN], "band 2 at NaN nm"),
        ] {
            let why = edges(middles, None).unwrap_err();
            assert!(why.contains(word), "{middles:?}: {why}");
        }
    }

    #[test]
    fn micrometres_are_converted_or_asked_about() {
        let nm = |numbers: &[f64], unit| in_nanometres(numbers.to_vec(), unit);
        assert_eq!(nm(&[0.55, 0.6], Some("Micrometers")).unwrap(), [550.0, 600.0]);
        assert_eq!(nm(&[5500.0], Some("Angstroms")).unwrap(), [550.0]);
        assert_eq!(nm(&[550.0], None).unwrap(), [550.0]);
        assert_eq!(nm(&[550.0], Some("Unknown")).unwrap(), [550.0]);
        for (numbers, unit, word) in [
            (0.55, None, "did you mean micrometres"),
            (0.55, Some("nm"), "did you mean micrometres"),
            (18_181.0, Some("Wavenumber"), "wavenumber, which is not read"),
        ] {
            let why = nm(&[numbers], unit).unwrap_err();
            assert!(why.contains(word), "{numbers} {unit:?}: {why}");
        }
    }
}
