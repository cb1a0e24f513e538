//! Times as loggers write them.

use super::*;

fn read(format: &str, cells: &[&str]) -> (Option<i64>, Vec<Option<f64>>) {
    let mut clock = DayClock::new(&TimeFormat::from_name(format).expect("a format"));
    let seconds = cells.iter().map(|cell| clock.seconds(cell.as_bytes())).collect();
    (clock.first_day(), seconds)
}

#[test]
fn dates_count_from_the_midnight_before_the_first_row() {
    let cells = ["2026-03-18T07:13:20.25", "2026-03-18 07:13:21,5", "2026-03-19T00:00:01"];
    let (day, seconds) = read("iso", &cells);
    assert_eq!(day, Some(20_530));
    assert_eq!(seconds, [Some(26_000.25), Some(26_001.5), Some(86_401.0)]);
    let (day, seconds) = read("iso", &["2026-03-18T00:30:00+01:00", "2026-03-17T23:30:01Z"]);
    assert_eq!((day, seconds), (Some(20_529), vec![Some(84_600.0), Some(84_601.0)]));
    let (day, seconds) = read("%d.%m.%Y %H:%M:%S", &["18.03.2026 07:13:20,25"]);
    assert_eq!((day, seconds), (Some(20_530), vec![Some(26_000.25)]));
    let (day, seconds) = read("%m/%d/%Y %I:%M:%S %p", &["03/18/2026 07:13:20 PM"]);
    assert_eq!((day, seconds), (Some(20_530), vec![Some(69_200.0)]));
    assert_eq!(read("%d.%m.%y %H:%M:%S", &["18.03.26 07:13:20"]).0, Some(20_530));
    let expected = (Some(20_530), vec![Some(69_200.25)]);
    for (format, cell) in [
        ("%-m/%-d/%Y %-I:%M:%S %p", "3/18/2026 7:13:20.250 PM"),
        ("%-m/%-d/%Y %-I:%M:%S %p", "3/18/2026 7:13:20.25 p.m."),
        ("iso", "2026-03-18 19:13:20.250 UTC"),
        ("iso", "2026-03-18 20:13:20.250 +0100"),
        ("iso", "2026-03-18 20:13:20.250 CET"),
        ("%d-%b-%Y %H:%M:%S", "18-Mar-2026 19:13:20.250"),
        ("%Y%m%dT%H%M%S", "20260318T191320.250"),
        ("%Y%m%d%H%M%S", "20260318191320.25"),
        ("%Y%m%d%H%M%S", "20260318191320250"),
    ] {
        assert_eq!(read(format, &[cell]), expected, "{cell}");
    }
}

#[test]
fn clocks_without_a_date_are_read_as_loggers_write_them() {
    let seconds = |format: &str, cell: &str| read(format, &[cell]).1[0];
    assert_eq!(seconds("clock", "07:13:20:250"), Some(26_000.25));
    assert_eq!(seconds("clock", "07:13:20:25"), None, "25 may be frames");
    assert_eq!(seconds("%-I:%M:%S %p", "7:13:20 AM"), Some(26_000.0));
    assert_eq!(seconds("%-I:%M:%S %p", "12:00:01 am"), Some(1.0));
    assert_eq!(seconds("%H%M%S", "71320.25"), Some(26_000.25));
    assert_eq!(seconds("%H%M%S", "071320"), Some(26_000.0));
    assert_eq!(seconds("elapsed", "0 days 07:13:20.250000"), Some(26_000.25));
    assert_eq!(seconds("elapsed", "1 day, 7:13:20"), Some(112_400.0));
    assert_eq!(seconds("elapsed", "31:13:20"), Some(112_400.0));
    let (_, turned) = read("%M:%S", &["59:59.5", "00:00.5", "00:01.0"]);
    assert_eq!(turned, [Some(3599.5), Some(3600.5), Some(3601.0)]);
}

#[test]
fn clock_times_pass_midnight_and_rows_out_of_order_do_not() {
    let cells = ["23:59:59.5", "0:00:00,5", "23:59:59.9", "", "00:00:01"];
    let expected = [Some(86_399.5), Some(86_400.5), Some(86_399.9), None, Some(86_401.0)];
    assert_eq!(read("clock", &cells), (None, expected.to_vec()));
}

#[test]
fn what_is_no_time_is_none() {
    for cell in ["", "x", "2026-03-18", "2026-02-30T00:00:00", "2026-03-18T25:00:00", "07:13:20"] {
        assert_eq!(read("iso", &[cell]).1, [None], "{cell}");
    }
    for cell in ["24:00:00", "07:60:00", "07:13:20.2x", "7", "07:13:20+1"] {
        assert_eq!(read("clock", &[cell]).1, [None], "{cell}");
    }
    for name in ["", "utc", "%H:%M:%Q", "%d.%m. %H:%M:%S", "%d.%m.%Y", "%"] {
        assert_eq!(TimeFormat::from_name(name), None, "{name}");
    }
}

#[test]
fn a_format_is_recognised_by_its_cells() {
    let first =
        |cell: &str| TimeFormat::of_cell(cell.as_bytes()).first().map(|it| it.name().to_owned());
    let cases = [
        ("2026-03-18T07:13:20.2", Some("iso")),
        ("2026-03-18 07:13:20", Some("iso")),
        ("7:13:20", Some("clock")),
        ("18.03.2026 07:13:20,2", Some("%d.%m.%Y %H:%M:%S")),
        ("8.3.2026 7:13:20", Some("%-d.%-m.%Y %-H:%M:%S")),
        ("03/18/2026 07:13:20", Some("%m/%d/%Y %H:%M:%S")),
        ("3/18/2026 7:13:20 AM", Some("%-m/%-d/%Y %-I:%M:%S %p")),
        ("7:13:20 AM", Some("%-I:%M:%S %p")),
        ("07:13:20:250", Some("clock")),
        ("13:20.5", Some("%-M:%S")),
        ("0 days 00:00:00.200000", Some("elapsed")),
        ("18-Mar-2026 07:13:20.000", Some("%d-%b-%Y %H:%M:%S")),
        ("20260318T071320.200", Some("%Y%m%dT%H%M%S")),
        ("3.5", None),
        ("12:5", None),
    ];
    for (cell, expected) in cases {
        assert_eq!(first(cell).as_deref(), expected, "{cell}");
    }
}

#[test]
fn a_date_of_a_file_is_a_second_since_1970() {
    let at = |text: &str| unix_s(&text.parse().expect("a TOML date"));
    assert_eq!(at("2026-03-18"), Some(20_530 * 86_400));
    assert_eq!(at("2026-03-18T07:13:20"), Some(20_530 * 86_400 + 26_000));
    assert_eq!(at("2026-03-18T07:13:20+01:00"), Some(20_530 * 86_400 + 22_400));
    assert_eq!(at("07:13:20"), None);
}
