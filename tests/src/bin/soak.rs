//! Seeded faults for as long as one likes.
//!
//! `dynocar-soak faults --rounds 1000 --seed 1`: kills, stops and restarts of all processes.
//! `dynocar-soak load --seconds 3600 --seed 1`: eight trains at 200 Hz, with faults.
//! `dynocar-soak hostile --rounds 5 --seed 1`: garbage into each kind of segment; who survives.
//! `dynocar-soak state --rounds 1000 --seed 1`: `kill -9` while a state file is written.
//! `dynocar-soak samples --rounds 4 --seed 1`: every pipeline under every failure of its sensors, a
//! simulated scene each round; prints the estimates that are trusted and wrong.
//! `dynocar-soak fuzz --rounds 100000 --seed 1`: mutations of `tests/corpus` into every reader.
//! `dynocar-soak golden`: makes `tests/golden/demo.txt` anew, after a change that is meant.

use std::collections::HashMap;

use dynocar_tests::fuzz::{self, Target};
use dynocar_tests::golden;
use dynocar_tests::sensor_failures::SensorFailure;
use dynocar_tests::simulator::TrainType;
use dynocar_tests::soak::bad_samples::Scene;
use dynocar_tests::soak::{Programs, faults, hostile, load, state_kills};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let what = arguments.next().unwrap_or_default();
    let mut options = HashMap::new();
    while let Some(key) = arguments.next() {
        let value = arguments.next().and_then(|value| value.parse::<u64>().ok());
        let value = value.unwrap_or_else(|| panic!("{key}: expected a whole number"));
        options.insert(key, value);
    }
    let mut option = |key: &str, otherwise| options.remove(key).unwrap_or(otherwise);
    let (rounds, seed) = (option("--rounds", 1000), option("--seed", 1));
    let seconds = option("--seconds", 3600);
    let programs = Programs::beside(&std::env::current_exe().expect("the program's path"));
    match what.as_str() {
        "faults" => {
            let summary = faults::run(&programs, rounds, seed);
            println!("{rounds} rounds: {summary:?}");
        }
        "load" => println!("{:#?}", load::run(&programs, seconds, seed)),
        "hostile" => {
            hostile::measure(&programs, rounds, seed).iter().for_each(|it| println!("{it:?}"));
        }
        "state" => {
            let states = state_kills::kill_writers(&programs.peer, rounds, seed);
            println!("{rounds} kills among {states} writes, every state readable");
        }
        "samples" => {
            for round in 0..rounds {
                let train_type = TrainType::ALL[(round % 4) as usize];
                let scene = Scene::new(seed + round, train_type);
                let report =
                    |misled: Vec<_>| misled.iter().for_each(|it| println!("{train_type:?} {it:?}"));
                report(scene.run(None, 0.0, 0));
                for failure in SensorFailure::ALL {
                    for rate in [0.001, 0.01, 0.1, 0.5] {
                        report(scene.run(Some(failure), rate, seed + round));
                    }
                }
            }
            println!("{rounds} scenes, every sample accounted for, every snapshot finite");
        }
        "fuzz" => {
            for target in Target::ALL {
                let accepted = fuzz::run(target, rounds, seed);
                println!("{target:?}: {rounds} inputs, {accepted} accepted, none misbehaved");
            }
        }
        "golden" => {
            let text = golden::compute().to_text();
            std::fs::write(golden::path(), text).expect("the golden file to be written");
            println!("{} made anew", golden::path().display());
        }
        other => {
            panic!("{other:?}: expected faults, hostile, load, state, samples, fuzz or golden")
        }
    }
}
