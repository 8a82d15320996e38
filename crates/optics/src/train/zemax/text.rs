//! Bytes to text. OpticStudio writes UTF-16 with a byte order mark, older versions one byte a
//! character.

use super::ZemaxError;

/// The text of a file in UTF-8 or UTF-16 of either order, by its byte order mark or, without one, by
/// where its zero bytes are. What is no UTF-8 is taken for Latin-1, as old versions write it.
pub(super) fn decode(bytes: &[u8]) -> Result<String, ZemaxError> {
    match bytes {
        [] => Err(ZemaxError::new(1, "the file is empty")),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest),
        [first, 0, ..] if *first != 0 => utf16(bytes, u16::from_le_bytes),
        [0, second, ..] if *second != 0 => utf16(bytes, u16::from_be_bytes),
        _ => utf8(bytes),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, ZemaxError> {
    let (pairs, odd) = bytes.as_chunks::<2>();
    let text: Result<String, _> =
        char::decode_utf16(pairs.iter().map(|&pair| unit(pair))).collect();
    match text {
        Ok(text) if odd.is_empty() => Ok(text),
        _ => Err(ZemaxError::new(1, "the file is broken UTF-16; save it again")),
    }
}

fn utf8(bytes: &[u8]) -> Result<String, ZemaxError> {
    if bytes.contains(&0) {
        return Err(ZemaxError::new(1, "the file is no text"));
    }
    Ok(match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    })
}
