//! Metrics, births, sequence numbers and the queue, without any broker.

use std::collections::BTreeMap;

use crate::fields::NUMBERS;
use crate::node::{Known, Message, NodeName, Session, is_rebirth};
use crate::payload::{DataType, Metric, MetricValue, Payload, TextValue, Value};
use crate::queue::Counts;
use crate::train::Train;
use dynocar_client::Reading;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Quantity, RejectionReason, Status, TrainId,
};
use prost::Message as _;

const TRAIN: TrainId = TrainId(7);
const NOW_NS: i64 = 5_000_000_000;

/// A snapshot in which every number differs from every other.
fn snapshot() -> ParameterSnapshot {
    let mut it = ParameterSnapshot::empty();
    for (index, field) in it.fields_mut().into_iter().enumerate() {
        for entry in 0..field.count() {
            let number = 1000 * (index as u64 + 1) + entry as u64;
            // An integer takes the bits it has room for, a float the bits of a number.
            field.set_word(entry, number);
            if ParameterSnapshot::LAYOUT[index].type_name.contains("f64") {
                field.set_word(entry, (number as f64 + 0.5).to_bits());
            }
        }
    }
    it.train_id = TRAIN.0;
    it.pipeline_index = 2;
    it.pipeline_kind = PipelineKind::TrajectoryKalman as u32;
    (it.status, it.reason) = (Status::Estimated as u32, 2);
    it.quantities = Quantity::Resistance.bit();
    it.sample_published_ns = NOW_NS - 250_000_000;
    it.parameter_count = 3;
    it.parameters = [1, 2, 3, 0, 0, 0];
    it.covariance[0] = 4.0;
    it.excited = 0b101;
    (it.missing_manoeuvres, it.suspected_effect, it.suspected_alternatives) = (0b11, 4, 0b1010);
    it
}

fn take(train: &mut Train, snapshots: &[ParameterSnapshot], is_stale: bool, now_ms: u64) {
    let reading = |snapshot| Reading { snapshot, age_ns: 0, is_stale, quantity: None };
    train.take(snapshots.iter().map(reading), NOW_NS, now_ms);
}

fn known(queue: usize) -> Known {
    let mut known = Known::new(queue);
    let mut train = Train::new(TRAIN, 1);
    take(&mut train, &[snapshot()], false, 1);
    known.trains.insert(TRAIN, train);
    known
}

/// Makes a publication whatever has changed.
fn publish(known: &mut Known, now_ms: u64) {
    let publication = known.trains.get_mut(&TRAIN).unwrap().event("test", "again".into(), now_ms);
    known.publish(publication);
}

fn session() -> Session {
    let name = NodeName { group: "depot".into(), node: "host".into() };
    Session::new(&name, 0, 1)
}

fn decoded(message: &Message) -> Payload {
    Payload::decode(&*message.payload).unwrap()
}

fn kind(message: &Message) -> &str {
    message.topic.split('/').nth(2).unwrap()
}

fn named(metrics: Vec<Metric>) -> BTreeMap<String, Metric> {
    metrics.into_iter().map(|it| (it.name.clone().unwrap(), it)).collect()
}

fn text(metric: &Metric) -> &str {
    match &metric.value {
        Some(MetricValue::Text(text)) => text,
        other => panic!("{:?}: {other:?}", metric.name),
    }
}

#[test]
fn every_field_of_a_snapshot_is_born_with_name_unit_meaning_and_value() {
    let it = snapshot();
    let births = session().births(&known(9), 77);
    assert_eq!(births.iter().map(kind).collect::<Vec<_>>(), ["NBIRTH", "DBIRTH"]);
    assert_eq!(births[1].topic, "spBv1.0/depot/DBIRTH/host/train-7");
    let metrics = named(decoded(&births[1]).metrics);
    let metric = |name: &str| {
        metrics.get(&format!("2_trajectory_kalman/{name}")).unwrap_or_else(|| panic!("{name}"))
    };
    for field in NUMBERS.iter() {
        let (metric, word) = (metric(field.layout.name), it.fields()[field.index].word(0));
        let value = match field.entry_type() {
            "f64" => (MetricValue::Double(f64::from_bits(word)), DataType::Double),
            _ => (MetricValue::Long(word), DataType::UInt64),
        };
        assert_eq!(metric.value, Some(value.0), "{}", field.layout.name);
        assert_eq!(metric.datatype, Some(value.1 as u32));
        assert_eq!(metric.metadata.clone().unwrap().description.unwrap(), field.meaning);
        let unit = metric.properties.clone().map(|it| (it.keys[0].clone(), it.values[0].clone()));
        let unit = unit.map(|(key, value)| (key, value.value));
        let said = (!field.unit().is_empty())
            .then(|| ("engUnit".into(), Some(TextValue::Text(field.unit().into()))));
        assert_eq!(unit, said, "{}", field.layout.name);
    }
    assert_eq!(metric("resistance_a_n_per_kn").value, Some(MetricValue::Double(it.values[0])));
    assert_eq!(metric("std/resistance_a_n_per_kn").value, Some(MetricValue::Double(2.0)));
    for &reason in RejectionReason::ALL {
        let count = u64::from(it.rejected(reason));
        let metric = metric(&format!("rejected/{}", reason.name()));
        assert_eq!(metric.value, Some(MetricValue::Long(count)));
    }
    assert_eq!(metric("age_s").value, Some(MetricValue::Double(0.25)));
    for (name, words) in [
        ("status", "estimated"),
        ("reason", "weak_excitation"),
        ("suspect", "dragging_brake"),
        ("suspect_alternatives", "tunnel_drag,wind"),
        ("missing_manoeuvres", "coast_slow,coast_fast"),
        ("excited", "resistance_a_n_per_kn,resistance_c_n_per_kn_per_mps2"),
    ] {
        assert_eq!(text(metric(name)), words, "{name}");
    }
    assert_eq!(text(&metrics["answers/resistance"]), "2_trajectory_kalman");
    assert_eq!(metrics["answers/mass"].is_null, Some(true), "nobody answers");
    let aliases: std::collections::BTreeSet<_> = metrics.values().map(|it| it.alias).collect();
    assert_eq!(aliases.len(), metrics.len(), "no alias twice");
}

#[test]
fn every_field_of_the_layout_is_forwarded_or_said_in_words_or_is_a_time_of_the_hosts_clock() {
    let in_words = [
        "train_id",
        "pipeline_index",
        "pipeline_kind",
        "status",
        "reason",
        "quantities",
        "train_quantities",
        "usable_quantities",
        "mass_source",
        "rejected_by_reason",
        "parameter_count",
        "excited",
        "missing_manoeuvres",
        "suspected_effect",
        "suspected_alternatives",
        "parameters",
        "values",
        "covariance",
    ];
    for field in ParameterSnapshot::LAYOUT {
        let is_number = NUMBERS.iter().any(|it| it.layout.name == field.name);
        let is_other = in_words.contains(&field.name) || field.name.ends_with("_ns");
        assert!(is_number != is_other, "{}", field.name);
    }
}

#[test]
fn only_what_has_changed_is_published_and_what_is_gone_is_null() {
    let mut train = Train::new(TRAIN, 1);
    let mut it = snapshot();
    take(&mut train, &[it], false, 1);
    let all = Payload::decode(&*train.publication(1).unwrap().payload).unwrap().metrics.len();
    assert_eq!(all, train.metric_count());
    take(&mut train, &[it], false, 2);
    assert_eq!(train.publication(2), None, "nothing has changed");

    it.samples_used += 1;
    (it.parameter_count, it.excited) = (2, 0b001);
    take(&mut train, &[it], false, 3);
    let changed = Payload::decode(&*train.publication(3).unwrap().payload).unwrap();
    let names: BTreeMap<u64, String> =
        train.born().into_iter().map(|it| (it.alias.unwrap(), it.name.unwrap())).collect();
    let mut published: Vec<_> =
        changed.metrics.iter().map(|it| &*names[&it.alias.unwrap()]).collect();
    published.sort_unstable();
    let c = "resistance_c_n_per_kn_per_mps2";
    let folder = "2_trajectory_kalman";
    let expected = [
        format!("{folder}/excited"),
        format!("{folder}/{c}"),
        format!("{folder}/samples_used"),
        format!("{folder}/std/{c}"),
        "publication".into(),
    ];
    assert_eq!(published, expected);
    let nulls = changed.metrics.iter().filter(|it| it.is_null == Some(true) && it.value.is_none());
    assert_eq!(nulls.count(), 2, "c and its standard deviation");
    assert!(changed.metrics.iter().all(|it| it.timestamp == Some(3) && it.name.is_none()));
}

#[test]
fn a_silent_daemon_makes_the_status_invalid_and_the_device_die_and_be_born_again() {
    let (mut known, mut session) = (known(9), session());
    session.births(&known, 1);
    assert_eq!(session.births_and_deaths(&known, 2), []);
    let train = known.trains.get_mut(&TRAIN).unwrap();
    take(train, &[snapshot()], true, 3);
    let born = named(train.born());
    assert_eq!(text(&born["2_trajectory_kalman/status"]), "invalid");
    assert_eq!(text(&born["2_trajectory_kalman/reason"]), "daemon_silent");
    let death = session.births_and_deaths(&known, 3);
    assert_eq!(death.iter().map(kind).collect::<Vec<_>>(), ["DDEATH"]);
    assert_eq!(session.births_and_deaths(&known, 4), [], "once");
    take(known.trains.get_mut(&TRAIN).unwrap(), &[snapshot()], false, 5);
    let birth = session.births_and_deaths(&known, 5);
    assert_eq!(birth.iter().map(kind).collect::<Vec<_>>(), ["DBIRTH"]);
}

#[test]
fn numbers_of_messages_go_from_0_to_255_and_begin_anew_with_a_birth() {
    let (mut known, mut session) = (known(10_000), session());
    let mut seqs = Vec::new();
    seqs.extend(session.births(&known, 1).iter().map(|it| decoded(it).seq));
    for now_ms in 0..300 {
        publish(&mut known, now_ms);
        for message in session.next(&mut known, now_ms) {
            assert_eq!(kind(&message), "DDATA");
            seqs.push(decoded(&message).seq);
        }
    }
    let expected: Vec<_> = (0..302).map(|number| Some(number % 256)).collect();
    assert_eq!(seqs, expected);
    let again: Vec<_> = session.births(&known, 9).iter().map(|it| decoded(it).seq).collect();
    assert_eq!(again, [Some(0), Some(1)]);
    let (birth, death) = (session.births(&known, 9), decoded(&session.death(9)));
    let bd_seq = |metrics: Vec<Metric>| named(metrics)["bdSeq"].value.clone();
    assert_eq!(bd_seq(decoded(&birth[0]).metrics), bd_seq(death.metrics));
    assert_eq!(death.seq, None);
}

#[test]
fn a_command_for_rebirth_is_understood_and_nothing_else_is() {
    let command = |name: &str, value| {
        let metric = Metric { name: Some(name.into()), value, ..Metric::default() };
        Payload { metrics: vec![metric], ..Payload::default() }.encode_to_vec()
    };
    let (yes, no) = (Some(MetricValue::Boolean(true)), Some(MetricValue::Boolean(false)));
    assert!(is_rebirth(&command("Node Control/Rebirth", yes.clone())));
    assert!(!is_rebirth(&command("Node Control/Rebirth", no)));
    assert!(!is_rebirth(&command("Node Control/Reboot", yes)));
    assert!(!is_rebirth(b"\xff\xff garbage"));
    let own = named(decoded(&session().births(&known(9), 1)[0]).metrics);
    assert_eq!(own["Node Control/Rebirth"].value, Some(MetricValue::Boolean(false)));
}

#[test]
fn a_train_that_has_more_metrics_than_it_was_born_with_is_born_again_before_its_data() {
    let (mut known, mut session) = (known(9), session());
    session.births(&known, 1);
    let mut other = snapshot();
    (other.pipeline_index, other.pipeline_kind) = (3, PipelineKind::MassKalman as u32);
    other.parameters[0] = Parameter::Mass as u32;
    take(known.trains.get_mut(&TRAIN).unwrap(), &[snapshot(), other], false, 2);
    publish(&mut known, 2);
    let messages = session.next(&mut known, 2);
    assert_eq!(messages.iter().map(kind).collect::<Vec<_>>(), ["DBIRTH", "DDATA"]);
    let born = named(decoded(&messages[0]).metrics);
    assert!(
        born.contains_key("3_mass_kalman/mass_t")
            && born.contains_key("2_trajectory_kalman/status")
    );
}

#[test]
fn a_full_queue_drops_the_oldest_and_the_train_then_reports_everything() {
    let mut known = known(4);
    for now_ms in 1..=4 {
        publish(&mut known, now_ms);
    }
    assert_eq!(known.queue.counts(), Counts { made: 4, taken: 0, dropped: 0, waiting: 4 });
    publish(&mut known, 5);
    assert_eq!(known.queue.counts(), Counts { made: 5, taken: 0, dropped: 1, waiting: 4 });
    let oldest = Payload::decode(&*known.queue.next().unwrap().payload).unwrap();
    assert_eq!(oldest.timestamp, Some(2), "the first has gone");
    let train = known.trains.get_mut(&TRAIN).unwrap();
    let next = Payload::decode(&*train.publication(6).unwrap().payload).unwrap();
    assert_eq!(next.metrics.len(), train.metric_count());
}

#[test]
fn what_the_broker_has_not_taken_is_sent_again_as_historical_and_all_is_accounted_for() {
    let (mut known, mut session) = (known(8), session());
    session.births(&known, 0);
    let is_sum_right = |known: &Known| {
        let it = known.queue.counts();
        assert_eq!(it.made, it.taken + it.dropped + it.waiting, "{it:?}");
        assert!(it.waiting <= 8, "{it:?}");
    };
    for now_ms in 1..=20 {
        publish(&mut known, now_ms);
        session.next(&mut known, now_ms);
        is_sum_right(&known);
    }
    assert!(session.next(&mut known, 20).is_empty(), "half of the queue is under way");
    known.queue.give_back();
    is_sum_right(&known);
    known.queue.begin();
    let again = decoded(&session.next(&mut known, 21).pop().unwrap());
    assert_eq!(again.timestamp, Some(1), "the oldest of those that were under way");
    assert!(again.metrics.iter().all(|it| it.is_historical == Some(true)));
    while !session.next(&mut known, 22).is_empty() || known.queue.next().is_some() {
        known.queue.take_note();
        is_sum_right(&known);
    }
    known.queue.take_note();
    publish(&mut known, 23);
    let new = decoded(&session.next(&mut known, 23).pop().unwrap());
    assert!(new.metrics.iter().all(|it| it.is_historical.is_none()), "what comes then is of now");
}

#[test]
fn the_nodes_own_counts_are_published_when_they_have_changed() {
    let (mut known, mut session) = (known(2), session());
    let own = named(decoded(&session.births(&known, 1)[0]).metrics);
    assert_eq!(own["forward/dropped"].value, Some(MetricValue::Long(0)));
    assert_eq!(session.own_data(&known, 2), None);
    (1..=5).for_each(|now_ms| publish(&mut known, now_ms));
    let data = decoded(&session.own_data(&known, 3).unwrap());
    let alias = own["forward/dropped"].alias;
    let dropped = data.metrics.iter().find(|it| it.alias == alias).unwrap();
    assert_eq!(dropped.value, Some(MetricValue::Long(3)));
}

#[test]
fn a_value_that_is_missing_is_null_and_keeps_its_type() {
    for (value, datatype) in [
        (Value::Count(None), DataType::UInt64),
        (Value::Number(None), DataType::Double),
        (Value::Words(None), DataType::String),
    ] {
        let metric = value.born("x", Some(1), "", "", 5);
        assert_eq!((metric.is_null, metric.value), (Some(true), None));
        assert_eq!(metric.datatype, Some(datatype as u32));
    }
}
