//! Response of a model to one run, and its derivatives; unchanged parts are not computed again.
//!
//! Effects that act on the forces together cost passes over the samples. Where there is only one on a run and the
//! forces are affine in it, two passes serve for all its parameters. Where there are several, a slope serves as far as
//! the step over which it was taken.

mod columns;

use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;

use super::super::integral::Response;
use super::super::integral::integrate_bins;
use super::super::model::UpdatedForces;
use super::super::run_data::RunData;
use super::plan::{At, Plan};
use crate::explain::hypothesis::{Handling, SharedHypothesis};

/// Speed in m/s at which a, b and c are compared, and the share of the resistance that does not change a slope.
const USUAL_MPS: f64 = 20.0;
const NEAR_SHARE: f64 = 0.05;

/// Values at some parameters, shared by models.
type Known<T> = Arc<(Vec<f64>, T)>;

/// Computed values of one run, for one model.
#[derive(Clone, Default)]
pub(super) struct RunMemory {
    together: Together,
    /// Slopes for each parameter of the effects that act together, with a, b, c and the parameters at which they were
    /// taken.
    slopes: Option<Known<Vec<Vec<f64>>>>,
    /// By effect: parameters but the first, and the bins for a first one of 1 above none.
    added: Vec<Option<Known<Vec<f64>>>>,
    /// By parameter of gradients: the bins for one of 1; empty where it does not touch the run.
    gradients: Vec<Option<Arc<Vec<f64>>>>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Room to work in.
#[derive(Default)]
struct Scratch {
    forces: UpdatedForces,
    moved: [UpdatedForces; 2],
    /// At each sample.
    samples: Vec<f64>,
    by_permille: Vec<f64>,
    slopes: Vec<Vec<f64>>,
}

/// Response of the effects that act together.
#[derive(Clone, Default)]
enum Together {
    #[default]
    Unknown,
    /// No effect acts: the declared forces stay.
    Nothing,
    /// Response at no effect, and its change with each parameter's affine coordinate.
    Affine { at: Response, none: Arc<Response>, slopes: Arc<Vec<Option<Response>>> },
    /// Response at some of their parameters.
    At(Vec<f64>, Arc<Response>),
}

impl RunMemory {
    /// Returns the computed values for a model with more effects, as far as these change nothing of them.
    pub fn of_grown(
        memories: &[RunMemory],
        runs: &[RunData],
        plan: &Plan,
        grown: &Plan,
    ) -> Vec<RunMemory> {
        let of_run = |(memory, run): (&RunMemory, &RunData)| match plan.serves(grown, run) {
            true => memory.clone(),
            false => RunMemory::default(),
        };
        memories.iter().zip(runs).map(of_run).collect()
    }

    /// The modelled speeds at the bins.
    pub fn predict(&mut self, at: At, bins: &mut Vec<f64>) {
        self.act_together(at);
        self.response(at.declared).bins(at.davis(), bins);
        self.add(at, at.plan.model.scale_of_added(at.theta), bins);
    }

    /// Adds the effects that only add a resistance or a gradient, times a factor.
    fn add(&mut self, at: At, scale: f64, bins: &mut [f64]) {
        for (number, effect, range) in at.plan.handled(Handling::Added) {
            let first = scale * (at.theta[range.start] - effect.none());
            let unit = self.added_bins(at, number);
            bins.iter_mut().zip(unit).for_each(|(bin, unit)| *bin += first * unit);
        }
        for (number, _, range) in at.plan.handled(Handling::Gradient) {
            for (parameter, value) in at.theta[range].iter().enumerate() {
                let unit = self.gradient_bins(at, number, parameter);
                bins.iter_mut().zip(unit).for_each(|(bin, unit)| *bin += scale * value * unit);
            }
        }
    }

    fn response<'r>(&'r self, declared: &'r Response) -> &'r Response {
        match &self.together {
            Together::At(_, response) => response,
            Together::Affine { at: response, .. } => response,
            Together::Nothing | Together::Unknown => declared,
        }
    }

    /// Computes the response of the effects that act together, where it has changed.
    fn act_together(&mut self, at: At) {
        let At { plan, run, theta, .. } = at;
        if matches!(self.together, Together::Unknown) {
            if plan.acting(run).next().is_none() {
                self.together = Together::Nothing;
            } else if let Some((effect, range, _)) = plan.affine(run) {
                self.together = with_scratch(|it| affine(at, effect, range, &mut it.forces));
            }
        }
        match &mut self.together {
            Together::Nothing => {}
            Together::Affine { at: response, none, slopes } => {
                let Some((effect, range, affine_in)) = plan.affine(run) else { return };
                response.clone_from(none);
                for (value, slope) in theta[range].iter().zip(&slopes[..]) {
                    if let Some(slope) = slope {
                        response.add(affine_in(*value) - affine_in(effect.none()), slope);
                    }
                }
            }
            Together::At(known, _)
                if plan.together(run).map(|i| theta[i]).eq(known.iter().copied()) => {}
            Together::At(known, response) => {
                known.clear();
                known.extend(plan.together(run).map(|i| theta[i]));
                *response = reckon(at).into();
            }
            Together::Unknown => {
                let known = plan.together(run).map(|i| theta[i]).collect();
                self.together = Together::At(known, reckon(at).into());
            }
        }
    }

    /// The bins for a first parameter of 1 of an effect that only resists.
    fn added_bins(&mut self, at: At, number: usize) -> &[f64] {
        let range = at.plan.ranges[number].clone();
        let others = &at.theta[range.start + 1..range.end];
        self.added.resize_with(at.plan.handlings.len(), || None);
        if self.added[number].as_ref().is_none_or(|added| added.0 != others) {
            let mut bins = Vec::new();
            Self::resist(at, &at.plan.model.effects[number], others, &mut bins);
            self.added[number] = Some(Arc::new((others.to_vec(), bins)));
        }
        self.added[number].as_ref().map_or(&[], |added| &added.1)
    }

    fn resist(at: At, effect: &SharedHypothesis, others: &[f64], bins: &mut Vec<f64>) {
        with_scratch(|Scratch { samples, .. }| {
            effect.unit_n_per_kn(others, at.run, samples);
            let unit_mps2 = at.unit_mps2();
            integrate_bins(at.run, |i| [-unit_mps2 * samples[i]], [bins]);
        });
    }

    /// The bins for one of a gradient's parameters at 1; none where it does not touch the run.
    fn gradient_bins(&mut self, at: At, number: usize, parameter: usize) -> &[f64] {
        let i = at.plan.ranges[number].start + parameter;
        self.gradients.resize(at.theta.len(), None);
        if self.gradients[i].is_none() {
            let effect = &at.plan.model.effects[number];
            let mut bins = Vec::new();
            if effect.touches(parameter, at.run) {
                let unit_mps2 = at.unit_mps2();
                with_scratch(|Scratch { samples, .. }| {
                    effect.gradient_permille(parameter, at.run, samples);
                    integrate_bins(at.run, |i| [-unit_mps2 * samples[i]], [&mut bins]);
                });
            }
            self.gradients[i] = Some(Arc::new(bins));
        }
        self.gradients[i].as_ref().map_or(&[], |bins| &bins[..])
    }
}

/// Works with this thread's room, which nothing else does meanwhile.
fn with_scratch<T>(work: impl FnOnce(&mut Scratch) -> T) -> T {
    SCRATCH.with_borrow_mut(work)
}

/// Response of the effects that act together.
fn reckon(At { plan, run, theta, .. }: At) -> Response {
    let (acts, mut response) = (plan.acts_together(run), Response::default());
    with_scratch(|it| plan.model.response((run, theta), acts, &mut it.forces, &mut response));
    response
}

/// Returns whether parameters lie within a step of others, and a, b, c within a small share: a slope is a difference
/// over a step, and no other so near.
fn is_near(at: &[f64], known: &[f64], steps: &[f64]) -> bool {
    let resistance =
        |of: [f64; 3]| of[0].abs() + USUAL_MPS * (of[1].abs() + USUAL_MPS * of[2].abs());
    let davis = |of: &[f64]| [of[0], of[1], of[2]];
    let away = std::array::from_fn(|i| known[i] - at[i]);
    let mut moved = at[3..].iter().zip(&known[3..]).zip(steps);
    resistance(away) <= NEAR_SHARE * resistance(davis(at))
        && moved.all(|((at, known), step)| (known - at).abs() <= step.abs())
}

/// The response of a run to one effect in which the forces are affine.
fn affine(
    at: At,
    effect: &SharedHypothesis,
    range: Range<usize>,
    forces: &mut UpdatedForces,
) -> Together {
    let At { plan, run, theta, .. } = at;
    let mut elsewhere = theta.to_vec();
    elsewhere[range.clone()].fill(effect.none());
    let mut none = Response::default();
    plan.model.response((run, &elsewhere), plan.acts_together(run), forces, &mut none);
    let slope = |(parameter, i): (usize, usize)| {
        let spec = &effect.parameters()[parameter];
        // As far away as possible, where rounding matters least.
        let is_upper = spec.upper - effect.none() > effect.none() - spec.lower;
        let far = if is_upper { spec.upper } else { spec.lower };
        effect.touches(parameter, run).then(|| {
            elsewhere[i] = far;
            let mut slope = Response::default();
            plan.model.response((run, &elsewhere), plan.acts_together(run), forces, &mut slope);
            elsewhere[i] = effect.none();
            let affine_in = effect.nature().affine_in.unwrap_or(|it| it);
            slope.become_slope_from(&none, affine_in(far) - affine_in(effect.none()));
            slope
        })
    };
    let slopes = range.enumerate().map(slope).collect::<Vec<_>>().into();
    Together::Affine { at: none.clone(), none: none.into(), slopes }
}
