//! The lens: cut along its axis with the rays of the pixel that was asked, and its spots or curves. Surfaces and gaps
//! can be dragged.

use eframe::egui::{self, Color32, Context, Id, Pos2, Rect, Sense, Stroke, Ui, Vec2};
use etendue::LensView;
use serde_json::Value;

use super::lens_curves::COLORS;
use crate::app::App;
use crate::document::Edit;
use crate::form::{mark, short};

/// Rays of the pixel that was asked.
const RAYS: u32 = 7;

/// From millimetres to points on the screen.
struct DrawingScale {
    middle: Pos2,
    centre: [f64; 2],
    points_per_mm: f64,
}

impl DrawingScale {
    fn of(view: &LensView, place: Rect) -> Self {
        let ([left, bottom], [right, top]) = (view.section.low, view.section.high);
        let (width, height) = ((right - left).max(1e-9), (top - bottom).max(1e-9));
        let room = [place.width(), place.height()].map(|side| f64::from(side) * 0.92);
        let points_per_mm = (room[0] / (1.2 * width)).min(room[1] / height);
        // Rays come in from the left.
        let centre = [0.5 * (left - 0.2 * width + right), 0.5 * (bottom + top)];
        Self { middle: place.center(), centre, points_per_mm }
    }

    #[expect(clippy::cast_possible_truncation, reason = "points on the screen")]
    fn point(&self, [z, y]: [f64; 2]) -> Pos2 {
        let across = (z - self.centre[0]) * self.points_per_mm;
        let up = (y - self.centre[1]) * self.points_per_mm;
        self.middle + Vec2::new(across as f32, -up as f32)
    }

    fn line(&self, line: &[[f64; 2]]) -> Vec<Pos2> {
        line.iter().map(|&point| self.point(point)).collect()
    }
}

pub(crate) fn show(app: &mut App, ctx: &Context) {
    if !app.shows_lens || app.inspector.is_none() {
        return;
    }
    let panel = egui::TopBottomPanel::bottom("lens").resizable(true).default_height(230.0);
    let mut edits = Vec::new();
    let mut curves = std::mem::take(&mut app.lens_curves);
    panel.show(ctx, |ui| match &app.lens {
        None => {
            ui.weak("This camera has no lens.");
        }
        Some(Err(why)) => {
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        Some(Ok(view)) => {
            ui.label(figures(view));
            let room = ui.available_rect_before_wrap();
            let (left, right) = room.split_left_right_at_fraction(0.68);
            layout(app, ui, view, left, &mut edits);
            if !curves.show(ui, view, right) {
                let below = Rect::from_min_max(right.min + Vec2::new(0.0, 26.0), right.max);
                spots(ui, view, below);
            }
            ui.allocate_rect(room, Sense::hover());
        }
    });
    app.lens_curves = curves;
    if !edits.is_empty() {
        app.edit(ctx, &edits);
    }
}

fn figures(view: &LensView) -> String {
    let (report, first) = (&view.report, &view.report.paraxial);
    let mut figures = Vec::new();
    let mut say = |name: &str, value: Option<f64>, unit: &str| {
        figures.extend(value.map(|value| format!("{name} {}{unit}", short(value))));
    };
    say("focal length", first.efl, " mm");
    say("f-number", first.f_number, "");
    say("field", report.field_of_view, "\u{b0}");
    say("image circle", report.image_circle, " mm");
    figures.join("    ")
}

fn layout(app: &App, ui: &Ui, view: &LensView, place: Rect, edits: &mut Vec<Edit>) {
    let painter = ui.painter().with_clip_rect(place);
    let (scale, dark) = (DrawingScale::of(view, place), ui.visuals().dark_mode);
    let ink = Stroke::new(1.2, ui.visuals().text_color());
    let glass =
        if dark { Color32::from_rgb(47, 111, 159) } else { Color32::from_rgb(182, 215, 242) };
    for outline in &view.section.glasses {
        fill(&painter, &scale.line(outline), glass.gamma_multiply(0.55));
    }
    let axis = [[view.section.low[0] - 1e3, 0.0], [view.section.high[0] + 1e3, 0.0]];
    painter.line(scale.line(&axis), Stroke::new(0.6, ui.visuals().weak_text_color()));
    let asked = match (&app.asked, &app.inspector) {
        (Some(asked), Some(inspector)) => inspector.ray_paths(asked.place, RAYS),
        _ => Vec::new(),
    };
    if asked.is_empty() {
        for ((_, rays), colors) in view.section.fans.iter().zip(COLORS.iter().cycle()) {
            let color = colors[usize::from(!dark)];
            for ray in rays {
                painter.line(scale.line(ray), Stroke::new(0.8, color));
            }
        }
    }
    for ray in &asked {
        painter.line(scale.line(ray), Stroke::new(1.0, Color32::from_rgb(240, 170, 40)));
    }
    for element in &view.section.elements {
        let width = if element.is_stop { 2.4 } else { 1.2 };
        for line in &element.lines {
            painter.line(scale.line(line), Stroke::new(width, ink.color));
        }
    }
    if let Some([z, half]) = view.section.sensor {
        painter.line(scale.line(&[[z, -half], [z, half]]), Stroke::new(2.5, ink.color));
    }
    handles(app, ui, view, &scale, edits);
}

/// A polygon that need not be convex: in slices from its front to its back.
fn fill(painter: &egui::Painter, outline: &[Pos2], color: Color32) {
    let mut mesh = egui::Mesh::default();
    let count = outline.len();
    // Front and back run from rim to rim with as many points each: pairs from both ends are slices.
    for (i, corner) in outline.iter().enumerate() {
        mesh.colored_vertex(*corner, color);
        let other = count - 1 - i;
        if i + 1 < other
            && let (Ok(i), Ok(other)) = (u32::try_from(i), u32::try_from(other))
        {
            mesh.add_triangle(i, i + 1, other);
            mesh.add_triangle(i + 1, other - 1, other);
        }
    }
    painter.add(mesh);
}

/// Handles at the vertices: across the axis they bend a surface, along it they move the gap before it.
fn handles(app: &App, ui: &Ui, view: &LensView, scale: &DrawingScale, edits: &mut Vec<Edit>) {
    // What is not written as a list of elements has nothing to be dragged.
    let Some((lens, is_file)) = &app.written_lens else { return };
    for (i, drawn) in view.section.elements.iter().enumerate() {
        let at = scale.point([drawn.vertex, 0.0]);
        let place = Rect::from_center_size(at, Vec2::splat(11.0));
        let response = ui.interact(place, Id::new(("element", i)), Sense::drag());
        mark(ui.ctx(), &format!("element {i}"), place);
        let color = match response.hovered() || response.dragged() {
            true => ui.visuals().selection.bg_fill,
            false => ui.visuals().weak_text_color(),
        };
        ui.painter().circle_filled(at, 4.0, color);
        let written = &lens["elements"][i];
        let response = response.on_hover_text(about(written, i));
        let drag = response.drag_delta();
        if drag == Vec2::ZERO {
            continue;
        }
        let radius = written["radius"].as_f64().filter(|_| written["type"] == "surface");
        let edit = match (radius, i.checked_sub(1)) {
            (Some(radius), _) if drag.y.abs() > drag.x.abs() => {
                let bent = radius * f64::from((drag.y * 0.01).exp());
                Edit::set(format!("camera.lens.elements[{i}].radius"), rounded(bent))
            }
            (_, Some(before)) => {
                let gap = lens["elements"][before]["thickness"].as_f64().unwrap_or(0.0);
                let gap = (gap + f64::from(drag.x) / scale.points_per_mm).max(0.0);
                Edit::set(format!("camera.lens.elements[{before}].thickness"), rounded(gap))
            }
            _ => continue,
        };
        if *is_file {
            // The scene holds the lens from now on; its file stays as it is.
            edits.push(Edit::set("camera.lens", lens.clone()));
        }
        edits.push(edit);
    }
}

/// A length to a micrometre (mm).
fn rounded(length: f64) -> f64 {
    (length * 1e3).round() / 1e3
}

fn about(element: &Value, i: usize) -> String {
    let mut words = vec![format!("{i} {}", element["type"].as_str().unwrap_or_default())];
    for key in ["radius", "thickness", "semi_diameter"] {
        words.extend(element[key].as_f64().map(|value| format!("{key} {} mm", short(value))));
    }
    words.push("drag along the axis for the gap before it, across for the radius".to_owned());
    words.join("\n")
}

/// The spots of the fields on one scale.
fn spots(ui: &Ui, view: &LensView, place: Rect) {
    let spots = &view.report.spots;
    let painter = ui.painter().with_clip_rect(place);
    let reach = spots.iter().map(|spot| spot.geometric).fold(0.0, f64::max);
    if spots.is_empty() || reach <= 0.0 {
        return;
    }
    #[expect(clippy::cast_precision_loss, reason = "a few fields")]
    let side = (place.width() / spots.len() as f32).min(place.height() - 30.0);
    let dark = ui.visuals().dark_mode;
    for (i, spot) in spots.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "a few fields")]
        let middle = place.left_top() + Vec2::new(side * (i as f32 + 0.5), 0.5 * side);
        let color = COLORS[i % COLORS.len()][usize::from(!dark)];
        let points_per_mm = f64::from(0.44 * side) / reach;
        for point in &spot.points {
            #[expect(clippy::cast_possible_truncation, reason = "points on the screen")]
            let at = Vec2::new((point.x * points_per_mm) as f32, -(point.y * points_per_mm) as f32);
            painter.circle_filled(middle + at, 0.8, color);
        }
        let below = Pos2::new(middle.x, place.top() + side);
        let text = format!("{}\u{b0}\nrms {} \u{b5}m", short(spot.field), short(1e3 * spot.rms));
        let font = egui::FontId::proportional(11.0);
        painter.text(below, egui::Align2::CENTER_TOP, text, font, ui.visuals().text_color());
    }
}
