//! Reader of `dataset.toml`.

use std::path::{Component, Path};

use dynocar_model::named;
use dynocar_model::units::Unit;

use super::clock::{self, TimeFormat};
use super::document::Item;
use super::error::{DatasetError, SourcePosition, unknown};
use super::keys::column::{COLUMN, DOUBTFUL, FORMAT, OFFSET, SCALE, UNIT};
use super::keys::dataset::{DESCRIPTION, NAME, POSITION_REFERENCE};
use super::keys::run::{DATE, DIRECTION, FILE, MASS, ROLE, START};
use super::keys::{self, DATASET_TABLES, FileKey, allow};
use super::node::Node;
use super::quantity::Quantity;
use super::text_layout::{TextLayout, TrainRows};

named! {
    /// Point of the train to which recorded positions refer.
    PositionReference ("in a dataset") {
        /// The train's centre.
        Centre "centre";
        /// The train's head: half a length ahead of the centre in the direction of travel.
        Head "head";
    }
}

named! {
    /// Role of a run.
    #[derive(serde::Serialize)]
    #[serde(rename_all = "snake_case")]
    Role ("in a dataset") {
        /// Models are fitted to it.
        Fit "fit";
        /// Read only to score a finished model.
        Holdout "holdout";
    }
}

/// A column of the runs' files and the quantity that it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnMapping {
    /// Quantity of the column.
    pub quantity: Quantity,
    /// Its name in the header, without surrounding spaces.
    pub column: String,
    /// Names of further columns in the same unit, which add up with it.
    pub parts: Vec<String>,
    /// True where `dynocar init` doubted the mapping and nobody has confirmed it.
    pub is_doubtful: bool,
    /// The unit of [`scaled`](Self::scaled) cells.
    pub unit: Unit,
    /// How the cells are written, where they are times and no numbers.
    pub format: Option<TimeFormat>,
    /// Factor on the cell.
    pub scale: f64,
    /// Added after the factor, in `unit`.
    pub offset: f64,
    /// Where the mapping is declared.
    pub place: SourcePosition,
}

impl ColumnMapping {
    /// Returns a column of times in s, which takes columns of numbers, too.
    pub fn of_time(column: &str) -> Self {
        ColumnMapping {
            quantity: Quantity::Time,
            column: column.into(),
            parts: Vec::new(),
            is_doubtful: false,
            unit: Quantity::Time.unit(),
            format: None,
            scale: 1.0,
            offset: 0.0,
            place: SourcePosition::whole(column),
        }
    }

    /// Returns the names of its columns.
    pub fn names(&self) -> impl Iterator<Item = &String> {
        std::iter::once(&self.column).chain(&self.parts)
    }

    /// Returns its columns for people, as `'a' + 'b'`.
    pub fn shown(&self) -> String {
        self.names().map(|name| format!("'{name}'")).collect::<Vec<_>>().join(" + ")
    }

    /// Returns a cell's number in [`unit`](Self::unit).
    pub fn scaled(&self, cell: f64) -> f64 {
        cell * self.scale + self.offset
    }

    /// Returns the quantity's unit, where the cells are in another.
    pub fn converted_to(&self) -> Option<Unit> {
        Some(self.quantity.unit()).filter(|unit| unit.name() != self.unit.name())
    }
}

/// A file that the dataset names.
#[derive(Clone, Debug, PartialEq)]
pub struct FileEntry {
    /// Its path, from the dataset's folder.
    pub path: String,
    /// Where it is named.
    pub place: SourcePosition,
}

/// A run as declared.
#[derive(Clone, Debug, PartialEq)]
pub struct RunEntry {
    /// Path of its file, from the dataset's folder.
    pub file: String,
    /// Role of the run.
    pub role: Role,
    /// 1 while the chainage grows, -1 while it falls.
    pub direction: i8,
    /// Declared gross mass of this run in kg.
    pub mass_kg: Option<f64>,
    /// Chainage in m at the run's start, for runs without a position column.
    pub start_m: Option<f64>,
    /// When it was recorded, in s since 1970 UTC, where that is declared.
    pub date_unix_s: Option<i64>,
    /// Where the run is declared.
    pub place: SourcePosition,
}

/// The content of a `dataset.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifest {
    /// Name of the dataset.
    pub name: String,
    /// Source, licence and the like.
    pub description: Option<String>,
    /// Which point of the train the positions are of.
    pub position_reference: PositionReference,
    /// How the text of the runs' files falls into cells.
    pub layout: TextLayout,
    /// The train's file.
    pub train_file: FileEntry,
    /// Which rows of the runs' files are the train's.
    pub train_rows: TrainRows,
    /// The line's file; `None` when the line is not known.
    pub track_file: Option<FileEntry>,
    /// The mapped columns, in the order of [`Quantity::ALL`].
    pub columns: Vec<ColumnMapping>,
    /// The runs, in the order of the file; never empty.
    pub runs: Vec<RunEntry>,
}

impl Manifest {
    /// Reads the text of a `dataset.toml`; `label` names the file in messages.
    ///
    /// # Errors
    ///
    /// Names file, line, key, value and the allowed values. Unknown keys are refused.
    pub fn parse(label: &str, text: &str) -> Result<Self, DatasetError> {
        let document = Node::of_toml(label, text)?;
        let root = Item::root(label, &document);
        root.allow(&DATASET_TABLES)?;
        let dataset = root.need_table(keys::dataset::TABLE)?;
        allow(&dataset, keys::dataset::KEYS)?;
        let columns = columns(&root.need_table(keys::column::TABLE)?)?;
        let train = root.need_table(keys::train_file::TABLE)?;
        allow(&train, keys::train_file::KEYS)?;
        let references = PositionReference::ALL.map(PositionReference::name);
        let named = PositionReference::from_name;
        let reference = POSITION_REFERENCE.named(&dataset, "reference", named, references)?;
        Ok(Manifest {
            name: NAME.need_quoted(&dataset)?.into(),
            description: DESCRIPTION.quoted(&dataset)?.map(Into::into),
            position_reference: reference.unwrap_or(PositionReference::Centre),
            layout: TextLayout::from_section(&dataset)?,
            train_file: file_of(&train, &keys::train_file::FILE)?,
            train_rows: TrainRows::from_train(&train)?,
            track_file: match root.table(keys::track_file::TABLE)? {
                Some(section) => {
                    allow(&section, keys::track_file::KEYS)?;
                    Some(file_of(&section, &keys::track_file::FILE)?)
                }
                None => None,
            },
            runs: runs(&root, &columns)?,
            columns,
        })
    }

    /// Returns the unit in which the runs hold the speed.
    pub fn speed_unit(&self) -> Unit {
        let mapped = self.mapping(Quantity::Speed);
        mapped.map_or(Quantity::Speed.unit(), |mapping| mapping.unit)
    }

    /// Returns the mapping of a quantity.
    pub fn mapping(&self, quantity: Quantity) -> Option<&ColumnMapping> {
        self.columns.iter().find(|mapping| mapping.quantity == quantity)
    }
}

fn file_of(section: &Item, key: &FileKey) -> Result<FileEntry, DatasetError> {
    Ok(FileEntry { path: key.need_quoted(section)?.into(), place: section.place_of(key.name) })
}

fn columns(section: &Item) -> Result<Vec<ColumnMapping>, DatasetError> {
    let mut mappings = Vec::new();
    for name in section.keys() {
        let quantity = Quantity::from_name(name).ok_or_else(|| {
            let names = Quantity::ALL.map(Quantity::name);
            let words = unknown("quantity", name, " in [columns]", names);
            section.place_of(name).problem(words)
        })?;
        mappings.push(mapping(section, quantity)?);
    }
    mappings.sort_by_key(|mapping| mapping.quantity);
    for quantity in [Quantity::Time, Quantity::Speed] {
        if mappings.iter().all(|mapping| mapping.quantity != quantity) {
            let either = match quantity {
                Quantity::Time => format!(" or {}", keys::inline([COLUMN, FORMAT].map(of_any))),
                _ => String::new(),
            };
            let expected = keys::inline([COLUMN, UNIT].map(of_any)) + &either;
            section.need(quantity.name(), &expected)?;
        }
    }
    require_own_columns(&mappings)?;
    let is_mapped =
        |quantity: Quantity| mappings.iter().any(|mapping| mapping.quantity == quantity);
    for other in [
        Quantity::TractionForce,
        Quantity::BrakeForce,
        Quantity::TractionHandle,
        Quantity::BrakeHandle,
    ] {
        if is_mapped(Quantity::ControlForce) && is_mapped(other) {
            return Err(section.exclusive(Quantity::ControlForce.name(), other.name()));
        }
    }
    Ok(mappings)
}

/// Refuses a column that is taken for two quantities.
fn require_own_columns(mappings: &[ColumnMapping]) -> Result<(), DatasetError> {
    for (at, mapping) in mappings.iter().enumerate() {
        for name in mapping.names() {
            let twin = mappings[..at].iter().find(|other| other.names().any(|it| it == name));
            let Some(twin) = twin else { continue };
            let words = format!(
                "column '{name}' is mapped to {} and to {}: expected a column of its own for each; a force that \
                 is negative while the train brakes is a control_force",
                twin.quantity, mapping.quantity
            );
            return Err(mapping.place.clone().problem(words));
        }
    }
    Ok(())
}

fn mapping(columns: &Item, quantity: Quantity) -> Result<ColumnMapping, DatasetError> {
    let section = columns.need(quantity.name(), "a table")?;
    if !section.is_map() {
        let unit = UNIT.assign(format!("\"{}\"", quantity.unit().name()));
        return Err(section.wrong_type(&keys::inline([of_any(COLUMN), unit])));
    }
    let is_time = quantity == Quantity::Time;
    let known = keys::column::KEYS.iter().filter(|it| is_time || it.name != FORMAT.name);
    allow(&section, &known.copied().collect::<Vec<_>>())?;
    let format = if is_time { time_format(&section)? } else { None };
    let unit = match format {
        Some(_) => Unit::base_of(quantity.dimension()),
        None => unit(&section, quantity)?,
    };
    let mut names = columns_of(&section, quantity)?.into_iter();
    let scale = section.checked_under(SCALE.name, SCALE.rule.allowed, |it| it != 0.0)?;
    Ok(ColumnMapping {
        quantity,
        column: names.next().unwrap_or_default(),
        parts: names.collect(),
        is_doubtful: section.truth(DOUBTFUL.name)?.unwrap_or(false),
        unit,
        format,
        scale: scale.unwrap_or(1.0),
        offset: OFFSET.number(&section)?.unwrap_or(0.0),
        place: section.place(),
    })
}

/// Returns an assignment of any value, for messages.
fn of_any(key: FileKey) -> String {
    key.assign("\"…\"")
}

/// Returns the columns of a quantity: one, or several that add up.
fn columns_of(section: &Item, quantity: Quantity) -> Result<Vec<String>, DatasetError> {
    let expected = match quantity.adds_up() {
        true => format!("{}, or a list of names of columns that add up", COLUMN.rule.allowed),
        false => COLUMN.rule.allowed.into(),
    };
    let (key, expected) = (COLUMN.name, &expected[..]);
    let item = section.need(key, expected)?;
    if !(quantity.adds_up() && item.is_list()) {
        // Tables of pandas have an index without a name.
        section.need(key, expected)?;
        return Ok(vec![section.quoted(key)?.unwrap_or_default().trim().into()]);
    }
    let names =
        item.list(expected, 1)?.into_iter().map(|name| Ok(name.text(expected)?.trim().into()));
    let names: Vec<String> = names.collect::<Result<_, DatasetError>>()?;
    match names.iter().enumerate().find(|(at, name)| names[..*at].contains(name)) {
        Some((_, name)) => Err(item.wrong(format!("column '{name}' is named twice"))),
        None => Ok(names),
    }
}

fn unit(section: &Item, quantity: Quantity) -> Result<Unit, DatasetError> {
    let units: Vec<_> = Unit::of(quantity.dimension()).map(|unit| unit.name()).collect();
    let or_format = if quantity == Quantity::Time { "; or a format" } else { "" };
    let expected = format!("{}: {}{or_format}", UNIT.rule.allowed, units.join(", "));
    let find = |name: &str| Unit::find(quantity.dimension(), name);
    section.need_named(UNIT.name, ("unit", &expected), find, units)
}

/// Returns how times are written that are no numbers.
fn time_format(section: &Item) -> Result<Option<TimeFormat>, DatasetError> {
    let Some(name) = FORMAT.quoted(section)? else { return Ok(None) };
    for other in [UNIT, SCALE, OFFSET] {
        if section.has(other.name) {
            return Err(section.exclusive(FORMAT.name, other.name));
        }
    }
    let refused = || FORMAT.refused(section, format_args!("{name:?}"));
    TimeFormat::from_name(name).map(Some).ok_or_else(refused)
}

fn runs(root: &Item, columns: &[ColumnMapping]) -> Result<Vec<RunEntry>, DatasetError> {
    let mut runs: Vec<RunEntry> = Vec::new();
    for section in root.tables(keys::run::TABLE)? {
        let run = run(&section)?;
        let has_date = |it: &ColumnMapping| it.format.as_ref().is_some_and(TimeFormat::has_date);
        if run.date_unix_s.is_some() && columns.iter().any(has_date) {
            let (words, date) = ("exclude each other: give one of them", section.full(DATE.name));
            let problem = format!("{date} and columns.time.format with a date {words}");
            return Err(section.place_of(DATE.name).problem(problem));
        }
        let twin = runs.iter().find(|other| is_same_path(&other.file, &run.file));
        if let Some(first_line) = twin.and_then(|twin| twin.place.line) {
            let key = section.full(FILE.name);
            let words = format!("{key}: {} is listed in line {first_line} already", run.file);
            return Err(section.place_of(FILE.name).problem(words));
        }
        runs.push(run);
    }
    if runs.is_empty() {
        let words = "missing key runs: expected at least one [[runs]] table";
        return Err(root.place().problem(words));
    }
    Ok(runs)
}

/// Returns true for two spellings of one path, as `1.csv` and `./1.csv`.
fn is_same_path(one: &str, other: &str) -> bool {
    let parts = |path| Path::new(path).components().filter(|part| *part != Component::CurDir);
    parts(one).eq(parts(other))
}

fn run(section: &Item) -> Result<RunEntry, DatasetError> {
    allow(section, keys::run::KEYS)?;
    let role = ROLE.named(section, "role", Role::from_name, Role::ALL.map(Role::name))?;
    let (key, allowed) = (DIRECTION.name, DIRECTION.rule.allowed);
    let direction = section.checked_under(key, allowed, |it| it.abs() == 1.0)?;
    Ok(RunEntry {
        file: FILE.need_quoted(section)?.into(),
        role: role.unwrap_or(Role::Fit),
        direction: if direction == Some(-1.0) { -1 } else { 1 },
        mass_kg: MASS.number(section)?.map(|mass_t| mass_t * MASS.rule.factor),
        start_m: START.number(section)?,
        date_unix_s: date(section)?,
        place: section.place(),
    })
}

/// Returns the second at which a run's date begins.
fn date(section: &Item) -> Result<Option<i64>, DatasetError> {
    let Some(date) = section.datetime(DATE.name)? else { return Ok(None) };
    let refused = || DATE.refused(section, date);
    clock::unix_s(&date).map(Some).ok_or_else(refused)
}

#[cfg(test)]
mod tests;
