//! The residual monitor over seeded simulations, fed sample by sample: the delay until it names an effect that begins
//! to act, the time for which it names one that does not act, and its false alarms.

use std::collections::BTreeMap;
use std::sync::Arc;

use clap::Args;
use dynocar::output::report_line;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};
use dynocar_tests::simulator::sensors::SIMULATED_TRAIN;
use dynocar_tests::simulator::true_run::{TRUE_STEP_S, TrueState};
use dynocar_tests::simulator::{SimulatedDataset, SimulatedRun, TrueEffect};
use serde_json::json;

use crate::explain::scenario::{ExplainScenario, FamilyArguments, SimulatedCase};
use crate::output::{BenchError, Record, counts, table};
use crate::rig::default_pipeline;
use crate::statistics::median;

/// The live monitor on every kind of undeclared effect, and on nulls: seconds of motion from onset
/// to the right suspect, hours with a wrong one, false suspicions in 100 hours.
#[derive(Debug, Args)]
pub struct MonitorArguments {
    #[command(flatten)]
    family: FamilyArguments,
}

impl MonitorArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such kind, or the result cannot be written.
    pub fn run(&self) -> Result<(), BenchError> {
        let family = &self.family;
        let watched = family.over(&family.scenarios(ExplainScenario::all())?, |case| {
            let watched = watch(&case.simulate());
            if family.verbose {
                print_case(case, &watched);
            }
            watched
        });
        let kinds: Vec<Record> = watched.iter().map(|(kind, own)| record(*kind, own)).collect();
        let nulls = || watched.iter().filter(|(kind, _)| kind.is_null()).flat_map(|it| &it.1);
        let hours = nulls().map(|it| it.driven_s).sum::<f64>() / 3600.0;
        let suspicions: usize = nulls().map(|it| it.false_suspicions().count()).sum();
        let per_100_h = 100.0 * suspicions as f64 / hours.max(f64::MIN_POSITIVE);
        let all = json!({
            "kinds": kinds,
            "null_hours": hours,
            "null_suspicions": suspicions,
            "per_100_h": per_100_h,
        });
        family.output.give(&all, || {
            let words = format!(
                "nothing undeclared: {suspicions} suspicions in {hours:.0} h of motion, \
                 {per_100_h:.2} in 100 h\n"
            );
            table(&kinds) + &words
        })
    }
}

/// Returns the record of one kind; times are of motion. Datasets are those in which it acts, or all nulls, which
/// are right where the monitor stayed silent.
fn record(scenario: ExplainScenario, all: &[Watched]) -> Record {
    let is_null = scenario.is_null();
    let watched: Vec<&Watched> = all.iter().filter(|it| is_null || it.has_acted).collect();
    let count = |is_so: &dyn Fn(&Watched) -> bool| watched.iter().filter(|it| is_so(it)).count();
    let hours = |of: fn(&Watched) -> f64| watched.iter().map(|it| of(it)).sum::<f64>() / 3600.0;
    let mut after_s: Vec<f64> = watched.iter().filter_map(|it| it.named_after_s).collect();
    after_s.sort_unstable_by(f64::total_cmp);
    let mut others = BTreeMap::new();
    for kind in watched.iter().flat_map(|it| it.false_suspicions()) {
        *others.entry(kind.name()).or_insert(0) += 1;
    }
    let is_silent = |it: &Watched| it.raised.is_empty();
    let is_right = |it: &Watched| if is_null { is_silent(it) } else { it.named_after_s.is_some() };
    let nine_of_ten = after_s.get((after_s.len() * 9).div_ceil(10).max(1) - 1).copied();
    Record::default()
        .with("kind", scenario.name())
        .with("right", format!("{}/{}", count(&is_right), watched.len()))
        .with("wrong", count(&|it| !is_right(it) && !is_silent(it)))
        .with("missed", count(&|it| !is_right(it) && is_silent(it)))
        .number("after s", median(after_s), 0)
        .number("90 % s", nine_of_ten, 0)
        .number("hours", hours(|it| it.driven_s), 1)
        .number("wrong h", hours(|it| it.wrong_s), 2)
        .with("others that led", counts(&others))
}

/// One dataset's suspicions on standard error.
fn print_case(case: &SimulatedCase, watched: &Watched) {
    let raised = watched.raised.iter().map(|(kind, s)| format!("{kind} at {s:.0} s"));
    let raised: Vec<String> = raised.collect();
    report_line(&format!(
        "{} seed {}: {} (wrong {:.0} s of {:.0})",
        case.scenario.name(),
        case.seed,
        if raised.is_empty() { "silent".into() } else { raised.join(", ") },
        watched.wrong_s,
        watched.driven_s
    ));
}

/// Speed in m/s below which a train shows little of any effect.
const MOVING_MPS: f64 = 2.0;
/// Ratio of acting to reported brake force below which the adhesion limits the force.
const CARRIED_SHARE: f64 = 0.9;
/// A longer step in s between samples is a gap, not driving.
const STEP_MAX_S: f64 = 5.0;

/// Statements of the monitor about a dataset; times are of motion.
#[derive(Clone, Debug, Default, PartialEq)]
struct Watched {
    /// The kinds that are undeclared.
    pub truth: Vec<EffectKind>,
    /// Time driven in s.
    pub driven_s: f64,
    /// Time in s from the first moment at which the effect acted until it was named, alone or
    /// among alternatives.
    pub named_after_s: Option<f64>,
    /// True when the effect ever acted.
    pub has_acted: bool,
    /// Suspicions in the order in which they were raised: the leading kind, and the time driven.
    pub raised: Vec<(EffectKind, f64)>,
    /// Time in s during which a suspicion stood that did not hold the effect.
    pub wrong_s: f64,
    /// The leading kind at the end.
    pub last: Option<EffectKind>,
}

/// The monitor as it stands after a sample.
struct Said {
    leading: Option<EffectKind>,
    holds_truth: bool,
}

impl Said {
    fn new(snapshot: &ParameterSnapshot, truth: &[EffectKind]) -> Said {
        let leading = EffectKind::from_number(snapshot.suspected_effect).expect("a known kind");
        let leading = Some(leading).filter(|&kind| kind != EffectKind::None);
        let others = snapshot.suspected_alternatives;
        let is_named = |kind: &EffectKind| leading == Some(*kind) || others & kind.bit() != 0;
        Said { leading, holds_truth: truth.iter().any(is_named) }
    }
}

/// Feeds all runs of a dataset to one monitor.
///
/// # Panics
///
/// When the monitor cannot be built with its default settings.
fn watch(data: &SimulatedDataset) -> Watched {
    let train = Arc::new(data.declared_train().clone());
    let track = Some(Arc::new(data.track().clone()));
    let kind = PipelineKind::ResidualMonitor;
    let mut pipeline = default_pipeline(kind, SIMULATED_TRAIN, &train, track);
    let truth: Vec<EffectKind> = data.effects.iter().map(|effect| effect.kind()).collect();
    let mut watched = Watched { truth: truth.clone(), ..Watched::default() };
    let mut acted_at_s = None;
    let mut sequence = 0;
    for run in &data.runs {
        let mut last_ns = None;
        for sample in &run.samples {
            sequence += 1;
            let said = Said::new(pipeline.process(&TrainSample { sequence, ..*sample }), &truth);
            watched.note_raised(&said);
            let step_s = driven_s(&mut last_ns, sample);
            watched.driven_s += step_s;
            if acted_at_s.is_none() && acts_at(data, run, sample) {
                acted_at_s = Some(watched.driven_s);
            }
            watched.note(&said, step_s, acted_at_s);
        }
    }
    watched.has_acted = acted_at_s.is_some();
    watched
}

/// Returns the time driven in s since the sample before.
fn driven_s(last_ns: &mut Option<i64>, sample: &TrainSample) -> f64 {
    let before_ns = last_ns.replace(sample.time_ns);
    let step_s = before_ns.map_or(0.0, |before_ns| (sample.time_ns - before_ns) as f64 * 1e-9);
    let is_driving = sample.speed_mps > MOVING_MPS && (0.0..STEP_MAX_S).contains(&step_s);
    if is_driving { step_s } else { 0.0 }
}

fn acts_at(data: &SimulatedDataset, run: &SimulatedRun, sample: &TrainSample) -> bool {
    let start_ns = run.samples[0].time_ns;
    let index = ((sample.time_ns - start_ns) as f64 * 1e-9 / TRUE_STEP_S).max(0.0) as usize;
    acts(data, run, &run.states[index.min(run.states.len() - 1)])
}

impl Watched {
    /// Returns the kinds that led a suspicion and do not act.
    fn false_suspicions(&self) -> impl Iterator<Item = EffectKind> {
        self.raised.iter().map(|(kind, _)| *kind).filter(|kind| !self.truth.contains(kind))
    }

    fn note_raised(&mut self, said: &Said) {
        if let Some(kind) = said.leading.filter(|_| said.leading != self.last) {
            self.raised.push((kind, self.driven_s));
        }
        self.last = said.leading;
    }

    fn note(&mut self, said: &Said, step_s: f64, acted_at_s: Option<f64>) {
        if said.leading.is_none() {
            return;
        }
        if !said.holds_truth {
            self.wrong_s += step_s;
        } else if let Some(acted_at_s) = acted_at_s {
            self.named_after_s.get_or_insert(self.driven_s - acted_at_s);
        }
    }
}

/// Returns whether any effect of a dataset acts in a state of one of its runs.
fn acts(data: &SimulatedDataset, run: &SimulatedRun, state: &TrueState) -> bool {
    let one = |effect: &TrueEffect| one_acts(effect, data, run, state);
    state.speed_mps > MOVING_MPS && data.effects.iter().any(one)
}

fn one_acts(
    effect: &TrueEffect,
    data: &SimulatedDataset,
    run: &SimulatedRun,
    state: &TrueState,
) -> bool {
    let (track, at_m) = (data.track(), state.position_m);
    let length_m = data.declared_train().length_m;
    let disturbances = &run.disturbances;
    match effect {
        TrueEffect::TunnelDrag { .. } => track.tunnel_share(at_m, length_m) > Some(0.0),
        TrueEffect::CurveResistance { .. } => track.curvature_per_m(at_m, length_m) > Some(0.0),
        TrueEffect::DraggingBrake { .. } => disturbances.drag_n(state.time_s) > 0.0,
        TrueEffect::MassChangeSections(_) | TrueEffect::MassChangeWindows(_) => {
            disturbances.effect_mass_factor(state.time_s, at_m) != 1.0
        }
        TrueEffect::LocalResistance { intervals_m, .. } => {
            let is_near = |&(from_m, to_m): &(f64, f64)| {
                (from_m - 0.5 * length_m..=to_m + 0.5 * length_m).contains(&at_m)
            };
            disturbances.local.is_some() && intervals_m.iter().any(is_near)
        }
        TrueEffect::LowAdhesion { .. } => {
            let carried_n = CARRIED_SHARE * state.reported.brake_force_n;
            disturbances.adhesion.is_some() && state.acting.brake_force_n < carried_n
        }
        _ => true,
    }
}
