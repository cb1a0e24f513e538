//! Keys of `train.toml`, `track.toml` and `dataset.toml`: one row each, which every reader and writer of the files
//! uses. The numbers of `train.toml` have their rows next to the members of the train ([`NUMBERS`]).

use std::fmt::Display;

use dynocar_model::terms::extra::FORCE_MAX_N_PER_KN;
use dynocar_model::terms::{Key, gradient, masses, place};
use dynocar_model::track as model;
use dynocar_model::train::NumberRule;
use dynocar_model::train::numbers::{MASS as TRAIN_MASS, NUMBERS};

use super::document::{Entries, Item};
use super::error::DatasetError;

/// A key of a file, in the table that holds it.
#[derive(Clone, Copy, Debug)]
pub struct FileKey {
    /// Name of the table.
    pub table: &'static str,
    /// Its name there.
    pub name: &'static str,
    /// Values that it may have: the range of a number, the words of anything else.
    pub rule: NumberRule,
}

impl FileKey {
    /// Returns `key = value`, as it stands in a file.
    pub fn assign(&self, value: impl Display) -> String {
        assign(self.name, value)
    }

    /// Returns the key with a value to set, in words.
    pub fn advice(&self, value: impl Display) -> String {
        format!("set {} in [{}]", self.assign(value), self.table)
    }

    /// Returns the value in quotes or not at all.
    pub fn quoted<'t>(&self, section: &Item<'t>) -> Result<Option<&'t str>, DatasetError> {
        section.quoted(self.name)
    }

    /// Returns the value in quotes, which must be there.
    pub fn need_quoted<'t>(&self, section: &Item<'t>) -> Result<&'t str, DatasetError> {
        section.need_quoted(self.name, self.rule.allowed)
    }

    /// Returns the number, in the file's unit.
    ///
    /// # Errors
    ///
    /// When the value breaks the rule, or is required and not there.
    pub fn number(&self, section: &Item) -> Result<Option<f64>, DatasetError> {
        let rule = &self.rule;
        if rule.is_required {
            section.need(self.name, rule.allowed)?;
        }
        section.checked_under(self.name, rule.allowed, |value| rule.allows(value))
    }

    /// Returns the item named by the word in quotes: one of these names.
    pub fn named<T, N: Into<String>>(
        &self,
        section: &Item,
        noun: &str,
        find: impl Fn(&str) -> Option<T>,
        names: impl IntoIterator<Item = N>,
    ) -> Result<Option<T>, DatasetError> {
        section.named_under(self.name, (noun, self.rule.allowed), find, names)
    }

    /// Returns the list of entries, each N numbers of the form that the row says.
    pub fn entries<'t, const N: usize>(
        &self,
        section: &Item<'t>,
    ) -> Result<Option<Entries<'t, N>>, DatasetError> {
        section.entries(self.name, self.rule.allowed)
    }

    /// Returns the error of a value that the row does not allow.
    pub fn refused(&self, section: &Item, found: impl Display) -> DatasetError {
        section.key_out_of_range(self.name, &found.to_string(), self.rule.allowed)
    }
}

impl From<&Key> for FileKey {
    fn from(key: &Key) -> Self {
        FileKey { table: key.table, name: key.name, rule: key.rule }
    }
}

const fn within(least: f64, greatest: f64, allowed: &'static str) -> NumberRule {
    NumberRule::within(least, greatest, allowed)
}

/// Above 0.
const fn positive(greatest: f64, allowed: &'static str) -> NumberRule {
    NumberRule::above(0.0, greatest, allowed)
}

/// Anything that the words say.
const fn said(words: &'static str) -> NumberRule {
    NumberRule::within(f64::MIN, f64::MAX, words)
}

/// Declares the tables, and their keys in the order in which messages list them.
macro_rules! keys {
    ($( #[doc = $doc:literal] $module:ident $table:literal { $( $key:ident $name:expr, $rule:expr; )* } )*) => { $(
        #[doc = $doc]
        pub mod $module {
            use crate::keys::*;

            /// Name of the table.
            pub const TABLE: &str = $table;
            /// Its keys that are no numbers of a train.
            pub const KEYS: &[FileKey] = &[ $( $key ),* ];
            $(
                #[doc = concat!("Row of `", stringify!($key), "`.")]
                pub const $key: FileKey = FileKey { table: TABLE, name: $name, rule: $rule };
            )*
        }
    )*

    /// Returns every key of the three files.
    pub fn all() -> impl Iterator<Item = FileKey> {
        let own = [$( $module::KEYS ),*].concat();
        own.into_iter().chain(NUMBERS.iter().copied().map(FileKey::from))
    }
    };
}

keys! {
    /// `[train]` of `train.toml`.
    train "train" {
        NAME "name", said("the train's name");
    }
    /// `[resistance]` of `train.toml`.
    resistance "resistance" {}
    /// `[traction]` of `train.toml`.
    traction "traction" {
        EFFORT "effort", said(EFFORT_POINT);
    }
    /// `[brake]` of `train.toml`.
    brake "brake" {
        MAX_FORCE "max_force_kn", FORCE_KN;
        EFFORT "effort", said(EFFORT_POINT);
    }
    /// `[corrections]` of `train.toml`.
    corrections "corrections" {}
    /// `[[extra]]` of `train.toml`.
    extra "extra" {
        FORCE "n_per_kn", within(-FORCE_MAX_N_PER_KN, FORCE_MAX_N_PER_KN, "N/kN, from -100 to 100").required();
        FACTORS "factor", said("one or two tables");
    }
    /// `[[extra.factor]]` of `train.toml`, with the numbers of its form.
    factor "factor" {
        OF "of", said("a covariate");
        FORM "form", said("a form");
    }
    /// `[track]` of `track.toml`.
    track "track" {
        NAME "name", said("the line's name");
        LENGTH "length_m", positive(f64::MAX, "a length in m above 0");
        GRADIENT "gradient", said(PERMILLE);
        GRADIENT_SHIFT gradient::SHIFT, within(-1e4, 1e4, "a shift in m from -10000 to 10000");
        GRADIENT_ERROR gradient::ERROR, said(PERMILLE);
        GRADIENT_ERROR_FALLING gradient::ERROR_FALLING, said(PERMILLE);
        CURVES model::CURVES, said("[start_m, end_m, radius_m]");
        TUNNELS model::TUNNELS, said("[start_m, end_m]");
        RESISTANCE place::LIST, said("[start_m, end_m, extra N/kN]");
        MASSES masses::LIST, said("[from_m, to_m, direction (1 or -1), mass factor]");
        GRADIENT_FALLING "gradient_falling", said(PERMILLE);
        GRADIENT_STD "gradient_std", said(PERMILLE);
        STOPS "stops", said("[chainage_m, \"name\"]");
        PERMITTED_SPEED "permitted_speed", said("[chainage_m, speed_mps]");
        ALIGNMENT "alignment", said("the path of a CSV file");
        ALIGNMENT_FALLING "alignment_falling", said("the path of a CSV file");
    }
    /// `[dataset]` of `dataset.toml`.
    dataset "dataset" {
        NAME "name", said("the dataset's name");
        DESCRIPTION "description", said("source, licence and the like");
        POSITION_REFERENCE "position_reference", said("centre or head");
        ENCODING "encoding", said("the name of an encoding");
        DELIMITER "delimiter", said("one ASCII character, as \",\" \";\" or \"\\t\"");
        DECIMAL "decimal", said("\".\" or \",\"");
        THOUSANDS "thousands",
            said("a point, a comma, an apostrophe or a space, other than the decimal mark");
        SKIP_ROWS "skip_rows", within(0.0, 1e4, "a number of lines, 0 to 10000").whole();
        UNITS_ROW "units_row", said("true or false");
    }
    /// `[train]` of `dataset.toml`.
    train_file "train" {
        FILE "file", said("the path of a train.toml");
        ROWS "rows", said("\"all\", or { column = \"…\", value = \"…\" } of the rows of this train");
    }
    /// `rows` of `[train]` of `dataset.toml`.
    rows "rows" {
        COLUMN "column", said("the name of a column");
        VALUE "value", said("the cell of this train's rows, quoted");
    }
    /// `[track]` of `dataset.toml`.
    track_file "track" {
        FILE "file", said("the path of a track.toml");
    }
    /// A quantity in `[columns]` of `dataset.toml`.
    column "columns" {
        COLUMN "column", said("the name of a column in the runs' files");
        UNIT "unit", said("a unit");
        SCALE "scale", said("a number other than 0");
        OFFSET "offset", said("a finite number");
        FORMAT "format",
            said("\"iso\" (2026-03-18T07:13:20.2), \"clock\" (07:13:20.2) or a pattern of strftime \
                  with the hour, and with the whole date or none of it (%d.%m.%Y %H:%M:%S); a \
                  fraction of the second is read in any case");
        DOUBTFUL "doubtful", said("true or false");
    }
    /// `[[runs]]` of `dataset.toml`.
    run "runs" {
        FILE "file", said("the path of a CSV or Parquet file");
        ROLE "role", said("a role");
        DIRECTION "direction", said("1 or -1");
        MASS TRAIN_MASS.name, NumberRule { is_required: false, ..TRAIN_MASS.rule };
        START "start_m", within(-1e9, 1e9, "a chainage in m");
        DATE "date", said("a day of the calendar, as 2026-03-18 or 2026-03-18T07:13:20");
    }
}

/// Tables of `train.toml`.
pub const TRAIN_TABLES: [&str; 6] = [
    train::TABLE,
    resistance::TABLE,
    traction::TABLE,
    brake::TABLE,
    corrections::TABLE,
    extra::TABLE,
];
/// Tables of `dataset.toml`.
pub const DATASET_TABLES: [&str; 5] =
    [dataset::TABLE, train_file::TABLE, track_file::TABLE, column::TABLE, run::TABLE];

/// Force of a brake or a drive.
pub(super) const FORCE_KN: NumberRule = within(0.0, 1e4, "a force in kN from 0 to 10000");
const EFFORT_POINT: &str = "[speed_mps, force kN]";
const PERMILLE: &str = "[chainage_m, permille]";

/// Refuses keys of a table that have no row.
pub(super) fn allow(section: &Item, keys: &[FileKey]) -> Result<(), DatasetError> {
    let names: Vec<&str> = keys.iter().map(|it| it.name).collect();
    section.allow(&names)
}

/// `name = value`, as a file says it.
pub fn assign(name: &str, value: impl Display) -> String {
    format!("{name} = {value}")
}

/// Returns a table of assignments within a line.
pub fn inline(assignments: impl IntoIterator<Item = String>) -> String {
    let all: Vec<String> = assignments.into_iter().collect();
    format!("{{ {} }}", all.join(", "))
}

/// Returns the numbers of a train in a table of `train.toml`.
pub fn numbers_of(table: &str) -> impl Iterator<Item = &'static Key> {
    NUMBERS.iter().copied().filter(move |it| it.table == table)
}
