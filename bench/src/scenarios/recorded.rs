//! A drive as a dataset that `dynocar explain` reads: the controller's samples, in runs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use dynocar_model::train::TrainModel;
use dynocar_shared::SampleField;
use serde_json::json;

use super::scenario_train::ScenarioTrain;
use super::world::World;
use crate::output::{BenchError, during};

/// A run ends at the first stop after this time in s, or where the train turns.
const RUN_S: f64 = 900.0;
/// Recorded fields by column.
const FIELDS: [(&str, SampleField); 7] = [
    ("position", SampleField::Position),
    ("speed", SampleField::Speed),
    ("traction_force", SampleField::TractionForce),
    ("brake_force", SampleField::BrakeForce),
    ("brake_cylinder_pressure", SampleField::BrakeCylinderPressure),
    ("train_mass", SampleField::Mass),
    ("gradient", SampleField::Gradient),
];
/// Units of time and of the columns, in their order.
const UNITS: [&str; 7] = ["m", "m/s", "N", "N", "Pa", "kg", "permille"];

/// Rows of a run while it is driven.
#[derive(Default)]
struct Run {
    direction: f64,
    begun_s: f64,
    text: String,
}

/// Writes some hours of a drive into a folder; the last quarter of the runs is held out.
///
/// # Errors
///
/// When a file cannot be written.
pub fn write(world: World, hours: f64, folder: &Path) -> Result<(), BenchError> {
    let train = train_toml(&world.declared)?;
    let cycle_s = 1.0 / f64::from(world.scenario.rate_hz);
    let mut drive = ScenarioTrain::new(world);
    let first = drive.advance();
    let fields = FIELDS.iter().zip(UNITS).filter(|((_, it), _)| first.sample.get(*it).is_some());
    let fields: Vec<_> = fields.collect();
    let names: Vec<&str> = fields.iter().map(|((name, _), _)| *name).collect();
    let head = format!("time,{}\n", names.join(","));
    let begun = |direction, begun_s| Run { direction, begun_s, text: head.clone() };
    let mut runs = vec![begun(first.direction, 0.0)];
    for cycle in 1..(3600.0 * hours / cycle_s) as u64 {
        let (time_s, moment) = (cycle as f64 * cycle_s, drive.advance());
        let mut run = runs.len() - 1;
        let is_over = moment.is_standing && time_s - runs[run].begun_s > RUN_S;
        if is_over || moment.direction != runs[run].direction {
            runs.push(begun(moment.direction, time_s));
            run += 1;
        }
        let cells = fields.iter().map(|((_, it), _)| moment.sample.get(*it).unwrap_or(f64::NAN));
        let row = cells.fold(format!("{time_s:.3}"), |row, cell| row + &format!(",{cell:.4}"));
        // Writing to a string cannot fail.
        let _ = writeln!(runs[run].text, "{row}");
    }
    let columns =
        fields.iter().map(|((name, _), unit)| (*name, json!({ "column": name, "unit": unit })));
    let mut columns: serde_json::Map<_, _> = columns.map(|(name, it)| (name.into(), it)).collect();
    columns.insert("time".into(), json!({ "column": "time", "unit": "s" }));
    let held_out = runs.len() / 4;
    let described = (0..runs.len()).map(|number| {
        let role = if number + held_out >= runs.len() { "holdout" } else { "fit" };
        let file = format!("{number:02}.csv");
        json!({ "file": file, "role": role, "direction": runs[number].direction as i64 })
    });
    let dataset = json!({
        "dataset": { "name": "scenario" },
        "train": { "file": "train.toml" },
        "columns": columns,
        "runs": described.collect::<Vec<_>>(),
    });
    let files =
        runs.iter().enumerate().map(|(number, run)| (format!("{number:02}.csv"), run.text.clone()));
    let described =
        [("train.toml".into(), train), ("dataset.toml".into(), toml::to_string(&dataset)?)];
    fs::create_dir_all(folder).map_err(during(folder.display()))?;
    for (name, text) in files.chain(described) {
        let file = folder.join(name);
        fs::write(&file, text).map_err(during(file.display()))?;
    }
    Ok(())
}

fn train_toml(train: &TrainModel) -> Result<String, BenchError> {
    let davis = &train.resistance;
    let mut declared = json!({
        "name": train.name,
        "mass_t": 1e-3 * train.mass_kg,
        "length_m": train.length_m,
        "rotating_mass_factor": train.rotating_mass_factor,
    });
    if let Some(full_kg) = train.full_mass_kg {
        declared["mass_full_t"] = json!(1e-3 * full_kg);
    }
    let resistance = json!({ "a": davis.a, "b": davis.b, "c": davis.c });
    Ok(toml::to_string(&json!({ "train": declared, "resistance": resistance }))?)
}
