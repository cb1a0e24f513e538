//! The protobuf messages of a recording, made from the layouts of sample and snapshot.
//!
//! A field's number is its place in the layout, counted from 1. Measured values are `optional`: a missing value is left
//! out. Numbers of a vocabulary are protobuf enumerations. The contents of arrays appear once more under names with
//! units in `estimate` and `rejected`.

use std::sync::LazyLock;

use dynocar_shared::schema::{Field, Missing, sample_fields, snapshot_fields, unit_end};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{HALF_95, Parameter, PipelineKind, Reason, RejectionReason, Status};
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet, OneofDescriptorProto,
};

use crate::event::{Event, EventKind, MessageField};

/// Name of the message of a sample.
pub const SAMPLE: &str = "dynocar.TrainSample";
/// Name of the message of a snapshot.
pub const SNAPSHOT: &str = "dynocar.ParameterSnapshot";
/// Name of the message of an event.
pub const EVENT: &str = "dynocar.Event";

/// Number of the field `estimate` of a snapshot: the parameters by name.
pub const ESTIMATE: u32 = 101;
/// Number of the field `rejected` of a snapshot: how many samples were refused, by name.
pub const REJECTED: u32 = 102;
/// The fields of a sample, in order.
pub static SAMPLE_FIELDS: LazyLock<Vec<Field>> = LazyLock::new(|| sample_fields().collect());
/// The fields of a snapshot, in order.
pub static SNAPSHOT_FIELDS: LazyLock<Vec<Field>> = LazyLock::new(|| snapshot_fields().collect());

/// The messages of a recording, as the bytes that an MCAP schema holds.
pub static DESCRIPTORS: LazyLock<Vec<u8>> = LazyLock::new(|| descriptors().encode_to_vec());

/// Returns whether other descriptors describe the fields of a message as this release's do.
pub fn is_described_alike(message: &str, descriptors: &[u8]) -> bool {
    type Described = (Option<String>, Option<i32>, Option<i32>);
    let fields = |bytes: &[u8]| -> Option<Vec<Described>> {
        let files = FileDescriptorSet::decode(bytes).ok()?;
        let (package, name) = message.rsplit_once('.')?;
        let mut files = files.file.into_iter().filter(|it| it.package() == package);
        let found =
            files.find_map(|it| it.message_type.into_iter().find(|it| it.name() == name))?;
        let mut fields: Vec<_> =
            found.field.into_iter().map(|it| (it.name, it.number, it.r#type)).collect();
        fields.sort();
        Some(fields)
    };
    let other = fields(descriptors);
    other.is_some() && other == fields(&DESCRIPTORS)
}

/// Returns the protobuf number of a layout's field.
pub fn number(field: &Field) -> u32 {
    field.index as u32 + 1
}

/// Returns the number of a parameter's value in `estimate`; those of its standard deviation and of the ends
/// of its 95 % interval are greater, see [`SUFFIXES`].
pub fn parameter_number(parameter: Parameter) -> u32 {
    parameter as u32
}

/// Function of value and standard deviation that gives an additional column of a parameter.
pub type OfEstimate = fn(f64, f64) -> f64;

/// Additional columns of `estimate` for a parameter: the offset of the field number, the word in its name, its
/// meaning, and its value.
pub const SUFFIXES: [(u32, &str, &str, OfEstimate); 3] = [
    (100, "std", "Its standard deviation.", |_, std| std),
    (200, "low", "The lower end of its 95 % interval.", |value, std| value - HALF_95 * std),
    (300, "high", "The upper end of its 95 % interval.", |value, std| value + HALF_95 * std),
];

/// Returns the name of an addition to a parameter's value: the unit stays last.
pub fn suffixed_name(parameter: Parameter, word: &str) -> String {
    let name = parameter.full_name();
    let unit = unit_end(name).0;
    format!("{}_{word}{unit}", &name[..name.len() - unit.len()])
}

/// Returns the number of a reason's count in `rejected`.
pub fn rejection_number(reason: RejectionReason) -> u32 {
    reason as u32 + 1
}

/// Returns the vocabulary whose numbers a field of a snapshot holds.
pub fn vocabulary_of(name: &str) -> Option<&'static str> {
    Some(match name {
        "pipeline_kind" => "PipelineKind",
        "status" => "Status",
        "reason" => "Reason",
        "suspected_effect" => "EffectKind",
        "parameters" => "Parameter",
        _ => return None,
    })
}

/// Returns the vocabulary that a type of a table of fields is.
pub fn vocabulary_of_type(type_name: &'static str) -> Option<&'static str> {
    type_name.starts_with(char::is_uppercase).then_some(type_name)
}

fn descriptors() -> FileDescriptorSet {
    let file = FileDescriptorProto {
        name: Some("dynocar/recording.proto".into()),
        package: Some("dynocar".into()),
        syntax: Some("proto3".into()),
        message_type: vec![
            message("TrainSample", SAMPLE_FIELDS.iter().filter_map(layout_field).collect()),
            message("ParameterSnapshot", snapshot_message()),
            message("Estimate", estimate_message()),
            message("Rejected", rejected_message()),
            message(Event::NAME, fields_of(Event::FIELDS)),
        ],
        enum_type: enums(),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }
}

/// Returns a message; each optional field gets the group of its own that protobuf asks for.
pub(crate) fn message(name: &str, mut fields: Vec<FieldDescriptorProto>) -> DescriptorProto {
    let mut groups = Vec::new();
    for field in fields.iter_mut().filter(|it| it.proto3_optional == Some(true)) {
        field.oneof_index = Some(groups.len() as i32);
        let name = format!("_{}", field.name());
        groups.push(OneofDescriptorProto { name: Some(name), ..Default::default() });
    }
    let name = Some(name.into());
    DescriptorProto { name, field: fields, oneof_decl: groups, ..Default::default() }
}

fn field(name: &str, number: u32, of_type: Type, is_optional: bool) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number as i32),
        label: Some(Label::Optional as i32),
        r#type: Some(of_type as i32),
        proto3_optional: is_optional.then_some(true),
        ..Default::default()
    }
}

fn typed(mut field: FieldDescriptorProto, of_type: Type, name: &str) -> FieldDescriptorProto {
    field.r#type = Some(of_type as i32);
    field.type_name = Some(format!(".dynocar.{name}"));
    field
}

/// Returns the protobuf type of a Rust type.
pub fn scalar(type_name: &str) -> Type {
    match type_name {
        "f64" => Type::Double,
        "i64" => Type::Int64,
        "i8" => Type::Int32,
        "u64" => Type::Uint64,
        "string" => Type::String,
        _ => Type::Uint32,
    }
}

/// Returns a field of a layout; `None` for one that is said by others.
fn layout_field(it: &Field) -> Option<FieldDescriptorProto> {
    let is_optional = match it.missing {
        Missing::Never => false,
        Missing::Unless(_) => true,
        Missing::SaidByOthers => return None,
    };
    let name = it.layout.name;
    let mut made = field(name, number(it), scalar(it.entry_type()), is_optional);
    if let Some(vocabulary) = vocabulary_of(name) {
        made = typed(made, Type::Enum, vocabulary);
    }
    if it.is_array() {
        made.label = Some(Label::Repeated as i32);
    }
    Some(made)
}

fn snapshot_message() -> Vec<FieldDescriptorProto> {
    let nested = [("estimate", ESTIMATE, "Estimate"), ("rejected", REJECTED, "Rejected")];
    let nested = nested.map(|(name, number, of_type)| {
        typed(field(name, number, Type::Message, false), Type::Message, of_type)
    });
    SNAPSHOT_FIELDS.iter().filter_map(layout_field).chain(nested).collect()
}

fn estimate_message() -> Vec<FieldDescriptorProto> {
    let of = |&it: &Parameter| {
        let number = parameter_number(it);
        let value = field(it.full_name(), number, Type::Double, true);
        let suffixed = SUFFIXES.map(|(offset, word, ..)| {
            field(&suffixed_name(it, word), number + offset, Type::Double, true)
        });
        std::iter::once(value).chain(suffixed)
    };
    Parameter::ALL.iter().flat_map(of).collect()
}

fn rejected_message() -> Vec<FieldDescriptorProto> {
    let of = |&it: &RejectionReason| field(it.name(), rejection_number(it), Type::Uint32, false);
    RejectionReason::ALL.iter().map(of).collect()
}

/// Returns the fields of a message by its table.
pub(crate) fn fields_of(table: &[MessageField]) -> Vec<FieldDescriptorProto> {
    let of = |it: &MessageField| {
        let made = field(it.name, it.number, scalar(it.type_name), it.is_optional);
        match vocabulary_of_type(it.type_name) {
            Some(vocabulary) => typed(made, Type::Enum, vocabulary),
            None => made,
        }
    };
    table.iter().map(of).collect()
}

/// Returns every vocabulary with its members' numbers and names.
fn vocabularies() -> Vec<(&'static str, Vec<(i32, &'static str)>)> {
    macro_rules! members {
        ($name:ident) => {
            (stringify!($name), $name::ALL.iter().map(|it| (*it as i32, it.name())).collect())
        };
    }
    vec![
        members!(PipelineKind),
        members!(Status),
        members!(Reason),
        members!(EffectKind),
        members!(Parameter),
        members!(EventKind),
    ]
}

/// Returns the members of a vocabulary: numbers and names.
pub fn members_of(vocabulary: &str) -> Vec<(i32, &'static str)> {
    let found = vocabularies().into_iter().find(|it| it.0 == vocabulary);
    found.map(|it| it.1).unwrap_or_default()
}

fn enums() -> Vec<EnumDescriptorProto> {
    vocabularies().into_iter().map(|(name, members)| enumeration(name, &members)).collect()
}

/// Returns an enumeration; protobuf asks for a member 0 and for names that are unique in the package.
fn enumeration(name: &str, members: &[(i32, &str)]) -> EnumDescriptorProto {
    let unknown = members.iter().all(|it| it.0 != 0).then_some((0, "unknown_number"));
    let prefix: String = name
        .chars()
        .enumerate()
        .flat_map(|(index, letter)| {
            let gap = (index > 0 && letter.is_uppercase()).then_some('_');
            gap.into_iter().chain(letter.to_uppercase())
        })
        .collect();
    let value = |(number, member): (i32, &str)| EnumValueDescriptorProto {
        name: Some(format!("{prefix}_{}", member.to_uppercase())),
        number: Some(number),
        options: None,
    };
    let value = unknown.into_iter().chain(members.iter().copied()).map(value).collect();
    EnumDescriptorProto { name: Some(name.into()), value, ..Default::default() }
}
