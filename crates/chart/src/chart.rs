//! A chart: what it shows, and its drawing as SVG.

use svg::Node;
use svg::node::element::{Circle, Group, Rectangle, Text};

use crate::axis::{Axis, AxisScale, front};
use crate::canvas::{
    COLOURS, Stroke, TextAnchor, Theme, dashed, document, line, path, rounded, straight, text,
};
use crate::names::{self, LINE, LabelArea, Obstacle, PointName};

/// The colour of what is no contestant: limits and models.
pub const GREY: usize = 7;

/// A chart: points and lines over two axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// The first line.
    pub title: String,
    /// Further notes, one line each.
    pub notes: Vec<String>,
    /// Across, and upwards.
    pub axes: [Axis; 2],
    /// Whatever is measured.
    pub series: Vec<Series>,
    /// True if the Pareto front is drawn: small values are good on both axes.
    pub front: bool,
}

/// Points of one name and colour.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// The name, which stands beside one of the points; none when empty.
    pub name: String,
    /// The points. Those that are not finite are left out, and those that a logarithmic axis has no
    /// place for.
    pub points: Vec<Point>,
    /// True if a line joins the points, in their order.
    pub joined: bool,
    /// Stroke of that line.
    pub stroke: Stroke,
    /// Index of the colour; series of one number look alike.
    pub colour: usize,
    /// True if the points count for the Pareto front.
    pub contends: bool,
}

/// A point of a chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Its values.
    pub at: [f64; 2],
    /// Mark by which the point is drawn.
    pub mark: Mark,
}

/// Mark of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mark {
    /// A disk, beside which the name may stand.
    #[default]
    Disk,
    /// A ring.
    Ring,
    /// A small disk.
    Dot,
    /// Nothing but its line.
    None,
}

impl Series {
    /// A line through `points`, marked by disks.
    #[must_use]
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::joined(name, points, Mark::Disk)
    }

    /// A line through `points`, which are not marked.
    #[must_use]
    pub fn curve(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::joined(name, points, Mark::None)
    }

    fn joined(
        name: impl Into<String>,
        points: impl IntoIterator<Item = [f64; 2]>,
        mark: Mark,
    ) -> Self {
        let points = points.into_iter().map(|at| Point { at, mark }).collect();
        Self { name: name.into(), points, joined: true, ..Self::default() }
    }
}

impl Chart {
    /// The chart as an SVG document. Its fonts are the reader's sans-serif.
    #[must_use]
    pub fn svg(&self, theme: Theme) -> String {
        single(self, theme)
    }
}

/// Smaller charts beside each other, two a row, as one SVG document.
#[must_use]
pub fn side_by_side(charts: &[Chart], theme: Theme) -> String {
    rows(charts, theme)
}

const LEFT: f64 = 84.0;
const RIGHT: f64 = 22.0;
const HEAD: f64 = 40.0;
const NOTE: f64 = 18.0;
const FOOT: f64 = 54.0;

/// Dashes of the line above the place of zeros.
const ZEROS: &str = "3 4";

/// Steps along a line (pixels) in which it keeps names away.
const STEP: f64 = 9.0;

/// Room for a chart (pixels).
#[derive(Debug, Clone, Copy)]
struct Room {
    width: f64,
    /// Height of the part between the axes.
    plot: f64,
}

/// A chart that stands alone, and one beside others.
const ALONE: Room = Room { width: 860.0, plot: 420.0 };
const BESIDE: Room = Room { width: 470.0, plot: 300.0 };

/// Charts beside each other before a new row begins.
const ROW: usize = 2;

/// One chart on its own.
pub(crate) fn single(chart: &Chart, theme: Theme) -> String {
    let size = [ALONE.width, ALONE.height(chart)];
    document(size, theme).add(ALONE.draw(chart)).to_string()
}

/// Charts in rows.
pub(crate) fn rows(charts: &[Chart], theme: Theme) -> String {
    let mut all = Group::new();
    let mut height = 0.0;
    for row in charts.chunks(ROW) {
        for (column, chart) in row.iter().enumerate() {
            let left = BESIDE.width * column as f64;
            all.append(BESIDE.draw(chart).set("transform", format!("translate({left} {height})")));
        }
        height += row.iter().map(|chart| BESIDE.height(chart)).fold(0.0, f64::max);
    }
    let columns = charts.len().clamp(1, ROW);
    document([BESIDE.width * columns as f64, height], theme).add(all).to_string()
}

impl Room {
    /// Height of all of `chart` (pixels).
    fn height(self, chart: &Chart) -> f64 {
        HEAD + NOTE * chart.notes.len() as f64 + self.plot + FOOT
    }

    fn draw(self, chart: &Chart) -> Group {
        let top = HEAD + NOTE * chart.notes.len() as f64;
        let frame =
            LabelArea { left: LEFT, top, right: self.width - RIGHT, bottom: top + self.plot };
        let values = |axis: usize| {
            let points = chart.series.iter().flat_map(|series| &series.points);
            // What has no place on the other axis does not stretch this one.
            points.filter(|point| is_shown(chart, point)).map(move |point| point.at[axis])
        };
        let [x, y] = &chart.axes;
        let drawing = Drawing {
            chart,
            frame,
            x: AxisScale::new(values(0), x, [frame.left, frame.right]),
            y: AxisScale::new(values(1), y, [frame.bottom, frame.top]),
        };
        let mut group = Group::new();
        drawing.heading(&mut group);
        drawing.axes(&mut group);
        drawing.front(&mut group);
        drawing.series(&mut group);
        drawing.names(&mut group);
        group
    }
}

fn is_shown(chart: &Chart, point: &Point) -> bool {
    let axes = chart.axes.iter().zip(point.at);
    axes.into_iter().all(|(axis, value)| {
        value.is_finite() && (axis.linear || value > 0.0 || (value == 0.0 && axis.zero.is_some()))
    })
}

struct Drawing<'a> {
    chart: &'a Chart,
    frame: LabelArea,
    x: AxisScale,
    y: AxisScale,
}

impl Drawing<'_> {
    fn place(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.x.at(x)?, self.y.at(y)?])
    }

    /// The points of a series that can be seen, by their places in the drawing.
    fn places(&self, series: usize) -> Vec<Point> {
        let points = self.chart.series[series].points.iter();
        let placed = |&Point { at, mark }: &Point| Some(Point { at: self.place(at)?, mark });
        points.filter_map(placed).collect()
    }

    fn heading(&self, group: &mut Group) {
        text(group, [LEFT, 25.0], TextAnchor::Start, "title", &self.chart.title);
        for (i, note) in self.chart.notes.iter().enumerate() {
            let y = 25.0 + NOTE * (i as f64 + 1.0);
            text(group, [LEFT, y], TextAnchor::Start, "small", note);
        }
    }

    fn axes(&self, group: &mut Group) {
        let LabelArea { left, top, right, bottom } = self.frame;
        for (name, at) in self.x.ticks() {
            line(group, [at, top], [at, bottom], "faint");
            text(group, [at, bottom + 18.0], TextAnchor::Middle, "", &name);
        }
        for (name, at) in self.y.ticks() {
            line(group, [left, at], [right, at], "faint");
            text(group, [left - 8.0, at + 4.0], TextAnchor::End, "", &name);
        }
        self.zeros(group);
        line(group, [left, bottom], [right, bottom], "ink");
        line(group, [left, bottom], [left, top], "ink");
        let [across, upwards] = &self.chart.axes;
        let middle = 0.5 * (left + right);
        text(group, [middle, bottom + 42.0], TextAnchor::Middle, "", &across.label);
        let upright = Text::new(&upwards.label)
            .set("transform", format!("translate(18 {}) rotate(-90)", 0.5 * (top + bottom)))
            .set("text-anchor", "middle");
        group.append(upright);
    }

    /// A dashed line above the place of zeros, and their name.
    fn zeros(&self, group: &mut Group) {
        let LabelArea { left, top, right, bottom } = self.frame;
        let [across, upwards] = &self.chart.axes;
        if let (Some(at), Some(name)) = (self.y.zero(), &upwards.zero) {
            let start = self.y.start();
            dashed(group, [left, start], [right, start], ZEROS);
            text(group, [left - 8.0, at + 4.0], TextAnchor::End, "", "0");
            text(group, [right - 4.0, start - 5.0], TextAnchor::End, "small", name);
        }
        if let (Some(at), Some(name)) = (self.x.zero(), &across.zero) {
            let start = self.x.start();
            dashed(group, [start, bottom], [start, top], ZEROS);
            text(group, [at, bottom + 18.0], TextAnchor::Middle, "", "0");
            text(group, [left + 4.0, top + 12.0], TextAnchor::Start, "small", name);
        }
    }

    fn front(&self, group: &mut Group) {
        let corners = self.front_corners();
        if corners.len() > 1 {
            path(group, &corners, "front", Stroke::Solid);
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

    fn series(&self, group: &mut Group) {
        for (i, series) in self.chart.series.iter().enumerate() {
            let colour = series.colour % COLOURS;
            let places = self.places(i);
            if series.joined && places.len() > 1 {
                let line: Vec<[f64; 2]> = places.iter().map(|point| point.at).collect();
                path(group, &line, &format!("s{colour}"), series.stroke);
            }
            for Point { at: place, mark } in places {
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
                group.append(circle);
            }
        }
    }

    fn names(&self, group: &mut Group) {
        let mut obstacles = Vec::new();
        let mut names = Vec::new();
        let mut named = Vec::new();
        for (i, series) in self.chart.series.iter().enumerate() {
            let places = self.places(i);
            for point in &places {
                obstacles.push(Obstacle { area: LabelArea::square_at(point.at, 5.0), weight: 3.0 });
            }
            if series.joined {
                along(&places, &mut obstacles);
            }
            if series.name.is_empty() {
                continue;
            }
            // Beside a disk where there is one.
            let has_disk = places.iter().any(|point| point.mark == Mark::Disk);
            let fit = places.iter().filter(|point| !has_disk || point.mark == Mark::Disk);
            let points = fit.map(|point| point.at).collect();
            names.push(PointName { name: &series.name, points });
            named.push(series);
        }
        if let (Some(_), Some(name)) = (self.y.zero(), &self.chart.axes[1].zero) {
            let width = 6.6 * name.chars().count() as f64;
            let (right, bottom) = (self.frame.right, self.y.start());
            let area = LabelArea { left: right - width, top: bottom - 16.0, right, bottom };
            obstacles.push(Obstacle { area, weight: 20.0 });
        }
        let placed = names::place(&names, &obstacles, &self.frame);
        for ((series, PointName { name, .. }), placed) in named.iter().zip(&names).zip(placed) {
            let Some(placed) = placed else { continue };
            let colour = series.colour % COLOURS;
            if let Some([from, to]) = placed.leader {
                let leader = straight(from, to).set("class", format!("s{colour}"));
                group.append(leader.set("stroke-width", 0.8).set("stroke-opacity", 0.7));
            }
            let LabelArea { left, top, right, bottom } = placed.area;
            let halo = Rectangle::new()
                .set("class", "halo")
                .set("x", rounded(left))
                .set("y", rounded(top))
                .set("width", rounded(right - left))
                .set("height", rounded(bottom - top));
            group.append(halo);
            let at = [0.5 * (left + right), top + 0.77 * LINE];
            text(group, at, TextAnchor::Middle, &format!("f{colour}"), name);
        }
    }
}

/// Keeps names away from the line through `places`.
fn along(places: &[Point], obstacles: &mut Vec<Obstacle>) {
    for pair in places.windows(2) {
        let [from, to] = [pair[0].at, pair[1].at];
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let mut done = 0.0;
        while done < length {
            let share = done / length;
            let at = [0, 1].map(|k| from[k] + share * (to[k] - from[k]));
            obstacles.push(Obstacle { area: LabelArea::square_at(at, 3.0), weight: 1.0 });
            done += STEP;
        }
    }
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
    fn charts_beside_each_other_stand_in_rows_of_two() {
        let three = [(); 3].map(|()| chart(&[[1.0, 1.0], [10.0, 2.0]]));
        let text = rows(&three, Theme::Light);
        let [width, height] = [BESIDE.width, BESIDE.height(&three[0])];
        for place in [[0.0, 0.0], [width, 0.0], [0.0, height]] {
            assert!(text.contains(&format!("translate({} {})", place[0], place[1])), "{text}");
        }
        assert!(text.contains(&format!("viewBox=\"0 0 {} {}\"", 2.0 * width, 2.0 * height)));
    }

    #[test]
    fn the_front_steps_through_the_best_points_to_the_edge() {
        let text = chart(&[[1.0, 1.0], [2.0, 3.0], [10.0, 0.0]]).svg(Theme::Light);
        let front = text.split("<path").find(|part| part.contains("class=\"front\"")).unwrap();
        // Two points, the corner between them, and the edge.
        assert_eq!(front.matches(['M', 'L']).count(), 4, "{front}");
    }
}
