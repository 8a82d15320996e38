//! The slanted edge: the modulation transfer of a whole camera from a picture of a straight edge, by the
//! method e-SFR of ISO 12233.
//!
//! 1. In each line across the edge, the centroid of the differences of neighbours is where it lies, with
//!    Hamming's window about where it is expected. A straight line through the centroids is the edge.
//! 2. Every pixel has a distance from that line. Means over a quarter of a pixel of distance are the edge
//!    spread function, sampled four times as finely as the pixels lie.
//! 3. Its differences are the line spread function, under a window of Tukey's whose middle half is flat
//!    (Hamming's, of the editions up to 2017, takes from wide spreads).
//! 4. The modulus of its Fourier transform over that at 0 is the modulation, divided by what the means over
//!    a quarter of a pixel and differences over two of them take.
//!
//! Frequencies are in cycles a pixel across the edge. The pixels' own transfer is in the result:
//! sinc(ν cos θ) sinc(ν sin θ) of square ones without gaps, at an edge that is turned by θ.
//!
//! # Sources
//!
//! ISO 12233:2017, annex D; P. D. Burns, "Slanted-edge MTF for digital camera and scanner analysis", *Proc.
//! IS&T PICS*, 135 (2000).

use serde::Serialize;

/// Samples of the edge spread function a pixel.
const FINE: f64 = 4.0;

/// Angles between the edge and rows or columns that can be measured (degrees).
const ANGLES: [f64; 2] = [0.5, 44.0];

/// Times that the edge is looked for about where it was found.
const LOOKS: u32 = 4;

/// The fewest pixels a side.
const FEWEST: usize = 16;

/// A step under this share of the noise in the region's values is no edge.
const CLEAR: f64 = 4.0;

/// Pixels that count: all, or those of one colour of a mosaic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Lattice {
    /// Every so many columns and rows.
    pub step: [usize; 2],
    /// The first column and row.
    pub first: [usize; 2],
}

impl Lattice {
    /// All pixels.
    pub const ALL: Self = Self { step: [1, 1], first: [0, 0] };
}

/// Measurements of a slanted edge.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SlantedEdge {
    /// The edge's angle from the column or row that it is nearest to (degrees), positive clockwise for an
    /// upright edge in a picture whose rows go down.
    pub angle: f64,
    /// True if it is nearer to upright than to level.
    pub is_upright: bool,
    /// Place where it crosses the region's middle line (pixels from the region's corner).
    pub position: f64,
    /// Root mean square of the lines' centroids from the straight line (pixels).
    pub straightness: f64,
    /// The levels on the dark and the bright side.
    pub levels: [f64; 2],
    /// Michelson's contrast of these.
    pub contrast: f64,
    /// Excess of the edge spread function over the levels, as a share of the step: sharpening.
    pub overshoot: f64,
    /// Distances from the edge (pixels) and the line spread function there (1/pixel).
    pub line_spread: Vec<[f64; 2]>,
    /// Frequencies (cycles a pixel) and the modulation there.
    pub modulation: Vec<[f64; 2]>,
    /// The lowest frequency (cycles a pixel) at which the modulation is a half; none below 1.
    pub mtf50: Option<f64>,
}

/// Error of a region without an edge that tells anything.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EdgeError {
    /// Too small.
    #[error("{} x {} pixels are too few for an edge: take {FEWEST} a side or more", .0[0], .0[1])]
    Small([usize; 2]),
    /// Not numbers.
    #[error("{0} of its values are not finite: choose a region of finite ones")]
    NotFinite(usize),
    /// No step.
    #[error(
        "there is no edge in it: dark and bright side differ by {step:.3e}, and values scatter by \
         {noise:.3e} about them\nhint: choose a region that one edge crosses from side to side"
    )]
    NoStep {
        /// Between the means of both sides.
        step: f64,
        /// Standard deviation about them.
        noise: f64,
    },
    /// Clipped, or several edges.
    #[error(
        "the edge leaves the region, or there are several: choose one that one edge crosses from side to side"
    )]
    NotOne,
    /// Not slanted, or too much.
    #[error(
        "the edge is turned by {0:.2} degrees from rows or columns: it is to be between 0.5 and 44, about 5 \
         at best, so that pixels lie at all distances from it"
    )]
    Angle(f64),
    /// Distances without pixels.
    #[error("no pixel lies {0:.2} pixels from the edge: choose a longer part of it")]
    Gap(f64),
}

/// Measures the edge that crosses a region of a picture: `values` row by row, `size` columns and rows.
///
/// # Errors
///
/// When the region is too small, has values that are not finite, or there is no one straight, slanted
/// edge in it.
pub fn slanted_edge(
    values: &[f64],
    size: [usize; 2],
    lattice: Lattice,
) -> Result<SlantedEdge, EdgeError> {
    let [width, height] = size;
    let step = lattice.step.map(|step| step.max(1));
    if size.iter().zip(step).any(|(&side, step)| side / step < FEWEST)
        || values.len() < width * height
    {
        return Err(EdgeError::Small(size));
    }
    let wrong = values.iter().filter(|value| !value.is_finite()).count();
    if wrong > 0 {
        return Err(EdgeError::NotFinite(wrong));
    }
    let taken = |axis: usize, side: usize| -> Vec<usize> {
        (lattice.first[axis].min(side)..side).step_by(step[axis]).collect()
    };
    let (columns, rows) = (taken(0, width), taken(1, height));
    let value = |x: usize, y: usize| values[rows[y] * width + columns[x]];
    // Lines across the edge are rows when it is more upright than level.
    let mean = |over: &mut dyn Iterator<Item = f64>| over.sum::<f64>().abs();
    let across = (0..rows.len())
        .map(|y| mean(&mut (1..columns.len()).map(|x| value(x, y) - value(x - 1, y))))
        .sum::<f64>()
        / rows.len() as f64;
    let down = (0..columns.len())
        .map(|x| mean(&mut (1..rows.len()).map(|y| value(x, y) - value(x, y - 1))))
        .sum::<f64>()
        / columns.len() as f64;
    let is_upright = across >= down;
    let (along, lines) = if is_upright { (&columns, &rows) } else { (&rows, &columns) };
    let at = |k: usize, line: usize| if is_upright { value(k, line) } else { value(line, k) };
    let place = |indices: &[usize], k: usize| indices[k] as f64 + 0.5;
    let grid = EdgeProfiles {
        places: (0..along.len()).map(|k| place(along, k)).collect(),
        lines: (0..lines.len()).map(|k| place(lines, k)).collect(),
        values: (0..lines.len())
            .map(|line| (0..along.len()).map(|k| at(k, line)).collect())
            .collect(),
    };
    grid.measure(
        is_upright,
        if is_upright { width } else { height },
        if is_upright { height } else { width },
    )
}

/// Lines across the edge.
struct EdgeProfiles {
    /// Places along a line (pixels).
    places: Vec<f64>,
    /// Places of the lines (pixels).
    lines: Vec<f64>,
    values: Vec<Vec<f64>>,
}

/// A straight line x = `start` + `slope` y.
#[derive(Debug, Clone, Copy)]
struct Edge {
    start: f64,
    slope: f64,
}

impl Edge {
    fn at(self, y: f64) -> f64 {
        self.start + self.slope * y
    }
}

/// Crossing of an edge with a line.
struct Crossing {
    /// Place of the line (pixels).
    line: f64,
    /// Place along it (pixels).
    place: f64,
}

impl EdgeProfiles {
    fn measure(
        &self,
        is_upright: bool,
        width: usize,
        height: usize,
    ) -> Result<SlantedEdge, EdgeError> {
        let mut edge: Option<Edge> = None;
        let mut straightness = 0.0;
        for _ in 0..LOOKS {
            let centroids = self.centroids(edge, width as f64)?;
            let fit = straight(&centroids);
            let square = |at: &Crossing| (at.place - fit.at(at.line)).powi(2);
            straightness =
                (centroids.iter().map(square).sum::<f64>() / centroids.len() as f64).sqrt();
            edge = Some(fit);
        }
        let Some(edge) = edge else { return Err(EdgeError::NotOne) };
        let angle = edge.slope.atan().to_degrees();
        self.check_step(edge)?;
        if !(ANGLES[0]..=ANGLES[1]).contains(&angle.abs()) {
            return Err(EdgeError::Angle(angle.abs()));
        }
        let cosine = edge.slope.atan().cos();
        // As far as all lines reach on both sides.
        let reach = |line: f64| edge.at(line).min(width as f64 - edge.at(line));
        let reach = self.lines.iter().map(|&line| reach(line)).fold(f64::INFINITY, f64::min);
        let reach = (reach - 1.0) * cosine;
        if reach < 3.0 {
            return Err(EdgeError::NotOne);
        }
        let spread = self.edge_spread(edge, cosine, reach)?;
        let fit = EdgeFit { edge, is_upright, straightness, middle: 0.5 * height as f64 };
        Ok(fit.with_spread(&spread))
    }

    /// Crossings of the edge with each line.
    fn centroids(&self, about: Option<Edge>, width: f64) -> Result<Vec<Crossing>, EdgeError> {
        let mut found = Vec::new();
        for (&line, values) in self.lines.iter().zip(&self.values) {
            let middle = about.map_or(0.5 * width, |edge| edge.at(line));
            let half = match about {
                Some(_) => middle.min(width - middle).max(2.0),
                None => width,
            };
            let (mut sum, mut moment) = (0.0, 0.0);
            for (pair, places) in values.windows(2).zip(self.places.windows(2)) {
                let place = 0.5 * (places[0] + places[1]);
                let share = (place - middle) / half;
                if share.abs() > 1.0 {
                    continue;
                }
                let window = 0.54 + 0.46 * (std::f64::consts::PI * share).cos();
                let difference = (pair[1] - pair[0]) * window;
                sum += difference;
                moment += difference * place;
            }
            let place = moment / sum;
            if place.is_finite() && (0.0..width).contains(&place) {
                found.push(Crossing { line, place });
            }
        }
        // Most lines have to be crossed.
        if found.len() * 10 < self.lines.len() * 9 { Err(EdgeError::NotOne) } else { Ok(found) }
    }

    /// Refuses an edge whose sides do not differ.
    fn check_step(&self, edge: Edge) -> Result<(), EdgeError> {
        let mut sides = [(0.0, 0.0, 0.0); 2];
        for (&line, values) in self.lines.iter().zip(&self.values) {
            for (&place, &value) in self.places.iter().zip(values) {
                let (count, sum, square) = &mut sides[usize::from(place > edge.at(line))];
                (*count, *sum, *square) = (*count + 1.0, *sum + value, *square + value * value);
            }
        }
        let [low, high] = sides.map(|(count, sum, _)| sum / count);
        let variance =
            sides.map(|(count, sum, square)| (square / count - (sum / count).powi(2)).max(0.0));
        let (step, noise) = ((high - low).abs(), variance[0].max(variance[1]).sqrt());
        // The mean of many pixels differs by much less than one of them.
        let of_mean = noise / sides[0].0.min(sides[1].0).max(1.0).sqrt();
        let is_clear = step > CLEAR * of_mean && step > 0.0 && step > 0.2 * noise;
        if is_clear { Ok(()) } else { Err(EdgeError::NoStep { step, noise }) }
    }

    /// The edge spread function in quarters of a pixel from −`reach` to `reach`: distance and value.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the reach")]
    fn edge_spread(&self, edge: Edge, cosine: f64, reach: f64) -> Result<Vec<[f64; 2]>, EdgeError> {
        let half = (reach * FINE).floor();
        let count = 2 * half as usize + 1;
        let mut bins = vec![[0.0; 3]; count];
        for (&line, values) in self.lines.iter().zip(&self.values) {
            for (&place, &value) in self.places.iter().zip(values) {
                let distance = (place - edge.at(line)) * cosine;
                let bin = (distance * FINE).round() + half;
                if bin >= 0.0 && bin < count as f64 {
                    let [number, sum, at] = &mut bins[bin as usize];
                    (*number, *sum, *at) = (*number + 1.0, *sum + value, *at + distance);
                }
            }
        }
        let middle = |k: usize| (k as f64 - half) / FINE;
        if let Some(empty) = bins.iter().position(|bin| bin[0] == 0.0) {
            return Err(EdgeError::Gap(middle(empty).abs()));
        }
        // A mean stands at the mean of its pixels' distances: along the line to its neighbours it is moved
        // to the middle of its quarter.
        let mean = |k: usize| [bins[k][2] / bins[k][0], bins[k][1] / bins[k][0]];
        let at = |k: usize| {
            let [here, value] = mean(k);
            let [a, b] = [mean(k.saturating_sub(1)), mean((k + 1).min(count - 1))];
            let slope = if b[0] > a[0] { (b[1] - a[1]) / (b[0] - a[0]) } else { 0.0 };
            [middle(k), value + slope * (middle(k) - here)]
        };
        Ok((0..count).map(at).collect())
    }
}

/// The straight line through crossings, by least squares.
fn straight(crossings: &[Crossing]) -> Edge {
    let count = crossings.len() as f64;
    let mean = |of: &dyn Fn(&Crossing) -> f64| crossings.iter().map(of).sum::<f64>() / count;
    let (y, x) = (mean(&|at| at.line), mean(&|at| at.place));
    let (mut square, mut product) = (0.0, 0.0);
    for at in crossings {
        square += (at.line - y).powi(2);
        product += (at.line - y) * (at.place - x);
    }
    let slope = if square > 0.0 { product / square } else { 0.0 };
    Edge { start: x - slope * y, slope }
}

/// Position of an edge.
struct EdgeFit {
    edge: Edge,
    is_upright: bool,
    /// Root mean square of the lines' centroids from it (pixels).
    straightness: f64,
    /// The region's middle line (pixels).
    middle: f64,
}

impl EdgeFit {
    /// The edge with what its edge spread function tells.
    fn with_spread(&self, spread: &[[f64; 2]]) -> SlantedEdge {
        let count = spread.len();
        let tenth = (count / 10).max(1);
        let mean = |part: &[[f64; 2]]| part.iter().map(|at| at[1]).sum::<f64>() / part.len() as f64;
        let ends = [mean(&spread[..tenth]), mean(&spread[count - tenth..])];
        let levels = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let step = levels[1] - levels[0];
        let (least, most) =
            spread.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
                (least.min(at[1]), most.max(at[1]))
            });
        let overshoot = (levels[0] - least).max(most - levels[1]).max(0.0) / step;
        // Differences over two quarters, under the window.
        let reach = spread[count - 1][0];
        let window = |distance: f64| {
            let beyond = (distance.abs() / reach - 0.5).max(0.0) / 0.5;
            0.5 + 0.5 * (std::f64::consts::PI * beyond.min(1.0)).cos()
        };
        let lines: Vec<[f64; 2]> = (1..count - 1)
            .map(|k| {
                let distance = spread[k][0];
                let slope = (spread[k + 1][1] - spread[k - 1][1]) * 0.5 * FINE;
                [distance, slope * window(distance) / (ends[1] - ends[0])]
            })
            .collect();
        let mut edge = SlantedEdge {
            angle: self.edge.slope.atan().to_degrees(),
            is_upright: self.is_upright,
            position: self.edge.at(self.middle),
            straightness: self.straightness,
            levels,
            contrast: step / (levels[0] + levels[1]),
            overshoot,
            line_spread: lines,
            modulation: Vec::new(),
            mtf50: None,
        };
        edge.modulation =
            (0..=100).map(|k| f64::from(k) * 0.01).map(|f| [f, edge.modulation_at(f)]).collect();
        edge.mtf50 = edge.modulation.windows(2).find(|pair| pair[1][1] < 0.5).map(|pair| {
            let [[low, a], [high, b]] = [pair[0], pair[1]];
            low + (high - low) * ((a - 0.5) / (a - b)).clamp(0.0, 1.0)
        });
        edge
    }
}

impl SlantedEdge {
    /// The modulation at a frequency (cycles a pixel, up to 1), the pixels' own included.
    #[must_use]
    pub fn modulation_at(&self, frequency: f64) -> f64 {
        let (mut cosines, mut sines, mut sum) = (0.0, 0.0, 0.0);
        for [distance, value] in &self.line_spread {
            let angle = std::f64::consts::TAU * frequency * distance;
            cosines += value * angle.cos();
            sines += value * angle.sin();
            sum += value;
        }
        let sinc = |x: f64| {
            let x = std::f64::consts::PI * x;
            if x.abs() < 1e-9 { 1.0 } else { x.sin() / x }
        };
        let taken = sinc(frequency / FINE) * sinc(2.0 * frequency / FINE);
        cosines.hypot(sines) / sum.abs() / taken.abs().max(0.1)
    }

    /// Modulation of square pixels without gaps at a frequency (cycles a pixel) across the edge:
    /// what the modulation is to be divided by for that of the lens alone.
    #[must_use]
    pub fn modulation_of_pixels(&self, frequency: f64) -> f64 {
        let turn = self.angle.to_radians();
        let sinc = |x: f64| {
            let x = std::f64::consts::PI * x;
            if x.abs() < 1e-9 { 1.0 } else { x.sin() / x }
        };
        sinc(frequency * turn.cos()) * sinc(frequency * turn.sin())
    }
}
