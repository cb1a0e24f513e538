//! Whether a force that follows a control force is more than a wrong scale of its report, which the library has.

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::extra::{Covariate, ExtraResistance};
use dynocar_model::terms::{brake, traction};

use crate::explain::scan::Scan;

/// Share of the square of a force above which most of it is no scale.
const LEFT_SHARE: f64 = 0.5;
/// Greatest number of samples that are compared.
const COMPARED_MAX: usize = 1000;

/// A control force at samples over the fit runs where it acts, with the least wrong scale of it that counts.
#[derive(Clone, Debug)]
pub struct ControlScale {
    /// Share of the control force.
    least: f64,
    /// Samples, each with the control force in N for each kN of weight.
    at: Vec<(ResolvedSample, f64)>,
}

impl ControlScale {
    /// Returns the control force among the covariates of a form; `None` where there is none.
    pub fn of(extra: &ExtraResistance, scan: &Scan) -> Option<Self> {
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
    pub fn is_left_by(&self, extra: &ExtraResistance) -> bool {
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
