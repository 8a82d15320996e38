//! The views of a light field: one from a place of the pupil, or all together, focused anew, as focused cameras
//! are by what their lenslets see.

use eframe::egui::{self, Pos2, Rect, Sense, Ui, Vec2};
use etendue::{Error, LightFieldViews, Picture, Preview, Screen};

use crate::form::{mark, short};

/// Part of a light field that is shown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum LightFieldPart {
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
    pub(crate) shows: LightFieldPart,
    views: Option<LightFieldViews>,
    offered: Option<ViewChoices>,
}

/// Choices that the views of the last whole picture offer: it stays while the next one is rendered.
#[derive(Debug, Clone, Copy)]
struct ViewChoices {
    /// Views along a side of the pupil; 0 of focused cameras.
    count: u32,
    /// The distance in focus, and the nearest and the farthest to focus at (m).
    focus: f64,
    distances: [f64; 2],
}

impl LightFieldPanel {
    /// Forgets the views of an earlier picture.
    pub(crate) fn renew(&mut self) {
        self.views = None;
    }

    /// Takes the views out of a picture, once.
    fn find(&mut self, preview: Option<&Preview>) -> Result<(), Error> {
        // Lenslets are told apart at the picture's own size alone.
        if let (None, Some(preview)) = (&self.views, preview.filter(|of| of.factor() == 1)) {
            self.views = preview.light_field()?;
            self.offered = self.views.as_ref().map(|views| ViewChoices {
                count: views.count(),
                focus: views.focus(),
                distances: views.distances(),
            });
        }
        Ok(())
    }

    /// Screen that is to be shown instead of the picture itself.
    pub(crate) fn screen(&mut self, preview: Option<&Preview>) -> Result<Option<Screen>, Error> {
        self.find(preview)?;
        let Some(views) = &self.views else { return Ok(None) };
        let picture: Picture = match self.shows {
            LightFieldPart::Raw => return Ok(None),
            LightFieldPart::View(at) => views.view(at)?,
            LightFieldPart::Focused(depth) => {
                let [nearest, farthest] = views.distances();
                views.refocused(depth.clamp(nearest, farthest))?
            }
        };
        Ok(Some(Screen::of_layer(&picture, "")?))
    }

    /// Shows what there is to choose from; whether something else is chosen now. `picture` is the whole one, where it is
    /// there.
    pub(crate) fn show(&mut self, ui: &mut Ui, picture: Option<&Preview>) -> Result<bool, Error> {
        self.find(picture)?;
        let before = self.shows;
        let mut shows = before;
        let Some(ViewChoices { count, focus, distances }) = self.offered else { return Ok(false) };
        let focus = if focus.is_finite() && focus > 0.0 { focus } else { 1.0 };
        ui.horizontal(|ui| {
            let mut choice = |title: &str, is_on: bool, kind: LightFieldPart| {
                let one = ui.selectable_label(is_on, title);
                mark(ui.ctx(), &format!("light field={title}"), one.rect);
                if one.clicked() && !is_on {
                    shows = kind;
                }
            };
            choice("raw", before == LightFieldPart::Raw, LightFieldPart::Raw);
            if count > 0 {
                choice(
                    "view",
                    matches!(before, LightFieldPart::View(_)),
                    LightFieldPart::View([0, 0]),
                );
            }
            choice(
                "refocus",
                matches!(before, LightFieldPart::Focused(_)),
                LightFieldPart::Focused(focus),
            );
        });
        match &mut shows {
            LightFieldPart::Raw => {}
            LightFieldPart::View(at) => pupil(ui, count, at),
            LightFieldPart::Focused(depth) => {
                let slider = egui::Slider::new(depth, distances[0]..=distances[1])
                    .logarithmic(true)
                    .suffix(" m");
                let slider = ui.add(slider.custom_formatter(|depth, _| short(depth)));
                mark(ui.ctx(), "refocus", slider.rect);
            }
        }
        self.shows = shows;
        Ok(shows != before)
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
