//! CSV files as they come, and every refusal with its words.

use super::*;
use crate::clock::TimeFormat;
use crate::manifest::Manifest;

fn manifest(dataset: &str) -> Manifest {
    let text = format!(
        "[dataset]\nname = \"x\"\n{dataset}\n[train]\nfile = \"t\"\n[columns]\n\
         time = {{ column = \"t\", unit = \"s\" }}\n\
         speed = {{ column = \"v\", unit = \"m/s\" }}\n[[runs]]\nfile = \"a.csv\"\n"
    );
    Manifest::parse("dataset.toml", &text).unwrap()
}

fn table(dataset: &str, text: &str) -> Result<Table, String> {
    let manifest = manifest(dataset);
    let described = (&manifest.layout, &manifest.columns[..]);
    Table::parse("a.csv", text, described).map_err(|error| error.to_string())
}

fn speeds(dataset: &str, text: &str) -> Vec<Option<f64>> {
    let table = table(dataset, text).unwrap();
    let speeds = table.column(Quantity::Speed).unwrap();
    speeds.iter().map(|&v| (!v.is_nan()).then_some(v)).collect()
}

#[test]
fn any_common_spelling_of_csv_is_read() {
    let expected = [Some(1.5), None, Some(-2.0)];
    let cases = [
        ("", "t,v\n0,1.5\n1,\n2,-2\n"),
        ("", "\u{feff}t,v\r\n0,1.5\r\n1,NaN\r\n2,-2\r\n"),
        ("", "x,t,v \n9,0, 1.5\n9,1,nan\n9,2,-2e0"),
        ("", "\"t\",\"v\"\n\"0\",\"1.5\"\n1,\"\"\n\n2,-2\n"),
        ("delimiter = \";\"", "t;v;\n0;1.5;\n1;;\n2;-2;\n"),
        ("delimiter = \"\\t\"", "t\tv\n0\t1.5\n1\tinf\n2\t-2\n"),
        ("delimiter = \";\"\ndecimal = \",\"", "t;v\n0;1,5\n1;\n2;-2\n"),
        ("decimal = \",\"", "t,v\n0,\"1,5\"\n1,\n\"2\",-2\n"),
        ("", "t,v\r0,1.5\r1,1e308\r2,-2\r"),
    ];
    for (dataset, text) in cases {
        assert_eq!(speeds(dataset, text), expected, "{text:?}");
    }
}

#[test]
fn a_missing_column_is_named_with_the_header() {
    let message = table("", "t,v_kmh,F\n0,1,2\n").unwrap_err();
    assert_eq!(
        message,
        "a.csv:1: unknown column 'v' (for speed in dataset.toml:8); did you \
         mean 'v_kmh'? (choices: 't', 'v_kmh', 'F')"
    );
    let message = table("", "t;v\n0;1\n").unwrap_err();
    assert_eq!(
        message,
        "a.csv:1: expected columns separated by ',', found ';' in the header: set delimiter = \
         \";\" in [dataset]"
    );
    let message = table("", "t\tv\n0\t1\n").unwrap_err();
    assert!(message.ends_with("set delimiter = \"\\t\" in [dataset]"), "{message}");
    let message = table("", "t,v,v\n0,1,2\n").unwrap_err();
    assert_eq!(
        message,
        "a.csv:1: column 'v' occurs 2 times in the header: give each column a name of its own there"
    );
}

#[test]
fn a_cell_that_is_no_number_is_named_with_line_and_column() {
    let message = table("", "t,v\n0,1\n1,fast\n2,1\n").unwrap_err();
    assert_eq!(message, "a.csv:3: column 'v': expected a number or an empty cell, got 'fast'");
    let message = table("delimiter = \";\"", "t;v\n0;1,5\n1;2\n").unwrap_err();
    assert_eq!(
        message,
        "a.csv:2: column 'v': expected a number or an empty cell, got '1,5'; for decimal \
         commas set decimal = \",\" in [dataset]"
    );
    let marks = "delimiter = \";\"\ndecimal = \",\"";
    let message = table(marks, "t;v\n0;1,5\n1;2.5\n").unwrap_err();
    assert!(message.ends_with("for decimal points set decimal = \".\" in [dataset]"), "{message}");
    let message = table("", "t,v\n0,1\n1,fast").unwrap_err();
    assert!(message.contains("got 'fast'"), "a word is no number that was cut off: {message}");
    let message = table("", "t,v\n0,1e\n1,2\n").unwrap_err();
    assert!(message.starts_with("a.csv:2: column 'v'"), "{message}");
    let message = table("", "t,v\n0,1\n1,2,5\n").unwrap_err();
    assert_eq!(message, "a.csv:3: 3 cells, but the header has 2 columns");
    let message = table("", "t,v\n0,1\n1,\"2\n2,3\n").unwrap_err();
    assert!(message.starts_with("a.csv:3: column 'v': expected a number"), "{message}");
    let message = table("", "t,v,x\n0,1,2\n1,\"2,3\n2,3,4\n").unwrap_err();
    assert!(message.starts_with("a.csv:3: a quoted cell runs over"), "{message}");
}

#[test]
fn decimal_commas_without_quotes_are_distinguished_from_delimiters() {
    let message = table("", "t,v\n0,\"1,5\"\n").unwrap_err();
    assert!(message.ends_with("for decimal commas set decimal = \",\" in [dataset]"), "{message}");
    let message = table("decimal = \",\"", "t,v\n0,1,5\n").unwrap_err();
    let hint = "where commas separate the cells, numbers with decimal commas need quotes";
    assert_eq!(message, format!("a.csv:2: 3 cells, but the header has 2 columns; {hint}"));
}

#[test]
fn a_file_that_breaks_off_in_its_last_line_loses_that_line_only() {
    for end in ["2", "2,", "2,-", "2,1e"] {
        let table = table("", &format!("t,v,x\n0,1,5\n1,1,5\n{end}")).unwrap();
        let lines = LineCounts { rows: 2, truncated: true, ..LineCounts::default() };
        assert_eq!(table.lines, lines, "{end:?}");
        assert_eq!(table.column(Quantity::Time).unwrap(), [0.0, 1.0]);
    }
}

#[test]
fn a_short_row_elsewhere_has_missing_cells() {
    let table = table("", "t,v\n0,1\n1\n2,1\n").unwrap();
    assert_eq!(table.lines, LineCounts { rows: 3, short: 1, ..LineCounts::default() });
    assert!(table.column(Quantity::Speed).unwrap()[1].is_nan());
}

#[test]
fn a_file_without_rows_is_refused() {
    assert_eq!(
        table("", "").unwrap_err(),
        "a.csv: expected a header line with the columns' names, found an empty file"
    );
    let no_rows = "a.csv: expected rows of values below the header, found none";
    assert_eq!(table("", "t,v\n").unwrap_err(), no_rows);
    assert_eq!(table("", "t,v\n0").unwrap_err(), no_rows);
}

#[test]
fn lines_above_the_names_and_units_below_them_are_passed_over() {
    let expected = [Some(1.5), None, Some(-2.0)];
    let rows = "0,1.5\n1,\n2,-2\n";
    let cases = [
        ("skip_rows = 2", format!("Logger \"7\nMessung,\"Süd\nt,v\n{rows}")),
        ("skip_rows = 1\nunits_row = true", format!("\u{feff}Logger\r\nt,v\r\ns,m/s\r\n{rows}")),
        ("skip_rows = 1", format!("Logger\rt,v\r{}", rows.replace('\n', "\r"))),
        ("units_row = true", format!("t,v\n,1\n{rows}")),
    ];
    for (dataset, text) in cases {
        assert_eq!(speeds(dataset, &text), expected, "{text:?}");
    }
    let refused = |dataset: &str, text: &str| table(dataset, text).unwrap_err();
    assert_eq!(
        refused("skip_rows = 9", "t,v\n0,1\n1,2"),
        "a.csv: skip_rows = 9: expected lines above the names, but the file has 3 lines"
    );
    assert_eq!(
        refused("skip_rows = 1", "Logger\r\nt,v\r\n0,1\r\n\r\n1,x\r\n2,1\r\n"),
        "a.csv:5: column 'v': expected a number or an empty cell, got 'x'"
    );
    let message = refused("skip_rows = 1", "t,v\n0,1\n1,2\n");
    assert_eq!(
        message,
        "a.csv:2: unknown column 't' (for time in dataset.toml:7; the names stand in line 1: set \
         skip_rows = 0 in [dataset]) (choices: '0', '1')"
    );
    assert_eq!(
        refused("units_row = true", "t,v\n0,1\n1,2\n"),
        "a.csv:2: units_row = true: expected units below the names, found the number 0 in column 't'"
    );
    assert_eq!(
        refused("skip_rows = 1", "Logger\nt,v\ns,m/s\n0,1\n"),
        "a.csv:3: column 't': expected a number or an empty cell, got 's'; for a line of units below \
         the names set units_row = true in [dataset]"
    );
    assert_eq!(
        refused("skip_rows = 1", "Logger\nt,v\n0,1\n1,x\n2,1\n"),
        "a.csv:4: column 'v': expected a number or an empty cell, got 'x'"
    );
}

/// Returns the times of a file in a format, and its first day.
fn times(format: &str, text: &str) -> Result<(Vec<f64>, Option<i64>), String> {
    let mut manifest = manifest("delimiter = \";\"\ndecimal = \",\"");
    manifest.columns[0].format = TimeFormat::from_name(format);
    let described = (&manifest.layout, &manifest.columns[..]);
    let table = Table::parse("a.csv", text, described).map_err(|error| error.to_string())?;
    let times = table.column(Quantity::Time).unwrap_or_default().to_vec();
    Ok((times, table.first_day))
}

#[test]
fn times_of_loggers_are_read_and_bad_ones_named() {
    let text = "t;v\n23:59:59,5;1,5\n00:00:00,5;2\n00:00:01;\n";
    assert_eq!(times("clock", text), Ok((vec![86_399.5, 86_400.5, 86_401.0], None)));
    let text = "t;v\n18.03.2026 07:13:20,2;1,5\n18.03.2026 07:13:20,4;2\n";
    assert_eq!(times("%d.%m.%Y %H:%M:%S", text), Ok((vec![26_000.2, 26_000.4], Some(20_530))));
    assert_eq!(
        times("clock", "t;v\n07:13:20;1\n07:99:20;1\n07:13:22;1\n").unwrap_err(),
        "a.csv:3: column 't': expected a time as 07:13:20.2 (format = \"clock\"), got '07:99:20'"
    );
    assert_eq!(
        times("clock", "t;v\n0,2;1\n0,4;1\n").unwrap_err(),
        "a.csv:2: column 't': expected a time as 07:13:20.2 (format = \"clock\"), got '0,2', a plain \
         number; for those set unit = \"s\" (or s, ms, us, ns, min, h, d, 100ns) in place of format"
    );
    assert_eq!(
        times("iso", "t;v\n18.03.2026 07:13:20;1\n").unwrap_err(),
        "a.csv:2: column 't': expected a time as 2026-03-18T07:13:20.2 (format = \"iso\"), got \
         '18.03.2026 07:13:20'; for such times set format = \"%d.%m.%Y %H:%M:%S\""
    );
    assert_eq!(
        table("", "t,v\n07:13:20.2,1\n07:13:20.4,2\n").unwrap_err(),
        "a.csv:2: column 't': expected a number or an empty cell, got '07:13:20.2'; for such times set \
         format = \"clock\" in place of unit"
    );
}

#[test]
fn words_for_missing_numbers_marks_of_thousands_and_footers_are_read() {
    let missing =
        ["n/a", "#N/A", "NULL", "None", "<NA>", "1.#QNAN", "-", "#DIV/0!", "null", "NaN", "#NV"];
    for word in missing {
        assert_eq!(speeds("", &format!("t,v\n0,1\n1,{word}\n2,3\n")), [Some(1.0), None, Some(3.0)]);
    }
    for (dataset, cell) in [
        ("delimiter = \";\"\ndecimal = \",\"\nthousands = \".\"", "1.755,5"),
        ("delimiter = \";\"\nthousands = \",\"", "1,755.5"),
        ("delimiter = \";\"\nthousands = \"'\"", "1'755.5"),
        ("delimiter = \";\"\ndecimal = \",\"\nthousands = \" \"", "1 755,5"),
    ] {
        assert_eq!(speeds(dataset, &format!("t;v\n0;{cell}\n")), [Some(1755.5)], "{cell}");
    }
    let wrong = table("delimiter = \";\"\nthousands = \",\"", "t;v\n0;1,75\n").unwrap_err();
    assert!(wrong.contains("expected a number"), "{wrong}");
    let hint = table("delimiter = \";\"", "t;v\n0;1\n1;1'755.5\n").unwrap_err();
    assert!(hint.contains("set thousands = \"'\""), "{hint}");
    for footer in ["End of file\n", "t,v\n2,2\n", "\0\0\0\0", "\x1a", "-- end, of\n"] {
        let read = speeds("", &format!("t,v\n0,1\n1,2\n{footer}"));
        assert_eq!(read[..2], [Some(1.0), Some(2.0)], "{footer:?}");
    }
    let text = table("", "t,v\n0,1\nabc,2\n2,3\n").unwrap_err();
    assert!(text.contains("a.csv:3: column 't'") && text.contains("'abc'"), "{text}");
}
