//! Writers of `train.toml`, `track.toml` and `dataset.toml`: new texts, key by key, and changes in declared files.

use std::fmt::{Display, Write as _};

use dynocar_model::terms::extra::{CovariateFactor, ExtraResistance};
use dynocar_model::terms::{Key, ModelEntry};
use toml::{Table, Value};

use super::keys::{self, FileKey, extra, factor, track};
use super::quantity::Quantity;

/// The text of a file that is being written.
#[derive(Clone, Debug)]
pub struct TomlText {
    text: String,
}

impl TomlText {
    /// Begins with comments, which end with a line break, and a table.
    pub fn new(head: &str, table: &str) -> Self {
        TomlText { text: format!("{head}[{table}]\n") }
    }

    /// Adds lines as they are, with their ends.
    pub fn lines(&mut self, lines: &str) {
        self.text += lines;
    }

    /// Begins another table.
    pub fn table(&mut self, table: &str) {
        self.line(format_args!("[{table}]"));
    }

    /// Begins the next table of a list.
    pub fn next_table(&mut self, list: &str) {
        self.line(format_args!("[[{list}]]"));
    }

    /// Adds a key with its value as TOML.
    pub fn value(&mut self, key: &FileKey, value: impl Display) {
        self.line(key.assign(value));
    }

    /// Adds a key with its value as TOML and a comment.
    pub fn noted(&mut self, key: &FileKey, value: impl Display, note: &str) {
        self.line(format_args!("{:<31}# {note}", key.assign(value)));
    }

    /// Proposes a key with its value as TOML and a comment.
    pub fn suggested(&mut self, key: &FileKey, value: impl Display, note: &str) {
        self.line(format_args!("# {:<29}# {note}", key.assign(value)));
    }

    /// Adds a list of entries, each the values between its brackets.
    pub fn list(&mut self, key: &FileKey, entries: impl Iterator<Item = String>) {
        self.line(key.assign("["));
        entries.for_each(|entry| self.line(format_args!("  [{entry}],")));
        self.text += "]\n";
    }

    /// Adds the column of a quantity by the assignments of its table.
    pub fn column(&mut self, quantity: Quantity, assignments: impl IntoIterator<Item = String>) {
        self.line(keys::assign(quantity.name(), keys::inline(assignments)));
    }

    /// Adds the column of a quantity of this name, in a unit.
    pub fn plain_column(&mut self, quantity: Quantity, column: &str, unit: &str) {
        let quoted = |text: &str| format!("\"{text}\"");
        let (column, unit) = (quoted(column), quoted(unit));
        self.column(
            quantity,
            [keys::column::COLUMN.assign(column), keys::column::UNIT.assign(unit)],
        );
    }

    fn line(&mut self, line: impl Display) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{line}");
    }

    /// Returns the text.
    pub fn into_text(self) -> String {
        self.text
    }
}

/// Returns true for an entry that the files may hold in addition to their present entries.
pub fn can_hold(entry: &ModelEntry, train: &Table, track: &Table) -> bool {
    match entry {
        ModelEntry::Number(key, found) => key.rule.allows(joined(key, train, *found)),
        ModelEntry::Extra(_) | ModelEntry::TrackNumber(..) | ModelEntry::Rows(..) => true,
        // Such a list stands alone.
        ModelEntry::List(name, _) => {
            track.get(track::TABLE).and_then(|own| own.get(name)).is_none()
        }
    }
}

/// Adds an entry to the files.
pub fn write_entry(entry: ModelEntry, train: &mut Table, track: &mut Table) {
    match entry {
        ModelEntry::Number(key, found) => set(train, key, joined(key, train, found)),
        ModelEntry::Extra(found) => {
            let tables = train.entry(extra::TABLE).or_insert_with(|| Value::Array(Vec::new()));
            if let Some(tables) = tables.as_array_mut() {
                tables.push(Value::Table(extra_table(&found)));
            }
        }
        ModelEntry::TrackNumber(name, found) => {
            let declared = number(track, track::TABLE, name).unwrap_or(0.0);
            insert(track, track::TABLE, name, Value::Float(declared + found));
        }
        ModelEntry::Rows(name, rows) | ModelEntry::List(name, rows) => {
            if let Some(list) = track_list(track, name) {
                list.extend(rows.into_iter().map(Value::from));
            }
        }
    }
}

/// Returns a table of `[[extra]]`.
fn extra_table(found: &ExtraResistance) -> Table {
    let of_factor = |it: &CovariateFactor| {
        let named = [(factor::OF, it.of.name()), (factor::FORM, it.form.name())];
        let named = named.map(|(key, name)| (key.name.into(), name.into()));
        let numbers = it.form.numbers().iter().zip(it.numbers);
        let numbers = numbers.map(|(name, number)| ((*name).into(), Value::Float(number)));
        Value::Table(named.into_iter().chain(numbers).collect())
    };
    let factors = found.factors.iter().map(of_factor).collect();
    Table::from_iter([
        (extra::FORCE.name.into(), Value::Float(found.n_per_kn)),
        (extra::FACTORS.name.into(), Value::Array(factors)),
    ])
}

/// Returns a number that was found with the one that stands in the file.
fn joined(key: &Key, train: &Table, found: f64) -> f64 {
    number(train, key.table, key.name).map_or(found, |declared| key.rule.join(declared, found))
}

/// Returns a list of `[track]`, made when absent.
fn track_list<'t>(track: &'t mut Table, key: &str) -> Option<&'t mut Vec<Value>> {
    let section = track.entry(track::TABLE).or_insert_with(|| Value::Table(Table::new()));
    section.as_table_mut()?.entry(key).or_insert_with(|| Value::Array(Vec::new())).as_array_mut()
}

fn number(table: &Table, section: &str, key: &str) -> Option<f64> {
    let value = table.get(section)?.get(key)?;
    value.as_float().or_else(|| value.as_integer().map(|it| it as f64))
}

/// Sets a number in its table, which is made when absent.
pub fn set(file: &mut Table, key: &Key, value: f64) {
    insert(file, key.table, key.name, Value::Float(value));
}

fn insert(file: &mut Table, table: &str, key: &str, value: Value) {
    let entry = file.entry(table).or_insert_with(|| Value::Table(Table::new()));
    if let Value::Table(section) = entry {
        section.insert(key.into(), value);
    }
}

/// Names the files of train and, where there is one, line in a `dataset.toml`.
pub fn name_model(manifest: &mut Table, train: &str, track: Option<&str>) {
    let file =
        |key: FileKey, name: &str| Value::Table(Table::from_iter([(key.name.into(), name.into())]));
    manifest.insert(keys::train_file::TABLE.into(), file(keys::train_file::FILE, train));
    match track {
        Some(name) => {
            manifest.insert(track::TABLE.into(), file(keys::track_file::FILE, name));
        }
        None => {
            manifest.remove(track::TABLE);
        }
    }
}

/// Returns the files of the runs in a `dataset.toml`.
pub fn run_files(manifest: &mut Table) -> impl Iterator<Item = &mut String> {
    let runs = manifest.get_mut(keys::run::TABLE).and_then(Value::as_array_mut);
    runs.into_iter().flatten().filter_map(|run| text_of(run.get_mut(keys::run::FILE.name)?))
}

/// Returns the files of the ways on the map in a `track.toml`.
pub fn alignment_files(file: &mut Table) -> impl Iterator<Item = &mut String> {
    let section = file.get_mut(track::TABLE).and_then(Value::as_table_mut);
    let own = [track::ALIGNMENT.name, track::ALIGNMENT_FALLING.name];
    let values = section.into_iter().flatten().filter(move |(key, _)| own.contains(&key.as_str()));
    values.filter_map(|(_, value)| text_of(value))
}

fn text_of(value: &mut Value) -> Option<&mut String> {
    match value {
        Value::String(text) => Some(text),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use dynocar_model::terms::{gradient, place, traction, wind};

    use super::*;

    #[test]
    fn a_finding_joins_what_is_declared_by_the_rule_of_its_key() {
        let declared = "[corrections]\ntraction_gain = 1.1\nwind_plus_mps = 2";
        let (mut train, mut track): (Table, Table) = (declared.parse().unwrap(), Table::new());
        write_entry(ModelEntry::Number(&traction::GAIN, 0.9), &mut train, &mut track);
        write_entry(ModelEntry::Number(&wind::WIND_PLUS, 3.0), &mut train, &mut track);
        assert_eq!(train["corrections"]["traction_gain"], Value::Float(1.1 * 0.9));
        assert_eq!(train["corrections"]["wind_plus_mps"], Value::Float(5.0));
        assert!(track.is_empty());
    }

    #[test]
    fn what_belongs_to_the_line_makes_its_file_where_there_is_none() {
        let (mut train, mut track) = (Table::new(), Table::new());
        let entry = ModelEntry::Rows(place::LIST, vec![vec![1000.0, 2000.0, 1.5]]);
        assert!(can_hold(&entry, &train, &track));
        write_entry(entry, &mut train, &mut track);
        let expected: Table = "[track]\nresistance = [[1000.0, 2000.0, 1.5]]".parse().unwrap();
        assert_eq!(track, expected);
    }

    #[test]
    fn what_no_file_may_hold_is_not_written() {
        let (train, track) = (Table::new(), Table::new());
        assert!(can_hold(&ModelEntry::Number(&traction::GAIN, 1.4), &train, &track));
        assert!(!can_hold(&ModelEntry::Number(&traction::GAIN, 2.4), &train, &track));
        let list = ModelEntry::List(gradient::ERROR, Vec::new());
        assert!(can_hold(&list, &train, &track));
        let track = "[track]\ngradient_error = [[0.0, 1.0]]".parse().unwrap();
        assert!(!can_hold(&list, &train, &track));
    }
}
