//! Results of every scenario and pipeline, in numbers.

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::settings::SettingError;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Quantity, TrainId, Uncertain};
use nalgebra::{Matrix4, Vector4};

use super::bound::Bound;
use super::brake::Brake;
use super::scenario_train::{DriveMoment, ScenarioTrain};
use super::score::{Answer, COUNTS_MPS, QuantityScore, Scores};
use super::world::{LoadSource, Mistakes, Scenario, Traffic, World};
use crate::ending::{over_until_due, until_due};
use crate::output::Record;

/// Time in s of the first comparison of errors with the bound, and the factor from each time to the next.
const COMPARED_FIRST_S: f64 = 60.0;
const COMPARED_GROWTH: f64 = 1.35;
/// Quantities that are asked for.
const QUANTITIES: [Quantity; 2] = [Quantity::Resistance, Quantity::Mass];

/// A scenario with the names of its traffic and of its deviation.
pub type NamedScenario = ([String; 2], Scenario);

const TRAFFIC: [(&str, Traffic); 4] = [
    ("metro", Traffic::Metro),
    ("EMU", Traffic::Emu),
    ("freight", Traffic::Freight),
    ("high speed", Traffic::HighSpeed),
];

/// Usual rows: for each traffic each load, and the ordinary load with each other property varied.
pub fn scenarios() -> Vec<NamedScenario> {
    let of = |(name, traffic): (String, _)| {
        varied(traffic).map(|(what, scenario)| ([name.clone(), what.into()], scenario))
    };
    TRAFFIC.into_iter().map(|(name, traffic)| (name.to_owned(), traffic)).flat_map(of).collect()
}

/// Returns the rows of brakes: for a tram and each other traffic each brake, with a good and a poor map.
pub fn brakes() -> Vec<NamedScenario> {
    let mut all = Vec::new();
    for (name, traffic) in [("tram", Traffic::Tram)].into_iter().chain(TRAFFIC) {
        for map_std_permille in MAPS_PERMILLE {
            for (what, brake) in Brake::rows() {
                let scenario = Scenario { map_std_permille, brake, ..usual(traffic) };
                all.push(([name.into(), format!("{what}, map {map_std_permille} ‰")], scenario));
            }
        }
    }
    all
}

/// Standard deviations in ‰ of the map under the rows of brakes.
const MAPS_PERMILLE: [f64; 2] = [0.1, 0.5];

fn usual(traffic: Traffic) -> Scenario {
    let usual = Scenario {
        traffic,
        load: LoadSource::Weighed(20),
        jumps: false,
        rate_hz: 10,
        speed_noise_mps: 0.03,
        position_noise_m: 2.0,
        map_std_permille: 0.1,
        brake: Brake::AS_TOLD,
    };
    match traffic {
        Traffic::Tram => Scenario {
            load: LoadSource::Passengers,
            rate_hz: 20,
            speed_noise_mps: 0.008,
            position_noise_m: 0.5,
            ..usual
        },
        _ => usual,
    }
}

fn varied(traffic: Traffic) -> [(&'static str, Scenario); 10] {
    let usual = usual(traffic);
    let exact = Scenario { map_std_permille: 0.0, ..usual };
    let quiet = Scenario { speed_noise_mps: 0.0, position_noise_m: 0.0, ..exact };
    [
        ("load exact", Scenario { load: LoadSource::Exact, ..usual }),
        ("weighed 2 % wrong", usual),
        ("weighed 5 % wrong", Scenario { load: LoadSource::Weighed(50), ..usual }),
        ("load unknown", Scenario { load: LoadSource::Unknown, ..usual }),
        ("load changes at stops", Scenario { load: LoadSource::Changing, ..usual }),
        ("forces jump", Scenario { jumps: true, ..usual }),
        ("5 Hz", Scenario { rate_hz: 5, ..usual }),
        ("50 Hz", Scenario { rate_hz: 50, ..usual }),
        ("map exact", exact),
        ("free of noise", quiet),
    ]
}

/// Plan of the measurement.
pub struct Plan<'a> {
    /// The rows.
    pub scenarios: &'a [NamedScenario],
    /// The pipelines in each.
    pub kinds: &'a [PipelineKind],
    /// Drives for each.
    pub seeds: u64,
    /// The first seed.
    pub first_seed: u64,
    /// Hours of each drive.
    pub hours: f64,
    /// How large the mistakes are.
    pub mistakes: Mistakes,
    /// Rows at a time.
    pub threads: usize,
}

/// Measures everything: a row for each quantity that a pipeline answers in a scenario, over all drives.
///
/// # Errors
///
/// When a kind cannot be built.
pub fn run(plan: &Plan<'_>) -> Result<Vec<Record>, SettingError> {
    let of = |row| plan.kinds.iter().map(move |&kind| (row, kind));
    let cases: Vec<(&NamedScenario, PipelineKind)> = plan.scenarios.iter().flat_map(of).collect();
    let rows = over_until_due(&cases, plan.threads, |(row, kind)| measure(plan, row, *kind));
    Ok(rows.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// Returns the settings that a user of the scenario has: load and map are known exactly where they are.
fn settings(kind: PipelineKind, scenario: &Scenario) -> Option<EstimatorSettings> {
    let mut settings = EstimatorSettings::default_of(kind)?;
    if let EstimatorSettings::TrainKalman(own) = &mut settings {
        if scenario.load == LoadSource::Exact {
            own.mass_std_percent = 0.0;
        }
        own.gradient_std_permille = scenario.map_std_permille;
    }
    Some(settings)
}

fn measure(
    plan: &Plan<'_>,
    (names, scenario): &NamedScenario,
    kind: PipelineKind,
) -> Result<Vec<Record>, SettingError> {
    let Some(settings) = settings(kind, scenario) else { return Ok(Vec::new()) };
    let mut scores = QUANTITIES.map(|_| Vec::new());
    for seed in until_due(plan.first_seed..plan.first_seed + plan.seeds) {
        let world = World::draw(*scenario, plan.mistakes, seed);
        let train = Arc::new(world.declared.clone());
        let estimator = settings.build(&train)?;
        let pipeline = Pipeline::new(TrainId(1), 0, train, None, estimator);
        for (all, score) in scores.iter_mut().zip(driven(pipeline, world, plan.hours)) {
            all.push(score);
        }
    }
    let rows = QUANTITIES.iter().zip(&scores);
    let rows = rows.filter(|(it, scores)| settings.answers(**it) && !scores.is_empty());
    Ok(rows.map(|(quantity, scores)| record(plan, names, kind, *quantity, scores)).collect())
}

/// One drive.
fn driven(mut pipeline: Pipeline, world: World, hours: f64) -> [QuantityScore; 2] {
    let cycle_s = 1.0 / f64::from(world.scenario.rate_hz);
    let mut bound = (world.scenario.speed_noise_mps > 0.0).then(Bound::default);
    let mut next_s = COMPARED_FIRST_S;
    let mut drive = ScenarioTrain::new(world);
    let mut scores = QUANTITIES.map(|_| QuantityScore::default());
    for cycle in 0..(3600.0 * hours / cycle_s) as u64 {
        let (time_s, moment) = (cycle as f64 * cycle_s, drive.advance());
        if let Some(bound) = &mut bound {
            bound.see(drive.world(), &moment, cycle_s);
        }
        let snapshot = pipeline.process(&moment.sample);
        let answers = QUANTITIES.map(|quantity| answer(snapshot, quantity, &moment));
        let is_moving = moment.speed_mps >= COUNTS_MPS;
        // A mass is one at a standstill, too.
        let counts = [is_moving, is_moving || moment.is_standing];
        for ((score, answer), counts) in scores.iter_mut().zip(answers).zip(counts) {
            if counts {
                score.push(time_s, cycle_s, answer);
            }
        }
        scores[1].follow_stops(moment.is_standing, cycle_s, answers[1]);
        if !is_moving {
            continue;
        }
        if time_s >= next_s {
            next_s = COMPARED_GROWTH * time_s;
            let least = bound.as_mut().and_then(|it| it.covariance(drive.world()));
            let Some(least) = least else { continue };
            for ((score, answer), quantity) in scores.iter_mut().zip(answers).zip(QUANTITIES) {
                if let Some(answer) = answer {
                    score.compare(answer.error, least_deviation(&least, quantity, &moment));
                }
            }
        }
    }
    scores
}

/// Returns the resistance at the speed driven or the mass, if a snapshot may be used for it.
fn answer(
    snapshot: &ParameterSnapshot,
    quantity: Quantity,
    moment: &DriveMoment,
) -> Option<Answer> {
    if !snapshot.is_usable_for(quantity) {
        return None;
    }
    let (found, truth) = if quantity == Quantity::Resistance {
        let at = snapshot.resistance_at(moment.speed_mps)?;
        (Uncertain::new(at.w0_n_per_kn, at.w0_std_n_per_kn), moment.w0_n_per_kn)
    } else {
        let mass_t = snapshot.value(Parameter::Mass)?;
        (Uncertain::new(mass_t, snapshot.std(Parameter::Mass)?), 1e-3 * moment.mass_kg)
    };
    Some(Answer::of(found, truth, truth))
}

/// Returns the least relative deviation of a quantity by the bound of the drive.
fn least_deviation(bound: &Matrix4<f64>, quantity: Quantity, moment: &DriveMoment) -> f64 {
    let v = moment.speed_mps;
    let row = match quantity {
        Quantity::Resistance => Vector4::new(1.0, v, v * v, 0.0) / moment.w0_n_per_kn,
        _ => Vector4::new(0.0, 0.0, 0.0, 1.0),
    };
    row.dot(&(bound * row)).max(0.0).sqrt()
}

/// One quantity of one pipeline in one scenario; `error_over_bound` is that at some instants of the drives.
fn record(
    plan: &Plan<'_>,
    [traffic, condition]: &[String; 2],
    kind: PipelineKind,
    quantity: Quantity,
    scores: &[QuantityScore],
) -> Record {
    let all = Scores(scores);
    let coverage = Some(all.percent(|it| it.covered)).filter(|_| all.count(|it| it.usable) > 0);
    let wrong_s = scores.iter().map(|it| it.wrong_s).fold(0.0, f64::max);
    let hours = plan.hours * scores.len() as f64;
    Record::default()
        .with("traffic", traffic.as_str())
        .with("condition", condition.as_str())
        .with("pipeline", kind.name())
        .with("quantity", quantity.name())
        .with("seeds", scores.len())
        .with("first_seed", plan.first_seed)
        .number("usable_percent", all.usable_percent(), 1)
        .number("coverage_percent", coverage, 1)
        .number("usable_later_percent", all.usable_later_percent(), 1)
        .number("first_use_s", all.first_use_s(), 0)
        .number("known_again_s", all.known_again_s(), 1)
        .number("changes_per_h", all.count(|it| it.changes) as f64 / hours, 1)
        .number("longest_wrong_s", wrong_s, 1)
        .number("error_percent", all.rms_percent(|it| it.error_square), 2)
        .number("error_over_std", all.ratio(|it| it.error_square, |it| it.deviation_square), 2)
        .number("error_over_bound", all.ratio(|it| it.compared_square, |it| it.least_square), 2)
}
