//! Seeded faults for as long as one likes.
//!
//! `dynocar-soak state --rounds 1000 --seed 1`: `kill -9` while a state file is written.
//! `dynocar-soak golden`: makes `tests/golden/demo.txt` anew, after a change that is meant.

use std::collections::HashMap;

use dynocar_tests::golden;
use dynocar_tests::soak::{Programs, state_kills};

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
    let programs = Programs::beside(&std::env::current_exe().expect("the program's path"));
    match what.as_str() {
        "state" => {
            let states = state_kills::kill_writers(&programs.peer, rounds, seed);
            println!("{rounds} kills among {states} writes, every state readable");
        }
        "golden" => {
            let text = golden::compute().to_text();
            std::fs::write(golden::path(), text).expect("the golden file to be written");
            println!("{} made anew", golden::path().display());
        }
        other => panic!("{other:?}: expected state or golden"),
    }
}
