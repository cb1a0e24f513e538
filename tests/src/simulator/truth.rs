//! Findings of a perfect explainer.

use dynocar_model::train::Davis;
use dynocar_shared::vocabulary::EffectKind;
use serde_json::{Value, json};

use super::SimulatedDataset;
use super::oracle::{OracleScore, score};

/// Speed in m/s above which a train counts as moving.
const MOVING_MPS: f64 = 0.5;

impl SimulatedDataset {
    /// Returns the verdict of `dynocar explain` that would be right.
    pub fn verdict(&self) -> &'static str {
        if self.effects.is_empty() {
            "none"
        } else if self.effects.iter().any(|effect| effect.kind() == EffectKind::Unknown) {
            "unknown"
        } else {
            "effect"
        }
    }

    /// Returns the mean size of the undeclared force over the mean ordinary resistance while moving; zero for
    /// effects that are no forces.
    pub fn extra_force_share(&self) -> f64 {
        let moving = || {
            let states = self.runs.iter().flat_map(|run| &run.states);
            states.filter(|state| state.speed_mps > MOVING_MPS)
        };
        let extra_n: f64 = moving().map(|state| state.resistance.extra_n.abs()).sum();
        let ordinary_n: f64 = moving().map(|state| state.resistance.ordinary_n).sum();
        extra_n / ordinary_n
    }

    /// Returns the truth as JSON: verdict, effects in the terms of `dynocar explain --json`, true
    /// resistance, the runs, and the error on the holdout runs of the declared model and of the
    /// true one.
    pub fn truth_json(&self) -> Value {
        let offset_s = self.settings.time_offset_s;
        json!({
            "seed": self.settings.seed,
            "train_type": self.train.train_type.name(),
            "verdict": self.verdict(),
            "effects": self.effects.iter().map(|effect| json!({
                "kind": effect.kind().name(),
                "parameters": effect.parameters(offset_s),
                "where": effect.place(offset_s),
            })).collect::<Vec<_>>(),
            "declared": davis_json(self.train.declared.resistance),
            "true_resistance": davis_json(self.train.resistance),
            "declared_rotating_mass_factor": self.train.declared.rotating_mass_factor,
            "extra_force_share": self.extra_force_share(),
            "time_offset_s": offset_s,
            "runs": self.runs.iter().map(|run| json!({
                "file": run.plan.file(),
                "role": if run.plan.is_holdout { "holdout" } else { "fit" },
                "direction": run.plan.direction,
                "mass_t": run.plan.mass_kg / 1000.0,
                "headwind_mps": run.disturbances.headwind_mps,
                "duration_s": run.states[run.states.len() - 1].time_s,
                "distance_m": run.states[run.states.len() - 1].distance_m,
                "speed_max_mps": run.states.iter().map(|s| s.speed_mps).fold(0.0, f64::max),
                "samples": run.samples.len(),
            })).collect::<Vec<_>>(),
            "oracle": oracle_json(&score(self)),
        })
    }
}

fn davis_json(davis: Davis) -> Value {
    json!({ "a": davis.a, "b": davis.b, "c": davis.c })
}

fn oracle_json(score: &OracleScore) -> Value {
    json!({
        "full_run": {
            "declared": score.full_run.declared_mps,
            "true_parameters": score.full_run.true_mps,
        },
        "window60": {
            "declared": score.window60.declared_mps,
            "true_parameters": score.window60.true_mps,
        },
    })
}
