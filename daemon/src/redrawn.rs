//! Lines on a terminal that later lines replace.

use std::fmt::Write as _;
use std::io::{self, Write as _};

use rustix::termios::tcgetwinsize;

/// Columns of a terminal that does not report their number.
const USUAL_COLUMNS: usize = 80;

/// Returns whether the terminal takes letters beyond ASCII, by its locale.
pub fn is_utf8() -> bool {
    let named = |name| std::env::var(name).ok().filter(|it: &String| !it.is_empty());
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(named).unwrap_or_default();
    let locale = locale.to_ascii_lowercase();
    locale.contains("utf-8") || locale.contains("utf8")
}

/// Returns whether lines can be replaced, and boxes and bars drawn: not on a terminal of the type `dumb`.
pub fn can_draw() -> bool {
    std::env::var("TERM").is_ok_and(|it| !it.is_empty() && it != "dumb") && is_utf8()
}

/// Latest drawing on the terminal of standard error.
#[derive(Debug, Default)]
pub struct Redrawn {
    lines: usize,
}

impl Redrawn {
    /// Draws lines over those drawn before; each is cut to the terminal's width.
    pub fn draw(&mut self, lines: &[String]) {
        let mut stderr = io::stderr().lock();
        let columns = tcgetwinsize(&stderr).map_or(0, |size| usize::from(size.ws_col));
        let columns = if columns == 0 { USUAL_COLUMNS } else { columns };
        // A terminal that is gone shows nothing.
        let _ = stderr.write_all(drawing(self.lines, lines, columns).as_bytes());
        self.lines = lines.len();
    }
}

/// Returns the letters that draw lines over the lines drawn before.
fn drawing(before: usize, lines: &[String], columns: usize) -> String {
    let mut text = String::new();
    if before > 0 {
        let _ = write!(text, "\x1b[{before}A");
    }
    for line in lines {
        let line: String = line.chars().take(columns.saturating_sub(1)).collect();
        let _ = writeln!(text, "\r\x1b[2K{line}");
    }
    text
}

/// Returns a bar of a share from 0 to 1, `letters` letters long.
pub fn bar(share: f64, letters: usize) -> String {
    let full = (share.clamp(0.0, 1.0) * letters as f64).round() as usize;
    "█".repeat(full) + &"░".repeat(letters - full)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_written_over_those_before_and_cut_to_the_width() {
        let lines = ["one".to_owned(), "a long line".to_owned()];
        assert_eq!(drawing(0, &lines, 7), "\r\x1b[2Kone\n\r\x1b[2Ka long\n");
        assert_eq!(drawing(2, &lines[..1], 80), "\x1b[2A\r\x1b[2Kone\n");
    }

    #[test]
    fn a_bar_is_as_full_as_its_share() {
        assert_eq!([bar(0.0, 4), bar(0.5, 4), bar(2.0, 4)], ["░░░░", "██░░", "████"]);
    }
}
