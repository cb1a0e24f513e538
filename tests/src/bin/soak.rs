//! Seeded faults for any length of time.

use std::collections::BTreeMap;
use std::process::ExitCode;

use dynocar::cli::parse;
use dynocar::output::{OutputError, print, report_line, write_file};
use dynocar_tests::fuzz::{self, Target};
use dynocar_tests::golden;
use dynocar_tests::sensor_failures::SensorFailure;
use dynocar_tests::simulator::TrainType;
use dynocar_tests::soak::arguments::{Arguments, Command, Months, SoakRounds};
use dynocar_tests::soak::bad_samples::{SoakScene, SoakTally};
use dynocar_tests::soak::months::story::StorySpan;
use dynocar_tests::soak::months::{self, Life, LifeSettings, Story, mistakes};
use dynocar_tests::soak::{Programs, day, faults, hostile, load, starts, state_kills};

/// Tallies by the kind of estimator and whether sensors failed.
type Tallies = BTreeMap<(String, bool), SoakTally>;

fn main() -> ExitCode {
    let programs = Programs::beside(&std::env::current_exe().expect("the program's path"));
    let arguments = match parse::<Arguments>("dynocar-soak") {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    match arguments.command {
        Command::Faults(SoakRounds { rounds, seed }) => {
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
        Command::Hostile(SoakRounds { rounds, seed }) => {
            hostile::measure(&programs, rounds, seed).iter().for_each(|it| say(format!("{it:?}")));
        }
        Command::Starts(SoakRounds { rounds, seed }) => {
            let summary = starts::run(&programs, rounds, seed);
            say(format!("{rounds} roots: {summary:?}"));
        }
        Command::State(SoakRounds { rounds, seed }) => {
            let states = state_kills::kill_writers(&programs.peer, rounds, seed);
            say(format!("{rounds} kills among {states} writes, every state readable"));
        }
        Command::Samples { rounds: SoakRounds { rounds, seed }, kinds } => {
            let mut tallies = Tallies::new();
            (0..rounds).for_each(|round| samples(round, seed + round, &kinds, &mut tallies));
            print_tallies(&tallies);
            say(format!("{rounds} scenes, every sample accounted for, every snapshot finite"));
        }
        Command::Fuzz(SoakRounds { rounds, seed }) => {
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

/// Simulates the months; an error describes the mistake in the request.
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
                span: StorySpan { onset: months.onset, end: months.end },
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
    let scene = SoakScene::new(seed, train_type);
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
        let SoakTally { looks, trusted, wrong, wrong_at_end } = tally;
        say(format!(
            "{kind}, {samples} samples: {looks} looks, {trusted} trusted, {wrong} of them wrong; \
             {wrong_at_end} wrong at the end of a scene"
        ));
    }
}
