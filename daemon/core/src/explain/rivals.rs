//! Kinds that could stand in the place of an accepted effect.

use dynocar_shared::vocabulary::EffectKind;

use super::evidence::Fit;
use super::selection::{AMBIGUOUS, EVIDENCE_MIN, Outcome, Trial};

/// A rival takes away this share of what the accepted effect does of the open-loop error.
const REDUCTION_SHARE: f64 = 0.7;

/// Kinds that could stand in the place of the effect accepted last.
///
/// Beside those that the runs could not tell from it whatever they showed, a rival explains the data as well, takes away about as much of the open-loop error, and has
/// nothing left to explain once the effect is in: what keeps its evidence acts beside the effect
/// and not in its place.
pub fn rivals(outcome: &Outcome) -> Vec<EffectKind> {
    let Some(accepted) = accepted_round(outcome) else { return Vec::new() };
    let Some(best) = accepted.iter().find(|trial| is_in(&outcome.fit, trial.kind)) else {
        return Vec::new();
    };
    let left = |kind: EffectKind| {
        let last = outcome.rounds.last().into_iter().flatten().find(|trial| trial.kind == kind);
        last.map_or(0.0, |trial| trial.evidence)
    };
    let twins = outcome.fit.model.effects.iter().flat_map(|effect| effect.twins());
    let mut kinds: Vec<EffectKind> =
        twins.copied().filter(|&twin| !is_in(&outcome.fit, twin)).collect();
    let close = accepted
        .iter()
        .filter(|trial| {
            !is_in(&outcome.fit, trial.kind)
                && trial.kind != EffectKind::Unknown
                && trial.evidence > EVIDENCE_MIN
                && trial.reduction > REDUCTION_SHARE * best.reduction
                && left(trial.kind) < 0.5 * trial.evidence
                && trial.advantage > best.advantage - AMBIGUOUS
        })
        .map(|trial| trial.kind);
    for kind in close {
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    kinds
}

/// Whether a model has an effect of a kind.
pub fn is_in(fit: &Fit, kind: EffectKind) -> bool {
    fit.model.effects.iter().any(|effect| effect.kind() == kind)
}

/// The last round that added an effect.
fn accepted_round(outcome: &Outcome) -> Option<&Vec<Trial>> {
    let count = outcome.fit.model.effects.len();
    count.checked_sub(1).and_then(|index| outcome.rounds.get(index))
}

/// What is known to separate the kinds that are easily confused.
pub fn separating_run(kind: EffectKind, rivals: &[EffectKind]) -> String {
    use EffectKind::{
        AmbientTemperature, BearingTemperature, CurveResistance, DraggingBrake, GradientError,
        GradientShift, LocalResistance, MassChange, RotatingMass, TractionGain, TunnelDrag,
        WheelDiameter, Wind,
    };
    let has = |wanted: EffectKind| kind == wanted || rivals.contains(&wanted);
    let pairs: [(EffectKind, EffectKind, &str); 12] = [
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
