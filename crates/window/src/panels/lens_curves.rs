//! Curves of the lens in waves: ray fans, wave fans and modulation by field, computed beside the window.

use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Duration;

use eframe::egui::{self, Color32, Pos2, Rect, Shape, Stroke, Ui, Vec2};
use etendue::{LensView, LensWaves};

use crate::form::{mark, short};

/// Colours of fields, on dark and on light.
pub(super) const COLORS: [[Color32; 2]; 3] = [
    [Color32::from_rgb(121, 192, 255), Color32::from_rgb(5, 80, 174)],
    [Color32::from_rgb(86, 211, 100), Color32::from_rgb(26, 127, 55)],
    [Color32::from_rgb(255, 123, 114), Color32::from_rgb(207, 34, 46)],
];

/// Plot beside the section.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum LensPlot {
    /// Spot diagram: where rays of a field land.
    #[default]
    Spots,
    /// Ray fans: where rays of two lines over the pupil land.
    RayFans,
    /// Wave fans: how far ahead of the sphere their waves are.
    WaveFans,
    /// Modulation by frequency.
    Modulation,
}

impl LensPlot {
    const ALL: [(Self, &'static str); 4] = [
        (Self::Spots, "spots"),
        (Self::RayFans, "ray fans"),
        (Self::WaveFans, "OPD"),
        (Self::Modulation, "MTF"),
    ];
}

/// Curves that are being computed, or are there.
#[derive(Debug, Default)]
pub(crate) struct LensCurves {
    pub(crate) plot: LensPlot,
    waiting: Option<Receiver<Result<LensWaves, String>>>,
    pub(crate) found: Option<Result<LensWaves, String>>,
}

impl LensCurves {
    /// Those of a lens before it changed are nothing to look at.
    pub(crate) fn forget(&mut self) {
        (self.waiting, self.found) = (None, None);
    }

    /// Asks for them once, and takes them when they are there.
    fn look(&mut self, view: &LensView) {
        if self.found.is_some() {
            return;
        }
        let receiver = self.waiting.get_or_insert_with(|| {
            let (sender, receiver) = channel();
            let view = view.clone();
            let work = move || {
                // Nobody may wait for it any more.
                let _ = sender.send(view.waves().map_err(|error| error.to_string()));
            };
            // Without a thread the channel is closed, which is told below.
            drop(std::thread::Builder::new().name("lens in waves".to_owned()).spawn(work));
            receiver
        });
        match receiver.try_recv() {
            Ok(found) => self.found = Some(found),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => {
                self.found = Some(Err("the lens' waves could not be computed".to_owned()));
            }
        }
        if self.found.is_some() {
            self.waiting = None;
        }
    }

    /// The choice, and the curves in a place; `false` where spots are asked for.
    pub(crate) fn show(&mut self, ui: &mut Ui, view: &LensView, place: Rect) -> bool {
        let row = Rect::from_min_size(place.min, Vec2::new(place.width(), 20.0));
        ui.scope_builder(egui::UiBuilder::new().max_rect(row), |ui| {
            ui.horizontal(|ui| {
                for (plot, name) in LensPlot::ALL {
                    let response = ui.selectable_value(&mut self.plot, plot, name);
                    mark(ui.ctx(), &format!("lens {name}"), response.rect);
                }
            });
        });
        if self.plot == LensPlot::Spots {
            return false;
        }
        self.look(view);
        let place = Rect::from_min_max(row.left_bottom() + Vec2::new(0.0, 6.0), place.max);
        match &self.found {
            None => {
                ui.ctx().request_repaint_after(Duration::from_millis(50));
                words(ui, place, "tracing ...");
            }
            Some(Err(why)) => words(ui, place, why),
            Some(Ok(waves)) => match self.plot {
                LensPlot::Spots => {}
                LensPlot::RayFans => fans(ui, waves, place, true),
                LensPlot::WaveFans => fans(ui, waves, place, false),
                LensPlot::Modulation => modulation(ui, waves, place),
            },
        }
        true
    }
}

fn words(ui: &Ui, place: Rect, text: &str) {
    let font = egui::FontId::proportional(12.0);
    let layout =
        ui.painter().layout(text.to_owned(), font, ui.visuals().text_color(), place.width());
    ui.painter().galley(place.min, layout, ui.visuals().text_color());
}

/// Axes of a plot: what its left and right, its bottom and top stand for.
struct PlotAxes {
    place: Rect,
    x: [f64; 2],
    y: [f64; 2],
}

/// A curve of a plot.
struct PlotCurve {
    points: Vec<[f64; 2]>,
    color: Color32,
    is_dashed: bool,
}

impl PlotAxes {
    #[expect(clippy::cast_possible_truncation, reason = "points on the screen")]
    fn point(&self, [x, y]: [f64; 2]) -> Pos2 {
        let share = |value: f64, [low, high]: [f64; 2]| ((value - low) / (high - low)) as f32;
        let Rect { min, max } = self.place;
        Pos2::new(
            min.x + share(x, self.x) * (max.x - min.x),
            max.y - share(y, self.y) * (max.y - min.y),
        )
    }

    fn draw(&self, ui: &Ui, title: &str, curves: &[PlotCurve]) {
        let weak = Stroke::new(0.6, ui.visuals().weak_text_color());
        let painter = ui.painter();
        painter.rect_stroke(self.place, 0.0, weak, egui::StrokeKind::Inside);
        for line in [[[self.x[0], 0.0], [self.x[1], 0.0]], [[0.0, self.y[0]], [0.0, self.y[1]]]] {
            let inside = |[x, y]: [f64; 2]| {
                (self.x[0]..=self.x[1]).contains(&x) && (self.y[0]..=self.y[1]).contains(&y)
            };
            if line.into_iter().all(inside) {
                painter.line_segment(line.map(|end| self.point(end)), weak);
            }
        }
        let inside = painter.with_clip_rect(self.place);
        for PlotCurve { points, color, is_dashed } in curves {
            let points: Vec<Pos2> = points.iter().map(|&point| self.point(point)).collect();
            let stroke = Stroke::new(1.4, *color);
            match is_dashed {
                true => inside.extend(Shape::dashed_line(&points, stroke, 5.0, 3.0)),
                false => drop(inside.line(points, stroke)),
            }
        }
        let font = egui::FontId::proportional(11.0);
        let below = self.place.center_bottom() + Vec2::new(0.0, 2.0);
        painter.text(below, egui::Align2::CENTER_TOP, title, font, ui.visuals().text_color());
    }
}

/// Room below a plot for its words.
const BELOW: f32 = 32.0;

/// Fans by field on one scale: along y through, along x dashed.
fn fans(ui: &Ui, waves: &LensWaves, place: Rect, are_rays: bool) {
    let curve = |field: &etendue::FieldCurves, axis: usize| -> Vec<[f64; 2]> {
        let fan = if axis == 0 { &field.fans.tangential } else { &field.fans.sagittal };
        let value = |ray: &etendue::FanRay| match (are_rays, axis) {
            (true, 0) => 1e3 * ray.y,
            (true, _) => 1e3 * ray.x,
            (false, _) => ray.waves,
        };
        fan.iter().map(|ray| [ray.pupil, value(ray)]).collect()
    };
    let all = || waves.fields.iter().flat_map(|field| [curve(field, 0), curve(field, 1)]);
    let reach = |axis: usize| {
        let values = all().flatten().map(|point| point[axis].abs());
        values.filter(|value| value.is_finite()).fold(1e-9, f64::max)
    };
    let (x, y) = (reach(0), 1.1 * reach(1));
    #[expect(clippy::cast_precision_loss, reason = "a few fields")]
    let width = place.width() / waves.fields.len().max(1) as f32;
    let dark = ui.visuals().dark_mode;
    for (i, field) in waves.fields.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "a few fields")]
        let left = place.min + Vec2::new(width * i as f32, 0.0);
        let size = Vec2::new(width - 8.0, (place.height() - BELOW).max(8.0));
        let axes = PlotAxes { place: Rect::from_min_size(left, size), x: [-x, x], y: [-y, y] };
        let color = COLORS[i % COLORS.len()][usize::from(!dark)];
        let unit = if are_rays { "\u{b5}m" } else { "waves" };
        let title = format!("{}\n\u{b1}{} {unit}", field.name, short(y));
        let curves = [false, true].map(|is_dashed| PlotCurve {
            points: curve(field, usize::from(is_dashed)),
            color,
            is_dashed,
        });
        axes.draw(ui, &title, &curves);
    }
}

/// Modulation of all fields: along y through, along x dashed.
fn modulation(ui: &Ui, waves: &LensWaves, place: Rect) {
    let dark = ui.visuals().dark_mode;
    let mut curves = Vec::new();
    for (i, field) in waves.fields.iter().enumerate() {
        let color = COLORS[i % COLORS.len()][usize::from(!dark)];
        for axis in [0, 1] {
            let points = field.modulation.iter().map(|row| [row[0], row[1 + axis]]).collect();
            curves.push(PlotCurve { points, color, is_dashed: axis == 1 });
        }
    }
    let limit = waves.limit;
    let size = Vec2::new(place.width() - 8.0, (place.height() - BELOW).max(8.0));
    let axes =
        PlotAxes { place: Rect::from_min_size(place.min, size), x: [0.0, limit], y: [0.0, 1.0] };
    let title = format!("0 to {} cycles/mm at {} nm\nfrom 0 to 1", short(limit), waves.wavelength);
    axes.draw(ui, &title, &curves);
}
