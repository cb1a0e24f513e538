//! What every page has: head, policy, style, script and foot.

use sha2::{Digest, Sha256};

use super::plots::colour_rules;
use super::provenance::Provenance;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("plots.js");

/// A whole page; title, header and main part are HTML.
///
/// Its policy lets it load nothing, and run no script but ours.
pub fn document(title: &str, header: &str, main: &str, made: &Provenance) -> String {
    let (version, day, colours) = (made.version, &made.day, colour_rules());
    let hash = base64(&Sha256::digest(SCRIPT));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta name=\"generator\" content=\"dynocar {version}\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
         style-src 'unsafe-inline'; script-src 'sha256-{hash}'\">\n\
         <title>{title}</title>\n<style>\n{STYLE}\n{colours}</style>\n</head>\n<body>\n\
         <header>\n{header}</header>\n<main>\n{main}</main>\n\
         <footer><p>Made by Dynocar {version} on {day}. The page is complete in itself: it loads \
         nothing.</p></footer>\n<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let all = (0..3).fold(0, |all, k| all << 8 | usize::from(*chunk.get(k).unwrap_or(&0)));
        for k in 0..4 {
            let letter = char::from(LETTERS[all >> (18 - 6 * k) & 63]);
            text.push(if k <= chunk.len() { letter } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        let coded = ["", "f", "fo", "foo", "foob"].map(|text| base64(text.as_bytes()));
        assert_eq!(coded, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]);
    }
}
