//! The reference page of the recorded fields, from the same tables as the messages.

use std::fmt::Write;

use dynocar_shared::schema::{Field, Missing, unit_of};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Parameter, PipelineKind, Reason, RejectionReason, Status};

use crate::annotate::schema::MESSAGES;
use crate::event::{EVENT_FIELDS, EventField, EventKind};
use crate::schema::{
    BESIDE_VALUE, ESTIMATE, REJECTED, SAMPLE_FIELDS, SNAPSHOT_FIELDS, name_beside, number,
    parameter_number, rejection_number, vocabulary_of, vocabulary_of_type,
};

const HEAD: &str = "# Fields of a recording

This page is what `dynocar-recording fields` prints; it is made from the same tables as the recordings'
protobuf messages. How to record is told in [the guide](guides/recording.md).

A field of which it says *missing unless measured* is `optional`: it is there when the controller
measured it. Every other number that is not there is 0.
";

const EXPLANATION: &str = "
`explain --annotate` adds the following messages.
";

/// The page as Markdown.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    layout(&mut page, "dynocar.TrainSample", "One cycle of a train.", &SAMPLE_FIELDS);
    layout(
        &mut page,
        "dynocar.ParameterSnapshot",
        "A pipeline's knowledge of one train at one moment.",
        &SNAPSHOT_FIELDS,
    );
    row(&mut page, "estimate", ESTIMATE, "Estimate", "", "The parameters by name, see below.");
    row(&mut page, "rejected", REJECTED, "Rejected", "", "The refusals by name, see below.");
    table(
        &mut page,
        "dynocar.Estimate",
        "What a pipeline estimates, each missing unless the pipeline estimates it.",
    );
    for &it in Parameter::ALL {
        let (name, number) = (it.full_name(), parameter_number(it));
        row(&mut page, name, number, "double", unit_of(name), it.meaning());
        for (offset, word, meaning) in BESIDE_VALUE {
            let beside = name_beside(it, word);
            row(&mut page, &beside, number + offset, "double", unit_of(name), meaning);
        }
    }
    table(&mut page, "dynocar.Rejected", "How many samples a pipeline refused, by reason.");
    for &it in RejectionReason::ALL {
        row(&mut page, it.name(), rejection_number(it), "uint32", "", it.meaning());
    }
    listed(&mut page, "Event", "What happened around them.", &EVENT_FIELDS);
    page.push_str(EXPLANATION);
    for (name, what, fields) in MESSAGES {
        listed(&mut page, name, what, fields);
    }
    enumerations(&mut page);
    page
}

fn table(page: &mut String, name: &str, what: &str) {
    let _ = write!(
        page,
        "\n## `{name}`\n\n{what}\n\n| field | number | type | unit | meaning |\n\
         | --- | --- | --- | --- | --- |\n"
    );
}

/// A message by the table of its fields.
fn listed(page: &mut String, name: &str, what: &str, fields: &[EventField]) {
    table(page, &format!("dynocar.{name}"), &plain(what));
    for it in fields {
        let of_type = vocabulary_of_type(it.type_name).unwrap_or_else(|| protobuf(it.type_name));
        row(page, it.name, it.number as u32, of_type, unit_of(it.name), it.meaning);
    }
}

fn row(page: &mut String, name: &str, number: u32, of_type: &str, unit: &str, meaning: &str) {
    let meaning = plain(meaning);
    let _ = writeln!(page, "| `{name}` | {number} | {of_type} | {unit} | {meaning} |");
}

/// A line of documentation without its links.
fn plain(meaning: &str) -> String {
    meaning
        .trim()
        .replace("[`crate::vocabulary::", "[`")
        .replace("[`crate::", "[`")
        .replace("[`", "`")
        .replace("`]", "`")
}

fn protobuf(type_name: &str) -> &'static str {
    match type_name {
        "f64" => "double",
        "i64" => "int64",
        "i8" => "int32",
        "u64" => "uint64",
        "string" => "string",
        _ => "uint32",
    }
}

fn layout(page: &mut String, name: &str, what: &str, fields: &[Field]) {
    table(page, name, what);
    for field in fields {
        let (missing, is_said) = match field.missing {
            Missing::Never => ("", false),
            Missing::Unless(_) => (" Missing unless measured.", false),
            Missing::SaidByOthers => ("", true),
        };
        if is_said {
            continue;
        }
        let of_type = vocabulary_of(field.layout.name);
        let of_type = of_type.unwrap_or_else(|| protobuf(field.entry_type()));
        let of_type =
            if field.is_array() { format!("repeated {of_type}") } else { of_type.to_owned() };
        let meaning = format!("{}{missing}", field.meaning);
        row(page, field.layout.name, number(field), &of_type, field.unit(), &meaning);
    }
}

fn enumerations(page: &mut String) {
    macro_rules! members {
        ($name:ident) => {
            for it in $name::ALL {
                let (number, name, meaning) = (*it as u32, it.name(), plain(it.meaning()));
                let _ = writeln!(page, "| {} | {number} | {name} | {meaning} |", stringify!($name));
            }
        };
    }
    page.push_str(
        "\n## Numbers and their names\n\nIn the messages the names are in capitals, after that of the \
         vocabulary: `STATUS_ESTIMATED`.\n\n| vocabulary | number | name | meaning |\n\
         | --- | --- | --- | --- |\n",
    );
    members!(PipelineKind);
    members!(Status);
    members!(Reason);
    members!(EffectKind);
    members!(EventKind);
}
