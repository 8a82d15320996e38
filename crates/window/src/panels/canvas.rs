//! The picture: shown, moved about in, clicked.

use eframe::egui::{self, Color32, Key, PointerButton, Pos2, Rect, Response, Sense, Ui, Vec2};
use etendue::{DistanceScale, Viewpoint};

use super::light_field::LightFieldPart;
use super::start;
use crate::app::App;
use crate::document::Edit;
use crate::form::{mark, short};
use crate::state::Tool;

/// A drag of this many points turns the camera by a radian.
const POINTS_PER_RADIAN: f32 = 160.0;

/// Keys move the camera by this share of the distance to what it looks at in a second.
const SPEED: f64 = 0.8;

/// A camera that was moved is taken as it is now when nobody has moved it for this long (s).
const GESTURE: f64 = 0.5;

pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let canvas = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(canvas, Sense::click_and_drag());
    mark(ui.ctx(), "canvas", canvas);
    ui.painter().rect_filled(canvas, 0.0, backdrop(ui));
    let Some(picture) = &app.picture else {
        let inside = egui::UiBuilder::new().max_rect(canvas);
        ui.scope_builder(inside, |ui| start::show(app, ui));
        return;
    };
    let size = resolution(app);
    let place = app.canvas.place(canvas, size);
    let painter = ui.painter().with_clip_rect(canvas);
    let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
    painter.image(picture.texture.id(), place, whole, Color32::WHITE);
    if let Some(scale) = picture.screen.scale {
        scale_bar(&painter, canvas, scale);
    }
    compare(app, ui, &painter, place, canvas);
    mark(ui.ctx(), "picture", place);
    pin(app, &painter, place, size);
    point(app, &response, place, size);
    zoom(app, ui, &response, canvas);
    walk(app, ui, &response);
}

/// Columns and rows of the picture at its own size.
fn resolution(app: &App) -> [f32; 2] {
    let is_raw = app.light_field.shows == LightFieldPart::Raw;
    let known = app
        .inspector
        .as_ref()
        .filter(|_| is_raw)
        .map(|inspector| inspector.scene().camera.resolution());
    #[expect(clippy::cast_precision_loss, reason = "sides of a picture")]
    match (known, &app.picture) {
        (Some(size), _) => size.map(|side| side as f32),
        (None, Some(picture)) => picture.screen.size.map(|side| side as f32),
        (None, None) => [1.0; 2],
    }
}

fn backdrop(ui: &Ui) -> Color32 {
    match ui.visuals().dark_mode {
        true => Color32::from_gray(18),
        false => Color32::from_gray(200),
    }
}

/// The colours of distances, from near at the top to far.
fn scale_bar(painter: &egui::Painter, canvas: Rect, scale: DistanceScale) {
    const STEPS: u16 = 64;
    let bar =
        Rect::from_min_size(canvas.right_top() + Vec2::new(-34.0, 24.0), Vec2::new(14.0, 200.0));
    let room = bar.expand2(Vec2::new(56.0, 14.0)).translate(Vec2::new(-38.0, 0.0));
    painter.rect_filled(room.intersect(canvas), 4.0, Color32::from_black_alpha(150));
    for step in 0..STEPS {
        let share = f64::from(step) / f64::from(STEPS - 1);
        let [r, g, b] = DistanceScale::color(1.0 - share);
        let height = bar.height() / f32::from(STEPS);
        let top = bar.top() + height * f32::from(step);
        let cell =
            Rect::from_min_size(Pos2::new(bar.left(), top), Vec2::new(bar.width(), height + 0.5));
        painter.rect_filled(cell, 0.0, Color32::from_rgb(r, g, b));
    }
    for mark in 0..=4_u8 {
        let share = f64::from(mark) / 4.0;
        let at = Pos2::new(bar.left() - 6.0, bar.top() + bar.height() * f32::from(mark) / 4.0);
        let text = format!("{} m", short(scale.distance(1.0 - share)));
        let font = egui::FontId::proportional(12.0);
        painter.text(at, egui::Align2::RIGHT_CENTER, text, font, Color32::WHITE);
    }
}

/// The picture from before on the left of a line that can be dragged.
fn compare(app: &mut App, ui: &Ui, painter: &egui::Painter, place: Rect, canvas: Rect) {
    let Some(before) = &app.canvas.before else { return };
    let split = app.canvas.split;
    let x = place.left() + split * place.width();
    let left = Rect::from_min_max(place.min, Pos2::new(x, place.bottom()));
    let part = Rect::from_min_max(Pos2::ZERO, Pos2::new(split, 1.0));
    painter.rect_filled(left.intersect(canvas), 0.0, backdrop(ui));
    painter.image(before.id(), left, part, Color32::WHITE);
    painter.vline(x, place.y_range(), (2.0, ui.visuals().selection.bg_fill));
    let handle = Rect::from_center_size(Pos2::new(x, place.center().y), Vec2::new(14.0, 44.0));
    painter.rect_filled(handle, 4.0, ui.visuals().selection.bg_fill);
    mark(ui.ctx(), "split", handle);
    let grip = ui.interact(handle.expand(4.0), ui.id().with("split"), Sense::drag());
    if let Some(at) = grip.interact_pointer_pos() {
        app.canvas.split = ((at.x - place.left()) / place.width()).clamp(0.0, 1.0);
    }
}

/// A mark at the place that was asked.
fn pin(app: &App, painter: &egui::Painter, place: Rect, size: [f32; 2]) {
    let Some(asked) = &app.asked else { return };
    let at = asked.place;
    #[expect(clippy::cast_possible_truncation, reason = "a place on the screen")]
    let at = Pos2::new(
        place.left() + at[0] as f32 / size[0] * place.width(),
        place.top() + at[1] as f32 / size[1] * place.height(),
    );
    for (width, color) in [(3.0, Color32::from_black_alpha(160)), (1.2, Color32::WHITE)] {
        painter.circle_stroke(at, 6.0, (width, color));
        for side in [-1.0, 1.0] {
            let [from, to] = [7.0, 13.0].map(|r| side * r);
            painter
                .line_segment([at + Vec2::new(from, 0.0), at + Vec2::new(to, 0.0)], (width, color));
            painter
                .line_segment([at + Vec2::new(0.0, from), at + Vec2::new(0.0, to)], (width, color));
        }
    }
}

/// Clicks and drags.
fn point(app: &mut App, response: &Response, place: Rect, size: [f32; 2]) {
    let ctx = &response.ctx;
    // A view of a light field has pixels of its own.
    if response.clicked()
        && app.light_field.shows == LightFieldPart::Raw
        && let Some(at) = response.interact_pointer_pos().filter(|at| place.contains(*at))
    {
        let pixel = [
            f64::from((at.x - place.left()) / place.width() * size[0]),
            f64::from((at.y - place.top()) / place.height() * size[1]),
        ];
        match app.tool {
            Tool::Inspect => app.ask(pixel),
            Tool::Focus => app.focus(ctx, pixel),
        }
    }
    let drag = response.drag_delta();
    if drag == Vec2::ZERO {
        return;
    }
    if app.still.is_some() {
        // There is no camera to move: the picture is.
        app.canvas.shift += drag;
        return;
    }
    let shifted = ctx.input(|input| input.modifiers.shift);
    let angles = [drag.x, drag.y].map(|points| f64::from(points / POINTS_PER_RADIAN));
    let heights = [drag.x, drag.y].map(|points| f64::from(points / place.height()));
    let held = |button| response.dragged_by(button);
    if held(PointerButton::Middle) || (held(PointerButton::Primary) && shifted) {
        turn(app, ctx, |viewpoint| viewpoint.panned(heights));
    } else if held(PointerButton::Primary) {
        turn(app, ctx, |viewpoint| viewpoint.orbited(angles));
    } else if held(PointerButton::Secondary) {
        turn(app, ctx, |viewpoint| viewpoint.looking(angles));
    }
}

/// Moves the camera in the hand.
fn turn(app: &mut App, ctx: &egui::Context, change: impl FnOnce(Viewpoint) -> Viewpoint) {
    let now = ctx.input(|input| input.time);
    // A camera that the renderer has not reached yet is newer than the one it tells of.
    let held = app.canvas.hand.filter(|(_, at)| now - at < GESTURE || app.is_behind());
    let held = held.map(|(viewpoint, _)| viewpoint).or_else(|| app.viewpoint());
    let Some(viewpoint) = held.map(change) else { return };
    app.canvas.hand = Some((viewpoint, now));
    app.stand(ctx, &viewpoint);
}

/// The wheel: nearer and farther, or the picture larger and smaller with Ctrl held.
fn zoom(app: &mut App, ui: &Ui, response: &Response, canvas: Rect) {
    if response.double_clicked() {
        (app.canvas.zoom, app.canvas.shift) = (None, Vec2::ZERO);
    }
    let Some(pointer) = response.hover_pos() else { return };
    let (mut wheel, mut larger) =
        ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
    if app.still.is_some() && wheel != 0.0 {
        (larger, wheel) = (larger * (wheel * 0.0025).exp(), 0.0);
    }
    if (larger - 1.0).abs() > 1e-4 {
        let before = app.canvas.zoom.unwrap_or(1.0);
        let after = (before * larger).clamp(0.25, 64.0);
        let from_middle = pointer - canvas.center();
        // What is under the pointer stays there.
        app.canvas.shift = from_middle - (from_middle - app.canvas.shift) * (after / before);
        app.canvas.zoom = Some(after);
    } else if wheel != 0.0 {
        approach(app, ui.ctx(), f64::from((-wheel * 0.0025).exp()));
    }
}

fn approach(app: &mut App, ctx: &egui::Context, factor: f64) {
    let camera = app.document.as_ref().map(|document| document.at("camera").clone());
    let is_parallel = camera.is_some_and(|camera| camera["type"] == "orthographic");
    let height = app.inspector.as_ref().and_then(etendue::Inspector::picture_height);
    match height.filter(|_| is_parallel) {
        // Parallel rays come no nearer: the picture takes in less.
        Some(height) => app.edit(ctx, &[Edit::set("camera.height", height * factor)]),
        None => turn(app, ctx, |viewpoint| viewpoint.approached(factor)),
    }
}

/// Keys that fly: right and left, up and down, ahead and back.
const FLY: [[Key; 2]; 3] = [[Key::D, Key::A], [Key::E, Key::Q], [Key::W, Key::S]];

/// Flies while a key is held that was pressed by itself: the S of Ctrl+S is none, also when Ctrl is let go
/// first.
fn walk(app: &mut App, ui: &Ui, response: &Response) {
    let is_typing = ui.ctx().memory(|memory| memory.focused().is_some());
    let starts = !is_typing && response.contains_pointer();
    let dt = ui.input(|input| {
        let keys = FLY.as_flattened().iter();
        let pressed = keys.filter(|key| input.key_pressed(**key) && !input.modifiers.any());
        app.canvas.flying.extend(pressed.filter(|_| starts));
        app.canvas.flying.retain(|key| input.key_down(*key));
        input.stable_dt
    });
    if app.canvas.flying.is_empty() {
        return;
    }
    let held = |key| f64::from(u8::from(app.canvas.flying.contains(key)));
    let keys = FLY.each_ref().map(|[ahead, back]| held(ahead) - held(back));
    let step = SPEED * f64::from(dt.min(0.1));
    turn(app, ui.ctx(), |viewpoint| viewpoint.flown(keys.map(|key| key * step)));
    ui.ctx().request_repaint();
}
