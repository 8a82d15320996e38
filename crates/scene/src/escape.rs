//! Text that came out of files, on its way to a terminal or to other programs.
//!
//! Names in files may hold what a terminal takes for a command (control characters) and what turns the
//! order of a line's letters round (Unicode's bidirectional controls: Boucher and Anderson, "Trojan
//! Source: Invisible Vulnerabilities", 2023). Neither leaves the program as it is.

use std::borrow::Cow;
use std::fmt::Write;

/// Tests whether a character is a command rather than a sign.
fn is_command(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}');
    c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}')
}

/// `text` with control and bidirectional characters spelled out as `\u{1b}`; ends of lines and tabs
/// stay.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(
        text,
        |c| is_command(c) && c != '\n' && c != '\t',
        |c, out| out.extend(c.escape_unicode()),
    )
}

/// Escapes `text` as [`printable`] does, onto one line: ends of lines and tabs are spelled out,
/// too. For names inside a message.
#[must_use]
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_command, |c, out| match c {
        '\n' => out.push_str("\\n"),
        '\t' => out.push_str("\\t"),
        c => out.extend(c.escape_unicode()),
    })
}

/// JSON whose strings hold the same characters as `\u001b`, as the format allows: it reads back the
/// same.
#[must_use]
pub fn printable_json(json: &str) -> Cow<'_, str> {
    // Between strings there is nothing but ASCII, and inside of them no control character of ASCII
    // but DEL is left as it is.
    escaped(
        json,
        |c| is_command(c) && c != '\n',
        |c, out| {
            for unit in c.encode_utf16(&mut [0; 2]) {
                let _ = write!(out, "\\u{unit:04x}");
            }
        },
    )
}

fn escaped<'t>(
    text: &'t str,
    is_escaped: impl Fn(char) -> bool,
    escape: impl Fn(char, &mut String),
) -> Cow<'t, str> {
    let Some(first) = text.find(&is_escaped) else { return Cow::Borrowed(text) };
    let mut out = String::with_capacity(text.len() + 16);
    out.push_str(&text[..first]);
    for c in text[first..].chars() {
        if is_escaped(c) { escape(c, &mut out) } else { out.push(c) }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_steers_a_terminal_is_left() {
        let name = "a\u{1b}]0;x\u{7}\u{9b}2J\u{202e}b\u{2066}\u{200f}\r\n\u{7f}";
        assert_eq!(
            printable(name),
            "a\\u{1b}]0;x\\u{7}\\u{9b}2J\\u{202e}b\\u{2066}\\u{200f}\\u{d}\n\\u{7f}"
        );
        assert!(one_line(name).ends_with("\\u{d}\\n\\u{7f}"));
        for plain in ["", "Würfel 立方体 مكعب é", "a\tb\nc"] {
            assert!(matches!(printable(plain), Cow::Borrowed(same) if same == plain));
        }
    }

    #[test]
    fn json_reads_back_the_same() {
        let value = serde_json::json!({ "a\u{202e}\u{9b}": ["\u{2066}\u{7f}\u{1b}\n", "é"] });
        for json in [value.to_string(), serde_json::to_string_pretty(&value).unwrap()] {
            let printed = printable_json(&json);
            assert!(printed.chars().all(|c| !is_command(c) || c == '\n'), "{printed}");
            assert_eq!(serde_json::from_str::<serde_json::Value>(&printed).unwrap(), value);
        }
    }
}
