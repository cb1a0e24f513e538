//! Messages, their tables and the page of the fields agree.

use std::collections::HashSet;

use dynocar_mcap::columns::{EVENTS, SAMPLES, SNAPSHOTS};
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::schema::{DESCRIPTORS, SUFFIXES, suffixed_name};
use dynocar_recording::page::page;
use dynocar_shared::Parameter;
use prost::Message;
use prost::encoding::{DecodeContext, decode_key, skip_field};
use prost_types::FileDescriptorSet;

#[test]
fn the_table_of_fields_is_that_of_the_message() {
    let event = Event {
        monotonic_ns: 1,
        train_id: 1,
        kind: EventKind::SamplesLost as i32,
        pipeline_index: Some(1),
        status: Some(1),
        reason: Some(1),
        count: Some(1),
        text: "lost".into(),
    };
    let bytes = event.encode_to_vec();
    let mut rest = &bytes[..];
    let mut numbers = Vec::new();
    while !rest.is_empty() {
        let (number, wire_type) = decode_key(&mut rest).unwrap();
        skip_field(wire_type, number, &mut rest, DecodeContext::default()).unwrap();
        numbers.push(number);
    }
    assert_eq!(numbers, Event::FIELDS.iter().map(|it| it.number).collect::<Vec<_>>());
    for (index, kind) in EventKind::ALL.iter().enumerate() {
        assert_eq!(*kind as usize, index);
    }
    let shown = format!("{event:?}");
    assert!(Event::FIELDS.iter().all(|it| shown.contains(&format!("{}:", it.name))), "{shown}");
}

#[test]
fn names_and_numbers_are_unique_in_every_message_and_numbers_never_meet_the_nested_ones() {
    let set = FileDescriptorSet::decode(&DESCRIPTORS[..]).unwrap();
    let file = &set.file[0];
    for message in &file.message_type {
        let names: HashSet<_> = message.field.iter().map(|it| it.name()).collect();
        let numbers: HashSet<_> = message.field.iter().map(|it| it.number()).collect();
        assert_eq!((names.len(), numbers.len()), (message.field.len(), message.field.len()));
    }
    let members: Vec<_> =
        file.enum_type.iter().flat_map(|it| &it.value).map(|it| it.name()).collect();
    assert_eq!(members.iter().collect::<HashSet<_>>().len(), members.len());
    assert!(file.enum_type.iter().all(|it| it.value[0].number() == 0));
}

#[test]
fn parameters_have_names_with_units_and_deviations_and_intervals_next_to_them() {
    let of = |&it: &Parameter| {
        let suffixed = SUFFIXES.map(|(_, word, ..)| suffixed_name(it, word));
        std::iter::once(it.full_name().to_owned()).chain(suffixed)
    };
    let names: Vec<String> = Parameter::ALL.iter().flat_map(of).collect();
    let expected = [
        "resistance_a_n_per_kn",
        "resistance_a_std_n_per_kn",
        "resistance_a_low_n_per_kn",
        "resistance_a_high_n_per_kn",
        "resistance_b_n_per_kn_per_mps",
        "resistance_b_std_n_per_kn_per_mps",
        "resistance_b_low_n_per_kn_per_mps",
        "resistance_b_high_n_per_kn_per_mps",
    ];
    assert_eq!(names[..expected.len()], expected);
    for other in ["mass_t", "mass_std_t", "adhesion", "adhesion_high"] {
        assert!(names.contains(&other.to_owned()), "{other}");
    }
    assert!(names.contains(&"unexplained_force_std_n".to_owned()));
}

#[test]
fn columns_are_the_fields_of_the_messages_with_their_numbers_names_and_types() {
    let set = FileDescriptorSet::decode(&DESCRIPTORS[..]).unwrap();
    let names = |message: &str| -> Vec<String> {
        let found = set.file[0].message_type.iter().find(|it| it.name() == message).unwrap();
        found.field.iter().map(|it| it.name().to_owned()).collect()
    };
    let rejected = names("Rejected").into_iter().map(|it| format!("rejected_{it}"));
    let estimate = names("Estimate").into_iter().map(|it| format!("estimate_{it}"));
    let nested = |it: &String| it != "estimate" && it != "rejected";
    let snapshot: Vec<String> = names("ParameterSnapshot")
        .into_iter()
        .filter(nested)
        .chain(estimate)
        .chain(rejected)
        .collect();
    for (columns, expected) in
        [(&SAMPLES, names("TrainSample")), (&SNAPSHOTS, snapshot), (&EVENTS, names("Event"))]
    {
        let column_names: Vec<&str> = columns.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(column_names[..2], ["message_number", "log_time"]);
        assert_eq!(column_names[2..], expected);
        assert_eq!(
            column_names.iter().collect::<HashSet<_>>().len(),
            column_names.len(),
            "each name once"
        );
        assert!(columns.iter().all(|it| it.vocabulary.is_none() || !it.names().is_empty()));
    }
}

#[test]
fn numbers_of_an_event_are_set_as_they_are_read() {
    let mut event =
        Event { kind: EventKind::DaemonGone as i32, text: "x".into(), ..Event::default() };
    for index in 0..Event::FIELDS.len() - 1 {
        event.set_word(index, Some(index as u64 + 1));
        assert_eq!(event.word(index), Some(index as u64 + 1), "{}", Event::FIELDS[index].name);
        if Event::FIELDS[index].is_optional {
            event.set_word(index, None);
            assert_eq!(event.word(index), None);
        }
    }
    let shown = format!("{event:?}");
    assert!(shown.contains("monotonic_ns: 1") && shown.contains("text: \"x\""), "{shown}");
}

#[test]
fn the_page_of_the_fields_is_the_one_in_the_documents() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/recording_fields.md");
    let kept = std::fs::read_to_string(path).expect("the page");
    assert!(kept == page(), "`dynocar-recording fields > docs/recording_fields.md`");
}
