//! Contents of a run's file: rows of text, or columns of numbers.

/// Contents of a run's file.
#[derive(Clone, Debug, PartialEq)]
pub enum RunContent {
    /// Rows of text, laid out as the manifest says.
    Text(String),
    /// The columns of a file of Parquet.
    Columns(RunColumns),
}

/// The columns of a run's file that is no text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunColumns {
    /// All of them. Where a mapped one is not there, none has values.
    pub columns: Vec<RunColumn>,
    /// The one that says whose the rows are.
    pub trains: Option<TrainColumn>,
}

/// A column of a run's file that is no text.
#[derive(Clone, Debug, PartialEq)]
pub struct RunColumn {
    /// Its name.
    pub name: String,
    /// A mapped column's numbers, times in the unit that is declared for them; `NaN` where missing.
    pub values: Option<Vec<f64>>,
}

/// The column of a run's file that says whose the rows are.
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
