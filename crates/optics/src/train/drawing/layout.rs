//! The lens cut along y and z.

use etendue_chart::{Canvas, TextAnchor, Theme, round_length, short};
use glam::DVec3;

use super::{COLOURS, title};
use crate::element::{Clip, RayStatus, Symbol};
use crate::train::{Element, Isometry, LensReport, MonochromaticTrain, OpticalTrain, Side};

/// The picture's width and the most of its height (pixels).
const WIDTH: f64 = 960.0;
const TALLEST: f64 = 620.0;
const MARGIN: f64 = 40.0;
/// Room for the title.
const HEAD: f64 = 44.0;
/// Room for what the colours mean.
const FOOT: f64 = 34.0;

/// Rays of a fan.
const FAN: i32 = 9;
/// Fields that are drawn.
const FANS: usize = 3;
/// Points of a surface's section.
const SECTION: i32 = 48;

/// The lens in section, with fans of rays from points at infinity: those that leave it.
///
/// # Errors
///
/// When a glass has no index at the lens' wavelength.
pub fn layout(
    train: &OpticalTrain,
    report: &LensReport,
) -> Result<String, crate::glass::GlassError> {
    // What is to be drawn, and the view that holds it.
    let at = train.at(train.wavelength())?;
    let end = end_of(train, report);
    let fields = drawn_fields(report);
    // Mirrors are drawn as they are built.
    let spaces = train.built();
    let fans: Vec<Fan> =
        fields.iter().map(|&field| fan(train, &at, report, field, end, &spaces)).collect();
    let heights = heights(train, &fans);
    let train = &as_built(train, &spaces);
    let behind = spaces.last().copied().unwrap_or(Isometry::ONE);
    let view = DrawingView::holding(train, &heights, &fans, report, end, &behind);
    // Glass first, then rays, then the elements' lines over both.
    let mut canvas = Canvas::new(WIDTH, view.height, &title(report));
    glasses(&mut canvas, &view, &bodies(train, &at, &heights));
    canvas.dashed(view.pixel([view.left, 0.0]), view.pixel([view.right, 0.0]), "10 3 2 3");
    for (i, fan) in fans.iter().enumerate() {
        for ray in &fan.rays {
            let points: Vec<[f64; 2]> = ray.iter().map(|&point| view.pixel(point)).collect();
            for piece in view.pieces(&points) {
                canvas.path(&piece, &format!("s{}", i % COLOURS), 0.8);
            }
        }
    }
    for (i, element) in train.elements().iter().enumerate() {
        draw(&mut canvas, &view, element, heights[i], i == train.stop());
    }
    if let Some(z) = report.sensor_z {
        let half = view.sensor;
        let ends = [-half, half].map(|y| behind.place(DVec3::new(0.0, y, z)));
        canvas.path(&ends.map(|end| view.pixel([end.z, end.y])), "ink", 2.5);
    }
    let drawn = fields.iter().zip(&fans).enumerate().filter(|(_, (_, fan))| !fan.rays.is_empty());
    let drawn: Vec<DrawnField> =
        drawn.map(|(colour, (&angle, _))| DrawnField { colour, angle }).collect();
    legend(&mut canvas, &view, &drawn);
    Ok(canvas.svg(Theme::Reader))
}

/// The elements where they stand in the built lens, for drawing alone.
fn as_built(train: &OpticalTrain, spaces: &[Isometry]) -> OpticalTrain {
    let mut built = train.clone();
    if train.is_folded() {
        for (element, space) in built.elements.iter_mut().zip(spaces) {
            element.frame = space.frame(&element.frame);
        }
    }
    built
}

/// Axial position where drawn rays end (mm): at the sensor, or a little behind the lens.
pub(super) fn end_of(train: &OpticalTrain, report: &LensReport) -> f64 {
    report.sensor_z.unwrap_or_else(|| train.last_vertex() + 0.3 * train.last_vertex().max(1.0))
}

/// The axis, a middle field and the widest one.
pub(super) fn drawn_fields(report: &LensReport) -> Vec<f64> {
    let mut fields = report.fields.clone();
    fields.sort_by(f64::total_cmp);
    fields.dedup();
    if fields.len() > FANS {
        fields = vec![fields[0], fields[fields.len() / 2], fields[fields.len() - 1]];
    }
    fields
}

/// The rays of a field that leave the lens, as points (z, y).
pub(super) struct Fan {
    pub(super) rays: Vec<Vec<[f64; 2]>>,
}

pub(super) fn fan(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    report: &LensReport,
    field: f64,
    end: f64,
    spaces: &[Isometry],
) -> Fan {
    let none = Fan { rays: Vec::new() };
    let Some(chief) = train.chief_ray(at, field) else { return none };
    // Vignetting decides which of the rays there are; twice the pupil finds them at wide angles.
    let radius =
        report.paraxial.entrance_pupil.diameter.map_or(0.2 * train.lateral_scale(), |d| 0.5 * d);
    let across = DVec3::new(0.0, chief.direction.z, -chief.direction.y);
    let lit = |offset: f64| {
        let position = chief.position + across * offset;
        trace(train, at, position, chief.direction, end, spaces)
    };
    // Where the beam ends on both sides of its chief ray, to a percent of the pupil.
    let edge = |side: f64| {
        let mut steps = (0..=200).rev().map(|i| side * radius * 0.01 * f64::from(i));
        steps.find(|&offset| lit(offset).is_some())
    };
    let (Some(low), Some(high)) = (edge(-1.0), edge(1.0)) else { return none };
    let place = |i: i32| low + (high - low) * f64::from(i) / f64::from(FAN - 1);
    let mut rays: Vec<Vec<[f64; 2]>> = (0..FAN).filter_map(|i| lit(place(i))).collect();
    start_together(&mut rays, [chief.direction.z, chief.direction.y]);
    Fan { rays }
}

/// The fan of a field, for tests.
#[cfg(test)]
pub(super) fn fan_of(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    report: &LensReport,
    field: f64,
) -> Vec<Vec<[f64; 2]>> {
    fan(train, at, report, field, report.sensor_z.unwrap_or_default(), &[]).rays
}

/// Moves the beginnings of parallel rays to a plane square to them, that of the one that begins first.
fn start_together(rays: &mut [Vec<[f64; 2]>], direction: [f64; 2]) {
    let along = |point: &[f64; 2]| point[0] * direction[0] + point[1] * direction[1];
    let first = rays.iter().filter_map(|ray| ray.first()).map(along).fold(f64::INFINITY, f64::min);
    for start in rays.iter_mut().filter_map(|ray| ray.first_mut()) {
        let back = first - along(start);
        *start = [start[0] + direction[0] * back, start[1] + direction[1] * back];
    }
}

/// The way of a ray that leaves, from a little in front of the lens to the plane at `end`.
fn trace(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    position: DVec3,
    direction: DVec3,
    end: f64,
    spaces: &[Isometry],
) -> Option<Vec<[f64; 2]>> {
    let path = at.path(Side::Object, Clip::On, position, direction);
    let (RayStatus::Exited, Some(out)) = (path.status, path.direction) else { return None };
    let (first, last) = (*path.points.first()?, *path.points.last()?);
    let lead = 0.25 * (end.abs() + train.lateral_scale());
    let start = first - direction * lead;
    let stop = last + out * ((end - last.z) / out.z);
    // Each point as the space before its element stands in the built lens; without spaces as they are.
    let place = |i: usize, point: DVec3| spaces.get(i).map_or(point, |space| space.place(point));
    // The way through a gradient before it, and the point on each element.
    let mut ways = at.ways_through_gradients(position, direction).into_iter();
    let vertices = path.points.iter().enumerate().flat_map(|(i, &point)| {
        let way = ways.next().unwrap_or_default();
        way.into_iter().chain([point]).map(move |point| place(i, point)).collect::<Vec<_>>()
    });
    let stop = match train.elements().last().and_then(|last| last.part.mirror()) {
        // The last point is before the fold: where it is behind it follows from the way back.
        Some(_) if !spaces.is_empty() => {
            let direction = spaces.last()?.direction(out);
            let from = place(path.points.len() - 1, last);
            let plane = spaces.last()?.place(DVec3::new(0.0, 0.0, end));
            let normal = spaces.last()?.direction(DVec3::Z);
            from + direction * ((plane - from).dot(normal) / direction.dot(normal))
        }
        _ => place(path.points.len(), stop),
    };
    let points = std::iter::once(start).chain(vertices).chain([stop]);
    let points: Vec<[f64; 2]> = points.map(|point| [point.z, point.y]).collect();
    points.iter().flatten().all(|number| number.is_finite()).then_some(points)
}

/// Height from its axis to which each element is drawn (mm): its rim, or where the rays are.
pub(super) fn heights(train: &OpticalTrain, fans: &[Fan]) -> Vec<f64> {
    let rays = || fans.iter().flat_map(|fan| &fan.rays);
    let reach = |i: usize| {
        // Rays through a gradient have more points than there are elements.
        let z = train.elements()[i].frame.vertex.z;
        let nearest = |ray: &Vec<[f64; 2]>| {
            let far = |point: &[f64; 2]| (point[0] - z).abs();
            ray.iter().copied().min_by(|a, b| far(a).total_cmp(&far(b)))
        };
        let point = |ray: &Vec<[f64; 2]>| match train.is_graded() {
            true => nearest(ray),
            false => ray.get(i + 1).copied(),
        };
        let heights = rays().filter_map(point).map(|point| point[1].abs());
        1.1 * heights.fold(0.0, f64::max)
    };
    let height = |(i, element): (usize, &Element)| {
        let rim = element.clear_radius();
        let rim = if rim.is_finite() { rim } else { reach(i).max(0.05 * train.lateral_scale()) };
        rim.min(element.part.domain())
    };
    train.elements().iter().enumerate().map(height).collect()
}

/// From millimetres to pixels.
struct DrawingView {
    left: f64,
    right: f64,
    top: f64,
    scale: f64,
    height: f64,
    /// Half the sensor's height (mm).
    sensor: f64,
}

impl DrawingView {
    fn holding(
        train: &OpticalTrain,
        heights: &[f64],
        fans: &[Fan],
        report: &LensReport,
        end: f64,
        behind: &Isometry,
    ) -> Self {
        let sensor = behind.place(DVec3::new(0.0, 0.0, end));
        let (mut left, mut right) = (sensor.z.min(0.0), sensor.z);
        let mut top = sensor.y.abs();
        for (element, &height) in train.elements().iter().zip(heights) {
            top = top.max(height + element.frame.vertex.truncate().length());
            for [z, _] in section(element, height) {
                (left, right) = (left.min(z), right.max(z));
            }
        }
        let landed = fans.iter().flat_map(|fan| &fan.rays).filter_map(|ray| ray.last());
        let sensor = landed.map(|point| point[1].abs()).fold(0.0, f64::max);
        let circle = report.image_circle.map_or(sensor, |diameter| 0.5 * diameter);
        let sensor = circle.max(sensor).max(0.05 * top);
        let length = (right - left).max(top).max(1e-9);
        left -= 0.2 * length;
        right += 0.03 * length;
        // Beams from the side are cut off rather than shrink the lens.
        top = 1.12 * top.max(sensor).max(0.05 * length);
        let across = (WIDTH - 2.0 * MARGIN) / (right - left);
        let scale = across.min((TALLEST - HEAD - FOOT) / (2.0 * top));
        // A tall lens leaves room on both sides.
        let spare = 0.5 * ((WIDTH - 2.0 * MARGIN) / scale - (right - left));
        let height = HEAD + FOOT + 2.0 * top * scale;
        Self { left: left - spare, right: right + spare, top, scale, height, sensor }
    }

    /// The pieces of a polyline (pixels) that lie on the picture.
    fn pieces(&self, points: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
        let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
        for [from, to] in points.windows(2).filter_map(|ends| self.clipped([ends[0], ends[1]])) {
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&from) => piece.push(to),
                _ => pieces.push(vec![from, to]),
            }
        }
        pieces
    }

    /// Part of a line (pixels) that lies between the title and the legend (N. Liang and B. Barsky,
    /// "A new concept and method for line clipping", 1984).
    fn clipped(&self, [from, to]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
        let (low, high) = ([0.0, HEAD - 8.0], [WIDTH, self.height - FOOT + 6.0]);
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let step = to[axis] - from[axis];
            let ends = [low[axis], high[axis]].map(|edge| (edge - from[axis]) / step);
            if step == 0.0 {
                if !(low[axis]..=high[axis]).contains(&from[axis]) {
                    return None;
                }
            } else {
                enter = enter.max(ends[0].min(ends[1]));
                leave = leave.min(ends[0].max(ends[1]));
            }
        }
        let at = |share: f64| match share {
            0.0 => from,
            1.0 => to,
            _ => [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])),
        };
        (enter < leave).then(|| [at(enter), at(leave)])
    }

    fn pixel(&self, [z, y]: [f64; 2]) -> [f64; 2] {
        [MARGIN + (z - self.left) * self.scale, HEAD + (self.top - y) * self.scale]
    }
}

/// Points (z, y) of a surface from its lower rim to its upper.
fn section(element: &Element, height: f64) -> Vec<[f64; 2]> {
    let points = (-SECTION..=SECTION).filter_map(|i| {
        let y = height * f64::from(i) / f64::from(SECTION);
        let point = element.frame.point(DVec3::new(0.0, y, element.part.sag([0.0, y])?));
        Some([point.z, point.y])
    });
    points.collect()
}

/// A body of glass between two surfaces.
pub(super) struct GlassBody {
    /// All around, from the lower end of its front.
    pub(super) outline: Vec<[f64; 2]>,
    /// Points of its front; 0 where its rim is not drawn.
    front: usize,
}

/// The bodies of glass between surfaces.
pub(super) fn bodies(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    heights: &[f64],
) -> Vec<GlassBody> {
    let surfaces: Vec<usize> = (0..heights.len())
        .filter(|&i| train.elements()[i].part.symbol() == Symbol::Surface)
        .collect();
    let pairs = surfaces.windows(2).map(|pair| [pair[0], pair[1]]);
    let of_glass = pairs.filter(|&[front, _]| at.index_behind(front) > 1.0);
    of_glass.map(|pair| body(train, heights, pair)).collect()
}

fn body(train: &OpticalTrain, heights: &[f64], [front, back]: [usize; 2]) -> GlassBody {
    let side = |i: usize| section(&train.elements()[i], heights[i]);
    let (first, second) = (side(front), side(back));
    // The thicker of the two rims is the glass'.
    let rim = heights[front].max(heights[back]);
    let edge = |points: &[[f64; 2]], upper: bool| {
        let point = if upper { points.last() } else { points.first() };
        point.map(|&[z, y]| {
            [z, if y.abs() < rim { rim * if upper { 1.0 } else { -1.0 } } else { y }]
        })
    };
    let tilted = [front, back].iter().any(|&i| !train.elements()[i].frame.is_axial());
    let mut outline = first.clone();
    if !tilted {
        outline.extend(edge(&first, true));
        outline.extend(edge(&second, true));
    }
    outline.extend(second.iter().rev());
    if !tilted {
        outline.extend(edge(&second, false));
        outline.extend(edge(&first, false));
    }
    GlassBody { outline, front: if tilted { 0 } else { first.len() } }
}

fn glasses(canvas: &mut Canvas, view: &DrawingView, bodies: &[GlassBody]) {
    for GlassBody { outline, front } in bodies {
        let outline: Vec<[f64; 2]> = outline.iter().map(|&point| view.pixel(point)).collect();
        canvas.glass(&outline);
        let count = *front;
        if count > 0 && outline.len() > count + 2 {
            let rims = [&outline[count - 1..count + 3], &outline[outline.len() - 3..]];
            canvas.path(rims[0], "ink", 1.0);
            let closing: Vec<[f64; 2]> = rims[1].iter().copied().chain([outline[0]]).collect();
            canvas.path(&closing, "ink", 1.0);
        }
    }
}

/// The lines of an element with their widths (pixels), where a pixel is `pixel` mm.
pub(super) fn strokes(element: &Element, height: f64, pixel: f64) -> Vec<(Vec<[f64; 2]>, f64)> {
    let line = |points: &[DVec3], width: f64| {
        let points = points.iter().map(|&local| element.frame.point(local));
        (points.map(|point| [point.z, point.y]).collect(), width)
    };
    let at = |y: f64, z: f64| DVec3::new(0.0, y, z);
    match element.part.symbol() {
        Symbol::Surface => match element.part.mirror().map(|mirror| mirror.hole) {
            Some(hole) if hole > 0.0 && hole < height => {
                let half = |side: f64| {
                    let points = (0..=SECTION).filter_map(|i| {
                        let y = side * (hole + (height - hole) * f64::from(i) / f64::from(SECTION));
                        Some(at(y, element.part.sag([0.0, y])?))
                    });
                    line(&points.collect::<Vec<_>>(), 1.2)
                };
                vec![half(-1.0), half(1.0)]
            }
            _ => vec![(section(element, height), 1.2)],
        },
        Symbol::Nothing => Vec::new(),
        Symbol::ThinLens { converging } => {
            let tip = 0.05 * height * converging;
            let arrow = |side: f64| {
                let inner = side * (height - tip);
                let tips = [at(inner, -tip.abs()), at(side * height, 0.0), at(inner, tip.abs())];
                line(&tips, 1.2)
            };
            vec![line(&[at(-height, 0.0), at(height, 0.0)], 1.2), arrow(-1.0), arrow(1.0)]
        }
        Symbol::Opening => {
            let outer = height + (0.2 * height).max(8.0 * pixel);
            let blade = |side: f64| line(&[at(side * height, 0.0), at(side * outer, 0.0)], 3.0);
            vec![blade(-1.0), blade(1.0)]
        }
        Symbol::Sheet => {
            let half = 1.5 * pixel;
            [-half, half].map(|z| line(&[at(-height, z), at(height, z)], 0.8)).into()
        }
    }
}

fn draw(canvas: &mut Canvas, view: &DrawingView, element: &Element, height: f64, stop: bool) {
    for (line, width) in strokes(element, height, 1.0 / view.scale) {
        let points: Vec<[f64; 2]> = line.iter().map(|&point| view.pixel(point)).collect();
        canvas.path(&points, "ink", width);
    }
    if stop {
        let top = element.frame.point(DVec3::new(0.0, -height, 0.0));
        let [x, y] = view.pixel([top.z, top.y]);
        let below = if element.part.symbol() == Symbol::Opening { 26.0 } else { 14.0 };
        canvas.text([x, y + below], TextAnchor::Middle, "small", "stop");
    }
}

/// A field of which rays were drawn.
struct DrawnField {
    /// Number of its colour.
    colour: usize,
    /// Its angle (degrees).
    angle: f64,
}

/// Fields of which rays were drawn, and a scale.
fn legend(canvas: &mut Canvas, view: &DrawingView, fields: &[DrawnField]) {
    let y = view.height - 14.0;
    // Beams from the side may reach down here.
    canvas.cover([0.0, view.height - FOOT + 6.0], [WIDTH, FOOT]);
    for (place, &DrawnField { colour, angle }) in (0_u32..).zip(fields) {
        let x = MARGIN + 90.0 * f64::from(place);
        canvas.path(&[[x, y - 4.0], [x + 24.0, y - 4.0]], &format!("s{}", colour % COLOURS), 2.0);
        canvas.text([x + 30.0, y], TextAnchor::Start, "small", &format!("{}\u{b0}", short(angle)));
    }
    let length = round_length(140.0 / view.scale);
    let right = WIDTH - MARGIN;
    let left = right - length * view.scale;
    canvas.path(&[[left, y - 4.0], [right, y - 4.0]], "ink", 2.0);
    canvas.text([left - 8.0, y], TextAnchor::End, "small", &format!("{} mm", short(length)));
}
