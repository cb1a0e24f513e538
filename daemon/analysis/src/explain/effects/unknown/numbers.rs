//! Which numbers of a form are estimated, and between which bounds.

use dynocar_model::terms::extra::Form;

/// Numbers of a form that are fitted, with their bounds for a covariate over the range from `low`
/// to `high`; below `least` there are too few data to show anything.
pub fn fitted_numbers(form: Form, [least, low, high]: [f64; 3]) -> Vec<(usize, (f64, f64))> {
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
        Form::Decay | Form::Rise => vec![(0, (0.02 * high, 3.0 * high))],
        Form::Bell => vec![(0, (low, high)), (1, (0.01 * width, 0.6 * width))],
    }
}

/// The name of a number in the answer; that of the second factor says so.
pub fn named(factor: usize, name: &'static str) -> &'static str {
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

/// Edges of a form, which are sought and not fitted.
pub fn edges(form: Form) -> usize {
    match form {
        Form::Between => 2,
        Form::From | Form::UpTo => 1,
        _ => 0,
    }
}

/// Whether a number of a form is an exponent.
pub fn is_exponent(form: Form, number: usize) -> bool {
    form == Form::Power && number == 1
}

/// Numbers of a form that are estimated, edges among them.
pub fn estimated(form: Form, holds_exponents: bool) -> usize {
    let fitted = fitted_numbers(form, [0.0, 0.0, 1.0]);
    let is_free = |number: usize| !(holds_exponents && is_exponent(form, number));
    fitted.iter().filter(|(number, _)| is_free(*number)).count() + edges(form)
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

    #[test]
    fn an_exponent_that_is_held_is_no_number() {
        assert_eq!([false, true].map(|held| estimated(Form::Power, held)), [1, 0]);
        assert_eq!([false, true].map(|held| estimated(Form::Between, held)), [2, 2]);
    }
}
