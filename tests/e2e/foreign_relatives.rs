//! Further forms of other people's files: names, units, times and cells that few tools write.

use crate::foreign_files::{NAMES, ROWS, assert_as_plain, described, plain, table, values};

/// The plain table with one column under another name, its values times a factor.
fn renamed(column: usize, name: &str, factor: f64) -> String {
    let mut names = NAMES.to_vec();
    names[column] = name;
    table(&names, ";", |row, at| {
        let factor = if at == column { factor } else { 1.0 };
        (values(row)[at] * factor).to_string()
    })
}

#[test]
fn forces_speeds_and_gradients_in_rare_units_are_read_in_them() {
    const POUND_FORCE_N: f64 = 4.4482216152605;
    for (column, name, factor) in [
        (2, "Geschwindigkeit in Kilometern pro Stunde", 3.6),
        (2, "vitesse (kilomètres par heure)", 3.6),
        (2, "velocidad [kilómetros por hora]", 3.6),
        (2, "speed [dm/s]", 10.0),
        (2, "speed_kmh_1", 3.6),
        (2, "speed_kmh\\CAN1:1", 3.6),
        (2, "sebesség [km/h]", 3.6),
        (2, "속도 [km/h]", 3.6),
        (3, "tractive effort [US tonf]", 1.0 / (2000.0 * POUND_FORCE_N)),
        (3, "F_trac_kilopounds", 1.0 / (1000.0 * POUND_FORCE_N)),
        (3, "tractive effort [metric tons-force]", 1.0 / 9806.65),
        (3, "vonóerő [kN]", 1e-3),
        (3, "cer kuvveti [kN]", 1e-3),
        (3, "牽引力 [kN]", 1e-3),
        (3, "forță de tracțiune [kN]", 1e-3),
        (5, "gradient [ft/mi]", 5.28),
        (5, "gradient_feet_per_mile", 5.28),
        (5, "slope [gon]", 0.2 / std::f64::consts::PI),
        (5, "gradient [N/kN]", 1.0),
        (5, "gradient [°/oo]", 1.0),
    ] {
        let text = renamed(column, name, factor);
        let said = assert_as_plain(name, &[("a.csv", text.as_bytes())], &[], 1e-9);
        assert!(!said.contains("doubtful"), "{name}: {said}");
    }
}

#[test]
fn a_unit_in_brackets_that_is_no_unit_or_a_multiple_of_one_is_refused_with_its_name() {
    for (column, name, unit) in [
        (2, "speed [furlong/s]", "furlong/s"),
        (2, "speed [x10 km/h]", "x10 km/h"),
        (3, "tractive effort [0.1 kN]", "0.1 kN"),
        (3, "tractive effort (1000 lbf)", "1000 lbf"),
        (3, "tractive effort [kN*10]", "kN*10"),
        (5, "gradient [1:n]", "1:n"),
    ] {
        let text = renamed(column, name, 1.0);
        let message = described(&[("a.csv", text.as_bytes())], &[]).1.unwrap_err();
        assert!(message.contains(&format!("there is no unit '{unit}'")), "{name}: {message}");
    }
}

#[test]
fn the_measured_force_is_taken_beside_the_wanted_one_in_further_languages() {
    for (wanted, measured) in [
        ("TE_des_N", "TE_meas_N"),
        ("kért vonóerő [N]", "mért vonóerő [N]"),
        ("istenen cer kuvveti [N]", "cer kuvveti [N]"),
        ("目標牽引力 [N]", "牽引力 [N]"),
        ("ønsket trækkraft [N]", "trækkraft [N]"),
        ("tilgjengelig trekkraft [N]", "trekkraft [N]"),
        ("pyydetty vetovoima [N]", "vetovoima [N]"),
        ("forță de tracțiune solicitată [N]", "forță de tracțiune [N]"),
    ] {
        let names: Vec<&str> = [wanted].into_iter().chain(NAMES).collect();
        let names: Vec<&str> =
            names.into_iter().map(|it| if it == NAMES[3] { measured } else { it }).collect();
        let text = table(&names, ";", |row, at| match at {
            0 => (1.3 * values(row)[3]).to_string(),
            at => plain(row, at - 1),
        });
        assert_as_plain(wanted, &[("a.csv", text.as_bytes())], &[], 1e-9);
    }
}

#[test]
fn a_second_measurement_of_the_same_that_differs_is_a_doubt() {
    let names: Vec<&str> = NAMES.into_iter().chain(["speed_mps_1"]).collect();
    let text = table(&names, ";", |row, at| match at {
        6 => (1.2 * values(row)[2]).to_string(),
        at => plain(row, at),
    });
    let said = assert_as_plain("twice", &[("a.csv", text.as_bytes())], &[], 1e-9);
    assert!(said.contains("'speed_mps_1' could be it as well"), "{said}");
}

/// Hours, minutes and milliseconds of a row that begins at 07:13:20 on 18 March 2026.
fn clock(row: u32) -> (u32, u32, u32) {
    let ms = (7 * 3600 + 13 * 60 + 20) * 1000 + 200 * row;
    (ms / 3_600_000, ms / 60_000 % 60, ms % 60_000)
}

#[test]
fn times_in_rare_forms_are_the_same_times() {
    let marked = |row: u32, mark: &str, point: &str| {
        let (hours, minutes, ms) = clock(row);
        let (seconds, ms) = (ms / 1000, ms % 1000);
        format!("{hours:02}{mark}{minutes:02}{mark}{seconds:02}{point}{ms:03}")
    };
    type Form<'f> = &'f dyn Fn(u32) -> String;
    let forms: [(&str, Form); 15] = [
        ("digits with thousandths", &|row| format!("20260318{}", marked(row, "", ""))),
        ("year in two digits", &|row| format!("260318{}", marked(row, "", "."))),
        ("Julian day", &|row| format!("{:.10}", 2_461_117.5 + 0.2 * f64::from(row) / 86_400.0)),
        ("month in letters", &|row| format!("Mar 18, 2026 {}", marked(row, ":", "."))),
        ("month as a word", &|row| format!("18 March 2026 {}", marked(row, ":", "."))),
        ("month before", &|row| format!("March 18, 2026 {}", marked(row, ":", "."))),
        ("mail", &|row| format!("Wed, 18 Mar 2026 {} +0000", marked(row, ":", "."))),
        ("zone's name", &|row| {
            format!("2026-03-18T{}+01:00[Europe/Berlin]", marked(row, ":", "."))
        }),
        ("file names", &|row| format!("2026-03-18_{}", marked(row, "-", "."))),
        ("digits of file names", &|row| format!("20260318_{}", marked(row, "", "_"))),
        ("dots", &|row| marked(row, ".", ",")),
        ("text of a spreadsheet", &|row| format!("'{}", marked(row, ":", "."))),
        ("Chinese", &|row| format!("2026年03月18日 {}", marked(row, ":", "."))),
        ("minutes of one digit", &|row| {
            format!("{}:{:04.1}", row / 300, 0.2 * f64::from(row % 300))
        }),
        ("text that is a formula", &|row| format!("=\"{}\"", 0.2 * f64::from(row))),
    ];
    for (name, form) in forms {
        let mut names = NAMES.to_vec();
        names[0] = "time";
        let text = table(&names, ";", |row, at| if at == 0 { form(row) } else { plain(row, at) });
        let tolerance = if name == "Julian day" { 1e-4 } else { 1e-9 };
        assert_as_plain(name, &[("a.csv", text.as_bytes())], &[], tolerance);
    }
}

#[test]
fn numbers_and_lines_in_rare_forms_are_the_same_numbers() {
    let fortran = |row: u32, at: usize| format!("{:.15e}", values(row)[at]);
    let fortran = |row: u32, at: usize| {
        let text = fortran(row, at);
        if text.contains("e-") { text.replace('e', "D") } else { text.replace('e', "D+") }
    };
    let formula = |row: u32, at: usize| format!("=\"{}\"", plain(row, at));
    let minus = |row: u32, at: usize| plain(row, at).replace('-', "\u{2212}");
    for (name, text) in [
        ("Fortran", table(&NAMES, ",", fortran)),
        ("formulas", table(&NAMES, ",", formula)),
        ("typographic minus", table(&NAMES, ",", minus)),
    ] {
        assert_as_plain(name, &[("a.csv", text.as_bytes())], &[], 1e-9);
    }
    let text = table(&NAMES, ",", plain);
    let (names, rows) = text.split_once('\n').expect("names");
    for types in ["double", "float64", "DBL", "Nullable(Float64)"] {
        let text = format!("{names}\n{}\n{rows}", [types; 6].join(","));
        assert_as_plain(types, &[("a.csv", text.as_bytes())], &[], 1e-9);
    }
    assert_eq!(rows.lines().count(), ROWS as usize);
}
