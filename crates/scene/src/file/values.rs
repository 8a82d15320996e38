//! Values of JSON as Rust's types, with the place and the words of JSON where they are none.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::{MapAccessDeserializer, MapDeserializer, SeqDeserializer};
use serde::de::{self, DeserializeOwned, Deserializer, IntoDeserializer, Unexpected, Visitor};
use serde::forward_to_deserialize_any;
use serde_json::Value;

use super::path::ScenePath;
use crate::words::{kind_of, suggest};

/// `value` as a `T`; the error has the place below `value`, and why it is none.
pub(crate) fn read<T: DeserializeOwned>(value: &Value) -> Result<T, (ScenePath, String)> {
    serde_path_to_error::deserialize(ValueNode::<Reason>::new(value)).map_err(|error| {
        let path = ScenePath::from(error.path());
        (path, error.into_inner().0)
    })
}

/// `value` as a `T`, inside of what a deserializer with the errors `E` reads.
pub(crate) fn read_within<T: DeserializeOwned, E: de::Error>(value: &Value) -> Result<T, E> {
    T::deserialize(ValueNode::new(value))
}

/// A value that is read, with errors `E`.
struct ValueNode<'a, E> {
    value: &'a Value,
    errors: PhantomData<E>,
}

impl<'a, E> ValueNode<'a, E> {
    fn new(value: &'a Value) -> Self {
        Self { value, errors: PhantomData }
    }
}

impl<'a, E: de::Error> IntoDeserializer<'a, E> for ValueNode<'a, E> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de, E: de::Error> Deserializer<'de> for ValueNode<'de, E> {
    type Error = E;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, E> {
        match self.value {
            Value::Null => visitor.visit_unit(),
            Value::Bool(truth) => visitor.visit_bool(*truth),
            Value::Number(number) => match (number.as_u64(), number.as_i64(), number.as_f64()) {
                (Some(number), ..) => visitor.visit_u64(number),
                (_, Some(number), _) => visitor.visit_i64(number),
                (.., number) => visitor.visit_f64(number.unwrap_or(f64::NAN)),
            },
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Array(elements) => {
                let mut inside = SeqDeserializer::new(elements.iter().map(Self::new));
                let read = visitor.visit_seq(&mut inside)?;
                inside.end().map(|()| read)
            }
            Value::Object(members) => {
                let members = members.iter().map(|(key, value)| (key.as_str(), Self::new(value)));
                let mut inside = MapDeserializer::new(members);
                let read = visitor.visit_map(&mut inside)?;
                inside.end().map(|()| read)
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, E> {
        match self.value {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, E> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, E> {
        match self.value {
            Value::String(word) => visitor.visit_enum(word.as_str().into_deserializer()),
            Value::Object(members) if members.len() == 1 => {
                let members = members.iter().map(|(key, value)| (key.as_str(), Self::new(value)));
                visitor.visit_enum(MapAccessDeserializer::new(MapDeserializer::new(members)))
            }
            Value::Object(_) => Err(E::invalid_value(Unexpected::Map, &"an object with one key")),
            other => Err(E::invalid_type(Unexpected::Other(kind_of(other)), &"a word")),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// Reason why a value is none of a type, in words for who wrote the JSON: without the names of Rust's types.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Reason(String);

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Reason {}

impl de::Error for Reason {
    fn custom<T: fmt::Display>(why: T) -> Self {
        Self(why.to_string())
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self(format!("expected {}, found {}", kind(expected), shown(found)))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(found: usize, expected: &dyn de::Expected) -> Self {
        Self(format!("expected {}, found {found} values", kind(expected)))
    }

    fn unknown_variant(found: &str, known: &'static [&'static str]) -> Self {
        Self(format!("\"{found}\" is not known here{}", suggest(found, known.iter().copied())))
    }

    fn unknown_field(found: &str, known: &'static [&'static str]) -> Self {
        Self(format!("\"{found}\" is an unknown key{}", suggest(found, known.iter().copied())))
    }

    fn missing_field(key: &'static str) -> Self {
        Self(format!("the key `{key}` is missing"))
    }

    fn duplicate_field(key: &'static str) -> Self {
        Self(format!("the key `{key}` stands here twice"))
    }
}

/// The longest value that a message repeats (characters).
const LONGEST: usize = 40;

/// The value that was found.
fn shown(found: Unexpected<'_>) -> String {
    let text = match found {
        Unexpected::Bool(truth) => truth.to_string(),
        Unexpected::Unsigned(number) => number.to_string(),
        Unexpected::Signed(number) => number.to_string(),
        Unexpected::Float(number) => number.to_string(),
        Unexpected::Str(text) => format!("\"{text}\""),
        Unexpected::Unit | Unexpected::Option => "null".to_owned(),
        Unexpected::Seq => "an array".to_owned(),
        Unexpected::Map => "an object".to_owned(),
        other => other.to_string(),
    };
    match text.chars().count() {
        0..=LONGEST => text,
        _ => "a long string".to_owned(),
    }
}

/// The kind of value that would do, of the words by which serde's derived code says it.
fn kind(expected: &dyn de::Expected) -> String {
    let expected = expected.to_string();
    let after = |prefix: &str| expected.strip_prefix(prefix);
    if let Some(count) = after("an array of length ").or_else(|| after("a tuple of size ")) {
        return format!("an array of {count} values");
    }
    // glTF's numbers that stand for kinds.
    if let Some(known) = after("any of: [").and_then(|list| list.strip_suffix(']')) {
        return format!("one of {known}");
    }
    match (expected.as_str(), expected.split(' ').next().unwrap_or_default()) {
        ("usize" | "u8" | "u16" | "u32" | "u64" | "index into child of root", _) => {
            "a whole number from 0"
        }
        ("isize" | "i8" | "i16" | "i32" | "i64", _) => "a whole number",
        ("f32" | "f64", _) => "a number",
        ("a sequence", _) => "an array",
        ("a map", _) | (_, "struct") => "an object",
        ("a boolean", _) => "true or false",
        ("unit", _) => "null",
        (_, "tuple") => "an array",
        (_, "variant" | "enum") => "a word",
        (expected, _) => expected,
    }
    .to_owned()
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;
    use serde_json::json;

    use super::*;

    #[derive(Debug, Deserialize)]
    struct Inner {
        #[serde(rename = "count")]
        _count: usize,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(rename_all = "snake_case")]
    enum Word {
        Sphere,
        Box(f64),
    }

    fn said<T: DeserializeOwned + fmt::Debug>(value: Value) -> String {
        read::<T>(&value).unwrap_err().1
    }

    #[test]
    fn no_type_of_rust_is_named() {
        assert_eq!(said::<usize>(json!(-1)), "expected a whole number from 0, found -1");
        assert_eq!(said::<u32>(json!(1.5)), "expected a whole number from 0, found 1.5");
        assert_eq!(
            said::<f64>(json!("x, expected y")),
            "expected a number, found \"x, expected y\""
        );
        assert_eq!(said::<[f64; 4]>(json!({})), "expected an array of 4 values, found an object");
        assert_eq!(
            said::<[f64; 4]>(json!([1, 2])),
            "expected an array of 4 values, found 2 values"
        );
        assert_eq!(said::<(f64, f64)>(json!(3)), "expected an array of 2 values, found 3");
        assert_eq!(said::<Vec<f64>>(json!(true)), "expected an array, found true");
        assert_eq!(said::<String>(json!(null)), "expected a string, found null");
        assert_eq!(said::<Inner>(json!(7)), "expected an object, found 7");
        assert_eq!(said::<Inner>(json!({})), "the key `count` is missing");
        let long = json!("x".repeat(1000));
        assert_eq!(said::<u8>(long), "expected a whole number from 0, found a long string");
        assert_eq!(said::<Word>(json!(3)), "expected a word, found a number");
        let word = said::<Word>(json!("shpere"));
        assert_eq!(
            word,
            "\"shpere\" is not known here\nhint: did you mean `sphere`? known: `box`, `sphere`"
        );
    }

    #[test]
    fn the_place_of_what_is_wrong_is_known() {
        let place = |value| read::<Vec<Inner>>(&value).unwrap_err().0.to_string();
        assert_eq!(place(json!([{"count": 1}, {"count": "2"}])), "[1].count");
        assert_eq!(place(json!([{"count": 1}, {}])), "[1]");
        assert_eq!(read::<Word>(&json!({"box": 2})), Ok(Word::Box(2.0)));
        assert_eq!(read::<Word>(&json!({"box": "2"})).unwrap_err().0.to_string(), "box");
        assert_eq!(read::<Word>(&json!("sphere")), Ok(Word::Sphere));
    }
}
