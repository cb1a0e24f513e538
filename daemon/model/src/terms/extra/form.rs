//! Dimensionless functions of one covariate u.

use crate::named;

named! {
    /// A form of such a function; its numbers have the unit of the covariate, except the exponent.
    Form ("in `train.toml`") {
        /// `(max(0, u) / at)^exponent`.
        Power "power";
        /// `max(0, below / max(u, least) − 1)`.
        Hyperbola "hyperbola";
        /// `max(0, u − from) / span`.
        Above "above";
        /// `max(0, until − u) / span`.
        Below "below";
        /// 1 from `from` up to `to`, else 0.
        Between "between";
        /// 1 from `from` on, else 0.
        From "from";
        /// 1 up to `to`, else 0.
        UpTo "up_to";
        /// `exp(−max(0, u) / over)`.
        Decay "decay";
        /// `1 − exp(−max(0, u) / over)`.
        Rise "rise";
        /// `exp(−((u − at) / width)² / 2)`.
        Bell "bell";
    }
}

/// Below this share of `at`, a power with an exponent under 1 grows no steeper.
const POWER_LEAST: f64 = 1e-3;

impl Form {
    /// Returns the names of its numbers in `train.toml`.
    pub const fn numbers(self) -> &'static [&'static str] {
        match self {
            Form::Power => &["at", "exponent"],
            Form::Hyperbola => &["below", "least"],
            Form::Above => &["from", "span"],
            Form::Below => &["until", "span"],
            Form::Between => &["from", "to"],
            Form::From => &["from"],
            Form::UpTo => &["to"],
            Form::Decay | Form::Rise => &["over"],
            Form::Bell => &["at", "width"],
        }
    }

    /// Returns the constraint that the numbers violate; `None` if they are valid.
    pub fn refusal(self, [one, other]: [f64; 2]) -> Option<&'static str> {
        let (is_right, expected) = match self {
            Form::Power => (one > 0.0 && (0.0..=5.0).contains(&other), {
                "at above 0 and an exponent from 0 to 5"
            }),
            Form::Hyperbola => (other > 0.0 && one > other, "least above 0 and below above least"),
            Form::Above | Form::Below => (other > 0.0, "a span above 0"),
            Form::Between => (other > one, "to above from"),
            Form::From | Form::UpTo => (true, "a number"),
            Form::Decay | Form::Rise => (one > 0.0, "over above 0"),
            Form::Bell => (other > 0.0, "a width above 0"),
        };
        (!is_right).then_some(expected)
    }

    /// Its value at u, and the slope there.
    #[inline]
    pub fn value_and_slope(self, [one, other]: [f64; 2], u: f64) -> (f64, f64) {
        match self {
            Form::Power => {
                let share = (u / one).max(0.0);
                let value = share.powf(other);
                let slope = match share {
                    share if share >= POWER_LEAST => other * value / (share * one),
                    share if share > 0.0 => other * POWER_LEAST.powf(other - 1.0) / one,
                    _ => 0.0,
                };
                (value, slope)
            }
            Form::Hyperbola => {
                let held = u.max(other);
                let value = one / held - 1.0;
                let slope = if u > other { -one / (held * held) } else { 0.0 };
                if value > 0.0 { (value, slope) } else { (0.0, 0.0) }
            }
            Form::Above => hinge((u - one) / other, 1.0 / other),
            Form::Below => hinge((one - u) / other, -1.0 / other),
            Form::Between => (f64::from(u8::from(u >= one && u < other)), 0.0),
            Form::From => (f64::from(u8::from(u >= one)), 0.0),
            Form::UpTo => (f64::from(u8::from(u < one)), 0.0),
            Form::Decay => {
                let value = (-u.max(0.0) / one).exp();
                (value, if u > 0.0 { -value / one } else { 0.0 })
            }
            Form::Rise => {
                let left = (-u.max(0.0) / one).exp();
                (1.0 - left, if u > 0.0 { left / one } else { 0.0 })
            }
            Form::Bell => {
                let away = (u - one) / other;
                let value = (-0.5 * away * away).exp();
                (value, -value * away / other)
            }
        }
    }

    /// Its value at u, and by how much a unit of each number changes it; by nothing where it jumps.
    #[inline]
    pub fn value_and_by_numbers(self, numbers: [f64; 2], u: f64) -> (f64, [f64; 2]) {
        let ([one, other], (value, slope)) = (numbers, self.value_and_slope(numbers, u));
        let by_numbers = match self {
            Form::Power if u > 0.0 => [-other * value / one, value * (u / one).ln()],
            Form::Hyperbola if value > 0.0 => {
                let held = u.max(other);
                [1.0 / held, if u > other { 0.0 } else { -one / (held * held) }]
            }
            Form::Above | Form::Below | Form::Bell => [-slope, -slope * (u - one) / other],
            Form::Decay | Form::Rise => [-slope * u / one, 0.0],
            _ => [0.0; 2],
        };
        (value, by_numbers)
    }

    /// The formula for a covariate of this name.
    pub fn law(self, [one, other]: [f64; 2], of: &str) -> String {
        let less = |number: f64| match number < 0.0 {
            true => format!("{of} + {}", short(-number)),
            false => format!("{of} − {}", short(number)),
        };
        let away = less(one);
        let (one, other) = (short(one), short(other));
        match self {
            Form::Power => format!("({of} / {one})^{other}"),
            Form::Hyperbola => format!("max(0, {one} / max({of}, {other}) − 1)"),
            Form::Above => format!("max(0, {away}) / {other}"),
            Form::Below => format!("max(0, {one} − {of}) / {other}"),
            Form::Between => format!("({one} ≤ {of} < {other})"),
            Form::From => format!("({of} ≥ {one})"),
            Form::UpTo => format!("({of} < {one})"),
            Form::Decay => format!("exp(−{of} / {one})"),
            Form::Rise => format!("(1 − exp(−{of} / {one}))"),
            Form::Bell => format!("exp(−(({away}) / {other})² / 2)"),
        }
    }
}

#[inline]
fn hinge(value: f64, slope: f64) -> (f64, f64) {
    if value > 0.0 { (value, slope) } else { (0.0, 0.0) }
}

/// Returns a number with four digits, and no more zeros than it needs.
fn short(value: f64) -> String {
    let digits = (3 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASES: [(Form, [f64; 2]); 12] = [
        (Form::Power, [10.0, 1.5]),
        (Form::Power, [10.0, 0.0]),
        (Form::Power, [10.0, 0.5]),
        (Form::Hyperbola, [15.0, 3.0]),
        (Form::Above, [8.0, 4.0]),
        (Form::Below, [8.0, 4.0]),
        (Form::Between, [5.0, 9.0]),
        (Form::From, [5.0, 0.0]),
        (Form::UpTo, [5.0, 0.0]),
        (Form::Decay, [7.0, 0.0]),
        (Form::Rise, [7.0, 0.0]),
        (Form::Bell, [7.0, 2.0]),
    ];

    #[test]
    fn slopes_are_those_of_the_values() {
        for (form, numbers) in CASES {
            for u in [0.7, 2.0, 4.3, 7.1, 12.0, 18.0] {
                let value = |u: f64| form.value_and_slope(numbers, u).0;
                let slope = (value(u + 1e-5) - value(u - 1e-5)) / 2e-5;
                let (_, own) = form.value_and_slope(numbers, u);
                assert!((own - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{form:?} at {u}");
            }
        }
    }

    #[test]
    fn what_a_number_changes_is_that_of_the_values() {
        for (form, numbers) in CASES {
            for u in [0.7, 2.0, 4.3, 7.1, 12.0, 18.0] {
                let (value, own) = form.value_and_by_numbers(numbers, u);
                assert_eq!(value, form.value_and_slope(numbers, u).0);
                for number in 0..form.numbers().len() {
                    let moved = |by: f64| {
                        let mut moved = numbers;
                        moved[number] += by;
                        form.value_and_slope(moved, u).0
                    };
                    let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                    let away = (own[number] - difference).abs();
                    assert!(away < 1e-6 * (1.0 + difference.abs()), "{form:?} {number} at {u}");
                }
            }
        }
    }

    #[test]
    fn every_value_is_finite_whatever_the_covariate() {
        for (form, numbers) in CASES {
            assert_eq!(form.refusal(numbers), None);
            for u in [-1e9, -1.0, 0.0, 1e-12, 1e9] {
                let (value, slope) = form.value_and_slope(numbers, u);
                assert!(value.is_finite() && slope.is_finite(), "{form:?} at {u}");
                let (_, by_numbers) = form.value_and_by_numbers(numbers, u);
                assert!(by_numbers.into_iter().all(f64::is_finite), "{form:?} at {u}");
            }
        }
    }

    #[test]
    fn names_are_read_back() {
        for form in Form::ALL {
            assert_eq!(Form::from_name(form.name()), Some(form));
        }
        assert_eq!(Form::from_name("sine"), None);
        assert!(Form::Hyperbola.refusal([2.0, 3.0]).is_some());
    }
}
