//! What of a scene is looked at.

use serde_json::{Value, json};

/// What the window shows.
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

#[cfg(test)]
mod tests {
    use super::*;

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
