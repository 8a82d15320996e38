//! Effects on a pixel's charge that depend on all of its column: smear and blooming.
//!
//! *Smear*: while the rows of a picture are shifted out, light goes on falling, so that every pixel gets a share of the
//! light of its column. Data sheets state the signal of smear as a share of that of an even area a tenth of the picture
//! high (Theuwissen, "Solid-State Imaging with Charge-Coupled Devices", 1995, section 4.4), which is `smear` here: a pixel
//! gains 10·smear/H times the sum of its column, H being its rows.
//!
//! *Blooming*: of the charge above the full well the share `blooming` flows to the neighbours of the column, half of it up
//! and half down, and fills each as far as there is room; the rest is drained. It is worked out on mean charges, so what
//! flows has no noise of its own beside theirs.

/// Mean photo-electrons of one channel, `[row][column]`, to which smear is added and whose charge flows.
pub(crate) struct WholeFrame {
    pub(crate) width: usize,
    pub(crate) values: Vec<f64>,
}

impl WholeFrame {
    /// Adds smear.
    pub(crate) fn smear(&mut self, smear: f64) {
        let Self { width, values } = self;
        let rows = values.len() / (*width).max(1);
        let share = 10.0 * smear / rows.max(1) as f64;
        let mut sums = vec![0.0; *width];
        for row in values.chunks(*width) {
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        for row in values.chunks_mut(*width) {
            row.iter_mut().zip(&sums).for_each(|(value, sum)| *value += share * sum);
        }
    }

    /// Lets charge flow along columns out of pixels that hold no more than `well`, of which the dark signal takes `dark`.
    pub(crate) fn bloom(&mut self, share: f64, well: f64, dark: f64) {
        let Self { width, values } = self;
        let flow = |carried: &mut [f64], row: &mut [f64]| {
            for (carried, value) in carried.iter_mut().zip(row) {
                let room = well - dark - *value;
                if room >= 0.0 {
                    let taken = carried.min(room);
                    *value += taken;
                    *carried -= taken;
                } else {
                    *carried -= 0.5 * share * room;
                }
            }
        };
        let mut carried = vec![0.0; *width];
        values.chunks_mut(*width).for_each(|row| flow(&mut carried, row));
        carried.fill(0.0);
        values.chunks_mut(*width).rev().for_each(|row| flow(&mut carried, row));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pixel far above the well fills as many neighbours as its charge is worth, and no charge is lost or made.
    #[test]
    fn a_bright_pixel_fills_its_column() {
        for (share, wells) in [(1.0, 9.0), (0.5, 9.0), (1.0, 4.5)] {
            let (width, rows, well, dark) = (3, 41, 1000.0, 20.0);
            let mut values = vec![0.0; width * rows];
            values[20 * width + 1] = wells * (well - dark) + well - dark;
            let mut frame = WholeFrame { width, values };
            frame.bloom(share, well, dark);
            let column: Vec<f64> = frame.values.iter().skip(1).step_by(width).copied().collect();
            let gained: f64 =
                column.iter().enumerate().filter(|(r, _)| *r != 20).map(|(_, v)| v).sum();
            // Sums of at most ten numbers of 10³.
            assert!((gained - share * wells * (well - dark)).abs() < 1e-9, "{share}: {gained}");
            let full = column.iter().filter(|v| (**v - (well - dark)).abs() < 1e-9).count();
            let expected = 2.0 * (share * wells / 2.0_f64).floor();
            assert_eq!(full as f64, expected, "{share} of {wells}");
            assert_eq!(column[19], column[21]);
            assert!(frame.values.iter().step_by(width).all(|&v| v == 0.0), "other columns");
        }
    }

    /// By the data sheets' definition: an even area of a tenth of the height has `smear` of its signal above and below.
    #[test]
    fn smear_is_what_a_tenth_of_the_height_makes() {
        let (width, rows) = (2, 100);
        let mut values = vec![0.0; width * rows];
        values[40 * width..50 * width].fill(500.0);
        let mut frame = WholeFrame { width, values };
        frame.smear(1e-3);
        assert!((frame.values[0] - 0.5).abs() < 1e-12);
        assert!((frame.values[45 * width] - 500.5).abs() < 1e-12);
    }
}
