//! The command line of `dynocar-soak`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand};
use dynocar_analysis::identify::default_estimators;

/// Seeded faults, load and bad input for as long as one likes; exit status 101 when a promise breaks.
#[derive(Debug, Parser)]
#[command(name = "dynocar-soak", version, about)]
pub struct Arguments {
    /// Action
    #[command(subcommand)]
    pub command: Command,
}

/// Actions of `dynocar-soak`.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Kills, stops and restarts of all processes
    Faults(SoakRounds),
    /// Eight trains at 200 Hz, with faults
    Load {
        /// How long, in s
        #[arg(long, default_value_t = 3600)]
        seconds: u64,
        /// The seed
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// A day of eight trains in accelerated time, with trouble by the quarter of an hour
    Day {
        /// Hours of train time
        #[arg(long, default_value_t = 24)]
        hours: usize,
        /// The seed
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Months of one train: something undeclared appears or goes, and the loop of learning, trying, adopting
    /// and taking back has to follow; a table
    Months(Months),
    /// How often a model that is no better is adopted: years made of simulated trips, drawn with replacement
    Mistakes {
        /// Trains
        #[arg(long, default_value_t = 20)]
        trains: u64,
        /// Years of each
        #[arg(long, default_value_t = 20)]
        years: usize,
        /// The first seed
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// As in the configuration
        #[arg(long, default_value_t = 200_000.0)]
        trips_between_mistakes: f64,
    },
    /// Garbage into each kind of segment; prints who survives
    Hostile(SoakRounds),
    /// `kill -9` of daemon, controller and client while they start, ten starts a round
    Starts(SoakRounds),
    /// `kill -9` while a state file is written
    State(SoakRounds),
    /// Every pipeline under every failure of its sensors, a simulated scene each round; prints the
    /// estimates that are trusted and wrong at the end, and how many were at a look every 40 s
    Samples {
        /// Scenes and seed
        #[command(flatten)]
        rounds: SoakRounds,
        /// Kinds of estimator, all when absent
        #[arg(long, value_delimiter = ',', value_parser = known_kinds())]
        kinds: Vec<String>,
    },
    /// Mutations of `tests/corpus` into every reader
    Fuzz(SoakRounds),
    /// Makes `tests/golden/demo.txt` anew, after a change that is meant
    Golden,
}

/// Months of one train.
#[derive(Debug, Args)]
pub struct Months {
    /// Events: `nothing`, `wheels_wear`, `winter`, `brake_drags_for_a_day` or a kind of effect; all when absent
    #[arg(long)]
    pub story: Option<String>,
    /// Days
    #[arg(long, default_value_t = 50)]
    pub days: usize,
    /// The first day on which something is undeclared
    #[arg(long, default_value_t = 12)]
    pub onset: usize,
    /// The first day on which nothing is any more, in stories that end
    #[arg(long, default_value_t = 32)]
    pub end: usize,
    /// Trips of a day
    #[arg(long, default_value_t = 24)]
    pub trips: usize,
    /// Keep each life's files, runs and store, in a folder of its own in this one
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
    /// How many lives of each story
    #[arg(long, default_value_t = 1)]
    pub lives: u64,
    /// The seed of the first
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// How often, and by chance of which seed.
#[derive(Debug, Args)]
pub struct SoakRounds {
    /// How many
    #[arg(long, default_value_t = 1000)]
    pub rounds: u64,
    /// The seed
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

fn known_kinds() -> PossibleValuesParser {
    PossibleValuesParser::new(default_estimators().iter().map(|settings| settings.kind().name()))
}
