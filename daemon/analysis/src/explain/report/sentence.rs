//! The verdict in a plain sentence: kind, where, size with unit and interval, error reduction.

use dynocar_core::terms::KindRow;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;

use super::errors::Errors;
use super::words::{self, joined, kind_name, number};
use crate::dataset::Role;
use crate::explain::answer::{
    EffectAnswer, ExplainAnswer, Location, Meaning, ParameterValue, Verdict,
};

/// Places named in a sentence at most.
const PLACES_MAX: usize = 4;

/// The verdict of an answer.
pub fn sentence(answer: &ExplainAnswer, errors: &Errors) -> String {
    let found: Vec<String> = answer.effects.iter().map(described).collect();
    let found = found.join("; and ");
    match answer.verdict {
        Verdict::None => {
            "Nothing undeclared acts, as far as these runs show: the declared model with a, b and \
             c refitted explains them."
                .into()
        }
        Verdict::InsufficientData => {
            format!("These runs do not suffice for a verdict. {}", answer.statement)
        }
        Verdict::Effect => {
            let means = answer.effects.first().map(|it| meaning(&it.meaning)).unwrap_or_default();
            let is_one = answer.effects.len() == 1 && !means.is_empty();
            let means = if is_one { format!(" It means {means}.") } else { String::new() };
            format!("Found: {found}.{means} {}", gained(errors))
        }
        Verdict::Ambiguous => {
            let competing: Vec<String> =
                answer.ambiguous_with.iter().map(|kind| kind_name(kind).into()).collect();
            let is_or_are = if competing.len() == 1 { "explains" } else { "explain" };
            format!(
                "Something undeclared acts, but these runs do not show what: it may be {found}; \
                 {} {is_or_are} them as well. {}",
                joined(&competing),
                gained(errors)
            )
        }
        Verdict::Unknown if answer.effects.is_empty() => answer.statement.clone(),
        Verdict::Unknown => format!(
            "Something undeclared acts that no effect of the library explains: {found}. {}",
            gained(errors)
        ),
    }
}

/// What the effects take away from the error that judges them.
fn gained(errors: &Errors) -> String {
    let Some((role, judged)) = errors.judged() else { return String::new() };
    let runs = if role == Role::Holdout { "the runs held out" } else { "the fit runs" };
    let runs = format!("{runs}{}", judged.predicted());
    let interval = judged.reduction_interval_95;
    let percent = |share: f64| format!("{} %", words::percent(share, interval));
    let interval = interval.map_or(String::new(), |[low, high]| {
        format!(" (95 % interval {} to {})", percent(low), percent(high))
    });
    let [before, after] = judged.error_mps;
    let values = format!("from {before:.3} to {after:.3} m/s");
    if judged.reduction > 0.0 {
        let share = percent(judged.reduction);
        format!(
            "With it, the error of the predicted speed on {runs} falls {values}, by {share}{interval}."
        )
    } else {
        format!("With it, the error of the predicted speed on {runs} does not fall ({values}).")
    }
}

/// Kind, size and place of an effect.
pub fn described(effect: &EffectAnswer) -> String {
    let sizes: Vec<String> = sizes(effect);
    let size = if sizes.is_empty() { String::new() } else { format!(" – {}", joined(&sizes)) };
    let place = placed(&effect.place);
    let place = if place.is_empty() { place } else { format!(" {place}") };
    let kind = match effect.kind {
        // The sentence around it says that it has no name.
        "unknown" => "a residual",
        kind => kind_name(kind),
    };
    format!("{kind}{place}{size}")
}

/// The numbers of an effect, each with its meaning, unit and 95 % interval.
pub fn sizes(effect: &EffectAnswer) -> Vec<String> {
    let number_of = |value: Option<&ParameterValue>| match value {
        Some(ParameterValue::Number(value)) => Some(*value),
        _ => None,
    };
    let mut sizes = Vec::new();
    for (name, value) in &effect.parameters {
        let (words, unit) = words::parameter(name);
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        match value {
            ParameterValue::Number(value) => {
                let half = HALF_95 * number_of(effect.std.get(name)).unwrap_or(0.0);
                if name == "speed_scale" {
                    sizes.push(speed_error(*value, half));
                } else if half > 0.0 {
                    // What is a convention has no uncertainty.
                    let [low, high] = [value - half, value + half].map(|it| number(it, Some(half)));
                    let value = number(*value, Some(half));
                    sizes.push(format!("{words} {value}{unit} (95 % interval {low} to {high})"));
                }
            }
            ParameterValue::ByRun(by_run) => {
                let values = by_run.values().copied();
                let low = values.clone().fold(f64::INFINITY, f64::min);
                let high = values.fold(f64::NEG_INFINITY, f64::max);
                sizes.push(format!("{words} {low:.1} to {high:.1}{unit}, run by run"));
            }
            ParameterValue::Sections(sections) => {
                let shown = sections.iter().take(PLACES_MAX);
                sizes.extend(shown.map(|s| {
                    let (from, to) = (s.from_m / 1000.0, s.to_m / 1000.0);
                    let percent = 100.0 * (s.mass_factor - 1.0);
                    format!(
                        "{percent:+.1} % from km {from:.2} to {to:.2} (direction {:+})",
                        s.direction
                    )
                    .replace('-', "−")
                }));
            }
            ParameterValue::Formula(formula) => sizes.insert(0, formula.clone()),
            ParameterValue::Windows(windows) => {
                sizes.extend(in_order(windows, |w| (&w.run, w.t_start_s)).take(PLACES_MAX).map(
                    |w| {
                        let percent =
                            format!("{:+.1} %", 100.0 * (w.mass_factor - 1.0)).replace('-', "−");
                        let is_one = windows.iter().filter(|it| it.run == w.run).count() == 1;
                        let (from_s, to_s) = (w.t_start_s, w.t_end_s);
                        let time = if is_one {
                            String::new()
                        } else {
                            format!(" from {from_s:.0} to {to_s:.0} s")
                        };
                        format!("{percent} in {}{time}", w.run)
                    },
                ));
            }
            ParameterValue::List(_) | ParameterValue::Profile(_) => {}
        }
    }
    sizes
}

/// A wheel's wrong diameter by what the speed reads, with its 95 % interval.
fn speed_error(scale: f64, half: f64) -> String {
    let side = if scale > 1.0 { "high" } else { "low" };
    let percent =
        |scale: f64| number(100.0 * (scale - 1.0) * (scale - 1.0).signum(), Some(100.0 * half));
    let mut ends =
        [scale - half, scale + half].map(|it| 100.0 * (it - 1.0) * (scale - 1.0).signum());
    ends.sort_unstable_by(f64::total_cmp);
    let [low, high] = ends.map(|it| number(it, Some(100.0 * half)));
    format!("speeds read {} % too {side} (95 % interval {low} to {high})", percent(scale))
}

/// Windows by run and time, however they were found.
fn in_order<'a, W>(windows: &'a [W], key: fn(&W) -> (&String, f64)) -> std::vec::IntoIter<&'a W> {
    let mut all: Vec<&W> = windows.iter().collect();
    all.sort_by(|one, other| {
        let ((run, from_s), (other_run, other_s)) = (key(one), key(other));
        run.cmp(other_run).then(from_s.total_cmp(&other_s))
    });
    all.into_iter()
}

/// How sure it is that an effect acts, by the probability of finding as much where nothing does.
pub fn sureness(p_value: f64) -> String {
    let odds = 1.0 / p_value.max(1e-300);
    let odds = match odds {
        1e6.. => "less than 1 in a million".to_owned(),
        10.0.. => {
            let digits = 10.0_f64.powf(odds.log10().floor() - 1.0);
            format!("1 in {:.0}", (odds / digits).round() * digits)
        }
        _ => format!("{} %", number(100.0 * p_value, Some(1.0))),
    };
    format!("chance of as much where nothing acts: {odds}")
}

/// What a person should do about an effect; `None` for one without a name.
pub fn to_do(effect: &EffectAnswer) -> Option<&'static str> {
    let kind = EffectKind::from_name(effect.kind).filter(|kind| *kind != EffectKind::Unknown)?;
    Some(KindRow::of(kind).to_do)
}

/// Share of the traction's energy below which the work of an effect is not worth a word.
const WORK_SHARE_MIN: f64 = 0.002;

/// What an effect means in kWh and metres, in words without a full stop; empty where nothing is known of it.
pub fn meaning(meaning: &Meaning) -> String {
    let percent =
        |share: f64| format!("{} % of the traction's energy", number(100.0 * share, Some(1.0)));
    let share = meaning.share_of_traction_energy.filter(|share| share.abs() >= WORK_SHARE_MIN);
    let work = share.map(|share| {
        let kwh = meaning.energy_kwh_per_100_km.abs();
        let kwh = number(kwh, Some(0.1 * kwh));
        let more = if share > 0.0 { "more" } else { "less" };
        format!("{kwh} kWh per 100 km {more}, {}", percent(share.abs()))
    });
    let ahead = meaning.distance_error_60_s_m.map(|[without, with]| {
        let [without, with] = [without, with].map(|m| number(m, Some(0.1 * without.max(with))));
        format!(
            "a minute ahead, the model errs by {without} m without this effect, {with} m with it"
        )
    });
    let parts: Vec<String> = work.into_iter().chain(ahead).collect();
    parts.join("; ")
}

/// Where an effect acts, in words; empty when it acts everywhere.
pub fn placed(place: &Location) -> String {
    let mut parts = Vec::new();
    let listed = |all: Vec<String>| {
        let more = all.len().saturating_sub(PLACES_MAX);
        let mut shown: Vec<String> = all.into_iter().take(PLACES_MAX).collect();
        if more > 0 {
            shown.push(format!("{more} more"));
        }
        joined(&shown)
    };
    if let Some(intervals) = &place.intervals_m {
        parts.push(sections(intervals));
    }
    if let Some(windows) = &place.windows {
        let all = in_order(windows, |w| (&w.run, w.t_start_s))
            .map(|w| format!("in {} from {:.0} to {:.0} s", w.run, w.t_start_s, w.t_end_s));
        parts.push(listed(all.collect()));
    }
    if let Some(runs) = &place.runs {
        parts.push(format!("in {}", listed(runs.clone())));
    }
    if let Some([low, high]) = place.speed_range_mps {
        parts.push(format!("at {low:.1} to {high:.1} m/s"));
    }
    let covariate = place.covariate.as_ref().filter(|it| {
        // The same is said above in other words.
        !matches!(it.name.as_str(), "speed_mps" | "chainage_m" | "run")
    });
    if let Some(covariate) = covariate {
        let [low, high] = covariate.range.map(|value| number(value, None));
        parts.push(format!("while {} is {low} to {high}", covariate.name));
    }
    parts.join(", ")
}

/// Stretches of the line; many are counted, not listed.
fn sections(intervals_m: &[[f64; 2]]) -> String {
    let km = |m: f64| m / 1000.0;
    if intervals_m.len() > PLACES_MAX {
        let low = intervals_m.iter().map(|interval| interval[0]).fold(f64::INFINITY, f64::min);
        let high = intervals_m.iter().map(|interval| interval[1]).fold(f64::NEG_INFINITY, f64::max);
        let count = intervals_m.len();
        return format!("at {count} places between km {:.2} and {:.2}", km(low), km(high));
    }
    let listed: Vec<String> = intervals_m
        .iter()
        .map(|[from, to]| format!("from km {:.2} to {:.2}", km(*from), km(*to)))
        .collect();
    joined(&listed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::answer::{BaseAnswer, CovariateRange, DavisDeviations, RunWindow};
    use crate::explain::report::Estimate;
    use crate::explain::report::errors::{ErrorPair, Resampling};
    use crate::explain::stop_to_stop::StopToStop;

    #[test]
    fn what_an_effect_means_is_said_in_kwh_and_metres() {
        let costs = Meaning {
            energy_kwh_per_100_km: 41.26,
            share_of_traction_energy: Some(0.0312),
            distance_error_60_s_m: Some([14.52, 2.13]),
        };
        assert_eq!(
            meaning(&costs),
            "41.3 kWh per 100 km more, 3.1 % of the traction's energy; a minute ahead, the model errs by \
             14.5 m without this effect, 2.1 m with it"
        );
        let helps = Meaning {
            energy_kwh_per_100_km: -2.0,
            share_of_traction_energy: Some(-0.01),
            distance_error_60_s_m: None,
        };
        assert_eq!(meaning(&helps), "2.00 kWh per 100 km less, 1.0 % of the traction's energy");
        assert_eq!(meaning(&Meaning::default()), "");
    }

    #[test]
    fn places_are_reported_in_words() {
        let tunnels = Location::of_intervals(vec![[5200.0, 6900.0], [8000.0, 8100.0]]);
        assert_eq!(placed(&tunnels), "from km 5.20 to 6.90 and from km 8.00 to 8.10");
        let curves: Vec<[f64; 2]> =
            (0..9).map(|k| [1e3 * f64::from(k), 1e3 * f64::from(k) + 300.0]).collect();
        assert_eq!(placed(&Location::of_intervals(curves)), "at 9 places between km 0.00 and 8.30");
        let window = RunWindow { run: "runs/03.csv".into(), t_start_s: 204.0, t_end_s: 729.6 };
        let covariate = CovariateRange { name: "brake_force_n".into(), range: [1e3, 2.5e4] };
        let place = Location {
            windows: Some(vec![window]),
            speed_range_mps: Some([10.0, 12.5]),
            covariate: Some(covariate),
            ..Location::default()
        };
        assert_eq!(
            placed(&place),
            "in runs/03.csv from 204 to 730 s, at 10.0 to 12.5 m/s, \
             while brake_force_n is 1000 to 25000"
        );
        assert_eq!(placed(&Location::default()), "");
    }

    #[test]
    fn an_effect_is_reported_with_its_size_and_interval() {
        let number = |value| [("force_n".to_string(), ParameterValue::Number(value))].into();
        let effect = EffectAnswer {
            kind: "dragging_brake",
            place: Location { runs: Some(vec!["runs/02.csv".into()]), ..Location::default() },
            parameters: number(3058.6),
            std: number(107.5),
            p_value: 1e-9,
            error_reduction: 0.8,
            meaning: Meaning::default(),
            runners_up: Vec::new(),
        };
        assert_eq!(
            described(&effect),
            "a dragging brake in runs/02.csv – drag force 3059 N (95 % interval 2848 to 3269)"
        );
    }

    fn effect(kind: &'static str, parameter: &str) -> EffectAnswer {
        EffectAnswer {
            kind,
            place: Location::of_intervals(vec![[5200.0, 6900.0]]),
            parameters: [(parameter.to_string(), ParameterValue::Number(2.5))].into(),
            std: [(parameter.to_string(), ParameterValue::Number(0.1))].into(),
            p_value: 1e-9,
            error_reduction: 0.8,
            meaning: Meaning::default(),
            runners_up: Vec::new(),
        }
    }

    /// An ambiguous answer.
    fn ambiguous() -> ExplainAnswer {
        let none = DavisDeviations { a: 0.0, b: 0.0, c: 0.0 };
        ExplainAnswer {
            verdict: Verdict::Ambiguous,
            statement: String::new(),
            diagnostics: Vec::new(),
            verdict_words: String::new(),
            caveats: Vec::new(),
            effects: vec![effect("local_resistance", "extra_n_per_kn")],
            ambiguous_with: vec!["tunnel_drag"],
            experiment: None,
            base: BaseAnswer { a: 1.0, b: 0.0, c: 0.0, std: none, told_by_data: none },
            metric: "full_run",
            scored_runs: 1,
            unscored: None,
            judged: None,
            rmse_before: None,
            rmse_after: None,
            error_reduction_interval: None,
            window60: None,
            stop_to_stop: None,
            fit_runs: None,
            drive: None,
            force_late_s: None,
            unexplained_n_per_kn: None,
            considered: Vec::new(),
            identifiability: Vec::new(),
            predictions: std::collections::BTreeMap::new(),
        }
    }

    /// Errors over whole runs held out that grow.
    fn updated_errors() -> Errors {
        let value = |value| Estimate { value, interval: None };
        let pair = ErrorPair {
            before_mps: value(0.8),
            after_mps: value(0.9),
            reduction: value(-0.125),
            resampling: Resampling::Blocks(1),
        };
        Errors {
            fit: None,
            holdout: Some(pair),
            fit_window60: None,
            holdout_window60: None,
            holdout_stop_to_stop: None,
            fit_stop_to_stop: None,
            by_run: Vec::new(),
        }
    }

    #[test]
    fn rivals_and_unknown_causes_are_distinguished_from_findings() {
        let (mut answer, errors) = (ambiguous(), updated_errors());
        let size = "from km 5.20 to 6.90 – extra resistance 2.50 N/kN (95 % interval 2.30 to 2.70)";
        let gained = "With it, the error of the predicted speed on the runs held out does not \
                      fall (from 0.800 to 0.900 m/s).";
        assert_eq!(
            sentence(&answer, &errors),
            format!(
                "Something undeclared acts, but these runs do not show what: it may be a local \
                 resistance {size}; tunnel drag explains them as well. {gained}"
            )
        );
        answer.verdict = Verdict::Unknown;
        answer.effects = vec![effect("unknown", "extra_n_per_kn")];
        assert_eq!(
            sentence(&answer, &errors),
            format!(
                "Something undeclared acts that no effect of the library explains: a \
                 residual {size}. {gained}"
            )
        );
    }

    #[test]
    fn a_headline_states_the_error_from_stop_to_stop_where_there_are_stops() {
        let mut errors = updated_errors();
        // Stops that were cut off leave an error over whole runs that says nothing of the forces.
        errors.holdout_stop_to_stop = StopToStop::from_errors(vec![vec![[0.5, 0.06]; 3]; 4]);
        let said = sentence(&ambiguous(), &errors);
        let gained = "on the runs held out, from stop to stop (12 sections) falls from 0.500 to \
                      0.060 m/s, by 88 % (95 % interval 88 % to 88 %).";
        assert!(said.ends_with(gained), "{said}");
    }
}
