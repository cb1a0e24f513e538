//! A force of some form outside the library, with the numbers that a fit estimates, and whether one that follows a control
//! force is more than a wrong scale of its report, which the library has.

use std::sync::Arc;

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::extra::{
    self, Covariate, CovariateFactor, ExtraResistance, FORCE_MAX_N_PER_KN, Form,
};
use dynocar_model::terms::{ModelEntry, Parameter, brake, traction};
use dynocar_shared::vocabulary::EffectKind;

use super::known::{edges, fitted_numbers, is_exponent, named};
use crate::explain::answer::{CovariateRange, Location, ParameterValue};
use crate::explain::effects::{
    Candidate, Handling, Hypothesis, Nature, On, ReportContext, ReportedValues, SharedHypothesis,
};
use crate::explain::evidence::{OUTSIDE_COST, RunData, SampleForces};
use crate::explain::places::{Axis, IntervalEnd, Reach};
use crate::explain::scan::Scan;
use crate::statistics::span;

/// Least size in N/kN of a force that counts.
const LEAST_N_PER_KN: f64 = 0.1;
/// Share of a covariate's range by which an edge is moved, small enough not to matter.
const EDGE_FINE_SHARE: f64 = 1e-3;
/// A force acts where it is at least this share of its greatest value.
const LIVES_SHARE: f64 = 0.1;

/// The structure: the factors, and which of their numbers are fitted.
#[derive(Clone, Debug)]
pub struct FormForce {
    /// Factors with the numbers that they start from.
    factors: Vec<CovariateFactor>,
    /// The size and the numbers that are fitted.
    parameters: Vec<Parameter>,
    /// Factor and number of each that is fitted, after the size.
    fitted: Vec<(usize, usize)>,
    /// Greatest product of the factors over the fit runs.
    greatest: f64,
    place: Location,
    /// Least and greatest value of the last factor's covariate.
    span: [f64; 2],
    choice_cost: f64,
    /// The control force that it follows, if any.
    control: Option<ControlScale>,
}

/// Returns the price of a form that was chosen from `chosen_from` forms.
pub fn choice_cost(chosen_from: f64) -> f64 {
    OUTSIDE_COST + 2.0 * chosen_from.ln()
}

impl FormForce {
    /// Returns a force of this form to start from, chosen from several; `ranges` are those of the covariates.
    /// Exponents that are held are not fitted.
    pub fn candidate(
        extra: &ExtraResistance,
        holds_exponents: bool,
        ranges: &[[f64; 3]],
        chosen_from: f64,
        scan: &Scan,
    ) -> Candidate {
        let most = FORCE_MAX_N_PER_KN;
        let mut parameters = vec![Parameter::new("extra_n_per_kn", (-most, most), 0.01)];
        let (mut fitted, mut start) = (Vec::new(), vec![extra.n_per_kn]);
        for (k, (factor, range)) in extra.factors.iter().zip(ranges).enumerate() {
            let free = fitted_numbers(factor.form, *range).into_iter();
            let is_free = |number: usize| !(holds_exponents && is_exponent(factor.form, number));
            for (number, bounds) in free.filter(|(number, _)| is_free(*number)) {
                let name = named(k, factor.form.numbers()[number]);
                let step = 2e-3 * (bounds.1 - bounds.0);
                parameters.push(Parameter::new(name, bounds, step));
                fitted.push((k, number));
                start.push(factor.numbers[number].clamp(bounds.0, bounds.1));
            }
        }
        let (greatest, place) = lives(extra, scan);
        // An edge that was sought costs as much as a fitted number.
        let sought: usize = extra.factors.iter().map(|factor| edges(factor.form)).sum();
        let observations = scan.fit.observations().max(2) as f64;
        let force = FormForce {
            factors: extra.factors.clone(),
            parameters,
            fitted,
            greatest,
            place,
            span: ranges.last().map_or([0.0, 1.0], |&[_, low, high]| [low, high]),
            choice_cost: choice_cost(chosen_from) + sought as f64 * observations.ln(),
            control: ControlScale::of(extra, scan),
        };
        Candidate::new(force, start)
    }

    /// The force for given parameters.
    fn extra(&self, parameters: &[f64]) -> ExtraResistance {
        ExtraResistance { n_per_kn: parameters[0], factors: self.factors_at(&parameters[1..]) }
    }

    /// Its factors for given numbers.
    fn factors_at(&self, numbers: &[f64]) -> Vec<CovariateFactor> {
        let mut factors = self.factors.clone();
        for (&(factor, number), &value) in self.fitted.iter().zip(numbers) {
            factors[factor].numbers[number] = value;
        }
        factors
    }
}

/// A covariate at each sample; the speed as resistances are evaluated.
fn covariate(run: &RunData, of: Covariate) -> &[f64] {
    if of == Covariate::Speed { &run.smooth_mps } else { run.covariate(of) }
}

/// The greatest product of the factors over the fit runs, and where it lives.
fn lives(extra: &ExtraResistance, scan: &Scan) -> (f64, Location) {
    let unit = ExtraResistance { n_per_kn: 1.0, ..extra.clone() };
    let of_bins = || {
        scan.problem.runs.iter().flat_map(|run| {
            let middles = run.bins.iter().map(|bin| &run.samples()[bin.middle()]);
            middles.map(|sample| (sample, unit.at(|of| sample.covariate(of)).0))
        })
    };
    let greatest = of_bins().map(|(_, value)| value).fold(0.0, f64::max);
    let range = |of: Covariate| {
        let inside = of_bins().filter(|(_, value)| *value >= LIVES_SHARE * greatest);
        span(inside.filter_map(|(sample, _)| sample.covariate(of)))
            .unwrap_or([f64::INFINITY, f64::NEG_INFINITY])
    };
    let mut place = Location::default();
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
    fn nature(&self) -> Nature<'_> {
        Nature {
            choice_cost: self.choice_cost,
            handling: Handling::Added,
            feels_speed: self.factors.iter().any(|factor| factor.of == Covariate::Speed),
            ..Nature::new(EffectKind::Unknown, &self.parameters)
        }
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let extra = [self.extra(parameters)];
        let speed_mps = run.covariate(Covariate::Speed);
        for (i, force) in (first..).zip(forces) {
            let known = |of: Covariate| Some(run.covariate(of)[i]).filter(|it| !it.is_nan());
            extra::act(&extra, speed_mps[i], known, &mut force.resistance);
        }
    }

    fn unit_n_per_kn(&self, others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        n_per_kn.clear();
        n_per_kn.resize(run.samples().len(), 1.0);
        for factor in self.factors_at(others) {
            factor.multiply(covariate(run, factor.of), n_per_kn);
        }
    }

    fn unit_slopes(&self, others: &[f64], _: &[f64], run: &RunData, slopes: &mut [Vec<f64>]) {
        let factors = self.factors_at(others);
        let covariates: Vec<&[f64]> = factors.iter().map(|it| covariate(run, it.of)).collect();
        slopes.iter_mut().for_each(Vec::clear);
        let mut at = vec![(0.0, [0.0; 2]); factors.len()];
        for i in 0..run.samples().len() {
            for ((at, factor), covariate) in at.iter_mut().zip(&factors).zip(&covariates) {
                *at = factor.value_and_by_numbers(covariate[i]);
            }
            for (slope, &(factor, number)) in slopes.iter_mut().zip(&self.fitted) {
                let others = at.iter().enumerate().filter(|(other, _)| *other != factor);
                let product: f64 = others.map(|(_, (value, _))| value).product();
                slope.push(product * at[factor].1[number]);
            }
        }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        let is_left_by_scale = |control: &ControlScale| control.is_left_by(&self.extra(parameters));
        (parameters[0] * self.greatest).abs() >= LEAST_N_PER_KN
            && self.control.as_ref().is_none_or(is_left_by_scale)
    }

    fn place(&self) -> Location {
        self.place.clone()
    }

    /// The edges of the last factor, where its value jumps.
    fn ends(&self) -> Vec<IntervalEnd> {
        let Some(last) = self.factors.last() else { return Vec::new() };
        let ([low, high], [one, other]) = (self.span, last.numbers);
        let end = |is_upper: bool, at: f64, low: f64, high: f64| IntervalEnd {
            axis: Axis::Covariate,
            part: 0,
            is_upper,
            at,
            reach: Reach::Between(low.min(at), high.max(at)),
            fine: EDGE_FINE_SHARE * (self.span[1] - self.span[0]),
            run: None,
        };
        match last.form {
            Form::Between => vec![end(false, one, low, other), end(true, other, one, high)],
            Form::From => vec![end(false, one, low, high)],
            Form::UpTo => vec![end(true, one, low, high)],
            _ => Vec::new(),
        }
    }

    fn with_end(&self, end: &IntervalEnd, at: f64) -> Option<SharedHypothesis> {
        let mut moved = self.clone();
        let last = moved.factors.last_mut()?;
        let number = usize::from(end.is_upper && last.form == Form::Between);
        last.numbers[number] = at;
        let covariate = moved.place.covariate.as_mut()?;
        covariate.range[usize::from(end.is_upper)] = at;
        if last.of == Covariate::Chainage {
            moved.place.intervals_m = Some(vec![covariate.range]);
        }
        last.form.refusal(last.numbers).is_none().then(|| Arc::new(moved) as SharedHypothesis)
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let extra = self.extra(parameters);
        let is_read_back = extra.factors.iter().all(|it| it.form.refusal(it.numbers).is_none());
        is_read_back.then(|| vec![ModelEntry::Extra(extra)])
    }

    fn formula(&self, parameters: &[f64]) -> Option<String> {
        Some(self.extra(parameters).law())
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let mut reported = context.each_of(&self.parameters);
        let formula = self.extra(context.parameters).law();
        reported.values.insert("formula".into(), ParameterValue::Formula(formula));
        reported
    }
}

/// Share of the square of a force above which most of it is no scale.
const LEFT_SHARE: f64 = 0.5;
/// Greatest number of samples that are compared.
const COMPARED_MAX: usize = 1000;

/// A control force at samples over the fit runs where it acts, with the least wrong scale of it that counts.
#[derive(Clone, Debug)]
struct ControlScale {
    /// Share of the control force.
    least: f64,
    /// Samples, each with the control force in N for each kN of weight.
    at: Vec<(ResolvedSample, f64)>,
}

impl ControlScale {
    /// Returns the control force among the covariates of a form; `None` where there is none.
    fn of(extra: &ExtraResistance, scan: &Scan) -> Option<Self> {
        let least = |of: Covariate| match of {
            Covariate::TractionForce => Some((of, traction::LEAST)),
            Covariate::BrakeForce => Some((of, brake::GAIN_LEAST)),
            _ => None,
        };
        let (force, least) = extra.factors.iter().find_map(|factor| least(factor.of))?;
        let acting = || {
            scan.problem.runs.iter().flat_map(|run| {
                let middles = run.bins.iter().map(|bin| &run.samples()[bin.middle()]);
                middles.filter(|sample| sample.covariate(force).is_some_and(|it| it > 0.0))
            })
        };
        let every = acting().count().div_ceil(COMPARED_MAX).max(1);
        let per_kn =
            |sample: &ResolvedSample| Some((*sample, sample.covariate(force)? / sample.weight_kn));
        let at = acting().step_by(every).filter_map(per_kn).collect();
        Some(ControlScale { least, at })
    }

    /// Returns whether a force departs from every share of the control force by more than the least wrong scale, as
    /// root mean squares, or is for the most part no such share: of a force that acts at walking pace alone little is
    /// left over all braking.
    fn is_left_by(&self, extra: &ExtraResistance) -> bool {
        let mut sums = [0.0; 3];
        for (sample, control) in &self.at {
            let own = extra.at(|of| sample.covariate(of)).0;
            for (sum, product) in sums.iter_mut().zip([own * own, own * control, control * control])
            {
                *sum += product;
            }
        }
        let [own, both, control] = sums;
        let left = own - both * both / control;
        left > self.least.powi(2) * control || left > LEFT_SHARE * own
    }
}

#[cfg(test)]
mod tests {
    use dynocar_model::terms::extra::{CovariateFactor, Form};

    use super::*;
    use crate::explain::evidence::coasting;

    #[test]
    fn an_edge_moves_the_factor_and_its_place_and_never_past_the_other() {
        let factor = CovariateFactor {
            of: Covariate::TimeSinceStart,
            form: Form::Between,
            numbers: [200.0, 500.0],
        };
        let name = factor.of.name().into();
        let covariate = Some(CovariateRange { name, range: [200.0, 500.0] });
        let force = FormForce {
            factors: vec![factor],
            parameters: vec![Parameter::new("extra_n_per_kn", (-9.0, 9.0), 0.01)],
            fitted: Vec::new(),
            greatest: 1.0,
            place: Location { covariate, ..Location::default() },
            span: [0.0, 900.0],
            choice_cost: 0.0,
            control: None,
        };
        let ends = force.ends();
        assert_eq!(ends[0].reach, Reach::Between(0.0, 500.0));
        assert_eq!(ends[1].reach, Reach::Between(200.0, 900.0));
        let later = force.with_end(&ends[1], 700.0).unwrap();
        assert_eq!(later.place().covariate.unwrap().range, [200.0, 700.0]);
        let Some([ModelEntry::Extra(extra)]) =
            later.entries(&[2.0]).as_deref().map(|it| [it[0].clone()])
        else {
            panic!("a form that files can hold");
        };
        assert_eq!(extra.factors[0].numbers, [200.0, 700.0]);
        assert!(force.with_end(&ends[1], 100.0).is_none());
    }

    /// Whether a form of the brake force, up to 100 N on 1 kN of weight, is more than a wrong scale.
    fn is_left_by(n_per_kn: f64, form: Form, numbers: [f64; 2]) -> bool {
        let braked = |k: i32| {
            let brake_n = f64::from(k);
            let sample =
                ResolvedSample { brake_force_n: Some(brake_n), weight_kn: 1.0, ..coasting() };
            (sample, brake_n)
        };
        let scale = ControlScale { least: 0.05, at: (1..=100).map(braked).collect() };
        let factors = vec![CovariateFactor { of: Covariate::BrakeForce, form, numbers }];
        scale.is_left_by(&ExtraResistance { n_per_kn, factors })
    }

    #[test]
    fn a_power_near_one_is_a_wrong_scale_and_a_force_from_a_threshold_is_none() {
        for exponent in [0.9, 1.0, 1.1] {
            assert!(!is_left_by(20.0, Form::Power, [100.0, exponent]), "{exponent}");
        }
        assert!(is_left_by(20.0, Form::Power, [100.0, 3.0]));
        assert!(is_left_by(20.0, Form::Above, [60.0, 40.0]));
        assert!(is_left_by(2.0, Form::Between, [10.0, 20.0]), "little of it, and no scale");
    }
}
