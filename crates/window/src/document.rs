//! The scene that is edited: its values, and the way back to earlier ones.
//!
//! The view of a scene: what of it is looked at.

use std::path::PathBuf;
use std::sync::Arc;

use etendue::ScenePath;
use serde_json::{Value, json};

/// Earlier values that are kept.
const MOST_STEPS: usize = 200;

/// Edits of one value that follow each other this soon (s) are one step back.
const ONE_GESTURE: f64 = 0.7;

/// A change of one value, at its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Edit {
    /// The value is this now; objects on the way are made.
    Set(ScenePath, Value),
    /// The key is gone: the format's own default holds.
    Remove(ScenePath),
}

impl Edit {
    pub(crate) fn set(path: impl Into<ScenePath>, value: impl Into<Value>) -> Self {
        Self::Set(path.into(), value.into())
    }

    fn path(&self) -> &ScenePath {
        match self {
            Self::Set(path, _) | Self::Remove(path) => path,
        }
    }
}

/// A scene with its past and its future.
#[derive(Debug)]
pub(crate) struct Document {
    /// The file that it was opened from.
    pub(crate) path: PathBuf,
    /// That file is a scene, and no model or lens that a scene was made for.
    pub(crate) is_scene: bool,
    value: Arc<Value>,
    /// Values of the file.
    saved: Arc<Value>,
    past: Vec<Arc<Value>>,
    future: Vec<Arc<Value>>,
    /// The last edit's place and time (s).
    last: Option<(ScenePath, f64)>,
}

impl Document {
    pub(crate) fn new(path: PathBuf, is_scene: bool, value: Arc<Value>) -> Self {
        let saved = Arc::clone(&value);
        Self { path, is_scene, value, saved, past: Vec::new(), future: Vec::new(), last: None }
    }

    /// File in which it is saved when nobody says where: in its own file, or in a new one beside that.
    pub(crate) fn own_file(&self) -> PathBuf {
        match self.is_scene {
            true => self.path.clone(),
            false => {
                let stem = self.path.file_stem().unwrap_or_default().display();
                self.path.with_file_name(format!("{stem}-scene.json"))
            }
        }
    }

    pub(crate) fn value(&self) -> &Arc<Value> {
        &self.value
    }

    /// The value at a place; null where there is none.
    pub(crate) fn at(&self, path: impl Into<ScenePath>) -> &Value {
        path.into().get(&self.value).unwrap_or(&Value::Null)
    }

    pub(crate) fn is_changed(&self) -> bool {
        self.value != self.saved
    }

    /// Applies edits at the time `now` (s); `true` when anything is another.
    pub(crate) fn apply(&mut self, edits: &[Edit], now: f64) -> bool {
        let mut value = (*self.value).clone();
        edits.iter().for_each(|edit| apply(&mut value, edit));
        let Some(first) = edits.first().filter(|_| value != *self.value) else { return false };
        let goes_on = self.last.as_ref().is_some_and(|(place, at)| {
            place == first.path() && (0.0..ONE_GESTURE).contains(&(now - at))
        });
        if !goes_on {
            self.remember();
        }
        self.last = Some((first.path().clone(), now));
        self.value = Arc::new(value);
        self.future.clear();
        true
    }

    fn remember(&mut self) {
        self.past.push(Arc::clone(&self.value));
        if self.past.len() > MOST_STEPS {
            self.past.remove(0);
        }
    }

    pub(crate) fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    pub(crate) fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }

    pub(crate) fn undo(&mut self) {
        if let Some(earlier) = self.past.pop() {
            self.future.push(std::mem::replace(&mut self.value, earlier));
            self.last = None;
        }
    }

    pub(crate) fn redo(&mut self) {
        if let Some(later) = self.future.pop() {
            self.past.push(std::mem::replace(&mut self.value, later));
            self.last = None;
        }
    }

    /// Goes back to what was accepted last, as if what was refused had not been tried.
    pub(crate) fn refuse(&mut self, accepted: &Arc<Value>) {
        self.value = Arc::clone(accepted);
        while self.past.last().is_some_and(|past| past == accepted) {
            self.past.pop();
        }
        self.last = None;
    }

    /// Takes up what the file says now; `value` is that with the edits that were not saved.
    pub(crate) fn take_up(&mut self, saved: Arc<Value>, value: Arc<Value>) {
        if self.value != value {
            self.remember();
            self.value = value;
        }
        self.saved = saved;
        self.last = None;
    }

    /// The values stand in the file `path` now.
    pub(crate) fn saved_to(&mut self, path: PathBuf, value: &Arc<Value>) {
        (self.path, self.is_scene) = (path, true);
        self.saved = Arc::clone(value);
    }
}

fn apply(value: &mut Value, edit: &Edit) {
    let path = edit.path();
    let Some((holder, key)) = path.split_last() else { return };
    match (edit, holder.find(value)) {
        (Edit::Set(_, new), Some(Value::Array(elements)))
            if key.as_index() == Some(elements.len()) =>
        {
            elements.push(new.clone());
        }
        // What leads nowhere is not set.
        (Edit::Set(_, new), _) => drop(path.set(value, new.clone())),
        (Edit::Remove(_), Some(Value::Object(members))) => drop(members.remove(&key.text())),
        (Edit::Remove(_), Some(Value::Array(elements))) => {
            if let Some(index) = key.as_index().filter(|&index| index < elements.len()) {
                elements.remove(index);
            }
        }
        (Edit::Remove(_), _) => {}
    }
}

/// View that the window shows.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) enum View {
    /// The picture, as `picture.png` shows it.
    #[default]
    Picture,
    /// The sensor's image, developed.
    Sensor,
    /// The sensor's digital numbers.
    Numbers,
    /// A layer of data, by the name that scenes give it.
    Layer(String),
}

impl View {
    /// The scene that shows this and nothing else, so that nothing else is worked out.
    pub(crate) fn of(&self, scene: &Value) -> Value {
        let mut scene = scene.clone();
        let Value::Object(members) = &mut scene else { return scene };
        match self {
            Self::Layer(name) => {
                members.remove("tracer");
                let written = members.get("layers").and_then(Value::as_array);
                // The scene's own options of the layer, where it has the layer.
                let own = written.into_iter().flatten().find(|layer| name_of(layer) == Some(name));
                let layer = own.cloned().unwrap_or_else(|| json!(name));
                members.insert("layers".to_owned(), json!([layer]));
            }
            Self::Picture | Self::Sensor | Self::Numbers => {
                members.insert("layers".to_owned(), json!([]));
                if members.get("tracer").is_none_or(Value::is_null) {
                    members.insert("tracer".to_owned(), json!({ "type": "facing" }));
                }
            }
        }
        scene
    }

    pub(crate) fn title(&self) -> String {
        match self {
            Self::Picture => "Picture".to_owned(),
            Self::Sensor => "Sensor image".to_owned(),
            Self::Numbers => "Raw numbers".to_owned(),
            Self::Layer(name) => name.replace('_', " "),
        }
    }
}

fn name_of(layer: &Value) -> Option<&str> {
    layer.as_str().or_else(|| layer.get("type")?.as_str())
}

/// A scene that is built in: its file name, its title, what it shows, and the scene.
pub(crate) struct FirstScene {
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    pub(crate) about: &'static str,
    pub(crate) json: &'static str,
}

/// Scenes that name no files.
pub(crate) const FIRST_SCENES: [FirstScene; 4] = [
    FirstScene {
        name: "glass.json",
        title: "Glass and gold",
        about: "all paths of light, with depth and normals",
        json: include_str!("../first/glass.json"),
    },
    FirstScene {
        name: "lens.json",
        title: "Behind a lens",
        about: "one thick lens with its aberrations: click with the tool Focus",
        json: include_str!("../first/lens.json"),
    },
    FirstScene {
        name: "sensor.json",
        title: "A sensor's noise",
        about: "raw numbers behind a colour filter array",
        json: include_str!("../first/sensor.json"),
    },
    FirstScene {
        name: "light-field.json",
        title: "A light field",
        about: "a plenoptic camera: look through its lenslets, and refocus",
        json: include_str!("../first/light-field.json"),
    },
];

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn document() -> Document {
        let scene = json!({"camera": {"type": "thin_lens", "f_number": 2.0}, "lights": [{"a": 1}]});
        Document::new("scene.json".into(), true, Arc::new(scene))
    }

    #[test]
    fn a_drag_is_one_step_back() {
        let mut document = document();
        for (i, f_number) in [2.1, 2.2, 2.3].into_iter().enumerate() {
            assert!(document.apply(&[Edit::set("camera.f_number", f_number)], 0.1 * i as f64));
        }
        document.apply(&[Edit::set("camera.f_number", 8.0)], 5.0);
        document.undo();
        assert_eq!(document.at("camera.f_number"), &json!(2.3));
        document.undo();
        assert_eq!(document.at("camera.f_number"), &json!(2.0));
        assert!(!document.can_undo() && !document.is_changed());
        document.redo();
        document.redo();
        assert_eq!(document.at("camera.f_number"), &json!(8.0));
        assert!(!document.can_redo() && document.is_changed());
    }

    #[test]
    fn edits_make_and_remove_what_they_name() {
        let mut document = document();
        let edits = [
            Edit::set("camera.pose.from", json!([1, 2, 3])),
            Edit::Remove("camera.f_number".into()),
            Edit::set("lights[1]", json!({"b": 2})),
            Edit::Remove("lights[0]".into()),
            Edit::set("materials[\"a/b\"].color", 1),
        ];
        assert!(document.apply(&edits, 0.0));
        let expected = json!({"camera": {"type": "thin_lens", "pose": {"from": [1, 2, 3]}},
                          "lights": [{"b": 2}], "materials": {"a/b": {"color": 1}}});
        assert_eq!(**document.value(), expected);
        assert!(!document.apply(&[Edit::Remove("nothing.here".into())], 0.0));
    }

    #[test]
    fn what_is_refused_leaves_no_step() {
        let mut document = document();
        let accepted = Arc::clone(document.value());
        document.apply(&[Edit::set("camera.f_number", -1)], 0.0);
        document.refuse(&accepted);
        assert_eq!(document.value(), &accepted);
        assert!(!document.can_undo());
    }

    #[test]
    fn the_past_has_an_end() {
        let mut document = document();
        for i in 0..10_000 {
            document.apply(&[Edit::set("camera.f_number", i)], 10.0 * f64::from(i));
        }
        assert_eq!(document.past.len(), MOST_STEPS);
    }

    #[test]
    fn a_view_asks_for_nothing_else() {
        let scene = json!({"tracer": {"type": "path"}, "layers": [{"type": "normal", "space": "camera"}, "ids"]});
        let normal = View::Layer("normal".into()).of(&scene);
        assert_eq!(normal, json!({"layers": [{"type": "normal", "space": "camera"}]}));
        assert_eq!(View::Layer("depth".into()).of(&scene), json!({"layers": ["depth"]}));
        assert_eq!(View::Picture.of(&scene), json!({"tracer": {"type": "path"}, "layers": []}));
        let bare = View::Picture.of(&json!({"layers": ["depth"]}));
        assert_eq!(bare, json!({"tracer": {"type": "facing"}, "layers": []}));
    }
}
