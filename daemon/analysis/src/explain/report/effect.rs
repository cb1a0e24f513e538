//! Effects and verdicts in words: one text with slots for the statement, the terminal, the page, the timeline and
//! events.
//!
//! An effect has a kind, a size, a location, a cost to the railway, a significance, and a recommended action.

use std::collections::BTreeMap;

use dynocar_model::words::{self, PLACES_MAX, joined, kind_name, number, stretch};
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::{EffectKind, KindRow};

use crate::explain::answer::{
    EffectAnswer, EffectMeaning, HeldOutAnswer, Location, MassWindow, ParameterValue, RunWindow,
    Verdict, VerdictWords, WithStd, in_plain_words,
};
use crate::explain::competing::{CompetingHypotheses, kinds_of};
use crate::explain::over_time::CHANCE_MAX;
use crate::explain::selection::{EffectTrial, ScaleSources, SearchOutcome};
use crate::statistics::span;

/// The named values of an effect.
type Values = BTreeMap<String, ParameterValue>;

/// Kind, size and place of an effect.
pub fn described(effect: &EffectAnswer) -> String {
    let kind = match effect.kind {
        // The sentence around this text says that the effect has no name.
        "unknown" => "a residual",
        kind => kind_name(kind),
    };
    let place = located(&effect.place).map_or(String::new(), |place| format!(" {place}"));
    format!("{kind}{place}{}", listed(&sizes(&effect.parameters, &effect.std)))
}

/// Sizes behind the kind that they are of.
fn listed(sizes: &[String]) -> String {
    if sizes.is_empty() { String::new() } else { format!(" – {}", joined(sizes)) }
}

/// Returns the numbers of an effect, each with its meaning, unit and 95 % interval.
pub fn sizes(parameters: &Values, std: &Values) -> Vec<String> {
    let mut sizes = Vec::new();
    // A change of mass with its 95 % interval, by its number in the list.
    let change = |name: &str, index: usize, mass_factor: f64| {
        let percent = 100.0 * (mass_factor - 1.0);
        let half = match std.get(name) {
            Some(ParameterValue::List(all)) => all.get(index).map(|std| 100.0 * HALF_95 * std),
            _ => None,
        };
        let half = half.map_or(String::new(), |half| format!(" ± {half:.1}"));
        format!("{percent:+.1}{half} %").replace('-', "−")
    };
    for (name, value) in parameters {
        match value {
            ParameterValue::Number(value) => {
                let std = match std.get(name) {
                    Some(ParameterValue::Number(std)) => *std,
                    _ => 0.0,
                };
                sizes.extend(words::figure(name, *value, HALF_95 * std));
            }
            ParameterValue::ByRun(by_run) => {
                let (words, unit) = words::parameter(name);
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                let span = span(by_run.values().copied());
                sizes.extend(
                    span.map(|[low, high]| {
                        format!("{words} {low:.1} to {high:.1}{unit}, run by run")
                    }),
                );
            }
            ParameterValue::Sections(sections) => {
                let shown = sections.iter().enumerate().take(PLACES_MAX);
                sizes.extend(shown.map(|(index, s)| {
                    let place = stretch([s.from_m, s.to_m]).replace('-', "−");
                    let direction = format!("{:+}", s.direction).replace('-', "−");
                    let change = change(name, index, s.mass_factor);
                    format!("{change} {place} (direction {direction})")
                }));
            }
            ParameterValue::Formula(formula) => sizes.insert(0, in_plain_words(formula)),
            ParameterValue::Windows(windows) => {
                let all: Vec<(usize, &MassWindow)> = windows.iter().enumerate().collect();
                let all = in_order(&all, |(_, it)| (&it.window.run, it.window.t_start_s));
                sizes.extend(all.take(PLACES_MAX).map(
                    |(index, MassWindow { window, mass_factor })| {
                        let change = change(name, *index, *mass_factor);
                        let RunWindow { run, t_start_s, t_end_s } = window;
                        let is_one = windows.iter().filter(|it| it.window.run == *run).count() == 1;
                        let time = if is_one {
                            String::new()
                        } else {
                            format!(" from {:.0} to {t_end_s:.0} s", t_start_s.round() + 0.0)
                        };
                        format!("{change} in {run}{time}")
                    },
                ));
            }
            ParameterValue::List(_) | ParameterValue::Profile(_) => {}
        }
    }
    sizes
}

/// States an effect's numbers by the holdout runs alone; `None` where these hardly show it.
pub fn by_held_out_runs(effect: &EffectAnswer) -> Option<String> {
    let HeldOutAnswer { runs, parameters, std, p_value } = effect.held_out.as_ref()?;
    let sizes = listed(&sizes(parameters, std));
    let judged = match *p_value < CHANCE_MAX {
        true => format!(
            "which is not what the fit runs say (chance of as much: {p_value:.0e}): it is not the same in all runs, \
             or not what acts"
        ),
        false => "which agrees with the fit runs".into(),
    };
    let kind = kind_name(effect.kind);
    Some(format!(" The {runs} runs held out by themselves give {kind}{sizes}, {judged}."))
}

/// Describes a certain and small effect: its kind with its numbers jointly with the usual errors.
pub fn small(outcome: &SearchOutcome, trial: &EffectTrial) -> String {
    let effect = &trial.fit.model.effects[trial.last()];
    let tried = trial.fit.effect_parameters(trial.last());
    let values = outcome.values(trial.kind).unwrap_or(tried);
    // One number, or one for each run.
    let each = effect.parameters().chunk_by(|one, other| one.name == other.name);
    let mut values = values.iter().copied();
    let each = each.map(|specs| {
        let (words, unit) = words::parameter(specs[0].name);
        let value = match span(values.by_ref().take(specs.len())) {
            Some([least, greatest]) if least < greatest => format!("{least:.4} to {greatest:.4}"),
            value => format!("{:.4}", value.map_or(f64::NAN, |[value, _]| value)),
        };
        format!("{words} {value} {unit}").trim_end().to_owned()
    });
    format!("{} ({})", kind_name(trial.kind.name()), each.collect::<Vec<_>>().join(", "))
}

/// Returns the windows by run and time, however they were found.
fn in_order<W>(windows: &[W], key: fn(&W) -> (&String, f64)) -> std::vec::IntoIter<&W> {
    let mut all: Vec<&W> = windows.iter().collect();
    all.sort_by(|one, other| {
        let ((run, from_s), (other_run, other_s)) = (key(one), key(other));
        run.cmp(other_run).then(from_s.total_cmp(&other_s))
    });
    all.into_iter()
}

/// The words for the probability of an effect.
pub const CHANCE: &str = "chance of as much where nothing acts";

/// Describes scales of the speeds that contradict each other.
pub fn contradicting_scales(scales: &ScaleSources) -> String {
    let percent = |it: WithStd| {
        format!("{:+.2} ± {:.2} %", 100.0 * (it.value - 1.0), 100.0 * HALF_95 * it.std)
    };
    format!(
        "Positions and motion contradict each other: by positions alone the speeds read {}, by \
         gradients and forces alone {}. One of them is wrong by more than usual, and no part is to be \
         replaced before it is known which.",
        percent(scales.positions),
        percent(scales.motion)
    )
}

/// Returns how sure it is that an effect acts, by the probability of finding as much where nothing does.
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
    format!("{CHANCE}: {odds}")
}

/// Returns the recommended action for an effect; `None` for one without a name.
pub fn to_do(effect: &EffectAnswer) -> Option<&'static str> {
    if effect.contradiction.is_some() {
        return Some("find out what is wrong before anything is replaced");
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

/// Returns where an effect acts, and how well the ends are known; `None` when it acts everywhere.
pub fn located(place: &Location) -> Option<String> {
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
        parts.push(words::stretches(intervals));
    }
    if let Some(windows) = &place.windows {
        let all = in_order(windows, |w| (&w.run, w.t_start_s)).map(|w| {
            format!("in {} from {:.0} to {:.0} s", w.run, w.t_start_s.round() + 0.0, w.t_end_s)
        });
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
    if !parts.is_empty() {
        parts.extend(precision(place));
    }
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// Returns where an effect acts, of one that changes along the line the stretch that its values cover.
pub fn place(effect: &EffectAnswer) -> String {
    let profiles = effect.parameters.values().filter_map(|value| match value {
        ParameterValue::Profile(nodes) => Some([nodes.first()?[0], nodes.last()?[0]]),
        _ => None,
    });
    let covered = || profiles.map(|stretch| words::stretches(&[stretch])).next();
    located(&effect.place).or_else(covered).unwrap_or_else(|| "everywhere".into())
}

/// Returns how well the ends of a place are known: half of the widest 95 % interval.
fn precision(place: &Location) -> Option<String> {
    let known = place.uncertainty_95.as_ref()?;
    let half = |interval: [f64; 2]| 0.5 * (interval[1] - interval[0]);
    let widest = |ends: &mut dyn Iterator<Item = [f64; 2]>| ends.map(half).reduce(f64::max);
    let ends_m = widest(&mut known.intervals_m.iter().flatten().flatten().copied());
    let windows = known.windows.iter().flatten();
    let ends_s = widest(&mut windows.flat_map(|it| [Some(it.t_start_s), it.t_end_s]).flatten());
    let range = widest(&mut known.range.iter().flatten().flatten().copied());
    let shown = [
        ends_m.map(|half| format!("{half:.0} m")),
        ends_s.map(|half| format!("{half:.0} s")),
        range.filter(|_| ends_m.is_none()).map(|half| {
            let half = number(half, Some(0.1 * half));
            format!("{half} {}", unit_of_range(place)).trim_end().to_owned()
        }),
    ];
    let shown: Vec<String> = shown.into_iter().flatten().collect();
    if ends_m.or(ends_s) == Some(0.0) {
        return Some("ends certain".into());
    }
    (!shown.is_empty()).then(|| format!("ends known to ± {} or better", shown.join(", ± ")))
}

/// Returns the unit of a place's range, by the end of its covariate's name.
fn unit_of_range(place: &Location) -> &'static str {
    let name = place.covariate.as_ref().map_or("", |it| it.name.as_str());
    match name.rsplit('_').next() {
        // A range of another covariate is that of it, whichever speeds it covers.
        Some("") if place.speed_range_mps.is_some() => "m/s",
        Some("mps") => "m/s",
        Some("mps2") => "m/s²",
        Some("m") => "m",
        Some("n") => "N",
        Some("s") => "s",
        Some("pa") => "Pa",
        Some("permille") => "‰",
        Some("degc") => "°C",
        _ => "",
    }
}

/// Returns the verdict where kinds act that change over the runs, and none that is the same in all of them.
pub fn changing(kinds: &[&str]) -> String {
    let kinds: Vec<String> = kinds.iter().map(|kind| kind_name(kind).to_owned()).collect();
    format!(
        "Nothing undeclared acts in all runs alike, as far as these show; over the runs changes {}.",
        joined(&kinds)
    )
}

/// Returns a verdict with its effects, the kinds that explain the runs as well as some of them, and the questions that
/// it leaves open.
pub fn verdict_words(
    verdict: Verdict,
    effects: &[EffectAnswer],
    competing: &[CompetingHypotheses],
    left: String,
) -> VerdictWords {
    let is_contested = |it: &&EffectAnswer| competing.iter().any(|c| c.accepted.name() == it.kind);
    let (contested, sure): (Vec<&EffectAnswer>, Vec<_>) = effects.iter().partition(is_contested);
    let listed = |list: &[&EffectAnswer]| {
        list.iter().map(|it| described(it)).collect::<Vec<_>>().join("; and ")
    };
    let found = listed(&effects.iter().collect::<Vec<_>>());
    let has_form = effects.iter().any(|it| it.kind == EffectKind::Unknown.name());
    let lacking = |count: usize| match count {
        1 => "Found: the declared model lacks one effect".to_owned(),
        count => format!("Found: the declared model lacks {count} effects"),
    };
    let something = if sure.is_empty() { "Something" } else { "Something else" };
    let open = format!("{something} undeclared acts, but these runs do not show what");
    let heading = match (verdict, sure.len()) {
        (Verdict::Effect, count) => lacking(count),
        (Verdict::Ambiguous, 0) => open.clone(),
        (Verdict::Ambiguous, count) => format!("{}. {open}", lacking(count)),
        (Verdict::Unknown, _) => {
            "Something undeclared acts that no effect of the library explains".into()
        }
        (Verdict::None | Verdict::InsufficientData, _) => {
            "Nothing undeclared acts, as far as these runs show: the declared model with a, b and \
             c refitted explains them"
                .into()
        }
    };
    let whole = match verdict {
        Verdict::Effect => format!("Found: {found}"),
        Verdict::Ambiguous => {
            let found = Some(listed(&sure)).filter(|it| !it.is_empty());
            let found = found.map_or(String::new(), |found| format!("Found: {found}. "));
            let rivals = kinds_of(competing).into_iter().map(|it| kind_name(it).to_owned());
            let rivals: Vec<String> = rivals.collect();
            let explain = if rivals.len() == 1 { "explains" } else { "explain" };
            let (contested, rivals) = (listed(&contested), joined(&rivals));
            format!("{found}{open}: it may be {contested}; {rivals} {explain} them as well")
        }
        Verdict::Unknown if has_form => format!("{heading}: {found}"),
        Verdict::Unknown if !found.is_empty() => format!("{heading}, beside {found}"),
        _ => heading.clone(),
    };
    VerdictWords { heading: heading + ".", whole: whole + ".", left }
}

#[cfg(test)]
mod tests;
