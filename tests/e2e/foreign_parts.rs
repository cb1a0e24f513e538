//! Files of several trains, and of several locomotives of one train.

use std::path::Path;

use crate::foreign_files::{
    DYNOCAR, NAMES, ROWS, assert_as_plain, described, plain, table, values,
};

#[test]
fn the_rows_of_one_train_are_chosen_of_a_file_of_several() {
    let of_train = |name: &str, order: &dyn Fn(usize, usize) -> usize| {
        let header = format!("{name};{}\n", NAMES.join(";"));
        let mut rows: Vec<(usize, String)> = Vec::new();
        for row in 0..ROWS {
            for (train, factor) in [("ice1", 1.0), ("re2", 0.5)] {
                let cells = values(row).map(|it| it.to_string());
                let mut cells = cells.to_vec();
                cells[3] = (factor * values(row)[3]).to_string();
                let place = order(row as usize, usize::from(train == "re2"));
                rows.push((place, format!("{train};{}\n", cells.join(";"))));
            }
        }
        rows.sort_by_key(|it| it.0);
        header + &rows.into_iter().map(|it| it.1).collect::<String>()
    };
    let interleaved = |row: usize, train: usize| 2 * row + train;
    let one_after_the_other = |row: usize, train: usize| 10_000 * train + row;
    for name in ["vehicle_id", "Vehicle ID", "train", "Fahrzeug-Nr.", "unit"] {
        let text = of_train(name, &interleaved);
        let message = described(&[("a.csv", text.as_bytes())], &[]).1.unwrap_err();
        assert!(
            message.contains(&format!("of 2 trains, by column '{name}': 'ice1', 're2'")),
            "{message}"
        );
        assert_as_plain(name, &[("a.csv", text.as_bytes())], &["--train", "ice1"], 1e-9);
        let (_site, read, _) = described(&[("a.csv", text.as_bytes())], &["--train", "re2"]);
        let half = read.expect("a dataset").runs[0].samples[10].traction_force_n;
        assert_eq!(half, 0.5 * 41_000.5, "{name}");
        let message = described(&[("a.csv", text.as_bytes())], &["--train", "ice2"]).1.unwrap_err();
        assert!(message.contains("no row of train 'ice2' in column"), "{message}");
    }
    let text = of_train("vehicle_id", &one_after_the_other);
    let message = described(&[("a.csv", text.as_bytes())], &[]).1.unwrap_err();
    assert!(message.contains("of 2 trains, by column 'vehicle_id'"), "{message}");
    assert_as_plain("in turn", &[("a.csv", text.as_bytes())], &["--train", "ice1"], 1e-9);
    // The second is there once the first has gone.
    let names: Vec<&str> = NAMES.into_iter().chain(["vehicle_id"]).collect();
    let cell = |row: u32, column: usize| match column {
        6 => (if row < 250 { "ice1" } else { "re2" }).to_owned(),
        1 if row >= 250 => (values(row)[1] - 900.0).to_string(),
        column => plain(row, column),
    };
    let message = described(&[("a.csv", table(&names, ",", cell).as_bytes())], &[]).1.unwrap_err();
    assert!(message.contains("of 2 trains, by column 'vehicle_id'"), "{message}");
    // One train whose number changes on the way, and one with a mark, are one.
    for cell_of in [
        &(|row: u32| if row < 300 { "101" } else { "102" }) as &dyn Fn(u32) -> &'static str,
        &(|row| if row % 3 == 0 { "1" } else { "0" }),
    ] {
        let names: Vec<&str> = NAMES.into_iter().chain(["train"]).collect();
        let cell =
            |row, column| if column == 6 { cell_of(row).to_owned() } else { plain(row, column) };
        assert_as_plain("one train", &[("a.csv", table(&names, ",", cell).as_bytes())], &[], 1e-9);
    }
}

#[test]
fn of_two_locomotives_in_a_column_each_the_forces_add_up_and_the_doubt_is_said_everywhere() {
    let names = [
        "time_s",
        "position_m",
        "speed_mps",
        "Zugkraft Lok 1 [N]",
        "brake_force_n",
        "gradient_permille",
        "Zugkraft Lok 2 [N]",
    ];
    let cell = |row: u32, column: usize| match column {
        3 => (0.25 * values(row)[3]).to_string(),
        6 => (0.75 * values(row)[3]).to_string(),
        column => plain(row, column),
    };
    let text = table(&names, ",", cell);
    assert_as_plain("parts", &[("a.csv", text.as_bytes())], &[], 1e-9);
    let (site, read, said) = described(&[("a.csv", text.as_bytes())], &[]);
    read.expect("a dataset");
    assert!(said.contains("doubtful: traction_force:"), "{said}");
    let at = |name: &str| site.path().join(name).display().to_string();
    let (folder, report, json) = (at("ds"), at("report.html"), at("answer.json"));
    let words = "traction_force was DOUBTFUL when";
    let run = |arguments: &[&str]| {
        let mut process = site.start(DYNOCAR, arguments);
        assert!(process.wait().success(), "{}", process.errors());
        process.output().split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let file = |path: &str| std::fs::read_to_string(path).expect("a file");
    for command in ["check", "identify", "explain"] {
        let said = run(&[command, &folder, "--json", &json]);
        assert!(said.contains(words), "{command}: {said}");
        let answer: serde_json::Value = serde_json::from_str(&file(&json)).expect("JSON");
        let codes: Vec<&str> = answer["notes"]
            .as_array()
            .expect("notes")
            .iter()
            .filter_map(|it| it["code"].as_str())
            .collect();
        assert!(codes.contains(&"doubtful_input"), "{command}: {codes:?}");
    }
    run(&["explain", &folder, "--report", &report]);
    assert!(file(&report).contains(words));
    // Once it is confirmed, nothing is said.
    let manifest = Path::new(&folder).join("dataset.toml");
    let text = std::fs::read_to_string(&manifest).expect("a manifest");
    std::fs::write(&manifest, text.replace(", doubtful = true", "")).expect("written");
    assert!(!run(&["identify", &folder]).contains("DOUBTFUL"));
}
