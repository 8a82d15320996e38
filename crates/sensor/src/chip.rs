//! Effects of a chip and of its electronics, checked: what [`effects`](crate::effects) writes, ready to act.

use crate::effects::{Defect, DefectMap, ListedDefect, joined};
use crate::{SensorError, SensorSpec};

/// The most pixels that a map of defects lists.
const MOST_DEFECTS: usize = 10_000_000;

/// Non-linearity near saturation: the charge that is read of what was collected, in shares of the full well.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Nonlinearity {
    /// `[collected, read]`, from `[0, 0]` to 1 collected.
    points: Vec<[f64; 2]>,
}

impl Nonlinearity {
    fn new(points: &[[f64; 2]]) -> Result<Self, SensorError> {
        let key = "nonlinearity";
        let value = |value, demand| SensorError::Value { key, value, demand };
        let last = points.last().map_or(0.0, |point| point[0]);
        if last != 1.0 {
            return Err(value(
                last,
                "points [collected, read] as shares of the full well, up to 1 collected",
            ));
        }
        let mut all = vec![[0.0; 2]];
        for &[collected, read] in points.iter().filter(|point| **point != [0.0; 2]) {
            let [before, below] = all[all.len() - 1];
            if !(collected > before && collected <= 1.0) {
                return Err(value(collected, "shares collected that ascend from 0 to 1"));
            }
            if !(read > below && read <= 2.0) {
                return Err(value(
                    read,
                    "shares read that ascend: two signals of one number cannot be told apart",
                ));
            }
            all.push([collected, read]);
        }
        Ok(Self { points: all })
    }

    /// The share read of a share collected.
    pub(crate) fn read(&self, collected: f64) -> f64 {
        // Below 0 as the first line goes on.
        match collected < 0.0 {
            true => collected * self.slope(0.0),
            false => joined(&self.points, collected),
        }
    }

    /// The share collected of which a share was read.
    pub(crate) fn collected(&self, read: f64) -> f64 {
        let turned: Vec<[f64; 2]> = self.points.iter().map(|[x, y]| [*y, *x]).collect();
        match read < 0.0 {
            true => read / self.slope(0.0),
            false => joined(&turned, read),
        }
    }

    /// The slope of the line on which a share collected lies.
    pub(crate) fn slope(&self, collected: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] <= collected);
        let after = after.clamp(1, self.points.len() - 1);
        let [[a, from], [b, to]] = [self.points[after - 1], self.points[after]];
        (to - from) / (b - a)
    }
}

/// Effects that a sensor has of those in this module, checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Effects {
    pub(crate) nonlinearity: Option<Nonlinearity>,
    /// Share of the charge above the full well that flows into neighbours of the column.
    pub(crate) blooming: f64,
    /// Signal of smear, as a share of that of an area a tenth of the picture high.
    pub(crate) smear: f64,
    /// By rows, columns and channels.
    pub(crate) listed: Vec<ListedDefect>,
    /// Standard deviation of the way that carriers diffuse (µm).
    pub(crate) diffusion: f64,
}

impl Effects {
    /// Of a sensor of these columns and rows, with this full well (e⁻, +inf for none).
    pub(crate) fn new(
        spec: &SensorSpec,
        [columns, rows]: [u32; 2],
        full_well: f64,
    ) -> Result<Self, SensorError> {
        let share = |key, value: Option<f64>| {
            let value = value.unwrap_or(0.0);
            let inside = (0.0..=1.0).contains(&value);
            SensorError::unless(inside, key, value, "a fraction in 0..=1").map(|()| value)
        };
        let of_a_well =
            spec.nonlinearity.is_some() || spec.blooming.is_some_and(|share| share > 0.0);
        if of_a_well && full_well.is_infinite() {
            let why = "nonlinearity and blooming count from the electrons that a pixel holds";
            return Err(SensorError::missing("full_well", why));
        }
        let nonlinearity = spec.nonlinearity.as_deref().map(Nonlinearity::new).transpose()?;
        let diffusion = spec.carrier_diffusion.map_or(0.0, |length| length.0);
        let demand = "micrometres, 0 or more, up to 1000";
        SensorError::unless(
            (0.0..=1000.0).contains(&diffusion),
            "carrier_diffusion",
            diffusion,
            demand,
        )?;
        if let Some(metering) = spec.auto_exposure {
            metering.check()?;
        }
        if let Some(second) = spec.second_readout {
            second.check()?;
        }
        if let Some(response) = &spec.angular_response {
            response.check()?;
        }
        let mut listed = match &spec.defect_map {
            None => Vec::new(),
            Some(DefectMap::List(list)) => list.clone(),
            Some(DefectMap::File(_)) => {
                let why = "files are read where the scene is\nhint: give the list of pixels";
                return Err(SensorError::misplaced("defect_map", why));
            }
        };
        let count = listed.len();
        let demand = "ten million pixels at most";
        SensorError::unless(count <= MOST_DEFECTS, "defect_map", count as f64, demand)?;
        for at in &listed {
            let demand = "columns of the sensor";
            SensorError::unless(at.column < columns, "defect_map", f64::from(at.column), demand)?;
            SensorError::unless(
                at.row < rows,
                "defect_map",
                f64::from(at.row),
                "rows of the sensor",
            )?;
            if at.kind == Defect::Hot && spec.hot_pixels.is_none() {
                let why = "the map has hot pixels, and nobody says how hot they are: give { \"share\": 0, \
                           \"dark_current\": 50 } (e⁻/s)";
                return Err(SensorError::missing("hot_pixels", why));
            }
        }
        let place = |at: &ListedDefect| (at.row, at.column, at.channel);
        listed.sort_by_key(place);
        if let Some(twice) = listed.windows(2).find(|pair| place(&pair[0]) == place(&pair[1])) {
            let column = f64::from(twice[0].column);
            SensorError::unless(false, "defect_map", column, "the column of each pixel once")?;
        }
        Ok(Self {
            nonlinearity,
            blooming: share("blooming", spec.blooming)?,
            smear: share("smear", spec.smear)?,
            listed,
            diffusion,
        })
    }

    /// The listed defects of a row's pixels from one column to before another, in a channel.
    pub(crate) fn listed_in(
        &self,
        row: u32,
        columns: std::ops::Range<u32>,
        channel: u16,
    ) -> impl Iterator<Item = &ListedDefect> {
        let before = |at: &ListedDefect| (at.row, at.column) < (row, columns.start);
        let from = self.listed.partition_point(before);
        let end = columns.end;
        self.listed[from..]
            .iter()
            .take_while(move |at| at.row == row && at.column < end)
            .filter(move |at| at.channel.is_none_or(|own| own == channel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_of_saturation_is_its_own_inverse() {
        let curve = Nonlinearity::new(&[[0.8, 0.8], [0.9, 0.88], [1.0, 0.93]]).unwrap();
        for k in -2..=20 {
            let share = f64::from(k) / 20.0;
            // Three roundings.
            assert!((curve.collected(curve.read(share)) - share).abs() < 1e-14, "{share}");
        }
        assert_eq!((curve.read(0.5), curve.read(1.5)), (0.5, 0.93));
        assert!((curve.slope(0.85) - 0.8).abs() < 1e-12 && (curve.slope(1.0) - 0.5).abs() < 1e-12);
    }
}
