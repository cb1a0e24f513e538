//! What every page has: head, policy, style, script and foot.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
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
    let hash = STANDARD.encode(Sha256::digest(SCRIPT));
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
