//! Seeded faults for as long as one likes.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand};
use dynocar::cli::parse;
use dynocar::output::{OutputError, print, report_line, write_file};
use dynocar_analysis::identify::default_estimators;
use dynocar_tests::fuzz::{self, Target};
use dynocar_tests::golden;
use dynocar_tests::sensor_failures::SensorFailure;
use dynocar_tests::simulator::TrainType;
use dynocar_tests::soak::bad_samples::{Scene, Tally};
use dynocar_tests::soak::months::story::Span;
use dynocar_tests::soak::months::{self, Life, LifeSettings, Story, mistakes};
use dynocar_tests::soak::{Programs, day, faults, hostile, load, state_kills};

/// Seeded faults, load and bad input for as long as one likes; exit status 101 when a promise breaks.
#[derive(Debug, Parser)]
#[command(name = "dynocar-soak", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Kills, stops and restarts of all processes
    Faults(Rounds),
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
    Hostile(Rounds),
    /// `kill -9` while a state file is written
    State(Rounds),
    /// Every pipeline under every failure of its sensors, a simulated scene each round; prints the
    /// estimates that are trusted and wrong at the end, and how many were at a look every 40 s
    Samples {
        #[command(flatten)]
        rounds: Rounds,
        /// Kinds of estimator, all when absent
        #[arg(long, value_delimiter = ',', value_parser = known_kinds())]
        kinds: Vec<String>,
    },
    /// Mutations of `tests/corpus` into every reader
    Fuzz(Rounds),
    /// Makes `tests/golden/demo.txt` anew, after a change that is meant
    Golden,
}

#[derive(Debug, Args)]
struct Months {
    /// What happens: `nothing`, `wheels_wear`, `winter`, `brake_drags_for_a_day` or a kind of effect; all when
    /// absent
    #[arg(long)]
    story: Option<String>,
    /// Days
    #[arg(long, default_value_t = 50)]
    days: usize,
    /// The first day on which something is undeclared
    #[arg(long, default_value_t = 12)]
    onset: usize,
    /// The first day on which nothing is any more, in stories that end
    #[arg(long, default_value_t = 32)]
    end: usize,
    /// Trips of a day
    #[arg(long, default_value_t = 24)]
    trips: usize,
    /// Keep each life's files, runs and store, in a folder of its own in this one
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// How many lives of each story
    #[arg(long, default_value_t = 1)]
    lives: u64,
    /// The seed of the first
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Debug, Args)]
struct Rounds {
    /// How many
    #[arg(long, default_value_t = 1000)]
    rounds: u64,
    /// The seed
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn known_kinds() -> PossibleValuesParser {
    PossibleValuesParser::new(default_estimators().iter().map(|settings| settings.kind().name()))
}

/// Tallies by the kind of estimator and whether sensors failed.
type Tallies = BTreeMap<(String, bool), Tally>;

fn main() -> ExitCode {
    let programs = Programs::beside(&std::env::current_exe().expect("the program's path"));
    let arguments = match parse::<Arguments>("dynocar-soak") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    match arguments.command {
        Command::Faults(Rounds { rounds, seed }) => {
            let summary = faults::run(&programs, rounds, seed);
            say(format!("{rounds} rounds: {summary:?}"));
        }
        Command::Load { seconds, seed } => {
            say(format!("{:#?}", load::run(&programs, seconds, seed)));
        }
        Command::Day { hours, seed } => say(day::hours::table(&day::run(&programs, hours, seed))),
        Command::Months(months) => {
            if let Err(message) = live(&months) {
                report_line(&format!("dynocar-soak: {message}"));
                return ExitCode::from(2);
            }
        }
        Command::Mistakes { trains, years, seed, trips_between_mistakes } => {
            say(format!("{:?}", mistakes::measure(trains, years, seed, trips_between_mistakes)));
        }
        Command::Hostile(Rounds { rounds, seed }) => {
            hostile::measure(&programs, rounds, seed).iter().for_each(|it| say(format!("{it:?}")));
        }
        Command::State(Rounds { rounds, seed }) => {
            let states = state_kills::kill_writers(&programs.peer, rounds, seed);
            say(format!("{rounds} kills among {states} writes, every state readable"));
        }
        Command::Samples { rounds: Rounds { rounds, seed }, kinds } => {
            let mut tallies = Tallies::new();
            (0..rounds).for_each(|round| samples(round, seed + round, &kinds, &mut tallies));
            print_tallies(&tallies);
            say(format!("{rounds} scenes, every sample accounted for, every snapshot finite"));
        }
        Command::Fuzz(Rounds { rounds, seed }) => {
            for target in Target::ALL {
                let accepted = fuzz::run(target, rounds, seed);
                say(format!("{target:?}: {rounds} inputs, {accepted} accepted, none misbehaved"));
            }
        }
        Command::Golden => {
            let text = golden::compute().to_text();
            write_file(&golden::path(), &text).unwrap_or_else(|error| give_up(&error));
            say(format!("{} made anew", golden::path().display()));
        }
    }
    ExitCode::SUCCESS
}

/// Lives the months; an error says what is wrong with what was asked for.
fn live(months: &Months) -> Result<(), String> {
    let stories = match months.story.as_deref().map(|name| (name, Story::from_name(name))) {
        None => Story::all(),
        Some((_, Some(story))) => vec![story],
        Some((name, None)) => {
            let names: Vec<String> = Story::all().into_iter().map(Story::name).collect();
            return Err(format!("--story {name}: expected one of {}", names.join(", ")));
        }
    };
    if months.days * months.trips < 2 {
        return Err("--days and --trips: expected two trips or more in all".into());
    }
    print(months::table::HEADER).unwrap_or_else(|error| give_up(&error));
    for story in stories {
        for seed in months.seed..months.seed + months.lives {
            let settings = LifeSettings {
                story,
                span: Span { onset: months.onset, end: months.end },
                seed,
                days: months.days,
                trips: months.trips,
                recorded: 6,
                trips_between_mistakes: 200_000.0,
            };
            let passing = tempfile::tempdir().expect("a temporary folder");
            let name = format!("{}-{seed}", story.name());
            let kept = months.keep.as_ref().map(|folder| folder.join(name));
            let folder = kept.as_deref().unwrap_or(passing.path());
            let outcome = Life::begin(settings, folder).live();
            print(&months::table::line(&outcome)).unwrap_or_else(|error| give_up(&error));
        }
    }
    Ok(())
}

/// A line of the result on standard output.
fn say(line: String) {
    print(&(line + "\n")).unwrap_or_else(|error| give_up(&error));
}

/// Ends the program when nobody can be given the result.
fn give_up(error: &OutputError) {
    report_line(&format!("dynocar-soak: {error}"));
    std::process::exit(1);
}

/// One scene without and with every failure at six rates; adds to the tallies of the kinds.
fn samples(round: u64, seed: u64, kinds: &[String], tallies: &mut Tallies) {
    let train_type = TrainType::ALL[(round % 4) as usize];
    let scene = Scene::new(seed, train_type);
    let is_wanted = |kind: &str| kinds.is_empty() || kinds.iter().any(|wanted| wanted == kind);
    let mut watch = |failure, rate| {
        for watched in scene.watch(failure, rate, seed, is_wanted) {
            watched.misled_at_end.iter().for_each(|it| say(format!("{train_type:?} {it:?}")));
            *tallies.entry((watched.kind, failure.is_some())).or_default() += watched.tally;
        }
    };
    watch(None, 0.0);
    for failure in SensorFailure::ALL {
        for rate in [0.001, 0.01, 0.03, 0.1, 0.25, 0.5] {
            watch(Some(failure), rate);
        }
    }
}

fn print_tallies(tallies: &Tallies) {
    for ((kind, is_failing), tally) in tallies {
        let samples = if *is_failing { "failing" } else { "good" };
        let Tally { looks, trusted, wrong, wrong_at_end } = tally;
        say(format!(
            "{kind}, {samples} samples: {looks} looks, {trusted} trusted, {wrong} of them wrong; \
             {wrong_at_end} wrong at the end of a scene"
        ));
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use dynocar_tests::documents::{Shown, pages};

    #[test]
    fn every_soak_that_a_page_shows_is_one_that_this_program_takes() {
        let shown: Vec<Shown> = pages().iter().flat_map(|it| it.commands("dynocar-soak")).collect();
        assert!(shown.len() > 5, "the commands are found: {}", shown.len());
        let command = super::Arguments::command;
        let refusals: Vec<String> = shown.iter().filter_map(|it| it.refusal(command())).collect();
        assert!(refusals.is_empty(), "{}", refusals.join("\n"));
    }
}
