//! A second number of each pixel, of another gain or of a smaller photodiode; and the exposure that is metered.

use crate::film::Film;
use crate::philox::mixed_seed;
use crate::settings::{EXPOSURES, ReadoutPath, at_its_iso};
use crate::spec::SensorSpec;
use crate::{AutoExposure, SecondReadout, Sensor, SensorError};

impl Sensor {
    /// The sensor of the second number alone; `None` of sensors that have one. Of a dual gain it sees the very electrons of
    /// the first and reads them with noise of its own; a second photodiode has its own electrons and its own pattern.
    #[must_use]
    pub fn second(&self) -> Option<Self> {
        self.second_checked().ok().flatten()
    }

    /// Refuses a second read-out that is none.
    pub(crate) fn check_second(&self) -> Result<(), SensorError> {
        self.second_checked().map(|_| ()).map_err(|error| match error {
            SensorError::Value { value, demand, .. } => {
                SensorError::Value { key: "second_readout", value, demand }
            }
            other => other,
        })
    }

    fn second_checked(&self) -> Result<Option<Self>, SensorError> {
        let Some(second) = self.spec().second_readout else { return Ok(None) };
        let settings = &self.settings;
        let mut first: SensorSpec = at_its_iso(self.spec())?.into_owned();
        first.system_gain = Some(settings.gain);
        let mut other = Self::new(&first.second(second))?;
        let own = &mut other.settings;
        own.resolution = settings.resolution;
        own.noise = settings.noise;
        own.exposures.clone_from(&settings.exposures);
        match second {
            SecondReadout::DualGain { .. } => own.readout = ReadoutPath::Second,
            SecondReadout::SplitPixel { ratio, dark_current, .. } => {
                own.sensitivity = ratio;
                own.serial = mixed_seed(settings.serial, b"second photodiode");
                own.dark_current = match dark_current {
                    // As `dark_current`, at its temperature.
                    Some(current) if own.dark_current > 0.0 => {
                        let stated = self.spec().dark_current.unwrap_or(own.dark_current);
                        if stated > 0.0 { own.dark_current / stated * current } else { current }
                    }
                    Some(current) => current,
                    None => ratio * own.dark_current,
                };
            }
        }
        other.response = self.response.clone();
        for channel in &mut other.response.channels {
            channel.electrons.iter_mut().for_each(|electrons| *electrons *= second.ratio());
            channel.primaries.iter_mut().for_each(|electrons| *electrons *= second.ratio());
        }
        Ok(Some(other))
    }

    /// The exposure time (s) at which the percentile of the pixels that `auto_exposure` names reaches its share of
    /// saturation, dark signal included. `None` where the exposure is not metered, or there is no light to meter.
    #[must_use]
    pub fn metered(&self, film: Film<'_>) -> Option<f64> {
        let AutoExposure { percentile, target, .. } = self.spec().auto_exposure?;
        let rate = self.electrons_of_brightest(film, 1.0, 1.0 - percentile / 100.0);
        let time = target * self.saturation() / (rate + self.dark_current());
        (rate > 0.0).then(|| time.clamp(EXPOSURES[0], EXPOSURES[1]))
    }

    /// Returns the sensor with this exposure time alone (s).
    #[must_use]
    pub fn at_exposure(mut self, exposure: f64) -> Self {
        self.settings.exposures = vec![exposure];
        self
    }
}
