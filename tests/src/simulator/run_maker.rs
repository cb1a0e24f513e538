//! The plan of the runs: direction, load, stops, weather and manner of driving.

use super::effects::run_file;
use super::line_maker::SimulatedLine;
use super::random::SimulatorRandom;
use super::settings::{SimulatorSettings, TrainType};
use super::train_maker::{TrueTrain, rounded};

/// How a driver drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivingStyle {
    /// Share of the speed limit aimed at.
    pub speed_share: f64,
    /// Share of the greatest traction used.
    pub traction_share: f64,
    /// Share of the ordinary deceleration used.
    pub braking_share: f64,
    /// Probability of coasting, instead of holding the speed, once it is reached.
    pub coasting_share: f64,
    /// Share of the speed that is lost in coasting before traction is taken again.
    pub coasting_band: f64,
    /// Time in s at a stop, at least; up to twice as long.
    pub dwell_s: f64,
}

/// One run before it is driven.
#[derive(Clone, Debug, PartialEq)]
pub struct RunPlan {
    /// Number of the run, from 0.
    pub number: usize,
    /// True when the run is set aside for scoring.
    pub is_holdout: bool,
    /// +1 while the chainage grows, -1 while it falls.
    pub direction: f64,
    /// True gross mass in kg.
    pub mass_kg: f64,
    /// Chainage in m of the train's centre at the start.
    pub start_m: f64,
    /// Chainages in m of the stops in order of travel; the run ends at the last.
    pub stops_m: Vec<f64>,
    /// Outside temperature in °C at the start.
    pub temperature_degc: f64,
    /// Manner of driving.
    pub style: DrivingStyle,
}

impl RunPlan {
    /// Returns the name of the run's file within a dataset.
    pub fn file(&self) -> String {
        run_file(self.number)
    }

    /// Declared gross mass in kg: the true one to 0.1 t.
    pub fn declared_mass_kg(&self) -> f64 {
        rounded(self.mass_kg, 100.0)
    }

    /// Returns whether the run passes or stops at a chainage in m.
    pub fn covers(&self, chainage_m: f64) -> bool {
        let end_m = self.stops_m.last().copied().unwrap_or(self.start_m);
        (self.start_m.min(end_m)..=self.start_m.max(end_m)).contains(&chainage_m)
    }
}

/// Draws the runs of a dataset: directions alternate, and the holdout runs have both.
pub fn make_plans(
    settings: &SimulatorSettings,
    train: &TrueTrain,
    line: &SimulatedLine,
    random: &mut SimulatorRandom,
) -> Vec<RunPlan> {
    let first_sign = random.sign();
    let holdouts = choose_holdouts(settings, random);
    let season_degc = random.uniform(2.0, 20.0);
    (0..settings.runs)
        .map(|number| {
            let is_first = number % 2 == 0 || settings.is_one_direction;
            let direction = if is_first { first_sign } else { -first_sign };
            let style = make_style(train.train_type, random);
            let (start_m, stops_m) =
                make_route(settings.duration_s, train, line, direction, &style, random);
            RunPlan {
                number,
                is_holdout: holdouts.contains(&number),
                direction,
                mass_kg: train.declared.mass_kg * random.uniform(0.95, 1.05),
                start_m,
                stops_m,
                temperature_degc: season_degc + random.uniform(-10.0, 10.0),
                style,
            }
        })
        .collect()
}

/// Runs of both directions in turn, never the first two.
fn choose_holdouts(settings: &SimulatorSettings, random: &mut SimulatorRandom) -> Vec<usize> {
    let mut holdouts: Vec<usize> = Vec::new();
    let count = settings.holdout_runs.min(settings.runs.saturating_sub(1));
    while holdouts.len() < count {
        let candidate = random.integer(settings.runs.min(3) - 1, settings.runs - 1);
        let wants_other_direction = holdouts.len() == 1 && settings.runs > 4;
        let is_other_direction = holdouts.first().is_none_or(|one| (one + candidate) % 2 == 1);
        if !holdouts.contains(&candidate) && (is_other_direction || !wants_other_direction) {
            holdouts.push(candidate);
        }
    }
    holdouts
}

fn make_style(train_type: TrainType, random: &mut SimulatorRandom) -> DrivingStyle {
    let (dwell_low_s, dwell_high_s) = match train_type {
        TrainType::Metro => (18.0, 30.0),
        _ => (20.0, 45.0),
    };
    DrivingStyle {
        speed_share: random.uniform(0.84, 0.99),
        traction_share: random.uniform(0.7, 1.0),
        braking_share: random.uniform(0.8, 1.15),
        coasting_share: random.uniform(0.2, 0.9),
        coasting_band: random.uniform(0.06, 0.18),
        dwell_s: random.uniform(dwell_low_s, dwell_high_s),
    }
}

/// Start and stops of a run of about `duration_s`.
fn make_route(
    duration_s: f64,
    train: &TrueTrain,
    line: &SimulatedLine,
    direction: f64,
    style: &DrivingStyle,
    random: &mut SimulatorRandom,
) -> (f64, Vec<f64>) {
    let places_m = match train.train_type {
        TrainType::Freight => signals_m(train, line, random),
        _ => line.stations_m.clone(),
    };
    let ordered_m: Vec<f64> =
        if direction > 0.0 { places_m } else { places_m.into_iter().rev().collect() };
    let skip_share = match train.train_type {
        TrainType::Freight => 0.7,
        TrainType::Regional => 0.12,
        TrainType::Metro => 0.03,
        TrainType::HighSpeed => 0.6,
    };
    // Stops are drawn for the whole line first, so that the start can be where enough is left.
    let is_stop: Vec<bool> = (0..ordered_m.len()).map(|_| !random.chance(skip_share)).collect();
    let leg_s = |from_m: f64, to_m: f64| leg_time_s(train, style, (to_m - from_m).abs());
    let left_s = |start: usize| leg_s(ordered_m[start], ordered_m[ordered_m.len() - 1]);
    let starts: Vec<usize> =
        (0..ordered_m.len() - 1).filter(|&k| k == 0 || left_s(k) > 0.95 * duration_s).collect();
    let start = random.pick(&starts);
    let mut stops_m = Vec::new();
    let mut spent_s = 15.0;
    let mut from_m = ordered_m[start];
    for k in start + 1..ordered_m.len() {
        let place_m = ordered_m[k];
        let with_leg_s = spent_s + leg_s(from_m, place_m);
        let is_end = with_leg_s >= duration_s || k + 1 == ordered_m.len();
        if is_stop[k] || is_end {
            stops_m.push(place_m);
            spent_s = with_leg_s + 1.5 * style.dwell_s;
            from_m = place_m;
        }
        if is_end {
            break;
        }
    }
    (ordered_m[start], stops_m)
}

/// Places where a freight train may have to stop: every kilometre or two.
fn signals_m(train: &TrueTrain, line: &SimulatedLine, random: &mut SimulatorRandom) -> Vec<f64> {
    let margin_m = 0.5 * train.declared.length_m + 80.0;
    let mut places_m = vec![margin_m + random.uniform(0.0, 1500.0)];
    loop {
        let next_m = places_m[places_m.len() - 1] + random.uniform(1300.0, 2600.0);
        if next_m > line.length_m - margin_m {
            return places_m;
        }
        places_m.push(next_m);
    }
}

/// Rough time in s for a leg between two stops.
fn leg_time_s(train: &TrueTrain, style: &DrivingStyle, leg_m: f64) -> f64 {
    let cruise_mps = 0.72 * style.speed_share * train.handling.speed_max_mps;
    let pull_mps2 = 0.55 * style.traction_share * train.traction_max_n(0.5 * cruise_mps)
        / train.declared.mass_kg;
    let braking_mps2 = style.braking_share * train.handling.braking_mps2;
    let lost_s = 0.5 * cruise_mps * (1.0 / pull_mps2 + 1.0 / braking_mps2);
    let reached_mps = cruise_mps.min((2.0 * leg_m / (1.0 / pull_mps2 + 1.0 / braking_mps2)).sqrt());
    if reached_mps < cruise_mps { 2.0 * leg_m / reached_mps } else { leg_m / cruise_mps + lost_s }
}
