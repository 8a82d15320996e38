//! A sensor ready to expose films.

use std::sync::Arc;

use etendue_geometry::units::Micrometres;
use etendue_spectrum::{Bands, Curve};
use rayon::prelude::*;

use crate::chain::Chain;
use crate::effects::Defect;
use crate::film::{Exposure, Film};
use crate::philox::{PhiloxKey, Site};
use crate::response::Response;
use crate::settings::{ReadoutPath, SensorSettings};
use crate::spec::{HotPixels, NoiseModel, Radiometry, SensorSpec};
use crate::{CfaSpec, SensorError};

/// A sensor whose numbers hold together.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    spec: SensorSpec,
    pub(crate) settings: SensorSettings,
    pub(crate) response: Response,
    pub(crate) cfa: Option<CfaSpec>,
}

impl Sensor {
    /// Checks a spec and works out what each channel makes of light.
    ///
    /// # Errors
    ///
    /// [`SensorError`] for any number or curve that is none, and for a channel that would be black.
    pub fn new(spec: &SensorSpec) -> Result<Self, SensorError> {
        let settings = SensorSettings::new(spec)?;
        let response = Response::new(spec, &settings, None)?;
        let sensor = Self { spec: spec.clone(), settings, response, cfa: spec.cfa.clone() };
        sensor.check_second()?;
        Ok(sensor)
    }

    /// Specification that the sensor was made of.
    #[must_use]
    pub fn spec(&self) -> &SensorSpec {
        &self.spec
    }

    /// Columns and rows.
    #[must_use]
    pub fn resolution(&self) -> [u32; 2] {
        self.settings.resolution
    }

    /// Returns the sensor with other columns and rows. The fixed pattern keeps its pixels.
    #[must_use]
    pub fn with_resolution(mut self, resolution: [u32; 2]) -> Self {
        self.settings.resolution = resolution.map(|side| side.max(1));
        self
    }

    /// Returns the sensor, as its file specifies it, with pixels of another size (µm).
    ///
    /// # Errors
    ///
    /// When the size is none.
    pub fn with_pixel_pitch(&self, pitch: f64) -> Result<Self, SensorError> {
        Self::new(&SensorSpec { pixel_pitch: Some(Micrometres(pitch)), ..self.spec.clone() })
    }

    /// Returns the sensor for a render in other bands than it asks for: in three, say, where
    /// nothing in the scene has a spectrum of its own.
    ///
    /// # Errors
    ///
    /// When a channel sees none of the bands, or they are not the bands of a multispectral sensor.
    pub fn in_bands(mut self, bands: Bands) -> Result<Self, SensorError> {
        self.response = Response::new(&self.spec, &self.settings, Some(bands))?;
        Ok(self)
    }

    /// From one pixel's centre to the next (µm).
    #[must_use]
    pub fn pixel_pitch(&self) -> f64 {
        self.settings.pixel_pitch
    }

    /// The spectral bands that a film for this sensor has.
    #[must_use]
    pub fn bands(&self) -> &Bands {
        &self.response.bands
    }

    /// Radiometry: what the film's values mean.
    #[must_use]
    pub fn radiometry(&self) -> Radiometry {
        self.settings.radiometry
    }

    /// Noise model by which electrons are drawn.
    #[must_use]
    pub fn noise(&self) -> NoiseModel {
        self.settings.noise
    }

    /// Names of the kinds of photosites: filters, or the channels of each pixel.
    pub fn channels(&self) -> impl ExactSizeIterator<Item = &str> {
        self.response.channels.iter().map(|channel| channel.name.as_str())
    }

    /// Numbers a pixel of an image: 1 for a raw sensor.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.response.depth()
    }

    /// The colour filter array of a raw sensor that has one.
    #[must_use]
    pub fn cfa(&self) -> Option<&CfaSpec> {
        self.cfa.as_ref()
    }

    /// Channel of a pixel of a raw sensor, an index into [`Self::channels`].
    #[must_use]
    pub fn channel_at(&self, row: usize, column: usize) -> usize {
        let Some(pattern) = &self.response.pattern else { return 0 };
        let channels = &pattern[row % pattern.len()];
        channels[column % channels.len()]
    }

    /// Mean photo-electrons that a unit of each band makes in a channel: a second in physical mode,
    /// in all in digital mode (e⁻).
    #[must_use]
    pub fn electrons_per_unit(&self, channel: usize) -> &[f64] {
        &self.response.channels[channel].electrons
    }

    /// η without colour filters.
    #[must_use]
    pub fn quantum_efficiency(&self) -> &Curve {
        &self.settings.efficiency
    }

    /// K (DN/e⁻).
    #[must_use]
    pub fn system_gain(&self) -> f64 {
        self.settings.gain
    }

    /// `σ_read` (e⁻).
    #[must_use]
    pub fn read_noise(&self) -> f64 {
        self.settings.read_noise
    }

    /// `μ_I` at the sensor's temperature (e⁻/s).
    #[must_use]
    pub fn dark_current(&self) -> f64 {
        self.settings.dark_current
    }

    /// Electrons a pixel holds, +inf when only the converter saturates.
    #[must_use]
    pub fn full_well(&self) -> f64 {
        self.settings.full_well
    }

    /// Electrons from black to saturation, of the well or the converter (e⁻).
    #[must_use]
    pub fn saturation(&self) -> f64 {
        let converter = (self.settings.white() - self.settings.black) / self.settings.gain;
        let (converter, _) = self.settings.collected_of(converter);
        self.settings.full_well.min(converter)
    }

    /// Black level: the number of a pixel without light (DN).
    #[must_use]
    pub fn black_level(&self) -> f64 {
        self.settings.black
    }

    /// The greatest digital number, 2ᵇ − 1.
    #[must_use]
    pub fn white_level(&self) -> f64 {
        self.settings.white()
    }

    /// The digital number at which a pixel saturates: where the well is full, or the converter ends.
    #[must_use]
    pub fn saturation_level(&self) -> f64 {
        self.settings.saturation_level()
    }

    /// Electrons of full scale in digital mode: of light 1 in the most sensitive channel (e⁻).
    #[must_use]
    pub fn full_scale(&self) -> f64 {
        (self.settings.white() - self.settings.black) / self.settings.gain
    }

    /// Mean photo-electrons of a pixel, over all pixels and channels; what of the film is no light
    /// counts as 0 (e⁻).
    #[must_use]
    pub fn mean_electrons(&self, film: Film<'_>, exposure: f64) -> f64 {
        let mean = |channels: &mut dyn ExactSizeIterator<Item = f64>| {
            let count = channels.len().max(1) as f64;
            channels.sum::<f64>() / count
        };
        let rows = self.rows_of_electrons(film, exposure, mean);
        let pixels = film.values.len() / self.response.bands.count();
        rows.map(|row| row.iter().sum::<f64>()).sum::<f64>() / pixels.max(1) as f64
    }

    /// Photo-electrons that the brightest `share` (0 to 1) of the pixels reach or pass in their brightest
    /// channel; what of the film is no light counts as 0 (e⁻).
    #[must_use]
    pub fn electrons_of_brightest(&self, film: Film<'_>, exposure: f64, share: f64) -> f64 {
        let most = |channels: &mut dyn ExactSizeIterator<Item = f64>| channels.fold(0.0, f64::max);
        let rows = self.rows_of_electrons(film, exposure, most);
        let mut electrons: Vec<f64> = rows.flatten().collect();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of it"
        )]
        let place = (share.clamp(0.0, 1.0) * electrons.len() as f64) as usize;
        let place = place.min(electrons.len().saturating_sub(1));
        match electrons.is_empty() {
            true => 0.0,
            false => *electrons.select_nth_unstable_by(place, |a, b| b.total_cmp(a)).1,
        }
    }

    /// Photo-electrons of the pixels, row by row; `of_pixel` makes one number of its channels.
    pub(crate) fn rows_of_electrons<'a>(
        &'a self,
        film: Film<'a>,
        exposure: f64,
        of_pixel: impl Fn(&mut dyn ExactSizeIterator<Item = f64>) -> f64 + Sync + Send + 'a,
    ) -> impl ParallelIterator<Item = Vec<f64>> + 'a {
        let bands = self.response.bands.count();
        let [width, _] = self.settings.resolution.map(|side| side as usize);
        let factor = match self.settings.radiometry {
            Radiometry::Digital => 1.0,
            Radiometry::Physical => exposure,
        };
        let electrons = move |channel: usize, light: &[f32]| -> f64 {
            let electrons = self.electrons_per_unit(channel).iter().zip(light);
            let seen = electrons.filter(|(_, value)| **value > 0.0 && value.is_finite());
            factor * seen.map(|(e, value)| e * f64::from(*value)).sum::<f64>()
        };
        let rows = film.values.par_chunks(width.max(1) * bands).enumerate();
        rows.map(move |(row, values)| {
            let pixels = values.chunks_exact(bands).enumerate();
            let pixel = |(column, light): (usize, &[f32])| match &self.response.pattern {
                Some(_) => electrons(self.channel_at(row, column), light),
                None => {
                    let channels = 0..self.response.channels.len();
                    of_pixel(&mut channels.map(|channel| electrons(channel, light)))
                }
            };
            pixels.map(pixel).collect()
        })
    }

    /// Temporal dark noise: of the read-out, and of the dark current in an exposure of `exposure`
    /// seconds (e⁻).
    #[must_use]
    pub fn dark_noise(&self, exposure: f64) -> f64 {
        let s = &self.settings;
        let offsets = s.row_noise.powi(2) + s.column_noise.powi(2);
        (s.read_noise.powi(2) + offsets + s.dark_current * exposure).sqrt()
    }

    /// Standard deviation of the way that carriers diffuse sideways (pixels).
    #[must_use]
    pub fn carrier_diffusion(&self) -> f64 {
        self.settings.effects.diffusion / self.settings.pixel_pitch
    }

    /// Bits of the converter.
    #[must_use]
    pub fn bit_depth(&self) -> u32 {
        self.settings.bit_depth
    }

    /// PRNU as a fraction, DSNU in electrons.
    #[must_use]
    pub fn non_uniformity(&self) -> [f64; 2] {
        [self.settings.prnu, self.settings.dsnu]
    }

    /// Notes for the user: keys that have no effect, values that look like a slip.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.settings.notes
    }

    /// Exposures that the scene asks for: every frame of every exposure, numbered through.
    pub fn shots(&self) -> impl Iterator<Item = Exposure> + '_ {
        let exposures = self.settings.exposures.iter();
        let each = exposures.flat_map(|&exposure| (0..self.settings.frames).map(move |_| exposure));
        each.zip(0..).map(|(exposure, frame)| Exposure { exposure, frame })
    }

    /// Returns the sensor with another noise model for its electrons.
    #[must_use]
    pub fn with_noise(mut self, noise: NoiseModel) -> Self {
        self.settings.noise = noise;
        self
    }

    /// The pixels with which something is wrong, row by row: column, row, channel of the image, and what.
    pub fn defects(&self) -> impl Iterator<Item = ([u32; 2], usize, Defect)> + '_ {
        let chain = self.chain(0.0, 0);
        let [width, height] = self.settings.resolution;
        let by_chance = self.settings.dead + self.settings.stuck + chain.hot[0] > 0.0;
        let rows = if by_chance || !chain.effects.listed.is_empty() { 0..height } else { 0..0 };
        rows.flat_map(move |row| {
            let mut found = Vec::new();
            for column in (0..width).filter(|_| by_chance) {
                for channel in 0..self.depth() {
                    #[expect(clippy::cast_possible_truncation, reason = "channels have 12 bits")]
                    let site = Site { row, channel: channel as u16, frame: 0 };
                    let kind = chain.defect_at(site, column);
                    found.extend(kind.map(|kind| ([column, row], channel, kind)));
                }
            }
            for channel in 0..self.depth() {
                #[expect(clippy::cast_possible_truncation, reason = "channels have 12 bits")]
                let listed = chain.effects.listed_in(row, 0..width, channel as u16);
                found.extend(listed.map(|at| ([at.column, row], channel, at.kind)));
            }
            found.sort_by_key(|(at, channel, _)| (*at, *channel));
            // What a map says of a pixel comes after what chance does, and holds.
            found.reverse();
            found.dedup_by_key(|(at, channel, _)| (*at, *channel));
            found.into_iter().rev()
        })
    }

    pub(crate) fn chain(&self, exposure: f64, seed: u64) -> Chain {
        let s = &self.settings;
        let hot = |hot: HotPixels| [hot.share, hot.dark_current * exposure];
        Chain {
            noise: s.noise,
            dark: s.dark_current * exposure,
            full_well: s.full_well,
            read_noise: s.read_noise,
            gain: s.gain,
            black: s.black,
            white: s.white(),
            prnu: s.prnu,
            dsnu: s.dsnu,
            dcnu: s.dcnu,
            hot: s.hot_pixels.map_or([0.0; 2], hot),
            dead: s.dead,
            stuck: s.stuck,
            effects: Arc::clone(&s.effects),
            temporal: PhiloxKey::temporal(seed, s.serial),
            second: match s.readout {
                ReadoutPath::First => None,
                ReadoutPath::Second => Some(PhiloxKey::temporal(!seed, s.serial)),
            },
            pattern: PhiloxKey::new(s.serial),
        }
    }
}
