//! Pieces of HTML.

use std::fmt::Write as _;

use dynocar_analysis::explain::report::Estimate;
use dynocar_analysis::explain::report::words::{self, number};

/// Text from outside, harmless within elements and quoted attributes.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Control characters have no place in HTML.
            other if other.is_control() && other != '\n' => escaped.push('\u{fffd}'),
            other => escaped.push(other),
        }
    }
    escaped
}

/// How the cells of a column are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// Words, to the left.
    Words,
    /// Numbers, to the right.
    Numbers,
    /// Names that may be broken anywhere.
    Names,
}

/// A table whose cells are HTML.
#[derive(Clone, Debug)]
pub struct Table {
    caption: String,
    head: Vec<(String, Column)>,
    rows: Vec<(Vec<String>, bool)>,
}

impl Table {
    /// A table; caption and head are plain text.
    pub fn new(caption: &str, head: &[(&str, Column)]) -> Self {
        let head = head.iter().map(|(name, column)| (escape(name), *column)).collect();
        Table { caption: escape(caption), head, rows: Vec::new() }
    }

    /// Adds a row of HTML cells.
    pub fn push(&mut self, cells: Vec<String>) {
        self.rows.push((cells, false));
    }

    /// Adds a row that stands out.
    pub fn push_marked(&mut self, cells: Vec<String>) {
        self.rows.push((cells, true));
    }

    /// The table, which scrolls within itself where the page is narrower.
    pub fn html(&self) -> String {
        let mut html = format!(
            "<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"{0}\">\n<table>\n\
             <caption>{0}</caption>\n<thead><tr>",
            self.caption
        );
        for (name, column) in &self.head {
            let _ = write!(html, "<th scope=\"col\"{}>{name}</th>", class(*column));
        }
        html += "</tr></thead>\n<tbody>\n";
        for (cells, is_marked) in &self.rows {
            html += if *is_marked { "<tr class=\"marked\">" } else { "<tr>" };
            for (k, (cell, (_, column))) in cells.iter().zip(&self.head).enumerate() {
                let class = class(*column);
                let _ = match k {
                    0 => write!(html, "<th scope=\"row\"{class}>{cell}</th>"),
                    _ => write!(html, "<td{class}>{cell}</td>"),
                };
            }
            html += "</tr>\n";
        }
        html + "</tbody>\n</table>\n</div>\n"
    }
}

fn class(column: Column) -> &'static str {
    match column {
        Column::Words => "",
        Column::Numbers => " class=\"number\"",
        Column::Names => " class=\"name\"",
    }
}

/// A value above its 95 % interval.
pub fn estimate(estimate: &Estimate) -> String {
    let half = estimate.interval.map(|[low, high]| 0.5 * (high - low));
    let value = number(estimate.value, half);
    match estimate.interval {
        Some(interval) => {
            let [low, high] = interval.map(|bound| number(bound, half));
            format!("{value}<span class=\"interval\">{low} to {high}</span>")
        }
        None => value,
    }
}

/// A share in percent above its interval.
pub fn percent(share: &Estimate) -> String {
    let shown = |value: f64| words::percent(value, share.interval);
    match share.interval {
        Some([low, high]) => {
            let (low, high) = (shown(low), shown(high));
            format!("{} %<span class=\"interval\">{low} to {high} %</span>", shown(share.value))
        }
        None => format!("{} %", shown(share.value)),
    }
}

/// A number's text with a true minus, and none before zero.
pub fn minus(text: &str) -> String {
    let digits = text.trim_start_matches('-');
    if digits.chars().all(|c| matches!(c, '0' | '.' | ' ' | '%')) {
        return digits.into();
    }
    text.replacen('-', "−", 1)
}

/// A count, a dash for none.
pub fn count(count: usize) -> String {
    if count == 0 { "–".into() } else { grouped(count) }
}

/// A whole number with thin spaces between its thousands.
pub fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_mass_is_shown_to_the_kilogram() {}

    #[test]
    fn names_from_files_cannot_leave_their_place() {
        assert_eq!(
            escape("<img src=x onerror='alert(1)'>&\"\u{7}"),
            "&lt;img src=x onerror=&#39;alert(1)&#39;&gt;&amp;&quot;\u{fffd}"
        );
    }

    #[test]
    fn a_table_says_what_its_rows_and_columns_are() {
        let mut table = Table::new("a < b", &[("run", Column::Names), ("n", Column::Numbers)]);
        table.push(vec!["x".into(), "1".into()]);
        let html = table.html();
        assert!(html.contains("<caption>a &lt; b</caption>"));
        assert!(
            html.contains("<th scope=\"row\" class=\"name\">x</th><td class=\"number\">1</td>")
        );
    }

    #[test]
    fn numbers_are_set_for_reading() {
        assert_eq!(grouped(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(grouped(12), "12");
        assert_eq!(minus("-0.0"), "0.0");
        assert_eq!(minus("-0 %"), "0 %");
        assert_eq!(minus("-1.5"), "−1.5");
        let value = Estimate { value: 1.234, interval: Some([1.0, 1.4]) };
        assert_eq!(estimate(&value), "1.23<span class=\"interval\">1.00 to 1.40</span>");
    }
}
