//! Messages of the library, which name options of the command line, in the words of Python.

/// Options whose words in Python are not their names with underscores.
const OPTIONS: [(&str, &str); 6] = [
    ("--set ", ""),
    ("`--up z`, or its object ", "the scene \"up\": \"z\", or its object "),
    ("pass --allow-outside", "pass allow_outside=True"),
    ("without --strict", "without strict=True"),
    ("--accel bvh", "render.accel \"bvh\""),
    ("; a catalogue of your own is added with --glass-catalog FILE.agf", ""),
];

/// `message` without options of the command line: `--set camera.fov=x` is `camera.fov=x`, and
/// `--memory-limit` is `memory_limit`.
pub(crate) fn in_python(message: &str) -> String {
    let mut words = message.to_owned();
    for (option, keyword) in OPTIONS {
        words = words.replace(option, keyword);
    }
    // What follows a blank or a mark is an option, what follows a letter or a slash a part of a name.
    let starts = |before: &str| before.ends_with([' ', '`', '(', ',']) || before.is_empty();
    let mut message = String::with_capacity(words.len());
    let mut left = &*words;
    while let Some((before, after)) = left.split_once("--") {
        message.push_str(before);
        let length = after.find(|c: char| !(c.is_ascii_lowercase() || c == '-'));
        let (name, rest) = after.split_at(length.unwrap_or(after.len()));
        match starts(before) && !name.is_empty() {
            true => message.push_str(&name.replace('-', "_")),
            false => message.extend(["--", name]),
        }
        left = rest;
    }
    message + left
}
