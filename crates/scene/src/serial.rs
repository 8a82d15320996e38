//! The slots of a serial exposure: each a scene of its own, whose light the sensor adds to that of the others.
//!
//! The shutter lets a slot's light through in the slot's part of the exposure alone, and light is the mean over the whole of
//! it, so that the light of all slots is the sum of their pictures.

use std::path::PathBuf;

use etendue_files::{InputFolder, Opener};
use etendue_optics::element::grey_picture;
use etendue_report::Refusal;
use serde_json::{Value, json};

use crate::SceneError;
use crate::error::not_found;
use crate::file::{
    CameraPath, FramesSpec, PathStep, PixelsSpec, SceneFile, ScenePath, Setting, SlotSpec, texts_of,
};
use crate::frames::listed;
use etendue_camera::{Shutter, ShutterKind};

/// The most slots of an exposure.
const MOST_SLOTS: usize = 4096;

/// The most values of a tile.
const MOST_VALUES: usize = 1 << 20;

/// By how much of an exposure slots may be longer, in rounding of their times.
const ROUNDING: f64 = 1e-9;

/// Top-level keys that slots may set.
const ROOTS: [&str; 4] = ["camera", "lights", "objects", "materials"];

/// A part of an exposure.
#[derive(Debug)]
pub struct Slot {
    /// The scene as it is then.
    pub file: SceneFile,
    /// Share of its light that each pixel takes at this moment; all of it when absent.
    pub pixels: Option<PixelShares>,
    /// Index of the slot in the scene's `serial`.
    number: usize,
    /// The files that are named for it.
    pub(crate) files: Vec<PathBuf>,
}

/// Numbers from 0 to 1, repeated over the pixels of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelShares {
    size: [usize; 2],
    values: Vec<f64>,
}

impl PixelShares {
    /// That of the pixel at a column and row.
    #[must_use]
    pub fn at(&self, [column, row]: [usize; 2]) -> f64 {
        let [width, height] = self.size;
        self.values[row % height * width + column % width]
    }
}

/// A slot, or one of the frames that it is divided among.
struct SlotPart<'a> {
    /// Number of the slot.
    number: usize,
    slot: &'a SlotSpec,
    seed: u64,
    /// From when to when (s from its row's opening).
    span: [f64; 2],
    /// Settings of the frame.
    frame: &'a [(String, Value)],
}

impl SceneFile {
    /// The slots of the exposure, in order; none where it is in one piece.
    ///
    /// # Errors
    ///
    /// When they do not fit into the exposure, set what is the exposure's, or a file is missing or of another size;
    /// the message names the slot.
    pub fn slots(&self, opener: &Opener) -> Result<Vec<Slot>, SceneError> {
        let slots = &self.spec.serial;
        if slots.is_empty() {
            return Ok(Vec::new());
        }
        let folder = self.open_folder(opener)?;
        let shutter = self.serial_shutter()?;
        let spans = self.spans(&shutter)?;
        let mut all = Vec::with_capacity(slots.len());
        for (number, (slot, [start, end])) in slots.iter().zip(spans).enumerate() {
            let frames = self.frames_of(opener, number, slot)?;
            let each = (end - start) / frames.len() as f64;
            for (k, settings) in frames.iter().enumerate() {
                if all.len() == MOST_SLOTS {
                    let why = format!("more than {MOST_SLOTS} slots with the frames along them");
                    return Err(self.fault("serial", why));
                }
                let from = start + each * k as f64;
                let to = if k + 1 == frames.len() { end } else { from + each };
                let seed = self.spec.render.seed.wrapping_add(all.len() as u64);
                let part = SlotPart { number, slot, seed, span: [from, to], frame: settings };
                all.push(self.slot(&folder, part, &shutter)?);
            }
        }
        Ok(all)
    }

    /// Settings of each of the frames that a slot is divided among: none for one in one piece.
    fn frames_of(
        &self,
        opener: &Opener,
        number: usize,
        slot: &SlotSpec,
    ) -> Result<Vec<Vec<(String, Value)>>, SceneError> {
        let Some(along) = &slot.along else { return Ok(vec![Vec::new()]) };
        let at = place_of(number).key("along");
        let frames = match along {
            FramesSpec::List(list) => listed(list),
            FramesSpec::Path(path @ (CameraPath::Poses { .. } | CameraPath::Trajectory { .. })) => {
                // What a user should know of the file is told of `frames`; here it is read for its poses alone.
                let start = || Err(self.fault(&at, "starts from nothing"));
                self.along(&at, path, opener, &mut Vec::new(), start)?
            }
            FramesSpec::Path(_) => {
                let why = "goes by the scene as it is loaded, which a slot does not know\nhint: give `poses`, a `trajectory`, \
                           or a list of settings";
                return Err(self.fault(&at, why));
            }
        };
        if frames.is_empty() {
            return Err(self.fault(&at, "there is no frame\nhint: leave `along` out for one slot"));
        }
        for frame in &frames {
            for (path, _) in &frame.settings {
                if let Some(why) = not_of_a_slot(path) {
                    return Err(self.fault(at.index(frame.number), format!("`{path}` {why}")));
                }
            }
        }
        Ok(frames.into_iter().map(|frame| frame.settings).collect())
    }

    /// Refuses slots by what they say alone.
    pub(crate) fn check_serial(&self) -> Result<(), SceneError> {
        if self.spec.serial.is_empty() {
            return Ok(());
        }
        let shutter = self.serial_shutter()?;
        self.spans(&shutter)?;
        for (number, slot) in self.spec.serial.iter().enumerate() {
            for path in slot.set.keys() {
                if let Some(why) = not_of_a_slot(path) {
                    let at = place_of(number).key("set");
                    return Err(self.fault(at, format!("`{path}` {why}")));
                }
            }
            if let Some(PixelsSpec::Tile(rows)) = &slot.pixels {
                let at = place_of(number).key("pixels");
                check_tile(rows).map_err(|why| self.fault(at, why))?;
            }
        }
        Ok(())
    }

    /// The shutter of the whole exposure.
    fn serial_shutter(&self) -> Result<Shutter, SceneError> {
        if self.spec.serial.len() > MOST_SLOTS {
            let why = format!("{} slots; {MOST_SLOTS} are the most", self.spec.serial.len());
            return Err(self.fault("serial", why));
        }
        if self.spec.render.alpha {
            let why =
                "a picture of several slots has no one backdrop\nhint: leave `render.alpha` out";
            return Err(self.fault("serial", why));
        }
        let camera = self.camera_spec();
        let [_, rows] = camera.sensor().resolution;
        let spec = camera.shutter().cloned().unwrap_or_default();
        let shutter = spec.build(rows).map_err(|error| self.camera_fault(&error))?;
        if shutter.exposure() <= 0.0 {
            let why = "slots divide an exposure, and there is none\nhint: give `camera.shutter` an `exposure`, or \
                       `camera.sensor`";
            return Err(self.fault("serial", why));
        }
        if shutter.kind() == ShutterKind::GlobalReset && shutter.line_time() > 0.0 {
            let why = "rows of a global reset are open for different times, which no slots divide alike\nhint: set \
                       `camera.shutter.type` to \"global\" or \"rolling\"";
            return Err(self.fault("serial", why));
        }
        Ok(shutter)
    }

    /// Times at which each slot starts and ends (s from its row's opening).
    fn spans(&self, shutter: &Shutter) -> Result<Vec<[f64; 2]>, SceneError> {
        let slots = &self.spec.serial;
        let exposure = shutter.exposure();
        let given: f64 = slots.iter().filter_map(|slot| slot.duration).map(|time| time.0).sum();
        let open_ended = slots.iter().filter(|slot| slot.duration.is_none()).count();
        let share = (exposure - given) / open_ended.max(1) as f64;
        let mut spans = Vec::with_capacity(slots.len());
        let mut end = 0.0;
        for (number, slot) in slots.iter().enumerate() {
            let at = place_of(number);
            let start = slot.start.map_or(end, |time| time.0);
            let duration = slot.duration.map_or(share, |time| time.0);
            if !(start >= 0.0 && start.is_finite()) {
                let why = format!("{start} s is not within the exposure");
                return Err(self.fault(at.key("start"), why));
            }
            if !(duration > 0.0 && duration.is_finite()) {
                let why = match slot.duration {
                    Some(_) => format!("{duration} s is no duration\nhint: give more than 0"),
                    None => format!(
                        "is missing, and other slots leave {} s of an exposure of {exposure} s",
                        exposure - given
                    ),
                };
                return Err(self.fault(at.key("duration"), why));
            }
            end = start + duration;
            if end > exposure * (1.0 + ROUNDING) {
                let why = format!(
                    "ends {end} s after the start of an exposure of {exposure} s\nhint: shorten it, or lengthen the exposure"
                );
                return Err(self.fault(&at, why));
            }
            spans.push([start, end.min(exposure)]);
        }
        Ok(spans)
    }

    /// The scene of a slot.
    fn slot(
        &self,
        folder: &InputFolder,
        part: SlotPart<'_>,
        shutter: &Shutter,
    ) -> Result<Slot, SceneError> {
        let SlotPart { number, slot, seed, span: [start, end], frame } = part;
        let at = place_of(number);
        // When the shutter is open anyhow, from the opening of a row.
        let row = 0.5;
        let opening = shutter.span(row)[0];
        let open = shutter.open_intervals(row).into_iter().filter_map(|[from, to]| {
            let [from, to] = [(from - opening).max(start), (to - opening).min(end)];
            (to > from).then_some([from, to])
        });
        let open: Vec<[f64; 2]> = open.collect();
        if open.is_empty() {
            let why = "the shutter is closed all the time that it lasts, by `camera.shutter`\nhint: let it last longer, \
                       start at another time, or open the shutter";
            return Err(self.fault(&at, why));
        }
        let own = [
            ("serial", json!([])),
            ("render.seed", json!(seed)),
            ("camera.shutter.exposure", json!(shutter.exposure())),
            ("camera.shutter.open", json!(open)),
            ("camera.shutter.code", Value::Null),
            ("camera.shutter.chip", Value::Null),
        ];
        let own = own.into_iter().map(|(path, value)| Setting::new(path, value.to_string()));
        let frame = frame.iter().map(|(path, value)| (path, value));
        let set = slot.set.iter().chain(frame);
        let words: Vec<&str> = set.clone().flat_map(|(_, value)| texts_of(value)).collect();
        let set = set.map(|(path, value)| Setting::new(path, value.to_string()));
        let settings: Vec<Setting> = own.chain(set).collect();
        let file = self.with(&settings).map_err(|error| {
            let why = match error {
                SceneError::Invalid { path, why, .. } => why.at(path),
                other => Refusal::new(other.to_string()),
            };
            self.fault(&at, why)
        })?;
        // Any word that it sets may be a file's name; those that are none are not found.
        let trajectory = match &slot.along {
            Some(FramesSpec::Path(CameraPath::Trajectory { file, .. })) => Some(file.as_str()),
            _ => None,
        };
        let words = words.into_iter().chain(trajectory);
        let mut files: Vec<PathBuf> =
            words.filter_map(|word| Some(folder.find(word).ok()?.path)).collect();
        let pixels = match &slot.pixels {
            None => None,
            Some(PixelsSpec::Tile(rows)) => {
                let size = [rows[0].len(), rows.len()];
                Some(PixelShares { size, values: rows.concat() })
            }
            Some(PixelsSpec::File(written)) => {
                let fault = |why: String| self.fault(at.key("pixels"), why);
                let found = folder.find(written).map_err(|error| fault(not_found(error)))?;
                let read = grey_picture(&found.path);
                let (size, values) = read.map_err(|why| fault(format!("\"{written}\" {why}")))?;
                files.push(found.path);
                Some(PixelShares { size, values })
            }
        };
        Ok(Slot { file, pixels, number, files })
    }

    /// Refuses numbers of pixels that are not those of a picture of `resolution`.
    pub(crate) fn check_pixels(
        &self,
        slots: &[Slot],
        resolution: [u32; 2],
    ) -> Result<(), SceneError> {
        for slot in slots {
            let (number, spec) = (slot.number, self.spec.serial.get(slot.number));
            let (Some(pixels), Some(PixelsSpec::File(written))) =
                (&slot.pixels, spec.and_then(|spec| spec.pixels.as_ref()))
            else {
                continue;
            };
            let [width, height] = resolution;
            if pixels.size != [width as usize, height as usize] {
                let [columns, rows] = pixels.size;
                let at = place_of(number).key("pixels");
                let why = format!(
                    "\"{written}\" has {columns} x {rows} pixels, and the sensor {width} x {height}; a mask has one \
                     for each"
                );
                return Err(self.fault(&at, why));
            }
        }
        Ok(())
    }
}

/// The place of a slot.
fn place_of(number: usize) -> ScenePath {
    ScenePath::of("serial").index(number)
}

/// Reason why a slot may not set what is at a path.
fn not_of_a_slot(path: &str) -> Option<&'static str> {
    let path = ScenePath::of(path);
    if !path.root().is_some_and(|root| ROOTS.contains(&root)) {
        return Some(
            "is of the whole exposure; slots set `camera`, `lights`, `objects` and `materials`",
        );
    }
    let holds_the_exposures = match path.steps() {
        [PathStep::Key(root), rest @ ..] if root == "camera" => match rest {
            [PathStep::Key(key), ..] => ["sensor", "shutter"].contains(&key.as_str()),
            _ => true,
        },
        _ => false,
    };
    holds_the_exposures.then_some(
        "holds the sensor or the shutter, which are those of the whole exposure\nhint: set other keys",
    )
}

fn check_tile(rows: &[Vec<f64>]) -> Result<(), String> {
    let width = rows.first().map_or(0, Vec::len);
    if width == 0 || rows.iter().any(|row| row.len() != width) {
        return Err(
            "is no tile: give rows of as many numbers each, such as [[1, 0], [0, 1]]".to_owned()
        );
    }
    if width * rows.len() > MOST_VALUES {
        return Err(format!("has {} numbers; {MOST_VALUES} are the most", width * rows.len()));
    }
    match rows.iter().flatten().find(|value| !(0.0..=1.0).contains(*value)) {
        Some(value) => Err(format!("has the number {value}; a pixel takes 0 to 1 of the light")),
        None => Ok(()),
    }
}
