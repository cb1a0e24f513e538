//! A force of a form of its own, as a fit knows it.

use dynocar_shared::vocabulary::EffectKind;

use super::OUTSIDE_COST;
use crate::explain::answer::{CovariateRange, ParameterValue, Place};
use crate::explain::effects::{Candidate, Hypothesis, ReportContext, Reported};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;
use crate::terms::extra::{self, Covariate, Extra, FORCE_MAX_N_PER_KN, Factor, Form};
use crate::terms::{Entry, Parameter};

/// A force counts from this size in N/kN on.
const LEAST_N_PER_KN: f64 = 0.1;
/// A force lives where it is at least this share of its greatest.
const LIVES_SHARE: f64 = 0.1;

/// The structure: which factors, and which of their numbers are fitted.
#[derive(Clone, Debug)]
pub struct FormForce {
    /// Factors with the numbers that they start from.
    factors: Vec<Factor>,
    /// The size and the numbers that are fitted.
    parameters: Vec<Parameter>,
    /// Factor and number of each that is fitted, after the size.
    fitted: Vec<(usize, usize)>,
    /// Greatest product of the factors over the fit runs.
    greatest: f64,
    place: Place,
    choice_cost: f64,
}

/// Numbers of a form that are fitted, with their bounds for a covariate over the range from `low`
/// to `high`; below `least` there are too few data to tell anything.
fn fitted_numbers(form: Form, [least, low, high]: [f64; 3]) -> Vec<(usize, (f64, f64))> {
    let width = high - low;
    match form {
        Form::Power => vec![(1, (0.1, 5.0))],
        Form::Hyperbola => {
            // Runs that are never slow hold no low least.
            let least_bounds = (least, (0.3 * high).max(1.5 * least));
            vec![(0, (0.05 * high, 3.0 * high)), (1, least_bounds)]
        }
        Form::Above | Form::Below => vec![(0, (low, high))],
        // Their value jumps: they are sought, not fitted.
        Form::Between | Form::From | Form::UpTo => Vec::new(),
        Form::Decay => vec![(0, (0.02 * high, 3.0 * high))],
        Form::Bell => vec![(0, (low, high)), (1, (0.01 * width, 0.6 * width))],
    }
}

/// The name of a number in the answer; that of the second factor says so.
fn named(factor: usize, name: &'static str) -> &'static str {
    match (factor, name) {
        (0, name) => name,
        (_, "at") => "second_at",
        (_, "exponent") => "second_exponent",
        (_, "below") => "second_below",
        (_, "least") => "second_least",
        (_, "from") => "second_from",
        (_, "until") => "second_until",
        (_, "over") => "second_over",
        (_, "width") => "second_width",
        (_, other) => other,
    }
}

impl FormForce {
    /// A force of this form to start from, chosen from so many; `ranges` are those of the
    /// covariates.
    pub fn candidate(
        extra: &Extra,
        ranges: &[[f64; 3]],
        chosen_from: f64,
        scan: &Scan,
    ) -> Candidate {
        let most = FORCE_MAX_N_PER_KN;
        let mut parameters = vec![Parameter::new("extra_n_per_kn", (-most, most), 0.01)];
        let (mut fitted, mut start) = (Vec::new(), vec![extra.n_per_kn]);
        for (k, (factor, range)) in extra.factors.iter().zip(ranges).enumerate() {
            for (number, bounds) in fitted_numbers(factor.form, *range) {
                let name = named(k, factor.form.numbers()[number]);
                let step = 2e-3 * (bounds.1 - bounds.0);
                parameters.push(Parameter::new(name, bounds, step));
                fitted.push((k, number));
                start.push(factor.numbers[number].clamp(bounds.0, bounds.1));
            }
        }
        let (greatest, place) = lives(extra, scan);
        // An edge that was sought costs what a number that is fitted does.
        let edges = |factor: &Factor| match factor.form {
            Form::Between => 2.0,
            Form::From | Form::UpTo => 1.0,
            _ => 0.0,
        };
        let sought: f64 = extra.factors.iter().map(edges).sum();
        let observations = scan.fit.observations().max(2) as f64;
        let force = FormForce {
            factors: extra.factors.clone(),
            parameters,
            fitted,
            greatest,
            place,
            choice_cost: OUTSIDE_COST + 2.0 * chosen_from.ln() + sought * observations.ln(),
        };
        Candidate::new(force, start)
    }

    /// The force for given parameters.
    fn extra(&self, parameters: &[f64]) -> Extra {
        let mut factors = self.factors.clone();
        for (&(factor, number), &value) in self.fitted.iter().zip(&parameters[1..]) {
            factors[factor].numbers[number] = value;
        }
        Extra { n_per_kn: parameters[0], factors }
    }
}

/// The greatest product of the factors over the fit runs, and where it lives.
fn lives(extra: &Extra, scan: &Scan) -> (f64, Place) {
    let unit = Extra { n_per_kn: 1.0, ..extra.clone() };
    let of_bins = || {
        scan.problem.runs.iter().flat_map(|run| {
            let middles = run.bins.iter().map(|bin| &run.samples()[bin.middle()]);
            middles.map(|sample| (sample, unit.at(|of| sample.covariate(of)).0))
        })
    };
    let greatest = of_bins().map(|(_, value)| value).fold(0.0, f64::max);
    let range = |of: Covariate| {
        let inside = of_bins().filter(|(_, value)| *value >= LIVES_SHARE * greatest);
        inside
            .filter_map(|(sample, _)| sample.covariate(of))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            })
    };
    let mut place = Place::default();
    for factor in &extra.factors {
        match factor.of {
            Covariate::Speed => place.speed_range_mps = Some(range(factor.of)),
            Covariate::Chainage => place.intervals_m = Some(vec![range(factor.of)]),
            _ => {}
        }
    }
    let last = extra.factors.last().map_or(Covariate::Speed, |factor| factor.of);
    place.covariate = Some(CovariateRange { name: last.name().into(), range: range(last) });
    (greatest, place)
}

impl Hypothesis for FormForce {
    fn kind(&self) -> EffectKind {
        EffectKind::Unknown
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        let extra = [self.extra(parameters)];
        for (sample, force) in run.samples().iter().zip(forces) {
            let known = |of: Covariate| sample.covariate(of);
            extra::act(&extra, sample.speed_mps, known, &mut force.resistance);
        }
    }

    fn choice_cost(&self) -> f64 {
        self.choice_cost
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        (parameters[0] * self.greatest).abs() >= LEAST_N_PER_KN
    }

    fn place(&self) -> Place {
        self.place.clone()
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        let extra = self.extra(parameters);
        let is_read_back = extra.factors.iter().all(|it| it.form.refusal(it.numbers).is_none());
        is_read_back.then(|| vec![Entry::Extra(extra)])
    }

    fn formula(&self, parameters: &[f64]) -> Option<String> {
        Some(self.extra(parameters).law())
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let mut reported = Reported::default();
        for (i, spec) in self.parameters.iter().enumerate() {
            reported.push(spec.name, context.parameters[i], context.deviations[i]);
        }
        let formula = self.extra(context.parameters).law();
        reported.values.insert("formula".into(), ParameterValue::Formula(formula));
        reported
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_in_order_however_slow_or_fast_the_runs_are() {
        for form in Form::ALL {
            for range in [[1.0, 0.8, 30.0], [12.0, 10.0, 22.0], [18.9, 18.5, 19.4]] {
                for (_, (lower, upper)) in fitted_numbers(form, range) {
                    assert!(lower < upper, "{form:?} over {range:?}: {lower} to {upper}");
                }
            }
        }
    }
}
