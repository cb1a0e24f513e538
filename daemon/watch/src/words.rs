//! Numbers with intervals and units, and sentences on a train, for screen and lines alike.

use dynocar::operator::{SILENT_S, Suspicion, duration, force_words, refusals};
use dynocar_shared::schema::unit_of;
use dynocar_shared::{HALF_95, Parameter, Quantity, UseState};

use crate::state::{Daemon, PipelineState, TrainState};

/// A quantity or one of its parameters in a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuantityRow {
    /// Label; parameters of a quantity are indented.
    pub label: String,
    /// The value; a bound has a sign before it.
    pub number: String,
    /// Half width of the 95 % interval, with a sign before it.
    pub interval: String,
    /// The unit of both.
    pub unit: &'static str,
    /// The state of use, for a quantity.
    pub use_state: Option<UseState>,
    /// Why; empty where there is nothing to remark.
    pub why: &'static str,
    /// Age in s of the newest sample behind it.
    pub age_s: Option<f64>,
}

/// Returns the table of a train's quantities; the resistance at these shares of the speeds driven.
pub fn rows(train: &TrainState, shares: &[f64]) -> Vec<QuantityRow> {
    let mut all = Vec::new();
    for &quantity in Quantity::ALL {
        let Some(pipeline) = train.answering(quantity) else { continue };
        let head = QuantityRow {
            label: quantity.name().replace('_', " "),
            use_state: Some(pipeline.use_of(quantity)),
            why: pipeline.why(quantity),
            age_s: pipeline.sample_age_s,
            ..QuantityRow::default()
        };
        if quantity == Quantity::Resistance {
            all.push(head);
            all.extend(resistance_rows(pipeline, shares));
        } else {
            let value = main_value(quantity, pipeline);
            all.push(QuantityRow {
                number: value.number,
                interval: value.interval,
                unit: value.unit,
                ..head
            });
        }
    }
    all
}

fn resistance_rows(pipeline: &PipelineState, shares: &[f64]) -> Vec<QuantityRow> {
    let snapshot = &pipeline.snapshot;
    let of_parameter = |parameter: Parameter| {
        let (value, std) = (snapshot.value(parameter)?, snapshot.std(parameter)?);
        let label = format!("  {}", parameter.name());
        Some(QuantityRow { label, ..with_interval(value, std, unit_of(parameter.full_name())) })
    };
    let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
    let (low, high) = (snapshot.speed_min_mps, snapshot.speed_max_mps);
    let at_speed = |share: &f64| {
        let speed_mps = (low + share * (high - low)).round();
        let w0 = snapshot.resistance_at(speed_mps).filter(|_| high > low)?;
        let label = format!("  at {:.0} km/h", 3.6 * speed_mps);
        Some(QuantityRow { label, ..with_interval(w0.w0_n_per_kn, w0.w0_std_n_per_kn, "N/kN") })
    };
    davis.into_iter().filter_map(of_parameter).chain(shares.iter().filter_map(at_speed)).collect()
}

/// Returns the value of a quantity other than the resistance.
fn main_value(quantity: Quantity, pipeline: &PipelineState) -> QuantityRow {
    let candidates: &[Parameter] = match quantity {
        Quantity::Resistance => &[],
        Quantity::Mass => &[Parameter::Mass],
        Quantity::Adhesion => &[Parameter::Adhesion, Parameter::AdhesionLowerBound],
        Quantity::BrakeFriction => &[Parameter::DiscFriction],
        Quantity::BrakingRatio => &[Parameter::BrakingRatio],
    };
    let snapshot = &pipeline.snapshot;
    let found = candidates.iter().find_map(|&parameter| {
        Some((parameter, snapshot.value(parameter)?, snapshot.std(parameter)?))
    });
    let Some((parameter, value, std)) = found else { return QuantityRow::default() };
    let row = with_interval(value, std, unit_of(parameter.full_name()));
    match parameter {
        Parameter::AdhesionLowerBound => {
            QuantityRow { number: format!("≥ {}", row.number), ..row }
        }
        _ => row,
    }
}

/// Returns a value with its interval, to two digits of the interval.
fn with_interval(value: f64, std: f64, unit: &'static str) -> QuantityRow {
    let half = HALF_95 * std;
    let digits = digits(half);
    let interval = if half > 0.0 { format!("± {half:.digits$}") } else { String::new() };
    QuantityRow { number: format!("{value:.digits$}"), interval, unit, ..QuantityRow::default() }
}

/// Decimals that show two digits of an interval.
fn digits(half: f64) -> usize {
    if half > 0.0 { (1.0 - half.log10().floor()).clamp(0.0, 7.0) as usize } else { 3 }
}

/// Returns who serves a train.
pub fn daemon(daemon: &Daemon, up_s: Option<f64>) -> String {
    match daemon {
        Daemon::Absent => "no daemon serves it; waiting".to_owned(),
        Daemon::Gone => "the daemon is gone; what it said last is shown; waiting".to_owned(),
        Daemon::Serving { version, process_id } => {
            let up = up_s.map_or(String::new(), |up_s| format!(", up {}", duration(up_s)));
            format!("daemon {version} (process {process_id}){up}")
        }
        Daemon::Unreadable(message) => message.clone(),
    }
}

/// Rate, uses, refusals with the most frequent reason, and losses, of the pipeline that has most.
pub fn samples(train: &TrainState) -> String {
    let sum = |of: fn(&PipelineState) -> u64| train.pipelines.iter().map(of).max().unwrap_or(0);
    let used = sum(|it| it.snapshot.samples_used);
    let rejected = sum(|it| it.snapshot.samples_rejected);
    let lost = sum(|it| it.snapshot.samples_lost);
    let rate = train.pipelines.iter().filter_map(|it| it.history.rate_hz()).reduce(f64::max);
    let newest_s = train.pipelines.iter().filter_map(|it| it.sample_age_s).reduce(f64::min);
    let rate = match (newest_s, rate) {
        (Some(age_s), _) if age_s > SILENT_S => format!("no sample for {}", duration(age_s)),
        (_, Some(rate)) => format!("{rate:.1} samples/s"),
        (_, None) => "… samples/s".to_owned(),
    };
    let most = train.pipelines.iter().max_by_key(|it| it.snapshot.samples_rejected);
    let why = most.and_then(|it| refusals(&it.snapshot.rejected_by_reason).into_iter().next());
    let why = why.map_or(String::new(), |(reason, _)| format!(" (most: {reason})"));
    format!("{rate}, used {used}, rejected {rejected}{why}, lost {lost}")
}

/// Returns the unexplained force with its interval, and the suspect with its alternatives.
pub fn residual(train: &TrainState) -> Option<(String, String)> {
    let snapshot = &train.residual()?.snapshot;
    let force = force_words(snapshot.unexplained_force_n, snapshot.unexplained_force_std_n);
    let suspect = Suspicion::from_snapshot(snapshot).map_or("none".to_owned(), |it| it.to_string());
    Some((force, suspect))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_of_the_interval_are_shown() {
        let printed = |value, std, unit| {
            let row = with_interval(value, std, unit);
            [&row.number, row.interval.as_str(), row.unit].join(" ").trim_end().to_owned()
        };
        assert_eq!(printed(1.49832, 0.0274, "N/kN"), "1.498 ± 0.054 N/kN");
        assert_eq!(printed(1697.4, 6.0, "t"), "1697 ± 12 t");
        assert_eq!(printed(0.000_861, 0.000_013, ""), "0.000861 ± 0.000025");
        assert_eq!(printed(0.094, 0.0, ""), "0.094");
    }
}
