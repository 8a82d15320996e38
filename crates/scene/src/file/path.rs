use std::fmt;
use std::str::FromStr;

use etendue_report::Refusal;
use serde_json::{Map, Value};

use crate::words::kind_of;

/// The place of a value in a scene's values: the keys and indices that lead to it from the top.
///
/// Written and read as messages and `--set` have it, `objects[0].transform.scale`; a key of other characters than
/// letters, digits, `_` and `-` stands in brackets and quotes, `materials["a.b"]`. The top is empty.
///
/// ```
/// # use etendue_scene::ScenePath;
/// let path = ScenePath::of("objects").index(0).key("a b");
/// assert_eq!(path.to_string(), "objects[0][\"a b\"]");
/// assert_eq!(path.to_string().parse(), Ok(path));
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ScenePath(Vec<PathStep>);

/// One step of a [`ScenePath`].
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PathStep {
    /// Into an object.
    Key(String),
    /// Into an array, from 0.
    Index(usize),
}

/// The most steps of a path that is set: half as many as the levels of a JSON text.
const MOST_STEPS: usize = 64;

impl ScenePath {
    /// The place that `path` names; what cannot be read as a path is one key.
    #[must_use]
    pub fn of(path: &str) -> Self {
        path.parse().unwrap_or_else(|_| Self(vec![PathStep::Key(path.to_owned())]))
    }

    /// Returns the place as a JSON pointer (RFC 6901).
    #[must_use]
    pub fn pointer(&self) -> String {
        self.0.iter().fold(String::new(), |pointer, step| match step {
            PathStep::Key(key) => pointer + "/" + &key.replace('~', "~0").replace('/', "~1"),
            PathStep::Index(index) => format!("{pointer}/{index}"),
        })
    }

    /// The place one key further in.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        self.then([PathStep::Key(key.to_owned())])
    }

    /// The place of the entry `index` of the array here.
    #[must_use]
    pub fn index(&self, index: usize) -> Self {
        self.then([PathStep::Index(index)])
    }

    /// The place that `inside` names, counted from here.
    #[must_use]
    pub fn join(&self, inside: impl Into<Self>) -> Self {
        self.then(inside.into().0)
    }

    fn then(&self, steps: impl IntoIterator<Item = PathStep>) -> Self {
        Self(self.0.iter().cloned().chain(steps).collect())
    }

    /// This place, what holds it, and so on to the top.
    pub fn holders(&self) -> impl Iterator<Item = Self> + '_ {
        (0..=self.0.len()).rev().map(|count| Self(self.0[..count].to_vec()))
    }

    /// Returns the place relative to `holder`; `None` where it is not in there.
    #[must_use]
    pub fn inside(&self, holder: &Self) -> Option<Self> {
        self.0.strip_prefix(&*holder.0).map(|rest| Self(rest.to_vec()))
    }

    /// The first key, where there is one.
    #[must_use]
    pub fn root(&self) -> Option<&str> {
        match self.0.first()? {
            PathStep::Key(key) => Some(key),
            PathStep::Index(_) => None,
        }
    }

    /// Its steps, from the top.
    #[must_use]
    pub fn steps(&self) -> &[PathStep] {
        &self.0
    }

    /// Splits the place into what holds it and the last step; `None` for the top.
    #[must_use]
    pub fn split_last(&self) -> Option<(Self, &PathStep)> {
        let (last, holder) = self.0.split_last()?;
        Some((Self(holder.to_vec()), last))
    }

    /// The value there; `None` where there is none.
    #[must_use]
    pub fn get<'a>(&self, root: &'a Value) -> Option<&'a Value> {
        root.pointer(&self.pointer())
    }

    /// The value there, to be changed; `None` where there is none.
    pub fn find<'a>(&self, root: &'a mut Value) -> Option<&'a mut Value> {
        root.pointer_mut(&self.pointer())
    }

    /// Sets the value there, and says where that is: steps of digits that lead into arrays are indices in it. Objects
    /// on the way that are missing are made.
    ///
    /// # Errors
    ///
    /// When there are too many steps, or one leads into something that is neither an object nor an array with such an
    /// entry.
    pub fn set(&self, root: &mut Value, new: Value) -> Result<Self, Refusal> {
        let steps = self.0.len();
        if steps > MOST_STEPS {
            let why =
                format!("the path has {steps} steps; the format needs no more than {MOST_STEPS}");
            return Err(why.into());
        }
        let mut here = root;
        let mut walked = Self::default();
        for step in &self.0 {
            if here.is_null() {
                *here = Value::Object(Map::new());
            }
            here = match (here, step) {
                (Value::Object(members), PathStep::Key(key)) => {
                    walked = walked.key(key);
                    members.entry(key.clone()).or_insert(Value::Null)
                }
                (Value::Array(elements), step) => {
                    let (array, len) = (walked.as_parent(), elements.len());
                    let Some(index) = step.as_index().filter(|&index| index < len) else {
                        let index = step.text();
                        let why =
                            format!("{array} has {len} entries, so there is no {array}[{index}]");
                        return Err(why.into());
                    };
                    walked = walked.index(index);
                    &mut elements[index]
                }
                (leaf, step) => {
                    let (parent, found) = (walked.as_parent(), kind_of(leaf));
                    let step = step.text();
                    return Err(format!("{parent} is {found}, which has no `{step}`").into());
                }
            };
        }
        *here = new;
        Ok(walked)
    }

    fn as_parent(&self) -> String {
        if self.0.is_empty() { "the scene".to_owned() } else { self.to_string() }
    }
}

impl PathStep {
    /// The entry of an array that it leads to.
    #[must_use]
    pub fn as_index(&self) -> Option<usize> {
        match self {
            Self::Key(key) => key.parse().ok(),
            Self::Index(index) => Some(*index),
        }
    }

    /// Its key, or its index in digits.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Key(key) => key.clone(),
            Self::Index(index) => index.to_string(),
        }
    }
}

impl fmt::Display for ScenePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_plain = |key: &str| {
            !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-')
        };
        for (number, step) in self.0.iter().enumerate() {
            match step {
                PathStep::Index(index) => write!(f, "[{index}]")?,
                PathStep::Key(key) if is_plain(key) => {
                    let dot = if number == 0 { "" } else { "." };
                    write!(f, "{dot}{key}")?;
                }
                PathStep::Key(key) => write!(f, "[{}]", Value::from(key.as_str()))?,
            }
        }
        Ok(())
    }
}

impl FromStr for ScenePath {
    type Err = Refusal;

    fn from_str(text: &str) -> Result<Self, Refusal> {
        steps(text).map(Self).ok_or_else(|| {
            Refusal::new(format!("`{text}` is no path")).hint(
                "write keys with dots between and indices in brackets, such as objects[0].transform.scale",
            )
        })
    }
}

/// The steps of `a.b[0]["c.d"]`; `None` when it is no path.
fn steps(text: &str) -> Option<Vec<PathStep>> {
    let mut steps = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        if let Some(inside) = rest.strip_prefix('[') {
            let (step, tail) = if inside.starts_with('"') {
                let mut strings = serde_json::Deserializer::from_str(inside).into_iter::<String>();
                let step = strings.next()?.ok()?;
                (PathStep::Key(step), &inside[strings.byte_offset()..])
            } else {
                let end = inside.find(']')?;
                (PathStep::Index(inside[..end].parse().ok()?), &inside[end..])
            };
            steps.push(step);
            rest = tail.strip_prefix(']')?;
        } else {
            let rest_of_key = if steps.is_empty() { rest } else { rest.strip_prefix('.')? };
            let end = rest_of_key.find(['.', '[']).unwrap_or(rest_of_key.len());
            if end == 0 {
                return None;
            }
            steps.push(PathStep::Key(rest_of_key[..end].to_owned()));
            rest = &rest_of_key[end..];
        }
    }
    (!steps.is_empty()).then_some(steps)
}

impl FromIterator<PathStep> for ScenePath {
    fn from_iter<I: IntoIterator<Item = PathStep>>(steps: I) -> Self {
        Self(steps.into_iter().collect())
    }
}

impl From<&str> for ScenePath {
    fn from(path: &str) -> Self {
        match path {
            "" => Self::default(),
            path => Self::of(path),
        }
    }
}

impl From<String> for ScenePath {
    fn from(path: String) -> Self {
        Self::from(&*path)
    }
}

impl From<&String> for ScenePath {
    fn from(path: &String) -> Self {
        Self::from(&**path)
    }
}

impl From<&Self> for ScenePath {
    fn from(path: &Self) -> Self {
        path.clone()
    }
}

impl From<&serde_path_to_error::Path> for ScenePath {
    fn from(path: &serde_path_to_error::Path) -> Self {
        use serde_path_to_error::Segment;
        let step = |segment: &Segment| match segment {
            Segment::Seq { index } => Some(PathStep::Index(*index)),
            Segment::Map { key } | Segment::Enum { variant: key } => {
                Some(PathStep::Key(key.clone()))
            }
            Segment::Unknown => None,
        };
        path.iter().filter_map(step).collect()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_path_is_read_as_it_is_written() {
        for text in [
            "a",
            "a.b[0]",
            "[\"x y\"].c",
            "a[3][4].b-c_d",
            "[\"\"]",
            "a[\"\\\"]\"]",
            "é[\"\\u0007\"]",
        ] {
            let path: ScenePath = text.parse().unwrap();
            assert_eq!(path.to_string(), text);
        }
        for text in ["", ".", "a..b", "a.", "a[", "a[x]", "a[0]b", "[\"a\"", ".a"] {
            assert!(text.parse::<ScenePath>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_pointer_finds_what_the_path_names() {
        let mut value = json!({"a/b": [{"c~d": 7}]});
        let path = ScenePath::of("[\"a/b\"][0][\"c~d\"]");
        assert_eq!(path.pointer(), "/a~1b/0/c~0d");
        assert_eq!(path.get(&value), Some(&json!(7)));
        let same = ScenePath::default().key("a/b").key("0").key("c~d");
        assert_eq!(
            same.set(&mut value, json!(8)),
            Ok(path),
            "digits that lead into an array are its index"
        );
        assert_eq!(value, json!({"a/b": [{"c~d": 8}]}));
    }

    #[test]
    fn a_place_knows_what_holds_it() {
        let path = ScenePath::of("camera.pose.from[1]");
        let all: Vec<String> = path.holders().map(|path| path.to_string()).collect();
        assert_eq!(all, ["camera.pose.from[1]", "camera.pose.from", "camera.pose", "camera", ""]);
        assert_eq!(path.inside(&ScenePath::of("camera.pose")), Some(ScenePath::of("from[1]")));
        assert_eq!(path.inside(&ScenePath::of("cam")), None);
        assert_eq!(path.root(), Some("camera"));
    }
}
