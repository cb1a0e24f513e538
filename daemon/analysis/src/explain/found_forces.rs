//! Corrections of the recorded forces, which are estimated before the search for undeclared effects.
//!
//! The efficiency of a drive whose recording has its power and not its force is a scale that the runs determine through
//! the mass. It acts one way when the drive pulls and the other way when it brakes, and so do the auxiliaries: their
//! estimates hold for the declared mass.
//!
//! A recorder that averages over the second before its time stamp, or stamps late, holds forces that act before their
//! stamps; in recordings with one sample per second this costs as much error as all other causes together. A force that
//! acts after its stamp is an actuator's delay, for which the search looks.

use std::sync::Arc;

use dynocar_model::terms::Parameter;
use dynocar_model::train::PowerTrain;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::answer::{DriveAnswer, ExplainAnswer, WithStd};
use super::effects::{AtBound, Hypothesis, Nature, On};
use super::evidence::{FitProblem, RunData, SampleForces, UpdatedModel};
use super::selection::{EFFECT_FORM_SHARE, OBSERVATIONS_MIN, deviations};
use crate::dataset::{is_stamped_late, stamped_late};
use crate::statistics::{rms, share_of};

/// Efficiency, and the power in kW that auxiliaries take while the train drives, above their power at rest.
const DRIVE: [Parameter; 2] = [
    Parameter::new(
        "efficiency",
        (*PowerTrain::EFFICIENCIES.start(), *PowerTrain::EFFICIENCIES.end()),
        0.005,
    ),
    Parameter::new("auxiliary_power_kw", (-2000.0, 2000.0), 0.1),
];
/// Speed in m/s below which a drive takes no power.
const RESTING_MPS: f64 = 0.05;
/// Samples at rest from which the auxiliary power is known.
const RESTING_MIN: usize = 30;
/// Least difference, as a share, between the auxiliary power of a moving drive and that at rest.
const DRIVING_SHARE: f64 = 0.25;

/// Auxiliary power in kW before the runs have driven.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Auxiliaries {
    power_kw: f64,
    std_kw: f64,
}

impl Auxiliaries {
    /// Returns the power at rest of some runs and its scatter; the declared one with a wide one where they
    /// never rest.
    fn new(powered: &[&RunData], declared: PowerTrain) -> Self {
        let rows = powered.iter().filter_map(|run| Some((run, run.power.as_ref()?)));
        let resting_kw: Vec<f64> = rows
            .flat_map(|(run, power)| run.samples().iter().zip(&power.power_w))
            .filter(|(sample, power_w)| sample.speed_mps < RESTING_MPS && power_w.is_finite())
            .map(|(_, power_w)| 1e-3 * power_w)
            .collect();
        if resting_kw.len() < RESTING_MIN {
            let power_kw = 1e-3 * declared.auxiliary_power_w;
            return Auxiliaries { power_kw, std_kw: DRIVE[1].upper };
        }
        let at = |share: f64| share_of(&resting_kw, share);
        let power_kw = at(0.5).max(0.0);
        let scatter_kw = 0.5 * (at(0.84) - at(0.16));
        Auxiliaries { power_kw, std_kw: scatter_kw.hypot(DRIVING_SHARE * power_kw).max(0.1) }
    }
}

/// Effect of one constant efficiency on the auxiliaries, since a drive's efficiency differs between light and full
/// load by some hundredths: standard deviation as a share of the drive's root mean square power.
const AUXILIARIES_FORM_SHARE: f64 = 0.02;

/// Returns the root mean square of the power in kW of moving samples.
fn moving_power_kw(problem: &FitProblem) -> f64 {
    let rows = problem.runs.iter().filter_map(|run| Some((run, run.power.as_ref()?)));
    let moving = rows
        .flat_map(|(run, power)| run.samples().iter().zip(&power.power_w))
        .filter(|(sample, power_w)| sample.speed_mps > RESTING_MPS && power_w.is_finite());
    1e-3 * rms(&moving.map(|(_, power_w)| *power_w).collect::<Vec<f64>>())
}

/// A drive with an efficiency, and auxiliaries where the power holds them, for unknown.
#[derive(Debug)]
struct OpenDrive {
    declared: PowerTrain,
    /// Auxiliary power at rest, where the power includes it.
    resting: Option<Auxiliaries>,
    prior: DMatrix<f64>,
}

impl OpenDrive {
    fn new(declared: PowerTrain, resting: Option<Auxiliaries>) -> Self {
        let weights = match resting {
            Some(resting) => vec![0.0, resting.std_kw.powi(-2)],
            None => vec![0.0],
        };
        OpenDrive { declared, resting, prior: DMatrix::from_diagonal(&weights.into()) }
    }

    fn at(&self, parameters: &[f64]) -> PowerTrain {
        let auxiliary_power_w = match (self.resting, parameters.get(1)) {
            (Some(resting), Some(more_kw)) => 1e3 * (resting.power_kw + more_kw),
            _ => self.declared.auxiliary_power_w,
        };
        PowerTrain { efficiency: parameters[0], auxiliary_power_w, ..self.declared }
    }

    fn start(&self) -> Vec<f64> {
        let all = [self.declared.efficiency, 0.0];
        all[..self.parameters().len()].to_vec()
    }
}

impl Hypothesis for OpenDrive {
    fn nature(&self) -> Nature<'_> {
        let parameters = if self.resting.is_some() { &DRIVE[..] } else { &DRIVE[..1] };
        Nature {
            // A drive without losses.
            none: 1.0,
            // The auxiliary power at rest limits the one while driving.
            prior: Some(&self.prior),
            // The kind that it would be taken for.
            ..Nature::new(EffectKind::TractionGain, parameters)
        }
    }

    fn at_bound(&self, parameters: &[f64]) -> Option<AtBound> {
        let spec = &DRIVE[0];
        // The upper bound is a drive without losses: power that is recorded at the wheels.
        let is_low = parameters[0] - spec.lower < spec.step;
        is_low.then_some(AtBound { name: spec.name, bound: spec.lower })
    }

    fn touches(&self, _parameter: usize, run: &RunData) -> bool {
        run.power.is_some()
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let Some(power) = &run.power else { return };
        let drive = self.at(parameters);
        let rows = power.power_w.iter().zip(run.samples()).skip(first);
        for (force, (&power_w, sample)) in forces.iter_mut().zip(rows) {
            let more = drive.beyond_n(self.declared, power_w, sample.speed_mps);
            let Some([traction_n, brake_n]) = more else { continue };
            force.traction_n += traction_n;
            if power.is_brake {
                force.brake_n += brake_n;
            }
        }
    }
}

/// A drive as the runs show it.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedDrive {
    /// With the findings.
    pub drive: PowerTrain,
    /// The same for machines.
    pub answer: DriveAnswer,
}

/// Returns the efficiency of a train's drive, which may be declared, as estimated from runs that record its power;
/// `None` where no force comes from power, or too little is driven to estimate it.
pub fn estimated_drive(
    problem: &FitProblem,
    declared: Option<PowerTrain>,
) -> Option<EstimatedDrive> {
    let powered: Vec<&RunData> = problem.runs.iter().filter(|run| run.power.is_some()).collect();
    if powered.is_empty() {
        return None;
    }
    let drive = declared.unwrap_or(PowerTrain::USUAL);
    let holds_more = |run: &&RunData| run.power.as_ref().is_some_and(|it| it.has_auxiliaries);
    let resting = powered.iter().any(holds_more).then(|| Auxiliaries::new(&powered, drive));
    let open = Arc::new(OpenDrive::new(drive, resting));
    let model = UpdatedModel::default().with(open.clone());
    let fit = problem.fit_from_declared(&model, &open.start());
    if fit.observations() < OBSERVATIONS_MIN {
        return None;
    }
    let deviation = deviations(&fit).std;
    let found = fit.effect_parameters(0);
    let at = open.at(found);
    let form_kw = AUXILIARIES_FORM_SHARE * moving_power_kw(problem);
    let at_bound = open.at_bound(found).map(|at| at.name);
    let answer = DriveAnswer {
        efficiency: WithStd {
            value: at.efficiency,
            std: deviation[3].hypot(EFFECT_FORM_SHARE * at.efficiency),
        },
        auxiliary_power_kw: open.resting.map(|_| WithStd {
            value: 1e-3 * at.auxiliary_power_w,
            std: deviation[4].hypot(form_kw),
        }),
        declared_efficiency: declared.map(|drive| drive.efficiency),
        at_bound,
    };
    // A value at a bound is not identified.
    let drive = if at_bound.is_some() { open.declared } else { at };
    Some(EstimatedDrive { drive, answer })
}

impl DriveAnswer {
    /// Returns the estimate as a sentence to follow another.
    pub fn sentence(&self) -> String {
        let WithStd { value, std } = self.efficiency;
        let read = match self.declared_efficiency {
            Some(declared) => format!("declared {declared}"),
            None => format!("{} is usual", PowerTrain::USUAL.efficiency),
        };
        if let Some(name) = self.at_bound {
            return format!(
                " The force comes from power, and these runs do not determine the drive's efficiency \
                 ({name} at its bound; {read}): it stays."
            );
        }
        let auxiliaries = self.auxiliary_power_kw.map_or(String::new(), |estimated| {
            format!(
                " and {:.1} ± {:.1} kW for what is fed beside it",
                estimated.value,
                HALF_95 * estimated.std
            )
        });
        format!(
            " The force comes from power, at an efficiency of {value:.3} ± {:.3} ({read}){auxiliaries}, \
             for the declared mass: of a mass that is 1 % off, so is the efficiency.",
            HALF_95 * std
        )
    }
}

/// Where the samples are nearer in time than this in s, a late stamp is left to each run's own small delay.
const STEP_MIN_S: f64 = 0.5;
/// A lateness below this share of the step between samples is left to it as well.
const LATE_SHARE_MIN: f64 = 0.1;

/// Time in s by which forces act before their stamps.
const LATENESS: [Parameter; 1] = [Parameter::new("force_late_s", (-1.0, 1.0), 0.02)];

/// Forces that act before their stamps (after them, where negative), along straight lines between
/// the samples.
#[derive(Debug)]
struct LateStamps;

impl Hypothesis for LateStamps {
    fn nature(&self) -> Nature<'_> {
        Nature::new(EffectKind::ActuatorDelay, &LATENESS)
    }

    /// No other effect acts before this one: the forces around a sample are the declared ones.
    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let (late_s, time_s) = (parameters[0], run.recording.time_s());
        for (i, force) in (first..).zip(forces) {
            let other = if late_s >= 0.0 { i + 1 } else { i.wrapping_sub(1) };
            let Some(ahead) = run.declared.get(other) else { continue };
            let step_s = (time_s[other] - time_s[i]).abs();
            let at = |own, ahead| stamped_late(own, ahead, step_s, late_s.abs());
            force.traction_n = at(force.traction_n, ahead.traction_n);
            force.brake_n = at(force.brake_n, ahead.brake_n);
        }
    }
}

/// Returns whether samples `step_s` apart leave the time of the forces open.
pub fn is_time_sought(step_s: f64) -> bool {
    step_s >= STEP_MIN_S
}

/// Returns by how many s runs with samples `step_s` apart stamp forces late; `None` where the forces act after their
/// stamps, or where it is not identifiable.
pub fn estimated_lateness(problem: &FitProblem, step_s: f64) -> Option<WithStd> {
    let model = UpdatedModel::default().with(Arc::new(LateStamps));
    let fit = problem.fit_from_declared(&model, &[0.0]);
    if fit.observations() < OBSERVATIONS_MIN {
        return None;
    }
    let deviation = deviations(&fit).std;
    let late = WithStd { value: fit.effect_parameters(0)[0], std: deviation[3] };
    let is_inside = LateStamps.at_bound(&[late.value]).is_none();
    let counts = late.value > LATE_SHARE_MIN * step_s && is_inside;
    (counts && is_stamped_late(late.value, late.std)).then_some(late)
}

/// Corrections of the forces that were found before the search.
pub struct FoundForces {
    /// The drive, where its power is recorded.
    pub drive: Option<EstimatedDrive>,
    /// Time in s by which the forces act before their stamps.
    pub late: Option<WithStd>,
}

impl FoundForces {
    /// States them in an answer.
    pub fn add_to(self, answer: &mut ExplainAnswer) {
        if let Some(estimated) = self.drive {
            answer.add_caveat(&estimated.answer.sentence());
            answer.drive = Some(estimated.answer);
        }
        if let Some(late) = self.late {
            answer.add_caveat(&format!(
                " Forces act {:.2} ± {:.2} s before their stamps and were taken where they act.",
                late.value,
                HALF_95 * late.std
            ));
            answer.force_late_s = Some(late);
        }
    }
}
