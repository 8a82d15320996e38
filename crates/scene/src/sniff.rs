//! Detection of a file's kind by its first bytes, for those that are not what their name says.

/// Signatures with which files of other kinds start. Sources: the formats' own specifications; Gary
/// Kessler's table of file signatures.
const STARTS: [(&[u8], &str); 26] = [
    (b"\x89PNG\r\n\x1a\n", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"GIF8", "a GIF image"),
    (b"II*\0", "a TIFF image"),
    (b"MM\0*", "a TIFF image"),
    (b"\x76\x2f\x31\x01", "an OpenEXR image"),
    (b"#?RADIANCE", "a Radiance HDR image"),
    (b"#?RGBE", "a Radiance HDR image"),
    (b"\xabKTX", "a KTX texture"),
    (b"DDS ", "a DDS texture"),
    (b"8BPS", "a Photoshop image"),
    (b"glTF", "a binary glTF file (.glb)"),
    (b"ply\n", "a PLY model"),
    (b"ply\r", "a PLY model"),
    (b"Kaydara FBX Binary", "an FBX model"),
    (b"BLENDER", "a Blender file"),
    (b"PXR-USDC", "a USD file"),
    (b"#usda", "a USD file"),
    (b"DRACO", "a Draco mesh"),
    (b"\x93NUMPY", "an NPY array"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"%PDF", "a PDF document"),
    (b"\x7fELF", "a program"),
];

/// Number of bytes that are searched for zeros.
const LOOKED_AT: usize = 4096;

/// Kind of file that `bytes` are the start of; `None` for what might be text of any kind, or is not known.
pub(crate) fn what_it_is(bytes: &[u8]) -> Option<&'static str> {
    if let Some((_, what)) = STARTS.iter().find(|(start, _)| bytes.starts_with(start)) {
        return Some(what);
    }
    if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        return Some("a WebP image");
    }
    let head = &bytes[..bytes.len().min(LOOKED_AT)];
    if !head.is_empty() && head.iter().all(|&byte| byte == 0) {
        return Some("nothing but zeros, as a copy that was cut off leaves them");
    }
    let text = head.trim_ascii_start();
    if text.starts_with(b"<") {
        let is_page = text.len() >= 5
            && [&b"<html"[..], b"<!doc"].iter().any(|tag| text[..5].eq_ignore_ascii_case(tag));
        return Some(if is_page { "a web page" } else { "an XML file" });
    }
    if text.starts_with(b"version https://git-lfs") {
        return Some("a Git LFS pointer; fetch the file itself with `git lfs pull`");
    }
    head.contains(&0).then_some("binary data of no known kind")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_first_bytes() {
        assert_eq!(what_it_is(b"\x89PNG\r\n\x1a\n\0\0"), Some("a PNG image"));
        assert_eq!(what_it_is(b"RIFF\x10\0\0\0WEBPVP8 "), Some("a WebP image"));
        assert_eq!(what_it_is(b"\n<!DOCTYPE html>"), Some("a web page"));
        assert!(what_it_is(&[0; 9]).is_some_and(|what| what.contains("zeros")));
        assert_eq!(what_it_is(b"\x01\0\x02"), Some("binary data of no known kind"));
        for text in [&b"{\"asset\": {}}"[..], b"", b"v 0 0 0\r\n", "é".as_bytes()] {
            assert_eq!(what_it_is(text), None);
        }
    }
}
