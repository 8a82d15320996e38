//! Charts as SVG.

use svg::node::element::path::Data;
use svg::node::element::{Circle, Line, Path, Rectangle, Style, Text};
use svg::{Document, Node};

use crate::axis::Scale;
use crate::chart::{Chart, Mark, Point, Theme};
use crate::front::front;
use crate::names::{self, Area, LINE, Obstacle};

const WIDTH: f64 = 860.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 22.0;
const HEAD: f64 = 40.0;
const NOTE: f64 = 18.0;
const PLOT: f64 = 420.0;
const FOOT: f64 = 54.0;

/// Colours by theme.
const LIGHT: &str = "\
text { font-family: sans-serif; font-size: 12px; fill: #24292f; }
.title { font-size: 16px; } .small { font-size: 11px; fill: #57606a; }
.paper { fill: #ffffff; } .halo { fill: #ffffff; fill-opacity: 0.82; }
.ink { stroke: #57606a; fill: none; } .faint { stroke: #d8dee4; fill: none; }
.front { stroke: #57606a; stroke-opacity: 0.3; fill: none; stroke-width: 7px; }
.ring { fill: #ffffff; }
.s0 { stroke: #0550ae; } .s1 { stroke: #1a7f37; } .s2 { stroke: #cf222e; }
.s3 { stroke: #8250df; } .s4 { stroke: #bc4c00; } .s5 { stroke: #0b7285; }
.s6 { stroke: #bf3989; } .s7 { stroke: #57606a; }
.f0 { fill: #0550ae; } .f1 { fill: #1a7f37; } .f2 { fill: #cf222e; }
.f3 { fill: #8250df; } .f4 { fill: #bc4c00; } .f5 { fill: #0b7285; }
.f6 { fill: #bf3989; } .f7 { fill: #57606a; }
";

const DARK: &str = "\
@media (prefers-color-scheme: dark) {
text { fill: #e6edf3; } .small { fill: #9198a1; }
.paper { fill: #0d1117; } .halo { fill: #0d1117; } .ring { fill: #0d1117; }
.ink { stroke: #9198a1; } .faint { stroke: #30363d; } .front { stroke: #9198a1; }
.s0 { stroke: #79c0ff; } .s1 { stroke: #56d364; } .s2 { stroke: #ff7b72; }
.s3 { stroke: #d2a8ff; } .s4 { stroke: #ffa657; } .s5 { stroke: #66d9e8; }
.s6 { stroke: #ff9bce; } .s7 { stroke: #b1bac4; }
.f0 { fill: #79c0ff; } .f1 { fill: #56d364; } .f2 { fill: #ff7b72; }
.f3 { fill: #d2a8ff; } .f4 { fill: #ffa657; } .f5 { fill: #66d9e8; }
.f6 { fill: #ff9bce; } .f7 { fill: #b1bac4; }
}
";

/// Colours that the style has.
const COLOURS: usize = 8;

/// Steps along a line (pixels) in which it keeps names away.
const STEP: f64 = 9.0;

/// Where a text stands against its place.
#[derive(Debug, Clone, Copy)]
enum Anchor {
    Start,
    Middle,
    End,
}

pub(crate) fn svg(chart: &Chart, theme: Theme) -> String {
    let top = HEAD + NOTE * chart.notes.len() as f64;
    let frame = Area { left: LEFT, top, right: WIDTH - RIGHT, bottom: top + PLOT };
    let values = |axis: usize| {
        let points = chart.series.iter().flat_map(|series| &series.points);
        // What has no place on the other axis does not stretch this one.
        points.filter(|point| is_shown(chart, point)).map(move |point| point.at[axis])
    };
    let [x, y] = &chart.axes;
    let drawing = Drawing {
        chart,
        frame,
        x: Scale::new(values(0), x.zero.is_some(), [frame.left, frame.right]),
        y: Scale::new(values(1), y.zero.is_some(), [frame.bottom, frame.top]),
    };
    let style = match theme {
        Theme::Reader => format!("{LIGHT}{DARK}"),
        Theme::Light => LIGHT.to_owned(),
    };
    let height = frame.bottom + FOOT;
    let paper = Rectangle::new().set("class", "paper").set("width", WIDTH).set("height", height);
    let mut document = Document::new()
        .set("viewBox", (0, 0, WIDTH, height))
        .set("width", WIDTH)
        .set("height", height)
        .add(Style::new(style))
        .add(paper);
    drawing.heading(&mut document);
    drawing.axes(&mut document);
    drawing.front(&mut document);
    drawing.series(&mut document);
    drawing.names(&mut document);
    document.to_string()
}

fn is_shown(chart: &Chart, point: &Point) -> bool {
    let axes = chart.axes.iter().zip(point.at);
    axes.into_iter().all(|(axis, value)| {
        value.is_finite() && (value > 0.0 || (value == 0.0 && axis.zero.is_some()))
    })
}

struct Drawing<'a> {
    chart: &'a Chart,
    frame: Area,
    x: Scale,
    y: Scale,
}

impl Drawing<'_> {
    fn place(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.x.at(x)?, self.y.at(y)?])
    }

    /// The points of a series that can be seen.
    fn places(&self, series: usize) -> Vec<([f64; 2], Mark)> {
        let points = self.chart.series[series].points.iter();
        points.filter_map(|point| Some((self.place(point.at)?, point.mark))).collect()
    }

    fn heading(&self, document: &mut Document) {
        text(document, [LEFT, 25.0], Anchor::Start, "title", &self.chart.title);
        for (i, note) in self.chart.notes.iter().enumerate() {
            let y = 25.0 + NOTE * (i as f64 + 1.0);
            text(document, [LEFT, y], Anchor::Start, "small", note);
        }
    }

    fn axes(&self, document: &mut Document) {
        let Area { left, top, right, bottom } = self.frame;
        for (name, at) in self.x.ticks() {
            line(document, [at, top], [at, bottom], "faint");
            text(document, [at, bottom + 18.0], Anchor::Middle, "", &name);
        }
        for (name, at) in self.y.ticks() {
            line(document, [left, at], [right, at], "faint");
            text(document, [left - 8.0, at + 4.0], Anchor::End, "", &name);
        }
        self.zeros(document);
        line(document, [left, bottom], [right, bottom], "ink");
        line(document, [left, bottom], [left, top], "ink");
        let [across, upwards] = &self.chart.axes;
        let middle = 0.5 * (left + right);
        text(document, [middle, bottom + 42.0], Anchor::Middle, "", &across.label);
        let upright = Text::new(&upwards.label)
            .set("transform", format!("translate(18 {}) rotate(-90)", 0.5 * (top + bottom)))
            .set("text-anchor", "middle");
        document.append(upright);
    }

    /// A dashed line above the place of zeros, and their name.
    fn zeros(&self, document: &mut Document) {
        let Area { left, top, right, bottom } = self.frame;
        let [across, upwards] = &self.chart.axes;
        if let (Some(at), Some(name)) = (self.y.zero(), &upwards.zero) {
            let start = self.y.start();
            dashed(document, [left, start], [right, start]);
            text(document, [left - 8.0, at + 4.0], Anchor::End, "", "0");
            text(document, [right - 4.0, start - 5.0], Anchor::End, "small", name);
        }
        if let (Some(at), Some(name)) = (self.x.zero(), &across.zero) {
            let start = self.x.start();
            dashed(document, [start, bottom], [start, top]);
            text(document, [at, bottom + 18.0], Anchor::Middle, "", "0");
            text(document, [left + 4.0, top + 12.0], Anchor::Start, "small", name);
        }
    }

    fn front(&self, document: &mut Document) {
        let corners = self.front_corners();
        if corners.len() > 1 {
            path(document, &corners, "front", None);
        }
    }

    /// The front as steps: until the next point, nothing better is to be had.
    fn front_corners(&self) -> Vec<[f64; 2]> {
        if !self.chart.front {
            return Vec::new();
        }
        let series = self.chart.series.iter().filter(|series| series.contends);
        let points = series.flat_map(|series| &series.points);
        let all: Vec<[f64; 2]> =
            points.filter(|point| is_shown(self.chart, point)).map(|point| point.at).collect();
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for at in front(&all).into_iter().filter_map(|point| self.place(point)) {
            if let Some(&[_, y]) = corners.last() {
                corners.push([at[0], y]);
            }
            corners.push(at);
        }
        if let Some(&[_, y]) = corners.last() {
            corners.push([self.frame.right, y]);
        }
        corners
    }

    fn series(&self, document: &mut Document) {
        for (i, series) in self.chart.series.iter().enumerate() {
            let colour = series.colour % COLOURS;
            let places = self.places(i);
            if series.joined && places.len() > 1 {
                let line: Vec<[f64; 2]> = places.iter().map(|(place, _)| *place).collect();
                let dashes = series.dashed.then_some("5 4");
                path(document, &line, &format!("s{colour}"), dashes);
            }
            for (place, mark) in places {
                let (radius, class) = match mark {
                    Mark::Disk => (4.5, format!("f{colour}")),
                    Mark::Ring => (4.0, format!("ring s{colour}")),
                    Mark::Dot => (2.4, format!("f{colour}")),
                    Mark::None => continue,
                };
                let circle = Circle::new()
                    .set("cx", rounded(place[0]))
                    .set("cy", rounded(place[1]))
                    .set("r", radius)
                    .set("stroke-width", 1.6)
                    .set("class", class);
                document.append(circle);
            }
        }
    }

    fn names(&self, document: &mut Document) {
        let mut obstacles = Vec::new();
        let mut names = Vec::new();
        let mut named = Vec::new();
        for (i, series) in self.chart.series.iter().enumerate() {
            let places = self.places(i);
            for (place, _) in &places {
                obstacles.push(Obstacle { area: Area::around(*place, 5.0), weight: 3.0 });
            }
            if series.joined {
                along(&places, &mut obstacles);
            }
            if series.name.is_empty() {
                continue;
            }
            // Beside a disk where there is one.
            let has_disk = places.iter().any(|(_, mark)| *mark == Mark::Disk);
            let fit = places.iter().filter(|(_, mark)| !has_disk || *mark == Mark::Disk);
            names.push((series.name.as_str(), fit.map(|(place, _)| *place).collect()));
            named.push(series);
        }
        if let (Some(_), Some(name)) = (self.y.zero(), &self.chart.axes[1].zero) {
            let width = 6.6 * name.chars().count() as f64;
            let (right, bottom) = (self.frame.right, self.y.start());
            let area = Area { left: right - width, top: bottom - 16.0, right, bottom };
            obstacles.push(Obstacle { area, weight: 20.0 });
        }
        let placed = names::place(&names, &obstacles, &self.frame);
        for ((series, (name, _)), placed) in named.iter().zip(&names).zip(placed) {
            let Some(placed) = placed else { continue };
            let colour = series.colour % COLOURS;
            if let Some([from, to]) = placed.leader {
                let leader = straight(from, to).set("class", format!("s{colour}"));
                document.append(leader.set("stroke-width", 0.8).set("stroke-opacity", 0.7));
            }
            let Area { left, top, right, bottom } = placed.area;
            let halo = Rectangle::new()
                .set("class", "halo")
                .set("x", rounded(left))
                .set("y", rounded(top))
                .set("width", rounded(right - left))
                .set("height", rounded(bottom - top));
            document.append(halo);
            let at = [0.5 * (left + right), top + 0.77 * LINE];
            text(document, at, Anchor::Middle, &format!("f{colour}"), name);
        }
    }
}

/// Keeps names away from the line through `places`.
fn along(places: &[([f64; 2], Mark)], obstacles: &mut Vec<Obstacle>) {
    for pair in places.windows(2) {
        let [(from, _), (to, _)] = [pair[0], pair[1]];
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let mut done = 0.0;
        while done < length {
            let share = done / length;
            let at = [0, 1].map(|k| from[k] + share * (to[k] - from[k]));
            obstacles.push(Obstacle { area: Area::around(at, 3.0), weight: 1.0 });
            done += STEP;
        }
    }
}

fn text(document: &mut Document, at: [f64; 2], anchor: Anchor, class: &str, words: &str) {
    let anchor = match anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let text = Text::new(words)
        .set("x", rounded(at[0]))
        .set("y", rounded(at[1]))
        .set("text-anchor", anchor);
    document.append(if class.is_empty() { text } else { text.set("class", class) });
}

fn straight(from: [f64; 2], to: [f64; 2]) -> Line {
    Line::new()
        .set("x1", rounded(from[0]))
        .set("y1", rounded(from[1]))
        .set("x2", rounded(to[0]))
        .set("y2", rounded(to[1]))
}

fn line(document: &mut Document, from: [f64; 2], to: [f64; 2], class: &str) {
    document.append(straight(from, to).set("class", class));
}

fn dashed(document: &mut Document, from: [f64; 2], to: [f64; 2]) {
    document.append(straight(from, to).set("class", "ink").set("stroke-dasharray", "3 4"));
}

fn path(document: &mut Document, points: &[[f64; 2]], class: &str, dashes: Option<&str>) {
    let [first, rest @ ..] = points else { return };
    let pair = |point: &[f64; 2]| (rounded(point[0]), rounded(point[1]));
    let data =
        rest.iter().fold(Data::new().move_to(pair(first)), |d, point| d.line_to(pair(point)));
    let mut path = Path::new().set("class", class).set("fill", "none").set("d", data);
    if class != "front" {
        path = path.set("stroke-width", 1.6);
    }
    if let Some(dashes) = dashes {
        path = path.set("stroke-dasharray", dashes);
    }
    document.append(path);
}

/// A hundredth of a pixel is more than enough; files stay small.
fn rounded(pixels: f64) -> f64 {
    (pixels * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{Axis, Series};

    fn chart(points: &[[f64; 2]]) -> Chart {
        let axes = [Axis::new("time (s)"), Axis::new("error").with_zero("none wrong")];
        let series = Series { contends: true, ..Series::line("a < b", points.iter().copied()) };
        Chart { title: "t".into(), axes, series: vec![series], front: true, ..Chart::default() }
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out() {
        let nan = f64::NAN;
        let text =
            chart(&[[1.0, 1.0], [10.0, 0.0], [nan, 1.0], [0.0, 1.0], [1.0, -1.0], [1e3, nan]])
                .svg(Theme::Reader);
        assert_eq!(text.matches("<circle").count(), 2, "{text}");
        assert!(!text.contains("NaN") && !text.contains("inf") && !text.contains("1000"));
        assert!(text.contains("a &lt; b") && text.contains("none wrong"));
        assert!(text.contains("prefers-color-scheme"));
        assert!(!chart(&[]).svg(Theme::Light).contains("prefers-color-scheme"));
    }

    #[test]
    fn the_front_steps_through_the_best_points_to_the_edge() {
        let text = chart(&[[1.0, 1.0], [2.0, 3.0], [10.0, 0.0]]).svg(Theme::Light);
        let front = text.split("<path").find(|part| part.contains("class=\"front\"")).unwrap();
        // Two points, the corner between them, and the edge.
        assert_eq!(front.matches(['M', 'L']).count(), 4, "{front}");
    }
}
