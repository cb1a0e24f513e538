//! Effects of a relevant size, at places where the train runs.

use dynocar_shared::vocabulary::EffectKind;

use super::common_deviations::wavy;
use super::effects::{TrueEffect, TrueMassSection, TrueRunWindow};
use super::line_maker::SimulatedLine;
use super::random::SimulatorRandom;
use super::run_maker::RunPlan;
use super::settings::TrainType;
use super::train_maker::{TrueTrain, rounded};
use super::unlisted::{Law, Unlisted};

/// Returns the types of train on which an effect of this kind shows.
pub fn suitable_types(kind: EffectKind) -> &'static [TrainType] {
    use TrainType::{Freight, HighSpeed, Metro, Regional};
    match kind {
        EffectKind::TunnelDrag => &[Regional, Metro, HighSpeed],
        EffectKind::CurveResistance => &[Freight, Regional, Metro],
        EffectKind::Wind => &[Regional, HighSpeed],
        EffectKind::MassChange => &[Freight, Regional, Metro],
        EffectKind::RotatingMass
        | EffectKind::ActuatorDelay
        | EffectKind::BrakeDelay
        | EffectKind::BrakeGain
        | EffectKind::SpeedDelay => &[Regional, Metro],
        EffectKind::LowAdhesion => &[Regional, Metro, HighSpeed],
        _ => &TrainType::ALL,
    }
}

/// Train and line for which effects are drawn.
#[derive(Clone, Copy, Debug)]
pub struct EffectScene<'a> {
    /// The train.
    pub train: &'a TrueTrain,
    /// The line.
    pub line: &'a SimulatedLine,
    /// The runs.
    pub plans: &'a [RunPlan],
}

impl EffectScene<'_> {
    /// Returns a resistance by any law outside the library.
    pub fn any_law(&self, duration_s: f64, random: &mut SimulatorRandom) -> TrueEffect {
        let sizes = (self.train.handling.speed_max_mps, self.train.ordinary_w0_n_per_kn());
        let degc = self.plans.iter().map(|plan| plan.temperature_degc);
        let warmest_degc = degc.fold(f64::NEG_INFINITY, f64::max);
        TrueEffect::Unlisted(Unlisted::draw(sizes, warmest_degc, duration_s, random))
    }

    /// Loads up to an eighth off between every two stations, another one in each direction.
    pub fn loads_by_stop(&self, random: &mut SimulatorRandom) -> TrueEffect {
        const MOST: f64 = 0.12;
        let mut sections = Vec::new();
        for direction in [1.0, -1.0] {
            sections.extend(self.line.stations_m.windows(2).map(|pair| TrueMassSection {
                from_m: pair[0],
                to_m: pair[1],
                direction,
                mass_factor: 1.0 + random.uniform(-MOST, MOST),
            }));
        }
        TrueEffect::MassChangeSections(sections)
    }

    /// About half of the fit runs and half of the holdout runs.
    fn some_runs(&self, random: &mut SimulatorRandom) -> Vec<usize> {
        let mut chosen = Vec::new();
        for is_holdout in [false, true] {
            let mut group: Vec<usize> = self
                .plans
                .iter()
                .filter(|plan| plan.is_holdout == is_holdout)
                .map(|plan| plan.number)
                .collect();
            let wanted = group.len().div_ceil(2);
            while group.len() > wanted {
                group.remove(random.integer(0, group.len() - 1));
            }
            chosen.extend(group);
        }
        chosen.sort_unstable();
        chosen
    }

    /// Returns the chainage in m among `count` random ones that most runs pass.
    fn busy_place_m(&self, margin_m: f64, count: usize, random: &mut SimulatorRandom) -> f64 {
        let passes = |place_m: f64| self.plans.iter().filter(|plan| plan.covers(place_m)).count();
        let candidates: Vec<f64> = (0..count)
            .map(|_| random.uniform(margin_m, self.line.length_m - margin_m).round())
            .collect();
        let mut best_m = candidates[0];
        for &candidate_m in &candidates[1..] {
            if passes(candidate_m) > passes(best_m) {
                best_m = candidate_m;
            }
        }
        best_m
    }

    /// One or two intervals that together are about a tenth of the line, apart from each other.
    fn sections(&self, random: &mut SimulatorRandom) -> Vec<(f64, f64)> {
        let length_m = self.line.length_m;
        let count = random.integer(1, 2);
        let each_m = (length_m * random.uniform(0.09, 0.14) / count as f64).round();
        let mut intervals_m: Vec<(f64, f64)> = Vec::new();
        while intervals_m.len() < count {
            let centre_m = self.busy_place_m(0.6 * each_m, 4, random);
            let interval_m = (centre_m - (0.5 * each_m).round(), centre_m + (0.5 * each_m).round());
            let is_apart = |other: &(f64, f64)| {
                interval_m.0 > other.1 + 1000.0 || other.0 > interval_m.1 + 1000.0
            };
            if intervals_m.iter().all(is_apart) {
                intervals_m.push(interval_m);
            }
        }
        intervals_m.sort_by(|one, other| one.0.total_cmp(&other.0));
        intervals_m
    }
}

/// Draws an effect of a kind; `None` for a kind that is no effect.
pub fn make_effect(
    kind: EffectKind,
    scene: &EffectScene<'_>,
    duration_s: f64,
    random: &mut SimulatorRandom,
) -> Option<TrueEffect> {
    let train = scene.train;
    let w0_n_per_kn = train.ordinary_w0_n_per_kn();
    Some(match kind {
        EffectKind::None => return None,
        EffectKind::TunnelDrag => TrueEffect::TunnelDrag { c_factor: random.uniform(1.4, 2.3) },
        EffectKind::CurveResistance => {
            TrueEffect::CurveResistance { k_n_per_kn_m: random.uniform(1100.0, 1900.0) }
        }
        EffectKind::Wind => TrueEffect::Wind {
            wind_plus_mps: random.sign() * random.uniform(3.5, 8.0),
            run_sd_mps: 0.8,
            gust_sd_mps: 0.7,
        },
        EffectKind::DraggingBrake => {
            dragging_brake(scene, duration_s, random.uniform(0.15, 0.35) * w0_n_per_kn, random)
        }
        EffectKind::WheelDiameter => TrueEffect::WheelDiameter {
            speed_scale: 1.0 + random.sign() * random.uniform(0.01, 0.025),
        },
        EffectKind::GradientShift => TrueEffect::GradientShift {
            shift_m: random.sign() * random.uniform(0.15, 0.4) * mean_gradient_length_m(scene),
        },
        EffectKind::GradientError => gradient_error(scene, random),
        EffectKind::MassChange => mass_change(scene, random),
        EffectKind::TractionGain => {
            TrueEffect::TractionGain { gain: 1.0 + random.sign() * random.uniform(0.03, 0.08) }
        }
        EffectKind::BrakeGain => {
            TrueEffect::BrakeGain { gain: 1.0 + random.sign() * random.uniform(0.08, 0.15) }
        }
        EffectKind::BrakeDelay => brake_delay(random),
        EffectKind::ActuatorDelay => TrueEffect::ActuatorDelay {
            delay_s: rounded(random.uniform(0.5, 1.6), 0.05),
            lag_s: random.uniform(0.4, 1.2),
        },
        EffectKind::SpeedDelay => speed_delay(random),
        EffectKind::RotatingMass => {
            let declared = train.declared.rotating_mass_factor;
            let off = random.sign() * random.uniform(0.03, 0.06);
            TrueEffect::RotatingMass { rotating_mass_factor: declared + off }
        }
        EffectKind::BearingTemperature => TrueEffect::BearingTemperature {
            delta_a_n_per_kn: random.uniform(0.3, 0.6) * w0_n_per_kn,
            tau_s: random.uniform(120.0, 350.0),
        },
        EffectKind::AmbientTemperature => TrueEffect::AmbientTemperature {
            w0_per_k: random.sign() * random.uniform(0.008, 0.016),
            reference_k: 288.15,
        },
        EffectKind::LocalResistance => TrueEffect::LocalResistance {
            extra_n_per_kn: random.uniform(0.6, 1.4) * w0_n_per_kn,
            intervals_m: scene.sections(random),
            runs: if random.chance(0.3) { scene.some_runs(random) } else { Vec::new() },
        },
        EffectKind::LowAdhesion => low_adhesion(scene, random),
        EffectKind::Unknown => TrueEffect::Unlisted(Unlisted {
            law: Law::Band {
                centre_mps: random.uniform(0.5, 0.75) * train.handling.speed_max_mps,
                width_mps: random.uniform(0.03, 0.05) * train.handling.speed_max_mps,
            },
            n_per_kn: random.uniform(0.6, 1.2) * w0_n_per_kn,
        }),
    })
}

fn mean_gradient_length_m(scene: &EffectScene<'_>) -> f64 {
    let entries = scene.line.track.gradient().map_or(1, |gradient| gradient.entries().len());
    scene.line.length_m / entries as f64
}

/// Valves that open late, and cylinders that fill and empty.
fn brake_delay(random: &mut SimulatorRandom) -> TrueEffect {
    TrueEffect::BrakeDelay {
        delay_s: rounded(random.uniform(0.0, 0.4), 0.05),
        lag_s: random.uniform(0.3, 1.5),
    }
}

/// Returns a bus that is late, a filter, or both; 0.4 to 1 s together.
fn speed_delay(random: &mut SimulatorRandom) -> TrueEffect {
    let late_s = random.uniform(0.4, 1.0);
    let share = random.pick(&[0.0, 0.5, 1.0]);
    TrueEffect::SpeedDelay { delay_s: share * late_s, lag_s: (1.0 - share) * late_s }
}

/// Three waves of 3 to 9 km, together about 1 ‰.
fn gradient_error(scene: &EffectScene<'_>, random: &mut SimulatorRandom) -> TrueEffect {
    let waves: Vec<[f64; 3]> = (0..3)
        .map(|_| {
            let wave_m = random.uniform(3000.0, 9000.0);
            [random.uniform(0.6, 1.1), wave_m, random.uniform(0.0, std::f64::consts::TAU)]
        })
        .collect();
    TrueEffect::GradientError { profile: wavy(&waves, scene.line.length_m) }
}

/// In half of the runs, from somewhere in their first half to the end.
fn dragging_brake(
    scene: &EffectScene<'_>,
    duration_s: f64,
    n_per_kn: f64,
    random: &mut SimulatorRandom,
) -> TrueEffect {
    let weight_kn = 9.81e-3 * scene.train.declared.mass_kg;
    let windows = scene
        .some_runs(random)
        .into_iter()
        .map(|run| {
            let start_s = (random.uniform(0.12, 0.4) * duration_s).round();
            TrueRunWindow { run, start_s, end_s: f64::INFINITY }
        })
        .collect();
    let residual_pressure_pa = if random.chance(0.5) { random.uniform(5e3, 9e3) } else { 0.0 };
    TrueEffect::DraggingBrake { force_n: n_per_kn * weight_kn, windows, residual_pressure_pa }
}

/// Between some neighbouring stations in one direction, or in half of the runs throughout.
fn mass_change(scene: &EffectScene<'_>, random: &mut SimulatorRandom) -> TrueEffect {
    let stations_m = &scene.line.stations_m;
    if scene.train.train_type == TrainType::Freight || stations_m.len() < 5 {
        let mass_factor = another_mass(random);
        let windows = scene
            .some_runs(random)
            .into_iter()
            .map(|run| (TrueRunWindow { run, start_s: 0.0, end_s: f64::INFINITY }, mass_factor))
            .collect();
        return TrueEffect::MassChangeWindows(windows);
    }
    let count = (stations_m.len() - 1).div_ceil(3);
    let first = random.integer(1, stations_m.len() - 1 - count);
    let sections = [1.0, -1.0].into_iter().map(|direction| TrueMassSection {
        from_m: stations_m[first],
        to_m: stations_m[first + count],
        direction,
        mass_factor: another_mass(random),
    });
    TrueEffect::MassChangeSections(sections.collect())
}

fn another_mass(random: &mut SimulatorRandom) -> f64 {
    1.0 + random.sign() * random.uniform(0.06, 0.13)
}

/// Rain in some runs along the whole line, or slippery approaches of some stations.
fn low_adhesion(scene: &EffectScene<'_>, random: &mut SimulatorRandom) -> TrueEffect {
    let handling = &scene.train.handling;
    // A fast train runs on for kilometres when the rail carries much less than asked.
    let (low, high) = match scene.train.train_type {
        TrainType::HighSpeed => (0.85, 0.97),
        _ => (0.6, 0.88),
    };
    let adhesion = random.uniform(low, high) * handling.braking_mps2 / 9.81;
    let runs = scene.some_runs(random);
    if random.chance(0.5) || scene.line.stations_m.len() < 5 {
        return TrueEffect::LowAdhesion { adhesion, intervals_m: Vec::new(), runs };
    }
    let reach_m = handling.speed_max_mps.powi(2) / (2.0 * handling.braking_mps2);
    let intervals_m = scene
        .line
        .stations_m
        .chunks(2)
        .map(|pair| ((pair[0] - reach_m).round(), (pair[0] + reach_m).round()))
        .collect();
    TrueEffect::LowAdhesion { adhesion, intervals_m, runs }
}
