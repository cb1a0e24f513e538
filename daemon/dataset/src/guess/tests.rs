//! Guesses of whole files.

use super::*;

mod others;
use crate::TimeFormat;
use Quantity::*;

/// Returns a run that pulls, coasts and brakes, as rows of time, position, speed, traction and brake force
/// in SI units.
fn run() -> Vec<[f64; 5]> {
    let (mut speed, mut position) = (0.0_f64, 1000.0);
    let mut rows = Vec::new();
    for second in 0..600 {
        let (traction, brake) = match second {
            0..60 => (60e3, 0.0),
            60..500 => (0.0, 0.0),
            _ if speed > 1.0 => (0.0, 30e3),
            _ => (0.0, 0.0),
        };
        rows.push([f64::from(second), position, speed, traction, brake]);
        let drag = 0.981e3 * (1.0 + 0.02 * speed + 0.0004 * speed * speed);
        speed = (speed + (traction - brake - drag) / 105e3).max(0.0);
        position += speed;
    }
    rows
}

/// Returns a file: a header and, for each row, a cell for each column.
fn file(header: &str, cells: impl Fn(&[f64; 5]) -> Vec<String>) -> String {
    let delimiter = if header.contains(';') { ";" } else { "," };
    let rows = run();
    let rows = rows.iter().map(|row| cells(row).join(delimiter) + "\n");
    format!("{header}\n{}", rows.collect::<String>())
}

fn guessed(text: &str) -> Guess {
    guess(&[RecordingText { label: "a.csv", text }], &[], GivenMarks::default()).unwrap()
}

fn refusal(text: &str) -> String {
    guess(&[RecordingText { label: "a.csv", text }], &[], GivenMarks::default())
        .unwrap_err()
        .to_string()
}

/// Returns the mapping of each quantity: column, unit and factor.
fn mapped(guess: &Guess) -> Vec<(Quantity, &str, &str, f64)> {
    let columns = guess.columns.iter();
    columns.map(|it| (it.quantity, it.name.text.as_str(), it.unit.name(), it.scale)).collect()
}

/// Returns the quantity assigned to a header of one name, besides time and speed.
fn taken_for(name: &str, values: [f64; 3]) -> Option<(Quantity, &'static str)> {
    let [one, two, three] = values;
    let text = format!("time [s],{name},speed [m/s]\n0,{one},0\n1,{two},1\n2,{three},2\n");
    let guess = guessed(&text);
    let column = guess.columns.iter().find(|column| column.name.text == name.trim());
    column.map(|column| (column.quantity, column.unit.name()))
}

#[test]
fn headers_of_many_styles_are_understood() {
    let ramp = |top: f64| [0.0, top / 2.0, top];
    let cases = [
        ("F_trac [kN]", ramp(300.0), TractionForce, "kN"),
        ("traction effort", ramp(300.0), TractionForce, "kN"),
        ("Zugkraft in kN", ramp(300.0), TractionForce, "kN"),
        ("tractive_effort_n", ramp(3e5), TractionForce, "N"),
        ("tractionForce", ramp(3e5), TractionForce, "N"),
        ("te", ramp(250.0), TractionForce, "kN"),
        ("Bremskraft / kN", ramp(300.0), BrakeForce, "kN"),
        ("braking_kn", ramp(300.0), BrakeForce, "kN"),
        ("be", ramp(300.0), BrakeForce, "kN"),
        ("brake_cylinder_pressure_bar", ramp(3.8), BrakeCylinderPressure, "bar"),
        ("BC pressure [kPa]", ramp(380.0), BrakeCylinderPressure, "kPa"),
        ("p_c", ramp(3.8), BrakeCylinderPressure, "bar"),
        ("Bremszylinderdruck", ramp(3.8), BrakeCylinderPressure, "bar"),
        ("Außentemperatur [°C]", [12.0, 12.5, 12.5], AmbientTemperature, "degC"),
        ("T_amb_C", [12.0, 12.5, 12.5], AmbientTemperature, "degC"),
        ("oat", [285.0, 286.0, 285.0], AmbientTemperature, "K"),
        ("Neigung[‰]", [3.0, -5.0, 12.0], Gradient, "permille"),
        ("slope_percent", [0.3, -0.5, 1.2], Gradient, "%"),
        ("Streckenkilometer", [10.1, 20.0, 30.0], Position, "km"),
        ("Chainage [m]", [0.0, 5.0, 12.0], Position, "m"),
        ("PK", [10e3, 20e3, 35e3], Position, "m"),
        ("Altitude (m)", [430.0, 431.0, 432.0], Altitude, "m"),
        ("lat", [47.1, 47.2, 47.3], Latitude, "deg"),
        ("GPS_Lon", [8.1, 8.2, 8.3], Longitude, "deg"),
        ("gross mass t", [114.0, 114.0, 114.0], TrainMass, "t"),
        ("pax", [10.0, 20.0, 20.0], Passengers, "1"),
        ("wheelSlip", [0.0, 1.0, 0.0], WheelSlide, "1"),
        ("wind_speed", [3.0, 2.0, 4.0], WindSpeed, "m/s"),
        ("rel_humidity_%", [60.0, 62.0, 63.0], RelativeHumidity, "%"),
        ("acceleration [m/s²]", [0.1, -0.2, 0.5], Acceleration, "m/s2"),
        ("traction power kW", ramp(4000.0), TractionPower, "kW"),
        ("tractoin_force", ramp(300e3), TractionForce, "N"),
    ];
    for (name, values, quantity, unit) in cases {
        assert_eq!(taken_for(name, values), Some((quantity, unit)), "{name}");
    }
}

#[test]
fn times_and_speeds_of_many_styles_are_understood() {
    let cases = [
        ("t;v", "s", "m/s", 1.0, 1.0),
        ("time_s;speed_kmh", "s", "km/h", 1.0, 3.6),
        ("timestamp;v_ist", "ms", "m/s", 1e3, 1.0),
        ("Zeit [s];Geschwindigkeit", "s", "km/h", 1.0, 3.6),
        ("Time (ms);Velocity (km/h)", "ms", "km/h", 1e3, 3.6),
        ("t_ms;v [m/s]", "ms", "m/s", 1e3, 1.0),
        ("T / s;V / km/h", "s", "km/h", 1.0, 3.6),
        ("zeitstempel_us;vitesse_kmh", "us", "km/h", 1e6, 3.6),
        ("Elapsed;Fahrgeschwindigkeit [km/h]", "s", "km/h", 1.0, 3.6),
        ("TIME;GPS speed mph", "s", "mph", 1.0, 1.0 / 0.44704),
        ("t;speeed", "s", "m/s", 1.0, 1.0),
        ("t;V1 [km/h]", "s", "km/h", 1.0, 3.6),
    ];
    for (header, time, speed, per_s, per_mps) in cases {
        let text = file(header, |row| {
            vec![format!("{}", 100.0 * per_s + row[0] * per_s), format!("{:.3}", row[2] * per_mps)]
        });
        let guess = guessed(&text);
        let unit = |quantity| guess.column(quantity).map(|it| it.unit.name());
        assert_eq!((unit(Time), unit(Speed)), (Some(time), Some(speed)), "{header}");
    }
}

#[test]
fn a_decimal_comma_and_a_semicolon_are_seen() {
    let comma = |value: f64| format!("{value:.2}").replace('.', ",");
    let text = file("Zeit [s];v [km/h];Zugkraft [kN]", |row| {
        vec![comma(row[0]), comma(row[2] * 3.6), comma(row[3] / 1e3)]
    });
    let guess = guessed(&text);
    assert_eq!((guess.layout.delimiter, guess.layout.decimal), (b';', b','));
    let expected = [
        (Time, "Zeit [s]", "s", 1.0),
        (Speed, "v [km/h]", "km/h", 1.0),
        (TractionForce, "Zugkraft [kN]", "kN", 1.0),
    ];
    assert_eq!(mapped(&guess), expected);
    assert!(guess.columns.iter().all(|column| column.doubts.is_empty()), "{guess:#?}");
    assert_eq!(guess.runs[0].rows, 600);
}

#[test]
fn what_was_wanted_and_other_things_are_not_taken_for_what_was_measured() {
    for name in [
        "v_soll",
        "speed limit",
        "speed_setpoint",
        "Sollgeschwindigkeit [km/h]",
        "motor temperature",
        "Motortemperatur [°C]",
        "engine speed [rpm]",
        "brake pipe pressure [bar]",
        "traction current [A]",
        "brake disc temperature",
        "speed_valid",
        "row",
        "",
        "F_id",
        "battery voltage [V]",
    ] {
        assert_eq!(taken_for(name, [1.0, 2.0, 3.0]), None, "{name}");
    }
    let text =
        file("t,v_soll,v_ist", |row| vec![row[0].to_string(), "30".into(), row[2].to_string()]);
    let guess = guessed(&text);
    assert_eq!(guess.column(Speed).unwrap().name.text, "v_ist");
    assert!(guess.unmapped[0].reason.contains("'soll' names what was wanted"), "{guess:?}");
    let rejected = guess.column(Speed).unwrap().rejected.join("; ");
    assert!(rejected.contains("'v_soll'"), "{rejected}");
}

#[test]
fn of_two_columns_that_say_the_same_one_is_taken_and_the_other_reported() {
    let text = file("t,speed_kmh,speed_gps_kmh", |row| {
        let speed = format!("{}", row[2] * 3.6);
        vec![row[0].to_string(), speed.clone(), speed]
    });
    let guess = guessed(&text);
    assert_eq!(guess.column(Speed).unwrap().name.text, "speed_kmh");
    assert_eq!(guess.unmapped[0].reason, "could be speed, for which 'speed_kmh' is taken");
    assert!(guess.column(Speed).unwrap().rejected[0].contains("'speed_gps_kmh' could be it"));
}

#[test]
fn a_force_of_both_signs_is_traction_minus_brake() {
    let text = file("t,v,F", |row| {
        vec![row[0].to_string(), row[2].to_string(), ((row[3] - row[4]) / 1e3).to_string()]
    });
    assert!(mapped(&guessed(&text)).contains(&(ControlForce, "F", "kN", 1.0)));
    let text = file("t,v,traction [kN]", |row| {
        vec![row[0].to_string(), row[2].to_string(), ((row[3] - row[4]) / 1e3).to_string()]
    });
    let guess = guessed(&text);
    let control = guess.column(ControlForce).unwrap();
    assert!(control.doubts[0].contains("both signs"), "{control:?}");
    let text = file("t,v,F", |row| {
        vec![row[0].to_string(), row[2].to_string(), (row[3] / 1e3).to_string()]
    });
    assert!(guessed(&text).column(TractionForce).unwrap().doubts[0].contains("one sign"));
}

#[test]
fn a_pressure_that_may_be_another_one_is_doubted() {
    let text =
        file("t,v,p [bar]", |row| [row[0], row[2], row[4] / 1e4].map(|it| it.to_string()).to_vec());
    let guess = guessed(&text);
    let pressure = guess.column(BrakeCylinderPressure).unwrap();
    assert_eq!(pressure.doubts, ["little speaks for it but 'p' in the name"]);
}

#[test]
fn a_negative_brake_force_is_turned() {
    let text = file("t,v,F_trac_kN,F_brake_kN", |row| {
        let brake = -row[4] / 1e3;
        vec![row[0].to_string(), row[2].to_string(), (row[3] / 1e3).to_string(), brake.to_string()]
    });
    let guess = guessed(&text);
    assert!(mapped(&guess).contains(&(BrakeForce, "F_brake_kN", "kN", -1.0)), "{guess:?}");
    assert!(mapped(&guess).contains(&(TractionForce, "F_trac_kN", "kN", 1.0)));
}

#[test]
fn a_signed_force_next_to_single_ones_and_handles_next_to_forces_are_left_out() {
    let text = file("t,v,traction_kN,brake_kN,force_kN,throttle", |row| {
        let (traction, brake) = (row[3] / 1e3, row[4] / 1e3);
        let cells = [row[0], row[2], traction, brake, traction - brake, traction / 300.0];
        cells.map(|cell| cell.to_string()).to_vec()
    });
    let guess = guessed(&text);
    let quantities: Vec<Quantity> = guess.columns.iter().map(|it| it.quantity).collect();
    assert_eq!(quantities, [Time, Speed, TractionForce, BrakeForce]);
    assert!(guess.unmapped[0].reason.contains("traction_force is recorded"), "{guess:?}");
    assert!(guess.unmapped[1].reason.contains("the force itself"), "{guess:?}");
}

#[test]
fn a_falling_position_is_a_run_backwards() {
    let up = file("t,s [m],v", |row| [row[0], row[1], row[2]].map(|it| it.to_string()).to_vec());
    let down =
        file("t,s [m],v", |row| [row[0], 9e4 - row[1], row[2]].map(|it| it.to_string()).to_vec());
    let files = [
        RecordingText { label: "a.csv", text: &up },
        RecordingText { label: "b.csv", text: &down },
    ];
    let guess = guess(&files, &[], GivenMarks::default()).unwrap();
    let directions: Vec<i8> = guess.runs.iter().map(|run| run.direction).collect();
    assert_eq!(directions, [1, -1]);
}

#[test]
fn a_column_that_another_file_lacks_or_fills_with_words_is_left_out() {
    let one = file("t,v,pax", |row| [row[0], row[2], 50.0].map(|it| it.to_string()).to_vec());
    let two = file("v,t", |row| [row[2], row[0]].map(|it| it.to_string()).to_vec());
    let three = one.replacen("\n100,", "\n100,0.0,many\n100,", 1);
    let of = |other: &str| {
        let files = [
            RecordingText { label: "a.csv", text: &one },
            RecordingText { label: "b.csv", text: other },
        ];
        guess(&files, &[], GivenMarks::default()).unwrap()
    };
    assert_eq!(of(&two).unmapped[0].reason, "b.csv has no such column");
    let reason = &of(&three).unmapped[0].reason;
    assert!(reason.contains("it holds text in b.csv, line 102: 'many'"), "{reason}");
    assert!(of(&two).column(Speed).is_some());
    let unit = |unit: &str| one.replacen("pax", &format!("force [{unit}]"), 1);
    let files = [("a.csv", unit("kN")), ("b.csv", unit("N"))];
    let files = files.each_ref().map(|(label, text)| RecordingText { label, text });
    let guess = guess(&files, &[], GivenMarks::default()).unwrap();
    assert_eq!(
        guess.unmapped[0].reason,
        "b.csv has it in N, not in kN: write one unit in all files"
    );
}

#[test]
fn files_of_another_layout_are_refused() {
    let one = file("t,v", |row| [row[0], row[2]].map(|it| it.to_string()).to_vec());
    let two = file("t;v", |row| [row[0], row[2]].map(|it| it.to_string()).to_vec());
    let files = [
        RecordingText { label: "a.csv", text: &one },
        RecordingText { label: "b.csv", text: &two },
    ];
    let message = guess(&files, &[], GivenMarks::default()).unwrap_err().to_string();
    assert!(message.starts_with("b.csv: the delimiter is \";\", but \",\" in a.csv"), "{message}");
}

#[test]
fn what_lacks_time_or_speed_is_refused_with_what_comes_near() {
    let message = refusal("t,F\n0,1\n1,2\n");
    assert_eq!(
        message,
        "a.csv:1: no column was recognised as speed; the columns: 't', 'F'; say which it is: \
         --column speed=COLUMN:UNIT"
    );
    let message = refusal("timestamp,v\n2024-05-01 10:00,1\n2024-05-01 10:01,2\n");
    assert!(
        message.contains("time ('timestamp': it holds text in line 2: '2024-05-01 10:00')"),
        "{message}"
    );
    let message = refusal("t,v\n3,1\n2,2\n1,2\n");
    assert!(message.contains("'t': its values do not grow"), "{message}");
    let message = refusal("t,v,v\n0,1,1\n1,2,2\n");
    assert!(message.contains("no column was recognised as speed"), "{message}");
}

#[test]
fn what_is_reported_is_taken_for_granted() {
    let text = file("A,B,v", |row| [row[0], row[2] * 3.6, 7.0].map(|it| it.to_string()).to_vec());
    let kmh = dynocar_model::units::Unit::find(Speed.dimension(), "km/h");
    let given = |quantity, column: &str, unit| GivenColumn {
        quantity,
        column: column.into(),
        unit,
        format: None,
    };
    let files = [RecordingText { label: "a.csv", text: &text }];
    let all = [given(Time, "A", None), given(Speed, "B", kmh)];
    let guessed = guess(&files, &all, GivenMarks::default()).unwrap();
    assert_eq!(mapped(&guessed), [(Time, "A", "s", 1.0), (Speed, "B", "km/h", 1.0)]);
    let refused = |given: GivenColumn| {
        guess(&files, &[given], GivenMarks::default()).unwrap_err().to_string()
    };
    let message = refused(given(Time, "C", None));
    assert_eq!(message, "a.csv:1: no column 'C' for time; the columns: 'A', 'B', 'v'");
    let message = refused(given(Time, "v", None));
    assert!(message.contains("column 'v' cannot be time: its values do not grow"), "{message}");
    let message = refused(given(Speed, "B:kmh", None));
    assert!(
        message.starts_with("a.csv:1: unknown unit 'kmh' for speed; did you mean"),
        "{message}"
    );
    let twice = [given(Speed, "B", kmh), given(Speed, "v", None)];
    let message = guess(&files, &twice, GivenMarks::default()).unwrap_err().to_string();
    assert_eq!(message, "a.csv: speed is given twice: as column 'B' and as 'v'");
}

#[test]
fn a_row_of_totals_leaves_times_times() {
    let mut text = file("Zeit,v", |row| {
        let [minute, second] = [row[0] / 60.0, row[0] % 60.0].map(f64::floor);
        vec![format!("07:{:02}:{second:02}", minute % 60.0), row[2].to_string()]
    });
    text += "Summe,900\n";
    let time = guessed(&text).column(Time).cloned().unwrap();
    assert_eq!(time.format, Some(TimeFormat::Clock));
}

#[test]
fn a_loggers_preamble_units_and_clock_times_are_described() {
    let text = "Logger;XY 7;;;\nZug;ET 4711;;;\nDatum;Uhrzeit;Geschwindigkeit;Zugkraft;Bemerkung\n\
                ;hh:mm:ss;km/h;kN;\n\
                18.03.2026;23:59:59,0;10,5;60;\n18.03.2026;23:59:59,5;11,5;60;x\n\
                19.03.2026;00:00:00,0;12,5;60;\n19.03.2026;00:00:00,5;13,5;60;\n";
    let guess =
        guess(&[RecordingText { label: "a.csv", text }], &[], GivenMarks::default()).unwrap();
    assert_eq!((guess.layout.delimiter, guess.layout.decimal), (b';', b','));
    assert_eq!((guess.layout.skip_rows, guess.layout.units_row), (2, true));
    let time = guess.column(Quantity::Time).unwrap();
    assert_eq!((&time.name.text[..], time.format.as_ref()), ("Uhrzeit", Some(&TimeFormat::Clock)));
    assert!(time.doubts.is_empty(), "{:?}", time.doubts);
    let speed = guess.column(Quantity::Speed).unwrap();
    assert_eq!((speed.unit.name(), speed.is_unit_open), ("km/h", false));
    assert_eq!(guess.column(Quantity::TractionForce).unwrap().unit.name(), "kN");
    assert_eq!(guess.runs[0].day, Some(20_530));
    assert_eq!(guess.runs[0].rows, 4);
}

#[test]
fn dates_are_recognised_by_their_cells_and_doubtful_where_day_and_month_could_be_exchanged() {
    let read = |times: [&str; 3]| {
        let row = |(k, time): (usize, &str)| format!("{time};{}\n", 10 + k);
        let rows: String = times.into_iter().enumerate().map(row).collect();
        let text = format!("Zeitpunkt;v [km/h]\n{rows}");
        let guess =
            guess(&[RecordingText { label: "a.csv", text: &text }], &[], GivenMarks::default())
                .unwrap();
        let time = guess.column(Quantity::Time).unwrap().clone();
        (time.format.unwrap().name().to_owned(), time.doubts.join(" "), guess.runs[0].day)
    };
    let iso = ["2026-03-18T07:13:20.2", "2026-03-18T07:13:20.4", "2026-03-18T07:13:20.6"];
    assert_eq!(read(iso), ("iso".into(), String::new(), None));
    let german = ["18.03.2026 07:13:20", "18.03.2026 07:13:21", "18.03.2026 07:13:22"];
    assert_eq!(read(german), ("%d.%m.%Y %H:%M:%S".into(), String::new(), None));
    let american = ["03/18/2026 07:13:20", "03/18/2026 07:13:21", "03/18/2026 07:13:22"];
    assert_eq!(read(american).0, "%m/%d/%Y %H:%M:%S");
    let either = ["03/04/2026 07:13:20", "03/04/2026 07:13:21", "03/04/2026 07:13:22"];
    let (format, doubts, _) = read(either);
    assert_eq!(format, "%d/%m/%Y %H:%M:%S");
    assert_eq!(doubts, "they could be %m/%d/%Y %H:%M:%S, too");
}
