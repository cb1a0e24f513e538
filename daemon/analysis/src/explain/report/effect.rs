//! An effect in words: kind, size, location, what it means, how sure it is, and what to do.

use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::{EffectKind, KindRow};

use super::words::{self, joined, kind_name, number};
use crate::explain::answer::{
    EffectAnswer, EffectMeaning, Location, MassWindow, ParameterValue, RunWindow, in_plain_words,
};
use crate::statistics::span;

/// Places named in a sentence at most.
const PLACES_MAX: usize = 4;

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
                    // A convention has no uncertainty.
                    let ends = [(value - half).max(words::least(name)), value + half];
                    let [low, high] = ends.map(|it| number(it, Some(half)));
                    let value = number(*value, Some(half));
                    sizes.push(format!("{words} {value}{unit} (95 % interval {low} to {high})"));
                }
            }
            ParameterValue::ByRun(by_run) => {
                let span = span(by_run.values().copied());
                sizes.extend(
                    span.map(|[low, high]| {
                        format!("{words} {low:.1} to {high:.1}{unit}, run by run")
                    }),
                );
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
            ParameterValue::Formula(formula) => sizes.insert(0, in_plain_words(formula)),
            ParameterValue::Windows(windows) => {
                let all = in_order(windows, |it| (&it.window.run, it.window.t_start_s));
                sizes.extend(all.take(PLACES_MAX).map(|MassWindow { window, mass_factor }| {
                    let percent =
                        format!("{:+.1} %", 100.0 * (mass_factor - 1.0)).replace('-', "−");
                    let RunWindow { run, t_start_s, t_end_s } = window;
                    let is_one = windows.iter().filter(|it| it.window.run == *run).count() == 1;
                    let time = if is_one {
                        String::new()
                    } else {
                        format!(" from {t_start_s:.0} to {t_end_s:.0} s")
                    };
                    format!("{percent} in {run}{time}")
                }));
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
fn in_order<W>(windows: &[W], key: fn(&W) -> (&String, f64)) -> std::vec::IntoIter<&W> {
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

/// Returns the recommended action for an effect; `None` for one without a name.
pub fn to_do(effect: &EffectAnswer) -> Option<&'static str> {
    if effect.contradiction.is_some() {
        return Some("find out which of the two is wrong before anything is replaced");
    }
    let kind = EffectKind::from_name(effect.kind).filter(|kind| *kind != EffectKind::Unknown)?;
    Some(KindRow::of(kind).to_do)
}

/// Share of the traction's energy below which the work of an effect is not worth a word.
const WORK_SHARE_MIN: f64 = 0.002;

/// Describes the meaning of an effect in kWh and metres, without a full stop; empty where nothing is known of it.
pub fn meaning(meaning: &EffectMeaning) -> String {
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
    let count = intervals_m.len();
    if let Some([low, high]) = span(intervals_m.as_flattened().iter().copied())
        && count > PLACES_MAX
    {
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
    use crate::explain::answer::CovariateRange;

    #[test]
    fn what_an_effect_means_is_said_in_kwh_and_metres() {
        let costs = EffectMeaning {
            energy_kwh_per_100_km: 41.26,
            share_of_traction_energy: Some(0.0312),
            distance_error_60_s_m: Some([14.52, 2.13]),
        };
        assert_eq!(
            meaning(&costs),
            "41.3 kWh per 100 km more, 3.1 % of the traction's energy; a minute ahead, the model errs by \
             14.5 m without this effect, 2.1 m with it"
        );
        let helps = EffectMeaning {
            energy_kwh_per_100_km: -2.0,
            share_of_traction_energy: Some(-0.01),
            distance_error_60_s_m: None,
        };
        assert_eq!(meaning(&helps), "2.00 kWh per 100 km less, 1.0 % of the traction's energy");
        assert_eq!(meaning(&EffectMeaning::default()), "");
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
            meaning: EffectMeaning::default(),
            contradiction: None,
            over_time: Vec::new(),
            held_out: None,
            runners_up: Vec::new(),
        };
        assert_eq!(
            described(&effect),
            "a dragging brake in runs/02.csv – drag force 3059 N (95 % interval 2848 to 3269)"
        );
    }
}
