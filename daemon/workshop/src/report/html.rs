//! Parts of pages of HTML: tables, sections, numbers.

use dynocar_analysis::explain::report::IntervalEstimate;
use dynocar_model::words::{self, number};

/// Returns a part of a page under an anchor; title and body are HTML.
pub fn section(id: &str, title: &str, body: &str) -> String {
    format!(
        "<section id=\"{id}\" aria-labelledby=\"{id}-title\">\n\
         <h2 id=\"{id}-title\">{title}</h2>\n{body}</section>\n"
    )
}

/// Returns the key to the colours of a plot.
pub fn legend(entries: &[(&str, &str)]) -> String {
    let items: String = entries
        .iter()
        .map(|(class, words)| format!("<li><i class=\"key {class}\"></i>{words}</li>"))
        .collect();
    format!("<ul class=\"legend\" aria-label=\"Key\">{items}</ul>\n")
}

/// Returns an element that is folded until the reader opens it.
pub fn details(summary: &str, body: &str) -> String {
    format!("<details>\n<summary>{summary}</summary>\n{body}</details>\n")
}

/// Returns a probability that may be tiny, with `decimals` decimals.
pub fn chance(p_value: f64, decimals: usize) -> String {
    if p_value < 1e-6 { "&lt; 10⁻⁶".into() } else { format!("{p_value:.decimals$e}") }
}

/// Returns the text from outside, harmless within elements and quoted attributes.
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
pub enum ColumnAlignment {
    /// Words, to the left.
    Words,
    /// Numbers, to the right.
    Numbers,
    /// Names that may be broken anywhere.
    Names,
}

/// A column of a table: its head in plain text, how its cells are set, and the HTML of a row's cell.
pub type TableColumn<'c, T> = (&'c str, ColumnAlignment, &'c dyn Fn(&T) -> String);

/// Head and cells of columns that are shown as text and as HTML.
pub type TableColumns<'c, T> = &'c [(&'c str, fn(&T) -> String)];

/// Returns a table, which scrolls within itself where the page is narrower; the caption is plain text.
pub fn table<T>(caption: &str, columns: &[TableColumn<'_, T>], rows: &[T]) -> String {
    marked_table(caption, columns, rows, |_| false)
}

/// Returns a table in which some rows stand out.
pub fn marked_table<T>(
    caption: &str,
    columns: &[TableColumn<'_, T>],
    rows: &[T],
    is_marked: impl Fn(&T) -> bool,
) -> String {
    let mut html = format!(
        "<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"{0}\">\n<table>\n\
         <caption>{0}</caption>\n<thead><tr>",
        escape(caption)
    );
    for (name, column, _) in columns {
        html += &format!("<th scope=\"col\"{}>{}</th>", class(*column), escape(name));
    }
    html += "</tr></thead>\n<tbody>\n";
    for row in rows {
        html += if is_marked(row) { "<tr class=\"marked\">" } else { "<tr>" };
        for (k, (_, column, cell)) in columns.iter().enumerate() {
            let (class, cell) = (class(*column), cell(row));
            html += &match k {
                0 => format!("<th scope=\"row\"{class}>{cell}</th>"),
                _ => format!("<td{class}>{cell}</td>"),
            };
        }
        html += "</tr>\n";
    }
    html + "</tbody>\n</table>\n</div>\n"
}

fn class(column: ColumnAlignment) -> &'static str {
    match column {
        ColumnAlignment::Words => "",
        ColumnAlignment::Numbers => " class=\"number\"",
        ColumnAlignment::Names => " class=\"name\"",
    }
}

/// Returns a value above its 95 % interval.
pub fn estimate(estimate: &IntervalEstimate) -> String {
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

/// Returns a share in percent above its interval.
pub fn percent(share: &IntervalEstimate) -> String {
    let shown = |value: f64| words::percent(value, share.interval);
    match share.interval {
        Some([low, high]) => {
            let (low, high) = (shown(low), shown(high));
            format!("{} %<span class=\"interval\">{low} to {high} %</span>", shown(share.value))
        }
        None => format!("{} %", shown(share.value)),
    }
}

/// Returns a number's text with a true minus, and none before zero.
pub fn minus(text: &str) -> String {
    let digits = text.trim_start_matches('-');
    if digits.chars().all(|c| matches!(c, '0' | '.' | ' ' | '%')) {
        return digits.into();
    }
    text.replacen('-', "−", 1)
}

/// Returns a count, a dash for none.
pub fn count(count: usize) -> String {
    if count == 0 { "–".into() } else { grouped(count) }
}

/// Returns a whole number with thin spaces between its thousands.
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
    fn names_from_files_cannot_leave_their_place() {
        assert_eq!(
            escape("<img src=x onerror='alert(1)'>&\"\u{7}"),
            "&lt;img src=x onerror=&#39;alert(1)&#39;&gt;&amp;&quot;\u{fffd}"
        );
    }

    #[test]
    fn a_table_says_what_its_rows_and_columns_are() {
        let columns: [TableColumn<u8>; 2] = [
            ("run", ColumnAlignment::Names, &|_| "x".into()),
            ("n", ColumnAlignment::Numbers, &u8::to_string),
        ];
        let html = table("a < b", &columns, &[1]);
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
        let value = IntervalEstimate { value: 1.234, interval: Some([1.0, 1.4]) };
        assert_eq!(estimate(&value), "1.23<span class=\"interval\">1.00 to 1.40</span>");
    }
}
