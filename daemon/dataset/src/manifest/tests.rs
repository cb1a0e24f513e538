//! Contents of `dataset.toml`, and every refusal with its words.

use super::*;
use crate::cell::held;

const FULL: &str = r#"[dataset]
name = "line-01"
description = "made by hand"
position_reference = "head"
delimiter = ";"
decimal = ","
[train]
file = "train.toml"
[track]
file = "track.toml"
[columns]
time = { column = "t ", unit = "ms" }
speed = { column = "v", unit = "km/h", scale = 2.0, offset = -1.0 }
gradient = { column = "i", unit = "%" }
[[runs]]
file = "runs/01.csv"
role = "holdout"
direction = -1
mass_t = 114.5
[[runs]]
file = "runs/02.csv"
start_m = 250.0
"#;

fn refusal(text: &str) -> String {
    Manifest::parse("dataset.toml", text).unwrap_err().to_string()
}

#[test]
fn every_key_is_read() {
    let manifest = Manifest::parse("dataset.toml", FULL).unwrap();
    assert_eq!(manifest.name, "line-01");
    assert_eq!(manifest.description.as_deref(), Some("made by hand"));
    assert_eq!(manifest.position_reference, PositionReference::Head);
    assert_eq!((manifest.layout.delimiter, manifest.layout.decimal), (b';', b','));
    assert_eq!(manifest.train_file.path, "train.toml");
    let track =
        FileEntry { path: "track.toml".into(), place: SourcePosition::line("dataset.toml", 10) };
    assert_eq!(manifest.track_file, Some(track));
    let time = manifest.mapping(Quantity::Time).unwrap();
    assert_eq!((time.column.as_str(), held(time, time.converted_to().as_ref(), 200.0)), ("t", 0.2));
    let runs = &manifest.runs;
    assert_eq!((runs[0].role, runs[0].direction), (Role::Holdout, -1));
    assert_eq!((runs[0].mass_kg, runs[0].start_m), (Some(114_500.0), None));
    assert_eq!((runs[1].role, runs[1].direction), (Role::Fit, 1));
    assert_eq!((runs[1].mass_kg, runs[1].start_m), (None, Some(250.0)));
}

#[test]
fn keys_of_other_text_and_times_are_read() {
    let text = FULL
        .replace("decimal = \",\"\n", "encoding = \"cp1252\"\nskip_rows = 4\nunits_row = true\n")
        .replace("unit = \"ms\"", "format = \"clock\"")
        .replace("role = \"holdout\"", "date = 2026-03-18");
    let manifest = Manifest::parse("dataset.toml", &text).unwrap();
    let layout = manifest.layout;
    assert_eq!(layout.encoding.name(), "windows-1252");
    assert_eq!((layout.skip_rows, layout.units_row, layout.lines_above()), (4, true, 6));
    let time = manifest.mapping(Quantity::Time).unwrap();
    assert_eq!(
        (time.format.as_ref(), held(time, time.converted_to().as_ref(), 3.5)),
        (Some(&TimeFormat::Clock), 3.5)
    );
    assert_eq!(manifest.runs[0].date_unix_s, Some(20_530 * 86_400));
    assert_eq!(manifest.runs[1].date_unix_s, None);
    assert_eq!(manifest.speed_unit().name(), "km/h");
    let quoted = text.replace("date = 2026-03-18", "date = \"2026-03-18\"");
    assert_eq!(Manifest::parse("dataset.toml", &quoted).unwrap().runs[0], manifest.runs[0]);
}

#[test]
fn wrong_keys_of_other_text_and_times_are_named_with_their_choices() {
    let cases = [
        (
            ("name = \"line-01\"", "name = \"line-01\"\nencoding = \"utf-9\""),
            "dataset.toml:3: unknown encoding 'utf-9' in dataset.encoding; did you mean 'utf-8'? \
             (choices: 'utf-8', 'windows-1252', 'iso-8859-2', 'utf-16le', 'utf-16be')",
        ),
        (
            ("decimal = \",\"", "skip_rows = 1.5"),
            "dataset.toml:6: dataset.skip_rows = 1.5: expected a number of lines, 0 to 10000",
        ),
        (
            ("decimal = \",\"", "units_row = 1"),
            "dataset.toml:6: dataset.units_row: expected true or false, got 1",
        ),
        (
            ("unit = \"ms\"", "unit = \"s\", format = \"iso\""),
            "dataset.toml:12: columns.time.format and columns.time.unit exclude each other: give one \
             of them",
        ),
        (
            ("unit = \"ms\"", "format = \"hh:mm\""),
            "dataset.toml:12: columns.time.format = \"hh:mm\": expected \"iso\" \
             (2026-03-18T07:13:20.2), \"clock\" (07:13:20.2) or a pattern of strftime with the hour, \
             and with the whole date or none of it (%d.%m.%Y %H:%M:%S); a fraction of the second is \
             read in any case",
        ),
        (
            ("role = \"holdout\"", "date = 07:13:20"),
            "dataset.toml:17: runs[1].date = 07:13:20: expected a day of the calendar, as 2026-03-18 \
             or 2026-03-18T07:13:20",
        ),
        (
            ("role = \"holdout\"", "date = \"18.03.2026\""),
            "dataset.toml:17: runs[1].date: expected a date, as 2026-03-18, got the text \"18.03.2026\"",
        ),
    ];
    for ((from, to), expected) in cases {
        assert_eq!(refusal(&FULL.replace(from, to)), expected);
    }
    let dated = FULL
        .replace("unit = \"ms\"", "format = \"iso\"")
        .replace("role = \"holdout\"", "date = 2026-03-18");
    assert_eq!(
        refusal(&dated),
        "dataset.toml:17: runs[1].date and columns.time.format with a date exclude each other: give \
         one of them"
    );
}

#[test]
fn scale_and_offset_act_in_the_columns_unit() {
    let manifest = Manifest::parse("dataset.toml", FULL).unwrap();
    let speed = manifest.mapping(Quantity::Speed).unwrap();
    assert_eq!(held(speed, speed.converted_to().as_ref(), 36.5), 20.0, "36.5 * 2 - 1 = 72 km/h");
    let gradient = manifest.mapping(Quantity::Gradient).unwrap();
    assert!((held(gradient, gradient.converted_to().as_ref(), 1.2) - 12.0).abs() < 1e-12);
}

#[test]
fn the_track_and_most_keys_may_be_absent() {
    let text = "[dataset]\nname=\"x\"\n[train]\nfile=\"t\"\n[columns]\n\
                time={column=\"t\",unit=\"s\"}\nspeed={column=\"v\",unit=\"m/s\"}\n\
                [[runs]]\nfile=\"a.csv\"\n";
    let manifest = Manifest::parse("dataset.toml", text).unwrap();
    assert_eq!((manifest.track_file, manifest.description), (None, None));
    assert_eq!((manifest.layout.delimiter, manifest.layout.decimal), (b',', b'.'));
    assert_eq!(manifest.position_reference, PositionReference::Centre);
}

#[test]
fn mistakes_are_named_with_line_and_choices() {
    let cases = [
        (
            ("unit = \"km/h\"", "unit = \"kmh\""),
            "dataset.toml:13: unknown unit 'kmh' in columns.speed.unit; did you mean 'km/h'? \
             (choices: 'm/s', 'km/h', 'mph', 'kn', 'cm/s', \
             'mm/s', 'dm/s', \
             'm/min', 'ft/s')",
        ),
        (
            ("role = \"holdout\"", "role = \"test\""),
            "dataset.toml:17: unknown role 'test' in runs[1].role (choices: 'fit', 'holdout')",
        ),
        (
            ("\"head\"", "\"center\""),
            "dataset.toml:4: unknown reference 'center' in dataset.position_reference; did you \
             mean 'centre'? (choices: 'centre', 'head')",
        ),
        (
            ("start_m", "start"),
            "dataset.toml:22: unknown key 'start' in [runs[2]]; did you mean 'start_m'? \
             (choices: 'file', 'role', 'direction', 'mass_t', 'start_m', 'date')",
        ),
        (
            ("direction = -1", "direction = 2"),
            "dataset.toml:18: runs[1].direction = 2: expected 1 or -1",
        ),
        (
            ("mass_t = 114.5", "mass_t = 0"),
            "dataset.toml:19: runs[1].mass_t = 0: expected a mass in t above 0, at most 100000",
        ),
        (
            ("delimiter = \";\"", "delimiter = \"::\""),
            "dataset.toml:5: dataset.delimiter = \"::\": expected one ASCII character, as \
             \",\" \";\" or \"\\t\"",
        ),
        (
            ("delimiter = \";\"\ndecimal = \",\"", "delimiter = \".\""),
            "dataset.toml:1: dataset.decimal = \".\": expected another mark than the delimiter",
        ),
        (
            ("scale = 2.0", "scale = 0"),
            "dataset.toml:13: columns.speed.scale = 0: expected a number other than 0",
        ),
        (
            ("runs/02.csv", "runs/01.csv"),
            "dataset.toml:21: runs[2].file: runs/01.csv is listed in line 15 already",
        ),
        (
            ("runs/02.csv", "./runs//01.csv"),
            "dataset.toml:21: runs[2].file: ./runs//01.csv is listed in line 15 already",
        ),
        (
            ("{ column = \"i\", unit = \"%\" }", "{ column = \"i\" }"),
            "dataset.toml:14: missing key columns.gradient.unit: expected a unit: permille, %, 1, deg, ft/mi, \
             gon, rad, mrad",
        ),
        (
            ("gradient = { column = \"i\", unit = \"%\" }", "gradient = \"i\""),
            "dataset.toml:14: columns.gradient: expected { column = \"…\", unit = \"permille\" }, got the text \
             \"i\"",
        ),
    ];
    for ((from, to), expected) in cases {
        assert_eq!(refusal(&FULL.replacen(from, to, 1)), expected);
    }
}

#[test]
fn an_unknown_quantity_is_refused_with_the_choices() {
    let message = refusal(&FULL.replace("gradient =", "gradiant ="));
    let start = "dataset.toml:14: unknown quantity 'gradiant' in [columns]; did you mean \
                 'gradient'? (choices: 'time', 'position', 'speed',";
    assert!(message.starts_with(start), "{message}");
}

#[test]
fn time_and_speed_and_a_run_are_needed() {
    let without_speed = FULL.replace("speed = {", "wind_speed = {");
    assert!(refusal(&without_speed).starts_with("dataset.toml:11: missing key columns.speed"));
    let (head, _) = FULL.split_once("[[runs]]").unwrap();
    assert_eq!(
        refusal(head),
        "dataset.toml: missing key runs: expected at least one [[runs]] table"
    );
}

#[test]
fn a_signed_control_force_excludes_the_two() {
    let both = "control_force = { column = \"F\", unit = \"kN\" }\n\
                brake_force = { column = \"B\", unit = \"kN\" }\n[[runs]]";
    assert_eq!(
        refusal(&FULL.replacen("[[runs]]", both, 1)),
        "dataset.toml:15: columns.control_force and columns.brake_force exclude each other: \
         give one of them"
    );
}

#[test]
fn a_column_holds_one_quantity() {
    let both = "traction_force = { column = \"F\", unit = \"kN\" }\n\
                brake_force = { column = \"F\", unit = \"kN\", scale = -1 }\n[[runs]]";
    assert_eq!(
        refusal(&FULL.replacen("[[runs]]", both, 1)),
        "dataset.toml:16: column 'F' is mapped to traction_force and to brake_force: expected a column of its own for \
         each; a force that is negative while the train brakes is a control_force"
    );
}
