//! The views of a light field: one from a place of the pupil, or all together, focused anew.

use eframe::egui::{self, Pos2, Rect, Sense, Ui, Vec2};
use etendue::{Error, LightFieldViews, Picture, Screen};

use crate::app::App;
use crate::canvas::short;
use crate::form::mark;

/// What of a light field is shown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Shows {
    /// The picture on the sensor.
    #[default]
    Raw,
    /// The view from a column and a row of the pupil.
    View([u32; 2]),
    /// All views, focused at a distance (m).
    Focused(f64),
}

/// The light field of the picture that is shown.
#[derive(Debug, Default)]
pub(crate) struct LightFieldPanel {
    pub(crate) shows: Shows,
    views: Option<LightFieldViews>,
}

impl LightFieldPanel {
    /// Forgets the views of an earlier picture.
    pub(crate) fn renew(&mut self) {
        self.views = None;
    }

    /// Takes the views out of a picture, once.
    fn find(&mut self, preview: Option<&etendue::Preview>) -> Result<(), Error> {
        // Lenslets are told apart at the picture's own size alone.
        if let (None, Some(preview)) = (&self.views, preview.filter(|of| of.factor() == 1)) {
            self.views = preview.light_field()?;
        }
        Ok(())
    }

    /// What is to be shown instead of the picture itself.
    pub(crate) fn screen(
        &mut self,
        preview: Option<&etendue::Preview>,
    ) -> Result<Option<Screen>, Error> {
        self.find(preview)?;
        let Some(views) = &self.views else { return Ok(None) };
        let picture: Picture = match self.shows {
            Shows::Raw => return Ok(None),
            Shows::View(at) => views.view(at)?,
            Shows::Focused(depth) => views.refocused(depth)?,
        };
        Ok(Some(Screen::of_layer(&picture, "")?))
    }
}

pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let scene = app.inspector.as_ref().map(|inspector| inspector.scene());
    if let Some(why) = scene.and_then(|scene| scene.camera.no_views()) {
        ui.weak(format!("no views: {why}"));
        return;
    }
    let preview = app.picture.as_ref().filter(|picture| picture.is_final);
    if let Err(error) = app.light_field.find(preview.and_then(|of| of.preview.as_deref())) {
        app.error = Some(error.to_string());
    }
    let before = app.light_field.shows;
    let mut shows = before;
    let focus = app.light_field.views.as_ref().map_or(f64::INFINITY, LightFieldViews::focus);
    let focus = if focus.is_finite() && focus > 0.0 { focus } else { 1.0 };
    ui.horizontal(|ui| {
        let mut choice = |title: &str, is_on: bool, kind: Shows| {
            let one = ui.selectable_label(is_on, title);
            mark(ui.ctx(), &format!("light field={title}"), one.rect);
            if one.clicked() && !is_on {
                shows = kind;
            }
        };
        choice("raw", before == Shows::Raw, Shows::Raw);
        choice("view", matches!(before, Shows::View(_)), Shows::View([0, 0]));
        choice("refocus", matches!(before, Shows::Focused(_)), Shows::Focused(focus));
    });
    let count = app.light_field.views.as_ref().map_or(1, LightFieldViews::count);
    match &mut shows {
        Shows::Raw => {}
        Shows::View(at) => pupil(ui, count, at),
        Shows::Focused(depth) => {
            let range = focus * 0.2..=focus * 5.0;
            let slider = egui::Slider::new(depth, range).logarithmic(true).suffix(" m");
            let slider = ui.add(slider.custom_formatter(|depth, _| short(depth)));
            mark(ui.ctx(), "refocus", slider.rect);
        }
    }
    if shows != before {
        app.light_field.shows = shows;
        app.show_light_field(ui.ctx());
    }
}

/// The pupil as a square of its views: a drag moves through it.
fn pupil(ui: &mut Ui, count: u32, at: &mut [u32; 2]) {
    let side = ui.available_width().min(140.0);
    let (response, painter) = ui.allocate_painter(Vec2::splat(side), Sense::click_and_drag());
    let place = response.rect;
    mark(ui.ctx(), "pupil", place);
    #[expect(clippy::cast_precision_loss, reason = "at most 255 views a side")]
    let cell = side / count as f32;
    if let Some(pointer) = response.interact_pointer_pos() {
        let from = pointer - place.min;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let index = |along: f32| (along / cell).clamp(0.0, 1e4) as u32;
        *at = [from.x, from.y].map(|along| index(along).min(count.saturating_sub(1)));
    }
    for row in 0..count {
        for column in 0..count {
            #[expect(clippy::cast_precision_loss, reason = "at most 255 views a side")]
            let corner = place.min + Vec2::new(column as f32, row as f32) * cell;
            let square = Rect::from_min_size(Pos2::new(corner.x, corner.y), Vec2::splat(cell));
            let color = match [column, row] == *at {
                true => ui.visuals().selection.bg_fill,
                false => ui.visuals().extreme_bg_color,
            };
            painter.rect_filled(square.shrink(1.0), 2.0, color);
        }
    }
    ui.weak(format!("view {}, {} of {count} \u{d7} {count}", at[0], at[1]));
}

/// Whether the camera of the scene has views.
pub(crate) fn is_there(app: &App) -> bool {
    let inspector = app.inspector.as_ref();
    inspector.is_some_and(|inspector| inspector.scene().camera.light_field().is_some())
}
