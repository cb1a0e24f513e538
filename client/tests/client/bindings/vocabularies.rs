//! Every vocabulary of the interface, as the library has it.

use std::fmt::Debug;

use dynocar_client::ffi::about::DaemonState;
use dynocar_client::ffi::{Code, Rail};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{
    Manoeuvre, MassSource, Parameter, PipelineKind, Quantity, Reason, RejectionReason, SampleField,
    Status, UseState,
};

/// A number with its name and its meaning.
pub struct Member {
    pub name: String,
    pub number: u32,
    pub meaning: String,
}

/// Numbers of one kind.
pub struct Vocabulary {
    /// `DYNOCAR_<prefix>_<member>` in C.
    pub prefix: &'static str,
    /// The class in Python.
    pub class: &'static str,
    /// Documentation for both languages.
    pub about: &'static str,
    /// Documentation for C only or Python only.
    pub in_c: &'static str,
    pub in_python: &'static str,
    /// True where the members are bits, by their places.
    pub is_bits: bool,
    /// Members under names of earlier releases, as (now, then).
    pub aliases: &'static [(&'static str, &'static str)],
    pub members: Vec<Member>,
}

/// `WeakExcitation` as `WEAK_EXCITATION`.
pub fn upper_snake(member: impl Debug) -> String {
    let mut name = String::new();
    for (index, letter) in format!("{member:?}").char_indices() {
        if index > 0 && letter.is_uppercase() {
            name.push('_');
        }
        name.push(letter.to_ascii_uppercase());
    }
    name
}

/// A meaning as plain letters: links by name only, no letters beyond ASCII.
pub fn plain(meaning: &str) -> String {
    let text = meaning.trim().trim_end_matches('.').replace("crate::vocabulary::", "");
    let text =
        text.replace("crate::", "").replace("TrainSample::", "").replace(['[', ']', '`'], "");
    let spelled = [("m/s²", "m/s^2"), ("²", "^2"), ("‰", "permille"), ("°C", "degC"), ("…", "...")];
    spelled.iter().fold(text, |text, (letter, ascii)| text.replace(letter, ascii))
}

macro_rules! members {
    ($name:ident) => {
        $name::ALL.iter().map(|it| member(it, *it as u32, it.meaning())).collect()
    };
}

fn member(name: impl Debug, number: u32, meaning: &str) -> Member {
    Member { name: upper_snake(name), number, meaning: plain(meaning) }
}

const PLAIN: Vocabulary = Vocabulary {
    prefix: "",
    class: "",
    about: "",
    in_c: "",
    in_python: "",
    is_bits: false,
    aliases: &[],
    members: Vec::new(),
};

/// Returns the vocabulary of result codes.
pub fn code() -> Vocabulary {
    Vocabulary {
        prefix: "ERROR",
        class: "Code",
        about: "What every function that can fail gives.",
        members: members!(Code),
        ..PLAIN
    }
}

/// Returns the vocabulary of rail adhesion.
pub fn rail() -> Vocabulary {
    Vocabulary {
        prefix: "RAIL",
        class: "Rail",
        about: "What the rail carries in a stop.",
        members: members!(Rail),
        ..PLAIN
    }
}

/// Measured quantities.
pub fn has() -> Vocabulary {
    Vocabulary {
        prefix: "HAS",
        class: "Has",
        about: "Measured quantities of a sample: bits of valid.",
        is_bits: true,
        members: SampleField::ALL.iter().map(|it| member(it, *it as u32, it.name())).collect(),
        ..PLAIN
    }
}

/// Those between [`code`] and [`has`], in the order of the header.
pub fn of_answers() -> Vec<Vocabulary> {
    vec![
        Vocabulary {
            prefix: "DAEMON",
            class: "DaemonState",
            about: "Who serves a train.",
            members: members!(DaemonState),
            ..PLAIN
        },
        Vocabulary {
            prefix: "STATUS",
            class: "Status",
            about: "How the estimate of a pipeline stands as a whole.",
            in_c: "Of an estimated one, too, the reason may remark something.",
            in_python: "``UseState`` says what may be used.\n\n    ``docs/guides/reading.md`` says \
                        what each status and each reason means.\n    ",
            members: members!(Status),
            ..PLAIN
        },
        Vocabulary {
            prefix: "USE",
            class: "UseState",
            about: "Whether a controller may use the values for what it asked for, in one word.",
            members: members!(UseState),
            ..PLAIN
        },
        Vocabulary {
            prefix: "REASON",
            class: "Reason",
            about: "Why a status is what it is.",
            in_c: "Of weak excitation, excited and missing_manoeuvres say more.",
            members: members!(Reason),
            ..PLAIN
        },
        Vocabulary {
            prefix: "PIPELINE",
            class: "PipelineKind",
            about: "The kind of estimator behind a snapshot, named as in the configuration.",
            aliases: &[("LS", "LEAST_SQUARES")],
            members: members!(PipelineKind),
            ..PLAIN
        },
        Vocabulary {
            prefix: "QUANTITY",
            class: "Quantity",
            about: "What a controller asks for; the daemon's configuration says which pipeline answers.",
            in_c: "Where the answer is: dynocar_snapshot_resistance() or Davis a, b and c; else the \
                   parameter MASS, ADHESION or ADHESION_LOWER_BOUND, DISC_FRICTION, BRAKING_RATIO.",
            members: members!(Quantity),
            ..PLAIN
        },
        Vocabulary {
            prefix: "MASS_SOURCE",
            class: "MassSource",
            about: "Where the mass in a snapshot comes from.",
            members: members!(MassSource),
            ..PLAIN
        },
        Vocabulary {
            prefix: "PARAMETER",
            class: "Parameter",
            about: "A number that a pipeline estimates, with the unit of its value.",
            in_c: "A sample's mass is in kg.",
            members: members!(Parameter),
            ..PLAIN
        },
        Vocabulary {
            prefix: "REJECTED",
            class: "RejectionReason",
            about: "Why a sample was not used: places in rejected_by_reason.",
            members: members!(RejectionReason),
            ..PLAIN
        },
        Vocabulary {
            prefix: "MANOEUVRE",
            class: "Manoeuvre",
            about: "Manoeuvres that would show more: bits of missing_manoeuvres.",
            is_bits: true,
            members: members!(Manoeuvre),
            ..PLAIN
        },
        Vocabulary {
            prefix: "EFFECT",
            class: "Effect",
            about: "An effect that the model may lack.",
            members: members!(EffectKind),
            ..PLAIN
        },
    ]
}
