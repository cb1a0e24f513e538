//! Files as loggers write them: other encodings, lines above the names, units below them, times that are not numbers
//! and pass midnight.

use std::fmt::Write as _;
use std::fs::{read_to_string, write};

use dynocar::dataset::load;
use dynocar_shared::SampleField;
use dynocar_tests::process::DaemonSite;

use super::commands::{done, dynocar, said};

/// Seconds from midnight at which the run begins: it ends on the next day.
const START_S: u32 = 86_400 - 200;

/// Returns a run with traction, coasting and braking as a German logger writes it; `times` writes its clock.
fn logged(times: impl Fn(u32) -> String) -> Vec<u8> {
    let mut text = String::from(
        "Fahrtenschreiber;XY 7;;\nTriebzug;Süd 4711;;\n\n\
         Zeit;Geschwindigkeit;Zugkraft;Außentemperatur\n;km/h;kN;°C\n",
    );
    let mut speed_mps = 0.0_f64;
    for second in 0..600 {
        let force_kn = match second {
            0..60 => 60.0,
            60..500 => 0.0,
            _ if speed_mps > 1.0 => -30.0,
            _ => 0.0,
        };
        let row = format!("{};{:.2};{force_kn:.1};-3.5", times(START_S + second), speed_mps * 3.6);
        writeln!(text, "{}", row.replace('.', ",").replace("~", ".")).unwrap();
        let w0 = 1.0 + 0.02 * speed_mps + 0.0004 * speed_mps * speed_mps;
        speed_mps = (speed_mps + (force_kn - 0.981 * w0) / 105.0).max(0.0);
    }
    // Text as Windows writes it: one byte for each of these letters.
    let byte = |letter: char| u8::try_from(u32::from(letter)).expect("a letter of Latin-1");
    text.chars().map(byte).collect()
}

fn clock(second: u32) -> String {
    let second = second % 86_400;
    format!("{:02}:{:02}:{:02}.0", second / 3600, second / 60 % 60, second % 60)
}

fn dated(second: u32) -> String {
    format!("{:02}~03~2026 {}", 18 + second / 86_400, clock(second))
}

#[test]
fn a_german_loggers_file_that_passes_midnight_is_described_and_read() {
    let site = DaemonSite::new();
    write(site.path().join("a.csv"), logged(clock)).unwrap();
    let shown = done(&site, &["init", "zug", "--mass-t", "100", "--csv", "a.csv"]);
    for words in
        ["letters are windows-1252", "the names stand in line 4", "units stand in the line below"]
    {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let path = site.path().join("zug/dataset.toml");
    let text = read_to_string(&path).unwrap();
    for line in [
        "encoding = \"windows-1252\"",
        "units_row = true",
        "time = { column = \"Zeit\", format = \"clock\" }",
        "speed = { column = \"Geschwindigkeit\", unit = \"km/h\" }",
        "ambient_temperature = { column = \"Außentemperatur\", unit = \"degC\" }",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    write(&path, text.replace("# date = 2026-03-18 ", "date = 2026-03-18 ")).unwrap();
    let dataset = load(&site.path().join("zug")).unwrap();
    let run = &dataset.runs[0];
    assert_eq!((run.samples.len(), run.quality.refused_in_all()), (600, 0));
    assert_eq!((run.quality.start_s, run.quality.duration_s), (f64::from(START_S), 599.0));
    assert_eq!(run.samples[0].get(SampleField::AmbientTemperature), Some(-3.5));
    let checked = done(&site, &["check", "zug"]);
    assert!(checked.contains("2026-03-18 23:56:40"), "{checked}");
    assert!(checked.contains("km/h is the top speed"), "{checked}");
    assert!(checked.contains("'Zeit' as times like 07:13:20.2"), "{checked}");
    let identified = done(&site, &["identify", "zug", "--estimator", "v_mils"]);
    assert!(identified.contains(" km/h ") && !identified.contains(" m/s "), "{identified}");
}

#[test]
fn times_with_a_date_give_the_day_of_answers_and_reports() {
    let site = DaemonSite::new();
    write(site.path().join("a.csv"), logged(dated)).unwrap();
    write(site.path().join("b.csv"), logged(dated)).unwrap();
    done(&site, &["init", "zug", "--mass-t", "100", "--csv", "a.csv", "b.csv"]);
    let text = read_to_string(site.path().join("zug/dataset.toml")).unwrap();
    assert!(text.contains("format = \"%d.%m.%Y %H:%M:%S\"") && !text.contains("date ="), "{text}");
    done(&site, &["check", "zug", "--json", "check.json"]);
    let answer = read_to_string(site.path().join("check.json")).unwrap();
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["dataset"]["runs"][0]["recorded"], "2026-03-18T23:56:40Z");
    done(&site, &["explain", "zug", "--report", "report.html"]);
    let report = read_to_string(site.path().join("report.html")).unwrap();
    assert!(report.contains("Recorded (UTC)") && report.contains("2026-03-18 23:56:40"));
}

#[test]
fn a_wrong_description_of_a_loggers_file_is_named_with_line_and_what_helps() {
    let site = DaemonSite::new();
    write(site.path().join("a.csv"), logged(clock)).unwrap();
    done(&site, &["init", "zug", "--mass-t", "100", "--csv", "a.csv"]);
    let path = site.path().join("zug/dataset.toml");
    let text = read_to_string(&path).unwrap();
    let cases = [
        ("encoding = \"windows-1252\"", "encoding = \"win-1252\"", "unknown encoding 'win-1252'"),
        (
            "encoding = \"windows-1252\"\n",
            "",
            "a.csv:2: not UTF-8: save the file as UTF-8, or set its",
        ),
        (
            "skip_rows = 3",
            "skip_rows = 2000",
            "skip_rows = 2000: expected lines above the names, but the",
        ),
        ("skip_rows = 3", "skip_rows = 0", "stand in line 4: set skip_rows = 3"),
        (
            "units_row = true",
            "units_row = false",
            "a.csv:5: column 'Geschwindigkeit': expected a number",
        ),
        (
            "format = \"clock\"",
            "format = \"iso\"",
            "a.csv:6: column 'Zeit': expected a time as 2026",
        ),
        ("format = \"clock\"", "unit = \"s\"", "set format = \"clock\" in place of unit"),
    ];
    for (from, to, words) in cases {
        let wrong = text.replace(from, to);
        assert_ne!(wrong, text, "{from}");
        write(&path, wrong).unwrap();
        let output = dynocar(&site, &["check", "zug"]);
        let message = said(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(words), "{words}: {message}");
    }
}
