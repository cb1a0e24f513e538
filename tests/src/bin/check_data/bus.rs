//! The trolley bus on an unsurveyed line: the findings of `dynocar survey`, and the error of the speed predicted for
//! two trips on a line learned without them.

use std::path::Path;

use dynocar::dataset;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::answer::ExplainAnswer;
use dynocar_analysis::explain::explain;
use dynocar_analysis::explain::stop_to_stop::StopToStop;
use dynocar_shared::PipelineKind;
use dynocar_workshop::survey::SurveyAnswer;
use dynocar_workshop::survey::survey_folder;

use super::Report;
use super::bus_variants::{self, ByPower, OtherDay};
use super::stop_masses::{self, StopMasses};

/// Largest open-loop error in m/s on trips left out, for the error over 60 s in all trips and for the median error from
/// stop to stop.
const ERROR_MAX_MPS: f64 = 0.30;
/// Largest scatter in t of the learned masses between stops about the masses by passenger count, and least correlation
/// of the two.
const STOP_MASS_T: f64 = 0.38;
const CORRELATION: f64 = 0.9;
/// Limit of the error after explaining, as a share of the error before, where the line is declared level and its
/// gradient has to be found.
const LEVEL_SHARE_MAX: f64 = 0.25;
/// Range of the inertial mass from independent analyses of the day.
const INERTIAL_MASS_T: [f64; 2] = [19.4, 20.1];
const PASSENGER_KG: [f64; 2] = [60.0, 82.0];
const BRAKE_N_PER_PA: [f64; 2] = [0.23, 0.28];
const RELEASE_PA: [f64; 2] = [17e3, 25e3];

/// Surveys the bus's day, then leaves its trips out two by two.
pub fn check(report: &mut Report, folder: &Path) {
    let whole = surveyed(&folder.join("dataset-raw.toml"));
    report.note(
        "bus: what is learned jointly with the line",
        whole.as_ref().map_err(Clone::clone).and_then(learned),
    );
    let outcome = whole.and_then(|answer| left_out(folder, &answer));
    let error = outcome.as_ref().map_err(Clone::clone).and_then(LeftOut::error);
    report.note("bus: 60 s in open loop, trips left out two by two", error);
    let stops = outcome.as_ref().map_err(Clone::clone).and_then(LeftOut::stop_to_stop);
    report.note("bus: from stop to stop in open loop, trips left out two by two", stops);
    let days = outcome.as_ref().map_err(Clone::clone);
    report.note(
        "bus: 60 s in open loop, trips mapped as another day's",
        days.and_then(|it| bus_variants::other_days(&it.another_day)),
    );
    let powers = outcome.as_ref().map_err(Clone::clone);
    report.note(
        "bus: its force from power, trips left out two by two",
        powers.and_then(|it| bus_variants::powers(&it.power)),
    );
    let climbs = outcome.as_ref().map_err(Clone::clone).and_then(|it| found_to_climb(&it.level));
    report.note("bus: its line declared level", climbs);
    for (index, (label, ..)) in LEARNERS.iter().enumerate() {
        let masses = outcome.as_ref().map_err(Clone::clone).map(|it| &it.masses[index]);
        report.note(label, masses.and_then(held));
    }
}

/// Learns the masses of a dataset's sections by a kind of pipeline.
type Learn = fn(&Dataset, PipelineKind) -> StopMasses;

/// How the mass from stop to stop is learned on trips left out.
const LEARNERS: [(&str, Learn, PipelineKind); 2] = [
    ("bus: mass from stop to stop, live", stop_masses::live, PipelineKind::MassKalman),
    ("bus: mass of each section alone", stop_masses::alone, PipelineKind::JointLeastSquares),
];

fn held(masses: &StopMasses) -> Result<String, String> {
    let (scatter_t, correlation, words) = masses.summary();
    if scatter_t <= STOP_MASS_T && correlation >= CORRELATION { Ok(words) } else { Err(words) }
}

/// Errors of trips that took no part in their line.
#[derive(Default)]
struct LeftOut {
    errors_mps: Vec<f64>,
    /// From stop to stop, before and after effects, by trip.
    stop_errors_mps: Vec<Vec<[f64; 2]>>,
    masses: [StopMasses; LEARNERS.len()],
    /// The trips mapped as another day's, by pair.
    another_day: Vec<OtherDay>,
    /// Their force from power, by pair.
    power: Vec<ByPower>,
    /// Answer when the first of these lines is declared level.
    level: Option<ExplainAnswer>,
}

impl LeftOut {
    fn error(&self) -> Result<String, String> {
        let squares: f64 = self.errors_mps.iter().map(|error| error * error).sum();
        let all_mps = (squares / self.errors_mps.len() as f64).sqrt();
        let words = format!("{all_mps:.3} m/s, by pair {:.3?}", self.errors_mps);
        if all_mps <= ERROR_MAX_MPS { Ok(words) } else { Err(words) }
    }
}

impl LeftOut {
    fn stop_to_stop(&self) -> Result<String, String> {
        let found = StopToStop::from_errors(self.stop_errors_mps.clone()).ok_or("no stops")?;
        let median_mps = found.median_mps[0];
        let [low, high] = found.interval_95_mps.ok_or("one trip only")?[0];
        let runs = found.runs;
        let words = format!("median {median_mps:.3} m/s ({low:.3} to {high:.3}) of {runs} runs");
        if median_mps <= ERROR_MAX_MPS { Ok(words) } else { Err(words) }
    }
}

fn surveyed(source: &Path) -> Result<SurveyAnswer, String> {
    let out = tempfile::tempdir().map_err(|error| error.to_string())?;
    Ok(survey_folder(source, None, out.path()).map_err(|error| error.to_string())?.answer)
}

fn learned(answer: &SurveyAnswer) -> Result<String, String> {
    let learned = answer.learned.as_ref().ok_or("nothing is learned")?;
    let missing = f64::NAN;
    let passenger_kg = learned.passenger_mass_kg.as_ref().map_or(missing, |it| it.value);
    let brake = learned.friction_brake_n_per_pa.as_ref().map_or(missing, |it| it.value);
    let release_pa = learned.release_pressure_pa.unwrap_or(missing);
    let found = [
        ("t with rotating parts", learned.inertial_mass_t.value, INERTIAL_MASS_T),
        ("kg a passenger", passenger_kg, PASSENGER_KG),
        ("N/Pa", brake, BRAKE_N_PER_PA),
        ("Pa of release", release_pa, RELEASE_PA),
    ];
    let words: Vec<String> =
        found.iter().map(|(unit, value, _)| format!("{value:.3} {unit}")).collect();
    let is_inside = found.iter().all(|(_, value, [low, high])| (low..=high).contains(&value));
    if is_inside { Ok(words.join(", ")) } else { Err(words.join(", ")) }
}

fn left_out(folder: &Path, whole: &SurveyAnswer) -> Result<LeftOut, String> {
    let trips = &whole.trips;
    // A trip's recording reaches to the middle of the standstills before and after it.
    let middles: Vec<f64> =
        trips.windows(2).map(|pair| 0.5 * (pair[0].to_s + pair[1].from_s)).collect();
    let mut all = LeftOut::default();
    for first in (0..trips.len()).step_by(2) {
        let raw = tempfile::tempdir().map_err(|error| error.to_string())?;
        let out = tempfile::tempdir().map_err(|error| error.to_string())?;
        let is_out = |trip: usize| trip == first || trip == first + 1;
        cut(folder, raw.path(), &middles, &is_out).map_err(|error| error.to_string())?;
        survey_folder(raw.path(), None, out.path()).map_err(|error| error.to_string())?;
        let mapped = dataset::load(out.path()).map_err(|error| error.to_string())?;
        let explained = explain(&mapped, &|_, _| {}).map_err(|error| error.to_string())?;
        let score = &explained.score.holdout_window60[0];
        all.errors_mps.push(score.rmse_mps().ok_or("no trip is held out")?);
        let stops = explained.score.holdout_stop_to_stop.ok_or("no trip stops twice")?;
        all.stop_errors_mps.extend(stops.errors_mps);
        let trips = [first, first + 1];
        all.another_day.push(bus_variants::of_another_day(raw.path(), out.path(), trips)?);
        all.power.push(bus_variants::by_power(out.path())?);
        if first == 0 {
            let level = declared_level(out.path())?;
            let explained = explain(&level, &|_, _| {}).map_err(|error| error.to_string())?;
            all.level = Some(explained.answer);
        }
        for (masses, (_, learn, kind)) in all.masses.iter_mut().zip(LEARNERS) {
            masses.extend(learn(&mapped, kind));
        }
    }
    Ok(all)
}

/// Returns the same trips on a line of which no gradient is known.
fn declared_level(folder: &Path) -> Result<Dataset, String> {
    let file = folder.join("track.toml");
    let text = std::fs::read_to_string(&file).map_err(|error| error.to_string())?;
    let mut document: toml::Table = text.parse().map_err(|error| format!("{error}"))?;
    let line = document.get_mut("track").and_then(toml::Value::as_table_mut).ok_or("no line")?;
    line.retain(|name, _| !name.starts_with("gradient"));
    line.insert("gradient".into(), toml::Value::from(vec![vec![0.0, 0.0]]));
    std::fs::write(&file, document.to_string()).map_err(|error| error.to_string())?;
    dataset::load(folder).map_err(|error| error.to_string())
}

fn found_to_climb(answer: &Option<ExplainAnswer>) -> Result<String, String> {
    let answer = answer.as_ref().ok_or("nothing was explained")?;
    let error = |error: Option<f64>| error.unwrap_or(f64::NAN);
    let (before, after) = (error(answer.rmse_before), error(answer.rmse_after));
    let kinds: Vec<&str> = answer.effects.iter().map(|effect| effect.kind).collect();
    let words = format!("{}, {before:.2} to {after:.2} m/s", kinds.join(", "));
    if kinds == ["gradient_error"] && after < LEVEL_SHARE_MAX * before {
        Ok(words)
    } else {
        Err(words)
    }
}

/// Cuts the day into one recording for each trip, some of them held out.
fn cut(
    folder: &Path,
    out: &Path,
    middles: &[f64],
    is_out: &dyn Fn(usize) -> bool,
) -> std::io::Result<()> {
    std::fs::create_dir(out.join("runs"))?;
    std::fs::copy(folder.join("train.toml"), out.join("train.toml"))?;
    let described = std::fs::read_to_string(folder.join("dataset-raw.toml"))?;
    let (mut manifest, runs) = match described.split_once("[[runs]]") {
        Some((head, runs)) => (head.to_string(), runs),
        None => (described.clone(), ""),
    };
    manifest += "line_power = { column = \"electric_powerDemand\", unit = \"W\" }\n";
    let file = runs.split('"').nth(1).unwrap_or_default();
    let text = std::fs::read_to_string(folder.join(file))?;
    let (head, rows) = text.split_once('\n').unwrap_or((&text, ""));
    let column = head.split(',').position(|name| name == "time_unix").unwrap_or(0);
    let mut parts = vec![format!("{head}\n"); middles.len() + 1];
    for row in rows.lines() {
        let time_s = row.split(',').nth(column).and_then(|cell| cell.parse::<f64>().ok());
        let trip = middles.partition_point(|middle| time_s.is_some_and(|it| it > *middle));
        parts[trip] += &format!("{row}\n");
    }
    for (trip, part) in parts.iter().enumerate() {
        std::fs::write(out.join(format!("runs/{trip}.csv")), part)?;
        let role = if is_out(trip) { "holdout" } else { "fit" };
        manifest += &format!("[[runs]]\nfile = \"runs/{trip}.csv\"\nrole = \"{role}\"\n");
    }
    std::fs::write(out.join("dataset.toml"), manifest)
}
