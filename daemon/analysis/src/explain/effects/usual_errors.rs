//! Usual errors of declared figures: scales of the reported forces, their lateness, the curve constant and others; and
//! the map's own small error where its shape is known. They are no effects: the search for other effects and the fit of
//! a finished model include them.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{
    Parameter, bearings, brake, curve, delay, gradient, rotating, traction,
};
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::{DMatrix, DVector};

use super::lateness::{Late, late_forces};
use super::{
    Candidate, DeclaredFigure, Handling, Hypothesis, Nature, On, Past, SharedHypothesis, Turn,
};
use crate::explain::evidence::{RunData, SampleForces};

/// Figures that are usually a little wrong, with the standard deviations of their errors.
const FIGURES: [(DeclaredFigure, f64); 7] = [
    (DeclaredFigure::Traction, traction::USUAL_STD),
    (DeclaredFigure::Brake, brake::USUAL_STD),
    (DeclaredFigure::Lateness, delay::USUAL_STD_S),
    (DeclaredFigure::Curves, curve::USUAL_STD),
    (DeclaredFigure::Warming, bearings::USUAL_STD),
    (DeclaredFigure::RotatingMass, rotating::USUAL_STD),
    (DeclaredFigure::FeltGradient, gradient::FELT_USUAL_STD),
];
/// Bounds of the search, in standard deviations, and the step of differences.
const BEYOND: f64 = 10.0;
const STEP: f64 = 0.1;

#[derive(Debug)]
struct UsualErrors {
    /// a, in N/kN.
    a_n_per_kn: f64,
    figures: Vec<DeclaredFigure>,
    parameters: Vec<Parameter>,
    information: DMatrix<f64>,
}

/// Returns nuisance parameters for the errors of the figures that no effect of the model estimates, starting at zero.
pub fn usual_errors(a_n_per_kn: f64, is_free: impl Fn(DeclaredFigure) -> bool) -> Candidate {
    let free: Vec<(DeclaredFigure, f64)> = FIGURES.into_iter().filter(|it| is_free(it.0)).collect();
    let parameter = |&(figure, std): &(DeclaredFigure, f64)| {
        // No force acts before its report, and bearings that warm up resist less.
        let least = if matches!(figure, DeclaredFigure::Lateness | DeclaredFigure::Warming) {
            0.0
        } else {
            -BEYOND * std
        };
        Parameter::new("usual_error", (least, BEYOND * std), STEP * std)
    };
    let precisions = free.iter().map(|(_, std)| std.powi(-2));
    let information = DMatrix::from_diagonal(&DVector::from_iterator(free.len(), precisions));
    let errors = UsualErrors {
        a_n_per_kn,
        figures: free.iter().map(|it| it.0).collect(),
        parameters: free.iter().map(parameter).collect(),
        information,
    };
    let start = vec![0.0; free.len()];
    Candidate::new(errors, start)
}

impl Hypothesis for UsualErrors {
    fn nature(&self) -> Nature<'_> {
        Nature {
            prior: Some(&self.information),
            turn: Turn::First,
            looks_back: self.figures.contains(&DeclaredFigure::Lateness),
            ..Nature::new(EffectKind::None, &self.parameters)
        }
    }

    fn apply(&self, parameters: &[f64], on: On, forces: &mut [SampleForces]) {
        let On { run, first, past } = on;
        for (figure, &error) in self.figures.iter().zip(parameters) {
            match figure {
                DeclaredFigure::Traction => {
                    forces.iter_mut().for_each(|it| it.traction_n *= 1.0 + error)
                }
                DeclaredFigure::Brake => forces.iter_mut().for_each(|it| it.brake_n *= 1.0 + error),
                DeclaredFigure::Curves => {
                    forces.iter_mut().for_each(|it| it.resistance.curve_n_per_kn *= 1.0 + error);
                }
                DeclaredFigure::RotatingMass => {
                    forces.iter_mut().for_each(|it| it.rotating_mass_factor += error);
                }
                DeclaredFigure::FeltGradient => {
                    forces.iter_mut().for_each(|it| it.gradient_permille *= 1.0 + error);
                }
                DeclaredFigure::Warming => {
                    let delta_a = error * self.a_n_per_kn;
                    let since_cold_s = run.covariate(Covariate::TimeSinceStart);
                    for (force, &since_cold_s) in forces.iter_mut().zip(&since_cold_s[first..]) {
                        let tau_s = bearings::TYPICAL_TAU_S;
                        bearings::act(delta_a, tau_s, since_cold_s, &mut force.resistance);
                    }
                }
                DeclaredFigure::Lateness => {
                    let on = On { run, first, past: &mut *past };
                    late_forces(Late::Both, [error, 0.0], on, forces);
                }
            }
        }
    }
}

/// The error of the map in the shape in which it was fitted, of any size: one number in the place of its many.
pub fn map_error_as_fitted(error: SharedHypothesis, permille: &[f64]) -> Candidate {
    let parameters = [Parameter::new("share", (-10.0, 10.0), 0.1)];
    Candidate::new(Fitted { error, permille: permille.to_vec(), parameters }, vec![1.0])
}

#[derive(Debug)]
struct Fitted {
    error: SharedHypothesis,
    /// Its parameters.
    permille: Vec<f64>,
    parameters: [Parameter; 1],
}

impl Hypothesis for Fitted {
    fn nature(&self) -> Nature<'_> {
        Nature { handling: Handling::Gradient, ..Nature::new(EffectKind::None, &self.parameters) }
    }

    fn apply(&self, parameters: &[f64], on: On, forces: &mut [SampleForces]) {
        let mut with = forces.to_vec();
        self.error.apply(&self.permille, on, &mut with);
        for (force, with) in forces.iter_mut().zip(with) {
            force.gradient_permille +=
                parameters[0] * (with.gradient_permille - force.gradient_permille);
        }
    }

    fn gradient_permille(&self, _parameter: usize, run: &RunData, permille: &mut Vec<f64>) {
        let mut with: Vec<SampleForces> = run.declared.all().collect();
        let on = On { run, first: 0, past: &mut Past::default() };
        self.error.apply(&self.permille, on, &mut with);
        let added = with.iter().zip(run.declared.all());
        permille.clear();
        permille.extend(added.map(|(with, own)| with.gradient_permille - own.gradient_permille));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_that_an_effect_estimates_has_no_usual_error_beside_it() {
        for (figure, _) in FIGURES {
            let free = usual_errors(1.0, |own| own != figure).start.len();
            assert_eq!(free, FIGURES.len() - 1, "{figure:?}");
        }
    }

    #[test]
    fn nothing_acts_before_it_is_reported_and_the_prior_is_what_is_usual() {
        let errors = usual_errors(1.0, |_| true).hypothesis;
        let prior = errors.nature().prior.expect("a prior");
        for (i, (figure, std)) in FIGURES.into_iter().enumerate() {
            assert!((prior[(i, i)] * std * std - 1.0).abs() < 1e-12);
            let has_a_sign = matches!(figure, DeclaredFigure::Lateness | DeclaredFigure::Warming);
            assert_eq!(errors.parameters()[i].lower >= 0.0, has_a_sign);
        }
    }
}
