//! Declared model of a train and its line, and the forces that follow from it, without side effects.
//!
//! Every part of the project that learns, explains or simulates stands on this library: the live estimators
//! (`dynocar_core`), the papers' methods, the reader of recorded runs, the analysis, the daemon.
//! It estimates nothing, and knows no channel, clock, file, thread or logger: times come in as arguments.
//!
//! # Layout, in the order in which a sample passes
//!
//! - [`units`]: the units that quantities may be in
//! - [`train`], [`track`]: the declared train and line
//! - [`terms`]: the physical terms of the model, one law each, that all of the following share
//! - [`force`]: the known forces on the train at a sample
//! - [`simulate`]: the speed that a force model predicts over a recorded run
//! - [`words`]: the words of every answer: kinds of effects, their numbers and places
//! - [`named!`]: enums whose members have names in files
//!
//! # Examples
//!
//! ```
//! use dynocar_model::train::{Davis, TrainModel};
//!
//! let resistance = Davis { a: 1.5, b: 0.01, c: 0.0005 };
//! let train = TrainModel::bare("metro", 200_000.0, resistance);
//! // 1.5 + 0.01 · 20 + 0.0005 · 20² N/kN at 20 m/s
//! assert!((train.resistance.w0_n_per_kn(20.0) - 1.9).abs() < 1e-12);
//! ```

pub mod force;
pub mod simulate;
pub mod terms;
pub mod track;
pub mod train;
pub mod units;
pub mod words;

/// Declares an enum whose members have names in files, on command lines and in answers: each member with its
/// documentation and its name; `("in a file")` says where the names are used.
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $name:ident ($what:literal) {
        $( $(#[doc = $doc:literal])* $item:ident $(= $number:literal)? $text:literal; )*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $( $(#[doc = $doc])* $item $(= $number)? ),* }

        impl $name {
            /// Every member.
            pub const ALL: [$name; [$( $name::$item ),*].len()] = [$( $name::$item ),*];

            #[doc = concat!("The name ", $what, ".")]
            pub const fn name(self) -> &'static str {
                match self { $( $name::$item => $text ),* }
            }

            /// Returns the member of this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|member| member.name() == name)
            }
        }
    };
}

#[cfg(test)]
mod tests {
    named! {
        /// Position of a door.
        Door ("in a test") {
            /// Nobody gets in.
            Shut = 3 "shut";
            /// Somebody may.
            Ajar "a_jar";
        }
    }

    #[test]
    fn a_name_leads_back_to_its_member() {
        assert_eq!(Door::ALL, [Door::Shut, Door::Ajar]);
        assert_eq!((Door::Shut as u8, Door::Ajar as u8), (3, 4));
        assert_eq!(Door::from_name("a_jar"), Some(Door::Ajar));
        assert_eq!((Door::from_name("open"), Door::Shut.name()), (None, "shut"));
    }
}
