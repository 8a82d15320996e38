//! Savings of samples that stop where they are enough, against the same number for every pixel: writes the
//! measured part of `docs/measurements/sampling.md` with its chart and its map.
//!
//! The light of each scene is scaled so that a quarter of the sensor's full well is filled in 10 ms, in the
//! mean over the picture. The variance of a picture is measured from pairs of other
//! seeds, never from a picture's own samples: per pixel and channel, the half of their squared difference,
//! carried to digital numbers and divided by the sensor's own variance.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

mod oracle;
mod study;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::Parser;
use etendue_bench::timing;
use etendue_chart::{Axis, Chart, Series, Theme};
use etendue_files::Transaction;
use etendue_render::Plan;
use etendue_render::output::{Outputs, png};
use serde_json::json;

use study::{Spread, Study, Wanted};

/// Behind this line the page is measured.
const MARK: &str = "<!-- Behind this line `make bench-sampling` writes. -->\n";

/// Exposure times (s) of the table, dim and bright, and of the chart.
const SHOWN: [f64; 2] = [0.0001, 0.001];
const CHARTED: [f64; 4] = [0.00003, 0.0001, 0.0003, 0.001];

/// Samples of pictures with the same number for each pixel. The variance of Sobol points does not fall evenly
/// between powers of two.
const COUNTS: [u32; 15] = [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024];

/// The variance that samples may have, as a share of the sensor's.
const FRACTION: f64 = 0.1;

/// The fewest samples that the oracle gives.
const FEWEST: f64 = 4.0;

/// The relative error of the other table.
const ERROR: f64 = 0.1;

/// The most samples.
const MOST: u32 = 2048;

#[derive(Parser)]
struct Arguments {
    /// The folder of the scenes.
    #[arg(long, default_value = "scenes")]
    scenes: PathBuf,
    /// The folder of the documents.
    #[arg(long, default_value = "docs")]
    docs: PathBuf,
    /// Columns of the pictures: of fewer, blocks of 8 pixels show little that differs.
    #[arg(long, default_value_t = 96)]
    width: u32,
    /// Measure fewer numbers of samples and exposure times.
    #[arg(long)]
    quick: bool,
    /// Measure these scenes alone, of those of the table.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Pairs of pictures that a variance is measured by.
    #[arg(long, default_value_t = PAIRS)]
    pairs: u64,
    /// Measure only what planning costs, and print it.
    #[arg(long)]
    planning: bool,
}

/// Amount of what is measured.
struct Effort {
    pairs: u64,
    counts: &'static [u32],
    charted: &'static [f64],
    most: u32,
}

impl Effort {
    fn of(quick: bool, pairs: u64) -> Self {
        match quick {
            false => Self { counts: &COUNTS, charted: &CHARTED, most: MOST, pairs },
            true => Self { counts: &COUNTS[..9], charted: &SHOWN, most: MOST, pairs },
        }
    }
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let effort = Effort::of(arguments.quick, arguments.pairs.max(1));
    if arguments.planning {
        let study = Study::open(&arguments.scenes.join("paper/fig3.json"), arguments.width)?;
        print!("{}", planner(("paper/fig3.json", &study)).trim_start());
        return Ok(());
    }
    let mut text = String::new();
    let _ = write!(
        text,
        "\n## Measured\n\n`make bench-sampling` measures this and writes it. Pictures of {} columns{}; variances by {} pairs \
         of pictures.\n\n",
        arguments.width,
        if arguments.quick { ", at the quick scale" } else { "" },
        effort.pairs
    );
    for line in timing::describe().into_iter().chain([timing::checkout()]) {
        let _ = writeln!(text, "- {line}");
    }
    let mut names = vec!["paper/fig3.json", "double-gauss.json", "sensor-noise.json"];
    names.retain(|name| arguments.only.is_empty() || arguments.only.iter().any(|own| own == name));
    anyhow::ensure!(!names.is_empty(), "--only names none of the scenes of the table");
    let open = |name: &&str| Study::open(&arguments.scenes.join(name), arguments.width);
    let studies: Vec<Study> = names.iter().map(open).collect::<Result<_, _>>()?;
    let uniform: Vec<Vec<PicturePairs>> = studies
        .iter()
        .map(|study| {
            effort.counts.iter().map(|n| PicturePairs::of(study, json!(n), effort.pairs)).collect()
        })
        .collect();
    let noise = noise_table(&effort, &names, &studies, &uniform);
    text += &noise.text;
    draw(&arguments.docs, &names, &noise.saved)?;
    text += "\n![Samples saved against exposure time](../images/sampling/saved.svg)\n";
    text += &relative_table(&effort, &names, &studies, &uniform);
    text += &map(&arguments.docs, (names[0], &studies[0]))?;
    text += &planner((names[0], &studies[0]));
    let path = arguments.docs.join("measurements/sampling.md");
    let page = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let written = page.split(MARK).next().unwrap_or_default().trim_end().to_owned();
    std::fs::write(&path, format!("{written}\n\n{MARK}{text}"))?;
    println!("{}", path.display());
    Ok(())
}

/// Pairs of pictures of other seeds: the variance of a block is told by 64 squares of each, and the worst hundredth of
/// blocks is that of what is measured.
const PAIRS: u64 = 4;

/// Pairs of pictures of other seeds, and the samples of one.
struct PicturePairs {
    pairs: Vec<[study::Picture; 2]>,
    mean_samples: f64,
}

impl PicturePairs {
    fn of(study: &Study, samples: serde_json::Value, pairs: u64) -> Self {
        let wanted = Wanted { samples, exposure: SHOWN[0] };
        Self::with(study, &wanted, pairs)
    }

    fn with(study: &Study, wanted: &Wanted, pairs: u64) -> Self {
        let pair = |k: u64| [2 * k + 1, 2 * k + 2].map(|seed| study.picture(wanted, seed));
        let pairs: Vec<_> = (0..pairs).map(pair).collect();
        let samples = pairs.iter().flatten().map(|picture| picture.samples);
        let mean_samples = samples.sum::<f64>() / (2 * pairs.len()) as f64;
        Self { pairs, mean_samples }
    }
}

struct NoiseTable {
    text: String,
    /// Of each scene: exposure time, and the same number for each pixel over the samples taken.
    saved: Vec<Vec<[f64; 2]>>,
}

fn noise_table(
    effort: &Effort,
    names: &[&str],
    studies: &[Study],
    uniform: &[Vec<PicturePairs>],
) -> NoiseTable {
    let mut text = format!(
        "\nUntil the variance of the samples is {FRACTION} of the sensor's. `as even`: a number for every pixel \
         with the same variance in the mean over the picture (so the same root mean square error of the sensor's \
         image), over the samples taken. `as good`: a number with which as many as nine tenths of all blocks of 8 × 8 \
         pixels have what nine tenths have here; `as good everywhere`: the same of 99 in 100. What lies beyond the numbers of samples measured ({} to {}) is extrapolated along \
         the nearest two, and marked. `oracle`: what could be saved there at best, by somebody who knows how the variance of \
         every block falls and gives each the fewest samples, {FEWEST} at least, with which 99 in 100 are as good; `of the \
         oracle`: the samples taken over those. `of two sequences`: the same, by an oracle whose pixels have two sequences of half \
         as many samples each, as here, where their difference tells the variance: what two cost or \
         save beside one that is twice as long, no rule can change.\n\n| scene | exposure | samples a pixel | variance, of the sensor's | as even | as good | as good everywhere | oracle | of the oracle | of two sequences |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
        effort.counts[0],
        effort.counts[effort.counts.len() - 1]
    );
    let mut saved = Vec::new();
    let mut factors = Vec::new();
    let mut of_oracles: [Vec<f64>; 2] = Default::default();
    for ((name, study), uniform) in names.iter().zip(studies).zip(uniform) {
        let mut line = Vec::new();
        let of_two = of_two_sequences(effort, study);
        for &exposure in effort.charted {
            let samples =
                json!({ "until": "sensor-noise", "fraction": FRACTION, "max": effort.most });
            let taken = PicturePairs::with(study, &Wanted { samples, exposure }, effort.pairs);
            let spread = |shot: &PicturePairs| study.noise_share(&shot.pairs, exposure);
            let own = spread(&taken);
            let curve = |of: &dyn Fn(Spread) -> f64| -> Vec<[f64; 2]> {
                uniform.iter().map(|shot| [shot.mean_samples, of(spread(shot))]).collect()
            };
            let (even, even_mark) = samples_for(&curve(&|s| s.mean), own.mean);
            let (good, good_mark) = samples_for(&curve(&|s| s.ninth), own.ninth);
            let (most, most_mark) = samples_for(&curve(&|s| s.most), own.most);
            line.push([exposure, good / taken.mean_samples]);
            if SHOWN.contains(&exposure) {
                let [oracle, of_two] = [uniform, &of_two].map(|shots| {
                    let of_blocks =
                        shots.iter().map(|shot| study.noise_shares(&shot.pairs, exposure));
                    let of_blocks: Vec<Vec<f64>> = of_blocks.collect();
                    oracle::samples(effort.counts, &of_blocks, own.most, FEWEST)
                });
                factors.push([even, good, most].map(|samples| samples / taken.mean_samples));
                let ratios = [oracle, of_two].map(|samples| taken.mean_samples / samples);
                of_oracles.iter_mut().zip(ratios).for_each(|(all, ratio)| all.push(ratio));
                let [of_oracle, of_two] = ratios;
                let _ = writeln!(
                    text,
                    "| `{name}` | {} ms | {:.0} | {:.3} | {:.1}{even_mark} | {:.1}{good_mark} | {:.1}{most_mark} | {:.1}{most_mark} | {of_oracle:.2} | {of_two:.2} |",
                    exposure * 1e3,
                    taken.mean_samples,
                    own.mean,
                    even / taken.mean_samples,
                    good / taken.mean_samples,
                    most / taken.mean_samples,
                    most / oracle
                );
            }
        }
        saved.push(line);
    }
    for (k, words) in ["as even", "as good", "as good everywhere"].into_iter().enumerate() {
        let middle = median(&mut factors.iter().map(|each| each[k]).collect::<Vec<f64>>());
        let _ = write!(
            text,
            "\nMedian, {words}: one number for all takes **{middle:.1} times the samples** (goal: 4).\n"
        );
    }
    for (mut all, words) in
        of_oracles.into_iter().zip(["the oracle", "the oracle of two sequences"])
    {
        let _ = write!(
            text,
            "\nMedian, of {words}: **{:.2} times its samples** (goal: 1.5).\n",
            median(&mut all)
        );
    }
    NoiseTable { text, saved }
}

/// Pictures of each number of samples whose pixels have two sequences of half as many, as where samples stop.
fn of_two_sequences(effort: &Effort, study: &Study) -> Vec<PicturePairs> {
    let of = |n: &u32| {
        let samples = json!({ "until": "sensor-noise", "fraction": FRACTION, "min": n, "max": n });
        PicturePairs::of(study, samples, effort.pairs)
    };
    effort.counts.iter().map(of).collect()
}

fn median(all: &mut [f64]) -> f64 {
    all.sort_by(f64::total_cmp);
    0.5 * (all[(all.len() - 1) / 2] + all[all.len() / 2])
}

fn relative_table(
    effort: &Effort,
    names: &[&str],
    studies: &[Study],
    uniform: &[Vec<PicturePairs>],
) -> String {
    let mut text = format!(
        "\nUntil a relative error of {ERROR}, against a number for every pixel with the same error in the worst tenth of \
         all blocks (goal: 2):\n\n| scene | samples a pixel | error of the worst tenth | one number for all over the samples taken |\n\
         |---|---|---|---|\n"
    );
    for ((name, study), uniform) in names.iter().zip(studies).zip(uniform) {
        let samples = json!({ "relative_error": ERROR, "max": effort.most });
        let taken = PicturePairs::of(study, samples, effort.pairs);
        let spread = |shot: &PicturePairs| study.relative_variance(&shot.pairs).ninth;
        let curve: Vec<[f64; 2]> =
            uniform.iter().map(|shot| [shot.mean_samples, spread(shot)]).collect();
        let (samples, mark) = samples_for(&curve, spread(&taken));
        let _ = writeln!(
            text,
            "| `{name}` | {:.0} | {:.3} | {:.1}{mark} |",
            taken.mean_samples,
            spread(&taken).sqrt(),
            samples / taken.mean_samples
        );
    }
    text
}

/// The samples at which a curve of samples and variances, which falls, is `variance`; and a mark when that is
/// beyond it.
fn samples_for(curve: &[[f64; 2]], variance: f64) -> (f64, &'static str) {
    let logs: Vec<[f64; 2]> = curve.iter().map(|point| point.map(f64::ln)).collect();
    let wanted = variance.max(1e-300).ln();
    let within = logs.windows(2).find(|pair| pair[1][1] <= wanted);
    let mark = if within.is_none() || logs[0][1] < wanted { " *" } else { "" };
    let pair = within.unwrap_or(&logs[logs.len() - 2..]);
    let slope = ((pair[1][0] - pair[0][0]) / (pair[1][1] - pair[0][1])).clamp(-2.0, -0.3);
    ((pair[0][0] + slope * (wanted - pair[0][1])).exp(), mark)
}

fn draw(docs: &Path, names: &[&str], saved: &[Vec<[f64; 2]>]) -> anyhow::Result<()> {
    let folder = docs.join("images/sampling");
    std::fs::create_dir_all(&folder)?;
    let series = names.iter().zip(saved).enumerate();
    let chart = Chart {
        title: "Samples saved against exposure time".to_owned(),
        axes: [
            Axis::new("exposure time (s)"),
            Axis::new("one number for all over the samples taken"),
        ],
        series: series
            .map(|(k, (name, line))| Series { colour: k, ..Series::line(*name, line.clone()) })
            .collect(),
        ..Chart::default()
    };
    std::fs::write(folder.join("saved.svg"), chart.svg(Theme::Reader))?;
    Ok(())
}

/// The map of samples as a picture.
fn map(docs: &Path, (name, study): (&str, &Study)) -> anyhow::Result<String> {
    let samples = json!({ "until": "sensor-noise", "fraction": FRACTION, "max": 512 });
    let rendered = study.rendered(&Wanted { samples, exposure: SHOWN[1] }, 1);
    let path = docs.join("images/sampling/map.png");
    png::write(&Transaction::at_once(), &path, &rendered.picture, "SampleCount", png::Bits::Eight)?;
    let counts = rendered.sample_counts.context("samples are counted")?;
    let [fewest, most] = [counts.least, counts.most];
    Ok(format!(
        "\nWhere the samples of `{name}` go at {} ms: {fewest} (dark) to {most} (bright) a pixel.\n\n\
         ![Samples of each pixel](../images/sampling/map.png)\n",
        SHOWN[1] * 1e3
    ))
}

/// Cost of planning beyond loading.
fn planner((name, study): (&str, &Study)) -> String {
    let wanted = Wanted { samples: json!(64), exposure: SHOWN[0] };
    let scene = study.scene(&wanted, 0);
    let mut times: Vec<f64> = (0..50)
        .map(|_| {
            let start = Instant::now();
            std::hint::black_box(Plan::new(&scene, Outputs::ALL));
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    format!(
        "\nPlanning `{name}` takes {:.3} ms beyond loading (median of 50; goal: 1).\n",
        times[25]
    )
}
