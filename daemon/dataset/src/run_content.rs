//! Contents of a run's file: rows of text, or columns of numbers.

/// Contents of a run's file.
#[derive(Clone, Debug, PartialEq)]
pub enum RunContent {
    /// Rows of text, in the layout of the manifest.
    Text(String),
    /// The columns of a file of Parquet.
    Columns(RunColumns),
}

/// The columns of a run's file that is no text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunColumns {
    /// All columns. Where a mapped one is missing, no column has values.
    pub columns: Vec<RunColumn>,
    /// The column that names the train of each row.
    pub trains: Option<TrainColumn>,
}

/// A column of a run's file that is no text.
#[derive(Clone, Debug, PartialEq)]
pub struct RunColumn {
    /// Its name.
    pub name: String,
    /// The numbers of a mapped column, with times in their declared unit; `NaN` where missing.
    pub values: Option<Vec<f64>>,
}

/// The column of a run's file that names the train of each row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainColumn {
    /// Its name.
    pub name: String,
    /// The trains' names.
    pub trains: Vec<String>,
    /// The place of each row's train among them; `NaN` where none is named.
    pub rows: Vec<f64>,
}

impl TrainColumn {
    /// Returns the name of each row's train, empty where none is named.
    pub fn cells(&self) -> impl Iterator<Item = &str> {
        let name = |&place: &f64| self.trains.get(place as usize).filter(|_| !place.is_nan());
        self.rows.iter().map(move |place| name(place).map_or("", String::as_str))
    }
}
