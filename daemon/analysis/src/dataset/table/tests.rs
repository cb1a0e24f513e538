//! CSV files as they come, and every refusal with its words.

use super::*;

fn manifest(dataset: &str) -> Manifest {
    let text = format!(
        "[dataset]\nname = \"x\"\n{dataset}\n[train]\nfile = \"t\"\n[columns]\n\
         time = {{ column = \"t\", unit = \"s\" }}\n\
         speed = {{ column = \"v\", unit = \"m/s\" }}\n[[runs]]\nfile = \"a.csv\"\n"
    );
    Manifest::parse("dataset.toml", &text).unwrap()
}

fn table(dataset: &str, text: &str) -> Result<Table, String> {
    Table::parse("a.csv", text, &manifest(dataset)).map_err(|error| error.to_string())
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
    assert_eq!(message, "a.csv:1: column 'v' occurs 2 times in the header");
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
fn decimal_commas_without_quotes_are_told_apart_from_delimiters() {
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
        let lines = LineCounts { rows: 2, short: 0, truncated: true };
        assert_eq!(table.lines, lines, "{end:?}");
        assert_eq!(table.column(Quantity::Time).unwrap(), [0.0, 1.0]);
    }
}

#[test]
fn a_short_row_elsewhere_has_missing_cells() {
    let table = table("", "t,v\n0,1\n1\n2,1\n").unwrap();
    assert_eq!(table.lines, LineCounts { rows: 3, short: 1, truncated: false });
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
