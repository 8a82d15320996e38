//! Wavelengths at which the rays of bands run through a lens: each band's own, or one for a group of neighbours.

use std::ops::Range;

use etendue_spectrum::Bands;

/// Bands whose rays run the same way.
#[derive(Debug, Clone, PartialEq)]
pub struct BandGroup {
    /// The bands.
    pub bands: Range<usize>,
    /// Wavelength at which their rays run (nm): `None` when all bands are in one group.
    pub wavelength: Option<f64>,
}

/// Wavelengths at which rays run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TracedAt {
    /// Those of each band at its own.
    #[default]
    Own,
    /// Those of so many groups of neighbouring bands, at most, at the middle of each group.
    Grouped(usize),
    /// All at the design wavelength.
    Design,
}

/// Runs of neighbouring bands in the same of `count` parts of 1/λ².
pub(super) fn grouped(bands: &Bands, count: usize) -> Vec<BandGroup> {
    let place = |band: usize| bands.wavelength(band).powi(-2);
    let all = 0..bands.count();
    let low = all.clone().map(place).fold(f64::INFINITY, f64::min);
    let high = all.clone().map(place).fold(f64::NEG_INFINITY, f64::max);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few dozen")]
    let part = |band: usize| {
        let share = (place(band) - low) / (high - low).max(f64::MIN_POSITIVE);
        ((share * count as f64) as usize).min(count - 1)
    };
    let mut groups: Vec<BandGroup> = Vec::new();
    let mut before = None;
    for band in all {
        let own = part(band);
        match groups.last_mut().filter(|_| before == Some(own)) {
            Some(group) => group.bands.end = band + 1,
            None => groups.push(BandGroup { bands: band..band + 1, wavelength: None }),
        }
        before = Some(own);
    }
    for BandGroup { bands: own, wavelength } in &mut groups {
        let middle = 0.5 * (place(own.start) + place(own.end - 1));
        *wavelength = Some(match own.len() {
            1 => bands.wavelength(own.start),
            _ => middle.powf(-0.5),
        });
    }
    groups
}

#[cfg(test)]
mod tests {
    use etendue_spectrum::Grid;

    use super::*;

    #[test]
    fn groups_are_all_bands_in_order_and_even_in_the_index_of_glass() {
        let edges: Vec<f64> = (0..=30).map(|k| 400.0 + 10.0 * f64::from(k)).collect();
        let bands = Bands::Spectral(Grid::from_edges(edges).unwrap());
        for count in 1..=30 {
            let groups = grouped(&bands, count);
            assert!((1..=count).contains(&groups.len()), "{count}");
            let listed: Vec<usize> = groups.iter().flat_map(|group| group.bands.clone()).collect();
            assert_eq!(listed, (0..30).collect::<Vec<_>>());
            for BandGroup { bands: own, wavelength } in &groups {
                let [first, last] = [own.start, own.end - 1].map(|band| bands.wavelength(band));
                let middle = wavelength.unwrap();
                assert!(first <= middle && middle <= last, "{first} {middle} {last}");
                // No group is wider than its part of 1/λ².
                let wide = first.powi(-2) - last.powi(-2);
                let all = bands.wavelength(0).powi(-2) - bands.wavelength(29).powi(-2);
                assert!(wide <= all / count as f64 * (1.0 + 1e-12), "{count}: {own:?}");
            }
        }
        // Short waves have narrower groups: glass parts them by more.
        let three = grouped(&bands, 3);
        assert!(three[0].bands.len() < three[1].bands.len());
        assert!(three[1].bands.len() < three[2].bands.len());
        // RGB has its longest waves first.
        let groups = grouped(&Bands::Rgb, 2);
        let listed: Vec<usize> = groups.iter().flat_map(|group| group.bands.clone()).collect();
        assert_eq!((groups.len(), listed), (2, vec![0, 1, 2]));
    }
}
