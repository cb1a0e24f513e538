//! Where the FMU was unpacked.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::PathBuf;

/// The folder that a `file:` URI means (RFC 8089), or a plain absolute path; `None` for any other.
pub fn folder_of(location: &str) -> Option<PathBuf> {
    let Some(rest) = location.strip_prefix("file:") else {
        return location.starts_with('/').then(|| location.into());
    };
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.strip_prefix("localhost").unwrap_or(rest),
        None => rest,
    };
    let bytes = percent_decoded(path.as_bytes())?;
    bytes.starts_with(b"/").then(|| OsString::from_vec(bytes).into())
}

/// `None` where a percent sign is followed by no two hexadecimal digits.
fn percent_decoded(text: &[u8]) -> Option<Vec<u8>> {
    let mut decoded = Vec::with_capacity(text.len());
    let mut rest = text.iter();
    while let Some(&byte) = rest.next() {
        let mut digit = || char::from(*rest.next()?).to_digit(16);
        decoded.push(if byte == b'%' { (16 * digit()? + digit()?) as u8 } else { byte });
    }
    Some(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_found_by_any_way_of_writing_its_uri() {
        let expected = Some(PathBuf::from("/tmp/a b/é#1"));
        for location in [
            "file:///tmp/a%20b/%C3%A9%231",
            "file://localhost/tmp/a%20b/%c3%a9%231",
            "file:/tmp/a%20b/é%231",
            "/tmp/a b/é#1",
        ] {
            assert_eq!(folder_of(location), expected, "{location}");
        }
    }

    #[test]
    fn what_is_no_local_folder_is_none() {
        for location in
            ["", "resources", "https://host/a", "file://host/a", "file:///a%2", "file:///%zz"]
        {
            assert_eq!(folder_of(location), None, "{location}");
        }
    }
}
