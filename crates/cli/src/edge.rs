//! `etendue edge`: the modulation transfer of a camera, from a picture of a slanted edge.

use std::fmt::Write as _;
use std::io::Write as _;

use etendue::{Still, places};
use etendue_chart::{Axis, Chart, Series, Theme};
use etendue_files::Transaction;
use etendue_report::{Cell, Table};
use etendue_sensor::slanted_edge::{Lattice, SlantedEdge, slanted_edge};
use serde::Serialize;

use crate::arguments::EdgeArguments;
use crate::fault::{Fault, print_json, print_text};
use crate::progress::say;

/// File of the drawing, and of the table beside it.
const DRAWING: &str = "edge.svg";
const TABLE: &str = "edge.csv";

/// Measurements of an image's edges, for machines.
#[derive(Debug, Serialize)]
struct EdgeMeasurement {
    version: u32,
    image: String,
    /// Left column, top row, width and height.
    region: [usize; 4],
    lattice: Lattice,
    /// µm
    pitch: Option<f64>,
    channels: Vec<MeasuredChannel>,
}

#[derive(Debug, Serialize)]
struct MeasuredChannel {
    channel: String,
    #[serde(flatten)]
    edge: SlantedEdge,
    /// cycles/mm
    mtf50_mm: Option<f64>,
}

pub(crate) fn run(arguments: &EdgeArguments) -> Result<(), Fault> {
    let name = arguments.image.display().to_string();
    let refused = |why: String| Fault::refused(format!("{name}: {why}"));
    let still = Still::open(&arguments.image)?;
    let planes = planes(&still, arguments).map_err(refused)?;
    let [width, height] = still.size();
    let region @ [x, y, columns, rows] = arguments.region.unwrap_or([0, 0, width, height]);
    if x.checked_add(columns).is_none_or(|end| end > width)
        || y.checked_add(rows).is_none_or(|end| end > height)
    {
        let why = format!(
            "--region {x},{y},{columns},{rows} reaches beyond its {width} x {height} pixels"
        );
        return Err(refused(why));
    }
    let lattice = match arguments.mosaic {
        // Counted in the picture, not in the region.
        Some([column, row]) => Lattice { step: [2, 2], first: [(column + x) % 2, (row + y) % 2] },
        None => Lattice::ALL,
    };
    let mut channels = Vec::new();
    for (channel, values) in planes {
        let part: Vec<f64> = (y..y + rows)
            .flat_map(|row| &values[row * width + x..row * width + x + columns])
            .copied()
            .collect();
        let edge = slanted_edge(&part, [columns, rows], lattice).map_err(|error| {
            refused(format!("channel {channel}, region {x},{y},{columns},{rows}: {error}"))
        })?;
        let a_millimetre = |frequency: f64| arguments.pitch.map(|pitch| frequency / pitch * 1e3);
        let mtf50_mm = edge.mtf50.and_then(a_millimetre);
        channels.push(MeasuredChannel { channel, edge, mtf50_mm });
    }
    let measured = EdgeMeasurement {
        version: 1,
        image: name,
        region,
        lattice,
        pitch: arguments.pitch,
        channels,
    };
    write(&measured, arguments)?;
    if arguments.json {
        return print_json(&measured);
    }
    print_text(&table(&measured).to_string())
}

/// The channels to measure, with their values.
fn planes(still: &Still, arguments: &EdgeArguments) -> Result<Vec<(String, Vec<f64>)>, String> {
    if arguments.raw {
        return still.numbers().ok_or_else(|| {
            "has no integers: its values are light already\nhint: leave out --raw".to_owned()
        });
    }
    let layers = still.layers();
    let found = layers.iter().find(|layer| layer.name == arguments.layer);
    let Some(layer) = found.or(layers.first().filter(|_| arguments.layer.is_empty())) else {
        let name = |name: &str| if name.is_empty() { "the picture" } else { name }.to_owned();
        let names: Vec<String> = layers.iter().map(|layer| name(&layer.name)).collect();
        return Err(format!("--layer {}: it has {}", arguments.layer, names.join(", ")));
    };
    let channels = layer.channels.iter().map(|channel| {
        let values = (0..channel.values.len()).map(|i| channel.values.at(i)).collect();
        (channel.name.clone(), values)
    });
    Ok(channels.collect())
}

fn table(measured: &EdgeMeasurement) -> Table {
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(Cell::none, |value| Cell::number(value, format!("{value:.digits$}")))
    };
    let row = |measured: &MeasuredChannel| {
        let edge = &measured.edge;
        let at = |frequency: f64| number(Some(edge.modulation_at(frequency)), 3);
        let mut cells = vec![
            ("channel", Cell::word(&measured.channel)),
            ("lies", Cell::word(if edge.is_upright { "upright" } else { "level" })),
            ("angle (degrees)", number(Some(edge.angle), 2)),
            ("straight to (px)", number(Some(edge.straightness), 3)),
            ("contrast", number(Some(edge.contrast), 3)),
            ("overshoot", number(Some(edge.overshoot), 3)),
            ("MTF50 (cycles/px)", number(edge.mtf50, 3)),
        ];
        if measured.mtf50_mm.is_some() {
            cells.push(("MTF50 (cycles/mm)", number(measured.mtf50_mm, 1)));
        }
        cells.extend([("MTF at 1/8", at(0.125)), ("at 1/4", at(0.25)), ("at 1/2", at(0.5))]);
        cells
    };
    Table::of_rows(measured.channels.iter().map(row).collect())
}

/// Writes the drawing and the table, where a folder is named.
fn write(measured: &EdgeMeasurement, arguments: &EdgeArguments) -> Result<(), Fault> {
    let Some(folder) = &arguments.output else { return Ok(()) };
    let paths = [DRAWING, TABLE].map(|name| folder.join(name));
    let inputs = [arguments.image.clone()];
    places::keep_apart(&inputs, &paths)?;
    places::folder(folder)?;
    let to = Transaction::at_once().keeping(&inputs);
    for (path, text) in paths.iter().zip([drawing(measured), csv(measured)]) {
        to.write(path, |file| file.write_all(text.as_bytes()))?;
        if !arguments.quiet {
            say(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}

fn csv(measured: &EdgeMeasurement) -> String {
    let mut text = "cycles_a_pixel".to_owned();
    for channel in &measured.channels {
        let _ = write!(text, ",{}", channel.channel);
    }
    text.push_str(",pixels\n");
    let Some(first) = measured.channels.first() else { return text };
    for (k, [frequency, _]) in first.edge.modulation.iter().enumerate() {
        let _ = write!(text, "{frequency:.2}");
        for channel in &measured.channels {
            let _ = write!(text, ",{:.6}", channel.edge.modulation[k][1]);
        }
        let _ = writeln!(text, ",{:.6}", first.edge.modulation_of_pixels(*frequency));
    }
    text
}

fn drawing(measured: &EdgeMeasurement) -> String {
    let curve = |(number, channel): (usize, &MeasuredChannel)| Series {
        colour: number % 7,
        ..Series::curve(channel.channel.clone(), channel.edge.modulation.clone())
    };
    let series = measured.channels.iter().enumerate().map(curve).collect();
    let axes = [Axis::linear("cycles a pixel"), Axis::linear("modulation")];
    let title = "Modulation across the edge, pixels included".to_owned();
    Chart { title, axes, series, ..Chart::default() }.svg(Theme::Reader)
}
