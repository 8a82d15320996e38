//! A series evaluated after the linear model of EMVA 1288 (Release 4.0), apart from the code that made
//! it: from the images alone, with the standard error of each parameter.

use std::path::Path;

use etendue_sensor::emva::{MANIFEST, Manifest, SeriesStep};

/// A parameter as measured.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    pub(crate) value: f64,
    /// One standard error.
    pub(crate) error: f64,
}

/// Characteristics that a series tells of a sensor.
#[derive(Debug)]
pub(crate) struct Characterised {
    /// K (DN/e⁻).
    pub(crate) system_gain: Measured,
    /// η.
    pub(crate) quantum_efficiency: Measured,
    /// `σ_d` at no exposure time (e⁻).
    pub(crate) read_noise: Measured,
    /// From the mean of dark frames, and from their variance (e⁻/s).
    pub(crate) dark_current_by_mean: Measured,
    pub(crate) dark_current_by_variance: Measured,
    /// e⁻.
    pub(crate) dsnu: Measured,
    pub(crate) prnu: Measured,
    /// The greatest deviation of a signal from the straight line from 5 % of saturation on, in
    /// its own standard errors, and the mean size of these deviations (relative).
    pub(crate) worst_deviation: f64,
    pub(crate) linearity_error: f64,
}

/// The variance of rounding to whole numbers (DN²).
const ROUNDING: f64 = 1.0 / 12.0;

/// Signals and variances are looked at up to this part of saturation: near it some pixels clip, and
/// sooner the more they differ and the more dark electrons are in their wells.
const LINEAR: f64 = 0.7;

/// Mean and temporal variance of a pair of frames (DN, DN²).
#[derive(Debug, Clone, Copy)]
struct Pair {
    mean: f64,
    variance: f64,
}

/// One exposure time.
#[derive(Debug, Clone, Copy)]
struct Exposed {
    time: f64,
    photons: f64,
    bright: Pair,
    dark: Pair,
}

impl Exposed {
    fn signal(&self) -> f64 {
        self.bright.mean - self.dark.mean
    }
}

/// A point of a straight line and the variance of its ordinate.
struct Point {
    x: f64,
    y: f64,
    variance: f64,
}

impl Characterised {
    /// Evaluates the series in `folder` of a sensor that saturates at `saturation` (DN above dark).
    pub(crate) fn read(folder: &Path, saturation: f64) -> Self {
        let text = std::fs::read_to_string(folder.join(MANIFEST)).unwrap();
        let manifest: Manifest = serde_json::from_str(&text).unwrap();
        let steps: Vec<Exposed> = manifest.steps.iter().map(|step| exposed(folder, step)).collect();
        let pixels = image(folder, &manifest.spatial.bright[0]).len() as f64;
        let linear: Vec<&Exposed> =
            steps.iter().filter(|step| step.signal() < LINEAR * saturation).collect();

        // A variance of `pixels` halved squared differences is uncertain by √(2/pixels) of itself.
        let of_variance = |pair: &Pair| 2.0 * pair.variance.powi(2) / pixels;
        let of_mean = |pair: &Pair| pair.variance / (2.0 * pixels);
        let transfer = linear.iter().map(|s| Point {
            x: s.signal(),
            y: s.bright.variance - s.dark.variance,
            variance: of_variance(&s.bright) + of_variance(&s.dark),
        });
        let system_gain = through_origin(transfer);
        let gain = system_gain.value;
        let relative_gain = system_gain.error / gain;
        let response = linear.iter().map(|s| Point {
            x: s.photons,
            y: s.signal(),
            variance: of_mean(&s.bright) + of_mean(&s.dark),
        });
        let responsivity = through_origin(response);

        let times = steps.iter().map(|s| s.time);
        let dark_means = steps.iter().zip(times.clone()).map(|(s, x)| Point {
            x,
            y: s.dark.mean,
            variance: of_mean(&s.dark),
        });
        let dark_variances = steps.iter().zip(times).map(|(s, x)| Point {
            x,
            y: s.dark.variance,
            variance: of_variance(&s.dark),
        });
        let [_, mean_slope] = line(dark_means);
        let [start, variance_slope] = line(dark_variances);
        let read = ((start.value - ROUNDING) / (gain * gain)).sqrt();
        let read_error = start.error / (gain * gain) / (2.0 * read);

        let [bright, dark] = [&manifest.spatial.bright, &manifest.spatial.dark]
            .map(|files| Stack::read(folder, files));
        let signal = bright.mean - dark.mean;
        let [of_bright, of_dark] = [&bright, &dark].map(|stack| stack.spatial(pixels));
        let dsnu = of_dark.value.sqrt();
        let prnu = (of_bright.value - of_dark.value).sqrt() / signal;
        let prnu_error = of_bright.error.hypot(of_dark.error) / (2.0 * prnu * signal * signal);

        let efficiency = responsivity.value / gain;
        // The pixels that are looked at are themselves a sample of all.
        let of_sample = prnu / pixels.sqrt();
        let efficiency_error =
            (responsivity.error / responsivity.value).hypot(relative_gain).hypot(of_sample);
        let [worst_deviation, linearity_error] = deviations(&linear, saturation, pixels);
        let by_gain = |value: f64, error: f64, power: f64| Measured {
            value,
            error: error.hypot(power * relative_gain * value),
        };
        Self {
            system_gain,
            quantum_efficiency: Measured {
                value: efficiency,
                error: efficiency * efficiency_error,
            },
            read_noise: by_gain(read, read_error, 1.0),
            dark_current_by_mean: by_gain(mean_slope.value / gain, mean_slope.error / gain, 1.0),
            dark_current_by_variance: by_gain(
                variance_slope.value / (gain * gain),
                variance_slope.error / (gain * gain),
                2.0,
            ),
            dsnu: by_gain(dsnu / gain, of_dark.error / (2.0 * dsnu * gain), 1.0),
            prnu: Measured { value: prnu, error: prnu_error },
            worst_deviation,
            linearity_error,
        }
    }
}

/// Sixteen frames of one light.
struct Stack {
    mean: f64,
    /// Between the pixels' means.
    of_means: f64,
    /// Between a pixel's frames, on average.
    temporal: f64,
    frames: f64,
}

impl Stack {
    fn read(folder: &Path, files: &[String]) -> Self {
        let images: Vec<Vec<f64>> = files.iter().map(|name| image(folder, name)).collect();
        let (frames, pixels) = (images.len() as f64, images[0].len());
        let means: Vec<f64> =
            (0..pixels).map(|i| images.iter().map(|y| y[i]).sum::<f64>() / frames).collect();
        let scatter = |i: usize| images.iter().map(|y| (y[i] - means[i]).powi(2)).sum::<f64>();
        let temporal = (0..pixels).map(scatter).sum::<f64>() / (pixels as f64 * (frames - 1.0));
        let mean = means.iter().sum::<f64>() / pixels as f64;
        let squares: f64 = means.iter().map(|m| (m - mean).powi(2)).sum();
        Self { mean, of_means: squares / (pixels as f64 - 1.0), temporal, frames }
    }

    /// The variance of what differs between pixels and stays (DN²): the temporal noise that is left
    /// in the means is taken off.
    fn spatial(&self, pixels: f64) -> Measured {
        let left = self.temporal / self.frames;
        let error = self.of_means * (2.0 / pixels).sqrt();
        let of_left = left * (2.0 / (pixels * (self.frames - 1.0))).sqrt();
        Measured { value: self.of_means - left, error: error.hypot(of_left) }
    }
}

fn image(folder: &Path, name: &str) -> Vec<f64> {
    let image = image::open(folder.join(name)).unwrap().to_luma16();
    image.as_raw().iter().map(|&y| f64::from(y)).collect()
}

fn exposed(folder: &Path, step: &SeriesStep) -> Exposed {
    let pair = |files: &[String]| {
        let [a, b] = [0, 1].map(|i| image(folder, &files[i]));
        let count = a.len() as f64;
        let shift = a.iter().zip(&b).map(|(a, b)| a - b).sum::<f64>() / count;
        let squares: f64 = a.iter().zip(&b).map(|(a, b)| (a - b - shift).powi(2)).sum();
        let sum: f64 = a.iter().chain(&b).sum();
        Pair { mean: 0.5 * sum / count, variance: 0.5 * squares / (count - 1.0) }
    };
    let (bright, dark) = (pair(&step.bright), pair(&step.dark));
    Exposed { time: step.exposure_s, photons: step.photons, bright, dark }
}

/// The slope of a line through the origin, by weighted least squares.
fn through_origin(points: impl Iterator<Item = Point>) -> Measured {
    let (mut product, mut square) = (0.0, 0.0);
    for Point { x, y, variance } in points {
        product += x * y / variance;
        square += x * x / variance;
    }
    Measured { value: product / square, error: square.sqrt().recip() }
}

/// Ordinate at 0 and slope, by weighted least squares.
fn line(points: impl Iterator<Item = Point>) -> [Measured; 2] {
    let [mut s, mut sx, mut sy, mut sxx, mut sxy] = [0.0; 5];
    for Point { x, y, variance } in points {
        let weight = 1.0 / variance;
        s += weight;
        sx += weight * x;
        sy += weight * y;
        sxx += weight * x * x;
        sxy += weight * x * y;
    }
    let determinant = s * sxx - sx * sx;
    let measured = |value: f64, square: f64| Measured {
        value: value / determinant,
        error: (square / determinant).sqrt(),
    };
    [measured(sxx * sy - sx * sxy, sxx), measured(s * sxy - sx * sy, s)]
}

/// The signals' deviations from the straight line from 5 % of saturation on: the greatest in standard
/// errors, and the mean of their sizes, relative.
fn deviations(linear: &[&Exposed], saturation: f64, pixels: f64) -> [f64; 2] {
    let shown: Vec<&Exposed> =
        linear.iter().copied().filter(|step| step.signal() > 0.05 * saturation).collect();
    let variance = |s: &Exposed| (s.bright.variance + s.dark.variance) / (2.0 * pixels);
    let points = shown.iter().map(|s| Point { x: s.photons, y: s.signal(), variance: variance(s) });
    let [start, slope] = line(points);
    let deviation = |s: &Exposed| s.signal() - (start.value + slope.value * s.photons);
    let worst = shown.iter().map(|s| (deviation(s) / variance(s).sqrt()).abs()).fold(0.0, f64::max);
    let sizes: f64 = shown.iter().map(|s| (deviation(s) / s.signal()).abs()).sum();
    [worst, sizes / shown.len() as f64]
}
