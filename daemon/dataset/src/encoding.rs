//! Which letters a text file's bytes are.

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use super::error::FileProblem;

/// The encodings that messages propose; every other of the WHATWG's list is known, too.
pub(super) const USUAL: [&str; 5] = ["utf-8", "windows-1252", "iso-8859-2", "utf-16le", "utf-16be"];

/// The encoding of this name, as `utf-8`, `windows-1252`, `cp1252` or `latin1`.
pub fn by_name(name: &str) -> Option<&'static Encoding> {
    Encoding::for_label_no_replacement(name.as_bytes())
}

/// The encoding of bytes that nobody described: UTF-16 where they begin so, UTF-8 where they are such,
/// else that of Western European Windows, unless they hold what no text does.
pub fn guessed(bytes: &[u8]) -> &'static Encoding {
    match bytes {
        [0xff, 0xfe, ..] => UTF_16LE,
        [0xfe, 0xff, ..] => UTF_16BE,
        _ if std::str::from_utf8(bytes).is_ok() || bytes.iter().any(is_no_letter) => UTF_8,
        _ => WINDOWS_1252,
    }
}

fn is_no_letter(byte: &u8) -> bool {
    byte.is_ascii_control() && !byte.is_ascii_whitespace()
}

/// The text of a run's file in its declared encoding.
///
/// # Errors
///
/// If bytes are not valid in the encoding, with the line.
pub fn decoded(bytes: Vec<u8>, encoding: &'static Encoding) -> Result<String, FileProblem> {
    if encoding == UTF_8 {
        return String::from_utf8(bytes).map_err(|error| {
            let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = 1 + good.iter().filter(|&&byte| byte == b'\n').count();
            FileProblem::OtherEncoding { line, expected: encoding.name() }
        });
    }
    if let Some(text) = encoding.decode_without_bom_handling_and_without_replacement(&bytes) {
        return Ok(text.into_owned());
    }
    let (text, _) = encoding.decode_without_bom_handling(&bytes);
    Err(FileProblem::OtherEncoding { line: line_of_first_loss(&text), expected: encoding.name() })
}

/// The line, from 1, of the first letter that stands for what could not be read.
fn line_of_first_loss(text: &str) -> usize {
    let good = text.split('\u{fffd}').next().unwrap_or_default();
    1 + good.matches('\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_letters_are_read_of_several_encodings() {
        let text = "Zeit;Außen [°C]\n";
        let cp1252 = b"Zeit;Au\xdfen [\xb0C]\n".to_vec();
        let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        for (bytes, name) in [
            (text.as_bytes().to_vec(), "UTF-8"),
            (cp1252.clone(), "cp1252"),
            (cp1252.clone(), "Latin1"),
            (utf16, "utf-16le"),
        ] {
            assert_eq!(decoded(bytes, by_name(name).unwrap()), Ok(text.into()), "{name}");
        }
        assert_eq!((guessed(text.as_bytes()), guessed(&cp1252)), (UTF_8, WINDOWS_1252));
        assert_eq!(guessed(b"\x7fELF\x01\xb0"), UTF_8, "a program is no text of Windows");
        assert_eq!(guessed(&[0xff, 0xfe, b'a', 0]), UTF_16LE);
        assert!(["", "utf-9", "replacement"].into_iter().all(|name| by_name(name).is_none()));
        assert!(USUAL.into_iter().all(|name| by_name(name).is_some()));
    }

    #[test]
    fn bytes_of_another_encoding_are_named_with_their_line() {
        let lost = |bytes: &[u8], name: &str| decoded(bytes.to_vec(), by_name(name).unwrap());
        let at = |line, expected| Err(FileProblem::OtherEncoding { line, expected });
        assert_eq!(lost(b"a\nb\xb0\n", "utf-8"), at(2, "UTF-8"));
        assert_eq!(lost(b"a\0\n\0\0\xd8\n\0", "utf-16le"), at(2, "UTF-16LE"));
    }
}
