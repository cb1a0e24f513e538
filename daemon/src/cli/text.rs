//! Aligned text for people.

/// Widest line of running text.
pub const WIDTH: usize = 96;
/// Width of the keys of an entry.
const KEY_WIDTH: usize = 12;

/// Rows of cells under a header, aligned in columns.
#[derive(Clone, Debug)]
pub struct TextTable {
    rows: Vec<Vec<String>>,
    /// Columns aligned to the left; the others hold numbers and are aligned to the right.
    left: Vec<usize>,
}

impl TextTable {
    /// Returns a table with a header; `left` are the columns of words.
    pub fn new(header: &[&str], left: &[usize]) -> Self {
        let header = header.iter().map(|&name| name.into()).collect();
        TextTable { rows: vec![header], left: left.into() }
    }

    /// Adds a row with as many cells as the header.
    pub fn push(&mut self, row: Vec<String>) {
        self.rows.push(row);
    }
}

impl std::fmt::Display for TextTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width_of = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.rows[0].len()).map(width_of).collect();
        for row in &self.rows {
            let mut line = String::new();
            for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                let padding = " ".repeat(width - cell.chars().count());
                line += "  ";
                if self.left.contains(&column) {
                    line += cell;
                    line += &padding;
                } else {
                    line += &padding;
                    line += cell;
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Breaks words into lines of at most `width` letters (a longer word has its own line).
pub fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

/// Returns a number with at most `decimals` decimals and no zeros at its end.
pub fn short(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    if text == "-0" { "0".into() } else { text.into() }
}

/// Returns an entry: a key and the words on it, broken into lines.
pub fn line(key: &str, value: &str) -> String {
    let mut lines = wrap(value, WIDTH - KEY_WIDTH).into_iter();
    let first = lines.next().unwrap_or_default();
    let rest = lines.map(|line| format!("  {:KEY_WIDTH$}{line}\n", ""));
    format!("  {key:KEY_WIDTH$}{first}\n{}", rest.collect::<String>())
}

/// Returns a sentence that begins with its subject, the lines after the first further in.
pub fn entry(indent: &str, words: &str) -> String {
    let lines = wrap(words, WIDTH - indent.len());
    format!("{indent}{}\n", lines.join(&format!("\n{indent}  ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_by_letters_not_bytes() {
        let mut table = TextTable::new(&["run", "file", "m"], &[1]);
        table.push(vec!["1".into(), "zürich".into(), "12".into()]);
        table.push(vec!["10".into(), "x".into(), "3.5".into()]);
        assert_eq!(
            table.to_string(),
            "  run  file      m\n    1  zürich   12\n   10  x       3.5\n"
        );
    }

    #[test]
    fn text_is_wrapped_between_words() {
        assert_eq!(wrap("a bb ccc  dddd", 6), ["a bb", "ccc", "dddd"]);
        assert_eq!(wrap("", 10), [] as [String; 0]);
    }

    #[test]
    fn short_numbers_have_no_needless_zeros() {
        assert_eq!(short(1.50, 3), "1.5");
        assert_eq!(short(100.0, 2), "100");
        assert_eq!(short(-0.0001, 2), "0");
        assert_eq!(short(1200.0, 0), "1200");
    }
}
