//! Guesses of names and units as other people's loggers write them.

use super::*;

/// What a file of time, speed and these columns holds, one value a row for each.
fn guess_of(names: &[&str], row: impl Fn(f64) -> Vec<f64>) -> Result<Guess, String> {
    let rows = (0..40).map(|second| {
        let time = f64::from(second);
        let cells = [time, 0.3 * time].into_iter().chain(row(time)).map(|cell| cell.to_string());
        cells.collect::<Vec<_>>().join(";") + "\n"
    });
    let text = format!("time [s];speed [m/s];{}\n{}", names.join(";"), rows.collect::<String>());
    guess(&[Recording { label: "a.csv", text: &text }], &[]).map_err(|error| error.to_string())
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
