//! Guesses of names and units as other people's loggers write them.

use super::*;

/// Returns the guess for a file of time, speed and these columns, one value a row for each.
fn guess_of(names: &[&str], row: impl Fn(f64) -> Vec<f64>) -> Result<Guess, String> {
    let rows = (0..40).map(|second| {
        let time = f64::from(second);
        let cells = [time, 0.3 * time].into_iter().chain(row(time)).map(|cell| cell.to_string());
        cells.collect::<Vec<_>>().join(";") + "\n"
    });
    let text = format!("time [s];speed [m/s];{}\n{}", names.join(";"), rows.collect::<String>());
    guess(&[RecordingText { label: "a.csv", text: &text }], &[], GivenMarks::default())
        .map_err(|error| error.to_string())
}

#[test]
fn columns_that_only_a_number_distinguishes_add_up_and_are_doubted() {
    let cases: [(&[&str], Quantity); 10] = [
        (&["Zugkraft Lok 1 [kN]", "Zugkraft Lok 2 [kN]"], TractionForce),
        (&["brake force bogie 1 [kN]", "brake force bogie 2 [kN]"], BrakeForce),
        (&["TE loco 1 [kN]", "TE loco 2 [kN]", "TE loco 3 [kN]"], TractionForce),
        (
            &["Effort de traction motrice avant (kN)", "Effort de traction motrice arrière (kN)"],
            TractionForce,
        ),
        (&["effort_freinage_1_kN", "effort_freinage_2_kN"], BrakeForce),
        (&["Bremskraft Drehgestell 1 in kN", "Bremskraft Drehgestell 2 in kN"], BrakeForce),
        (&["traction power 1 [kW]", "traction power 2 [kW]"], TractionPower),
        (&["traction_force_front_n", "traction_force_rear_n"], TractionForce),
        (&["forza di trazione A [kN]", "forza di trazione B [kN]"], TractionForce),
        (&["TE1 [kN]", "TE2 [kN]", "TE3 [kN]", "TE4 [kN]"], TractionForce),
    ];
    for (names, quantity) in cases {
        let guess = guess_of(names, |time| vec![2.0 * time; names.len()]).unwrap();
        let column = guess.column(quantity).unwrap_or_else(|| panic!("{names:?}: {guess:#?}"));
        assert_eq!(column.name.text, names[0]);
        let parts: Vec<&str> = column.parts.iter().map(|part| &part.text[..]).collect();
        assert_eq!(parts, names[1..], "{names:?}");
        assert!(column.doubts.iter().any(|it| it.contains("parts that add up")), "{column:?}");
        assert!(guess.unmapped.is_empty(), "{:?}", guess.unmapped);
    }
}

#[test]
fn what_does_not_add_up_is_one_column_and_another_that_differs_is_a_doubt() {
    let guess = guess_of(&["speed axle 1 [km/h]"], |time| vec![time]).unwrap();
    assert!(guess.columns.iter().all(|it| it.parts.is_empty()));
    let names = ["tractive effort [kN]", "traction effort measured [kN]"];
    let alike = guess_of(&names, |time| vec![time, time]).unwrap();
    assert!(alike.column(TractionForce).unwrap().doubts.is_empty());
    let apart = guess_of(&names, |time| vec![time, 1.3 * time]).unwrap();
    let doubts = apart.column(TractionForce).unwrap().doubts.join(" ");
    assert!(doubts.contains("could be it as well"), "{doubts}");
}

#[test]
fn what_was_requested_or_possible_is_not_what_acted_in_any_language() {
    for wanted in [
        "requested tractive effort [kN]",
        "available tractive effort [kN]",
        "permitted traction force [kN]",
        "Zugkraft möglich [kN]",
        "Vorgabe Zugkraft [kN]",
        "Zugkraftanforderung [kN]",
        "verfügbare Zugkraft [kN]",
        "effort de traction demandé [kN]",
        "effort de traction disponible [kN]",
        "force de traction prévue [kN]",
        "esfuerzo de traccion solicitado [kN]",
        "fuerza de traccion disponible [kN]",
        "sforzo di trazione richiesto [kN]",
        "forza di trazione massima [kN]",
        "begärd dragkraft [kN]",
        "gevraagde trekkracht [kN]",
        "planned traction force [kN]",
    ] {
        let guess = guess_of(&[wanted, "TE [kN]"], |time| vec![9.0 * time, 8.0 * time]).unwrap();
        assert_eq!(guess.column(TractionForce).unwrap().name.text, "TE [kN]", "{wanted}");
    }
}

#[test]
fn numbers_in_the_place_of_missing_values_say_nothing_of_the_unit() {
    let gradient = |time: f64| if time % 20.0 == 7.0 { 9999.0 } else { (time % 9.0) - 4.0 };
    let guess = guess_of(&["gradient_permille"], |time| vec![gradient(time)]).unwrap();
    let column = guess.column(Gradient).unwrap();
    assert_eq!((column.scale, column.unit.name(), &column.doubts[..]), (1.0, "permille", &[][..]));
}

#[test]
fn units_are_read_as_loggers_write_them() {
    let cases = [
        ("traction power [hp]", TractionPower, "hp"),
        ("traction power [PS]", TractionPower, "PS"),
        ("traction force [kp]", TractionForce, "kp"),
        ("tractive effort (klbf)", TractionForce, "klbf"),
        ("tractive effort [kips]", TractionForce, "klbf"),
        ("tractive_effort_newtons", TractionForce, "N"),
        ("history.pwr_whl_out_watts", TractionPower, "W"),
        ("history.mass_static_kilograms", TrainMass, "kg"),
        ("slope [deg]", Gradient, "deg"),
        ("slope [rad]", Gradient, "rad"),
        ("grade_percent", Gradient, "%"),
        ("brake cylinder pressure [psi]", BrakeCylinderPressure, "psi"),
        ("brake cylinder pressure [kgf/cm²]", BrakeCylinderPressure, "kgf/cm2"),
        ("distance_meters", Position, "m"),
        ("altitude (feet)", Altitude, "ft"),
        ("acceleration [km/h/s]", Acceleration, "km/h/s"),
        ("Сила тяги [кН]", TractionForce, "kN"),
    ];
    for (name, quantity, unit) in cases {
        let guess = guess_of(&[name], |time| vec![0.02 * time]).unwrap();
        let column = guess.column(quantity).unwrap_or_else(|| panic!("{name}: {guess:#?}"));
        assert_eq!((column.unit.name(), column.is_unit_open), (unit, false), "{name}");
    }
    let text = "history.time_seconds,history.speed_meters_per_second\n0,1\n1,2\n2,3\n";
    let guess = guessed(text);
    assert_eq!(guess.column(Speed).unwrap().unit.name(), "m/s");
    for (name, unit) in [("speed_kilometers_per_hour", "km/h"), ("ground speed [knots]", "kn")] {
        let guess = guessed(&format!("time_seconds,{name}\n0,1\n1,2\n2,3\n"));
        assert_eq!(guess.column(Speed).unwrap().unit.name(), unit);
    }
}

#[test]
fn an_unknown_unit_is_an_error_that_names_it() {
    for (name, unit) in [
        ("traction power [pood]", "pood"),
        ("traction force [sn]", "sn"),
        ("brake force (kN/axle²)", "kN/axle²"),
    ] {
        let message = guess_of(&[name], |time| vec![time]).unwrap_err();
        assert!(message.contains(&format!("there is no unit '{unit}'")), "{message}");
        assert!(message.contains("--column"), "{message}");
    }
    // Notes are no units.
    assert!(guess_of(&["traction force [kN] (front)"], |time| vec![time]).is_ok());
    assert!(guess_of(&["Zugkraft [Lok 1]"], |time| vec![time]).is_ok());
}

#[test]
fn the_position_is_that_which_the_speed_spans_and_its_direction_that_of_most_steps() {
    let text = |rows: &dyn Fn(f64) -> (f64, f64)| {
        let row = |second: u32| {
            let (one, other) = rows(f64::from(second));
            format!("{second},20,{one},{other}\n")
        };
        let rows: String = (0..300).map(row).collect();
        format!("time [s],speed [m/s],distance [m],odometer [m]\n{rows}")
    };
    let guess = guessed(&text(&|time| (1.5 * time, 20.0 * time)));
    assert_eq!(guess.column(Position).unwrap().name.text, "odometer [m]");
    let guess = guessed(&text(&|time| (20.0 * time, 1e6 * time)));
    assert_eq!(guess.column(Position).unwrap().name.text, "distance [m]");
    let falling = |time: f64| if time < 60.0 { 0.0 } else { 40_000.0 - 20.0 * time };
    let guess = guessed(&text(&|time| (falling(time), falling(time))));
    assert_eq!(guess.runs[0].direction, -1);
}

/// Returns the guess for the practice file of [`file`] with another first column, and its times.
fn times_of(cells: impl Fn(f64) -> String) -> (Guess, Vec<i64>) {
    let rows = (0..900).map(|row| {
        let time = 0.2 * f64::from(row);
        format!("{};{:.3};{}\n", cells(time), 0.05 * time, 300.0 - time)
    });
    let text = format!("Timestamp;speed [m/s];traction force [kN]\n{}", rows.collect::<String>());
    let guess = guess(&[RecordingText { label: "a.csv", text: &text }], &[], GivenMarks::default())
        .unwrap();
    let time = guess.column(Time).unwrap();
    let how = match &time.format {
        Some(format) => format!("format='{}'", format.name()),
        None => format!("unit='{}',scale={:?}", time.unit.name(), time.scale),
    };
    let manifest = format!(
        "[dataset]\nname='x'\ndelimiter=';'\n[train]\nfile='t'\n[columns]\ntime={{column='Timestamp',{how}}}\n\
         speed={{column='speed [m/s]',unit='m/s'}}\n[[runs]]\nfile='a.csv'\n"
    );
    let train =
        "[train]\nmass_t=100\nlength_m=50\nrotating_mass_factor=0\n[resistance]\na=1\nb=0\nc=0\n";
    let files = [("dataset.toml", &manifest[..]), ("t", train), ("a.csv", &text)];
    let dataset = crate::Dataset::load(&files[..]).unwrap();
    let first_ns = dataset.runs[0].samples[0].time_ns;
    (guess, dataset.runs[0].samples.iter().map(|it| it.time_ns - first_ns).collect())
}

#[test]
fn times_are_read_as_they_were_recorded() {
    let clock = |time: f64, from_s: f64| {
        let ms = ((from_s + time) * 1000.0).round() as u64;
        [ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000]
    };
    let with =
        |form: fn([u64; 4]) -> String, from_s: f64| move |time: f64| form(clock(time, from_s));
    type Written = Box<dyn Fn(f64) -> String>;
    let cases: [(&str, Written); 11] = [
        (
            "AM",
            Box::new(with(
                |[h, m, s, ms]| format!("3/18/2026 {h}:{m:02}:{s:02}.{ms:03} AM"),
                26_000.0,
            )),
        ),
        ("ms", Box::new(with(|[h, m, s, ms]| format!("{h:02}:{m:02}:{s:02}:{ms:03}"), 26_000.0))),
        ("mm:ss", Box::new(with(|[_, m, s, ms]| format!("{m:02}:{s:02}.{}", ms / 100), 3500.0))),
        (
            "UTC",
            Box::new(with(
                |[h, m, s, ms]| format!("2026-03-18 {h:02}:{m:02}:{s:02}.{ms:03} UTC"),
                26_000.0,
            )),
        ),
        (
            "+0100",
            Box::new(with(
                |[h, m, s, ms]| format!("2026-03-18 {h:02}:{m:02}:{s:02}.{ms:03} +0100"),
                26_000.0,
            )),
        ),
        (
            "days",
            Box::new(with(|[h, m, s, ms]| format!("0 days {h:02}:{m:02}:{s:02}.{ms:03}000"), 10.0)),
        ),
        (
            "packed",
            Box::new(with(|[h, m, s, ms]| format!("{h:02}{m:02}{s:02}.{:02}", ms / 10), 34_400.0)),
        ),
        (
            "stamp",
            Box::new(with(|[h, m, s, ms]| format!("20260318{h:02}{m:02}{s:02}.{ms:03}"), 26_000.0)),
        ),
        ("Excel", Box::new(|time| format!("{:.9}", 46_099.301 + time / 86_400.0))),
        (
            "ticks",
            Box::new(|time| {
                format!("{}", 638_000_000_000_000_000_u64 + (time * 1e7).round() as u64)
            }),
        ),
        ("whole", Box::new(with(|[h, m, s, _]| format!("{h:02}:{m:02}:{s:02}"), 26_000.0))),
    ];
    for (name, cells) in cases {
        let (guess, times_ns) = times_of(cells);
        let time = guess.column(Time).unwrap();
        let worst = times_ns
            .iter()
            .enumerate()
            .map(|(row, ns)| (ns - 200_000_000 * row as i64).abs())
            .max();
        assert!(worst.unwrap() < 200_000, "{name}: {worst:?} {time:?} {:?}", &times_ns[..12]);
    }
}

#[test]
fn the_mass_of_a_train_is_known_in_other_languages_and_no_part_of_it_is_taken_for_it() {
    let mapped = |name: &str| {
        let guess = guess_of(&[name], |_| vec![182.0]).unwrap();
        guess.column(TrainMass).is_some()
    };
    for whole in [
        "Masa del tren (t)",
        "Masa total [t]",
        "Massa del treno [t]",
        "Masa pociągu [t]",
        "Hmotnost vlaku [t]",
        "Масса поезда (т)",
        "列车质量 (t)",
        "总重(t)",
        "Bruttomasse [t]",
        "masse totale [t]",
    ] {
        assert!(mapped(whole), "{whole}");
    }
    for part in [
        "mass of locomotive [t]",
        "Masse locomotive [t]",
        "Wagenzugmasse [t]",
        "tare mass [t]",
        "braked weight [t]",
        "Masa własna [t]",
        "Massa a vuoto [t]",
        "自重(t)",
    ] {
        assert!(!mapped(part), "{part}");
    }
}

#[test]
fn a_chainage_of_km_and_m_and_a_share_of_the_effort_are_named_with_the_remedy() {
    let text = "t [s];v [m/s];Chainage;Tractive effort [%]\n".to_owned()
        + &(0..40).map(|k| format!("{k};{k};1+{:03};50\n", 10 * k)).collect::<String>();
    let recordings = [RecordingText { label: "a.csv", text: &text }];
    let guess = guess(&recordings, &[], GivenMarks::default()).unwrap();
    let why = format!("{:?}", guess.unmapped);
    assert!(why.contains("12345 for 12+345"), "{why}");
    assert!(why.contains("map a share of the effort as traction_handle"), "{why}");
}
