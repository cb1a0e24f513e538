//! What was verified, in words.

use std::fmt::Write;

use dynocar_shared::schema::unit_of;
use dynocar_shared::{HALF_95, Parameter, ParameterSnapshot, Quantity, Reason};

use super::{Outcome, QuantityAnswer, STAMPS, Verified};

/// The answer for people.
pub fn text(verified: &[Verified]) -> String {
    let mut text = String::new();
    let mut epoch = None;
    for it in verified {
        if epoch != Some(it.epoch) {
            let _ = writeln!(text, "daemon of epoch {}", it.epoch);
            epoch = Some(it.epoch);
        }
        let Verified { train, index, name, recorded, same, .. } = it;
        let _ = writeln!(
            text,
            "  train {train}, {index} {name}: {same} of {recorded} snapshots the same to the bit{}",
            rest(it)
        );
    }
    let _ = writeln!(text, "compared: every field but {}", STAMPS.join(", "));
    text
}

fn rest(it: &Verified) -> String {
    let state = match it.keeps_state {
        true => "; the daemon keeps states ([state]) and may have started from one",
        false => "",
    };
    match &it.outcome {
        Outcome::Same => String::new(),
        Outcome::BeginsLate { before } => format!(
            "; cannot be verified: the pipeline had taken {before} samples before the first recorded"
        ),
        Outcome::OtherSamples { agree_up_to: 0, why } => format!("; cannot be verified: {why}"),
        Outcome::OtherSamples { agree_up_to, why } => {
            format!("; cannot be verified after sample {agree_up_to}: {why}")
        }
        Outcome::NotConfigured => "; the attached configuration has no such pipeline".into(),
        Outcome::Differs(it) => format!(
            "; differs from sample {} on: {} recorded as {}, computed as {}{state}",
            it.sample, it.field, it.recorded, it.computed
        ),
    }
}

/// What two configurations answer after the last sample, side by side.
pub fn overlay_text(recorded: &[QuantityAnswer], other: &[QuantityAnswer], name: &str) -> String {
    let mut text = format!(
        "after the last sample, each computed from the first recorded one\n{:<44} {:>32} {:>32}\n",
        "", "recorded configuration", name
    );
    let mut keys: Vec<(u64, Quantity)> =
        recorded.iter().chain(other).map(|it| (it.train, it.quantity)).collect();
    keys.sort_by_key(|it| (it.0, it.1 as u32));
    keys.dedup();
    for (train, quantity) in keys {
        let find = |answers: &[QuantityAnswer]| {
            answers.iter().find(|it| (it.train, it.quantity) == (train, quantity)).cloned()
        };
        let (one, two) = (find(recorded), find(other));
        let shown = |it: &Option<QuantityAnswer>, show: &dyn Fn(&QuantityAnswer) -> String| {
            it.as_ref().map_or("-".to_owned(), show)
        };
        let mut row = |title: &str, show: &dyn Fn(&QuantityAnswer) -> String| {
            let (one, two) = (shown(&one, show), shown(&two, show));
            let _ = writeln!(text, "{title:<44} {one:>32} {two:>32}");
        };
        row(&format!("train {train}, {quantity}"), &|it| it.pipeline.clone());
        row("  status", &|it| status(&it.snapshot));
        for &parameter in Parameter::ALL {
            let has = |it: &Option<QuantityAnswer>| {
                it.as_ref().is_some_and(|it| it.snapshot.index_of(parameter).is_some())
            };
            if has(&one) || has(&two) {
                let (name, unit) = (parameter.full_name(), unit_of(parameter.full_name()));
                let title = format!("  {name} in {unit}");
                let title = if unit.is_empty() { format!("  {name}") } else { title };
                row(&title, &|it| value(&it.snapshot, parameter));
            }
        }
    }
    text + "± is the half width of the 95 % interval\n"
}

fn status(it: &ParameterSnapshot) -> String {
    match it.reason() {
        None | Some(Reason::None) => it.status().to_string(),
        Some(reason) => format!("{} ({reason})", it.status()),
    }
}

fn value(it: &ParameterSnapshot, parameter: Parameter) -> String {
    match (it.value(parameter), it.std(parameter)) {
        (Some(value), Some(std)) => format!("{value:.6} ± {:.6}", HALF_95 * std),
        _ => "-".into(),
    }
}
