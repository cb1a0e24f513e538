//! Imports of whole files, each number checked.

use dynocar_shared::resistance::GRAVITY_MPS2;

use super::*;

const STOCK: &str = include_str!("../../../../tests/corpus/import/rolling_stock.yaml");
const PATH_2022: &str = include_str!("../../../../tests/corpus/import/running_path_2022.yaml");
const PATH_2024: &str = include_str!("../../../../tests/corpus/import/running_path_2024.yaml");
const TRACK: &str = include_str!("../../../../tests/corpus/import/ttobench_track.json");
const TRAIN: &str = include_str!("../../../../tests/corpus/import/ttobench_train.json");
const TRAM: &str = include_str!("../../../../tests/corpus/import/osrd_whole.json");
const EXPRESS: &str = include_str!("../../../../tests/corpus/import/osrd_each_kg.json");

fn read(text: &str) -> Imported {
    read_as(text, &ImportReading::default())
}

fn read_as(text: &str, reading: &ImportReading) -> Imported {
    let source = ImportSource { label: "file", text };
    import(&[source], None, reading).unwrap_or_else(|error| panic!("{error}"))
}

fn refusal(text: &str) -> String {
    let source = ImportSource { label: "file", text };
    import(&[source], None, &ImportReading::default()).unwrap_err().to_string()
}

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-6 * expected.abs(), "{found} for {expected}");
    }
}

fn davis(train: &ImportedTrain) -> [f64; 3] {
    let davis = train.resistance.expect("a resistance");
    [davis.a, davis.b, davis.c]
}

fn flat(list: &[(f64, f64)]) -> Vec<f64> {
    list.iter().flat_map(|&(at, value)| [at, value]).collect()
}

/// Returns the reason for which a field has no place, or a key is not known.
fn reason<'a>(account: &'a Account, name: &str) -> &'a str {
    let of = account.outcomes().iter().find_map(|outcome| match outcome {
        FieldOutcome::Left { field, why } if field == name => Some(why.as_str()),
        FieldOutcome::Unknown { key, why } if *key == name => Some(why.as_str()),
        _ => None,
    });
    of.unwrap_or_else(|| panic!("{name}: {account:?}"))
}

#[test]
fn a_formation_weighs_and_resists_as_its_vehicles_by_their_laws() {
    let trains = read(STOCK).trains;
    let ids: Vec<&str> = trains.iter().map(|it| it.id.as_str()).collect();
    assert_eq!(ids, ["ore", "express"]);
    let ore = &trains[0];
    assert_eq!(
        (ore.name.as_str(), ore.mass_kg, ore.length_m),
        ("Ore train", Some(120e3), Some(40.0))
    );
    assert_eq!(ore.cars, Some(3));
    assert_close(&[ore.rotating_mass_factor.unwrap()], &[130.0 / 120.0 - 1.0]);
    // Worked by hand in ‰ times t: 3 · 60 + 1.5 · 20, 9 · 80 · 0.15², 1.4 · 40; and so on.
    assert_close(&davis(ore), &[282.2 / 120.0, 0.0648, 0.009504]);
    let effort = [0.0, 200e3, 10.0, 180e3, 30.0, 60e3];
    assert_close(&flat(ore.traction.as_ref().unwrap()), &effort);
    assert_close(&davis(&trains[1]), &[309.44 / 120.0, 0.08616, 0.0093312]);
    assert!(
        reason(&ore.account, "vehicles.load_limit").contains("--load 1 adds all of 120.0000 t")
    );
    assert_eq!(reason(&ore.account, "vehicles.a_braking"), "not understood");
    assert_eq!(reason(&trains[1].account, "trains.UUID"), "train.toml holds no identifier");
}

#[test]
fn a_load_weighs_on_the_wagons_and_not_on_the_locomotive() {
    let reading = ImportReading { load_share: 0.5, ..ImportReading::default() };
    let ore = &read_as(STOCK, &reading).trains[0];
    assert_eq!(ore.mass_kg, Some(180e3));
    assert_close(&davis(ore), &[366.2 / 180.0, 7.776 / 180.0, 0.008064]);
    assert_close(&[ore.rotating_mass_factor.unwrap()], &[130.0 / 120.0 - 1.0]);
    let express = &read_as(STOCK, &reading).trains[1];
    assert_eq!(
        reason(&express.account, "vehicles.load_limit"),
        "no vehicle has one: none is added"
    );
}

#[test]
fn what_a_vehicle_lacks_is_reported_and_not_made_up() {
    let without = |line: &str| {
        let text = STOCK.replace(line, "");
        assert_ne!(text, STOCK, "{line}");
        read(&text).trains[0].clone()
    };
    let train = without("    air_resistance: 4.0\n");
    assert_eq!(train.resistance, None);
    let why = "'hopper' has no air_resistance, which its law needs";
    assert_eq!(reason(&train.account, "a, b, c"), why);
    let train = without("    rotation_mass: 1.1\n");
    assert_eq!(train.rotating_mass_factor, None);
    assert!(reason(&train.account, "rotating_mass_factor").contains("'shunter'"));
    let train = without("    mass_traction: 60   # t\n");
    assert_eq!(
        reason(&train.account, "a, b, c"),
        "'shunter' has no mass_traction, which its law needs"
    );
}

#[test]
fn vehicles_may_stand_in_another_file_than_their_train() {
    let (head, vehicles) = STOCK.split_once("vehicles:").unwrap();
    let schema = head.split_once("trains:").unwrap().0;
    let stock = format!("{schema}vehicles:{vehicles}");
    let sources =
        [ImportSource { label: "a", text: head }, ImportSource { label: "b", text: &stock }];
    let both = import(&sources, None, &ImportReading::default()).unwrap();
    assert_eq!(davis(&both.trains[0]), davis(&read(STOCK).trains[0]));
    let words =
        "file:9: trains[1].formation[1]: the vehicle 'shunter' is described in none of the files";
    assert!(refusal(head).starts_with(words), "{}", refusal(head));
    let alone = read(&stock).trains;
    assert_eq!(alone.len(), 3);
    assert!(reason(&alone[0].account, "trains").contains("each vehicle counts as a train"));
}

#[test]
fn paths_of_both_schemas_give_gradient_and_permitted_speed() {
    let line = &read(PATH_2022).lines[0];
    assert_eq!((line.id.as_str(), line.name.as_str()), ("hill", "Over the hill"));
    assert_eq!(line.length_m, 3500.0);
    let gradient = [1000.0, 0.0, 1800.0, 12.5, 3000.0, -8.0];
    assert_eq!(flat(line.gradient.as_ref().unwrap()), gradient);
    let permitted = [1000.0, 20.0, 3000.0, 30.0];
    assert_close(&flat(line.permitted_speed.as_ref().unwrap()), &permitted);
    assert!(reason(&line.account, "paths.points_of_interest").contains("no stops"));
    assert!(reason(&line.account, "curves").contains("with the gradient"));
    let lines = read(PATH_2024).lines;
    assert_eq!(flat(lines[0].gradient.as_ref().unwrap()), [400.0, 5.0, 900.0, -2.5]);
    assert_close(&flat(lines[0].permitted_speed.as_ref().unwrap()), &[0.0, 20.0, 900.0, 10.0]);
    let printed = format!("{:?}", lines[0].account.outcomes());
    assert!(printed.contains("the file gives it from 400 m on"), "{printed}");
    assert_eq!((lines[1].name.as_str(), &lines[1].gradient), ("back", &None));
    assert_eq!(reason(&lines[1].account, "gradient"), "no section has a resistance");
}

#[test]
fn a_ttobench_track_keeps_its_lists_and_the_mean_curvature_of_transitions() {
    let line = &read(TRACK).lines[0];
    assert_eq!((line.name.as_str(), line.length_m), ("XX_Here_There", 6000.0));
    assert_close(&flat(line.gradient.as_ref().unwrap())[1..], &[4.0, 1500.0, -6.67]);
    assert_close(&flat(line.permitted_speed.as_ref().unwrap())[1..], &[20.0, 1000.0, 30.0]);
    let stops: Vec<f64> = line.stops.iter().map(|stop| stop.0).collect();
    assert_eq!(stops, [0.0, 2500.0, 6000.0]);
    let curves = line.curves.as_ref().unwrap();
    let radii: Vec<f64> = curves.iter().map(|it| it.radius_m).collect();
    let tenths = [1.0, 3.0, 5.0, 7.0, 9.0].map(|tenth| 5000.0 / tenth);
    assert_close(&radii, &[&tenths[..], &[500.0]].concat());
    assert_eq!((curves[0].start_m, curves[5].start_m, curves[5].end_m), (400.0, 500.0, 800.0));
    let turned = |it: &dynocar_model::track::TrackCurve| (it.end_m - it.start_m) / it.radius_m;
    assert_close(&[curves.iter().map(turned).sum()], &[100.0 / 1000.0 + 300.0 / 500.0]);
    let bare = TRACK.replace("curvatures", "curviness");
    let account = &read(&bare).lines[0].account;
    assert!(reason(account, "curves").contains("real ones leave them out"));
    assert_eq!(reason(account, "curviness"), "not understood");
}

#[test]
fn a_ttobench_train_is_read_by_its_units() {
    let train = &read(TRAIN).trains[0];
    assert_eq!((train.mass_kg, train.cars, train.length_m), (Some(150e3), Some(4), None));
    assert_close(&[train.rotating_mass_factor.unwrap()], &[0.08]);
    let weight_kn = 150.0 * GRAVITY_MPS2;
    assert_close(&davis(train), &[2200.0 / weight_kn, 36.0 / weight_kn, 6.48 / weight_kn]);
    let effort = train.traction.as_ref().unwrap();
    assert_close(&flat(&effort[..2]), &[0.0, 180e3, 40.0 / 3.0, 180e3]);
    assert_close(&flat(&effort[effort.len() - 1..]), &[40.0, 60e3]);
    let is_power = |pair: &[(f64, f64)]| {
        let (speed, force) = (0.5 * (pair[0].0 + pair[1].0), 0.5 * (pair[0].1 + pair[1].1));
        (1.0..1.004).contains(&(speed * force / 2.4e6))
    };
    assert!(effort[1..].windows(2).all(is_power), "{effort:?}");
    let metric =
        TRAIN.replace("\"unit\": \"t\", \"value\": 150", "\"unit\": \"kg\", \"value\": 150000");
    assert_eq!(davis(&read(&metric).trains[0]), davis(train));
    assert!(reason(&train.account, "max reg braking force").contains("[brake] by hand"));
    assert_eq!(reason(&train.account, "length_m"), "the format has none");
}

#[test]
fn davis_coefficients_are_reported_by_their_size() {
    let tram = &read(TRAM).trains[0];
    let weight_kn = 80.0 * GRAVITY_MPS2;
    assert_close(&davis(tram), &[1200.0 / weight_kn, 90.0 / weight_kn, 1.4 / weight_kn]);
    assert_close(&[tram.rotating_mass_factor.unwrap(), tram.length_m.unwrap()], &[0.05, 42.0]);
    let printed = format!("{:?}", tram.account.outcomes());
    assert!(printed.contains("for the whole train: 3.24 N/kN at 12.5 m/s"), "{printed}");
    assert_eq!(reason(&tram.account, "hoverboards"), "not understood");
    let express = &read(EXPRESS).trains[0];
    let each = |value: f64| 1000.0 * value / GRAVITY_MPS2;
    assert_close(&davis(express), &[each(0.008), each(0.0003), each(0.000015)]);
    let printed = format!("{:?}", express.account.outcomes());
    assert!(printed.contains("for each kg: 4.49 N/kN at 40.0 m/s"), "{printed}");
    assert_eq!(reason(&express.account, "rotating_mass_factor"), "no inertia_coefficient");
    assert_eq!(reason(&express.account, "effort"), "no effort_curves");
    let between =
        refusal(&TRAM.replace("1200.0, \"B\": 90.0, \"C\": 1.4", "50.0, \"B\": 0, \"C\": 0"));
    assert!(
        between.starts_with("file:10: rolling_resistance: 6.371e-2 N/kN at 12.5 m/s if"),
        "{between}"
    );
}

#[test]
fn another_mode_of_traction_is_taken_when_it_is_wanted() {
    let effort = |mode: Option<&str>| {
        let reading = ImportReading { mode: mode.map(Into::into), ..ImportReading::default() };
        let source = [ImportSource { label: "file", text: TRAM }];
        import(&source, None, &reading).map(|it| flat(it.trains[0].traction.as_ref().unwrap()))
    };
    assert_eq!(effort(None).unwrap(), [0.0, 90e3, 10.0, 60e3, 25.0, 24e3]);
    assert_eq!(effort(Some("1500V")).unwrap(), [0.0, 100e3, 25.0, 40e3]);
    let words = effort(Some("steam")).unwrap_err().to_string();
    assert!(words.contains("unknown mode 'steam'") && words.contains("'1500V'"), "{words}");
}

#[test]
fn bad_input_is_refused_with_file_line_and_place() {
    let stock = |from: &str, to: &str| STOCK.replacen(from, to, 1);
    let cases = [
        (
            stock("mass: 80 ", "mass: .nan "),
            "file:20: vehicles[1].mass = NaN: expected a mass in t",
        ),
        (
            stock("mass: 80 ", "mass: 80000 "),
            "file:20: vehicles[1].mass = 80000: expected a mass in t",
        ),
        (stock("mass: 80 ", "mass: heavy "), "file:20: vehicles[1].mass: expected a mass in t"),
        (
            stock("length: 15.0 ", "height: 15.0 "),
            "missing key vehicles[1].length: expected a length",
        ),
        (
            stock("[36.0, 180000]", "[0.0, 180000]"),
            "vehicles[1].tractive_effort entry 2: expected a speed",
        ),
        (
            stock("traction unit", "tram"),
            "file:17: unknown type of vehicle 'tram' in vehicles[1].vehicle_type",
        ),
        (
            stock("\"2022.05\"", "\"2031.01\""),
            "file:5: schema_version = 2031.01: expected 2022.05 or",
        ),
        (
            stock("rolling-stock.json", "timetable.json"),
            "file:4: schema = https://railtoolkit.org/schema/ti",
        ),
        (stock("id: express", "id: ore"), "trains[2].id = 'ore': expected another than in line 7"),
        (STOCK[..700].to_string(), "file:"),
        (
            PATH_2022.replace("1800.0,  72,", "1800.0,   0,"),
            "characteristic_sections[2][2] = 0: expected",
        ),
        (PATH_2022.replace("1800.0", "900.0"), "expected a position above the one before (1000 m)"),
        (
            PATH_2024.replace("        resistance: 5.0\n", ""),
            "[2].speed: expected a speed in km/h, or",
        ),
        (TRACK.replace("permil", "perlin"), "unknown unit 'perlin' in gradients.units.slope"),
        (TRACK.replace("-500.0", "-5.0"), "expected a radius of 10 m or more"),
        (
            TRAIN.replace("kN/(km/h)^2", "kN/(m/s)"),
            "unknown unit 'kN/(m/s)' in rolling resistance r2.unit",
        ),
        (
            TRAIN.replace("\"value\": 150}", "\"value\": 0.15}"),
            "mass.value = 0.15: expected a mass",
        ),
        (TRAM.replace("80000.0", "NaN"), "file:5: mass = NaN: expected a mass in kg"),
        (
            TRAM.replace("\"davis\"", "\"strahl\""),
            "rolling_resistance.type = strahl: expected \"davis\"",
        ),
        (TRAM.replace("[0.0, 10.0, 25.0]", "[0.0, 10.0]"), "one for each of 2 speeds"),
        (
            "{\"a\": 1}".into(),
            "file:1: the format is not recognised: it holds 'a'; expected a railt",
        ),
        ("3".into(), "the format is not recognised: it holds no keys and values"),
    ];
    for (text, words) in cases {
        let message = refusal(&text);
        assert!(message.contains(words), "{words}: {message}");
        assert!(message.starts_with("file:"), "{message}");
    }
}

#[test]
fn railml_is_refused_with_the_reason_and_other_xml_with_its_root() {
    for root in ["railml version='2.2'", "railML xmlns='https://www.railml.org'", "r:railml"] {
        let text = format!("<?xml version='1.0'?>\n<!-- a > b -->\n<{root}><a/></{root}>");
        assert!(refusal(&text).contains("railML is not imported: its licence"), "{root}");
    }
    assert!(refusal("<osm version='1'/>").contains("found XML with the root 'osm'"));
    assert!(refusal("<!-- never closed").contains("found XML with the root ''"));
}

#[test]
fn a_format_may_be_forced_and_then_says_what_is_missing() {
    let forced = |text, format| {
        let source = [ImportSource { label: "file", text }];
        import(&source, Some(format), &ImportReading::default()).unwrap_err().to_string()
    };
    assert_eq!(
        forced(TRAM, Format::Railtoolkit),
        "file:1: missing key schema: expected the address of railtoolkit's schema"
    );
    assert!(forced(STOCK, Format::Osrd).contains("missing key mass"));
    assert!(forced(STOCK, Format::Ttobench).contains("missing key metadata"));
}
