//! `dataset.toml`.

use std::path::{Component, Path};

use dynocar_model::named;
use dynocar_model::units::Unit;

use super::clock::{self, TimeFormat};
use super::document::{Document, Section};
use super::error::{DatasetError, Problem, SourcePosition};
use super::names::Choices;
use super::quantity::Quantity;
use super::text_layout::TextLayout;

/// Which point of the train the recorded position is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PositionReference {
    /// The train's centre.
    Centre,
    /// The train's head: half a length ahead of the centre in the direction of travel.
    Head,
}

named! {
    /// What a run is for.
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
    /// What it holds.
    pub quantity: Quantity,
    /// Its name in the header, without surrounding spaces.
    pub column: String,
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
    /// A cell's number in [`unit`](Self::unit).
    pub fn scaled(&self, cell: f64) -> f64 {
        cell * self.scale + self.offset
    }

    /// The quantity's unit, where the cells are in another.
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
    /// What it is for.
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
    /// Names file, line, key, value and what was allowed. Unknown keys are refused.
    pub fn parse(label: &str, text: &str) -> Result<Self, DatasetError> {
        let document = Document::parse(label, text)?;
        let root = document.root();
        root.allow(&["dataset", "train", "track", "columns", "runs"])?;
        let dataset = root.required_table("dataset")?;
        let own = ["name", "description", "position_reference"];
        dataset.allow(&[&own[..], &TextLayout::KEYS[..]].concat())?;
        let columns = columns(&root.required_table("columns")?)?;
        Ok(Manifest {
            name: dataset.required_text("name", "the dataset's name")?.into(),
            description: dataset.text("description")?.map(Into::into),
            position_reference: position_reference(&dataset)?,
            layout: TextLayout::of(&dataset)?,
            train_file: file_of(&root.required_table("train")?, "the path of a train.toml")?,
            track_file: match root.table("track")? {
                Some(section) => Some(file_of(&section, "the path of a track.toml")?),
                None => None,
            },
            runs: runs(&root, &columns)?,
            columns,
        })
    }

    /// The unit in which the runs hold the speed.
    pub fn speed_unit(&self) -> Unit {
        let mapped = self.mapping(Quantity::Speed);
        mapped.map_or(Quantity::Speed.unit(), |mapping| mapping.unit)
    }

    /// The mapping of a quantity.
    pub fn mapping(&self, quantity: Quantity) -> Option<&ColumnMapping> {
        self.columns.iter().find(|mapping| mapping.quantity == quantity)
    }
}

fn file_of(section: &Section, expected: &str) -> Result<FileEntry, DatasetError> {
    section.allow(&["file"])?;
    let path = section.required_text("file", expected)?.into();
    Ok(FileEntry { path, place: section.place_of("file") })
}

fn position_reference(section: &Section) -> Result<PositionReference, DatasetError> {
    const KEY: &str = "position_reference";
    match section.text(KEY)? {
        None | Some("centre") => Ok(PositionReference::Centre),
        Some("head") => Ok(PositionReference::Head),
        Some(word) => Err(section.unknown(KEY, "reference", word, &["centre", "head"])),
    }
}

fn columns(section: &Section) -> Result<Vec<ColumnMapping>, DatasetError> {
    let mut mappings = Vec::new();
    for (name, place) in section.keys() {
        let Some(quantity) = Quantity::from_name(name) else {
            let choices = Choices::new(name, Quantity::ALL.map(Quantity::name));
            let (what, context) = ("quantity", " in [columns]".into());
            let name = name.into();
            return Err(place.problem(Problem::UnknownName { what, name, context, choices }));
        };
        mappings.push(mapping(section, quantity)?);
    }
    mappings.sort_by_key(|mapping| mapping.quantity);
    for quantity in [Quantity::Time, Quantity::Speed] {
        if mappings.iter().all(|mapping| mapping.quantity != quantity) {
            let expected = match quantity {
                Quantity::Time => {
                    "{ column = \"…\", unit = \"…\" } or { column = \"…\", format = \"…\" }"
                }
                _ => "{ column = \"…\", unit = \"…\" }",
            };
            return Err(section.missing(quantity.name(), expected));
        }
    }
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

fn mapping(columns: &Section, quantity: Quantity) -> Result<ColumnMapping, DatasetError> {
    let section = columns.required_table(quantity.name())?;
    let format = match quantity {
        Quantity::Time => {
            section.allow(&["column", "unit", "scale", "offset", "format"])?;
            time_format(&section)?
        }
        _ => {
            section.allow(&["column", "unit", "scale", "offset"])?;
            None
        }
    };
    let unit = match format {
        Some(_) => Unit::base_of(quantity.dimension()),
        None => unit(&section, quantity)?,
    };
    let column = section.required_text("column", "the name of a column in the runs' files")?;
    Ok(ColumnMapping {
        quantity,
        column: column.trim().into(),
        unit,
        format,
        scale: section
            .number("scale", "a number other than 0", |scale| scale != 0.0)?
            .unwrap_or(1.0),
        offset: section.number("offset", "a finite number", |_| true)?.unwrap_or(0.0),
        place: section.place(),
    })
}

fn unit(section: &Section, quantity: Quantity) -> Result<Unit, DatasetError> {
    let units: Vec<_> = Unit::of(quantity.dimension()).map(|unit| unit.name()).collect();
    let or_format = if quantity == Quantity::Time { "; or a format" } else { "" };
    let expected = format!("a unit: {}{or_format}", units.join(", "));
    let unit = section.required_text("unit", &expected)?;
    Unit::find(quantity.dimension(), unit)
        .ok_or_else(|| section.unknown("unit", "unit", unit, &units))
}

/// How times are written that are no numbers.
fn time_format(section: &Section) -> Result<Option<TimeFormat>, DatasetError> {
    const KEY: &str = "format";
    let Some(name) = section.text(KEY)? else { return Ok(None) };
    for other in ["unit", "scale", "offset"] {
        if section.has(other) {
            return Err(section.exclusive(KEY, other));
        }
    }
    let allowed = "\"iso\" (2026-03-18T07:13:20.2), \"clock\" (07:13:20.2) or a pattern of strftime \
                   with the hour, and with the whole date or none of it (%d.%m.%Y %H:%M:%S); a \
                   fraction of the second is read in any case";
    let refused = || section.out_of_range(KEY, &format!("{name:?}"), allowed);
    TimeFormat::from_name(name).map(Some).ok_or_else(refused)
}

fn runs(root: &Section, columns: &[ColumnMapping]) -> Result<Vec<RunEntry>, DatasetError> {
    let mut runs: Vec<RunEntry> = Vec::new();
    for section in root.tables("runs")? {
        let run = run(&section)?;
        let has_date = |it: &ColumnMapping| it.format.as_ref().is_some_and(TimeFormat::has_date);
        if run.date_unix_s.is_some() && columns.iter().any(has_date) {
            let (key, other) = (section.full("date"), "columns.time.format with a date".into());
            return Err(section.place_of("date").problem(Problem::Exclusive { key, other }));
        }
        let twin = runs.iter().find(|other| is_same_path(&other.file, &run.file));
        if let Some(first_line) = twin.and_then(|twin| twin.place.line) {
            let (key, file) = (section.full("file"), run.file);
            let problem = Problem::RepeatedRun { key, file, first_line };
            return Err(section.place_of("file").problem(problem));
        }
        runs.push(run);
    }
    if runs.is_empty() {
        Err(root.missing("runs", "at least one [[runs]] table"))
    } else {
        Ok(runs)
    }
}

/// True for two spellings of one path, as `1.csv` and `./1.csv`.
fn is_same_path(one: &str, other: &str) -> bool {
    let parts = |path| Path::new(path).components().filter(|part| *part != Component::CurDir);
    parts(one).eq(parts(other))
}

fn run(section: &Section) -> Result<RunEntry, DatasetError> {
    section.allow(&["file", "role", "direction", "mass_t", "start_m", "date"])?;
    let role = match section.text("role")? {
        None => Role::Fit,
        Some(word) => Role::from_name(word)
            .ok_or_else(|| section.unknown("role", "role", word, &Role::ALL.map(Role::name)))?,
    };
    let direction = section.number("direction", "1 or -1", |direction| direction.abs() == 1.0)?;
    let mass_t = section.number("mass_t", "a mass in t above 0, at most 100000", |mass| {
        mass > 0.0 && mass <= 1e5
    })?;
    Ok(RunEntry {
        file: section.required_text("file", "the path of a CSV or Parquet file")?.into(),
        role,
        direction: if direction == Some(-1.0) { -1 } else { 1 },
        mass_kg: mass_t.map(|mass| mass * 1000.0),
        start_m: section.number("start_m", "a chainage in m", |start| start.abs() <= 1e9)?,
        date_unix_s: date(section)?,
        place: section.place(),
    })
}

/// The second at which a run's date begins.
fn date(section: &Section) -> Result<Option<i64>, DatasetError> {
    let Some(date) = section.datetime("date")? else { return Ok(None) };
    let allowed = "a day of the calendar, as 2026-03-18 or 2026-03-18T07:13:20";
    let refused = || section.out_of_range("date", &date.to_string(), allowed);
    clock::unix_s(&date).map(Some).ok_or_else(refused)
}

#[cfg(test)]
mod tests;
