//! Kinds that could stand in the place of an accepted effect.

use dynocar_shared::vocabulary::EffectKind;

use super::evidence::{EQUAL, Fit};
use super::selection::{Outcome, Trial};

/// A competing hypothesis takes away this share of what the accepted effect does of the open-loop error.
const ERROR_REDUCTION_SHARE: f64 = 0.7;

/// An accepted effect and the kinds that could stand in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct CompetingHypotheses {
    /// The kind that was accepted.
    pub accepted: EffectKind,
    /// The others.
    pub kinds: Vec<EffectKind>,
}

/// For each accepted effect that has some, the kinds that could stand in its place.
///
/// Beside those that the runs could not distinguish from it whatever they showed, a competing hypothesis explains the data as
/// well, takes away about as much of the open-loop error, and has nothing left to explain once the effect
/// is in: what keeps its evidence acts beside the effect and not in its place.
pub fn competing_hypotheses(outcome: &Outcome) -> Vec<CompetingHypotheses> {
    let effects = &outcome.fit.model.effects;
    let of = |accepted: EffectKind, tried: &[Trial], twins: &[EffectKind]| {
        let own = tried.iter().find(|trial| trial.kind == accepted);
        let close =
            tried.iter().filter(|trial| own.is_some_and(|own| comes_close(trial, own, outcome)));
        let mut kinds: Vec<EffectKind> = Vec::new();
        for kind in twins.iter().copied().chain(close.map(|trial| trial.kind)) {
            if !is_in(&outcome.fit, kind) && !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        CompetingHypotheses { accepted, kinds }
    };
    let named = effects.iter().filter(|effect| outcome.is_named(effect.kind()));
    let each = named.map(|effect| {
        let kind = effect.kind();
        let instead =
            outcome.instead.iter().find(|(stands, _)| effects.len() > 1 && *stands == kind);
        let first = outcome.rounds.first().map_or(&[][..], |round| &round[..]);
        of(kind, instead.map_or(first, |(_, tried)| tried), effect.twins())
    });
    each.filter(|competing| !competing.kinds.is_empty()).collect()
}

/// Whether a trial could stand in the place of the accepted one.
fn comes_close(trial: &Trial, accepted: &Trial, outcome: &Outcome) -> bool {
    let last = outcome.rounds.last().into_iter().flatten();
    let left = last.clone().find(|left| left.kind == trial.kind).map_or(0.0, |left| left.evidence);
    trial.kind != EffectKind::Unknown
        && trial.bic_gain > accepted.bic_gain - EQUAL
        && trial.reduction > ERROR_REDUCTION_SHARE * accepted.reduction
        && left < 0.5 * trial.evidence
}

/// Whether a model has an effect of a kind.
pub fn is_in(fit: &Fit, kind: EffectKind) -> bool {
    fit.model.effects.iter().any(|effect| effect.kind() == kind)
}

/// What would determine a kind that is one number of the train or the line.
pub fn informative_runs(kind: EffectKind) -> &'static str {
    use EffectKind::{
        AmbientTemperature, CurveResistance, GradientShift, MassChange, RotatingMass, TractionGain,
        TunnelDrag, WheelDiameter, Wind,
    };
    match kind {
        AmbientTemperature => "runs on colder and warmer days",
        Wind => "fast runs in both directions on one day",
        MassChange | RotatingMass | TractionGain => "harder accelerating and braking",
        WheelDiameter => "positions over several kilometres",
        CurveResistance => "more passes of the sharpest curves",
        TunnelDrag => "fast passes of the tunnels",
        GradientShift => "more passes of the steepest changes of gradient",
        _ => "more runs",
    }
}

/// What is known to separate the kinds that are easily confused.
pub fn separating_run(kind: EffectKind, competing: &[EffectKind]) -> String {
    use EffectKind::{
        ActuatorDelay, AmbientTemperature, BearingTemperature, CurveResistance, DraggingBrake,
        GradientError, GradientShift, LocalResistance, MassChange, RotatingMass, SpeedDelay,
        TractionGain, TunnelDrag, WheelDiameter, Wind,
    };
    let has = |wanted: EffectKind| kind == wanted || competing.contains(&wanted);
    let pairs: [(EffectKind, EffectKind, &str); 13] = [
        (
            GradientError,
            LocalResistance,
            "Drive the line in the other direction: a gradient changes its sign there.",
        ),
        (
            MassChange,
            TractionGain,
            "Coast down a known gradient: a mass is felt there, a gain is not.",
        ),
        (
            MassChange,
            RotatingMass,
            "Pass a steep gradient at other loads: the rotating mass does not feel it.",
        ),
        (
            RotatingMass,
            TractionGain,
            "Compare accelerating with braking: a gain acts on traction only.",
        ),
        (RotatingMass, WheelDiameter, "Compare the odometer with balises over several kilometres."),
        (
            ActuatorDelay,
            SpeedDelay,
            "Record a position of its own (GNSS, balises) on steep and changing gradients: the line acts \
             at once on a train, a late speed shows it late.",
        ),
        (TunnelDrag, Wind, "Pass the portals in both directions and on another day."),
        (TunnelDrag, LocalResistance, "Pass the place at clearly different speeds."),
        (
            CurveResistance,
            GradientShift,
            "Pass the curves in both directions: a gradient changes its sign.",
        ),
        (
            DraggingBrake,
            BearingTemperature,
            "Read the brake-cylinder pressure while released, and let the train run on.",
        ),
        (
            DraggingBrake,
            LocalResistance,
            "Pass the place in further runs: a place stays, a brake moves with its train.",
        ),
        (
            DraggingBrake,
            AmbientTemperature,
            "Read the brake-cylinder pressure while released, and record runs on a mild day.",
        ),
        (
            AmbientTemperature,
            BearingTemperature,
            "Start warm on a cold day and cold on a warm one.",
        ),
    ];
    pairs
        .iter()
        .find(|(one, other, _)| has(*one) && has(*other))
        .map_or("Drive again with other speeds, loads, directions and weather.", |pair| pair.2)
        .into()
}
