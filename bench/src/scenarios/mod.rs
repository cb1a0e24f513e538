//! Every pipeline that answers resistance or mass, in a user's day: trains that stop, loads that are
//! weighed wrong or not at all, maps, wheels, forces and clocks that are a little off. The drives can be written as
//! datasets that `dynocar explain` reads: the controller's samples, in runs.
//!
//! - [`world`]: a train, its line and its day, with the size of the mistakes in their declaration
//! - [`brake`]: brakes that do not act as they report
//! - [`scenario_train`]: driving from stop to stop, and the controller's samples
//! - [`bound`]: the least possible standard deviations of both
//! - [`score`]: scores of answers over a drive
//! - [`table`]: the scenarios, and their results in numbers

pub mod bound;
pub mod brake;
pub mod scenario_train;
pub mod score;
pub mod table;
pub mod world;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_model::train::TrainModel;
use dynocar_shared::{PipelineKind, SampleField};
use serde_json::json;

use self::scenario_train::ScenarioTrain;
use self::table::NamedScenario;
use self::world::{Mistakes, World};
use crate::output::{
    self, BenchError, OutputArguments, containing, during, expect, named, write_csv,
};

/// Resistance and mass in a user's day: how long an answer may be used, how soon, how often that
/// changes, and whether its intervals hold.
#[derive(Debug, Args)]
pub struct ScenariosArguments {
    /// Drives for each scenario
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Hours of each drive
    #[arg(long, default_value_t = 2.0)]
    hours: f64,
    /// Only scenarios whose name contains this, as metro
    #[arg(long, value_name = "TEXT", default_value = "")]
    scenario: String,
    /// Rows of brakes that do not act as they report, instead of the usual ones
    #[arg(long)]
    brakes: bool,
    /// How large the mistakes are: those of careful declarations, or all that default settings expect
    #[arg(long, value_enum, default_value_t = Size::Usual)]
    mistakes: Size,
    /// Instead of measuring, write the drives as datasets into this folder
    #[arg(long, value_name = "DIR", conflicts_with = "csv")]
    write: Option<PathBuf>,
    /// A pipeline; may be repeated
    #[arg(long = "pipeline", value_name = "KIND", default_value = "train_kalman")]
    pipelines: Vec<String>,
    /// Scenarios at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    #[command(flatten)]
    output: OutputArguments,
    /// Write the result as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// How large the mistakes are.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Size {
    Usual,
    Expected,
}

impl Size {
    fn mistakes(self) -> Mistakes {
        match self {
            Size::Usual => Mistakes::USUAL,
            Size::Expected => Mistakes::expected(),
        }
    }
}

impl ScenariosArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When the command line is wrong, or the result cannot be written.
    pub fn run(&self) -> Result<(), BenchError> {
        let all = if self.brakes { table::brakes() } else { table::scenarios() };
        let chosen = containing("--scenario", &self.scenario, all, |(it, _)| it.join(", "))?;
        let all: Vec<_> = PipelineKind::ALL.iter().map(|kind| (kind.name(), *kind)).collect();
        let kinds = self.pipelines.iter().map(|name| named("--pipeline", name, &all));
        let kinds = kinds.collect::<Result<Vec<_>, _>>()?;
        let is_some = self.hours > 0.0 && self.hours.is_finite() && self.seeds > 0;
        expect(is_some, || "--hours and --seeds: expected more than 0".into())?;
        if let Some(folder) = &self.write {
            return self.write(&chosen, folder);
        }
        let records = table::run(&table::Plan {
            scenarios: &chosen,
            kinds: &kinds,
            seeds: self.seeds,
            first_seed: self.first_seed,
            hours: self.hours,
            mistakes: self.mistakes.mistakes(),
            threads: self.threads,
        })?;
        if let Some(file) = &self.csv {
            write_csv(file, &records)?;
        }
        self.output.give(&records, || output::table(&records))
    }

    /// Writes every drive of the rows as a dataset.
    fn write(&self, rows: &[NamedScenario], folder: &Path) -> Result<(), BenchError> {
        for (name, scenario) in rows {
            for seed in self.first_seed..self.first_seed + self.seeds {
                let world = World::draw(*scenario, self.mistakes.mistakes(), seed);
                let name = format!("{}, seed {seed}", name.join(", ")).replace([',', '/'], "");
                write_dataset(world, self.hours, &folder.join(name.replace(' ', "_")))?;
            }
        }
        Ok(())
    }
}

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
pub fn write_dataset(world: World, hours: f64, folder: &Path) -> Result<(), BenchError> {
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
