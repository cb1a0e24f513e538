//! Constants of the library that the header repeats, as C.

use std::fmt::Write as _;

use dynocar_client::ffi::{EffortPlace, ReadingCopy, ResistanceAtSpeed, StopRequest, Stopping};
use dynocar_shared::layout::FieldLayout;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::snapshot::{COVARIANCE_ENTRIES, PARAMETERS_MAX, REJECTION_REASONS};
use dynocar_shared::{ParameterSnapshot, SCHEMA_MAJOR, TrainSample};

use super::vocabularies::{self as vocabularies, Member, Vocabulary, plain};

/// Columns of a line of a comment.
const WIDTH: usize = 98;
/// Lengths of arrays that have a name.
const LENGTHS: [(usize, &str); 3] = [
    (REJECTION_REASONS, "DYNOCAR_REJECTION_REASONS"),
    (PARAMETERS_MAX, "DYNOCAR_PARAMETERS_MAX"),
    (COVARIANCE_ENTRIES, "DYNOCAR_COVARIANCE_ENTRIES"),
];
/// Names of Rust in meanings, and their names in C.
const NAMES: [(&str, &str); 11] = [
    ("PipelineKind", "DYNOCAR_PIPELINE_..."),
    ("Status", "DYNOCAR_STATUS_..."),
    ("UseState", "DYNOCAR_USE_..."),
    ("RejectionReason", "DYNOCAR_REJECTED_..."),
    ("Reason", "DYNOCAR_REASON_..."),
    ("Quantity", "DYNOCAR_QUANTITY_..."),
    ("Parameter", "DYNOCAR_PARAMETER_..."),
    ("Manoeuvre", "DYNOCAR_MANOEUVRE_..."),
    ("EffectKind", "DYNOCAR_EFFECT_..."),
    ("MassSource", "DYNOCAR_MASS_SOURCE_..."),
    ("SampleField", "DYNOCAR_HAS_..."),
];

/// A struct that crosses the interface.
struct Struct {
    name: &'static str,
    about: &'static str,
    size: usize,
    layout: &'static [FieldLayout],
    meanings: &'static [&'static str],
}

macro_rules! of {
    ($rust:ident, $name:literal, $about:literal) => {
        Struct {
            name: $name,
            about: $about,
            size: size_of::<$rust>(),
            layout: $rust::LAYOUT,
            meanings: $rust::MEANINGS,
        }
    };
}

const SAMPLE: Struct = of!(
    TrainSample,
    "dynocar_train_sample",
    "One cycle of a train. A field counts only while its bit in valid is set; start from \
     dynocar_sample_empty(). Missing values: leave the bit out; never write a made-up number. \
     published_ns, sequence, train_id and run are filled in by publish."
);
const ANSWERS: [Struct; 3] = [
    of!(
        ParameterSnapshot,
        "dynocar_parameter_snapshot",
        "A pipeline's knowledge of one train at one moment. One bit for each X is 1 << X; model_hash is as `dynocar models` names it."
    ),
    of!(
        ReadingCopy,
        "dynocar_reading",
        "A snapshot copied out, with its age. is_usable is for what was asked, by usable_quantities."
    ),
    of!(
        ResistanceAtSpeed,
        "dynocar_resistance",
        "Basic resistance (no gradient, no curve) at a speed: w0(v) = a + b v + c v^2."
    ),
];
const STOPPING: [Struct; 3] = [
    of!(
        StopRequest,
        "dynocar_stop",
        "The stop that is asked about. Set all to 0 first; standard deviations may stay 0."
    ),
    of!(
        EffortPlace,
        "dynocar_effort_point",
        "A point of the brake-effort curve: linear between points, constant beyond the ends; speeds \
         increase."
    ),
    of!(Stopping, "dynocar_stopping", "Distance and time of a stop."),
];

/// The parts of the header that are generated, each with the name by which the header marks it.
pub fn parts() -> [(&'static str, String); 6] {
    let vocabularies = vocabularies::of_answers();
    let text = vocabularies.iter().map(enumeration).collect::<Vec<_>>().join("\n");
    [
        ("numbers", numbers()),
        (
            "vocabularies",
            format!(
                "{}\n{text}\n{}\n#define DYNOCAR_FLAG_WHEEL_SLIDE {FLAG_WHEEL_SLIDE} /* in flags: the \
                 wheel-slide protection is active */\n",
                enumeration(&vocabularies::code()).replacen(
                    "enum {",
                    "typedef int32_t dynocar_code;\nenum {",
                    1
                ),
                enumeration(&vocabularies::has())
            ),
        ),
        ("sample", declaration(&SAMPLE)),
        ("answers", ANSWERS.iter().map(declaration).collect::<Vec<_>>().join("\n")),
        (
            "stops",
            format!(
                "{}\n{}",
                enumeration(&vocabularies::rail()),
                STOPPING.iter().map(declaration).collect::<Vec<_>>().join("\n")
            ),
        ),
        (
            "places",
            [SAMPLE]
                .iter()
                .chain(&ANSWERS)
                .chain(&STOPPING)
                .map(places)
                .collect::<Vec<_>>()
                .join("\n"),
        ),
    ]
}

fn numbers() -> String {
    format!(
        "#define DYNOCAR_SCHEMA {SCHEMA_MAJOR}u\n\
         #define DYNOCAR_SAMPLE_LAYOUT UINT64_C({:#x})\n\
         #define DYNOCAR_SNAPSHOT_LAYOUT UINT64_C({:#x})\n\n\
         #define DYNOCAR_PIPELINES_MAX {PIPELINES_MAX} /* pipelines of one train */\n\
         #define DYNOCAR_PARAMETERS_MAX {PARAMETERS_MAX} /* parameters that one pipeline estimates together */\n\
         #define DYNOCAR_COVARIANCE_ENTRIES {COVARIANCE_ENTRIES} /* of the lower triangle, packed by rows */\n\
         #define DYNOCAR_REJECTION_REASONS {REJECTION_REASONS}\n",
        TrainSample::LAYOUT_HASH,
        ParameterSnapshot::LAYOUT_HASH
    )
}

/// A comment, broken into lines.
fn comment(indent: &str, words: &str) -> String {
    let mut lines: Vec<String> = vec![String::new()];
    for word in words.split_whitespace() {
        let line = lines.last_mut().expect("one line at least");
        if !line.is_empty() && indent.len() + 6 + line.len() + 1 + word.len() > WIDTH {
            lines.push(word.to_owned());
        } else {
            line.push_str(if line.is_empty() { "" } else { " " });
            line.push_str(word);
        }
    }
    format!("{indent}/* {} */\n", lines.join(&format!("\n{indent} * ")))
}

/// A meaning, with the names that C has.
fn in_c(meaning: &str) -> String {
    let words = plain(meaning);
    let is_of_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    let named = words.split_inclusive(|letter| !is_of_name(letter)).map(|word| {
        let name = word.trim_end_matches(|letter| !is_of_name(letter));
        let c = NAMES.iter().find(|(rust, _)| *rust == name).map(|(_, c)| *c);
        c.map_or_else(|| word.to_owned(), |c| word.replacen(name, c, 1))
    });
    named
        .collect::<String>()
        .replace(" by number", "")
        .replace(", see TrainId", "")
        .replace("FLAG_WHEEL_SLIDE", "DYNOCAR_FLAG_WHEEL_SLIDE")
}

/// The name of a member in C; the code for success is no error.
fn constant(vocabulary: &Vocabulary, member: &str) -> String {
    match (vocabulary.class, member) {
        ("Code", "OK") => "DYNOCAR_OK".into(),
        _ => format!("DYNOCAR_{}_{member}", vocabulary.prefix),
    }
}

fn enumeration(vocabulary: &Vocabulary) -> String {
    let mut text = comment("", format!("{} {}", vocabulary.about, vocabulary.in_c).trim());
    text += "enum {\n";
    for (index, Member { name, number, meaning }) in vocabulary.members.iter().enumerate() {
        let value = if vocabulary.is_bits { format!("1 << {number}") } else { number.to_string() };
        let comma = if index + 1 < vocabulary.members.len() { "," } else { "" };
        let line = format!("    {} = {value}{comma}", constant(vocabulary, name));
        if line.len() + meaning.len() + 7 > WIDTH {
            let _ = writeln!(text, "{}{line}", comment("    ", meaning));
        } else {
            let _ = writeln!(text, "{line} /* {meaning} */");
        }
    }
    text += "};\n";
    for (now, then) in vocabulary.aliases {
        let [now, then] = [now, then].map(|name| constant(vocabulary, name));
        let _ = writeln!(text, "#define {then} {now} /* its name in earlier releases */");
    }
    text
}

/// The type of a field in C, and the length of an array.
fn c_type(type_name: &str) -> (String, String) {
    let (element, length) = match type_name.strip_prefix('[') {
        Some(array) => array.trim_end_matches(']').split_once("; ").expect("a length"),
        None => (type_name, ""),
    };
    let element = match element {
        "f64" => "double".into(),
        "ParameterSnapshot" => "dynocar_parameter_snapshot".into(),
        _ if element.starts_with('i') => format!("int{}_t", &element[1..]),
        _ => format!("uint{}_t", &element[1..]),
    };
    let named = LENGTHS.iter().find(|(entries, _)| length == entries.to_string());
    (element, named.map_or(String::new(), |(_, name)| format!("[{name}]")))
}

fn declaration(it: &Struct) -> String {
    let mut text = comment("", it.about);
    let _ = writeln!(text, "typedef struct {} {{", it.name);
    for (field, meaning) in it.layout.iter().zip(it.meanings) {
        let (element, length) = c_type(field.type_name);
        text += &comment("    ", &in_c(meaning));
        let _ = writeln!(text, "    {element} {}{length};", field.name);
    }
    let _ = writeln!(text, "}} {};", it.name);
    text
}

fn places(it: &Struct) -> String {
    let mut text = format!("DYNOCAR_SIZE_({}, {});\n", it.name, it.size);
    for field in it.layout {
        let _ = writeln!(text, "DYNOCAR_AT_({}, {}, {});", it.name, field.name, field.offset);
    }
    text
}
