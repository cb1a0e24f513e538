//! What of a snapshot becomes which metric.
//!
//! Every field of the shared table (`dynocar_shared::schema`) is forwarded but these: arrays and counts of
//! entries, for their entries have names of their own; numbers of a vocabulary and bits, for their words stand for
//! them; and times of the host's monotonic clock, for ages stand for them where that clock is unknown.

use std::sync::LazyLock;

use dynocar_client::Reading;
use dynocar_shared::schema::{Field, snapshot_fields};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Manoeuvre, MassSource, Parameter, Quantity, Reason, RejectionReason};

use crate::payload::Value;

/// What does not change about a metric of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MetricMeta {
    /// The folder within the pipeline's; empty for none.
    pub folder: &'static str,
    /// The name, with its unit.
    pub name: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
}

/// Fields that words stand for, or that the metric's name says.
const SAID_OTHERWISE: [&str; 14] = [
    "train_id",
    "pipeline_index",
    "pipeline_kind",
    "status",
    "reason",
    "quantities",
    "train_quantities",
    "mass_source",
    "usable_quantities",
    "parameter_count",
    "excited",
    "missing_manoeuvres",
    "suspected_effect",
    "suspected_alternatives",
];

/// The fields that are forwarded as the numbers they are.
pub static NUMBERS: LazyLock<Vec<Field>> = LazyLock::new(|| {
    let is_number = |field: &Field| {
        let name = field.layout.name;
        !field.is_array() && !SAID_OTHERWISE.contains(&name) && !name.ends_with("_ns")
    };
    snapshot_fields().filter(is_number).collect()
});

/// Gives every metric of a pipeline: what it is, and its value at this moment of the host's monotonic clock.
pub fn each_metric(reading: &Reading<'_>, now_ns: i64, mut give: impl FnMut(MetricMeta, Value)) {
    let it = reading.snapshot;
    let mut put = |folder, name, meaning, value| {
        give(MetricMeta { folder, name, meaning }, value);
    };
    let status = Value::words(reading.status().name());
    put("", "status", "What may be done with the estimate", status);
    let reason = reading.reason().map_or("unknown", Reason::name);
    put("", "reason", "Why the status is what it is", Value::words(reason));
    let age_s = 1e-9 * now_ns.saturating_sub(it.sample_published_ns).max(0) as f64;
    let age_s = (it.sample_sequence > 0).then_some(age_s);
    put("", "age_s", "Age of the newest sample behind the estimate", Value::Number(age_s));
    for (index, &number) in it.parameters.iter().take(it.parameter_count as usize).enumerate() {
        let Some(parameter) = Parameter::from_number(number) else { continue };
        // A field of this name says it, and another its standard deviation.
        if parameter == Parameter::UnexplainedForce {
            continue;
        }
        let (name, meaning) = (parameter.full_name(), parameter.meaning().trim());
        let std = it.covariance_at(index, index).max(0.0).sqrt();
        put("", name, meaning, Value::Number(Some(it.values[index])));
        put("std", name, "Standard deviation of the value of this name", Value::Number(Some(std)));
    }
    let words = it.fields();
    for field in NUMBERS.iter() {
        let word = words[field.index].word(0);
        let value = match field.entry_type() {
            "f64" => Value::Number(Some(f64::from_bits(word))),
            _ => Value::Count(Some(word)),
        };
        put("", field.layout.name, field.meaning, value);
    }
    for &reason in RejectionReason::ALL {
        let count = Value::Count(Some(u64::from(it.rejected(reason))));
        put("rejected", reason.name(), reason.meaning().trim(), count);
    }
    let suspect = EffectKind::from_number(it.suspected_effect).map_or("unknown", EffectKind::name);
    put("", "suspect", "Suspected effect that the model lacks", Value::words(suspect));
    let meaning = "Other effects that these data hardly distinguish from it, with commas between";
    put("", "suspect_alternatives", meaning, listed(it.alternatives().map(EffectKind::name)));
    let source = it.mass_source().map_or("unknown", MassSource::name);
    put("", "mass_source", "Where the mass comes from", Value::words(source));
    let usable = Quantity::ALL.iter().filter(|quantity| it.is_usable_for(**quantity));
    let meaning = "Quantities whose values a controller may use, with commas between";
    put("", "usable", meaning, listed(usable.map(|quantity| quantity.name())));
    let is_excited = |index: &usize| it.excited & (1 << index) != 0;
    let excited = (0..it.parameter_count as usize).filter(is_excited);
    let excited = excited.filter_map(|index| Parameter::from_number(it.parameters[index]));
    let meaning = "Parameters that the data excited, with commas between";
    put("", "excited", meaning, listed(excited.map(Parameter::full_name)));
    let missing = Manoeuvre::ALL.iter().filter(|a| it.missing_manoeuvres & a.bit() != 0);
    let meaning = "Manoeuvres that would show what the data do not, with commas between";
    put("", "missing_manoeuvres", meaning, listed(missing.map(|a| a.name())));
}

/// Names with commas between.
fn listed(names: impl Iterator<Item = &'static str>) -> Value {
    Value::words(names.collect::<Vec<_>>().join(","))
}
