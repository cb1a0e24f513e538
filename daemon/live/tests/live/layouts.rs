//! Every topic and field that a shipped layout shows is served and recorded with the shipped configuration; viewers get
//! as many samples as a picture needs.

use std::path::{Path, PathBuf};

use dynocar::config::DaemonConfig;
use dynocar_live::viewers::Thinning;
use dynocar_mcap::schema::DESCRIPTORS;
use dynocar_mcap::topic::Topic;
use prost::Message;
use prost_types::field_descriptor_proto::Type;
use prost_types::{FileDescriptorProto, FileDescriptorSet};
use serde_json::Value;

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(config(name)).expect("a shipped file")
}

/// Returns the topics of the shipped daemon and its controller.
fn topics() -> Vec<Topic> {
    let shipped = DaemonConfig::load(&config("daemon.toml")).expect("the shipped configuration");
    let snapshots = shipped.pipelines.iter().enumerate();
    let snapshots =
        snapshots.map(|(index, it)| Topic::Snapshots(1, index as u32, it.estimator.kind() as u32));
    snapshots.chain([Topic::Samples(1), Topic::Events]).collect()
}

fn descriptors() -> FileDescriptorProto {
    FileDescriptorSet::decode(DESCRIPTORS.as_slice()).unwrap().file.remove(0)
}

/// Whether a message has a field under this path, that is no message of its own.
fn has_field(file: &FileDescriptorProto, message: &str, path: &[&str]) -> bool {
    let name = message.rsplit('.').next().unwrap();
    let found = file.message_type.iter().find(|it| it.name() == name).unwrap();
    let Some((first, rest)) = path.split_first() else { return false };
    let Some(field) = found.field.iter().find(|it| it.name() == *first) else { return false };
    match (field.r#type(), rest.is_empty()) {
        (Type::Message, false) => has_field(file, field.type_name(), rest),
        (of_type, is_last) => is_last && of_type != Type::Message,
    }
}

/// The index of a path among the topics, and the rest of it.
fn split<'a>(topics: &'a [Topic], path: &'a str) -> Option<(&'a Topic, &'a str)> {
    topics.iter().find_map(|it| Some((it, path.strip_prefix(&it.name()[..])?)))
}

fn assert_shown(file: &FileDescriptorProto, topics: &[Topic], path: &str, separator: char) {
    let (topic, rest) =
        split(topics, path).unwrap_or_else(|| panic!("{path}: no topic of {topics:?}"));
    let fields: Vec<&str> =
        rest.strip_prefix(separator).unwrap_or_default().split(separator).collect();
    let (schema, _) = topic.schema_and_layout();
    assert!(has_field(file, schema, &fields), "{path}: no such field of {schema}");
}

/// The values of a key, wherever it stands.
fn values_of<'a>(tree: &'a Value, key: &str, found: &mut Vec<&'a str>) {
    match tree {
        Value::Object(map) => {
            found.extend(map.get(key).and_then(Value::as_str));
            map.values().for_each(|it| values_of(it, key, found));
        }
        Value::Array(items) => items.iter().for_each(|it| values_of(it, key, found)),
        _ => {}
    }
}

/// The panels that the arrangement names.
fn leaves<'a>(node: &'a Value, found: &mut Vec<&'a str>) {
    match node {
        Value::String(name) => found.push(name),
        Value::Object(map) => ["first", "second"].iter().for_each(|it| leaves(&map[*it], found)),
        other => panic!("expected a panel or two, found {other}"),
    }
}

#[test]
fn what_the_layout_for_foxglove_and_lichtblick_shows_is_served() {
    let layout: Value = serde_json::from_str(&text("live/foxglove_layout.json")).unwrap();
    let (file, topics) = (descriptors(), topics());
    let mut paths = Vec::new();
    values_of(&layout["configById"], "value", &mut paths);
    assert!(paths.len() > 20, "{paths:?}");
    paths.iter().for_each(|path| assert_shown(&file, &topics, path, '.'));
    let mut whole = Vec::new();
    values_of(&layout["configById"], "topicPath", &mut whole);
    assert_eq!(whole, ["/events"]);
    let mut arranged = Vec::new();
    leaves(&layout["layout"], &mut arranged);
    arranged.sort_unstable();
    let panels: Vec<&str> =
        layout["configById"].as_object().unwrap().keys().map(String::as_str).collect();
    let mut panels = panels;
    panels.sort_unstable();
    assert_eq!(arranged, panels, "every panel has its place");
}

#[test]
fn what_the_layout_for_plotjuggler_shows_is_recorded() {
    let layout = text("live/plotjuggler_layout.xml");
    let (file, topics) = (descriptors(), topics());
    let curves: Vec<&str> =
        layout.split("<curve name=\"").skip(1).filter_map(|it| it.split('"').next()).collect();
    assert!(curves.len() > 15, "{curves:?}");
    curves.iter().for_each(|curve| assert_shown(&file, &topics, curve, '/'));
}

#[test]
fn a_field_or_topic_that_is_not_there_is_found() {
    let (file, topics) = (descriptors(), topics());
    let is_shown = |path: &str| {
        split(&topics, path).is_some_and(|(topic, rest)| {
            let fields: Vec<&str> = rest.trim_start_matches('.').split('.').collect();
            has_field(&file, topic.schema_and_layout().0, &fields)
        })
    };
    assert!(is_shown("/train/1/0_train_kalman.estimate.mass_low_t"));
    for wrong in [
        "/train/1/0_train_kalman.estimate.mass_low",
        "/train/1/0_train_kalman.estimate",
        "/train/1/0_trajectory_kalman.status",
        "/train/1/samples.speed",
    ] {
        assert!(!is_shown(wrong), "{wrong}");
    }
}

fn let_through(per_second: u32, moments_ns: impl Iterator<Item = i64>) -> usize {
    let mut thinning = Thinning::to(per_second);
    moments_ns.filter(|&at| thinning.lets_through(at)).count()
}

#[test]
fn of_a_thousand_a_second_fifty_go_on_and_what_is_slower_goes_on_whole() {
    let second = |hz: i64| (0..hz).map(move |k| 1_000_000_000 * k / hz);
    assert_eq!(let_through(50, second(1000)), 50);
    assert_eq!(let_through(50, second(60)), 50);
    assert_eq!(let_through(50, second(20)), 20);
    assert_eq!(let_through(0, second(1000)), 1000);
}

#[test]
fn a_clock_that_is_set_back_silences_nobody() {
    let moments = [0, 1_000_000_000, 5_000_000, 10_000_000, 30_000_000];
    assert_eq!(let_through(50, moments.into_iter()), 4);
}
