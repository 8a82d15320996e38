//! Curves in files that cameras and lens files name, `{"file": "x.csv"}`: read, they stand in the file's place.

use std::path::Path;

use etendue_spectrum::{Curve, CurveFault, CurveSpec};
use serde_json::{Map, Value, json};

/// The longest table of a curve that is read (bytes).
pub const LONGEST_TABLE: u64 = 1 << 26;

/// Puts curves in the place of the files that `value` names, in filters, elements and sensors; `read` gives the text of a
/// file. Whether there were any.
///
/// # Errors
///
/// When a file cannot be read or is no curve; the key leads to it from `value`.
pub fn read_curves(
    value: &mut Value,
    read: &mut dyn FnMut(&str) -> Result<String, String>,
) -> Result<bool, CurveFault> {
    match value {
        Value::Object(members) if is_curve_file(members) => {
            *value = json!(curve_of(value, read)?);
            Ok(true)
        }
        Value::Object(members) => {
            let mut any = false;
            for (key, below) in members {
                any |= read_curves(below, read).map_err(|fault| below_key(key, fault))?;
            }
            Ok(any)
        }
        Value::Array(all) => {
            let mut any = false;
            for (k, below) in all.iter_mut().enumerate() {
                any |= read_curves(below, read)
                    .map_err(|fault| below_key(&format!("[{k}]"), fault))?;
            }
            Ok(any)
        }
        _ => Ok(false),
    }
}

fn curve_of(
    value: &Value,
    read: &mut dyn FnMut(&str) -> Result<String, String>,
) -> Result<Curve, CurveFault> {
    let spec: CurveSpec = serde_json::from_value(value.clone()).map_err(|_| {
        let why =
            "is no curve\nhint: give { \"file\": \"x.csv\", \"column\": \"name\", \"scale\": 1 }";
        CurveFault { key: String::new(), why: why.to_owned() }
    })?;
    spec.resolve(read)
}

/// A fault below a key or the place of a list.
fn below_key(at: &str, CurveFault { key, why }: CurveFault) -> CurveFault {
    let dot = if key.is_empty() || key.starts_with('[') { "" } else { "." };
    CurveFault { key: format!("{at}{dot}{key}"), why }
}

/// True if a value is a curve in a file, and no lens or image.
fn is_curve_file(members: &Map<String, Value>) -> bool {
    let is_table = |file: &str| {
        let ending = Path::new(file).extension().map(|e| e.to_ascii_lowercase());
        ending.is_some_and(|ending| ending == "csv" || ending == "spd")
    };
    members.get("file").and_then(Value::as_str).is_some_and(is_table)
        && members.keys().all(|key| matches!(key.as_str(), "file" | "column" | "scale"))
}
